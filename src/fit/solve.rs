//! Weighted Gauss-Newton by orthogonal factors, rank by singular values, and nothing about effects or machines.
//!
//! The unknowns are scaled by their columns' norms at the nominal touches; directions that leave no trace there
//! (singular value below [`RANK_TOLERANCE`] of the largest) are gauges: they are taken out of the search, stay at
//! their start, and are reported. Source of the method: Björck, Numerical Methods for Least Squares Problems, ch. 9.

use nalgebra::{DMatrix, DVector};

/// Singular values below this share of the largest are zero: rounding leaves some 1e-15, the weakest combinations that
/// a plan determines are above 1e-5.
pub const RANK_TOLERANCE: f64 = 1e-9;

/// The search stops when a step moves no predicted touch by more than this, mm.
const STEP_TOLERANCE_MM: f64 = 1e-13;

const MAX_STEPS: usize = 60;

/// What the nominal touches say about the unknowns.
#[derive(Debug, Clone)]
pub struct Observability {
    /// Norm of each column of the nominal Jacobian (1 where it is zero), mm per unit.
    pub scale: DVector<f64>,
    /// Rank.
    pub rank: usize,
    /// Largest over smallest non-zero singular value of the scaled Jacobian.
    pub condition: f64,
    /// Orthonormal columns: scaled combinations that are seen.
    pub seen: DMatrix<f64>,
    /// Rows in echelon form, unit norm: scaled combinations that leave no trace.
    pub unseen: Vec<DVector<f64>>,
}

/// Rank and null directions of a Jacobian (rows: touches, columns: unknowns).
#[must_use]
pub fn observe(jacobian: &DMatrix<f64>) -> Observability {
    let p = jacobian.ncols();
    if p == 0 || jacobian.nrows() == 0 {
        // every parameter is held, or nothing was touched: there is nothing to see
        return Observability {
            scale: DVector::from_element(p, 1.0),
            rank: 0,
            condition: 1.0,
            seen: DMatrix::zeros(p, 0),
            unseen: (0..p).map(|i| DVector::from_fn(p, |k, _| f64::from(u8::from(k == i)))).collect(),
        };
    }
    let mut scaled = jacobian.clone();
    let mut scale = DVector::from_element(p, 1.0);
    let largest = scaled.column_iter().map(|c| c.norm()).fold(0.0, f64::max);
    for (mut column, s) in scaled.column_iter_mut().zip(scale.iter_mut()) {
        let norm = column.norm();
        if norm > 1e-12 * largest {
            *s = norm;
            column /= norm;
        } else {
            column.fill(0.0);
        }
    }
    let (values, v) = singular(&scaled);
    let top = values.iter().copied().fold(0.0, f64::max);
    let kept: Vec<usize> = (0..p).filter(|&i| values[i] > RANK_TOLERANCE * top && top > 0.0).collect();
    let lost: Vec<usize> = (0..p).filter(|i| !kept.contains(i)).collect();
    let smallest = kept.iter().map(|&i| values[i]).fold(f64::INFINITY, f64::min);
    let seen = if lost.is_empty() { DMatrix::identity(p, p) } else { v.select_columns(&kept) };
    Observability {
        scale,
        rank: kept.len(),
        condition: if kept.is_empty() { f64::INFINITY } else { top / smallest },
        seen,
        unseen: echelon(v.select_columns(&lost).transpose()),
    }
}

/// Singular values and right singular vectors of a tall matrix, by QR first; as many as columns.
fn singular(a: &DMatrix<f64>) -> (DVector<f64>, DMatrix<f64>) {
    let p = a.ncols();
    let mut square = DMatrix::zeros(p, p);
    let r = if a.nrows() > p { a.clone().qr().r() } else { a.clone() };
    square.rows_mut(0, r.nrows()).copy_from(&r);
    let svd = square.svd(false, true);
    let v = svd.v_t.map_or_else(|| DMatrix::identity(p, p), |v_t| v_t.transpose());
    (svd.singular_values, v)
}

