//! The touches of the virtual machine as the control would have written them.

use crate::log::{self, RawTouch, Touch};
use crate::machine::Machine;
use crate::post::{LogRecord, Postprocessor};
use crate::program::plan::Plan;

/// The log of a control, or a touches CSV where none is named. Every simulated touch has its number.
#[must_use]
pub fn simulated_log(machine: &Machine, plan: &Plan, touches: &[RawTouch], post: Option<&Postprocessor>) -> String {
    log_of_program(machine, plan, touches, None, post)
}

/// The same of a program that found its artefact so far off its place, mm along X, Y and Z.
#[must_use]
pub fn log_of_program(
    machine: &Machine,
    plan: &Plan,
    touches: &[RawTouch],
    found_mm: Option<[f64; 3]>,
    post: Option<&Postprocessor>,
) -> String {
    let Some(post) = post else {
        let touch = |t: &RawTouch| {
            let RawTouch { position, status, time_s, temperature_deg_c, line, .. } = *t;
            Some(Touch { id: t.id?, position, status, time_s, digit_mm: None, temperature_deg_c, line })
        };
        return log::csv::write(machine, &touches.iter().filter_map(touch).collect::<Vec<_>>());
    };
    let record = |t: &RawTouch| Some(LogRecord { id: t.id?, status: t.status, position: t.position, time_s: t.time_s });
    post.log_text_found(machine, plan, found_mm, &touches.iter().filter_map(record).collect::<Vec<_>>())
}
