//! The chain's own check values: displacements of the ball of the paper's two heads, exact and to first order, and readings
//! of the turntable. (The virtual machine has the same numbers as tests of its own.)

use crate::common;
use axiscal::axes::{AxisName, Position};
use axiscal::machine::{Carrier, Machine};
use axiscal::model::catalogue::Catalogue;
use axiscal::model::formula::VARIABLES;
use axiscal::model::predict::{Model, Observation, SetUp};
use axiscal::model::surface::{Body, Surface};
use common::machine;
use nalgebra::Vector3;

/// What an errorless control's touch at this pose would read with these errors: exact, and to first order (mm).
fn gap(
    machine: &Machine,
    effect: &str,
    errors: &[(&str, f64)],
    carrier: Carrier,
    pose: &[(AxisName, f64)],
    point: Vector3<f64>,
    normal: Vector3<f64>,
) -> (f64, f64) {
    let catalogue = Catalogue::built_in().unwrap();
    let set_up = SetUp { label: "block".into(), carrier, body: Body::Box, centre: Vector3::zeros(), runs: vec![0] };
    let model = Model::new(machine, &[catalogue.get(effect, machine).unwrap()], &[set_up], machine.reference.pivot);
    let theta: Vec<f64> = model
        .unknowns
        .iter()
        .map(|u| errors.iter().find(|(n, _)| u.alias.as_deref() == Some(n) || u.name == *n).map_or(0.0, |(_, v)| *v))
        .collect();
    let mut at = Position::default();
    pose.iter().for_each(|(axis, angle)| at.set(*axis, *angle));
    let position = machine.linear_for_ball(carrier, &at, &point, machine.tool.length_mm).unwrap();
    let touch = Observation {
        run: 0,
        id: 1,
        set_up: 0,
        point,
        normal,
        surface: Surface::Plane { point, normal },
        ball_radius: 0.0,
        ball_at_zero: machine.tool.ball_at_zero(machine.tool.length_mm),
        position,
        state: [0.0; VARIABLES.len()],
        has_temperature: false,
    };
    let mut row = vec![0.0; theta.len()];
    let exact = model.gap(&touch, &theta);
    model.gap_and_row(&touch, &model.start(), &mut row);
    (exact, row.iter().zip(&theta).map(|(r, t)| r * t).sum())
}

/// Displacement of the ball in R: the gap of faces along x, y, z.
fn displacement(machine: &Machine, effect: &str, errors: &[(&str, f64)], pose: &[(AxisName, f64)]) -> [(f64, f64); 3] {
    [Vector3::x(), Vector3::y(), Vector3::z()]
        .map(|n| gap(machine, effect, errors, Carrier::Table, pose, machine.reference.ball, n))
}

const SET_1: [(&str, f64); 5] =
    [("a_BZ", 0.0150), ("b_BZ", -0.0100), ("g_BZ", 0.0200), ("d_xBZ", 0.0300), ("d_yBZ", 0.0250)];
const SET_2: [(&str, f64); 5] =
    [("a_BZ", 0.0250), ("b_BZ", 0.0340), ("g_BZ", -0.0100), ("d_xBZ", -0.0400), ("d_yBZ", -0.0350)];

#[test]
fn displacements_of_the_swivelling_head() {
    let machine = machine("swivel-head");
    // the method, section 9: exact, first order
    #[allow(clippy::type_complexity)] // a table
    let table: [(&[(&str, f64)], f64, [(f64, f64); 3]); 6] = [
        (&SET_1, 0.0, [(0.065356506, 0.065375031), (0.078074891, 0.078062547), (0.000010033, 0.0)]),
        (&SET_1, -90.0, [(0.029984565, 0.030000000), (0.095750060, 0.095750063), (0.035375031, 0.035375031)]),
        (&SET_1, -30.0, [(0.060611914, 0.060635676), (0.106339234, 0.106328545), (0.017696204, 0.017687516)]),
        (&SET_2, 0.0, [(-0.160259651, -0.160275107), (0.053458566, 0.053437579), (0.000054980, 0.0)]),
        (&SET_2, -90.0, [(-0.040038773, -0.040000000), (-0.070375025, -0.070375031), (-0.120275100, -0.120275107)]),
        (&SET_2, -30.0, [(-0.144167300, -0.144161298), (0.023919853, 0.023901674), (-0.060089935, -0.060137553)]),
    ];
    for (errors, b, expected) in table {
        let found = displacement(&machine, "paper-head", errors, &[(AxisName::B, b)]);
        for (f, e) in found.iter().zip(expected) {
            assert!((f.0 - e.0).abs() < 6e-10 && (f.1 - e.1).abs() < 6e-10, "B = {b}: {f:?} instead of {e:?}");
        }
    }
}

