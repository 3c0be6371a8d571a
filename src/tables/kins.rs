//! World coordinates ↔ joints of a machine whose rotary axes have location errors.
//!
//! World coordinates are the axis positions of the **errorless** machine; joints are those of the real one that hold the
//! ball at the same place of the workpiece. Rotary joints are the world's rotaries less their zero errors; the linear ones
//! follow from three linear equations, because the ball's place in the workpiece is affine in X, Y, Z for every serial
//! chain. Exact in the errors, not of first order; with all errors zero the mapping is the identity to the last bit.
//!
//! What linear axes cannot do is turn the tool: an axis that is tilted stays tilted, only the ball's place is put right.
//! The kinematics component of `linuxcnc` does the same in C; a test holds the two together.

use super::compensation::Term;
use super::place::Place;
use crate::axes::{AxisName, Position};
use crate::geometry::{Displacement, Transform, apply};
use crate::machine::{Axis, Machine, Side};
use crate::units::{deg_from_rad, rad_from_deg};
use nalgebra::{Matrix3, Vector3};

/// Location errors of one rotary axis, mm and rad.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct AxisErrors {
    /// Before its rotation.
    pub before: Displacement,
    /// After its rotation.
    pub after: Displacement,
    /// Of its own angle, right-handed about its direction, rad.
    pub zero_rad: f64,
}

/// Location errors of a machine.
#[derive(Debug, Clone, PartialEq)]
pub struct Errors {
    /// By axis, as `AxisName::index` counts.
    axes: [AxisErrors; 6],
    /// Where `before` of workpiece-side axes is stated, mm in R.
    reference: Vector3<f64>,
}

impl Errors {
    /// From carried terms.
    #[must_use]
    pub fn from_terms(terms: &[Term], reference_mm: [f64; 3]) -> Self {
        let mut errors = Self { axes: [AxisErrors::default(); 6], reference: Vector3::from(reference_mm) };
        for term in terms {
            let amount = if term.dof.is_angle() { rad_from_deg(term.value) } else { term.value };
            let axis = &mut errors.axes[term.axis.index()];
            match term.place {
                Place::Before => axis.before.add(term.dof.index(), amount),
                Place::After => axis.after.add(term.dof.index(), amount),
                Place::Zero => axis.zero_rad += amount,
            }
        }
        errors
    }

    /// Those of one axis.
    #[must_use]
    pub fn of_axis(&self, axis: AxisName) -> &AxisErrors {
        &self.axes[axis.index()]
    }

    /// The point about which `before` of this axis is stated, mm in R.
    #[must_use]
    pub fn centre(&self, axis: &Axis) -> Vector3<f64> {
        match axis.side {
            Side::Workpiece => self.reference,
            Side::Tool => axis.point,
        }
    }
}

/// The ball's place in the workpiece at a pose of the rotary axes: `at_zero + columns · (X, Y, Z)`, mm.
#[derive(Debug, Clone, Copy)]
struct Affine {
    columns: Matrix3<f64>,
    at_zero: Vector3<f64>,
}

/// The mapping.
#[derive(Debug, Clone)]
pub struct Kins<'a> {
    machine: &'a Machine,
    errors: Errors,
    length_mm: f64,
}

impl<'a> Kins<'a> {
    /// For a tool of a length (pivot to ball's centre or tip, mm).
    #[must_use]
    pub fn new(machine: &'a Machine, errors: Errors, length_mm: f64) -> Self {
        Self { machine, errors, length_mm }
    }

    /// Frame of one side with the linear axes at 0, and the directions of the linear axes in it, in R.
    fn side(&self, side: Side, turned: &Position, real: bool, directions: &mut Matrix3<f64>) -> Transform {
        let mut frame = Transform::identity();
        for axis in self.machine.side(side) {
            if !axis.name.is_rotary() {
                // a table moves the other way, and its frame is inverted: the two signs cancel
                directions.set_column(axis.name.index(), &(frame.rotation * axis.direction.into_inner()));
                continue;
            }
            let errors = self.errors.of_axis(axis.name);
            if real {
                frame *= errors.before.transform_about(&self.errors.centre(axis));
            }
            frame *= axis.motion(turned);
            if real {
                frame *= errors.after.transform_about(&axis.point);
            }
        }
        frame
    }

