//! Which of several local minima a fit with shape parameters takes, and what becomes of a shape that runs out of its range.

use super::nonlinear_scan::{self, Stretch};
use super::remark::Remark;
use super::shape_search::{Job, ShapeSearch, Starts};
use super::{Fit, Knowledge};
use crate::diag::Result;
use crate::model::predict::Unknown;
use nalgebra::DMatrix;

/// A lower minimum is lower by more than this share of χ².
const SAME: f64 = 1e-6;

/// The fit at the lowest of the local minima that are known: beside other values of a shape that fit about as well, and at moments of a
/// jump next to its own. A scan saw both only beside everything else following a straight line, and without the jump good touches
/// about it looked like outliers.
pub(super) fn lowest_minimum(fit: Fit, job: Job, mut search: ShapeSearch, starts: &Starts) -> Result<Fit> {
    /// Moves at most.
    const MOST: usize = 6;
    let (mut fit, remarks) = within_range(fit, job, &mut search, starts)?;
    for _ in 0..if search.settings.quick { 0 } else { MOST } {
        let mut best: Option<(f64, Fit, ShapeSearch)> = None;
        for (name, value) in other_values(&fit, job, &search) {
            let mut held = search.quick();
            held.hold(&name, value);
            let mut other = job.fit(fit.data.clone(), &held, &values(&fit))?;
            let mut moved = search.clone();
            if search.jumps.contains(&name) {
                moved.hold(&name, value);
            } else {
                other = job.fit(fit.data.clone(), &search.quick(), &values(&other))?;
            }
            let [here, there] = against([&fit, &other]);
            let share = there / here;
            let is_better = share < 1.0 - SAME && best.as_ref().is_none_or(|b| share < b.0);
            if is_better && nonlinear_scan::out_of_range(&other, job.effects).is_none() {
                best = Some((share, other, moved));
            }
        }
        let Some((_, lower, moved)) = best else { break };
        let from = values(&lower);
        let next = job.fit(lower.data, &moved, &from)?;
        if nonlinear_scan::out_of_range(&next, job.effects).is_some() {
            break;
        }
        (fit, search) = (next, moved);
    }
    fit.outcome.warnings.extend(remarks.iter().map(crate::words::fit::remark));
    fit.remarks.extend(remarks);
    Ok(fit)
}

/// Values of shapes at which another minimum may be, by name.
fn other_values(fit: &Fit, job: Job, search: &ShapeSearch) -> Vec<(String, f64)> {
    let of_smooth = fit.other_values.iter().flat_map(|(&i, all)| all.iter().map(move |v| (i, *v)));
    let mut out: Vec<(String, f64)> = of_smooth.map(|(i, v)| (fit.model.unknowns[i].name.clone(), v)).collect();
    for u in fit.model.unknowns.iter().filter(|u| search.jumps.contains(&u.name)) {
        let p = job.effects.iter().flat_map(|e| &e.parameters).find(|p| p.name == u.own_name());
        let Some((p, Some(Knowledge::Fixed(at)))) = p.zip(search.settings.knowledge.get(&u.name).map(Some)) else {
            continue;
        };
        let stretches = nonlinear_scan::stretches_of_a_jump(p, &fit.data, u.block());
        out.extend(next_to(&stretches, *at).map(|place| (u.name.clone(), place)));
    }
    out
}

/// Moments in the stretches on either side of one.
fn next_to(stretches: &[Stretch], at: f64) -> impl Iterator<Item = f64> {
    /// Stretches between touches on either side.
    const REACH: usize = 5;
    let here = stretches.iter().position(|s| s.ends[0] <= at && at <= s.ends[1]);
    let near = here.map_or(0..0, |k| k.saturating_sub(REACH)..(k + REACH + 1).min(stretches.len()));
    near.filter(move |k| Some(*k) != here).map(|k| stretches[k].place)
}

