//! Reading logs of a million lines, beside a plain C++ reader, polars' CSV reader and Python's `re`, in one run.
//!
//! `cargo bench --bench logs` prints the table, `-- --write` puts it into `docs/performance.md` as well. Without `--bench`
//! (`cargo test`), and with `-- --answers`, small logs are read once and the answers compared. Peers are what
//! `benches/peers/run` finds; `AXISCAL_PEERS_REQUIRED=1` makes a missing one an error.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)] // a benchmark that cannot run says where

mod problems;

use axiscal::log::{self, ParsedLog, Writer};
use axiscal::post::{LogRecord, Postprocessor};
use problems::Problem;
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::Path;
use std::process::Command;
use std::time::Instant;

/// Controllers whose logs are read: six decimals without padding, four with DPRNT's.
const CONTROLLERS: [&str; 2] = ["linuxcnc", "fanuc"];

fn main() {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let has = |word: &str| words.iter().any(|w| w == word);
    let timed = has("--bench") && !has("--answers");
    let peers = Peers::find(has("--bench"));
    let folder = tempfile::tempdir().unwrap();
    let n_touches = if timed { 1_000_000 } else { 1_000 };
    let mut table = String::from(
        "## Logs of a million lines\n\nFastest of several runs; from the bytes in memory to touches with their lines, findings included. \
         MB/s of the file that each reads; in brackets how many times as long as axiscal for the same touches on as many threads.\n\n\
         | log | MB | axiscal, 1 thread | 2 threads | matched to the plan too | C++ `from_chars`, 1 | polars CSV, 1 | polars CSV, 2 | Python `re` |\n\
         |---|---|---|---|---|---|---|---|---|\n",
    );
    let problem = Problem::new(n_touches, 15, 0.001);
    for controller in CONTROLLERS {
        let text = row(controller, &problem, &peers, folder.path(), if timed { 9 } else { 1 });
        eprint!("{text}");
        table.push_str(&text);
    }
    if timed {
        println!("\n{table}");
    }
    if timed && has("--write") {
        insert(&table);
    }
}

/// Reads one controller's log in every way; panics where the answers differ.
fn row(controller: &str, problem: &Problem, peers: &Peers, folder: &Path, repeats: usize) -> String {
    let (post, _) = Postprocessor::load_built_in_or_file(controller).unwrap();
    let Problem { machine, plan, touches, .. } = problem;
    let records: Vec<LogRecord> =
        touches.iter().map(|t| LogRecord { id: t.id, status: t.status, position: t.position, time_s: None }).collect();
    let text = post.log_text(machine, plan, &records);
    let log_file = folder.join(format!("{controller}.log"));
    std::fs::write(&log_file, &text).unwrap();
    let csv_file = folder.join(format!("{controller}.csv"));
    std::fs::write(&csv_file, as_csv(&text)).unwrap();
    let csv_bytes = std::fs::metadata(&csv_file).unwrap().len() as f64;
    let bytes = text.as_bytes();
    let parsed = || log::parse(bytes, "run.log", &post).unwrap().0;
    let [one, two] = [1, 2].map(|n| in_pool(n, || fastest(repeats, parsed)));
    let matched = in_pool(1, || {
        fastest(repeats.min(3), || log::read(bytes, "run.log", Writer::Controller(&post), machine, plan).unwrap())
    });
    let answer = parsed();
    let (count, sum) = (answer.touches.len(), x_sum(&answer));
    assert_eq!(count, touches.len());
    let run = |found: Option<Found>| {
        found.inspect(|f| {
            assert!(f.count == count && (f.sum - sum).abs() <= 1e-9 * sum.abs().max(1.0), "{f:?}: {count} {sum}");
        })
    };
    let cpp = run(peers.cpp(&log_file, repeats));
    let polars = [1, 2].map(|n| run(peers.polars(&csv_file, n, repeats)));
    let regex = run(peers.regex(&log_file, repeats.min(2)));
    let shown = |found: Option<Found>, size: f64, ours: f64| match found {
        Some(f) => format!("{:.0} ({:.2})", size / f.seconds / 1e6, f.seconds / ours),
        None => "left out".to_owned(),
    };
    let size = bytes.len() as f64;
    let mut out = String::new();
    writeln!(
        out,
        "| {controller} | {:.0} | {:.0} | {:.0} | {:.0} | {} | {} | {} | {} |",
        size / 1e6,
        size / one / 1e6,
        size / two / 1e6,
        size / matched / 1e6,
        shown(cpp, size, one),
        shown(polars[0], csv_bytes, one),
        shown(polars[1], csv_bytes, two),
        shown(regex, size, one),
    )
    .unwrap();
    out
}

