//! `axiscal generate`: the NC program and its plan, written only when the whole path is proven clear.

use super::common::MachineArgs;
use super::{Answer, Io};
use crate::axes::AxisMap;
use crate::diag::{Failure, Finding, Result, source};
use crate::files;
use crate::machine::Machine;
use crate::machine::artefact::{self, WithArtefact};
use crate::model::catalogue::Catalogue;
use crate::post::Postprocessor;
use crate::program::find::{MOST_ASTRAY_MM, is_placement_tolerance};
use crate::program::path::{Step, Stop};
use crate::program::plan::{Plan, Proof};
use crate::program::{self, Generated, Options, ProgramSpec, SkippedGroup, pose_says};
use crate::report::fit::{number, table};
use crate::workflow::auto_program::{AutoProgram, auto_program};
use crate::workflow::generate::{ForControl, for_control, generate, load_program};
use crate::workflow::{Environment, load_controller, machines_file};
use comfy_table::Cell;
use serde_json::json;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(flatten)]
    machine: MachineArgs,
    /// Name of a program (`axiscal programs` lists them), a file of your own (FILE.toml), or `auto`: poses and touches are chosen
    #[arg(long, short)]
    program: String,
    /// What is mounted: a built-in artefact (`axiscal artefacts` lists them), or a file of your own: FILE.toml
    #[arg(long, value_name = "NAME|FILE")]
    artefact: Option<String>,
    /// With `--program auto`: one of the machine's own mountings, instead of --artefact
    #[arg(long, value_name = "NAME", conflicts_with = "artefact")]
    mounting: Option<String>,
    /// With `--program auto`: how long the program may take
    #[arg(long, value_name = "N", default_value_t = 20.0)]
    minutes: f64,
    /// Name of the controller (`axiscal controllers` lists them)
    #[arg(long, short, required_unless_present = "postprocessor")]
    controller: Option<String>,
    /// A postprocessor file of your own, instead of --controller
    #[arg(long, value_name = "FILE", conflicts_with = "controller")]
    postprocessor: Option<PathBuf>,
    /// Folder for the program and its plan, PROGRAM.plan.json
    #[arg(long, short, value_name = "DIR")]
    out: PathBuf,
    /// The same touches under the control's own transformation, to see a loaded compensation at work
    #[arg(long)]
    tcp: bool,
    /// Write it for a dry run: all moves are higher by so many mm, and nothing is measured
    #[arg(long, value_name = "MM")]
    dry_run_height: Option<f64>,
    /// Make each touch by the program's own routine, or by the control's measuring cycle
    #[arg(long, value_enum, default_value_t = TouchWith::Own)]
    touch_with: TouchWith,
    /// The artefact, one sphere, is put down by eye: how far off it may stand, mm; the first touches find it
    #[arg(long, value_name = "MM")]
    placement_tolerance: Option<f64>,
    /// Refuse the program when a single touch cannot be reached, instead of leaving it out
    #[arg(long)]
    strict: bool,
}

/// What makes a touch.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum TouchWith {
    /// The program's own routine
    Own,
    /// The control's measuring cycle
    Cycle,
}

