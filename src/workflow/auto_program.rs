//! A program for a machine and what is mounted on it: chosen touch by touch and proven to be reachable, or a built-in one where that
//! measures better in the same time.

use super::new::default_effects;
use crate::design::auto_plan::{Choice, Tells, choose};
use crate::design::bundle::{
    Bundle, Head, SWIVELS_WIDE_DEG, VisitOf, as_plan, bundles, is_skipped, program_text, too_narrow, without,
};
use crate::design::worth::Worth;
use crate::design::{LinearisedPlan, Noise, Planned, Task};
use crate::diag::{Failure, Findings, Result, source};
use crate::fit::effects_of;
use crate::machine::{Machine, Mounting};
use crate::model::catalogue::Catalogue;
use crate::program::plan::Plan;
use crate::program::{self, Generated, Options, ProgramSpec};
use crate::units::mm_from_um;
use nalgebra::Vector3;

/// Rounds of choosing, proving and leaving out what cannot be reached.
const MOST_ROUNDS: usize = 8;

/// The program uses at least this share of its time, at most this much more.
const USED: [f64; 2] = [0.9, 1.02];

/// A result that is known no better than to this part of its typical size is one that the artefact hardly sees.
const POOR: f64 = 1.0;

/// Another place is worth the trouble when the worst uncertainty is so many times smaller there.
const WORTH_MOVING: f64 = 1.5;

/// Places that are tried: X and Y from the axis of what bears the artefact, and how much higher, mm.
const PLACES_MM: [(f64, f64, f64); 6] =
    [(60.0, 0.0, 0.0), (-60.0, 0.0, 0.0), (0.0, 60.0, 0.0), (0.0, -60.0, 0.0), (100.0, 0.0, 0.0), (60.0, 0.0, 50.0)];

/// Longest program, minutes: a day.
const MOST_MINUTES: f64 = 1440.0;

/// A program that was chosen, as a file of its own.
#[derive(Debug, Clone)]
pub struct AutoProgram {
    /// The file's text: it can be edited and used like any other.
    pub text: String,
    pub spec: ProgramSpec,
    /// A place at which the artefact would see much more.
    pub better: Option<BetterPlace>,
    /// The built-in program that was taken.
    pub taken: Option<Taken>,
    /// Plan and path of `spec`, where they are generated already.
    pub made: Option<Made>,
}

/// Plan and path of a program, with the findings.
type Made = (Generated, Findings);

/// A built-in program that measures better than the touches that would be chosen.
#[derive(Debug, Clone, PartialEq)]
pub struct Taken {
    pub program: String,
    pub worth: Worth,
    /// Of the choice that was not taken.
    pub of_choice: Worth,
}

