//! Which poses of an artefact are touched where nobody has written a program: first for the worst-determined of the results, then
//! for power against the whole catalogue, at last the first poses once more.
//!
//! Greedy, with updates of low rank of the covariance of all unknowns (Woodbury); every size counts in typical ones.

use super::bundle::{Bundle, Pace, cost_at};
use super::choose_touches::typical_columns;
use super::linearised_plan::LinearisedPlan;
use crate::search::power::SEEN;
use nalgebra::{Cholesky, DMatrix, DVector, Dyn};
use rayon::prelude::*;
use std::ops::Range;

/// Shares of the time that go to the results of the model: the choice is made once with each, and the better one is kept.
const FOR_RESULTS: [f64; 2] = [0.4, 0.8];

/// Share of the time that is left for poses that come once more.
const FOR_AGAIN: f64 = 0.12;

/// Poses that come once more at most.
const MOST_AGAIN: usize = 3;

/// Prior of the model's unknowns, in typical sizes: wide, for a firm start only.
const WIDE: f64 = 30.0;

/// So many effects that become detectable are worth a worst uncertainty that is smaller by the factor e.
const EFFECTS_PER_FACTOR: f64 = 15.0;

/// Rounds of the exchange at most, and visits that each of them tries to leave out.
const EXCHANGE: [usize; 2] = [4, 4];

/// What was chosen from a pool.
#[derive(Debug, Clone, PartialEq)]
pub struct Choice {
    /// Bundles, in the order in which they were taken.
    pub chosen: Vec<usize>,
    /// Those of them that come once more at the end.
    pub again: Vec<usize>,
    /// Standard uncertainty of the worst-determined result, in its typical size.
    pub worst: f64,
    /// How good the choice is by both figures: worst uncertainty and effects that can be detected.
    pub merit: f64,
}

/// How thoroughly it is chosen.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Look {
    /// One beginning, by its number; no exchange.
    Quick(usize),
    /// All beginnings, each with an exchange.
    Thorough,
}

/// Chooses bundles within a time, s. `view`: the touches of the pool, one after the other.
#[must_use]
pub fn choose(view: &LinearisedPlan, pool: &[Bundle], pace: &Pace, budget_s: f64, look: Look) -> Choice {
    let (columns, n_base) = typical_columns(view);
    let rows = columns.rows(0, view.n_touches()).into_owned();
    let visits = Visits::of(pool, *pace);
    // what the set-ups take is no result
    let results: Vec<usize> = (0..n_base).filter(|&c| !view.model.unknowns[view.free[c]].nuisance).collect();
    let figures = Figures::new(view, &rows, &visits, &results);
    let first_s = (1.0 - FOR_AGAIN) * budget_s;
    let start = |share: f64| {
        let mut chosen = Vec::new();
        let mut of_model = Covariance::new(rows.columns(0, n_base).into_owned(), |_| WIDE * WIDE);
        let worst = |c: &Covariance, r: &Range<usize>| c.worst_falls(r, &results);
        of_model.fill(pool, &visits, &mut chosen, share * budget_s, &worst);
        // an effect of the catalogue has its typical size
        let mut of_all = Covariance::new(rows.clone(), |c| if c < n_base { WIDE * WIDE } else { 1.0 });
        chosen.iter().for_each(|&i: &usize| of_all.take(&visits.rows[i]));
        of_all.fill(pool, &visits, &mut chosen, first_s, &Covariance::information);
        chosen
    };
    let mut best: Option<Choice> = None;
    let shares: Vec<f64> = match look {
        Look::Quick(number) => vec![FOR_RESULTS[number % FOR_RESULTS.len()]],
        Look::Thorough => FOR_RESULTS.to_vec(),
    };
    for share in shares {
        let mut chosen = start(share);
        if look == Look::Thorough {
            figures.exchange(pool, &visits, &mut chosen, first_s);
        }
        let again = visits.again(pool, &chosen, budget_s);
        // what is left of the time
        let rest_s = budget_s - visits.cost_s(pool, &again);
        figures.fill(pool, &visits, &mut chosen, &again, rest_s, None);
        let (worst, merit) = figures.of(&figures.sums_of(&[&chosen[..], &again].concat()));
        if best.as_ref().is_none_or(|b| merit > b.merit) {
            best = Some(Choice { chosen: visits.members(&chosen), again: visits.members(&again), worst, merit });
        }
    }
    best.unwrap_or(Choice { chosen: Vec::new(), again: Vec::new(), worst: WIDE, merit: f64::NEG_INFINITY })
}

