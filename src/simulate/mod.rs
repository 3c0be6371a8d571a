//! The virtual machine: a ball searches a real block with a real chain, both with planted errors, and triggers late,
//! early or not at all, as a machine would.
//!
//! Nothing here is shared with the code that predicts but the records (`Machine`, `Plan`, `Position`): transforms,
//! error placement and the physics of the effects are written down once more. What the two say about the same machine
//! must agree, and that is tested.
//!
//! A touch: the commanded position runs on the straight line from `start` to `end` ([`control`] turns it into axis
//! positions), the chain says where ball and block really are (`chain`, `terms`), `contact` finds where they
//! first meet, and pre-travel, lobing, latency and noise make the trigger that much later along the commanded line.

pub mod catalogue;
mod chain;
mod contact;
pub mod control;
mod errorless;
mod find;
mod noise;
mod own;
mod prepare;
mod rigid;
pub mod scenario;
mod terms;
mod touch;
mod written;

#[cfg(test)]
mod tests;

pub use control::Compensation;
pub use errorless::{Errorless, Met};
pub use scenario::Scenario;

use crate::diag::{Finding, Findings, Result};
use crate::log::RawTouch;
use crate::machine::Machine;
use crate::program::plan::Plan;
use rayon::prelude::*;
use touch::{Outcome, Remark};

/// Runs a plan on a machine with everything that is wrong with it; the touches come in the plan's order.
///
/// Findings that are no errors: missed touches, touches that began in contact, and edges that were hit.
///
/// # Errors
/// When the plan does not fit the machine (unknown axes or carriers, no way to search).
pub fn run(
    machine: &Machine,
    plan: &Plan,
    scenario: &Scenario,
    compensation: Option<&Compensation>,
) -> Result<(Vec<RawTouch>, Findings)> {
    run_with_progress(machine, plan, scenario, compensation, &|_| {})
}

/// The same; `progress` is told how many touches are done, from any thread.
///
/// # Errors
/// As [`run`].
pub fn run_with_progress(
    machine: &Machine,
    plan: &Plan,
    scenario: &Scenario,
    compensation: Option<&Compensation>,
    progress: &(dyn Fn(usize) + Sync),
) -> Result<(Vec<RawTouch>, Findings)> {
    run_program(machine, plan, scenario, compensation, progress).map(|(made, findings)| (made.touches, findings))
}

/// What a program made.
#[derive(Debug, Clone)]
pub struct Made {
    /// The touches, in the plan's order.
    pub touches: Vec<RawTouch>,
    /// How far off its place an artefact stood that was put down by eye, as the program has found it, mm along X, Y and Z with all
    /// rotary axes at 0.
    pub found_mm: Option<[f64; 3]>,
}

/// The same with what the program has found.
///
/// # Errors
/// As [`run`], and when the program stops because it does not find the artefact.
pub fn run_program(
    machine: &Machine,
    plan: &Plan,
    scenario: &Scenario,
    compensation: Option<&Compensation>,
    progress: &(dyn Fn(usize) + Sync),
) -> Result<(Made, Findings)> {
    let found =
        plan.find.as_ref().map(|sought| find::find(machine, plan, sought, scenario, compensation)).transpose()?;
    let (found_mm, relative) = found.unzip();
    let plan = relative.as_ref().unwrap_or(plan);
    /// Touches between two reports: some milliseconds of work.
    const CHUNK: usize = 1024;
    let (bench, findings) = prepare::bench(machine, plan, scenario, compensation)?;
    let mut outcomes: Vec<Outcome> = Vec::with_capacity(bench.touches.len());
    bench
        .touches
        .par_chunks(CHUNK)
        .map(|chunk| {
            let done: Vec<Outcome> = chunk.iter().map(|t| touch::make(&bench, t)).collect();
            progress(done.len());
            done
        })
        .collect::<Vec<_>>()
        .into_iter()
        .for_each(|done| outcomes.extend(done));
    let findings = remarks(findings, &outcomes);
    findings.finish(Made { touches: outcomes.into_iter().map(|o| o.raw).collect(), found_mm })
}

/// The first of many numbers, and how many more there are.
fn some_of(ids: &[u64]) -> (String, String) {
    const SHOWN: usize = 10;
    let shown = ids.iter().take(SHOWN).map(u64::to_string).collect::<Vec<_>>().join(", ");
    let more = if ids.len() > SHOWN { format!(" and {} more", ids.len() - SHOWN) } else { String::new() };
    (shown, more)
}

/// One finding for each kind of remark, with the touches that it is about.
fn remarks(mut findings: Findings, outcomes: &[Outcome]) -> Findings {
    let mut say = |kind: fn(&Remark) -> bool, code, what: &str, help: &str| {
        let ids: Vec<u64> =
            outcomes.iter().filter(|o| o.remark.as_ref().is_some_and(kind)).filter_map(|o| o.raw.id).collect();
        if !ids.is_empty() {
            let (shown, more) = some_of(&ids);
            findings.push(Finding::warning(code, format!("{what}: touch {shown}{more}")).help(help));
        }
    };
    say(
        |r| matches!(r, Remark::Missed),
        "simulate::missed",
        "the search ended without contact",
        "the block stands further off than the search reaches: the log says miss",
    );
    say(
        |r| matches!(r, Remark::Already(_)),
        "simulate::already",
        "the ball was in contact before the search began",
        "the block stands nearer than the approach: the log says miss at the start; a control would stop",
    );
    say(
        |r| matches!(r, Remark::Edge),
        "simulate::edge",
        "the ball met an edge of the block instead of its face",
        "touch further from the edge, or displace the block less: such a touch measures something else",
    );
    say(
        |r| matches!(r, Remark::OtherFace),
        "simulate::other_face",
        "the ball met another face of the block than the plan says",
        "the block is turned or displaced too far for this plan",
    );
    say(
        |r| matches!(r, Remark::Unreachable(_)),
        "simulate::unreachable",
        "the compensated control has no way to this position",
        "export the compensation again for this machine",
    );
    findings
}
