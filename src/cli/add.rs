//! `axiscal add`, `remove` and `history`: the study's model is changed in place, and every model tried is kept.

use super::common::of_fit;
use super::{Answer, Io};
use crate::diag::{Finding, Result};
use crate::fit::outcome::Outcome;
use crate::report;
use crate::workflow::change::{Edit, change_study};
use crate::workflow::history::with_present_model;
use crate::workflow::load_study;
use serde_json::json;
use std::path::PathBuf;

#[derive(Debug, clap::Args)]
pub struct Args {
    /// The study; it is edited in place
    pub study: PathBuf,
    /// Ids of the effects (`axiscal effects` lists them)
    #[arg(required = true)]
    pub effects: Vec<String>,
    /// Fit and compare, but leave the study as it is
    #[arg(long)]
    pub dry_run: bool,
}

#[derive(Debug, clap::Args)]
pub struct HistoryArgs {
    /// The study
    pub study: PathBuf,
    /// Plots of plain ASCII signs (as in a pipe)
    #[arg(long)]
    pub ascii: bool,
}

/// # Errors
/// When the study is unusable, an effect is unknown, does not apply or is in the model, or the study changed meanwhile.
pub fn add(args: &Args, io: &Io) -> Result<Answer> {
    run(args, Edit::Add(&args.effects), None, io)
}

/// # Errors
/// When the study is unusable, an effect is not in the model, or the study changed meanwhile.
pub fn remove(args: &Args, io: &Io) -> Result<Answer> {
    run(args, Edit::Remove(&args.effects), None, io)
}

/// Changes the model and says what that did; `nested_rms_um` as [`crate::workflow::Loaded::change`].
pub(super) fn run(args: &Args, edit: Edit, nested_rms_um: Option<f64>, io: &Io) -> Result<Answer> {
    let changed = change_study(&args.study, edit, nested_rms_um, args.dry_run, io)?;
    let (before, after) = (&changed.before.outcome, &changed.after.outcome);
    let (later, doubt) = (changed.later_run_rms_um, &changed.held_out);
    io.say(report::ladder::change((before, after), &changed.parameters, later, doubt, io.paper(false)));
    for t in &changed.together {
        io.say(format!("{}: parameters without a value cannot be determined alone; {}", t.effect, t.says()));
    }
    for b in &changed.between {
        io.say(format!("{}: no touch lies in between", b.says()));
    }
    io.say(if args.dry_run {
        format!("{} is as it was (--dry-run)", args.study.display())
    } else {
        format!("{}: the model is now {}", args.study.display(), after.effects.join(", "))
    });
    let plain = |outcome: &Outcome| Outcome { residuals: None, ..outcome.clone() };
    io.answer(&json!({
        "before": plain(before), "after": plain(after), "remarks": changed.parameters.remarks, "written": !args.dry_run,
        "together": changed.together, "between": changed.between,
        "held_out": {
            "se_before_um": doubt.standard_errors.0, "se_after_um": doubt.standard_errors.1,
            "fall_um": doubt.fall.map(|f| f.0), "fall_se_um": doubt.fall.map(|f| f.1), "nested_rms_um": nested_rms_um,
        },
    }));
    Ok(of_fit(after, Answer::Done, io))
}

/// # Errors
/// When the study or its history is unusable.
pub fn history(args: &HistoryArgs, io: &Io) -> Result<Answer> {
    let loaded = load_study(&args.study, io)?;
    let history = with_present_model(&loaded, io)?;
    let other = history.on_other_data(&loaded.data_sha256);
    if !other.is_empty() {
        let steps: Vec<String> = other.iter().map(ToString::to_string).collect();
        io.report(&[Finding::warning(
            "history::other_data",
            format!("the plans or logs have changed since step {}: its figures are of other touches", steps.join(", ")),
        )
        .help("delete the history file next to the study to begin a new one")]);
    }
    io.say(report::ladder::history(&history, io.paper(args.ascii)));
    io.answer(&history);
    Ok(Answer::Done)
}
