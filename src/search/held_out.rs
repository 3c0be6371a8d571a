//! Does a term predict touches that had no part in choosing it?
//!
//! Groups of touches (set-ups, index visits) are left out one at a time. Everything that leads to a term is redone on
//! the rest: the projection, all score tests, Holm, the choice. Inner products add up over touches, so a training set
//! is the whole less one group, and no factorisation ever sees all touches again.

use super::basis::Basis;
use super::library::Library;
use super::moments::{Block, Moments};
use super::score::{Question, Search, leader, score};
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;
use std::collections::{BTreeMap, HashMap};

/// Touches whose prediction has a variance above this (in variances of a touch) judge nothing.
pub const LARGEST_VARIANCE: f64 = 9.0;

/// Logarithms of p-values that differ by less (a factor of 20) do not separate two candidates.
const NOT_SEPARATED: f64 = super::groups::AS_LIKELY;

/// Directions of the base of which a training set keeps less than this share of the information are lost to it.
const LOST: f64 = 1e-8;

/// Which term is put to the test.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Choice<'a> {
    /// The choice is redone in each training set: the leader with a name that passes Holm, or none. Where it cannot be separated
    /// from the leader of all touches, that one.
    Redone,
    /// A given candidate, with the variant that fits the training set best; the choice is not tested.
    Given(usize),
    /// As these folds chose, with the variants that fit best here.
    AsIn(&'a [Fold]),
}

/// Squared error on held-out touches, with and without the term.
#[derive(Debug, Clone, PartialEq)]
pub struct HeldOut {
    /// Root mean square error of the base model on the held-out touches that it can predict, in the unit of [`Colours`] (standard
    /// deviations of a whitened row without them); not a number where no touch could be predicted.
    pub before: f64,
    /// The same with the chosen terms, on the same touches: one that they make unpredictable is predicted without them.
    pub after: f64,
    /// Standard error of before less after, from its spread over groups.
    pub fall_error: f64,
    /// Touches that the base model could predict.
    pub scored: usize,
    /// Touches in groups.
    pub touches: usize,
    /// By how much the sum of squared errors falls.
    pub gain: f64,
    /// Standard error of the gain, from its spread over groups.
    pub standard_error: f64,
    /// Per group: its number, the candidate chosen without it, and by how much its squared error falls.
    pub folds: Vec<Fold>,
}

/// One group left out.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Fold {
    /// Number of the group.
    pub group: usize,
    /// Candidate that was chosen without it; `None`: nothing passed.
    pub chosen: Option<usize>,
    /// By how much the sum of squared whitened errors of its touches falls.
    pub gain: f64,
    /// By how much that of its touches falls, in the unit of [`Colours`].
    pub gain_coloured: f64,
    /// Touches of it that the base model could predict.
    pub scored: usize,
}

impl HeldOut {
    /// Does the error fall by more than its standard error?
    #[must_use]
    pub fn falls(&self) -> bool {
        self.gain > self.standard_error && self.gain > 0.0
    }
}

/// What turns whitened rows of a group back into its touches.
#[derive(Debug, Clone)]
pub struct Colours {
    /// A square matrix for each group; rows of a group without one stay as they are.
    pub by_group: HashMap<usize, DMatrix<f64>>,
    /// Standard deviation of a touch in the unit of the touches.
    pub sigma: f64,
}

impl Default for Colours {
    fn default() -> Self {
        Self { by_group: HashMap::new(), sigma: 1.0 }
    }
}

impl Colours {
    /// Rows of a group as those of its touches.
    #[must_use]
    pub fn touches(&self, group: usize, rows: &DMatrix<f64>) -> DMatrix<f64> {
        self.by_group.get(&group).map_or_else(|| rows.clone(), |c| c * rows)
    }
}

/// Errors as they are.
#[must_use]
pub fn held_out(question: Question, library: &Library, groups: &[usize], choice: Choice) -> HeldOut {
    held_out_in(question, library, groups, choice, &Colours::default())
}

