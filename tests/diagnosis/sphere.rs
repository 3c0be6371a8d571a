//! One calibration sphere: what its touches can be taken for.

use crate::common::verbs::{json, ok};
use std::path::Path;

const PROGRAM: &str = "format = \"axiscal-programs/1\"
name = \"four\"
machine = \"trunnion\"
says = \"the pole and four touches on the equator\"
mounting = \"sphere\"
repeats = 2

[[ring]]
name = \"pole\"
directions_in = \"tool\"
azimuth_deg = [0]
elevation_deg = [90]

[[ring]]
name = \"equator\"
directions_in = \"tool\"
azimuth_deg = [AZIMUTHS]
elevation_deg = [12]

[[stage]]
name = \"all\"

[[stage.setup]]
pose = { A = [-60.0, -25.0, 0.0, 40.0, 70.0], C = [0.0, 50.0, 110.0, 190.0, 250.0, 300.0] }
touch = [{ ring = \"pole\" }, { ring = \"equator\" }]
";

/// The study of a program on a probe with three lobes.
fn lobed(at: &Path, azimuths: &str) {
    lobed_on(at, &PROGRAM.replace("AZIMUTHS", azimuths));
}

fn lobed_on(at: &Path, program: &str) {
    std::fs::write(at.join("four.toml"), program).unwrap();
    let wrong = "seed = 3\n[effects.location-a]\nEY0A = 0.02\n[effects.lobing-3]\nlobing3c = 3.0\n[noise]\ntouch_um = 0.5\nvisit_um = 0.3\n";
    std::fs::write(at.join("wrong.toml"), wrong).unwrap();
    let machine = ["--machine", "trunnion", "--controller", "linuxcnc"];
    ok(at, &[&["generate", "--program", "four.toml", "--artefact", "sphere", "--out", "."][..], &machine].concat());
    let plan = ["--machines", "machines.toml", "--plan", "four.plan.json"];
    ok(at, &[&["simulate", "--scenario", "wrong.toml", "--out", "four.log"][..], &machine, &plan].concat());
    ok(at, &[&["new", "--log", "four.log", "--out", "study.toml"][..], &machine, &plan].concat());
}

/// Four touches take the three lobes for a place of the ball in the spindle: it is no error of the machine, and none is proposed.
#[test]
fn a_lobed_probe_is_not_called_an_error_of_the_machine() {
    for azimuths in ["0, 90, 180, 270", "0, 72, 144, 216, 288"] {
        let folder = tempfile::tempdir().unwrap();
        lobed(folder.path(), azimuths);
        let (said, _) = json(folder.path(), &["diagnose", "study.toml"]);
        let proposed: Vec<&serde_json::Value> =
            said["candidates"].as_array().unwrap().iter().filter(|c| c["proposed"] == true).collect();
        for c in &proposed {
            let group = format!("{} {}", c["effect"], c["same_as"]);
            assert!(group.contains("lobing-3"), "{azimuths}: {group}");
        }
        // five touches see the lobes, and say so
        assert_eq!(proposed.is_empty(), azimuths.starts_with("0, 90"), "{azimuths}: {}", said["says"]);
    }
}

/// What is left of a touch is the sum of two radii: the diagnosis does not name one of the two, and `sphere-diameter` in place of
/// `pretravel` fits as well.
#[test]
fn radius_and_tip_are_one_number() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    lobed(at, "0, 72, 144, 216, 288");
    let study = std::fs::read_to_string(at.join("study.toml")).unwrap();
    assert!(study.contains("\"pretravel\""));
    let (with_tip, _) = json(at, &["identify", "study.toml"]);
    std::fs::write(at.join("study.toml"), study.replace("\"pretravel\"", "\"sphere-diameter\"")).unwrap();
    let (with_sphere, _) = json(at, &["identify", "study.toml"]);
    let rms = |fit: &serde_json::Value| fit["rms_um"].as_f64().unwrap();
    assert!((rms(&with_tip) - rms(&with_sphere)).abs() < 0.01, "{} {}", rms(&with_tip), rms(&with_sphere));
    // both at once: one combination without effect, and it names the two
    std::fs::write(at.join("study.toml"), study.replace("\"pretravel\"", "\"pretravel\", \"sphere-diameter\""))
        .unwrap();
    let (both, _) = json(at, &["identify", "study.toml"]);
    let says = both["undetermined"].to_string();
    assert!(says.contains("pretravel") && says.contains("diameter"), "{says}");
}

/// Most points of a sphere are touched once: one touch has nothing in common with itself.
#[test]
fn points_that_are_touched_once_are_no_split() {
    let folder = tempfile::tempdir().unwrap();
    lobed_on(folder.path(), &PROGRAM.replace("AZIMUTHS", "0, 90, 180, 270").replace("repeats = 2", "repeats = 1"));
    let (said, _) = json(folder.path(), &["compare", "study.toml"]);
    let by: Vec<&str> = said["splits"].as_array().unwrap().iter().map(|s| s["by"].as_str().unwrap()).collect();
    assert!(!by.contains(&"face") && by.contains(&"pose.C") && by.contains(&"direction"), "{by:?}");
}

/// docs/guide/diagnose.md: a log has no temperatures, and they are added.
#[test]
fn temperatures_can_be_added_to_a_log() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    lobed(at, "0, 90, 180, 270");
    let needs = |study: &str| json(at, &["diagnose", study]).0["needs_temperature"].as_array().map_or(0, Vec::len);
    assert!(needs("study.toml") > 0);
    ok(
        at,
        &[
            "parse",
            "four.log",
            "--controller",
            "linuxcnc",
            "--plan",
            "four.plan.json",
            "--machines",
            "machines.toml",
            "--out",
            "touches.csv",
        ],
    );
    let csv = std::fs::read_to_string(at.join("touches.csv")).unwrap();
    assert!(!csv.contains("time_s"), "{csv}");
    let with = csv.lines().enumerate().map(|(i, line)| match i {
        0 => format!("{line},temperature_degC\n"),
        i => format!("{line},{}\n", 20.0 + 0.01 * i as f64),
    });
    std::fs::write(at.join("touches.csv"), with.collect::<String>()).unwrap();
    let study = std::fs::read_to_string(at.join("study.toml")).unwrap();
    let study = study.replace("four.log", "touches.csv").replace("controller = \"linuxcnc\"", "controller = \"csv\"");
    std::fs::write(at.join("warm.toml"), study).unwrap();
    assert_eq!(needs("warm.toml"), 0);
}

