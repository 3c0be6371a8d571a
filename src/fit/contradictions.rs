//! What the user states of a parameter, against what the touches say of it.

use super::normal::Touches;
use super::uncertainty::free_covariance;
use super::{Fit, Knowledge, Settings, profile};
use crate::machine::Machine;
use crate::model::catalogue::Effect;
use nalgebra::DVector;

/// A value that the user states and that the touches contradict.
#[derive(Debug, Clone)]
pub(super) struct Contradiction {
    /// In words.
    pub says: String,
    /// By how much χ² would fall without it.
    pub chi2: f64,
}

/// Further apart than this many standard deviations, what is stated and what the touches say contradict each other; the
/// chance of that is 6e-5 where both are right.
const CONTRADICTS: f64 = 4.0;

/// Priors and held values that the touches contradict: each compared with the estimate without it (a rank-one downdate; of a shape
/// parameter its likelihood profile), at the scatter that the touches would then have.
pub(super) fn contradictions(
    fit: &Fit,
    machine: &Machine,
    effects: &[&Effect],
    settings: &Settings,
) -> Vec<Contradiction> {
    let scale2 = |falls: f64| ((fit.chi2 - falls).max(0.0) / fit.dof.saturating_sub(1).max(1) as f64).max(1.0);
    let mut out = Vec::new();
    for &(i, stated, sigma) in &fit.priors {
        if fit.model.unknowns[i].shape {
            out.extend(of_a_shape(fit, machine, effects, (i, stated, Some(sigma)), scale2));
            continue;
        }
        let (variance, prior) = (fit.covariance[(i, i)], sigma * sigma);
        let rest = 1.0 / variance - 1.0 / prior;
        // the touches say next to nothing of it
        if !rest.is_finite() || rest <= 1e-9 / prior {
            continue;
        }
        let alone = (fit.theta[i] / variance - stated / prior) / rest;
        let falls = (alone - stated).powi(2) / (1.0 / rest + prior);
        let own = (scale2(falls) / rest).sqrt();
        let apart = (alone - stated).abs() / own.hypot(sigma);
        if apart > CONTRADICTS {
            let u = &fit.model.unknowns[i];
            out.push(Contradiction {
                says: format!(
                    "the touches contradict the prior of {}: it says {stated} ± {sigma} {}, and without it they say {} ± {} ({apart:.0} standard deviations apart); check it, or give it a larger sigma",
                    u.name,
                    u.unit,
                    with_digits(alone, own),
                    with_digits(own, own)
                ),
                chi2: falls,
            });
        }
    }
    out.extend(held_contradictions(fit, scale2));
    // of shapes only what the user holds: the search holds some by itself
    let by_search = |name: &String| settings.held.contains(name) || settings.jumps.contains(name);
    for (i, _) in fit.model.unknowns.iter().enumerate().filter(|(_, u)| u.shape && !by_search(&u.name)) {
        if let Some(Knowledge::Fixed(stated)) = fit.knowledge[i] {
            out.extend(of_a_shape(fit, machine, effects, (i, stated, None), scale2));
        }
    }
    out
}

/// The same of a shape parameter, which the touches do not follow evenly: a line through the solution may lead to a negative time
/// constant.
fn of_a_shape(
    fit: &Fit,
    machine: &Machine,
    effects: &[&Effect],
    (i, stated, sigma): (usize, f64, Option<f64>),
    scale2: impl Fn(f64) -> f64 + Copy,
) -> Option<Contradiction> {
    let alone = profile::without_prior(fit, machine, effects, i, scale2)?;
    let apart = (alone.falls / scale2(alone.falls)).max(0.0).sqrt();
    let u = &fit.model.unknowns[i];
    let [low, high] = alone.interval;
    let doubt = 0.25 * (high - low);
    let (name, unit) = (&u.name, &u.unit);
    let they = format!(
        "they say {} (95 % between {} and {}; {apart:.0} standard deviations apart)",
        with_digits(alone.value, doubt),
        with_digits(low, doubt),
        with_digits(high, doubt),
    );
    let says = match sigma {
        Some(sigma) => format!(
            "the touches contradict the prior of {name}: it says {stated} ± {sigma} {unit}, and without it {they}; check it, or give it a larger sigma"
        ),
        None => format!(
            "the touches contradict the held value of {name}: it is held at {stated} {unit}, and if it were free {they}; check it, or let it free"
        ),
    };
    (apart > CONTRADICTS).then_some(Contradiction { says, chi2: alone.falls })
}

/// The same for held values: the score test of each, and what the touches would make of it.
fn held_contradictions(fit: &Fit, scale2: impl Fn(f64) -> f64) -> Vec<Contradiction> {
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
        // the other parameters follow it: nothing tells it from them
        if information.is_nan() || information <= 1e-9 * column.norm_squared() || information == 0.0 {
            continue;
        }
        let by = -own.dot(&residual) / information;
        let falls = by * by * information;
        let sigma = (scale2(falls) / information).sqrt();
        let apart = by.abs() / sigma;
        if apart > CONTRADICTS {
            let (u, stated) = (&fit.model.unknowns[i], fit.theta[i]);
            out.push(Contradiction {
                says: format!(
                    "the touches contradict the held value of {}: it is held at {stated} {}, and if it were free they would say {} ± {} ({apart:.0} standard deviations away); check it, or let it free",
                    u.name,
                    u.unit,
                    with_digits(stated + by, sigma),
                    with_digits(sigma, sigma)
                ),
                chi2: falls,
            });
        }
    }
    out
}

/// A value with two digits of its uncertainty.
fn with_digits(value: f64, sigma: f64) -> String {
    let decimals = if sigma > 0.0 && sigma.is_finite() { (1.0 - sigma.log10().floor()).clamp(0.0, 12.0) } else { 6.0 };
    format!("{value:.*}", decimals as usize)
}
