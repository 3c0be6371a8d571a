//! Runs the peers and the crate on one problem, and compares their answers.

pub mod search;

use crate::problems::{MOUNTING, Problem, SIGMA_MM, matched, solve, swivel_head};
use axiscal::fit;
use axiscal::log;
use axiscal::program;
use axiscal::simulate::{self, Scenario};
use peak_alloc::PeakAlloc;
use std::collections::BTreeMap;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Instant;

/// What a solver says of a problem.
#[derive(serde::Deserialize)]
pub struct Answer {
    pub solver: String,
    pub fit_s: f64,
    pub covariance_s: f64,
    pub iterations: usize,
    /// Memory with the touches read, KiB.
    pub loaded_kb: f64,
    /// The most that there was until the end, KiB.
    pub peak_kb: f64,
    pub name: Vec<String>,
    pub value: Vec<f64>,
    pub sigma: Vec<f64>,
}

impl Answer {
    pub fn total_s(&self) -> f64 {
        self.fit_s + self.covariance_s
    }
}

/// What `benches/peers/run` sets up for the fits.
const PEERS: [&str; 3] = ["ceres_fit", "newton_fit", "python"];

/// The peers that are installed, by name.
pub struct Peers(BTreeMap<String, PathBuf>);

impl Peers {
    /// Asks `benches/peers/run`, which installs what is missing if it may.
    pub fn find(install: bool) -> Self {
        let mut command = Command::new("bash");
        command.arg(folder().join("run")).stderr(std::process::Stdio::inherit());
        if !install {
            command.arg("--no-install");
        }
        let said = command.output().expect("bash runs").stdout;
        let lines = String::from_utf8(said).unwrap();
        let peers = Self(lines.lines().filter_map(|l| l.split_once('\t')).map(|(n, p)| (n.into(), p.into())).collect());
        if std::env::var_os("AXISCAL_PEERS_REQUIRED").is_some() {
            let missing: Vec<&str> = PEERS.into_iter().filter(|name| !peers.0.contains_key(*name)).collect();
            assert!(missing.is_empty(), "peers are missing: {missing:?}");
        }
        peers
    }

    pub fn newton(&self, problem: &Path, n_threads: usize, repeats: usize) -> Option<Answer> {
        self.run("newton_fit", &[path(problem), &n_threads.to_string(), &repeats.to_string()], n_threads)
    }

    pub fn scipy(&self, problem: &Path, n_threads: usize, repeats: usize) -> Option<Answer> {
        let script = folder().join("scipy_fit.py");
        self.run("python", &[path(&script), path(problem), "lm", &repeats.to_string()], n_threads)
    }

    pub fn ceres(
        &self,
        problem: &Path,
        derivatives: &str,
        solver: &str,
        covariance: &str,
        n_threads: usize,
        repeats: usize,
    ) -> Option<Answer> {
        let (threads, repeats) = (n_threads.to_string(), repeats.to_string());
        self.run("ceres_fit", &[path(problem), derivatives, solver, covariance, &threads, &repeats], n_threads)
    }

    fn run(&self, name: &str, arguments: &[&str], n_threads: usize) -> Option<Answer> {
        let mut command = Command::new(self.0.get(name)?);
        command.args(arguments).env("OPENBLAS_NUM_THREADS", n_threads.to_string());
        let output = command.output().unwrap();
        assert!(output.status.success(), "{name} {arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
        Some(serde_json::from_slice(&output.stdout).unwrap())
    }
}

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("benches/peers")
}

fn path(path: &Path) -> &str {
    path.to_str().expect("a path that is text")
}

