//! The verdict: what is decided from tests and held-out touches, and how it is said.

use super::Examination;
use super::answer::{Candidate, Diagnosis, Verdict};
use super::clustered_rejections::Gathered;
use crate::fit::Fit;
use crate::model::data::UnusableReason;
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
        return Decision { verdict: Verdict::TooLittleData, borne_out: false, named: false };
    }
    let named = seen.search.leader().is_some();
    let generic = seen.dependences.iter().any(|d| d.p_adjusted < FAMILY_LEVEL);
    let borne_out = named && bears_out(&seen.nested) && !beside.shapes_win;
    let other = beside.gathered.is_some() || beside.scatter.is_some();
    let verdict = if borne_out {
        Verdict::MissingEffect
    } else if named || generic || other || seen.lack_of_fit.p < LACK_OF_FIT {
        Verdict::Unexplained
    } else {
        Verdict::Adequate
    };
    Decision { verdict, borne_out, named }
}

/// Above this ratio of what is left to the noise nobody calls what is left faint.
const FAINT: f64 = 1.2;

/// What chance makes less often than this is no matter of chance, however small it is beside the noise.
const CHANCE: f64 = 1e-3;

/// Share of what is left that a form must explain beyond a name to speak against it.
const WORTH_SAYING: f64 = 0.01;

/// Something passed a test and was not borne out, while the noise explains all that is left and chance might have made it.
fn faint(out: &Diagnosis, fit: &Fit) -> bool {
    let tests = out.candidates.iter().map(|c| c.p_adjusted).chain(out.depends.iter().map(|w| w.p_adjusted));
    if tests.fold(1.0, f64::min) < CHANCE {
        return false;
    }
    let noise_does = fit.dof > 0 && fit.outcome.chi2_per_dof <= fit.noise.limit(fit.dof);
    out.verdict == Verdict::Unexplained && noise_does && out.rms_um <= FAINT * out.noise_um
}

/// Says the verdict in a sentence: the terminal, the report and the workbench say it as it is said here.
pub(super) fn says(out: &mut Diagnosis, subject: super::Subject, decision: Decision, beside: &OtherEvidence) {
    let fit = subject.fit;
    out.faint = beside.gathered.is_none() && beside.scatter.is_none() && faint(out, fit);
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
        Verdict::MissingEffect => {
            let named = out.candidates.first().map_or_else(String::new, |c| missing(c, &against));
            let better = beside.better.as_ref().and_then(|on| out.depends.iter().find(|w| w.on == *on));
            // what rounds to nothing is said of no name
            let worth = |w: &&super::answer::Where| {
                let own =
                    out.candidates.first().filter(|c| crate::words::diagnose::speaks_of(subject, &c.effect, &w.on));
                own.is_none_or(|c| w.share - c.share >= WORTH_SAYING)
            };
            let better = better.filter(worth).map_or_else(String::new, |w| {
                // what depends on the effect's own variable has the same words: what counts is what goes beyond it
                let own = out.candidates.first().filter(|c| crate::words::diagnose::speaks_of(subject, &c.effect, &w.on));
                match own {
                    Some(c) => format!(
                        " Another form of the same dependence describes it better: {:.0} % more of what is left goes with {} \
                         than {} takes, so that the name may be wrong or not all.",
                        100.0 * (w.share - c.share),
                        crate::words::diagnose::plain(&w.by),
                        c.effect
                    ),
                    None => format!(
                        " A shape without a name describes it better, so that the name may be wrong: {}.",
                        w.says
                    ),
                }
            });
            out.name_in_doubt = !better.is_empty();
            named + &better
        }
        Verdict::Unexplained if out.faint => {
            let first = out.depends.first().map_or_else(String::new, |w| format!(": {}", w.says));
            format!(
                "The model fits within the noise ({against}), but a faint pattern is left that chance seldom makes{first}. Further \
                 touches would tell whether it is there."
            )
        }
        Verdict::Unexplained => {
            let first = out.depends.first().map_or_else(String::new, |w| format!(" {}.", w.says));
            let gross = out
                .gross
                .first()
                .filter(|g| g.rms_um < super::setup_mistakes::RIGHT * out.rms_um)
                .map(|g| format!(" {}.", g.says));
            let one = out.candidates.first().map_or_else(
                || "an effect".to_owned(),
                |c| match &c.same_as[..] {
                    [] => c.effect.clone(),
                    [other] => format!("{} or {other}", c.effect),
                    others => format!("{} or one of {} others", c.effect, others.len()),
                },
            );
            let share = out.candidates.first().map_or(0.0, |c| c.share);
            let part = format!("{:.0} %", (100.0 * share).round());
            let scatter_first = super::scatter_leads(out);
            match (beside.scatter.filter(|_| scatter_first), decision.named, beside.shapes_win) {
                (Some(_), false, _) => format!("{}. {against}.", out.depends.first().map_or("", |w| w.says.as_str())),
                (_, true, true) => format!(
                    "Something is missing ({against}), and no known effect explains it: {one} would take {part} of it, but {}.{}",
                    // the first shape may take less than the effect: what was weighed is what either side comes to in the end
                    if out.depends.first().is_some_and(|w| w.share > share) {
                        "a shape without a name describes it clearly better"
                    } else {
                        "what is left beside it has no name, and shapes without one describe the whole clearly better"
                    },
                    gross.unwrap_or(first)
                ),
                (_, true, false) if gross.is_none() => format!(
                    "Something is missing ({against}). {one} passes the test, but touches that had no part in choosing it are \
                     not predicted better with it, so that nothing is named.{first} More index visits would tell."
                ),
                _ => format!(
                    "Something is missing ({against}), and no known effect explains it{}.{}",
                    fit.noise
                        .or_the_probe(fit.outcome.chi2_per_dof.sqrt())
                        .map_or_else(String::new, |or| format!("; {or}")),
                    gross.unwrap_or(first)
                ),
            }
        }
    };
}

