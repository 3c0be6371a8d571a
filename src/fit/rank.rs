//! Rank and null directions of a model, and which unknowns are held where combinations leave no trace.

use super::normal::{Prior, Touches};
use super::{effects_of, solve};
use crate::diag::Result;
use crate::machine::Machine;
use crate::model::catalogue::Catalogue;
use crate::model::data::Data;
use crate::model::predict::Model;
use nalgebra::{DMatrix, DVector};

/// Condition up to which the touches as they were made show the rank that the nominal ones have: the two Jacobians differ
/// by what errors and set-ups of some tenths of a millimetre make of levers of some hundred.
const CLEARLY_SEEN: f64 = 300.0;

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
    let clear = solve::observe_gram(gram).filter(|seen| seen.condition < CLEARLY_SEEN);
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
    let mut touches = Touches::new(&nominal, &data.visits, theta.to_vec(), free, priors, (1e-3, 0.0));
    if let Some(weights) = weights {
        touches.set_weights(weights.to_vec());
    }
    let at = DVector::from_iterator(free.len(), free.iter().map(|&i| theta[i]));
    let gram = solve::Problem::normal(&touches, &at, true).gram;
    let mut seen =
        solve::observe_gram(&gram).unwrap_or_else(|| solve::observe(&solve::Problem::jacobian(&touches, &at)));
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
