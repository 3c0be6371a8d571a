//! Which physical effect is missing, how sure that is, and what to do.
//!
//! [`diagnose`] is a pure function of a fit, the machine and the effects that exist. Gross mistakes are tried first; then
//! every effect that is not in the model is tested from the one fit (`search`), together with shapes that have no name;
//! what passes Holm's test must also predict touches that had no part in its choice; candidates that these touches cannot
//! tell apart stand together; and where nothing fits, the variable is named on which the misfit depends.

pub mod answer;
mod assemble_diagnosis;
pub mod candidate_effects;
mod clustered_rejections;
pub mod consequence;
mod decide;
mod effect_curve;
mod effects_versus_patterns;
pub mod error_locations;
pub mod evidence;
pub mod features;
mod first_order;
pub mod folds;
mod missed_touches;
pub mod next_step;
mod no_usable_touches;
mod not_identifiable;
pub mod odd_block;
mod other_causes;
mod outlying_groups;
pub mod oversized;
mod pairs;
mod separating_touches;
pub mod setup_mistakes;
pub mod sketch;
pub mod solving;
#[cfg(test)]
mod tests;
mod turning_points;
pub mod unresolved_pairs;
pub mod verdict;
mod visit_scatter;

use crate::design::Planned;
use crate::diag::Result;
use crate::fit::held_out::by_visit;
use crate::fit::{Fit, Reason, Settings, VisitSource, declared_tau_mm, identify_beside, identify_data};
use crate::machine::Machine;
use crate::model::catalogue::Catalogue;
use crate::search::dependence::{Dependence, dependences, depends_on_anything};
use crate::search::groups::{Group, Member};
use crate::search::held_out::{Choice, HeldOut, held_out};
use crate::search::pattern_tests::{Features, Generics};
use crate::search::{LackOfFit, Pair, Score, Search, lack_of_fit};
use crate::units::um_from_mm;
pub use answer::Diagnosis;
use candidate_effects::Named;
use evidence::Evidence;
pub use first_order::taken_away_um;
use nalgebra::DMatrix;
use std::sync::Arc;
pub use verdict::Verdict;
use visit_scatter::Regression;

/// What is diagnosed.
#[derive(Debug, Clone, Copy)]
pub struct Subject<'a> {
    pub machine: &'a Machine,
    /// The effects that exist.
    pub catalogue: &'a Catalogue,
    /// What the fit was asked for: refits ask the same.
    pub settings: &'a Settings,
    pub fit: &'a Fit,
}

/// How much is worked out.
#[derive(Debug, Clone, Copy)]
pub struct Options<'a> {
    /// Most candidates that are listed.
    pub at_most: usize,
    /// Refit with the first candidate: what remains, and which outliers come back.
    pub refit: bool,
    /// What would have been found.
    pub power: bool,
    /// The runs as they were planned: which further touches would tell effects apart is tried on them, and where touches are
    /// missing, which mistake would have made them miss.
    pub planned: Option<&'a [Planned]>,
}

impl Default for Options<'_> {
    fn default() -> Self {
        Self { at_most: 5, refit: true, power: true, planned: None }
    }
}

/// Everything that the answer is made from.
pub(crate) struct Examination<'a> {
    /// The regression.
    pub evidence: &'a Evidence,
    /// Effects with a name.
    pub named: &'a Named<'a>,
    /// Their tests.
    pub search: Search<'a>,
    /// The tests of shapes without a name.
    pub patterns: Search<'a>,
    /// Tests of the effects for sizes and order, where no test passes: with the scatter that is left with the most likely effect.
    ordered: Option<Search<'a>>,
    /// What these touches cannot tell apart, best first.
    pub groups: Vec<Group>,
    /// On what the misfit depends, best first.
    pub dependences: Vec<Dependence>,
    /// Against pure error.
    pub lack_of_fit: LackOfFit,
    /// Where a test passes: what the touches of each index visit say of the choice that is made without them.
    pub nested: Option<HeldOut>,
    /// They do not bear that out, and `nested` is of the first finding behind it that they do bear out by itself.
    pub given: bool,
    /// Two effects that are named together.
    pub both: Option<Pair>,
    /// All scores with the second of them in the model, and with the first.
    beside: Option<[Vec<Score>; 2]>,
}

