//! On what the misfit depends: variables ranked, with the curve itself and a formula to start from.

use super::groups::Member;
use super::library::{Library, Origin};
use super::multiplicity::{FAMILY_LEVEL, GENERIC_LEVEL};
use super::pattern_tests::{CONSTANT, Features, Generics, Shape};
use super::score::{Question, Score, Search};
use super::shapes::{Function, Grouping};
use super::{Basis, KEPT};
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;
use std::ops::Range;

/// Points of a curve.
const POINTS: usize = 121;

/// A term of a formula: size times formula.
#[derive(Debug, Clone, PartialEq)]
pub struct SketchTerm {
    /// In the formula language; `None` where it has no words for the shape (groups of touches).
    pub formula: Option<String>,
    /// Size, in the unit of the dependence.
    pub size: f64,
    /// Its standard uncertainty.
    pub sigma: f64,
}

/// A number inside the formulas of a dependence that a fit may refine.
#[derive(Debug, Clone, PartialEq)]
pub struct SketchShape {
    /// Name, as the formulas say it.
    pub name: String,
    /// Its unit.
    pub unit: String,
    /// What the scan found.
    pub start: f64,
    /// Smallest sensible value: the neighbour in the scan.
    pub min: f64,
    /// Largest sensible value.
    pub max: f64,
}

/// A point of a curve: what the misfit is at a value of the variable.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CurvePoint {
    /// Value of the variable, in its unit; number of the group from 1 for groups.
    pub x: f64,
    /// Size of the misfit, in the unit of the dependence, against its mean over the touches.
    pub y: f64,
    /// Standard uncertainty of y.
    pub sigma: f64,
}

/// What the misfit depends on.
#[derive(Debug, Clone)]
pub struct Dependence {
    /// The variable or pair of variables, or `block`, `face`, `visit`.
    pub on: String,
    /// Id of the generic candidate that shows it best.
    pub id: String,
    /// Its index in the library.
    pub candidate: usize,
    /// Name of the direction in which it acts.
    pub direction: String,
    /// What the scan found: order of a rotary axis, period, place of a step or kink, time constant; 0 without a scan.
    pub scanned: f64,
    /// ΔSS as a share of the misfit's sum of squares.
    pub share: f64,
    /// p-value, the scan taken into account.
    pub p: f64,
    /// Its logarithm.
    pub ln_p: f64,
    /// Holm's over all generic shapes, against the whole level.
    pub p_adjusted: f64,
    /// `at` of an effect that acts so.
    pub at: String,
    /// `dof` of it.
    pub dof: String,
    /// Unit of its size.
    pub unit: String,
    /// Formula, as a sum of terms.
    pub terms: Vec<SketchTerm>,
    /// The number that the scan found, where a fit may refine it; the formulas then have it by name.
    pub shape: Option<SketchShape>,
    /// Numbers of the groups of touches that it is of: one for each point of a curve over groups, one for a block that
    /// moves.
    pub groups: Vec<usize>,
    /// The curve against the variable; empty for a product of two variables.
    pub curve: Vec<CurvePoint>,
}

