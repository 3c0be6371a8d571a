//! `compare`, `add`, `remove`, `history` and `verify` from outside, and the held-out error against real refits.

use crate::common;
use assert_cmd::Command;
use axiscal::compare::compare;
use axiscal::fit::{Mask, Settings, held_out};
use axiscal::simulate::Scenario;
use common::*;
use predicates::prelude::*;
use std::path::Path;

fn axiscal(folder: &Path) -> Command {
    let mut command = Command::cargo_bin("axiscal").unwrap();
    command.current_dir(folder).env("NO_COLOR", "1").env_remove("COLUMNS");
    command
}

const EFFECTS: [&str; 4] = ["location-b", "location-c", "block-setup", "pretravel"];

fn scenario(text: &str, machine: &axiscal::machine::Machine) -> Scenario {
    axiscal::simulate::scenario::parse(&axiscal::diag::source("s.toml", text), machine).unwrap().0
}

/// A folder with both programs of the paper's machine touched under a scenario, and the study.
fn folder(scenario: &str) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("s.toml"), scenario).unwrap();
    let mut new = vec!["new", "--machine", "swivel-head", "--controller", "linuxcnc", "--out", "study.toml"];
    for (program, plan, log) in [("head", "head.plan.json", "head.log"), ("table", "table.plan.json", "table.log")] {
        let common = ["--machine", "swivel-head", "--controller", "linuxcnc", "--out"];
        axiscal(folder.path()).args(["generate", "--program", program]).args(common).arg(".").assert().success();
        axiscal(folder.path())
            .args(["simulate", "--plan", plan, "--scenario", "s.toml"])
            .args(common)
            .arg(log)
            .assert()
            .success();
        new.extend(["--plan", plan, "--log", log]);
    }
    axiscal(folder.path()).args(new).assert().success();
    folder
}

/// A once-per-turn error motion of C that the table's blocks show, hidden from the study's model.
const HIDDEN: &str = "seed = 4\n[effects.location-c]\nEX0C = 0.012\n[effects.radial-c-2]\nEXC2c = 6.0\nEYC2s = -5.0\n[noise]\ntouch_um = 0.5\n";

fn json(folder: &Path, arguments: &[&str]) -> serde_json::Value {
    let run = axiscal(folder).args(arguments).arg("--json").output().unwrap();
    serde_json::from_slice(&run.stdout)
        .unwrap_or_else(|e| panic!("{arguments:?}: {e}: {}", String::from_utf8_lossy(&run.stderr)))
}

#[test]
fn the_held_out_error_is_that_of_real_refits() {
    let machine = machine("swivel-head");
    let (head, table) = (plan(&machine, "head"), plan(&machine, "table"));
    let wrong = scenario(HIDDEN, &machine);
    let (a, b) = (touch(&machine, &head, &wrong, None), touch(&machine, &table, &wrong, None));
    let runs = [(&head, &a[..]), (&table, &b[..])];
    let stated =
        || Settings { touch_sigma_mm: Some(5e-4), visit_sigma_mm: Some(0.0), quick: true, ..Settings::default() };
    let all = identify_with(&machine, &runs, &EFFECTS, stated());
    let held = held_out::by_visit(&all).unwrap();
    let mut compared = 0;
    for visit in [1, 3, 6] {
        let left_out: Vec<usize> = (0..all.data.visits.len()).filter(|&i| all.data.visits[i] == visit).collect();
        let masked = left_out
            .iter()
            .map(|&i| Mask {
                run: all.data.observations[i].run,
                id: all.data.observations[i].id,
                reason: "held out".into(),
            })
            .collect();
        let rest = identify_with(&machine, &runs, &EFFECTS, Settings { masked, ..stated() });
        for i in left_out {
            if let (Some(error), true) = (held.error_mm[i], rest.rejected.len() - all.rejected.len() > 0) {
                assert!((error - rest.residual_mm[i]).abs() < 2e-5, "touch {i}: {error} or {}", rest.residual_mm[i]);
                compared += 1;
            }
        }
    }
    println!("{compared} touches compared, {} predicted, {:.3} um", held.scored, held.rms_um);
    assert!(compared > 20, "{compared}");
    assert!(held.rms_um > all.outcome.rms_um);
    // nothing but the last run knows the errors of C
    assert!(held_out::later_run(&all).is_none());
    // the table again, its blocks set up anew, with other noise: only what the model lacks is badly predicted
    let again = touch(&machine, &table, &scenario(&HIDDEN.replace("seed = 4", "seed = 5"), &machine), None);
    let three = identify_with(&machine, &[(&head, &a), (&table, &b), (&table, &again)], &EFFECTS, stated());
    let missing = held_out::later_run(&three).unwrap();
    let with = [&EFFECTS[..], &["radial-c-2"]].concat();
    let three = identify_with(&machine, &[(&head, &a), (&table, &b), (&table, &again)], &with, stated());
    let known = held_out::later_run(&three).unwrap();
    println!(
        "later run: {:.3} um, with the effect {:.3} um over {} touches",
        missing.rms_um, known.rms_um, known.scored
    );
    assert!(known.scored == table.touches.len() && known.rms_um < 0.7 && missing.rms_um > 1.5 * known.rms_um);
}

