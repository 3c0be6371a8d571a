//! Hidden effects at full count: `cargo run --release --example discovery [-- PART COUNT]`. The table stands in
//! docs/discovery.md. Parts: planted (paper, full), clean (clean-paper,
//! clean-paper-visits, clean-full, clean-full-visits), two, strange; all of them without an argument.
//! Planted by the generator of tests/discovery on all machines: faults (faults-paper, faults-full, faults-weak, faults-two), faultless
//! (faultless-paper, faultless-full; with one scatter in µm: faultless-paper-0.3), mistakes; on one sphere: faults-sphere,
//! faultless-sphere.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)] // a measurement that cannot be made shall stop
#![allow(missing_docs)]

#[path = "../tests/common/mod.rs"]
mod common;
#[path = "../tests/diagnosis/discovery_bench/mod.rs"]
mod discovery;
#[path = "../tests/discovery/mod.rs"]
mod generator;

use axiscal::diagnose::Verdict;
use discovery::measure::{Clean, Outcome, both_named, clean, planted, two};
use discovery::plant::Bench;
use discovery::strange::{self, Seen};
use generator::bench::Bench as Machines;
use generator::judge::{self, Conditions};
use generator::mistakes::MISTAKES;
use generator::peers::{self, Cases};
use std::collections::BTreeMap;

fn percent(part: usize, of: usize) -> String {
    format!("{:5.1} %", 100.0 * part as f64 / of.max(1) as f64)
}

fn share(outcomes: &[Outcome], what: impl Fn(&Outcome) -> bool) -> String {
    percent(outcomes.iter().filter(|o| what(o)).count(), outcomes.len())
}

fn report_planted(name: &str, outcomes: &[Outcome]) {
    let n = outcomes.len();
    println!("planted, {name}: {n} cases, {} with another shape", share(outcomes, |o| o.other_shape));
    println!(
        "  proposed {}  missing-effect {}",
        share(outcomes, |o| o.proposed),
        share(outcomes, |o| o.verdict.is_missing_effect())
    );
    println!(
        "  by name {}  first group {} (mean size {:.1})  first three {}",
        share(outcomes, |o| o.by_name),
        share(outcomes, |o| o.first_group),
        outcomes.iter().map(|o| o.group_size as f64).sum::<f64>() / n as f64,
        share(outcomes, |o| o.first_three)
    );
    for bent in [false, true] {
        let part: Vec<Outcome> = outcomes.iter().filter(|o| o.other_shape == bent).cloned().collect();
        println!(
            "    {}: by name {}  first group {}  first three {}",
            if bent { "another shape" } else { "own shape" },
            share(&part, |o| o.by_name),
            share(&part, |o| o.first_group),
            share(&part, |o| o.first_three)
        );
    }
    let mean = |f: &dyn Fn(&Outcome) -> f64| outcomes.iter().map(f).sum::<f64>() / n as f64;
    println!(
        "  reduced RMS {:.2} -> {:.3} um  held-out falls {}",
        mean(&|o| o.reduced_before),
        mean(&|o| o.reduced_after),
        share(outcomes, |o| o.held_out_falls)
    );
    let mut verdicts: BTreeMap<String, usize> = BTreeMap::new();
    outcomes.iter().for_each(|o| *verdicts.entry(o.verdict.as_str().to_owned()).or_default() += 1);
    println!("  verdicts {verdicts:?}");
    for o in outcomes.iter().filter(|o| !o.first_group || !o.by_name) {
        println!(
            "  - {}{} lambda {:.0}: {}{:?} {:.3?}",
            o.truth,
            if o.other_shape { " (bent)" } else { "" },
            o.lambda,
            if o.first_group { "" } else { "MISSED " },
            o.groups,
            o.shares
        );
    }
}

fn report_clean(name: &str, verdicts: &[Clean]) {
    let count = |v: &str| verdicts.iter().filter(|x| x.verdict.as_str() == v).count();
    println!(
        "clean, {name}: {} runs, not adequate {} (missing-effect {}, unexplained {})",
        verdicts.len(),
        percent(verdicts.len() - count("adequate"), verdicts.len()),
        count("missing-effect"),
        count("unexplained")
    );
    for c in verdicts.iter().filter(|c| c.verdict != Verdict::Adequate) {
        println!("  - {}", c.because);
    }
}

