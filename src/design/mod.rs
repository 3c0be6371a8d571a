//! What touches would tell, before they are made, and which further touches would tell more.
//!
//! [`LinearisedPlan`] is a plan linearised at an errorless machine; [`variations()`] are variations of its touches as data, each with what
//! it costs; [`assess()`] says what a plan will be able to tell (`axiscal-assessment/1`); [`explain()`] names the touches
//! that part what a fit cannot tell apart. All verdicts are computed from the varied touches, none is looked up.

mod assess;
pub mod auto_plan;
pub mod bundle;
pub mod choose_touches;
mod explain;
pub mod linearised_plan;
pub mod plan_variations;
pub mod questions;
pub mod record;
mod score;
mod shape_parameters;
pub mod vary;
pub mod worth;

pub use assess::{Request, assess};
pub use explain::explain;
pub use linearised_plan::{Known, LinearisedPlan, Made, Noise, Planned, Room, Task, keep_measured};
pub use plan_variations::{Variation, variations};
