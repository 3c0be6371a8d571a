//! What people see: no line is wider than the terminal, a pipe gets neither colours nor bars, `NO_COLOR` is heard.

use assert_cmd::Command;
use portable_pty::{CommandBuilder, PtySize, native_pty_system};
use std::io::Read;
use std::path::Path;
use std::sync::OnceLock;

/// A machine with something missing in its model, and a later run of it.
const HIDDEN: &str = "seed = 4\n[effects.location-c]\nEX0C = 0.012\n[effects.radial-c-2]\nEXC2c = 6.0\nEYC2s = -5.0\n[noise]\ntouch_um = 0.5\n";

pub(super) fn axiscal(folder: &Path, columns: Option<&str>, args: &[&str]) -> std::process::Output {
    let mut command = Command::cargo_bin("axiscal").unwrap();
    command.current_dir(folder).args(args).env_remove("COLUMNS").env_remove("NO_COLOR");
    if let Some(columns) = columns {
        command.env("COLUMNS", columns);
    }
    command.output().unwrap()
}

/// The folder that all tests read; what a verb changes is changed in a copy.
pub(super) fn folder() -> &'static Path {
    static FOLDER: OnceLock<tempfile::TempDir> = OnceLock::new();
    FOLDER
        .get_or_init(|| {
            let folder = tempfile::tempdir().unwrap();
            let at = folder.path();
            let ok = |args: &[&str]| {
                let out = axiscal(at, None, args);
                assert!(out.status.success(), "{args:?}: {}", String::from_utf8_lossy(&out.stderr));
            };
            let common = ["--machine", "swivel-head", "--controller", "linuxcnc", "--out"];
            for p in ["head", "table"] {
                ok(&[&["generate", "--program", p][..], &common, &["."]].concat());
            }
            for (study, seed) in [("study", 4), ("later", 5)] {
                let wrong = HIDDEN.replace("seed = 4", &format!("seed = {seed}"));
                std::fs::write(at.join(format!("{study}.wrong.toml")), wrong).unwrap();
                let mut new = vec!["new".to_owned()];
                for p in ["head", "table"] {
                    let (plan, log) = (format!("{p}.plan.json"), format!("{study}-{p}.log"));
                    let wrong = format!("{study}.wrong.toml");
                    ok(&[&["simulate", "--plan", &plan, "--scenario", &wrong][..], &common, &[&log]].concat());
                    new.extend(["--plan".to_owned(), plan, "--log".to_owned(), log]);
                }
                let file = format!("{study}.toml");
                let words: Vec<&str> = new.iter().map(String::as_str).collect();
                ok(&[&words[..], &common, &[&file]].concat());
            }
            folder
        })
        .path()
}

/// A copy, for verbs that write.
pub(super) fn copy() -> tempfile::TempDir {
    let to = tempfile::tempdir().unwrap();
    for entry in std::fs::read_dir(folder()).unwrap() {
        let entry = entry.unwrap();
        std::fs::copy(entry.path(), to.path().join(entry.file_name())).unwrap();
    }
    to
}

const READING: [&[&str]; 10] = [
    &["identify", "study.toml"],
    &["identify", "study.toml", "--verbose"],
    &["compare", "study.toml"],
    &["compare", "study.toml", "--all"],
    &["diagnose", "study.toml"],
    &["diagnose", "study.toml", "--verbose"],
    &["history", "study.toml"],
    &["verify", "study.toml", "later.toml"],
    &["assess", "--machine", "swivel-head", "--plan", "head.plan.json"],
    &["assess", "--machine", "swivel-head", "--plan", "head.plan.json", "--plan", "table.plan.json"],
];

const WRITING: [&[&str]; 3] = [
    &[
        "plan-next",
        "study.toml",
        "--out",
        "n",
        "--controller",
        "linuxcnc",
        "--minutes",
        "4",
        "--effects",
        "radial-c-1,radial-c-3",
    ],
    &["solve", "study.toml", "--yes"],
    &["sketch-effect", "study.toml", "--out", "mine.toml"],
];

fn width(line: &str) -> usize {
    line.chars().count()
}

/// What a person copies stays on its line, however long it is.
fn is_copied(line: &str) -> bool {
    let line = line.trim_start();
    ["next: axiscal", "when it has run: axiscal", "written:", "plan = ", "log = ", "mounting = "]
        .iter()
        .any(|w| line.starts_with(w))
}

fn looks_good(args: &[&str], text: &str, columns: usize) {
    for line in text.lines() {
        assert!(width(line) <= columns || is_copied(line), "{args:?}: {} columns: {line}", width(line));
    }
    assert!(!text.contains('\u{1b}'), "{args:?}: colours in a pipe");
    let bar = |c: char| ('\u{2500}'..='\u{259f}').contains(&c) || ('\u{2800}'..='\u{28ff}').contains(&c);
    assert!(!text.contains(bar), "{args:?}: bars in a pipe: {text}");
}

