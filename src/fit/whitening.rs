//! V^(−1/2) of the touches, made once and applied to any number of columns.

use nalgebra::{DMatrix, DMatrixViewMut, DVectorViewMut, Matrix3, Vector3};

/// What turns columns of gaps (one row per touch, mm or mm per unit) into rows of unit noise.
#[derive(Debug, Clone, PartialEq)]
pub struct Whitening {
    /// Square root of each touch's weight: zero where it is not used.
    pub(super) root: Vec<f64>,
    /// Index visits whose touches share a displacement, one after the other.
    pub(super) visits: Vec<Visit>,
    /// Standard deviation of a touch.
    pub(super) sigma_mm: f64,
}

/// The touches of an index visit.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Visit {
    /// Outward normals in R, each times the root of its weight.
    pub normals: Vec<Vector3<f64>>,
    /// K of V^(−1/2) = (I − N·K·Nᵀ)/σ.
    pub root: Matrix3<f64>,
}

impl Visit {
    /// Takes out what the touches of the visit share.
    fn apply(&self, mut part: DVectorViewMut<'_, f64>) {
        let sum = self.normals.iter().zip(part.iter()).fold(Vector3::zeros(), |s, (n, x)| s + n * *x);
        let by = self.root * sum;
        part.iter_mut().zip(&self.normals).for_each(|(x, n)| *x -= n.dot(&by));
    }
}

impl Whitening {
    /// Whitens columns in place; rows of unused touches become zero.
    pub fn apply(&self, columns: &mut DMatrix<f64>) {
        let rows = columns.nrows();
        self.apply_to(columns.view_mut((0, 0), (rows, columns.ncols())));
    }

    /// The touches of the visits of some touches, in ascending order as these: whitening mixes them, and no others.
    #[must_use]
    pub fn mixed_with(&self, touches: &[usize]) -> Vec<usize> {
        let mut out = Vec::new();
        let (mut place, mut from) = (0, 0);
        for visit in &self.visits {
            let to = from + visit.normals.len();
            let end = touches.partition_point(|&touch| touch < to).max(place);
            if end > place {
                out.extend(from..to);
            }
            (place, from) = (end, to);
        }
        out.extend(&touches[place..]);
        out
    }

    /// Whitened rows of some touches, in ascending order: `value` is a touch's in a column. What whitening mixes with them are the
    /// touches of their visits, and no others.
    pub fn some(&self, touches: &[usize], columns: usize, value: &dyn Fn(usize, usize) -> f64) -> DMatrix<f64> {
        let mut out = DMatrix::zeros(touches.len(), columns);
        let mut place = 0;
        let mut from = 0;
        for visit in &self.visits {
            let to = from + visit.normals.len();
            let own = place..touches.partition_point(|&touch| touch < to).max(place);
            if !own.is_empty() {
                let mut part = DMatrix::from_fn(to - from, columns, |i, j| value(from + i, j) * self.root[from + i]);
                for mut column in part.column_iter_mut() {
                    visit.apply(column.as_view_mut());
                }
                for row in own.clone() {
                    out.row_mut(row).copy_from(&part.row(touches[row] - from));
                }
            }
            (place, from) = (own.end, to);
        }
        for row in place..touches.len() {
            let touch = touches[row];
            (0..columns).for_each(|j| out[(row, j)] = value(touch, j) * self.root[touch]);
        }
        out.unscale_mut(self.sigma_mm);
        out
    }

    /// The same for a part of a matrix.
    pub fn apply_to(&self, mut columns: DMatrixViewMut<'_, f64>) {
        for mut column in columns.column_iter_mut() {
            for (x, root) in column.iter_mut().zip(&self.root).filter(|(_, root)| **root != 1.0) {
                *x *= root;
            }
            let mut from = 0;
            for visit in &self.visits {
                visit.apply(column.rows_mut(from, visit.normals.len()));
                from += visit.normals.len();
            }
            column.unscale_mut(self.sigma_mm);
        }
    }
}
