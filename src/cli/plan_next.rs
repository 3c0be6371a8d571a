//! `axiscal plan-next`: the probing program that best separates what the data of a study cannot tell apart.

use super::load::{Loaded, load_study, read_log};
use super::new::relative;
use super::{Answer, Io};
use crate::design;
use crate::design::bundle::{Bundle, as_plan, bundles, program_text, without};
use crate::design::next::{Design, Separation, where_all_have_values};
use crate::design::questions::{Pair, Questions, Suspect};
use crate::design::{Known, Noise, Planned, Room, Task, View};
use crate::diag::{Failure, Finding, Result, source};
use crate::diagnose::{self, Subject, Verdict, diagnose};
use crate::files;
use crate::fit::{self, Fit, Settings, effects_of};
use crate::machine::{Machine, Mounting};
use crate::model::catalogue::{Catalogue, Effect};
use crate::post::Postprocessor;
use crate::program::plan::Plan;
use crate::program::{self, Generated, Options};
use crate::report::fit::{number, significant};
use crate::search::apart::SEEN;
use crate::study;
use comfy_table::Cell;
use nalgebra::DVector;
use serde_json::json;
use std::cell::RefCell;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

/// Rounds of choosing, generating and leaving out what cannot be reached.
const MOST_ROUNDS: usize = 5;

/// A program may take this much longer than the time that was given.
const OVER: f64 = 1.02;

/// A pair is promised to be told apart from this probability on.
const SAFELY: f64 = 0.95;

/// A pair that all touches at once leave no further apart than this is one that they cannot part.
const NOTHING: f64 = 0.1;

/// Pairs that the program's own head names.
const MOST_SAID: usize = 6;

/// Pairs that are listed: those that matter most for the person who waits.
const MOST_LISTED: usize = 20;

/// Other blocks are worth the trouble when they part effects so many times better.
const WORTH_MOVING: f64 = 1.5;

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
    /// How long the program may take, minutes (putting up other blocks not counted)
    #[arg(long, default_value_t = 10.0)]
    pub minutes: f64,
    /// The effects that are to be told apart (default: what the data leave open)
    #[arg(long, value_delimiter = ',')]
    pub effects: Vec<String>,
    /// The blocks were put up anew since the last run, or will be: their set-up is unknown again
    #[arg(long)]
    pub moved: bool,
    /// Put this log of the program into the study as its next run, instead of writing a program
    #[arg(long, value_name = "LOG")]
    pub join: Option<PathBuf>,
}

fn warn<'a>(said: impl Iterator<Item = &'a String>, io: &Io) {
    io.report(&said.map(|w| Finding::warning("next::left_out", w.clone())).collect::<Vec<_>>());
}

