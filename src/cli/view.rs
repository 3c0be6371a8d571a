//! From a study to what is looked at: the report and the workbench begin here.

use super::add::{history_path, read_history};
use super::compare::leads;
use super::export::newest_log;
use super::load::Loaded;
use crate::compare::model_ladder::{Kind, Ladder, Rung, climb};
use crate::compare::{Comparison, compare};
use crate::diag::Result;
use crate::diagnose::{Diagnosis, Options, Subject, diagnose, with_effects};
use crate::fit::{Fit, Settings};
use crate::tables::Correction;
use crate::tables::compensation::{Compensation, Provenance};
use crate::view::{Material, RunFiles, View, gather};
use crate::{design, study::history::History};

/// Everything that was worked out for a view; what it borrows is in [`Loaded`].
pub struct Worked {
    /// The fit of the study's model.
    pub fit: Fit,
    /// The fit with what the diagnosis proposes.
    pub proposed: Option<Fit>,
    /// Where it fails.
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
pub fn work_out(loaded: &Loaded, history: Option<&History>) -> Result<Worked> {
    let settings = loaded.settings();
    let mut fit = loaded.fit(&settings)?;
    design::explain(&loaded.machine, &loaded.catalogue, &loaded.runs(), &mut fit)?;
    let diagnosis = {
        let quick = Settings { quick: true, ..settings.clone() };
        let subject = Subject { machine: &loaded.machine, catalogue: &loaded.catalogue, settings: &quick, fit: &fit };
        let planned = loaded.planned();
        diagnose(subject, &Options { planned: Some(&planned), ..Options::default() })?
    };
    let tried: Vec<Vec<String>> =
        history.map(|h| h.steps.iter().map(|s| s.effects.clone()).collect()).unwrap_or_default();
    let mut ladder = climb(&loaded.machine, &loaded.catalogue, &settings, &fit, &tried);
    let mut proposed = None;
    if diagnosis.verdict.is_missing_effect()
        && let Some(first) = diagnosis.candidates.first().filter(|c| c.proposed)
    {
        let subject =
            Subject { machine: &loaded.machine, catalogue: &loaded.catalogue, settings: &settings, fit: &fit };
        // a candidate that cannot be fitted beside the others is still a candidate
        match with_effects(subject, &[first.effect.as_str()]) {
            Ok(with) => {
                ladder.push(Rung::of(&with, Kind::Proposed));
                proposed = Some(with);
            }
            Err(failure) => ladder.notes.push(format!("{} cannot be added to the model: {failure}", first.effect)),
        }
    }
    let date = newest_log(loaded);
    let correction = correction(loaded, &fit, &date);
    let comparison = compare(&fit).led_by(&leads(&diagnosis));
    Ok(Worked { comparison, proposed, diagnosis, ladder, correction, date, fit })
}

fn correction(loaded: &Loaded, fit: &Fit, date: &str) -> std::result::Result<Correction, String> {
    let study = loaded.path.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
    let provenance =
        Provenance { study, study_sha256: loaded.sha256.clone(), data_date: date.to_owned(), forced: Vec::new() };
    if !fit.outcome.converged {
        return Err(format!("the fit did not converge: {}", fit.outcome.stopped));
    }
    let active: Option<Compensation> = loaded.active().map_err(|f| f.to_string())?;
    Correction::collect(&loaded.machine, &loaded.catalogue, &fit.outcome, loaded.during(active.as_ref()), provenance)
        .map(|(correction, _)| correction)
        .map_err(|f| f.to_string())
}

/// The history beside a study, where there is one.
///
/// # Errors
/// When it is there and cannot be read.
pub fn history_of(loaded: &Loaded) -> Result<Option<History>> {
    read_history(&history_path(&loaded.path))
}

/// The view of what was worked out. `study` is how a user types it.
#[must_use]
pub fn view_of(loaded: &Loaded, worked: &Worked, study: &str) -> View {
    let runs: Vec<RunFiles> = loaded
        .runs
        .iter()
        .zip(&loaded.study.data)
        .map(|(run, entry)| RunFiles {
            plan: &entry.plan,
            log: &entry.log,
            controller: &entry.controller,
            touches: &run.plan,
        })
        .collect();
    gather(&Material {
        study,
        sha256: &loaded.sha256,
        date: &worked.date,
        machine: &loaded.machine,
        catalogue: &loaded.catalogue,
        runs: &runs,
        tolerance: &loaded.study.tolerance,
        fit: &worked.fit,
        proposed: worked.proposed.as_ref(),
        comparison: &worked.comparison,
        diagnosis: &worked.diagnosis,
        ladder: &worked.ladder,
        correction: worked.correction.as_ref().map_err(String::as_str),
    })
}