/// Leaves out each group in turn. `groups[i]` is the group of row i; rows beyond its end (priors) are always known.
/// Rows that whitening has mixed must stand in one group.
#[must_use]
pub fn held_out_in(
    question: Question,
    library: &Library,
    groups: &[usize],
    choice: Choice,
    colours: &Colours,
) -> HeldOut {
    Search::new(question, library).held_out_in(groups, choice, colours)
}

impl Search<'_> {
    /// Leaves out each group in turn, errors as they are; see [`held_out_in`].
    #[must_use]
    pub fn held_out(&self, groups: &[usize], choice: Choice) -> HeldOut {
        self.held_out_in(groups, choice, &Colours::default())
    }

    fn held_out_in(&self, groups: &[usize], choice: Choice, colours: &Colours) -> HeldOut {
        let residual = self.question.base.project(self.question.residual);
        let first = if matches!(choice, Choice::Redone) { self.leader() } else { None };
        let mut rows: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
        for (row, &group) in groups.iter().enumerate() {
            rows.entry(group).or_default().push(row);
        }
        let of = |(&group, rows): (&usize, &Vec<usize>)| {
            fold(self.question, self.library, (&self.moments, &residual), (group, rows), choice, (colours, first))
        };
        summed(rows.par_iter().map(of).collect(), groups.len())
    }
}

fn summed(results: Vec<Result>, touches: usize) -> HeldOut {
    let scored: usize = results.iter().map(|r| r.fold.scored).sum();
    let gain: f64 = results.iter().map(|r| r.fold.gain).sum();
    let before: f64 = results.iter().map(|r| r.before).sum();
    let fall: f64 = results.iter().map(|r| r.fold.gain_coloured).sum();
    let folds: Vec<Fold> = results.into_iter().map(|r| r.fold).collect();
    let n = folds.len() as f64;
    let error_of = |total: f64, each: &dyn Fn(&Fold) -> f64| -> f64 {
        let spread: f64 = folds.iter().map(|f| (each(f) - total / n).powi(2)).sum();
        if n > 1.0 { (n / (n - 1.0) * spread).sqrt() } else { f64::INFINITY }
    };
    let root = |ss: f64| if scored == 0 { f64::NAN } else { (ss.max(0.0) / scored as f64).sqrt() };
    let (before, after) = (root(before), root(before - fall));
    HeldOut {
        before,
        after,
        fall_error: error_of(fall, &|f| f.gain_coloured) / (scored as f64 * (before + after)),
        scored,
        touches,
        gain,
        standard_error: error_of(gain, &|f| f.gain),
        folds,
    }
}

struct Result {
    fold: Fold,
    /// Sum of squares without the term, in the unit of the colour.
    before: f64,
}

/// What a group of touches bears of the directions of a base: QᵀQ of the training set is the identity less the group's.
struct Borne {
    /// Directions of which the group bears something, p × m, orthonormal.
    directions: DMatrix<f64>,
    /// Share of each that is left to the training set; 0 where it is lost.
    left: Vec<f64>,
}

impl Borne {
    /// Of the group's rows of the basis, p × group; by whichever of the two products is the smaller.
    fn new(q_g: &DMatrix<f64>) -> Self {
        /// A share that is no more than rounding.
        const NOTHING: f64 = 1e-12;
        let (p, n) = q_g.shape();
        if p == 0 {
            return Self { directions: DMatrix::zeros(0, 0), left: Vec::new() };
        }
        let product = if n < p { q_g.tr_mul(q_g) } else { q_g * q_g.transpose() };
        let eigen = product.symmetric_eigen();
        let borne: Vec<usize> = (0..eigen.eigenvalues.len()).filter(|&i| eigen.eigenvalues[i] > NOTHING).collect();
        let mut directions = eigen.eigenvectors.select_columns(&borne);
        if n < p {
            directions = q_g * directions;
            for (mut direction, &i) in directions.column_iter_mut().zip(&borne) {
                direction /= eigen.eigenvalues[i].sqrt();
            }
        }
        let left = borne.iter().map(|&i| 1.0 - eigen.eigenvalues[i]).map(|left| if left > LOST { left } else { 0.0 });
        Self { directions, left: left.collect() }
    }

