//! What a user does wrong before the first touch. The logs come from the machine as it is; the program is told what the user
//! believes.

use super::bench::{Act, At, Bench};
use super::forward::{V, Wrong};
use axiscal::axes::AxisName;
use axiscal::diag::Result;
use axiscal::log::{Touch, match_to_plan};
use axiscal::machine::Side;
use axiscal::units::mm_from_inch;
use rand_chacha::ChaCha8Rng;

/// The touches of all runs, or why the program refuses them.
pub type Logs = Result<Vec<Vec<Touch>>>;

/// Makes the logs of a bench whose user made a mistake.
pub type Make = fn(&Bench, &Act, &mut ChaCha8Rng) -> Logs;

/// A mistake with the ids of the effects whose size gives it away.
pub struct Mistake {
    pub what: &'static str,
    pub expects: &'static [&'static str],
    /// The logs that the program reads, or why it refuses them.
    pub make: Make,
    /// The same touches after the user has given the temperatures that the verdict asked for, and the ids that may be named then.
    pub with_temperatures: Option<(Make, &'static [&'static str])>,
}

/// Scatter of a touch and of an index position, µm.
const TOUCH_UM: f64 = 1.0;

pub const MISTAKES: [Mistake; 8] = [
    Mistake {
        what: "ball radius typed 0.05 mm wrong",
        expects: &["pretravel"],
        make: ball_radius,
        with_temperatures: None,
    },
    Mistake {
        what: "pivot or axis 0.5 mm wrong in the machine file",
        expects: &["location-a", "location-b", "location-c", "tool-length"],
        make: pivot,
        with_temperatures: None,
    },
    Mistake {
        what: "tool length 0.3 mm wrong",
        expects: &["tool-length", "location-a", "location-b", "location-c", "block-setup"],
        make: tool_length,
        with_temperatures: None,
    },
    Mistake {
        what: "blocks 0.05 mm larger than in the plan",
        expects: &["block-size", "block-own-size", "pretravel"],
        make: oversize,
        with_temperatures: None,
    },
    Mistake {
        what: "one block turned by 2 degrees",
        expects: &["block-setup"],
        make: turned_block,
        with_temperatures: None,
    },
    Mistake {
        what: "a probe with a ball of 5 mm instead of 6 mm",
        expects: &["pretravel"],
        make: wrong_probe,
        with_temperatures: None,
    },
    Mistake {
        what: "temperature not logged while the frame bends with it",
        expects: &["ambient-bending", "drift-linear", "warm-up"],
        make: |bench, base, rng| bending(bench, base, false, rng),
        with_temperatures: Some((|bench, base, rng| bending(bench, base, true, rng), &["ambient-bending"])),
    },
    Mistake { what: "log in inches", expects: &["inch", "sign-or-axis-swap"], make: inches, with_temperatures: None },
];

fn with(
    bench: &Bench,
    base: &Act,
    act: impl Fn(&At, &mut Wrong) + Send + Sync + 'static,
    rng: &mut ChaCha8Rng,
) -> Logs {
    matched(bench, bench.raw(&[base, &act], TOUCH_UM, 0.0, true, rng))
}

/// The real ball is smaller than the plan's: contact comes later.
fn ball_radius(bench: &Bench, base: &Act, rng: &mut ChaCha8Rng) -> Logs {
    with(bench, base, |_, wrong| wrong.late += 0.05, rng)
}

/// In a head the ball hangs 0.5 mm lower under the axis than the file says, whatever its tool's length is; a table's axis lies 0.5 mm
/// lower.
fn pivot(bench: &Bench, base: &Act, rng: &mut ChaCha8Rng) -> Logs {
    let mut real = bench.clone();
    let head = real.machine.axes.iter().any(|a| a.side == Side::Tool && a.name.is_rotary());
    for axis in real.machine.axes.iter_mut().filter(|a| a.name != AxisName::C && a.name.is_rotary()) {
        axis.point.z += if head { 0.5 } else { -0.5 };
    }
    let raw = real.raw(&[base], TOUCH_UM, 0.0, true, rng);
    matched(bench, raw)
}

fn tool_length(bench: &Bench, base: &Act, rng: &mut ChaCha8Rng) -> Logs {
    let down = -bench.machine.tool.direction.into_inner();
    with(bench, base, move |_, wrong| wrong.in_head += down * 0.3, rng)
}

fn oversize(bench: &Bench, base: &Act, rng: &mut ChaCha8Rng) -> Logs {
    with(bench, base, |_, wrong| wrong.longer += V::repeat(0.05), rng)
}

fn turned_block(bench: &Bench, base: &Act, rng: &mut ChaCha8Rng) -> Logs {
    let act = |at: &At, wrong: &mut Wrong| {
        if at.block == 0 {
            wrong.block_turn.z += 2f64.to_radians();
        }
    };
    with(bench, base, act, rng)
}

fn wrong_probe(bench: &Bench, base: &Act, rng: &mut ChaCha8Rng) -> Logs {
    with(bench, base, |_, wrong| wrong.late += 0.5, rng)
}

fn bending(bench: &Bench, base: &Act, logged: bool, rng: &mut ChaCha8Rng) -> Logs {
    let bends = |at: &At, wrong: &mut Wrong| wrong.tool += V::new(0.6, -0.4, 0.7) * (5e-3 * at.kelvin);
    matched(bench, bench.raw(&[base, &bends], TOUCH_UM, 0.0, logged, rng))
}

fn inches(bench: &Bench, base: &Act, rng: &mut ChaCha8Rng) -> Logs {
    let mut raw = bench.raw(&[base], TOUCH_UM, 0.0, true, rng);
    for touch in raw.iter_mut().flatten() {
        touch.position.0[..3].iter_mut().for_each(|mm| *mm /= mm_from_inch(1.0));
    }
    matched(bench, raw)
}

fn matched(bench: &Bench, raw: Vec<Vec<axiscal::log::RawTouch>>) -> Logs {
    let plans = bench.runs.iter().map(|(plan, _)| plan);
    plans.zip(raw).map(|(plan, raw)| Ok(match_to_plan(&bench.machine, plan, raw)?.0)).collect()
}
