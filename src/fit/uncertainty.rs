//! Where the uncertainty of a parameter comes from, what it becomes with everything that the model leaves out, and which
//! combinations are weak.

use super::candidates::{columns, columns_of, with_values, without_value};
use super::normal::Touches;
use super::outcome::{Combination, Correlation, Covariance};
use super::solve::{Problem as _, RANK_TOLERANCE};
use super::{Fit, Knowledge};
use crate::diag::{Failure, Finding, Result};
use crate::machine::Machine;
use crate::model::catalogue::{Catalogue, Effect};
use crate::model::formula::slot;
use crate::model::predict::{Model, Observation, Unknown};
use nalgebra::{DMatrix, DVector, DVectorView, Matrix3};
use std::collections::BTreeMap;

/// Correlations above this are worth a line.
const WORTH_NAMING: f64 = 0.8;

/// With more touches the whole catalogue would take longer than everything else together.
pub(super) const MOST_UNMODELLED: usize = 20_000;

/// Touches whose columns of the whole catalogue are held at once.
const UNMODELLED_AT_ONCE: usize = 256;

/// Projecting the set-ups out of a Gram matrix leaves some 1e-5 of the largest singular value: below this share of it the
/// rows themselves must tell.
const GRAM_SEES: f64 = 1e-4;

/// The same against the columns before the projection: their Gram matrix is good to some 1e-15.
const GRAM_SEES_OF_RAW: f64 = 1e-6;

/// What is left of a column that is taken out whole, as a share of it: gauges are said elsewhere.
const ROUNDING: f64 = 1e-12;

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
                // JᵀV⁻¹N of this visit, times C: how its displacement moves each unknown
                let by = (Matrix3::identity() - square * m) / (sigma * sigma);
                let moves = &c * sums.transpose() * by;
                for (i, row) in moves.row_iter().enumerate() {
                    out[i] += tau * tau * row.norm_squared();
                }
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

/// How far each free unknown moves, in its unit, while what leaves no trace at the solution moves by its usual size. 0 for
/// what does not depend on it at all: combinations without a trace bend, and a value that has no part in them where everything
/// is nominal may have a small one where the machine stands.
pub(super) fn moves_with_unseen(fit: &Fit) -> DVector<f64> {
    let p = fit.free.len();
    if fit.seen.unseen.is_empty() {
        return DVector::zeros(p);
    }
    let rooms = rooms_of_shapes(fit);
    let typical = |c: usize| rooms.get(&c).copied().unwrap_or(fit.model.unknowns[fit.free[c]].typical);
    let each: Vec<DVector<f64>> = fit
        .seen
        .unseen
        .iter()
        .map(|v| DVector::from_fn(p, |c, _| v[c] / fit.seen.scale[c] / typical(c)).normalize())
        .collect();
    let svd = DMatrix::from_columns(&each).svd(true, false);
    let kept: Vec<usize> = (0..each.len()).filter(|&k| svd.singular_values[k] > 1e-9).collect();
    let Some(basis) = svd.u.map(|u| u.select_columns(&kept)) else { return DVector::zeros(p) };
    // less than this is the rounding of a value that stays where it is
    const LEAST: f64 = 1e-11;
    DVector::from_fn(p, |c, _| Some(basis.row(c).norm() * typical(c)).filter(|m| *m > LEAST).unwrap_or(0.0))
}

