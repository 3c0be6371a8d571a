//! What a program says, statement by statement: two programs of the same statements do the same, whatever happens to them.
//!
//! No run shows a limit that was moved a little: none falls between the old and the new one. The statements do. Remarks,
//! blanks, numbers of blocks and labels, and how a number is spelled are gone when a program has been read. What a person
//! may change at the control without harm is not compared ([`super::harmless`]), but named.

use super::code::{Code, Expr, Instruction, Piece, Statement, Text, Var};
use super::harmless::Harmless;
use crate::program::plan::Proof;
use sha2::{Digest, Sha256};
use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write;
use std::ops::Range;

/// Statements to a piece in the plan.
const PIECE: usize = 32;
/// Digits of a statement in the plan.
const DIGITS: usize = 4;

/// How the statements of a program are compared.
pub struct Rules<'a> {
    /// To this control a number with its decimal point is another than the one without.
    pub points: bool,
    /// Statements of the head with which a person says where it begins, how fast it positions, whether it only tries.
    pub switches: Vec<usize>,
    /// What may have been put in.
    pub harmless: &'a dyn Fn(&Statement) -> Option<Harmless>,
}

/// A program against the one that was written.
#[derive(Debug, Default, PartialEq, Eq)]
pub struct Compared {
    /// The first statement that is another one; behind the last: some lack.
    pub other: Option<usize>,
    /// What was put in and harms nothing.
    pub inserted: BTreeMap<usize, Harmless>,
    /// What is shown to the operator is another text.
    pub other_texts: bool,
}

/// The record of a program for its plan; `text`: all of it, as it was written.
pub fn record(code: &Code, rules: &Rules<'_>, text: &str) -> Proof {
    let mut speller = Speller::new(code, rules);
    let mut digits = Vec::with_capacity(code.statements.len());
    for (place, statement) in code.statements.iter().enumerate() {
        speller.comes_to(place);
        digits.push(short(&speller.spell(place, statement)));
        speller.keep(place);
    }
    let (steps_sha256, texts_sha256) = speller.finish();
    Proof {
        sha256: steps_sha256.clone(),
        steps_sha256,
        steps: digits.chunks(PIECE).map(<[String]>::concat).collect(),
        texts_sha256,
        text_sha256: hex(&Sha256::digest(text.as_bytes())),
        ..Proof::default()
    }
}

/// Compares a program with what its plan holds of it.
pub fn compare(written: &Proof, code: &Code, rules: &Rules<'_>) -> Compared {
    let digits = written.steps.concat();
    let mut expected = digits.as_bytes().chunks(DIGITS);
    let mut next = expected.next();
    let mut compared = Compared::default();
    let mut speller = Speller::new(code, rules);
    for (place, statement) in code.statements.iter().enumerate() {
        speller.comes_to(place);
        if next == Some(short(&speller.spell(place, statement)).as_bytes()) {
            speller.keep(place);
            next = expected.next();
        } else if let Some(harmless) = (rules.harmless)(statement) {
            compared.inserted.insert(place, harmless);
        } else {
            compared.other = Some(place);
            return compared;
        }
    }
    if next.is_some() {
        compared.other = Some(code.statements.len());
        return compared;
    }
    let (all, texts) = speller.finish();
    if all != written.steps_sha256 {
        // the digits of another statement are the same by chance: which one is not known
        compared.other = Some(code.statements.len().saturating_sub(1));
    }
    compared.other_texts = texts != written.texts_sha256;
    compared
}

/// The first digits of a statement's digest.
fn short(spelled: &str) -> String {
    hex(Sha256::digest(spelled.as_bytes()).get(..DIGITS / 2).unwrap_or_default())
}

pub(super) fn hex(bytes: &[u8]) -> String {
    bytes.iter().fold(String::new(), |mut hex, byte| {
        let _ = write!(hex, "{byte:02x}");
        hex
    })
}

/// Spells statements one after the other. A statement to which something jumps on is called by the number of the jumps before: what
/// a statement is called then hangs on what stands before it alone, and a jump that lacks changes none of those before it.
struct Speller<'a> {
    rules: &'a Rules<'a>,
    /// Texts that go into a log: those are not the operator's.
    logged: BTreeSet<&'a Var>,
    ahead: BTreeMap<usize, usize>,
    /// Names of the labels since the last statement that was kept.
    labels: Vec<usize>,
    /// Statements that were kept before each place.
    kept: Vec<usize>,
    count: usize,
    /// The jump that the present statement makes, and its texts.
    jump: Option<usize>,
    text: String,
    shown: String,
    all: Sha256,
    texts: Sha256,
}

impl<'a> Speller<'a> {
    fn new(code: &'a Code, rules: &'a Rules<'a>) -> Self {
        let logged = code.statements.iter().flat_map(|s| match &s.what {
            Instruction::LogLine(text) | Instruction::LogWrite { text, .. } => held(text),
            _ => Vec::new(),
        });
        Self {
            rules,
            logged: logged.collect(),
            ahead: BTreeMap::new(),
            labels: Vec::new(),
            kept: Vec::with_capacity(code.statements.len()),
            count: 0,
            jump: None,
            text: String::new(),
            shown: String::new(),
            all: Sha256::new(),
            texts: Sha256::new(),
        }
    }

