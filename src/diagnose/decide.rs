//! Decides the verdict from tests, unused measurements and what else the touches show.

use super::answer::{Candidate, Diagnosis, Gross, Where};
use super::clustered_rejections::Gathered;
use super::next_step::MachineCheck;
use super::verdict::{Missing, NameDoubt, NotNamed, TooLittle, Unexplained, Verdict};
use super::{Examination, Subject, noise_um, scatter_leads, setup_mistakes};
use crate::model::data::UnusableReason;
use crate::search::held_out::HeldOut;
use crate::search::multiplicity::FAMILY_LEVEL;
use crate::words::diagnose as words;

/// The whole misfit against the pure error makes a model fail below this p-value: it sees little of one effect, and must
/// not use up the level of the tests that see more.
pub const LACK_OF_FIT: f64 = 1e-3;

/// Fewer degrees of freedom than this cannot tell an effect from noise.
const LEAST_DOF: usize = 8;

/// With fewer index visits than this each of them bears something that the others do not tell, and the spread of the
/// folds says little: the error may then rise by less than its standard error.
const FEW_VISITS: usize = 15;

/// What the tests decide.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Kind {
    Adequate,
    MissingEffect,
    Unexplained,
    TooFewTouches,
}

/// What was decided.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Decision {
    /// The kind of verdict.
    pub kind: Kind,
    /// Do unused measurements confirm a candidate that passes Holm's test?
    pub confirmed: bool,
    /// Does one pass Holm's test at all?
    pub named: bool,
}

/// What else the touches say, beside the tests of effects.
#[derive(Debug, Clone, Default)]
pub(super) struct OtherEvidence {
    /// Shapes without a name say what is left clearly better than names do.
    pub shapes_win: bool,
    /// What the best shape depends on, where it is better than the first effect.
    pub better: Option<String>,
    /// Touches that were not used and lie together.
    pub gathered: Option<Gathered>,
    /// Scatter of index visits that nothing explains, and the declared one, mm.
    pub scatter: Option<(f64, f64)>,
}

/// Do held-out touches bear out a choice? With many visits their error must fall by more than its standard error, with
/// few it must not rise by as much: the report then says that they speak neither for nor against it.
#[must_use]
pub fn bears_out(nested: &HeldOut) -> bool {
    if nested.folds.len() < FEW_VISITS { nested.gain > -nested.standard_error } else { nested.falls() }
}

/// From the tests.
#[must_use]
pub(super) fn decide(seen: &Examination, beside: &OtherEvidence) -> Decision {
    let testable = seen.search.scores.iter().any(|s| s.visible());
    if seen.evidence.dof() < LEAST_DOF || !testable {
        return Decision { kind: Kind::TooFewTouches, confirmed: false, named: false };
    }
    let named = seen.nested.is_some();
    let generic = seen.dependences.iter().any(|d| d.p_adjusted < FAMILY_LEVEL);
    let confirmed = seen.nested.as_ref().is_some_and(bears_out) && !beside.shapes_win;
    let other = beside.gathered.is_some() || beside.scatter.is_some();
    let kind = if confirmed {
        Kind::MissingEffect
    } else if named || generic || other || seen.lack_of_fit.p < LACK_OF_FIT {
        Kind::Unexplained
    } else {
        Kind::Adequate
    };
    Decision { kind, confirmed, named }
}

/// Above this ratio of the residual to the noise a pattern is not weak.
const WEAK: f64 = 1.2;

/// What chance makes less often than this is no matter of chance, however small it is beside the noise.
const CHANCE: f64 = 1e-3;

/// Share of the residual that a pattern must explain beyond an effect to put its name in doubt.
const WORTH_SAYING: f64 = 0.01;

/// What the verdict is made from.
pub(super) struct Findings<'a> {
    pub subject: Subject<'a>,
    pub decision: Decision,
    pub beside: &'a OtherEvidence,
    pub candidates: &'a [Candidate],
    pub depends: &'a [Where],
    pub gross: &'a [Gross],
    pub check: MachineCheck,
    pub sketchable: bool,
}

