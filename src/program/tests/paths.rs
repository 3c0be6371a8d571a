//! The proof of a path: clean for what is generated, and blind to nothing that is broken in it by hand.

use super::{built_in, machine_of};
use crate::axes::{AxisMap, AxisName};
use crate::diag::source;
use crate::machine::BUILT_IN;
use crate::program::path::{Path, Step};
use crate::program::{Generated, Options, Violation, generate, load, verify};

/// What the proof says about the head program after a change.
fn after(change: impl FnOnce(&mut Vec<Step>)) -> Vec<Violation> {
    let (machine, mut g) = built_in("swivel-head", "head");
    change(&mut g.path.steps);
    verify(&machine, &g.plan, &g.path).unwrap()
}

fn place(steps: &[Step], n: usize, what: impl Fn(&Step) -> bool) -> usize {
    steps.iter().enumerate().filter(|(_, s)| what(s)).nth(n).map(|(i, _)| i).unwrap()
}

fn says(violations: &[Violation], words: &str) {
    assert!(violations.iter().any(|v| v.says.contains(words)), "{words:?} not in {violations:?}");
}

#[test]
fn unchanged_it_is_clean() {
    assert_eq!(after(|_| {}), []);
}

#[test]
fn a_retract_that_is_missing() {
    says(
        &after(|s| {
            let i = place(s, 20, |s| matches!(s, Step::Retract { .. }));
            s.remove(i);
        }),
        "retract must come first",
    );
}

#[test]
fn a_retract_to_the_wrong_side() {
    says(
        &after(|s| {
            let i = place(s, 20, |s| matches!(s, Step::Retract { .. }));
            if let Step::Retract { to, .. } = &mut s[i] {
                to.set(AxisName::X, -to.get(AxisName::X).unwrap());
            }
        }),
        "does not end at the touch's start",
    );
}

/// By sampling and plain arithmetic, for B = 0 alone: does the ball come too near to a block between two steps?
fn ball_meets_a_block(steps: &[Step], range: std::ops::Range<usize>) -> bool {
    let mut at = AxisMap::default();
    let mut meets = false;
    for (i, step) in steps.iter().enumerate().take(range.end) {
        let (to, room) = match step {
            Step::Rapid { to } => (to, 1.3),
            Step::Protected { to, .. } | Step::Retract { to, .. } => (to, 0.3),
            _ => continue,
        };
        let end = to.or(&at);
        if range.contains(&i) {
            let (a, b) = (at.position().xyz_mm(), end.position().xyz_mm());
            for k in 0..=1000 {
                let ball = a + (b - a) * (f64::from(k) / 1000.0);
                for centre in [(-30.0, 0.0), (30.0, 0.0), (0.0, -30.0), (0.0, 30.0)] {
                    // NC coordinates at B = 0: the tool over the workpiece, Z = 0 with the ball at the blocks' height
                    let off = [ball.x - centre.0, ball.y - centre.1, ball.z].map(|d| (d.abs() - 5.0).max(0.0));
                    meets |= off.iter().map(|d| d * d).sum::<f64>().sqrt() < 3.0 + room - 1e-6;
                }
            }
        }
        at = end;
    }
    meets
}

#[test]
fn a_way_across_that_runs_lower_is_caught_exactly_where_the_ball_would_come_too_near() {
    let (machine, g) = built_in("swivel-head", "head");
    let (mut caught, mut free) = (0, 0);
    let end = place(&g.path.steps, 0, |s| matches!(s, Step::Setup { number: 2, .. }));
    for i in 12..end {
        // the way up before the way across
        let (Step::Protected { to, .. }, Some(Step::Rapid { .. })) = (&g.path.steps[i], g.path.steps.get(i + 1)) else {
            continue;
        };
        let z = to.get(AxisName::Z).unwrap();
        let mut path = g.path.clone();
        if let Step::Protected { to, .. } = &mut path.steps[i] {
            to.set(AxisName::Z, z - 10.0);
        }
        let next = (i..).find(|&k| matches!(path.steps[k], Step::Touch(_) | Step::Setup { .. })).unwrap();
        let found = !verify(&machine, &g.plan, &path).unwrap().is_empty();
        assert_eq!(found, ball_meets_a_block(&path.steps, i..next), "step {i}");
        if found {
            caught += 1;
        } else {
            free += 1;
        }
    }
    // beside one face the ball may run low: the points of a side face lie in one free plane
    assert!(caught > 60 && free > 10, "{caught} {free}");
}

#[test]
fn a_rapid_into_the_blocks() {
    says(
        &after(|s| {
            let i = place(s, 3, |s| matches!(s, Step::Rapid { .. }));
            s[i] = Step::Rapid { to: AxisMap::default().with(AxisName::Z, -10.0) };
        }),
        "would hit",
    );
}

