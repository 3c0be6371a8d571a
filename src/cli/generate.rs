//! `axiscal generate`: the NC program and its plan, written only when the whole path is proven clear.

use super::common::MachineArgs;
use super::new::default_effects;
use super::{Answer, Io};
use crate::axes::AxisMap;
use crate::check::{self, Against};
use crate::diag::{Failure, Finding, Result, Severity, source};
use crate::files;
use crate::fit;
use crate::log::{Status, Touch};
use crate::machine::Machine;
use crate::model::catalogue::Catalogue;
use crate::model::data::{Run, assemble};
use crate::post::{DialectName, NcProgram, Postprocessor};
use crate::program::path::{Step, Stop};
use crate::program::plan::{Plan, Proof};
use crate::program::{self, Generated, Options, ProgramSpec, SkippedGroup, pose_says};
use crate::report::fit::{number, table};
use crate::tables::linuxcnc;
use comfy_table::Cell;
use serde_json::json;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Arguments of `generate`.
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(flatten)]
    machine: MachineArgs,
    /// Name of a program (`axiscal programs` lists them), or a file of your own: FILE.toml
    #[arg(long, short)]
    program: String,
    /// Name of the controller (`axiscal controllers` lists them)
    #[arg(long, short, required_unless_present = "postprocessor")]
    controller: Option<String>,
    /// A postprocessor file of your own, instead of --controller
    #[arg(long, value_name = "FILE", conflicts_with = "controller")]
    postprocessor: Option<PathBuf>,
    /// Folder for the two files, PROGRAM.<ext> and PROGRAM.plan.json
    #[arg(long, short, value_name = "DIR")]
    out: PathBuf,
    /// The same touches under the control's own transformation, to see a loaded compensation at work
    #[arg(long)]
    tcp: bool,
    /// Refuse the program when a single touch cannot be reached, instead of leaving it out
    #[arg(long)]
    strict: bool,
}

/// Runs `generate`.
///
/// # Errors
/// When machine, program or controller are unusable, or nothing can be reached; nothing is written then.
pub fn run(args: &Args, io: &Io) -> Result<Answer> {
    let machine = args.machine.load(io)?;
    let spec = load_program(&args.program, &machine, io)?;
    let word = match (&args.postprocessor, &args.controller) {
        // a path without a folder or an ending would read as the name of a controller
        (Some(file), _) => Path::new(".").join(file).display().to_string(),
        (None, Some(name)) => name.clone(),
        (None, None) => {
            return Err(Failure::new("cli::controller", "no controller is named").help("add --controller NAME"));
        }
    };
    let (post, findings) = Postprocessor::load_built_in_or_file(&word)?;
    io.report(&findings);
    let plan_file = args.out.join(format!("{}.plan.json", spec.name));
    keep_other_plans(&plan_file, &machine, &spec)?;
    if args.tcp
        && post.check.as_ref().is_some_and(|rule| rule.dialect == DialectName::Ngc)
        && !post.releases.is_empty()
        && let Err(why) = linuxcnc::stock::module_of(&machine, post.release(None)?)
    {
        return Err(Failure::new("generate::no_transformation", format!("{} cannot run under a transformation of LinuxCNC's own: {why}", machine.name))
            .help("generate without --tcp: under the kinematics component that `export` writes, coordinates stay axis positions. Is it another version of LinuxCNC, name it under [settings] of a postprocessor file of your own"));
    }
    let options = Options { strict: args.strict, tcp: args.tcp };
    let (mut generated, findings) = program::generate(&machine, &spec, &options)?;
    if !generated.plan.skipped.is_empty() {
        let lost = lost_parameters(&machine, &spec, &generated.plan)?;
        if !lost.is_empty() {
            let note = format!("without the omitted touches these cannot be determined: {}", lost.join(", "));
            generated.path.head.push(format!("  {note}"));
            generated.plan.notes.push(note);
        }
    }
    let nc = post.program(&machine, &generated.plan, &generated.path)?;
    // the summary shows what was left out; with --json it goes to stderr, finding by finding
    let shown = |f: &&Finding| io.json || !matches!(f.code, "program::unreachable" | "program::lost");
    io.report(&findings.0.iter().chain(&nc.findings.0).filter(shown).cloned().collect::<Vec<_>>());

    let files: Vec<(PathBuf, &str)> =
        nc.files(&spec.name).into_iter().map(|(name, text)| (args.out.join(name), text)).collect();
    let name = format!("{}.{}", spec.name, nc.extension);
    let proven = prove(&machine, &post, &generated.plan, &name, &nc, io)?;
    // the figure of `check`, move by move as this control makes them, and what a person needs at the stops
    let seconds = proven.as_ref().map_or(generated.path.seconds, |(_, s)| s + generated.path.waiting);
    // the same touches for another control: what was proven of its program stays known
    if let Some(old) = old_programs(&plan_file, &generated.plan) {
        generated.plan.programs = old;
    }
    generated.plan.programs.extend(proven.map(|(p, _)| (post.name.clone(), p)));
    let plan_text = generated.plan.to_json();
    let programs = files.iter().map(|(file, text)| (file.clone(), text.as_bytes()));
    files::write_together(
        &std::iter::once((plan_file.clone(), plan_text.as_bytes())).chain(programs).collect::<Vec<_>>(),
    )?;
    let written: Vec<&PathBuf> = files.iter().map(|(file, _)| file).collect();
    summary(&machine, &post, &generated, seconds, (&written, &plan_file), io);
    Ok(Answer::Done)
}