/// Information of touches about the model and about each effect beside it, as far as the two figures need it.
#[derive(Debug, Clone)]
struct Sums {
    base: DMatrix<f64>,
    cross: DMatrix<f64>,
    own: DVector<f64>,
}

impl Sums {
    fn add(&mut self, other: &Self) {
        self.base += &other.base;
        self.cross += &other.cross;
        self.own += &other.own;
    }
}

/// The two figures of a choice: the worst uncertainty of a result, and how many effects can be detected.
struct Figures<'a> {
    of_visits: Vec<Sums>,
    /// Before any touch.
    nothing: Sums,
    results: &'a [usize],
    /// Columns of each effect.
    effects: Vec<Range<usize>>,
}

impl<'a> Figures<'a> {
    fn new(view: &LinearisedPlan, rows: &DMatrix<f64>, visits: &Visits, results: &'a [usize]) -> Self {
        let n_base = view.free.len();
        let n_left = rows.ncols() - n_base;
        let of = |range: &Range<usize>| {
            let base = rows.view((range.start, 0), (range.len(), n_base));
            let left = rows.view((range.start, n_base), (range.len(), n_left));
            let own = DVector::from_iterator(n_left, left.column_iter().map(|c| c.norm_squared()));
            Sums { base: base.tr_mul(&base), cross: base.tr_mul(&left), own }
        };
        let nothing = Sums {
            base: DMatrix::identity(n_base, n_base) / (WIDE * WIDE),
            cross: DMatrix::zeros(n_base, n_left),
            own: DVector::zeros(n_left),
        };
        let effects = view.library.candidates().iter().map(|c| c.variants[0].columns.clone()).collect();
        Self { of_visits: visits.rows.par_iter().map(of).collect(), nothing, results, effects }
    }

    fn sums_of(&self, chosen: &[usize]) -> Sums {
        let mut sums = self.nothing.clone();
        chosen.iter().for_each(|&v| sums.add(&self.of_visits[v]));
        sums
    }

    /// Worst uncertainty in typical sizes, and the merit.
    fn of(&self, sums: &Sums) -> (f64, f64) {
        let Some(factor) = sums.base.clone().cholesky() else { return (WIDE, f64::NEG_INFINITY) };
        let lower = factor.l_dirty();
        let mut left = sums.cross.clone();
        if !lower.solve_lower_triangular_mut(&mut left) {
            return (WIDE, f64::NEG_INFINITY);
        }
        let covariance = factor.inverse();
        let worst = self.results.iter().map(|&c| covariance[(c, c)].max(0.0).sqrt()).fold(0.0, f64::max);
        let shown = |span: &Range<usize>| {
            let seen: f64 = span.clone().map(|c| (sums.own[c] - left.column(c).norm_squared()).max(0.0)).sum();
            let noncentrality = seen / span.len().max(1) as f64;
            noncentrality / (noncentrality + SEEN)
        };
        let detectable: f64 = self.effects.iter().map(shown).sum();
        // a high mean stands for the worst: one that is nearly as bad counts as well
        let high: f64 = self.results.iter().map(|&c| covariance[(c, c)].max(0.0).powi(4)).sum();
        (worst, detectable - EFFECTS_PER_FACTOR * high.max(f64::MIN_POSITIVE).ln() / 8.0)
    }

    fn merit_with(&self, sums: &Sums, visit: usize) -> f64 {
        let mut with = sums.clone();
        with.add(&self.of_visits[visit]);
        self.of(&with).1
    }

