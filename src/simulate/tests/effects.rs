//! Planted effects against what each is by hand, to second order.
#![allow(clippy::type_complexity)] // tables of cases

use super::*;
use crate::units::{mm_from_um, rad_from_deg};

/// Errors are some 1e-4 of the lengths: what is left out is a millionth of a millimetre.
const SECOND_ORDER: f64 = 2e-6;

/// Readings of three faces (+x, -y, +z of a block) at a pose, with a scenario of one effect.
fn three_faces(machine: &Machine, mounting: &str, block: &str, at: AxisMap, scenario: &Scenario) -> [f64; 3] {
    let mut plan = empty_plan(machine, mounting);
    let centre = plan.blocks.iter().find(|b| b.name == block).unwrap().centre;
    for n in [[1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, 1.0]] {
        add_touch(&mut plan, machine, block, plus(centre, 5.0, n), n, at);
    }
    let e = readings(machine, &plan, scenario, None);
    [e[0], e[1], e[2]]
}

fn expect(found: [f64; 3], expected: [f64; 3], within: f64) {
    for i in 0..3 {
        close(found[i], expected[i], within);
    }
}

#[test]
fn offsets_of_a_head_axis_turn_with_it_and_its_tilts_do_not() {
    let machine = machine_named("swivel-head");
    let b = -35.0;
    let (s, c) = rad_from_deg(b).sin_cos();
    let at = pose(&[(AxisName::B, b), (AxisName::C, 0.0)]);
    let plant = |values: &[(&str, f64)]| Scenario::flawless().with(&machine, "location-b", values).unwrap();
    // ball displaced by Ry(B)·(x, 0, z); a fixed block reads minus that along its normal
    let found = three_faces(&machine, "head", "x+", at, &plant(&[("EX0B", 0.02), ("EZ0B", -0.03)]));
    let (dx, dz) = (c * 0.02 + s * -0.03, -s * 0.02 + c * -0.03);
    expect(found, [-dx, 0.0, -dz], 1e-12);
    let (a, g) = (rad_from_deg(0.01), rad_from_deg(-0.02));
    let found = three_faces(&machine, "head", "x+", at, &plant(&[("EA0B", 0.01), ("EC0B", -0.02)]));
    let q = [-L * s, 0.0, -L * c];
    let d = cross([a, 0.0, g], q);
    expect(found, [-d[0], d[1], -d[2]], 2e-5);
}

#[test]
fn a_trunnion_moves_its_blocks_by_the_errors_of_both_axes() {
    let machine = machine_named("trunnion");
    let (a, c) = (-40.0, 70.0);
    let ((sa, ca), (sc, cc)) = (rad_from_deg(a).sin_cos(), rad_from_deg(c).sin_cos());
    let at = pose(&[(AxisName::A, a), (AxisName::C, c)]);
    let scenario = Scenario::flawless()
        .with(&machine, "location-a", &[("EY0A", 0.02), ("EZ0A", -0.01), ("EB0A", 0.004), ("EC0A", -0.006)])
        .and_then(|s| {
            s.with(&machine, "location-c", &[("EX0C", 0.015), ("EY0C", 0.025), ("EA0C", 0.005), ("EB0C", 0.003)])
        })
        .unwrap();
    let rx = |v: Vec3| [v[0], ca * v[1] - sa * v[2], sa * v[1] + ca * v[2]];
    let rz = |v: Vec3| [cc * v[0] - sc * v[1], sc * v[0] + cc * v[1], v[2]];
    let deg = |v: Vec3| v.map(rad_from_deg);
    let mut expected = [0.0; 3];
    let centre = machine.mounting("table").unwrap().blocks.iter().find(|b| b.name == "y+").unwrap().centre;
    for (i, n) in [[1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, 1.0]].into_iter().enumerate() {
        // arms from the reference point (the pivot)
        let arm = rz(minus(plus([centre.x, centre.y, centre.z], 5.0, n), [0.0, 0.0, -250.0]));
        let of_c = plus([0.015, 0.025, 0.0], 1.0, cross(deg([0.005, 0.003, 0.0]), arm));
        let of_a = plus([0.0, 0.02, -0.01], 1.0, cross(deg([0.0, 0.004, -0.006]), rx(arm)));
        let moved = plus(rx(of_c), 1.0, of_a);
        expected[i] = dot(rx(rz(n)), moved);
    }
    expect(three_faces(&machine, "table", "y+", at, &scenario), expected, 1e-5);
}

