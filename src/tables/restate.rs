//! Terms stated at another point of reference: where a control can hold no tilt, an offset is right at one height only.

use super::compensation::Term;
use super::correction::{Correction, blank, rounded};
use super::place::{Dof, Place, Spot, along};
use crate::axes::AxisName;
use crate::geometry::Displacement;
use crate::machine::{Machine, Side};
use crate::units::rad_from_deg;
use nalgebra::Vector3;

/// The terms with the displacements of workpiece-side axes stated at another point: the same transforms, exactly.
///
/// E about c1 by d1 is E about c2 by d1 + (R - 1)(c2 - c1), with R its rotation. Only `value` is restated; a displacement
/// that becomes another number loses its uncertainty, which would need that of the tilts and their covariance.
#[must_use]
pub fn restated(terms: &[Term], machine: &Machine, from_mm: [f64; 3], to_mm: [f64; 3]) -> Vec<Term> {
    let mut out = terms.to_vec();
    let shift = Vector3::from(to_mm) - Vector3::from(from_mm);
    let value = |spot: Spot| terms.iter().find(|t| t.spot() == spot).map_or(0.0, |t| t.value);
    for axis in machine.rotary().filter(|a| a.side == Side::Workpiece) {
        let at = |dof: Dof| Spot { axis: axis.name, place: Place::Before, dof };
        let mut e = Displacement::default();
        for dof in Dof::ALL.into_iter().filter(|d| d.is_angle()) {
            e.add(dof.index(), rad_from_deg(value(at(dof))));
        }
        let moved = e.rotation() * shift - shift;
        for dof in [Dof::Dx, Dof::Dy, Dof::Dz] {
            let by = moved[dof.index()];
            // below the twelve decimals that are written
            if by.abs() < 5e-13 {
                continue;
            }
            match out.iter_mut().find(|t| t.spot() == at(dof)) {
                Some(term) => {
                    term.value += by;
                    term.sigma = None;
                }
                None => {
                    let parameter = format!("E{}0{}", dof.iso_letter(), axis.name);
                    let mut term = blank(at(dof), &parameter, "tilt at another point", 0.0, None);
                    term.value = by;
                    out.push(term);
                }
            }
        }
    }
    out.sort_by_key(Term::spot);
    out
}

/// The terms of a correction stated at a point, with what was active there, and the places that stay as they were because the
/// study does not know them: a tilt moves them, but from where nobody knows.
#[must_use]
pub fn stated_at(machine: &Machine, correction: &Correction, to_mm: [f64; 3]) -> (Vec<Term>, Vec<Spot>) {
    let before: Vec<Term> = correction.terms.iter().map(|t| Term { value: t.active_before, ..t.clone() }).collect();
    let before = restated(&before, machine, correction.reference_mm, to_mm);
    // a tilt that the study holds is no result of it, and moves the offsets that are all the same
    let held = correction.held_tilts.iter().filter(|h| !correction.terms.iter().any(|t| t.spot() == h.spot()));
    let all: Vec<Term> = correction.terms.iter().chain(held.clone()).cloned().collect();
    let mut terms = restated(&all, machine, correction.reference_mm, to_mm);
    let held: Vec<Spot> = held.map(Term::spot).collect();
    terms.retain(|t| !held.contains(&t.spot()));
    let mut kept = Vec::new();
    for term in &mut terms {
        let old = before.iter().find(|b| b.spot() == term.spot()).map_or(0.0, |b| b.value);
        let moved = correction.terms.iter().find(|t| t.spot() == term.spot()).map_or(0.0, |t| t.value) != term.value;
        if moved && !is_known(machine, correction, term.spot()) {
            term.value = old;
            // along its own line an axis stands nowhere in particular: nobody misses a number there
            if !stands_along(machine, term.spot()) {
                kept.push(term.spot());
            }
        }
        term.value = rounded(term.value);
        term.active_before = rounded(old);
        term.identified = rounded(term.value - term.active_before);
    }
    (terms, kept)
}

/// Is it a component along the axis's own line?
fn stands_along(machine: &Machine, spot: Spot) -> bool {
    machine.axis(spot.axis).is_some_and(|a| along(a, spot.dof).is_some())
}

/// Does the study know where this is? Along its own line an axis stands nowhere in particular; what moves it there moves the
/// axes that it carries, so that their places must be known.
pub(super) fn is_known(machine: &Machine, correction: &Correction, spot: Spot) -> bool {
    let of = |axis: AxisName| Spot { axis, ..spot };
    let is_along = |axis: AxisName| stands_along(machine, of(axis));
    if !is_along(spot.axis) {
        return correction.found.contains(&spot);
    }
    let mut carried = machine
        .side(Side::Workpiece)
        .filter(|a| a.name.is_rotary())
        .map(|a| a.name)
        .skip_while(|name| *name != spot.axis)
        .skip(1)
        .filter(|name| !is_along(*name))
        .peekable();
    carried.peek().is_some() && carried.all(|name| correction.found.contains(&of(name)))
}

/// In words: which places stay.
#[must_use]
pub fn kept_in_words(kept: &[Spot]) -> String {
    let names: Vec<String> = kept.iter().map(|s| format!("E{}0{}", s.dof.iso_letter(), s.axis)).collect();
    format!(
        "{} stay{} as the control has it: these touches do not tell where, so that the tilts move nothing there",
        names.join(", "),
        if names.len() == 1 { "s" } else { "" }
    )
}
