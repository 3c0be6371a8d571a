//! A study of which no touch is used: there is nothing to search in, and nothing to be said but that.

use super::answer::{Diagnosis, FORMAT, Verdict};
use super::unresolved_pairs::Open;
use super::{Options, Subject, missed_touches, noise_um, setup_mistakes, verdict};

/// The answer, before any search.
pub(super) fn used(subject: Subject, options: &Options) -> Diagnosis {
    let fit = subject.fit;
    let planned = options.planned.filter(|_| fit.data.mostly_missed());
    let n = fit.data.observations.len();
    let mut out = Diagnosis {
        format: FORMAT,
        verdict: Verdict::TooLittleData,
        says: format!(
            "Too few touches to judge: none is used{}. Take touches back in, or measure again.",
            if n == 0 { String::new() } else { format!(", all {n} are taken out") }
        ),
        sketchable: false,
        moved_block: None,
        faces: Vec::new(),
        blocks: Vec::new(),
        faint: false,
        most_missed: false,
        consequences: Vec::new(),
        name_in_doubt: false,
        untold: false,
        visits_come_back: false,
        rms_um: fit.outcome.rms_um,
        held_out_rms_um: None,
        held_out_se_um: None,
        noise_um: noise_um(fit),
        visit_um: 0.0,
        visit_source: fit.noise.visit_source.as_str().to_owned(),
        noise_says: fit.noise.says(),
        lack_of_fit_p: 1.0,
        depends: Vec::new(),
        shape: None,
        candidates: Vec::new(),
        gross: match setup_mistakes::of_log(subject) {
            Some(supposed) => vec![supposed],
            None => planned.map(|p| missed_touches::hypotheses(subject, p)).unwrap_or_default(),
        },
        outliers: Vec::new(),
        tested: 0,
        power: Vec::new(),
        not_seen: Vec::new(),
        needs_temperature: Vec::new(),
        open: Open::default(),
        warnings: Vec::new(),
    };
    verdict::not_when_touches_are_missing(&mut out, subject);
    out
}
