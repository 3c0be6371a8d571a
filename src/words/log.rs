//! Facts of logs and their touches.

use crate::model::data::UnusableReason;

/// Why a touch cannot be used.
pub(crate) fn unusable(reason: &UnusableReason) -> String {
    match reason {
        UnusableReason::NotInPlan => "the plan has no touch of this number".to_owned(),
        UnusableReason::NoTrigger => "the probe did not trigger".to_owned(),
        UnusableReason::FarFromPlan => "far from the planned position".to_owned(),
        UnusableReason::NotANumber => "a position is not a number".to_owned(),
        UnusableReason::NoSuchBlock { carrier, block } => format!("the plan has no block {block:?} on {carrier}"),
    }
}
