//! Which way an axis moves what it carries: the same effect on an axis of the table and on one of the head, with readings worked out
//! by hand, for the virtual machine and for the model.
//!
//! A coordinate says where the tool is over the workpiece. Head: the ball goes along with it. Table: the block goes the other way.
//! An error of the coordinate that the control reads (backlash, a lost position, scales that grow with the room) therefore acts
//! alike on both sides. An error of the position that a part reaches (`scale-x`, squareness, straightness, sag) changes its sign or
//! its size with the side. `trunnion` has X, Y and Z in the head, `swivel-head` has X and Y in the table.
//!
//! A reading is recorded less nominal along the outward normal: positive where the ball stops early.

use crate::common::{self, matched};
use axiscal::axes::{AxisName, Position};
use axiscal::diag::source;
use axiscal::machine::Machine;
use axiscal::model::catalogue::Catalogue;
use axiscal::model::data::{Run, assemble};
use axiscal::model::predict::Model;
use axiscal::program::plan::{Plan, PlanTouch};
use axiscal::simulate::{self, scenario};
use serde_json::json;

/// What is of second order is left out below: turns of 2e-5 squared times 200 mm are 8e-8.
const BY_HAND_MM: f64 = 1e-7;

/// A touch of a block of 10 mm with a ball of 3 mm.
struct Touch {
    carrier: &'static str,
    /// Centre of the block in the carrier's frame.
    centre: [f64; 3],
    normal: [f64; 3],
    c_deg: f64,
    /// B of the machine with a head, A of the trunnion.
    tilt_deg: f64,
}

impl Touch {
    fn of_c(centre: [f64; 3], normal: [f64; 3], c_deg: f64) -> Self {
        Self { carrier: "C", centre, normal, c_deg, tilt_deg: 0.0 }
    }

    fn tilted(self, tilt_deg: f64) -> Self {
        Self { tilt_deg, ..self }
    }

    fn pose(&self, machine: &Machine) -> Position {
        let mut pose = Position::default();
        if machine.axis(AxisName::C).is_some() {
            pose.set(AxisName::C, self.c_deg);
        }
        let tilting = [AxisName::A, AxisName::B].into_iter().find(|name| machine.axis(*name).is_some());
        pose.set(tilting.unwrap(), self.tilt_deg);
        pose
    }
}

fn plan(machine: &Machine, touches: &[Touch], mounting: &str) -> Plan {
    let mut blocks = Vec::new();
    let mut rows = Vec::new();
    for (i, t) in touches.iter().enumerate() {
        let along = |off: f64| -> [f64; 3] { std::array::from_fn(|k| t.centre[k] + t.normal[k] * off) };
        let name = format!("b{i}");
        blocks.push(json!({"name": name, "carrier": t.carrier, "centre": t.centre, "size": [10.0, 10.0, 10.0]}));
        let at = |off: f64| {
            let ball = nalgebra::Vector3::from(along(8.0 + off));
            let p = machine
                .linear_for_ball(machine.carrier(t.carrier).unwrap(), &t.pose(machine), &ball, machine.tool.length_mm)
                .unwrap();
            json!({"X": p.0[0], "Y": p.0[1], "Z": p.0[2]})
        };
        let mut pose = serde_json::Map::new();
        machine.rotary().for_each(|a| drop(pose.insert(a.name.to_string(), json!(t.pose(machine).get(a.name)))));
        rows.push(json!({
            "id": i + 1, "stage": "s", "repeat": 1, "carrier": t.carrier, "block": name, "face": "f", "point": along(5.0),
            "normal": t.normal, "pose": pose, "start": at(2.0), "nominal": at(0.0), "end": at(-2.0), "time_s": 10.0 * (i + 1) as f64,
        }));
    }
    serde_json::from_value(json!({
        "format": "axiscal-plan/1", "machine": machine.name, "program": "by-hand", "mounting": mounting, "ball_radius_mm": 3.0,
        "tool_length_mm": machine.tool.length_mm, "blocks": blocks, "touches": rows,
    }))
    .unwrap()
}

