//! Data snooping: touches that do not belong to the rest, one at a time, and back again where they do.
//!
//! With P = V⁻¹ − V⁻¹JCJᵀV⁻¹ and a = P·y, touch i misses the others by ∇ᵢ = aᵢ/Pᵢᵢ with the variance 1/Pᵢᵢ (Baarda's
//! mean shift); leaving it out changes P by a rank-one term, so that no refit is needed on the way. The scale is the
//! externally studentised one: a missing effect widens it, and good touches are not thrown after a bad model.

use super::normal::Touches;
use crate::units::um_from_mm;
use nalgebra::{DMatrix, DVector, Matrix3, Vector3};
use std::collections::BTreeMap;

/// A touch further off than this many standard deviations is left out; the chance of a good one is 6e-5.
const LIMIT: f64 = 4.0;

/// More than this share of rejected touches is no longer a matter of chips: it is a finding by itself.
pub const MOST_SHARE: f64 = 0.02;

/// The scatter is never taken for less than a hundredth of the noise: what is left in a log without noise is rounding,
/// and no touch stands out of that.
const LEAST_SCALE2: f64 = 1e-4;

/// A rejected touch.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rejection {
    /// Index of the observation.
    pub touch: usize,
    /// By how much it misses what the other touches say, mm along the outward normal.
    pub off_mm: f64,
    /// The same in standard deviations.
    pub standardised: f64,
}

impl Rejection {
    /// In words.
    #[must_use]
    pub fn reason(&self) -> String {
        format!(
            "{:+.1} um off what the other touches say ({:.1} standard deviations): a chip, a drop or a double touch?",
            um_from_mm(self.off_mm),
            self.standardised.abs()
        )
    }
}

/// What the touches say about each other at a fit.
#[derive(Debug, Clone)]
pub struct Snoop {
    /// P·y with the dropped touches projected out.
    a: Vec<f64>,
    /// Diagonal of P, likewise.
    d: Vec<f64>,
    /// Columns of P of the dropped touches, normalised in their turn.
    u: Vec<(usize, Vec<f64>)>,
    chi2: f64,
    dof: f64,
    /// Degrees of freedom of the noise, which has the variance 1.
    noise_dof: f64,
}

/// Rows of the touches: only the free unknowns that a touch sees, one after the other.
struct Rows<'t, 'a> {
    touches: &'t Touches<'a>,
    /// Free columns of the rows of each block.
    columns: Vec<Vec<usize>>,
    set_up: Vec<usize>,
    start: Vec<usize>,
    values: Vec<f64>,
    gap: Vec<f64>,
}

impl Rows<'_, '_> {
    fn row(&self, touch: usize) -> (&[usize], &[f64]) {
        let columns = &self.columns[self.set_up[touch]];
        (columns, &self.values[self.start[touch]..self.start[touch] + columns.len()])
    }

    /// Row times a vector of all free unknowns.
    fn dot(&self, touch: usize, x: &[f64]) -> f64 {
        let (columns, values) = self.row(touch);
        columns.iter().zip(values).map(|(&c, v)| v * x[c]).sum()
    }

    /// V⁻¹·x for one column over all touches, 1/mm² times mm.
    fn inverse_noise(&self, x: &mut [f64]) {
        let (sigma, tau) = self.touches.noise_mm();
        if tau > 0.0 {
            for visit in self.touches.visits_in(0..x.len()) {
                let m = self.touches.visit_inverse(&self.touches.normals_square(visit.clone()));
                let weights = self.touches.weights();
                let sum =
                    visit.clone().fold(Vector3::zeros(), |s, i| s + self.touches.normal_in_r(i) * (x[i] * weights[i]));
                let by = m * sum;
                for i in visit {
                    x[i] -= self.touches.normal_in_r(i).dot(&by);
                }
            }
        }
        for (value, w) in x.iter_mut().zip(self.touches.weights()) {
            *value *= w / (sigma * sigma);
        }
    }

