//! `axiscal solve`: the loop, step by step. Each step is proposed with its reason and confirmed by the user, or by
//! `--yes`; the loop never goes past what the test with all candidates counted in and the held-out touches allow.

use super::common::of_fit;
use super::{Answer, Io, add};
use crate::compare::parameter_combinations;
use crate::diag::{Failure, Result};
use crate::diagnose::Verdict;
use crate::diagnose::answer::{Candidate, Diagnosis};
use crate::diagnose::solving::{Added, Change, Ending, Host, Refusal, State, Stop, Visited, Why};
use crate::fit::Fit;
use crate::fit::outcome::{Outcome, Parameter};
use crate::report::fit::{digits, first_remarks, per_dof, significant, with_unit};
use crate::search::groups::PLAUSIBLE;
use crate::words::diagnose::{list, machine_check, one_of};
use crate::words::diagnosis_remarks::wrong_sign;
use crate::workflow::change::Edit;
use crate::workflow::{Loaded, load_study};
use serde::Serialize;
use std::io::{BufRead, IsTerminal, Write};
use std::path::PathBuf;

#[derive(Debug, clap::Args)]
pub struct Args {
    /// The study; effects that you accept are added to it
    pub study: PathBuf,
    /// Accept everything that is proposed
    #[arg(long)]
    pub yes: bool,
    /// Most effects that are added
    #[arg(long, value_name = "N", default_value_t = 6)]
    pub at_most: usize,
    /// Accept an effect of up to so many times its usual size
    #[arg(long, value_name = "N", default_value_t = PLAUSIBLE, value_parser = times)]
    pub at_most_size: f64,
    /// All that stays open, not the first three only
    #[arg(long, short)]
    pub verbose: bool,
}

#[derive(Debug, Serialize)]
struct Solution {
    format: &'static str,
    /// Effects that were added and are in the model.
    steps: Vec<Step>,
    /// Why the loop ended.
    stopped: String,
    /// Verdict of the last model, which is the study's.
    #[serde(flatten)]
    verdict: Verdict,
    /// The same in a sentence.
    says: String,
    /// Every model that was in force, the first one first and the last one last.
    models: Vec<Visited>,
    /// Effects that were added and removed again: the model without them is as good.
    dropped: Vec<String>,
    /// Effects that were added and removed again, because the end was not what they had promised.
    taken_back: Vec<String>,
    /// What stays open.
    open: Vec<String>,
    rms_um: f64,
    noise_um: f64,
    chi2_per_dof: f64,
    held_out_rms_um: Option<f64>,
    effects: Vec<String>,
}

#[derive(Debug, Serialize)]
struct Step {
    added: String,
    /// What was found, in words: never one name where these touches cannot tell it from others.
    found: String,
    /// Effects that these touches cannot tell from it.
    same_as: Vec<String>,
    /// No touches do.
    #[serde(skip)]
    never_parted: bool,
    p_adjusted: f64,
    rms_before_um: f64,
    rms_after_um: f64,
    /// Cross-validated error of the model before it.
    held_out_before_um: Option<f64>,
    /// With it, on touches that had no part in choosing it (the choice redone for each index position left out).
    held_out_after_um: Option<f64>,
    /// Standard error of the difference.
    held_out_se_um: Option<f64>,
}

impl Step {
    fn from_added(added: &Added) -> Self {
        let Added { id, proposal, name_in_doubt, rms_um } = added;
        let mut same_as: Vec<String> = std::iter::once(&proposal.effect).chain(&proposal.same_as).cloned().collect();
        same_as.retain(|s| s != id);
        Self {
            found: found_as(id, &same_as, proposal.or_else.as_deref(), *name_in_doubt),
            added: id.clone(),
            same_as,
            never_parted: proposal.never_parted,
            p_adjusted: proposal.p_adjusted,
            rms_before_um: rms_um.0,
            rms_after_um: rms_um.1,
            held_out_before_um: proposal.held_out_before_um,
            held_out_after_um: proposal.held_out_after_um,
            held_out_se_um: proposal.held_out_se_um,
        }
    }
}

/// The terminal and the study.
struct Terminal<'a> {
    args: &'a Args,
    io: &'a Io,
}

