//! What a control's coordinates mean: axis positions, or the place of the ball in the workpiece under the control's
//! own transformation. The one function pair is used when a program is written and when its log is read back.
//!
//! World coordinates of a transformation are taken as LinuxCNC's table kinematics define them: the place of the ball in
//! the frame of what bears the workpiece, less the ball's place in R with all axes at 0. While the rotary axes stand at
//! 0 they equal the axis positions of an errorless machine, so a program's origin is R's in both cases.

use crate::axes::Position;
use crate::machine::{Carrier, Machine, Side};
use crate::program::plan::{ControllerFrame, Plan};
use nalgebra::Vector3;

/// The meaning of a program's X, Y, Z. Rotary words mean axis positions in both frames. mm, deg.
#[derive(Debug, Clone, Copy)]
pub struct Frame<'a> {
    machine: &'a Machine,
    carrier: Carrier,
    length_mm: f64,
    kind: ControllerFrame,
}

impl<'a> Frame<'a> {
    /// The frame of a plan's program up to its first stop: a touch with another stylus has a frame of its own.
    #[must_use]
    pub fn of_plan(machine: &'a Machine, plan: &Plan) -> Self {
        Self::new(machine, plan.controller_frame, plan.tool_length_mm)
    }

    /// A frame for a stylus of this length (pivot to ball's centre, mm).
    #[must_use]
    pub fn new(machine: &'a Machine, kind: ControllerFrame, length_mm: f64) -> Self {
        // the workpiece is borne by the last axis of its side
        let carrier = machine.side(Side::Workpiece).last().map_or(Carrier::Base, |a| Carrier::Axis(a.name));
        Self { machine, carrier, length_mm, kind }
    }

    /// Length of the stylus for which it holds, mm.
    #[must_use]
    pub(super) fn length_mm(&self) -> f64 {
        self.length_mm
    }

    /// True when the program's X, Y, Z are the tool's place in the workpiece.
    #[must_use]
    pub fn is_tcp(&self) -> bool {
        self.kind == ControllerFrame::Tcp
    }

    /// Axis positions (relative to R) → the control's coordinates.
    #[must_use]
    pub fn controller_from_axes(&self, axes: &Position) -> Position {
        if !self.is_tcp() {
            return *axes;
        }
        let place = self.machine.ball_in(self.carrier, axes, self.length_mm) - self.ball_at_zero();
        axes.with_xyz_mm(place)
    }

    /// The control's coordinates → axis positions (relative to R) of an errorless machine.
    ///
    /// `None` when the machine's linear axes do not span space.
    #[must_use]
    pub fn axes_from_controller(&self, controller: &Position) -> Option<Position> {
        if !self.is_tcp() {
            return Some(*controller);
        }
        let ball = controller.xyz_mm() + self.ball_at_zero();
        self.machine.linear_for_ball(self.carrier, controller, &ball, self.length_mm)
    }

    fn ball_at_zero(&self) -> Vector3<f64> {
        self.machine.tool.ball_at_zero(self.length_mm)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::axes::{AxisMap, AxisName};
    use crate::diag::source;

    /// Forward function of LinuxCNC's xyzac-trt-kins (manual 9.3), tool length in the rot-point: joints → world.
    fn xyzac_trt(joints: &Position, z_rot_point: f64) -> [f64; 3] {
        let (sa, ca) = joints.mm_or_rad(AxisName::A).sin_cos();
        let (sc, cc) = joints.mm_or_rad(AxisName::C).sin_cos();
        let [x, y, z] = [joints.0[0], joints.0[1], joints.0[2] - z_rot_point];
        [cc * x + sc * ca * y + sc * sa * z, -sc * x + cc * ca * y + cc * sa * z, -sa * y + ca * z + z_rot_point]
    }

    /// The same of xyzbc-trt-kins.
    fn xyzbc_trt(joints: &Position, z_rot_point: f64) -> [f64; 3] {
        let (sb, cb) = joints.mm_or_rad(AxisName::B).sin_cos();
        let (sc, cc) = joints.mm_or_rad(AxisName::C).sin_cos();
        let [x, y, z] = [joints.0[0], joints.0[1], joints.0[2] - z_rot_point];
        [cc * cb * x + sc * y - cc * sb * z, -sc * cb * x + cc * y + sc * sb * z, sb * x + cb * z + z_rot_point]
    }

    fn at(pairs: &[(AxisName, f64)]) -> Position {
        pairs.iter().fold(AxisMap::default(), |map, (a, v)| map.with(*a, *v)).position()
    }

    #[test]
    fn world_coordinates_are_those_of_the_stock_kinematics() {
        let (machines, _) = crate::machine::load(&source("m", crate::machine::BUILT_IN)).unwrap();
        // the rotary axes pass through z = -250, the ball at zero stands at -202.684
        let z_rot_point = -250.0 + 202.684;
        for (name, tilt) in [("trunnion", AxisName::A), ("swivel-table-b", AxisName::B)] {
            let machine = machines.iter().find(|m| m.name == name).unwrap();
            let frame = Frame::new(machine, ControllerFrame::Tcp, machine.tool.length_mm);
            for (tilted, turned) in [(0.0, 0.0), (30.0, 0.0), (0.0, 90.0), (-45.0, 120.0), (90.0, -75.0)] {
                let axes = at(&[
                    (AxisName::X, 12.5),
                    (AxisName::Y, -33.0),
                    (AxisName::Z, 48.0),
                    (tilt, tilted),
                    (AxisName::C, turned),
                ]);
                let expected =
                    if tilt == AxisName::A { xyzac_trt(&axes, z_rot_point) } else { xyzbc_trt(&axes, z_rot_point) };
                let world = frame.controller_from_axes(&axes);
                for (found, wanted) in world.0.iter().zip(expected) {
                    assert!((found - wanted).abs() < 1e-10, "{name} {tilted} {turned}: {world:?} {expected:?}");
                }
                let back = frame.axes_from_controller(&world).unwrap();
                for (found, wanted) in back.0.iter().zip(axes.0) {
                    assert!((found - wanted).abs() < 1e-10);
                }
            }
        }
    }
}
