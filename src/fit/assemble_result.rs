//! Puts the result of a fit together: values with their uncertainty, what cannot be determined, and the remarks.

use super::nonlinear_scan::{self, NOT_CREDIBLE};
use super::outcome::{FORMAT, Outcome, Parameter, Rejected, Residual, Status, TurnsAbout, TypeBRow};
use super::profile::{Ends, Intervals};
use super::remark::Remark;
use super::shape_search::Asked;
use super::solve::{Problem as _, Solution};
use super::type_b::TypeB;
use super::uncertainty::{LeftOut, Unmodelled};
use super::{Fit, contradictions, held_out, null_space, outliers, poorly_determined, profile, uncertainty};
use crate::machine::Machine;
use crate::model::catalogue::Effect;
use crate::model::data::UnusableReason;
use crate::model::lever_arm::{Arm, turning_point};
use crate::model::predict::Unknown;
use crate::units::um_from_mm;
use crate::words::fit as words;
use nalgebra::DVector;
use std::collections::{BTreeMap, BTreeSet};

/// Sides of an interval that differ from the usual one by more than a twentieth are shown.
const UNEVEN: f64 = 1.05;

/// And one that is wider by this is no longer that of a standard uncertainty that holds near the solution.
const MUCH_WIDER: f64 = 1.5;

/// With more touches a shape parameter is known so well that its uncertainty is the same on both sides. A moment at which something
/// jumps has no other than that of its profile.
const MOST_PROFILED: usize = 20_000;

/// The result with what only the fit itself keeps.
pub(super) struct Assembled {
    pub outcome: Outcome,
    pub remarks: Vec<Remark>,
    /// Other values of shape parameters that fit about as well, by unknown.
    pub other_values: BTreeMap<usize, Vec<f64>>,
}

