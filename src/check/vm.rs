//! The axes of the machine that runs a program, and the record of what happened.

use super::seconds::Clock;
use super::world::World;
use crate::axes::{AxisName, Position};
use crate::log;
use crate::units::Plain;
use std::ops::Range;
use std::sync::Arc;

/// How fast a move is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Rate {
    /// As fast as the machine can; each axis by itself unless the control says otherwise.
    Rapid,
    /// mm/min, or deg/min where only rotary axes move.
    Feed(f64),
}

/// A move that the probe may end.
#[derive(Debug, Clone, PartialEq)]
pub struct Probe {
    /// Where it begins: the control's coordinates in machine coordinates.
    pub from: Position,
    /// Where it ends if nothing happens.
    pub to: Position,
    /// mm/min
    pub feed: f64,
    /// It ends at contact; `false`: it ends when contact is lost.
    pub toward: bool,
    /// The place from which each axis comes is known.
    pub known: [bool; 6],
    /// The operator's feed override acts on it.
    pub overridden: bool,
    /// When the control itself breaks the program off.
    pub alarm: Alarm,
}

/// When a control breaks a program off at a move that the probe may end, with an alarm of its own.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Alarm {
    /// The program has to look.
    Never,
    /// When the event for which it waits does not come.
    WithoutEvent,
    /// When it does: a guarded move of a macro package.
    AtEvent,
}

impl Alarm {
    /// How it stands in a proof.
    pub fn word(self) -> &'static str {
        match self {
            Self::Never => "false",
            Self::WithoutEvent => "true",
            Self::AtEvent => "at the event",
        }
    }

    /// Does it come?
    pub fn comes(self, outcome: Outcome) -> bool {
        match self {
            Self::Never => false,
            Self::WithoutEvent => !outcome.hit,
            Self::AtEvent => outcome.hit,
        }
    }
}

/// How a move that the probe may end did end.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Outcome {
    /// The event that it waited for came.
    pub hit: bool,
    /// Which part of the way was made, 0 to 1.
    pub part: f64,
}

/// Something that a person or a machine would notice.
#[derive(Debug, Clone, PartialEq)]
pub enum Event {
    /// A move that does not look at the probe.
    Move {
        from: Position,
        to: Position,
        /// How fast.
        rate: Rate,
        /// The place from which each axis comes is known.
        known: [bool; 6],
        /// Corners are driven to: the next move begins where this one ends.
        exact: bool,
        /// The axes that the block names.
        named: [bool; 6],
    },
    /// A move that looked at the probe.
    Probe {
        /// As it was programmed.
        probe: Probe,
        /// How it ended.
        outcome: Outcome,
        /// The place that the control keeps of it.
        latched: Position,
    },
    /// The control itself went back from where the probe had triggered, as a part of the same block.
    Release {
        /// From the contact.
        from: Position,
        /// To where it then stands.
        to: Position,
    },
    /// A log was opened.
    LogOpen {
        name: String,
        /// What it held is kept.
        append: bool,
    },
    /// A line went into the log.
    Log(String),
    /// The log was closed.
    LogClose,
    /// A message was shown.
    Message(String),
    /// The program waited for a person, with this text.
    Wait(String),
    /// The program was broken off.
    Abort(String),
    /// The spindle was turned to an angle, deg.
    Orient(f64),
    /// Something else that the machine does, by its word.
    Other(String),
    /// The program ended.
    End,
}

/// The word of [`Event::Other`] for a spindle that is switched off.
pub const SPINDLE_OFF: &str = "spindle off";

/// An event with its place in the program.
#[derive(Debug, Clone, PartialEq)]
pub struct Happened {
    /// Bytes of the text.
    pub at: Range<usize>,
    pub event: Event,
}

