//! Which of several minima a fit with shape parameters takes.

use super::nonlinear_scan;
use super::{Fit, Knowledge, Settings, identify_from};
use crate::diag::Result;
use crate::machine::Machine;
use crate::model::catalogue::{Catalogue, Effect};
use crate::model::predict::Unknown;
use nalgebra::DMatrix;
use std::collections::BTreeMap;

/// Moments of jumps were found beside a fit without the jump, which takes good touches about it for strangers: each is moved among the
/// touches next to it that show it, as long as that takes less against the touches, those included that are then rejected.
pub(super) fn better_moments(
    mut fit: Fit,
    (machine, catalogue): (&Machine, &Catalogue),
    effects: &[&Effect],
    mut settings: Settings,
) -> Result<Fit> {
    /// Stretches between touches on either side.
    const REACH: usize = 5;
    /// Times that one is moved.
    const MOST: usize = 4;
    /// A better place is better by more.
    const SAME: f64 = 1e-6;
    if settings.quick {
        return Ok(fit);
    }
    for name in settings.jumps.clone() {
        let (own, block) = name.split_once('@').map_or((name.as_str(), None), |(own, block)| (own, Some(block)));
        let Some(p) = effects.iter().flat_map(|e| &e.parameters).find(|p| p.name == own) else { continue };
        let stretches = nonlinear_scan::stretches_of_a_jump(p, &fit.data, block);
        for _ in 0..MOST {
            let Some(&Knowledge::Fixed(at)) = settings.knowledge.get(&name) else { break };
            let Some(here) = stretches.iter().position(|s| s.ends[0] <= at && at <= s.ends[1]) else { break };
            let last = (here + REACH).min(stretches.len().saturating_sub(1));
            let mut best: Option<(f64, f64)> = None;
            for k in (here.saturating_sub(REACH)..=last).filter(|k| *k != here) {
                let mut moved = Settings { quick: true, ..settings.clone() };
                hold(&mut moved, &name, stretches[k].place);
                let other = identify_from(machine, catalogue, effects, fit.data.clone(), &moved, &values(&fit))?;
                if nonlinear_scan::out_of_range(&other, catalogue, machine).is_some() {
                    continue;
                }
                let [here, there] = against([&fit, &other]);
                let gain = here - there;
                if gain > SAME * here && best.is_none_or(|(most, _)| gain > most) {
                    best = Some((gain, stretches[k].place));
                }
            }
            let Some((_, place)) = best else { break };
            hold(&mut settings, &name, place);
            let from = values(&fit);
            let next = identify_from(machine, catalogue, effects, fit.data.clone(), &settings, &from)?;
            if nonlinear_scan::out_of_range(&next, catalogue, machine).is_some() {
                hold(&mut settings, &name, at);
                break;
            }
            fit = next;
        }
    }
    Ok(fit)
}

/// A shape parameter that ran out of its range.
pub(super) struct OutOfRange<'a> {
    pub machine: &'a Machine,
    pub catalogue: &'a Catalogue,
    pub effects: &'a [&'a Effect],
    /// What the user says.
    pub settings: &'a Settings,
    pub starts: &'a BTreeMap<String, f64>,
    /// Its name, and the ends of its range.
    pub out: (String, [f64; 2]),
}

impl OutOfRange<'_> {
    /// The fit with it in its range again, searched for from where it began or held at an end, and what is to be said of it.
    pub fn back_into_it(&self, mut fit: Fit, held_settings: &mut Settings) -> Result<(Fit, Option<String>)> {
        let Self { machine, catalogue, effects, settings, starts, out: (name, ends_of) } = self;
        // a first step too far: everything else settles while the shape stays where it began, and the search goes on from there
        if let Some(&began) = starts.get(name) {
            let mut waiting = Settings { quick: true, ..held_settings.clone() };
            hold(&mut waiting, name, began);
            let settled = identify_from(machine, catalogue, effects, fit.data, &waiting, starts)?;
            let from = values(&settled);
            fit = identify_from(machine, catalogue, effects, settled.data, held_settings, &from)?;
            if nonlinear_scan::out_of_range(&fit, catalogue, machine).is_none_or(|(other, _)| other != *name) {
                return Ok((fit, None));
            }
        }
        // a step too far says nothing of the side: the end that fits better
        held_settings.held.push(name.clone());
        let mut held_at = |end: f64| {
            hold(held_settings, name, end);
            identify_from(machine, catalogue, effects, fit.data.clone(), held_settings, starts)
        };
        let [low, high] = [held_at(ends_of[0])?, held_at(ends_of[1])?];
        let [at_low, at_high] = against([&low, &high]);
        // what the user says of it counts, too
        let known = settings.knowledge.iter().find(|(word, _)| crate::symbols::same(word, name)).map(|(_, k)| *k);
        let stated = |end: f64| match known {
            Some(Knowledge::Prior { value, sigma }) => ((end - value) / sigma).powi(2),
            _ => 0.0,
        };
        let lower = at_low + stated(ends_of[0]) <= at_high + stated(ends_of[1]);
        hold(held_settings, name, ends_of[usize::from(!lower)]);
        let says = match known {
            Some(Knowledge::Prior { value, sigma }) => format!(
                "{name} ran out of its range in the search beside its prior of {value} ± {sigma}: touches and prior do not agree, or its range is too narrow; it stands at the end of its range that fits both better"
            ),
            _ => format!(
                "{name} ran out of its range in the search: these touches do not tell it, and it stands at the end of its range that fits better"
            ),
        };
        Ok((if lower { low } else { high }, Some(says)))
    }
}

