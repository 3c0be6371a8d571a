//! The scatter of groups of rows under each hypothesis, by restricted maximum likelihood.
//!
//! Touches of one index position share a displacement, and nobody knows how much it scatters. An effect that is missing in the
//! model looks like scatter; once it is in the model the scatter is small. The same regression is therefore tested with several
//! supposed scatters, and each candidate counts with those that are likely if the candidate is there (Patterson and Thompson,
//! Biometrika 58 (1971) 545): −2 ln L = ln|V| + ln|XᵀV⁻¹X| + rᵀPr.

use super::basis::Basis;
use super::library::{Library, Origin};
use super::moments::{Change, KEPT, Moments, Regression};
use super::multiplicity::{self, FAMILY_LEVEL};
use super::score::{PureError, Score, family, score};
use nalgebra::DVector;
use rayon::prelude::*;

/// A regression with a supposed scatter.
pub struct Supposed<'a> {
    /// The scatter.
    pub tau: f64,
    /// Whitened with it.
    pub residual: DVector<f64>,
    /// Basis of the base model, whitened with it.
    pub base: Basis,
    /// −2 ln L of the base model without the residual's part, ln|V| + ln|XᵀV⁻¹X|, and what is known of the scatter beforehand.
    pub ln_det: f64,
    /// What turns rows of the library into rows of this regression.
    pub change: Change<'a>,
}

/// What the tests say with one supposed scatter.
struct Tested {
    /// −2 ln L without any candidate.
    deviance: f64,
    scores: Vec<Score>,
}

impl Tested {
    /// −2 ln L with a variant of a candidate.
    fn with(&self, candidate: usize, variant: usize) -> f64 {
        let score = &self.scores[candidate];
        self.deviance + score.ln_left[variant] - score.scan[variant]
    }
}

/// A scatter for the tests, and one for the order of the candidates.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Scatter {
    /// Where no candidate passes, an upper bound.
    pub tests: f64,
    /// Where none passes, what is left with the most likely one.
    pub order: f64,
}

/// The scatter that is to be expected once the candidates are in the model that pass their test, each averaged over the scatters that
/// are likely with it, one after the other, `at_most` of them. The first of the supposed scatters is none at all.
#[must_use]
pub fn scatter_that_fits(
    mut supposed: Vec<Supposed>,
    library: &Library,
    pure: Option<PureError>,
    at_most: usize,
) -> Scatter {
    let taus: Vec<f64> = supposed.iter().map(|s| s.tau).collect();
    let mut step = 0;
    loop {
        let deviance: Vec<f64> =
            supposed.iter().map(|s| s.ln_det + s.base.project(&s.residual).norm_squared()).collect();
        let expected = root_mean_square(&weights(&taus, &deviance), &taus, 0.0);
        let found = Scatter { tests: expected, order: expected };
        let Some(sharpest) = supposed.first().filter(|_| step < at_most) else { return found };
        let first = tested(std::slice::from_ref(sharpest), library, pure).swap_remove(0);
        let (some, tests) = sensible(&first.scores, library);
        let tested = tested(&supposed, &some, pure);
        let Some(best) = leading(&taus, &tested, &some, &tests).filter(|best| step == 0 || best.passes) else {
            // with nothing in the model tests must not be sure of a scatter that is not
            let bound = root_mean_square(&weights(&taus, &deviance), &taus, 2.0);
            return if step == 0 { Scatter { tests: bound, order: bound } } else { found };
        };
        if !best.passes {
            let with: Vec<f64> = tested.iter().map(|t| t.with(best.candidate, best.variant)).collect();
            return Scatter {
                tests: root_mean_square(&weights(&taus, &deviance), &taus, 2.0),
                order: root_mean_square(&weights(&taus, &with), &taus, 0.0),
            };
        }
        for (s, t) in supposed.iter_mut().zip(&tested) {
            let mut columns = some.columns(best.candidate, best.variant);
            (s.change)(columns.as_view_mut());
            s.ln_det += t.scores[best.candidate].ln_left[best.variant];
            if s.base.extend(&columns, KEPT) == 0 {
                return found;
            }
        }
        step += 1;
    }
}

