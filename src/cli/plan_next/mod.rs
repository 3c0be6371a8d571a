//! `axiscal plan-next`: the probing program that best separates what the data of a study cannot tell apart.

mod choose;
mod join;
mod write_program;

use super::load::{Loaded, load_study};
use super::new::relative;
use super::{Answer, Io};
use crate::design;
use crate::design::questions::{Pair, Questions, Suspect};
use crate::design::{LinearisedPlan, Room};
use crate::diag::{Failure, Finding, Result, source};
use crate::diagnose::verdict::{NotNamed, TooLittle};
use crate::diagnose::{self, Subject, Verdict, diagnose};
use crate::fit::candidates::NoValue;
use crate::fit::{Fit, Settings, effects_of};
use crate::model::catalogue::{Catalogue, Effect};
use crate::post::Postprocessor;
use crate::search::distinguishability::SEEN;
use choose::{Chosen, SAFELY, Setting, says};
use join::{join, plan_of};
use nalgebra::DVector;
use serde_json::json;
use std::path::PathBuf;
use write_program::write;

/// Other blocks are worth the trouble when they part effects so many times better.
const WORTH_MOVING: f64 = 1.5;

/// A program must part effects by so much more than the touches that there are.
const GAIN: f64 = 1.02;

/// Arguments of `plan-next`.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The study
    pub study: PathBuf,
    /// Folder for the program and its plan
    #[arg(long, short, value_name = "DIR")]
    pub out: PathBuf,
    /// Name of the controller, or a postprocessor file
    #[arg(long, short)]
    pub controller: String,
    /// How long the program may take, minutes (without mounting other blocks)
    #[arg(long, default_value_t = 10.0)]
    pub minutes: f64,
    /// The effects to separate (default: those that the data leave open)
    #[arg(long, value_delimiter = ',')]
    pub effects: Vec<String>,
    /// The blocks were mounted again since the last run, or will be: their positions are unknown again
    #[arg(long)]
    pub moved: bool,
    /// Add this log of the program to the study as its next run, instead of writing a program
    #[arg(long, value_name = "LOG")]
    pub join: Option<PathBuf>,
}

fn warn(said: impl Iterator<Item = String>, io: &Io) {
    io.report(&said.map(|w| Finding::warning("next::left_out", w)).collect::<Vec<_>>());
}