/// The result of a fit.
pub(super) fn assemble_result(
    fit: &Fit,
    asked: &Asked,
    (solution, condition): (&Solution, f64),
    (type_b, left_out): (&[TypeB], Option<LeftOut>),
    mut remarks: Vec<Remark>,
) -> Assembled {
    let (settings, effects) = (&asked.search.settings, asked.effects);
    let n = fit.data.observations.len();
    let (mut unmodelled, mut held_out_rms_um, mut weak) = (None, None, Vec::new());
    if !settings.quick && !settings.bare {
        fit.with_touches(fit.noise.tau_mm, |touches| {
            let normal = touches.normal(&fit.free_theta(), true);
            if n <= uncertainty::MOST_UNMODELLED {
                weak = poorly_determined::poorly_determined(fit, effects, &normal.gram);
            }
            let held_out = || held_out::by_visit_of(fit, touches, normal).map(|h| h.rms_um);
            let with_all = || left_out.map(|all| uncertainty::with_unmodelled(fit, all));
            (unmodelled, held_out_rms_um) = rayon::join(with_all, held_out);
        });
    }
    let evidence = Evidence::new(fit, asked, type_b, unmodelled);
    let status: Vec<Status> = (0..fit.theta.len()).map(|i| evidence.status(i)).collect();
    let parameters: Vec<Parameter> = (0..fit.theta.len()).map(|i| evidence.parameter(i, status[i])).collect();
    let is_lost =
        |name: &String| fit.model.unknowns.iter().position(|u| u.name == *name).is_some_and(|i| evidence.is_lost(i));
    // how badly something is determined that another value of a shape makes something else cannot be said
    weak.retain(|c| {
        let lost: f64 = c.combination.iter().filter(|(name, _)| is_lost(name)).map(|(_, w)| w * w).sum();
        lost <= 0.5 * c.combination.values().map(|w| w * w).sum::<f64>()
    });
    let free_unknowns: Vec<&Unknown> = fit.free.iter().map(|&i| &fit.model.unknowns[i]).collect();
    let squares: f64 = fit.residual_mm.iter().zip(&fit.weight).map(|(r, w)| w * r * r).sum();
    let unusable = fit.data.unusable.iter().map(|u| Rejected {
        id: u.id,
        run: u.run + 1,
        reason: format!("{} (line {})", crate::words::log::unusable(&u.reason), u.line),
        is_far: u.reason == UnusableReason::FarFromPlan,
    });
    let excluded = fit.rejected.iter().map(|(&i, reason)| {
        let o = &fit.data.observations[i];
        Rejected { id: o.id, run: o.run + 1, reason: words::reason(reason), is_far: false }
    });
    let mut undetermined =
        null_space::undetermined(&free_unknowns, effects, &fit.observability.unseen, &fit.observability);
    for u in &mut undetermined {
        u.moves_um = moves_um(fit, &u.combination);
    }
    let with_value = |i: usize| parameters[i].sigma.is_some();
    let mut outcome = Outcome {
        format: FORMAT.into(),
        machine: asked.machine.name.clone(),
        effects: settings.effects.clone(),
        converged: solution.converged,
        iterations: solution.iterations,
        stopped: solution.stopped.clone(),
        touches: n + fit.data.unusable.len(),
        rejected: unusable.chain(excluded).collect(),
        unknowns: fit.free.len(),
        rank: fit.observability.rank,
        dof: fit.dof,
        condition,
        rms_um: um_from_mm((squares / fit.n_used().max(1) as f64).sqrt()),
        held_out_rms_um,
        noise_um: um_from_mm(fit.noise.sigma_mm),
        noise_source: fit.noise.source,
        noise_dof: fit.noise.dof,
        visit_dof: fit.noise.visit_dof,
        visit_um: um_from_mm(fit.noise.tau_mm),
        visit_shown_um: fit.noise.visits_shown.map(|shown| um_from_mm(shown.tau_mm)),
        visit_source: fit.noise.visit_source,
        noise_says: words::noise(&fit.noise),
        chi2_per_dof: if fit.dof > 0 { fit.chi2 / fit.dof as f64 } else { f64::NAN },
        turns_about: turns_about(fit, asked.machine, effects, &status),
        undetermined,
        parted_together: Vec::new(),
        never_determined: 0,
        weak,
        correlations: poorly_determined::correlations(fit, with_value),
        priors: uncertainty::priors(fit),
        type_b: type_b
            .iter()
            .map(|b| TypeBRow { name: b.name.clone(), sigma: b.sigma, unit: b.unit.clone() })
            .collect(),
        reference_mm: fit.model.reference.into(),
        covariance: None,
        covariance_type_a: None,
        residuals: Some(residuals(fit)),
        parameters,
        warnings: Vec::new(),
    };
    remarks.extend(of_the_fit(fit, asked, solution));
    remarks.extend(of_shapes(&evidence, &status));
    remarks.extend(type_b.iter().filter_map(|b| b.remark.clone()));
    remarks.extend(evidence.unmodelled.iter().flat_map(|all| all.left_out.clone()).map(Remark::NotCounted));
    remarks.extend(not_mentioned(&outcome, &remarks));
    remarks.sort_by_key(Remark::rank);
    outcome.warnings = remarks.iter().map(words::remark).collect();
    Assembled { outcome, remarks, other_values: evidence.other_values }
}

/// The points about which axes turn, as far as the touches show them.
fn turns_about(fit: &Fit, machine: &Machine, effects: &[&Effect], status: &[Status]) -> Vec<TurnsAbout> {
    let one = |effect: &&Effect| {
        let value = |parameter: usize| {
            let name = &effect.parameters.get(parameter)?.name;
            let i = fit.model.unknowns.iter().position(|u| u.effect == effect.id && u.name == *name)?;
            let known = matches!(status[i], Status::Identified | Status::Fixed);
            known.then(|| (fit.theta[i], fit.covariance[(i, i)].max(0.0).sqrt()))
        };
        let (Arm::Distance { parameter, .. } | Arm::Displaced { turn: (parameter, _), .. }) = effect.arm?;
        let says = words::turning_point(&turning_point(machine, effect, value)?);
        Some(TurnsAbout { effect: effect.id.clone(), parameter: effect.parameters.get(parameter)?.name.clone(), says })
    };
    effects.iter().filter_map(one).collect()
}

