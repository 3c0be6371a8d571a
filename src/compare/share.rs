//! Which share of a misfit some columns would explain, had the model held them.

use crate::fit::whitening::Whitening;
use crate::fit::{Fit, uncertainty};
use crate::probability::f_sf;
use nalgebra::{DMatrix, DVector};

/// Directions of which the model leaves less than this share (of the norm's square) are its own already.
const LEAST_LEFT: f64 = 1e-3;

/// What columns explain.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Share {
    /// Of the misfit's excess over the noise, 0 to 1; about 0 on pure noise.
    pub share: f64,
    /// Probability that noise alone does as well.
    pub p: f64,
    /// Degrees of freedom that the columns add.
    pub rank: usize,
    /// How much better the touches are described, less the price of the columns: n·ln(χ²/χ²after) − rank·ln n
    /// (Schwarz's criterion). Of two splits that explain alike, the one with fewer groups says more.
    pub evidence: f64,
}

/// A fit at its minimum, whitened.
pub(super) struct Misfit<'f> {
    fit: &'f Fit,
    residual: DVector<f64>,
    jacobian: DMatrix<f64>,
    covariance: DMatrix<f64>,
    whitening: Whitening,
}

impl<'f> Misfit<'f> {
    pub(super) fn new(fit: &'f Fit) -> Self {
        let linear = fit.linear(fit.noise.tau_mm);
        let n = fit.data.observations.len();
        Self {
            fit,
            residual: linear.residual.rows(0, n).into_owned(),
            jacobian: linear.jacobian.rows(0, n).into_owned(),
            covariance: uncertainty::free_covariance(fit),
            whitening: fit.whitening(fit.noise.tau_mm),
        }
    }

    /// Sums of columns (one row per touch) beside the model: AᵀPA and AᵀPr with P = I − JCJᵀ, columns of unit norm.
    pub(super) fn beside(&self, mut columns: DMatrix<f64>) -> ColumnsBesideModel {
        self.whitening.apply(&mut columns);
        for mut column in columns.column_iter_mut() {
            let norm = column.norm();
            if norm > 0.0 {
                column /= norm;
            }
        }
        let seen = self.jacobian.tr_mul(&columns);
        let gram = columns.tr_mul(&columns) - seen.tr_mul(&(&self.covariance * &seen));
        ColumnsBesideModel {
            n: self.fit.n_used() as f64,
            gram,
            slope: columns.tr_mul(&self.residual),
            chi2: self.fit.chi2,
            dof: self.fit.dof as f64,
        }
    }
}

pub(super) struct ColumnsBesideModel {
    /// Touches used.
    n: f64,
    gram: DMatrix<f64>,
    slope: DVector<f64>,
    chi2: f64,
    dof: f64,
}

impl ColumnsBesideModel {
    /// What a choice of the columns explains.
    ///
    /// With the misfit χ² on ν degrees of freedom and the part S that q columns take away, the excess is χ² − ν and the
    /// columns account for S − q·s², s² = max(1, (χ² − S)/(ν − q)): what columns of no meaning would take away is taken
    /// off. An excess within four of its own standard deviations, √2ν, counts as that much, or noise would be divided by
    /// next to nothing.
    pub(super) fn share(&self, choice: &[usize]) -> Share {
        let gram = DMatrix::from_fn(choice.len(), choice.len(), |a, b| self.gram[(choice[a], choice[b])]);
        let slope = DVector::from_iterator(choice.len(), choice.iter().map(|&c| self.slope[c]));
        let eigen = gram.symmetric_eigen();
        let (mut taken, mut rank) = (0.0, 0);
        for (value, vector) in eigen.eigenvalues.iter().zip(eigen.eigenvectors.column_iter()) {
            if *value > LEAST_LEFT {
                taken += vector.dot(&slope).powi(2) / value;
                rank += 1;
            }
        }
        let q = rank as f64;
        let rest = self.dof - q;
        if rank == 0 || rest < 1.0 {
            return Share { share: 0.0, p: 1.0, rank, evidence: f64::NEG_INFINITY };
        }
        let left = (self.chi2 - taken).max(0.0);
        let per_dof = (left / rest).max(1.0);
        let excess = (self.chi2 - self.dof).max(4.0 * (2.0 * self.dof).sqrt());
        let share = ((taken - q * per_dof) / excess).clamp(0.0, 1.0);
        let p = f_sf(taken / q / (left / rest).max(1e-300), q, rest).unwrap_or(1.0);
        let n = self.n;
        let evidence = n * (self.chi2 / left.max(1e-9 * self.chi2)).ln() - q * n.ln();
        Share { share, p, rank, evidence }
    }
}