/// An effect on the paper's machine, at B and C, against three readings in micrometres.
fn on_the_paper_machine(effect: &str, values: &[(&str, f64)], (b, c): (f64, f64), on: &str, expected_um: [f64; 3]) {
    let machine = machine_named("swivel-head");
    let scenario = Scenario::flawless().with(&machine, effect, values).unwrap();
    let at = pose(&[(AxisName::B, b), (AxisName::C, c)]);
    let found = three_faces(&machine, on, "x+", at, &scenario);
    for i in 0..3 {
        let e = mm_from_um(expected_um[i]);
        assert!((found[i] - e).abs() < SECOND_ORDER, "{effect}: {found:?} mm, expected {expected_um:?} um");
    }
}

#[test]
fn harmonics_of_the_turntable_stand_still_while_it_turns() {
    // C = 90: block at +Y, its +x face looks to +Y, its -y face to +X
    on_the_paper_machine("radial-c-1", &[("EXC1c", 4.9), ("EXC1s", 2.0)], (0.0, 90.0), "table", [0.0, 2.0, 0.0]);
    on_the_paper_machine("radial-c-2", &[("EYC2c", 5.0)], (0.0, 90.0), "table", [-5.0, 0.0, 0.0]);
    on_the_paper_machine("axial-c-3", &[("EZC3s", 5.0)], (0.0, 90.0), "table", [0.0, 0.0, -5.0]);
    // 100 µrad about machine X lift what stands 30 mm out along +Y; the block stands at the height where the lean is stated
    on_the_paper_machine("tilt-c-1", &[("EAC1s", 100.0)], (0.0, 90.0), "table", [0.0, 0.0, 3.0]);
    // about a point 200 mm below it the block also goes 200 mm · 100 µrad = 0.02 mm towards -Y, away from where its +x face looks;
    // the ball then meets its upper face 0.02 mm further out: (30 + 0.02) mm · 100 µrad
    let below = [("EAC1s", 100.0), ("arm_tilt_c_1", -200.0)];
    on_the_paper_machine("tilt-c-1", &below, (0.0, 90.0), "table", [-20.0, 0.0, 3.002]);
    // about its own axis: the tangential face, 30 mm out
    on_the_paper_machine("positioning-c-2", &[("ECC2c", 100.0)], (0.0, 0.0), "table", [0.0, -3.0, 0.0]);
}

#[test]
fn harmonics_of_the_head_move_the_ball() {
    on_the_paper_machine("radial-b-1", &[("EZB1s", 5.0)], (-90.0, 0.0), "head", [0.0, 0.0, 5.0]);
    on_the_paper_machine("axial-b-1", &[("EYB1c", 5.0)], (0.0, 0.0), "head", [0.0, 5.0, 0.0]);
    let arm_um = mm_from_um(L) * 100.0;
    on_the_paper_machine("positioning-b-1", &[("EBB1c", 100.0)], (0.0, 0.0), "head", [arm_um, 0.0, 0.0]);
    let quarter = -std::f64::consts::FRAC_PI_2;
    on_the_paper_machine(
        "positioning-b-linear",
        &[("EBB", 50.0)],
        (-90.0, 0.0),
        "head",
        [0.0, 0.0, arm_um / 2.0 * quarter],
    );
    on_the_paper_machine("head-tilt", &[("EBBs", 100.0)], (-90.0, 0.0), "head", [0.0, 0.0, -arm_um]);
    // -100 µrad about Y through a point 200 mm above the pivot: what hangs 200 mm below that point goes 20 µm to +X
    let above = [("EBBs", 100.0), ("arm_head_tilt", 200.0)];
    on_the_paper_machine("head-tilt", &above, (-90.0, 0.0), "head", [-20.0, 0.0, -arm_um]);
    on_the_paper_machine("head-sag", &[("head_sag", 5.0)], (-30.0, 0.0), "head", [0.0, 0.0, 2.5]);
}