/// All that the status and the uncertainty of a parameter are made of. `c` is a place among the free unknowns, `i` among all.
struct Evidence<'a> {
    fit: &'a Fit,
    asked: &'a Asked<'a>,
    /// Variance of each free unknown from the scatter of index positions and from type B rows.
    by_visits: DVector<f64>,
    by_type_b: DVector<f64>,
    has_type_b: bool,
    /// How far each moves with what leaves no trace.
    moves: DVector<f64>,
    unmodelled: Option<Unmodelled>,
    intervals: BTreeMap<usize, Ends>,
    other_values: BTreeMap<usize, Vec<f64>>,
}

impl<'a> Evidence<'a> {
    fn new(fit: &'a Fit, asked: &'a Asked<'a>, type_b: &[TypeB], unmodelled: Option<Unmodelled>) -> Self {
        let by_type_b = |c: usize| type_b.iter().map(|row| row.makes[c] * row.makes[c]).sum::<f64>();
        let mut out = Self {
            fit,
            asked,
            by_visits: uncertainty::visit_variance(fit),
            by_type_b: DVector::from_fn(fit.free.len(), |c, _| by_type_b(c)),
            has_type_b: !type_b.is_empty(),
            moves: uncertainty::moves_with_unseen(fit),
            unmodelled,
            intervals: BTreeMap::new(),
            other_values: BTreeMap::new(),
        };
        let spread = |i: usize| {
            let c = out.column(i).filter(|&c| !out.is_unseen(c))?;
            Some((out.variance(c).sqrt(), out.coverage(c)))
        };
        let profiled = |u: &Unknown| out.is_profiled(u);
        let Intervals { ends, other_values } =
            profile::intervals(fit, asked.machine, asked.effects, asked.search, (&profiled, &spread));
        (out.intervals, out.other_values) = (ends, other_values);
        out
    }

    fn is_profiled(&self, u: &Unknown) -> bool {
        let is_jump = self.asked.search.jumps.contains(&u.name);
        !self.asked.search.settings.quick && (is_jump || self.fit.data.observations.len() <= MOST_PROFILED)
    }

    fn column(&self, i: usize) -> Option<usize> {
        self.fit.free.binary_search(&i).ok()
    }

    /// Variance from noise and priors.
    fn variance(&self, c: usize) -> f64 {
        // of visits that scatter less or more than the weights suppose
        let noise = &self.fit.noise;
        let shown = noise.visits_shown.map(|shown| shown.tau_mm).filter(|tau| *tau > 0.0);
        let more = shown.map_or(0.0, |tau| 1.0 - (noise.tau_mm / tau).powi(2));
        self.weighted_variance(c) + more * self.by_visits[c]
    }

    /// The same if visits scattered as the weights suppose.
    fn weighted_variance(&self, c: usize) -> f64 {
        self.fit.covariance[(self.fit.free[c], self.fit.free[c])]
    }

    /// What of it the priors make.
    fn prior_variance(&self, c: usize) -> f64 {
        let of = |&(j, _, sigma): &(usize, f64, f64)| (self.fit.covariance[(self.fit.free[c], j)] / sigma).powi(2);
        self.fit.priors.iter().map(of).sum()
    }

    /// Variance that counts beside noise and priors.
    fn other_variance(&self, c: usize) -> f64 {
        self.by_type_b[c] + self.moves[c] * self.moves[c]
    }

    /// The 95 % factor.
    fn coverage(&self, c: usize) -> f64 {
        let all = self.variance(c) + self.other_variance(c);
        let share = if all > 0.0 { self.by_visits[c] / all } else { 0.0 };
        self.fit.noise.coverage(share.clamp(0.0, 1.0))
    }

