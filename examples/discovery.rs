//! Hidden effects at full count: `cargo run --release --example discovery [-- PART COUNT]`. The table stands in
//! docs/discovery.md. Parts, all of them without an argument: planted by the generator of tests/discovery on all machines: faults
//! (faults-paper, faults-full, faults-weak, faults-two), faultless (faultless-paper, faultless-full; with one scatter in µm:
//! faultless-paper-0.3), mistakes; on one sphere: faults-sphere, faultless-sphere. What is in no catalogue: strange; one kind: strange-0 to -5.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)] // a measurement that cannot be made shall stop
#![allow(missing_docs)]

#[path = "../tests/common/mod.rs"]
mod common;
#[path = "../tests/discovery/mod.rs"]
mod generator;

use axiscal::diagnose::Verdict;
use generator::bench::Bench as Machines;
use generator::judge::{self, Conditions};
use generator::mistakes::MISTAKES;
use generator::peers::{self, Cases};
use generator::strange::{self, Seen};

fn percent(part: usize, of: usize) -> String {
    format!("{:5.1} %", 100.0 * part as f64 / of.max(1) as f64)
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
            "  - {:?} noncentrality {:.0} first {:?} then {:?}, proposed {:?}, {} rejected",
            s.verdict, s.noncentrality, s.first, s.depends, s.proposed, s.rejected
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
    println!("  held-out error falls    {}", of(&|o| o.held_out_falls));
    let mean = |what: &dyn Fn(&judge::Outcome) -> f64| outcomes.iter().map(what).sum::<f64>() / outcomes.len() as f64;
    println!("  names in the first group {:.1}", mean(&|o| o.groups.first().map_or(0, Vec::len) as f64));
    println!("  reduced RMS {:.2} -> {:.3}", mean(&|o| o.reduced.0), mean(&|o| o.reduced.1));
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
    of_the_generator(part, &count);
    for (kind, (name, _, _)) in strange::KINDS.iter().enumerate() {
        if part == "all" || part == "strange" || part == format!("strange-{kind}") {
            report_strange(name, &strange::run(kind, count(100) as u64, 100 * kind as u64 + 8));
        }
    }
}
