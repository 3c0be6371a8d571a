//! The answer of a fit, put together: values with their doubt, what cannot be told, what a reader must not miss.

use super::outcome::{Combination, FORMAT, Outcome, Parameter, Rejected, Residual, Status, TypeBRow};
use super::shapes::NOT_CREDIBLE;
use super::solve::{Problem as _, Solution};
use super::type_b::TypeB;
use super::{Fit, Settings, contradictions, held_out, profile, snoop, statement, uncertainty, weak};
use crate::machine::Machine;
use crate::model::catalogue::Effect;
use crate::model::data::UnusableReason;
use crate::model::predict::Unknown;
use crate::units::{significant, um_from_mm};
use nalgebra::DVector;
use std::collections::{BTreeMap, BTreeSet};

/// Sides of an interval that differ from the usual one by more than a twentieth are shown.
const UNEVEN: f64 = 1.05;

/// And one that is wider by this is no longer that of a standard uncertainty that holds near the solution.
const MUCH_WIDER: f64 = 1.5;

/// Other values of a shape parameter that are named.
const NAMED: usize = 3;

/// With more touches a shape parameter is known so well that its doubt is the same on both sides. A moment at which something jumps has no
/// other than that of its profile.
const MOST_PROFILED: usize = 20_000;

/// The answer, and other values of shape parameters that fit about as well, by unknown.
pub(super) fn outcome(
    fit: &Fit,
    machine: &Machine,
    effects: &[&Effect],
    settings: &Settings,
    (solution, condition): (&Solution, f64),
    (type_b, left_out): (&[TypeB], Option<uncertainty::LeftOut>),
) -> (Outcome, BTreeMap<usize, Vec<f64>>) {
    let (n, n_used) = (fit.data.observations.len(), fit.n_used());
    let p = fit.free.len();
    let by_visits = uncertainty::visit_variance(fit);
    let shapes_told = !settings.quick && n <= MOST_PROFILED;
    let many = n > uncertainty::MOST_UNMODELLED;
    let (unmodelled, (held_out_rms_um, weak)) = if settings.quick || settings.bare {
        (None, (None, Vec::new()))
    } else {
        fit.with_touches(fit.noise.tau_mm, |touches| {
            let beside = || {
                let normal = touches.normal(&fit.free_theta(), true);
                let weak = if many { Vec::new() } else { weak::weak(fit, effects, &normal.gram) };
                (held_out::by_visit_of(fit, touches, normal).map(|h| h.rms_um), weak)
            };
            rayon::join(|| left_out.map(|all| uncertainty::with_unmodelled(fit, touches, all)), beside)
        })
    };
    let noise_variance = |c: usize| fit.covariance[(fit.free[c], fit.free[c])];
    // what the scatter of the priors makes of it
    let prior_variance = |c: usize| {
        let of = |&(j, _, sigma): &(usize, f64, f64)| (fit.covariance[(fit.free[c], j)] / sigma).powi(2);
        fit.priors.iter().map(of).sum::<f64>()
    };
    let b_variance = DVector::from_fn(p, |c, _| type_b.iter().map(|row| row.makes[c] * row.makes[c]).sum::<f64>());
    let moves = uncertainty::moves_with_unseen(fit);
    let unseen = |c: usize| fit.observability.unseen.iter().map(|v| v[c].abs()).fold(0.0, f64::max);
    let factor = |c: usize| {
        let s2 = noise_variance(c) + b_variance[c] + moves[c] * moves[c];
        let share = if s2 > 0.0 { by_visits[c] / s2 } else { 0.0 };
        fit.noise.coverage(share.clamp(0.0, 1.0))
    };
    // it leaves no trace, or follows what is not known by more than its uncertainty
    let untold =
        |c: usize| unseen(c) > 1e-6 || !noise_variance(c).is_finite() || moves[c] * moves[c] > noise_variance(c);
    let spread = |i: usize| {
        let c = fit.free.binary_search(&i).ok().filter(|&c| !untold(c))?;
        Some((noise_variance(c).sqrt(), factor(c)))
    };
    let profiled = |u: &Unknown| shapes_told || !settings.quick && settings.jumps.contains(&u.name);
    let intervals = profile::intervals(fit, machine, effects, settings, (&profiled, &spread));
    let profile::Intervals { ends: intervals, other_values, lost_beside } = intervals;
    // sizes beside a shape that nobody knows
    let runs_along = |i: usize| !fit.model.unknowns[i].shape && intervals.get(&i) == Some(&[None, None]);
    // a time constant that may as well be endless is none that is told
    let open = |i: usize| {
        let ends = intervals.get(&i).filter(|_| fit.model.unknowns[i].shape);
        ends.filter(|[low, high]| low.is_none() || high.is_none()).copied()
    };
    // where a shape may as well have another value, what goes with it by more than its own uncertainty is not told either
    let goes_with = |c: usize| {
        const FAR: f64 = 2.0;
        let i = fit.free[c];
        let usual = factor(c) * noise_variance(c).sqrt();
        let far = |end: Option<f64>| end.is_none_or(|end| (end - fit.theta[i]).abs() > FAR * usual);
        !other_values.is_empty() && intervals.get(&i).is_some_and(|ends| ends.iter().any(|end| far(*end)))
    };
    // where a shape is not told, a set with a size that no machine has says nothing of its other sizes either
    let sets_of = |which: &dyn Fn(usize) -> bool| -> BTreeSet<(&str, Option<usize>)> {
        let all = (0..fit.theta.len()).filter(|&i| which(i)).map(|i| &fit.model.unknowns[i]);
        all.map(|u| (u.effect.as_str(), u.set_up)).collect()
    };
    let far = sets_of(&|i| !fit.model.unknowns[i].nuisance && !fit.model.unknowns[i].shape && is_far(fit, i));
    let told = |i: usize| fit.free.binary_search(&i).is_ok_and(|c| !untold(c)) || intervals.contains_key(&i);
    let adrift = sets_of(&|i| fit.model.unknowns[i].shape && !told(i));
    let nowhere = |i: usize| {
        let u = &fit.model.unknowns[i];
        let set = (u.effect.as_str(), u.set_up);
        far.contains(&set) && adrift.contains(&set)
    };
    let parameters: Vec<Parameter> = (0..fit.theta.len())
        .map(|i| {
            let u = &fit.model.unknowns[i];
            let column = fit.free.binary_search(&i).ok();
            let jumps = settings.jumps.contains(&u.name);
            let jump = intervals.get(&i).filter(|_| jumps).and_then(|[low, high]| Some([(*low)?, (*high)?]));
            let status = match column {
                None if jump.is_some() => Status::Identified,
                None if jumps || settings.held.contains(&u.name) => Status::Undetermined,
                None => Status::Fixed,
                Some(c) if untold(c) || runs_along(i) || open(i).is_some() || goes_with(c) || nowhere(i) => {
                    Status::Undetermined
                }
                // most of its variance is that of priors, its own or those of others: the value is theirs rather than the touches'
                Some(c) if prior_variance(c) > 0.5 * noise_variance(c) => Status::PriorDominated,
                _ => Status::Identified,
            };
            let known = column.filter(|_| matches!(status, Status::Identified | Status::PriorDominated));
            let sigma = known.map(|c| (noise_variance(c) + b_variance[c] + moves[c] * moves[c]).sqrt());
            let factor = known.map(factor);
            let usual = sigma.zip(factor).map(|(s, k)| s * k);
            let sigma = sigma.or(jump.map(|ends| off_a_moment(fit.theta[i], ends)));
            // the ends are those of the noise's interval, with all else that is counted
            let interval = known.zip(factor).and_then(|(c, k)| {
                let more = k * (b_variance[c] + moves[c] * moves[c]).sqrt();
                let with = |end: f64| fit.theta[i] + (end - fit.theta[i]).hypot(more).copysign(end - fit.theta[i]);
                intervals.get(&i).map(|ends| ends.map(|end| end.map(with)))
            });
            let one_sided = open(i).filter(|ends| *ends != [None, None]);
            let bare = one_sided.or_else(|| other_values.get(&i).and(intervals.get(&i).copied()));
            let interval = interval.or(jump.map(|ends| ends.map(Some))).or(bare);
            // an end that the touches do not set is that of the range
            let own = u.name.split('@').next().unwrap_or_default();
            let range = effects.iter().flat_map(|e| &e.parameters).find(|p| p.name == own).and_then(|p| p.shape);
            let wider = |[low, high]: [Option<f64>; 2]| {
                let (low, high) = (low.or(range.map(|r| r.1)), high.or(range.map(|r| r.2)));
                let side = |end: Option<f64>| end.map_or(0.0, |end| (end - fit.theta[i]).abs());
                side(low).max(side(high))
            };
            let expanded = interval.filter(|_| bare.is_none()).map(wider).or(usual);
            // where the likelihood is much wider than a line through the solution says, so is the standard uncertainty
            let by_profile =
                expanded.zip(factor).filter(|(e, _)| usual.is_some_and(|u| *e > MUCH_WIDER * u)).map(|(e, k)| e / k);
            let sigma = by_profile.or(sigma);
            let interval = interval.filter(|[low, high]| u.shape || uneven(fit.theta[i], *low, *high, usual));
            Parameter {
                name: u.name.clone(),
                alias: u.alias.clone(),
                effect: u.effect.clone(),
                value: fit.theta[i],
                unit: u.unit.clone(),
                sigma,
                expanded,
                interval,
                sigma_noise: known.map(|c| (noise_variance(c) - by_visits[c] - prior_variance(c)).max(0.0).sqrt()),
                sigma_type_b: known.filter(|_| !type_b.is_empty()).map(|c| b_variance[c].sqrt()),
                moves_with_unseen: known.map(|c| moves[c]).filter(|m| *m > 0.0),
                sigma_with_unmodelled: known
                    .zip(unmodelled.as_ref())
                    .zip(sigma)
                    // what counts beside the noise counts here, too: the other values of a shape, what is not seen
                    .map(|((c, all), s)| {
                        (all.sigma[c] * all.sigma[c] + (s * s - noise_variance(c)).max(b_variance[c])).sqrt()
                    })
                    .filter(|s| s.is_finite()),
                holds: known.zip(unmodelled.as_ref()).map_or_else(Vec::new, |(c, all)| all.holds[c].clone()),
                status,
            }
        })
        .collect();
    let beside: Vec<Status> = parameters.iter().map(|p| p.status).collect();
    let is_lost = |i: usize| runs_along(i) && fit.free.binary_search(&i).is_ok_and(|c| !untold(c));
    let lost: Vec<&str> =
        (0..fit.theta.len()).filter(|&i| is_lost(i)).map(|i| fit.model.unknowns[i].name.as_str()).collect();
    let free_unknowns: Vec<&Unknown> = fit.free.iter().map(|&i| &fit.model.unknowns[i]).collect();
    let squares: f64 = fit.residual_mm.iter().zip(&fit.weight).map(|(r, w)| w * r * r).sum();
    let chi2_per_dof = if fit.dof > 0 { fit.chi2 / fit.dof as f64 } else { f64::NAN };
    let unusable = fit.data.unusable.iter().map(|u| Rejected {
        id: u.id,
        run: u.run + 1,
        reason: format!("{} (line {})", crate::words::log::unusable(&u.reason), u.line),
        is_far: u.reason == UnusableReason::FarFromPlan,
    });
    let strangers = fit.rejected.iter().map(|(&i, reason)| {
        let o = &fit.data.observations[i];
        Rejected { id: o.id, run: o.run + 1, reason: reason.clone(), is_far: false }
    });
    let mut outcome = Outcome {
        format: FORMAT.into(),
        machine: machine.name.clone(),
        effects: settings.effects.clone(),
        converged: solution.converged,
        iterations: solution.iterations,
        stopped: solution.stopped.clone(),
        touches: n + fit.data.unusable.len(),
        rejected: unusable.chain(strangers).collect(),
        unknowns: p,
        rank: fit.observability.rank,
        dof: fit.dof,
        condition,
        rms_um: um_from_mm((squares / n_used.max(1) as f64).sqrt()),
        held_out_rms_um,
        noise_um: um_from_mm(fit.noise.sigma_mm),
        noise_source: fit.noise.source.into(),
        noise_dof: fit.noise.dof,
        visit_dof: fit.noise.visit_dof,
        visit_um: um_from_mm(fit.noise.tau_mm),
        visit_source: fit.noise.visit_source.into(),
        noise_says: fit.noise.says(),
        chi2_per_dof,
        undetermined: statement::undetermined(&free_unknowns, effects, &fit.observability.unseen, &fit.observability),
        parted_together: Vec::new(),
        // how badly what is lost beside a shape is told, nobody knows: a warning names it
        weak: weak.into_iter().filter(|c| !mostly(c, |name| lost.contains(name))).collect(),
        correlations: weak::correlations(fit, |i| parameters[i].sigma.is_some()),
        parameters,
        priors: uncertainty::priors(fit),
        type_b: type_b
            .iter()
            .map(|b| TypeBRow { name: b.name.clone(), sigma: b.sigma, unit: b.unit.clone() })
            .collect(),
        reference_mm: fit.model.reference.into(),
        covariance: None,
        covariance_type_a: None,
        residuals: Some(residuals(fit)),
        warnings: [
            warnings(fit, machine, effects, settings, (solution, chi2_per_dof)),
            other_values
                .iter()
                .map(|(&i, values)| may_be_another(&fit.model.unknowns[i], fit.theta[i], values))
                .collect(),
            beside_a_shape_that_is_not_told(fit, &beside, settings.quick, profiled),
            much_else(fit, &beside, &lost_beside, is_lost).into_iter().collect(),
            type_b.iter().filter_map(|b| b.warning.clone()).collect(),
            unmodelled.map(|all| all.left_out).unwrap_or_default(),
        ]
        .concat(),
    };
    outcome.warnings.extend(unnamed(&outcome));
    for i in 0..outcome.undetermined.len() {
        outcome.undetermined[i].moves_um = moves_um(fit, &outcome, i);
    }
    (outcome, other_values)
}

