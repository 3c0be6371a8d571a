//! The probing program that best separates what the data of a study leave open.

mod choose;
mod poses;

pub use choose::{Chosen, SAFELY};
pub use poses::{NextCentre, Poses};

use super::history::read_history;
use super::{Environment, Loaded};
use crate::design::questions::{Pair, Questions, Suspect};
use crate::design::{self, LinearisedPlan, Room};
use crate::diag::{Failure, Finding, Result, source};
use crate::diagnose::next_step::NextStep;
use crate::diagnose::unresolved_pairs;
use crate::diagnose::verdict::{NotNamed, TooLittle, Unexplained};
use crate::diagnose::{Diagnosis, Options, Verdict, sketch::sketch};
use crate::fit::candidates::NoValue;
use crate::fit::{Fit, Settings, effects_of};
use crate::model::catalogue::{Catalogue, Effect};
use crate::search::distinguishability::SEEN;
use choose::{Setting, locked, says};
use nalgebra::DVector;
use rayon::prelude::*;

/// Other blocks are worth the trouble when they part effects so many times better.
const WORTH_MOVING: f64 = 1.5;

/// A program must part effects by so much more than the touches that there are.
const GAIN: f64 = 1.02;

/// What is asked of the program.
#[derive(Debug, Clone, Copy)]
pub struct Request<'a> {
    /// How long it may take (putting up other blocks not counted).
    pub minutes: f64,
    /// The effects to separate; none: what the data leave open.
    pub effects: &'a [String],
    /// The blocks are put up anew: their set-up is unknown again.
    pub moved: bool,
    pub name: &'a str,
}

/// What comes next.
pub enum Next {
    NothingConfounded,
    NoProgram(NoProgram),
    Program(Box<Program>),
    /// For a study of sphere centres: poses that the user's own cycle measures.
    Centres {
        questions: Questions,
        poses: Poses,
    },
}

/// No program is worth its time.
pub struct NoProgram {
    pub says: String,
    pub advice: Advice,
}

/// What to do instead.
pub enum Advice {
    Says(Vec<String>),
    /// What is seen can be written as a formula.
    Sketch,
}

pub struct Program {
    pub questions: Questions,
    pub chosen: Chosen,
}

/// Either what is asked for, or why there is no program.
type Asked<T> = std::result::Result<T, NoProgram>;

impl NoProgram {
    fn new(says: impl Into<String>, more: impl Into<String>) -> Self {
        let advice = Advice::Says(vec![more.into(), "nothing is written".to_owned()]);
        Self { says: says.into(), advice }
    }
}

fn warn(said: impl Iterator<Item = String>, env: &dyn Environment) {
    env.remark(&said.map(|w| Finding::warning("next::left_out", w)).collect::<Vec<_>>());
}

/// Chooses the touches that separate most of what the study leaves open, and proves that they can be reached.
///
/// # Errors
/// When the study cannot be fitted, an effect is unknown, or nothing can be reached.
pub fn plan_next(loaded: &Loaded, request: &Request, env: &dyn Environment) -> Result<Next> {
    if !(request.minutes.is_finite() && request.minutes > 0.0 && request.minutes < 1e5) {
        return Err(Failure::new("next::minutes", "the time is no usable number").help("write --minutes more than 0"));
    }
    let open = match Open::look_at(loaded, request, env)? {
        Ok(open) => open,
        Err(no_program) => return Ok(Next::NoProgram(no_program)),
    };
    let sketched = open.sketched(loaded, request);
    if let Some(no_program) = open.no_program(request, sketched.as_ref()) {
        return Ok(Next::NoProgram(no_program));
    }
    let mut setting = Setting::new(loaded, &open.settings.effects, &open.fit)?;
    let questions = open.questions(&mut setting, sketched.as_ref(), request, env)?;
    if questions.pairs.is_empty() {
        return Ok(Next::NothingConfounded);
    }
    let effects = asked_effects(loaded, &questions, sketched.as_ref());
    let asked_of = LinearisedPlan::with_effects(&setting.task, &setting.runs, &setting.known, setting.noise, &effects)?;
    if let Some(bad) = asked_of.left_out.first() {
        return Err(Failure::new("next::no_value", bad.left_out())
            .help("write its formula so that it has a value at every touch, or ask for other effects"));
    }
    if let Some(plan) = poses::of_centres(&setting) {
        let found = poses::choose(&setting, plan, &effects, &questions, 60.0 * request.minutes)?;
        let better = |p: &Poses| p.separations.iter().any(|s| s.after > GAIN * s.before);
        return Ok(match found.filter(better) {
            Some(poses) => Next::Centres { questions, poses },
            None => Next::NoProgram(NoProgram::new(
                format!("{}: centres of these spheres at other poses determine it no better", says(&questions)),
                "measure a sphere at another radius and height, or touch blocks with a program of `generate`",
            )),
        });
    }
    let best = best(loaded, &mut setting, &effects, &questions, request, env)?;
    warn(locked(&setting.holes).iter().cloned(), env);
    let never = setting.never(&questions);
    if never.len() == questions.pairs.len() {
        let says = format!(
            "no touches that this machine can make, with its blocks and styli, separate these: {} have the same effect wherever it \
             touches",
            never.join(", ")
        );
        let looks: Vec<String> =
            effects.iter().filter(|(e, _)| !e.look.is_empty()).map(|(e, _)| format!("{}: {}", e.id, e.look)).collect();
        let more = format!("look at the machine which it is. {}", looks.join(". "));
        return Ok(Next::NoProgram(NoProgram::new(says, more)));
    }
    let Some(mut chosen) = best else {
        return Err(Failure::new("next::nothing", "no reachable touch separates these effects within the time")
            .help("give more time (--minutes), mount the blocks again (--moved), or name other effects (--effects)"));
    };
    chosen.never = never;
    let of_room = goes_with_room(&setting, &effects);
    Ok(match not_worth_it(&chosen, &questions, of_room, request) {
        Some(no_program) => Next::NoProgram(no_program),
        None => Next::Program(Box::new(Program { questions, chosen })),
    })
}

