//! What the data cannot tell, in sentences.

use super::outcome::Undetermined;
use super::solve::Observability;
use crate::model::catalogue::{Effect, Place, Term};
use crate::model::formula::VARIABLES;
use crate::model::predict::Unknown;
use crate::units::significant;
use nalgebra::DVector;
use std::collections::{BTreeMap, BTreeSet};

/// Weights below this are not worth a word: what a sentence leaves out leaves a trace, and so much of that of its parts is not more
/// than their rounding to three digits.
const WORTH_NAMING: f64 = 1e-3;

/// Weights below this are named last: a sentence begins with what makes most of it.
const SMALL: f64 = 0.05;

/// The null directions (scaled, unit norm) in words; `unknowns` are the free ones in the same order, `seen` says how they are
/// scaled and which are held, `effects` are the model's.
#[must_use]
pub fn undetermined(
    unknowns: &[&Unknown],
    effects: &[&Effect],
    unseen: &[DVector<f64>],
    seen: &Observability,
) -> Vec<Undetermined> {
    let each = |k: usize| {
        let others: Vec<&DVector<f64>> = unseen.iter().enumerate().filter(|(i, _)| *i != k).map(|(_, v)| v).collect();
        one(unknowns, effects, &unseen[k], &others, seen)
    };
    (0..unseen.len()).map(each).collect()
}

/// One null direction in words. What is said to be seen must stand still in the other ones too.
fn one(
    unknowns: &[&Unknown],
    effects: &[&Effect],
    direction: &DVector<f64>,
    others: &[&DVector<f64>],
    seen: &Observability,
) -> Undetermined {
    let scale = &seen.scale;
    // a part below this is the rounding of the null directions
    const LEAST: f64 = 1e-6;
    let held: Vec<String> =
        seen.held.iter().filter(|&&c| direction[c].abs() > LEAST).map(|&c| unknowns[c].name.clone()).collect();
    // what counts as 0 by convention is named, however small its part
    let named = |i: usize| direction[i].abs() > if seen.held.contains(&i) { LEAST } else { WORTH_NAMING };
    let is_small = |i: &usize| direction[*i].abs() < SMALL;
    let (small, large): (Vec<usize>, Vec<usize>) = (0..unknowns.len()).filter(|&i| named(i)).partition(is_small);
    let members_at = [large, small].concat();
    let alone = others.iter().all(|v| members_at.iter().all(|&i| v[i].abs() <= LEAST));
    // a sum of two is seen although both stand in another direction where that one leaves the sum as it is
    let still = |v: &&DVector<f64>| match members_at[..] {
        [a, b] => (direction[b] * v[a] - direction[a] * v[b]).abs() <= LEAST,
        _ => false,
    };
    let one_number = alone || others.iter().all(still);
    let mut combination = BTreeMap::new();
    for (u, weight) in unknowns.iter().zip(direction.iter()) {
        if weight.abs() > LEAST {
            combination.insert(u.name.clone(), (weight * 1e6).round() / 1e6);
        }
    }
    // results with how much of each the direction holds, in its own unit
    let mut physical: Vec<(&Unknown, f64)> = Vec::new();
    let mut blocks: BTreeSet<String> = BTreeSet::new();
    let mut block_words: BTreeSet<String> = BTreeSet::new();
    for &i in &members_at {
        let (u, weight, scale) = (unknowns[i], direction[i], scale[i]);
        match u.name.split_once('@').filter(|_| u.nuisance) {
            Some((word, block)) => {
                blocks.insert(block.to_owned());
                block_words.insert(word.to_owned());
            }
            None => physical.push((u, weight / scale)),
        }
    }
    let mut members: Vec<String> = physical.iter().map(|(u, _)| meaning(u, effects)).collect();
    if !blocks.is_empty() {
        let words: Vec<&str> = block_words.iter().map(|w| set_up_word(w)).collect();
        let of = if blocks.len() > 3 {
            format!("{} blocks", blocks.len())
        } else {
            blocks.iter().cloned().collect::<Vec<_>>().join(", ")
        };
        members.push(format!("the set-up of {of} ({})", words.join(", ")));
    }
    let is_shape = |name: &String| physical.iter().any(|(u, _)| u.shape && u.name == *name);
    let convention = match &held[..] {
        [one] if is_shape(one) => format!("by convention {one} stays where the search for it began"),
        [one] => format!("by convention {one} counts as 0"),
        _ if held.iter().any(is_shape) => format!("by convention {} stay where the search began", join(&held)),
        _ => format!("by convention {} count as 0", join(&held)),
    };
    let says = match (&members[..], &physical[..]) {
        ([], _) => "a combination of many parameters leaves no trace in these touches".to_owned(),
        ([one], [(u, _)]) if u.shape && effects.iter().any(|e| e.id == u.effect) => format!(
            "{one} is not told: beside an effect that does not show clearly in these touches there is nothing to tell it by; it \
             stands at the one of its usual values that fits best. More touches where that effect changes would tell it; else hold it at what is known of the machine"
        ),
        ([one], _) => format!(
            "{one} leaves no trace in these touches: its value is not known, and stands at its start by convention"
        ),
        (_, [a, b]) if blocks.is_empty() && one_number => format!(
            "{} are one number with these touches: only {} is seen, and {convention}",
            join(&members),
            what_is_seen(*a, *b)
        ),
        (_, [one]) if one_number => format!(
            "{} are one number with these touches: no touch notices a change of {} while the blocks go with it, and {convention}",
            join(&members),
            one.0.name
        ),
        _ => format!(
            "{} are one number less than they seem with these touches: no touch notices {}, and {convention}",
            join(&members),
            trade(&physical, !blocks.is_empty())
        ),
    };
    Undetermined { combination, says, moves_um: None, parted_by: Vec::new() }
}

