//! Runs under something that turns the program's coordinates and that no variable shows.

use super::Runs;
use crate::axes::Position;
use crate::check::explore::ExploredRun;
use crate::check::hidden_rotation::Turn;
use crate::check::run::{Dialect, Event, Happened, Start};
use rayon::prelude::*;
use std::ops::Range;

const FIRST_MOVES: usize = 6;

/// The beginning of a run.
pub(super) struct Begun {
    from: u32,
    /// Where its first moves lead.
    places: Vec<Position>,
}

impl Begun {
    pub(super) fn from_run(told: &ExploredRun) -> Self {
        let leads = |h: &Happened| if let Event::Move { to, .. } = &h.event { Some(*to) } else { None };
        Self { from: told.from, places: told.trunk.iter().filter_map(leads).take(FIRST_MOVES).collect() }
    }
}

impl<D: Dialect> Runs<'_, D> {
    /// Something turns the coordinates that no variable shows: begun elsewhere, and from where its own first moves lead, as one that is
    /// simply started again.
    pub(super) fn skewed(&self, elsewhere: Position, runs: &[Begun]) -> Option<(Range<usize>, String)> {
        let turns = Turn::all();
        let of = |(run, begun): (usize, &Begun)| {
            let places: Vec<Position> = begun.places.iter().copied().chain([elsewhere]).collect();
            // a set-up with one turn, the next with the next; the whole with all
            let some = if run == 0 { turns.clone() } else { vec![turns[run % turns.len()]] };
            let from = begun.from;
            let begins = some.into_iter().flat_map(move |turn| places.clone().into_iter().map(move |at| (turn, at)));
            begins.map(move |(turn, at)| (from, turn, at))
        };
        let all: Vec<_> = runs.iter().enumerate().flat_map(of).collect();
        let told = |(from, turn, at): &(u32, Turn, Position)| self.told(*from, Start::Rotated(*turn), *at, None);
        let fault = all.par_iter().find_map_first(|begun| told(begun).fault)?;
        Some((fault.at, fault.says))
    }
}
