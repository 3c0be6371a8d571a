//! Which touches would tell the members of a group apart: variations of these very touches that this machine can make.

use super::{Examination, Options, Subject, settings_with};
use crate::design::{Known, LinearisedPlan, Noise, Planned, Task, keep_measured, variations};
use crate::diag::Result;
use crate::fit::{Knowledge, effects_of};
use crate::model::catalogue::Effect;
use crate::model::formula::slot;
use crate::search::Score;
use crate::search::distinguishability::{Left, Products, chance};
use crate::search::groups::Group;
use crate::search::multiplicity::FAMILY_LEVEL;
use crate::units::deg_from_rad;
use nalgebra::DVector;
use rayon::prelude::*;

/// A variation tells two effects apart when the diagnosis of its touches does so with this probability.
const SAFELY: f64 = 0.95;

/// A variation that takes longer is no advice, s.
const LONGEST_S: f64 = 7200.0;

/// Rivals that are named at most.
const MOST_NAMED: usize = 4;

/// What tells the members of a group apart.
#[derive(Debug, Clone, Default)]
pub(super) struct Separating {
    /// In words; empty where a group has one member.
    pub says: String,
    /// No touches do.
    pub never: bool,
}

/// One for each group. Of two effects that are named together each is judged with the other in the model.
pub(super) fn words(subject: Subject, seen: &Examination, options: &Options) -> Vec<Separating> {
    let found = |g: &Group| g.members.iter().any(|m| seen.search.scores[m.candidate].p_adjusted < FAMILY_LEVEL);
    let asked = |place: &usize| seen.groups[*place].members.len() > 1 && found(&seen.groups[*place]);
    let named = seen.first_names();
    let tried = |places: &[usize], with: &[&str]| match options.planned {
        Some(planned) if !places.is_empty() => tried(subject, seen, planned, (places, with)).unwrap_or_default(),
        _ => Vec::new(),
    };
    let (of_two, alone): (Vec<usize>, Vec<usize>) =
        (0..seen.groups.len()).filter(asked).partition(|place| seen.both.is_some() && *place < named.len());
    let by_itself = tried(&alone, &[]);
    let each = seen.groups.iter().enumerate().map(|(place, group)| {
        let beside_the_other = of_two.contains(&place).then(|| tried(&[place], &[named[1 - place]]));
        let tried = beside_the_other.as_ref().unwrap_or(&by_itself);
        if asked(&place) && !tried.is_empty() {
            by_variation(seen, group, tried)
        } else {
            Separating { says: by_difference(subject, seen, (place, group)), never: false }
        }
    });
    each.collect()
}

/// A variation with what it makes of the effects in question.
struct Tried {
    says: String,
    seconds: f64,
    /// Could a further program make it?
    program: bool,
    /// Candidate, columns, expected size.
    effects: Vec<(usize, std::ops::Range<usize>, DVector<f64>)>,
    products: Products,
}

impl Tried {
    /// Would the two be told apart, whichever of them acts?
    fn tells(&self, one: usize, other: usize) -> bool {
        self.left(one, other).is_some_and(|left| chance(left.lambda, left.q) >= SAFELY)
    }

    /// Noncentrality of an effect for itself.
    fn alone(&self, one: usize) -> Option<f64> {
        let of = self.effects.iter().find(|e| e.0 == one)?;
        Some(self.products.left(&of.1, Some(&of.2), None).lambda)
    }

    /// What is left of one when the other is taken for it, the worse way.
    fn left(&self, one: usize, other: usize) -> Option<Left> {
        let find = |c: usize| self.effects.iter().find(|e| e.0 == c);
        let (a, b) = (find(one)?, find(other)?);
        Some(self.products.apart((&a.1, Some(&a.2)), Some((&b.1, Some(&b.2)))))
    }
}

/// All variations, cheapest first, for the groups at some places and with some effects in the model besides.
fn tried(
    subject: Subject,
    seen: &Examination,
    planned: &[Planned],
    (places, with): (&[usize], &[&str]),
) -> Result<Vec<Tried>> {
    let Subject { machine, catalogue, fit, .. } = subject;
    let name = |i: usize| fit.model.unknowns[i].name.clone();
    let task = Task {
        machine,
        catalogue,
        effects: effects_of(&settings_with(subject, with).effects, catalogue, machine)?,
        held: (0..fit.theta.len())
            .filter(|i| matches!(fit.knowledge[*i], Some(Knowledge::Fixed(_))))
            .map(name)
            .collect(),
        reference: fit.model.reference,
        temperature: fit.data.observations.iter().any(|o| o.has_temperature),
    };
    let priors: Vec<Known> =
        fit.priors.iter().map(|(i, _, sigma)| Known { sum: vec![(name(*i), 1.0)], sigma: *sigma }).collect();
    let noise = Noise { sigma_mm: fit.noise.sigma_mm, tau_mm: seen.evidence.tau_mm };
    let mut planned = planned.to_vec();
    keep_measured(&mut planned, &fit.data);
    let members = |&place: &usize| seen.groups[place].members.iter().map(move |m| &seen.scores(place)[m.candidate]);
    let candidates: Vec<&Score> = places.iter().flat_map(members).collect();
    let effects: Vec<(&Effect, Option<f64>)> = candidates
        .iter()
        .map(|score| {
            let c = score.candidate;
            let shape = seen.named.library.candidates()[c].variants[score.variant].shape;
            (seen.named.effects[c], seen.named.scanned[c].as_ref().map(|_| shape))
        })
        .collect();
    variations(machine, &planned, &fit.model)
        .into_par_iter()
        .map(|variation| {
            let known: Vec<Known> = priors.iter().chain(&variation.known).cloned().collect();
            let view = LinearisedPlan::with_effects(&task, &variation.runs(&planned), &known, noise, &effects)?;
            let spans = view.library.candidates().iter().map(|c| c.variants[0].columns.clone());
            let effects = candidates
                .iter()
                .zip(spans)
                .map(|(score, span)| (score.candidate, span, score.estimate.clone()))
                .collect();
            let products = Products::new(view.base(), &view.library.matrix());
            Ok(Tried {
                program: variation.is_a_program(machine),
                says: variation.says,
                seconds: variation.seconds,
                effects,
                products,
            })
        })
        .collect()
}

