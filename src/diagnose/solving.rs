//! The loop of `solve`: diagnose, add an effect, fit again. It ends on a model that was fitted and diagnosed, and its verdict is
//! never worse than that of a model before it.
//!
//! What a step does to the study, and who agrees to it, is up to the [`Host`].

use super::answer::{Candidate, Diagnosis};
use super::next_step::{MachineCheck, NextStep};
use super::verdict::{NotNamed, Unexplained, Verdict};
use super::{Options, Subject, diagnose};
use crate::diag::Result;
use crate::fit::outcome::{Parameter, Status};
use crate::fit::{Fit, Settings, held_out};
use crate::machine::Machine;
use crate::model::catalogue::Catalogue;
use crate::search::distributions::{ln_p_of_f, p_of_chi2};
use nalgebra::DMatrix;
use serde::Serialize;

/// What is to be solved.
#[derive(Clone, Copy)]
pub struct Request<'a> {
    pub machine: &'a Machine,
    /// The effects that exist.
    pub catalogue: &'a Catalogue,
    /// What the first model is.
    pub settings: &'a Settings,
    /// Fits a model to the touches.
    pub fit: &'a dyn Fn(&Settings) -> Result<Fit>,
    /// How each model is diagnosed.
    pub options: Options<'a>,
    /// Most effects that are added.
    pub at_most: usize,
    /// A proposal may have so many times its usual size.
    pub at_most_size: f64,
}

/// A model, fitted and diagnosed.
#[derive(Debug)]
pub struct State {
    pub fit: Fit,
    /// What its diagnosis says.
    pub found: Diagnosis,
}

/// How a model of the loop did.
#[derive(Debug, Clone, Serialize)]
pub struct Visited {
    /// Ids of its effects.
    pub effects: Vec<String>,
    /// The verdict of its diagnosis.
    #[serde(flatten)]
    pub verdict: Verdict,
    /// RMS of the residuals, µm.
    pub rms_um: f64,
    /// Reduced chi-square.
    pub chi2_per_dof: f64,
    /// Cross-validated error, µm.
    pub held_out_rms_um: Option<f64>,
}

/// An effect that was added.
#[derive(Debug, Clone)]
pub struct Added {
    /// The effect that is in the model.
    pub id: String,
    /// The proposal that it was taken from.
    pub proposal: Candidate,
    /// A shape without a name described it better.
    pub name_in_doubt: bool,
    /// RMS before and after, µm.
    pub rms_um: (f64, f64),
}

/// Why the loop ended.
#[derive(Debug, Clone)]
pub enum Stop {
    /// A set-up mistake comes first.
    Mistake(String),
    /// A proposal would need more times its usual size than it may have.
    TooLarge(String),
    /// As many effects were added as were asked for.
    AtMost(usize),
    /// The fit with the effect that was added last is not credible.
    Refused(Refusal),
    /// The user said no.
    ByUser,
    /// What is left is as small as the noise.
    Faint,
    /// An effect passes the test and is not confirmed on unused touches.
    InQuestion(Box<Candidate>),
    /// No known effect explains what is left; it can be sketched as a formula.
    Sketchable,
    /// No known effect explains what is left: what to check at the machine.
    Unexplained(MachineCheck),
    /// Too few touches to judge.
    TooLittleData,
    /// Something is missing, and no proposal is confirmed.
    NotConfirmed,
    /// Nothing is missing that these touches can show.
    Nothing,
}

/// Why an effect was not kept after its fit.
#[derive(Debug, Clone, PartialEq)]
pub enum Refusal {
    /// A size of it is so many times what such an effect usually has.
    TooLarge {
        effect: String,
        parameter: String,
        /// Times its usual size.
        times: f64,
    },
    /// A size of it cannot be separated from that of another effect that was added.
    Together {
        effect: String,
        other: String,
        parameters: [String; 2],
        /// Correlation of the two.
        r: f64,
    },
}

