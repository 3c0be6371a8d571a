//! From the points of a program to its path: touches with their places, and every move between them.
//!
//! Each move is proven when it is chosen; where there is no clear move the touch is left out with the reason. The whole
//! path is walked once more by `verify`, which shares nothing with the choices that are made here.

use super::clock::{Clock, distance_mm};
use super::heights::{Heights, Lift};
use super::layout::{Layout, Setup, Target};
use super::parts::where_it_differs;
use super::path::{Path, StartNear, Step, TouchStep};
use super::plan::{Find, PlanTouch, Skipped};
use super::reach::Reached;
use super::rotary_turns::{Turn, turn_step, turns};
use super::scene::Scene;
use super::spec::ProgramSpec;
use super::stops::mounted;
use super::sweep::Manner;
use crate::axes::{AxisMap, AxisName, Position};
use crate::diag::{Failure, Result};
use crate::machine::{Axis, Carrier};
use rayon::prelude::*;
use std::collections::BTreeSet;

/// A protected move is never shorter than this, mm: some controls refuse a probing move of a few tenths.
pub(super) const SHORTEST_PROTECTED_MM: f64 = 1.0;

/// Steps in which a height for turning is searched, mm.
const TURN_STEP_MM: f64 = 10.0;

/// Coordinates that differ by less are the same place, mm or deg.
pub(super) const SAME: f64 = 1e-9;

/// What the routing of a program gives.
#[derive(Debug, Default)]
pub(super) struct Routed {
    pub(super) touches: Vec<PlanTouch>,
    pub(super) skipped: Vec<Skipped>,
    pub(super) path: Path,
    /// Why the rotary axes do not stand at 0 at the end, where they should.
    pub(super) stays_turned: Option<String>,
}

/// Routes a program. `tcp`: it runs under the control's own transformation.
///
/// # Errors
/// When no program can begin on this machine: no axis lifts the probe, or not even near the first pose all is clear.
///
/// `finding`: the scene while the artefact is not found yet, where it was put down by eye, and the touches that find it.
pub(super) fn route<'m>(
    scenes: &[Scene<'m>],
    finding: Option<(&Scene<'m>, &Find)>,
    layout: &Layout,
    spec: &ProgramSpec,
    tcp: bool,
) -> Result<Routed> {
    let Some(scene) = scenes.first() else { return Ok(Routed::default()) };
    let Some(lift) = scene.lift() else {
        return Err(Failure::new("program::no_lift", format!("{} has no linear axis", scene.machine.name))
            .help("a probing program needs X, Y and Z"));
    };
    if scene.search_past_mm().is_none() {
        return Err(Failure::new(
            "program::overtravel",
            format!("the probe of {} leaves no room for a search", scene.machine.name),
        )
        .help(
            "a search goes past the nominal contact by more than placement_tolerance, and by both together the stylus may \
             be pushed: search and overtravel - placement_tolerance must be above placement_tolerance",
        ));
    }
    let mut router = Router {
        scenes,
        scene,
        part: 0,
        layout,
        lift,
        overshoot_deg: spec.overshoot_deg,
        out: Routed::default(),
        clock: Clock::default(),
        at: None,
        senses: AxisMap::default(),
        opening: None,
        entered: 0,
        visit: 0,
        stopped: false,
        met: BTreeSet::new(),
        heights: Heights { over_all: lift.top_height(), over_blocks: lift.top_height() },
        shifted_at: None,
    };
    if let Some((unfound, find)) = finding {
        router.find(unfound, find)?;
    }
    for setup in &layout.setups {
        router.setup(setup)?;
    }
    router.leave(tcp);
    router.number_find_touches();
    router.out.path.seconds = router.clock.rounded_s();
    router.out.path.waiting = router.clock.waiting;
    if router.part > 0 {
        router.out.path.mounted = layout.parts.first().map(mounted).unwrap_or_default();
    }
    Ok(router.out)
}

pub(super) struct Router<'a, 'm> {
    /// Of each part.
    pub(super) scenes: &'a [Scene<'m>],
    /// Of the part that is mounted.
    pub(super) scene: &'a Scene<'m>,
    pub(super) part: usize,
    pub(super) layout: &'a Layout<'a>,
    pub(super) lift: Lift,
    overshoot_deg: f64,
    pub(super) out: Routed,
    pub(super) clock: Clock,
    /// Where the machine stands; `None` until the first moves have brought it to a known place.
    pub(super) at: Option<Position>,
    /// Sense of each rotary axis's last move.
    pub(super) senses: AxisMap,
    /// Where the opening ended, and the senses in which the rotary axes came there.
    pub(super) opening: Option<(Position, AxisMap)>,
    /// Set-ups that the program has so far: one of which nothing can be reached is none of them.
    entered: u32,
    pub(super) visit: u32,
    /// The program has stopped since the last touch: what comes is another visit, turned or not.
    pub(super) stopped: bool,
    /// Blocks of the part that have been touched with its stylus.
    pub(super) met: BTreeSet<usize>,
    /// Of the pose in which the machine stands.
    pub(super) heights: Heights,
    /// The pose for which the moves are relative to what was found; `None`: nothing is to be found.
    pub(super) shifted_at: Option<AxisMap>,
}

