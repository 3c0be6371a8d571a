//! Where most touches found nothing: which gross mistake would have made just these touches miss?
//!
//! A touch finds its face when its search begins before the face and ends behind it. Where an axis counts the other way
//! round, or two are exchanged, some searches begin and end on one side: which ones, says which mistake it is.

use super::Subject;
use super::answer::Gross;
use super::gross::{EFFECT, in_words};
use crate::design::Planned;
use crate::log::{Status, Touch};
use crate::model::catalogue::Effect;
use crate::model::data::{Data, Run, assemble};
use crate::model::predict::Model;
use std::collections::{HashMap, HashSet};

/// More touches than this share may not be missing.
pub(super) const MOST_MISSED: f64 = 0.2;

/// A mistake is named when so many hits and misses are as it would make them …
pub(super) const AGREES: f64 = 0.85;

/// … and so many more than a right machine would.
const CLEARLY: f64 = 0.1;

/// Is that so many that the rest is no sample of the machine?
#[must_use]
pub(super) fn mostly(data: &Data) -> bool {
    let (missed, made) = (data.unusable.len(), data.observations.len() + data.unusable.len());
    missed as f64 > MOST_MISSED * made as f64
}

/// Mistakes that would have made these touches miss, best first.
#[must_use]
pub(super) fn hypotheses(subject: Subject, planned: &[Planned]) -> Vec<Gross> {
    let Some(effect) = subject.catalogue.get(EFFECT, subject.machine) else { return Vec::new() };
    let data = &subject.fit.data;
    let mut found: HashMap<(usize, u64), bool> = data.unusable.iter().map(|u| ((u.run, u.id), false)).collect();
    found.extend(data.observations.iter().map(|o| ((o.run, o.id), true)));
    let (starts, ends) = (at(subject, planned, false), at(subject, planned, true));
    let agreement = |supposed: Option<&str>| -> f64 {
        let before = gaps(subject, effect, &starts, supposed);
        let after = gaps(subject, effect, &ends, supposed);
        let (mut same, mut all) = (0usize, 0usize);
        for (key, from) in &before {
            let (Some(hit), Some(to)) = (found.get(key), after.get(key)) else { continue };
            all += 1;
            same += usize::from(*hit == (*from > 0.0 && *to <= 0.0));
        }
        same as f64 / all.max(1) as f64
    };
    let right = agreement(None);
    let names: HashSet<&str> = effect.parameters.iter().map(|p| p.name.as_str()).collect();
    let mut out: Vec<Gross> = names
        .into_iter()
        .map(|name| (name, agreement(Some(name))))
        .filter(|(_, agrees)| *agrees >= AGREES && *agrees > right + CLEARLY)
        .map(|(name, agrees)| Gross {
            hypothesis: name.to_owned(),
            says: in_words(name),
            rms_um: subject.fit.outcome.rms_um,
            agrees: Some(agrees),
        })
        .collect();
    out.sort_by(|a, b| b.agrees.partial_cmp(&a.agrees).unwrap_or(std::cmp::Ordering::Equal).then(a.hypothesis.cmp(&b.hypothesis)));
    out
}

/// The planned touches where their search begins or ends.
fn at(subject: Subject, planned: &[Planned], end: bool) -> Data {
    let touches: Vec<Vec<Touch>> = planned
        .iter()
        .map(|run| {
            let each = run.plan.touches.iter().map(|t| Touch {
                id: t.id,
                position: if end { t.end_position() } else { t.start_position() },
                status: Status::Hit,
                time_s: t.time_s,
                temperature_deg_c: None,
                line: 0,
            });
            each.collect()
        })
        .collect();
    let runs: Vec<Run> = planned
        .iter()
        .zip(&touches)
        .map(|(run, touches)| Run { plan: &run.plan, touches, mounting: run.mounting.as_deref(), started_s: run.started_s })
        .collect();
    assemble(subject.machine, &runs)
}

/// Distance of the ball from its face, mm, where a mistake is supposed and the blocks stand as planned.
fn gaps(subject: Subject, effect: &Effect, data: &Data, supposed: Option<&str>) -> HashMap<(usize, u64), f64> {
    let model = Model::new(subject.machine, &[effect], &data.set_ups, subject.fit.model.reference);
    let mut theta = model.start();
    for (value, unknown) in theta.iter_mut().zip(&model.unknowns) {
        *value = if supposed == Some(unknown.name.as_str()) { 1.0 } else { 0.0 };
    }
    let batch = model.prepare(&data.observations);
    let (at, mut scratch) = (batch.at(&theta), batch.scratch());
    data.observations.iter().enumerate().map(|(i, o)| ((o.run, o.id), at.gap(i, &mut scratch))).collect()
}
