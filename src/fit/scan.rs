//! Where the search for a shape parameter begins: the value of its scan that explains most, because a search from one
//! start may end in the wrong valley, and a moment in time has no derivative to follow. The effect's factors begin at
//! what they are there: at zero they would hide the shape.

use super::candidates::columns;
use crate::machine::Machine;
use crate::model::catalogue::Effect;
use crate::model::data::Data;
use crate::model::predict::Model;
use crate::search::{Basis, Library, Origin, Question, Search};
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

/// A start found by a scan.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Start {
    /// Which unknown.
    pub unknown: usize,
    /// Its value, in its unit.
    pub value: f64,
    /// The effect's factors with their values.
    pub factors: Vec<(usize, f64)>,
    /// Can a search go on from there? False for a moment or a place at which something jumps.
    pub smooth: bool,
}

/// Starts of scanned shapes; `known` says which unknowns the user has decided about.
pub(super) fn starts(
    machine: &Machine,
    effects: &[&Effect],
    model: &Model,
    data: &Data,
    theta: &[f64],
    known: &dyn Fn(usize) -> bool,
) -> Vec<Start> {
    let mut out = Vec::new();
    for effect in effects {
        let shapes: Vec<_> = effect.parameters.iter().filter(|p| p.shape.is_some()).collect();
        if shapes.is_empty() {
            continue;
        }
        let which = shapes.iter().position(|p| p.scan.len() > 1).unwrap_or(0);
        let of_effect = |i: &usize| model.unknowns[*i].effect == effect.id;
        let name = &shapes[which].name;
        let Some(unknown) = (0..theta.len()).filter(of_effect).find(|&i| &model.unknowns[i].name == name) else {
            continue;
        };
        if known(unknown) {
            continue;
        }
        let (gaps, jacobian) = linear(model, data, theta, &|i| !of_effect(&i));
        let starts: Vec<f64> = shapes.iter().filter_map(|p| p.shape.map(|s| s.0)).collect();
        let values = if shapes[which].scan.is_empty() { &starts[which..=which] } else { &shapes[which].scan[..] };
        let made: Vec<_> = values
            .par_iter()
            .map(|&value| {
                let mut at = starts.clone();
                at[which] = value;
                columns(machine, &[effect], data, &data.observations, model.reference, Some(&at))
            })
            .collect();
        let factors: Vec<usize> = (0..made[0].unknowns.len()).filter(|&c| !made[0].unknowns[c].shape).collect();
        let variants = values.iter().zip(&made).map(|(&value, m)| (value, m.values.select_columns(&factors)));
        let mut library = Library::new(gaps.len());
        library.push_scan(&effect.id, Origin::Catalogue, variants, 1);
        let base = Basis::new(&jacobian);
        let search = Search::new(Question { residual: &gaps, base: &base, pure: None }, &library);
        if let Some(score) = search.scores.first().filter(|s| s.visible()) {
            let value = library.candidates()[0].variants[score.variant].shape;
            let own = |name: &str| (0..theta.len()).filter(of_effect).find(|&i| model.unknowns[i].name == name);
            let factors = factors.iter().zip(score.estimate.iter());
            let factors = factors.filter_map(|(&c, size)| Some((own(&made[0].unknowns[c].name)?, *size))).collect();
            out.push(Start { unknown, value, factors, smooth: is_smooth(effect, which, value, &starts, data) });
        }
    }
    out
}

/// Gaps at θ and their derivatives by some of the unknowns.
fn linear(model: &Model, data: &Data, theta: &[f64], take: &dyn Fn(usize) -> bool) -> (DVector<f64>, DMatrix<f64>) {
    let batch = model.prepare(&data.observations);
    let at = batch.at(theta);
    let layout = model.layout();
    let n = data.observations.len();
    let mut gaps = DVector::zeros(n);
    let mut jacobian = DMatrix::zeros(n, theta.len());
    let mut scratch = batch.scratch();
    for (i, o) in data.observations.iter().enumerate() {
        let mut row = vec![0.0; layout.row_length(o.set_up)];
        gaps[i] = at.gap_and_row(i, &mut scratch, &mut row);
        for (value, unknown) in row.iter().zip(layout.row(o.set_up)) {
            if take(unknown) {
                jacobian[(i, unknown)] = *value;
            }
        }
    }
    (gaps, jacobian)
}

/// Does any formula of the effect change with the shape by degrees?
fn is_smooth(effect: &Effect, which: usize, value: f64, starts: &[f64], data: &Data) -> bool {
    // formulas number an effect's parameters, factors first
    let n_factors = effect.parameters.len() - starts.len();
    let mut values = vec![0.0; n_factors];
    values.extend_from_slice(starts);
    values[n_factors + which] = value;
    let moves = |o: &crate::model::predict::Observation| {
        effect
            .terms
            .iter()
            .any(|t| t.formula.partials(&o.state, &values).any(|(k, d)| k == n_factors + which && d != 0.0))
    };
    data.observations.iter().filter(|o| moves(o)).count() > data.observations.len() / 20
}
