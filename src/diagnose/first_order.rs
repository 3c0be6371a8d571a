//! What a fit would become with further columns in its model, to first order and in its own weights.

use super::candidate_effects::{Named, missing};
use super::evidence::Evidence;
use crate::fit::{Fit, uncertainty};
use crate::machine::Machine;
use crate::model::catalogue::Catalogue;
use crate::search::KEPT;
use crate::units::{mm_from_um, um_from_mm};
use nalgebra::{DMatrix, DVector};

/// A fit at its minimum, ready to take further columns.
#[derive(Debug)]
pub(super) struct FirstOrder<'f> {
    fit: &'f Fit,
    weights: Evidence,
    /// Derivatives of the gaps by the free unknowns, mm per unit, one row per touch.
    raw_jacobian: DMatrix<f64>,
    /// Of the free unknowns.
    pub covariance: DMatrix<f64>,
}

/// How further columns fall in.
struct Fallen {
    /// C·Jᵀ·A: how much each free unknown moves with the sizes, sign reversed.
    moves: DMatrix<f64>,
    /// Norm of each column.
    scale: DVector<f64>,
    /// Directions in scaled sizes that the model leaves, with their squared share.
    directions: Vec<(f64, DVector<f64>)>,
    /// What the model leaves of the columns.
    left: DMatrix<f64>,
}

impl<'f> FirstOrder<'f> {
    pub fn from_fit(fit: &'f Fit) -> Self {
        // the weights of the fit, which a refit keeps, and not those of the tests, which allow for more scatter or for none
        let tau_mm = fit.noise.tau_mm;
        Self {
            weights: Evidence::with_visits(fit, tau_mm),
            raw_jacobian: fit.with_touches(tau_mm, |t| t.unwhitened(&fit.free_theta()).1),
            covariance: uncertainty::free_covariance(fit),
            fit,
        }
    }

    fn fall(&self, raw_mm: &DMatrix<f64>) -> Fallen {
        let columns = self.weights.whiten(raw_mm.clone());
        let left = self.weights.base.project_columns(&columns);
        let scale = columns.column_iter().map(|c| c.norm().max(f64::MIN_POSITIVE));
        let scale = DVector::from_iterator(columns.ncols(), scale);
        let gram = left.tr_mul(&left);
        let scaled = DMatrix::from_fn(gram.nrows(), gram.ncols(), |i, j| gram[(i, j)] / (scale[i] * scale[j]));
        let eigen = scaled.symmetric_eigen();
        let kept =
            eigen.eigenvalues.iter().zip(eigen.eigenvectors.column_iter()).filter(|(value, _)| **value > KEPT * KEPT);
        let directions = kept.map(|(value, vector)| (*value, vector.into_owned())).collect();
        Fallen { moves: &self.covariance * self.weights.jacobian.tr_mul(&columns), scale, directions, left }
    }

    /// What these columns (mm, one row per touch) in the model change of each residual, mm.
    fn change_mm(&self, raw_mm: &DMatrix<f64>) -> DVector<f64> {
        let fallen = self.fall(raw_mm);
        let slope = fallen.left.tr_mul(&self.weights.residual).component_div(&fallen.scale);
        let mut sizes = DVector::zeros(raw_mm.ncols());
        for (value, vector) in &fallen.directions {
            sizes -= vector * (vector.dot(&slope) / value);
        }
        sizes.component_div_assign(&fallen.scale);
        raw_mm * &sizes - &self.raw_jacobian * (&fallen.moves * &sizes)
    }

    /// RMS over the touches that are used with these columns (mm, one row per touch) in the model, µm.
    pub fn rms_um(&self, raw_mm: &DMatrix<f64>) -> f64 {
        let change = self.change_mm(raw_mm);
        let used = &self.weights.used;
        let sum: f64 = used.iter().map(|&i| (self.fit.residual_mm[i] + change[i]).powi(2)).sum();
        um_from_mm((sum / used.len().max(1) as f64).sqrt())
    }

    /// What these columns in the model add to the variance of each free unknown: C' = C + G·C_c·Gᵀ with G how they move with
    /// it; what the plan does not see of the columns moves nothing.
    pub fn added_variance(&self, raw_mm: &DMatrix<f64>) -> DVector<f64> {
        let fallen = self.fall(raw_mm);
        let mut added = DVector::zeros(self.covariance.nrows());
        for (value, vector) in fallen.directions.iter().filter(|(value, _)| *value > KEPT) {
            let along = &fallen.moves * vector.component_div(&fallen.scale);
            added += along.component_mul(&along) / *value;
        }
        added
    }
}

/// What one effect in the model would take away from the residual of each touch, µm, by one linear step from a fit; 0 where a touch
/// is not used. `None` for an effect that is no candidate, or whose shape only the fit itself can find.
#[must_use]
pub fn taken_away_um(fit: &Fit, machine: &Machine, catalogue: &Catalogue, effect: &str) -> Option<Vec<f64>> {
    let effect = missing(fit, machine, catalogue).into_iter().find(|e| e.id == effect)?;
    if effect.parameters.iter().any(|p| p.shape.is_some()) || fit.n_used() == 0 || fit.dof == 0 {
        return None;
    }
    let linear = FirstOrder::from_fit(fit);
    let named = Named::with(fit, &linear.weights, machine, vec![effect]);
    // an effect that has no value at some touches is no candidate
    if named.effects.is_empty() {
        return None;
    }
    let raw_mm = named.raw_um(&[(0, 0)]).pop()?.map(mm_from_um);
    let change = linear.change_mm(&raw_mm);
    let each = change.iter().zip(&fit.weight);
    Some(each.map(|(mm, weight)| if *weight > 0.0 { -um_from_mm(*mm) } else { 0.0 }).collect())
}