/// One effect on one touch: both programs against the number on paper.
fn check(machine: &Machine, touch: Touch, effect: &str, values: &[(&str, f64)], more: &str, by_hand_mm: f64) {
    check_last(machine, &[touch], effect, values, more, by_hand_mm);
}

/// The same of the last of some touches.
fn check_last(machine: &Machine, touches: &[Touch], effect: &str, values: &[(&str, f64)], more: &str, by_hand_mm: f64) {
    let plan = plan(machine, touches, "m");
    let last = plan.touches.last().unwrap();
    let values_text: String = values.iter().map(|(name, value)| format!("{name} = {value:?}\n")).collect();
    let text = format!("{more}[effects.{effect}]\n{values_text}");
    let place = format!("{effect} {values:?} on {}", machine.name);
    let scenario = scenario::parse(&source("by-hand", &text), machine).unwrap().0;
    let (raw, _) = simulate::run(machine, &plan, &scenario, None).unwrap();
    let mut log: Vec<_> = raw.iter().map(matched).collect();
    let outward = outward(machine, last);
    let off = log.last().unwrap().position.xyz_mm() - last.nominal_position().xyz_mm();
    let reading = off.dot(&outward);
    assert!(
        (reading - by_hand_mm).abs() < BY_HAND_MM,
        "virtual machine, {place}: {reading:.9}, by hand {by_hand_mm:.9}"
    );
    // the model finds no gap in a log that shows the reading by hand
    let position = &mut log.last_mut().unwrap().position;
    *position = last.nominal_position();
    for name in [AxisName::X, AxisName::Y, AxisName::Z] {
        position.set(name, position.get(name) + by_hand_mm * outward[name.index()]);
    }
    let data = assemble(machine, &[Run { plan: &plan, touches: &log, mounting: None, started_s: None }]);
    let catalogue = Catalogue::built_in().unwrap();
    let row = catalogue.get(effect, machine).unwrap();
    let model = Model::new(machine, &[row], &data.set_ups, machine.reference.pivot);
    let theta: Vec<f64> = row
        .parameters
        .iter()
        .map(|p| {
            let given = values.iter().find(|(name, _)| name.split('@').next() == Some(p.name.as_str()));
            given.map_or(p.shape.map_or(0.0, |s| s.0), |v| v.1)
        })
        .collect();
    let gap = model.gap(data.observations.last().unwrap(), &theta);
    assert!(gap.abs() < BY_HAND_MM, "model, {place}: {gap:e} mm");
}

/// The normal of the face in R: C turns it, right-handed about Z, and A of a table about X.
fn outward(machine: &Machine, touch: &PlanTouch) -> nalgebra::Vector3<f64> {
    let (s, c) = touch.pose.get(AxisName::C).unwrap_or(0.0).to_radians().sin_cos();
    let a = machine.axis(AxisName::A).and_then(|_| touch.pose.get(AxisName::A)).unwrap_or(0.0);
    let (sa, ca) = a.to_radians().sin_cos();
    let [x, y, z] = touch.normal;
    let (x, y) = (c * x - s * y, s * x + c * y);
    nalgebra::Vector3::new(x, ca * y - sa * z, sa * y + ca * z)
}

const X: [f64; 3] = [1.0, 0.0, 0.0];
const MINUS_X: [f64; 3] = [-1.0, 0.0, 0.0];
const Y: [f64; 3] = [0.0, 1.0, 0.0];
const Z: [f64; 3] = [0.0, 0.0, 1.0];

fn head() -> Machine {
    common::machine("trunnion")
}

fn table() -> Machine {
    common::machine("swivel-head")
}

/// What bears the blocks of each machine: C of the trunnion, the linear axes' table of the other.
fn on(machine: &Machine, centre: [f64; 3], normal: [f64; 3]) -> Touch {
    let carrier = if machine.name == "trunnion" { "C" } else { "table" };
    Touch { carrier, centre, normal, c_deg: 0.0, tilt_deg: 0.0 }
}

