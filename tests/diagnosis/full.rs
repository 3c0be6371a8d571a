//! The `full` programs: that the plan holds what names effects, that the program stops where a person must act, and that
//! its log comes back whole.

use crate::common;

use assert_cmd::Command;
use axiscal::axes::{AxisMap, AxisName};
use axiscal::diag::source;
use axiscal::machine::Machine;
use axiscal::model::data::{Run, assemble};
use axiscal::post::Postprocessor;
use axiscal::program::plan::{Plan, PlanTouch};
use axiscal::program::{self, Generated, Options};
use std::collections::{BTreeMap, BTreeSet};

const MACHINES: [&str; 6] =
    ["swivel-head", "double-head", "trunnion", "swivel-table-b", "nutating-b", "trunnion-offset"];

fn generated(machine: &Machine) -> Generated {
    let spec = program::choose(program::built_in().unwrap(), "full", machine).unwrap();
    program::generate(machine, &spec, &Options { strict: true, tcp: false }).unwrap().0
}

/// Numbers as a set that can be compared: thousandths.
fn distinct(values: impl Iterator<Item = f64>) -> BTreeSet<i64> {
    values.map(|v| (v * 1000.0).round() as i64).collect()
}

fn length(plan: &Plan, t: &PlanTouch) -> f64 {
    t.tool_length_mm.unwrap_or(plan.tool_length_mm)
}

/// First touches of the visits, in order.
fn visits(plan: &Plan) -> Vec<&PlanTouch> {
    let mut out: Vec<&PlanTouch> = Vec::new();
    for t in &plan.touches {
        if out.last().is_none_or(|last| last.visit != t.visit) {
            out.push(t);
        }
    }
    out
}

#[test]
fn nothing_is_left_out_and_it_fits_into_a_morning() {
    for name in MACHINES {
        let machine = common::machine(name);
        let g = generated(&machine);
        assert!(g.plan.skipped.is_empty());
        assert!((600..=800).contains(&g.plan.touches.len()), "{name}: {}", g.plan.touches.len());
        assert!(g.path.seconds < 3.0 * 3600.0, "{name}: {} s", g.path.seconds);
        let times: Vec<f64> = g.plan.touches.iter().map(|t| t.time_s.unwrap()).collect();
        assert!(times.windows(2).all(|w| w[0] < w[1]));
        // ordinary visits are minutes apart, the two stops at least as long as a person needs for a stylus
        let stops = g.plan.touches.windows(2).filter(|w| length(&g.plan, &w[0]) != length(&g.plan, &w[1]));
        let waits: Vec<f64> = stops.map(|w| w[1].time_s.unwrap() - w[0].time_s.unwrap()).collect();
        assert!(waits.len() == 2 && waits.iter().all(|s| *s > 300.0), "{waits:?}");
    }
}

/// Two patterns of k and k' per turn are told apart by some angle: no set of angles with a common step does that for all.
#[test]
fn angles_tell_harmonics_apart() {
    for name in MACHINES {
        let machine = common::machine(name);
        let plan = generated(&machine).plan;
        for axis in machine.rotary() {
            let angles: Vec<f64> = distinct(plan.touches.iter().filter_map(|t| t.pose.get(axis.name)))
                .iter()
                .map(|a| *a as f64 / 1e3)
                .collect();
            assert!(angles.len() >= 8, "{name} {}: {angles:?}", axis.name);
            // a nutating table has nothing below 0
            let below = axis.range[0] <= -90.0 && axis.name != AxisName::C;
            assert!(angles.iter().any(|a| *a > 0.0) && (!below || angles.iter().any(|a| *a < 0.0)));
            // seen at these angles only, k per turn is other per turn where all of them are turns of k - other, and its mirror
            // image where they are turns of k + other: at multiples of 45 deg 7 per turn is once per turn backwards
            for k in 1..=8 {
                for other in 1..k {
                    for between in [k - other, k + other] {
                        let apart = angles.iter().map(|a| {
                            let turn = (a * f64::from(between)).rem_euclid(360.0);
                            turn.min(360.0 - turn)
                        });
                        assert!(apart.fold(0.0, f64::max) > 30.0, "{name} {}: {other} and {k} per turn", axis.name);
                    }
                }
            }
            let senses = distinct(plan.touches.iter().filter_map(|t| t.from.get(axis.name)));
            assert_eq!(senses, BTreeSet::from([-1000, 1000]), "{name} {}", axis.name);
            // up and down again and again: an error that grows with time is not one that grows with the angle
            let way: Vec<f64> = visits(&plan)
                .windows(2)
                .filter_map(|w| Some((w[1].pose.get(axis.name)? - w[0].pose.get(axis.name)?).signum()))
                .filter(|s| *s != 0.0)
                .collect();
            assert!(way.windows(2).filter(|w| w[0] != w[1]).count() >= 8, "{name} {}: {way:?}", axis.name);
        }
    }
}

