//! What effects that are not in a model would do to its touches: columns for tests, type B rows and designs.

use crate::machine::Machine;
use crate::model::catalogue::{Effect, Term};
use crate::model::data::Data;
use crate::model::predict::{Model, Observation, Unknown};
use crate::model::sensitivities::Sensitivities;
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
    let all = Variant { effects: (0..effects.len()).collect(), shapes: shapes.unwrap_or_default().to_vec() };
    Trials::new(&model, observations).columns(&all)
}

/// Columns of all unknowns of a model at some touches, in the order of its θ, at the start of its shape parameters.
#[must_use]
pub(super) fn columns_of(model: &Model, observations: &[Observation]) -> DMatrix<f64> {
    let traces = Sensitivities::new(model, observations);
    let start = model.start();
    let mut values = DMatrix::zeros(observations.len(), model.n_unknowns());
    let mut left = values.as_mut_slice();
    // they stand one after the other
    let mut each: Vec<(usize, usize, &mut [f64])> = Vec::new();
    for (first, count) in model.all_instances() {
        let (own, behind) = left.split_at_mut(count * observations.len());
        each.push((first, count, own));
        left = behind;
    }
    let add = |(first, count, own): (usize, usize, &mut [f64])| {
        traces.add_columns(model, None, (first, &start[first..first + count]), own);
    };
    each.into_par_iter().for_each(add);
    values
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

/// A model's effects at some touches, for many choices of effects and shapes: the machine's chain is gone through once for all
/// of them.
#[derive(Debug)]
pub struct Trials<'a> {
    model: &'a Model,
    traces: Sensitivities,
}

impl<'a> Trials<'a> {
    /// Of the effects of a model, at touches.
    #[must_use]
    pub fn new(model: &'a Model, observations: &[Observation]) -> Self {
        Self { model, traces: Sensitivities::new(model, observations) }
    }

    /// The columns of one choice.
    #[must_use]
    pub fn columns(&self, variant: &Variant) -> Columns {
        columns_at(self.model, &self.traces, variant, None)
    }
}

/// The columns of one choice of a model's effects at some touches (`None`: at all).
#[must_use]
pub fn columns_at(model: &Model, traces: &Sensitivities, variant: &Variant, touches: Option<&[usize]>) -> Columns {
    let mut given = variant.shapes.iter();
    let instances = || variant.effects.iter().flat_map(|&effect| model.instances(effect));
    let n = touches.map_or(traces.n_touches(), <[usize]>::len);
    let n_columns = instances().map(|(_, count)| count).sum();
    let mut unknowns = Vec::with_capacity(n_columns);
    let mut values = DMatrix::zeros(n, n_columns);
    for &(first, count) in instances() {
        let own = &model.unknowns[first..first + count];
        let value = |u: &Unknown| if u.shape { *given.next().unwrap_or(&u.start) } else { u.start };
        let shapes: Vec<f64> = own.iter().map(value).collect();
        let into = &mut values.as_mut_slice()[unknowns.len() * n..(unknowns.len() + count) * n];
        traces.add_columns(model, touches, (first, &shapes), into);
        unknowns.extend_from_slice(own);
    }
    Columns { unknowns, values }
}

/// What to do about a formula without a value at some touches.
pub const NO_VALUE_HELP: &str = "a division by zero, a tangent at 90°, or a root or logarithm of a negative number: write the formula so that it has a value at every touch";

/// A formula that has no usable value at some touches.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct NoValue {
    /// Id of the effect.
    pub effect: String,
    /// Number of the term.
    pub term: usize,
    pub formula: String,
    /// How many touches.
    pub n_touches: usize,
    /// Number of the first one in its plan.
    pub first: u64,
    /// There is a value, and at its usual size the effect would displace the touch by more than a kilometre.
    pub too_large: bool,
}

impl NoValue {
    /// In words.
    #[must_use]
    pub fn says(&self) -> String {
        crate::words::fit::no_value(self)
    }

    /// In words, for an effect that is only a candidate.
    #[must_use]
    pub fn left_out(&self) -> String {
        crate::words::fit::not_a_candidate(self)
    }
}

/// A displacement beyond this, mm, at an effect's usual size is none of a machine: such a column would drown all others.
const MOST_MM: f64 = 1e6;

/// What a turn makes of a touch, mm per rad.
const LEVER_MM: f64 = 1e3;

/// The formulas of an effect that have no usable value at some touch, at the shapes where it starts and at those that are tried.
#[must_use]
pub fn without_value(effect: &Effect, observations: &[Observation]) -> Vec<NoValue> {
    let starts: Vec<f64> = effect.parameters.iter().map(|p| p.shape.map_or(0.0, |(start, _, _)| start)).collect();
    let mut shapes = vec![starts.clone()];
    for (i, p) in effect.parameters.iter().enumerate() {
        shapes.extend(p.scan.iter().map(|value| {
            let mut tried = starts.clone();
            tried[i] = *value;
            tried
        }));
    }
    let of_term = |(number, term): (usize, &Term)| -> Option<NoValue> {
        let formula = &term.formula;
        let tried = if formula.has_shape() { &shapes[..] } else { &shapes[..1] };
        let p = &effect.parameters[term.parameter];
        let size = (p.typical * p.factor).abs() * if term.component >= 3 { LEVER_MM } else { 1.0 };
        let is_bad = |v: f64| !v.is_finite() || v.abs() * size > MOST_MM;
        let is_usable = |o: &Observation| !tried.iter().any(|s| is_bad(formula.eval(&o.state, s)));
        let mut bad = observations.iter().filter(|o| !is_usable(o));
        let first = bad.next()?;
        let too_large = tried.iter().all(|s| formula.eval(&first.state, s).is_finite());
        Some(NoValue {
            effect: effect.id.clone(),
            term: number,
            formula: formula.text().to_owned(),
            n_touches: 1 + bad.count(),
            first: first.id,
            too_large,
        })
    };
    effect.terms.iter().enumerate().filter_map(of_term).collect()
}

/// Candidates that have a value at every touch, and those that are left out: its column would be no number, and
/// would spoil what is said of all the others. The built-in ones have a value everywhere.
#[must_use]
pub fn with_values<'c>(effects: Vec<&'c Effect>, observations: &[Observation]) -> (Vec<&'c Effect>, Vec<NoValue>) {
    let mut left_out = Vec::new();
    let kept = effects.into_iter().filter(|e| {
        let bad = if e.built_in { Vec::new() } else { without_value(e, observations) };
        left_out.extend(bad.first().cloned());
        bad.is_empty()
    });
    (kept.collect(), left_out)
}
