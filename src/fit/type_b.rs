//! What the touches cannot show of the measurement itself, as the user states it: type B rows, and what each of them makes of
//! the unknowns.

use super::Fit;
use super::candidates::{columns, without_value};
use super::remark::Remark;
use super::uncertainty::free_covariance;
use crate::diag::{Failure, Finding, Result};
use crate::machine::Machine;
use crate::model::catalogue::{Catalogue, Effect};
use crate::model::formula::slot;
use crate::model::predict::Observation;
use nalgebra::{DMatrix, DVector};
use std::collections::BTreeMap;

/// A source of uncertainty that the touches cannot show.
#[derive(Debug, Clone)]
pub(super) struct TypeB {
    pub name: String,
    pub unit: String,
    pub sigma: f64,
    /// What one standard uncertainty of it makes of each free unknown, with its sign, in the unknown's unit.
    pub makes: DVector<f64>,
    /// What a reader must know.
    pub remark: Option<Remark>,
}

/// The type B row of the thermometer, K: what the temperature's own uncertainty makes of all that goes with the temperature.
const THERMOMETER: &str = "temperature";

impl TypeB {
    fn new(name: &str, unit: &str, sigma: f64, moved: &DVector<f64>, per_kelvin: bool) -> Self {
        let name = name.to_owned();
        let remark = match (per_kelvin, moved.amax() == 0.0) {
            (true, _) => Some(Remark::TypeBPerKelvin { name: name.clone() }),
            (false, true) => Some(Remark::TypeBWithoutEffect { name: name.clone() }),
            (false, false) => None,
        };
        Self { name, unit: unit.to_owned(), sigma, makes: moved * sigma, remark }
    }
}

/// The touches with everything warmer by so many kelvins.
fn warmer(fit: &Fit, kelvins: f64) -> Vec<Observation> {
    let at = |o: &Observation| {
        let mut warm = o.clone();
        warm.state[slot::TEMPERATURE] += kelvins;
        warm
    };
    fit.data.observations.iter().map(at).collect()
}

/// What one kelvin more, everywhere and unknown, makes of the free unknowns: by the effects that go with the temperature, each at
/// the size that the model has for it, or at its typical one.
fn per_kelvin_of_all(fit: &Fit, machine: &Machine, catalogue: &Catalogue) -> DVector<f64> {
    let mut column = DVector::zeros(fit.data.observations.len());
    let (cold, warm) = (warmer(fit, 0.0), warmer(fit, 1.0));
    let with_t = |e: &&Effect| e.terms.iter().any(|t| t.formula.variables().contains(&"T"));
    let effects = catalogue.acting_on(machine).filter(|e| !e.is_repeated());
    for effect in effects.filter(with_t).filter(|e| without_value(e, &warm).is_empty()) {
        let at = |o: &[Observation]| columns(machine, &[effect], &fit.data, o, fit.model.reference, None);
        let (before, after) = (at(&cold), at(&warm));
        for (c, u) in before.unknowns.iter().enumerate().filter(|(_, u)| !u.shape) {
            let known = fit.model.unknowns.iter().position(|own| own.name == u.name);
            let size = known.map_or(u.typical, |i| fit.theta[i]);
            column += (after.values.column(c) - before.values.column(c)) * size;
        }
    }
    sensitivity(fit, &column)
}

/// Type B rows as the user states them: by name of a parameter of an effect that is not in the model.
pub(super) fn type_b(
    fit: &Fit,
    machine: &Machine,
    catalogue: &Catalogue,
    stated: &BTreeMap<String, f64>,
) -> Result<Vec<TypeB>> {
    let mut out = Vec::new();
    let mut findings = Vec::new();
    for (word, &sigma) in stated {
        if fit.model.unknowns.iter().any(|u| crate::symbols::same(&u.name, word)) {
            findings.push(
                Finding::error(
                    "model::type_b_in_model",
                    format!("{word:?} is in the model: it cannot be a type B row too"),
                )
                .help("give it a prior under [model.parameters], or take its effect out of the model"),
            );
            continue;
        }
        let is_size = sigma.is_finite() && sigma > 0.0;
        let owner = catalogue.iter().filter(|e| e.applies_to(machine) && !e.paper).find_map(|e| {
            let p = e.parameters.iter().position(|p| crate::symbols::same(&p.name, word))?;
            Some((e, p))
        });
        let is_thermometer = owner.is_none() && word == THERMOMETER;
        if is_thermometer && is_size {
            out.push(TypeB::new(word, "K", sigma, &per_kelvin_of_all(fit, machine, catalogue), false));
            continue;
        }
        if (owner.is_some() || is_thermometer) && !is_size {
            findings.push(
                Finding::error("model::type_b", format!("uncertainty of {word:?} is {sigma}"))
                    .about(word)
                    .help("write a positive number in the parameter's unit"),
            );
            continue;
        }
        let Some((effect, which)) = owner else {
            findings.push(
                Finding::error("model::unknown_type_b", format!("no effect for this machine has a parameter {word:?}"))
                    .about(word)
                    .help("`axiscal effects` lists them, for instance size_X (block-size), dL (tool-length), expansion (ambient-scale); and temperature, K, for the thermometer"),
            );
            continue;
        };
        if let Some(bad) = without_value(effect, &fit.data.observations).first() {
            findings.push(
                Finding::error("model::no_value", format!("{word:?} cannot be a type B row: {}", bad.says()))
                    .about(word)
                    .help("write the formula so that it holds at every touch"),
            );
            continue;
        }
        let with_t = effect.terms.iter().any(|t| t.parameter == which && t.formula.variables().contains(&"T"));
        let per_kelvin = with_t && fit.data.observations.iter().all(|o| !o.has_temperature);
        let observations = warmer(fit, if per_kelvin { 1.0 } else { 0.0 });
        let column = columns(machine, &[effect], &fit.data, &observations, fit.model.reference, None)
            .values
            .column(which)
            .into_owned();
        let moved = sensitivity(fit, &column);
        let p = &effect.parameters[which];
        out.push(TypeB::new(&p.name, &p.unit, sigma, &moved, per_kelvin));
    }
    if findings.is_empty() { Ok(out) } else { Err(Failure(findings)) }
}

/// How much the free unknowns move per unit of something that displaces the touches by `column` (mm per unit).
fn sensitivity(fit: &Fit, column: &DVector<f64>) -> DVector<f64> {
    let theta = fit.free_theta();
    let mut sum = DVector::zeros(fit.free.len());
    fit.with_touches(fit.noise.tau_mm, |touches| {
        for part in touches.parts() {
            let rows: Vec<usize> = part.clone().collect();
            let mut jacobian = touches.unwhitened_of(&theta, &rows).1;
            touches.whiten_of(&rows, &mut jacobian);
            let mut moved = DMatrix::from_column_slice(rows.len(), 1, &column.as_slice()[part.clone()]);
            touches.whiten_of(&rows, &mut moved);
            sum += jacobian.tr_mul(&moved.column(0));
        }
    });
    -(free_covariance(fit) * sum)
}
