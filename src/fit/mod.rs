//! Identification: weighted nonlinear least squares over the model, with noise, outliers, rank, covariance and what
//! cannot be told.
//!
//! [`identify`] is a pure function: machine, effects, runs and settings in, [`Fit`] out. In its order: rank on the
//! nominal touches, a first fit with white noise, a robust start and data snooping, the noise from repeats and revisits,
//! the fit with that noise, snooping again, and the answer.

mod answer;
pub mod candidates;
mod contradictions;
mod digits;
pub mod held_out;
mod knowledge;
pub mod noise;
pub mod normal;
pub mod outcome;
mod profile;
pub mod quantiles;
mod rank;
mod revisits;
mod search;
pub mod shapes;
pub mod snoop;
pub mod solve;
pub mod statement;
mod type_b;
pub mod uncertainty;
mod weak;
pub mod whitening;

pub use knowledge::effects_of;
pub use rank::{held_first, observe_plan};
pub use shapes::{around, between, scan, start_shapes};

use crate::diag::{Failure, Result};
use crate::machine::Machine;
use crate::model::catalogue::{Catalogue, Effect};
use crate::model::data::{Data, Run, assemble};
use crate::model::predict::{Model, Observation};
use nalgebra::{DMatrix, DVector, Vector3};
use noise::{Known, Noise};
use normal::{Prior, Touches};
use outcome::Outcome;
use search::Search;
use snoop::Snoop;
use std::collections::BTreeMap;
use whitening::Whitening;

/// What the user decided about one parameter.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Knowledge {
    /// Held at a value, in the parameter's unit.
    Fixed(f64),
    /// Known to be `value` with a standard deviation, in the parameter's unit.
    Prior {
        /// Expected value.
        value: f64,
        /// Standard deviation.
        sigma: f64,
    },
}

/// A touch that the user took out.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Mask {
    /// Which run, from 0.
    pub run: usize,
    /// Number in the plan.
    pub id: u64,
    /// Why.
    pub reason: String,
}

/// What a fit is asked for.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Settings {
    /// Ids of the effects: the whole model.
    pub effects: Vec<String>,
    /// Parameters that are held or have a prior, by name in any spelling.
    pub knowledge: BTreeMap<String, Knowledge>,
    /// Standard deviation of a touch, mm, where the user states it.
    pub touch_sigma_mm: Option<f64>,
    /// Standard deviation of each component of a visit's displacement, mm, where the user states it.
    pub visit_sigma_mm: Option<f64>,
    /// Where location errors of workpiece-side axes are stated, mm in R (default: the machine's pivot).
    pub reference: Option<Vector3<f64>>,
    /// What the measurement itself is uncertain about: parameters of effects that are not in the model, by name, with a
    /// standard uncertainty in their unit. They widen the uncertainties and are not solved for.
    pub type_b: BTreeMap<String, f64>,
    /// Touches that are not to be used.
    pub masked: Vec<Mask>,
    /// Without the figures that need the whole catalogue (uncertainty with unmodelled effects, type B rows).
    pub quick: bool,
    /// Shape parameters that the search holds at an end of their range: nobody knows them.
    pub held: Vec<String>,
    /// Shape parameters at which something jumps, as a moment: the search holds each at the best of the places between touches.
    pub jumps: Vec<String>,
}

