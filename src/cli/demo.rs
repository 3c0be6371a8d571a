//! `axiscal demo`: the whole loop on built-in data, in seconds, with every file left behind to look at.

use super::{Answer, Io};
use crate::diag::{Result, source};
use crate::files;
use crate::fit::outcome::{Outcome, Status};
use crate::fit::{self, Fit, Settings};
use crate::log::{self, Touch, Writer};
use crate::machine::Machine;
use crate::model::catalogue::Catalogue;
use crate::model::data::Run;
use crate::post::{LogRecord, Postprocessor};
use crate::program::{self, Generated, ProgramSpec, plan::Plan};
use crate::report::fit::{digits, number, significant, table};
use crate::simulate::{self, Compensation, Scenario};
use crate::study::{DataEntry, Study};
use crate::tables::compensation::Provenance;
use crate::tables::correction::Correction;
use crate::tables::linuxcnc;
use comfy_table::Cell;
use indicatif::{ProgressBar, ProgressStyle};
use serde_json::json;
use std::path::{Path, PathBuf};

/// Arguments of `demo`.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The folder to write to
    #[arg(long, default_value = "axiscal-demo")]
    pub out: PathBuf,
}

const MACHINE: &str = "swivel-head";

/// What is wrong with the machine of the demo; `identify` is not told.
const SCENARIO: &str = "\
# what is wrong with the virtual machine of the demo
seed = 20

[effects.location-b]
EX0B = 0.021
EZ0B = -0.013
EA0B = 0.0061
EC0B = -0.0038

[effects.location-c]
EX0C = -0.017
EY0C = 0.012
EA0C = 0.0045
EB0C = -0.0052

[effects.pretravel]
pretravel = 0.004

[[block]]
mounting = \"head\"
name = \"x-\"
shift = [0.12, -0.08, 0.05]
tilt = [0.04, -0.03, 0.08]

[[block]]
mounting = \"table\"
name = \"x+\"
shift = [-0.10, 0.06, 0.03]
tilt = [-0.02, 0.05, -0.06]

[noise]
touch_um = 0.5
";

/// The steps, as they are announced.
const STEPS: u64 = 6;

/// Runs `demo`.
///
/// # Errors
/// When the folder cannot be written.
pub fn run(args: &Args, io: &Io) -> Result<Answer> {
    let bench = Bench::new(&args.out, io)?;
    let step = Steps::new(io);

    step.next("probing programs: every move checked for limits and collisions");
    let (head, table_run) = (bench.generate("head")?, bench.generate("table")?);
    let check = bench
        .generate_from(&program::load(&source("check program of the demo", include_str!("demo_check.toml")))?.0)?;

    step.next("the virtual machine runs them and writes the control's logs");
    let before = [bench.touch(&head, "head.log", None)?, bench.touch(&table_run, "table.log", None)?];
    let check_before = bench.touch(&check, "check-before.log", None)?;

    step.next("identification: all errors at once, from both logs");
    let fit =
        bench.identify(&[(&head.plan, &before[0]), (&table_run.plan, &before[1])], &["location-b", "location-c"])?;
    bench.write_study(&fit)?;

    step.next("the compensation as the control's own tables");
    let n_files = bench.export(&fit)?;

    step.next("the control applies it; other points are probed again");
    let compensation = bench.compensation()?;
    let check_after = bench.touch(&check, "check-after.log", Some(&compensation))?;

    step.next("before and after");
    // with no location error in the model, only a block's set-up and the pre-travel can explain a reading
    let left = |touches: &[Touch]| bench.identify(&[(&check.plan, touches)], &[]).map(|f| f.outcome.rms_um);
    let (rms_before, rms_after) = (left(&check_before)?, left(&check_after)?);
    step.done();

    say(&fit.outcome, &bench.scenario, io);
    io.say(format!(
        "At {} other points: {} um RMS before, {} um after, with a probe that scatters by {} um\n",
        check.plan.touches.len(),
        significant(rms_before),
        significant(rms_after),
        significant(crate::units::um_from_mm(bench.scenario.noise.touch_mm)),
    ));
    let out = args.out.display();
    io.say("Where to look:");
    for (file, what) in [
        ("head.ngc", "the first program (table.ngc is the second): its head says what to set up where"),
        ("head.log", "what LinuxCNC would have written"),
        ("wrong.toml", "what was wrong with the machine"),
        ("study.toml", "the study: `axiscal identify` takes it"),
        ("compensation/README.txt", "how to load the compensation, and what must be set again"),
    ] {
        io.say(format!("  {:<38} {what}", format!("{out}/{file}")));
    }
    io.say(format!("Next: axiscal identify {out}/study.toml"));
    io.answer(&json!({
        "out": args.out.display().to_string(), "fit": brief(&fit.outcome), "planted": bench.scenario.planted,
        "check": { "touches": check.plan.touches.len(), "rms_before_um": rms_before, "rms_after_um": rms_after },
        "compensation_files": n_files,
    }));
    // the machine is one of our own: an error that does not fall is a fault of the program
    Ok(if rms_after < 0.5 * rms_before { Answer::Done } else { Answer::No })
}