/// The crate's own answer, the fastest of `repeats`; memory is what the heap holds.
pub fn run_crate(problem: &Problem, n_threads: usize, repeats: usize, heap: &PeakAlloc) -> Answer {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(n_threads).build().unwrap();
    let data = problem.data();
    let mut best: Option<Answer> = None;
    for _ in 0..repeats {
        let loaded_kb = f64::from(heap.current_usage_as_kb());
        heap.reset_peak_usage();
        let start = Instant::now();
        let model = problem.model(&data);
        let solution = pool.install(|| solve(&model, &data));
        let fit_s = start.elapsed().as_secs_f64();
        if best.as_ref().is_none_or(|b| fit_s < b.fit_s) {
            best = Some(Answer {
                solver: "axiscal".into(),
                fit_s,
                covariance_s: 0.0,
                iterations: solution.iterations,
                loaded_kb,
                peak_kb: f64::from(heap.peak_usage_as_kb()),
                name: model.unknowns.iter().map(|u| u.name.clone()).collect(),
                value: solution.theta.as_slice().to_vec(),
                sigma: solution.covariance.diagonal().iter().map(|v| v.sqrt()).collect(),
            });
        }
    }
    best.expect("at least one repeat")
}

/// All of `identify` on a problem in memory, the fastest of `repeats`: time, s, and what the heap holds at most, KiB.
pub fn run_identify(problem: &Problem, n_threads: usize, repeats: usize, heap: &PeakAlloc) -> (f64, f64) {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(n_threads).build().unwrap();
    let (data, settings) = (problem.data(), problem.settings());
    let mut best = (f64::INFINITY, 0.0);
    for _ in 0..repeats {
        let data = data.clone();
        let loaded_kb = heap.current_usage_as_kb();
        heap.reset_peak_usage();
        let start = Instant::now();
        let fit = pool
            .install(|| fit::identify_data(&problem.machine, &problem.catalogue, data, &settings))
            .unwrap_or_else(|e| panic!("{e:?}"));
        let seconds = start.elapsed().as_secs_f64();
        assert!(fit.outcome.converged && fit.outcome.rank == fit.free.len(), "{}", fit.outcome.stopped);
        if seconds < best.0 {
            best = (seconds, f64::from(heap.peak_usage_as_kb() - loaded_kb));
        }
    }
    best
}

/// Writes the problem file of `benches/peers/README.md`; `names` in the model's order.
pub fn write_problem(problem: &Problem, names: &[String], file: &Path) {
    let plan = &problem.plan;
    let mut out = std::io::BufWriter::new(std::fs::File::create(file).unwrap());
    writeln!(out, "axiscal-peers/1\n{} {} {} {SIGMA_MM}", problem.touches.len(), plan.blocks.len(), names.len())
        .unwrap();
    for b in &plan.blocks {
        writeln!(out, "{} {} {} {}", b.carrier, b.centre[0], b.centre[1], b.centre[2]).unwrap();
    }
    names.iter().for_each(|name| writeln!(out, "{name}").unwrap());
    let in_order: Vec<String> = plan.blocks.iter().map(|b| format!("SX@{MOUNTING}/{}", b.name)).collect();
    assert!(names.iter().filter(|n| n.starts_with("SX@")).eq(&in_order), "the model orders the blocks as the plan");
    let ball = problem.machine.tool.ball_at_zero(plan.tool_length_mm);
    for (t, planned) in problem.touches.iter().zip(&plan.touches) {
        let [x, y, z, _, b, c] = t.position.0;
        let block = plan.blocks.iter().position(|b| b.name == planned.block).unwrap();
        let numbers = [x, y, z, b, c].into_iter().chain(planned.point).chain(planned.normal);
        let rest = [plan.ball_radius_mm, ball.x, ball.y, ball.z, block as f64];
        for number in numbers.chain(rest) {
            out.write_all(&number.to_le_bytes()).unwrap();
        }
    }
    out.flush().unwrap();
}

