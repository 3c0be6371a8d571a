//! From a study's path to machine, effects and touches: opens what the study names.

use super::common::{Io, load_machine};
use crate::diag::{Failure, Finding, Result, source};
use crate::files;
use crate::fit::Settings;
use crate::log::{self, Touch};
use crate::machine::Machine;
use crate::model::catalogue::Catalogue;
use crate::model::data::Run;
use crate::post::Postprocessor;
use crate::program::plan::Plan;
use crate::study::Study;
use sha2::{Digest, Sha256};
use std::path::{Path, PathBuf};

/// A study with everything that it names.
#[derive(Debug)]
pub struct Loaded {
    /// Where the study lies.
    pub path: PathBuf,
    /// The study.
    pub study: Study,
    /// Its machine.
    pub machine: Machine,
    /// The effects that exist for it.
    pub catalogue: Catalogue,
    /// Plan and touches of each run.
    pub runs: Vec<LoadedRun>,
    /// SHA-256 over the study and every file that it names, hexadecimal.
    pub sha256: String,
}

/// One run, read.
#[derive(Debug)]
pub struct LoadedRun {
    /// What was to be touched.
    pub plan: Plan,
    /// What was touched.
    pub touches: Vec<Touch>,
    /// Blocks of equal mounting, carrier and name share one set-up.
    pub mounting: Option<String>,
    /// When the run began, s.
    pub started_s: Option<f64>,
    /// The compensation that was active, as an absolute or working path.
    pub compensation: Option<PathBuf>,
}

impl Loaded {
    /// The runs as the fit takes them.
    #[must_use]
    pub fn runs(&self) -> Vec<Run<'_>> {
        self.runs
            .iter()
            .map(|r| Run {
                plan: &r.plan,
                touches: &r.touches,
                mounting: r.mounting.as_deref(),
                started_s: r.started_s,
            })
            .collect()
    }

    /// What the study asks of the fit.
    #[must_use]
    pub fn settings(&self) -> Settings {
        Settings {
            effects: self.study.effects.clone(),
            knowledge: self.study.knowledge.clone(),
            touch_sigma_mm: self.study.touch_sigma_mm,
            reference: None,
        }
    }
}

/// Reads a study and everything that it names; findings that are no errors are printed.
///
/// # Errors
/// When a file is missing or unusable.
pub fn load_study(path: &Path, io: &Io) -> Result<Loaded> {
    let text = files::read_text(path)?;
    let mut hash = Sha256::new();
    hash.update(text.as_bytes());
    let (study, findings) = Study::parse(&source(path.display().to_string(), text))?;
    io.report(&findings.0);
    let folder = path.parent().map(Path::to_path_buf).unwrap_or_default();
    let machines = study.machines.as_ref().map(|m| folder.join(m));
    let machine = load_machine(&study.machine, machines.as_deref(), io)?;
    hash.update(machine.sha256.as_bytes());
    let mut catalogue = Catalogue::built_in()?;
    for file in &study.effects_files {
        let file = folder.join(file);
        let text = files::read_text(&file)?;
        hash.update(text.as_bytes());
        io.report(&catalogue.add_file(&source(file.display().to_string(), text))?.0);
    }
    let mut runs = Vec::new();
    for entry in &study.data {
        let plan_path = folder.join(&entry.plan);
        let plan = load_plan(&plan_path, &machine, io)?;
        let log_path = folder.join(&entry.log);
        let bytes = files::read_bytes(&log_path)?;
        hash.update(plan.to_json().as_bytes());
        hash.update(&bytes);
        let touches = read_log(&bytes, &log_path, &controller_path(&entry.controller, &folder), &machine, &plan, io)?;
        runs.push(LoadedRun {
            plan,
            touches,
            mounting: entry.mounting.clone(),
            started_s: entry.started_s,
            compensation: entry.compensation.as_ref().map(|c| folder.join(c)),
        });
    }
    let sha256 = hash.finalize().iter().map(|b| format!("{b:02x}")).collect();
    Ok(Loaded { path: path.to_path_buf(), study, machine, catalogue, runs, sha256 })
}

/// A controller is a name, or a postprocessor file relative to the study.
fn controller_path(word: &str, folder: &Path) -> String {
    let file = folder.join(word);
    if word.ends_with(".toml") && file.is_file() { file.display().to_string() } else { word.to_owned() }
}

/// Reads a plan and checks that it is for this machine.
///
/// # Errors
/// When it is unusable or for another machine.
pub fn load_plan(path: &Path, machine: &Machine, io: &Io) -> Result<Plan> {
    let src = source(path.display().to_string(), files::read_text(path)?);
    let (plan, findings) = Plan::parse(&src)?;
    io.report(&findings.0);
    if plan.machine != machine.name {
        return Err(Failure::new(
            "plan::other_machine",
            format!("{} is a plan for machine {:?}, not {:?}", path.display(), plan.machine, machine.name),
        )
        .help("name the machine that the plan was made for, or make the plan again"));
    }
    if !plan.machine_sha256.is_empty() && plan.machine_sha256 != machine.sha256 {
        io.report(&[Finding::warning(
            "plan::machine_changed",
            format!("the description of {:?} has changed since {} was made", machine.name, path.display()),
        )
        .help("if the change moves the chain, the blocks or the probe, generate the plan again")]);
    }
    Ok(plan)
}

/// Reads a log (or touches CSV) and matches it to its plan.
///
/// # Errors
/// When nothing in it can be used.
pub fn read_log(
    bytes: &[u8],
    path: &Path,
    controller: &str,
    machine: &Machine,
    plan: &Plan,
    io: &Io,
) -> Result<Vec<Touch>> {
    let post = if controller == "csv" {
        None
    } else {
        let (post, findings) = Postprocessor::load_built_in_or_file(controller)?;
        io.report(&findings);
        Some(post)
    };
    let writer = post.as_ref().map_or(log::Writer::Csv, log::Writer::Controller);
    let (read, findings) = log::read(bytes, &path.display().to_string(), writer, machine, plan)?;
    io.report(&findings.0);
    Ok(read.touches)
}