/// The same numbers, digit for digit, as a CSV with a header: what polars reads at its best.
fn as_csv(log: &str) -> String {
    let mut out = String::with_capacity(log.len());
    for line in log.lines().filter(|l| l.starts_with('P')) {
        let words = line[1..].trim_start();
        if out.is_empty() {
            let letters: Vec<String> = words.chars().filter(char::is_ascii_uppercase).map(|c| c.to_string()).collect();
            out.push_str(&letters.join(","));
            out.push('\n');
        }
        let mut first = true;
        for word in words.split(|c: char| c.is_ascii_uppercase()).skip(1) {
            if !std::mem::take(&mut first) {
                out.push(',');
            }
            out.extend(word.chars().filter(|c| *c != ' '));
        }
        out.push('\n');
    }
    out
}

fn x_sum(parsed: &ParsedLog) -> f64 {
    parsed.touches.iter().map(|t| t.position.0[0]).sum()
}

fn in_pool<T: Send>(n_threads: usize, work: impl FnOnce() -> T + Send) -> T {
    rayon::ThreadPoolBuilder::new().num_threads(n_threads).build().unwrap().install(work)
}

fn fastest<T>(repeats: usize, work: impl Fn() -> T) -> f64 {
    let once = || {
        let begin = Instant::now();
        let out = work();
        let took = begin.elapsed().as_secs_f64();
        drop(out);
        took
    };
    (0..repeats).map(|_| once()).fold(f64::INFINITY, f64::min)
}

/// What a peer answers.
#[derive(Debug, Clone, Copy)]
struct Found {
    seconds: f64,
    count: usize,
    sum: f64,
}

/// Programs by name.
struct Peers(BTreeMap<String, String>);

impl Peers {
    fn find(install: bool) -> Self {
        let here = Path::new(env!("CARGO_MANIFEST_DIR")).join("benches/peers");
        let mut command = Command::new(here.join("run"));
        if !install {
            command.arg("--no-install");
        }
        let text = command.output().map(|o| String::from_utf8_lossy(&o.stdout).into_owned()).unwrap_or_default();
        let pair = |l: &str| l.split_once('\t').map(|(name, path)| (name.to_owned(), path.to_owned()));
        let mut peers: BTreeMap<String, String> = text.lines().filter_map(pair).collect();
        peers.entry("re".into()).or_insert_with(|| "python3".into());
        for name in ["log_read", "polars"] {
            let there = peers.contains_key(name);
            assert!(there || std::env::var_os("AXISCAL_PEERS_REQUIRED").is_none(), "the peer {name} is not there");
        }
        Self(peers)
    }

    fn call(mut command: Command) -> Option<Found> {
        let output = command.output().ok().filter(|o| o.status.success())?;
        let text = String::from_utf8_lossy(&output.stdout).into_owned();
        let [seconds, count, sum] = text.split_whitespace().collect::<Vec<_>>()[..] else { return None };
        Some(Found { seconds: seconds.parse().ok()?, count: count.parse().ok()?, sum: sum.parse().ok()? })
    }

    fn cpp(&self, file: &Path, repeats: usize) -> Option<Found> {
        let mut command = Command::new(self.0.get("log_read")?);
        command.arg(file).arg(repeats.to_string());
        Self::call(command)
    }

    fn python(&self, which: &str, file: &Path, repeats: usize) -> Option<Command> {
        let mut command = Command::new(self.0.get(which)?);
        command.arg(Path::new(env!("CARGO_MANIFEST_DIR")).join("benches/peers/log_read.py"));
        command.arg(which).arg(file).arg(repeats.to_string());
        Some(command)
    }

    fn polars(&self, file: &Path, n_threads: usize, repeats: usize) -> Option<Found> {
        let mut command = self.python("polars", file, repeats)?;
        command.env("POLARS_MAX_THREADS", n_threads.to_string());
        Self::call(command)
    }

    fn regex(&self, file: &Path, repeats: usize) -> Option<Found> {
        Self::call(self.python("re", file, repeats)?)
    }
}

/// Replaces what stands between the marks of `docs/performance.md`.
fn insert(text: &str) {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/performance.md");
    let old = std::fs::read_to_string(&path).unwrap();
    let (head, rest) = old.split_once("<!-- logs measured -->\n").expect("docs/performance.md has its mark");
    let (_, tail) = rest.split_once("<!-- logs end -->").expect("docs/performance.md has its second mark");
    std::fs::write(&path, format!("{head}<!-- logs measured -->\n{text}\n<!-- logs end -->{tail}")).unwrap();
}
