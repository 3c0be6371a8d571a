//! A plan and its log belong together: every number of a plan is edited after the log was made. The fit is then the same one (it
//! does not read the number), or the plan or the log is refused with a code.

use crate::common;

use axiscal::diag::{Failure, Finding};
use axiscal::log::Status;
use axiscal::machine::Machine;
use axiscal::post::{LogRecord, Postprocessor};
use axiscal::program::plan::Plan;
use axiscal::program::plan_digest;
use axiscal::simulate::{self, Scenario};
use axiscal::workflow::{Disk, load_plan, load_study};
use common::{machine, plan, verbs};
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::path::PathBuf;

/// A run with its study in a folder.
struct Job {
    folder: tempfile::TempDir,
    machine: Machine,
    plan: Value,
    /// What `identify --quick --json` answers.
    fit: String,
}

/// Whose numbers are edited.
#[derive(Clone, Copy, PartialEq)]
enum Touches {
    /// The first, the middle and the last one of each stage.
    Some,
    All,
}

impl Job {
    /// A program, touched by the virtual machine with errors and noise.
    fn new(machine_name: &str, program: &str) -> Self {
        let machine = machine(machine_name);
        let plan = plan(&machine, program);
        let folder = tempfile::tempdir().unwrap();
        let scenario = Scenario::flawless().with_noise(0.5e-3, 0.0, 7);
        let (raw, _) = simulate::run(&machine, &plan, &scenario, None).unwrap();
        let record = |t: &axiscal::log::RawTouch| {
            assert_eq!(t.status, Status::Hit);
            LogRecord { id: t.id.unwrap(), status: t.status, position: t.position, time_s: t.time_s }
        };
        let records: Vec<LogRecord> = raw.iter().map(record).collect();
        let post = Postprocessor::load_built_in_or_file("linuxcnc").unwrap().0;
        std::fs::write(folder.path().join("run.log"), post.log_text(&machine, &plan, &records)).unwrap();
        std::fs::write(folder.path().join("plan.json"), plan.to_json()).unwrap();
        let locations: Vec<String> =
            machine.rotary().map(|a| format!("\"location-{}\"", a.name.to_string().to_lowercase())).collect();
        let study = format!(
            "machine = {machine_name:?}\n[[data]]\nplan = \"plan.json\"\nlog = \"run.log\"\ncontroller = \"linuxcnc\"\n[model]\n\
             effects = [{}, \"block-setup\", \"pretravel\"]\n",
            locations.join(", ")
        );
        std::fs::write(folder.path().join("study.toml"), study).unwrap();
        let plan = serde_json::from_str(&plan.to_json()).unwrap();
        let mut job = Self { folder, machine, plan, fit: String::new() };
        job.fit = job.identify().unwrap();
        job
    }

    fn plan_file(&self) -> PathBuf {
        self.folder.path().join("plan.json")
    }

    /// As `identify --quick --json` does it.
    fn identify(&self) -> Result<String, Failure> {
        let loaded = load_study(&self.folder.path().join("study.toml"), &Disk::default())?;
        let fit = loaded.fit(&axiscal::fit::Settings { bare: true, ..loaded.settings() })?;
        Ok(serde_json::to_string(&fit.outcome).unwrap())
    }

    /// Every number of the plan by its JSON pointer.
    fn numbers(&self, touches: Touches) -> Vec<String> {
        let all = self.plan["touches"].as_array().unwrap();
        let mut stages: BTreeMap<&str, Vec<usize>> = BTreeMap::new();
        all.iter().enumerate().for_each(|(i, t)| stages.entry(t["stage"].as_str().unwrap()).or_default().push(i));
        let sampled: Vec<usize> = stages.values().flat_map(|of| [of[0], of[of.len() / 2], of[of.len() - 1]]).collect();
        let mut out = Vec::new();
        numbers(&self.plan, "", &mut out);
        out.retain(|pointer| {
            let touch = pointer.strip_prefix("/touches/").and_then(|rest| rest.split('/').next());
            touch.is_none_or(|i| touches == Touches::All || sampled.contains(&i.parse().unwrap()))
        });
        out
    }

