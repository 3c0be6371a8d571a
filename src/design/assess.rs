//! What a plan will be able to tell, before the first touch.

use super::explain::{Remedy, Results, part};
use super::linearised_plan::{LinearisedPlan, Noise, Planned, Task};
use super::plan_variations::{Variation, variations};
use super::record::{Advice, Assessment, Expected, FORMAT, Seen};
use super::score;
use super::shape_parameters::shapes;
use crate::diag::Result;
use crate::fit::null_space;
use crate::fit::solve::observe;
use crate::fit::span::LeastNorm;
use crate::fit::uncertainty::expected;
use crate::fit::{declared_tau_mm, held_first};
use crate::model::catalogue::Effect;
use crate::search::groups::{ALIGNED, AliasPair, alias_pairs};
use crate::search::power::{Power, power};
use crate::units::um_from_mm;
use nalgebra::{DMatrix, DVector};
use std::collections::BTreeSet;

/// Noncentrality at typical size from which on a variation is said to show an effect well.
const SHOWN: f64 = 4.0;

/// Parameters that take less of an invisible effect than this share of the largest are not named.
const WORTH_NAMING: f64 = 0.05;

/// Variations that are recommended at most.
const MOST_ADVICE: usize = 5;

/// What is to be assessed.
#[derive(Debug, Clone)]
pub struct Request<'a> {
    /// Machine and model.
    pub task: Task<'a>,
    /// The runs in their order.
    pub runs: Vec<Planned>,
    /// Their names, for the answer.
    pub names: Vec<String>,
    /// The noise of which alone the first uncertainty speaks.
    pub probe: Noise,
    /// Scatter per index visit in which effects must be seen, mm; `None`: as the machine's file declares it.
    pub acting_tau_mm: Option<f64>,
}

/// A variation and what it sees.
struct Tried {
    variation: Variation,
    power: Vec<Power>,
    pairs: Vec<AliasPair>,
    nullity: usize,
    remedy: Option<Remedy>,
}

