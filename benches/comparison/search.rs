//! The score tests of all candidates against what they replace: a refit of the model with each of them.

use crate::problems::{Problem, SIGMA_MM, try_solve};
use axiscal::diagnose::candidate_effects::Named;
use axiscal::diagnose::evidence::Evidence;
use axiscal::fit::{self, Settings};
use axiscal::search::Search;
use std::time::Instant;

/// Times at one size, s, fastest of some runs, one thread.
pub struct ScoreTests {
    pub n_touches: usize,
    pub n_unknowns: usize,
    /// Effects that are tested.
    pub candidates: usize,
    /// Columns of all candidates, values of a scanned shape included.
    pub columns: usize,
    /// Columns of all candidates at all touches, whitened.
    pub columns_s: f64,
    /// All tests from these columns.
    pub tests_s: f64,
    /// The bare fit with each candidate in the model, one after the other (a scanned shape is solved for, once).
    pub solves_s: f64,
    /// All of `identify --quick` with each candidate, as `add` does it.
    pub refits_s: f64,
}

/// Measures one size on one thread.
pub fn score_tests(n_touches: usize, n_unknowns: usize) -> ScoreTests {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    pool.install(|| measure(n_touches, n_unknowns))
}

fn fastest(repeats: usize, mut run: impl FnMut()) -> f64 {
    let once = |run: &mut dyn FnMut()| {
        let start = Instant::now();
        run();
        start.elapsed().as_secs_f64()
    };
    (0..repeats).map(|_| once(&mut run)).fold(f64::INFINITY, f64::min)
}

fn measure(n_touches: usize, n_unknowns: usize) -> ScoreTests {
    let mut problem = Problem::new(n_touches, n_unknowns, SIGMA_MM);
    let base = problem.effects.clone();
    let settings = Settings { quick: true, ..problem.settings() };
    let (machine, catalogue) = (problem.machine.clone(), problem.catalogue.clone());
    let fit = fit::identify_data(&machine, &catalogue, problem.data(), &settings).unwrap();
    let evidence = Evidence::from_fit(&fit);
    let named = Named::for_fit(&fit, &evidence, &machine, &catalogue);
    let few = if n_touches > 1000 { 3 } else { 20 };
    let columns_s = fastest(few, || drop(Named::for_fit(&fit, &evidence, &machine, &catalogue)));
    let tests_s = fastest(5 * few, || drop(Search::new(evidence.question(), &named.library)));
    let (mut solves_s, mut refits_s) = (0.0, 0.0);
    for effect in &named.effects {
        problem.effects = base.iter().cloned().chain([effect.id.clone()]).collect();
        let data = problem.data();
        let model = problem.model(&data);
        // an effect that leaves no trace of its own is not solved: nothing is lost to the comparison
        solves_s += fastest(1, || drop(try_solve(&model, &data)));
        let more = Settings { effects: problem.effects.clone(), ..settings.clone() };
        let mut data = Some(data);
        refits_s += fastest(1, || {
            drop(fit::identify_data(&machine, &catalogue, data.take().unwrap(), &more).unwrap());
        });
    }
    ScoreTests {
        n_touches,
        n_unknowns,
        candidates: named.effects.len(),
        columns: named.library.n_columns(),
        columns_s,
        tests_s,
        solves_s,
        refits_s,
    }
}
