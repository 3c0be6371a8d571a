//! An artefact that was put down by eye: the program's first touches find it, and all its places are relative to that.

use super::chain::{Chain, Stylus};
use super::control::Compensation;
use super::rigid::{Vec3, dot, minus, norm, plus, solve, unit};
use super::terms::Shifts;
use super::{prepare, touch};
use crate::axes::{AxisMap, AxisName, Position};
use crate::diag::{Failure, Result};
use crate::log::Status;
use crate::machine::Machine;
use crate::program::plan::{Find, FindTouch, Plan, PlanTouch};
use crate::simulate::Scenario;

const LINEAR: [AxisName; 3] = [AxisName::X, AxisName::Y, AxisName::Z];

/// What the program's first touches find, mm along X, Y and Z with all rotary axes at 0, and the touches relative to it.
///
/// # Errors
/// When the program would stop: the artefact is not met, or it is further off than the program is made for.
pub(super) fn find(
    machine: &Machine,
    plan: &Plan,
    find: &Find,
    scenario: &Scenario,
    compensation: Option<&Compensation>,
) -> Result<(Vec3, Plan)> {
    let stop = |why: String| {
        Failure::new("simulate::not_found", format!("the program stops before its first touch: {why}")).help(format!(
            "the artefact may be off by {} mm along X, Y and Z: displace it less in the scenario",
            find.tolerance_mm
        ))
    };
    let Some(first) = plan.touches.first() else { return Ok(([0.0; 3], plan.clone())) };
    let (mut found, mut relative) = ([0.0; 3], [0.0; 3]);
    for (place, one) in find.touches.iter().enumerate() {
        let id = plan.touches.len() as u64 + 1 + place as u64;
        let sought = planned(machine, first, one, id, relative);
        let (start, nominal, end) = (sought.start_position(), sought.nominal_position(), sought.end_position());
        let alone = Plan { touches: vec![sought], find: None, ..plan.clone() };
        let (bench, _) = prepare::bench(machine, &alone, scenario, compensation)?;
        let Some(ready) = bench.touches.first() else { continue };
        let made = touch::make(&bench, ready).raw;
        if made.status != Status::Hit {
            return Err(stop(format!("{}: the search meets nothing", one.face)));
        }
        let along = unit(minus(linear(&end), linear(&start)));
        let off = dot(minus(linear(&made.position), linear(&nominal)), along);
        if off.abs() > find.room_mm {
            return Err(stop(format!("{}: the artefact is {off:.3} mm off along the search", one.face)));
        }
        for (slot, axis) in found.iter_mut().zip(LINEAR) {
            *slot += one.moves.get(axis).unwrap_or(0.0) * off;
        }
        if find.counts_after(place) {
            relative = found;
        }
    }
    if found.iter().any(|off| off.abs() > find.tolerance_mm + 0.01) {
        return Err(stop(format!("the artefact is off by {:.3}, {:.3}, {:.3} mm", found[0], found[1], found[2])));
    }
    Ok((found, relative_to(machine, plan, found)))
}

fn linear(at: &Position) -> Vec3 {
    [at.0[0], at.0[1], at.0[2]]
}

/// A touch that finds, as one of a plan; `off`: what is found by then. All rotary axes stand at 0.
fn planned(machine: &Machine, like: &PlanTouch, one: &FindTouch, id: u64, off: Vec3) -> PlanTouch {
    let mut pose = AxisMap::default();
    machine.rotary().for_each(|a| pose.set(a.name, 0.0));
    let by = |place: &AxisMap| {
        let at = plus(linear(&place.position()), 1.0, off);
        AxisMap::xyz(at[0], at[1], at[2])
    };
    let outward = minus(linear(&one.start.position()), linear(&one.nominal.position()));
    let normal = if norm(outward) > 0.0 { unit(outward) } else { [0.0, 0.0, 1.0] };
    PlanTouch {
        id,
        stage: "find".to_owned(),
        repeat: 1,
        face: one.face.clone(),
        normal,
        pose,
        start: by(&one.start),
        nominal: by(&one.nominal),
        end: by(&one.end),
        time_s: Some(0.0),
        visit: Some(0),
        feed_mm_min: None,
        spindle_deg: None,
        from: AxisMap::default(),
        first: true,
        ..like.clone()
    }
}

/// The plan with its places where the program brings the ball that has found the artefact.
fn relative_to(machine: &Machine, plan: &Plan, found: Vec3) -> Plan {
    let p = &machine.reference.pivot;
    let chain = Chain::new(machine, [p.x, p.y, p.z]);
    let nothing = Shifts::default();
    let mut plan = plan.clone();
    let length_mm = plan.tool_length_mm;
    for touch in &mut plan.touches {
        let Some(carrier) = machine.carrier(&touch.carrier) else { continue };
        let links = chain.links_to(carrier);
        let stylus = Stylus { length_mm: touch.tool_length_mm.unwrap_or(length_mm), spindle_deg: 0.0 };
        let ball = |at: &Position| chain.ball_in(at, &nothing, links, stylus);
        let at = |xyz: Vec3, pose: &Position| Position([xyz[0], xyz[1], xyz[2], pose.0[3], pose.0[4], pose.0[5]]);
        let (level, pose) = (Position::default(), touch.pose.position());
        // where the artefact is, in what bears it
        let moved = minus(ball(&at(found, &level)), ball(&level));
        let origin = ball(&at([0.0; 3], &pose));
        let column = |xyz: Vec3| minus(ball(&at(xyz, &pose)), origin);
        let columns = [column([1.0, 0.0, 0.0]), column([0.0, 1.0, 0.0]), column([0.0, 0.0, 1.0])];
        let Some(off) = solve(columns, moved) else { continue };
        for place in [&mut touch.start, &mut touch.nominal, &mut touch.end] {
            let to = plus(linear(&place.position()), 1.0, off);
            *place = AxisMap::xyz(to[0], to[1], to[2]);
        }
    }
    plan
}
