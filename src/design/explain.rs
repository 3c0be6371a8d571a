//! Which touches would part what a fit cannot tell apart.

use super::linearised_plan::{Known, LinearisedPlan, Noise, Planned, Task, keep_measured};
use super::plan_variations::{Variation, variations};
use crate::diag::Result;
use crate::fit::outcome::Undetermined;
use crate::fit::solve::{Observability, observe};
use crate::fit::span::{LeastNorm, span};
use crate::fit::{Fit, Knowledge, effects_of};
use crate::machine::Machine;
use crate::model::catalogue::Catalogue;
use crate::model::data::Run;
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

/// A direction is parted when less than this share of it (the cosine of an angle) is left among what leaves no trace.
const LEFT: f64 = 0.9;

/// A direction with less than this weight in a combination does not stand in it.
const STANDS_IN: f64 = 0.1;

/// Variations that are named at most.
const MOST_NAMED: usize = 2;

/// Results as they stand in a regression: their names, and their usual sizes.
#[derive(Debug, Clone)]
pub(super) struct Results {
    columns: Vec<usize>,
    names: Vec<String>,
    typical: Vec<f64>,
    /// Time constants and the like: no angle or edge tells one.
    shape: Vec<bool>,
}

impl Results {
    /// Of the free unknowns of a model, those that are no set-up.
    pub fn new(model: &crate::model::predict::Model, free: &[usize]) -> Self {
        let unknown = |c: usize| &model.unknowns[free[c]];
        let columns: Vec<usize> = (0..free.len()).filter(|&c| !unknown(c).nuisance).collect();
        let names = columns.iter().map(|&c| unknown(c).name.clone()).collect();
        let typical = columns.iter().map(|&c| unknown(c).typical).collect();
        let shape = columns.iter().map(|&c| unknown(c).shape).collect();
        Self { columns, names, typical, shape }
    }

    /// The results' part of each null direction, in units of their typical sizes; `None` where it has none, or shapes alone.
    pub fn directions(&self, seen: &Observability) -> Vec<Option<DVector<f64>>> {
        let of = |scaled: &DVector<f64>| {
            let own = self.columns.iter().zip(&self.typical).map(|(&c, typical)| scaled[c] / seen.scale[c] / typical);
            let own = DVector::from_iterator(self.columns.len(), own);
            let named = self.columns.iter().zip(&self.shape).any(|(&c, shape)| !shape && scaled[c].abs() > 1e-6);
            named.then_some(own)
        };
        seen.unseen.iter().map(of).collect()
    }
}

/// A variation of the touches, and what of the results it leaves without a trace.
#[derive(Debug, Clone)]
pub(super) struct Remedy {
    says: String,
    seconds: f64,
    /// Orthonormal basis, in units of typical sizes.
    left: DMatrix<f64>,
}

impl Remedy {
    pub fn new(variation: &Variation, varied: &LinearisedPlan, results: &Results) -> Self {
        let minutes = (variation.seconds / 60.0).round().max(1.0);
        let left = unseen(varied, &results.names, &results.typical);
        Self { says: format!("{} (+{minutes} min)", variation.says), seconds: variation.seconds, left }
    }
}

/// The variations that together determine what the touches cannot, and how many combinations no variation determines.
#[derive(Debug, Default)]
pub(super) struct Together {
    pub variations: Vec<String>,
    pub left: usize,
}

