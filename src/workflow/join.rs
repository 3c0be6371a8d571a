//! The log of a program is put into the study as its next run.

use super::new::{relative, relative_controller};
use super::{Environment, Loaded, LogFile, load_plan};
use crate::diag::{Failure, Finding, Result};
use crate::study;
use std::path::Path;

#[derive(Debug, Clone, Copy)]
pub struct Join<'a> {
    pub plan: &'a Path,
    pub log: &'a Path,
    pub controller: &'a str,
    /// The blocks were put up anew: their set-up is unknown again.
    pub moved: bool,
}

/// Puts it into the study's file and says how many touches it has. The caller holds the study's lock.
///
/// # Errors
/// When plan or log are unusable, or the log is in the study already.
pub fn join(loaded: &Loaded, run: &Join, env: &dyn Environment) -> Result<usize> {
    let &Join { plan: plan_file, log, controller, moved } = run;
    let folder = loaded.folder();
    let same = |name: &str| env.is_same(&folder.join(name), log);
    if let Some(run) = loaded.study.data.iter().position(|d| same(&d.log)) {
        return Err(Failure::new("next::joined", format!("{} is run {} of the study already", log.display(), run + 1))
            .help("a log counts once: name the log of a further run"));
    }
    let plan = load_plan(plan_file, &loaded.machine, env)?;
    let read = LogFile { bytes: &env.read(log)?, path: log, controller, run: None };
    let touches = read.read(&loaded.machine, &plan, env)?.touches;
    let runs = loaded.planned();
    // whoever made the program for blocks put up anew has put them up anew
    if plan.blocks_anew && !moved {
        env.remark(&[Finding::info(
            "next::blocks_anew",
            "this program was made for blocks that are mounted again: their positions are unknown",
        )
        .help("where they were not moved after all, write the [[data]] by hand with the same mounting")]);
    }
    let moved = moved || plan.blocks_anew;
    let stood = runs.last().and_then(|last| {
        let own = last.plan.touches.last()?.mounting.clone();
        let same = own.as_deref().unwrap_or(&last.plan.mounting).split('#').next() == Some(plan.mounting.as_str());
        let run = last.mounting.clone().unwrap_or_else(|| format!("{}-{}", last.plan.mounting, runs.len()));
        (same && !moved).then(|| (run.clone(), own.map_or(run.clone(), |m| format!("{run}/{m}"))))
    });
    let joined = study::Joined {
        plan: relative(plan_file, folder),
        log: relative(log, folder),
        controller: relative_controller(controller, folder),
        stood,
    };
    let text = study::join(&loaded.text(), &joined)?;
    env.write(&loaded.path, Some(text.as_bytes()))?;
    Ok(touches.len())
}
