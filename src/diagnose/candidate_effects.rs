//! The effects that are not in the model, as candidates: columns of the catalogue's rows and of the user's.

use super::evidence::{Evidence, WhiteRows};
use crate::fit::candidates::{NoValue, Variant, columns_at, with_values};
use crate::fit::{Fit, around, between, scan};
use crate::machine::Machine;
use crate::model::catalogue::{Catalogue, Effect};
use crate::model::data::Data;
use crate::model::formula::slot;
use crate::model::predict::{Model, Observation, Unknown};
use crate::model::sensitivities::Sensitivities;
use crate::search::library::Make;
use crate::search::{self, Change, Library, Origin};
use crate::units::um_from_mm;
use nalgebra::DMatrix;
use rayon::prelude::*;
use std::sync::Arc;

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
    pub name: String,
    /// Its unit.
    pub unit: String,
}

/// Effects that may be missing; candidate i of the library is `effects[i]`.
#[derive(Debug, Clone)]
pub struct Named<'c> {
    pub effects: Vec<&'c Effect>,
    /// Their whitened columns, per typical size.
    pub library: Library,
    /// What each column is, by candidate.
    pub columns: Vec<Vec<Column>>,
    /// The scanned shape of each candidate.
    pub scanned: Vec<Option<Scanned>>,
    /// What is said of effects that could not be tested.
    pub left_out: Vec<NoValue>,
    source: Arc<Source>,
    weight: Vec<f64>,
}

/// All effects on an errorless machine, and what the touches see of them: what columns are made of.
#[derive(Debug)]
struct Source {
    model: Model,
    traces: Sensitivities,
    /// Values at which the shape parameters of each effect start.
    starts: Vec<Vec<f64>>,
    rows: Arc<WhiteRows>,
}

/// An effect, by its place, with one of its shapes (by its place among them) at a value.
#[derive(Debug, Clone, Copy)]
struct Chosen {
    effect: usize,
    shape: Option<(usize, f64)>,
}

impl Source {
    /// Sizes of an effect.
    fn sizes(&self, effect: usize) -> impl Iterator<Item = &Unknown> {
        let instances = self.model.instances(effect).iter();
        let all = instances.flat_map(|&(first, count)| &self.model.unknowns[first..first + count]);
        all.filter(|u| !u.shape)
    }

    /// What the sizes of an effect do at some touches (`None`: at all), mm per typical size.
    fn columns(&self, chosen: Chosen, touches: Option<&[usize]>) -> DMatrix<f64> {
        let mut shapes = self.starts[chosen.effect].clone();
        if let Some((which, value)) = chosen.shape {
            shapes[which] = value;
        }
        let variant = Variant { effects: vec![chosen.effect], shapes };
        let made = columns_at(&self.model, &self.traces, &variant, touches);
        let shaped: Vec<usize> = (0..made.unknowns.len()).filter(|&c| made.unknowns[c].shape).collect();
        let kinds: Vec<&Unknown> = made.unknowns.iter().filter(|u| !u.shape).collect();
        // a copy of many columns only where some of them go
        let mut values = if shaped.is_empty() { made.values } else { made.values.remove_columns_at(&shaped) };
        for (mut values, u) in values.column_iter_mut().zip(kinds) {
            values *= typical(u);
        }
        values
    }

    /// Columns of some choices, each with the place of a column in it, at some touches (`None`: at all); mm per typical size.
    fn some(&self, wanted: &[(Chosen, usize)], touches: Option<&[usize]>) -> DMatrix<f64> {
        let is_one = wanted.iter().enumerate().all(|(k, (chosen, at))| *at == k && chosen.is(wanted[0].0));
        if is_one && wanted.first().is_some_and(|(chosen, _)| self.sizes(chosen.effect).count() == wanted.len()) {
            return self.columns(wanted[0].0, touches);
        }
        let n = touches.map_or(self.traces.n_touches(), <[usize]>::len);
        let mut out = DMatrix::zeros(n, wanted.len());
        let mut at = 0;
        while at < wanted.len() {
            let (chosen, first) = wanted[at];
            let made = self.columns(chosen, touches);
            // the columns of a choice follow one another
            while at < wanted.len() && wanted[at].1 >= first && wanted[at].0.is(chosen) {
                out.set_column(at, &made.column(wanted[at].1));
                at += 1;
            }
        }
        out
    }

