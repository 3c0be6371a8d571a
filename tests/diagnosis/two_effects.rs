//! Two effects that act at once, where no single effect explains the touches. The case is a folder beside the project.

use crate::common::verbs::{axiscal, json, ok};
use serde_json::Value;
use std::path::{Path, PathBuf};

const MACHINE: [&str; 4] = ["--machine", "shop-ac", "--machines", "machines.toml"];

/// A copy of the case `two-effects-one-block`, or nothing where it is missing. The cases are beside the shared data.
fn case() -> Option<tempfile::TempDir> {
    let data = std::env::var_os("AXISCAL_SHARED_DATA")
        .map_or_else(|| PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../shared/data"), PathBuf::from);
    let case = data.join("../cases/two-effects-one-block");
    if !case.is_dir() {
        let missing = format!("skipped: {} is missing (AXISCAL_SHARED_DATA sets another folder)", case.display());
        assert!(std::env::var_os("AXISCAL_REQUIRE_SHARED_DATA").is_none(), "{missing}");
        println!("{missing}");
        return None;
    }
    let folder = tempfile::tempdir().unwrap();
    for file in ["machines.toml", "program.toml", "wrong.toml"] {
        std::fs::copy(case.join(file), folder.path().join(file)).unwrap();
    }
    Some(folder)
}

/// The touches of the case and their study, made as its `run.sh` makes them.
fn measure(at: &Path) {
    let run = |verb: &[&str], out: &str| {
        ok(at, &[verb, &MACHINE, &["--controller", "linuxcnc", "--out", out]].concat());
    };
    run(&["generate", "--program", "program.toml"], "job");
    run(&["simulate", "--plan", "job/one.plan.json", "--scenario", "wrong.toml"], "one.log");
    run(&["new", "--plan", "job/one.plan.json", "--log", "one.log"], "study.toml");
}

/// Ids of the effects that these touches cannot separate from a candidate, with its own.
fn group(candidate: &Value) -> Vec<&str> {
    let alike = candidate["same_as"].as_array().unwrap().iter();
    std::iter::once(&candidate["effect"]).chain(alike).map(|id| id.as_str().unwrap()).collect()
}

fn number(value: &Value, key: &str) -> f64 {
    value[key].as_f64().unwrap_or_else(|| panic!("no number {key:?} in {value}"))
}

/// Planted: `scale-y` with 60 µm/m and `backlash-a` with 80 µrad; the touches scatter by 0.5 µm and the index positions by 0.2 µm.
#[test]
fn two_effects_that_explain_the_touches_together_are_named_together() {
    let Some(folder) = case() else { return };
    let at = folder.path();
    measure(at);
    let (d, code) = json(at, &["diagnose", "study.toml"]);
    assert_eq!((d["verdict"].as_str(), code), (Some("missing-effect"), 1), "{}", d["says"]);
    let [first, second] = [&d["candidates"][0], &d["candidates"][1]];
    assert_eq!(first["together_with"], second["effect"], "{}", d["says"]);
    assert_eq!(first["proposed"], true);
    let both = [group(first), group(second)];
    assert!(both[0].contains(&"scale-y") && both[1].contains(&"backlash-a"), "{both:?}");
    // with both effects no more is left than the touches and the index positions scatter, which is less than the probe noise
    let [before, noise, after] = [number(&d, "rms_um"), number(&d, "noise_um"), number(first, "rms_after_um")];
    assert!(before > 1.5 * noise, "{before} {noise}");
    assert!(after > 0.4 && after < 0.5f64.hypot(0.2) * 1.1 && after < noise, "{after}, noise {noise}");
    assert_eq!(first["remains"], false, "{first}");
    // each has the size and the cross-validated error that it has beside the other
    for (candidate, name, planted) in [(first, "EYY", 60.0), (second, "backlash_A", 80.0)] {
        let size = &candidate["parameters"][0];
        assert_eq!(size["name"], name, "{candidate}");
        let off = number(size, "value") - planted;
        assert!(off.abs() < 3.0 * number(size, "sigma") && off.abs() < 0.05 * planted, "{size}");
        assert!(number(candidate, "held_out_after_um") < 0.7, "{candidate}");
        assert_eq!(candidate["rms_after_um"], first["rms_after_um"]);
    }
    assert_eq!(second["together_with"], first["effect"]);
    // and the message states both names and the error that is left
    let says = d["says"].as_str().unwrap();
    for part in ["scale-y", "backlash-a", "both", &format!("{before:.2}"), &format!("{after:.2} µm")] {
        assert!(says.contains(part), "{part:?} is not in {says:?}");
    }
}

/// The page says the same as the terminal: two names, the error with both, and the values of a model with both.
#[test]
fn the_report_names_both() {
    let Some(folder) = case() else { return };
    let at = folder.path();
    measure(at);
    let said = ok(at, &["report", "study.toml", "--out", "report.html"]);
    let names =
        "Scale of axis Y, or one of 3 others, and together with it Backlash of A: no single effect explains both";
    assert!(said.contains(names), "{said}");
    let page = std::fs::read_to_string(at.join("report.html")).unwrap();
    for part in [names, "with both in the model", "after, with", "scale-y, backlash-a", "the backlash of A"] {
        assert!(page.contains(part), "{part:?}");
    }
}

/// `backlash-a` is clear; what `scale-y` may be is asked with it in the model, by `diagnose` and by `plan-next` alike.
#[test]
fn the_effect_that_is_clear_is_added_first_and_the_other_is_asked_with_it() {
    let Some(folder) = case() else { return };
    let at = folder.path();
    measure(at);
    let said = String::from_utf8(axiscal(at, &["diagnose", "study.toml"]).stdout).unwrap();
    assert!(said.contains("next: axiscal add study.toml backlash-a"), "{said}");
    let (d, _) = json(at, &["diagnose", "study.toml"]);
    let first = &d["candidates"][0];
    assert!(first["tell_apart"].as_str().unwrap().starts_with("add backlash-a first"), "{first}");
    let next = |out: &str| json(at, &["plan-next", "study.toml", "--controller", "linuxcnc", "--out", out]).0;
    let asked = next("first");
    ok(at, &["add", "study.toml", "backlash-a"]);
    let (d, _) = json(at, &["diagnose", "study.toml"]);
    assert_eq!(d["candidates"][0]["effect"], "scale-y", "{}", d["says"]);
    let then = next("then");
    assert_eq!((&asked["pairs"], &asked["says"]), (&then["pairs"], &then["says"]));
    // it asks for what `diagnose` names, and not for what backlash-a makes of other effects
    let names = group(&d["candidates"][0]);
    for pair in then["pairs"].as_array().unwrap() {
        let is_named = |id: &Value| id.is_null() || names.contains(&id.as_str().unwrap());
        assert!(is_named(&pair["one"]) && is_named(&pair["other"]), "{then}");
    }
    // the turns of which a scale is a special case are not passed over
    assert!(then["says"].as_str().unwrap().contains("a special case of angular-cy, angular-ay"), "{}", then["says"]);
}

/// With both in the model their sizes are those that were planted, and nothing is missing.
#[test]
fn with_both_effects_the_model_is_complete_and_their_sizes_are_right() {
    let Some(folder) = case() else { return };
    let at = folder.path();
    measure(at);
    for effect in ["scale-y", "backlash-a"] {
        ok(at, &["add", "study.toml", effect]);
    }
    let (d, code) = json(at, &["diagnose", "study.toml"]);
    assert_eq!((d["verdict"].as_str(), code), (Some("adequate"), 0), "{}", d["says"]);
    let (fit, _) = json(at, &["identify", "study.toml"]);
    for (name, planted) in [("EYY", 60.0), ("backlash_A", 80.0)] {
        let all = fit["parameters"].as_array().unwrap();
        let p = all.iter().find(|p| p["name"] == name).unwrap_or_else(|| panic!("no {name} in {fit}"));
        let (value, sigma) = (number(p, "value"), number(p, "sigma"));
        assert!((value - planted).abs() < 3.0 * sigma && sigma < 0.1 * planted, "{name}: {value} ± {sigma}");
    }
}
