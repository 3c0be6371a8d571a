//! What of a machine's frames depends on the pose of its rotary axes alone: touches of one pose mostly follow one another,
//! and share it.

use crate::axes::{AxisName, Position};
use crate::machine::{BallPlaces, Carrier, Machine};
use nalgebra::{UnitQuaternion, Vector3};

/// A carrier, and the angles of A, B and C to the bit.
type Pose = (Carrier, [u64; 3]);

/// The last pose that was asked for.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct LastPose {
    turned: Option<(Pose, Turned)>,
    /// With the tool's length.
    places: Option<(Pose, u64, BallPlaces)>,
}

/// How carrier and tool are turned in R.
#[derive(Debug, Clone, Copy)]
pub(super) struct Turned {
    /// From the carrier's frame to R.
    pub to_r: UnitQuaternion<f64>,
    /// From R to the tool's frame.
    pub into_tool: UnitQuaternion<f64>,
}

fn pose(carrier: Carrier, at: &Position) -> Pose {
    (carrier, [AxisName::A, AxisName::B, AxisName::C].map(|a| at.get(a).to_bits()))
}

impl LastPose {
    /// How carrier and tool of an errorless machine are turned with its axes there.
    pub fn turned(&mut self, machine: &Machine, carrier: Carrier, at: &Position) -> Turned {
        let pose = pose(carrier, at);
        match self.turned {
            Some((last, turned)) if last == pose => turned,
            _ => {
                let to_r = machine.carrier_frame(carrier, at).rotation;
                let turned = Turned { to_r, into_tool: machine.tool_frame(at).rotation.inverse() };
                self.turned = Some((pose, turned));
                turned
            }
        }
    }

    /// [`Machine::linear_for_ball`].
    pub fn linear_for_ball(
        &mut self,
        machine: &Machine,
        carrier: Carrier,
        at: &Position,
        ball: &Vector3<f64>,
        length_mm: f64,
    ) -> Option<Position> {
        let (pose, length) = (pose(carrier, at), length_mm.to_bits());
        let places = match self.places {
            Some((last, last_length, places)) if (last, last_length) == (pose, length) => places,
            _ => {
                let places = machine.ball_places(carrier, at, length_mm)?;
                self.places = Some((pose, length, places));
                places
            }
        };
        Some(at.with_xyz_mm(places.linear_for(ball)))
    }
}
