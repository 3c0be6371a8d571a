//! What planned touches will tell of a shape parameter: a time constant, a pitch, the moment of a jump.
//!
//! How well it is told depends on its own value and on how large its effect is: it is looked at where its search begins, with
//! the typical sizes. That another value would do the same to these touches the slope there does not show; so each value of
//! the range is tried against it, as the fit does with what was measured.

use super::linearised_plan::{LinearisedPlan, Task};
use super::record::Expected;
use crate::diag::{Failure, Result};
use crate::fit::candidates::{Trials, Variant};
use crate::fit::span::LeastNorm;
use crate::fit::whitening::Whitening;
use crate::fit::{all_tried, fine, jumps_in_a_design};
use crate::model::catalogue::{Effect, Parameter};
use crate::model::data::Data;
use crate::model::predict::{Model, Unknown};
use crate::search::{Basis, without_rounding};
use crate::units::significant;
use nalgebra::{DMatrix, DVector};
use std::collections::BTreeMap;

/// χ² grows by this much at the ends of a 95 % interval.
const GROWTH_95: f64 = 3.841;

/// Other values that are named, and with how many digits.
const NAMED: usize = 3;
const DIGITS: i32 = 4;

/// Choices of signs of the typical sizes that are tried.
const MOST_SIGNS: usize = 4;

/// What is said of the shape parameters of a model; those that will not be told, and what is another beside another value, lose
/// their uncertainty in `expected`.
pub(super) fn shapes(task: &Task, view: &LinearisedPlan, expected: &mut [Expected]) -> Vec<String> {
    let shaped = task.effects.iter().flat_map(|e| e.parameters.iter().filter_map(move |p| Some((*e, p, p.shape?))));
    // an effect of blocks has one for each
    let is =
        |u: &Unknown, e: &Effect, p: &Parameter| u.effect == e.id && u.name.split('@').next() == Some(p.name.as_str());
    let each = shaped.flat_map(|(e, p, range)| {
        (0..view.model.unknowns.len())
            .filter(move |&i| is(&view.model.unknowns[i], e, p))
            .map(move |i| (e, p, range, i))
    });
    let mut out = Vec::new();
    for (effect, p, (start, low, high), unknown) in each {
        let name = &view.model.unknowns[unknown].name;
        if !view.free.contains(&unknown) {
            if !task.held.iter().any(|h| crate::symbols::same(h, &p.name) || crate::symbols::same(h, name)) {
                out.push(format!(
                    "{} ({}) is found by trying every position between the touches. How well it is determined depends on the size of the jump; the other figures are for the value {}",
                    name,
                    effect.name,
                    with_unit(&significant(view.theta[unknown], DIGITS), &p.unit)
                ));
            }
            continue;
        }
        let looked_at = format!(
            "{} ({}) is examined where it is {} and {} has its typical size",
            name,
            effect.name,
            with_unit(&significant(start, DIGITS), &p.unit),
            effect.id
        );
        let row = expected.iter().position(|x| x.effect == effect.id && x.name == *name);
        let told = row.is_some_and(|r| expected[r].sigma.is_some());
        let others = if told { others(task, view, (effect, p, start), name) } else { Others::default() };
        let what = match (&others.values[..], others.open) {
            _ if !told => "there it has no effect on these touches; other values are not examined".to_owned(),
            ([], None) => "how well it is determined depends on both".to_owned(),
            ([], Some(upwards)) => format!(
                "there these touches may not separate it from any value {} {}",
                if upwards { "up to" } else { "down to" },
                with_unit(&significant(if upwards { high } else { low }, DIGITS), &p.unit)
            ),
            (values, _) => {
                let values: Vec<String> = values.iter().map(|v| significant(*v, DIGITS)).collect();
                format!(
                    "there these touches may not separate it from {}: touch at more positions, or set it to what is known of the machine",
                    with_unit(&values.join(" or "), &p.unit)
                )
            }
        };
        let mut lost = if others.any() { others.lost(expected) } else { Vec::new() };
        lost.extend(row.filter(|_| others.any()));
        let also: Vec<&str> = lost.iter().filter(|r| Some(**r) != row).map(|&r| expected[r].name.as_str()).collect();
        let also = if also.is_empty() { String::new() } else { format!("; with it go {}", also.join(", ")) };
        out.push(format!("{looked_at}: {what}{also}"));
        for r in lost {
            let x = &mut expected[r];
            (x.sigma, x.sigma_with_visits, x.sigma_with_unmodelled) = (None, None, None);
        }
    }
    out
}

