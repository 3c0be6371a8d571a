//! The corpus of logs: what is good is read, what is damaged is said with its place. One line of a table per file.
// a panic in a test is a failure with its place
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use axiscal::diag::{Finding, Severity, source};
use axiscal::log::{self, Status, Writer};
use axiscal::machine::{self, Machine};
use axiscal::post::Postprocessor;
use axiscal::program::plan::Plan;
use std::path::Path;

/// What must come out of a file.
struct Case {
    file: &'static str,
    /// Touches that can be used: `1 2 3`, `2!` for a miss; `None` when the file is refused (exit code 2).
    touches: Option<&'static str>,
    /// Findings in order: `code line:column`, `code` where there is no place.
    findings: &'static [&'static str],
    /// Words that one of the messages holds.
    says: &'static str,
}

const fn case(
    file: &'static str,
    touches: Option<&'static str>,
    findings: &'static [&'static str],
    says: &'static str,
) -> Case {
    Case { file, touches, findings, says }
}

include!("logs/expected.rs");

fn folder() -> &'static Path {
    Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/logs"))
}

fn shown(finding: &Finding, file: &str) -> String {
    let place = finding.place().map(|p| p.strip_prefix(file).map_or(p.clone(), |rest| rest[1..].to_owned()));
    // an empty file has no text to point into: the place stands in the message
    let place = place.or_else(|| finding.message.starts_with(&format!("{file}:1:1")).then(|| "1:1".to_owned()));
    place.map_or_else(|| finding.code.to_owned(), |place| format!("{} {place}", finding.code))
}

fn check(case: &Case, machine: &Machine, plan: &Plan, post: &Postprocessor) -> Result<(), String> {
    let bytes = std::fs::read(folder().join(case.file)).map_err(|e| format!("{}: {e}", case.file))?;
    let writer = if case.file.ends_with(".csv") { Writer::Csv } else { Writer::Controller(post) };
    let (touches, findings) = match log::read(&bytes, case.file, writer, machine, plan) {
        Ok((read, findings)) => {
            let one = |t: &log::Touch| format!("{}{}", t.id, if t.status == Status::Miss { "!" } else { "" });
            (Some(read.touches.iter().map(one).collect::<Vec<_>>().join(" ")), findings.0)
        }
        Err(failure) => (None, failure.0),
    };
    let found: Vec<String> = findings.iter().map(|f| shown(f, case.file)).collect();
    let says = findings.iter().any(|f| f.message.contains(case.says)) || (findings.is_empty() && case.says.is_empty());
    let refused = findings.iter().any(|f| f.severity == Severity::Error);
    let remedied = findings.iter().filter(|f| f.severity == Severity::Error).all(|f| f.help.is_some());
    if touches.as_deref() == case.touches && found == case.findings && says && refused == touches.is_none() && remedied
    {
        return Ok(());
    }
    let messages: Vec<&str> = findings.iter().map(|f| f.message.as_str()).collect();
    Err(format!("    case({:?}, {touches:?}, &{found:?}, {:?}),\n        // {messages:?}", case.file, case.says))
}

#[test]
fn every_log_of_the_corpus_gives_what_is_expected() {
    let (machines, _) = machine::load(&source("machines.toml", machine::BUILT_IN)).expect("shipped");
    let machine = machines.iter().find(|m| m.name == "swivel-head").expect("shipped");
    let text = std::fs::read_to_string(folder().join("t.plan.json")).expect("the corpus's plan");
    let (plan, _) = Plan::parse(&source("t.plan.json", text)).expect("a plan");
    let post = Postprocessor::load_built_in_or_file("linuxcnc").expect("shipped").0;
    let wrong: Vec<String> = CASES.iter().filter_map(|c| check(c, machine, &plan, &post).err()).collect();
    assert!(wrong.is_empty(), "{} of {} files give something else:\n{}", wrong.len(), CASES.len(), wrong.join("\n"));
    for kind in ["good", "bad"] {
        for entry in std::fs::read_dir(folder().join(kind)).expect("the corpus") {
            let name = format!("{kind}/{}", entry.expect("an entry").file_name().to_string_lossy());
            assert!(CASES.iter().any(|c| c.file == name), "{name} stands in no line of tests/logs/expected.rs");
        }
    }
}
