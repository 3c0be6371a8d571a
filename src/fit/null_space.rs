//! The null space of the touches: combinations of parameters that cannot be determined.

use super::outcome::Undetermined;
use super::solve::Observability;
use crate::model::catalogue::{Effect, Place, Term};
use crate::model::formula::VARIABLES;
use crate::model::predict::Unknown;
use nalgebra::DVector;
use std::collections::BTreeSet;

/// Smaller weights are not named: what a sentence leaves out has an effect, of no more than the rounding of the rest to three digits.
const WORTH_NAMING: f64 = 1e-3;

/// Smaller weights are named last: a sentence begins with what makes most of it.
const SMALL: f64 = 0.05;

/// A part below this is the rounding of the null directions.
const LEAST: f64 = 1e-6;

/// A parameter in a combination.
#[derive(Debug, Clone, PartialEq)]
pub struct Combined {
    /// Its name, and what it means at the machine.
    pub name: String,
    /// What it means at the machine, with its symbol.
    pub meaning: String,
    /// How much of it the combination holds, in its unit.
    pub amount: f64,
    /// Its unit.
    pub unit: String,
    /// It is a shape parameter.
    pub is_shape: bool,
}

/// Positions of blocks in a combination.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Blocks {
    /// The blocks.
    pub labels: BTreeSet<String>,
    /// Which of their parameters: `SX`, …
    pub parameters: BTreeSet<String>,
}

impl Blocks {
    /// True where there are none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.labels.is_empty()
    }
}

/// What kind of combination it is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// Of so many parameters that none is worth naming.
    Unnamed,
    /// One shape parameter, whose effect does not show.
    Shape,
    /// One parameter that has no effect.
    Single,
    /// Two results of which one number is seen.
    Pair,
    /// One result that block positions follow.
    OneWithBlocks,
    /// Several that trade against each other.
    Several,
}

/// A combination that has no effect on the touches.
#[derive(Debug, Clone, PartialEq)]
pub struct NullDirection {
    pub kind: Kind,
    /// Results in it, the largest weights first.
    pub members: Vec<Combined>,
    /// Block positions in it.
    pub blocks: Blocks,
    /// Which parameters are set, so that the rest can be solved for.
    pub held: Vec<String>,
}

/// The null directions (scaled, unit norm), each with its sentence; `unknowns` are the free ones in the same order, `seen` says how they
/// are scaled and which are held, `effects` are the model's.
#[must_use]
pub fn undetermined(
    unknowns: &[&Unknown],
    effects: &[&Effect],
    unseen: &[DVector<f64>],
    seen: &Observability,
) -> Vec<Undetermined> {
    let each = |k: usize| {
        let others: Vec<&DVector<f64>> = unseen.iter().enumerate().filter(|(i, _)| *i != k).map(|(_, v)| v).collect();
        let weights = unknowns.iter().zip(unseen[k].iter()).filter(|(_, weight)| weight.abs() > LEAST);
        Undetermined {
            combination: weights.map(|(u, weight)| (u.name.clone(), (weight * 1e6).round() / 1e6)).collect(),
            says: crate::words::fit::undetermined(&null_direction(unknowns, effects, &unseen[k], &others, seen)),
            moves_um: None,
            parted_by: Vec::new(),
        }
    };
    (0..unseen.len()).map(each).collect()
}

/// One null direction. What is said to be seen must stand still in the other ones too.
fn null_direction(
    unknowns: &[&Unknown],
    effects: &[&Effect],
    direction: &DVector<f64>,
    others: &[&DVector<f64>],
    seen: &Observability,
) -> NullDirection {
    let is_held = |i: usize| seen.held.contains(&i);
    // what is set to 0 is named, however small its part
    let is_named = |i: usize| direction[i].abs() > if is_held(i) { LEAST } else { WORTH_NAMING };
    let is_small = |i: &usize| direction[*i].abs() < SMALL;
    let (small, large): (Vec<usize>, Vec<usize>) = (0..unknowns.len()).filter(|&i| is_named(i)).partition(is_small);
    let named = [large, small].concat();
    let is_alone = others.iter().all(|v| named.iter().all(|&i| v[i].abs() <= LEAST));
    // a sum of two is seen although both are in another direction where that one leaves the sum as it is
    let leaves_the_sum = |v: &&DVector<f64>| match named[..] {
        [a, b] => (direction[b] * v[a] - direction[a] * v[b]).abs() <= LEAST,
        _ => false,
    };
    let is_one_number = is_alone || others.iter().all(leaves_the_sum);
    let (mut members, mut blocks) = (Vec::new(), Blocks::default());
    for &i in &named {
        let u = unknowns[i];
        match u.name.split_once('@').filter(|_| u.nuisance) {
            Some((parameter, block)) => {
                blocks.labels.insert(block.to_owned());
                blocks.parameters.insert(parameter.to_owned());
            }
            None => members.push(Combined {
                name: u.name.clone(),
                meaning: meaning(u, effects),
                amount: direction[i] / seen.scale[i],
                unit: u.unit.clone(),
                is_shape: u.shape,
            }),
        }
    }
    let kind = match (&members[..], blocks.is_empty()) {
        ([], true) => Kind::Unnamed,
        ([one], true) if one.is_shape => Kind::Shape,
        ([_], true) => Kind::Single,
        ([_, _], true) if is_one_number => Kind::Pair,
        ([_], false) if is_one_number => Kind::OneWithBlocks,
        _ if named.len() == 1 => Kind::Single,
        _ => Kind::Several,
    };
    let held = seen.held.iter().filter(|&&c| direction[c].abs() > LEAST).map(|&c| unknowns[c].name.clone());
    NullDirection { kind, members, blocks, held: held.collect() }
}

/// What an unknown means at the machine, with its symbol: "the position of axis C in Y (EY0C)".
#[must_use]
pub fn meaning(unknown: &Unknown, effects: &[&Effect]) -> String {
    let symbol = match &unknown.alias {
        Some(alias) => format!("{}, {alias}", unknown.name),
        None => unknown.name.clone(),
    };
    match name_at_the_machine(unknown, effects) {
        Some(name) => format!("{name} ({symbol})"),
        None => symbol,
    }
}

/// What an unknown means at the machine, without its symbol: "the position of axis C in Y".
#[must_use]
pub fn name_at_the_machine(unknown: &Unknown, effects: &[&Effect]) -> Option<String> {
    let effect = effects.iter().find(|e| e.id == unknown.effect)?;
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
    let Some(term) = strongest else { return Some(the(&effect.name)) };
    let component = COMPONENTS.get(term.component).copied().unwrap_or("");
    let is_stand = effect.family == "location" || effect.paper;
    Some(match term.place {
        Place::Before(axis) | Place::After(axis) if is_stand && axis.is_rotary() => {
            let turns = term.component >= 3;
            if turns && term.component == axis.index() {
                format!("the zero position of axis {axis}")
            } else if turns {
                format!("the tilt of axis {axis} {component}")
            } else if matches!(term.place, Place::After(_)) {
                format!("the tool's offset from axis {axis} {component}")
            } else {
                format!("the position of axis {axis} {component}")
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
    })
}

/// Components of a displacement, in words.
const COMPONENTS: [&str; 6] = ["in X", "in Y", "in Z", "about X", "about Y", "about Z"];

/// An effect's name inside a sentence.
fn the(name: &str) -> String {
    let mut letters = name.chars();
    let first = letters.next().map_or_else(String::new, |c| c.to_lowercase().collect());
    format!("the {first}{}", letters.as_str())
}
