//! What a control's transformation can know of a machine: the lines of its rotary axes, as they lie at zero.
//!
//! Every chain of constant errors is such a machine exactly. With E the error before and after each rotation M,
//!
//! ```text
//! E1·M1(q1)·F1·E2·M2(q2)·F2  =  M1'(q1)·M2'(q2)·S        M1' about E1·line1,  M2' about E1·F1·E2·line2,  S = E1·F1·E2·F2
//! ```
//!
//! so that lines and one rigid displacement S, which does not depend on any angle, say everything. On the workpiece side S
//! is where the workpiece stands, which is touched off; on the tool side it moves the ball by the same δ for every
//! position of the axes, and a control whose vectors close (at zero the machine coordinates are those of the tool) counts
//! its lines from there. What is not said by lines is the tool's own direction: right for the tool length that was
//! measured with, see [`Seen::from_errors`].

use super::kins::{Errors, Kins};
use crate::axes::{AxisName, Position};
use crate::geometry::{Transform, apply, rotation_about};
use crate::machine::{Axis, Machine, Side};
use nalgebra::{Unit, Vector3};
use std::collections::BTreeMap;

/// The line of a rotary axis at zero.
#[derive(Debug, Clone, PartialEq)]
pub struct Line {
    pub axis: AxisName,
    /// A point of it, mm: workpiece side in machine coordinates (where the adapter stands at it), tool side from the
    /// adapter.
    pub point: Vector3<f64>,
    /// About which a positive coordinate turns what the axis carries, right-handed.
    pub direction: Unit<Vector3<f64>>,
}

/// A machine as a control sees it.
#[derive(Debug, Clone, PartialEq)]
pub struct Seen {
    /// From the base on.
    pub workpiece: Vec<Line>,
    /// From the base on.
    pub tool: Vec<Line>,
    /// From the adapter to the ball at zero, mm: the tool as the control takes it.
    pub stylus: Vector3<f64>,
    /// Added to a place in R to get machine coordinates, mm.
    pub to_machine: Vector3<f64>,
    /// Machine coordinates of R's origin, mm.
    pub origin: Vector3<f64>,
    /// How far the workpiece stands off in it, mm and rad: it is touched off again after loading.
    pub workpiece_off: Transform,
}

/// Is it a machine whose chain a control's transformation describes: linear axes along X, Y, Z next to the base?
///
/// # Errors
/// The reason why not, in words.
pub fn fits(machine: &Machine) -> Result<(), String> {
    for side in [Side::Workpiece, Side::Tool] {
        let mut turned = false;
        for axis in machine.side(side) {
            turned |= axis.name.is_rotary();
            if axis.name.is_rotary() {
                continue;
            }
            if turned {
                return Err(format!(
                    "axis {} is carried by a rotary axis; the control's transformation knows it the other way round",
                    axis.name
                ));
            }
            let mut own = Vector3::zeros();
            own[axis.name.index()] = 1.0;
            if (axis.direction.dot(&own) - 1.0).abs() > 1e-9 {
                return Err(format!(
                    "axis {} is not along {} of the machine, as the control assumes",
                    axis.name, axis.name
                ));
            }
        }
    }
    let origin = machine.rotary().find(|a| machine.origin.get(a.name).unwrap_or(0.0) != 0.0);
    match origin {
        Some(axis) => Err(format!(
            "axis {} shows {} where R has its zero; the vectors of a control count from 0 of every rotary axis",
            axis.name,
            machine.origin.get(axis.name).unwrap_or(0.0)
        )),
        None => Ok(()),
    }
}

fn seen_direction(axis: &Axis, frame: &Transform) -> Unit<Vector3<f64>> {
    frame.rotation * if axis.sense < 0.0 { -axis.direction } else { axis.direction }
}

impl Seen {
    /// The machine with errors, for a tool of a length (pivot to ball, mm).
    ///
    /// Where the head is tilted the ball of this tool stands right at every angle; that of a tool longer by L is off by
    /// the tilt times L.
    #[must_use]
    pub fn from_errors(machine: &Machine, errors: &Errors, length_mm: f64) -> Self {
        let side = |side: Side| {
            let (mut frame, mut lines) = (Transform::identity(), Vec::new());
            for axis in machine.side(side).filter(|a| a.name.is_rotary()) {
                let e = errors.of_axis(axis.name);
                frame *= e.before.transform_about(&errors.centre(axis));
                lines.push(Line {
                    axis: axis.name,
                    point: apply(&frame, &axis.point),
                    direction: seen_direction(axis, &frame),
                });
                frame *= rotation_about(&axis.point, &axis.direction, e.zero_rad);
                frame *= e.after.transform_about(&axis.point);
            }
            (frame, lines)
        };
        let (work, mut workpiece) = side(Side::Workpiece);
        let (head, mut tool) = side(Side::Tool);
        let ball = machine.tool.ball_at_zero(length_mm);
        let off = apply(&head, &ball) - ball;
        let pivot = machine.tool.pivot;
        let origin =
            Vector3::from([AxisName::X, AxisName::Y, AxisName::Z].map(|a| machine.origin.get(a).unwrap_or(0.0)));
        for line in &mut tool {
            line.point -= off + pivot;
        }
        for line in &mut workpiece {
            line.point += origin - off - pivot;
        }
        let workpiece_off = Transform::from_parts((-off).into(), nalgebra::UnitQuaternion::identity()) * work;
        Self { workpiece, tool, stylus: ball - pivot, to_machine: origin - pivot, origin, workpiece_off }
    }