    /// Whitened columns that are made whenever they are needed.
    fn make(self: &Arc<Self>, columns: Vec<(Chosen, usize)>) -> Make {
        let source = self.clone();
        Arc::new(move |numbers, rows| {
            let wanted: Vec<(Chosen, usize)> = numbers.iter().map(|&n| columns[n]).collect();
            let Some(rows) = rows else { return source.rows.of_mm(source.some(&wanted, None)) };
            let (touches, part) = source.rows.part(rows);
            part.of_mm(source.some(&wanted, Some(&touches)))
        })
    }
}

impl Chosen {
    fn is(self, other: Self) -> bool {
        self.effect == other.effect && self.shape == other.shape
    }
}

/// Effects of catalogue and user that the model does not hold. Not the paper's sets, not whole hypotheses (gross
/// mistakes), and none that shares a parameter with the model under another name.
#[must_use]
pub fn missing<'c>(fit: &Fit, machine: &Machine, catalogue: &'c Catalogue) -> Vec<&'c Effect> {
    let held = |e: &Effect| {
        fit.model.unknowns.iter().any(|u| u.effect == e.id)
            || (!e.is_repeated() && e.parameters.iter().any(|p| fit.model.unknowns.iter().any(|u| u.name == p.name)))
    };
    catalogue.acting_on(machine).filter(|e| !held(e) && fit.model.has_parameters_of(e)).collect()
}

/// Index of the scanned shape among an effect's shape parameters, with the values.
fn scan_of(effect: &Effect, data: &Data) -> Option<(usize, Vec<f64>)> {
    let shapes = effect.parameters.iter().filter(|p| p.shape.is_some());
    shapes.enumerate().find_map(|(i, p)| Some((i, scan(p, data).filter(|s| s.len() > 1)?)))
}

/// An effect at the values of its scanned shape.
struct Tried {
    /// Which of its shapes is scanned, by its place among them.
    which: Option<usize>,
    /// The values, in the order of their columns; 0 where nothing is scanned.
    values: Vec<f64>,
    /// What its sizes would do, as rows of the tests; nothing where it is made anew whenever it is needed.
    white: Arc<Vec<f64>>,
}

/// Makes and compares columns of effects that are not in the model.
struct Maker<'a> {
    fit: &'a Fit,
    evidence: &'a Evidence,
    source: &'a Arc<Source>,
}