/// The fit with every shape in its range again, and what is to be remarked on it.
fn within_range(mut fit: Fit, job: Job, search: &mut ShapeSearch, starts: &Starts) -> Result<(Fit, Vec<Remark>)> {
    let mut remarks = Vec::new();
    // each may come out of its range twice: before and after another one is held
    for _ in 0..2 * fit.model.unknowns.iter().filter(|u| u.shape).count() {
        let Some((name, ends)) = nonlinear_scan::out_of_range(&fit, job.effects) else { break };
        // a first step too far: everything else settles while the shape stays where it began, and the search goes on from there
        if let Some(&began) = starts.get(&name) {
            let mut held = search.quick();
            held.hold(&name, began);
            let settled = job.fit(fit.data, &held, starts)?;
            let from = values(&settled);
            fit = job.fit(settled.data, search, &from)?;
            if nonlinear_scan::out_of_range(&fit, job.effects).is_none_or(|(other, _)| other != name) {
                continue;
            }
        }
        // a step too far does not tell the side: the end that fits better, what the user states of it included
        let words = search.settings.knowledge.iter();
        let prior = words.filter(|(word, _)| crate::symbols::same(word, &name)).find_map(|(_, k)| match *k {
            Knowledge::Prior { value, sigma } => Some((value, sigma)),
            Knowledge::Fixed(_) => None,
        });
        search.held.insert(name.clone());
        let mut at = |end: f64| {
            search.hold(&name, end);
            job.fit(fit.data.clone(), search, starts)
        };
        let [low, high] = [at(ends[0])?, at(ends[1])?];
        let stated = ends.map(|end| prior.map_or(0.0, |(value, sigma)| ((end - value) / sigma).powi(2)));
        let [at_low, at_high] = against([&low, &high]);
        let is_low = at_low + stated[0] <= at_high + stated[1];
        search.hold(&name, ends[usize::from(!is_low)]);
        fit = if is_low { low } else { high };
        remarks.push(Remark::OutOfRange { name, prior });
    }
    Ok((fit, remarks))
}

/// Values of all unknowns by name, to begin at. Where a shape leaves no trace the sizes of its effect begin at none again: beside what
/// noise made of them the shape would run anywhere.
pub(super) fn values(fit: &Fit) -> Starts {
    /// A share of a combination that is rounding.
    const NONE: f64 = 1e-6;
    let unknowns = &fit.model.unknowns;
    let is_unseen = |i: usize| {
        let column = fit.free.binary_search(&i).ok().filter(|_| unknowns[i].shape);
        column.is_some_and(|c| fit.observability.unseen.iter().any(|v| v[c].abs() > NONE))
    };
    let set = |u: &Unknown| (u.effect.clone(), u.set_up);
    let unseen: Vec<_> = (0..unknowns.len()).filter(|&i| is_unseen(i)).map(|i| set(&unknowns[i])).collect();
    let begins = |(u, value): (&Unknown, &f64)| {
        let is_size = !u.shape && unseen.contains(&set(u));
        (u.name.clone(), if is_size { u.start } else { *value })
    };
    unknowns.iter().zip(&fit.theta).map(begins).collect()
}

/// χ² of touches and priors of each of two fits, by one measure: with the smaller noise of the two, and a price for each touch that is
/// not used.
fn against(fits: [&Fit; 2]) -> [f64; 2] {
    /// What an excluded touch costs: about where the limit of an outlier is.
    const EXCLUDED: f64 = 12.0;
    let least = |of: fn(&Fit) -> f64| of(fits[0]).min(of(fits[1]));
    let noise_mm = (least(|f| f.noise.sigma_mm), least(|f| f.noise.tau_mm));
    fits.map(|fit| {
        let mut residual = DMatrix::from_column_slice(fit.residual_mm.len(), 1, &fit.residual_mm);
        fit.with_noise(noise_mm, |touches| touches.whitening()).apply(&mut residual);
        let known = fit.priors.iter().map(|&(i, value, sigma)| ((fit.theta[i] - value) / sigma).powi(2));
        residual.norm_squared() + known.sum::<f64>() + EXCLUDED * fit.rejected.len() as f64
    })
}
