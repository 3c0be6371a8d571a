//! Where a fit with shape parameters begins.

use super::local_minima::{OutOfRange, against, best_minimum, better_moments, hold};
use super::nonlinear_scan::{self, Start};
use super::{Fit, Knowledge, Mask, Settings, effects_of, identify_from};
use crate::diag::Result;
use crate::machine::Machine;
use crate::model::catalogue::{Catalogue, Effect, Parameter};
use crate::model::data::Data;
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
    let [apart, together] = against([&fit, &alike]);
    Ok(if together < apart { alike } else { fit })
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
    let look = LookFor { machine, catalogue, data: &data, settings, alike };
    let shaped = effects.iter().copied().filter(|e| has_shapes(e)).flat_map(|e| look.parts_of(e));
    let unseen = look.all(shaped.collect(), &mut starts)?;
    let fit = identify_started(machine, catalogue, effects, data, settings, &starts)?;
    // what an effect changes from one visit to the next is scatter of the visits to a fit without it, which then hardly sees it:
    // where less scatter is left beside it, that is what it is judged by
    let Some(unseen) = unseen.filter(|u| fit.noise.tau_mm < u.tau_mm) else { return Ok(fit) };
    let calm = Settings { visit_sigma_mm: Some(fit.noise.tau_mm), ..settings.clone() };
    let n_unseen = unseen.parts.len();
    let look = LookFor { machine, catalogue, data: &fit.data, settings: &calm, alike };
    let still = look.all(unseen.parts, &mut starts)?;
    if still.is_some_and(|s| s.parts.len() == n_unseen) {
        return Ok(fit);
    }
    identify_started(machine, catalogue, effects, fit.data, settings, &starts)
}

/// An effect with shape parameters, or the part of it that is one block's.
#[derive(Debug, Clone)]
struct Part<'e> {
    effect: &'e Effect,
    /// The block's label, where each has parameters of its own.
    block: Option<String>,
}

impl PartialEq for Part<'_> {
    fn eq(&self, other: &Self) -> bool {
        self.effect.id == other.effect.id && self.block == other.block
    }
}

/// What the data does not show, and with which scatter of index visits, mm.
struct Unseen<'e> {
    parts: Vec<Part<'e>>,
    tau_mm: f64,
}

/// Looks for where effects with shape parameters begin.
struct LookFor<'a> {
    machine: &'a Machine,
    catalogue: &'a Catalogue,
    data: &'a Data,
    settings: &'a Settings,
    /// The sets of all blocks share their shapes.
    alike: bool,
}

/// Touches further off than this were made by no effect, mm.
const GROSS_MM: f64 = 0.3;

