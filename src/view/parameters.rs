//! Results against their tolerance, how they hang together, and the compensation.

use super::Material;
use super::record::{Compensation, Correlation, Judgement, LeftRecord, ParameterRecord, ShapeRecord};
use crate::fit::outcome::{Parameter, Status};
use crate::fit::{Fit, effects_of, null_space, uncertainty};
use crate::machine::Machine;
use crate::model::catalogue::{Catalogue, Effect};
use crate::study::tolerance::Tolerance;
use crate::tables::correction::left_um;

/// The results of a fit of the study's touches.
pub(crate) fn parameters(m: &Material, fit: &Fit) -> Vec<ParameterRecord> {
    results(fit, m.catalogue, m.machine, m.tolerance)
}

/// The results of a fit in words, against a tolerance: everything that is no set-up of a block and no other unknown of
/// the measurement.
#[must_use]
pub fn results(fit: &Fit, catalogue: &Catalogue, machine: &Machine, tolerance: &Tolerance) -> Vec<ParameterRecord> {
    let effects = effects_of(&fit.outcome.effects, catalogue, machine).unwrap_or_default();
    let each = fit.outcome.parameters.iter().zip(&fit.model.unknowns);
    each.filter(|(_, u)| !u.nuisance)
        .map(|(p, u)| {
            let says = null_space::name_at_the_machine(u, &effects).unwrap_or_else(|| u.name.clone());
            record(tolerance, p, says, &effects)
        })
        .collect()
}

fn record(t: &Tolerance, p: &Parameter, says: String, effects: &[&Effect]) -> ParameterRecord {
    let effect = effects.iter().find(|e| e.id == p.effect);
    // a shape parameter (a period, a time constant) scales nothing: it has no size as an error
    let is_shape = effect.is_some_and(|e| e.parameters.iter().any(|q| q.name == p.name && q.shape.is_some()));
    let size = |value: f64| left_um(value, &p.unit, t.radius_mm).filter(|_| !is_shape);
    let own = t.parameters.keys().any(|name| crate::symbols::same(name, &p.name));
    let tolerance = t.limit(&p.name, &p.unit).filter(|_| own || !is_shape);
    let expanded = p.expanded.filter(|e| e.is_finite());
    let told = matches!(p.status, Status::Identified | Status::PriorDominated);
    let judgement = match (tolerance, expanded) {
        (Some(limit), Some(doubt)) if told && !is_shape => {
            if p.value.abs() - doubt > limit {
                Judgement::Beyond
            } else if p.value.abs() + doubt <= limit {
                Judgement::Within
            } else {
                Judgement::Open
            }
        }
        _ => Judgement::None,
    };
    ParameterRecord {
        name: p.name.clone(),
        alias: p.alias.clone(),
        says,
        effect: p.effect.clone(),
        effect_name: effect.map_or_else(String::new, |e| e.name.clone()),
        mends: effect.map_or_else(String::new, |e| e.mends.clone()),
        value: p.value,
        unit: p.unit.clone(),
        sigma: p.sigma,
        expanded,
        status: p.status,
        at_radius_um: size(p.value).map(|s| s.copysign(p.value)),
        at_radius_expanded_um: expanded.and_then(size),
        tolerance,
        tolerance_um: tolerance.and_then(size),
        judgement,
        judgement_says: judgement.says(),
    }
}

/// Correlation coefficients of the results.
#[must_use]
pub fn correlation(fit: &Fit) -> Correlation {
    let c = uncertainty::results_covariance(fit);
    let sd = |i: usize| c.matrix[i][i].max(0.0).sqrt();
    // those of the table of results
    let is_result = |name: &String| fit.model.unknowns.iter().any(|u| u.name == *name && !u.nuisance);
    let shown: Vec<usize> = (0..c.names.len()).filter(|&i| is_result(&c.names[i])).collect();
    let matrix = shown
        .iter()
        .map(|&i| {
            let row = shown.iter().map(|&j| {
                let r = c.matrix[i][j] / (sd(i) * sd(j));
                r.is_finite().then(|| ((r.clamp(-1.0, 1.0)) * 1e4).round() / 1e4)
            });
            row.collect()
        })
        .collect();
    Correlation { names: shown.iter().map(|&i| c.names[i].clone()).collect(), matrix }
}

/// What a compensation carries and leaves, whoever controls the machine.
pub(super) fn compensation(m: &Material) -> Compensation {
    let empty = Compensation {
        refused: None,
        active: false,
        terms: Vec::new(),
        shapes: Vec::new(),
        tool_length_mm: None,
        left: Vec::new(),
        of_measurement: Vec::new(),
        reference_mm: m.fit.outcome.reference_mm,
    };
    let c = match m.correction {
        Ok(c) => c,
        Err(why) => return Compensation { refused: Some(why.to_owned()), ..empty },
    };
    let refused = c.beyond(&crate::tables::correction::Limits::default());
    Compensation {
        refused: (!refused.is_empty())
            .then(|| refused.iter().map(|f| f.message.clone()).collect::<Vec<_>>().join("; ")),
        active: c.active.is_some(),
        terms: c.terms.clone(),
        shapes: c
            .shapes
            .iter()
            .map(|s| ShapeRecord { parameter: s.parameter.clone(), effect: s.effect.clone(), axis: s.axis.to_string() })
            .collect(),
        tool_length_mm: c.tool_length_mm,
        left: c
            .left_out
            .iter()
            .map(|l| LeftRecord {
                parameter: l.parameter.clone(),
                effect: l.effect.clone(),
                value: l.value,
                unit: l.unit.clone(),
                left_um: left_um(l.value, &l.unit, m.tolerance.radius_mm).filter(|_| l.known),
                why: l.why.clone(),
                known: l.known,
            })
            .collect(),
        of_measurement: c.of_measurement.keys().cloned().collect(),
        ..empty
    }
}
