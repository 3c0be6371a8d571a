//! `axiscal simulate` from outside: files, exit codes, messages.

use crate::common;
use assert_cmd::Command;
use common::*;
use predicates::prelude::*;
use std::path::Path;

fn axiscal(folder: &Path) -> Command {
    let mut command = Command::cargo_bin("axiscal").unwrap();
    command.current_dir(folder);
    command
}

/// A folder with the plan of a program.
fn folder(machine_name: &str, program: &str) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let machine = machine(machine_name);
    std::fs::write(folder.path().join("plan.json"), plan(&machine, program).to_json()).unwrap();
    folder
}

const CALL: [&str; 7] = ["simulate", "--plan", "plan.json", "--machine", "swivel-head", "--out", "out.log"];

#[test]
fn logs_come_in_the_form_that_was_asked_for() {
    let folder = folder("swivel-head", "head");
    let scenario = "seed = 1\n[effects.paper-head]\na_BZ = 0.015\n[noise]\ntouch_um = 1.0\n";
    std::fs::write(folder.path().join("s.toml"), scenario).unwrap();
    let read = || std::fs::read_to_string(folder.path().join("out.log")).unwrap();
    let csv = ["--scenario", "s.toml", "--controller", "csv"];
    axiscal(folder.path())
        .args(CALL)
        .args(csv)
        .assert()
        .success()
        .stdout(predicate::str::contains("202 touches, 0 misses"));
    let first = read();
    assert_eq!(first.lines().count(), 203);
    assert!(first.starts_with("id,X,Y,Z,B,C,time_s,status\n1,"));
    axiscal(folder.path()).args(CALL).arg("--force").args(csv).assert().success();
    assert_eq!(read(), first, "the same seed gives the same log");
    let answer = axiscal(folder.path())
        .args(CALL)
        .arg("--force")
        .args(csv)
        .arg("--json")
        .assert()
        .success()
        .get_output()
        .stdout
        .clone();
    let answer: serde_json::Value = serde_json::from_slice(&answer).unwrap();
    assert_eq!(answer["touches"], 202);
    assert_eq!(answer["planted"][0]["parameter"], "EA0B");
    axiscal(folder.path()).args(CALL).arg("--force").args(["--controller", "linuxcnc"]).assert().success();
    assert!(read().starts_with("H AXISCAL 1 LINUXCNC SWIVEL-HEAD HEAD "));
}

#[test]
fn what_cannot_be_used_is_said_and_nothing_is_written() {
    let folder = folder("swivel-head", "head");
    let file = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).unwrap();
    file("bad.toml", "[effects.paper-head]\na_BZ = \"much\"\n[noise]\ntouch_um = -1\n");
    file("binary.toml", "\u{0}\u{1}");
    std::fs::create_dir(folder.path().join("comp")).unwrap();
    file("comp/compensation.json", "{}");
    let tries: [(&[&str], &str); 6] = [
        (&["--scenario", "bad.toml"], "bad.toml:4:12: error: touch_um is -1, expected 0 or more"),
        (&["--scenario", "binary.toml"], "binary.toml"),
        (&["--scenario", "none.toml"], "cannot read none.toml"),
        (&["--controller", "nobody"], "no controller is called \"nobody\""),
        (&["--compensation", "comp"], "compensation.json"),
        (&["--compensation", "nowhere"], "cannot read nowhere"),
    ];
    for (arguments, message) in tries {
        let run = axiscal(folder.path()).args(CALL).args(arguments).assert().code(2);
        run.stderr(predicate::str::contains(message));
        assert!(!folder.path().join("out.log").exists());
    }
    axiscal(folder.path())
        .args(["simulate", "--plan", "plan.json", "--machine", "trunnion", "--out", "out.log"])
        .assert()
        .code(2)
        .stderr(predicate::str::contains("trunnion"));
}

#[test]
fn a_block_that_is_not_there_gives_misses_and_a_warning() {
    let folder = folder("swivel-head", "head");
    let scenario = "[[block]]\nmounting = \"head\"\nname = \"x-\"\nshift = [0, 0, -50]\n";
    std::fs::write(folder.path().join("s.toml"), scenario).unwrap();
    axiscal(folder.path())
        .args(CALL)
        .args(["--scenario", "s.toml", "--controller", "csv"])
        .assert()
        .success()
        .stderr(predicate::str::contains("the search ended without contact: touch 1, 2,"));
    assert!(std::fs::read_to_string(folder.path().join("out.log")).unwrap().contains(",miss\n"));
}

#[test]
fn nothing_that_exists_is_lost() {
    let folder = folder("swivel-head", "head");
    std::fs::write(folder.path().join("out.log"), "measured").unwrap();
    axiscal(folder.path()).args(CALL).assert().code(2).stderr(predicate::str::contains("out.log exists"));
    assert_eq!(std::fs::read_to_string(folder.path().join("out.log")).unwrap(), "measured");
    let plan = std::fs::read(folder.path().join("plan.json")).unwrap();
    let over = ["simulate", "--plan", "plan.json", "--machine", "swivel-head", "--out", "./plan.json", "--force"];
    axiscal(folder.path()).args(over).assert().code(2).stderr(predicate::str::contains("which is read here"));
    assert_eq!(std::fs::read(folder.path().join("plan.json")).unwrap(), plan);
    axiscal(folder.path()).args(CALL).arg("--force").assert().success();
}
