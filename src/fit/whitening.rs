//! V^(−1/2) of the touches, made once and applied to any number of columns.

use nalgebra::{DMatrix, DMatrixViewMut, Dyn, Matrix3, OMatrix, U3, Vector3};

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

/// Outward normals in R, each times the root of its weight: one row for each touch.
pub(super) type Normals = OMatrix<f64, Dyn, U3>;

/// Normals of some touches.
pub(super) fn normals_of(each: &[Vector3<f64>]) -> Normals {
    Normals::from_fn(each.len(), |touch, k| each[touch][k])
}

/// The touches of an index visit.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Visit {
    pub normals: Normals,
    /// K of V^(−1/2) = (I − N·K·Nᵀ)/σ.
    pub root: Matrix3<f64>,
}

impl Visit {
    /// Takes out of some columns what the touches of the visit share. A visit has few touches, and there are many columns: plain sums
    /// by place are several times as fast here as products of matrices of any size.
    fn apply<const K: usize>(&self, parts: [&mut [f64]; K]) {
        let n = self.normals.nrows();
        let (x, others) = self.normals.as_slice().split_at(n);
        let (y, z) = others.split_at(n);
        let parts = parts.map(|part| &mut part[..n]);
        let mut shared = [Vector3::zeros(); K];
        for i in 0..n {
            for (shared, part) in shared.iter_mut().zip(&parts) {
                shared.x += x[i] * part[i];
                shared.y += y[i] * part[i];
                shared.z += z[i] * part[i];
            }
        }
        for (shared, part) in shared.into_iter().zip(parts) {
            let by = self.root * shared;
            for i in 0..n {
                part[i] -= x[i] * by.x + y[i] * by.y + z[i] * by.z;
            }
        }
    }
}

/// Columns that are whitened side by side, so that the additions of different sums overlap.
const AT_ONCE: usize = 4;

impl Whitening {
    /// Whitens columns in place; rows of unused touches become zero.
    pub fn apply(&self, columns: &mut DMatrix<f64>) {
        let rows = columns.nrows();
        self.apply_to(columns.view_mut((0, 0), (rows, columns.ncols())));
    }

    /// The whitening of some touches, in ascending order, with the touches that it mixes: those of their visits, and no others.
    #[must_use]
    pub fn part(&self, touches: &[usize]) -> (Vec<usize>, Self) {
        let (mut all, mut visits) = (Vec::new(), Vec::new());
        let (mut place, mut from) = (0, 0);
        for visit in &self.visits {
            let to = from + visit.normals.nrows();
            let end = touches.partition_point(|&touch| touch < to).max(place);
            if end > place {
                all.extend(from..to);
                visits.push(visit.clone());
            }
            (place, from) = (end, to);
        }
        all.extend(&touches[place..]);
        let root = all.iter().filter_map(|&touch| self.root.get(touch).copied()).collect();
        (all, Self { root, visits, sigma_mm: self.sigma_mm })
    }

    /// The same for a part of a matrix.
    pub fn apply_to(&self, mut columns: DMatrixViewMut<'_, f64>) {
        let mut each: Vec<_> = columns.column_iter_mut().collect();
        let (fours, rest) = each.as_chunks_mut::<AT_ONCE>();
        fours.iter_mut().for_each(|four| self.apply_each(four.each_mut().map(|column| column.as_mut_slice())));
        rest.iter_mut().for_each(|column| self.apply_each([column.as_mut_slice()]));
    }

    fn apply_each<const K: usize>(&self, mut columns: [&mut [f64]; K]) {
        if self.root.iter().any(|root| *root != 1.0) {
            for column in &mut columns {
                column.iter_mut().zip(&self.root).for_each(|(x, root)| *x *= root);
            }
        }
        let mut from = 0;
        for visit in &self.visits {
            let to = from + visit.normals.nrows();
            visit.apply(columns.each_mut().map(|column| &mut column[from..to]));
            from = to;
        }
        if self.sigma_mm != 1.0 {
            columns.into_iter().flatten().for_each(|x| *x /= self.sigma_mm);
        }
    }
}

/// Normals of the touches that are used, by index visit: what a supposed scatter of visits does to rows of unit noise.
#[derive(Debug, Clone)]
pub struct VisitNormals {
    visits: Vec<Directions>,
    sigma_mm: f64,
}

/// Normals of a visit's touches and the principal axes of their squares.
#[derive(Debug, Clone)]
struct Directions {
    pub normals: Normals,
    pub squares: Vector3<f64>,
    pub axes: Matrix3<f64>,
}

impl Directions {
    fn of(normals: Normals) -> Self {
        let eigen = normals.tr_mul(&normals).symmetric_eigen();
        Self { squares: eigen.eigenvalues, axes: eigen.eigenvectors, normals }
    }
}

