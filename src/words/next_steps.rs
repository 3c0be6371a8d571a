//! What to do next, the first thing first.

use super::command::{
    SUPPOSED_CONTROLLER, about_controller, beside_the_study, for_controller, larger_program, quoted, study,
};
use super::headline::{Headline, Level, capital, in_question, named, size, um};
use crate::diagnose::Verdict;
use crate::diagnose::answer::Candidate;
use crate::diagnose::consequence::Consequence;
use crate::diagnose::next_step::NextStep;
use crate::diagnose::verdict::{NotNamed, Unexplained};
use crate::post::Postprocessor;
use crate::tables::control;
use crate::units::um_from_mm;
use crate::view::Material;
use crate::view::record::{Compensation, Judgement, ParameterRecord};
use serde::Serialize;

/// A thing to do.
#[derive(Debug, Clone, Serialize)]
pub struct Next {
    /// What to do.
    pub what: String,
    /// How, or why.
    pub how: String,
    /// What to type; empty where nothing is typed.
    pub command: String,
    /// What the workbench does about it when it is asked to.
    pub act: Act,
}

/// What the workbench can do itself.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
#[serde(tag = "do", rename_all = "kebab-case")]
pub enum Act {
    /// A person does it, at the machine or in the terminal.
    Nothing,
    /// Adds the effect to the model.
    Add {
        /// Its id.
        effect: String,
    },
    /// Writes a program of further touches.
    MeasureMore,
    /// Writes the compensation.
    Export,
    /// Writes a starting formula.
    Sketch,
}

impl Next {
    fn new(what: impl Into<String>, how: impl Into<String>, command: impl Into<String>) -> Self {
        Self { what: what.into(), how: how.into(), command: command.into(), act: Act::Nothing }
    }

    fn with(self, act: Act) -> Self {
        Self { act, ..self }
    }
}

/// What to do, the first thing first.
pub(crate) fn next(m: &Material, headline: &Headline, parameters: &[ParameterRecord], c: &Compensation) -> Vec<Next> {
    let mut out = Vec::new();
    let plan_next = format!("axiscal plan-next {} {} --out next", study(m), for_controller(m));
    let about = about_controller(m);
    let d = m.diagnosis;
    match &d.verdict {
        _ if d.next_step() == NextStep::CorrectSetupMistake => {
            let look = d.candidates.first().map(|c| c.look.clone()).filter(|look| !look.is_empty());
            let how = look.or_else(|| d.mistake()).unwrap_or_default();
            out.push(Next::new("Correct the set-up mistake and measure again", capital(&how), ""));
        }
        Verdict::TooLittleData(_) => out.push(Next::new(
            "Measure more touches",
            format!("A larger program measures what this one cannot. First check that the log belongs to the plan and that the blocks are where it says.{about}"),
            larger_program(m),
        )),
        Verdict::MissingEffect(_) => {
            let clear = if let NextStep::Add(clear) = d.next_step() { Some(clear) } else { None };
            if let Some(first) = clear.or(d.candidates.first()) {
                found(m, first, &plan_next, c, &mut out);
            }
        }
        Verdict::Unexplained(u) => match (&u.why, d.next_step() == NextStep::MeasureMore) {
            (NotNamed::WeakPattern, true) => {
                out.push(Next::new(
                    "Measure more touches",
                    format!("Repeats and further poses show whether the weak pattern is real.{about}"),
                    plan_next.clone(),
                ).with(Act::MeasureMore));
                // what could be wrong by more than its tolerance would be refused
                let within =
                    |c: &Consequence| m.tolerance.limit(&c.parameter, &c.unit).is_none_or(|limit| c.off <= limit);
                if d.consequences.iter().all(within) && c.refused.is_none() {
                    compensate(m, parameters, c, &mut out);
                }
            }
            (NotNamed::CannotBeConfirmed(effects), _) => which(m, effects, &plan_next, &mut out),
            (_, true) => {
                let what = d.in_question().map_or_else(|| "one of these effects".to_owned(), |c| in_question(m, c));
                let how = format!("Touches at further poses show whether it is {what}.{about}");
                out.push(Next::new("Measure more index positions", how, plan_next.clone()).with(Act::MeasureMore));
            }
            (_, false) => unexplained(m, u, &mut out),
        },
        Verdict::Adequate => {
            if let NextStep::CheckSize(o) = d.next_step() {
                let how = capital(&super::oversized::check(o));
                out.push(Next::new(format!("Check {}: it is far too large", o.parameter), how, ""));
            }
            settled(m, headline, parameters, c, &mut out);
        }
    }
    if !m.fit.outcome.undetermined.is_empty() && (d.verdict == Verdict::Adequate || d.verdict.is_weak_pattern()) {
        let how = m.fit.outcome.undetermined.iter().flat_map(|u| u.parted_by.first()).next();
        let how = how.map_or_else(|| "A program that measures what these touches cannot.".to_owned(), Clone::clone);
        let how = format!("{}{about}", capital(&how));
        out.push(Next::new("Measure what cannot be determined yet", how, plan_next).with(Act::MeasureMore));
    }
    odd_touches(m, &mut out);
    out
}

