//! Which touches of which blocks: chosen, proven to be reachable, and what they will tell.

use crate::design::bundle::{
    Bundle, Head, Manner, SWIVELS_DEG, VisitOf, as_plan, bundles, is_skipped, program_text, without,
};
use crate::design::choose_touches::{Design, Separation, where_all_have_values};
use crate::design::questions::{Pair, Questions};
use crate::design::{Known, LinearisedPlan, Noise, Planned, Room, Task};
use crate::diag::{Failure, Result, source};
use crate::fit::{self, Fit, effects_of};
use crate::machine::{Machine, Mounting};
use crate::model::catalogue::Effect;
use crate::program::plan::Plan;
use crate::program::{self, Generated, Options};
use crate::search::distinguishability::SEEN;
use crate::workflow::Loaded;
use std::collections::BTreeSet;
use std::sync::{Mutex, MutexGuard, PoisonError};

/// Rounds of choosing, generating and leaving out what cannot be reached.
const MOST_ROUNDS: usize = 5;

/// A program may take this much longer than the time that was given.
const OVER: f64 = 1.02;

/// A pair is promised to be told apart from this probability on.
pub const SAFELY: f64 = 0.95;

/// A pair that all touches at once leave no further apart than this is one that they cannot part.
const NOTHING: f64 = 0.1;

/// Pairs that the program's own head names.
const MOST_SAID: usize = 6;

/// A program that was chosen and proven.
pub struct Chosen {
    pub text: String,
    pub generated: Generated,
    pub separations: Vec<Separation>,
    /// The study's name for the blocks as they stand; `None`: put up anew.
    pub label: Option<String>,
    /// Pairs that no touches on these blocks part: they cannot keep a choice from being done.
    pub hopeless: Vec<bool>,
    /// Pairs that no touches of the machine part, in words.
    pub never: Vec<String>,
}

impl Chosen {
    /// Does every pair come that far apart?
    pub(super) fn settles(&self, lambda: f64) -> bool {
        self.separations.iter().all(|s| s.most() >= lambda)
    }

    /// Does every pair that these blocks can part?
    pub(super) fn settles_what_it_can(&self, lambda: f64) -> bool {
        self.separations.iter().zip(&self.hopeless).all(|(s, hopeless)| *hopeless || s.after >= lambda)
    }

    /// How many pairs are told apart.
    pub(super) fn told(&self) -> usize {
        self.separations.iter().filter(|s| s.told >= SAFELY).count()
    }

    /// What was chosen for a room that turns is promised for one only; `goes_on` has what it does where the room goes on.
    pub(super) fn if_the_room_turns(&mut self, goes_on: Vec<Separation>) {
        for (s, on) in self.separations.iter_mut().zip(goes_on) {
            let turned = std::mem::replace(s, on);
            s.told_if_room_turns = Some(turned.told);
            s.after_if_room_turns = Some(turned.after);
        }
    }

    /// Separations as far as they are worth anything: a pair that nothing parts must not hide the others.
    pub(super) fn worth(&self) -> f64 {
        self.separations.iter().map(|s| s.most().min(2.0 * SEEN)).sum()
    }
}

/// What mountings that are tried at the same time find together.
pub(super) fn locked<T>(found: &Mutex<T>) -> MutexGuard<'_, T> {
    found.lock().unwrap_or_else(PoisonError::into_inner)
}

/// The study as a design sees it.
pub(super) struct Setting<'a> {
    pub task: Task<'a>,
    pub runs: Vec<Planned>,
    /// What the study knows beside the touches.
    pub known: Vec<Known>,
    pub noise: Noise,
    /// What was left out of the choice because an effect has no value there.
    pub holes: Mutex<BTreeSet<String>>,
    /// What the room does during the program.
    pub room: Room,
    /// Pairs of questions that a choice is for.
    pub wanted: BTreeSet<usize>,
    /// Pairs that some touches part, on whatever blocks.
    pub parted: Mutex<BTreeSet<usize>>,
}