#[test]
fn spindle_styli_feeds_heights_and_blocks() {
    for name in MACHINES {
        let machine = common::machine(name);
        let plan = generated(&machine).plan;
        let spindle = distinct(plan.touches.iter().map(|t| t.spindle_deg.unwrap_or(0.0)));
        assert_eq!(spindle, BTreeSet::from([0, 90_000, 180_000]), "{name}");
        let lengths = distinct(plan.touches.iter().map(|t| length(&plan, t)));
        assert_eq!(lengths, BTreeSet::from([202_684, 302_684]), "{name}");
        let feeds = distinct(plan.touches.iter().filter_map(|t| t.feed_mm_min));
        assert_eq!(feeds, BTreeSet::from([60_000, 240_000]), "{name}");
        // the same points at both feeds
        let points = |feed: f64| -> BTreeSet<String> {
            let here = plan.touches.iter().filter(|t| t.feed_mm_min == Some(feed));
            here.map(|t| format!("{} {:?} {:?} {:?}", t.block, t.face, t.point, t.pose)).collect()
        };
        assert!(points(60.0).intersection(&points(240.0)).count() >= 6, "{name}");

        let turntable: BTreeSet<&str> =
            plan.touches.iter().filter(|t| t.carrier == "C").map(|t| t.block.as_str()).collect();
        let standing: BTreeSet<&str> =
            plan.touches.iter().filter(|t| t.carrier == "table").map(|t| t.block.as_str()).collect();
        let has_turntable = machine.axis(AxisName::C).is_some();
        assert!(!has_turntable || turntable.len() >= 2, "{name}: {turntable:?}");
        assert!(!standing.is_empty(), "{name}");
        let heights: Vec<i64> = distinct(plan.blocks.iter().map(|b| b.centre[2])).into_iter().collect();
        assert_eq!(heights, [-202_684, -162_684], "{name}");
        // repeats right after each other: degrees of freedom of the noise of a touch
        assert!(plan.touches.iter().filter(|t| t.repeat > 1).count() >= 28, "{name}");
    }
}

#[test]
fn a_tilted_head_touches_the_face_that_only_it_can_tell() {
    for name in ["swivel-head", "double-head"] {
        let plan = generated(&common::machine(name)).plan;
        for visit in visits(&plan).iter().filter(|t| t.pose.get(AxisName::B).unwrap() < 0.0) {
            let here = |t: &&PlanTouch| t.pose == visit.pose && t.carrier == "table" && t.face == "-X";
            assert!(plan.touches.iter().any(|t| here(&t)), "{name} {:?}", visit.pose);
        }
    }
}