#[test]
fn what_is_written_of_a_coordinate_acts_alike_on_both_sides() {
    const WARM: &str = "[temperature]\nprofile = [[0.0, 30.0], [9.0, 30.0]]\n";
    for machine in [head(), table()] {
        // The face +X of a block at x = 92 is met by the ball's centre at x = 92 + 5 + 3 = 100. Scales that have grown by 10 K times
        // 10 ppm/K show 100 mm less a part of 1e-4 where the axis has gone 100: 100 / 1.0001 = 99.990 001 000. Met 9.998 µm early in
        // the coordinate, which is along the normal: -0.009 999 000.
        let at_100 = || on(&machine, [92.0, 0.0, -202.684], X);
        check(&machine, at_100(), "ambient-scale", &[("expansion", 10.0)], WARM, -0.009_999_000);
        let y_at_100 = on(&machine, [0.0, 92.0, -202.684], Y);
        check(&machine, y_at_100, "ambient-scale", &[("expansion", 10.0)], WARM, -0.009_999_000);
        // the same in Z, which is a head's on both machines: the top of a block 92 mm higher is met at Z = 100
        let above = on(&machine, [0.0, 0.0, -202.684 + 92.0], Z);
        check(&machine, above, "ambient-scale", &[("expansion", 10.0)], WARM, -0.009_999_000);
        // 8 µm of lost motion: the face +X is touched in the direction of -X, the axis lags by 4 µm and stands at +4 µm of what it
        // shows: met 4 µm later in the coordinate, at -0.004.
        check(&machine, at_100(), "backlash-x", &[("backlash_X", 8.0)], "", -0.004);
        // the face -X is touched in +X: it lags to -4 µm, and shows +0.004, along the normal -X: -0.004
        let minus = on(&machine, [108.0, 0.0, -202.684], MINUS_X);
        check(&machine, minus, "backlash-x", &[("backlash_X", 8.0)], "", -0.004);
    }
}

#[test]
fn what_is_written_of_a_place_depends_on_the_side() {
    let (head, table) = (head(), table());
    let at_100 = |machine: &Machine| on(machine, [92.0, 0.0, -202.684], X);
    // scale-x, dx = 100 µm/m of the coordinate 100: what X carries lies 0.010 mm towards +X of where it should. Head: the ball is
    // ahead and meets the face early, shown 100 - 0.010 (and less 1e-4 of that): 100 / 1.0001. Table: the block is ahead, the ball
    // must follow: it is met where X - 1e-4 X = 100, at 100 / 0.9999 = 100.010 001 000.
    check(&head, at_100(&head), "scale-x", &[("EXX", 100.0)], "", -0.009_999_000);
    check(&table, at_100(&table), "scale-x", &[("EXX", 100.0)], "", 0.010_001_000);
    // squareness-xy, dx = -Y * 100 µrad at Y = 50: what Y carries lies 0.005 mm towards -X. Head: the ball is behind, it meets +X
    // 0.005 later: shown further out. Table: the block has gone back, met 0.005 further in.
    let beside = |machine: &Machine| on(machine, [0.0, 50.0, -202.684], X);
    check(&head, beside(&head), "squareness-xy", &[("EC0Y", 100.0)], "", 0.005);
    check(&table, beside(&table), "squareness-xy", &[("EC0Y", 100.0)], "", -0.005);
    // straightness-zx, dz = 4 µm * (X/300)² at X = 150: what X carries is 1 µm higher. Head: the ball must go 1 µm lower. Table: the
    // block is met 1 µm higher.
    let middle = |machine: &Machine| on(machine, [150.0, 0.0, -202.684], Z);
    check(&head, middle(&head), "straightness-zx", &[("EZX2", 4.0)], "", -0.001);
    check(&table, middle(&table), "straightness-zx", &[("EZX2", 4.0)], "", 0.001);
}

