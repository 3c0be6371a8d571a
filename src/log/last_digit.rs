//! The last digit of a log, from its positions.

use crate::axes::{AxisName, Position};
use crate::units::mm_from_inch;

/// The coarsest step, mm, of which every position of the linear axes is a multiple: decimal fractions of a millimetre or of an
/// inch. None where there is none down to a nanometre: nothing is lost that a touch would show.
#[must_use]
pub fn digit_mm(positions: impl Iterator<Item = Position> + Clone) -> Option<f64> {
    const STEPS: [f64; 7] = [1e-2, 5e-3, 2e-3, 1e-3, 1e-4, 1e-5, 1e-6];
    let steps = STEPS.iter().flat_map(|&s| [s, mm_from_inch(0.1 * s)]);
    let mut steps: Vec<f64> = steps.collect();
    steps.sort_by(|a, b| b.total_cmp(a));
    let linear = || positions.clone().flat_map(|p| [AxisName::X, AxisName::Y, AxisName::Z].map(|a| p.get(a)));
    steps.into_iter().find(|step| {
        // as far as the digits of a coordinate of machine size go
        linear().all(|x| (x / step - (x / step).round()).abs() * step < 1e-9 + 1e-14 * x.abs())
    })
}

#[cfg(test)]
mod tests {
    use super::digit_mm;
    use crate::axes::Position;

    fn common_digit(places: &[f64]) -> Option<f64> {
        let at = |&x: &f64| {
            let mut p = Position::default();
            p.0[..3].copy_from_slice(&[x, 2.0 * x, -x]);
            p
        };
        digit_mm(places.iter().map(at))
    }

    #[test]
    fn the_last_digit_of_a_log() {
        assert_eq!(common_digit(&[1.234, -200.001, 17.0]), Some(1e-3));
        assert_eq!(common_digit(&[1.2345, 17.0]), Some(1e-4));
        assert_eq!(common_digit(&[1.234_567, 17.0]), Some(1e-6));
        assert_eq!(common_digit(&[1.234_567_8, 17.0]), None);
        // 0.1234 and 3.0001 inches
        let inches = common_digit(&[0.1234 * 25.4, 3.0001 * 25.4]).unwrap();
        assert!((inches - 0.00254).abs() < 1e-12, "{inches}");
    }
}