impl Maker<'_> {
    /// Columns of effect number i with its shapes where they start, one of them (by its place among the shapes) at each of some
    /// values; behind them room for as many values as `room` says.
    fn whitened(&self, i: usize, which: Option<usize>, values: &[f64], room: usize) -> Arc<Vec<f64>> {
        let n_rows = self.evidence.n_rows();
        if !Library::keeps(n_rows) {
            return Arc::default();
        }
        let size = self.source.sizes(i).count() * n_rows;
        let mut data = vec![0.0; size * (values.len() + room)];
        data.par_chunks_mut(size.max(1)).zip(values).for_each(|(own, value)| {
            let chosen = Chosen { effect: i, shape: which.map(|which| (which, *value)) };
            own.copy_from_slice(self.evidence.whiten(self.source.columns(chosen, None)).as_slice());
        });
        Library::part(n_rows, data)
    }

    /// Which columns effect number i has at values of one of its shapes.
    fn listed(&self, i: usize, which: Option<usize>, values: &[f64]) -> Vec<(Chosen, usize)> {
        let n = self.source.sizes(i).count();
        let chosen = |value: &f64| Chosen { effect: i, shape: which.map(|which| (which, *value)) };
        values.iter().map(chosen).flat_map(|chosen| (0..n).map(move |k| (chosen, k))).collect()
    }

    /// Which of the values of effect number i explains most, and how much: nothing where the touches see none.
    fn best_of(&self, (i, which): (usize, usize), values: &[f64], white: &Arc<Vec<f64>>) -> (usize, f64) {
        let n = self.source.sizes(i).count();
        let n_rows = self.evidence.n_rows();
        let mut library = if Library::keeps(n_rows) {
            let mut library = Library::new(n_rows);
            library.put(white);
            library
        } else {
            let all = self.listed(i, Some(which), values);
            Library::made(n_rows, all.len(), self.source.make(all))
        };
        let variant = |(k, value): (usize, &f64)| search::Variant { shape: *value, columns: k * n..(k + 1) * n };
        library.place("tried", Origin::Catalogue, values.iter().enumerate().map(variant).collect(), 1);
        search::best_variant(self.evidence.question(), &library).unwrap_or((0, 0.0))
    }

    /// A library of all columns, and the first of each effect.
    fn library(&self, tried: &[Tried]) -> (Library, Vec<usize>) {
        let n_rows = self.evidence.n_rows();
        let each = || tried.iter().enumerate();
        if !Library::keeps(n_rows) {
            let all: Vec<_> = each().map(|(i, t)| self.listed(i, t.which, &t.values)).collect();
            let starts = all.iter().scan(0, |end, own| {
                *end += own.len();
                Some(*end - own.len())
            });
            let first = starts.collect();
            let all = all.concat();
            return (Library::made(n_rows, all.len(), self.source.make(all)), first);
        }
        // the columns of a scan where they are, the few of the other effects in one piece
        let of_few: Vec<&[f64]> = tried.iter().filter(|t| t.which.is_none()).map(|t| &t.white[..]).collect();
        let mut library = Library::new(n_rows);
        let mut few = library.put(&Arc::new(of_few.concat())).start;
        let place = |(i, t): (usize, &Tried)| match t.which {
            Some(_) => library.put(&t.white).start,
            None => {
                few += self.source.sizes(i).count();
                few - self.source.sizes(i).count()
            }
        };
        let first = each().map(place).collect();
        (library, first)
    }

    /// An effect at all values of its scan, and at a better one beside the best of them: a jump that was tried between index
    /// visits only may come in mid-visit, and where an effect is large a number between two that were tried leaves so much
    /// that another effect seems better.
    fn scan(&self, i: usize, effect: &Effect, (which, mut values): (usize, Vec<f64>)) -> Tried {
        let mut white = self.whitened(i, Some(which), &values, 1);
        let coarse = self.best_of((i, which), &values, &white);
        let shape = effect.parameters.iter().filter(|p| p.shape.is_some()).nth(which);
        let mut best = (values[coarse.0], coarse.1, Vec::new());
        let size = white.len() / (values.len() + 1);
        let try_also = |more: &[f64], best: (f64, f64, Vec<f64>)| {
            let made = self.whitened(i, Some(which), more, 0);
            match self.best_of((i, which), more, &made) {
                (at, gain) if gain > best.1 => (more[at], gain, made[at * size..(at + 1) * size].to_vec()),
                _ => best,
            }
        };
        if let Some(shape) = shape {
            // the misfit that a pitch leaves goes up and down with it: its best place may be between any two values
            let finer = if shape.between.is_none() { between(&values) } else { Vec::new() };
            best = try_also(&finer, best);
            let mut tried = [&values[..], &finer].concat();
            tried.sort_by(f64::total_cmp);
            loop {
                let more = around(shape, &self.fit.data, &tried, best.0);
                let before = best.1;
                best = try_also(&more, best);
                // of a number that changes smoothly there are always more steps between
                if more.is_empty() || (shape.between.is_none() && best.1 < WORTH_A_CLOSER_LOOK * before) {
                    break;
                }
                tried.extend(more);
                tried.sort_by(f64::total_cmp);
            }
        }
        // in place: no library has the columns now
        let data = Arc::make_mut(&mut white);
        data.truncate(size * values.len());
        if best.0 != values[coarse.0] {
            values.push(best.0);
            data.extend(best.2);
        }
        Tried { which: Some(which), values, white }
    }
}

/// A number that explains so many times more than its neighbours is looked at more closely.
const WORTH_A_CLOSER_LOOK: f64 = 1.01;

/// Usual size of a parameter: 1 where it has none.
fn typical(u: &Unknown) -> f64 {
    if u.typical > 0.0 { u.typical } else { 1.0 }
}