/// Adds to every null direction the variations that determine it, cheapest first, and chooses those that together determine all.
pub(super) fn part(
    directions: &[Option<DVector<f64>>],
    remedies: &[Remedy],
    undetermined: &mut [Undetermined],
) -> Together {
    let own: Vec<DVector<f64>> = directions.iter().flatten().map(|d| d / d.norm().max(f64::MIN_POSITIVE)).collect();
    if own.is_empty() {
        return Together::default();
    }
    let all = DMatrix::from_columns(&own);
    let within = span(&all, 1e-6);
    // a direction that stands in any combination that stays dark is not parted, though it may not be dark by itself
    let still_in: Vec<DVector<f64>> = remedies.iter().map(|r| shares(&all, &common(&within, &r.left))).collect();
    let mut place = 0;
    for (said, direction) in undetermined.iter_mut().zip(directions) {
        if direction.is_none() {
            continue;
        }
        let parts = |(r, shares): (&'_ Remedy, &DVector<f64>)| (shares[place] < STANDS_IN).then(|| r.says.clone());
        said.parted_by = remedies.iter().zip(&still_in).filter_map(parts).take(MOST_NAMED).collect();
        place += 1;
        if !said.parted_by.is_empty() {
            said.says = format!("{}; what separates them: {}", said.says, said.parted_by.join("; or "));
        }
    }
    if own.len() < 2 {
        return Together::default();
    }
    // each further variation for what the ones before it leave, the most for its time first
    let mut open = within;
    let mut out = Vec::new();
    while open.ncols() > 0 {
        let tried = remedies.iter().map(|r| (r, common(&open, &r.left)));
        let worth = |left: &DMatrix<f64>, r: &Remedy| (open.ncols() - left.ncols()) as f64 / r.seconds.max(60.0);
        let best = tried.filter(|(_, left)| left.ncols() < open.ncols());
        // ties go to the earlier, which is the cheaper
        let Some((remedy, left)) = best.reduce(|a, b| if worth(&b.1, b.0) > worth(&a.1, a.0) { b } else { a }) else {
            break;
        };
        out.push(remedy.says.clone());
        open = left;
    }
    if out.is_empty() {
        return Together::default();
    }
    // what no single one parts may be parted by several
    let left_in = shares(&all, &open);
    let named = undetermined.iter_mut().zip(directions).filter(|(_, direction)| direction.is_some());
    for (place, (said, _)) in named.enumerate() {
        if said.parted_by.is_empty() && left_in[place] < STANDS_IN {
            said.says.push_str("; no single variation of the touches determines it, several together do");
        }
    }
    Together { variations: out, left: open.ncols() }
}

/// The largest weight of each direction (unit columns) in the combinations that make up a space of theirs.
fn shares(directions: &DMatrix<f64>, space: &DMatrix<f64>) -> DVector<f64> {
    let weights = LeastNorm::new(directions, 1e-6).solve(space);
    DVector::from_fn(directions.ncols(), |i, _| weights.row(i).iter().fold(0.0_f64, |m, w| m.max(w.abs())))
}

/// What two spaces have in common, as far as their directions go together by more than [`LEFT`].
fn common(open: &DMatrix<f64>, left: &DMatrix<f64>) -> DMatrix<f64> {
    if left.ncols() == 0 || open.ncols() == 0 {
        return DMatrix::zeros(open.nrows(), 0);
    }
    // square, so that there is a singular vector for every open direction
    let shared = left.tr_mul(open);
    let eigen = shared.tr_mul(&shared).symmetric_eigen();
    let kept: Vec<usize> = (0..eigen.eigenvalues.len()).filter(|&k| eigen.eigenvalues[k] >= LEFT * LEFT).collect();
    open * eigen.eigenvectors.select_columns(&kept)
}

/// Adds to every combination of results that the fit cannot tell the variations of the touches that part it, cheapest
/// first, and what tells all of them together. Nothing is computed where everything is told.
///
/// # Errors
/// When an effect of the fit is unknown.
pub fn explain(machine: &Machine, catalogue: &Catalogue, runs: &[Run], fit: &mut Fit) -> Result<()> {
    let results = Results::new(&fit.model, &fit.free);
    let directions = results.directions(&fit.observability);
    if directions.iter().all(Option::is_none) {
        return Ok(());
    }
    let name = |i: usize| fit.model.unknowns[i].name.clone();
    let task = Task {
        machine,
        catalogue,
        effects: effects_of(&fit.outcome.effects, catalogue, machine)?,
        held: (0..fit.theta.len())
            .filter(|i| matches!(fit.knowledge[*i], Some(Knowledge::Fixed(_))))
            .map(name)
            .collect(),
        reference: fit.model.reference,
        temperature: false,
    };
    let priors: Vec<Known> =
        fit.priors.iter().map(|(i, _, sigma)| Known { sum: vec![(name(*i), 1.0)], sigma: *sigma }).collect();
    let noise = Noise { sigma_mm: fit.noise.sigma_mm, tau_mm: 0.0 };
    // what was planned and not made tells nothing: a run may have been broken off
    let mut planned: Vec<Planned> = runs.iter().map(Planned::from_run).collect();
    keep_measured(&mut planned, &fit.data);
    let remedies: Vec<Remedy> = variations(machine, &planned, &fit.model)
        .into_par_iter()
        .map(|variation| {
            let known: Vec<Known> = priors.iter().chain(&variation.known).cloned().collect();
            Ok(Remedy::new(
                &variation,
                &LinearisedPlan::of_model(&task, &variation.runs(&planned), &known, noise)?,
                &results,
            ))
        })
        .collect::<Result<_>>()?;
    let together = part(&directions, &remedies, &mut fit.outcome.undetermined);
    fit.outcome.parted_together = together.variations;
    fit.outcome.never_determined = together.left;
    Ok(())
}

/// Orthonormal basis of what leaves no trace in a view, seen from the named unknowns in units of their typical sizes.
fn unseen(view: &LinearisedPlan, names: &[String], typical: &[f64]) -> DMatrix<f64> {
    let seen = observe(&view.jacobian);
    let columns: Vec<Option<usize>> =
        names.iter().map(|n| view.free.iter().position(|&i| view.model.unknowns[i].name == *n)).collect();
    let mut all = DMatrix::zeros(names.len(), seen.unseen.len());
    for (k, v) in seen.unseen.iter().enumerate() {
        for (row, column) in columns.iter().enumerate() {
            if let Some(c) = *column {
                all[(row, k)] = v[c] / seen.scale[c] / typical[row];
            }
        }
        let norm = all.column(k).norm();
        if norm > 0.0 {
            all.column_mut(k).scale_mut(1.0 / norm);
        }
    }
    if all.ncols() == 0 {
        return all;
    }
    span(&all, 1e-6)
}
