//! The interval of a shape parameter: how far a time constant or a pitch may go before the touches contradict it.
//!
//! Sizes enter the touches linearly and their intervals are as wide on either side. A shape does not: a time constant that
//! came out too short looks better known than it is. So each of its values is held in turn, everything else follows, and the
//! interval ends where χ² has grown by k² (the likelihood profile of D. M. Bates and D. G. Watts, *Nonlinear Regression
//! Analysis and Its Applications*, 1988, section 6.1). All but the effect's own sizes follow linearly, as they nearly do. A size
//! beside a shape that is told weakly may be all that it is beside any of the shape's values that the touches allow.

use super::candidates::columns;
use super::{Fit, shapes};
use crate::machine::Machine;
use crate::model::catalogue::Effect;
use nalgebra::{DMatrix, DVector};
use std::collections::BTreeMap;

/// Steps from the value to the end of its usual interval: a profile that goes up and down is followed to its first crossing.
const STEPS: f64 = 4.0;
/// After so many steps each goes further than the one before.
const EVEN: usize = 32;
/// Steps at most: they reach the end of any range.
const MOST_STEPS: usize = 120;
/// Halvings between two steps.
const HALVINGS: usize = 30;

/// 95 % intervals of shape parameters and of the sizes beside them, by index among the unknowns, in their units; an end is none
/// where the touches set none within the range of the shape. `spread`: standard uncertainty and t-factor of a free unknown at
/// the solution. `held`: shapes that the search holds.
#[must_use]
pub fn intervals(
    fit: &Fit,
    machine: &Machine,
    effects: &[&Effect],
    held: &[String],
    spread: &dyn Fn(usize) -> Option<(f64, f64)>,
) -> BTreeMap<usize, [Option<f64>; 2]> {
    let mut out = BTreeMap::new();
    for effect in effects.iter().filter(|e| !e.per_block) {
        for p in effect.parameters.iter().filter(|p| p.shape.is_some()) {
            let Some(unknown) = fit.model.unknowns.iter().position(|u| u.effect == effect.id && u.name == p.name)
            else {
                continue;
            };
            let free = fit.free.contains(&unknown);
            if !free && !held.contains(&p.name) {
                continue;
            }
            let Some(profile) = Profile::new(fit, machine, effect, unknown) else { continue };
            let Some((_, low, high)) = p.shape else { continue };
            // a shape that the touches do not tell may be any of those that were tried
            let (places, tried) = match spread(unknown).filter(|_| free) {
                Some(of) => {
                    let ends = profile.ends(of, [low, high]);
                    out.insert(unknown, ends);
                    (between([ends[0].unwrap_or(low), ends[1].unwrap_or(high)]), 1)
                }
                None => {
                    let mut places = shapes::all_tried(p, &fit.data);
                    places.extend([low, high, fit.theta[unknown]]);
                    let n = places.len();
                    (places, n)
                }
            };
            profile.widen(&places, tried, spread, &mut out);
        }
    }
    out
}

/// Places from one end to the other, by equal factors where both are above 0.
fn between([low, high]: [f64; 2]) -> Vec<f64> {
    const PLACES: usize = 40;
    let at = |k: usize| {
        let share = k as f64 / PLACES as f64;
        if low > 0.0 { low * (high / low).powf(share) } else { low + (high - low) * share }
    };
    (0..=PLACES).map(at).collect()
}

/// χ² as a function of one shape parameter, everything else following.
struct Profile<'a> {
    fit: &'a Fit,
    machine: &'a Machine,
    effect: &'a Effect,
    /// Place of the shape among the effect's parameters.
    shape: usize,
    /// Values of the effect's parameters at the solution.
    values: Vec<f64>,
    /// Places of the free sizes among the effect's parameters.
    sizes: Vec<usize>,
    /// Whitened residuals of touches and priors.
    residual: DVector<f64>,
    /// Whitened Jacobian of all free unknowns but the shape and the sizes.
    others: DMatrix<f64>,
    /// The others' covariance.
    covariance: DMatrix<f64>,
    /// Index of each size among the unknowns.
    unknowns: Vec<usize>,
    /// Rows of the priors in the columns of the sizes, and in that of the shape.
    priors: DMatrix<f64>,
    prior_of_shape: DVector<f64>,
    /// What the effect does at the solution.
    now: DVector<f64>,
}