/// Panics unless two answers are the same: within 1e-9 mm and deg without noise, 1e-4 of the standard uncertainty with it.
pub fn compare(ours: &Answer, theirs: &Answer, noisy: bool) {
    assert_eq!(ours.name, theirs.name);
    for (i, name) in ours.name.iter().enumerate() {
        // um/m and urad are a thousandth of a millimetre's kind
        let fine = if ["EXX", "EYY", "EC0Y"].contains(&name.as_str()) { 1e-6 } else { 1e-9 };
        let tolerance = if noisy { 1e-4 * ours.sigma[i] } else { fine };
        let off = (ours.value[i] - theirs.value[i]).abs();
        assert!(
            off <= tolerance,
            "{name}: {} says {}, {} says {}",
            ours.solver,
            ours.value[i],
            theirs.solver,
            theirs.value[i]
        );
        let ratio = theirs.sigma[i] / ours.sigma[i];
        assert!((ratio - 1.0).abs() < 1e-6, "{name}: sigma of {} is {ratio} times ours", theirs.solver);
    }
}

/// Times of a program that was run several times, s.
pub struct Times {
    pub median_s: f64,
    pub least_s: f64,
}

/// A study of 356 touches for the comparison of whole processes.
pub struct Study {
    pub unknowns: usize,
    /// Program, name of the set-up, touches of it.
    runs: &'static [(&'static str, &'static str, usize)],
    effects: &'static [&'static str],
}

const LOCATIONS: &[&str] = &["location-b", "location-c", "pretravel", "block-setup"];
const SCALES: &[&str] =
    &["location-b", "location-c", "pretravel", "scale-x", "scale-y", "squareness-xy", "block-setup"];

/// Three studies with different numbers of unknowns and different effects, and the paper's own (39 unknowns).
pub const STUDIES: [Study; 4] = [
    Study {
        unknowns: 15,
        runs: &[("table", "one", 154), ("table", "one", 154), ("table", "one", 48)],
        effects: LOCATIONS,
    },
    Study { unknowns: 39, runs: &[("head", "one", 202), ("table", "two", 154)], effects: LOCATIONS },
    Study { unknowns: 60, runs: &[("head", "one", 178), ("head", "two", 178)], effects: SCALES },
    Study {
        unknowns: 120,
        runs: &[
            ("head", "one", 66),
            ("head", "two", 66),
            ("head", "three", 66),
            ("head", "four", 66),
            ("table", "five", 46),
            ("table", "six", 46),
        ],
        effects: SCALES,
    },
];

/// `identify --quick`, `identify` and SciPy's script on a study, run in turn; their answers must agree.
pub fn identify_all(peers: &Peers, folder: &Path, study: &Study, rounds: usize) -> [Option<Times>; 3] {
    const RUNS: usize = 5;
    let study = write_study(folder, study);
    // as an installation leaves it: what a linker has just written lies in the system's cache in small pieces, and starts more slowly
    let program = folder.join("axiscal");
    std::fs::copy(env!("CARGO_BIN_EXE_axiscal"), &program).unwrap();
    let command = |program: &Path, words: &[&str]| {
        let mut command = Command::new(program);
        command.args(words).arg(&study);
        command
    };
    let script = self::folder().join("identify.py").display().to_string();
    let quick = command(&program, &["identify", "--json", "--quick"]);
    let plain = command(&program, &["identify", "--json"]);
    let theirs = peers.0.get("python").map(|python| command(python.as_ref(), &[&script]));
    let mut commands: Vec<Command> = [quick, plain].into_iter().chain(theirs).collect();
    let mut times_s = vec![Vec::new(); commands.len()];
    let mut said = vec![Vec::new(); commands.len()];
    for _ in 0..rounds {
        for ((command, times_s), said) in commands.iter_mut().zip(&mut times_s).zip(&mut said) {
            for run in 0..RUNS {
                let start = Instant::now();
                let output = command.output().unwrap();
                times_s.extend((run > 0).then(|| start.elapsed().as_secs_f64()));
                assert!(output.status.success(), "{command:?}: {}", String::from_utf8_lossy(&output.stderr));
                *said = output.stdout;
            }
        }
    }
    let values: Vec<BTreeMap<String, f64>> = said.iter().map(|said| identified(said)).collect();
    // with the figures that need the whole catalogue; nothing else of the answer may change
    assert_eq!(values[0], values[1], "--quick and the whole answer hold the same values");
    if let Some(theirs) = values.get(2) {
        assert!(values[0].keys().eq(theirs.keys()), "both identify the same parameters");
        for (name, value) in &values[0] {
            // mm and deg; um/m and urad are larger numbers
            let room = if value.abs() > 1.0 { 1e-6 } else { 1e-9 };
            assert!((value - theirs[name]).abs() < room, "{name}: identify says {value}, SciPy {}", theirs[name]);
        }
    }
    let mut times = times_s.into_iter().map(|mut times_s| {
        times_s.sort_by(f64::total_cmp);
        Times { median_s: times_s[times_s.len() / 2], least_s: times_s[0] }
    });
    [times.next(), times.next(), times.next()]
}

