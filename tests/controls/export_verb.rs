//! `axiscal export` from outside: units, refusals, and what stands in the files.

use crate::common;
use assert_cmd::Command;
use common::*;
use predicates::prelude::*;
use serde_json::Value;
use std::collections::BTreeMap;
use std::path::Path;

pub(super) fn axiscal(at: &Path) -> Command {
    let mut command = Command::cargo_bin("axiscal").unwrap();
    command.current_dir(at).env("NO_COLOR", "1").env_remove("COLUMNS");
    command
}

/// A folder with a program measured under a scenario, and its study with these effects.
pub(super) fn folder(
    machine_name: &str,
    program: &str,
    controller: &str,
    scenario: &str,
    effects: &str,
) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    std::fs::write(at.join("plan.json"), plan(&machine(machine_name), program).to_json()).unwrap();
    std::fs::write(at.join("wrong.toml"), scenario).unwrap();
    let common = ["--machine", machine_name, "--controller", controller, "--plan", "plan.json"];
    axiscal(at).arg("simulate").args(common).args(["--scenario", "wrong.toml", "--out", "run.log"]).assert().success();
    axiscal(at)
        .arg("new")
        .args(common)
        .args(["--log", "run.log", "--effects", effects, "--out", "study.toml"])
        .assert()
        .success();
    folder
}

/// Location errors of a trunnion, measured with noise.
const WRONG: &str = "seed = 3\n[effects.location-a]\nEY0A = 0.021\n[effects.location-c]\nEX0C = 0.013\nEB0C = 0.006\n[noise]\ntouch_um = 0.5\n";
pub(super) const EFFECTS: &str = "location-a,location-c,block-setup,pretravel";

pub(super) fn trunnion(controller: &str) -> tempfile::TempDir {
    folder("trunnion", "basic", controller, WRONG, EFFECTS)
}

/// `export` of the folder's study for a control.
pub(super) fn export(at: &Path, controller: &str, out: &str, more: &[&str]) -> Command {
    let mut command = axiscal(at);
    command.args(["export", "study.toml", "--controller", controller, "--out", out]).args(more);
    command
}

pub(super) fn json(mut command: Command) -> Value {
    let run = command.arg("--json").assert().success();
    serde_json::from_slice(&run.get_output().stdout).unwrap()
}

pub(super) fn text(at: &Path, name: &str) -> String {
    std::fs::read_to_string(at.join(name)).unwrap()
}

pub(super) fn backup(name: &str) -> String {
    text(Path::new(env!("CARGO_MANIFEST_DIR")), &format!("tests/tables/backups/{name}"))
}

/// `N19700Q1M0.1;`, `N19700Q1L1M0.1 `: unit letter and number.
fn fanuc(text: &str) -> BTreeMap<String, (char, f64)> {
    let value = |line: &str| {
        let (name, value) = line.trim().trim_end_matches(';').split_once("Q1")?;
        let value = value.strip_prefix("L1").unwrap_or(value);
        Some((name.to_owned(), (value.chars().next()?, value[1..].parse().ok()?)))
    };
    text.lines().filter_map(value).collect()
}

#[test]
fn what_nobody_has_verified_is_written_only_when_it_is_accepted() {
    let folder = trunnion("fanuc");
    let at = folder.path();
    for control in ["fanuc", "heidenhain", "haas"] {
        let refused = export(at, control, "comp", &[]).assert().code(2);
        refused.stderr(predicate::str::contains("not verified").and(predicate::str::contains("--accept-unverified")));
        assert!(!at.join("comp").exists(), "{control}");
        export(at, control, control, &["--accept-unverified"])
            .assert()
            .success()
            .stderr(predicate::str::contains("not verified"));
        assert!(text(at, &format!("{control}/README.txt")).contains("NOT VERIFIED on a real control"), "{control}");
    }
    // what every entry of has its page for needs nothing: SINUMERIK's kinds P and T
    export(at, "sinumerik", "sinumerik", &[]).assert().success();
    let folder = self::folder(
        "double-head",
        "double-head",
        "sinumerik",
        "seed = 1\n[effects.location-a]\nEY0A = 0.02\n[noise]\ntouch_um = 0.5\n",
        "location-b,location-a,block-setup,pretravel",
    );
    export(folder.path(), "sinumerik", "comp", &[]).assert().success();
}