impl Router<'_, '_> {
    fn setup(&mut self, setup: &Setup) -> Result<()> {
        let Some(scene) = self.scenes.get(setup.part) else { return Ok(()) };
        let probe = &scene.machine.probe;
        let room = probe.clearance + probe.placement_tolerance + probe.approach;
        let heights = scene.heights(&self.lift, &setup.at_pose(), room);
        let reached: Vec<_> = setup
            .targets
            .par_iter()
            .map(|t| {
                let carrier = self.layout.block(setup, t).map_or(Carrier::Base, |b| b.carrier);
                scene.reach(&self.lift, carrier, &setup.at_pose(), t, heights.over_all)
            })
            .collect();
        let Some(first) = reached.iter().find_map(|r| r.as_ref().ok()) else {
            for (target, reached) in setup.targets.iter().zip(reached) {
                self.skip(setup, target, reached.err().unwrap_or_default());
            }
            return Ok(());
        };
        let there = match self.change_part(setup.part) {
            Ok(()) => self.index(setup, heights, first)?,
            Err(reason) => Err(reason),
        };
        if let Err(reason) = there {
            for (target, reached) in setup.targets.iter().zip(reached) {
                self.skip(setup, target, reached.err().unwrap_or_else(|| reason.clone()));
            }
            return Ok(());
        }
        for (target, reached) in setup.targets.iter().zip(reached) {
            match reached.and_then(|r| self.travel(&r.start).map(|()| r)) {
                Ok(reached) => {
                    for repeat in 1..=setup.spec.repeats {
                        self.touch(setup, target, &reached, repeat);
                    }
                }
                Err(reason) => self.skip(setup, target, reason),
            }
        }
        Ok(())
    }

    fn skip(&mut self, setup: &Setup, target: &Target, reason: String) {
        self.out.skipped.push(Skipped {
            stage: setup.spec.stage.clone(),
            block: self.layout.block_name(setup, target).to_owned(),
            face: target.face.to_string(),
            point: target.point.into(),
            pose: setup.pose,
            reason,
        });
    }

    /// Brings the rotary axes to a pose. The inner error is the reason why this set-up cannot be reached.
    fn index(&mut self, setup: &Setup, heights: Heights, first: &Reached) -> Result<Result<(), String>> {
        let turns = match self.turns(self.at.map(|at| (at, self.senses)), &setup.pose, &setup.spec.from.value) {
            Ok(turns) => turns,
            Err(reason) => return Ok(Err(reason)),
        };
        let Some(at) = self.at else {
            self.begin(&setup.pose, &turns, &first.start)?;
            self.enter(setup);
            self.heights = heights;
            return Ok(Ok(()));
        };
        // both poses' heights, or as much more as the turns need
        let mut height = self.lift.height(&at).max(self.heights.over_all).max(heights.over_all);
        let top = self.lift.top_height();
        loop {
            let height_here = height.min(top);
            match self.clear_turns(&at, height_here, &turns, first) {
                Ok(()) => {
                    self.rise(height_here);
                    self.enter(setup);
                    for turn in &turns {
                        self.turn(turn);
                    }
                    self.shift_for(&setup.pose);
                    let stopped = std::mem::take(&mut self.stopped);
                    self.visit += u32::from(stopped || !turns.is_empty());
                    self.heights = heights;
                    return Ok(Ok(()));
                }
                Err(reason) if height >= top => {
                    return Ok(Err(format!("even at the top of {} {reason}", self.lift.axis)));
                }
                Err(_) => height += TURN_STEP_MM,
            }
        }
    }