    /// Coordinates in the basis as those in one that the training set makes orthonormal; nothing along what is lost.
    fn orthonormal_again(&self, mut x: DMatrix<f64>) -> DMatrix<f64> {
        let mut along = self.directions.tr_mul(&x);
        for (mut row, left) in along.row_iter_mut().zip(&self.left) {
            row *= if *left > 0.0 { left.sqrt().recip() - 1.0 } else { -1.0 };
        }
        x.gemm(1.0, &self.directions, &along, 1.0);
        x
    }

    /// Coordinates along what is lost.
    fn lost(&self, x: &DMatrix<f64>) -> DMatrix<f64> {
        let lost: Vec<usize> = (0..self.left.len()).filter(|&i| self.left[i] == 0.0).collect();
        self.directions.select_columns(&lost).tr_mul(x)
    }

    fn n_lost(&self) -> usize {
        self.left.iter().filter(|left| **left == 0.0).count()
    }
}

/// One group left out: the training set as whole less group, in the coordinates of the full basis.
fn fold(
    question: Question,
    library: &Library,
    (whole, residual): (&Moments, &DVector<f64>),
    (group, rows): (usize, &[usize]),
    choice: Choice,
    (colours, first): (&Colours, Option<usize>),
) -> Result {
    let base: &Basis = question.base;
    let p = base.rank();
    // p × group, group × columns, group
    let q_g = base.transposed().select_columns(rows);
    let j_g = library.at_rows(rows);
    let r_g = DVector::from_iterator(rows.len(), rows.iter().map(|&i| residual[i]));

    let group_bears = Borne::new(&q_g);
    let into = |x: DMatrix<f64>| group_bears.orthonormal_again(x);
    // the projected residual has QᵀR = 0 as a whole
    let qr = -into(DMatrix::from_columns(&[&q_g * &r_g])).column(0);
    let qj = into(&whole.qj - &q_g * &j_g);
    let rr = whole.rr - r_g.norm_squared() - qr.norm_squared();
    let jr = &whole.jr - j_g.tr_mul(&r_g) - qj.tr_mul(&qr);
    let blocks: Vec<DMatrix<f64>> = library
        .candidates()
        .iter()
        .flat_map(|c| &c.variants)
        .zip(&whole.blocks)
        .map(|(variant, block)| {
            let part = j_g.columns(variant.columns.start, variant.columns.len());
            block - part.transpose() * part
        })
        .collect();
    let training = Moments { n: whole.n - rows.len(), p: p - group_bears.n_lost(), rr: rr.max(0.0), jr, qj, blocks };
    let scores = score(&training, library, question.pure);
    let chosen = match choice {
        // a training set that cannot separate the leader of all touches from its rival chooses the same
        Choice::Redone => leader(&scores, library, false).map(|c| {
            first.filter(|&f| scores[f].visible() && scores[f].ln_p - scores[c].ln_p < NOT_SEPARATED).unwrap_or(c)
        }),
        Choice::Given(c) => scores[c].visible().then_some(c),
        Choice::AsIn(folds) => {
            folds.iter().find(|f| f.group == group).and_then(|f| f.chosen).filter(|&c| scores[c].visible())
        }
    };

    // each touch of the group in the training basis: prediction r̂ = −… of the residual, and its variance
    let lost_g = group_bears.lost(&q_g);
    let seen_g = into(q_g);
    let known: Vec<bool> = (0..rows.len())
        .map(|i| lost_g.column(i).norm_squared() < 1e-12 && seen_g.column(i).norm_squared() < LARGEST_VARIANCE)
        .collect();
    let base_error = &r_g - seen_g.tr_mul(&qr);
    // the same touch by touch: rows that whitening has mixed are no touches, and what one of them lacks all of them would lack
    let s2 = colours.sigma.powi(2);
    let [seen_t, lost_t] = [&seen_g, &lost_g].map(|rows| colours.touches(group, &rows.transpose()));
    let error_of = |e: &DVector<f64>| {
        let column = DMatrix::from_column_slice(e.len(), 1, e.as_slice());
        colours.touches(group, &column).column(0).into_owned()
    };
    let predicted: Vec<bool> = (0..rows.len())
        .map(|i| {
            let variance = seen_t.row(i).norm_squared();
            lost_t.row(i).norm_squared() < 1e-12 * s2 && variance < LARGEST_VARIANCE * s2
        })
        .collect();
    let base_error_t = error_of(&base_error);
    let (before_t, scored) = sum(&base_error_t, &predicted);
    let Some(c) = chosen else {
        return Result { fold: Fold { group, chosen, gain: 0.0, gain_coloured: 0.0, scored }, before: before_t };
    };
    let variant = scores[c].variant;
    let span = library.candidates()[c].variants[variant].columns.clone();
    let index: usize = library.candidates()[..c].iter().map(|k| k.variants.len()).sum::<usize>() + variant;
    let block: Block = training.block(index, span.start);
    // what the touches see of the term once the training base has taken its part, in the term's own orthonormal basis
    let own = j_g.columns(span.start, span.len()) - seen_g.tr_mul(&training.qj.columns(span.start, span.len()));
    let own = own * &block.whitener;
    let along = block.whitener.tr_mul(&training.jr.rows(span.start, span.len()));
    let error = &base_error - &own * along;
    let known: Vec<bool> = known
        .iter()
        .enumerate()
        .map(|(i, &k)| k && seen_g.column(i).norm_squared() + own.row(i).norm_squared() < LARGEST_VARIANCE)
        .collect();
    let (before, _) = sum(&base_error, &known);
    let (after, _) = sum(&error, &known);
    // a touch that the term makes unpredictable is predicted without it, so that both errors are of the same touches
    let own_t = colours.touches(group, &own);
    let mut error_t = error_of(&error);
    for i in 0..rows.len() {
        if seen_t.row(i).norm_squared() + own_t.row(i).norm_squared() >= LARGEST_VARIANCE * s2 {
            error_t[i] = base_error_t[i];
        }
    }
    let (after_t, _) = sum(&error_t, &predicted);
    let fold = Fold { group, chosen, gain: before - after, gain_coloured: before_t - after_t, scored };
    Result { fold, before: before_t }
}

