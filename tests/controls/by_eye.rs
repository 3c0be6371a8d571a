//! A sphere that was put down by eye: the program finds it, and its other touches are relative to what it found.

use crate::common::verbs::{axiscal, json, ok};
use std::path::Path;

const CONTROLLERS: [(&str, &str); 5] =
    [("linuxcnc", "ngc"), ("sinumerik", "mpf"), ("fanuc", "nc"), ("heidenhain", "h"), ("haas", "nc")];

/// Almost at a corner of the tolerance.
const SHIFT: [f64; 3] = [2.5, -2.6, 2.7];

const PLANTED: [(&str, f64); 5] =
    [("EY0A", 0.021), ("EZ0A", -0.013), ("EX0C", 0.015), ("EA0C", 0.004), ("pretravel", 0.004)];

fn scenario(at: &Path, shift: [f64; 3]) {
    let text = format!(
        "seed = 5\n[effects.location-a]\nEY0A = 0.021\nEZ0A = -0.013\n[effects.location-c]\nEX0C = 0.015\nEA0C = 0.004\n\
         [effects.pretravel]\npretravel = 0.004\n[[block]]\nmounting = \"sphere\"\nname = \"ball\"\nshift = {shift:?}\n\
         [noise]\ntouch_um = 0.5\nvisit_um = 0.5\n"
    );
    std::fs::write(at.join("wrong.toml"), text).unwrap();
}

fn generate<'a>(controller: &'a str, more: &[&'a str]) -> Vec<&'a str> {
    let words = ["generate", "--machine", "trunnion", "--program", "auto", "--artefact", "sphere", "--minutes", "8"];
    [&words[..], &["--placement-tolerance", "3", "--controller", controller, "--out", "job"], more].concat()
}

const MACHINE: [&str; 4] = ["--machine", "trunnion", "--machines", "job/machines.toml"];
const PLAN: [&str; 2] = ["--plan", "job/auto.plan.json"];

#[test]
fn a_sphere_put_down_by_eye_goes_round_on_every_control() {
    for (controller, extension) in CONTROLLERS {
        let folder = tempfile::tempdir().unwrap();
        let at = folder.path();
        scenario(at, SHIFT);
        ok(at, &generate(controller, &[]));
        let on = ["--controller", controller];
        ok(at, &[&["check", &format!("job/auto.{extension}")][..], &MACHINE, &PLAN, &on].concat());
        ok(at, &[&["simulate", "--scenario", "wrong.toml", "--out", "auto.log"][..], &MACHINE, &PLAN, &on].concat());
        let log = std::fs::read_to_string(at.join("auto.log")).unwrap();
        // some controls write no line ends
        let found = log.find("F X").map_or_else(|| panic!("{controller}: {log:.300}"), |from| &log[from..]);
        let numbers: Vec<f64> = found
            .split(|c: char| c.is_ascii_uppercase())
            .filter_map(|word| word.replace(' ', "").parse().ok())
            .take(3)
            .collect();
        for (number, shift) in numbers.iter().zip(SHIFT) {
            // what is wrong with the machine is in it
            assert!((number - shift).abs() < 0.1, "{controller}: {found:.80}");
        }
        let read = ["parse", "auto.log", "--machines", "job/machines.toml", "--out", "touches.csv"];
        assert!(ok(at, &[&read[..], &PLAN, &on].concat()).contains("has its end line"), "{controller}");
        // a CSV does not say where the sphere was found: its touches do
        for (log, by) in [("auto.log", controller), ("touches.csv", "csv")] {
            let study = format!("{by}.toml");
            let new = ["new", "--log", log, "--controller", by, "--out", &study];
            ok(at, &[&new[..], &MACHINE, &PLAN].concat());
            let (fit, code) = json(at, &["identify", &study]);
            assert_eq!(code, 0, "{controller}: {fit}");
            for (name, truth) in PLANTED {
                let p = fit["parameters"].as_array().unwrap().iter().find(|p| p["name"] == name).unwrap();
                let (value, sigma) = (p["value"].as_f64().unwrap(), p["sigma"].as_f64().unwrap());
                assert!(
                    (value - truth).abs() < 4.0 * sigma,
                    "{controller}: {name}: {value} for {truth}, sigma {sigma}"
                );
            }
            let rms = fit["rms_um"].as_f64().unwrap();
            assert!(rms < 1.3, "{controller}: {rms} um left of 0.5 um each touch and each visit");
        }
    }
}

/// Constants of a program that are changed, one each.
const EDITS: [(&str, &str); 5] = [
    // of what moves are relative to in a pose
    ("#<_axiscal_dx> = [0.", "#<_axiscal_dx> = [0.1"),
    // of what a touch adds to what was found
    ("+ 0.5 * #<_axiscal_off>]", "+ 0.4 * #<_axiscal_off>]"),
    ("+ -1 * #<_axiscal_off>]", "+ -0.9 * #<_axiscal_off>]"),
    // the moves are no longer relative to it
    ("#2 = [#2 + #<_axiscal_dy>]", "#2 = [#2 + #<_axiscal_dx>]"),
    // the log says something else
    ("(LOG,F X%.6f#<_axiscal_ox>", "(LOG,F X%.6f#<_axiscal_oy>"),
];

/// Whatever is changed is found against the record in the plan; a plan without the record is refused.
#[test]
fn an_edit_of_what_moves_are_relative_to_does_not_pass() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    ok(at, &generate("linuxcnc", &[]));
    let program = std::fs::read_to_string(at.join("job/auto.ngc")).unwrap();
    let plan = at.join("job/auto.plan.json");
    let written = std::fs::read_to_string(&plan).unwrap();
    let check = [&["check", "edited.ngc", "--controller", "linuxcnc"][..], &MACHINE, &PLAN].concat();
    let judged = |text: &str| {
        std::fs::write(at.join("edited.ngc"), text).unwrap();
        let out = axiscal(at, &check);
        (out.status.code(), String::from_utf8_lossy(&out.stderr).into_owned() + &String::from_utf8_lossy(&out.stdout))
    };
    let (code, says) = judged(&program);
    assert_eq!(code, Some(0), "{says}");
    for (from, to) in EDITS {
        assert!(program.contains(from), "{from}");
        let (code, says) = judged(&program.replacen(from, to, 1));
        assert_eq!(code, Some(1), "{from} as {to}: {says}");
    }
    let mut bare: serde_json::Value = serde_json::from_str(&written).unwrap();
    for program in bare["programs"].as_object_mut().unwrap().values_mut() {
        program["steps_sha256"] = serde_json::json!("");
    }
    std::fs::write(&plan, bare.to_string()).unwrap();
    let (code, says) = judged(&program);
    assert_ne!(code, Some(0), "a plan without its record: {says}");
}