/// Says what planned runs will be able to tell.
///
/// # Errors
/// When no touch can be used.
pub fn assess(request: &Request) -> Result<Assessment> {
    let task = &request.task;
    let alone = LinearisedPlan::of_model(task, &request.runs, &[], request.probe)?;
    let tau_mm = request.acting_tau_mm.unwrap_or_else(|| declared_tau_mm(task.machine, &alone.data.nominal));
    let acting = Noise { tau_mm, ..request.probe };
    let view = LinearisedPlan::new(task, &request.runs, &[], acting)?;
    let parameters = parameters(task, &alone, &view);
    let mut observability = observe(&alone.jacobian);
    observability.hold(held_first(&alone.model, &alone.free));
    let free: Vec<_> = alone.free.iter().map(|&i| &alone.model.unknowns[i]).collect();
    let mut undetermined = null_space::undetermined(&free, &task.effects, &observability.unseen, &observability);
    // nothing has been fitted yet: no value fits best
    for u in &mut undetermined {
        let only = free.iter().find(|f| f.shape && u.combination.len() == 1 && u.combination.contains_key(&f.name));
        if let Some(shape) = only {
            u.says = format!(
                "{} has no effect on these touches where its effect has its usual size: it cannot be determined",
                null_space::meaning(shape, &task.effects)
            );
        }
    }
    let seen = power(view.base(), &view.library, &|c| view.raw_um[c].clone());
    let pairs = alias_pairs(view.base(), &view.library);
    let nullity = view.jacobian.ncols() - view.base().rank();
    let results = Results::new(&alone.model, &alone.free);
    let tried: Vec<Tried> = variations(task.machine, &request.runs, &view.model)
        .into_iter()
        .map(|variation| {
            let varied = LinearisedPlan::new(task, &variation.runs(&request.runs), &variation.known, acting)?;
            let power = power(varied.base(), &varied.library, &|c| varied.raw_um[c].clone());
            let pairs = alias_pairs(varied.base(), &varied.library);
            // further blocks bring further unknowns: only what was unknown before counts
            let nullity = (varied.jacobian.ncols() - varied.base().rank()).min(nullity);
            let remedy = (!observability.unseen.is_empty()).then(|| Remedy::new(&variation, &varied, &results));
            Ok(Tried { variation, power, pairs, nullity, remedy })
        })
        .collect::<Result<_>>()?;
    let remedies: Vec<Remedy> = tried.iter().filter_map(|t| t.remedy.clone()).collect();
    let together = part(&results.directions(&observability), &remedies, &mut undetermined);
    let absorbed = Absorbed::new(&view);
    let mut effects: Vec<Seen> = Vec::new();
    let warm = |e: &Effect| e.terms.iter().any(|t| t.formula.variables().contains(&"T"));
    let blind = |id: &str| !task.temperature && task.catalogue.get(id, task.machine).is_some_and(warm);
    let left_out = |id: &str| view.left_out.iter().any(|left| left.effect == id);
    for (c, candidate) in view.library.candidates().iter().enumerate().filter(|(_, x)| !left_out(&x.id)) {
        let name = task.catalogue.get(&candidate.id, task.machine).map_or_else(String::new, |e| e.name.clone());
        let id = |other: usize| view.library.candidates()[other].id.clone();
        let p = &seen[c];
        let visible = p.q > 0;
        let of = |both: bool| pairs.iter().filter(move |x| x.explained == c && x.both_ways == both).map(|x| id(x.by));
        let (same_as, contained_in): (Vec<String>, Vec<String>) = (of(true).collect(), of(false).collect());
        let absorbed_by = if visible { Vec::new() } else { absorbed.absorbing(&view, c) };
        let (tell_apart, helps) = if !visible {
            to_show(c, &tried, &view, &absorbed_by, blind(&candidate.id))
        } else {
            to_part(c, &pairs, &tried, &view)
        };
        effects.push(Seen {
            effect: candidate.id.clone(),
            name,
            visible,
            minimal_detectable_um: p.minimal_detectable.filter(|_| visible),
            typical_um: peak_um(&view, c),
            noncentrality: p.at_typical,
            kept: p.kept,
            same_as,
            contained_in,
            absorbed_by,
            tell_apart,
            habits: helps,
        });
    }
    let mut parameters = parameters;
    let of_shapes = shapes(task, &view, &mut parameters);
    for p in &mut parameters {
        // where the lines of two axes miss each other, a turn about the first moves the second in more than one way
        let equal = effects.iter().filter(|e| !e.visible && e.habits.is_empty() && e.absorbed_by.contains(&p.name));
        p.holds = equal.map(|e| e.effect.clone()).collect();
    }
    let groups = groups(&effects);
    let advice = advice(&view, &seen, &pairs, nullity, &tried);
    let mut out = Assessment {
        format: FORMAT.into(),
        machine: task.machine.name.clone(),
        plan: request.names.clone(),
        model: task.effects.iter().map(|e| e.id.clone()).collect(),
        touches: view.n_touches(),
        time_s: view.end_s,
        noise_um: um_from_mm(acting.sigma_mm),
        visit_um: um_from_mm(acting.tau_mm),
        score: super::record::Score::NotEnough,
        says: String::new(),
        unknowns: alone.free.len(),
        rank: observability.rank,
        undetermined,
        parted_together: together.variations,
        never_determined: together.left,
        parameters,
        effects,
        alias_groups: groups,
        alias_pairs: pairs.len(),
        advice,
        compared: Vec::new(),
        warnings: view.left_out.iter().map(crate::fit::candidates::NoValue::left_out).chain(of_shapes).collect(),
    };
    (out.score, out.says) = score::score(&out, task);
    Ok(out)
}

/// Expected uncertainties of the parameters that are results.
fn parameters(task: &Task, alone: &LinearisedPlan, view: &LinearisedPlan) -> Vec<Expected> {
    let seen = observe(&alone.jacobian);
    let sigma = expected(&alone.jacobian, None, &seen);
    let beside: Vec<usize> = view
        .library
        .candidates()
        .iter()
        .filter(|c| task.catalogue.get(&c.id, task.machine).is_none_or(|e| !e.is_repeated() && !e.is_incident()))
        .flat_map(|c| c.variants[0].columns.clone())
        .collect();
    let acting = observe(&view.jacobian);
    let visits = expected(&view.jacobian, None, &acting);
    let with = expected(&view.jacobian, Some(&view.left_out().select_columns(&beside)), &acting);
    alone
        .free
        .iter()
        .enumerate()
        .filter(|(_, i)| !alone.model.unknowns[**i].nuisance)
        .map(|(c, &i)| {
            let u = &alone.model.unknowns[i];
            let told = seen.unseen.iter().all(|v| v[c].abs() <= 1e-6);
            let finite = |x: f64| Some(x).filter(|x| told && x.is_finite());
            Expected {
                name: u.name.clone(),
                alias: u.alias.clone(),
                effect: u.effect.clone(),
                unit: u.unit.clone(),
                sigma: finite(sigma[c]),
                sigma_with_visits: finite(visits[c]),
                sigma_with_unmodelled: finite(with[c]),
                holds: Vec::new(),
            }
        })
        .collect()
}

