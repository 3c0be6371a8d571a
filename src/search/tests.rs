//! Distributions, algebra and decisions of the search, against simulation and against plain least squares.

use super::groups::alias_pairs;
use super::held_out::{Choice, held_out};
use super::power::{power, separation};
use super::testing::{noise, noise_matrix, rng};
use super::*;
use nalgebra::{DMatrix, DVector};
use rand_chacha::ChaCha8Rng;
use std::f64::consts::TAU;

const ROWS: usize = 200;

pub(super) fn ask<'a>(residual: &'a DVector<f64>, base: &'a Basis) -> Question<'a> {
    Question { residual, base, pure: None }
}

/// Candidates of 1 to 3 columns that resemble each other strongly: mixtures of few directions.
pub(super) fn correlated_library(rng: &mut ChaCha8Rng, rows: usize, count: usize) -> Library {
    mixtures(rng, rows, count, 0.7)
}

/// The larger `own` beside √12, the less they have in common.
pub(super) fn mixtures(rng: &mut ChaCha8Rng, rows: usize, count: usize, own: f64) -> Library {
    let roots = noise_matrix(rng, rows, 12);
    let mut library = Library::new(rows);
    for i in 0..count {
        let apart = noise_matrix(rng, rows, 1 + i % 3) * own;
        let mixed = &roots * noise_matrix(rng, 12, 1 + i % 3) + apart;
        library.push(format!("c{i}"), Origin::Catalogue, &mixed);
    }
    library
}

fn raw_of(library: &Library, sigma: f64) -> Vec<DMatrix<f64>> {
    (0..library.candidates().len()).map(|c| library.columns(c, 0) * sigma).collect()
}

fn least_squares(a: &DMatrix<f64>, r: &DVector<f64>) -> (DVector<f64>, f64) {
    let theta = a.clone().svd(true, true).solve(&(-r), 1e-12).unwrap();
    let left = r + a * &theta;
    (theta, left.norm_squared())
}

fn beside(a: &DMatrix<f64>, b: &DMatrix<f64>) -> DMatrix<f64> {
    let mut out = a.clone().resize_horizontally(a.ncols() + b.ncols(), 0.0);
    out.columns_mut(a.ncols(), b.ncols()).copy_from(b);
    out
}

/// Largest distance of a sample from the uniform distribution, times √n: 1.63 is the 1 % limit.
fn kolmogorov(mut p: Vec<f64>) -> f64 {
    p.sort_by(f64::total_cmp);
    let n = p.len() as f64;
    let gap = |i: usize, x: f64| (x - i as f64 / n).abs().max(((i + 1) as f64 / n - x).abs());
    p.iter().enumerate().map(|(i, &x)| gap(i, x)).fold(0.0, f64::max) * n.sqrt()
}

#[test]
fn the_expected_size_is_that_of_a_refit() {
    let mut rng = rng(10);
    let a = noise_matrix(&mut rng, ROWS, 9);
    let base = Basis::new(&a);
    let mut library = correlated_library(&mut rng, ROWS, 20);
    // one that the base follows but for 1 %
    let near = &a * noise_matrix(&mut rng, 9, 2) + noise_matrix(&mut rng, ROWS, 2) * 0.03;
    library.push("near", Origin::Catalogue, &near);
    let r = base.project(&(noise(&mut rng, ROWS) * 2.0));
    let search = Search::new(ask(&r, &base), &library);
    for s in &search.scores {
        let columns = search.columns(s.candidate);
        let q = columns.ncols();
        assert_eq!(s.q, q);
        let all = beside(&a, &columns);
        let (theta, ss) = least_squares(&all, &r);
        let refit = theta.rows(9, q);
        assert!((&s.estimate - refit).amax() < 1e-9 * refit.amax(), "{}", library.candidates()[s.candidate].id);
        assert!((r.norm_squared() - s.delta_ss - ss).abs() < 1e-9 * ss);
        let dof = (ROWS - 9 - q) as f64;
        let covariance = (all.transpose() * &all).try_inverse().unwrap() * (ss / dof);
        assert!((&s.covariance - covariance.view((9, 9), (q, q))).amax() < 1e-8 * s.covariance.amax());
        assert!((s.f - s.delta_ss / q as f64 / (ss / dof)).abs() < 1e-9 * s.f.max(1.0));
    }
}