impl<'a> Profile<'a> {
    fn new(fit: &'a Fit, machine: &'a Machine, effect: &'a Effect, unknown: usize) -> Option<Self> {
        let places = effect
            .parameters
            .iter()
            .map(|p| fit.model.unknowns.iter().position(|u| u.effect == effect.id && u.name == p.name))
            .collect::<Option<Vec<usize>>>()?;
        let shape = places.iter().position(|&i| i == unknown)?;
        let free = |i: usize| fit.free.binary_search(&places[i]).ok();
        let sizes: Vec<usize> =
            (0..places.len()).filter(|&i| effect.parameters[i].shape.is_none() && free(i).is_some()).collect();
        let own: Vec<usize> = sizes.iter().filter_map(|&i| free(i)).collect();
        let here = free(shape);
        let linear = fit.linear(fit.noise.tau_mm);
        let n = fit.data.observations.len();
        let rest: Vec<usize> = (0..fit.free.len()).filter(|c| Some(*c) != here && !own.contains(c)).collect();
        let others = linear.jacobian.select_columns(&rest);
        let n_priors = linear.jacobian.nrows() - n;
        let prior_rows = linear.jacobian.rows(n, n_priors);
        let priors = prior_rows.select_columns(&own);
        let prior_of_shape = here.map_or_else(|| DVector::zeros(n_priors), |c| prior_rows.column(c).into_owned());
        let mut out = Self {
            fit,
            machine,
            effect,
            shape,
            values: places.iter().map(|&i| fit.theta[i]).collect(),
            unknowns: sizes.iter().map(|&i| places[i]).collect(),
            sizes,
            residual: linear.residual,
            covariance: inverse(&others.tr_mul(&others)),
            others,
            priors,
            prior_of_shape,
            now: DVector::zeros(0),
        };
        out.now = out.does(out.values[shape]).1;
        Some(out)
    }

    /// Whitened columns of the effect's free sizes at a value of the shape, and what its sizes do there (touches only).
    fn does(&self, at: f64) -> (DMatrix<f64>, DVector<f64>) {
        let mut values = self.values.clone();
        values[self.shape] = at;
        let shapes: Vec<f64> =
            values.iter().zip(&self.effect.parameters).filter(|(_, p)| p.shape.is_some()).map(|(v, _)| *v).collect();
        let data = &self.fit.data;
        let reference = self.fit.model.reference;
        let mut all = columns(self.machine, &[self.effect], data, &data.observations, reference, Some(&shapes)).values;
        self.fit.whitening(self.fit.noise.tau_mm).apply(&mut all);
        let size = |i: usize| if self.effect.parameters[i].shape.is_some() { 0.0 } else { values[i] };
        let does = &all * DVector::from_fn(values.len(), |i, _| size(i));
        (all.select_columns(&self.sizes), does)
    }

    /// What χ² and the sizes are while the shape is held at a value.
    fn held(&self, at: f64) -> Held {
        let (columns, does) = self.does(at);
        let n = columns.nrows();
        if does.iter().any(|x| !x.is_finite()) {
            return Held { growth: f64::INFINITY, sizes: Vec::new() };
        }
        let mut y = self.residual.clone();
        let mut touches = y.rows_mut(0, n);
        touches += does - &self.now;
        let n_priors = y.len() - n;
        let mut known = y.rows_mut(n, n_priors);
        known += &self.prior_of_shape * (at - self.values[self.shape]);
        let mut a = DMatrix::zeros(y.len(), columns.ncols());
        a.rows_mut(0, n).copy_from(&columns);
        a.rows_mut(n, n_priors).copy_from(&self.priors);
        let (seen, along) = (self.others.tr_mul(&a), self.others.tr_mul(&y));
        let gram = a.tr_mul(&a) - seen.tr_mul(&(&self.covariance * &seen));
        let slope = a.tr_mul(&y) - seen.tr_mul(&(&self.covariance * &along));
        let (inverse, whole) = (inverse(&gram), y.norm_squared() - along.dot(&(&self.covariance * &along)));
        let step = &inverse * &slope;
        let sizes = self.sizes.iter().enumerate();
        Held {
            growth: whole - slope.dot(&step) - self.residual.norm_squared(),
            sizes: sizes.map(|(c, &i)| (self.values[i] - step[c], inverse[(c, c)].max(0.0).sqrt())).collect(),
        }
    }

