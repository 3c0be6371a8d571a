//! The crate beside its peers on the same touches and unknowns, in one run: answers compared, times as ratios.
//!
//! `cargo bench --bench peers` prints the table; `-- --write` puts it into `docs/performance.md` as well, and words such as
//! `10000x60` choose sizes (touches x unknowns); `-- score` runs the score tests only, `-- whole` the whole processes only; `-- --answers` compares the answers only, at small
//! size, as does a call without `--bench` (`cargo test`). Peers are what `benches/peers/run` finds; `AXISCAL_PEERS_REQUIRED=1`
//! makes a missing one an error.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)] // a benchmark that cannot run says where

mod comparison;
mod problems;

use comparison::{Answer, Peers, STUDIES, compare, identify_all, run_crate, run_identify};
use problems::Problem;
use std::fmt::Write;
use std::path::Path;

#[global_allocator]
static HEAP: peak_alloc::PeakAlloc = peak_alloc::PeakAlloc;

/// Ceres with analytic derivatives: the solvers on normal equations, and all of them.
const NORMAL: [&str; 3] = ["dense-normal", "dense-normal-lapack", "sparse-normal"];
const OTHERS: [&str; 3] = ["dense-schur", "dense-qr", "dense-qr-lapack"];
/// Where the issue of speed is decided, touches x unknowns.
const DECISIVE: [(usize, usize); 2] = [(10_000, 60), (100_000, 60)];

fn main() {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let has = |word: &str| words.iter().any(|w| w == word);
    let peers = Peers::find(has("--bench"));
    let folder = tempfile::tempdir().unwrap();
    agree(&peers, folder.path());
    if !has("--bench") || has("--answers") {
        return;
    }
    if has("score") {
        println!("{}", score_tests());
        return;
    }
    if has("whole") {
        println!("{}{}", machine(), whole_process(&peers, folder.path()));
        return;
    }
    let mut text = machine();
    text.push_str(&whole_process(&peers, folder.path()));
    let sizes = [356, 10_000, 100_000].into_iter().flat_map(|n| [15, 60, 120].map(|p| (n, p)));
    let chosen = words.iter().any(|w| w.contains('x') && !w.starts_with('-'));
    let sizes = sizes.filter(|(n, p)| !chosen || has(&format!("{n}x{p}")));
    let results: Vec<Size> = sizes.map(|(n, p)| measure(&peers, folder.path(), n, p)).collect();
    text.push_str(&table(&results));
    text.push_str(&solvers(&results));
    if !chosen {
        text.push_str(&score_tests());
    }
    println!("\n{text}");
    if has("--write") {
        insert(&text);
    }
}

/// The score tests of the diagnosis against a refit with each candidate.
fn score_tests() -> String {
    let mut out = "\n## Score tests of the whole catalogue\n\n\
        Milliseconds on one thread, fastest run; in brackets how many times as long as the tests. \"Bare fits\": the model solved \
        again with each effect that leaves a trace; \"refits\": all of `identify --quick` with each effect.\n\n\
        | touches x unknowns | effects (columns) | tests | their columns | bare fits | refits |\n|---|---|---|---|---|---|\n"
        .to_owned();
    for n_touches in [356, 10_000] {
        let t = comparison::search::score_tests(n_touches, 60);
        let ratio = |s: f64| format!("{:.0} ({:.0})", 1e3 * s, s / t.tests_s);
        let _ = writeln!(
            out,
            "| {} x {} | {} ({}) | {:.2} | {:.1} | {} | {} |",
            t.n_touches,
            t.n_unknowns,
            t.candidates,
            t.columns,
            1e3 * t.tests_s,
            1e3 * t.columns_s,
            ratio(t.solves_s),
            ratio(t.refits_s)
        );
    }
    out
}

/// All answers agree, without noise and with it; panics where they do not.
fn agree(peers: &Peers, folder: &Path) {
    for n_unknowns in [15, 60, 120] {
        for noise_mm in [0.0, problems::SIGMA_MM] {
            let problem = Problem::new(356, n_unknowns, noise_mm);
            let file = folder.join("agree.problem");
            let ours = run_crate(&problem, 1, 1, &HEAP);
            comparison::write_problem(&problem, &ours.name, &file);
            let mut answers = vec![peers.newton(&file, 1, 1), peers.scipy(&file, 1, 1)];
            for derivatives in ["automatic", "analytic"] {
                for solver in NORMAL.iter().chain(&OTHERS) {
                    answers.push(peers.ceres(&file, derivatives, solver, "sparse-qr", 1, 1));
                }
            }
            for covariance in ["dense-svd", "normal"] {
                answers.push(peers.ceres(&file, "analytic", "dense-qr", covariance, 1, 1));
            }
            for theirs in answers.iter().flatten() {
                compare(&ours, theirs, noise_mm > 0.0);
            }
        }
    }
    STUDIES.iter().for_each(|study| identify_all(peers, folder, study, 1).into_iter().for_each(drop));
}

