//! Weighted Gauss-Newton, rank by singular values, and nothing about effects or machines.
//!
//! The unknowns are scaled by their columns' norms at the nominal touches; directions that leave no trace there
//! (singular value below [`RANK_TOLERANCE`] of the largest) are gauges: they are reported, and for each of them one unknown is
//! held where it stands ([`Observability::hold`]). What is left is a plain problem of full rank: a gauge that bends away from its
//! straight direction cannot mislead the search, because the search never moves along it. Source of the method: Björck,
//! Numerical Methods for Least Squares Problems, ch. 9.

use nalgebra::{DMatrix, DVector};

/// Singular values below this share of the largest are zero: rounding leaves some 1e-15, the weakest combinations that
/// a plan determines are above 1e-5.
pub const RANK_TOLERANCE: f64 = 1e-9;

/// The search stops when a step moves no predicted touch by more than this, mm.
pub(super) const STEP_TOLERANCE_MM: f64 = 1e-13;

const MAX_STEPS: usize = 60;

/// What the nominal touches say about the unknowns.
#[derive(Debug, Clone)]
pub struct Observability {
    /// Norm of each column of the nominal Jacobian (1 where it is zero), mm per unit.
    pub scale: DVector<f64>,
    pub rank: usize,
    /// Largest over smallest non-zero singular value of the scaled Jacobian.
    pub condition: f64,
    /// Orthonormal columns: scaled combinations that are seen.
    pub seen: DMatrix<f64>,
    /// Rows in echelon form, unit norm: scaled combinations that leave no trace.
    pub unseen: Vec<DVector<f64>>,
    /// Unknowns that a search holds where they stand, in ascending order: one for each combination without a trace.
    pub held: Vec<usize>,
}

/// A held unknown must have at least this share in what leaves no trace: the others follow it with the inverse of that.
const SHARE_OF_HELD: f64 = 0.05;

/// Rank and null directions of a Jacobian (rows: touches, columns: unknowns).
#[must_use]
pub fn observe(jacobian: &DMatrix<f64>) -> Observability {
    observe_with(jacobian, None)
}

/// The same where the rank is known already: the weakest directions, as many as that leaves, are the null directions.
#[must_use]
pub fn observe_of_rank(jacobian: &DMatrix<f64>, rank: usize) -> Observability {
    observe_with(jacobian, Some(rank))
}

