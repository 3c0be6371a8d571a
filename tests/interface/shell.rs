//! Completions and manual pages: of every verb, for every shell, and the same bytes every time.

use assert_cmd::Command;

fn axiscal(args: &[&str]) -> std::process::Output {
    Command::cargo_bin("axiscal").unwrap().args(args).output().unwrap()
}

/// The verbs as `--help` lists them.
fn verbs() -> Vec<String> {
    let help = String::from_utf8(axiscal(&["--help"]).stdout).unwrap();
    let list = help.split("Commands:").nth(1).unwrap().split("Options:").next().unwrap();
    let first = |line: &str| line.starts_with("  ") && !line.starts_with("   ");
    let word = |line: &str| line.split_whitespace().next().unwrap().to_owned();
    list.lines().filter(|l| first(l)).map(word).filter(|v| v != "help").collect()
}

#[test]
fn completions_know_every_verb_in_every_shell() {
    let verbs = verbs();
    assert!(verbs.len() > 20 && verbs.iter().any(|v| v == "plan-next"), "{verbs:?}");
    for shell in ["bash", "zsh", "fish", "powershell", "elvish"] {
        let out = axiscal(&["completions", shell]);
        assert!(out.status.success(), "{shell}");
        let script = String::from_utf8(out.stdout.clone()).unwrap();
        for verb in &verbs {
            assert!(script.contains(verb.as_str()), "{shell}: {verb}");
        }
        assert!(script.contains("--json") || script.contains("-l json"), "{shell}");
        assert_eq!(out.stdout, axiscal(&["completions", shell]).stdout);
    }
    // bash is there wherever this runs: it reads the script without a word
    let file = tempfile::NamedTempFile::new().unwrap();
    std::fs::write(file.path(), axiscal(&["completions", "bash"]).stdout).unwrap();
    let read = std::process::Command::new("bash").arg("-n").arg(file.path()).output().unwrap();
    assert!(read.status.success() && read.stderr.is_empty(), "{}", String::from_utf8_lossy(&read.stderr));
    assert_eq!(axiscal(&["completions", "csh"]).status.code(), Some(2));
    assert_eq!(axiscal(&["completions"]).status.code(), Some(2));
}

#[test]
fn every_verb_has_a_manual_page() {
    let dir = tempfile::tempdir().unwrap();
    let out = dir.path().join("man");
    let said = axiscal(&["man", "--out", out.to_str().unwrap(), "--json"]);
    assert!(said.status.success(), "{}", String::from_utf8_lossy(&said.stderr));
    let answer: serde_json::Value = serde_json::from_slice(&said.stdout).unwrap();
    let verbs = verbs();
    assert_eq!(answer["pages"].as_array().unwrap().len(), verbs.len() + 1);
    let read = |name: &str| std::fs::read_to_string(out.join(name)).unwrap();
    let program = read("axiscal.1");
    for verb in &verbs {
        let page = read(&format!("axiscal-{verb}.1"));
        assert!(page.contains(".TH") && page.contains(".SH SYNOPSIS") && page.contains("json"), "{page}");
        assert!(program.contains(&verb.replace('-', "\\-")), "{verb} in {program}");
    }
    assert!(read("axiscal-plan-next.1").contains("minutes"));
    // no date, no clock: the same bytes again
    let before = program.clone();
    assert!(axiscal(&["man", "--out", out.to_str().unwrap()]).status.success());
    assert_eq!(before, read("axiscal.1"));
    // a file in place of the folder
    let file = dir.path().join("file");
    std::fs::write(&file, "x").unwrap();
    let bad = axiscal(&["man", "--out", file.to_str().unwrap()]);
    assert_eq!(bad.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&bad.stderr).contains("file"));
}