impl Findings<'_> {
    pub fn verdict(self, kind: Kind) -> Verdict {
        match kind {
            Kind::Adequate => Verdict::Adequate,
            Kind::TooFewTouches => Verdict::TooLittleData(TooLittle::FewTouches {
                used: self.subject.fit.n_used(),
                unknowns: self.subject.fit.free.len(),
            }),
            Kind::MissingEffect => Verdict::MissingEffect(Missing::Effect(self.name_doubt())),
            Kind::Unexplained => {
                let why = self.not_named();
                let check = match self.check {
                    MachineCheck::NoFormula if why == NotNamed::WeakPattern => MachineCheck::WeakPattern,
                    other => other,
                };
                Verdict::Unexplained(Unexplained { why, check, sketchable: self.sketchable })
            }
        }
    }

    fn not_named(&self) -> NotNamed {
        let Self { decision, beside, candidates, depends, .. } = self;
        if self.is_weak() {
            NotNamed::WeakPattern
        } else if beside.scatter.is_some() && scatter_leads(depends) && !decision.named {
            NotNamed::Scatter
        } else if decision.named && beside.shapes_win {
            let share = candidates.first().map_or(0.0, |c| c.share);
            NotNamed::PatternExplainsMore { alone: depends.first().is_some_and(|w| w.share > share) }
        } else if !decision.named || self.is_mistaken() {
            NotNamed::NoEffectPasses
        } else {
            match cannot_be_confirmed(candidates) {
                none if none.is_empty() => NotNamed::NotConfirmed,
                effects => NotNamed::CannotBeConfirmed(effects),
            }
        }
    }

    /// Does a set-up mistake explain the residuals?
    fn is_mistaken(&self) -> bool {
        self.gross.first().is_some_and(|g| g.rms_um < setup_mistakes::RIGHT * self.subject.fit.outcome.rms_um)
    }

    /// Something passed a test and was not confirmed, while the noise explains the residuals and chance might have made it.
    fn is_weak(&self) -> bool {
        let fit = self.subject.fit;
        let tests = || {
            let candidates = self.candidates.iter().map(|c| c.p_adjusted);
            candidates.chain(self.depends.iter().map(|w| w.p_adjusted)).fold(1.0, f64::min)
        };
        let noise_does = || fit.dof > 0 && fit.outcome.chi2_per_dof <= fit.noise.limit(fit.dof);
        self.beside.gathered.is_none()
            && self.beside.scatter.is_none()
            && tests() >= CHANCE
            && noise_does()
            && fit.outcome.rms_um <= WEAK * noise_um(fit)
    }

    fn name_doubt(&self) -> Option<NameDoubt> {
        let on = self.beside.better.as_ref()?;
        let pattern = self.depends.iter().find(|w| w.on == *on)?;
        // a pattern that explains less is not better: it only has fewer parameters
        if self.candidates.first().is_some_and(|c| c.share >= pattern.share) {
            return None;
        }
        // where the pattern depends on the effect's own variable, only what it explains beyond the effect counts
        let own = self.candidates.first().filter(|c| words::speaks_of(self.subject, &c.effect, &pattern.on));
        match own {
            None => Some(NameDoubt::Pattern(pattern.says.clone())),
            Some(c) => {
                let more = pattern.share - c.share;
                (more >= WORTH_SAYING).then(|| NameDoubt::OtherForm { by: pattern.by.clone(), more })
            }
        }
    }
}

/// The effects that pass their test where no touch can be predicted without its own pose: nothing confirms or refutes them.
fn cannot_be_confirmed(candidates: &[Candidate]) -> Vec<String> {
    let open = |c: &&Candidate| c.p_adjusted < FAMILY_LEVEL && !is_cross_validated(c);
    let mut out: Vec<String> = Vec::new();
    if !candidates.first().is_some_and(|c| open(&c) && !c.proposed) {
        return out;
    }
    for id in candidates.iter().filter(open).flat_map(|c| std::iter::once(&c.effect).chain(&c.same_as)) {
        if !out.contains(id) {
            out.push(id.clone());
        }
    }
    out
}

/// Could a candidate be tried on unused measurements? Of a few poses none can be predicted from the others.
fn is_cross_validated(c: &Candidate) -> bool {
    match (c.held_out_before_um, c.held_out_after_um) {
        (Some(before), Some(after)) => before.is_finite() && after.is_finite() && (before > 0.0 || after > 0.0),
        _ => false,
    }
}

/// Where many touches found nothing the rest is no sample of the machine: that alone is the finding.
pub(super) fn where_most_touches_are_unusable(out: &mut Diagnosis, subject: Subject) {
    let data = &subject.fit.data;
    let (unusable, of) = (data.unusable.len(), data.observations.len() + data.unusable.len());
    if !data.mostly_missed() {
        return;
    }
    // small effects were looked for in touches that are no sample
    out.shape = None;
    out.candidates.clear();
    out.depends.clear();
    out.power.clear();
    out.not_seen.clear();
    out.outliers.clear();
    out.consequences.clear();
    if let Some((s, first)) = data.supposed.as_ref().zip(out.gross.first()) {
        let mistake = first.says.clone();
        out.candidates.extend(setup_mistakes::of_misses(subject, &[first]));
        out.verdict = Verdict::MissingEffect(Missing::TouchesFarOff { far: s.far, of: s.of, right: s.right, mistake });
        return;
    }
    let named: Vec<&Gross> = out.gross.iter().filter(|g| g.agrees.is_some()).collect();
    if let Some(first) = named.first() {
        let alike: Vec<&Gross> = named.iter().copied().filter(|g| g.agrees == first.agrees).collect();
        out.candidates.extend(setup_mistakes::of_misses(subject, &alike));
        out.verdict = Verdict::MissingEffect(Missing::TouchesMissed {
            unusable,
            of,
            mistakes: alike.iter().map(|g| g.says.clone()).collect(),
            agrees: first.agrees.unwrap_or(0.0),
        });
        return;
    }
    let far = data.unusable.iter().filter(|u| u.reason == UnusableReason::FarFromPlan).count();
    out.verdict = Verdict::TooLittleData(TooLittle::MostUnusable { unusable, of, far: 2 * far > unusable });
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnose::answer::tests::candidate;

    #[test]
    fn what_cannot_be_tried_is_not_refuted() {
        // no figure, no number, 0 against 0: no touch could be predicted without its pose
        for held_out in [None, Some(f64::NAN), Some(0.0)] {
            let all = [
                candidate("a", 1e-9, held_out, &["b", "c"]),
                candidate("d", 1e-3, held_out, &["b"]),
                candidate("e", 0.4, held_out, &[]),
            ];
            assert_eq!(cannot_be_confirmed(&all), ["a", "b", "c", "d"]);
        }
        // tried and not confirmed: no known effect explains it
        assert!(cannot_be_confirmed(&[candidate("a", 1e-9, Some(2.0), &[])]).is_empty());
        assert!(cannot_be_confirmed(&[candidate("a", 0.2, None, &[])]).is_empty());
    }
}
