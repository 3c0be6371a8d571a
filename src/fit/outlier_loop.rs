//! The steps of a fit around the least squares: noise samples, outliers, null directions that bend.

use super::noise::{self, Known, Sample};
use super::normal::Touches;
use super::outliers::{self, Studentised};
use super::remark::{Reason, VisitSource};
use super::revisits::Followed;
use super::solve;
use crate::model::data::Data;
use crate::model::formula::slot;
use crate::model::predict::Model;
use nalgebra::{DVector, Vector3};
use std::collections::{BTreeMap, HashMap};

/// Rounds of excluding outliers and including what belongs to the rest after all.
const MOST_ROUNDS: usize = 12;

/// Steps at most along the bends of gauges.
const MOST_BENDS: usize = 30;

/// Touches that scatter less than this share of what the probe's maker declares were made by no probe: they are exact.
const QUIET: f64 = 0.05;

/// More than this share of the touches is never left out: the rest is no longer what most of them say.
const MOST_OUTLIERS: f64 = 0.25;

/// More than this share of the outliers on faces of which most is off is no chance: of a quarter of all touches, strewn at
/// random, every fourth has the other touch of its face with it.
const MOST_TOGETHER: f64 = 1.0 / 3.0;

/// Touches that miss the model by five times their noise, in the square, without one that stands out may hide each other
/// behind many gross ones.
const GROSS2: f64 = 25.0;

/// A fit that is being made.
pub(super) struct OutlierLoop<'a> {
    pub data: &'a Data,
    /// What the nominal touches say, and what is held.
    pub observability: solve::Observability,
    pub touches: Touches<'a>,
    pub masked: Vec<bool>,
    /// What is known of the noise without the touches.
    pub known: Known,
    /// Does the model hold anything that changes between the visits of a pose?
    pub moving: bool,
    /// As [`super::Fit::outliers_beyond`].
    pub beyond: Option<usize>,
}

