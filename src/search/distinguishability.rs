//! Told apart or not: the one criterion behind the groups of a diagnosis, the alias pairs of a plan and the promise of
//! a further program.
//!
//! Is it the one effect, or the other? The other is put into the model, and the F-test asks whether the one still adds
//! something in the directions that are left of it. With touches, the two are told apart when that test speaks below
//! [`LEVEL`]. Before there are touches, the same test has a noncentrality λ: what is left of the one effect, at its size,
//! when the other is taken for it; from [`SEEN`] on it speaks nearly always. Of a plan alone no size is known: two
//! effects count as inseparable when λ stays below [`SEEN`] even at a size that is found with λ = [`CLEAR`].

use super::moments::Block;
use crate::probability::{chi2_cdf, chi2_quantile};
use nalgebra::{DMatrix, DVector};
use std::ops::Range;

/// Below this p-value an effect adds something after another one: the true effect leaves its group in so many cases at most, and
/// in some more where its shape is not quite the catalogue's.
pub const LEVEL: f64 = 0.003;

/// Noncentrality from which on a test speaks nearly always.
pub const SEEN: f64 = 25.0;

/// Noncentrality of an effect that is large beside what is just found: 3.2 times the size.
pub const CLEAR: f64 = 250.0;

/// An effect of which another one explains this share cannot be told from it at noncentrality [`CLEAR`].
pub const ALIGNED: f64 = 1.0 - SEEN / CLEAR;

/// Does an effect with this p-value after another one add nothing?
#[must_use]
pub fn adds_nothing(p: f64) -> bool {
    p > LEVEL
}

/// Probability that touches of noncentrality λ on q parameters tell two effects apart (χ² in place of F: enough degrees
/// of freedom).
#[must_use]
pub fn chance(lambda: f64, q: usize) -> f64 {
    if q == 0 || !lambda.is_finite() {
        return if q == 0 { 0.0 } else { 1.0 };
    }
    let Some(limit) = chi2_quantile(1.0 - LEVEL, q as f64) else { return 0.0 };
    // a noncentral χ² is a mixture of central ones with Poisson's weights of mean λ/2
    let mean = 0.5 * lambda;
    if mean > 200.0 {
        return 1.0;
    }
    let (mut weight, mut below, mut total) = ((-mean).exp(), 0.0, 0.0);
    for k in 0..1000u32 {
        if k > 0 {
            weight *= mean / f64::from(k);
        }
        total += weight;
        let dof = q as f64 + 2.0 * f64::from(k);
        below += weight * chi2_cdf(limit, dof).unwrap_or(0.0);
        if total > 1.0 - 1e-12 {
            break;
        }
    }
    (1.0 - below).clamp(0.0, 1.0)
}

/// What one effect leaves when another one is taken for it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Left {
    /// Noncentrality.
    pub lambda: f64,
    /// Directions of the effect that are left.
    pub q: usize,
}

/// Inner products of the candidates' columns (per typical size): as they are, and beside the base model.
#[derive(Debug, Clone)]
pub struct Products {
    raw: DMatrix<f64>,
    left: DMatrix<f64>,
}

impl Products {
    /// From whitened columns and the base model's space.
    #[must_use]
    pub fn new(base: &super::Basis, columns: &DMatrix<f64>) -> Self {
        let left = base.project_columns(columns);
        Self { raw: columns.tr_mul(columns), left: left.tr_mul(&left) }
    }

    /// From the information about the base model's unknowns (the first rows) and the candidates' parameters.
    #[must_use]
    pub fn of_information(information: &DMatrix<f64>, n_base: usize) -> Option<Self> {
        let (p, q) = (n_base, information.ncols() - n_base);
        let base = information.view((0, 0), (p, p)).into_owned().cholesky()?;
        let cross = information.view((0, p), (p, q)).into_owned();
        let raw = information.view((p, p), (q, q)).into_owned();
        let left = &raw - cross.tr_mul(&base.solve(&cross));
        Some(Self { raw, left })
    }

    /// JᵀPJ of all candidates.
    #[must_use]
    pub fn beside_the_base(&self) -> &DMatrix<f64> {
        &self.left
    }

