//! `axiscal simulate`: the virtual machine writes the log that the controller would have written.

use super::common::MachineArgs;
use super::{Answer, Io};
use crate::diag::{Failure, Finding, Findings, Result, source};
use crate::files;
use crate::log::{RawTouch, Status};
use crate::machine::Machine;
use crate::simulate::{self, Compensation, Scenario};
use crate::workflow::simulated_log::log_of_program;
use crate::workflow::{load_controller, load_plan};
use indicatif::{ProgressBar, ProgressStyle};
use serde_json::json;
use std::path::{Path, PathBuf};

#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(flatten)]
    pub machine: MachineArgs,
    /// The plan of what is to be touched
    #[arg(long)]
    pub plan: PathBuf,
    /// What is wrong with the machine (default: nothing)
    #[arg(long, value_name = "FILE")]
    pub scenario: Option<PathBuf>,
    /// Whose log to write: a controller's name, a postprocessor file, or csv
    #[arg(long, short, default_value = "linuxcnc")]
    pub controller: String,
    /// The compensation that the control applies: what `export` wrote
    #[arg(long, value_name = "DIR")]
    pub compensation: Option<PathBuf>,
    /// Where to write the log
    #[arg(long, value_name = "LOG")]
    pub out: PathBuf,
    /// Write over LOG when it exists
    #[arg(long)]
    pub force: bool,
}

/// A plan of fewer touches is done before a person sees a bar.
const LONG: usize = 50_000;

/// # Errors
/// When an input is unusable or does not fit the machine.
pub fn run(args: &Args, io: &Io) -> Result<Answer> {
    let machine = args.machine.load(io)?;
    let plan = load_plan(&args.plan, &machine, io)?;
    let scenario = match &args.scenario {
        None => Scenario::flawless(),
        Some(path) => {
            let text = source(path.display().to_string(), files::read_text(path)?);
            let folder = path.parent().unwrap_or(Path::new(""));
            let open = |name: &str| {
                let file = folder.join(name);
                Ok(source(file.display().to_string(), files::read_text(&file)?))
            };
            reported(simulate::scenario::parse_with(&text, &machine, &open)?, io)
        }
    };
    let compensation = match &args.compensation {
        None => None,
        Some(path) => Some(reported(load_compensation(path, &machine)?, io)),
    };
    // an unknown controller is said before the work, not after
    let post = match args.controller.as_str() {
        "csv" => None,
        word => Some(load_controller(word, io)?),
    };
    keep_existing(args)?;
    let bar = progress(plan.touches.len(), io);
    let made = simulate::run_program(&machine, &plan, &scenario, compensation.as_ref(), &|done| {
        bar.inc(done as u64);
    });
    bar.finish_and_clear();
    let simulate::Made { touches, found_mm } = reported(made?, io);
    let text = log_of_program(&machine, &plan, &touches, found_mm, post.as_ref());
    files::write_whole(&args.out, text.as_bytes())?;
    if post.is_some() && touches.iter().any(|t| t.temperature_deg_c.is_some()) {
        io.report(&[Finding::info(
            "simulate::temperature",
            format!("the log of {} carries no temperature: what goes with the temperature of the scenario looks as if it went with time", args.controller),
        )
        .help("--controller csv writes the temperature of each touch beside it")]);
    }
    let n_hits = touches.iter().filter(|t| t.status == Status::Hit).count();
    let n_misses = touches.len() - n_hits;
    io.say(format!("{}: {n_hits} touches, {n_misses} misses", args.out.display()));
    io.answer(&json!({
        "format": "axiscal-simulation/1",
        "machine": machine.name,
        "program": plan.program,
        "log": args.out.display().to_string(),
        "controller": args.controller,
        "seed": scenario.seed,
        "touches": touches.len(),
        "misses": n_misses,
        "missed": missed(&touches),
        "compensated": compensation.is_some(),
        "planted": scenario.planted,
    }));
    Ok(Answer::Done)
}

/// A log of a real machine cannot be made again: what exists is written over only when that is asked for, inputs never. Asked
/// when all inputs are read, and before the work.
fn keep_existing(args: &Args) -> Result<()> {
    files::check_outputs(&[&args.out])?;
    if args.out.exists() && !args.force {
        return Err(Failure::new("cli::exists", format!("{} exists: it is not written over", args.out.display()))
            .help("name a new file with --out, or add --force if it may be lost"));
    }
    Ok(())
}

fn reported<T>((value, findings): (T, Findings), io: &Io) -> T {
    io.report(&findings.0);
    value
}

/// A directory that `export` wrote, or the file in it.
fn load_compensation(path: &Path, machine: &Machine) -> Result<(Compensation, Findings)> {
    let file = if path.is_dir() { path.join("compensation.json") } else { path.to_path_buf() };
    let text = source(file.display().to_string(), files::read_text(&file)?);
    // one check of the file, whoever reads it
    let record = crate::tables::compensation::Compensation::read(&text)?;
    let said = record.check_belongs(machine, &record.controller)?;
    let folder = file.parent().map(Path::to_path_buf).unwrap_or_default();
    let (loaded, mut findings) = Compensation::parse_with(&text, machine, &|name| {
        let beside = folder.join(name);
        Ok(source(beside.display().to_string(), files::read_text(&beside)?))
    })?;
    findings.0.extend(said.0);
    Ok((loaded, findings))
}

fn missed(touches: &[RawTouch]) -> Vec<u64> {
    touches.iter().filter(|t| t.status == Status::Miss).filter_map(|t| t.id).collect()
}

fn progress(n_touches: usize, io: &Io) -> ProgressBar {
    if io.json || n_touches < LONG {
        return ProgressBar::hidden();
    }
    let bar = ProgressBar::new(n_touches as u64);
    match ProgressStyle::with_template("{bar:40} {pos}/{len} touches, {eta} left") {
        Ok(style) => bar.with_style(style),
        Err(_) => bar,
    }
}
