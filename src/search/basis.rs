//! An orthonormal basis of what the base model can follow.

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

/// Singular values of the column-scaled Jacobian below this share of the largest are zero.
pub const TOLERANCE: f64 = 1e-7;

/// Rows that are factored at once: 60 columns of them stay in a processor's cache.
const CHUNK: usize = 1024;

/// The leading left singular vectors Q of a base Jacobian (rows: touches, whitened).
#[derive(Debug, Clone)]
pub struct Basis {
    /// Qᵀ, rank × rows: the vector of a touch is a contiguous column.
    q_t: DMatrix<f64>,
}

impl Basis {
    /// From a whitened Jacobian, with [`TOLERANCE`]. Columns may be dependent or empty.
    #[must_use]
    pub fn new(jacobian: &DMatrix<f64>) -> Self {
        Self::with_tolerance(jacobian, TOLERANCE)
    }

    /// From a whitened Jacobian; singular values below `tolerance` of the largest, after scaling each column to unit
    /// norm, are zero.
    #[must_use]
    pub fn with_tolerance(jacobian: &DMatrix<f64>, tolerance: f64) -> Self {
        let n = jacobian.nrows();
        let norms: Vec<f64> = jacobian.column_iter().map(|c| c.norm()).collect();
        let largest = norms.iter().copied().fold(0.0, f64::max);
        let seen: Vec<usize> = (0..norms.len()).filter(|&i| norms[i] > 1e-12 * largest).collect();
        if seen.is_empty() {
            return Self { q_t: DMatrix::zeros(0, n) };
        }
        let mut scaled = jacobian.select_columns(&seen);
        for (mut column, &i) in scaled.column_iter_mut().zip(&seen) {
            column /= norms[i];
        }
        let svd = triangle(&scaled).svd(false, true);
        let top = svd.singular_values.max();
        let Some(v_t) = svd.v_t else { return Self { q_t: DMatrix::zeros(0, n) } };
        let kept: Vec<usize> =
            (0..svd.singular_values.len()).filter(|&i| svd.singular_values[i] > tolerance * top).collect();
        let mut into = v_t.select_rows(&kept);
        for (mut row, &i) in into.row_iter_mut().zip(&kept) {
            row /= svd.singular_values[i];
        }
        // weak directions come out orthogonal to about machine precision times their condition: once more
        Self { q_t: orthonormal(into * scaled.transpose()) }
    }

    /// Rank p.
    #[must_use]
    pub fn rank(&self) -> usize {
        self.q_t.nrows()
    }

    #[must_use]
    pub fn n_rows(&self) -> usize {
        self.q_t.ncols()
    }

    /// Qᵀ, rank × rows.
    #[must_use]
    pub fn transposed(&self) -> &DMatrix<f64> {
        &self.q_t
    }

    /// (I − QQᵀ) v.
    #[must_use]
    pub fn project(&self, v: &DVector<f64>) -> DVector<f64> {
        v - self.q_t.tr_mul(&(&self.q_t * v))
    }

    /// (I − QQᵀ) M, column by column.
    #[must_use]
    pub fn project_columns(&self, m: &DMatrix<f64>) -> DMatrix<f64> {
        m - self.q_t.transpose() * (&self.q_t * m)
    }

    /// Share of its own residual that the base model takes away, of a row.
    #[must_use]
    pub fn leverage(&self, row: usize) -> f64 {
        self.q_t.column(row).norm_squared()
    }

