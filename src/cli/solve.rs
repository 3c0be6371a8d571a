//! `axiscal solve`: the loop, step by step. Each step is proposed with its reason and confirmed by the user, or by
//! `--yes`; the loop never goes past what the test with all candidates counted in and the held-out touches allow.

use super::load::{Loaded, load_study};
use super::{Answer, Io, add};
use crate::compare::told;
use crate::diag::{Failure, Result};
use crate::diagnose::answer::{Candidate, Diagnosis};
use crate::diagnose::words::{self, list, one_of};
use crate::diagnose::{Options, Subject, Verdict, diagnose};
use crate::fit::outcome::{Outcome, Parameter, Status};
use crate::fit::{self, Fit};
use crate::report::diagnosis::wrong_sign;
use crate::report::fit::{digits, significant};
use nalgebra::{DMatrix, DVector};
use serde::Serialize;
use statrs::distribution::{ChiSquared, ContinuousCDF};
use std::io::{BufRead, IsTerminal, Write};
use std::path::{Path, PathBuf};

/// Arguments of `solve`.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The study; effects that you agree to are added in place
    pub study: PathBuf,
    /// Agree to everything that is proposed
    #[arg(long)]
    pub yes: bool,
    /// Most effects that are added
    #[arg(long, value_name = "N", default_value_t = 6)]
    pub at_most: usize,
}

/// An effect whose size has at least this chance under pure noise says nothing any more beside the later ones.
const DROP_P: f64 = 0.05;

/// What was done.
#[derive(Debug, Serialize)]
struct Solution {
    format: &'static str,
    steps: Vec<Step>,
    /// Why the loop ended.
    stopped: String,
    /// The last verdict.
    verdict: Verdict,
    /// Effects that were added and say nothing beside the later ones: they were taken out again.
    dropped: Vec<String>,
    /// Effects that were added and taken out again, because the end was not what they had promised.
    taken_back: Vec<String>,
    /// What stays open.
    open: Vec<String>,
    rms_um: f64,
    noise_um: f64,
    held_out_rms_um: Option<f64>,
    effects: Vec<String>,
}

/// One step of the loop.
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
    /// On touches that had no part in choosing the effect (the choice redone for each index visit left out).
    held_out_before_um: Option<f64>,
    held_out_after_um: Option<f64>,
    /// Standard error of the difference.
    held_out_se_um: Option<f64>,
}

/// What the user says to a proposal.
enum Reply {
    Take(String),
    Stop,
}