/// The model whose open questions are asked.
struct Open {
    settings: Settings,
    fit: Fit,
    found: Diagnosis,
    /// What else is open: groups of other steps of the history.
    others: Vec<unresolved_pairs::Open>,
}

impl Open {
    fn look_at(loaded: &Loaded, request: &Request, env: &dyn Environment) -> Result<Asked<Self>> {
        let mut settings = loaded.quick_settings();
        settings.effects.retain(|e| !request.effects.contains(e));
        effects_of(request.effects, &loaded.catalogue, &loaded.machine)?;
        let mut open = Self::look(loaded, settings)?.with_the_other_of_two(loaded, request)?;
        if let Some(mistake) = open.found.mistake() {
            let says = format!("a set-up mistake must be corrected first, and the touches measured again: {mistake}");
            return Ok(Err(NoProgram::new(says, &open.found.says)));
        }
        let nothing_determined = matches!(open.found.verdict, Verdict::TooLittleData(TooLittle::NothingDetermined(_)));
        if request.effects.is_empty() && nothing_determined {
            design::explain(&loaded.machine, &loaded.catalogue, &loaded.runs(), &mut open.fit)?;
            let help = match &open.fit.outcome.parted_together[..] {
                [] => "run the program to its end, or touch in more poses, and ask again".to_owned(),
                remedies => {
                    format!(
                        "run the program to its end; or add touches that determine them: {}",
                        remedies.join("; and ")
                    )
                }
            };
            let says = format!("the model's own errors must be determined first. {}", open.found.says);
            return Ok(Err(NoProgram::new(says, help)));
        }
        if request.effects.is_empty() && !open.found.leaves_open() {
            open = open.with_groups_of_history(loaded, env)?;
        }
        Ok(Ok(open))
    }

    /// Of two effects that are named together the one that is clear is in the model when the other one is asked about; else the second.
    fn with_the_other_of_two(self, loaded: &Loaded, request: &Request) -> Result<Self> {
        let other = match (self.found.proposed(), self.found.next_step()) {
            ([_, _], NextStep::Add(clear)) => clear.effect.clone(),
            ([_, second], _) => second.effect.clone(),
            _ => return Ok(self),
        };
        if !request.effects.is_empty() {
            return Ok(self);
        }
        let mut settings = self.settings;
        settings.effects.push(other);
        Self::look(loaded, settings)
    }

    /// What a step added may stand for others that the same touches could not tell from it: still open questions. Of each step its
    /// group is looked for beside the rest of the model; the model that is asked has none of those that are in question.
    fn with_groups_of_history(self, loaded: &Loaded, env: &dyn Environment) -> Result<Self> {
        let without = |added: &[String]| {
            let mut settings = self.settings.clone();
            settings.effects.retain(|e| !added.contains(e));
            settings
        };
        let steps = added(loaded, env)?;
        let looks: Vec<Self> =
            steps.par_iter().map(|added| Self::look(loaded, without(added))).collect::<Result<_>>()?;
        let is_open = |(added, then): &(Vec<String>, Self)| {
            let left_open = &then.found.open;
            let group = left_open.suspects.iter().any(|s| added.contains(&s.id)) && !left_open.pairs.is_empty();
            then.found.leaves_open() && group
        };
        let mut open: Vec<(Vec<String>, Self)> = steps.into_iter().zip(looks).filter(is_open).collect();
        let Some((_, mut first)) = open.pop() else { return Ok(self) };
        for (added, then) in open {
            first.settings.effects.retain(|e| !added.contains(e));
            first.others.push(then.found.open);
        }
        if !first.others.is_empty() {
            first.fit = loaded.fit(&first.settings)?;
        }
        Ok(first)
    }