/// Runs `plan-next`.
///
/// # Errors
/// When the study is unusable, an effect is unknown, or nothing can be reached.
pub fn run(args: &Args, io: &Io) -> Result<Answer> {
    // a run that is joined changes the study: nobody else does so until it is written
    let _alone = if args.join.is_some() { Some(crate::files::lock(&args.study)?) } else { None };
    let loaded = load_study(&args.study, io)?;
    let name = format!("next-{}", loaded.study.data.len() + 1);
    let plan_file = args.out.join(format!("{name}.plan.json"));
    if let Some(log) = &args.join {
        return join(args, &loaded, &plan_of(log, &args.out).unwrap_or(plan_file), log, io);
    }
    if !(args.minutes.is_finite() && args.minutes > 0.0 && args.minutes < 1e5) {
        return Err(Failure::new("next::minutes", "the time is no usable number").help("write --minutes more than 0"));
    }
    let (post, findings) = Postprocessor::load_built_in_or_file(&args.controller)?;
    io.report(&findings);
    let mut settings = loaded.settings();
    settings.effects.retain(|e| !args.effects.contains(e));
    settings.quick = true;
    let named = effects_of(&args.effects, &loaded.catalogue, &loaded.machine)?;
    let look = |settings: &Settings| -> Result<(Fit, diagnose::Diagnosis)> {
        let fit = loaded.fit(settings)?;
        let subject = Subject { machine: &loaded.machine, catalogue: &loaded.catalogue, settings, fit: &fit };
        // which mistake made touches miss is asked of the plans
        let planned = if fit.data.mostly_missed() { loaded.planned() } else { Vec::new() };
        let planned = fit.data.mostly_missed().then_some(&planned[..]);
        let found =
            diagnose(subject, &diagnose::Options { power: false, refit: false, planned, ..Default::default() })?;
        Ok((fit, found))
    };
    let (mut fit, mut found) = look(&settings)?;
    if let Some(mistake) = found.mistake() {
        let says = format!("a set-up mistake must be corrected first, and the touches measured again: {mistake}");
        return Ok(refuse(&says, &found.says, io));
    }
    let nothing_determined = matches!(found.verdict, Verdict::TooLittleData(TooLittle::NothingDetermined(_)));
    if named.is_empty() && nothing_determined {
        design::explain(&loaded.machine, &loaded.catalogue, &loaded.runs(), &mut fit)?;
        let help = match &fit.outcome.parted_together[..] {
            [] => "run the program to its end, or touch in more poses, and ask again".to_owned(),
            remedies => {
                format!("run the program to its end; or add touches that determine them: {}", remedies.join("; and "))
            }
        };
        return Ok(refuse(&format!("the model's own errors must be determined first. {}", found.says), &help, io));
    }
    let open = diagnose::Diagnosis::leaves_open;
    if named.is_empty() && !open(&found) {
        // what was added last may stand for others that the same touches could not tell from it: still an open question
        let added = last_added(args, &loaded)?;
        let mut before = settings.clone();
        before.effects.retain(|e| !added.contains(e));
        if before.effects.len() < settings.effects.len() {
            let (fit_before, then) = look(&before)?;
            let group = then.open.suspects.iter().any(|s| added.contains(&s.id)) && !then.open.pairs.is_empty();
            if open(&then) && group {
                (settings, fit, found) = (before, fit_before, then);
            }
        }
    }
    let mut setting = Setting::new(&loaded, &settings.effects, &fit)?;
    let unexplained = found.verdict.unexplained().filter(|_| named.is_empty() && !open(&found));
    // further touches show whether a weak pattern is there. A clear one is there, and no known effects have to be separated
    let weak = unexplained.is_some_and(|u| u.why == NotNamed::WeakPattern && u.sketchable);
    let sketched =
        if weak && found.verdict.moved_block().is_none() { Sketched::of(&loaded, &settings, &fit) } else { None };
    if let (Some(unexplained), None) = (unexplained, &sketched) {
        let help = match unexplained.sketchable {
            true => format!("{} writes what is seen as a formula", super::next::sketch_effect(&loaded)),
            false => crate::words::diagnose::machine_check(&unexplained.check),
        };
        return Ok(refuse(
            &format!("no known effect explains the residual, so there are no effects to separate. {}", found.says),
            &help,
            io,
        ));
    }
    let questions = if let Some(s) = &sketched {
        Questions {
            pairs: vec![Pair { one: s.effect.id.clone(), other: None }],
            suspects: vec![Suspect { id: s.effect.id.clone(), size: s.size.clone(), shape: None }],
            says: format!("is this weak pattern real? {}", s.says),
        }
    } else if named.is_empty() {
        warn(found.warnings.iter().cloned(), io);
        if open(&found) {
            // as its tests allow for it
            setting.noise.tau_mm = found.open.tau_mm;
            Questions::left_open(found.open.suspects, &found.open.pairs)
        } else {
            let view = LinearisedPlan::new(&setting.task, &setting.runs, &setting.known, setting.noise)?;
            warn(view.left_out.iter().map(NoValue::left_out).filter(|says| !found.warnings.contains(says)), io);
            let asked = Questions::of_plan(&view);
            match found.verdict {
                Verdict::TooLittleData(_) => Questions {
                    says: format!("{} These effects would be confounded if one of them acted", found.says),
                    ..asked
                },
                _ => asked,
            }
        }
    } else {
        Questions::named(&args.effects)
    };
    if questions.pairs.is_empty() {
        io.say("the touches of this study separate all effects: no further program is needed");
        io.answer(&json!({ "format": "axiscal-next/1", "pairs": [], "says": "nothing is confounded" }));
        return Ok(Answer::Done);
    }
    let asked: Vec<String> =
        questions.pairs.iter().flat_map(|p| std::iter::once(p.one.clone()).chain(p.other.clone())).collect();
    let mut effects: Vec<(&Effect, Option<f64>)> = Vec::new();
    for id in &asked {
        let shape = questions.suspects.iter().find(|s| s.id == *id).and_then(|s| s.shape);
        let known = effects.iter().any(|(e, _)| e.id == *id);
        let own = sketched.as_ref().map(|s| &s.effect).filter(|e| e.id == *id);
        let effect = own.or_else(|| loaded.catalogue.get(id, &loaded.machine));
        effects.extend(effect.filter(|_| !known).map(|e| (e, shape)));
    }
    let asked_of = LinearisedPlan::with_effects(&setting.task, &setting.runs, &setting.known, setting.noise, &effects)?;
    if let Some(bad) = asked_of.left_out.first() {
        return Err(Failure::new("next::no_value", bad.left_out())
            .help("write its formula so that it has a value at every touch, or ask for other effects"));
    }
    let budget_s = 60.0 * args.minutes;
    let stands = setting.stands(&loaded.machine, args.moved);
    let mut best: Option<Chosen> = None;
    // what goes with the temperature is told from what goes with time where the room turns, and not by touches alone
    let of_room = |e: &Effect| e.terms.iter().any(|t| t.formula.variables().contains(&"T"));
    let of_room = setting.task.temperature && effects.iter().any(|(e, _)| of_room(e));
    if let Some((mounting, label)) = &stands {
        let choose = |s: &Setting| s.choose(mounting, label.as_deref(), &effects, &questions, budget_s, &name).ok();
        best = choose(&setting);
        if of_room && !best.as_ref().is_some_and(|b| b.settles(SEEN)) {
            setting.room = Room::Swings;
            let turned = choose(&setting);
            setting.room = Room::GoesOn;
            if let Some(mut turned) = turned.filter(|t| best.as_ref().is_none_or(|b| t.told() > b.told())) {
                turned.if_the_room_turns(setting.told(
                    &turned.generated.plan,
                    label.as_deref(),
                    &effects,
                    &questions,
                )?);
                best = Some(turned);
            }
        }
    }
    // other blocks only where those that stand there cannot settle it, and only if they may be put up
    if !best.as_ref().is_some_and(|b| b.settles(SEEN)) {
        let settled = |p: usize| best.as_ref().is_some_and(|b| b.separations[p].most() >= SEEN);
        setting.wanted = (0..questions.pairs.len()).filter(|&p| !settled(p)).collect();
        let others = loaded.machine.mountings.iter();
        let others = others.filter_map(|m| setting.choose(m, None, &effects, &questions, budget_s, &name).ok());
        let better = others.filter(|o| best.as_ref().is_none_or(|b| o.worth() > WORTH_MOVING * b.worth()));
        let most = better.max_by(|a, b| a.worth().total_cmp(&b.worth()));
        if let Some(other) = most {
            if args.moved || stands.is_none() {
                best = Some(other);
            } else if other.told() > best.as_ref().map_or(0, Chosen::told) {
                io.report(&[Finding::info(
                    "next::other_blocks",
                    format!(
                        "with mounting {:?} mounted again, {} of {} pairs would be separated",
                        other.generated.plan.mounting,
                        other.told(),
                        other.separations.len()
                    ),
                )
                .help("add --moved for that program")]);
            }
        }
    }
    warn(setting.holes.borrow().iter().cloned(), io);
    let never = setting.never(&questions);
    if never.len() == questions.pairs.len() {
        let says = format!(
            "no touches that this machine can make, with its blocks and styli, tell these apart: {} do the same wherever it \
             touches",
            never.join(", ")
        );
        let looks: Vec<String> =
            effects.iter().filter(|(e, _)| !e.look.is_empty()).map(|(e, _)| format!("{}: {}", e.id, e.look)).collect();
        return Ok(refuse(&says, &format!("look at the machine which it is. {}", looks.join(". ")), io));
    }
    let Some(mut chosen) = best else {
        return Err(Failure::new("next::nothing", "no reachable touch separates these effects within the time")
            .help("give more time (--minutes), mount the blocks again (--moved), or name other effects (--effects)"));
    };
    chosen.never = never;
    // a program that parts nothing further is not worth a person's walk to the machine
    if chosen.separations.iter().all(|s| s.most() <= GAIN * s.before) {
        let says = format!(
            "{}: these touches determine it as well as any program of {:.0} minutes would",
            says(&questions),
            args.minutes
        );
        let moved = if chosen.label.is_none() { " with the blocks mounted again" } else { "" };
        return Ok(refuse(
            &says,
            &format!("no program{moved} brings more: confirm it at the machine, or give more time (--minutes)"),
            io,
        ));
    }
    if chosen.separations.iter().all(|s| s.told < SAFELY && s.told_if_room_turns.is_none_or(|t| t < SAFELY)) {
        let says = format!(
            "no program of {:.0} minutes on this machine would separate any of these effects: {}",
            args.minutes,
            says(&questions)
        );
        io.say(&says);
        if of_room {
            io.say("  what goes with the temperature and what goes with time stay one while the room goes on as it did: measure \
                    again when its temperature has turned");
        }
        io.say(
            "  nothing is written: give more time (--minutes), mount the blocks again (--moved), or confirm one of \
                them at the machine",
        );
        io.answer(&json!({ "format": "axiscal-next/1", "pairs": [], "says": says }));
        return Ok(Answer::No);
    }
    write(args, &loaded, &post, &plan_file, &questions, &chosen, io)
}