/// The generic search: what the misfit depends on, best first, one entry per variable or pair.
///
/// The leader of the ranking goes first, unless a simpler shape (fewer variables, then smaller p; any before groups of visits) says the same. What is the
/// same at every touch depends on no variable: it is a finding of its own, and taken off before variables are looked at, or
/// each group of touches and each step near an end of the run would be credited with it.
#[must_use]
pub fn dependences(patterns: &Search, features: &Features, generics: &Generics) -> Vec<Dependence> {
    let question = patterns.question;
    let total = question.base.project(question.residual).norm_squared();
    let constants = Constants::new(&question, generics);
    let same = Search::new(question, &constants.library);
    let search = patterns.with_larger_base(Question { base: &constants.base, ..question });
    let mut ranking = search.ranking();
    // what passes goes before what does not: of one variable the first entry speaks
    ranking.sort_by_key(|&c| !search.scores[c].proposed());
    let mut order = Vec::new();
    if let Some(&leader) = ranking.first() {
        let passes = search.scores[leader].proposed();
        let group = search.group_of(leader, &ranking);
        // a level for each index visit says whatever goes with pose or time, and why it does of none: it is what is left over
        let key = |m: &Member| {
            let on = &generics.shapes[m.candidate].depends_on;
            (if on == "visit" { usize::MAX } else { on.matches('*').count() }, search.scores[m.candidate].ln_p)
        };
        let alike = group.members.iter().filter(|m| search.scores[m.candidate].proposed() == passes);
        let simplest = alike.min_by(|a, b| {
            let ((n, p), (k, q)) = (key(a), key(b));
            n.cmp(&k).then(p.total_cmp(&q))
        });
        order.extend(simplest.map(|m| m.candidate));
    }
    order.extend(ranking);
    let on = |candidate: usize| generics.shapes[candidate].depends_on.as_str();
    let mut first: Vec<usize> = Vec::new();
    for candidate in order {
        if first.iter().all(|&other| on(other) != on(candidate)) {
            first.push(candidate);
        }
    }
    let of = |&candidate: &usize| {
        dependence(&search, &search.scores[candidate], &generics.shapes[candidate], features, generics, total)
    };
    let mut out: Vec<Dependence> = first.par_iter().map(of).collect();
    if let Some(mut score) = same.ranking().first().map(|&c| same.scores[c].clone()) {
        score.p_adjusted = constants.p_adjusted(&score, &search);
        score.candidate = constants.candidates[score.candidate];
        let passes = |d: &Dependence| d.p_adjusted < FAMILY_LEVEL;
        let constant = dependence(&search, &score, &generics.shapes[score.candidate], features, generics, total);
        // beside something that changes it is the level of that
        let at = usize::from(out.first().is_some_and(passes) || !passes(&constant)).min(out.len());
        out.insert(at, constant);
    }
    out
}

/// Does the misfit depend on anything, the constant included? As [`dependences`] finds it, at a part of the cost.
#[must_use]
pub fn depends_on_anything(question: Question, generics: &Generics) -> bool {
    let constants = Constants::new(&question, generics);
    let same = Search::new(question, &constants.library);
    let search = Search::new(Question { base: &constants.base, ..question }, &generics.library);
    let first = same.ranking().first().map(|&c| constants.p_adjusted(&same.scores[c], &search));
    first.is_some_and(|p| p < FAMILY_LEVEL) || search.scores.iter().any(Score::proposed)
}

/// Shapes that are the same at every touch.
struct Constants {
    /// Their indices among all shapes.
    candidates: Vec<usize>,
    library: Library,
    /// The model's base with them.
    base: Basis,
}

impl Constants {
    fn new(question: &Question, generics: &Generics) -> Self {
        let is_constant = |c: &usize| generics.shapes[*c].depends_on == CONSTANT;
        let candidates: Vec<usize> = (0..generics.shapes.len()).filter(is_constant).collect();
        let mut base = question.base.clone();
        let mut library = Library::new(generics.library.n_rows());
        for &c in &candidates {
            let columns = generics.library.columns(c, 0);
            base.extend(&columns, KEPT);
            library.push(&generics.library.candidates()[c].id, Origin::Generic, &columns);
        }
        Self { candidates, library, base }
    }

    /// A constant's adjusted p-value: it is in one family with all the shapes that are tested beside it.
    fn p_adjusted(&self, score: &Score, others: &Search) -> f64 {
        let tested = others.scores.iter().filter(|s| s.visible()).count() + self.candidates.len();
        (score.p * tested as f64 * FAMILY_LEVEL / GENERIC_LEVEL).min(1.0)
    }
}

