//! The scatter of index positions as the residuals of a fit show it, where revisits do not tell it and only a declared value is known.
//!
//! Touches of one index position share a displacement: what the residuals of an index position have in common beyond the model says
//! how far it goes. Restricted maximum likelihood (Patterson and Thompson, Biometrika 58 (1971) 545):
//! −2 ln L = ln|V| + ln|XᵀV⁻¹X| + rᵀPr, with the declared value as one observation.

use super::Fit;
use super::remark::VisitSource;
use nalgebra::{DMatrix, Matrix3};

/// The scatter is looked for up to so many times the declared one: more is no scatter of an axis.
pub const MOST_TIMES: f64 = 3.0;

/// Values that are tried, from none to the largest.
const TRIED: usize = 25;

/// Least degrees of freedom: what is known beforehand bounds the scatter, so that its tail is short.
const LEAST_DOF: f64 = 4.0;

/// With more unknowns, or with more touches (first: in a trial fit, second: in any other), the declared value is taken.
const MOST_UNKNOWNS: usize = 200;
const MOST_TOUCHES: [usize; 2] = [2_000, 20_000];

/// Where −2 ln L of the residuals differs by less between all values that are tried, they say nothing, and the declared value is taken.
const NOTHING: f64 = 0.5;

/// What is known of the scatter before a measurement, as a part of −2 ln L: a declared value has a standard uncertainty of 140 %. With
/// 70 %, the 95 % intervals held 91 % where the true scatter is twice the declared one.
fn known_beforehand(tau_mm: f64, declared_mm: f64) -> f64 {
    0.5 * (tau_mm / declared_mm - 1.0).powi(2)
}

/// What the residuals say of the scatter.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Shown {
    /// Root of the mean square of the scatters that are likely, mm.
    pub tau_mm: f64,
    /// Degrees of freedom of its square.
    pub dof: f64,
}

/// The scatter of index positions; `None` where it is known otherwise.
pub(super) fn residual_scatter(fit: &Fit, is_trial: bool) -> Option<Shown> {
    let (sigma_mm, declared_mm) = (fit.noise.sigma_mm, fit.noise.tau_mm);
    let is_small =
        fit.free.len() <= MOST_UNKNOWNS && fit.data.observations.len() <= MOST_TOUCHES[usize::from(!is_trial)];
    if fit.noise.visit_source != VisitSource::Declared || declared_mm <= 0.0 || !is_small {
        return None;
    }
    // the directions that leave a trace, and the residuals behind them: rows in units of a touch's noise
    let linear = fit.linear(0.0);
    let mut to_seen = fit.seen.seen.clone();
    for (mut row, scale) in to_seen.row_iter_mut().zip(fit.seen.scale.iter()) {
        row /= *scale;
    }
    let r = to_seen.ncols();
    let mut rows = (&linear.jacobian * to_seen).resize_horizontally(r + 1, 0.0);
    rows.set_column(r, &linear.residual);
    let gram = rows.tr_mul(&rows);
    // of each index position: Σn·nᵀ and what its displacement sees of the rows
    let visits: Vec<(Matrix3<f64>, DMatrix<f64>)> = fit.with_touches(0.0, |touches| {
        let of = |visit: std::ops::Range<usize>| {
            let mut sees = DMatrix::zeros(3, r + 1);
            for i in visit.clone() {
                sees.ger(fit.weight[i].sqrt(), &touches.normal_in_r(i), &rows.row(i).transpose(), 1.0);
            }
            (touches.normals_square(visit), sees)
        };
        touches.visits_in(0..fit.data.observations.len()).into_iter().map(of).collect()
    });
    let deviance = |tau_mm: f64| {
        let rho2 = (tau_mm / sigma_mm).powi(2);
        let (mut left, mut ln_det) = (gram.clone(), 0.0);
        for (square, sees) in &visits {
            let spread = Matrix3::identity() + square * rho2;
            ln_det += spread.determinant().ln();
            left -= sees.tr_mul(&(spread.try_inverse()? * rho2 * sees));
        }
        let factor = left.cholesky()?.unpack();
        let of_model: f64 = (0..r).map(|k| 2.0 * factor[(k, k)].ln()).sum();
        Some(ln_det + of_model + factor[(r, r)].powi(2))
    };
    let taus = (0..TRIED).map(|k| MOST_TIMES * declared_mm * k as f64 / (TRIED - 1) as f64);
    let shown: Vec<(f64, f64)> = taus.map(|tau| Some((tau, deviance(tau)?))).collect::<Option<_>>()?;
    let ends = shown.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), (_, d)| (a.min(*d), b.max(*d)));
    if ends.1 - ends.0 < NOTHING {
        return None;
    }
    let each: Vec<(f64, f64)> =
        shown.into_iter().map(|(tau, d)| (tau, d + known_beforehand(tau, declared_mm))).collect();
    let least = each.iter().map(|(_, deviance)| *deviance).fold(f64::INFINITY, f64::min);
    let likely = |deviance: f64| (-0.5 * (deviance - least)).exp();
    let all: f64 = each.iter().map(|(_, deviance)| likely(*deviance)).sum();
    let mean = |of: &dyn Fn(f64) -> f64| each.iter().map(|(tau, d)| likely(*d) * of(tau * tau)).sum::<f64>() / all;
    // a value lies anywhere within its step
    let step_mm = MOST_TIMES * declared_mm / (TRIED - 1) as f64;
    let within = step_mm * step_mm / 12.0;
    let square = mean(&|t| t) + within;
    let variance = mean(&|t| (t + within - square).powi(2)) + 4.0 * square * within;
    // a variance that is estimated with ν degrees of freedom has a variance of its own of 2/ν of its square
    let dof = 2.0 * square * square / variance;
    // more than the largest that is tried is possible: nothing is sure then
    let is_beyond = each.last().is_some_and(|(_, deviance)| *deviance <= least);
    let dof = if is_beyond { LEAST_DOF } else { dof.max(LEAST_DOF) };
    Some(Shown { tau_mm: square.sqrt(), dof }).filter(|s| s.tau_mm.is_finite() && s.dof.is_finite())
}