impl Host for Terminal<'_> {
    fn looked(&mut self, state: &State, added: &[Added]) -> Result<()> {
        let (o, found) = (&state.fit.outcome, &state.found);
        self.io.say(format!(
            "--- step {}: residual {} µm RMS, noise {} µm, chi2/dof {}{}",
            added.len() + 1,
            significant(o.rms_um),
            significant(o.noise_um),
            per_dof(o.chi2_per_dof, 2),
            cross_validated(found)
        ));
        self.io.say(&found.says);
        Ok(())
    }

    fn agree(&mut self, proposal: &Candidate) -> Result<Option<String>> {
        propose(proposal, self.io);
        ask(proposal, self.args.yes)
    }

    fn change(&mut self, change: &Change, added: &[Added]) -> Result<()> {
        let of = |effects: Vec<String>| add::Args { study: self.args.study.clone(), effects, dry_run: false };
        match change {
            Change::Add(id, nested_rms_um) => {
                let args = of(vec![id.clone()]);
                add::run(&args, Edit::Add(&args.effects), *nested_rms_um, &self.io.inner())?;
            }
            Change::Remove(ids, why) => {
                self.io.say(leaves(ids, why, added));
                add::remove(&of(ids.clone()), &self.io.inner())?;
            }
        }
        Ok(())
    }
}

/// Runs `solve`. The answer is "no" when something is left that nothing explains.
///
/// # Errors
/// When the study is unusable, or nobody is there to agree.
pub fn run(args: &Args, io: &Io) -> Result<Answer> {
    let loaded = load_study(&args.study, &io.inner())?;
    let ending = loaded.solve((args.at_most, args.at_most_size), &mut Terminal { args, io })?;
    let Ending { state: State { fit, found }, models, added, dropped, taken_back, stop } = ending;
    if load_study(&args.study, &io.inner())?.study.effects != fit.outcome.effects {
        return Err(Failure::new("study::changed", format!("{} was changed meanwhile", args.study.display()))
            .help("its model is not the one that was fitted last: call `axiscal solve` again"));
    }
    // what was added and taken back is what the reason speaks of
    let beside: Vec<&str> = match added.is_empty() {
        true => taken_back.iter().map(String::as_str).collect(),
        false => added.iter().map(|a| a.id.as_str()).collect(),
    };
    let stopped = stopped(&stop, &beside, &loaded);
    let steps: Vec<Step> = added.iter().map(Step::from_added).collect();
    let solution = Solution {
        format: "axiscal-solution/1",
        open: open(&steps, &found, &fit.outcome),
        verdict: found.verdict.clone(),
        says: found.says.clone(),
        models,
        stopped,
        dropped,
        taken_back,
        rms_um: fit.outcome.rms_um,
        noise_um: fit.outcome.noise_um,
        chi2_per_dof: fit.outcome.chi2_per_dof,
        held_out_rms_um: found.held_out_rms_um,
        effects: fit.outcome.effects.clone(),
        steps,
    };
    tell(&solution, &fit, &loaded, (found.mistake().is_some(), args.verbose), io);
    io.answer(&solution);
    Ok(of_fit(&fit.outcome, if found.verdict.is_no() { Answer::No } else { Answer::Done }, io))
}

/// The model's cross-validated error, in words.
fn cross_validated(found: &Diagnosis) -> String {
    let Some(rms_um) = found.held_out_rms_um else { return String::new() };
    let se = found.held_out_se_um.filter(|se| *se > 1e-6 * rms_um);
    let doubt = se.map_or_else(String::new, |se| format!(" ± {} (one standard error)", digits(se, Some(se))));
    let rms = se.map_or_else(|| significant(rms_um), |se| digits(rms_um, Some(se)));
    format!(", cross-validated {rms}{doubt} µm")
}

/// So many times a usual size.
fn times(text: &str) -> std::result::Result<f64, String> {
    match text.parse::<f64>() {
        Ok(times) if times.is_finite() && times > 0.0 => Ok(times),
        _ => Err("write a number above 0, 5 for example".to_owned()),
    }
}

/// Why the loop ended, in words.
fn stopped(stop: &Stop, added: &[&str], loaded: &Loaded) -> String {
    let (beside, add) = beside(added, loaded);
    match stop {
        Stop::Mistake(mistake) => {
            format!("a set-up mistake must be corrected first, and the touches measured again: {mistake}")
        }
        Stop::TooLarge(effect) => format!(
            "the first proposal ({effect}) would be larger than --at-most-size allows ({PLAUSIBLE:.0} times the usual size where it is not given): another effect \
             may look like it. `axiscal add` adds it all the same"
        ),
        Stop::AtMost(n) => format!("{n} effects were added, as many as --at-most allows"),
        Stop::Refused(refusal) => not_credible(refusal),
        Stop::ByUser => "you stopped it".to_owned(),
        Stop::Faint => "the residual is as small as the noise, except for a pattern too weak to name".to_owned(),
        Stop::InQuestion(first) => format!(
            "{} passes the test{beside}, but unused measurements do not confirm it: {add}`{}` looks for touches that decide",
            one_of(&first.effect, &first.same_as),
            crate::words::next_calls::plan_next(loaded)
        ),
        Stop::Sketchable => format!(
            "no known effect explains the rest{beside}: {add}`{}` writes its curve as a formula",
            crate::words::next_calls::sketch_effect(loaded)
        ),
        Stop::Unexplained(check) => format!("no known effect explains the rest{beside}: {}", machine_check(check)),
        Stop::TooLittleData => "too few touches to judge".to_owned(),
        Stop::NotConfirmed => "what is missing is not confirmed".to_owned(),
        Stop::Nothing => "the model is complete as far as these touches can measure".to_owned(),
    }
}

