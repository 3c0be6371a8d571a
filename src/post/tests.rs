use super::*;
use crate::axes::AxisMap;
use crate::machine::Machine;
use crate::program::path::{self, Step, TouchStep};
use crate::program::plan::{ControllerFrame, Plan};

pub(crate) fn machine(name: &str) -> Machine {
    let (machines, _) = crate::machine::load(&source("m", crate::machine::BUILT_IN)).unwrap();
    machines.into_iter().find(|m| m.name == name).unwrap()
}

/// A plan of a few touches on one block of a mounting: two down on its upper face, one from the side, at rotary zero.
pub(crate) fn plan(machine: &Machine, mounting: &str, block: &str) -> Plan {
    let mounting = machine.mounting(mounting).unwrap();
    let b = mounting.blocks.iter().find(|b| b.name == block).unwrap();
    let ball = machine.tool.ball_at_zero(machine.tool.length_mm);
    let pose: serde_json::Map<_, _> = machine.rotary().map(|a| (a.name.to_string(), 0.0.into())).collect();
    let touch = |id: u64, face: &str, point: [f64; 3], normal: [f64; 3]| {
        let along = |off: f64| {
            let p = |i: usize| point[i] + normal[i] * (3.0 + off) - ball[i];
            serde_json::json!({"X": p(0), "Y": p(1), "Z": p(2)})
        };
        serde_json::json!({"id": id, "stage": "t", "carrier": mounting.carrier.to_string(), "block": block, "face": face,
            "point": point, "normal": normal, "pose": pose, "start": along(2.0), "nominal": along(0.0), "end": along(-2.0),
            "first": id == 1})
    };
    let c = b.centre;
    let json = serde_json::json!({"format": "axiscal-plan/1", "machine": machine.name, "program": "t",
        "mounting": mounting.name, "ball_radius_mm": 3.0, "tool_length_mm": machine.tool.length_mm,
        "blocks": [{"name": block, "carrier": mounting.carrier.to_string(), "centre": [c.x, c.y, c.z], "size": [b.size.x, b.size.y, b.size.z]}],
        "touches": [touch(1, "+Z", [c.x - 2.0, c.y, c.z + 5.0], [0.0, 0.0, 1.0]),
                    touch(2, "+Z", [c.x + 2.0, c.y + 1.0, c.z + 5.0], [0.0, 0.0, 1.0]),
                    touch(3, "+X", [c.x + 5.0, c.y, c.z + 2.0], [1.0, 0.0, 0.0])]});
    Plan::parse(&source("plan", json.to_string())).unwrap().0
}

/// A path over the plan's touches, by hand: up, turn, over, down, touch, back.
pub(crate) fn path(plan: &Plan, probe: &crate::machine::as_written::Probe) -> path::Path {
    let high = 60.0;
    let z = |v: f64| AxisMap::default().with(AxisName::Z, v);
    let mut steps = vec![
        Step::Note("up first".into()),
        Step::Rapid { to: z(high) },
        Step::Rotary { to: plan.touches[0].pose, sense: AxisMap::default() },
        Step::Rapid { to: AxisMap::default().with(AxisName::X, 0.0) },
        Step::Rapid { to: AxisMap::default().with(AxisName::Y, 0.0) },
    ];
    for (i, t) in plan.touches.iter().enumerate() {
        if i != 1 {
            let number = 1 + u32::from(i > 1);
            // the second set-up begins high over the first column, the opening ended at X0 Y0
            let to = |axis: AxisName| Step::Rapid {
                to: AxisMap::default().with(axis, plan.touches[i.saturating_sub(1)].start.get(axis).unwrap()),
            };
            let resume = if number == 1 { Vec::new() } else { vec![to(AxisName::X), to(AxisName::Y)] };
            steps.push(Step::Setup { number, says: format!("face {}", t.face), resume: Some(resume) });
        }
        let start = t.start;
        for axis in [AxisName::X, AxisName::Y] {
            steps.push(Step::Rapid { to: AxisMap::default().with(axis, start.get(axis).unwrap()) });
        }
        steps.push(Step::Protected { to: z(start.get(AxisName::Z).unwrap()), feed: probe.position_feed });
        steps.push(Step::Touch(TouchStep {
            id: t.id,
            says: format!("block {} face {}", t.block, t.face),
            start,
            nominal: t.nominal,
            end: t.end,
            pose: t.pose,
            first: t.first,
            tolerance_mm: probe.placement_tolerance,
            search_feed: if t.first { probe.slow_feed } else { probe.fast_feed },
            measure_feed: probe.slow_feed,
            back_off_mm: probe.back_off,
        }));
        let axis = if t.face == "+X" { AxisName::X } else { AxisName::Z };
        let to = AxisMap::default().with(axis, start.get(axis).unwrap());
        steps.push(Step::Retract { to, feed: probe.position_feed });
        steps.push(Step::Protected { to: z(high), feed: probe.position_feed });
    }
    path::Path { head: vec!["three touches (by hand), about 1 min".into()], steps, seconds: 60.0, ..Default::default() }
}

