//! Rank and null directions of a model, and which unknowns are held where combinations leave no trace.

use super::normal::{Prior, Touches};
use super::{effects_of, solve};
use crate::diag::Result;
use crate::machine::Machine;
use crate::model::catalogue::{Catalogue, Effect, Parameter};
use crate::model::data::Data;
use crate::model::predict::Model;
use nalgebra::{DMatrix, DVector};

/// Rank and null directions, and the condition where the unknowns are least correlated. From the Gram matrix of the
/// touches as they were made where that is beyond doubt, else from the nominal touches: errors of the machine itself
/// must not make a combination look seen.
pub(super) fn observe(
    gram: &DMatrix<f64>,
    model: &Model,
    data: &Data,
    theta: &[f64],
    free: &[usize],
    priors: &[Prior],
    weights: &[f64],
) -> (solve::Observability, f64) {
    // beside large sizes of an effect with a shape what no nominal touch sees may look clear
    let clear = solve::observe_clearly(gram).filter(|_| !has_shapes(model));
    let (seen, nominal) = match clear {
        // nothing is lost, nothing is held
        Some(seen) => (seen, None),
        None => {
            let (seen, gram) = observe_nominal(model, data, theta, free, priors, Some(weights));
            (seen, Some(gram))
        }
    };
    let mut change = DMatrix::identity(free.len(), free.len());
    for (offset, tilt, lever) in model.least_correlated(&data.observations) {
        if let (Ok(o), Ok(t)) = (free.binary_search(&offset), free.binary_search(&tilt)) {
            change[(o, t)] += lever;
        }
    }
    let condition = solve::condition(&(change.tr_mul(nominal.as_ref().unwrap_or(gram)) * &change), seen.rank);
    (seen, condition)
}

/// Has an effect of the model a shape parameter, searched for or held?
fn has_shapes(model: &Model) -> bool {
    model.unknowns.iter().any(|u| u.shape)
}

/// Rank and null directions at the nominal touches, with the Gram matrix there.
fn observe_nominal(
    model: &Model,
    data: &Data,
    theta: &[f64],
    free: &[usize],
    priors: &[Prior],
    weights: Option<&[f64]>,
) -> (solve::Observability, DMatrix<f64>) {
    let nominal = model.prepare(&data.nominal);
    let at = |theta: &[f64]| {
        let mut touches = Touches::new(&nominal, &data.visits, theta.to_vec(), free, priors, (1e-3, 0.0));
        if let Some(weights) = weights {
            touches.set_weights(weights.to_vec());
        }
        (touches, DVector::from_iterator(free.len(), free.iter().map(|&i| theta[i])))
    };
    let is_free = |i: usize| free.binary_search(&i).is_ok();
    let of_shapes = |i: usize| {
        let u = &model.unknowns[i];
        !u.shape && model.unknowns.iter().any(|s| s.shape && s.effect == u.effect)
    };
    // a search that goes on from another one begins at its values: they are no errorless machine
    let bare_at = |i: usize| {
        let u = &model.unknowns[i];
        if !u.shape && (of_shapes(i) || is_free(i)) { u.start } else { theta[i] }
    };
    let bare: Vec<f64> = (0..theta.len()).map(bare_at).collect();
    let (mut seen, gram) = if has_shapes(model) {
        // a shape needs the sizes of its effect to leave a trace; nothing else does, and beside them a tilt that no touch sees
        // would leave one of second order
        let sized: Vec<f64> = (0..theta.len()).map(|i| if of_shapes(i) { theta[i] } else { bare[i] }).collect();
        let jacobian_at = |theta: &[f64]| {
            let (touches, at) = at(theta);
            solve::Problem::jacobian(&touches, &at)
        };
        let (mut jacobian, there) = (jacobian_at(&bare), jacobian_at(&sized));
        for c in (0..free.len()).filter(|&c| model.unknowns[free[c]].shape) {
            jacobian.set_column(c, &there.column(c));
        }
        let gram = jacobian.tr_mul(&jacobian);
        (solve::observe_gram(&gram).unwrap_or_else(|| solve::observe(&jacobian)), gram)
    } else {
        let (touches, at) = at(&bare);
        let gram = solve::Problem::normal(&touches, &at, true).gram;
        let seen =
            solve::observe_gram(&gram).unwrap_or_else(|| solve::observe(&solve::Problem::jacobian(&touches, &at)));
        (seen, gram)
    };
    seen.hold(held_first(model, free));
    (seen, gram)
}

