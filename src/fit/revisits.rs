//! How far the ball's place scatters from one index visit to the next, from visits of one pose.
//!
//! With y the residuals of the touches of a pose, X their points and Z their normals by visit, X is projected out of y and of Z;
//! the projected ZZᵀ has eigenvalues λₖ, and yₖ² has the expectation σ² + τ²·λₖ. τ̂ solves Σ yₖ²/(σ² + τ²λₖ) = K (Paule and
//! Mandel's estimator, exact in its degrees of freedom), and its 90 % bound solves the same sum for the 10 % quantile of χ²(K).
//!
//! What a model holds of what changes with time follows the visits' displacements a little way, and they look smaller for it:
//! with G the contrasts' rows of the fit's Jacobian and C its covariance, yₖ² lacks (G·C·Gᵀ)ₖₖ, which is given back.

use super::noise::Sample;
use crate::probability::chi2_quantile;
use nalgebra::{DMatrix, DVector};
use std::collections::HashMap;

/// Rows of a pose that enter the estimate of τ at most: the work grows with their cube.
const MOST_ROWS: usize = 600;

/// Where a pose has more rows than that, its first visits enter, with at most this many rows.
const ENOUGH_ROWS: usize = 240;

/// How a fit followed what changes from visit to visit.
pub struct Followed {
    /// A row of the Jacobian for each sample, mm per unit.
    pub rows: DMatrix<f64>,
    /// Covariance of its unknowns.
    pub covariance: DMatrix<f64>,
}

impl Followed {
    /// Variance that the fit took out of a contrast of some rows, mm².
    fn variance(&self, rows: &[Row], contrast: &[f64]) -> f64 {
        let mut along = DVector::zeros(self.rows.ncols());
        for (row, part) in rows.iter().zip(contrast) {
            along.axpy(part * row.root, &self.rows.row(row.first).transpose(), 1.0);
        }
        along.dot(&(&self.covariance * &along)).max(0.0)
    }
}

/// Touches of one point made right after each other.
struct Row {
    /// The first of them, with the mean of their residuals.
    sample: Sample,
    /// Root of their number.
    root: f64,
    /// Place of the first among the samples.
    first: usize,
}

/// A contrast between visits.
#[derive(Debug, Clone, Copy)]
pub(super) struct Contrast {
    /// How much of the visits' scatter it shows.
    lambda: f64,
    /// Its square, mm².
    square: f64,
    /// What the fit took out of that on the average, mm².
    followed: f64,
}

/// What revisited poses say.
#[derive(Debug, Default)]
pub(super) struct Revisits {
    /// Contrasts between visits.
    pub contrasts: Vec<Contrast>,
    /// Sum of squares and degrees of freedom of what is left when each visit is displaced freely.
    pub within: (f64, usize),
}

/// How touches of the same points differ between visits of one pose.
pub(super) fn revisits(samples: &[Sample], followed: Option<&Followed>) -> Revisits {
    let mut out = Revisits::default();
    let mut poses: Vec<usize> = samples.iter().map(|s| s.pose).collect();
    poses.sort_unstable();
    poses.dedup();
    for pose in poses {
        // touches made right after each other count by their mean: their own scatter is used already
        let mut rows: Vec<Row> = Vec::new();
        let mut next = 0;
        for group in samples.chunk_by(|a, b| a.repeat == b.repeat) {
            let first = next;
            next += group.len();
            if group[0].pose == pose {
                let mean = group.iter().map(|s| s.residual_mm).sum::<f64>() / group.len() as f64;
                rows.push(Row {
                    sample: Sample { residual_mm: mean, ..group[0] },
                    root: (group.len() as f64).sqrt(),
                    first,
                });
            }
        }
        // only points that stand in several visits say anything
        let mut times: HashMap<usize, usize> = HashMap::new();
        rows.iter().for_each(|r| *times.entry(r.sample.point).or_default() += 1);
        rows.retain(|r| times[&r.sample.point] > 1);
        if rows.len() > MOST_ROWS {
            let end = rows.chunk_by(|a, b| a.sample.visit == b.sample.visit).map(<[Row]>::len);
            let ends = end.scan(0, |at, n| {
                *at += n;
                Some(*at)
            });
            let kept = ends.take_while(|&end| end <= ENOUGH_ROWS).last().unwrap_or(0);
            rows.truncate(kept);
        }
        if rows.len() < 2 {
            continue;
        }
        let mut visits: Vec<usize> = rows.iter().map(|r| r.sample.visit).collect();
        visits.sort_unstable();
        visits.dedup();
        if visits.len() < 2 {
            continue;
        }
        out.add(&rows, &visits, followed);
    }
    out
}