    /// It leaves no trace, or follows what leaves none by more than its uncertainty.
    fn is_unseen(&self, c: usize) -> bool {
        let part = self.fit.observability.unseen.iter().map(|v| v[c].abs()).fold(0.0, f64::max);
        part > 1e-6 || !self.variance(c).is_finite() || self.moves[c] * self.moves[c] > self.variance(c)
    }

    /// It may be much else beside another value of a shape.
    fn is_lost(&self, i: usize) -> bool {
        !self.fit.model.unknowns[i].shape
            && self.intervals.get(&i) == Some(&[None, None])
            && self.column(i).is_some_and(|c| !self.is_unseen(c))
    }

    /// The interval of a shape with an end that the touches do not set.
    fn open(&self, i: usize) -> Option<Ends> {
        let ends = self.intervals.get(&i).filter(|_| self.fit.model.unknowns[i].shape)?;
        ends.contains(&None).then_some(*ends)
    }

    /// The interval of a moment at which something jumps.
    fn jump(&self, i: usize) -> Option<[f64; 2]> {
        let is_jump = self.asked.search.jumps.contains(&self.fit.model.unknowns[i].name);
        let [low, high] = self.intervals.get(&i).filter(|_| is_jump)?;
        Some([(*low)?, (*high)?])
    }

    /// Where a shape is not determined, a set with a size that no machine has does not determine its other sizes either.
    fn is_beside_a_size_of_no_machine(&self, i: usize) -> bool {
        let unknowns = &self.fit.model.unknowns;
        let u = &unknowns[i];
        let mut set = (0..unknowns.len()).filter(|&k| unknowns[k].effect == u.effect && unknowns[k].set_up == u.set_up);
        let is_determined =
            |k: usize| self.column(k).is_some_and(|c| !self.is_unseen(c)) || self.intervals.contains_key(&k);
        set.clone().any(|k| unknowns[k].shape && !is_determined(k)) && set.any(|k| is_far(self.fit, k))
    }

    fn status(&self, i: usize) -> Status {
        let u = &self.fit.model.unknowns[i];
        let search = self.asked.search;
        match self.column(i) {
            None if self.jump(i).is_some() => Status::Identified,
            None if search.jumps.contains(&u.name) || search.held.contains(&u.name) => Status::Undetermined,
            None => Status::Fixed,
            Some(c) if self.is_unseen(c) || self.is_lost(i) || self.open(i).is_some() => Status::Undetermined,
            Some(_) if self.is_beside_a_size_of_no_machine(i) || self.other_values.contains_key(&i) => {
                Status::Undetermined
            }
            // the value is that of priors, its own or those of others, rather than the touches'
            Some(c) if self.prior_variance(c) > 0.5 * self.variance(c) => Status::PriorDominated,
            Some(_) => Status::Identified,
        }
    }