/// Why effects leave the model.
#[derive(Debug, Clone, PartialEq)]
pub enum Why {
    /// Its fit is not credible.
    Refused(Refusal),
    /// The last model's verdict is worse than the first one's.
    Worse,
    /// The model without it is as good.
    Idle(AsGood),
}

/// A change of the model.
#[derive(Debug, Clone, PartialEq)]
pub enum Change {
    /// An effect is added; its cross-validated error where the choice was redone for each fold, µm.
    Add(String, Option<f64>),
    /// Effects are removed.
    Remove(Vec<String>, Why),
}

/// Who agrees to the steps, and where the model is kept.
pub trait Host {
    /// A model was fitted and diagnosed; so many effects were added before.
    ///
    /// # Errors
    /// The host's own.
    fn looked(&mut self, state: &State, added: &[Added]) -> Result<()>;
    /// Which effect is added; `None` ends the loop.
    ///
    /// # Errors
    /// When nobody can answer.
    fn agree(&mut self, proposal: &Candidate) -> Result<Option<String>>;
    /// The model is changed.
    ///
    /// # Errors
    /// When it cannot be written.
    fn change(&mut self, change: &Change, added: &[Added]) -> Result<()>;
}

/// How the loop ended.
#[derive(Debug)]
pub struct Ending {
    /// The last model.
    pub state: State,
    /// Every model that was in force, the first one first and the last one last.
    pub models: Vec<Visited>,
    /// Effects that were added and are in the model.
    pub added: Vec<Added>,
    /// Effects that were added and removed because the model without them is as good.
    pub dropped: Vec<String>,
    /// Effects that were added and removed because the fit with them is not credible, or ended in something unexplained.
    pub taken_back: Vec<String>,
    /// Why it ended.
    pub stop: Stop,
}

impl State {
    fn badness(&self) -> u8 {
        self.found.verdict.badness()
    }

    fn visited(&self) -> Visited {
        let o = &self.fit.outcome;
        Visited {
            effects: o.effects.clone(),
            verdict: self.found.verdict.clone(),
            rms_um: o.rms_um,
            chi2_per_dof: o.chi2_per_dof,
            held_out_rms_um: self.found.held_out_rms_um,
        }
    }
}

impl Request<'_> {
    fn settings_of(&self, effects: &[String]) -> Settings {
        Settings { effects: effects.to_vec(), ..self.settings.clone() }
    }

    fn diagnosed(&self, fit: Fit) -> Result<State> {
        let settings = Settings { quick: true, ..self.settings_of(&fit.outcome.effects) };
        let subject = Subject { machine: self.machine, catalogue: self.catalogue, settings: &settings, fit: &fit };
        let found = diagnose(subject, &self.options)?;
        Ok(State { fit, found })
    }
}

