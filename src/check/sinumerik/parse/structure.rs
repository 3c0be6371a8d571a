//! IF, loops, labels and jumps.

use super::{Reader, place};
use crate::check::code::{Expr, Instruction};
use crate::check::lines::{Line, blanks};
use crate::check::run::Fault;
use crate::check::sinumerik::expression::{identifier, is_truth};
use crate::check::sinumerik::words::means_something;
use std::ops::Range;

/// An IF or a loop that is not closed yet.
pub(super) enum Open {
    /// The jump over the part that is being read, and the one at the end of the first part.
    If {
        over: usize,
        end: Option<usize>,
    },
    /// First statement; the jump out of it.
    While {
        start: usize,
        out: usize,
    },
    Loop {
        start: usize,
    },
    Repeat {
        start: usize,
    },
}

/// Where a label may be looked for.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum Direction {
    Onward,
    Back,
    Both,
}

pub(super) struct Jump {
    pub(super) statement: usize,
    /// Of which program.
    pub(super) label: (usize, String),
    pub(super) direction: Direction,
    pub(super) at: Range<usize>,
    pub(super) inside: Vec<usize>,
}

impl Reader {
    pub(super) fn whether<'a>(&self, line: &Line<'_>, rest: &'a str) -> Result<(&'a str, Expr), Fault> {
        let unread = |rest: &str| line.not_understood(rest, "a condition");
        let (inside, gap) = blanks(rest).map_err(|e| line.unread(&e, "a condition"))?;
        if gap.is_empty() && !inside.starts_with('(') {
            return Err(unread(rest));
        }
        let (left, condition) = self.names.expression(inside).map_err(|e| unread(place(&e)))?;
        if is_truth(&condition) { Ok((left, condition)) } else { Err(unread(inside)) }
    }

    pub(super) fn condition<'a>(&mut self, line: &Line<'_>, rest: &'a str, at: Range<usize>) -> Result<&'a str, Fault> {
        let (left, condition) = self.whether(line, rest)?;
        let over = self.code.push(at.clone(), Instruction::JumpUnless(condition, 0));
        let left = blanks(left).map_err(|e| line.unread(&e, "GOTOF or the end of the block"))?.0;
        if left.is_empty() {
            self.opened(Open::If { over, end: None }, at);
            return Ok(left);
        }
        let left = self.goto(line, left, at)?;
        self.code.aim_here(over);
        Ok(left)
    }

    pub(super) fn goto<'a>(&mut self, line: &Line<'_>, rest: &'a str, at: Range<usize>) -> Result<&'a str, Fault> {
        let unread = |rest: &str| line.not_understood(rest, "GOTOF, GOTOB or GOTO and a label");
        let (after, word) = identifier(rest).map_err(|_| unread(rest))?;
        let direction = match word {
            "GOTOF" => Direction::Onward,
            "GOTOB" => Direction::Back,
            "GOTO" => Direction::Both,
            _ => return Err(unread(rest)),
        };
        let (after, gap) = blanks(after).map_err(|e| line.unread(&e, "a label"))?;
        let (left, label) = identifier(after).map_err(|_| unread(after))?;
        if gap.is_empty() {
            return Err(unread(after));
        }
        let statement = self.code.push(at.clone(), Instruction::Jump(0));
        let inside = self.inside();
        self.jumps.push(Jump { statement, label: (self.program, label.to_owned()), direction, at, inside });
        Ok(left)
    }

    pub(super) fn label(&mut self, line: &Line<'_>, rest: &str, name: &str) -> Result<(), Fault> {
        self.running = true;
        const LENGTH: std::ops::RangeInclusive<usize> = 2..=32;
        if !LENGTH.contains(&name.len()) {
            return Err(line.fault(rest, format!("{name} is no label: it has 2 to 32 characters")));
        }
        if means_something(name) || self.names.axis(name).is_some() {
            let says = format!("{name} is no label: the control reads a block number, an address or a word of its own");
            return Err(line.fault(rest, says));
        }
        if self.names.types.contains_key(name) {
            return Err(line.fault(rest, format!("{name} is no label: it is declared as a variable")));
        }
        let place = (self.code.statements.len(), self.inside());
        match self.labels.insert((self.program, name.to_owned()), place) {
            Some(_) => Err(line.fault(rest, format!("the label {name} stands twice"))),
            None => Ok(()),
        }
    }

    pub(super) fn inside(&self) -> Vec<usize> {
        self.open.iter().map(|(_, number, _)| *number).collect()
    }

    pub(super) fn opened(&mut self, open: Open, at: Range<usize>) {
        self.structures += 1;
        self.open.push((open, self.structures, at));
    }

    pub(super) fn structure<'a>(
        &mut self,
        line: &Line<'_>,
        rest: &str,
        keyword: &str,
        after: &'a str,
        at: Range<usize>,
    ) -> Result<&'a str, Fault> {
        let here = self.code.statements.len();
        match keyword {
            "WHILE" => {
                let (left, condition) = self.whether(line, after)?;
                let out = self.code.push(at.clone(), Instruction::JumpUnless(condition, 0));
                self.opened(Open::While { start: here, out }, at);
                return Ok(left);
            }
            "LOOP" => self.opened(Open::Loop { start: here }, at),
            "REPEAT" => self.opened(Open::Repeat { start: here }, at),
            _ => return self.closed(line, rest, keyword, after, at),
        }
        Ok(after)
    }

    pub(super) fn closed<'a>(
        &mut self,
        line: &Line<'_>,
        rest: &str,
        keyword: &str,
        after: &'a str,
        at: Range<usize>,
    ) -> Result<&'a str, Fault> {
        let alone = || line.fault(rest, format!("{keyword} does not belong to what is open here"));
        let (open, _, begun) = self.open.pop().ok_or_else(alone)?;
        match (keyword, open) {
            ("ELSE", Open::If { over, end: None }) => {
                let end = self.code.push(at, Instruction::Jump(0));
                self.code.aim_here(over);
                // another part: a jump from one into the other goes into a structure
                self.opened(Open::If { over, end: Some(end) }, begun);
            }
            ("ENDIF", Open::If { over, end }) => self.code.aim_here(end.unwrap_or(over)),
            ("ENDWHILE", Open::While { start, out }) => {
                self.code.push(at, Instruction::Jump(start));
                self.code.aim_here(out);
            }
            ("ENDLOOP", Open::Loop { start }) => {
                self.code.push(at, Instruction::Jump(start));
            }
            ("UNTIL", Open::Repeat { start }) => {
                let (left, condition) = self.whether(line, after)?;
                self.code.push(at, Instruction::JumpUnless(condition, start));
                return Ok(left);
            }
            _ => return Err(alone()),
        }
        Ok(after)
    }
}
