//! Every emitted program against what is known of its control, written from documents and not from the postprocessor files.

use crate::controllers::{controller, generated, machine, programs, written};
use axiscal::post::NcProgram;
use std::collections::BTreeMap;
use std::path::Path;

/// A range or a list of numbers.
fn numbers(facts: &toml::Table, key: &str) -> Vec<i64> {
    facts[key].as_array().unwrap().iter().map(|n| n.as_integer().unwrap()).collect()
}

fn within(facts: &toml::Table, key: &str, n: i64) -> bool {
    let range = numbers(facts, key);
    (range[0]..=range[1]).contains(&n)
}

fn words(facts: &toml::Table, key: &str) -> Vec<String> {
    facts[key].as_array().unwrap().iter().map(|n| n.as_str().unwrap().to_owned()).collect()
}

/// The numbers right behind a text, wherever it stands.
fn behind(line: &str, text: &str) -> Vec<i64> {
    let digits = |rest: &str| rest[..rest.find(|c: char| !c.is_ascii_digit()).unwrap_or(rest.len())].parse().ok();
    line.match_indices(text).filter_map(|(at, _)| digits(&line[at + text.len()..])).collect()
}

/// The axes of a machine by their numbers at the control.
fn macro_b(facts: &toml::Table, letters: &str, by_count: bool, texts: &[String], what: &str) {
    let given = facts["axis_numbers"].as_table().unwrap();
    let number = |(at, letter): (usize, char)| match by_count {
        true => at as i64 + 1,
        false => given[&letter.to_string()].as_integer().unwrap(),
    };
    let axes: Vec<i64> = letters.chars().enumerate().map(number).collect();
    let (positions, system) = (numbers(facts, "positions"), numbers(facts, "system"));
    let waits = words(facts, "waits");
    for (place, text) in texts.iter().enumerate() {
        // a program begins with nothing under way
        let mut waited = true;
        for line in text.lines().filter(|l| !l.starts_with('(')) {
            for n in behind(line, "#") {
                let known = within(facts, "locals", n)
                    || within(facts, "common", n)
                    || system.contains(&n)
                    || (positions.contains(&(n / 10)) && axes.contains(&(n % 10)));
                assert!(known, "{what}: #{n} in {line}");
                let reads_position = n / 10 == 502 || n / 10 == 504;
                assert!(!reads_position || waited, "{what}: #{n} is read while blocks may be under way: {line}");
            }
            if line.starts_with("G0 ") || line.starts_with("G1 ") || line.starts_with("G52 ") {
                waited = false;
            }
            waited |= waits.iter().any(|w| line == w || line.starts_with(&format!("{w} ")));
            assert!(
                line.strip_prefix('N').is_none_or(|n| n.parse().is_ok_and(|n| within(facts, "labels", n))),
                "{line}"
            );
            assert!(
                behind(line, "GOTO").iter().chain(&behind(line, "M99 P")).all(|n| within(facts, "labels", *n)),
                "{line}"
            );
            assert!(
                line.strip_prefix('O').is_none_or(|n| n.parse().is_ok_and(|n| within(facts, "programs", n))),
                "{line}"
            );
            assert!(behind(line, "G65 P").iter().all(|n| within(facts, "programs", *n)), "{line}");
            // the number of an alarm: the touch, less what is said beside it
            if let Some(rest) = line.strip_prefix("#3000=#3") {
                let less = rest.strip_prefix('-').map_or(0, |r| behind(r, "")[0]);
                let most = numbers(facts, "alarms")[1];
                let limit = format!("IF[#3GT{}]", less + most);
                let before = text[..text.find(line).unwrap()].lines().next_back().unwrap();
                assert!(before.starts_with(&limit), "{what}: {before} before {line}");
            }
            if line.starts_with("DPRNT[") {
                let fields = line.split('#').skip(1).map(|f| &f[f.find('[').unwrap() + 1..f.find(']').unwrap()]);
                let places = |f: &str| f.bytes().map(|b| i64::from(b - b'0')).sum::<i64>();
                fields.for_each(|f| assert!(places(f) <= facts["field_places"].as_integer().unwrap(), "{line}"));
            }
        }
        assert!(place == 0 || text.trim_end().ends_with("M99\n%"), "{what}: a program that is called ends with M99");
    }
}

fn heidenhain(facts: &toml::Table, texts: &[String], what: &str) {
    for line in texts[0].lines() {
        let block = line.split_once(' ').unwrap().1;
        if block.starts_with(';') {
            continue;
        }
        assert!(behind(block, "LBL ").iter().all(|n| within(facts, "labels", *n)), "{what}: {line}");
        assert!(behind(block, "Q").iter().all(|n| within(facts, "parameters", *n)), "{what}: {line}");
    }
}

