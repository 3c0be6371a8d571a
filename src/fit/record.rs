//! A fit with everything that later rooms need.

use super::noise::Noise;
use super::normal::{Prior, Touches};
use super::outcome::Outcome;
use super::remark::{Reason, Remark};
use super::settings::Knowledge;
use super::solve::Observability;
use super::whitening::{VisitNormals, Whitening};
use crate::model::data::Data;
use crate::model::predict::Model;
use nalgebra::{DMatrix, DVector};
use std::collections::BTreeMap;

/// A fit with everything that later rooms need.
#[derive(Debug, Clone)]
pub struct Fit {
    pub model: Model,
    pub data: Data,
    /// All unknowns, held ones included, each in its unit.
    pub theta: Vec<f64>,
    /// Measured less model along the outward normal, mm, per observation.
    pub residual_mm: Vec<f64>,
    /// Externally studentised residuals, per observation; of a touch that is not used, how far it is off what the others say
    /// in standard deviations.
    pub studentised: Vec<f64>,
    /// 1 for each touch that is used, else 0.
    pub weight: Vec<f64>,
    /// Why a touch is not used, by observation.
    pub rejected: BTreeMap<usize, Reason>,
    /// Covariance of all unknowns, in their units; zero rows for held ones.
    pub covariance: DMatrix<f64>,
    /// What one standard uncertainty of each type B row makes of the free unknowns, in their units.
    pub type_b: Vec<DVector<f64>>,
    /// What the nominal touches say about the free unknowns.
    pub observability: Observability,
    /// The same at the solution, of equal rank: combinations that leave no trace bend with the machine's errors.
    pub seen: Observability,
    /// Indices of the free unknowns.
    pub free: Vec<usize>,
    /// Priors, by unknown.
    pub priors: Vec<Prior>,
    /// What the user said, by unknown.
    pub knowledge: Vec<Option<Knowledge>>,
    pub noise: Noise,
    /// How many outliers a robust fit finds, where they are too many to be excluded.
    pub outliers_beyond: Option<usize>,
    /// Other values of shape parameters that fit about as well, the best first, by unknown.
    pub other_values: BTreeMap<usize, Vec<f64>>,
    /// χ² of the touches and priors.
    pub chi2: f64,
    /// Degrees of freedom.
    pub dof: usize,
    /// What a reader must know; in words among the outcome's warnings.
    pub remarks: Vec<Remark>,
    /// The result.
    pub outcome: Outcome,
}

/// A fit linearised at its minimum: rows are the touches and then the priors, in units of their noise. Rows of touches
/// that are not used are zero.
#[derive(Debug, Clone)]
pub struct Linear {
    /// Whitened residuals.
    pub residual: DVector<f64>,
    /// Whitened Jacobian of the free unknowns.
    pub jacobian: DMatrix<f64>,
}

impl Fit {
    /// The free unknowns.
    #[must_use]
    pub fn free_theta(&self) -> DVector<f64> {
        DVector::from_iterator(self.free.len(), self.free.iter().map(|&i| self.theta[i]))
    }

    /// Calls `f` with the touches as a problem at the given τ, mm.
    pub fn with_touches<T>(&self, tau_mm: f64, f: impl FnOnce(&Touches) -> T) -> T {
        self.with_noise((self.noise.sigma_mm, tau_mm), f)
    }

    /// The same at a given scatter of touches and of visits, mm.
    pub(super) fn with_noise<T>(&self, noise_mm: (f64, f64), f: impl FnOnce(&Touches) -> T) -> T {
        let held = |i: usize| self.free.binary_search(&i).is_err();
        let batch = self.model.prepare_holding(&self.data.observations, &self.theta, &held);
        let mut touches =
            Touches::new(&batch, &self.data.visits, self.theta.clone(), &self.free, &self.priors, noise_mm);
        touches.set_weights(self.weight.clone());
        f(&touches)
    }

    /// Calls `f` with the touches of an errorless machine on artefacts at their planned places. The columns of effects that the model
    /// leaves out are made there, too: a sphere beside its place is touched with other normals, and two effects that are one
    /// number would seem to differ. `f` also gets the free unknowns.
    pub(super) fn with_nominal_touches<T>(&self, f: impl FnOnce(&Touches, &DVector<f64>) -> T) -> T {
        let mut theta = self.theta.clone();
        for (value, (start, unknown)) in theta.iter_mut().zip(self.model.start().into_iter().zip(&self.model.unknowns))
        {
            if unknown.is_set_up() {
                *value = start;
            }
        }
        let held = |i: usize| self.free.binary_search(&i).is_err();
        let batch = self.model.prepare_holding(&self.data.nominal, &theta, &held);
        let free = DVector::from_iterator(self.free.len(), self.free.iter().map(|&i| theta[i]));
        let noise_mm = (self.noise.sigma_mm, self.noise.tau_mm);
        let mut touches = Touches::new(&batch, &self.data.visits, theta.clone(), &self.free, &self.priors, noise_mm);
        touches.set_weights(self.weight.clone());
        f(&touches, &free)
    }

    /// What whitens columns of all touches, with a given scatter of visits, mm.
    #[must_use]
    pub fn whitening(&self, tau_mm: f64) -> Whitening {
        self.with_touches(tau_mm, |t| t.whitening())
    }

    /// What a scatter of visits does to rows of the touches that are used.
    #[must_use]
    pub fn visit_normals(&self) -> VisitNormals {
        self.with_touches(0.0, |t| t.visit_normals())
    }

    /// The fit linearised, with the given τ, mm (tests for missing effects use the noise's upper bound).
    #[must_use]
    pub fn linear(&self, tau_mm: f64) -> Linear {
        let (residual, jacobian) = self.with_touches(tau_mm, |t| t.dense(&self.free_theta()));
        Linear { residual, jacobian }
    }

    /// Number of touches that are used.
    #[must_use]
    pub fn n_used(&self) -> usize {
        self.weight.iter().filter(|w| **w > 0.0).count()
    }
}
