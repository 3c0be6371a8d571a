//! Two studies side by side: did the compensation work, has the machine changed?

use super::examine::VERDICT;
use super::{Environment, Loaded};
use crate::compare::verify::{Figures, Question, Verification, verify as side_by_side};
use crate::diag::{Failure, Result};
use crate::diagnose;
use crate::fit::outcome::Outcome;
use crate::fit::{Fit, Settings};
use crate::program::plan::ControllerFrame;
use crate::units::um_from_mm;
use std::collections::BTreeMap;

/// The comparison of two studies, with the fit of each.
#[derive(Debug)]
pub struct Verified {
    pub answer: Verification,
    pub before: Outcome,
    pub after: Outcome,
}

/// Compares the study of the runs before with that of the runs after.
///
/// # Errors
/// When they are of two machines or of the same logs, the runs after cannot show what is asked, or a fit is impossible.
pub fn verify(before: &Loaded, after: &Loaded, env: &dyn Environment) -> Result<Verified> {
    if before.machine.name != after.machine.name {
        return Err(Failure::new(
            "verify::machines",
            format!("the studies are of two machines: {:?} and {:?}", before.machine.name, after.machine.name),
        )
        .help("name two studies of one machine"));
    }
    if before.data_sha256 == after.data_sha256 {
        return Err(Failure::new("verify::same_data", "both studies hold the same logs")
            .help("name the study of the runs before first, then that of the runs after"));
    }
    let question = if before.active(env)? == after.active(env)? { Question::Change } else { Question::Compensation };
    can_show(after, question, env)?;
    let fitted = |l: &Loaded| l.fit(&l.settings());
    let (first, second) = (fitted(before)?, fitted(after)?);
    let same_plans = before.runs.len() == after.runs.len()
        && before.runs.iter().zip(&*after.runs).all(|(b, a)| {
            let points = |p: &crate::program::plan::Plan| {
                p.touches.iter().map(|t| (t.point, t.normal, t.pose)).collect::<Vec<_>>()
            };
            points(&b.plan) == points(&a.plan)
        });
    let mut answer = side_by_side(
        (&first.outcome, figures(before, &first)?),
        (&second.outcome, figures(after, &second)?),
        question,
        same_plans,
    );
    let missing = still_missing(after, &second)?;
    answer.remarks.splice(0..0, missing);
    Ok(Verified { answer, before: first.outcome, after: second.outcome })
}

/// What the runs after show that their model lacks: its errors are then not those of the machine.
fn still_missing(after: &Loaded, fit: &Fit) -> Result<Option<String>> {
    let found = after.diagnose(&after.settings(), fit, &VERDICT)?;
    let fails = matches!(found.verdict, diagnose::Verdict::MissingEffect(_) | diagnose::Verdict::Unexplained(_));
    let missing = (fails && !found.verdict.is_weak_pattern()) || found.mistake().is_some();
    Ok(missing.then(|| format!("`axiscal diagnose` says of the study after: {}", found.says)))
}

/// A run with the transformation off reads the bare machine, whatever pins are set.
fn can_show(after: &Loaded, question: Question, env: &dyn Environment) -> Result<()> {
    let Some(active) = after.active(env)? else { return Ok(()) };
    if question != Question::Compensation {
        return Ok(());
    }
    let axes = |f: ControllerFrame| f == ControllerFrame::Axes;
    let idle = active.idle_without_transformation(&after.machine);
    let off = after.runs.iter().find(|r| idle > 0 && axes(r.plan.controller_frame));
    match off {
        Some(run) => Err(Failure::new(
            "verify::cannot_show",
            format!(
                "the runs after cannot show the compensation: program {} gives axis positions, and {idle} of its errors act under the control's own transformation only",
                run.plan.program
            ),
        )
        .help("make the program with `axiscal generate --tcp`, run it with the transformation on, and name that study")),
        None => Ok(()),
    }
}

/// RMS of the readings when only what is no error of the machine is fitted: places of the blocks, and the probe.
fn figures(loaded: &Loaded, fit: &Fit) -> Result<Figures> {
    let nuisance = |id: &String| loaded.catalogue.get(id, &loaded.machine).is_some_and(|e| e.nuisance);
    let effects: Vec<String> = loaded.study.effects.iter().filter(|id| nuisance(id)).cloned().collect();
    let (readings_rms_um, readings_dof) = if effects.is_empty() {
        let batch = fit.model.prepare(&fit.data.observations);
        let start = fit.model.start();
        let (at, mut scratch) = (batch.at(&start), batch.scratch());
        let squares: f64 =
            (0..batch.len()).filter(|&i| fit.weight[i] > 0.0).map(|i| at.gap(i, &mut scratch).powi(2)).sum();
        (um_from_mm((squares / fit.n_used().max(1) as f64).sqrt()), fit.n_used())
    } else {
        let settings =
            Settings { effects, knowledge: BTreeMap::new(), type_b: BTreeMap::new(), quick: true, ..loaded.settings() };
        let bare = loaded.fit(&settings)?;
        (bare.outcome.rms_um, bare.dof)
    };
    Ok(Figures {
        readings_rms_um,
        readings_dof,
        fit_rms_um: fit.outcome.rms_um,
        noise_um: um_from_mm(fit.noise.sigma_mm),
        explained: fit.dof == 0 || fit.outcome.chi2_per_dof <= fit.noise.limit(fit.dof),
    })
}
