//! What the data cannot tell, in sentences.

use super::outcome::Undetermined;
use crate::model::catalogue::{Effect, Place, Term};
use crate::model::formula::VARIABLES;
use crate::model::predict::Unknown;
use nalgebra::DVector;
use std::collections::{BTreeMap, BTreeSet};

/// Weights below this are not worth a word.
const WORTH_NAMING: f64 = 0.05;

/// A null direction (scaled, unit norm) in words; `unknowns` are the free ones in the same order, `effects` the model's.
#[must_use]
pub fn undetermined(unknowns: &[&Unknown], effects: &[&Effect], direction: &DVector<f64>) -> Undetermined {
    let mut combination = BTreeMap::new();
    for (u, weight) in unknowns.iter().zip(direction.iter()) {
        if weight.abs() > 1e-6 {
            combination.insert(u.name.clone(), (weight * 1e6).round() / 1e6);
        }
    }
    let mut physical: Vec<String> = Vec::new();
    let mut blocks: BTreeSet<String> = BTreeSet::new();
    let mut block_words: BTreeSet<String> = BTreeSet::new();
    for (u, _) in unknowns.iter().zip(direction.iter()).filter(|(_, w)| w.abs() > WORTH_NAMING) {
        match u.name.split_once('@') {
            Some((word, block)) => {
                blocks.insert(block.to_owned());
                block_words.insert(word.to_owned());
            }
            None => physical.push(meaning(u, effects)),
        }
    }
    let mut members = physical.clone();
    if !blocks.is_empty() {
        let words: Vec<&str> = block_words.iter().map(|w| set_up_word(w)).collect();
        let of = if blocks.len() > 3 {
            format!("{} blocks", blocks.len())
        } else {
            blocks.into_iter().collect::<Vec<_>>().join(", ")
        };
        members.push(format!("the set-up of {of} ({})", words.join(", ")));
    }
    let says = match &members[..] {
        [] => "a combination of many parameters leaves no trace in these touches".to_owned(),
        [one] => format!(
            "{one} leaves no trace in these touches: its value is not known, and stands at its start by convention"
        ),
        several => format!(
            "{} are one number with these touches: only their sum is seen, and by convention the part that leaves no trace is 0, so that each value holds a share of that sum",
            join(several)
        ),
    };
    Undetermined { combination, says, parted_by: Vec::new() }
}

/// What an unknown means at the machine, with its symbol: "the place of axis C in Y (EY0C)".
#[must_use]
pub fn meaning(unknown: &Unknown, effects: &[&Effect]) -> String {
    let symbol = match &unknown.alias {
        Some(alias) => format!("{}, {alias}", unknown.name),
        None => unknown.name.clone(),
    };
    let Some(effect) = effects.iter().find(|e| e.id == unknown.effect) else { return symbol };
    let own = |t: &&Term| effect.parameters.get(t.parameter).is_some_and(|p| p.name == unknown.name);
    // a parameter that acts in several directions is called after the one in which it acts when everything stands at zero
    let shapes: Vec<f64> = effect.parameters.iter().map(|p| p.shape.map_or(0.0, |s| s.0)).collect();
    let at_zero = |t: &Term| {
        let value = t.formula.eval(&[0.0; VARIABLES.len()], &shapes).abs();
        if value.is_finite() { value } else { 0.0 }
    };
    let first = effect.terms.iter().find(own);
    let strongest = effect.terms.iter().filter(own).fold(first, |best, t| match best {
        Some(b) if at_zero(b) >= at_zero(t) => best,
        _ => Some(t),
    });
    let Some(term) = strongest else { return format!("{} ({symbol})", the(&effect.name)) };
    let component = COMPONENTS.get(term.component).copied().unwrap_or("");
    let is_stand = effect.family == "location" || effect.paper;
    let what = match term.place {
        Place::Before(axis) | Place::After(axis) if is_stand && axis.is_rotary() => {
            let turns = term.component >= 3;
            if turns && term.component == axis.index() {
                format!("the zero position of axis {axis}")
            } else if turns {
                format!("the tilt of axis {axis} {component}")
            } else if matches!(term.place, Place::After(_)) {
                format!("the tool's offset from axis {axis} {component}")
            } else {
                format!("the place of axis {axis} {component}")
            }
        }
        Place::Tool if effect.id == "tip-eccentricity" => format!("the tip's offset {component}"),
        // several components of one effect are told apart by where they point
        _ if effect.parameters.iter().filter(|p| p.shape.is_none()).count() > 1
            && !matches!(term.place, Place::Trigger | Place::Reading) =>
        {
            format!("{} {component}", the(&effect.name))
        }
        _ => the(&effect.name),
    };
    format!("{what} ({symbol})")
}

/// Components of a displacement, in words.
const COMPONENTS: [&str; 6] = ["in X", "in Y", "in Z", "about X", "about Y", "about Z"];

/// An effect's name inside a sentence.
fn the(name: &str) -> String {
    let mut letters = name.chars();
    let first = letters.next().map_or_else(String::new, |c| c.to_lowercase().collect());
    format!("the {first}{}", letters.as_str())
}

fn join(words: &[String]) -> String {
    match words {
        [] => String::new(),
        [one] => one.clone(),
        [all @ .., last] => format!("{} and {last}", all.join(", ")),
    }
}

fn set_up_word(word: &str) -> &str {
    match word {
        "SX" => "place in X",
        "SY" => "place in Y",
        "SZ" => "height",
        "SA" => "tilt about X",
        "SB" => "tilt about Y",
        "SC" => "turn about Z",
        other => other,
    }
}

/// A combination that is known badly, in words.
pub(super) fn weak(weights: &BTreeMap<String, f64>, times: f64) -> String {
    let names: Vec<String> = weights.keys().cloned().collect();
    let what = match &names[..] {
        [one] => one.clone(),
        several => format!("the combination of {}", join(several)),
    };
    format!("{what} is known to {times:.1} times its typical size only: these touches hardly see it")
}