/// Runs `solve`. The answer is "no" when something is left that nothing explains.
///
/// # Errors
/// When the study is unusable, or nobody is there to agree.
pub fn run(args: &Args, io: &Io) -> Result<Answer> {
    let mut steps: Vec<Step> = Vec::new();
    let mut taken_back: Vec<String> = Vec::new();
    let (loaded, fit, found, stopped) = loop {
        let (loaded, fit) = look(&args.study, io)?;
        let o = &fit.outcome;
        io.say(format!(
            "--- step {}: {} um RMS left, noise {} um, chi2/dof {:.2}{}",
            steps.len() + 1,
            significant(o.rms_um),
            significant(o.noise_um),
            o.chi2_per_dof,
            left_out(&fit)
        ));
        let mut settings = loaded.settings();
        settings.quick = true;
        let subject =
            Subject { machine: &loaded.machine, catalogue: &loaded.catalogue, settings: &settings, fit: &fit };
        let planned = loaded.planned();
        let found = diagnose(subject, &Options { planned: Some(&planned), ..Options::default() })?;
        io.say(&found.says);
        let mistake = found.mistake();
        let stopped = match (&found.verdict, found.candidates.first()) {
            _ if mistake.is_some() => Some(format!(
                "a gross mistake must be put right first, and the touches made again: {}",
                mistake.unwrap_or_default()
            )),
            (Verdict::MissingEffect, Some(first)) if first.proposed => {
                if let Some(why) = unbelievable(first) {
                    Some(why)
                } else if steps.len() >= args.at_most {
                    Some(format!("{} effects were added, as many as --at-most allows", steps.len()))
                } else {
                    propose(first, io);
                    match ask(first, args.yes)? {
                        Reply::Take(id) => {
                            let change =
                                add::Args { study: args.study.clone(), effects: vec![id.clone()], dry_run: false };
                            add::add_chosen(&change, &io.inner(), first.held_out_after_um.filter(|_| first.nested))?;
                            let after_fit = look(&args.study, io)?.1;
                            let added: Vec<&str> =
                                steps.iter().map(|s| s.added.as_str()).chain([id.as_str()]).collect();
                            let refused = refused(&after_fit, &added);
                            let after = after_fit.outcome;
                            let mut same_as: Vec<String> =
                                std::iter::once(first.effect.clone()).chain(first.same_as.clone()).collect();
                            same_as.retain(|s| *s != id);
                            if refused.is_some() {
                                add::remove(&change, &io.inner())?;
                                taken_back.push(id);
                                break (loaded, fit, found, refused.unwrap_or_default());
                            }
                            steps.push(Step {
                                found: found_as(&id, &same_as, first.or_else.as_deref(), found.name_in_doubt),
                                added: id,
                                same_as,
                                never_parted: first.never_parted,
                                p_adjusted: first.p_adjusted,
                                rms_before_um: o.rms_um,
                                rms_after_um: after.rms_um,
                                held_out_before_um: first.held_out_before_um,
                                held_out_after_um: first.held_out_after_um,
                                held_out_se_um: first.held_out_se_um,
                            });
                            None
                        }
                        Reply::Stop => Some("you stopped it".to_owned()),
                    }
                }
            }
            (Verdict::Unexplained, _) if found.faint => {
                Some("what is left is as small as the noise, but for a pattern too faint to name".to_owned())
            }
            (Verdict::Unexplained, Some(first)) if found.in_question().is_some() => {
                let (beside, add) = beside(&steps, &loaded);
                Some(format!(
                    "{} passes the test{beside}, but touches that had no part in choosing it are not predicted better with it: \
                     {add}`{}` looks for touches that tell",
                    one_of(&first.effect, &first.same_as),
                    super::next::plan_next(&loaded)
                ))
            }
            (Verdict::Unexplained, _) if found.sketchable => {
                let (beside, add) = beside(&steps, &loaded);
                Some(format!(
                    "no known effect explains what is left{beside}: {add}`{}` writes its curve as a formula",
                    super::next::sketch_effect(&loaded)
                ))
            }
            (Verdict::Unexplained, _) => Some(format!(
                "no known effect explains what is left{}: {}",
                beside(&steps, &loaded).0,
                words::at_the_machine(&found)
            )),
            (Verdict::TooLittleData, _) => Some("too few touches to judge".to_owned()),
            (Verdict::MissingEffect, _) => Some("what is missing is not borne out".to_owned()),
            _ => Some("nothing is left that these touches can show".to_owned()),
        };
        if let Some(stopped) = stopped {
            break (loaded, fit, found, stopped);
        }
    };
    // names that end in something unexplained were names for a part of it, and may all be wrong
    let unexplained = found.verdict == Verdict::Unexplained && !found.faint;
    if unexplained && !steps.is_empty() {
        let each = |s: &Step| {
            format!("{}: {} > {} um RMS", s.added, significant(s.rms_before_um), significant(s.rms_after_um))
        };
        let found: Vec<String> = steps.iter().map(each).collect();
        let added: Vec<String> = steps.drain(..).map(|s| s.added).collect();
        io.say(format!("what was added ({}) is not all that is there: it is taken out again", found.join("; ")));
        let change = add::Args { study: args.study.clone(), effects: added.clone(), dry_run: false };
        add::remove(&change, &io.inner())?;
        taken_back.extend(added);
    }
    let dropped = drop_idle(args, &steps, &fit, io)?;
    let same = dropped.is_empty() && taken_back.is_empty();
    let fit = if same { fit } else { look(&args.study, io)?.1 };
    let solution = Solution {
        format: "axiscal-solution/1",
        open: open(&steps, &found, &fit.outcome),
        verdict: found.verdict,
        stopped,
        dropped,
        taken_back,
        rms_um: fit.outcome.rms_um,
        noise_um: fit.outcome.noise_um,
        held_out_rms_um: fit.outcome.held_out_rms_um,
        effects: fit.outcome.effects.clone(),
        steps,
    };
    tell(&solution, &fit, &loaded, found.mistake().is_some(), io);
    io.answer(&solution);
    let no = matches!(found.verdict, Verdict::Unexplained | Verdict::MissingEffect) || found.most_missed;
    Ok(if no { Answer::No } else { Answer::Done })
}