/// A guideway that is bowed upwards, z = -4 µm (u/300)² at the place u of the carriage: at 150 from its middle it has sunk by 1 µm,
/// and its slope is 2 * 4 µm * 150/300² = 13.333 333 nm/mm, down to the outside.
#[test]
fn a_carriage_sinks_and_leans_outwards_on_both_sides() {
    let (head, table) = (head(), table());
    let sag = [("carriage_sag_X", 4.0), ("arm_carriage_sag_x", 0.0)];
    // Head, X = 150, u = +150. It leans about the ball: nothing goes sideways.
    check(&head, on(&head, [142.0, 0.0, -202.684], X), "carriage-sag-x", &sag, "", 0.0);
    // With the bearing 202.684 mm above the ball what hangs below it goes inwards by 202.684 * 13.333 333e-6 = 0.002 702 453, to -X.
    // The face +X is met that much later in the coordinate: +0.002 702 453.
    let above = [("carriage_sag_X", 4.0), ("arm_carriage_sag_x", 202.684)];
    check(&head, on(&head, [142.0, 0.0, -202.684], X), "carriage-sag-x", &above, "", 0.002_702_453);
    // The ball itself has sunk by 1 µm: the top is met 1 µm early, and for its distance of 8 mm from the ball's height at zero
    // (Z = 8) nothing more, because the turn moves it sideways only.
    check(&head, on(&head, [150.0, 0.0, -202.684], Z), "carriage-sag-x", &sag, "", 0.001);
    // Table, X = 150: it stands at u = -150 and has sunk by 1 µm. It leans outwards, to -X, about the ball's place at zero. The block
    // under the ball is 150 mm from there to the inside: lifted by 150 * 13.333 333e-6 = 2 µm. Together +1 µm, which is where the
    // tangent of the guideway at u = -150 passes over its middle: -1 + 2.
    check(&table, on(&table, [150.0, 0.0, -202.684], Z), "carriage-sag-x", &sag, "", 0.001);
    // Y of the table in the same way.
    let sag_y = [("carriage_sag_Y", 4.0), ("arm_carriage_sag_y", 0.0)];
    check(&table, on(&table, [0.0, 150.0, -202.684], Z), "carriage-sag-y", &sag_y, "", 0.001);
    let above_y = [("carriage_sag_Y", 4.0), ("arm_carriage_sag_y", 202.684)];
    check(&head, on(&head, [0.0, 142.0, -202.684], Y), "carriage-sag-y", &above_y, "", 0.002_702_453);
}

#[test]
fn the_new_rows_by_hand() {
    let (head, table) = (head(), table());
    // block-own-size: the edge along x of this block is 6 µm longer, its face +X 3 µm further out; another block's size says nothing
    let b0 = on(&table, [0.0, 0.0, -202.684], X);
    // (blocks of a scenario are those of the machine: the value without a block is that of every block)
    check(&table, b0, "block-own-size", &[("own_size_X", 6.0)], "", 0.003);
    // encoder-eccentricity-c at C = 0: cos = 1. The centre goes 2 µm to +Y, and the head, on the side where the ring moves along +Y,
    // takes that for 2 µm / 100 mm = 20 µrad: C is turned back by so much about its own line through (0, 0). The block at x = 50 goes
    // to -Y by 50 * 20e-6 = 0.001. Face +Y: 0.002 - 0.001. The ball touches it on the line x = 50 of the block's middle; the turn of
    // the face about itself is nothing to first order (8 * 2e-10).
    let aside = Touch::of_c([50.0, 0.0, -202.684], Y, 0.0);
    check(&table, aside, "encoder-eccentricity-c", &[("runout_YCc", 2.0)], "", 0.001);
    // on the trunnion C's line passes through the same point
    let aside = Touch::of_c([50.0, 0.0, -202.684], Y, 0.0);
    check(&head, aside, "encoder-eccentricity-c", &[("runout_YCc", 2.0)], "", 0.001);
    // windup-c: C comes from 0 to 10 degrees, in one direction. Wound up over 10 degrees it lags by half of 40 µrad times
    // (1 - 1/e) = 0.632 120 559, that is by 12.642 411 µrad. The block's face +Y, 50 mm out, is that much behind:
    // 50 * 12.642 411e-6 = 0.000 632 121 against its normal.
    let way = |to: f64| [Touch::of_c([50.0, 0.0, -202.684], Y, 0.0), Touch::of_c([50.0, 0.0, -202.684], Y, to)];
    let wound = [("windup_C", 40.0), ("windup_way_C", 10.0)];
    check_last(&table, &way(10.0), "windup-c", &wound, "", -0.000_632_121);
    // the other way round it lags to the other side
    check_last(&table, &way(-10.0), "windup-c", &wound, "", 0.000_632_121);
    // back from 10 to 5 degrees: 5 degrees since the reversal, 1 - exp(-1/2) = 0.393 469 340; 20 µrad * 50 mm * that = 0.000 393 469
    let back = [0.0, 10.0, 5.0].map(|c| Touch::of_c([50.0, 0.0, -202.684], Y, c));
    check_last(&table, &back, "windup-c", &wound, "", 0.000_393_469);
}