#[test]
fn what_the_base_follows_leaves_no_trace() {
    let mut rng = rng(11);
    let a = noise_matrix(&mut rng, ROWS, 5);
    let base = Basis::new(&a);
    let mut library = Library::new(ROWS);
    library.push("inside", Origin::Catalogue, &(&a * noise_matrix(&mut rng, 5, 2)));
    library.push("empty", Origin::Catalogue, &DMatrix::zeros(ROWS, 1));
    let half = beside(&(&a * noise_matrix(&mut rng, 5, 1)), &noise_matrix(&mut rng, ROWS, 1));
    library.push("half", Origin::Catalogue, &half);
    let r = noise(&mut rng, ROWS);
    let search = Search::new(ask(&r, &base), &library);
    assert_eq!(search.scores.iter().map(|s| s.q).collect::<Vec<_>>(), [0, 0, 1]);
    assert_eq!(search.scores[0].p, 1.0);
    assert_eq!(search.ranking(), [2]);
    let seen = power(&base, &library, &|c| raw_of(&library, 1.0).swap_remove(c));
    assert!(seen[0].minimal_detectable.is_none() && seen[2].minimal_detectable.is_some());
}

#[test]
fn p_values_of_clean_data_are_uniform() {
    let mut rng = rng(12);
    let base = Basis::new(&noise_matrix(&mut rng, 60, 9));
    let library = correlated_library(&mut rng, 60, 3);
    let mut p: Vec<Vec<f64>> = vec![Vec::new(); 6];
    for run in 0..1500 {
        let r = noise(&mut rng, 60);
        // pure error from other touches joins in every other run
        let chi2: f64 = noise(&mut rng, 8).norm_squared();
        let pure = PureError { variance: chi2 / 8.0, dof: 8.0, within: false, floor: false };
        let question = Question { residual: &r, base: &base, pure: (run % 2 == 0).then_some(pure) };
        for s in Search::new(question, &library).scores {
            p[2 * s.candidate + run % 2].push(s.p);
        }
    }
    for p in p {
        let distance = kolmogorov(p);
        assert!(distance < 1.63, "{distance}");
    }
}

#[test]
fn holm_keeps_the_family_level_with_correlated_candidates() {
    let mut rng = rng(13);
    let base = Basis::new(&noise_matrix(&mut rng, 120, 15));
    let library = correlated_library(&mut rng, 120, 70);
    let runs = 2000;
    let proposed = (0..runs)
        .filter(|_| {
            let r = noise(&mut rng, 120);
            Search::new(ask(&r, &base), &library).leader().is_some()
        })
        .count();
    let rate = proposed as f64 / f64::from(runs);
    // named effects alone have 4 % of the level; two standard errors more
    assert!(rate < 0.04 + 2.0 * (0.04f64 * 0.96 / f64::from(runs)).sqrt(), "{rate}");
    assert!(rate > 0.005, "a test that never fires is no test: {rate}");
}

#[test]
fn a_scan_keeps_its_rate() {
    let mut rng = rng(14);
    let n = 150;
    let base = Basis::new(&DMatrix::from_fn(n, 2, |i, j| (i as f64 / n as f64).powi(j as i32)));
    let mut library = Library::new(n);
    let step = |at: usize| DMatrix::from_fn(n, 1, |i, _| f64::from(u8::from(i >= at)));
    library.push_scan("step", Origin::Catalogue, (5..145).step_by(3).map(|at| (at as f64, step(at))), 1);
    let wave = |k: usize| {
        DMatrix::from_fn(n, 2, |i, j| (TAU * k as f64 * i as f64 / n as f64 / 2.0 - j as f64 * TAU / 4.0).cos())
    };
    library.push_scan("period", Origin::Catalogue, (2..60).map(|k| (k as f64, wave(k))), 1);
    let decay = |k: usize| DMatrix::from_fn(n, 1, |i, _| (-(i as f64) / (10.0 * k as f64)).exp());
    library.push_scan("decay", Origin::Catalogue, (1..4).map(|k| (k as f64, decay(k))), 1);
    let runs = 2000;
    let mut below = [[0usize; 2]; 3];
    for _ in 0..runs {
        let r = noise(&mut rng, n);
        for s in Search::new(ask(&r, &base), &library).scores {
            below[s.candidate][0] += usize::from(s.p < 0.05);
            below[s.candidate][1] += usize::from(s.p < 0.01);
        }
    }
    println!("scans on clean data below 5 % and 1 %: {below:?} of {runs}");
    for b in below {
        assert!(b[0] < 120 && b[1] < 30, "{below:?}");
    }
    assert!(below[0][0] > 20 && below[1][0] > 20, "the bound should not be empty: {below:?}");
}

