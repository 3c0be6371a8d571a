//! Which physical effect is missing, how sure that is, and what to do.
//!
//! [`diagnose`] is a pure function of a fit, the machine and the effects that exist. Gross mistakes are tried first; then
//! every effect that is not in the model is tested from the one fit (`search`), together with shapes that have no name;
//! what passes Holm's test must also predict touches that had no part in its choice; candidates that these touches cannot
//! tell apart stand together; and where nothing fits, the variable is named on which the misfit depends.

pub mod answer;
pub mod evidence;
pub mod features;
mod findings;
pub mod gross;
pub mod named;
pub mod sketch;
mod tell;
mod verdict;
mod words;

use crate::diag::Result;
use crate::fit::{Fit, Settings, identify_data};
use crate::machine::Machine;
use crate::model::catalogue::Catalogue;
use crate::search::dependence::{Dependence, dependences};
use crate::search::generic::{Features, Generics};
use crate::search::groups::Group;
use crate::search::held_out::{Choice, HeldOut, held_out};
use crate::search::{LackOfFit, Search, lack_of_fit};
use crate::units::um_from_mm;
pub use answer::{Diagnosis, Verdict};
use evidence::Evidence;
use named::Named;

/// What is diagnosed.
#[derive(Debug, Clone, Copy)]
pub struct Subject<'a> {
    /// The machine.
    pub machine: &'a Machine,
    /// The effects that exist.
    pub catalogue: &'a Catalogue,
    /// What the fit was asked for: refits ask the same.
    pub settings: &'a Settings,
    /// The fit.
    pub fit: &'a Fit,
}

/// How much is worked out.
#[derive(Debug, Clone, Copy)]
pub struct Options {
    /// Most candidates that are listed.
    pub at_most: usize,
    /// Refit with the first candidate: what remains, and which outliers come back.
    pub refit: bool,
    /// What would have been found.
    pub power: bool,
}

impl Default for Options {
    fn default() -> Self {
        Self { at_most: 5, refit: true, power: true }
    }
}

/// Everything that the answer is made from.
pub struct Examination<'a> {
    /// The regression.
    pub evidence: &'a Evidence,
    /// Effects with a name.
    pub named: &'a Named<'a>,
    /// Their tests.
    pub search: Search<'a>,
    /// What these touches cannot tell apart, best first.
    pub groups: Vec<Group>,
    /// On what the misfit depends, best first.
    pub dependences: Vec<Dependence>,
    /// Against pure error.
    pub lack_of_fit: LackOfFit,
    /// The choice redone without the touches that judge it.
    pub nested: HeldOut,
}

/// The tests of a fit without the answer in words.
#[must_use]
pub fn examine<'a>(
    evidence: &'a Evidence,
    named: &'a Named<'a>,
    features: &Features,
    generics: &Generics,
    at_most: usize,
) -> Examination<'a> {
    let question = evidence.question();
    let search = Search::new(question, &named.library);
    Examination {
        groups: search.groups(at_most),
        dependences: dependences(question, features, generics),
        lack_of_fit: lack_of_fit(&question),
        nested: held_out(question, &named.library, &evidence.visits, Choice::Redone),
        evidence,
        named,
        search,
    }
}

/// The diagnosis of a fit.
///
/// # Errors
/// When a refit is impossible.
pub fn diagnose(subject: Subject, options: &Options) -> Result<Diagnosis> {
    let Subject { machine, catalogue, fit, .. } = subject;
    let evidence = Evidence::of(fit);
    let named = Named::of(fit, &evidence, machine, catalogue);
    let features = features::features(fit, machine);
    let generics = features::shapes(fit, &evidence, &features);
    let seen = examine(&evidence, &named, &features, &generics, options.at_most);
    let verdict = verdict::of(&seen);
    let gross = if fit.outcome.rms_um > gross::GROSS_UM { gross::hypotheses(subject) } else { Vec::new() };
    let mut out = findings::put_together(subject, &seen, &features, verdict, gross, options);
    if options.refit
        && let Some(first) = out.candidates.first_mut()
        && (first.proposed || fit.outcome.rejected.iter().any(|r| !r.reason.starts_with("taken out")))
        && fit.outcome.rms_um <= gross::GROSS_UM
    {
        let again = with_effects(subject, &[first.effect.as_str()])?;
        if first.proposed {
            first.rms_after_um = again.outcome.rms_um;
            first.remains = Some(still_fails(&again, machine, catalogue));
        }
        findings::outliers_again(&mut out, fit, &again);
    }
    verdict::says(&mut out, fit);
    Ok(out)
}

/// The fit with further effects.
///
/// # Errors
/// When an effect is unknown.
pub fn with_effects(subject: Subject, more: &[&str]) -> Result<Fit> {
    let mut settings = subject.settings.clone();
    settings.effects.extend(more.iter().map(|e| (*e).to_owned()));
    settings.reference = Some(subject.fit.model.reference);
    settings.quick = true;
    identify_data(subject.machine, subject.catalogue, subject.fit.data.clone(), &settings)
}

/// Does a fit still miss something, by the tests of the first step?
fn still_fails(fit: &Fit, machine: &Machine, catalogue: &Catalogue) -> bool {
    let evidence = Evidence::of(fit);
    let named = Named::of(fit, &evidence, machine, catalogue);
    let question = evidence.question();
    if Search::new(question, &named.library).leader().is_some() {
        return true;
    }
    let features = features::features(fit, machine);
    let generics = features::shapes(fit, &evidence, &features);
    dependences(question, &features, &generics).iter().any(|d| d.p_adjusted < crate::search::multiplicity::FAMILY_LEVEL)
        || lack_of_fit(&question).p < verdict::LACK_OF_FIT
}

/// Standard deviation of a touch in µm, for figures in units of the noise.
pub(crate) fn noise_um(fit: &Fit) -> f64 {
    um_from_mm(fit.noise.sigma_mm)
}
