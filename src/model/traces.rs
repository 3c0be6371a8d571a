//! What effects of no size yet would do to every touch: d gap / d size, for many effects and many values of their shapes.
//!
//! Where nothing has a size, no shape moves the chain: how far the gap follows a displacement at each place is computed once per
//! touch, and the column of a parameter is that times its formula. A formula that stands in many effects (the cosine of an axis
//! in six directions) is evaluated once.

use super::batch::Batch;
use super::formula::Formula;
use super::predict::{Active, Model, Observation};
use rayon::prelude::*;
use std::collections::HashMap;

/// Touches whose slopes stand together.
const SOME: usize = 64;

/// How the gap of each touch follows displacements at each place of a model.
#[derive(Debug)]
pub struct Traces<'a> {
    batch: Batch<'a>,
    /// d gap / d component: mm per mm, or mm per rad. Some touches after others; of these, touches of one component side by side.
    slope: Vec<f64>,
    /// Values of formulas without shape parameters at all touches.
    plain: HashMap<&'a str, Vec<f64>>,
}

impl<'a> Traces<'a> {
    /// The traces of a model's effects where none has a size.
    #[must_use]
    pub fn of(model: &'a Model, observations: &'a [Observation]) -> Self {
        let batch = model.prepare_places(observations);
        let n = batch.len();
        let theta = model.start();
        let at = batch.at(&theta);
        let n_components = 6 * model.slots.len();
        let mut slope = vec![0.0; n * n_components];
        slope.par_chunks_mut((SOME * n_components).max(1)).enumerate().for_each_init(
            || batch.scratch(),
            |scratch, (k, part)| {
                let here = part.len() / n_components;
                for i in 0..here {
                    for (c, slope) in at.slopes(k * SOME + i, scratch).iter().flatten().enumerate() {
                        part[c * here + i] = *slope;
                    }
                }
            },
        );
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
            let component = 6 * active.slot + active.component;
            if let Some(constant) = formula.constant() {
                for (at, slope) in self.slopes(component) {
                    self.add(&mut column[at..], active, at, slope.iter().map(|s| s * constant));
                }
                continue;
            }
            let coefficient = match self.plain.get(formula.text()) {
                Some(values) => values,
                // all terms of one block's effect belong to that block: the other touches are not looked at
                None => shaped.entry(formula.text()).or_insert_with(|| {
                    let all = || self.batch.observations().iter();
                    let here = |o: &&Observation| active.set_up.is_none_or(|own| own == o.set_up);
                    let mut own = formula.eval_each(all().filter(here).map(|o| &o.state), shapes).into_iter();
                    all().map(|o| if here(&o) { own.next().unwrap_or_default() } else { 0.0 }).collect()
                }),
            };
            for (at, slope) in self.slopes(component) {
                self.add(&mut column[at..], active, at, slope.iter().zip(&coefficient[at..]).map(|(s, c)| s * c));
            }
        }
    }

    /// The slopes of one component: number of the first touch, and those of it and the next ones.
    fn slopes(&self, component: usize) -> impl Iterator<Item = (usize, &[f64])> {
        let n_components = 6 * self.batch.model().slots.len();
        self.slope.chunks((SOME * n_components).max(1)).enumerate().map(move |(k, part)| {
            let here = part.len() / n_components;
            (k * SOME, &part[component * here..][..here])
        })
    }

    /// Adds amounts to a column from a touch on.
    fn add(&self, column: &mut [f64], active: &Active, from: usize, amounts: impl Iterator<Item = f64>) {
        match active.set_up {
            None => column.iter_mut().zip(amounts).for_each(|(into, amount)| *into += active.factor * amount),
            Some(own) => {
                let touched = self.batch.observations()[from..].iter().map(|o| o.set_up == own);
                for ((into, amount), here) in column.iter_mut().zip(amounts).zip(touched) {
                    if here {
                        *into += active.factor * amount;
                    }
                }
            }
        }
    }
}
