//! The programs of every controller: what any of them must hold to, and one of each as a file to read.
//!
//! The files stand in `programs/emitted/`. After a change that is meant: `AXISCAL_RENEW=1 cargo test --test controls emitted`, then
//! read the difference before it is committed.

use axiscal::diag::source;
use axiscal::machine::{self, Machine};
use axiscal::post::{NcProgram, Postprocessor, parse};
use axiscal::program::{self, Generated, Options};
use std::collections::BTreeSet;
use std::path::Path;

pub const CONTROLLERS: [&str; 7] =
    ["linuxcnc", "sinumerik", "fanuc", "heidenhain", "haas", "fanuc-inspection-plus", "haas-inspection-plus"];

pub fn machine(name: &str) -> Machine {
    let (machines, _) = machine::load(&source("machines", machine::BUILT_IN)).unwrap();
    machines.into_iter().find(|m| m.name == name).unwrap()
}

pub fn generated(machine: &Machine, program: &str, tcp: bool) -> Generated {
    let spec = program::choose(program::built_in().unwrap(), program, machine).unwrap();
    program::generate(machine, &spec, &Options { strict: false, tcp }).unwrap().0
}

pub fn controller(name: &str) -> Postprocessor {
    Postprocessor::load_built_in_or_file(name).unwrap().0
}

/// A variant of a built-in controller: its file with these lines.
pub fn variant(base: &str, lines: &str) -> Postprocessor {
    let text = format!("format = \"axiscal-postprocessor/1\"\nbased_on = {base:?}\nname = \"mine\"\n{lines}");
    parse(&source("mine.toml", text)).unwrap_or_else(|e| panic!("{e}")).0
}

pub fn written(post: &Postprocessor, machine: &Machine, generated: &Generated) -> NcProgram {
    post.program(machine, &generated.plan, &generated.path).unwrap_or_else(|e| panic!("{}: {e}", post.name))
}

/// Numbers behind a word, e.g. the labels behind `GOTO`.
fn numbers_after(line: &str, word: &str) -> Vec<u64> {
    line.match_indices(word)
        .filter_map(|(at, _)| {
            let rest = line[at + word.len()..].trim_start();
            rest[..rest.find(|c: char| !c.is_ascii_digit()).unwrap_or(rest.len())].parse().ok()
        })
        .collect()
}

/// Labels that stand in the program and labels that it goes to, as this control spells them.
fn labels(post: &Postprocessor, text: &str) -> (Vec<u64>, BTreeSet<u64>) {
    let (mut stand, mut gone_to) = (Vec::new(), BTreeSet::new());
    for line in text.lines() {
        if line.trim_start().starts_with(post.comment.open.as_str()) {
            continue;
        }
        match post.extension.as_str() {
            "mpf" => {
                let label = line.strip_suffix(':').map(|l| l.replace("AXC_END", "AXC_L0"));
                stand.extend(label.iter().flat_map(|l| numbers_after(l, "AXC_L")));
                gone_to.extend(numbers_after(&line.replace("AXC_END", "AXC_L0"), "GOTOF AXC_L"));
            }
            "nc" => {
                stand.extend(line.strip_prefix('N').and_then(|n| n.parse::<u64>().ok()));
                gone_to.extend(numbers_after(line, "GOTO"));
            }
            "h" => {
                let block = line.split_once(' ').unwrap().1;
                // LBL 0 ends a subprogram
                stand.extend(block.strip_prefix("LBL ").and_then(|n| n.parse::<u64>().ok()).filter(|n| *n > 0));
                gone_to.extend(numbers_after(block, "GOTO LBL "));
            }
            _ => {}
        }
    }
    (stand, gone_to)
}

/// A program and those that it calls, each as a text of its own.
pub fn programs(post: &Postprocessor, nc: &NcProgram) -> Vec<String> {
    let called = nc.beside.iter().filter(|f| f.name.ends_with(".nc") || f.name.ends_with(".spf")).map(|f| &f.text);
    let texts = std::iter::once(&nc.text).chain(called);
    assert!(post.extension != "nc" && post.extension != "mpf" || nc.beside.len() > 1);
    texts.map(|text| text.replace("\r\n", "\n")).collect()
}