fn program_of(name: &str, mounting: &str, block: &str, frame: ControllerFrame) -> String {
    let machine = machine(name);
    let mut plan = plan(&machine, mounting, block);
    plan.controller_frame = frame;
    let path = path(&plan, &machine.probe);
    let post = Postprocessor::load_built_in_or_file("linuxcnc").unwrap().0;
    let program = post.program(&machine, &plan, &path).unwrap_or_else(|e| panic!("{:#?}", e.0));
    if let Some(folder) = option_env!("AXISCAL_KEEP") {
        let stem = format!("{folder}/{name}-{frame:?}");
        std::fs::write(format!("{stem}.ngc"), &program.text).unwrap();
        std::fs::write(format!("{stem}.plan.json"), plan.to_json()).unwrap();
    }
    program.text
}

#[test]
fn what_is_shipped_can_be_used() {
    let all = Postprocessor::built_in().unwrap_or_else(|e| panic!("{:#?}", e.0));
    let file_of = |p: &Postprocessor| format!("{}.toml", p.name);
    assert!(all.iter().zip(BUILT_IN).all(|(p, (file, _))| file_of(p) == file), "a file is called as its control");
    assert_eq!(all[0].name, "linuxcnc");
    assert!(all[0].unverified.is_empty());
    program_of("swivel-head", "head", "x+", ControllerFrame::Axes);
}

#[test]
fn the_same_input_gives_the_same_bytes() {
    let one = program_of("swivel-head", "head", "x+", ControllerFrame::Axes);
    assert_eq!(one, program_of("swivel-head", "head", "x+", ControllerFrame::Axes));
    assert!(one.is_ascii() && one.lines().all(|l| l.len() <= 255) && !one.contains("-0 "));
}

#[test]
fn every_label_is_opened_and_closed_once() {
    for frame in [ControllerFrame::Axes, ControllerFrame::Tcp] {
        let text = program_of("trunnion", "table", "x+", frame);
        let mut opened = std::collections::BTreeSet::new();
        let mut open = Vec::new();
        for line in text.lines().filter(|l| l.starts_with('o') && !l.starts_with("o<")) {
            let (label, word) = line.split_once(' ').unwrap();
            if word.starts_with("if ") {
                assert!(opened.insert(label), "{label} is used twice");
                open.push(label);
            } else if word.starts_with("endif") {
                assert_eq!(open.pop(), Some(label));
            } else {
                assert_eq!(open.last(), Some(&label), "{line}");
            }
        }
        assert!(open.is_empty());
    }
}

