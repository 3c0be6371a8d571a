//! When the spindle ran during the measurements: it warms while it runs and cools while it stands.

use super::formula::{State, slot};
use crate::units::hours_from_s;

/// So many stretches a formula can look back on.
pub const MOST_STRETCHES: usize = 4;

/// A stretch of time in which the spindle ran.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SpindleStretch {
    /// From here on, s on the study's clock …
    pub from_s: f64,
    /// … to here.
    pub to_s: f64,
    pub rpm: f64,
}

/// What formulas see of the spindle at a touch made so many hours after the first one, which was made at `first_s`: of each stretch
/// that has begun, the latest first, its speed over the highest of all, when it began and when it ended, if it has.
/// Without stretches the spindle has run since the first touch.
pub(super) fn put_into(state: &mut State, stretches: &[SpindleStretch], first_s: f64) {
    let now = state[slot::HOURS];
    let mut seen = [0.0; 3 * MOST_STRETCHES];
    if stretches.is_empty() {
        seen[..3].copy_from_slice(&[1.0, 0.0, now]);
    }
    let highest = stretches.iter().map(|s| s.rpm).fold(0.0, f64::max);
    let hours = |s: f64| hours_from_s(s - first_s);
    let mut begun: Vec<&SpindleStretch> = stretches.iter().filter(|s| hours(s.from_s) < now && s.rpm > 0.0).collect();
    begun.sort_by(|a, b| b.from_s.total_cmp(&a.from_s));
    for (three, stretch) in seen.chunks_exact_mut(3).zip(begun) {
        three.copy_from_slice(&[stretch.rpm / highest, hours(stretch.from_s), hours(stretch.to_s).min(now)]);
    }
    state[slot::SPINDLE_RUNS..slot::SPINDLE_RUNS + 3 * MOST_STRETCHES].copy_from_slice(&seen);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::formula::{Formula, VARIABLES};

    /// The first stretch's part of the built-in growth, and what a stretch behind it adds.
    const GROWTH: &str =
        "speed1*(exp(-(t - off1)/tau) - exp(-(t - on1)/tau)) + speed2*(exp(-(t - off2)/tau) - exp(-(t - on2)/tau))";

    #[test]
    fn a_spindle_that_runs_on_grows_as_before_and_one_that_stands_shrinks() {
        let growth = Formula::parse(GROWTH, &["tau"]).unwrap();
        let at = |hours: f64, stretches: &[SpindleStretch]| {
            let mut state = [0.0; VARIABLES.len()];
            state[slot::HOURS] = hours;
            put_into(&mut state, stretches, 100.0);
            growth.eval(&state, &[0.5])
        };
        // 1 - exp(-2)
        assert!((at(1.0, &[]) - 0.864_664_716_8).abs() < 1e-9);
        // half an hour at full speed, from the first touch on: then it cools. After one hour (1 - 1/e)/e = 0.232 544 157 9
        let stretch = |from_h: f64, to_h: f64, rpm| SpindleStretch {
            from_s: 100.0 + 3600.0 * from_h,
            to_s: 100.0 + 3600.0 * to_h,
            rpm,
        };
        let once = [stretch(0.0, 0.5, 9000.0)];
        assert!((at(0.5, &once) - 0.632_120_558_8).abs() < 1e-9);
        assert!((at(1.0, &once) - 0.232_544_157_9).abs() < 1e-9);
        // and again at half the speed: 0.5 (1 - 1/e) more after half an hour, the rest shrunk by e once more
        let twice = [once[0], stretch(1.0, 2.0, 4500.0)];
        assert!((at(1.5, &twice) - (0.232_544_157_9 / std::f64::consts::E + 0.316_060_279_4)).abs() < 1e-9);
        assert_eq!(at(0.0, &[stretch(1.0, 2.0, 100.0)]), 0.0);
    }
}