    /// The basis with further columns in the base model; returns how many new directions they brought.
    /// Directions of which less than `kept` of the column's norm is left after projection are none.
    pub fn extend(&mut self, columns: &DMatrix<f64>, kept: f64) -> usize {
        let mut scaled = columns.clone();
        for mut column in scaled.column_iter_mut() {
            let norm = column.norm();
            if norm > 0.0 {
                column /= norm;
            }
        }
        // twice: what is left of a nearly aliased column is mostly rounding after once
        let left = self.project_columns(&self.project_columns(&scaled));
        let gram = (left.transpose() * &left).symmetric_eigen();
        let directions: Vec<usize> =
            (0..gram.eigenvalues.len()).filter(|&i| gram.eigenvalues[i] > kept * kept).collect();
        if directions.is_empty() {
            return 0;
        }
        let rows = orthonormal((left * gram.eigenvectors.select_columns(&directions)).transpose());
        let p = self.rank();
        let mut q_t = DMatrix::zeros(p + rows.nrows(), self.n_rows());
        q_t.rows_mut(0, p).copy_from(&self.q_t);
        q_t.rows_mut(p, rows.nrows()).copy_from(&rows);
        self.q_t = q_t;
        rows.nrows()
    }
}

/// The triangular factor R of a tall matrix, by factoring chunks of rows and then what they leave.
fn triangle(a: &DMatrix<f64>) -> DMatrix<f64> {
    let (n, p) = a.shape();
    if n <= 2 * CHUNK || p * 4 > CHUNK {
        return a.clone().qr().r();
    }
    let starts: Vec<usize> = (0..n).step_by(CHUNK).collect();
    let parts: Vec<DMatrix<f64>> =
        starts.par_iter().map(|&s| a.rows(s, CHUNK.min(n - s)).into_owned().qr().r()).collect();
    let mut stacked = DMatrix::zeros(parts.iter().map(DMatrix::nrows).sum(), p);
    let mut at = 0;
    for part in &parts {
        stacked.rows_mut(at, part.nrows()).copy_from(part);
        at += part.nrows();
    }
    stacked.qr().r()
}

/// Rows, orthonormal but for rounding or scale and independent, made orthonormal.
fn orthonormal(rows: DMatrix<f64>) -> DMatrix<f64> {
    let mut rows = rows;
    for mut row in rows.row_iter_mut() {
        let norm = row.norm();
        row /= norm;
    }
    match (&rows * rows.transpose()).cholesky() {
        Some(factor) => {
            let mut out = rows;
            factor.l_dirty().solve_lower_triangular_mut(&mut out);
            out
        }
        None => rows,
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::{noise_matrix, rng};
    use super::*;

    #[test]
    fn dependent_and_empty_columns_add_no_rank() {
        let mut rng = rng(1);
        for n in [40, 5000] {
            let mut a = noise_matrix(&mut rng, n, 6);
            let sum = a.column(0) * 3.0 - a.column(1) * 1e-6;
            a.set_column(4, &sum);
            a.column_mut(5).fill(0.0);
            let basis = Basis::new(&a);
            assert_eq!(basis.rank(), 4);
            let gram = basis.transposed() * basis.transposed().transpose();
            assert!((gram - DMatrix::identity(4, 4)).amax() < 1e-13);
            assert!(basis.project_columns(&a).amax() < 1e-10);
            let mean = (0..n).map(|i| basis.leverage(i)).sum::<f64>();
            assert!((mean - 4.0).abs() < 1e-10, "leverages sum to the rank");
        }
    }

    #[test]
    fn nothing_is_a_basis_too() {
        let basis = Basis::new(&DMatrix::zeros(7, 0));
        assert_eq!((basis.rank(), basis.n_rows()), (0, 7));
        let v = DVector::from_element(7, 1.0);
        assert_eq!(basis.project(&v), v);
    }

    #[test]
    fn extending_is_the_basis_of_all_columns() {
        let mut rng = rng(2);
        let (a, b) = (noise_matrix(&mut rng, 50, 5), noise_matrix(&mut rng, 50, 3));
        let mut both = a.clone().resize_horizontally(8, 0.0);
        both.columns_mut(5, 3).copy_from(&b);
        let mut grown = Basis::new(&a);
        assert_eq!(grown.extend(&b, 1e-3), 3);
        assert_eq!(grown.extend(&(&b * 2.0), 1e-3), 0);
        let v = noise_matrix(&mut rng, 50, 1).column(0).into_owned();
        assert!((grown.project(&v) - Basis::new(&both).project(&v)).amax() < 1e-12);
    }
}
