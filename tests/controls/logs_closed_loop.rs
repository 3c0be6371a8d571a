//! For every controller, machine and program: the program written and proven as `generate` does it → the virtual machine →
//! the log in that control's own spelling → read back → identified: what was planted, to the resolution of that log.
//!
//! What the decimals of a log cost is measured here for every format and compared with what the guide states
//! (`docs/guide/controllers.md`).

use crate::common;
use axiscal::axes::Position;
use axiscal::check::{Against, check};
use axiscal::diag::{Severity, source};
use axiscal::fit::Settings;
use axiscal::fit::outcome::Status;
use axiscal::log::{self, RawTouch, Touch, Writer};
use axiscal::machine::Machine;
use axiscal::post::{LengthUnit, LogRecord, Postprocessor, parse};
use axiscal::program::{self, Generated, Options, plan::Plan};
use axiscal::simulate::{self, Scenario};
use axiscal::units::mm_from_inch;
use common::*;
use std::collections::BTreeMap;

const CONTROLLERS: [&str; 5] = ["linuxcnc", "sinumerik", "fanuc", "heidenhain", "haas"];
const PACKAGES: [&str; 2] = ["fanuc-inspection-plus", "haas-inspection-plus"];

/// Formats of the log: the name in the guide's table, unit, decimals. The built-in controllers have the first two.
const FORMATS: [(&str, LengthUnit, usize); 5] = [
    ("mm, 6 decimals", LengthUnit::Mm, 6),
    ("mm, 4 decimals", LengthUnit::Mm, 4),
    ("mm, 3 decimals", LengthUnit::Mm, 3),
    ("inch, 5 decimals", LengthUnit::Inch, 5),
    ("inch, 4 decimals", LengthUnit::Inch, 4),
];

/// Programs that are measured together for one study, with the effects that they can tell.
struct Case {
    machine: &'static str,
    programs: &'static [&'static str],
    effects: &'static [&'static str],
}