    fn affine(&self, turned: &Position, real: bool) -> Affine {
        let mut directions = Matrix3::zeros();
        let work = self.side(Side::Workpiece, turned, real, &mut directions);
        let tool = self.side(Side::Tool, turned, real, &mut directions);
        let to_work = work.inverse();
        let ball = apply(&tool, &self.machine.tool.ball_at_zero(self.length_mm));
        Affine {
            columns: to_work.rotation.to_rotation_matrix().into_inner() * directions,
            at_zero: apply(&to_work, &ball),
        }
    }

    /// Degrees by which an axis is told less than it shall stand at.
    fn zero_deg(&self, axis: &Axis) -> f64 {
        deg_from_rad(axis.sense * self.errors.of_axis(axis.name).zero_rad)
    }

    /// `to.xyz` such that the ball stands where it stands at `from.xyz`; the same pose for both.
    fn linear(from: &Affine, to: &Affine, xyz: &Vector3<f64>) -> Option<Vector3<f64>> {
        // solved for the difference: it is small, so that rounding is too, and exactly zero without errors
        let gap = (from.columns - to.columns) * xyz + from.at_zero - to.at_zero;
        Some(xyz + to.columns.try_inverse()? * gap)
    }

    /// Joints that hold the ball where the errorless machine holds it at `world`. Positions relative to R, mm and deg.
    ///
    /// `None` when the linear axes do not span space (no checked machine is one).
    #[must_use]
    pub fn joints(&self, world: &Position) -> Option<Position> {
        let xyz = Self::linear(&self.affine(world, false), &self.affine(world, true), &world.xyz_mm())?;
        let mut joints = world.with_xyz_mm(xyz);
        for axis in self.machine.rotary() {
            joints.set(axis.name, world.get(axis.name) - self.zero_deg(axis));
        }
        Some(joints)
    }

    /// The inverse of [`Kins::joints`].
    #[must_use]
    pub fn world(&self, joints: &Position) -> Option<Position> {
        let mut world = *joints;
        for axis in self.machine.rotary() {
            world.set(axis.name, joints.get(axis.name) + self.zero_deg(axis));
        }
        let xyz = Self::linear(&self.affine(&world, true), &self.affine(&world, false), &joints.xyz_mm())?;
        Some(world.with_xyz_mm(xyz))
    }

    /// How far the ball stands off its place when the real machine is driven to `joints` and `world` was meant:
    /// in the workpiece's frame, mm.
    #[must_use]
    pub fn ball_error(&self, world: &Position, joints: &Position) -> Vector3<f64> {
        let mut stands = *joints;
        for axis in self.machine.rotary() {
            stands.set(axis.name, joints.get(axis.name) + self.zero_deg(axis));
        }
        let (real, meant) = (self.affine(&stands, true), self.affine(world, false));
        real.columns * joints.xyz_mm() + real.at_zero - meant.columns * world.xyz_mm() - meant.at_zero
    }
}

#[cfg(test)]
mod tests {
    use super::super::place::Dof;
    use super::*;
    use crate::diag::source;

    pub fn machine(name: &str) -> Machine {
        let (machines, _) = crate::machine::load(&source("m", crate::machine::BUILT_IN)).unwrap();
        machines.into_iter().find(|m| m.name == name).unwrap()
    }

    fn term(axis: AxisName, place: Place, dof: Dof, value: f64) -> Term {
        Term {
            axis,
            place,
            dof,
            value,
            unit: dof.unit().to_owned(),
            parameter: String::new(),
            effect: String::new(),
            active_before: 0.0,
            identified: value,
            sigma: None,
        }
    }

    fn at(values: [f64; 6]) -> Position {
        Position(values)
    }