fn report_strange(name: &str, seen: &[Seen]) {
    let of = |what: &dyn Fn(&Seen) -> bool| percent(seen.iter().filter(|s| what(s)).count(), seen.len());
    println!(
        "in no catalogue, {name}: {} runs, adequate {}, bare name {}, right variable first {}, touches rejected {}, \
         adequate with two names that are not the cause {}",
        seen.len(),
        of(&|s| s.verdict == Verdict::Adequate),
        of(&|s| s.bare),
        of(&|s| s.right()),
        of(&|s| s.rejected > 0),
        of(&|s| s.adequate_after_two)
    );
    let sketched: Vec<f64> = seen.iter().filter_map(|s| s.sketched).collect();
    if !sketched.is_empty() {
        println!(
            "  with the sketch: {} within 20 % of the noise, worst {:.2} um",
            percent(sketched.iter().filter(|r| **r < 1.2).count(), sketched.len()),
            sketched.iter().copied().fold(0.0, f64::max)
        );
    }
    for s in seen.iter().filter(|s| !s.right() || s.bare || s.verdict == Verdict::Adequate).take(12) {
        println!(
            "  - {:?} lambda {:.0} first {:?} then {:?}, proposed {:?}, {} rejected",
            s.verdict, s.lambda, s.first, s.depends, s.proposed, s.rejected
        );
    }
}

/// One line for each case, then the rates with their 95 % intervals.
fn report_faults(name: &str, outcomes: &[judge::Outcome]) {
    println!("faults, {name}: {} cases", outcomes.len());
    for o in outcomes {
        println!(
            "  {} | {} | {} | noncentrality {:.0} | rank {} | {} | {:?}",
            if o.rank == Some(1) { "ok    " } else { "MISSED" },
            o.bench,
            o.what,
            o.noncentrality,
            o.rank.map_or("-".to_owned(), |r| r.to_string()),
            o.verdict,
            o.groups
        );
    }
    let of = |what: &dyn Fn(&judge::Outcome) -> bool| {
        judge::rate(outcomes.iter().filter(|o| what(o)).count(), outcomes.len())
    };
    println!("  first group {}", of(&|o| o.rank == Some(1)));
    println!("  first three {}", of(&|o| o.rank.is_some()));
    println!("  by name     {}", of(&|o| o.by_name));
    println!("  proposed    {}", of(&|o| o.proposed));
    println!("  two names for one fault {}", of(&|o| o.pair));
}

/// The parts that the generator of tests/discovery plants.
fn of_the_generator(part: &str, count: &dyn Fn(usize) -> usize) {
    let wanted = |name: &str| part == "all" || part == name || name.starts_with(&format!("{part}-"));
    let plain = Conditions { visit_um: 0.0, noncentrality: None };
    for (name, full, seed) in [("faults-paper", false, 51), ("faults-full", true, 52)] {
        if wanted(name) {
            report_faults(name, &judge::planted(&Machines::all(full), plain, count(400), seed));
        }
    }
    if wanted("faults-sphere") {
        report_faults("one sphere, auto", &judge::planted(&Machines::one_sphere(), plain, count(200), 57));
    }
    if wanted("faultless-sphere") {
        for visit_um in [0.0, 0.5] {
            let verdicts = judge::clean(&Machines::one_sphere(), visit_um, count(500), 58);
            let adequate = verdicts.iter().filter(|v| v.1 == "adequate").count();
            println!(
                "faultless-sphere, scatter {visit_um} um: not adequate {}",
                judge::rate(verdicts.len() - adequate, verdicts.len())
            );
        }
    }
    if wanted("faults-weak") {
        let weak = Conditions { noncentrality: Some(45.0), ..plain };
        report_faults("noncentrality 45, full", &judge::planted(&Machines::all(true), weak, count(200), 53));
    }
    if wanted("faults-two") {
        let pairs = judge::pairs(&Machines::all(true), count(200), 59);
        for p in pairs.iter().filter(|p| !p.both) {
            println!("  MISSED | {} | {} | {:?}", p.bench, p.what.join(" and "), p.steps);
        }
        println!("two faults, full: both named {}", judge::rate(pairs.iter().filter(|p| p.both).count(), pairs.len()));
    }
    for (name, full, seed) in [("faultless-paper", false, 54), ("faultless-full", true, 55)] {
        for (at, visit_um) in [("0", 0.0), ("0.3", 0.3), ("0.7", 0.7)] {
            if wanted(name) || part == format!("{name}-{at}") {
                let verdicts = judge::clean(&Machines::all(full), visit_um, count(2000), seed);
                let adequate = verdicts.iter().filter(|v| v.1 == "adequate").count();
                println!(
                    "{name}, scatter {visit_um} um: not adequate {}",
                    judge::rate(verdicts.len() - adequate, verdicts.len())
                );
            }
        }
    }
    if wanted("mistakes") {
        for full in [false, true] {
            for bench in Machines::all(full) {
                for mistake in &MISTAKES {
                    let led = judge::mistake(&bench, mistake, 56);
                    println!(
                        "{} | {} | {} | {}",
                        match (led.led, led.gave_temperatures) {
                            (true, false) => "led",
                            (true, true) => "led with the temperatures that it asked for",
                            (false, _) => "NOT LED",
                        },
                        led.bench,
                        led.what,
                        led.said.join("; ")
                    );
                }
            }
        }
    }
}