    /// The fit with an edited plan: `None` where it is the same one.
    fn refusal(&self, text: &str) -> Option<Vec<Finding>> {
        std::fs::write(self.plan_file(), text).unwrap();
        // the study reads its plans in the same way, and much besides: most edits end here
        if let Err(Failure(findings)) = load_plan(&self.plan_file(), &self.machine, &Disk::default()) {
            return Some(findings);
        }
        match self.identify() {
            Err(Failure(findings)) => Some(findings),
            Ok(fit) => {
                assert!(fit == self.fit, "another fit without a finding:\n{fit}\ninstead of\n{}", self.fit);
                None
            }
        }
    }

    /// Sets a number to what it cannot be, and moves it a little; how many edits were refused.
    fn edit(&self, pointer: &str) -> usize {
        let old = self.plan.pointer(pointer).unwrap();
        let number = old.as_f64().unwrap();
        let values = [json!(0), json!(-1), json!(1e12), json!(1e308), json!("NaN"), json!(number + 0.02)];
        let mut plan = self.plan.clone();
        let mut refused = 0;
        for value in values.into_iter().filter(|v| v.as_f64() != Some(number)) {
            *plan.pointer_mut(pointer).unwrap() = value.clone();
            let found = self.refusal(&plan.to_string());
            refused += usize::from(found.is_some());
            let what = format!("{pointer} = {value}");
            assert_refused(found, &what);
            // with the digests of the fields edited as well the log still knows
            if value.as_f64() == Some(number + 0.02)
                && let Ok(edited) = serde_json::from_value::<Plan>(plan.clone())
            {
                assert_refused(self.refusal(&edited.to_json()), &format!("{what}, with its digests"));
            }
        }
        refused
    }

    /// Numbers edited, and edits refused.
    fn sweep(&self, touches: Touches) -> (usize, usize) {
        let numbers = self.numbers(touches);
        let refused = numbers.iter().map(|pointer| self.edit(pointer)).sum();
        (numbers.len(), refused)
    }
}

/// A refusal has a code of the plan or the log, and says what to do.
fn assert_refused(found: Option<Vec<Finding>>, what: &str) {
    for finding in found.iter().flatten() {
        let of_plan_or_log = finding.code.starts_with("plan::") || finding.code == "log::other_plan";
        assert!(of_plan_or_log && finding.help.is_some(), "{what}: {finding:?}");
    }
}

fn numbers(value: &Value, pointer: &str, out: &mut Vec<String>) {
    match value {
        Value::Number(_) => out.push(pointer.to_owned()),
        Value::Array(items) => items.iter().enumerate().for_each(|(i, v)| numbers(v, &format!("{pointer}/{i}"), out)),
        Value::Object(fields) => fields.iter().for_each(|(key, v)| numbers(v, &format!("{pointer}/{key}"), out)),
        _ => {}
    }
}

#[test]
fn an_edited_number_gives_the_same_fit_or_is_refused() {
    let jobs = [
        ("swivel-head", "head"),
        ("swivel-head", "table"),
        ("trunnion", "basic"),
        ("swivel-table-b", "basic"),
        ("double-head", "double-head"),
    ];
    let counts = jobs.map(|(machine, program)| Job::new(machine, program).sweep(Touches::Some));
    let (numbers, refused) = counts.iter().fold((0, 0), |sum, c| (sum.0 + c.0, sum.1 + c.1));
    println!("{numbers} numbers edited, {refused} edits refused");
    assert!(numbers >= 400 && refused >= 4 * numbers, "{counts:?}");
}

/// All touches of a program, some minutes: `cargo test --test diagnosis plan_sweep -- --ignored --nocapture`.
#[test]
#[ignore = "takes minutes"]
fn every_number_of_a_plan_gives_the_same_fit_or_is_refused() {
    for (machine, program) in [("swivel-head", "head"), ("swivel-head", "table"), ("trunnion", "basic")] {
        let (numbers, refused) = Job::new(machine, program).sweep(Touches::All);
        println!("{machine} {program}: {numbers} numbers edited, {refused} edits refused");
        assert!(numbers > 2000 && refused >= 4 * numbers);
    }
}

/// What nothing reads may be edited: the fit is the same one.
#[test]
fn what_no_fit_reads_may_be_edited() {
    let job = Job::new("swivel-head", "table");
    let mut plan = job.plan.clone();
    plan["notes"] = json!(["checked by a person"]);
    assert!(job.refusal(&plan.to_string()).is_none());
    assert!(job.refusal(&serde_json::to_string_pretty(&job.plan).unwrap()).is_none());
}

