//! What a table leaves: found by driving the machine with its errors by the control that knows the table.

use super::carried::with_active;
use super::{Carried, Filled, grids, workpiece};
use crate::axes::{AxisName, Position};
use crate::machine::{Machine, Side};
use crate::tables::compensation::Term;
use crate::tables::correction::{Correction, left_um};
use crate::tables::kins::{Errors, Kins};
use crate::tables::lines::Seen;
use crate::tables::linuxcnc::Left;
use crate::units::um_from_mm;
use nalgebra::Vector3;
use std::collections::BTreeMap;

/// A control's steps are larger than this, µm: less is rounding of numbers, not of tables.
const NOTHING_UM: f64 = 1e-3;

/// What a control leaves of constant errors, at the worst pose and place, µm.
pub(super) struct Figures {
    pub rounding_um: f64,
    /// Of all that is known.
    pub rest_um: f64,
    /// More, with a tool 100 mm longer.
    pub longer_tool_um: f64,
    /// Of all that is known, without the new numbers.
    pub without_um: f64,
}

/// What the figures are made from.
pub(super) struct Pieces<'a> {
    pub machine: &'a Machine,
    pub correction: &'a Correction,
    pub carried: &'a Carried,
    pub filled: &'a Filled,
    pub zero: &'a BTreeMap<AxisName, f64>,
    pub has_grids: bool,
    pub radius_mm: f64,
}

impl Pieces<'_> {
    /// Poses over the ranges of the rotary axes.
    fn poses(&self) -> Vec<Position> {
        let mut poses = vec![Position::default()];
        for axis in self.machine.rotary() {
            let [low, high] = axis.range;
            let steps: Vec<f64> =
                (0..7).map(|i| low.max(-180.0) + (high.min(180.0) - low.max(-180.0)) * f64::from(i) / 6.0).collect();
            poses = poses
                .iter()
                .flat_map(|p| {
                    steps.iter().map(|deg| {
                        let mut at = *p;
                        at.set(axis.name, *deg);
                        at
                    })
                })
                .collect();
        }
        poses
    }

    /// Places of the workpiece: about its last rotary axis at the stated radius, at the ball's height.
    fn places(&self) -> Vec<Vector3<f64>> {
        let foot = workpiece(self.machine);
        let Some(axis) = self.machine.side(Side::Workpiece).filter(|a| a.name.is_rotary()).last() else {
            return vec![foot];
        };
        let d = axis.direction.into_inner();
        let u = d.cross(&if d.x.abs() < 0.9 { Vector3::x() } else { Vector3::y() }).normalize();
        let v = d.cross(&u);
        [u, v, -u, -v].map(|w| foot + w * self.radius_mm).to_vec()
    }

    /// Largest distance of the ball, µm, where a control drives a machine with these errors.
    fn worst(&self, control: &Seen, errors: Errors, longer: f64, told_deg: &BTreeMap<AxisName, f64>) -> f64 {
        let length = self.machine.tool.length_mm;
        let nominal = Seen::from_errors(self.machine, &Errors::from_terms(&[], self.carried.reference_mm), length);
        let kins = Kins::new(self.machine, errors, length + longer);
        let (poses, places) = (self.poses(), self.places());
        let off = |pose: &Position| {
            places
                .iter()
                .map(|place| control.ball_off((&nominal, &kins), place, pose, longer, told_deg).norm())
                .fold(0.0, f64::max)
        };
        um_from_mm(poses.iter().map(off).fold(0.0, f64::max))
    }

    fn errors(&self, terms: &[Term]) -> Errors {
        Errors::from_terms(terms, self.carried.reference_mm)
    }

    /// Distance at which a tilt acts, mm.
    fn lever(&self, axis: AxisName) -> f64 {
        match self.machine.axis(axis) {
            Some(axis) if axis.side == Side::Tool => self.machine.tool.length_mm,
            _ => self.radius_mm,
        }
    }

    /// What is known and not held, each alone and by its size: an offset as it is, a tilt times the distance at which it acts,
    /// as for every other control.
    pub(super) fn left(&self) -> Vec<Left> {
        let mut out = Vec::new();
        for (term, why) in self.carried.not.iter().filter(|(t, _)| t.value != 0.0) {
            let lever = self.lever(term.axis);
            let um = left_um(term.value, &term.unit, lever);
            out.push(row(&term.parameter, &term.effect, (term.value, &term.unit), lever, um, why.clone()));
        }
        for l in self.correction.left_out.iter().filter(|l| l.known) {
            let mended =
                |s: &&crate::tables::correction::AxisShape| (&s.parameter, &s.effect) == (&l.parameter, &l.effect);
            if self.has_grids && self.correction.across.iter().any(|s| mended(&s)) {
                continue;
            }
            let um = left_um(l.value, &l.unit, self.radius_mm);
            out.push(row(&l.parameter, &l.effect, (l.value, &l.unit), self.radius_mm, um, l.why.clone()));
        }
        if !self.has_grids {
            for shape in &self.correction.shapes {
                let um = grids::largest_um(self.machine, shape, self.radius_mm);
                let why = format!(
                    "over the whole travel of {}, by whose position it goes: this program knows no table of this control for that",
                    shape.input
                );
                let value = (shape.value, shape.unit.as_str());
                out.push(row(&shape.parameter, &shape.effect, value, self.radius_mm, Some(um), why));
            }
        }
        out
    }

    /// `before`: the machine as the control sees it now; `exact`: as it is to see it, not rounded.
    pub(super) fn figures(&self, before: &Seen, exact: &Seen) -> Figures {
        let held = self.errors(&self.carried.in_lines());
        let none = BTreeMap::new();
        let rounding =
            self.worst(&self.filled.seen, held.clone(), 0.0, &none) - self.worst(exact, held.clone(), 0.0, &none);
        let mut all = self.carried.terms.clone();
        all.extend(self.carried.zero.iter().cloned());
        all.extend(self.carried.not.iter().map(|(t, _)| t.clone()));
        all.extend(self.carried.held_turns.iter().cloned());
        if self.correction.transformation {
            // the touches show what is off beside what the control held, turns of the head included
            all.extend(with_active(&self.carried.of_turns));
        }
        let all = self.errors(&all);
        let zero_before = self.correction.active.as_ref().and_then(|a| a.tables.as_ref()).map(|t| &t.zero_deg);
        let rest = self.worst(&self.filled.seen, all.clone(), 0.0, self.zero);
        let clean = |um: f64| if um < NOTHING_UM { 0.0 } else { um };
        Figures {
            rounding_um: clean(rounding),
            rest_um: clean(rest),
            longer_tool_um: clean(self.worst(&self.filled.seen, all.clone(), 100.0, self.zero) - rest),
            without_um: self.worst(before, all, 0.0, zero_before.unwrap_or(&none)),
        }
    }
}

fn row(
    parameter: &str,
    effect: &str,
    (value, unit): (f64, &str),
    lever_mm: f64,
    left_um: Option<f64>,
    why: String,
) -> Left {
    Left {
        parameter: parameter.to_owned(),
        effect: effect.to_owned(),
        value,
        unit: unit.to_owned(),
        lever_mm,
        left_um,
        why,
    }
}
