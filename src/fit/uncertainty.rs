//! Where the uncertainty of a parameter comes from, and what it becomes with everything that the model leaves out.

use super::candidates::{NoValue, columns_of, with_values};
use super::normal::Touches;
use super::outcome::Covariance;
use super::solve::Problem as _;
use super::span::span;
use super::{Fit, Knowledge};
use crate::machine::Machine;
use crate::model::catalogue::{Catalogue, Effect};
use crate::model::data::Data;
use crate::model::predict::{Model, Observation, Unknown};
use nalgebra::{DMatrix, DMatrixViewMut, DVector, Matrix3, MatrixXx3};
use rayon::prelude::*;
use std::ops::Range;

/// With more touches the whole catalogue would take longer than everything else together.
pub(super) const MOST_UNMODELLED: usize = 20_000;

/// Touches whose columns of the whole catalogue are held at once.
const UNMODELLED_AT_ONCE: usize = 128;

/// Variance of each free unknown that goes back to the scatter of visits as the residuals show it.
pub(super) fn visit_variance(fit: &Fit) -> DVector<f64> {
    let mut out = DVector::zeros(fit.free.len());
    let tau = fit.noise.visits_shown.map_or(fit.noise.tau_mm, |shown| shown.tau_mm);
    each_visit(fit, |moves| {
        for (i, row) in moves.row_iter().enumerate() {
            out[i] += tau * tau * row.norm_squared();
        }
    });
    out
}

/// What the covariance of the free unknowns lacks where visits scatter more than the weights suppose (less: it is negative).
fn visit_excess(fit: &Fit) -> Option<DMatrix<f64>> {
    let shown = fit.noise.visits_shown?.tau_mm;
    let more = shown * shown - fit.noise.tau_mm * fit.noise.tau_mm;
    let mut out = DMatrix::zeros(fit.free.len(), fit.free.len());
    each_visit(fit, |moves| out.gemm(more, moves, &moves.transpose(), 1.0));
    // as it is without rounding
    out.fill_upper_triangle_with_lower_triangle();
    Some(out)
}

/// How the displacement of each visit, along x, y, z, moves the free unknowns: their units per mm.
fn each_visit(fit: &Fit, mut of: impl FnMut(&MatrixXx3<f64>)) {
    let tau = fit.noise.tau_mm;
    if tau == 0.0 {
        return;
    }
    let c = free_covariance(fit);
    let theta = fit.free_theta();
    fit.with_touches(tau, |touches: &Touches| {
        let (sigma, _) = touches.noise_mm();
        for part in touches.parts() {
            let rows: Vec<usize> = part.clone().collect();
            let (_, jacobian) = touches.unwhitened_of(&theta, &rows);
            for visit in touches.visits_in(part.clone()) {
                let square = touches.normals_square(visit.clone());
                let m = touches.visit_inverse(&square);
                let mut sums = DMatrix::zeros(3, jacobian.ncols());
                for i in visit {
                    let row = jacobian.row(i - part.start).transpose();
                    sums.ger(fit.weight[i], &touches.normal_in_r(i), &row, 1.0);
                }
                // JᵀV⁻¹N of this visit, times C
                let by = (Matrix3::identity() - square * m) / (sigma * sigma);
                of(&(&c * sums.transpose() * by));
            }
        }
    });
}

/// Covariance of the free unknowns.
#[must_use]
pub fn free_covariance(fit: &Fit) -> DMatrix<f64> {
    DMatrix::from_fn(fit.free.len(), fit.free.len(), |a, b| fit.covariance[(fit.free[a], fit.free[b])])
}

