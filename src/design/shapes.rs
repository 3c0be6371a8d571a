//! What planned touches will tell of a shape parameter: a time constant, a pitch, the moment of a jump.
//!
//! How well it is told depends on its own value and on how large its effect is: it is looked at where its search begins, with
//! the typical sizes. That another value would do the same to these touches the slope there does not show; so each value of
//! the range is tried against it, as the fit does with what was measured.

use super::record::Expected;
use super::view::{Task, View};
use crate::fit::candidates::{Trials, Variant};
use crate::fit::fine;
use crate::model::catalogue::{Effect, Parameter};
use crate::model::predict::Model;
use crate::search::Basis;
use nalgebra::{DMatrix, DVector};

/// χ² grows by this much at the ends of a 95 % interval.
const GROWTH_95: f64 = 3.841;

/// Other values that are named.
const NAMED: usize = 3;

/// What is said of the shape parameters of a model; those that will not be told, and the sizes that are others beside another
/// value, lose their uncertainty in `expected`.
pub(super) fn shapes(task: &Task, view: &View, expected: &mut [Expected]) -> Vec<String> {
    let shared = task.effects.iter().filter(|e| !e.per_block);
    let shaped = shared.flat_map(|e| e.parameters.iter().filter(|p| p.shape.is_some()).map(move |p| (*e, p)));
    let mut out = Vec::new();
    for (effect, p) in shaped {
        let is = |i: &usize| view.model.unknowns[*i].effect == effect.id && view.model.unknowns[*i].name == p.name;
        if !view.free.iter().any(is) {
            out.extend(p.between.map(|_| {
                format!(
                    "{} ({}) will be found by trying every place between the touches: how well it will be told depends on how large the jump is, and the rest is what is expected where it is known",
                    p.name, effect.name
                )
            }));
            continue;
        }
        let Some((start, low, high)) = p.shape else { continue };
        let tried = Tried::new(task, view, effect, p, start);
        let looked_at = format!(
            "{} ({}) is looked at where it is {} and {} has its typical sizes",
            p.name,
            effect.name,
            with_unit(&shown(start), &p.unit),
            effect.id
        );
        let row = |name: &str| expected.iter().position(|x| x.effect == effect.id && x.name == name);
        let told = row(&p.name).is_some_and(|r| expected[r].sigma.is_some());
        let others = if told { tried.others() } else { Others::default() };
        let what = match (&others.values[..], others.open) {
            _ if !told => "there it leaves no trace, and of other values nothing is said here".to_owned(),
            ([], None) => "how well it will be told, and what goes with it, depends on both".to_owned(),
            ([], Some(upwards)) => format!(
                "there these touches will not tell it from any value {} {}",
                if upwards { "up to" } else { "down to" },
                with_unit(&shown(if upwards { high } else { low }), &p.unit)
            ),
            (values, _) => {
                let values: Vec<String> = values.iter().map(|v| shown(*v)).collect();
                format!(
                    "there these touches will not tell it from {}: touches at more positions would, or hold it at what is known of the machine",
                    with_unit(&values.join(" or "), &p.unit)
                )
            }
        };
        out.push(format!("{looked_at}: {what}"));
        if !others.values.is_empty() || others.open.is_some() {
            let lost = others.far_sizes(expected, &tried).into_iter().chain(row(&p.name));
            for r in lost.collect::<Vec<_>>() {
                let x = &mut expected[r];
                (x.sigma, x.sigma_with_visits, x.sigma_with_unmodelled) = (None, None, None);
            }
        }
    }
    out
}

fn shown(value: f64) -> String {
    let text = format!("{value:.3}");
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}

fn with_unit(number: &str, unit: &str) -> String {
    if unit == "1" { number.to_owned() } else { format!("{number} {unit}") }
}

/// Values of a shape parameter, each against the effect with the typical sizes at its start.
struct Tried<'a> {
    effect: &'a Effect,
    /// Names of the sizes with their typical values.
    sizes: Vec<(String, f64)>,
    start: f64,
    /// Values over the range, in order, with what the effect does at each: beside what the rest of the model follows.
    places: Vec<(f64, DMatrix<f64>)>,
    /// What it does at the start with its typical sizes.
    signal: DVector<f64>,
}

/// Values beside the start that these touches cannot tell from it.
#[derive(Default)]
struct Others {
    /// Apart from it, with a better one between neither: the nearest in what they do first.
    values: Vec<f64>,
    /// Nothing tells it from any value up to the upper (`true`) or the lower end of the range.
    open: Option<bool>,
    /// The effect's sizes at all those values.
    sizes: Vec<DVector<f64>>,
}