    /// Proves the turns at a height, and the way on to the first column in the new pose.
    fn clear_turns(&self, at: &Position, height: f64, turns: &[Turn], first: &Reached) -> Result<(), String> {
        let mut here = *at;
        here.set(self.lift.axis, self.lift.coordinate(height));
        self.scene.clear_straight(at, &here, Manner::Guarded).map_err(|hit| format!("on the way up {hit}"))?;
        for (axis, to, _) in turns {
            self.scene.clear_turn(&here, *axis, *to).map_err(|hit| format!("as {axis} turns to {to} {hit}"))?;
            here.set(*axis, *to);
        }
        if self.shifted_at.is_some() {
            self.scene.clear_box(&here, &here).map_err(|hit| format!("beside the artefact {hit}"))?;
        }
        self.lateral(&here, &first.start).map(|_| ())
    }

    /// The first moves: nobody knows where the machine stands.
    pub(super) fn begin(&mut self, pose: &AxisMap, turns: &[Turn], start: &Position) -> Result<()> {
        let lift = self.lift;
        // whatever is mounted when a run starts again at a later set-up
        let all_clear = |window: &dyn Fn(&Axis) -> [f64; 2]| {
            self.scenes.iter().all(|scene| scene.clear_from_anywhere(&lift, window))
        };
        if !all_clear(&|a| a.range) {
            let near = StartNear { pose: *pose, within_deg: self.overshoot_deg };
            if !all_clear(&|a| near.window(a)) {
                return Err(Failure::new(
                    "program::no_start",
                    format!("{} at the top of its range does not lift the probe over everything", lift.axis),
                )
                .help(
                    "a longer range, a lower artefact or a shorter stylus: the first moves must be clear wherever the \
                       machine stands",
                ));
            }
            self.out.path.start_near = Some(near);
        }
        // half of its range, for want of a place to count from
        let half = |a: AxisName| self.scene.machine.axis(a).map_or(0.0, |a| (a.range[1] - a.range[0]) / 2.0);
        self.clock.rapid(half(lift.axis));
        self.push(Step::Rapid { to: AxisMap::default().with(lift.axis, lift.top) });
        for turn in turns {
            self.clock.rotary(half(turn.0));
            self.turn(turn);
        }
        self.visit += 1;
        let mut at = *start;
        at.set(lift.axis, lift.top);
        for axis in self.across() {
            self.clock.rapid(half(axis));
            self.push(Step::Rapid { to: AxisMap::default().with(axis, at.get(axis)) });
        }
        self.at = Some(at);
        self.opening = Some((at, self.senses));
        Ok(())
    }

    /// The set-up begins here: how to come here from the end of the opening, and the spindle in its place.
    fn enter(&mut self, setup: &Setup) {
        // without a gap: begun at a number that is left out, a program would enter the next set-up without a way there
        self.entered += 1;
        let pose: Vec<String> = setup.pose.iter().map(|(a, v)| format!("{a} {v}")).collect();
        let says = format!("{}, {}", setup.spec.stage, pose.join(" "));
        let resume = self.resume();
        self.push(Step::Setup { number: self.entered, says, resume });
        // in every set-up, that it also holds where the program is taken up again
        let deg = setup.spec.spindle_deg.unwrap_or(0.0);
        self.push(Step::OrientSpindle { deg });
    }

