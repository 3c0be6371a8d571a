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
mod record;
mod remark;
pub mod residual_scatter;
mod revisits;
mod rounding;
mod settings;
mod shape_search;
pub mod solve;
pub mod span;
mod start_values;
mod type_b;
pub mod uncertainty;
pub mod whitening;

pub use knowledge::{effects_of, every_formula_has_a_value};
pub use nonlinear_scan::{all_tried, around, between, fine, scan};
pub use rank::{design_jacobian, free_in_a_design, held_first, jumps_in_a_design, observe_plan};
pub use record::{Fit, Linear};
pub use remark::{Contradiction, Found, NoiseSource, Reason, Remark, VisitSource};
pub use settings::{Knowledge, Mask, Settings};
pub use start_values::{identify_beside, identify_data};

use crate::diag::{Failure, Result};
use crate::machine::Machine;
use crate::model::catalogue::{Catalogue, Effect};
use crate::model::data::{Data, Run, assemble};
use crate::model::predict::{Model, Observation};
use assemble_result::{Assembled, assemble_result};
use nalgebra::{DMatrix, DVector};
use noise::{Known, Noise};
use normal::{Prior, Touches};
use outcome::Outcome;
use outlier_loop::OutlierLoop;
use shape_search::{Asked, ShapeSearch};
use std::collections::BTreeMap;

/// Fits a model to runs.
///
/// # Errors
/// When an effect or parameter is unknown, or no touch can be used.
pub fn identify(machine: &Machine, catalogue: &Catalogue, runs: &[Run], settings: &Settings) -> Result<Fit> {
    let data = assemble(machine, runs);
    identify_data(machine, catalogue, data, settings)
}

/// What a formula may depend on that is not the same in two visits of one pose.
const MOVING: [&str; 8] = ["t", "T", "wA", "wB", "wC", "wayA", "wayB", "wayC"];

/// Fits a model from given starts.
fn identify_from(
    machine: &Machine,
    catalogue: &Catalogue,
    effects: &[&Effect],
    data: Data,
    search: &ShapeSearch,
    starts: &BTreeMap<String, f64>,
) -> Result<Fit> {
    let settings = &search.settings;
    if data.observations.is_empty() {
        return Err(Failure::new("fit::no_touches", "no touch can be used")
            .help("does the log belong to this plan? `axiscal parse` lists its touches"));
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
    let known_noise = (known, moving);
    let mut found = find(&model, &data, settings, (&free, &priors), theta, known_noise);
    let mut fit = Fit {
        model,
        data,
        theta: found.theta,
        residual_mm: found.residual_mm,
        studentised: found.studentised,
        weight: found.weight,
        rejected: found.rejected,
        covariance: found.covariance,
        observability: found.observability,
        seen: found.seen,
        free,
        priors,
        knowledge,
        type_b: Vec::new(),
        noise: found.noise,
        outliers_beyond: found.outliers_beyond,
        other_values: BTreeMap::new(),
        chi2: found.solution.chi2,
        dof: found.dof,
        remarks: Vec::new(),
        outcome: Outcome::default(),
    };
    fit.noise.visits_shown = residual_scatter::residual_scatter(&fit, settings.bare || settings.quick);
    let is_small = fit.data.observations.len() <= uncertainty::MOST_UNMODELLED;
    let type_b = type_b::type_b(&fit, machine, catalogue, &settings.type_b)?;
    fit.type_b = type_b.iter().map(|b| b.makes.clone()).collect();
    let with_catalogue = !settings.quick && !settings.bare && is_small;
    let left_out = with_catalogue.then(|| uncertainty::LeftOut::new(&fit.model, machine, catalogue, &fit.data));
    let asked = Asked { machine, effects, search };
    let solved = (&found.solution, found.condition);
    let masks = std::mem::take(&mut found.unknown_masks);
    let Assembled { outcome, remarks, other_values } =
        assemble_result(&fit, &asked, solved, (&type_b, left_out), masks);
    (fit.outcome, fit.remarks, fit.other_values) = (outcome, remarks, other_values);
    Ok(fit)
}

/// What the touches say of a model.
struct Solved {
    theta: Vec<f64>,
    residual_mm: Vec<f64>,
    studentised: Vec<f64>,
    weight: Vec<f64>,
    rejected: BTreeMap<usize, Reason>,
    covariance: DMatrix<f64>,
    observability: solve::Observability,
    condition: f64,
    seen: solve::Observability,
    noise: Noise,
    outliers_beyond: Option<usize>,
    solution: solve::Solution,
    dof: usize,
    /// Masks of touches that do not exist.
    unknown_masks: Vec<Remark>,
}

/// Solves a model from `theta` on: with the noise that the touches show, and without outliers.
fn find(
    model: &Model,
    data: &Data,
    settings: &Settings,
    (free, priors): (&[usize], &[Prior]),
    mut theta: Vec<f64>,
    (known, moving): (Known, bool),
) -> Solved {
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
    let mut search =
        OutlierLoop { data, observability: observability.clone(), touches, masked, known, moving, beyond: None };
    let solution = solve::minimise_from(&search.touches, start, &observability, Some(first));
    let solution = search.follow_bends(solution, model, free);
    // the scale of the first pass is that of the residuals themselves: the noise is not known yet
    let solution = if settings.all_in { solution } else { search.without_outliers(solution, 0.0) };
    let first_steps = solution.iterations;
    let (noise, solution) = search.settle(solution);
    let before = search.touches.weights().to_vec();
    let mut solution =
        if settings.all_in { solution } else { search.without_outliers(solution, noise.dof.unwrap_or(0.0)) };
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
                rejected.insert(i, Reason::Masked { reason: mask.reason.clone() });
            }
            None => unknown_masks.push(Remark::UnknownMask { id: mask.id, run: mask.run }),
        }
    }
    let weight = search.touches.weights().to_vec();
    let mut covariance = DMatrix::zeros(theta.len(), theta.len());
    for (a, &i) in free.iter().enumerate() {
        for (b, &j) in free.iter().enumerate() {
            covariance[(i, j)] = solution.covariance[(a, b)];
        }
    }
    let mut studentised = search.studentised(&solution, noise.dof.unwrap_or(0.0)).each();
    // a touch that is not used stands by how far it is off what the others say
    let scale2 = search.scale2(&solution, 0.0);
    for &i in rejected.keys() {
        studentised[i] = search.off(&solution, i, scale2).1;
    }
    let seen = search.seen_at(&solution.theta);
    let outliers_beyond = search.beyond;
    Solved {
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
        outliers_beyond,
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