/// What an answer calls identified, by name.
fn identified(answer: &[u8]) -> BTreeMap<String, f64> {
    let answer: serde_json::Value = serde_json::from_slice(answer).unwrap();
    let all = answer["parameters"].as_array().unwrap().iter().filter(|p| p["status"] == "identified");
    all.map(|p| (p["name"].as_str().unwrap().to_owned(), p["value"].as_f64().unwrap())).collect()
}

/// A study with everything that the whole-process comparison reads; noise-free, so that two noise models cannot differ.
fn write_study(folder: &Path, study: &Study) -> PathBuf {
    let machine = swivel_head();
    let mut scenario = Scenario::flawless();
    let values: [(&str, &[(&str, f64)]); 6] = [
        ("location-b", &[("EX0B", 0.031), ("EZ0B", -0.022), ("EA0B", 0.004), ("EC0B", -0.003)]),
        ("location-c", &[("EX0C", 0.012), ("EY0C", -0.027), ("EA0C", 0.002), ("EB0C", 0.005)]),
        ("pretravel", &[("pretravel", 0.006)]),
        ("scale-x", &[("EXX", 40.0)]),
        ("scale-y", &[("EYY", -30.0)]),
        ("squareness-xy", &[("EC0Y", 25.0)]),
    ];
    for (id, values) in values.iter().filter(|(id, _)| study.effects.contains(id)) {
        scenario = scenario.with(&machine, id, values).unwrap();
    }
    let mut text = String::from("machine = \"swivel-head\"\n");
    for (i, (name, set_up, n_touches)) in study.runs.iter().enumerate() {
        let spec = program::choose(program::built_in().unwrap(), name, &machine).unwrap();
        let mut plan = program::generate(&machine, &spec, &program::Options::default()).unwrap().0.plan;
        // some of them, from the whole program
        let (all, mut place) = (plan.touches.len(), 0);
        plan.touches.retain(|_| {
            place += 1;
            place * n_touches / all > (place - 1) * n_touches / all
        });
        let (raw, _) = simulate::run(&machine, &plan, &scenario, None).unwrap();
        let touches: Vec<log::Touch> = raw.iter().map(matched).collect();
        std::fs::write(folder.join(format!("{i}.plan.json")), plan.to_json()).unwrap();
        std::fs::write(folder.join(format!("{i}.csv")), log::csv::write(&machine, &touches)).unwrap();
        text += &format!(
            "[[data]]\nplan = \"{i}.plan.json\"\nlog = \"{i}.csv\"\ncontroller = \"csv\"\nmounting = \"{set_up}\"\n"
        );
    }
    text += &format!("[model]\neffects = {:?}\n[noise]\ntouch_um = 1.0\nvisit_um = 0.0\n", study.effects);
    let path = folder.join("study.toml");
    std::fs::write(&path, text).unwrap();
    path
}