    fn comes_to(&mut self, place: usize) {
        self.kept.push(self.count);
        self.labels.extend(self.ahead.get(&place));
    }

    /// What a jump from here is called.
    fn target(&mut self, from: usize, to: usize) -> String {
        if to <= from {
            // what lies behind is known by its place
            return format!("back {}", self.kept.get(to).copied().unwrap_or_default());
        }
        self.jump = Some(to);
        self.ahead.get(&to).copied().unwrap_or(self.ahead.len()).to_string()
    }

    fn spell(&mut self, place: usize, statement: &Statement) -> String {
        (self.jump, self.text) = (None, String::new());
        self.shown.clear();
        for label in &self.labels {
            let _ = writeln!(self.text, "label {label}");
        }
        match &statement.what {
            Instruction::Jump(to) => {
                let to = self.target(place, *to);
                let _ = writeln!(self.text, "jump {to}");
            }
            Instruction::JumpUnless(condition, to) => {
                let to = self.target(place, *to);
                let _ = writeln!(self.text, "unless {condition:?} jump {to}");
            }
            Instruction::Leave(to) => {
                let to = self.target(place, *to);
                let _ = writeln!(self.text, "leave for {to}");
            }
            Instruction::Call { to, gives, texts, .. } => {
                let to = self.target(place, *to);
                let _ = writeln!(self.text, "call {to} with {gives:?} {texts:?}");
            }
            Instruction::Block(words) if !self.rules.points => {
                words.iter().for_each(|w| {
                    let _ = write!(self.text, "{} {:?} ", w.address, w.value);
                });
                self.text.push('\n');
            }
            Instruction::Set(var, Expr::Number(_)) if self.rules.switches.contains(&place) => {
                let _ = writeln!(self.text, "switch {var}");
            }
            Instruction::Message(text) => self.show("message", text),
            Instruction::Wait(text) => self.show("wait", text),
            Instruction::Abort(text) => self.show("abort", text),
            Instruction::SetText { var, text, .. } if !self.logged.contains(var) => {
                self.show(&format!("text {var}"), text);
            }
            other => {
                let _ = writeln!(self.text, "{other:?}");
            }
        }
        self.text.clone()
    }

    /// A text for the operator: its numbers count, its words do not.
    fn show(&mut self, what: &str, text: &Text) {
        let words = |piece: &&Piece| matches!(piece, Piece::Text(_));
        let numbers: Vec<&Piece> = text.iter().filter(|piece| !words(piece)).collect();
        let _ = writeln!(self.text, "{what} {} {numbers:?}", text.is_empty());
        let _ = writeln!(self.shown, "{text:?}");
    }

    /// The statement that was spelled last is one of the program.
    fn keep(&mut self, place: usize) {
        if let Some(to) = self.jump.take() {
            let next = self.ahead.len();
            self.ahead.entry(to).or_insert(next);
        }
        self.all.update(self.text.as_bytes());
        self.texts.update(self.shown.as_bytes());
        self.labels.clear();
        self.count = self.kept.get(place).copied().unwrap_or_default() + 1;
    }

    fn finish(mut self) -> (String, String) {
        // jumps to behind the last statement
        for label in std::mem::take(&mut self.labels) {
            self.all.update(format!("label {label}"));
        }
        (hex(&self.all.finalize()), hex(&self.texts.finalize()))
    }
}

/// The variables whose texts stand in a text.
fn held(text: &Text) -> Vec<&Var> {
    text.iter().filter_map(|piece| if let Piece::Held(var) = piece { Some(var) } else { None }).collect()
}

