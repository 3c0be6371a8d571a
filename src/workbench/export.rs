//! The compensation from the page: what each control asks for, the call with the answers, and the files as a ZIP.

use super::upload::Upload;
use super::{Answered, Snapshot};
use crate::diag::{Failure, Result};
use crate::post::Postprocessor;
use crate::tables::control;
use crate::tables::linuxcnc::{self, stock};
use serde::{Deserialize, Serialize};
use std::io::Write as _;
use std::path::{Component, Path};
use zip::write::SimpleFileOptions;

/// The answers to the questions of `axiscal export`.
#[derive(Debug, Clone, Default, PartialEq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ExportAnswers {
    /// Entries that were not tried on a real control, too.
    pub accept_unverified: bool,
    /// Values beyond the limits, and those of a model that lacks something, too.
    pub force: bool,
    /// Lengths in inches.
    pub inch: bool,
    /// The version of LinuxCNC.
    pub target: Option<String>,
    /// Old values, `NAME=VALUE`.
    pub old: Vec<String>,
    /// The file with the control's present values: LinuxCNC's INI file, or the control's own backup.
    pub present: Option<Upload>,
}

/// Old values that are taken by hand at once.
const MOST_OLD: usize = 1000;

/// What the export for a control asks.
#[derive(Debug, Serialize)]
pub struct ControllerForm {
    name: String,
    says: String,
    /// Why its tables do not describe this machine.
    cannot: Option<String>,
    /// `ini` or `backup`: the file with the control's present values.
    present: &'static str,
    /// Its tables may be in inches.
    inch: bool,
    /// Versions that differ, the usual one first.
    versions: Vec<Version>,
    /// Entries that were not tried on a real control.
    unverified: Vec<String>,
    /// Values whose old value may be given by hand.
    values: Vec<String>,
}

#[derive(Debug, Serialize)]
struct Version {
    name: String,
    says: String,
}

/// The controls that have tables, and what each asks.
///
/// # Errors
/// Never for a released program: the files are tested.
pub fn forms(now: &Snapshot) -> Result<Vec<ControllerForm>> {
    let machine = &now.opened.machine;
    let mut out = Vec::new();
    for post in Postprocessor::built_in()? {
        if let Some(tables) = &post.tables {
            out.push(ControllerForm {
                cannot: control::kind_of(machine, tables).err().map(|why| why.to_string()),
                present: "backup",
                inch: true,
                versions: Vec::new(),
                unverified: control::not_run(machine, tables, true),
                values: control::names(machine, tables).into_iter().collect(),
                name: post.name,
                says: post.says,
            });
        } else if let Ok(usual) = post.release(None) {
            let mut versions: Vec<Version> =
                post.releases.iter().map(|r| Version { name: r.name.clone(), says: r.says.clone() }).collect();
            versions.sort_by_key(|v| v.name != usual.name);
            let module = stock::module_of(machine, usual).ok();
            let pins = module.iter().flat_map(|m| {
                let numbers = usual.pins.get(m.name).into_iter().flatten();
                numbers.filter(|pin| usual.direction_pin.as_ref() != Some(*pin)).map(|pin| format!("{}.{pin}", m.name))
            });
            out.push(ControllerForm {
                cannot: None,
                present: "ini",
                inch: false,
                unverified: Vec::new(),
                values: pins.collect(),
                versions,
                name: post.name,
                says: post.says,
            });
        }
    }
    out.sort_by_key(|form| form.name != linuxcnc::CONTROLLER);
    Ok(out)
}

impl ExportAnswers {
    /// Words behind `axiscal export STUDY --controller NAME --out DIR`; a file of the page is put into `folder` under a name of
    /// ours.
    ///
    /// # Errors
    /// When an answer is unusable, or the file cannot be kept.
    pub fn words(&self, controller: &str, folder: &Path) -> Result<Vec<String>> {
        let mut words = Vec::new();
        let mut flag = |on: bool, word: &str| words.extend(on.then(|| word.to_owned()));
        flag(self.accept_unverified, "--accept-unverified");
        flag(self.force, "--force");
        flag(self.inch, "--unit=inch");
        words.extend(self.target.iter().map(|name| format!("--target={name}")));
        if self.old.len() > MOST_OLD {
            return Err(Failure::new("workbench::old", format!("{} old values are given", self.old.len()))
                .help("give the control's own backup: it has them all"));
        }
        words.extend(self.old.iter().map(|old| format!("--old={old}")));
        if let Some(present) = &self.present {
            let (option, name) = kept(controller);
            let path = folder.join(name);
            crate::files::write_whole(&path, &present.bytes()?)?;
            words.push(format!("{option}={}", path.display()));
        }
        Ok(words)
    }

    /// What was said of the kept file, under the name that the user knows.
    pub fn rename(&self, answered: &mut Answered, controller: &str, folder: &Path) {
        let Some(present) = &self.present else { return };
        let path = folder.join(kept(controller).1).display().to_string();
        for line in &mut answered.messages {
            *line = line.replace(&path, &present.name);
        }
        for finding in answered.answer["findings"].as_array_mut().into_iter().flatten() {
            if finding["file"].as_str() == Some(&path) {
                finding["file"] = present.name.clone().into();
            }
        }
    }
}

/// The option for the file of present values, and the name under which it is kept.
fn kept(controller: &str) -> (&'static str, &'static str) {
    if controller == linuxcnc::CONTROLLER { ("--ini", "machine.ini") } else { ("--backup", "backup.txt") }
}

/// What an export wrote: the folder's name, and names and contents of its files.
#[derive(Debug, Clone, Default)]
pub struct Exported {
    pub folder: String,
    pub files: Vec<(String, Vec<u8>)>,
}

impl Exported {
    /// Reads the files that the verb says it has written.
    ///
    /// # Errors
    /// When one of them cannot be read.
    pub fn read(answered: &Answered, beside: &Path) -> Result<Self> {
        let names = answered.answer["files"].as_array().into_iter().flatten().filter_map(|name| name.as_str());
        let mut files = Vec::new();
        for name in names {
            let below = Path::new(name).components().all(|c| matches!(c, Component::Normal(_)));
            if below {
                files.push((name.to_owned(), crate::files::read_own(&beside.join(&answered.folder).join(name))?));
            }
        }
        Ok(Self { folder: answered.folder.clone(), files })
    }

    /// All of them as one file.
    ///
    /// # Errors
    /// When they are too large for the format.
    pub fn zip(&self) -> Result<Vec<u8>> {
        let failed = |e: String| Failure::new("workbench::zip", format!("the files cannot be packed: {e}"));
        let mut zip = zip::ZipWriter::new(std::io::Cursor::new(Vec::new()));
        let stored = SimpleFileOptions::default().compression_method(zip::CompressionMethod::Stored);
        for (name, contents) in &self.files {
            zip.start_file(format!("{}/{name}", self.folder), stored).map_err(|e| failed(e.to_string()))?;
            zip.write_all(contents).map_err(|e| failed(e.to_string()))?;
        }
        Ok(zip.finish().map_err(|e| failed(e.to_string()))?.into_inner())
    }
}
