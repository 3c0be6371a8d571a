//! Data snooping: touches that do not belong to the rest, one at a time, and back again where they do.
//!
//! With P = V⁻¹ − V⁻¹JCJᵀV⁻¹ and a = P·y, touch i misses the others by ∇ᵢ = aᵢ/Pᵢᵢ with the variance 1/Pᵢᵢ (Baarda's
//! mean shift); leaving it out changes P by a rank-one term, so that no refit is needed on the way. The scale is the
//! externally studentised one: a missing effect widens it, and good touches are not thrown after a bad model.

use super::normal::Touches;
use super::quantiles::student_as_4;
use crate::units::um_from_mm;
use nalgebra::{DMatrix, DVector, Matrix3, Vector3};
use std::collections::BTreeMap;

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

/// A rejected touch.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rejection {
    /// Index of the observation.
    pub touch: usize,
    /// By how much it misses what the other touches say, mm along the outward normal.
    pub off_mm: f64,
    /// The same in standard deviations.
    pub standardised: f64,
    /// Degrees of freedom of what a standard deviation is.
    pub dof: f64,
}

impl Rejection {
    /// In words.
    #[must_use]
    pub fn reason(&self) -> String {
        // a touch that a wide misfit hides is told by the fit in which the rest votes first, and that is why it is out
        if belongs(self.standardised, self.dof) {
            return format!(
                "{:+.1} um off what the other touches say: a robust fit, in which far touches count little, leaves it out with \
                 others: a chip, a drop or a double touch?",
                um_from_mm(self.off_mm)
            );
        }
        // of touches without noise the scatter is rounding: its multiples say nothing
        let times = self.standardised.abs();
        let times = if times < 1000.0 { format!("{times:.1}") } else { "more than 1000".to_owned() };
        format!(
            "{:+.1} um off what the other touches say ({times} standard deviations of their scatter): a chip, a drop or a double touch?",
            um_from_mm(self.off_mm)
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
    out: Dropped,
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
        let mut moved: Vec<f64> = Vec::new();
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
                d[i] = noise - fit;
            }
        }
        d
    }

    /// Jᵀ·x.
    fn onto_unknowns(&self, x: &[f64], unknowns: usize) -> DVector<f64> {
        let mut b = DVector::zeros(unknowns);
        for (k, u) in x.iter().enumerate().filter(|(_, u)| **u != 0.0) {
            let (columns, values) = self.row(k);
            columns.iter().zip(values).for_each(|(&c, v)| b[c] += u * v);
        }
        b
    }

    /// Column i of P with the dropped touches projected out, which is then one of them.
    fn drop_touch(&self, i: usize, covariance: &DMatrix<f64>, out: &mut Dropped) -> Vec<f64> {
        let n = self.gap.len();
        let unit = |at: &[(usize, f64)]| {
            let mut x = vec![0.0; n];
            at.iter().for_each(|(k, value)| x[*k] = *value);
            self.inverse_noise(&mut x);
            x
        };
        let mut noise = unit(&[(i, 1.0)]);
        let mut image = self.onto_unknowns(&noise, covariance.nrows());
        let own = image.clone();
        let mut moved = covariance * &image;
        let with_dropped: Vec<f64> =
            out.touches.iter().zip(&out.images).map(|(&d, b)| noise[d] - b.dot(&moved)).collect();
        let row = out.forward(with_dropped);
        let by = out.backward(&row);
        if !by.is_empty() {
            // one product for all of them: the columns of the dropped touches themselves are not kept
            let mut at = vec![(i, 1.0)];
            at.extend(out.touches.iter().zip(&by).map(|(&d, w)| (d, -w)));
            noise = unit(&at);
            out.images.iter().zip(&by).for_each(|(b, w)| image.axpy(-w, b, 1.0));
            moved = covariance * &image;
        }
        let mut column: Vec<f64> = (0..n).map(|k| self.dot(k, moved.as_slice())).collect();
        self.inverse_noise(&mut column);
        column.iter_mut().zip(&noise).for_each(|(c, u)| *c = u - *c);
        out.touches.push(i);
        out.images.push(own);
        out.lower.push(row);
        column
    }
}

/// The dropped touches in their order, with the Cholesky factor of their part of P.
#[derive(Debug, Clone, Default)]
struct Dropped {
    touches: Vec<usize>,
    /// JᵀV⁻¹ of each.
    images: Vec<DVector<f64>>,
    /// Rows of the factor, each without its diagonal.
    lower: Vec<Vec<f64>>,
    diagonal: Vec<f64>,
}

impl Dropped {
    /// L⁻¹·x.
    fn forward(&self, mut x: Vec<f64>) -> Vec<f64> {
        for k in 0..x.len() {
            let sum: f64 = self.lower[k].iter().zip(&x).map(|(l, y)| l * y).sum();
            x[k] = (x[k] - sum) / self.diagonal[k];
        }
        x
    }

