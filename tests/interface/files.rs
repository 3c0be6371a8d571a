//! Files through the binary: no output over an input, one writer at a time, exports whole, inputs that are no files.
#![cfg(unix)] // links of both kinds, devices, pipes

use crate::common::verbs;

use std::io::Write;
use std::path::Path;
use std::process::{Command, Stdio};
use std::sync::OnceLock;
use verbs::{json, ok};

const WRONG: &str = "seed = 3\n[effects.location-b]\nEX0B = 0.02\n[noise]\ntouch_um = 0.5\n";

/// A copy of a measured machine with its study.
fn folder() -> tempfile::TempDir {
    static MADE: OnceLock<tempfile::TempDir> = OnceLock::new();
    let made = MADE.get_or_init(|| {
        let made = verbs::touched(&["head"], WRONG, None);
        let new = ["new", "--plan", "head.plan.json", "--log", "head.log", "--effects", "location-b,pretravel"];
        ok(made.path(), &[&new[..], &["--known-blocks"], &verbs::COMMON, &["study.toml"]].concat());
        made
    });
    let dir = tempfile::tempdir().unwrap();
    for name in ["head.plan.json", "head.log", "study.toml", "wrong.toml"] {
        std::fs::copy(made.path().join(name), dir.path().join(name)).unwrap();
    }
    dir
}

/// The code of the finding that ends a call.
fn refused(at: &Path, args: &[&str]) -> String {
    let (answer, code) = json(at, args);
    assert_eq!(code, 2, "{args:?}: {answer}");
    answer["findings"][0]["code"].as_str().unwrap().to_owned()
}

fn text(at: &Path, name: &str) -> String {
    std::fs::read_to_string(at.join(name)).unwrap()
}

const PARSE: [&str; 6] = ["parse", "head.log", "--controller", "linuxcnc", "--plan", "head.plan.json"];
const EXPORT: [&str; 5] = ["export", "study.toml", "--controller", "linuxcnc", "--out"];

#[test]
fn no_output_takes_the_place_of_an_input() {
    let dir = folder();
    let at = dir.path();
    std::os::unix::fs::symlink("head.log", at.join("soft.csv")).unwrap();
    std::fs::hard_link(at.join("head.log"), at.join("hard.csv")).unwrap();
    let inputs = ["head.plan.json", "head.log", "study.toml", "wrong.toml"];
    let before = inputs.map(|name| text(at, name));
    let absolute = at.join("head.log").display().to_string();
    for out in ["head.log", "./head.log", "new/../head.log", &absolute, "soft.csv", "hard.csv", "head.plan.json"] {
        assert_eq!(refused(at, &[&PARSE[..], &["--out", out]].concat()), "file::is_input", "{out}");
    }
    for call in [
        &["report", "study.toml", "--out", "study.toml"][..],
        &["report", "study.toml", "--out", "new.html", "--view", "head.log"],
        &["compare", "study.toml", "--csv", "study.toml"],
        &["compare", "study.toml", "--csv", "head.plan.json"],
        &["sketch-effect", "study.toml", "--out", "head.log"],
        &[
            "simulate",
            "--plan",
            "head.plan.json",
            "--machine",
            "swivel-head",
            "--scenario",
            "wrong.toml",
            "--force",
            "--out",
            "wrong.toml",
        ],
    ] {
        let code = refused(at, call);
        // a file that is added to must be one of effects
        assert!(code == "file::is_input" || call[0] == "sketch-effect", "{call:?}: {code}");
    }
    // what cannot be written all is not written at all
    assert!(!at.join("new.html").exists());
    assert_eq!(inputs.map(|name| text(at, name)), before);
    // a file of a folder counts as well
    ok(at, &["report", "study.toml", "--out", "new.html", "--plots", "plots"]);
    let plot = std::fs::read_dir(at.join("plots")).unwrap().next().unwrap().unwrap().path();
    std::fs::remove_file(&plot).unwrap();
    std::fs::hard_link(at.join("head.log"), &plot).unwrap();
    assert_eq!(refused(at, &["report", "study.toml", "--out", "new.html", "--plots", "plots"]), "file::is_input");
    assert_eq!(text(at, "head.log"), before[1]);
}

#[test]
fn two_outputs_are_two_files() {
    let dir = folder();
    let at = dir.path();
    for view in ["x.html", "./x.html", "new/../x.html"] {
        assert_eq!(refused(at, &["report", "study.toml", "--out", "x.html", "--view", view]), "file::same_output");
    }
    assert!(!at.join("x.html").exists());
}