/// Runs the loop.
///
/// # Errors
/// When a fit is impossible, or the host ends it.
pub fn solve(request: Request, host: &mut dyn Host) -> Result<Ending> {
    let mut effects = request.settings.effects.clone();
    let mut state = request.diagnosed((request.fit)(request.settings)?)?;
    let mut first = None;
    let mut models = vec![state.visited()];
    let (mut added, mut taken_back, mut dropped): (Vec<Added>, Vec<String>, Vec<String>) = Default::default();
    let stop = loop {
        host.looked(&state, &added)?;
        let proposal = match proposed(&state.found, added.len(), &request) {
            Ok(proposal) => proposal.clone(),
            Err(stop) => break stop,
        };
        let Some(id) = host.agree(&proposal)? else { break Stop::ByUser };
        host.change(&Change::Add(id.clone(), proposal.held_out_after_um.filter(|_| proposal.nested)), &added)?;
        let more = [&effects[..], std::slice::from_ref(&id)].concat();
        let after = (request.fit)(&request.settings_of(&more))?;
        let ids: Vec<&str> = added.iter().map(|a| a.id.as_str()).chain([id.as_str()]).collect();
        if let Some(refusal) = refused(&after, &ids, request.at_most_size) {
            host.change(&Change::Remove(vec![id.clone()], Why::Refused(refusal.clone())), &added)?;
            taken_back.push(id);
            break Stop::Refused(refusal);
        }
        added.push(Added {
            proposal,
            id,
            name_in_doubt: state.found.verdict.name_in_doubt(),
            rms_um: (state.fit.outcome.rms_um, after.outcome.rms_um),
        });
        effects = more;
        let before = std::mem::replace(&mut state, request.diagnosed(after)?);
        first.get_or_insert(before);
        models.push(state.visited());
    };
    // names that end in something unexplained were names for a part of it, and may all be wrong
    if let Some(first) = first.filter(|first| first.badness() < state.badness()) {
        let ids: Vec<String> = added.iter().map(|a| a.id.clone()).collect();
        host.change(&Change::Remove(ids.clone(), Why::Worse), &added)?;
        taken_back.extend(ids);
        added.clear();
        state = first;
        models.push(state.visited());
    }
    // the last one was needed a moment ago
    for at in (0..added.len().saturating_sub(1)).rev() {
        let id = added[at].id.clone();
        let fewer: Vec<String> = state.fit.outcome.effects.iter().filter(|e| **e != id).cloned().collect();
        let without = (request.fit)(&request.settings_of(&fewer))?;
        let Some(as_good) = as_good(&without, &state.fit) else { continue };
        let without = request.diagnosed(without)?;
        if without.badness() > state.badness() {
            continue;
        }
        host.change(&Change::Remove(vec![id], Why::Idle(as_good)), &added)?;
        dropped.push(added.remove(at).id);
        state = without;
        models.push(state.visited());
    }
    Ok(Ending { state, models, added, dropped, taken_back, stop })
}

/// The effect that is proposed next, or why the loop ends.
fn proposed<'d>(found: &'d Diagnosis, added: usize, request: &Request) -> std::result::Result<&'d Candidate, Stop> {
    if let Some(mistake) = found.mistake() {
        return Err(Stop::Mistake(mistake));
    }
    // of two effects that are named together one is added, and the other one is judged again
    let first = if let NextStep::Add(clear) = found.next_step() { Some(clear) } else { found.candidates.first() };
    match (&found.verdict, first) {
        (Verdict::MissingEffect(_), Some(first)) if first.proposed => {
            if first.times_usual > request.at_most_size {
                Err(Stop::TooLarge(first.effect.clone()))
            } else if added >= request.at_most {
                Err(Stop::AtMost(added))
            } else {
                Ok(first)
            }
        }
        (Verdict::MissingEffect(_), _) => Err(Stop::NotConfirmed),
        (Verdict::Unexplained(Unexplained { why: NotNamed::WeakPattern, .. }), _) => Err(Stop::Faint),
        (Verdict::Unexplained(_), Some(first)) if found.in_question().is_some() => {
            Err(Stop::InQuestion(Box::new(first.clone())))
        }
        (Verdict::Unexplained(u), _) if u.sketchable => Err(Stop::Sketchable),
        (Verdict::Unexplained(u), _) => Err(Stop::Unexplained(u.check.clone())),
        (Verdict::TooLittleData(_), _) => Err(Stop::TooLittleData),
        (Verdict::Adequate, _) => Err(Stop::Nothing),
    }
}

/// A model with fewer effects beside the one with all of them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AsGood {
    /// Probability of so much a rise of chi-square where the effect is not there.
    pub p: f64,
    /// By how much the cross-validated error falls with the effect, and the standard error of that, µm.
    pub fall_um: (f64, f64),
}

/// An effect whose removal makes chi-square rise by what chance makes at least as often is not needed by the touches.
const IDLE_P: f64 = 0.05;

