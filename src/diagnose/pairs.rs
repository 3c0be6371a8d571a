//! Two effects at once, before an effect of many parameters is named and before nothing is.

use super::decide::{Decision, Kind, LACK_OF_FIT, bears_out};
use super::{Examination, Subject, tried_with};
use crate::search::groups::Group;
use crate::search::held_out::{Choice, held_out};
use crate::search::{KEPT, Library, Origin, Pair, Question, Score, Search, lack_of_fit, side_by_side};

/// So many of the most significant groups are paired: effects that these touches cannot separate fill no list.
const AMONG: usize = 10;

/// The pair that is to be named in place of what the tests of single effects decide: together they explain all that no one does, no
/// pattern says it with less, and held-out touches bear them out.
pub(super) fn both(subject: Subject, seen: &Examination, decision: &Decision) -> Option<Pair> {
    if decision.kind == Kind::TooFewTouches || decision.kind == Kind::Adequate {
        return None;
    }
    let search = &seen.search;
    let pair = better_than_one(search)?;
    if decision.confirmed && is_found_alone(&pair, &seen.groups) {
        return None;
    }
    // a pattern without a name that says it with less is no pair of names
    if seen.patterns.leading_shape().is_some_and(|shape| seen.patterns.bic(shape) < pair.bic) {
        return None;
    }
    let mut library = Library::new(search.library.n_rows());
    let joint = side_by_side(&[pair.first, pair.second].map(|c| search.columns(c)));
    let mut base = search.question.base.clone();
    base.extend(&joint, KEPT);
    // with shapes at the values that were tried; where that leaves too much, with all of their values free
    let leaves_much = lack_of_fit(&Question { base: &base, ..search.question }).p < LACK_OF_FIT;
    if leaves_much && !is_left_to_the_noise(subject, [pair.first, pair.second].map(|c| &*seen.named.effects[c].id)) {
        return None;
    }
    library.push("both", Origin::Catalogue, &joint);
    let held = held_out(search.question, &library, &seen.evidence.visits, Choice::Given(0));
    bears_out(&held).then_some(pair)
}

/// The first effect of two is found by itself, and the other one after it.
fn is_found_alone(pair: &Pair, groups: &[Group]) -> bool {
    groups.first().is_some_and(|leader| leader.holds(pair.first) || leader.holds(pair.second))
}

/// Two criteria that differ by less are equal: the two effects are then one effect in parts.
const EQUAL: f64 = 1e-6;

/// The pair that takes away most, where its criterion is lower than that of any single effect.
fn better_than_one(search: &Search) -> Option<Pair> {
    let best = (0..search.scores.len()).map(|c| search.bic(c)).fold(f64::INFINITY, f64::min);
    search.best_pair(&among(search)).filter(|pair| pair.bic < best - EQUAL)
}

/// Candidates that are paired.
fn among(search: &Search) -> Vec<usize> {
    search.groups(AMONG).iter().map(Group::first).collect()
}

/// What the best pair takes away by the tests, 0 where there is none.
pub(super) fn gained(search: &Search) -> f64 {
    search.best_pair(&among(search)).map_or(0.0, |pair| pair.delta_ss)
}

/// Does the noise explain what a fit with these effects leaves?
fn is_left_to_the_noise(subject: Subject, effects: [&str; 2]) -> bool {
    tried_with(subject, &effects).is_ok_and(|fit| fit.dof > 0 && fit.outcome.chi2_per_dof <= fit.noise.limit(fit.dof))
}

/// The groups with those of the pair in front, and the scores of each with the other in the model: what the other one does says nothing
/// of what is in its group.
pub(super) fn in_front(seen: &Examination, pair: &Pair, at_most: usize) -> (Vec<Group>, [Vec<Score>; 2]) {
    groups_with_the_pair(&seen.search, &seen.groups, pair, at_most)
}

