//! Identification: weighted nonlinear least squares over the model, with rank, covariance and what cannot be told.
//!
//! [`identify`] is a pure function: machine, effects, runs and settings in, [`Fit`] out.

mod noise;
pub mod outcome;
pub mod solve;
mod statement;

use crate::diag::{Failure, Finding, Result};
use crate::machine::Machine;
use crate::model::catalogue::{Catalogue, Effect};
use crate::model::data::{Data, Run, assemble};
use crate::model::predict::{Model, Observation, Unknown};
use nalgebra::{DMatrix, DVector, Vector3};
use outcome::{Outcome, Parameter, Rejected, Residual, Status};
use std::collections::BTreeMap;

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

/// What a fit is asked for.
#[derive(Debug, Clone, Default)]
pub struct Settings {
    /// Ids of the effects: the whole model.
    pub effects: Vec<String>,
    /// Parameters that are held or have a prior, by name in any spelling.
    pub knowledge: BTreeMap<String, Knowledge>,
    /// Standard deviation of a touch, mm, where the user states it.
    pub touch_sigma_mm: Option<f64>,
    /// Where location errors of workpiece-side axes are stated, mm in R (default: the machine's pivot).
    pub reference: Option<Vector3<f64>>,
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
    /// Covariance of all unknowns, in their units; zero rows for held ones.
    pub covariance: DMatrix<f64>,
    /// What the nominal touches say about the free unknowns.
    pub observability: solve::Observability,
    /// Indices of the free unknowns.
    pub free: Vec<usize>,
    /// The answer.
    pub outcome: Outcome,
}

