//! The temperatures of the touches, where a log has some and lacks others.

use super::data::Run;
use crate::units::hours_from_s;

/// A touch without a temperature takes that of the readings around it where one is nearer than this, h: a room does not turn
/// in a quarter of an hour.
pub const NEAR_H: f64 = 0.25;

/// Touches without a temperature while others have one.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct TemperatureGap {
    /// So many touches have none …
    pub missing: usize,
    /// … of so many.
    pub of: usize,
    /// For so many no reading is near: no temperature is used at all. Else the readings around them are used.
    pub far: usize,
}

/// Temperatures of the touches of each run, °C, as the model takes them; `None` where no effect of temperature is to be seen.
pub(super) type Temperatures = Vec<Vec<Option<f64>>>;

/// Of all runs, with the touches that lack one. Readings near in time fill a gap; where that cannot be, no
/// temperature is used at all: 20 °C in the middle of a warm hour would be a jump that nothing made.
pub(super) fn of_runs(runs: &[Run]) -> (Temperatures, Option<TemperatureGap>) {
    let read = |run: &Run| -> Vec<Option<f64>> { run.touches.iter().map(|t| t.temperature_deg_c).collect() };
    let as_read: Temperatures = runs.iter().map(read).collect();
    let all = as_read.iter().map(Vec::len).sum::<usize>();
    let missing = as_read.iter().flatten().filter(|t| t.is_none()).count();
    if missing == 0 || missing == all {
        return (as_read, None);
    }
    let filled: Temperatures = runs.iter().map(filled).collect();
    let far = filled.iter().flatten().filter(|t| t.is_none()).count();
    if far == 0 {
        return (filled, Some(TemperatureGap { missing, of: all, far }));
    }
    (as_read.iter().map(|run| vec![None; run.len()]).collect(), Some(TemperatureGap { missing, of: all, far }))
}

fn filled(run: &Run) -> Vec<Option<f64>> {
    let numbered = run.plan.numbered();
    let hours = |i: usize| {
        let touch = &run.touches[i];
        let planned = || numbered.touch(touch.id).and_then(|p| p.time_s);
        touch.time_s.or_else(planned).map(hours_from_s)
    };
    let at: Vec<Option<f64>> = (0..run.touches.len()).map(hours).collect();
    let reading = |i: usize| Some((at[i]?, run.touches[i].temperature_deg_c?));
    (0..run.touches.len())
        .map(|i| {
            run.touches[i].temperature_deg_c.or_else(|| {
                let now = at[i]?;
                let before = (0..i).rev().find_map(reading).filter(|r| now - r.0 <= NEAR_H);
                let after = (i + 1..run.touches.len()).find_map(reading).filter(|r| r.0 - now <= NEAR_H);
                match (before, after) {
                    (Some((t0, a)), Some((t1, b))) if t1 > t0 => {
                        Some(a + (b - a) * ((now - t0) / (t1 - t0)).clamp(0.0, 1.0))
                    }
                    (one, other) => one.or(other).map(|r| r.1),
                }
            })
        })
        .collect()
}