/// Codes of the findings of a call that was refused.
fn refused(folder: &std::path::Path, args: &[&str]) -> Vec<String> {
    let (answer, code) = verbs::json(folder, args);
    assert_eq!((code, &answer["format"]), (2, &json!("axiscal-failure/1")), "{answer}");
    let errors = answer["findings"].as_array().unwrap().iter().filter(|f| f["severity"] == "error");
    errors.map(|f| f["code"].as_str().unwrap().to_owned()).collect()
}

#[test]
fn the_verbs_refuse_a_plan_that_was_edited_after_its_log_was_made() {
    let folder = verbs::folder(&["table"], "[noise]\ntouch_um = 0.5\n", None);
    let at = folder.path();
    let file = at.join("table.plan.json");
    let good = std::fs::read_to_string(&file).unwrap();
    let parse = ["parse", "table.log", "--controller", "linuxcnc", "--plan", "table.plan.json"];
    let (parsed, _) = verbs::json(at, &parse);
    assert_eq!(parsed["findings"], json!([]));
    let mut edited: Value = serde_json::from_str(&good).unwrap();
    // it contradicts nothing in the plan
    edited["touches"][0]["feed_mm_min"] = json!(61.0);
    std::fs::write(&file, edited.to_string()).unwrap();
    for verb in ["identify", "compare", "diagnose", "report"] {
        assert_eq!(refused(at, &[verb, "study.toml"]), ["plan::changed"]);
    }
    assert_eq!(refused(at, &parse), ["plan::changed"]);
    // without the digests, and with new ones: the log knows
    edited.as_object_mut().unwrap().remove("fields_sha256");
    std::fs::write(&file, edited.to_string()).unwrap();
    assert_eq!(refused(at, &["identify", "study.toml"]), ["log::other_plan"]);
    let plan: Plan = serde_json::from_value(edited).unwrap();
    std::fs::write(&file, plan.to_json()).unwrap();
    assert_eq!(refused(at, &["identify", "study.toml"]), ["log::other_plan"]);
    // a plan and a log of an earlier version
    let plan: Plan = serde_json::from_str(&good).unwrap();
    let log = std::fs::read_to_string(at.join("table.log")).unwrap();
    let of_earlier_version = log.replacen(&plan_digest::digest(&plan), &plan_digest::older(&plan), 1);
    assert_ne!(log, of_earlier_version);
    std::fs::write(at.join("table.log"), of_earlier_version).unwrap();
    let mut without: Value = serde_json::from_str(&good).unwrap();
    without.as_object_mut().unwrap().remove("fields_sha256");
    std::fs::write(&file, without.to_string()).unwrap();
    let (parsed, code) = verbs::json(at, &parse);
    assert_eq!(
        (code, &parsed["findings"][0]["code"], parsed["complete"].as_bool()),
        (0, &json!("log::older"), Some(true))
    );
    assert_eq!(verbs::json(at, &["identify", "study.toml"]).1, 0);
}

/// Values that disagree with each other inside of a plan of an earlier version, which holds no digests.
#[test]
fn values_that_disagree_are_refused_at_the_first_touch_that_has_them() {
    let folder = verbs::folder(&["table"], "[noise]\ntouch_um = 0.5\n", None);
    let file = folder.path().join("table.plan.json");
    let mut good: Value = serde_json::from_str(&std::fs::read_to_string(&file).unwrap()).unwrap();
    good.as_object_mut().unwrap().remove("fields_sha256");
    type Edit = fn(&mut Value);
    let edits: [(&str, Edit); 3] = [
        ("plan::disagrees", |p| p["tool_length_mm"] = json!(p["tool_length_mm"].as_f64().unwrap() + 0.02)),
        ("plan::disagrees", |p| p["ball_radius_mm"] = json!(3.005)),
        ("plan::disagrees", |p| {
            p["touches"].as_array_mut().unwrap().iter_mut().for_each(|t| t["point"][1] = json!(0.0));
        }),
    ];
    for (code, edit) in edits {
        let mut plan = good.clone();
        edit(&mut plan);
        std::fs::write(&file, plan.to_string()).unwrap();
        assert_eq!(refused(folder.path(), &["identify", "study.toml"])[0], code);
    }
}