/// The effects of a model, in order.
///
/// # Errors
/// When an id is unknown, stands twice, or the machine lacks the axis that it needs.
pub fn effects_of<'c>(ids: &[String], catalogue: &'c Catalogue, machine: &Machine) -> Result<Vec<&'c Effect>> {
    let mut findings = Vec::new();
    let mut effects: Vec<&Effect> = Vec::new();
    for id in ids {
        match catalogue.get(id, machine) {
            Some(effect) if effects.iter().any(|e| e.id == effect.id) => {
                findings.push(Finding::error("model::effect_twice", format!("effect {id:?} stands twice in the model")).help("name each effect once"));
            }
            Some(effect) => effects.push(effect),
            None if catalogue.knows(id) => findings.push(
                Finding::error("model::effect_not_here", format!("effect {id:?} does not apply to machine {:?}", machine.name))
                    .help("it needs an axis that the machine lacks, or has on the other side of the chain: `axiscal effects show` tells which"),
            ),
            None => {
                let known: Vec<&str> = catalogue.iter().filter(|e| e.applies_to(machine)).map(|e| e.id.as_str()).collect();
                findings.push(Finding::error("model::unknown_effect", format!("no effect is called {id:?}")).help(format!("for this machine there are: {}", known.join(", "))));
            }
        }
    }
    // two effects may not bring the same parameter: their columns would be equal and the names would clash
    for (i, a) in effects.iter().enumerate() {
        for b in &effects[..i] {
            if let Some(p) = a.parameters.iter().find(|p| b.parameters.iter().any(|q| q.name == p.name)) {
                findings.push(
                    Finding::error(
                        "model::parameter_twice",
                        format!("effects {:?} and {:?} both bring the parameter {}", b.id, a.id, p.name),
                    )
                    .help("take one of the two out of the model"),
                );
            }
        }
    }
    if findings.is_empty() { Ok(effects) } else { Err(Failure(findings)) }
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
    if data.observations.is_empty() {
        return Err(Failure::new("fit::no_touches", "no touch can be used")
            .help("does the log belong to this plan? `axiscal parse` lists what it holds"));
    }
    let reference = settings.reference.unwrap_or(machine.reference.pivot);
    let model = Model::new(machine, &effects, &data.set_ups, reference);
    let knowledge = resolve(&model.unknowns, &settings.knowledge)?;
    every_formula_has_a_value(&effects, &data)?;
    let mut theta = model.start();
    for (value, known) in theta.iter_mut().zip(&knowledge) {
        match known {
            Some(Knowledge::Fixed(v)) | Some(Knowledge::Prior { value: v, .. }) => *value = *v,
            None => {}
        }
    }
    let free: Vec<usize> = (0..theta.len()).filter(|&i| !matches!(knowledge[i], Some(Knowledge::Fixed(_)))).collect();
    let priors: Vec<(usize, f64, f64)> = free
        .iter()
        .enumerate()
        .filter_map(|(column, &i)| match knowledge[i] {
            Some(Knowledge::Prior { value, sigma }) => Some((column, value, sigma)),
            _ => None,
        })
        .collect();

    let declared = crate::units::mm_from_um(machine.probe.repeatability_um);
    let first_sigma = settings.touch_sigma_mm.unwrap_or(declared);
    let nominal = nominal_jacobian(&model, &data.nominal, &theta, &free, &priors, first_sigma);
    let observability = solve::observe(&nominal);
    let mut problem = Touches {
        model: &model,
        observations: &data.observations,
        theta: theta.clone(),
        free: &free,
        priors: &priors,
        sigma: first_sigma,
    };
    let start = DVector::from_iterator(free.len(), free.iter().map(|&i| theta[i]));
    let mut solution = solve::minimise(&problem, start, &observability);
    let gaps = |solution: &solve::Solution, sigma: f64| -> Vec<f64> {
        solution.residual.iter().take(data.observations.len()).map(|r| r * sigma).collect()
    };
    let noise = noise::estimate(&gaps(&solution, first_sigma), &data.repeats, declared, settings.touch_sigma_mm);
    if !priors.is_empty() && (noise.sigma_mm - first_sigma).abs() > 1e-12 {
        // the weight of a prior against the touches depends on the noise that has just been found
        problem.sigma = noise.sigma_mm;
        let nominal = nominal_jacobian(&model, &data.nominal, &theta, &free, &priors, noise.sigma_mm);
        let again = solve::observe(&nominal);
        solution = solve::minimise(&problem, solution.theta.clone(), &again);
    } else {
        let ratio = first_sigma / noise.sigma_mm;
        solution.residual *= ratio;
        solution.covariance /= ratio * ratio;
        problem.sigma = noise.sigma_mm;
    }
    for (column, &i) in free.iter().enumerate() {
        theta[i] = solution.theta[column];
    }
    let residual_mm = gaps(&solution, noise.sigma_mm);
    let mut covariance = DMatrix::zeros(theta.len(), theta.len());
    for (a, &i) in free.iter().enumerate() {
        for (b, &j) in free.iter().enumerate() {
            covariance[(i, j)] = solution.covariance[(a, b)];
        }
    }
    let n = data.observations.len();
    let dof = (n + priors.len()).saturating_sub(observability.rank);
    let chi2 = solution.residual.norm_squared();
    let unseen_share = |column: usize| observability.unseen.iter().map(|v| v[column].abs()).fold(0.0, f64::max);
    let parameters = (0..theta.len()).map(|i| {
        let u = &model.unknowns[i];
        let column = free.iter().position(|&f| f == i);
        let sigma = covariance[(i, i)].sqrt();
        let status = match (column, &knowledge[i]) {
            (None, _) => Status::Fixed,
            (Some(c), _) if unseen_share(c) > 1e-6 => Status::Undetermined,
            // the data halve the prior's variance at least, or the value is the prior's rather than theirs
            (Some(_), Some(Knowledge::Prior { sigma: prior, .. })) if sigma * sigma > 0.5 * prior * prior => {
                Status::PriorDominated
            }
            _ => Status::Identified,
        };
        let has_sigma = matches!(status, Status::Identified | Status::PriorDominated);
        Parameter {
            name: u.name.clone(),
            alias: u.alias.clone(),
            effect: u.effect.clone(),
            value: theta[i],
            unit: u.unit.clone(),
            sigma: has_sigma.then_some(sigma),
            expanded: has_sigma.then_some(sigma * noise.coverage_factor),
            status,
        }
    });
    let parameters: Vec<Parameter> = parameters.collect();
    let free_unknowns: Vec<&Unknown> = free.iter().map(|&i| &model.unknowns[i]).collect();
    let undetermined = observability.unseen.iter().map(|v| statement::undetermined(&free_unknowns, v)).collect();
    let rms_um = crate::units::um_from_mm((residual_mm.iter().map(|r| r * r).sum::<f64>() / n as f64).sqrt());
    let mut warnings = Vec::new();
    if data.observations.iter().all(|o| !o.has_temperature) {
        for effect in effects.iter().filter(|e| e.terms.iter().any(|t| t.formula.variables().contains(&"T"))) {
            warnings.push(format!("effect {} goes with the temperature T, and no touch carries one", effect.id));
        }
    }
    if !solution.converged {
        warnings.push(format!("the search did not converge: {}", solution.stopped));
    }
    if dof == 0 {
        warnings.push("as many unknowns as touches: nothing is left over to judge the model by".into());
    }
    let chi2_per_dof = if dof > 0 { chi2 / dof as f64 } else { f64::NAN };
    if dof > 0 && chi2_per_dof > noise::chi2_limit(dof) {
        warnings.push(format!(
            "the touches miss the model by {:.1} times their noise: something is missing in it, and the uncertainties count the noise only",
            chi2_per_dof.sqrt()
        ));
    }
    let residuals = (0..n).map(|i| {
        let o = &data.observations[i];
        let redundancy = 1.0 - solution.leverage[i];
        // externally studentised: the touch's own share is taken out of the variance
        let w = if redundancy > 1e-9 && dof > 1 {
            let e = solution.residual[i] / redundancy.sqrt();
            let rest = ((chi2 - e * e) / (dof as f64 - 1.0)).max(0.0);
            if rest > 0.0 { e / rest.sqrt() } else { 0.0 }
        } else {
            0.0
        };
        Residual { id: o.id, run: o.run + 1, residual_um: crate::units::um_from_mm(residual_mm[i]), standardised: w }
    });
    let residuals = residuals.collect();
    let outcome = Outcome {
        format: outcome::FORMAT.into(),
        machine: machine.name.clone(),
        effects: settings.effects.clone(),
        converged: solution.converged,
        iterations: solution.iterations,
        stopped: solution.stopped.clone(),
        touches: n + data.unusable.len(),
        rejected: data
            .unusable
            .iter()
            .map(|u| Rejected { id: u.id, run: u.run + 1, reason: format!("{} (line {})", u.reason, u.line) })
            .collect(),
        unknowns: free.len(),
        rank: observability.rank,
        dof,
        condition: observability.condition,
        rms_um,
        held_out_rms_um: None,
        noise_um: crate::units::um_from_mm(noise.sigma_mm),
        noise_source: noise.source.into(),
        visit_um: 0.0,
        chi2_per_dof,
        undetermined,
        parameters,
        reference_mm: reference.into(),
        residuals: Some(residuals),
        warnings,
    };
    Ok(Fit { model, data, theta, residual_mm, covariance, observability, free, outcome })
}