/// Why an effect was not kept, in words.
fn not_credible(refusal: &Refusal) -> String {
    match refusal {
        Refusal::TooLarge { effect, parameter, times } => {
            format!("{effect} is removed again: its {parameter} would be {times:.0} times its usual size")
        }
        Refusal::Together { effect, other, parameters: [a, b], r } => format!(
            "{effect} is removed again: these touches cannot separate it from {other} (correlation of {a} and {b}: {r:.3}), so the two may \
             cancel"
        ),
    }
}

/// Why effects are removed from the model, in words.
fn leaves(ids: &[String], why: &Why, added: &[Added]) -> String {
    match why {
        Why::Refused(refusal) => not_credible(refusal),
        Why::Worse => {
            let each =
                |a: &Added| format!("{}: {} > {} µm RMS", a.id, significant(a.rms_um.0), significant(a.rms_um.1));
            let all: Vec<String> = added.iter().map(each).collect();
            format!("The added effects ({}) do not explain all of the error. They are removed again.", all.join("; "))
        }
        Why::Idle(as_good) => {
            let (fall, se) = as_good.fall_um;
            format!(
                "{} is no longer needed and is removed: the model without it fits as well (p = {:.2}), and its cross-validated \
                 error changes by {} ± {} µm.",
                ids.join(", "),
                as_good.p,
                digits(fall, Some(se)),
                digits(se, Some(se))
            )
        }
    }
}

fn propose(first: &Candidate, io: &Io) {
    let mut sizes: Vec<String> = first
        .parameters
        .iter()
        .map(|p| match p.sigma {
            Some(sigma) => {
                let size = format!("{} ± {}", digits(p.value, Some(sigma)), significant(sigma));
                format!("{} {}", p.name, with_unit(size, &p.unit))
            }
            None => format!("{} {}", p.name, with_unit(significant(p.value), &p.unit)),
        })
        .collect();
    sizes.extend(first.not_told.iter().map(|name| format!("{name} ? (cannot be determined with this plan)")));
    if let (false, Some(most)) = (first.not_told.is_empty(), first.moves_um) {
        sizes.push(format!("together up to {} µm at a touch", significant(most)));
    }
    let what = match &first.same_as[..] {
        [] => match &first.or_else {
            Some(other) => format!("{} ({}, or {other}: these touches cannot separate them)", first.effect, first.name),
            None => format!("{} ({})", first.effect, first.name),
        },
        others => format!("{}; if it is {}", one_of(&first.effect, others), first.effect),
    };
    io.say(format!("proposed: {what}: {} (± one standard uncertainty)", sizes.join(", ")));
    if !first.wrong_sign.is_empty() {
        io.say(format!("  {}", wrong_sign(first)));
    }
    if let Some(other) = &first.together_with {
        io.say(format!("  named together with {other}, which is judged again when this effect is in the model"));
    }
    io.say(format!("  {}", first.says));
    io.say(format!("  check at the machine: {}", first.look));
    if let (Some(before), Some(after)) = (first.held_out_before_um, first.held_out_after_um) {
        let se = first.held_out_se_um.map_or_else(String::new, |se| format!(" ± {}", digits(se, Some(se))));
        let how = if first.nested { "choice repeated for each" } else { "effect given" };
        let fall = digits(before - after, first.held_out_se_um);
        io.say(format!(
            "  cross-validated error ({how}): {} µm before, {} µm with {}: {fall}{se} µm less",
            significant(before),
            significant(after),
            if first.together_with.is_some() { "both" } else { "it" }
        ));
    }
    if !first.same_as.is_empty() {
        io.say(format!("  these touches cannot separate it from: {}", first.same_as.join(", ")));
        io.say(format!("  to separate them: {}", first.tell_apart));
    }
    for w in &first.weakens {
        io.say(format!("  {} becomes more than three times less certain", w.name));
    }
}