/// A tool that is longer than the file says is one number with EZ0A, wherever in its tolerance the sphere was put.
#[test]
fn a_sphere_beside_its_place_hides_no_more() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let program = PROGRAM.replace("AZIMUTHS", "0, 72, 144, 216, 288");
    std::fs::write(at.join("four.toml"), program).unwrap();
    let machine = ["--machine", "trunnion", "--controller", "linuxcnc"];
    ok(at, &[&["generate", "--program", "four.toml", "--artefact", "sphere", "--out", "."][..], &machine].concat());
    let plan = ["--machines", "machines.toml", "--plan", "four.plan.json"];
    let found = [0.0, 0.9].map(|mm| {
        let wrong = format!(
            "seed = 3\n[[block]]\nmounting = \"sphere\"\nname = \"ball\"\nshift = [{mm}, {mm}, {mm}]\n[noise]\ntouch_um = 1.0\n"
        );
        std::fs::write(at.join("wrong.toml"), wrong).unwrap();
        for old in ["four.log", "study.toml"] {
            let _ = std::fs::remove_file(at.join(old));
        }
        ok(at, &[&["simulate", "--scenario", "wrong.toml", "--out", "four.log"][..], &machine, &plan].concat());
        ok(at, &[&["new", "--log", "four.log", "--out", "study.toml"][..], &machine, &plan].concat());
        let (fit, _) = json(at, &["identify", "study.toml"]);
        let all = fit["parameters"].as_array().unwrap();
        all.iter().find(|p| p["name"] == "EZ0A").unwrap().clone()
    });
    for p in &found {
        assert!(p["holds"].as_array().unwrap().iter().any(|id| id == "tool-length"), "{p}");
    }
    let [here, aside] = found.map(|p| p["sigma_with_unmodelled"].as_f64().unwrap());
    assert!((here / aside - 1.0).abs() < 0.01 && here > 0.02, "{here} mm, beside its place {aside} mm");
}