/// A fit with everything that later rooms need.
#[derive(Debug, Clone)]
pub struct Fit {
    /// The model.
    pub model: Model,
    /// The data.
    pub data: Data,
    /// All unknowns, held ones included, each in its unit.
    pub theta: Vec<f64>,
    /// Measured less model along the outward normal, mm, per observation.
    pub residual_mm: Vec<f64>,
    /// Externally studentised residuals, per observation; of a touch that is not used, how far it is off what the others say
    /// in standard deviations.
    pub studentised: Vec<f64>,
    /// 1 for each touch that is used, else 0.
    pub weight: Vec<f64>,
    /// Why a touch is not used, by observation.
    pub rejected: BTreeMap<usize, String>,
    /// Covariance of all unknowns, in their units; zero rows for held ones.
    pub covariance: DMatrix<f64>,
    /// What one standard uncertainty of each type B row makes of the free unknowns, in their units.
    pub type_b: Vec<DVector<f64>>,
    /// What the nominal touches say about the free unknowns.
    pub observability: solve::Observability,
    /// The same at the solution, of equal rank: combinations that leave no trace bend with the machine's errors.
    pub seen: solve::Observability,
    /// Indices of the free unknowns.
    pub free: Vec<usize>,
    /// Priors, by unknown.
    pub priors: Vec<Prior>,
    /// What the user said, by unknown.
    pub knowledge: Vec<Option<Knowledge>>,
    /// The noise.
    pub noise: Noise,
    /// How many touches a robust fit finds off the rest, where they are too many to be left out on its word.
    pub strangers_beyond: Option<usize>,
    /// χ² of the touches and priors.
    pub chi2: f64,
    /// Degrees of freedom.
    pub dof: usize,
    /// The answer.
    pub outcome: Outcome,
}

/// A fit linearised at its minimum: rows are the touches and then the priors, in units of their noise. Rows of touches
/// that are not used are zero.
#[derive(Debug, Clone)]
pub struct Linear {
    /// Whitened residuals.
    pub residual: DVector<f64>,
    /// Whitened Jacobian of the free unknowns.
    pub jacobian: DMatrix<f64>,
}

impl Fit {
    /// The free unknowns.
    #[must_use]
    pub fn free_theta(&self) -> DVector<f64> {
        DVector::from_iterator(self.free.len(), self.free.iter().map(|&i| self.theta[i]))
    }

    /// Calls `f` with the touches as a problem at the given τ, mm.
    pub fn with_touches<T>(&self, tau_mm: f64, f: impl FnOnce(&Touches) -> T) -> T {
        let batch = self.model.prepare(&self.data.observations);
        let noise = (self.noise.sigma_mm, tau_mm);
        let mut touches = Touches::new(&batch, &self.data.visits, self.theta.clone(), &self.free, &self.priors, noise);
        touches.set_weights(self.weight.clone());
        f(&touches)
    }

    /// What whitens columns of all touches, with a given scatter of visits, mm.
    #[must_use]
    pub fn whitening(&self, tau_mm: f64) -> Whitening {
        self.with_touches(tau_mm, |t| t.whitening())
    }

    /// The fit linearised, with the given τ, mm (tests for missing effects use the noise's upper bound).
    #[must_use]
    pub fn linear(&self, tau_mm: f64) -> Linear {
        let (residual, jacobian) = self.with_touches(tau_mm, |t| t.dense(&self.free_theta()));
        Linear { residual, jacobian }
    }

    /// Number of touches that are used.
    #[must_use]
    pub fn n_used(&self) -> usize {
        self.weight.iter().filter(|w| **w > 0.0).count()
    }
}

/// Fits a model to runs.
///
/// # Errors
/// When an effect or parameter is unknown, or no touch can be used.
pub fn identify(machine: &Machine, catalogue: &Catalogue, runs: &[Run], settings: &Settings) -> Result<Fit> {
    let data = assemble(machine, runs);
    identify_data(machine, catalogue, data, settings)
}