/// By how much the machine's errors in a combination that is not told move the touch that they move most, µm: what is seen of
/// it stands in the values of those that are not held at 0.
fn moves_um(fit: &Fit, outcome: &Outcome, which: usize) -> Option<f64> {
    let combination = &outcome.undetermined[which].combination;
    let member = |i: &usize| {
        let u = &fit.model.unknowns[*i];
        !u.nuisance && !u.shape && combination.contains_key(&u.name)
    };
    let members: Vec<usize> = (0..fit.theta.len()).filter(member).collect();
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

/// Is a value further off than any machine's?
fn is_far(fit: &Fit, i: usize) -> bool {
    fit.theta[i].abs() > NOT_CREDIBLE * fit.model.unknowns[i].typical
}

/// What is not told and stands in no other sentence.
fn unnamed(outcome: &Outcome) -> Option<String> {
    let said = |name: &str| {
        let word = |c: char| !(c.is_alphanumeric() || c == '_');
        outcome.undetermined.iter().any(|u| u.combination.contains_key(name))
            || outcome.warnings.iter().any(|w| w.split(word).any(|w| w == name))
    };
    let of = |p: &&Parameter| p.status == Status::Undetermined && !p.name.contains('@') && !said(&p.name);
    let names: Vec<&str> = outcome.parameters.iter().filter(of).map(|p| p.name.as_str()).collect();
    (!names.is_empty())
        .then(|| format!("not told: {}. Beside what these touches do not tell they may be much else", names.join(", ")))
}

/// Is an interval other than the value and so many standard uncertainties on either side, by more than a twentieth?
fn uneven(value: f64, low: Option<f64>, high: Option<f64>, usual: Option<f64>) -> bool {
    let usual = usual.map_or(f64::INFINITY, |e| e * UNEVEN);
    low.is_none_or(|low| value - low > usual) || high.is_none_or(|high| high - value > usual)
}

/// Without profiles sizes have the doubt that they have where the shape stands.
fn beside_a_shape_that_is_not_told(
    fit: &Fit,
    status: &[Status],
    quick: bool,
    profiled: impl Fn(&Unknown) -> bool,
) -> Vec<String> {
    let unknowns = &fit.model.unknowns;
    let untold = (0..unknowns.len())
        .filter(|&i| unknowns[i].shape && status[i] == Status::Undetermined && !profiled(&unknowns[i]));
    let more = if quick {
        "`axiscal identify` works out all that it may be".to_owned()
    } else {
        format!("beside its other values it is worked out for up to {MOST_PROFILED} touches only")
    };
    let says = untold.filter_map(|i| {
        let u = &unknowns[i];
        let size = |k: &usize| {
            unknowns[*k].effect == u.effect && unknowns[*k].set_up == u.set_up && status[*k] == Status::Identified
        };
        let sizes: Vec<&str> = (0..unknowns.len()).filter(size).map(|k| unknowns[k].name.as_str()).collect();
        (!sizes.is_empty()).then(|| {
            format!(
                "{} is not told: the doubt of {} is what it is beside {} {}, and {more}",
                u.name,
                sizes.join(", "),
                significant(fit.theta[i], 4),
                u.unit
            )
        })
    });
    says.collect()
}

/// Standard uncertainty of the value of a moment while any moment between two ends may be it: a value at one end is off by more than
/// one in their middle.
fn off_a_moment(value: f64, [low, high]: [f64; 2]) -> f64 {
    let [below, above] = [value - low, high - value];
    ((below * below - below * above + above * above) / 3.0).max(0.0).sqrt()
}

/// What is not told only because a shape is not: leaving that effect out brings it back.
fn much_else(
    fit: &Fit,
    status: &[Status],
    beside: &BTreeMap<usize, BTreeSet<usize>>,
    lost: impl Fn(usize) -> bool,
) -> Option<String> {
    let unknowns = &fit.model.unknowns;
    let names = |which: &dyn Fn(usize) -> bool| {
        let all: Vec<&str> = (0..unknowns.len()).filter(|&i| which(i)).map(|i| unknowns[i].name.as_str()).collect();
        all.join(", ")
    };
    let results = names(&|i| !unknowns[i].nuisance && lost(i));
    let of_results = beside.iter().filter(|(i, _)| !unknowns[**i].nuisance && lost(**i));
    let known: BTreeSet<usize> = of_results.flat_map(|(_, shapes)| shapes.iter().copied()).collect();
    // what runs along with the end of a range does so with a shape that is held there
    let untold = |i: usize| unknowns[i].shape && status[i] == Status::Undetermined;
    let shapes = names(&|i| if known.is_empty() { untold(i) } else { known.contains(&i) });
    // they are many, and all of one kind
    let blocks = match (0..unknowns.len()).filter(|&i| unknowns[i].nuisance && lost(i)).count() {
        0 => String::new(),
        n => format!(", and {n} numbers of where the blocks stand"),
    };
    (!results.is_empty()).then(|| {
        format!(
            "not told beside {shapes}: {results}{blocks}. Beside some of its values, which these touches allow, they may be much else. Leave the effect out of the model where nothing needs it, or hold {shapes} at what is known of the machine"
        )
    })
}

/// Does more than half of a combination consist of such parameters?
fn mostly(combination: &Combination, of: impl Fn(&&str) -> bool) -> bool {
    let share = combination.combination.iter().filter(|(name, _)| of(&name.as_str())).map(|(_, w)| w * w).sum::<f64>();
    share > 0.5 * combination.combination.values().map(|w| w * w).sum::<f64>()
}

/// That a shape parameter may as well have other values, in words.
fn may_be_another(u: &Unknown, value: f64, others: &[f64]) -> String {
    let shown = |v: f64| significant(v, 4);
    let others: Vec<String> = others.iter().take(NAMED).map(|v| shown(*v)).collect();
    format!(
        "{} is not told: {} {} fits best, and {} about as well; what depends on it is as unsure. Touches at more positions would tell, or hold it at what is known of the machine (`value` and `fixed = true` or `sigma`, [model.parameters])",
        u.name,
        shown(value),
        u.unit,
        others.join(" or ")
    )
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

fn warnings(
    fit: &Fit,
    machine: &Machine,
    effects: &[&Effect],
    settings: &Settings,
    (solution, chi2_per_dof): (&Solution, f64),
) -> Vec<String> {
    let mut out = Vec::new();
    if fit.data.observations.iter().all(|o| !o.has_temperature) {
        for effect in effects.iter().filter(|e| e.terms.iter().any(|t| t.formula.variables().contains(&"T"))) {
            out.push(format!("effect {} goes with the temperature T, and no touch carries one", effect.id));
        }
    }
    out.extend(fit.data.temperature_says.clone());
    let far = |i: usize| !fit.model.unknowns[i].shape && !fit.model.unknowns[i].nuisance && is_far(fit, i);
    for &i in fit.free.iter().filter(|&&i| far(i)) {
        out.push(format!(
            "{} is more than {NOT_CREDIBLE} times its usual size: no machine is like that; is the plan, a unit or a sign wrong, or does a combination of the model leave hardly a trace?",
            fit.model.unknowns[i].name
        ));
    }
    let moves = uncertainty::moves_with_unseen(fit);
    for (c, &i) in fit.free.iter().enumerate() {
        let straight = fit.observability.unseen.iter().all(|v| v[c].abs() <= 1e-6);
        let u = &fit.model.unknowns[i];
        if straight && !u.nuisance && moves[c] * moves[c] > fit.covariance[(i, i)] {
            out.push(format!(
                "{} follows what these touches cannot tell by more than its own uncertainty, and is not determined either",
                statement::meaning(u, effects)
            ));
        }
    }
    if !solution.converged {
        out.push(format!("the search did not converge: {}", solution.stopped));
    }
    if fit.dof == 0 {
        out.push("as many unknowns as touches: nothing is left over to judge the model by".into());
    }
    if fit.data.observations.len() > uncertainty::MOST_UNMODELLED {
        out.push(format!(
            "what unmodelled effects may add is worked out for up to {} touches only",
            uncertainty::MOST_UNMODELLED
        ));
    }
    if let Some(s) = &fit.data.supposed {
        out.push(format!(
            "{} of {} touches are far from their places; {} would be right if {}: put that right first, these values are of the touches that happen to stand where the plan has them",
            s.far, s.of, s.right, s.says
        ));
    }
    let n_out = fit.rejected.values().filter(|r| !r.starts_with("taken out")).count();
    let n = fit.data.observations.len();
    let share = |count: usize| 100.0 * count as f64 / n.max(1) as f64;
    if let Some(found) = fit.strangers_beyond {
        out.push(format!(
            "a robust fit finds {found} of {n} touches ({:.1} %) that do not belong to the rest, and without them the others still do not agree: {} left out (removal stops at {:.0} %), and the values and their uncertainties are not to be trusted; look for dirt, a loose block or stylus, or an effect that the model lacks",
            share(found),
            match n_out {
                0 => "none is".into(),
                1 => "only 1 is".into(),
                n => format!("only {n} are"),
            },
            100.0 * snoop::MOST_SHARE
        ));
    } else if n_out as f64 > snoop::MOST_SHARE * n as f64 {
        out.push(format!(
            "{n_out} of {n} touches ({:.1} %) do not belong to the rest and are left out; more than {:.0} % is a finding in itself: chips, a loose block or stylus, or an effect that the model lacks; look at them before you trust the values",
            share(n_out),
            100.0 * snoop::MOST_SHARE
        ));
    }
    out.extend(fit.noise.contradiction());
    out.extend(fit.noise.contradiction_of_visits());
    out.extend(fit.noise.visits_beyond());
    out.extend(fit.noise.coarse());
    let contradictions = contradictions::contradictions(fit, machine, effects, settings);
    // what is stated wrongly is no fault of the model
    let chi2 = fit.chi2 - contradictions.iter().map(|c| c.chi2).sum::<f64>();
    let dof = fit.dof.saturating_sub(contradictions.len());
    out.extend(contradictions.into_iter().map(|c| c.says));
    let limit = fit.noise.limit(fit.dof);
    if fit.dof > 0 && chi2_per_dof > limit && (dof == 0 || chi2 > limit * dof as f64) {
        out.push(format!(
            "the touches miss the model by {}: something is missing in it, and the uncertainties count {} only (`axiscal diagnose` looks for it){}",
            fit.noise.times(chi2_per_dof.sqrt()),
            if fit.type_b.is_empty() { "the noise" } else { "the noise and the type B rows" },
            fit.noise.or_the_probe(chi2_per_dof.sqrt()).map_or_else(String::new, |or| format!("; {or}"))
        ));
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