#[test]
fn aliases_stand_in_one_group() {
    let mut rng = rng(15);
    let base = Basis::new(&noise_matrix(&mut rng, ROWS, 6));
    let truth = noise_matrix(&mut rng, ROWS, 1);
    let mut library = Library::new(ROWS);
    // inside of the base's space twins differ, and outside they do not
    let hidden = base.transposed().transpose() * noise_matrix(&mut rng, 6, 1) * 4.0;
    library.push("wide", Origin::Catalogue, &beside(&truth, &noise_matrix(&mut rng, ROWS, 1)));
    library.push("small-unit", Origin::Catalogue, &(&truth * 0.01));
    library.push("truth", Origin::Catalogue, &truth);
    library.push("twin", Origin::User, &(&truth * -0.7 + hidden));
    library.push("other", Origin::Catalogue, &noise_matrix(&mut rng, ROWS, 1));
    library.push("relative", Origin::Catalogue, &(&truth + noise_matrix(&mut rng, ROWS, 1) * 0.2));
    let r = noise(&mut rng, ROWS) - truth.column(0) * 2.0;
    let search = Search::new(ask(&r, &base), &library);
    let groups = search.groups(3);
    let names: Vec<&str> = groups[0].members.iter().map(|m| library.candidates()[m.candidate].id.as_str()).collect();
    // one parameter before two, plausible before not, the user's before ours; what these data tell apart stands alone
    assert_eq!(names, ["twin", "truth", "small-unit", "wide"]);
    let exact = groups[0].members.iter().find(|m| names[1] == library.candidates()[m.candidate].id).unwrap();
    assert!(exact.separation < 1e-6 && exact.leader_after_p > 0.9);
    assert!(!groups[0].members[2].plausible);
    let second: Vec<&str> = groups[1].members.iter().map(|m| library.candidates()[m.candidate].id.as_str()).collect();
    assert_eq!(second, ["relative"], "nearly the same, and told apart all the same");
    let relative = library.position("relative").unwrap();
    let products = super::distinguishability::Products::new(&base, &library.matrix().into_owned());
    let span = |c: usize| library.candidates()[c].variants[0].columns.clone();
    let truth = groups[0].leader;
    let left = products.left(&span(truth), Some(&search.scores[truth].estimate), Some(&span(relative)));
    assert!(left.lambda > 10.0 && left.q == 1, "{left:?}");
    assert_eq!(groups.len(), 3);
    assert_eq!(library.candidates()[groups[2].leader].id, "other");

    let pairs = alias_pairs(&base, &library);
    let pair = |a: &str, b: &str| {
        pairs.iter().find(|p| (p.explained, p.by) == (library.position(a).unwrap(), library.position(b).unwrap()))
    };
    assert!(pair("truth", "twin").unwrap().both_ways);
    assert!(!pair("truth", "wide").unwrap().both_ways && pair("wide", "truth").is_none());
    assert!(pair("other", "truth").is_none());
}

#[test]
fn minimal_detectable_size_has_noncentrality_25() {
    let mut rng = rng(16);
    let base = Basis::new(&noise_matrix(&mut rng, ROWS, 6));
    let mut library = Library::new(ROWS);
    let column = noise_matrix(&mut rng, ROWS, 1);
    library.push("one", Origin::Catalogue, &column);
    library.push("two", Origin::Catalogue, &noise_matrix(&mut rng, ROWS, 2));
    // σ = 2 µm: the column in µm is twice the whitened one
    let seen = power(&base, &library, &|c| raw_of(&library, 2.0).swap_remove(c));
    let peak = seen[0].minimal_detectable.unwrap();
    let size = peak / (2.0 * column.amax());
    let trace = base.project(&(column.column(0) * size));
    assert!((trace.norm_squared() - 25.0).abs() < 1e-9);
    assert!((seen[0].at_typical - 25.0 / (size * size)).abs() < 1e-6);
    let theta = DVector::from_element(1, size);
    assert!(separation(&base, &library, 0, &theta, 1) > 20.0);
    assert!(separation(&base, &library, 0, &theta, 0) < 1e-9);
}

/// Base with one offset per group and common columns; the group's own offset is unknown without its touches.
fn grouped(rng: &mut ChaCha8Rng, groups: usize, each: usize) -> (DMatrix<f64>, Vec<usize>) {
    let n = groups * each;
    let number: Vec<usize> = (0..n).map(|i| i / each).collect();
    let mut a = noise_matrix(rng, n, 8);
    // the last group alone bears a column
    for i in 0..n - each / 2 {
        a[(i, 7)] = 0.0;
    }
    (a, number)
}

