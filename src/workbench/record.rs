//! What the page is told, as JSON (`axiscal-workbench/1`).
//!
//! In two parts, because a step must be quick: `inputs` (touches, effects, words: the same until other data are read) and
//! here *live* (what a step changes). Touches stand column by column. Lengths mm and angles deg, µm where a name ends in
//! `_um`, hours in `_h`.

use super::Answered;
use super::draft::{self, Draft};
use super::evidence::Scored;
use super::session::{Refused, Snapshot};
use super::shelf::Shelf;
use crate::compare::by_direction::{self, Explained};
use crate::compare::variables::{VariableKind, plot_variables};
use crate::diag::{Failure, Finding, Severity};
use crate::diagnose::Diagnosis;
use crate::fit;
use crate::fit::outcome::{Combination, Parameter, Undetermined};
use crate::study::history::History;
use crate::study::tolerance::Tolerance;
use crate::units::um_from_mm;
use crate::view::{Headline, Next};
use serde::Serialize;
use std::sync::Arc;

pub const FORMAT: &str = "axiscal-workbench/1";

#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Message {
    severity: &'static str,
    code: &'static str,
    message: String,
    #[serde(skip_serializing_if = "Option::is_none")]
    help: Option<String>,
    /// `file:line:column`.
    #[serde(skip_serializing_if = "Option::is_none")]
    place: Option<String>,
}

#[must_use]
pub fn messages(findings: &[Finding]) -> Vec<Message> {
    let each = findings.iter().map(|f| Message {
        severity: match f.severity {
            Severity::Error => "error",
            Severity::Warning => "warning",
            Severity::Info => "info",
        },
        code: f.code,
        message: f.message.clone(),
        help: f.help.clone(),
        place: f.place(),
    });
    each.collect()
}

/// What is worked out behind a state.
#[derive(Debug, Clone, Default, Serialize)]
pub struct Behind {
    pub version: u64,
    pub complete: bool,
    pub scores: Option<Vec<Scored>>,
    pub diagnosis: Option<Diagnosis>,
    /// RMS on index visits left out.
    pub held_out_rms_um: Option<f64>,
    /// RMS on the last run left out.
    pub later_run_rms_um: Option<f64>,
    /// The verdict in words, as the report has it.
    pub headline: Option<Headline>,
    /// What to do next, the first thing first.
    pub next: Vec<Next>,
    pub ms: f64,
    /// Why there is none.
    pub failed: Vec<Message>,
}

/// A verb that was called from the page.
#[derive(Debug, Clone, Serialize)]
pub struct Job {
    /// `plan-next` or `export`.
    pub verb: &'static str,
    pub version: u64,
    /// Its answer, once it is there.
    pub answered: Option<Answered>,
    /// Why there is none.
    pub failed: Vec<Message>,
}

#[derive(Serialize)]
struct Live<'a> {
    format: &'static str,
    version: u64,
    inputs: u64,
    study: &'a str,
    machine: &'a str,
    effects: &'a [String],
    undo: &'a Option<String>,
    redo: &'a Option<String>,
    fault: Vec<Message>,
    fit_ms: f64,
    rms_um: f64,
    noise_um: f64,
    noise_says: &'a str,
    visit_um: f64,
    chi2_per_dof: f64,
    /// Null where nothing is left over to judge by.
    explained_by_noise: Option<bool>,
    converged: bool,
    touches: usize,
    used: usize,
    unknowns: usize,
    dof: usize,
    parameters: Vec<crate::view::record::ParameterRecord>,
    tolerance: &'a Tolerance,
    undetermined: &'a [Undetermined],
    weak: &'a [Combination],
    correlation: crate::view::record::Correlation,
    warnings: &'a [String],
    /// Measured less model along the outward normal.
    residual_um: Vec<f64>,
    /// Externally studentised.
    standardised: Vec<f64>,
    /// Index among the touches, and why it is not used.
    rejected: Vec<(usize, String)>,
    /// Indices of those that the study itself takes out.
    masked: Vec<usize>,
    /// Share of the residual's variance that goes with each variable, in X, Y and Z (adjusted R²).
    explained: Vec<VariableShare>,
    /// The variable on which the residual depends most.
    axis: Option<String>,
    ladder: &'a History,
    job: Option<&'a Job>,
}

/// What is shown needs no more digits than these.
pub(super) fn short(x: f64, per_unit: f64) -> f64 {
    (x * per_unit).round() / per_unit + 0.0
}

pub(super) fn bytes(record: &impl Serialize) -> Vec<u8> {
    // records of numbers and words always have a JSON
    serde_json::to_vec(record).unwrap_or_else(|_| b"{}".to_vec())
}

/// A row of the table "where the model fails".
#[derive(Serialize)]
struct VariableShare {
    variable: String,
    share: [Option<f64>; 3],
}

/// The rows, and the variable to draw the residual against.
fn explained(now: &Snapshot) -> (Vec<VariableShare>, Option<String>) {
    let points = crate::compare::points(&now.fit);
    let variables = plot_variables(&now.opened.machine, &points);
    let all: Vec<(Explained, VariableKind)> =
        variables.iter().map(|v| (by_direction::explained(&points, &v.id), v.kind)).collect();
    let axis = by_direction::to_draw(&all).map(|i| variables[i].id.clone());
    let rows = variables.into_iter().zip(all);
    let rows = rows.map(|(v, (e, _))| VariableShare {
        variable: v.id,
        share: e.share.map(|share| share.map(|share| short(share, 1e4))),
    });
    (rows.filter(|row| row.share.iter().any(Option::is_some)).collect(), axis)
}

