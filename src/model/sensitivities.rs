//! What effects of no size yet would do to every touch: d gap / d size, for many effects and many values of their shapes.
//!
//! Where nothing has a size, no shape moves the chain: how far the gap follows a displacement at each place is computed once per
//! touch, and the column of a parameter is that times its formula. A formula that stands in many effects (the cosine of an axis
//! in six directions) is evaluated once.

use super::formula::{Formula, States};
use super::predict::{Active, Model, Observation};
use nalgebra::DMatrix;
use rayon::prelude::*;
use std::collections::HashMap;

/// How the gap of each touch follows displacements at each place of a model. All that is kept of the touches are columns.
#[derive(Debug)]
pub struct Sensitivities {
    /// d gap / d component, mm per mm or mm per rad: a row for each touch, a column for each component that an effect acts on.
    slope: DMatrix<f64>,
    /// Which column belongs to a component, by 6 × slot + component.
    column: Vec<usize>,
    /// Values of formulas without shape parameters at all touches.
    plain: HashMap<String, Vec<f64>>,
    /// What formulas with shape parameters use.
    states: States,
    /// Body and run of each touch.
    places: Vec<(usize, usize)>,
}

/// Touches that are gone through at once.
const CHUNK: usize = 4096;

impl Sensitivities {
    /// The sensitivities to a model's effects where none has a size.
    #[must_use]
    pub fn new(model: &Model, observations: &[Observation]) -> Self {
        let mut used: Vec<usize> = model.active.iter().map(|a| 6 * a.slot + a.component).collect();
        used.sort_unstable();
        used.dedup();
        let mut column = vec![0; 6 * model.slots.len()];
        used.iter().enumerate().for_each(|(at, &component)| column[component] = at);
        let states = || observations.iter().map(|o| &o.state);
        let formulas = || model.active.iter().map(|a| &a.term.formula);
        let plain: HashMap<&str, &Formula> =
            formulas().filter(|f| f.constant().is_none() && !f.has_shape()).map(|f| (f.text(), f)).collect();
        let of_plain = States::new(plain.values().copied(), states());
        let n = observations.len();
        let value = |(text, formula): (&str, &Formula)| (text.to_owned(), formula.eval_each(&of_plain, 0..n, &[]));
        Self {
            slope: slopes(model, observations, &used),
            column,
            plain: plain.into_par_iter().map(value).collect(),
            states: States::new(formulas().filter(|f| f.has_shape()), states()),
            places: observations.iter().map(|o| (o.set_up, o.run)).collect(),
        }
    }

    /// Number of touches.
    #[must_use]
    pub fn n_touches(&self) -> usize {
        self.places.len()
    }

    /// Adds the columns of the effect whose parameters are the model's unknowns from `first` on, mm per unit, one row per
    /// touch of some (`None`: of all), to `columns` (one after the other); nothing is added to those of shape parameters. `shapes`
    /// are the values of all its parameters, of which only those of shape parameters are looked at.
    pub fn add_columns(
        &self,
        model: &Model,
        touches: Option<&[usize]>,
        (first, shapes): (usize, &[f64]),
        columns: &mut [f64],
    ) {
        match touches {
            Some(some) => self.add_at(model, some.iter().copied(), (first, shapes), columns),
            None => self.add_at(model, 0..self.n_touches(), (first, shapes), columns),
        }
    }

    fn add_at(
        &self,
        model: &Model,
        touches: impl ExactSizeIterator<Item = usize> + Clone,
        (first, shapes): (usize, &[f64]),
        columns: &mut [f64],
    ) {
        let n = touches.len();
        let mut shaped: HashMap<&str, Vec<f64>> = HashMap::new();
        // those of an effect follow one another
        let from = model.active.partition_point(|a| a.first < first);
        for active in model.active[from..].iter().take_while(|a| a.first == first) {
            let formula = &active.term.formula;
            let column = &mut columns[(active.unknown - first) * n..][..n];
            if let Some(constant) = formula.constant() {
                self.add(column, active, touches.clone(), |_, _| constant);
            } else if let Some(values) = self.plain.get(formula.text()) {
                self.add(column, active, touches.clone(), |_, touch| values[touch]);
            } else {
                let values = shaped.entry(formula.text()).or_insert_with(|| {
                    // all terms of one block's effect belong to that block: the other touches are not looked at
                    let here = |touch: &usize| self.acts_on(active, *touch);
                    let mut own = formula.eval_each(&self.states, touches.clone().filter(here), shapes).into_iter();
                    touches.clone().map(|t| if here(&t) { own.next().unwrap_or_default() } else { 0.0 }).collect()
                });
                self.add(column, active, touches.clone(), |at, _| values[at]);
            }
        }
    }

    fn acts_on(&self, active: &Active, touch: usize) -> bool {
        let (set_up, run) = self.places[touch];
        active.acts_in(set_up, run)
    }

    /// Adds what a displacement does to a column, by its coefficient (place in the column, touch); of the effect of one block or run
    /// only at its touches.
    fn add(
        &self,
        column: &mut [f64],
        active: &Active,
        touches: impl Iterator<Item = usize>,
        coefficient: impl Fn(usize, usize) -> f64,
    ) {
        let n = self.n_touches();
        let slope = &self.slope.as_slice()[self.column[6 * active.slot + active.component] * n..][..n];
        let everywhere = active.acts_everywhere();
        for (at, (into, touch)) in column.iter_mut().zip(touches).enumerate() {
            if everywhere || self.acts_on(active, touch) {
                *into += active.factor * (slope[touch] * coefficient(at, touch));
            }
        }
    }
}

/// d gap / d component of some components: a row for each touch.
fn slopes(model: &Model, observations: &[Observation], components: &[usize]) -> DMatrix<f64> {
    let theta = model.start();
    let mut out = DMatrix::zeros(observations.len(), components.len());
    for (number, some) in observations.chunks(CHUNK).enumerate() {
        let batch = model.prepare_places(some);
        let at = batch.at(&theta);
        let mut by_touch = DMatrix::zeros(components.len(), some.len());
        by_touch.as_mut_slice().par_chunks_mut(components.len().max(1)).enumerate().for_each_init(
            || batch.scratch(),
            |scratch, (touch, slopes)| {
                let found = at.slopes(touch, scratch);
                slopes.iter_mut().zip(components).for_each(|(slope, &c)| *slope = found[c / 6][c % 6]);
            },
        );
        out.rows_mut(number * CHUNK, some.len()).copy_from(&by_touch.transpose());
    }
    out
}
