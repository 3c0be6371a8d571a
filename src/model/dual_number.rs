//! Dual numbers: a value and its derivative by one parameter, computed together step by step (forward-mode differentiation). The
//! derivative of a formula is never written out, so that it costs no more than the formula itself.

use super::operators::{One, Two, Value};

/// A value with its derivative.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Dual {
    pub(super) value: f64,
    pub(super) slope: f64,
}

impl Dual {
    /// The parameter by which the derivative is taken.
    pub(super) fn variable(value: f64) -> Self {
        Self { value, slope: 1.0 }
    }
}

impl Value for Dual {
    #[inline]
    fn number(value: f64) -> Self {
        Self { value, slope: 0.0 }
    }

    #[inline]
    fn one(self, of: One) -> Self {
        Self { value: of.at(self.value), slope: chained(self.slope, || of.slope(self.value)) }
    }

    #[inline]
    fn two(self, of: Two, right: Self) -> Self {
        let (a, b) = (self.value, right.value);
        let by_left = chained(self.slope, || of.slope_left(a, b));
        let by_right = chained(right.slope, || of.slope_right(a, b));
        Self { value: of.at(a, b), slope: by_left + by_right }
    }
}

/// The chain rule. What does not depend on the parameter adds nothing, also where the outer derivative is infinite.
#[inline]
fn chained(inner: f64, outer: impl FnOnce() -> f64) -> f64 {
    if inner == 0.0 { 0.0 } else { outer() * inner }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ONES: [One; 14] = [
        One::Negative,
        One::Sin,
        One::Cos,
        One::Tan,
        One::Asin,
        One::Acos,
        One::Atan,
        One::Exp,
        One::Ln,
        One::Sqrt,
        One::Abs,
        One::Sign,
        One::Floor,
        One::Step,
    ];
    const TWOS: [Two; 7] = [Two::Plus, Two::Minus, Two::Times, Two::Over, Two::Power, Two::Atan2, Two::Mod];

    fn close(exact: f64, of: impl Fn(f64) -> f64, x: f64) -> bool {
        let h = 1e-6;
        let difference = (of(x + h) - of(x - h)) / (2.0 * h);
        (exact - difference).abs() <= 1e-8 * exact.abs().max(1.0)
    }

    #[test]
    fn every_derivative_is_that_of_small_differences() {
        for of in ONES {
            for x in [-0.7, 0.3, 0.8] {
                if of.at(x).is_finite() {
                    let dual = Dual::variable(x).one(of);
                    assert!(dual.value == of.at(x) && close(dual.slope, |x| of.at(x), x), "{of:?} {x}: {dual:?}");
                }
            }
        }
        for of in TWOS {
            for (a, b) in [(0.7, 1.3), (2.9, -0.8), (-1.7, 3.0), (1.7, 0.6)] {
                let left = Dual::variable(a).two(of, Dual::number(b));
                assert!(left.value == of.at(a, b) && close(left.slope, |a| of.at(a, b), a), "{of:?} {a} {b}: {left:?}");
                let right = Dual::number(a).two(of, Dual::variable(b));
                if of != Two::Power || a > 0.0 {
                    assert!(close(right.slope, |b| of.at(a, b), b), "{of:?} {a} {b}: {right:?}");
                }
            }
        }
    }

    #[test]
    fn what_does_not_depend_on_the_parameter_adds_nothing() {
        // the square root of 0 has an infinite derivative, and the logarithm of a negative number none
        let root = Dual::number(0.0).one(One::Sqrt);
        assert_eq!(root.two(Two::Times, Dual::variable(2.0)), Dual { value: 0.0, slope: 0.0 });
        assert_eq!(Dual::variable(-2.0).two(Two::Power, Dual::number(3.0)).slope, 12.0);
        assert_eq!(Dual::number(0.0).two(Two::Power, Dual::variable(1.5)).slope, 0.0);
    }
}