    /// The lines of one side.
    #[must_use]
    pub fn side(&self, side: Side) -> &[Line] {
        match side {
            Side::Workpiece => &self.workpiece,
            Side::Tool => &self.tool,
        }
    }

    /// The lines of one side, to be changed.
    pub fn side_mut(&mut self, side: Side) -> &mut Vec<Line> {
        match side {
            Side::Workpiece => &mut self.workpiece,
            Side::Tool => &mut self.tool,
        }
    }

    /// Positions of the linear axes relative to R at which this control holds the ball at a place of the workpiece (in R
    /// at zero, mm), with the rotary axes at `pose`; `longer`: the tool is that much longer than the one seen with, mm.
    #[must_use]
    pub fn linear(&self, place: &Vector3<f64>, pose: &Position, longer: f64) -> Vector3<f64> {
        let turned = |lines: &[Line]| {
            let each = lines.iter().map(|l| rotation_about(&l.point, &l.direction, pose.mm_or_rad(l.axis)));
            each.fold(Transform::identity(), |all, one| all * one)
        };
        let work = apply(&turned(&self.workpiece), &(place + self.to_machine));
        let stylus = self.stylus + self.stylus.try_normalize(0.0).unwrap_or_default() * longer;
        work - apply(&turned(&self.tool), &stylus) - self.origin
    }

    /// How far the ball stands off its place of the workpiece (in R at zero, mm) where this control drives a machine with
    /// errors; what it stands off at zero too is a matter of where the workpiece is, and not counted. `told_deg`: what the
    /// control adds to the angles that a program names, deg.
    #[must_use]
    pub fn ball_off(
        &self,
        (nominal, kins): (&Self, &Kins),
        place: &Vector3<f64>,
        pose: &Position,
        longer: f64,
        told_deg: &BTreeMap<AxisName, f64>,
    ) -> Vector3<f64> {
        let at = |pose: &Position| {
            let world = pose.with_xyz_mm(nominal.linear(place, pose, longer));
            let mut joints = pose.with_xyz_mm(self.linear(place, pose, longer));
            for (axis, deg) in told_deg {
                joints.set(*axis, joints.get(*axis) + deg);
            }
            kins.ball_error(&world, &joints)
        };
        at(pose) - at(&Position::default())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diag::source;
    use crate::tables::compensation::Term;
    use crate::tables::place::{Dof, Place};

    fn machine(name: &str) -> Machine {
        let (machines, _) = crate::machine::load(&source("m", crate::machine::BUILT_IN)).unwrap();
        machines.into_iter().find(|m| m.name == name).unwrap()
    }

    /// Every constant error at once: the ball stands where it should, but for one shift of the workpiece.
    #[test]
    fn lines_say_everything_but_where_the_workpiece_is() {
        for name in ["swivel-head", "double-head", "trunnion", "swivel-table-b", "nutating-b", "trunnion-offset"] {
            let machine = machine(name);
            let mut terms = Vec::new();
            let mut size = 0.03;
            for axis in machine.rotary() {
                for place in [Place::Before, Place::After] {
                    for dof in Dof::ALL {
                        size = -size * 1.03;
                        let parameter = String::new();
                        let (effect, unit) = (String::new(), dof.unit().to_owned());
                        terms.push(Term {
                            axis: axis.name,
                            place,
                            dof,
                            value: size,
                            unit,
                            parameter,
                            effect,
                            active_before: 0.0,
                            identified: size,
                            sigma: None,
                        });
                    }
                }
            }
            let errors = Errors::from_terms(&terms, [3.0, -4.0, -190.0]);
            let length = machine.tool.length_mm;
            let (nominal, seen) = (
                Seen::from_errors(&machine, &Errors::from_terms(&[], [0.0; 3]), length),
                Seen::from_errors(&machine, &errors, length),
            );
            let kins = Kins::new(&machine, errors, length);
            let none = BTreeMap::new();
            let mut pose = Position::default();
            for (i, axis) in machine.rotary().enumerate() {
                pose.set(axis.name, [37.0, -71.0][i]);
            }
            // a workpiece that stands off and is turned shows the same displacement at every pose
            for place in [Vector3::new(30.0, -20.0, -202.684), Vector3::new(-80.0, 55.0, -150.0)] {
                let off = |seen: &Seen| seen.ball_off((&nominal, &kins), &place, &pose, 0.0, &none).norm();
                assert!(off(&nominal) > 1e-2, "{name}");
                assert!(off(&seen) < 1e-11, "{name}: {:e}", off(&seen));
            }
        }
    }
}
