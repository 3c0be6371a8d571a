//! What a person looks at, as one record (`axiscal-view/1`): the report, the workbench and the plots draw it and nothing
//! else.
//!
//! Nothing is computed here that a room above could say: [`gather`] takes a fit, its comparison, its diagnosis and its
//! ladder, and puts beside each other what belongs together, in the words and units that are shown.

mod machine;
pub(crate) mod parameters;
pub mod record;
mod touches;

pub use crate::words::headline::{Headline, Level};
pub use crate::words::next_steps::{Act, Next};
pub use parameters::{correlation, results};
pub use record::View;

use crate::compare::Comparison;
use crate::compare::model_ladder::{Kind, Ladder};
use crate::diagnose::Diagnosis;
use crate::fit::Fit;
use crate::machine::Machine;
use crate::model::catalogue::Catalogue;
use crate::program::plan::Plan;
use crate::study::tolerance::Tolerance;
use crate::tables::Correction;
use crate::units::um_from_mm;
use crate::words::{command, headline, next_steps};
use record::{Errors, RunRecord, StudyRecord};
use std::path::Path;

/// The format line of a view.
pub const FORMAT: &str = "axiscal-view/1";

/// A run, as a reader finds it again.
#[derive(Debug, Clone)]
pub struct RunFiles<'a> {
    /// The plan's file, as the study names it.
    pub plan: &'a str,
    /// The log's file, as the study names it.
    pub log: &'a str,
    pub controller: &'a str,
    /// The plan itself.
    pub touches: &'a Plan,
}

/// What the verdict and the steps are made from.
#[derive(Debug, Clone, Copy)]
pub struct Material<'a> {
    /// The study's file name, as a user would type it.
    pub study: &'a str,
    /// Its path as the caller of the program typed it.
    pub path: &'a Path,
    /// The machines file that the study names.
    pub machines_file: Option<&'a str>,
    /// SHA-256 of the study and all that it names.
    pub sha256: &'a str,
    /// Day of the data, YYYY-MM-DD.
    pub date: &'a str,
    pub machine: &'a Machine,
    /// The effects that exist.
    pub catalogue: &'a Catalogue,
    pub runs: &'a [RunFiles<'a>],
    /// The study's tolerance.
    pub tolerance: &'a Tolerance,
    /// The fit of the study's model.
    pub fit: &'a Fit,
    /// The fit with what the diagnosis proposes.
    pub proposed: Option<&'a Fit>,
    /// What is missing.
    pub diagnosis: &'a Diagnosis,
    /// What a compensation would carry, or why none can be made.
    pub correction: Result<&'a Correction, &'a str>,
}

/// Everything that a view is made from.
#[derive(Debug, Clone, Copy)]
pub struct ViewMaterial<'a> {
    pub verdict: Material<'a>,
    /// Where the model fails.
    pub comparison: &'a Comparison,
    /// The models on these touches.
    pub ladder: &'a Ladder,
}

impl<'a> std::ops::Deref for ViewMaterial<'a> {
    type Target = Material<'a>;

    fn deref(&self) -> &Material<'a> {
        &self.verdict
    }
}

/// The verdict in words and what to do about it, the first thing first.
#[must_use]
pub fn verdict_and_steps(m: &Material) -> (Headline, Vec<Next>) {
    let parameters = parameters::parameters(m, m.fit);
    let compensation = parameters::compensation(m);
    let headline = headline::headline(m, &parameters, &compensation);
    let next = next_steps::next(m, &headline, &parameters, &compensation);
    (headline, next)
}

/// Puts a view together.
#[must_use]
pub fn gather(m: &ViewMaterial) -> View {
    let fit = m.fit;
    let parameters = parameters::parameters(m, fit);
    let compensation = parameters::compensation(m);
    let (headline, next) = verdict_and_steps(m);
    let at = |kind: Kind| m.ladder.rungs.iter().position(|r| r.kind == kind);
    let (before, after) = match (at(Kind::Current), at(Kind::Proposed)) {
        (Some(current), Some(proposed)) => (current, proposed),
        // nothing is proposed: the machine as it stands against the study's model
        (Some(current), None) => (0, current),
        _ => (0, 0),
    };
    View {
        format: FORMAT,
        program: format!("axiscal {}", env!("CARGO_PKG_VERSION")),
        study: StudyRecord {
            name: m.study.to_owned(),
            sha256: m.sha256.to_owned(),
            commands_run_in: command::run_in(m.path),
            date: m.date.to_owned(),
            effects: fit.outcome.effects.clone(),
            runs: m
                .runs
                .iter()
                .map(|r| RunRecord {
                    plan: r.plan.to_owned(),
                    program: r.touches.program.clone(),
                    log: r.log.to_owned(),
                    controller: r.controller.to_owned(),
                    touches: r.touches.touches.len(),
                })
                .collect(),
        },
        headline,
        next,
        errors: Errors {
            before,
            after,
            noise_um: um_from_mm(fit.noise.sigma_mm),
            noise_says: fit.outcome.noise_says.clone(),
            chi2_per_dof: fit.outcome.chi2_per_dof,
            rms_um: fit.outcome.rms_um,
            held_out_rms_um: fit.outcome.held_out_rms_um,
            touches: fit.data.observations.len() + fit.data.unusable.len(),
            used: fit.n_used(),
            unknowns: fit.free.len(),
            dof: fit.dof,
            converged: fit.outcome.converged,
        },
        parameters,
        proposed: m.proposed.map(|fit| parameters::parameters(m, fit)).unwrap_or_default(),
        tolerance: m.tolerance.clone(),
        ladder: touches::rungs(m),
        ladder_notes: m.ladder.notes.clone(),
        diagnosis: record::diagnosis(m),
        splits: m.comparison.splits.clone(),
        comparison_says: m.comparison.says.clone(),
        correlation: parameters::correlation(fit),
        undetermined: fit.outcome.undetermined.clone(),
        weak: fit.outcome.weak.clone(),
        warnings: fit.outcome.warnings.clone(),
        compensation,
        machine: machine::machine(m),
        touches: touches::touches(m),
        unusable: touches::unusable(m),
        variables: touches::variables(m),
        curves: touches::curves(m, before, after),
    }
}