impl<'a> Examination<'a> {
    /// The tests that sizes and order are of.
    fn order(&self) -> &Search<'a> {
        self.ordered.as_ref().unwrap_or(&self.search)
    }

    /// The scores that sizes of a group's members are of, by the place of the group: of two effects that are named together each is
    /// judged with the other in the model.
    fn scores(&self, place: usize) -> &[Score] {
        let beside = self.beside.as_ref().and_then(|both| both.get(place));
        beside.unwrap_or(&self.order().scores)
    }

    /// What the sizes of a group's member do before whitening, µm per typical size, with the shape that fits best.
    fn raw_um(&self, place: usize, candidate: usize) -> DMatrix<f64> {
        self.named.raw_um(&[(candidate, self.scores(place)[candidate].variant)]).remove(0)
    }

    /// Ids of the effect that is named first, or of the two that are named together.
    fn first_names(&self) -> Vec<&str> {
        let named = if self.both.is_some() { 2 } else { 1 };
        self.groups.iter().take(named).map(|group| self.named.effects[group.first()].id.as_str()).collect()
    }
}

/// The tests of a fit without the answer in words.
fn examine<'a>(
    fit: &Fit,
    found: &'a Regression<'a>,
    search: Search<'a>,
    features: &Features,
    at_most: usize,
) -> Examination<'a> {
    let Regression { evidence, named, generics, .. } = found;
    let question = evidence.question();
    let patterns = Search::new(question, &generics.library);
    let passes = search.leader().is_some();
    let ordered = if passes { None } else { found.search_for_order(fit) };
    let order = ordered.as_ref().unwrap_or(&search);
    let mut groups = order.groups(at_most);
    let nested = passes.then(|| search.held_out(&evidence.visits, Choice::Redone));
    groups.iter_mut().for_each(|group| without_needless_incidents(group, named));
    let behind = nested.as_ref().and_then(|nested| borne_out_behind(&mut groups, &search, &evidence.visits, nested));
    Examination {
        groups,
        ordered,
        dependences: dependences(&patterns, features, generics),
        patterns,
        lack_of_fit: lack_of_fit(&question),
        given: behind.is_some(),
        nested: behind.or(nested),
        both: None,
        beside: None,
        evidence,
        named,
        search,
    }
}

/// Where these touches cannot tell an incident from an effect that it includes and that always acts, only that one is named: an axis
/// whose position was lost before the first touch has another zero position.
fn without_needless_incidents(group: &mut Group, named: &Named) {
    let effect = |m: &Member| named.effects[m.candidate];
    let leader = &named.effects[group.leader].id;
    let always: Vec<&str> = group
        .members
        .iter()
        .map(effect)
        .filter(|e| !e.is_repeated() && !e.is_incident())
        .map(|e| e.id.as_str())
        .collect();
    // a group says of each member that the leader adds nothing after it, and nothing of two others
    let is_needless = |m: &Member| {
        let includes = |id: &&str| effect(m).includes.iter().any(|other| other == id);
        effect(m).is_incident()
            && always.iter().filter(|id| includes(id)).any(|id| *leader == *id || *leader == effect(m).id)
    };
    let needless: Vec<usize> = group.members.iter().filter(|m| is_needless(m)).map(|m| m.candidate).collect();
    group.members.retain(|m| !needless.contains(&m.candidate));
}

