//! Facts of logs and their touches.

use crate::log::LogMistake;
use crate::model::data::UnusableReason;

/// A mistake, after "would be right if".
pub(crate) fn mistake(mistake: &LogMistake) -> String {
    match mistake {
        LogMistake::Sign(axes) => {
            let names: Vec<String> = axes.iter().map(ToString::to_string).collect();
            format!("the sign of {} were the other one", names.join(" and "))
        }
        LogMistake::Exchanged(a, b) => {
            let (first, second) = if a.index() < b.index() { (a, b) } else { (b, a) };
            format!("the columns {first} and {second} were exchanged")
        }
        LogMistake::ExchangedXyz => "the columns X, Y and Z were exchanged".to_owned(),
        LogMistake::Inches => "the numbers were inches".to_owned(),
        LogMistake::Millimetres => "the numbers were millimetres".to_owned(),
        LogMistake::Shift { by_mm, inches } => {
            let inches = if *inches { "the numbers were inches, and then " } else { "" };
            format!("{inches}all were shifted by X {:.3} Y {:.3} Z {:.3} mm", by_mm.x, by_mm.y, by_mm.z)
        }
    }
}

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
