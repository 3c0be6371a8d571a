//! Custom macro B of Fanuc, and the macros of Haas, as far as our programs use them.

mod control;
mod leftover_modes;
mod machine_builder;
mod parse;

pub use control::MacroB;
pub use parse::parse;
