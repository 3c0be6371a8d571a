//! Two effects at once: where no single candidate explains what is left, two simple ones together may.

use super::distributions::ln_p_of_f;
use super::groups::Group;
use super::moments::Block;
use super::score::{Score, Search, held_against};
use super::{KEPT, Question};
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

    /// All scores with a candidate in the base model, and the group that another one has then.
    #[must_use]
    pub fn beside(&self, other: usize, leader: usize) -> (Vec<Score>, Group) {
        let mut base = self.question.base.clone();
        base.extend(&self.columns(other), KEPT);
        let search = Search::new(Question { base: &base, ..self.question }, self.library);
        let among: Vec<usize> = search.ranking().into_iter().filter(|&c| c != other).collect();
        let group = search.group_of(leader, &among);
        (search.scores, group)
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

#[cfg(test)]
mod tests {
    use super::super::testing::{noise, noise_matrix, rng};
    use super::super::tests::ask;
    use super::*;
    use crate::search::{Basis, Library, Origin};
    use rand_chacha::ChaCha8Rng;

    const ROWS: usize = 200;
    const CANDIDATES: usize = 10;

    /// Ten effects of one parameter each that these touches separate well.
    fn simple_effects(rng: &mut ChaCha8Rng) -> Library {
        let mut library = Library::new(ROWS);
        for i in 0..CANDIDATES {
            library.push(format!("c{i}"), Origin::Catalogue, &noise_matrix(rng, ROWS, 1));
        }
        library
    }

    fn column(library: &Library, candidate: usize) -> DVector<f64> {
        library.columns(candidate, 0).column(0).into_owned()
    }

    /// Columns of some candidates side by side.
    fn columns_of(library: &Library, candidates: &[usize]) -> DMatrix<f64> {
        let columns: Vec<DVector<f64>> = candidates.iter().map(|&c| column(library, c)).collect();
        DMatrix::from_columns(&columns)
    }

    fn all(library: &Library) -> Vec<usize> {
        (0..library.candidates().len()).collect()
    }

    /// Sum of squares that columns take away from what a base leaves, by plain least squares.
    fn taken_away(base: &Basis, residual: &DVector<f64>, columns: &DMatrix<f64>) -> f64 {
        let columns = base.project_columns(columns);
        let residual = base.project(residual);
        let size = columns.clone().svd(true, true).solve(&residual, 1e-12).unwrap();
        residual.norm_squared() - (&residual - columns * size).norm_squared()
    }

    #[test]
    fn two_effects_that_act_at_once_are_found_as_the_pair() {
        for seed in 0..20 {
            let mut rng = rng(400 + seed);
            let base = Basis::new(&noise_matrix(&mut rng, ROWS, 6));
            let library = simple_effects(&mut rng);
            let residual = noise(&mut rng, ROWS) - column(&library, 3) * 0.6 - column(&library, 7) * 1.0;
            let search = Search::new(ask(&residual, &base), &library);
            let pair = search.best_pair(&all(&library)).unwrap();
            // the one that explains more by itself comes first
            assert_eq!((pair.first, pair.second), (7, 3), "{seed}: {pair:?}");
            assert_eq!(pair.n_parameters, 2);
            let delta_ss = taken_away(&base, &residual, &columns_of(&library, &[3, 7]));
            assert!((pair.delta_ss - delta_ss).abs() < 1e-9 * delta_ss, "{seed}: {pair:?}, refitted {delta_ss}");
            let (n, left) = (ROWS as f64, base.project(&residual).norm_squared() - delta_ss);
            let bic = n * (left / n).ln() + 2.0 * n.ln();
            assert!((pair.bic - bic).abs() < 1e-8 * bic.abs(), "{seed}: {pair:?}, by hand {bic}");
            assert!(pair.p_adjusted < 1e-6, "{seed}: {pair:?}");
            assert!(all(&library).iter().all(|&c| search.bic(c) > pair.bic + 10.0), "{seed}: {pair:?}");
            // only the candidates that are given are paired
            let without: Vec<usize> = all(&library).into_iter().filter(|&c| c != 3).collect();
            assert!(search.best_pair(&without).is_none_or(|pair| pair.second != 3 && pair.first != 3));
        }
    }

    /// Two columns that have much in common: alone, each takes a part of the other for its own.
    #[test]
    fn each_of_a_pair_has_the_size_that_it_has_beside_the_other() {
        let mut rng = rng(470);
        let base = Basis::new(&noise_matrix(&mut rng, ROWS, 6));
        let mut library = simple_effects(&mut rng);
        let alike = column(&library, 3) + column(&library, 4);
        library.push("alike", Origin::Catalogue, &DMatrix::from_columns(&[alike]));
        let two = columns_of(&library, &[3, CANDIDATES]);
        let residual = noise(&mut rng, ROWS) - &two * DVector::from_vec(vec![0.9, 0.6]);
        let search = Search::new(ask(&residual, &base), &library);
        assert!(search.best_pair(&[3, CANDIDATES]).is_some());
        let left = base.project_columns(&two);
        let gram = left.tr_mul(&left).try_inverse().unwrap();
        let sizes = -(&gram * left.tr_mul(&base.project(&residual)));
        let rest = base.project(&residual) + &left * &sizes;
        let covariance = gram * (rest.norm_squared() / (ROWS - 6 - 2) as f64);
        for (place, (candidate, other)) in [(3, CANDIDATES), (CANDIDATES, 3)].into_iter().enumerate() {
            let (scores, group) = search.beside(other, candidate);
            assert!(group.holds(candidate) && !group.holds(other));
            let score = &scores[candidate];
            let own = (score.estimate[0], score.covariance[(0, 0)]);
            assert!(
                (own.0 - sizes[place]).abs() < 1e-9 && (own.1 / covariance[(place, place)] - 1.0).abs() < 1e-9,
                "{own:?}"
            );
            let alone = search.scores[candidate].estimate[0];
            assert!((alone - own.0).abs() > 3.0 * own.1.sqrt(), "{alone} {own:?}");
        }
    }

    #[test]
    fn of_three_effects_the_two_that_explain_most_are_the_pair() {
        for seed in 0..10 {
            let mut rng = rng(450 + seed);
            let base = Basis::new(&noise_matrix(&mut rng, ROWS, 6));
            let library = simple_effects(&mut rng);
            let acts = column(&library, 3) * 1.1 + column(&library, 5) * 0.8 + column(&library, 7) * 1.4;
            let residual = noise(&mut rng, ROWS) - acts;
            let search = Search::new(ask(&residual, &base), &library);
            let pair = search.best_pair(&all(&library)).unwrap();
            assert!([(3, 7), (7, 3)].contains(&(pair.first, pair.second)), "{seed}: {pair:?}");
            // the others would be pairs as well, were they alone
            assert!(search.best_pair(&[3, 5]).is_some() && search.best_pair(&[5, 7]).is_some(), "{seed}");
        }
    }

    /// Each of the two is four standard deviations. Among ten effects that is a pair, and among three thousand it is none.
    #[test]
    fn all_pairs_that_there_are_count() {
        let mut rng = rng(460);
        let base = Basis::new(&DMatrix::zeros(ROWS, 0));
        let mut library = simple_effects(&mut rng);
        let two = columns_of(&library, &[3, 7]);
        let both = Basis::new(&two);
        let left = both.project(&noise(&mut rng, ROWS));
        let scale = ((ROWS - 2) as f64).sqrt() / left.norm();
        // so that each takes away 16 after the other one
        let gram = two.tr_mul(&two).try_inverse().unwrap();
        let size = |i: usize| 4.0 * gram[(i, i)].sqrt();
        let residual = left * scale - two.column(0) * size(0) - two.column(1) * size(1);
        let pair = Search::new(ask(&residual, &base), &library).best_pair(&[3, 7]).unwrap();
        let parts = [3, 7].map(|c| pair.delta_ss - taken_away(&base, &residual, &columns_of(&library, &[c])));
        assert!(parts.iter().all(|part| (part - 16.0).abs() < 1e-9), "{parts:?}");
        for i in CANDIDATES..3000 {
            library.push(format!("c{i}"), Origin::Catalogue, &noise_matrix(&mut rng, ROWS, 1));
        }
        assert_eq!(Search::new(ask(&residual, &base), &library).best_pair(&[3, 7]), None);
    }

    /// By the limit for each of the two, one run of about a hundred has a second effect by accident, and none is clearly better.
    #[test]
    fn one_effect_alone_makes_no_pair() {
        let (mut pairs, mut clearly_better) = (0, 0);
        for seed in 0..200 {
            let mut rng = rng(500 + seed);
            let base = Basis::new(&noise_matrix(&mut rng, ROWS, 6));
            let library = simple_effects(&mut rng);
            let residual = noise(&mut rng, ROWS) - column(&library, 3);
            let search = Search::new(ask(&residual, &base), &library);
            let Some(pair) = search.best_pair(&all(&library)) else { continue };
            pairs += 1;
            clearly_better += usize::from(pair.bic < search.bic(3) - 10.0);
        }
        println!("one effect: {pairs} pairs of 200, {clearly_better} clearly better than the effect");
        assert!(pairs <= 4, "{pairs}");
        assert_eq!(clearly_better, 0);
    }

    #[test]
    fn noise_makes_no_pair() {
        let found = |seed: u64| {
            let mut rng = rng(700 + seed);
            let base = Basis::new(&noise_matrix(&mut rng, ROWS, 6));
            let library = simple_effects(&mut rng);
            let residual = noise(&mut rng, ROWS);
            Search::new(ask(&residual, &base), &library).best_pair(&all(&library)).is_some()
        };
        assert_eq!((0..200).filter(|&seed| found(seed)).count(), 0);
    }

    /// Two effects of one parameter each act. The composite has the columns of both and some more.
    fn with_composite(composite: impl Fn(&mut ChaCha8Rng, &Library) -> DMatrix<f64>) -> (f64, Pair) {
        let mut rng = rng(901);
        let base = Basis::new(&noise_matrix(&mut rng, ROWS, 6));
        let mut library = simple_effects(&mut rng);
        let columns = composite(&mut rng, &library);
        library.push("composite", Origin::Catalogue, &columns);
        let residual = noise(&mut rng, ROWS) - column(&library, 3) * 0.6 - column(&library, 7);
        let search = Search::new(ask(&residual, &base), &library);
        let pair = search.best_pair(&all(&library)).unwrap();
        assert_eq!((pair.first.min(pair.second), pair.first.max(pair.second)), (3, 7), "{pair:?}");
        (search.bic(CANDIDATES), pair)
    }

    #[test]
    fn two_simple_effects_win_over_a_composite_of_more_parameters_only() {
        // one parameter moves both as they act: it says the same with less
        let (bic, pair) =
            with_composite(|_, library| columns_of(library, &[3, 7]) * DMatrix::from_column_slice(2, 1, &[0.6, 1.0]));
        assert!(bic < pair.bic, "{bic} {pair:?}");
        // the same two parameters: neither is better
        let (bic, pair) = with_composite(|_, library| columns_of(library, &[3, 7]));
        assert!((bic - pair.bic).abs() < 1e-6, "{bic} {pair:?}");
        // six more parameters that do not act
        let (bic, pair) = with_composite(|rng, library| {
            let mut columns = columns_of(library, &[3, 7]).resize_horizontally(8, 0.0);
            columns.columns_mut(2, 6).copy_from(&noise_matrix(rng, ROWS, 6));
            columns
        });
        assert!(bic > pair.bic + 10.0, "{bic} {pair:?}");
    }

    #[test]
    fn a_scanned_shape_counts_as_a_parameter_of_the_pair() {
        let mut rng = rng(902);
        let base = Basis::new(&noise_matrix(&mut rng, ROWS, 6));
        let mut library = simple_effects(&mut rng);
        let variants: Vec<DMatrix<f64>> = (0..5).map(|_| noise_matrix(&mut rng, ROWS, 1)).collect();
        let acts = variants[2].column(0).into_owned();
        library.push_scan("scan", Origin::Catalogue, variants.into_iter().enumerate().map(|(i, c)| (i as f64, c)), 1);
        let residual = noise(&mut rng, ROWS) - column(&library, 3) - acts;
        let search = Search::new(ask(&residual, &base), &library);
        let pair = search.best_pair(&all(&library)).unwrap();
        assert_eq!(pair.first + pair.second, 3 + CANDIDATES, "{pair:?}");
        assert_eq!((search.scores[CANDIDATES].variant, pair.n_parameters), (2, 3));
    }
}
