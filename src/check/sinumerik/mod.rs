//! SINUMERIK 840D sl and ONE: the part of their language that our programs use.

mod control;
mod expression;
mod parse;
mod words;

pub use control::Sinumerik;
pub use parse::parse;
