//! The one machine that runs the programs of all dialects: statements, axes, what happened.
//!
//! It stops at every move that a probe may end ([`Pause::Probe`]); whoever runs it decides how that move ends. So one
//! program can be run with every touch missed, with contact on the way, with a probe that does not close again.

use super::code::{Code, Expr, Instruction, Piece, Statement, VALUE, Values, Var, Word, numbered};
use super::doubt::{Doubt, Doubts, Fork};
use super::harmless::Harmless;
use super::vm;
use crate::axes::Position;
use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;
use std::sync::Arc;

pub use super::dialect::{Dialect, LeftoverMode, Next, Spoken, Start};
pub use vm::{Alarm, Event, Happened, Outcome, Probe, Rate, SPINDLE_OFF, Vm};

/// Where a run rests.
#[derive(Debug, Clone, PartialEq)]
pub enum Pause {
    /// At a move that the probe may end.
    Probe(Probe),
    /// At its end.
    Done,
}

/// Why a run cannot go on.
#[derive(Debug, Clone, PartialEq)]
pub struct Fault {
    /// Bytes of the text.
    pub at: Range<usize>,
    /// What is wrong.
    pub says: String,
}

/// Where the axes stand when they have stopped behind a contact: they need a way for that. A program that logs this place, and
/// not the one that the control has kept, shows.
fn beyond(probe: &Probe, contact: &Position) -> Position {
    const OVERTRAVEL_MM: f64 = 0.0085;
    let way = probe.to.xyz_mm() - probe.from.xyz_mm();
    let mut at = *contact;
    if let Some(along) = way.try_normalize(1e-12) {
        let left = (probe.to.xyz_mm() - contact.xyz_mm()).norm();
        at.0.iter_mut().zip(along.iter()).for_each(|(slot, a)| *slot += a * OVERTRAVEL_MM.min(left));
    }
    at
}

/// What the encoders of a real machine say at a contact: each axis off by its own fraction of a least step, another one at each
/// place. A reading that is left over from another touch, or that nobody has made, shows.
fn latched(contact: &Position, axes: &[bool; 6], rotary: bool) -> Position {
    const OFF: [f64; 6] = [0.5e-3, 0.45e-3, 0.4e-3, 0.4e-3, 0.5e-3, 0.6e-3];
    // the same place has the same reading, whatever came before it
    let phase = contact.0.iter().zip([12.9898, 78.233, 37.719, 4.581, 9.137, 7.313]).map(|(x, f)| x * f).sum::<f64>();
    let mut at = *contact;
    for (k, (slot, off)) in at.0.iter_mut().zip(OFF).enumerate().filter(|(k, _)| axes[*k] && (*k < 3 || rotary)) {
        *slot += off * (phase + 1.7 * k as f64).sin();
    }
    at
}

/// What may go wrong at a statement that is no move.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Trouble {
    /// A line cannot be written.
    LogFull,
    /// The probe is deflected when the program looks at it.
    Deflected,
}

/// Statements after which a run that has not ended never will.
const MOST_STATEMENTS: u64 = 3_000_000;

/// Where a subroutine leads back to.
#[derive(Debug, Clone)]
struct Return {
    next: usize,
    /// The step of the body that the subroutine is a part of.
    step: Option<Range<usize>>,
}

/// A program on its way.
#[derive(Debug, Clone)]
pub struct Run<'p, D> {
    pub(super) code: &'p Code,
    /// Statements that stand in place of the program's: at which set-up it begins, whether it only tries.
    pub switched: Vec<(usize, Arc<Statement>)>,
    /// What a person has put in, by statement.
    pub inserted: &'p BTreeMap<usize, Harmless>,
    pub(super) next: usize,
    returns: Vec<Return>,
    done: u64,
    pending: Option<Probe>,
    over: bool,
    texts: BTreeMap<Var, String>,
    /// Logs that were thrown away, and the one into which it writes, where none is opened.
    deleted: BTreeSet<String>,
    writes_to: Option<String>,
    /// No log takes a line any more.
    log_is_full: bool,
    /// Runs in which there is trouble at a statement are kept: what, and the run at that statement.
    pub keeps_forks: bool,
    forks: Vec<(Trouble, Self)>,
    /// What of its values is not known.
    pub doubts: Doubts,
    pub(super) doubted: Vec<Fork<'p, D>>,
    /// The axes and the record.
    pub vm: Vm,
    /// The language.
    pub dialect: D,
}