#[test]
fn a_touch_is_searched_released_measured_and_logged() {
    let text = program_of("swivel-head", "head", "x+", ControllerFrame::Axes);
    let (_, routine) = text.split_once("\no<touch> sub\n").unwrap();
    let (routine, _) = routine.split_once("\no<touch> endsub").unwrap();
    let (_, measures) = routine.split_once("\n(search)\n").unwrap();
    let moves: Vec<&str> = measures.lines().filter(|l| l.starts_with('G')).collect();
    // search, off the face, measuring touch, off the face, back
    let expected = [
        "G38.3 X#3 Y#4 Z#5 F#7",
        "G38.5 X#<bx> Y#<by> Z#<bz> F300",
        "G38.3 X#<bx> Y#<by> Z#<bz> F300",
        "G38.3 X#3 Y#4 Z#5 F#8",
        "G38.5 X#<_axiscal_x> Y#<_axiscal_y> Z#<_axiscal_z> F300",
        "G38.3 X#<_axiscal_x> Y#<_axiscal_y> Z#<_axiscal_z> F#<_axiscal_feed>",
    ];
    assert_eq!(moves, expected);
    assert!(measures.contains("(LOG,P N%.0f#1 S0 X%.6f#5061 Y%.6f#5062 Z%.6f#5063 B%.6f#5065 C%.6f#5066 K%.6f#<sum>)"));
    assert!(measures.contains("(LOG,P N%.0f#1 S1 X%.6f#5061"));
    assert!(measures.contains("axiscal: missed") && text.contains("touch %.0f#1, block x+ face +Z)"));
    assert!(measures.contains("[ABS[#<off>] GT 1]"), "placement tolerance");
    assert!(measures.contains("than it should"), "every touch is checked: X and Y of a block show on its sides only");
    assert!(measures.contains("the probe triggered on the way back from the face"));
    let call = |id: u32| text.lines().find(|l| l.starts_with(&format!("o<touch> call [{id}] "))).unwrap();
    // the first touch of the block is searched slowly; the second fast: the block has been met in this set-up
    assert!(call(1).ends_with(" [6] [2] [60] [60]"), "{}", call(1));
    assert!(call(2).ends_with(" [6] [2] [300] [60]"), "{}", call(2));
}

#[test]
fn a_second_set_up_can_be_started_by_itself() {
    let text = program_of("swivel-head", "head", "x+", ControllerFrame::Axes);
    let first = text.find("G0 Z60").unwrap();
    assert!(first < text.find("(set-up 1").unwrap(), "the first moves stand before every set-up");
    let second = &text[text.find("(set-up 2").unwrap()..];
    let way: Vec<&str> = second.lines().filter(|l| l.starts_with("G0 ")).take(2).collect();
    assert_eq!(way, ["G0 X32", "G0 Y1"]);
    // only the first search of a block that this run has not met is slow
    assert_eq!(second.matches("[300 + [#<_axiscal_from> GT 1] * [60 - 300]]").count(), 1);
}

#[test]
fn a_user_changes_a_controller_without_code() {
    let mine = BUILT_IN[0]
        .1
        .replace("release_feed = \"300\"", "release_feed = \"77\"")
        .replace("name = \"linuxcnc\"", "name = \"mine\"");
    let (post, _) = parse(&source("mine.toml", mine)).unwrap();
    let machine = machine("swivel-head");
    let plan = plan(&machine, "head", "x+");
    let program = post.program(&machine, &plan, &path(&plan, &machine.probe)).unwrap();
    assert!(program.text.contains("F77") && program.text.contains("H AXISCAL 1 MINE "));
}

