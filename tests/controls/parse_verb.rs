//! `parse` and `controllers` from outside: files, exit codes, messages. What a log gives is in `logs.rs`.
// a panic in a test is a failure with its place

use assert_cmd::Command;
use predicates::prelude::*;
use serde_json::Value;
use std::path::Path;

fn axiscal() -> Command {
    let mut command = Command::cargo_bin("axiscal").unwrap();
    command.current_dir(Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/logs"));
    command
}

/// The corpus is of an earlier version: that is noted, and nothing else.
fn only_the_older_note() -> impl predicates::Predicate<str> {
    predicate::function(|said: &str| said.matches("note: ").count() == 1 && !said.contains("warning: "))
}

#[test]
fn a_log_becomes_a_csv_that_reads_the_same() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("touches.csv");
    axiscal()
        .args(["parse", "good/run.log", "--controller", "linuxcnc", "--plan", "t.plan.json", "--out"])
        .arg(&out)
        .assert()
        .success()
        .stdout(predicate::str::contains("3 of 3 planned touches read; the log has its end line"))
        .stderr(only_the_older_note());
    assert!(std::fs::read_to_string(&out).unwrap().starts_with("id,X,Y,Z,B,C,status\n1,28,0,8,0,0,hit\n"));
    let answer = |log: &str, controller: &str| -> Value {
        let mut command = axiscal();
        command.args(["parse", log, "--controller", controller, "--plan", "t.plan.json", "--json"]);
        serde_json::from_slice(&command.assert().success().get_output().stdout).unwrap()
    };
    let from_log = answer("good/run.log", "linuxcnc");
    let from_csv = answer(&out.display().to_string(), "csv");
    assert_eq!(from_log["touches"], from_csv["touches"]);
    assert_eq!((&from_log["hits"], &from_log["complete"]), (&3.into(), &true.into()));
}

#[test]
fn warnings_leave_the_rest_usable_and_errors_write_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("touches.csv");
    let parse = |log: &str, plan: &str, controller: &str| {
        let mut command = axiscal();
        command.args(["parse", log, "--controller", controller, "--plan", plan, "--out"]).arg(&out);
        command.assert()
    };
    parse("bad/missed.log", "t.plan.json", "linuxcnc")
        .code(0)
        .stderr(predicate::str::contains("bad/missed.log:3:1: warning: touch 2 (block x+, face +Z) was missed"));
    std::fs::remove_file(&out).unwrap();
    for (log, plan, controller, says) in [
        ("bad/empty.log", "t.plan.json", "linuxcnc", "bad/empty.log:1:1: the log is empty"),
        (
            "bad/other-program.log",
            "t.plan.json",
            "linuxcnc",
            "bad/other-program.log:1:1: error: the log is of program TABLE",
        ),
        ("bad/nowhere.log", "t.plan.json", "linuxcnc", "cannot read bad/nowhere.log"),
        ("good/run.log", "good/run.log", "linuxcnc", "good/run.log:1:1: error"),
        ("good/run.log", "t.plan.json", "sinumerik-of-my-own", "no controller is called"),
        ("good/run.log", "t.plan.json", "t.plan.toml", "cannot read t.plan.toml"),
        ("good/run.log", "t.plan.json", "csv", "column"),
    ] {
        parse(log, plan, controller).code(2).stderr(predicate::str::contains(says)).stdout("");
        assert!(!out.exists());
    }
}

#[test]
fn the_last_line_says_what_was_read_and_how_the_log_ends() {
    for (log, says) in [
        ("good/probeopen.log", "3 of 3 planned touches read; a log of this form has no end line"),
        ("bad/truncated.log", "2 of 3 planned touches read (1 NOT READ: the warnings say why); THE LOG IS CUT OFF"),
        ("bad/nan.log", "2 of 3 planned touches read (1 NOT READ: the warnings say why); the log has its end line"),
    ] {
        let mut command = axiscal();
        command.args(["parse", log, "--controller", "linuxcnc", "--plan", "t.plan.json"]);
        command.assert().success().stdout(predicate::str::contains(says));
    }
    let mut command = axiscal();
    command.args(["parse", "bad/nan.log", "--controller", "linuxcnc", "--plan", "t.plan.json"]);
    let says = "1 of the plan's 3 touches is in the log, but its line is not used (see above): 2";
    command
        .assert()
        .success()
        .stderr(predicate::str::contains(says).and(predicate::str::contains("not in the log").not()));
}

#[test]
fn controllers_are_listed_and_shown_as_files_to_change() {
    let listed = axiscal().args(["controllers", "--json"]).assert().success().get_output().stdout.clone();
    let listed: Value = serde_json::from_slice(&listed).unwrap();
    assert_eq!(
        (&listed["format"], &listed["controllers"][0]["name"]),
        (&"axiscal-controllers/1".into(), &"linuxcnc".into())
    );
    axiscal().arg("controllers").assert().success().stdout(predicate::str::contains("linuxcnc"));
    let shown = axiscal().args(["controllers", "show", "linuxcnc"]).assert().success().get_output().stdout.clone();
    let folder = tempfile::tempdir().unwrap();
    let mine = folder.path().join("mine.toml");
    std::fs::write(&mine, shown).unwrap();
    axiscal()
        .args(["parse", "good/run.log", "--plan", "t.plan.json", "--controller"])
        .arg(&mine)
        .assert()
        .success()
        .stderr(only_the_older_note());
    axiscal()
        .args(["controllers", "show", "nobody"])
        .assert()
        .code(2)
        .stderr(predicate::str::contains("there are: linuxcnc"));
}