/// Where the shape parameters of an effect start.
fn starts(effect: &Effect) -> Vec<f64> {
    effect.parameters.iter().filter_map(|p| p.shape.map(|(start, _, _)| start)).collect()
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
    pub fn for_fit(fit: &Fit, evidence: &Evidence, machine: &Machine, catalogue: &'c Catalogue) -> Self {
        Self::with(fit, evidence, machine, missing(fit, machine, catalogue))
    }

    /// Given effects as candidates.
    #[must_use]
    pub fn with(fit: &Fit, evidence: &Evidence, machine: &Machine, effects: Vec<&'c Effect>) -> Self {
        let places = without_noise(fit);
        let (effects, left_out) = with_values(effects, &places);
        let model = Model::new(machine, &effects, &fit.data.set_ups, fit.model.reference);
        let starts = effects.iter().map(|e| starts(e)).collect();
        let traces = Sensitivities::new(&model, &places);
        drop(places);
        let source = Arc::new(Source { model, traces, starts, rows: evidence.rows.clone() });
        let maker = Maker { fit, evidence, source: &source };
        let all_of = |(i, effect): (usize, &&Effect)| match scan_of(effect, &fit.data) {
            Some(scan) => maker.scan(i, effect, scan),
            None => Tried { which: None, values: vec![0.0], white: maker.whitened(i, None, &[0.0], 0) },
        };
        let tried: Vec<Tried> = effects.par_iter().enumerate().map(all_of).collect();
        let (mut library, first) = maker.library(&tried);
        let (mut columns, mut scanned) = (Vec::new(), Vec::new());
        for ((i, effect), Tried { which, values, .. }) in effects.iter().enumerate().zip(tried) {
            let column = |u: &Unknown| {
                let positive = effect.parameters.iter().any(|p| p.name == u.own_name() && p.positive);
                Column { name: u.name.clone(), unit: u.unit.clone(), typical: typical(u), positive }
            };
            let own: Vec<Column> = source.sizes(i).map(column).collect();
            let origin = if effect.built_in { Origin::Catalogue } else { Origin::User };
            let variant = |(k, value): (usize, f64)| {
                let at = first[i] + k * own.len();
                search::Variant { shape: value, columns: at..at + own.len() }
            };
            let mut variants: Vec<_> = values.into_iter().enumerate().map(variant).collect();
            variants.sort_by(|a, b| a.shape.total_cmp(&b.shape));
            library.place(&effect.id, origin, variants, usize::from(which.is_some()));
            library.positive_of_last((0..own.len()).filter(|&k| own[k].positive).collect());
            columns.push(own);
            let shape = which.and_then(|which| effect.parameters.iter().filter(|p| p.shape.is_some()).nth(which));
            scanned.push(shape.map(|p| Scanned { name: p.name.clone(), unit: p.unit.clone() }));
        }
        let weight = fit.weight.clone();
        Self { effects, library, columns, scanned, left_out, source, weight }
    }

    /// The same candidates in a regression whose rows a change makes of this one's; `None` where columns are not kept in memory.
    pub(super) fn changed(self, change: Change) -> Option<Self> {
        Some(Self { library: self.library.changed(change)?, ..self })
    }

    /// Columns of some variants of candidates (both by index) before whitening, µm per typical size; touches that are not used
    /// are zero.
    #[must_use]
    pub fn raw_um(&self, wanted: &[(usize, usize)]) -> Vec<DMatrix<f64>> {
        let each = wanted.par_iter().map(|&(candidate, variant)| {
            let effect = self.effects[candidate];
            let value = self.library.candidates()[candidate].variants[variant].shape;
            let which = self.scanned[candidate]
                .as_ref()
                .and_then(|s| effect.parameters.iter().filter(|p| p.shape.is_some()).position(|p| p.name == s.name));
            let chosen = Chosen { effect: candidate, shape: which.map(|which| (which, value)) };
            let mut values = self.source.columns(chosen, None);
            for mut column in values.column_iter_mut() {
                column.iter_mut().zip(&self.weight).for_each(|(mm, weight)| *mm = um_from_mm(*mm) * weight);
            }
            values
        });
        each.collect()
    }
}
