//! The log of a program that was chosen, as the next run of the study.

use super::{Answer, Args, Io, Loaded, relative};
use crate::cli::load::{load_plan, read_log};
use crate::diag::{Failure, Finding, Result};
use crate::files;
use crate::study;
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
pub(super) fn join(args: &Args, loaded: &Loaded, plan_file: &Path, log: &Path, io: &Io) -> Result<Answer> {
    let folder = args.study.parent().map(Path::to_path_buf).unwrap_or_default();
    let same = |name: &str| {
        let there = |p: &Path| std::fs::canonicalize(p).ok();
        there(&folder.join(name)).is_some_and(|p| there(log) == Some(p))
    };
    if let Some(run) = loaded.study.data.iter().position(|d| same(&d.log)) {
        return Err(Failure::new("next::joined", format!("{} is run {} of the study already", log.display(), run + 1))
            .help("a log counts once: name the log of a further run"));
    }
    let plan = load_plan(plan_file, &loaded.machine, io)?;
    let touches = read_log(&files::read_bytes(log)?, log, &args.controller, &loaded.machine, &plan, io)?;
    let runs = loaded.planned();
    // whoever made the program for blocks put up anew has put them up anew
    let moved = args.moved || plan.blocks_anew;
    if moved && !args.moved {
        io.report(&[Finding::info(
            "next::blocks_anew",
            "this program was made for blocks that are mounted again: their positions are unknown",
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
    files::rewrite(&args.study, text.as_bytes())?;
    io.say(format!("{}: run {} with {} touches", args.study.display(), loaded.runs.len() + 1, touches.len()));
    io.answer(
        &json!({ "study": args.study.display().to_string(), "runs": loaded.runs.len() + 1, "touches": touches.len() }),
    );
    Ok(Answer::Done)
}
