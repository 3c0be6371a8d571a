//! The log as the control would have written it: the counterpart of [`crate::log::parse`].
//!
//! `H AXISCAL 1 LINUXCNC SWIVEL-HEAD HEAD 0A1B2C3D4E5F MM N202 U1`, then `P N1 S1 X… K…` for each touch, then `E N202`.
//! Capitals, digits, signs, points and blanks only: every control can write that.

use super::as_written::EndOfLine;
use super::{Frame, Postprocessor, spelling::name_of};
use crate::axes::{AxisName, Position};
use crate::diag::Result;
use crate::log::Status;
use crate::machine::Machine;
use crate::program::plan::{ControllerFrame, Plan};
use minijinja::context;
use sha2::{Digest, Sha256};
use std::fmt::Write;

/// One touch for [`Postprocessor::log_text`]: axis positions at the trigger, NC coordinates relative to R, mm and deg.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LogRecord {
    /// Number in the plan.
    pub id: u64,
    /// Hit or miss.
    pub status: Status,
    /// Axis positions at the trigger (at the end of the search for a miss).
    pub position: Position,
    /// When, on any clock, s; written where the control's program writes times.
    pub time_s: Option<f64>,
}

/// Version of the log's form.
pub(crate) const VERSION: u32 = 1;

/// Twelve hexadecimal digits that tell plans apart: touches, their places and the frame.
///
/// Taken from rounded numbers, so that a plan that has been written and read again keeps its digest.
#[must_use]
pub fn digest(plan: &Plan) -> String {
    let mut text = String::new();
    let frame = if plan.controller_frame == ControllerFrame::Tcp { "tcp" } else { "axes" };
    // writing into a String cannot fail
    let _ = write!(text, "{} {} {frame}", plan.machine, plan.program);
    for touch in &plan.touches {
        let _ = write!(text, "\n{}", touch.id);
        for value in touch.nominal_position().0.iter().chain(&touch.end_position().0) {
            let _ = write!(text, " {:.4}", value + 0.0);
        }
    }
    Sha256::digest(text.as_bytes()).iter().take(6).fold(String::new(), |mut hex, byte| {
        let _ = write!(hex, "{byte:02X}");
        hex
    })
}

/// A name as it stands in a log: capitals, digits and `-`.
pub(crate) fn log_word(name: &str) -> String {
    name_of(&name.to_ascii_uppercase(), |c| c.is_ascii_uppercase() || c.is_ascii_digit() || c == '-')
}

/// The head line up to and with the `U` whose number is the first set-up of the run.
pub(super) fn head(post: &Postprocessor, plan: &Plan) -> String {
    format!(
        "H AXISCAL {VERSION} {} {} {} {} MM N{} U",
        log_word(&post.name),
        log_word(&plan.machine),
        log_word(&plan.program),
        digest(plan),
        plan.touches.len()
    )
}

/// The last line.
pub(super) fn end(plan: &Plan) -> String {
    format!("E N{}", plan.touches.len())
}

impl Postprocessor {
    /// Name of the log that the program of a plan writes.
    ///
    /// # Errors
    /// When the template fails.
    pub fn log_name(&self, plan: &Plan) -> Result<String> {
        let name =
            self.render("log_file", context! { program => plan.program.clone(), machine => plan.machine.clone() })?;
        Ok(name_of(&name, |c| self.log.characters.contains(c)))
    }

    /// The log that the program of a plan would have left, had the machine touched like this.
    #[must_use]
    pub fn log_text(&self, machine: &Machine, plan: &Plan, records: &[LogRecord]) -> String {
        let axes: Vec<AxisName> = AxisName::ALL.into_iter().filter(|a| machine.axis(*a).is_some()).collect();
        let number = |value: f64| {
            let text = format!("{value:.*}", self.log.decimals);
            let zero = text.starts_with('-') && !text.bytes().any(|b| (b'1'..=b'9').contains(&b));
            let text = if zero { text[1..].to_owned() } else { text };
            if self.log.mark == b',' { text.replace('.', ",") } else { text }
        };
        let mut lines = vec![format!("{}1", head(self, plan))];
        for record in records {
            let length = plan.touch(record.id).and_then(|t| t.tool_length_mm).unwrap_or(plan.tool_length_mm);
            let frame = Frame::new(machine, plan.controller_frame, length);
            let shown = frame.controller_from_axes(&record.position);
            let status = i32::from(record.status == Status::Hit);
            let mut line = format!("P N{} S{status}", record.id);
            for axis in &axes {
                // writing into a String cannot fail
                let _ = write!(line, " {axis}{}", number(shown.get(*axis)));
            }
            if let Some(letter) = self.log.check_word {
                // ids are small: a double holds them
                let sum = record.id as f64 + f64::from(status) + axes.iter().map(|a| shown.get(*a)).sum::<f64>();
                let _ = write!(line, " {}{}", letter as char, number(sum));
            }
            if let (Some(letter), Some(time)) = (self.log.time_word, record.time_s) {
                let _ = write!(line, " {}{}", letter as char, number(time));
            }
            lines.push(line);
        }
        lines.push(end(plan));
        let eol = match self.log.end_of_line.first() {
            Some(EndOfLine::Crlf) => "\r\n",
            Some(EndOfLine::Cr) => "\r",
            _ => "\n",
        };
        lines.iter().flat_map(|line| [line.as_str(), eol]).collect()
    }
}