#[test]
fn set_ups_come_back_and_visits_are_counted() {
    for name in MACHINES {
        let machine = common::machine(name);
        let plan = generated(&machine).plan;
        let visits = visits(&plan);
        let numbers: Vec<u32> = visits.iter().map(|t| t.visit.unwrap()).collect();
        assert_eq!(numbers, (1..=visits.len() as u32).collect::<Vec<_>>(), "{name}");
        for w in plan.touches.windows(2) {
            let moved =
                w[0].pose != w[1].pose || w[0].from != w[1].from || length(&plan, &w[0]) != length(&plan, &w[1]);
            // the same pose in the same sense may be a visit of its own only if the axis went away between
            assert!(!moved || w[0].visit != w[1].visit, "{name}: touch {}", w[1].id);
        }
        let key = |t: &PlanTouch| format!("{:?} {:?} {}", t.pose, t.from, length(&plan, t));
        let mut times: BTreeMap<String, usize> = BTreeMap::new();
        visits.iter().for_each(|t| *times.entry(key(t)).or_default() += 1);
        let again: usize = times.values().map(|n| n - 1).sum();
        // a vector of three per visit: twelve degrees of freedom and more
        assert!(again >= 5, "{name}: {again} visits come again");
        let ends = [visits[0], *visits.last().unwrap()].map(|t| (t.pose, t.from, length(&plan, t)));
        assert_eq!(ends[0], ends[1], "{name}: it ends where it began");
        // the blocks stand as they stood: one set-up each
        let nominal: Vec<_> = plan
            .touches
            .iter()
            .map(|t| axiscal::log::Touch {
                id: t.id,
                position: t.nominal_position(),
                status: axiscal::log::Status::Hit,
                time_s: None,
                digit_mm: None,
                temperature_deg_c: None,
                line: 0,
            })
            .collect();
        let data = assemble(&machine, &[Run { plan: &plan, touches: &nominal, mounting: None, started_s: None }]);
        assert_eq!((data.set_ups.len(), data.unusable.len()), (4, 0), "{name}");
        // a spindle that turns while the rotary axes stand makes no other visit of it: their scatter is one
        assert!(plan.touches.iter().any(|t| t.spindle_deg.is_some()), "{name}");
        assert_eq!(data.poses.len(), visits.len(), "{name}");
    }
}

#[test]
fn the_program_stops_says_what_to_do_and_can_be_taken_up_behind_each_stop() {
    let post = &Postprocessor::built_in().unwrap()[0];
    for name in MACHINES {
        let machine = common::machine(name);
        let g = generated(&machine);
        let text = post.program(&machine, &g.plan, &g.path).unwrap().text;
        let lines: Vec<&str> = text.lines().collect();
        let stops: Vec<usize> = lines
            .iter()
            .enumerate()
            .filter(|(_, l)| l.contains("(DEBUG,axiscal: change to the"))
            .map(|(i, _)| i)
            .collect();
        assert_eq!(stops.len(), 2, "{name}");
        for (at, stylus) in stops.iter().zip(["stylus long", "own stylus"]) {
            let around = lines[at - 6..at + 6].join("\n");
            for word in [stylus, "M5 M9", "leave the blocks as they stand", "press cycle start", "\nM0\n"] {
                assert!(around.contains(word), "{name}: {word} not in {around}");
            }
        }
        // every set-up can be taken up, and says before it what must be mounted
        let setups = lines.iter().filter(|l| l.starts_with("(set-up ")).count();
        assert!(!text.contains("cannot start again"), "{name}");
        assert_eq!(text.matches("mounted must be: mounting full").count(), setups - 1, "{name}");
        assert_eq!(lines.iter().filter(|l| **l == "M0").count(), setups - 1 + 2, "{name}");
        assert!(text.contains("At stop 2, where the program waits"), "{name}");
    }
}

const WRONG: &str = "seed = 3\n[effects.pretravel]\npretravel = 0.004\n[effects.squareness-xy]\nEC0Y = 40.0\n[effects.backlash-x]\nbacklash = 4.0\n\
    [effects.tip-eccentricity]\nex = 8.0\ney = -5.0\n[effects.latency]\nlatency = 2.0\n[effects.drift-linear]\nvx = 6.0\nvy = -4.0\nvz = 3.0\n\
    [[block]]\nmounting = \"full\"\nname = \"a\"\nshift = [0.3, -0.2, 0.1]\n\
    [noise]\ntouch_um = 1.0\nvisit_um = 0.5\n";

#[test]
fn every_touch_hits_and_is_read_back() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("wrong.toml"), WRONG).unwrap();
    for name in MACHINES {
        let call = |args: &[&str]| {
            let mut command = Command::cargo_bin("axiscal").unwrap();
            let output = command.current_dir(folder.path()).args(args).arg("--json").assert().success();
            serde_json::from_slice::<serde_json::Value>(&output.get_output().stdout).unwrap()
        };
        let made =
            call(&["generate", "--machine", name, "--program", "full", "--controller", "linuxcnc", "--out", name]);
        let (plan, log) = (format!("{name}/full.plan.json"), format!("{name}/full.log"));
        let done = call(&[
            "simulate",
            "--plan",
            &plan,
            "--machine",
            name,
            "--scenario",
            "wrong.toml",
            "--controller",
            "linuxcnc",
            "--out",
            &log,
        ]);
        assert_eq!(done["touches"], made["touches"], "{name}");
        let read = call(&["parse", "--controller", "linuxcnc", "--plan", &plan, &log]);
        assert_eq!((&read["hits"], &read["misses"]), (&made["touches"], &0.into()), "{name}: {read}");
    }
}

