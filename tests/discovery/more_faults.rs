//! What can be wrong with head, probe, blocks and temperature.

use super::bench::Bench;
use super::faults::{Draw, Fault, UM, along, small, unit};
use super::forward::{Slip, V};
use axiscal::axes::AxisName;
use axiscal::machine::Side;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use std::f64::consts::TAU;

pub const FAMILIES: [Draw; 21] = [
    sinking_head,
    leaning_head,
    hanging_stylus,
    three_seats,
    soft_one_way,
    one_late_direction,
    stylus_beside_the_spindle,
    stiff_along,
    slow_control,
    larger_blocks,
    blocks_of_many_sizes,
    oblong_blocks,
    knocked_fixture,
    warm_blocks,
    creep,
    warming_up,
    growing_spindle,
    bending_frame,
    growing_scales,
    wandering_table,
    growing_plate,
];

fn direction(rng: &mut ChaCha8Rng) -> V {
    loop {
        let v = V::from_fn(|_, _| rng.random_range(-1.0..1.0));
        if (0.1..1.0).contains(&v.norm()) {
            return v.normalize();
        }
    }
}

/// The axis that tilts the head: B, else A.
fn tilting(bench: &Bench) -> Option<AxisName> {
    let on_tool = |n: &AxisName| bench.machine.axis(*n).is_some_and(|a| a.side == Side::Tool);
    [AxisName::B, AxisName::A].into_iter().find(on_tool)
}

/// The head sinks as it hangs out, with a power of the overhang.
fn sinking_head(bench: &Bench, rng: &mut ChaCha8Rng) -> Option<Fault> {
    tilting(bench)?;
    let power = rng.random_range(1.0..1.6);
    Some(Fault::new(format!("sinking head, power {power:.1}"), &["head-sag"], move |at, size, wrong| {
        let out = at.spindle.x.hypot(at.spindle.y);
        wrong.tool.z -= 3.0 * UM * size * out.powf(power);
    }))
}

/// The weight of the head turns it on: by itself, or with the ram that carries it, about a bearing above.
fn leaning_head(bench: &Bench, rng: &mut ChaCha8Rng) -> Option<Fault> {
    let name = tilting(bench)?;
    if rng.random_bool(0.5) {
        let above = rng.random_range(50.0..400.0);
        let (about, i) = (bench.machine.reference.pivot + unit(2) * above, name.index());
        let what = format!("head turned by its weight with its ram, about a point {above:.0} mm above the pivot");
        return Some(Fault::new(what, &["head-tilt"], move |at, size, wrong| {
            wrong.before[i].push(Slip::turn(along(name) * (1e-5 * size * at.q[i].sin()), about));
        }));
    }
    Some(Fault::new("head turned by its weight", &["head-tilt"], move |at, size, wrong| {
        wrong.joint[name.index()] += 1e-5 * size * at.q[name.index()].sin();
    }))
}

/// A bar held at one end sinks with a power of its length.
fn hanging_stylus(bench: &Bench, rng: &mut ChaCha8Rng) -> Option<Fault> {
    tilting(bench)?;
    let (power, own) = (rng.random_range(1.7..2.3), bench.machine.tool.length_mm);
    Some(Fault::new(format!("stylus bent by its weight, power {power:.1}"), &["stylus-sag"], move |at, size, wrong| {
        let across = V::new(at.down_in_head.x, at.down_in_head.y, 0.0);
        wrong.in_head += across * (2.0 * UM * size * (at.stylus_mm / own).powf(power));
    }))
}

/// How much of the approach is across the stylus, and in which direction.
fn around(approach: V) -> (f64, f64) {
    (approach.x.hypot(approach.y), approach.y.atan2(approach.x))
}

fn three_seats(_: &Bench, rng: &mut ChaCha8Rng) -> Option<Fault> {
    let seat = rng.random_range(0.0..TAU);
    Some(Fault::new("three seats of the stylus", &["lobing-3"], move |at, size, wrong| {
        let (across, angle) = around(at.approach);
        wrong.late += 2.0 * UM * size * across * (3.0 * (angle - seat)).cos();
    }))
}