fn sum(error: &DVector<f64>, known: &[bool]) -> (f64, usize) {
    error.iter().zip(known).filter(|(_, k)| **k).fold((0.0, 0), |(ss, n), (e, _)| (ss + e * e, n + 1))
}

#[cfg(test)]
mod tests {
    use super::super::testing::{noise, noise_matrix, rng};
    use super::super::tests::ask;
    use super::*;
    use crate::search::{Origin, Score};

    const FOLDS: usize = 12;
    const ROWS: usize = 120;

    fn two_candidates(a: &DVector<f64>, b: &DVector<f64>) -> Library {
        let mut library = Library::new(ROWS);
        library.push("a", Origin::Catalogue, &DMatrix::from_columns(std::slice::from_ref(a)));
        library.push("b", Origin::Catalogue, &DMatrix::from_columns(std::slice::from_ref(b)));
        library
    }

    fn group_of_rows() -> Vec<usize> {
        (0..ROWS).map(|i| i / (ROWS / FOLDS)).collect()
    }

    /// The score tests of the rows that are not in a group, computed from these rows only.
    fn scores_without(group: usize, a: &DMatrix<f64>, residual: &DVector<f64>, library: &Library) -> Vec<Score> {
        let groups = group_of_rows();
        let train: Vec<usize> = (0..ROWS).filter(|&i| groups[i] != group).collect();
        let base = Basis::new(&a.select_rows(&train));
        let residual = residual.select_rows(&train);
        let mut own = Library::new(train.len());
        for (i, candidate) in library.candidates().iter().enumerate() {
            own.push(candidate.id.clone(), Origin::Catalogue, &library.columns(i, 0).select_rows(&train));
        }
        Search::new(ask(&residual, &base), &own).scores
    }

