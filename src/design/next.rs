//! Which further touches part effects best: greedy Bayesian D_s start, then exchange for the named pairs.
//!
//! Each bundle adds its information matrix over the model's unknowns and the effects in question. What the model's
//! unknowns (set-ups of blocks among them) take is projected out by the Schur complement: locating a new block earns no
//! credit.

use super::bundle::{Bundle, cost_s};
use super::questions::{Pair, Questions};
use super::view::View;
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;
use std::ops::Range;

/// More separation than this is worth no further touch: 25 tells two effects apart nearly always.
const ENOUGH: f64 = 50.0;

/// Share of separation beyond enough that still counts, so that a tie goes to the clearer answer.
const BEYOND: f64 = 1e-3;

/// Prior of the model's unknowns, in typical sizes: wide, for a firm start only.
const WIDE: f64 = 30.0;

/// Passes of the exchange at most.
const MOST_PASSES: usize = 12;

/// Bundles that one pass tries to bring in.
const MOST_FRESH: usize = 60;

/// Information about the model's unknowns and the effects in question, bundle by bundle.
#[derive(Debug, Clone)]
pub struct Design {
    n_base: usize,
    /// Columns of each effect, behind those of the base.
    spans: Vec<(String, Range<usize>)>,
    /// What there is already, with the prior of the base.
    given: DMatrix<f64>,
    /// What each bundle adds.
    adds: Vec<DMatrix<f64>>,
    /// The pairs with the sizes of their effects.
    asked: Vec<Asked>,
}

#[derive(Debug, Clone)]
struct Asked {
    one: usize,
    other: Option<usize>,
    size: [Option<DVector<f64>>; 2],
}

/// How well a pair is told apart.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct Separation {
    /// Id of one effect.
    pub one: String,
    /// Id of the other; none: whether the first is there at all.
    pub other: Option<String>,
    /// Noncentrality of what would be left if one were taken for the other, with the data so far.
    pub before: f64,
    /// The same with the further touches.
    pub after: f64,
}

impl Design {
    /// `view`: all touches so far and then those of the pool, with the columns of the effects in question.
    /// `n_given`: how many touches there are already.
    #[must_use]
    pub fn new(view: &View, n_given: usize, pool: &[Bundle], questions: &Questions) -> Self {
        let n_base = view.free.len();
        let mut spans = Vec::new();
        let mut columns = view.jacobian.clone();
        for (mut column, &i) in columns.column_iter_mut().zip(&view.free) {
            column *= view.model.unknowns[i].typical;
        }
        let own = view.library.matrix();
        let columns = {
            let mut all = columns.resize_horizontally(n_base + own.ncols(), 0.0);
            all.columns_mut(n_base, own.ncols()).copy_from(&own);
            all
        };
        for c in view.library.candidates() {
            let span = &c.variants[0].columns;
            spans.push((c.id.clone(), n_base + span.start..n_base + span.end));
        }
        let gram = |rows: Range<usize>| {
            let part = columns.rows(rows.start, rows.len());
            part.tr_mul(&part)
        };
        let mut given = gram(0..n_given);
        // rows that are no touches: what is known beside them
        given += gram(view.n_touches()..columns.nrows());
        for i in 0..n_base {
            given[(i, i)] += 1.0 / (WIDE * WIDE);
        }
        let mut at = n_given;
        let ranges: Vec<Range<usize>> = pool
            .iter()
            .map(|b| {
                at += b.touches.len();
                at - b.touches.len()..at
            })
            .collect();
        let adds = ranges.into_par_iter().map(gram).collect();
        let find = |id: &str| spans.iter().position(|(s, _)| s == id);
        let size = |id: &str| questions.sizes.get(id).cloned();
        let asked = questions
            .pairs
            .iter()
            .filter_map(|p: &Pair| {
                let other = match &p.other {
                    Some(id) => Some(find(id)?),
                    None => None,
                };
                Some(Asked { one: find(&p.one)?, other, size: [size(&p.one), p.other.as_deref().and_then(size)] })
            })
            .collect();
        Self { n_base, spans, given, adds, asked }
    }

