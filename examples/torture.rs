//! Calls that are killed at random moments, and calls that change one study at the same time, in numbers.
//!
//! `cargo run --release --example torture -- [kills [N] | races [N]]`: both, 1 000 each, where nothing is said. The sweep over all
//! numbers of a plan is `cargo test --release --test diagnosis plan_sweep -- --ignored`; the readers are fuzzed by `fuzz/run-short`.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)] // an example ends with what went wrong

#[path = "../tests/interface/torture/runs.rs"]
mod runs;

use runs::{Program, Races};
use std::process::ExitCode;

/// Set for the processes that this one starts: they are the program itself.
const AS_PROGRAM: &str = "AXISCAL_TORTURE_AS_PROGRAM";

fn main() -> ExitCode {
    if std::env::var_os(AS_PROGRAM).is_some() {
        return axiscal::cli::main();
    }
    let words: Vec<String> = std::env::args().skip(1).collect();
    let count = words.get(1).and_then(|word| word.parse().ok()).unwrap_or(1000);
    let program = Program { path: std::env::current_exe().unwrap(), environment: Some(AS_PROGRAM) };
    let good = match words.first().map(String::as_str) {
        Some("kills") => kills(&program, count),
        Some("races") => races(&program, count),
        // `&`: the second is run though the first has failed
        None => kills(&program, count) & races(&program, count),
        _ => {
            eprintln!("usage: torture [kills [N] | races [N]]");
            return ExitCode::from(2);
        }
    };
    if good { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}

fn kills(program: &Program, count: usize) -> bool {
    println!("| verb | kills | as before | as after | unfinished | damaged | not mended by the next call |");
    println!("|---|---|---|---|---|---|---|");
    let all = runs::kills(program, count);
    for (verb, k) in &all {
        println!(
            "| {verb} | {} | {} | {} | {} | {} | {} |",
            k.kills, k.before, k.after, k.unfinished, k.damaged, k.not_mended
        );
    }
    all.iter().all(|(_, k)| k.damaged == 0 && k.not_mended == 0)
}

type Run = fn(&Program, usize) -> Races;

fn races(program: &Program, count: usize) -> bool {
    println!("| who | changes | done | refused | lost |");
    println!("|---|---|---|---|---|");
    let kinds: [(&str, Run); 3] = [
        ("two `add`", runs::two_adds),
        ("workbench and `add`", runs::workbench_and_add),
        ("two workbenches", runs::two_workbenches),
    ];
    let mut good = true;
    for (who, run) in kinds {
        let r = run(program, count);
        println!("| {who} | {} | {} | {} | {} |", r.changes, r.done, r.refused, r.lost);
        good &= r.lost == 0;
    }
    good
}