/// Where held-out touches do not bear out the first finding, one behind it that they do comes before it: of two effects that act
/// at once the stronger may live in a few visits, and predict none of them from the others.
fn borne_out_behind(groups: &mut [Group], search: &Search, visits: &[usize], nested: &HeldOut) -> Option<HeldOut> {
    /// What comes second by chance is never as sure.
    const SURE: f64 = 1e-4;
    if decide::bears_out(nested) {
        return None;
    }
    for place in 1..groups.len() {
        let candidate = groups[place].first();
        if search.scores[candidate].p_adjusted > SURE || !search.scores[candidate].proposed() {
            continue;
        }
        let own = search.library.only(candidate);
        let mut held = held_out(search.question, &own, visits, Choice::Given(0));
        if held.falls() {
            held.folds.iter_mut().for_each(|f| f.chosen = f.chosen.map(|_| candidate));
            groups[..=place].rotate_right(1);
            return Some(held);
        }
    }
    None
}

/// Scatter of index visits that revisits show, that is far above what the machine file declares, and that nothing else
/// explains: τ and the declared one, mm.
fn scatter(fit: &Fit, machine: &Machine, evidence: &Evidence) -> Option<(f64, f64)> {
    /// Probability of so much scatter where the declared one holds.
    const LEVEL: f64 = 1e-3;
    /// And so many times the declared one, or the noise of a touch where nothing is declared.
    const TIMES: f64 = 2.0;
    let noise = &fit.noise;
    let declared_mm = declared_tau_mm(machine, &fit.data.observations);
    let usual_mm = if declared_mm > 0.0 { declared_mm } else { noise.sigma_mm };
    // where an effect explains it the tests were made with less
    let explained = evidence.tau_mm <= TIMES * usual_mm;
    let dof = noise.visit_dof.filter(|d| noise.visit_source == VisitSource::Revisits && *d > 1.0 && !explained)?;
    let times = noise.tau_mm / usual_mm;
    let p = crate::search::distributions::p_of_chi2(dof * times * times, dof);
    (times > TIMES && p < LEVEL).then_some((noise.tau_mm, declared_mm))
}

/// The diagnosis of a fit.
///
/// # Errors
/// When a refit is impossible.
pub fn diagnose(subject: Subject, options: &Options) -> Result<Diagnosis> {
    if subject.fit.n_used() == 0 {
        return Ok(no_usable_touches::used(subject, options));
    }
    let features = Arc::new(features::features(subject.fit, subject.machine));
    // a second question, with all touches
    if !subject.settings.all_in
        && clustered_rejections::gathered(subject.fit, &features).is_some()
        && let Some(answer) = with_all_touches(subject, options)?
    {
        return Ok(answer);
    }
    let found = Regression::new(subject.fit, subject.machine, subject.catalogue, &features);
    Tested::new(subject, &found, found.search(), &features, options)?.answer()
}

/// A fit with all tests made, and refitted with what they name.
struct Tested<'a> {
    subject: Subject<'a>,
    features: &'a Arc<Features>,
    options: &'a Options<'a>,
    generics: &'a Generics,
    seen: Examination<'a>,
    beside: decide::OtherEvidence,
    decision: decide::Decision,
    refitted: Option<Fit>,
}

