//! The touches of a program without asking whether they can be reached: for studies on paper, never for a machine.

use super::layout::lay_out;
use super::parts::{plan_blocks, where_it_differs};
use super::plan::{self, ControllerFrame, Plan, PlanTouch};
use super::spec::ProgramSpec;
use crate::axes::{AxisMap, Position};
use crate::diag::{Failure, Result};
use crate::machine::Machine;

/// Makes a plan from a program's points alone: no path, no limits, no collisions.
///
/// # Errors
/// When the program does not fit the machine.
pub fn plan_without_path(machine: &Machine, spec: &ProgramSpec) -> Result<Plan> {
    let (layout, _) = lay_out(machine, spec)?;
    let Some(one) = layout.parts.first() else {
        return Err(Failure::new("program::empty", "the program has no part"));
    };
    let mut touches: Vec<PlanTouch> = Vec::new();
    for (setup, visit) in layout.setups.iter().zip(1..) {
        let pose = setup.at_pose();
        let Some(part) = layout.parts.get(setup.part) else { continue };
        let (probe, length_mm) = (&part.machine.probe, part.machine.tool.length_mm);
        for target in &setup.targets {
            let Some(block) = layout.block(setup, target) else { continue };
            let at = |off_face: f64| -> Result<AxisMap> {
                let ball = target.point + target.normal * (probe.ball_radius + off_face);
                let place: Position =
                    machine.linear_for_ball(block.carrier, &pose, &ball, length_mm).ok_or_else(|| {
                        Failure::new("program::linear_axes", "the linear axes do not span space in this pose")
                    })?;
                let xyz = place.xyz_mm();
                Ok(AxisMap::xyz(xyz.x, xyz.y, xyz.z))
            };
            for repeat in 1..=setup.spec.repeats {
                touches.push(PlanTouch {
                    id: touches.len() as u64 + 1,
                    stage: setup.spec.stage.as_str().into(),
                    repeat,
                    carrier: block.carrier.to_string(),
                    mounting: (part.label != one.label).then(|| part.label.clone()),
                    block: block.name.as_str().into(),
                    face: target.face.to_string(),
                    point: target.point.into(),
                    normal: target.normal.into(),
                    pose: setup.pose,
                    start: at(probe.approach)?,
                    nominal: at(0.0)?,
                    end: at(-probe.search)?,
                    time_s: None,
                    visit: Some(visit),
                    feed_mm_min: setup.spec.feed_mm_min,
                    spindle_deg: setup.spec.spindle_deg,
                    tool_length_mm: where_it_differs(length_mm, one.machine.tool.length_mm),
                    ball_radius_mm: where_it_differs(probe.ball_radius, one.machine.probe.ball_radius),
                    from: setup.spec.from.value,
                    first: false,
                });
            }
        }
    }
    Ok(Plan {
        format: plan::FORMAT.to_owned(),
        machine: machine.name.clone(),
        machine_sha256: machine.sha256.clone(),
        program: spec.name.clone(),
        mounting: one.label.clone(),
        blocks_anew: false,
        controller_frame: ControllerFrame::Axes,
        ball_radius_mm: one.machine.probe.ball_radius,
        tool_length_mm: one.machine.tool.length_mm,
        placement_tolerance_mm: None,
        find: None,
        blocks: plan_blocks(&layout.parts),
        touches,
        skipped: Vec::new(),
        notes: Vec::new(),
        programs: std::collections::BTreeMap::new(),
    })
}
