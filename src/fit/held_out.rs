//! How well a model predicts touches that had no part in its fit.
//!
//! A group of touches (an index visit of a mounting, or a whole run: never single touches, whose neighbours share their
//! visit's errors) is left out, and the rest predicts it. From the fit linearised at its minimum: with the whitened rows,
//! G the Gram matrix of all and G_g that of the group, C = (G − G_g + Λ)⁻¹ and θ − C·(gradient without the group), so that
//! nothing is fitted again. Λ, 1/(1000 typical sizes)², keeps C finite where only the group sees an unknown; touches
//! that then cannot be predicted, because the prediction is more uncertain than three touches' noise, judge nothing.
//!
//! Weights, and with them the touches that can be predicted, come from the noise of a touch and the declared or stated scatter of
//! index positions (`Noise::tau_fold_mm`): the same for every model of the same touches, so that their errors compare.

use super::Fit;
use super::normal::Touches;
use super::solve::{Normal, Problem as _};
use super::span::span;
use crate::units::um_from_mm;
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

/// Touches whose prediction has a variance above this (in variances of a touch) judge nothing.
pub const LARGEST_VARIANCE: f64 = 9.0;

/// Standard deviation of what is assumed of each unknown, in typical sizes.
const WIDE: f64 = 1000.0;

/// What a fit says about touches that were left out of it.
#[derive(Debug, Clone, PartialEq)]
pub struct HeldOut {
    /// Root mean square of the errors of prediction, µm.
    pub rms_um: f64,
    /// Standard error of that from its spread over the groups, µm; none with a single group.
    pub standard_error_um: Option<f64>,
    /// Sum of squared errors, mm², and number of predicted touches of each group.
    pub by_group: Vec<(f64, usize)>,
    /// Touches that could be predicted.
    pub scored: usize,
    /// Used touches that the rest cannot predict.
    pub unpredicted: usize,
    /// Groups that were left out, one at a time.
    pub groups: usize,
    /// Measured less predicted, mm, by observation; `None` where it was not used or cannot be predicted.
    pub error_mm: Vec<Option<f64>>,
}

/// Leaves out each index visit in turn; `None` where no touch can be predicted.
#[must_use]
pub fn by_visit(fit: &Fit) -> Option<HeldOut> {
    by_group(fit, &fit.data.visits)
}

/// The same, where the touches of the fit and their normal equations at its solution are at hand.
pub(super) fn by_visit_of(fit: &Fit, touches: &Touches, normal: Normal) -> Option<HeldOut> {
    if fit.noise.tau_mm == fit.noise.tau_fold_mm {
        each_left_out(Whole::new(fit, touches, normal), &fit.data.visits)
    } else {
        by_visit(fit)
    }
}

/// Leaves out each group in turn. `groups[i]` is the group of observation i; touches of a visit stand in one group.
#[must_use]
pub fn by_group(fit: &Fit, groups: &[usize]) -> Option<HeldOut> {
    fit.with_touches(fit.noise.tau_fold_mm, |touches| {
        each_left_out(Whole::new(fit, touches, touches.normal(&fit.free_theta(), true)), groups)
    })
}

fn each_left_out(whole: Whole, groups: &[usize]) -> Option<HeldOut> {
    let fit = whole.fit;
    let mut members: Vec<Vec<usize>> = Vec::new();
    for i in (0..groups.len()).filter(|&i| fit.weight[i] > 0.0) {
        if groups[i] >= members.len() {
            members.resize(groups[i] + 1, Vec::new());
        }
        members[groups[i]].push(i);
    }
    members.retain(|m| !m.is_empty());
    if members.len() < 2 {
        return None;
    }
    let predicted: Vec<Vec<Option<f64>>> = members.par_iter().map(|m| whole.without(m).predict(&[])).collect();
    let mut error_mm = vec![None; groups.len()];
    for (group, errors) in members.iter().zip(predicted) {
        group.iter().zip(errors).for_each(|(&i, e)| error_mm[i] = e);
    }
    collect(fit, error_mm, &members, 0)
}