impl LookFor<'_> {
    fn parts_of<'e>(&self, effect: &'e Effect) -> Vec<Part<'e>> {
        if !effect.per_block || self.alike {
            return vec![Part { effect, block: None }];
        }
        self.data.set_ups.iter().map(|s| Part { effect, block: Some(s.label.to_string()) }).collect()
    }

    /// Where the search begins, by name of the unknown: first for what shows most, then for each of the rest beside it, at last for
    /// each beside all others, because a jump that another one hides stands at the wrong moment. What the touches do not show is
    /// handed back.
    fn all<'e>(&self, shaped: Vec<Part<'e>>, starts: &mut BTreeMap<String, f64>) -> Result<Option<Unseen<'e>>> {
        if shaped.is_empty() || self.data.observations.is_empty() {
            return Ok(None);
        }
        let (mut waiting, mut seen) = (shaped, Vec::new());
        let mut tau_mm = 0.0;
        while !waiting.is_empty() {
            let fit = self.without(&waiting, self.settings, starts)?;
            let mut found: Vec<Vec<Start>> = waiting.iter().map(|part| self.starts_of(&fit, part)).collect();
            let gain = |k: &usize| found[*k].iter().filter(|s| s.shown).map(|s| s.gain).sum::<f64>();
            let most = (0..waiting.len()).max_by(|a, b| gain(a).total_cmp(&gain(b))).filter(|k| gain(k) > 0.0);
            let next = match most {
                Some(k) => Some((k, found.swap_remove(k))),
                None => self.among_those_left_out(&fit, &waiting, starts)?,
            };
            let Some((k, of_it)) = next else {
                tau_mm = fit.noise.tau_mm;
                found.into_iter().for_each(|of_it| take(of_it, starts));
                break;
            };
            take(of_it, starts);
            seen.push(waiting.remove(k));
        }
        let mut unseen = Unseen { parts: waiting, tau_mm };
        self.again(&seen, &mut unseen, starts)?;
        Ok(Some(unseen).filter(|u| !u.parts.is_empty()))
    }

    /// Looks for each of several that are seen once more, beside all the others, until none of them moves.
    fn again<'e>(&self, seen: &[Part<'e>], unseen: &mut Unseen<'e>, starts: &mut BTreeMap<String, f64>) -> Result<()> {
        /// Rounds at most.
        const ROUNDS: usize = 3;
        let never = unseen.parts.clone();
        // the last one was looked for beside all others
        let mut stay = 1;
        for part in seen.iter().cycle().take(ROUNDS * seen.len()) {
            if stay >= seen.len() {
                break;
            }
            let out: Vec<Part> = never.iter().chain([part]).cloned().collect();
            let fit = self.without(&out, self.settings, starts)?;
            let found = self.starts_of(&fit, part);
            let shapes = |s: &Start| -> Vec<(String, f64)> {
                let all = s.names.iter().zip(&s.values).zip(&part.effect.parameters);
                all.filter(|(_, p)| p.shape.is_some()).map(|((name, value), _)| (name.clone(), *value)).collect()
            };
            let moved = found.iter().any(|s| shapes(s).iter().any(|(name, value)| starts.get(name) != Some(value)));
            // what showed only in place of another one
            unseen.parts.retain(|p| p != part);
            if found.iter().any(|s| !s.shown) {
                unseen.parts.push(part.clone());
                unseen.tau_mm = unseen.tau_mm.max(fit.noise.tau_mm);
            }
            take(found, starts);
            stay = if moved { 1 } else { stay + 1 };
        }
        Ok(())
    }

    /// What only touches show which the fit without it leaves out, as the last ones of a run: it counts where the fit with it
    /// misses so much less that it would show among all. Its place among those that wait, and where it begins.
    fn among_those_left_out(
        &self,
        fit: &Fit,
        waiting: &[Part],
        starts: &BTreeMap<String, f64>,
    ) -> Result<Option<(usize, Vec<Start>)>> {
        let left_out = |i: &usize| !self.settings.masked.iter().any(|m| m.is_of(&fit.data.observations[*i]));
        let mut all_in = Settings {
            all_in: true,
            touch_sigma_mm: Some(fit.noise.sigma_mm),
            visit_sigma_mm: Some(fit.noise.tau_mm),
            ..self.settings.clone()
        };
        let gross = |i: &usize| fit.residual_mm[*i].abs() > GROSS_MM;
        let (far, near): (Vec<usize>, Vec<usize>) = fit.rejected.keys().copied().filter(left_out).partition(gross);
        if near.is_empty() {
            return Ok(None);
        }
        all_in.masked.extend(far.into_iter().map(|i| {
            let o = &fit.data.observations[i];
            Mask { run: o.run, id: o.id, reason: String::new() }
        }));
        let whole = self.without(waiting, &all_in, starts)?;
        for (k, part) in waiting.iter().enumerate() {
            let found = self.starts_of(&whole, part);
            let sets = found.iter().filter(|s| s.shown).count();
            if sets == 0 {
                continue;
            }
            let others: Vec<Part> = waiting.iter().filter(|p| *p != part).cloned().collect();
            let mut with_it = starts.clone();
            take(found.clone(), &mut with_it);
            let [without, with] = against([fit, &self.without(&others, self.settings, &with_it)?]);
            if without - with > nonlinear_scan::LEAST_GAIN * (sets * part.effect.parameters.len()) as f64 {
                return Ok(Some((k, found)));
            }
        }
        Ok(None)
    }

    fn starts_of(&self, fit: &Fit, part: &Part) -> Vec<Start> {
        nonlinear_scan::start_shapes(fit, self.machine, part.effect, (self.alike, part.block.as_deref()))
    }

    /// The fit of everything but some effects, or parts of them.
    fn without(&self, out: &[Part], settings: &Settings, starts: &BTreeMap<String, f64>) -> Result<Fit> {
        let whole = |part: &&Part| self.parts_of(part.effect).iter().all(|p| out.contains(p));
        let effects: Vec<&Effect> = out.iter().filter(whole).map(|part| part.effect).collect();
        let mut base = nonlinear_scan::without(settings, &effects);
        for (part, block) in out.iter().filter(|part| !whole(part)).filter_map(|p| Some((p, p.block.as_ref()?))) {
            for p in &part.effect.parameters {
                hold(&mut base, &format!("{}@{block}", p.name), p.shape.map_or(0.0, |(start, _, _)| start));
            }
        }
        let others = effects_of(&base.effects, self.catalogue, self.machine)?;
        identify_started(self.machine, self.catalogue, &others, self.data.clone(), &base, starts)
    }
}

fn take(found: Vec<Start>, starts: &mut BTreeMap<String, f64>) {
    starts.extend(found.into_iter().flat_map(|s| s.names.into_iter().zip(s.values)));
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
            for (name, value) in nonlinear_scan::jumps(effect, &values, &data) {
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
        let Some(out) = nonlinear_scan::out_of_range(&fit, catalogue, machine) else { break };
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