pub fn holds_to_the_rules(post: &Postprocessor, nc: &NcProgram, what: &str) {
    for text in programs(post, nc) {
        lines_hold_to_the_rules(post, &text, what);
    }
    for (entry, why) in &post.unverified {
        assert!(nc.findings.0.iter().any(|f| f.code == "post::unverified" && f.message.contains(entry.as_str())));
        let notes = nc.beside.iter().find(|f| f.name.ends_with(".notes.txt")).unwrap();
        assert!(!notes.to_control && notes.text.contains(&format!("- {entry}: {why}\n")), "{what}: {entry}: {why}");
    }
    // one line of the head says how many there are, and where
    let said = nc.text.lines().filter(|l| l.to_ascii_uppercase().contains("NOT VERIFIED ON A REAL CONTROL")).count();
    assert_eq!(said, usize::from(!post.unverified.is_empty()), "{what}");
}

fn lines_hold_to_the_rules(post: &Postprocessor, text: &str, what: &str) {
    assert!(text.is_ascii(), "{what}");
    for (number, line) in text.lines().enumerate() {
        let place = || format!("{what}, line {}: {line}", number + 1);
        assert!(line.len() <= post.line_length, "{}", place());
        let is_code = !line.contains(post.comment.open.trim()) && !line.contains('"');
        assert!(!is_code || !line.contains("undefined") && !line.contains("none"), "{}", place());
        assert_eq!(line, line.trim_end(), "{}", place());
        assert!(post.blank_lines || !line.is_empty(), "{}", place());
        if let Some(rule) = &post.block_numbers {
            let expected = rule.word.replace("{n}", &(rule.first + number * rule.step).to_string());
            assert!(line.starts_with(&expected), "{}", place());
        }
        if line.starts_with("DPRNT[") {
            let allowed = |c: char| c.is_ascii_uppercase() || c.is_ascii_digit() || "+-/*.[]#".contains(c);
            assert!(line.ends_with(']') && line.chars().all(allowed), "{}", place());
            // what stands in a field: at most eight places
            for format in line.split('#').skip(1).map(|f| &f[f.find('[').unwrap() + 1..f.find(']').unwrap()]) {
                let digits: Vec<u32> = format.chars().map(|c| c.to_digit(10).unwrap()).collect();
                assert!(digits.len() == 2 && (1..=8).contains(&(digits[0] + digits[1])), "{}", place());
            }
        }
        let moves = ["G0 ", "G1 ", "G31 "].iter().any(|g| line.starts_with(g));
        if post.number.always_mark && moves {
            for word in line.split(' ').skip(1).filter(|w| !w.contains(['[', '#']) && !w.starts_with('G')) {
                assert!(word.contains('.'), "a word without its point: {}", place());
            }
        }
        if post.comment.capitals {
            assert!(!line.contains(|c: char| c.is_ascii_lowercase()), "{}", place());
            if line.starts_with('(') {
                assert!(line.ends_with(')') && line.matches(['(', ')']).count() == 2, "{}", place());
            }
        }
        if let Some(message) = line.strip_prefix("#3006=1(").and_then(|m| m.strip_suffix(')')) {
            assert!(message.len() <= post.comment.message_width.unwrap(), "{}", place());
        }
    }
    let (stand, gone_to) = labels(post, text);
    let unique: BTreeSet<u64> = stand.iter().copied().collect();
    assert_eq!(unique.len(), stand.len(), "{what}: a label stands twice");
    assert!(gone_to.is_subset(&unique), "{what}: no such label: {:?}", gone_to.difference(&unique).collect::<Vec<_>>());
    assert!(unique.iter().all(|l| post.last_label.is_none_or(|last| *l <= last as u64)), "{what}");
}

