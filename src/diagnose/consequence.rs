//! By how much results could be wrong because of what is missing from the model.
//!
//! The unknowns of a model take up a part of what it lacks. For each explanation that passes its test the model is extended by
//! it, to first order, and the results move. Where nothing passes and the model still does not fit, the residuals of each index
//! visit are taken as one error of unknown cause (the cluster-robust covariance).

use super::evidence::Evidence;
use super::{Examination, Subject, Verdict};
use crate::diag::Result;
use crate::fit::outcome::Status;
use crate::fit::{Fit, Settings, identify_data};
use crate::search::multiplicity::FAMILY_LEVEL;
use crate::search::pattern_tests::Generics;
use crate::search::{Basis, KEPT};
use nalgebra::{DMatrix, DVector};
use serde::Serialize;
use std::collections::BTreeMap;

/// A size below so many of its standard deviations is left at 0: what chance makes has no consequence.
const SIGNIFICANT: f64 = 2.0;

/// Directions of the unknowns of which the touches see less than this share are not determined, and move nothing.
const SINGULAR: f64 = 1e-12;

/// By how much one result could be wrong.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Consequence {
    /// The result.
    pub parameter: String,
    /// Id of its effect.
    pub effect: String,
    /// Its unit.
    pub unit: String,
    /// How far it moves, in its unit.
    pub off: f64,
    /// What would move it: the id of an effect, what a pattern depends on, `not-used`, or `misfit`.
    pub because: String,
}

/// The largest move of each result, over all explanations.
pub(super) fn consequences(
    subject: Subject,
    seen: &Examination,
    generics: &Generics,
    (verdict, gathered): (&Verdict, bool),
) -> Result<Vec<Consequence>> {
    let fit = subject.fit;
    if !matches!(verdict, Verdict::MissingEffect(_) | Verdict::Unexplained(_)) {
        return Ok(Vec::new());
    }
    let moves = Moves::from_evidence(seen.evidence);
    let mut explained: Vec<(String, DVector<f64>)> = Vec::new();
    let passes = |candidate: usize| seen.search.scores[candidate].p_adjusted < FAMILY_LEVEL;
    for group in seen.groups.iter().filter(|g| g.members.iter().any(|m| passes(m.candidate))) {
        // effects that these touches cannot tell apart may move the results by different amounts
        for candidate in group.members.iter().map(|m| m.candidate) {
            let effect = seen.named.effects[candidate].id.clone();
            explained.push((effect, moves.with(&seen.search.columns(candidate))));
        }
    }
    for shape in seen.dependences.iter().filter(|d| d.p_adjusted < FAMILY_LEVEL) {
        let variants = &generics.library.candidates()[shape.candidate].variants;
        let variant = variants.iter().position(|v| v.shape == shape.scanned).unwrap_or(0);
        explained.push((shape.on.clone(), moves.with(&generics.library.columns(shape.candidate, variant))));
    }
    if gathered {
        explained.push(("not-used".to_owned(), with_all_touches(subject)?));
    }
    if explained.is_empty() {
        explained.push(("misfit".to_owned(), moves.by_visits()));
    }
    Ok(results(fit).filter_map(|(column, i)| worst(fit, (column, i), &explained)).collect())
}

/// Free unknowns that are results, with their column.
fn results(fit: &Fit) -> impl Iterator<Item = (usize, usize)> + '_ {
    let is_result =
        |i: usize| !fit.model.unknowns[i].nuisance && fit.outcome.parameters[i].status == Status::Identified;
    fit.free.iter().copied().enumerate().filter(move |(_, i)| is_result(*i))
}

fn worst(fit: &Fit, (column, i): (usize, usize), explained: &[(String, DVector<f64>)]) -> Option<Consequence> {
    let p = &fit.outcome.parameters[i];
    let moved = explained.iter().map(|(because, by)| (because, by[column].abs()));
    let (because, off) = moved.filter(|(_, off)| off.is_finite()).max_by(|a, b| a.1.total_cmp(&b.1))?;
    Some(Consequence {
        parameter: p.name.clone(),
        effect: p.effect.clone(),
        unit: p.unit.clone(),
        off,
        because: because.clone(),
    })
}

/// How the free unknowns move when the touches that were left out are used, too.
fn with_all_touches(subject: Subject) -> Result<DVector<f64>> {
    let fit = subject.fit;
    let settings =
        Settings { all_in: true, quick: true, reference: Some(fit.model.reference), ..subject.settings.clone() };
    let again = identify_data(subject.machine, subject.catalogue, fit.data.clone(), &settings)?;
    let now: BTreeMap<(&str, &str), f64> =
        again.outcome.parameters.iter().map(|p| ((p.effect.as_str(), p.name.as_str()), p.value)).collect();
    let moved = fit.free.iter().map(|&i| {
        let p = &fit.outcome.parameters[i];
        now.get(&(p.effect.as_str(), p.name.as_str())).map_or(0.0, |value| value - p.value)
    });
    Ok(DVector::from_iterator(fit.free.len(), moved))
}

/// The regression at its minimum.
struct Moves<'a> {
    base: &'a Basis,
    jacobian: &'a DMatrix<f64>,
    residual: &'a DVector<f64>,
    /// Index visit of each row of a touch.
    visits: &'a [usize],
    /// (JᵀJ)⁺, of the free unknowns in their units.
    covariance: DMatrix<f64>,
}

impl<'a> Moves<'a> {
    fn from_evidence(evidence: &'a Evidence) -> Self {
        Self::new(&evidence.base, &evidence.jacobian, &evidence.residual, &evidence.visits)
    }

