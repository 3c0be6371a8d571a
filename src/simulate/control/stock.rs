//! LinuxCNC's own kinematics of a tilting table that carries a turntable: `xyzac-trt-kins`, `xyzbc-trt-kins`.
//!
//! With P = (x, y, z)-rot-point and D = (x, y, z)-offset, `tool-offset` added to its z, the module moves the joints to
//!
//! ```text
//! j = P + D + Rt(T)·( Rz(C)·(w - P) - D )        T = A about X, or B about Y; machine coordinates, mm
//! ```
//!
//! for a tool centre point w in the workpiece (LinuxCNC manual, chapter on 5-axis kinematics). Where the pin
//! conventional-directions is 1, both angles count the other way: T and C are replaced by -T and -C. At T = C = 0 the two are
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
    /// The direction pin is 1: positive angles turn the table left-handed.
    pub conventional: bool,
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
        Linear::linearise(|commanded| {
            let world = plus(meant.at(commanded), 1.0, fixed);
            minus(self.joints(world, pose, stylus), self.origin)
        })
    }

    /// The module's inverse function.
    fn joints(&self, world: Vec3, pose: &Position, stylus: Stylus) -> Vec3 {
        let along = if self.tilting == AxisName::A { [1.0, 0.0, 0.0] } else { [0.0, 1.0, 0.0] };
        let way = if self.conventional { -1.0 } else { 1.0 };
        let tilt = Rigid::turn(along, [0.0; 3], sin_cos_deg(way * pose.get(self.tilting)));
        let turn = Rigid::turn([0.0, 0.0, 1.0], [0.0; 3], sin_cos_deg(way * pose.get(AxisName::C)));
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
            conventional: false,
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

    /// Joints that somebody else expects of xyzbc-trt-kins with conventional directions (LinuxCNC issue 2435), all pins at 0.
    #[test]
    fn conventional_directions_are_those_of_the_table_of_others() {
        let table = include_str!("../../../tests/linuxcnc_kins/expected_xyzbc_trt.csv");
        let module = TiltingTable {
            tilting: AxisName::B,
            rot_point: [0.0; 3],
            offset: [0.0; 3],
            conventional: true,
            tool_beyond_mm: 0.0,
            origin: [0.0; 3],
            workpiece_shift: [0.0; 3],
        };
        let mut rows = 0;
        for line in table.lines().skip(1) {
            let v: Vec<f64> = line.split(',').map(|v| v.parse().unwrap()).collect();
            let pose = Position([0.0, 0.0, 0.0, 0.0, v[3], v[4]]);
            let found = module.joints([v[0], v[1], v[2]], &pose, Stylus { length_mm: 0.0, spindle_deg: 0.0 });
            assert!(found.iter().zip(&v[5..8]).all(|(a, b)| (a - b).abs() < 1e-12), "{line}: {found:?}");
            rows += 1;
        }
        assert_eq!(rows, 3);
    }
}