#[test]
fn nothing_takes_the_place_of_the_history_and_links_are_followed() {
    let dir = folder();
    let at = dir.path();
    ok(at, &["add", "study.toml", "squareness-xy"]);
    let history = text(at, "study.history.json");
    assert_eq!(refused(at, &["compare", "study.toml", "--csv", "study.history.json"]), "file::is_input");
    assert_eq!(text(at, "study.history.json"), history);
    std::os::unix::fs::symlink("there.csv", at.join("soft.csv")).unwrap();
    std::os::unix::fs::symlink("loop", at.join("loop")).unwrap();
    ok(at, &[&PARSE[..], &["--out", "soft.csv"]].concat());
    assert!(at.join("soft.csv").is_symlink() && at.join("there.csv").is_file());
    assert_eq!(refused(at, &[&PARSE[..], &["--out", "loop"]].concat()), "file::unwritable");
    assert!(at.join("loop").is_symlink());
}

#[test]
fn a_call_that_reads_a_study_removes_what_a_killed_one_left() {
    let dir = folder();
    let at = dir.path();
    let mut child = Command::new("true").spawn().unwrap();
    child.wait().unwrap();
    let left = at.join(format!(".axiscal-tmp-{}-abc123", child.id()));
    std::fs::write(&left, "").unwrap();
    ok(at, &["identify", "study.toml"]);
    assert!(!left.exists());
}

#[test]
fn devices_serve_as_input_and_output() {
    let dir = folder();
    let at = dir.path();
    ok(at, &[&PARSE[..], &["--out", "/dev/null"]].concat());
    ok(at, &["report", "study.toml", "--out", "/dev/null", "--view", "/dev/null"]);
    let parse = |max: &str| {
        let mut words = PARSE;
        words[1] = "/dev/stdin";
        let mut command = Command::new(env!("CARGO_BIN_EXE_axiscal"));
        command.current_dir(at).args(words).args(["--json", "--max-input", max]);
        let mut child = command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::null()).spawn().unwrap();
        let mut pipe = child.stdin.take().unwrap();
        let log = std::fs::read(at.join("head.log")).unwrap();
        // a reader that has had enough may close first
        let writing = std::thread::spawn(move || drop(pipe.write_all(&log)));
        let out = child.wait_with_output().unwrap();
        writing.join().unwrap();
        let answer: serde_json::Value = serde_json::from_slice(&out.stdout).unwrap();
        (out.status.code().unwrap(), answer["findings"][0]["code"].as_str().unwrap_or_default().to_owned())
    };
    assert_eq!(parse("2G").0, 0);
    // the plan is larger than that as well: the stream is the one that is refused with enough for the plan
    let plan = std::fs::metadata(at.join("head.plan.json")).unwrap().len();
    let mut log = std::fs::read(at.join("head.log")).unwrap();
    let part = log.clone();
    while (log.len() as u64) < plan + 2 {
        log.extend(&part);
    }
    std::fs::write(at.join("head.log"), log).unwrap();
    assert_eq!(parse(&(plan + 1).to_string()), (2, "file::too_large".to_owned()));
}

#[test]
fn what_is_no_file_or_too_large_is_refused_unread() {
    let dir = folder();
    let at = dir.path();
    assert!(Command::new("mkfifo").arg(at.join("pipe")).status().unwrap().success());
    let parse = |log: &str, more: &[&str]| {
        let mut words = PARSE;
        words[1] = log;
        refused(at, &[&words[..], more].concat())
    };
    for log in ["pipe", "/dev/zero", "."] {
        assert_eq!(parse(log, &[]), "file::no_file", "{log}");
    }
    std::fs::File::create(at.join("huge.log")).unwrap().set_len(3 << 30).unwrap();
    assert_eq!(parse("huge.log", &[]), "file::too_large");
    assert_eq!(parse("head.log", &["--max-input", "1K"]), "file::too_large");
    assert_eq!(refused(at, &["identify", "study.toml", "--max-input", "100"]), "file::too_large");
    ok(at, &["--max-input", "1G", "identify", "study.toml"]);
}