/// Another place for an artefact.
#[derive(Debug, Clone, PartialEq)]
pub struct BetterPlace {
    /// By how much all bodies would move, mm in R.
    pub by_mm: Vector3<f64>,
    /// How many times smaller the worst uncertainty would be.
    pub times: f64,
    /// Standard uncertainty of the worst-determined result where it stands, in its typical size.
    pub worst: f64,
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
    by_eye_mm: Option<f64>,
) -> Result<AutoProgram> {
    if !(minutes > 0.0 && minutes <= MOST_MINUTES) {
        return Err(Failure::new("auto::minutes", format!("--minutes {minutes}: more than 0, at most {MOST_MINUTES}"))
            .help("20 is a good beginning"));
    }
    let budget_s = 60.0 * minutes;
    let says = format!("chosen for {}: {minutes} minutes with {:?}", machine.name, mounting.name);
    let write = |pool: &[Bundle], choice: &Choice| {
        let head = Head { by: "generate --program auto", name: "auto", says: &says, again: &choice.again, by_eye_mm };
        program_text(machine, mounting, &head, pool, &choice.chosen)
    };
    let mut pool = bundles(machine, mounting, &SWIVELS_WIDE_DEG);
    // what was found with one stylus is not found for another
    pool.retain(|bundle| by_eye_mm.is_none() || bundle.manner.stylus.is_none());
    let mut scale = 1.0;
    let mut best: Option<(f64, String, Option<Made>)> = None;
    let mut worst = f64::INFINITY;
    let mut why: Option<Failure> = None;
    let mut known: Option<Tells> = None;
    for _ in 0..MOST_ROUNDS {
        if pool.is_empty() {
            break;
        }
        let tells = match known.take() {
            Some(of_pool) => of_pool,
            None => linearised(machine, catalogue, mounting, &pool, budget_s)?,
        };
        let choice = choose(&tells, &pool, budget_s * scale);
        if choice.chosen.is_empty() {
            break;
        }
        worst = worst.min(choice.worst);
        let mut text = write(&pool, &choice);
        let mut whole = None;
        let (made, findings) = match prove(machine, &text) {
            Ok(made) => made,
            Err(failure) => {
                // nothing of it can be reached: what was chosen is no choice
                why = Some(failure);
                let (left, touches) = without(&pool, |i, _, _| choice.chosen.contains(&i));
                (pool, known) = (left, Some(tells.only(&touches)));
                continue;
            }
        };
        let used = made.path.seconds / budget_s;
        let lost = made.plan.skipped.len() as f64 / (made.plan.skipped.len() + made.plan.touches.len()) as f64;
        // what is left of the same choice is a program without a gap
        if !made.plan.skipped.is_empty() {
            let (left, touches) = without(&pool, |_, b, face| is_skipped(b, face, &made.plan.skipped));
            let again = |of: &[usize]| -> Vec<usize> {
                let same = |i: &usize| left.iter().position(|b| b.is_of(&pool[*i]));
                of.iter().filter_map(same).collect()
            };
            let kept = Choice { chosen: again(&choice.chosen), again: again(&choice.again), worst: choice.worst };
            known = Some(tells.only(&touches));
            if kept.chosen.is_empty() {
                pool = left;
                continue;
            }
            text = write(&left, &kept);
            pool = left;
        } else {
            known = Some(tells);
            whole = Some((made, findings));
        }
        let worth = used - 2.0 * lost;
        if used <= USED[1] && best.as_ref().is_none_or(|(w, ..)| worth > *w) {
            best = Some((worth, text, whole));
            if worth >= USED[0] {
                break;
            }
        }
        scale = (scale / used * 0.97).clamp(0.05, 20.0);
    }
    let nothing = || {
        if let Some(narrow) = narrow_hole(machine, mounting) {
            return narrow;
        }
        why.unwrap_or_else(|| {
            Failure::new("auto::nothing", format!("no program for {:?} fits into {minutes} minutes", mounting.name))
                .help("more minutes (--minutes), or another place for the artefact")
        })
    };
    let (_, text, made) = best.ok_or_else(nothing)?;
    let (spec, _) = program::load(&source("auto.toml", text.clone()))?;
    // where touches were taken out, it is generated again
    let made = || made.map_or_else(|| program::generate(machine, &spec, &Options::default()), Ok);
    let suited = if by_eye_mm.is_none() { program::written_for(machine, &mounting.name)? } else { Vec::new() };
    let made = if suited.is_empty() {
        made()?
    } else {
        let (made, written) = better_written(machine, catalogue, suited, made, budget_s)?;
        if let Some(written) = written {
            return Ok(written);
        }
        made
    };
    let better = if worst > POOR { better_place(machine, catalogue, mounting, budget_s, worst)? } else { None };
    Ok(AutoProgram { text, spec, better, taken: None, made: Some(made) })
}

