//! Which parameters, and which combinations of them, the touches tell badly.

use super::Fit;
use super::null_space::meaning;
use super::outcome::{Combination, Correlation};
use super::solve::RANK_TOLERANCE;
use super::span::span;
use crate::model::catalogue::Effect;
use crate::model::predict::Unknown;
use crate::words::fit as words;
use nalgebra::{DMatrix, DVector, DVectorView};

/// Correlations above this are worth a line.
const WORTH_NAMING: f64 = 0.8;

/// Projecting the set-ups out of a Gram matrix leaves some 1e-5 of the largest singular value: below this share of it the
/// rows themselves must tell.
const GRAM_SEES: f64 = 1e-4;

/// The same against the columns before the projection: their Gram matrix is good to some 1e-15.
const GRAM_SEES_OF_RAW: f64 = 1e-6;

/// Correlations below this are none.
const NOTHING: f64 = 0.05;

/// What is left of a column that is taken out whole, as a share of it: gauges are said elsewhere.
const ROUNDING: f64 = 1e-12;

/// Pairs that are named at most.
const MOST_PAIRS: usize = 8;

/// The pairs of results that are least told apart, among those that have a value: all that are worth naming, and the worst one where it is
/// anything.
pub(super) fn correlations(fit: &Fit, has_value: impl Fn(usize) -> bool) -> Vec<Correlation> {
    let is_result = |i: &usize| !fit.model.unknowns[*i].is_set_up() && fit.covariance[(*i, *i)] > 0.0 && has_value(*i);
    let results: Vec<usize> = fit.free.iter().copied().filter(is_result).collect();
    let mut out = Vec::new();
    for (k, &i) in results.iter().enumerate() {
        for &j in &results[..k] {
            let r = fit.covariance[(i, j)] / (fit.covariance[(i, i)] * fit.covariance[(j, j)]).sqrt();
            out.push((r, j, i));
        }
    }
    out.sort_by(|x, y| y.0.abs().total_cmp(&x.0.abs()));
    let worth = |least: f64| out.iter().take_while(|(r, ..)| r.abs() > least).count();
    let named = worth(WORTH_NAMING).max(worth(NOTHING).min(1)).min(MOST_PAIRS);
    out.truncate(named);
    let name = |i: usize| fit.model.unknowns[i].name.clone();
    out.into_iter().map(|(r, a, b)| Correlation { a: name(a), b: name(b), r: (r * 1e4).round() / 1e4 }).collect()
}

/// Combinations of results that these touches determine no better than their typical sizes: columns scaled by typical
/// size, nuisance projected out, singular values below 1 (in units of the noise). Without those that leave no trace, which
/// are said elsewhere. `gram`: that of the fit's touches and priors.
pub(super) fn poorly_determined(fit: &Fit, effects: &[&Effect], gram: &DMatrix<f64>) -> Vec<Combination> {
    let is_nuisance = |c: &usize| fit.model.unknowns[fit.free[*c]].nuisance;
    let (nuisance, physical): (Vec<usize>, Vec<usize>) = (0..fit.free.len()).partition(is_nuisance);
    if physical.is_empty() {
        return Vec::new();
    }
    let typical = |c: usize| fit.model.unknowns[fit.free[c]].typical;
    // what the columns are before anything is taken out of them: all that is left may be rounding
    let raw: Vec<f64> = physical.iter().map(|&c| gram[(c, c)].max(0.0).sqrt() * typical(c)).collect();
    let size =
        |direction: DVectorView<f64>| direction.iter().zip(&raw).map(|(w, r)| (w * r).powi(2)).sum::<f64>().sqrt();
    let precise = |(values, directions): &Spectrum| {
        values.iter().zip(directions.column_iter()).all(|(s, d)| *s > GRAM_SEES_OF_RAW * size(d))
    };
    let quick = if fit.seen.full() { from_gram(gram, &physical, &nuisance, typical) } else { None };
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
        let meanings: Vec<(String, f64)> = weights.iter().map(|(u, w)| (meaning(u, effects), *w)).collect();
        out.push(Combination {
            says: words::poorly_determined(&meanings, 1.0 / s),
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
        let basis = span(&set_ups, RANK_TOLERANCE);
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