    #[test]
    fn without_errors_it_is_the_identity_to_the_last_bit() {
        for name in ["swivel-head", "double-head", "trunnion", "swivel-table-b", "nutating-b", "trunnion-offset"] {
            let machine = machine(name);
            let kins = Kins::new(&machine, Errors::from_terms(&[], [0.1, 0.2, -250.3]), 202.684);
            let world = at([12.3, -45.6, 78.9, 33.0, -71.0, 123.0]);
            assert_eq!(kins.joints(&world), Some(world), "{name}");
            assert_eq!(kins.world(&world), Some(world), "{name}");
        }
    }

    /// dx of B before its rotation carries the ball off by dx at every B, so X is told dx less. By hand.
    #[test]
    fn an_offset_of_the_head_is_taken_off_the_axis() {
        let machine = machine("swivel-head");
        let errors = Errors::from_terms(&[term(AxisName::B, Place::Before, Dof::Dx, 0.03)], [0.0; 3]);
        let joints = Kins::new(&machine, errors, 202.684).joints(&at([1.0, 2.0, 3.0, 0.0, -37.0, 0.0])).unwrap();
        assert!((joints.get(AxisName::X) - 0.97).abs() < 1e-12);
        assert!((joints.get(AxisName::Y) - 2.0).abs() < 1e-12);
    }

    /// An offset after B's rotation turns with B: at B = -90 the tool-frame x of the head is R's z. By hand:
    /// Ry(-90)·(e, 0, 0) = (0, 0, e), so Z is told e less and X nothing.
    #[test]
    fn an_offset_after_the_rotation_turns_with_the_head() {
        let machine = machine("swivel-head");
        let errors = Errors::from_terms(&[term(AxisName::B, Place::After, Dof::Dx, 0.02)], [0.0; 3]);
        let joints = Kins::new(&machine, errors, 202.684).joints(&at([0.0, 0.0, 0.0, 0.0, -90.0, 0.0])).unwrap();
        assert!(joints.get(AxisName::X).abs() < 1e-12);
        assert!((joints.get(AxisName::Z) + 0.02).abs() < 1e-12);
    }

    /// The displacement check values of the paper's set 1 at B = -30: X, Y, Z are told exactly that much less.
    #[test]
    fn the_head_s_displacement_is_the_known_one() {
        let machine = machine("swivel-head");
        let set = [(Dof::Rx, 0.0150), (Dof::Ry, -0.0100), (Dof::Rz, 0.0200), (Dof::Dx, 0.0300), (Dof::Dy, 0.0250)];
        let terms: Vec<Term> = set.map(|(dof, v)| term(AxisName::B, Place::Before, dof, v)).to_vec();
        let kins = Kins::new(&machine, Errors::from_terms(&terms, [0.0; 3]), 202.684);
        let joints = kins.joints(&at([0.0, 0.0, 0.0, 0.0, -30.0, 0.0])).unwrap().xyz_mm();
        let known = Vector3::new(0.060_611_914, 0.106_339_234, 0.017_696_204);
        assert!((joints + known).amax() < 1e-9, "{joints}");
    }

    /// A zero error of 0.1° is taken off the angle that is told; nothing else moves.
    #[test]
    fn a_zero_error_is_taken_off_the_angle() {
        let machine = machine("trunnion");
        let errors = Errors::from_terms(&[term(AxisName::A, Place::Zero, Dof::Rx, 0.1)], [0.0, 0.0, -250.0]);
        let kins = Kins::new(&machine, errors, 202.684);
        let world = at([5.0, 6.0, 7.0, 20.0, 0.0, 40.0]);
        let joints = kins.joints(&world).unwrap();
        assert!((joints.get(AxisName::A) - 19.9).abs() < 1e-12);
        assert_eq!(joints.xyz_mm(), world.xyz_mm());
        assert!(kins.ball_error(&world, &joints).amax() < 1e-12);
        assert!((kins.world(&joints).unwrap().get(AxisName::A) - 20.0).abs() < 1e-12);
    }
}
