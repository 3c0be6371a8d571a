//! What a plan can see, before anything is measured.

use super::basis::Basis;
use super::library::Library;
use super::moments::{Block, Moments};
use super::score::{Search, first_variants};
use nalgebra::{DMatrix, DVector};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use rayon::prelude::*;
use std::ops::Range;

pub use super::distinguishability::SEEN;

/// Directions over which the median is taken.
const DIRECTIONS: usize = 401;

/// What a plan sees of a candidate.
#[derive(Debug, Clone, PartialEq)]
pub struct Power {
    /// Index in the library.
    pub candidate: usize,
    /// Rank of what is seen; 0: no trace.
    pub q: usize,
    /// Share of the candidate's norm that the base model cannot follow.
    pub kept: f64,
    /// Smallest size that is found nearly always, as the peak of the effect over the touches, µm;
    /// the median over random directions of the block. `None`: no size is ever seen.
    pub minimal_detectable: Option<f64>,
    /// Noncentrality at typical size, the median over the same directions.
    pub at_typical: f64,
}

/// Power of each candidate's first variant.
#[must_use]
pub fn power(base: &Basis, library: &Library, raw: Raw) -> Vec<Power> {
    of_moments(&Moments::new(&DVector::zeros(base.n_rows()), base, library), library, raw)
}

impl Search<'_> {
    /// Power of each candidate's first variant; see [`power`].
    #[must_use]
    pub fn power(&self, raw: Raw) -> Vec<Power> {
        of_moments(&self.moments, self.library, raw)
    }
}

/// What makes the columns of a candidate's first variant before whitening, µm.
pub type Raw<'a> = &'a (dyn Fn(usize) -> DMatrix<f64> + Sync);

fn of_moments(moments: &Moments, library: &Library, raw: Raw) -> Vec<Power> {
    let first = first_variants(library);
    library
        .candidates()
        .par_iter()
        .enumerate()
        .map(|(c, candidate)| {
            let span = candidate.variants[0].columns.clone();
            let block = moments.block(first[c], span.start);
            let q = block.rank();
            if q == 0 {
                return Power { candidate: c, q, kept: block.kept, minimal_detectable: None, at_typical: 0.0 };
            }
            let w = moments.qj.columns(span.start, span.len());
            let left = &moments.blocks[first[c]] - w.transpose() * w;
            // the same directions for every candidate and in every run
            let mut rng = ChaCha8Rng::seed_from_u64(5);
            let count = if span.len() == 1 { 1 } else { DIRECTIONS };
            let mut sizes = Vec::with_capacity(count);
            let mut typical = Vec::with_capacity(count);
            let raw = raw(c);
            for _ in 0..count {
                let theta = DVector::from_fn(span.len(), |_, _| -> f64 { StandardNormal.sample(&mut rng) });
                let theta = if span.len() == 1 { DVector::from_element(1, 1.0) } else { theta.normalize() };
                let lambda = theta.dot(&(&left * &theta)).max(0.0);
                let peak = (&raw * &theta).amax();
                typical.push(lambda);
                sizes.push(if lambda > 0.0 { peak * (SEEN / lambda).sqrt() } else { f64::INFINITY });
            }
            let size = median(&mut sizes);
            Power {
                candidate: c,
                q,
                kept: block.kept,
                minimal_detectable: size.is_finite().then_some(size),
                at_typical: median(&mut typical),
            }
        })
        .collect()
}

fn median(values: &mut [f64]) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

/// ‖U_bᵀU_a‖²_F/q_a for all pairs of candidates (row a: explained, column b: by), first variants; 0 for what is not
/// seen.
#[must_use]
pub fn shares(base: &Basis, library: &Library) -> DMatrix<f64> {
    let blocks = whiteners(base, library);
    let n = blocks.len();
    let spans: Vec<Range<usize>> = library.candidates().iter().map(|c| c.variants[0].columns.clone()).collect();
    let rows: Vec<Vec<f64>> = (0..n)
        .into_par_iter()
        .map(|a| {
            let q = blocks[a].rank();
            if q == 0 {
                return vec![0.0; n];
            }
            let traces = base.project_columns(&library.columns(a, 0)) * &blocks[a].whitener;
            let cross = Moments::cross(&traces, library, &spans);
            let mut at = 0;
            let share = |b: usize| {
                at += spans[b].len();
                let part = cross.columns(at - spans[b].len(), spans[b].len());
                (part * &blocks[b].whitener).norm_squared() / q as f64
            };
            (0..n).map(share).collect()
        })
        .collect();
    DMatrix::from_fn(n, n, |a, b| rows[a][b])
}

/// Noncentrality of an effect of given size (typical sizes; first variant) that would be left if another candidate
/// were taken for it: what tells the two apart. 25 and more is safe.
#[must_use]
pub fn separation(base: &Basis, library: &Library, effect: usize, size: &DVector<f64>, taken_for: usize) -> f64 {
    let trace = base.project(&(library.columns(effect, 0) * size));
    let mut with = base.clone();
    with.extend(&library.columns(taken_for, 0), super::KEPT);
    with.project(&trace).norm_squared()
}

fn whiteners(base: &Basis, library: &Library) -> Vec<Block> {
    let moments = Moments::new(&DVector::zeros(base.n_rows()), base, library);
    let first = first_variants(library);
    library.candidates().iter().enumerate().map(|(c, k)| moments.block(first[c], k.variants[0].columns.start)).collect()
}