impl<'a> Tested<'a> {
    fn new(
        subject: Subject<'a>,
        found: &'a Regression<'a>,
        search: Search<'a>,
        features: &'a Arc<Features>,
        options: &'a Options<'a>,
    ) -> Result<Self> {
        let Subject { machine, fit, .. } = subject;
        let Regression { evidence, named, generics, .. } = found;
        let mut seen = examine(fit, found, search, features, options.at_most);
        let gross = fit.outcome.rms_um > setup_mistakes::GROSS_UM;
        let tried = |names: &[&str]| match tried_with(subject, names) {
            // with so large an error the refit may fail: its names are not proposed
            Err(_) if gross => Ok(None),
            again => again.map(Some),
        };
        let (weighed, first_tried) = match seen.groups.first().filter(|_| seen.nested.is_some()) {
            Some(group) => rayon::join(
                || effects_versus_patterns::weigh(&seen, generics, group.first()),
                // where held-out touches bear the choice out it will most likely be asked for
                || {
                    let borne_out = options.refit && seen.nested.as_ref().is_some_and(decide::bears_out);
                    borne_out.then(|| tried(&seen.first_names()))
                },
            ),
            None => (effects_versus_patterns::Weighed::default(), None),
        };
        let mut beside = decide::OtherEvidence {
            shapes_win: weighed.shapes_win,
            // a shape that goes with the first by probability says nothing against the one that is borne out behind it
            better: weighed.better.filter(|_| !seen.given).map(|shape| generics.shapes[shape].depends_on.clone()),
            gathered: clustered_rejections::gathered(fit, features),
            scatter: scatter(fit, machine, evidence),
        };
        let mut decision = decide::decide(&seen, &beside);
        // names are not proposed where their refit raises the error
        let refused = |again: &Option<Fit>| again.as_ref().is_none_or(|again| raises_the_error(fit, again));
        let mut refitted = None;
        if let Some(pair) = pairs::both(subject, &seen, &decision) {
            let (groups, scores) = pairs::in_front(&seen, &pair, options.at_most);
            let names = groups[..2].iter().map(|group| &*named.effects[group.first()].id).collect::<Vec<_>>();
            let again = if options.refit { tried(&names)? } else { None };
            if !options.refit || !refused(&again) {
                (seen.groups, seen.beside) = (groups, Some(scores));
                seen.groups.iter_mut().for_each(|group| without_needless_incidents(group, named));
                (seen.both, seen.given) = (Some(pair), true);
                (beside.shapes_win, beside.better) = (false, None);
                decision = decide::Decision { kind: decide::Kind::MissingEffect, confirmed: true, named: true };
                refitted = again;
            }
        }
        if seen.both.is_none() && options.refit && decision.confirmed {
            let again = first_tried.unwrap_or_else(|| tried(&seen.first_names()))?;
            if refused(&again) {
                (decision.kind, decision.confirmed) = (decide::Kind::Unexplained, false);
            }
            refitted = again;
        }
        // with a gross error the answer reports set-up mistakes first, and not what the refit leaves
        refitted = refitted.filter(|_| !gross);
        Ok(Self { subject, features, options, generics, seen, beside, decision, refitted })
    }

    /// May what is named first bring the error down to the noise? Unknown where nothing was refitted on purpose.
    fn may_explain(&self) -> bool {
        if !self.options.refit || self.subject.fit.outcome.rms_um > setup_mistakes::GROSS_UM {
            return true;
        }
        let again = self.refitted.as_ref().filter(|_| self.decision.confirmed);
        again.is_some_and(|again| explains(self.subject.fit, again.outcome.rms_um))
    }

