//! Where a fit with shape parameters begins, and which of several minima it takes.

use super::shapes;
use super::whitening::Whitening;
use super::{Fit, Knowledge, Settings, effects_of, identify_from};
use crate::diag::Result;
use crate::machine::Machine;
use crate::model::catalogue::{Catalogue, Effect, Parameter};
use crate::model::data::Data;
use nalgebra::DMatrix;
use std::collections::BTreeMap;

/// Fits a model to assembled data.
///
/// # Errors
/// As [`identify`](super::identify).
pub fn identify_data(machine: &Machine, catalogue: &Catalogue, data: Data, settings: &Settings) -> Result<Fit> {
    let effects = effects_of(&settings.effects, catalogue, machine)?;
    let of_blocks = data.set_ups.len() > 1 && effects.iter().any(|e| e.per_block && has_shapes(e));
    let alike =
        if of_blocks { Some(from_starts(machine, catalogue, &effects, data.clone(), settings, true)?) } else { None };
    let fit = from_starts(machine, catalogue, &effects, data, settings, false)?;
    let Some(alike) = alike else { return Ok(fit) };
    // by one measure: the smaller scatter of visits hides less
    let white = fit.whitening(fit.noise.tau_mm.min(alike.noise.tau_mm));
    Ok(if misfit(&alike, &white) < misfit(&fit, &white) { alike } else { fit })
}

fn has_shapes(effect: &Effect) -> bool {
    effect.parameters.iter().any(|p| p.shape.is_some())
}

/// The fit from where each shape alone fits best, or, `alike`, from shapes that the sets of all blocks share: what changes slowly on
/// every block is scatter of the visits to one block alone.
fn from_starts(
    machine: &Machine,
    catalogue: &Catalogue,
    effects: &[&Effect],
    data: Data,
    settings: &Settings,
    alike: bool,
) -> Result<Fit> {
    let mut starts = BTreeMap::new();
    let shaped = effects.iter().copied().filter(|e| has_shapes(e));
    let unseen = look_for((machine, catalogue), shaped.collect(), &data, (settings, alike), &mut starts)?;
    let fit = identify_started(machine, catalogue, effects, data, settings, &starts)?;
    // what an effect changes from one visit to the next is scatter of the visits to a fit without it, which then hardly sees it:
    // where less scatter is left beside it, that is what it is judged by
    let Some(unseen) = unseen.filter(|u| fit.noise.tau_mm < u.tau_mm) else { return Ok(fit) };
    let calm = Settings { visit_sigma_mm: Some(fit.noise.tau_mm), ..settings.clone() };
    let n_unseen = unseen.effects.len();
    let still = look_for((machine, catalogue), unseen.effects, &fit.data, (&calm, alike), &mut starts)?;
    if still.is_some_and(|s| s.effects.len() == n_unseen) {
        return Ok(fit);
    }
    identify_started(machine, catalogue, effects, fit.data, settings, &starts)
}

/// Effects with shape parameters that the data does not show, and with which scatter of index visits, mm.
struct Unseen<'e> {
    effects: Vec<&'e Effect>,
    tau_mm: f64,
}

/// Where the search begins for effects with shape parameters, by name of the unknown, beside the fit of everything else; what
/// the data does not show is handed back.
fn look_for<'e>(
    (machine, catalogue): (&Machine, &Catalogue),
    shaped: Vec<&'e Effect>,
    data: &Data,
    (settings, alike): (&Settings, bool),
    starts: &mut BTreeMap<String, f64>,
) -> Result<Option<Unseen<'e>>> {
    if shaped.is_empty() || data.observations.is_empty() {
        return Ok(None);
    }
    let base = shapes::without(settings, &shaped);
    let others = effects_of(&base.effects, catalogue, machine)?;
    let fit = identify_started(machine, catalogue, &others, data.clone(), &base, starts)?;
    let mut unseen = Unseen { effects: Vec::new(), tau_mm: fit.noise.tau_mm };
    for effect in shaped {
        let found = shapes::start_shapes(&fit, machine, effect, alike);
        if found.iter().any(|s| !s.shown) {
            unseen.effects.push(effect);
        }
        starts.extend(found.into_iter().flat_map(|s| s.names.into_iter().zip(s.values)));
    }
    Ok(Some(unseen).filter(|u| !u.effects.is_empty()))
}