/// Where several effects explain it and these poses cannot separate them: touches that can.
fn which(m: &Material, open: &[String], plan_next: &str, out: &mut Vec<Next>) {
    const MOST: usize = 4;
    let mut names: Vec<String> = open.iter().take(MOST).map(|id| named(m, id)).collect();
    if open.len() > MOST {
        names.push(format!("{} more", open.len() - MOST));
    }
    out.push(
        Next::new(
            "Measure further poses",
            format!("The touches that show most of what may be missing: {}.", names.join("; ")) + about_controller(m),
            plan_next,
        )
        .with(Act::MeasureMore),
    );
    out.push(Next::new(
        "Or run the full program",
        "It has the poses in which every known effect shows, and some to confirm the answer.",
        larger_program(m),
    ));
}

fn found(m: &Material, first: &Candidate, plan_next: &str, c: &Compensation, out: &mut Vec<Next>) {
    let one_of_several = if first.same_as.is_empty() { String::new() } else { format!("If it is {}: ", first.name) };
    if !first.same_as.is_empty() {
        let command = if first.never_parted { "" } else { plan_next };
        let act = if first.never_parted { Act::Nothing } else { Act::MeasureMore };
        out.push(Next::new("Find out which of them it is", capital(&first.tell_apart), command).with(act));
    }
    let what = match &first.together_with {
        Some(_) => format!("Add one of the two to the model: {}", first.name),
        None => "Add it to the model".to_owned(),
    };
    out.push(
        Next::new(
            what,
            "The error falls and the other values become right. This page then shows the next step.",
            format!("axiscal add {} {}", study(m), quoted(&first.effect)),
        )
        .with(Act::Add { effect: first.effect.clone() }),
    );
    // an effect of a person's own may not say where
    if !first.look.is_empty() {
        out.push(Next::new("Check at the machine", format!("{one_of_several}{}", first.look), ""));
    }
    let mends = m.catalogue.get(&first.effect, m.machine).map_or("", |e| e.mends.as_str());
    if !mends.is_empty() {
        out.push(Next::new("How to correct it", format!("{one_of_several}{mends}"), ""));
    }
    let known = m.proposed.map(|fit| crate::view::parameters::parameters(m, fit)).unwrap_or_default();
    let beyond = known.iter().filter(|p| p.judgement == Judgement::Beyond);
    let is_named = |p: &&ParameterRecord| m.diagnosis.proposed().iter().any(|named| named.effect == p.effect);
    let large: Vec<&ParameterRecord> = beyond.filter(|p| !is_named(p) && is_carried(c, p)).collect();
    let ratio = |p: &ParameterRecord| p.tolerance.map_or(0.0, |t| p.value.abs() / t);
    if let Some(worst) = large.iter().max_by(|a, b| ratio(a).total_cmp(&ratio(b))) {
        let n = large.len();
        out.push(Next::new(
            "Then compensate",
            format!(
                "{} the tolerance: {} is {}.",
                if n == 1 { "One error exceeds".to_owned() } else { format!("{n} errors exceed") },
                worst.name,
                worst.at_radius_um.map_or_else(|| size(worst, m), um)
            ),
            "",
        ));
    }
}

/// Does a compensation hold it? What the probe or the blocks do is no error of the machine, and no table holds it.
fn is_carried(c: &Compensation, p: &ParameterRecord) -> bool {
    let left = c.left.iter().any(|l| l.known && crate::symbols::same(&l.parameter, &p.name));
    let term = c.terms.iter().any(|t| t.effect.split('+').any(|e| e == p.effect));
    let shape = c.shapes.iter().any(|s| s.parameter == p.name);
    !left && (term || shape || (c.tool_length_mm.is_some() && p.effect == "tool-length"))
}

fn unexplained(m: &Material, found: &Unexplained, out: &mut Vec<Next>) {
    let d = m.diagnosis;
    if let Some(gross) = d.gross.first() {
        out.push(Next::new("Check for a set-up mistake", gross.says.clone(), ""));
    }
    if let Some(shape) = &d.shape {
        let depends = d.depends.first().map_or("", |w| w.says.as_str());
        let kind = if shape.kind.is_empty() { String::new() } else { format!("{}. ", capital(&shape.kind)) };
        out.push(Next::new("Check at the machine", format!("{kind}{depends}."), ""));
    }
    if let NextStep::CorrectAtMachine(check) = d.next_step() {
        let how = capital(&crate::words::diagnose::machine_check(check)) + ".";
        out.push(Next::new("Correct it at the machine", how, ""));
    }
    if !found.sketchable {
        return;
    }
    out.push(
        Next::new(
            "Write it as a formula",
            "A starting formula for what no known effect explains. Then add it to the model.",
            format!("axiscal sketch-effect {} --out my-effects.toml", study(m)),
        )
        .with(Act::Sketch),
    );
}

