//! Errors scatter as their uncertainties say: a smaller count of what `examples/coverage.rs` runs in full.

use crate::coverage_cases as coverage;

#[test]
fn uncertainties_are_those_of_the_errors() {
    let (mut wrong, mut all) = (Vec::new(), Vec::new());
    // each artefact once, each machine once; all of them: `examples/coverage.rs`
    let artefacts = coverage::ARTEFACTS.iter().step_by(6);
    for case in coverage::CASES.iter().chain(artefacts) {
        let summary = coverage::run(case, 300, 30, 20);
        println!("{} {:?} {:?}: {summary:?}", case.machine, case.programs, case.artefact);
        wrong.extend(coverage::check(case, &summary, 3.5));
        all.push(summary);
    }
    wrong.extend(coverage::check_together(&all, 3.5));
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

/// The bounds of all cases together have teeth: the same runs with intervals a twentieth too narrow or too wide are refused.
#[test]
fn intervals_a_twentieth_off_are_refused() {
    // what a normal error makes of an interval of 1.96 standard deviations that are off by a factor
    let inside = |factor: f64| statrs::function::erf::erf(1.959_964 * factor / std::f64::consts::SQRT_2);
    let summary = |factor: f64| coverage::Summary {
        runs: 300,
        rows: vec![coverage::Row { name: String::new(), ratio: 1.0 / factor, covered: inside(factor) }; 39],
        chi2_per_dof: 1.0,
        tails: [0.025; 2],
        tau_estimated: false,
        dof: 300,
        tau2_ratio: 0.0,
        shown_um: None,
        rejected_per_mille: 0.0,
    };
    let refused = |factor: f64| coverage::check_together(&vec![summary(factor); coverage::CASES.len()], 3.5).len();
    assert_eq!(refused(1.0), 0);
    for factor in [0.95, 1.05] {
        assert_eq!(refused(factor), 2, "{factor}: {}", inside(factor));
    }
}
