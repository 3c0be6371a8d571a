//! Files with very many mistakes: read in a time that grows with their length, and the first mistakes named with the count of the others.

use crate::common;
use common::verbs::{COMMON, json, ok};
use serde_json::Value;
use std::fmt::Write as _;
use std::path::Path;
use std::time::{Duration, Instant};

const MANY: usize = 40_000;

fn lines(of: impl Fn(usize) -> String) -> String {
    (1..=MANY).fold(String::new(), |mut text, i| {
        writeln!(text, "{}", of(i)).unwrap();
        text
    })
}

fn keys() -> String {
    lines(|i| format!("k{i} = 1"))
}

/// What the call answers: 20 findings of the code from the first line on, and the count of the others. It took 28 s once.
fn refused(at: &Path, call: &[&str], code: &str, first_line: usize) {
    let begun = Instant::now();
    let (answer, exit) = json(at, call);
    let time = begun.elapsed();
    assert_eq!(exit, 2, "{call:?}");
    let findings = answer["findings"].as_array().unwrap();
    let of = |code: &str| findings.iter().filter(|f| f["code"] == code).collect::<Vec<&Value>>();
    assert_eq!(of(code).len(), 20, "{call:?}: {findings:?}");
    assert_eq!(of(code)[0]["line"], first_line, "{call:?}");
    let more = of("diag::more");
    assert!(more.len() == 1 && more[0]["says"].as_str().unwrap().starts_with("39980 more"), "{more:?}");
    assert!(time < Duration::from_secs(8), "{call:?}: {time:?}");
    println!("{call:?}: {time:?}");
}

#[test]
fn many_unknown_keys_are_named_and_counted_at_once() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    ok(at, &[&["generate", "--program", "table"][..], &COMMON, &["."]].concat());
    let write = |name: &str, text: String| std::fs::write(at.join(name), text).unwrap();
    let simulate = [
        "simulate",
        "--plan",
        "table.plan.json",
        "--machine",
        "swivel-head",
        "--scenario",
        "s.toml",
        "--controller",
        "linuxcnc",
        "--out",
        "x.log",
    ];
    write("s.toml", format!("seed = 1\n{}", keys()));
    refused(at, &simulate, "scenario::unknown", 2);
    write("s.toml", format!("seed = 1\n{}", lines(|i| format!("[effects.no-{i}]\np = 1"))));
    refused(at, &simulate, "scenario::effect", 2);
    write("s.toml", format!("[effects.location-b]\n{}", keys()));
    refused(at, &simulate, "scenario::parameter", 2);
    write("fx.toml", keys());
    write("s.toml", "effects_file = [\"fx.toml\"]\n".to_owned());
    refused(at, &simulate, "effects::not_toml", 1);

    write("study.toml", keys());
    refused(at, &["identify", "study.toml"], "study::not_toml", 1);
    refused(at, &["effects", "--effects-file", "fx.toml"], "effects::not_toml", 1);
    write("m.toml", format!("format = \"axiscal-machines/1\"\n{}", keys()));
    refused(at, &["machines", "--machines", "m.toml"], "machine::not_toml", 2);

    let names: Vec<String> = (1..=MANY).map(|i| format!("\"no-{i}\"")).collect();
    let data = "[[data]]\nplan = \"table.plan.json\"\nlog = \"x.log\"\ncontroller = \"linuxcnc\"\n";
    write("study.toml", format!("machine = \"swivel-head\"\n{data}[model]\neffects = [\n{}\n]\n", names.join(",\n")));
    refused(at, &["identify", "study.toml"], "model::unknown_effect", 8);
}
