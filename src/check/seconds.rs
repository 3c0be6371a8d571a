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

/// A clock that goes on with what a program does; it stands while the program waits for a person.
#[derive(Debug, Clone, Copy, Default)]
pub struct Clock {
    /// Since the program began, s.
    pub seconds: f64,
    /// The last move was a turn: one that is cut into steps settles once.
    turning: bool,
}

/// Seconds without the time in which the program waits for a person.
pub fn seconds(trunk: &[Happened]) -> f64 {
    let mut clock = Clock::default();
    trunk.iter().for_each(|h| clock.pass(&h.event));
    // to a tenth: more digits would pretend to be known
    (clock.seconds * 10.0).round() / 10.0
}

impl Clock {
    /// Something happens. The way of an axis from an unknown place counts nothing: the same run takes the same time wherever it finds
    /// the machine.
    pub fn pass(&mut self, event: &Event) {
        const PER_MINUTE: f64 = 60.0;
        let way = |a: &Position, b: &Position| (b.xyz_mm() - a.xyz_mm()).norm();
        let went_on = std::mem::take(&mut self.turning);
        self.seconds += match event {
            Event::Move { from, to, rate, known, .. } => {
                let mut end = *from;
                AxisName::ALL.into_iter().filter(|a| known[a.index()]).for_each(|a| end.set(a, to.get(a)));
                let rotary = AxisName::ALL.into_iter().filter(|a| a.is_rotary());
                let turn = rotary.map(|a| (end.get(a) - from.get(a)).abs()).fold(0.0, f64::max);
                self.turning = turn > 0.0;
                let speed = if let Rate::Feed(feed) = rate { *feed } else { RAPID_MM_MIN };
                let settling = if self.turning && !went_on { SETTLE_S } else { 0.0 };
                way(from, &end) / speed * PER_MINUTE + turn / ROTARY_DEG_MIN * PER_MINUTE + settling + MOVE_S
            }
            Event::Probe { probe, outcome, .. } => {
                way(&probe.from, &probe.to) * outcome.part / probe.feed * PER_MINUTE + MOVE_S
            }
            Event::Release { from, to } => way(from, to) / RAPID_MM_MIN * PER_MINUTE + MOVE_S,
            Event::Log(_) => LINE_S,
            _ => 0.0,
        };
    }
}
