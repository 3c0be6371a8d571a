//! The chain once more, from its definition: 4×4 matrices, one after the other, no code of the crate but the records.

use axiscal::axes::{AxisName, Position};
use axiscal::machine::{Machine, Side};
use axiscal::tables::compensation::Term;
use axiscal::tables::place::{Dof, Place};

pub type M = [[f64; 4]; 4];

pub fn times(a: &M, b: &M) -> M {
    let mut out = [[0.0; 4]; 4];
    for i in 0..4 {
        for j in 0..4 {
            out[i][j] = (0..4).map(|k| a[i][k] * b[k][j]).sum();
        }
    }
    out
}

pub fn trans(v: [f64; 3]) -> M {
    [[1.0, 0.0, 0.0, v[0]], [0.0, 1.0, 0.0, v[1]], [0.0, 0.0, 1.0, v[2]], [0.0, 0.0, 0.0, 1.0]]
}

/// About x, y, z (0, 1, 2), rad.
pub fn rot(about: usize, rad: f64) -> M {
    let (s, c) = rad.sin_cos();
    let (i, j) = ((about + 1) % 3, (about + 2) % 3);
    let mut out = trans([0.0; 3]);
    out[i][i] = c;
    out[j][j] = c;
    out[i][j] = -s;
    out[j][i] = s;
    out
}

/// About a unit direction, rad (Rodrigues).
pub fn turn([x, y, z]: [f64; 3], rad: f64) -> M {
    let ((s, c), u) = (rad.sin_cos(), 1.0 - rad.cos());
    [
        [x * x * u + c, x * y * u - z * s, x * z * u + y * s, 0.0],
        [y * x * u + z * s, y * y * u + c, y * z * u - x * s, 0.0],
        [z * x * u - y * s, z * y * u + x * s, z * z * u + c, 0.0],
        [0.0, 0.0, 0.0, 1.0],
    ]
}

/// Inverse of a rigid transform.
pub fn inverse(m: &M) -> M {
    let mut out = trans([0.0; 3]);
    for i in 0..3 {
        for j in 0..3 {
            out[i][j] = m[j][i];
        }
        out[i][3] = -(0..3).map(|j| m[j][i] * m[j][3]).sum::<f64>();
    }
    out
}

pub fn about(point: [f64; 3], m: &M) -> M {
    times(&trans(point), &times(m, &trans(point.map(|v| -v))))
}

/// Trans(d) Rz Ry Rx of the terms of one axis at one place, about a point.
fn error(terms: &[Term], axis: AxisName, place: Place, point: [f64; 3]) -> M {
    let sum = |dof: Dof| -> f64 {
        terms.iter().filter(|t| t.axis == axis && t.place == place && t.dof == dof).map(|t| t.value).sum()
    };
    let angle = |dof: Dof| sum(dof) * std::f64::consts::PI / 180.0;
    let turned = times(&rot(2, angle(Dof::Rz)), &times(&rot(1, angle(Dof::Ry)), &rot(0, angle(Dof::Rx))));
    times(&trans([sum(Dof::Dx), sum(Dof::Dy), sum(Dof::Dz)]), &about(point, &turned))
}

/// One side of the chain.
fn side(machine: &Machine, side: Side, at: &Position, terms: &[Term], reference: [f64; 3]) -> M {
    let mut frame = trans([0.0; 3]);
    for axis in machine.side(side) {
        let k = axis.name.index() % 3;
        let q = at.get(axis.name);
        if axis.name.is_rotary() {
            let point: [f64; 3] = axis.point.into();
            let centre = if side == Side::Tool { point } else { reference };
            let zero: f64 =
                terms.iter().filter(|t| t.axis == axis.name && t.place == Place::Zero).map(|t| t.value).sum();
            let angle = (q * axis.sense + zero) * std::f64::consts::PI / 180.0;
            frame = times(&frame, &error(terms, axis.name, Place::Before, centre));
            frame = times(&frame, &about(point, &turn(axis.direction.into_inner().into(), angle)));
            frame = times(&frame, &error(terms, axis.name, Place::After, point));
        } else {
            let mut by = [0.0; 3];
            by[k] = if side == Side::Tool { q } else { -q };
            frame = times(&frame, &trans(by));
        }
    }
    frame
}

/// The tip of a tool of a length in the workpiece's frame, at joint positions relative to R.
pub fn tip(machine: &Machine, joints: &Position, terms: &[Term], reference: [f64; 3], length: f64) -> [f64; 3] {
    let work = side(machine, Side::Workpiece, joints, terms, reference);
    let tool = side(machine, Side::Tool, joints, terms, reference);
    let pivot: [f64; 3] = machine.tool.pivot.into();
    let tip = times(&times(&inverse(&work), &tool), &trans([pivot[0], pivot[1], pivot[2] - length]));
    [tip[0][3], tip[1][3], tip[2][3]]
}
