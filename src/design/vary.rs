//! A touch made another way: another pose, spindle, stylus, feed or face, with all axis positions anew.

use super::linearised_plan::{INDEX_S, TOUCH_S, times_s};
use crate::axes::{AxisMap, AxisName, Position};
use crate::machine::{Carrier, Machine};
use crate::program::plan::{Plan, PlanTouch};
use nalgebra::Vector3;

/// A face may look away from the spindle by so much (cosine) that the ball still meets it before the stem does.
const TURNED_AWAY: f64 = -0.05;

/// Touches of one face of one block that a variation repeats at most.
const MOST_PER_FACE: usize = 2;

/// Blocks that a variation touches at most.
const MOST_BLOCKS: usize = 2;

/// What is to be different.
#[derive(Debug, Clone, Default)]
pub struct Change {
    /// Angles of rotary axes, deg; those that are not given stay.
    pub pose: AxisMap,
    /// Sense in which rotary axes come to the pose.
    pub from: AxisMap,
    /// Orientation of the spindle, deg.
    pub spindle_deg: Option<f64>,
    /// Pivot to ball's centre, mm.
    pub length_mm: Option<f64>,
    /// Feed of the measuring touch, mm/min.
    pub feed_mm_min: Option<f64>,
    /// A disc or a star on the stylus meets a face that looks away from the spindle.
    pub star: bool,
}

/// Touches of one index visit.
#[derive(Debug, Clone)]
pub struct Visit<'a> {
    pub run: usize,
    pub touches: Vec<&'a PlanTouch>,
}

impl Visit<'_> {
    /// Angles of the rotary axes, deg.
    #[must_use]
    pub fn pose(&self) -> Position {
        self.touches.first().map_or_else(Position::default, |t| t.pose.position())
    }

    /// A light pattern: few touches of each face, few blocks.
    #[must_use]
    pub fn light(&self) -> Vec<PlanTouch> {
        let mut out: Vec<PlanTouch> = Vec::new();
        let mut blocks: Vec<&str> = Vec::new();
        for t in &self.touches {
            if !blocks.contains(&t.block.as_str()) {
                blocks.push(&t.block);
            }
            let is_early = blocks.iter().position(|b| *b == t.block).is_some_and(|i| i < MOST_BLOCKS);
            let of_face = |o: &&PlanTouch| o.block == t.block && o.normal == t.normal;
            let again = out.iter().any(|o| of_face(&o) && o.point == t.point);
            if is_early && !again && out.iter().filter(of_face).count() < MOST_PER_FACE {
                out.push((*t).clone());
            }
        }
        out
    }
}

/// The index visits of a plan, in order.
#[must_use]
pub fn visits(run: usize, plan: &Plan) -> Vec<Visit<'_>> {
    let mut out: Vec<Visit> = Vec::new();
    for t in &plan.touches {
        let same = out.last().and_then(|v| v.touches.last()).is_some_and(|p| {
            p.visit == t.visit
                && p.pose == t.pose
                && p.spindle_deg == t.spindle_deg
                && p.tool_length_mm == t.tool_length_mm
                && p.mounting == t.mounting
        });
        match out.last_mut() {
            Some(visit) if same => visit.touches.push(t),
            _ => out.push(Visit { run, touches: vec![t] }),
        }
    }
    out
}

/// The touch made another way; `None` where an axis does not go there or the face looks away from the spindle.
#[must_use]
pub fn again(machine: &Machine, plan: &Plan, touch: &PlanTouch, change: &Change) -> Option<PlanTouch> {
    let pose = change.pose.or(&touch.pose);
    let length_mm = change.length_mm.or(touch.tool_length_mm).unwrap_or(plan.tool_length_mm);
    let radius_mm = touch.ball_radius_mm.unwrap_or(plan.ball_radius_mm);
    let carrier = machine.carrier(&touch.carrier)?;
    let at = pose.position();
    if !change.star && !faces_the_spindle(machine, carrier, &at, &touch.normal.into()) {
        return None;
    }
    for (name, angle) in pose.iter() {
        let [low, high] = machine.axis(name)?.range;
        if !(low..=high).contains(&angle) {
            return None;
        }
    }
    let face = (touch.point.into(), touch.normal.into());
    let [start, nominal, end] = way_to_face(machine, carrier, &at, face, radius_mm, length_mm)?;
    Some(PlanTouch {
        pose,
        start,
        nominal,
        end,
        repeat: 1,
        from: change.from.or(&touch.from),
        spindle_deg: change.spindle_deg.or(touch.spindle_deg),
        tool_length_mm: change.length_mm.or(touch.tool_length_mm),
        feed_mm_min: change.feed_mm_min.or(touch.feed_mm_min),
        first: false,
        ..touch.clone()
    })
}

/// Linear axes at the start, the contact and the end of a touch of a face (a point and its outward normal, in the carrier's frame, mm);
/// `None` where one of them does not go there.
#[must_use]
pub fn way_to_face(
    machine: &Machine,
    carrier: Carrier,
    pose: &Position,
    (point, normal): (Vector3<f64>, Vector3<f64>),
    ball_radius_mm: f64,
    length_mm: f64,
) -> Option<[AxisMap; 3]> {
    let places = machine.ball_places(carrier, pose, length_mm)?;
    let at = [machine.probe.approach, 0.0, -machine.probe.search]
        .map(|off_face_mm| places.linear_for(&(point + normal * (ball_radius_mm + off_face_mm))));
    let inside = |xyz: &Vector3<f64>| {
        [AxisName::X, AxisName::Y, AxisName::Z].into_iter().zip(xyz.iter()).all(|(name, mm)| {
            machine.axis(name).is_none_or(|axis| {
                let [low, high] = axis.program_range();
                (low..=high).contains(mm)
            })
        })
    };
    at.iter().all(inside).then(|| at.map(|xyz| AxisMap::xyz(xyz.x, xyz.y, xyz.z)))
}

/// Can a straight stylus meet a face that looks along `normal` (carrier's frame)?
#[must_use]
pub fn faces_the_spindle(machine: &Machine, carrier: Carrier, at: &Position, normal: &Vector3<f64>) -> bool {
    let in_r = machine.carrier_frame(carrier, at).rotation * normal;
    let spindle = machine.tool_frame(at).rotation * machine.tool.direction.into_inner();
    in_r.dot(&spindle) > TURNED_AWAY
}

/// What visits cost, s.
#[must_use]
pub fn duration_s(visits: &[Vec<PlanTouch>]) -> f64 {
    visits.iter().filter(|v| !v.is_empty()).map(|v| INDEX_S + TOUCH_S * v.len() as f64).sum()
}

/// Adds visits at the end of a plan. Empty visits are passed over.
pub fn append(plan: &mut Plan, added: Vec<Vec<PlanTouch>>) {
    let mut clock_s = times_s(&plan.touches).last().copied().unwrap_or(0.0);
    let mut id = plan.touches.iter().map(|t| t.id).max().unwrap_or(0);
    let mut visit = plan.touches.iter().filter_map(|t| t.visit).max().unwrap_or(0);
    for touches in added.into_iter().filter(|t| !t.is_empty()) {
        clock_s += INDEX_S;
        visit += 1;
        for mut touch in touches {
            clock_s += TOUCH_S;
            id += 1;
            (touch.id, touch.visit, touch.time_s) = (id, Some(visit), Some(clock_s));
            plan.touches.push(touch);
        }
    }
}