    /// The rival is better in a training set by less than the factor of the rule: the choice is that of all touches.
    #[test]
    fn a_rival_that_cannot_be_separated_does_not_change_the_choice() {
        let (mut runs, mut folds_of_rival) = (0, 0);
        for seed in 0..40 {
            let mut rng = rng(300 + seed);
            let known = noise_matrix(&mut rng, ROWS, 3);
            let base = Basis::new(&known);
            let a = noise(&mut rng, ROWS);
            let b = &a + noise(&mut rng, ROWS) * 0.12;
            let residual = noise(&mut rng, ROWS) - &a * 1.5;
            let library = two_candidates(&a, &b);
            if Search::new(ask(&residual, &base), &library).leader() != Some(0) {
                continue;
            }
            let ahead: Vec<f64> = (0..FOLDS)
                .map(|group| scores_without(group, &known, &residual, &library))
                .map(|scores| scores[0].ln_p - scores[1].ln_p)
                .collect();
            assert!(ahead.iter().all(|ahead| *ahead < NOT_SEPARATED), "{seed}: {ahead:?}");
            let rival = ahead.iter().filter(|ahead| **ahead > 0.0).count();
            if rival == 0 {
                continue;
            }
            (runs, folds_of_rival) = (runs + 1, folds_of_rival + rival);
            let held = held_out(ask(&residual, &base), &library, &group_of_rows(), Choice::Redone);
            let chosen: Vec<Option<usize>> = held.folds.iter().map(|fold| fold.chosen).collect();
            assert_eq!(chosen, [Some(0); FOLDS], "{seed}: {ahead:?}");
            assert!(held.falls(), "{seed}: {held:?}");
        }
        println!("the rival is ahead in {folds_of_rival} folds of {runs} runs");
        assert!(runs >= 3, "the rule must decide: {runs}");
    }

    /// One group alone speaks for the first candidate. Without it the rival is clearly better, and is chosen.
    #[test]
    fn a_rival_that_is_clearly_better_without_a_group_is_chosen() {
        let mut rng = rng(340);
        let known = noise_matrix(&mut rng, ROWS, 3);
        let base = Basis::new(&known);
        let a = noise(&mut rng, ROWS);
        let groups = group_of_rows();
        // in group 0 the two differ much, and there only the first one acts
        let apart = noise(&mut rng, ROWS);
        let b = DVector::from_fn(ROWS, |i, _| a[i] + apart[i] * if groups[i] == 0 { 4.0 } else { 0.4 });
        let residual =
            noise(&mut rng, ROWS) * 0.5 - DVector::from_fn(ROWS, |i, _| 1.5 * if groups[i] == 0 { a[i] } else { b[i] });
        let library = two_candidates(&a, &b);
        assert_eq!(Search::new(ask(&residual, &base), &library).leader(), Some(0));
        let scores = scores_without(0, &known, &residual, &library);
        assert!(scores[0].ln_p - scores[1].ln_p > NOT_SEPARATED, "{scores:?}");
        let held = held_out(ask(&residual, &base), &library, &groups, Choice::Redone);
        assert_eq!(held.folds[0].chosen, Some(1));
        assert!(held.folds[1..].iter().all(|fold| fold.chosen == Some(0)), "{:?}", held.folds);
    }
}
