//! The effects that are not in the model, as candidates: columns of the catalogue's rows and of the user's.

use super::evidence::Evidence;
use crate::fit::candidates::{Columns, Variant, variants, with_values};
use crate::fit::{Fit, around, between, scan};
use crate::machine::Machine;
use crate::model::catalogue::{Catalogue, Effect, Parameter};
use crate::model::data::Data;
use crate::model::formula::slot;
use crate::model::predict::Observation;
use crate::search::{Library, Origin, Search};
use crate::units::um_from_mm;
use nalgebra::DMatrix;

/// A parameter of a candidate: one column.
#[derive(Debug, Clone)]
pub struct Column {
    /// Name; block parameters carry `@mounting/block`.
    pub name: String,
    /// Its unit.
    pub unit: String,
    /// Its usual size: columns are per so much of it.
    pub typical: f64,
    /// Is its size positive by nature?
    pub positive: bool,
}

/// A shape parameter whose values are tried.
#[derive(Debug, Clone)]
pub struct Scanned {
    /// Name.
    pub name: String,
    /// Its unit.
    pub unit: String,
}

/// Effects that may be missing; candidate i of the library is `effects[i]`.
#[derive(Debug, Clone)]
pub struct Named<'c> {
    /// The effects.
    pub effects: Vec<&'c Effect>,
    /// Their whitened columns, per typical size.
    pub library: Library,
    /// The same before whitening, µm per typical size; touches that are not used are zero.
    pub raw_um: DMatrix<f64>,
    /// What each column is, by candidate.
    pub columns: Vec<Vec<Column>>,
    /// The scanned shape of each candidate.
    pub scanned: Vec<Option<Scanned>>,
    /// What is said of effects that could not be tested.
    pub left_out: Vec<String>,
}

/// Effects of catalogue and user that the model does not hold. Not the paper's sets, not whole hypotheses (gross
/// mistakes), and none that shares a parameter with the model under another name.
#[must_use]
pub fn missing<'c>(fit: &Fit, machine: &Machine, catalogue: &'c Catalogue) -> Vec<&'c Effect> {
    let held = |e: &Effect| {
        fit.model.unknowns.iter().any(|u| u.effect == e.id)
            || (!e.per_block && e.parameters.iter().any(|p| fit.model.unknowns.iter().any(|u| u.name == p.name)))
    };
    catalogue.iter().filter(|e| e.applies_to(machine) && !e.paper && !e.discrete && !held(e)).collect()
}

/// Index of the scanned shape among an effect's shape parameters, with the values.
fn scan_of(effect: &Effect, data: &Data) -> Option<(usize, Vec<f64>)> {
    let shapes = effect.parameters.iter().filter(|p| p.shape.is_some());
    shapes.enumerate().find_map(|(i, p)| Some((i, scan(p, data).filter(|s| s.len() > 1)?)))
}

/// The values of a scan and a better one beside its best: a jump that was tried between index visits only may come in
/// mid-visit, and where an effect is large a number between two that were tried leaves so much that another effect seems better.
fn closer(
    fit: &Fit,
    evidence: &Evidence,
    machine: &Machine,
    (effect, places): (&Effect, &[Observation]),
    which: usize,
    mut values: Vec<f64>,
) -> Vec<f64> {
    let shaped: Vec<&Parameter> = effect.parameters.iter().filter(|p| p.shape.is_some()).collect();
    let starts: Vec<f64> = shaped.iter().filter_map(|p| p.shape.map(|(start, _, _)| start)).collect();
    let best_of = |values: &[f64]| -> Option<(f64, f64)> {
        let of = |value: &f64| {
            let mut shapes = starts.clone();
            shapes[which] = *value;
            Variant { effects: vec![0], shapes }
        };
        let wanted: Vec<Variant> = values.iter().map(of).collect();
        let made = variants(machine, &[effect], &fit.data, places, fit.model.reference, &wanted);
        let sizes = values.iter().zip(made).map(|(value, made)| {
            let own: Vec<usize> = (0..made.unknowns.len()).filter(|&c| !made.unknowns[c].shape).collect();
            let mut columns = made.values.select_columns(&own);
            for (mut column, &c) in columns.column_iter_mut().zip(&own) {
                column *= made.unknowns[c].typical.max(f64::MIN_POSITIVE);
            }
            (*value, evidence.whiten(fit, columns))
        });
        let mut library = Library::new(evidence.n_rows());
        library.push_scan(&effect.id, Origin::Catalogue, sizes, 1);
        let score = Search::new(evidence.question(), &library).scores.into_iter().next()?;
        Some((values[score.variant], score.delta_ss))
    };
    let Some(coarse) = best_of(&values) else { return values };
    // the misfit that a pitch leaves goes up and down with it: its best place may be between any two values
    let finer = if shaped[which].between.is_none() { between(&values) } else { Vec::new() };
    let better = |one: (f64, f64), other: Option<(f64, f64)>| other.filter(|o| o.1 > one.1).unwrap_or(one);
    let best = better(coarse, best_of(&finer));
    let mut tried = [&values[..], &finer].concat();
    tried.sort_by(f64::total_cmp);
    let best = better(best, best_of(&around(shaped[which], &fit.data, &tried, best.0)));
    if best != coarse {
        values.push(best.0);
        values.sort_by(f64::total_cmp);
    }
    values
}

