//! What can be wrong with the machine's axes: each fault has a formula of its own, drawn at random.

use super::bench::{Act, At, Bench};
use super::forward::{Slip, V, Wrong};
use axiscal::axes::AxisName;
use axiscal::machine::{Axis, Side};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use std::f64::consts::TAU;
use std::sync::Arc;

/// A fault at a size.
type Sizable = dyn Fn(&At, f64, &mut Wrong) + Send + Sync;

/// A hidden fault.
#[derive(Clone)]
pub struct Fault {
    /// What it is, in words.
    pub what: String,
    /// Ids under which the program may name it.
    pub expects: Vec<String>,
    /// The fault at size 1, which is some µm at the ball.
    act: Arc<Sizable>,
}

impl Fault {
    pub fn new(
        what: impl Into<String>,
        expects: &[&str],
        act: impl Fn(&At, f64, &mut Wrong) + Send + Sync + 'static,
    ) -> Self {
        Self { what: what.into(), expects: expects.iter().map(|id| (*id).to_owned()).collect(), act: Arc::new(act) }
    }

    pub fn at_size(&self, size: f64) -> Box<Act> {
        let act = self.act.clone();
        Box::new(move |at: &At, wrong: &mut Wrong| act(at, size, wrong))
    }
}

pub const UM: f64 = 1e-3;
/// A turn that moves what is 100 mm away by 1 µm, rad.
pub const TURN: f64 = 1e-5;

/// A family of faults: `None` where the machine cannot have it.
pub type Draw = fn(&Bench, &mut ChaCha8Rng) -> Option<Fault>;

/// All families.
pub fn families() -> Vec<Draw> {
    let axes: [Draw; 21] = [
        wobble,
        wobble,
        run_out,
        axial_motion,
        graduation,
        gear_ratio,
        rotary_play,
        wind_up,
        clamp,
        homed_again,
        lost_position,
        ring_and_bearing,
        screw_scale,
        warm_end,
        screw_turn,
        lost_motion,
        not_square,
        bent_guideway,
        leaning_carriage,
        bowed_guideway,
        sinking_table,
    ];
    axes.into_iter().chain(super::more_faults::FAMILIES).collect()
}

/// A fault at random.
pub fn draw(bench: &Bench, rng: &mut ChaCha8Rng) -> Fault {
    let all = families();
    loop {
        if let Some(fault) = all[rng.random_range(0..all.len())](bench, rng) {
            return fault;
        }
    }
}

pub fn small(name: AxisName) -> char {
    name.letter().to_ascii_lowercase()
}

fn pick<'a>(bench: &'a Bench, rotary: bool, rng: &mut ChaCha8Rng) -> &'a Axis {
    let axes: Vec<&Axis> = bench.machine.axes.iter().filter(|a| a.name.is_rotary() == rotary).collect();
    axes[rng.random_range(0..axes.len())]
}

/// Directions of R: along the axis and across it.
pub fn along(axis: AxisName) -> V {
    unit(axis.index() % 3)
}

pub fn unit(k: usize) -> V {
    V::from_fn(|i, _| f64::from(i == k))
}

/// A direction across an axis.
fn across(axis: AxisName, angle: f64) -> V {
    let k = axis.index() % 3;
    unit((k + 1) % 3) * angle.cos() + unit((k + 2) % 3) * angle.sin()
}

/// The point of an axis's line that is nearest to the ball at zero.
fn foot(axis: &Axis, bench: &Bench) -> V {
    let u = axis.direction.into_inner();
    match axis.side {
        Side::Tool => axis.point,
        Side::Workpiece => axis.point + u * u.dot(&(bench.machine.reference.ball - axis.point)),
    }
}

/// 50 to 400 mm to either side.
fn far(rng: &mut ChaCha8Rng) -> f64 {
    rng.random_range(50.0..400.0) * if rng.random_bool(0.5) { 1.0 } else { -1.0 }
}

fn order(rng: &mut ChaCha8Rng) -> f64 {
    f64::from(rng.random_range(1..4u8))
}

/// The axis line tilts to and fro, about a bearing that is somewhere along it.
fn wobble(bench: &Bench, rng: &mut ChaCha8Rng) -> Option<Fault> {
    let axis = pick(bench, true, rng);
    let (name, k, arm) = (axis.name, order(rng), far(rng));
    let about = foot(axis, bench) + along(name) * arm;
    let (side, phases) = (rng.random_range(0.0..TAU), [rng.random_range(0.0..TAU), rng.random_range(0.0..TAU)]);
    let second = rng.random_range(0.0..1.0);
    let what = format!("wobble of {name}, {k} per turn, about a bearing {arm:.0} mm from the blocks");
    Some(Fault::new(what, &[&format!("tilt-{}-{k}", small(name))], move |at, size, wrong| {
        let q = at.q[name.index()];
        let turn = across(name, side) * (k * q + phases[0]).cos()
            + across(name, side + TAU / 4.0) * second * (k * q + phases[1]).cos();
        wrong.before[name.index()].push(Slip::turn(turn * TURN * size, about));
    }))
}