#[test]
fn what_is_wrong_in_a_file_is_said_with_its_place() {
    let cases = [
        ("axiscal-postprocessor/1", "axiscal-postprocessor/9", "post::format"),
        ("decimals = 6                             # of", "decimals = 60 # of", "post::decimals"),
        ("template = \"{{ text | note }}\"\nsource", "template = \"{{ text | note\"\nsource", "post::template"),
        ("source = \"LinuxCNC manual 11.5.3 G0: coordinated, straight\"", "", "post::no_source"),
        ("word = \"{axis}{value}\"", "word = \"{axis}\"", "post::word"),
        ("check_word = \"K\"", "check_word = \"X\"", "post::word"),
        ("rotary_step = 2.0", "rotary_step = 0.0", "post::rotary_step"),
        ("axes = [\"X\", \"Y\"", "axes = [\"X\", \"X\"", "post::columns"),
        ("[write.retract]", "[write.retreat]", "post::not_toml"),
    ];
    for (from, to, code) in cases {
        assert!(BUILT_IN[0].1.contains(from), "{from}");
        let failure = parse(&source("mine.toml", BUILT_IN[0].1.replacen(from, to, 1))).unwrap_err();
        let finding = failure.0.iter().find(|f| f.code == code).unwrap_or_else(|| panic!("{code}: {failure}"));
        assert!(finding.place().is_some() && finding.help.is_some(), "{code}");
    }
    let unverified = BUILT_IN[0].1.replacen(
        "source = \"LinuxCNC manual 11.5.3 G0: coordinated, straight\"",
        "unverified = \"from memory\"",
        1,
    );
    let (post, _) = parse(&source("mine.toml", unverified)).unwrap();
    let machine = machine("swivel-head");
    let plan = plan(&machine, "head", "x+");
    let program = post.program(&machine, &plan, &path(&plan, &machine.probe)).unwrap();
    assert_eq!(program.findings.0[0].code, "post::unverified");
    assert!(program.text.contains("NOT VERIFIED on a real control: 1 entry, see t.notes.txt"));
    let notes = program.beside.last().unwrap();
    assert!(notes.text.contains("- write.rapid: from memory\n") && !notes.to_control, "{}", notes.text);
    let undefined = BUILT_IN[0].1.replacen("o<orient> call [{{ deg }}]", "o<orient> call [{{ degrees }}]", 1);
    let (post, _) = parse(&source("mine.toml", undefined)).unwrap();
    let mut path = path(&plan, &machine.probe);
    path.steps.insert(0, Step::OrientSpindle { deg: 0.0 });
    let failure = post.program(&machine, &plan, &path).unwrap_err();
    assert!(failure.0[0].message.contains("template orient, line 2"), "{failure}");
}

#[test]
fn a_broken_path_is_refused() {
    let machine = machine("swivel-head");
    let plan = plan(&machine, "head", "x+");
    let post = Postprocessor::load_built_in_or_file("linuxcnc").unwrap().0;
    let good = path(&plan, &machine.probe);
    let at = good.steps.iter().position(|s| matches!(s, Step::Touch(_))).unwrap();
    let with = |change: &dyn Fn(&mut path::Path)| {
        let mut path = good.clone();
        change(&mut path);
        post.program(&machine, &plan, &path).map(|_| ())
    };
    with(&|_| {}).unwrap();
    with(&|p| drop(p.steps.remove(at - 1))).unwrap_err();
    with(&|p| p.steps.insert(0, Step::Rapid { to: AxisMap::default().with(AxisName::X, f64::NAN) })).unwrap_err();
    with(&|p| p.steps.insert(0, Step::Rapid { to: AxisMap::default().with(AxisName::A, 1.0) })).unwrap_err();
    with(&|p| p.steps.insert(at, Step::Protected { to: AxisMap::xyz(1.0, 2.0, 3.0), feed: 0.0 })).unwrap_err();
    with(&|p| {
        let sense = AxisMap::default().with(AxisName::C, -1.0);
        p.steps.insert(at, Step::Rotary { to: AxisMap::default().with(AxisName::C, 90.0), sense });
    })
    .unwrap_err();
    with(&|p| {
        if let Step::Touch(t) = &mut p.steps[at] {
            t.id = 0
        }
    })
    .unwrap_err();
    with(&|p| {
        if let Step::Touch(t) = &mut p.steps[at] {
            t.end = t.start
        }
    })
    .unwrap_err();
}

#[test]
fn under_the_transformation_turns_go_in_steps_that_end_where_the_plan_says() {
    let text = program_of("trunnion", "table", "x+", ControllerFrame::Tcp);
    assert!(text.contains("axis A must stand at 0 before the start") && !text.lines().any(|l| l == "G49"));
    // at rotary zero both frames are the same
    assert!(text.contains(" [6] [2] [60] [60]\n"));
}
