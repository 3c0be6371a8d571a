//! What is to be touched, in which order and along which path: controller-neutral.
//!
//! `programs/*.toml` ([`spec`]) on a machine ([`layout`]) → [`plan::Plan`] (the touches) and [`path::Path`] (every move):
//! chosen by `route`, proven once more by [`verify()`]. Shapes and distances are in [`scene`], the proof of a single move
//! in [`sweep`].

pub mod as_written;
mod clock;
pub mod find;
pub mod heights;
pub mod layout;
mod library;
mod operator_notes;
pub mod parts;
pub mod path;
pub mod plan;
pub mod plan_check;
pub mod plan_digest;
mod plan_without_path;
mod reach;
pub mod ring_points;
mod rotary_turns;
mod route;
mod route_find;
pub mod scene;
pub mod spec;
mod stops;
pub mod sweep;
mod touch_status;
mod verify;

#[cfg(test)]
mod tests;

pub use library::{built_in, choose, written_for};
pub use operator_notes::{SkippedGroup, duration, pose_says, skipped_groups};
pub use plan_without_path::plan_without_path;
pub use spec::{ProgramSpec, load};
pub use touch_status::Status;
pub use verify::{Violation, verify};

use crate::diag::{Failure, Finding, Findings, Result};
use crate::machine::Machine;
use plan::{ControllerFrame, Plan};

/// How a program is generated.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Options {
    /// Refuse the program when a single touch cannot be reached, instead of leaving it out.
    pub strict: bool,
    /// The controller's coordinates mean the tool centre point in the workpiece, under its own transformation. Plan and
    /// path hold axis positions all the same: the postprocessor spells them.
    pub tcp: bool,
}

/// A plan with the path that makes its touches.
#[derive(Debug, Clone, PartialEq)]
pub struct Generated {
    /// The touches.
    pub plan: Plan,
    /// Every move.
    pub path: path::Path,
}

/// The JSON schema of a program file.
#[must_use]
pub fn schema() -> schemars::Schema {
    schemars::schema_for!(as_written::File)
}

