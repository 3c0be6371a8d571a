//! `axiscal new`: writes a study from plans and logs.

use super::common::MachineArgs;
use super::{Answer, Io};
use crate::diag::{Failure, Result};
use crate::files;
use crate::workflow::load_plan;
use crate::workflow::new::{NewRun, NewStudy, default_effects};
use serde_json::json;
use std::path::{Path, PathBuf};

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
    let mut runs = Vec::new();
    for (i, (plan, log)) in args.plan.iter().zip(&args.log).enumerate() {
        let controller = pick(&args.controller, i, "--controller")?;
        let active =
            if args.compensation.is_empty() { None } else { Some(pick(&args.compensation, i, "--compensation")?) };
        runs.push(NewRun { plan: plan.clone(), log: log.clone(), controller, compensation: active });
    }
    let effects = if args.effects.is_empty() {
        let plans = args.plan.iter().map(|p| load_plan(p, &machine, io)).collect::<Result<Vec<_>>>()?;
        default_effects(&machine, &plans.iter().collect::<Vec<_>>(), args.known_blocks)
    } else {
        args.effects.clone()
    };
    let new = NewStudy {
        folder: args.out.parent().unwrap_or(Path::new("")),
        machines: args.machine.machines.as_deref(),
        effects: &effects,
        effects_files: &args.effects_file,
        runs: &runs,
    };
    let text = new.text(&machine, io)?;
    // another call may have written it meanwhile. Only beside it can be locked; that it cannot be made is said on writing
    let _ = std::fs::create_dir_all(new.folder);
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

fn pick<T: Clone>(all: &[T], i: usize, option: &str) -> Result<T> {
    match all {
        [one] => Ok(one.clone()),
        several => several.get(i).cloned().ok_or_else(|| {
            Failure::new("new::count", format!("{option} is given {} times", several.len()))
                .help("give it once for all runs, or once per run")
        }),
    }
}