/// What a step changes.
#[must_use]
pub fn live(now: &Snapshot, job: Option<&Job>) -> Vec<u8> {
    let (fit, o) = (&*now.fit, &now.fit.outcome);
    let masks = &now.opened.study.masked;
    let masked: std::collections::HashSet<(usize, u64)> = masks.iter().map(|m| (m.run, m.id)).collect();
    let observations = &fit.data.observations;
    let (explained, axis) = explained(now);
    bytes(&Live {
        format: FORMAT,
        version: now.version,
        inputs: now.inputs,
        study: &now.opened.name(),
        machine: &o.machine,
        effects: &o.effects,
        undo: &now.undo,
        redo: &now.redo,
        fault: now.fault.as_ref().map_or_else(Vec::new, |f| messages(&f.0)),
        fit_ms: now.fit_ms,
        rms_um: o.rms_um,
        noise_um: o.noise_um,
        noise_says: &o.noise_says,
        visit_um: o.visit_um,
        chi2_per_dof: o.chi2_per_dof,
        explained_by_noise: (fit.dof > 0).then(|| o.chi2_per_dof <= fit.noise.limit(fit.dof)),
        converged: o.converged,
        touches: o.touches,
        used: fit.n_used(),
        unknowns: o.unknowns,
        dof: fit.dof,
        parameters: crate::view::results(fit, &now.opened.catalogue, &now.opened.machine, &now.opened.study.tolerance),
        tolerance: &now.opened.study.tolerance,
        undetermined: &o.undetermined,
        weak: &o.weak,
        correlation: crate::view::correlation(fit),
        warnings: &o.warnings,
        residual_um: fit.residual_mm.iter().map(|r| short(um_from_mm(*r), 1e4)).collect(),
        standardised: fit.studentised.iter().map(|s| short(*s, 1e3)).collect(),
        rejected: fit.rejected.iter().map(|(i, why)| (*i, why.says())).collect(),
        masked: (0..observations.len())
            .filter(|&i| masked.contains(&(observations[i].run, observations[i].id)))
            .collect(),
        axis,
        explained,
        ladder: &now.opened.history,
        job,
    })
}

/// What is known of a state behind its fit.
#[must_use]
pub fn evidence(behind: &Behind) -> Vec<u8> {
    bytes(behind)
}

#[derive(Serialize)]
struct Expected {
    version: u64,
    /// What the effect takes away from the residual of each touch, to first order; null where only the fit can say it.
    curve_um: Option<Vec<f64>>,
}

/// What the plot may show while an effect is being fitted: one linear step from the present fit.
#[must_use]
pub fn expected(now: &Snapshot, effect: &str) -> Vec<u8> {
    let opened = &*now.opened;
    let curve = crate::diagnose::taken_away_um(&now.fit, &opened.machine, &opened.catalogue, effect);
    let curve_um = curve.map(|um| um.into_iter().map(|um| short(um, 1e3)).collect());
    bytes(&Expected { version: now.version, curve_um })
}

#[derive(Serialize)]
struct Tried<'a> {
    version: u64,
    effect: &'a str,
    rms_before_um: f64,
    rms_after_um: f64,
    chi2_per_dof: f64,
    parameters: Vec<&'a Parameter>,
    /// What the effect takes away from the residual of each touch.
    curve_um: Vec<f64>,
    row: Option<String>,
    /// What of a formula that was typed may not be meant.
    hints: &'a [draft::Mistake],
}

/// What an effect of the catalogue, or one that was typed, would do at each touch.
///
/// # Errors
/// When it is in the model, is unknown, was typed wrongly, or cannot be fitted.
pub fn tried(now: &Snapshot, shelf: &Shelf, effect: Option<&str>, draft: Option<&Draft>) -> Result<Vec<u8>, Refused> {
    let opened = &*now.opened;
    let typed = match draft {
        Some(draft) => Some(draft::check(draft, &opened.catalogue, &opened.study.effects).map_err(Refused::Mistakes)?),
        None => None,
    };
    let id = typed.as_ref().map(|t| t.id.as_str()).or(effect).ok_or_else(|| {
        Refused::Unusable(Failure::new("workbench::nothing", "no effect is named").help("choose one of the list"))
    })?;
    let mut settings = opened.quick_settings();
    if settings.effects.iter().any(|e| e == id) {
        let says = format!("effect {id:?} is in the model already");
        return Err(Refused::Unusable(Failure::new("study::in_model", says)));
    }
    settings.effects.push(id.to_owned());
    let fit = match (&typed, draft) {
        // what is only typed is in no catalogue, and so on no shelf
        (Some(typed), Some(draft)) => {
            draft::check_values(draft, typed, &opened.machine, &opened.data.observations)?;
            let data = crate::model::data::Data::clone(&opened.data);
            let fitted = fit::identify_data(&opened.machine, &typed.catalogue, data, &settings);
            Arc::new(fitted.map_err(Refused::Unusable)?)
        }
        _ => shelf.fit(opened, now.inputs, settings)?.0,
    };
    let before = &now.fit.residual_mm;
    let own = fit.outcome.parameters.iter().filter(|p| p.effect == id);
    Ok(bytes(&Tried {
        version: now.version,
        effect: draft.map_or(id, |d| d.id.as_str()),
        rms_before_um: now.fit.outcome.rms_um,
        rms_after_um: fit.outcome.rms_um,
        chi2_per_dof: fit.outcome.chi2_per_dof,
        parameters: own.take(12).collect(),
        curve_um: before.iter().zip(&fit.residual_mm).map(|(b, a)| short(um_from_mm(b - a), 1e4)).collect(),
        row: draft.map(draft::row),
        hints: typed.as_ref().map_or(&[], |t| &t.hints),
    }))
}