impl Revisits {
    /// One pose.
    fn add(&mut self, rows: &[Row], visits: &[usize], followed: Option<&Followed>) {
        let n = rows.len();
        let mut y = DVector::from_iterator(n, rows.iter().map(|r| r.sample.residual_mm * r.root));
        let mut z = DMatrix::zeros(n, 3 * visits.len());
        for (i, row) in rows.iter().enumerate() {
            if let Some(v) = visits.iter().position(|v| *v == row.sample.visit) {
                for k in 0..3 {
                    z[(i, 3 * v + k)] = row.sample.normal[k] * row.root;
                }
            }
        }
        // the mean of each point is a fixed unknown: project it out of both
        let mut points: Vec<usize> = rows.iter().map(|r| r.sample.point).collect();
        points.sort_unstable();
        points.dedup();
        for point in &points {
            let of: Vec<usize> = (0..n).filter(|&i| rows[i].sample.point == *point).collect();
            let norm2: f64 = of.iter().map(|&i| rows[i].root.powi(2)).sum();
            let mean = of.iter().map(|&i| rows[i].root * y[i]).sum::<f64>() / norm2;
            of.iter().for_each(|&i| y[i] -= rows[i].root * mean);
            for mut column in z.column_iter_mut() {
                let mean = of.iter().map(|&i| rows[i].root * column[i]).sum::<f64>() / norm2;
                of.iter().for_each(|&i| column[i] -= rows[i].root * mean);
            }
        }
        /// A visit's displacement that less than this share of the best seen one shows is not seen: what is left of it is rounding.
        const SEEN: f64 = 1e-10;
        let eigen = z.tr_mul(&z).symmetric_eigen();
        let top = eigen.eigenvalues.max();
        let mut explained = 0.0;
        let mut n_contrasts = 0;
        for (v, &lambda) in eigen.eigenvectors.column_iter().zip(eigen.eigenvalues.iter()) {
            if lambda > SEEN * top && top > SEEN {
                let u = &z * v / lambda.sqrt();
                let square = u.dot(&y).powi(2);
                let followed = followed.map_or(0.0, |f| f.variance(rows, u.as_slice()));
                self.contrasts.push(Contrast { lambda, square, followed });
                explained += square;
                n_contrasts += 1;
            }
        }
        self.within.0 += (y.norm_squared() - explained).max(0.0);
        self.within.1 += (n - points.len()).saturating_sub(n_contrasts);
    }

    /// How much the contrasts scatter over what a τ makes of them (mean square 1 where it is the true one), and their number.
    pub fn beside(&self, sigma_mm: f64, tau_mm: f64) -> (f64, usize) {
        let variance = |c: &Contrast| sigma_mm * sigma_mm + tau_mm * tau_mm * c.lambda;
        let k = self.contrasts.len();
        (self.contrasts.iter().map(|c| (c.square + c.followed) / variance(c)).sum::<f64>() / k.max(1) as f64, k)
    }

    /// τ, its degrees of freedom and its 90 % upper bound, mm.
    pub fn solve(&self, sigma_mm: f64) -> (f64, f64, f64) {
        let k = self.contrasts.len() as f64;
        let sum = |of: fn(&Contrast) -> f64, tau2: f64| -> f64 {
            self.contrasts.iter().map(|c| of(c) / (sigma_mm * sigma_mm + tau2 * c.lambda)).sum()
        };
        let tau2 = root(|tau2| sum(|c| c.square + c.followed, tau2), k);
        // what the fit followed is no longer in the contrasts
        let left = (k - sum(|c| c.followed, tau2)).max(1.0);
        let quantile = chi2_quantile(0.1, left).unwrap_or(left);
        let upper2 = root(|tau2| sum(|c| c.square, tau2), quantile);
        let information = sum(|c| c.lambda, tau2);
        let dof = (tau2 * information).powi(2) / k * (left / k);
        (tau2.sqrt(), dof, upper2.sqrt())
    }
}