#[test]
fn linear_axes_move_what_they_carry() {
    let machine = machine_named("swivel-head");
    // at B = 0 on the head's block x+: X = 38 on its +x face and 30 on the others, Y = -8 on its -y face
    on_the_paper_machine("scale-x", &[("EXX", 100.0)], (0.0, 0.0), "head", [3.8, 0.0, 0.0]);
    on_the_paper_machine("scale-z", &[("EZZ", 100.0)], (0.0, 0.0), "head", [0.0, 0.0, -0.8]);
    on_the_paper_machine(
        "positioning-x-2",
        &[("EXX2", 100.0)],
        (0.0, 0.0),
        "head",
        [100.0 * (38.0_f64 / 300.0).powi(2), 0.0, 0.0],
    );
    on_the_paper_machine("squareness-xy", &[("EC0Y", 1000.0)], (0.0, 0.0), "head", [0.0; 3]);
    // B = -90: X = 30 - 202.684, Z = -202.684 + 8 on top
    let x = 30.0 - L;
    on_the_paper_machine(
        "straightness-zx",
        &[("EZX2", 100.0)],
        (-90.0, 0.0),
        "head",
        [0.0, 0.0, 100.0 * (x / 300.0).powi(2)],
    );
    on_the_paper_machine(
        "straightness-zx",
        &[("EZX3", 100.0)],
        (-90.0, 0.0),
        "head",
        [0.0, 0.0, 100.0 * (x / 300.0).powi(3)],
    );
    let z = -L + 5.0 + 3.0;
    on_the_paper_machine("squareness-zx", &[("EB0Z", 10.0)], (-90.0, 0.0), "head", [-10.0 * mm_from_um(-L), 0.0, 0.0]);
    on_the_paper_machine("squareness-yz", &[("EA0Z", 10.0)], (-90.0, 0.0), "head", [0.0, -10.0 * mm_from_um(-L), 0.0]);
    on_the_paper_machine("scale-z", &[("EZZ", 10.0)], (-90.0, 0.0), "head", [0.0, 0.0, -10.0 * mm_from_um(z)]);
    on_the_paper_machine(
        "pitch-x",
        &[("EXXs", 5.0), ("pitch", 8.0)],
        (0.0, 0.0),
        "head",
        [5.0 * (38.0 * std::f64::consts::TAU / 8.0).sin(), 0.0, 0.0],
    );
    // lever arms count in the carriage's frame from the ball's point: the block stands 30 mm out at its height
    on_the_paper_machine("angular-bx", &[("EBX", 300.0)], (0.0, 0.0), "head", [0.0, 0.0, -0.9]);
    let scenario = Scenario::flawless().with(&machine, "table-sag", &[("table_sag", 100.0)]).unwrap();
    let found = three_faces(&machine, "head", "y+", pose(&[(AxisName::B, 0.0), (AxisName::C, 0.0)]), &scenario);
    close(found[2], -mm_from_um(100.0 * (30.0_f64 / 300.0).powi(2)), SECOND_ORDER);
}

#[test]
fn lost_motion_lets_blocks_look_thinner() {
    // every face is met half the lost motion late
    on_the_paper_machine("backlash-x", &[("backlash", 4.0)], (0.0, 0.0), "head", [-2.0, 0.0, 0.0]);
    on_the_paper_machine("backlash-y", &[("b_Y", 4.0)], (0.0, 0.0), "head", [0.0, -2.0, 0.0]);
    on_the_paper_machine("backlash-z", &[("backlash", 4.0)], (0.0, 0.0), "head", [0.0, 0.0, -2.0]);
    let machine = machine_named("swivel-head");
    let scenario = Scenario::flawless().with(&machine, "backlash-c", &[("backlash", 200.0)]).unwrap();
    let mut plan = empty_plan(&machine, "table");
    let at = pose(&[(AxisName::B, 0.0), (AxisName::C, 0.0)]);
    for sense in [1.0, -1.0] {
        add_touch(&mut plan, &machine, "x+", [30.0, -5.0, -202.0], [0.0, -1.0, 0.0], at);
        plan.touches.last_mut().unwrap().from = AxisMap::default().with(AxisName::C, sense);
    }
    let e = readings(&machine, &plan, &scenario, None);
    // the table lags by 100 µrad: coming from below, the face 30 mm out stays 3 µm towards -y, outward
    close(e[0], mm_from_um(3.0), SECOND_ORDER);
    close(e[1], -mm_from_um(3.0), SECOND_ORDER);
}