/// An amount of an unknown with its unit; lengths all in mm, so that they compare.
fn plain((unknown, amount): (&Unknown, f64)) -> (f64, &str) {
    if unknown.unit == "um" { (crate::units::mm_from_um(amount), "mm") } else { (amount, unknown.unit.as_str()) }
}

/// What is seen of two results that trade against each other: "their sum (ey + EY0C)", "EX0B + 3.54 mm/deg · EB0B".
fn what_is_seen(a: (&Unknown, f64), b: (&Unknown, f64)) -> String {
    let ((in_a, unit_a), (in_b, unit_b)) = (plain(a), plain(b));
    let factor = -in_a / in_b;
    let sign = if factor < 0.0 { '-' } else { '+' };
    if unit_a == unit_b && (factor.abs() - 1.0).abs() < 1e-3 {
        let what = if factor < 0.0 { "difference" } else { "sum" };
        return format!("their {what} ({} {sign} {})", a.0.name, b.0.name);
    }
    let unit = match (unit_a, unit_b) {
        (a, b) if a == b => String::new(),
        (a, "1") => format!(" {a}"),
        (a, b) => format!(" {a}/{b}"),
    };
    format!("{} {sign} {}{unit} * {}", a.0.name, significant(factor.abs(), 3), b.0.name)
}

/// How results trade against each other: "+1 mm of EX0B with -0.283 deg of EB0B".
fn trade(physical: &[(&Unknown, f64)], with_blocks: bool) -> String {
    // the first is changed by one of its unit
    let one = physical.first().map_or(1.0, |p| plain(*p).0);
    let each: Vec<String> = physical
        .iter()
        .map(|p| {
            let (amount, unit) = plain(*p);
            let x = amount / one;
            // a number without a dimension has no unit beside it
            let unit = if unit == "1" { String::new() } else { format!(" {unit}") };
            format!("{}{}{unit} of {}", if x < 0.0 { '-' } else { '+' }, significant(x.abs(), 3), p.0.name)
        })
        .chain(with_blocks.then(|| "a set-up of the blocks that goes with it".to_owned()))
        .collect();
    match &each[..] {
        [] => "a change of the set-ups together".to_owned(),
        [first, rest @ ..] => format!("{first} with {}", join(rest)),
    }
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
            && effect.terms.iter().any(|t| t.component != term.component)
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

/// A combination that is known badly, in words: unknowns with their weights in units of their usual sizes.
pub(super) fn weak(weights: &[(&Unknown, f64)], effects: &[&Effect], times: f64) -> String {
    let what = match weights {
        [(one, _)] => meaning(one, effects),
        several => {
            let each: Vec<String> =
                several.iter().map(|(u, w)| format!("{w:+.2} of {}", meaning(u, effects))).collect();
            format!("the combination {} (each in its usual size)", join(&each))
        }
    };
    format!("{what} is known to {} times its usual size only: these touches hardly see it", significant(times, 3))
}