    fn look(loaded: &Loaded, settings: Settings) -> Result<Self> {
        let fit = loaded.fit(&settings)?;
        let options = Options { power: false, ..Options::default() };
        let found = loaded.diagnose(&settings, &fit, &options)?;
        Ok(Self { settings, fit, found, others: Vec::new() })
    }

    fn unexplained(&self, request: &Request) -> Option<&Unexplained> {
        let found = self.found.verdict.unexplained();
        found.filter(|_| request.effects.is_empty() && !self.found.leaves_open())
    }

    /// Further touches show whether a weak pattern is there.
    fn sketched(&self, loaded: &Loaded, request: &Request) -> Option<Sketched> {
        let found = self.unexplained(request)?;
        let weak = found.why == NotNamed::WeakPattern && found.sketchable;
        let is_asked = weak && self.found.verdict.moved_block().is_none();
        if is_asked { Sketched::sketch(loaded, &self.settings, &self.fit) } else { None }
    }

    /// A clear pattern is there, and no known effects have to be separated.
    fn no_program(&self, request: &Request, sketched: Option<&Sketched>) -> Option<NoProgram> {
        let found = self.unexplained(request).filter(|_| sketched.is_none())?;
        let says =
            format!("no known effect explains the residual, so there are no effects to separate. {}", self.found.says);
        Some(match found.sketchable {
            true => NoProgram { says, advice: Advice::Sketch },
            false => NoProgram::new(says, crate::words::diagnose::machine_check(&found.check)),
        })
    }

    fn questions(
        &self,
        setting: &mut Setting,
        sketched: Option<&Sketched>,
        request: &Request,
        env: &dyn Environment,
    ) -> Result<Questions> {
        let found = &self.found;
        if let Some(s) = sketched {
            return Ok(Questions {
                pairs: vec![Pair { one: s.effect.id.clone(), other: None }],
                suspects: vec![Suspect { id: s.effect.id.clone(), size: s.size.clone(), shape: None }],
                says: format!("is this weak pattern real? {}", s.says),
            });
        }
        if !request.effects.is_empty() {
            return Ok(Questions::named(request.effects));
        }
        warn(found.warnings.iter().cloned(), env);
        if found.leaves_open() {
            // as its tests allow for it
            setting.noise.tau_mm = found.open.tau_mm;
            let each = std::iter::once(&found.open).chain(&self.others);
            let asked = each.map(|open| Questions::left_open(open.suspects.clone(), &open.pairs, &open.including));
            return Ok(asked.reduce(Questions::and).unwrap_or_default());
        }
        let view = LinearisedPlan::new(&setting.task, &setting.runs, &setting.known, setting.noise)?;
        let left_out = view.left_out.iter().map(NoValue::left_out);
        warn(left_out.filter(|says| !found.warnings.contains(says)), env);
        let asked = Questions::of_plan(&view);
        Ok(match found.verdict {
            Verdict::TooLittleData(_) => Questions {
                says: format!("{} These effects would be confounded if one of them acted", found.says),
                ..asked
            },
            _ => asked,
        })
    }
}

/// The effects of the questions, each once, with the shape that it is asked at.
fn asked_effects<'a>(
    loaded: &'a Loaded,
    questions: &Questions,
    sketched: Option<&'a Sketched>,
) -> Vec<(&'a Effect, Option<f64>)> {
    let mut effects: Vec<(&Effect, Option<f64>)> = Vec::new();
    for id in questions.pairs.iter().flat_map(|p| std::iter::once(&p.one).chain(&p.other)) {
        let shape = questions.suspects.iter().find(|s| s.id == *id).and_then(|s| s.shape);
        let known = effects.iter().any(|(e, _)| e.id == *id);
        let own = sketched.map(|s| &s.effect).filter(|e| e.id == *id);
        let effect = own.or_else(|| loaded.catalogue.get(id, &loaded.machine));
        effects.extend(effect.filter(|_| !known).map(|e| (e, shape)));
    }
    effects
}

/// What goes with the temperature is told from what goes with time where the room turns, and not by touches alone.
fn goes_with_room(setting: &Setting, effects: &[(&Effect, Option<f64>)]) -> bool {
    let of_room = |e: &Effect| e.terms.iter().any(|t| t.formula.variables().contains(&"T"));
    setting.task.temperature && effects.iter().any(|(e, _)| of_room(e))
}

