//! From a study's path to machine, effects and touches: opens what the study names.

use super::active_compensation::{beside_the_axis, does_not_act, load_compensation};
use super::history::history_path;
use super::read_run::{LogFile, ReadPlan, controller_path, touches_of_run};
use super::{Disk, Environment};
use crate::design::{Planned, keep_measured};
use crate::diag::{Failure, Finding, Findings, Result, SHOWN, Source, shown, source};
use crate::fit::{self, Fit, Settings};
use crate::log::Touch;
use crate::machine::{self, Machine};
use crate::model::catalogue::Catalogue;
use crate::model::data::{Data, Run, assemble_with_spindle};
use crate::model::spindle::SpindleStretch;
use crate::post::Postprocessor;
use crate::program::plan::Plan;
use crate::study::{Study, place_of_mask};
use sha2::{Digest, Sha256};
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// A study with everything that it names.
#[derive(Debug, Clone)]
pub struct Loaded {
    pub path: PathBuf,
    /// The study's file as it was read, with a byte order mark where it has one.
    pub bytes: Vec<u8>,
    pub study: Study,
    pub machine: Arc<Machine>,
    /// The effects that exist for the machine.
    pub catalogue: Arc<Catalogue>,
    pub runs: Arc<[LoadedRun]>,
    /// SHA-256 over the study and every file that it names, hexadecimal.
    pub sha256: String,
    /// SHA-256 over the plans and logs alone, hexadecimal.
    pub data_sha256: String,
}

#[derive(Debug)]
pub struct LoadedRun {
    pub plan: Plan,
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
        fit::identify_data(&self.machine, &self.catalogue, self.data(), settings)
            .map_err(|failure| placed(failure, &source(self.path.display().to_string(), self.text())))
    }

    #[must_use]
    pub fn text(&self) -> String {
        String::from_utf8_lossy(without_mark(&self.bytes)).into_owned()
    }

    /// The same study with another text, as it is to be written: a byte order mark belongs to the file.
    ///
    /// # Errors
    /// When the text is no study.
    pub fn with_text(&self, text: &str) -> Result<Self> {
        let mark = &self.bytes[..self.bytes.len() - without_mark(&self.bytes).len()];
        self.with_bytes([mark, text.as_bytes()].concat())
    }

    /// The same study with other contents of its file.
    ///
    /// # Errors
    /// When they are no study.
    pub fn with_bytes(&self, bytes: Vec<u8>) -> Result<Self> {
        let text = crate::files::text_of(&self.path, bytes.clone())?;
        let (study, _) = Study::parse(&source(self.path.display().to_string(), text))?;
        Ok(Self { study, bytes, ..self.clone() })
    }

    /// The study's file name, as a user types it.
    #[must_use]
    pub fn name(&self) -> String {
        self.path.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default()
    }

    /// The folder that the study's paths are relative to.
    #[must_use]
    pub fn folder(&self) -> &Path {
        self.path.parent().unwrap_or(Path::new(""))
    }

    /// When the spindle ran, as the study says.
    #[must_use]
    pub fn spindle(&self) -> Vec<SpindleStretch> {
        self.study.data.iter().flat_map(|run| run.spindle.iter().copied()).collect()
    }

    /// All touches, ready for the model.
    #[must_use]
    pub fn data(&self) -> Data {
        assemble_with_spindle(&self.machine, &self.runs(), &self.spindle())
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
        let spindle = self.spindle();
        self.runs().iter().map(|run| Planned { spindle: spindle.clone(), ..Planned::from_run(run) }).collect()
    }

    /// The same with the touches that a fit could use: only what was measured tells anything.
    #[must_use]
    pub fn measured(&self, fit: &Fit) -> Vec<Planned> {
        let mut out = self.planned();
        keep_measured(&mut out, &fit.data);
        out
    }

    /// The control that the runs were made on, as a call from here names it: the first of them that programs can be written for.
    #[must_use]
    pub fn control(&self) -> Option<String> {
        let each = self.study.data.iter().map(|d| controller_path(&d.controller, self.folder(), &Disk::default()));
        let mut each = each.filter(|c| c != "csv");
        each.find(|c| Postprocessor::load_built_in_or_file(c).is_ok())
    }

    #[must_use]
    pub fn settings(&self) -> Settings {
        self.study.settings()
    }
}