/// The centre of rotation goes along an ellipse or a line.
fn run_out(bench: &Bench, rng: &mut ChaCha8Rng) -> Option<Fault> {
    let name = pick(bench, true, rng).name;
    let k = order(rng);
    let (side, phase, second) = (rng.random_range(0.0..TAU), rng.random_range(0.0..TAU), rng.random_range(-0.6..0.6));
    let expects = [format!("radial-{}-{k}", small(name))];
    Some(Fault::new(format!("radial run-out of {name}, {k} per turn"), &[&expects[0]], move |at, size, wrong| {
        let angle = k * at.q[name.index()] + phase;
        let shift = across(name, side) * angle.cos() + across(name, side + TAU / 4.0) * second * angle.sin();
        wrong.before[name.index()].push(Slip::shift(shift * UM * size));
    }))
}

fn axial_motion(bench: &Bench, rng: &mut ChaCha8Rng) -> Option<Fault> {
    let name = pick(bench, true, rng).name;
    let (k, phase) = (order(rng), rng.random_range(0.0..TAU));
    let expects = [format!("axial-{}-{k}", small(name))];
    Some(Fault::new(format!("axial motion of {name}, {k} per turn"), &[&expects[0]], move |at, size, wrong| {
        let shift = along(name) * (k * at.q[name.index()] + phase).cos();
        wrong.before[name.index()].push(Slip::shift(shift * UM * size));
    }))
}

/// The encoder's lines are not evenly spaced.
fn graduation(bench: &Bench, rng: &mut ChaCha8Rng) -> Option<Fault> {
    let axis = pick(bench, true, rng);
    let (name, k, phase, about) = (axis.name, order(rng), rng.random_range(0.0..TAU), axis.point);
    // a wave of the angle with its zero at the zero of a head is what the head's weight does
    let expects = [format!("positioning-{}-{k}", small(name))];
    Some(Fault::new(format!("graduation of {name}, {k} per turn"), &[&expects[0]], move |at, size, wrong| {
        let turn = along(name) * (k * at.q[name.index()] + phase).cos();
        wrong.before[name.index()].push(Slip::turn(turn * TURN * size, about));
    }))
}

fn gear_ratio(bench: &Bench, rng: &mut ChaCha8Rng) -> Option<Fault> {
    let name = pick(bench, true, rng).name;
    let expects = [format!("positioning-{}-linear", small(name))];
    Some(Fault::new(format!("gear ratio of {name}"), &[&expects[0]], move |at, size, wrong| {
        wrong.joint[name.index()] += TURN * size * at.q[name.index()];
    }))
}

fn rotary_play(bench: &Bench, rng: &mut ChaCha8Rng) -> Option<Fault> {
    let name = pick(bench, true, rng).name;
    let expects = [format!("backlash-{}", small(name))];
    Some(Fault::new(format!("play of the gear of {name}"), &[&expects[0]], move |at, size, wrong| {
        wrong.joint[name.index()] -= TURN * size * at.direction[name.index()];
    }))
}

/// The lag saturates over an angle; over a small one it is backlash.
fn wind_up(bench: &Bench, rng: &mut ChaCha8Rng) -> Option<Fault> {
    let name = pick(bench, true, rng).name;
    let over = rng.random_range(8f64..60.0).to_radians();
    let expects = [format!("windup-{}", small(name))];
    let what = format!("wind-up of {name} over {:.0} deg", over.to_degrees());
    Some(Fault::new(what, &[&expects[0]], move |at, size, wrong| {
        let way = at.since_reversal[name.index()];
        wrong.joint[name.index()] -= TURN * size * way.signum() * (1.0 - (-way.abs() / over).exp());
    }))
}

/// The clamped axis falls to the side where its load hangs.
fn clamp(bench: &Bench, rng: &mut ChaCha8Rng) -> Option<Fault> {
    let axis = pick(bench, true, rng);
    let name = axis.name;
    if name == AxisName::C {
        return None;
    }
    let sharp = rng.random_range(0.002..0.02);
    let expects = [format!("clamp-play-{}", small(name))];
    Some(Fault::new(format!("play in the clamp of {name}"), &[&expects[0]], move |at, size, wrong| {
        let torque = at.q[name.index()].sin();
        wrong.joint[name.index()] += TURN * size * (torque / sharp).tanh();
    }))
}

