//! A program that was read: its code, its switches, what a person has put in.

use super::files;
use crate::check::code::{Code, Expr, Instruction, Statement, Unknown, UnknownKind, Var, Word};
use crate::check::harmless::{self, Harmless};
use crate::check::needs_plan;
use crate::check::run::{Dialect, Fault, Happened, Spoken, Start};
use crate::check::statements::{self, Compared, Rules};
use crate::check::{heidenhain, macro_b, ngc, sinumerik};
use crate::diag::{Failure, Source};
use crate::machine::Machine;
use crate::post::{CheckRule, DialectName, Postprocessor};
use crate::program::plan::Proof;
use std::collections::BTreeMap;
use std::ops::Range;
use std::sync::Arc;

/// A program that was read.
pub struct Program {
    pub(super) dialect: DialectName,
    pub(super) code: Code,
    /// What a person has put in, by statement.
    pub(super) inserted: BTreeMap<usize, Harmless>,
    /// The variable that says at which set-up it begins, and the statement that sets it.
    pub(super) from: Option<(Var, usize)>,
    /// The same of the height of its dry run.
    pub(super) dry_run: Option<(Var, usize)>,
    pub(super) setups: u32,
}

/// More set-ups than any program has: a number beyond comes from a damaged one.
const MOST_SETUPS: f64 = 400.0;

impl Program {
    /// Reads a program.
    ///
    /// # Errors
    /// The first place that is not of the dialect's grammar.
    pub fn parse(post: &Postprocessor, rule: &CheckRule, text: &str, masks: &heidenhain::Masks) -> Result<Self, Fault> {
        let code = match rule.dialect {
            DialectName::Ngc => ngc::parse(text)?,
            DialectName::MacroB => macro_b::parse(text, post)?,
            DialectName::Klartext => heidenhain::parse(text, post, masks)?,
            DialectName::Sinumerik => sinumerik::parse(text, post)?,
        };
        let switch = |var: Var| set_at(&code, &var).map(|at| (var, at));
        let var = variable(&rule.from);
        let from = switch(var);
        let dry_run = rule.dry_run.as_deref().map(variable).and_then(switch);
        let mut highest = 1.0_f64;
        for statement in &code.statements {
            if let Instruction::JumpUnless(condition, _) = &statement.what {
                compared(condition, &var, &mut |n| highest = highest.max(n));
            }
        }
        let setups = highest.min(MOST_SETUPS) as u32;
        Ok(Self { dialect: rule.dialect, code, inserted: BTreeMap::new(), from, dry_run, setups })
    }

    /// The program's own number, and where it stands.
    pub fn number(&self) -> Option<&(String, Range<usize>)> {
        self.code.number.as_ref()
    }

    /// What the grammar does not know the meaning of.
    pub fn unknown_of_grammar(&self) -> &[Unknown] {
        &self.code.unknown
    }

    /// Everything in it that is not known to axiscal, wherever the program comes to; in the order of the text.
    pub fn unknown(&self, machine: &Machine, post: &Postprocessor) -> Vec<Unknown> {
        let words = match self.dialect {
            DialectName::Ngc => self.unknown_words::<ngc::Ngc>(machine, post),
            DialectName::MacroB => self.unknown_words::<macro_b::MacroB>(machine, post),
            DialectName::Klartext => self.unknown_words::<heidenhain::Heidenhain>(machine, post),
            DialectName::Sinumerik => self.unknown_words::<sinumerik::Sinumerik>(machine, post),
        };
        let mut all = [self.code.unknown.clone(), words, files::others(&self.code)].concat();
        all.sort_by_key(|unknown| unknown.at.start);
        all
    }

    fn unknown_words<D: Dialect>(&self, machine: &Machine, post: &Postprocessor) -> Vec<Unknown> {
        let control = D::begin(Start::Fresh, post, machine);
        let value = |word: &Word| match &word.value {
            Expr::Number(n) => *n,
            _ => f64::NAN,
        };
        let blocks = self.code.statements.iter().filter_map(|statement| match &statement.what {
            Instruction::Block(words) => Some((&statement.at, words)),
            _ => None,
        });
        let unknown = blocks.flat_map(|(at, words)| {
            let spoken: Vec<Spoken> =
                words.iter().map(|w| Spoken { address: w.address, value: value(w), point: w.point }).collect();
            let names = control.unknown(&spoken, post);
            names.into_iter().map(|(kind, name)| Unknown { at: at.clone(), name, kind }).collect::<Vec<_>>()
        });
        let outputs = self.code.statements.iter().filter_map(|statement| match &statement.what {
            Instruction::Set(var, _) if control.is_output(var) => {
                Some(Unknown { at: statement.at.clone(), name: var.to_string(), kind: UnknownKind::Output })
            }
            _ => None,
        });
        unknown.chain(outputs).collect()
    }

    /// Probing moves are programmed by direction and length.
    pub fn is_relative(&self) -> bool {
        self.dialect == DialectName::Klartext
    }

