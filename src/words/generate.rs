//! Sentences of programs that are chosen.

use crate::diag::Finding;
use crate::units::Plain;
use crate::workflow::auto_program::BetterPlace;

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