fn dependence(
    search: &Search,
    score: &Score,
    shape: &Shape,
    features: &Features,
    generics: &Generics,
    total: f64,
) -> Dependence {
    let candidate = &generics.library.candidates()[score.candidate];
    let all = &shape.functions[score.variant];
    // of a shape in several directions at once, the one that shows it best speaks for it
    let told = |i: usize| score.estimate[i].abs() / score.covariance[(i, i)].max(f64::MIN_POSITIVE).sqrt();
    let main = (0..all.len()).max_by(|&a, &b| told(a).total_cmp(&told(b))).unwrap_or(0);
    let (of_shape, kept) = match (shape.direction, all.get(main)) {
        (None, Some(Function::Along { direction, .. })) => (*direction, main..main + 1),
        (direction, _) => (direction.unwrap_or(0), 0..all.len()),
    };
    let direction = &features.directions[of_shape];
    let functions = &all[kept.clone()];
    let free = functions.first().and_then(|f| f.free_parameter(features));
    let terms = functions
        .iter()
        .enumerate()
        .map(|(i, f)| SketchTerm {
            formula: f.formula(features, free.map(|(name, _, _)| name)),
            size: score.estimate[kept.start + i],
            sigma: score.covariance[(kept.start + i, kept.start + i)].max(0.0).sqrt(),
        })
        .collect();
    let scanned = candidate.variants[score.variant].shape;
    Dependence {
        on: shape.depends_on.clone(),
        id: candidate.id.clone(),
        candidate: score.candidate,
        direction: direction.name.clone(),
        scanned,
        share: if total > 0.0 { score.delta_ss / total } else { 0.0 },
        p: score.p,
        ln_p: score.ln_p,
        p_adjusted: score.p_adjusted,
        at: direction.at.clone(),
        dof: direction.dof.clone(),
        unit: direction.unit.clone(),
        terms,
        shape: free.map(|(name, unit, start)| {
            let neighbours = || candidate.variants.iter().map(|v| v.shape).filter(|s| *s != start);
            let below = neighbours().filter(|s| *s < start).fold(f64::NEG_INFINITY, f64::max);
            let above = neighbours().filter(|s| *s > start).fold(f64::INFINITY, f64::min);
            SketchShape {
                name: name.to_owned(),
                unit: unit.to_owned(),
                start,
                min: if below.is_finite() { below } else { start - 0.5 * start.abs() },
                max: if above.is_finite() { above } else { start + start.abs().max(1e-3) },
            }
        }),
        groups: functions.iter().filter_map(|f| f.group().map(|g| g.1)).collect(),
        curve: curve(search, score, shape, features, &kept),
    }
}

/// Combinations of functions of which the model leaves less than this share (of the best one's share) are no part of the
/// curve: the model follows them by itself, and their size is anybody's guess.
const LEAST_LEFT: f64 = 0.05;

/// What of a sum of functions the model cannot follow: the matrix that takes sizes to those of that part. From the
/// directions v of VᵀRV = 1, VᵀLV = diag(share left), with R = JᵀJ and L = JᵀPJ.
fn beyond_the_model(columns: &DMatrix<f64>, left: &DMatrix<f64>) -> DMatrix<f64> {
    let n = columns.ncols();
    let (raw, gram) = (columns.tr_mul(columns), left.tr_mul(left));
    let scale: Vec<f64> = (0..n).map(|i| if raw[(i, i)] > 0.0 { raw[(i, i)].sqrt() } else { 1.0 }).collect();
    let scaled = |m: &DMatrix<f64>| DMatrix::from_fn(n, n, |i, j| m[(i, j)] / (scale[i] * scale[j]));
    let own = scaled(&raw).symmetric_eigen();
    let kept: Vec<usize> = (0..n).filter(|&i| own.eigenvalues[i] > 1e-9 * own.eigenvalues.max()).collect();
    // W: directions in which the functions differ at the touches, of unit norm there
    let mut w = own.eigenvectors.select_columns(&kept);
    for (mut column, &i) in w.column_iter_mut().zip(&kept) {
        column /= own.eigenvalues[i].sqrt();
    }
    let shares = (w.transpose() * scaled(&gram) * &w).symmetric_eigen();
    let least = LEAST_LEFT * shares.eigenvalues.max();
    let seen: Vec<usize> = (0..kept.len()).filter(|&i| shares.eigenvalues[i] >= least).collect();
    let v = w * shares.eigenvectors.select_columns(&seen);
    let onto = &v * (v.transpose() * scaled(&raw));
    DMatrix::from_fn(n, n, |i, j| onto[(i, j)] * scale[j] / scale[i])
}