fn homed_again(bench: &Bench, rng: &mut ChaCha8Rng) -> Option<Fault> {
    let name = pick(bench, true, rng).name;
    if bench.runs.len() < 2 {
        return None;
    }
    let expects = [format!("rehomed-{}", small(name))];
    Some(Fault::new(format!("{name} homed again between the runs"), &[&expects[0]], move |at, size, wrong| {
        wrong.joint[name.index()] += TURN * size * at.run as f64;
    }))
}

/// A coupling slips at some moment.
fn lost_position(bench: &Bench, rng: &mut ChaCha8Rng) -> Option<Fault> {
    let rotary = rng.random_bool(0.5);
    let name = pick(bench, rotary, rng).name;
    let share = rng.random_range(0.15..0.85);
    let off = if rotary { TURN } else { UM };
    let expects = [format!("lost-position-{}", small(name))];
    Some(Fault::new(format!("{name} that lost its position"), &[&expects[0]], move |at, size, wrong| {
        if at.hours > share * at.hours_of_all {
            wrong.joint[name.index()] += 4.0 * off * size;
        }
    }))
}

/// The bearing wanders along a line once per turn, and the one reading head, on a ring of its own radius, takes the part along the
/// ring for an angle.
fn ring_and_bearing(bench: &Bench, rng: &mut ChaCha8Rng) -> Option<Fault> {
    let axis = pick(bench, true, rng);
    let (name, about) = (axis.name, axis.point);
    let ring_mm = rng.random_range(50.0..150.0);
    let (side, head, phase) = (rng.random_range(0.0..TAU), rng.random_range(0.0..TAU), rng.random_range(0.0..TAU));
    let expects = [format!("encoder-eccentricity-{}", small(name))];
    let what = format!("run-out of {name} that its encoder on a ring of {ring_mm:.0} mm reads");
    Some(Fault::new(what, &[&expects[0]], move |at, size, wrong| {
        let wander = across(name, side) * (at.q[name.index()] + phase).cos() * UM * size;
        let past_the_head = wander.dot(&along(name).cross(&across(name, head)));
        wrong.before[name.index()].push(Slip::shift(wander));
        wrong.before[name.index()].push(Slip::turn(along(name) * (-past_the_head / ring_mm), about));
    }))
}

/// The scale counts too much: the axis goes less far than it shows, whatever it bears.
fn screw_scale(bench: &Bench, rng: &mut ChaCha8Rng) -> Option<Fault> {
    let name = pick(bench, false, rng).name;
    let expects = [format!("scale-{}", small(name))];
    Some(Fault::new(format!("scale of {name}"), &[&expects[0]], move |at, size, wrong| {
        wrong.joint[name.index()] += TURN * size * at.q[name.index()];
    }))
}

/// One end of the screw is warm.
fn warm_end(bench: &Bench, rng: &mut ChaCha8Rng) -> Option<Fault> {
    let name = pick(bench, false, rng).name;
    let power = rng.random_range(1.8..2.2);
    let expects = [format!("positioning-{}-2", small(name))];
    Some(Fault::new(format!("curved scale of {name}, power {power:.1}"), &[&expects[0]], move |at, size, wrong| {
        wrong.joint[name.index()] += 4.0 * UM * size * (at.q[name.index()].abs() / 150.0).powf(power);
    }))
}

fn screw_turn(bench: &Bench, rng: &mut ChaCha8Rng) -> Option<Fault> {
    let name = pick(bench, false, rng).name;
    let (pitch, phase) = (rng.random_range(5.0..16.0), rng.random_range(0.0..TAU));
    let expects = [format!("pitch-{}", small(name))];
    Some(Fault::new(format!("screw of {name}, {pitch:.1} mm per turn"), &[&expects[0]], move |at, size, wrong| {
        wrong.joint[name.index()] += UM * size * (TAU * at.q[name.index()] / pitch + phase).sin();
    }))
}

fn lost_motion(bench: &Bench, rng: &mut ChaCha8Rng) -> Option<Fault> {
    let name = pick(bench, false, rng).name;
    let expects = [format!("backlash-{}", small(name))];
    Some(Fault::new(format!("lost motion of {name}"), &[&expects[0]], move |at, size, wrong| {
        wrong.joint[name.index()] -= UM * size * at.direction[name.index()];
    }))
}

/// What a linear axis carries is moved by this much to the side of positive NC motion: a table the other way.
fn carried(axis: &Axis) -> f64 {
    if axis.side == Side::Workpiece { -1.0 } else { 1.0 }
}