    /// Information about the effects, what the base takes projected out.
    fn effects(&self, information: &DMatrix<f64>) -> Option<DMatrix<f64>> {
        let (p, q) = (self.n_base, information.ncols() - self.n_base);
        let base = information.view((0, 0), (p, p)).into_owned().cholesky()?;
        let cross = information.view((0, p), (p, q)).into_owned();
        Some(information.view((p, p), (q, q)) - cross.tr_mul(&base.solve(&cross)))
    }

    /// Noncentrality of effect `a` at its size when `b` is taken for it.
    fn left(&self, s: &DMatrix<f64>, a: usize, b: Option<usize>, size: Option<&DVector<f64>>) -> f64 {
        let local = |k: usize| {
            let r = &self.spans[k].1;
            (r.start - self.n_base, r.len())
        };
        let (i, n) = local(a);
        let mut own = s.view((i, i), (n, n)).into_owned();
        if let Some(b) = b {
            let (j, m) = local(b);
            let mut other = s.view((j, j), (m, m)).into_owned();
            let floor = 1e-9 * other.trace().max(1e-12);
            for k in 0..m {
                other[(k, k)] += floor;
            }
            let cross = s.view((j, i), (m, n)).into_owned();
            if let Some(c) = other.cholesky() {
                own -= cross.tr_mul(&c.solve(&cross));
            }
        }
        match size.filter(|t| t.len() == n) {
            Some(theta) => theta.dot(&(&own * theta)).max(0.0),
            // the mean over random signs of typical sizes
            None => own.trace().max(0.0),
        }
    }

    fn separations(&self, information: &DMatrix<f64>) -> Option<Vec<f64>> {
        let s = self.effects(information)?;
        Some(
            self.asked
                .iter()
                .map(|p| {
                    let forth = self.left(&s, p.one, p.other, p.size[0].as_ref());
                    p.other.map_or(forth, |b| forth.min(self.left(&s, b, Some(p.one), p.size[1].as_ref())))
                })
                .collect(),
        )
    }

    /// What the exchange maximises: separations, as far as they are worth anything.
    fn worth(&self, information: &DMatrix<f64>) -> f64 {
        let all = self.separations(information).unwrap_or_default();
        all.iter().map(|l| l.min(ENOUGH) + BEYOND * (l - ENOUGH).max(0.0).sqrt()).sum()
    }

    /// Bayesian D_s: log det of the information about the effects, each with a prior of its typical size.
    fn d_s(&self, information: &DMatrix<f64>) -> f64 {
        let Some(mut s) = self.effects(information) else { return f64::NEG_INFINITY };
        for i in 0..s.nrows() {
            s[(i, i)] += 1.0;
        }
        s.cholesky().map_or(f64::NEG_INFINITY, |c| 2.0 * c.l_dirty().diagonal().iter().map(|x| x.ln()).sum::<f64>())
    }

    fn information(&self, chosen: &[usize]) -> DMatrix<f64> {
        chosen.iter().fold(self.given.clone(), |sum, &i| sum + &self.adds[i])
    }

    /// Separations of the pairs by the touches so far and with a choice.
    #[must_use]
    pub fn separated(&self, chosen: &[usize]) -> Vec<Separation> {
        let before = self.separations(&self.given).unwrap_or_default();
        let after = self.separations(&self.information(chosen)).unwrap_or_default();
        self.asked
            .iter()
            .zip(before.iter().zip(&after))
            .map(|(p, (before, after))| Separation {
                one: self.spans[p.one].0.clone(),
                other: p.other.map(|b| self.spans[b].0.clone()),
                before: *before,
                after: *after,
            })
            .collect()
    }

    /// Chooses bundles within a time, s.
    #[must_use]
    pub fn choose(&self, pool: &[Bundle], budget_s: f64) -> Vec<usize> {
        let mut best: Vec<usize> = Vec::new();
        let mut worth = self.worth(&self.given);
        let all: Vec<usize> = (0..pool.len()).collect();
        // changing the stylus costs as much as many touches: what can be done without it is a start of its own
        let own: Vec<usize> = all.iter().copied().filter(|&i| pool[i].manner.stylus.is_none()).collect();
        let pools = if own.len() < all.len() { vec![all, own] } else { vec![all] };
        for among in &pools {
            // D_s finds its way where no single bundle parts a pair yet; the pairs' own worth is the other start
            let by_d_s = self.greedy(pool, among, budget_s, |m| self.d_s(m));
            let by_worth = self.greedy(pool, among, budget_s, |m| self.worth(m));
            for start in [by_d_s, by_worth] {
                let chosen = self.exchange(pool, among, budget_s, start);
                let now = self.worth(&self.information(&chosen));
                if now > worth {
                    (best, worth) = (chosen, now);
                }
            }
        }
        self.thinned(pool, best)
    }