/// The last run of a study of several, predicted from the others. Where its blocks were set up anew, their places are
/// taken from the run itself (nothing else can know them), and counted as lost degrees of freedom.
#[must_use]
pub fn later_run(fit: &Fit) -> Option<HeldOut> {
    let observations = &fit.data.observations;
    let last = observations.iter().map(|o| o.run).max().filter(|last| *last > 0)?;
    let used = |i: &usize| fit.weight[*i] > 0.0;
    let group: Vec<usize> = (0..observations.len()).filter(used).filter(|&i| observations[i].run == last).collect();
    if group.is_empty() || group.len() == fit.n_used() {
        return None;
    }
    let elsewhere = |set_up: usize| {
        (0..observations.len()).filter(used).any(|i| observations[i].run != last && observations[i].set_up == set_up)
    };
    let own: Vec<usize> = (0..fit.free.len())
        .filter(|&c| {
            let u = &fit.model.unknowns[fit.free[c]];
            u.nuisance && u.set_up.is_some_and(|s| !elsewhere(s))
        })
        .collect();
    let (errors, n_own) = fit.with_touches(fit.noise.tau_fold_mm, |touches| {
        let whole = Whole::new(fit, touches, touches.normal(&fit.free_theta(), true));
        let part = whole.without(&group);
        let mut errors = part.predict(&own);
        let n_own = part.without_own(&own, &mut errors);
        (errors, n_own)
    });
    let mut error_mm = vec![None; observations.len()];
    group.iter().zip(errors).for_each(|(&i, e)| error_mm[i] = e);
    let mut out = collect(fit, error_mm, std::slice::from_ref(&group), n_own)?;
    out.unpredicted = group.len() - out.scored;
    Some(out)
}

fn collect(fit: &Fit, error_mm: Vec<Option<f64>>, groups: &[Vec<usize>], n_own: usize) -> Option<HeldOut> {
    let scored = error_mm.iter().flatten().count();
    let dof = scored.checked_sub(n_own).filter(|d| *d > 0)?;
    let squares: f64 = error_mm.iter().flatten().map(|e| e * e).sum();
    let unpredicted = fit.n_used().saturating_sub(scored);
    let by_group: Vec<(f64, usize)> = groups
        .iter()
        .map(|g| {
            let errors = || g.iter().filter_map(|&i| error_mm[i]);
            (errors().map(|e| e * e).sum(), errors().count())
        })
        .collect();
    let rms_um = um_from_mm((squares / dof as f64).sqrt());
    // of the mean square m, from how the groups differ from it; the root halves the relative error
    let (n, mean) = (by_group.len() as f64, squares / dof as f64);
    let spread: f64 = by_group.iter().map(|(ss, k)| (ss - mean * *k as f64).powi(2)).sum();
    let of_mean = (n / (n - 1.0) * spread).sqrt() / dof as f64;
    let standard_error_um = (by_group.len() > 1 && mean > 0.0).then(|| rms_um * 0.5 * of_mean / mean);
    let groups = by_group.len();
    Some(HeldOut { rms_um, standard_error_um, by_group, scored, unpredicted, groups, error_mm })
}

/// By how much the error on touches left out falls from one model to another one of the same touches, with the standard
/// error of the fall, µm: touches that both predict, group by group, so that what both have in common takes no part.
#[must_use]
pub fn fall(before: &HeldOut, after: &HeldOut, groups: &[usize]) -> Option<(f64, f64)> {
    let n_groups = groups.iter().max()? + 1;
    let mut each = vec![(0.0, 0.0, 0usize); n_groups];
    for ((b, a), &g) in before.error_mm.iter().zip(&after.error_mm).zip(groups) {
        if let (Some(b), Some(a)) = (b, a) {
            each[g] = (each[g].0 + b * b, each[g].1 + a * a, each[g].2 + 1);
        }
    }
    each.retain(|e| e.2 > 0);
    let (b, a, n) = each.iter().fold((0.0, 0.0, 0usize), |s, e| (s.0 + e.0, s.1 + e.1, s.2 + e.2));
    if each.len() < 2 {
        return None;
    }
    let (k, mean) = (each.len() as f64, (b - a) / n as f64);
    let spread: f64 = each.iter().map(|e| (e.0 - e.1 - mean * e.2 as f64).powi(2)).sum();
    let root = |ss: f64| um_from_mm((ss / n as f64).sqrt());
    let of_squares = (k / (k - 1.0) * spread).sqrt() / n as f64;
    let sum = root(b) + root(a);
    (sum > 0.0).then(|| (root(b) - root(a), um_from_mm(um_from_mm(of_squares)) / sum))
}