/// How far each free unknown moves, in its unit, while what leaves no trace at the solution moves by its usual size. 0 for
/// what does not depend on it at all: combinations without a trace bend, and a value that has no part in them where everything
/// is nominal may have a small one where the machine stands, or come to it on the way.
pub(super) fn moves_with_unseen(fit: &Fit) -> DVector<f64> {
    let p = fit.free.len();
    if fit.seen.unseen.is_empty() {
        return DVector::zeros(p);
    }
    // a shape that leaves no trace has an effect that does not show: whatever its value is, it moves nothing by more than the
    // uncertainty of its sizes, which is counted already
    const OF_A_SHAPE: f64 = 1e-9;
    let typical = |c: usize| {
        let u = &fit.model.unknowns[fit.free[c]];
        u.typical * if u.shape { OF_A_SHAPE } else { 1.0 }
    };
    let each: Vec<DVector<f64>> = fit
        .seen
        .unseen
        .iter()
        .map(|v| DVector::from_fn(p, |c, _| v[c] / fit.seen.scale[c] / typical(c)).normalize())
        .collect();
    let basis = span(&DMatrix::from_columns(&each), 1e-9);
    let straight = DVector::from_fn(p, |c, _| basis.row(c).norm() * typical(c));
    let steps = basis.column_iter().map(|column| DVector::from_fn(p, |c, _| column[c] * typical(c)));
    // along a shape that is not seen nothing is known of the way beyond its room
    let moves_a_shape = |step: &DVector<f64>| {
        (0..p).any(|c| fit.model.unknowns[fit.free[c]].shape && step[c].abs() > 1e-9 * typical(c))
    };
    let steps: Vec<DVector<f64>> = steps.filter(|step| !moves_a_shape(step)).collect();
    let moves = straight + bends(fit, &steps);
    // less than this is the rounding of a value that stays where it is
    const LEAST: f64 = 1e-11;
    moves.map(|m| if m > LEAST { m } else { 0.0 })
}

/// How far the free unknowns must follow, each in its unit, for steps of this length that leave no trace at the solution to leave none
/// on the way either: the sum of the second-order terms of all steps.
fn bends(fit: &Fit, steps: &[DVector<f64>]) -> DVector<f64> {
    let p = fit.free.len();
    let mut out = DVector::zeros(p);
    if steps.is_empty() {
        return out;
    }
    let theta = fit.free_theta();
    fit.with_touches(fit.noise.tau_mm, |touches: &Touches| {
        let here = touches.normal(&theta, true);
        let s = &fit.seen.scale;
        let scaled = DMatrix::from_fn(p, p, |a, b| here.gram[(a, b)] / (s[a] * s[b]));
        let Some(factor) = (fit.seen.seen.tr_mul(&scaled) * &fit.seen.seen).cholesky() else { return };
        for step in steps {
            let gradient = |theta: &DVector<f64>| touches.normal(theta, false).gradient;
            // forwards and backwards: what is straight, and the noise of the touches in it, cancels
            let curved = (gradient(&(&theta + step)) + gradient(&(&theta - step))) / 2.0 - &here.gradient;
            let back = &fit.seen.seen * factor.solve(&fit.seen.seen.tr_mul(&curved.component_div(s)));
            out += back.component_div(s).abs();
        }
    });
    out
}

/// Effects that may act although a model with these unknowns does not hold them: all of the catalogue but those that share a
/// parameter with the model, the paper's sets and whole hypotheses.
#[must_use]
pub fn unmodelled_by<'c>(unknowns: &[Unknown], machine: &Machine, catalogue: &'c Catalogue) -> Vec<&'c Effect> {
    let held = |e: &Effect| e.parameters.iter().any(|p| unknowns.iter().any(|u| u.effect == e.id || u.name == p.name));
    catalogue.acting_on(machine).filter(|e| !held(e)).collect()
}

/// Effects outside of a model (not the block positions) that may act on its touches.
pub(super) struct LeftOut {
    model: Model,
    /// Effects that could not be counted.
    without_value: Vec<NoValue>,
}

