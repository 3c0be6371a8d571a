//! Touches that determine none of the errors that the model is there for give no verdict.

use super::Subject;
use super::answer::Diagnosis;
use super::verdict::{TooLittle, Verdict};
use crate::fit::outcome::Status;

/// The probe's own errors: a model is not there for them.
const PROBE: &str = "probe";

/// The errors of the machine in the model, where these touches determine none of them; else nothing.
fn none_determined(subject: Subject) -> Vec<String> {
    let Subject { machine, catalogue, fit, .. } = subject;
    let unknowns = fit.model.unknowns.iter().zip(&fit.outcome.parameters);
    let of_machine = unknowns.filter(|(u, _)| {
        let probe = || catalogue.get(&u.effect, machine).is_some_and(|e| e.family == PROBE);
        !u.nuisance && !u.shape && !probe()
    });
    let mut names = Vec::new();
    for (u, p) in of_machine {
        if p.status != Status::Undetermined {
            return Vec::new();
        }
        names.push(u.name.clone());
    }
    names
}

/// That nothing stands out says nothing where nothing can be determined.
pub(super) fn where_nothing_is_determined(out: &mut Diagnosis, subject: Subject) {
    let names = none_determined(subject);
    if out.verdict == Verdict::Adequate && !names.is_empty() {
        out.candidates.clear();
        out.verdict = Verdict::TooLittleData(TooLittle::NothingDetermined(names));
    }
}
