//! A short run of `examples/torture.rs`: calls that are killed, and calls that change one study at the same time.
#![cfg(unix)] // a kill that nothing can catch

#[path = "torture/runs.rs"]
mod runs;

use runs::{Program, Races};

fn program() -> Program {
    Program { path: env!("CARGO_BIN_EXE_axiscal").into(), environment: None }
}

fn nothing_is_lost(races: Races) {
    assert_eq!(races.lost, 0, "{races:?}");
    assert!(races.done >= races.changes / 2, "{races:?}");
}

#[test]
fn a_killed_call_leaves_all_or_nothing() {
    for (verb, kills) in runs::kills(&program(), 30) {
        assert_eq!((kills.damaged, kills.not_mended), (0, 0), "{verb}: {kills:?}");
    }
}

#[test]
fn two_adds_at_once_lose_nothing() {
    nothing_is_lost(runs::two_adds(&program(), 12));
}

#[test]
fn a_workbench_and_an_add_lose_nothing() {
    nothing_is_lost(runs::workbench_and_add(&program(), 12));
}

#[test]
fn two_workbenches_lose_nothing() {
    nothing_is_lost(runs::two_workbenches(&program(), 12));
}
