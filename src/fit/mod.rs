//! Identification: weighted nonlinear least squares over the model, with noise, outliers, rank, covariance and what
//! cannot be told.
//!
//! [`identify`] is a pure function: machine, effects, runs and settings in, [`Fit`] out. In its order: rank on the
//! nominal touches, a first fit with white noise, a robust start and data snooping, the noise from repeats and revisits,
//! the fit with that noise, snooping again, and the answer.

mod assemble_result;
pub mod candidates;
mod contradictions;
pub mod held_out;
mod knowledge;
mod local_minima;
pub mod noise;
pub mod nonlinear_scan;
pub mod normal;
pub mod null_space;
pub mod outcome;
mod outlier_loop;
pub mod outliers;
mod poorly_determined;
mod profile;
pub mod quantiles;
mod rank;
mod revisits;
mod rounding;
pub mod solve;
pub mod span;
mod start_values;
mod type_b;
pub mod uncertainty;
pub mod whitening;

pub use knowledge::{effects_of, every_formula_has_a_value};
pub use nonlinear_scan::{all_tried, around, between, fine, scan, start_shapes};
pub use rank::{design_jacobian, free_in_a_design, held_first, jumps_in_a_design, observe_plan};
pub use start_values::identify_data;

use crate::diag::{Failure, Result};
use crate::machine::Machine;
use crate::model::catalogue::{Catalogue, Effect};
use crate::model::data::{Data, Run, assemble};
use crate::model::predict::{Model, Observation};
use nalgebra::{DMatrix, DVector, Vector3};
use noise::{Known, Noise};
use normal::{Prior, Touches};
use outcome::Outcome;
use outlier_loop::Search;
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

impl Mask {
    fn is_of(&self, o: &Observation) -> bool {
        o.run == self.run && o.id == self.id
    }
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
    /// Without the figures that need the whole catalogue: what unmodelled effects may add, weak combinations, held-out errors.
    pub bare: bool,
    /// For trial fits: as `bare`, and without the intervals of shape parameters. What hangs on a shape that is not told may then be
    /// called identified.
    pub quick: bool,
    /// Shape parameters that the search holds at an end of their range: nobody knows them.
    pub held: Vec<String>,
    /// Shape parameters at which something jumps, as a moment: the search holds each at the best of the places between touches.
    pub jumps: Vec<String>,
    /// No touch is left out but those that the user takes out.
    pub all_in: bool,
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
    /// Other values of shape parameters that fit about as well, the best first, by unknown.
    pub other_values: BTreeMap<usize, Vec<f64>>,
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
        self.with_noise((self.noise.sigma_mm, tau_mm), f)
    }

    /// The same at a given scatter of touches and of visits, mm.
    fn with_noise<T>(&self, noise_mm: (f64, f64), f: impl FnOnce(&Touches) -> T) -> T {
        let held = |i: usize| self.free.binary_search(&i).is_err();
        let batch = self.model.prepare_holding(&self.data.observations, &self.theta, &held);
        let mut touches =
            Touches::new(&batch, &self.data.visits, self.theta.clone(), &self.free, &self.priors, noise_mm);
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
    knowledge::every_formula_has_a_value(effects.iter().copied(), &data.observations)?;
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
        rounding: rounding::Rounding::of_touches(&data),
        declared_tau_mm: declared_tau_mm(machine, &data.observations),
        stated_sigma_mm: settings.touch_sigma_mm,
        stated_tau_mm: settings.visit_sigma_mm,
    };
    let moving =
        effects.iter().any(|e| e.terms.iter().any(|t| t.formula.variables().iter().any(|v| MOVING.contains(v))));
    let many = data.observations.len() > uncertainty::MOST_UNMODELLED;
    let is_asked = !(settings.quick || settings.bare || many);
    let solution = || find(&model, &data, settings, (&free, &priors), theta, (known, moving));
    let (found, left_out) = if is_asked {
        // what the model leaves out does not wait for the solution
        rayon::join(solution, || Some(uncertainty::LeftOut::of(&model, machine, catalogue, &data)))
    } else {
        (solution(), None)
    };
    let Found { theta, residual_mm, studentised, weight, rejected, covariance, .. } = found;
    let Found { observability, condition, seen, noise, strangers_beyond, solution, dof, unknown_masks, .. } = found;
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
        other_values: BTreeMap::new(),
        chi2: solution.chi2,
        dof,
        outcome: Outcome::default(),
    };
    let type_b = type_b::type_b(&fit, machine, catalogue, &settings.type_b)?;
    fit.type_b = type_b.iter().map(|b| b.makes.clone()).collect();
    let (mut outcome, other_values) =
        assemble_result::outcome(&fit, machine, effects, settings, (&solution, condition), (&type_b, left_out));
    outcome.warnings.extend(unknown_masks);
    (fit.outcome, fit.other_values) = (outcome, other_values);
    Ok(fit)
}

