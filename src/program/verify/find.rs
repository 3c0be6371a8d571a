//! The touches that find an artefact that was put down by eye, and what its moves are relative to.

use super::{How, Walk, near};
use crate::program::find::shift_matrix;
use crate::program::path::TouchStep;
use crate::program::sweep::Manner;
use nalgebra::Matrix3;

impl<'a> Walk<'a, '_> {
    /// The first block of the mounting is the one that is found.
    pub(super) fn find(&mut self, i: usize, touch: &'a TouchStep) {
        let planned = self.plan.find.as_ref().and_then(|find| find.touches.get(self.find_touches));
        self.find_touches += 1;
        let (Some(planned), Some(at)) = (planned, self.known()) else {
            self.violation(
                i,
                "a touch that finds the artefact is not in the plan, or begins at an unknown place".into(),
            );
            return;
        };
        let [start, nominal, end] = [touch.start, touch.nominal, touch.end].map(|m| m.or(&touch.pose).position());
        let same = [(&planned.start, &touch.start), (&planned.nominal, &touch.nominal), (&planned.end, &touch.end)];
        let same = same.iter().all(|(a, b)| near(&a.position(), &b.position()));
        let turned = touch.pose.iter().any(|(_, angle)| angle != 0.0);
        if !same || turned || !near(&at, &start) || self.at_start_of.is_none() {
            self.violation(i, format!("{}: it is not the plan's, or the ball did not come to its start", touch.says));
        }
        let probe = &self.scene.machine.probe;
        let slow = touch.search_feed > 0.0 && touch.search_feed <= probe.slow_feed;
        if !(slow && touch.measure_feed > 0.0 && touch.back_off_mm > 0.0) {
            self.violation(i, format!("{}: it must search slowly", touch.says));
        }
        self.prove(i, at, nominal, How::Straight(Manner::ToContact(0)));
        self.prove(i, nominal, end, How::Straight(Manner::PastArtefact(0)));
        self.inside(i, &touch.end);
        self.in_contact = Some(touch.start);
    }

    /// Another matrix would bring the ball elsewhere than beside the artefact; what moves by it must be clear.
    pub(super) fn shift(&mut self, i: usize, matrix: &Matrix3<f64>) {
        let Some(at) = self.known() else {
            self.violation(i, "moves become relative to the artefact at an unknown place".to_owned());
            return;
        };
        let block = self.scene.machine.mounting(self.mounted).and_then(|m| m.blocks.first());
        let wanted = block.and_then(|b| shift_matrix(self.scene.machine, b.carrier, &at));
        if wanted.is_none_or(|wanted| (wanted - matrix).norm() > 1e-9) {
            self.violation(i, "moves are not made relative to where the artefact is in this pose".to_owned());
        }
        if self.found {
            self.prove(i, at, at, How::Spanned);
        }
    }

    /// From here on the artefact is found.
    pub(super) fn found(&mut self, i: usize) {
        if self.plan.find.as_ref().is_none_or(|find| find.touches.len() != self.find_touches) {
            self.violation(i, "the artefact is taken as found before all its touches are made".to_owned());
        }
        if let Some(scene) = self.scenes.first() {
            (self.scene, self.part) = (scene, 0);
        }
        self.found = true;
        self.at_start_of = None;
    }
}
