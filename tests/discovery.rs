//! Hidden effects, at counts that a test can afford; bars are those of docs/discovery.md widened by the sampling error of
//! these counts (three standard errors). `cargo run --release --example discovery` makes the full counts.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)] // a panic in a test is a failure with its place

mod common;
#[path = "discovery/mod.rs"]
mod discovery;

use axiscal::diagnose::Verdict;
use discovery::measure::{Outcome, both_named, clean, planted, two};
use discovery::plant::Bench;
use discovery::strange;

/// The least share that a sample of n may show where the true share is `bar`.
fn at_least(bar: f64, n: usize) -> f64 {
    bar - 3.0 * (bar * (1.0 - bar) / n as f64).sqrt()
}

fn check(what: &str, hits: usize, n: usize, bar: f64) {
    let share = hits as f64 / n as f64;
    println!("{what}: {hits} of {n} ({:.1} %), bar {:.1} %", 100.0 * share, 100.0 * bar);
    assert!(share >= at_least(bar, n), "{what}: {hits} of {n}");
}

fn count(outcomes: &[Outcome], what: impl Fn(&Outcome) -> bool) -> usize {
    outcomes.iter().filter(|o| what(o)).count()
}

#[test]
fn planted_effects_are_in_the_first_group_on_the_papers_plan() {
    let found = planted(&Bench::paper(), 60, 101);
    check("first group", count(&found, |o| o.first_group), found.len(), 0.95);
    check("first three groups", count(&found, |o| o.first_three), found.len(), 0.985);
}

#[test]
fn planted_effects_are_named_on_full() {
    let found = planted(&Bench::full(), 40, 102);
    check("first group", count(&found, |o| o.first_group), found.len(), 0.99);
    check("by name", count(&found, |o| o.by_name), found.len(), 0.95);
    check("first three groups", count(&found, |o| o.first_three), found.len(), 0.985);
    check("missing-effect", count(&found, |o| o.verdict == Verdict::MissingEffect), found.len(), 0.90);
    check("held-out error falls", count(&found, |o| o.held_out_falls), found.len(), 0.90);
    let mean = found.iter().map(|o| o.reduced_after).sum::<f64>() / found.len() as f64;
    assert!((mean - 1.0).abs() < 0.05, "{mean}");
}

#[test]
fn clean_machines_are_adequate() {
    for (name, bench, n) in [
        ("paper's plan", Bench::paper(), 60),
        ("paper's plan with the declared scatter of visits", Bench::paper().with_visits(0.5f64.hypot(0.5)), 60),
        ("full", Bench::full(), 40),
        ("full with 0.5 um per visit", Bench::full().with_visits(0.5), 40),
    ] {
        let verdicts = clean(&bench, n, None, 103);
        let adequate = verdicts.iter().filter(|c| c.verdict == Verdict::Adequate).count();
        check(&format!("adequate, {name}"), adequate, verdicts.len(), 0.95);
    }
}

#[test]
fn two_hidden_effects_are_both_named_on_full() {
    let found = two(&Bench::full(), 20, 104);
    check("both named", found.iter().filter(|(t, s)| both_named(t, s)).count(), found.len(), 0.90);
}

#[test]
fn what_is_in_no_catalogue_is_never_adequate() {
    let bench = Bench::full();
    let (mut right, mut all, mut bare) = (0, 0, 0);
    for (kind, (name, _, smooth)) in strange::KINDS.iter().enumerate() {
        let seen = strange::run(&bench, kind, 6, 105 + 100 * kind as u64);
        for s in &seen {
            assert!(s.verdict != Verdict::Adequate, "{name}: {s:?}");
            if *smooth {
                assert!(s.sketched.is_some_and(|rms| rms < 1.2), "{name}: {s:?}");
            }
        }
        bare += seen.iter().filter(|s| s.bare).count();
        right += seen.iter().filter(|s| s.right()).count();
        all += seen.len();
    }
    check("right variable first", right, all, 0.80);
    // every one of them would be wrong
    check("no bare name", all - bare, all, 0.97);
}
