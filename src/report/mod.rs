//! What a person sees in the terminal: formats, never computes.

pub mod diagnosis;
pub mod compare;
pub mod assess;
pub mod fit;
pub mod ladder;
pub mod plot;
