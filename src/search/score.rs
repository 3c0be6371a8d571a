//! Score tests: what each candidate would take away from the misfit, and its expected size, without a refit.

use super::basis::Basis;
use super::distributions::{ln_p_of_f, ln_p_of_scan, p_of_chi2};
use super::library::{Candidate, Library, Origin, Variant};
use super::moments::{Block, Moments};
use super::multiplicity::{self, Family};
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

/// A variance of the touches that does not rest on the model, in units of the variance used for whitening.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PureError {
    /// Variance (1 where σ was taken from these repeats).
    pub variance: f64,
    /// Degrees of freedom.
    pub dof: f64,
    /// True when the repeats are rows of the regression: its residual holds them already.
    pub within: bool,
    /// What is left per degree of freedom counts as no less than this variance. Rows that were whitened with the upper bound
    /// of the scatter of visits are left with less than there is within a visit, and would make what changes there look sure.
    pub floor: bool,
}

impl PureError {
    /// σ as somebody told it, and no repeats that could say otherwise: what is left counts as no less. Touches that scatter less
    /// than their probe does (a virtual machine's, or those of a log with coarse digits) show what is no error of the machine.
    pub const TOLD: Self = Self { variance: 1.0, dof: 0.0, within: false, floor: true };
}

/// What an effect's sum of squares is held against: what is left of `ss` without it, on `dof` degrees of freedom.
pub(super) fn held_against(pure: Option<PureError>, ss: f64, dof: f64) -> f64 {
    match pure {
        Some(e) if e.floor => ss.max(e.variance * dof),
        _ => ss,
    }
}

/// One linearised regression at the minimum of its base model.
///
/// Rows are touches, then prior rows, whitened to unit noise. `residual` is the whitened gap g (measured less model)
/// and columns are derivatives of g, so that a missing effect of size θ has left g = −Jθ.
#[derive(Debug, Clone, Copy)]
pub struct Question<'a> {
    /// Whitened gaps.
    pub residual: &'a DVector<f64>,
    /// Basis of the base model.
    pub base: &'a Basis,
    /// From repeats; `None` where σ is declared.
    pub pure: Option<PureError>,
}

/// What one score test says.
#[derive(Debug, Clone)]
pub struct Score {
    /// Index in the library.
    pub candidate: usize,
    /// Which variant of its scan fits best.
    pub variant: usize,
    /// Rank q of what the plan sees of it; 0: it leaves no trace with this plan.
    pub q: usize,
    /// Degrees of freedom that it costs: q and the scanned shape parameters.
    pub n_parameters: usize,
    /// Sum of squares that it takes away.
    pub delta_ss: f64,
    /// F on (q, `dof`) of the best variant.
    pub f: f64,
    /// Residual degrees of freedom.
    pub dof: f64,
    /// Natural logarithm of the p-value, the scan taken into account; finite where p is not.
    pub ln_p: f64,
    /// The p-value.
    pub p: f64,
    /// Holm's, over the family that the candidate belongs to; below [`multiplicity::FAMILY_LEVEL`]: proposed.
    pub p_adjusted: f64,
    /// Expected size of each parameter, in typical sizes.
    pub estimate: DVector<f64>,
    pub covariance: DMatrix<f64>,
    /// Share of the candidate's norm that the base model cannot follow.
    pub kept: f64,
    /// Noncentrality as estimated, (ΔSS/s² − q) and not below 0.
    pub noncentrality: f64,
    /// Sum of squares taken away by each variant: a periodogram, where the scan is one of frequencies.
    pub scan: Vec<f64>,
    /// Logarithm of the determinant of what is left of each variant's columns; infinite where nothing is left.
    pub ln_left: Vec<f64>,
}

impl Score {
    /// Is it seen by this plan at all?
    #[must_use]
    pub fn visible(&self) -> bool {
        self.q > 0
    }

