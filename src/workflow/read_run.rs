//! A run's plan and log, read: what is to be said of them is kept for who says it in the order of the study.

use super::{Environment, load_machine};
use crate::diag::{Failure, Finding, Findings, Result};
use crate::log::{self, MatchedLog, Touch};
use crate::machine::Machine;
use crate::program::plan::Plan;
use crate::program::{plan_check, plan_digest};
use crate::study::DataEntry;
use sha2::{Digest, Sha256};
use std::path::Path;

/// Reads a plan and checks that it is for this machine.
///
/// # Errors
/// When it is unusable or for another machine.
pub fn load_plan(path: &Path, machine: &Machine, env: &dyn Environment) -> Result<Plan> {
    let mut read = ReadPlan::read(path, env)?;
    read.check_belongs(path, machine, env)?;
    Ok(read.plan)
}

/// Reads a plan and, from the machines file, the machine that it names.
///
/// # Errors
/// When one of them is unusable.
pub fn load_plan_and_machine(path: &Path, machines: Option<&Path>, env: &dyn Environment) -> Result<(Plan, Machine)> {
    let mut read = ReadPlan::read(path, env)?;
    let machine = load_machine(&read.plan.machine, machines, env)?;
    read.check_belongs(path, &machine, env)?;
    Ok((read.plan, machine))
}

/// A plan as it was read.
pub(super) struct ReadPlan {
    pub plan: Plan,
    /// The error where it is not as it was written.
    changed: Option<Finding>,
    /// SHA-256 of the file.
    pub digest: Vec<u8>,
}

impl ReadPlan {
    /// Of a file, for whatever machine.
    ///
    /// # Errors
    /// When it is unusable.
    pub fn read(path: &Path, env: &dyn Environment) -> Result<Self> {
        let src = env.source(path)?;
        let ((plan, written), Findings(findings)) = Plan::read(&src)?;
        env.remark(&findings);
        let fields = plan_digest::field_digests(&plan);
        let changed = plan_digest::changed(&written, &fields, &src);
        let digest = Sha256::digest(src.inner().as_bytes()).to_vec();
        Ok(Self { plan, changed, digest })
    }

    pub fn check_belongs(&mut self, path: &Path, machine: &Machine, env: &dyn Environment) -> Result<()> {
        let plan = &self.plan;
        if plan.machine != machine.name {
            return Err(Failure::new(
                "plan::other_machine",
                format!("{} is a plan for machine {:?}, not {:?}", path.display(), plan.machine, machine.name),
            )
            .help("name the machine that the plan was made for, or make the plan again"));
        }
        if !plan.machine_sha256.is_empty() && plan.machine_sha256 != machine.sha256 {
            env.remark(&[Finding::warning(
                "plan::machine_changed",
                format!("the description of {:?} has changed since {} was made", machine.name, path.display()),
            )
            .help("if the change moves the chain, the blocks or the probe, generate the plan again")]);
        }
        // which field was changed, and at which touch that can be seen
        let mut wrong: Vec<Finding> = self.changed.take().into_iter().collect();
        let faults = plan_check::on_machine(plan, machine);
        if !faults.is_empty() {
            // the text was not kept: it is read once more for the places
            let src = env.source(path)?;
            wrong.extend(faults.findings(plan, &src).0);
        }
        let ((), said) = Findings(wrong).finish(())?;
        env.remark(&said.0);
        Ok(())
    }
}

/// The touches of a run of a study, on the study's clock.
///
/// # Errors
/// When nothing in the log can be used.
pub(super) fn touches_of_run(
    entry: &DataEntry,
    log: LogFile,
    machine: &Machine,
    plan: &Plan,
    env: &dyn Environment,
) -> Result<Vec<Touch>> {
    let mut touches = log.read(machine, plan, env)?.touches;
    // a CSV may have its times on the study's clock already
    if log.controller != "csv" || entry.started_s.is_some() {
        on_the_study_clock(&mut touches, plan, entry.started_s);
    }
    Ok(touches)
}

