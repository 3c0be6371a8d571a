//! Which touches would part what a fit cannot tell apart.

use super::habits::habits;
use super::view::{Known, Noise, Planned, Task, View};
use crate::diag::Result;
use crate::fit::solve::observe;
use crate::fit::{Fit, Knowledge, effects_of};
use crate::machine::Machine;
use crate::model::catalogue::Catalogue;
use crate::model::data::Run;
use nalgebra::{DMatrix, DVector};

/// A direction is parted when less than this share of it is left among what leaves no trace.
const LEFT: f64 = 0.9;

/// Variations that are named at most.
const MOST_NAMED: usize = 2;

/// Adds to every combination of results that the fit cannot tell the variations of the touches that part it, cheapest
/// first. Nothing is computed where everything is told.
///
/// # Errors
/// When an effect of the fit is unknown.
pub fn explain(machine: &Machine, catalogue: &Catalogue, runs: &[Run], fit: &mut Fit) -> Result<()> {
    let results: Vec<usize> = (0..fit.free.len()).filter(|&c| !fit.model.unknowns[fit.free[c]].nuisance).collect();
    let directions: Vec<Option<DVector<f64>>> =
        fit.observability.unseen.iter().map(|v| of_results(fit, &results, v)).collect();
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
    let planned: Vec<Planned> = runs
        .iter()
        .map(|r| Planned { plan: r.plan.clone(), mounting: r.mounting.map(str::to_owned), started_s: r.started_s })
        .collect();
    let names: Vec<String> = results.iter().map(|&c| name(fit.free[c])).collect();
    let typical: Vec<f64> = results.iter().map(|&c| fit.model.unknowns[fit.free[c]].typical).collect();
    for habit in habits(machine, &planned, &fit.model) {
        let open = |k: usize| fit.outcome.undetermined.get(k).is_some_and(|u| u.parted_by.len() < MOST_NAMED);
        if !(0..directions.len()).any(|k| directions[k].is_some() && open(k)) {
            break;
        }
        let known: Vec<Known> = priors.iter().chain(&habit.known).cloned().collect();
        let varied = View::of_model(&task, &habit.runs, &known, noise)?;
        let left = unseen(&varied, &names, &typical);
        let minutes = (habit.seconds / 60.0).ceil();
        for (k, direction) in directions.iter().enumerate() {
            let Some(direction) = direction else { continue };
            let Some(said) = fit.outcome.undetermined.get_mut(k) else { continue };
            if said.parted_by.len() < MOST_NAMED && left.tr_mul(direction).norm() < LEFT * direction.norm() {
                said.parted_by.push(format!("{} (+{minutes} min)", habit.says));
            }
        }
    }
    for said in &mut fit.outcome.undetermined {
        if !said.parted_by.is_empty() {
            said.says = format!("{}; what parts them: {}", said.says, said.parted_by.join("; or "));
        }
    }
    Ok(())
}

/// A null direction's results in units of their typical sizes; `None` where it has none.
fn of_results(fit: &Fit, results: &[usize], scaled: &DVector<f64>) -> Option<DVector<f64>> {
    let own = DVector::from_iterator(
        results.len(),
        results.iter().map(|&c| scaled[c] / fit.observability.scale[c] / fit.model.unknowns[fit.free[c]].typical),
    );
    results.iter().any(|&c| scaled[c].abs() > 1e-6).then_some(own)
}

/// Orthonormal basis of what leaves no trace in a view, seen from the named unknowns in units of their typical sizes.
fn unseen(view: &View, names: &[String], typical: &[f64]) -> DMatrix<f64> {
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
    let svd = all.svd(true, false);
    let kept: Vec<usize> = (0..svd.singular_values.len()).filter(|&i| svd.singular_values[i] > 1e-6).collect();
    svd.u.map_or_else(|| DMatrix::zeros(names.len(), 0), |u| u.select_columns(&kept))
}
