//! From a study to everything that a person sees of it.

use super::examine::leads;
use super::export::{correction, newest_log};
use super::{Environment, Loaded};
use crate::compare::model_ladder::{Kind, Ladder, Rung, climb};
use crate::compare::{Comparison, compare};
use crate::design;
use crate::diag::Result;
use crate::diagnose::{Diagnosis, Options, with_effects};
use crate::fit::Fit;
use crate::study::history::History;
use crate::tables::Correction;
use crate::view::{Headline, Material, Next, RunFiles, View, ViewMaterial, gather, verdict_and_steps};

/// Everything that was worked out for a view; what it borrows is in [`Loaded`].
pub struct Worked {
    /// The fit of the study's model.
    pub fit: Fit,
    /// The fit with what the diagnosis proposes.
    pub proposed: Option<Fit>,
    pub comparison: Comparison,
    /// What is missing.
    pub diagnosis: Diagnosis,
    /// The models on these touches.
    pub ladder: Ladder,
    /// What a compensation would carry, or why none can be made.
    pub correction: std::result::Result<Correction, String>,
    /// Day of the data.
    pub date: String,
}

/// Works a study out: fit, comparison, diagnosis, ladder, compensation.
///
/// # Errors
/// When the study cannot be fitted.
pub fn work_out(loaded: &Loaded, history: Option<&History>, env: &dyn Environment) -> Result<Worked> {
    let settings = loaded.settings();
    let mut fit = loaded.fit(&settings)?;
    design::explain(&loaded.machine, &loaded.catalogue, &loaded.runs(), &mut fit)?;
    let diagnosis = loaded.diagnose(&settings, &fit, &Options::default())?;
    let tried: Vec<Vec<String>> =
        history.map(|h| h.steps.iter().map(|s| s.effects.clone()).collect()).unwrap_or_default();
    let mut ladder = climb(&loaded.machine, &loaded.catalogue, &settings, &fit, &tried);
    let mut proposed = None;
    let names: Vec<&str> = diagnosis.proposed().iter().map(|c| c.effect.as_str()).collect();
    if diagnosis.verdict.is_missing_effect() && !names.is_empty() {
        // a candidate that cannot be fitted beside the others is still a candidate
        match with_effects(loaded.subject(&settings, &fit), &names) {
            Ok(with) => {
                ladder.push(Rung::from_fit(&with, Kind::Proposed));
                proposed = Some(with);
            }
            Err(failure) => {
                ladder.notes.push(format!("{} cannot be added to the model: {failure}", names.join(" and ")))
            }
        }
    }
    let (correction, date) = possible_correction(loaded, &fit, env);
    let comparison = compare(&fit).led_by(&leads(&diagnosis));
    Ok(Worked { comparison, proposed, diagnosis, ladder, correction, date, fit })
}

fn run_files(loaded: &Loaded) -> Vec<RunFiles<'_>> {
    let each = loaded.runs.iter().zip(&loaded.study.data);
    each.map(|(run, entry)| RunFiles {
        plan: &entry.plan,
        log: &entry.log,
        controller: &entry.controller,
        touches: &run.plan,
    })
    .collect()
}

/// What a compensation of these values would carry, or why none can be made; and the day of the data.
fn possible_correction(
    loaded: &Loaded,
    fit: &Fit,
    env: &dyn Environment,
) -> (std::result::Result<Correction, String>, String) {
    let date = newest_log(loaded, env);
    let correction = loaded
        .active(env)
        .and_then(|active| correction(loaded, fit, &date, Vec::new(), active.as_ref()))
        .map(|(correction, _)| correction)
        .map_err(|failure| failure.to_string());
    (correction, date)
}

/// The verdict and the steps alone, from what the workbench has at hand.
#[must_use]
pub fn verdict_of(
    loaded: &Loaded,
    fit: &Fit,
    proposed: Option<&Fit>,
    diagnosis: &Diagnosis,
    env: &dyn Environment,
) -> (Headline, Vec<Next>) {
    let (correction, date) = possible_correction(loaded, fit, env);
    verdict_and_steps(&Material {
        study: &loaded.name(),
        path: &loaded.path,
        machines_file: loaded.study.machines.as_deref(),
        sha256: &loaded.sha256,
        date: &date,
        machine: &loaded.machine,
        catalogue: &loaded.catalogue,
        runs: &run_files(loaded),
        tolerance: &loaded.study.tolerance,
        fit,
        proposed,
        diagnosis,
        correction: correction.as_ref().map_err(String::as_str),
    })
}

#[must_use]
pub fn view_of(loaded: &Loaded, worked: &Worked) -> View {
    let runs = run_files(loaded);
    let verdict = Material {
        study: &loaded.name(),
        path: &loaded.path,
        machines_file: loaded.study.machines.as_deref(),
        sha256: &loaded.sha256,
        date: &worked.date,
        machine: &loaded.machine,
        catalogue: &loaded.catalogue,
        runs: &runs,
        tolerance: &loaded.study.tolerance,
        fit: &worked.fit,
        proposed: worked.proposed.as_ref(),
        diagnosis: &worked.diagnosis,
        correction: worked.correction.as_ref().map_err(String::as_str),
    };
    gather(&ViewMaterial { verdict, comparison: &worked.comparison, ladder: &worked.ladder })
}
