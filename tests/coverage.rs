//! Errors scatter as their uncertainties say: a smaller count of what `examples/coverage.rs` runs in full.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)] // a panic in a test is a failure with its place

mod common;
#[path = "common/coverage.rs"]
mod coverage;

#[test]
fn uncertainties_are_those_of_the_errors() {
    let mut wrong = Vec::new();
    for case in &coverage::CASES {
        let summary = coverage::run(case, 300, 30, 20);
        println!("{} {:?}: {summary:?}", case.machine, case.programs);
        wrong.extend(coverage::check(case, &summary, 3.5));
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}
