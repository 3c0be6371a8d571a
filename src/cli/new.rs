//! `axiscal new`: writes a study from plans and logs.

use super::common::MachineArgs;
use super::load::{load_compensation, load_plan, read_log};
use super::{Answer, Io};
use crate::diag::{Failure, Result};
use crate::files;
use crate::machine::Machine;
use crate::model::catalogue::Catalogue;
use crate::study::{DataEntry, Study};
use serde_json::json;
use std::path::{Path, PathBuf};

/// Arguments of `new`.
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(flatten)]
    pub machine: MachineArgs,
    /// The plan of a run (repeat for several runs)
    #[arg(long, required = true)]
    pub plan: Vec<PathBuf>,
    /// The log of a run, in the order of the plans
    #[arg(long, required = true)]
    pub log: Vec<PathBuf>,
    /// The controller that wrote the logs: a name, a postprocessor file, or csv (once for all, or once per log)
    #[arg(long, default_value = "linuxcnc")]
    pub controller: Vec<String>,
    /// The compensation that the control applied during the runs: what `export` wrote (once for all, or once per log)
    #[arg(long, value_name = "DIR")]
    pub compensation: Vec<PathBuf>,
    /// Effects of the model (default: the location errors, the blocks' set-up and the pre-travel)
    #[arg(long, value_delimiter = ',')]
    pub effects: Vec<String>,
    /// The blocks are exactly where the plan says: their positions are not solved for
    #[arg(long)]
    pub known_blocks: bool,
    /// A file with effects of your own
    #[arg(long, value_name = "FILE")]
    pub effects_file: Vec<PathBuf>,
    /// Where to write the study
    #[arg(long, default_value = "study.toml")]
    pub out: PathBuf,
}

/// Runs `new`.
///
/// # Errors
/// When a file is unusable, plans and logs do not pair, or the study exists already.
pub fn run(args: &Args, io: &Io) -> Result<Answer> {
    if args.plan.len() != args.log.len() {
        return Err(Failure::new(
            "new::pairs",
            format!("{} plans and {} logs do not pair", args.plan.len(), args.log.len()),
        )
        .help("give one --log for each --plan, in the same order"));
    }
    keep_existing(&args.out)?;
    let machine = args.machine.load(io)?;
    let mut catalogue = Catalogue::built_in()?;
    for file in &args.effects_file {
        io.report(&catalogue.add_file(&crate::diag::source(file.display().to_string(), files::read_text(file)?))?.0);
    }
    let effects =
        if args.effects.is_empty() { default_effects(&machine, args.known_blocks) } else { args.effects.clone() };
    crate::fit::effects_of(&effects, &catalogue, &machine)?;
    let folder = args.out.parent().map(Path::to_path_buf).unwrap_or_default();
    let mut data = Vec::new();
    for (i, (plan, log)) in args.plan.iter().zip(&args.log).enumerate() {
        let controller = pick(&args.controller, i, "--controller")?;
        let read = load_plan(plan, &machine, io)?;
        read_log(&files::read_bytes(log)?, log, &controller, &machine, &read, io)?;
        let controller =
            if controller.ends_with(".toml") { relative(Path::new(&controller), &folder) } else { controller };
        if let Some(active) = args.compensation.get(if args.compensation.len() == 1 { 0 } else { i }) {
            load_compensation(active, &machine)?;
        }
        let compensation = if args.compensation.is_empty() {
            None
        } else {
            Some(relative(&pick(&args.compensation, i, "--compensation")?, &folder))
        };
        data.push(DataEntry {
            plan: relative(plan, &folder),
            log: relative(log, &folder),
            controller,
            started_s: None,
            run: None,
            mounting: None,
            compensation,
        });
    }
    let study = Study {
        machines: args.machine.machines.as_ref().map(|m| relative(m, &folder)),
        machine: machine.name.clone(),
        effects_files: args.effects_file.iter().map(|f| relative(f, &folder)).collect(),
        data,
        effects: effects.clone(),
        knowledge: std::collections::BTreeMap::new(),
        touch_sigma_mm: None,
        visit_sigma_mm: None,
        type_b: std::collections::BTreeMap::new(),
        masked: Vec::new(),
        tolerance: crate::study::tolerance::Tolerance::default(),
    };
    let text = study.fresh()?;
    // another call may have written it meanwhile. Only beside it can be locked; that it cannot be made is said on writing
    let _ = std::fs::create_dir_all(&folder);
    let alone = files::lock(&args.out)?;
    keep_existing(&args.out)?;
    files::write_whole(&args.out, text.as_bytes())?;
    drop(alone);
    io.say(format!("{}: {} run(s), model: {}", args.out.display(), args.plan.len(), effects.join(", ")));
    io.say(format!("next: axiscal identify {}", args.out.display()));
    io.answer(&json!({ "study": args.out.display().to_string(), "runs": args.plan.len(), "effects": effects }));
    Ok(Answer::Done)
}

fn keep_existing(out: &Path) -> Result<()> {
    if !out.exists() {
        return Ok(());
    }
    Err(Failure::new("new::exists", format!("{} exists already", out.display()))
        .help("name another file with --out, or remove it first"))
}

/// What is on by default: the location errors of the machine's rotary axes, the blocks' set-up and the pre-travel.
#[must_use]
pub fn default_effects(machine: &Machine, known_blocks: bool) -> Vec<String> {
    let mut effects: Vec<String> =
        machine.rotary().map(|a| format!("location-{}", a.name.letter().to_ascii_lowercase())).collect();
    effects.sort();
    if !known_blocks {
        effects.push("block-setup".into());
    }
    effects.push("pretravel".into());
    effects
}

fn pick<T: Clone>(all: &[T], i: usize, option: &str) -> Result<T> {
    match all {
        [one] => Ok(one.clone()),
        several => several.get(i).cloned().ok_or_else(|| {
            Failure::new("new::count", format!("{option} is given {} times", several.len()))
                .help("give it once for all runs, or once per run")
        }),
    }
}

/// A path as the study's folder sees it; absolute where it is not below a common folder.
pub(super) fn relative(path: &Path, folder: &Path) -> String {
    let absolute = |p: &Path| std::path::absolute(p).unwrap_or_else(|_| p.to_path_buf());
    let (path_abs, folder_abs) =
        (absolute(path), absolute(if folder.as_os_str().is_empty() { Path::new(".") } else { folder }));
    let mut there = path_abs.components().peekable();
    let mut here = folder_abs.components().peekable();
    while there.peek().is_some() && there.peek() == here.peek() {
        there.next();
        here.next();
    }
    let mut out = PathBuf::new();
    for _ in here {
        out.push("..");
    }
    out.extend(there);
    out.display().to_string()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn paths_are_relative_to_the_study() {
        assert_eq!(relative(Path::new("a/b/head.log"), Path::new("a")), "b/head.log");
        assert_eq!(relative(Path::new("a/head.log"), Path::new("a/studies")), "../head.log");
        assert_eq!(relative(Path::new("head.log"), Path::new("")), "head.log");
    }
}
