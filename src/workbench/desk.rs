//! The study of a session on its files: the study itself, and what is beside it under names that the study gives.

use super::session::Snapshot;
use super::shelf::Shelf;
use super::{Answered, Opened, Place, Verb};
use crate::diag::{Failure, Result};
use crate::diagnose::Diagnosis;
use crate::post::Postprocessor;
use crate::study::Study;
use crate::view::{Headline, Next};
use crate::workflow::history::{history_path, read_history};
use crate::workflow::view::verdict_of;
use crate::workflow::{Disk, Environment, load_study};
use std::hash::{Hash, Hasher};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// How the file of the user's own effects is called where a study names none.
const OWN_EFFECTS: &str = "my-effects.toml";

/// Calls a verb with the words that a user would type; the second one is the folder that it writes to. Takes its time.
pub type CallVerb = fn(&[String], String) -> Result<Answered>;

/// The study on its files.
pub struct Desk {
    study: PathBuf,
    folder: PathBuf,
    stem: String,
    files: Disk,
    call: CallVerb,
}

impl Desk {
    /// # Errors
    /// When there is no such study.
    pub fn new(study: PathBuf, files: Disk, call: CallVerb) -> Result<Self> {
        let stem = study.file_stem().map(|s| s.to_string_lossy().into_owned()).unwrap_or_default();
        if !files.exists(&study) || stem.is_empty() {
            return Err(Failure::new("file::unreadable", format!("{} is no study", study.display()))
                .help("`axiscal new` writes one"));
        }
        let folder = study.parent().map(PathBuf::from).unwrap_or_default();
        Ok(Self { study, folder, stem, files, call })
    }

    /// Reads the study and all that it names.
    ///
    /// # Errors
    /// When something is missing or unusable, or was changed while it was read.
    pub fn open(&self) -> Result<Opened> {
        let loaded = load_study(&self.study, &self.files);
        let remarks = self.files.remarks.take();
        let loaded = loaded?;
        if self.files.read(&self.study)? != loaded.bytes {
            return Err(Failure::new("study::changed", "the study was changed while it was read"));
        }
        Ok(Opened {
            data: Arc::new(loaded.data()),
            history: read_history(&self.study, &self.files)?.unwrap_or_default(),
            remarks,
            loaded,
        })
    }

    /// Keeps other processes from changing the study until what is returned is dropped.
    ///
    /// # Errors
    /// When one of them does so for longer than is waited, or nothing can be written there.
    pub fn alone(&self) -> Result<Box<dyn Send>> {
        self.files.lock(&self.study)
    }

    fn path(&self, place: Place) -> Result<PathBuf> {
        Ok(match place {
            Place::Study => self.study.clone(),
            Place::History => history_path(&self.study),
            Place::Effects => {
                let (study, _) = Study::parse(&self.files.source(&self.study)?)?;
                self.folder.join(Self::effects_file(&study))
            }
        })
    }

    /// The bytes of a file of ours; `None` where it is not there.
    ///
    /// # Errors
    /// When it is there and cannot be read.
    pub fn read(&self, place: Place) -> Result<Option<Vec<u8>>> {
        let path = self.path(place)?;
        if self.files.exists(&path) { self.files.read(&path).map(Some) } else { Ok(None) }
    }

    /// Writes a file of ours whole, or removes it.
    ///
    /// # Errors
    /// When the folder cannot be written.
    pub fn write(&self, place: Place, bytes: Option<&[u8]>) -> Result<()> {
        self.files.write(&self.path(place)?, bytes)
    }

    /// What [`Place::Effects`] is called in the study: the first file that it names, or one of ours.
    #[must_use]
    pub fn effects_file(study: &Study) -> String {
        study.effects_files.first().cloned().unwrap_or_else(|| OWN_EFFECTS.to_owned())
    }

    /// Something that changes when a file of the study does.
    #[must_use]
    pub fn mark(&self, study: &Study) -> u64 {
        let data = study.data.iter().flat_map(|d| [Some(&d.plan), Some(&d.log), d.compensation.as_ref()]);
        let named = data.flatten().chain(&study.machines).chain(&study.effects_files);
        let all = std::iter::once(self.study.clone()).chain(named.map(|n| self.folder.join(n)));
        let mut hash = std::hash::DefaultHasher::new();
        for path in all {
            let stamp = self.files.stamp(&path);
            (path, stamp).hash(&mut hash);
        }
        hash.finish()
    }

    /// Calls a verb on the study as its file is now.
    ///
    /// # Errors
    /// When it cannot be called at all.
    pub fn call(&self, verb: &Verb) -> Result<Answered> {
        let folder = match verb {
            Verb::PlanNext(..) => format!("{}-next", self.stem),
            Verb::Export(controller, _) => format!("{}-compensation-{controller}", self.stem),
        };
        let (study, out) = (self.study.display().to_string(), self.folder.join(&folder).display().to_string());
        let words = |name: &str, controller: &str, more: Vec<String>| {
            let first = [name, &study, "--out", &out, "--controller", controller];
            first.into_iter().map(str::to_owned).chain(more).collect::<Vec<_>>()
        };
        match verb {
            Verb::PlanNext(controller, minutes) => {
                (self.call)(&words("plan-next", controller, vec![format!("--minutes={minutes}")]), folder)
            }
            Verb::Export(controller, answers) => {
                let kept = tempfile::tempdir().map_err(|e| {
                    Failure::new("workbench::upload", format!("no folder for the file of the page: {e}"))
                })?;
                let more = answers.words(controller, kept.path())?;
                let mut answered = (self.call)(&words("export", controller, more), folder)?;
                answers.rename(&mut answered, controller, kept.path());
                Ok(answered)
            }
        }
    }

    /// The folder of the study.
    #[must_use]
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// The verdict in words and what to do next, as the report has them.
    #[must_use]
    pub fn verdict(&self, now: &Snapshot, shelf: &Shelf, found: &Diagnosis) -> (Headline, Vec<Next>) {
        let names = found.proposed().iter().map(|c| c.effect.clone());
        let mut settings = now.opened.quick_settings();
        settings.effects.extend(names);
        // a candidate that cannot be fitted beside the others is still a candidate
        let proposed = match found.proposed() {
            [] => None,
            _ => shelf.fit(&now.opened, now.inputs, settings).ok(),
        };
        let proposed = proposed.as_ref().map(|(fit, _)| &**fit);
        verdict_of(&now.opened.loaded, &now.fit, proposed, found, &self.files)
    }

    /// Controllers that have programs, by name.
    #[must_use]
    pub fn controllers() -> Vec<String> {
        Postprocessor::built_in().map(|all| all.into_iter().map(|p| p.name).collect()).unwrap_or_default()
    }
}
