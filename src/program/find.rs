//! An artefact that was put down by eye: the first touches of the program find it, and everything after them is relative to what they
//! found.
//!
//! Two heights and two pairs: the pole of the sphere, two opposite sides along each of the two axes across, and the pole once more.
//! The middle of two opposite contacts at one height is the sphere's middle, whatever the other two coordinates are off.

use super::heights::Lift;
use super::plan::{Find, FindTouch, Plan};
use super::reach::tidy;
use super::scene::Scene;
use super::sweep::Manner;
use crate::axes::{AxisMap, AxisName, Position};
use crate::diag::{Failure, Result};
use crate::machine::{Block, Carrier, Form, Machine, Mounting};
use crate::units::Plain;
use nalgebra::{Matrix3, Vector3};

/// Beyond the way that a displaced sphere asks for, mm.
const BEYOND_MM: f64 = 0.1;

/// Sides are touched this far up from the equator, in radii of the path of the ball: the stem of the probe stays off the sphere.
const UP: f64 = 0.25;

/// Largest placement tolerance, mm: more is a set-up mistake.
pub const MOST_ASTRAY_MM: f64 = 10.0;

/// Can an artefact be put down by eye within this?
#[must_use]
pub fn is_placement_tolerance(mm: f64) -> bool {
    mm > 0.0 && mm <= MOST_ASTRAY_MM
}

/// How far a place in a box of this half edge may be off, mm.
#[must_use]
pub fn farthest_mm(tolerance_mm: f64) -> f64 {
    tolerance_mm * 3f64.sqrt()
}

/// By how much the axes must go further in a pose, for each mm that the artefact stands off along X, Y and Z with all rotary axes at
/// 0: the columns of the matrix.
#[must_use]
pub fn shift_matrix(machine: &Machine, carrier: Carrier, pose: &Position) -> Option<Matrix3<f64>> {
    let length = machine.tool.length_mm;
    let at_zero = |linear: &Vector3<f64>| machine.ball_in(carrier, &Position::default().with_xyz_mm(*linear), length);
    let here = machine.ball_places(carrier, pose, length)?;
    let from = here.linear_for(&at_zero(&Vector3::zeros()));
    let columns = [Vector3::x(), Vector3::y(), Vector3::z()].map(|unit| here.linear_for(&at_zero(&unit)) - from);
    Some(Matrix3::from_columns(&columns))
}

/// A machine on which all places of a program lie so far inside the ranges that they may be shifted by as much, mm.
#[must_use]
pub fn with_reserve(machine: &Machine, mm: f64) -> Machine {
    let mut inside = machine.clone();
    for axis in inside.axes.iter_mut().filter(|a| !a.name.is_rotary()) {
        axis.range = [axis.range[0] + mm, axis.range[1] - mm];
    }
    inside
}

impl Plan {
    /// The plan with its touches where they are made: an artefact that was put down by eye stands off by what the program has found,
    /// mm along X, Y and Z with all rotary axes at 0. Blocks and points stay nominal.
    #[must_use]
    pub fn relative_to(&self, machine: &Machine, found_mm: &Vector3<f64>) -> Self {
        let mut plan = self.clone();
        let mut known: Vec<(AxisMap, String, Vector3<f64>)> = Vec::new();
        for touch in &mut plan.touches {
            let off = match known.iter().find(|(pose, carrier, _)| *pose == touch.pose && *carrier == touch.carrier) {
                Some((_, _, off)) => *off,
                None => {
                    let matrix = machine
                        .carrier(&touch.carrier)
                        .and_then(|carrier| shift_matrix(machine, carrier, &touch.pose.position()));
                    let off = matrix.map_or_else(Vector3::zeros, |m| m * found_mm);
                    known.push((touch.pose, touch.carrier.clone(), off));
                    off
                }
            };
            for place in [&mut touch.start, &mut touch.nominal, &mut touch.end] {
                let at = place.position().xyz_mm() + off;
                *place = AxisMap::xyz(at.x, at.y, at.z);
            }
        }
        plan
    }
}

/// The one sphere that a program finds.
///
/// # Errors
/// Why what is mounted cannot be found.
pub(super) fn sphere(mounting: &Mounting) -> Result<&Block> {
    match mounting.blocks.as_slice() {
        [one] if one.form == Form::Sphere => Ok(one),
        _ => Err(Failure::new(
            "program::find",
            format!(
                "placement_tolerance: mounting {:?} is not one sphere, and only that is found by touches",
                mounting.name
            ),
        )
        .help("place it within the tolerance of the machine, or take placement_tolerance out")),
    }
}

