//! Two effects at once: where no single candidate explains what is left, two simple ones together may.

use super::distributions::ln_p_of_f;
use super::moments::Block;
use super::score::{Search, held_against};
use nalgebra::{DMatrix, DVector};

/// A candidate of a pair counts where adding it after the other one is no matter of chance by this measure.
const EACH_LN_P: f64 = -7.0;

/// Two candidates in the model together.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pair {
    /// The one that explains more by itself.
    pub first: usize,
    pub second: usize,
    /// Sum of squares that they take away together.
    pub delta_ss: f64,
    /// Parameters of both.
    pub n_parameters: usize,
    /// Schwarz's criterion of the model with both.
    pub bic: f64,
    /// Probability of so much by chance, all pairs counted in.
    pub p_adjusted: f64,
}

/// A candidate without what the base model follows.
struct Alone {
    candidate: usize,
    /// Orthonormal, rows × q.
    space: DMatrix<f64>,
    /// What of the residual lies in it.
    along: DVector<f64>,
}

impl Search<'_> {
    /// Schwarz's criterion of the base model with so many parameters more that take so much away.
    fn criterion(&self, delta_ss: f64, n_parameters: usize) -> f64 {
        let n = self.question.residual.len() as f64;
        let left = (self.moments.rr - delta_ss).max(f64::MIN_POSITIVE);
        n * (left / n).ln() + n_parameters as f64 * n.ln()
    }

    /// Schwarz's criterion of the model with a candidate.
    #[must_use]
    pub fn bic(&self, candidate: usize) -> f64 {
        let score = &self.scores[candidate];
        self.criterion(score.delta_ss, score.n_parameters)
    }

    /// The pair among some candidates that Schwarz's criterion favours, if both together pass a test that counts all pairs there
    /// are, and each adds something after the other.
    #[must_use]
    pub fn best_pair(&self, among: &[usize]) -> Option<Pair> {
        let residual = self.question.base.project(self.question.residual);
        let alone: Vec<Alone> = among.iter().map(|&candidate| self.alone(candidate, &residual)).collect();
        let visible = self.scores.iter().filter(|s| s.visible()).count() as f64;
        let ln_pairs = (visible * (visible - 1.0) / 2.0).max(1.0).ln();
        let mut best: Option<Pair> = None;
        for (i, a) in alone.iter().enumerate() {
            for b in &alone[i + 1..] {
                let Some(pair) = self.pair(a, b, ln_pairs) else { continue };
                if best.is_none_or(|best| pair.bic < best.bic) {
                    best = Some(pair);
                }
            }
        }
        best
    }

    fn alone(&self, candidate: usize, residual: &DVector<f64>) -> Alone {
        let left = self.question.base.project_columns(&self.columns(candidate));
        let space = &left * &self.block(candidate).whitener;
        Alone { candidate, along: space.tr_mul(residual), space }
    }

    fn pair(&self, a: &Alone, b: &Alone, ln_pairs: f64) -> Option<Pair> {
        let overlap = a.space.tr_mul(&b.space);
        let left = &b.space - &a.space * &overlap;
        let block = Block::new(&b.space.tr_mul(&b.space), &left.tr_mul(&left));
        // what of the residual lies in the second's space and not in the first's
        let more = block.whitener.tr_mul(&(&b.along - overlap.tr_mul(&a.along))).norm_squared();
        let delta_ss = a.along.norm_squared() + more;
        let (first, second) = (&self.scores[a.candidate], &self.scores[b.candidate]);
        let scanned = first.n_parameters - first.q + second.n_parameters - second.q;
        let n_parameters = first.q + block.rank() + scanned;
        let dof = first.dof - (n_parameters - first.n_parameters) as f64;
        if block.rank() == 0 || dof < 1.0 || delta_ss > self.moments.rr {
            return None;
        }
        let rest = held_against(self.question.pure, self.moments.rr - delta_ss, dof);
        let ln_p = |delta: f64, parameters: usize| ln_p_of_f(delta, parameters.max(1) as f64, rest, dof);
        let together = ln_p(delta_ss, n_parameters) + ln_pairs;
        let each = [
            ln_p(more, n_parameters - first.n_parameters),
            ln_p(delta_ss - b.along.norm_squared(), n_parameters.saturating_sub(second.n_parameters)),
        ];
        let passes = together < super::multiplicity::NAMED_LEVEL.ln() && each.iter().all(|p| *p < EACH_LN_P);
        let (a, b) = (a.candidate, b.candidate);
        let (one, other) = if first.ln_p <= second.ln_p { (a, b) } else { (b, a) };
        passes.then(|| Pair {
            first: one,
            second: other,
            delta_ss,
            n_parameters,
            bic: self.criterion(delta_ss, n_parameters),
            p_adjusted: together.exp(),
        })
    }
}