#[test]
fn a_rapid_of_two_axes_whose_box_is_not_clear() {
    says(
        &after(|s| {
            let i = place(s, 2, |s| matches!(s, Step::Rapid { .. }));
            s[i] = Step::Rapid { to: AxisMap::xyz(30.0, 30.0, 5.0) };
        }),
        "one axis moves at a time",
    );
    // high over everything the same is clear
    let found = after(|s| {
        let i = place(s, 0, |s| matches!(s, Step::Setup { number: 2, .. }));
        let (x, y) = (AxisMap::default().with(AxisName::X, 100.0), AxisName::Y);
        s.insert(i, Step::Rapid { to: x.with(y, 100.0) });
    });
    assert!(!found.iter().any(|v| v.says.contains("box")), "{found:?}");
}

#[test]
fn a_turn_in_the_wrong_sense() {
    says(
        &after(|s| {
            let i = place(s, 4, |s| matches!(s, Step::Rotary { .. }));
            if let Step::Rotary { sense, to } = &mut s[i] {
                let axis = to.iter().next().unwrap().0;
                sense.set(axis, -sense.get(axis).unwrap());
            }
        }),
        "its sense says",
    );
}

#[test]
fn a_turn_low_over_the_blocks() {
    says(
        &after(|s| {
            let i = place(s, 0, |s| matches!(s, Step::Setup { number: 3, .. }));
            // the ball stays at its last start instead of going up
            let up = (0..i).rev().find(|&k| matches!(s[k], Step::Retract { .. })).unwrap();
            s.drain(up + 1..i);
        }),
        "would",
    );
}

#[test]
fn a_turn_before_the_probe_is_up() {
    says(
        &after(|s| {
            s.remove(place(s, 0, |s| matches!(s, Step::Rapid { .. })));
        }),
        "not proven clear",
    );
}

#[test]
fn a_touch_that_is_left_out_or_made_elsewhere() {
    says(
        &after(|s| {
            let i = place(s, 7, |s| matches!(s, Step::Touch(_)));
            s.drain(i..i + 2);
        }),
        "comes where the plan has touch 8",
    );
    says(
        &after(|s| {
            let i = place(s, 7, |s| matches!(s, Step::Touch(_)));
            if let Step::Touch(t) = &mut s[i] {
                t.end.set(AxisName::Z, t.end.get(AxisName::Z).unwrap() - 5.0);
            }
        }),
        "past its overtravel",
    );
}

#[test]
fn a_fast_first_touch() {
    says(
        &after(|s| {
            let i = place(s, 0, |s| matches!(s, Step::Touch(_)));
            if let Step::Touch(t) = &mut s[i] {
                t.search_feed = 300.0;
            }
        }),
        "must search slowly",
    );
}

#[test]
fn a_place_outside_the_range() {
    says(
        &after(|s| {
            let i = place(s, 5, |s| matches!(s, Step::Rapid { .. }));
            s[i] = Step::Rapid { to: AxisMap::default().with(AxisName::X, 500.0) };
        }),
        "outside the range",
    );
}

#[test]
fn a_path_that_ends_in_contact() {
    says(
        &after(|s| {
            let i = place(s, 201, |s| matches!(s, Step::Touch(_)));
            s.truncate(i + 1);
        }),
        "ends with the ball at a block",
    );
}

#[test]
fn rapids_move_one_axis_and_each_turn_has_its_sense() {
    for (machine, program) in
        [("swivel-head", "head"), ("swivel-head", "table"), ("double-head", "double-head"), ("nutating-b", "basic")]
    {
        let (_, g) = built_in(machine, program);
        let first_touch = place(&g.path.steps, 0, |s| matches!(s, Step::Touch(_)));
        for (i, step) in g.path.steps.iter().enumerate() {
            match step {
                Step::Rapid { to } => assert_eq!(to.iter().count(), 1),
                Step::Rotary { to, sense } => assert!(to.iter().count() == 1 && (i < first_touch || !sense.is_empty())),
                Step::Protected { to, .. } => assert_eq!(to.iter().count(), 1),
                _ => {}
            }
        }
    }
}

#[test]
fn the_first_touch_of_each_block_is_slow_and_the_plan_says_so() {
    let (_, g) = built_in("swivel-head", "head");
    let first: Vec<(u64, &str)> = g.plan.touches.iter().filter(|t| t.first).map(|t| (t.id, t.block.as_str())).collect();
    assert_eq!(first, [(1, "x-"), (29, "x+"), (57, "y-"), (85, "y+")]);
}