#[test]
fn what_cannot_be_found_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let refused = |words: &[&str], code: &str| {
        let out = axiscal(at, &[words, &["--json"]].concat());
        let says = String::from_utf8_lossy(&out.stderr).into_owned() + &String::from_utf8_lossy(&out.stdout);
        assert_eq!(out.status.code(), Some(2), "{words:?}: {says}");
        assert!(says.contains(code), "{words:?}: {says}");
    };
    refused(&generate("linuxcnc", &["--tcp"]), "program::find");
    refused(&generate("fanuc-inspection-plus", &[]), "post::find");
    let with = |from: &'static str, to: &'static str| -> Vec<&'static str> {
        generate("linuxcnc", &[]).into_iter().map(|word| if word == from { to } else { word }).collect()
    };
    refused(&with("sphere", "cube"), "program::find");
    refused(&with("3", "0"), "cli::placement_tolerance");
    refused(&with("3", "9"), "program::find");
    // further off than the program is made for, it stops
    ok(at, &generate("linuxcnc", &[]));
    scenario(at, [0.0, 3.2, 0.0]);
    let simulate = ["simulate", "--scenario", "wrong.toml", "--controller", "linuxcnc", "--out", "auto.log"];
    refused(&[&simulate[..], &MACHINE, &PLAN].concat(), "simulate::not_found");
    // without its plan nobody knows where the touches of such a program are
    let out = axiscal(at, &[&["check", "job/auto.ngc", "--controller", "linuxcnc", "--json"][..], &MACHINE].concat());
    let says = String::from_utf8_lossy(&out.stderr).into_owned() + &String::from_utf8_lossy(&out.stdout);
    assert!(out.status.code() == Some(2) && says.contains("check::needs_plan"), "{says}");
}
