//! What a person may put into a program at the control without harm: stops, coolant, dwells, modes that act already, and the M codes
//! that the postprocessor file allows. Everything else that is put in makes another program of it.

use super::code::{Expr, Instruction, Statement, Word};
use crate::post::Postprocessor;

/// Something that was put in.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Harmless {
    /// The program waits for a person, M0 or M1.
    Stop,
    /// M8, M9.
    Coolant,
    /// G4.
    Dwell,
    /// Modal words: only while they change nothing ([`super::run`] sees to that).
    Modes,
    /// An M code of the postprocessor file.
    Allowed,
}

impl Harmless {
    /// What was put in.
    pub fn says(self) -> &'static str {
        match self {
            Self::Stop => "a stop was put in here",
            Self::Coolant => "coolant is switched here, which the written program does not do",
            Self::Dwell => "a dwell was put in here",
            Self::Modes => "modal words were put in here, which act already",
            Self::Allowed => "a function was put in here that the postprocessor file allows",
        }
    }
}

/// Modal words that people repeat: plane, units, cutter compensation off, exact stop, cycles off, absolute, feed per minute.
const MODES: [f64; 11] = [17.0, 20.0, 21.0, 40.0, 60.0, 61.0, 71.0, 80.0, 90.0, 94.0, 710.0];

/// Letters with which a dwell says how long.
const DWELLS: [&str; 4] = ["P", "X", "F", "S"];

/// The longest dwell, s or ms: a longer one is no pause but a mistake.
const LONGEST: f64 = 60_000.0;

/// What a statement is, if it may be put in.
pub fn of(statement: &Statement, post: &Postprocessor) -> Option<Harmless> {
    let words = match &statement.what {
        Instruction::Wait(text) if text.is_empty() => return Some(Harmless::Stop),
        Instruction::Block(words) if !words.is_empty() => words,
        _ => return None,
    };
    let spoken: Vec<(&str, f64)> = words.iter().map(literal).collect::<Option<_>>()?;
    if allowed(&spoken, post) {
        return Some(Harmless::Allowed);
    }
    let all = |good: &dyn Fn(&str, f64) -> bool| spoken.iter().all(|(address, value)| good(address, *value));
    let is_dwell = |address: &str, value: f64| match address {
        "G" => value == 4.0,
        "DWELL" => (0.0..LONGEST).contains(&value),
        other => DWELLS.contains(&other) && (0.0..LONGEST).contains(&value),
    };
    if all(&|address, value| address == "M" && matches!(value, 0.0 | 1.0)) {
        Some(Harmless::Stop)
    } else if all(&|address, value| address == "M" && matches!(value, 8.0 | 9.0)) {
        Some(Harmless::Coolant)
    } else if all(&is_dwell) && spoken.iter().any(|(a, v)| *a == "DWELL" || (*a == "G" && *v == 4.0)) {
        Some(Harmless::Dwell)
    } else if all(&|address, value| address == "G" && MODES.contains(&value)) {
        Some(Harmless::Modes)
    } else {
        None
    }
}

fn literal(word: &Word) -> Option<(&str, f64)> {
    if let Expr::Number(value) = word.value { Some((word.address, value)) } else { None }
}

/// Is it a line of the setting that switches the probe on, or one of the words that the file allows?
fn allowed(spoken: &[(&str, f64)], post: &Postprocessor) -> bool {
    let on = post.settings.get("probe_on").map_or("", String::as_str).lines();
    let allowed = post.check.iter().flat_map(|rule| rule.harmless.iter().map(String::as_str));
    on.chain(allowed).any(|line| {
        let words: Vec<&str> = line.split_whitespace().collect();
        let same = |(word, (address, value)): (&&str, &(&str, f64))| {
            word.strip_prefix(*address).and_then(|n| n.parse::<f64>().ok()) == Some(*value)
        };
        !words.is_empty() && words.len() == spoken.len() && words.iter().zip(spoken).all(same)
    })
}