#[test]
fn displacements_of_the_two_axis_head() {
    let machine = machine("double-head");
    let errors = [&SET_1[..], &[("d_zBZ", -0.0100), ("a_BA", 0.0120), ("d_xBA", 0.0100)]].concat();
    // the method, section 9, set 1 with the labels of the table, exact
    for (b, a, expected) in [
        (0.0, 0.0, [0.075341684, 0.120528414, -0.009972663]),
        (-90.0, 0.0, [0.029963555, 0.138197473, 0.035386143]),
        (-30.0, 0.0, [0.069254252, 0.148790980, 0.012712678]),
        (0.0, -90.0, [0.110766723, 0.025038349, -0.105510834]),
        (0.0, 90.0, [-0.030766724, 0.024968632, 0.085514325]),
        (-90.0, -90.0, [0.143207608, 0.025035942, -0.053055136]),
    ] {
        let found = displacement(&machine, "paper-double-head", &errors, &[(AxisName::B, b), (AxisName::A, a)]);
        for (f, e) in found.iter().zip(expected) {
            assert!((f.0 - e).abs() < 6e-10, "({b}, {a}): {} instead of {e}", f.0);
        }
        // section 7, first order: what the corrected relations say
        let length = machine.tool.length_mm;
        let rad = |name: &str| errors.iter().find(|(n, _)| *n == name).unwrap().1.to_radians();
        if (b, a) == (0.0, 0.0) {
            assert!((found[0].1 - (0.03 + 0.01 - length * rad("b_BZ"))).abs() < 1e-12, "(4-3) with d_xBA");
            assert!((found[1].1 - (0.025 + length * (rad("a_BZ") + rad("a_BA")))).abs() < 1e-12, "(4-4) with a_BA");
        }
        if (b, a) == (0.0, -90.0) {
            assert!((found[0].1 - (0.03 + 0.01 + length * rad("g_BZ"))).abs() < 1e-12, "(4-7) with d_xBA");
            assert!((found[1].1 - 0.025).abs() < 1e-12, "(4-8)");
        }
    }
}

#[test]
fn first_order_maps_of_head_and_table() {
    // the method, section 2: dx - L b cos B, dy + L a cos B - L g sin B, dz + L b sin B; table: d + w x p
    let head = machine("swivel-head");
    let length = head.tool.length_mm;
    let [a, b, g] = [0.015f64, -0.01, 0.02].map(f64::to_radians);
    for angle in [0.0f64, -90.0, -30.0, 90.0, 17.0] {
        let (s, c) = angle.to_radians().sin_cos();
        let expected = [0.03 - length * b * c, 0.025 + length * a * c - length * g * s, length * b * s];
        let found = displacement(&head, "paper-head", &SET_1, &[(AxisName::B, angle)]);
        for (f, e) in found.iter().zip(expected) {
            assert!((f.1 - e).abs() < 1e-12, "B = {angle}: {} instead of {e}", f.1);
        }
    }
    let errors = [("a_CY", 0.015), ("b_CY", -0.01), ("d_xCY", 0.03), ("d_yCY", 0.025)];
    let point = Vector3::new(35.0, 0.0, -202.684);
    for angle in [0.0f64, 90.0, 180.0, 270.0] {
        let (s, c) = angle.to_radians().sin_cos();
        let p = Vector3::new(c * point.x, s * point.x, point.z);
        let moved = Vector3::new(0.03, 0.025, 0.0) + Vector3::new(a, b, 0.0).cross(&p);
        let outward = Vector3::new(c, s, 0.0);
        let (_, first) = gap(
            &head,
            "paper-table",
            &errors,
            Carrier::Axis(AxisName::C),
            &[(AxisName::C, angle)],
            point,
            Vector3::x(),
        );
        // the face has moved by +moved: the ball at its nominal place stands that much inside
        assert!((first + outward.dot(&moved)).abs() < 1e-12, "C = {angle}");
    }
}
