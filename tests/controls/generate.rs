//! `generate` and `programs` from outside: files, exit codes, messages.

use assert_cmd::Command;
use axiscal::diag::source;
use axiscal::program::plan::Plan;
use predicates::prelude::*;
use serde_json::Value;
use std::path::Path;

fn axiscal(folder: &Path) -> Command {
    let mut command = Command::cargo_bin("axiscal").unwrap();
    command.current_dir(folder);
    command
}

fn json(command: &mut Command) -> Value {
    let output = command.arg("--json").assert().success().get_output().stdout.clone();
    serde_json::from_slice(&output).unwrap()
}

#[test]
fn every_built_in_program_is_generated_with_its_plan() {
    let folder = tempfile::tempdir().unwrap();
    for (machine, program, touches) in [
        ("swivel-head", "head", 202),
        ("swivel-head", "table", 154),
        ("double-head", "double-head", 286),
        ("trunnion", "basic", 332),
        ("swivel-table-b", "basic", 332),
        ("nutating-b", "basic", 348),
        ("trunnion-offset", "basic", 332),
    ] {
        let out = folder.path().join(machine);
        let answer = json(
            axiscal(folder.path())
                .args(["generate", "--machine", machine, "--program", program, "--controller", "linuxcnc", "--out"])
                .arg(&out),
        );
        assert_eq!(answer["touches"], touches);
        assert_eq!(answer["skipped"].as_array().unwrap().len(), 0);
        let counted: u64 = answer["setups"].as_array().unwrap().iter().map(|s| s["touches"].as_u64().unwrap()).sum();
        assert_eq!(counted, touches);
        let plan = std::fs::read_to_string(out.join(format!("{program}.plan.json"))).unwrap();
        let (plan, _) = Plan::parse(&source("plan", plan)).unwrap();
        assert_eq!(plan.touches.len() as u64, touches);
        let nc = std::fs::read_to_string(out.join(format!("{program}.ngc"))).unwrap();
        assert!(nc.contains(machine) && nc.contains("G38"));
    }
}

#[test]
fn identical_calls_write_identical_bytes() {
    let folder = tempfile::tempdir().unwrap();
    let read = |out: &str| {
        axiscal(folder.path())
            .args([
                "generate",
                "--machine",
                "swivel-head",
                "--program",
                "table",
                "--controller",
                "linuxcnc",
                "--out",
                out,
            ])
            .assert()
            .success();
        ["table.ngc", "table.plan.json"].map(|f| std::fs::read(folder.path().join(out).join(f)).unwrap())
    };
    assert_eq!(read("a"), read("b"));
}

/// Asks for the face away from the probe's body, which the stem would have to pass through.
const TOO_MUCH: &str = r#"format = "axiscal-programs/1"
name = "mine"
mounting = "head"
[[grid]]
name = "G"
u = [-2.0, 2.0]
depth = [3.0]
[[stage]]
name = "s"
[[stage.setup]]
pose = { B = -90.0 }
blocks = ["x-"]
touch = [{ faces = ["-X", "+X"], grid = "G" }]
"#;

#[test]
fn what_cannot_be_touched_is_left_out_with_its_reason_or_refused() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("mine.toml"), TOO_MUCH).unwrap();
    let call = |extra: &[&str]| {
        let mut command = axiscal(folder.path());
        command.args(["generate", "--machine", "swivel-head", "--program", "mine.toml", "--controller", "linuxcnc"]);
        command.args(["--out", "out"]).args(extra);
        command
    };
    // refused: nothing is written
    call(&["--strict"]).assert().code(2).stderr(predicate::str::contains("the stem would hit block x-"));
    assert!(!folder.path().join("out").exists());
    call(&[])
        .assert()
        .success()
        .stdout(predicate::str::contains("2 touches were left out").and(predicate::str::contains("lost its +X side")));
    let answer = json(&mut call(&[]));
    assert_eq!((&answer["touches"], &answer["skipped"][0]["points"]), (&2.into(), &2.into()));
}