    pub(super) fn turns(
        &self,
        from: Option<(Position, AxisMap)>,
        pose: &AxisMap,
        wanted: &AxisMap,
    ) -> Result<Vec<Turn>, String> {
        turns(self.scene.machine, self.overshoot_deg, from, pose, wanted)
    }

    pub(super) fn turn(&mut self, (axis, to, sense): &Turn) {
        if let Some(sense) = sense {
            self.senses.set(*axis, *sense);
        }
        if let Some(at) = &mut self.at {
            self.clock.rotary((to - at.get(*axis)).abs());
            at.set(*axis, *to);
        }
        self.push(turn_step(*axis, *to, *sense));
    }

    /// The linear axes other than the lift.
    pub(super) fn across(&self) -> impl Iterator<Item = AxisName> + use<> {
        let lift = self.lift.axis;
        [AxisName::X, AxisName::Y, AxisName::Z].into_iter().filter(move |a| *a != lift)
    }

    /// Rapids across at the height of `from`, one axis at a time: the order in which they are clear.
    pub(super) fn lateral(&self, from: &Position, to: &Position) -> Result<Vec<AxisName>, String> {
        let forth: Vec<AxisName> = self.across().filter(|a| (to.get(*a) - from.get(*a)).abs() > SAME).collect();
        let back: Vec<AxisName> = forth.iter().rev().copied().collect();
        let try_order = |order: &[AxisName]| {
            let mut here = *from;
            for axis in order {
                let mut next = here;
                next.set(*axis, to.get(*axis));
                self.scene.inside_limits(&next)?;
                self.scene.clear_straight(&here, &next, Manner::Rapid).map_err(|hit| hit.to_string())?;
                here = next;
            }
            Ok(())
        };
        try_order(&forth).map(|()| forth).or_else(|reason: String| try_order(&back).map(|()| back).map_err(|_| reason))
    }

    /// From where the ball stands over to a touch's start: up, across, down.
    pub(super) fn travel(&mut self, start: &Position) -> Result<(), String> {
        let Some(at) = self.at else { return Err("the machine does not stand at a known place".to_owned()) };
        if at == *start {
            return Ok(());
        }
        let lift = self.lift;
        let here = lift.height(&at);
        let least = here.max(lift.height(start)) + SHORTEST_PROTECTED_MM;
        // low over the blocks where that is clear, over everything where it is not; from high up straight across
        let candidates = if here >= self.heights.over_all {
            [here, here]
        } else {
            [least.max(self.heights.over_blocks), least.max(self.heights.over_all)]
        };
        let mut reason = String::new();
        for height in candidates {
            match self.over(&at, start, height) {
                Ok((above_here, order, above_start)) => {
                    if height > here {
                        self.protected(&above_here);
                    }
                    for axis in order {
                        self.rapid(axis, start.get(axis));
                    }
                    // no closer than everything allows at rapid, the rest protected
                    let low = self.heights.over_all.max(lift.height(start) + SHORTEST_PROTECTED_MM);
                    if lift.height(&above_start) > low + SAME {
                        self.rapid(lift.axis, lift.coordinate(low));
                    }
                    self.protected(start);
                    return Ok(());
                }
                Err(e) => reason = e,
            }
        }
        Err(format!("no clear way there: {reason}"))
    }

    /// Proves up, across and down through a height.
    fn over(
        &self,
        at: &Position,
        start: &Position,
        height: f64,
    ) -> Result<(Position, Vec<AxisName>, Position), String> {
        let [mut above_here, mut above_start] = [*at, *start];
        for above in [&mut above_here, &mut above_start] {
            above.set(self.lift.axis, self.lift.coordinate(height));
            self.scene.inside_limits(above)?;
        }
        self.scene.clear_straight(at, &above_here, Manner::Guarded).map_err(|hit| hit.to_string())?;
        let order = self.lateral(&above_here, &above_start)?;
        self.scene.clear_straight(&above_start, start, Manner::Guarded).map_err(|hit| hit.to_string())?;
        Ok((above_here, order, above_start))
    }