#[test]
fn touches_stand_where_the_format_shows_them() {
    let (_, g) = built_in("swivel-head", "head");
    let t = &g.plan.touches[0];
    assert_eq!((t.point, t.normal, t.face.as_str()), ([-33.0, -3.0, -197.684], [0.0, 0.0, 1.0], "+Z"));
    assert_eq!(t.start, AxisMap::xyz(-33.0, -3.0, 10.0));
    assert_eq!(t.nominal, AxisMap::xyz(-33.0, -3.0, 8.0));
    assert_eq!(t.end, AxisMap::xyz(-33.0, -3.0, 6.0));
    assert_eq!(t.pose, AxisMap::default().with(AxisName::B, 0.0).with(AxisName::C, 0.0));
    assert_eq!(t.from, AxisMap::default().with(AxisName::B, 1.0).with(AxisName::C, 1.0));
}

#[test]
fn identical_input_gives_identical_bytes() {
    let [a, b] = [0, 1].map(|_| built_in("swivel-head", "table").1);
    assert_eq!(a.plan.to_json(), b.plan.to_json());
    assert_eq!(format!("{:?}", a.path), format!("{:?}", b.path));
}

#[test]
fn a_block_that_hides_the_end_of_a_search_shortens_it() {
    // at B = -90 the stem runs 1.5 mm over block x- when the ball touches the upper face of block x+
    let (_, g) = generated("pose = { B = -90.0 }\nblocks = [\"x+\"]\ntouch = [{ faces = [\"+Z\"], grid = \"G\" }]");
    let t = &g.plan.touches[0];
    let past = t.nominal.get(AxisName::Z).unwrap() - t.end.get(AxisName::Z).unwrap();
    assert!((1.1..1.3).contains(&past), "{past}");
}

#[test]
fn an_axis_comes_to_the_pose_in_the_sense_that_is_asked_for() {
    let (_, g) = generated(
        "pose = { B = [0.0, -30.0] }\nfrom = { B = 1 }\nspindle_deg = 90.0\nfeed = 30.0\nrepeats = 2\n\
         blocks = [\"x+\"]\ntouch = [{ faces = [\"+Z\"], grid = \"G\" }]",
    );
    let turns: Vec<(f64, Option<f64>)> = g
        .path
        .steps
        .iter()
        .filter_map(|s| match s {
            Step::Rotary { to, sense } => to.get(AxisName::B).map(|b| (b, sense.get(AxisName::B))),
            _ => None,
        })
        .collect();
    // past it and back: the natural way from 0 to -30 falls
    assert_eq!(turns, [(-5.0, None), (0.0, Some(1.0)), (-35.0, Some(-1.0)), (-30.0, Some(1.0))]);
    let t: Vec<_> = g.plan.touches.iter().map(|t| (t.repeat, t.visit, t.from.get(AxisName::B))).collect();
    assert_eq!(t, [(1, Some(1), Some(1.0)), (2, Some(1), Some(1.0)), (1, Some(2), Some(1.0)), (2, Some(2), Some(1.0))]);
    assert!(g.plan.touches.iter().all(|t| t.spindle_deg == Some(90.0) && t.feed_mm_min == Some(30.0)));
    assert_eq!(g.path.steps.iter().filter(|s| matches!(s, Step::OrientSpindle { deg: 90.0 })).count(), 2);
}

#[test]
fn every_set_up_of_the_built_in_programs_can_be_taken_up_again() {
    for (machine, program) in [
        ("swivel-head", "head"),
        ("swivel-head", "table"),
        ("double-head", "double-head"),
        ("trunnion", "basic"),
        ("swivel-table-b", "basic"),
        ("nutating-b", "basic"),
        ("trunnion-offset", "basic"),
    ] {
        let (_, g) = built_in(machine, program);
        assert!(g.path.steps.iter().all(|s| !matches!(s, Step::Setup { resume: None, .. })), "{machine} {program}");
    }
    // a way that is not the proven one is caught
    says(
        &after(|s| {
            let i = place(s, 2, |s| matches!(s, Step::Setup { .. }));
            if let Step::Setup { resume: Some(moves), .. } = &mut s[i] {
                moves.pop();
            }
        }),
        "does not end where the set-up begins",
    );
    // and so is a gap: begun at that number, the program would enter the next set-up without a way there
    says(
        &after(|s| {
            let i = place(s, 2, |s| matches!(s, Step::Setup { .. }));
            if let Step::Setup { number, .. } = &mut s[i] {
                *number += 1;
            }
        }),
        "set-up 3 of the program has the number 4",
    );
}

/// A program of one set-up on the swivel head's bridge.
fn generated(setup: &str) -> (Path, Generated) {
    let machine = machine_of(BUILT_IN, "swivel-head");
    let text = format!(
        "format = \"axiscal-programs/1\"\nname = \"p\"\nmounting = \"head\"\n[[grid]]\nname = \"G\"\nu = [0.0]\nv = [0.0]\n\
         [[stage]]\nname = \"s\"\n[[stage.setup]]\n{setup}\n"
    );
    let (spec, _) = load(&source("p.toml", text)).unwrap();
    let (g, _) = generate(&machine, &spec, &Options::default()).unwrap();
    (g.path.clone(), g)
}