/// # Errors
/// When machine, program or controller are unusable, or nothing can be reached; nothing is written then.
pub fn run(args: &Args, io: &Io) -> Result<Answer> {
    let mut machine = args.machine.load(io)?;
    let mounted = args.artefact.as_deref().map(|word| mount_artefact(word, &machine, args, io)).transpose()?;
    if let Some(mounted) = &mounted {
        machine = mounted.machine.clone();
    }
    let mut auto = (args.program == AUTO).then(|| choose_touches(&machine, mounted.as_ref(), args)).transpose()?;
    let mut spec = match &auto {
        Some(auto) => auto.spec.clone(),
        None => load_program(&args.program, &machine, io)?,
    };
    if let Some(mm) = args.placement_tolerance {
        spec.placement_tolerance_mm = Some(placement_tolerance(mm)?);
    }
    let word = match (&args.postprocessor, &args.controller) {
        // a path without a folder or an ending would read as the name of a controller
        (Some(file), _) => Path::new(".").join(file).display().to_string(),
        (None, Some(name)) => name.clone(),
        (None, None) => {
            return Err(Failure::new("cli::controller", "no controller is named").help("add --controller NAME"));
        }
    };
    let mut post = load_controller(&word, io)?;
    if args.touch_with == TouchWith::Cycle {
        post = post.with_cycle()?;
    }
    post.dry_run_mm = dry_run_mm(args.dry_run_height)?;
    let plan_file = args.out.join(format!("{}.plan.json", spec.name));
    keep_other_plans(&plan_file, &machine, &spec)?;
    if mounted.is_some() {
        keep_other_machines(&args.out.join(MACHINES))?;
    }
    let options = Options { strict: args.strict, tcp: args.tcp };
    // a choice is generated with the default options
    let made = auto.as_mut().and_then(|auto| auto.made.take()).filter(|_| options == Options::default());
    let written = match made {
        Some(made) => for_control(&machine, &spec, made, &post, &Summarised(io)),
        None => generate(&machine, &spec, &post, &options, &Summarised(io)),
    };
    let ForControl { mut generated, nc, proof, seconds } = written?;

    let mut files: Vec<(PathBuf, &str)> =
        nc.files(&spec.name).into_iter().map(|(name, text)| (args.out.join(name), text)).collect();
    files.extend(auto.as_ref().map(|auto| (args.out.join(format!("{AUTO}.toml")), auto.text.as_str())));
    files.extend(mounted.as_ref().map(|m| (args.out.join(MACHINES), m.text.as_str())));
    // the same touches for another control: what was proven of its program stays known
    if let Some(old) = old_programs(&plan_file, &generated.plan) {
        generated.plan.programs = old;
    }
    generated.plan.programs.extend(proof.map(|p| (post.name.clone(), p)));
    let plan_text = generated.plan.to_json();
    let programs = files.iter().map(|(file, text)| (file.clone(), text.as_bytes()));
    files::write_together(
        &std::iter::once((plan_file.clone(), plan_text.as_bytes())).chain(programs).collect::<Vec<_>>(),
    )?;
    let written: Vec<&PathBuf> = files.iter().map(|(file, _)| file).collect();
    summary(&machine, &post, &generated, seconds, (&written, &plan_file), io);
    for (file, beside) in written.iter().skip(1).zip(&nc.beside).filter(|(_, beside)| beside.to_control) {
        io.say(format!("{} goes to the control with the program: {}", file.display(), beside.says));
    }
    io.say("the head of the program says what to set up where");
    if let Some(better) = auto.as_ref().and_then(|a| a.better.as_ref()) {
        io.report(&[crate::words::generate::badly_placed(better)]);
    }
    if let Some(taken) = auto.as_ref().and_then(|a| a.taken.as_ref()) {
        io.say(crate::words::generate::built_in_taken(taken));
    }
    if auto.is_some() {
        io.say(format!(
            "{AUTO}.toml holds the chosen touches: to change them, edit a copy of it and use that with --program FILE"
        ));
    }
    if mounted.is_some() {
        let file = crate::words::command::quoted_path(&args.out.join(MACHINES));
        io.say(format!("the machine with its artefact: add --machines {file} to further calls"));
    }
    if post.dry_run_mm > 0.0 {
        io.say("it is written for a dry run: it measures nothing until its height in the head is 0");
    }
    Ok(Answer::Done)
}

/// The word for a program that is chosen.
const AUTO: &str = "auto";

/// The machine with its artefact, beside the program.
const MACHINES: &str = "machines.toml";

/// Mounts an artefact on the machine.
fn mount_artefact(word: &str, machine: &Machine, args: &Args, io: &Io) -> Result<WithArtefact> {
    let artefact =
        if word.ends_with(".toml") { io.source(Path::new(word))? } else { super::artefacts::built_in(word)? };
    let machines = machines_file(args.machine.machines.as_deref(), io)?;
    let (mounted, findings) = artefact::mount(&machines, machine, &artefact)?;
    io.report(&findings.0);
    Ok(mounted)
}

