//! Artefacts that people own, on every control: generate → check → simulate → parse → identify → export.

use crate::common::verbs::{axiscal, json, ok};
use std::path::Path;

const SCENARIO: &str = "seed = 5
[effects.location-a]
EY0A = 0.021
EZ0A = -0.013
EB0A = 0.002
[effects.location-c]
EX0C = 0.015
EA0C = 0.004
[effects.pretravel]
pretravel = 0.004
[[block]]
mounting = \"MOUNTING\"
name = \"BODY\"
shift = [0.4, -0.3, 0.5]
[noise]
touch_um = 0.5
visit_um = 0.5
";

/// Generates the program that is chosen for an artefact and runs it on a wrong machine; the study is `study.toml`.
fn measured(at: &Path, artefact: &str, body: &str, minutes: &str, controller: &str) {
    std::fs::write(at.join("wrong.toml"), SCENARIO.replace("MOUNTING", artefact).replace("BODY", body)).unwrap();
    let chosen = ["--program", "auto", "--artefact", artefact, "--minutes", minutes];
    let generate = ["generate", "--machine", "trunnion", "--controller", controller, "--out", "job"];
    ok(at, &[&generate[..], &chosen].concat());
    let machine = ["--machine", "trunnion", "--machines", "job/machines.toml", "--controller", controller];
    let plan = ["--plan", "job/auto.plan.json"];
    let program = ["ngc", "mpf", "nc", "h"].iter().find(|end| at.join(format!("job/auto.{end}")).exists()).unwrap();
    ok(at, &[&["check", &format!("job/auto.{program}")][..], &machine, &plan].concat());
    ok(at, &[&["simulate", "--scenario", "wrong.toml", "--out", "auto.log"][..], &machine, &plan].concat());
    let read = ["parse", "auto.log", "--machines", "job/machines.toml", "--controller", controller];
    assert!(ok(at, &[&read[..], &plan].concat()).contains("has its end line"));
    ok(at, &[&["new", "--log", "auto.log", "--out", "study.toml"][..], &machine, &plan].concat());
}

/// Planted values, each within four standard uncertainties.
fn found(at: &Path, planted: &[(&str, f64)]) {
    let (fit, code) = json(at, &["identify", "study.toml"]);
    assert_eq!(code, 0);
    for (name, truth) in planted {
        let p = fit["parameters"].as_array().unwrap().iter().find(|p| p["name"] == *name).unwrap();
        let (value, sigma) = (p["value"].as_f64().unwrap(), p["sigma"].as_f64().unwrap());
        assert!((value - truth).abs() < 4.0 * sigma, "{name}: {value} for {truth}, sigma {sigma}");
    }
}

#[test]
fn one_sphere_goes_round_on_every_control() {
    for controller in ["linuxcnc", "sinumerik", "fanuc", "heidenhain", "haas"] {
        let folder = tempfile::tempdir().unwrap();
        let at = folder.path();
        measured(at, "sphere", "ball", "10", controller);
        found(
            at,
            &[
                ("EY0A", 0.021),
                ("EZ0A", -0.013),
                ("EB0A", 0.002),
                ("EX0C", 0.015),
                ("EA0C", 0.004),
                ("pretravel", 0.004),
            ],
        );
        let export = ["export", "study.toml", "--controller", controller, "--accept-unverified", "--out", "tables"];
        let out = axiscal(at, &export);
        assert!(out.status.success(), "{controller}: {}", String::from_utf8_lossy(&out.stderr));
        assert!(at.join("tables/README.txt").exists(), "{controller}");
    }
}

#[test]
fn ring_pin_and_cube_go_round() {
    for (artefact, body) in [("ring", "ring"), ("pin", "pin"), ("cube", "cube"), ("two-spheres", "high")] {
        let folder = tempfile::tempdir().unwrap();
        let at = folder.path();
        measured(at, artefact, body, "15", "linuxcnc");
        // a ring that is touched with the table level sees C alone
        let all = [("EX0C", 0.015), ("EY0A", 0.021), ("EZ0A", -0.013)];
        found(at, &all[..if artefact == "ring" { 1 } else { 3 }]);
    }
}

