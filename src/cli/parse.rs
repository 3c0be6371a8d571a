//! `axiscal parse`: a controller's log → the touches CSV.

use super::common::finding_record;
use super::{Answer, Io};
use crate::axes::AxisName;
use crate::diag::Result;
use crate::files;
use crate::log::{self, Ending, MatchedLog, RunFound, Status, Touch};
use crate::machine::Machine;
use crate::program::plan::Plan;
use crate::workflow::load_plan_and_machine;
use comfy_table::CellAlignment;
use serde::Serialize;
use std::path::PathBuf;

#[derive(Debug, clap::Args)]
pub struct Args {
    /// The log that the probing program wrote
    pub log: PathBuf,
    /// Controller that wrote it: a name (`axiscal controllers` lists them), a FILE.toml of your own, `msr` (inspection results), or `csv`
    #[arg(long, short, value_name = "NAME|FILE")]
    pub controller: String,
    /// The plan that `generate` wrote together with the program
    #[arg(long, value_name = "FILE")]
    pub plan: PathBuf,
    /// A machines.toml of your own (default: the one built in)
    #[arg(long, value_name = "FILE")]
    pub machines: Option<PathBuf>,
    /// Which run, where the log has several (default: the last complete one)
    #[arg(long, value_name = "N")]
    pub run: Option<usize>,
    /// Where to write the touches (CSV)
    #[arg(long, value_name = "FILE")]
    pub out: Option<PathBuf>,
}

/// The answer as JSON.
#[derive(Serialize)]
struct Parsed<'a> {
    format: &'static str,
    machine: &'a str,
    program: &'a str,
    /// Every planned touch is read, and the log is not cut off.
    complete: bool,
    end: String,
    runs: usize,
    run: Option<usize>,
    run_list: Vec<serde_json::Value>,
    planned: usize,
    hits: usize,
    misses: usize,
    /// Touches far from their places: they are among those that are missing, too.
    elsewhere: usize,
    missing: Vec<u64>,
    touches: Vec<serde_json::Value>,
    /// What was noticed while reading.
    findings: Vec<serde_json::Value>,
}

/// # Errors
/// When the plan, the machine or the log is unusable.
pub fn run(args: &Args, io: &Io) -> Result<Answer> {
    let machines = args.machines.as_deref();
    let (plan, machine) = load_plan_and_machine(&args.plan, machines, io)?;
    let (reader, findings) = log::Reader::load(&args.controller, files::read_text)?;
    io.report(&findings);
    let bytes = files::read_bytes(&args.log)?;
    let (read, findings) =
        log::read_run(&bytes, &args.log.display().to_string(), reader.writer(), &machine, &plan, args.run)?;
    io.report(&findings.0);
    if let Some(out) = &args.out {
        files::write_whole(out, log::csv::write(&machine, &read.touches).as_bytes())?;
    }
    io.say(summary(&plan, &read));
    if let Some(out) = &args.out {
        io.say(format!("touches written to {}", out.display()));
    }
    let findings = findings.0.iter().map(finding_record).collect();
    io.answer(&Parsed { findings, ..answer(&machine, &plan, &read) });
    Ok(Answer::Done)
}

/// A run as it is offered.
fn run_record(run: &RunFound) -> serde_json::Value {
    let RunFound { number, first_line, last_line, touches, complete, taken } = *run;
    serde_json::json!({
        "run": number, "first_line": first_line, "last_line": last_line, "touches": touches, "complete": complete,
        "taken": taken,
    })
}

fn answer<'a>(machine: &Machine, plan: &'a Plan, read: &MatchedLog) -> Parsed<'a> {
    let usable = || read.touches.iter().filter(|t| t.status != Status::Elsewhere);
    let touches = usable().map(|t| {
        let mut object = serde_json::Map::new();
        object.insert("id".into(), t.id.into());
        for axis in AxisName::ALL.into_iter().filter(|a| machine.axis(*a).is_some()) {
            object.insert(axis.to_string(), (t.position.get(axis) + 0.0).into());
        }
        let status = if t.status == Status::Hit { "hit" } else { "miss" };
        object.insert("status".into(), status.into());
        t.time_s.into_iter().for_each(|v| drop(object.insert("time_s".into(), v.into())));
        t.temperature_deg_c.into_iter().for_each(|v| drop(object.insert("temperature_degC".into(), v.into())));
        object.insert("line".into(), t.line.into());
        serde_json::Value::Object(object)
    });
    let have: std::collections::BTreeSet<u64> = usable().map(|t| t.id).collect();
    let count = |status: Status| read.touches.iter().filter(|t| t.status == status).count();
    Parsed {
        format: "axiscal-parse/1",
        machine: &plan.machine,
        program: &plan.program,
        complete: read.complete,
        end: end_says(read),
        runs: read.runs.len().max(1),
        run: read.runs.iter().find(|r| r.taken).map(|r| r.number),
        run_list: read.runs.iter().map(run_record).collect(),
        planned: plan.touches.len(),
        hits: count(Status::Hit),
        misses: count(Status::Miss),
        elsewhere: count(Status::Elsewhere),
        missing: plan.touches.iter().map(|t| t.id).filter(|id| !have.contains(id)).collect(),
        touches: touches.collect(),
        findings: Vec::new(),
    }
}

