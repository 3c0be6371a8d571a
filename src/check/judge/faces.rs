//! At a face: the search, the way back, the second search.

use super::proofs::How;
use super::{Contact, Walk};
use crate::axes::{AxisName, Position};
use crate::check::checked_program::SIDEWAYS_MM;
use crate::check::run::Probe;
use crate::check::touches::Made;
use crate::program::sweep::Manner;
use crate::units::Plain;
use nalgebra::Vector3;
use std::ops::Range;

impl Walk<'_, '_> {
    /// A move that begins at a face: back along the approach, no further than the search began.
    pub(super) fn leave_face(
        &mut self,
        at: &Range<usize>,
        part: usize,
        mut contact: Contact,
        from: &Position,
        to: &Position,
        rotary: &[AxisName],
    ) {
        let way = to.xyz_mm() - from.xyz_mm();
        let back = -way.dot(&contact.along);
        let aside = (way + contact.along * back).norm();
        let left = (from.xyz_mm() - contact.start.xyz_mm()).dot(&contact.along);
        // the place of contact has its own last digits in each axis
        if !rotary.is_empty() || aside > (10.0 * self.case.same).max(SIDEWAYS_MM) || back < -self.case.same {
            self.say(
                "check::in_contact",
                at,
                "the ball may still press against the block: it must first go back the way it came".into(),
                "a retract is missing",
            );
            return;
        }
        if back > left + 10.0 * self.case.same {
            // further back than the search began: proven from there on
            self.prove(at, part, contact.start, *to, How::Straight(Manner::Rapid));
        } else if back < left - 10.0 * self.case.same {
            contact.made.backed_off = true;
            self.contact = Some(contact);
        } else {
            self.came_guarded = true;
        }
    }

    #[allow(clippy::too_many_arguments)] // the fields of one event
    pub(super) fn probe(
        &mut self,
        at: &Range<usize>,
        part: usize,
        probe: &Probe,
        from: &Position,
        to: &Position,
        hit: bool,
        made_part: f64,
    ) {
        let machine = &self.case.machine.probe;
        let moving = self.moving(from, to);
        let mut bounded = [false; 6];
        moving.iter().for_each(|a| bounded[a.index()] = true);
        if probe.feed > machine.position_feed + self.case.same {
            let says = format!(
                "it probes at {} mm/min, the machine's position_feed is {}",
                Plain(probe.feed),
                Plain(machine.position_feed)
            );
            self.say("check::feed", at, says, "");
        }
        if moving.iter().any(|a| a.is_rotary()) {
            self.say("check::turn_and_move", at, "a probing move turns a rotary axis".into(), "");
            return;
        }
        if !self.all_known(&probe.known) {
            const ASKS_MM: f64 = 0.02;
            if (to.xyz_mm() - from.xyz_mm()).norm() > ASKS_MM + self.case.same {
                self.say("check::unknown_start", at, "it probes before the place of every axis is known".into(), "");
            }
            return;
        }
        self.inside(at, to, &bounded);
        let way = to.xyz_mm() - from.xyz_mm();
        let stands = |p: f64| {
            let mut s = *from;
            s.0.iter_mut().zip(to.0).for_each(|(slot, end)| *slot += (end - *slot) * p);
            s
        };
        let reached = if made_part >= 1.0 { *to } else { stands(made_part) };
        let Some(mut contact) = self.contact.take() else {
            self.free_probe(at, part, probe, (from, to, &reached), hit, way);
            return;
        };
        let onward = way.dot(&contact.along);
        if onward < 0.0 || moving.is_empty() {
            // back from the face; the move to the start ends the touch
            let rotary = [];
            let released_on_the_way = !probe.toward && hit;
            let target = if released_on_the_way { &reached } else { to };
            self.leave_face(at, part, contact, from, target, &rotary);
            // what the program would drive to without a release is proven as well
            return;
        }
        let aside = (way - contact.along * onward).norm();
        if aside > (10.0 * self.case.same).max(SIDEWAYS_MM) || !probe.toward {
            self.say("check::in_contact", at, "a second search goes in another direction than the first".into(), "");
        }
        if !contact.made.backed_off {
            self.say("check::in_contact", at, "it searches again without having moved off the face".into(), "");
        }
        if hit {
            self.search_is_gentle(at, probe.feed, (to.xyz_mm() - reached.xyz_mm()).norm());
        }
        contact.made.measure(probe, from, to, &reached, hit);
        self.contact = Some(contact);
    }

