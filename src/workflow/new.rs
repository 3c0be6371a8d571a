//! The text of a new study, of plans and logs that were read once to see that they are usable.

use super::active_compensation::load_compensation;
use super::{Environment, LogFile, load_effects, load_plan};
use crate::diag::Result;
use crate::fit::effects_of;
use crate::machine::{Form, Machine};
use crate::model::surface::Surface;
use crate::program::plan::{Plan, PlanBlock, PlanTouch};
use crate::study::tolerance::Tolerance;
use crate::study::{DataEntry, Study};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

#[derive(Debug, Clone)]
pub struct NewRun {
    pub plan: PathBuf,
    pub log: PathBuf,
    /// Name of a controller, a postprocessor file, or `csv`.
    pub controller: String,
    /// The compensation that was active: what an export wrote.
    pub compensation: Option<PathBuf>,
}

/// What a study is made of. Paths are as the caller sees them.
#[derive(Debug, Clone, Copy)]
pub struct NewStudy<'a> {
    /// Where the study will be: its paths are relative to it.
    pub folder: &'a Path,
    /// The machines file; `None`: the one built in.
    pub machines: Option<&'a Path>,
    /// Ids of the effects of the model.
    pub effects: &'a [String],
    pub effects_files: &'a [PathBuf],
    pub runs: &'a [NewRun],
}

/// What is known of the runs of a new study beside their plans and logs.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Beside {
    /// Standard deviation of a touch, mm.
    pub touch_sigma_mm: Option<f64>,
    /// Scatter of an index position, mm.
    pub visit_sigma_mm: Option<f64>,
    /// The mounting that all runs share.
    pub mounting: Option<String>,
}

impl NewStudy<'_> {
    /// The text of the study.
    ///
    /// # Errors
    /// When a file is unusable or an effect is unknown.
    pub fn text(&self, machine: &Machine, env: &dyn Environment) -> Result<String> {
        self.text_with(&Beside::default(), machine, env)
    }

    /// The same with what is known beside the runs.
    ///
    /// # Errors
    /// When a file is unusable or an effect is unknown.
    pub fn text_with(&self, beside: &Beside, machine: &Machine, env: &dyn Environment) -> Result<String> {
        let catalogue = load_effects(self.effects_files, env)?;
        effects_of(self.effects, &catalogue, machine)?;
        let mut data = Vec::new();
        for NewRun { plan, log, controller, compensation } in self.runs {
            let read = load_plan(plan, machine, env)?;
            LogFile { bytes: &env.read(log)?, path: log, controller, run: None }.read(machine, &read, env)?;
            if let Some(active) = compensation {
                load_compensation(active, machine, env)?;
            }
            data.push(DataEntry {
                plan: relative(plan, self.folder),
                log: relative(log, self.folder),
                controller: relative_controller(controller, self.folder),
                started_s: None,
                run: None,
                mounting: beside.mounting.clone(),
                compensation: compensation.as_ref().map(|c| relative(c, self.folder)),
                spindle: Vec::new(),
            });
        }
        let study = Study {
            machines: self.machines.map(|m| relative(m, self.folder)),
            machine: machine.name.clone(),
            effects_files: self.effects_files.iter().map(|f| relative(f, self.folder)).collect(),
            data,
            effects: self.effects.to_vec(),
            knowledge: BTreeMap::new(),
            touch_sigma_mm: beside.touch_sigma_mm,
            visit_sigma_mm: beside.visit_sigma_mm,
            type_b: BTreeMap::new(),
            masked: Vec::new(),
            tolerance: Tolerance::default(),
        };
        study.fresh()
    }
}

/// What is on by default: the location errors of the machine's rotary axes, where the touched bodies stand, and the pre-travel where a
/// probe has triggered.
#[must_use]
pub fn default_effects(machine: &Machine, plans: &[&Plan], known_blocks: bool) -> Vec<String> {
    let mut effects: Vec<String> =
        machine.rotary().map(|a| format!("location-{}", a.name.letter().to_ascii_lowercase())).collect();
    effects.sort();
    if !known_blocks {
        effects.extend(set_ups_of(plans).into_iter().map(str::to_owned));
    }
    let is_centre = |p: &&Plan| !p.blocks.is_empty() && p.blocks.iter().all(|b| b.form.is_centre());
    if plans.is_empty() || !plans.iter().all(is_centre) {
        effects.push("pretravel".into());
    }
    effects
}

/// The effects that say where the touched bodies of plans stand.
fn set_ups_of(plans: &[&Plan]) -> Vec<&'static str> {
    let touched = || plans.iter().flat_map(|p| p.touches.iter().filter_map(|t| Some((p.block_of(t)?, t))));
    let has = |form: &[Form]| touched().any(|(block, _)| form.contains(&block.form));
    let round = |(block, touch): (&PlanBlock, &PlanTouch)| {
        matches!(block.form, Form::Cylinder | Form::Bore) && matches!(Surface::of(block, touch), Surface::Plane { .. })
    };
    let all = [
        ("block-setup", has(&[Form::Box, Form::Part])),
        ("sphere-setup", has(&[Form::Sphere, Form::Centre, Form::Reading])),
        ("reading-zero", has(&[Form::Reading])),
        ("cylinder-setup", has(&[Form::Cylinder, Form::Bore])),
        ("cylinder-height", touched().any(round)),
        ("plane-setup", has(&[Form::Plane])),
    ];
    all.into_iter().filter(|(_, there)| *there).map(|(id, _)| id).collect()
}

/// A controller as a study names it: its name, or its file as the study's folder sees it.
pub(super) fn relative_controller(word: &str, folder: &Path) -> String {
    if word.ends_with(".toml") { relative(Path::new(word), folder) } else { word.to_owned() }
}

/// A path as the study's folder sees it; absolute where it is not below a common folder.
#[must_use]
pub fn relative(path: &Path, folder: &Path) -> String {
    let absolute = |p: &Path| std::path::absolute(p).unwrap_or_else(|_| p.to_path_buf());
    let (path_abs, folder_abs) =
        (absolute(path), absolute(if folder.as_os_str().is_empty() { Path::new(".") } else { folder }));
    let mut there = path_abs.components().peekable();
    let mut here = folder_abs.components().peekable();
    while there.peek().is_some() && there.peek() == here.peek() {
        there.next();
        here.next();
    }
    let mut out = PathBuf::new();
    for _ in here {
        out.push("..");
    }
    out.extend(there);
    out.display().to_string()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn paths_are_relative_to_the_study() {
        assert_eq!(relative(Path::new("a/b/head.log"), Path::new("a")), "b/head.log");
        assert_eq!(relative(Path::new("a/head.log"), Path::new("a/studies")), "../head.log");
        assert_eq!(relative(Path::new("head.log"), Path::new("")), "head.log");
    }
}
