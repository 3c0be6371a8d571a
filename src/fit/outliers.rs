//! Outliers: touches that do not agree with the rest. Here are the measure and its limit; `outlier_loop.rs` decides which touches go.
//!
//! With P = V⁻¹ − V⁻¹JCJᵀV⁻¹ and a = P·y, touch i misses the others by ∇ᵢ = aᵢ/Pᵢᵢ with the variance 1/Pᵢᵢ (Baarda's mean shift).
//! The scale is the externally studentised one: a missing effect widens it, and good touches are not excluded because of a bad model.

use super::normal::Touches;
use super::quantiles::student_as_4;
use nalgebra::{DMatrix, DVector, Matrix3, Vector3};
use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;

/// A touch further off than 4 standard deviations is left out: the chance of a good one is 6e-5. Where few others say what a standard
/// deviation is, it takes more for the same chance; `dof` are the degrees of freedom of that.
fn limit(dof: f64) -> f64 {
    student_as_4(dof)
}

/// The least that it ever is.
const LEAST_LIMIT: f64 = 4.0;

/// More than this share of rejected touches is no longer a matter of chips: it is a finding by itself.
pub const MOST_SHARE: f64 = 0.02;

/// The scatter is never taken for less than a hundredth of the noise: what is left in a log without noise is rounding,
/// and no touch stands out of that.
const LEAST_SCALE2: f64 = 1e-4;

/// How far each touch is off what the others predict, at a fit.
#[derive(Debug, Clone)]
pub struct Studentised {
    /// P·y.
    a: Vec<f64>,
    /// Diagonal of P.
    d: Vec<f64>,
    /// Below this share of its own weight a touch is judged by nothing but itself.
    least: f64,
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
        let own: Vec<DMatrix<f64>> =
            self.columns.iter().map(|c| DMatrix::from_fn(c.len(), c.len(), |a, b| covariance[(c[a], c[b])])).collect();
        let of_part = |part: &Range<usize>| self.diagonal_of(part.clone(), covariance, &own);
        self.touches.each_chunk(of_part).concat()
    }

    /// The diagonal at touches of whole visits; `own` is the covariance of each set-up's unknowns.
    fn diagonal_of(&self, part: Range<usize>, covariance: &DMatrix<f64>, own: &[DMatrix<f64>]) -> Vec<f64> {
        let (sigma, tau) = self.touches.noise_mm();
        let (w, s2) = (self.touches.weights(), sigma * sigma);
        let mut d = vec![0.0; part.len()];
        let mut moved: Vec<f64> = Vec::new();
        let visits = if tau > 0.0 { self.touches.visits_in(part.clone()) } else { vec![part.clone()] };
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
                // sums side by side, not one after the other: several at a time in the processor
                moved.clear();
                moved.resize(values.len(), 0.0);
                for (v, column) in values.iter().zip(block.as_slice().chunks_exact(values.len().max(1))) {
                    moved.iter_mut().zip(column).for_each(|(m, c)| *m += v * c);
                }
                let quadratic: f64 = moved.iter().zip(values).map(|(m, v)| m * v).sum();
                let (mut noise, mut fit) = (1.0 / s2, quadratic / (s2 * s2));
                if tau > 0.0 {
                    let mn = m * self.touches.normal_in_r(i);
                    noise -= self.touches.normal_in_r(i).dot(&mn) / s2;
                    let cross = Vector3::from_fn(|k, _| self.dot(i, shared.column(k).as_slice()));
                    fit += (mn.dot(&(square * mn)) - 2.0 * cross.dot(&mn)) / (s2 * s2);
                }
                d[i - part.start] = noise - fit;
            }
        }
        d
    }
}

impl Studentised {
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
        let (sigma, _) = touches.noise_mm();
        Self { a, d, least: 1e-6 / (sigma * sigma), chi2, dof: dof as f64, noise_dof }
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

    /// The touches beyond the limit, the worst first; of each index position only its worst one, whose error the others share.
    #[must_use]
    pub fn outliers(&self, visits: &[usize]) -> Vec<usize> {
        let limit = LEAST_LIMIT.max(limit(self.dof - 1.0 + self.noise_dof));
        let mut beyond: Vec<(usize, f64)> =
            (0..self.a.len()).map(|i| (i, self.standardised(i, self.least).abs())).filter(|t| t.1 > limit).collect();
        beyond.sort_by(|x, y| y.1.total_cmp(&x.1));
        let mut seen = BTreeSet::new();
        beyond.retain(|(i, _)| seen.insert(visits[*i]));
        beyond.into_iter().map(|t| t.0).collect()
    }

    /// Externally studentised residual of each touch that is used.
    #[must_use]
    pub fn each(&self) -> Vec<f64> {
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

/// True for a touch that is back in: [`judge`] finds it within the limit. `dof` are the degrees of freedom of its scale.
#[must_use]
pub fn belongs(standardised: f64, dof: f64) -> bool {
    standardised.abs() < LEAST_LIMIT || standardised.abs() < limit(dof)
}

/// A face as it was touched: visit, block, rounded normal.
pub type Face = (usize, usize, [i8; 3]);

/// Number of touches and the rejected ones of each face.
fn by_face(rejected: &[usize], face_of: impl Fn(usize) -> Face, n: usize) -> impl Iterator<Item = (usize, Vec<usize>)> {
    let mut faces: BTreeMap<Face, (usize, Vec<usize>)> = BTreeMap::new();
    for i in 0..n {
        faces.entry(face_of(i)).or_default().0 += 1;
    }
    for &i in rejected {
        faces.entry(face_of(i)).or_default().1.push(i);
    }
    faces.into_values()
}

/// Clusters among rejected touches: where three or more of one face in one visit go together and make half of it, they
/// are no chips but say something in common.
#[must_use]
pub fn clusters(rejected: &[usize], face_of: impl Fn(usize) -> Face, n: usize) -> Vec<Vec<usize>> {
    by_face(rejected, face_of, n).filter(|(all, out)| out.len() >= 3 && 2 * out.len() >= *all).map(|f| f.1).collect()
}

/// How many rejected touches stand on faces of which more than half is rejected, two touches at least.
#[must_use]
pub fn whole_faces(rejected: &[usize], face_of: impl Fn(usize) -> Face, n: usize) -> usize {
    let whole = |(all, out): (usize, Vec<usize>)| (out.len() >= 2 && 2 * out.len() > all).then_some(out.len());
    by_face(rejected, face_of, n).filter_map(whole).sum()
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
