//! The verdict: what is decided from tests and held-out touches, and how it is said.

use super::Examination;
use super::answer::{Candidate, Diagnosis, Verdict};
use crate::fit::Fit;
use crate::search::held_out::HeldOut;
use crate::search::multiplicity::FAMILY_LEVEL;

/// The whole misfit against the pure error makes a model fail below this p-value: it sees little of one effect, and must
/// not use up the level of the tests that see more.
pub const LACK_OF_FIT: f64 = 1e-3;

/// Fewer degrees of freedom than this cannot tell an effect from noise.
const LEAST_DOF: usize = 8;

/// With fewer index visits than this each of them bears something that the others do not tell, and the spread of the
/// folds says little: the error may then rise by less than its standard error.
const FEW_VISITS: usize = 15;

/// What was decided.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Decision {
    /// The verdict.
    pub verdict: Verdict,
    /// Does a candidate that passes Holm's test also pass the held-out touches?
    pub borne_out: bool,
}

/// Do held-out touches bear out a choice?
#[must_use]
pub fn bears_out(nested: &HeldOut) -> bool {
    if nested.folds.len() < FEW_VISITS { nested.gain > -nested.standard_error } else { nested.falls() }
}

/// From the tests.
#[must_use]
pub fn of(seen: &Examination) -> Decision {
    let testable = seen.search.scores.iter().any(|s| s.visible());
    if seen.evidence.dof() < LEAST_DOF || !testable {
        return Decision { verdict: Verdict::TooLittleData, borne_out: false };
    }
    let named = seen.search.leader().is_some();
    let generic = seen.dependences.iter().any(|d| d.p_adjusted < FAMILY_LEVEL);
    let borne_out = named && bears_out(&seen.nested);
    let verdict = if borne_out {
        Verdict::MissingEffect
    } else if named || generic || seen.lack_of_fit.p < LACK_OF_FIT {
        Verdict::Unexplained
    } else {
        Verdict::Adequate
    };
    Decision { verdict, borne_out }
}

/// Above this ratio of what is left to the noise nobody calls what is left faint.
const FAINT: f64 = 1.2;

/// Something passed a test and was not borne out, while the noise explains all that is left.
fn faint(out: &Diagnosis, fit: &Fit) -> bool {
    let noise_does = fit.dof > 0 && fit.outcome.chi2_per_dof <= crate::fit::noise::chi2_limit(fit.dof, fit.noise.dof);
    out.verdict == Verdict::Unexplained && noise_does && out.rms_um <= FAINT * out.noise_um
}

/// Says the verdict in a sentence: the terminal, the report and the workbench say it as it is said here.
pub(super) fn says(out: &mut Diagnosis, fit: &Fit) {
    out.faint = faint(out, fit);
    let against = format!("{:.2} um RMS against {:.2} um noise", out.rms_um, out.noise_um);
    out.says = match out.verdict {
        Verdict::Adequate => {
            match out.power.iter().max_by(|a, b| a.minimal_detectable_um.total_cmp(&b.minimal_detectable_um)) {
                Some(_) => format!(
                    "Nothing is missing that these touches can show ({against}; {} effects tested, {} leave no trace in this plan).",
                    out.tested,
                    out.not_seen.len()
                ),
                None => format!("Nothing is missing that these touches can show ({against})."),
            }
        }
        Verdict::TooLittleData => format!(
            "Too few touches to judge: {} touches against {} unknowns. Use a program with more touches, or take effects out of the model.",
            fit.n_used(),
            fit.free.len()
        ),
        Verdict::MissingEffect => out.candidates.first().map_or_else(String::new, |c| missing(c, &against)),
        Verdict::Unexplained if out.faint => {
            let first = out.depends.first().map_or_else(String::new, |w| format!(": {}", w.says));
            format!(
                "The model fits within the noise ({against}), but a faint pattern is left that chance seldom makes{first}. Further \
                 touches would tell whether it is there."
            )
        }
        Verdict::Unexplained => {
            let first = out.depends.first().map_or_else(String::new, |w| format!(" {}.", w.says));
            let gross = out.gross.first().filter(|g| g.rms_um < 0.1 * out.rms_um).map(|g| format!(" {}.", g.says));
            format!("Something is missing ({against}), and no known effect explains it.{}", gross.unwrap_or(first))
        }
    };
}

/// Where many touches found nothing the rest is no sample of the machine: that is the finding, and it is said alone.
pub(super) fn not_when_touches_are_missing(out: &mut Diagnosis, fit: &Fit) {
    let (missed, made) = (fit.data.unusable.len(), fit.data.observations.len() + fit.data.unusable.len());
    if !super::missed::mostly(&fit.data) {
        return;
    }
    out.verdict = Verdict::TooLittleData;
    out.candidates.iter_mut().for_each(|c| c.proposed = false);
    let named: Vec<&super::answer::Gross> = out.gross.iter().filter(|g| g.agrees.is_some()).collect();
    if let Some(first) = named.first() {
        let as_good = named.iter().skip(1).filter(|g| g.agrees == first.agrees).map(|g| g.says.as_str());
        let supposed: Vec<&str> = std::iter::once(first.says.as_str()).chain(as_good).collect();
        out.says = format!(
            "{missed} of {made} touches cannot be used, most of them because the search found nothing. It looks as if {}: that \
             would make {:.0} % of the touches hit or miss as they did. Correct it in the machine file or the log and measure \
             again; nothing can be said about small effects before.",
            supposed.join(", or "),
            100.0 * first.agrees.unwrap_or(0.0)
        );
        return;
    }
    out.says = format!(
        "{missed} of {made} touches cannot be used, most of them because the search found nothing: nothing can be said about small \
         effects. Does an axis count the other way round, are two exchanged, do the blocks stand where the plan says, does the \
         log belong to this plan?"
    );
}

fn missing(c: &Candidate, against: &str) -> String {
    let rest = match c.remains {
        Some(true) => " Something else is missing besides.",
        _ => "",
    };
    let what = if c.same_as.is_empty() {
        format!("Missing: {} ({}).", c.name, c.effect)
    } else {
        format!(
            "Missing: one of {} and {}; these touches cannot tell them apart.",
            c.effect,
            super::words::list(&c.same_as)
        )
    };
    format!("{what} It would bring the error from {against} to {:.2} um.{rest}", c.rms_after_um)
}
