//! The inner products that every test needs: once they are there, no test looks at a touch again.
//!
//! With Q the base's orthonormal basis, J the stacked candidate columns and r the whitened residual, these are QᵀJ,
//! the block JᵀJ of each candidate and Jᵀr. What is left of a candidate after projection, PJ, is only needed as
//! JᵀPJ = JᵀJ − (QᵀJ)ᵀ(QᵀJ); directions below [`KEPT`] of their norm are dropped, so that the difference keeps at
//! least nine digits. Inner products add up over touches: a training set is the whole less the touches held out.

use super::basis::Basis;
use super::library::Library;
use nalgebra::{DMatrix, DMatrixView, DMatrixViewMut, DVector};
use rayon::prelude::*;
use std::ops::Range;

/// A direction of a candidate of which less than this share is left after projection leaves no trace.
pub const KEPT: f64 = 1e-3;

/// What turns rows of a library into those of another regression of the same touches.
pub type Change<'a> = &'a (dyn Fn(DMatrixViewMut<'_, f64>) + Sync);

/// A regression of the touches of a library.
#[derive(Clone, Copy)]
pub(super) struct Regression<'a> {
    pub residual: &'a DVector<f64>,
    pub base: &'a Basis,
    /// What makes its rows of the library's.
    pub change: Option<Change<'a>>,
}

/// Jᵀr and QᵀJ of some columns of a library, and JᵀJ of each variant among them.
type Piece = (Vec<f64>, DMatrix<f64>, Vec<DMatrix<f64>>);

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
    /// QᵀJ, as many rows as the base has directions: those that a training set has lost are 0.
    pub qj: DMatrix<f64>,
    /// JᵀJ of each variant of each candidate, in their order.
    pub blocks: Vec<DMatrix<f64>>,
}

impl Moments {
    /// Of a residual and a library over a base.
    pub fn new(residual: &DVector<f64>, base: &Basis, library: &Library) -> Self {
        Self::of_each(&[Regression { residual, base, change: None }], library).swap_remove(0)
    }

    /// The same of several regressions: columns that are in no memory are made once for all of them.
    pub fn of_each(regressions: &[Regression], library: &Library) -> Vec<Self> {
        let projected: Vec<DVector<f64>> = regressions.iter().map(|r| r.base.project(r.residual)).collect();
        let variants = library.candidates().iter().flat_map(|c| &c.variants).map(|v| v.columns.clone());
        let mut variants: Vec<(usize, Range<usize>)> = variants.enumerate().collect();
        variants.sort_by_key(|(_, columns)| columns.start);
        let of = |span: Range<usize>| -> Vec<Piece> {
            let from = variants.partition_point(|(_, v)| v.start < span.start);
            let own = variants[from..].iter().take_while(|(_, v)| v.end <= span.end);
            library.with(span.clone(), |whole| {
                let each = regressions.iter().zip(&projected).map(|(regression, r)| {
                    let changed = regression.change.map(|change| {
                        let mut own = whole.into_owned();
                        change(own.as_view_mut());
                        own
                    });
                    let j = changed.as_ref().map_or(whole, DMatrix::as_view);
                    let jr = j.column_iter().map(|column| column.dot(r)).collect();
                    let blocks = own.clone().map(|(_, v)| block(j.columns(v.start - span.start, v.len()))).collect();
                    (jr, regression.base.transposed() * j, blocks)
                });
                each.collect()
            })
        };
        let empty = |(r, projected): (&Regression, &DVector<f64>)| Self {
            n: r.residual.len(),
            p: r.base.rank(),
            rr: projected.norm_squared(),
            jr: DVector::zeros(library.n_columns()),
            qj: DMatrix::zeros(r.base.rank(), library.n_columns()),
            blocks: vec![DMatrix::zeros(0, 0); variants.len()],
        };
        let mut out: Vec<Self> = regressions.iter().zip(&projected).map(empty).collect();
        let chunks = library.chunks();
        let pieces: Vec<_> = chunks.par_iter().map(|span| of(span.clone())).collect();
        let mut at = 0;
        for (span, each) in chunks.into_iter().zip(pieces) {
            let from = at;
            for (moments, (jr, qj, blocks)) in out.iter_mut().zip(each) {
                at = from + blocks.len();
                moments.jr.rows_mut(span.start, span.len()).copy_from_slice(&jr);
                moments.qj.columns_mut(span.start, span.len()).copy_from(&qj);
                for ((variant, _), block) in variants[from..at].iter().zip(blocks) {
                    moments.blocks[*variant] = block;
                }
            }
        }
        out
    }

    /// The same once the base has further directions behind its own: q of them, q × rows, with what of the residual lies along each.
    pub fn with_more(&self, rows: &DMatrix<f64>, along: &DVector<f64>, library: &Library) -> Self {
        let chunks = library.chunks();
        let pieces: Vec<DMatrix<f64>> =
            chunks.par_iter().map(|span| library.with(span.clone(), |j| product(rows, j))).collect();
        let (p, q) = (self.qj.nrows(), rows.nrows());
        let mut qj = self.qj.clone().resize_vertically(p + q, 0.0);
        for (span, piece) in chunks.iter().zip(&pieces) {
            qj.view_mut((p, span.start), piece.shape()).copy_from(piece);
        }
        let jr = &self.jr - qj.rows(p, q).tr_mul(along);
        let rr = (self.rr - along.norm_squared()).max(0.0);
        Self { p: self.p + q, rr, jr, qj, blocks: self.blocks.clone(), n: self.n }
    }

