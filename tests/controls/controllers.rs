//! The programs of every controller: what any of them must hold to, and one of each as a file to read.
//!
//! The files stand in `programs/emitted/`. After a change that is meant: `AXISCAL_RENEW=1 cargo test --test controls emitted`, then
//! read the difference before it is committed.

use axiscal::diag::source;
use axiscal::machine::{self, Machine};
use axiscal::post::{NcProgram, Postprocessor, parse};
use axiscal::program::{self, Generated, Options};
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

const CONTROLLERS: [&str; 7] =
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
fn variant(base: &str, lines: &str) -> Postprocessor {
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

fn holds_to_the_rules(post: &Postprocessor, nc: &NcProgram, what: &str) {
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

// ------------------------------------------------------------------------------------------------ variants as files

/// The axis words of the straight moves of a program, in order.
fn words(text: &str, axis: char) -> Vec<f64> {
    let code = |l: &&str| !l.contains(['(', ';', '"', '*']) && !l.contains("SYSREAD") && !l.contains("TCH");
    let named = text
        .lines()
        .filter(code)
        .flat_map(|l| l.split_whitespace())
        .filter_map(|w| w.strip_prefix(axis)?.trim_start_matches('=').parse().ok());
    // what routines are given: X, Y, Z in this order, B and C of a turn, or a parameter for each of the three
    let given = |line: &str| -> Option<f64> {
        let place = "XYZ".find(axis);
        let argument =
            |rest: &str, at: usize| rest.split(['[', ']', ',', ' ']).filter(|w| !w.is_empty()).nth(at)?.parse().ok();
        let linear = ["o<rapid> call ", "o<guarded> call "].iter().find_map(|begins| line.strip_prefix(begins));
        if let Some((rest, place)) = linear.zip(place) {
            return argument(rest, place);
        }
        if let Some((rest, place)) = line.strip_prefix("o<turn> call ").zip("BC".find(axis)) {
            return argument(rest, place);
        }
        if let Some(((_, rest), place)) = line.strip_prefix("AXC_GUARDED(").and_then(|l| l.rsplit_once('"')).zip(place)
        {
            return argument(rest, place);
        }
        let (_, rest) = line.split_once("FN 0: Q165")?;
        rest.strip_prefix(&format!("{} = ", place? + 1))?.trim().parse().ok()
    };
    named.chain(text.lines().filter_map(given)).collect()
}

#[test]
fn a_machine_in_inches_gets_inches_everywhere() {
    let machine = machine("swivel-head");
    let generated = generated(&machine, "head", false);
    for (base, word) in [
        ("sinumerik", "G700"),
        ("fanuc", "G20"),
        ("haas", "G20"),
        ("heidenhain", "BEGIN PGM HEAD INCH"),
        ("linuxcnc", "G20"),
    ] {
        let metric = written(&controller(base), &machine, &generated);
        let lines = "[number]\ndecimals = 5\nunverified = \"an inch machine of ours\"\n[log]\nunit = \"inch\"\ndecimals = 5\nunverified = \"an inch machine of ours\"\n";
        let post = variant(base, lines);
        let inch = written(&post, &machine, &generated);
        holds_to_the_rules(&post, &inch, base);
        assert!(inch.text.contains(word) && !metric.text.contains(word), "{base}");
        let head = inch.text.to_owned() + &inch.beside.iter().map(|f| f.text.clone()).collect::<String>();
        assert!(head.replace('*', " ").contains(" INCH N202 U"), "{base}");
        for axis in ['X', 'Y', 'Z', 'B', 'C'] {
            let (mm, inch) = (words(&metric.text, axis), words(&inch.text, axis));
            assert!(mm.len() == inch.len() && !mm.is_empty(), "{base} {axis}: {} {}", mm.len(), inch.len());
            let unit = if "XYZ".contains(axis) { 25.4 } else { 1.0 };
            for (mm, inch) in mm.iter().zip(&inch) {
                assert!((mm - inch * unit).abs() < 1e-3, "{base} {axis}: {mm} mm, {inch}");
            }
        }
        // feeds, tolerances and settings too: 1500 mm/min, 300 mm/min, 1 mm
        assert!(["59.05512", "11.81102", "0.03937"].iter().all(|number| head.contains(number)), "{base}");
    }
}

#[test]
fn modulo_axes_are_told_their_sense() {
    let machine = machine("swivel-head");
    let generated = generated(&machine, "table", false);
    for (base, forward, back) in
        [("sinumerik", "C=ACP(", "C=ACN("), ("fanuc", "G0 C90.", "G0 C-"), ("heidenhain", "L IC+", "L IC-")]
    {
        let post = variant(base, "[settings]\nmodulo = \"C\"\n");
        let nc = written(&post, &machine, &generated);
        holds_to_the_rules(&post, &nc, base);
        assert!(nc.text.contains(forward) && nc.text.contains(back), "{base}");
    }
}

#[test]
fn axes_have_the_control_s_own_names_and_numbers() {
    let machine = machine("swivel-head");
    let generated = generated(&machine, "head", false);
    let post = variant("sinumerik", "[number]\naxis_names = { C = \"C1\", B = \"B1\" }\nsource = \"our machine\"\n");
    let text = programs(&post, &written(&post, &machine, &generated)).concat();
    assert!(text.contains("G0 SUPA C1=0") && text.contains("$AA_IM[B1]") && !text.contains("$AA_IM[B]"));
    let post = variant("fanuc", "[number]\naxis_numbers = { C = 6 }\nsource = \"our machine\"\n");
    let text = programs(&post, &written(&post, &machine, &generated)).concat();
    assert!(text.contains("=#5066") && text.contains("=#5046-#5026") && text.contains("=#5064"));
}

#[test]
fn machine_coordinates_hold_the_origin_of_r() {
    let text = machine::BUILT_IN.replacen(
        "origin = { X = 0.0, Y = 0.0, Z = 0.0",
        "origin = { X = 100.0, Y = -50.0, Z = 0.0",
        1,
    );
    let (machines, _) = machine::load(&source("machines", text)).unwrap();
    let machine = machines.into_iter().find(|m| m.name == "swivel-head").unwrap();
    let generated = generated(&machine, "head", false);
    for (name, first, touch) in [
        ("sinumerik", "G0 SUPA X=67\n", "AXT_PX=$AA_MM[X]-(100)\n"),
        ("heidenhain", "L X+67 R0 FMAX M91", "Q1621 = Q1601 - 100\n"),
        ("fanuc", "G0 X-33.\n", "#27=#5041-#5021+[100.]\n#28=#5042-#5022+[-50.]\n#29=#5043-#5023\n"),
    ] {
        let post = controller(name);
        let text = programs(&post, &written(&post, &machine, &generated)).concat();
        assert!(text.contains(first) && text.contains(touch), "{name}");
    }
}

/// Between two steps of a control the origin of R cannot be named: that is said, with the place next to it, which then serves.
#[test]
fn an_origin_between_the_steps_of_a_control_is_named() {
    let inch = "[number]\ndecimals = 4\nsource = \"ours\"\n[log]\nunit = \"inch\"\ndecimals = 4\nsource = \"ours\"\n";
    let with = |origin: &str| {
        let text =
            machine::BUILT_IN.replace("origin = { X = 0.0, Y = 0.0, Z = 0.0, A", &format!("origin = {{ {origin}, A"));
        let (machines, _) = machine::load(&source("machines", &text)).unwrap();
        machines.into_iter().find(|m| m.name == "trunnion").unwrap()
    };
    for (post, origin, nearest) in [
        (controller("fanuc"), "X = 1.1234, Y = 0.5, Z = 0.0", "X = 1.123"),
        (variant("fanuc", inch), "X = 0.1, Y = 0.5, Z = 0.254", "X = 0.09906, Y = 0.50038"),
    ] {
        let machine = with(origin);
        let generated = generated(&machine, "basic", false);
        let failure = post.program(&machine, &generated.plan, &generated.path).unwrap_err();
        assert_eq!(failure.0[0].code, "post::origin", "{failure}");
        assert!(failure.0[0].help.as_deref().unwrap().ends_with(nearest), "{failure}");
        let machine = with(&if post.number.decimals == 4 {
            format!("{nearest}, Z = 0.254")
        } else {
            format!("{nearest}, Y = 0.5, Z = 0.0")
        });
        written(&post, &machine, &generated);
    }
}

/// An origin of many digits in every axis makes no line that a control would not take.
#[test]
fn an_origin_of_many_digits_fits_the_lines() {
    let origin = "origin = { X = -1350.125, Y = -1412.625, Z = -1287.315, ";
    let text = machine::BUILT_IN.replace("origin = { X = 0.0, Y = 0.0, Z = 0.0, ", origin);
    assert!(text.matches(origin).count() >= 3);
    // the ends of the axes stand in machine coordinates
    let mut by = 0.0;
    let ends = |line: &str, by: f64| -> Option<String> {
        let (low, high) = line.strip_prefix("range = [")?.split_once(']')?.0.split_once(',')?;
        let shifted = |end: &str| end.trim().parse::<f64>().map(|v| format!("{:.3}", v + by)).unwrap();
        Some(format!("range = [{}, {}]\n", shifted(low), shifted(high)))
    };
    let mut moved = String::new();
    for line in text.lines() {
        if let Some(name) = line.strip_prefix("name = \"") {
            by = ["X\"", "Y\"", "Z\""]
                .iter()
                .position(|n| name.starts_with(n))
                .map_or(0.0, |i| [-1350.125, -1412.625, -1287.315][i]);
        }
        moved += &ends(line, by).unwrap_or_else(|| format!("{line}\n"));
    }
    let (machines, _) = machine::load(&source("machines", &moved)).unwrap();
    for (name, program) in
        [("swivel-head", "head"), ("trunnion", "basic"), ("double-head", "double-head"), ("nutating-b", "basic")]
    {
        let machine = machines.iter().find(|m| m.name == name).unwrap();
        for tcp in [false, true] {
            let generated = generated(machine, program, tcp);
            for control in ["sinumerik", "heidenhain", "fanuc", "haas", "linuxcnc"] {
                let post = controller(control);
                if let Err(why) = post.program(machine, &generated.plan, &generated.path) {
                    assert_ne!(why.0[0].code, "post::line_length", "{control} {name} {tcp}: {why}");
                }
            }
        }
    }
}

#[test]
fn a_probing_package_is_a_file_of_a_few_lines() {
    let machine = machine("swivel-head");
    let generated = generated(&machine, "head", false);
    for (name, base) in [("fanuc-inspection-plus", "fanuc"), ("haas-inspection-plus", "haas")] {
        let (post, base) = (controller(name), controller(base));
        assert!(post.text.lines().count() < 40 && post.based_on.as_deref() == Some(base.name.as_str()));
        let nc = written(&post, &machine, &generated);
        assert!(
            nc.text.contains("G65 P9832") && nc.text.contains("G65 P9833") && nc.text.contains("G65 P9810 Z10. F1500.")
        );
        assert_eq!(post.log.decimals, base.log.decimals);
    }
}

#[test]
fn labels_that_run_out_are_said() {
    let machine = machine("swivel-head");
    let generated = generated(&machine, "head", false);
    let post = variant("fanuc", "[file]\nlast_label = 60\nsource = \"a small control\"\n");
    let failure = post.program(&machine, &generated.plan, &generated.path).unwrap_err();
    assert_eq!(failure.0[0].code, "post::labels");
}

#[test]
fn controllers_say_what_they_are_based_on_and_what_stands_beside() {
    let beside: BTreeMap<&str, usize> = CONTROLLERS.iter().map(|c| (*c, controller(c).companions.len())).collect();
    assert_eq!((beside["heidenhain"], beside["fanuc"], beside["sinumerik"], beside["linuxcnc"]), (7, 3, 3, 0));
    assert!(Postprocessor::built_in().unwrap().len() == CONTROLLERS.len());
}
