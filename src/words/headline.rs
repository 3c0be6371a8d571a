//! The verdict in one sentence for somebody who knows machines and not statistics, and what to do next.

use crate::diagnose::Verdict;
use crate::diagnose::answer::Candidate;
use crate::diagnose::verdict::{Missing, NotNamed, Unexplained};
use crate::fit::outcome::Status;
use crate::model::catalogue::Place;
use crate::units::um_from_mm;
use crate::view::Material;
use crate::view::record::{Compensation, Judgement, ParameterRecord};
use serde::Serialize;

/// How the page is coloured and which sign stands before the sentence.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Level {
    /// Nothing needs to be done.
    Good,
    /// Something is wrong with the machine.
    Act,
    /// The data does not say.
    Unknown,
}

/// The verdict.
#[derive(Debug, Clone, Serialize)]
pub struct Headline {
    /// Good, act, unknown.
    pub level: Level,
    /// The answer in one sentence.
    pub sentence: String,
    /// What stands behind it, in a second one.
    pub detail: String,
    /// Its grounds, in three lines.
    pub why: Vec<String>,
}

/// Three digits that a person reads, µm.
pub(crate) fn um(x: f64) -> String {
    let x = x.abs();
    let digits = if x >= 100.0 {
        0
    } else if x >= 10.0 {
        1
    } else {
        2
    };
    format!("{x:.digits$} µm")
}

/// The same with its sign.
fn signed_um(x: f64) -> String {
    format!("{}{}", if x < 0.0 { "\u{2212}" } else { "" }, um(x))
}

/// "3 of 8 errors", "1 of 8 errors", "the one error".
fn count_of_errors(n: usize, total: usize) -> String {
    if total == 1 { "the one error".to_owned() } else { format!("{n} of {total} errors") }
}

fn verb(n: usize) -> &'static str {
    if n == 1 { "is" } else { "are" }
}

fn largest(parameters: &[ParameterRecord], judgement: Judgement) -> Option<&ParameterRecord> {
    let ratio = |p: &ParameterRecord| p.tolerance.map_or(0.0, |t| p.value.abs() / t);
    let those = parameters.iter().filter(|p| p.judgement == judgement);
    those.max_by(|a, b| ratio(a).total_cmp(&ratio(b)))
}

/// How large a result is, as a length where it does one at the tolerance's radius.
pub(crate) fn size(p: &ParameterRecord, m: &Material) -> String {
    let own = || with_sign(p.value, p.sigma, &p.unit);
    match (p.at_radius_um, p.unit.as_str()) {
        (Some(size), "mm" | "um") => signed_um(size),
        (Some(size), _) => format!("{}, that is {} at {} mm", own(), um(size), m.tolerance.radius_mm),
        (None, _) => own(),
    }
}

/// A value with its unit as people write both.
fn with_sign(value: f64, sigma: Option<f64>, unit: &str) -> String {
    let number = crate::report::fit::digits(value, sigma).replace('-', "\u{2212}");
    match unit {
        "deg" => format!("{number}°"),
        _ => format!("{number} {}", crate::report::fit::unit(unit)).trim_end().to_owned(),
    }
}

/// The sentence on top of the page.
pub(crate) fn headline(m: &Material, parameters: &[ParameterRecord], c: &Compensation) -> Headline {
    let d = m.diagnosis;
    let errors = || format!("The residual is {}; the probe noise is {}.", um(d.rms_um), um(d.noise_um));
    let (level, sentence, detail) = match &d.verdict {
        Verdict::TooLittleData(_) => (Level::Unknown, d.says.clone(), String::new()),
        Verdict::MissingEffect(Missing::Effect(_)) => match d.candidates.first() {
            Some(first) => (Level::Act, missing(m, first), falls(m, first)),
            None => (Level::Act, d.says.clone(), d.says.clone()),
        },
        // a set-up mistake that made touches miss: there is nothing to compare its error with
        Verdict::MissingEffect(_) => (Level::Act, d.says.clone(), d.says.clone()),
        Verdict::Unexplained(Unexplained { why, .. }) => match why {
            NotNamed::WeakPattern => (Level::Unknown, d.says.clone(), d.says.clone()),
            NotNamed::CannotBeConfirmed(effects) => {
                (Level::Act, one_of(m, effects), errors() + " No touches are left to confirm one of them.")
            }
            _ => {
                let sentence = match d.in_question() {
                    Some(c) => format!(
                        "An effect is missing in the model. It may be {}, but unused measurements do not confirm it.",
                        in_question(m, c)
                    ),
                    None => format!("The machine has an error that no known effect explains. {}", errors()),
                };
                let depends = d.depends.first().map_or_else(String::new, |w| format!("{}.", w.says));
                (Level::Act, sentence, depends)
            }
        },
        Verdict::Adequate if !m.fit.outcome.converged => (
            Level::Unknown,
            format!("The fit did not converge ({}). Do not use these values.", m.fit.outcome.stopped),
            d.says.clone(),
        ),
        Verdict::Adequate => {
            let (level, sentence, lost) = adequate(m, parameters, c);
            (level, sentence, format!("{}{lost}", d.says))
        }
    };
    Headline { level, sentence, detail, why: super::why::why(m, parameters) }
}

