//! What is wrong with a program: its runs, move by move, against the machine's limits, the shapes, and the plan.
//!
//! Shapes and the proof that a move is clear are those of [`crate::program`]; the order of moves, what a touch is and what
//! must happen when something goes wrong are judged here, from what the program did and not from how it was made.

mod faces;
mod proofs;

use super::branches::{branch_stops, last_line};
use super::checked_program::{CheckedProgram, CollectedFindings};
use super::doubt::Doubt;
use super::explore::ExploredRun;
use super::run::{Event, Happened, Rate};
use super::settings::settings_return;
use super::touches::{Made, against_plan};
use crate::axes::{AxisMap, AxisName, Position};
use crate::diag::Finding;
use crate::log;
use crate::program::heights::Lift;
use crate::program::plan::ControllerFrame;
use crate::program::scene::Scene;
use crate::program::sweep::Manner;
use crate::units::Plain;
use nalgebra::Vector3;
use proofs::{How, Key, Proof};
use rayon::prelude::*;
use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;

/// Judges runs one by one.
pub struct Judge<'a> {
    case: &'a CheckedProgram<'a>,
    said: CollectedFindings,
    /// Moves that are to be proven, and those that were.
    proofs: BTreeMap<Key, Proof>,
    proven: BTreeSet<Key>,
}

impl<'a> Judge<'a> {
    /// Nothing is judged yet.
    pub fn new(case: &'a CheckedProgram<'a>) -> Self {
        Self { case, said: CollectedFindings::default(), proofs: BTreeMap::new(), proven: BTreeSet::new() }
    }

    /// The whole program, or its run from a set-up.
    pub fn run(&mut self, told: &ExploredRun) {
        let (case, said) = (self.case, &mut self.said);
        let mut walk = Walk::new(case, told, said, &mut self.proofs);
        walk.trunk();
        let made = walk.made;
        against_plan(case, told, &made, said);
        let last_line = last_line(told);
        for branch in &told.branches {
            branch_stops(case, told, last_line, branch, said);
        }
        settings_return(case, told, said);
    }

    /// The dry run: its moves are clear, it meets nothing, logs nothing, comes to its end, and stops at any contact.
    pub fn dry(&mut self, told: &ExploredRun) {
        self.prove();
        let case = self.case;
        self.said.when = Some("in the dry run".to_owned());
        Walk::new(case, told, &mut self.said, &mut self.proofs).trunk();
        for happened in &told.trunk {
            let wrong = match &happened.event {
                Event::Log(_) | Event::LogOpen { .. } => "the program writes into the log",
                Event::Probe { probe, outcome, .. } if probe.toward && outcome.hit => "the ball meets a block",
                _ => continue,
            };
            self.said.say(case, "check::dry_run", &happened.at, wrong.to_owned(), "a larger height");
        }
        if told.fault.is_none() && stops_by_itself(told) {
            let end = told.trunk.last().map_or(0..0, |h| h.at.clone());
            self.said.say(case, "check::dry_run", &end, "the program does not come to its end".to_owned(), "");
        }
        self.prove();
        for branch in &told.branches {
            branch_stops(case, told, None, branch, &mut self.said);
        }
        settings_return(case, told, &mut self.said);
        self.said.when = None;
    }

    /// A run that finds the control in another state: only what it leaves to the user.
    pub fn other(&mut self, told: &ExploredRun) {
        settings_return(self.case, told, &mut self.said);
    }

    /// A run that takes the other way at a condition on an unknown value: its moves must be clear as well, and it must stop where
    /// something goes wrong. It may stop by itself.
    pub fn doubted(&mut self, told: &ExploredRun) {
        self.prove();
        let case = self.case;
        self.said.when = Some(when(case, told));
        Walk::new(case, told, &mut self.said, &mut self.proofs).trunk();
        self.prove();
        let last_line = last_line(told);
        for branch in &told.branches {
            branch_stops(case, told, last_line, branch, &mut self.said);
        }
        // where a stored value is said to be another one than it is, the program gives that other one back
        if told.otherwise.iter().all(|(_, doubt)| *doubt == Doubt::Outside) {
            settings_return(case, told, &mut self.said);
        }
        self.said.when = None;
    }