#[test]
fn pure_noise_goes_with_nothing() {
    let machine = machine("swivel-head");
    let (head, table) = (plan(&machine, "head"), plan(&machine, "table"));
    let (mut high, mut n) = (0, 0);
    for seed in 0..12 {
        let text = format!("seed = {seed}\n[noise]\ntouch_um = 1.0\n");
        let wrong = scenario(&text, &machine);
        let (a, b) = (touch(&machine, &head, &wrong, None), touch(&machine, &table, &wrong, None));
        let stated = Settings { touch_sigma_mm: Some(1e-3), quick: true, ..Settings::default() };
        let c = compare(&identify_with(&machine, &[(&head, &a), (&table, &b)], &EFFECTS, stated));
        assert!(c.explained_by_noise, "{}", c.says);
        high += c.splits.iter().filter(|s| s.share > 0.25).count();
        n += c.splits.len();
    }
    println!("{high} of {n} shares above 25 %");
    assert!(n > 100 && high * 20 <= n, "{high} of {n}");
}

#[test]
fn a_hidden_effect_is_compared_added_taken_out_and_kept_in_the_ladder() {
    let folder = folder(HIDDEN);
    let at = folder.path();
    let comparison = json(at, &["compare", "study.toml", "--csv", "points.csv"]);
    assert_eq!(comparison["format"], "axiscal-comparison/1");
    assert_eq!(comparison["explained_by_noise"], false, "{}", comparison["says"]);
    assert_eq!(comparison["splits"][0]["by"], "pose.C", "{}", comparison["says"]);
    assert!(comparison["splits"][0]["share"].as_f64().unwrap() > 0.7, "{}", comparison["splits"][0]["share"]);
    assert!(comparison["says"].as_str().unwrap().contains("changes with C"), "{}", comparison["says"]);
    assert_eq!(comparison["points"].as_array().unwrap().len(), 356);
    assert!(comparison["worst"][0]["line"].as_u64().unwrap() > 1);
    let csv = std::fs::read_to_string(at.join("points.csv")).unwrap();
    assert_eq!(csv.lines().count(), 357);
    assert!(csv.lines().all(|l| l.split(',').count() == csv.lines().next().unwrap().split(',').count()));
    for columns in ["80", "160"] {
        let run = axiscal(at).args(["compare", "study.toml", "--all"]).env("COLUMNS", columns).assert().success();
        let text = String::from_utf8(run.get_output().stdout.clone()).unwrap();
        let most: usize = columns.parse().unwrap();
        // sentences may be longer than a line: tables and plots may not
        let lines =
            text.lines().filter(|l| !l.starts_with("the residual is") && !l.starts_with("cannot be determined"));
        assert!(lines.clone().all(|l| l.chars().count() <= most.max(110)), "{text}");
        assert!(!text.contains('\u{1b}') && text.contains("residual, um, against C, deg"), "{text}");
    }

    // a list over several lines, with remarks
    let text = std::fs::read_to_string(at.join("study.toml")).unwrap();
    let lines = text
        .replace("effects = [\"", "effects = [\n  \"")
        .replace("\", \"", "\", # kept\n  \"")
        .replace("\"pretravel\"]", "\"pretravel\" # last\n]");
    assert!(lines.contains("# last"), "{lines}");
    std::fs::write(at.join("study.toml"), &lines).unwrap();
    let study = || std::fs::read_to_string(at.join("study.toml")).unwrap();

    let dry = json(at, &["add", "study.toml", "radial-c-2", "--dry-run"]);
    assert!(dry["after"]["rms_um"].as_f64().unwrap() < dry["before"]["rms_um"].as_f64().unwrap());
    assert_eq!(study(), lines);
    assert!(!at.join("study.history.json").exists());

    let run = axiscal(at).args(["add", "study.toml", "radial-c-2"]).assert().success();
    run.stdout(
        predicate::str::contains("residual, µm RMS")
            .and(predicate::str::contains("EXC2c"))
            // the fall has its doubt, and a choice by hand is no nested one
            .and(predicate::str::contains("you chose the effect with all touches known"))
            .and(predicate::str::contains("one standard error")),
    );
    assert!(study().contains("  \"radial-c-2\"\n]"), "{}", study());
    let h = json(at, &["history", "study.toml"]);
    let steps = h["steps"].as_array().unwrap();
    assert_eq!(steps.len(), 2);
    assert_eq!(steps[1]["added"][0], "radial-c-2");
    for figure in ["rms_um", "held_out_rms_um", "chi2_per_dof"] {
        let at = |i: usize| steps[i][figure].as_f64().unwrap();
        println!("{figure}: {} to {}", at(0), at(1));
        assert!(at(1) < 0.8 * at(0), "{figure}");
    }
    let fall_of = |i: usize| steps[i]["held_out_se_um"].as_f64().unwrap();
    assert!(fall_of(0) > 0.0 && fall_of(1) > 0.0 && steps[1]["nested_rms_um"].is_null(), "{}", steps[1]);
    let fall = axiscal(at).args(["history", "study.toml"]).assert().success();
    fall.stdout(predicate::str::contains("+radial-c-2").and(predicate::str::contains("cross-validated")));

    axiscal(at).args(["remove", "study.toml", "radial-c-2"]).assert().success();
    assert_eq!(study(), lines, "the very same bytes");
    assert_eq!(json(at, &["history", "study.toml"])["steps"].as_array().unwrap().len(), 3);

    // the log is not that of the ladder any more
    let log = std::fs::read_to_string(at.join("head.log")).unwrap();
    std::fs::write(at.join("head.log"), log.replace('\n', "\r\n")).unwrap();
    axiscal(at)
        .args(["history", "study.toml"])
        .assert()
        .success()
        .stderr(predicate::str::contains("the plans or logs have changed since step 1, 2, 3"));
}

