//! Numbers that a control takes for a program and its labels.

use super::Postprocessor;
use crate::diag::{Failure, Result};

/// The highest number of a program, where the file does not say it: four digits are on every control.
const LAST_PROGRAM: u32 = 9999;

impl Postprocessor {
    /// Why a label cannot have this number.
    #[must_use]
    pub fn wrong_label(&self, label: u32) -> Option<String> {
        let last = self.last_label.and_then(|last| u32::try_from(last).ok()).unwrap_or(u32::MAX);
        (!(1..=last).contains(&label)).then(|| match self.last_label {
            Some(last) => format!("the labels of controller {} are 1 to {last}", self.name),
            None => "there is no such label".to_owned(),
        })
    }

    /// Why the program cannot have this number: the one of the settings is meant, and none that the program calls.
    #[must_use]
    pub fn wrong_program_number(&self, digits: &str) -> Option<String> {
        let last = self.last_program.unwrap_or(LAST_PROGRAM);
        let Some(number) = digits.parse().ok().filter(|n| (1..=last).contains(n)) else {
            return Some(format!("a program's number is 1 to {last} ([file] last_program)"));
        };
        if self.check.as_ref().is_some_and(|rule| rule.calls.iter().any(|call| call.program == number)) {
            return Some("this is a macro that the program calls: it would call itself".to_owned());
        }
        let meant = self.settings.get("program_number")?;
        (meant.trim().parse() != Ok(number))
            .then(|| format!("the program has the number {meant} (program_number in [settings])"))
    }

    /// The number that the settings give a program is one that it can have.
    ///
    /// # Errors
    /// When it is not.
    pub(super) fn check_program_number(&self) -> Result<()> {
        let Some(number) = self.settings.get("program_number") else { return Ok(()) };
        self.wrong_program_number(number).map_or(Ok(()), |wrong| {
            Err(Failure::new(
                "post::program_number",
                format!("program_number {number:?} of controller {}: {wrong}", self.name),
            )
            .help("write another one under [settings] in the postprocessor file"))
        })
    }
}