impl OutlierLoop<'_> {
    fn gaps(&self, solution: &solve::Solution) -> Vec<f64> {
        self.touches.gaps(&solution.theta)
    }

    /// The touches that are used, as the noise sees them.
    pub fn samples(&self, solution: &solve::Solution) -> Vec<Sample> {
        let mut points: HashMap<[u64; 11], usize> = HashMap::new();
        let gaps = self.gaps(solution);
        let mut out = Vec::with_capacity(gaps.len());
        for (i, o) in self.data.observations.iter().enumerate() {
            let bits = |x: f64| x.to_bits();
            let key = [
                o.set_up as u64,
                bits(o.point.x),
                bits(o.point.y),
                bits(o.point.z),
                bits(o.normal.x),
                bits(o.normal.y),
                bits(o.normal.z),
                bits(o.state[slot::FEED]),
                // another orientation of the spindle or another stylus is another touch
                bits(o.state[slot::SPINDLE]),
                bits(o.state[slot::LENGTHS]),
                bits(o.ball_radius),
            ];
            let n = points.len();
            let point = *points.entry(key).or_insert(n);
            if self.touches.weights()[i] > 0.0 {
                let visit = self.data.visits[i];
                out.push(Sample {
                    residual_mm: gaps[i],
                    normal: Vector3::new(o.state[8], o.state[9], o.state[10]),
                    repeat: self.data.repeats[i],
                    visit,
                    pose: self.data.poses[visit],
                    point,
                });
            }
        }
        out
    }

    /// How a solution follows what changes between the visits of a pose.
    fn followed(&self, solution: &solve::Solution) -> Followed {
        let used: Vec<usize> = (0..self.data.observations.len()).filter(|&i| self.touches.weights()[i] > 0.0).collect();
        let (_, rows) = self.touches.unwhitened_of(&solution.theta, &used);
        Followed { rows, covariance: solution.covariance.clone() }
    }

    /// Takes the noise that the touches show, and the solution with it.
    pub fn settle(&mut self, mut solution: solve::Solution) -> (noise::Noise, solve::Solution) {
        /// Rounds, and the change of τ that is none, relative.
        const ROUNDS: usize = 6;
        const NONE: f64 = 0.01;
        let mut noise = noise::estimate(&self.samples(&solution), &self.known, None);
        for _ in 0..ROUNDS {
            solution = self.with_noise(solution, &noise);
            // what the fit follows between visits depends on how much they are taken to scatter
            if !self.moving || noise.visit_source != VisitSource::Revisits {
                break;
            }
            let before = noise.tau_mm;
            noise = noise::estimate(&self.samples(&solution), &self.known, Some(&self.followed(&solution)));
            if (noise.tau_mm - before).abs() <= NONE * before {
                break;
            }
        }
        let (sigma_mm, tau_mm) = self.touches.noise_mm();
        if (sigma_mm, tau_mm) != (noise.sigma_mm, noise.tau_mm) {
            // what is answered belongs to the noise that is answered
            solution = self.with_noise(solution, &noise);
        }
        (noise, solution)
    }

    /// The solution with another noise.
    fn with_noise(&mut self, mut solution: solve::Solution, noise: &noise::Noise) -> solve::Solution {
        let before = self.touches.noise_mm();
        self.touches.set_noise(noise.sigma_mm, noise.tau_mm);
        // where a gauge was followed along its bend, the covariance is not yet that of where it led
        let stays = solution.converged && self.observability.full() && self.touches.priors().is_empty();
        if !stays || before.1 > 0.0 || noise.tau_mm > 0.0 {
            return self.refit_here(solution.theta);
        }
        // all weights change alike: the minimum stays where it is
        let by = (noise.sigma_mm / before.0).powi(2);
        solution.chi2 /= by;
        solution.covariance *= by;
        solution.iterations = 0;
        solution
    }

    /// How far each touch is off what the others predict at a solution; `noise_dof` is that of σ.
    pub fn studentised(&self, solution: &solve::Solution, noise_dof: f64) -> Studentised {
        let dof = solve::Problem::n_rows(&self.touches).saturating_sub(self.observability.rank);
        Studentised::new(&self.touches, &solution.theta, &solution.covariance, (solution.chi2, dof), noise_dof)
    }

    /// The touches that a solution shows to be outliers, the worst first.
    fn found(&self, solution: &solve::Solution, noise_dof: f64) -> Vec<usize> {
        self.studentised(solution, noise_dof).outliers(&self.data.visits)
    }

    fn refit(&mut self, weights: Vec<f64>, from: &solve::Solution) -> solve::Solution {
        self.touches.set_weights(weights);
        self.refit_here(from.theta.clone())
    }

    pub fn refit_here(&self, from: DVector<f64>) -> solve::Solution {
        solve::minimise(&self.touches, from, &self.observability)
    }

    /// What the touches tell of held unknowns by the bend of their gauges. A combination leaves no trace where everything is
    /// nominal; where blocks stand askew it may leave a small one, which goes into the other values while an unknown of the
    /// combination is held. Where the touches scatter far less than a probe does, that trace is more than their scatter: then
    /// everything moves, each held unknown expected within its usual size of where it stands, and each touch within what it
    /// scatters. Touches as real probes make them say nothing of it, and stay with what is held.
    pub fn follow_bends(&self, mut solution: solve::Solution, model: &Model, free: &[usize]) -> solve::Solution {
        let seen = &self.observability;
        let dof = solve::Problem::n_rows(&self.touches).saturating_sub(seen.rank);
        if seen.full() || seen.rank == 0 || dof == 0 {
            return solution;
        }
        let (sigma_mm, _) = self.touches.noise_mm();
        let (p, k) = (free.len(), seen.held.len());
        let typical = DVector::from_iterator(p, free.iter().map(|&i| model.unknowns[i].typical));
        let stood: Vec<f64> = seen.held.iter().map(|&c| solution.theta[c]).collect();
        let off = |theta: &DVector<f64>| -> DVector<f64> {
            let each = seen.held.iter().zip(&stood).map(|(&c, stood)| (theta[c] - stood) / typical[c]);
            DVector::from_iterator(k, each)
        };
        let sum = |theta: &DVector<f64>| solve::Problem::normal(&self.touches, theta, false).sum;
        for _ in 0..MOST_BENDS {
            let scatter = (solution.chi2.max(0.0) / dof as f64).sqrt().max(solve::STEP_TOLERANCE_MM / sigma_mm);
            if scatter * sigma_mm > QUIET * self.known.declared_sigma_mm {
                return solution;
            }
            let (residual, jacobian) = self.touches.dense(&solution.theta);
            let n = jacobian.nrows();
            let mut rows = jacobian.resize_vertically(n + k, 0.0);
            for (mut column, size) in rows.column_iter_mut().zip(typical.iter()) {
                column *= size / scatter;
            }
            seen.held.iter().enumerate().for_each(|(row, &c)| rows[(n + row, c)] = 1.0);
            let mut right = residual.resize_vertically(n + k, 0.0) / -scatter;
            right.rows_mut(n, k).copy_from(&-off(&solution.theta));
            let moved = |step: &DVector<f64>| (rows.rows(0, n) * step).norm() * scatter * sigma_mm / (n as f64).sqrt();
            let factor = rows.clone().qr();
            factor.q_tr_mul(&mut right);
            let Some(step) = factor.r().solve_upper_triangular(&right.rows(0, p).into_owned()) else { break };
            let moved_mm = moved(&step);
            let step = step.component_mul(&typical);
            if !moved_mm.is_finite() || step.iter().any(|s| !s.is_finite()) {
                break;
            }
            let worth = |theta: &DVector<f64>, sum: f64| sum / scatter.powi(2) + off(theta).norm_squared();
            let before = worth(&solution.theta, solution.chi2);
            let parts = [1.0, 0.5, 0.25, 0.125];
            let better = parts.iter().find_map(|part| {
                let theta = &solution.theta + &step * *part;
                let chi2 = sum(&theta);
                (worth(&theta, chi2) < before).then_some((theta, chi2))
            });
            let Some((theta, chi2)) = better else { break };
            (solution.theta, solution.chi2) = (theta, chi2);
            solution.iterations += 1;
            if moved_mm < solve::STEP_TOLERANCE_MM {
                break;
            }
        }
        solution
    }

    /// What is seen where the search has come to: as many combinations as at the nominal touches.
    pub fn seen_at(&self, theta: &DVector<f64>) -> solve::Observability {
        let nominal = &self.observability;
        if nominal.full() || nominal.rank == 0 {
            return nominal.clone();
        }
        let mut jacobian = solve::Problem::jacobian(&self.touches, theta);
        // an unknown that left no trace at all has none of its own here either: scaled to one, what the sizes that a shape came to
        // beside noise show of it would push out the weakest of what is seen
        let alone = |v: &DVector<f64>| {
            (v.amax() > 0.0 && v.iter().filter(|w| w.abs() > 1e-9 * v.amax()).count() == 1).then(|| v.iamax())
        };
        for c in nominal.unseen.iter().filter_map(alone) {
            jacobian.column_mut(c).fill(0.0);
        }
        solve::observe_of_rank(&jacobian, nominal.rank)
    }

    /// Data snooping from a robust start: touches that do not belong to the rest get the weight 0, and those that do
    /// get it back. `noise_dof` is that of σ.
    pub fn without_outliers(&mut self, plain: solve::Solution, noise_dof: f64) -> solve::Solution {
        let n = self.data.observations.len();
        let all: Vec<f64> = self.masked.iter().map(|m| if *m { 0.0 } else { 1.0 }).collect();
        let mut solution = if self.touches.weights() == all { plain } else { self.refit(all.clone(), &plain) };
        self.beyond = None;
        let first = self.found(&solution, noise_dof);
        if first.is_empty() && self.scale2(&solution, noise_dof) < GROSS2 {
            return solution;
        }
        // several bad touches hide each other: let the rest vote first
        let cap = (outliers::MOST_SHARE * n as f64).ceil() as usize;
        let mut most = cap;
        let robust = self.robust_outliers(&solution, &all);
        let mut out = if robust.is_empty() || robust.len() > cap { first } else { robust.clone() };
        if robust.len() > cap {
            match self.many_outliers(&robust, &all, &solution) {
                // few of them after all: the rule for few
                Some(many) if many.len() <= cap => out = many,
                Some(many) => {
                    most = (MOST_OUTLIERS * n as f64) as usize;
                    out = many;
                }
                None => self.beyond = Some(robust.len()),
            }
        }
        if out.is_empty() {
            return if self.touches.weights() == all { solution } else { self.refit(all, &solution) };
        }
        for _ in 0..MOST_ROUNDS {
            let mut weights = all.clone();
            out.iter().for_each(|&i| weights[i] = 0.0);
            solution = self.refit(weights, &solution);
            // back in what belongs, out what does not
            let scale2 = self.scale2(&solution, noise_dof);
            let back: Vec<usize> =
                out.iter().copied().filter(|&i| self.belongs(&solution, i, scale2, noise_dof)).collect();
            let more: Vec<usize> = self.found(&solution, noise_dof);
            if back.is_empty() && (more.is_empty() || out.len() >= most) {
                break;
            }
            out.retain(|i| !back.contains(i));
            out.extend(more);
            out.truncate(most.max(1));
        }
        // touches of one face that miss together say something in common: that is no matter of chips. Among many outliers
        // some meet on a face by chance
        if most == cap {
            for cluster in outliers::clusters(&out, self.faces(), n) {
                out.retain(|i| !cluster.contains(i));
            }
        }
        let mut weights = all;
        out.iter().for_each(|&i| weights[i] = 0.0);
        if weights == self.touches.weights() { solution } else { self.refit(weights, &solution) }
    }

    /// The face of each touch.
    fn faces(&self) -> impl Fn(usize) -> outliers::Face {
        let rounded = |n: Vector3<f64>| [n.x, n.y, n.z].map(|x| (10.0 * x).round() as i8);
        move |i| {
            let o = &self.data.observations[i];
            (self.data.visits[i], o.set_up, rounded(o.normal))
        }
    }

    /// More outliers than chips explain, where they are gross ones all the same and no missing effect: they are a
    /// minority and strewn over the faces, the others see as much without them, and the others agree to within their
    /// noise, which an effect that the model lacks would not let them do. `None` where that does not hold.
    fn many_outliers(&mut self, robust: &[usize], all: &[f64], from: &solve::Solution) -> Option<Vec<usize>> {
        let n_used = all.iter().filter(|w| **w > 0.0).count();
        let mut out = robust.to_vec();
        if out.len() as f64 > MOST_OUTLIERS * n_used as f64
            || outliers::whole_faces(&out, self.faces(), all.len()) as f64 > MOST_TOGETHER * out.len() as f64
        {
            return None;
        }
        let (sigma_mm, tau_mm) = self.touches.noise_mm();
        let mut weights = all.to_vec();
        out.iter().for_each(|&i| weights[i] = 0.0);
        let mut solution = self.refit(weights, from);
        let noise = noise::estimate(&self.samples(&solution), &self.known, None);
        self.touches.set_noise(noise.sigma_mm, noise.tau_mm);
        solution = self.refit_here(solution.theta);
        // touches that the robust fit took for outliers, and that are not, come back
        let scale2 = self.scale2(&solution, noise.dof.unwrap_or(0.0));
        let noise_dof = noise.dof.unwrap_or(0.0);
        out.retain(|&i| !self.belongs(&solution, i, scale2, noise_dof));
        let mut weights = all.to_vec();
        out.iter().for_each(|&i| weights[i] = 0.0);
        solution = self.refit(weights, &solution);
        let dof = solve::Problem::n_rows(&self.touches).saturating_sub(self.observability.rank);
        let fits = dof > 0 && solution.chi2 / dof as f64 <= noise.limit(dof);
        let jacobian = solve::Problem::jacobian(&self.touches, &solution.theta);
        let sees_all = solve::observe(&jacobian).rank >= self.observability.rank;
        self.touches.set_noise(sigma_mm, tau_mm);
        (fits && sees_all).then_some(out)
    }

    /// Touches further than 4 robust standard deviations off a fit in which far touches count little.
    fn robust_outliers(&mut self, plain: &solve::Solution, all: &[f64]) -> Vec<usize> {
        let (sigma, _) = self.touches.noise_mm();
        let mut solution = plain.clone();
        let mut gaps = self.gaps(&solution);
        let mut scale = gaps.iter().map(|r| r.abs()).fold(0.0, f64::max);
        loop {
            let mut weights = outliers::robust_weights(&gaps, scale);
            weights.iter_mut().zip(all).for_each(|(w, a)| *w = (*w * a).max(1e-6 * a));
            solution = self.refit(weights, &solution);
            gaps = self.gaps(&solution);
            let floor = 3.0 * outliers::median_scale(&gaps).max(0.1 * sigma);
            if scale <= floor {
                break;
            }
            scale = (scale / 3.0).max(floor);
        }
        let limit = 4.0 * outliers::median_scale(&gaps).max(0.1 * sigma);
        (0..gaps.len()).filter(|&i| all[i] > 0.0 && gaps[i].abs() > limit).collect()
    }

    pub fn scale2(&self, solution: &solve::Solution, noise_dof: f64) -> f64 {
        (solution.chi2 + noise_dof) / (self.dof() + noise_dof).max(1.0)
    }

    /// Degrees of freedom of the touches that are used.
    fn dof(&self) -> f64 {
        solve::Problem::n_rows(&self.touches).saturating_sub(self.observability.rank) as f64
    }

    /// Does a touch that is not used agree with those that are?
    fn belongs(&self, solution: &solve::Solution, i: usize, scale2: f64, noise_dof: f64) -> bool {
        outliers::belongs(self.off(solution, i, scale2).1, self.dof() + noise_dof)
    }

    /// How far touch i is off what the fit says, mm and in standard deviations.
    pub fn off(&self, solution: &solve::Solution, i: usize, scale2: f64) -> (f64, f64) {
        let (gap, row) = self.touches.row(&solution.theta, i);
        let (sigma, tau) = self.touches.noise_mm();
        outliers::judge(gap, &row, &solution.covariance, sigma * sigma + tau * tau, scale2)
    }

    /// Why each touch is excluded that the user did not mask.
    pub fn reasons(&self, solution: &solve::Solution, noise_dof: f64) -> BTreeMap<usize, Reason> {
        let scale2 = self.scale2(solution, 0.0);
        let weights = self.touches.weights();
        let is_outlier = |i: &usize| weights[*i] == 0.0 && !self.masked[*i];
        let reason = |i: usize| {
            let (off_mm, standardised) = self.off(solution, i, scale2);
            let robust_only = outliers::belongs(standardised, self.dof() + noise_dof);
            (i, Reason::Outlier { off_mm, standardised, robust_only })
        };
        (0..weights.len()).filter(is_outlier).map(reason).collect()
    }
}