/// The table turns by 10 µrad about X at C = 90, where the block has gone to Y = 30.
#[test]
fn a_wobble_acts_about_its_bearing() {
    let table = table();
    let touch = |normal| Touch::of_c([30.0, 0.0, -202.684], normal, 90.0);
    // about a point at the ball's height: what is 30 mm out along +Y is lifted by 30 * 10e-6 = 0.0003, and goes nowhere else
    let level = [("EAC1s", 10.0), ("arm_tilt_c_1", 0.0)];
    check(&table, touch(Z), "tilt-c-1", &level, "", 0.0003);
    check(&table, touch(X), "tilt-c-1", &level, "", 0.0);
    // about a point 200 mm below it the block also goes 200 * 10e-6 = 0.002 to -Y; its face +X looks to +Y
    let below = [("EAC1s", 10.0), ("arm_tilt_c_1", -200.0)];
    check(&table, touch(X), "tilt-c-1", &below, "", -0.002);
    check(&table, touch(Z), "tilt-c-1", &below, "", 0.0003);
}

/// The weight of the head turns it by 10 µrad about Y at B = 90, by -10 µrad at B = -90.
#[test]
fn a_head_turns_about_its_pivot_or_with_what_carries_it() {
    let machine = table();
    let touch = |normal| on(&machine, [0.0, 0.0, -202.684], normal).tilted(-90.0);
    // At B = -90 the ball is 202.684 mm from the pivot to +X: turned by -10e-6 about Y it is 202.684 * 10e-6 = 0.002 026 84 higher,
    // and its coordinate is so much lower where it meets the upper face. Nothing goes sideways.
    let by_itself = [("EBBs", 10.0), ("arm_head_tilt", 0.0)];
    check(&machine, touch(Z), "head-tilt", &by_itself, "", -0.002_026_84);
    check(&machine, touch(X), "head-tilt", &by_itself, "", 0.0);
    // with a ram that turns about a point 200 mm above the pivot: the pivot itself goes 200 * 10e-6 = 0.002 to +X
    let with_its_ram = [("EBBs", 10.0), ("arm_head_tilt", 200.0)];
    check(&machine, touch(Z), "head-tilt", &with_its_ram, "", -0.002_026_84);
    check(&machine, touch(X), "head-tilt", &with_its_ram, "", -0.002);
}

/// The carriage of X pitches by 20 µrad at 300 mm, by 10 µrad about Y at X = 150.
#[test]
fn a_pitch_of_a_guideway_acts_on_what_its_carriage_bears() {
    let (head, table) = (head(), table());
    let top = |machine: &Machine| on(machine, [150.0, 0.0, -202.684], Z);
    let side = |machine: &Machine| on(machine, [142.0, 0.0, -202.684], X);
    // A table's carriage: about the ball's place at zero. The block is 150 mm from there to +X and sinks by 150 * 10e-6 = 0.0015. A
    // head's carriage takes that place along: the ball itself stays where it is.
    let level = [("EBX", 20.0), ("EBX_x", 0.0), ("EBX_z", 0.0)];
    check(&table, top(&table), "angular-bx", &level, "", -0.0015);
    check(&head, top(&head), "angular-bx", &level, "", 0.0);
    // about a point 180 mm below the ball: what is at the ball's height goes 180 * 10e-6 = 0.0018 to +X. EBX_x is 20e-6 * 180 mm =
    // 3.6 µm at 300 mm. The face +X of the table comes towards the ball; the head's ball is ahead of its coordinate.
    let below = [("EBX", 20.0), ("EBX_x", 3.6), ("EBX_z", 0.0)];
    check(&table, side(&table), "angular-bx", &below, "", 0.0018);
    check(&head, side(&head), "angular-bx", &below, "", -0.0018);
}

