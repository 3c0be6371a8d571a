//! The check values of the paper's method: exact tip displacements of the head, readings on the turntable's block.

use super::*;
use crate::units::rad_from_deg;

const SET_1: [f64; 8] = [0.0150, -0.0100, 0.0200, 0.0300, 0.0250, -0.0100, 0.0120, 0.0100];
const SET_2: [f64; 8] = [0.0250, 0.0340, -0.0100, -0.0400, -0.0350, 0.0180, -0.0180, 0.0230];
const NAMES: [&str; 8] = ["a_BZ", "b_BZ", "g_BZ", "d_xBZ", "d_yBZ", "d_zBZ", "a_BA", "d_xBA"];
const FACES: [Vec3; 5] = [[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, 1.0]];

fn head(set: &[f64; 8]) -> Scenario {
    let values: Vec<(&str, f64)> = NAMES.into_iter().zip(*set).take(5).collect();
    Scenario::flawless().with(&machine_named("swivel-head"), "paper-head", &values).unwrap()
}

/// All five faces of all blocks at a pose, points off the middle of the face.
fn all_faces(machine: &Machine, mounting: &str, poses: &[AxisMap], radius: f64) -> Plan {
    let mut plan = empty_plan(machine, mounting);
    plan.ball_radius_mm = radius;
    for pose in poses {
        for block in plan.blocks.clone() {
            for n in FACES {
                let mut point = plus(block.centre, 5.0, n);
                for (i, x) in point.iter_mut().enumerate() {
                    *x += if n[i] == 0.0 { [1.5, -2.0, 1.0][i] } else { 0.0 };
                }
                add_touch(&mut plan, machine, &block.name, point, n, *pose);
            }
        }
    }
    plan
}

/// `E·q - q` with `E` of the method, section 1, its rotation written as three turns of a vector, one after another.
fn displacement(set: &[f64; 8], q: Vec3) -> Vec3 {
    let [a, b, g] = [0, 1, 2].map(|i| rad_from_deg(set[i]).sin_cos());
    let [x, y, z] = q;
    let (y, z) = (y * a.1 - z * a.0, y * a.0 + z * a.1);
    let (x, z) = (x * b.1 + z * b.0, z * b.1 - x * b.0);
    let (x, y) = (x * g.1 - y * g.0, x * g.0 + y * g.1);
    minus(plus([set[3], set[4], 0.0], 1.0, [x, y, z]), q)
}

#[test]
fn head_touches_give_the_tip_displacement() {
    let machine = machine_named("swivel-head");
    let printed = [
        (SET_1, 0.0, [0.065356506, 0.078074891, 0.000010033]),
        (SET_1, -90.0, [0.029984565, 0.095750060, 0.035375031]),
        (SET_1, -30.0, [0.060611914, 0.106339234, 0.017696204]),
        (SET_2, 0.0, [-0.160259651, 0.053458566, 0.000054980]),
        (SET_2, -90.0, [-0.040038773, -0.070375025, -0.120275100]),
        (SET_2, -30.0, [-0.144167300, 0.023919853, -0.060089935]),
    ];
    for (set, b, delta) in printed {
        let (s, c) = rad_from_deg(b).sin_cos();
        let exact = displacement(&set, [-L * s, 0.0, -L * c]);
        let mut first: Option<Vec<f64>> = None;
        for radius in [3.0, 0.5, 4.0] {
            let plan = all_faces(&machine, "head", &[pose(&[(AxisName::B, b), (AxisName::C, 0.0)])], radius);
            let found = readings(&machine, &plan, &head(&set), None);
            for (e, touch) in found.iter().zip(&plan.touches) {
                close(*e, -dot(touch.normal, delta), 6e-10);
                // the blocks stand still: whatever block, point and radius, the reading is minus the displacement
                close(*e, -dot(touch.normal, exact), 3e-13);
            }
            match &first {
                None => first = Some(found),
                Some(first) => found.iter().zip(first).for_each(|(a, b)| close(*a, *b, 3e-13)),
            }
        }
    }
}