fn look(study: &Path, io: &Io) -> Result<(Loaded, Fit)> {
    let loaded = load_study(study, &io.inner())?;
    let fit = loaded.fit(&loaded.settings())?;
    Ok((loaded, fit))
}

/// What the model leaves of index visits that were left out of the fit, in words.
fn left_out(fit: &Fit) -> String {
    let Some(h) = fit::held_out::by_visit(fit) else { return String::new() };
    let se =
        h.standard_error_um.map_or_else(String::new, |se| format!(" ± {} (one standard error)", digits(se, Some(se))));
    format!(", {}{se} um on index visits left out", digits(h.rms_um, h.standard_error_um))
}

/// Why nobody should believe a proposal: a size far beyond what such an effect has, as names get that stand for another one.
fn unbelievable(first: &Candidate) -> Option<String> {
    (!first.plausible).then(|| {
        format!(
            "the first proposal ({}) would need more than {:.0} times its usual size: it may be a name for something else. \
             `axiscal add` puts it in if you know better",
            first.effect,
            crate::search::groups::PLAUSIBLE
        )
    })
}

/// Sizes of two added effects that go together like this are those of two names for one thing, or of two that cancel.
const TOGETHER: f64 = 0.99;

/// Why a model with these added effects is not to be believed, after the full fit.
fn refused(fit: &Fit, added: &[&str]) -> Option<String> {
    // where a combination leaves no trace the values of its members are a convention, and no sizes
    let is_told = |i: usize| {
        let u = &fit.model.unknowns[i];
        let is = |p: &Parameter| p.name == u.name && p.effect == u.effect && p.status == Status::Identified;
        fit.outcome.parameters.iter().any(is)
    };
    let of: Vec<usize> = fit
        .free
        .iter()
        .copied()
        .filter(|&i| added.contains(&fit.model.unknowns[i].effect.as_str()) && !fit.model.unknowns[i].shape)
        .filter(|&i| is_told(i))
        .collect();
    let last = added.last()?;
    for &i in of.iter().filter(|&&i| fit.model.unknowns[i].effect == *last) {
        let u = &fit.model.unknowns[i];
        let times = (fit.theta[i] / u.typical).abs();
        let sure = fit.theta[i].abs() > 2.0 * fit.covariance[(i, i)].max(0.0).sqrt();
        if u.typical > 0.0 && sure && times > crate::search::groups::PLAUSIBLE {
            return Some(format!(
                "{last} is taken back: its {} would be {times:.0} times as large as such an effect usually is",
                u.name
            ));
        }
    }
    for (k, &i) in of.iter().enumerate() {
        for &j in &of[..k] {
            let (a, b) = (&fit.model.unknowns[i], &fit.model.unknowns[j]);
            let scale = (fit.covariance[(i, i)] * fit.covariance[(j, j)]).max(0.0).sqrt();
            let r = if scale > 0.0 { fit.covariance[(i, j)] / scale } else { 0.0 };
            if a.effect != b.effect && r.abs() > TOGETHER {
                return Some(format!(
                    "{last} is taken back: these touches cannot tell its size from that of {} ({} and {} go together with a \
                     correlation of {r:.3}), so that the two may cancel",
                    if a.effect == *last { &b.effect } else { &a.effect },
                    a.name,
                    b.name
                ));
            }
        }
    }
    None
}

