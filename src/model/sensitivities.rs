//! What effects of no size yet would do to every touch: d gap / d size, for many effects and many values of their shapes.
//!
//! Where nothing has a size, no shape moves the chain: how far the gap follows a displacement at each place is computed once per
//! touch, and the column of a parameter is that times its formula. A formula that stands in many effects (the cosine of an axis
//! in six directions) is evaluated once.

use super::batch::Batch;
use super::formula::Formula;
use super::predict::{Active, Model, Observation};
use nalgebra::DMatrix;
use rayon::prelude::*;
use std::collections::HashMap;

/// How the gap of each touch follows displacements at each place of a model.
#[derive(Debug)]
pub struct Sensitivities<'a> {
    batch: Batch<'a>,
    /// d gap / d component, mm per mm or mm per rad: a row for each touch, a column for each component.
    slope: DMatrix<f64>,
    /// Values of formulas without shape parameters at all touches.
    plain: HashMap<&'a str, Vec<f64>>,
}

impl<'a> Sensitivities<'a> {
    /// The sensitivities to a model's effects where none has a size.
    #[must_use]
    pub fn new(model: &'a Model, observations: &'a [Observation]) -> Self {
        let batch = model.prepare_places(observations);
        let n = batch.len();
        let theta = model.start();
        let at = batch.at(&theta);
        let n_components = 6 * model.slots.len();
        let mut by_touch = DMatrix::zeros(n_components, n);
        by_touch.as_mut_slice().par_chunks_mut(n_components.max(1)).enumerate().for_each_init(
            || batch.scratch(),
            |scratch, (touch, slopes)| {
                let found = at.slopes(touch, scratch).iter().flatten();
                slopes.iter_mut().zip(found).for_each(|(slope, found)| *slope = *found);
            },
        );
        let slope = by_touch.transpose();
        drop(at);
        let formulas = model.active.iter().map(|a| &a.term.formula);
        let plain: HashMap<&str, &Formula> =
            formulas.filter(|f| f.constant().is_none() && !f.has_shape()).map(|f| (f.text(), f)).collect();
        let plain = plain
            .into_par_iter()
            .map(|(text, formula)| (text, formula.eval_each(observations.iter().map(|o| &o.state), &[])))
            .collect();
        Self { batch, slope, plain }
    }

    /// Number of touches.
    #[must_use]
    pub fn n_touches(&self) -> usize {
        self.batch.len()
    }

    /// Adds the columns of the effect whose parameters are the model's unknowns from `first` on, mm per unit, one row per
    /// touch, to `columns` (one after the other); nothing is added to those of shape parameters. `shapes` are the values of all
    /// its parameters, of which only those of shape parameters are looked at.
    pub fn add_columns(&self, first: usize, shapes: &[f64], columns: &mut [f64]) {
        let n = self.batch.len();
        let mut shaped: HashMap<&str, Vec<f64>> = HashMap::new();
        for active in self.batch.model().active.iter().filter(|a| a.first == first) {
            let formula = &active.term.formula;
            let column = &mut columns[(active.unknown - first) * n..][..n];
            let slope = self.slope.column(6 * active.slot + active.component);
            if let Some(constant) = formula.constant() {
                self.add(column, active, slope.iter().map(|s| s * constant));
                continue;
            }
            let coefficient = match self.plain.get(formula.text()) {
                Some(values) => values,
                // all terms of one block's effect belong to that block: the other touches are not looked at
                None => shaped.entry(formula.text()).or_insert_with(|| {
                    let all = || self.batch.observations().iter();
                    let here = |o: &&Observation| active.acts_on(o);
                    let mut own = formula.eval_each(all().filter(here).map(|o| &o.state), shapes).into_iter();
                    all().map(|o| if here(&o) { own.next().unwrap_or_default() } else { 0.0 }).collect()
                }),
            };
            self.add(column, active, slope.iter().zip(coefficient).map(|(s, c)| s * c));
        }
    }

    /// Adds amounts to a column; of the effect of one block or run only those of its touches.
    fn add(&self, column: &mut [f64], active: &Active, amounts: impl Iterator<Item = f64>) {
        for ((into, amount), touch) in column.iter_mut().zip(amounts).zip(self.batch.observations()) {
            if active.acts_on(touch) {
                *into += active.factor * amount;
            }
        }
    }
}
