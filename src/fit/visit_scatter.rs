//! How much the index positions scatter as far as the touches themselves say it, where the machine file only declares it.
//!
//! A declared repeatability is a rough figure, and an uncertainty that rests on it is one, too. The residuals show the scatter:
//! restricted likelihood (Patterson and Thompson, Biometrika 58 (1971) 545), −2 ln L = ln|V| + ln|XᵀV⁻¹X| + rᵀPr, times what is
//! known beforehand, gives the mean of τ² and its uncertainty. Weights, values and χ² stay with what is declared, so that a model
//! that fails is still seen; the uncertainties use the mean.

use super::whitening::VisitNormals;
use super::{Fit, VisitSource, uncertainty};
use crate::search::Basis;
use nalgebra::{DMatrix, DVector};

/// The scatter is looked for up to so many times the declared one: more is no scatter of an axis.
const MOST_TIMES: f64 = 3.0;

/// Steps between 0 and the most.
const STEPS: usize = 15;

/// Variance of the free unknowns that goes back to the scatter of index positions.
#[derive(Debug, Clone)]
pub struct VisitPart {
    /// Standard deviation of each component of a displacement that the uncertainties use, mm.
    pub tau_mm: f64,
    /// Its degrees of freedom; none where it is taken as known.
    pub dof: Option<f64>,
    /// What it adds to the covariance of the free unknowns, which holds the declared scatter already.
    pub more: DMatrix<f64>,
    /// The variance that goes back to the scatter.
    pub variance: DVector<f64>,
}

/// What is known of the scatter before a measurement, as a part of −2 ln L: it is uncertain by 0.7 of itself.
#[must_use]
pub fn known_beforehand(tau_mm: f64, declared_mm: f64) -> f64 {
    if declared_mm > 0.0 { 2.0 * (tau_mm / declared_mm - 1.0).powi(2) } else { 0.0 }
}

impl VisitPart {
    /// Of a fit.
    pub(super) fn new(fit: &Fit, is_estimated: bool) -> Self {
        let moves = uncertainty::moves_with_visits(fit);
        let (used_mm, visit_dof) = (fit.noise.tau_mm, fit.noise.visit_dof);
        let declared = is_estimated && fit.noise.visit_source == VisitSource::Declared && used_mm > 0.0;
        let (tau2, dof) = declared.then(|| mean_square(fit)).flatten().unwrap_or((used_mm * used_mm, visit_dof));
        let per_square = &moves * moves.transpose();
        Self {
            tau_mm: tau2.sqrt(),
            dof,
            variance: per_square.diagonal() * tau2,
            more: per_square * (tau2 - used_mm * used_mm),
        }
    }
}

/// Mean of τ², mm², and its degrees of freedom.
fn mean_square(fit: &Fit) -> Option<(f64, Option<f64>)> {
    let linear = fit.linear(0.0);
    let n = fit.data.observations.len();
    let rows: Vec<usize> = (0..n).filter(|&i| fit.weight[i] > 0.0).chain(n..linear.residual.len()).collect();
    let basis = Basis::new(&linear.jacobian.select_rows(&rows));
    let residual = basis.project(&linear.residual.select_rows(&rows));
    let p = basis.rank();
    let mut all = basis.transposed().clone().insert_row(p, 0.0);
    all.set_row(p, &residual.transpose());
    let normals = fit.visit_normals();
    let (squares, along) = normals.along_axes(&all);
    let whole = &all * all.transpose();
    let declared_mm = fit.noise.tau_mm;
    let deviance = |tau_mm: f64| -> Option<f64> {
        let rho2 = (tau_mm / fit.noise.sigma_mm).powi(2);
        let mut scaled = along.clone();
        for (mut column, s) in scaled.column_iter_mut().zip(&squares) {
            column *= (rho2 / (1.0 + rho2 * s)).sqrt();
        }
        let l = (&whole - &scaled * scaled.transpose()).cholesky()?.unpack();
        let ln_det: f64 = (0..p).map(|i| 2.0 * l[(i, i)].ln()).sum();
        Some(normals.ln_det(tau_mm) + ln_det + l[(p, p)].powi(2) + known_beforehand(tau_mm, declared_mm))
    };
    let each: Vec<(f64, f64)> = (0..=STEPS)
        .filter_map(|k| {
            let tau_mm = MOST_TIMES * declared_mm * k as f64 / STEPS as f64;
            Some((tau_mm * tau_mm, deviance(tau_mm)?))
        })
        .collect();
    let least = each.iter().map(|e| e.1).fold(f64::INFINITY, f64::min);
    let weigh = |of: &dyn Fn(f64) -> f64| each.iter().map(|(t, d)| of(*t) * (-0.5 * (d - least)).exp()).sum::<f64>();
    let total = weigh(&|_| 1.0);
    let mean = weigh(&|t| t) / total;
    let variance = weigh(&|t| (t - mean).powi(2)) / total;
    mean.is_finite().then(|| (mean, (variance > 0.0).then(|| 2.0 * mean * mean / variance)))
}

impl VisitNormals {
    /// Rows of a matrix (columns: the touches, then others) along the principal axes of each visit, and the axes' squares.
    fn along_axes(&self, rows: &DMatrix<f64>) -> (Vec<f64>, DMatrix<f64>) {
        let mut squares = Vec::new();
        let mut columns = Vec::new();
        let mut from = 0;
        for visit in &self.visits {
            let n = visit.normals.len();
            let own = rows.columns(from, n);
            let normals = DMatrix::from_fn(n, 3, |i, k| visit.normals[i][k]);
            let along = own * normals * visit.axes;
            columns.extend(along.column_iter().map(|c| c.into_owned()));
            squares.extend(visit.squares.iter().map(|s| s.max(0.0)));
            from += n;
        }
        (squares, DMatrix::from_columns(&columns))
    }
}
