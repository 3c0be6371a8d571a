//! The proof of a finished path: walked step by step, knowing only the machine, the plan and the steps.
//!
//! It shares shapes and distances with the routing, and none of its choices: not its heights, not its order, not what it
//! believed to be clear. Every move is checked against limits and against collision over its whole length, every touch
//! against the plan, every turn for its sense.

mod find;

use super::find::{farthest_mm, with_reserve};
use super::path::{Path, Step, Stop, TouchStep};
use super::plan::{Plan, PlanTouch};
use super::scene::{ByEye, Scene};
use super::sweep::Manner;
use crate::axes::{AxisMap, AxisName, Position};
use crate::diag::{Failure, Result};
use crate::machine::{Axis, Machine};
use crate::units::Plain;
use nalgebra::Vector3;
use rayon::prelude::*;

/// Places that differ by less are the same, mm or deg.
const SAME: f64 = 1e-6;

/// What is wrong with a path.
#[derive(Debug, Clone, PartialEq)]
pub struct Violation {
    /// Place in [`Path::steps`], from 0.
    pub step: usize,
    /// What is wrong there.
    pub says: String,
}

/// Walks a path and reports everything in it that could break a probe or that the plan does not ask for.
///
/// # Errors
/// When the plan names a mounting that the machine lacks, or the machine's lengths cannot be computed with.
pub fn verify(machine: &Machine, plan: &Plan, path: &Path) -> Result<Vec<Violation>> {
    let first = (&plan.mounting, plan.tool_length_mm, plan.ball_radius_mm);
    let stops = path.steps.iter().filter_map(|s| match s {
        Step::Stop(stop) => Some((&stop.mounting, stop.tool_length_mm, stop.ball_radius_mm)),
        _ => None,
    });
    let inside = plan.find.as_ref().map(|find| with_reserve(machine, farthest_mm(find.tolerance_mm)));
    let machine = inside.as_ref().unwrap_or(machine);
    let by_eye =
        |found: bool| plan.find.as_ref().map(|find| ByEye { displacement_mm: farthest_mm(find.tolerance_mm), found });
    let parts: Vec<(&String, f64, f64)> = std::iter::once(first).chain(stops).collect();
    let machines = parts.iter().map(|(_, length_mm, radius_mm)| {
        machine.with_stylus_of(*length_mm, *radius_mm).ok_or_else(|| {
            let what = format!("a stylus of {} mm with a ball of radius {} mm", Plain(*length_mm), Plain(*radius_mm));
            not_this_machine("program::unknown_stylus", &what, machine)
        })
    });
    let machines: Vec<Machine> = machines.collect::<Result<_>>()?;
    let scenes = parts.iter().zip(&machines).map(|((name, ..), with_stylus)| {
        let mounting = machine
            .mounting(name)
            .ok_or_else(|| not_this_machine("program::unknown_mounting", &format!("mounting {name:?}"), machine))?;
        let scene = Scene::new(with_stylus, mounting)?.put_by_eye(by_eye(true));
        scene.blocks_clear_of_each_other().map(|()| scene)
    });
    let mut scenes: Vec<Scene> = scenes.collect::<Result<_>>()?;
    // the last one: before the artefact is found
    if let (Some(_), Some(first)) = (&plan.find, machines.first())
        && let Some(mounting) = machine.mounting(&plan.mounting)
    {
        scenes.push(Scene::new(first, mounting)?.put_by_eye(by_eye(false)));
    }
    let part = if plan.find.is_some() { scenes.len() - 1 } else { 0 };
    let Some(scene) = scenes.get(part) else { return Ok(Vec::new()) };
    let mut walk = Walk {
        scenes: &scenes,
        scene,
        part,
        mounted: &plan.mounting,
        part_began: 0,
        plan,
        at: AxisMap::default(),
        senses: AxisMap::default(),
        in_contact: None,
        at_start_of: None,
        next_touch: 0,
        find_touches: 0,
        found: false,
        setups: 0,
        moves: Vec::new(),
        violations: Vec::new(),
        start_near: path.start_near.as_ref(),
        opening: None,
        anywhere: None,
    };
    for (i, step) in path.steps.iter().enumerate() {
        walk.step(i, step);
    }
    if walk.in_contact.is_some() {
        walk.violation(path.steps.len().saturating_sub(1), "the path ends with the ball at a block".to_owned());
    }
    for touch in plan.touches.iter().skip(walk.next_touch) {
        let says = format!("touch {} of the plan is not made", touch.id);
        walk.violations.push(Violation { step: path.steps.len(), says });
    }
    let mut violations = walk.violations;
    // each by itself, in the order of the path whatever order the threads take
    let found: Vec<Option<Violation>> = walk.moves.par_iter().map(|m| m.check(scenes.get(m.part)?)).collect();
    violations.extend(found.into_iter().flatten());
    violations.sort_by_key(|v| v.step);
    Ok(violations)
}

