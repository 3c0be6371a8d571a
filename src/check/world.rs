//! Where the blocks are while a program is checked, and what the probe feels: the virtual machine without errors.
//!
//! A program speaks in the control's coordinates: machine coordinates of the axes, or of the tool centre point under the
//! control's own transformation. [`World::axes`] turns them into axis positions relative to R.

use super::code::VarHasher;
use super::run::{Outcome, Probe, Vm};
use crate::axes::{AxisMap, AxisName, Position};
use crate::simulate::Errorless;
use std::collections::HashMap;
use std::hash::BuildHasherDefault;
use std::sync::{PoisonError, RwLock};

/// The machine with what is mounted in each part of a program.
#[derive(Debug)]
pub struct World {
    parts: Vec<Errorless>,
    origin: Position,
    tcp: bool,
    /// Which part of a way is made until a block is met: the run from each set-up makes the same ways as the whole one.
    met: Kept<12, Option<f64>>,
    /// Whether the ball touches a block, by place.
    touched: Kept<6, bool>,
}

/// What is known, by what is mounted and the bits of a place or a way: only the very same one is the same.
type Kept<const N: usize, T> = RwLock<HashMap<(usize, [u64; N]), T, BuildHasherDefault<VarHasher>>>;

/// How many are kept of each, some 10 MB.
const MOST_KEPT: usize = 50_000;

/// What is known already, or else what is computed.
fn kept<const N: usize, T: Copy>(all: &Kept<N, T>, key: (usize, [u64; N]), compute: impl FnOnce() -> T) -> T {
    let has_room = {
        let known = all.read().unwrap_or_else(PoisonError::into_inner);
        if let Some(known) = known.get(&key) {
            return *known;
        }
        known.len() < MOST_KEPT
    };
    let value = compute();
    if has_room {
        all.write().unwrap_or_else(PoisonError::into_inner).insert(key, value);
    }
    value
}

/// How far a probe moves off a face until it closes, mm: any small way will do.
const RELEASED_MM: f64 = 0.02;

impl World {
    /// `origin`: machine coordinates at R's origin. `tcp`: coordinates are those of the tool centre point.
    pub fn new(parts: Vec<Errorless>, origin: &AxisMap, tcp: bool) -> Self {
        Self { parts, origin: origin.position(), tcp, met: RwLock::default(), touched: RwLock::default() }
    }

    /// Are the control's coordinates those of the tool centre point?
    pub fn is_tcp(&self) -> bool {
        self.tcp
    }

    /// Place of the last part.
    pub fn last_part(&self) -> usize {
        self.parts.len().saturating_sub(1)
    }

    /// Axis positions relative to R of the control's coordinates.
    pub fn axes(&self, part: usize, at: &Position) -> Position {
        let mut relative = *at;
        for axis in AxisName::ALL {
            relative.set(axis, at.get(axis) - self.origin.get(axis));
        }
        if !self.tcp {
            return relative;
        }
        // a machine whose linear axes do not span space has no transformation: its words stay as they are
        self.parts.get(part).and_then(|p| p.axes_of_tcp(&relative)).unwrap_or(relative)
    }

    /// Does the ball touch a block here, the blocks standing off by `shift`?
    pub fn touches(&self, part: usize, at: &Position, shift: &[f64; 3]) -> bool {
        let at = shifted(at, shift);
        let is_met = |p: &Errorless| p.touches(&self.axes(part, &at));
        kept(&self.touched, (part, at.0.map(f64::to_bits)), || self.parts.get(part).is_some_and(is_met))
    }

    /// How a probing move ends.
    pub fn outcome(&self, vm: &Vm, probe: &Probe) -> Outcome {
        let way = way_mm(probe);
        let part = |mm: f64| if way > 0.0 { (mm / way).min(1.0) } else { 1.0 };
        match (probe.toward, vm.deflected()) {
            (true, true) => Outcome { hit: true, part: 0.0 },
            (true, false) => {
                let (from, to) = (shifted(&probe.from, &vm.shift), shifted(&probe.to, &vm.shift));
                let (from, to) = (self.axes(vm.part, &from), self.axes(vm.part, &to));
                match self.meets_at(vm.part, &from, &to) {
                    Some(part) => Outcome { hit: true, part },
                    None => Outcome { hit: false, part: 1.0 },
                }
            }
            (false, true) if vm.stuck => Outcome { hit: false, part: 1.0 },
            (false, true) => Outcome { hit: true, part: part(RELEASED_MM) },
            (false, false) => Outcome { hit: true, part: 0.0 },
        }
    }

    /// The part of a way until the ball meets a block.
    fn meets_at(&self, part: usize, from: &Position, to: &Position) -> Option<f64> {
        let mut bits = [0; 12];
        bits.iter_mut().zip(from.0.iter().chain(&to.0)).for_each(|(bits, x)| *bits = x.to_bits());
        let first = |p: &Errorless| p.first(from, to).map(|m| m.part);
        kept(&self.met, (part, bits), || self.parts.get(part).and_then(first))
    }

    /// The block that a search meets.
    pub fn met(&self, part: usize, probe: &Probe) -> Option<String> {
        let (from, to) = (self.axes(part, &probe.from), self.axes(part, &probe.to));
        self.parts.get(part)?.first(&from, &to).map(|m| m.block)
    }
}

/// The linear way of a probing move in the control's coordinates, mm.
pub fn way_mm(probe: &Probe) -> f64 {
    (probe.to.xyz_mm() - probe.from.xyz_mm()).norm()
}

fn shifted(at: &Position, shift: &[f64; 3]) -> Position {
    let mut out = *at;
    for (slot, s) in out.0.iter_mut().zip(shift) {
        *slot -= s;
    }
    out
}
