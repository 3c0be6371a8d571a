//! One word for a plan, with the reason (the thresholds stand in docs/guide/assess.md).

use super::linearised_plan::Task;
use super::record::{Assessment, Expected, Score};

/// The noise of a touch alone must leave a location error to this share of its typical size.
const NOISE_SHARE: f64 = 0.25;

/// With the scatter of indexing the 95 % interval must stay within the typical size: else a usual error could not be told
/// from none.
const VISITS_SHARE: f64 = 0.5;

/// A good plan knows location errors to this share of their typical size whatever else acts.
const UNMODELLED_SHARE: f64 = 1.0;

/// A good plan leaves at most so many effects without a trace, those not counted that equal a parameter with any touches
/// or do not move these touches at all …
const MOST_INVISIBLE: usize = 4;

/// … and at most so many pairs of effects that cannot be told apart, for each effect.
const PAIRS_PER_EFFECT: f64 = 0.5;

/// Pairs of which one is a special case of the other: they say nothing of the plan.
fn special_cases(a: &Assessment, task: &Task) -> usize {
    let includes = |by: &String, id: &String| {
        task.catalogue.get(by, task.machine).is_some_and(|effect| effect.includes.contains(id))
    };
    let of =
        |e: &super::record::Seen| e.same_as.iter().chain(&e.contained_in).filter(|by| includes(by, &e.effect)).count();
    a.effects.iter().map(of).sum()
}

/// Score and reason.
pub(super) fn score(a: &Assessment, task: &Task) -> (Score, String) {
    // an axis that no touch sees is not what this plan is for
    let unseen_effect = |effect: &str| a.parameters.iter().filter(|p| p.effect == effect).all(|p| p.sigma.is_none());
    let location: Vec<&Expected> = a.parameters.iter().filter(|p| is_location(&p.effect)).collect();
    let typical = |p: &Expected| {
        let effect = task.effects.iter().find(|e| e.id == p.effect);
        effect.and_then(|e| e.parameters.iter().find(|q| q.name == p.name)).map_or(f64::INFINITY, |q| q.typical)
    };
    let silent: Vec<&str> = {
        let mut ids: Vec<&str> = location.iter().map(|p| p.effect.as_str()).filter(|e| unseen_effect(e)).collect();
        ids.dedup();
        ids
    };
    let judged: Vec<&&Expected> = location.iter().filter(|p| !silent.contains(&p.effect.as_str())).collect();
    let not_for = if silent.is_empty() { String::new() } else { format!("; it says nothing of {}", silent.join(", ")) };
    let told = if silent.is_empty() {
        "the location errors".to_owned()
    } else {
        let mut ids: Vec<&str> = judged.iter().map(|p| p.effect.as_str()).collect();
        ids.dedup();
        ids.join(" and ")
    };
    let lost: Vec<&str> = judged.iter().filter(|p| p.sigma.is_none()).map(|p| p.name.as_str()).collect();
    if !lost.is_empty() {
        return (Score::NotEnough, format!("it cannot determine {}{not_for}", lost.join(", ")));
    }
    if location.is_empty() {
        return (Score::Enough, "the model has no location error to score the plan by".into());
    }
    if judged.is_empty() {
        return (Score::NotEnough, "it sees no location error at all".into());
    }
    let coarse = |share: f64, of: fn(&Expected) -> Option<f64>| -> Vec<&str> {
        let over = judged.iter().filter(|p| of(p).is_none_or(|s| s > share * typical(p)));
        over.map(|p| p.name.as_str()).collect()
    };
    let noisy = coarse(NOISE_SHARE, |p| p.sigma);
    if !noisy.is_empty() {
        let says = format!(
            "the noise of the touches alone leaves {} uncertain by more than a quarter of {}",
            noisy.join(", "),
            usual_size(&noisy)
        );
        return (Score::NotEnough, format!("{says}{not_for}"));
    }
    let scattered = coarse(VISITS_SHARE, |p| p.sigma_with_visits);
    if !scattered.is_empty() {
        let says = format!(
            "with the scatter of indexing {} {} uncertain by more than half of {}, so that a usual error could not be separated from none",
            scattered.join(", "),
            if scattered.len() == 1 { "is" } else { "are" },
            usual_size(&scattered)
        );
        return (Score::NotEnough, format!("{says}{not_for}"));
    }
    let mut reasons = Vec::new();
    let open: Vec<&str> = {
        let over = judged.iter().filter(|p| {
            p.holds.is_empty() && p.sigma_with_unmodelled.is_none_or(|s| s > UNMODELLED_SHARE * typical(p))
        });
        over.map(|p| p.name.as_str()).collect()
    };
    if !open.is_empty() {
        reasons.push(format!(
            "effects that are not in the model could shift {} by more than {}",
            open.join(", "),
            usual_size(&open)
        ));
    }
    // what no touches of any kind tell from another effect is no fault of the plan, but it is no good value either
    let excused: Vec<String> = {
        let over = judged.iter().filter(|p| {
            !p.holds.is_empty() && p.sigma_with_unmodelled.is_none_or(|s| s > UNMODELLED_SHARE * typical(p))
        });
        over.map(|p| format!("{} includes {}", p.name, p.holds.join(", "))).collect()
    };
    let not_for = if excused.is_empty() {
        not_for
    } else {
        format!("; no touches separate these: {}{not_for}", excused.join(", "))
    };
    let equal = |id: &str| a.parameters.iter().any(|p| p.holds.iter().any(|h| h == id));
    let invisible = a.effects.iter().filter(|e| !e.visible && e.typical_um > 0.0 && !equal(&e.effect)).count();
    if invisible > MOST_INVISIBLE {
        reasons.push(traceless(a, &equal));
    }
    let pairs = a.alias_pairs.saturating_sub(special_cases(a, task));
    if pairs as f64 > PAIRS_PER_EFFECT * a.effects.len() as f64 {
        reasons.push(format!("{} pairs of effects cannot be separated", a.alias_pairs));
    }
    if reasons.is_empty() {
        // a trace is not enough: at its usual size an effect must be larger than what would just be found
        let of_usual_size = |e: &&super::record::Seen| e.noncentrality >= 25.0;
        let found = a.effects.iter().filter(of_usual_size).count();
        let says = format!(
            "it determines {told} even if other errors act, and would find {found} of {} effects of their usual size",
            a.effects.len()
        );
        return (Score::Good, format!("{says}{not_for}"));
    }
    (
        Score::Enough,
        format!("it determines {told} of a machine without other errors, but {}{not_for}", reasons.join("; ")),
    )
}

