//! For every controller, machine and program: plan → virtual machine → log in that control's own spelling → read back →
//! identified: what was planted, to the resolution of that log. What the decimals of a log cost is printed, and stated in
//! the guide (`docs/guide/controllers.md`).
//!
//! The program itself is read back and run by `check`, in tests of its own.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)] // a panic in a test is a failure with its place

mod common;
use axiscal::fit::outcome::Status;
use axiscal::log::{self, Touch, Writer};
use axiscal::machine::Machine;
use axiscal::post::{LogRecord, Postprocessor};
use axiscal::program::plan::Plan;
use axiscal::simulate::{self, Scenario};
use common::*;
use std::collections::BTreeMap;

/// Machine, its programs, the effects of its rotary axes.
const CASES: [(&str, &[&str], [&str; 2]); 8] = [
    ("swivel-head", &["head", "table"], ["location-b", "location-c"]),
    ("double-head", &["double-head"], ["location-b", "location-a"]),
    ("trunnion", &["basic"], ["location-a", "location-c"]),
    ("swivel-table-b", &["basic"], ["location-b", "location-c"]),
    ("swivel-head", &["full"], ["location-b", "location-c"]),
    ("double-head", &["full"], ["location-b", "location-a"]),
    ("trunnion", &["full"], ["location-a", "location-c"]),
    ("swivel-table-b", &["full"], ["location-b", "location-c"]),
];

/// Location errors of every sign (some 20 um, 0.004 deg), blocks that stand elsewhere, a late trigger.
fn wrong(machine: &Machine, effects: [&str; 2]) -> (Scenario, BTreeMap<String, f64>) {
    let catalogue = axiscal::model::catalogue::Catalogue::built_in().unwrap();
    let mut scenario = Scenario::flawless().with(machine, "pretravel", &[("pretravel", 0.004_321)]).unwrap();
    let mut truth = BTreeMap::new();
    let mut size = 1.0;
    for effect in effects {
        for p in &catalogue.get(effect, machine).unwrap().parameters {
            size *= -1.137;
            let planted = if p.unit == "mm" { 0.0213 * size } else { 0.00417 * size };
            scenario = scenario.with(machine, effect, &[(&p.name, planted)]).unwrap();
            truth.insert(p.name.clone(), planted);
        }
    }
    for mounting in &machine.mountings {
        for block in &mounting.blocks {
            scenario = scenario.with_block(&mounting.name, &block.name, [0.0713, -0.0457, 0.0319], [3e-4, -4e-4, 5e-4]);
        }
    }
    (scenario, truth)
}

/// The touches as they come back from the log of this control.
fn through_the_log(post: &Postprocessor, machine: &Machine, plan: &Plan, scenario: &Scenario) -> Vec<Touch> {
    let (raw, _) = simulate::run(machine, plan, scenario, None).unwrap();
    let record =
        |t: &log::RawTouch| LogRecord { id: t.id.unwrap(), status: t.status, position: t.position, time_s: t.time_s };
    let records: Vec<LogRecord> = raw.iter().map(record).collect();
    let text = post.log_text(machine, plan, &records);
    let (read, findings) = log::read(text.as_bytes(), "run.log", Writer::Controller(post), machine, plan)
        .unwrap_or_else(|e| panic!("{}: {:?}", post.name, e.0));
    assert!(findings.0.is_empty(), "{}: {:?}", post.name, findings.0);
    assert!(read.complete && read.touches.len() == plan.touches.len(), "{}: {}", post.name, plan.program);
    let half = 0.5001 * 10f64.powi(-i32::try_from(post.log.decimals).unwrap());
    for (touch, made) in read.touches.iter().zip(&raw) {
        assert!(touch.position.0.iter().zip(made.position.0).all(|(a, b)| (a - b).abs() <= half), "{touch:?} {made:?}");
        if post.log.time_word.is_some()
            && let (Some(read), Some(made)) = (touch.time_s, made.time_s)
        {
            assert!((read - made).abs() <= half, "{touch:?}");
        }
    }
    read.touches
}

/// Worst error of a parameter: offsets, um; tilts, deg.
fn worst(machine: &Machine, programs: &[&str], effects: [&str; 2], posts: &[Postprocessor]) -> Vec<[f64; 2]> {
    let (scenario, truth) = wrong(machine, effects);
    let plans: Vec<Plan> = programs.iter().map(|p| plan(machine, p)).collect();
    let each = |post: &Postprocessor| {
        let touches: Vec<_> = plans.iter().map(|p| through_the_log(post, machine, p, &scenario)).collect();
        let runs: Vec<_> = plans.iter().zip(&touches).map(|(p, t)| (p, &t[..])).collect();
        let fit = identify(machine, &runs, &[effects[0], effects[1], "block-setup", "pretravel"]);
        assert!(fit.outcome.converged, "{} {}", machine.name, post.name);
        let mut worst = [0.0f64; 2];
        let mut n_identified = 0;
        for p in fit.outcome.parameters.iter().filter(|p| p.status == Status::Identified) {
            let Some(planted) = truth.get(&p.name) else { continue };
            n_identified += 1;
            let (kind, scale) = if p.unit == "mm" { (0, 1e3) } else { (1, 1.0) };
            worst[kind] = worst[kind].max((p.value - planted).abs() * scale);
        }
        assert!(n_identified >= 4, "{} {}: {n_identified} identified", machine.name, post.name);
        worst
    };
    posts.iter().map(each).collect()
}

#[test]
fn every_controllers_log_gives_back_what_was_planted_to_its_resolution() {
    let posts = Postprocessor::built_in().unwrap();
    assert_eq!(
        posts
            .iter()
            .map(|p| p.name.as_str())
            .filter(|n| ["linuxcnc", "sinumerik", "fanuc", "heidenhain", "haas"].contains(n))
            .count(),
        5
    );
    let mut all = vec![[0.0f64; 2]; posts.len()];
    for (name, programs, effects) in CASES {
        let found = worst(&machine(name), programs, effects, &posts);
        for ((post, found), all) in posts.iter().zip(&found).zip(&mut all) {
            let digit = 10f64.powi(-i32::try_from(post.log.decimals).unwrap());
            println!("{name} {programs:?} {}: offsets {:.2e} um, tilts {:.2e} deg", post.name, found[0], found[1]);
            // one digit of the log for an offset; a tilt follows from places some ten millimetres apart
            assert!(found[0] <= digit * 1e3 && found[1] <= 5.0 * digit, "{name} {}: {found:?}", post.name);
            all.iter_mut().zip(found).for_each(|(a, f)| *a = a.max(*f));
        }
    }
    for (post, all) in posts.iter().zip(&all) {
        println!(
            "{}: {} decimals, offsets to {:.2e} um, tilts to {:.2e} deg",
            post.name, post.log.decimals, all[0], all[1]
        );
    }
}