/// How far a shape parameter that leaves no trace may go, by its place among the free unknowns: until what it does has changed by all
/// that its effect does. Where the touches do not show the effect either, whatever pitch it has moves nothing by more than the
/// uncertainty of its size, which is counted already.
fn rooms_of_shapes(fit: &Fit) -> BTreeMap<usize, f64> {
    /// Standard uncertainties from which a size is shown.
    const SHOWN: f64 = 3.0;
    /// Share of its usual size that a shape of nothing may go.
    const NONE: f64 = 1e-9;
    let unknown = |c: usize| &fit.model.unknowns[fit.free[c]];
    let is_unseen = |c: &usize| fit.seen.unseen.iter().any(|v| v[*c].abs() > 1e-9);
    let shapes: Vec<usize> = (0..fit.free.len()).filter(|&c| unknown(c).shape).filter(is_unseen).collect();
    if shapes.is_empty() {
        return BTreeMap::new();
    }
    let theta = fit.free_theta();
    let gram = fit.with_touches(fit.noise.tau_mm, |t| t.normal(&theta, true).gram);
    let room = |c: usize| {
        let own = |k: &usize| unknown(*k).effect == unknown(c).effect && !unknown(*k).shape;
        let sizes: Vec<usize> = (0..fit.free.len()).filter(own).collect();
        let sigma = |k: usize| fit.covariance[(fit.free[k], fit.free[k])].max(0.0).sqrt();
        let (slope, typical) = (gram[(c, c)], unknown(c).typical);
        // all that it does, in units of the noise
        let product = |a: usize, b: usize| theta[a] * theta[b] * gram[(a, b)];
        let square: f64 = sizes.iter().map(|&a| sizes.iter().map(|&b| product(a, b)).sum::<f64>()).sum();
        let small = |k: &usize| theta[*k].abs() < SHOWN * sigma(*k);
        // the shape was chosen as the best of many: chance makes more of it than of a size
        let by_chance = SHOWN * SHOWN * (sizes.len() + 1) as f64;
        if slope <= 0.0 || square < by_chance || sizes.iter().all(small) {
            return (c, NONE * typical);
        }
        (c, (square.max(0.0) / slope).sqrt().clamp(NONE * typical, typical))
    };
    shapes.into_iter().map(room).collect()
}

/// A source of uncertainty that the touches cannot show.
#[derive(Debug, Clone)]
pub(super) struct TypeB {
    pub name: String,
    pub unit: String,
    pub sigma: f64,
    /// What one standard uncertainty of it makes of each free unknown, with its sign, in the unknown's unit.
    pub makes: DVector<f64>,
    /// What a reader must not miss.
    pub warning: Option<String>,
}

/// The type B row of the thermometer, K: what the temperature's own uncertainty makes of all that goes with the temperature.
const THERMOMETER: &str = "temperature";

impl TypeB {
    fn new(name: &str, unit: &str, sigma: f64, moved: &DVector<f64>, per_kelvin: bool) -> Self {
        let warning = if per_kelvin {
            Some(format!(
                "type B: {name} goes with the temperature, and no touch carries one: it is counted as if everything had been \
                 touched 1 K off 20 °C; multiply its uncertainty by the kelvins that the room may be off, or log the temperature"
            ))
        } else if moved.amax() == 0.0 {
            Some(format!(
                "type B: {name} makes nothing of these touches, and adds nothing to any uncertainty; where it goes with the \
                 temperature they are at 20 °C: state the doubt of the thermometer, {THERMOMETER} = … (K)"
            ))
        } else {
            None
        };
        Self { name: name.to_owned(), unit: unit.to_owned(), sigma, makes: moved * sigma, warning }
    }
}

/// The touches with everything warmer by so many kelvins.
fn warmer(fit: &Fit, kelvins: f64) -> Vec<Observation> {
    let at = |o: &Observation| {
        let mut warm = o.clone();
        warm.state[slot::TEMPERATURE] += kelvins;
        warm
    };
    fit.data.observations.iter().map(at).collect()
}

