//! A controller's log → [`RawTouch`] records with their line numbers → touches matched to the plan.
//!
//! `parse` reads the bytes, driven by the postprocessor's file; [`to_axes`] makes axis positions of a control's own
//! coordinates; [`match_to_plan`] finds the touch of the plan that each one is; [`read`] does all three, [`csv`] reads
//! and writes the project's own form. Nothing is silently left out: what is not used is a finding with its place.

pub mod centres;
mod clock;
pub mod csv;
mod finding_places;
mod found;
mod last_digit;
mod matching;
mod numbers;
mod origin_shift;
mod parse;
pub mod points;
mod position_rows;
mod read_lines;
mod reader;
mod record;
mod runs;
mod setup_mistakes;
mod temperatures;
mod text_lines;
pub mod touch;

pub use last_digit::digit_mm;
pub use matching::match_to_plan;
pub use parse::{Ending, ParsedLog, Rejected, parse, parse_run};
pub use reader::Reader;
pub use record::LogHeader;
pub(crate) use record::says_found;
pub use runs::RunFound;
pub use setup_mistakes::{LogMistake, Supposed, suppose};
pub use touch::{RawTouch, Status, Touch};

use crate::axes::{AxisMap, AxisName};
use crate::diag::{Failure, Finding, Findings, Result};
use crate::machine::Machine;
use crate::post::{Frame, Postprocessor, log_word};
use crate::program::plan::Plan;
use crate::program::plan_digest::{self, digest};
use finding_places::Places;
use nalgebra::Vector3;