/// Cases for other methods: `-- cases FOLDER [COUNT]`, then `benches/discovery/peers.py FOLDER`.
fn cases(folder: &std::path::Path, count: usize) {
    let at = |visit_um: f64, noncentrality: Option<f64>| Conditions { visit_um, noncentrality };
    let of = |name, faulty, conditions| Cases { name, faulty, conditions };
    let all = [
        of("planted", true, at(0.0, None)),
        of("weak", true, at(0.0, Some(45.0))),
        of("clean", false, at(0.0, None)),
        of("scatter", false, at(0.7, None)),
    ];
    for (k, cases) in all.iter().enumerate() {
        peers::write(&Machines::all(false), cases, count, 60 + k as u64, folder);
    }
}

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let part = arguments.first().map_or("all", String::as_str);
    if part == "cases" {
        let count = arguments.get(2).map_or(100, |n| n.parse().unwrap());
        return cases(std::path::Path::new(&arguments[1]), count);
    }
    let count = |full: usize| arguments.get(1).map_or(full, |n| n.parse().unwrap());
    let wanted = |name: &str| part == "all" || part == name;
    of_the_generator(part, &count);
    let began = std::time::Instant::now();
    if wanted("planted") || part == "paper" {
        report_planted("paper's plan", &planted(&Bench::paper(), count(400), 1));
        println!("  [{:.0} s]", began.elapsed().as_secs_f64());
    }
    if wanted("planted") || part == "full" {
        report_planted("full", &planted(&Bench::full(), count(400), 2));
        println!("  [{:.0} s]", began.elapsed().as_secs_f64());
    }
    // two axes with 0.5 um each, as the machine file declares
    let declared_um = 0.5f64.hypot(0.5);
    let clean_cases = [
        ("clean-paper", "paper's plan", Bench::paper as fn() -> Bench, 0.0, 3),
        ("clean-paper-visits", "paper's plan, 0.7 um per visit as declared", Bench::paper, declared_um, 5),
        ("clean-full", "full", Bench::full, 0.0, 4),
        ("clean-full-visits", "full, 0.5 um per visit", Bench::full, 0.5, 6),
    ];
    for (name, says, bench, visit_um, seed) in clean_cases {
        if wanted("clean") || part == name {
            report_clean(says, &clean(&bench().with_visits(visit_um), count(2000) as u64, None, seed));
            println!("  [{:.0} s]", began.elapsed().as_secs_f64());
        }
    }
    if wanted("strange") {
        let bench = Bench::full();
        for (kind, (name, _, _)) in strange::KINDS.iter().enumerate() {
            report_strange(name, &strange::run(&bench, kind, count(100) as u64, 100 * kind as u64 + 8));
        }
        println!("  [{:.0} s]", began.elapsed().as_secs_f64());
    }
    if wanted("two") {
        let found = two(&Bench::full(), count(400), 7);
        let both = found.iter().filter(|(t, s)| both_named(t, s)).count();
        let more = found.iter().filter(|(_, s)| s.len() > 2).count();
        println!(
            "two hidden, full: {} cases, both named {}, more than two {}",
            found.len(),
            percent(both, found.len()),
            percent(more, found.len())
        );
        for (truths, steps) in found.iter().filter(|(t, s)| !both_named(t, s)) {
            println!("  - {truths:?}: {steps:?}");
        }
        println!("  [{:.0} s]", began.elapsed().as_secs_f64());
    }
}