/// The touches that find the sphere. `scene`: that of a machine on which it may stand anywhere within the tolerance.
///
/// # Errors
/// Why it cannot be found so.
pub(super) fn touches(scene: &Scene<'_>, lift: &Lift, block: &Block, tolerance_mm: f64) -> Result<Find> {
    let machine = scene.machine;
    let refuse = |why: String| {
        Failure::new("program::find", format!("block {} cannot be found by touches: {why}", block.name))
            .help("a smaller placement_tolerance, or place it within the tolerance of the machine")
    };
    let (length, zero) = (machine.tool.length_mm, Position::default());
    let places = machine
        .ball_places(block.carrier, &zero, length)
        .ok_or_else(|| refuse("the linear axes do not span space".to_owned()))?;
    let way = |axis: AxisName| {
        let moved = AxisMap::default().with(axis, 1.0).position();
        machine.ball_in(block.carrier, &moved, length) - machine.ball_in(block.carrier, &zero, length)
    };
    let up = way(lift.axis) * lift.sense;
    let across: Vec<AxisName> =
        [AxisName::X, AxisName::Y, AxisName::Z].into_iter().filter(|a| *a != lift.axis).collect();
    let ways: Vec<Vector3<f64>> = across.iter().map(|a| way(*a)).collect();
    let square = Matrix3::from_fn(|i, j| ways.get(j).map_or(up, |w| *w)[i]);
    let is_square = (square.transpose() * square - Matrix3::identity()).norm() < 1e-6;
    if !is_square || (up - machine.tool.direction.into_inner()).norm() > 1e-6 {
        return Err(refuse(
            "with all rotary axes at 0 the spindle and X, Y, Z are not square to each other".to_owned(),
        ));
    }
    let rho = block.diameter.unwrap_or_default() / 2.0 + machine.probe.ball_radius;
    if rho < 2.0 * tolerance_mm {
        let most = Plain((rho * 50.0).floor() / 100.0);
        return Err(refuse(format!("{} mm are too much for its size, {most} mm are the most", Plain(tolerance_mm))));
    }
    // where the ball comes down beside the middle, it meets the sphere that much later
    let chord = |aside: f64| rho - (rho * rho - aside * aside).sqrt();
    let room_mm = tolerance_mm + chord(tolerance_mm * std::f64::consts::SQRT_2) + BEYOND_MM;
    let probe = &machine.probe;
    let gap = probe.clearance + farthest_mm(tolerance_mm) + BEYOND_MM;
    let one = |face: String, from: Vector3<f64>, height: f64, moves: AxisMap| -> Result<FindTouch> {
        // along `from`, at this height over the middle
        let flat = (rho * rho - height * height).sqrt();
        let begins = ((rho + gap) * (rho + gap) - height * height).sqrt();
        let ball = |far: f64| {
            let at = block.centre + from * far + up * height;
            tidy(&zero.with_xyz_mm(places.linear_for(&at)))
        };
        let [start, nominal, end] = [begins, flat, flat - room_mm - BEYOND_MM].map(ball);
        let clear = [&start, &nominal, &end].into_iter().try_for_each(|at| scene.inside_limits(at));
        let block = 0;
        let clear = clear
            .and_then(|()| {
                scene.clear_straight(&start, &nominal, Manner::ToContact(block)).map_err(|hit| hit.to_string())
            })
            .and_then(|()| {
                scene.clear_straight(&nominal, &end, Manner::PastArtefact(block)).map_err(|hit| hit.to_string())
            });
        clear.map_err(|why| refuse(format!("{face}: {why}")))?;
        let linear = |at: &Position| {
            let at = at.xyz_mm();
            AxisMap::xyz(at.x, at.y, at.z)
        };
        Ok(FindTouch { face, start: linear(&start), nominal: linear(&nominal), end: linear(&end), moves })
    };
    // a contact that comes later is one further down
    let pole = || one("pole".to_owned(), up, 0.0, AxisMap::default().with(lift.axis, -lift.sense));
    let mut touches = vec![pole()?];
    for axis in across {
        for side in [-1.0, 1.0] {
            let face = format!("side {}{axis}", if side < 0.0 { '-' } else { '+' });
            touches.push(one(face, way(axis) * side, UP * rho, AxisMap::default().with(axis, -side / 2.0))?);
        }
    }
    touches.push(pole()?);
    Ok(Find { block: block.name.clone(), tolerance_mm, room_mm, touches })
}
