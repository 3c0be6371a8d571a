//! How high the probe must go: over everything in a pose, over the blocks only, and over everything at any angle.
//!
//! These are candidates: each move is proven by itself (`sweep`). Only [`Scene::clear_from_anywhere`] is a proof of its
//! own: of the first moves, when nobody knows yet where the machine stands.

use super::scene::{Part, Role, Scene, Solid};
use crate::axes::{AxisName, Position};
use crate::geometry::Transform;
use crate::machine::{Axis, Side};
use crate::units::{deg_from_rad, rad_from_deg};
use nalgebra::Vector3;

/// Step of the angles when a range is searched for its extremes, rad; what lies between is added as a margin.
const STEP_RAD: f64 = std::f64::consts::PI / 36.0;

/// The linear axis that lifts the probe off the work, and the sense in which it does.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Lift {
    /// Its letter.
    pub axis: AxisName,
    /// +1 when rising coordinates lift.
    pub sense: f64,
    /// Its coordinate at the far end of its range, mm.
    pub top: f64,
}

impl Lift {
    /// Height of a position, mm: more is farther off the work.
    #[must_use]
    pub fn height(&self, at: &Position) -> f64 {
        self.sense * at.get(self.axis)
    }

    /// The coordinate of a height, mm.
    #[must_use]
    pub fn coordinate(&self, height: f64) -> f64 {
        self.sense * height
    }

    /// The greatest height, mm.
    #[must_use]
    pub fn top_height(&self) -> f64 {
        self.sense * self.top
    }
}

/// Heights of a pose, mm; see [`Lift::height`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Heights {
    /// Everything of the probe passes over everything.
    pub over_all: f64,
    /// The ball passes over the blocks with what they stand on.
    pub over_blocks: f64,
}

impl Scene<'_> {
    /// The axis that lifts the probe: the linear axis that lies nearest to the spindle with all axes at 0.
    #[must_use]
    pub fn lift(&self) -> Option<Lift> {
        let along = |a: &Axis| a.direction.dot(&self.machine.tool.direction);
        let linear = self.machine.axes.iter().filter(|a| !a.name.is_rotary());
        let axis = linear.max_by(|a, b| along(a).abs().total_cmp(&along(b).abs()))?;
        let sense = if along(axis) < 0.0 { -1.0 } else { 1.0 };
        let [low, high] = axis.program_range();
        let top = if sense < 0.0 { low } else { high };
        Some(Lift { axis: axis.name, sense, top })
    }

    /// How the tool moves against a carrier when the lift rises by 1 mm, in R.
    fn rise(&self, lift: &Lift, pose: &Position, carrier: usize) -> Vector3<f64> {
        let mut raised = *pose;
        raised.set(lift.axis, pose.get(lift.axis) + lift.sense);
        let (a, b) = (self.place(pose), self.place(&raised));
        let shift = |before: &Transform, after: &Transform| after.translation.vector - before.translation.vector;
        let carrier = match (a.carriers.get(carrier), b.carriers.get(carrier)) {
            (Some(before), Some(after)) => shift(before, after),
            _ => Vector3::zeros(),
        };
        shift(&a.tool, &b.tool) - carrier
    }

    /// Heights of a pose (linear axes at 0) that leave `room` mm.
    #[must_use]
    pub fn heights(&self, lift: &Lift, pose: &Position, room: f64) -> Heights {
        let placed = self.place(pose);
        let mut heights = Heights { over_all: f64::MIN, over_blocks: f64::MIN };
        for obstacle in &self.obstacles {
            let rise = self.rise(lift, pose, obstacle.carrier);
            let Some(up) = rise.try_normalize(1e-9) else { continue };
            let Some(carrier) = placed.carriers.get(obstacle.carrier) else { continue };
            let highest = obstacle.solid.extent(carrier, &up);
            for (part, solid) in &self.parts {
                let lowest = -solid.extent(&placed.tool, &-up);
                let room = room + self.displacement_mm(obstacle.role, true);
                let height = (highest + room - lowest) / rise.norm();
                heights.over_all = heights.over_all.max(height);
                if *part == Part::Ball && obstacle.role != Role::Fixed {
                    heights.over_blocks = heights.over_blocks.max(height);
                }
            }
        }
        // up to the next tenth: nobody wants to read 11.300000000000011
        let tenth_up = |height: f64| if height > f64::MIN { (height * 10.0 - 1e-6).ceil() / 10.0 } else { height };
        heights.over_all = tenth_up(heights.over_all);
        heights.over_blocks = tenth_up(heights.over_blocks).min(heights.over_all);
        heights
    }

    /// True when with the lift at its top nothing can meet, wherever the other linear axes stand and whatever angles
    /// within these windows the rotary axes take; mm, deg. A bound, not a sample: extremes are searched in steps and
    /// what lies between the steps is added.
    #[must_use]
    pub fn clear_from_anywhere(&self, lift: &Lift, window: &dyn Fn(&Axis) -> [f64; 2]) -> bool {
        let Some(lift_axis) = self.machine.axis(lift.axis) else { return false };
        let carried_by_rotary =
            |axis: &Axis| self.machine.side(axis.side).take_while(|a| a.name != axis.name).any(|a| a.name.is_rotary());
        if carried_by_rotary(lift_axis) {
            return false; // its direction turns: "up" is not one direction
        }
        let mut at = Position::default();
        at.set(lift.axis, lift.top);
        // coordinates count the tool over the workpiece, whichever of the two moves
        let up = lift_axis.direction.into_inner() * lift.sense;
        // how far the other linear axes of a side can shift it along `up`
        let drift = |side: Side| -> f64 {
            let others = self.machine.side(side).filter(|a| !a.name.is_rotary() && a.name != lift.axis);
            others
                .map(|a| {
                    let reach = a.range[0].abs().max(a.range[1].abs());
                    if carried_by_rotary(a) { reach } else { reach * a.direction.dot(&up).abs() }
                })
                .sum()
        };
        let lowest = self
            .parts
            .iter()
            .map(|(_, solid)| {
                let chain: Vec<&Axis> = self.machine.side(Side::Tool).collect();
                let frame = |at: &Position| self.machine.tool_frame(at);
                -farthest(&chain, solid, &at, &frame, &-up, window)
            })
            .fold(f64::MAX, f64::min)
            - drift(Side::Tool);
        self.obstacles.iter().all(|obstacle| {
            let Some(carrier) = self.carriers.get(obstacle.carrier) else { return false };
            let chain = self.machine.carrier_chain(*carrier);
            // a solid that the lift does not leave behind is never passed over
            if lift_axis.side == Side::Workpiece && !chain.iter().any(|a| a.name == lift.axis) {
                return false;
            }
            let frame = |at: &Position| self.machine.carrier_frame(*carrier, at);
            let highest = farthest(&chain, &obstacle.solid, &at, &frame, &up, window) + drift(Side::Workpiece);
            let probe = &self.machine.probe;
            lowest - highest
                >= probe.clearance
                    + probe.placement_tolerance
                    + self.by_eye.map_or(0.0, |by_eye| by_eye.displacement_mm)
        })
    }
}