/// 40 µrad of play: an axis that is clamped at +30 degrees has fallen 20 µrad further, at -30 degrees 20 µrad the other way.
#[test]
fn a_clamped_axis_falls_to_the_side_of_its_load() {
    let (head, table) = (head(), table());
    // A of the table passes through (0, 0, -250): the upper face 50 mm beside it goes 50 * 20e-6 = 0.001 along its normal
    let block = || Touch::of_c([0.0, 50.0, -250.0], Z, 0.0);
    check(&head, block().tilted(30.0), "clamp-play-a", &[("clamp_play_A", 40.0)], "", 0.001);
    check(&head, block().tilted(-30.0), "clamp-play-a", &[("clamp_play_A", 40.0)], "", -0.001);
    check(&head, block(), "clamp-play-a", &[("clamp_play_A", 40.0)], "", 0.0);
    // B of the head at -30: the ball, at 202.684 * (sin 30, 0, -cos 30) from the pivot, turns by -20 µrad about Y, that is
    // 202.684 * 20e-6 * (cos 30, 0, sin 30) = (0.003 510 590, 0, 0.002 026 840). It is that much ahead and meets each face so much later.
    let of = |normal| on(&table, [0.0, 0.0, -202.684], normal).tilted(-30.0);
    check(&table, of(X), "clamp-play-b", &[("clamp_play_B", 40.0)], "", -0.003_510_590);
    check(&table, of(Z), "clamp-play-b", &[("clamp_play_B", 40.0)], "", -0.002_026_840);
    check(&table, of(Y), "clamp-play-b", &[("clamp_play_B", 40.0)], "", 0.0);
}

/// A probe that triggers 4 µm later where it goes to its own -x.
#[test]
fn the_pretravel_of_a_direction_turns_with_the_probe() {
    let table = table();
    let of = |normal| on(&table, [0.0, 0.0, -202.684], normal);
    let late = [("pretravel_xm", 4.0)];
    // upright, the face +X is touched in -x; -X, Y and the top are not
    check(&table, of(X), "pretravel-directions", &late, "", -0.004);
    for other in [MINUS_X, Y, Z] {
        check(&table, of(other), "pretravel-directions", &late, "", 0.0);
    }
    // at B = -90 the probe's x looks to +Z: the top is touched in its -x
    check(&table, of(Z).tilted(-90.0), "pretravel-directions", &late, "", -0.004);
    check(&table, of(X).tilted(-90.0), "pretravel-directions", &late, "", 0.0);
    // the other three likewise
    check(&table, of(MINUS_X), "pretravel-directions", &[("pretravel_xp", 4.0)], "", -0.004);
    check(&table, of(Y), "pretravel-directions", &[("pretravel_ym", 4.0)], "", -0.004);
    check(&table, of([0.0, -1.0, 0.0]), "pretravel-directions", &[("pretravel_yp", 4.0)], "", -0.004);
}

