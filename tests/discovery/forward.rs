//! A five-axis machine with errors: where the ball is, where the block is, and where the probe triggers.

use axiscal::machine::{Axis, Machine, Side};
use nalgebra::{Matrix3, Vector3};

pub type V = Vector3<f64>;

/// The rotation by a vector: about its direction, by its length (rad). Rodrigues' formula.
pub fn turned(by: V) -> Matrix3<f64> {
    let angle = by.norm();
    if angle < 1e-300 {
        return Matrix3::identity();
    }
    let u = by / angle;
    let k = Matrix3::new(0.0, -u.z, u.y, u.z, 0.0, -u.x, -u.y, u.x, 0.0);
    Matrix3::identity() + k * angle.sin() + k * k * (1.0 - angle.cos())
}

/// A small motion of a part: it turns about a point and is shifted. Directions are those of the machine at zero.
#[derive(Debug, Clone, Copy)]
pub struct Slip {
    pub shift: V,
    /// rad
    pub turn: V,
    pub about: V,
}

impl Slip {
    pub fn shift(shift: V) -> Self {
        Self { shift, turn: V::zeros(), about: V::zeros() }
    }

    pub fn turn(turn: V, about: V) -> Self {
        Self { shift: V::zeros(), turn, about }
    }

    fn forward(&self, p: V) -> V {
        turned(self.turn) * (p - self.about) + self.about + self.shift
    }

    fn back(&self, p: V) -> V {
        turned(self.turn).transpose() * (p - self.shift - self.about) + self.about
    }
}

/// Everything that is wrong at one touch.
#[derive(Debug, Clone, Default)]
pub struct Wrong {
    /// The axis is further than the control shows: mm, rad; X Y Z A B C.
    pub joint: [f64; 6],
    /// Of an axis: in front of its motion, so that they do not go along with it.
    pub before: [Vec<Slip>; 6],
    /// Behind its motion.
    pub after: [Vec<Slip>; 6],
    /// The tool against the base, mm.
    pub tool: V,
    /// The ball against the head that tilts it, mm.
    pub in_head: V,
    /// The ball against the spindle, mm.
    pub in_spindle: V,
    /// Way of the ball from contact to trigger, mm.
    pub late: f64,
    /// The block, about its centre.
    pub block_shift: V,
    pub block_turn: V,
    /// The block's edges are longer by this, mm.
    pub longer: V,
}

/// What is touched with what.
#[derive(Debug, Clone)]
pub struct Target {
    /// Number of workpiece-side axes between base and block.
    pub carried_by: usize,
    pub centre: V,
    /// Where the ball should touch, and the outward normal, in the carrier's frame.
    pub point: V,
    pub normal: V,
    /// Of a sphere about `centre`; `None`: a face.
    pub sphere_radius: Option<f64>,
    pub ball_radius: f64,
    pub stylus_mm: f64,
    pub spindle_rad: f64,
}

/// An axis moves a point with what it carries.
fn moved(axis: &Axis, q: f64, p: V) -> V {
    let u = axis.direction.into_inner();
    if axis.name.is_rotary() {
        turned(u * (axis.sense * q)) * (p - axis.point) + axis.point
    } else if axis.side == Side::Workpiece {
        // display +X: the table goes to -X
        p - u * q
    } else {
        p + u * q
    }
}

fn moved_back(axis: &Axis, q: f64, p: V) -> V {
    moved(axis, -q, p)
}

/// The axes of a side, from the base on.
pub fn chain(machine: &Machine, side: Side) -> Vec<&Axis> {
    machine.axes.iter().filter(|a| a.side == side).collect()
}

/// Turns a direction of the tool's frame into one of R.
pub fn tool_direction(machine: &Machine, q: &[f64; 6], v: V) -> V {
    chain(machine, Side::Tool)
        .into_iter()
        .rev()
        .filter(|a| a.name.is_rotary())
        .fold(v, |v, a| turned(a.direction.into_inner() * (a.sense * q[a.name.index()])) * v)
}

/// Turns a direction of a carrier's frame into one of R.
pub fn carrier_direction(machine: &Machine, q: &[f64; 6], carried_by: usize, v: V) -> V {
    chain(machine, Side::Workpiece)[..carried_by]
        .iter()
        .rev()
        .filter(|a| a.name.is_rotary())
        .fold(v, |v, a| turned(a.direction.into_inner() * (a.sense * q[a.name.index()])) * v)
}

/// The ball's centre in the frame of the carrier, mm; `q` is what the control shows, mm and rad.
fn ball_in_carrier(machine: &Machine, q: &[f64; 6], wrong: &Wrong, target: &Target) -> V {
    let real = |a: &Axis| q[a.name.index()] + wrong.joint[a.name.index()];
    let down = machine.tool.direction.into_inner();
    let mut p = machine.tool.pivot - down * target.stylus_mm;
    p += wrong.in_head + turned(down * target.spindle_rad) * wrong.in_spindle;
    for axis in chain(machine, Side::Tool).into_iter().rev() {
        let i = axis.name.index();
        p = wrong.after[i].iter().fold(p, |p, s| s.forward(p));
        p = moved(axis, real(axis), p);
        p = wrong.before[i].iter().fold(p, |p, s| s.forward(p));
    }
    p += wrong.tool;
    for axis in &chain(machine, Side::Workpiece)[..target.carried_by] {
        let i = axis.name.index();
        p = wrong.before[i].iter().fold(p, |p, s| s.back(p));
        p = moved_back(axis, real(axis), p);
        p = wrong.after[i].iter().fold(p, |p, s| s.back(p));
    }
    p
}

/// How far the ball is off the real face, mm.
fn gap(machine: &Machine, q: &[f64; 6], wrong: &Wrong, target: &Target) -> f64 {
    let in_carrier = ball_in_carrier(machine, q, wrong, target);
    let in_block = turned(wrong.block_turn).transpose() * (in_carrier - target.centre - wrong.block_shift);
    if let Some(radius) = target.sphere_radius {
        return in_block.norm() - radius - target.ball_radius;
    }
    let face = target.point - target.centre;
    target.normal.dot(&(in_block - face)) - 0.5 * wrong.longer.dot(&target.normal.abs()) - target.ball_radius
}

/// What the control shows at the trigger (mm, rad) when it searches from `start` along `way` (unit vector of X Y Z).
pub fn trigger(machine: &Machine, start: &[f64; 6], way: V, wrong: &Wrong, target: &Target) -> [f64; 6] {
    let at = |mm: f64| {
        let mut q = *start;
        (0..3).for_each(|k| q[k] += mm * way[k]);
        q
    };
    // with nothing that changes on the way the gap is straight in it: the secant is exact, the second step mends rounding
    let (mut a, mut b) = (0.0, 1.0);
    let (rounds, window) = if target.sphere_radius.is_some() { (8, 0.02) } else { (3, 0.5) };
    for _ in 0..rounds {
        let (ga, gb) = (gap(machine, &at(a), wrong, target), gap(machine, &at(b), wrong, target));
        if (gb - ga).abs() < 1e-12 {
            break;
        }
        let next = b - gb * (b - a) / (gb - ga);
        (a, b) = (next - window, next);
    }
    at(b + wrong.late)
}