    /// Up to a height where the ball stands: protected until it is over everything, at rapid from there on.
    pub(super) fn rise(&mut self, height: f64) {
        let Some(mut to) = self.at else { return };
        let here = self.lift.height(&to);
        let guarded = height.min(self.heights.over_all.max(here + SHORTEST_PROTECTED_MM));
        if guarded > here + SAME && here < self.heights.over_all - SAME {
            to.set(self.lift.axis, self.lift.coordinate(guarded));
            self.protected(&to);
        }
        if height > self.lift.height(&to) + SAME {
            self.rapid(self.lift.axis, self.lift.coordinate(height));
        }
    }

    fn protected(&mut self, to: &Position) {
        let Some(at) = self.at else { return };
        let feed = self.scene.machine.probe.position_feed;
        let (from, to_map) = (linear(&at), linear(to));
        self.clock.feed(distance_mm(&from, &to_map), feed);
        let mut moved = AxisMap::default();
        for (axis, value) in to_map.iter().filter(|(a, v)| (v - at.get(*a)).abs() > SAME) {
            moved.set(axis, value);
        }
        self.push(Step::Protected { to: moved, feed });
        self.at = Some(*to);
    }

    pub(super) fn rapid(&mut self, axis: AxisName, to: f64) {
        if let Some(at) = &mut self.at {
            self.clock.rapid((to - at.get(axis)).abs());
            at.set(axis, to);
        }
        self.push(Step::Rapid { to: AxisMap::default().with(axis, to) });
    }

    fn touch(&mut self, setup: &Setup, target: &Target, reached: &Reached, repeat: u32) {
        let machine = self.scene.machine;
        let probe = &machine.probe;
        let Some(((part, one), planned)) =
            self.layout.parts.get(setup.part).zip(self.layout.parts.first()).zip(self.layout.block(setup, target))
        else {
            return;
        };
        let id = self.out.touches.len() as u64 + 1;
        let block = planned.name.clone();
        let first = self.met.insert(target.block);
        let measure_feed = setup.spec.feed_mm_min.unwrap_or(probe.slow_feed);
        let step = TouchStep {
            id,
            says: format!("block {block} face {}", target.face),
            start: linear(&reached.start),
            nominal: linear(&reached.nominal),
            end: linear(&reached.end),
            pose: setup.pose,
            first,
            tolerance_mm: probe.placement_tolerance,
            // an unknown block is met slowly: nobody can say yet where it stands
            search_feed: if first { probe.slow_feed } else { probe.fast_feed },
            measure_feed,
            back_off_mm: probe.back_off,
        };
        self.clock.touch(&step);
        self.out.touches.push(PlanTouch {
            id,
            stage: setup.spec.stage.as_str().into(),
            repeat,
            carrier: planned.carrier.to_string(),
            mounting: (part.label != one.label).then(|| part.label.clone()),
            block,
            face: target.face.to_string(),
            point: target.point.into(),
            normal: target.normal.into(),
            pose: setup.pose,
            start: step.start,
            nominal: step.nominal,
            end: step.end,
            time_s: Some(self.clock.rounded_s()),
            visit: Some(self.visit),
            feed_mm_min: Some(measure_feed),
            spindle_deg: setup.spec.spindle_deg,
            tool_length_mm: where_it_differs(machine.tool.length_mm, one.machine.tool.length_mm),
            ball_radius_mm: where_it_differs(probe.ball_radius, one.machine.probe.ball_radius),
            from: self.senses,
            first,
        });
        let to = step.start;
        self.clock.feed(distance_mm(&step.nominal, &to), probe.position_feed);
        self.push(Step::Touch(step));
        self.push(Step::Retract { to, feed: probe.position_feed });
    }

    pub(super) fn push(&mut self, step: Step) {
        self.out.path.steps.push(step);
    }
}

/// The linear axes of a position.
pub(super) fn linear(at: &Position) -> AxisMap {
    let p = at.xyz_mm();
    AxisMap::xyz(p.x, p.y, p.z)
}
