//! The corpus's machine and plan, and what holds for whatever is read.
#![allow(dead_code)]

use axiscal::diag::source;
use axiscal::log::{self, ParsedLog, Writer};
use axiscal::machine::{self, Machine};
use axiscal::post::Postprocessor;
use axiscal::program::plan::Plan;
use std::sync::LazyLock;

static PLANNED: LazyLock<(Machine, Plan)> = LazyLock::new(|| {
    let (machines, _) = machine::load(&source("machines.toml", machine::BUILT_IN)).expect("shipped");
    let machine = machines.into_iter().find(|m| m.name == "swivel-head").expect("shipped");
    let plan = Plan::parse(&source("t.plan.json", include_str!("../../tests/logs/t.plan.json"))).expect("a plan").0;
    (machine, plan)
});

pub static POSTS: LazyLock<Vec<Postprocessor>> = LazyLock::new(|| Postprocessor::built_in().expect("shipped"));

/// Every touch is one line of its own, with finite numbers; every finding shows its place.
pub fn sound(data: &[u8], parsed: &ParsedLog) {
    let n_lines = data.iter().filter(|b| matches!(b, b'\n' | b'\r')).count() + 1;
    let mut last = 0;
    for touch in &parsed.touches {
        assert!(touch.line > last && touch.line <= n_lines, "{touch:?}");
        assert!(touch.position.0.iter().all(|v| v.is_finite()), "{touch:?}");
        last = touch.line;
    }
}

/// Read and matched to the plan: each planned touch once at most.
pub fn matched(data: &[u8], writer: Writer<'_>) {
    let (machine, plan) = &*PLANNED;
    match log::read(data, "fuzz", writer, machine, plan) {
        Ok((read, findings)) => {
            assert!(read.touches.len() <= plan.touches.len());
            findings.0.iter().for_each(|f| drop(f.to_string()));
        }
        Err(failure) => assert!(!failure.0.is_empty()),
    }
}
