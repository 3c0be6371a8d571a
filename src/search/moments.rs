//! The inner products that every test needs: once they are there, no test looks at a touch again.
//!
//! With Q the base's orthonormal basis, J the stacked candidate columns and r the whitened residual, these are QᵀJ,
//! the block JᵀJ of each candidate and Jᵀr. What is left of a candidate after projection, PJ, is only needed as
//! JᵀPJ = JᵀJ − (QᵀJ)ᵀ(QᵀJ); directions below [`KEPT`] of their norm are dropped, so that the difference keeps at
//! least nine digits. Inner products add up over touches: a training set is the whole less the touches held out.

use super::basis::Basis;
use super::library::Library;
use nalgebra::{DMatrix, DVector, DVectorView};
use rayon::prelude::*;

/// A direction of a candidate of which less than this share is left after projection leaves no trace.
pub const KEPT: f64 = 1e-3;

/// Columns that one thread multiplies at once.
const CHUNK: usize = 64;

/// Inner products of a regression and its candidates.
#[derive(Debug, Clone)]
pub(super) struct Moments {
    /// Rows N.
    pub n: usize,
    /// Rank of the base p.
    pub p: usize,
    /// Squared norm of the residual after projection.
    pub rr: f64,
    /// JᵀPr of all columns.
    pub jr: DVector<f64>,
    /// QᵀJ, p × columns.
    pub qj: DMatrix<f64>,
    /// JᵀJ of each variant of each candidate, in their order.
    pub blocks: Vec<DMatrix<f64>>,
}

/// `left` × `right`, chunks of columns in parallel.
fn product(left: &DMatrix<f64>, library: &Library) -> DMatrix<f64> {
    let (rows, n, m) = (left.nrows(), library.n_rows(), library.n_columns());
    if rows == 0 || n == 0 || m == 0 {
        return DMatrix::zeros(rows, m);
    }
    let j = library.matrix();
    if rows * n * m < 1 << 18 {
        return left * j;
    }
    let mut out = DMatrix::zeros(rows, m);
    out.as_mut_slice().par_chunks_mut(rows * CHUNK).enumerate().for_each(|(i, part)| {
        let count = part.len() / rows;
        let product = left * j.columns(i * CHUNK, count);
        part.copy_from_slice(product.as_slice());
    });
    out
}

impl Moments {
    /// Of a residual and a library over a base.
    pub fn new(residual: &DVector<f64>, base: &Basis, library: &Library) -> Self {
        let r = base.project(residual);
        let j = library.matrix();
        let jr = DVector::from_vec(
            (0..j.ncols()).into_par_iter().with_min_len(CHUNK).map(|c| j.column(c).dot(&r)).collect(),
        );
        let spans: Vec<_> = library.candidates().iter().flat_map(|c| &c.variants).map(|v| v.columns.clone()).collect();
        let blocks = spans
            .par_iter()
            .with_min_len(16)
            .map(|span| {
                let q = span.len();
                let mut block = DMatrix::zeros(q, q);
                for a in 0..q {
                    let column: DVectorView<'_, f64> = j.column(span.start + a);
                    for b in 0..=a {
                        let dot = column.dot(&j.column(span.start + b));
                        block[(a, b)] = dot;
                        block[(b, a)] = dot;
                    }
                }
                block
            })
            .collect();
        Self {
            n: residual.len(),
            p: base.rank(),
            rr: r.norm_squared(),
            jr,
            qj: product(base.transposed(), library),
            blocks,
        }
    }

    /// MᵀJ for a matrix M of few columns that is already projected: columns of M × columns of the library.
    pub fn cross(projected: &DMatrix<f64>, library: &Library) -> DMatrix<f64> {
        let (j, k) = (library.matrix(), projected.ncols());
        let dots: Vec<f64> = (0..j.ncols())
            .into_par_iter()
            .with_min_len(CHUNK)
            .flat_map_iter(|c| (0..k).map(move |row| (row, c)))
            .map(|(row, c)| projected.column(row).dot(&j.column(c)))
            .collect();
        DMatrix::from_vec(k, j.ncols(), dots)
    }

    /// JᵀPJ of a variant in pieces: what its directions are and how much of them is left.
    pub fn block(&self, index: usize, first: usize) -> Block {
        let raw = &self.blocks[index];
        let q = raw.nrows();
        let w = self.qj.columns(first, q);
        Block::new(raw, &(raw - w.transpose() * w))
    }
}

/// What is left of a candidate after projection: JᵀPJ = D⁻¹ V Λ Vᵀ D⁻¹ with D⁻¹ the columns' norms.
#[derive(Debug, Clone)]
pub(super) struct Block {
    /// D V Λ^(−1/2), columns × q: turns JᵀPx into Uᵀx.
    pub whitener: DMatrix<f64>,
    /// Share of the candidate's norm that is left.
    pub kept: f64,
}

impl Block {
    /// From JᵀJ and JᵀPJ.
    pub fn new(raw: &DMatrix<f64>, left: &DMatrix<f64>) -> Self {
        let m = raw.nrows();
        let norms: Vec<f64> = (0..m).map(|i| raw[(i, i)].max(0.0).sqrt()).collect();
        let scale = |i: usize| if norms[i] > 0.0 { 1.0 / norms[i] } else { 0.0 };
        let total: f64 = raw.trace();
        let kept = if total > 0.0 { (left.trace().max(0.0) / total).sqrt() } else { 0.0 };
        if m == 1 {
            let value = left[(0, 0)] * scale(0) * scale(0);
            let whitener = if value > KEPT * KEPT {
                DMatrix::from_element(1, 1, scale(0) / value.sqrt())
            } else {
                DMatrix::zeros(1, 0)
            };
            return Self { whitener, kept };
        }
        let scaled = DMatrix::from_fn(m, m, |i, j| left[(i, j)] * scale(i) * scale(j));
        let eigen = scaled.symmetric_eigen();
        let seen: Vec<usize> = (0..m).filter(|&i| eigen.eigenvalues[i] > KEPT * KEPT).collect();
        let whitener = DMatrix::from_fn(m, seen.len(), |i, k| {
            scale(i) * eigen.eigenvectors[(i, seen[k])] / eigen.eigenvalues[seen[k]].sqrt()
        });
        Self { whitener, kept }
    }

    /// Rank q.
    pub fn rank(&self) -> usize {
        self.whitener.ncols()
    }
}
