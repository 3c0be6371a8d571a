//! Where the search for a shape parameter begins.
//!
//! A time constant or a pitch leaves no trace while its effect has no size, so that a search from size 0 never moves it.
//! Its values are tried one after another beside the fit of everything else, as a score test does, and the best one is
//! taken with the size that it asks for.

use super::candidates::{Trials, Variant};
use super::local_minima::values;
use super::whitening::Whitening;
use super::{Fit, uncertainty};
use crate::machine::Machine;
use crate::model::catalogue::{Effect, Parameter};
use crate::model::data::Data;
use crate::model::predict::{Model, Observation, Unknown};
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::ops::Range;

/// Values that are tried where the catalogue names none.
const TRIED: usize = 12;

/// Places of a jump that are tried at once, times touches: their columns lie in memory.
const MOST_OF_JUMPS: usize = 400_000;

/// So many places of a jump are tried at once, however many touches there are.
const FEWEST_PLACES: usize = 24;

/// Values that are tried, times touches: more takes longer than a user waits.
const MOST_OF_ALL: usize = 1_500_000;

/// What of an effect the rest of the model could not do as well: with less of it (as a share of the variance) the rest of the model only
/// trades with it, and a size that would show would be thirty times what it does.
const LEAST_OWN: f64 = 1e-3;

/// Shapes that nobody has listed count where their sizes are no more than so many times the typical ones.
pub(super) const CREDIBLE: f64 = 50.0;

/// A size further off than so many typical ones is no machine's.
pub(super) const NOT_CREDIBLE: f64 = 300.0;

/// χ² must fall by this for each parameter, or the data does not show the effect and cannot tell its shape.
pub(super) const LEAST_GAIN: f64 = 9.0;

/// Where the search for the parameters of an effect begins.
#[derive(Debug, Clone, PartialEq)]
pub struct Start {
    /// Value of each unknown of the effect, by name, in its unit; sizes are 0 where the touches do not show it. Where they do, also the
    /// values of the fit beside which it was looked for, its sizes moved to where they belong beside the effect.
    pub values: BTreeMap<String, f64>,
    /// By how much χ² falls.
    pub gain: f64,
    /// Do the touches show the effect?
    pub shown: bool,
}

/// Unknowns of an effect in the model of it alone: all of them, or of one block where it has a set of its own for each. `name`:
/// one of them.
pub(super) fn set_of(alone: &Model, effect: &Effect, name: &str) -> Option<Range<usize>> {
    let at = alone.unknowns.iter().position(|u| u.name == name)?;
    let count = effect.parameters.len();
    let first = at / count * count;
    Some(first..first + count)
}

/// The effect with given values of one set of its parameters; the shapes of other sets are no part of what that one does.
pub(super) fn variant(alone: &Model, set: &Range<usize>, values: &[f64]) -> Variant {
    let value = |i: usize| if set.contains(&i) { values[i - set.start] } else { alone.unknowns[i].start };
    let shapes = (0..alone.n_unknowns()).filter(|&i| alone.unknowns[i].shape).map(value).collect();
    Variant { effects: vec![0], shapes }
}

/// The best start for the parameters of an effect with shape parameters that is not in a fit. Where each block has a set of its own,
/// all sets begin at the same shapes.
#[must_use]
pub fn start_shapes(fit: &Fit, machine: &Machine, effect: &Effect) -> Start {
    let alone = Model::new(machine, &[effect], &fit.data.set_ups, fit.model.reference);
    let trials = Trials::new(&alone, &fit.data.observations);
    let instances = alone.instances(0).iter().map(|&(first, count)| first..first + count);
    ScoreTest::new(fit, effect, (&alone, &trials), instances.collect()).best_start()
}

/// The score test of an effect beside a fit, at any values of its shapes.
struct ScoreTest<'a> {
    fit: &'a Fit,
    effect: &'a Effect,
    /// The effect alone, and its columns at any shapes.
    alone: (&'a Model, &'a Trials<'a>),
    /// One set of the effect's parameters, or one for each block.
    sets: Vec<Range<usize>>,
    /// Places of shapes and of sizes among the effect's parameters.
    shaped: Vec<usize>,
    sizes: Vec<usize>,
    residual: DVector<f64>,
    jacobian: DMatrix<f64>,
    covariance: DMatrix<f64>,
    whitening: Whitening,
}

