//! Readers that share nothing with the crate read the same programs: the positions that they compute must be the plan's.
//!
//! - LinuxCNC's own interpreter, `rs274`. Left out with a word where it is not installed; AXISCAL_LINUXCNC=required makes that
//!   a failure.
//! - The crate `gcode` on the literal motion of Fanuc and Haas: what it does not know is an error.
//! - `nc-gcode-interpreter` on the motion of SINUMERIK. tests/readers/install.sh installs it; where it is not, the test is left
//!   out with a word, and AXISCAL_READERS=required makes that a failure.

use axiscal::axes::{AxisName, Position};
use axiscal::diag::source;
use axiscal::machine;
use axiscal::post::Postprocessor;
use axiscal::program::{self, Generated, Options};
use std::io::Write;
use std::path::PathBuf;
use std::process::{Command, Stdio};

/// `rs274` prints four decimals.
const PRINTED: f64 = 1e-4;

/// The interpreter believes that each probing move ends this far short of its end, mm: what a move does not name stays there.
const SHORT_MM: f64 = 0.3;

#[test]
fn rs274_drives_every_search_to_the_plans_end() {
    if Command::new("rs274").arg("-h").stdin(Stdio::null()).output().is_err() {
        assert!(
            std::env::var("AXISCAL_LINUXCNC").as_deref() != Ok("required"),
            "rs274 of linuxcnc-uspace is not installed"
        );
        println!("left out: rs274 is not installed");
        return;
    }
    let (machines, _) = machine::load(&source("machines", machine::BUILT_IN)).unwrap();
    let machine = machines.into_iter().find(|m| m.name == "swivel-head").unwrap();
    let (post, _) = Postprocessor::load_built_in_or_file("linuxcnc").unwrap();
    let spec = program::choose(program::built_in().unwrap(), "table", &machine).unwrap();
    let (generated, _) = program::generate(&machine, &spec, &Options::default()).unwrap();
    let text = post.program(&machine, &generated.plan, &generated.path).unwrap().text;

    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("p.ngc"), text).unwrap();
    std::fs::write(folder.path().join("p.var"), "").unwrap();
    let run = Command::new("rs274")
        .args(["-g", "-v", "p.var", "p.ngc", "canon.txt"])
        .current_dir(folder.path())
        .stdin(Stdio::null())
        .output()
        .unwrap();
    assert!(run.status.success(), "{}", String::from_utf8_lossy(&run.stderr));
    let canon = std::fs::read_to_string(folder.path().join("canon.txt")).unwrap();
    let ends: Vec<Vec<f64>> = canon
        .lines()
        .filter_map(|l| l.split_once("STRAIGHT_PROBE(")?.1.split_once(')'))
        .map(|(numbers, _)| numbers.split(',').map(|n| n.trim().parse().unwrap()).collect())
        .collect();

    let mut ends = ends.iter();
    for touch in &generated.plan.touches {
        let wanted = touch.end_position();
        let is_there = |end: &&Vec<f64>| {
            AxisName::ALL.into_iter().all(|axis| {
                let off = (end[axis.index()] - wanted.get(axis)).abs();
                let searched = touch.start.get(axis) != touch.end.get(axis);
                off < if searched || axis.is_rotary() { PRINTED } else { SHORT_MM }
            })
        };
        // the search and the measuring touch, in this order after those of the touch before
        assert_eq!(ends.by_ref().filter(is_there).take(2).count(), 2, "touch {} is not made", touch.id);
    }
}

// ------------------------------------------------------------------------------------- literal motion, read by others

/// The program of a sphere that was put down by eye.
const BY_EYE: &str = "by-eye";

/// Two programs for the paper's machine, and one that finds its artefact.
const PROGRAMS: [&str; 3] = ["head", "table", BY_EYE];

/// A program: its plan, its text.
fn written(controller: &str, program: &str) -> (Generated, String) {
    let (post, _) = Postprocessor::load_built_in_or_file(controller).unwrap();
    let (machine, spec) = if program == BY_EYE {
        let (machine, auto) = crate::common::with_artefact("trunnion", "sphere", 5.0);
        (machine, program::ProgramSpec { placement_tolerance_mm: Some(3.0), ..auto.spec })
    } else {
        let (machines, _) = machine::load(&source("machines", machine::BUILT_IN)).unwrap();
        let machine = machines.into_iter().find(|m| m.name == "swivel-head").unwrap();
        let spec = program::choose(program::built_in().unwrap(), program, &machine).unwrap();
        (machine, spec)
    };
    let (generated, _) = program::generate(&machine, &spec, &Options::default()).unwrap();
    let text = post.program(&machine, &generated.plan, &generated.path).unwrap().text;
    let text = text.lines().map(in_its_place).map(|line| unrolled(&line)).collect();
    (generated, text)
}