fn with_unit(number: &str, unit: &str) -> String {
    if unit == "1" { number.to_owned() } else { format!("{number} {unit}") }
}

/// Values beside the start that these touches may not tell from it.
#[derive(Default)]
struct Others {
    /// Apart from it, with a worse one between: those that come nearest in what they do first.
    values: Vec<f64>,
    /// Nothing tells it from any value up to the upper (`true`) or the lower end of the range.
    open: Option<bool>,
    /// How far each unknown goes with it at most, by name.
    goes: BTreeMap<String, f64>,
}

impl Others {
    fn any(&self) -> bool {
        !self.values.is_empty() || self.open.is_some()
    }

    /// Rows that go with it by more than their own interval.
    fn lost(&self, expected: &[Expected]) -> Vec<usize> {
        const FAR: f64 = 1.96;
        let far = |x: &Expected| {
            let goes = self.goes.get(&x.name).copied().unwrap_or(0.0);
            x.sigma_with_visits.or(x.sigma).is_some_and(|sigma| goes > FAR * sigma)
        };
        (0..expected.len()).filter(|&r| far(&expected[r])).collect()
    }
}

/// Could noise bring χ² there below a limit? What is expected scatters by twice its root.
fn may_be_below(growth: f64, limit: f64) -> bool {
    growth - 2.0 * growth.sqrt() < limit
}

