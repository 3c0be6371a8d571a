//! A clean verdict over touches that tell none of the errors that the model is there for is none.

use super::Subject;
use super::answer::{Diagnosis, Verdict};
use crate::fit::outcome::Status;

/// The probe's own errors: a model is not there for them.
const PROBE: &str = "probe";

/// The errors of the machine in the model, where these touches tell none of them; else nothing.
pub(super) fn none_told(subject: Subject) -> Vec<String> {
    let Subject { machine, catalogue, fit, .. } = subject;
    let unknowns = fit.model.unknowns.iter().zip(&fit.outcome.parameters);
    let of_machine = unknowns.filter(|(u, _)| {
        let probe = || catalogue.get(&u.effect, machine).is_some_and(|e| e.family == PROBE);
        !u.nuisance && !u.shape && !probe()
    });
    let mut untold = Vec::new();
    for (u, p) in of_machine {
        if p.status != Status::Undetermined {
            return Vec::new();
        }
        untold.push(u.name.clone());
    }
    untold
}

/// That nothing stands out says little where nothing could: it is said so.
pub(super) fn not_when_nothing_is_told(out: &mut Diagnosis, subject: Subject) {
    let untold = none_told(subject);
    if out.verdict != Verdict::Adequate || untold.is_empty() {
        return;
    }
    out.verdict = Verdict::TooLittleData;
    out.candidates.clear();
    out.untold = true;
    out.says = format!(
        "Too little to judge: these touches tell none of the errors that the model is there for ({}). What they show fits \
         ({:.2} um RMS against {:.2} um noise), and says nothing of the machine. Run the program to its end, or touch in other \
         poses: `axiscal identify` names those that help.",
        untold.join(", "),
        out.rms_um,
        out.noise_um
    );
}
