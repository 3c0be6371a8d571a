//! Sentences of programs that are chosen.

use crate::diag::Finding;
use crate::units::Plain;
use crate::workflow::auto_program::{BetterPlace, Taken};

/// An artefact at a place where one of the machine's errors can hardly be measured.
#[must_use]
pub fn badly_placed(better: &BetterPlace) -> Finding {
    let by: Vec<String> = ["X", "Y", "Z"]
        .iter()
        .zip(better.by_mm.iter())
        .filter(|(_, mm)| mm.abs() > 0.05)
        .map(|(axis, mm)| format!("{} mm along {axis}", Plain((mm * 10.0).round() / 10.0)))
        .collect();
    Finding::warning(
        "auto::place",
        format!(
            "with the artefact at this place one of the errors can hardly be measured: its standard uncertainty is {:.1} times the \
             usual size of that error",
            better.worst
        ),
    )
    .help(format!(
        "move the artefact by {}: the worst uncertainty is then {:.0} times smaller. Change centre or from_table in its file",
        by.join(" and "),
        better.times
    ))
}

/// A built-in program instead of touches that were chosen.
#[must_use]
pub fn built_in_taken(taken: &Taken) -> String {
    let Taken { program, worth, of_choice } = taken;
    format!(
        "these are the touches of the built-in program {program}: it measures the worst location error to {:.3} of its usual size \
         (one standard uncertainty) and detects {} effects if they have their usual size; chosen touches: {:.3} and {}",
        worth.worst, worth.found, of_choice.worst, of_choice.found
    )
}
