//! Where the uncertainty of a parameter comes from, what it becomes with everything that the model leaves out, and which
//! combinations are weak.

use super::candidates::columns;
use super::normal::Touches;
use super::outcome::{Combination, Correlation, Covariance};
use super::{Fit, Knowledge};
use crate::diag::{Failure, Finding, Result};
use crate::machine::Machine;
use crate::model::catalogue::{Catalogue, Effect};
use crate::model::predict::Unknown;
use nalgebra::{DMatrix, DVector, Matrix3};
use std::collections::BTreeMap;

/// Correlations above this are worth a line.
const WORTH_NAMING: f64 = 0.8;

/// With more touches the columns of the whole catalogue would need gigabytes.
pub(super) const MOST_UNMODELLED: usize = 20_000;

/// Singular values of the combinations of results below this share of the largest are zero: projecting the set-ups out
/// of a Gram matrix leaves some 1e-5, and what leaves no trace is said elsewhere.
const NO_TRACE: f64 = 1e-4;

/// Pairs that are named at most.
const MOST_PAIRS: usize = 8;

/// Variance of each free unknown that goes back to the scatter of visits.
pub(super) fn visit_variance(fit: &Fit) -> DVector<f64> {
    let tau = fit.noise.tau_mm;
    let mut out = DVector::zeros(fit.free.len());
    if tau == 0.0 {
        return out;
    }
    let c = free_covariance(fit);
    fit.with_touches(tau, |touches: &Touches| {
        let (_, jacobian) = touches.unwhitened(&fit.free_theta());
        let (sigma, _) = touches.noise_mm();
        for visit in touches.visits_in(0..jacobian.nrows()) {
            let square = touches.normals_square(visit.clone());
            let m = touches.visit_inverse(&square);
            let mut sums = DMatrix::zeros(3, jacobian.ncols());
            for i in visit {
                sums.ger(fit.weight[i], &touches.normal_in_r(i), &jacobian.row(i).transpose(), 1.0);
            }
            // JᵀV⁻¹N of this visit, times C: how its displacement moves each unknown
            let by = (Matrix3::identity() - square * m) / (sigma * sigma);
            let moves = &c * sums.transpose() * by;
            for (i, row) in moves.row_iter().enumerate() {
                out[i] += tau * tau * row.norm_squared();
            }
        }
    });
    out
}

/// Covariance of the free unknowns.
#[must_use]
pub fn free_covariance(fit: &Fit) -> DMatrix<f64> {
    DMatrix::from_fn(fit.free.len(), fit.free.len(), |a, b| fit.covariance[(fit.free[a], fit.free[b])])
}

/// A source of uncertainty that the touches cannot show.
#[derive(Debug, Clone)]
pub(super) struct TypeB {
    pub name: String,
    pub unit: String,
    pub sigma: f64,
    /// What it makes of each free unknown: standard uncertainty, in the unknown's unit.
    pub makes: DVector<f64>,
}

/// Type B rows as the user states them: by name of a parameter of an effect that is not in the model.
pub(super) fn type_b(
    fit: &Fit,
    machine: &Machine,
    catalogue: &Catalogue,
    stated: &BTreeMap<String, f64>,
) -> Result<Vec<TypeB>> {
    let mut out = Vec::new();
    let mut findings = Vec::new();
    for (word, &sigma) in stated {
        if fit.model.unknowns.iter().any(|u| crate::symbols::same(&u.name, word)) {
            findings.push(
                Finding::error(
                    "model::type_b_in_model",
                    format!("{word} is in the model: it cannot be a type B row too"),
                )
                .help("give it a prior under [model.parameters], or take its effect out of the model"),
            );
            continue;
        }
        let owner = catalogue.iter().filter(|e| e.applies_to(machine) && !e.paper).find_map(|e| {
            let p = e.parameters.iter().position(|p| crate::symbols::same(&p.name, word))?;
            Some((e, p))
        });
        let Some((effect, which)) = owner else {
            findings.push(
                Finding::error("model::unknown_type_b", format!("no effect for this machine has a parameter {word:?}"))
                    .help("`axiscal effects` lists them, for instance size_X (block-size), dL (tool-length), expansion (ambient-scale)"),
            );
            continue;
        };
        if !(sigma.is_finite() && sigma > 0.0) {
            findings.push(
                Finding::error("model::type_b", format!("uncertainty of {word} is {sigma}"))
                    .help("write a positive number in the parameter's unit"),
            );
            continue;
        }
        let column = columns(machine, &[effect], &fit.data, &fit.data.observations, fit.model.reference, None)
            .values
            .column(which)
            .into_owned();
        let moved = sensitivity(fit, column);
        let p = &effect.parameters[which];
        out.push(TypeB { name: p.name.clone(), unit: p.unit.clone(), sigma, makes: moved.map(|m| (m * sigma).abs()) });
    }
    if findings.is_empty() { Ok(out) } else { Err(Failure(findings)) }
}