impl<'a> ScoreTest<'a> {
    fn new(fit: &'a Fit, effect: &'a Effect, alone: (&'a Model, &'a Trials<'a>), sets: Vec<Range<usize>>) -> Self {
        let linear = fit.linear(fit.noise.tau_mm);
        let n = fit.data.observations.len();
        let (shaped, sizes) = (0..effect.parameters.len()).partition(|&i| effect.parameters[i].shape.is_some());
        Self {
            fit,
            effect,
            alone,
            sets,
            shaped,
            sizes,
            residual: linear.residual.rows(0, n).into_owned(),
            jacobian: linear.jacobian.rows(0, n).into_owned(),
            covariance: uncertainty::free_covariance(fit),
            whitening: fit.whitening(fit.noise.tau_mm),
        }
    }

    /// Whitened columns of the sizes of all sets.
    fn columns(&self, shapes: &[f64]) -> DMatrix<f64> {
        let mut values = vec![0.0; self.effect.parameters.len()];
        self.shaped.iter().zip(shapes).for_each(|(&i, v)| values[i] = *v);
        let k = self.sizes.len();
        let mut out = DMatrix::zeros(self.residual.len(), self.sets.len() * k);
        let (model, trials) = self.alone;
        for (s, set) in self.sets.iter().enumerate() {
            let own: Vec<usize> = self.sizes.iter().map(|i| set.start + i).collect();
            let all = trials.columns(&variant(model, set, &values)).values;
            out.columns_mut(s * k, k).copy_from(&all.select_columns(&own));
        }
        self.whitening.apply(&mut out);
        out
    }

    /// By how much χ² falls at some shapes, and the sizes there.
    fn at(&self, shapes: &[f64]) -> (f64, DVector<f64>) {
        let a = self.columns(shapes);
        let n = a.ncols();
        let seen = self.jacobian.tr_mul(&a);
        let raw = a.tr_mul(&a);
        let gram = &raw - seen.tr_mul(&(&self.covariance * &seen));
        let scale = raw.diagonal().map(|d| if d > 0.0 { d.sqrt() } else { 1.0 });
        let scaled = DMatrix::from_fn(n, n, |i, j| gram[(i, j)] / (scale[i] * scale[j]));
        let slope = a.tr_mul(&self.residual).component_div(&scale);
        let eigen = scaled.symmetric_eigen();
        let (mut gain, mut step) = (0.0, DVector::zeros(n));
        for (value, vector) in eigen.eigenvalues.iter().zip(eigen.eigenvectors.column_iter()) {
            if *value > LEAST_OWN {
                let along = vector.dot(&slope);
                gain += along * along / value;
                step -= vector * (along / value);
            }
        }
        (gain, step.component_div(&scale))
    }

    /// Are all sizes below so many usual ones?
    fn is_credible(&self, sizes: &DVector<f64>, times: f64) -> bool {
        let usual = self.sizes.iter().cycle().map(|&i| self.effect.parameters[i].typical);
        usual.zip(sizes.iter()).all(|(usual, v)| v.abs() < times * usual)
    }

    /// The shapes at which χ² falls most: one shape after another, twice, because an effect has few.
    fn best_start(&self) -> Start {
        let (data, n) = (&self.fit.data, self.residual.len());
        let parameter = |k: usize| &self.effect.parameters[self.shaped[k]];
        let mut best: Vec<f64> =
            (0..self.shaped.len()).map(|k| parameter(k).shape.map_or(0.0, |(start, _, _)| start)).collect();
        let mut found = self.at(&best);
        let mut usual = best.clone();
        for _ in 0..if self.shaped.len() > 1 { 2 } else { 1 } {
            for k in 0..self.shaped.len() {
                let p = parameter(k);
                let is_jump = p.between.is_some();
                let times = if is_jump { f64::INFINITY } else { CREDIBLE };
                let mut values = scan(p, data).unwrap_or_else(|| tried(p));
                self.try_all(&values, k, f64::INFINITY, (&mut best, &mut found));
                let look_closer = |values: &mut Vec<f64>, best: &mut Vec<f64>, found: &mut _| {
                    values.sort_by(f64::total_cmp);
                    let finer = around(p, data, values, best[k]);
                    self.try_all(&finer, k, times, (best, found));
                    let is_done = finer.is_empty();
                    values.extend(finer);
                    is_done
                };
                if is_jump {
                    // between any two touches
                    while !look_closer(&mut values, &mut best, &mut found) {}
                    usual[k] = best[k];
                    continue;
                }
                // near the usual values first: there the shape stays if the touches do not show the effect
                let finer = between(&values);
                self.try_all(&finer, k, times, (&mut best, &mut found));
                values.extend(finer);
                look_closer(&mut values, &mut best, &mut found);
                usual[k] = best[k];
                let others = best.clone();
                let mut values = fine(p, n, &|at| {
                    let mut shapes = others.clone();
                    shapes[k] = at;
                    self.columns(&shapes)
                });
                self.try_all(&values, k, times, (&mut best, &mut found));
                for _ in 0..2 {
                    look_closer(&mut values, &mut best, &mut found);
                }
            }
        }
        let (gain, size) = found;
        let n_parameters = (self.shaped.len() + size.len()) as f64;
        let shown = gain > LEAST_GAIN * n_parameters && self.is_credible(&size, NOT_CREDIBLE);
        let mut values = if shown { self.beside(&best, &size) } else { BTreeMap::new() };
        for (s, set) in self.sets.iter().enumerate() {
            let unknowns = &self.alone.0.unknowns[set.clone()];
            for (&i, v) in self.shaped.iter().zip(if shown { &best } else { &usual }) {
                values.insert(unknowns[i].name.clone(), *v);
            }
            for (j, &i) in self.sizes.iter().enumerate() {
                let value = if shown { size[s * self.sizes.len() + j] } else { 0.0 };
                values.insert(unknowns[i].name.clone(), value);
            }
        }
        Start { values, gain, shown }
    }

    /// Values of the unknowns of the fit beside the effect, by name: its sizes have taken over a part of what the effect does, and a search
    /// that begins with both may run away. Its shapes stay; sizes that begin at none again (see [`values`]) are left out.
    fn beside(&self, shapes: &[f64], sizes: &DVector<f64>) -> BTreeMap<String, f64> {
        let (unknowns, theta, free, begins) =
            (&self.fit.model.unknowns, &self.fit.theta, &self.fit.free, values(self.fit));
        let stays = |i: usize| unknowns[i].shape || begins.get(&unknowns[i].name) != Some(&theta[i]);
        let mut covariance = self.covariance.clone();
        let mut moved = &covariance * self.jacobian.tr_mul(&(self.columns(shapes) * sizes));
        // the rest moves as it does beside known values of those that stay
        for k in (0..free.len()).filter(|&k| stays(free[k])) {
            let own = covariance[(k, k)];
            if own > LEAST_OWN * self.covariance[(k, k)] {
                let gain = covariance.column(k) / own;
                moved -= &gain * moved[k];
                covariance -= &gain * covariance.row(k).into_owned();
            }
        }
        let of_shapes =
            (0..unknowns.len()).filter(|&i| unknowns[i].shape).map(|i| (unknowns[i].name.clone(), theta[i]));
        let of_sizes = free.iter().zip(moved.iter()).filter(|(i, _)| !stays(**i));
        of_shapes.chain(of_sizes.map(|(&i, moved)| (unknowns[i].name.clone(), theta[i] - moved))).collect()
    }

    /// Tries values of one shape beside the others' best. Touches on a grid hardly see a wave that is as short as its steps: it follows
    /// the noise with an amplitude as large as the wave is long, so that sizes beyond `times` the usual ones do not count.
    fn try_all(&self, values: &[f64], k: usize, times: f64, (best, found): (&mut [f64], &mut (f64, DVector<f64>))) {
        let others = best.to_vec();
        let at = |value: &f64| {
            let mut shapes = others.clone();
            shapes[k] = *value;
            self.at(&shapes)
        };
        let all: Vec<(f64, DVector<f64>)> = values.par_iter().map(at).collect();
        for (&value, now) in values.iter().zip(all) {
            if now.0 > found.0 && self.is_credible(&now.1, times) {
                best[k] = value;
                *found = now;
            }
        }
    }
}

/// Shape parameters at which something jumps, as the moment at which a block slips: there is no slope that a search could
/// follow, and the best of the scan is held. By name, with its value.
pub(super) fn jumps<'e>(effect: &'e Effect, values: &[f64], data: &Data) -> Vec<(&'e str, f64)> {
    let n = data.observations.len();
    let slope = |which: usize, o: &Observation| {
        effect.terms.iter().any(|t| t.formula.partials(&o.state, values).any(|(k, d)| k == which && d != 0.0))
    };
    (0..effect.parameters.len())
        .filter(|&i| effect.parameters[i].shape.is_some())
        .filter(|&i| data.observations.iter().filter(|o| slope(i, o)).count() <= n / 20)
        .map(|i| (effect.parameters[i].name.as_str(), values[i]))
        .collect()
}