/// What an effect with its typical sizes at the start of a shape could be taken for.
/// `name`: of the unknown, one of a block where the effect has one for each.
fn others(task: &Task, view: &LinearisedPlan, (effect, p, start): (&Effect, &Parameter, f64), name: &str) -> Others {
    let model = Model::new(task.machine, &[effect], &view.data.set_ups, task.reference);
    let trials = Trials::new(&model, &view.data.nominal);
    let shaped: Vec<&Unknown> = model.unknowns.iter().filter(|u| u.shape).collect();
    let starts: Vec<f64> = shaped.iter().map(|u| u.start).collect();
    let which = shaped.iter().position(|u| u.name == name).unwrap_or(0);
    let of = shaped.get(which).and_then(|u| u.set_up);
    let sizes: Vec<usize> =
        (0..model.n_unknowns()).filter(|&i| !model.unknowns[i].shape && model.unknowns[i].set_up == of).collect();
    let white = view.whitening();
    let does = |value: f64| -> DMatrix<f64> {
        let mut shapes = starts.clone();
        shapes[which] = value;
        let all = trials.columns(&Variant { effects: vec![0], shapes });
        let mut columns = all.values.select_columns(&sizes);
        white.apply(&mut columns);
        without_rounding(&mut columns);
        columns.resize_vertically(view.jacobian.nrows(), 0.0)
    };
    let rest: Vec<usize> = (0..view.free.len())
        .filter(|&c| {
            let u = &view.model.unknowns[view.free[c]];
            u.effect != effect.id || u.set_up != of
        })
        .collect();
    let jacobian = view.jacobian.select_columns(&rest);
    let base = Basis::new(&jacobian);
    let places: Vec<(f64, Basis)> = fine(p, view.n_touches(), &does)
        .into_iter()
        .filter_map(|v| Some((v, base.project_columns(&does(v)))).filter(|(_, a)| a.iter().all(|x| x.is_finite())))
        .map(|(v, a)| (v, Basis::new(&a)))
        .collect();
    let (here, follow) = (does(start), Follow::new(&jacobian));
    let limit = GROWTH_95 + 2.0 * (places.len().max(1) as f64).ln();
    let mut out = Others::default();
    let mut found: Vec<(f64, f64)> = Vec::new();
    // a wave of another phase has other rivals
    for signs in 0..(1_usize << sizes.len().saturating_sub(1)).min(MOST_SIGNS) {
        let sign = |k: usize| if k > 0 && signs >> (k - 1) & 1 == 1 { -1.0 } else { 1.0 };
        let typical = DVector::from_fn(sizes.len(), |k, _| sign(k) * model.unknowns[sizes[k]].typical);
        let whole = &here * &typical;
        let signal = base.project(&whole);
        let all: Vec<f64> = places.iter().map(|(_, basis)| basis.project(&signal).norm_squared()).collect();
        let mut rivals: Vec<usize> = Vec::new();
        for upwards in [false, true] {
            let aside = |k: &usize| if upwards { places[*k].0 > start } else { places[*k].0 < start };
            let mut side: Vec<usize> = (0..places.len()).filter(aside).collect();
            if !upwards {
                side.reverse();
            }
            // a range that begins at its start has no such side
            if !side.is_empty() && side.iter().all(|&k| may_be_below(all[k], GROWTH_95)) {
                out.open = Some(upwards);
                rivals.extend(side.last());
                continue;
            }
            // its own values end where one is contradicted
            let end = side.iter().position(|&k| all[k] > GROWTH_95).unwrap_or(side.len());
            for n in end.max(1)..side.len() {
                let growth = |n: usize| side.get(n).map_or(f64::INFINITY, |&k| all[k]);
                // a value that is worse than the one beside it belongs to that one
                let best = growth(n) <= growth(n - 1) && growth(n) <= growth(n + 1);
                if best && may_be_below(growth(n), limit) {
                    found.push((growth(n), places[side[n]].0));
                    rivals.push(side[n]);
                }
            }
        }
        for k in rivals {
            let there = does(places[k].0);
            let size = Follow::new(&base.project_columns(&there)).follow(&signal);
            let go = follow.follow(&(&whole - &there * &size));
            let own = (0..sizes.len()).map(|k| (sizes[k], size[k] - typical[k]));
            let own = own.map(|(i, by)| (model.unknowns[i].name.clone(), by));
            let others =
                rest.iter().zip(go.iter()).map(|(&c, by)| (view.model.unknowns[view.free[c]].name.clone(), *by));
            for (name, by) in own.chain(others) {
                let most = out.goes.entry(name).or_insert(0.0);
                *most = most.max(by.abs());
            }
        }
    }
    found.sort_by(|a, b| a.0.total_cmp(&b.0));
    for (_, value) in found {
        if out.values.len() < NAMED && !out.values.contains(&value) {
            out.values.push(value);
        }
    }
    out
}

/// What unknowns do while they follow something as well as they can.
struct Follow {
    least: LeastNorm,
    scale: Vec<f64>,
}

impl Follow {
    fn new(columns: &DMatrix<f64>) -> Self {
        let norm = |c: nalgebra::DVectorView<f64>| c.norm();
        let scale: Vec<f64> = columns.column_iter().map(norm).map(|n| if n > 0.0 { 1.0 / n } else { 0.0 }).collect();
        let scaled = DMatrix::from_fn(columns.nrows(), columns.ncols(), |r, c| columns[(r, c)] * scale[c]);
        const LEAST: f64 = 1e-7;
        Self { least: LeastNorm::new(&scaled, LEAST), scale }
    }

    fn follow(&self, what: &DVector<f64>) -> DVector<f64> {
        let x = self.least.solve(&DMatrix::from_column_slice(what.len(), 1, what.as_slice()));
        DVector::from_fn(x.len(), |k, _| x[k] * self.scale[k])
    }
}

/// Moments at which something jumps, in a model on planned touches.
pub(super) struct Moments<'a> {
    pub task: &'a Task<'a>,
    pub model: &'a Model,
    pub data: &'a Data,
    pub free: &'a [usize],
    pub white: &'a Whitening,
}