    /// Diagonal of V⁻¹ − V⁻¹JCJᵀV⁻¹, visit by visit; 0 for touches that are not used.
    fn diagonal(&self, covariance: &DMatrix<f64>) -> Vec<f64> {
        let (sigma, tau) = self.touches.noise_mm();
        let (w, s2) = (self.touches.weights(), sigma * sigma);
        let own: Vec<DMatrix<f64>> =
            self.columns.iter().map(|c| DMatrix::from_fn(c.len(), c.len(), |a, b| covariance[(c[a], c[b])])).collect();
        let n = self.gap.len();
        let mut d = vec![0.0; n];
        let visits = if tau > 0.0 { self.touches.visits_in(0..n) } else { std::iter::once(0..n).collect() };
        for visit in visits {
            let (mut m, mut shared, mut square) = (Matrix3::zeros(), DMatrix::zeros(0, 0), Matrix3::zeros());
            if tau > 0.0 {
                m = self.touches.visit_inverse(&self.touches.normals_square(visit.clone()));
                let mut sums = DMatrix::zeros(3, covariance.nrows());
                for i in visit.clone() {
                    let n = self.touches.normal_in_r(i) * w[i];
                    let (columns, values) = self.row(i);
                    for (&c, v) in columns.iter().zip(values) {
                        for k in 0..3 {
                            sums[(k, c)] += n[k] * v;
                        }
                    }
                }
                shared = covariance * sums.transpose();
                let full = &sums * &shared;
                square = Matrix3::from_fn(|r, c| full[(r, c)]);
            }
            for i in visit {
                if w[i] == 0.0 {
                    continue;
                }
                let (_, values) = self.row(i);
                let block = &own[self.set_up[i]];
                let quadratic: f64 = values
                    .iter()
                    .zip(block.column_iter())
                    .map(|(v, column)| v * values.iter().zip(column.iter()).map(|(x, c)| x * c).sum::<f64>())
                    .sum();
                let (mut noise, mut fit) = (1.0 / s2, quadratic / (s2 * s2));
                if tau > 0.0 {
                    let mn = m * self.touches.normal_in_r(i);
                    noise -= self.touches.normal_in_r(i).dot(&mn) / s2;
                    let cross = Vector3::from_fn(|k, _| self.dot(i, shared.column(k).as_slice()));
                    fit += (mn.dot(&(square * mn)) - 2.0 * cross.dot(&mn)) / (s2 * s2);
                }
                d[i] = noise - fit;
            }
        }
        d
    }

    /// Column i of V⁻¹ − V⁻¹JCJᵀV⁻¹.
    fn column(&self, i: usize, covariance: &DMatrix<f64>) -> Vec<f64> {
        let n = self.gap.len();
        let mut unit = vec![0.0; n];
        unit[i] = 1.0;
        self.inverse_noise(&mut unit);
        let mut b = DVector::zeros(covariance.nrows());
        for (k, u) in unit.iter().enumerate().filter(|(_, u)| **u != 0.0) {
            let (columns, values) = self.row(k);
            columns.iter().zip(values).for_each(|(&c, v)| b[c] += u * v);
        }
        let moved = covariance * b;
        let mut column: Vec<f64> = (0..n).map(|k| self.dot(k, moved.as_slice())).collect();
        self.inverse_noise(&mut column);
        column.iter_mut().zip(&unit).for_each(|(c, u)| *c = u - *c);
        column
    }
}

impl Snoop {
    /// At a fit: touches with weight 0 are out already and stay out. `covariance` is that of the free unknowns;
    /// `noise_dof` the degrees of freedom of σ (0 where it is not known).
    #[must_use]
    pub fn new(
        touches: &Touches,
        theta: &DVector<f64>,
        covariance: &DMatrix<f64>,
        (chi2, dof): (f64, usize),
        noise_dof: f64,
    ) -> Self {
        let short = touches.short_rows(theta);
        let rows = Rows {
            touches,
            columns: short.columns,
            set_up: short.set_up,
            start: short.start,
            values: short.values,
            gap: short.gap,
        };
        let mut a = rows.gap.clone();
        rows.inverse_noise(&mut a);
        let d = rows.diagonal(covariance);
        let mut snoop = Self { a, d, u: Vec::new(), chi2, dof: dof as f64, noise_dof };
        snoop.search(&rows, covariance);
        snoop
    }

    /// Scale² without touch i.
    fn scale2(&self, i: usize) -> f64 {
        let without = self.chi2 - self.a[i] * self.a[i] / self.d[i];
        let found = (without.max(0.0) + self.noise_dof) / (self.dof - 1.0 + self.noise_dof).max(1.0);
        found.max(LEAST_SCALE2)
    }