/// Nothing is written, and why.
fn refuse(says: &str, more: &str, io: &Io) -> Answer {
    io.say(says);
    io.say(format!("  {more}"));
    io.say("  nothing is written");
    io.answer(&json!({ "format": "axiscal-next/1", "pairs": [], "says": says }));
    Answer::No
}

/// What is left over, as an effect that stands in no file.
struct Sketched {
    effect: Effect,
    /// As the data have it, in typical sizes.
    size: DVector<f64>,
    says: String,
}

impl Sketched {
    /// `None` where formulas have no word for it.
    fn of(loaded: &Loaded, settings: &Settings, fit: &Fit) -> Option<Self> {
        let subject = Subject { machine: &loaded.machine, catalogue: &loaded.catalogue, settings, fit };
        let made = diagnose::sketch::sketch(subject, &|id| loaded.catalogue.knows(id)).ok()?;
        let mut own = Catalogue::default();
        own.add_file(&source("sketch", made.toml)).ok()?;
        let effect = own.get(&made.id, &loaded.machine)?.clone();
        let factors = effect.parameters.iter().filter(|p| p.shape.is_none()).count();
        let size = DVector::from_vec(made.sizes);
        (size.len() == factors).then_some(Self { effect, size, says: made.says })
    }
}

/// Effects of the study's model that the last step of its history put there.
fn last_added(args: &Args, loaded: &Loaded) -> Result<Vec<String>> {
    let history = super::add::read_history(&super::add::history_path(&args.study))?.unwrap_or_default();
    let last = history.steps.last().filter(|s| s.effects == loaded.study.effects);
    Ok(last.map_or_else(Vec::new, |s| s.added.clone()))
}
