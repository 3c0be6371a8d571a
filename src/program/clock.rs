//! How long a program takes: a prediction, for the person who waits and for errors that drift with time.
//!
//! The machine's file knows its feeds but not its rapids; ordinary values stand in for them.

use super::path::TouchStep;
use crate::axes::{AxisMap, AxisName};

/// Rapid of a linear axis, mm/min: what machining centres of this size do at the least.
const RAPID_MM_MIN: f64 = 10_000.0;

/// Rapid of a rotary axis, deg/min: 5 turns a minute.
const ROTARY_DEG_MIN: f64 = 1_800.0;

/// Clamping and settling after a rotary axis has moved, s.
const SETTLE_S: f64 = 2.0;

/// Starting, stopping and reading a block, s, each move.
const MOVE_S: f64 = 0.2;

/// Stopping at the trigger and writing the log, s, each touch.
const TOUCH_S: f64 = 0.5;

/// A person puts up other blocks, s: assumed.
const MOUNTING_S: f64 = 600.0;

/// A person changes the stylus, s: assumed.
const STYLUS_S: f64 = 300.0;

const SECONDS_PER_MINUTE: f64 = 60.0;

/// Time since the program began.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Clock {
    /// s
    pub(super) seconds: f64,
    /// Of which a person needs, s.
    pub(super) waiting: f64,
}

impl Clock {
    fn add(&mut self, way: f64, per_minute: f64) {
        self.seconds += way / per_minute * SECONDS_PER_MINUTE + MOVE_S;
    }

    /// A rapid of linear axes, mm.
    pub(super) fn rapid(&mut self, way_mm: f64) {
        self.add(way_mm, RAPID_MM_MIN);
    }

    /// A move of a rotary axis, deg.
    pub(super) fn rotary(&mut self, way_deg: f64) {
        self.add(way_deg, ROTARY_DEG_MIN);
        self.seconds += SETTLE_S;
    }

    /// A move at a feed, mm and mm/min.
    pub(super) fn feed(&mut self, way_mm: f64, feed_mm_min: f64) {
        self.add(way_mm, feed_mm_min);
    }

    /// The program stands while blocks or stylus are changed.
    pub(super) fn stop(&mut self, blocks: bool, stylus: bool) {
        let waiting = if blocks { MOUNTING_S } else { 0.0 } + if stylus { STYLUS_S } else { 0.0 };
        self.seconds += waiting;
        self.waiting += waiting;
    }

    /// A touch up to its measuring trigger.
    pub(super) fn touch(&mut self, touch: &TouchStep) {
        self.add(distance_mm(&touch.start, &touch.nominal), touch.search_feed);
        self.add(touch.back_off_mm, touch.search_feed);
        self.add(touch.back_off_mm, touch.measure_feed);
        self.seconds += TOUCH_S;
    }

    /// To a hundredth of a second: more digits would pretend to be known.
    pub(super) fn rounded_s(&self) -> f64 {
        (self.seconds * 100.0).round() / 100.0
    }
}

/// Way between two places of the linear axes, mm.
pub(super) fn distance_mm(from: &AxisMap, to: &AxisMap) -> f64 {
    [AxisName::X, AxisName::Y, AxisName::Z]
        .into_iter()
        .filter_map(|a| Some(to.get(a)? - from.get(a)?))
        .map(|d| d * d)
        .sum::<f64>()
        .sqrt()
}