#[test]
fn table_touches_give_the_printed_readings() {
    let machine = machine_named("swivel-head");
    let names = ["a_CY", "b_CY", "d_xCY", "d_yCY"];
    let outer = [35.0, 0.0, -202.684];
    let upper = [30.0, 0.0, -197.684];
    let printed = [
        (
            SET_1,
            [0.065375611, 0.078063848, -0.065374453, -0.078061244],
            [0.005214570, 0.007832564, -0.005257406, -0.007875400],
        ),
        (
            SET_2,
            [-0.160268430, 0.053441176, 0.160281812, -0.053433941],
            [-0.017863636, 0.013028697, 0.017741085, -0.013151248],
        ),
    ];
    for (set, outer_e, upper_e) in printed {
        let values: Vec<(&str, f64)> = names.into_iter().zip([set[0], set[1], set[3], set[4]]).collect();
        let scenario = Scenario::flawless().with(&machine, "paper-table", &values).unwrap();
        let mut plan = empty_plan(&machine, "table");
        for c in [0.0, 90.0, 180.0, 270.0] {
            let at = pose(&[(AxisName::B, 0.0), (AxisName::C, c)]);
            add_touch(&mut plan, &machine, "x+", outer, [1.0, 0.0, 0.0], at);
            add_touch(&mut plan, &machine, "x+", upper, [0.0, 0.0, 1.0], at);
        }
        let found = readings(&machine, &plan, &scenario, None);
        for i in 0..4 {
            close(found[2 * i], outer_e[i], 6e-10);
            close(found[2 * i + 1], upper_e[i], 6e-10);
        }
    }
}

#[test]
fn double_head_touches_give_the_tip_displacement() {
    let machine = machine_named("double-head");
    let values: Vec<(&str, f64)> = NAMES.into_iter().zip(SET_1).collect();
    let scenario = Scenario::flawless().with(&machine, "paper-double-head", &values).unwrap();
    let printed = [
        ((0.0, 0.0), [0.075341684, 0.120528414, -0.009972663]),
        ((-90.0, 0.0), [0.029963555, 0.138197473, 0.035386143]),
        ((-30.0, 0.0), [0.069254252, 0.148790980, 0.012712678]),
        ((0.0, -90.0), [0.110766723, 0.025038349, -0.105510834]),
        ((0.0, 90.0), [-0.030766724, 0.024968632, 0.085514325]),
        ((-90.0, -90.0), [0.143207608, 0.025035942, -0.053055136]),
    ];
    for ((b, a), delta) in printed {
        let plan = all_faces(&machine, "head", &[pose(&[(AxisName::A, a), (AxisName::B, b)])], 3.0);
        for (e, touch) in readings(&machine, &plan, &scenario, None).iter().zip(&plan.touches) {
            close(*e, -dot(touch.normal, delta), 6e-10);
        }
    }
}

#[test]
fn the_nominal_positions_are_those_of_the_method() {
    // section 2: linear axes = ball - Ry(B)(0, 0, -L), the block turned by C
    let machine = machine_named("swivel-head");
    let plan = all_faces(&machine, "table", &[pose(&[(AxisName::B, -30.0), (AxisName::C, 90.0)])], 3.0);
    let (s, c) = rad_from_deg(-30.0).sin_cos();
    let q = [-L * s, 0.0, -L * c];
    for touch in &plan.touches {
        let ball = plus(touch.point, 3.0, touch.normal);
        let turned = [-ball[1], ball[0], ball[2]];
        let wanted = minus(turned, q);
        let p = touch.nominal_position();
        assert!(super::super::rigid::norm(minus([p.0[0], p.0[1], p.0[2]], wanted)) < 1e-12);
    }
}

#[test]
fn a_flawless_machine_reads_zero_everywhere() {
    for (name, mounting, poses) in [
        ("swivel-head", "table", vec![[(AxisName::B, -47.0), (AxisName::C, 133.0)]]),
        ("double-head", "head", vec![[(AxisName::B, 31.0), (AxisName::A, -17.0)]]),
        ("trunnion", "table", vec![[(AxisName::A, -35.0), (AxisName::C, 211.0)]]),
        ("swivel-table-b", "table", vec![[(AxisName::B, 25.0), (AxisName::C, -77.0)]]),
        ("nutating-b", "table", vec![[(AxisName::B, 143.0), (AxisName::C, -77.0)]]),
        ("trunnion-offset", "table", vec![[(AxisName::A, -35.0), (AxisName::C, 211.0)]]),
    ] {
        let machine = machine_named(name);
        let poses: Vec<AxisMap> = poses.iter().map(|p| pose(p)).collect();
        let plan = all_faces(&machine, mounting, &poses, 3.0);
        for e in readings(&machine, &plan, &Scenario::flawless(), None) {
            close(e, 0.0, 3e-13);
        }
    }
}