    /// Proves moves that have not been proven yet.
    fn prove(&mut self) {
        let all = std::mem::take(&mut self.proofs);
        let proofs: Vec<(Key, Proof)> = all.into_iter().filter(|(key, _)| self.proven.insert(*key)).collect();
        let hits: Vec<(Range<usize>, &'static str, String)> =
            proofs.par_iter().filter_map(|(_, proof)| proof.check(self.case)).collect();
        for (at, code, message) in hits {
            self.said.say(self.case, code, &at, message, "");
        }
    }

    /// What is wrong with the runs.
    pub fn finish(mut self) -> Vec<Finding> {
        self.prove();
        self.said.finish()
    }
}

fn when(case: &CheckedProgram<'_>, told: &ExploredRun) -> String {
    let line = |at: &Range<usize>| case.source.inner().get(..at.start).map_or(0, |text| text.matches('\n').count()) + 1;
    let each = |(at, doubt): &(Range<usize>, Doubt)| format!("line {} (it depends on {})", line(at), doubt.says());
    let conditions: Vec<String> = told.otherwise.iter().map(each).collect();
    if conditions.is_empty() {
        return "when the program is run a second time".to_owned();
    }
    format!("when the condition goes the other way in {}", conditions.join(" and in "))
}

// --------------------------------------------------------------------------------------------------------- trunk

/// The ball at a face.
struct Contact {
    /// Where the search began.
    start: Position,
    /// Unit direction of the search.
    along: Vector3<f64>,
    made: Made,
}

struct Walk<'a, 'b> {
    case: &'a CheckedProgram<'a>,
    told: &'b ExploredRun,
    said: &'b mut CollectedFindings,
    proofs: &'b mut BTreeMap<Key, Proof>,
    senses: AxisMap,
    spindle: Option<f64>,
    contact: Option<Contact>,
    /// The last motion stopped at contact if there had been any.
    came_guarded: bool,
    lift: Option<Lift>,
    made: Vec<Made>,
    waited: bool,
    /// How far the artefact may be off that is being found; `None`: it is found.
    finding_mm: Option<f64>,
    /// The event that is judged, by its place in the record.
    index: usize,
}

impl<'a, 'b> Walk<'a, 'b> {
    fn new(
        case: &'a CheckedProgram<'a>,
        told: &'b ExploredRun,
        said: &'b mut CollectedFindings,
        proofs: &'b mut BTreeMap<Key, Proof>,
    ) -> Self {
        let lift = case.scenes.first().and_then(Scene::lift);
        Self {
            case,
            told,
            said,
            proofs,
            senses: AxisMap::default(),
            spindle: None,
            contact: None,
            came_guarded: false,
            lift,
            made: Vec::new(),
            waited: false,
            finding_mm: case.plan.and_then(|p| p.find.as_ref()).map(|find| find.room_mm),
            index: 0,
        }
    }

    fn say(&mut self, code: &'static str, at: &Range<usize>, message: String, help: &str) {
        self.said.say(self.case, code, at, message, help);
    }

    fn prove(&mut self, at: &Range<usize>, part: usize, from: Position, to: Position, how: How) {
        let key = (part, from.0.map(f64::to_bits), to.0.map(f64::to_bits), how.number());
        self.proofs.entry(key).or_insert_with(|| Proof { at: at.clone(), part, from, to, how });
    }

    fn trunk(&mut self) {
        let told = self.told;
        for (event, (happened, part)) in told.trunk.iter().zip(&told.parts).enumerate() {
            self.index = event;
            self.event(happened, *part);
        }
        let end = told.trunk.last().map_or(0..0, |h| h.at.clone());
        if self.contact.is_some() {
            self.say("check::ends_in_contact", &end, "the program ends with the ball at a block".into(), "");
        }
        if let Some(fault) = &told.fault {
            self.say(
                "check::not_run",
                &fault.at,
                fault.says.clone(),
                "the control would stop here, or do something that axiscal does not know",
            );
        } else if self.said.when.is_none() && stops_by_itself(told) && !told.declines() {
            let texts = told.trunk.iter().rev().filter_map(|h| match &h.event {
                Event::Abort(text) | Event::Message(text) | Event::Wait(text) if !text.is_empty() => {
                    Some(text.as_str())
                }
                _ => None,
            });
            // the last message may only say where; the one before it says what
            let mut last: Vec<&str> = texts.take(2).collect();
            last.reverse();
            let shown = if last.is_empty() { "without a message".to_owned() } else { last.join(" / ") };
            let says = format!(
                "begun at set-up {}, the program stops by itself on a machine on which all is as it should be: {shown}",
                told.from
            );
            self.say("check::stops", &end, says, "");
        }
    }