/// The axes, the record of what happened, and what a dialect needs of both.
#[derive(Debug, Clone)]
pub struct Vm {
    /// Machine coordinates.
    pub at: Position,
    /// Axes whose place the program knows because it has sent them there.
    pub known: [bool; 6],
    pub trace: Vec<Happened>,
    /// The statement that is being done.
    pub place: Range<usize>,
    /// Which axes the machine has.
    pub axes: [bool; 6],
    /// Where the blocks are.
    pub world: Arc<World>,
    /// What is mounted.
    pub part: usize,
    /// The first stop only says what must be mounted.
    pub stop_is_reminder: bool,
    /// The probe does not close any more.
    pub stuck: bool,
    /// How much further along X, Y, Z the blocks seem to stand, mm.
    pub shift: [f64; 3],
    /// The artefact was put down by eye, and no line of the log says yet that it is found.
    pub finding: bool,
    /// Searches that found a face since the last line of the log.
    pub hits: usize,
    /// An axis has moved since the last stop.
    pub moved: bool,
    /// The program has looked at the probe since the last move.
    pub asked: bool,
    /// The angles near which axes that count from 0 to 360 are counted when they first move, deg.
    pub turned_near: Position,
    /// Since the program began, without the time in which it waits for a person.
    pub clock: Clock,
}

impl Vm {
    /// The axes as they stand, without what has happened.
    pub fn without_record(&self) -> Self {
        Self { trace: Vec::new(), place: self.place.clone(), world: self.world.clone(), ..*self }
    }

    /// What a clock shows that counts whole ticks of so many seconds.
    pub fn clock_s(&self, tick_s: f64) -> f64 {
        // no tick falls on a moment that a program of round numbers meets: a last digit would then be a matter of rounding
        const AFTER_A_TICK: f64 = 0.123_457;
        ((self.clock.seconds / tick_s + AFTER_A_TICK).floor() * tick_s).max(0.0)
    }

    /// Is the next contact that of a search, and not that of the measuring touch behind it?
    pub fn searches(&self) -> bool {
        // touches that find the artefact write no line
        if self.finding { self.hits.is_multiple_of(2) } else { self.hits == 0 }
    }

    /// Is the probe deflected here?
    pub fn deflected(&self) -> bool {
        self.stuck || self.world.touches(self.part, &self.at, &self.shift)
    }

    /// Notes an event.
    pub fn note(&mut self, event: Event) {
        self.asked &= !matches!(event, Event::Move { .. } | Event::Probe { .. });
        self.clock.pass(&event);
        match &event {
            // several stops without a move between them are one
            Event::Wait(_) if self.moved => {
                self.moved = false;
                if !std::mem::take(&mut self.stop_is_reminder) {
                    self.part = (self.part + 1).min(self.world.last_part());
                }
            }
            Event::Log(text) => {
                self.hits = 0;
                self.finding &= !log::says_found(text);
            }
            Event::Move { .. } | Event::Release { .. } => self.moved = true,
            Event::Probe { probe, outcome, .. } => {
                self.moved = true;
                self.hits += usize::from(probe.toward && outcome.hit);
            }
            _ => {}
        }
        self.trace.push(Happened { at: self.place.clone(), event });
    }

    /// A move that does not look at the probe.
    pub fn go(&mut self, to: &[Option<f64>; 6], rate: Rate, exact: bool) -> Result<(), String> {
        self.refuse_missing(to)?;
        let from = self.at;
        let known = self.known;
        let mut end = from;
        for axis in AxisName::ALL {
            if let Some(value) = to[axis.index()] {
                end.set(axis, value);
                self.known[axis.index()] = true;
            }
        }
        self.at = end;
        self.note(Event::Move { from, to: end, rate, known, exact, named: to.map(|v| v.is_some()) });
        Ok(())
    }

    /// No move has an axis that the machine lacks, or a number that is none.
    pub fn refuse_missing(&self, to: &[Option<f64>; 6]) -> Result<(), String> {
        for axis in AxisName::ALL {
            let Some(value) = to[axis.index()] else { continue };
            if !self.axes[axis.index()] {
                return Err(format!("the machine has no axis {axis}"));
            }
            if !value.is_finite() || value.abs() > 1e6 {
                return Err(format!("{axis} is sent to {}", Plain(value)));
            }
        }
        Ok(())
    }

    /// The end of a probing move.
    pub fn target(&self, to: &[Option<f64>; 6]) -> Result<Position, String> {
        self.refuse_missing(to)?;
        let mut end = self.at;
        for axis in AxisName::ALL {
            if let Some(value) = to[axis.index()] {
                end.set(axis, value);
            }
        }
        Ok(end)
    }
}