/// A move with the artefact in its place: what it adds to its numbers is 0 then.
fn in_its_place(line: &str) -> String {
    let is_move = line.starts_with("G0 ") && ["+#14", "+R9"].iter().any(|added| line.contains(added));
    let word = |word: &str| word.split_once('+').map_or(word, |(number, _)| number).replace('[', "");
    if is_move { line.split(' ').map(word).collect::<Vec<_>>().join(" ") } else { line.to_owned() }
}

/// A call with the moves that it makes between contacts: what the routine does with its numbers is the business of others.
fn unrolled(line: &str) -> String {
    let letter = |l: char| line.split(' ').find_map(|w| w.strip_prefix(l)).unwrap();
    let place = |letters: [char; 3]| letters.map(letter);
    let arguments = || line.rsplit_once('"').map_or(line, |(_, rest)| rest).split(['(', ',']).collect::<Vec<&str>>();
    let three = |values: &[&str]| format!("X={} Y={} Z={}", values[0], values[1], values[2]);
    if line.starts_with("G65 P9101 ") {
        let ([x, y, z], [i, j, k]) = (place(['X', 'Y', 'Z']), place(['I', 'J', 'K']));
        return format!("G31 X{x} Y{y} Z{z} F60.\nG31 X{x} Y{y} Z{z} F{}\nG31 X{i} Y{j} Z{k} F1500.\n", letter('E'));
    }
    if line.starts_with("G65 P9102 ") || line.starts_with("G65 P9103 ") {
        let ([x, y, z], g) = (place(['X', 'Y', 'Z']), if line.contains("P9102") { "G31" } else { "G0" });
        return format!("{g} X{x} Y{y} Z{z}\n");
    }
    if line.starts_with("AXC_TOUCH(") {
        let given = arguments();
        let (start, end) = (three(&given[1..4]), three(&given[4..7]));
        let search = format!("G1 SUPA {end} MEAS=1 F=60\n");
        return format!("{search}{search}G1 SUPA {start} MEAS=1 F=1500\n");
    }
    if line.starts_with("AXC_GUARDED(") {
        return format!("G1 SUPA {} MEAS=1 F=1500\n", three(&arguments()[1..4]));
    }
    if line.starts_with("AXC_RAPID(") {
        return format!("G0 SUPA {}\n", three(&arguments()[1..4]));
    }
    format!("{line}\n")
}

/// Both readers keep numbers in 24 binary digits: of 512 mm the last one is 0.03 um.
const KEPT_MM: f64 = 6e-5;
/// The programs of Fanuc and Haas have three decimals.
const ROUNDED_MM: f64 = 0.5e-3;

/// A move as a reader saw it: it may be ended by the probe, from, to. What was never named is not a number.
type Move = (bool, Position, Position);

/// Every touch is searched from the plan's start to the plan's end, and measured to the same end, in the plan's order.
fn makes_every_touch(who: &str, generated: &Generated, moves: &[Move], same: f64) {
    let near = |a: &Position, b: &Position, all: bool| {
        AxisName::ALL.into_iter().filter(|axis| all || axis.is_rotary()).all(|axis| {
            let off = a.get(axis) - b.get(axis);
            // an axis that the machine lacks is named by nobody
            off.abs() <= same || (off.is_nan() && b.get(axis) == 0.0)
        })
    };
    let mut searches = moves.iter().filter(|(probing, ..)| *probing);
    let finds = generated.plan.find.iter().flat_map(|find| &find.touches).zip(1..);
    for (touch, number) in finds {
        let (start, end) = (touch.start.position(), touch.end.position());
        let found = searches.by_ref().find(|(_, from, to)| near(from, &start, true) && near(to, &end, true));
        assert!(found.is_some(), "{who}: find touch {number} is not searched from {start:?} to {end:?}");
    }
    for touch in &generated.plan.touches {
        let (start, end) = (touch.start_position(), touch.end_position());
        let found = searches.by_ref().find(|(_, from, to)| near(from, &start, true) && near(to, &end, true));
        assert!(found.is_some(), "{who}: touch {} is not searched from {start:?} to {end:?}", touch.id);
        let measured = searches.next().is_some_and(|(_, _, to)| near(to, &end, true));
        assert!(measured, "{who}: touch {} is not measured to {end:?}", touch.id);
    }
    // nothing is probed at an angle that the plan lacks
    let level = generated.plan.find.iter().map(|_| Position::default());
    let poses: Vec<Position> = generated.plan.touches.iter().map(|t| t.start_position()).chain(level).collect();
    let probing_elsewhere = moves.iter().find(|(probing, _, to)| *probing && !poses.iter().any(|p| near(to, p, false)));
    assert!(probing_elsewhere.is_none(), "{who}: it probes at a pose that the plan lacks: {probing_elsewhere:?}");
}