    /// The answer in words and figures.
    fn answer(self) -> Result<Diagnosis> {
        let Self { subject, features, options, generics, seen, beside, decision, refitted } = self;
        let Subject { machine, catalogue, fit, .. } = subject;
        let mut gross = if fit.outcome.rms_um > setup_mistakes::GROSS_UM {
            setup_mistakes::hypotheses(subject)
        } else {
            Vec::new()
        };
        if let Some(supposed) = setup_mistakes::of_log(subject) {
            gross.retain(|g| g.hypothesis != supposed.hypothesis);
            gross.insert(0, supposed);
        } else if let Some(planned) = options.planned.filter(|_| fit.data.mostly_missed()) {
            let missed = missed_touches::hypotheses(subject, planned);
            gross.retain(|g| missed.iter().all(|m| m.hypothesis != g.hypothesis));
            gross.splice(0..0, missed);
        }
        let may_refit = options.refit && fit.outcome.rms_um <= setup_mistakes::GROSS_UM;
        let has_outliers = fit.rejected.values().any(Reason::is_outlier);
        let leading = seen.groups.first().map(|group| seen.named.effects[group.first()].id.as_str());
        // worked out at the same time as the answer: what the refit still misses and its sizes, or a refit that shows which outliers
        // come back
        let of_refit = || match &refitted {
            Some(again) => {
                // the fit first: it is one long piece, and the tests are many short ones
                let whole = || beside_its_shapes(subject, again, &seen.first_names());
                let (whole, remains) = rayon::join(whole, || Some(still_fails(again, machine, catalogue)));
                (remains, whole, None)
            }
            None if may_refit && has_outliers => (None, None, leading.map(|id| (id, tried_with(subject, &[id])))),
            None => (None, None, None),
        };
        let (mut out, (remains, whole, tried)) = rayon::join(
            || assemble_diagnosis::put_together(subject, &seen, features, (decision, &beside), gross, options),
            of_refit,
        );
        if out.mistake().is_none() {
            let gathered = beside.gathered.is_some();
            out.consequences = consequence::consequences(subject, &seen, generics, (&out.verdict, gathered))?;
        }
        if may_refit
            && let Some(first) = out.candidates.first_mut()
            && (first.proposed || has_outliers)
        {
            let again = match (refitted, tried) {
                (Some(again), _) if first.proposed => again,
                (_, Some((id, again))) if id == first.effect => again?,
                _ => tried_with(subject, &[first.effect.as_str()])?,
            };
            if first.proposed {
                first.remains = remains.or_else(|| Some(still_fails(&again, machine, catalogue)));
                let mut proposed: Vec<&mut answer::Candidate> =
                    out.candidates.iter_mut().filter(|c| c.proposed).collect();
                proposed.iter_mut().for_each(|c| c.rms_after_um = again.outcome.rms_um);
                if let Some(whole) = whole {
                    proposed.iter_mut().for_each(|c| assemble_diagnosis::sizes_of_refit(c, &whole));
                }
            }
            assemble_diagnosis::outliers_again(&mut out, fit, &again);
        }
        turning_points::say(subject, &mut out.candidates);
        decide::where_most_touches_are_unusable(&mut out, subject);
        not_identifiable::where_nothing_is_determined(&mut out, subject);
        out.oversized = oversized::oversized(fit, machine, catalogue);
        out.says = crate::words::diagnose::verdict(&out, fit);
        Ok(out)
    }
}

/// Does the error of the touches that a fit uses grow with the effects that another one has besides?
fn raises_the_error(before: &Fit, after: &Fit) -> bool {
    let squares = |fit: &Fit| -> f64 {
        fit.residual_mm.iter().zip(&before.weight).filter(|(_, weight)| **weight > 0.0).map(|(r, _)| r * r).sum()
    };
    squares(after) > squares(before)
}

/// The answer with all touches in, where touches that were not used lie together and one effect explains them as well: the touches
/// of the only index position at another feed are not bad touches.
fn with_all_touches(subject: Subject, options: &Options) -> Result<Option<Diagnosis>> {
    let Subject { machine, catalogue, .. } = subject;
    let settings = Settings { all_in: true, ..subject.settings.clone() };
    let fit = identify_data(machine, catalogue, subject.fit.data.clone(), &settings)?;
    let features = Arc::new(features::features(&fit, machine));
    let found = Regression::new(&fit, machine, catalogue, &features);
    let search = found.search();
    // a set-up mistake is no effect of the catalogue, and is tried where the error is gross
    if fit.outcome.rms_um <= setup_mistakes::GROSS_UM && !could_explain(&found.named, &search) {
        return Ok(None);
    }
    let subject_of_all = Subject { settings: &settings, fit: &fit, ..subject };
    let tested = Tested::new(subject_of_all, &found, search, &features, options)?;
    // most of the answer is worked out only where it can be one
    if !tested.may_explain() {
        return Ok(None);
    }
    let mut answer = tested.answer()?;
    // by the noise of the touches that agree: what lies on a face in some repeats and not in others is no noise of the probe
    if !answer.candidates.first().is_some_and(|c| c.proposed && explains(subject.fit, c.rms_after_um)) {
        return Ok(None);
    }
    answer.outliers = assemble_diagnosis::outliers(subject.fit);
    assemble_diagnosis::outliers_again(&mut answer, subject.fit, &fit);
    answer.all_touches = Some(answer::AllTouches {
        put_back: fit.n_used().saturating_sub(subject.fit.n_used()),
        rms_um: answer.rms_um,
        held_out_rms_um: answer.held_out_rms_um,
    });
    // the model's own figures are those of the touches that it uses, as in every other answer
    let held_out = by_visit(subject.fit);
    answer.rms_um = subject.fit.outcome.rms_um;
    answer.held_out_rms_um = held_out.as_ref().map(|h| h.rms_um);
    answer.held_out_se_um = held_out.and_then(|h| h.standard_error_um);
    answer.says = crate::words::diagnose::verdict(&answer, &fit);
    Ok(Some(answer))
}