#[test]
fn a_fold_is_a_refit_without_the_group() {
    // groups of more and of fewer touches than the base has columns
    is_refitted_without_each_group(10, 14);
    is_refitted_without_each_group(28, 5);
}

fn is_refitted_without_each_group(groups: usize, each: usize) {
    let mut rng = rng(18);
    let (a, number) = grouped(&mut rng, groups, each);
    let base = Basis::new(&a);
    let library = correlated_library(&mut rng, 140, 25);
    let r = noise(&mut rng, 140) - library.columns(5, 0) * noise(&mut rng, library.columns(5, 0).ncols()) * 0.4;
    let question = ask(&r, &base);
    for choice in [Choice::Redone, Choice::Given(5)] {
        let result = held_out(question, &library, &number, choice);
        let (mut before, mut after, mut scored) = (0.0, 0.0, 0);
        for fold in &result.folds {
            let train: Vec<usize> = (0..140).filter(|&i| number[i] != fold.group).collect();
            let test: Vec<usize> = (0..140).filter(|&i| number[i] == fold.group).collect();
            let rows = |m: &DMatrix<f64>, rows: &[usize]| m.select_rows(rows);
            let r_train = DVector::from_iterator(train.len(), train.iter().map(|&i| r[i]));
            // all of the choice again, from the training rows alone
            let trained = Basis::new(&rows(&a, &train));
            let mut own = Library::new(train.len());
            for c in 0..25 {
                own.push(format!("c{c}"), Origin::Catalogue, &rows(&library.columns(c, 0), &train));
            }
            let search = Search::new(ask(&r_train, &trained), &own);
            let chosen = if choice == Choice::Redone { search.leader() } else { Some(5) };
            assert_eq!(chosen, fold.chosen);
            let base_columns: Vec<usize> = if fold.group == groups - 1 { (0..7).collect() } else { (0..8).collect() };
            let a_known = a.select_columns(&base_columns);
            let with = chosen.map_or_else(|| a_known.clone(), |c| beside(&a_known, &library.columns(c, 0)));
            let (small, _) = least_squares(&rows(&a_known, &train), &r_train);
            let (large, _) = least_squares(&rows(&with, &train), &r_train);
            let design = rows(&with, &train);
            let inverse = (design.transpose() * &design).try_inverse().unwrap();
            for &i in &test {
                let x = with.row(i).transpose();
                // a touch that sees the column which only this group bears cannot be predicted
                let base_row = a_known.row(i).transpose();
                let base_rows = rows(&a_known, &train);
                let of_base = (base_rows.transpose() * &base_rows).try_inverse().unwrap();
                if (base_columns.len() == 7 && a[(i, 7)] != 0.0) || base_row.dot(&(&of_base * &base_row)) >= 9.0 {
                    continue;
                }
                scored += 1;
                let without = (r[i] + (a_known.row(i) * &small)[0]).powi(2);
                before += without;
                // one that the term makes unpredictable is predicted without it
                let told = x.dot(&(&inverse * &x)) < 9.0;
                after += if told { (r[i] + (with.row(i) * &large)[0]).powi(2) } else { without };
            }
        }
        assert_eq!(result.scored, scored);
        assert!(scored < 140);
        let rms = |ss: f64| (ss / scored as f64).sqrt();
        assert!((result.before - rms(before)).abs() < 1e-9, "{} {}", result.before, rms(before));
        assert!((result.after - rms(after)).abs() < 1e-9, "{} {}", result.after, rms(after));
    }
}

#[test]
fn held_out_error_of_noise_does_not_fall_and_of_an_effect_does() {
    let mut rng = rng(19);
    let (a, number) = grouped(&mut rng, 12, 16);
    let base = Basis::new(&a);
    let library = correlated_library(&mut rng, number.len(), 40);
    let (mut on_noise, mut on_effect, mut naive) = (0, 0, 0);
    let runs = 200;
    for run in 0..runs {
        let mut r = noise(&mut rng, number.len());
        on_noise += usize::from(held_out(ask(&r, &base), &library, &number, Choice::Redone).falls());
        let best = Search::new(ask(&r, &base), &library).ranking()[0];
        naive += usize::from(held_out(ask(&r, &base), &library, &number, Choice::Given(best)).gain > 0.0);
        let columns = library.columns(run % 40, 0);
        let trace = base.project(&(&columns * noise(&mut rng, columns.ncols())));
        r += &trace * (80.0 / trace.norm_squared()).sqrt();
        on_effect += usize::from(held_out(ask(&r, &base), &library, &number, Choice::Redone).falls());
    }
    println!("nested: noise {on_noise}, effect {on_effect}; choice not redone, noise {naive}; of {runs}");
    assert!(on_noise <= 6, "{on_noise}");
    assert!(on_effect >= 190, "{on_effect}");
    assert!(naive > 60, "choosing on all touches first would have looked like an improvement: {naive}");
}