    /// Does it pass Holm's test in its family?
    #[must_use]
    pub fn proposed(&self) -> bool {
        self.visible() && self.p_adjusted < multiplicity::FAMILY_LEVEL
    }

    /// Places of parameters that are positive by nature and clearly (two standard uncertainties) negative here.
    #[must_use]
    pub fn wrong_signs(&self, library: &Library) -> Vec<usize> {
        let negative =
            |&&k: &&usize| k < self.estimate.len() && self.estimate[k] < -2.0 * self.covariance[(k, k)].max(0.0).sqrt();
        library.candidates()[self.candidate].positive.iter().filter(negative).copied().collect()
    }

    /// Largest expected size of a parameter, in typical sizes.
    #[must_use]
    pub fn relative_size(&self) -> f64 {
        self.estimate.amax()
    }
}

/// The score tests of a library, with what groups and later steps need.
#[derive(Debug, Clone)]
pub struct Search<'a> {
    /// The regression.
    pub question: Question<'a>,
    /// The candidates.
    pub library: &'a Library,
    /// One per candidate, in the library's order.
    pub scores: Vec<Score>,
    pub(super) moments: Moments,
    /// Index of each candidate's first variant among all variants.
    pub(super) first_variant: Vec<usize>,
}

impl<'a> Search<'a> {
    /// Tests all candidates.
    #[must_use]
    pub fn new(question: Question<'a>, library: &'a Library) -> Self {
        let moments = Moments::new(question.residual, question.base, library);
        let scores = score(&moments, library, question.pure);
        let first_variant = first_variants(library);
        Self { question, library, scores, moments, first_variant }
    }

    /// The tests again with a larger base: its first directions are those of this one's, and the residual is the same.
    #[must_use]
    pub fn with_larger_base<'b>(&self, question: Question<'b>) -> Search<'b>
    where
        'a: 'b,
    {
        let before = self.question.base.rank();
        let rows = question.base.transposed().rows(before, question.base.rank() - before).into_owned();
        let along = &rows * self.question.residual;
        let moments = self.moments.with_more(&rows, &along, self.library);
        let scores = score(&moments, self.library, question.pure);
        Search { question, library: self.library, scores, moments, first_variant: self.first_variant.clone() }
    }

    /// Indices of the visible candidates: those with a name first, then generic shapes; each by significance.
    #[must_use]
    pub fn ranking(&self) -> Vec<usize> {
        ranking(&self.scores, self.library)
    }

    /// The most significant effect with a name that passes Holm's test.
    #[must_use]
    pub fn leader(&self) -> Option<usize> {
        leader(&self.scores, self.library, false)
    }

    /// The most significant generic shape that passes Holm's test.
    #[must_use]
    pub fn leading_shape(&self) -> Option<usize> {
        leader(&self.scores, self.library, true)
    }

    /// What is left of a candidate's best variant.
    pub(super) fn block(&self, candidate: usize) -> Block {
        let variant = self.scores[candidate].variant;
        let first = self.library.candidates()[candidate].variants[variant].columns.start;
        self.moments.block(self.first_variant[candidate] + variant, first)
    }

    /// Columns of a candidate's best variant, N × parameters.
    #[must_use]
    pub fn columns(&self, candidate: usize) -> DMatrix<f64> {
        self.library.columns(candidate, self.scores[candidate].variant)
    }
}

pub(super) fn first_variants(library: &Library) -> Vec<usize> {
    let mut at = 0;
    library
        .candidates()
        .iter()
        .map(|c| {
            at += c.variants.len();
            at - c.variants.len()
        })
        .collect()
}

pub(super) fn ranking(scores: &[Score], library: &Library) -> Vec<usize> {
    let generic = |i: usize| library.candidates()[i].origin == Origin::Generic;
    let mut order: Vec<usize> = (0..scores.len()).filter(|&i| scores[i].visible()).collect();
    order.sort_by(|&a, &b| {
        generic(a)
            .cmp(&generic(b))
            .then(scores[a].ln_p.total_cmp(&scores[b].ln_p))
            .then(scores[b].delta_ss.total_cmp(&scores[a].delta_ss))
    });
    order
}