fn settled(m: &Material, headline: &Headline, parameters: &[ParameterRecord], c: &Compensation, out: &mut Vec<Next>) {
    if let Some(why) = &c.refused {
        out.push(Next::new(
            "Do not compensate yet",
            format!(
                "{}. Such values come from a set-up mistake: check blocks, directions and lengths first.",
                capital(why)
            ),
            "",
        ));
        return;
    }
    let beyond: Vec<&ParameterRecord> = parameters.iter().filter(|p| p.judgement == Judgement::Beyond).collect();
    compensate(m, parameters, c, out);
    for p in beyond.iter().filter(|p| !is_carried(c, p)).take(2) {
        out.push(Next::new(format!("Correct {}", p.says), p.mends.clone(), ""));
    }
    if headline.level == Level::Good {
        out.push(Next::new(
            "Nothing needs to be done",
            "Keep this study. `axiscal verify` compares the next measurement with it.",
            "",
        ));
    }
    if beyond.is_empty() && parameters.iter().any(|p| p.judgement == Judgement::Open) {
        out.push(
            Next::new(
                "Measure more touches",
                "The uncertainty is too large for this tolerance. Repeats and further poses reduce it.".to_owned()
                    + about_controller(m),
                format!("axiscal plan-next {} {} --out next", study(m), for_controller(m)),
            )
            .with(Act::MeasureMore),
        );
    }
}

/// The command that writes the compensation, where it carries an error that is larger than its tolerance.
fn compensate(m: &Material, parameters: &[ParameterRecord], c: &Compensation, out: &mut Vec<Next>) {
    if !parameters.iter().any(|p| p.judgement == Judgement::Beyond && is_carried(c, p)) {
        return;
    }
    let (controller, accepts) = export_to(m);
    let word = quoted(&controller);
    let mut how = "The values go into the control as its own tables. The README beside them says how, and what must be set again.".to_owned();
    if !accepts.is_empty() {
        how += &format!(
            " With --accept-unverified you accept table entries that were not tried on a real control ({}): compare each with the control's manual before you load it.",
            few(&accepts)
        );
    }
    how += about_controller(m);
    if controller == crate::tables::linuxcnc::CONTROLLER {
        how += " With --ini FILE, the machine's INI file, its present values are added to; without it changes are listed in place of some values.";
    } else {
        how += " With --backup FILE, the control's own backup, its present values are added to; without it a sheet lists by how much each value changes.";
    }
    let flag = if accepts.is_empty() { "" } else { " --accept-unverified" };
    out.push(
        Next::new(
            "Load the compensation",
            how,
            format!("axiscal export {} --controller {word} --out compensation{flag}", study(m)),
        )
        .with(Act::Export),
    );
    out.push(Next::new(
        "Measure again and compare",
        "Run the same program with the compensation loaded and make a study of it. `axiscal verify` compares the two and shows whether it works.",
        "",
    ));
}

/// Names in a sentence, most of them counted.
fn few(names: &[String]) -> String {
    const MOST: usize = 4;
    let shown = names.iter().take(MOST).cloned().collect::<Vec<_>>().join(", ");
    if names.len() > MOST { format!("{shown} and {} more", names.len() - MOST) } else { shown }
}

/// The controller of the runs that has tables, and its entries that were not run on a real control.
fn export_to(m: &Material) -> (String, Vec<String>) {
    let linuxcnc = crate::tables::linuxcnc::CONTROLLER;
    let of_runs = || m.runs.iter().map(|r| r.controller);
    let tables = |name: &str| Postprocessor::built_in_tables(name);
    let by_position = m.correction.is_ok_and(|c| !(c.shapes.is_empty() && c.across.is_empty()));
    if let Some(name) = of_runs().find(|name| *name == linuxcnc || tables(name).is_some()) {
        return (name.to_owned(), tables(name).map_or_else(Vec::new, |t| control::not_run(m.machine, t, by_position)));
    }
    // a file of the user's own: what it holds is not known here
    let own = of_runs().find(|name| name.ends_with(".toml") || name.contains('/'));
    match own {
        Some(name) => (beside_the_study(m, name), vec![format!("entries of {name} that name no document")]),
        None => (SUPPOSED_CONTROLLER.to_owned(), Vec::new()),
    }
}

/// Outliers are a finding of their own.
fn odd_touches(m: &Material, out: &mut Vec<Next>) {
    // touches that fit once the missing effect is in the model are no fault of theirs
    let back = |i: usize| {
        let o = &m.fit.data.observations[i];
        m.diagnosis.outliers.iter().any(|x| x.comes_back && x.id == o.id && x.run == o.run + 1)
    };
    let odd: Vec<(&usize, &crate::fit::Reason)> =
        m.fit.rejected.iter().filter(|(i, reason)| reason.is_outlier() && !back(**i)).collect();
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
        if odd.len() == 1 { "Check 1 outlier".to_owned() } else { format!("Check {} outliers", odd.len()) },
        format!(
            "{}{rest}. Look for chips, dirt or a false trigger. {} excluded.",
            capital(&named.join(", ")),
            if odd.len() == 1 { "It is" } else { "They are" }
        ),
        "",
    ));
}