/// Reduced row echelon form with complete pivoting: sparse null vectors that a person can read.
fn echelon(mut rows: DMatrix<f64>) -> Vec<DVector<f64>> {
    let (k, p) = rows.shape();
    let mut pivots: Vec<usize> = Vec::new();
    for r in 0..k {
        let mut best = (r, 0, 0.0);
        for i in r..k {
            for j in (0..p).filter(|j| !pivots.contains(j)) {
                if rows[(i, j)].abs() > best.2 {
                    best = (i, j, rows[(i, j)].abs());
                }
            }
        }
        let (i, j, size) = best;
        if size < 1e-12 {
            break;
        }
        rows.swap_rows(r, i);
        let pivot = rows[(r, j)];
        for c in 0..p {
            rows[(r, c)] /= pivot;
        }
        for other in (0..k).filter(|&o| o != r) {
            let factor = rows[(other, j)];
            for c in 0..p {
                let amount = rows[(r, c)];
                rows[(other, c)] -= factor * amount;
            }
        }
        pivots.push(j);
    }
    rows.row_iter()
        .filter(|row| row.norm() > 0.0)
        .map(|row| {
            let mut v = row.transpose().normalize();
            v.iter_mut().filter(|x| x.abs() < 1e-9).for_each(|x| *x = 0.0);
            v
        })
        .collect()
}

/// Residuals (mm, already divided by their standard deviations when weights are wanted) and Jacobian at θ.
pub trait Problem {
    /// Fills both; `residual` has one row per touch and prior, `jacobian` one column per free unknown.
    fn evaluate(&self, theta: &DVector<f64>, residual: &mut DVector<f64>, jacobian: &mut DMatrix<f64>);
    /// Rows.
    fn n_rows(&self) -> usize;
    /// Standard deviation that one row is divided by, mm: turns a whitened step back into mm.
    fn sigma(&self, row: usize) -> f64;
}

/// Where a search ended.
#[derive(Debug, Clone)]
pub struct Solution {
    /// The free unknowns.
    pub theta: DVector<f64>,
    /// Residuals at θ, whitened.
    pub residual: DVector<f64>,
    /// Did it converge?
    pub converged: bool,
    /// Steps taken.
    pub iterations: usize,
    /// By which test it stopped.
    pub stopped: String,
    /// Covariance of the free unknowns for unit weight; zero along unseen directions.
    pub covariance: DMatrix<f64>,
    /// Leverage of each row: the share of its own residual that the fit takes away.
    pub leverage: DVector<f64>,
}