fn soft_one_way(_: &Bench, rng: &mut ChaCha8Rng) -> Option<Fault> {
    let soft = rng.random_range(0.0..TAU);
    Some(Fault::new("probe softer in one direction than across it", &["lobing-2"], move |at, size, wrong| {
        let (across, angle) = around(at.approach);
        wrong.late += 2.0 * UM * size * across * (2.0 * (angle - soft)).cos();
    }))
}

/// One of the four directions triggers late, more or less sharply.
fn one_late_direction(_: &Bench, rng: &mut ChaCha8Rng) -> Option<Fault> {
    let (way, power) = (rng.random_range(0..4u8), rng.random_range(1.7..2.5));
    Some(Fault::new("one late direction of the probe", &["pretravel-directions"], move |at, size, wrong| {
        let to = [V::x(), V::y(), -V::x(), -V::y()][usize::from(way)];
        wrong.late += 3.0 * UM * size * at.approach.dot(&to).max(0.0).powf(power);
    }))
}

fn stylus_beside_the_spindle(_: &Bench, rng: &mut ChaCha8Rng) -> Option<Fault> {
    let side = rng.random_range(0.0..TAU);
    Some(Fault::new("ball beside the spindle's line", &["tip-eccentricity"], move |_, size, wrong| {
        wrong.in_spindle += V::new(side.cos(), side.sin(), 0.0) * (4.0 * UM * size);
    }))
}

fn stiff_along(_: &Bench, rng: &mut ChaCha8Rng) -> Option<Fault> {
    let power = rng.random_range(1.6..2.4);
    Some(Fault::new("probe stiffer along the stylus", &["pretravel-axial"], move |at, size, wrong| {
        wrong.late -= 3.0 * UM * size * at.approach.z.abs().powf(power);
    }))
}

fn slow_control(_: &Bench, _: &mut ChaCha8Rng) -> Option<Fault> {
    Some(Fault::new("control that stores late", &["latency"], move |at, size, wrong| {
        wrong.late += 3.0 * UM * size * at.feed_mm_min / 60.0;
    }))
}

fn larger_blocks(_: &Bench, rng: &mut ChaCha8Rng) -> Option<Fault> {
    let edges = direction(rng);
    Some(Fault::new("blocks of another size", &["block-size"], move |_, size, wrong| {
        wrong.longer += edges * (6.0 * UM * size);
    }))
}

/// Every block its own, equal edges or not.
fn blocks_of_many_sizes(_: &Bench, rng: &mut ChaCha8Rng) -> Option<Fault> {
    let cubes = rng.random_bool(0.5);
    let own: Vec<V> = (0..64)
        .map(|_| {
            if cubes { V::repeat(rng.random_range(-1.0..1.0)) } else { V::from_fn(|_, _| rng.random_range(-1.0..1.0)) }
        })
        .collect();
    Some(Fault::new("every block of a size of its own", &["block-own-size"], move |at, size, wrong| {
        wrong.longer += own[at.block % own.len()] * (6.0 * UM * size);
    }))
}

fn oblong_blocks(_: &Bench, _: &mut ChaCha8Rng) -> Option<Fault> {
    Some(Fault::new("blocks longer in x than in y", &["block-shape", "block-size"], move |_, size, wrong| {
        wrong.longer += V::new(4.0, -4.0, 0.0) * (UM * size);
    }))
}

/// The fixture is knocked at some moment.
fn knocked_fixture(_: &Bench, rng: &mut ChaCha8Rng) -> Option<Fault> {
    let (share, shift, turn) = (rng.random_range(0.15..0.85), direction(rng), direction(rng));
    Some(Fault::new("fixture knocked", &["block-slip"], move |at, size, wrong| {
        if at.hours > share * at.hours_of_all {
            wrong.block_shift += shift * (4.0 * UM * size);
            wrong.block_turn += turn * (4e-5 * size);
        }
    }))
}

