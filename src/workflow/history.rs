//! The history beside a study: every model that was tried.

use super::{Environment, Loaded};
use crate::diag::Result;
use crate::fit::{Fit, held_out};
use crate::study::history::{History, Step};
use std::path::{Path, PathBuf};

/// `study.toml` → `study.history.json` beside it.
#[must_use]
pub fn history_path(study: &Path) -> PathBuf {
    study.with_extension("history.json")
}

/// The history beside a study, where there is one.
///
/// # Errors
/// When it is there and cannot be read.
pub fn read_history(study: &Path, env: &dyn Environment) -> Result<Option<History>> {
    let path = history_path(study);
    if env.exists(&path) { History::parse(&env.source(&path)?).map(Some) } else { Ok(None) }
}

/// A fit as a step of the history, without the errors on touches left out, which take longer than the fit.
#[must_use]
pub fn step_without_validation(loaded: &Loaded, fit: &Fit) -> Step {
    let o = &fit.outcome;
    Step {
        effects: loaded.study.effects.clone(),
        rms_um: o.rms_um,
        chi2_per_dof: o.chi2_per_dof,
        noise_um: Some(o.noise_um),
        visit_um: Some(o.visit_um),
        unknowns: o.unknowns,
        data_sha256: loaded.data_sha256.clone(),
        ..Step::default()
    }
}

/// A fit as a step of the history.
#[must_use]
pub fn step(loaded: &Loaded, fit: &Fit) -> Step {
    Step {
        held_out_rms_um: fit.outcome.held_out_rms_um,
        held_out_se_um: held_out::by_visit(fit).and_then(|h| h.standard_error_um),
        later_run_rms_um: held_out::later_run(fit).map(|h| h.rms_um),
        ..step_without_validation(loaded, fit)
    }
}

/// The history of a study with its present model at the end, which is fitted where it is not there.
///
/// # Errors
/// When the history or the study is unusable.
pub fn with_present_model(loaded: &Loaded, env: &dyn Environment) -> Result<History> {
    let mut history = read_history(&loaded.path, env)?.unwrap_or_default();
    let is_present = |s: &Step| s.effects == loaded.study.effects && s.data_sha256 == loaded.data_sha256;
    if !history.steps.last().is_some_and(is_present) {
        history.push(step(loaded, &loaded.fit(&loaded.settings())?));
    }
    Ok(history)
}
