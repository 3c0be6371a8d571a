//! A fit as the statistics see it: whitened rows of the touches that are used, then the priors, and the base model's
//! space.

use crate::fit::Fit;
use crate::fit::whitening::Whitening;
use crate::search::held_out::Colours;
use crate::search::pattern_tests::Rows;
use crate::search::{Basis, PureError, Question};
use crate::units::mm_from_um;
use nalgebra::{DMatrix, DVector};
use std::collections::HashMap;
use std::sync::Arc;

/// The regression that all tests share.
#[derive(Debug, Clone)]
pub struct Evidence {
    /// Whitened residuals.
    pub residual: DVector<f64>,
    /// What the base model can follow.
    pub base: Basis,
    /// Whitened Jacobian of the base model's free unknowns, in their units.
    pub jacobian: DMatrix<f64>,
    /// Observations that are used, in their order: the first rows.
    pub used: Vec<usize>,
    /// Index visit of each row of a touch: what is held out together.
    pub visits: Vec<usize>,
    /// From repeats, where there were enough; else what is declared or stated.
    pub pure: Option<PureError>,
    /// Scatter of index visits that the tests allow for, mm.
    pub tau_mm: f64,
    /// What makes rows of columns of gaps.
    pub(super) rows: Arc<WhiteRows>,
}

/// What makes rows of the regression of columns of gaps.
#[derive(Debug)]
pub(super) struct WhiteRows {
    whitening: Whitening,
    /// Observations that are used, in their order: the first rows.
    used: Vec<usize>,
    /// Rows of priors.
    n_priors: usize,
}

impl WhiteRows {
    /// What makes some of the rows, in ascending order, and the observations that they are made of.
    pub(super) fn part(&self, rows: &[usize]) -> (Vec<usize>, Self) {
        let own: Vec<usize> = rows.iter().filter_map(|&row| self.used.get(row).copied()).collect();
        let (touches, whitening) = self.whitening.part(&own);
        let used = own.iter().filter_map(|touch| touches.binary_search(touch).ok()).collect();
        // rows of priors see nothing of an effect that is not in the model
        (touches, Self { whitening, used, n_priors: rows.len() - own.len() })
    }

    pub(super) fn of_mm(&self, mut columns_mm: DMatrix<f64>) -> DMatrix<f64> {
        self.whitening.apply(&mut columns_mm);
        let (touches, columns) = columns_mm.shape();
        let rows = self.used.len() + self.n_priors;
        if rows == touches && self.n_priors == 0 {
            return columns_mm;
        }
        // in place: the columns of a large study would not fit into memory twice
        let mut numbers: Vec<f64> = columns_mm.data.into();
        for column in 0..columns {
            for (to, &touch) in self.used.iter().enumerate() {
                numbers[column * self.used.len() + to] = numbers[column * touches + touch];
            }
        }
        numbers.truncate(columns * self.used.len());
        if self.n_priors > 0 {
            numbers.resize(columns * rows, 0.0);
            for column in (0..columns).rev() {
                numbers.copy_within(column * self.used.len()..(column + 1) * self.used.len(), column * rows);
                numbers[column * rows + self.used.len()..(column + 1) * rows].fill(0.0);
            }
        }
        DMatrix::from_vec(rows, columns, numbers)
    }
}

impl Rows for WhiteRows {
    fn count(&self) -> usize {
        self.used.len() + self.n_priors
    }

    fn all(&self, mut columns_um: DMatrix<f64>) -> DMatrix<f64> {
        columns_um.apply(|um| *um = mm_from_um(*um));
        self.of_mm(columns_um)
    }
}

impl Evidence {
    /// Of a fit, with the scatter of index visits that tests must allow for.
    #[must_use]
    pub fn from_fit(fit: &Fit) -> Self {
        Self::with_visits(fit, fit.noise.tau_test_mm)
    }

    /// Of a fit, with a given scatter of index visits, mm.
    #[must_use]
    pub fn with_visits(fit: &Fit, tau_mm: f64) -> Self {
        let linear = fit.linear(tau_mm);
        let n = fit.data.observations.len();
        let used: Vec<usize> = (0..n).filter(|&i| fit.weight[i] > 0.0).collect();
        let rows: Vec<usize> = used.iter().copied().chain(n..linear.residual.len()).collect();
        let residual = DVector::from_iterator(rows.len(), rows.iter().map(|&i| linear.residual[i]));
        let jacobian = linear.jacobian.select_rows(&rows);
        // repeats are rows of this regression; beside a σ that the study states they count as they are
        let repeats = |(found_mm, dof): (f64, f64)| PureError {
            variance: (found_mm / fit.noise.sigma_mm).powi(2),
            dof,
            within: true,
            floor: fit.noise.tau_test_mm > 0.0,
        };
        Self {
            base: Basis::new(&jacobian),
            visits: used.iter().map(|&i| fit.data.visits[i]).collect(),
            rows: Arc::new(WhiteRows {
                whitening: fit.whitening(tau_mm),
                used: used.clone(),
                n_priors: linear.residual.len() - n,
            }),
            residual,
            jacobian,
            used,
            pure: Some(fit.noise.repeats.map_or(PureError::TOLD, repeats)),
            tau_mm,
        }
    }

    #[must_use]
    pub fn n_rows(&self) -> usize {
        self.residual.len()
    }

    /// Degrees of freedom of the residual.
    #[must_use]
    pub fn dof(&self) -> usize {
        self.n_rows().saturating_sub(self.base.rank())
    }

    /// The question that the tests answer.
    #[must_use]
    pub fn question(&self) -> Question<'_> {
        Question { residual: &self.residual, base: &self.base, pure: self.pure }
    }

    /// What turns whitened rows of a visit back into µm of its touches, by number of the visit. Whitening mixes
    /// touches of one visit only, so that one column for each place in a visit shows it whole.
    #[must_use]
    pub fn colours_um(&self, fit: &Fit) -> Colours {
        let mut rows: HashMap<usize, Vec<usize>> = HashMap::new();
        for (row, visit) in self.visits.iter().enumerate() {
            rows.entry(*visit).or_default().push(row);
        }
        let longest = rows.values().map(Vec::len).max().unwrap_or(0);
        let mut units = DMatrix::zeros(fit.data.observations.len(), longest);
        for of in rows.values() {
            for (k, &row) in of.iter().enumerate() {
                units[(self.used[row], k)] = crate::units::mm_from_um(1.0);
            }
        }
        let white = self.whiten(units);
        let each = rows.into_iter().filter_map(|(visit, of)| {
            let n = of.len();
            let block = DMatrix::from_fn(n, n, |a, b| white[(of[a], b)]);
            Some((visit, block.try_inverse()?))
        });
        Colours { by_group: each.collect(), sigma: crate::units::um_from_mm(fit.noise.sigma_mm) }
    }

    /// Columns of gaps (all observations × columns, mm) as rows of this regression.
    #[must_use]
    pub fn whiten(&self, columns_mm: DMatrix<f64>) -> DMatrix<f64> {
        self.rows.of_mm(columns_mm)
    }
}
