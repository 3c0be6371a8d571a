//! `axiscal new`: writes a study from plans and logs, from sphere centres, or from results on one's own part.

use super::centres::CentresArgs;
use super::common::MachineArgs;
use super::{Answer, Io};
use crate::diag::{Failure, Result};
use crate::files;
use crate::words::command::quoted_path;
use crate::workflow::load_plan;
use crate::workflow::new::{Beside, NewRun, NewStudy, default_effects};
use crate::workflow::overlay::Overlay;
use serde_json::json;
use std::path::{Path, PathBuf};

#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(flatten)]
    pub machine: MachineArgs,
    /// The plan of a run (repeat for several runs)
    #[arg(long, required_unless_present_any = ["centres", "points"])]
    pub plan: Vec<PathBuf>,
    /// The log of a run, in the order of the plans
    #[arg(long, required_unless_present_any = ["centres", "points"])]
    pub log: Vec<PathBuf>,
    /// The controller that wrote the logs: a name, a postprocessor file, or csv (once for all, or once per log)
    #[arg(long, default_value = "linuxcnc")]
    pub controller: Vec<String>,
    #[command(flatten)]
    pub centres: CentresArgs,
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
    let made = args.centres.convert(&machine, &args.out, &args.controller, io)?;
    let (plans, logs) = match &made {
        Some(made) => (made.paths(0), made.paths(1)),
        None => (args.plan.clone(), args.log.clone()),
    };
    let written = made.as_ref().map(|m| m.files.clone()).unwrap_or_default();
    written.iter().try_for_each(|(path, _)| keep_existing(path))?;
    let env = Overlay { beneath: io, files: &written };
    let mut runs = Vec::new();
    for (i, (plan, log)) in plans.iter().zip(&logs).enumerate() {
        let controller = if made.is_some() { "csv".to_owned() } else { pick(&args.controller, i, "--controller")? };
        let active =
            if args.compensation.is_empty() { None } else { Some(pick(&args.compensation, i, "--compensation")?) };
        runs.push(NewRun { plan: plan.clone(), log: log.clone(), controller, compensation: active });
    }
    let effects = if args.effects.is_empty() {
        let plans = plans.iter().map(|p| load_plan(p, &machine, &env)).collect::<Result<Vec<_>>>()?;
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
    let beside = made.as_ref().map_or_else(Beside::default, |m| m.beside.clone());
    let text = new.text_with(&beside, &machine, &env)?;
    // another call may have written it meanwhile. Only beside it can be locked; that it cannot be made is said on writing
    let _ = std::fs::create_dir_all(new.folder);
    let alone = files::lock(&args.out)?;
    keep_existing(&args.out)?;
    let mut all: Vec<(PathBuf, &[u8])> = vec![(args.out.clone(), text.as_bytes())];
    all.extend(written.iter().map(|(path, text)| (path.clone(), text.as_bytes())));
    files::write_together(&all)?;
    drop(alone);
    if let Some(made) = &made {
        made.says.iter().for_each(|line| io.say(line));
    }
    io.say(format!("{}: {} run(s), model: {}", args.out.display(), runs.len(), effects.join(", ")));
    io.say_as_it_is(format!("next: axiscal identify {}", quoted_path(&args.out)));
    let mut answer = json!({ "study": args.out.display().to_string(), "runs": runs.len(), "effects": effects });
    if let Some(made) = &made {
        answer["centres"] = made.record.clone();
        answer["written"] = json!(written.iter().map(|(path, _)| path.display().to_string()).collect::<Vec<_>>());
    }
    io.answer(&answer);
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
