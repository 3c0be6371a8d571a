//! What a person sees in the terminal: formats, never computes.

pub mod compare;
pub mod fit;
pub mod ladder;
pub mod plot;