/// The proposal and its reason.
fn propose(first: &Candidate, io: &Io) {
    let mut sizes: Vec<String> = first
        .parameters
        .iter()
        .map(|p| match p.sigma {
            Some(sigma) => format!("{} {} ± {} {}", p.name, digits(p.value, Some(sigma)), significant(sigma), p.unit),
            None => format!("{} {} {}", p.name, significant(p.value), p.unit),
        })
        .collect();
    sizes.extend(first.not_told.iter().map(|name| format!("{name} ? (cannot be told by this plan)")));
    if let (false, Some(most)) = (first.not_told.is_empty(), first.moves_um) {
        sizes.push(format!("together up to {} um at a touch", significant(most)));
    }
    let what = match &first.same_as[..] {
        [] => match &first.or_else {
            Some(other) => format!("{} ({}, or {other}: these touches cannot tell)", first.effect, first.name),
            None => format!("{} ({})", first.effect, first.name),
        },
        others => format!("{}; if it is {}", one_of(&first.effect, others), first.effect),
    };
    io.say(format!("proposed: {what}: {} (± one standard uncertainty)", sizes.join(", ")));
    if !first.wrong_sign.is_empty() {
        io.say(format!("  {}", wrong_sign(first)));
    }
    io.say(format!("  {}", first.says));
    io.say(format!("  to confirm it: {}", first.look));
    if let (Some(before), Some(after)) = (first.held_out_before_um, first.held_out_after_um) {
        let se = first.held_out_se_um.map_or_else(String::new, |se| format!(" ± {}", digits(se, Some(se))));
        let how = if first.nested { "the choice redone for each" } else { "the effect given" };
        let fall = digits(before - after, first.held_out_se_um);
        io.say(format!(
            "  on index visits left out ({how}): {} um before, {} um with it: {fall}{se} um less",
            significant(before),
            significant(after)
        ));
    }
    if !first.same_as.is_empty() {
        io.say(format!("  these touches cannot tell it from: {}", first.same_as.join(", ")));
        io.say(format!("  to tell them apart: {}", first.tell_apart));
    }
    for w in &first.weakens {
        io.say(format!("  it makes {} more than three times less certain", w.name));
    }
}

/// Asks on the terminal; the first of the group is taken with `--yes`.
fn ask(first: &Candidate, yes: bool) -> Result<Reply> {
    if yes {
        return Ok(Reply::Take(first.effect.clone()));
    }
    if !std::io::stdin().is_terminal() {
        return Err(Failure::new("solve::nobody", "nobody is there to agree: the input is no terminal")
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
            return Ok(Reply::Stop);
        }
        match line.trim().to_lowercase().as_str() {
            "" | "y" | "yes" => return Ok(Reply::Take(first.effect.clone())),
            "n" | "no" | "q" => return Ok(Reply::Stop),
            word => {
                if let Some(member) = word.parse::<usize>().ok().and_then(|n| members.get(n.wrapping_sub(1))) {
                    return Ok(Reply::Take((*member).clone()));
                }
            }
        }
    }
}

/// What was added before something is left that nothing explains, in words: it is taken out again, and what is said of the rest
/// holds beside it only.
fn beside(steps: &[Step], loaded: &Loaded) -> (String, String) {
    if steps.is_empty() {
        return (String::new(), String::new());
    }
    let added: Vec<&str> = steps.iter().map(|s| s.added.as_str()).collect();
    let study = super::next::quoted(&loaded.path);
    (format!(" beside {}", added.join(", ")), format!("`axiscal add {study} {}` and then ", added.join(" ")))
}

