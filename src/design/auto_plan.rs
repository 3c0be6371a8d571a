//! Which poses of an artefact are touched where nobody has written a program: first for the worst-determined of the results, then
//! for power against the whole catalogue, at last the first poses once more.
//!
//! Greedy, with updates of low rank of the covariance of all unknowns (Woodbury); every size counts in typical ones.

use super::bundle::{Bundle, cost_s};
use super::choose_touches::typical_columns;
use super::linearised_plan::{LinearisedPlan, STYLUS_S};
use crate::fit::whitening::VisitNormals;
use nalgebra::{Cholesky, DMatrix, DVector, Dyn};
use rayon::prelude::*;
use std::ops::Range;

/// Share of the time that goes to the results of the model.
const FOR_RESULTS: f64 = 0.4;

/// Share of the time that is left for poses that come once more.
const FOR_AGAIN: f64 = 0.12;

/// Poses that come once more at most.
const MOST_AGAIN: usize = 3;

/// Prior of the model's unknowns, in typical sizes: wide, for a firm start only.
const WIDE: f64 = 30.0;

/// Visits whose gains are computed at a time.
const AT_ONCE: usize = 32;

/// What was chosen from a pool.
#[derive(Debug, Clone, PartialEq)]
pub struct Choice {
    /// Bundles, in the order in which they were taken.
    pub chosen: Vec<usize>,
    /// Those of them that come once more at the end.
    pub again: Vec<usize>,
    /// Standard uncertainty of the worst-determined result where nothing but the model acts, in its typical size.
    pub worst: f64,
}

/// What the touches of a pool tell: columns in typical sizes over the noise of a touch, a row for each touch.
#[derive(Debug, Clone)]
pub struct Tells {
    rows: DMatrix<f64>,
    /// What the scatter of index visits, mm, moves together.
    visits: VisitNormals,
    tau_mm: f64,
    /// Columns of the model; those of the other effects follow.
    n_base: usize,
    /// Columns of the model's results: what the set-ups take is none.
    results: Vec<usize>,
}

impl Tells {
    /// `view`: the touches of the pool, one after the other, without a scatter of visits. `tau_mm`: this scatter.
    #[must_use]
    pub fn of(view: &LinearisedPlan, tau_mm: f64) -> Self {
        let (columns, n_base) = typical_columns(view);
        let rows = columns.rows(0, view.n_touches()).into_owned();
        let results = (0..n_base).filter(|&c| !view.model.unknowns[view.free[c]].nuisance).collect();
        Self { rows, visits: view.visit_normals(), tau_mm, n_base, results }
    }

    /// Some of the touches only, in ascending order.
    #[must_use]
    pub fn only(&self, touches: &[usize]) -> Self {
        let (rows, visits) = (self.rows.select_rows(touches), self.visits.only(touches));
        Self { rows, visits, tau_mm: self.tau_mm, n_base: self.n_base, results: self.results.clone() }
    }

    fn whitened(&self) -> DMatrix<f64> {
        let mut rows = self.rows.clone();
        self.visits.change(0.0, self.tau_mm).apply(&mut rows);
        rows
    }
}

/// Chooses bundles within a time, s. `tells`: the touches of the pool, one after the other.
#[must_use]
pub fn choose(tells: &Tells, pool: &[Bundle], budget_s: f64) -> Choice {
    let (n_base, results) = (tells.n_base, &tells.results);
    let rows = tells.whitened();
    let visits = Visits::of(pool);

    let mut chosen = Vec::new();
    let of_base = rows.columns(0, n_base).into_owned();
    let mut of_model = Covariance::new(&of_base, |_| WIDE * WIDE);
    let worst = |c: &Covariance, r: &Range<usize>| c.worst_falls(r, results);
    of_model.fill(pool, &visits, &mut chosen, FOR_RESULTS * budget_s, Falls::Anyhow, &worst);
    let of_results = chosen.len();

    // an effect of the catalogue has its typical size
    let mut of_all = Covariance::new(&rows, |c| if c < n_base { WIDE * WIDE } else { 1.0 });
    chosen.iter().for_each(|&i: &usize| of_all.take(&visits.rows[i]));
    let most_s = (1.0 - FOR_AGAIN) * budget_s;
    of_all.fill(pool, &visits, &mut chosen, most_s, Falls::Always, &Covariance::information);

    // plain poses: what is done differently at a pose is no repeat of it
    let mut again: Vec<usize> = Vec::new();
    for &v in chosen.iter().filter(|v| pool[visits.bundles[**v].start].manner.stylus.is_none()) {
        let seconds = visits.cost_s(pool, &chosen) + visits.cost_s(pool, &[&again[..], &[v]].concat());
        if again.len() < MOST_AGAIN && seconds <= budget_s {
            again.push(v);
        }
    }
    chosen[of_results..].iter().for_each(|&i| of_model.take(&visits.rows[i]));
    let worst = results.iter().map(|&c| of_model.covariance[(c, c)].max(0.0).sqrt()).fold(0.0, f64::max);
    Choice { chosen: visits.members(&chosen), again: visits.members(&again), worst }
}