/// A text file without its byte order mark.
fn without_mark(bytes: &[u8]) -> &[u8] {
    bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes)
}

/// One machine by name: of a file, or a built-in one.
///
/// # Errors
/// When the file is unusable or has none of that name; the message lists those that exist.
pub fn load_machine(name: &str, path: Option<&Path>, env: &dyn Environment) -> Result<Machine> {
    if let (None, Some(machine)) = (path, machine::built_in(name)?) {
        return Ok(machine);
    }
    let machines = load_machines(path, env)?;
    let names: Vec<String> = machines.iter().map(|m| m.name.clone()).collect();
    machines.into_iter().find(|m| m.name == name).ok_or_else(|| {
        Finding::error("machine::unknown", format!("no machine is called {name:?}"))
            .about(name)
            .help(format!("there are: {}; a file of your own goes with --machines FILE", names.join(", ")))
            .into()
    })
}

/// The text of a machines file, or of the built-in one.
///
/// # Errors
/// When the file cannot be read.
pub fn machines_file(path: Option<&Path>, env: &dyn Environment) -> Result<Source> {
    match path {
        Some(path) => env.source(path),
        None => Ok(source("machines.toml (built in)", machine::BUILT_IN)),
    }
}

/// The machines of a file, or the built-in ones.
///
/// # Errors
/// When the file is unusable.
pub fn load_machines(path: Option<&Path>, env: &dyn Environment) -> Result<Vec<Machine>> {
    let text = machines_file(path, env)?;
    let (machines, Findings(said)) = machine::load(&text)?;
    env.remark(&said);
    Ok(machines)
}

/// A controller by name, or of a postprocessor file.
///
/// # Errors
/// When there is none of that name, or the file is unusable.
pub fn load_controller(word: &str, env: &dyn Environment) -> Result<Postprocessor> {
    let (post, findings) = Postprocessor::load(word, |path| env.text(path))?;
    env.remark(&findings);
    Ok(post)
}

/// The built-in effects with those of files.
///
/// # Errors
/// When a file is unusable.
pub fn load_effects<P: AsRef<Path>>(paths: &[P], env: &dyn Environment) -> Result<Catalogue> {
    let mut catalogue = Catalogue::built_in()?;
    for path in paths {
        env.remark(&catalogue.add_file(&env.source(path.as_ref())?)?.0);
    }
    Ok(catalogue)
}