/// Largest displacement over the touches with every parameter of an effect at its typical size, µm.
fn peak_um(view: &LinearisedPlan, candidate: usize) -> f64 {
    view.raw_um[candidate].row_iter().map(|r| r.norm()).fold(0.0, f64::max)
}

/// Which parameters of the model take an effect that leaves no trace of its own.
struct Absorbed {
    least: LeastNorm,
    norms: Vec<f64>,
}

impl Absorbed {
    fn new(view: &LinearisedPlan) -> Self {
        let mut scaled = view.jacobian.clone();
        let norms: Vec<f64> = scaled
            .column_iter_mut()
            .map(|mut c| {
                let norm = c.norm();
                if norm > 0.0 {
                    c /= norm;
                }
                norm
            })
            .collect();
        Self { least: LeastNorm::new(&scaled, 1e-8), norms }
    }

    /// Names, largest first; the blocks' set-ups are one name.
    fn absorbing(&self, view: &LinearisedPlan, candidate: usize) -> Vec<String> {
        let columns: DMatrix<f64> = view.library.columns(candidate, 0);
        let x = self.least.solve(&columns);
        // in units of what it does to the touches, so that unlike units compare
        let weight: DVector<f64> =
            DVector::from_fn(x.nrows(), |r, _| if self.norms[r] > 0.0 { x.row(r).norm() } else { 0.0 });
        let top = weight.amax();
        let mut order: Vec<usize> =
            (0..weight.len()).filter(|&r| weight[r] > WORTH_NAMING * top && top > 0.0).collect();
        order.sort_by(|a, b| weight[*b].total_cmp(&weight[*a]));
        let mut out: Vec<String> = Vec::new();
        for r in order {
            let u = &view.model.unknowns[view.free[r]];
            let name = if u.set_up.is_some() { SET_UPS.to_owned() } else { u.name.clone() };
            if !out.contains(&name) {
                out.push(name);
            }
        }
        out
    }
}

/// The blocks' set-up among the parameters that take an effect.
const SET_UPS: &str = "the block positions";

fn minutes(seconds: f64) -> String {
    // as the report says it of the same touches
    format!("{:.0} min", (seconds / 60.0).round().max(1.0))
}

/// Touches that make an effect visible.
fn to_show(
    c: usize,
    tried: &[Tried],
    view: &LinearisedPlan,
    absorbed_by: &[String],
    blind: bool,
) -> (String, Vec<String>) {
    let shows = |limit: f64| -> Vec<&Tried> {
        tried.iter().filter(|t| t.power.get(c).is_some_and(|p| p.q > 0 && p.at_typical >= limit)).collect()
    };
    let well = shows(SHOWN);
    let found = if well.is_empty() { shows(0.0) } else { well };
    let why = if blind {
        return (
            "it goes with the temperature, and no touch will carry one: it may act, and these touches cannot show it"
                .into(),
            Vec::new(),
        );
    } else if view.library.columns(c, 0).norm() == 0.0 {
        "nothing that it acts on is touched".to_owned()
    } else if absorbed_by.is_empty() {
        "the model follows it".to_owned()
    } else {
        format!("it looks the same as {}", absorbed_by.join(", "))
    };
    match found.first() {
        Some(first) => {
            let more = found
                .get(1)
                .map_or_else(String::new, |t| format!("; or {} (+{})", t.variation.says, minutes(t.variation.seconds)));
            let says = format!(
                "not observable with this plan: {why}; {} (+{}){more}",
                first.variation.says,
                minutes(first.variation.seconds)
            );
            (says, found.iter().map(|t| t.variation.id.clone()).collect())
        }
        None if absorbed_by.iter().any(|name| name != SET_UPS) => (
            format!(
                "not observable with these or any varied touches: it is one number with {}",
                absorbed_by.join(" and ")
            ),
            Vec::new(),
        ),
        None if view.library.columns(c, 0).norm() == 0.0 => {
            ("these touches cannot be disturbed by it: nothing that it acts on is touched".into(), Vec::new())
        }
        None => {
            (format!("not observable with this plan: {why}; no single variation of the touches shows it"), Vec::new())
        }
    }
}

