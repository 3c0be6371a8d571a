//! What everything else does while a shape is held at a value.

use super::Profile;
use crate::fit::nonlinear_scan;
use nalgebra::{DMatrix, DVector};

/// What moves by more than this share of its usual size along with something that leaves no trace leaves none either.
const NO_TRACE: f64 = 0.01;

impl Profile<'_> {
    /// What χ² and the sizes are while the shape is held at a value.
    pub fn held(&self, at: f64) -> Held {
        let (columns, does) = self.does(at);
        let n = columns.nrows();
        if does.iter().any(|x| !x.is_finite()) {
            return Held { growth: f64::INFINITY, sizes: Vec::new(), others: Vec::new() };
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
        let follow = &self.covariance * self.others.tr_mul(&a);
        let followed = &self.covariance * self.others.tr_mul(&y);
        // what the others cannot do, row by row: as a difference of products what is next to nothing would be rounding
        let own = &a - &self.others * &follow;
        let left = &y - &self.others * &followed;
        let slope = own.tr_mul(&left);
        let raw = DVector::from_iterator(a.ncols(), a.column_iter().map(|c| c.norm_squared()));
        let gram = own.tr_mul(&own);
        // what leaves hardly a trace here would fit with any size, of metres: nobody believes that
        let limit = |c: usize| {
            let i = self.sizes[c];
            nonlinear_scan::CREDIBLE * self.effect.parameters[i].typical.max(self.values[i].abs())
        };
        let belief = DVector::from_fn(self.sizes.len(), |c, _| limit(c).powi(-2));
        let value = DVector::from_fn(self.sizes.len(), |c, _| self.values[self.sizes[c]]);
        let believed = |size: &DVector<f64>| size.component_mul(&belief).dot(size);
        let Inverse { lost, .. } = inverse(&gram, &raw);
        let inverse = inverse(&(&gram + DMatrix::from_diagonal(&belief)), &raw).inverse;
        let step = &inverse * (&slope + belief.component_mul(&value));
        let grows = left.norm_squared() - 2.0 * slope.dot(&step) + step.dot(&(&gram * &step))
            - self.residual.norm_squared()
            + believed(&(&value - &step))
            - believed(&value);
        let sizes = self.sizes.iter().enumerate();
        // what the others do while the sizes and they settle, and how far they scatter there
        let moved = &follow * &step - &followed;
        let scatter = &follow * &inverse;
        // a size that leaves no trace here may be anything, and so may what follows it
        let typical = |c: usize| self.effect.parameters[self.sizes[c]].typical;
        let free: Vec<DVector<f64>> = lost
            .iter()
            .map(|v| v / v.iter().enumerate().map(|(c, w)| w.abs() / typical(c)).fold(0.0, f64::max))
            .collect();
        let size_sigma = |c: usize| {
            let is_lost = free.iter().any(|v| v[c].abs() > NO_TRACE * typical(c));
            if is_lost { f64::INFINITY } else { inverse[(c, c)].max(0.0).sqrt() }
        };
        let others = (0..self.rest.len()).map(|r| {
            let variance = self.covariance[(r, r)] + scatter.row(r).dot(&follow.row(r));
            let along_with = free.iter().map(|v| (follow.row(r) * v).x.abs()).fold(0.0, f64::max);
            let is_lost = along_with > NO_TRACE * self.fit.model.unknowns[self.rest[r]].typical;
            (self.fit.theta[self.rest[r]] + moved[r], if is_lost { f64::INFINITY } else { variance.max(0.0).sqrt() })
        });
        Held {
            others: others.collect(),
            growth: grows,
            sizes: sizes.map(|(c, &i)| (self.values[i] - step[c], size_sigma(c))).collect(),
        }
    }
}

/// What follows while a shape is held.
pub(super) struct Held {
    /// By how much χ² has grown.
    pub growth: f64,
    /// Value and standard uncertainty of each free size.
    pub sizes: Vec<(f64, f64)>,
    /// The same of every other free unknown.
    pub others: Vec<(f64, f64)>,
}

/// The inverse of a matrix of products, without what leaves no trace in it, and the directions that leave none.
pub(super) struct Inverse {
    pub inverse: DMatrix<f64>,
    lost: Vec<DVector<f64>>,
}

/// `raw`: the squares by which it is scaled.
pub(super) fn inverse(gram: &DMatrix<f64>, raw: &DVector<f64>) -> Inverse {
    /// Smaller eigenvalues of the scaled matrix are rounding.
    const LEAST: f64 = 1e-10;
    let scale = raw.map(|v| if v > 0.0 { v.sqrt() } else { 1.0 });
    let n = gram.nrows();
    if n == 0 {
        return Inverse { inverse: gram.clone(), lost: Vec::new() };
    }
    let eigen = DMatrix::from_fn(n, n, |a, b| gram[(a, b)] / (scale[a] * scale[b])).symmetric_eigen();
    let of = |v: f64| if v > LEAST { 1.0 / v } else { 0.0 };
    let inverse =
        &eigen.eigenvectors * DMatrix::from_diagonal(&eigen.eigenvalues.map(of)) * eigen.eigenvectors.transpose();
    let lost = (0..n).filter(|&k| eigen.eigenvalues[k] <= LEAST);
    Inverse {
        inverse: DMatrix::from_fn(n, n, |a, b| inverse[(a, b)] / (scale[a] * scale[b])),
        lost: lost.map(|k| eigen.eigenvectors.column(k).component_div(&scale)).collect(),
    }
}
