//! The log as the control would have written it: the counterpart of [`crate::log::parse`].
//!
//! `H AXISCAL 1 LINUXCNC SWIVEL-HEAD HEAD 0A1B2C3D4E5F MM N202 U1`, then `P N1 S1 X… K…` for each touch, then `E N202`.
//! Capitals, digits, signs, points and blanks only: every control can write that.

use super::as_written::{EndOfLine, LengthUnit, Padding};
use super::{Frame, LogRule, Postprocessor, spelling::name_of};
use crate::axes::{AxisName, Position};
use crate::diag::Result;
use crate::machine::Machine;
use crate::program::Status;
use crate::program::plan::Plan;
use crate::program::plan_digest::digest;
use crate::units::inch_from_mm;
use minijinja::context;
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
    /// When, s on any clock; written where the control's program writes times.
    pub time_s: Option<f64>,
}

/// Version of the log's form.
pub(crate) const VERSION: u32 = 1;

/// A name as it stands in a log: capitals, digits and `-`.
pub(crate) fn log_word(name: &str) -> String {
    name_of(&name.to_ascii_uppercase(), |c| c.is_ascii_uppercase() || c.is_ascii_digit() || c == '-')
}

/// The head line up to and with the `U` whose number is the first set-up of the run.
pub(super) fn head(post: &Postprocessor, plan: &Plan) -> String {
    format!(
        "H AXISCAL {VERSION} {} {} {} {} {} N{} U",
        log_word(&post.name),
        log_word(&plan.machine),
        log_word(&plan.program),
        digest(plan),
        match post.log.unit {
            LengthUnit::Mm => "MM",
            LengthUnit::Inch => "INCH",
        },
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
        self.log_text_found(machine, plan, None, records)
    }

    /// The same of a program that found its artefact so far off its place, mm along X, Y and Z.
    #[must_use]
    pub fn log_text_found(
        &self,
        machine: &Machine,
        plan: &Plan,
        found_mm: Option<[f64; 3]>,
        records: &[LogRecord],
    ) -> String {
        let axes: Vec<AxisName> = AxisName::ALL.into_iter().filter(|a| machine.axis(*a).is_some()).collect();
        let mut lines = vec![format!("{}1", head(self, plan))];
        lines.extend(found_mm.map(|off| self.found_line(off)));
        let numbered = plan.numbered();
        for record in records {
            let length = numbered.touch(record.id).and_then(|t| t.tool_length_mm).unwrap_or(plan.tool_length_mm);
            let frame = Frame::new(machine, plan.controller_frame, length);
            let mut shown = frame.controller_from_axes(&record.position);
            if self.log.unit == LengthUnit::Inch {
                shown = shown.with_xyz_mm(shown.xyz_mm().map(inch_from_mm));
            }
            let status = i32::from(record.status == Status::Hit);
            let mut line = format!("P N{} S{status}", record.id);
            for axis in &axes {
                // writing into a String cannot fail
                let _ = write!(line, " {axis}{}", self.log.number(shown.get(*axis)));
            }
            // the sum is that of the numbers as they stand in the line
            let tick = 0.1_f64.powi(i32::try_from(self.log.time_decimals).unwrap_or(0));
            let time_s = record.time_s.filter(|_| self.log.writes_time).map(|t| (t / tick).round() * tick);
            if let (Some(letter), Some(time)) = (self.log.time_word, time_s) {
                let _ = write!(line, " {}{}", letter as char, self.log.number_of(time, self.log.time_decimals));
            }
            if let Some(letter) = self.log.check_word {
                // ids are small: a double holds them
                let sum = record.id as f64
                    + f64::from(status)
                    + axes.iter().map(|a| shown.get(*a)).sum::<f64>()
                    + time_s.unwrap_or(0.0);
                let sum = self.log.check_modulo.map_or(sum, |modulo| sum % modulo);
                let _ = write!(line, " {}{}", letter as char, self.log.number(sum));
            }
            lines.push(line);
        }
        lines.push(end(plan));
        let eol = match self.log.end_of_line.first() {
            Some(EndOfLine::Crlf) => "\r\n",
            Some(EndOfLine::Cr) => "\r",
            _ => "\n",
        };
        lines.iter().flat_map(|line| [self.log.prefix.as_str(), line, eol]).collect()
    }
}

impl Postprocessor {
    /// The line that says where the artefact was found.
    fn found_line(&self, off_mm: [f64; 3]) -> String {
        let off = if self.log.unit == LengthUnit::Inch { off_mm.map(inch_from_mm) } else { off_mm };
        let mut line = "F".to_owned();
        for (axis, value) in ["X", "Y", "Z"].into_iter().zip(off) {
            // writing into a String cannot fail
            let _ = write!(line, " {axis}{}", self.log.number(value));
        }
        if let Some(letter) = self.log.check_word {
            let sum: f64 = off.iter().sum();
            let sum = self.log.check_modulo.map_or(sum, |modulo| sum % modulo);
            let _ = write!(line, " {}{}", letter as char, self.log.number(sum));
        }
        line
    }
}

impl LogRule {
    /// A number as the control writes it into its log: rounded, padded, with its mark; never `-0`.
    #[must_use]
    pub fn number(&self, value: f64) -> String {
        self.number_of(value, self.decimals)
    }

    fn number_of(&self, value: f64, decimals: usize) -> String {
        let mut digits = format!("{value:.decimals$}", value = value.abs());
        let negative = value < 0.0 && digits.bytes().any(|b| (b'1'..=b'9').contains(&b));
        if self.mark == b',' {
            digits = digits.replace('.', ",");
        }
        let whole = digits.find(['.', ',']).unwrap_or(digits.len());
        let sign = if negative { "-" } else { "" };
        match self.padding {
            _ if self.whole_places == 0 => format!("{sign}{digits}"),
            Padding::BeforeSign => {
                let blanks = self.whole_places.saturating_sub(whole + sign.len());
                format!("{:blanks$}{sign}{digits}", "")
            }
            Padding::AfterSign => {
                let (blanks, sign) = (self.whole_places.saturating_sub(whole), if negative { "-" } else { " " });
                format!("{sign}{:blanks$}{digits}", "")
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_padded_as_the_control_does() {
        let mut rule = LogRule { decimals: 3, ..Postprocessor::load_built_in_or_file("linuxcnc").unwrap().0.log };
        assert_eq!((rule.number(-1.5), rule.number(-0.0001)), ("-1.500".into(), "0.000".into()));
        rule.whole_places = 5;
        assert_eq!((rule.number(128.47398), rule.number(-91.2)), ("  128.474".into(), "  -91.200".into()));
        assert_eq!(rule.number(-1_234_567.0), "-1234567.000");
        rule.padding = Padding::AfterSign;
        // the example of controllers' manuals for DPRNT[X#2[53]Y#5[53]]
        assert_eq!((rule.number(128.47398), rule.number(-91.2)), ("   128.474".into(), "-   91.200".into()));
        rule.mark = b',';
        assert_eq!(rule.number(0.25), "     0,250");
    }
}