fn every_controller(machine_name: &str, program: &str, both_frames: bool) {
    let machine = machine(machine_name);
    for tcp in [false, true].into_iter().filter(|tcp| both_frames || !tcp) {
        let generated = generated(&machine, program, tcp);
        for name in CONTROLLERS {
            let post = controller(name);
            let what = format!("{name}, {machine_name}, {program}, tcp {tcp}");
            let nc = written(&post, &machine, &generated);
            holds_to_the_rules(&post, &nc, &what);
            // each touch is called once, and leaves its line with the status 1 or 0
            let text = nc.text.replace("\r\n", "\n");
            for touch in &generated.plan.touches {
                let ids = [
                    format!("o<touch> call [{}]", touch.id),
                    format!("G65 P9101 A{}. ", touch.id),
                    format!("\nAXC_TOUCH({},", touch.id),
                ];
                let times = ids.iter().map(|id| text.matches(id.as_str()).count()).max();
                // HEIDENHAIN: a touch is named, anew where a set-up begins, and called by its number
                let named = text.contains(&format!("FN 0: Q1607 = +{} ; touch {}: ", touch.id, touch.id));
                let well = if name == "heidenhain" { named } else { times == Some(1) };
                assert!(well, "{what}: touch {}: {times:?}", touch.id);
            }
            let calls = text.lines().filter(|l| l.ends_with(" CALL LBL 1")).count();
            assert!(name != "heidenhain" || calls == generated.plan.touches.len(), "{what}: {calls}");
            let all = programs(&post, &nc).concat();
            for status in 0..=1 {
                let forms = [
                    format!("(LOG,P N%.0f#1 S{status}"),
                    format!("DPRNT[P*N#1[50]*S{status}"),
                    format!("SPRINT(\"P N%D S{status}"),
                    format!("FN 0: Q1608 = +{status}\n"),
                ];
                assert!(forms.iter().any(|form| all.contains(form.as_str())), "{what}: no line of status {status}");
            }
        }
    }
}

#[test]
fn the_paper_s_programs() {
    every_controller("swivel-head", "head", true);
    every_controller("swivel-head", "table", true);
}

#[test]
fn the_second_machine_of_the_paper() {
    every_controller("double-head", "double-head", true);
}

#[test]
fn the_table_machines() {
    every_controller("trunnion", "basic", true);
    every_controller("swivel-table-b", "basic", true);
    every_controller("nutating-b", "basic", true);
    every_controller("trunnion-offset", "basic", true);
}

#[test]
fn a_program_that_stops_for_another_stylus() {
    every_controller("swivel-head", "full", false);
    let machine = machine("trunnion");
    let generated = generated(&machine, "full", true);
    for name in CONTROLLERS {
        let post = controller(name);
        let program = post.program(&machine, &generated.plan, &generated.path);
        if post.tcp.as_ref().unwrap().other_stylus {
            holds_to_the_rules(&post, &program.unwrap(), name);
        } else {
            assert_eq!(program.unwrap_err().0[0].code, "post::other_stylus");
        }
    }
}

/// The texts of the messages of a program, as any control spells them.
fn messages(text: &str) -> Vec<String> {
    let forms = [("MSG(\"AXISCAL: ", "\")"), ("#3006=1(", ")"), ("QS1600 = \"", "\""), ("(DEBUG,axiscal: ", ")")];
    let shown = |line: &str| {
        forms.into_iter().find_map(|(begins, ends)| {
            let (_, message) = line.split_once(begins)?;
            let message = message.strip_prefix("AXISCAL: ").unwrap_or(message);
            message.trim_end().strip_suffix(ends).map(str::to_owned)
        })
    };
    text.lines().filter_map(shown).collect()
}

