//! How long a program runs: its moves at their feeds, and ordinary values for what the program does not say.

use super::run::{Event, Happened, Rate};
use crate::axes::{AxisName, Position};

/// Rapid of a linear axis, mm/min: what machining centres of this size do at the least.
const RAPID_MM_MIN: f64 = 10_000.0;
/// Rapid of a rotary axis, deg/min.
const ROTARY_DEG_MIN: f64 = 1_800.0;
/// Clamping and settling after a rotary axis has moved, s.
const SETTLE_S: f64 = 2.0;
/// Starting, stopping and reading a block, s.
const MOVE_S: f64 = 0.2;
/// Writing a line of the log, s.
const LINE_S: f64 = 0.5;

/// Seconds without the time in which the program waits for a person.
pub fn seconds(trunk: &[Happened]) -> f64 {
    const PER_MINUTE: f64 = 60.0;
    let way = |a: &Position, b: &Position| (b.xyz_mm() - a.xyz_mm()).norm();
    let turn = |a: &Position, b: &Position| {
        AxisName::ALL.into_iter().filter(|x| x.is_rotary()).map(|x| (b.get(x) - a.get(x)).abs()).fold(0.0, f64::max)
    };
    let mut sum = 0.0;
    for happened in trunk {
        sum += match &happened.event {
            Event::Move { from, to, rate, .. } => {
                let speed = if let Rate::Feed(feed) = rate { *feed } else { RAPID_MM_MIN };
                let (way, turn) = (way(from, to), turn(from, to));
                let turning = if turn > 0.0 { turn / ROTARY_DEG_MIN * PER_MINUTE + SETTLE_S } else { 0.0 };
                way / speed * PER_MINUTE + turning + MOVE_S
            }
            Event::Probe { probe, outcome, .. } => {
                way(&probe.from, &probe.to) * outcome.part / probe.feed * PER_MINUTE + MOVE_S
            }
            Event::Release { from, to } => way(from, to) / RAPID_MM_MIN * PER_MINUTE + MOVE_S,
            Event::Log(_) => LINE_S,
            _ => 0.0,
        };
    }
    // to a tenth: more digits would pretend to be known
    (sum * 10.0).round() / 10.0
}
