//! Cross-validated errors of candidates, beside the cross-validated error of the model (`fit::held_out::by_visit`): with the same
//! weights and on the same touches, so that a model has one such figure wherever it is shown.
//!
//! The tests allow for the scatter of index positions that revisited poses show. That may hold the missing effect itself, so that the
//! choice is left to the tests and the errors are worked out with the noise of cross-validation (`Noise::tau_fold_mm`).

use super::candidate_effects::Named;
use super::evidence::Evidence;
use crate::fit::{Fit, held_out};
use crate::search::held_out::{Choice, Colours, HeldOut, held_out_in};
use crate::search::{Library, Origin, side_by_side};
use crate::units::mm_from_um;
use nalgebra::DMatrix;

/// What cross-validated errors are worked out from.
#[derive(Debug)]
pub struct Folds {
    /// The model's own error.
    model: Option<held_out::HeldOut>,
    /// Rows with the noise of cross-validation, where the tests use another one.
    otherwise: Option<Evidence>,
    /// Whitened rows as µm of touches.
    colours: Colours,
}

/// Cross-validated error of a candidate, µm.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Errors {
    /// Without it: the model's own.
    pub before_um: Option<f64>,
    /// With it, on the same touches.
    pub after_um: Option<f64>,
    /// Standard error of their difference.
    pub fall_se_um: Option<f64>,
}

impl Folds {
    /// Of a fit; `evidence` is that of the tests.
    pub(super) fn new(fit: &Fit, evidence: &Evidence) -> Self {
        let model = held_out::by_visit(fit);
        let otherwise =
            (evidence.tau_mm != fit.noise.tau_fold_mm).then(|| Evidence::with_visits(fit, fit.noise.tau_fold_mm));
        let colours = otherwise.as_ref().unwrap_or(evidence).colours_um(fit);
        Self { model, otherwise, colours }
    }

    /// The model's own error.
    #[must_use]
    pub fn model(&self) -> Option<&held_out::HeldOut> {
        self.model.as_ref()
    }

    /// With what the tests chose in each fold.
    pub(super) fn chosen(&self, evidence: &Evidence, named: &Named, tested: &HeldOut) -> HeldOut {
        let mut chosen: Vec<usize> = tested.folds.iter().filter_map(|f| f.chosen).collect();
        chosen.sort_unstable();
        chosen.dedup();
        let mut folds = tested.folds.clone();
        for fold in &mut folds {
            fold.chosen = fold.chosen.and_then(|c| chosen.iter().position(|k| *k == c));
        }
        self.held_out(evidence, named, &chosen, Choice::AsIn(&folds))
    }

    /// With a candidate of the tests.
    pub(super) fn given(&self, evidence: &Evidence, named: &Named, candidate: usize) -> HeldOut {
        self.held_out(evidence, named, &[candidate], Choice::Given(0))
    }

    /// With two candidates of the tests at once, each with one of its variants.
    pub(super) fn both(&self, evidence: &Evidence, named: &Named, two: [(usize, usize); 2]) -> HeldOut {
        let columns = match &self.otherwise {
            Some(own) => named.raw_um(&two).into_iter().map(|um| own.whiten(um.map(mm_from_um))).collect(),
            None => two.map(|(candidate, variant)| named.library.columns(candidate, variant)).to_vec(),
        };
        let own = self.otherwise.as_ref().unwrap_or(evidence);
        let mut library = Library::new(own.n_rows());
        library.push("both", Origin::Catalogue, &side_by_side(&columns));
        held_out_in(own.question(), &library, &own.visits, Choice::Given(0), &self.colours)
    }

    /// Of some candidates of the tests, in ascending order.
    fn held_out(&self, evidence: &Evidence, named: &Named, candidates: &[usize], choice: Choice) -> HeldOut {
        let wanted = |c| candidates.contains(&c);
        let library = match &self.otherwise {
            Some(own) => {
                let variants = |&c: &usize| (0..named.library.candidates()[c].variants.len()).map(move |v| (c, v));
                let raw = named.raw_um(&candidates.iter().flat_map(variants).collect::<Vec<_>>());
                let white: Vec<DMatrix<f64>> = raw.into_iter().map(|um| own.whiten(um.map(mm_from_um))).collect();
                named.library.most(wanted).with_variants(own.n_rows(), &white)
            }
            None => named.library.some(wanted),
        };
        let own = self.otherwise.as_ref().unwrap_or(evidence);
        held_out_in(own.question(), &library, &own.visits, choice, &self.colours)
    }

    /// As they are shown. The linear folds come to the model's own error but for rounding: it is the one figure.
    pub(super) fn errors(&self, held: &HeldOut) -> Errors {
        let Some(model) = self.model.as_ref().filter(|_| held.before.is_finite()) else { return Errors::default() };
        let ratio = if held.before > 0.0 { held.after / held.before } else { 1.0 };
        Errors {
            before_um: Some(model.rms_um),
            after_um: Some(model.rms_um * ratio),
            fall_se_um: Some(held.fall_error).filter(|x| x.is_finite()),
        }
    }
}