/// How far a solid reaches along a direction over all angles of its chain's rotary axes: an upper bound, mm.
fn farthest(
    chain: &[&Axis],
    solid: &Solid,
    at: &Position,
    frame: &dyn Fn(&Position) -> Transform,
    direction: &Vector3<f64>,
    window: &dyn Fn(&Axis) -> [f64; 2],
) -> f64 {
    let rotary: Vec<&Axis> = chain.iter().filter(|a| a.name.is_rotary()).copied().collect();
    // distance of any point of the solid from a point of each axis, from the innermost axis outwards: turning about an
    // inner axis does not change the distance from its own point
    let (mut centre, mut reach, mut margin) = (solid.centre(&Transform::identity()), solid.reach(), 0.0);
    let shifts: f64 = chain
        .iter()
        .skip_while(|a| !a.name.is_rotary())
        .filter(|a| !a.name.is_rotary())
        .map(|a| a.range[0].abs().max(a.range[1].abs()))
        .sum();
    reach += shifts;
    for axis in rotary.iter().rev() {
        reach += (centre - axis.point).norm();
        centre = axis.point;
        margin += reach * STEP_RAD / 2.0;
    }
    let mut poses = vec![*at];
    for axis in &rotary {
        let [low, high] = window(axis);
        // more than a turn repeats itself
        let span = rad_from_deg(high - low).clamp(0.0, std::f64::consts::TAU);
        let steps = (span / STEP_RAD).ceil().max(1.0);
        let n = steps as u32;
        poses = poses
            .iter()
            .flat_map(|p| {
                (0..=n).map(move |k| {
                    let mut p = *p;
                    p.set(axis.name, low + deg_from_rad(span) * f64::from(k) / steps);
                    p
                })
            })
            .collect();
    }
    poses.iter().map(|p| solid.extent(&frame(p), direction)).fold(f64::MIN, f64::max) + margin
}