struct Bench<'a> {
    machine: Machine,
    catalogue: Catalogue,
    post: Postprocessor,
    scenario: Scenario,
    out: &'a Path,
    io: &'a Io,
}

impl<'a> Bench<'a> {
    fn new(out: &'a Path, io: &'a Io) -> Result<Self> {
        let machine = super::common::load_machine(MACHINE, None, io)?;
        let text = source("wrong.toml", SCENARIO);
        let (scenario, _) = simulate::scenario::parse(&text, &machine)?;
        files::write_whole(&out.join("wrong.toml"), SCENARIO.as_bytes())?;
        let (post, _) = Postprocessor::load_built_in_or_file(linuxcnc::CONTROLLER)?;
        Ok(Self { machine, catalogue: Catalogue::built_in()?, post, scenario, out, io })
    }

    fn write(&self, name: &str, contents: &[u8]) -> Result<()> {
        files::write_whole(&self.out.join(name), contents)
    }

    fn generate(&self, name: &str) -> Result<Generated> {
        self.generate_from(&program::choose(program::built_in()?, name, &self.machine)?)
    }

    fn generate_from(&self, spec: &ProgramSpec) -> Result<Generated> {
        let (generated, findings) = program::generate(&self.machine, spec, &program::Options::default())?;
        self.io.report(&findings.0);
        let nc = self.post.program(&self.machine, &generated.plan, &generated.path)?;
        self.io.report(&nc.findings.0);
        let name = &generated.plan.program;
        self.write(&format!("{name}.{}", nc.extension), nc.text.as_bytes())?;
        self.write(&format!("{name}.plan.json"), generated.plan.to_json().as_bytes())?;
        Ok(generated)
    }

    /// Through the log's own text: simulated and real data walk the same path from there on.
    fn touch(&self, run: &Generated, log_name: &str, compensation: Option<&Compensation>) -> Result<Vec<Touch>> {
        let (raw, _) = simulate::run(&self.machine, &run.plan, &self.scenario, compensation)?;
        let records: Vec<LogRecord> =
            raw.iter().filter_map(|t| Some(LogRecord { id: t.id?, status: t.status, position: t.position })).collect();
        let text = self.post.log_text(&self.machine, &run.plan, &records);
        self.write(log_name, text.as_bytes())?;
        let writer = Writer::Controller(&self.post);
        let (matched, findings) = log::read(text.as_bytes(), log_name, writer, &self.machine, &run.plan)?;
        self.io.report(&findings.0);
        Ok(matched.touches)
    }

