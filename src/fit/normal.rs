//! The touches of a study as weighted normal equations, accumulated block by block.
//!
//! The noise of a touch is white, σ, plus one random displacement of the ball per index visit, τ in each direction:
//! V = σ²·I + τ²·Σᵥ NᵥNᵥᵀ with the normals in R as rows of Nᵥ. Its inverse needs one 3 × 3 matrix per visit
//! (Woodbury), so that neither V nor the full Jacobian is ever formed. A row holds the common unknowns and those of its
//! block; the Gram matrix is collected per block and spread out at the end.

use super::solve::{Normal, Problem};
use super::whitening::{Visit, VisitNormals, Whitening, normals_of};
use crate::model::batch::{At, Batch, Scratch};
use nalgebra::{DMatrix, DMatrixView, DVector, Matrix3, Vector3};
use rayon::prelude::*;
use std::ops::Range;

/// Touches accumulated together: some hundred microseconds of work.
const CHUNK: usize = 1024;

/// What a prior says: index of the unknown, value, standard deviation (in the unknown's unit).
pub type Prior = (usize, f64, f64);

/// The touches as a least-squares problem. Residuals are in units of their noise.
#[derive(Debug)]
pub struct Touches<'a> {
    batch: &'a Batch<'a>,
    /// Touch by touch: the number of its visit; touches of a visit follow one another.
    visits: &'a [usize],
    /// Weight of each touch: 1, or 0 for one that is not used; in between for the robust start.
    weight: Vec<f64>,
    /// All unknowns; the free ones are overwritten.
    theta: Vec<f64>,
    free: &'a [usize],
    priors: &'a [Prior],
    sigma_mm: f64,
    tau_mm: f64,
    chunks: Vec<Range<usize>>,
}

impl<'a> Touches<'a> {
    /// Of a batch, with all touches used.
    #[must_use]
    pub fn new(
        batch: &'a Batch<'a>,
        visits: &'a [usize],
        theta: Vec<f64>,
        free: &'a [usize],
        priors: &'a [Prior],
        (sigma_mm, tau_mm): (f64, f64),
    ) -> Self {
        let mut touches = Self {
            batch,
            visits,
            weight: vec![1.0; batch.len()],
            theta,
            free,
            priors,
            sigma_mm,
            tau_mm,
            chunks: Vec::new(),
        };
        touches.set_noise(sigma_mm, tau_mm);
        touches
    }

    /// Another noise, mm.
    pub fn set_noise(&mut self, sigma_mm: f64, tau_mm: f64) {
        (self.sigma_mm, self.tau_mm) = (sigma_mm, tau_mm);
        // a visit's touches must stay together where they share a displacement
        self.chunks = self.cut(0..self.visits.len(), CHUNK);
    }

    /// Other weights, one for each touch.
    pub fn set_weights(&mut self, weight: Vec<f64>) {
        self.weight = weight;
    }

    /// Standard deviation of a touch and of a component of a visit's displacement, mm.
    #[must_use]
    pub fn noise_mm(&self) -> (f64, f64) {
        (self.sigma_mm, self.tau_mm)
    }

    /// What is known of unknowns without the touches.
    #[must_use]
    pub fn priors(&self) -> &[Prior] {
        self.priors
    }

    /// Weights of the touches.
    #[must_use]
    pub fn weights(&self) -> &[f64] {
        &self.weight
    }

    /// All unknowns with the free ones filled in.
    #[must_use]
    pub fn full(&self, free: &DVector<f64>) -> Vec<f64> {
        let mut theta = self.theta.clone();
        for (value, &i) in free.iter().zip(self.free) {
            theta[i] = *value;
        }
        theta
    }

    /// Gaps at all touches, mm.
    #[must_use]
    pub fn gaps(&self, free: &DVector<f64>) -> Vec<f64> {
        let theta = self.full(free);
        let at = self.batch.at(&theta);
        let each = |range: &Range<usize>| -> Vec<f64> {
            let mut scratch = self.batch.scratch();
            range.clone().map(|i| at.gap(i, &mut scratch)).collect()
        };
        self.each_chunk(each).concat()
    }

    /// Something of each part of the touches, in their order. One part is no work for threads: starting them takes as long.
    pub(super) fn each_chunk<T: Send>(&self, of: impl Fn(&Range<usize>) -> T + Sync) -> Vec<T> {
        match self.chunks.as_slice() {
            [only] => vec![of(only)],
            many => many.par_iter().map(&of).collect(),
        }
    }