/// What the touches say of a model.
struct Found {
    theta: Vec<f64>,
    residual_mm: Vec<f64>,
    studentised: Vec<f64>,
    weight: Vec<f64>,
    rejected: BTreeMap<usize, String>,
    covariance: DMatrix<f64>,
    observability: solve::Observability,
    condition: f64,
    seen: solve::Observability,
    noise: Noise,
    strangers_beyond: Option<usize>,
    solution: solve::Solution,
    dof: usize,
    /// What is said of masks of touches that do not exist.
    unknown_masks: Vec<String>,
}

/// Solves a model from `theta` on: with the noise that the touches show, and without those that are strangers to it.
fn find(
    model: &Model,
    data: &Data,
    settings: &Settings,
    (free, priors): (&[usize], &[Prior]),
    mut theta: Vec<f64>,
    (known, moving): (Known, bool),
) -> Found {
    let first_noise = (known.rounding.added_to(settings.touch_sigma_mm.unwrap_or(known.declared_sigma_mm)), 0.0);
    let batch = model.prepare_holding(&data.observations, &theta, &|i| free.binary_search(&i).is_err());
    let start = DVector::from_iterator(free.len(), free.iter().map(|&i| theta[i]));
    let mut touches = Touches::new(&batch, &data.visits, theta.clone(), free, priors, first_noise);
    let masked: Vec<bool> = { data.observations.iter().map(|o| settings.masked.iter().any(|m| m.is_of(o))).collect() };
    if masked.contains(&true) {
        touches.set_weights(masked.iter().map(|m| if *m { 0.0 } else { 1.0 }).collect());
    }
    let first = solve::Problem::normal(&touches, &start, true);
    let (observability, condition) = rank::observe(&first.gram, model, data, &theta, free, priors, touches.weights());
    let mut search = Search {
        data,
        observability: observability.clone(),
        touches,
        masked,
        known,
        moving,
        beyond: None,
        judged: None,
    };
    let solution = solve::minimise_from(&search.touches, start, &observability, Some(first));
    let solution = search.follow_bends(solution, model, free);
    // the scale of the first pass is that of the residuals themselves: the noise is not known yet
    let solution = if settings.all_in { solution } else { search.without_strangers(solution, 0.0) };
    let first_steps = solution.iterations;
    let (noise, solution) = search.settle(solution);
    let before = search.touches.weights().to_vec();
    let mut solution =
        if settings.all_in { solution } else { search.without_strangers(solution, noise.dof.unwrap_or(0.0)) };
    let noise = if search.touches.weights() == before {
        noise
    } else {
        let (noise, settled) = search.settle(solution);
        solution = settled;
        noise
    };
    solution = search.follow_bends(solution, model, free);
    solution.iterations += first_steps;
    let dof = solve::Problem::n_rows(&search.touches).saturating_sub(observability.rank);
    for (column, &i) in free.iter().enumerate() {
        theta[i] = solution.theta[column];
    }
    let residual_mm = search.touches.gaps(&solution.theta);
    let mut rejected = search.reasons(&solution, noise.dof.unwrap_or(0.0));
    let mut unknown_masks = Vec::new();
    for mask in &settings.masked {
        match data.observations.iter().position(|o| mask.is_of(o)) {
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
    let mut studentised = search.judge(&solution, noise.dof.unwrap_or(0.0)).studentised();
    // a touch that is not used stands by how far it is off what the others say
    let scale2 = search.scale2(&solution, 0.0);
    for &i in rejected.keys() {
        studentised[i] = search.off(&solution, i, scale2).1;
    }
    let seen = search.seen_at(&solution.theta);
    let strangers_beyond = search.beyond;
    Found {
        theta,
        residual_mm,
        studentised,
        weight,
        rejected,
        covariance,
        observability,
        condition,
        seen,
        noise,
        strangers_beyond,
        solution,
        dof,
        unknown_masks,
    }
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
