//! The verbs from outside, on the paper's machine at LinuxCNC: programs touched under a scenario, and their study.

use assert_cmd::Command;
use serde_json::Value;
use std::path::Path;

pub fn axiscal(folder: &Path, args: &[&str]) -> std::process::Output {
    Command::cargo_bin("axiscal").unwrap().current_dir(folder).env_remove("COLUMNS").args(args).output().unwrap()
}

pub fn ok(folder: &Path, args: &[&str]) -> String {
    let out = axiscal(folder, args);
    assert!(out.status.success(), "{args:?}: {}", String::from_utf8_lossy(&out.stderr));
    String::from_utf8(out.stdout).unwrap()
}

/// One JSON object on stdout and the exit code.
pub fn json(folder: &Path, args: &[&str]) -> (Value, i32) {
    let out = axiscal(folder, &[args, &["--json"]].concat());
    let read = serde_json::from_slice(&out.stdout);
    (
        read.unwrap_or_else(|e| panic!("{args:?}: {e}: {}", String::from_utf8_lossy(&out.stderr))),
        out.status.code().unwrap(),
    )
}

pub const COMMON: [&str; 5] = ["--machine", "swivel-head", "--controller", "linuxcnc", "--out"];

/// Programs touched under a scenario.
pub fn touched(programs: &[&str], scenario: &str, effects: Option<&str>) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    std::fs::write(at.join("wrong.toml"), scenario).unwrap();
    if let Some(text) = effects {
        std::fs::write(at.join("own.toml"), text).unwrap();
    }
    for p in programs {
        let (plan, log) = (format!("{p}.plan.json"), format!("{p}.log"));
        ok(at, &[&["generate", "--program", p][..], &COMMON, &["."]].concat());
        ok(at, &[&["simulate", "--plan", &plan, "--scenario", "wrong.toml"][..], &COMMON, &[&log]].concat());
    }
    folder
}

/// Their study.
pub fn study(at: &Path, programs: &[&str]) {
    let mut new = vec!["new".to_owned()];
    for p in programs {
        new.extend(["--plan".to_owned(), format!("{p}.plan.json"), "--log".to_owned(), format!("{p}.log")]);
    }
    let words: Vec<&str> = new.iter().map(String::as_str).collect();
    ok(at, &[&words[..], &COMMON, &["study.toml"]].concat());
}

/// Programs touched under a scenario, and their study.
pub fn folder(programs: &[&str], scenario: &str, effects: Option<&str>) -> tempfile::TempDir {
    let folder = touched(programs, scenario, effects);
    study(folder.path(), programs);
    folder
}