#[test]
fn no_line_is_wider_than_the_terminal() {
    for columns in ["80", "160"] {
        let n: usize = columns.parse().unwrap();
        for args in READING {
            let out = axiscal(folder(), Some(columns), args);
            assert!(out.status.code().is_some_and(|c| c < 2), "{args:?}: {}", String::from_utf8_lossy(&out.stderr));
            let text = String::from_utf8(out.stdout).unwrap();
            assert!(text.lines().count() > 3, "{args:?}: {text}");
            looks_good(args, &text, n);
        }
        let own = copy();
        for args in WRITING {
            let out = axiscal(own.path(), Some(columns), args);
            assert!(out.status.code().is_some_and(|c| c < 2) || args[0] == "sketch-effect", "{args:?}");
            looks_good(args, &String::from_utf8(out.stdout).unwrap(), n);
        }
    }
}

#[test]
fn a_pipe_of_no_stated_width_gets_tables_of_eighty_columns() {
    for args in READING {
        let text = String::from_utf8(axiscal(folder(), None, args).stdout).unwrap();
        assert!(!text.contains('\u{1b}'), "{args:?}");
        // rules of tables; sentences stay whole
        for line in text.lines().filter(|l| l.starts_with("---")) {
            assert!(width(line) <= 80, "{args:?}: {line}");
        }
    }
}

/// A table as it stands on the paper: the heads of its columns with what is below each, line by line.
type Columns = Vec<(String, Vec<String>)>;

/// The tables of a text that have their heads on one line each.
fn tables(text: &str) -> Vec<Columns> {
    let mut out: Vec<Columns> = Vec::new();
    let mut rules = 0;
    for line in text.lines() {
        let letters: Vec<char> = line.chars().collect();
        if line.starts_with("---") {
            // above the head, below it, and at the end
            rules = (rules + 1) % 3;
        } else if rules == 1 {
            // heads are separated by two blanks at least, and stand at the left of their columns
            let begins =
                (0..letters.len()).filter(|&i| letters[i] != ' ' && letters[i.saturating_sub(2)..i] == [' ', ' ']);
            let mut begins: Vec<usize> = begins.collect();
            begins.insert(0, 0);
            begins.dedup_by_key(|b| if *b == 1 { 0 } else { *b });
            let until = begins.iter().skip(1).copied().chain([letters.len()]);
            let head = |(from, to): (&usize, usize)| letters[*from..to].iter().collect::<String>().trim().to_owned();
            let heads = begins.iter().zip(until).map(head);
            out.push(heads.map(|h| (h, Vec::new())).collect());
            let last = out.last_mut().unwrap();
            last.iter_mut().zip(&begins).for_each(|(c, b)| c.1.push(b.to_string()));
        } else if rules == 2 {
            let columns = out.last_mut().unwrap();
            let begins: Vec<usize> = columns.iter().map(|c| c.1[0].parse().unwrap()).collect();
            for (i, (_, cells)) in columns.iter_mut().enumerate() {
                let to = begins.get(i + 1).copied().unwrap_or(letters.len()).min(letters.len());
                cells.push(letters[begins[i].min(to)..to].iter().collect::<String>().trim().to_owned());
            }
        }
    }
    for (_, cells) in out.iter_mut().flatten() {
        cells.remove(0);
    }
    out
}

/// The lines of a text that stand in tables.
fn in_tables(text: &str) -> Vec<&str> {
    let mut rules = 0;
    text.lines()
        .filter(|l| {
            let rule = l.starts_with("---");
            rules += usize::from(rule);
            !rule && rules % 3 != 0
        })
        .collect()
}

fn is_number(word: &str) -> bool {
    word.parse::<f64>().is_ok()
}

/// A number that is cut in two is two wrong ones. What a narrow paper has no room for it leaves out and says so.
#[test]
fn a_number_is_never_broken() {
    let adding: &[&str] = &["add", "study.toml", "radial-c-2", "--dry-run"];
    let residuals: &[&str] = &["identify", "study.toml", "--residuals"];
    let mut n_compared = 0;
    for args in READING.into_iter().chain([adding, residuals]) {
        let printed = |columns: Option<&str>| String::from_utf8(axiscal(folder(), columns, args).stdout).unwrap();
        let wide = printed(Some("160"));
        for narrow in [printed(Some("80")), printed(None)] {
            let sentences = narrow.replace("\n  ", " ");
            let left_out = sentences.lines().find_map(|l| l.strip_prefix("no room for: ")).unwrap_or_default();
            let left_out: Vec<&str> = left_out.split(" (").next().unwrap().split(", ").collect();
            let mut words: std::collections::BTreeMap<&str, i64> = std::collections::BTreeMap::new();
            let lines = in_tables(&narrow);
            for word in lines.iter().flat_map(|l| l.split_whitespace()) {
                *words.entry(word).or_default() += 1;
            }
            for (head, cells) in tables(&wide).iter().flatten() {
                if left_out.contains(&head.as_str()) {
                    continue;
                }
                for word in cells.iter().flat_map(|c| c.split_whitespace()).filter(|w| is_number(w)) {
                    let left = words.get_mut(word).map_or(-1, |n| {
                        *n -= 1;
                        *n
                    });
                    assert!(left >= 0, "{args:?}: {word} of {head:?} is broken or gone:\n{narrow}");
                    n_compared += 1;
                }
                // an interval is no number without its sign
                for interval in cells.iter().filter(|c| c.starts_with("± ")) {
                    // a column without a head stands behind it in `verify`
                    let interval = interval.split_whitespace().take(2).collect::<Vec<_>>().join(" ");
                    assert!(lines.iter().any(|l| l.contains(&interval)), "{args:?}: {interval}:\n{narrow}");
                }
            }
        }
    }
    println!("{n_compared} numbers compared");
    assert!(n_compared > 1000, "{n_compared}");
}

