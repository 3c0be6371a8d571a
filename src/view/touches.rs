//! Touches column by column, the rungs of the ladder without them, and what they are drawn against.

use super::ViewMaterial;
use super::record::{RungRecord, Touches, UnusableRecord, Variable};
use crate::compare::model_ladder::{self, Curve, Kind, direction};
use crate::compare::variables::plot_variables;
use std::collections::{BTreeMap, HashMap};

/// µm, to a nanometre: a probe sees no less.
fn nanometre(x: f64) -> f64 {
    (x * 1e3).round() / 1e3 + 0.0
}

/// Four decimals: what is shown needs no more, and a page with ten thousand touches stays small.
fn short(x: f64) -> f64 {
    (x * 1e4).round() / 1e4 + 0.0
}

pub(super) fn touches(m: &ViewMaterial) -> Touches {
    let fit = m.fit;
    let points = &m.comparison.points;
    let mut words: Vec<String> = Vec::new();
    let mut known: HashMap<String, usize> = HashMap::new();
    let mut word = |text: &str| {
        *known.entry(text.to_owned()).or_insert_with(|| {
            words.push(text.to_owned());
            words.len() - 1
        })
    };
    let stage = points.iter().map(|p| word(&p.stage)).collect();
    let block = points.iter().map(|p| word(&p.block)).collect();
    let face = points.iter().map(|p| word(&p.face)).collect();
    let mut axes: BTreeMap<String, Vec<f64>> = BTreeMap::new();
    for p in points {
        for (name, value) in &p.axes {
            axes.entry(name.clone()).or_default().push(short(*value));
        }
    }
    let three = |v: &nalgebra::Vector3<f64>| [short(v.x), short(v.y), short(v.z)];
    Touches {
        n: points.len(),
        run: points.iter().map(|p| p.run).collect(),
        id: points.iter().map(|p| p.id).collect(),
        line: points.iter().map(|p| p.line).collect(),
        stage,
        block,
        face,
        words,
        visit: points.iter().map(|p| p.visit).collect(),
        axes,
        time_h: points.iter().map(|p| short(p.time_h)).collect(),
        stylus_mm: points.iter().map(|p| short(p.stylus_mm)).collect(),
        approach_deg: points.iter().map(|p| p.approach_deg.map(short)).collect(),
        point: fit.data.observations.iter().map(|o| three(&o.point)).collect(),
        normal: fit.data.observations.iter().map(|o| three(&o.normal)).collect(),
        normal_r: points.iter().map(|p| p.normal.map(short)).collect(),
        towards: points.iter().map(|p| direction(&p.normal).0).collect(),
        sign: points.iter().map(|p| if direction(&p.normal).1 < 0.0 { -1 } else { 1 }).collect(),
        residual_um: m.ladder.rungs.iter().map(|r| r.residual_um.iter().map(|x| nanometre(*x)).collect()).collect(),
        standardised: points.iter().map(|p| short(p.standardised)).collect(),
        rejected: (0..points.len()).map(|i| fit.rejected.get(&i).map(crate::fit::Reason::says)).collect(),
    }
}

pub(super) fn unusable(m: &ViewMaterial) -> Vec<UnusableRecord> {
    let each = m.fit.data.unusable.iter();
    each.map(|u| UnusableRecord {
        run: u.run + 1,
        id: u.id,
        line: u.line,
        reason: crate::words::log::unusable(&u.reason),
    })
    .collect()
}

pub(super) fn rungs(m: &ViewMaterial) -> Vec<RungRecord> {
    let each = m.ladder.rungs.iter().enumerate().map(|(i, r)| {
        let signed = |sign: &str, ids: &[String]| ids.iter().map(|e| format!("{sign}{e}")).collect::<Vec<_>>();
        let mut changes = signed("+", &r.added);
        changes.extend(signed("\u{2212}", &r.removed));
        let label = match (r.kind, i) {
            (Kind::Uncorrected, _) => "machine as it is".to_owned(),
            (Kind::Proposed, _) => format!("{} (proposed)", changes.join(" ")),
            (_, 1) if m.ladder.rungs[0].kind == Kind::Uncorrected => "first model".to_owned(),
            (_, 0) => "first model".to_owned(),
            _ if changes.is_empty() => "the same model".to_owned(),
            _ => changes.join(" "),
        };
        RungRecord {
            kind: r.kind,
            label,
            effects: r.effects.clone(),
            added: r.added.clone(),
            removed: r.removed.clone(),
            rms_um: r.rms_um,
            held_out_rms_um: r.held_out_rms_um,
            chi2_per_dof: r.chi2_per_dof,
            unknowns: r.unknowns,
        }
    });
    each.collect()
}

/// What residuals are drawn against, with the share of the misfit that goes with it.
pub(super) fn variables(m: &ViewMaterial) -> Vec<Variable> {
    let share = |id: &str| {
        // an axis is split by its poses, and a direction of approach has another name there
        let by = |s: &&crate::compare::Split| {
            s.by == id || s.by.strip_prefix("pose.") == Some(id) || (id == "approach" && s.by == "direction")
        };
        m.comparison.splits.iter().find(by).map(|s| s.share)
    };
    let each = plot_variables(m.machine, &m.comparison.points).into_iter();
    each.map(|v| Variable { share: share(&v.id), title: v.title(), id: v.id }).collect()
}

/// Curves of each step of the ladder, and of the whole way from "before" to "after".
pub(super) fn curves(m: &ViewMaterial, before: usize, after: usize) -> Vec<Curve> {
    let ids: Vec<String> = variables(m).into_iter().map(|v| v.id).collect();
    let rungs = &m.ladder.rungs;
    let mut pairs: Vec<(usize, usize)> = (1..rungs.len()).map(|i| (i - 1, i)).collect();
    if before < after && !pairs.contains(&(before, after)) {
        pairs.push((before, after));
    }
    let each = pairs.into_iter().flat_map(|(a, b)| model_ladder::curves(&m.comparison.points, rungs, a, b, &ids));
    each.map(|mut c| {
        c.x.iter_mut().chain(&mut c.y_um).for_each(|v| *v = short(*v));
        c
    })
    .collect()
}