/// Minimises the sum of squares over the seen directions, from `start`.
#[must_use]
pub fn minimise(problem: &impl Problem, start: DVector<f64>, seen: &Observability) -> Solution {
    let (n, p, rank) = (problem.n_rows(), start.len(), seen.rank);
    let mut theta = start;
    let mut residual = DVector::zeros(n);
    let mut jacobian = DMatrix::zeros(n, p);
    problem.evaluate(&theta, &mut residual, &mut jacobian);
    let mut iterations = 0;
    let mut converged = false;
    let mut stopped = format!("no end after {MAX_STEPS} steps");
    let full = rank == p;
    let scaled = |jacobian: &DMatrix<f64>| -> DMatrix<f64> {
        let mut a = jacobian.clone();
        for (mut column, s) in a.column_iter_mut().zip(seen.scale.iter()) {
            column /= *s;
        }
        if full { a } else { a * &seen.seen }
    };
    if rank == 0 {
        return Solution {
            theta,
            residual,
            converged: p == 0,
            iterations: 0,
            stopped: if p == 0 { "nothing is left to solve for" } else { "no unknown leaves a trace in these touches" }
                .into(),
            covariance: DMatrix::zeros(p, p),
            leverage: DVector::zeros(n),
        };
    }
    while iterations < MAX_STEPS {
        let a = scaled(&jacobian);
        let qr = a.clone().qr();
        let mut rhs = residual.clone();
        qr.q_tr_mul(&mut rhs);
        let mut phi = -rhs.rows(0, rank).into_owned();
        if !qr.r().solve_upper_triangular_mut(&mut phi) || phi.iter().any(|x| !x.is_finite()) {
            stopped = "the factor became singular".into();
            break;
        }
        let moves = &a * &phi;
        let largest_mm = moves.iter().enumerate().map(|(i, m)| m.abs() * problem.sigma(i)).fold(0.0, f64::max);
        let step = (if full { phi } else { &seen.seen * phi }).component_div(&seen.scale);
        let before = residual.norm_squared();
        iterations += 1;
        let mut length = 1.0;
        let accepted = loop {
            let candidate = &theta + &step * length;
            problem.evaluate(&candidate, &mut residual, &mut jacobian);
            let after = residual.norm_squared();
            // close to the minimum rounding decides about the sum of squares: the step itself is then the better judge
            if after.is_finite() && (after <= before * (1.0 + 1e-12) || largest_mm < 1e-9) {
                theta = candidate;
                break true;
            }
            length *= 0.5;
            if length < 1e-4 {
                break false;
            }
        };
        if !accepted {
            problem.evaluate(&theta, &mut residual, &mut jacobian);
            stopped = "no shorter step lowers the sum of squares".into();
            converged = largest_mm < 1e-6;
            break;
        }
        if largest_mm * length < STEP_TOLERANCE_MM {
            converged = true;
            stopped = format!("the last step moved no touch by more than {STEP_TOLERANCE_MM:e} mm");
            break;
        }
        // where touches are noisy, a step far below their noise changes nothing that anybody could see
        if largest_mm < 1e-11 && (before - residual.norm_squared()).abs() <= 1e-13 * before {
            converged = true;
            stopped = "the sum of squares no longer falls".into();
            break;
        }
    }
    let a = scaled(&jacobian);
    let qr = a.qr();
    let q = qr.q();
    let leverage = DVector::from_iterator(n, q.row_iter().map(|row| row.norm_squared()));
    let covariance = match qr.r().try_inverse() {
        Some(inverse) => {
            let half = if full { inverse } else { &seen.seen * inverse };
            let mut half = half;
            for (mut row, s) in half.row_iter_mut().zip(seen.scale.iter()) {
                row /= *s;
            }
            &half * half.transpose()
        }
        None => DMatrix::from_element(p, p, f64::NAN),
    };
    Solution { theta, residual, converged, iterations, stopped, covariance, leverage }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rank_and_null_vectors_of_a_dependent_column() {
        // columns: a, b, a + b
        let a = DMatrix::from_row_slice(4, 3, &[1.0, 0.0, 1.0, 0.0, 1.0, 1.0, 1.0, 1.0, 2.0, 2.0, -1.0, 1.0]);
        let seen = observe(&a);
        assert_eq!(seen.rank, 2);
        assert_eq!(seen.unseen.len(), 1);
        let unscaled = seen.unseen[0].component_div(&seen.scale);
        assert!((a * unscaled).norm() < 1e-12);
    }

    #[test]
    fn nothing_to_solve_for_is_no_panic() {
        assert_eq!(observe(&DMatrix::zeros(5, 0)).rank, 0);
        assert_eq!(observe(&DMatrix::zeros(0, 2)).unseen.len(), 2);
        assert_eq!(observe(&DMatrix::zeros(4, 2)).rank, 0);
    }

    #[test]
    fn an_empty_column_is_unseen_alone() {
        let a = DMatrix::from_row_slice(3, 2, &[1.0, 0.0, 2.0, 0.0, 3.0, 0.0]);
        let seen = observe(&a);
        assert_eq!(seen.rank, 1);
        assert!((seen.unseen[0][1].abs() - 1.0).abs() < 1e-12 && seen.unseen[0][0] == 0.0);
    }
}
