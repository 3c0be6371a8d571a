//! Numbers that a control takes for a program, its labels and its blocks.

use super::Postprocessor;
use super::as_written::{BlockNumbers, DialectName};
use super::render::is_block;
use crate::diag::{Failure, Result};

/// The highest number of a program, where the file does not say it: four digits are on every control.
const LAST_PROGRAM: u32 = 9999;

/// The highest number of a block: five digits (LinuxCNC 2.9 manual 11.3.2), eight on a SINUMERIK. No file needs more.
fn last_block(dialect: Option<DialectName>) -> usize {
    if dialect == Some(DialectName::Ngc) { 99_999 } else { 99_999_999 }
}

/// Why blocks cannot be numbered so, and what to write instead.
pub(super) fn wrong_block_numbers(rule: &BlockNumbers, dialect: Option<DialectName>) -> Option<(String, &'static str)> {
    let last = last_block(dialect);
    let BlockNumbers { first, step, word } = rule;
    let (before, behind) = word.split_once("{n}").unwrap_or((word, "none"));
    let blank = behind.starts_with(' ') && behind.trim().is_empty();
    let (good, wanted) = match dialect {
        Some(DialectName::MacroB) => {
            let says = "N numbers are the labels of this control, a running number could be one of them";
            return Some((says.to_owned(), "leave block_numbers out"));
        }
        Some(DialectName::Ngc) => (before == "N" && behind.trim().is_empty(), "word = \"N{n} \""),
        Some(DialectName::Sinumerik) => (before == "N" && blank, "word = \"N{n} \", with its blank"),
        Some(DialectName::Klartext) => (before.is_empty() && blank, "word = \"{n} \", with its blank"),
        None => (word.contains("{n}"), "word = \"{n} \""),
    };
    if !good {
        return Some((format!("the control does not read the word {word:?}"), wanted));
    }
    if *step == 0 {
        return Some(("with step 0 all blocks have one number".to_owned(), "a step of 1 or more"));
    }
    let beyond = *first > last || *step > last;
    beyond.then(|| (format!("first {first} and step {step}: block numbers end at {last}"), "smaller numbers"))
}

impl Postprocessor {
    /// The last block of a program has a number that the control takes.
    ///
    /// # Errors
    /// When it has not.
    pub(super) fn check_block_numbers(&self, text: &str) -> Result<()> {
        let Some(rule) = &self.block_numbers else { return Ok(()) };
        let last = last_block(self.check.as_ref().map(|check| check.dialect));
        let steps = text.lines().filter(|line| self.keeps(line) && is_block(line)).count().saturating_sub(1);
        let number = rule.first.saturating_add(rule.step.saturating_mul(steps));
        if number <= last {
            return Ok(());
        }
        let shown = |n: usize| rule.word.trim_end().replace("{n}", &n.to_string());
        let help = match (rule.first + steps <= last, steps < last) {
            (true, _) => "a smaller step",
            (false, true) => "a smaller first number, and a smaller step",
            (false, false) => "leave block_numbers out, or split the program: fewer touches in one",
        };
        Err(Failure::new(
            "post::block_numbers",
            format!(
                "[file] block_numbers of controller {}: {} is beyond {}, the highest that it takes",
                self.name,
                shown(number),
                shown(last)
            ),
        )
        .help(help))
    }

    /// Why a label cannot have this number.
    #[must_use]
    pub fn wrong_label(&self, label: u32) -> Option<String> {
        let last = self.last_label.and_then(|last| u32::try_from(last).ok()).unwrap_or(u32::MAX);
        (!(1..=last).contains(&label)).then(|| match self.last_label {
            Some(last) => format!("the labels of controller {} are 1 to {last}", self.name),
            None => "there is no such label".to_owned(),
        })
    }

    /// Why no program of this control can have this number: out of range, or it would call itself.
    #[must_use]
    pub fn impossible_program_number(&self, digits: &str) -> Option<String> {
        let last = self.last_program.unwrap_or(LAST_PROGRAM);
        let Some(number) = digits.parse().ok().filter(|n| (1..=last).contains(n)) else {
            return Some(format!("a program's number is 1 to {last} ([file] last_program)"));
        };
        let calls = self.check.as_ref().is_some_and(|rule| rule.calls.iter().any(|call| call.program == number));
        calls.then(|| "this is a macro that the program calls: it would call itself".to_owned())
    }

    /// The number is not the one of the settings.
    #[must_use]
    pub fn other_program_number(&self, digits: &str) -> Option<String> {
        let meant = self.settings.get("program_number")?;
        (meant.trim().parse::<u64>().ok() != digits.parse().ok())
            .then(|| format!("the program was written with the number {meant} (program_number in [settings])"))
    }

    /// The number that the settings give a program is one that it can have.
    ///
    /// # Errors
    /// When it is not.
    pub(super) fn check_program_number(&self) -> Result<()> {
        let Some(number) = self.settings.get("program_number") else { return Ok(()) };
        self.impossible_program_number(number).map_or(Ok(()), |wrong| {
            Err(Failure::new(
                "post::program_number",
                format!("program_number {number:?} of controller {}: {wrong}", self.name),
            )
            .help("write another one under [settings] in the postprocessor file"))
        })
    }
}