/// The name of an effect.
pub(crate) fn named(m: &Material, id: &str) -> String {
    m.catalogue.get(id, m.machine).map_or_else(|| id.to_owned(), |e| e.name.clone())
}

/// Several effects would do, and nothing tells which.
fn one_of(m: &Material, open: &[String]) -> String {
    match open {
        [one] => format!(
            "An effect is missing in the model. One known effect explains it ({}), but there are too few poses to confirm it.",
            named(m, one)
        ),
        _ => format!(
            "An effect is missing in the model. One of {} known effects explains it, but there are too few poses to decide which.",
            open.len()
        ),
    }
}

/// An effect that passes its test and is not borne out, with those that these touches cannot tell from it.
pub(crate) fn in_question(m: &Material, c: &Candidate) -> String {
    match &c.same_as[..] {
        [] => c.name.clone(),
        [one] => format!("{} or {}", c.name, named(m, one)),
        several => format!("{} or one of {} others", c.name, several.len()),
    }
}

/// What the missing effect does to the touches, in figures.
fn falls(m: &Material, c: &Candidate) -> String {
    let d = m.diagnosis;
    let (with, they_move, in_place) = match d.proposed() {
        [first, second] => {
            let others = |c: &Candidate| c.same_as.iter().map(|id| named(m, id)).collect::<Vec<_>>();
            let in_place = |c: &Candidate| super::diagnose::in_place_of(&c.name, &others(c), c.or_else.as_deref());
            ("both", "Together they move", in_place(first) + &in_place(second))
        }
        _ => ("this effect", "It moves", String::new()),
    };
    let (sizes, moves) = match is_one_size(c) && d.proposed().len() < 2 {
        true => (sizes(m, c), None),
        false => (Vec::new(), most_moved_um(m)),
    };
    let sizes = if sizes.is_empty() { String::new() } else { format!(" Its size: {}.", sizes.join("; ")) };
    let moves = moves.map_or_else(String::new, |most| format!(" {they_move} single touches by up to {}.", um(most)));
    let rest = super::not_explained::remains(d);
    let (of, now_um, then_um) = match &d.all_touches {
        None => (String::new(), d.rms_um, m.proposed.map_or(c.rms_after_um, |fit| fit.outcome.rms_um)),
        Some(all) => {
            (format!(" of all touches, with the {} that are not used now,", all.put_back), all.rms_um, c.rms_after_um)
        }
    };
    format!(
        "The residual{of} is {}, and {} with {with} in the model; the probe noise is {}.{sizes}{moves}{rest}{in_place}",
        um(now_um),
        um(then_um),
        um(d.noise_um)
    )
}

/// Does a number or two say how large it is? Where not, the touches do.
fn is_one_size(c: &Candidate) -> bool {
    c.parameters.iter().any(|p| p.sigma.is_some()) && c.parameters.len() <= 2 && c.same_as.is_empty()
}

/// Its parameters with their sizes.
fn sizes(m: &Material, c: &Candidate) -> Vec<String> {
    let known = m.proposed.map(|fit| crate::view::parameters::parameters(m, fit)).unwrap_or_default();
    let those = c.parameters.iter().filter(|p| p.sigma.is_some()).take(2);
    let each = those.map(|p| match known.iter().find(|r| r.name == p.name && r.sigma.is_some()) {
        Some(record) => format!("{} {}", p.name, size(record, m)),
        None => format!("{} {}", p.name, with_sign(p.value, p.sigma, &p.unit)),
    });
    each.collect()
}