impl Moments<'_> {
    /// Puts each among the touches where its jump leaves most that the rest of the model cannot follow: behind the last touch it
    /// would leave nothing. `jacobian`: whitened, of the free unknowns.
    pub fn put_where_they_show(&self, theta: &mut [f64], jacobian: &DMatrix<f64>) {
        for effect in &self.task.effects {
            for p in jumps_in_a_design(effect, self.data) {
                // an effect of blocks has one for each
                for (i, u) in self.model.unknowns.iter().enumerate() {
                    if u.effect != effect.id || u.name.split('@').next() != Some(p.name.as_str()) {
                        continue;
                    }
                    let rest: Vec<usize> = (0..self.free.len())
                        .filter(|&c| {
                            let other = &self.model.unknowns[self.free[c]];
                            other.effect != effect.id || other.name.split('@').nth(1) != u.name.split('@').nth(1)
                        })
                        .collect();
                    let rest = jacobian.select_columns(&rest);
                    if rest.iter().any(|x| !x.is_finite()) {
                        continue;
                    }
                    if let Some(value) = self.most_visible((effect, p), &u.name, &Basis::new(&rest), jacobian.nrows()) {
                        theta[i] = value;
                    }
                }
            }
        }
    }

    /// The value of a parameter at which its jump leaves most beside everything else.
    fn most_visible(&self, (effect, p): (&Effect, &Parameter), name: &str, base: &Basis, n_rows: usize) -> Option<f64> {
        /// Places that are tried.
        const MOST: usize = 60;
        let alone = Model::new(self.task.machine, &[effect], &self.data.set_ups, self.task.reference);
        let trials = Trials::new(&alone, &self.data.nominal);
        let at = alone.unknowns.iter().position(|u| u.name == name)?;
        let first = at / effect.parameters.len() * effect.parameters.len();
        let own = first..first + effect.parameters.len();
        let shaped: Vec<usize> = (0..alone.n_unknowns()).filter(|&i| alone.unknowns[i].shape).collect();
        let sizes: Vec<usize> = own.filter(|&i| !alone.unknowns[i].shape).collect();
        let typical = DVector::from_fn(sizes.len(), |k, _| alone.unknowns[sizes[k]].typical);
        let kept = |value: f64| {
            let shapes = shaped.iter().map(|&i| if i == at { value } else { alone.unknowns[i].start }).collect();
            let mut all = trials.columns(&Variant { effects: vec![0], shapes }).values.select_columns(&sizes);
            self.white.apply(&mut all);
            base.project(&(all * &typical).resize_vertically(n_rows, 0.0)).norm()
        };
        let places = all_tried(p, self.data);
        let few = places.iter().copied().step_by(places.len().div_ceil(MOST).max(1));
        let best = few.map(|v| (v, kept(v))).filter(|(_, kept)| kept.is_finite());
        best.max_by(|a, b| a.1.total_cmp(&b.1)).map(|(value, _)| value)
    }
}

/// A slope that is no number, as that of a root where it begins, would be one of everything.
///
/// # Errors
/// Names the parameter and the touch.
pub(super) fn every_slope_is_a_number(
    model: &Model,
    data: &Data,
    free: &[usize],
    jacobian: &DMatrix<f64>,
) -> Result<()> {
    let Some(at) = jacobian.iter().position(|x| !x.is_finite()) else { return Ok(()) };
    let (row, column) = (at % jacobian.nrows(), at / jacobian.nrows());
    let u = &model.unknowns[free[column]];
    let touch = data.nominal.get(row).map_or(0, |o| o.id);
    Err(Failure::new(
        "assess::no_slope",
        format!(
            "how the touches go with {} of effect {} is no number at touch {touch}, where it is {}",
            u.name, u.effect, u.start
        ),
    )
    .help("begin it (`start`) where its formula is smooth at all touches"))
}