#[test]
fn an_export_replaces_its_own_files_alone() {
    let dir = folder();
    let at = dir.path();
    ok(at, &[&EXPORT[..], &["comp"]].concat());
    let comp = at.join("comp");
    let own = ["axiscal-notes.txt", "restore-notes.md", "axiscal.hal.bak"];
    own.iter().for_each(|name| std::fs::write(comp.join(name), "mine").unwrap());
    let restoring = text(&comp, "restore.hal");
    std::fs::write(comp.join("restore.hal"), restoring.clone() + "setp another.pin 1\n").unwrap();
    ok(at, &["add", "study.toml", "squareness-xy"]);
    ok(at, &[&EXPORT[..], &["comp", "--force"]].concat());
    own.iter().for_each(|name| assert_eq!(text(&comp, name), "mine"));
    assert!(text(&comp, "restore.hal.earlier-1").contains("another.pin"));
    // from within, where the folder cannot be exchanged
    let stale = comp.join("axiscal_stale.txt");
    std::fs::write(&stale, "").unwrap();
    let list =
        text(&comp, ".axiscal-files.json").replacen("\"axiscal.hal\"", "\"axiscal.hal\", \"axiscal_stale.txt\"", 1);
    std::fs::write(comp.join(".axiscal-files.json"), list).unwrap();
    ok(&comp, &["export", "../study.toml", "--controller", "linuxcnc", "--force", "--out", "."]);
    assert!(!stale.exists() && comp.join("compensation.json").exists());
    own.iter().for_each(|name| assert_eq!(text(&comp, name), "mine"));
    // interrupted there: no compensation for any reader, and the next export ends it
    std::fs::remove_file(comp.join("compensation.json")).unwrap();
    ok(at, &[&EXPORT[..], &["comp", "--force"]].concat());
    let hidden = |at: &Path| {
        let names = std::fs::read_dir(at).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap());
        names.filter(|name| name.starts_with('.')).collect::<Vec<_>>()
    };
    assert_eq!((hidden(at), hidden(&comp)), (Vec::new(), vec![".axiscal-files.json".to_owned()]));
    // the tables of another control are not touched
    let before = text(&comp, "axiscal.hal");
    let other =
        ["export", "study.toml", "--controller", "sinumerik", "--accept-unverified", "--force", "--out", "comp"];
    assert_eq!(refused(at, &other), "export::other_controller");
    assert_eq!(text(&comp, "axiscal.hal"), before);
}

/// Not even the super-user can make a folder in `/sys`.
#[test]
#[cfg(target_os = "linux")]
fn an_export_says_why_its_folder_cannot_be_made() {
    let dir = folder();
    let (answer, code) = json(dir.path(), &[&EXPORT[..], &["/sys/axiscal-export"]].concat());
    let findings = answer["findings"].as_array().unwrap();
    let finding = findings.iter().find(|f| f["code"] == "file::unwritable").unwrap();
    let (says, help) = (finding["says"].as_str().unwrap(), finding["help"].as_str().unwrap());
    assert_eq!(code, 2);
    assert!(says.starts_with("cannot write /sys/axiscal-export: ") && !says.contains("No such file"), "{says}");
    assert!(!help.contains("every part of the path"), "{help}");
}

#[test]
fn a_study_that_another_process_changes_is_not_changed() {
    let dir = folder();
    let at = dir.path();
    let before = text(at, "study.toml");
    let held = std::fs::File::create(at.join(".study.toml.lock")).unwrap();
    held.lock().unwrap();
    assert_eq!(refused(at, &["add", "study.toml", "squareness-xy"]), "file::busy");
    // who only looks does not wait
    ok(at, &["identify", "study.toml"]);
    ok(at, &["add", "study.toml", "squareness-xy", "--dry-run"]);
    assert_eq!(text(at, "study.toml"), before);
    drop(held);
    ok(at, &["add", "study.toml", "squareness-xy"]);
    assert!(!at.join(".study.toml.lock").exists());
}

/// A fault that the system provokes: threads that cannot be had.
#[cfg(target_os = "linux")]
#[test]
fn a_fault_of_the_program_is_one_line_and_one_finding() {
    let dir = folder();
    let call = |words: &[&str]| {
        let limited = "ulimit -v 4000000; exec \"$0\" \"$@\"";
        let mut command = Command::new("sh");
        command.current_dir(dir.path()).args(["-c", limited, env!("CARGO_BIN_EXE_axiscal")]).args(words);
        // large stacks: when the next one does not fit, there is still memory for the message
        command.env("RUST_MIN_STACK", "1000000000").env("RAYON_NUM_THREADS", "2000").output().unwrap()
    };
    let before = text(dir.path(), "study.toml");
    for words in [&["compare", "study.toml", "--csv", "new.csv"][..], &["add", "study.toml", "squareness-xy"]] {
        let out = call(&[&["--json"], words].concat());
        let said = String::from_utf8_lossy(&out.stderr).into_owned();
        let answer: serde_json::Value = serde_json::from_slice(&out.stdout).unwrap_or_else(|e| panic!("{e}: {said}"));
        assert_eq!(
            (out.status.code(), answer["findings"][0]["code"].as_str()),
            (Some(2), Some("internal::panic")),
            "{said}"
        );
        assert_eq!(said.lines().count(), 1, "{said}");
        assert!(said.contains(words[0]) && said.contains(".rs:"), "{said}");
    }
    assert_eq!(text(dir.path(), "study.toml"), before);
    assert!(!dir.path().join(".study.toml.lock").exists());
}
