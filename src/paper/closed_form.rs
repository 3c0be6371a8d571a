//! Closed forms of the paper from readings: exact in the readings, first order in the errors.
//!
//! A reading e is recorded less nominal along the face's outward normal, mm. On the head side e = −n·Δ(pose), where Δ is
//! the displacement of the ball; on the table side e = +n·(d + ω×p) to first order.

use nalgebra::Vector3;

/// A reading with what a closed form needs to know of its touch. Lengths mm, angles deg, machine directions.
#[derive(Debug, Clone, Copy)]
pub struct Reading {
    /// A, B, C, deg.
    pub pose_deg: [f64; 3],
    /// Outward normal in the machine frame.
    pub normal: Vector3<f64>,
    /// Nominal contact in the machine frame (the carrier's frame turned by the pose), mm.
    pub point: Vector3<f64>,
    /// Recorded less nominal along the normal, mm.
    pub e: f64,
}

/// Mean of an iterator; `None` when it is empty.
fn mean(values: impl Iterator<Item = f64>) -> Option<f64> {
    let (mut sum, mut n) = (0.0, 0usize);
    for v in values {
        sum += v;
        n += 1;
    }
    (n > 0).then(|| sum / n as f64)
}

fn at(reading: &Reading, pose: [f64; 3]) -> bool {
    reading.pose_deg.iter().zip(pose).all(|(a, b)| (a - b).abs() < 1e-9)
}

fn along(reading: &Reading, k: usize) -> bool {
    reading.normal[k].abs() > 0.999
}

/// Displacement of the ball along machine direction `k` at a head pose: half the sum of (3-1)…, one-sided where only one
/// side can be reached. `None` when no such face was touched.
#[must_use]
pub fn head_displacement(readings: &[Reading], a_deg: f64, b_deg: f64, k: usize) -> Option<f64> {
    mean(readings.iter().filter(|r| at(r, [a_deg, b_deg, r.pose_deg[2]]) && along(r, k)).map(|r| -r.e * r.normal[k]))
}

/// a b g d_x d_y of the swivelling head (rad, mm); `length` is z_b, mm. Relations (3-1)…(3-5).
#[must_use]
pub fn head(readings: &[Reading], length: f64) -> Option<[f64; 5]> {
    let d = |b, k| head_displacement(readings, 0.0, b, k);
    let (c, s) = (30f64.to_radians().cos(), 0.5);
    let (x0, x90) = (d(0.0, 0)?, d(-90.0, 0)?);
    let (y0, y90, y30) = (d(0.0, 1)?, d(-90.0, 1)?, d(-30.0, 1)?);
    let dx = x90;
    let b = (x90 - x0) / length;
    let dy = (c * y0 + s * y90 - y30) / (c + s - 1.0);
    Some([(y0 - dy) / length, b, (y90 - dy) / length, dx, dy])
}

/// a b d_x d_y of the turntable (rad, mm) from a complete turn of C at B = 0; `z_c` is the height at which d is stated.
/// Relations (3-6)…(3-9).
#[must_use]
pub fn table(readings: &[Reading], z_c: f64) -> Option<[f64; 4]> {
    let turn: Vec<&Reading> = readings.iter().filter(|r| r.pose_deg[1].abs() < 1e-9).collect();
    let top = |k: usize, side: f64| {
        // the block's own place tells on which side of the table it stands
        mean(
            turn.iter()
                .filter(|r| along(r, 2) && r.point[k] * side > 0.0 && r.point[k].abs() > r.point[1 - k].abs())
                .map(|r| r.e),
        )
    };
    let arm = |k: usize, side: f64| {
        mean(
            turn.iter()
                .filter(|r| along(r, 2) && r.point[k] * side > 0.0 && r.point[k].abs() > r.point[1 - k].abs())
                .map(|r| r.point[k]),
        )
    };
    let b = (top(0, -1.0)? - top(0, 1.0)?) / (arm(0, 1.0)? - arm(0, -1.0)?);
    let a = (top(1, 1.0)? - top(1, -1.0)?) / (arm(1, 1.0)? - arm(1, -1.0)?);
    let side = |k: usize| mean(turn.iter().filter(|r| along(r, k)).map(|r| r.e * r.normal[k]));
    let height = |k: usize| mean(turn.iter().filter(|r| along(r, k)).map(|r| r.point.z - z_c));
    Some([a, b, side(0)? - height(0)? * b, side(1)? + height(1)? * a])
}