fn observe_with(jacobian: &DMatrix<f64>, rank: Option<usize>) -> Observability {
    let p = jacobian.ncols();
    if p == 0 || jacobian.nrows() == 0 {
        // every parameter is held, or nothing was touched: there is nothing to see
        return Observability {
            scale: DVector::from_element(p, 1.0),
            rank: 0,
            condition: 1.0,
            seen: DMatrix::zeros(p, 0),
            unseen: (0..p).map(|i| DVector::from_fn(p, |k, _| f64::from(u8::from(k == i)))).collect(),
            held: (0..p).collect(),
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
    let mut kept: Vec<usize> = (0..p).filter(|&i| values[i] > RANK_TOLERANCE * top && top > 0.0).collect();
    if let Some(rank) = rank {
        kept.sort_by(|&a, &b| values[b].total_cmp(&values[a]));
        kept.truncate(rank);
        kept.sort_unstable();
    }
    let lost: Vec<usize> = (0..p).filter(|i| !kept.contains(i)).collect();
    let smallest = kept.iter().map(|&i| values[i]).fold(f64::INFINITY, f64::min);
    let seen = if lost.is_empty() { DMatrix::identity(p, p) } else { v.select_columns(&kept) };
    let mut out = Observability {
        scale,
        rank: kept.len(),
        condition: if kept.is_empty() { f64::INFINITY } else { top / smallest },
        seen,
        unseen: echelon(v.select_columns(&lost).transpose()),
        held: Vec::new(),
    };
    out.hold((0..p).rev());
    out
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

/// Sums of a whitened least-squares problem at θ: JᵀJ, Jᵀr, rᵀr.
#[derive(Debug, Clone)]
pub struct Normal {
    /// JᵀJ, or empty where it was not asked for.
    pub gram: DMatrix<f64>,
    /// Jᵀr.
    pub gradient: DVector<f64>,
    /// rᵀr.
    pub sum: f64,
}

/// A whitened least-squares problem.
pub trait Problem {
    /// Its sums at θ; the Gram matrix only on request.
    fn normal(&self, theta: &DVector<f64>, with_gram: bool) -> Normal;
    /// Its Jacobian at θ, one row per touch and prior.
    fn jacobian(&self, theta: &DVector<f64>) -> DMatrix<f64>;
    /// Rows that count.
    fn n_rows(&self) -> usize;
    /// Noise of a touch, mm: turns a whitened step back into mm.
    fn noise(&self) -> f64;
}

/// Above this condition the Gram matrix loses too many digits: the factor then comes from the Jacobian itself.
const GRAM_CONDITION: f64 = 1e5;

/// While steps are larger than this, mm, the factor is made anew; smaller ones do not change it.
const SAME_FACTOR_MM: f64 = 1e-6;

/// Where a search ended.
#[derive(Debug, Clone)]
pub struct Solution {
    /// The free unknowns.
    pub theta: DVector<f64>,
    /// Sum of squared whitened residuals at θ.
    pub chi2: f64,
    /// Did it converge?
    pub converged: bool,
    /// Steps taken.
    pub iterations: usize,
    /// By which test it stopped.
    pub stopped: String,
    /// Covariance of the free unknowns; zero for those that are held.
    pub covariance: DMatrix<f64>,
}

/// The scaled unknowns that are not held, with the factor R, RᵀR = their normal matrix.
struct Factor {
    r: DMatrix<f64>,
}

impl Factor {
    /// From the Gram matrix where that is accurate enough, else from the Jacobian.
    fn new(problem: &impl Problem, theta: &DVector<f64>, normal: &Normal, seen: &Observability) -> Option<Self> {
        if seen.condition < GRAM_CONDITION {
            let scaled = DMatrix::from_fn(theta.len(), theta.len(), |i, j| {
                normal.gram[(i, j)] / (seen.scale[i] * seen.scale[j])
            });
            let reduced = if seen.full() {
                scaled
            } else {
                let moved = seen.moved();
                scaled.select_rows(&moved).select_columns(&moved)
            };
            if let Some(cholesky) = reduced.cholesky() {
                return Some(Self { r: cholesky.unpack().transpose() });
            }
        }
        let mut jacobian = problem.jacobian(theta);
        for (mut column, s) in jacobian.column_iter_mut().zip(seen.scale.iter()) {
            column /= *s;
        }
        let reduced = if seen.full() { jacobian } else { jacobian.select_columns(&seen.moved()) };
        let r = reduced.qr().r();
        let good = r.nrows() == seen.rank && r.diagonal().iter().all(|d| *d != 0.0 && d.is_finite());
        good.then_some(Self { r })
    }

    /// −(RᵀR)⁻¹·D⁻¹·gradient, 0 for what is held, and the length of the move that it makes (whitened).
    fn step(&self, gradient: &DVector<f64>, seen: &Observability) -> Option<(DVector<f64>, f64)> {
        let scaled = gradient.component_div(&seen.scale);
        let mut x = if seen.full() { scaled } else { scaled.select_rows(&seen.moved()) };
        if !self.r.tr_solve_upper_triangular_mut(&mut x) {
            return None;
        }
        let length = x.norm();
        if !self.r.solve_upper_triangular_mut(&mut x) || x.iter().any(|v| !v.is_finite()) {
            return None;
        }
        let step = -seen.spread(DMatrix::from_column_slice(x.len(), 1, x.as_slice())).column(0);
        Some((step.component_div(&seen.scale), length))
    }

    fn covariance(&self, seen: &Observability) -> Option<DMatrix<f64>> {
        let mut inverse = DMatrix::identity(self.r.nrows(), self.r.ncols());
        if !self.r.solve_upper_triangular_mut(&mut inverse) {
            return None;
        }
        let mut half = seen.spread(inverse);
        for (mut row, s) in half.row_iter_mut().zip(seen.scale.iter()) {
            row /= *s;
        }
        Some(&half * half.transpose())
    }
}

impl Observability {
    /// True when every combination of the unknowns is seen.
    #[must_use]
    pub fn full(&self) -> bool {
        self.rank == self.scale.len()
    }

    /// Chooses the unknowns that a search holds: for each combination without a trace the first of `order` that has a share in
    /// it.
    pub fn hold(&mut self, order: impl IntoIterator<Item = usize>) {
        self.held.clear();
        let mut rows: Vec<DVector<f64>> = self.unseen.clone();
        let order: Vec<usize> = order.into_iter().collect();
        for least in [SHARE_OF_HELD, 0.0] {
            for &c in &order {
                let largest = (0..rows.len()).max_by(|&a, &b| rows[a][c].abs().total_cmp(&rows[b][c].abs()));
                let Some(row) = largest.filter(|&k| rows[k][c].abs() > least * rows[k].norm()) else { continue };
                let pivot = rows.swap_remove(row);
                for other in &mut rows {
                    let share = other[c] / pivot[c];
                    other.axpy(-share, &pivot, 1.0);
                    other[c] = 0.0;
                }
                self.held.push(c);
            }
        }
        self.held.sort_unstable();
    }

    /// The unknowns that a search moves.
    fn moved(&self) -> Vec<usize> {
        (0..self.scale.len()).filter(|c| self.held.binary_search(c).is_err()).collect()
    }

    /// Rows for the unknowns that are moved → rows for all of them, 0 for those that are held.
    fn spread(&self, rows: DMatrix<f64>) -> DMatrix<f64> {
        if self.full() {
            return rows;
        }
        let mut out = DMatrix::zeros(self.scale.len(), rows.ncols());
        for (&c, row) in self.moved().iter().zip(rows.row_iter()) {
            out.set_row(c, &row);
        }
        out
    }
}

/// Minimises the sum of squares over the unknowns that are not held, from `start`: Gauss-Newton with halved steps. Its steps solve
/// (corrected semi-)normal equations; the gradient is always that of the exact residuals, so that the factor decides
/// about the speed of convergence and not about the answer.
#[must_use]
pub fn minimise(problem: &impl Problem, start: DVector<f64>, seen: &Observability) -> Solution {
    minimise_from(problem, start, seen, None)
}

/// The same, with the sums at the start where they are known already.
#[must_use]
pub fn minimise_from(
    problem: &impl Problem,
    start: DVector<f64>,
    seen: &Observability,
    first: Option<Normal>,
) -> Solution {
    let p = start.len();
    let mut theta = start;
    if seen.rank == 0 {
        let chi2 = problem.normal(&theta, false).sum;
        let stopped =
            if p == 0 { "there is no unknown to solve for" } else { "no unknown has an effect on these touches" }
                .into();
        let covariance = DMatrix::zeros(p, p);
        return Solution { theta, chi2, converged: p == 0, iterations: 0, stopped, covariance };
    }
    // moves are judged by their root mean square over the touches
    let to_mm = problem.noise() / (problem.n_rows().max(1) as f64).sqrt();
    let mut normal = first.unwrap_or_else(|| problem.normal(&theta, true));
    let mut last_mm = f64::INFINITY;
    let mut factor = Factor::new(problem, &theta, &normal, seen);
    let mut iterations = 0;
    let mut converged = false;
    let mut stopped = format!("no end after {MAX_STEPS} steps");
    while iterations < MAX_STEPS {
        let Some((step, length)) = factor.as_ref().and_then(|f| f.step(&normal.gradient, seen)) else {
            stopped = "the factor became singular".into();
            break;
        };
        let moved_mm = length * to_mm;
        let again = moved_mm > SAME_FACTOR_MM;
        iterations += 1;
        // steps shrink by their ratio: when the next one would be below the tolerance, this one is the last, and what
        // it takes from the sum of squares is known without looking
        if moved_mm < SAME_FACTOR_MM && moved_mm * (moved_mm / last_mm) < STEP_TOLERANCE_MM {
            theta += &step;
            normal.sum = (normal.sum - length * length).max(0.0);
            converged = true;
            stopped = format!("a further step would move no touch by more than {STEP_TOLERANCE_MM:e} mm");
            break;
        }
        last_mm = moved_mm;
        let mut part = 1.0;
        let accepted = loop {
            let candidate = &theta + &step * part;
            let after = problem.normal(&candidate, again);
            // close to the minimum rounding decides about the sum of squares: the step itself is then the better judge
            if after.sum.is_finite() && (after.sum <= normal.sum * (1.0 + 1e-12) || moved_mm < 1e-9) {
                theta = candidate;
                break Some(after);
            }
            part *= 0.5;
            if part < 1e-4 {
                break None;
            }
        };
        let Some(after) = accepted else {
            stopped = "no shorter step lowers the sum of squares".into();
            converged = moved_mm < 1e-6;
            break;
        };
        let fell = normal.sum - after.sum;
        normal = Normal { gram: if again { after.gram } else { normal.gram }, ..after };
        if moved_mm * part < STEP_TOLERANCE_MM {
            converged = true;
            stopped = format!("the last step moved no touch by more than {STEP_TOLERANCE_MM:e} mm");
            break;
        }
        // where touches are noisy, a step far below their noise changes nothing that anybody could see
        if moved_mm < 1e-11 && fell.abs() <= 1e-13 * normal.sum {
            converged = true;
            stopped = "the sum of squares no longer falls".into();
            break;
        }
        if again {
            factor = Factor::new(problem, &theta, &normal, seen);
        }
    }
    let covariance = factor.and_then(|f| f.covariance(seen)).unwrap_or_else(|| DMatrix::from_element(p, p, f64::NAN));
    Solution { theta, chi2: normal.sum, converged, iterations, stopped, covariance }
}

/// Condition of the column-scaled Jacobian over its rank, from its Gram matrix.
#[must_use]
pub fn condition(gram: &DMatrix<f64>, rank: usize) -> f64 {
    let p = gram.ncols();
    if rank == 0 {
        return if p == 0 { 1.0 } else { f64::INFINITY };
    }
    let scale = |i: usize| if gram[(i, i)] > 0.0 { gram[(i, i)].sqrt() } else { 1.0 };
    let scaled = DMatrix::from_fn(p, p, |i, j| gram[(i, j)] / (scale(i) * scale(j)));
    let mut values: Vec<f64> = scaled.symmetric_eigenvalues().iter().copied().collect();
    values.sort_unstable_by(|a, b| b.total_cmp(a));
    let smallest = values.get(rank - 1).copied().unwrap_or(0.0).max(f64::EPSILON * values[0]);
    (values[0] / smallest).sqrt()
}

/// Condition up to which the touches as they were made show the rank that the nominal ones have: the two Jacobians differ
/// by what errors and set-ups of some tenths of a millimetre make of levers of some hundred.
const CLEARLY_SEEN: f64 = 300.0;

/// Rank and condition from the Gram matrix of touches as they were made, where it is beyond doubt that the nominal ones
/// would say the same: that every unknown is seen.
#[must_use]
pub fn observe_clearly(gram: &DMatrix<f64>) -> Option<Observability> {
    observe_gram(gram).filter(|seen| seen.condition < CLEARLY_SEEN)
}

/// Rank and condition from a Gram matrix alone, where it is well enough conditioned to say that every unknown is seen.
#[must_use]
pub fn observe_gram(gram: &DMatrix<f64>) -> Option<Observability> {
    let p = gram.ncols();
    let scale = DVector::from_fn(p, |i, _| gram[(i, i)].sqrt());
    let largest = scale.max();
    if p == 0 || scale.iter().any(|s| s.is_nan() || *s <= 1e-12 * largest) {
        return None;
    }
    let scaled = DMatrix::from_fn(p, p, |i, j| gram[(i, j)] / (scale[i] * scale[j]));
    let values = scaled.symmetric_eigenvalues();
    let (low, high) = (values.min(), values.max());
    // rounding moves an eigenvalue by some 1e-14: its root is good to a percent from here on
    (low > 1e-11 * high).then(|| Observability {
        scale,
        rank: p,
        condition: (high / low).sqrt(),
        seen: DMatrix::identity(p, p),
        unseen: Vec::new(),
        held: Vec::new(),
    })
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
        // one of the three is held: the first that is named
        assert_eq!(seen.held, [2]);
        let mut other = seen.clone();
        other.hold([1, 2, 0]);
        assert_eq!(other.held, [1]);
    }

    #[test]
    fn a_parameter_with_next_to_no_share_is_not_held() {
        // no trace: (1, 1e-3, 0) and (0, 0, 1) of the scaled unknowns
        let mut seen = observe(&DMatrix::from_row_slice(2, 3, &[1e-3, -1.0, 0.0, 2e-3, -2.0, 0.0]));
        seen.unseen = vec![DVector::from_vec(vec![1.0, 1e-3, 0.0]), DVector::from_vec(vec![0.0, 0.0, 1.0])];
        seen.hold([1, 0, 2]);
        assert_eq!(seen.held, [0, 2]);
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