/// How many effects leave no trace, as the list of effects counts them, and which of them no touches would show.
fn traceless(a: &Assessment, equal: &dyn Fn(&str) -> bool) -> String {
    let all: Vec<&super::record::Seen> = a.effects.iter().filter(|e| !e.visible).collect();
    let held = all.iter().filter_map(|e| {
        let by: Vec<&str> =
            a.parameters.iter().filter(|p| p.holds.contains(&e.effect)).map(|p| p.name.as_str()).collect();
        let verb = if by.len() == 1 { "includes" } else { "include" };
        (!by.is_empty()).then(|| format!("{}, which {} {verb}", e.effect, by.join(", ")))
    });
    let mut not_counted: Vec<String> = held.collect();
    let still = all.iter().filter(|e| e.typical_um <= 0.0 && !equal(&e.effect));
    let still: Vec<&str> = still.map(|e| e.effect.as_str()).collect();
    if !still.is_empty() {
        not_counted.push(format!("{}, which move nothing here", still.join(", ")));
    }
    let but = if not_counted.is_empty() {
        String::new()
    } else {
        format!(" (not counted against it: {})", not_counted.join("; "))
    };
    format!("{} effects have no effect on the touches{but}", all.len())
}

pub(super) fn is_location(effect: &str) -> bool {
    effect.starts_with("location-") || effect.starts_with("paper-") || effect == "double-head-10"
}

/// That of one parameter, or of several.
fn usual_size(names: &[&str]) -> &'static str {
    if names.len() == 1 { "its usual size" } else { "their usual sizes" }
}
