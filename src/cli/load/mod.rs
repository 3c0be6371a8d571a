//! From a study's path to machine, effects and touches: opens what the study names.

mod run;

use super::add::history_path;
use super::common::{Io, load_machine};
use crate::design::{Planned, keep_measured};
use crate::diag::{Failure, Finding, Result, Source, shown, source};
use crate::files;
use crate::fit::{self, Fit, Settings};
use crate::log::Touch;
use crate::machine::{Machine, Side};
use crate::model::catalogue::Catalogue;
use crate::model::data::Run;
use crate::program::plan::{ControllerFrame, Plan, PlanBlock};
use crate::study::Study;
use crate::tables::compensation::Compensation;
use crate::tables::correction::During;
use run::{ReadLog, ReadPlan, ReadRun};
pub use run::{load_plan, load_plan_and_machine, read_log};
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
    /// SHA-256 over the plans and logs alone, hexadecimal.
    pub data_sha256: String,
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
    /// The fit of the study; what is wrong with a word of the study has its place.
    ///
    /// # Errors
    /// When the model or the touches are unusable.
    pub fn fit(&self, settings: &Settings) -> Result<Fit> {
        fit::identify(&self.machine, &self.catalogue, &self.runs(), settings).map_err(|failure| match files::read_text(
            &self.path,
        ) {
            Ok(text) => placed(failure, &source(self.path.display().to_string(), text)),
            Err(_) => failure,
        })
    }

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

    /// The runs as they were planned.
    #[must_use]
    pub fn planned(&self) -> Vec<Planned> {
        self.runs().iter().map(Planned::of).collect()
    }

    /// The same with the touches that a fit could use: only what was measured tells anything.
    #[must_use]
    pub fn measured(&self, fit: &Fit) -> Vec<Planned> {
        let mut out = self.planned();
        keep_measured(&mut out, &fit.data);
        out
    }

    /// What the study asks of the fit.
    #[must_use]
    pub fn settings(&self) -> Settings {
        self.study.settings()
    }
}

impl Loaded {
    /// The compensation that was loaded while the touches were made; `None` where nothing was. All runs must agree: the
    /// identified errors add to it.
    ///
    /// # Errors
    /// When a file is unusable, belongs to another machine, or the runs differ.
    pub fn active(&self) -> Result<Option<Compensation>> {
        let mut found: Option<Option<Compensation>> = None;
        for run in &self.runs {
            let here = match &run.compensation {
                Some(path) => Some(load_compensation(path, &self.machine)?),
                None => None,
            };
            match &found {
                Some(first) if *first != here => {
                    return Err(Failure::new(
                        "study::two_compensations",
                        "the runs of the study were measured under different compensations",
                    )
                    .help(
                        "the identified errors add to what was active: put runs under one compensation into one study",
                    ));
                }
                _ => found = Some(here),
            }
        }
        let found = found.flatten();
        if let Some(idle) = found.as_ref().filter(|c| c.idle_without_transformation(&self.machine) > 0)
            && self.transformation().is_none()
        {
            return Err(Failure::new(
                "study::two_frames",
                format!(
                    "the compensation of study {} acted on a part of the runs only: its mode is \"{}\", and some programs give axis positions",
                    idle.provenance.study, idle.mode
                ),
            )
            .help("put the programs of `generate --tcp` into one study and the others into another"));
        }
        Ok(found)
    }

    /// Was the control's own transformation on, so that what it held acted on the touches? `None`: in a part of the runs.
    #[must_use]
    pub fn transformation(&self) -> Option<bool> {
        let mut on = self.runs.iter().map(|r| r.plan.controller_frame == ControllerFrame::Tcp);
        let first = on.next().unwrap_or(false);
        on.all(|other| other == first).then_some(first)
    }

    /// What the control did while the touches were made.
    #[must_use]
    pub fn during<'a>(&self, loaded: Option<&'a Compensation>) -> During<'a> {
        During { loaded, transformation: self.transformation() == Some(true) }
    }
}