    /// Outward normal of a touch in R.
    pub(super) fn normal_in_r(&self, touch: usize) -> Vector3<f64> {
        let s = &self.batch.observations()[touch].state;
        Vector3::new(s[8], s[9], s[10])
    }

    /// Runs of touches of one visit inside a range.
    pub(super) fn visits_in(&self, range: Range<usize>) -> Vec<Range<usize>> {
        let mut out = Vec::new();
        let mut from = range.start;
        for i in range.start + 1..=range.end {
            if i == range.end || self.visits[i] != self.visits[from] {
                out.push(from..i);
                from = i;
            }
        }
        out
    }

    /// Σ w·n·nᵀ over the touches of a visit.
    pub(super) fn normals_square(&self, visit: Range<usize>) -> Matrix3<f64> {
        visit.fold(Matrix3::zeros(), |sum, i| {
            let n = self.normal_in_r(i);
            sum + n * n.transpose() * self.weight[i]
        })
    }

    /// M of V⁻¹ = (I − N·M·Nᵀ)/σ² for a visit.
    pub(super) fn visit_inverse(&self, normals_square: &Matrix3<f64>) -> Matrix3<f64> {
        let rho2 = (self.tau_mm / self.sigma_mm).powi(2);
        (Matrix3::identity() + normals_square * rho2).try_inverse().map_or_else(Matrix3::zeros, |m| m * rho2)
    }

    /// K of V^(−1/2) = (I − N·K·Nᵀ)/σ for a visit.
    fn visit_root(&self, normals_square: &Matrix3<f64>) -> Matrix3<f64> {
        let rho2 = (self.tau_mm / self.sigma_mm).powi(2);
        let eigen = normals_square.symmetric_eigen();
        let mut k = Matrix3::zeros();
        for (s, v) in eigen.eigenvalues.iter().zip(eigen.eigenvectors.column_iter()) {
            let shrink = if *s > 1e-12 { (1.0 - 1.0 / (1.0 + rho2 * s).sqrt()) / s } else { 0.5 * rho2 };
            k += v * v.transpose() * shrink;
        }
        k
    }

    /// Whitens columns (one row per touch, mm or mm per unit) in place; rows of unused touches become zero.
    pub fn whiten(&self, columns: &mut DMatrix<f64>) {
        self.whitening().apply(columns);
    }

    /// The same for some touches only, one row each in their order: the used touches of a visit stand together.
    pub(super) fn whiten_of(&self, touches: &[usize], columns: &mut DMatrix<f64>) {
        self.whitening_of(touches).apply(columns);
    }

    /// What whitens columns of all touches.
    #[must_use]
    pub fn whitening(&self) -> Whitening {
        let all: Vec<usize> = (0..self.batch.len()).collect();
        self.whitening_of(&all)
    }

    /// What a scatter of visits does to rows of the touches that are used.
    #[must_use]
    pub fn visit_normals(&self) -> VisitNormals {
        let used: Vec<usize> = (0..self.batch.len()).filter(|&i| self.weight[i] > 0.0).collect();
        let normals: Vec<Vector3<f64>> = used.iter().map(|&i| self.normal_in_r(i) * self.weight[i].sqrt()).collect();
        let visits: Vec<usize> = used.iter().map(|&i| self.visits[i]).collect();
        VisitNormals::new(&visits, &normals, self.sigma_mm)
    }

    fn whitening_of(&self, touches: &[usize]) -> Whitening {
        let root: Vec<f64> = touches.iter().map(|&i| self.weight[i].sqrt()).collect();
        let mut visits = Vec::new();
        if self.tau_mm > 0.0 {
            let mut normals = touches.iter().zip(&root).map(|(&i, root)| self.normal_in_r(i) * *root);
            for visit in touches.chunk_by(|&a, &b| self.visits[a] == self.visits[b]) {
                let normals: Vec<Vector3<f64>> = normals.by_ref().take(visit.len()).collect();
                let square = normals.iter().fold(Matrix3::zeros(), |sum, n| sum + n * n.transpose());
                visits.push(Visit { root: self.visit_root(&square), normals: normals_of(&normals) });
            }
        }
        Whitening { root, visits, sigma_mm: self.sigma_mm }
    }

    /// All touches in parts of about a thousand, visits whole where their touches share a displacement.
    pub(super) fn parts(&self) -> &[Range<usize>] {
        &self.chunks
    }

