//! The regression that all tests share, with the scatter of index positions that is the most likely once what is missing is in
//! the model.
//!
//! An effect that the model lacks looks like scatter of the index positions, and tests that allow for it are blind to the
//! effect. So the scatter is estimated with each candidate in the model (`search::scatter_that_fits`).

use super::candidate_effects::Named;
use super::evidence::Evidence;
use super::features;
use crate::fit::residual_scatter::MOST_TIMES;
use crate::fit::{Fit, VisitSource, declared_tau_mm};
use crate::machine::Machine;
use crate::model::catalogue::Catalogue;
use crate::search::pattern_tests::{Features, Generics};
use crate::search::{
    Basis, Change, KEPT, Library, Question, Scatter, Search, Supposed, lack_of_fit, scatter_that_fits,
};
use nalgebra::{DMatrix, DMatrixViewMut};
use rayon::prelude::*;
use std::sync::{Arc, OnceLock};

/// Most effects or patterns that are supposed to be there at once.
const MOST_AT_ONCE: usize = 4;

/// Supposed scatters, in units of the largest.
const SUPPOSED: [f64; 6] = [0.0, 0.12, 0.25, 0.42, 0.65, 1.0];

/// The regression of a fit and the candidates.
pub(super) struct Regression<'c> {
    /// What all tests share.
    pub evidence: Evidence,
    pub named: Named<'c>,
    /// Shapes without a name.
    pub generics: Generics,
    /// The scatter that is left with the most likely effect, mm, where it is less than that of the tests.
    order_mm: Option<f64>,
    ordered: OnceLock<Option<(Evidence, Library)>>,
}

impl<'c> Regression<'c> {
    pub fn new(fit: &Fit, machine: &Machine, catalogue: &'c Catalogue, features: &Arc<Features>) -> Self {
        let of = |first: &Evidence| {
            rayon::join(|| Named::for_fit(fit, first, machine, catalogue), || features::shapes(first, features))
        };
        let (first, (named, generics)) = calm(fit, machine, &of).unwrap_or_else(|| {
            let first = Evidence::from_fit(fit);
            let candidates = of(&first);
            (first, candidates)
        });
        let Some(scatter) = estimated(fit, machine, &first, &named, &generics) else {
            return Self { evidence: first, named, generics, order_mm: None, ordered: OnceLock::new() };
        };
        let change = fit.visit_normals().change(first.tau_mm, scatter.tests);
        let change: Change = &|columns| change.apply_to(columns);
        let evidence = Evidence::with_visits(fit, scatter.tests);
        Self {
            named: named.changed(change).unwrap_or_else(|| Named::for_fit(fit, &evidence, machine, catalogue)),
            generics: features::shapes(&evidence, features),
            order_mm: Some(scatter.order).filter(|order_mm| *order_mm < scatter.tests),
            ordered: OnceLock::new(),
            evidence,
        }
    }

    /// The tests of effects.
    pub fn search(&self) -> Search<'_> {
        Search::new(self.evidence.question(), &self.named.library)
    }

    /// The tests of effects with the scatter that is left with the most likely one: their order where no test passes. Its columns are
    /// made when it is asked for.
    pub fn search_for_order(&self, fit: &Fit) -> Option<Search<'_>> {
        let make = |tau_mm: f64| {
            let change = fit.visit_normals().change(self.evidence.tau_mm, tau_mm);
            let library = self.named.library.clone().changed(&|columns| change.apply_to(columns))?;
            Some((Evidence::with_visits(fit, tau_mm), library))
        };
        let (evidence, library) = self.ordered.get_or_init(|| self.order_mm.and_then(make)).as_ref()?;
        Some(Search::new(evidence.question(), library))
    }
}

/// The scatter of index positions, mm, for the tests and for the order of the candidates; `None` where it is known or of no account.
fn estimated(fit: &Fit, machine: &Machine, first: &Evidence, named: &Named, generics: &Generics) -> Option<Scatter> {
    let declared_mm = declared_tau_mm(machine, &fit.data.observations);
    let most_mm = MOST_TIMES * declared_mm;
    // revisited poses say it without any model
    if fit.noise.visit_source != VisitSource::Declared || most_mm <= 0.0 {
        return None;
    }
    let normals = fit.visit_normals();
    // groups of visits are the scatter itself
    let mut library = named.library.clone();
    library.append(generics.without("visit"));
    let changes: Vec<(f64, _)> = SUPPOSED
        .iter()
        .map(|part| {
            let tau_mm = part * most_mm;
            let change = normals.change(first.tau_mm, tau_mm);
            (tau_mm, move |columns: DMatrixViewMut<'_, f64>| change.apply_to(columns))
        })
        .collect();
    let base = first.base.transposed().transpose();
    let supposed = changes.par_iter().map(|(tau_mm, change)| {
        let (mut own, mut residual) = (base.clone(), DMatrix::from_columns(std::slice::from_ref(&first.residual)));
        change(own.as_view_mut());
        change(residual.as_view_mut());
        Supposed {
            tau: *tau_mm,
            residual: residual.column(0).into_owned(),
            base: Basis::new(&own),
            ln_det: normals.ln_det(*tau_mm)
                + own.tr_mul(&own).determinant().ln()
                + known_beforehand(*tau_mm, declared_mm),
            change: change as Change,
        }
    });
    Some(scatter_that_fits(supposed.collect(), &library, first.pure, MOST_AT_ONCE))
}

/// What is known of the scatter before a measurement, as a part of −2 ln L: a declared value is uncertain by 0.7 of itself. It is bound
/// more tightly than in the fit: an effect that is missing must not pass for scatter.
fn known_beforehand(tau_mm: f64, declared_mm: f64) -> f64 {
    2.0 * (tau_mm / declared_mm - 1.0).powi(2)
}

/// The evidence and the candidates with the declared scatter of visits, where revisits show far more than that and a few effects or shapes
/// explain all of it: what drifts or jumps between two visits of one pose looks like scatter of the visits, and would
/// widen the tests until they are blind to it. Scatter that nothing explains stays scatter.
fn calm<'c>(
    fit: &Fit,
    machine: &Machine,
    of: &dyn Fn(&Evidence) -> (Named<'c>, Generics),
) -> Option<(Evidence, (Named<'c>, Generics))> {
    const AT_MOST: usize = 4;
    let declared_mm = declared_tau_mm(machine, &fit.data.observations);
    // more than declared as estimated, not as its upper bound only: scatter as it is declared is no reason to look twice
    if fit.noise.visit_source != VisitSource::Revisits || declared_mm == 0.0 || fit.noise.tau_mm <= declared_mm {
        return None;
    }
    let evidence = Evidence::with_visits(fit, declared_mm);
    let (named, generics) = of(&evidence);
    // groups of visits are the scatter itself
    let mut library = named.library.clone();
    library.append(generics.without("visit"));
    let question = evidence.question();
    let (mut basis, mut residual) = (question.base.clone(), question.base.project(question.residual));
    let tested = Search::new(question, &library);
    for _ in 0..AT_MOST {
        let search = tested.with_larger_base(Question { residual: &residual, base: &basis, ..question });
        let passed = [search.leader(), search.leading_shape()].into_iter().flatten();
        let best = passed.min_by(|&a, &b| search.scores[a].ln_p.total_cmp(&search.scores[b].ln_p))?;
        if basis.extend(&search.columns(best), KEPT) == 0 {
            return None;
        }
        residual = basis.project(&residual);
        if lack_of_fit(&Question { residual: &residual, base: &basis, ..question }).p > 0.05 {
            return Some((evidence, (named, generics)));
        }
    }
    None
}