/// Times of a control's own clock, whose zero nobody knows → the study's clock: the first touch is where the plan has it.
/// Without `started` the runs follow one another, by the plan's times. A touch without a time behind others that have one
/// (the program was started again) follows the last of them as the plan has it: time does not run backward.
fn on_the_study_clock(touches: &mut [Touch], plan: &Plan, started_s: Option<f64>) {
    let numbered = plan.numbered();
    let first = touches.iter().find_map(|t| Some((t.time_s?, numbered.touch(t.id)?.time_s?)));
    // the touch made before, once one had a time of its own: on the study's clock, and as planned
    let mut last: Option<(f64, f64)> = None;
    let mut made: Vec<&mut Touch> = touches.iter_mut().collect();
    made.sort_by_key(|t| t.line);
    for touch in made {
        let planned = numbered.touch(touch.id).and_then(|t| t.time_s);
        touch.time_s = match (started_s, first, touch.time_s) {
            (Some(started), Some((first_s, planned_s)), Some(time_s)) => Some(started + planned_s + time_s - first_s),
            // begun again at an earlier set-up it comes after the last one all the same
            _ => last.zip(planned).map(|((time_s, then), now)| time_s + (now - then).max(0.0)),
        };
        last = touch.time_s.zip(planned).or(last);
    }
}

/// A controller's log, a touches CSV or an inspection result, and what it is.
#[derive(Debug, Clone, Copy)]
pub struct LogFile<'a> {
    pub bytes: &'a [u8],
    pub path: &'a Path,
    /// Name of a controller, a postprocessor file, or `csv`.
    pub controller: &'a str,
    /// Which run, from 1; `None`: the last complete one.
    pub run: Option<usize>,
}

impl LogFile<'_> {
    /// Reads it and matches it to its plan.
    ///
    /// # Errors
    /// When nothing in it can be used.
    pub fn read(&self, machine: &Machine, plan: &Plan, env: &dyn Environment) -> Result<MatchedLog> {
        let (reader, said) = log::Reader::load(self.controller, |path| env.text(path))?;
        env.remark(&said);
        let name = self.path.display().to_string();
        let (read, said) = log::read_run(self.bytes, &name, reader.writer(), machine, plan, self.run)?;
        env.remark(&said.0);
        Ok(read)
    }
}

/// A controller is a name, or a postprocessor file relative to the study.
#[must_use]
pub fn controller_path(word: &str, folder: &Path, env: &dyn Environment) -> String {
    let file = folder.join(word);
    if word.ends_with(".toml") && env.exists(&file) { file.display().to_string() } else { word.to_owned() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn time_does_not_run_backward_behind_a_second_start() {
        let machine = crate::post::tests::machine("swivel-head");
        let mut plan = crate::post::tests::plan(&machine, "head", "x+");
        plan.touches.iter_mut().zip([100.0, 160.0, 200.0]).for_each(|(t, s)| t.time_s = Some(s));
        let touches = |times: [Option<f64>; 3], lines: [usize; 3]| -> Vec<Touch> {
            let touch = |((planned, time_s), line): ((&crate::program::plan::PlanTouch, Option<f64>), usize)| Touch {
                id: planned.id,
                position: planned.nominal_position(),
                status: log::Status::Hit,
                time_s,
                digit_mm: None,
                temperature_deg_c: None,
                line,
            };
            plan.touches.iter().zip(times).zip(lines).map(touch).collect()
        };
        let made = |times: [Option<f64>; 3], lines: [usize; 3], started_s: Option<f64>| -> Vec<Option<f64>> {
            let mut touches = touches(times, lines);
            on_the_study_clock(&mut touches, &plan, started_s);
            touches.iter().map(|t| t.time_s).collect()
        };
        let on_the_clock = |times: [Option<f64>; 3], started_s: Option<f64>| made(times, [1, 2, 3], started_s);
        // 90 s where the plan has 60: behind it the plan goes on from there
        let stopped = [Some(7.0), Some(97.0), None];
        assert_eq!(on_the_clock(stopped, Some(1000.0)), [Some(1100.0), Some(1190.0), Some(1230.0)]);
        assert_eq!(on_the_clock([Some(7.0), None, None], Some(0.0)), [Some(100.0), Some(160.0), Some(200.0)]);
        assert_eq!(on_the_clock([None, Some(7.0), Some(8.0)], Some(0.0)), [None, Some(160.0), Some(161.0)]);
        // begun again at an earlier set-up: what was made last comes last
        let again = made([Some(7.0), None, Some(107.0)], [1, 3, 2], Some(0.0));
        assert_eq!(again, [Some(100.0), Some(200.0), Some(200.0)]);
        assert_eq!(on_the_clock(stopped, None), [None; 3]);
        assert_eq!(on_the_clock([None; 3], Some(0.0)), [None; 3]);
    }
}
