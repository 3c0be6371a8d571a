//! What a person must know before pressing start, and what was lost where touches were left out.

use super::layout::{Layout, Setup};
use super::plan::{PlanTouch, Skipped};
use super::route::Routed;
use super::spec::ProgramSpec;
use crate::axes::{AxisMap, AxisName, Position};
use crate::machine::as_written::Toward;
use crate::machine::{Block, Form, Machine, Side};
use nalgebra::Vector3;
use std::collections::{BTreeMap, BTreeSet};

/// The lines at the head of the NC program: plain ASCII, no brackets, so that every control takes them as a comment.
pub(super) fn head(machine: &Machine, spec: &ProgramSpec, layout: &Layout, routed: &Routed) -> Vec<String> {
    let probe = &machine.probe;
    let mut lines = vec![
        spec.says.clone(),
        format!(
            "{} touches, about {}; the plan {}.plan.json belongs to it",
            routed.touches.len(),
            duration(routed.path.seconds),
            spec.name
        ),
    ];
    lines.extend(parts_lines(layout));
    let all = || layout.parts.iter().flat_map(|p| &p.mounting.blocks);
    let faces = all().any(|b| matches!(b.form, Form::Box | Form::Plane));
    let body = if all().all(|b| b.form == Form::Box) { "block" } else { "body" };
    let tolerance = probe.placement_tolerance;
    let by_eye = spec.placement_tolerance_mm.filter(|mm| *mm > tolerance);
    lines.extend([
        if let Some(mm) = by_eye {
            format!("  what is touched within {mm} mm of its position along X, Y and Z: the first touches find it")
        } else if faces {
            format!("  each block within {tolerance} mm of its position, its faces along the machine's axes")
        } else {
            format!("  what is touched within {tolerance} mm of its position")
        },
        format!("  a touch that is further off stops the program; the first of each {body} is made slowly"),
        "  the positions above and below are machine coordinates with all rotary axes at 0, ball's centre".to_owned(),
        "Before the start:".to_owned(),
        "  probe in the spindle, spindle stopped, nothing that touches the stylus".to_owned(),
    ]);
    if let Some(mm) = by_eye {
        let [too_far, bears] = [past_mm(routed) + mm, probe.overtravel];
        lines.push(format!(
            "  deflect the stylus by hand: the control must show it. A dead probe would be pushed by up to {too_far:.1} mm, it bears {bears} mm"
        ));
    }
    lines.extend(sense_lines(machine, layout));
    if !routed.skipped.is_empty() {
        lines.push(match routed.skipped.len() {
            1 => "  1 touch of the program was left out: it cannot be reached".to_owned(),
            n => format!("  {n} touches of the program were left out: they cannot be reached"),
        });
        lines.extend(losses(layout, &routed.touches, &routed.skipped).into_iter().map(|note| format!("    {note}")));
    }
    if let Some(near) = &routed.path.start_near {
        lines.push(format!(
            "  turn the rotary axes to {}, within {} deg: not every angle is clear at the top",
            pose_says(&near.pose),
            near.within_deg
        ));
    }
    let first = routed.path.steps.iter().find_map(|s| match s {
        super::path::Step::Rapid { to } => to.iter().next(),
        _ => None,
    });
    if let Some((axis, top)) = first {
        let top = top + machine.origin.get(axis).unwrap_or(0.0);
        lines.push(format!(
            "  the first move takes {axis} straight to {top:.3} from where it stands: keep that way free"
        ));
    }
    for line in &mut lines {
        line.retain(|c| c.is_ascii() && !matches!(c, '(' | ')'));
    }
    lines.retain(|l| !l.trim().is_empty());
    lines
}

/// How far the first search is programmed to go past the nominal contact, mm.
fn past_mm(routed: &Routed) -> f64 {
    let way =
        |touch: &super::path::TouchStep| (touch.end.position().xyz_mm() - touch.nominal.position().xyz_mm()).norm();
    routed.path.steps.iter().find_map(|step| step.touch().map(way)).unwrap_or(0.0)
}

/// What is to be put up: at the start and, where the program has several parts, at each stop.
fn parts_lines(layout: &Layout) -> Vec<String> {
    let mut lines = Vec::new();
    let mut said = BTreeSet::new();
    for (i, part) in layout.parts.iter().enumerate() {
        lines.push(if i == 0 {
            "Set up:".to_owned()
        } else {
            format!("At stop {i}, where the program waits for cycle start:")
        });
        lines.push(format!("  mounting {}: {}", part.mounting.name, part.mounting.says));
        if said.insert(&part.mounting.name) {
            for block in &part.mounting.blocks {
                lines.extend(block_lines(&part.machine, block));
            }
        }
        let says = if part.stylus.is_some() { part.stylus_says() } else { part.probe_says() };
        lines.push(format!("  probe with {says}"));
    }
    lines
}

