//! What the user said about a model: which effects, which parameters are held or known, and whether that makes sense.

use super::Knowledge;
use super::candidates::{NO_VALUE_HELP, without_value};
use crate::diag::{Failure, Finding, Result, enough};
use crate::machine::Machine;
use crate::model::catalogue::{Catalogue, Effect};
use crate::model::predict::{Model, Observation, Unknown};
use std::collections::BTreeMap;

/// The effects of a model, in order.
///
/// # Errors
/// When an id is unknown, stands twice, or the machine lacks the axis that it needs.
pub fn effects_of<'c>(ids: &[String], catalogue: &'c Catalogue, machine: &Machine) -> Result<Vec<&'c Effect>> {
    let mut findings = Vec::new();
    let mut effects: Vec<&Effect> = Vec::new();
    for id in ids {
        match catalogue.get(id, machine) {
            Some(effect) if effects.iter().any(|e| e.id == effect.id) => {
                findings.push(Finding::error("model::effect_twice", format!("effect {id:?} is twice in the model")).about(id).help("name each effect once"));
            }
            Some(effect) => effects.push(effect),
            None if catalogue.knows(id) => findings.push(
                Finding::error("model::effect_not_here", format!("effect {id:?} does not apply to machine {:?}", machine.name))
                    .about(id)
                    .help("it needs an axis that the machine lacks, or has on the other side of the chain: `axiscal effects show` says which"),
            ),
            None => {
                let mut finding = Finding::error("model::unknown_effect", format!("no effect is called {id:?}")).about(id);
                if !enough(findings.iter().map(|f: &Finding| f.code), finding.code) {
                    let known: Vec<&str> = catalogue.iter().filter(|e| e.applies_to(machine)).map(|e| e.id.as_str()).collect();
                    finding = finding.help(format!("for this machine there are: {}", known.join(", ")));
                }
                findings.push(finding);
            }
        }
    }
    // two effects may not bring the same parameter: their columns would be equal and the names would clash
    for (i, a) in effects.iter().enumerate() {
        for b in &effects[..i] {
            if a.is_of_other_bodies_than(b) {
                continue;
            }
            if let Some(p) = a.parameters.iter().find(|p| b.parameters.iter().any(|q| q.name == p.name)) {
                findings.push(
                    Finding::error(
                        "model::parameter_twice",
                        format!("effects {:?} and {:?} both bring the parameter {}", b.id, a.id, p.name),
                    )
                    .about(&b.id)
                    .help("take one of the two out of the model"),
                );
            }
        }
    }
    if findings.is_empty() { Ok(effects) } else { Err(Failure(findings)) }
}

/// A formula that gives no number at a touch would spoil the whole fit: say which, and where.
///
/// # Errors
/// Names each such formula with its first touch.
pub fn every_formula_has_a_value<'e>(
    effects: impl IntoIterator<Item = &'e Effect>,
    observations: &[Observation],
) -> Result<()> {
    let mut findings = Vec::new();
    for bad in effects.into_iter().flat_map(|e| without_value(e, observations)) {
        findings.push(Finding::error("model::no_value", bad.says()).about(&bad.effect).help(NO_VALUE_HELP));
    }
    if findings.is_empty() { Ok(()) } else { Err(Failure(findings)) }
}

/// Which unknowns the user's words mean.
pub(super) fn resolve(unknowns: &[Unknown], words: &BTreeMap<String, Knowledge>) -> Result<Vec<Option<Knowledge>>> {
    let mut out = vec![None; unknowns.len()];
    let mut findings = Vec::new();
    // as it is written before any other spelling: a user's effect may have a name that differs in its capitals only. What is said
    // by the exact name comes last, and stays
    let exact = |word: &String| unknowns.iter().position(|u| u.name == *word);
    let (by_name, spelled): (Vec<_>, Vec<_>) = words.iter().partition(|(word, _)| exact(word).is_some());
    for (word, known) in spelled.into_iter().chain(by_name) {
        let exact = exact(word);
        let meant = |i: &usize| {
            let u = &unknowns[*i];
            exact.map_or_else(
                || crate::symbols::same(&u.name, word) || u.alias.as_deref() == Some(word),
                |exact| exact == *i,
            )
        };
        let matches: Vec<usize> = (0..unknowns.len()).filter(meant).collect();
        match matches[..] {
            [i] => out[i] = Some(*known),
            _ => {
                let message = format!("no parameter of the model is called {word:?}");
                let mut finding = Finding::error("model::unknown_parameter", message).about(word);
                if !enough(findings.iter().map(|f: &Finding| f.code), finding.code) {
                    let names: Vec<&str> = unknowns.iter().map(|u| u.name.as_str()).collect();
                    finding = finding.help(format!("there are: {}", names.join(", ")));
                }
                findings.push(finding);
            }
        }
        // a kilometre or a billion degrees is no knowledge of a machine
        let sane = |v: f64| v.is_finite() && v.abs() < 1e6;
        let bad = match known {
            Knowledge::Fixed(v) => !sane(*v),
            Knowledge::Prior { value, sigma } => !(sane(*value) && sane(*sigma) && *sigma > 0.0),
        };
        if bad {
            findings.push(
                Finding::error("model::knowledge", format!("what is said of {word:?} is not usable"))
                    .about(word)
                    .help("write numbers below 1e6 in size, in the parameter's unit, and a sigma greater than 0"),
            );
        }
    }
    if findings.is_empty() { Ok(out) } else { Err(Failure(findings)) }
}

/// A time constant of -1 h is no knowledge either: what is said of a shape parameter lies within its range.
pub(super) fn within_range(model: &Model, knowledge: &[Option<Knowledge>], effects: &[&Effect]) -> Result<()> {
    let mut findings = Vec::new();
    for (u, known) in model.unknowns.iter().zip(knowledge).filter(|(u, _)| u.shape) {
        let Some(Knowledge::Fixed(value) | Knowledge::Prior { value, .. }) = known else { continue };
        let name = u.name.split('@').next().unwrap_or(&u.name);
        let of_effect = effects.iter().filter(|e| e.id == u.effect).flat_map(|e| &e.parameters);
        let Some((_, low, high)) = of_effect.filter(|p| p.name == name).find_map(|p| p.shape) else { continue };
        if !(low..=high).contains(value) {
            findings.push(
                Finding::error(
                    "model::knowledge",
                    format!("what is said of {}, {value} {}, lies outside of its range, {low} to {high}", u.name, u.unit),
                )
                .help("write a value within it; where the machine has another one, the effect in a file of your own with a wider range"),
            );
        }
    }
    if findings.is_empty() { Ok(()) } else { Err(Failure(findings)) }
}

/// A held value or a prior of a length among the location errors counts at the machine's pivot: at another point it would be
/// another line on the machine that is held, and with it another fit.
pub(super) fn stated_at_the_pivot(model: &Model, knowledge: &[Option<Knowledge>], machine: &Machine) -> Result<()> {
    if model.reference == machine.reference.pivot {
        return Ok(());
    }
    let moves = |u: &Unknown| u.at_reference && u.unit == "mm";
    let known = model.unknowns.iter().zip(knowledge).filter(|(u, k)| k.is_some() && moves(u));
    let names: Vec<&str> = known.map(|(u, _)| u.name.as_str()).collect();
    if names.is_empty() {
        return Ok(());
    }
    Err(Failure::new(
        "model::reference_of_known",
        format!("what the study says of {} counts at the machine's pivot, and the errors are asked for at another point", names.join(", ")),
    )
    .help("ask for them at the pivot (--reference pivot), or take what is said of these parameters out of [model.parameters]"))
}
