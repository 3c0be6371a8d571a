//! What the user states of a parameter, against what the touches say of it.

use super::normal::Touches;
use super::remark::{Contradiction, Found};
use super::shape_search::Asked;
use super::uncertainty::free_covariance;
use super::{Fit, Knowledge, profile};
use nalgebra::DVector;

/// Further apart than this many standard deviations, what is stated and what the touches say contradict each other; the
/// chance of that is 6e-5 where both are right.
const CONTRADICTS: f64 = 4.0;

/// Priors and held values that the touches contradict: each compared with the estimate without it (a rank-one downdate; of a shape
/// parameter its likelihood profile), at the scatter that the touches would then have.
pub(super) fn contradictions(fit: &Fit, asked: &Asked) -> Vec<Contradiction> {
    let scale2 = |falls: f64| ((fit.chi2 - falls).max(0.0) / fit.dof.saturating_sub(1).max(1) as f64).max(1.0);
    let mut out = Vec::new();
    for &(i, stated, sigma) in &fit.priors {
        if fit.model.unknowns[i].shape {
            out.extend(of_a_shape(fit, asked, (i, stated, Some(sigma)), scale2));
            continue;
        }
        let (variance, prior) = (fit.covariance[(i, i)], sigma * sigma);
        let rest = 1.0 / variance - 1.0 / prior;
        // the touches say next to nothing of it
        if !rest.is_finite() || rest <= 1e-9 / prior {
            continue;
        }
        let value = (fit.theta[i] / variance - stated / prior) / rest;
        let chi2 = (value - stated).powi(2) / (1.0 / rest + prior);
        let own = (scale2(chi2) / rest).sqrt();
        let apart = (value - stated).abs() / own.hypot(sigma);
        out.push(Contradiction {
            value,
            found: Found::Sigma(own),
            apart,
            chi2,
            ..contradiction(fit, (i, stated, Some(sigma)))
        });
    }
    out.extend(of_held_sizes(fit, scale2));
    // of shapes only what the user holds: the search holds some by itself
    let by_search = |name: &String| asked.search.held.contains(name) || asked.search.jumps.contains(name);
    for (i, _) in fit.model.unknowns.iter().enumerate().filter(|(_, u)| u.shape && !by_search(&u.name)) {
        if let Some(Knowledge::Fixed(stated)) = fit.knowledge[i] {
            out.extend(of_a_shape(fit, asked, (i, stated, None), scale2));
        }
    }
    out.retain(|c| c.apart > CONTRADICTS);
    out
}

/// What is stated of an unknown, with nothing found yet.
fn contradiction(fit: &Fit, (i, stated, sigma): (usize, f64, Option<f64>)) -> Contradiction {
    let u = &fit.model.unknowns[i];
    let (name, unit) = (u.name.clone(), u.unit.clone());
    Contradiction { name, unit, stated, sigma, value: stated, found: Found::Sigma(0.0), apart: 0.0, chi2: 0.0 }
}

/// The same of a shape parameter, on which the touches do not depend evenly: a line through the solution may lead to a negative time
/// constant.
fn of_a_shape(
    fit: &Fit,
    asked: &Asked,
    known: (usize, f64, Option<f64>),
    scale2: impl Fn(f64) -> f64 + Copy,
) -> Option<Contradiction> {
    let alone = profile::without_prior(fit, asked.machine, asked.effects, known.0, scale2)?;
    let apart = (alone.falls / scale2(alone.falls)).max(0.0).sqrt();
    let (value, found) = (alone.value, Found::Interval(alone.interval));
    Some(Contradiction { value, found, apart, chi2: alone.falls, ..contradiction(fit, known) })
}

/// The same for held sizes: the score test of each, and what the touches would make of it.
fn of_held_sizes(fit: &Fit, scale2: impl Fn(f64) -> f64) -> Vec<Contradiction> {
    let held: Vec<usize> = (0..fit.theta.len())
        .filter(|&i| matches!(fit.knowledge[i], Some(Knowledge::Fixed(_))) && !fit.model.unknowns[i].shape)
        .collect();
    if held.is_empty() {
        return Vec::new();
    }
    let batch = fit.model.prepare(&fit.data.observations);
    let noise = (fit.noise.sigma_mm, fit.noise.tau_mm);
    let all: Vec<usize> = (0..fit.theta.len()).collect();
    let mut touches = Touches::new(&batch, &fit.data.visits, fit.theta.clone(), &all, &fit.priors, noise);
    touches.set_weights(fit.weight.clone());
    let (residual, jacobian) = touches.dense(&DVector::from_column_slice(&fit.theta));
    let free = jacobian.select_columns(&fit.free);
    let covariance = free_covariance(fit);
    let mut out = Vec::new();
    for i in held {
        let column = jacobian.column(i).into_owned();
        let own = &column - &free * (&covariance * free.tr_mul(&column));
        let information = own.norm_squared();
        // the other parameters follow it: nothing separates it from them
        if information.is_nan() || information <= 1e-9 * column.norm_squared() || information == 0.0 {
            continue;
        }
        let by = -own.dot(&residual) / information;
        let chi2 = by * by * information;
        let sigma = (scale2(chi2) / information).sqrt();
        let (stated, apart) = (fit.theta[i], by.abs() / sigma);
        let value = stated + by;
        out.push(Contradiction {
            value,
            found: Found::Sigma(sigma),
            apart,
            chi2,
            ..contradiction(fit, (i, stated, None))
        });
    }
    out
}