/// How each rotary axis must turn: a machine that counts the other way would lay the stylus on the other side.
fn sense_lines(machine: &Machine, layout: &Layout) -> Vec<String> {
    let mut lines = Vec::new();
    for axis in machine.rotary() {
        let angles = layout.setups.iter().filter_map(|s| s.pose.get(axis.name));
        // half a turn shows no sense
        let Some(angle) =
            angles.filter(|a| (a % 180.0).abs() > 1.0).max_by(|a, b| a.abs().min(90.0).total_cmp(&b.abs().min(90.0)))
        else {
            continue;
        };
        let mut at = Position::default();
        at.set(axis.name, angle);
        let turn = axis.motion(&at).rotation;
        lines.push(if axis.side == Side::Tool {
            format!(
                "  check the direction of {0}: at {0} {angle} the ball must be on the {1} side of the pivot",
                axis.name,
                towards(&(turn * -machine.tool.direction.into_inner()))
            )
        } else {
            let across = if axis.direction.x.abs() > 0.9 { Vector3::y() } else { Vector3::x() };
            format!(
                "  check the direction of {0}: at {0} {angle} what was towards {1} must be towards {2}",
                axis.name,
                towards(&across),
                towards(&(turn * across))
            )
        });
    }
    lines
}

/// A direction in words: +X, or between +X and -Z.
fn towards(direction: &Vector3<f64>) -> String {
    let words: Vec<String> = [AxisName::X, AxisName::Y, AxisName::Z]
        .iter()
        .zip(direction.iter())
        .filter(|(_, d)| d.abs() > 0.2)
        .map(|(a, d)| format!("{}{a}", if *d > 0.0 { "+" } else { "-" }))
        .collect();
    words.join(" ")
}

fn block_lines(machine: &Machine, block: &Block) -> Vec<String> {
    let top = block.centre + Vector3::z() * (block.size.z / 2.0 + machine.probe.ball_radius);
    let at = machine.linear_for_ball(block.carrier, &Position::default(), &top, machine.tool.length_mm);
    let edges = format!("{} x {} x {} mm", block.size.x, block.size.y, block.size.z);
    let across = block.diameter.unwrap_or_default();
    let mut line = match block.form {
        Form::Box | Form::Centre | Form::Reading | Form::Part => format!("  block {}: {edges}", block.name),
        Form::Plane => format!("  plane {}: {edges}", block.name),
        Form::Sphere => format!("  sphere {}: {across} mm across", block.name),
        Form::Cylinder => format!("  cylinder {}: {across} mm across, {} mm high", block.name, block.size.z),
        Form::Bore => format!("  bore {}: {across} mm across, in a body of {edges}", block.name),
    };
    if let Some(riser) = &block.riser {
        let what = if riser.diameter.is_some() { "stem" } else { "riser" };
        line.push_str(&format!(", on a {what} {} mm high", riser.height));
        if let Some(toward) = riser.toward.filter(|t| *t != Toward::MinusZ) {
            line.push_str(&format!(", which goes to {}", toward.as_str()));
        }
    }
    let mut lines = vec![line];
    if let Some(at) = at {
        let shown = [AxisName::X, AxisName::Y, AxisName::Z]
            .map(|a| format!("{a} {:.3}", at.get(a) + machine.origin.get(a).unwrap_or(0.0) + 0.0));
        let stands = match block.form {
            Form::Sphere => "the ball rests on its highest point",
            Form::Bore => "the ball stands over the middle of the hole, its lowest point level with the rim,",
            _ => "the ball rests on the middle of its upper face",
        };
        lines.push(format!("    {stands} at {}", shown.join(" ")));
    }
    lines
}

/// `1 h 05 min`, `34 min`, `50 s`.
#[must_use]
pub fn duration(seconds: f64) -> String {
    let minutes = (seconds / 60.0).round();
    if seconds < 90.0 {
        format!("{seconds:.0} s")
    } else if minutes < 60.0 {
        format!("{minutes:.0} min")
    } else {
        format!("{:.0} h {:02.0} min", (minutes / 60.0).floor(), minutes % 60.0)
    }
}

/// A pose in words: `B -90, C 0`.
#[must_use]
pub fn pose_says(pose: &AxisMap) -> String {
    pose.iter().map(|(a, v)| format!("{a} {v}")).collect::<Vec<_>>().join(", ")
}

