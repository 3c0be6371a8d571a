//! A control whose transformation knows the rotary axes by vectors and directions, and applies them literally.
//!
//! With the vectors as Siemens names them (head: `l1`, `l2`, `l3` from the tool to the machine; table: likewise outwards)
//!
//! ```text
//! head:   adapter - tip  =  l1 + R1·(l2 + R2·(l3 + tool))          tool = adapter - tip at zero
//! table:  place of the workpiece in machine coordinates  =  l2 + R1·(l3 + R2·(l4 + place))
//! ```
//!
//! and the machine coordinates are those at which the tip stands at that place. Vectors that do not close (l1 = -(l2 + l3),
//! l4 = -(l2 + l3)) shift everything, as they would on the machine.

use super::Linear;
use crate::axes::{AxisName, Position};
use crate::simulate::chain::{Chain, Stylus};
use crate::simulate::rigid::{Rigid, Vec3, minus, plus, sin_cos_deg};
use crate::simulate::terms::Shifts;

/// A turn, and what stands inside it.
#[derive(Debug, Clone, PartialEq)]
pub struct Joint {
    /// Whose angle.
    pub axis: AxisName,
    /// About which a positive angle turns what the axis carries, unit.
    pub direction: Vec3,
    /// Added inside the turn, mm.
    pub inside: Vec3,
}

/// Vectors of one side: added first of all, then turn by turn from the base on.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Side {
    /// Outside of all turns, mm.
    pub outside: Vec3,
    /// From the base on.
    pub joints: Vec<Joint>,
}

impl Side {
    fn place(&self, at: Vec3, pose: &Position) -> Vec3 {
        let inner = self.joints.iter().rev().fold(at, |p, joint| {
            let turn = Rigid::turn(joint.direction, [0.0; 3], sin_cos_deg(pose.get(joint.axis)));
            turn.outward(plus(p, 1.0, joint.inside))
        });
        plus(inner, 1.0, self.outside)
    }
}

/// The control's transformation.
#[derive(Debug, Clone, PartialEq)]
pub struct Vectors {
    pub head: Side,
    /// The table, in machine coordinates.
    pub table: Side,
    /// Machine coordinates of R's origin, mm.
    pub origin: Vec3,
    /// The adapter in R at zero, mm.
    pub adapter: Vec3,
}

impl Vectors {
    /// How the linear axes follow those of an errorless machine whose ball is where the program wants it.
    pub(super) fn linear(&self, nominal: &Chain, pose: &Position, stylus: Stylus) -> Linear {
        let meant = Linear::ball_in_workpiece(nominal, &Shifts::default(), pose, stylus);
        let tool = nominal.tool_direction().map(|d| d * stylus.length_mm);
        let arm = self.head.place(tool, pose);
        Linear::linearise(|commanded| {
            let place = plus(minus(meant.at(commanded), self.adapter), 1.0, self.origin);
            minus(plus(self.table.place(place, pose), 1.0, arm), self.origin)
        })
    }
}