#[test]
fn a_broken_program_is_named_with_its_place() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("mine.toml"), TOO_MUCH.replace("\"x-\"", "\"q\"").replace("-90.0", "190.0"))
        .unwrap();
    axiscal(folder.path())
        .args([
            "generate",
            "--machine",
            "swivel-head",
            "--program",
            "mine.toml",
            "--controller",
            "linuxcnc",
            "--out",
            "out",
        ])
        .assert()
        .code(2)
        .stderr(
            predicate::str::contains("mine.toml:11:")
                .and(predicate::str::contains("mine.toml:12:"))
                .and(predicate::str::contains("no block \"q\"").and(predicate::str::contains("outside the range"))),
        );
    assert!(!folder.path().join("out").exists());
}

#[test]
fn unknown_names_list_what_there_is() {
    let folder = tempfile::tempdir().unwrap();
    let call = |machine: &str, program: &str, controller: &str| {
        let mut command = axiscal(folder.path());
        command.args([
            "generate",
            "--machine",
            machine,
            "--program",
            program,
            "--controller",
            controller,
            "--out",
            "o",
        ]);
        command.assert().code(2)
    };
    call("lathe", "head", "linuxcnc").stderr(predicate::str::contains("swivel-head, double-head, trunnion"));
    call("swivel-head", "heap", "linuxcnc").stderr(predicate::str::contains("head, table, double-head, basic"));
    call("trunnion", "head", "linuxcnc").stderr(predicate::str::contains("is written for swivel-head"));
    call("swivel-head", "head", "abacus").stderr(predicate::str::contains("linuxcnc"));
    call("swivel-head", "missing.toml", "linuxcnc").stderr(predicate::str::contains("missing.toml"));
}

#[test]
fn programs_are_listed_and_shown() {
    let folder = tempfile::tempdir().unwrap();
    let list = json(axiscal(folder.path()).arg("programs"));
    let names: Vec<&str> = list["programs"].as_array().unwrap().iter().map(|p| p["name"].as_str().unwrap()).collect();
    let (basic, full) = ([&"basic"; 4], [&"full"; 6]);
    assert_eq!(names, [&["head", "table", "double-head"][..], &basic.map(|n| *n), &full.map(|n| *n)].concat());
    let head = json(axiscal(folder.path()).args(["programs", "show", "head"]));
    let counts: Vec<u64> =
        head["programs"][0]["setups"].as_array().unwrap().iter().map(|s| s["touches"].as_u64().unwrap()).collect();
    assert_eq!(counts, [112, 42, 48]);
    axiscal(folder.path()).args(["programs", "show", "heap"]).assert().code(2);
    // what is printed can be saved, changed and used
    let text = axiscal(folder.path()).args(["programs", "show", "head", "--toml"]).assert().success();
    std::fs::write(folder.path().join("copy.toml"), &text.get_output().stdout).unwrap();
    let copy = json(axiscal(folder.path()).args(["programs", "show", "copy.toml"]));
    assert_eq!(copy["programs"][0]["setups"], head["programs"][0]["setups"]);
}

#[test]
fn a_program_for_other_machines_is_refused_in_one_line() {
    let folder = tempfile::tempdir().unwrap();
    let call = ["generate", "--machine", "swivel-head", "--program", "basic", "--controller", "linuxcnc", "--out", "o"];
    let output = axiscal(folder.path()).args(call).assert().code(2).get_output().stderr.clone();
    let said = String::from_utf8(output).unwrap();
    assert!(said.contains("not for swivel-head; for swivel-head there are: head, table"), "{said}");
    assert_eq!(said.matches("error:").count(), 1, "{said}");
}

#[test]
fn the_plan_of_another_machine_is_kept() {
    let folder = tempfile::tempdir().unwrap();
    let other = r#"{ "machine": "trunnion", "program": "table" }"#;
    std::fs::write(folder.path().join("table.plan.json"), other).unwrap();
    let call = ["generate", "--machine", "swivel-head", "--program", "table", "--controller", "linuxcnc", "--out", "."];
    let run = axiscal(folder.path()).args(call).assert().code(2);
    run.stderr(predicate::str::contains("for machine \"trunnion\""));
    assert_eq!(std::fs::read_to_string(folder.path().join("table.plan.json")).unwrap(), other);
    assert!(!folder.path().join("table.ngc").exists());
}