    fn event(&mut self, happened: &Happened, part: usize) {
        let at = &happened.at;
        match &happened.event {
            Event::Move { from, to, rate, known, exact, named } => {
                let (from, to) = (self.case.world.axes(part, from), self.case.world.axes(part, to));
                if !exact {
                    self.say(
                        "check::rounded",
                        at,
                        "the control may round the corner between this move and the next".into(),
                        "exact stop (G61, G60) is missing",
                    );
                }
                self.moved(at, part, &from, &to, *rate, known, named);
            }
            Event::Probe { probe, outcome, latched } => {
                let (from, to) = (self.case.world.axes(part, &probe.from), self.case.world.axes(part, &probe.to));
                self.probe(at, part, probe, &from, &to, outcome.hit, outcome.part);
                if outcome.hit
                    && probe.toward
                    && let Some(contact) = &mut self.contact
                {
                    contact.made.latched = self.case.world.axes(part, latched);
                }
            }
            Event::Release { from, to } => {
                let (from, to) = (self.case.world.axes(part, from), self.case.world.axes(part, to));
                if let Some(contact) = self.contact.take() {
                    self.leave_face(at, part, contact, &from, &to, &[]);
                }
            }
            Event::Log(text) => {
                if log::says_found(text) {
                    self.finding_mm = None;
                }
                if let Some(mut contact) = self.contact.take() {
                    contact.made.log = Some(text.clone());
                    contact.made.at = at.clone();
                    contact.made.logged = Some(self.index);
                    contact.made.senses = self.senses;
                    contact.made.spindle_deg = self.spindle;
                    contact.made.waited = std::mem::take(&mut self.waited);
                    self.made.push(contact.made.clone());
                    self.contact = Some(contact);
                }
            }
            Event::Orient(deg) => self.spindle = Some(*deg),
            Event::Wait(_) => self.waited = true,
            _ => {}
        }
    }

    fn all_known(&self, known: &[bool; 6]) -> bool {
        self.case.machine.axes.iter().all(|a| known[a.name.index()])
    }

    fn inside(&mut self, at: &Range<usize>, to: &Position, named: &[bool; 6]) {
        for axis in &self.case.machine.axes {
            let [low, high] = axis.program_range();
            let value = to.get(axis.name);
            if named[axis.name.index()] && !(value >= low - self.case.same && value <= high + self.case.same) {
                let origin = self.case.machine.origin.get(axis.name).unwrap_or(0.0);
                let says = format!(
                    "{} = {:.3} is outside the range of the axis ({} to {}, machine coordinates)",
                    axis.name,
                    value + origin,
                    Plain(low + origin),
                    Plain(high + origin)
                );
                self.say("check::limit", at, says, "");
            }
        }
    }

    #[allow(clippy::too_many_arguments)] // the fields of one event
    fn moved(
        &mut self,
        at: &Range<usize>,
        part: usize,
        from: &Position,
        to: &Position,
        rate: Rate,
        known: &[bool; 6],
        named: &[bool; 6],
    ) {
        let mut moving: Vec<AxisName> = self.moving(from, to);
        for axis in AxisName::ALL.into_iter().filter(|a| named[a.index()] && !known[a.index()]) {
            if !moving.contains(&axis) {
                moving.push(axis);
            }
        }
        let mut bounded = [false; 6];
        moving.iter().for_each(|a| bounded[a.index()] = true);
        self.inside(at, to, &bounded);
        if moving.is_empty() {
            return;
        }
        self.came_guarded = false;
        if let Rate::Feed(feed) = rate
            && feed > self.case.machine.probe.position_feed + self.case.same
            && self.all_known(known)
        {
            let most = self.case.machine.probe.position_feed;
            self.say(
                "check::feed",
                at,
                format!("the feed is {} mm/min, the machine's position_feed is {}", Plain(feed), Plain(most)),
                "",
            );
        }
        let rotary: Vec<AxisName> = moving.iter().copied().filter(|a| a.is_rotary()).collect();
        if !self.all_known(known) {
            self.unknown_start(at, &moving, to, known);
            return;
        }
        if let Some(contact) = self.contact.take() {
            if rate == Rate::Rapid {
                let says = "a rapid leaves the face: nothing there has the clearance of a rapid".to_owned();
                self.say(
                    "check::in_contact",
                    at,
                    says,
                    "leave it by a move at a feed (G1) that stops at contact or is short",
                );
            }
            self.leave_face(at, part, contact, from, to, &rotary);
            return;
        }
        match rotary.as_slice() {
            [] => {
                let how = match rate {
                    Rate::Rapid if moving.len() > 1 => How::Spanned,
                    _ => How::Straight(Manner::Rapid),
                };
                self.prove(at, part, *from, *to, how);
            }
            [axis] if moving.len() == 1 => {
                self.senses.set(*axis, (to.get(*axis) - from.get(*axis)).signum());
                self.prove(at, part, *from, *from, How::Straight(Manner::Rapid));
                self.prove(at, part, *from, *to, How::Turn(*axis));
            }
            _ => self.say(
                "check::turn_and_move",
                at,
                "a rotary axis turns while another axis moves: the way is not proven clear".into(),
                "one rotary axis at a time",
            ),
        }
    }

