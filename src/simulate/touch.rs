//! One touch: the search, the contact, the trigger, and what the log then says.

use super::contact::{Body, Contact, first_contact};
use super::control::Mapping;
use super::prepare::{Bench, Ready};
use super::rigid::{Rigid, Vec3, dot, minus, norm, plus};
use super::terms::Shifts;
use crate::axes::Position;
use crate::log::{RawTouch, Status};
use crate::machine::Form;

/// A made touch.
pub struct Outcome {
    /// What the log says.
    pub raw: RawTouch,
    /// What a person should know about it.
    pub remark: Option<Remark>,
}

/// What may be said about a touch.
#[derive(Debug, Clone, PartialEq)]
pub enum Remark {
    /// No contact before the end.
    Missed,
    /// In contact before the start, by this depth in mm.
    Already(f64),
    /// Not a face but an edge or a corner was met.
    Edge,
    /// Another face was met than planned.
    OtherFace,
    /// The control could not move there.
    Unreachable(&'static str),
}

/// Makes a touch.
pub fn make(bench: &Bench<'_>, ready: &Ready) -> Outcome {
    let log = |position: Position, status: Status, remark: Option<Remark>| Outcome {
        raw: RawTouch {
            id: Some(ready.id),
            position: rounded(position, bench.rounding_mm),
            present: bench.present,
            status,
            time_s: ready.time_s,
            temperature_deg_c: ready.temperature_deg_c,
            line: ready.number,
        },
        remark,
    };
    let ends = (&ready.start, &ready.end);
    let mapping = match bench.compensation {
        None => Ok(Mapping::DIRECT),
        Some(c) => c.mapping(&bench.chain, bench.tcp, ends, &ready.state.sense, ready.stylus),
    };
    let mapping = match mapping {
        Ok(mapping) => mapping,
        Err(why) => return log(ready.start, Status::Miss, Some(Remark::Unreachable(why))),
    };
    // errors depend on where the axes stand, not on what was commanded
    let steady = bench.terms.during(&ready.state, &mapping.joints(&ready.start));
    let scatter = bench.dice.visit_mm(ready.visit);
    let (block, body) = real_block(bench, ready, &steady);
    let ball_in = |block: &Rigid, joints: &Position, shifts: &Shifts| -> Vec3 {
        let place = bench.chain.place(joints, shifts, ready.n_links, ready.stylus);
        let ball = plus(place.ball, 1.0, scatter);
        block.inward(place.carrier.inward(ball))
    };
    let way = norm(way_of(ready));
    let ball_in_block = |s: f64| -> Vec3 {
        let joints = mapping.joints(&commanded(ready, s));
        if bench.terms.steady() {
            return ball_in(&block, &joints, &steady);
        }
        // the stylus bends until the probe triggers, and the errors are those of where the axes stand then. What goes with the
        // axes' places may move the block, too
        let shifts = at_trigger(bench, ready, &steady, |late| mapping.joints(&commanded(ready, s + late / way)));
        ball_in(&real_block(bench, ready, &shifts).0, &joints, &shifts)
    };
    let straight = bench.terms.steady() && mapping.is_affine();
    let (at, normal, faces) = match first_contact(&ball_in_block, straight, &body, ready.ball_radius_mm) {
        Contact::Met { at, normal, faces } => (at, normal, faces),
        Contact::Missed => return log(ready.end, Status::Miss, Some(Remark::Missed)),
        Contact::Already(depth) => return log(ready.start, Status::Miss, Some(Remark::Already(depth))),
    };
    // the probe triggers that much later on the commanded line
    let shifts = at_trigger(bench, ready, &steady, |late| mapping.joints(&commanded(ready, at + late / way)));
    // no probe triggers on a centre, but it scatters
    let late = if ready.form.is_centre() { 0.0 } else { shifts.late } + bench.dice.late_mm(ready.id);
    let trigger = at + late / way;
    if trigger > 1.0 {
        return log(ready.end, Status::Miss, Some(Remark::Missed));
    }
    let remark = if faces > 1 {
        Some(Remark::Edge)
    } else if dot(normal, ready.normal) < 0.5 {
        Some(Remark::OtherFace)
    } else {
        None
    };
    log(commanded(ready, trigger), Status::Hit, remark)
}

/// What is wrong where the axes stand when the probe triggers; `joints`: where they stand when it is so late, mm.
fn at_trigger(bench: &Bench<'_>, ready: &Ready, steady: &Shifts, joints: impl Fn(f64) -> Position) -> Shifts {
    /// How late it comes hardly depends on where the axes stand: each round is some ten thousand times nearer.
    const ROUNDS: usize = 3;
    let mut shifts = *steady;
    if bench.terms.steady() {
        return shifts;
    }
    for _ in 0..ROUNDS {
        let late = shifts.late;
        shifts = bench.terms.at(steady, &ready.state, &joints(late));
        if shifts.late == late {
            break;
        }
    }
    shifts
}

/// The commanded linear way, mm.
fn way_of(ready: &Ready) -> Vec3 {
    let xyz = |p: &Position| [p.0[0], p.0[1], p.0[2]];
    minus(xyz(&ready.end), xyz(&ready.start))
}

/// The commanded position on the way from start (0) to end (1).
fn commanded(ready: &Ready, s: f64) -> Position {
    let mut out = ready.start;
    for (slot, way) in out.0.iter_mut().zip(way_of(ready)) {
        *slot += s * way;
    }
    out
}

/// The frame of the real block in its carrier (origin at its centre, axes along its edges) and what it really is, mm.
fn real_block(bench: &Bench<'_>, ready: &Ready, shifts: &Shifts) -> (Rigid, Body) {
    let mut half = ready.half;
    if !ready.form.is_centre() {
        half = plus(half, shifts.half_size_ratio, half);
        // edges are those of blocks
        half = plus(half, f64::from(ready.form == Form::Box), shifts.half_size);
        half = plus(half, 1.0, ready.longer_half);
    }
    let mut frame = Rigid::shift(ready.centre);
    if shifts.block_outward != 0.0 {
        let outward = bench.chain.outward_from_centre(ready.n_links, ready.centre);
        frame = Rigid::shift(plus(ready.centre, shifts.block_outward, outward));
    }
    // whatever moves a block moves it in its carrier's frame: components add (docs/method.md)
    let mut six = shifts.block;
    if let Some(wrong) = &ready.wrong {
        let ([x, y, z], [a, b, c]) = (wrong.shift_mm, wrong.tilt_rad);
        six.iter_mut().zip([x, y, z, a, b, c]).for_each(|(sum, own)| *sum += own);
        half = plus(half, 0.5, wrong.size_mm);
    }
    if six != [0.0; 6] {
        frame = frame.then(&Rigid::error(&six, [0.0; 3]));
    }
    // a sphere is larger by its half axes, a cylinder and a hole by their radius
    if ready.form == Form::Sphere {
        half = plus(half, shifts.sphere_radius + ready.longer_radius, [1.0; 3]);
    }
    let radius = ready.radius * (1.0 + shifts.half_size_ratio) + shifts.cylinder_radius + ready.longer_radius;
    (frame, Body { form: ready.form, half, radius })
}

/// As a log with few digits would hold it.
fn rounded(mut position: Position, step_mm: f64) -> Position {
    if step_mm > 0.0 {
        for x in &mut position.0[..3] {
            *x = (*x / step_mm).round() * step_mm;
        }
    }
    position
}