    fn parameter(&self, i: usize, status: Status) -> Parameter {
        let (fit, u) = (self.fit, &self.fit.model.unknowns[i]);
        let value = fit.theta[i];
        let known = self.column(i).filter(|_| matches!(status, Status::Identified | Status::PriorDominated));
        let linear = known.map(|c| ((self.variance(c) + self.other_variance(c)).sqrt(), self.coverage(c)));
        let usual = linear.map(|(sigma, k)| sigma * k);
        // ends of the noise's interval, with all else that is counted
        let widened = known.zip(linear).and_then(|(c, (_, k))| {
            let more = k * self.other_variance(c).sqrt();
            let with = |end: f64| value + (end - value).hypot(more).copysign(end - value);
            self.intervals.get(&i).map(|ends| ends.map(|end| end.map(with)))
        });
        let of_a_jump = self.jump(i).map(|ends| ends.map(Some));
        // what is not determined may still have a bound on one side
        let bound = self
            .open(i)
            .filter(|ends| *ends != [None, None])
            .or_else(|| self.other_values.get(&i).and(self.intervals.get(&i).copied()));
        let interval = widened.or(of_a_jump);
        let range = nonlinear_scan::range_of(u, self.asked.effects);
        let widest = |ends: Ends| {
            let side = |k: usize| ends[k].or(range.map(|r| r[k])).map_or(0.0, |end| (end - value).abs());
            side(0).max(side(1))
        };
        let expanded = interval.map(widest).or(usual);
        // where the likelihood is much wider than a line through the solution says, so is the standard uncertainty
        let sigma = match (linear, expanded, self.jump(i)) {
            (Some((sigma, k)), Some(e), _) if e > MUCH_WIDER * sigma * k => Some(e / k),
            (Some((sigma, _)), ..) => Some(sigma),
            (None, _, jump) => jump.map(|ends| off_a_moment(value, ends)),
        };
        let with_unmodelled = known.zip(self.unmodelled.as_ref()).zip(sigma).map(|((c, all), s)| {
            // what counts beside the noise counts here, too
            let by_more_visits = self.variance(c) - self.weighted_variance(c);
            (all.sigma[c] * all.sigma[c] + by_more_visits + (s * s - self.variance(c)).max(self.by_type_b[c]))
                .max(s * s)
                .sqrt()
        });
        let interval = interval.or(bound).filter(|ends| u.shape || is_uneven(value, *ends, usual));
        Parameter {
            name: u.name.clone(),
            alias: u.alias.clone(),
            effect: u.effect.clone(),
            value,
            unit: u.unit.clone(),
            sigma,
            expanded,
            interval,
            sigma_noise: known.map(|c| (self.variance(c) - self.by_visits[c] - self.prior_variance(c)).max(0.0).sqrt()),
            sigma_type_b: known.filter(|_| self.has_type_b).map(|c| self.by_type_b[c].sqrt()),
            moves_with_unseen: known.map(|c| self.moves[c]).filter(|m| *m > 0.0),
            sigma_with_unmodelled: with_unmodelled.filter(|s| s.is_finite()),
            holds: known.zip(self.unmodelled.as_ref()).map_or_else(Vec::new, |(c, all)| all.holds[c].clone()),
            status,
        }
    }
}

/// By how much the machine's errors in a combination that cannot be determined move the touch that they move most, µm.
fn moves_um(fit: &Fit, combination: &BTreeMap<String, f64>) -> Option<f64> {
    let is_member = |i: &usize| {
        let u = &fit.model.unknowns[*i];
        !u.nuisance && !u.shape && combination.contains_key(&u.name)
    };
    let members: Vec<usize> = (0..fit.theta.len()).filter(is_member).collect();
    if members.is_empty() {
        return None;
    }
    let mut without = fit.theta.clone();
    members.iter().for_each(|&i| without[i] = 0.0);
    let batch = fit.model.prepare(&fit.data.observations);
    let (with, without, mut scratch) = (batch.at(&fit.theta), batch.at(&without), batch.scratch());
    let moved = |i: usize| {
        let at_theta = with.gap(i, &mut scratch);
        (at_theta - without.gap(i, &mut scratch)).abs()
    };
    let used = (0..fit.weight.len()).filter(|&i| fit.weight[i] > 0.0);
    Some(um_from_mm(used.map(moved).fold(0.0, f64::max)))
}

/// Is a size further off than any machine's?
fn is_far(fit: &Fit, i: usize) -> bool {
    let u = &fit.model.unknowns[i];
    !u.shape && !u.nuisance && fit.theta[i].abs() > NOT_CREDIBLE * u.typical
}

/// Is an interval other than the value and its expanded uncertainty on either side, by more than a twentieth?
fn is_uneven(value: f64, [low, high]: Ends, usual: Option<f64>) -> bool {
    let usual = usual.map_or(f64::INFINITY, |e| e * UNEVEN);
    low.is_none_or(|low| value - low > usual) || high.is_none_or(|high| high - value > usual)
}