/// Where a statement stands; behind the last one, where that ends.
pub fn place(code: &Code, statement: usize) -> Range<usize> {
    let end = || code.statements.last().map_or(0..0, |s| s.at.end..s.at.end);
    code.statements.get(statement).map_or_else(end, |s| s.at.clone())
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)] // a failure has its place
    use super::*;
    use crate::check::harmless;
    use crate::check::{macro_b, ngc};
    use crate::post::Postprocessor;

    fn compared(one: &Code, two: &Code, points: bool) -> Compared {
        let post = Postprocessor::load_built_in_or_file("fanuc").unwrap().0;
        let rules = Rules { points, switches: Vec::new(), harmless: &|s| harmless::of(s, &post) };
        compare(&record(one, &rules, ""), two, &rules)
    }

    fn other(one: &str, two: &str) -> Option<usize> {
        compared(&ngc::parse(one).unwrap(), &ngc::parse(two).unwrap(), false).other
    }

    #[test]
    fn what_does_not_act_does_not_matter() {
        let text = "G0 X1 (there)\n#<a> = 2\no1 if [#<a> GT 1]\nG0 X2\no1 endif\n(MSG,hello)\nM2\n";
        let same = "  G0   X1.0\r\n\n#<a>=2.\n(remark)\no7 if [ #<a> gt 1.00 ]\nG0X+2\no7 endif\n(msg,hallo)\nM2";
        assert_eq!(other(text, same), None);
    }

    #[test]
    fn the_first_other_statement_is_named() {
        // a number for each of a hundred statements, so that pieces are crossed
        let program = |changed: usize, by: &str| -> String {
            (0..100).map(|n| format!("#<a> = {n}{}\n", if n == changed { by } else { "" })).collect()
        };
        for n in [0, 31, 32, 63, 70, 99] {
            assert_eq!(other(&program(n, ""), &program(n, ".1")), Some(n), "{n}");
        }
        let all = program(0, "");
        assert_eq!(other(&all, all.rsplit_once("#<a>").unwrap().0), Some(99), "the last one lacks");
        let doubled = all.replacen("#<a> = 40\n", "#<a> = 40\n#<a> = 40\n", 1);
        assert_eq!(other(&all, &doubled), Some(41));
    }

    #[test]
    fn limits_and_jumps_matter() {
        let text = "o1 if [#<a> GT 1]\nG0 X2\no1 endif\nG0 X3\n(DEBUG,hello#<a>)\n";
        for (from, to, place) in [
            ("GT 1", "GT 1.1", 0),
            ("GT 1", "GE 1", 0),
            ("[#<a>", "[ABS[#<a>]", 0),
            ("G0 X2\no1 endif\nG0 X3\n", "G0 X2\nG0 X3\no1 endif\n", 2),
            ("hello#<a>", "hello#<b>", 3),
        ] {
            assert_eq!(other(text, &text.replace(from, to)), Some(place), "{from} to {to}");
        }
    }

    #[test]
    fn what_a_person_puts_in_is_named_and_harms_nothing() {
        let text =
            "o<s> sub\no1 if [#1 GT 1]\nG0 X2\no1 endif\no<s> endsub\nG0 X3\no<s> call [1]\nG0 X4\no<s> call [2]\n";
        let with = |line: &str, before: &str| text.replacen(before, &format!("{line}\n{before}"), 1);
        let of = |two: &str| compared(&ngc::parse(text).unwrap(), &ngc::parse(two).unwrap(), false);
        for line in ["M0", "M1", "M8", "M9", "G4 P0.5", "G90", "G21 G17"] {
            for before in ["o<s> sub", "o1 if", "G0 X2", "o1 endif", "G0 X3", "o<s> call [1]", "G0 X4"] {
                let found = of(&with(line, before));
                assert_eq!((found.other, found.inserted.len()), (None, 1), "{line} before {before}");
            }
        }
        for line in ["M3", "G4 P-1", "G91 X1", "G55", "G43.1 Z1", "G0 X3", "M6", "G38.2 Z1", "o<s> call [1]"] {
            if let Ok(code) = ngc::parse(&with(line, "G0 X4")) {
                let found = compared(&ngc::parse(text).unwrap(), &code, false);
                assert!(found.other.is_some() || !code.unknown.is_empty(), "{line}");
            }
        }
    }

    #[test]
    fn a_jump_that_lacks_is_named_where_it_stood() {
        let post = Postprocessor::load_built_in_or_file("fanuc").unwrap().0;
        let text = "G4 P1.\nIF[#1EQ1]GOTO20\nG4 P2.\nIF[#1EQ2]GOTO10\nG4 P3.\nIF[#1EQ3]GOTO20\nN10\nG4 P4.\nIF[#1EQ4]GOTO30\n\
            N20\nG4 P5.\nN30\nG4 P6.\nIF[#1EQ5]GOTO10\n";
        let read = |p: &str| macro_b::parse(&format!("%\nO9100\n{p}M30\n%\n"), &post).unwrap();
        // a condition and its jump are two statements, a label is none
        assert_eq!(read(text).statements.len(), 17);
        for (jump, place) in [
            ("IF[#1EQ1]GOTO20\n", 1),
            ("IF[#1EQ2]GOTO10\n", 4),
            ("IF[#1EQ3]GOTO20\n", 7),
            ("IF[#1EQ4]GOTO30\n", 10),
            ("IF[#1EQ5]GOTO10\n", 14),
        ] {
            let found = compared(&read(text), &read(&text.replace(jump, "")), true).other;
            // the dwells behind it may look as if they had been put in
            assert!(found.is_some_and(|at| (place..=place + 2).contains(&at)), "{jump} {found:?}");
        }
        let back = text.replace("EQ5]GOTO10", "EQ5]GOTO20");
        assert_eq!(compared(&read(text), &read(&back), true).other, Some(15), "to another label");
        let renamed = text.replace("N10\n", "N11\n").replace("GOTO10", "GOTO11");
        assert_eq!(compared(&read(text), &read(&renamed), true).other, None);
    }

    #[test]
    fn a_point_matters_where_the_control_counts_increments_without_it() {
        let post = Postprocessor::load_built_in_or_file("fanuc").unwrap().0;
        let read = |p: &str| macro_b::parse(&format!("%\nO9100\nG31 X1. F{p}\nM30\n%\n"), &post).unwrap();
        assert_eq!(compared(&read("10."), &read("10.0"), true).other, None);
        assert_eq!(compared(&read("10."), &read("100."), true).other, Some(0));
    }
}