/// What is said of effects that do the same wherever the machine touches.
pub const NEVER: &str = "no touches of this machine separate them: check at the machine which it is";

/// What is said where the variations that were tried do not help, and another program may.
const LOOKED_FOR: &str =
    "no single change of this program separates them; `axiscal plan-next` looks for another program that does";

/// What is said where only variations of more than [`LONGEST_S`] help.
const ONLY_LONG: &str =
    "changes of these touches separate them only in more than 2 hours; `axiscal plan-next` looks for a shorter program";

/// Does every variation that a program could make leave the first of a group and all others exactly as they are to each other?
fn never_parted(group: &Group, tried: &[Tried]) -> bool {
    /// Share of an effect's own noncentrality: time constants of two effects are found one by one, and differ a little.
    const NOTHING: f64 = 1e-4;
    /// No chance to be told by that.
    const AT_MOST: f64 = 0.5;
    let chosen = group.first();
    let rivals = || group.members.iter().map(|m| m.candidate).filter(|&c| c != chosen);
    let the_same = |t: &Tried, rival: usize| {
        let whole = t.alone(chosen).unwrap_or(0.0);
        t.left(chosen, rival).is_some_and(|l| l.q == 0 || l.lambda < (NOTHING * whole).min(AT_MOST))
    };
    tried.iter().filter(|t| t.program).all(|t| rivals().all(|r| the_same(t, r)))
}

/// The cheapest variation that tells the first of a group from most of the others.
fn by_variation(seen: &Examination, group: &Group, tried: &[Tried]) -> Separating {
    let chosen = group.first();
    let rivals: Vec<usize> = group.members.iter().map(|m| m.candidate).filter(|&c| c != chosen).collect();
    let told = |t: &Tried| rivals.iter().filter(|&&r| t.tells(chosen, r)).count();
    // ties go to the earlier, which is the cheaper
    let short = tried.iter().filter(|t| t.seconds <= LONGEST_S);
    let best = short.map(|t| (told(t), t)).rev().max_by_key(|t| t.0);
    let id = |c: usize| seen.named.effects[c].id.as_str();
    let never = never_parted(group, tried);
    let Some((count, best)) = best.filter(|b| b.0 > 0) else {
        let told_by_room = |c: usize| seen.named.effects[c].terms.iter().any(|t| t.formula.variables().contains(&"T"));
        let of_room = group.members.iter().any(|m| told_by_room(m.candidate));
        let says = match never {
            true if of_room => "measure again while the temperature of the room changes in another way",
            true => NEVER,
            false if tried.iter().any(|t| told(t) > 0) => ONLY_LONG,
            false => LOOKED_FOR,
        };
        // a room that turns is something that touches wait for
        return Separating { says: says.into(), never: never && !of_room };
    };
    let from: Vec<&str> = rivals.iter().filter(|&&r| best.tells(chosen, r)).map(|&r| id(r)).collect();
    let whom = match (count == rivals.len(), count) {
        (true, 1) => format!("from {}", from[0]),
        (true, _) => "from all of them".to_owned(),
        (false, n) if n <= MOST_NAMED => format!("from {}, and leaves the others", from.join(", ")),
        (false, n) => format!("from {n} of the {}", rivals.len()),
    };
    let says =
        format!("{} (+{:.0} min): this separates {} {whom}", best.says, (best.seconds / 60.0).ceil(), id(chosen));
    Separating { says, never }
}

/// Two effects that differ by less at every touch, um, are told apart at none of them.
const LEAST_DIFFERENCE_UM: f64 = 0.05;

/// Where the two that lead a group differ most: for who has no plan at hand.
fn by_difference(subject: Subject, seen: &Examination, (place, group): (usize, &Group)) -> String {
    let chosen = group.first();
    let Some(rival) = group.members.iter().map(|m| m.candidate).find(|&c| c != chosen) else { return String::new() };
    let trace = |c: usize| -> DVector<f64> { seen.raw_um(place, c) * &seen.scores(place)[c].estimate };
    let difference = trace(chosen) - trace(rival);
    let further = |a: &usize, b: &usize| difference[*a].abs().total_cmp(&difference[*b].abs());
    let Some(most) = seen.evidence.used.iter().copied().max_by(further) else { return String::new() };
    if difference[most].abs() < LEAST_DIFFERENCE_UM {
        return LOOKED_FOR.into();
    }
    let o = &subject.fit.data.observations[most];
    let pose: Vec<String> = subject
        .machine
        .rotary()
        .map(|a| format!("{} = {:.0}", a.name, deg_from_rad(o.state[slot::AXES + a.name.index()])))
        .collect();
    format!(
        "more touches near {} on block {}, where {} and {} differ by up to {:.1} µm",
        pose.join(", "),
        subject.fit.data.set_ups[o.set_up].label,
        seen.named.effects[chosen].id,
        seen.named.effects[rival].id,
        difference[most].abs()
    )
}