impl<'p, D: Dialect> Run<'p, D> {
    /// A program that begins.
    pub fn new(code: &'p Code, inserted: &'p BTreeMap<usize, Harmless>, dialect: D, vm: Vm) -> Self {
        Self {
            code,
            inserted,
            switched: Vec::new(),
            next: 0,
            returns: Vec::new(),
            done: 0,
            pending: None,
            over: false,
            texts: BTreeMap::new(),
            deleted: BTreeSet::new(),
            writes_to: None,
            log_is_full: false,
            keeps_forks: false,
            forks: Vec::new(),
            doubts: Doubts::default(),
            doubted: Vec::new(),
            vm,
            dialect,
        }
    }

    /// Takes the runs that went the other way at a condition whose values are not known.
    pub fn take_doubted(&mut self) -> Vec<Fork<'p, D>> {
        std::mem::take(&mut self.doubted)
    }

    /// How deep in subroutines it is.
    pub(super) fn depth(&self) -> usize {
        self.returns.len()
    }

    /// Takes the runs in which there is trouble.
    pub fn take_forks(&mut self) -> Vec<(Trouble, Self)> {
        std::mem::take(&mut self.forks)
    }

    /// The run as it stands, without what has happened and the runs that it has kept.
    pub(super) fn without_record(&self) -> Self {
        Self {
            code: self.code,
            switched: self.switched.clone(),
            inserted: self.inserted,
            next: self.next,
            returns: self.returns.clone(),
            done: self.done,
            pending: self.pending.clone(),
            over: self.over,
            texts: self.texts.clone(),
            deleted: self.deleted.clone(),
            writes_to: self.writes_to.clone(),
            log_is_full: self.log_is_full,
            keeps_forks: false,
            forks: Vec::new(),
            doubts: self.doubts.clone(),
            doubted: Vec::new(),
            vm: self.vm.without_record(),
            dialect: self.dialect.clone(),
        }
    }

    /// Keeps the run that comes to this statement again with trouble.
    fn fork(&mut self, trouble: Trouble) {
        if !self.keeps_forks {
            return;
        }
        let mut fork = self.without_record();
        (fork.keeps_forks, fork.next) = (false, fork.next - 1);
        match trouble {
            Trouble::LogFull => fork.log_is_full = true,
            Trouble::Deflected => {
                fork.vm.stuck = true;
                fork.vm.note(Event::Other("the probe is deflected".to_owned()));
            }
        }
        self.forks.push((trouble, fork));
    }

    /// The statement that stands here in place of the program's.
    pub(super) fn own(&self) -> Option<Arc<Statement>> {
        self.switched.iter().find(|(at, _)| *at == self.next).map(|(_, own)| own.clone())
    }

    /// On to the next move that the probe may end, or to the end.
    ///
    /// # Errors
    /// What the control would not do.
    pub fn on(&mut self) -> Result<Pause, Fault> {
        if let Some(probe) = &self.pending {
            return Ok(Pause::Probe(probe.clone()));
        }
        while !self.over {
            let code = self.code;
            let own = self.own();
            let Some(statement) = own.as_deref().or_else(|| code.statements.get(self.next)) else {
                let end = code.statements.last().map_or(0..0, |s| s.at.clone());
                return Err(Fault { at: end, says: "the program has no end".to_owned() });
            };
            self.done += 1;
            if self.done > MOST_STATEMENTS {
                return Err(Fault { at: statement.at.clone(), says: "the program runs in a circle".to_owned() });
            }
            self.next += 1;
            let step = self.returns.last().and_then(|back| back.step.as_ref());
            self.vm.place.clone_from(step.unwrap_or(&statement.at));
            let fault = |says: String| Fault { at: statement.at.clone(), says };
            match self.inserted.get(&(self.next - 1)) {
                Some(Harmless::Modes) => {
                    self.changes_nothing(statement).map_err(fault)?;
                    continue;
                }
                // it waits, or switches something that moves nothing
                Some(_) => continue,
                None => {}
            }
            if let Some(probe) = self.statement(statement).map_err(fault)? {
                self.pending = Some(probe.clone());
                return Ok(Pause::Probe(probe));
            }
        }
        Ok(Pause::Done)
    }

    /// Modal words that were put in: they act already.
    fn changes_nothing(&mut self, statement: &Statement) -> Result<(), String> {
        let before = self.dialect.settings();
        self.statement(statement)?;
        if self.dialect.settings() == before {
            return Ok(());
        }
        Err("modal words that were put in change how the control counts".to_owned())
    }

    /// The move at which it rests ended like this.
    pub fn resolve(&mut self, outcome: Outcome) {
        let Some(probe) = self.pending.take() else { return };
        let mut stands = probe.from;
        for (slot, end) in stands.0.iter_mut().zip(probe.to.0) {
            *slot += (end - *slot) * outcome.part;
        }
        if outcome.part >= 1.0 {
            stands = probe.to;
        }
        let touched = outcome.hit && outcome.part > 0.0 && probe.toward;
        let latches = self.dialect.latches();
        // under a transformation an angle's last digits would move the linear axes by more than those of the log
        let rotary = self.dialect.latches_rotary() && !self.vm.world.is_tcp();
        let latched = if touched && latches { latched(&stands, &self.vm.axes, rotary) } else { stands };
        self.vm.at = if touched && latches { beyond(&probe, &stands) } else { stands };
        self.vm.note(Event::Probe { probe: probe.clone(), outcome, latched });
        self.dialect.probed(&probe, outcome, &latched);
        if probe.alarm.comes(outcome) {
            let says = match (outcome.hit, probe.toward) {
                (true, _) => "contact on the way",
                (false, true) => "the move ended without contact",
                (false, false) => "the probe did not close",
            };
            self.vm.note(Event::Abort(says.to_owned()));
            self.over = true;
        }
    }

    /// It has ended.
    pub fn is_over(&self) -> bool {
        self.over
    }

    fn value(&self, expr: &Expr) -> Result<f64, String> {
        expr.value(&|var| self.dialect.read(var, &self.vm), &|var| self.dialect.exists(var))
    }

    fn text(&self, text: &[Piece]) -> Result<String, String> {
        let mut out = String::new();
        for piece in text {
            match piece {
                Piece::Text(t) => out.push_str(t),
                Piece::Held(var) => {
                    out.push_str(self.texts.get(var).ok_or_else(|| format!("{var} has no value"))?);
                }
                Piece::Fixed { decimals, width, value } => {
                    out.push_str(&self.dialect.spell(self.value(value)?, *decimals, *width));
                }
            }
        }
        Ok(out)
    }

    /// The variable whose number an expression computes.
    pub(super) fn variable(&self, number: &Expr) -> Result<Var, String> {
        numbered(self.value(number)?)
    }

    pub(super) fn statement(&mut self, statement: &Statement) -> Result<Option<Probe>, String> {
        match &statement.what {
            Instruction::Block(words) => {
                self.refuse_outside(words)?;
                let spoken = self.spoken(words)?;
                match self.dialect.block(&spoken, &mut self.vm)? {
                    Next::On => {}
                    Next::Probe(probe) => return Ok(Some(probe)),
                    Next::End => self.end(Event::End),
                }
            }
            Instruction::Set(var, expr) => {
                let (value, doubt) = (self.value(expr)?, self.doubt(expr));
                self.dialect.write(var, value, &self.vm)?;
                self.given(var, doubt);
            }
            Instruction::SetIndirect(number, expr) => {
                let (var, value) = (self.variable(number)?, self.value(expr)?);
                let doubt = self.doubt(number).max(self.doubt(expr));
                self.dialect.write(&var, value, &self.vm)?;
                self.given(&var, doubt);
            }
            Instruction::Jump(to) => self.next = *to,
            Instruction::JumpUnless(condition, to) => {
                if condition.reads(&|var| self.dialect.is_probe_input(var)) {
                    self.fork(Trouble::Deflected);
                    self.vm.asked = true;
                }
                let holds = self.value(condition)? != 0.0;
                if let Some(doubt) = self.doubt(condition) {
                    self.in_doubt(doubt, holds, *to);
                }
                if !holds {
                    self.next = *to;
                }
            }
            Instruction::Call { to, gives, texts, is_step } => {
                const DEEPEST: usize = 10;
                if self.returns.len() >= DEEPEST {
                    return Err("subroutines call each other more than ten deep".to_owned());
                }
                let mut given = Vec::with_capacity(gives.len());
                for (var, expr) in gives {
                    given.push((*var, self.value(expr)?, self.doubt(expr)));
                }
                for (var, text) in texts {
                    let text = self.text(text)?;
                    self.texts.insert(*var, text);
                }
                let outer = self.returns.last().and_then(|back| back.step.clone());
                let step = outer.or_else(|| is_step.then(|| statement.at.clone()));
                self.returns.push(Return { next: self.next, step });
                self.next = *to;
                self.dialect.entered();
                // its variables are its own: nothing is known of those of the subroutine before it
                self.doubts.enters(self.returns.len());
                for (var, value, doubt) in given {
                    self.dialect.write(&var, value, &self.vm)?;
                    self.given(&var, doubt);
                }
            }
            Instruction::Return(expr) => {
                let value = expr.as_ref().map(|v| self.value(v)).transpose()?;
                let doubt = expr.as_ref().and_then(|v| self.doubt(v));
                self.next = self.returns.pop().ok_or("a return outside of a subroutine")?.next;
                self.dialect.left(value, &self.vm);
                self.given(&VALUE, doubt);
            }
            Instruction::Leave(to) => {
                while self.returns.pop().is_some() {
                    self.dialect.left(None, &self.vm);
                }
                self.next = *to;
            }
            Instruction::Message(text) => self.say(text, Event::Message)?,
            Instruction::Wait(text) => self.say(text, Event::Wait)?,
            Instruction::LogLine(text) => self.say(text, Event::Log)?,
            Instruction::LogOpen { name, append } => {
                let name = self.text(name)?;
                self.vm.note(Event::LogOpen { name, append: *append });
            }
            Instruction::LogClose => self.vm.note(Event::LogClose),
            Instruction::SetText { var, most, text } => {
                let text = self.text(text)?;
                if text.chars().count() > *most {
                    return Err(format!("{var} holds {most} characters, the text has {}", text.chars().count()));
                }
                self.texts.insert(*var, text);
            }
            Instruction::LogWrite { error, name, text } => self.log_write(error, name, text)?,
            Instruction::LogDelete { error, name } => {
                let name = self.text(name)?;
                if self.writes_to.as_ref() == Some(&name) {
                    return Err(format!("the log {name} is thrown away after something was written into it"));
                }
                self.deleted.insert(name);
                self.dialect.write(error, 0.0, &self.vm)?;
            }
            Instruction::Abort(text) => {
                let text = self.text(text)?;
                self.end(Event::Abort(text));
            }
            Instruction::End => self.end(Event::End),
        }
        Ok(None)
    }

    /// What a block does must not depend on a clock or an input.
    fn refuse_outside(&self, words: &[Word]) -> Result<(), String> {
        match words.iter().find(|w| self.doubt(&w.value) == Some(Doubt::Outside)) {
            Some(word) => Err(format!(
                "the value of {} depends on a clock or an input: what the block does is not known",
                word.address
            )),
            None => Ok(()),
        }
    }

    fn log_write(&mut self, error: &Var, name: &[Piece], text: &[Piece]) -> Result<(), String> {
        const FULL: f64 = 10.0;
        let (name, text) = (self.text(name)?, self.text(text)?);
        if self.log_is_full {
            self.vm.note(Event::Other(format!("no line goes into {name}")));
            return self.dialect.write(error, FULL, &self.vm);
        }
        self.fork(Trouble::LogFull);
        if self.writes_to.as_ref() != Some(&name) {
            self.vm.note(Event::LogOpen { name: name.clone(), append: !self.deleted.contains(&name) });
            self.writes_to = Some(name);
        }
        self.vm.note(Event::Log(text));
        self.dialect.write(error, 0.0, &self.vm)
    }

    fn say(&mut self, text: &[Piece], event: fn(String) -> Event) -> Result<(), String> {
        let text = self.text(text)?;
        self.vm.note(event(text));
        Ok(())
    }

    fn end(&mut self, event: Event) {
        if self.writes_to.take().is_some() {
            self.vm.note(Event::LogClose);
        }
        self.vm.note(event);
        self.over = true;
    }

    fn spoken(&self, words: &[Word]) -> Result<Vec<Spoken>, String> {
        let speak = |w: &Word| Ok(Spoken { address: w.address, value: self.value(&w.value)?, point: w.point });
        words.iter().map(speak).collect()
    }
}

/// Reads a variable of the program's own.
///
/// # Errors
/// When it has no value yet.
pub fn own(values: &Values, var: &Var) -> Result<f64, String> {
    values.get(var).copied().ok_or_else(|| format!("{var} has no value"))
}