    fn identify(&self, runs: &[(&Plan, &[Touch])], location: &[&str]) -> Result<Fit> {
        let runs: Vec<Run> =
            runs.iter().map(|(plan, touches)| Run { plan, touches, mounting: None, started_s: None }).collect();
        let effects = location.iter().copied().chain(["block-setup", "pretravel"]).map(str::to_owned).collect();
        let settings = Settings { effects, touch_sigma_mm: Some(self.scenario.noise.touch_mm), visit_sigma_mm: Some(0.0), ..Settings::default() };
        fit::identify(&self.machine, &self.catalogue, &runs, &settings)
    }

    fn write_study(&self, fit: &Fit) -> Result<()> {
        let entry = |name: &str| DataEntry {
            plan: format!("{name}.plan.json"),
            log: format!("{name}.log"),
            controller: linuxcnc::CONTROLLER.into(),
            started_s: None,
            mounting: None,
            compensation: None,
        };
        let study = Study {
            machines: None,
            machine: self.machine.name.clone(),
            effects_files: Vec::new(),
            data: vec![entry("head"), entry("table")],
            effects: fit.outcome.effects.clone(),
            knowledge: std::collections::BTreeMap::new(),
            touch_sigma_mm: Some(self.scenario.noise.touch_mm),
            visit_sigma_mm: Some(0.0),
            type_b: std::collections::BTreeMap::new(),
            masked: Vec::new(),
        };
        self.write("study.toml", study.fresh()?.as_bytes())
    }

    fn export(&self, fit: &Fit) -> Result<usize> {
        let provenance = Provenance {
            study: "study.toml of the demo".into(),
            study_sha256: String::new(),
            data_date: "simulated".into(),
        };
        let (correction, _) = Correction::collect(&self.machine, &self.catalogue, &fit.outcome, None, provenance)?;
        let (export, _) = linuxcnc::export(&self.machine, &correction, &linuxcnc::Options::default())?;
        for (name, contents) in &export.files {
            self.write(&format!("compensation/{name}"), contents)?;
        }
        Ok(export.files.len())
    }

    fn compensation(&self) -> Result<Compensation> {
        let file = self.out.join("compensation").join("compensation.json");
        let text = source(file.display().to_string(), files::read_text(&file)?);
        Ok(Compensation::parse(&text, &self.machine)?.0)
    }
}

/// Progress: a bar for a person, nothing in a pipe.
struct Steps(ProgressBar);

impl Steps {
    fn new(io: &Io) -> Self {
        if io.json {
            return Self(ProgressBar::hidden());
        }
        let bar = ProgressBar::new(STEPS);
        match ProgressStyle::with_template("{bar:24} {pos}/{len} {msg}") {
            Ok(style) => Self(bar.with_style(style)),
            Err(_) => Self(bar),
        }
    }

    fn next(&self, what: &'static str) {
        self.0.inc(1);
        self.0.println(format!("{}/{STEPS} {what}", self.0.position()));
        self.0.set_message(what);
    }

    fn done(&self) {
        self.0.finish_and_clear();
    }
}

fn say(o: &Outcome, scenario: &Scenario, io: &Io) {
    let mut t = table(&["parameter", "planted", "identified", "std. uncertainty", "off by", "unit"]);
    for planted in &scenario.planted {
        let Some(p) = o.parameters.iter().find(|p| p.name == planted.parameter && p.effect == planted.effect) else {
            continue;
        };
        let off = p.sigma.map_or_else(|| "-".to_owned(), |s| format!("{:+.1} sigma", (p.value - planted.value) / s));
        t.add_row(vec![
            Cell::new(&p.name),
            number(planted.value),
            number(if p.status == Status::Identified { digits(p.value, p.sigma) } else { "?".into() }),
            number(p.sigma.map_or_else(|| "-".into(), significant)),
            number(off),
            Cell::new(&p.unit),
        ]);
    }
    io.say(format!(
        "\n{} touches, {} unknowns of rank {}; {} um RMS left\n{t}\n",
        o.touches,
        o.unknowns,
        o.rank,
        significant(o.rms_um)
    ));
}

fn brief(o: &Outcome) -> Outcome {
    Outcome { residuals: None, ..o.clone() }
}
