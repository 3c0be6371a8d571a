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
    let sum: f64 = trunk.iter().map(|h| event_s(&h.event)).sum();
    // to a tenth: more digits would pretend to be known
    (sum * 10.0).round() / 10.0
}

/// How long one event takes, s. The way of an axis from an unknown place counts nothing: the same run takes the same time
/// wherever it finds the machine.
pub fn event_s(event: &Event) -> f64 {
    const PER_MINUTE: f64 = 60.0;
    let way = |a: &Position, b: &Position| (b.xyz_mm() - a.xyz_mm()).norm();
    match event {
        Event::Move { from, to, rate, known, .. } => {
            let mut end = *from;
            AxisName::ALL.into_iter().filter(|a| known[a.index()]).for_each(|a| end.set(a, to.get(a)));
            let rotary = AxisName::ALL.into_iter().filter(|a| a.is_rotary());
            let turn = rotary.map(|a| (end.get(a) - from.get(a)).abs()).fold(0.0, f64::max);
            let speed = if let Rate::Feed(feed) = rate { *feed } else { RAPID_MM_MIN };
            let turning = if turn > 0.0 { turn / ROTARY_DEG_MIN * PER_MINUTE + SETTLE_S } else { 0.0 };
            way(from, &end) / speed * PER_MINUTE + turning + MOVE_S
        }
        Event::Probe { probe, outcome, .. } => {
            way(&probe.from, &probe.to) * outcome.part / probe.feed * PER_MINUTE + MOVE_S
        }
        Event::Release { from, to } => way(from, to) / RAPID_MM_MIN * PER_MINUTE + MOVE_S,
        Event::Log(_) => LINE_S,
        _ => 0.0,
    }
}
