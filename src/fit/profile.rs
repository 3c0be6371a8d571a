//! The interval of a shape parameter: how far a time constant or a pitch may go before the touches contradict it.
//!
//! Sizes enter the touches linearly and their intervals are as wide on either side. A shape does not: a time constant that
//! came out too short looks better known than it is. So each of its values is held in turn, everything else follows, and the
//! interval ends where χ² has grown by k² (the likelihood profile of D. M. Bates and D. G. Watts, *Nonlinear Regression
//! Analysis and Its Applications*, 1988, section 6.1). All but the effect's own sizes follow linearly, as they nearly do.

use super::Fit;
use super::candidates::columns;
use crate::machine::Machine;
use crate::model::catalogue::Effect;
use nalgebra::{DMatrix, DVector};

/// Steps from the value to the end of its usual interval: a profile that goes up and down is followed to its first crossing.
const STEPS: f64 = 4.0;
/// Usual intervals after which the end is that of the parameter's range.
const FURTHEST: f64 = 8.0;
/// Halvings between two steps.
const HALVINGS: usize = 30;

/// The values below and above that of a free shape parameter, by its index among the unknowns and in its unit, at which χ² has
/// grown by k²; the ends of its range where it does not grow so far. `sigma`: its standard uncertainty at the solution.
/// `None` for what is no shape parameter, or one of an effect that has a set for each block.
#[must_use]
pub fn interval(
    fit: &Fit,
    machine: &Machine,
    effects: &[&Effect],
    unknown: usize,
    (sigma, k): (f64, f64),
) -> Option<[f64; 2]> {
    let u = &fit.model.unknowns[unknown];
    let effect = effects.iter().find(|e| e.id == u.effect && !e.per_block)?;
    let (_, low, high) = effect.parameters.iter().find(|p| p.name == u.name)?.shape?;
    let profile = Profile::new(fit, machine, effect, unknown)?;
    let value = fit.theta[unknown];
    let width = k * sigma;
    if !(width > 0.0 && width.is_finite()) {
        return None;
    }
    let end = |side: f64, limit: f64| -> f64 {
        let inside = |at: f64| profile.growth(at) < k * k;
        let mut last = value;
        for step in 1..=(STEPS * FURTHEST) as usize {
            let at = value + side * width * step as f64 / STEPS;
            let (at, over) = if side * (at - limit) >= 0.0 { (limit, true) } else { (at, false) };
            if !inside(at) {
                let (mut from, mut to) = (last, at);
                for _ in 0..HALVINGS {
                    let middle = 0.5 * (from + to);
                    if inside(middle) { from = middle } else { to = middle }
                }
                return 0.5 * (from + to);
            }
            if over {
                return limit;
            }
            last = at;
        }
        limit
    };
    Some([end(-1.0, low), end(1.0, high)])
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
    /// Rows of the priors in the columns of the sizes.
    priors: DMatrix<f64>,
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
        let here = free(shape)?;
        let linear = fit.linear(fit.noise.tau_mm);
        let n = fit.data.observations.len();
        let rest: Vec<usize> = (0..fit.free.len()).filter(|c| *c != here && !own.contains(c)).collect();
        let others = linear.jacobian.select_columns(&rest);
        let n_priors = linear.jacobian.nrows() - n;
        let priors = linear.jacobian.rows(n, n_priors).select_columns(&own);
        let mut out = Self {
            fit,
            machine,
            effect,
            shape,
            values: places.iter().map(|&i| fit.theta[i]).collect(),
            sizes,
            residual: linear.residual,
            covariance: inverse(&others.tr_mul(&others)),
            others,
            priors,
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

    /// By how much χ² grows while the shape is held at a value.
    fn growth(&self, at: f64) -> f64 {
        let (columns, does) = self.does(at);
        let n = columns.nrows();
        if does.iter().any(|x| !x.is_finite()) {
            return f64::INFINITY;
        }
        let mut y = self.residual.clone();
        let mut touches = y.rows_mut(0, n);
        touches += does - &self.now;
        let mut a = DMatrix::zeros(y.len(), columns.ncols());
        a.rows_mut(0, n).copy_from(&columns);
        a.rows_mut(n, y.len() - n).copy_from(&self.priors);
        let (seen, along) = (self.others.tr_mul(&a), self.others.tr_mul(&y));
        let gram = a.tr_mul(&a) - seen.tr_mul(&(&self.covariance * &seen));
        let slope = a.tr_mul(&y) - seen.tr_mul(&(&self.covariance * &along));
        let left = y.norm_squared() - along.dot(&(&self.covariance * &along)) - slope.dot(&(inverse(&gram) * &slope));
        left - self.residual.norm_squared()
    }
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
