//! The corpus of logs: what is good is read, what is damaged is said with its place. One line of a table per file.

use axiscal::diag::{Finding, Severity, source};
use axiscal::log::{self, Reader, Status, Writer};
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

include!("../logs/expected.rs");

fn folder() -> &'static Path {
    Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/logs"))
}

fn shown(finding: &Finding, file: &str) -> String {
    let place = finding.place().map(|p| p.strip_prefix(file).map_or(p.clone(), |rest| rest[1..].to_owned()));
    // an empty file has no text to point into: the place stands in the message
    let place = place.or_else(|| finding.message.starts_with(&format!("{file}:1:1")).then(|| "1:1".to_owned()));
    place.map_or_else(|| finding.code.to_owned(), |place| format!("{} {place}", finding.code))
}

/// Without the remark that an earlier version wrote the program: the heads of the whole corpus are of one.
fn without_older(mut findings: Vec<Finding>) -> Vec<Finding> {
    findings.retain(|f| f.code != "log::older");
    findings
}

fn check(case: &Case, machine: &Machine, plan: &Plan, post: &Postprocessor) -> Result<(), String> {
    let bytes = std::fs::read(folder().join(case.file)).map_err(|e| format!("{}: {e}", case.file))?;
    let writer = if case.file.ends_with(".csv") { Writer::Csv } else { Writer::Controller(post) };
    let (touches, findings) = match log::read(&bytes, case.file, writer, machine, plan) {
        Ok((read, findings)) => {
            let one = |t: &log::Touch| format!("{}{}", t.id, if t.status == Status::Miss { "!" } else { "" });
            let usable = read.touches.iter().filter(|t| t.status != Status::Elsewhere);
            (Some(usable.map(one).collect::<Vec<_>>().join(" ")), findings.0)
        }
        Err(failure) => (None, failure.0),
    };
    let findings = without_older(findings);
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

/// The machine, the plan and the postprocessor of the corpus.
fn with_corpus<T>(with: impl FnOnce(&Machine, &Plan) -> T) -> T {
    let (machines, _) = machine::load(&source("machines.toml", machine::BUILT_IN)).expect("shipped");
    let machine = machines.iter().find(|m| m.name == "swivel-head").expect("shipped");
    let text = std::fs::read_to_string(folder().join("t.plan.json")).expect("the corpus's plan");
    let (plan, _) = Plan::parse(&source("t.plan.json", text)).expect("a plan");
    with(machine, &plan)
}

#[test]
fn every_log_of_the_corpus_gives_what_is_expected() {
    let post = Postprocessor::load_built_in_or_file("linuxcnc").expect("shipped").0;
    let wrong: Vec<String> =
        with_corpus(|machine, plan| CASES.iter().filter_map(|c| check(c, machine, plan, &post).err()).collect());
    assert!(wrong.is_empty(), "{} of {} files give something else:\n{}", wrong.len(), CASES.len(), wrong.join("\n"));
}

/// The codes of the findings of a CSV with one column more, and the first message of each. `of` gives the column's text by
/// the number of the row.
fn with_column(column: &str, of: impl Fn(usize) -> String) -> (Vec<&'static str>, Vec<String>) {
    with_corpus(|machine, plan| {
        let mut long = plan.clone();
        let nominal = plan.touches[0].clone();
        long.touches = (0..20).map(|i| timed(&nominal, i)).collect();
        let p = nominal.nominal_position();
        let rows =
            (0..20).map(|i| format!("{},{},{},{},{},{},{}\n", i + 1, p.0[0], p.0[1], p.0[2], p.0[4], p.0[5], of(i)));
        let text = format!("id,X,Y,Z,B,C,{column}\n{}", rows.collect::<String>());
        let findings = match log::read(text.as_bytes(), "t.csv", Writer::Csv, machine, &long) {
            Ok((_, findings)) => findings.0,
            Err(failure) => failure.0,
        };
        let says = findings.iter().map(|f| format!("{f}; {}", f.help.as_deref().unwrap_or_default()));
        (findings.iter().map(|f| f.code).collect(), says.collect())
    })
}

/// The touch of a plan that is made each 4 s.
fn timed(touch: &axiscal::program::plan::PlanTouch, i: usize) -> axiscal::program::plan::PlanTouch {
    axiscal::program::plan::PlanTouch { id: i as u64 + 1, time_s: Some(30.0 + 4.0 * i as f64), ..touch.clone() }
}

#[test]
fn temperatures_of_another_unit_are_warned_of_or_not_used() {
    let with = |of: &dyn Fn(usize) -> f64| with_column("temperature_degC", |i| of(i).to_string());
    assert_eq!(with(&|i| 20.0 + i as f64).0, [] as [&str; 0]);
    let (codes, says) = with(&|i| if i == 0 { 20.0 } else { 68.0 + 0.1 * i as f64 });
    assert_eq!(codes, ["log::temperature"]);
    for word in
        ["t.csv:3:1: ", "outside 0 to 50 °C at 19 touches: 68.1 °C is the first", "are these values in °F or K?"]
    {
        assert!(says[0].contains(word), "{says:?}");
    }
    // in kelvins no line can be used; with one of them the others are
    let (codes, says) = with(&|i| 293.15 + 0.1 * i as f64);
    assert!(codes.contains(&"log::not_understood") && codes.last() == Some(&"log::nothing"), "{codes:?}");
    assert!(says[0].contains("expected a temperature_degC from -50 to 100 °C"), "{says:?}");
    let (codes, says) = with(&|i| if i == 4 { 2000.0 } else { 20.0 });
    assert_eq!(codes, ["log::not_understood", "log::missing"]);
    assert!(says[0].starts_with("t.csv:6:"), "{says:?}");
}

#[test]
fn times_that_run_backward_or_are_no_seconds_are_warned_of() {
    let with = |of: &dyn Fn(f64) -> f64| with_column("time_s", |i| of(7.0 + 4.0 * i as f64).to_string());
    let good: [&dyn Fn(f64) -> f64; 5] = [
        &|t| t,
        &|t| 9.0 * t,
        // the same night and the next morning
        &|t| if t < 30.0 { t } else { t + 50_000.0 },
        // a clock of whole minutes
        &|t| (t / 60.0).floor() * 60.0,
        &|t| 1e9 + t,
    ];
    for (i, of) in good.iter().enumerate() {
        assert_eq!(with(of).0, [] as [&str; 0], "{i}");
    }
    for (factor, unit) in [(1000.0, "milliseconds"), (1.0 / 60.0, "minutes or hours"), (1.0 / 3600.0, "hours")] {
        let (codes, says) = with(&|t| factor * t);
        assert_eq!(codes, ["log::time_unit"], "{factor}");
        assert!(says[0].starts_with("t.csv:2:1: ") && says[0].contains(unit), "{says:?}");
        assert!(says[0].contains("and 76 s by the plan"), "{says:?}");
    }
    let (codes, says) = with(&|t| if t == 27.0 { 5.0 } else { t });
    assert_eq!(codes, ["log::time_backward"]);
    assert!(
        says[0].starts_with("t.csv:7:1: ") && says[0].contains("touch 6 has 5 s, touch 5 before it 23 s"),
        "{says:?}"
    );
    let (codes, says) = with(&|t| 5000.0 - t);
    assert_eq!(codes, ["log::time_backward"]);
    assert!(says[0].contains("this happens 18 more times"), "{says:?}");
    // too few to see it, and a log without times
    assert_eq!(
        with_column("time_s", |i| if i < 4 { (1000 * i).to_string() } else { String::new() }).0,
        [] as [&str; 0]
    );
    assert_eq!(with_column("status", |_| "hit".to_owned()).0, [] as [&str; 0]);
}

#[test]
fn a_log_of_an_earlier_version_is_read_with_a_remark() {
    let post = Postprocessor::load_built_in_or_file("linuxcnc").expect("shipped").0;
    let bytes = std::fs::read(folder().join("good/run.log")).expect("a file");
    with_corpus(|machine, plan| {
        let (read, findings) =
            log::read(&bytes, "good/run.log", Writer::Controller(&post), machine, plan).expect("a log");
        let found: Vec<(&str, Severity)> = findings.0.iter().map(|f| (f.code, f.severity)).collect();
        assert_eq!((read.touches.len(), found), (3, vec![("log::older", Severity::Info)]));
    });
}

/// What `NAME.expect` says: `controller K`, perhaps `run N`, `touches 1 2! 3` or `refused`, then one line for each finding
/// in order, `code line:column words of its message`, `-` where it has no place.
struct Expected {
    controller: String,
    run: Option<usize>,
    touches: Option<String>,
    findings: Vec<[String; 3]>,
}

impl Expected {
    fn read(text: &str) -> Self {
        let mut expected = Self { controller: String::new(), run: None, touches: None, findings: Vec::new() };
        for line in text.lines() {
            let (word, rest) = line.split_once(' ').unwrap_or((line, ""));
            match word {
                "controller" => expected.controller = rest.to_owned(),
                "run" => expected.run = Some(rest.parse().expect("a number")),
                "touches" => expected.touches = Some(rest.to_owned()),
                "refused" => {}
                code => {
                    let (place, words) = rest.split_once(' ').expect("a place and words");
                    expected.findings.push([code, place, words].map(str::to_owned));
                }
            }
        }
        expected
    }

    /// The first thing that is otherwise.
    fn compare(&self, touches: Option<String>, findings: &[Finding], file: &str) -> Result<(), String> {
        let found: Vec<[String; 3]> = findings
            .iter()
            .map(|f| {
                let shown = shown(f, file);
                let (code, place) = shown.split_once(' ').unwrap_or((&shown, "-"));
                [code.to_owned(), place.to_owned(), f.message.clone()]
            })
            .collect();
        let same = |(expected, found): (&[String; 3], &[String; 3])| {
            expected[..2] == found[..2] && found[2].contains(&expected[2])
        };
        let all = self.findings.len() == found.len() && self.findings.iter().zip(&found).all(same);
        let remedied = findings.iter().filter(|f| f.severity == Severity::Error).all(|f| f.help.is_some());
        if all && self.touches == touches && remedied {
            return Ok(());
        }
        Err(format!("{file}\n  expected {:?} {:#?}\n  found    {touches:?} {found:#?}", self.touches, self.findings))
    }
}

#[test]
fn every_file_of_the_corpus_that_says_what_it_gives_gives_it() {
    let mut n_bad = 0;
    let mut wrong = Vec::new();
    with_corpus(|machine, plan| {
        for (kind, entry) in ["good", "bad"].into_iter().flat_map(|kind| {
            let entries = std::fs::read_dir(folder().join(kind)).expect("the corpus");
            entries.map(move |e| (kind, e.expect("an entry").path()))
        }) {
            let file = format!("{kind}/{}", entry.file_name().expect("a name").to_string_lossy());
            if file.ends_with(".expect") || CASES.iter().any(|c| c.file == file) {
                continue;
            }
            let Ok(text) = std::fs::read_to_string(entry.with_extension("expect")) else {
                wrong.push(format!("{file} has no .expect beside it, and no line in tests/logs/expected.rs"));
                continue;
            };
            n_bad += usize::from(kind == "bad");
            let expected = Expected::read(&text);
            let bytes = std::fs::read(&entry).expect("a file");
            let reader = Reader::load(&expected.controller, axiscal::files::read_text).expect("shipped").0;
            let one = |t: &log::Touch| format!("{}{}", t.id, if t.status == Status::Miss { "!" } else { "" });
            let (touches, findings) = match log::read_run(&bytes, &file, reader.writer(), machine, plan, expected.run) {
                Ok((read, findings)) => {
                    let usable = read.touches.iter().filter(|t| t.status != Status::Elsewhere);
                    (Some(usable.map(one).collect::<Vec<_>>().join(" ")), findings.0)
                }
                Err(failure) => (None, failure.0),
            };
            wrong.extend(expected.compare(touches, &without_older(findings), &file).err());
        }
    });
    assert!(wrong.is_empty(), "{} files give something else:\n{}", wrong.len(), wrong.join("\n"));
    assert!(n_bad >= 60, "{n_bad} damaged logs");
}