/// What one kelvin more, everywhere and unknown, makes of the free unknowns: by the effects that go with the temperature, each at
/// the size that the model has for it, or at its typical one.
fn per_kelvin_of_all(fit: &Fit, machine: &Machine, catalogue: &Catalogue) -> DVector<f64> {
    let mut column = DVector::zeros(fit.data.observations.len());
    let (cold, warm) = (warmer(fit, 0.0), warmer(fit, 1.0));
    let with_t = |e: &&Effect| e.terms.iter().any(|t| t.formula.variables().contains(&"T"));
    let effects = catalogue.iter().filter(|e| e.applies_to(machine) && !e.paper && !e.discrete && !e.per_block);
    for effect in effects.filter(with_t).filter(|e| without_value(e, &warm).is_empty()) {
        let at = |o: &[Observation]| columns(machine, &[effect], &fit.data, o, fit.model.reference, None);
        let (before, after) = (at(&cold), at(&warm));
        for (c, u) in before.unknowns.iter().enumerate().filter(|(_, u)| !u.shape) {
            let known = fit.model.unknowns.iter().position(|own| own.name == u.name);
            let size = known.map_or(u.typical, |i| fit.theta[i]);
            column += (after.values.column(c) - before.values.column(c)) * size;
        }
    }
    sensitivity(fit, &column)
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
        let is_size = sigma.is_finite() && sigma > 0.0;
        let owner = catalogue.iter().filter(|e| e.applies_to(machine) && !e.paper).find_map(|e| {
            let p = e.parameters.iter().position(|p| crate::symbols::same(&p.name, word))?;
            Some((e, p))
        });
        let is_thermometer = owner.is_none() && word == THERMOMETER;
        if is_thermometer && is_size {
            out.push(TypeB::new(word, "K", sigma, &per_kelvin_of_all(fit, machine, catalogue), false));
            continue;
        }
        if (owner.is_some() || is_thermometer) && !is_size {
            findings.push(
                Finding::error("model::type_b", format!("uncertainty of {word} is {sigma}"))
                    .help("write a positive number in the parameter's unit"),
            );
            continue;
        }
        let Some((effect, which)) = owner else {
            findings.push(
                Finding::error("model::unknown_type_b", format!("no effect for this machine has a parameter {word:?}"))
                    .help("`axiscal effects` lists them, for instance size_X (block-size), dL (tool-length), expansion (ambient-scale); and temperature, K, for the thermometer"),
            );
            continue;
        };
        if let Some(bad) = without_value(effect, &fit.data.observations).first() {
            findings.push(
                Finding::error("model::no_value", format!("{word} cannot be a type B row: {}", bad.says()))
                    .help("write the formula so that it holds at every touch"),
            );
            continue;
        }
        let with_t = effect.terms.iter().any(|t| t.parameter == which && t.formula.variables().contains(&"T"));
        let per_kelvin = with_t && fit.data.observations.iter().all(|o| !o.has_temperature);
        let observations = warmer(fit, if per_kelvin { 1.0 } else { 0.0 });
        let column = columns(machine, &[effect], &fit.data, &observations, fit.model.reference, None)
            .values
            .column(which)
            .into_owned();
        let moved = sensitivity(fit, &column);
        let p = &effect.parameters[which];
        out.push(TypeB::new(&p.name, &p.unit, sigma, &moved, per_kelvin));
    }
    if findings.is_empty() { Ok(out) } else { Err(Failure(findings)) }
}

/// How much the free unknowns move per unit of something that displaces the touches by `column` (mm per unit).
fn sensitivity(fit: &Fit, column: &DVector<f64>) -> DVector<f64> {
    let theta = fit.free_theta();
    let mut sum = DVector::zeros(fit.free.len());
    fit.with_touches(fit.noise.tau_mm, |touches| {
        for part in touches.parts() {
            let rows: Vec<usize> = part.clone().collect();
            let mut jacobian = touches.unwhitened_of(&theta, &rows).1;
            touches.whiten_of(&rows, &mut jacobian);
            let mut moved = DMatrix::from_column_slice(rows.len(), 1, &column.as_slice()[part.clone()]);
            touches.whiten_of(&rows, &mut moved);
            sum += jacobian.tr_mul(&moved.column(0));
        }
    });
    -(free_covariance(fit) * sum)
}

