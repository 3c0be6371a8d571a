//! Says of candidates about which point they turn their axis: a wobble about a bearing far away looks like run-out at the ball.

use super::Subject;
use super::answer::Candidate;
use crate::model::lever_arm::turning_point;
use crate::words::diagnose as words;

/// Adds the point to what is said of each candidate that has one.
pub(super) fn say(subject: Subject, candidates: &mut [Candidate]) {
    for candidate in candidates {
        let Some(effect) = subject.catalogue.get(&candidate.effect, subject.machine) else { continue };
        let value = |parameter: usize| {
            let name = &effect.parameters.get(parameter)?.name;
            candidate.parameters.iter().find(|p| p.name == *name).map(|p| (p.value, p.sigma.unwrap_or(f64::INFINITY)))
        };
        if let Some(point) = turning_point(subject.machine, effect, value) {
            candidate.says = words::turning(&candidate.says, &point);
        }
    }
}