/// Free columns in the order in which they are held where a combination leaves no trace: results before set-ups, which stand
/// anywhere within tenths of a millimetre, and what stands last in the list of effects before what it was added to.
#[must_use]
pub fn held_first(model: &Model, free: &[usize]) -> Vec<usize> {
    let (set_ups, results): (Vec<usize>, Vec<usize>) =
        (0..free.len()).rev().partition(|&c| model.unknowns[free[c]].nuisance);
    [results, set_ups].concat()
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
    let seen = observe_nominal(&model, data, &theta, &free, &[], None).0;
    Ok((model, seen))
}

/// The unknowns that a search will follow on planned touches: not those that are held, and not a moment at which something
/// jumps, which is found by trying all places between touches.
#[must_use]
pub fn free_in_a_design(model: &Model, effects: &[&Effect], data: &Data, held: &[String]) -> Vec<usize> {
    let is_held = |name: &str| held.iter().any(|h| crate::symbols::same(h, name));
    let jumps: Vec<(&str, &str)> = effects
        .iter()
        .flat_map(|e| jumps_in_a_design(e, data).into_iter().map(|p| (e.id.as_str(), p.name.as_str())))
        .collect();
    // an effect of blocks has one for each
    let own = |name: &'_ str| name.split('@').next().unwrap_or_default().to_owned();
    let of = |i: &usize| {
        let u = &model.unknowns[*i];
        !is_held(&u.name) && !jumps.iter().any(|(effect, name)| u.effect == *effect && own(&u.name) == *name)
    };
    (0..model.n_unknowns()).filter(of).collect()
}

/// Shape parameters of an effect at which something jumps, as the search will take them.
#[must_use]
pub fn jumps_in_a_design<'e>(effect: &'e Effect, data: &Data) -> Vec<&'e Parameter> {
    let usual: Vec<f64> = effect.parameters.iter().map(|p| p.shape.map_or(p.typical, |s| s.0)).collect();
    let names = super::nonlinear_scan::jumps(effect, &usual, data);
    effect.parameters.iter().filter(|p| names.iter().any(|(name, _)| *name == p.name)).collect()
}

/// Jacobian of touches that are only planned, mm per unit, before whitening: at an errorless machine, but a shape parameter
/// (a time constant, a pitch) where its effect has its typical size. Without a size nothing depends on its shape. Only the
/// shape's own column is taken there: errors of the machine must not make a combination look seen.
#[must_use]
pub fn design_jacobian(touches: &Touches, model: &Model, free: &[usize]) -> DMatrix<f64> {
    let start = DVector::from_iterator(free.len(), free.iter().map(|&i| model.unknowns[i].start));
    let mut jacobian = touches.unwhitened(&start).1;
    let shapes: Vec<usize> = (0..free.len()).filter(|&c| model.unknowns[free[c]].shape).collect();
    if !shapes.is_empty() {
        let mut shown = start;
        for (c, &i) in free.iter().enumerate() {
            let u = &model.unknowns[i];
            if !u.shape && shapes.iter().any(|&s| model.unknowns[free[s]].effect == u.effect) {
                shown[c] = u.typical;
            }
        }
        let there = touches.unwhitened(&shown).1;
        for c in shapes {
            jacobian.set_column(c, &there.column(c));
        }
    }
    jacobian
}