impl LeftOut {
    /// What `model` leaves out.
    pub(super) fn new(model: &Model, machine: &Machine, catalogue: &Catalogue, data: &Data) -> Self {
        let mut effects = unmodelled_by(&model.unknowns, machine, catalogue);
        // an incident is a mistake that the diagnosis looks for, and no part of an uncertainty (GUM 3.4.7); its moment is unknown
        effects.retain(|e| !e.is_repeated() && !e.is_incident());
        let (effects, without_value) = with_values(effects, &data.observations);
        let model = Model::new(machine, &effects, &data.set_ups, model.reference);
        Self { model, without_value }
    }
}

/// Columns of a model's unknowns times their usual sizes, mm.
fn typical_columns(model: &Model, observations: &[Observation]) -> DMatrix<f64> {
    let mut columns = columns_of(model, observations);
    for (mut column, unknown) in columns.column_iter_mut().zip(&model.unknowns) {
        column *= unknown.typical;
    }
    columns
}

/// Standard uncertainty of each free unknown when everything that the model leaves out may act at its typical size, and the
/// ball's place scatters from one index to the next as far as that is known; and what is said of effects that could not be
/// counted.
pub(super) fn with_unmodelled(fit: &Fit, left_out: LeftOut) -> Unmodelled {
    fit.with_nominal_touches(|touches, theta| unmodelled_at(fit, touches, theta, left_out))
}

fn unmodelled_at(fit: &Fit, touches: &Touches, theta: &DVector<f64>, left_out: LeftOut) -> Unmodelled {
    let LeftOut { model, without_value } = left_out;
    let (p, q) = (fit.free.len(), model.n_unknowns());
    let mut sums = Sums { gram: DMatrix::zeros(p, p), cross: DMatrix::zeros(p, q), inner: DMatrix::zeros(q, q) };
    let jacobian = |rows: &[usize]| {
        let mut jacobian = touches.unwhitened_of(theta, rows).1;
        touches.whiten_of(rows, &mut jacobian);
        jacobian
    };
    // part by part, as many at once as there are processors: the columns of the whole catalogue at all touches would be many times
    // the touches themselves
    let columns = |part: &Range<usize>| {
        let rows: Vec<usize> = part.clone().collect();
        let mut b = typical_columns(&model, &fit.data.nominal[part.clone()]);
        touches.whiten_of(&rows, &mut b);
        (jacobian(&rows), b)
    };
    let parts: Vec<Range<usize>> =
        touches.parts().iter().flat_map(|p| touches.cut(p.clone(), UNMODELLED_AT_ONCE)).collect();
    for some in parts.chunks(rayon::current_num_threads()) {
        let made: Vec<_> = some.par_iter().map(columns).collect();
        // in their order, so that the sums are the same on any number of processors
        made.iter().for_each(|(jacobian, b)| sums.add(jacobian, b));
    }
    for (unknown, _, sigma) in &fit.priors {
        if let Ok(c) = fit.free.binary_search(unknown) {
            sums.gram[(c, c)] += sigma.powi(-2);
        }
    }
    let (taken, sigma) = rayon::join(|| sums.taken(&fit.seen), || sums.expected(&fit.seen));
    let mut holds: Vec<Vec<String>> = (0..p).map(|_| Vec::new()).collect();
    for (u, taken) in model.unknowns.iter().zip(taken).filter(|(u, _)| !u.shape) {
        if let Some(c) = taken.and_then(|taken| one_result(fit, &taken))
            && !holds[c].contains(&u.effect)
        {
            holds[c].push(u.effect.clone());
        }
    }
    Unmodelled { sigma, holds, left_out: without_value }
}

/// What effects outside of the model may do to a fit.
pub(super) struct Unmodelled {
    /// Standard uncertainty of each free unknown while all of them act at their typical size.
    pub sigma: DVector<f64>,
    /// For each free unknown: effects of which it takes all that they do.
    pub holds: Vec<Vec<String>>,
    /// What is said of effects that could not be counted.
    pub left_out: Vec<NoValue>,
}