/// The touches where the model expects them instead of where they were read: along its normal a reading carries the very
/// noise that is to be explained, and a formula that is steep in a coordinate (a pitch error whose period the plan's
/// coordinates keep) would explain the noise by itself.
fn without_noise(fit: &Fit) -> Vec<Observation> {
    let each = fit.data.observations.iter().zip(&fit.residual_mm).map(|(o, residual)| {
        let mut o = o.clone();
        for k in 0..3 {
            let by = o.state[slot::NORMAL_IN_R + k] * residual;
            o.position.0[k] -= by;
            o.state[slot::AXES + k] -= by;
        }
        o
    });
    each.collect()
}

impl<'c> Named<'c> {
    /// All candidates of a fit.
    #[must_use]
    pub fn of(fit: &Fit, evidence: &Evidence, machine: &Machine, catalogue: &'c Catalogue) -> Self {
        Self::with(fit, evidence, machine, missing(fit, machine, catalogue))
    }

    /// Given effects as candidates.
    #[must_use]
    pub fn with(fit: &Fit, evidence: &Evidence, machine: &Machine, effects: Vec<&'c Effect>) -> Self {
        let places = without_noise(fit);
        let (effects, left_out) = with_values(effects, &places);
        let scans_of: Vec<Option<(usize, Vec<f64>)>> = effects
            .iter()
            .map(|e| {
                let (which, values) = scan_of(e, &fit.data)?;
                let values = closer(fit, evidence, machine, (e, &places), which, values);
                Some((which, values))
            })
            .collect();
        let fixed = (0..effects.len()).filter(|i| scans_of[*i].is_none()).collect();
        let mut wanted = vec![Variant { effects: fixed, shapes: Vec::new() }];
        let mut scanned_at = Vec::new();
        for (i, effect) in effects.iter().enumerate() {
            let Some((which, values)) = &scans_of[i] else { continue };
            let starts: Vec<f64> =
                effect.parameters.iter().filter_map(|p| p.shape.map(|(start, _, _)| start)).collect();
            for &value in values {
                let mut shapes = starts.clone();
                shapes[*which] = value;
                wanted.push(Variant { effects: vec![i], shapes });
                scanned_at.push((i, value));
            }
        }
        let mut made = variants(machine, &effects, &fit.data, &places, fit.model.reference, &wanted).into_iter();
        let together = made.next().unwrap_or_else(|| Columns::none(places.len()));
        let scans: Vec<_> = scanned_at.into_iter().zip(made).map(|((i, value), columns)| (i, value, columns)).collect();

        // one matrix of all variants, whitened at once
        let mut parts: Vec<(usize, f64, DMatrix<f64>)> = Vec::new();
        let mut info: Vec<Vec<Column>> = Vec::new();
        let mut scanned = Vec::new();
        for (i, effect) in effects.iter().enumerate() {
            let scan = &scans_of[i];
            let mut push = |made: &Columns, shape: f64| -> Vec<Column> {
                let own = |c: &usize| made.unknowns[*c].effect == effect.id && !made.unknowns[*c].shape;
                let of: Vec<usize> = (0..made.unknowns.len()).filter(own).collect();
                let mut values = made.values.select_columns(&of);
                let columns: Vec<Column> = of
                    .iter()
                    .map(|&c| {
                        let u = &made.unknowns[c];
                        let typical = if u.typical > 0.0 { u.typical } else { 1.0 };
                        let bare = u.name.split('@').next().unwrap_or(&u.name);
                        let positive = effect.parameters.iter().any(|p| p.name == bare && p.positive);
                        Column { name: u.name.clone(), unit: u.unit.clone(), typical, positive }
                    })
                    .collect();
                for (mut column, c) in values.column_iter_mut().zip(&columns) {
                    column *= c.typical;
                }
                parts.push((i, shape, values));
                columns
            };
            let mut columns = Vec::new();
            if scan.is_some() {
                for (_, shape, made) in scans.iter().filter(|s| s.0 == i) {
                    columns = push(made, *shape);
                }
            } else {
                columns = push(&together, 0.0);
            }
            info.push(columns);
            let shapes: Vec<_> = effect.parameters.iter().filter(|p| p.shape.is_some()).collect();
            scanned.push(
                scan.as_ref().map(|(k, _)| Scanned { name: shapes[*k].name.clone(), unit: shapes[*k].unit.clone() }),
            );
        }
        let n = fit.data.observations.len();
        let n_columns = parts.iter().map(|p| p.2.ncols()).sum();
        let mut all = DMatrix::zeros(n, n_columns);
        let mut at = 0;
        for (_, _, values) in &parts {
            all.columns_mut(at, values.ncols()).copy_from(values);
            at += values.ncols();
        }
        let mut raw_um = all.map(um_from_mm);
        for (mut row, w) in raw_um.row_iter_mut().zip(&fit.weight) {
            row *= *w;
        }
        let white = evidence.whiten(fit, all);
        let mut library = Library::new(evidence.n_rows());
        let (mut at, mut part) = (0, 0);
        for (i, effect) in effects.iter().enumerate() {
            let mut variants = Vec::new();
            while part < parts.len() && parts[part].0 == i {
                let width = parts[part].2.ncols();
                variants.push((parts[part].1, white.columns(at, width).into_owned()));
                at += width;
                part += 1;
            }
            let origin = if effect.built_in { Origin::Catalogue } else { Origin::User };
            library.push_scan(&effect.id, origin, variants, usize::from(scanned[i].is_some()));
            library.positive_of_last((0..info[i].len()).filter(|&k| info[i][k].positive).collect());
        }
        Self { effects, library, raw_um, columns: info, scanned, left_out }
    }
}
