//! The touches CSV of the contract (`controller = "csv"`), every number with all its digits.

use crate::axes::AxisName;
use crate::log::{RawTouch, Status};
use crate::machine::Machine;
use std::fmt::Write;

/// `id,X,…,status` with a header line; the machine's axes, time and temperature where they are known.
#[must_use]
pub fn text(machine: &Machine, touches: &[RawTouch]) -> String {
    let axes: Vec<AxisName> = AxisName::ALL.into_iter().filter(|&a| machine.axis(a).is_some()).collect();
    let timed = touches.iter().any(|t| t.time_s.is_some());
    let measured = touches.iter().any(|t| t.temperature_deg_c.is_some());
    let mut out = String::from("id");
    for axis in &axes {
        let _ = write!(out, ",{axis}");
    }
    out.push_str(if timed { ",time_s" } else { "" });
    out.push_str(if measured { ",temperature_degC" } else { "" });
    out.push_str(",status\n");
    for touch in touches {
        if let Some(id) = touch.id {
            let _ = write!(out, "{id}");
        }
        for &axis in &axes {
            // shortest text that reads back as the same number
            let _ = write!(out, ",{}", touch.position.get(axis));
        }
        for (wanted, value) in [(timed, touch.time_s), (measured, touch.temperature_deg_c)] {
            if wanted {
                out.push(',');
                if let Some(value) = value {
                    let _ = write!(out, "{value}");
                }
            }
        }
        out.push_str(if touch.status == Status::Hit { ",hit\n" } else { ",miss\n" });
    }
    out
}