/// Values of a shape parameter to be scanned: those of the catalogue, or the places at which these touches would show a
/// jump: between two index visits, where they are many.
#[must_use]
pub fn scan(p: &Parameter, data: &Data) -> Option<Vec<f64>> {
    if let (Some(variable), Some((_, low, high))) = (p.between, p.shape) {
        let mut all = places(data, variable, false);
        let most = most_places(data);
        if all.len() > most {
            // a visit may be long: some places within it, too
            let within = some_of(&all, most);
            all = some_of(&places(data, variable, true), most);
            all.extend(within);
            all.sort_by(f64::total_cmp);
            all.dedup();
        }
        all.retain(|v| (low..=high).contains(v));
        if !all.is_empty() {
            return Some(all);
        }
    }
    (!p.scan.is_empty()).then(|| p.scan.clone())
}

/// Places of a jump that are tried at once.
fn most_places(data: &Data) -> usize {
    (MOST_OF_JUMPS / data.observations.len().max(1)).clamp(FEWEST_PLACES, 1000)
}

/// At most so many of them, evenly.
fn some_of(all: &[f64], most: usize) -> Vec<f64> {
    let every = all.len().div_ceil(most.max(1)).max(1);
    all.iter().copied().skip(every / 2).step_by(every).collect()
}