    /// MᵀJ for a matrix M of few columns that is already projected and some columns of the library, one after the other.
    pub fn cross(projected: &DMatrix<f64>, library: &Library, spans: &[Range<usize>]) -> DMatrix<f64> {
        let k = projected.ncols();
        let dots = |span: &Range<usize>| -> Vec<f64> {
            library.with(span.clone(), |j| {
                let each = j.column_iter().map(|column| (0..k).map(move |row| projected.column(row).dot(&column)));
                each.flatten().collect()
            })
        };
        let dots: Vec<f64> = spans.par_iter().flat_map_iter(dots).collect();
        DMatrix::from_vec(k, spans.iter().map(Range::len).sum(), dots)
    }

    /// JᵀPJ of a variant in pieces: what its directions are and how much of them is left.
    pub fn block(&self, index: usize, first: usize) -> Block {
        let raw = &self.blocks[index];
        let w = self.qj.columns(first, raw.nrows());
        // most candidates are of one column
        match raw.as_slice() {
            [raw] => Block::of_one(*raw, raw - w.iter().map(|w| w * w).sum::<f64>()),
            _ => Block::new(raw, &(raw - w.tr_mul(&w))),
        }
    }
}

/// Up to so many rows nalgebra's product writes each sum back to memory after each touch. With more rows it works on blocks of
/// columns, which is faster and rounds differently.
const FEW_ROWS: usize = 5;

/// Columns that are summed side by side, so that the additions of different sums overlap.
const AT_ONCE: usize = 4;

/// A few rows (q × N) times columns (N × m): q × m.
fn product(rows: &DMatrix<f64>, j: DMatrixView<'_, f64>) -> DMatrix<f64> {
    if rows.nrows() > FEW_ROWS {
        return rows * j;
    }
    let directions = rows.transpose();
    let columns: Vec<_> = j.column_iter().collect();
    let mut out = Vec::with_capacity(rows.nrows() * columns.len());
    let (fours, rest) = columns.as_chunks::<AT_ONCE>();
    for four in fours {
        let four = four.each_ref().map(|column| column.as_slice());
        let each: Vec<_> = directions.column_iter().map(|direction| sums(direction.as_slice(), four)).collect();
        (0..AT_ONCE).for_each(|column| out.extend(each.iter().map(|of_direction| of_direction[column])));
    }
    for column in rest {
        out.extend(directions.column_iter().flat_map(|direction| sums(direction.as_slice(), [column.as_slice()])));
    }
    DMatrix::from_vec(rows.nrows(), columns.len(), out)
}

/// The products of a direction with some columns of the same length, each summed from the first touch to the last.
fn sums<const K: usize>(direction: &[f64], columns: [&[f64]; K]) -> [f64; K] {
    let columns = columns.map(|column| &column[..direction.len()]);
    let mut sums = [0.0; K];
    for (touch, along) in direction.iter().enumerate() {
        for (sum, column) in sums.iter_mut().zip(&columns) {
            *sum += along * column[touch];
        }
    }
    sums
}

/// JᵀJ of a few columns.
fn block(j: DMatrixView<'_, f64>) -> DMatrix<f64> {
    let q = j.ncols();
    let mut block = DMatrix::zeros(q, q);
    for a in 0..q {
        for b in 0..=a {
            let dot = j.column(a).dot(&j.column(b));
            block[(a, b)] = dot;
            block[(b, a)] = dot;
        }
    }
    block
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
    /// Of one column.
    fn of_one(raw: f64, left: f64) -> Self {
        let scale = if raw > 0.0 { raw.sqrt().recip() } else { 0.0 };
        let kept = if raw > 0.0 { (left.max(0.0) / raw).sqrt() } else { 0.0 };
        let value = left * scale * scale;
        let is_seen = value > KEPT * KEPT;
        let whitener = if is_seen { DMatrix::from_element(1, 1, scale / value.sqrt()) } else { DMatrix::zeros(1, 0) };
        Self { whitener, kept }
    }

    /// From JᵀJ and JᵀPJ.
    pub fn new(raw: &DMatrix<f64>, left: &DMatrix<f64>) -> Self {
        let m = raw.nrows();
        if m == 1 {
            return Self::of_one(raw[(0, 0)], left[(0, 0)]);
        }
        let norms: Vec<f64> = (0..m).map(|i| raw[(i, i)].max(0.0).sqrt()).collect();
        let scale = |i: usize| if norms[i] > 0.0 { 1.0 / norms[i] } else { 0.0 };
        let total: f64 = raw.trace();
        let kept = if total > 0.0 { (left.trace().max(0.0) / total).sqrt() } else { 0.0 };
        let scaled = DMatrix::from_fn(m, m, |i, j| left[(i, j)] * scale(i) * scale(j));
        let eigen = scaled.symmetric_eigen();
        let seen: Vec<usize> = (0..m).filter(|&i| eigen.eigenvalues[i] > KEPT * KEPT).collect();
        let whitener = DMatrix::from_fn(m, seen.len(), |i, k| {
            scale(i) * eigen.eigenvectors[(i, seen[k])] / eigen.eigenvalues[seen[k]].sqrt()
        });
        Self { whitener, kept }
    }

    /// Logarithm of the determinant of JᵀPJ, as far as it is seen.
    pub fn ln_det(&self) -> f64 {
        -self.whitener.tr_mul(&self.whitener).determinant().ln()
    }

    /// Rank q.
    pub fn rank(&self) -> usize {
        self.whitener.ncols()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::search::testing::{noise_matrix, rng};

    #[test]
    fn a_product_has_the_digits_of_a_product_of_matrices() {
        let mut rng = rng(4);
        for rows in 1..=FEW_ROWS + 2 {
            for columns in 0..=2 * AT_ONCE + 1 {
                let (rows, j) = (noise_matrix(&mut rng, rows, 23), noise_matrix(&mut rng, 23, columns));
                assert_eq!(product(&rows, j.as_view()), rows * j);
            }
        }
    }
}