/// By value, interval and status a reader decides: they stay on the narrowest paper, on one line with the name and the unit.
#[test]
fn a_parameter_has_its_value_interval_and_unit_on_one_line() {
    let printed = |columns: &str| {
        String::from_utf8(axiscal(folder(), Some(columns), &["identify", "study.toml"]).stdout).unwrap()
    };
    let wide = tables(&printed("160")).swap_remove(0);
    let column = |head: &str| wide.iter().find(|(h, _)| h == head).map(|(_, cells)| cells.clone()).unwrap();
    let (names, values, units, intervals) = (column("parameter"), column("value"), column("unit"), column("95 %"));
    assert!(names.len() > 8);
    for columns in ["80", "64"] {
        let narrow = printed(columns);
        let lines = in_tables(&narrow);
        assert!(lines[0].contains("status"), "{narrow}");
        for i in 0..names.len() {
            let parts = [&names[i], &values[i], &units[i], &intervals[i]];
            let one = |l: &&&str| parts.iter().all(|p| format!(" {l} ").contains(&format!(" {p} ")));
            assert_eq!(lines.iter().filter(one).count(), 1, "{parts:?}:\n{narrow}");
        }
    }
}

/// What a verb prints in a terminal of so many columns.
fn in_a_terminal(args: &[&str], columns: u16, no_color: bool) -> String {
    let size = PtySize { rows: 40, cols: columns, pixel_width: 0, pixel_height: 0 };
    let pair = native_pty_system().openpty(size).unwrap();
    let mut command = CommandBuilder::new(assert_cmd::cargo::cargo_bin("axiscal"));
    command.cwd(folder());
    command.env_remove("COLUMNS");
    command.env_remove("NO_COLOR");
    command.env("TERM", "xterm-256color");
    if no_color {
        command.env("NO_COLOR", "1");
    }
    for a in args {
        command.arg(a);
    }
    let mut child = pair.slave.spawn_command(command).unwrap();
    drop(pair.slave);
    let mut reader = pair.master.try_clone_reader().unwrap();
    let reading = std::thread::spawn(move || {
        let (mut all, mut part) = (Vec::new(), [0u8; 4096]);
        // a terminal whose program has ended gives an error in place of an end
        while let Ok(n) = reader.read(&mut part) {
            if n == 0 {
                break;
            }
            all.extend_from_slice(&part[..n]);
        }
        all
    });
    child.wait().unwrap();
    drop(pair.master);
    String::from_utf8_lossy(&reading.join().unwrap()).into_owned()
}

/// Without escape sequences.
fn bare(text: &str) -> String {
    let mut out = String::new();
    let mut chars = text.chars();
    while let Some(c) = chars.next() {
        if c == '\u{1b}' {
            // CSI … a letter
            let _ = chars.by_ref().find(char::is_ascii_alphabetic);
        } else {
            out.push(c);
        }
    }
    out
}

/// Some terminals (a serial line, a build server's pty) do not know their size.
#[test]
fn a_terminal_of_no_size_gets_tables_that_can_be_read() {
    let text = bare(&in_a_terminal(&["compare", "study.toml"], 0, true));
    let rule = text.lines().find(|l| l.starts_with('\u{2500}')).unwrap();
    assert!(width(rule.trim_end()) > 60 && text.contains("split by"), "{text}");
}

#[test]
fn a_terminal_gets_colours_unless_it_does_not_want_them() {
    for columns in [80, 160] {
        for args in [&["compare", "study.toml"][..], &["diagnose", "study.toml"], &["identify", "study.toml"]] {
            let coloured = in_a_terminal(args, columns, false);
            let plain = in_a_terminal(args, columns, true);
            if args[0] == "compare" {
                assert!(coloured.contains("\u{1b}["), "no colour in a terminal");
                assert!(plain.chars().any(|c| ('\u{2800}'..='\u{28ff}').contains(&c)), "{plain}");
            }
            assert!(!plain.contains('\u{1b}'), "{args:?}: colours in spite of NO_COLOR");
            for line in bare(&coloured).lines().chain(plain.lines()) {
                let line = line.trim_end_matches('\r');
                assert!(width(line) <= usize::from(columns) || is_copied(line), "{args:?} {columns}: {line}");
            }
        }
    }
}