/// Touches that part an effect from those that it cannot be told from.
fn to_part(c: usize, pairs: &[AliasPair], tried: &[Tried], view: &LinearisedPlan) -> (String, Vec<String>) {
    let others: Vec<usize> = pairs.iter().filter(|p| p.explained == c).map(|p| p.by).collect();
    if others.is_empty() {
        return (String::new(), Vec::new());
    }
    let parted = |t: &Tried| -> Vec<usize> {
        let still = |o: &usize| {
            let explained =
                |a: usize, b: usize| t.pairs.iter().any(|p| p.explained == a && p.by == b && p.share >= ALIGNED);
            let both = pairs.iter().any(|p| p.explained == c && p.by == *o && p.both_ways);
            explained(c, *o) && (!both || explained(*o, c))
        };
        others.iter().copied().filter(|o| !still(o)).collect()
    };
    let mut found: Vec<(usize, &Tried, Vec<usize>)> =
        tried.iter().map(|t| (t, parted(t))).filter(|(_, p)| !p.is_empty()).map(|(t, p)| (p.len(), t, p)).collect();
    if found.is_empty() {
        return ("no single variation of the touches separates them".into(), Vec::new());
    }
    // the cheapest that parts it from all; else the one that parts it from most
    found.sort_by(|a, b| b.0.cmp(&a.0).then(a.1.variation.seconds.total_cmp(&b.1.variation.seconds)));
    let (count, best, from) = &found[0];
    let whom = if *count == others.len() {
        if others.len() == 1 {
            format!("from {}", view.library.candidates()[from[0]].id)
        } else {
            format!("from all {}", others.len())
        }
    } else {
        format!("from {count} of {}", others.len())
    };
    let says = format!("{} (+{}) separates the effect {whom}", best.variation.says, minutes(best.variation.seconds));
    (says, found.iter().map(|f| f.1.variation.id.clone()).collect())
}

/// Effects that are the same both ways, largest group first.
fn groups(effects: &[Seen]) -> Vec<Vec<String>> {
    let mut left: BTreeSet<&str> =
        effects.iter().filter(|e| !e.same_as.is_empty()).map(|e| e.effect.as_str()).collect();
    let mut out: Vec<Vec<String>> = Vec::new();
    while let Some(first) = left.pop_first() {
        let (mut group, mut open) = (vec![first.to_owned()], vec![first.to_owned()]);
        while let Some(id) = open.pop() {
            for other in effects.iter().filter(|e| e.effect == id).flat_map(|e| &e.same_as) {
                if left.remove(other.as_str()) {
                    group.push(other.clone());
                    open.push(other.clone());
                }
            }
        }
        group.sort();
        out.push(group);
    }
    out.sort_by_key(|g| (std::cmp::Reverse(g.len()), g.first().cloned()));
    out
}

/// The variations that bring most for their time.
fn advice(view: &LinearisedPlan, seen: &[Power], pairs: &[AliasPair], nullity: usize, tried: &[Tried]) -> Vec<Advice> {
    let mut out: Vec<(f64, Advice)> = tried
        .iter()
        .filter_map(|t| {
            let shows: Vec<String> = (0..seen.len())
                .filter(|&c| seen[c].q == 0 && t.power.get(c).is_some_and(|p| p.q > 0 && p.at_typical >= SHOWN))
                .map(|c| view.library.candidates()[c].id.clone())
                .collect();
            let parts =
                pairs.iter().filter(|p| !t.pairs.iter().any(|q| q.explained == p.explained && q.by == p.by)).count();
            let determines = nullity - t.nullity;
            let worth = (5 * shows.len() + parts + 5 * determines) as f64;
            (worth > 0.0).then(|| {
                let variation = &t.variation;
                let advice = Advice {
                    habit: variation.id.clone(),
                    says: variation.says.clone(),
                    touches: variation.touches,
                    time_s: variation.seconds,
                    shows,
                    parts,
                    determines,
                };
                (worth / variation.seconds.max(60.0), advice)
            })
        })
        .collect();
    out.sort_by(|a, b| b.0.total_cmp(&a.0));
    out.into_iter().take(MOST_ADVICE).map(|(_, a)| a).collect()
}