/// How much the free unknowns move per unit of something that displaces the touches by `column` (mm per unit).
fn sensitivity(fit: &Fit, column: DVector<f64>) -> DVector<f64> {
    let linear = fit.linear(fit.noise.tau_mm);
    let n = column.len();
    let mut whitened = DMatrix::from_column_slice(n, 1, column.as_slice());
    fit.with_touches(fit.noise.tau_mm, |t| t.whiten(&mut whitened));
    -(free_covariance(fit) * linear.jacobian.rows(0, n).tr_mul(&whitened.column(0)))
}

/// Effects that may act although the model does not hold them: all of the catalogue but those that share a parameter with
/// the model, the paper's sets, whole hypotheses and the set-up of blocks.
#[must_use]
pub fn unmodelled<'c>(fit: &Fit, machine: &Machine, catalogue: &'c Catalogue) -> Vec<&'c Effect> {
    unmodelled_by(&fit.model.unknowns, machine, catalogue).into_iter().filter(|e| !e.per_block).collect()
}

/// As [`unmodelled`], of a model with these unknowns; effects with parameters for each block are among them.
#[must_use]
pub fn unmodelled_by<'c>(unknowns: &[Unknown], machine: &Machine, catalogue: &'c Catalogue) -> Vec<&'c Effect> {
    let held = |e: &Effect| e.parameters.iter().any(|p| unknowns.iter().any(|u| u.effect == e.id || u.name == p.name));
    catalogue.iter().filter(|e| e.applies_to(machine) && !e.paper && !e.discrete && !held(e)).collect()
}

/// Standard uncertainty of each free unknown when everything that the model leaves out may act at its typical size,
/// and the ball's place scatters from one index to the next as far as that is known.
pub(super) fn with_unmodelled(fit: &Fit, machine: &Machine, catalogue: &Catalogue) -> DVector<f64> {
    let effects = unmodelled(fit, machine, catalogue);
    let all = columns(machine, &effects, &fit.data, &fit.data.observations, fit.model.reference, None);
    let tau_mm = fit.noise.visit_mm();
    let linear = fit.linear(tau_mm);
    let mut b = all.values;
    for (mut column, u) in b.column_iter_mut().zip(&all.unknowns) {
        column *= u.typical;
    }
    fit.with_touches(tau_mm, |t| t.whiten(&mut b));
    expected(&linear.jacobian, Some(&b), &fit.observability)
}

/// Standard uncertainty of each unknown of a whitened regression, in its unit, while effects that are not solved for act
/// at their typical size: `b` has their whitened columns times that size, for the first rows of the Jacobian. Not a
/// number where the normal equations cannot be solved.
#[must_use]
pub fn expected(jacobian: &DMatrix<f64>, b: Option<&DMatrix<f64>>, seen: &super::solve::Observability) -> DVector<f64> {
    let p = jacobian.ncols();
    let unknown = || DVector::from_element(p, f64::NAN);
    let mut gram = jacobian.tr_mul(jacobian);
    if let Some(b) = b {
        // a parameter of typical size 1 with a prior of 1: θ̂ moves by −C·Jᵀ(I + BBᵀ)⁻¹…, which is a noise of I + BBᵀ
        let cross = jacobian.rows(0, b.nrows()).tr_mul(b);
        let mut inner = b.tr_mul(b);
        inner.fill_diagonal_added();
        let Some(cholesky) = inner.cholesky() else { return unknown() };
        gram -= &cross * cholesky.solve(&cross.transpose());
    }
    let scaled = DMatrix::from_fn(p, p, |i, j| gram[(i, j)] / (seen.scale[i] * seen.scale[j]));
    let reduced = if seen.full() { scaled } else { seen.seen.tr_mul(&scaled) * &seen.seen };
    let Some(inverse) = reduced.cholesky().map(|c| c.inverse()) else { return unknown() };
    let full = if seen.full() { inverse } else { &seen.seen * inverse * seen.seen.transpose() };
    DVector::from_fn(p, |i, _| full[(i, i)].max(0.0).sqrt() / seen.scale[i])
}

trait AddToDiagonal {
    fn fill_diagonal_added(&mut self);
}

impl AddToDiagonal for DMatrix<f64> {
    /// Adds the identity.
    fn fill_diagonal_added(&mut self) {
        for i in 0..self.nrows() {
            self[(i, i)] += 1.0;
        }
    }
}