/// Which labels the two-axis head's closed form uses.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Mode {
    /// The labels of the relations: d_zBA and g_BA, printed relations literally.
    R,
    /// The labels of the table: a_BA and d_xBA, corrected relations, d_zBA = g_BA = 0 known.
    T,
    /// All ten unknowns.
    F,
}

/// The two-axis head's unknowns (rad, mm).
#[derive(Debug, Clone, Copy, Default, PartialEq)]
#[allow(missing_docs)]
pub struct DoubleHead {
    pub a_bz: f64,
    pub b_bz: f64,
    pub g_bz: f64,
    pub dx_bz: f64,
    pub dy_bz: f64,
    pub dz_bz: f64,
    pub a_ba: f64,
    pub g_ba: f64,
    pub dx_ba: f64,
    pub dz_ba: f64,
}

/// Closed form of the two-axis head; `length` is R, mm. Relations (4-3)…(4-9) and their completions.
#[must_use]
pub fn double_head(readings: &[Reading], length: f64, mode: Mode) -> Option<DoubleHead> {
    let x = |b, a| head_displacement(readings, a, b, 0);
    let y = |b, a| head_displacement(readings, a, b, 1);
    let z = |b, a| head_displacement(readings, a, b, 2);
    let (c, s) = (30f64.to_radians().cos(), 0.5);
    let mut u = DoubleHead::default();
    match mode {
        Mode::R => {
            // (4-3), (4-5), (4-9) for d_x, d_z of A and b; (4-8), (4-4), (4-6), (4-7) for the rest
            let (x00, x90, x30) = (x(0.0, 0.0)?, x(-90.0, 0.0)?, x(-30.0, 0.0)?);
            u.dx_bz = (c * x00 + s * x90 - x30) / (c + s - 1.0);
            u.dz_ba = u.dx_bz - x90;
            u.b_bz = (u.dx_bz - x00) / length;
            u.dy_bz = y(0.0, -90.0)?;
            u.a_bz = (y(0.0, 0.0)? - u.dy_bz) / length;
            u.g_bz = (y(-90.0, 0.0)? - u.dy_bz) / length;
            u.g_ba = (x(0.0, -90.0)? - u.dx_bz) / length - u.g_bz;
            u.dz_bz = z(0.0, 0.0)? - u.dz_ba;
        }
        Mode::T => {
            u.dx_bz = x(-90.0, 0.0)?;
            u.g_bz = (x(0.0, -90.0)? - x(0.0, 90.0)?) / (2.0 * length);
            u.dx_ba = (x(0.0, -90.0)? + x(0.0, 90.0)?) / 2.0 - u.dx_bz;
            u.b_bz = (u.dx_bz + u.dx_ba - x(0.0, 0.0)?) / length;
            u.dy_bz = y(0.0, -90.0)?;
            u.a_ba = (y(-90.0, 0.0)? - u.dy_bz) / length - u.g_bz;
            u.a_bz = (y(0.0, 0.0)? - u.dy_bz) / length - u.a_ba;
            u.dz_bz = z(0.0, 0.0)?;
        }
        Mode::F => {
            let d = 1.0 / (c + s - 1.0);
            u.dx_bz = (c * x(0.0, 0.0)? + s * x(-90.0, 0.0)? - x(-30.0, 0.0)?) * d;
            u.dz_ba = u.dx_bz - x(-90.0, 0.0)?;
            u.dx_ba = (x(0.0, -90.0)? + x(0.0, 90.0)?) / 2.0 - u.dx_bz;
            u.b_bz = (u.dx_bz + u.dx_ba - x(0.0, 0.0)?) / length;
            let g = (x(0.0, -90.0)? - x(0.0, 90.0)?) / (2.0 * length);
            u.dy_bz = (y(0.0, -90.0)? + y(0.0, 90.0)?) / 2.0;
            let a = |b| Some((y(b, 0.0)? - u.dy_bz) / length);
            let (a1, a2, a3) = (a(0.0)?, a(-90.0)?, a(-30.0)?);
            u.a_ba = (c * a1 + s * a2 - a3) * d;
            u.a_bz = a1 - u.a_ba;
            u.g_bz = a2 - u.a_ba;
            u.g_ba = g - u.g_bz;
            u.dz_bz = z(0.0, 0.0)? - u.dz_ba;
        }
    }
    Some(u)
}
