//! Klartext of HEIDENHAIN controls, as far as our programs use it, and the masks by which they write.

mod control;
mod formula;
mod masks;
mod parse;
mod scan;

pub use control::Heidenhain;
pub use masks::{Masks, wanted};
pub use parse::parse;
