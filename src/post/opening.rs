//! The first moves of a program, and the way back in when it starts again at a later set-up.
//!
//! The first moves bring the machine from anywhere to a known place with the lift at its top, where nothing can meet
//! whatever the other axes do: the path has proven that. A run that starts again makes the same moves, then goes up
//! there to where its set-up begins, rotary axes first and in the sense in which they would have come, the lift last.

use super::emit::Writer;
use crate::axes::{AxisMap, AxisName};
use crate::diag::Result;
use crate::machine::Machine;
use crate::program::path::{Path, Step};
use minijinja::Value;

/// A rotary axis comes to its angle from so far past it, deg, where its range allows: its play is then taken up in the
/// same sense as in the whole program.
const OVERSHOOT_DEG: f64 = 5.0;

/// The first moves.
#[derive(Debug, Clone, Default)]
pub(super) struct Opening {
    /// Indices of the path's steps, in the order in which they are written.
    pub(super) steps: Vec<usize>,
    /// The rest, in order.
    pub(super) rest: Vec<usize>,
    /// The axis that lifts the probe over everything.
    lift: Option<AxisName>,
    /// Where every axis stands after them; `None` where that is not known.
    place: Option<AxisMap>,
    senses: AxisMap,
    oriented: Option<f64>,
}

/// The way to the beginning of a set-up.
#[derive(Debug, Clone, Default)]
pub(super) struct Resume {
    /// Lists of axis words.
    pub(super) moves: Vec<Value>,
    /// Orientation of the spindle, where it has changed since the first moves.
    pub(super) orient: Option<String>,
}

impl Opening {
    /// Takes the first moves out of the first set-up. Under a transformation linear axes go first: a turn needs to know
    /// where they stand.
    pub(super) fn of(path: &Path, machine: &Machine, tcp: bool) -> Self {
        let mut known = AxisMap::default();
        let whole = |known: &AxisMap| machine.axes.iter().all(|a| known.get(a.name).is_some());
        let mut setup = None;
        let mut steps = Vec::new();
        let mut lift = None;
        for (index, step) in path.steps.iter().enumerate() {
            if whole(&known) {
                break;
            }
            match step {
                Step::Setup { .. } if setup.is_none() => setup = Some(index),
                Step::Note(_) | Step::OrientSpindle { .. } => steps.push(index),
                Step::Rapid { to } | Step::Rotary { to, .. } => {
                    if lift.is_none() {
                        lift = to.iter().map(|(a, _)| a).find(|a| !a.is_rotary());
                    }
                    known = to.or(&known);
                    steps.push(index);
                }
                _ => break,
            }
        }
        if !whole(&known) {
            // a path by hand that begins otherwise: as it stands, and with no way back in
            return Self { rest: (0..path.steps.len()).collect(), ..Self::default() };
        }
        if tcp {
            steps.sort_by_key(|i| matches!(path.steps.get(*i), Some(Step::Rotary { .. })));
        }
        let rest = (0..path.steps.len()).filter(|i| !steps.contains(i)).collect();
        Self { steps, rest, lift, ..Self::default() }
    }
}

impl Writer<'_> {
    /// Remembers where the first moves have brought the machine.
    pub(super) fn opened(&mut self) {
        if self.opening.lift.is_some() && self.path.start_near.is_none() {
            self.opening.place = Some(self.at);
        }
        self.opening.senses = self.senses;
        self.opening.oriented = self.oriented;
    }

    /// The way from where the first moves end to where the machine stands now; `None` where it is not proven.
    pub(super) fn resume(&self) -> Result<Option<Resume>> {
        let (Some(opening), Some(lift)) = (self.opening.place, self.opening.lift) else { return Ok(None) };
        let mut stands = opening;
        let mut places = Vec::new();
        for axis in self.machine.rotary() {
            let (name, [low, high]) = (axis.name, axis.range);
            let (Some(value), sense) = (self.at.get(name), self.senses.get(name)) else { return Ok(None) };
            if opening.get(name) == Some(value) && self.opening.senses.get(name) == sense {
                continue;
            }
            let past = sense.map(|s| value - s * OVERSHOOT_DEG).filter(|v| (low..=high).contains(v));
            for target in past.into_iter().chain([value]) {
                let turn = AxisMap::default().with(name, target);
                places.extend(self.rotary_steps(&stands, &turn)?);
                stands = turn.or(&stands);
            }
        }
        let across = AxisName::ALL[..3].iter().copied().filter(|a| *a != lift);
        for axis in across.chain([lift]) {
            let Some(value) = self.at.get(axis) else { return Ok(None) };
            if stands.get(axis) == Some(value) {
                continue;
            }
            stands.set(axis, value);
            let here = AxisMap::default().with(axis, value);
            places.push(if self.frame.is_tcp() {
                let world = self.controller(&stands);
                AxisMap::xyz(world.0[0], world.0[1], world.0[2])
            } else {
                here
            });
        }
        let moves: Vec<Value> = places.iter().map(|place| self.words(place)).collect::<Result<_>>()?;
        let orient = self.oriented.filter(|_| self.oriented != self.opening.oriented).map(|deg| self.number(deg));
        Ok(Some(Resume { moves, orient }))
    }
}