/// A stretch of a shape parameter in which a jump shows in the same touches, wherever in it.
#[derive(Debug, Clone, Copy)]
pub(super) struct Stretch {
    pub place: f64,
    pub ends: [f64; 2],
}

/// All stretches in which a jump may be, in order: from one touch to the next; where it is not known which of the parameter's values part
/// touches, half-way to the next value that was tried. `block`: the one whose touches alone show it.
pub(super) fn stretches_of_a_jump(p: &Parameter, data: &Data, block: Option<&str>) -> Vec<Stretch> {
    let half_way = |w: &[f64]| 0.5 * (w[0] + w[1]);
    let mut all: Vec<f64> = match p.between {
        Some(variable) => {
            let shows = |o: &&Observation| block.is_none_or(|block| data.set_ups[o.set_up].label == block);
            data.observations.iter().filter(shows).map(|o| o.state[variable]).collect()
        }
        None => all_tried(p, data),
    };
    all.retain(|v| v.is_finite());
    all.sort_by(f64::total_cmp);
    all.dedup();
    if p.between.is_none() {
        let middles: Vec<f64> = all.windows(2).map(half_way).collect();
        return middles
            .windows(2)
            .zip(all.iter().skip(1))
            .map(|(w, &place)| Stretch { place, ends: [w[0], w[1]] })
            .collect();
    }
    all.windows(2).map(|w| Stretch { place: half_way(w), ends: [w[0], w[1]] }).collect()
}

/// Values between one of a scan's values and its neighbours, for a closer look: places of a jump that the scan did not try (where they
/// are many, some: look again with these among those that were tried), or some steps of a number that changes smoothly.
#[must_use]
pub fn around(p: &Parameter, data: &Data, scanned: &[f64], best: f64) -> Vec<f64> {
    let below = scanned.iter().copied().filter(|v| *v < best).fold(f64::NEG_INFINITY, f64::max);
    let above = scanned.iter().copied().filter(|v| *v > best).fold(f64::INFINITY, f64::min);
    let mut out = match p.between {
        Some(variable) => places(data, variable, false),
        None => between(scanned),
    };
    out.retain(|v| *v > below && *v < above && !scanned.contains(v));
    if p.between.is_some() { some_of(&out, most_places(data)) } else { out }
}

/// Steps between the values of a scan.
#[must_use]
pub fn between(scanned: &[f64]) -> Vec<f64> {
    /// From one value to the next.
    const STEPS: usize = 4;
    let gaps = scanned.windows(2).filter(|w| w[0].is_finite() && w[1].is_finite());
    gaps.flat_map(|w| (1..STEPS).map(|i| w[0] + (w[1] - w[0]) * i as f64 / STEPS as f64)).collect()
}

/// Half-way between successive values of a variable: of all touches, or where the next index visit begins.
fn places(data: &Data, variable: usize, by_visit: bool) -> Vec<f64> {
    let mut at: Vec<(f64, usize)> =
        data.observations.iter().zip(&data.visits).map(|(o, v)| (o.state[variable], *v)).collect();
    at.retain(|a| a.0.is_finite());
    at.sort_by(|a, b| a.0.total_cmp(&b.0));
    let apart = at.windows(2).filter(|w| w[1].0 > w[0].0 && (!by_visit || w[1].1 != w[0].1));
    apart.map(|w| 0.5 * (w[0].0 + w[1].0)).collect()
}