/// Fits a model to assembled data.
///
/// # Errors
/// As [`identify`].
pub fn identify_data(machine: &Machine, catalogue: &Catalogue, data: Data, settings: &Settings) -> Result<Fit> {
    let effects = effects_of(&settings.effects, catalogue, machine)?;
    let mut starts = BTreeMap::new();
    let shaped = effects.iter().copied().filter(|e| !e.per_block && e.parameters.iter().any(|p| p.shape.is_some()));
    let unseen = look_for((machine, catalogue), shaped.collect(), &data, settings, &mut starts)?;
    let fit = identify_started(machine, catalogue, &effects, data, settings, &starts)?;
    // what an effect changes from one visit to the next is scatter of the visits to a fit without it, which then hardly sees it:
    // where less scatter is left beside it, that is what it is judged by
    let Some(unseen) = unseen.filter(|u| fit.noise.tau_mm < u.tau_mm) else { return Ok(fit) };
    let calm = Settings { visit_sigma_mm: Some(fit.noise.tau_mm), ..settings.clone() };
    let n_unseen = unseen.effects.len();
    let still = look_for((machine, catalogue), unseen.effects, &fit.data, &calm, &mut starts)?;
    if still.is_some_and(|s| s.effects.len() == n_unseen) {
        return Ok(fit);
    }
    identify_started(machine, catalogue, &effects, fit.data, settings, &starts)
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
    settings: &Settings,
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
        let Some(start) = shapes::start_shapes(&fit, machine, effect) else { continue };
        starts.extend(effect.parameters.iter().zip(start.values).map(|(p, v)| (p.name.clone(), v)));
        if !start.shown {
            unseen.effects.push(effect);
        }
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
    for effect in effects.iter().filter(|e| starts.contains_key(&e.parameters[0].name)) {
        let values: Vec<f64> = effect.parameters.iter().map(|p| starts.get(&p.name).copied().unwrap_or(0.0)).collect();
        // what the data does not show has no place to be held at
        if effect.parameters.iter().zip(&values).all(|(p, v)| p.shape.is_some() || *v == 0.0) {
            continue;
        }
        for (name, value) in shapes::jumps(effect, &values, &data) {
            if !held_settings.knowledge.contains_key(name) {
                held_settings.knowledge.insert(name.to_owned(), Knowledge::Fixed(value));
                held_settings.jumps.push(name.to_owned());
            }
        }
    }
    let fit = identify_from(machine, catalogue, effects, data, &held_settings, starts)?;
    let Some((name, ends_of)) = shapes::out_of_range(&fit, catalogue, machine) else { return Ok(fit) };
    // a first step too far: everything else settles while the shape stays where it began, and the search goes on from there
    let mut fit = fit;
    if let Some(&began) = starts.get(&name) {
        let mut waiting = Settings { quick: true, ..held_settings.clone() };
        waiting.knowledge.insert(name.clone(), Knowledge::Fixed(began));
        let settled = identify_from(machine, catalogue, effects, fit.data, &waiting, starts)?;
        let values = settled.model.unknowns.iter().zip(settled.theta.iter()).map(|(u, v)| (u.name.clone(), *v));
        let from: BTreeMap<String, f64> = values.collect();
        fit = identify_from(machine, catalogue, effects, settled.data, &held_settings, &from)?;
        if shapes::out_of_range(&fit, catalogue, machine).is_none() {
            return Ok(fit);
        }
    }
    // a step too far says nothing of the side: the end that fits better
    held_settings.held.push(name.clone());
    let mut held_at = |end: f64| {
        held_settings.knowledge.insert(name.clone(), Knowledge::Fixed(end));
        identify_from(machine, catalogue, effects, fit.data.clone(), &held_settings, starts)
    };
    let [low, high] = [held_at(ends_of[0])?, held_at(ends_of[1])?];
    // by one measure: the smaller scatter of visits hides less
    let white = low.whitening(low.noise.tau_mm.min(high.noise.tau_mm));
    let misfit = |f: &Fit| {
        let mut residual = DMatrix::from_column_slice(f.residual_mm.len(), 1, &f.residual_mm);
        white.apply(&mut residual);
        residual.norm_squared()
    };
    // what the user says of it counts, too
    let known = settings.knowledge.iter().find(|(word, _)| crate::symbols::same(word, &name)).map(|(_, k)| *k);
    let against = |end: f64| match known {
        Some(Knowledge::Prior { value, sigma }) => ((end - value) / sigma).powi(2),
        _ => 0.0,
    };
    let lower = misfit(&low) + against(ends_of[0]) <= misfit(&high) + against(ends_of[1]);
    let mut fit = if lower { low } else { high };
    if let Some(Knowledge::Prior { value, sigma }) = known {
        fit.outcome.warnings.push(format!(
            "{name} ran out of its range in the search beside its prior of {value} ± {sigma}: touches and prior do not agree, or its range is too narrow; it stands at the end of its range that fits both better"
        ));
        return Ok(fit);
    }
    fit.outcome.warnings.push(format!("{name} ran out of its range in the search: these touches do not tell it, and it stands at the end of its range that fits better"));
    Ok(fit)
}