    /// Gaps and rows of all touches with only the free unknowns that they see.
    #[must_use]
    pub(super) fn short_rows(&self, free: &DVector<f64>) -> ShortRows {
        let theta = self.full(free);
        let at = self.batch.at(&theta);
        let column_of = self.columns();
        let layout = self.batch.model().layout();
        // places of the free unknowns in the rows of each block, and their columns
        let kept: Vec<(Vec<usize>, Vec<usize>)> = (0..layout.own.len())
            .map(|s| layout.row(s).enumerate().filter_map(|(place, u)| Some((place, column_of[u]?))).unzip())
            .collect();
        let mut out = ShortRows { columns: kept.iter().map(|k| k.1.clone()).collect(), ..ShortRows::default() };
        let of_part = |part: &Range<usize>| {
            let (mut scratch, mut row) = (self.batch.scratch(), Vec::new());
            let (mut gaps, mut values) = (Vec::with_capacity(part.len()), Vec::new());
            for i in part.clone() {
                let set_up = self.batch.observations()[i].set_up;
                row.resize(layout.row_length(set_up), 0.0);
                gaps.push(at.gap_and_row(i, &mut scratch, &mut row));
                values.extend(kept[set_up].0.iter().map(|&place| row[place]));
            }
            (gaps, values)
        };
        for (gaps, values) in self.each_chunk(of_part) {
            out.gap.extend(gaps);
            out.values.extend(values);
        }
        let mut start = 0;
        for o in self.batch.observations() {
            out.set_up.push(o.set_up);
            out.start.push(start);
            start += kept[o.set_up].0.len();
        }
        out
    }

    /// A part in smaller ones of about `most` touches, visits whole where their touches share a displacement.
    pub(super) fn cut(&self, part: Range<usize>, most: usize) -> Vec<Range<usize>> {
        let mut out = Vec::new();
        let mut from = part.start;
        for i in part.start + 1..=part.end {
            let may_end = i == part.end || self.tau_mm == 0.0 || self.visits[i] != self.visits[i - 1];
            if i == part.end || (may_end && i - from >= most) {
                out.push(from..i);
                from = i;
            }
        }
        out
    }

    /// Gaps, mm, and Jacobian of the free unknowns, mm per unit; touches only.
    #[must_use]
    pub fn unwhitened(&self, free: &DVector<f64>) -> (DVector<f64>, DMatrix<f64>) {
        let all: Vec<usize> = (0..self.batch.len()).collect();
        self.unwhitened_of(free, &all)
    }

    /// The same for some touches only, one row each in their order.
    pub(super) fn unwhitened_of(&self, free: &DVector<f64>, touches: &[usize]) -> (DVector<f64>, DMatrix<f64>) {
        let theta = self.full(free);
        let at = self.batch.at(&theta);
        let (n, p) = (touches.len(), self.free.len());
        let column_of = self.columns();
        let (mut gaps, mut jacobian) = (DVector::zeros(n), DMatrix::zeros(n, p));
        let mut scratch = self.batch.scratch();
        let layout = self.batch.model().layout();
        let mut row = Vec::new();
        for (k, &i) in touches.iter().enumerate() {
            let set_up = self.batch.observations()[i].set_up;
            row.resize(layout.row_length(set_up), 0.0);
            gaps[k] = at.gap_and_row(i, &mut scratch, &mut row);
            for (value, unknown) in row.iter().zip(layout.row(set_up)) {
                if let Some(c) = column_of[unknown] {
                    jacobian[(k, c)] = *value;
                }
            }
        }
        (gaps, jacobian)
    }

    /// Gap, mm, and derivatives with respect to the free unknowns at one touch.
    #[must_use]
    pub fn row(&self, free: &DVector<f64>, touch: usize) -> (f64, DVector<f64>) {
        let theta = self.full(free);
        let layout = self.batch.model().layout();
        let set_up = self.batch.observations()[touch].set_up;
        let mut short = vec![0.0; layout.row_length(set_up)];
        let gap = self.batch.at(&theta).gap_and_row(touch, &mut self.batch.scratch(), &mut short);
        let column_of = self.columns();
        let mut row = DVector::zeros(free.len());
        for (value, unknown) in short.iter().zip(layout.row(set_up)) {
            if let Some(c) = column_of[unknown] {
                row[c] = *value;
            }
        }
        (gap, row)
    }