fn warm_blocks(_: &Bench, rng: &mut ChaCha8Rng) -> Option<Fault> {
    let per_kelvin = rng.random_range(0.5..1.5);
    Some(Fault::new("blocks that grow with the temperature", &["block-temperature"], move |at, size, wrong| {
        wrong.longer += at.edges * (1e-4 * per_kelvin * size * at.kelvin);
    }))
}

/// Slow motion of the column, nearly in proportion to time.
fn creep(_: &Bench, rng: &mut ChaCha8Rng) -> Option<Fault> {
    let (to, power) = (direction(rng), rng.random_range(0.85..1.25));
    Some(Fault::new(format!("drift, power {power:.2} of time"), &["drift-linear"], move |at, size, wrong| {
        wrong.tool += to * (5.0 * UM * size * at.hours.max(0.0).powf(power));
    }))
}

fn warming_up(_: &Bench, rng: &mut ChaCha8Rng) -> Option<Fault> {
    let (to, tau) = (direction(rng), rng.random_range(0.12..1.0));
    Some(Fault::new(format!("warming up in {tau:.2} h"), &["warm-up"], move |at, size, wrong| {
        wrong.tool += to * (6.0 * UM * size * (1.0 - (-at.hours / tau).exp()));
    }))
}

fn growing_spindle(_: &Bench, rng: &mut ChaCha8Rng) -> Option<Fault> {
    let tau = rng.random_range(0.12..1.0);
    Some(Fault::new(format!("spindle growing in {tau:.2} h"), &["spindle-growth"], move |at, size, wrong| {
        // away from the head: against the direction from the ball to the spindle
        wrong.tool -= at.spindle * (6.0 * UM * size * (1.0 - (-at.hours / tau).exp()));
    }))
}

fn bending_frame(_: &Bench, rng: &mut ChaCha8Rng) -> Option<Fault> {
    let to = direction(rng);
    Some(Fault::new("frame bent by the room's temperature", &["ambient-bending"], move |at, size, wrong| {
        wrong.tool += to * (3.0 * UM * size * at.kelvin);
    }))
}

/// Scales that have grown by α·K show q where the axis has gone q·(1 + α·K): table or tool, the axis itself goes further.
fn growing_scales(_: &Bench, _: &mut ChaCha8Rng) -> Option<Fault> {
    Some(Fault::new("scales that grow with the temperature", &["ambient-scale"], move |at, size, wrong| {
        for axis in at.machine.axes.iter().filter(|a| !a.name.is_rotary()) {
            let i = axis.name.index();
            wrong.joint[i] += 1e-5 * size * at.kelvin * at.q[i];
        }
    }))
}

/// The middle of the turntable moves while its drive warms it.
fn wandering_table(bench: &Bench, rng: &mut ChaCha8Rng) -> Option<Fault> {
    bench.machine.axis(AxisName::C).filter(|a| a.side == Side::Workpiece)?;
    let (side, power) = (rng.random_range(0.0..TAU), rng.random_range(0.85..1.2));
    let expects = [format!("centre-drift-{}", small(AxisName::C))];
    Some(Fault::new("centre of C that moves with time", &[&expects[0]], move |at, size, wrong| {
        let to = unit(0) * side.cos() + unit(1) * side.sin();
        let shift = to * (5.0 * UM * size * at.hours.max(0.0).powf(power));
        wrong.before[AxisName::C.index()].push(Slip::shift(shift));
    }))
}

fn growing_plate(_: &Bench, rng: &mut ChaCha8Rng) -> Option<Fault> {
    let power = rng.random_range(0.85..1.2);
    Some(Fault::new("plate that pushes the blocks outward", &["artefact-growth"], move |at, size, wrong| {
        wrong.block_shift += at.outward * (4.0 * UM * size * at.hours.max(0.0).powf(power));
    }))
}