    /// Takes what gains most merit for its time until nothing more fits. `again`: visits that are made besides.
    fn fill(
        &self,
        pool: &[Bundle],
        visits: &Visits,
        chosen: &mut Vec<usize>,
        again: &[usize],
        budget_s: f64,
        but: Option<usize>,
    ) {
        let mut sums = self.sums_of(&[&chosen[..], again].concat());
        loop {
            let (here, spent) = (self.of(&sums).1, visits.cost_s(pool, chosen));
            let gain = |i: usize| {
                let seconds = visits.cost_s(pool, &[&chosen[..], &[i]].concat());
                let gain = (seconds <= budget_s).then(|| self.merit_with(&sums, i))? - here;
                Some((gain / (seconds - spent), i)).filter(|g| g.0 > 0.0)
            };
            let open = (0..visits.rows.len()).into_par_iter().filter(|i| but != Some(*i) && !chosen.contains(i));
            // ties go to the earlier visit: the same choice in every run
            match open.filter_map(gain).max_by(|a, b| a.0.total_cmp(&b.0).then(b.1.cmp(&a.1))) {
                Some((_, i)) => {
                    sums.add(&self.of_visits[i]);
                    chosen.push(i);
                }
                None => return,
            }
        }
    }

    /// Leaves out a visit that is missed least for its time and fills the time again, while that pays.
    fn exchange(&self, pool: &[Bundle], visits: &Visits, chosen: &mut Vec<usize>, budget_s: f64) {
        let [rounds, most_out] = EXCHANGE;
        let merit = |chosen: &[usize]| self.of(&self.sums_of(chosen)).1;
        self.fill(pool, visits, chosen, &[], budget_s, None);
        for _ in 0..rounds {
            let here = merit(chosen);
            let rest = |out: usize| chosen.iter().copied().filter(|v| *v != out).collect::<Vec<_>>();
            let mut missed: Vec<(f64, usize)> = chosen
                .par_iter()
                .map(|&out| ((here - merit(&rest(out))) / visits.cost_s(pool, &[out]).max(1.0), out))
                .collect();
            missed.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
            let tried = missed.into_iter().take(most_out).map(|(_, out)| {
                let mut other = rest(out);
                self.fill(pool, visits, &mut other, &[], budget_s, Some(out));
                (merit(&other), other)
            });
            match tried.reduce(|a, b| if b.0 > a.0 { b } else { a }) {
                Some((better, other)) if better > here + 1e-6 => *chosen = other,
                _ => return,
            }
        }
    }
}

/// Bundles in one manner, which follow one another in a pool: the rotary axes go there once for all of them.
struct Visits {
    bundles: Vec<Range<usize>>,
    /// Rows of their touches.
    rows: Vec<Range<usize>>,
    pace: Pace,
}

impl Visits {
    fn of(pool: &[Bundle], pace: Pace) -> Self {
        let (mut bundles, mut rows): (Vec<Range<usize>>, Vec<Range<usize>>) = (Vec::new(), Vec::new());
        let mut at = 0;
        for (i, b) in pool.iter().enumerate() {
            let end = at + b.touches.len();
            match (bundles.last_mut(), rows.last_mut()) {
                (Some(own), Some(of_own)) if pool[own.start].manner == b.manner => (own.end, of_own.end) = (i + 1, end),
                _ => {
                    bundles.push(i..i + 1);
                    rows.push(at..end);
                }
            }
            at = end;
        }
        Self { bundles, rows, pace }
    }

    fn members(&self, visits: &[usize]) -> Vec<usize> {
        visits.iter().flat_map(|&v| self.bundles[v].clone()).collect()
    }

    fn cost_s(&self, pool: &[Bundle], visits: &[usize]) -> f64 {
        cost_at(pool, &self.members(visits), &self.pace)
    }