/// Asks on the terminal; the first of the group is taken with `--yes`.
fn ask(first: &Candidate, yes: bool) -> Result<Option<String>> {
    if yes {
        return Ok(Some(first.effect.clone()));
    }
    if !std::io::stdin().is_terminal() {
        return Err(Failure::new("solve::nobody", "the input is not a terminal: the proposal cannot be confirmed")
            .help("call with --yes to agree to everything that is proposed"));
    }
    let members: Vec<&String> = std::iter::once(&first.effect).chain(&first.same_as).collect();
    loop {
        let choice = if members.len() > 1 {
            let list: Vec<String> = members.iter().enumerate().map(|(i, m)| format!("{} {m}", i + 1)).collect();
            format!("add it? [Y]es, [n]o, or a number ({})", list.join(", "))
        } else {
            "add it? [Y]es or [n]o".to_owned()
        };
        let _ = write!(std::io::stderr(), "{choice}: ");
        let mut line = String::new();
        if std::io::stdin().lock().read_line(&mut line).unwrap_or(0) == 0 {
            return Ok(None);
        }
        match line.trim().to_lowercase().as_str() {
            "" | "y" | "yes" => return Ok(Some(first.effect.clone())),
            "n" | "no" | "q" => return Ok(None),
            word => {
                if let Some(member) = word.parse::<usize>().ok().and_then(|n| members.get(n.wrapping_sub(1))) {
                    return Ok(Some((*member).clone()));
                }
            }
        }
    }
}

/// What was added before something is left that nothing explains, in words: it is taken out again, and what is said of the rest
/// holds beside it only.
fn beside(added: &[&str], loaded: &Loaded) -> (String, String) {
    if added.is_empty() {
        return (String::new(), String::new());
    }
    let study = crate::words::command::quoted_path(&loaded.path);
    (format!(" beside {}", added.join(", ")), format!("`axiscal add {study} {}` and then ", added.join(" ")))
}

/// What nobody knows yet.
fn open(steps: &[Step], found: &Diagnosis, outcome: &Outcome) -> Vec<String> {
    let mut out = Vec::new();
    for s in steps.iter().filter(|s| !s.same_as.is_empty()) {
        out.push(format!("{} is in the model; it could also be {}", s.added, list(&s.same_as)));
    }
    out.extend(outcome.undetermined.iter().map(|u| u.says.clone()));
    out.extend(outcome.weak.iter().map(|w| w.says.clone()));
    if !found.not_seen.is_empty() {
        out.push(format!("cannot be seen with these touches: {}", found.not_seen.join(", ")));
    }
    out
}

/// What was found: one name, or those that these touches cannot tell apart, the one that stands in the model first.
fn found_as(added: &str, same_as: &[String], or_else: Option<&str>, in_doubt: bool) -> String {
    let found = match same_as {
        [] => match or_else {
            Some(other) => format!("{added}, or {other}: these touches cannot separate them"),
            None => added.to_owned(),
        },
        others => format!("{} (these touches cannot separate them; {added} is in the model)", one_of(added, others)),
    };
    let doubt =
        if in_doubt { " (the name may be wrong: a pattern that no listed effect explains fits better)" } else { "" };
    found + doubt
}

fn tell(s: &Solution, fit: &Fit, loaded: &Loaded, (mistaken, verbose): (bool, bool), io: &Io) {
    let outcome = &fit.outcome;
    io.say(format!("\n--- the end: {}", s.stopped));
    let sizes = |id: &str| -> String {
        let of = outcome.parameters.iter().filter(|p: &&Parameter| p.effect == id);
        let words: Vec<String> = of
            .map(|p| match p.sigma {
                Some(sigma) => {
                    let size = format!("{} ± {}", digits(p.value, p.sigma), significant(sigma));
                    format!("{} {}", p.name, with_unit(size, &p.unit))
                }
                None => match parameter_combinations::bracket(fit, &loaded.catalogue, p) {
                    Some(b) => b.says(),
                    None => format!("{} cannot be determined alone", p.name),
                },
            })
            .collect();
        let together = parameter_combinations::together(fit, id).map(|t| t.says());
        words.into_iter().chain(together).collect::<Vec<_>>().join(", ")
    };
    if !s.steps.is_empty() {
        io.say("± below: one standard uncertainty");
    }
    for step in &s.steps {
        io.say(format!(
            "found: {}: {} > {} µm RMS: {}",
            step.found,
            significant(step.rms_before_um),
            significant(step.rms_after_um),
            sizes(&step.added)
        ));
    }
    if mistaken {
        // what is left over says nothing of the machine
        return;
    }
    io.say(format!(
        "residual: {} µm RMS, noise {} µm{}",
        significant(s.rms_um),
        significant(s.noise_um),
        s.held_out_rms_um.map_or_else(String::new, |h| format!("; cross-validated {} µm", significant(h)))
    ));
    for id in &s.taken_back {
        io.say(format!("removed again: {id}"));
    }
    let open: Vec<String> = s.open.iter().map(|line| format!("open: {line}")).collect();
    if !open.is_empty() {
        io.say(first_remarks(&open, verbose).trim_end());
    }
    // it asks about the group of every step that the history has
    if s.steps.iter().any(|step| !step.same_as.is_empty() && !step.never_parted) {
        io.say_as_it_is(format!("next: {}", crate::words::next_calls::plan_next(loaded)));
    }
    io.say_as_it_is(format!("next: axiscal history {}", crate::words::command::quoted_path(&loaded.path)));
}