/// Who wrote a log.
#[derive(Debug, Clone, Copy)]
pub enum Writer<'a> {
    Controller(&'a Postprocessor),
    /// Inspection results of another program.
    Points(&'a points::PointsForm),
    /// The project's own form, `controller = "csv"`.
    Csv,
}

/// A log, read and matched to its plan.
#[derive(Debug, Clone)]
pub struct MatchedLog {
    /// In the order of the plan, each once; missed touches and those far from their places are among them.
    pub touches: Vec<Touch>,
    /// Every touch of the plan is read, and the log is not cut off.
    pub complete: bool,
    /// How the log ends.
    pub ending: Ending,
    /// The runs that the log holds.
    pub runs: Vec<RunFound>,
    /// How far off its place an artefact stood that was put down by eye, mm along X, Y and Z with all rotary axes at 0.
    pub found_mm: Option<Vector3<f64>>,
}

/// Reads a log and matches it to its plan.
///
/// # Errors
/// When nothing of it can be used, or it belongs to another program.
pub fn read(
    bytes: &[u8],
    name: &str,
    writer: Writer<'_>,
    machine: &Machine,
    plan: &Plan,
) -> Result<(MatchedLog, Findings)> {
    read_run(bytes, name, writer, machine, plan, None)
}

/// The same for the run of this number, from 1, in a log that holds several.
///
/// # Errors
/// As [`read`], and when there is no such run.
pub fn read_run(
    bytes: &[u8],
    name: &str,
    writer: Writer<'_>,
    machine: &Machine,
    plan: &Plan,
    run: Option<usize>,
) -> Result<(MatchedLog, Findings)> {
    let places = Places::new(bytes, name);
    let (mut parsed, mut findings) = match writer {
        Writer::Controller(post) => parse_run(bytes, name, post, run)?,
        Writer::Points(form) => {
            let (read, findings) = points::parse(bytes, name, form, run)?;
            let (touches, unclear, more) = points::touches(machine, plan, &read, form, &places)
                .map_err(|f| Failure([findings.0.clone(), f.0].concat()))?;
            let ending = if read.ended { Ending::Line } else { Ending::CutOff };
            let rejected = Rejected { ids: unclear, ..Rejected::default() };
            let findings = Findings([findings.0, more.0].concat());
            (of_touches(touches, ending, rejected, read.runs), findings)
        }
        Writer::Csv => {
            let (touches, findings) = csv::read(bytes, name)?;
            let unnamed = findings.0.iter().any(|f| f.code == "log::not_understood");
            let rejected = Rejected { unnamed, ..Rejected::default() };
            (of_touches(touches, Ending::Unmarked, rejected, Vec::new()), findings)
        }
    };
    let joined = |findings: &Findings, failure: Failure| Failure([findings.0.clone(), failure.0].concat());
    if let Some(header) = &mut parsed.header {
        if header.part(&log_word(&machine.name), &log_word(&plan.program))
            && let Writer::Controller(post) = writer
        {
            parse::other_controller(header, post, &places, &mut findings);
        }
        belongs(header, machine, plan, &places, &mut findings).map_err(|f| joined(&findings, f))?;
    }
    let finite = parsed.touches.iter().map(|t| t.position).filter(|p| p.0.iter().all(|v| v.is_finite()));
    let digit_mm = digit_mm(finite);
    if let Writer::Controller(_) = writer {
        to_axes(machine, plan, &mut parsed.touches).map_err(|f| joined(&findings, f))?;
    }
    if plan.find.is_some() && parsed.found_mm.is_none() && parsed.touches.iter().any(|t| t.id.is_none()) {
        let says = "touches without numbers cannot be matched: the program found an artefact that was put down by eye, and this log does not say where";
        let help = "use the log that the program itself writes";
        findings.push(Finding::error("log::not_found", says).help(help));
        return Err(Failure(findings.0));
    }
    let found_mm = parsed.found_mm.or_else(|| found::by_touches(machine, plan, &parsed.touches));
    let relative = plan.find.as_ref().zip(found_mm).map(|(_, off)| plan.relative_to(machine, &off));
    let here = relative.as_ref().unwrap_or(plan);
    let form = position_rows::RowForm {
        per_touch: &parsed.per_touch,
        says_status: parsed.rows_say_status,
        lost: &parsed.rejected.lines,
    };
    let (mut touches, more) = matching::match_at(machine, here, parsed.touches, form, Some(&places), &parsed.rejected)
        .map_err(|f| joined(&findings, f))?;
    findings.0.extend(more.0);
    clock::check(plan, &touches, &places, &mut findings);
    touches.iter_mut().for_each(|t| t.digit_mm = digit_mm);
    if !touches.iter().any(|t| t.status == Status::Hit) {
        findings.push(
            Finding::error("log::no_hit", format!("{name} holds no touch of the plan at which the probe triggered"))
                .help(
                    "is it the log of this program, and did the program run? the findings above say what was not used",
                ),
        );
        return Err(Failure(findings.0));
    }
    let usable = touches.iter().filter(|t| t.status != Status::Elsewhere).count();
    let complete = usable == plan.touches.len() && parsed.ending != Ending::CutOff;
    Ok((MatchedLog { touches, complete, ending: parsed.ending, runs: parsed.runs, found_mm }, findings))
}

/// A log of touches with numbers, without a head.
fn of_touches(touches: Vec<RawTouch>, ending: Ending, rejected: Rejected, runs: Vec<RunFound>) -> ParsedLog {
    let (header, per_touch) = (None, Vec::new());
    let found_mm = None;
    ParsedLog { touches, header, found_mm, ending, rejected, columns: false, per_touch, rows_say_status: false, runs }
}

/// Is this the log of the plan's program? A log that was written with other numbers than those of the plan is refused: the fit would
/// read the touches with numbers that were not those of the machine.
fn belongs(
    header: &LogHeader,
    machine: &Machine,
    plan: &Plan,
    places: &Places<'_>,
    findings: &mut Findings,
) -> Result<()> {
    let (program, of_machine) = (log_word(&plan.program), log_word(&machine.name));
    if header.program != program || header.machine != of_machine {
        let message =
            format!("the log is of {}, the plan is of program {program} on machine {of_machine}", header.says());
        let finding = Finding::error("log::other_program", message)
            .help("use the plan that `axiscal generate` wrote together with the program");
        return Err(places.at_line(finding, header.line).into());
    }
    if header.digest == digest(plan) {
        return Ok(());
    }
    if header.digest == plan_digest::older(plan) {
        let message = "an earlier version wrote the program of this log: the log confirms the positions of its plan, and no other number of it";
        let finding = Finding::info("log::older", message)
            .help("was the plan edited since, use it as it was written; a program that is generated again writes logs that confirm all numbers");
        findings.push(places.at_line(finding, header.line));
        return Ok(());
    }
    let message = format!(
        "the program that wrote this log was made from another plan ({} touches), or the plan was changed since",
        header.touches
    );
    let finding = Finding::error("log::other_plan", message)
        .help("use the plan that `axiscal generate` wrote together with the program");
    Err(places.at_line(finding, header.line).into())
}

/// Makes axis positions (relative to R) of a control's own coordinates, where the plan's program was written for the
/// control's own transformation. The positions are those of an errorless machine.
///
/// # Errors
/// When the machine's linear axes do not span space.
pub fn to_axes(machine: &Machine, plan: &Plan, touches: &mut [RawTouch]) -> Result<()> {
    if !Frame::of_plan(machine, plan).is_tcp() {
        return Ok(());
    }
    let numbered = plan.numbered();
    for touch in touches {
        let planned = touch.id.and_then(|id| numbered.touch(id));
        let length = planned.and_then(|t| t.tool_length_mm).unwrap_or(plan.tool_length_mm);
        let mut shown = touch.position;
        // rotary axes that the log lacks stand at the plan's pose
        let pose = planned.map_or_else(AxisMap::default, |t| t.pose);
        AxisName::ALL.into_iter().filter(|a| !touch.present[a.index()]).for_each(|a| {
            if let Some(value) = pose.get(a) {
                shown.set(a, value);
            }
        });
        let frame = Frame::new(machine, plan.controller_frame, length);
        touch.position = frame.axes_from_controller(&shown).ok_or_else(|| {
            Failure::new("log::frame", format!("the linear axes of machine {} do not span space", machine.name))
                .help("check the directions of X, Y and Z in machines.toml")
        })?;
    }
    Ok(())
}

#[cfg(test)]
mod tests;