/// The best touches on the blocks as they are, or on others where those settle more.
fn best(
    loaded: &Loaded,
    setting: &mut Setting,
    effects: &[(&Effect, Option<f64>)],
    questions: &Questions,
    request: &Request,
    env: &dyn Environment,
) -> Result<Option<Chosen>> {
    let (budget_s, name) = (60.0 * request.minutes, request.name);
    let stands = setting.stands(&loaded.machine, request.moved);
    let mut best: Option<Chosen> = None;
    if let Some((mounting, label)) = &stands {
        let choose = |s: &Setting| s.choose(mounting, label.as_deref(), effects, questions, budget_s, name).ok();
        best = choose(setting);
        if goes_with_room(setting, effects) && !best.as_ref().is_some_and(|b| b.settles(SEEN)) {
            setting.room = Room::Swings;
            let turned = choose(setting);
            setting.room = Room::GoesOn;
            if let Some(mut turned) = turned.filter(|t| best.as_ref().is_none_or(|b| t.told() > b.told())) {
                let plan = &turned.generated.plan;
                let goes_on = setting.told(plan, label.as_deref(), effects, questions)?;
                turned.if_the_room_turns(goes_on);
                best = Some(turned);
            }
        }
    }
    // other blocks only where those that stand there cannot settle it, and only if they may be put up
    if best.as_ref().is_some_and(|b| b.settles(SEEN)) {
        return Ok(best);
    }
    let settled = |p: usize| best.as_ref().is_some_and(|b| b.separations[p].most() >= SEEN);
    setting.wanted = (0..questions.pairs.len()).filter(|&p| !settled(p)).collect();
    let setting = &*setting;
    let others = loaded.machine.mountings.par_iter();
    let others: Vec<Chosen> =
        others.filter_map(|m| setting.choose(m, None, effects, questions, budget_s, name).ok()).collect();
    let better = others.into_iter().filter(|o| best.as_ref().is_none_or(|b| o.worth() > WORTH_MOVING * b.worth()));
    let Some(other) = better.max_by(|a, b| a.worth().total_cmp(&b.worth())) else { return Ok(best) };
    if request.moved || stands.is_none() {
        return Ok(Some(other));
    }
    if other.told() > best.as_ref().map_or(0, Chosen::told) {
        env.remark(&[Finding::info(
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
    Ok(best)
}

/// A program that parts nothing further is not worth a person's walk to the machine.
fn not_worth_it(chosen: &Chosen, questions: &Questions, of_room: bool, request: &Request) -> Option<NoProgram> {
    if chosen.separations.iter().all(|s| s.most() <= GAIN * s.before) {
        let says = format!(
            "{}: these touches determine it as well as any program of {:.0} minutes would",
            says(questions),
            request.minutes
        );
        let moved = if chosen.label.is_none() { " with the blocks mounted again" } else { "" };
        let more = format!("no program{moved} brings more: confirm it at the machine, or give more time (--minutes)");
        return Some(NoProgram::new(says, more));
    }
    let is_told = |told: f64| told >= SAFELY;
    if chosen.separations.iter().any(|s| is_told(s.told) || s.told_if_room_turns.is_some_and(is_told)) {
        return None;
    }
    let says = format!(
        "no program of {:.0} minutes on this machine would separate any of these effects: {}",
        request.minutes,
        says(questions)
    );
    let room = "what goes with the temperature and what goes with time stay one while the room goes on as it did: measure again \
                when its temperature has turned";
    let none = "nothing is written: give more time (--minutes), mount the blocks again (--moved), or confirm one of them \
                at the machine";
    let advice = of_room.then_some(room).into_iter().chain([none]).map(str::to_owned).collect();
    Some(NoProgram { says, advice: Advice::Says(advice) })
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
    fn sketch(loaded: &Loaded, settings: &Settings, fit: &Fit) -> Option<Self> {
        let made = sketch(loaded.subject(settings, fit), &|id| loaded.catalogue.knows(id)).ok()?;
        let mut own = Catalogue::default();
        own.add_file(&source("sketch", made.toml)).ok()?;
        let effect = own.get(&made.id, &loaded.machine)?.clone();
        let factors = effect.parameters.iter().filter(|p| p.shape.is_none()).count();
        let size = DVector::from_vec(made.sizes);
        (size.len() == factors).then_some(Self { effect, size, says: made.says })
    }
}

/// Effects of the study's model that steps of its history put there, step by step.
fn added(loaded: &Loaded, env: &dyn Environment) -> Result<Vec<Vec<String>>> {
    let history = read_history(&loaded.path, env)?.unwrap_or_default();
    let mut out: Vec<Vec<String>> = Vec::new();
    // what was taken out and added again counts where it was added last
    for step in history.steps.iter().rev() {
        let is_new =
            |id: &&String| loaded.study.effects.contains(id) && !out.iter().flatten().any(|other| other == *id);
        let added: Vec<String> = step.added.iter().filter(is_new).cloned().collect();
        if !added.is_empty() {
            out.push(added);
        }
    }
    out.reverse();
    Ok(out)
}