/// Fits a model from given starts: where something jumps, and what runs out of its range, is held.
fn identify_started(
    machine: &Machine,
    catalogue: &Catalogue,
    effects: &[&Effect],
    data: Data,
    settings: &Settings,
    starts: &BTreeMap<String, f64>,
) -> Result<Fit> {
    let mut held_settings = settings.clone();
    for effect in effects.iter().filter(|e| has_shapes(e)) {
        let blocks: Vec<String> = data.set_ups.iter().map(|s| format!("@{}", s.label)).collect();
        for block in if effect.per_block { blocks } else { vec![String::new()] } {
            let named = |name: &str| format!("{name}{block}");
            let value = |p: &Parameter| starts.get(&named(&p.name)).copied().unwrap_or(0.0);
            let values: Vec<f64> = effect.parameters.iter().map(value).collect();
            // what the data does not show has no place to be held at
            if effect.parameters.iter().zip(&values).all(|(p, v)| p.shape.is_some() || *v == 0.0) {
                continue;
            }
            for (name, value) in shapes::jumps(effect, &values, &data) {
                let name = named(name);
                if !held_settings.knowledge.keys().any(|word| crate::symbols::same(word, &name)) {
                    held_settings.knowledge.insert(name.clone(), Knowledge::Fixed(value));
                    held_settings.jumps.push(name);
                }
            }
        }
    }
    let mut fit = identify_from(machine, catalogue, effects, data, &held_settings, starts)?;
    let mut said = Vec::new();
    // each may come out of its range twice: before and after another one is held
    for _ in 0..2 * fit.model.unknowns.iter().filter(|u| u.shape).count() {
        let Some(out) = shapes::out_of_range(&fit, catalogue, machine) else { break };
        let of = OutOfRange { machine, catalogue, effects, settings, starts, out };
        let (next, warning) = of.back_into_it(fit, &mut held_settings)?;
        fit = next;
        said.extend(warning);
    }
    let fit = best_minimum(fit, (machine, catalogue), effects, &held_settings)?;
    let mut fit = better_moments(fit, (machine, catalogue), effects, held_settings)?;
    fit.outcome.warnings.extend(said);
    Ok(fit)
}

/// Moments of jumps were found beside a fit without the jump, which takes good touches about it for strangers: each is moved among the
/// touches next to it that show it, as long as that takes less against the touches, those included that are then rejected.
fn better_moments(
    mut fit: Fit,
    (machine, catalogue): (&Machine, &Catalogue),
    effects: &[&Effect],
    mut settings: Settings,
) -> Result<Fit> {
    /// Stretches between touches on either side.
    const REACH: usize = 5;
    /// Times that one is moved.
    const MOST: usize = 4;
    /// What a touch costs that is rejected: about where one is.
    const REJECTED: f64 = 12.0;
    /// A better place is better by more.
    const SAME: f64 = 1e-6;
    if settings.quick {
        return Ok(fit);
    }
    for name in settings.jumps.clone() {
        let (own, block) = name.split_once('@').map_or((name.as_str(), None), |(own, block)| (own, Some(block)));
        let Some(p) = effects.iter().flat_map(|e| &e.parameters).find(|p| p.name == own) else { continue };
        let stretches = shapes::stretches_of_a_jump(p, &fit.data, block);
        for _ in 0..MOST {
            let Some(&Knowledge::Fixed(at)) = settings.knowledge.get(&name) else { break };
            let Some(here) = stretches.iter().position(|s| s.ends[0] <= at && at <= s.ends[1]) else { break };
            let last = (here + REACH).min(stretches.len().saturating_sub(1));
            let mut best: Option<(f64, f64)> = None;
            for k in (here.saturating_sub(REACH)..=last).filter(|k| *k != here) {
                let mut moved = Settings { quick: true, ..settings.clone() };
                hold(&mut moved, &name, stretches[k].place);
                let other = identify_from(machine, catalogue, effects, fit.data.clone(), &moved, &values(&fit))?;
                let tau_mm = fit.noise.tau_mm.min(other.noise.tau_mm);
                let cost = |f: &Fit| misfit(f, &f.whitening(tau_mm)) + REJECTED * f.rejected.len() as f64;
                let gain = cost(&fit) - cost(&other);
                if gain > SAME * cost(&fit) && best.is_none_or(|(most, _)| gain > most) {
                    best = Some((gain, stretches[k].place));
                }
            }
            let Some((_, place)) = best else { break };
            hold(&mut settings, &name, place);
            let from = values(&fit);
            fit = identify_from(machine, catalogue, effects, fit.data, &settings, &from)?;
        }
    }
    Ok(fit)
}