/// Effects that the loop added and that say nothing any more beside the later ones (Wald), taken out again.
fn drop_idle(args: &Args, steps: &[Step], fit: &Fit, io: &Io) -> Result<Vec<String>> {
    let mut dropped = Vec::new();
    // the last one was needed a moment ago
    for step in steps.iter().rev().skip(1) {
        let of: Vec<usize> = fit.free.iter().copied().filter(|&i| fit.model.unknowns[i].effect == step.added).collect();
        let linear: Vec<usize> = of.into_iter().filter(|&i| !fit.model.unknowns[i].shape).collect();
        let theta = DVector::from_iterator(linear.len(), linear.iter().map(|&i| fit.theta[i]));
        let c = DMatrix::from_fn(linear.len(), linear.len(), |a, b| fit.covariance[(linear[a], linear[b])]);
        let Some(weight) = c.try_inverse() else { continue };
        let size2 = theta.dot(&(weight * &theta));
        let p = ChiSquared::new(linear.len() as f64).map_or(0.0, |d| d.sf(size2));
        if p > DROP_P {
            io.say(format!(
                "{} says nothing any more beside the later effects (p = {p:.2}): it is taken out",
                step.added
            ));
            let change = add::Args { study: args.study.clone(), effects: vec![step.added.clone()], dry_run: false };
            add::remove(&change, &io.inner())?;
            dropped.push(step.added.clone());
            break;
        }
    }
    Ok(dropped)
}

/// What nobody knows yet.
fn open(steps: &[Step], found: &Diagnosis, outcome: &Outcome) -> Vec<String> {
    let mut out = Vec::new();
    for s in steps.iter().filter(|s| !s.same_as.is_empty()) {
        out.push(format!("{} stands in the model and could as well be {}", s.added, list(&s.same_as)));
    }
    out.extend(outcome.undetermined.iter().map(|u| u.says.clone()));
    out.extend(outcome.weak.iter().map(|w| w.says.clone()));
    if !found.not_seen.is_empty() {
        out.push(format!("these touches cannot see: {}", found.not_seen.join(", ")));
    }
    out
}

/// What was found: one name, or those that these touches cannot tell apart, the one that stands in the model first.
fn found_as(added: &str, same_as: &[String], or_else: Option<&str>, in_doubt: bool) -> String {
    let found = match same_as {
        [] => match or_else {
            Some(other) => format!("{added}, or {other}: these touches cannot tell"),
            None => added.to_owned(),
        },
        others => format!("{} (these touches cannot tell which; {added} stands in the model)", one_of(added, others)),
    };
    let doubt = if in_doubt { " (the name may be wrong: a shape without a name described it better)" } else { "" };
    found + doubt
}

fn tell(s: &Solution, fit: &Fit, loaded: &Loaded, mistaken: bool, io: &Io) {
    let outcome = &fit.outcome;
    io.say(format!("\n--- the end: {}", s.stopped));
    let sizes = |id: &str| -> String {
        let of = outcome.parameters.iter().filter(|p: &&Parameter| p.effect == id);
        let words: Vec<String> = of
            .map(|p| match p.sigma {
                Some(sigma) => format!("{} {} ± {} {}", p.name, digits(p.value, p.sigma), significant(sigma), p.unit),
                None => match told::bracket(fit, &loaded.catalogue, p) {
                    Some(b) => b.says(),
                    None => format!("{} not told alone", p.name),
                },
            })
            .collect();
        let together = told::together(fit, id).map(|t| t.says());
        words.into_iter().chain(together).collect::<Vec<_>>().join(", ")
    };
    if !s.steps.is_empty() {
        io.say("± below: one standard uncertainty");
    }
    for step in &s.steps {
        io.say(format!(
            "found: {}: {} > {} um RMS: {}",
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
        "left: {} um RMS of a noise of {} um{}",
        significant(s.rms_um),
        significant(s.noise_um),
        s.held_out_rms_um.map_or_else(String::new, |h| format!("; {} um on index visits left out", significant(h)))
    ));
    for id in &s.taken_back {
        io.say(format!("taken back: {id}"));
    }
    for line in &s.open {
        io.say(format!("open: {line}"));
    }
    // a further program is asked for the names themselves: the study holds one of them by now
    for step in s.steps.iter().filter(|step| !step.same_as.is_empty() && !step.never_parted) {
        let asked: Vec<&str> = std::iter::once(&step.added).chain(&step.same_as).map(String::as_str).collect();
        io.say_as_it_is(format!("next: {}", super::next::plan_next_for(loaded, &asked)));
    }
    io.say_as_it_is(format!("next: axiscal history {}", super::next::quoted(&loaded.path)));
}