/// The curve as a contrast: what the model follows by itself is left out, and so is its mean over the touches, because
/// neither is told by what is left over. Its uncertainty is that of the contrast.
fn curve(search: &Search, score: &Score, shape: &Shape, features: &Features, kept: &Range<usize>) -> Vec<CurvePoint> {
    let functions = &shape.functions[score.variant][kept.clone()];
    if functions.is_empty() {
        return Vec::new();
    }
    let columns = search.columns(score.candidate).columns(kept.start, kept.len()).into_owned();
    let beyond = beyond_the_model(&columns, &search.question.base.project_columns(&columns));
    let estimate = &beyond * score.estimate.rows(kept.start, kept.len());
    let covariance = score.covariance.view((kept.start, kept.start), (kept.len(), kept.len()));
    let covariance = &beyond * covariance * beyond.transpose();
    // touches count by how much they see of the direction
    let direction = match (shape.direction, functions.first()) {
        (None, Some(Function::Along { direction, .. })) => Some(*direction),
        (direction, _) => direction,
    };
    let n_touches = features.block.len();
    // what moves one block is told by its touches alone
    let moved = match (&shape.variables[..], functions.first().and_then(Function::group)) {
        ([_], Some((Grouping::Block, number))) => Some(number),
        _ => None,
    };
    let of_it = |i: usize| moved.is_none_or(|number| features.block[i] == number);
    let acts = |i: usize| shape.variables.iter().all(|&v| features.variables[v].acts_at(i));
    let weight = |i: usize| match direction {
        _ if !of_it(i) || !acts(i) => 0.0,
        Some(d) => features.directions[d].weight[i].powi(2),
        None => 1.0,
    };
    let total: f64 = (0..n_touches).map(weight).sum();
    let mean = |f: &Function| -> f64 {
        let f = if let Function::Along { of, .. } = f { of.as_ref() } else { f };
        let sum: f64 = (0..n_touches).map(|i| weight(i) * f.at_row(features, i)).sum();
        if total > 0.0 { sum / total } else { 0.0 }
    };
    let means = DVector::from_iterator(functions.len(), functions.iter().map(mean));
    let point = |x: f64, values: DVector<f64>| {
        let values = values - &means;
        CurvePoint { x, y: estimate.dot(&values), sigma: values.dot(&(&covariance * &values)).max(0.0).sqrt() }
    };
    match shape.variables[..] {
        [] if shape.depends_on == CONSTANT => Vec::new(),
        [] => (0..functions.len())
            .map(|i| point((i + 1) as f64, DVector::from_fn(functions.len(), |k, _| f64::from(u8::from(i == k)))))
            .collect(),
        [v] => {
            let values = || (0..n_touches).filter(|&i| of_it(i) && acts(i)).map(|i| features.variables[v].values[i]);
            let low = values().fold(f64::INFINITY, f64::min);
            let high = values().fold(f64::NEG_INFINITY, f64::max);
            (0..POINTS)
                .map(|i| {
                    let x = low + (high - low) * i as f64 / (POINTS - 1) as f64;
                    point(x, DVector::from_iterator(functions.len(), functions.iter().map(|f| f.at(x))))
                })
                .collect()
        }
        _ => Vec::new(),
    }
}
