//! What a person sees in the terminal: formats, never computes.

pub mod assess;
pub mod fit;
