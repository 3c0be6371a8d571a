//! Poses at which the centre of a sphere should be measured next, for a study of centres: there is no program, the user's own
//! cycle measures them.

use super::choose::Setting;
use crate::axes::{AxisMap, AxisName};
use crate::design::bundle::{Bundle, Manner, poses};
use crate::design::choose_touches::{Design, Separation};
use crate::design::questions::Questions;
use crate::diag::Result;
use crate::machine::{Form, Machine};
use crate::model::catalogue::Effect;
use crate::program::plan::{Plan, PlanTouch};
use nalgebra::Vector3;
use std::collections::BTreeMap;

/// A centre to be measured.
#[derive(Debug, Clone)]
pub struct NextCentre {
    pub sphere: String,
    /// Rotary axes, deg.
    pub pose: AxisMap,
    /// Where the machine will be with the ball on the centre, as far as it is known: axis positions relative to R, mm.
    pub expected_mm: Vector3<f64>,
}

/// Centres to be measured, and what they will tell.
#[derive(Debug, Clone)]
pub struct Poses {
    pub centres: Vec<NextCentre>,
    pub separations: Vec<Separation>,
}

/// The last run's plan, where its touches are centres of spheres.
pub(super) fn of_centres<'p>(setting: &'p Setting) -> Option<&'p Plan> {
    let plan = &setting.runs.last()?.plan;
    let is_centre = |form: Form| matches!(form, Form::Centre | Form::Reading);
    (!plan.blocks.is_empty() && plan.blocks.iter().all(|b| is_centre(b.form))).then_some(plan)
}

/// Chooses poses within a time; none where no pose separates anything.
pub(super) fn choose(
    setting: &Setting,
    plan: &Plan,
    effects: &[(&Effect, Option<f64>)],
    questions: &Questions,
    budget_s: f64,
) -> Result<Option<Poses>> {
    let pool = pool(setting.task.machine, plan);
    if pool.is_empty() {
        return Ok(None);
    }
    let label = setting.runs.last().map(|r| r.mounting.clone().unwrap_or_else(|| plan.mounting.clone()));
    let view = setting.view(&with_touches(plan, &pool), label.as_deref(), effects)?;
    let design = Design::new(&view, setting.n_given(), &pool, questions);
    let chosen = design.choose(&pool, budget_s);
    if chosen.is_empty() {
        return Ok(None);
    }
    let separations = design.separated(&chosen);
    let centre = |&i: &usize| {
        let (bundle, touch) = (&pool[i], pool[i].touches.first()?);
        let expected_mm = touch.nominal.position().xyz_mm();
        Some(NextCentre { sphere: bundle.block.clone(), pose: bundle.manner.pose, expected_mm })
    };
    let mut centres: Vec<NextCentre> = chosen.iter().filter_map(centre).collect();
    let angles = |c: &NextCentre| c.pose.iter().map(|(_, deg)| deg).collect::<Vec<f64>>();
    centres.sort_by(|a, b| angles(a).partial_cmp(&angles(b)).unwrap_or(std::cmp::Ordering::Equal));
    Ok(Some(Poses { centres, separations }))
}

/// Every sphere at every pose at which the machine reaches its centre.
fn pool(machine: &Machine, plan: &Plan) -> Vec<Bundle> {
    let mut out = Vec::new();
    for block in &plan.blocks {
        let own: Vec<&PlanTouch> = plan.touches.iter().filter(|t| t.block == block.name && t.repeat == 1).collect();
        let Some(first) = own.first() else { continue };
        // one pose shows how this centre is measured: three planes, or what the file had
        let pattern: Vec<&PlanTouch> = own.iter().copied().filter(|t| t.visit == first.visit).collect();
        for pose in poses(machine) {
            let touches: Option<Vec<PlanTouch>> = pattern.iter().map(|t| at_pose(machine, plan, t, &pose)).collect();
            let manner = Manner { pose, from: AxisMap::default(), spindle_deg: 0.0, feed_mm_min: 0.0, stylus: None };
            out.extend(touches.map(|touches| Bundle {
                manner,
                block: block.name.clone(),
                faces: Vec::new(),
                ring: Vec::new(),
                touches,
            }));
        }
    }
    out
}

/// A touch of a centre at another pose; none where the linear axes do not go there.
fn at_pose(machine: &Machine, plan: &Plan, touch: &PlanTouch, pose: &AxisMap) -> Option<PlanTouch> {
    let carrier = machine.carrier(&touch.carrier)?;
    let places = machine.ball_places(carrier, &pose.position(), touch.tool_length_mm.unwrap_or(plan.tool_length_mm))?;
    let (point, normal) = (Vector3::from(touch.point), Vector3::from(touch.normal));
    let at = |off_mm: f64| {
        let linear = places.linear_for(&(point + normal * off_mm));
        let inside = |name: AxisName, mm: f64| {
            machine.axis(name).is_none_or(|axis| (axis.range[0]..=axis.range[1]).contains(&mm))
        };
        let reached = inside(AxisName::X, linear.x) && inside(AxisName::Y, linear.y) && inside(AxisName::Z, linear.z);
        reached.then(|| AxisMap::xyz(linear.x, linear.y, linear.z))
    };
    Some(PlanTouch {
        pose: *pose,
        start: at(SEARCH_MM)?,
        nominal: at(0.0)?,
        end: at(-SEARCH_MM)?,
        time_s: None,
        ..touch.clone()
    })
}

/// The search of a touch in the plan goes from this far off the centre to as far behind it, mm.
const SEARCH_MM: f64 = 2.0;

/// A plan with the touches of all bundles, each a visit of its own.
fn with_touches(plan: &Plan, pool: &[Bundle]) -> Plan {
    let of = |(visit, bundle): (u32, &Bundle)| {
        bundle.touches.iter().map(|t| PlanTouch { visit: Some(visit), ..t.clone() }).collect::<Vec<_>>()
    };
    let touches = (1..).zip(pool).flat_map(of).zip(1..).map(|(t, id)| PlanTouch { id, ..t }).collect();
    Plan { touches, skipped: Vec::new(), programs: BTreeMap::new(), ..plan.clone() }
}