#[test]
fn what_cannot_be_added_is_said_and_nothing_is_written() {
    let folder = folder("seed = 1\n[noise]\ntouch_um = 1.0\n");
    let at = folder.path();
    let text = std::fs::read(at.join("study.toml")).unwrap();
    let tries: [(&[&str], &str); 9] = [
        (&["add", "none.toml", "scale-x"], "cannot read none.toml"),
        (&["add", "study.toml", "radial-c1"], "did you mean radial-c-1"),
        (&["add", "study.toml", "pretravel"], "in the model already"),
        (&["add", "study.toml", "location-a"], "does not apply"),
        (&["remove", "study.toml", "scale-x"], "is not in the model"),
        (&["remove", "study.toml", "location-b", "location-c", "block-setup", "pretravel"], "only effect"),
        (&["compare", "none.toml"], "cannot read none.toml"),
        (&["history", "none.toml"], "cannot read none.toml"),
        (&["verify", "study.toml", "study.toml"], "both studies hold the same logs"),
    ];
    for (arguments, message) in tries {
        axiscal(at).args(arguments).assert().code(2).stderr(predicate::str::contains(message));
        assert_eq!(std::fs::read(at.join("study.toml")).unwrap(), text);
    }
    std::fs::write(at.join("study.history.json"), "{ \"format\": 3").unwrap();
    axiscal(at)
        .args(["history", "study.toml"])
        .assert()
        .code(2)
        .stderr(predicate::str::contains("study.history.json:1:"));
    axiscal(at).args(["add", "study.toml", "scale-x"]).assert().code(2).stderr(predicate::str::contains("delete it"));
    assert_eq!(std::fs::read(at.join("study.toml")).unwrap(), text);
    std::fs::write(at.join("bare.toml"), "machine = \"swivel-head\"\n").unwrap();
    axiscal(at).args(["compare", "bare.toml"]).assert().code(2).stderr(predicate::str::contains("no measurement"));
}