/// The control counts an axis backwards, or two for each other: the axis stands at -q where q is shown. Faces are touched along their
/// normals, close to where it makes no difference: elsewhere the ball would meet nothing.
#[test]
fn a_control_with_a_wrong_sign_or_two_swapped_axes() {
    const SWAP: &str = "sign-or-axis-swap";
    let (head, table) = (head(), table());
    for machine in [&head, &table] {
        // C: shown at 0.1, it stands at -0.1 degrees. Seen from the table the ball comes 0.2 degrees askew: in its frame at y =
        // 50 sin 0.2 + (8 + t) cos 0.2, which is 8 on the face: t = -0.174 483.
        let aside = Touch::of_c([50.0, 0.0, -202.684], Y, 0.1);
        check(machine, aside, SWAP, &[("flip_C", 1.0)], "", -0.174_484_895);
        // X: the face +X looks to (0.5, 0.866) at C = 60, and the ball at 8 mm from it would be met at X = 0.5 * 0.4 = 0.2. Its path
        // t has X = 0.2 + 0.5 t where it is shown, minus that where it is: -0.5 (0.2 + 0.5 t) + 0.75 t = 0.5 * 0.2, t = 0.4.
        let across = Touch::of_c([0.4 - 8.0, 0.0, -202.684], X, 60.0);
        check(machine, across, SWAP, &[("flip_X", 1.0)], "", 0.4);
        // X and Y for each other: would be met at (2, 3.464), 4 mm out. 0.5 (3.464 + 0.866 t) + 0.866 (2 + 0.5 t) = 4, t = 0.618 802.
        let across = Touch::of_c([4.0 - 8.0, 0.0, -202.684], X, 60.0);
        check(machine, across, SWAP, &[("swap_XY", 1.0)], "", 0.618_802_154);
        // Y: at C = 30 the face +X looks to (0.866, 0.5) and would be met at Y = 0.5 * 0.4 = 0.2: 0.75 t - 0.5 (0.2 + 0.5 t) = 0.5 * 0.2,
        // t = 0.4
        let across = Touch::of_c([0.4 - 8.0, 0.0, -202.684], X, 30.0);
        check(machine, across, SWAP, &[("flip_Y", 1.0)], "", 0.4);
        // Y and Z, of which one bears the table and the other the head of the one machine: would be met at Y = 2, Z = 0. The ball stands
        // at Y = 0: 0.866 * 0.866 t = 0.5 * 2, t = 4/3
        let across = || Touch::of_c([4.0 - 8.0, 0.0, -202.684], X, 30.0);
        check(machine, across(), SWAP, &[("swap_YZ", 1.0)], "", 4.0 / 3.0);
        // Z and X: at C = 60 would be met at X = 2, Z = 0. The ball stands at X = 0: 0.866 * 0.866 t = 0.5 * 2
        check(machine, Touch { c_deg: 60.0, ..across() }, SWAP, &[("swap_ZX", 1.0)], "", 4.0 / 3.0);
    }
    // Z alone turns only the way to a face that looks up, which is then never met: A has to tilt one (below)
    // B of the head: shown at -0.1, the ball hangs 202.684 sin 0.1 to -X in place of +X: 0.707 498 further in, met so much further out
    let tilted = on(&table, [0.0, 0.0, -202.684], X).tilted(-0.1);
    check(&table, tilted, SWAP, &[("flip_B", 1.0)], "", 0.707_500_269);
    // A of the table as C above: the upper face of a block 50 mm beside its line
    let aside = Touch::of_c([0.0, 50.0, -250.0], Z, 0.0).tilted(0.1);
    check(&head, aside, SWAP, &[("flip_A", 1.0)], "", -0.174_484_895);
    // Y: the upper face looks to (0, -0.5, 0.866) at A = 30 and would be met 0.8 mm from the line, at Y = -0.4:
    // -0.5 (0.4 + 0.5 t) + 0.866 * 0.866 t = -0.5 * -0.4, t = 0.8
    let upper = Touch::of_c([0.0, 0.0, -250.0 + 0.8 - 8.0], Z, 0.0).tilted(30.0);
    check(&head, upper, SWAP, &[("flip_Y", 1.0)], "", 0.8);
    // Z: it looks to (0, -0.866, 0.5) at A = 60 and would be met at Z = 0.2, 47.516 mm above the line of A:
    // -0.5 (0.2 + 0.5 t) + 0.75 t = 0.5 * 0.2, t = 0.4
    let upper = Touch::of_c([0.0, 0.0, -250.0 + 2.0 * 47.516 - 8.0], Z, 0.0).tilted(60.0);
    check(&head, upper, SWAP, &[("flip_Z", 1.0)], "", 0.4);
    // Y and Z: the face looks to (0, 0.866, 0.5) at A = -60 and would be met at Y = 0.5, Z = 0, which is 47.316 above the line:
    // 0.866 * 0.5 t + 0.5 (0.5 + 0.866 t) = 0.866 * 0.5, t = 0.211 325
    let upper = Touch::of_c([0.0, -40.726_857_989, -233.908_987_298], Z, 0.0).tilted(-60.0);
    check(&head, upper, SWAP, &[("swap_YZ", 1.0)], "", 0.211_324_865);
    // Z and X: at A = 90, C = 60 the face +X looks to (0.5, 0, 0.866) and would be met at X = 0, Z = 0.5, 47.816 above the line
    let side = Touch::of_c([33.409_870_695, 23.908, -250.0], X, 60.0).tilted(90.0);
    check(&head, side, SWAP, &[("swap_ZX", 1.0)], "", 0.211_324_865);
}