/// The blocks of Fanuc and Haas whose axis words are numbers; feeds that are computed are left out.
fn literal_macro_b(text: &str) -> String {
    let begun = text.lines().skip_while(|l| !l.starts_with("DPRNT["));
    let motion = begun.filter(|l| ["G0 ", "G1 ", "G31 "].iter().any(|g| l.starts_with(g)));
    motion
        .filter_map(|line| {
            let block = line.split_once(" F[").or(line.split_once(" F#")).map_or(line, |(axes, _)| axes);
            (!block.contains(['#', '['])).then(|| format!("{block}\n"))
        })
        .collect()
}

#[test]
fn the_gcode_crate_reads_the_motion_of_fanuc_and_haas() {
    for controller in ["fanuc", "haas"] {
        for program in PROGRAMS {
            let (generated, text) = written(controller, program);
            let literal = literal_macro_b(&text);
            let read = gcode::parse(&literal).unwrap_or_else(|e| panic!("{controller}: {e:?}"));
            let mut moves: Vec<Move> = Vec::new();
            let mut at = Position([f64::NAN; 6]);
            for block in &read.blocks {
                let [gcode::Code::General(code)] = block.codes.as_slice() else { panic!("{controller}: {block}") };
                assert!(block.word_addresses.is_empty(), "{controller}: {block}");
                let from = at;
                for argument in &code.args {
                    let gcode::Value::Literal(value) = argument.value else { panic!("{controller}: {block}") };
                    match AxisName::from_letter(argument.letter) {
                        Some(axis) => at.set(axis, f64::from(value)),
                        None => assert_eq!(argument.letter, 'F', "{controller}: {block}"),
                    }
                }
                moves.push((code.number.to_string() == "31", from, at));
            }
            assert_eq!(moves.len(), literal.lines().count(), "{controller}: a block was not read");
            makes_every_touch(&format!("{controller} {program}"), &generated, &moves, KEPT_MM + ROUNDED_MM);
        }
    }
}

/// The motion of a SINUMERIK program, and which of its blocks MEAS may end. Blocks with a measured value and computed feeds
/// are left out: where the ball backs off to is not known before.
fn literal_sinumerik(text: &str) -> (String, Vec<bool>) {
    let (mut out, mut probing) = (String::new(), Vec::new());
    for line in text.lines().filter(|l| ["G0 ", "G1 "].iter().any(|g| l.starts_with(g)) && !l.contains('$')) {
        let words: Vec<&str> = line.split(' ').filter(|w| !w.starts_with("MEAS=") && !w.contains("AXC_")).collect();
        out += &format!("{}\n", words.join(" "));
        probing.push(line.contains(" MEAS="));
    }
    (out, probing)
}

fn python() -> Option<PathBuf> {
    let cache = std::env::var_os("AXISCAL_READERS_DIR").map(PathBuf::from).or_else(|| {
        let cache = std::env::var_os("XDG_CACHE_HOME").map(PathBuf::from);
        let home = || Some(PathBuf::from(std::env::var_os("HOME")?).join(".cache"));
        Some(cache.or_else(home)?.join("axiscal-readers"))
    })?;
    Some(cache.join("venv/bin/python")).filter(|python| python.exists())
}

#[test]
fn nc_gcode_interpreter_reads_the_motion_of_sinumerik() {
    let Some(python) = python() else {
        assert!(
            std::env::var("AXISCAL_READERS").as_deref() != Ok("required"),
            "nc-gcode-interpreter is not installed: tests/readers/install.sh"
        );
        println!("left out: nc-gcode-interpreter is not installed (tests/readers/install.sh)");
        return;
    };
    for program in PROGRAMS {
        let (generated, text) = written("sinumerik", program);
        let (literal, probing) = literal_sinumerik(&text);
        let mut reader = Command::new(&python)
            .arg(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/readers/sinumerik.py"))
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        reader.stdin.take().unwrap().write_all(literal.as_bytes()).unwrap();
        let run = reader.wait_with_output().unwrap();
        assert!(run.status.success(), "{}", String::from_utf8_lossy(&run.stderr));
        let places: Vec<Position> = String::from_utf8(run.stdout)
            .unwrap()
            .lines()
            .map(|l| {
                let numbers: Vec<f64> = l.split(' ').map(|n| n.parse().unwrap()).collect();
                Position(numbers.try_into().unwrap())
            })
            .collect();
        assert_eq!(places.len(), probing.len(), "a block was not read");
        let before = [Position([f64::NAN; 6])].into_iter().chain(places.iter().copied());
        let moves: Vec<Move> = probing.iter().zip(before).zip(&places).map(|((p, from), to)| (*p, from, *to)).collect();
        makes_every_touch(&format!("sinumerik {program}"), &generated, &moves, KEPT_MM);
    }
}
