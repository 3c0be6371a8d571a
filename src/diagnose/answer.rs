//! What a diagnosis says (`axiscal-diagnosis/1`).

use super::verdict::{NotNamed, Verdict};
use crate::fit::VisitSource;
use serde::Serialize;

/// The format line of a diagnosis.
pub const FORMAT: &str = "axiscal-diagnosis/1";

/// The model on all touches, those that are not used included.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct AllTouches {
    /// Touches that were put back.
    pub put_back: usize,
    /// √(Σr²/n) over all touches, µm.
    pub rms_um: f64,
    /// Cross-validated error, µm.
    pub held_out_rms_um: Option<f64>,
}

/// The answer of `diagnose`.
#[derive(Debug, Clone, Default, Serialize)]
pub struct Diagnosis {
    /// `axiscal-diagnosis/1`
    pub format: &'static str,
    /// Is something missing?
    #[serde(flatten)]
    pub verdict: Verdict,
    /// The verdict in a sentence.
    pub says: String,
    /// √(Σr²/n) over the touches used, µm.
    pub rms_um: f64,
    /// Cross-validated error of the model (`fit::held_out::by_visit`), µm: the same figure as in every other answer.
    pub held_out_rms_um: Option<f64>,
    /// Standard error of that, µm.
    pub held_out_se_um: Option<f64>,
    /// Where the question was asked with the touches that are not used put back: the candidates are judged on all of them.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub all_touches: Option<AllTouches>,
    /// Standard deviation of a touch, µm.
    pub noise_um: f64,
    /// The probe's declared repeatability, µm, where repeats scatter by far more: what makes them scatter counts as noise.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub declared_noise_um: Option<f64>,
    /// Scatter of index visits that the tests allow for, µm.
    pub visit_um: f64,
    /// What the axes declare, µm, where the residuals make the tests allow for far more: an effect may be hidden in it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub declared_visit_um: Option<f64>,
    /// Where the scatter of index positions comes from.
    pub visit_source: VisitSource,
    /// Noise and scatter of visits with their sources, in a sentence.
    pub noise_says: String,
    /// Probability of so much misfit where the model holds.
    pub lack_of_fit_p: f64,
    /// On what the misfit depends, best first.
    #[serde(rename = "where")]
    pub depends: Vec<Where>,
    /// The misfit against the variable that it depends on.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub shape: Option<Shape>,
    /// Effects that may be missing, best first, one per group that these touches cannot tell apart.
    pub candidates: Vec<Candidate>,
    /// Suppositions that were tried because the error is gross, best first.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub gross: Vec<Gross>,
    /// Touches that were not used, and what became of them with the first candidate in the model.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub outliers: Vec<Outlier>,
    /// How many effects were tested.
    pub tested: usize,
    /// Effects that were tested and not found, and from which size on these touches would have shown them.
    pub power: Vec<Power>,
    /// Effects that go with the temperature, where no touch carries one: they may act, and nothing here shows it.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub needs_temperature: Vec<String>,
    /// Effects that leave no trace in these touches.
    pub not_seen: Vec<String>,
    /// By how much each result could be wrong because of what is missing.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub consequences: Vec<super::consequence::Consequence>,
    /// Parameters of the model that are far larger than usual, the largest in usual sizes first.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub oversized: Vec<super::oversized::Oversized>,
    /// What is left open, for a further program.
    #[serde(skip)]
    pub open: super::unresolved_pairs::Open,
    /// Remarks.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub warnings: Vec<String>,
}

impl Diagnosis {
    /// Are there effects of which these touches cannot say which one acts, or whether it does? A further program shows it.
    #[must_use]
    pub fn leaves_open(&self) -> bool {
        matches!(self.verdict, Verdict::MissingEffect(_) | Verdict::Unexplained(_)) && !self.open.suspects.is_empty()
    }

    /// What is proposed: one effect, or two that are named together.
    #[must_use]
    pub fn proposed(&self) -> &[Candidate] {
        let first = self.candidates.first().filter(|first| first.proposed);
        // behind a set-up mistake an effect may stand as well: that is no pair
        let second = self
            .candidates
            .get(1)
            .filter(|second| first.is_some_and(|f| f.together_with.as_ref() == Some(&second.effect)));
        &self.candidates[..usize::from(first.is_some()) + usize::from(second.is_some())]
    }

    /// The effect that passes the test with all candidates counted in and that unused measurements do not confirm.
    #[must_use]
    pub fn in_question(&self) -> Option<&Candidate> {
        let not_confirmed = self
            .verdict
            .unexplained()
            .is_some_and(|u| matches!(u.why, NotNamed::NotConfirmed | NotNamed::CannotBeConfirmed(_)));
        let asked = not_confirmed && self.leaves_open() && self.mistake().is_none();
        let passes = |c: &&Candidate| !c.proposed && c.p_adjusted < crate::search::multiplicity::FAMILY_LEVEL;
        self.candidates.first().filter(|_| asked).filter(passes)
    }

