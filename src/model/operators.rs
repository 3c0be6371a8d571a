//! The operators and functions of formulas (docs/guide/effects.md) with their derivatives.

use std::f64::consts::PI;

/// Functions of one value.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[allow(missing_docs)]
pub(super) enum One {
    Negative,
    Sin,
    Cos,
    Tan,
    Asin,
    Acos,
    Atan,
    Exp,
    Ln,
    Sqrt,
    Abs,
    Sign,
    Floor,
    Step,
}

/// Operators, and functions of two values.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[allow(missing_docs)]
pub(super) enum Two {
    Plus,
    Minus,
    Times,
    Over,
    Power,
    Atan2,
    Mod,
}

/// What a formula can be computed with: numbers, and numbers that carry a derivative (`dual`).
pub(super) trait Value: Copy {
    /// A number of the formula.
    fn number(value: f64) -> Self;
    /// A function of one value.
    fn one(self, of: One) -> Self;
    /// An operator between two values.
    fn two(self, of: Two, right: Self) -> Self;
}

impl Value for f64 {
    #[inline]
    fn number(value: f64) -> Self {
        value
    }

    #[inline]
    fn one(self, of: One) -> Self {
        of.at(self)
    }

    #[inline]
    fn two(self, of: Two, right: Self) -> Self {
        of.at(self, right)
    }
}

/// A number with a name.
pub(super) fn constant(name: &str) -> Option<f64> {
    matches!(name, "pi" | "PI").then_some(PI)
}

impl One {
    /// The function of a name.
    pub(super) fn named(name: &str) -> Option<Self> {
        Some(match name {
            "sin" => Self::Sin,
            "cos" => Self::Cos,
            "tan" => Self::Tan,
            "asin" => Self::Asin,
            "acos" => Self::Acos,
            "atan" => Self::Atan,
            "exp" => Self::Exp,
            "ln" => Self::Ln,
            "sqrt" => Self::Sqrt,
            "abs" => Self::Abs,
            "sign" => Self::Sign,
            "floor" => Self::Floor,
            "step" => Self::Step,
            _ => return None,
        })
    }

    /// Its value.
    #[inline]
    pub(super) fn at(self, x: f64) -> f64 {
        match self {
            Self::Negative => -x,
            Self::Sin => x.sin(),
            Self::Cos => x.cos(),
            Self::Tan => x.tan(),
            Self::Asin => x.asin(),
            Self::Acos => x.acos(),
            Self::Atan => x.atan(),
            Self::Exp => x.exp(),
            Self::Ln => x.ln(),
            Self::Sqrt => x.sqrt(),
            Self::Abs => x.abs(),
            Self::Sign => sign(x),
            Self::Floor => x.floor(),
            Self::Step => f64::from(x >= 0.0),
        }
    }

    /// Its derivative. A function that jumps has none at the jump: 0 is taken there as beside it.
    #[inline]
    pub(super) fn slope(self, x: f64) -> f64 {
        match self {
            Self::Negative => -1.0,
            Self::Sin => x.cos(),
            Self::Cos => -x.sin(),
            Self::Tan => 1.0 + x.tan().powi(2),
            Self::Asin => 1.0 / (1.0 - x * x).sqrt(),
            Self::Acos => -1.0 / (1.0 - x * x).sqrt(),
            Self::Atan => 1.0 / (1.0 + x * x),
            Self::Exp => x.exp(),
            Self::Ln => 1.0 / x,
            Self::Sqrt => 0.5 / x.sqrt(),
            Self::Abs => sign(x),
            Self::Sign | Self::Floor | Self::Step => 0.0,
        }
    }
}

/// -1, 0 or 1.
fn sign(x: f64) -> f64 {
    if x == 0.0 { 0.0 } else { x.signum() }
}

impl Two {
    pub(super) fn operator(sign: char) -> Self {
        match sign {
            '+' => Self::Plus,
            '-' => Self::Minus,
            '*' => Self::Times,
            '/' => Self::Over,
            _ => Self::Power,
        }
    }

    /// The function of a name.
    pub(super) fn named(name: &str) -> Option<Self> {
        Some(match name {
            "atan2" => Self::Atan2,
            "mod" => Self::Mod,
            _ => return None,
        })
    }

    /// Its value.
    #[inline]
    pub(super) fn at(self, a: f64, b: f64) -> f64 {
        match self {
            Self::Plus => a + b,
            Self::Minus => a - b,
            Self::Times => a * b,
            Self::Over => a / b,
            Self::Power => a.powf(b),
            Self::Atan2 => a.atan2(b),
            // the remainder has the sign of the period
            Self::Mod => a - b * (a / b).floor(),
        }
    }

    /// Its derivative by the left value.
    #[inline]
    pub(super) fn slope_left(self, a: f64, b: f64) -> f64 {
        match self {
            Self::Plus | Self::Minus | Self::Mod => 1.0,
            Self::Times => b,
            Self::Over => 1.0 / b,
            Self::Power => b * a.powf(b - 1.0),
            Self::Atan2 => b / (a * a + b * b),
        }
    }

    /// Its derivative by the right value.
    #[inline]
    pub(super) fn slope_right(self, a: f64, b: f64) -> f64 {
        match self {
            Self::Plus => 1.0,
            Self::Minus => -1.0,
            Self::Times => a,
            Self::Over => -(a / b) / b,
            // every positive power of 0 is 0
            Self::Power if a == 0.0 && b > 0.0 => 0.0,
            Self::Power => a.powf(b) * a.ln(),
            Self::Atan2 => -a / (a * a + b * b),
            Self::Mod => -(a / b).floor(),
        }
    }
}
