//! What a control can hold of the errors that are known, and where it holds them.

use super::backup::Old;
use super::fill::{self, Filled, Value};
use super::{axis_of, directions_of, workpiece};
use crate::axes::AxisName;
use crate::geometry::{Transform, apply, rotation_about};
use crate::machine::{Axis, Machine, Side};
use crate::post::tables::{Kind, Tables, doubt};
use crate::tables::compensation::Term;
use crate::tables::correction::{Correction, blank, rounded};
use crate::tables::kins::Errors;
use crate::tables::place::{Dof, Place, Spot, along, turns_about_itself};
use crate::tables::restate::stated_at;
use nalgebra::Vector3;
use std::collections::{BTreeMap, BTreeSet};

/// What the control can hold of the terms, where it holds them, and the rest with the reason.
pub(super) struct Carried {
    /// Terms in lines.
    pub terms: Vec<Term>,
    /// Terms as zero positions.
    pub zero: Vec<Term>,
    /// Where `before` of workpiece-side axes is stated, mm in R.
    pub reference_mm: [f64; 3],
    /// Not held.
    pub not: Vec<(Term, String)>,
    /// Places that a tilt would move, from where the study does not know.
    pub kept: Vec<Spot>,
    /// Offsets that stand for turns of the head which the control cannot hold.
    pub of_turns: Vec<Term>,
    /// Turns of the head that the study holds: the machine has them too.
    pub held_turns: Vec<Term>,
}

impl Carried {
    /// What the control's lines hold.
    pub fn in_lines(&self) -> Vec<Term> {
        self.terms.iter().chain(&self.of_turns).cloned().collect()
    }
}

pub(super) fn carried(machine: &Machine, correction: &Correction, kind: &Kind) -> Carried {
    let held = directions_of(machine, kind);
    let tilts = machine.rotary().all(|a| held.contains(&a.name));
    let angles: BTreeSet<AxisName> = kind.angle.iter().filter_map(|a| axis_of(machine, a.axis)).collect();
    let reference_mm = if tilts { correction.reference_mm } else { workpiece(machine).into() };
    // without directions an offset is right at one place only: that of the workpiece
    let (terms, kept) = stated_at(machine, correction, reference_mm);
    let last = |side: Side| machine.side(side).filter(|a| a.name.is_rotary()).last().map(|a| a.name);
    let (last_work, last_tool) = (last(Side::Workpiece), last(Side::Tool));
    let is_of_head = |t: &&Term| machine.axis(t.axis).is_some_and(|a| a.side == Side::Tool);
    let is_new = |t: &&Term| !tilts && !correction.terms.iter().any(|known| known.spot() == t.spot());
    let mut out = Carried {
        terms: Vec::new(),
        zero: Vec::new(),
        reference_mm,
        not: Vec::new(),
        kept,
        of_turns: Vec::new(),
        held_turns: correction.held_tilts.iter().filter(is_of_head).filter(is_new).cloned().collect(),
    };
    for term in terms {
        let own = turns_about_itself(machine, term.spot());
        if own && angles.contains(&term.axis) {
            out.zero.push(term);
        } else if own && Some(term.axis) == last_work {
            let why = format!(
                "a turn of {} about itself turns the workpiece with it: set the work offset of {} again",
                term.axis, term.axis
            );
            out.not.push((term, why));
        } else if own && Some(term.axis) == last_tool {
            // it turns the tool and no line: the lines go through the ball as it stands
            out.terms.push(term);
        } else if term.dof.is_angle() && !tilts {
            let why = if own {
                format!(
                    "the control's tables have no place for the zero position of {}: it belongs into the reference point of that axis",
                    term.axis
                )
            } else {
                "the control's tables hold places of rotary axes, no directions".to_owned()
            };
            out.not.push((term, why));
        } else {
            out.terms.push(term);
        }
    }
    out.of_turns = turns_of_the_head(machine, correction, &out);
    out
}