/// Is there an effect, or a pair that would be named together, that may bring the error down to the noise? Linear tests say so but for
/// shapes: a refit may find a better value than those of the scan, and may change shapes that are not scanned.
fn could_explain(named: &Named, search: &Search) -> bool {
    /// Part of the residual by which a better value of a scanned shape may explain more.
    const MORE: f64 = 0.05;
    let question = search.question;
    let has_other_shapes = |c: usize| {
        let shapes = named.effects[c].parameters.iter().filter(|p| p.shape.is_some()).count();
        shapes > usize::from(named.scanned[c].is_some())
    };
    if search.scores.iter().any(|s| s.proposed() && has_other_shapes(s.candidate)) {
        return true;
    }
    let gained = search.scores.iter().map(|s| s.delta_ss).fold(pairs::gained(search), f64::max);
    (1.0 - MORE) * lack_of_fit(&question).ss - gained <= TIMES_NOISE.powi(2) * question.residual.len() as f64
}

/// An error that comes down to so many times the noise is explained.
const TIMES_NOISE: f64 = 1.25;

/// Does an error that is left come down to the noise of a fit?
fn explains(fit: &Fit, rms_um: f64) -> bool {
    rms_um <= TIMES_NOISE * noise_um(fit)
}

/// The fit with further effects.
///
/// # Errors
/// When an effect is unknown.
pub fn with_effects(subject: Subject, more: &[&str]) -> Result<Fit> {
    let settings = settings_with(subject, more);
    identify_data(subject.machine, subject.catalogue, subject.fit.data.clone(), &settings)
}

/// A trial of it: shapes of the model begin where the fit has them, and stay where it holds them.
///
/// # Errors
/// When an effect is unknown.
fn tried_with(subject: Subject, more: &[&str]) -> Result<Fit> {
    identify_beside(subject.fit, subject.machine, subject.catalogue, &settings_with(subject, more))
}

/// The whole fit with more effects, where a trial fit with them has found shapes of theirs: it says how sure their sizes are beside
/// unknown shapes.
fn beside_its_shapes(subject: Subject, again: &Fit, more: &[&str]) -> Option<Fit> {
    if !again.model.unknowns.iter().any(|u| u.shape && more.contains(&u.effect.as_str())) {
        return None;
    }
    let settings = Settings { quick: false, bare: true, ..settings_with(subject, more) };
    identify_beside(again, subject.machine, subject.catalogue, &settings).ok()
}

fn settings_with(subject: Subject, more: &[&str]) -> Settings {
    let mut settings = subject.settings.clone();
    settings.effects.extend(more.iter().map(|e| (*e).to_owned()));
    settings.reference = Some(subject.fit.model.reference);
    settings.quick = true;
    settings
}

/// Does a fit still miss something, by the tests of the first step, or because touches that it does not use lie together?
fn still_fails(fit: &Fit, machine: &Machine, catalogue: &Catalogue) -> bool {
    let features = Arc::new(features::features(fit, machine));
    if clustered_rejections::gathered(fit, &features).is_some() {
        return true;
    }
    let found = Regression::new(fit, machine, catalogue, &features);
    let question = found.evidence.question();
    if found.search().leader().is_some() {
        return true;
    }
    depends_on_anything(question, &found.generics) || lack_of_fit(&question).p < decide::LACK_OF_FIT
}

/// Is the scatter of index positions named first?
fn scatter_leads(depends: &[answer::Where]) -> bool {
    depends.first().is_some_and(|w| w.finding == answer::Finding::Scatter)
}

/// Standard deviation of a touch in µm, for figures in units of the noise.
pub(crate) fn noise_um(fit: &Fit) -> f64 {
    um_from_mm(fit.noise.sigma_mm)
}
