//! Where a number puts an axis, and what the control shows of where it stands: units, offsets, lengths, whole turns.

use super::MacroB;
use crate::axes::AxisName;
use crate::check::run::{Spoken, Vm};
use crate::units::mm_from_inch;

/// Whole turn, deg.
const TURN: f64 = 360.0;

/// Angles that differ by less are the same, deg.
pub(super) const SAME_DEG: f64 = 1e-6;

/// Tool offsets that a control has at most.
const MOST_OFFSETS: u32 = 999;

impl MacroB {
    pub(super) fn unit(&self, axis: AxisName) -> f64 {
        if self.inch && !axis.is_rotary() { mm_from_inch(1.0) } else { 1.0 }
    }

    /// Offsets of the chosen work coordinate system, mm and deg: each has its own.
    pub(super) fn offset(&self, axis: AxisName) -> f64 {
        if !self.offsets {
            return 0.0;
        }
        let n = (self.system - 50.0) + self.system_p;
        [7.5, -3.25, 11.0, 1.5, -2.0, 0.75][axis.index()] * n / 4.0
    }

    /// Machine coordinate less work coordinate, mm or deg.
    pub(super) fn shift(&self, axis: AxisName) -> f64 {
        let tool = if axis == AxisName::Z && self.tool_on { self.tool_mm } else { 0.0 };
        self.offset(axis) + self.external[axis.index()] + self.local[axis.index()] + tool
    }

    /// Sense of the program's coordinate.
    pub(super) fn sense(&self, axis: AxisName) -> f64 {
        if self.mirrored && axis == AxisName::X { -1.0 } else { 1.0 }
    }

    /// What the tool offset memory holds under a number, mm: another length under each, so that one that is read for another
    /// shows. Offset 0 is none.
    pub(super) fn stored_mm(&self, number: u32) -> f64 {
        const APART_MM: f64 = 0.375;
        if number == 0 { 0.0 } else { self.stored_from_mm + APART_MM * f64::from(number) }
    }

    /// The length that H chooses, mm.
    pub(super) fn chosen_mm(&self, words: &[Spoken]) -> Result<f64, String> {
        let h = words.iter().find(|w| w.address == "H").ok_or("the number of the tool offset, H, is missing")?.value;
        if h.fract() != 0.0 || !(0.0..=f64::from(MOST_OFFSETS)).contains(&h) {
            return Err(format!("H{h} is no tool offset"));
        }
        Ok(self.stored_mm(h as u32))
    }

    pub(super) fn axis(&self, number: u32) -> Option<AxisName> {
        AxisName::ALL.into_iter().find(|a| self.numbers[a.index()] == Some(number))
    }

    pub(super) fn target(&self, words: &[Spoken], vm: &mut Vm) -> [Option<f64>; 6] {
        AxisName::ALL.map(|axis| {
            let way =
                self.sense(axis) * self.length(words.iter().find(|w| w.address.starts_with(axis.letter()))?, axis);
            Some(match (self.incremental, self.modulo[axis.index()]) {
                (true, _) => vm.at.get(axis) + way,
                (false, true) => self.turn(axis, way, vm),
                (false, false) => way + self.shift(axis),
            })
        })
    }

    /// Where a roll-over axis ends, whole turns counted: its sign is the sense in which it turns (No. 1008, RABx = 1).
    pub(super) fn turn(&self, axis: AxisName, value: f64, vm: &mut Vm) -> f64 {
        let place = value.abs() + self.shift(axis);
        let at = vm.at.get(axis);
        let mut by = (place - at).rem_euclid(TURN);
        if !(SAME_DEG..=TURN - SAME_DEG).contains(&by) {
            by = 0.0;
        }
        if value.is_sign_negative() && by > 0.0 {
            by -= TURN;
        }
        if vm.known[axis.index()] {
            return at + by;
        }
        // nobody knows how often it has turned: counted as the plan does from here on
        let near = vm.turned_near.get(axis);
        let end = near + (place - near + TURN / 2.0).rem_euclid(TURN) - TURN / 2.0;
        vm.at.set(axis, end - by);
        end
    }

    /// What the control shows of a position, mm or deg.
    pub(super) fn shown(&self, axis: AxisName, place: f64) -> f64 {
        if !self.modulo[axis.index()] {
            return place;
        }
        let turned = place.rem_euclid(TURN);
        if turned > TURN - SAME_DEG { 0.0 } else { turned }
    }

    /// A number without its point counts least increments.
    pub(super) fn length(&self, word: &Spoken, axis: AxisName) -> f64 {
        const LEAST_MM: f64 = 0.001;
        const LEAST_INCH: f64 = 0.0001;
        let least = if self.inch && !axis.is_rotary() { LEAST_INCH } else { LEAST_MM };
        word.value * if word.point { 1.0 } else { least } * self.unit(axis)
    }
}