/// Turns of the head that the control cannot hold, as offsets that do the same to the lines and the ball at zero. A control counts
/// the lines of its table from the ball as it stands.
fn turns_of_the_head(machine: &Machine, correction: &Correction, carried: &Carried) -> Vec<Term> {
    let is_of_head = |t: &&Term| machine.axis(t.axis).is_some_and(|a| a.side == Side::Tool);
    let not_held = carried.not.iter().map(|(t, _)| t).filter(is_of_head);
    let turns: Vec<Term> = not_held.chain(&carried.held_turns).cloned().collect();
    let head: Vec<&Axis> = machine.side(Side::Tool).filter(|a| a.name.is_rotary()).collect();
    let ball = machine.tool.ball_at_zero(machine.tool.length_mm);
    // what moves at zero: the line of each axis next to the ball, then the ball
    let moved = |terms: &[Term]| {
        let errors = Errors::from_terms(terms, carried.reference_mm);
        let (mut frame, mut out) = (Transform::identity(), Vec::new());
        for axis in &head {
            let e = errors.of_axis(axis.name);
            frame *= e.before.transform_about(&axis.point);
            let along = axis.direction.into_inner();
            let foot = axis.point + along * along.dot(&(ball - axis.point));
            out.push(apply(&frame, &foot) - foot);
            frame *= rotation_about(&axis.point, &axis.direction, e.zero_rad);
            frame *= e.after.transform_about(&axis.point);
        }
        out.push(apply(&frame, &ball) - ball);
        out
    };
    let with_turns: Vec<Term> = carried.terms.iter().chain(&turns).cloned().collect();
    let by_turns = moved(&with_turns).into_iter().zip(moved(&carried.terms)).map(|(all, held)| all - held);
    let places = head.iter().map(|a| (a.name, Place::Before)).chain(head.last().map(|a| (a.name, Place::After)));
    // what such offsets hold already; touches of programs that give axis positions show the turns whole
    let active = active_turns(correction);
    let (mut from, mut out) = (Vector3::zeros(), Vec::new());
    for ((axis, place), to) in places.zip(by_turns) {
        let own = to - from;
        from = to;
        for dof in [Dof::Dx, Dof::Dy, Dof::Dz] {
            let spot = Spot { axis, place, dof };
            let before = active.iter().find(|t| t.spot() == spot).map_or(0.0, |t| t.value);
            let now = rounded(own[dof.index()] + if correction.transformation { before } else { 0.0 });
            if now != 0.0 || before != 0.0 {
                let parameter = format!("E{}0{axis}", dof.iso_letter());
                let mut term = blank(spot, &parameter, "turn of the head at the ball", rounded(now - before), None);
                (term.value, term.active_before) = (now, before);
                out.push(term);
            }
        }
    }
    out
}

/// The offsets of turns that the control holds already.
fn active_turns(correction: &Correction) -> &[Term] {
    correction.active.as_ref().and_then(|a| a.tables.as_ref()).map_or(&[], |t| &t.of_turns)
}

/// The correction with the places of the table's first rotary axis as the control counts them, from the ball: what stands in offsets
/// of turns is no distance that a limit is for.
pub(super) fn beside_the_ball(machine: &Machine, correction: &Correction) -> Correction {
    let mut out = correction.clone();
    let Some(first) = machine.side(Side::Workpiece).find(|a| a.name.is_rotary()) else { return out };
    for turn in active_turns(correction).iter().filter(|_| correction.transformation) {
        let spot = Spot { axis: first.name, place: Place::Before, dof: turn.dof };
        for term in out.terms.iter_mut().filter(|t| t.spot() == spot) {
            term.value -= turn.value;
        }
    }
    out
}

pub(super) fn with_active(terms: &[Term]) -> Vec<Term> {
    terms.iter().map(|t| Term { value: t.active_before, ..t.clone() }).collect()
}

/// How much further each axis shows than it stands, in its own count, by a value of the terms, deg.
fn zero_deg(machine: &Machine, terms: &[Term]) -> BTreeMap<AxisName, f64> {
    let mut out = BTreeMap::new();
    for term in terms {
        let Some(axis) = machine.axis(term.axis) else { continue };
        let sign = if term.place == Place::Zero { 1.0 } else { along(axis, term.dof).unwrap_or(1.0) };
        *out.entry(axis.name).or_insert(0.0) -= sign * axis.sense * term.value;
    }
    out
}

/// Zero positions of rotary axes; gives what the control is to hold beyond its old values, deg by axis.
pub(super) fn add_angles(
    machine: &Machine,
    tables: &Tables,
    kind: &Kind,
    carried: &Carried,
    old: &Old,
    filled: &mut Filled,
) -> BTreeMap<AxisName, f64> {
    let (now, before) = (zero_deg(machine, &carried.zero), zero_deg(machine, &with_active(&carried.zero)));
    let step = *tables.step_deg.get_ref();
    let mut out = BTreeMap::new();
    for form in &kind.angle {
        let (side, place) = form.axis.place();
        let Some(axis) = machine.side(side).filter(|a| a.name.is_rotary()).nth(place) else { continue };
        let (now, before) = (now.get(&axis.name).copied(), before.get(&axis.name).copied().unwrap_or(0.0));
        let Some(now) = now else { continue };
        let given_name = form.names.values().find(|n| old.values.contains_key(*n));
        let given = given_name.and_then(|n| old.values.get(n)).map(|(v, _)| *v);
        let was = given.unwrap_or(before);
        let new = rounded(((was + now - before) / step).round() * step);
        out.insert(axis.name, rounded(new - was + before));
        filled.values.push(Value {
            id: form.id.clone(),
            says: form.says.clone(),
            names: form.names.clone(),
            old: rounded(was),
            new,
            unit: "deg",
            decimals: fill::decimals(step),
            known: given_name.is_some_and(|n| !old.assumed.contains(n)),
            given: given_name.cloned(),
            elsewhere: false,
            instead: false,
            unverified: doubt(form.source.as_ref(), form.unverified.as_ref()),
        });
    }
    out
}