/// What the operator is told is told whole: a control that shows longer messages is sent the same program.
#[test]
fn no_message_is_cut() {
    for (machine_name, program, frames) in [
        ("swivel-head", "head", &[false, true][..]),
        ("swivel-head", "table", &[false, true]),
        ("swivel-head", "full", &[false]),
        ("double-head", "double-head", &[false, true]),
        ("trunnion", "basic", &[false, true]),
        ("trunnion", "full", &[false, true]),
        ("swivel-table-b", "basic", &[false, true]),
        ("nutating-b", "basic", &[false, true]),
        ("trunnion-offset", "basic", &[false, true]),
    ] {
        let machine = machine(machine_name);
        for tcp in frames {
            let generated = generated(&machine, program, *tcp);
            for name in CONTROLLERS {
                let post = controller(name);
                if *tcp && program == "full" && !post.tcp.as_ref().unwrap().other_stylus {
                    continue;
                }
                let width = post.comment.message_width;
                let wide = variant(
                    name,
                    "[file]\nline_length = 5000\nunverified = \"as long as it wants\"\n[comment]\nmessage_width = 4000\nunverified = \"as wide as it wants\"\n",
                );
                assert_ne!(wide.comment.message_width, width);
                let all = |post: &Postprocessor| {
                    let nc = written(post, &machine, &generated);
                    messages(&programs(post, &nc).concat())
                };
                let (cut, whole) = (all(&post), all(&wide));
                assert!(!cut.is_empty(), "{name}");
                // in one message or in several
                let words = |of: &[String]| of.join(" ");
                assert!(words(&cut) == words(&whole), "{name}, {machine_name}, {program}, tcp {tcp}");
                // of a touch and its face: the longest
                let touches = &generated.plan.touches;
                let face = |t: &axiscal::program::plan::PlanTouch| format!("block {} face {}", t.block, t.face);
                let longest = touches.iter().map(face).max_by_key(String::len).unwrap();
                let id = touches.len().to_string();
                let filled = |m: &String, off: &str| {
                    let values = [("AXT_OFF", off), ("AXT_ID", &id), ("AXG_ID", &id), ("AXT_SAYS", &longest)];
                    let values = values.into_iter().chain([("AXG_SAYS", longest.as_str())]);
                    values.fold(m.clone(), |m, (name, value)| m.replace(&format!("\"<<{name}<<\""), value))
                };
                assert!(width.is_none_or(|w| cut.iter().all(|m| filled(m, "{}").len() <= w)), "{name}: {cut:#?}");
                // with the longest number in it a SINUMERIK shows 124 characters
                for message in cut.iter().filter(|_| name == "sinumerik") {
                    let shown = format!("AXISCAL: {}", filled(message, "-0.123456"));
                    assert!(shown.len() <= 124, "{}: {shown}", shown.len());
                }
            }
        }
    }
}

#[test]
fn emitted_programs_are_those_in_the_tree() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("programs/emitted");
    let machine = machine("swivel-head");
    let generated = generated(&machine, "head", false);
    let renew = std::env::var_os("AXISCAL_RENEW").is_some();
    for name in &CONTROLLERS[..5] {
        let nc = written(&controller(name), &machine, &generated);
        for (file, text) in nc.files("head") {
            let path = folder.join(name).join(&file);
            if renew {
                std::fs::create_dir_all(path.parent().unwrap()).unwrap();
                std::fs::write(&path, text).unwrap();
            }
            let kept = std::fs::read(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
            let kept = String::from_utf8(kept).unwrap();
            let differs = kept.lines().zip(text.lines()).enumerate().find(|(_, (a, b))| a != b);
            if let Some((number, (old, new))) = differs {
                panic!(
                    "{} line {}:\n  in the tree {old}\n  now         {new}\nif it is meant: AXISCAL_RENEW=1",
                    path.display(),
                    number + 1
                );
            }
            assert!(kept == text, "{}: another length or other line ends", path.display());
        }
    }
}

/// The lines of a program that are no remarks.
fn code_lines<'a>(post: &Postprocessor, text: &'a str) -> Vec<&'a str> {
    text.lines().filter(|l| !l.starts_with(post.comment.open.trim())).collect()
}

