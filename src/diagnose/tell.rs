//! Which touches would tell the members of a group apart.

use super::{Examination, Subject};
use crate::model::formula::slot;
use crate::search::groups::Group;
use crate::units::deg_from_rad;
use nalgebra::DVector;

/// In words; empty where the group has one member.
pub(super) fn words(subject: Subject, seen: &Examination, group: &Group) -> String {
    let chosen = group.first();
    let Some(rival) = group.members.iter().map(|m| m.candidate).find(|&c| c != chosen) else { return String::new() };
    let trace = |c: usize| -> DVector<f64> {
        let score = &seen.order.scores[c];
        let span = seen.named.library.candidates()[c].variants[score.variant].columns.clone();
        seen.named.raw_um.columns(span.start, span.len()) * &score.estimate
    };
    let difference = trace(chosen) - trace(rival);
    let further = |a: &usize, b: &usize| difference[*a].abs().total_cmp(&difference[*b].abs());
    let Some(most) = seen.evidence.used.iter().copied().max_by(further) else { return String::new() };
    let o = &subject.fit.data.observations[most];
    let pose: Vec<String> = subject
        .machine
        .rotary()
        .map(|a| format!("{} = {:.0}", a.name, deg_from_rad(o.state[slot::AXES + a.name.index()])))
        .collect();
    format!(
        "more touches near {} on block {}, where {} and {} differ by {:.1} um before the rest of the model takes its part",
        pose.join(", "),
        subject.fit.data.set_ups[o.set_up].label,
        seen.named.effects[chosen].id,
        seen.named.effects[rival].id,
        difference[most].abs()
    )
}
