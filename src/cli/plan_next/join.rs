//! The log of a program that was chosen, as the next run of the study.

use super::{Answer, Args, Io};
use crate::diag::Result;
use crate::workflow::Loaded;
use crate::workflow::join::{Join, join as join_run};
use serde_json::json;
use std::path::{Path, PathBuf};

/// The plan that a log is of, by its name: `next-3.log` is that of `next-3.plan.json`, in the folder that is named or beside
/// the log. How many runs the study has by now says nothing of it.
pub(super) fn plan_of(log: &Path, out: &Path) -> Option<PathBuf> {
    let name = format!("{}.plan.json", log.file_stem()?.to_str()?);
    let beside = log.parent().map(|folder| folder.join(&name));
    std::iter::once(out.join(&name)).chain(beside).find(|p| p.is_file())
}

/// Puts the log of the program into the study.
pub(super) fn join(args: &Args, loaded: &Loaded, plan: &Path, log: &Path, io: &Io) -> Result<Answer> {
    let controller = args.controller.as_deref().ok_or_else(super::no_controller)?;
    let run = Join { plan, log, controller, moved: args.moved };
    let touches = join_run(loaded, &run, io)?;
    let runs = loaded.runs.len() + 1;
    io.say(format!("{}: run {runs} with {touches} touches", args.study.display()));
    io.answer(&json!({ "study": args.study.display().to_string(), "runs": runs, "touches": touches }));
    Ok(Answer::Done)
}