/// Runs `plan-next`.
///
/// # Errors
/// When the study is unusable, an effect is unknown, or nothing can be reached.
pub fn run(args: &Args, io: &Io) -> Result<Answer> {
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
        let fit = fit::identify(&loaded.machine, &loaded.catalogue, &loaded.runs(), settings)?;
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
        let says = format!("a gross mistake must be put right first, and the touches made again: {mistake}");
        return Ok(refuse(&says, &found.says, io));
    }
    if named.is_empty() && found.untold {
        design::explain(&loaded.machine, &loaded.catalogue, &loaded.runs(), &mut fit)?;
        let help = match &fit.outcome.parted_together[..] {
            [] => "run the program to its end, or touch in more poses, and ask again".to_owned(),
            remedies => format!("run the program to its end; or what tells them: {}", remedies.join("; and ")),
        };
        return Ok(refuse(
            &format!("nothing to part before the model's own errors are told. {}", found.says),
            &help,
            io,
        ));
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
    let unexplained = named.is_empty() && !open(&found) && found.verdict == Verdict::Unexplained;
    let sketched =
        if unexplained && found.touches_would_tell() { Sketched::of(&loaded, &settings, &fit) } else { None };
    // a faint pattern is there or is not: touches tell. A clear one is there, and no known effect stands against another
    if unexplained && !(found.faint && sketched.is_some()) {
        let help = match found.sketchable {
            true => format!("{} writes what is seen as a formula", super::next::sketch_effect(&loaded)),
            false => diagnose::words::at_the_machine(&found),
        };
        return Ok(refuse(
            &format!("nothing here to part: no known effect explains what is left. {}", found.says),
            &help,
            io,
        ));
    }
    let questions = if let Some(s) = &sketched {
        Questions {
            pairs: vec![Pair { one: s.effect.id.clone(), other: None }],
            suspects: vec![Suspect { id: s.effect.id.clone(), size: s.size.clone(), shape: None }],
            says: format!("is this faint pattern there at all? {}", s.says),
        }
    } else if named.is_empty() {
        warn(found.warnings.iter(), io);
        if open(&found) {
            // as its tests allow for it
            setting.noise.tau_mm = found.open.tau_mm;
            Questions::left_open(found.open.suspects, &found.open.pairs)
        } else {
            let view = View::new(&setting.task, &setting.runs, &setting.known, setting.noise)?;
            warn(view.left_out.iter().map(|(_, says)| says).filter(|says| !found.warnings.contains(says)), io);
            let asked = Questions::of_plan(&view);
            match found.verdict {
                Verdict::TooLittleData => Questions {
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
        io.say("the touches of this study tell every effect from every other: no further program is needed");
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
    let asked_of = View::with_effects(&setting.task, &setting.runs, &setting.known, setting.noise, &effects)?;
    if let Some((_, says)) = asked_of.left_out.first() {
        return Err(Failure::new("next::no_value", says.clone())
            .help("write its formula so that it holds at every touch, or ask for other effects"));
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
            } else {
                io.report(&[Finding::info(
                    "next::other_blocks",
                    format!(
                        "with mounting {:?} put up anew {} of {} pairs would be told apart",
                        other.generated.plan.mounting,
                        other.separations.iter().filter(|s| s.told >= SAFELY).count(),
                        other.separations.len()
                    ),
                )
                .help("add --moved for that program")]);
            }
        }
    }
    warn(setting.holes.borrow().iter(), io);
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
        return Err(Failure::new("next::nothing", "no reachable touch parts these effects within the time").help(
            "give more time (--minutes), let the blocks be put up anew (--moved), or name other effects (--effects)",
        ));
    };
    chosen.never = never;
    if chosen.separations.iter().all(|s| s.told < SAFELY && s.told_if_room_turns.is_none_or(|t| t < SAFELY)) {
        let says = format!(
            "no program of {:.0} minutes that this machine can run would tell any of these effects apart: {}",
            args.minutes,
            says(&questions)
        );
        io.say(&says);
        if of_room {
            io.say("  what goes with the temperature and what goes with time stay one while the room goes on as it did: measure \
                    again when its temperature has turned");
        }
        io.say("  nothing is written: give more time (--minutes), let the blocks be put up anew (--moved), or confirm one of \
                them at the machine");
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

/// A program that was chosen and proven.
struct Chosen {
    text: String,
    generated: Generated,
    separations: Vec<Separation>,
    /// The study's name for the blocks as they stand; `None`: put up anew.
    label: Option<String>,
    /// Pairs that no touches on these blocks part: they cannot keep a choice from being done.
    hopeless: Vec<bool>,
    /// Pairs that no touches of the machine part, in words.
    never: Vec<String>,
}

impl Chosen {
    /// Does every pair come that far apart?
    fn settles(&self, lambda: f64) -> bool {
        self.separations.iter().all(|s| s.most() >= lambda)
    }

    /// Does every pair that these blocks can part?
    fn settles_what_it_can(&self, lambda: f64) -> bool {
        self.separations.iter().zip(&self.hopeless).all(|(s, hopeless)| *hopeless || s.after >= lambda)
    }

    /// How many pairs are told apart.
    fn told(&self) -> usize {
        self.separations.iter().filter(|s| s.told >= SAFELY).count()
    }

    /// What was chosen for a room that turns is promised for one only; `goes_on` has what it does where the room goes on.
    fn if_the_room_turns(&mut self, goes_on: Vec<Separation>) {
        for (s, on) in self.separations.iter_mut().zip(goes_on) {
            let turned = std::mem::replace(s, on);
            s.told_if_room_turns = Some(turned.told);
            s.after_if_room_turns = Some(turned.after);
        }
    }

    /// Separations as far as they are worth anything: a pair that nothing parts must not hide the others.
    fn worth(&self) -> f64 {
        self.separations.iter().map(|s| s.most().min(2.0 * SEEN)).sum()
    }
}

/// The study as a design sees it.
struct Setting<'a> {
    task: Task<'a>,
    runs: Vec<Planned>,
    /// What the study knows beside the touches.
    known: Vec<Known>,
    noise: Noise,
    /// What was left out of the choice because an effect has no value there.
    holes: RefCell<BTreeSet<String>>,
    /// What the room does during the program.
    room: Room,
    /// Pairs of questions that a choice is for.
    wanted: BTreeSet<usize>,
    /// Pairs that some touches part, on whatever blocks.
    parted: RefCell<BTreeSet<usize>>,
}

impl<'a> Setting<'a> {
    fn new(loaded: &'a Loaded, effects: &[String], fit: &Fit) -> Result<Self> {
        let runs = loaded.measured(fit);
        let name = |i: usize| fit.model.unknowns[i].name.clone();
        let known =
            fit.priors.iter().map(|(i, _, sigma)| Known { sum: vec![(name(*i), 1.0)], sigma: *sigma }).collect();
        let task = Task {
            machine: &loaded.machine,
            catalogue: &loaded.catalogue,
            effects: effects_of(effects, &loaded.catalogue, &loaded.machine)?,
            held: loaded
                .study
                .knowledge
                .iter()
                .filter(|(_, k)| matches!(k, fit::Knowledge::Fixed(_)))
                .map(|(n, _)| n.clone())
                .collect(),
            reference: loaded.machine.reference.pivot,
            temperature: fit.data.observations.iter().any(|o| o.has_temperature),
        };
        let noise = Noise { sigma_mm: fit.noise.sigma_mm, tau_mm: fit.noise.tau_test_mm };
        Ok(Self {
            task,
            runs,
            known,
            noise,
            holes: RefCell::default(),
            room: Room::GoesOn,
            wanted: BTreeSet::new(),
            parted: RefCell::default(),
        })
    }

    /// Pairs that all touches of all blocks together leave as they are, in words.
    fn never(&self, questions: &Questions) -> Vec<String> {
        let parted = self.parted.borrow();
        let never = questions.pairs.iter().enumerate().filter(|(p, _)| !parted.contains(p));
        never.map(|(_, p)| p.other.as_ref().map_or_else(|| p.one.clone(), |o| format!("{} and {o}", p.one))).collect()
    }

    /// The mounting that stands there since the last run, with the study's name for it (`None` where it is put up anew).
    fn stands(&self, machine: &'a Machine, moved: bool) -> Option<(&'a Mounting, Option<String>)> {
        let last = self.runs.last()?;
        let own = last.plan.touches.last()?.mounting.clone();
        let mounting = machine.mounting(own.as_deref().unwrap_or(&last.plan.mounting))?;
        let run = last.mounting.clone().unwrap_or_else(|| format!("{}-{}", last.plan.mounting, self.runs.len()));
        let label = own.map_or(run.clone(), |m| format!("{run}/{m}"));
        Some((mounting, (!moved).then_some(label)))
    }

    /// The runs with a further one, whose blocks stand as the last run left them where a label is given.
    fn with(&self, plan: Plan, label: Option<&str>) -> Vec<Planned> {
        let mut runs = self.runs.clone();
        if let (Some(label), Some(last)) = (label, runs.last_mut()) {
            last.mounting = Some(label.split('/').next().unwrap_or(label).to_owned());
        }
        let mut plan = plan;
        if label.is_none() && runs.iter().any(|r| r.mounting.is_some() || r.plan.mounting == plan.mounting) {
            plan.mounting = format!("{} anew", plan.mounting);
        }
        runs.push(Planned { mounting: label.map(str::to_owned), room: self.room, ..Planned::new(plan) });
        runs
    }

    fn view(&self, plan: &Plan, label: Option<&str>, effects: &[(&Effect, Option<f64>)]) -> Result<View> {
        View::with_effects(&self.task, &self.with(plan.clone(), label), &self.known, self.noise, effects)
    }

    /// Touches that were made or planned before.
    fn n_given(&self) -> usize {
        self.runs.iter().map(|r| r.plan.touches.len()).sum()
    }

    /// Chooses touches on a mounting and proves their program, again without what cannot be reached.
    fn choose(
        &self,
        mounting: &Mounting,
        label: Option<&str>,
        effects: &[(&Effect, Option<f64>)],
        questions: &Questions,
        budget_s: f64,
        name: &str,
    ) -> Result<Chosen> {
        let machine = self.task.machine;
        let nothing = || Failure::new("next::nothing", "nothing can be touched");
        let mut pool = bundles(machine, mounting);
        let mut scale = 1.0;
        let mut found: Option<Chosen> = None;
        for _ in 0..MOST_ROUNDS {
            if pool.is_empty() {
                break;
            }
            let planned = as_plan(machine, mounting, &pool, budget_s / 2.0);
            let view = self.view(&planned, label, effects)?;
            if !view.left_out.is_empty() {
                let (left, says) = where_all_have_values(&view, self.n_given(), effects, &pool);
                self.holes.borrow_mut().extend(says);
                if left.len() == pool.len() {
                    break;
                }
                pool = left;
                continue;
            }
            let design = Design::new(&view, self.n_given(), &pool, questions);
            // what all touches of the pool together leave as it is no choice of them parts
            let all: Vec<usize> = (0..pool.len()).collect();
            let hopeless: Vec<bool> = design.separated(&all).iter().map(|s| s.after < NOTHING).collect();
            self.parted.borrow_mut().extend((0..hopeless.len()).filter(|&p| !hopeless[p]));
            let wanted = |p: usize| self.wanted.is_empty() || self.wanted.contains(&p);
            if (0..hopeless.len()).all(|p| hopeless[p] || !wanted(p)) {
                break;
            }
            let chosen = design.choose(&pool, budget_s * scale);
            if chosen.is_empty() {
                break;
            }
            let text = program_text(machine, mounting, name, &says(questions), &pool, &chosen);
            let (spec, _) = program::load(&source("plan-next", text.clone()))?;
            let (generated, _) = match program::generate(machine, &spec, &Options::default()) {
                Ok(done) => done,
                // nothing of it can be reached: what was chosen is no choice
                Err(_) => {
                    pool = pool.into_iter().enumerate().filter(|(i, _)| !chosen.contains(i)).map(|(_, b)| b).collect();
                    continue;
                }
            };
            let over = generated.path.seconds / budget_s;
            let lost = !generated.plan.skipped.is_empty();
            if over <= OVER {
                let separations = self.told(&generated.plan, label, effects, questions)?;
                let now = Chosen {
                    text,
                    generated: generated.clone(),
                    separations,
                    label: label.map(str::to_owned),
                    hopeless,
                    never: Vec::new(),
                };
                if found.as_ref().is_none_or(|f| now.worth() > f.worth()) {
                    found = Some(now);
                }
            }
            let settled = found.as_ref().is_some_and(|f| f.settles_what_it_can(2.0 * SEEN));
            if !lost && (settled || (0.85..=OVER).contains(&over)) {
                break;
            }
            if lost {
                pool = without(&pool, &generated.plan.skipped);
            }
            scale = (scale / over * 0.97).clamp(0.1, 10.0);
        }
        found.ok_or_else(nothing)
    }

    /// What the proven program will be able to tell.
    fn told(
        &self,
        plan: &Plan,
        label: Option<&str>,
        effects: &[(&Effect, Option<f64>)],
        questions: &Questions,
    ) -> Result<Vec<Separation>> {
        let touches = plan.touches.clone();
        let Some(first) = touches.first() else { return Ok(Vec::new()) };
        let manner = crate::design::bundle::Manner {
            pose: first.pose,
            from: first.from,
            spindle_deg: 0.0,
            feed_mm_min: 0.0,
            stylus: None,
        };
        let all = Bundle { manner, block: String::new(), faces: Vec::new(), touches };
        let pool = [all];
        let view = self.view(plan, label, effects)?;
        Ok(Design::new(&view, self.n_given(), &pool, questions).separated(&[0]))
    }
}

fn says(questions: &Questions) -> String {
    let pair = |p: &crate::design::questions::Pair| match &p.other {
        Some(other) => format!("{} from {other}", p.one),
        None => p.one.clone(),
    };
    let named = questions.pairs.iter().take(MOST_SAID).map(pair).collect::<Vec<_>>().join(", ");
    match questions.pairs.len().saturating_sub(MOST_SAID) {
        0 => named,
        more => format!("{named} and {more} more pairs"),
    }
}

/// Writes program, plan and program file, and says what they will tell.
fn write(
    args: &Args,
    loaded: &Loaded,
    post: &Postprocessor,
    plan_file: &Path,
    questions: &Questions,
    chosen: &Chosen,
    io: &Io,
) -> Result<Answer> {
    let plan = &chosen.generated.plan;
    let nc = post.program(&loaded.machine, plan, &chosen.generated.path)?;
    io.report(&nc.findings.0);
    let program_file = args.out.join(format!("{}.{}", plan.program, nc.extension));
    let form_file = args.out.join(format!("{}.toml", plan.program));
    let name = format!("{}.{}", plan.program, nc.extension);
    let proof = super::generate::prove(&loaded.machine, post, plan, &name, &nc, io)?;
    let mut proven = plan.clone();
    proven.blocks_anew = chosen.label.is_none();
    proven.programs.extend(proof.map(|(p, _)| (post.name.clone(), p)));
    files::write_whole(plan_file, proven.to_json().as_bytes())?;
    files::write_whole(&form_file, chosen.text.as_bytes())?;
    for (name, text) in nc.files(&plan.program) {
        files::write_whole(&args.out.join(name), text.as_bytes())?;
    }
    let seconds = chosen.generated.path.seconds;
    io.say(&questions.says);
    io.say(format!(
        "{} touches on mounting {:?}, about {}",
        plan.touches.len(),
        plan.mounting,
        program::duration(seconds)
    ));
    match &chosen.label {
        Some(_) => io.say("leave the blocks as the last run left them"),
        None => io.say("put the blocks up first; the time for it is not counted"),
    }
    let mut t = crate::report::fit::table(&["is it", "or", "separation now", "with these touches", "told apart"]);
    for s in chosen.separations.iter().take(MOST_LISTED) {
        t.add_row(vec![
            Cell::new(&s.one),
            Cell::new(s.other.as_deref().unwrap_or("nothing")),
            number(significant(s.before)),
            number(significant(s.after)),
            number(match s.told {
                p if p >= SAFELY => format!("yes ({:.0} %)", (100.0 * p).floor()),
                _ if s.told_if_room_turns.is_some_and(|p| p >= SAFELY) => "if the room turns".to_owned(),
                p if p >= 0.5 => format!("likely ({:.0} %)", 100.0 * p),
                p => format!("no ({:.0} %)", 100.0 * p),
            }),
        ]);
    }
    crate::report::lay::lay(&mut t, io.paper(false).width.min(120), &[]);
    io.say(io.paper(false).plain(t.to_string()));
    let told = |limit: f64| chosen.separations.iter().filter(|s| s.told >= limit).count();
    io.say(format!(
        "{} of {} pairs will be told apart by `diagnose` (with 95 % or more, whichever of the two acts); 25 and more of \
         separation tells a pair apart nearly always",
        told(SAFELY),
        chosen.separations.len()
    ));
    let turns =
        chosen.separations.iter().filter(|s| s.told < SAFELY && s.told_if_room_turns.is_some_and(|p| p >= SAFELY));
    let turns = match turns.count() {
        0 => None,
        n => Some(format!(
            "{n} more only if the room's temperature does not go on as in the runs so far, but turns or swings while the \
             program runs (reckoned with {:.0} K up and down in {:.0} min: open a gate, switch the heating, or run it at another \
             time of day); where the room goes on as before, what goes with it and what goes with time stay one",
            crate::design::view::SWING_K,
            crate::design::view::SWING_S / 60.0
        )),
    };
    turns.iter().for_each(|says| io.say(says));
    for pair in &chosen.never {
        io.say(format!("no touches of this machine tell {pair} apart: look at the machine which it is"));
    }
    let folder = args.study.parent().map(Path::to_path_buf).unwrap_or_default();
    let log = args.out.join(format!("{}.log", plan.program));
    io.say(format!(
        "written: {}\n         {}\n         {}",
        program_file.display(),
        plan_file.display(),
        form_file.display()
    ));
    io.say(format!(
        "when it has run: axiscal plan-next {} --out {} --controller {} {}--join {}\nor by hand:\n\n{}",
        args.study.display(),
        args.out.display(),
        args.controller,
        if args.moved { "--moved " } else { "" },
        log.display(),
        entry(&relative(plan_file, &folder), &relative(&log, &folder), &args.controller, chosen.label.as_deref())
    ));
    io.answer(&json!({
        "format": "axiscal-next/1",
        "says": questions.says,
        "pairs": chosen.separations,
        "room": turns,
        "never": chosen.never,
        "touches": plan.touches.len(),
        "time_s": seconds,
        "mounting": chosen.label,
        "program": program_file.display().to_string(),
        "plan": plan_file.display().to_string(),
    }));
    Ok(Answer::Done)
}

/// The study's table of the run, as a person would write it.
fn entry(plan: &str, log: &str, controller: &str, label: Option<&str>) -> String {
    let mounting = label.map_or_else(String::new, |l| {
        let before = l.split('/').next().unwrap_or(l);
        format!("mounting = \"{l}\"        # and in the [[data]] before it: mounting = \"{before}\"\n")
    });
    format!("[[data]]\nplan = \"{plan}\"\nlog = \"{log}\"\ncontroller = \"{controller}\"\n{mounting}")
}

/// The plan that a log is of, by its name: `next-3.log` is that of `next-3.plan.json`, in the folder that is named or beside
/// the log. How many runs the study has by now says nothing of it.
fn plan_of(log: &Path, out: &Path) -> Option<PathBuf> {
    let name = format!("{}.plan.json", log.file_stem()?.to_str()?);
    let beside = log.parent().map(|folder| folder.join(&name));
    std::iter::once(out.join(&name)).chain(beside).find(|p| p.is_file())
}

/// Puts the log of the program into the study.
fn join(args: &Args, loaded: &Loaded, plan_file: &Path, log: &Path, io: &Io) -> Result<Answer> {
    let folder = args.study.parent().map(Path::to_path_buf).unwrap_or_default();
    let same = |name: &str| {
        let there = |p: &Path| std::fs::canonicalize(p).ok();
        there(&folder.join(name)).is_some_and(|p| there(log) == Some(p))
    };
    if let Some(run) = loaded.study.data.iter().position(|d| same(&d.log)) {
        return Err(Failure::new("next::joined", format!("{} is run {} of the study already", log.display(), run + 1))
            .help("a log counts once: name the log of a further run"));
    }
    let plan = super::load::load_plan(plan_file, &loaded.machine, io)?;
    let touches = read_log(&files::read_bytes(log)?, log, (&args.controller, None), &loaded.machine, &plan, io)?;
    let runs = loaded.planned();
    // whoever made the program for blocks put up anew has put them up anew
    let moved = args.moved || plan.blocks_anew;
    if moved && !args.moved {
        io.report(&[Finding::info(
            "next::blocks_anew",
            "this program was made for blocks that are put up anew: their set-up counts as unknown",
        )
        .help("where they were not moved after all, write the [[data]] by hand with the same mounting")]);
    }
    let stood = runs.last().and_then(|last| {
        let own = last.plan.touches.last()?.mounting.clone();
        let same = own.as_deref().unwrap_or(&last.plan.mounting).split('#').next() == Some(plan.mounting.as_str());
        let run = last.mounting.clone().unwrap_or_else(|| format!("{}-{}", last.plan.mounting, runs.len()));
        (same && !moved).then(|| (run.clone(), own.map_or(run.clone(), |m| format!("{run}/{m}"))))
    });
    let joined = study::Joined {
        plan: relative(plan_file, &folder),
        log: relative(log, &folder),
        controller: if args.controller.ends_with(".toml") {
            relative(Path::new(&args.controller), &folder)
        } else {
            args.controller.clone()
        },
        stood,
    };
    let text = study::join(&files::read_text(&args.study)?, &joined)?;
    files::write_whole(&args.study, text.as_bytes())?;
    io.say(format!("{}: run {} with {} touches", args.study.display(), loaded.runs.len() + 1, touches.len()));
    io.answer(
        &json!({ "study": args.study.display().to_string(), "runs": loaded.runs.len() + 1, "touches": touches.len() }),
    );
    Ok(Answer::Done)
}