#[test]
fn the_unit_of_the_table_is_the_user_s() {
    let folder = trunnion("fanuc");
    let at = folder.path();
    std::fs::write(at.join("backup.txt"), backup("fanuc.txt")).unwrap();
    let more = ["--accept-unverified", "--backup", "backup.txt"];
    export(at, "fanuc", "mm", &more).assert().success();
    export(at, "fanuc", "inch", &[&more[..], &["--unit", "inch"]].concat()).assert().success();
    let (old, mm, inch) = (
        fanuc(&backup("fanuc.txt")),
        fanuc(&text(at, "mm/axiscal_parameters.txt")),
        fanuc(&text(at, "inch/axiscal_parameters.txt")),
    );
    assert_eq!(mm.keys().collect::<Vec<_>>(), inch.keys().collect::<Vec<_>>());
    assert_eq!(mm.len(), 6);
    for (name, (letter, value)) in &mm {
        let (other, inches) = inch[name];
        assert_eq!((*letter, other), ('M', 'I'), "{name}");
        // half a step of each table: 0.5 um, 0.00005 in
        assert!((value - inches * 25.4).abs() < 0.5e-3 + 0.5e-4 * 25.4 + 1e-9, "{name}: {value} mm, {inches} in");
    }
    assert!((mm["N19701"].1 - 0.021).abs() < 0.0015, "{mm:?}");
    // to go back: the old values as they were, whatever the unit of the new ones
    for folder in ["mm", "inch"] {
        let back = fanuc(&text(at, &format!("{folder}/restore_parameters.txt")));
        assert!(back.len() == mm.len() && back.iter().all(|(name, value)| old[name] == *value), "{folder}: {back:?}");
    }
    assert!(text(at, "inch/axiscal_g10.nc").contains("G20") && text(at, "mm/axiscal_g10.nc").contains("G21"));
    export(at, "fanuc", "x", &["--unit", "furlong"]).assert().code(2);
}

/// A model that does not fit is no compensation where what is missing makes a value wrong by more than its tolerance.
#[test]
fn a_bad_verdict_refuses_what_would_be_wrong_by_more_than_its_tolerance() {
    let missing = "seed = 4\n[effects.radial-c-2]\nEXC2c = 9.0\nEYC2s = -8.0\n[noise]\ntouch_um = 0.5\n";
    // seven teeth of the turntable's ring: nothing in the catalogue has seven periods
    let teeth = "seed = 6\n[[harmonic]]\naxis = \"C\"\ndof = \"rz\"\nk = 7\ncos_urad = 160.0\nsin_urad = -90.0\n[noise]\ntouch_um = 1.0\n";
    for (scenario, verdict) in [(missing, "missing-effect"), (teeth, "unexplained")] {
        let folder = folder("swivel-head", "full", "linuxcnc", scenario, "location-b,location-c,block-setup,pretravel");
        let at = folder.path();
        let study = text(at, "study.toml");
        // the amount is in the answer; within the tolerance it is a remark
        std::fs::write(at.join("study.toml"), format!("{study}\n[tolerance]\nerror_um = 1000\n")).unwrap();
        let answer = json(export(at, "linuxcnc", "wide", &[]));
        let worst = &answer["could_be_wrong"][0];
        let (off, tolerance) = (worst["off"].as_f64().unwrap(), worst["tolerance"].as_f64().unwrap());
        assert!(off > 0.0 && off < tolerance && !worst["because"].as_str().unwrap().is_empty(), "{answer}");
        let um = worst["off_um"].as_f64().unwrap();
        std::fs::write(at.join("study.toml"), format!("{study}\n[tolerance]\nerror_um = {}\n", um / 2.0)).unwrap();
        for control in ["linuxcnc", "sinumerik"] {
            let says = format!("the diagnosis is {verdict}");
            let refused = export(at, control, "comp", &["--accept-unverified"]).assert().code(2);
            refused.stderr(predicate::str::contains(says.as_str()).and(predicate::str::contains("--force")));
            assert!(!at.join("comp").exists(), "{control}");
        }
        export(at, "linuxcnc", "comp", &["--force"])
            .assert()
            .success()
            .stderr(predicate::str::contains(format!("the diagnosis is {verdict}")));
        // whoever loads them did not see the screen
        for name in ["comp/README.txt", "comp/compensation.json"] {
            assert!(text(at, name).contains(&format!("the diagnosis is {verdict}")), "{name}");
        }
        assert!(text(at, "comp/axiscal.hal").contains("FORCED, 1 finding spoke against it"));
    }
}