/// Values of a shape parameter over all of its range, so near to each other that what the effect does at one is nearly what it does at
/// the next: no value that fits lies unseen between two of them. `does`: whitened columns of the effect's sizes; `n`: touches.
#[must_use]
pub fn fine(p: &Parameter, n: usize, does: &dyn Fn(f64) -> DMatrix<f64>) -> Vec<f64> {
    /// Before it is looked closer, from one end to the other.
    const COARSE: usize = 24;
    /// What two neighbours have in common (mean squared cosine of the principal angles).
    const ALIKE: f64 = 0.8;
    /// Touches that are enough to see how alike two values are.
    const ENOUGH: usize = 1000;
    let Some((start, low, high)) = p.shape else { return Vec::new() };
    let middle = |a: f64, b: f64| if low > 0.0 { (a * b).sqrt() } else { 0.5 * (a + b) };
    let at = |share: f64| if low > 0.0 { low * (high / low).powf(share) } else { low + (high - low) * share };
    let most = (MOST_OF_ALL / n.max(1)).clamp(3 * COARSE, 1500);
    let some: Vec<usize> = (0..n).step_by(n.div_ceil(ENOUGH).max(1)).collect();
    let basis = |value: f64| -> DMatrix<f64> {
        let a = does(value).select_rows(&some);
        if a.iter().all(|x| x.is_finite()) { a.qr().q() } else { DMatrix::zeros(a.nrows(), a.ncols()) }
    };
    let alike = |a: &DMatrix<f64>, b: &DMatrix<f64>| a.tr_mul(b).norm_squared() / a.ncols().max(1) as f64 > ALIKE;
    let mut values: Vec<(f64, DMatrix<f64>)> =
        (0..=COARSE).map(|k| at(k as f64 / COARSE as f64)).map(|v| (v, basis(v))).collect();
    // stretches that are still to be looked into, the widest first
    let mut open: std::collections::VecDeque<(usize, usize)> = (1..values.len()).map(|k| (k - 1, k)).collect();
    while let Some((a, b)) = open.pop_front().filter(|_| values.len() < most) {
        let value = middle(values[a].0, values[b].0);
        let own = basis(value);
        let (left, right) = (alike(&values[a].1, &own), alike(&own, &values[b].1));
        values.push((value, own));
        let own = values.len() - 1;
        if !(left && right) {
            open.extend([(a, own), (own, b)]);
        }
    }
    let mut values: Vec<f64> =
        values.into_iter().map(|(v, _)| v).chain(p.scan.iter().copied()).chain([start]).collect();
    values.sort_by(f64::total_cmp);
    // one value in two roundings would make a step that is none: of two next to nothing apart either may come out lower
    let same = |a: f64, b: f64| (a - b).abs() <= 1e-9 * a.abs().max(b.abs());
    values.dedup_by(|b, a| same(*b, *a));
    values
}

/// Values of a shape parameter that are tried.
fn tried(p: &Parameter) -> Vec<f64> {
    let Some((start, low, high)) = p.shape else { return Vec::new() };
    let at = |k: usize| {
        let share = k as f64 / (TRIED - 1) as f64;
        if low > 0.0 && high > 10.0 * low { low * (high / low).powf(share) } else { low + (high - low) * share }
    };
    (0..TRIED).map(at).chain([start]).collect()
}

/// All values of a shape parameter that a scan tries.
#[must_use]
pub fn all_tried(p: &Parameter, data: &Data) -> Vec<f64> {
    let mut values = scan(p, data).unwrap_or_else(|| tried(p));
    if p.between.is_none() {
        values.extend(between(&values));
    }
    values
}

/// The range of a shape parameter; none of a size.
pub(super) fn range_of(unknown: &Unknown, effects: &[&Effect]) -> Option<[f64; 2]> {
    let effect = effects.iter().find(|e| e.id == unknown.effect)?;
    let (_, low, high) = effect.parameters.iter().find(|p| p.name == unknown.own_name())?.shape?;
    Some([low, high])
}

/// A free shape that ran out of its range, with the ends of that.
pub(super) fn out_of_range(fit: &Fit, effects: &[&Effect]) -> Option<(String, [f64; 2])> {
    fit.free.iter().find_map(|&i| {
        let u = &fit.model.unknowns[i];
        let [low, high] = range_of(u, effects)?;
        (!(low..=high).contains(&fit.theta[i])).then(|| (u.name.clone(), [low, high]))
    })
}
