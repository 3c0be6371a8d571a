//! A program that nobody has written: chosen for a machine and what is mounted on it, proven to be reachable.

use super::new::default_effects;
use crate::design::auto_plan::choose;
use crate::design::bundle::{Head, as_plan, bundles, program_text, without};
use crate::design::{LinearisedPlan, Noise, Planned, Task};
use crate::diag::{Failure, Result, source};
use crate::fit::effects_of;
use crate::machine::{Machine, Mounting};
use crate::model::catalogue::Catalogue;
use crate::program::{self, Options, ProgramSpec};
use crate::units::mm_from_um;

/// Rounds of choosing, proving and leaving out what cannot be reached.
const MOST_ROUNDS: usize = 6;

/// The program uses at least this share of its time, at most this much more.
const USED: [f64; 2] = [0.9, 1.02];

/// Longest program, minutes: a day.
const MOST_MINUTES: f64 = 1440.0;

/// A program that was chosen, as a file of its own.
#[derive(Debug, Clone)]
pub struct AutoProgram {
    /// The file's text: it can be edited and used like any other.
    pub text: String,
    pub spec: ProgramSpec,
}

/// Chooses poses and touches for what a mounting holds, within a time.
///
/// # Errors
/// When the time is no usable number, or nothing can be reached.
pub fn auto_program(
    machine: &Machine,
    catalogue: &Catalogue,
    mounting: &Mounting,
    minutes: f64,
) -> Result<AutoProgram> {
    if !(minutes > 0.0 && minutes <= MOST_MINUTES) {
        return Err(Failure::new("auto::minutes", format!("--minutes {minutes}: more than 0, at most {MOST_MINUTES}"))
            .help("20 is a good beginning"));
    }
    let budget_s = 60.0 * minutes;
    let mut pool = bundles(machine, mounting);
    let (mut scale, mut best): (f64, Option<(f64, AutoProgram)>) = (1.0, None);
    let mut why: Option<Failure> = None;
    for _ in 0..MOST_ROUNDS {
        if pool.is_empty() {
            break;
        }
        let planned = as_plan(machine, mounting, &pool, budget_s / 2.0);
        let effects = default_effects(machine, &[&planned], false);
        let task = Task {
            machine,
            catalogue,
            effects: effects_of(&effects, catalogue, machine)?,
            held: Vec::new(),
            reference: machine.reference.pivot,
            temperature: false,
        };
        let noise = Noise {
            sigma_mm: mm_from_um(machine.probe.repeatability_um),
            tau_mm: machine.rotary().map(|a| a.indexing_repeatability_mm.powi(2)).sum::<f64>().sqrt(),
        };
        let view = LinearisedPlan::new(&task, &[Planned::new(planned)], &[], noise)?;
        let choice = choose(&view, &pool, budget_s * scale);
        if choice.chosen.is_empty() {
            break;
        }
        let says = format!("chosen for {}: {minutes} minutes with {:?}", machine.name, mounting.name);
        let head = Head { by: "generate --program auto", name: "auto", says: &says, again: &choice.again };
        let text = program_text(machine, mounting, &head, &pool, &choice.chosen);
        let (spec, _) = program::load(&source("auto.toml", text.clone()))?;
        let made = match program::generate(machine, &spec, &Options::default()) {
            Ok((made, _)) => made,
            Err(failure) => {
                // nothing of it can be reached: what was chosen is no choice
                why = Some(failure);
                let mut at = 0..;
                pool.retain(|_| !choice.chosen.contains(&at.next().unwrap_or_default()));
                continue;
            }
        };
        let used = made.path.seconds / budget_s;
        let lost = !made.plan.skipped.is_empty();
        let fits = used <= USED[1];
        let found = AutoProgram { text, spec };
        // a program without a gap before one with, then the longer one
        let worth = if lost { used - 1.0 } else { used };
        if fits && best.as_ref().is_none_or(|(w, _)| worth > *w) {
            best = Some((worth, found));
        }
        if fits && !lost && used >= USED[0] {
            break;
        }
        if lost {
            pool = without(&pool, &made.plan.skipped);
        }
        scale = (scale / used * 0.97).clamp(0.05, 20.0);
    }
    let nothing = || {
        why.unwrap_or_else(|| {
            Failure::new(
                "auto::nothing",
                format!("nothing of {:?} can be touched within {minutes} minutes", mounting.name),
            )
            .help("more minutes (--minutes), or another place for the artefact")
        })
    };
    best.map(|(_, program)| program).ok_or_else(nothing)
}
