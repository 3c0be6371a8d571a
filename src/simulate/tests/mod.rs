//! What the virtual machine must give, to the digits that the method states.

mod compensation;
mod effects;
mod paper;
mod runs;
mod scenarios;

use super::chain::{Chain, Stylus};
use super::rigid::{Vec3, cross, dot, minus, plus, solve};
use super::terms::Shifts;
use super::{Compensation, Scenario, run};
use crate::axes::{AxisMap, AxisName, Position};
use crate::diag::source;
use crate::log::{RawTouch, Status};
use crate::machine::{self, Machine};
use crate::program::plan::{FORMAT, Plan, PlanBlock, PlanTouch};

pub const L: f64 = 202.684;

pub fn machine_named(name: &str) -> Machine {
    let (machines, _) = machine::load(&source("built in", machine::BUILT_IN)).unwrap();
    machines.into_iter().find(|m| m.name == name).unwrap()
}

pub fn pose(values: &[(AxisName, f64)]) -> AxisMap {
    values.iter().fold(AxisMap::default(), |m, &(a, v)| m.with(a, v))
}

/// A plan with blocks of a mounting of the machine and no touches.
pub fn empty_plan(machine: &Machine, mounting: &str) -> Plan {
    let m = machine.mounting(mounting).unwrap();
    let blocks = m.blocks.iter().map(|b| PlanBlock {
        name: b.name.clone(),
        carrier: m.carrier.to_string(),
        mounting: None,
        form: b.form,
        centre: b.centre.into(),
        size: b.size.into(),
        diameter: b.diameter,
    });
    Plan {
        format: FORMAT.to_owned(),
        machine: machine.name.clone(),
        machine_sha256: String::new(),
        program: "by-hand".to_owned(),
        mounting: mounting.to_owned(),
        blocks_anew: false,
        controller_frame: crate::program::plan::ControllerFrame::Axes,
        ball_radius_mm: 3.0,
        tool_length_mm: machine.tool.length_mm,
        placement_tolerance_mm: None,
        find: None,
        blocks: blocks.collect(),
        touches: Vec::new(),
        skipped: Vec::new(),
        notes: Vec::new(),
        programs: std::collections::BTreeMap::new(),
    }
}

/// Adds a touch of a face of a block at a pose: 2 mm off to 2 mm past, the ball on the normal of `point`.
pub fn add_touch(plan: &mut Plan, machine: &Machine, block: &str, point: Vec3, normal: Vec3, pose: AxisMap) {
    let found = plan.blocks.iter().find(|b| b.name == block).unwrap().clone();
    let n_links = chain(machine).links_to(machine.carrier(&found.carrier).unwrap());
    let at = |off: f64| {
        let ball = plus(point, plan.ball_radius_mm + off, normal);
        let p = linear_for(machine, n_links, &pose, ball, plan.tool_length_mm);
        AxisMap::xyz(p[0], p[1], p[2])
    };
    let touch = PlanTouch {
        id: plan.touches.len() as u64 + 1,
        stage: "test".into(),
        repeat: 1,
        carrier: found.carrier.as_str().into(),
        mounting: None,
        block: block.into(),
        face: String::new(),
        point,
        normal,
        pose,
        start: at(2.0),
        nominal: at(0.0),
        end: at(-2.0),
        time_s: None,
        visit: None,
        feed_mm_min: None,
        spindle_deg: None,
        tool_length_mm: None,
        ball_radius_mm: None,
        from: AxisMap::default(),
        first: false,
    };
    plan.touches.push(touch);
}

pub fn chain(machine: &Machine) -> Chain {
    let p = machine.reference.pivot;
    Chain::new(machine, [p.x, p.y, p.z])
}

/// Where an errorless machine's linear axes stand when the ball is at a place of a carrier.
fn linear_for(machine: &Machine, n_links: usize, pose: &AxisMap, ball: Vec3, length_mm: f64) -> Vec3 {
    let chain = chain(machine);
    let at = |linear: Vec3| {
        let mut p = pose.position();
        p.0[..3].copy_from_slice(&linear);
        chain.ball_in(&p, &Shifts::default(), n_links, Stylus { length_mm, spindle_deg: 0.0 })
    };
    let p0 = at([0.0; 3]);
    let columns = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]].map(|u| minus(at(u), p0));
    let rough = solve(columns, minus(ball, p0)).unwrap();
    // once more from there: differences of one millimetre have lost digits
    plus(rough, 1.0, solve(columns, minus(ball, at(rough))).unwrap())
}

/// The reading of a touch: recorded minus nominal along the outward normal, mm. The nominal trigger is the plan's.
pub fn reading(plan: &Plan, raw: &RawTouch) -> f64 {
    assert_eq!(raw.status, Status::Hit, "touch {:?}", raw.id);
    let touch = plan.touch(raw.id.unwrap()).unwrap();
    let (start, nominal) = (touch.start_position(), touch.nominal_position());
    let xyz = |p: &Position| [p.0[0], p.0[1], p.0[2]];
    let outward = minus(xyz(&start), xyz(&nominal));
    let length = dot(outward, outward).sqrt();
    let off = minus(xyz(&raw.position), xyz(&nominal));
    assert!(super::rigid::norm(cross(off, outward)) < 1e-9 * length, "off the line of the search");
    dot(off, outward) / length
}

pub fn readings(machine: &Machine, plan: &Plan, scenario: &Scenario, compensation: Option<&Compensation>) -> Vec<f64> {
    let (raw, _) = run(machine, plan, scenario, compensation).unwrap();
    assert_eq!(raw.len(), plan.touches.len());
    raw.iter().map(|r| reading(plan, r)).collect()
}

pub fn close(found: f64, expected: f64, within: f64) {
    assert!((found - expected).abs() <= within, "found {found}, expected {expected}: off by {:e}", found - expected);
}