    /// Where it goes over to the control's own transformation: it cannot be judged without its plan.
    pub fn transforms(&self, source: &Source) -> Option<Failure> {
        needs_plan::transforms(self.dialect, &self.code, source)
    }

    /// Where it waits for a person between two touches: it cannot be judged without its plan.
    pub fn waits_for_a_mounting(&self, trunk: &[Happened], source: &Source) -> Option<Failure> {
        needs_plan::waits(trunk, source)
    }

    /// Where it finds an artefact: it cannot be judged without its plan.
    pub fn finds(&self, trunk: &[Happened], source: &Source) -> Option<Failure> {
        needs_plan::finds(trunk, source)
    }

    /// The set-up at which it is told to begin.
    pub fn begins_at(&self) -> Option<u32> {
        let (_, at) = self.from.as_ref()?;
        match self.code.statements.get(*at)?.what {
            // a number that is no set-up begins nowhere
            Instruction::Set(_, Expr::Number(n)) => {
                Some(if n.fract() == 0.0 && n >= 0.0 { n as u32 } else { u32::MAX })
            }
            _ => None,
        }
    }

    /// Set-ups at which it can begin.
    pub fn setups(&self) -> u32 {
        self.setups
    }

    /// The record of it for its plan; `text`: all of it.
    pub fn record(&self, post: &Postprocessor, text: &str) -> Proof {
        self.with_rules(post, |rules| statements::record(&self.code, rules, text))
    }

    /// Compares it with what was written. What a person has put in is known from then on.
    pub fn compare(&mut self, written: &Proof, post: &Postprocessor) -> Compared {
        let compared = self.with_rules(post, |rules| statements::compare(written, &self.code, rules));
        self.inserted.clone_from(&compared.inserted);
        compared
    }

    fn with_rules<T>(&self, post: &Postprocessor, of: impl FnOnce(&Rules<'_>) -> T) -> T {
        let rule = post.check.as_ref();
        let switches = rule.iter().flat_map(|rule| std::iter::once(&rule.from).chain(&rule.feed).chain(&rule.dry_run));
        of(&Rules {
            // Fanuc and Haas: a number without its point counts least increments
            points: self.dialect == DialectName::MacroB,
            switches: switches.filter_map(|written| set_at(&self.code, &variable(written))).collect(),
            harmless: &|statement| harmless::of(statement, post),
        })
    }

    /// Where a statement stands; behind the last one, where that ends.
    pub fn place(&self, statement: usize) -> Range<usize> {
        statements::place(&self.code, statement)
    }

    /// Where it is told at which set-up it begins.
    pub fn begins_in(&self) -> Range<usize> {
        let at = self.from.as_ref().and_then(|(_, at)| self.code.statements.get(*at));
        at.map_or(0..0, |s| s.at.clone())
    }

    /// The height of its dry run as it is written; 0: it measures. `None`: it has none.
    pub fn dry_run(&self) -> Option<(f64, Range<usize>)> {
        let (_, at) = self.dry_run.as_ref()?;
        let statement = self.code.statements.get(*at)?;
        match statement.what {
            Instruction::Set(_, Expr::Number(height)) => Some((height, statement.at.clone())),
            _ => None,
        }
    }

    /// The statements of its head that say at which set-up it begins and how high its dry run is, for others.
    pub(super) fn switched(&self, setup: u32, height: f64) -> Vec<(usize, Arc<Statement>)> {
        let own = |(switch, value): (&Option<(Var, usize)>, f64)| {
            let (var, at) = switch.as_ref()?;
            let statement = self.code.statements.get(*at)?;
            let what = Instruction::Set(*var, Expr::Number(value));
            Some((*at, Arc::new(Statement { what, at: statement.at.clone() })))
        };
        [(&self.from, f64::from(setup)), (&self.dry_run, height)].into_iter().filter_map(own).collect()
    }
}

/// The statement that gives a variable its number first.
fn set_at(code: &Code, var: &Var) -> Option<usize> {
    code.statements.iter().position(|s| matches!(&s.what, Instruction::Set(v, Expr::Number(_)) if v == var))
}

/// `#<_axiscal_from>`, `#100`, `Q1600`, `AXC_FROM` as a variable.
fn variable(written: &str) -> Var {
    let bare = written.trim_start_matches('#').trim_matches(['<', '>']);
    let digits = bare.strip_prefix('Q').unwrap_or(bare);
    digits.parse().map_or_else(|_| Var::named(bare), Var::Number)
}

/// The numbers with which a condition compares a variable.
fn compared(condition: &Expr, var: &Var, found: &mut dyn FnMut(f64)) {
    if let Expr::Two(_, left, right) = condition {
        match (left.as_ref(), right.as_ref()) {
            (Expr::Var(v), Expr::Number(n)) | (Expr::Number(n), Expr::Var(v)) if v == var => found(*n),
            _ => {
                compared(left, var, found);
                compared(right, var, found);
            }
        }
    }
}