fn not_this_machine(code: &'static str, what: &str, machine: &Machine) -> Failure {
    Failure::new(code, format!("the plan is for {what}, which {} lacks", machine.name))
        .help("plan and machine belong together: make the plan again")
}

/// A move whose ends are known.
struct Move {
    /// Place of its scene.
    part: usize,
    step: usize,
    from: Position,
    to: Position,
    how: How,
}

enum How {
    Straight(Manner),
    /// Several axes at rapid: each by its own speed, anywhere in the box that they span.
    Spanned,
    Turn(AxisName),
}

impl Move {
    fn check(&self, scene: &Scene) -> Option<Violation> {
        let proven = match &self.how {
            How::Straight(manner) => scene.clear_straight(&self.from, &self.to, *manner),
            How::Turn(axis) => scene.clear_turn(&self.from, *axis, self.to.get(*axis)),
            How::Spanned => scene.clear_box(&self.from, &self.to),
        };
        proven.err().map(|hit| Violation { step: self.step, says: hit.to_string() })
    }
}

struct Walk<'a, 'm> {
    /// Of each part.
    scenes: &'a [Scene<'m>],
    /// Of the part that is mounted.
    scene: &'a Scene<'m>,
    part: usize,
    /// Name of the blocks as they stand.
    mounted: &'a str,
    /// Touches that were made before the part began.
    part_began: usize,
    plan: &'a Plan,
    /// The axes whose place is known.
    at: AxisMap,
    senses: AxisMap,
    /// The start of the touch that was just made: the ball may still press.
    in_contact: Option<AxisMap>,
    /// Start of the touch at which the ball stands and from which it may search.
    at_start_of: Option<AxisMap>,
    next_touch: usize,
    /// Touches that find the artefact, made so far.
    find_touches: usize,
    /// The artefact is found.
    found: bool,
    /// That have begun.
    setups: u32,
    moves: Vec<Move>,
    violations: Vec<Violation>,
    start_near: Option<&'a super::path::StartNear>,
    /// Where the first set-up began, and the senses in which the rotary axes came there.
    opening: Option<(AxisMap, AxisMap)>,
    /// Whether moves from an unknown place are proven clear; computed when it is first asked for.
    anywhere: Option<bool>,
}