/// The one result among the unknowns that take an effect, the set-ups of blocks aside. `taken`: what each takes, in noise.
fn one_result(fit: &Fit, taken: &DVector<f64>) -> Option<usize> {
    /// Smaller parts are rounding, or the bend of a block that stands askew.
    const PART: f64 = 0.02;
    let limit = PART * taken.amax();
    let result = |c: &usize| !fit.model.unknowns[fit.free[*c]].nuisance && taken[*c] > limit;
    let mut results = (0..taken.len()).filter(result);
    results.next().filter(|_| results.next().is_none())
}

/// Standard uncertainty of each unknown of a whitened regression, in its unit, while effects that are not solved for act
/// at their typical size: `b` has their whitened columns times that size, for the first rows of the Jacobian. Not a
/// number where the normal equations cannot be solved.
#[must_use]
pub fn expected(jacobian: &DMatrix<f64>, b: Option<&DMatrix<f64>>, seen: &super::solve::Observability) -> DVector<f64> {
    let none = DMatrix::zeros(jacobian.nrows(), 0);
    let b = b.unwrap_or(&none);
    let cross = jacobian.rows(0, b.nrows()).tr_mul(b);
    Sums { gram: jacobian.tr_mul(jacobian), cross, inner: b.tr_mul(b) }.expected(seen)
}

/// Products of a whitened Jacobian J and columns B of effects that may act at their typical size.
struct Sums {
    /// JᵀJ
    gram: DMatrix<f64>,
    /// JᵀB
    cross: DMatrix<f64>,
    /// BᵀB, its lower triangle
    inner: DMatrix<f64>,
}

impl Sums {
    fn add(&mut self, jacobian: &DMatrix<f64>, b: &DMatrix<f64>) {
        let Self { gram, cross, inner } = self;
        rayon::join(
            || {
                for (from, n) in few_rows(b.nrows()) {
                    let j = jacobian.rows(from, n);
                    let turned = j.transpose();
                    gram.gemm(1.0, &turned, &j, 1.0);
                    cross.gemm(1.0, &turned, &b.rows(from, n), 1.0);
                }
            },
            || add_lower_square(inner, b),
        );
    }

    /// Where all that each column of B does goes, by unknown and in units of the noise; none where the touches show a part of it
    /// that is more than the noise of one touch.
    fn taken(&self, seen: &super::solve::Observability) -> Vec<Option<DVector<f64>>> {
        /// Blocks that stand askew leave this share of what would be one number on straight ones.
        const SHARE: f64 = 1e-3;
        let (p, q) = self.cross.shape();
        let scaled = DMatrix::from_fn(p, p, |i, j| self.gram[(i, j)] / (seen.scale[i] * seen.scale[j]));
        let mut cross = DMatrix::from_fn(p, q, |i, j| self.cross[(i, j)] / seen.scale[i]);
        let factor = if seen.full() {
            scaled.cholesky()
        } else {
            cross = seen.seen.tr_mul(&cross);
            (seen.seen.tr_mul(&scaled) * &seen.seen).cholesky()
        };
        let Some(factor) = factor.filter(|f| f.l_dirty().solve_lower_triangular_mut(&mut cross)) else {
            return vec![None; q];
        };
        let taken = |j: usize| {
            // the square of L⁻¹·column is what the unknowns take
            let (whole, mut x) = (self.inner[(j, j)], cross.column(j).into_owned());
            let left = whole - x.norm_squared();
            if !(whole > 0.0 && left < 1.0 && left < SHARE * whole) {
                return None;
            }
            factor.l_dirty().ad_solve_lower_triangular_mut(&mut x);
            let x = if seen.full() { x } else { &seen.seen * x };
            Some(DVector::from_fn(p, |i, _| x[i].abs() * self.gram[(i, i)].sqrt() / seen.scale[i]))
        };
        (0..q).map(taken).collect()
    }