/// An axis loses its position by +10 µm, C by +40 µrad, 3.6 s after the first touch; the second comes after 10 s.
#[test]
fn an_axis_is_elsewhere_from_some_moment_on() {
    for machine in [table(), head()] {
        let face = || Touch::of_c([50.0, 0.0, -202.684], X, 0.0);
        let x = [("lost_X", 10.0), ("lost_h_X", 0.001)];
        // before it nothing has happened
        check(&machine, face(), "lost-position-x", &x, "", 0.0);
        // then the ball is 10 µm further over +X than X says, on either side of the chain, and meets the face at a smaller X
        check_last(&machine, &[face(), face()], "lost-position-x", &x, "", -0.010);
        // a face that looks along Y does not see it
        let aside = || Touch::of_c([50.0, 0.0, -202.684], Y, 0.0);
        check_last(&machine, &[aside(), aside()], "lost-position-x", &x, "", 0.0);
        // C carries the face +Y, 50 mm out, on by 50 * 40e-6 = 0.002, towards the ball
        let c = [("lost_C", 40.0), ("lost_h_C", 0.001)];
        check(&machine, aside(), "lost-position-c", &c, "", 0.0);
        check_last(&machine, &[aside(), aside()], "lost-position-c", &c, "", 0.002);
    }
}

/// C was homed again before the second run, 1 mrad further: the first run is as it was; in the second the face +Y of a block 50 mm
/// out has gone on by 50 * tan(1 mrad) = 0.050 000 017, and its plane, 8 mm from the line through C, is met 8 * 5e-7 further out.
#[test]
fn a_later_run_has_a_zero_of_its_own() {
    let machine = table();
    let plan = plan(&machine, &[Touch::of_c([50.0, 0.0, -202.684], Y, 0.0)], "m");
    let catalogue = Catalogue::built_in().unwrap();
    let row = catalogue.get("rehomed-c", &machine).unwrap();
    let at = |off: f64| {
        let mut position = plan.touches[0].nominal_position();
        position.set(AxisName::Y, position.get(AxisName::Y) + off);
        let raw = simulate::run(&machine, &plan, &simulate::Scenario::flawless(), None).unwrap().0;
        let mut touch = matched(&raw[0]);
        touch.position = position;
        vec![touch]
    };
    let (first, second) = (at(0.0), at(0.050_004_017));
    let run = |touches| Run { plan: &plan, touches, mounting: Some("m"), started_s: Some(0.0) };
    let data = assemble(&machine, &[run(&first), run(&second)]);
    let model = Model::new(&machine, &[row], &data.set_ups, machine.reference.pivot);
    assert_eq!(model.unknowns.len(), 1);
    assert_eq!(model.unknowns[0].name, "rehomed_C@run2");
    let mrad_in_deg = [1e-3_f64.to_degrees()];
    for o in &data.observations {
        let gap = model.gap(o, &mrad_in_deg);
        assert!(gap.abs() < BY_HAND_MM, "run {}: {gap:e}", o.run);
    }
    // the virtual machine plants it in the run of its scenario
    let text = "[effects.rehomed-c]\nrehomed_C = { value = 1.0, unit = \"mrad\" }\n";
    let scenario = scenario::parse(&source("by-hand", text), &machine).unwrap().0;
    let made = matched(&simulate::run(&machine, &plan, &scenario, None).unwrap().0[0]);
    let reading = made.position.get(AxisName::Y) - plan.touches[0].nominal_position().get(AxisName::Y);
    assert!((reading - 0.050_004_017).abs() < BY_HAND_MM, "{reading}");
    // in a study of one run it has no parameter
    let alone = assemble(&machine, &[run(&first)]);
    assert_eq!(Model::new(&machine, &[row], &alone.set_ups, machine.reference.pivot).unknowns.len(), 0);
}