fn not_square(bench: &Bench, rng: &mut ChaCha8Rng) -> Option<Fault> {
    let (name, to, id) = [
        (AxisName::Y, V::x(), "squareness-xy"),
        (AxisName::Z, V::y(), "squareness-yz"),
        (AxisName::Z, V::x(), "squareness-zx"),
    ][rng.random_range(0..3)];
    let way = carried(bench.machine.axis(name)?);
    Some(Fault::new(format!("{name} not square, {id}"), &[id], move |at, size, wrong| {
        wrong.after[name.index()].push(Slip::shift(to * (TURN * size * way * at.q[name.index()])));
    }))
}

/// The guideway is bent to the side: a bow and an S.
fn bent_guideway(bench: &Bench, rng: &mut ChaCha8Rng) -> Option<Fault> {
    let name = pick(bench, false, rng).name;
    let to = (name.index() + rng.random_range(1..3usize)) % 3;
    let (bow, s) = (rng.random_range(-1.0..1.0), rng.random_range(-1.0..1.0));
    let expects = [format!("straightness-{}{}", ['x', 'y', 'z'][to], small(name))];
    Some(Fault::new(format!("bent guideway of {name}"), &[&expects[0]], move |at, size, wrong| {
        let u = at.q[name.index()] / 150.0;
        let off = 4.0 * UM * size * (bow * u * u + s * u * u * u);
        wrong.after[name.index()].push(Slip::shift(unit(to) * off));
    }))
}

/// The carriage turns about itself, 50 to 400 mm from the ball, in proportion to its way.
fn leaning_carriage(bench: &Bench, rng: &mut ChaCha8Rng) -> Option<Fault> {
    let name = pick(bench, false, rng).name;
    let turn = rng.random_range(0..3usize);
    let arm = far(rng);
    // along a direction across the turn: along the turn it would act nowhere
    let to = (turn + rng.random_range(1..3usize)) % 3;
    let about = bench.machine.reference.ball + unit(to) * arm;
    let expects = [format!("angular-{}{}", ['a', 'b', 'c'][turn], small(name))];
    let what = format!(
        "turn of the carriage of {name} about {}, {arm:.0} mm away along {}",
        ["X", "Y", "Z"][turn],
        ["X", "Y", "Z"][to]
    );
    Some(Fault::new(what, &[&expects[0]], move |at, size, wrong| {
        let angle = TURN * size * at.q[name.index()] / 150.0;
        wrong.after[name.index()].push(Slip::turn(unit(turn) * angle, about));
    }))
}

/// The guideway is bowed upwards: the carriage sinks with the square of its way and leans by the slope, about itself.
fn bowed_guideway(bench: &Bench, rng: &mut ChaCha8Rng) -> Option<Fault> {
    let axis = pick(bench, false, rng);
    let name = axis.name;
    if name == AxisName::Z {
        return None;
    }
    let arm = -rng.random_range(50.0..400.0);
    let way = carried(axis);
    let about = bench.machine.reference.ball + V::z() * arm;
    let expects = [format!("carriage-sag-{}", small(name))];
    Some(Fault::new(
        format!("bowed guideway of {name}, {:.0} mm below the ball", -arm),
        &[&expects[0]],
        move |at, size, wrong| {
            // where the carriage stands in R
            let u = way * at.q[name.index()] / 150.0;
            let slope = -2.0 * u / 150.0;
            // what leans along its way by dz/du turns about the other horizontal direction
            let turn = unit(name.index()).cross(&V::z()) * (4.0 * UM * size * slope);
            let shift = V::z() * (-4.0 * UM * size * u * u);
            wrong.after[name.index()].push(Slip { shift, turn, about });
        },
    ))
}

/// The table sinks towards the ends of its travel, as a bowl.
fn sinking_table(bench: &Bench, rng: &mut ChaCha8Rng) -> Option<Fault> {
    let axes: Vec<AxisName> = [AxisName::X, AxisName::Y]
        .into_iter()
        .filter(|n| bench.machine.axis(*n).is_some_and(|a| a.side == Side::Workpiece))
        .collect();
    let last = *axes.last()?;
    let power = rng.random_range(1.8..2.2);
    Some(Fault::new(format!("sinking table, power {power:.1}"), &["table-sag"], move |at, size, wrong| {
        let r = axes.iter().map(|n| (at.q[n.index()] / 150.0).powi(2)).sum::<f64>().sqrt();
        wrong.after[last.index()].push(Slip::shift(V::z() * (-4.0 * UM * size * r.powf(power))));
    }))
}