/// Where a falling function of x ≥ 0 takes a value; 0 where it starts below.
fn root(f: impl Fn(f64) -> f64, value: f64) -> f64 {
    if f(0.0) <= value {
        return 0.0;
    }
    let mut high = 1e-12;
    while f(high) > value && high < 1e6 {
        high *= 4.0;
    }
    let mut low = 0.0;
    for _ in 0..200 {
        let middle = 0.5 * (low + high);
        if f(middle) > value { low = middle } else { high = middle }
    }
    0.5 * (low + high)
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector3;
    use rand::{RngExt, SeedableRng};

    /// What is left of y when each visit is displaced freely and each point has a mean of its own, and its degrees of freedom: by Gram and
    /// Schmidt, twice.
    fn left_by_hand(samples: &[Sample]) -> (f64, usize) {
        let n = samples.len();
        let count = |of: fn(&Sample) -> usize| samples.iter().map(of).max().unwrap() + 1;
        let mut columns: Vec<DVector<f64>> = Vec::new();
        for point in 0..count(|s| s.point) {
            columns.push(DVector::from_fn(n, |i, _| f64::from(u8::from(samples[i].point == point))));
        }
        for visit in 0..count(|s| s.visit) {
            for k in 0..3 {
                columns.push(DVector::from_fn(
                    n,
                    |i, _| if samples[i].visit == visit { samples[i].normal[k] } else { 0.0 },
                ));
            }
        }
        let mut basis: Vec<DVector<f64>> = Vec::new();
        let clear = |mut x: DVector<f64>, basis: &[DVector<f64>]| {
            for _ in 0..2 {
                basis.iter().for_each(|b| x -= b * b.dot(&x));
            }
            x
        };
        for column in columns {
            let left = clear(column.clone(), &basis);
            if left.norm() > 1e-9 * (1.0 + column.norm()) {
                basis.push(left.normalize());
            }
        }
        let y = DVector::from_iterator(n, samples.iter().map(|s| s.residual_mm));
        (clear(y, &basis).norm_squared(), n - basis.len())
    }

    /// Faces that look straight along the axes make zeros that are exact, and columns that are the same: nothing of a visit's
    /// displacement may stay in what counts as the noise of a touch.
    #[test]
    fn visits_are_taken_out_whole() {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(5);
        for n_visits in 2..6 {
            for tilt in [0.0, 1e-17, 0.3] {
                for faces in [5, 3, 2] {
                    let normals =
                        [[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, 1.0]];
                    let turned = nalgebra::Rotation3::from_euler_angles(0.0, tilt, 0.0);
                    let mut samples = Vec::new();
                    for visit in 0..n_visits {
                        let moved = Vector3::from_fn(|_, _| rng.random_range(-10.0..10.0));
                        for point in 0..4 * faces {
                            let normal = turned * Vector3::from(normals[point % faces]);
                            samples.push(Sample {
                                residual_mm: normal.dot(&moved) + rng.random_range(-1.0..1.0),
                                normal,
                                repeat: samples.len(),
                                visit,
                                pose: 0,
                                point,
                            });
                        }
                    }
                    let found = revisits(&samples, None);
                    let (left, dof) = left_by_hand(&samples);
                    assert_eq!(found.within.1, dof, "{n_visits} visits, {faces} faces, tilt {tilt}");
                    assert!(
                        (found.within.0 / left - 1.0).abs() < 1e-9,
                        "{n_visits} visits, {faces} faces, tilt {tilt}: {} {left}",
                        found.within.0
                    );
                }
            }
        }
    }

    /// A hundred visits of a pose say how far they scatter, by the first of them: too many are not none.
    #[test]
    fn many_visits_of_a_pose_count_by_the_first_of_them() {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(6);
        let mut samples = Vec::new();
        for visit in 0..100 {
            let moved = rng.random_range(-3.0..3.0);
            for point in 0..10 {
                let residual_mm = moved + rng.random_range(-0.1..0.1);
                samples.push(Sample {
                    residual_mm,
                    normal: Vector3::x(),
                    repeat: samples.len(),
                    visit,
                    pose: 0,
                    point,
                });
            }
        }
        let (all, first) = (revisits(&samples, None), revisits(&samples[..240], None));
        assert_eq!(all.contrasts.len(), 23);
        assert_eq!(all.within, first.within);
        // a uniform distribution over 6 has the variance 3, of which each contrast shows as much as there are points
        let shown = all.contrasts.iter().map(|c| c.square / c.lambda).sum::<f64>() / 23.0;
        assert!((1.5..4.5).contains(&shown), "{shown}");
    }
}