pub(super) fn leader(scores: &[Score], library: &Library, generic: bool) -> Option<usize> {
    let wanted = |i: usize| (library.candidates()[i].origin == Origin::Generic) == generic;
    ranking(scores, library).into_iter().find(|&i| wanted(i) && scores[i].proposed())
}

/// All score tests from inner products.
pub(super) fn score(moments: &Moments, library: &Library, pure: Option<PureError>) -> Vec<Score> {
    let first = first_variants(library);
    let mut scores: Vec<Score> =
        first.par_iter().enumerate().map(|(c, first)| score_of(moments, library, pure, (c, *first))).collect();
    multiplicity::adjust(&mut scores, |s| family(library, s.candidate));
    scores
}

/// What a variant takes away from the misfit.
struct Taken {
    block: Block,
    /// Of the residual, in the block's own directions.
    along: DVector<f64>,
    delta_ss: f64,
    ln_p: f64,
}

/// What there is to be taken from, and on how many degrees of freedom.
fn whole(moments: &Moments, pure: Option<PureError>) -> (f64, f64) {
    let (pure_ss, pure_dof) = match pure {
        Some(e) if !e.within => (e.variance * e.dof, e.dof),
        _ => (0.0, 0.0),
    };
    (moments.rr + pure_ss, moments.n as f64 - moments.p as f64 + pure_dof)
}

/// Shape parameters that a candidate's scan costs.
fn n_scanned(candidate: &Candidate) -> usize {
    if candidate.variants.len() > 1 { candidate.n_scanned } else { 0 }
}

/// What each variant of a candidate takes away, where these touches see it; its variants are those from `first` on.
fn taken(moments: &Moments, candidate: &Candidate, pure: Option<PureError>, first: usize) -> Vec<Option<Taken>> {
    /// So few variants are no work for a further thread.
    const FEW: usize = 32;
    let (total, free) = whole(moments, pure);
    let of = |(v, variant): (usize, &Variant)| {
        let block = moments.block(first + v, variant.columns.start);
        let q = block.rank();
        let dof = free - (q + n_scanned(candidate)) as f64;
        if q == 0 || dof < 1.0 {
            return None;
        }
        let along = block.whitener.tr_mul(&moments.jr.rows(variant.columns.start, variant.columns.len()));
        // rounding may take away more than there is
        let delta_ss = along.norm_squared().min(moments.rr);
        let ln_p = ln_p_of_f(delta_ss, q as f64, held_against(pure, total - delta_ss, dof), dof);
        Some(Taken { block, along, delta_ss, ln_p })
    };
    candidate.variants.par_iter().enumerate().with_min_len(FEW).map(of).collect()
}

/// The variant that fits best.
fn best(each: &[Option<Taken>]) -> Option<usize> {
    // of values that these touches cannot tell apart the first stands, and not the one that rounding favours
    const ROUNDING: f64 = 1e-9;
    let seen = each.iter().enumerate().filter_map(|(v, taken)| Some((v, taken.as_ref()?.ln_p)));
    let better = |best: (usize, f64), next: (usize, f64)| {
        if next.1 < best.1 - ROUNDING * best.1.abs().max(1.0) { next } else { best }
    };
    seen.reduce(better).map(|(variant, _)| variant)
}

/// The variant of a library's only candidate that fits best, and what it takes away.
#[must_use]
pub fn best_variant(question: Question, library: &Library) -> Option<(usize, f64)> {
    let moments = Moments::new(question.residual, question.base, library);
    let each = taken(&moments, library.candidates().first()?, question.pure, 0);
    let variant = best(&each)?;
    Some((variant, each[variant].as_ref()?.delta_ss))
}