/// Reads the program back and proves it: what cannot be proven is not written. What it does, and its run time without the
/// stops, s.
///
/// # Errors
/// When the program holds anything that `check` refuses.
pub(super) fn prove(
    machine: &Machine,
    post: &Postprocessor,
    plan: &Plan,
    name: &str,
    nc: &NcProgram,
    io: &Io,
) -> Result<Option<(Proof, f64)>> {
    if post.check.is_none() {
        let what = format!(
            "controller {} does not say how its programs are read back: the program was not checked",
            post.name
        );
        io.report(&[Finding::warning("check::no_dialect", what)
            .help("write [check] in the postprocessor file: docs/guide/check.md")]);
        return Ok(None);
    }
    let beside = nc.sources();
    let against = Against { plan: Some(plan), beside: &beside, ..Against::default() };
    let text = source(format!("{name} (not written)"), nc.text.as_str());
    let checked = check::check(machine, post, &text, &against)?;
    if checked.findings.iter().any(|f| f.severity == Severity::Error) {
        let mut findings = checked.findings;
        findings.push(
            Finding::error("check::refused", format!("{name} cannot be proven safe: no file was written"))
                .help("the findings above say where: look there in the templates of a postprocessor file of your own; with a built-in controller it is a fault of axiscal: report it with machines.toml, program and controller"),
        );
        return Err(Failure(findings));
    }
    Ok(Some((checked.proof, checked.seconds)))
}

/// What was proven of other programs for the same plan.
fn old_programs(file: &Path, plan: &Plan) -> Option<BTreeMap<String, Proof>> {
    let text = String::from_utf8(files::read_own(file).ok()?).ok()?;
    let (old, _) = Plan::parse(&source(file.display().to_string(), text)).ok()?;
    let same = Plan { programs: BTreeMap::new(), ..old.clone() }.to_json() == plan.to_json();
    same.then_some(old.programs)
}

/// Location errors that the whole program could tell, with blocks of unknown set-up, and the touches that are left cannot.
fn lost_parameters(machine: &Machine, spec: &ProgramSpec, plan: &Plan) -> Result<Vec<String>> {
    let catalogue = Catalogue::built_in()?;
    let effects = default_effects(machine, false);
    let unseen = |plan: &Plan| -> Result<Vec<String>> {
        let touches: Vec<Touch> = plan
            .touches
            .iter()
            .map(|t| Touch {
                id: t.id,
                position: t.nominal_position(),
                status: Status::Hit,
                time_s: None,
                digit_mm: None,
                temperature_deg_c: None,
                line: 0,
            })
            .collect();
        let data = assemble(machine, &[Run { plan, touches: &touches, mounting: None, started_s: None }]);
        let (model, seen) = fit::observe_plan(machine, &catalogue, &data, &effects)?;
        let blind = |i: usize| seen.unseen.iter().any(|v| v[i].abs() > 1e-6);
        Ok((0..model.n_unknowns()).filter(|i| blind(*i)).map(|i| model.unknowns[i].name.clone()).collect())
    };
    let before = unseen(&program::plan_without_path(machine, spec)?)?;
    let after = unseen(plan)?;
    Ok(after.into_iter().filter(|name| !before.contains(name) && !name.contains('@')).collect())
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

/// A program by name, or from a file of the user's own when the word ends in `.toml` or holds a `/`.
///
/// # Errors
/// When there is none of that name for this machine, or the file is unusable.
pub(super) fn load_program(word: &str, machine: &Machine, io: &Io) -> Result<ProgramSpec> {
    if !is_file(word) {
        return program::choose(program::built_in()?, word, machine);
    }
    let (spec, findings) = program::load(&source(word, files::read_text(Path::new(word))?))?;
    io.report(&findings.0);
    Ok(spec)
}

/// Whether a word means a file rather than a name.
pub(super) fn is_file(word: &str) -> bool {
    word.ends_with(".toml") || word.contains(['/', '\\'])
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
    for (file, says) in beside.iter().zip(&post.companions) {
        io.say(format!("{} goes to the control with the program: {says}", file.display()));
    }
    io.say("the head of the program says what to set up where");
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