/// A pattern as large as the noise, and planted values that are found: the consequence is a fraction of a micrometre, so that it is
/// a remark. What is said to be the most is at least what is really wrong.
#[test]
fn a_weak_pattern_is_a_remark() {
    let scenario =
        WRONG.replace("seed = 3", "seed = 5").replace("[noise]", "[effects.radial-c-2]\nEXC2c = 0.5\n[noise]");
    let folder = folder("trunnion", "full", "linuxcnc", &scenario, EFFECTS);
    let at = folder.path();
    let run = axiscal(at).args(["diagnose", "study.toml", "--json"]).output().unwrap();
    let found: Value = serde_json::from_slice(&run.stdout).unwrap();
    assert_ne!(found["verdict"], "adequate", "{found}");
    let ratio = found["rms_um"].as_f64().unwrap() / found["noise_um"].as_f64().unwrap();
    assert!(ratio < 1.2, "{ratio}");
    let answer = json(export(at, "linuxcnc", "comp", &[]));
    let doubts = answer["could_be_wrong"].as_array().unwrap();
    assert!(!doubts.is_empty() && doubts.iter().all(|d| d["off_um"].as_f64().unwrap() < 1.0), "{doubts:?}");
    let planted = BTreeMap::from([("EY0A", 0.021), ("EX0C", 0.013), ("EB0C", 0.006)]);
    for term in answer["terms"].as_array().unwrap() {
        let name = term["parameter"].as_str().unwrap();
        let off = (term["identified"].as_f64().unwrap() - planted.get(name).copied().unwrap_or(0.0)).abs();
        let sigma = term["sigma"].as_f64().unwrap();
        let said = doubts.iter().find(|d| d["parameter"] == name).map_or(0.0, |d| d["off"].as_f64().unwrap());
        assert!(off <= said + 4.0 * sigma, "{name}: {off} off, said {said}, sigma {sigma}");
    }
}

/// The command that report and workbench suggest runs as it stands, whatever the control.
#[test]
fn the_suggested_command_runs_as_it_stands() {
    let controls = [("sinumerik", false), ("fanuc", true), ("heidenhain", true), ("haas", true), ("linuxcnc", false)];
    for (control, accepts) in controls {
        let folder = trunnion(control);
        let at = folder.path();
        axiscal(at).args(["report", "study.toml", "--out", "r.html", "--view", "v.json"]).assert().success();
        let view: Value = serde_json::from_str(&text(at, "v.json")).unwrap();
        let next = view["next"].as_array().unwrap();
        let suggested = next.iter().find(|n| n["command"].as_str().unwrap().starts_with("axiscal export")).unwrap();
        let words: Vec<&str> = suggested["command"].as_str().unwrap().split_whitespace().skip(1).collect();
        assert_eq!(words.contains(&"--accept-unverified"), accepts, "{control}: {words:?}");
        // and a sentence says what that accepts
        assert_eq!(suggested["how"].as_str().unwrap().contains("--accept-unverified"), accepts, "{suggested}");
        axiscal(at).args(&words).assert().success();
        assert!(at.join("compensation/compensation.json").exists(), "{control}");
    }
}

#[test]
fn values_beyond_the_limit_are_refused() {
    let large = "seed = 1\n[effects.location-c]\nEX0C = 0.62\n[noise]\ntouch_um = 0.5\n";
    let folder = folder("trunnion", "basic", "fanuc", large, EFFECTS);
    let at = folder.path();
    export(at, "fanuc", "comp", &["--accept-unverified"])
        .assert()
        .code(2)
        .stderr(predicate::str::contains("above the limit of 0.5 mm").and(predicate::str::contains("--force")));
    assert!(!at.join("comp").exists());
    export(at, "fanuc", "comp", &["--accept-unverified", "--force"])
        .assert()
        .success()
        .stderr(predicate::str::contains("above the limit of 0.5 mm"));
    let record: Value = serde_json::from_str(&text(at, "comp/compensation.json")).unwrap();
    assert!((record["tables"]["changes"]["N19703"].as_f64().unwrap() - 0.62).abs() < 0.002);
}

/// The program `head` does not touch what C carries: nothing of C is known, and nothing of it is written.
#[test]
fn only_what_was_identified_is_written() {
    let scenario =
        "seed = 2\n[effects.location-b]\nEX0B = 0.03\n[effects.location-c]\nEX0C = 0.05\n[noise]\ntouch_um = 0.5\n";
    let folder = folder("swivel-head", "head", "sinumerik", scenario, "location-b,location-c,block-setup,pretravel");
    let at = folder.path();
    let answer = json(export(at, "sinumerik", "comp", &["--accept-unverified"]));
    let terms: Vec<&str> =
        answer["terms"].as_array().unwrap().iter().map(|t| t["parameter"].as_str().unwrap()).collect();
    assert!(terms.contains(&"EX0B") && !terms.iter().any(|t| t.ends_with("0C")), "{terms:?}");
    let readme = text(at, "comp/README.txt");
    for name in ["EX0C", "EY0C", "EA0C", "EB0C"] {
        assert!(
            readme.contains(&format!("Not exported: {name} (location-c): these touches cannot determine it")),
            "{readme}"
        );
    }
    // the table axis stays where the description has it, but for the shift that the head's own offset makes in X
    let record: Value = serde_json::from_str(&text(at, "comp/compensation.json")).unwrap();
    let change = |name: &str| record["tables"]["changes"][name].as_f64().unwrap_or(0.0);
    assert!(change("$MC_TRAFO5_JOINT_OFFSET_PART_1[1]").abs() < 1e-3, "{record}");
    assert_eq!(change("$MC_TRAFO5_AXIS2_1[2]"), 0.0);
}