    fn part<'m>(m: &'m DMatrix<f64>, rows: &Range<usize>, columns: &Range<usize>) -> DMatrix<f64> {
        let view: nalgebra::DMatrixView<'m, f64> = m.view((rows.start, columns.start), (rows.len(), columns.len()));
        view.into_owned()
    }

    /// What is left of the candidate with columns `one`, at its size in typical sizes (`None`: the mean over random signs
    /// of them), when the candidate with columns `other` (or nothing) is in the model.
    #[must_use]
    pub fn left(&self, one: &Range<usize>, size: Option<&DVector<f64>>, other: Option<&Range<usize>>) -> Left {
        let mut left = Self::part(&self.left, one, one);
        if let Some(other) = other {
            let block = Block::new(&Self::part(&self.raw, other, other), &Self::part(&self.left, other, other));
            let shared = block.whitener.tr_mul(&Self::part(&self.left, other, one));
            left -= shared.tr_mul(&shared);
        }
        let after = Block::new(&Self::part(&self.raw, one, one), &left);
        let seen = after.whitener.tr_mul(&left);
        let lambda = match size.filter(|t| t.len() == one.len()) {
            Some(theta) => (seen * theta).norm_squared(),
            None => seen.norm_squared(),
        };
        Left { lambda, q: after.rank() }
    }

    /// Both ways, the worse one: each of the two may be the true one.
    #[must_use]
    pub fn apart(
        &self,
        (one, size): (&Range<usize>, Option<&DVector<f64>>),
        other: Option<(&Range<usize>, Option<&DVector<f64>>)>,
    ) -> Left {
        let forth = self.left(one, size, other.map(|o| o.0));
        let Some((other, other_size)) = other else { return forth };
        let back = self.left(other, other_size, Some(one));
        if chance(back.lambda, back.q) < chance(forth.lambda, forth.q) { back } else { forth }
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::{noise_matrix, rng};
    use super::super::{Basis, Library, Origin, power::separation};
    use super::*;

    #[test]
    fn the_chance_is_that_of_the_test() {
        // q = 1: |z + 5| > 2.968, and the level itself where nothing is there
        assert!((chance(25.0, 1) - 0.979).abs() < 1e-3);
        for q in 1..6 {
            assert!((chance(0.0, q) - LEVEL).abs() < 1e-9);
            assert!(chance(SEEN, q) > 0.88, "{q}");
            assert!(chance(9.0, q) < 0.7);
        }
        assert!(chance(1e4, 3) == 1.0 && chance(1e4, 0) == 0.0);
    }

    #[test]
    fn products_have_what_columns_have() {
        let mut rng = rng(23);
        let base = noise_matrix(&mut rng, 80, 5);
        let all = noise_matrix(&mut rng, 80, 5);
        let mut library = Library::new(80);
        library.push("one", Origin::Catalogue, &all.columns(0, 2).into_owned());
        library.push("other", Origin::Catalogue, &all.columns(2, 3).into_owned());
        let (one, other) = (0..2, 2..5);
        let size = DVector::from_vec(vec![0.7, -1.2]);
        let basis = Basis::new(&base);
        let direct = separation(&basis, &library, 0, &size, 1);
        let products = Products::new(&basis, &all);
        assert!((products.left(&one, Some(&size), Some(&other)).lambda - direct).abs() < 1e-9 * direct);
        let rows = [base.as_slice(), all.as_slice()].concat();
        let joint = DMatrix::from_column_slice(80, 10, &rows);
        let same = Products::of_information(&joint.tr_mul(&joint), 5).unwrap();
        assert!((same.left(&one, Some(&size), Some(&other)).lambda - direct).abs() < 1e-9 * direct);
        // a copy leaves nothing
        let twice = DMatrix::from_fn(80, 2, |i, _| all[(i, 0)]);
        let copy = Products::new(&basis, &twice).apart((&(0..1), None), Some((&(1..2), None)));
        assert_eq!((copy.q, copy.lambda), (0, 0.0));
    }
}
