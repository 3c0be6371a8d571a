//! Spans and solutions of least norm, of matrices whose columns may depend on one another.
//!
//! By QR decompositions, and not by the left vectors of nalgebra's singular value decomposition: where a matrix lacks rank they may
//! span something else (one in a hundred matrices of small whole numbers with two equal columns, nalgebra 0.35).

use nalgebra::{ColPivQR, DMatrix, Dyn};

/// Orthonormal basis of the span of some columns. What is left of a column beside the others counts as nothing below this share of the
/// longest one.
#[must_use]
pub fn span(columns: &DMatrix<f64>, share: f64) -> DMatrix<f64> {
    let (n, p) = columns.shape();
    if n == 0 || p == 0 {
        return DMatrix::zeros(n, 0);
    }
    let qr = columns.clone().col_piv_qr();
    let kept = rank(&qr.r(), share);
    qr.q().columns(0, kept).into_owned()
}

/// How many rows of a triangle count, which begins with its longest.
fn rank(r: &DMatrix<f64>, share: f64) -> usize {
    let top = r[(0, 0)].abs();
    (0..r.nrows()).take_while(|&i| r[(i, i)].abs() > share * top).count()
}

/// Of all x that bring A·x nearest to something, the shortest.
#[derive(Debug, Clone)]
pub struct LeastNorm {
    /// A = Q·R·Pᵀ; `None` for a matrix of nothing.
    qr: Option<ColPivQR<f64, Dyn, Dyn>>,
    /// Orthonormal rows that span those of R that count, and the triangle Rᵀ = Z·T.
    rows: DMatrix<f64>,
    triangle: DMatrix<f64>,
    n_columns: usize,
}

impl LeastNorm {
    /// Of a matrix; what is left of a column beside the others counts as nothing below this share of the longest one.
    #[must_use]
    pub fn new(a: &DMatrix<f64>, share: f64) -> Self {
        let n_columns = a.ncols();
        let qr = if a.is_empty() { None } else { Some(a.clone().col_piv_qr()) };
        let kept = qr.as_ref().map(|qr| qr.r()).map(|r| r.rows(0, rank(&r, share)).into_owned());
        match kept.filter(|rows| rows.nrows() > 0) {
            Some(kept) => {
                let second = kept.transpose().qr();
                Self { qr, rows: second.q(), triangle: second.r(), n_columns }
            }
            None => Self { qr: None, rows: DMatrix::zeros(0, 0), triangle: DMatrix::zeros(0, 0), n_columns },
        }
    }

    /// x for each column of b.
    #[must_use]
    pub fn solve(&self, b: &DMatrix<f64>) -> DMatrix<f64> {
        let none = || DMatrix::zeros(self.n_columns, b.ncols());
        let Some(qr) = &self.qr else { return none() };
        let mut turned = b.clone();
        qr.q_tr_mul(&mut turned);
        let seen = turned.rows(0, self.triangle.nrows());
        let Some(w) = self.triangle.tr_solve_upper_triangular(&seen) else { return none() };
        let mut x = &self.rows * w;
        qr.p().inv_permute_rows(&mut x);
        x
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};

    #[test]
    fn they_span_what_they_should() {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(3);
        let mut lacking = 0;
        for _ in 0..2000 {
            let (n, p) = (rng.random_range(2..20), rng.random_range(2..9));
            let mut a = DMatrix::from_fn(n, p, |_, _| f64::from(rng.random_range(-2..3_i32)));
            let twin = -a.column(0).into_owned();
            a.column_mut(p - 1).copy_from(&twin);
            if a.amax() == 0.0 {
                continue;
            }
            let q = span(&a, 1e-9);
            let square = q.tr_mul(&q);
            assert!((square - DMatrix::identity(q.ncols(), q.ncols())).amax() < 1e-12);
            assert!((&a - &q * q.tr_mul(&a)).amax() < 1e-12, "{a}");
            lacking += usize::from(q.ncols() < n.min(p));
            // what A makes of a shortest x is its own image, and what lies across the span has none
            let b = &a * DMatrix::from_fn(p, 2, |_, _| rng.random_range(-1.0..1.0));
            let least = LeastNorm::new(&a, 1e-9);
            let x = least.solve(&b);
            assert!((&a * &x - &b).amax() < 1e-9, "{a}");
            assert!((x.row(0) + x.row(p - 1)).amax() < 1e-9, "equal columns share equally");
            let across = DMatrix::from_fn(n, 1, |_, _| rng.random_range(-1.0..1.0));
            let across = &across - &q * q.tr_mul(&across);
            assert!(least.solve(&across).amax() < 1e-9);
        }
        assert!(lacking > 1000);
    }

    #[test]
    fn nothing_spans_nothing() {
        assert_eq!(span(&DMatrix::zeros(3, 0), 1e-9).shape(), (3, 0));
        assert_eq!(span(&DMatrix::zeros(3, 2), 1e-9).shape(), (3, 0));
        assert_eq!(LeastNorm::new(&DMatrix::zeros(3, 2), 1e-9).solve(&DMatrix::zeros(3, 1)).shape(), (2, 1));
        assert_eq!(LeastNorm::new(&DMatrix::zeros(0, 2), 1e-9).solve(&DMatrix::zeros(0, 1)).shape(), (2, 1));
    }
}