/// Touches that were left out for one cause in one place.
#[derive(Debug, Clone, PartialEq)]
pub struct SkippedGroup {
    /// Stage of the procedure.
    pub stage: String,
    /// Rotary axes, deg.
    pub pose: AxisMap,
    /// The block's name.
    pub block: String,
    /// The block's own face.
    pub face: String,
    /// How many points.
    pub points: usize,
    /// Why the first of them was left out.
    pub reason: String,
}

/// Skipped touches by pose, block and face, in the order of the plan.
#[must_use]
pub fn skipped_groups(skipped: &[Skipped]) -> Vec<SkippedGroup> {
    let mut groups: Vec<SkippedGroup> = Vec::new();
    for s in skipped {
        let same =
            |g: &&mut SkippedGroup| (&g.stage, &g.block, &g.face) == (&s.stage, &s.block, &s.face) && g.pose == s.pose;
        match groups.iter_mut().find(same) {
            Some(group) => group.points += 1,
            None => groups.push(SkippedGroup {
                stage: s.stage.clone(),
                pose: s.pose,
                block: s.block.clone(),
                face: s.face.clone(),
                points: 1,
                reason: s.reason.clone(),
            }),
        }
    }
    groups
}

/// What is lost by the touches that were left out: poses, blocks, and pairs of opposite faces of which one side is left.
pub(super) fn losses(layout: &Layout, touches: &[PlanTouch], skipped: &[Skipped]) -> Vec<String> {
    if skipped.is_empty() {
        return Vec::new();
    }
    let mut notes = Vec::new();
    for setup in &layout.setups {
        let here = |pose: &AxisMap, stage: &str| *pose == setup.pose && stage == setup.spec.stage;
        let made: BTreeSet<(&str, &str)> =
            touches.iter().filter(|t| here(&t.pose, &t.stage)).map(|t| (t.block.as_str(), t.face.as_str())).collect();
        notes.extend(losses_of(layout, setup, &made));
    }
    notes.dedup();
    notes
}

fn losses_of(layout: &Layout, setup: &Setup, made: &BTreeSet<(&str, &str)>) -> Vec<String> {
    let pose = pose_says(&setup.pose);
    let wanted: Vec<(&str, String, Vector3<f64>)> =
        setup.targets.iter().map(|t| (layout.block_name(setup, t), t.face.to_string(), t.normal)).collect();
    if made.is_empty() {
        return vec![format!("{pose}: nothing can be touched in this pose; every relation that needs it is lost")];
    }
    let mut notes = Vec::new();
    let mut blocks: Vec<&str> = wanted.iter().map(|(b, ..)| *b).collect();
    blocks.dedup();
    for block in blocks.into_iter().filter(|b| !made.iter().any(|(m, _)| m == b)) {
        notes.push(format!("{pose}: block {block} is not touched at all"));
    }
    // by the direction of the face, over all blocks: a relation needs one block on each side
    let mut sides: BTreeMap<usize, [(bool, bool); 2]> = BTreeMap::new();
    // a point of what is round has no opposite face
    for (block, face, normal) in wanted.iter().filter(|(_, face, _)| face.starts_with(['+', '-'])) {
        let axis = normal.iamax();
        let side = sides.entry(axis).or_default();
        let one = &mut side[usize::from(normal[axis] > 0.0)];
        one.0 = true;
        one.1 |= made.contains(&(*block, face.as_str()));
    }
    for (axis, [minus, plus]) in sides {
        let letter = ["X", "Y", "Z"].get(axis).copied().unwrap_or_default();
        let both_wanted = minus.0 && plus.0;
        match (minus.1, plus.1) {
            (true, true) => {}
            (false, false) => {
                notes.push(format!("{pose}: no face that looks along {letter} is touched; {letter} is lost here"))
            }
            (minus_made, _) if both_wanted => {
                let (lost, left) = if minus_made { ('+', '-') } else { ('-', '+') };
                notes.push(format!(
                    "{pose}: the pair of faces along {letter} has lost its {lost}{letter} side; {letter} is known from the \
                     {left}{letter} faces alone, which takes a constant pre-travel in full and needs the ball's radius and \
                     the block's place"
                ));
            }
            (minus_made, plus_made) => {
                // one side was asked for and part of it is there, or it is gone
                let asked = if minus.0 { minus_made } else { plus_made };
                if !asked {
                    notes.push(format!("{pose}: {letter} is lost here"));
                }
            }
        }
    }
    notes
}
