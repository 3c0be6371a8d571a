//! The scatter of groups of rows under each hypothesis, by restricted maximum likelihood.
//!
//! Touches of one index position share a displacement, and nobody knows how much it scatters. An effect that is missing in the
//! model looks like scatter; once it is in the model the scatter is small. The same regression is therefore tested with several
//! supposed scatters, and each candidate counts with those that are likely if the candidate is there (Patterson and Thompson,
//! Biometrika 58 (1971) 545): −2 ln L = ln|V| + ln|XᵀV⁻¹X| + rᵀPr.

use super::basis::Basis;
use super::library::{Library, Origin};
use super::moments::{Change, KEPT, Moments};
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

/// The scatter that is to be expected once the candidates are in the model that pass their test, each averaged over the scatters that are likely with
/// it, one after the other, `at_most` of them. Where none passes, an upper bound.
#[must_use]
pub fn scatter_that_fits(
    mut supposed: Vec<Supposed>,
    library: &Library,
    pure: Option<PureError>,
    at_most: usize,
) -> f64 {
    let taus: Vec<f64> = supposed.iter().map(|s| s.tau).collect();
    for step in 0.. {
        let tested: Vec<Tested> = supposed.par_iter().map(|s| tested(s, library, pure)).collect();
        let deviance: Vec<f64> = tested.iter().map(|t| t.deviance).collect();
        // with nothing in the model tests must not be sure of a scatter that is not
        let bound = root_mean_square(&weights(&taus, &deviance), &taus, if step == 0 { 2.0 } else { 0.0 });
        if step == at_most {
            return bound;
        }
        let Some((candidate, variant)) = leading(&taus, &tested, library) else { return bound };
        for (s, t) in supposed.iter_mut().zip(&tested) {
            let mut columns = library.columns(candidate, variant);
            (s.change)(&mut columns);
            s.ln_det += t.scores[candidate].ln_left[variant];
            if s.base.extend(&columns, KEPT) == 0 {
                return bound;
            }
        }
    }
    0.0
}

/// The root of the mean square and some standard deviations of it.
fn root_mean_square(weights: &[f64], taus: &[f64], deviations: f64) -> f64 {
    let mean = |of: &dyn Fn(f64) -> f64| weights.iter().zip(taus).map(|(w, tau)| w * of(tau * tau)).sum::<f64>();
    let square = mean(&|t| t);
    (square + deviations * mean(&|t| (t - square).powi(2)).sqrt()).sqrt()
}

fn tested(supposed: &Supposed, library: &Library, pure: Option<PureError>) -> Tested {
    let moments = Moments::changed(&supposed.residual, &supposed.base, library, supposed.change);
    Tested { deviance: supposed.ln_det + moments.rr, scores: score(&moments, library, pure) }
}

/// The most significant candidate that passes its test, and its variant. A probability is the mean over the scatters that are
/// likely with the candidate: with few groups of rows many scatters are.
fn leading(taus: &[f64], tested: &[Tested], library: &Library) -> Option<(usize, usize)> {
    let mut own: Vec<(Score, usize)> = (0..library.candidates().len())
        .filter_map(|c| {
            let variants = 0..library.candidates()[c].variants.len();
            let all = variants.flat_map(|v| tested.iter().map(move |t| (t, v)));
            let (best, variant) = all.min_by(|a, b| a.0.with(c, a.1).total_cmp(&b.0.with(c, b.1)))?;
            let deviance: Vec<f64> = tested.iter().map(|t| t.with(c, variant)).collect();
            let mut score = best.scores[c].clone();
            score.ln_p = ln_mean(&weights(taus, &deviance), tested.iter().map(|t| t.scores[c].ln_p));
            score.p = score.ln_p.exp();
            Some((score, variant))
        })
        .collect();
    let mut scores: Vec<Score> = own.iter().map(|o| o.0.clone()).collect();
    multiplicity::adjust(&mut scores, |s| family(library, s.candidate));
    own.iter_mut().zip(scores).for_each(|(o, s)| o.0 = s);
    let passed = own.iter().filter(|(s, _)| s.visible() && s.p_adjusted < FAMILY_LEVEL);
    let named = |s: &Score| library.candidates()[s.candidate].origin != Origin::Generic;
    let best = passed.min_by(|(a, _), (b, _)| named(b).cmp(&named(a)).then(a.ln_p.total_cmp(&b.ln_p)))?;
    Some((best.0.candidate, best.1))
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
