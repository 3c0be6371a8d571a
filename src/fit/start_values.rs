//! Where a fit with shape parameters begins.
//!
//! A time constant or a pitch leaves no trace while its effect has no size, so that a search from size 0 never moves it. Each effect
//! with shapes is looked for beside a fit without it ([`start_shapes`]): first the one that shows most, then each of the rest beside
//! it.

use super::local_minima::{lowest_minimum, values};
use super::nonlinear_scan::{self, Start, start_shapes};
use super::shape_search::{Job, ShapeSearch, Starts};
use super::{Fit, Knowledge, Settings, effects_of};
use crate::diag::Result;
use crate::machine::Machine;
use crate::model::catalogue::{Catalogue, Effect};
use crate::model::data::Data;
use std::collections::BTreeMap;

/// Fits a model to assembled data.
///
/// # Errors
/// As [`identify`](super::identify).
pub fn identify_data(machine: &Machine, catalogue: &Catalogue, data: Data, settings: &Settings) -> Result<Fit> {
    identify_from_starts(machine, catalogue, data, settings, Starts::new())
}

/// Fits a model with more effects than an earlier fit to the same touches. Shapes of the earlier one begin where they were, and those
/// that it holds stay there: it is a trial, and a shape at an end of its range would run out again.
///
/// # Errors
/// As [`identify`](super::identify).
pub fn identify_beside(earlier: &Fit, machine: &Machine, catalogue: &Catalogue, settings: &Settings) -> Result<Fit> {
    let mut settings = settings.clone();
    for (u, known) in earlier.model.unknowns.iter().zip(&earlier.knowledge).filter(|(u, _)| u.shape) {
        if let Some(held @ Knowledge::Fixed(_)) = known {
            settings.knowledge.insert(u.name.clone(), *held);
        }
    }
    identify_from_starts(machine, catalogue, earlier.data.clone(), &settings, values(earlier))
}

/// Effects with shapes of which a start is known are not looked for.
fn identify_from_starts(
    machine: &Machine,
    catalogue: &Catalogue,
    data: Data,
    settings: &Settings,
    mut starts: Starts,
) -> Result<Fit> {
    let effects = effects_of(&settings.effects, catalogue, machine)?;
    let job = Job { machine, catalogue, effects: &effects };
    let is_known = |e: &Effect| e.parameters.iter().any(|p| starts.keys().any(|name| own_name(name) == p.name));
    let mut waiting: Vec<&Effect> = effects.iter().copied().filter(|e| has_shapes(e) && !is_known(e)).collect();
    let tau_mm = look_for(job, &data, settings, &mut waiting, &mut starts)?;
    let fit = identify_started(job, data, settings, &starts)?;
    // what an effect changes from one index position to the next is scatter to a fit without it, which then hardly shows it: where
    // less scatter is left beside it, it is judged by that
    let n_waiting = waiting.len();
    if n_waiting == 0 || fit.noise.tau_mm >= tau_mm {
        return Ok(fit);
    }
    let calm = Settings { visit_sigma_mm: Some(fit.noise.tau_mm), ..settings.clone() };
    look_for(job, &fit.data, &calm, &mut waiting, &mut starts)?;
    if waiting.len() == n_waiting { Ok(fit) } else { identify_started(job, fit.data, settings, &starts) }
}

/// Finds start values of the effects that the touches show, and takes these out of `waiting`; the others stay at usual shapes. The
/// scatter of index positions beside all that show, mm.
fn look_for(
    job: Job,
    data: &Data,
    settings: &Settings,
    waiting: &mut Vec<&Effect>,
    starts: &mut Starts,
) -> Result<f64> {
    while !waiting.is_empty() && !data.observations.is_empty() {
        let beside = fit_without(job, data, settings, waiting, starts)?;
        let found: Vec<Start> = waiting.iter().map(|effect| start_shapes(&beside, job.machine, effect)).collect();
        let shown = (0..waiting.len()).filter(|&k| found[k].shown);
        let Some(k) = shown.max_by(|&a, &b| found[a].gain.total_cmp(&found[b].gain)) else {
            starts.extend(found.into_iter().flat_map(|s| s.values));
            return Ok(beside.noise.tau_mm);
        };
        starts.extend(found[k].values.clone());
        waiting.remove(k);
    }
    Ok(0.0)
}

/// The name of a parameter without its block.
fn own_name(name: &str) -> &str {
    name.split('@').next().unwrap_or_default()
}

fn has_shapes(effect: &Effect) -> bool {
    effect.parameters.iter().any(|p| p.shape.is_some())
}

/// A trial fit of everything but some effects.
fn fit_without(job: Job, data: &Data, settings: &Settings, out: &[&Effect], starts: &Starts) -> Result<Fit> {
    let is_out = |id: &str| out.iter().any(|e| e.id == id);
    let is_of_them =
        |name: &str| out.iter().flat_map(|e| &e.parameters).any(|p| crate::symbols::same(&p.name, own_name(name)));
    let mut base = Settings { quick: true, type_b: BTreeMap::new(), ..settings.clone() };
    base.effects.retain(|id| !is_out(id));
    base.knowledge.retain(|name, _| !is_of_them(name));
    let rest: Vec<&Effect> = job.effects.iter().copied().filter(|e| !is_out(&e.id)).collect();
    identify_started(Job { effects: &rest, ..job }, data.clone(), &base, starts)
}

/// Fits a model from given starts: where something jumps, and what runs out of its range, is held.
fn identify_started(job: Job, data: Data, settings: &Settings, starts: &Starts) -> Result<Fit> {
    let mut search = ShapeSearch { settings: settings.clone(), ..ShapeSearch::default() };
    for effect in job.effects.iter().filter(|e| has_shapes(e)) {
        let blocks: Vec<String> = data.set_ups.iter().map(|s| format!("@{}", s.label)).collect();
        for block in if effect.per_block { blocks } else { vec![String::new()] } {
            let named = |name: &str| format!("{name}{block}");
            let values: Vec<f64> =
                effect.parameters.iter().map(|p| starts.get(&named(&p.name)).copied().unwrap_or(0.0)).collect();
            // what the touches do not show has no moment to be held at
            if effect.parameters.iter().zip(&values).all(|(p, v)| p.shape.is_some() || *v == 0.0) {
                continue;
            }
            for (name, value) in nonlinear_scan::jumps(effect, &values, &data) {
                let name = named(name);
                if !search.settings.knowledge.keys().any(|word| crate::symbols::same(word, &name)) {
                    search.hold(&name, value);
                    search.jumps.insert(name);
                }
            }
        }
    }
    let fit = job.fit(data, &search, starts)?;
    lowest_minimum(fit, job, search, starts)
}
