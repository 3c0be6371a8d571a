//! The exported kinematics component: its world coordinates are the axis positions of the errorless machine.
//!
//! For a commanded position the control finds the linear axes' positions at which the machine *with* the errors it
//! knows holds the ball where the errorless machine would hold it in the workpiece. Errors of a rotary axis's own angle
//! it takes off the angle, so that the axis stands where it was commanded.

use super::Linear;
use crate::axes::Position;
use crate::simulate::chain::{Chain, Stylus};
use crate::simulate::rigid::{minus, solve};
use crate::simulate::terms::Shifts;

/// A machine as the control knows it.
#[derive(Debug, Clone)]
pub struct Component {
    /// Its chain, with the reference point of the values.
    pub chain: Chain,
    /// Its errors.
    pub known: Shifts,
}

impl Component {
    /// How the linear axes follow the commanded ones at a pose.
    pub(super) fn linear(&self, nominal: &Chain, pose: &Position, stylus: Stylus) -> Result<Linear, &'static str> {
        let real = Linear::ball_in_workpiece(&self.chain, &self.known, pose, stylus);
        let meant = Linear::ball_in_workpiece(nominal, &Shifts::default(), pose, stylus);
        let joints = |place| {
            solve(real.columns, place).ok_or("the linear axes of the machine that the control knows do not span space")
        };
        let offset = joints(minus(meant.offset, real.offset))?;
        let columns = [joints(meant.columns[0])?, joints(meant.columns[1])?, joints(meant.columns[2])?];
        Ok(Linear { offset, columns })
    }
}