/// Is a model as good as one with a further effect? Chi-square must not rise by more than chance makes, and the cross-validated
/// error by no more than its standard error.
fn as_good(without: &Fit, with: &Fit) -> Option<AsGood> {
    let p = p_without(without, with);
    if p <= IDLE_P {
        return None;
    }
    let errors = (held_out::by_visit(without)?, held_out::by_visit(with)?);
    let (fall, se) = held_out::fall(&errors.0, &errors.1, &with.data.visits)?;
    (fall <= se).then_some(AsGood { p, fall_um: (fall, se) })
}

/// Probability of the rise of chi-square without an effect. Both models are held against the noise of the one with it, over the touches
/// that it uses: without the effect the noise, and the touches that are left out, may have taken in what is missing.
fn p_without(without: &Fit, with: &Fit) -> f64 {
    let whitening = with.whitening(with.noise.tau_mm);
    let chi2 = |fit: &Fit| -> f64 {
        let mut rows = DMatrix::from_column_slice(fit.residual_mm.len(), 1, &fit.residual_mm);
        whitening.apply(&mut rows);
        let priors = fit.priors.iter().map(|&(i, value, sigma)| ((fit.theta[i] - value) / sigma).powi(2));
        rows.norm_squared() + priors.sum::<f64>()
    };
    let (own, rise) = (chi2(with), (chi2(without) - chi2(with)).max(0.0));
    let q = with.observability.rank.saturating_sub(without.observability.rank);
    if q == 0 {
        return if rise > 1e-9 * own { 0.0 } else { 1.0 };
    }
    let (q, dof) = (q as f64, with.dof as f64);
    let of_noise = match with.noise.dof {
        Some(nu) => ln_p_of_f(rise, q, nu, nu).exp(),
        None => p_of_chi2(rise, q),
    };
    // a declared noise may be far larger than what the touches scatter
    let of_residual = if dof < 1.0 { 1.0 } else { ln_p_of_f(rise, q, own, dof).exp() };
    of_noise.min(of_residual)
}

/// Sizes of two added effects that go together like this are those of two names for one thing, or of two that cancel.
const TOGETHER: f64 = 0.99;

/// Why a model with these added effects is not to be believed, after the full fit.
fn refused(fit: &Fit, added: &[&str], at_most_size: f64) -> Option<Refusal> {
    // where a combination leaves no trace the values of its members are a convention, and no sizes
    let is_told = |i: usize| {
        let u = &fit.model.unknowns[i];
        let is = |p: &Parameter| p.name == u.name && p.effect == u.effect && p.status == Status::Identified;
        fit.outcome.parameters.iter().any(is)
    };
    let of: Vec<usize> = fit
        .free
        .iter()
        .copied()
        .filter(|&i| added.contains(&fit.model.unknowns[i].effect.as_str()) && !fit.model.unknowns[i].shape)
        .filter(|&i| is_told(i))
        .collect();
    let last = added.last()?;
    for &i in of.iter().filter(|&&i| fit.model.unknowns[i].effect == *last) {
        let u = &fit.model.unknowns[i];
        let times = (fit.theta[i] / u.typical).abs();
        let sure = fit.theta[i].abs() > 2.0 * fit.covariance[(i, i)].max(0.0).sqrt();
        if u.typical > 0.0 && sure && times > at_most_size {
            return Some(Refusal::TooLarge { effect: (*last).to_owned(), parameter: u.name.clone(), times });
        }
    }
    for (k, &i) in of.iter().enumerate() {
        for &j in &of[..k] {
            let (a, b) = (&fit.model.unknowns[i], &fit.model.unknowns[j]);
            let scale = (fit.covariance[(i, i)] * fit.covariance[(j, j)]).max(0.0).sqrt();
            let r = if scale > 0.0 { fit.covariance[(i, j)] / scale } else { 0.0 };
            if a.effect != b.effect && r.abs() > TOGETHER {
                let other = if a.effect == *last { &b.effect } else { &a.effect };
                return Some(Refusal::Together {
                    effect: (*last).to_owned(),
                    other: other.clone(),
                    parameters: [a.name.clone(), b.name.clone()],
                    r,
                });
            }
        }
    }
    None
}