    /// Residuals and Jacobian of the free unknowns, whitened, the priors' rows last.
    #[must_use]
    pub fn dense(&self, free: &DVector<f64>) -> (DVector<f64>, DMatrix<f64>) {
        let (gaps, touched) = self.unwhitened(free);
        let (n, p) = touched.shape();
        let column_of = self.columns();
        let mut gaps = DMatrix::from_column_slice(n, 1, gaps.as_slice());
        self.whiten(&mut gaps);
        let mut residual = DVector::zeros(n + self.priors.len());
        residual.rows_mut(0, n).copy_from(&gaps.column(0));
        let mut jacobian = DMatrix::zeros(n + self.priors.len(), p);
        jacobian.rows_mut(0, n).copy_from(&touched);
        drop(touched);
        if self.priors.is_empty() {
            self.whiten(&mut jacobian);
        } else {
            let mut own = jacobian.rows(0, n).into_owned();
            self.whiten(&mut own);
            jacobian.rows_mut(0, n).copy_from(&own);
        }
        for (i, (unknown, value, sigma)) in self.priors.iter().enumerate() {
            if let Some(c) = column_of[*unknown] {
                residual[n + i] = (free[c] - value) / sigma;
                jacobian[(n + i, c)] = 1.0 / sigma;
            }
        }
        (residual, jacobian)
    }

    /// Column of each unknown among the free ones.
    fn columns(&self) -> Vec<Option<usize>> {
        let mut out = vec![None; self.theta.len()];
        for (c, &u) in self.free.iter().enumerate() {
            out[u] = Some(c);
        }
        out
    }

    /// Adds a range of touches.
    fn accumulate(&self, at: &At, range: &Range<usize>, with_gram: bool) -> Partial {
        let layout = self.batch.model().layout();
        let n_set_ups = layout.own.len();
        let mut part = Partial { blocks: vec![None; n_set_ups], visits: None, sum: 0.0 };
        let mut scratch: Scratch = self.batch.scratch();
        let mut row = Vec::new();
        let p = self.theta.len();
        let whole = if self.tau_mm > 0.0 { self.visits_in(range.clone()) } else { vec![range.clone()] };
        for visit in whole {
            let mut seen = VisitSums::new(if self.tau_mm > 0.0 { p } else { 0 });
            for i in visit.clone() {
                let root = self.weight[i].sqrt();
                if root == 0.0 {
                    continue;
                }
                let set_up = self.batch.observations()[i].set_up;
                let k = layout.row_length(set_up);
                row.resize(k, 0.0);
                let mut gap = at.gap_and_row(i, &mut scratch, &mut row);
                if root != 1.0 {
                    gap *= root;
                    row.iter_mut().for_each(|x| *x *= root);
                }
                part.sum += gap * gap;
                let block = part.blocks[set_up].get_or_insert_with(|| Block::new(k, with_gram));
                block.add(gap, &row, with_gram);
                if self.tau_mm > 0.0 {
                    let n = self.normal_in_r(i) * root;
                    seen.gaps += n * gap;
                    seen.normals += n * n.transpose();
                    for (value, unknown) in row.iter().zip(layout.row(set_up)) {
                        let mut s = seen.rows.column_mut(unknown);
                        s += n * *value;
                    }
                }
            }
            if self.tau_mm > 0.0 {
                let m = self.visit_inverse(&seen.normals);
                let weighted = m * &seen.rows;
                let (gram, gradient) = part.visits.get_or_insert_with(|| {
                    (DMatrix::zeros(if with_gram { p } else { 0 }, if with_gram { p } else { 0 }), DVector::zeros(p))
                });
                if with_gram {
                    gram.gemm_tr(1.0, &seen.rows, &weighted, 1.0);
                }
                gradient.gemv_tr(1.0, &weighted, &seen.gaps, 1.0);
                part.sum -= seen.gaps.dot(&(m * seen.gaps));
            }
        }
        part.blocks.iter_mut().flatten().for_each(Block::multiply);
        part
    }
}

/// Rows one after the other, each with the free unknowns that its touch sees.
#[derive(Debug, Default)]
pub(super) struct ShortRows {
    /// Free columns of the rows of each block.
    pub columns: Vec<Vec<usize>>,
    /// Block of each touch.
    pub set_up: Vec<usize>,
    /// Where each row begins.
    pub start: Vec<usize>,
    pub values: Vec<f64>,
    /// Gaps, mm.
    pub gap: Vec<f64>,
}

/// Sums over one visit.
struct VisitSums {
    /// Σ n ⊗ row.
    rows: nalgebra::Matrix3xX<f64>,
    gaps: Vector3<f64>,
    normals: Matrix3<f64>,
}

