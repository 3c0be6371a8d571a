//! Where most touches found nothing: which gross mistake would have made just these touches miss?
//!
//! Where an axis counts the other way round, or two are exchanged, the ball searches elsewhere. Each search is gone along
//! as the mistake would turn it, past all blocks where the plan has them: which searches would meet one, says which
//! mistake it is.

use super::Subject;
use super::answer::Gross;
use super::setup_mistakes::EFFECT;
use crate::axes::{AxisName, Position};
use crate::design::Planned;
use crate::geometry::apply;
use crate::machine::{Carrier, Machine};
use crate::model::catalogue::Effect;
use crate::model::formula::{VARIABLES, slot};
use crate::program::plan::{Plan, PlanTouch};
use crate::units::deg_from_rad;
use crate::words::diagnose as words;
use nalgebra::Vector3;
use rayon::prelude::*;
use std::collections::HashMap;

/// A mistake is named when so many hits and misses are as it would make them …
const AGREES: f64 = 0.85;

/// … and so many more than a right machine would.
const CLEARLY: f64 = 0.1;

/// Places along a search that are looked at.
const PLACES: usize = 40;

/// Mistakes that would have made these touches miss, best first.
#[must_use]
pub(super) fn hypotheses(subject: Subject, planned: &[Planned]) -> Vec<Gross> {
    let Some(effect) = subject.catalogue.get(EFFECT, subject.machine) else { return Vec::new() };
    let data = &subject.fit.data;
    let mut found: HashMap<(usize, u64), bool> = data.unusable.iter().map(|u| ((u.run, u.id), false)).collect();
    found.extend(data.observations.iter().map(|o| ((o.run, o.id), true)));
    let agreement_with = |supposed: Option<usize>, own: bool| -> f64 {
        let (mut same, mut all) = (0usize, 0usize);
        for (run, p) in planned.iter().enumerate() {
            for touch in &p.plan.touches {
                let Some(hit) = found.get(&(run, touch.id)) else { continue };
                all += 1;
                same += usize::from(*hit == hits(subject.machine, &p.plan, touch, effect, (supposed, own)));
            }
        }
        same as f64 / all.max(1) as f64
    };
    // other blocks may be met in place of the own one, if they are mounted by then
    let agreement = |supposed| agreement_with(supposed, false).max(agreement_with(supposed, true));
    let right = agreement(None);
    let mut out: Vec<Gross> = (0..effect.parameters.len())
        .into_par_iter()
        .map(|k| (&effect.parameters[k].name, agreement(Some(k))))
        .filter(|(_, agrees)| *agrees >= AGREES && *agrees > right + CLEARLY)
        .map(|(name, agrees)| Gross {
            hypothesis: name.clone(),
            says: words::catalogue_mistake(name),
            rms_um: subject.fit.outcome.rms_um,
            agrees: Some(agrees),
            in_place: None,
        })
        .collect();
    let agrees = |g: &Gross| g.agrees.unwrap_or(0.0);
    out.sort_by(|a, b| agrees(b).total_cmp(&agrees(a)).then(a.hypothesis.cmp(&b.hypothesis)));
    out
}

/// Would the search meet a block (its own alone, or any), were the supposition true? A search that begins in a block is none.
fn hits(
    machine: &Machine,
    plan: &Plan,
    touch: &PlanTouch,
    effect: &Effect,
    (supposed, own): (Option<usize>, bool),
) -> bool {
    let at = |p: &Position| turned(p, effect, supposed);
    let (from, to) = (at(&touch.start_position()), at(&touch.end_position()));
    let length_mm = touch.tool_length_mm.unwrap_or(plan.tool_length_mm);
    let radius_mm = touch.ball_radius_mm.unwrap_or(plan.ball_radius_mm);
    let blocks: Vec<(Carrier, Vector3<f64>, Vector3<f64>)> = plan
        .blocks
        .iter()
        .filter(|b| b.mounting == touch.mounting && (!own || (b.name == touch.block && b.carrier == touch.carrier)))
        .filter_map(|b| Some((machine.carrier(&b.carrier)?, b.centre.into(), 0.5 * Vector3::from(b.size))))
        .collect();
    let meets = |k: usize| {
        let share = k as f64 / PLACES as f64;
        let mut here = from;
        for name in AxisName::ALL {
            here.set(name, from.get(name) + share * (to.get(name) - from.get(name)));
        }
        let ball = apply(&machine.tool_frame(&here), &machine.tool.ball_at_zero(length_mm));
        blocks.iter().any(|(carrier, centre, half)| {
            let inside = apply(&machine.carrier_frame(*carrier, &here).inverse(), &ball) - centre;
            let beyond = (inside.abs() - half).map(|x| x.max(0.0));
            beyond.norm() <= radius_mm
        })
    };
    !meets(0) && (1..=PLACES).any(meets)
}

/// Where the axes really stand, by the effect's own formulas: readings and commands are turned in the same way.
fn turned(position: &Position, effect: &Effect, supposed: Option<usize>) -> Position {
    let Some(parameter) = supposed else { return *position };
    let mut state = [0.0; VARIABLES.len()];
    for name in AxisName::ALL {
        state[slot::AXES + name.index()] = position.mm_or_rad(name);
    }
    let mut out = *position;
    for t in effect.terms.iter().filter(|t| t.parameter == parameter) {
        if let Some(name) = AxisName::ALL.into_iter().find(|n| n.index() == t.component) {
            let by = t.formula.eval(&state, &[]);
            out.set(name, position.get(name) + if name.is_rotary() { deg_from_rad(by) } else { by });
        }
    }
    out
}