/// A compensation that does not act on a program of axis positions.
#[must_use]
pub fn does_not_act(compensation: &Compensation, machine: &Machine, plan: &Plan) -> Option<Finding> {
    let idle = compensation.idle_without_transformation(machine);
    if idle == 0 || plan.controller_frame == ControllerFrame::Tcp {
        return None;
    }
    let of = compensation.terms.iter().filter(|t| t.value != 0.0).count();
    let tables = compensation.tables.as_ref().is_some_and(|t| !t.grids.is_empty())
        || compensation.stock.as_ref().is_some_and(|s| !s.axis_tables.is_empty());
    let which = match (idle == of, tables) {
        (true, false) => "the compensation acts under the control's own transformation, and it does not act on it".to_owned(),
        (true, true) => "only the position tables of the compensation act on it, its other errors under the control's own transformation".to_owned(),
        (false, _) => format!("{idle} of the {of} errors of the compensation act under the control's own transformation only"),
    };
    Some(
        Finding::info(
            "compensation::does_not_act",
            format!("program {} gives axis positions: {which}", plan.program),
        )
        .help("what these touches show is the machine without it, and an export takes its place; a program of `generate --tcp` shows what it leaves"),
    )
}

/// A compensation with errors of an axis that does not carry the blocks: the control then corrects what the blocks do not
/// do, and their readings hold that axis's errors with the other sign.
#[must_use]
pub fn beside_the_axis(compensation: &Compensation, machine: &Machine, plan: &Plan) -> Option<Finding> {
    let side = |axis| machine.axis(axis).map(|a| a.side);
    let beside = |axis| -> Vec<&str> {
        let carried = |b: &&PlanBlock| {
            machine.carrier(&b.carrier).is_none_or(|c| machine.carrier_chain(c).iter().any(|a| a.name == axis))
        };
        plan.blocks.iter().filter(|b| !carried(b)).map(|b| b.name.as_str()).collect()
    };
    let of_workpiece = compensation.terms.iter().filter(|t| t.value != 0.0 && side(t.axis) == Some(Side::Workpiece));
    let (term, blocks) = of_workpiece.map(|t| (t, beside(t.axis))).find(|(_, blocks)| !blocks.is_empty())?;
    if blocks.len() < plan.blocks.len() {
        let (which, they) = if blocks.len() == 1 { ("block", "it is") } else { ("blocks", "they are") };
        return Some(
            Finding::info(
                "compensation::beside_the_axis",
                format!(
                    "the compensation has errors of {}, which carries {} of the {} blocks of program {}, and not {which} {}",
                    term.axis,
                    plan.blocks.len() - blocks.len(),
                    plan.blocks.len(),
                    plan.program,
                    blocks.join(", ")
                ),
            )
            .help(format!("{they} read with the errors of {0} the wrong way round where {0} is turned", term.axis)),
        );
    }
    Some(
        Finding::warning(
            "compensation::beside_the_axis",
            format!("the compensation has errors of {}, which does not carry the blocks of program {}", term.axis, plan.program),
        )
        .help(format!(
            "such blocks are read with the errors of {0} the wrong way round: measure them with {0}'s values at 0, or use a program whose blocks {0} carries",
            term.axis
        )),
    )
}

/// What `export` wrote: the directory, or the compensation.json in it.
///
/// # Errors
/// When it is unusable or belongs to another machine.
pub fn load_compensation(path: &Path, machine: &Machine) -> Result<Compensation> {
    let file = if path.is_dir() { path.join("compensation.json") } else { path.to_path_buf() };
    let compensation = Compensation::read(&source(file.display().to_string(), files::read_text(&file)?))?;
    compensation.check_belongs(machine, &compensation.controller)?;
    Ok(compensation)
}

