//! At which point an error of an axis is stated, and along which directions its components count.
//!
//! A rotary axis turns about its own line, wherever that line lies: its zero position, its positioning and its error
//! motions are stated there. Only its location errors, which say where that line is, are stated at a point that the user
//! chooses (docs/conventions.md, "About which point an error turns").

use super::catalogue::{About, Effect, Place, Term};
use crate::axes::AxisName;
use crate::machine::{Axis, Machine, Side};
use nalgebra::{Matrix3, UnitQuaternion, Vector3};

/// At which point an error is stated.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Stated {
    /// A location error of a workpiece-side rotary axis: at the reference point, components along R.
    Reference,
    /// Another constant error of a rotary axis: at the axis's `point`, components along R.
    AxisPoint,
    /// An error motion or zero position of a rotary axis: on its own line, components in the axis's own frame.
    OwnLine,
    /// An error of anything but a rotary axis: where its place says.
    Place,
}

#[must_use]
pub fn stated(machine: &Machine, effect: &Effect, term: &Term) -> Stated {
    let (name, before) = match term.place {
        Place::Before(name) if name.is_rotary() => (name, true),
        Place::After(name) if name.is_rotary() => (name, false),
        _ => return Stated::Place,
    };
    let Some(axis) = machine.axis(name) else { return Stated::Place };
    let on_workpiece = axis.side == Side::Workpiece;
    let about_itself = on_workpiece && square(axis).is_some() && term.component == own_turn(name);
    if effect.about == Some(About::Line) || about_itself || term.formula.constant().is_none() {
        Stated::OwnLine
    } else if on_workpiece && before {
        Stated::Reference
    } else {
        Stated::AxisPoint
    }
}

/// The component (3, 4 or 5) that turns an axis about itself in its own frame.
#[must_use]
pub fn own_turn(axis: AxisName) -> usize {
    axis.index()
}

/// +1 or -1 where a rotary axis lies along or against the direction of its letter: its own frame is then R.
fn square(axis: &Axis) -> Option<f64> {
    let share = along_letter(axis);
    ((share.abs() - 1.0).abs() < 1e-9).then_some(share.signum())
}

fn letter(axis: &Axis) -> Vector3<f64> {
    let mut v = Vector3::zeros();
    v[axis.name.index() % 3] = 1.0;
    v
}

fn along_letter(axis: &Axis) -> f64 {
    axis.direction.dot(&letter(axis))
}

/// +1 where the axis's `direction` points to the side of its letter, -1 where it points against it.
#[must_use]
pub fn direction_sign(axis: &Axis) -> f64 {
    if along_letter(axis) < 0.0 { -1.0 } else { 1.0 }
}

/// The axis's own frame: its columns are the directions, in R, along which dx dy dz and about which rx ry rz count.
///
/// R turned by the smallest angle that lays the direction of the axis's letter onto its line; `None` where that is R.
#[must_use]
pub fn own_frame(axis: &Axis) -> Option<Matrix3<f64>> {
    if square(axis).is_some() {
        return None;
    }
    let line = axis.direction.into_inner() * direction_sign(axis);
    // the two are never opposite: the sign has been chosen so that they enclose 90 degrees at most
    UnitQuaternion::rotation_between(&letter(axis), &line).map(|q| q.to_rotation_matrix().into_inner())
}

/// The point of the axis's own line at which its error motions are stated, mm in R: workpiece side the nearest to the
/// ball's place at zero, where the artefact stands; tool side the axis's `point`.
#[must_use]
pub fn own_point(machine: &Machine, axis: &Axis) -> Vector3<f64> {
    match axis.side {
        Side::Tool => axis.point,
        Side::Workpiece => {
            let direction = axis.direction.into_inner();
            axis.point + direction * direction.dot(&(machine.reference.ball - axis.point))
        }
    }
}