    /// The gross mistake that must be put right before anything smaller can be spoken of: an axis that counts the wrong
    /// way round, other units, a log of something else, or touches most of which found nothing.
    #[must_use]
    pub fn mistake(&self) -> Option<String> {
        if self.verdict.most_touches_unusable() {
            let named = self.gross.iter().find(|g| g.in_place.is_some()).map(|g| g.says.clone());
            let none = || "most touches found nothing".to_owned();
            return Some(self.candidates.first().map(|c| c.name.clone()).or(named).unwrap_or_else(none));
        }
        let rms_um = self.all_touches.map_or(self.rms_um, |all| all.rms_um);
        let right = |g: &&Gross| g.rms_um < super::setup_mistakes::RIGHT * rms_um;
        let elsewhere = |g: &&Gross| g.hypothesis == super::setup_mistakes::ELSEWHERE;
        let found = self.gross.first().filter(right).or_else(|| self.gross.iter().find(elsewhere));
        found.map(|g| g.says.clone())
    }
}

/// On what the misfit depends.
#[derive(Debug, Clone, Serialize)]
pub struct Where {
    /// `pose.C`, `axis.X`, `time`, `block`, …
    pub by: String,
    /// Share of the misfit that goes with it.
    pub share: f64,
    /// Family-wise probability of so much where nothing is missing.
    pub p_adjusted: f64,
    /// In a sentence.
    pub says: String,
    /// The generic shape that shows it best.
    pub id: String,
    /// The same variable as shapes call it.
    #[serde(skip)]
    pub on: String,
    /// What shows it.
    #[serde(skip)]
    pub finding: Finding,
}

/// What shows on what the residuals depend.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Finding {
    /// The test of a pattern.
    Pattern,
    /// The formula of the first candidate.
    Effect,
    /// Index positions scatter by more than the axes declare.
    Scatter,
    /// Outliers that lie together.
    Outliers,
}

/// The misfit against a variable: what of it the model cannot follow, about its mean over the touches. A level is no finding:
/// the set-ups take it.
#[derive(Debug, Clone, Serialize)]
pub struct Shape {
    /// Which variable, as in `where`.
    pub by: String,
    /// Unit of x; `1` for groups of touches, which are numbered.
    pub x_unit: String,
    pub y_unit: String,
    /// Direction in which it acts.
    pub direction: String,
    /// Values of the variable.
    pub x: Vec<f64>,
    /// The misfit.
    pub y: Vec<f64>,
    /// Half the width of its 95 % band.
    pub band: Vec<f64>,
    /// Names of the groups of touches that x numbers, where it numbers groups.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub labels: Vec<String>,
    /// Block whose touches it is of, where it is of one alone.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub block: Option<String>,
    /// What kind of thing does that.
    pub kind: String,
}

/// An effect that may be missing.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct Candidate {
    /// Its id.
    pub effect: String,
    /// Name for people.
    pub name: String,
    /// Probability of so much misfit in its direction where nothing is missing.
    pub p: f64,
    /// The same, with all effects that were tested counted in (Holm).
    pub p_adjusted: f64,
    /// Does it pass Holm's test, and do the held-out touches bear it out?
    pub proposed: bool,
    /// RMS with it in the model, µm.
    pub rms_after_um: f64,
    /// Cross-validated error of the model without it, µm: the model's one figure.
    pub held_out_before_um: Option<f64>,
    /// The same with it, on the same touches; they had no part in its choice where `nested` says so.
    pub held_out_after_um: Option<f64>,
    /// Standard error of the difference of the two, µm.
    pub held_out_se_um: Option<f64>,
    /// Was the choice redone for each group of touches left out? Else the effect was given.
    pub nested: bool,
    /// Expected sizes of what these touches can tell.
    pub parameters: Vec<Parameter>,
    /// Parameters that these touches cannot tell: they have no size here.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub not_told: Vec<String>,
    /// By how much it moves the touch that it moves most, µm: the size of all its parameters together.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub moves_um: Option<f64>,
    /// Standard uncertainty of that, µm.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub moves_sigma_um: Option<f64>,
    /// Effects that these touches cannot tell from it.
    pub same_as: Vec<String>,
    /// Another effect that is named together with it: no one effect explains what both do.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub together_with: Option<String>,
    /// What else would do the same to these touches and is no effect with a name.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub or_else: Option<String>,
    /// Which touches would tell them apart.
    pub tell_apart: String,
    /// No touches that this machine can make tell the first two apart, whatever else may.
    #[serde(skip)]
    pub never_parted: bool,
    pub says: String,
    /// Where to look on the machine and how to confirm it.
    pub look: String,
    /// What usually makes it far larger than machines have it.
    #[serde(skip_serializing_if = "String::is_empty")]
    pub too_large: String,
    /// Share of the misfit's sum of squares that it takes away.
    pub share: f64,
    /// The largest expected size, in usual sizes.
    pub times_usual: f64,
    /// Are the expected sizes usual ones?
    pub plausible: bool,
    /// Parameters that are positive by nature (lost motion, sag) and would be negative: only a compensation that is set too
    /// far does that.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub wrong_sign: Vec<String>,
    /// Parameters of the model that it makes more than three times less certain.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub weakens: Vec<Weakened>,
    /// Does the model still fail with it?
    #[serde(skip_serializing_if = "Option::is_none")]
    pub remains: Option<bool>,
}