/// Bundles in one manner, which follow one another in a pool: the rotary axes go there once for all of them.
struct Visits {
    bundles: Vec<Range<usize>>,
    /// Rows of their touches.
    rows: Vec<Range<usize>>,
}

impl Visits {
    fn of(pool: &[Bundle]) -> Self {
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
        Self { bundles, rows }
    }

    fn members(&self, visits: &[usize]) -> Vec<usize> {
        visits.iter().flat_map(|&v| self.bundles[v].clone()).collect()
    }

    fn cost_s(&self, pool: &[Bundle], visits: &[usize]) -> f64 {
        cost_s(self.members(visits).into_iter().map(|i| &pool[i]))
    }

    /// What one more visit takes, s: a stylus that is in use already need not be changed.
    fn more_s(&self, pool: &[Bundle], visits: &[usize], more: usize) -> f64 {
        let stylus = |v: usize| pool[self.bundles[v].start].manner.stylus.as_deref();
        let is_in_use = stylus(more).is_some() && visits.iter().any(|&v| stylus(v) == stylus(more));
        self.cost_s(pool, &[more]) - if is_in_use { STYLUS_S } else { 0.0 }
    }
}

/// What becomes of a gain as more is taken.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Falls {
    /// It becomes smaller: one that was computed before bounds the present one.
    Always,
    /// It may also become larger.
    Anyhow,
}

/// Covariance of all unknowns after what was taken.
struct Covariance<'a> {
    /// Whitened columns: a row for each touch of the pool.
    rows: &'a DMatrix<f64>,
    covariance: DMatrix<f64>,
}

impl<'a> Covariance<'a> {
    /// Nothing is taken yet: the prior variance of each column.
    fn new(rows: &'a DMatrix<f64>, prior: impl Fn(usize) -> f64) -> Self {
        let variances = DVector::from_iterator(rows.ncols(), (0..rows.ncols()).map(prior));
        Self { rows, covariance: DMatrix::from_diagonal(&variances) }
    }

    /// A factor of I + A C Aᵀ for the rows A of a bundle, and A C.
    fn of(&self, range: &Range<usize>) -> Option<(Cholesky<f64, Dyn>, DMatrix<f64>)> {
        let own = self.rows.rows(range.start, range.len());
        let seen = own * &self.covariance;
        let within = &seen * own.transpose();
        Some(((within + DMatrix::identity(range.len(), range.len())).cholesky()?, seen))
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
        falls: Falls,
        gain: &(dyn Fn(&Self, &Range<usize>) -> Option<f64> + Sync),
    ) {
        // no visit gains more than this
        let mut bound = vec![f64::INFINITY; visits.rows.len()];
        loop {
            if falls == Falls::Anyhow {
                bound.fill(f64::INFINITY);
            }
            let spent = visits.cost_s(pool, chosen);
            let per_second = |i: usize| {
                let seconds = visits.more_s(pool, chosen, i);
                (spent + seconds <= budget_s && !chosen.contains(&i)).then(|| (bound[i] / seconds, seconds, i))
            };
            let mut open: Vec<(f64, f64, usize)> = (0..bound.len()).filter_map(per_second).collect();
            open.sort_by(|a, b| b.0.total_cmp(&a.0));
            let mut best: Option<(f64, usize)> = None;
            for some in open.chunks(AT_ONCE) {
                if best.is_some_and(|(gain, _)| some[0].0 < gain) {
                    break;
                }
                let gains = some.par_iter().map(|&(_, _, i)| gain(self, &visits.rows[i]).unwrap_or(0.0));
                for (&(_, seconds, i), gain) in some.iter().zip(gains.collect::<Vec<f64>>()) {
                    bound[i] = gain;
                    let gain = gain / seconds;
                    // ties go to the earlier visit: the same choice in every run
                    if gain > 0.0 && best.is_none_or(|(most, at)| gain > most || (gain == most && i < at)) {
                        best = Some((gain, i));
                    }
                }
            }
            let Some((_, i)) = best else { return };
            self.take(&visits.rows[i]);
            chosen.push(i);
        }
    }
}