/// A stage and block of the summary.
struct Row<'a> {
    stage: &'a str,
    block: &'a str,
    /// Of each planned touch.
    touches: Vec<Option<&'a Touch>>,
    /// Of each hit: how far past the nominal contact, mm.
    offs: Vec<f64>,
}

/// One row per stage and block: what was planned, what was touched, how far off the nominal contact.
fn summary(plan: &Plan, read: &MatchedLog) -> String {
    let mut table =
        crate::report::fit::table(&["stage", "block", "planned", "hit", "missed", "not read", "off nominal, mm"]);
    let mut rows: Vec<Row> = Vec::new();
    let by_id: std::collections::BTreeMap<u64, &Touch> = read.touches.iter().map(|t| (t.id, t)).collect();
    for planned in &plan.touches {
        let touch = by_id.get(&planned.id).copied();
        let index =
            rows.iter().position(|r| r.stage == planned.stage && r.block == planned.block).unwrap_or_else(|| {
                rows.push(Row { stage: &planned.stage, block: &planned.block, touches: Vec::new(), offs: Vec::new() });
                rows.len() - 1
            });
        rows[index].touches.push(touch);
        if let Some(hit) = touch.filter(|t| t.status == Status::Hit) {
            let off = hit.position.xyz_mm() - planned.nominal_position().xyz_mm();
            let way = planned.end_position().xyz_mm() - planned.start_position().xyz_mm();
            let length = way.norm();
            rows[index].offs.push(if length > 0.0 { off.dot(&way) / length } else { off.norm() });
        }
    }
    for Row { stage, block, touches, offs } in rows {
        let count = |status| touches.iter().flatten().filter(|t| t.status == status).count();
        // to the printed digits, so that nothing reads -0.000
        let offs: Vec<f64> = offs.iter().map(|v| (v * 1e3).round() / 1e3 + 0.0).collect();
        let low = offs.iter().copied().fold(f64::INFINITY, f64::min);
        let high = offs.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let range = if offs.is_empty() { String::new() } else { format!("{low:+.3} .. {high:+.3}") };
        let absent = touches.iter().filter(|t| t.is_none_or(|t| t.status == Status::Elsewhere)).count();
        table.add_row([
            stage.to_owned(),
            block.to_owned(),
            touches.len().to_string(),
            count(Status::Hit).to_string(),
            count(Status::Miss).to_string(),
            absent.to_string(),
            range,
        ]);
    }
    for index in 2..=6 {
        if let Some(column) = table.column_mut(index) {
            column.set_cell_alignment(CellAlignment::Right);
        }
    }
    let found = plan.find.as_ref().and(read.found_mm).map_or_else(String::new, |off| {
        format!("\nthe artefact was found off its position by X {:+.3} Y {:+.3} Z {:+.3} mm", off.x, off.y, off.z)
    });
    let done = read.touches.iter().filter(|t| t.status != Status::Elsewhere).count();
    let planned = plan.touches.len();
    let lacks =
        if done < planned { format!(" ({} NOT READ: the warnings say why)", planned - done) } else { String::new() };
    format!(
        "{table}\nprogram {} on {}: {done} of {planned} planned touches read{lacks}; {}{found}",
        plan.program,
        plan.machine,
        end_says(read)
    )
}

/// How the log ends: whether touches are lacking is another question.
fn end_says(read: &MatchedLog) -> String {
    match read.ending {
        Ending::Line => "the log has its end line".to_owned(),
        Ending::Later(setup) => format!("the log has its end line, but BEGINS AT SET-UP {setup}"),
        Ending::CutOff => "THE LOG IS CUT OFF BEFORE ITS END, or the program was stopped".to_owned(),
        Ending::Unmarked => "a log of this form has no end line".to_owned(),
    }
}