fn sinumerik(facts: &toml::Table, texts: &[String], nc: &NcProgram, what: &str) {
    let notes = &nc.beside.iter().find(|f| f.name.ends_with(".notes.txt")).unwrap().text;
    words(facts, "notes").iter().for_each(|w| assert!(notes.contains(w.as_str()), "{what}: {w} is not in the notes"));
    for line in texts.iter().flat_map(|t| t.lines()) {
        words(facts, "never").iter().for_each(|w| assert!(!line.contains(w.as_str()), "{what}: {line}"));
        let names = line.split(|c: char| !(c.is_ascii_alphanumeric() || c == '_')).filter(|w| w.starts_with("AX"));
        names.for_each(|n| assert!(within(facts, "names", n.len() as i64), "{what}: {n}"));
    }
}

#[test]
fn every_emitted_program_holds_to_what_is_known_of_its_control() {
    let facts: toml::Table = include_str!("facts.toml").parse().unwrap();
    for (machine_name, program, letters) in [
        ("swivel-head", "head", "XYZBC"),
        ("swivel-head", "table", "XYZBC"),
        ("trunnion", "basic", "XYZAC"),
        ("trunnion", "full", "XYZAC"),
        ("double-head", "double-head", "XYZAB"),
        ("nutating-b", "basic", "XYZBC"),
    ] {
        let machine = machine(machine_name);
        for tcp in [false, true] {
            let generated = generated(&machine, program, tcp);
            for name in ["fanuc", "haas", "heidenhain", "sinumerik"] {
                let post = controller(name);
                let facts = facts[name].as_table().unwrap();
                let what = format!("{name} {machine_name} {program} tcp {tcp}");
                if tcp && program == "full" && !post.tcp.as_ref().unwrap().other_stylus {
                    continue;
                }
                let nc = written(&post, &machine, &generated);
                let texts = programs(&post, &nc);
                let longest = texts.iter().flat_map(|t| t.lines()).map(str::len).max().unwrap();
                assert!(longest as i64 <= facts["line_length"].as_integer().unwrap(), "{what}: {longest}");
                match name {
                    "heidenhain" => heidenhain(facts, &texts, &what),
                    "sinumerik" => sinumerik(facts, &texts, &nc, &what),
                    _ => macro_b(facts, letters, name == "fanuc", &texts, &what),
                }
            }
        }
    }
}

/// Lines, bytes and run time of each program for each control: the table in the guide. `AXISCAL_RENEW=1` writes it anew.
#[test]
fn the_table_of_sizes_in_the_guide() {
    const BEGIN: &str = "<!-- sizes: written by tests/controls/facts.rs -->\n";
    const END: &str = "<!-- end of sizes -->\n";
    let mut rows = BTreeMap::new();
    let mut wrong = Vec::new();
    for (machine_name, program) in
        [("swivel-head", "head"), ("swivel-head", "table"), ("trunnion", "basic"), ("trunnion", "full")]
    {
        let machine = machine(machine_name);
        let generated = generated(&machine, program, false);
        for (place, name) in ["linuxcnc", "fanuc", "haas", "sinumerik", "heidenhain"].iter().enumerate() {
            let nc = written(&controller(name), &machine, &generated);
            let all: Vec<&str> = std::iter::once(nc.text.as_str())
                .chain(nc.beside.iter().filter(|f| f.to_control).map(|f| f.text.as_str()))
                .collect();
            let lines: usize = all.iter().map(|t| t.lines().count()).sum();
            let kb = all.iter().map(|t| t.len()).sum::<usize>().div_ceil(1000);
            let (most_lines, most_kb) = match (program, *name) {
                ("head", "heidenhain") => (3000, 130),
                ("head", _) => (1600, 90),
                ("full", "heidenhain") => (11_000, 500),
                ("full", _) => (6000, 350),
                _ => (usize::MAX, usize::MAX),
            };
            let touches = generated.plan.touches.len();
            // of HEIDENHAIN each argument is a line; the others have room for the head of a small program
            let a_touch = if *name == "heidenhain" { 12 } else { 8 };
            if lines > most_lines || kb > most_kb || lines > a_touch * touches {
                wrong.push(format!("{name} {program}: {lines} lines, {kb} kB"));
            }
            let minutes = (generated.path.seconds / 60.0).round();
            let row = format!(
                "| {name} | `{program}` on {machine_name} | {touches} | {lines} | {kb} | {:.1} | {minutes} |\n",
                lines as f64 / touches as f64
            );
            rows.insert((place, machine_name, program), row);
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    let head = "| controller | program | touches | lines | kB | lines a touch | min as planned |\n|---|---|---|---|---|---|---|\n";
    let table = format!("{BEGIN}{head}{}{END}", rows.into_values().collect::<String>());
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/guide/controllers.md");
    let guide = std::fs::read_to_string(&path).unwrap();
    let (before, rest) = guide.split_once(BEGIN).expect("the guide has no table of sizes");
    let (_, after) = rest.split_once(END).unwrap();
    let renewed = format!("{before}{table}{after}");
    if std::env::var_os("AXISCAL_RENEW").is_some() {
        std::fs::write(&path, &renewed).unwrap();
    } else {
        assert!(guide == renewed, "the table of sizes in the guide is another one now: AXISCAL_RENEW=1");
    }
}