/// Standard uncertainty of the value of a moment while any moment between two ends may be it: a value at one end is off by more than
/// one in their middle.
fn off_a_moment(value: f64, [low, high]: [f64; 2]) -> f64 {
    let [below, above] = [value - low, high - value];
    ((below * below - below * above + above * above) / 3.0).max(0.0).sqrt()
}

fn residuals(fit: &Fit) -> Vec<Residual> {
    let each = fit.data.observations.iter().enumerate().map(|(i, o)| Residual {
        id: o.id,
        run: o.run + 1,
        residual_um: um_from_mm(fit.residual_mm[i]),
        standardised: fit.studentised[i],
        used: fit.weight[i] > 0.0,
    });
    each.collect()
}

/// What is to be remarked on shapes and on what depends on them.
fn of_shapes(evidence: &Evidence, status: &[Status]) -> Vec<Remark> {
    let (fit, unknowns) = (evidence.fit, &evidence.fit.model.unknowns);
    let names = |which: &dyn Fn(usize) -> bool| -> Vec<String> {
        (0..unknowns.len()).filter(|&i| which(i)).map(|i| unknowns[i].name.clone()).collect()
    };
    let mut out: Vec<Remark> = Vec::new();
    for (&i, others) in &evidence.other_values {
        let u = &unknowns[i];
        out.push(Remark::OtherValues {
            name: u.name.clone(),
            unit: u.unit.clone(),
            value: fit.theta[i],
            others: others.clone(),
        });
    }
    let is_undetermined_shape = |i: usize| unknowns[i].shape && status[i] == Status::Undetermined;
    // without profiles sizes have the uncertainty that they have beside one value of the shape
    for i in (0..unknowns.len()).filter(|&i| is_undetermined_shape(i) && !evidence.is_profiled(&unknowns[i])) {
        let u = &unknowns[i];
        let is_own = |k: usize| unknowns[k].effect == u.effect && unknowns[k].set_up == u.set_up;
        let sizes = names(&|k| is_own(k) && status[k] == Status::Identified);
        if !sizes.is_empty() {
            let (name, unit, value) = (u.name.clone(), u.unit.clone(), fit.theta[i]);
            let quick = evidence.asked.search.settings.quick;
            out.push(Remark::SizesBesideOneValue { name, unit, value, sizes, quick, most_touches: MOST_PROFILED });
        }
    }
    let results = names(&|i| !unknowns[i].nuisance && evidence.is_lost(i));
    if !results.is_empty() {
        let n_blocks = (0..unknowns.len()).filter(|&i| unknowns[i].nuisance && evidence.is_lost(i)).count();
        out.push(Remark::LostBesideShapes { shapes: names(&is_undetermined_shape), results, n_blocks });
    }
    out
}

/// What cannot be determined and no other remark names.
fn not_mentioned(outcome: &Outcome, remarks: &[Remark]) -> Option<Remark> {
    let mentioned: BTreeSet<&str> = remarks.iter().flat_map(Remark::names).collect();
    let in_a_combination = |name: &str| outcome.undetermined.iter().any(|u| u.combination.contains_key(name));
    let is_missing = |p: &&Parameter| {
        p.status == Status::Undetermined
            && !p.name.contains('@')
            && !mentioned.contains(p.name.as_str())
            && !in_a_combination(&p.name)
    };
    let names: Vec<String> = outcome.parameters.iter().filter(is_missing).map(|p| p.name.clone()).collect();
    (!names.is_empty()).then_some(Remark::NotDetermined { names })
}

