//! The loop by its verbs on machines whose axes do not meet, or have no end: what is exported makes the machine right.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)] // a panic in a test is a failure with its place

mod common;
use common::verbs::ok;
use serde_json::Value;
use std::path::Path;

/// What a verb answers with `--json`.
fn answer(at: &Path, words: &str) -> Value {
    let words: Vec<&str> = words.split_whitespace().chain(["--json"]).collect();
    serde_json::from_str(&ok(at, &words)).unwrap()
}

/// A machine, a program for it, what is wrong with it, and the effects of its model.
struct Case<'a> {
    machine: &'a str,
    program: &'a str,
    scenario: &'a str,
    model: &'a str,
}

impl Case<'_> {
    /// The error of the machine as it was built, and with its compensation, over the noise: measured against a model of the blocks alone.
    fn left(&self, at: &Path) -> (f64, f64) {
        let Self { machine, program, scenario, model } = self;
        std::fs::write(at.join("wrong.toml"), scenario).unwrap();
        answer(at, &format!("generate {machine} --program {program} --controller linuxcnc --out job"));
        let name = program.trim_end_matches(".toml");
        let plan = format!("job/{name}.plan.json");
        answer(at, &format!("simulate {machine} --plan {plan} --scenario wrong.toml --out before.log"));
        let study = |log: &str, more: &str, out: &str| {
            answer(at, &format!("new {machine} --plan {plan} --log {log} --out {out} --effects {more}"));
        };
        study("before.log", model, "study.toml");
        let exported = answer(at, "export study.toml --controller linuxcnc --out comp");
        assert!(!exported["files"].as_array().unwrap().is_empty(), "{exported}");
        answer(
            at,
            &format!("simulate {machine} --plan {plan} --scenario wrong.toml --compensation comp --out after.log"),
        );
        let blocks = "block-setup,pretravel";
        study("before.log", blocks, "b.toml");
        study("after.log", blocks, "a.toml");
        let rms = |study: &str| answer(at, &format!("identify {study} --quick"))["rms_um"].as_f64().unwrap();
        (rms("b.toml"), rms("a.toml"))
    }
}

/// The line of C passes 35 mm and more beside the reference point: its zero turns about its own line.
#[test]
fn a_zero_position_is_one_about_the_line_of_the_axis() {
    for machine in ["nutating-b", "trunnion-offset"] {
        let folder = tempfile::tempdir().unwrap();
        let zero = if machine == "nutating-b" { "zero-b" } else { "zero-a" };
        let error = if machine == "nutating-b" { "EB0B" } else { "EA0A" };
        let case = Case {
            machine: &format!("--machine {machine}"),
            program: "basic",
            scenario: &format!("seed = 4\n[effects.{zero}]\n{error} = 0.02\n[noise]\ntouch_um = 0.5\nvisit_um = 0.0\n"),
            model: &format!("{zero},block-setup,pretravel"),
        };
        let (before, after) = case.left(folder.path());
        assert!(before > 2.0 && after < 0.6, "{machine}: {before} um, {after} um with the compensation");
    }
}

const TURNS: &str = r#"
format = "axiscal-programs/1"
name = "turn"
machine = "endless"
says = "C over two turns, A level and at both sides"
mounting = "table"
faces_in = "block"
[[grid]]
name = "top"
u = [-2.5, 2.5]
v = [-2.5, 2.5]
[[grid]]
name = "side"
u = [-2.5, 2.5]
depth = [3.5]
[[stage]]
name = "c"
[[stage.setup]]
pose = { A = 0.0, C = [-135.0, -45.0, 0.0, 45.0, 135.0, 180.0, 315.0, 450.0, 585.0] }
touch = [ { faces = ["+Z"], grid = "top" }, { faces = ["+X", "-X", "+Y", "-Y"], grid = "side" } ]
[[stage.setup]]
pose = { A = [-40.0, 40.0], C = [0.0, 90.0, 180.0] }
touch = [ { faces = ["+Z"], grid = "top" }, { faces = ["+X", "-X", "+Y", "-Y"], grid = "side" } ]
"#;

/// A table of an endless axis holds every turn that the program used.
#[test]
fn the_turns_in_use_are_in_the_table() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let built_in = axiscal::machine::BUILT_IN;
    let own = built_in.split("[[machine]]").find(|m| m.contains("name = \"trunnion\"\n")).unwrap();
    let own =
        own.replace("\"trunnion\"", "\"endless\"").replace("range = [-360.0, 360.0]", "range = [-9999.0, 9999.0]");
    std::fs::write(at.join("own.toml"), format!("format = \"axiscal-machines/1\"\n[[machine]]{own}")).unwrap();
    std::fs::write(at.join("turn.toml"), TURNS).unwrap();
    let case = Case {
        machine: "--machine endless --machines own.toml",
        program: "turn.toml",
        scenario: "seed = 2\n[effects.positioning-c-1]\nECC1c = 300.0\nECC1s = -200.0\n[effects.positioning-c-3]\nECC3s = 150.0\n[noise]\n\
                   touch_um = 0.5\nvisit_um = 0.0\n",
        model: "positioning-c-1,positioning-c-3,block-setup,pretravel",
    };
    let (before, after) = case.left(at);
    assert!(before > 3.0 && after < 0.6, "{before} um, {after} um with the compensation");
    let table = std::fs::read_to_string(at.join("comp/axiscal_comp_c.txt"))
        .or_else(|_| std::fs::read_to_string(at.join("comp/axiscal_changes.txt")))
        .unwrap();
    assert!(table.contains("720"), "{table}");
}