/// Where many touches found nothing the rest is no sample of the machine: that is the finding, and it is said alone.
pub(super) fn not_when_touches_are_missing(out: &mut Diagnosis, subject: super::Subject) {
    let fit = subject.fit;
    let (missed, made) = (fit.data.unusable.len(), fit.data.observations.len() + fit.data.unusable.len());
    if !fit.data.mostly_missed() {
        return;
    }
    (out.most_missed, out.faint) = (true, false);
    (out.verdict, out.shape) = (Verdict::TooLittleData, None);
    // what was said of small effects was said of a sample that is none
    out.candidates.clear();
    out.depends.clear();
    out.power.clear();
    out.not_seen.clear();
    out.outliers.clear();
    out.consequences.clear();
    (out.moved_block, out.sketchable) = (None, false);
    out.faces.clear();
    out.blocks.clear();
    if let Some((s, first)) = fit.data.supposed.as_ref().zip(out.gross.first()) {
        let says = &first.says;
        out.says = format!(
            "{} of {} touches are far from their places. It looks as if {says}: that would put {} of them where they belong. \
             Correct it in the machine file or the log and measure again; nothing can be said about small effects before.",
            s.far, s.of, s.right
        );
        out.candidates.extend(super::setup_mistakes::of_misses(subject, &[first]));
        out.verdict = Verdict::MissingEffect;
        return;
    }
    let named: Vec<&super::answer::Gross> = out.gross.iter().filter(|g| g.agrees.is_some()).collect();
    if let Some(first) = named.first() {
        let alike: Vec<&super::answer::Gross> = named.iter().copied().filter(|g| g.agrees == first.agrees).collect();
        let supposed: Vec<&str> = alike.iter().map(|g| g.says.as_str()).collect();
        out.candidates.extend(super::setup_mistakes::of_misses(subject, &alike));
        out.verdict = Verdict::MissingEffect;
        out.says = format!(
            "{missed} of {made} touches cannot be used, most of them because the search found nothing. It looks as if {}: that \
             would make {:.0} % of the touches hit or miss as they did. Correct it in the machine file or the log and measure \
             again; nothing can be said about small effects before.",
            supposed.join(", or "),
            100.0 * first.agrees.unwrap_or(0.0)
        );
        return;
    }
    let far = fit.data.unusable.iter().filter(|u| u.reason == UnusableReason::FarFromPlan).count();
    let why = if 2 * far > missed { "they are far from their places" } else { "the search found nothing" };
    out.says = format!(
        "{missed} of {made} touches cannot be used, most of them because {why}: nothing can be said about small effects. Does an axis count the other way round, are two exchanged, do the blocks stand where the plan says, does the \
         log belong to this plan?"
    );
}

fn missing(c: &Candidate, against: &str) -> String {
    let rest = match c.remains {
        Some(true) => " Something else is missing besides.",
        _ => "",
    };
    let what = if c.same_as.is_empty() {
        match &c.or_else {
            Some(other) => format!("Missing: {} ({}), or {other}: these touches cannot tell.", c.name, c.effect),
            None => format!("Missing: {} ({}).", c.name, c.effect),
        }
    } else {
        let other = c.or_else.as_ref().map_or_else(String::new, |other| format!(", or {other}"));
        format!(
            "Missing: {}{other}; these touches cannot tell them apart.",
            crate::words::diagnose::one_of(&c.effect, &c.same_as)
        )
    };
    format!("{what} It would bring the error from {against} to {:.2} um.{rest}", c.rms_after_um)
}