    fn greedy(
        &self,
        pool: &[Bundle],
        among: &[usize],
        budget_s: f64,
        value: impl Fn(&DMatrix<f64>) -> f64 + Sync,
    ) -> Vec<usize> {
        let mut chosen: Vec<usize> = Vec::new();
        loop {
            let now = self.information(&chosen);
            let (here, spent) = (value(&now), cost_s(pool, &chosen));
            let best = among
                .par_iter()
                .copied()
                .filter(|i| !chosen.contains(i))
                .filter_map(|i| {
                    let with: Vec<usize> = chosen.iter().copied().chain([i]).collect();
                    let seconds = cost_s(pool, &with);
                    (seconds <= budget_s).then(|| ((value(&(&now + &self.adds[i])) - here) / (seconds - spent), i))
                })
                .filter(|(gain, _)| *gain > 1e-9)
                // ties go to the earlier bundle: the same choice in every run
                .max_by(|a, b| a.0.total_cmp(&b.0).then(b.1.cmp(&a.1)));
            match best {
                Some((_, i)) => chosen.push(i),
                None => return chosen,
            }
        }
    }

    /// Fedorov's exchange: one out, one in, while it pays.
    fn exchange(&self, pool: &[Bundle], among: &[usize], budget_s: f64, mut chosen: Vec<usize>) -> Vec<usize> {
        for _ in 0..MOST_PASSES {
            let now = self.information(&chosen);
            let here = self.worth(&now);
            // what helps most beside the present choice is what is worth a place in it
            let mut fresh: Vec<(f64, usize)> = among
                .par_iter()
                .copied()
                .filter(|i| !chosen.contains(i))
                .map(|i| (self.worth(&(&now + &self.adds[i])), i))
                .collect();
            fresh.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
            let fresh: Vec<usize> = fresh.into_iter().take(MOST_FRESH).map(|(_, i)| i).collect();
            let moves: Vec<Option<usize>> = (0..chosen.len()).map(Some).chain([None]).collect();
            let best = moves
                .into_iter()
                .filter_map(|out| {
                    let rest: Vec<usize> =
                        chosen.iter().enumerate().filter(|(k, _)| Some(*k) != out).map(|(_, i)| *i).collect();
                    let without = self.information(&rest);
                    fresh
                        .par_iter()
                        .copied()
                        .filter(|i| cost_s(pool, &rest.iter().copied().chain([*i]).collect::<Vec<_>>()) <= budget_s)
                        .map(|i| (self.worth(&(&without + &self.adds[i])), i))
                        .max_by(|a, b| a.0.total_cmp(&b.0).then(b.1.cmp(&a.1)))
                        .map(|(value, i)| (value, rest, i))
                })
                .max_by(|a, b| a.0.total_cmp(&b.0));
            match best {
                Some((value, rest, i)) if value > here * (1.0 + 1e-6) + 1e-9 => {
                    chosen = rest;
                    chosen.push(i);
                }
                _ => break,
            }
        }
        chosen
    }

    /// Without the bundles that no pair needs.
    fn thinned(&self, pool: &[Bundle], mut chosen: Vec<usize>) -> Vec<usize> {
        let full = self.worth(&self.information(&chosen));
        let mut order = chosen.clone();
        order.sort_by_key(|&i| std::cmp::Reverse(pool[i].touches.len()));
        for i in order {
            let rest: Vec<usize> = chosen.iter().copied().filter(|k| *k != i).collect();
            if !rest.is_empty() && self.worth(&self.information(&rest)) > 0.99 * full {
                chosen = rest;
            }
        }
        chosen
    }
}