    fn expected(&self, seen: &super::solve::Observability) -> DVector<f64> {
        let p = self.gram.nrows();
        let unknown = || DVector::from_element(p, f64::NAN);
        let mut gram = self.gram.clone();
        if self.inner.nrows() > 0 {
            // a parameter of typical size 1 with a prior of 1: θ̂ moves by −C·Jᵀ(I + BBᵀ)⁻¹…, which is a noise of I + BBᵀ
            let mut inner = self.inner.clone();
            inner.fill_diagonal_added();
            let Some(cholesky) = inner.cholesky() else { return unknown() };
            let mut half = self.cross.transpose();
            if !cholesky.l_dirty().solve_lower_triangular_mut(&mut half) {
                return unknown();
            }
            gram.gemm(-1.0, &half.transpose(), &half, 1.0);
        }
        let scaled = DMatrix::from_fn(p, p, |i, j| gram[(i, j)] / (seen.scale[i] * seen.scale[j]));
        let reduced = if seen.full() { scaled } else { seen.seen.tr_mul(&scaled) * &seen.seen };
        let Some(inverse) = reduced.cholesky().map(|c| c.inverse()) else { return unknown() };
        let full = if seen.full() { inverse } else { &seen.seen * inverse * seen.seen.transpose() };
        DVector::from_fn(p, |i, _| full[(i, i)].max(0.0).sqrt() / seen.scale[i])
    }
}

/// First and number of a few of so many rows, all of them in turn: the memory that a product needs besides stays small, and is that of
/// the one before.
fn few_rows(rows: usize) -> impl Iterator<Item = (usize, usize)> {
    const FEW: usize = 64;
    (0..rows).step_by(FEW).map(move |from| (from, FEW.min(rows - from)))
}

/// Adds BᵀB to the lower triangle of a matrix; what stands above it means nothing.
fn add_lower_square(into: &mut DMatrix<f64>, b: &DMatrix<f64>) {
    /// Columns of the product that are made together.
    const BLOCK: usize = 64;
    let q = b.ncols();
    into.as_mut_slice().par_chunks_mut((q * BLOCK).max(1)).enumerate().for_each(|(k, part)| {
        let (from, n) = (k * BLOCK, part.len() / q);
        let mut part = DMatrixViewMut::from_slice(part, q, n);
        let mut part = part.rows_mut(from, q - from);
        for (row, rows) in few_rows(b.nrows()) {
            let turned = b.view((row, from), (rows, q - from)).transpose();
            part.gemm(1.0, &turned, &b.view((row, from), (rows, n)), 1.0);
        }
    });
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

/// Covariance of the results (no set-ups of blocks) from the noise and the priors: type A.
#[must_use]
pub fn results_covariance(fit: &Fit) -> Covariance {
    covariance_with(fit, |_, _| 0.0)
}

/// Covariance of the results with the type B rows: the roots of its diagonal are the standard uncertainties of what does not
/// follow a combination that leaves no trace.
#[must_use]
pub fn full_covariance(fit: &Fit) -> Covariance {
    covariance_with(fit, |i, j| fit.type_b.iter().map(|makes| makes[i] * makes[j]).sum())
}

/// The type A covariance of the results with something added, by places among the free unknowns.
fn covariance_with(fit: &Fit, more: impl Fn(usize, usize) -> f64) -> Covariance {
    let results: Vec<(usize, usize)> =
        fit.free.iter().copied().enumerate().filter(|(_, i)| !fit.model.unknowns[*i].is_set_up()).collect();
    let excess = visit_excess(fit);
    let of_visits = |a: usize, b: usize| excess.as_ref().map_or(0.0, |e| e[(a, b)]);
    let row = |&(a, i): &(usize, usize)| -> Vec<f64> {
        results.iter().map(|&(b, j)| fit.covariance[(i, j)] + of_visits(a, b) + more(a, b)).collect()
    };
    Covariance {
        names: results.iter().map(|(_, i)| fit.model.unknowns[*i].name.clone()).collect(),
        matrix: results.iter().map(row).collect(),
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