    /// ∇ᵢ over its standard deviation; 0 for a touch that nothing else controls.
    fn standardised(&self, i: usize, least: f64) -> f64 {
        if self.d[i] <= least || self.dof < 2.0 {
            return 0.0;
        }
        let s2 = self.scale2(i);
        self.a[i] / (self.d[i] * s2).sqrt()
    }

    fn search(&mut self, rows: &Rows, covariance: &DMatrix<f64>) {
        let n = self.a.len();
        let most = (MOST_SHARE * n as f64).ceil() as usize + 1;
        let (sigma, _) = rows.touches.noise_mm();
        // a touch whose residual the fit takes away nearly whole cannot be judged
        let least = 1e-6 / (sigma * sigma);
        while self.u.len() < most {
            let worst = (0..n).map(|i| (i, self.standardised(i, least))).max_by(|x, y| x.1.abs().total_cmp(&y.1.abs()));
            let Some((i, w)) = worst else { break };
            if w.abs() <= LIMIT {
                break;
            }
            // column i of P, less what the touches dropped before take of it
            let mut column = rows.column(i, covariance);
            for (_, u) in &self.u {
                let at = u[i];
                column.iter_mut().zip(u).for_each(|(c, x)| *c -= x * at);
            }
            let root = self.d[i].sqrt();
            column.iter_mut().for_each(|c| *c /= root);
            let amount = self.a[i] / root;
            self.chi2 -= amount * amount;
            self.dof -= 1.0;
            for ((a, d), c) in self.a.iter_mut().zip(&mut self.d).zip(&column) {
                *a -= c * amount;
                *d = (*d - c * c).max(0.0);
            }
            self.d[i] = 0.0;
            self.a[i] = 0.0;
            self.u.push((i, column));
        }
    }

    /// The touches that were dropped, in their order.
    #[must_use]
    pub fn dropped(&self) -> Vec<usize> {
        self.u.iter().map(|(i, _)| *i).collect()
    }

    /// Externally studentised residual of each touch that is still in.
    #[must_use]
    pub fn studentised(&self) -> Vec<f64> {
        (0..self.a.len()).map(|i| self.standardised(i, 0.0)).collect()
    }
}

/// What the rejected touches of a fit without them are off by: (mm, standard deviations). `gap` and `row` (mm per unit of
/// the free unknowns) of the touch at that fit.
#[must_use]
pub fn judge(gap_mm: f64, row: &DVector<f64>, covariance: &DMatrix<f64>, variance_mm2: f64, scale2: f64) -> (f64, f64) {
    let predicted = row.dot(&(covariance * row));
    (gap_mm, gap_mm / ((variance_mm2 + predicted) * scale2.max(1e-300)).sqrt())
}

/// True for a touch that is back in: [`judge`] finds it within the limit.
#[must_use]
pub fn belongs(standardised: f64) -> bool {
    standardised.abs() < LIMIT
}

/// A face as it was touched: visit, block, rounded normal.
pub type Face = (usize, usize, [i8; 3]);

/// Clusters among rejected touches: where three or more of one face in one visit go together and make half of it, they
/// are no chips but say something in common.
#[must_use]
pub fn clusters(rejected: &[usize], face_of: impl Fn(usize) -> Face, n: usize) -> Vec<Vec<usize>> {
    let mut faces: BTreeMap<Face, (usize, Vec<usize>)> = BTreeMap::new();
    for i in 0..n {
        faces.entry(face_of(i)).or_default().0 += 1;
    }
    for &i in rejected {
        faces.entry(face_of(i)).or_default().1.push(i);
    }
    faces.into_values().filter(|(all, out)| out.len() >= 3 && 2 * out.len() >= *all).map(|(_, out)| out).collect()
}

/// Weights of a robust start: Geman and McClure's function with a scale that falls from the largest residual to 3 σ.
#[must_use]
pub fn robust_weights(gaps_mm: &[f64], scale_mm: f64) -> Vec<f64> {
    gaps_mm.iter().map(|r| (1.0 + (r / scale_mm).powi(2)).powi(-2)).collect()
}

/// Standard deviation from the median of absolute values, mm: what most touches say.
#[must_use]
pub fn median_scale(gaps_mm: &[f64]) -> f64 {
    let mut sizes: Vec<f64> = gaps_mm.iter().map(|r| r.abs()).collect();
    sizes.sort_unstable_by(f64::total_cmp);
    sizes.get(sizes.len() / 2).map_or(0.0, |m| 1.4826 * m)
}
