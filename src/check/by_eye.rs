//! A program that finds an artefact which was put down by eye: it is run with the artefact at its place, and at each corner of the box in
//! which it may stand. The touches are then expected where that artefact has them.

use super::{Checked, Part};
use crate::axes::Position;
use crate::diag::Finding;
use crate::machine::{Machine, Shape};
use crate::program::find::{farthest_mm, with_reserve};
use crate::program::plan::{Find, Plan};
use crate::units::Plain;
use nalgebra::Vector3;

/// The places of contacts are latched so well, and what is computed from them is off by as much, mm.
pub const FOUND_MM: f64 = 0.002;

/// The corners of the box, from its middle, mm along X, Y and Z with all rotary axes at 0.
pub fn corners(find: &Find) -> Vec<Vector3<f64>> {
    let mm = find.tolerance_mm;
    let sides = [-mm, mm];
    sides.iter().flat_map(|x| sides.map(|y| (*x, y))).flat_map(|(x, y)| sides.map(|z| Vector3::new(x, y, z))).collect()
}

/// What is mounted, with the artefact off by so much, on a machine whose places all lie inside by what they may be shifted.
pub fn displaced(machine: &Machine, plan: &Plan, parts: Vec<Part>, off_mm: &Vector3<f64>) -> Vec<Part> {
    let Some(find) = &plan.find else { return parts };
    let reserve = farthest_mm(find.tolerance_mm);
    let move_one = |mut part: Part| {
        part.machine = with_reserve(&part.machine, reserve);
        let length = machine.tool.length_mm;
        let Some(block) = part.mounting.blocks.iter().find(|b| b.name == find.block) else { return part };
        let ball =
            |linear: Vector3<f64>| machine.ball_in(block.carrier, &Position::default().with_xyz_mm(linear), length);
        let off = ball(*off_mm) - ball(Vector3::zeros());
        part.mounting.blocks.iter_mut().for_each(|b| b.centre += off);
        for solid in &mut part.mounting.solids {
            match &mut solid.shape {
                Shape::Box { centre, .. } => *centre += off,
                Shape::Cylinder { foot, .. } => *foot += off,
            }
        }
        part
    };
    parts.into_iter().map(move_one).collect()
}

/// Adds what is wrong with the artefact somewhere else.
pub fn add(checked: &mut Checked, there: Checked, off_mm: &Vector3<f64>) {
    let [x, y, z] =
        [off_mm.x, off_mm.y, off_mm.z].map(|mm| format!("{}{}", if mm < 0.0 { "" } else { "+" }, Plain(mm)));
    let says = format!("with the artefact off by X{x} Y{y} Z{z} mm");
    let errors = there.findings.into_iter().filter(|f| f.severity == crate::diag::Severity::Error);
    checked.findings.extend(errors.map(|f| Finding { message: format!("{says}: {}", f.message), ..f }));
}