/// The score test of a candidate; its variants are those from `first` on.
fn score_of(moments: &Moments, library: &Library, pure: Option<PureError>, (c, first): (usize, usize)) -> Score {
    let (total, free) = whole(moments, pure);
    let candidate = &library.candidates()[c];
    let n_scanned = n_scanned(candidate);
    let mut each = taken(moments, candidate, pure, first);
    let scan = each.iter().map(|t| t.as_ref().map_or(0.0, |t| t.delta_ss)).collect();
    let ln_left = each.iter().map(|t| t.as_ref().map_or(f64::INFINITY, |t| t.block.ln_det())).collect();
    let ln_each: Vec<f64> = each.iter().flatten().map(|t| t.ln_p).collect();
    let best = best(&each).and_then(|variant| Some((variant, each[variant].take()?)));
    let Some((variant, Taken { block, along, delta_ss, ln_p: ln_best })) = best else {
        let m = candidate.variants[0].columns.len();
        return Score {
            candidate: c,
            variant: 0,
            q: 0,
            n_parameters: 0,
            delta_ss: 0.0,
            f: 0.0,
            dof: free,
            ln_p: 0.0,
            p: 1.0,
            p_adjusted: 1.0,
            estimate: DVector::zeros(m),
            covariance: DMatrix::zeros(m, m),
            kept: 0.0,
            noncentrality: 0.0,
            scan,
            ln_left,
        };
    };
    let q = block.rank();
    let dof = free - (q + n_scanned) as f64;
    let rest = held_against(pure, total - delta_ss, dof);
    let variance = rest / dof;
    // a scanned shape is a parameter, and a long scan is bounded besides
    let ln_p = if n_scanned > 0 {
        let counted = ln_p_of_f(delta_ss, (q + n_scanned) as f64, rest, dof);
        counted.max(ln_p_of_scan(&ln_each, q))
    } else {
        ln_p_of_scan(&ln_each, q)
    };
    Score {
        candidate: c,
        variant,
        q,
        n_parameters: q + n_scanned,
        delta_ss,
        f: delta_ss / q as f64 / variance,
        dof,
        ln_p: if ln_best == f64::NEG_INFINITY { ln_best } else { ln_p },
        p: ln_p.exp(),
        p_adjusted: 1.0,
        estimate: -(&block.whitener * &along),
        covariance: &block.whitener * block.whitener.transpose() * variance,
        kept: block.kept,
        noncentrality: (delta_ss / variance - q as f64).max(0.0),
        scan,
        ln_left,
    }
}

/// The family of tests that a candidate belongs to.
pub(super) fn family(library: &Library, candidate: usize) -> Family {
    let candidate = &library.candidates()[candidate];
    match (candidate.origin == Origin::Generic, candidate.expected) {
        (false, _) => Family::Named,
        (true, false) => Family::Generic,
        (true, true) => Family::Expected,
    }
}

/// Does the base model fit at all? For display: a test against everything sees little of one effect.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LackOfFit {
    /// Sum of squares of the residual.
    pub ss: f64,
    /// Its degrees of freedom.
    pub dof: f64,
    /// Probability of so much misfit where the model holds.
    pub p: f64,
}

/// Lack of fit against the pure error, or against a declared σ by χ².
#[must_use]
pub fn lack_of_fit(question: &Question) -> LackOfFit {
    let ss = question.base.project(question.residual).norm_squared();
    let dof = question.residual.len() as f64 - question.base.rank() as f64;
    let p = match question.pure {
        _ if dof < 1.0 => 1.0,
        Some(e) if e.dof > 0.0 => {
            let (own_ss, own_dof) = if e.within { (e.variance * e.dof, e.dof) } else { (0.0, 0.0) };
            let (part, left) = (ss - own_ss, dof - own_dof);
            if left < 1.0 { 1.0 } else { ln_p_of_f(part, left, e.variance * e.dof, e.dof).exp() }
        }
        _ => p_of_chi2(ss, dof),
    };
    LackOfFit { ss, dof, p }
}
