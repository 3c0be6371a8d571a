//! Custom macro B of Fanuc, and the macros of Haas, as far as our programs use them.

mod control;
mod lasting;
mod machine_builder;
mod parse;

pub use control::MacroB;
pub use parse::parse;