/// A shape parameter that ran out of its range.
struct OutOfRange<'a> {
    machine: &'a Machine,
    catalogue: &'a Catalogue,
    effects: &'a [&'a Effect],
    /// What the user says.
    settings: &'a Settings,
    starts: &'a BTreeMap<String, f64>,
    /// Its name, and the ends of its range.
    out: (String, [f64; 2]),
}

impl OutOfRange<'_> {
    /// The fit with it in its range again, searched for from where it began or held at an end, and what is to be said of it.
    fn back_into_it(&self, mut fit: Fit, held_settings: &mut Settings) -> Result<(Fit, Option<String>)> {
        let Self { machine, catalogue, effects, settings, starts, out: (name, ends_of) } = self;
        // a first step too far: everything else settles while the shape stays where it began, and the search goes on from there
        if let Some(&began) = starts.get(name) {
            let mut waiting = Settings { quick: true, ..held_settings.clone() };
            hold(&mut waiting, name, began);
            let settled = identify_from(machine, catalogue, effects, fit.data, &waiting, starts)?;
            let from = values(&settled);
            fit = identify_from(machine, catalogue, effects, settled.data, held_settings, &from)?;
            if shapes::out_of_range(&fit, catalogue, machine).is_none_or(|(other, _)| other != *name) {
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
        // by one measure: the smaller scatter of visits hides less
        let white = low.whitening(low.noise.tau_mm.min(high.noise.tau_mm));
        // what the user says of it counts, too
        let known = settings.knowledge.iter().find(|(word, _)| crate::symbols::same(word, name)).map(|(_, k)| *k);
        let against = |end: f64| match known {
            Some(Knowledge::Prior { value, sigma }) => ((end - value) / sigma).powi(2),
            _ => 0.0,
        };
        let lower = misfit(&low, &white) + against(ends_of[0]) <= misfit(&high, &white) + against(ends_of[1]);
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

/// Holds a parameter, whatever the user said of it and by whatever spelling.
fn hold(settings: &mut Settings, name: &str, value: f64) {
    settings.knowledge.retain(|word, _| !crate::symbols::same(word, name));
    settings.knowledge.insert(name.to_owned(), Knowledge::Fixed(value));
}

/// Values of all unknowns by name.
fn values(fit: &Fit) -> BTreeMap<String, f64> {
    fit.model.unknowns.iter().zip(&fit.theta).map(|(u, v)| (u.name.clone(), *v)).collect()
}

/// What touches and priors have against a fit, by a given measure.
fn misfit(fit: &Fit, white: &Whitening) -> f64 {
    let mut residual = DMatrix::from_column_slice(fit.residual_mm.len(), 1, &fit.residual_mm);
    white.apply(&mut residual);
    let known = fit.priors.iter().map(|&(i, value, sigma)| ((fit.theta[i] - value) / sigma).powi(2));
    residual.norm_squared() + known.sum::<f64>()
}

/// Of several values of a shape parameter that fit about as well, each with a minimum of its own, the fit with the lowest one:
/// which of them the scan began at says little, because there everything else followed a straight line.
fn best_minimum(
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
            if shapes::out_of_range(&other, catalogue, machine).is_some() {
                continue;
            }
            // by one measure: the smaller scatter of visits hides less
            let white = fit.whitening(fit.noise.tau_mm.min(other.noise.tau_mm));
            let share = misfit(&other, &white) / misfit(&fit, &white);
            if share < 1.0 - SAME && best.as_ref().is_none_or(|(least, _)| share < *least) {
                best = Some((share, other));
            }
        }
        let Some((_, lower)) = best else { break };
        let from = values(&lower);
        fit = identify_from(machine, catalogue, effects, lower.data, settings, &from)?;
    }
    Ok(fit)
}