/// A formula that gives no number at a touch would spoil the whole fit: say which, and where.
fn every_formula_has_a_value(effects: &[&Effect], data: &Data) -> Result<()> {
    let mut findings = Vec::new();
    for effect in effects {
        let shapes: Vec<f64> = effect.parameters.iter().map(|p| p.shape.map_or(0.0, |(start, _, _)| start)).collect();
        for term in &effect.terms {
            let bad = |o: &&Observation| !term.formula.eval(&o.state, &shapes).is_finite();
            let n_bad = data.observations.iter().filter(bad).count();
            if let Some(first) = data.observations.iter().find(bad) {
                findings.push(
                    Finding::error(
                        "model::no_value",
                        format!("formula {:?} of effect {} has no value at {n_bad} touches, the first is touch {}", term.formula.text(), effect.id, first.id),
                    )
                    .help("a division by zero, or a root or logarithm of a negative number: write the formula so that it holds at every touch"),
                );
            }
        }
    }
    if findings.is_empty() { Ok(()) } else { Err(Failure(findings)) }
}

/// Which unknowns the user's words mean.
fn resolve(unknowns: &[Unknown], words: &BTreeMap<String, Knowledge>) -> Result<Vec<Option<Knowledge>>> {
    let mut out = vec![None; unknowns.len()];
    let mut findings = Vec::new();
    for (word, known) in words {
        let matches: Vec<usize> = (0..unknowns.len())
            .filter(|&i| crate::symbols::same(&unknowns[i].name, word) || unknowns[i].alias.as_deref() == Some(word))
            .collect();
        match matches[..] {
            [i] => out[i] = Some(*known),
            _ => {
                let names: Vec<&str> = unknowns.iter().map(|u| u.name.as_str()).collect();
                findings.push(
                    Finding::error("model::unknown_parameter", format!("no parameter of the model is called {word:?}"))
                        .help(format!("there are: {}", names.join(", "))),
                );
            }
        }
        // a kilometre or a billion degrees is no knowledge of a machine
        let sane = |v: f64| v.is_finite() && v.abs() < 1e6;
        let bad = match known {
            Knowledge::Fixed(v) => !sane(*v),
            Knowledge::Prior { value, sigma } => !(sane(*value) && sane(*sigma) && *sigma > 0.0),
        };
        if bad {
            findings.push(
                Finding::error("model::knowledge", format!("what is said of {word} is not usable"))
                    .help("value must be a number and sigma greater than 0"),
            );
        }
    }
    if findings.is_empty() { Ok(out) } else { Err(Failure(findings)) }
}