/// Two mountings, a stylus change, and a mounting that is put up once more.
const SEVERAL: &str = r#"format = "axiscal-programs/1"
name = "several"
mounting = "head"
[[grid]]
name = "G"
u = [-2.0, 2.0]
v = [0.0]
[[stage]]
name = "one"
[[stage.setup]]
pose = { B = 0.0 }
touch = [{ faces = ["+Z"], grid = "G" }]
[[stage]]
name = "two"
mounting = "table"
stylus = "long"
[[stage.setup]]
pose = { C = [0.0, 90.0] }
touch = [{ faces = ["+Z"], grid = "G" }]
[[stage]]
name = "three"
[[stage.setup]]
pose = { B = 0.0 }
touch = [{ faces = ["+Z"], grid = "G" }]
[[stage]]
name = "four"
placed = "anew"
[[stage.setup]]
pose = { B = 0.0 }
blocks = ["x-"]
touch = [{ faces = ["+Z"], grid = "G" }]
"#;

#[test]
fn blocks_that_are_put_up_anew_are_other_blocks() {
    let machine = common::machine("swivel-head");
    let plan_of = |text: &str| {
        let (spec, _) = program::load(&source("several.toml", text)).unwrap();
        program::generate(&machine, &spec, &Options::default()).unwrap().0.plan
    };
    let plan = plan_of(SEVERAL);
    let labels = |plan: &Plan| -> Vec<String> {
        let mut labels: Vec<String> =
            plan.touches.iter().map(|t| t.mounting.clone().unwrap_or_else(|| plan.mounting.clone())).collect();
        labels.dedup();
        labels
    };
    assert_eq!(labels(&plan), ["head", "table", "head#2", "head#3"]);
    assert_eq!(plan.blocks.len(), 4 + 1 + 4 + 4);
    // slow and wide again on each block of each part
    assert_eq!(plan.touches.iter().filter(|t| t.first).count(), 4 + 1 + 4 + 1);
    assert!(plan.touches.iter().all(|t| t.tool_length_mm.is_some() == (t.stage == "two")));
    let visits: BTreeSet<u32> = plan.touches.iter().filter_map(|t| t.visit).collect();
    assert_eq!(visits.len(), 5, "a stop begins a visit although no axis turns");

    // a pallet that comes back to its place
    let same = plan_of(&SEVERAL.replace("name = \"three\"", "name = \"three\"\nplaced = \"same\""));
    assert_eq!(labels(&same), ["head", "table", "head", "head#2"]);

    let raw: Vec<_> = plan
        .touches
        .iter()
        .map(|t| axiscal::log::Touch {
            id: t.id,
            position: t.nominal_position(),
            status: axiscal::log::Status::Hit,
            time_s: None,
            digit_mm: None,
            temperature_deg_c: None,
            line: 0,
        })
        .collect();
    for mounting in [None, Some("study")] {
        let data = assemble(&machine, &[Run { plan: &plan, touches: &raw, mounting, started_s: None }]);
        assert_eq!((data.set_ups.len(), data.unusable.len()), (4 + 1 + 4 + 1, 0), "{mounting:?}");
    }

    // the virtual machine moves only the blocks that are named
    let scenario = axiscal::simulate::Scenario::default().with_block("head#2", "x-", [0.0, 0.0, 0.2], [0.0; 3]);
    let touches = common::touch(&machine, &plan, &scenario, None);
    for (touch, planned) in touches.iter().zip(&plan.touches) {
        let off = touch.position.get(AxisName::Z) - planned.nominal_position().get(AxisName::Z);
        let moved = planned.block == "x-" && planned.mounting.as_deref() == Some("head#2");
        assert!((off - if moved { 0.2 } else { 0.0 }).abs() < 1e-9, "{}: {off}", planned.id);
    }
}