#[test]
fn the_probe_triggers_as_its_seats_and_its_tip_say() {
    on_the_paper_machine("pretravel-axial", &[("k", 4.0)], (0.0, 0.0), "head", [0.0, 0.0, -4.0]);
    on_the_paper_machine("pretravel-axial", &[("k", 4.0)], (-90.0, 0.0), "head", [-4.0, 0.0, 0.0]);
    // +x face: approach -x, φ = 180°; -y face: φ = 90°
    on_the_paper_machine("lobing-3", &[("lobing3c", 5.0)], (0.0, 0.0), "head", [5.0, 0.0, 0.0]);
    on_the_paper_machine("lobing-3", &[("lobing3s", 5.0)], (0.0, 0.0), "head", [0.0, 5.0, 0.0]);
    on_the_paper_machine("lobing-2", &[("lobing2c", 5.0)], (0.0, 0.0), "head", [-5.0, 5.0, 0.0]);
    on_the_paper_machine("tip-eccentricity", &[("ex", 5.0), ("ey", 3.0)], (0.0, 0.0), "head", [-5.0, 3.0, 0.0]);
    on_the_paper_machine("tool-length", &[("tool_length", 0.01)], (-90.0, 0.0), "head", [-10.0, 0.0, 0.0]);
    // the stylus hangs down by 5 µm when it lies flat: Ry(-90)·(5 sin B, 0, 0) = (0, 0, -5)
    on_the_paper_machine("stylus-sag", &[("stylus_sag", 5.0)], (-90.0, 0.0), "head", [0.0, 0.0, 5.0]);
    // 1 ms at 60 mm/min is 1 µm
    on_the_paper_machine("latency", &[("latency", 2.0)], (0.0, 0.0), "head", [-2.0, -2.0, -2.0]);
}

#[test]
fn tip_and_lobing_turn_with_the_spindle() {
    let machine = machine_named("swivel-head");
    let scenario = Scenario::flawless()
        .with(&machine, "tip-eccentricity", &[("ex", 5.0)])
        .and_then(|s| s.with(&machine, "lobing-3", &[("lobing3c", 2.0)]))
        .unwrap();
    let mut plan = empty_plan(&machine, "head");
    let at = pose(&[(AxisName::B, 0.0), (AxisName::C, 0.0)]);
    add_touch(&mut plan, &machine, "x+", [35.0, 0.0, -203.0], [1.0, 0.0, 0.0], at);
    for spindle in [0.0, 180.0, 60.0] {
        plan.touches[0].spindle_deg = Some(spindle);
        let e = readings(&machine, &plan, &scenario, None)[0];
        let turned = rad_from_deg(180.0 - spindle);
        close(e, -mm_from_um(5.0 * rad_from_deg(spindle).cos() + 2.0 * (3.0 * turned).cos()), SECOND_ORDER);
    }
}

#[test]
fn blocks_have_their_sizes() {
    on_the_paper_machine("block-size", &[("sX", 4.0), ("sZ", 2.0)], (0.0, 0.0), "head", [2.0, 0.0, 1.0]);
    on_the_paper_machine("block-shape", &[("dXY", 4.0)], (0.0, 0.0), "head", [2.0, -2.0, 0.0]);
    on_the_paper_machine("block-slip", &[("dx", 4.0), ("from_touch", 2.0)], (0.0, 0.0), "head", [0.0; 3]);
    on_the_paper_machine("block-slip", &[("dx", 4.0), ("from_touch", 1.0)], (0.0, 0.0), "head", [4.0, 0.0, 0.0]);
    on_the_paper_machine("table-load", &[("load_b", 100.0)], (0.0, 0.0), "table", [-20.2684, 0.0, -3.0]);
}

