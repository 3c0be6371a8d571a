//! `axiscal check`: an NC program read back, run on the virtual machine, and judged.

use super::common::{MachineArgs, finding_record};
use super::{Answer, Io};
use crate::check::{self, Against, Checked};
use crate::diag::{Finding, Result, Severity, Source, source};
use crate::files;
use crate::machine::Machine;
use crate::post::{DialectName, Postprocessor};
use crate::program;
use crate::program::plan::Plan;
use crate::workflow::{load_controller, load_plan};
use serde_json::json;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

#[derive(Debug, clap::Args)]
pub struct Args {
    /// The NC program
    file: PathBuf,
    #[command(flatten)]
    machine: MachineArgs,
    /// Whose program it is: a controller's name, or a postprocessor file
    #[arg(long, short)]
    controller: String,
    /// The plan that `generate` wrote with it: the touches are compared with it
    #[arg(long)]
    plan: Option<PathBuf>,
    /// Without a plan: what is mounted (default: the mounting on which most touches are made)
    #[arg(long, value_name = "NAME", conflicts_with = "plan")]
    mounting: Option<String>,
    /// The program is meant to begin at this set-up
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..))]
    from: u32,
}

/// # Errors
/// When an input is unusable, or the program holds something that axiscal does not know.
pub fn run(args: &Args, io: &Io) -> Result<Answer> {
    let machine = args.machine.load(io)?;
    let post = load_controller(&args.controller, io)?;
    let plan = args.plan.as_ref().map(|file| load_plan(file, &machine, io)).transpose()?;
    let text = source(args.file.display().to_string(), files::read_text_as_it_is(&args.file)?);
    let beside = beside(&check::wanted_beside(&post, &text), &args.file)?;
    let against = Against {
        plan: plan.as_ref(),
        mounting: args.mounting.as_deref(),
        from: args.from,
        beside: &beside,
        ..Against::default()
    };
    let mut checked = check::check(&machine, &post, &text, &against)?;
    checked.findings.extend(plan.as_ref().and_then(|plan| lacks_program(plan, &post)));
    checked.findings.extend(other_name(&post, &args.file, &text));
    io.report(&checked.findings);
    say_codes(&checked, io);
    say(&machine, args, &checked, io);
    answer(&machine, &post, args, &checked, io);
    Ok(if good(&checked) { Answer::Done } else { Answer::No })
}

/// The plan does not say what the program of this controller does: an edit that is safe is not found.
fn lacks_program(plan: &Plan, post: &Postprocessor) -> Option<Finding> {
    let (says, help) = match plan.programs.is_empty() {
        _ if plan.programs.contains_key(&post.name) => return None,
        true => (
            "the plan is of an older version and does not hold what its program does: whether this is still the program that was written is not known".to_owned(),
            "`axiscal generate` writes plan and program anew",
        ),
        false => (
            format!(
                "the plan does not hold the program of {}, but of {}: whether this is still the program that was written is not known",
                post.name,
                plan.programs.keys().cloned().collect::<Vec<_>>().join(", ")
            ),
            "is it the plan beside the program, and the controller for which it was written?",
        ),
    };
    Some(Finding::warning("check::older_plan", says).help(help))
}

/// A HEIDENHAIN program that calls itself otherwise than its file.
fn other_name(post: &Postprocessor, file: &Path, text: &Source) -> Option<Finding> {
    const BEGIN: &str = "BEGIN PGM ";
    post.check.as_ref().filter(|rule| rule.dialect == DialectName::Klartext)?;
    let at = text.inner().find(BEGIN)? + BEGIN.len();
    let name = text.inner().get(at..)?.split_whitespace().next()?;
    let wanted = post.nc_name(&file.file_stem()?.to_string_lossy());
    (name != wanted).then(|| {
        let says = format!("the file is called {wanted}, BEGIN PGM says {name}: a control may refuse it");
        Finding::warning("check::name", says)
            .help("one name for the file, in BEGIN PGM and in END PGM")
            .at(text, at..at + name.len())
    })
}

/// The findings by their codes, as the guide lists them.
fn say_codes(checked: &Checked, io: &Io) {
    let mut counts: BTreeMap<&str, usize> = BTreeMap::new();
    checked.findings.iter().for_each(|f| *counts.entry(f.code).or_default() += 1);
    let shown: Vec<String> = counts.iter().map(|(code, n)| format!("{code} ({n})")).collect();
    if !shown.is_empty() {
        io.say(format!("what was found, by its code in docs/guide/check.md: {}", shown.join(", ")));
    }
}

/// Files that lie in the folder of the program; which of them are lacking the check says.
fn beside(names: &[String], program: &Path) -> Result<Vec<(String, Source)>> {
    let folder = program.parent().unwrap_or_else(|| Path::new(""));
    let there = names.iter().map(|name| (name, folder.join(name))).filter(|(_, path)| path.is_file());
    there
        .map(|(name, path)| Ok((name.clone(), source(path.display().to_string(), files::read_text_as_it_is(&path)?))))
        .collect()
}

fn good(checked: &Checked) -> bool {
    !checked.findings.iter().any(|f| f.severity == Severity::Error)
}

fn say(machine: &Machine, args: &Args, checked: &Checked, io: &Io) {
    if !checked.ran {
        io.say(format!("{} was read and not run: it depends on what axiscal does not know", args.file.display()));
        io.say(refused(&checked.findings));
        return;
    }
    let stops = match checked.stops {
        0 => String::new(),
        1 => ", 1 stop".to_owned(),
        n => format!(", {n} stops"),
    };
    io.say(format!(
        "{} on {}, mounting {}: {} touches, {} moves, {} set-ups{stops}, about {} without the stops",
        args.file.display(),
        machine.name,
        checked.mountings.join(", then "),
        checked.touches,
        checked.moves,
        checked.setups,
        program::duration(checked.seconds)
    ));
    io.say(format!("{} ways on which something goes wrong were followed", checked.branches));
    if checked.both_ways > 0 {
        let runs = checked.both_ways;
        io.say(format!(
            "{runs} more runs: conditions on a clock or a stored value of the control, taken the other way"
        ));
    }
    if !checked.declined.is_empty() {
        let numbers: Vec<String> = checked.declined.iter().map(u32::to_string).collect();
        io.say(format!(
            "it cannot start again at set-up {}: the way there is not known, it says so and stops",
            numbers.join(", ")
        ));
    }
    if args.plan.is_none() {
        io.say("without --plan: whether it makes the touches that were planned was not looked at");
    }
    io.say(if good(checked) { "nothing is wrong with it".to_owned() } else { refused(&checked.findings) });
}

fn refused(findings: &[Finding]) -> String {
    let errors = findings.iter().filter(|f| f.severity == Severity::Error).count();
    format!("do not run it: {errors} finding{} above", if errors == 1 { "" } else { "s" })
}

fn answer(machine: &Machine, post: &Postprocessor, args: &Args, checked: &Checked, io: &Io) {
    let findings: Vec<serde_json::Value> = checked.findings.iter().map(finding_record).collect();
    io.answer(&json!({
        "format": "axiscal-check/1",
        "file": args.file.display().to_string(),
        "machine": machine.name,
        "controller": post.name,
        "mountings": checked.mountings,
        "compared_with_plan": args.plan.is_some(),
        "good": good(checked),
        "touches": checked.touches,
        "moves": checked.moves,
        "setups": checked.setups,
        "no_restart_at": checked.declined,
        "stops": checked.stops,
        "followed": checked.branches,
        "both_ways": checked.both_ways,
        "time_s": checked.seconds,
        "moves_sha256": checked.proof.sha256,
        "findings": findings,
    }));
}