    /// The values below and above the shape's at which χ² has grown by k².
    fn ends(&self, (sigma, k): (f64, f64), range: [f64; 2]) -> [Option<f64>; 2] {
        let (value, width) = (self.values[self.shape], k * sigma);
        let inside = |at: f64| self.held(at).growth < k * k;
        let end = |side: f64, limit: f64| -> Option<f64> {
            if width.is_nan() || width <= 0.0 {
                return None;
            }
            let (mut last, mut stride) = (value, width / STEPS);
            for step in 0..MOST_STEPS {
                let at = last + side * stride;
                let (at, over) = if side * (at - limit) >= 0.0 { (limit, true) } else { (at, false) };
                if !inside(at) {
                    let (mut from, mut to) = (last, at);
                    for _ in 0..HALVINGS {
                        let middle = 0.5 * (from + to);
                        if inside(middle) { from = middle } else { to = middle }
                    }
                    return Some(0.5 * (from + to));
                }
                if over {
                    return None;
                }
                last = at;
                if step > EVEN {
                    stride *= 1.2;
                }
            }
            None
        };
        [end(-1.0, range[0]), end(1.0, range[1])]
    }

    /// Intervals of the sizes: all that each may be beside some places of the shape, of which the best of `tried` was taken.
    fn widen(
        &self,
        places: &[f64],
        tried: usize,
        spread: &dyn Fn(usize) -> Option<(f64, f64)>,
        out: &mut BTreeMap<usize, [Option<f64>; 2]>,
    ) {
        // the best of many places is better by chance
        let chance = 2.0 * (tried as f64).ln();
        let held: Vec<Held> = places.iter().map(|&at| self.held(at)).collect();
        let lowest = held.iter().map(|h| h.growth).fold(0.0, f64::min);
        for (c, (&i, &unknown)) in self.sizes.iter().zip(&self.unknowns).enumerate() {
            let Some((sigma, k)) = spread(unknown) else { continue };
            let value = self.values[i];
            let [mut low, mut high] = [value - k * sigma, value + k * sigma];
            for h in &held {
                let room = k * k + chance - (h.growth - lowest);
                if let Some((at, sigma)) = h.sizes.get(c).filter(|_| room > 0.0) {
                    (low, high) = (low.min(at - sigma * room.sqrt()), high.max(at + sigma * room.sqrt()));
                }
            }
            out.insert(unknown, [Some(low), Some(high)]);
        }
    }
}

/// What follows while a shape is held.
struct Held {
    /// By how much χ² has grown.
    growth: f64,
    /// Value and standard uncertainty of each free size.
    sizes: Vec<(f64, f64)>,
}

/// The inverse of a matrix of products; of what leaves no trace in it, none.
fn inverse(gram: &DMatrix<f64>) -> DMatrix<f64> {
    /// Smaller eigenvalues of the matrix scaled to ones on its diagonal are rounding.
    const LEAST: f64 = 1e-10;
    let scale = gram.diagonal().map(|v| if v > 0.0 { v.sqrt() } else { 1.0 });
    let n = gram.nrows();
    let eigen = DMatrix::from_fn(n, n, |a, b| gram[(a, b)] / (scale[a] * scale[b])).symmetric_eigen();
    let of = |v: f64| if v > LEAST { 1.0 / v } else { 0.0 };
    let inverse =
        &eigen.eigenvectors * DMatrix::from_diagonal(&eigen.eigenvalues.map(of)) * eigen.eigenvectors.transpose();
    DMatrix::from_fn(n, n, |a, b| inverse[(a, b)] / (scale[a] * scale[b]))
}