/// Reads a study and everything that it names; findings that are no errors are printed.
///
/// # Errors
/// When a file is missing or unusable.
pub fn load_study(path: &Path, io: &Io) -> Result<Loaded> {
    let text = files::read_text(path)?;
    files::protect(&history_path(path));
    let mut hash = Sha256::new();
    let mut data = Sha256::new();
    hash.update(text.as_bytes());
    let src = source(path.display().to_string(), text);
    let (study, findings) = Study::parse(&src)?;
    io.report(&findings.0);
    let folder = path.parent().map(Path::to_path_buf).unwrap_or_default();
    let machines = study.machines.as_ref().map(|m| folder.join(m));
    let machine = located(load_machine(&study.machine, machines.as_deref(), io), &src)?;
    hash.update(machine.sha256.as_bytes());
    let mut catalogue = Catalogue::built_in()?;
    for name in &study.effects_files {
        let file = folder.join(name);
        let text = at_the_name(files::read_text(&file), name, &src)?;
        hash.update(text.as_bytes());
        io.report(&catalogue.add_file(&source(file.display().to_string(), text))?.0);
    }
    located(fit::effects_of(&study.effects, &catalogue, &machine), &src)?;
    let mut runs = Vec::new();
    let mut seen: Vec<(PathBuf, Vec<u8>)> = Vec::new();
    for entry in &study.data {
        let read = ReadRun::read(entry, &folder, &machine);
        let ReadRun { plan: ReadPlan { plan, findings, digest: plan_digest, .. }, log } =
            at_the_name(read, &entry.plan, &src)?;
        io.report(&findings);
        let log_path = folder.join(&entry.log);
        let ReadLog { findings, touches, digest } = at_the_name(log, &entry.log, &src)?;
        if let Some((first, _)) = seen.iter().find(|(_, d)| *d == digest) {
            io.report(&[Finding::warning(
                "study::log_twice",
                format!("{} and {} hold the same bytes", first.display(), log_path.display()),
            )
            .help("a log counted twice makes every uncertainty too small: name each run once")]);
        }
        seen.push((log_path, digest.clone()));
        if let Some(path) = &entry.compensation {
            let active = at_the_name(load_compensation(&folder.join(path), &machine), path, &src)?;
            let idle = does_not_act(&active, &machine, &plan);
            let beside = if idle.is_some() { None } else { beside_the_axis(&active, &machine, &plan) };
            io.report(&idle.into_iter().chain(beside).collect::<Vec<_>>());
        }
        for part in [&plan_digest[..], &digest, format!("{:?}", entry.run).as_bytes()] {
            hash.update(part);
            data.update(part);
        }
        io.report(&findings);
        let touches = at_the_name(touches, &entry.controller, &src)?;
        runs.push(LoadedRun {
            plan,
            touches,
            mounting: entry.mounting.clone(),
            started_s: entry.started_s,
            compensation: entry.compensation.as_ref().map(|c| folder.join(c)),
        });
    }
    let hexadecimal = |hash: Sha256| hash.finalize().iter().map(|b| format!("{b:02x}")).collect();
    let (sha256, data_sha256) = (hexadecimal(hash), hexadecimal(data));
    Ok(Loaded { path: path.to_path_buf(), study, machine, catalogue, runs, sha256, data_sha256 })
}

/// What is wrong with a file that the study names gets the place of its name, where it has none of its own.
fn at_the_name<T>(result: Result<T>, name: &str, study: &Source) -> Result<T> {
    let place = ["\"", "'"].iter().find_map(|quote| {
        let at = study.inner().find(&format!("{quote}{name}{quote}"))?;
        Some(at..at + name.len() + 2)
    });
    result.map_err(|Failure(findings)| {
        let placed = |f: Finding| match &place {
            Some(span) if f.source.is_none() => f.at(study, span.clone()),
            _ => f,
        };
        Failure(findings.into_iter().map(placed).collect())
    })
}

/// Findings that name a word of the study get its place.
fn located<T>(result: Result<T>, study: &Source) -> Result<T> {
    result.map_err(|failure| placed(failure, study))
}

fn placed(Failure(findings): Failure, study: &Source) -> Failure {
    let text = study.inner();
    let place = |f: &Finding| {
        let word = f.about.as_deref()?;
        let as_value = text.rfind(&format!("\"{word}\"")).map(|at| at..at + word.len() + 2);
        // or as a key
        as_value.or_else(|| {
            let before = ["parameters.", "\n"];
            let key = |b: &&str| text.find(&format!("{b}{word}")).map(|at| at + b.len());
            before.iter().find_map(key).map(|at| at..at + word.len())
        })
    };
    let at_its_place = |f: Finding| match place(&f) {
        Some(span) if f.source.is_none() => f.at(study, span),
        _ => f,
    };
    // each place is searched in the whole text: only for those that are shown
    Failure(shown(&findings).into_iter().map(at_its_place).collect())
}

/// A controller is a name, or a postprocessor file relative to the study.
#[must_use]
pub fn controller_path(word: &str, folder: &Path) -> String {
    let file = folder.join(word);
    if word.ends_with(".toml") && file.is_file() { file.display().to_string() } else { word.to_owned() }
}