impl VisitNormals {
    /// Of touches in their order: their visits, and their outward normals in R, each times the root of its weight.
    pub fn new(visits: &[usize], normals: &[Vector3<f64>], sigma_mm: f64) -> Self {
        let mut at = 0;
        let of = |visit: &[usize]| {
            at += visit.len();
            Directions::of(normals_of(&normals[at - visit.len()..at]))
        };
        Self { visits: visits.chunk_by(|a, b| a == b).map(of).collect(), sigma_mm }
    }

    /// Of some of the touches only, in ascending order.
    #[must_use]
    pub fn only(&self, touches: &[usize]) -> Self {
        let (mut place, mut from) = (0, 0);
        let of = |visit: &Directions| {
            let to = from + visit.normals.nrows();
            let end = touches.partition_point(|&touch| touch < to);
            let rows: Vec<usize> = touches[place..end].iter().map(|touch| touch - from).collect();
            (place, from) = (end, to);
            (!rows.is_empty()).then(|| Directions::of(visit.normals.select_rows(&rows)))
        };
        Self { visits: self.visits.iter().filter_map(of).collect(), sigma_mm: self.sigma_mm }
    }

    /// Variance along a principal axis in units of a touch's, where each component of a visit's displacement scatters by τ.
    fn variance(&self, square: f64, tau_mm: f64) -> f64 {
        1.0 + (tau_mm / self.sigma_mm).powi(2) * square.max(0.0)
    }

    /// What turns rows that were whitened with one scatter of visits (mm) into those that another one makes.
    #[must_use]
    pub fn change(&self, from_mm: f64, to_mm: f64) -> Whitening {
        let of = |visit: &Directions| {
            let mut root = Matrix3::zeros();
            for (&square, axis) in visit.squares.iter().zip(visit.axes.column_iter()) {
                // an axis that no touch looks along changes nothing
                if square > 1e-12 {
                    let kept = (self.variance(square, from_mm) / self.variance(square, to_mm)).sqrt();
                    root += axis * axis.transpose() * ((1.0 - kept) / square);
                }
            }
            Visit { normals: visit.normals.clone(), root }
        };
        Whitening { root: Vec::new(), visits: self.visits.iter().map(of).collect(), sigma_mm: 1.0 }
    }

    /// Logarithm of the determinant of the touches' covariance, in units of a touch's variance.
    #[must_use]
    pub fn ln_det(&self, tau_mm: f64) -> f64 {
        self.visits.iter().flat_map(|v| v.squares.iter()).map(|s| self.variance(*s, tau_mm).ln()).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn some_touches_scatter_as_if_the_others_were_never_made() {
        let normals =
            [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.6, 0.8, 0.0], [0.0, 0.0, 1.0], [0.8, 0.0, 0.6], [0.0, 0.6, 0.8]]
                .map(Vector3::from);
        let all = VisitNormals::new(&[0, 0, 0, 1, 1, 2], &normals, 0.001);
        // the last visit loses its only touch, the others keep some
        let kept = all.only(&[0, 2, 4]);
        let made = VisitNormals::new(&[0, 0, 1], &[normals[0], normals[2], normals[4]], 0.001);
        assert!((kept.ln_det(0.0005) - made.ln_det(0.0005)).abs() < 1e-12);
        let whitened = |visits: &VisitNormals| {
            let mut column = DMatrix::from_column_slice(3, 1, &[1.0, 2.0, 3.0]);
            visits.change(0.0, 0.0005).apply(&mut column);
            column
        };
        assert!((whitened(&kept) - whitened(&made)).amax() < 1e-12);
        // by hand: a touch alone along its normal, with half its standard deviation as scatter
        let lonely = whitened(&kept)[2] * (1.0f64 + 0.25).sqrt();
        assert!((lonely - 3.0).abs() < 1e-12, "{lonely}");
    }

    #[test]
    fn columns_side_by_side_become_what_each_becomes_by_itself() {
        let normals =
            [[1.0, 0.0, 0.0], [0.6, 0.8, 0.0], [0.0, 0.6, 0.8], [0.0, 0.0, 1.0], [0.8, 0.0, 0.6]].map(Vector3::from);
        let visits = VisitNormals::new(&[0, 0, 0, 1, 1], &normals, 0.001).change(0.0, 0.0007);
        // a touch counts half, one is not used; behind them a prior
        let whitening = Whitening { root: vec![1.0, 0.5, 1.0, 0.0, 1.0], sigma_mm: 0.003, ..visits };
        let columns = DMatrix::from_fn(6, 2 * AT_ONCE + 3, |row, column| ((7 * row + 3 * column) % 11) as f64 - 4.5);
        let mut all = columns.clone();
        whitening.apply(&mut all);
        for (k, column) in columns.column_iter().enumerate() {
            let mut alone = DMatrix::from_column_slice(6, 1, column.as_slice());
            whitening.apply(&mut alone);
            assert_eq!(all.column(k), alone.column(0), "column {k}");
            assert_eq!(alone[5], column[5] / 0.003);
        }
        assert_ne!(all, columns);
    }
}