/// Holds a parameter, whatever the user said of it: its exact name goes before any other spelling.
pub(super) fn hold(settings: &mut Settings, name: &str, value: f64) {
    settings.knowledge.insert(name.to_owned(), Knowledge::Fixed(value));
}

/// Values of all unknowns by name, to begin at. A shape that leaves no trace stands where it is because the sizes of its effect began at
/// none: beside what noise made of them it would run anywhere.
fn values(fit: &Fit) -> BTreeMap<String, f64> {
    /// A share of a combination that is rounding.
    const NONE: f64 = 1e-6;
    let unknowns = &fit.model.unknowns;
    let stands = |i: usize| {
        let column = fit.free.binary_search(&i).ok().filter(|_| unknowns[i].shape);
        column.is_some_and(|c| fit.observability.unseen.iter().any(|v| v[c].abs() > NONE))
    };
    let still: Vec<(&str, Option<usize>)> =
        (0..unknowns.len()).filter(|&i| stands(i)).map(|i| (unknowns[i].effect.as_str(), unknowns[i].set_up)).collect();
    let begins = |(u, value): (&Unknown, &f64)| {
        let of_it = !u.shape && still.contains(&(u.effect.as_str(), u.set_up));
        (u.name.clone(), if of_it { u.start } else { *value })
    };
    unknowns.iter().zip(&fit.theta).map(begins).collect()
}

/// What touches and priors have against each of two fits, by one measure: the smaller noise of the two hides less.
pub(super) fn against(fits: [&Fit; 2]) -> [f64; 2] {
    /// What a touch costs that is left out: about where one is.
    const LEFT_OUT: f64 = 12.0;
    let least = |of: fn(&Fit) -> f64| of(fits[0]).min(of(fits[1]));
    let noise_mm = (least(|f| f.noise.sigma_mm), least(|f| f.noise.tau_mm));
    fits.map(|fit| {
        let mut residual = DMatrix::from_column_slice(fit.residual_mm.len(), 1, &fit.residual_mm);
        fit.with_noise(noise_mm, |touches| touches.whitening()).apply(&mut residual);
        let known = fit.priors.iter().map(|&(i, value, sigma)| ((fit.theta[i] - value) / sigma).powi(2));
        residual.norm_squared() + known.sum::<f64>() + LEFT_OUT * fit.rejected.len() as f64
    })
}

/// Of several values of a shape parameter that fit about as well, each with a minimum of its own, the fit with the lowest one:
/// which of them the scan began at says little, because there everything else followed a straight line.
pub(super) fn best_minimum(
    mut fit: Fit,
    (machine, catalogue): (&Machine, &Catalogue),
    effects: &[&Effect],
    settings: &Settings,
) -> Result<Fit> {
    /// Going down from minimum to minimum comes to an end by itself; so many times is enough.
    const MOST: usize = 4;
    /// A lower one by less is the same one.
    const SAME: f64 = 1e-6;
    for _ in 0..MOST {
        let mut best: Option<(f64, Fit)> = None;
        let others = fit.other_values.iter().flat_map(|(i, all)| all.iter().map(move |v| (*i, *v)));
        for (unknown, value) in others {
            let quick = Settings { quick: true, ..settings.clone() };
            let mut waiting = quick.clone();
            hold(&mut waiting, &fit.model.unknowns[unknown].name, value);
            let settled = identify_from(machine, catalogue, effects, fit.data.clone(), &waiting, &values(&fit))?;
            let other = identify_from(machine, catalogue, effects, settled.data.clone(), &quick, &values(&settled))?;
            if nonlinear_scan::out_of_range(&other, catalogue, machine).is_some() {
                continue;
            }
            let [here, there] = against([&fit, &other]);
            let share = there / here;
            if share < 1.0 - SAME && best.as_ref().is_none_or(|(least, _)| share < *least) {
                best = Some((share, other));
            }
        }
        let Some((_, lower)) = best else { break };
        let from = values(&lower);
        let next = identify_from(machine, catalogue, effects, lower.data, settings, &from)?;
        if nonlinear_scan::out_of_range(&next, catalogue, machine).is_some() {
            break;
        }
        fit = next;
    }
    Ok(fit)
}