/// Rank of a model on given (nominal) touches, without measurements: what a plan can tell.
///
/// # Errors
/// When an effect is unknown or does not apply.
pub fn observe_plan(
    machine: &Machine,
    catalogue: &Catalogue,
    data: &Data,
    effects: &[String],
) -> Result<(Model, solve::Observability)> {
    let effects = effects_of(effects, catalogue, machine)?;
    let model = Model::new(machine, &effects, &data.set_ups, machine.reference.pivot);
    let theta = model.start();
    let free: Vec<usize> = (0..theta.len()).collect();
    let jacobian = nominal_jacobian(&model, &data.nominal, &theta, &free, &[], 1.0);
    let seen = solve::observe(&jacobian);
    Ok((model, seen))
}

fn nominal_jacobian(
    model: &Model,
    nominal: &[Observation],
    theta: &[f64],
    free: &[usize],
    priors: &[(usize, f64, f64)],
    sigma: f64,
) -> DMatrix<f64> {
    let mut jacobian = DMatrix::zeros(nominal.len() + priors.len(), free.len());
    let mut scratch = model.scratch();
    let mut row = vec![0.0; theta.len()];
    for (i, touch) in nominal.iter().enumerate() {
        model.gap_and_row(touch, theta, &mut scratch, &mut row);
        for (column, &f) in free.iter().enumerate() {
            jacobian[(i, column)] = row[f];
        }
    }
    for (i, (column, _, prior)) in priors.iter().enumerate() {
        jacobian[(nominal.len() + i, *column)] = sigma / prior;
    }
    jacobian
}

/// The touches as a least-squares problem: residuals in units of σ.
struct Touches<'a> {
    model: &'a Model,
    observations: &'a [Observation],
    theta: Vec<f64>,
    free: &'a [usize],
    priors: &'a [(usize, f64, f64)],
    sigma: f64,
}

impl solve::Problem for Touches<'_> {
    fn evaluate(&self, free: &DVector<f64>, residual: &mut DVector<f64>, jacobian: &mut DMatrix<f64>) {
        let mut theta = self.theta.clone();
        for (value, &i) in free.iter().zip(self.free) {
            theta[i] = *value;
        }
        let mut scratch = self.model.scratch();
        let mut row = vec![0.0; theta.len()];
        jacobian.fill(0.0);
        for (i, touch) in self.observations.iter().enumerate() {
            residual[i] = self.model.gap_and_row(touch, &theta, &mut scratch, &mut row) / self.sigma;
            for (column, &f) in self.free.iter().enumerate() {
                jacobian[(i, column)] = row[f] / self.sigma;
            }
        }
        let n = self.observations.len();
        for (i, (column, value, sigma)) in self.priors.iter().enumerate() {
            residual[n + i] = (free[*column] - value) / sigma;
            jacobian[(n + i, *column)] = 1.0 / sigma;
        }
    }

    fn n_rows(&self) -> usize {
        self.observations.len() + self.priors.len()
    }

    fn sigma(&self, row: usize) -> f64 {
        if row < self.observations.len() { self.sigma } else { 0.0 }
    }
}
