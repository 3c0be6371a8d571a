//! What effects that are not in a model would do to its touches: columns for tests, type B rows and designs.

use crate::machine::Machine;
use crate::model::catalogue::Effect;
use crate::model::data::Data;
use crate::model::predict::{Model, Observation, Unknown};
use crate::model::traces::Traces;
use nalgebra::{DMatrix, Vector3};
use rayon::prelude::*;

/// The columns of some effects: d gap / d parameter at zero effect, mm per unit, one row per touch.
#[derive(Debug, Clone)]
pub struct Columns {
    /// Their parameters.
    pub unknowns: Vec<Unknown>,
    /// One row per touch, one column per parameter; those of shape parameters are zero.
    pub values: DMatrix<f64>,
}

impl Columns {
    /// No columns at so many touches.
    #[must_use]
    pub fn none(n_touches: usize) -> Self {
        Self { unknowns: Vec::new(), values: DMatrix::zeros(n_touches, 0) }
    }
}

/// Columns of effects on an otherwise errorless machine: to first order they are those beside any other small errors.
/// `shapes` replaces the values of shape parameters (in their order within the effects).
#[must_use]
pub fn columns(
    machine: &Machine,
    effects: &[&Effect],
    data: &Data,
    observations: &[Observation],
    reference: Vector3<f64>,
    shapes: Option<&[f64]>,
) -> Columns {
    let variant = Variant { effects: (0..effects.len()).collect(), shapes: shapes.unwrap_or_default().to_vec() };
    let mut all = variants(machine, effects, data, observations, reference, &[variant]);
    all.pop().unwrap_or_else(|| Columns::none(observations.len()))
}

/// Some of the effects with values of their shape parameters, in their order within these effects; where there are too few
/// the effects' own stand.
#[derive(Debug, Clone)]
pub struct Variant {
    /// Indices of the effects.
    pub effects: Vec<usize>,
    /// Values of shape parameters, in their units.
    pub shapes: Vec<f64>,
}

/// The same for many choices of effects and shapes at once: the machine's chain is gone through once for all of them.
#[must_use]
pub fn variants(
    machine: &Machine,
    effects: &[&Effect],
    data: &Data,
    observations: &[Observation],
    reference: Vector3<f64>,
    variants: &[Variant],
) -> Vec<Columns> {
    let model = Model::new(machine, effects, &data.set_ups, reference);
    let traces = Traces::of(&model, observations);
    let start = model.start();
    let make = |variant: &Variant| {
        let mut given = variant.shapes.iter();
        let mut unknowns = Vec::new();
        let mut parts = Vec::new();
        for &effect in &variant.effects {
            for &(first, count) in model.instances(effect) {
                let own = &model.unknowns[first..first + count];
                let start = own.iter().zip(&start[first..]);
                let values: Vec<f64> =
                    start.map(|(u, s)| if u.shape { *given.next().unwrap_or(s) } else { *s }).collect();
                unknowns.extend_from_slice(own);
                parts.push(traces.columns(first, count, &values));
            }
        }
        let mut values = DMatrix::zeros(observations.len(), unknowns.len());
        let mut at = 0;
        for part in &parts {
            values.columns_mut(at, part.ncols()).copy_from(part);
            at += part.ncols();
        }
        Columns { unknowns, values }
    };
    variants.par_iter().map(make).collect()
}