/// Makes plan and path of a program on a machine. The same input gives the same bytes.
///
/// Touches that cannot be reached are left out, each with its reason in `plan.skipped`, a warning for each face, and what
/// is lost by it in `plan.notes`. The finished path is proven by [`verify()`] before it is given out.
///
/// # Errors
/// When the program does not fit the machine, nothing (or with [`Options::strict`]: not everything) can be reached, or the
/// proof finds a move that is not clear.
pub fn generate(machine: &Machine, spec: &ProgramSpec, options: &Options) -> Result<(Generated, Findings)> {
    let by_eye_mm = spec.placement_tolerance_mm.filter(|mm| *mm > machine.probe.placement_tolerance);
    // all places lie so far inside that they may be relative to wherever the artefact stands
    let inside = by_eye_mm.map(|mm| find::with_reserve(machine, find::farthest_mm(mm)));
    let (whole, machine) = (machine, inside.as_ref().unwrap_or(machine));
    let (layout, mut findings) = layout::lay_out(machine, spec)?;
    let by_eye = by_eye_mm.map(|mm| scene::ByEye { displacement_mm: find::farthest_mm(mm), found: true });
    let scene_of = |p| {
        let parts::Part { machine, mounting, .. }: &parts::Part<'_> = p;
        scene::Scene::new(machine, mounting).map(|scene| scene.put_by_eye(by_eye))
    };
    let scenes: Vec<scene::Scene> = layout.parts.iter().map(scene_of).collect::<Result<_>>()?;
    for scene in &scenes {
        scene.blocks_clear_of_each_other()?;
    }
    let finding = by_eye_mm.map(|mm| finding(&layout, &scenes, options, mm)).transpose()?;
    let finding = finding.as_ref().map(|(scene, find)| (scene, find));
    let mut routed = route::route(&scenes, finding, &layout, spec, options.tcp)?;
    let groups = skipped_groups(&routed.skipped);
    for group in &groups {
        let message = format!(
            "{} of block {} at {} cannot be touched ({} points): {}",
            group.face,
            group.block,
            pose_says(&group.pose),
            group.points,
            group.reason
        );
        findings.push(if options.strict {
            Finding::error("program::unreachable", message)
                .help("take it out of the program, change the set-up, or leave --strict out")
        } else {
            Finding::warning("program::unreachable", message).help("these touches are left out")
        });
    }
    if let Some(reason) = &routed.stays_turned {
        let message = format!("at the end the rotary axes are not turned back to 0: {reason}");
        findings.push(Finding::warning("program::stays_turned", message).help(
            "a control that can switch its transformation off only there gets no program: a lower artefact, a shorter stylus, or without --tcp",
        ));
    }
    if routed.touches.is_empty() {
        findings.push(
            Finding::error(
                "program::nothing_left",
                format!("nothing of {:?} can be touched on {}", spec.name, machine.name),
            )
            .help("higher risers, a longer stylus, or other poses: the reasons are above"),
        );
    }
    if findings.has_errors() {
        return Err(Failure(findings.0));
    }
    let notes = operator_notes::losses(&layout, &routed.touches, &routed.skipped);
    for note in &notes {
        findings.push(Finding::warning("program::lost", note.clone()));
    }
    let head = operator_notes::head(machine, spec, &layout, &routed);
    routed.path.head = head;
    let first = layout.parts.first();
    let own = first.map_or(machine, |p| &p.machine);
    let plan = Plan {
        format: plan::FORMAT.to_owned(),
        machine: machine.name.clone(),
        machine_sha256: machine.sha256.clone(),
        program: spec.name.clone(),
        mounting: first.map(|p| p.label.clone()).unwrap_or_default(),
        blocks_anew: false,
        controller_frame: if options.tcp { ControllerFrame::Tcp } else { ControllerFrame::Axes },
        ball_radius_mm: own.probe.ball_radius,
        tool_length_mm: own.tool.length_mm,
        placement_tolerance_mm: Some(machine.probe.placement_tolerance),
        find: finding.map(|(_, find)| find.clone()),
        blocks: parts::plan_blocks(&layout.parts),
        touches: routed.touches,
        skipped: routed.skipped,
        notes,
        programs: std::collections::BTreeMap::new(),
    };
    let generated = Generated { plan, path: routed.path };
    let violations = verify(whole, &generated.plan, &generated.path)?;
    if !violations.is_empty() {
        let findings = violations.iter().map(|v| {
            Finding::error("program::unproven", format!("step {} of the path: {}", v.step + 1, v.says))
                .help("no file was written; please report this with the machine's and the program's file")
        });
        return Err(Failure(findings.collect()));
    }
    Ok((generated, findings))
}

/// How an artefact that is put down by eye is found: what must be left free until then, and the touches.
///
/// # Errors
/// Why it is not found by touches.
fn finding<'m>(
    layout: &'m layout::Layout<'_>,
    scenes: &[scene::Scene<'m>],
    options: &Options,
    tolerance_mm: f64,
) -> Result<(scene::Scene<'m>, plan::Find)> {
    let refuse =
        |why: &str, help: &str| Failure::new("program::find", format!("placement_tolerance: {why}")).help(help);
    if options.tcp {
        let why = "under the control's own transformation an artefact is not found by touches";
        return Err(refuse(why, "generate without --tcp, or place it within the tolerance of the machine"));
    }
    let ([part], Some(lift)) = (layout.parts.as_slice(), scenes.first().and_then(scene::Scene::lift)) else {
        let why = "the program stops for another artefact or stylus, which would have to be found anew";
        return Err(refuse(why, "a program of one artefact and one stylus"));
    };
    let by_eye = scene::ByEye { displacement_mm: find::farthest_mm(tolerance_mm), found: false };
    let unfound = scene::Scene::new(&part.machine, part.mounting)?.put_by_eye(Some(by_eye));
    let touches = find::touches(&unfound, &lift, find::sphere(part.mounting)?, tolerance_mm)?;
    Ok((unfound, touches))
}