impl VisitSums {
    fn new(p: usize) -> Self {
        Self { rows: nalgebra::Matrix3xX::zeros(p), gaps: Vector3::zeros(), normals: Matrix3::zeros() }
    }
}

/// Sums over some touches.
struct Partial {
    blocks: Vec<Option<Block>>,
    /// What the shared displacements of visits take away: Gram and gradient.
    visits: Option<(DMatrix<f64>, DVector<f64>)>,
    sum: f64,
}

/// Rows of one block that wait to be multiplied together.
const ROWS: usize = 64;

/// Gram matrix and gradient of the touches of one block.
#[derive(Debug, Clone)]
struct Block {
    gram: DMatrix<f64>,
    gradient: Vec<f64>,
    /// Rows that are not in the Gram matrix yet, one after the other.
    waiting: Vec<f64>,
}

impl Block {
    fn new(k: usize, with_gram: bool) -> Self {
        let (size, room) = if with_gram { (k, ROWS * k) } else { (0, 0) };
        Self { gram: DMatrix::zeros(size, size), gradient: vec![0.0; k], waiting: Vec::with_capacity(room) }
    }

    fn add(&mut self, gap: f64, row: &[f64], with_gram: bool) {
        for (g, x) in self.gradient.iter_mut().zip(row) {
            *g += x * gap;
        }
        if with_gram {
            self.waiting.extend_from_slice(row);
            if self.waiting.len() == ROWS * row.len() {
                self.multiply();
            }
        }
    }

    /// Adds the waiting rows: a product of matrices uses the processor far better than row by row.
    fn multiply(&mut self) {
        if self.waiting.is_empty() {
            return;
        }
        let k = self.gradient.len();
        let n = self.waiting.len() / k;
        let turned = DMatrixView::from_slice(&self.waiting, k, n);
        let rows = DMatrixView::from_slice_with_strides(&self.waiting, n, k, k, 1);
        self.gram.gemm(1.0, &turned, &rows, 1.0);
        self.waiting.clear();
    }
}

impl Problem for Touches<'_> {
    fn normal(&self, free: &DVector<f64>, with_gram: bool) -> Normal {
        let theta = self.full(free);
        let at = self.batch.at(&theta);
        let parts = self.each_chunk(|range| self.accumulate(&at, range, with_gram));
        let p = free.len();
        let column_of = self.columns();
        let layout = self.batch.model().layout();
        let mut gram = DMatrix::zeros(if with_gram { p } else { 0 }, if with_gram { p } else { 0 });
        let mut gradient = DVector::zeros(p);
        let mut sum = 0.0;
        // in the order of the touches, whatever the threads did: the same input gives the same bits
        for part in parts {
            sum += part.sum;
            for (set_up, block) in part.blocks.iter().enumerate() {
                let Some(block) = block else { continue };
                let row: Vec<Option<usize>> = layout.row(set_up).map(|u| column_of[u]).collect();
                for (a, ca) in row.iter().enumerate() {
                    let Some(ca) = *ca else { continue };
                    gradient[ca] += block.gradient[a];
                    if with_gram {
                        for (b, cb) in row.iter().enumerate().skip(a) {
                            if let Some(cb) = *cb {
                                let value = block.gram[(a, b)];
                                gram[(ca, cb)] += value;
                                if ca != cb {
                                    gram[(cb, ca)] += value;
                                }
                            }
                        }
                    }
                }
            }
            if let Some((visits, slope)) = &part.visits {
                for (a, &u) in self.free.iter().enumerate() {
                    gradient[a] -= slope[u];
                    if with_gram {
                        for (b, &v) in self.free.iter().enumerate() {
                            gram[(a, b)] -= visits[(u, v)];
                        }
                    }
                }
            }
        }
        let weight = self.sigma_mm.powi(-2);
        gram *= weight;
        gradient *= weight;
        sum *= weight;
        for (unknown, value, sigma) in self.priors {
            if let Some(c) = column_of[*unknown] {
                let off = (free[c] - value) / sigma;
                sum += off * off;
                gradient[c] += off / sigma;
                if with_gram {
                    gram[(c, c)] += sigma.powi(-2);
                }
            }
        }
        Normal { gram, gradient, sum }
    }

    fn jacobian(&self, free: &DVector<f64>) -> DMatrix<f64> {
        self.dense(free).1
    }

    fn n_rows(&self) -> usize {
        self.weight.iter().filter(|w| **w > 0.0).count() + self.priors.len()
    }

    fn noise(&self) -> f64 {
        self.sigma_mm
    }
}