#[test]
fn time_and_temperature_move_things() {
    let machine = machine_named("swivel-head");
    let mut plan = empty_plan(&machine, "head");
    let at = pose(&[(AxisName::B, 0.0), (AxisName::C, 0.0)]);
    for hour in 0..3 {
        add_touch(&mut plan, &machine, "x+", [35.0, 0.0, -202.684], [1.0, 0.0, 0.0], at);
        plan.touches.last_mut().unwrap().time_s = Some(100.0 + 3600.0 * f64::from(hour));
    }
    let tries: [(&str, &[(&str, f64)], [f64; 3]); 7] = [
        ("drift-linear", &[("vx", 5.0)], [0.0, -5.0, -10.0]),
        (
            "warm-up",
            &[("wx", 5.0), ("tau", 1.0)],
            [0.0, -5.0 * (1.0 - (-1.0_f64).exp()), -5.0 * (1.0 - (-2.0_f64).exp())],
        ),
        ("ambient-bending", &[("qx", 2.0)], [0.0, -2.0, -4.0]),
        ("ambient-scale", &[("expansion", 10.0)], [0.0, -0.38, -0.76]),
        ("artefact-growth", &[("growth", 5.0)], [0.0, 5.0, 10.0]),
        ("block-temperature", &[("alpha", 100.0)], [0.0, 0.5, 1.0]),
        ("centre-drift-c", &[("vx", 5.0)], [0.0, 0.0, 0.0]),
    ];
    for (effect, values, expected) in tries {
        let mut scenario = Scenario::flawless().with(&machine, effect, values).unwrap();
        scenario.temperature = vec![(0.0, 20.0), (2.0, 22.0)];
        let found = readings(&machine, &plan, &scenario, None);
        for (e, um) in found.iter().zip(expected) {
            assert!((e - mm_from_um(um)).abs() < SECOND_ORDER, "{effect}: {found:?} mm, expected {expected:?} um");
        }
    }
    let scenario = Scenario::flawless().with(&machine, "spindle-growth", &[("growth", 5.0)]).unwrap();
    plan.touches.iter_mut().for_each(|t| t.time_s = t.time_s.map(|s| s + 7.0));
    let (raw, _) = run(&machine, &plan, &scenario, None).unwrap();
    assert_eq!(raw[1].time_s, Some(3707.0));
    assert!(raw.iter().all(|r| r.temperature_deg_c.is_none()));
}

/// A ruler that is longer by 2e-5 (10 ppm/K, 2 K) shows 100 mm as 99.998 mm, whether its axis carries the table or the head. The
/// contact is on the side of the ball that looks to the block, so that a reading too small by d is −d along the outward normal's axis.
#[test]
fn warm_scales_read_every_distance_too_short_on_both_sides_of_the_chain() {
    for name in ["swivel-head", "trunnion"] {
        let machine = machine_named(name);
        let mounting = if name == "trunnion" { "table" } else { "head" };
        let mut plan = empty_plan(&machine, mounting);
        let zero = machine.rotary().map(|a| (a.name, 0.0)).collect::<Vec<_>>();
        let block = plan.blocks[0].clone();
        let faces = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        for n in faces {
            add_touch(&mut plan, &machine, &block.name, plus(block.centre, 5.0, n), n, pose(&zero));
            plan.touches.last_mut().unwrap().time_s = Some(7200.0);
        }
        let mut scenario = Scenario::flawless().with(&machine, "ambient-scale", &[("expansion", 10.0)]).unwrap();
        scenario.temperature = vec![(0.0, 22.0), (9.0, 22.0)];
        let found = readings(&machine, &plan, &scenario, None);
        for ((e, touch), axis) in found.iter().zip(&plan.touches).zip([AxisName::X, AxisName::Y, AxisName::Z]) {
            close(*e, -2e-5 * touch.nominal.get(axis).unwrap(), SECOND_ORDER);
        }
    }
}

#[test]
fn a_control_that_counts_backwards_is_a_gross_error() {
    let machine = machine_named("swivel-head");
    let scenario = Scenario::flawless().with(&machine, "sign-or-axis-swap", &[("flip_B", 1.0)]).unwrap();
    let found = three_faces(&machine, "head", "x+", pose(&[(AxisName::B, -0.1), (AxisName::C, 0.0)]), &scenario);
    close(found[0], 2.0 * L * rad_from_deg(0.1).sin(), 1e-3);
}

#[test]
fn a_control_that_swaps_two_axes_meets_nothing() {
    let machine = machine_named("swivel-head");
    let scenario = Scenario::flawless().with(&machine, "sign-or-axis-swap", &[("swap_XY", 1.0)]).unwrap();
    let mut plan = empty_plan(&machine, "head");
    let at = pose(&[(AxisName::B, 0.0), (AxisName::C, 0.0)]);
    add_touch(&mut plan, &machine, "x+", [35.0, 0.0, -203.0], [1.0, 0.0, 0.0], at);
    assert_eq!(run(&machine, &plan, &scenario, None).unwrap().0[0].status, Status::Miss);
}
