//! What the sizes of an effect leave in the touches that nothing else could do.

use super::Profile;
use crate::fit::candidates::Trials;
use crate::fit::rank::{NOMINAL_SIGMA_MM, nominal_jacobian};
use crate::fit::shapes;
use crate::fit::solve::RANK_TOLERANCE;
use nalgebra::{DMatrix, DVector};

/// Smaller eigenvalues of a matrix of products, scaled to ones on its diagonal, are rounding.
const LEAST: f64 = 1e-10;

/// Where less than this share of what sizes do is their own, the nominal touches say whether it is a trace: a block askew by
/// 30 mrad would show as much of what leaves none.
pub(super) const FAINT: f64 = 1e-3;

/// The inverse of a matrix of products, without what leaves no trace in it.
pub(super) struct Inverse {
    pub inverse: DMatrix<f64>,
    /// Directions that leave none, in the units of the columns.
    pub lost: Vec<DVector<f64>>,
    /// The smallest eigenvalue of the scaled matrix.
    pub least: f64,
}

/// `raw`: the squares by which it is scaled; `trace`: the matrix of products, with the squares of its own, that says which directions
/// leave a trace, where that is another one.
pub(super) fn inverse(
    gram: &DMatrix<f64>,
    raw: &DVector<f64>,
    trace: Option<&(DMatrix<f64>, DVector<f64>)>,
) -> Inverse {
    let n = gram.nrows();
    let root = |raw: &DVector<f64>| raw.map(|v| if v > 0.0 { v.sqrt() } else { 1.0 });
    let scale = root(raw);
    let scaled = |m: &DMatrix<f64>, by: &DVector<f64>| DMatrix::from_fn(n, n, |a, b| m[(a, b)] / (by[a] * by[b]));
    let of = |v: f64| if v > LEAST { 1.0 / v } else { 0.0 };
    let own = scaled(gram, &scale);
    let (inverse, lost, least) = match trace {
        None => {
            let eigen = own.symmetric_eigen();
            let inverted = DMatrix::from_diagonal(&eigen.eigenvalues.map(of));
            let lost =
                (0..n).filter(|&k| eigen.eigenvalues[k] <= LEAST).map(|k| eigen.eigenvectors.column(k).into_owned());
            let lost: Vec<DVector<f64>> = lost.collect();
            let least = eigen.eigenvalues.iter().copied().fold(f64::INFINITY, f64::min);
            (&eigen.eigenvectors * inverted * eigen.eigenvectors.transpose(), lost, least)
        }
        Some((products, squares)) => {
            let eigen = scaled(products, &root(squares)).symmetric_eigen();
            let (kept, gone): (Vec<usize>, Vec<usize>) = (0..n).partition(|&k| eigen.eigenvalues[k] > LEAST);
            let basis = eigen.eigenvectors.select_columns(&kept);
            let within = (basis.transpose() * own * &basis).symmetric_eigen();
            let basis = basis * &within.eigenvectors;
            let inverted = DMatrix::from_diagonal(&within.eigenvalues.map(of));
            let lost = gone.into_iter().map(|k| eigen.eigenvectors.column(k).into_owned()).collect();
            (&basis * inverted * basis.transpose(), lost, 0.0)
        }
    };
    Inverse {
        inverse: DMatrix::from_fn(n, n, |a, b| inverse[(a, b)] / (scale[a] * scale[b])),
        lost: lost.into_iter().map(|v| v.component_div(&scale)).collect(),
        least,
    }
}

/// Everything else but the sizes of a profile's effect, at the nominal touches of an errorless machine.
pub(super) struct Nominal<'a> {
    /// The effect's columns there, at any shape.
    trials: Trials<'a>,
    /// Orthonormal columns: all that it can do.
    others: DMatrix<f64>,
}

impl<'a> Nominal<'a> {
    pub fn of(profile: &Profile<'a>) -> Self {
        let fit = profile.fit;
        let all = nominal_jacobian(&fit.model, &fit.data, &fit.theta, &fit.free, &fit.priors, Some(&fit.weight));
        let columns: Vec<usize> = profile.rest.iter().filter_map(|i| fit.free.binary_search(i).ok()).collect();
        let mut rest = all.select_columns(&columns);
        for mut column in rest.column_iter_mut() {
            let norm = column.norm();
            if norm > 0.0 {
                column /= norm;
            }
        }
        if rest.nrows() < rest.ncols() {
            rest = rest.resize_vertically(columns.len(), 0.0);
        }
        let factor = rest.qr();
        let svd = factor.r().svd(true, false);
        let top = svd.singular_values.iter().copied().fold(0.0, f64::max);
        let kept: Vec<usize> =
            (0..svd.singular_values.len()).filter(|&k| svd.singular_values[k] > RANK_TOLERANCE * top).collect();
        let within = svd.u.map_or_else(|| DMatrix::zeros(columns.len(), 0), |u| u.select_columns(&kept));
        Self { trials: Trials::of(profile.alone.0, &fit.data.nominal), others: factor.q() * within }
    }

    /// Products of what the sizes alone do with the shape at a value, and the squares of all that each does.
    pub fn products(&self, profile: &Profile, at: f64) -> (DMatrix<f64>, DVector<f64>) {
        let fit = profile.fit;
        let mut values = profile.values.clone();
        values[profile.shape] = at;
        let all = self.trials.columns(&shapes::variant(profile.alone.0, &profile.set, &values)).values;
        let touches = all.columns_range(profile.set.clone()).select_columns(&profile.sizes);
        let n = touches.nrows();
        let mut a = DMatrix::zeros(self.others.nrows().max(n + profile.priors.nrows()), touches.ncols());
        a.rows_mut(0, n).copy_from(&touches);
        for (mut row, weight) in a.row_iter_mut().zip(&fit.weight) {
            row *= weight.sqrt() / NOMINAL_SIGMA_MM;
        }
        a.rows_mut(n, profile.priors.nrows()).copy_from(&profile.priors);
        let raw = DVector::from_iterator(a.ncols(), a.column_iter().map(|c| c.norm_squared()));
        // twice: what is left of the first time is rounding
        for _ in 0..2 {
            let along = self.others.tr_mul(&a);
            a -= &self.others * along;
        }
        (a.tr_mul(&a), raw)
    }
}