fn missing(m: &Material, c: &Candidate) -> String {
    // one number stands beside the name; of several, what they do to a touch
    let size = match &sizes(m, c)[..] {
        [one] if is_one_size(c) => format!(" ({one})"),
        [_, ..] if is_one_size(c) => {
            most_moved_um(m).map_or_else(String::new, |most| format!(" (moves touches by up to {})", um(most)))
        }
        _ => String::new(),
    };
    let others = match &c.same_as[..] {
        [] => None,
        [one] => Some(named(m, one)),
        several => Some(format!("one of {} others", several.len())),
    };
    let or: String = others.iter().chain(&c.or_else).map(|other| format!(", or {other}")).collect();
    let which = if or.is_empty() { "" } else { ": these touches cannot separate them" };
    let (whose, has) = whose(m, &c.effect);
    if let [first, second] = m.diagnosis.proposed() {
        return format!(
            "Two errors are not in the model yet: {} and {}. No single effect explains both.",
            first.name, second.name
        );
    }
    let what = format!("{}{size}{or}{which}", c.name);
    format!("{whose} {has} an error that is not in the model yet: {what}.")
}

/// The most that the proposed effect takes away from a touch that both fits use, µm.
fn most_moved_um(m: &Material) -> Option<f64> {
    let after = m.proposed?;
    let used = |i: &usize| m.fit.weight[*i] > 0.0 && after.weight.get(*i).is_some_and(|w| *w > 0.0);
    let moved = |i: usize| um_from_mm((m.fit.residual_mm[i] - after.residual_mm[i]).abs());
    (0..m.fit.residual_mm.len()).filter(used).map(moved).max_by(f64::total_cmp)
}

/// Whose error an effect is: a probe that triggers late is no fault of the machine.
fn whose(m: &Material, id: &str) -> (&'static str, &'static str) {
    let Some(effect) = m.catalogue.get(id, m.machine) else { return ("The machine", "has") };
    let all = |of: fn(Place) -> bool| !effect.terms.is_empty() && effect.terms.iter().all(|t| of(t.place));
    if all(|p| p == Place::Trigger) {
        ("The probe", "has")
    } else if all(|p| p == Place::Block) {
        ("The blocks", "have")
    } else {
        ("The machine", "has")
    }
}

/// Level, sentence, and what cannot be determined.
fn adequate(m: &Material, parameters: &[ParameterRecord], c: &Compensation) -> (Level, String, String) {
    let count = |j: Judgement| parameters.iter().filter(|p| p.judgement == j).count();
    let (beyond, open) = (count(Judgement::Beyond), count(Judgement::Open));
    let judged = beyond + open + count(Judgement::Within);
    let lost = parameters.iter().filter(|p| p.status == Status::Undetermined).count();
    let limit = if m.tolerance.parameters.is_empty() {
        format!("{} µm at {} mm", m.tolerance.error_um, m.tolerance.radius_mm)
    } else {
        "their own limits".to_owned()
    };
    let untold = match lost {
        0 => String::new(),
        n => format!(
            " {n} more {} be determined with these touches.",
            if n == 1 { "error cannot" } else { "errors cannot" }
        ),
    };
    let with = if c.active { "With the compensation that was active, " } else { "" };
    let start = |text: &str| if with.is_empty() { capital(text) } else { format!("{with}{text}") };
    if let Some(worst) = largest(parameters, Judgement::Beyond) {
        let sentence = format!(
            "{} {} the tolerance ({limit}). The largest is {} ({}): {}.",
            start(&count_of_errors(beyond, judged)),
            if beyond == 1 { "exceeds" } else { "exceed" },
            worst.says,
            worst.name,
            size(worst, m)
        );
        return (Level::Act, sentence, untold);
    }
    if let Some(worst) = largest(parameters, Judgement::Open) {
        let sentence = format!(
            "{} too uncertain to compare with the tolerance ({limit}): {} ({}) is the worst. No error is certainly larger.",
            start(&format!("{} {}", count_of_errors(open, judged), verb(open))),
            worst.says,
            worst.name
        );
        return (Level::Unknown, sentence, untold);
    }
    if judged == 0 {
        return (Level::Unknown, "The model fits, but none of its errors has a tolerance.".to_owned(), untold);
    }
    let level = if lost == 0 { Level::Good } else { Level::Unknown };
    let nothing = "the model is complete as far as these touches can measure";
    (
        level,
        format!(
            "{} within the tolerance ({limit}), and {nothing}.{untold}",
            start(&format!("{} {}", all(judged), verb(judged)))
        ),
        // it is in the sentence
        String::new(),
    )
}

fn all(n: usize) -> String {
    if n == 1 { "the one error that is determined".to_owned() } else { format!("all {n} errors that are determined") }
}

/// With a capital letter.
pub(crate) fn capital(text: &str) -> String {
    let mut letters = text.chars();
    letters.next().map_or_else(String::new, |c| c.to_uppercase().collect::<String>() + letters.as_str())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_size_keeps_its_sign() {
        assert_eq!((signed_um(-2.95).as_str(), signed_um(2.95).as_str()), ("−2.95 µm", "2.95 µm"));
    }
}
