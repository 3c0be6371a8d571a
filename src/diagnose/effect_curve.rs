//! The curve of an effect that is named first: its own function of the variable, at the size that these touches give it. A
//! shape without a name that passes on the same variable may be another one: of a drift the step in its middle.

use super::Examination;
use super::answer::Shape;
use super::assemble_diagnosis::x_unit;
use crate::model::catalogue::Place;
use crate::model::formula::{State, VARIABLES};
use crate::search::pattern_tests::{Features, Kind};
use crate::units::{deg_from_rad, um_from_mm};

/// Points of the curve.
const POINTS: usize = 61;

/// Directions in words.
const ALONG: [&str; 3] = ["X", "Y", "Z"];

/// What the leading effect does with a variable in the direction in which it is told best, about its mean over the touches.
/// `None` where it depends on more than that, or does not shift the tool.
pub(super) fn curve(seen: &Examination, features: &Features, on: &str, by: &str) -> Option<Shape> {
    let chosen = seen.groups.first()?.first();
    let effect = seen.named.effects[chosen];
    let score = &seen.scores(0)[chosen];
    let slot = VARIABLES.iter().position(|v| *v == on)?;
    let variable = features.variables.iter().find(|v| v.name == on)?;
    let scanned = seen.named.scanned[chosen].as_ref().map(|s| s.name.as_str());
    let at = seen.named.library.candidates()[chosen].variants[score.variant].shape;
    let shapes: Vec<f64> = effect
        .parameters
        .iter()
        .map(|p| if scanned == Some(p.name.as_str()) { at } else { p.shape.map_or(0.0, |(start, ..)| start) })
        .collect();
    let sigma = |k: usize| score.covariance[(k, k)].max(f64::MIN_POSITIVE).sqrt();
    let columns = &seen.named.columns[chosen];
    let acting = columns.iter().enumerate().filter_map(|(k, column)| {
        let term = effect.terms.iter().find(|t| effect.parameters[t.parameter].name == column.name)?;
        let shifts = matches!(term.place, Place::Base | Place::Tool) && term.component < ALONG.len();
        (shifts && term.formula.variables() == [on]).then_some((k, column, term))
    });
    let told = |k: usize| score.estimate[k].abs() / sigma(k);
    let (k, column, term) = acting.max_by(|a, b| told(a.0).total_cmp(&told(b.0)))?;
    let one_um = um_from_mm(column.typical * effect.parameters[term.parameter].factor);
    let value = |x: f64| {
        let mut state: State = [0.0; VARIABLES.len()];
        state[slot] = x;
        one_um * term.formula.eval(&state, &shapes)
    };
    let places: Vec<f64> = seen.evidence.used.iter().map(|&i| variable.values[i]).collect();
    let mean = places.iter().map(|x| value(*x)).sum::<f64>() / places.len().max(1) as f64;
    let low = places.iter().copied().fold(f64::INFINITY, f64::min);
    let high = places.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let xs: Vec<f64> = (0..POINTS).map(|i| low + (high - low) * i as f64 / (POINTS - 1) as f64).collect();
    let does: Vec<f64> = xs.iter().map(|x| value(*x) - mean).collect();
    let frame = if term.place == Place::Tool { "tool" } else { "machine" };
    (low < high && does.iter().all(|y| y.is_finite())).then(|| Shape {
        by: by.to_owned(),
        x_unit: x_unit(Some(variable.kind)).to_owned(),
        y_unit: "um".to_owned(),
        direction: format!("in {} of the {frame}", ALONG[term.component]),
        x: xs.iter().map(|x| if variable.kind == Kind::Rotary { deg_from_rad(*x) } else { *x }).collect(),
        y: does.iter().map(|y| score.estimate[k] * y).collect(),
        band: does.iter().map(|y| 1.96 * sigma(k) * y.abs()).collect(),
        labels: Vec::new(),
        block: None,
        kind: String::new(),
    })
}