#[test]
fn a_machine_is_a_template_and_an_artefact_a_file() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    std::fs::write(at.join("mine.toml"), ok(at, &["machines", "show", "trunnion", "--toml"])).unwrap();
    std::fs::write(at.join("ball.toml"), ok(at, &["artefacts", "show", "sphere"]).replace("25.0", "30.0")).unwrap();
    let auto = ["--program", "auto", "--artefact", "ball.toml", "--minutes", "5", "--controller", "linuxcnc"];
    let machine = ["--machine", "trunnion", "--machines", "mine.toml", "--out", "job"];
    ok(at, &[&["generate"][..], &auto, &machine].concat());
    let plan: serde_json::Value =
        serde_json::from_slice(&std::fs::read(at.join("job/auto.plan.json")).unwrap()).unwrap();
    assert_eq!((&plan["blocks"][0]["form"], &plan["blocks"][0]["diameter"]), (&"sphere".into(), &30.0.into()));
    // the chosen touches are a program like any other
    let again = ["--program", "job/auto.toml", "--controller", "linuxcnc", "--out", "again"];
    ok(at, &[&["generate", "--machine", "trunnion", "--machines", "job/machines.toml"][..], &again].concat());
    assert_eq!(std::fs::read(at.join("job/auto.ngc")).unwrap(), std::fs::read(at.join("again/auto.ngc")).unwrap());
    // a machines file of the user's own is not written over
    std::fs::create_dir(at.join("own")).unwrap();
    std::fs::copy(at.join("mine.toml"), at.join("own/machines.toml")).unwrap();
    let out = axiscal(at, &[&["generate"][..], &auto, &["--machine", "trunnion", "--out", "own"]].concat());
    assert_eq!(out.status.code(), Some(2), "{}", String::from_utf8_lossy(&out.stderr));
    assert_eq!(std::fs::read(at.join("own/machines.toml")).unwrap(), std::fs::read(at.join("mine.toml")).unwrap());
    for (words, code) in [(["--artefact", "bell"], "artefact::unknown"), (["--minutes", "0"], "auto::minutes")] {
        let out = axiscal(
            at,
            &[&["generate", "--json", "--program", "auto"][..], &machine, &["--controller", "linuxcnc"], &words]
                .concat(),
        );
        assert_eq!(out.status.code(), Some(2));
        assert!(
            String::from_utf8_lossy(&out.stderr).contains(code) || String::from_utf8_lossy(&out.stdout).contains(code),
            "{code}"
        );
    }
}

#[test]
fn a_hole_that_is_too_narrow_is_refused_with_its_numbers() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let ring = ok(at, &["artefacts", "show", "ring"]);
    let narrow = ring.lines().map(|l| if l.starts_with("diameter") { "diameter = 5.0" } else { l });
    std::fs::write(at.join("narrow.toml"), narrow.collect::<Vec<_>>().join("\n")).unwrap();
    let auto = ["--program", "auto", "--artefact", "narrow.toml", "--controller", "linuxcnc", "--out", "job"];
    let out = axiscal(at, &[&["generate", "--machine", "trunnion"][..], &auto].concat());
    let said = String::from_utf8_lossy(&out.stderr);
    assert_eq!(out.status.code(), Some(2), "{said}");
    assert!(
        said.contains("diameter is 5 mm") && said.contains("tip has 6 mm") && said.contains("more than 6.6 mm"),
        "{said}"
    );
}

/// Worst uncertainty of a location error in its usual size, and how many effects are found at their usual size.
fn worth(at: &Path, machine: &str, plan: &str) -> (f64, usize) {
    let (says, code) = json(at, &["assess", "--machine", machine, "--plan", plan]);
    assert_eq!(code, 0);
    let parameters = says["parameters"].as_array().unwrap().iter();
    let location = parameters.filter(|p| p["effect"].as_str().unwrap().starts_with("location-"));
    // usual sizes of effects.toml: 10 um and 0.001 deg
    let usual = |unit: &str| if unit == "mm" { 0.01 } else { 0.001 };
    let shares = location.map(|p| p["sigma_with_visits"].as_f64().unwrap() / usual(p["unit"].as_str().unwrap()));
    let seen = says["effects"].as_array().unwrap().iter().filter(|e| e["noncentrality"].as_f64().unwrap() >= 25.0);
    (shares.fold(0.0, f64::max), seen.count())
}

#[test]
fn in_the_same_time_auto_is_as_good_as_the_built_in_programs() {
    for (machine, program, mounting) in [
        ("trunnion", "basic", "table"),
        ("nutating-b", "basic", "table"),
        ("swivel-table-b", "full", "full"),
        ("trunnion-offset", "full", "full"),
    ] {
        let folder = tempfile::tempdir().unwrap();
        let at = folder.path();
        let generate = ["generate", "--machine", machine, "--controller", "heidenhain"];
        ok(at, &[&generate[..], &["--program", program, "--out", "hand"]].concat());
        let plan = format!("hand/{program}.plan.json");
        let text: serde_json::Value = serde_json::from_slice(&std::fs::read(at.join(&plan)).unwrap()).unwrap();
        let minutes = text["touches"].as_array().unwrap().last().unwrap()["time_s"].as_f64().unwrap() / 60.0;
        let auto = ["--program", "auto", "--mounting", mounting, "--minutes", &minutes.to_string(), "--out", "job"];
        ok(at, &[&generate[..], &auto].concat());
        let (by_hand, chosen) = (worth(at, machine, &plan), worth(at, machine, "job/auto.plan.json"));
        assert!(chosen.0 <= by_hand.0 * (1.0 + 1e-9) && chosen.1 >= by_hand.1, "{machine}: {chosen:?}, {by_hand:?}");
        // it is a file that can be edited and used like any other
        let again = ["--program", "job/auto.toml", "--out", "again"];
        ok(at, &[&generate[..], &again].concat());
        let read = |folder: &str| std::fs::read(at.join(folder).join("auto.h")).unwrap();
        assert!(read("job") == read("again"), "{machine}: another program from auto.toml");
    }
}
