//! Do shapes without a name say what is left better than effects with names do?
//!
//! A jump at one moment is followed a good part of the way by a warm-up, and the rest of it by a drift: each of them passes
//! its test, and all of them are wrong. So what the effects with names come to, one after another, is held against what
//! shapes come to, by what they leave and what they cost (Schwarz's criterion). Either side pays for the parameters that act
//! and not for those that it has besides: a block that slips in X alone is a slip all the same.

use super::Examination;
use crate::search::pattern_tests::{CONSTANT, Generics};
use crate::search::{Basis, KEPT, Question, Search};
use nalgebra::{DMatrix, DVector};

/// Steps on either side.
const MOST_STEPS: usize = 2;

/// A difference of the criterion beyond which there is no doubt which side is better.
const CLEARLY: f64 = 10.0;

/// A difference beyond which a single shape is said to be better: an effect with a name and the shape that it has by itself
/// are equally good, and the name says more.
const BETTER: f64 = 4.0;

/// What a shape still takes after the first effect counts when it is so much of all that there was to explain.
const SHARE: f64 = 0.1;

/// What came of it.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct Weighed {
    /// Shapes are clearly better: the name is one for a part of it.
    pub shapes_win: bool,
    /// Index of the first shape, where it alone is better than the first effect alone.
    pub better: Option<usize>,
}

/// Where a way ends.
struct End {
    basis: Basis,
    residual: DVector<f64>,
    /// Parameters that it costs.
    cost: usize,
    steps: Vec<usize>,
    /// Schwarz's criterion after the first step, and at the end.
    after_first: f64,
    criterion: f64,
}

impl End {
    /// Before the first step.
    fn start(question: Question) -> Self {
        Self {
            residual: question.base.project(question.residual),
            basis: question.base.clone(),
            cost: 0,
            steps: Vec::new(),
            after_first: f64::INFINITY,
            criterion: f64::INFINITY,
        }
    }
}

/// Adds what passes its test, the first candidate given or found by the tests that are made already.
fn way(tested: &Search, generic: bool, first: Option<usize>) -> End {
    let question = tested.question;
    let n = question.residual.len() as f64;
    let mut end = End::start(question);
    while end.steps.len() < MOST_STEPS {
        let again;
        let search = if end.steps.is_empty() {
            tested
        } else {
            again = tested.with_larger_base(Question { residual: &end.residual, base: &end.basis, ..question });
            &again
        };
        let found = if generic { search.leading_shape() } else { search.leader() };
        let Some(next) = first.filter(|_| end.steps.is_empty()).or(found) else { break };
        let score = &search.scores[next];
        let acting = acting(&end, &search.columns(next));
        if acting.ncols() == 0 || end.basis.extend(&acting, KEPT) == 0 {
            break;
        }
        end.residual = end.basis.project(&end.residual);
        end.cost += acting.ncols() + score.n_parameters - score.q;
        end.steps.push(next);
        end.criterion = n * end.residual.norm_squared().max(f64::MIN_POSITIVE).ln() + end.cost as f64 * n.ln();
        if end.steps.len() == 1 {
            end.after_first = end.criterion;
        }
    }
    end
}

/// The columns of a candidate that pay for themselves by the criterion: the one that takes most away, then the one that takes
/// most of what is left, as long as the criterion falls; at least one that is seen.
fn acting(end: &End, columns: &DMatrix<f64>) -> DMatrix<f64> {
    let n = end.residual.len() as f64;
    let mut residual = end.residual.clone();
    let mut left = end.basis.project_columns(columns);
    let seen: Vec<f64> = columns.column_iter().map(|c| KEPT * c.norm_squared()).collect();
    let mut kept: Vec<usize> = Vec::new();
    loop {
        let gain = |k: usize| {
            let own = left.column(k).norm_squared();
            if own > seen[k] { left.column(k).dot(&residual).powi(2) / own } else { 0.0 }
        };
        let free = (0..columns.ncols()).filter(|k| !kept.contains(k));
        let Some((k, gained)) = free.map(|k| (k, gain(k))).max_by(|a, b| a.1.total_cmp(&b.1)) else { break };
        let ss = residual.norm_squared();
        let pays = n * (ss / (ss - gained).max(f64::MIN_POSITIVE)).ln() > n.ln();
        if gained <= 0.0 || (!pays && !kept.is_empty()) {
            break;
        }
        kept.push(k);
        let unit = left.column(k).normalize();
        residual -= &unit * unit.dot(&residual);
        let along = left.tr_mul(&unit);
        left -= &unit * along.transpose();
    }
    columns.select_columns(&kept)
}

/// Holds effects, `first` in front, against shapes.
pub(super) fn weigh(seen: &Examination, generics: &Generics, first: usize) -> Weighed {
    let names = way(&seen.search, false, Some(first));
    let shapes = way(&seen.patterns, true, None);
    let Some(&shape) = shapes.steps.first() else { return Weighed::default() };
    // visits that each stand elsewhere follow anything, and what is the same at every touch is a part of many effects
    let speaks = !["visit", CONSTANT].contains(&generics.shapes[shape].depends_on.as_str());
    let better = (speaks && shapes.after_first + BETTER < names.after_first).then_some(shape);
    // together they leave less and cost less
    let beaten = shapes.criterion + CLEARLY < names.criterion;
    Weighed { shapes_win: beaten || left_to_shapes(seen, first), better }
}

/// What columns leave and cost by themselves, by the criterion.
fn alone(question: Question, columns: &DMatrix<f64>) -> f64 {
    let n = question.residual.len() as f64;
    let mut end = End::start(question);
    let acting = acting(&end, columns);
    if acting.ncols() == 0 || end.basis.extend(&acting, KEPT) == 0 {
        return f64::INFINITY;
    }
    let left = end.basis.project(&end.residual).norm_squared().max(f64::MIN_POSITIVE);
    n * left.ln() + acting.ncols() as f64 * n.ln()
}

/// Do these columns explain what an effect explains, with no clear doubt?
pub(super) fn as_well(question: Question, effect: &DMatrix<f64>, columns: &DMatrix<f64>) -> bool {
    alone(question, columns) < alone(question, effect) + CLEARLY
}

/// Is much of it left to a shape once the first effect is in the model, and to no second effect?
fn left_to_shapes(seen: &Examination, first: usize) -> bool {
    let named = &seen.search;
    let question = named.question;
    let residual = question.base.project(question.residual);
    let dof = question.residual.len() as f64 - question.base.rank() as f64;
    let mut basis = question.base.clone();
    basis.extend(&named.columns(first), KEPT);
    let left = basis.project(&residual);
    let now = Question { residual: &left, base: &basis, ..question };
    let after = seen.patterns.with_larger_base(now);
    let Some(shape) = after.leading_shape() else { return false };
    let second = named.with_larger_base(now);
    let name_ln_p = second.leader().map_or(0.0, |l| second.scores[l].ln_p);
    let share = after.scores[shape].delta_ss / (residual.norm_squared() - dof).max(1.0);
    share > SHARE && after.scores[shape].ln_p + CLEARLY < name_ln_p
}
