//! Programs that give axis positions measure the machine against its description: what the control's vectors held did not
//! act. What was found then takes the place of the old values; what the touches do not tell stays as it was.

use super::Carried;
use super::fill::line_of;
use crate::axes::AxisName;
use crate::machine::{Machine, Side};
use crate::post::tables::{Point, Turn};
use crate::tables::compensation::Term;
use crate::tables::correction::Correction;
use crate::tables::kins::Errors;
use crate::tables::lines::Seen;
use nalgebra::Vector3;
use std::collections::BTreeMap;

/// The step by which a found place is moved to see what of the control's numbers moves with it, mm or deg.
const STEP: f64 = 1e-3;

/// What moves less than this does not move, mm or of a direction: a hundredth of what the step does at a lever of 1 mm.
const NOTHING: f64 = 1e-7;

/// The machine as described, and with each found place moved a little.
#[derive(Debug)]
pub struct Replaced {
    described: Seen,
    /// Offsets moved, by the side of their axis.
    offsets: Vec<(Side, Seen)>,
    /// Tilts moved.
    tilts: Vec<Seen>,
}

impl Replaced {
    pub(super) fn from_correction(
        machine: &Machine,
        correction: &Correction,
        carried: &Carried,
        length_mm: f64,
    ) -> Self {
        let seen =
            |terms: &[Term]| Seen::from_errors(machine, &Errors::from_terms(terms, carried.reference_mm), length_mm);
        let found = || {
            let own = carried.terms.iter().filter(|t| correction.found.contains(&t.spot()));
            own.chain(&carried.of_turns)
        };
        let moved = |t: &Term| seen(&[Term { value: STEP, ..t.clone() }]);
        Self {
            described: seen(&[]),
            offsets: found()
                .filter(|t| !t.dof.is_angle())
                .filter_map(|t| Some((machine.axis(t.axis)?.side, moved(t))))
                .collect(),
            tilts: found().filter(|t| t.dof.is_angle()).map(moved).collect(),
        }
    }

    /// What of a difference of two places stays: what is square to all that a found offset moves.
    pub fn place(&self, off: Vector3<f64>, of: impl Fn(&Seen) -> Vector3<f64>) -> Vector3<f64> {
        self.unmoved(self.offsets.iter().map(|(_, seen)| seen), off, of)
    }

    /// Takes out of the differences between old values and description what was found: of a point counted from what carries
    /// it, of a direction. Gives the largest that was taken out, mm, and whose.
    pub fn keep(
        &self,
        (before, now): (&Seen, &Seen),
        off: &mut BTreeMap<Point, Vector3<f64>>,
        turned: &mut BTreeMap<Turn, Vector3<f64>>,
    ) -> Option<(f64, AxisName)> {
        let mut worst: Option<(f64, AxisName)> = None;
        // lines of the table are counted from the ball at zero: what a found offset of the head moves there is the ball
        let mut head_moved = Vector3::zeros();
        for side in [Side::Tool, Side::Workpiece] {
            let (mut given, mut kept, mut carrier) = (Vector3::zeros(), Vector3::zeros(), None);
            for place in in_chain_order(before, side) {
                let (Some(line), Some(new)) = (before.side(side).get(place), now.side(side).get(place)) else {
                    continue;
                };
                let Some(by) = off.iter_mut().find(|(point, _)| stands_at(**point, side, place)).map(|(_, by)| by)
                else {
                    continue;
                };
                let d = line.direction.into_inner();
                let across = |v: Vector3<f64>| v - d * v.dot(&d);
                let relative = *by - given;
                let along = d * relative.dot(&d);
                let at = |seen: &Seen| {
                    let point = |n: usize| seen.side(side).get(n).map_or_else(Vector3::zeros, |l| l.point);
                    // an inclined line moves across itself, whatever the direction of the offset
                    across(point(place) - carrier.map_or_else(Vector3::zeros, point))
                };
                let own = || self.offsets.iter().filter(|(of, _)| *of == side).map(|(_, seen)| seen);
                // what stays, stays as the control has it next to the head, wherever the head was found
                let moved = if side == Side::Workpiece && carrier.is_none() {
                    across(head_moved - (new.point - line.point))
                } else {
                    Vector3::zeros()
                };
                let off_line = relative - along;
                let stays = self.unmoved(own(), off_line + moved, at);
                let taken = (off_line - self.unmoved(own(), off_line, at)).norm();
                if worst.is_none_or(|(most, _)| taken > most) {
                    worst = Some((taken, line.axis));
                }
                // where along its line the carrier's point was chosen moves nothing
                (given, kept, carrier) = (given + off_line, kept + stays, Some(place));
                if side == Side::Tool {
                    head_moved = across(new.point + kept - line.point - given);
                }
                *by = kept + along;
            }
        }
        for (turn, by) in turned.iter_mut() {
            let at =
                |seen: &Seen| line_of(seen, *turn).map_or_else(Vector3::zeros, |(_, _, l)| l.direction.into_inner());
            *by = self.unmoved(self.tilts.iter(), *by, at);
        }
        worst
    }

    /// What is square to all that these move.
    fn unmoved<'s>(
        &self,
        moved: impl Iterator<Item = &'s Seen>,
        off: Vector3<f64>,
        of: impl Fn(&Seen) -> Vector3<f64>,
    ) -> Vector3<f64> {
        let at = of(&self.described);
        let mut square: Vec<Vector3<f64>> = Vec::new();
        let without = |v: Vector3<f64>, known: &[Vector3<f64>]| known.iter().fold(v, |v, u| v - u * v.dot(u));
        for seen in moved {
            let step = without(of(seen) - at, &square);
            if step.norm() > NOTHING {
                square.push(step.normalize());
            }
        }
        without(off, &square)
    }
}

/// The lines of a side in the order in which the control's vectors lead from one to the next: the tool's from the adapter on.
fn in_chain_order(seen: &Seen, side: Side) -> Vec<usize> {
    let places = 0..seen.side(side).len();
    if side == Side::Tool { places.rev().collect() } else { places.collect() }
}

fn stands_at(point: Point, side: Side, place: usize) -> bool {
    point.turn().is_some_and(|turn| turn.place() == (side, place))
}

/// Where along its line a point stands says nothing: next to what carries it, it stays where the old values (`given`: off the
/// description) have it.
pub fn hold_along_the_lines(before: &Seen, given: &BTreeMap<Point, Vector3<f64>>, target: &mut Seen) {
    for side in [Side::Workpiece, Side::Tool] {
        let (mut given_before, mut moved) = (Vector3::zeros(), Vector3::zeros());
        for place in in_chain_order(before, side) {
            let off = given.iter().find(|(point, _)| stands_at(**point, side, place)).map(|(_, by)| *by);
            let off = off.unwrap_or(given_before);
            let (Some(was), Some(line)) = (before.side(side).get(place), target.side_mut(side).get_mut(place)) else {
                continue;
            };
            let share = was.direction.dot(&line.direction);
            if share.abs() > 0.5 {
                let along = was.direction.dot(&(line.point - was.point - moved - (off - given_before))) / share;
                line.point -= line.direction.into_inner() * along;
            }
            (moved, given_before) = (line.point - was.point, off);
        }
    }
}
