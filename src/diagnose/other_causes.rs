//! What else than a named effect does the same to these touches, and is no effect of the catalogue: the temperature of the room, a jump
//! of the probe or the machine.

use super::Examination;
use super::answer::Candidate;
use crate::fit::Fit;
use crate::model::catalogue::Place;
use crate::search::pattern_tests::{Direction, Features, Kind};
use crate::units::mm_from_um;
use nalgebra::DMatrix;

/// Effects that go with the temperature, where no touch carries one: whether they act is not to be seen.
pub(super) fn without_temperature(fit: &Fit, seen: &Examination) -> Vec<String> {
    if fit.data.observations.iter().any(|o| o.has_temperature) {
        return Vec::new();
    }
    let warm = seen.named.effects.iter().filter(|e| e.terms.iter().any(|t| t.formula.variables().contains(&"T")));
    warm.map(|e| e.id.clone()).collect()
}

/// What goes with time may go with the temperature of the room, which a log without temperatures does not show.
pub(super) fn room_or_time(fit: &Fit, seen: &Examination, candidates: &mut [Candidate]) {
    if without_temperature(fit, seen).is_empty() {
        return;
    }
    for (candidate, group) in candidates.iter_mut().filter(|c| c.proposed).zip(&seen.groups) {
        let effect = seen.named.effects[group.first()];
        let with_time = effect.terms.iter().any(|t| t.formula.variables().contains(&"t"));
        if effect.id == candidate.effect && with_time && !effect.is_incident() {
            candidate.or_else = Some("what goes with the room's temperature (this log carries none)".to_owned());
        }
    }
}

/// Blocks that all stand elsewhere from some moment on are one reading of a jump. Where a jump at the same moment in a frame
/// that stands still does as well, the machine or the probe may have made it.
pub(super) fn jump_of_what(seen: &Examination, features: &Features, candidates: &mut [Candidate]) {
    let Some((first, group)) = candidates.first_mut().filter(|c| c.proposed).zip(seen.groups.first()) else { return };
    let chosen = group.first();
    let effect = seen.named.effects[chosen];
    let of_blocks =
        effect.id == first.effect && effect.is_incident() && effect.terms.iter().all(|t| t.place == Place::Block);
    let Some(clock) = features.variables.iter().find(|v| v.kind == Kind::Time).filter(|_| of_blocks) else { return };
    let at_h = seen.named.library.candidates()[chosen].variants[seen.order().scores[chosen].variant].shape;
    let still: Vec<&Direction> = features.directions.iter().filter(|d| d.name.starts_with("machine-")).collect();
    let n = features.block.len();
    let after = |i: usize| f64::from(u8::from(clock.values[i] >= at_h));
    let raw_mm = DMatrix::from_fn(n, still.len(), |i, d| mm_from_um(still[d].weight[i] * after(i)));
    let columns = seen.evidence.whiten(raw_mm);
    if super::effects_versus_patterns::as_well(seen.evidence.question(), &seen.order().columns(chosen), &columns) {
        first.or_else = Some("the probe or the machine itself jumped".to_owned());
    }
}
