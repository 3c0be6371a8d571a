//! The touches of a program without asking whether they can be reached: for studies on paper, never for a machine.

use super::layout::lay_out;
use super::plan::{self, ControllerFrame, Plan, PlanBlock, PlanTouch};
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
    let mounting = layout.mounting;
    let length_mm = machine.tool.length_mm;
    let mut touches: Vec<PlanTouch> = Vec::new();
    for (setup, visit) in layout.setups.iter().zip(1..) {
        let pose = setup.at_pose();
        for target in &setup.targets {
            let at = |off_face: f64| -> Result<AxisMap> {
                let ball = target.point + target.normal * (machine.probe.ball_radius + off_face);
                let place: Position =
                    machine.linear_for_ball(mounting.carrier, &pose, &ball, length_mm).ok_or_else(|| {
                        Failure::new("program::linear_axes", "the linear axes do not span space in this pose")
                    })?;
                let xyz = place.xyz_mm();
                Ok(AxisMap::xyz(xyz.x, xyz.y, xyz.z))
            };
            for repeat in 1..=setup.spec.repeats {
                touches.push(PlanTouch {
                    id: touches.len() as u64 + 1,
                    stage: setup.spec.stage.clone(),
                    repeat,
                    carrier: mounting.carrier.to_string(),
                    mounting: None,
                    block: mounting.blocks[target.block].name.clone(),
                    face: target.face.to_string(),
                    point: target.point.into(),
                    normal: target.normal.into(),
                    pose: setup.pose,
                    start: at(machine.probe.approach)?,
                    nominal: at(0.0)?,
                    end: at(-machine.probe.search)?,
                    time_s: None,
                    visit: Some(visit),
                    feed_mm_min: None,
                    spindle_deg: None,
                    tool_length_mm: None,
                    ball_radius_mm: None,
                    from: AxisMap::default(),
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
        mounting: mounting.name.clone(),
        controller_frame: ControllerFrame::Axes,
        ball_radius_mm: machine.probe.ball_radius,
        tool_length_mm: length_mm,
        placement_tolerance_mm: None,
        blocks: mounting
            .blocks
            .iter()
            .map(|b| PlanBlock {
                name: b.name.clone(),
                carrier: mounting.carrier.to_string(),
                mounting: None,
                centre: b.centre.into(),
                size: b.size.into(),
            })
            .collect(),
        touches,
        skipped: Vec::new(),
        notes: Vec::new(),
    })
}