/// The pairs of results that are least told apart.
pub(super) fn correlations(fit: &Fit) -> Vec<Correlation> {
    let results: Vec<usize> =
        fit.free.iter().copied().filter(|&i| !fit.model.unknowns[i].nuisance && fit.covariance[(i, i)] > 0.0).collect();
    let mut out = Vec::new();
    for (k, &i) in results.iter().enumerate() {
        for &j in &results[..k] {
            let r = fit.covariance[(i, j)] / (fit.covariance[(i, i)] * fit.covariance[(j, j)]).sqrt();
            if r.abs() > WORTH_NAMING {
                out.push(Correlation {
                    a: fit.model.unknowns[j].name.clone(),
                    b: fit.model.unknowns[i].name.clone(),
                    r: (r * 1e4).round() / 1e4,
                });
            }
        }
    }
    out.sort_by(|x, y| y.r.abs().total_cmp(&x.r.abs()));
    out.truncate(MOST_PAIRS);
    out
}

/// Combinations of results that these touches determine no better than their typical sizes: columns scaled by typical
/// size, nuisance projected out, singular values below 1 (in units of the noise). Without those that leave no trace.
pub(super) fn weak(fit: &Fit) -> Vec<Combination> {
    let is_nuisance = |i: usize| fit.model.unknowns[i].nuisance;
    let physical: Vec<usize> = (0..fit.free.len()).filter(|&c| !is_nuisance(fit.free[c])).collect();
    let nuisance: Vec<usize> = (0..fit.free.len()).filter(|&c| is_nuisance(fit.free[c])).collect();
    if physical.is_empty() {
        return Vec::new();
    }
    let linear = fit.linear(fit.noise.tau_mm);
    let gram = linear.jacobian.tr_mul(&linear.jacobian);
    // every unknown in its typical size; the set-ups by the norms of their columns, which leaves their span as it is
    let scale = |c: usize| match is_nuisance(fit.free[c]) {
        true if gram[(c, c)] > 0.0 => gram[(c, c)].sqrt().recip(),
        true => 0.0,
        false => fit.model.unknowns[fit.free[c]].typical,
    };
    let part = |rows: &[usize], columns: &[usize]| {
        DMatrix::from_fn(rows.len(), columns.len(), |i, j| {
            gram[(rows[i], columns[j])] * scale(rows[i]) * scale(columns[j])
        })
    };
    let mut own = part(&physical, &physical);
    if !nuisance.is_empty() {
        // what the set-ups can follow is projected out
        let eigen = part(&nuisance, &nuisance).symmetric_eigen();
        let top = eigen.eigenvalues.max();
        let cross = eigen.eigenvectors.tr_mul(&part(&nuisance, &physical));
        for (k, value) in eigen.eigenvalues.iter().enumerate().filter(|(_, v)| **v > 1e-12 * top) {
            let row = cross.row(k);
            own -= row.transpose() * row / *value;
        }
    }
    let eigen = own.symmetric_eigen();
    let top = eigen.eigenvalues.max().max(0.0).sqrt();
    let mut out = Vec::new();
    for (k, value) in eigen.eigenvalues.iter().enumerate() {
        let s = value.max(0.0).sqrt();
        if s >= 1.0 || s <= NO_TRACE * top {
            continue;
        }
        let direction = eigen.eigenvectors.column(k);
        let weights = physical
            .iter()
            .zip(direction.iter())
            .filter(|(_, w)| w.abs() > 0.05)
            .map(|(&c, w)| (fit.model.unknowns[fit.free[c]].name.clone(), (w * 1e3).round() / 1e3))
            .collect();
        out.push(Combination {
            says: super::statement::weak(&weights, 1.0 / s),
            combination: weights,
            times_typical: (1e3 / s).round() / 1e3,
        });
    }
    out
}

/// Covariance of the results (no set-ups of blocks), type A.
#[must_use]
pub fn results_covariance(fit: &Fit) -> Covariance {
    let results: Vec<usize> = fit.free.iter().copied().filter(|&i| !fit.model.unknowns[i].nuisance).collect();
    Covariance {
        names: results.iter().map(|&i| fit.model.unknowns[i].name.clone()).collect(),
        matrix: results.iter().map(|&i| results.iter().map(|&j| fit.covariance[(i, j)]).collect()).collect(),
    }
}

/// Names and values of the priors that entered the fit.
pub(super) fn priors(fit: &Fit) -> Vec<super::outcome::PriorRow> {
    let mut out = Vec::new();
    for (i, known) in fit.knowledge.iter().enumerate() {
        if let Some(Knowledge::Prior { value, sigma }) = known {
            let u = &fit.model.unknowns[i];
            out.push(super::outcome::PriorRow {
                name: u.name.clone(),
                value: *value,
                sigma: *sigma,
                unit: u.unit.clone(),
            });
        }
    }
    out
}