/// The choice as it is generated, and the built-in program that measures better: of about the same time, or better in everything.
fn better_written(
    machine: &Machine,
    catalogue: &Catalogue,
    suited: Vec<(ProgramSpec, &'static str)>,
    choice: impl FnOnce() -> Result<Made> + Send,
    budget_s: f64,
) -> Result<(Made, Option<AutoProgram>)> {
    let worth_of = |plan: Plan| view_of(machine, catalogue, plan, noise_of(machine)).map(|view| Worth::of(&view));
    let of_written = || -> Result<Vec<(Worth, bool, String, &str)>> {
        let mut written = Vec::new();
        for (spec, text) in suited {
            // a mounting that was changed may no longer suit it
            let Ok((made, _)) = program::generate(machine, &spec, &Options::default()) else { continue };
            let used = made.path.seconds / budget_s;
            if used <= USED[1] && made.plan.skipped.is_empty() {
                written.push((worth_of(made.plan)?, used >= USED[0], spec.name, text));
            }
        }
        Ok(written)
    };
    let of_choice = || -> Result<(Made, Worth)> {
        let made = choice()?;
        let worth = worth_of(made.0.plan.clone())?;
        Ok((made, worth))
    };
    let (written, of_choice) = rayon::join(of_written, of_choice);
    let (mut written, (made, of_choice)) = (written?, of_choice?);
    written.retain(|(worth, is_as_long, ..)| {
        !of_choice.is_as_good_as(worth) && (*is_as_long || worth.is_as_good_as(&of_choice))
    });
    let Some((worth, _, name, text)) = written.into_iter().min_by(|a, b| a.0.worst.total_cmp(&b.0.worst)) else {
        return Ok((made, None));
    };
    let text = renamed(text, &name)?;
    let (spec, _) = program::load(&source("auto.toml", text.clone()))?;
    let taken = Some(Taken { program: name, worth, of_choice });
    Ok((made, Some(AutoProgram { text, spec, better: None, taken, made: None })))
}

/// The text of a built-in program as a file of its own.
fn renamed(text: &str, name: &str) -> Result<String> {
    let unusable = |e: toml_edit::TomlError| Failure::new("auto::built_in", e.message().to_owned());
    let mut file: toml_edit::DocumentMut = text.parse().map_err(unusable)?;
    file["name"] = toml_edit::value("auto");
    Ok(format!("# taken by `axiscal generate --program auto`: the built-in program {name}\n{file}"))
}

/// Looks at the places round the axis of what bears an artefact, and higher up: with the touches alone, not proven.
fn better_place(
    machine: &Machine,
    catalogue: &Catalogue,
    mounting: &Mounting,
    budget_s: f64,
    worst: f64,
) -> Result<Option<BetterPlace>> {
    let Some(first) = mounting.blocks.first() else { return Ok(None) };
    let turning = machine.carrier_chain(first.carrier).last().copied().filter(|a| a.name.is_rotary());
    let foot = turning.map_or(machine.reference.table, |axis| axis.point);
    let mut best: Option<BetterPlace> = None;
    for (x, y, up) in PLACES_MM {
        let by_mm = Vector3::new(foot.x + x - first.centre.x, foot.y + y - first.centre.y, up);
        let mut moved = mounting.clone();
        moved.blocks.iter_mut().for_each(|b| b.centre += by_mm);
        let pool = bundles(machine, &moved, &SWIVELS_WIDE_DEG);
        if pool.is_empty() {
            continue;
        }
        let there = choose(&linearised(machine, catalogue, &moved, &pool, budget_s)?, &pool, budget_s).worst;
        let times = worst / there;
        if times > best.as_ref().map_or(WORTH_MOVING, |b| b.times) {
            best = Some(BetterPlace { by_mm, times, worst });
        }
    }
    Ok(best)
}

/// Why a hole cannot be touched.
fn narrow_hole(machine: &Machine, mounting: &Mounting) -> Option<Failure> {
    mounting.blocks.iter().find_map(|block| {
        let least_mm = too_narrow(machine, block)?;
        let (hole_mm, tip_mm) = (block.diameter.unwrap_or_default(), 2.0 * machine.probe.ball_radius);
        let message = format!(
            "the probe does not go into the hole {:?}: its diameter is {hole_mm} mm, the tip has {tip_mm} mm and keeps {} mm on each \
             side",
            block.name, machine.probe.clearance
        );
        Some(Failure::new("auto::narrow_hole", message).help(format!(
            "use a hole of more than {least_mm} mm or a smaller tip (`ball_radius` of [machine.probe] in the machine file)"
        )))
    })
}

fn prove(machine: &Machine, text: &str) -> Result<Made> {
    let (spec, _) = program::load(&source("auto.toml", text.to_owned()))?;
    program::generate(machine, &spec, &Options::default())
}

/// What the touches of a pool tell, the whole catalogue beside the model.
fn linearised(
    machine: &Machine,
    catalogue: &Catalogue,
    mounting: &Mounting,
    pool: &[Bundle],
    budget_s: f64,
) -> Result<Tells> {
    let noise = noise_of(machine);
    let plan = as_plan(machine, mounting, pool, budget_s / 2.0, VisitOf::Manner);
    let of_touches = view_of(machine, catalogue, plan, Noise { tau_mm: 0.0, ..noise })?;
    Ok(Tells::of(&of_touches, noise.tau_mm))
}

fn noise_of(machine: &Machine) -> Noise {
    Noise {
        sigma_mm: mm_from_um(machine.probe.repeatability_um),
        tau_mm: machine.rotary().map(|a| a.indexing_repeatability_mm.powi(2)).sum::<f64>().sqrt(),
    }
}

/// What a plan sees, the whole catalogue beside the model.
fn view_of(machine: &Machine, catalogue: &Catalogue, plan: Plan, noise: Noise) -> Result<LinearisedPlan> {
    let effects = default_effects(machine, &[&plan], false);
    let task = Task {
        machine,
        catalogue,
        effects: effects_of(&effects, catalogue, machine)?,
        held: Vec::new(),
        reference: machine.reference.pivot,
        temperature: false,
    };
    LinearisedPlan::new(&task, &[Planned::new(plan)], &[], noise)
}