/// One size of problem: everybody's best times.
struct Size {
    n_touches: usize,
    n_unknowns: usize,
    /// Per number of threads.
    rows: Vec<Row>,
}

struct Row {
    n_threads: usize,
    ours: Answer,
    /// All of `identify`: time, s, and heap, KiB.
    identify: (f64, f64),
    newton: Option<Answer>,
    scipy: Option<Answer>,
    /// Fits by solver.
    ceres: Vec<Answer>,
    /// Covariances by way.
    covariances: Vec<Answer>,
}

impl Row {
    /// Fit by normal equations with analytic derivatives, and `ceres::Covariance`, s.
    fn ceres_normal_s(&self) -> Option<f64> {
        let fit = self.fastest(|s| s.contains("analytic") && NORMAL.iter().any(|n| s.split(' ').any(|w| w == *n)));
        let covariance = self.covariances.iter().filter(|a| !a.solver.ends_with(" normal")).map(|a| a.covariance_s);
        Some(fit? + covariance.reduce(f64::min)?)
    }

    /// The fastest fit of all, and the fastest covariance, `ceres::Covariance` or by hand, s.
    fn ceres_best_s(&self) -> Option<f64> {
        Some(self.fastest(|_| true)? + self.covariances.iter().map(|a| a.covariance_s).reduce(f64::min)?)
    }

    fn fastest(&self, which: impl Fn(&str) -> bool) -> Option<f64> {
        self.ceres.iter().filter(|a| which(&a.solver)).map(|a| a.fit_s).reduce(f64::min)
    }
}

fn measure(peers: &Peers, folder: &Path, n_touches: usize, n_unknowns: usize) -> Size {
    let problem = Problem::new(n_touches, n_unknowns, problems::SIGMA_MM);
    let file = folder.join("table.problem");
    let repeats = (300_000 / n_touches).clamp(3, 50);
    let all = DECISIVE.contains(&(n_touches, n_unknowns));
    let mut rows = Vec::new();
    for n_threads in [1, 2] {
        eprintln!("{n_touches} x {n_unknowns}, {n_threads} thread(s)");
        let ours = run_crate(&problem, n_threads, repeats, &HEAP);
        comparison::write_problem(&problem, &ours.name, &file);
        let ceres = |derivatives: &str, solver: &str, covariance: &str| {
            peers.ceres(&file, derivatives, solver, covariance, n_threads, repeats.min(10))
        };
        let mut fits: Vec<Option<Answer>> = Vec::new();
        fits.extend(NORMAL.iter().chain(&OTHERS[..1]).map(|s| ceres("analytic", s, "normal")));
        fits.push(ceres("automatic", "sparse-normal", "normal"));
        if all {
            fits.extend(OTHERS[1..].iter().map(|s| ceres("analytic", s, "normal")));
            fits.extend(["dense-normal-lapack", "dense-schur"].map(|s| ceres("automatic", s, "normal")));
        }
        let ways = ["normal", "sparse-qr", "dense-svd"];
        let covariances = ways[..if all { 3 } else { 2 }].iter().map(|c| ceres("analytic", "sparse-normal", c));
        let row = Row {
            n_threads,
            newton: peers.newton(&file, n_threads, repeats),
            scipy: peers.scipy(&file, n_threads, repeats.min(3)),
            covariances: covariances.flatten().collect(),
            ceres: fits.into_iter().flatten().collect(),
            identify: run_identify(&problem, n_threads, (30_000 / n_touches).clamp(1, 10), &HEAP),
            ours,
        };
        let others = row.ceres.iter().chain(&row.covariances).chain(&row.newton).chain(&row.scipy);
        others.for_each(|theirs| compare(&row.ours, theirs, true));
        rows.push(row);
    }
    Size { n_touches, n_unknowns, rows }
}

fn milliseconds(seconds: f64) -> String {
    let ms = seconds * 1e3;
    if ms < 10.0 { format!("{ms:.2}") } else { format!("{ms:.0}") }
}

/// "time (ratio to ours)".
fn beside(theirs: Option<f64>, ours: f64) -> String {
    theirs.map_or_else(|| "left out".to_owned(), |s| format!("{} ({:.1})", milliseconds(s), s / ours))
}

fn table(results: &[Size]) -> String {
    let mut out = String::from(
        "## Fit with covariance\n\nMilliseconds, fastest run; in brackets how many times as long as axiscal.\n\n\
         | touches x unknowns | threads | axiscal | Gauss-Newton by hand | Ceres, normal equations | Ceres, best of all | SciPy | heap / dense Jacobian \
         | all of `identify` | its heap / dense Jacobian |\n|---|---|---|---|---|---|---|---|---|---|\n",
    );
    for size in results {
        let jacobian_kb = (size.n_touches * size.n_unknowns * 8) as f64 / 1024.0;
        for row in &size.rows {
            let ours = row.ours.total_s();
            writeln!(
                out,
                "| {} x {} | {} | {} | {} | {} | {} | {} | {:.2} | {} | {:.2} |",
                size.n_touches,
                size.n_unknowns,
                row.n_threads,
                milliseconds(ours),
                beside(row.newton.as_ref().map(Answer::total_s), ours),
                beside(row.ceres_normal_s(), ours),
                beside(row.ceres_best_s(), ours),
                beside(row.scipy.as_ref().map(Answer::total_s), ours),
                (row.ours.peak_kb - row.ours.loaded_kb) / jacobian_kb,
                milliseconds(row.identify.0),
                row.identify.1 / jacobian_kb,
            )
            .unwrap();
        }
    }
    out.push('\n');
    out
}

