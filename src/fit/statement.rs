//! What the data cannot tell, in sentences.

use super::outcome::Undetermined;
use crate::model::predict::Unknown;
use nalgebra::DVector;
use std::collections::{BTreeMap, BTreeSet};

/// Weights below this are not worth a word.
const WORTH_NAMING: f64 = 0.05;

/// A null direction (scaled, unit norm) in words; `unknowns` are the free ones in the same order.
pub(super) fn undetermined(unknowns: &[&Unknown], direction: &DVector<f64>) -> Undetermined {
    let mut combination = BTreeMap::new();
    for (u, weight) in unknowns.iter().zip(direction.iter()) {
        if weight.abs() > 1e-6 {
            combination.insert(u.name.clone(), (weight * 1e6).round() / 1e6);
        }
    }
    let mut physical: Vec<String> = Vec::new();
    let mut blocks: BTreeSet<String> = BTreeSet::new();
    let mut block_words: BTreeSet<String> = BTreeSet::new();
    for (u, weight) in unknowns.iter().zip(direction.iter()).filter(|(_, w)| w.abs() > WORTH_NAMING) {
        let _ = weight;
        match u.name.split_once('@') {
            Some((word, block)) => {
                blocks.insert(block.to_owned());
                block_words.insert(word.to_owned());
            }
            None => physical.push(match &u.alias {
                Some(alias) => format!("{} ({alias})", u.name),
                None => u.name.clone(),
            }),
        }
    }
    if !blocks.is_empty() {
        let words: Vec<&str> = block_words.iter().map(|w| set_up_word(w)).collect();
        let of = if blocks.len() > 3 {
            format!("{} blocks", blocks.len())
        } else {
            blocks.into_iter().collect::<Vec<_>>().join(", ")
        };
        physical.push(format!("the set-up of {of} ({})", words.join(", ")));
    }
    let says = match &physical[..] {
        [] => "a combination of many parameters leaves no trace in these touches".to_owned(),
        [one] => format!("{one} leaves no trace in these touches: its value is not known, and it stays at its start"),
        several => format!(
            "{} are one number with these touches: only their sum is seen; touches that part them, or a known value, are needed",
            join(several)
        ),
    };
    Undetermined { combination, says }
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