#[test]
fn lack_of_fit_has_its_level() {
    let mut rng = rng(23);
    let a = noise_matrix(&mut rng, 80, 10);
    let base = Basis::new(&a);
    let mut p = [Vec::new(), Vec::new()];
    for _ in 0..800 {
        let r = noise(&mut rng, 80);
        p[0].push(lack_of_fit(&ask(&r, &base)).p);
        let chi2: f64 = noise(&mut rng, 20).norm_squared();
        let pure = PureError { variance: chi2 / 20.0, dof: 20.0, within: false, floor: false };
        p[1].push(lack_of_fit(&Question { pure: Some(pure), ..ask(&r, &base) }).p);
    }
    for p in p {
        assert!(kolmogorov(p) < 1.63);
    }
}

#[test]
fn a_fold_without_a_base_model_leaves_its_touches_as_they_are() {
    let mut rng = rng(23);
    let base = Basis::new(&DMatrix::zeros(40, 0));
    let column = noise_matrix(&mut rng, 40, 1);
    let r = noise(&mut rng, 40) * 0.1 - &column;
    let mut library = Library::new(40);
    library.push("truth", Origin::Catalogue, &column);
    let number: Vec<usize> = (0..40).map(|i| i / 4).collect();
    let result = held_out(ask(&r, &base), &library, &number, Choice::Given(0));
    assert_eq!(result.scored, 40);
    assert!((result.before - r.norm() / 40f64.sqrt()).abs() < 1e-12);
    assert!(result.after < 0.15 && result.falls(), "{result:?}");
}

#[test]
fn the_best_variant_is_that_of_the_whole_test() {
    let mut rng = rng(24);
    let base = Basis::new(&noise_matrix(&mut rng, ROWS, 5));
    let r = noise(&mut rng, ROWS);
    for columns in 1..4 {
        let variants: Vec<DMatrix<f64>> = (0..70).map(|_| noise_matrix(&mut rng, ROWS, columns)).collect();
        let mut library = Library::new(ROWS);
        library.push_scan("scan", Origin::Catalogue, variants.iter().enumerate().map(|(i, c)| (i as f64, c)), 1);
        let score = Search::new(ask(&r, &base), &library).scores.remove(0);
        assert_eq!(best_variant(ask(&r, &base), &library), Some((score.variant, score.delta_ss)));
    }
    let mut nothing = Library::new(ROWS);
    nothing.push_scan("scan", Origin::Catalogue, [(0.0, DMatrix::zeros(ROWS, 1)), (1.0, DMatrix::zeros(ROWS, 1))], 1);
    assert_eq!(best_variant(ask(&r, &base), &nothing), None);
}

#[test]
fn tests_go_on_with_a_larger_base_as_if_made_anew() {
    let mut rng = rng(26);
    let base = Basis::new(&noise_matrix(&mut rng, ROWS, 7));
    let library = correlated_library(&mut rng, ROWS, 30);
    let r = noise(&mut rng, ROWS) - library.columns(4, 0) * noise(&mut rng, library.columns(4, 0).ncols());
    let before = Search::new(ask(&r, &base), &library);
    let mut larger = base.clone();
    assert!(larger.extend(&noise_matrix(&mut rng, ROWS, 3), KEPT) == 3);
    for base in [&larger, &base] {
        let left = base.project(&r);
        let anew = Search::new(ask(&left, base), &library);
        let again = before.with_larger_base(ask(&left, base));
        for (a, b) in anew.scores.iter().zip(&again.scores) {
            let same = |x: f64, y: f64| (x - y).abs() <= 1e-9 * x.abs().max(1.0);
            assert!(same(a.delta_ss, b.delta_ss) && same(a.ln_p, b.ln_p) && same(a.dof, b.dof), "{a:?} {b:?}");
            assert_eq!((a.q, a.variant), (b.q, b.variant));
        }
    }
}