const fn case(machine: &'static str, programs: &'static [&'static str], effects: &'static [&'static str]) -> Case {
    Case { machine, programs, effects }
}

const CASES: [Case; 10] = [
    case("swivel-head", &["head", "table"], &["location-b", "location-c"]),
    case("swivel-head", &["full"], &["location-b", "location-c", "radial-c-2", "squareness-xy"]),
    case("double-head", &["double-head"], &["location-b", "location-a"]),
    case("double-head", &["full"], &["location-b", "location-a", "radial-b-2"]),
    case("trunnion", &["basic"], &["location-a", "location-c"]),
    case("swivel-table-b", &["basic"], &["location-b", "location-c"]),
    case("nutating-b", &["basic"], &["location-b", "location-c"]),
    case("nutating-b", &["full"], &["location-b", "location-c", "radial-c-2", "squareness-xy"]),
    case("trunnion-offset", &["basic"], &["location-a", "location-c"]),
    case("trunnion-offset", &["full"], &["location-a", "location-c", "radial-c-2", "squareness-xy"]),
];

/// Errors of every sign (some 20 um, 0.004 deg), blocks that stand elsewhere, a late trigger.
fn wrong(machine: &Machine, effects: &[&str]) -> (Scenario, BTreeMap<String, f64>) {
    let catalogue = axiscal::model::catalogue::Catalogue::built_in().unwrap();
    let mut scenario = Scenario::flawless().with(machine, "pretravel", &[("pretravel", 0.004_321)]).unwrap();
    let mut truth = BTreeMap::new();
    let mut size = 1.0;
    for effect in effects {
        for p in &catalogue.get(effect, machine).unwrap().parameters {
            size *= -1.137;
            let planted = match p.unit.as_str() {
                "mm" => 0.0213 * size,
                "deg" => 0.00417 * size,
                _ => 3.1 * size,
            };
            scenario = scenario.with(machine, effect, &[(&p.name, planted)]).unwrap();
            truth.insert(p.name.clone(), planted);
        }
    }
    for mounting in &machine.mountings {
        for block in &mounting.blocks {
            scenario = scenario.with_block(&mounting.name, &block.name, [0.0713, -0.0457, 0.0319], [3e-4, -4e-4, 5e-4]);
        }
    }
    (scenario, truth)
}

/// The touches as they come back from the log of this control.
fn through_the_log(post: &Postprocessor, machine: &Machine, plan: &Plan, raw: &[RawTouch]) -> Vec<Touch> {
    let record =
        |t: &RawTouch| LogRecord { id: t.id.unwrap(), status: t.status, position: t.position, time_s: t.time_s };
    let records: Vec<LogRecord> = raw.iter().map(record).collect();
    let text = post.log_text(machine, plan, &records);
    let (read, findings) = log::read(text.as_bytes(), "run.log", Writer::Controller(post), machine, plan)
        .unwrap_or_else(|e| panic!("{}: {:?}", post.name, e.0));
    assert!(findings.0.is_empty(), "{}: {:?}", post.name, findings.0);
    assert!(read.complete && read.touches.len() == plan.touches.len(), "{}: {}", post.name, plan.program);
    let half = 0.5001 * 10f64.powi(-i32::try_from(post.log.decimals).unwrap());
    let of_lengths = if post.log.unit == LengthUnit::Inch { mm_from_inch(half) } else { half };
    for (touch, made) in read.touches.iter().zip(raw) {
        for (k, (a, b)) in touch.position.0.iter().zip(made.position.0).enumerate() {
            let most = if k < 3 { of_lengths } else { half };
            assert!((a - b).abs() <= most, "{} {k}: {touch:?} {made:?}", post.name);
        }
        if post.log.time_word.is_some()
            && let (Some(read), Some(made)) = (touch.time_s, made.time_s)
        {
            let half_tick = 0.5001 * 10f64.powi(-i32::try_from(post.log.time_decimals).unwrap());
            assert!((read - made).abs() <= half_tick, "{touch:?}");
        }
    }
    read.touches
}

/// Worst error of a parameter: offsets and sizes, um; tilts, deg.
fn worst(machine: &Machine, case: &Case, truth: &BTreeMap<String, f64>, runs: &[(&Plan, &[Touch])]) -> [f64; 2] {
    let effects: Vec<&str> = case.effects.iter().copied().chain(["block-setup", "pretravel"]).collect();
    let fit = identify_with(machine, runs, &effects, Settings { quick: true, ..Settings::default() });
    assert!(fit.outcome.converged, "{} {:?}", machine.name, case.programs);
    let mut worst = [0.0f64; 2];
    let mut identified = Vec::new();
    for p in fit.outcome.parameters.iter().filter(|p| p.status == Status::Identified) {
        let Some(planted) = truth.get(&p.name) else { continue };
        identified.push(&p.name);
        let (kind, to_shown) = match p.unit.as_str() {
            "mm" => (0, 1e3),
            "um" => (0, 1.0),
            "deg" => (1, 1.0),
            "urad" => (1, 1e-6_f64.to_degrees()),
            other => panic!("{}: {other}", p.name),
        };
        worst[kind] = worst[kind].max((p.value - planted).abs() * to_shown);
    }
    let missing = &fit.outcome.undetermined;
    assert_eq!(identified.len(), truth.len(), "{} {:?}: {identified:?}, {missing:?}", machine.name, case.programs);
    worst
}

/// A controller's file with another format of its log.
fn with_format(base: &str, unit: LengthUnit, decimals: usize) -> Postprocessor {
    let unit = if unit == LengthUnit::Inch { "inch" } else { "mm" };
    // a program in inches needs the fourth decimal in its numbers, too
    let number = if unit == "inch" { "[number]\ndecimals = 5\nunverified = \"another format\"\n" } else { "" };
    let text = format!(
        "format = \"axiscal-postprocessor/1\"\nbased_on = {base:?}\nname = {base:?}\n\
         [log]\nunit = {unit:?}\ndecimals = {decimals}\nunverified = \"another format\"\n{number}"
    );
    parse(&source(format!("{base} in {unit}, {decimals}"), text)).unwrap_or_else(|e| panic!("{e}")).0
}

/// A control's file with the format of its log.
struct Writing {
    format: &'static str,
    post: Postprocessor,
}

/// Every control and package as it is built in, and the five controls in every other format.
fn logs() -> Vec<Writing> {
    let format_of = |p: &Postprocessor| {
        FORMATS.into_iter().find(|(_, unit, decimals)| (*unit, *decimals) == (p.log.unit, p.log.decimals)).unwrap().0
    };
    let mut logs: Vec<Writing> = Vec::new();
    for name in CONTROLLERS.iter().chain(&PACKAGES) {
        let post = Postprocessor::load_built_in_or_file(name).unwrap().0;
        logs.push(Writing { format: format_of(&post), post });
    }
    for base in CONTROLLERS {
        for (name, unit, decimals) in FORMATS {
            if !logs.iter().any(|l| l.format == name && l.post.name == base) && decimals < 6 {
                logs.push(Writing { format: name, post: with_format(base, unit, decimals) });
            }
        }
    }
    logs
}

/// The table of the guide: format → offsets (um), tilts (deg).
fn stated() -> BTreeMap<String, [f64; 2]> {
    let guide = include_str!("../../docs/guide/controllers.md");
    let table = guide.split("### What the decimals of a log cost").nth(1).unwrap().split("###").next().unwrap();
    let mut stated = BTreeMap::new();
    for row in table.lines().filter(|l| l.starts_with("| mm") || l.starts_with("| inch")) {
        let cells: Vec<&str> = row.split('|').map(str::trim).collect();
        let number = |cell: &str| cell.split(' ').next().unwrap().trim_end_matches('°').parse::<f64>().unwrap();
        stated.insert(cells[1].to_owned(), [number(cells[4]), number(cells[5])]);
    }
    stated
}

fn generated(machine: &Machine, name: &str) -> Generated {
    let spec = program::choose(program::built_in().unwrap(), name, machine).unwrap();
    program::generate(machine, &spec, &Options::default()).unwrap().0
}

/// As `generate` does it: what cannot be read back and proven is not written. How many are proven, and what is refused.
fn proven(wanted: impl Fn(&str) -> bool) -> (usize, Vec<String>) {
    let posts = CONTROLLERS.map(|name| Postprocessor::load_built_in_or_file(name).unwrap().0);
    let (mut proven, mut refused) = (0, Vec::new());
    for case in &CASES {
        let machine = machine(case.machine);
        for generated in case.programs.iter().filter(|name| wanted(name)).map(|name| generated(&machine, name)) {
            for post in posts.iter().filter(|p| p.check.is_some()) {
                let what = format!("{} {} {}", post.name, machine.name, generated.plan.program);
                let nc = post.program(&machine, &generated.plan, &generated.path);
                let nc = nc.unwrap_or_else(|e| panic!("{what}: {e}"));
                let beside = nc.sources();
                let against = Against { plan: Some(&generated.plan), beside: &beside, ..Against::default() };
                match check(&machine, post, &source(what.as_str(), nc.text), &against) {
                    Err(failure) => refused.push(format!("{what}: {failure}")),
                    Ok(checked) => {
                        let errors = checked.findings.iter().filter(|f| f.severity == Severity::Error);
                        refused.extend(errors.map(ToString::to_string));
                        if checked.touches != generated.plan.touches.len() {
                            refused.push(format!("{what}: {} touches", checked.touches));
                        }
                        proven += 1;
                    }
                }
            }
        }
    }
    println!("{proven} programs read back");
    (proven, refused)
}

#[test]
fn every_controllers_program_for_every_machine_is_proven() {
    let (proven, refused) = proven(|name| name != "full");
    assert!(refused.is_empty() && proven >= 5 * 5, "{proven}: {refused:#?}");
}

#[test]
fn the_full_program_is_proven_too() {
    let (proven, refused) = proven(|name| name == "full");
    assert!(refused.is_empty() && proven >= 5 * 4, "{proven}: {refused:#?}");
}

#[test]
fn every_controllers_log_gives_back_what_was_planted_to_its_resolution() {
    let logs = logs();
    assert_eq!(logs.len(), 5 * 4 + 2 + 2);
    let mut all: BTreeMap<&str, [f64; 2]> = BTreeMap::new();
    for case in &CASES {
        let machine = machine(case.machine);
        let (scenario, truth) = wrong(&machine, case.effects);
        let plans: Vec<Plan> = case.programs.iter().map(|name| generated(&machine, name).plan).collect();
        let made: Vec<_> = plans.iter().map(|plan| simulate::run(&machine, plan, &scenario, None).unwrap().0).collect();
        // logs whose numbers are the same give the same fit: it is made once
        let mut fitted: Vec<(Vec<Position>, [f64; 2])> = Vec::new();
        for Writing { format, post } in &logs {
            let touches: Vec<Vec<Touch>> =
                plans.iter().zip(&made).map(|(plan, raw)| through_the_log(post, &machine, plan, raw)).collect();
            let places: Vec<Position> = touches.iter().flatten().map(|t| t.position).collect();
            let known = fitted.iter().find(|(known, _)| *known == places).map(|(_, found)| *found);
            let found = known.unwrap_or_else(|| {
                let runs: Vec<_> = plans.iter().zip(&touches).map(|(p, t)| (p, &t[..])).collect();
                let found = worst(&machine, case, &truth, &runs);
                println!(
                    "{} {:?} {format}: offsets {:.2e} um, tilts {:.2e} deg",
                    case.machine, case.programs, found[0], found[1]
                );
                fitted.push((places, found));
                found
            });
            // one step of the log for an offset; a tilt follows from places some ten millimetres apart
            let step = 10f64.powi(-i32::try_from(post.log.decimals).unwrap());
            let step = if post.log.unit == LengthUnit::Inch { mm_from_inch(step) } else { step };
            let what = format!("{} {:?} {} {format}", case.machine, case.programs, post.name);
            assert!(found[0] <= step * 1e3 && found[1] <= 5.0 * step, "{what}: {found:?}");
            all.entry(format).or_default().iter_mut().zip(found).for_each(|(a, f)| *a = a.max(f));
        }
    }
    println!("{all:#?}");
    let stated = stated();
    assert_eq!(stated.keys().map(String::as_str).collect::<Vec<_>>(), all.keys().copied().collect::<Vec<_>>());
    for (format, found) in all {
        for (found, stated) in found.into_iter().zip(stated[format]) {
            let says = format!("{format}: {found:.2e} found, the guide says {stated:.2e}");
            assert!(found <= stated && stated < 2.0 * found, "{says}");
        }
    }
}

/// A log whose head is lost is in the unit of the other heads in the file, or in that of the postprocessor file: in millimetres all of
/// its touches would be far off.
#[test]
fn a_log_without_its_head_is_in_the_unit_of_its_control() {
    let machine = machine("swivel-head");
    let plan = generated(&machine, "head").plan;
    let (raw, _) = simulate::run(&machine, &plan, &Scenario::flawless(), None).unwrap();
    let record =
        |t: &RawTouch| LogRecord { id: t.id.unwrap(), status: t.status, position: t.position, time_s: t.time_s };
    let records: Vec<LogRecord> = raw.iter().map(record).collect();
    for unit in [LengthUnit::Inch, LengthUnit::Mm] {
        let post = with_format("fanuc", unit, 5);
        let whole = post.log_text(&machine, &plan, &records);
        let headless: String = whole.lines().filter(|l| !l.starts_with('H')).map(|l| format!("{l}\r\n")).collect();
        for text in [headless.clone(), whole.clone() + &headless] {
            let (read, findings) =
                log::read(text.as_bytes(), "run.log", Writer::Controller(&post), &machine, &plan).unwrap();
            assert!(read.touches.len() == plan.touches.len(), "{unit:?}: {:?}", findings.0);
            for (touch, made) in read.touches.iter().zip(&raw) {
                assert!((touch.position.xyz_mm() - made.position.xyz_mm()).norm() < 1e-3, "{unit:?}: {touch:?}");
            }
        }
    }
}
