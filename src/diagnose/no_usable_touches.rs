//! A study of which no touch is used: there is nothing to search in, and nothing to be said but that.

use super::answer::{Diagnosis, FORMAT};
use super::verdict::{TooLittle, Verdict};
use super::{Options, Subject, decide, missed_touches, noise_um, setup_mistakes};

/// The answer, before any search.
pub(super) fn used(subject: Subject, options: &Options) -> Diagnosis {
    let fit = subject.fit;
    let planned = options.planned.filter(|_| fit.data.mostly_missed());
    let mut out = Diagnosis {
        format: FORMAT,
        verdict: Verdict::TooLittleData(TooLittle::NoneUsed { excluded: fit.data.observations.len() }),
        rms_um: fit.outcome.rms_um,
        noise_um: noise_um(fit),
        visit_source: fit.noise.visit_source,
        noise_says: fit.noise.says(),
        lack_of_fit_p: 1.0,
        gross: match setup_mistakes::of_log(subject) {
            Some(supposed) => vec![supposed],
            None => planned.map(|p| missed_touches::hypotheses(subject, p)).unwrap_or_default(),
        },
        ..Diagnosis::default()
    };
    decide::where_most_touches_are_unusable(&mut out, subject);
    out.says = crate::words::diagnose::verdict(&out, fit);
    out
}