/// A fit at its minimum. Rows are made anew for the group that is looked at: those of all touches together would be larger
/// than the touches.
struct Whole<'f> {
    fit: &'f Fit,
    touches: &'f Touches<'f>,
    theta: DVector<f64>,
    gradient: DVector<f64>,
    gram: DMatrix<f64>,
    /// Scale of each unknown, so that the Gram matrix has about unit diagonal.
    scale: DVector<f64>,
}

/// A group of touches that is left out.
struct Part<'w> {
    whole: &'w Whole<'w>,
    group: &'w [usize],
    /// mm per unit.
    jacobian: DMatrix<f64>,
    whitened: DMatrix<f64>,
    residual: DVector<f64>,
}

impl<'f> Whole<'f> {
    fn new(fit: &'f Fit, touches: &'f Touches<'f>, Normal { gram, gradient, .. }: Normal) -> Self {
        let scale = gram.diagonal().map(|d| if d > 0.0 { d.sqrt() } else { 1.0 });
        Self { fit, touches, theta: fit.free_theta(), gradient, gram, scale }
    }

    fn without<'w>(&'w self, group: &'w [usize]) -> Part<'w> {
        let (gaps, jacobian) = self.touches.unwhitened_of(&self.theta, group);
        let mut whitened = jacobian.clone();
        self.touches.whiten_of(group, &mut whitened);
        let mut residual = DMatrix::from_column_slice(group.len(), 1, gaps.as_slice());
        self.touches.whiten_of(group, &mut residual);
        Part { whole: self, group, jacobian, whitened, residual: residual.column(0).into_owned() }
    }
}

impl Part<'_> {
    /// Measured less predicted at the touches that the rest predicts, mm; `own` unknowns are left aside.
    fn predict(&self, own: &[usize]) -> Vec<Option<f64>> {
        let Whole { fit, gradient, gram, scale, .. } = self.whole;
        let p = scale.len();
        let mut rest = gram - self.whitened.tr_mul(&self.whitened);
        for a in 0..p {
            for b in 0..p {
                rest[(a, b)] /= scale[a] * scale[b];
            }
            let wide = WIDE * fit.model.unknowns[fit.free[a]].typical * scale[a];
            rest[(a, a)] += wide.powi(-2);
        }
        let Some(factor) = rest.cholesky() else { return vec![None; self.group.len()] };
        let gradient = (gradient - self.whitened.tr_mul(&self.residual)).component_div(scale);
        let mut step = -factor.solve(&gradient);
        own.iter().for_each(|&c| step[c] = 0.0);
        let limit = LARGEST_VARIANCE * fit.noise.sigma_mm.powi(2);
        let mut rows = self.jacobian.transpose();
        for (c, mut of_unknown) in rows.row_iter_mut().enumerate() {
            of_unknown *= if own.contains(&c) { 0.0 } else { 1.0 / scale[c] };
        }
        let predicted = rows.tr_mul(&step);
        // the variance of a prediction is the square of L⁻¹·row
        if !factor.l_dirty().solve_lower_triangular_mut(&mut rows) {
            return vec![None; self.group.len()];
        }
        let each = self.group.iter().zip(rows.column_iter()).zip(predicted.iter());
        each.map(|((&i, row), by)| (row.norm_squared() < limit).then(|| fit.residual_mm[i] + by)).collect()
    }

    /// Takes off what `own` unknowns can explain of the errors; their number.
    fn without_own(&self, own: &[usize], errors: &mut [Option<f64>]) -> usize {
        let seen: Vec<usize> = (0..self.group.len()).filter(|&k| errors[k].is_some()).collect();
        if own.is_empty() || seen.is_empty() {
            return 0;
        }
        let b =
            DMatrix::from_fn(seen.len(), own.len(), |k, c| self.jacobian[(seen[k], own[c])] / self.whole.scale[own[c]]);
        let e = DVector::from_iterator(seen.len(), seen.iter().filter_map(|&k| errors[k]));
        let u = span(&b, 1e-9);
        let left = &e - &u * u.tr_mul(&e);
        seen.iter().zip(left.iter()).for_each(|(&k, e)| errors[k] = Some(*e));
        u.ncols()
    }
}
