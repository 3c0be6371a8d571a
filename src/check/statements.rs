//! What a program says, as a digest of its statements: two programs with one digest are the same, whatever happens to them.
//!
//! What a program does in the runs that are tried ([`super::proof`]) cannot show a limit that was moved a little: no run falls
//! between the old and the new one. The statements can. Remarks, blanks, numbers of blocks and labels, and how a number is spelled
//! are gone when a program has been read; what the operator is shown is not.

use super::code::{Code, Instruction, Statement};
use super::proof::hex;
use crate::program::plan::Proof;
use sha2::{Digest, Sha256};
use std::collections::BTreeMap;
use std::fmt::Write;

/// Statements to a piece: two digits for each of them in the plan.
const PIECE: usize = 32;

/// The digest of all statements, and two digits for what stands up to each of them. `points`: to this control a number with its
/// decimal point is another than the one without.
pub fn statements(code: &Code, points: bool) -> (String, Vec<String>) {
    let mut ahead = Ahead::default();
    let mut all = Sha256::new();
    let mut digits = Vec::with_capacity(code.statements.len());
    let mut text = String::new();
    for (place, statement) in code.statements.iter().enumerate() {
        text.clear();
        // writing into a String cannot fail
        if let Some(label) = ahead.label(place) {
            let _ = writeln!(text, "label {label}");
        }
        write(&mut text, place, statement, &mut ahead, points);
        all.update(text.as_bytes());
        let so_far = all.clone().finalize();
        digits.push(hex(so_far.get(..1).unwrap_or_default()));
    }
    // a jump to behind the last statement
    if let Some(label) = ahead.label(code.statements.len()) {
        all.update(format!("label {label}"));
    }
    (hex(&all.finalize()), digits.chunks(PIECE).map(<[String]>::concat).collect())
}

/// The first statement that is not the written one; `None` where all are, or the plan does not tell. Behind the last one: some lack.
pub fn first_other(written: &Proof, now: &Proof) -> Option<usize> {
    if written.statements_sha256.is_empty() || written.statements_sha256 == now.statements_sha256 {
        return None;
    }
    let digits = |proof: &Proof| proof.statements.concat().into_bytes();
    let (a, b) = (digits(written), digits(now));
    let (a, b): (Vec<_>, Vec<_>) = (a.chunks(2).collect(), b.chunks(2).collect());
    let same = a.iter().zip(&b).take_while(|(x, y)| x == y).count();
    // equal to the last: two digits of the last one are the same by chance
    let last = a.len() == b.len() && same == a.len();
    Some(if last { same.saturating_sub(1) } else { same })
}

/// Statements to which something jumps on, numbered as they are first named: what a statement is called then hangs on what stands before
/// it alone, and a jump that lacks changes none of the jumps before it.
#[derive(Default)]
struct Ahead(BTreeMap<usize, usize>);

impl Ahead {
    fn name(&mut self, from: usize, to: usize) -> String {
        if to <= from {
            // what lies behind is known by its place
            return format!("back {to}");
        }
        let next = self.0.len();
        self.0.entry(to).or_insert(next).to_string()
    }

    fn label(&self, place: usize) -> Option<usize> {
        self.0.get(&place).copied()
    }
}

fn write(text: &mut String, place: usize, statement: &Statement, ahead: &mut Ahead, points: bool) {
    let _ = match &statement.what {
        Instruction::Jump(to) => writeln!(text, "jump {}", ahead.name(place, *to)),
        Instruction::JumpUnless(condition, to) => {
            writeln!(text, "unless {condition:?} jump {}", ahead.name(place, *to))
        }
        Instruction::Call(to) => writeln!(text, "call {}", ahead.name(place, *to)),
        Instruction::Block(words) if !points => {
            words.iter().for_each(|w| {
                let _ = write!(text, "{} {:?} ", w.address, w.value);
            });
            writeln!(text)
        }
        other => writeln!(text, "{other:?}"),
    };
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)] // a failure has its place
    use super::*;
    use crate::check::{macro_b, ngc};
    use crate::post::Postprocessor;

    fn proof(code: &Code, points: bool) -> Proof {
        let (statements_sha256, statements) = statements(code, points);
        Proof { sha256: String::new(), lines: Vec::new(), statements_sha256, statements }
    }

    fn other(one: &str, two: &str) -> Option<usize> {
        first_other(&proof(&ngc::parse(one).unwrap(), false), &proof(&ngc::parse(two).unwrap(), false))
    }

    #[test]
    fn what_does_not_act_does_not_matter() {
        let text = "G0 X1 (there)\n#<a> = 2\no1 if [#<a> GT 1]\nG0 X2\no1 endif\n(MSG,hello)\nM2\n";
        let same = "  G0   X1.0\r\n\n#<a>=2.\n(remark)\no7 if [ #<a> gt 1.00 ]\nG0X+2\no7 endif\n(msg,hello)\nM2";
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
    fn limits_jumps_and_messages_matter() {
        let text = "o1 if [#<a> GT 1]\nG0 X2\no1 endif\nG0 X3\n(MSG,hello)\n";
        for (from, to, place) in [
            ("GT 1", "GT 1.1", 0),
            ("GT 1", "GE 1", 0),
            ("[#<a>", "[ABS[#<a>]", 0),
            ("G0 X2\no1 endif\nG0 X3\n", "G0 X2\nG0 X3\no1 endif\n", 2),
            ("hello", "hallo", 3),
        ] {
            assert_eq!(other(text, &text.replace(from, to)), Some(place), "{from} to {to}");
        }
    }

    #[test]
    fn a_jump_that_lacks_is_named_where_it_stood() {
        let post = Postprocessor::load_built_in_or_file("fanuc").unwrap().0;
        let text = "G4 P1.\nIF[#1EQ1]GOTO20\nG4 P2.\nIF[#1EQ2]GOTO10\nG4 P3.\nIF[#1EQ3]GOTO20\nN10\nG4 P4.\nIF[#1EQ4]GOTO30\n\
            N20\nG4 P5.\nN30\nG4 P6.\nIF[#1EQ5]GOTO10\n";
        let read = |p: &str| proof(&macro_b::parse(&format!("%\nO9100\n{p}M30\n%\n"), &post).unwrap(), true);
        let statements = read(text).statements.concat().len() / 2;
        // a condition and its jump are two statements, a label is none
        assert_eq!(statements, 17);
        for (jump, place) in [
            ("IF[#1EQ1]GOTO20\n", 1),
            ("IF[#1EQ2]GOTO10\n", 4),
            ("IF[#1EQ3]GOTO20\n", 7),
            ("IF[#1EQ4]GOTO30\n", 10),
            ("IF[#1EQ5]GOTO10\n", 14),
        ] {
            assert_eq!(first_other(&read(text), &read(&text.replace(jump, ""))), Some(place), "{jump}");
        }
        let back = text.replace("EQ5]GOTO10", "EQ5]GOTO20");
        assert_eq!(first_other(&read(text), &read(&back)), Some(15), "to another label");
        assert_eq!(first_other(&read(text), &read(&text.replace("N10\n", "N11\n").replace("GOTO10", "GOTO11"))), None);
    }

    #[test]
    fn a_point_matters_where_the_control_counts_increments_without_it() {
        let post = Postprocessor::load_built_in_or_file("fanuc").unwrap().0;
        let read = |p: &str| proof(&macro_b::parse(&format!("%\nO9100\nG4 P{p}\nM30\n%\n"), &post).unwrap(), true);
        assert_eq!(first_other(&read("10"), &read("10.")), Some(0));
        assert_eq!(first_other(&read("10."), &read("10.0")), None);
    }
}