/// An expected size.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Parameter {
    pub name: String,
    /// Expected value.
    pub value: f64,
    /// Its unit.
    pub unit: String,
    /// Standard uncertainty; null for a value that was picked from a scan.
    pub sigma: Option<f64>,
}

impl Candidate {
    /// Are its sizes those beside one value of a shape that was scanned?
    #[must_use]
    pub fn is_beside_a_shape(&self) -> bool {
        self.parameters.iter().any(|p| p.sigma.is_none())
    }
}

/// A parameter that an added effect makes less certain.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Weakened {
    pub name: String,
    /// Its unit.
    pub unit: String,
    /// Standard uncertainty without the effect.
    pub sigma_before: f64,
    pub sigma_after: f64,
}

/// A supposition about a gross mistake.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Gross {
    /// What was supposed: `flip_B`, `swap_XY`, `inch`, …
    pub hypothesis: String,
    /// In words.
    pub says: String,
    /// RMS if it is true, µm.
    pub rms_um: f64,
    /// Where most touches are missing: share of the hits and misses that are as it would make them.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub agrees: Option<f64>,
    /// Where touches of the log are far from their places: share of all touches that would be where they belong.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub in_place: Option<f64>,
}

/// A touch that was not used.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Outlier {
    /// Number in the plan.
    pub id: u64,
    /// Which run of the study, from 1.
    pub run: usize,
    /// Why.
    pub reason: String,
    /// The block as it stood.
    pub block: String,
    pub face: String,
    /// True where it belongs to the rest once the first candidate is in the model.
    pub comes_back: bool,
}

/// What would have been found.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Power {
    pub effect: String,
    /// From this size on (peak over the touches, µm) it would have been found nearly always.
    pub minimal_detectable_um: f64,
}

#[cfg(test)]
pub(crate) mod tests {
    use super::super::next_step::MachineCheck;
    use super::super::verdict::Unexplained;
    use super::*;

    pub(crate) fn candidate(effect: &str, p_adjusted: f64, held_out: Option<f64>, same_as: &[&str]) -> Candidate {
        Candidate {
            effect: effect.into(),
            name: effect.into(),
            p: p_adjusted,
            p_adjusted,
            rms_after_um: 1.0,
            held_out_before_um: held_out,
            held_out_after_um: held_out,
            nested: true,
            same_as: same_as.iter().map(|s| (*s).to_owned()).collect(),
            share: 0.9,
            times_usual: 1.0,
            plausible: true,
            ..Candidate::default()
        }
    }

    fn diagnosis(why: NotNamed, candidates: Vec<Candidate>) -> Diagnosis {
        Diagnosis {
            verdict: Verdict::Unexplained(Unexplained { why, check: MachineCheck::NoFormula, sketchable: true }),
            rms_um: 5.0,
            noise_um: 1.0,
            candidates,
            tested: 50,
            ..Diagnosis::default()
        }
    }

    #[test]
    fn what_passes_and_is_not_confirmed_is_in_question() {
        let mut d = diagnosis(NotNamed::NotConfirmed, vec![candidate("a", 1e-9, Some(2.0), &[])]);
        assert!(d.in_question().is_none(), "nothing is open");
        d.open.suspects.push(crate::design::questions::Suspect {
            id: "a".into(),
            size: nalgebra::DVector::from_element(1, 1.0),
            shape: None,
        });
        assert!(d.in_question().is_some_and(|c| c.effect == "a"));
        d.verdict = Verdict::Unexplained(Unexplained {
            why: NotNamed::WeakPattern,
            check: MachineCheck::NoFormula,
            sketchable: true,
        });
        assert!(d.in_question().is_none());
    }
}