    /// L⁻ᵀ·y.
    fn backward(&self, y: &[f64]) -> Vec<f64> {
        let mut x = y.to_vec();
        for k in (0..x.len()).rev() {
            x[k] /= self.diagonal[k];
            let value = x[k];
            x.iter_mut().zip(&self.lower[k]).for_each(|(x, l)| *x -= l * value);
        }
        x
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
        let mut snoop = Self { a, d, out: Dropped::default(), chi2, dof: dof as f64, noise_dof };
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
        while self.out.touches.len() < most {
            let worst = (0..n).map(|i| (i, self.standardised(i, least))).max_by(|x, y| x.1.abs().total_cmp(&y.1.abs()));
            let Some((i, w)) = worst else { break };
            if w.abs() <= LEAST_LIMIT || w.abs() <= limit(self.dof - 1.0 + self.noise_dof) {
                break;
            }
            let mut column = rows.drop_touch(i, covariance, &mut self.out);
            let root = self.d[i].sqrt();
            self.out.diagonal.push(root);
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
        }
    }

    /// The touches that were dropped, in their order.
    #[must_use]
    pub fn dropped(&self) -> Vec<usize> {
        self.out.touches.clone()
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

#[cfg(test)]
mod tests {
    use super::super::solve::Problem;
    use super::*;
    use crate::axes::AxisName;
    use crate::diag::source;
    use crate::log::{Status, Touch};
    use crate::machine;
    use crate::model::catalogue::Catalogue;
    use crate::model::data::{Run, assemble};
    use crate::model::predict::Model;
    use crate::program::{self, Options};

    /// The touches of a program, each off its nominal place in its own way.
    fn touches_of(plan: &crate::program::plan::Plan) -> Vec<Touch> {
        let touch = |p: &crate::program::plan::PlanTouch| {
            let mut position = p.nominal_position();
            let by = (p.id as f64 * 12.9898).sin() * 2e-3;
            position.set(AxisName::X, position.get(AxisName::X) + by);
            position.set(AxisName::Z, position.get(AxisName::Z) - 0.7 * by);
            Touch {
                id: p.id,
                position,
                status: Status::Hit,
                time_s: None,
                digit_mm: None,
                temperature_deg_c: None,
                line: 1,
            }
        };
        plan.touches.iter().map(touch).collect()
    }

    #[test]
    fn touches_dropped_one_by_one_leave_what_a_fit_without_them_has() {
        let (machines, _) = machine::load(&source("machines", machine::BUILT_IN)).unwrap();
        let machine = machines.into_iter().find(|m| m.name == "swivel-head").unwrap();
        let spec = program::choose(program::built_in().unwrap(), "head", &machine).unwrap();
        let plan = program::generate(&machine, &spec, &Options::default()).unwrap().0.plan;
        let measured = touches_of(&plan);
        let data = assemble(&machine, &[Run { plan: &plan, touches: &measured, mounting: None, started_s: None }]);
        let catalogue = Catalogue::built_in().unwrap();
        let effects = super::super::effects_of(&["location-b".to_owned()], &catalogue, &machine).unwrap();
        let model = Model::new(&machine, &effects, &data.set_ups, machine.reference.pivot);
        let theta = model.start();
        let free: Vec<usize> = (0..theta.len()).collect();
        let batch = model.prepare(&data.observations);
        let start = DVector::from_vec(theta.clone());
        let n = data.observations.len();
        for tau_mm in [0.0, 0.7e-3] {
            let at = |weights: &[f64]| {
                let mut touches = Touches::new(&batch, &data.visits, theta.clone(), &free, &[], (1e-3, tau_mm));
                touches.set_weights(weights.to_vec());
                let covariance = touches.normal(&start, true).gram.try_inverse().unwrap();
                (touches, covariance)
            };
            let (touches, covariance) = at(&vec![1.0; n]);
            let short = touches.short_rows(&start);
            let (columns, set_up, begin) = (short.columns, short.set_up, short.start);
            let rows = Rows { touches: &touches, columns, set_up, start: begin, values: short.values, gap: short.gap };
            // several of one visit and several of others
            let drops = [17, 3, 18, 19, 120, 60, 4];
            let mut d = rows.diagonal(&covariance);
            let mut out = Dropped::default();
            for i in drops {
                let column = rows.drop_touch(i, &covariance, &mut out);
                assert!((column[i] - d[i]).abs() < 1e-9 * d[i], "tau {tau_mm}: {} and {}", column[i], d[i]);
                out.diagonal.push(d[i].sqrt());
                let root = d[i];
                d.iter_mut().zip(&column).for_each(|(d, c)| *d -= c * c / root);
            }
            let mut weights = vec![1.0; n];
            drops.iter().for_each(|&i| weights[i] = 0.0);
            let (touches, covariance) = at(&weights);
            let short = touches.short_rows(&start);
            let (columns, set_up, begin) = (short.columns, short.set_up, short.start);
            let rows = Rows { touches: &touches, columns, set_up, start: begin, values: short.values, gap: short.gap };
            let without = rows.diagonal(&covariance);
            for i in (0..n).filter(|i| !drops.contains(i)) {
                assert!(
                    (d[i] - without[i]).abs() < 1e-9 * without[i],
                    "tau {tau_mm} touch {i}: {} {}",
                    d[i],
                    without[i]
                );
            }
        }
    }
}