/// Effects that may act although a model with these unknowns does not hold them: all of the catalogue but those that share a
/// parameter with the model, the paper's sets and whole hypotheses.
#[must_use]
pub fn unmodelled_by<'c>(unknowns: &[Unknown], machine: &Machine, catalogue: &'c Catalogue) -> Vec<&'c Effect> {
    let held = |e: &Effect| e.parameters.iter().any(|p| unknowns.iter().any(|u| u.effect == e.id || u.name == p.name));
    catalogue.iter().filter(|e| e.applies_to(machine) && !e.paper && !e.discrete && !held(e)).collect()
}

/// Standard uncertainty of each free unknown when everything that the model leaves out may act at its typical size (not the
/// set-up of blocks), and the ball's place scatters from one index to the next as far as that is known; and what is said of
/// effects that could not be counted.
pub(super) fn with_unmodelled(fit: &Fit, machine: &Machine, catalogue: &Catalogue) -> (DVector<f64>, Vec<String>) {
    let mut effects = unmodelled_by(&fit.model.unknowns, machine, catalogue);
    effects.retain(|e| !e.per_block);
    let (effects, left_out) = with_values(effects, &fit.data.observations);
    let others = Model::new(machine, &effects, &fit.data.set_ups, fit.model.reference);
    let typical: Vec<f64> = others.unknowns.iter().map(|u| u.typical).collect();
    let theta = fit.free_theta();
    let (p, q) = (fit.free.len(), typical.len());
    let mut sums = Sums { gram: DMatrix::zeros(p, p), cross: DMatrix::zeros(p, q), inner: DMatrix::zeros(q, q) };
    // part by part: the columns of the whole catalogue at all touches would be many times the touches themselves
    fit.with_touches(fit.noise.tau_mm, |touches| {
        for part in touches.parts().iter().flat_map(|p| touches.cut(p.clone(), UNMODELLED_AT_ONCE)) {
            let rows: Vec<usize> = part.clone().collect();
            let mut jacobian = touches.unwhitened_of(&theta, &rows).1;
            touches.whiten_of(&rows, &mut jacobian);
            let mut b = columns_of(&others, &fit.data.observations[part]);
            for (mut column, size) in b.column_iter_mut().zip(&typical) {
                column *= *size;
            }
            touches.whiten_of(&rows, &mut b);
            sums.add(&jacobian, &b);
        }
    });
    for (unknown, _, sigma) in &fit.priors {
        if let Ok(c) = fit.free.binary_search(unknown) {
            sums.gram[(c, c)] += sigma.powi(-2);
        }
    }
    (sums.expected(&fit.seen), left_out)
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
    /// BᵀB
    inner: DMatrix<f64>,
}

impl Sums {
    fn add(&mut self, jacobian: &DMatrix<f64>, b: &DMatrix<f64>) {
        let (turned, b_turned) = (jacobian.transpose(), b.transpose());
        self.gram.gemm(1.0, &turned, jacobian, 1.0);
        self.cross.gemm(1.0, &turned, b, 1.0);
        self.inner.gemm(1.0, &b_turned, b, 1.0);
    }