/// Chooses poses and touches for what is mounted.
fn choose_touches(machine: &Machine, mounted: Option<&WithArtefact>, args: &Args) -> Result<AutoProgram> {
    let name = mounted.map(|m| m.mounting.as_str()).or(args.mounting.as_deref());
    let has = || machine.mountings.iter().map(|m| m.name.as_str()).collect::<Vec<_>>().join(", ");
    let mounting = match name {
        Some(name) => machine.mounting(name),
        None => machine.mountings.first(),
    };
    let Some(mounting) = mounting else {
        let says = format!("{} has no mounting {:?}", machine.name, name.unwrap_or_default());
        return Err(Failure::new("program::unknown_mounting", says)
            .help(format!("name an artefact (--artefact sphere), or one of its mountings: {}", has())));
    };
    let by_eye_mm = args.placement_tolerance.map(placement_tolerance).transpose()?;
    auto_program(machine, &Catalogue::built_in()?, mounting, args.minutes, by_eye_mm)
}

/// How far off an artefact may stand that is put down by eye.
fn placement_tolerance(mm: f64) -> Result<f64> {
    if is_placement_tolerance(mm) {
        return Ok(mm);
    }
    let says = format!("--placement-tolerance {mm}: more than 0 mm, at most {MOST_ASTRAY_MM}");
    Err(Failure::new("cli::placement_tolerance", says).help("3 is what a careful eye leaves"))
}

/// A height at which the ball is over the blocks and not beyond every machine.
fn dry_run_mm(height: Option<f64>) -> Result<f64> {
    const MOST_MM: f64 = 1000.0;
    match height {
        None => Ok(0.0),
        Some(mm) if mm > 0.0 && mm <= MOST_MM => Ok(mm),
        Some(mm) => Err(Failure::new(
            "cli::dry_run_height",
            format!("--dry-run-height {mm}: more than 0 mm, at most {MOST_MM}"),
        )
        .help("50 is a good height")),
    }
}

/// The summary shows what was left out; with --json it goes to stderr, finding by finding.
struct Summarised<'a>(&'a Io);

impl Environment for Summarised<'_> {
    fn remark(&self, findings: &[Finding]) {
        let shown = |f: &&Finding| self.0.json || !matches!(f.code, "program::unreachable" | "program::lost");
        self.0.report(&findings.iter().filter(shown).cloned().collect::<Vec<_>>());
    }
}

/// What was proven of other programs for the same plan.
fn old_programs(file: &Path, plan: &Plan) -> Option<BTreeMap<String, Proof>> {
    let text = String::from_utf8(files::read_own(file).ok()?).ok()?;
    let (old, _) = Plan::parse(&source(file.display().to_string(), text)).ok()?;
    let same = Plan { programs: BTreeMap::new(), ..old.clone() }.to_json() == plan.to_json();
    same.then_some(old.programs)
}

/// Refuses to write over a machines file of the user's own.
fn keep_other_machines(file: &Path) -> Result<()> {
    if !file.exists() || artefact::is_our_own(&String::from_utf8_lossy(&files::read_own(file)?)) {
        return Ok(());
    }
    let says = format!("{} exists and is a file of yours: it is not written over", file.display());
    Err(Failure::new("cli::other_machines", says).help("name another folder with --out"))
}

/// Refuses to write over the plan of another machine or program, or over something that is no plan.
fn keep_other_plans(plan: &Path, machine: &Machine, spec: &ProgramSpec) -> Result<()> {
    if !plan.exists() {
        return Ok(());
    }
    let old: Option<serde_json::Value> = serde_json::from_slice(&files::read_own(plan)?).ok();
    let word = |key: &str| old.as_ref().and_then(|o| o.get(key)?.as_str());
    let what = match (word("machine"), word("program")) {
        (Some(m), Some(p)) if m == machine.name && p == spec.name => return Ok(()),
        (Some(m), Some(p)) => format!("the plan of program {p:?} for machine {m:?}"),
        _ => "no plan".to_owned(),
    };
    Err(Failure::new("cli::other_plan", format!("{} exists and is {what}: it is not written over", plan.display()))
        .help("name another folder with --out, or move the file away"))
}

/// Touches of one stage in one pose.
struct SetupCount {
    stage: String,
    pose: AxisMap,
    visit: Option<u32>,
    touches: usize,
}