impl<'a> Setting<'a> {
    pub(super) fn new(loaded: &'a Loaded, effects: &[String], fit: &Fit) -> Result<Self> {
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
            holes: Mutex::default(),
            room: Room::GoesOn,
            wanted: BTreeSet::new(),
            parted: Mutex::default(),
        })
    }

    /// Pairs that all touches of all blocks together leave as they are, in words.
    pub(super) fn never(&self, questions: &Questions) -> Vec<String> {
        let parted = locked(&self.parted);
        let never = questions.pairs.iter().enumerate().filter(|(p, _)| !parted.contains(p));
        never.map(|(_, p)| p.other.as_ref().map_or_else(|| p.one.clone(), |o| format!("{} and {o}", p.one))).collect()
    }

    /// The mounting that stands there since the last run, with the study's name for it (`None` where it is put up anew).
    pub(super) fn stands(&self, machine: &'a Machine, moved: bool) -> Option<(&'a Mounting, Option<String>)> {
        let last = self.runs.last()?;
        let own = last.plan.touches.last()?.mounting.clone();
        let mounting = machine.mounting(own.as_deref().unwrap_or(&last.plan.mounting))?;
        let run = last.mounting.clone().unwrap_or_else(|| format!("{}-{}", last.plan.mounting, self.runs.len()));
        let label = own.map_or(run.clone(), |m| format!("{run}/{m}"));
        Some((mounting, (!moved).then_some(label)))
    }

    /// The runs with a further one, whose blocks stand as the last run left them where a label is given.
    pub(super) fn with(&self, plan: Plan, label: Option<&str>) -> Vec<Planned> {
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

    pub(super) fn view(
        &self,
        plan: &Plan,
        label: Option<&str>,
        effects: &[(&Effect, Option<f64>)],
    ) -> Result<LinearisedPlan> {
        LinearisedPlan::with_effects(&self.task, &self.with(plan.clone(), label), &self.known, self.noise, effects)
    }

    /// What stood there was put down by eye within this: a further program finds it as well.
    fn by_eye_mm(&self, mounting: &Mounting) -> Option<f64> {
        let is_on =
            |run: &&Planned| self.task.machine.mounting(&run.plan.mounting).is_some_and(|on| on.name == mounting.name);
        let found = self.runs.iter().filter(is_on).filter_map(|run| run.plan.find.as_ref());
        found.map(|find| find.tolerance_mm).reduce(f64::max)
    }

    /// Touches that were made or planned before.
    pub(super) fn n_given(&self) -> usize {
        self.runs.iter().map(|r| r.plan.touches.len()).sum()
    }

    /// Chooses touches on a mounting and proves their program, again without what cannot be reached.
    pub(super) fn choose(
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
        let by_eye_mm = self.by_eye_mm(mounting);
        let mut pool = bundles(machine, mounting, &SWIVELS_DEG);
        // what was found with one stylus is not found for another
        pool.retain(|bundle| by_eye_mm.is_none() || bundle.manner.stylus.is_none());
        let mut scale = 1.0;
        let mut found: Option<Chosen> = None;
        for _ in 0..MOST_ROUNDS {
            if pool.is_empty() {
                break;
            }
            let planned = as_plan(machine, mounting, &pool, budget_s / 2.0, VisitOf::Bundle);
            let view = self.view(&planned, label, effects)?;
            if !view.left_out.is_empty() {
                let (left, says) = where_all_have_values(&view, self.n_given(), effects, &pool);
                locked(&self.holes).extend(says);
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
            locked(&self.parted).extend((0..hopeless.len()).filter(|&p| !hopeless[p]));
            let wanted = |p: usize| self.wanted.is_empty() || self.wanted.contains(&p);
            if (0..hopeless.len()).all(|p| hopeless[p] || !wanted(p)) {
                break;
            }
            let chosen = design.choose(&pool, budget_s * scale);
            if chosen.is_empty() {
                break;
            }
            let head = Head { by: "plan-next", name, says: &says(questions), again: &[], by_eye_mm };
            let text = program_text(machine, mounting, &head, &pool, &chosen);
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
                (pool, _) = without(&pool, |_, b, face| is_skipped(b, face, &generated.plan.skipped));
            }
            scale = (scale / over * 0.97).clamp(0.1, 10.0);
        }
        found.ok_or_else(nothing)
    }

    /// What the proven program will be able to tell.
    pub(super) fn told(
        &self,
        plan: &Plan,
        label: Option<&str>,
        effects: &[(&Effect, Option<f64>)],
        questions: &Questions,
    ) -> Result<Vec<Separation>> {
        let touches = plan.touches.clone();
        let Some(first) = touches.first() else { return Ok(Vec::new()) };
        let manner = Manner { pose: first.pose, from: first.from, spindle_deg: 0.0, feed_mm_min: 0.0, stylus: None };
        let all = Bundle { manner, block: String::new(), faces: Vec::new(), ring: Vec::new(), touches };
        let pool = [all];
        let view = self.view(plan, label, effects)?;
        Ok(Design::new(&view, self.n_given(), &pool, questions).separated(&[0]))
    }
}

/// The pairs of a question, in words.
pub(super) fn says(questions: &Questions) -> String {
    let pair = |p: &Pair| match &p.other {
        Some(other) => format!("{} from {other}", p.one),
        None => p.one.clone(),
    };
    let named = questions.pairs.iter().take(MOST_SAID).map(pair).collect::<Vec<_>>().join(", ");
    match questions.pairs.len().saturating_sub(MOST_SAID) {
        0 => named,
        more => format!("{named} and {more} more pairs"),
    }
}
