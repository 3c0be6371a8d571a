//! LinuxCNC's RS274/NGC, as far as our programs use it.

mod comments;
mod control;
mod parse;

pub use control::Ngc;
pub use parse::parse;
