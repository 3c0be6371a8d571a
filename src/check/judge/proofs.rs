//! Moves that must be clear, each proven once.

use super::CheckedProgram;
use crate::axes::{AxisName, Position};
use crate::program::sweep::Manner;
use std::ops::Range;

/// Proofs that are one: part, ends of the move, manner.
pub(super) type Key = (usize, [u64; 6], [u64; 6], u8);

/// A move that must be clear.
pub(super) struct Proof {
    pub at: Range<usize>,
    pub part: usize,
    pub from: Position,
    pub to: Position,
    pub how: How,
}

/// In what manner.
#[derive(Clone, Copy)]
pub(super) enum How {
    Straight(Manner),
    Spanned,
    Turn(AxisName),
}

impl How {
    pub(super) fn number(self) -> u8 {
        match self {
            Self::Straight(Manner::Rapid) => 0,
            Self::Straight(Manner::Guarded) => 1,
            Self::Straight(Manner::ToContact(b)) => 32 + (b % 64) as u8,
            Self::Straight(Manner::PastContact(b)) => 96 + (b % 64) as u8,
            // one artefact is found
            Self::Straight(Manner::PastArtefact(_)) => 160,
            Self::Spanned => 2,
            Self::Turn(axis) => 3 + axis.index() as u8,
        }
    }
}

impl Proof {
    /// What is wrong with it: where, code, in words.
    pub(super) fn check(&self, case: &CheckedProgram<'_>) -> Option<(Range<usize>, &'static str, String)> {
        let scene = case.scenes.get(self.part)?;
        let proven = match self.how {
            How::Straight(manner) => scene.clear_straight(&self.from, &self.to, manner),
            How::Turn(axis) => scene.clear_turn(&self.from, axis, self.to.get(axis)),
            How::Spanned => scene.clear_box(&self.from, &self.to),
        };
        let hit = proven.err()?;
        let unguarded = matches!(self.how, How::Straight(Manner::Rapid) | How::Spanned);
        let turns = matches!(self.how, How::Turn(_));
        let overlaps = hit.gap_mm <= 0.0;
        let (code, what) = match (unguarded, turns, overlaps) {
            (_, true, _) => ("check::turn_not_clear", "a rotary axis turns where it is not clear: "),
            (true, _, true) => ("check::collision", "collision: "),
            (true, _, false) => ("check::unguarded", "a move that does not stop at contact comes too near: "),
            (false, _, true) => ("check::collision", "collision: "),
            (false, _, false) => ("check::too_near", ""),
        };
        Some((self.at.clone(), code, format!("{what}{hit}")))
    }
}