#[test]
fn a_path_that_forgets_what_is_mounted_is_refused() {
    use axiscal::program::path::Step;
    let machine = common::machine("swivel-head");
    let (spec, _) = program::load(&source("several.toml", SEVERAL)).unwrap();
    let good = program::generate(&machine, &spec, &Options::default()).unwrap().0;
    let says = |change: &dyn Fn(&mut Vec<Step>)| {
        let mut path = good.path.clone();
        change(&mut path.steps);
        let found = program::verify(&machine, &good.plan, &path).unwrap();
        found.into_iter().map(|v| v.says).collect::<Vec<_>>().join("\n")
    };
    assert_eq!(says(&|_| {}), "");
    let stop = |steps: &[Step]| steps.iter().position(|s| matches!(s, Step::Stop(_))).unwrap();
    let left_out = says(&|steps| {
        steps.remove(stop(steps));
    });
    assert!(
        left_out.contains("its mounting is not the one that is up") && left_out.contains("its stylus"),
        "{left_out}"
    );
    let other_stylus = says(&|steps| {
        let at = stop(steps);
        if let Step::Stop(stop) = &mut steps[at] {
            stop.tool_length_mm -= 100.0;
        }
    });
    assert!(other_stylus.contains("its stylus is not the one that is in the probe"), "{other_stylus}");
    let low = says(&|steps| {
        let at = stop(steps);
        let before = steps[..at].iter().rposition(|s| matches!(s, Step::Rapid { .. })).unwrap();
        steps.insert(at, Step::Rapid { to: AxisMap::default().with(AxisName::Z, 300.0) });
        assert!(before < at);
    });
    assert!(low.contains("elsewhere than at the top"), "{low}");
    // the long stylus reaches 100 mm further down
    let crash = says(&|steps| {
        let at = stop(steps);
        let down =
            steps[at..].iter().position(|s| matches!(s, Step::Rapid { to } if to.get(AxisName::Z).is_some())).unwrap();
        if let Step::Rapid { to } = &mut steps[at + down] {
            to.set(AxisName::Z, to.get(AxisName::Z).unwrap() - 60.0);
        }
    });
    assert!(crash.contains("would"), "{crash}");
}

#[test]
fn a_fixed_block_in_the_way_of_the_turntable_is_refused() {
    let text =
        axiscal::machine::BUILT_IN.replacen("centre = [0.0, -140.0, -202.684]", "centre = [0.0, -40.0, -202.684]", 1);
    assert_ne!(text, axiscal::machine::BUILT_IN);
    let (machines, _) = axiscal::machine::load(&source("m.toml", text)).unwrap();
    let machine = machines.into_iter().find(|m| m.name == "swivel-head").unwrap();
    let spec = program::choose(program::built_in().unwrap(), "full", &machine).unwrap();
    let failure = program::generate(&machine, &spec, &Options::default()).unwrap_err();
    assert!(failure.to_string().contains("at every angle of the rotary axes"), "{failure}");
}

#[test]
fn a_controller_without_a_stop_and_a_machine_without_the_stylus_say_so() {
    let machine = common::machine("swivel-head");
    let g = generated(&machine);
    let (_, text) = axiscal::post::BUILT_IN[0];
    let begin = text.find("[write.stop]").unwrap();
    let end = begin + 1 + text[begin + 1..].find("\n[write.").unwrap();
    let (post, _) = axiscal::post::parse(&source("mine.toml", format!("{}{}", &text[..begin], &text[end..]))).unwrap();
    let failure = post.program(&machine, &g.plan, &g.path).unwrap_err();
    assert!(failure.to_string().contains("how a program waits for a person"), "{failure}");

    // the first part cannot be touched at all: the ball would have to come from below
    let below = SEVERAL.replacen("touch = [{ faces = [\"+Z\"]", "touch = [{ faces = [\"-Z\"]", 1);
    let (spec, _) = program::load(&source("s.toml", below)).unwrap();
    let failure = program::generate(&machine, &spec, &Options::default()).unwrap_err();
    let why = |words: &str| failure.0.iter().any(|f| f.message.contains(words));
    assert!(why("in the part with which the program begins") && why("nothing of \"several\""), "{failure:?}");

    let (spec, _) = program::load(&source("s.toml", SEVERAL.replace("\"long\"", "\"longer\""))).unwrap();
    let failure = program::generate(&machine, &spec, &Options::default()).unwrap_err();
    assert!(failure.to_string().contains("no stylus \"longer\""), "{failure}");
}
