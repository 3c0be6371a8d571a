//! What a person sees in the terminal: formats, never computes.

pub mod diagnosis;
pub mod fit;