    fn new(base: &'a Basis, jacobian: &'a DMatrix<f64>, residual: &'a DVector<f64>, visits: &'a [usize]) -> Self {
        let gram = jacobian.tr_mul(jacobian);
        let n = gram.nrows();
        let scale: Vec<f64> = (0..n).map(|i| if gram[(i, i)] > 0.0 { gram[(i, i)].sqrt() } else { 1.0 }).collect();
        let scaled = DMatrix::from_fn(n, n, |i, j| gram[(i, j)] / (scale[i] * scale[j])).symmetric_eigen();
        let largest = scaled.eigenvalues.iter().copied().fold(0.0, f64::max);
        let mut covariance = DMatrix::zeros(n, n);
        for (value, vector) in scaled.eigenvalues.iter().zip(scaled.eigenvectors.column_iter()) {
            if *value > SINGULAR * largest {
                covariance += vector * vector.transpose() / *value;
            }
        }
        let covariance = DMatrix::from_fn(n, n, |i, j| covariance[(i, j)] / (scale[i] * scale[j]));
        Self { base, jacobian, residual, visits, covariance }
    }

    /// With these whitened columns in the model: their sizes s = -(AᵀPA)⁺AᵀPr, the unknowns move by -(JᵀJ)⁺JᵀA s.
    fn with(&self, columns: &DMatrix<f64>) -> DVector<f64> {
        let left = self.base.project_columns(columns);
        let scale: Vec<f64> = columns.column_iter().map(|c| c.norm().max(f64::MIN_POSITIVE)).collect();
        let gram = left.tr_mul(&left);
        let n = gram.nrows();
        let eigen = DMatrix::from_fn(n, n, |i, j| gram[(i, j)] / (scale[i] * scale[j])).symmetric_eigen();
        let slope = left.tr_mul(self.residual);
        let slope = DVector::from_fn(n, |i, _| slope[i] / scale[i]);
        let mut sizes = DVector::zeros(n);
        for (value, vector) in eigen.eigenvalues.iter().zip(eigen.eigenvectors.column_iter()) {
            let along = vector.dot(&slope);
            if *value > KEPT && along.abs() > SIGNIFICANT * value.sqrt() {
                sizes -= vector * (along / *value);
            }
        }
        let sizes = DVector::from_fn(n, |i, _| sizes[i] / scale[i]);
        -(&self.covariance * self.jacobian.tr_mul(&(columns * sizes)))
    }

    /// Twice what errors that are common to an index visit add to the standard uncertainties.
    fn by_visits(&self) -> DVector<f64> {
        let p = self.covariance.nrows();
        let mut sums: BTreeMap<usize, DVector<f64>> = BTreeMap::new();
        for (row, visit) in self.visits.iter().enumerate() {
            let of_row = self.jacobian.row(row).transpose() * self.residual[row];
            *sums.entry(*visit).or_insert_with(|| DVector::zeros(p)) += of_row;
        }
        let few = sums.len() as f64 / (sums.len() as f64 - 1.0).max(1.0);
        let moved: Vec<DVector<f64>> = sums.values().map(|sum| &self.covariance * sum).collect();
        DVector::from_fn(p, |i, _| {
            let robust = few * moved.iter().map(|m| m[i] * m[i]).sum::<f64>();
            2.0 * (robust - self.covariance[(i, i)]).max(0.0).sqrt()
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A line through 40 points that lie on a parabola: the fit with the parabola in the model has another offset, and the move is
    /// the difference of the two.
    #[test]
    fn the_move_is_that_of_a_refit() {
        let x: Vec<f64> = (0..40).map(|i| f64::from(i) / 39.0).collect();
        let line = DMatrix::from_fn(40, 2, |i, j| if j == 0 { 1.0 } else { x[i] });
        let parabola = DMatrix::from_fn(40, 1, |i, _| x[i] * x[i]);
        let y = DVector::from_fn(40, |i, _| 3.0 + 2.0 * x[i] + 50.0 * x[i] * x[i]);
        let gram = line.tr_mul(&line).try_inverse().unwrap();
        let fitted = &gram * line.tr_mul(&y);
        let residual = &line * &fitted - &y;
        let base = Basis::new(&line);
        let moves = Moves::new(&base, &line, &residual, &[]);
        let moved = moves.with(&parabola);
        assert!((fitted[0] + moved[0] - 3.0).abs() < 1e-9 && (fitted[1] + moved[1] - 2.0).abs() < 1e-9, "{moved}");
        // what is in the model already moves nothing
        let inside = DMatrix::from_fn(40, 1, |i, _| 7.0 - x[i]);
        assert!(moves.with(&inside).amax() < 1e-12);
    }

    /// Residuals of 1 standard deviation that alternate within each visit are noise; those of a whole visit are not.
    #[test]
    fn what_a_visit_has_in_common_widens_the_results() {
        let ones = DMatrix::from_element(40, 1, 1.0);
        let visits: Vec<usize> = (0..40).map(|i| i / 4).collect();
        let noise = DVector::from_fn(40, |i, _| if i % 2 == 0 { 1.0 } else { -1.0 });
        let common = DVector::from_fn(40, |i, _| if (i / 4) % 2 == 0 { 1.0 } else { -1.0 });
        let base = Basis::new(&ones);
        let off = |residual: &DVector<f64>| Moves::new(&base, &ones, residual, &visits).by_visits()[0];
        assert_eq!(off(&noise), 0.0);
        // by hand: ten visits that are each off by 1: variance of the mean 10/9/10, less 1/40 of the noise
        assert!((off(&common) - 2.0 * (1.0_f64 / 9.0 - 1.0 / 40.0).sqrt()).abs() < 1e-12);
    }
}