    /// A probing move from a place in the open: a search when it meets something, positioning otherwise.
    pub(super) fn free_probe(
        &mut self,
        at: &Range<usize>,
        part: usize,
        probe: &Probe,
        (from, to, reached): (&Position, &Position, &Position),
        hit: bool,
        way: Vector3<f64>,
    ) {
        if !probe.toward {
            return; // the probe is closed: the move is over before it begins
        }
        if !hit {
            self.prove(at, part, *from, *to, How::Straight(Manner::Guarded));
            self.came_guarded = true;
            return;
        }
        let block = self.case.world.met(part, probe);
        let scene_block = self.case.mountings.get(part).and_then(|m| {
            let name = block.as_deref()?;
            m.blocks.iter().position(|b| b.name == name)
        });
        if let Some(b) = scene_block {
            self.prove(at, part, *from, *reached, How::Straight(Manner::ToContact(b)));
            let past = if self.finding_mm.is_some() { Manner::PastArtefact(b) } else { Manner::PastContact(b) };
            self.prove(at, part, *reached, *to, How::Straight(past));
        }
        self.search_is_gentle(at, probe.feed, (to.xyz_mm() - reached.xyz_mm()).norm());
        if !self.came_guarded {
            let says =
                "the ball did not come to the beginning of the search by a move that stops at contact".to_owned();
            self.say("check::unguarded", at, says, "");
        }
        self.came_guarded = false;
        let along = way.try_normalize(1e-12).unwrap_or_else(Vector3::zeros);
        let made = Made::search(at, part, block, probe, from, to, reached);
        self.contact = Some(Contact { start: *from, along, made });
    }

    /// A search is no faster than the probe allows, and one that goes on although the probe does not answer ends before the
    /// probe is pushed past its overtravel, wherever within the tolerance the block stands. `past_mm`: how far it is
    /// programmed to go past the nominal contact.
    fn search_is_gentle(&mut self, at: &Range<usize>, feed: f64, past_mm: f64) {
        /// Words of a rounded start and end.
        const ROUNDED_MM: f64 = 0.01;
        let probe = &self.case.machine.probe;
        let (overtravel, tolerance) = (probe.overtravel, probe.placement_tolerance);
        if let Some(room_mm) = self.finding_mm {
            // the artefact may stand anywhere within it: that a dead probe is not pushed cannot be had, that it is met slowly can
            if past_mm > 2.0 * room_mm + 1.0 || feed > probe.slow_feed + self.case.same {
                let says =
                    format!("a search that finds the artefact ends {past_mm:.3} mm past it, at {} mm/min", Plain(feed));
                self.say("check::overtravel", at, says, "no further than where it may stand, at slow_feed");
            }
            return;
        }
        if past_mm + tolerance > overtravel + ROUNDED_MM + self.case.same {
            let says = format!(
                "the search ends {past_mm:.3} mm past the face: a probe that does not answer would be pushed past its overtravel \
                 ({overtravel} mm, of which {tolerance} mm are for where the block stands)"
            );
            self.say("check::overtravel", at, says, "");
        }
        if feed > probe.fast_feed + self.case.same {
            let says =
                format!("it searches at {} mm/min, the machine's fast_feed is {}", Plain(feed), Plain(probe.fast_feed));
            self.say("check::feed", at, says, "");
        }
    }
}