impl Others {
    /// Rows of sizes that are others there, by more than twice what their interval is.
    fn far_sizes(&self, expected: &[Expected], tried: &Tried) -> Vec<usize> {
        const FAR: f64 = 2.0 * 1.96;
        let own = tried.sizes.iter().enumerate().filter_map(|(k, (name, typical))| {
            let r = expected.iter().position(|x| x.effect == tried.effect.id && x.name == *name)?;
            let sigma = expected[r].sigma_with_visits.or(expected[r].sigma)?;
            self.sizes.iter().any(|s| (s[k] - typical).abs() > FAR * sigma).then_some(r)
        });
        own.collect()
    }
}

impl<'a> Tried<'a> {
    fn new(task: &Task, view: &View, effect: &'a Effect, p: &Parameter, start: f64) -> Self {
        let model = Model::new(task.machine, &[effect], &view.data.set_ups, task.reference);
        let trials = Trials::of(&model, &view.data.nominal);
        let shaped = || effect.parameters.iter().filter(|p| p.shape.is_some());
        let starts: Vec<f64> = shaped().filter_map(|p| p.shape.map(|s| s.0)).collect();
        let which = shaped().position(|q| q.name == p.name).unwrap_or(0);
        let own: Vec<usize> = (0..model.n_unknowns()).filter(|&i| !model.unknowns[i].shape).collect();
        let does = |value: f64| -> DMatrix<f64> {
            let mut shapes = starts.clone();
            shapes[which] = value;
            let all = trials.columns(&Variant { effects: vec![0], shapes });
            view.whitened(&all.values.select_columns(&own))
        };
        let others = (0..view.free.len()).filter(|&c| view.model.unknowns[view.free[c]].effect != effect.id);
        let base = Basis::new(&view.jacobian.select_columns(&others.collect::<Vec<_>>()));
        let sizes: Vec<(String, f64)> =
            own.iter().map(|&i| (model.unknowns[i].name.clone(), model.unknowns[i].typical)).collect();
        let typical = DVector::from_iterator(sizes.len(), sizes.iter().map(|s| s.1));
        let values = fine(p, view.n_touches(), &does);
        Self {
            signal: base.project(&(does(start) * typical)),
            places: values.into_iter().map(|v| (v, base.project_columns(&does(v)))).collect(),
            effect,
            sizes,
            start,
        }
    }

    /// By how much χ² is higher at a value, and the sizes there.
    fn growth(&self, columns: &DMatrix<f64>) -> (f64, DVector<f64>) {
        let norms: Vec<f64> = columns.column_iter().map(|c| c.norm()).collect();
        let scale = |k: usize| if norms[k] > 0.0 { 1.0 / norms[k] } else { 0.0 };
        let scaled = DMatrix::from_fn(columns.nrows(), columns.ncols(), |r, c| columns[(r, c)] * scale(c));
        let zero = DVector::zeros(columns.ncols());
        if scaled.iter().any(|x| !x.is_finite()) {
            return (f64::INFINITY, zero);
        }
        let x = scaled.clone().svd(true, true).solve(&self.signal, 1e-6).unwrap_or(zero);
        let left = (&self.signal - scaled * &x).norm_squared();
        (left, DVector::from_fn(x.len(), |k, _| x[k] * scale(k)))
    }

    fn others(&self) -> Others {
        let all: Vec<(f64, DVector<f64>)> = self.places.iter().map(|(_, columns)| self.growth(columns)).collect();
        let limit = GROWTH_95 + 2.0 * (all.len().max(1) as f64).ln();
        let mut out = Others::default();
        let mut found: Vec<(f64, f64)> = Vec::new();
        let below: Vec<usize> = (0..all.len()).rev().filter(|&k| self.places[k].0 < self.start).collect();
        let above: Vec<usize> = (0..all.len()).filter(|&k| self.places[k].0 > self.start).collect();
        for (side, upwards) in [(below, false), (above, true)] {
            // its own values end where one is contradicted
            let Some(end) = side.iter().position(|&k| all[k].0 > GROWTH_95) else {
                // a range that begins at its start has no such side
                if let Some(&last) = side.last() {
                    out.open = Some(upwards);
                    out.sizes.push(all[last].1.clone());
                }
                continue;
            };
            for n in end..side.len() {
                let growth = |n: usize| side.get(n).map_or(f64::INFINITY, |&k| all[k].0);
                // a value that is worse than the one beside it belongs to that one, the first to the start
                let best = n > 0 && growth(n) <= growth(n - 1) && growth(n) <= growth(n + 1);
                if best && growth(n) < limit {
                    found.push((growth(n), self.places[side[n]].0));
                    out.sizes.push(all[side[n]].1.clone());
                }
            }
        }
        found.sort_by(|a, b| a.0.total_cmp(&b.0));
        out.values = found.into_iter().map(|f| f.1).take(NAMED).collect();
        out
    }
}