/// Neighbouring touches of one stage, pose and visit, counted.
fn setups(generated: &Generated) -> Vec<SetupCount> {
    let mut out: Vec<SetupCount> = Vec::new();
    for t in &generated.plan.touches {
        match out.last_mut() {
            Some(last) if last.stage == t.stage && last.pose == t.pose && last.visit == t.visit => last.touches += 1,
            _ => out.push(SetupCount { stage: t.stage.to_string(), pose: t.pose, visit: t.visit, touches: 1 }),
        }
    }
    out
}

fn summary(
    machine: &Machine,
    post: &Postprocessor,
    generated: &Generated,
    seconds: f64,
    (files, plan_file): (&[&PathBuf], &PathBuf),
    io: &Io,
) {
    let (plan, path) = (&generated.plan, &generated.path);
    let setups = setups(generated);
    let skipped = program::skipped_groups(&plan.skipped);
    let mut t = table(&["stage", "pose (deg)", "touches"]);
    for s in &setups {
        t.add_row(vec![Cell::new(&s.stage), Cell::new(pose_says(&s.pose)), number(s.touches)]);
    }
    io.say(t.to_string());
    io.say(format!(
        "{} touches on {}, mounting {:?}, about {}{}",
        plan.touches.len(),
        machine.name,
        plan.mounting,
        program::duration(seconds),
        // `assess` and the head of the program, which is the same for every control, know the plan alone
        match program::duration(path.seconds) {
            planned if planned == program::duration(seconds) => String::new(),
            planned => format!(" with this control's own steps, {planned} as planned"),
        }
    ));
    let stops: Vec<&Stop> =
        path.steps.iter().filter_map(|s| if let Step::Stop(stop) = s { Some(stop) } else { None }).collect();
    if !stops.is_empty() {
        io.say("it stops for a person; the time counts 10 min for other blocks and 5 min for another stylus:");
        for (number, stop) in (1..).zip(&stops) {
            io.say(format!("  stop {number}: {}", stop.says.join("; ")));
        }
    }
    if !skipped.is_empty() {
        io.say(match plan.skipped.len() {
            1 => "\n1 touch was left out:".to_owned(),
            n => format!("\n{n} touches were left out:"),
        });
        let mut t = table(&["pose (deg)", "block", "face", "points", "why"]);
        for SkippedGroup { pose, block, face, points, reason, .. } in &skipped {
            t.add_row(vec![
                Cell::new(pose_says(pose)),
                Cell::new(block),
                Cell::new(face),
                number(points),
                Cell::new(reason),
            ]);
        }
        io.say(t.to_string());
        for note in &plan.notes {
            io.say(format!("  {note}"));
        }
    }
    let beside = files.get(1..).unwrap_or_default();
    let all = files.iter().take(1).chain([&plan_file]).chain(beside);
    let lines: Vec<String> = all.map(|file| file.display().to_string()).collect();
    io.say(format!("\nwritten: {}", lines.join("\n         ")));
    io.answer(&json!({
        "format": "axiscal-generated/1",
        "machine": machine.name,
        "program": plan.program,
        "controller": post.name,
        "unverified": post.unverified.iter().map(|(entry, why)| json!({ "entry": entry, "why": why })).collect::<Vec<_>>(),
        "mounting": plan.mounting,
        "controller_frame": plan.controller_frame,
        "touches": plan.touches.len(),
        "time_s": seconds,
        "stops": stops.iter().map(|s| json!({
            "says": s.says, "mounting": s.mounting, "tool_length_mm": s.tool_length_mm, "ball_radius_mm": s.ball_radius_mm,
        })).collect::<Vec<_>>(),
        "setups": setups.iter().map(|s| json!({
            "stage": s.stage, "pose": s.pose, "visit": s.visit, "touches": s.touches,
        })).collect::<Vec<_>>(),
        "skipped": skipped.iter().map(|s| json!({
            "stage": s.stage, "pose": s.pose, "block": s.block, "face": s.face, "points": s.points, "reason": s.reason,
        })).collect::<Vec<_>>(),
        "notes": plan.notes,
        "files": { "program": files.first(), "plan": plan_file, "beside": beside },
    }));
}