/// Reads a study and everything that it names.
///
/// # Errors
/// When a file is missing or unusable.
pub fn load_study(path: &Path, env: &dyn Environment) -> Result<Loaded> {
    let bytes = env.read(path)?;
    env.protect(&history_path(path));
    let text = crate::files::text_of(path, bytes.clone())?;
    let mut hash = Sha256::new();
    let mut data = Sha256::new();
    hash.update(text.as_bytes());
    let src = source(path.display().to_string(), text);
    let (study, findings) = Study::parse(&src)?;
    env.remark(&findings.0);
    let folder = path.parent().map(Path::to_path_buf).unwrap_or_default();
    let machines = study.machines.as_ref().map(|m| folder.join(m));
    let machine = located(load_machine(&study.machine, machines.as_deref(), env), &src)?;
    hash.update(machine.sha256.as_bytes());
    let mut catalogue = Catalogue::built_in()?;
    for name in &study.effects_files {
        let file = at_the_name(env.source(&folder.join(name)), name, &src)?;
        hash.update(file.inner().as_bytes());
        env.remark(&catalogue.add_file(&file)?.0);
    }
    located(fit::effects_of(&study.effects, &catalogue, &machine), &src)?;
    let mut runs = Vec::new();
    let mut seen: Vec<(PathBuf, Vec<u8>)> = Vec::new();
    for entry in &study.data {
        let plan_path = folder.join(&entry.plan);
        let mut plan = at_the_name(ReadPlan::read(&plan_path, env), &entry.plan, &src)?;
        at_the_name(plan.check_belongs(&plan_path, &machine, env), &entry.plan, &src)?;
        let ReadPlan { plan, digest: plan_digest, .. } = plan;
        let log_path = folder.join(&entry.log);
        let bytes = at_the_name(env.read(&log_path), &entry.log, &src)?;
        let digest = Sha256::digest(&bytes).to_vec();
        if let Some((first, _)) = seen.iter().find(|(_, d)| *d == digest) {
            env.remark(&[Finding::warning(
                "study::log_twice",
                format!("{} and {} hold the same bytes", first.display(), log_path.display()),
            )
            .help("a log counted twice makes every uncertainty too small: name each run once")]);
        }
        seen.push((log_path.clone(), digest.clone()));
        if let Some(path) = &entry.compensation {
            let active = at_the_name(load_compensation(&folder.join(path), &machine, env), path, &src)?;
            let idle = does_not_act(&active, &machine, &plan);
            let beside = if idle.is_some() { None } else { beside_the_axis(&active, &machine, &plan) };
            env.remark(idle.or(beside).as_slice());
        }
        for part in [&plan_digest[..], &digest, format!("{:?}", entry.run).as_bytes()] {
            hash.update(part);
            data.update(part);
        }
        let controller = controller_path(&entry.controller, &folder, env);
        let log = LogFile { bytes: &bytes, path: &log_path, controller: &controller, run: entry.run };
        let touches = at_the_name(touches_of_run(entry, log, &machine, &plan, env), &entry.controller, &src)?;
        runs.push(LoadedRun {
            plan,
            touches,
            mounting: entry.mounting.clone(),
            started_s: entry.started_s,
            compensation: entry.compensation.as_ref().map(|c| folder.join(c)),
        });
    }
    masks_are_planned(&study, &runs, &src)?;
    crate::files::enough_memory(runs.iter().map(|run: &LoadedRun| run.touches.len()).sum())?;
    let hexadecimal = |hash: Sha256| hash.finalize().iter().map(|b| format!("{b:02x}")).collect();
    Ok(Loaded {
        path: path.to_path_buf(),
        bytes,
        study,
        machine: Arc::new(machine),
        catalogue: Arc::new(catalogue),
        runs: runs.into(),
        sha256: hexadecimal(hash),
        data_sha256: hexadecimal(data),
    })
}

/// Checks that each masked touch is in the plan of its run. One that only the log lacks is a remark of the fit.
fn masks_are_planned(study: &Study, runs: &[LoadedRun], src: &Source) -> Result<()> {
    let ids: Vec<BTreeSet<u64>> = runs.iter().map(|run| run.plan.touches.iter().map(|t| t.id).collect()).collect();
    let mut findings = Findings::default();
    for (nth, mask) in study.masked.iter().enumerate() {
        if ids.get(mask.run).is_none_or(|ids| ids.contains(&mask.id)) {
            continue;
        }
        let says = format!("there is no touch {} in the plan of run {}", mask.id, mask.run + 1);
        let finding = Finding::error("study::mask", says).help("id is the number of the touch in the plan: correct it");
        // the study is read again for each place
        let place = if findings.0.len() < SHOWN { place_of_mask(src, nth) } else { None };
        findings.push(match place {
            Some(span) => finding.at(src, span),
            None => finding,
        });
    }
    findings.finish(()).map(drop).map_err(|failure| Failure(shown(&failure.0)))
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