impl<'a> Walk<'a, '_> {
    fn violation(&mut self, step: usize, says: String) {
        self.violations.push(Violation { step, says });
    }

    fn prove(&mut self, step: usize, from: Position, to: Position, how: How) {
        self.moves.push(Move { part: self.part, step, from, to, how });
    }

    /// Stylus and blocks change: at the top, with all rotary axes at 0, and clear of what is mounted then.
    fn stop(&mut self, i: usize, stop: &'a Stop) {
        let Some(at) = self.known() else {
            self.violation(i, "the program stops before the place of every axis is known".to_owned());
            return;
        };
        let turned = self.scene.machine.rotary().any(|a| at.get(a.name).abs() > SAME);
        if turned || self.scene.lift().is_none_or(|lift| (at.get(lift.axis) - lift.top).abs() > SAME) {
            self.violation(i, "the program stops elsewhere than at the top with all rotary axes at 0".to_owned());
        }
        let Some(scene) = self.scenes.get(self.part + 1) else { return };
        (self.scene, self.part) = (scene, self.part + 1);
        (self.mounted, self.part_began) = (&stop.mounting, self.next_touch);
        self.at_start_of = None;
        self.prove(i, at, at, How::Straight(Manner::Rapid));
    }

    fn step(&mut self, i: usize, step: &'a Step) {
        let moves = !matches!(step, Step::Note(_) | Step::Setup { .. } | Step::Found { .. } | Step::Shift { .. });
        if moves && self.in_contact.is_some() && !matches!(step, Step::Retract { .. }) {
            self.violation(i, "the ball may still press against the block: a retract must come first".to_owned());
            self.in_contact = None;
        }
        match step {
            Step::Note(_) => {}
            Step::Stop(stop) => self.stop(i, stop),
            Step::OrientSpindle { .. } => self.at_start_of = None,
            Step::Setup { number, resume, .. } => self.setup(i, *number, resume.as_deref()),
            Step::Rapid { to } => self.linear(i, to, None),
            Step::Protected { to, feed } => self.linear(i, to, Some(*feed)),
            Step::Rotary { to, sense } => self.rotary(i, to, sense),
            Step::Touch(touch) => self.touch(i, touch),
            Step::Find(touch) => self.find(i, touch),
            Step::Found { .. } => {}
            Step::Shift { matrix } => self.shift(i, matrix),
            Step::FindEnd => self.found(i),
            Step::Retract { to, feed } => self.retract(i, to, *feed),
        }
    }

    /// Proves the way from the end of the opening to a set-up.
    fn setup(&mut self, i: usize, number: u32, resume: Option<&'a [Step]>) {
        self.setups += 1;
        if number != self.setups {
            self.violation(i, format!("set-up {} of the program has the number {number}", self.setups));
        }
        if self.in_contact.is_some() {
            self.violation(i, "a set-up begins while the ball may press against a block".to_owned());
        }
        if self.known().is_none() {
            self.violation(i, "a set-up begins before the place of every axis is known".to_owned());
            return;
        }
        let here = (self.at, self.senses);
        let opening = *self.opening.get_or_insert(here);
        let Some(resume) = resume else { return };
        (self.at, self.senses) = opening;
        for step in resume {
            match step {
                Step::Rapid { .. } | Step::Rotary { .. } | Step::Shift { .. } => self.step(i, step),
                _ => self
                    .violation(i, "the way to take the program up again holds more than rapids and turns".to_owned()),
            }
        }
        let there = (std::mem::replace(&mut self.at, here.0), std::mem::replace(&mut self.senses, here.1));
        if !near(&there.0.position(), &here.0.position()) || there.1 != here.1 {
            self.violation(i, "the way to take the program up again does not end where the set-up begins".to_owned());
        }
    }

    /// The full position, when every axis of the machine is known.
    fn known(&self) -> Option<Position> {
        let all = self.scene.machine.axes.iter().all(|a| self.at.get(a.name).is_some());
        all.then(|| self.at.position())
    }

    fn inside(&mut self, i: usize, to: &AxisMap) {
        for (name, value) in to.iter() {
            match self.scene.machine.axis(name).map(crate::machine::Axis::program_range) {
                None => self.violation(i, format!("the machine has no axis {name}")),
                Some([low, high]) if value >= low - SAME && value <= high + SAME => {}
                Some([low, high]) => {
                    let origin = self.scene.machine.origin.get(name).unwrap_or(0.0);
                    let says = format!(
                        "{name} = {:.3} is outside the range of the axis ({} to {})",
                        value + origin,
                        low + origin,
                        high + origin
                    );
                    self.violation(i, says);
                }
            }
        }
    }

    fn linear(&mut self, i: usize, to: &AxisMap, feed: Option<f64>) {
        self.inside(i, to);
        if to.iter().any(|(a, _)| a.is_rotary()) {
            self.violation(i, "a move of linear axes turns a rotary axis".to_owned());
        }
        if feed.is_some_and(|f| !(f > 0.0 && f <= self.scene.machine.probe.position_feed)) {
            self.violation(i, "a protected move is faster than the machine's position_feed".to_owned());
        }
        let before = self.known();
        match before {
            Some(from) => {
                let end = to.or(&self.at).position();
                let moving = to.iter().filter(|(a, v)| (v - from.get(*a)).abs() > SAME).count();
                let how = match feed {
                    Some(_) => How::Straight(Manner::Guarded),
                    None if moving > 1 => How::Spanned,
                    None => How::Straight(Manner::Rapid),
                };
                self.prove(i, from, end, how);
            }
            None => self.unknown_start(i, to, feed.is_some()),
        }
        self.at = to.or(&self.at);
        self.at_start_of = feed.and(Some(self.at));
    }

    /// A move while the place of some axis is not known: only up to the top, and then whatever is clear from anywhere.
    fn unknown_start(&mut self, i: usize, to: &AxisMap, protected: bool) {
        let Some(lift) = self.scene.lift() else { return };
        let at_top = self.at.get(lift.axis) == Some(lift.top);
        let only: Vec<(AxisName, f64)> = to.iter().collect();
        if protected || only.len() != 1 {
            self.violation(i, "from an unknown place one axis moves at a time".to_owned());
        } else if !at_top && only != [(lift.axis, lift.top)] {
            self.violation(i, format!("the first move must take {} to its top: its position is unknown", lift.axis));
        } else if at_top && !self.clear_anywhere() {
            self.violation(i, "the way from an unknown place is not proven clear".to_owned());
        }
    }

    fn clear_anywhere(&mut self) -> bool {
        if let Some(known) = self.anywhere {
            return known;
        }
        let Some(lift) = self.scene.lift() else { return false };
        // whatever is mounted when a run starts again at a later set-up
        let window = |a: &Axis| match self.start_near {
            Some(near) => near.window(a),
            None => a.range,
        };
        let clear = self.scenes.iter().all(|scene| scene.clear_from_anywhere(&lift, &window));
        self.anywhere = Some(clear);
        clear
    }

    fn rotary(&mut self, i: usize, to: &AxisMap, sense: &AxisMap) {
        self.inside(i, to);
        self.at_start_of = None;
        if to.iter().count() != 1 {
            self.violation(i, "rotary axes move one at a time".to_owned());
        }
        for (axis, target) in to.iter() {
            if !axis.is_rotary() {
                self.violation(i, format!("{axis} is no rotary axis"));
                continue;
            }
            match self.at.get(axis) {
                Some(angle) => {
                    let way = target - angle;
                    if sense.get(axis) != Some(way.signum()) || way.abs() < SAME {
                        let says =
                            format!("{axis} goes from {angle} to {target}, and its sense says {:?}", sense.get(axis));
                        self.violation(i, says);
                    }
                }
                None if sense.get(axis).is_some() => {
                    self.violation(i, format!("{axis} is to turn in a given sense from an unknown angle"));
                }
                None => {}
            }
            match self.known() {
                Some(from) => {
                    let mut end = from;
                    end.set(axis, target);
                    self.prove(i, from, end, How::Turn(axis));
                    self.prove(i, from, from, How::Straight(Manner::Rapid));
                }
                None => {
                    let lift = self.scene.lift();
                    if lift.is_none_or(|l| self.at.get(l.axis) != Some(l.top)) || !self.clear_anywhere() {
                        self.violation(i, format!("{axis} turns where it is not proven clear"));
                    }
                }
            }
            self.at.set(axis, target);
            if let Some(s) = sense.get(axis) {
                self.senses.set(axis, s);
            }
        }
    }

    fn touch(&mut self, i: usize, touch: &TouchStep) {
        let Some(planned) = self.plan.touches.get(self.next_touch) else {
            self.violation(i, format!("touch {} is not in the plan", touch.id));
            return;
        };
        self.next_touch += 1;
        if planned.id != touch.id {
            self.violation(i, format!("touch {} comes where the plan has touch {}", touch.id, planned.id));
        }
        let Some(at) = self.known() else {
            self.violation(i, format!("touch {} begins at an unknown place", touch.id));
            return;
        };
        for says in self.against_plan(&at, touch, planned) {
            self.violation(i, format!("touch {}: {says}", touch.id));
        }
        if self.at_start_of.is_none() {
            self.violation(i, format!("touch {}: the ball did not come to the start by a protected move", touch.id));
        }
        let block = self.scene_block(planned);
        match block {
            Some(b) => {
                let [nominal, end] = [touch.nominal, touch.end].map(|m| m.or(&touch.pose).position());
                self.prove(i, at, nominal, How::Straight(Manner::ToContact(b)));
                self.prove(i, nominal, end, How::Straight(Manner::PastContact(b)));
            }
            None => self.violation(i, format!("touch {}: the mounting has no block {:?}", touch.id, planned.block)),
        }
        self.inside(i, &touch.end);
        self.in_contact = Some(touch.start);
    }

    fn scene_block(&self, planned: &PlanTouch) -> Option<usize> {
        let mounting = self.scene.machine.mounting(self.mounted)?;
        mounting.blocks.iter().position(|b| b.name == planned.block)
    }

    /// What in a touch differs from the plan, from the errorless machine, or from what the probe can bear.
    fn against_plan(&self, at: &Position, touch: &TouchStep, planned: &PlanTouch) -> Vec<String> {
        let machine = self.scene.machine;
        let probe = &machine.probe;
        let mut says = Vec::new();
        let mut need = |good: bool, text: &str| {
            if !good {
                says.push(text.to_owned());
            }
        };
        need(near(at, &touch.start.or(&touch.pose).position()), "the ball does not stand at its start");
        let same = |a: &AxisMap, b: &AxisMap| near(&a.position(), &b.position());
        need(same(&touch.start, &planned.start), "its start is not the plan's");
        need(same(&touch.nominal, &planned.nominal), "its nominal place is not the plan's");
        need(same(&touch.end, &planned.end), "its end is not the plan's");
        need(same(&touch.pose, &planned.pose), "its pose is not the plan's");
        need(
            planned.from.iter().all(|(a, s)| self.senses.get(a) == Some(s)),
            "an axis came in another sense than planned",
        );
        need(
            planned.mounting.as_ref().unwrap_or(&self.plan.mounting) == self.mounted,
            "its mounting is not the one that is up",
        );
        let stylus = (planned.tool_length_mm, planned.ball_radius_mm);
        need(
            stylus.0.unwrap_or(self.plan.tool_length_mm) == machine.tool.length_mm
                && stylus.1.unwrap_or(self.plan.ball_radius_mm) == probe.ball_radius,
            "its stylus is not the one that is in the probe",
        );
        // the geometry from the carrier's frame, not from the plan's own numbers
        let carrier = machine.carrier(&planned.carrier);
        let normal = Vector3::from(planned.normal);
        let contact = Vector3::from(planned.point);
        let off_face = |m: &AxisMap| {
            let position = m.or(&touch.pose).position();
            let ball = carrier.map(|c| machine.ball_in(c, &position, machine.tool.length_mm)).unwrap_or_default();
            let from_contact = ball - contact;
            let along = from_contact.dot(&normal);
            (along - probe.ball_radius, (from_contact - normal * along).norm())
        };
        let [start, nominal, end] = [&touch.start, &touch.nominal, &touch.end].map(off_face);
        need([start, nominal, end].iter().all(|(_, aside)| *aside < SAME), "it does not run along the face's normal");
        need(nominal.0.abs() < SAME, "the nominal place does not touch the face");
        need(start.0 > probe.placement_tolerance + probe.clearance, "it begins too near to the face");
        need(-end.0 >= probe.placement_tolerance, "it ends before a block at the placement tolerance would be met");
        need(
            -end.0 + probe.placement_tolerance <= probe.overtravel + SAME,
            "it could push the probe past its overtravel",
        );
        need(touch.tolerance_mm <= probe.placement_tolerance + SAME, "its tolerance is wider than the probe's");
        need(touch.search_feed > 0.0 && touch.search_feed <= probe.fast_feed, "its search is faster than fast_feed");
        need(!touch.first || touch.search_feed <= probe.slow_feed, "the first touch of a block must search slowly");
        need(touch.measure_feed > 0.0 && touch.back_off_mm > 0.0, "its feeds and ways must be more than 0");
        need(touch.back_off_mm < start.0, "it backs off past its start");
        let of_part = self.plan.touches.iter().take(self.next_touch - 1).skip(self.part_began);
        let met = of_part.into_iter().any(|t| t.block == planned.block);
        need(met || touch.first, "it is the first touch of its block in this part and is not marked so");
        says
    }

    fn retract(&mut self, i: usize, to: &AxisMap, feed: f64) {
        match self.in_contact.take() {
            None => self.violation(i, "a retract without a touch before it".to_owned()),
            Some(start) => {
                let full = |m: &AxisMap| m.or(&self.at).position();
                if !near(&full(to), &full(&start)) {
                    self.violation(i, "the retract does not end at the touch's start".to_owned());
                }
                if !(feed > 0.0 && feed <= self.scene.machine.probe.position_feed) {
                    self.violation(i, "a retract is faster than the machine's position_feed".to_owned());
                }
            }
        }
        self.at = to.or(&self.at);
        self.at_start_of = Some(self.at);
    }
}

fn near(a: &Position, b: &Position) -> bool {
    a.0.iter().zip(b.0).all(|(x, y)| (x - y).abs() < SAME)
}