/// What a formula may depend on that is not the same in two visits of one pose.
const MOVING: [&str; 5] = ["t", "T", "wA", "wB", "wC"];

/// Fits a model from given starts.
fn identify_from(
    machine: &Machine,
    catalogue: &Catalogue,
    effects: &[&Effect],
    data: Data,
    settings: &Settings,
    starts: &BTreeMap<String, f64>,
) -> Result<Fit> {
    if data.observations.is_empty() {
        return Err(Failure::new("fit::no_touches", "no touch can be used")
            .help("does the log belong to this plan? `axiscal parse` lists what it holds"));
    }
    let reference = settings.reference.unwrap_or(machine.reference.pivot);
    let model = Model::new(machine, effects, &data.set_ups, reference);
    let knowledge = knowledge::resolve(&model.unknowns, &settings.knowledge)?;
    knowledge::within_range(&model, &knowledge, effects)?;
    knowledge::every_formula_has_a_value(effects, &data)?;
    knowledge::stated_at_the_pivot(&model, &knowledge, machine)?;
    let mut theta = model.start();
    for (value, u) in theta.iter_mut().zip(&model.unknowns) {
        *value = starts.get(&u.name).copied().unwrap_or(*value);
    }
    for (value, known) in theta.iter_mut().zip(&knowledge) {
        match known {
            Some(Knowledge::Fixed(v)) | Some(Knowledge::Prior { value: v, .. }) => *value = *v,
            None => {}
        }
    }
    let free: Vec<usize> = (0..theta.len()).filter(|&i| !matches!(knowledge[i], Some(Knowledge::Fixed(_)))).collect();
    let priors: Vec<Prior> = free
        .iter()
        .filter_map(|&i| match knowledge[i] {
            Some(Knowledge::Prior { value, sigma }) => Some((i, value, sigma)),
            _ => None,
        })
        .collect();
    let known = Known {
        declared_sigma_mm: crate::units::mm_from_um(machine.probe.repeatability_um),
        rounding: digits::Rounding::of_touches(&data),
        declared_tau_mm: declared_tau_mm(machine, &data.observations),
        stated_sigma_mm: settings.touch_sigma_mm,
        stated_tau_mm: settings.visit_sigma_mm,
    };
    let first_noise = (known.rounding.added_to(settings.touch_sigma_mm.unwrap_or(known.declared_sigma_mm)), 0.0);
    let batch = model.prepare(&data.observations);
    let start = DVector::from_iterator(free.len(), free.iter().map(|&i| theta[i]));
    let mut touches = Touches::new(&batch, &data.visits, theta.clone(), &free, &priors, first_noise);
    let masked: Vec<bool> = {
        let is = |m: &Mask, o: &Observation| o.run == m.run && o.id == m.id;
        data.observations.iter().map(|o| settings.masked.iter().any(|m| is(m, o))).collect()
    };
    if masked.contains(&true) {
        touches.set_weights(masked.iter().map(|m| if *m { 0.0 } else { 1.0 }).collect());
    }
    let first = solve::Problem::normal(&touches, &start, true);
    let (observability, condition) =
        rank::observe(&first.gram, &model, &data, &theta, &free, &priors, touches.weights());
    let moving =
        effects.iter().any(|e| e.terms.iter().any(|t| t.formula.variables().iter().any(|v| MOVING.contains(v))));
    let mut search =
        Search { data: &data, observability: observability.clone(), touches, masked, known, moving, beyond: None };
    let solution = solve::minimise_from(&search.touches, start, &observability, Some(first));
    let solution = search.follow_bends(solution, &model, &free);
    // the scale of the first pass is that of the residuals themselves: the noise is not known yet
    let solution = search.without_strangers(solution, 0.0);
    let first_steps = solution.iterations;
    let (noise, solution) = search.settle(solution);
    let before = search.touches.weights().to_vec();
    let mut solution = search.without_strangers(solution, noise.dof.unwrap_or(0.0));
    let noise = if search.touches.weights() == before {
        noise
    } else {
        let (noise, settled) = search.settle(solution);
        solution = settled;
        noise
    };
    solution = search.follow_bends(solution, &model, &free);
    solution.iterations += first_steps;
    let dof = solve::Problem::n_rows(&search.touches).saturating_sub(observability.rank);
    let snoop = Snoop::new(
        &search.touches,
        &solution.theta,
        &solution.covariance,
        (solution.chi2, dof),
        noise.dof.unwrap_or(0.0),
    );
    for (column, &i) in free.iter().enumerate() {
        theta[i] = solution.theta[column];
    }
    let residual_mm = search.touches.gaps(&solution.theta);
    let mut rejected = search.reasons(&solution);
    let mut unknown_masks = Vec::new();
    for mask in &settings.masked {
        let is = |o: &Observation| o.run == mask.run && o.id == mask.id;
        match data.observations.iter().position(is) {
            Some(i) => {
                rejected.insert(i, format!("taken out: {}", mask.reason));
            }
            None => unknown_masks.push(format!(
                "there is no touch {} in run {}: its mask does nothing",
                mask.id,
                mask.run + 1
            )),
        }
    }
    let weight = search.touches.weights().to_vec();
    let mut covariance = DMatrix::zeros(theta.len(), theta.len());
    for (a, &i) in free.iter().enumerate() {
        for (b, &j) in free.iter().enumerate() {
            covariance[(i, j)] = solution.covariance[(a, b)];
        }
    }
    let mut studentised = snoop.studentised();
    // a touch that is not used stands by how far it is off what the others say
    let scale2 = search.scale2(&solution, 0.0);
    for &i in rejected.keys() {
        studentised[i] = search.off(&solution, i, scale2).1;
    }
    let seen = search.seen_at(&solution.theta);
    let strangers_beyond = search.beyond;
    drop(search.touches);
    drop(batch);
    let chi2 = solution.chi2;
    let mut fit = Fit {
        model,
        data,
        theta,
        residual_mm,
        studentised,
        weight,
        rejected,
        covariance,
        observability,
        seen,
        free,
        priors,
        knowledge,
        type_b: Vec::new(),
        noise,
        strangers_beyond,
        chi2,
        dof,
        outcome: Outcome::default(),
    };
    let type_b = type_b::type_b(&fit, machine, catalogue, &settings.type_b)?;
    fit.type_b = type_b.iter().map(|b| b.makes.clone()).collect();
    fit.outcome = answer::outcome(&fit, machine, catalogue, effects, settings, (&solution, condition), &type_b);
    fit.outcome.warnings.extend(unknown_masks);
    Ok(fit)
}

/// Scatter of the ball's place from one index to the next as the machine file declares it, mm: of the rotary axes that
/// stand at more than one place in these touches.
#[must_use]
pub fn declared_tau_mm(machine: &Machine, observations: &[Observation]) -> f64 {
    let moved = |name| {
        let mut places = observations.iter().map(|o| o.position.get(name));
        let first = places.next();
        places.any(|p| first.is_some_and(|f| (p - f).abs() > 1e-3))
    };
    let axes = machine.axes.iter().filter(|a| a.name.is_rotary() && moved(a.name));
    axes.map(|a| a.indexing_repeatability_mm.powi(2)).sum::<f64>().sqrt()
}
