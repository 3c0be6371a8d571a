//! The verdict in one sentence for somebody who knows machines and not statistics, and what to do next.

use super::Material;
use super::record::{Compensation, Judgement, ParameterRecord};
use crate::diagnose::Verdict;
use crate::diagnose::answer::Candidate;
use crate::fit::outcome::Status;
use crate::model::catalogue::Place;
use crate::units::um_from_mm;
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
    /// One sentence.
    pub sentence: String,
    /// What stands behind it, in a second one.
    pub detail: String,
}

/// A thing to do.
#[derive(Debug, Clone, Serialize)]
pub struct Next {
    /// What to do.
    pub what: String,
    /// How, or why.
    pub how: String,
    /// What to type; empty where nothing is typed.
    pub command: String,
}

impl Next {
    fn new(what: impl Into<String>, how: impl Into<String>, command: impl Into<String>) -> Self {
        Self { what: what.into(), how: how.into(), command: command.into() }
    }
}

/// Three digits that a person reads, µm.
pub(super) fn um(x: f64) -> String {
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

/// "3 of 8 errors", "1 of 8 errors", "the one error".
fn of(n: usize, total: usize) -> String {
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

fn size(p: &ParameterRecord, m: &Material) -> String {
    let own = || format!("{} {}", crate::report::fit::digits(p.value, p.sigma), p.unit);
    match (p.at_radius_um, p.unit.as_str()) {
        (Some(size), "mm" | "um") => um(size),
        (Some(size), _) => format!("{}, that is {} at {} mm", own(), um(size), m.tolerance.radius_mm),
        (None, _) => own(),
    }
}

/// The sentence on top of the page.
pub(super) fn headline(m: &Material, parameters: &[ParameterRecord], c: &Compensation) -> Headline {
    let d = m.diagnosis;
    let first = d.candidates.first().filter(|c| c.proposed || d.verdict == Verdict::MissingEffect);
    let (level, sentence) = match d.verdict {
        Verdict::TooLittleData => (Level::Unknown, d.says.clone()),
        // a gross mistake that made touches miss: there is nothing to compare its error with
        Verdict::MissingEffect if d.most_missed => (Level::Act, d.says.clone()),
        Verdict::MissingEffect => (Level::Act, first.map_or_else(|| d.says.clone(), |c| missing(m, c))),
        Verdict::Unexplained if d.faint => (Level::Unknown, d.says.clone()),
        Verdict::Unexplained => (
            Level::Act,
            format!(
                "The machine does something that no known effect explains: the touches miss the model by {}, and the probe's noise is {}.",
                um(d.rms_um),
                um(d.noise_um)
            ),
        ),
        Verdict::Adequate if !m.fit.outcome.converged => (
            Level::Unknown,
            format!(
                "The search for the errors did not come to an end ({}): do not use these values.",
                m.fit.outcome.stopped
            ),
        ),
        Verdict::Adequate => adequate(m, parameters, c),
    };
    let detail = match d.verdict {
        Verdict::TooLittleData => String::new(),
        _ => d.says.clone(),
    };
    // the rooms write um in plain letters
    Headline { level, sentence: sentence.replace(" um ", " µm "), detail }
}

fn missing(m: &Material, c: &Candidate) -> String {
    let name = |id: &str| m.catalogue.get(id, m.machine).map_or_else(|| id.to_owned(), |e| e.name.clone());
    let d = m.diagnosis;
    let falls = format!(
        "The touches miss by {}, and by {} once it is in the model; the probe's noise is {}.",
        um(d.rms_um),
        um(m.proposed.map_or(c.rms_after_um, |fit| fit.outcome.rms_um)),
        um(d.noise_um)
    );
    let known = m.proposed.map(|fit| super::parameters::parameters(m, fit)).unwrap_or_default();
    let sizes: Vec<String> = c
        .parameters
        .iter()
        .filter(|p| p.sigma.is_some())
        .take(2)
        .map(|p| match known.iter().find(|r| r.name == p.name && r.sigma.is_some()) {
            Some(record) => format!("{} {}", p.name, size(record, m)),
            None => format!("{} {} {}", p.name, crate::report::fit::digits(p.value, p.sigma), p.unit),
        })
        .collect();
    let one = !sizes.is_empty() && c.parameters.len() <= 2 && c.same_as.is_empty();
    let size = if one { format!(" ({})", sizes.join(", ")) } else { String::new() };
    // where no single number says how large it is, the touches do
    let moves = if one { None } else { most_moved_um(m) };
    let moves = moves.map_or_else(String::new, |most| format!(" It moves single touches by up to {}.", um(most)));
    let what = match &c.same_as[..] {
        [] => format!("{}{size}", c.name),
        [one] => format!("{}, or {}: these touches cannot tell which", c.name, name(one)),
        several => format!("{}, or one of {} others that these touches cannot tell from it", c.name, several.len()),
    };
    let rest = if c.remains == Some(true) { " Something else is missing besides." } else { "" };
    let (whose, has) = whose(m, &c.effect);
    format!("{whose} {has} an error that is not in the model yet: {what}. {falls}{moves}{rest}")
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

fn adequate(m: &Material, parameters: &[ParameterRecord], c: &Compensation) -> (Level, String) {
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
        n => format!(" {n} more {} not told by these touches.", if n == 1 { "error is" } else { "errors are" }),
    };
    let with = if c.active { "With the compensation that was active, " } else { "" };
    let start = |text: &str| if with.is_empty() { capital(text) } else { format!("{with}{text}") };
    if let Some(worst) = largest(parameters, Judgement::Beyond) {
        let sentence = format!(
            "{} {} larger than the tolerance ({limit}), the largest {} ({}): {}. Nothing else is missing that these touches can show.{untold}",
            start(&of(beyond, judged)),
            verb(beyond),
            worst.says,
            worst.name,
            size(worst, m)
        );
        return (Level::Act, sentence);
    }
    if let Some(worst) = largest(parameters, Judgement::Open) {
        let sentence = format!(
            "{} too uncertain to say whether {} within the tolerance ({limit}): {} ({}) is the worst; no error is certainly larger.{untold}",
            start(&format!("{} {}", of(open, judged), verb(open))),
            if open == 1 { "it is" } else { "they are" },
            worst.says,
            worst.name
        );
        return (Level::Unknown, sentence);
    }
    if judged == 0 {
        return (
            Level::Unknown,
            format!("The model fits, and none of its errors can be held against a tolerance.{untold}"),
        );
    }
    let level = if lost == 0 { Level::Good } else { Level::Unknown };
    let nothing = "nothing else is missing that these touches can show";
    (
        level,
        format!(
            "{} within the tolerance ({limit}), and {nothing}.{untold}",
            start(&format!("{} {}", all(judged), verb(judged)))
        ),
    )
}

fn all(n: usize) -> String {
    if n == 1 {
        "the one error that these touches tell".to_owned()
    } else {
        format!("all {n} errors that these touches tell")
    }
}

fn capital(text: &str) -> String {
    let mut letters = text.chars();
    letters.next().map_or_else(String::new, |c| c.to_uppercase().collect::<String>() + letters.as_str())
}

/// What to do, the first thing first.
pub(super) fn next(m: &Material, headline: &Headline, parameters: &[ParameterRecord], c: &Compensation) -> Vec<Next> {
    let mut out = Vec::new();
    let study = m.study;
    let controller = m.runs.iter().map(|r| r.controller).find(|c| *c != "csv").unwrap_or("YOUR-CONTROLLER");
    let plan_next = format!("axiscal plan-next {study} --controller {controller} --out next");
    let d = m.diagnosis;
    match d.verdict {
        Verdict::TooLittleData => out.push(Next::new(
            "Measure more touches",
            "A richer program sees what this one cannot. First make sure that the log belongs to the plan and that the blocks stand where it says.",
            format!("axiscal generate --machine {} --program full --controller {controller} --out .", m.machine.name),
        )),
        Verdict::MissingEffect => {
            if let Some(first) = d.candidates.first() {
                found(m, first, &plan_next, &mut out);
            }
        }
        Verdict::Unexplained if d.faint => out.push(Next::new(
            "Measure more touches",
            "Repeats and further poses say whether the weak pattern is there at all.",
            plan_next.clone(),
        )),
        Verdict::Unexplained => unexplained(m, &mut out),
        Verdict::Adequate => settled(m, headline, parameters, c, controller, &mut out),
    }
    if d.verdict != Verdict::TooLittleData
        && !m.fit.outcome.undetermined.is_empty()
        && (d.verdict == Verdict::Adequate || d.faint)
    {
        let how = m.fit.outcome.undetermined.iter().flat_map(|u| u.parted_by.first()).next();
        let how = how.map_or_else(|| "A program that sees what these touches cannot tell.".to_owned(), Clone::clone);
        out.push(Next::new("Measure what is not told yet", capital(&how), plan_next));
    }
    odd_touches(m, &mut out);
    out
}

fn found(m: &Material, first: &Candidate, plan_next: &str, out: &mut Vec<Next>) {
    if m.diagnosis.most_missed {
        out.push(Next::new("Put the mistake right and measure again", first.look.clone(), ""));
        return;
    }
    let one_of_several = if first.same_as.is_empty() { String::new() } else { format!("If it is {}: ", first.name) };
    out.push(Next::new("Look at the machine", format!("{one_of_several}{}", first.look), ""));
    if !first.same_as.is_empty() {
        out.push(Next::new("Find out which of them it is", capital(&first.tell_apart), plan_next));
    }
    out.push(Next::new(
        "Put it into the model",
        "The error falls, the other values become right, and this page says what comes next.",
        format!("axiscal add {} {}", m.study, first.effect),
    ));
    let mends = m.catalogue.get(&first.effect, m.machine).map_or("", |e| e.mends.as_str());
    if !mends.is_empty() {
        out.push(Next::new("What mends it", format!("{one_of_several}{mends}"), ""));
    }
}

fn unexplained(m: &Material, out: &mut Vec<Next>) {
    let d = m.diagnosis;
    if let Some(gross) = d.gross.first() {
        out.push(Next::new("Check for a gross mistake", gross.says.clone(), ""));
    }
    if let Some(shape) = &d.shape {
        let depends = d.depends.first().map_or("", |w| w.says.as_str());
        let kind = if shape.kind.is_empty() { String::new() } else { format!("{}. ", capital(&shape.kind)) };
        out.push(Next::new("Look for it on the machine", format!("{kind}{depends}."), ""));
    }
    out.push(Next::new(
        "Write down its formula",
        "A starting formula for what no known effect explains; then put it into the model.",
        format!("axiscal sketch-effect {} --out my-effects.toml", m.study),
    ));
}

fn settled(
    m: &Material,
    headline: &Headline,
    parameters: &[ParameterRecord],
    c: &Compensation,
    controller: &str,
    out: &mut Vec<Next>,
) {
    if let Some(why) = &c.refused {
        out.push(Next::new(
            "Do not compensate yet",
            format!(
                "{}. Such values are faults of the set-up: look for a wrong block, sense or length first.",
                capital(why)
            ),
            "",
        ));
        return;
    }
    let beyond: Vec<&ParameterRecord> = parameters.iter().filter(|p| p.judgement == Judgement::Beyond).collect();
    // what the probe or the blocks do is no error of the machine, and no table holds it
    let carried = |p: &&&ParameterRecord| {
        let left = c.left.iter().any(|l| l.known && crate::symbols::same(&l.parameter, &p.name));
        let term = c.terms.iter().any(|t| t.effect.split('+').any(|e| e == p.effect));
        let shape = c.shapes.iter().any(|s| s.parameter == p.name);
        !left && (term || shape || (c.tool_length_mm.is_some() && p.effect == "tool-length"))
    };
    if beyond.iter().any(|p| carried(&p)) {
        out.push(Next::new(
            "Load the compensation",
            "The values go into the control as its own tables; the README beside them says how, and what must be set again.",
            format!("axiscal export {} --controller {controller} --out compensation", m.study),
        ));
        out.push(Next::new(
            "Measure again and compare",
            "Run the same program with the compensation loaded; the two studies side by side say whether it works.",
            format!("axiscal verify {} again.toml", m.study),
        ));
    }
    for p in beyond.iter().filter(|p| !carried(p)).take(2) {
        out.push(Next::new(format!("Mend {}", p.says), p.mends.clone(), ""));
    }
    if headline.level == Level::Good {
        out.push(Next::new(
            "Nothing needs to be done",
            "Keep this page: the next measurement can be held against it.",
            format!("axiscal verify {} LATER-STUDY.toml", m.study),
        ));
    }
    if beyond.is_empty() && parameters.iter().any(|p| p.judgement == Judgement::Open) {
        out.push(Next::new(
            "Measure more touches",
            "The uncertainty is larger than what the tolerance leaves: repeats and further poses make it smaller.",
            format!("axiscal plan-next {} --controller {controller} --out next", m.study),
        ));
    }
}

/// Touches that do not belong to the rest are a finding of their own.
fn odd_touches(m: &Material, out: &mut Vec<Next>) {
    // touches that fit once the missing effect is in the model are no fault of theirs
    let back = |i: usize| {
        let o = &m.fit.data.observations[i];
        m.diagnosis.outliers.iter().any(|x| x.comes_back && x.id == o.id && x.run == o.run + 1)
    };
    let odd: Vec<(&usize, &String)> =
        m.fit.rejected.iter().filter(|(i, reason)| !reason.starts_with("taken out") && !back(**i)).collect();
    if odd.is_empty() {
        return;
    }
    let named: Vec<String> = odd
        .iter()
        .take(4)
        .map(|(i, _)| {
            let o = &m.fit.data.observations[**i];
            let origin = &m.fit.data.origins[**i];
            let file = m.runs.get(o.run).map_or("log", |r| r.log);
            format!(
                "touch {} ({} {}, {file}:{}, {} off)",
                o.id,
                origin.block,
                origin.face,
                origin.line,
                um(um_from_mm(m.fit.residual_mm[**i]))
            )
        })
        .collect();
    let more = odd.len().saturating_sub(named.len());
    let rest = if more > 0 { format!(" and {more} more") } else { String::new() };
    out.push(Next::new(
        format!(
            "Look at {} {} that do not belong to the rest",
            odd.len(),
            if odd.len() == 1 { "touch" } else { "touches" }
        )
        .replace("1 touch that do not belong", "1 touch that does not belong"),
        format!(
            "Chips, dirt, a false trigger? {}{rest}. {} not used.",
            named.join(", "),
            if odd.len() == 1 { "It is" } else { "They are" }
        ),
        "",
    ));
}