/// What is to be remarked on data, noise, outliers and misfit.
fn of_the_fit(fit: &Fit, asked: &Asked, solution: &Solution) -> Vec<Remark> {
    let (effects, settings) = (asked.effects, &asked.search.settings);
    let mut out = Vec::new();
    if fit.data.observations.iter().all(|o| !o.has_temperature) {
        let with_t = effects.iter().filter(|e| e.terms.iter().any(|t| t.formula.variables().contains(&"T")));
        out.extend(with_t.map(|e| Remark::NoTemperature { effect: e.id.clone() }));
    }
    out.extend(fit.data.temperature_gap.map(Remark::TemperatureGap));
    let far = fit.free.iter().filter(|&&i| is_far(fit, i));
    out.extend(far.map(|&i| Remark::NotCredible { name: fit.model.unknowns[i].name.clone(), times: NOT_CREDIBLE }));
    let moves = uncertainty::moves_with_unseen(fit);
    for (c, &i) in fit.free.iter().enumerate() {
        let is_straight = fit.observability.unseen.iter().all(|v| v[c].abs() <= 1e-6);
        let u = &fit.model.unknowns[i];
        if is_straight && !u.nuisance && moves[c] * moves[c] > fit.covariance[(i, i)] {
            out.push(Remark::FollowsUnseen { name: u.name.clone(), meaning: null_space::meaning(u, effects) });
        }
    }
    if !solution.converged {
        out.push(Remark::NotConverged { stopped: solution.stopped.clone() });
    }
    if fit.dof == 0 {
        out.push(Remark::NoRedundancy);
    }
    let n = fit.data.observations.len();
    if n > uncertainty::MOST_UNMODELLED {
        out.push(Remark::UnmodelledNotCounted { most_touches: uncertainty::MOST_UNMODELLED });
    }
    if let Some(s) = &fit.data.supposed {
        out.push(Remark::SetUpMistake { far: s.far, of: s.of, right: s.right, mistake: s.mistake.clone() });
    }
    let excluded = fit.rejected.values().filter(|r| r.is_outlier()).count();
    if let Some(found) = fit.outliers_beyond {
        out.push(Remark::OutliersBeyond { found, of: n, excluded });
    } else if excluded as f64 > outliers::MOST_SHARE * n as f64 {
        out.push(Remark::ManyOutliers { excluded, of: n });
    }
    out.extend(fit.noise.remarks());
    let contradictions = contradictions::contradictions(fit, asked);
    // what is stated wrongly is no fault of the model
    let chi2 = fit.chi2 - contradictions.iter().map(|c| c.chi2).sum::<f64>();
    let dof = fit.dof.saturating_sub(contradictions.len());
    out.extend(contradictions.into_iter().map(Remark::Contradiction));
    let limit = fit.noise.limit(fit.dof);
    if fit.dof > 0 && fit.chi2 > limit * fit.dof as f64 && (dof == 0 || chi2 > limit * dof as f64) {
        let times = (fit.chi2 / fit.dof as f64).sqrt();
        let with_type_b = !settings.type_b.is_empty();
        out.push(Remark::Misfit { times, with_type_b, noise: Box::new(fit.noise) });
    }
    out.extend(fit.noise.far_too_large(fit.chi2, fit.dof));
    out
}

#[cfg(test)]
mod tests {
    #[test]
    fn a_moment_at_an_end_is_twice_as_uncertain_as_one_in_the_middle() {
        let off = |value| super::off_a_moment(value, [1.0, 1.6]);
        assert!((off(1.3) - 0.6 / 12f64.sqrt()).abs() < 1e-12);
        assert!((off(1.6) - 2.0 * off(1.3)).abs() < 1e-12);
        // by numbers: the mean of squares over a thousand moments
        let n = 1000;
        let square = |k: usize| (1.1 - (1.0 + 0.6 * (k as f64 + 0.5) / n as f64)).powi(2);
        let mean = (0..n).map(square).sum::<f64>() / n as f64;
        assert!((off(1.1) - mean.sqrt()).abs() < 1e-6, "{} {}", off(1.1), mean.sqrt());
    }
}
