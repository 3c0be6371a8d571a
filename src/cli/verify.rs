//! `axiscal verify`: two studies side by side: did the compensation work, has the machine changed?

use super::common::of_fit;
use super::load::{Loaded, load_study};
use super::{Answer, Io};
use crate::compare::verify::{Figures, Question, Verdict, verify};
use crate::diag::{Failure, Result};
use crate::diagnose::{self, Options, Subject, diagnose};
use crate::fit::{Fit, Settings};
use crate::program::plan::ControllerFrame;
use crate::report;
use crate::units::um_from_mm;
use std::collections::BTreeMap;
use std::path::PathBuf;

/// Arguments of `verify`.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The study of the runs before
    pub before: PathBuf,
    /// The study of the runs after
    pub after: PathBuf,
}

/// Runs `verify`.
///
/// # Errors
/// When a study is unusable, they are of two machines or of the same logs, or the runs after cannot show what is asked.
pub fn run(args: &Args, io: &Io) -> Result<Answer> {
    let (before, after) = (load_study(&args.before, io)?, load_study(&args.after, io)?);
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
    let question = if before.active()? == after.active()? { Question::Change } else { Question::Compensation };
    can_show(&after, question)?;
    let fitted = |l: &Loaded| l.fit(&l.settings());
    let (first, second) = (fitted(&before)?, fitted(&after)?);
    let same_plans = before.runs.len() == after.runs.len()
        && before.runs.iter().zip(&after.runs).all(|(b, a)| {
            let points = |p: &crate::program::plan::Plan| {
                p.touches.iter().map(|t| (t.point, t.normal, t.pose)).collect::<Vec<_>>()
            };
            points(&b.plan) == points(&a.plan)
        });
    let mut answer = verify(
        (&first.outcome, figures(&before, &first)?),
        (&second.outcome, figures(&after, &second)?),
        question,
        same_plans,
    );
    let missing = still_missing(&after, &second)?;
    answer.remarks.splice(0..0, missing);
    io.say(report::ladder::verification(&answer, io.paper(false)));
    for (lacks, effects) in [(&after, &answer.only_before), (&before, &answer.only_after)] {
        if !effects.is_empty() {
            let study = super::next::quoted(&lacks.path);
            io.say_as_it_is(format!("next: axiscal add {study} {}", effects.join(" ")));
        }
    }
    io.answer(&answer);
    let no = matches!(answer.verdict, Verdict::NotImproved | Verdict::ModelsDiffer);
    let answer = of_fit(&first.outcome, if no { Answer::No } else { Answer::Done }, io);
    Ok(of_fit(&second.outcome, answer, io))
}

/// What the runs after show that their model lacks: its errors are then not those of the machine.
fn still_missing(after: &Loaded, fit: &Fit) -> Result<Option<String>> {
    let settings = Settings { quick: true, ..after.settings() };
    let subject = Subject { machine: &after.machine, catalogue: &after.catalogue, settings: &settings, fit };
    let found = diagnose(subject, &Options { at_most: 1, refit: false, power: false, planned: None })?;
    let fails = matches!(found.verdict, diagnose::Verdict::MissingEffect(_) | diagnose::Verdict::Unexplained(_));
    let missing = (fails && !found.verdict.is_weak_pattern()) || found.mistake().is_some();
    Ok(missing.then(|| format!("`axiscal diagnose` says of the study after: {}", found.says)))
}

/// A run with the transformation off reads the bare machine, whatever pins are set.
fn can_show(after: &Loaded, question: Question) -> Result<()> {
    let Some(active) = after.active()? else { return Ok(()) };
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
