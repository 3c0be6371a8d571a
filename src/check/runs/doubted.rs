//! Runs that take the other way at conditions that depend on a clock or on a stored value of the control.

use super::Runs;
use crate::axes::Position;
use crate::check::doubt::{Doubt, Fork, Taken};
use crate::check::explore::{Explored, ExploredRun, Limits, explore, explore_on};
use crate::check::run::{Dialect, Start};
use rayon::prelude::*;
use std::ops::Range;

/// The runs, and what could not be run.
pub(super) struct Doubted {
    /// Each with the conditions at which it took the other way.
    pub runs: Vec<ExploredRun>,
    /// The first condition whose other way was not run, where there are too many.
    pub beyond: Option<Range<usize>>,
}

/// Runs of this kind that are made of a program at most.
const MOST_RUNS: usize = 23;

/// A run that is to begin at a condition: what was before it, and the run.
type Begun<'c, D> = (ExploredRun, Fork<'c, D>);

impl<'a, D: Dialect> Runs<'a, D> {
    /// Each condition the other way in a run of its own; conditions that only such a run comes to as well; and pairs, where they are few.
    pub(super) fn doubted<'c>(&self, begun: Vec<Begun<'c, D>>, taken: &Taken, limits: Limits) -> Doubted {
        let both_seen = |statement: usize| taken.get(&statement) == Some(&[true, true]);
        // a stored value of the control is another one in each run: what both ways were seen of was run
        let is_open = |fork: &Fork<'c, D>| fork.doubt == Doubt::Outside || !both_seen(fork.statement);
        let mut doubted = Doubted { runs: Vec::new(), beyond: None };
        let mut wave: Vec<Begun<'c, D>> = begun.into_iter().filter(|(_, fork)| is_open(fork)).collect();
        while !wave.is_empty() {
            let free = MOST_RUNS - doubted.runs.len();
            if let Some((_, fork)) = wave.get(free) {
                doubted.beyond = Some(self.program.place(fork.statement));
                wave.truncate(free);
            }
            let explored: Vec<Explored<'c, D>> =
                wave.into_par_iter().map(|(told, fork)| explore_on(fork.run, told, Some(limits), &|_| None)).collect();
            let mut next = Vec::new();
            let mut pairs = Vec::new();
            for Explored { told, forks, cut, .. } in explored {
                doubted.beyond = doubted.beyond.or(cut.map(|statement| self.program.place(statement)));
                for fork in forks.into_iter().filter(is_open) {
                    let is_new = !taken.contains_key(&fork.statement);
                    let begun = (self.begun(&told, &fork), fork);
                    if is_new { next.push(begun) } else { pairs.push(begun) }
                }
                doubted.runs.push(told);
            }
            let is_pair = |(told, _): &Begun<'c, D>| told.otherwise.len() == 2;
            let few = doubted.runs.len() + next.len() + pairs.len() <= MOST_RUNS;
            next.extend(pairs.into_iter().filter(|begun| few && is_pair(begun)));
            wave = next;
        }
        doubted
    }

    /// The forks of a run as runs that are to begin. Of a run that begins at a later set-up only those at conditions that the whole run
    /// does not come to.
    pub(super) fn forks<'c>(
        &self,
        told: &ExploredRun,
        forks: Vec<Fork<'c, D>>,
        whole: Option<&ExploredRun>,
    ) -> Vec<Begun<'c, D>> {
        let is_new = |fork: &Fork<'c, D>| whole.is_none_or(|whole| !whole.taken.contains_key(&fork.statement));
        forks.into_iter().filter(is_new).map(|fork| (self.begun(told, &fork), fork)).collect()
    }

    /// The program once more, with the control as its own run has left it.
    pub(super) fn again(&self, left: D, at: Position) -> ExploredRun {
        let mut run = self.run(1, Start::Awkward, at, 0, false);
        run.dialect = left;
        ExploredRun { start: Start::Awkward, ..explore(run, 1, None, &|_| None).told }
    }

    fn begun(&self, parent: &ExploredRun, fork: &Fork<'_, D>) -> ExploredRun {
        let mut otherwise = parent.otherwise.clone();
        otherwise.push((self.program.place(fork.statement), fork.doubt));
        ExploredRun {
            from: parent.from,
            start: parent.start,
            trunk: Vec::new(),
            parts: parent.parts.iter().take(fork.run.vm.trace.len()).copied().collect(),
            branches: Vec::new(),
            fault: None,
            settings: [parent.settings[0].clone(), std::collections::BTreeMap::new()],
            aborted: Vec::new(),
            taken: Taken::new(),
            otherwise,
        }
    }
}
