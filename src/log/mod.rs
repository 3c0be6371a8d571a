//! A controller's log → [`RawTouch`] records with their line numbers → touches matched to the plan.

pub mod touch;
pub use touch::{RawTouch, Status, Touch};