/// All solvers at the sizes that decide.
fn solvers(results: &[Size]) -> String {
    let mut out = String::new();
    for size in results.iter().filter(|s| DECISIVE.contains(&(s.n_touches, s.n_unknowns))) {
        write!(
            out,
            "## All solvers at {} x {}\n\nThe resident set grows during the fit by the memory given.\n\n\
             | solver | threads | iterations | fit, ms | covariance, ms | memory, MiB |\n|---|---|---|---|---|---|\n",
            size.n_touches, size.n_unknowns
        )
        .unwrap();
        for row in &size.rows {
            let covariances = row.covariances.iter().filter(|a| !a.solver.ends_with(" normal"));
            let others = row.newton.iter().chain(&row.ceres).chain(covariances).chain(&row.scipy);
            for a in std::iter::once(&row.ours).chain(others) {
                let memory_mib = (a.peak_kb - a.loaded_kb) / 1024.0;
                writeln!(
                    out,
                    "| {} | {} | {} | {} | {} | {memory_mib:.1} |",
                    a.solver,
                    row.n_threads,
                    a.iterations,
                    milliseconds(a.fit_s),
                    if a.covariance_s > 0.0 { milliseconds(a.covariance_s) } else { "in the fit".into() },
                )
                .unwrap();
            }
        }
        out.push('\n');
    }
    out
}

fn whole_process(peers: &Peers, folder: &Path) -> String {
    let mut out = String::from(
        "## Whole process: `identify` on 356 touches\n\nFrom the call to the answer in JSON, files read \
         included: median (fastest) of runs that follow one of the same program, the programs in turn, ms. Ratio: how many times as \
         fast as the script.\n\n\
         | unknowns | other processes | `identify --quick` | `identify` | SciPy (`benches/peers/identify.py`) | ratio |\n\
         |---|---|---|---|---|---|\n",
    );
    for study in &STUDIES {
        for busy in [false, true] {
            let other = busy.then(OneCore::busy);
            let [quick, plain, theirs] = identify_all(peers, folder, study, 6);
            drop(other);
            let ms = |times: &Option<comparison::Times>| {
                times.as_ref().map_or_else(
                    || "left out".to_owned(),
                    |t| format!("{} ({})", milliseconds(t.median_s), milliseconds(t.least_s)),
                )
            };
            let ratio = plain.as_ref().zip(theirs.as_ref()).map_or_else(String::new, |(ours, theirs)| {
                format!("{:.0} ({:.0})", theirs.median_s / ours.median_s, theirs.least_s / ours.least_s)
            });
            writeln!(
                out,
                "| {} | {} | {} | {} | {} | {ratio} |",
                study.unknowns,
                if busy { "one core busy" } else { "none" },
                ms(&quick),
                ms(&plain),
                ms(&theirs)
            )
            .unwrap();
        }
    }
    out.push('\n');
    out
}

/// A process that keeps one core busy.
struct OneCore(std::process::Child);

impl OneCore {
    fn busy() -> Self {
        Self(std::process::Command::new("sh").args(["-c", "while :; do :; done"]).spawn().unwrap())
    }
}

impl Drop for OneCore {
    fn drop(&mut self) {
        self.0.kill().unwrap();
        self.0.wait().unwrap();
    }
}

/// What this was measured on.
fn machine() -> String {
    let field = |file: &str, key: &str| -> String {
        let text = std::fs::read_to_string(file).unwrap_or_default();
        let line = text.lines().find(|l| l.starts_with(key)).unwrap_or_default();
        line.split_once(':').map_or("unknown", |(_, v)| v.trim()).to_owned()
    };
    let memory_kib: f64 = field("/proc/meminfo", "MemTotal").trim_end_matches(" kB").parse().unwrap_or(f64::NAN);
    format!(
        "Measured on: {}, {} of its processors, {:.0} GiB of memory.\n\n",
        field("/proc/cpuinfo", "model name"),
        std::thread::available_parallelism().map_or(1, std::num::NonZero::get),
        memory_kib / 1024.0 / 1024.0
    )
}

/// Replaces what stands between the marks of `docs/performance.md`.
fn insert(text: &str) {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/performance.md");
    let old = std::fs::read_to_string(&path).unwrap();
    let (head, rest) = old.split_once("<!-- measured -->\n").expect("docs/performance.md has its first mark");
    let (_, tail) = rest.split_once("<!-- end -->").expect("docs/performance.md has its second mark");
    std::fs::write(&path, format!("{head}<!-- measured -->\n{text}<!-- end -->{tail}")).unwrap();
}
