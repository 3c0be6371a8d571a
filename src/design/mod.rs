//! What touches would tell, before they are made, and which further touches would tell more.
//!
//! [`View`] is a plan linearised at an errorless machine; [`habits()`] are variations of its touches as data, each with what
//! it costs; [`assess()`] says what a plan will be able to tell (`axiscal-assessment/1`); [`explain()`] names the touches
//! that part what a fit cannot tell apart. All verdicts are computed from the varied touches, none is looked up.

mod assess;
pub mod bundle;
mod explain;
pub mod habits;
pub mod next;
pub mod questions;
pub mod record;
mod score;
mod shapes;
pub mod vary;
pub mod view;

pub use assess::{Request, assess};
pub use explain::explain;
pub use habits::{Habit, habits};
pub use view::{Known, Made, Noise, Planned, Room, Task, View, keep_measured};