#[test]
fn a_compensation_is_verified_and_a_month_is_compared() {
    let folder = folder("seed = 2\n[effects.location-c]\nEX0C = 0.02\nEY0C = -0.03\n[noise]\ntouch_um = 1.0\n");
    let at = folder.path();
    let table = |log: &str, scenario: &str, seed: u32, more: &[&str]| {
        let text = std::fs::read_to_string(at.join("s.toml")).unwrap().replace("seed = 2", &format!("seed = {seed}"));
        std::fs::write(at.join(scenario), text).unwrap();
        axiscal(at)
            .args(["simulate", "--plan", "table.plan.json", "--machine", "swivel-head", "--controller", "linuxcnc"])
            .args(["--scenario", scenario, "--out", log])
            .args(more)
            .assert()
            .success();
        let study = format!("{log}.toml");
        let mut new = vec!["new", "--machine", "swivel-head", "--controller", "linuxcnc", "--plan", "table.plan.json"];
        new.extend(["--log", log, "--effects", "location-c,block-setup,pretravel", "--out", &study]);
        new.extend(more);
        axiscal(at).args(new).assert().success();
    };
    table("before.log", "b.toml", 11, &[]);
    table("month.log", "m.toml", 12, &[]);
    axiscal(at).args(["export", "before.log.toml", "--controller", "linuxcnc", "--out", "comp"]).assert().success();
    table("after.log", "a.toml", 13, &["--compensation", "comp"]);
    let v = json(at, &["verify", "before.log.toml", "after.log.toml"]);
    println!("{}", v["says"]);
    assert_eq!(v["format"], "axiscal-verification/1");
    assert_eq!(v["verdict"], "improved", "{}", v["says"]);
    assert!(v["parameters"].as_array().unwrap().iter().any(|p| p["name"] == "EY0C" && p["changed"] == true));
    axiscal(at).args(["verify", "after.log.toml", "before.log.toml"]).assert().code(1);
    let m = json(at, &["verify", "before.log.toml", "month.log.toml"]);
    assert_eq!(m["question"], "change");
    println!("{}", m["says"]);
    axiscal(at).args(["verify", "before.log.toml", "month.log.toml"]).assert().success();

    // the same run under what acts with the transformation on only cannot show it
    let file = at.join("comp/compensation.json");
    let stock = std::fs::read_to_string(&file).unwrap().replace("\"mode\": \"component\"", "\"mode\": \"stock\"");
    std::fs::create_dir(at.join("stock")).unwrap();
    std::fs::write(at.join("stock/compensation.json"), stock).unwrap();
    let study = std::fs::read_to_string(at.join("after.log.toml"))
        .unwrap()
        .replace("compensation = \"comp\"", "compensation = \"stock\"");
    std::fs::write(at.join("off.toml"), study).unwrap();
    axiscal(at)
        .args(["verify", "before.log.toml", "off.toml"])
        .assert()
        .code(2)
        .stderr(predicate::str::contains("cannot show the compensation"));
}

#[test]
fn a_time_constant_is_found_although_it_leaves_no_trace_at_size_zero() {
    let machine = machine("swivel-head");
    let plan = plan(&machine, "full");
    let text = "seed = 3\n[effects.warm-up]\nwx = 12.0\nwy = -9.0\nwz = 15.0\ntau = 0.3\n[noise]\ntouch_um = 0.5\n";
    let wrong = scenario(text, &machine);
    let touches = touch(&machine, &plan, &wrong, None);
    let mut effects = EFFECTS.to_vec();
    effects.push("warm-up");
    let fit = identify_with(&machine, &[(&plan, &touches)], &effects, Settings { quick: true, ..Settings::default() });
    println!("tau {} h, left {} um, {:?}", value(&fit, "tau"), fit.outcome.rms_um, fit.outcome.warnings);
    assert!((value(&fit, "tau") - 0.3).abs() < 0.1, "{}", value(&fit, "tau"));
    assert!(fit.outcome.rms_um < 0.6);
}

#[test]
fn a_harmonic_of_the_table_is_named_by_its_order() {
    let machine = machine("swivel-head");
    let plan = plan(&machine, "full");
    let touches = touch(&machine, &plan, &scenario(HIDDEN, &machine), None);
    let c = compare(&identify(&machine, &[(&plan, &touches)], &EFFECTS));
    println!("{}", c.says);
    assert_eq!(
        c.splits[0].by,
        "pose.C",
        "{:?}",
        c.splits.iter().map(|s| (&s.by, s.share, s.evidence)).collect::<Vec<_>>()
    );
    assert!(c.says.contains("depends on C, twice per turn"), "{}", c.says);
    assert!(c.splits[0].share > 0.8);
}

/// A scan in steps of three minutes put it up to three minutes off, with some touches on the wrong side.
#[test]
fn a_slip_is_found_between_the_two_touches_where_it_came() {
    let machine = machine("swivel-head");
    let plan = plan(&machine, "full");
    for from_h in [0.6137, 1.0491] {
        let text = format!(
            "seed = 7\n[effects.block-slip]\ndx = 8.0\ndy = -6.0\ndz = 7.0\nfrom_h = {from_h}\n[noise]\ntouch_um = 0.5\n"
        );
        let wrong = scenario(&text, &machine);
        let touches = touch(&machine, &plan, &wrong, None);
        let effects = [&EFFECTS[..], &["block-slip"]].concat();
        let settings = Settings { quick: true, ..Settings::default() };
        let fit = identify_with(&machine, &[(&plan, &touches)], &effects, settings);
        let found = value(&fit, "from_h");
        let (low, high) = (found.min(from_h), found.max(from_h));
        let first = touches[0].time_s.unwrap();
        let hours = touches.iter().map(|t| (t.time_s.unwrap() - first) / 3600.0);
        let wrong_side = hours.filter(|h| (low..high).contains(h)).count();
        println!("slip at {from_h} h, found at {found} h, {wrong_side} touches on the wrong side");
        assert!(wrong_side <= 1, "{found} h instead of {from_h} h: {wrong_side} touches");
    }
}