    fn expected(mut self, seen: &super::solve::Observability) -> DVector<f64> {
        let p = self.gram.nrows();
        let unknown = || DVector::from_element(p, f64::NAN);
        if self.inner.nrows() > 0 {
            // a parameter of typical size 1 with a prior of 1: θ̂ moves by −C·Jᵀ(I + BBᵀ)⁻¹…, which is a noise of I + BBᵀ
            self.inner.fill_diagonal_added();
            let Some(cholesky) = self.inner.cholesky() else { return unknown() };
            self.gram -= &self.cross * cholesky.solve(&self.cross.transpose());
        }
        let scaled = DMatrix::from_fn(p, p, |i, j| self.gram[(i, j)] / (seen.scale[i] * seen.scale[j]));
        let reduced = if seen.full() { scaled } else { seen.seen.tr_mul(&scaled) * &seen.seen };
        let Some(inverse) = reduced.cholesky().map(|c| c.inverse()) else { return unknown() };
        let full = if seen.full() { inverse } else { &seen.seen * inverse * seen.seen.transpose() };
        DVector::from_fn(p, |i, _| full[(i, i)].max(0.0).sqrt() / seen.scale[i])
    }
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

/// The pairs of results that are least told apart, among those that have a value.
pub(super) fn correlations(fit: &Fit, has_value: impl Fn(usize) -> bool) -> Vec<Correlation> {
    let is_result = |i: &usize| !fit.model.unknowns[*i].nuisance && fit.covariance[(*i, *i)] > 0.0 && has_value(*i);
    let results: Vec<usize> = fit.free.iter().copied().filter(is_result).collect();
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
/// size, nuisance projected out, singular values below 1 (in units of the noise). Without those that leave no trace, which
/// are said elsewhere.
pub(super) fn weak(fit: &Fit, effects: &[&Effect]) -> Vec<Combination> {
    let is_nuisance = |c: &usize| fit.model.unknowns[fit.free[*c]].nuisance;
    let (nuisance, physical): (Vec<usize>, Vec<usize>) = (0..fit.free.len()).partition(is_nuisance);
    if physical.is_empty() {
        return Vec::new();
    }
    let typical = |c: usize| fit.model.unknowns[fit.free[c]].typical;
    let gram = fit.with_touches(fit.noise.tau_mm, |t| t.normal(&fit.free_theta(), true).gram);
    // what the columns are before anything is taken out of them: all that is left may be rounding
    let raw: Vec<f64> = physical.iter().map(|&c| gram[(c, c)].max(0.0).sqrt() * typical(c)).collect();
    let size =
        |direction: DVectorView<f64>| direction.iter().zip(&raw).map(|(w, r)| (w * r).powi(2)).sum::<f64>().sqrt();
    let precise = |(values, directions): &Spectrum| {
        values.iter().zip(directions.column_iter()).all(|(s, d)| *s > GRAM_SEES_OF_RAW * size(d))
    };
    let quick = if fit.seen.full() { from_gram(&gram, &physical, &nuisance, typical) } else { None };
    let (values, directions) = quick.filter(precise).unwrap_or_else(|| {
        let jacobian = only_seen(fit.linear(fit.noise.tau_mm).jacobian, &fit.seen);
        from_rows(&jacobian, &physical, &nuisance, typical)
    });
    let mut out = Vec::new();
    for (s, direction) in values.iter().zip(directions.column_iter()) {
        if *s >= 1.0 || *s <= ROUNDING * size(direction) {
            continue;
        }
        let unknown = |c: usize| &fit.model.unknowns[fit.free[c]];
        let all = physical.iter().zip(direction.iter()).filter(|(_, w)| w.abs() > 0.05);
        let weights: Vec<(&Unknown, f64)> = all.map(|(&c, w)| (unknown(c), (w * 1e3).round() / 1e3)).collect();
        out.push(Combination {
            says: super::statement::weak(&weights, effects, 1.0 / s),
            combination: weights.iter().map(|(u, w)| (u.name.clone(), *w)).collect(),
            times_typical: (1e3 / s).round() / 1e3,
        });
    }
    out
}

/// A Jacobian without what it shows of combinations that count as leaving no trace.
fn only_seen(mut jacobian: DMatrix<f64>, seen: &super::solve::Observability) -> DMatrix<f64> {
    if seen.full() {
        return jacobian;
    }
    for (mut column, s) in jacobian.column_iter_mut().zip(seen.scale.iter()) {
        column /= *s;
    }
    let mut left = (jacobian * &seen.seen) * seen.seen.transpose();
    for (mut column, s) in left.column_iter_mut().zip(seen.scale.iter()) {
        column *= *s;
    }
    left
}

/// Singular values and directions of the physical columns, each per typical size, with the nuisance projected out.
type Spectrum = (DVector<f64>, DMatrix<f64>);

/// From the Gram matrix: quick, and good to some 1e-5 of the largest; `None` where one is below that.
fn from_gram(
    gram: &DMatrix<f64>,
    physical: &[usize],
    nuisance: &[usize],
    typical: impl Fn(usize) -> f64,
) -> Option<Spectrum> {
    // the set-ups by the norms of their columns, which leaves their span as it is
    let norm = |c: usize| if gram[(c, c)] > 0.0 { gram[(c, c)].sqrt().recip() } else { 0.0 };
    let part = |rows: &[(usize, f64)], columns: &[(usize, f64)]| {
        DMatrix::from_fn(rows.len(), columns.len(), |i, j| gram[(rows[i].0, columns[j].0)] * rows[i].1 * columns[j].1)
    };
    let physical: Vec<(usize, f64)> = physical.iter().map(|&c| (c, typical(c))).collect();
    let nuisance: Vec<(usize, f64)> = nuisance.iter().map(|&c| (c, norm(c))).collect();
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
    let values = eigen.eigenvalues.map(|v| v.max(0.0).sqrt());
    (values.min() > GRAM_SEES * values.max()).then_some((values, eigen.eigenvectors))
}

/// From the rows themselves: good to rounding.
fn from_rows(
    jacobian: &DMatrix<f64>,
    physical: &[usize],
    nuisance: &[usize],
    typical: impl Fn(usize) -> f64,
) -> Spectrum {
    let mut own = jacobian.select_columns(physical);
    for (mut column, &c) in own.column_iter_mut().zip(physical) {
        column *= typical(c);
    }
    let mut set_ups = jacobian.select_columns(nuisance);
    for mut column in set_ups.column_iter_mut() {
        let norm = column.norm();
        column /= if norm > 0.0 { norm } else { 1.0 };
    }
    if !nuisance.is_empty() {
        let svd = set_ups.svd(true, false);
        let top = svd.singular_values.max();
        let kept: Vec<usize> =
            (0..svd.singular_values.len()).filter(|&k| svd.singular_values[k] > RANK_TOLERANCE * top).collect();
        let basis = svd.u.map_or_else(|| DMatrix::zeros(own.nrows(), 0), |u| u.select_columns(&kept));
        // once more: what is left is far smaller than what was there
        for _ in 0..2 {
            own -= &basis * basis.tr_mul(&own);
        }
    }
    let p = own.ncols();
    let mut square = DMatrix::zeros(p, p);
    let r = if own.nrows() > p { own.qr().r() } else { own };
    square.rows_mut(0, r.nrows()).copy_from(&r);
    let svd = square.svd(false, true);
    let directions = svd.v_t.map_or_else(|| DMatrix::identity(p, p), |v| v.transpose());
    (svd.singular_values, directions)
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
        fit.free.iter().copied().enumerate().filter(|(_, i)| !fit.model.unknowns[*i].nuisance).collect();
    let row = |&(a, i): &(usize, usize)| -> Vec<f64> {
        results.iter().map(|&(b, j)| fit.covariance[(i, j)] + more(a, b)).collect()
    };
    Covariance {
        names: results.iter().map(|(_, i)| fit.model.unknowns[*i].name.clone()).collect(),
        matrix: results.iter().map(row).collect(),
    }
}

/// A value that the user states and that the touches contradict.
#[derive(Debug, Clone)]
pub(super) struct Contradiction {
    /// In words.
    pub says: String,
    /// By how much χ² would fall without it.
    pub chi2: f64,
}

/// Further apart than this many standard deviations, what is stated and what the touches say contradict each other; the
/// chance of that is 6e-5 where both are right.
const CONTRADICTS: f64 = 4.0;

/// Priors and held values that the touches contradict: each compared with the estimate without it (a rank-one downdate), at
/// the scatter that the touches would then have.
pub(super) fn contradictions(fit: &Fit) -> Vec<Contradiction> {
    let scale2 = |falls: f64| ((fit.chi2 - falls).max(0.0) / fit.dof.saturating_sub(1).max(1) as f64).max(1.0);
    let mut out = Vec::new();
    for &(i, stated, sigma) in &fit.priors {
        let (variance, prior) = (fit.covariance[(i, i)], sigma * sigma);
        let rest = 1.0 / variance - 1.0 / prior;
        // the touches say next to nothing of it
        if !rest.is_finite() || rest <= 1e-9 / prior {
            continue;
        }
        let alone = (fit.theta[i] / variance - stated / prior) / rest;
        let falls = (alone - stated).powi(2) / (1.0 / rest + prior);
        let own = (scale2(falls) / rest).sqrt();
        let apart = (alone - stated).abs() / own.hypot(sigma);
        if apart > CONTRADICTS {
            let u = &fit.model.unknowns[i];
            out.push(Contradiction {
                says: format!(
                    "the touches contradict the prior of {}: it says {stated} ± {sigma} {}, and without it they say {} ± {} ({apart:.0} standard deviations apart); check it, or give it a larger sigma",
                    u.name,
                    u.unit,
                    with_digits(alone, own),
                    with_digits(own, own)
                ),
                chi2: falls,
            });
        }
    }
    out.extend(held_contradictions(fit, scale2));
    out
}

/// The same for held values: the score test of each, and what the touches would make of it.
fn held_contradictions(fit: &Fit, scale2: impl Fn(f64) -> f64) -> Vec<Contradiction> {
    let held: Vec<usize> = (0..fit.theta.len())
        .filter(|&i| matches!(fit.knowledge[i], Some(Knowledge::Fixed(_))) && !fit.model.unknowns[i].shape)
        .collect();
    if held.is_empty() {
        return Vec::new();
    }
    let batch = fit.model.prepare(&fit.data.observations);
    let noise = (fit.noise.sigma_mm, fit.noise.tau_mm);
    let all: Vec<usize> = (0..fit.theta.len()).collect();
    let mut touches = Touches::new(&batch, &fit.data.visits, fit.theta.clone(), &all, &fit.priors, noise);
    touches.set_weights(fit.weight.clone());
    let (residual, jacobian) = touches.dense(&DVector::from_column_slice(&fit.theta));
    let free = jacobian.select_columns(&fit.free);
    let covariance = free_covariance(fit);
    let mut out = Vec::new();
    for i in held {
        let column = jacobian.column(i).into_owned();
        let own = &column - &free * (&covariance * free.tr_mul(&column));
        let information = own.norm_squared();
        // the other parameters follow it: nothing tells it from them
        if information.is_nan() || information <= 1e-9 * column.norm_squared() || information == 0.0 {
            continue;
        }
        let by = -own.dot(&residual) / information;
        let falls = by * by * information;
        let sigma = (scale2(falls) / information).sqrt();
        let apart = by.abs() / sigma;
        if apart > CONTRADICTS {
            let (u, stated) = (&fit.model.unknowns[i], fit.theta[i]);
            out.push(Contradiction {
                says: format!(
                    "the touches contradict the held value of {}: it is held at {stated} {}, and if it were free they would say {} ± {} ({apart:.0} standard deviations away); check it, or let it free",
                    u.name,
                    u.unit,
                    with_digits(stated + by, sigma),
                    with_digits(sigma, sigma)
                ),
                chi2: falls,
            });
        }
    }
    out
}

/// A value with two digits of its uncertainty.
fn with_digits(value: f64, sigma: f64) -> String {
    let decimals = if sigma > 0.0 && sigma.is_finite() { (1.0 - sigma.log10().floor()).clamp(0.0, 12.0) } else { 6.0 };
    format!("{value:.*}", decimals as usize)
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
