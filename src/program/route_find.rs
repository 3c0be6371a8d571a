//! The moves that find an artefact that was put down by eye, and what keeps later moves relative to it.

use super::find::shift_matrix;
use super::path::{Step, TouchStep};
use super::plan::Find;
use super::route::{Router, linear};
use super::scene::Scene;
use crate::axes::{AxisMap, Position};
use crate::diag::{Failure, Result};
use crate::machine::Carrier;

impl<'a, 'm> Router<'a, 'm> {
    /// The first moves, the touches that find the artefact, and back to where the first moves have led.
    pub(super) fn find(&mut self, unfound: &'a Scene<'m>, find: &Find) -> Result<()> {
        let found = std::mem::replace(&mut self.scene, unfound);
        let probe = &unfound.machine.probe;
        let mut pose = AxisMap::default();
        unfound.machine.rotary().for_each(|a| pose.set(a.name, 0.0));
        let refuse = |why: String| {
            Failure::new("program::find", format!("block {} cannot be found by touches: {why}", find.block))
                .help("a smaller placement_tolerance, or place it within the tolerance of the machine")
        };
        let room = probe.clearance + probe.placement_tolerance + probe.approach;
        self.heights = unfound.heights(&self.lift, &pose.position(), room);
        let turns = self.turns(None, &pose, &AxisMap::default()).map_err(refuse)?;
        for (place, touch) in find.touches.iter().enumerate() {
            let start = touch.start.or(&pose).position();
            if self.at.is_none() {
                self.begin(&pose, &turns, &start)?;
            }
            self.travel(&start).map_err(|why| refuse(format!("{}: {why}", touch.face)))?;
            let step = TouchStep {
                id: 0,
                says: format!("find block {}, {}", find.block, touch.face),
                start: touch.start,
                nominal: touch.nominal,
                end: touch.end,
                pose,
                first: true,
                tolerance_mm: probe.placement_tolerance,
                search_feed: probe.slow_feed,
                measure_feed: probe.slow_feed,
                back_off_mm: probe.back_off,
            };
            self.clock.touch(&step);
            self.push(Step::Find(step));
            self.push(Step::Retract { to: touch.start, feed: probe.position_feed });
            self.push(Step::Found { moves: touch.moves });
            if find.counts_after(place) {
                self.shift(&start)?;
            }
        }
        self.push(Step::FindEnd);
        self.rise(self.lift.top_height());
        self.scene = found;
        (self.heights.over_all, self.heights.over_blocks) = (self.lift.top_height(), self.lift.top_height());
        // the first set-up is the first visit, turned to or not
        (self.visit, self.stopped) = (0, true);
        self.shifted_at = Some(pose);
        Ok(())
    }

    fn shift(&mut self, at: &Position) -> Result<()> {
        let matrix = shift_matrix(self.scene.machine, self.carrier(), at).ok_or_else(|| {
            Failure::new("program::find", "the linear axes do not span space").help("look at the machine's file")
        })?;
        self.push(Step::Shift { matrix });
        Ok(())
    }

    /// What bears the artefact that is found.
    fn carrier(&self) -> Carrier {
        let block = self.layout.parts.first().and_then(|p| p.mounting.blocks.first());
        block.map_or(Carrier::Base, |b| b.carrier)
    }

    /// Moves are relative to what was found in this pose, from where the machine stands: all linear axes move by that.
    pub(super) fn shift_steps(&self, at: &Position) -> Option<[Step; 2]> {
        let matrix = shift_matrix(self.scene.machine, self.carrier(), at)?;
        Some([Step::Shift { matrix }, Step::Rapid { to: linear(at) }])
    }

    /// The same for the pose of a set-up, where it is another one than before.
    pub(super) fn shift_for(&mut self, pose: &AxisMap) {
        let Some(at) = self.at.filter(|_| self.shifted_at.is_some_and(|before| before != *pose)) else { return };
        if let Some(steps) = self.shift_steps(&at) {
            steps.into_iter().for_each(|step| self.push(step));
            self.shifted_at = Some(*pose);
        }
    }

    /// Touches that find are numbered behind those of the plan.
    pub(super) fn number_find_touches(&mut self) {
        let mut next = self.out.touches.len() as u64;
        for step in &mut self.out.path.steps {
            if let Step::Find(touch) = step {
                next += 1;
                touch.id = next;
            }
        }
    }
}
