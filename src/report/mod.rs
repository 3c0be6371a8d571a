//! What a person sees in the terminal: formats, never computes.

pub mod assess;
mod canvas;
pub mod compare;
pub mod diagnosis;
pub mod fit;
pub mod ladder;
pub mod lay;
pub mod plot;
pub mod prose;