/// The candidates that pass their test without any scatter, the most significant ones: others do not pass with some. And how many
/// tests there are in the family of each.
fn sensible(scores: &[Score], library: &Library) -> (Library, Vec<f64>) {
    /// So many at most.
    const MOST: usize = 40;
    let mut passing: Vec<usize> =
        (0..scores.len()).filter(|&c| scores[c].visible() && scores[c].p_adjusted < FAMILY_LEVEL).collect();
    passing.sort_by(|&a, &b| scores[a].ln_p.total_cmp(&scores[b].ln_p));
    passing.truncate(MOST);
    passing.sort_unstable();
    let of_family = |c: usize| {
        let same = |s: &&Score| s.visible() && family(library, s.candidate) == family(library, c);
        scores.iter().filter(same).count() as f64
    };
    (library.some(|c| passing.binary_search(&c).is_ok()), passing.iter().map(|&c| of_family(c)).collect())
}

/// The root of the mean square and some standard deviations of it.
fn root_mean_square(weights: &[f64], taus: &[f64], deviations: f64) -> f64 {
    let mean = |of: &dyn Fn(f64) -> f64| weights.iter().zip(taus).map(|(w, tau)| w * of(tau * tau)).sum::<f64>();
    let square = mean(&|t| t);
    (square + deviations * mean(&|t| (t - square).powi(2)).sqrt()).sqrt()
}

fn tested(supposed: &[Supposed], library: &Library, pure: Option<PureError>) -> Vec<Tested> {
    let each = supposed.iter().map(|s| Regression { residual: &s.residual, base: &s.base, change: Some(s.change) });
    let moments = Moments::of_each(&each.collect::<Vec<_>>(), library);
    let ln_det: Vec<f64> = supposed.iter().map(|s| s.ln_det).collect();
    let of = |(m, ln_det): (&Moments, &f64)| Tested { deviance: ln_det + m.rr, scores: score(m, library, pure) };
    moments.par_iter().zip(&ln_det).map(of).collect()
}

/// A candidate with a variant, and whether it passes its test.
#[derive(Debug, Clone, Copy)]
struct Leading {
    candidate: usize,
    variant: usize,
    passes: bool,
}

/// The most significant candidate. A probability is the mean over the scatters that are likely with the candidate: with few groups
/// of rows many scatters are.
fn leading(taus: &[f64], tested: &[Tested], library: &Library, tests: &[f64]) -> Option<Leading> {
    let all = (0..library.candidates().len()).filter_map(|c| {
        let variants = 0..library.candidates()[c].variants.len();
        let each = variants.flat_map(|v| tested.iter().map(move |t| (t, v)));
        let (_, variant) = each.min_by(|a, b| a.0.with(c, a.1).total_cmp(&b.0.with(c, b.1)))?;
        let deviance: Vec<f64> = tested.iter().map(|t| t.with(c, variant)).collect();
        let ln_p = ln_mean(&weights(taus, &deviance), tested.iter().map(|t| t.scores[c].ln_p));
        // the first step of Holm's test
        let passes = ln_p + tests[c].ln() < multiplicity::level_of(family(library, c)).ln();
        let named = library.candidates()[c].origin != Origin::Generic;
        Some((Leading { candidate: c, variant, passes }, !named, ln_p))
    });
    // what passes goes before what does not, and a name before a pattern
    let rank = |l: &(Leading, bool, f64)| (!l.0.passes, l.1);
    let best = all.min_by(|a, b| rank(a).cmp(&rank(b)).then(a.2.total_cmp(&b.2)))?;
    Some(best.0)
}

/// Weights of supposed scatters from −2 ln L at each, as an integral over them has them; their sum is 1.
fn weights(at: &[f64], deviance: &[f64]) -> Vec<f64> {
    let least = deviance.iter().copied().fold(f64::INFINITY, f64::min);
    let width = |k: usize| (at[(k + 1).min(at.len() - 1)] - at[k.saturating_sub(1)]) / 2.0;
    let each: Vec<f64> = (0..at.len()).map(|k| width(k) * (-0.5 * (deviance[k] - least)).exp()).collect();
    let total: f64 = each.iter().sum();
    each.iter().map(|w| w / total).collect()
}

/// Logarithm of a weighted mean of numbers that are given by theirs.
fn ln_mean(weights: &[f64], ln: impl Iterator<Item = f64>) -> f64 {
    let parts: Vec<f64> = weights.iter().zip(ln).filter(|(w, _)| **w > 0.0).map(|(w, ln)| w.ln() + ln).collect();
    let largest = parts.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    if largest.is_finite() { largest + parts.iter().map(|p| (p - largest).exp()).sum::<f64>().ln() } else { largest }
}