/// Haas counts rotary axes by letter (96-8000 p. 113: X, Y, Z, A, B): B is #5045 and C #5046 on any machine. By count C of a
/// machine with B and C would be #5045, another axis's variable.
#[test]
fn haas_numbers_rotary_axes_by_letter() {
    let post = controller("haas");
    for (machine_name, program, there, lacks) in [
        ("swivel-head", "head", [5, 6], 4),
        ("trunnion", "basic", [4, 6], 5),
        ("double-head", "double-head", [4, 5], 6),
    ] {
        let machine = machine(machine_name);
        let nc = written(&post, &machine, &generated(&machine, program, false));
        let text = programs(&post, &nc).concat();
        let code = code_lines(&post, &text).join("\n");
        for family in [502, 504, 506] {
            assert!(
                there.iter().all(|n| code.contains(&format!("#{family}{n}"))),
                "{machine_name}: #{family}{there:?}"
            );
            assert!(!code.contains(&format!("#{family}{lacks}")), "{machine_name}: #{family}{lacks}");
        }
        // the probe is switched on before the first move, and blocks let the limit of reading ahead act before a position is read
        let at = |what: &str| code.find(what).unwrap_or_else(|| panic!("{what}"));
        assert!(at("\nM59 P1134\n") < at("\nG103 P1\nG4 P1\nG4 P1\nG4 P1\n") && at("\nG103 P1") < at("#504"));
        assert!(at("\nM69 P1134\n") > at("\nN9\n"));
    }
}

/// A G4 does not stop a Fanuc from reading ahead (B-63944EN/03 p. 556 names what does): no program counts on one.
#[test]
fn fanuc_waits_by_what_stops_reading_ahead() {
    let machine = machine("trunnion");
    let post = controller("fanuc");
    for tcp in [false, true] {
        let generated = generated(&machine, "basic", tcp);
        let text = written(&post, &machine, &generated).text;
        let code = code_lines(&post, &text);
        assert!(!code.iter().any(|l| l.starts_with("G4 ")) && code.iter().filter(|l| **l == "G53").count() >= 3);
    }
}

/// The time of a touch needs no machine data of a SINUMERIK: an index of $AC_TIMER beyond MD28258 would be an alarm.
#[test]
fn sinumerik_reads_a_clock_that_every_control_has() {
    let machine = machine("swivel-head");
    let generated = generated(&machine, "head", false);
    let all = |post: &Postprocessor| programs(post, &written(post, &machine, &generated)).concat();
    let text = all(&controller("sinumerik"));
    assert!(!text.contains("$AC_TIMER") && text.contains("$A_SECOND"));
    let without = all(&variant("sinumerik", "[settings]\ntime = \"no\"\n"));
    assert!(!without.contains("$A_SECOND") && !without.contains("_T=") && !without.contains(" T%"));
}

/// What no public source says is said where the program is read.
#[test]
fn what_no_public_source_says_is_said_in_the_programs() {
    let unverified = |name: &str| -> String {
        let post = controller(name);
        let kinds =
            post.tables.iter().flat_map(|t| &t.kind).flat_map(|k| &k.vector).filter_map(|v| v.unverified.clone());
        let files = post.tables.iter().flat_map(|t| &t.file).filter_map(|f| f.unverified.clone());
        post.unverified.iter().map(|(_, why)| why.clone()).chain(kinds).chain(files).collect::<Vec<_>>().join("\n")
    };
    for (control, words) in [
        ("heidenhain", &["MB0", "-1 of the 4th", "M_TRUNCATE", "M_APPEND", "CYCL DEF 13.1", "ID241"][..]),
        ("fanuc", &["19700 to 19702", "G10 L52", "#4130", "#4023"]),
        ("haas", &["settings 261 and 262", "the setting's number"]),
    ] {
        let said = unverified(control);
        for word in words {
            assert!(said.contains(word), "{control}: {word}\n{said}");
        }
    }
    // the head's parameters are documented for the 30i (A-79348E pp. 83, 84)
    let fanuc = controller("fanuc").tables.unwrap();
    let first = |v: &&axiscal::post::tables::VectorForm| v.names["parameter"][0].clone();
    let mut head =
        fanuc.kind.iter().flat_map(|k| &k.vector).filter(|v| ["N19709", "N19712"].contains(&first(v).as_str()));
    assert!(head.all(|v| v.unverified.is_none() && v.source.is_some()));
}
