//! Whole screens as a person reads them, in `snapshots/`. After a change of words `INSTA_UPDATE=always cargo test --test interface
//! screens` renews them, and the difference is reviewed.

use super::terminal::{axiscal, copy, folder};
use std::path::Path;

/// What a call prints, with its exit code.
fn screen(at: &Path, args: &[&str]) -> String {
    let out = axiscal(at, Some("100"), args);
    let text = |bytes: &[u8]| String::from_utf8(bytes.to_vec()).unwrap();
    let mut screen = format!("$ axiscal {}\n{}", args.join(" "), text(&out.stdout));
    if !out.stderr.is_empty() {
        screen += &format!("--- stderr\n{}", text(&out.stderr));
    }
    screen += &format!("--- exit code {}\n", out.status.code().unwrap());
    let lines: Vec<&str> = screen.lines().map(str::trim_end).collect();
    lines.join("\n").replace(env!("CARGO_PKG_VERSION"), "VERSION").replace(&at.display().to_string(), "FOLDER")
}

#[test]
fn a_model_that_lacks_an_effect() {
    insta::assert_snapshot!("identify", screen(folder(), &["identify", "study.toml"]));
    insta::assert_snapshot!("identify_verbose", screen(folder(), &["identify", "study.toml", "--verbose"]));
    insta::assert_snapshot!("compare", screen(folder(), &["compare", "study.toml"]));
    insta::assert_snapshot!("diagnose", screen(folder(), &["diagnose", "study.toml"]));
    insta::assert_snapshot!("diagnose_verbose", screen(folder(), &["diagnose", "study.toml", "--verbose"]));
}

#[test]
fn the_loop_to_its_end() {
    let folder = copy();
    let at = folder.path();
    insta::assert_snapshot!("solve", screen(at, &["solve", "study.toml", "--yes"]));
    insta::assert_snapshot!("diagnose_complete", screen(at, &["diagnose", "study.toml"]));
    insta::assert_snapshot!("history", screen(at, &["history", "study.toml", "--ascii"]));
    let export = ["export", "study.toml", "--controller", "linuxcnc", "--out", "compensation"];
    insta::assert_snapshot!("export", screen(at, &export));
}

#[test]
fn before_and_between_the_measurements() {
    let folder = copy();
    let at = folder.path();
    let machine = ["--machine", "swivel-head"];
    let assess = [&["assess", "--plan", "head.plan.json"][..], &machine].concat();
    insta::assert_snapshot!("assess", screen(at, &assess));
    let check = [&["check", "head.ngc", "--plan", "head.plan.json", "--controller", "linuxcnc"][..], &machine].concat();
    insta::assert_snapshot!("check", screen(at, &check));
    let next = ["plan-next", "study.toml", "--out", "next", "--controller", "linuxcnc", "--minutes", "4"];
    let asked = [&next[..], &["--effects", "radial-c-1,radial-c-3"]].concat();
    insta::assert_snapshot!("plan_next", screen(at, &asked));
}

#[test]
fn a_mistake_in_a_log() {
    let folder = copy();
    let at = folder.path();
    let log = std::fs::read_to_string(at.join("study-head.log")).unwrap();
    std::fs::write(at.join("study-head.log"), log.replacen(" X", " X--", 3)).unwrap();
    insta::assert_snapshot!("log_with_a_mistake", screen(at, &["identify", "study.toml"]));
}

#[test]
fn help_texts() {
    insta::assert_snapshot!("help", screen(folder(), &["help"]));
    insta::assert_snapshot!("help_of_diagnose", screen(folder(), &["diagnose", "--help"]));
}
