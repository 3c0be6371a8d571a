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
use crate::view::{Material, RunFiles, View, gather};

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
    if diagnosis.verdict.is_missing_effect()
        && let Some(first) = diagnosis.candidates.first().filter(|c| c.proposed)
    {
        // a candidate that cannot be fitted beside the others is still a candidate
        match with_effects(loaded.subject(&settings, &fit), &[first.effect.as_str()]) {
            Ok(with) => {
                ladder.push(Rung::from_fit(&with, Kind::Proposed));
                proposed = Some(with);
            }
            Err(failure) => ladder.notes.push(format!("{} cannot be added to the model: {failure}", first.effect)),
        }
    }
    let date = newest_log(loaded, env);
    let correction = loaded
        .active(env)
        .and_then(|active| correction(loaded, &fit, &date, Vec::new(), active.as_ref()))
        .map(|(correction, _)| correction)
        .map_err(|failure| failure.to_string());
    let comparison = compare(&fit).led_by(&leads(&diagnosis));
    Ok(Worked { comparison, proposed, diagnosis, ladder, correction, date, fit })
}

#[must_use]
pub fn view_of(loaded: &Loaded, worked: &Worked) -> View {
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
        study: &loaded.name(),
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