    /// Visits that come once more: the shortest ones. What is done differently at a pose is no repeat of it.
    fn again(&self, pool: &[Bundle], chosen: &[usize], budget_s: f64) -> Vec<usize> {
        let is_plain = |v: &usize| pool[self.bundles[*v].start].manner.stylus.is_none();
        let mut short: Vec<usize> = chosen.iter().copied().filter(is_plain).collect();
        short.sort_by_key(|&v| self.rows[v].len());
        let rest_s = budget_s - self.cost_s(pool, chosen);
        let mut again: Vec<usize> = Vec::new();
        for v in short {
            if again.len() < MOST_AGAIN && self.cost_s(pool, &[&again[..], &[v]].concat()) <= rest_s {
                again.push(v);
            }
        }
        again
    }
}

/// Covariance of all unknowns after what was taken.
struct Covariance {
    /// Whitened columns: a row for each touch of the pool.
    rows: DMatrix<f64>,
    covariance: DMatrix<f64>,
    /// `rows` times the covariance.
    seen: DMatrix<f64>,
}

impl Covariance {
    /// Nothing is taken yet: the prior variance of each column.
    fn new(rows: DMatrix<f64>, prior: impl Fn(usize) -> f64) -> Self {
        let variances = DVector::from_iterator(rows.ncols(), (0..rows.ncols()).map(prior));
        let covariance = DMatrix::from_diagonal(&variances);
        Self { seen: &rows * &covariance, rows, covariance }
    }

    /// A factor of I + A C Aᵀ for the rows A of a bundle, and A C.
    fn of(&self, range: &Range<usize>) -> Option<(Cholesky<f64, Dyn>, DMatrix<f64>)> {
        let seen = self.seen.rows(range.start, range.len());
        let within = seen * self.rows.rows(range.start, range.len()).transpose();
        let factor = (within + DMatrix::identity(range.len(), range.len())).cholesky()?;
        Some((factor, seen.into_owned()))
    }

    /// By how much the worst variances of some columns fall: the fourth power of the standard deviations stands for the worst.
    fn worst_falls(&self, range: &Range<usize>, columns: &[usize]) -> Option<f64> {
        let (factor, seen) = self.of(range)?;
        let mut change = seen.select_columns(columns);
        if !factor.l_dirty().solve_lower_triangular_mut(&mut change) {
            return None;
        }
        let falls = columns.iter().zip(change.column_iter()).map(|(&c, change)| {
            let before = self.covariance[(c, c)];
            before * before - (before - change.norm_squared()).powi(2)
        });
        Some(falls.sum())
    }

    /// Information that a bundle adds: log det (I + A C Aᵀ).
    fn information(&self, range: &Range<usize>) -> Option<f64> {
        let (factor, _) = self.of(range)?;
        Some(2.0 * factor.l_dirty().diagonal().iter().map(|x| x.ln()).sum::<f64>())
    }

    fn take(&mut self, range: &Range<usize>) {
        let Some((factor, mut change)) = self.of(range) else { return };
        if factor.l_dirty().solve_lower_triangular_mut(&mut change) {
            self.seen -= (&self.rows * change.transpose()) * &change;
            self.covariance -= change.tr_mul(&change);
        }
    }

    /// Takes what gains most for its time until nothing more fits.
    fn fill(
        &mut self,
        pool: &[Bundle],
        visits: &Visits,
        chosen: &mut Vec<usize>,
        budget_s: f64,
        gain: &(dyn Fn(&Self, &Range<usize>) -> Option<f64> + Sync),
    ) {
        loop {
            let spent = visits.cost_s(pool, chosen);
            let per_second = |i: usize| {
                let seconds = visits.cost_s(pool, &[&chosen[..], &[i]].concat());
                let gain = (seconds <= budget_s).then(|| gain(self, &visits.rows[i]))??;
                Some((gain / (seconds - spent), i)).filter(|g| g.0 > 0.0)
            };
            let open = (0..visits.rows.len()).into_par_iter().filter(|i| !chosen.contains(i));
            // ties go to the earlier visit: the same choice in every run
            match open.filter_map(per_second).max_by(|a, b| a.0.total_cmp(&b.0).then(b.1.cmp(&a.1))) {
                Some((_, i)) => {
                    self.take(&visits.rows[i]);
                    chosen.push(i);
                }
                None => return,
            }
        }
    }
}
