//! What effects that are not in a model would do to its touches: columns for tests, type B rows and designs.

use crate::machine::Machine;
use crate::model::catalogue::Effect;
use crate::model::data::Data;
use crate::model::predict::{Model, Observation, Unknown};
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
    let model = Model::new(machine, effects, &data.set_ups, reference);
    let mut theta = model.start();
    let slots = theta.iter_mut().zip(&model.unknowns).filter(|(_, u)| u.shape);
    slots.zip(shapes.unwrap_or_default()).for_each(|((slot, _), value)| *slot = *value);
    let batch = model.prepare(observations);
    let at = batch.at(&theta);
    let layout = model.layout();
    let rows: Vec<Vec<f64>> = (0..observations.len())
        .into_par_iter()
        .map_init(
            || batch.scratch(),
            |scratch, i| {
                let mut row = vec![0.0; layout.row_length(observations[i].set_up)];
                at.gap_and_row(i, scratch, &mut row);
                row
            },
        )
        .collect();
    let mut values = DMatrix::zeros(observations.len(), model.n_unknowns());
    for (i, row) in rows.iter().enumerate() {
        for (value, unknown) in row.iter().zip(layout.row(observations[i].set_up)) {
            values[(i, unknown)] = *value;
        }
    }
    Columns { unknowns: model.unknowns, values }
}