    /// The axes that a move moves.
    fn moving(&self, from: &Position, to: &Position) -> Vec<AxisName> {
        // under a transformation the rounded angle of a turn moves the linear axes by its arc over the lift's height
        const TURNED_MM: f64 = 0.05;
        let tcp = self.case.plan.is_some_and(|p| p.controller_frame == ControllerFrame::Tcp);
        // under a transformation both ends are rounded in each of three words: 2 * 0.87 um at three decimals
        let same = if tcp { 2.0 } else { 1.0 } * self.case.same;
        let far = |a: &AxisName| (to.get(*a) - from.get(*a)).abs() > same;
        let turns = tcp && AxisName::ALL.iter().any(|a| a.is_rotary() && far(a));
        let moved = |a: &AxisName| far(a) && (!turns || a.is_rotary() || (to.get(*a) - from.get(*a)).abs() > TURNED_MM);
        AxisName::ALL.into_iter().filter(moved).collect()
    }

    /// The first moves, when nobody knows where the machine stands: up to the top, then whatever is clear from anywhere.
    fn unknown_start(&mut self, at: &Range<usize>, moving: &[AxisName], to: &Position, known: &[bool; 6]) {
        let Some(lift) = self.lift else { return };
        let at_top = known[lift.axis.index()] && (to.get(lift.axis) - lift.top).abs() <= self.case.same;
        let goes_up = moving == [lift.axis] && (to.get(lift.axis) - lift.top).abs() <= self.case.same;
        if moving.len() != 1 {
            self.say("check::unknown_start", at, "from an unknown place one axis moves at a time".into(), "");
        } else if !at_top && !goes_up {
            let says = format!(
                "the first move must take {} to its top ({} mm): its position is unknown",
                lift.axis,
                Plain(lift.top + self.case.machine.origin.get(lift.axis).unwrap_or(0.0))
            );
            self.say("check::unknown_start", at, says, "");
        } else if at_top && !goes_up && !self.case.clear_from_anywhere {
            self.say("check::unknown_start", at, "the way from an unknown place is not proven clear".into(), "");
        }
        // coming from an unknown angle, an axis has no known sense
        for axis in moving.iter().filter(|a| a.is_rotary()) {
            let mut senses = AxisMap::default();
            self.senses.iter().filter(|(a, _)| a != axis).for_each(|(a, s)| senses.set(a, s));
            if known[axis.index()] {
                continue;
            }
            self.senses = senses;
        }
        if let [axis] = moving
            && axis.is_rotary()
            && known[axis.index()]
        {
            self.turned_in_opening(*axis, to);
        }
    }

    fn turned_in_opening(&mut self, axis: AxisName, to: &Position) {
        // the run has the control's coordinates, `to` those of R
        let origin = self.case.machine.origin.get(axis).unwrap_or(0.0);
        let in_r = |at: &Position| at.get(axis) - origin;
        let before = self.told.trunk.iter().find_map(|h| match &h.event {
            Event::Move { from, to: end, .. } if in_r(end) == to.get(axis) && in_r(from) != in_r(end) => {
                Some(in_r(from))
            }
            _ => None,
        });
        if let Some(before) = before {
            self.senses.set(axis, (to.get(axis) - before).signum());
        }
    }
}

/// Does the whole program end in the middle, or with a stop before its log is closed?
fn stops_by_itself(told: &ExploredRun) -> bool {
    if !matches!(told.trunk.last(), Some(Happened { event: Event::End, .. })) {
        return true;
    }
    let acts = |h: &&Happened| matches!(h.event, Event::Move { .. } | Event::Probe { .. } | Event::Log(_));
    let waits = told.trunk.iter().rev().take_while(|h| !acts(h)).any(|h| matches!(h.event, Event::Wait(_)));
    let closed = told.trunk.iter().rev().find_map(|h| match &h.event {
        Event::Log(text) => Some(text.starts_with('E')),
        _ => None,
    });
    told.from == 1 && waits && closed != Some(true)
}