fn groups_with_the_pair(
    search: &Search,
    groups: &[Group],
    pair: &Pair,
    at_most: usize,
) -> (Vec<Group>, [Vec<Score>; 2]) {
    let (of_first, first) = search.beside(pair.second, pair.first);
    let (of_second, mut second) = search.beside(pair.first, pair.second);
    second.members.retain(|m| m.candidate == pair.second || !first.holds(m.candidate));
    let is_one_of_them = |g: &Group| [g.first(), g.leader].iter().any(|c| first.holds(*c) || second.holds(*c));
    let rest: Vec<Group> = groups.iter().filter(|g| !is_one_of_them(g)).cloned().collect();
    let mut all = vec![first, second];
    all.extend(rest);
    all.truncate(at_most.max(2));
    (all, [of_first, of_second])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::search::Basis;
    use crate::search::testing::{noise_matrix, rng};
    use nalgebra::DMatrix;

    const ROWS: usize = 200;

    /// Two effects act. A third candidate has the columns of both and some more, which the residual does not see: it takes away as much
    /// with more parameters, and the pair wins by ln(200) for each, which is less than 10 for one. With the two columns alone it is one
    /// effect in place of two.
    #[test]
    fn two_simple_effects_win_where_their_criterion_is_lower() {
        for (more, wins) in [(0, false), (1, true), (2, true)] {
            let mut rng = rng(43);
            let columns = noise_matrix(&mut rng, ROWS, 8);
            let base = Basis::new(&columns.columns(4, 4).into_owned());
            let mut library = Library::new(ROWS);
            library.push("c0", Origin::Catalogue, &columns.columns(0, 1).into_owned());
            library.push("c1", Origin::Catalogue, &columns.columns(1, 1).into_owned());
            library.push("composite", Origin::Catalogue, &columns.columns(0, 2 + more).into_owned());
            let noise = Basis::new(&columns).project(&noise_matrix(&mut rng, ROWS, 1).column(0).into_owned());
            let residual = noise - columns.column(0) - columns.column(1) * 0.8;
            let search = Search::new(Question { residual: &residual, base: &base, pure: None }, &library);
            let found = better_than_one(&search);
            assert_eq!(found.is_some(), wins, "{more} more columns");
            if let Some(pair) = found {
                assert_eq!([pair.first.min(pair.second), pair.first.max(pair.second)], [0, 1]);
                let by = search.bic(2) - pair.bic;
                assert!((by - more as f64 * (ROWS as f64).ln()).abs() < 0.3, "{more} more columns: {by}");
            }
        }
    }

    /// A leader that held-out touches confirm is named alone where it is one of the pair; where it is another effect, that looks like
    /// both together, the pair is named though it has more parameters.
    #[test]
    fn a_confirmed_leader_keeps_its_name_only_as_one_of_the_pair() {
        let mut rng = rng(44);
        let columns = noise_matrix(&mut rng, ROWS, 6);
        let base = Basis::new(&columns.columns(4, 2).into_owned());
        let noise = noise_matrix(&mut rng, ROWS, 1).column(0).into_owned();
        for (second, alone) in [(0.2, true), (0.8, false)] {
            let act = columns.column(0) + columns.column(1) * second;
            let mut library = Library::new(ROWS);
            library.push("c0", Origin::Catalogue, &columns.columns(0, 1).into_owned());
            library.push("c1", Origin::Catalogue, &columns.columns(1, 1).into_owned());
            // one parameter, and nearly what both do together where the second is strong
            let alike = columns.column(0) + columns.column(1) * 0.6;
            library.push("like both", Origin::Catalogue, &DMatrix::from_columns(&[alike]));
            let residual = base.project(&(&noise * 0.1 - act));
            let search = Search::new(Question { residual: &residual, base: &base, pure: None }, &library);
            let pair = better_than_one(&search).unwrap();
            assert_eq!([pair.first.min(pair.second), pair.first.max(pair.second)], [0, 1]);
            let groups = search.groups(8);
            assert_eq!(groups[0].first(), if alone { 0 } else { 2 }, "{groups:?}");
            assert_eq!(is_found_alone(&pair, &groups), alone, "{groups:?}");
        }
    }

    /// Two effects act, each has a twin, and a third effect is stronger than both of them alone.
    #[test]
    fn the_groups_of_the_pair_come_first_and_only_once() {
        let mut rng = rng(41);
        let base = Basis::new(&noise_matrix(&mut rng, ROWS, 4));
        let columns: Vec<DMatrix<f64>> = (0..6).map(|_| noise_matrix(&mut rng, ROWS, 1)).collect();
        let mut library = Library::new(ROWS);
        for (i, column) in columns.iter().enumerate() {
            library.push(format!("c{i}"), Origin::Catalogue, column);
        }
        library.push("twin of c1", Origin::Catalogue, &(&columns[1] * 2.0));
        library.push("twin of c2", Origin::Catalogue, &(&columns[2] * -0.5));
        let act = &columns[0] * 2.0 + &columns[1] + &columns[2] * 0.7;
        let residual = (noise_matrix(&mut rng, ROWS, 1) - act).column(0).into_owned();
        let search = Search::new(Question { residual: &residual, base: &base, pure: None }, &library);
        let pair = search.best_pair(&[1, 2]).unwrap();
        let twin_of = |candidate: usize| candidate + 5;
        let groups = search.groups(8);
        assert_eq!(groups[0].first(), 0);
        let (groups, scores) = groups_with_the_pair(&search, &groups, &pair, 4);
        assert!(scores.iter().all(|scores| scores.len() == library.candidates().len()));
        assert_eq!(groups.len(), 4);
        assert!(groups[0].holds(pair.first) && groups[0].holds(twin_of(pair.first)), "{pair:?} {:?}", groups[0]);
        assert!(groups[1].holds(pair.second) && groups[1].holds(twin_of(pair.second)), "{pair:?} {:?}", groups[1]);
        assert_eq!(groups[2].first(), 0);
        for candidate in 0..library.candidates().len() {
            let times = groups.iter().filter(|group| group.holds(candidate)).count();
            assert!(times <= 1, "{candidate} is in {times} groups");
        }
    }
}
