//! LinuxCNC's own kinematics of a tilting table that carries a turntable: `xyzac-trt-kins`, `xyzbc-trt-kins`.
//!
//! With P = (x, y, z)-rot-point and D = (x, y, z)-offset, `tool-offset` added to its z, the module moves the joints to
//!
//! ```text
//! j = P + D + Rt(T)·( Rz(C)·(w - P) - D )        T = A about X, or B about Y; machine coordinates, mm
//! ```
//!
//! for a tool centre point w in the workpiece (LinuxCNC manual, chapter on 5-axis kinematics). At T = C = 0 the two are
//! equal.

use super::Linear;
use crate::axes::{AxisName, Position};
use crate::simulate::chain::{Chain, Stylus};
use crate::simulate::rigid::{Rigid, Vec3, minus, plus, sin_cos_deg};
use crate::simulate::terms::Shifts;

/// One of the two modules with its pins.
#[derive(Debug, Clone)]
pub struct TiltingTable {
    /// A or B.
    pub tilting: AxisName,
    /// P, mm in machine coordinates.
    pub rot_point: Vec3,
    /// D without the tool, mm.
    pub offset: Vec3,
    /// `tool-offset` less the machine's own tool length, mm: what the pin says beyond the stylus that is clamped.
    pub tool_beyond_mm: f64,
    /// Machine coordinates of R's origin, mm.
    pub origin: Vec3,
    /// How far the work offset was moved when it was set again after loading, mm.
    pub workpiece_shift: Vec3,
}

impl TiltingTable {
    /// How the linear axes follow those of an errorless machine whose ball is where the program wants it.
    pub(super) fn linear(&self, nominal: &Chain, pose: &Position, stylus: Stylus) -> Linear {
        let none = Shifts::default();
        let meant = Linear::ball_in_workpiece(nominal, &none, pose, stylus);
        let at_zero = nominal.ball_in(&Position::default(), &none, nominal.links_to_workpiece(), stylus);
        let fixed = plus(minus(self.origin, at_zero), 1.0, self.workpiece_shift);
        Linear::of(|commanded| {
            let world = plus(meant.at(commanded), 1.0, fixed);
            minus(self.joints(world, pose, stylus), self.origin)
        })
    }

    /// The module's inverse function.
    fn joints(&self, world: Vec3, pose: &Position, stylus: Stylus) -> Vec3 {
        let along = if self.tilting == AxisName::A { [1.0, 0.0, 0.0] } else { [0.0, 1.0, 0.0] };
        let tilt = Rigid::turn(along, [0.0; 3], sin_cos_deg(pose.get(self.tilting)));
        let turn = Rigid::turn([0.0, 0.0, 1.0], [0.0; 3], sin_cos_deg(pose.get(AxisName::C)));
        let mut d = self.offset;
        d[2] += stylus.length_mm + self.tool_beyond_mm;
        let table = minus(turn.outward(minus(world, self.rot_point)), d);
        plus(plus(self.rot_point, 1.0, d), 1.0, tilt.outward(table))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The manual's expanded formula of xyzac-trt-kins.
    #[test]
    fn the_inverse_is_that_of_the_manual() {
        let module = TiltingTable {
            tilting: AxisName::A,
            rot_point: [1.0, 2.0, -250.0],
            offset: [0.0, 0.3, -0.7],
            tool_beyond_mm: 0.0,
            origin: [0.0; 3],
            workpiece_shift: [0.0; 3],
        };
        let pose = Position([0.0, 0.0, 0.0, 25.0, 0.0, -70.0]);
        let ((sa, ca), (sc, cc)) = (sin_cos_deg(25.0), sin_cos_deg(-70.0));
        let (dy, dz) = (0.3, -0.7 + 100.0);
        let w = [11.0, -22.0, 33.0];
        let [x, y, z] = minus(w, module.rot_point);
        let expected = [
            cc * x - sc * y + 1.0,
            sc * ca * x + cc * ca * y - sa * z - ca * dy + sa * dz + dy + 2.0,
            sc * sa * x + cc * sa * y + ca * z - sa * dy - ca * dz + dz - 250.0,
        ];
        let found = module.joints(w, &pose, Stylus { length_mm: 100.0, spindle_deg: 0.0 });
        for (a, b) in found.iter().zip(expected) {
            assert!((a - b).abs() < 1e-12);
        }
    }
}
