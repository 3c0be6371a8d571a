//! Degrees in a formula where radians are meant: angles are radians there, and `step(abs(A) - 30)` never becomes 1.

use super::formula_parser::{Steps, fold};
use std::f64::consts::{PI, TAU};
use std::fmt;

/// Angles among the variables of a formula, rad.
const ANGLES: [&str; 10] = ["A", "B", "C", "wA", "wB", "wC", "wayA", "wayB", "wayC", "S"];

/// A part of a formula that looks as if an angle were in degrees.
#[derive(Debug, Clone, PartialEq)]
pub enum InDegrees {
    /// An angle stands against a number that is more than a turn in radians.
    Against {
        angle: String,
        /// The number, per one of the angle.
        number: f64,
    },
    /// An angle is multiplied by pi/180.
    Converted { angle: String },
}

impl InDegrees {
    /// What to do about it.
    #[must_use]
    pub fn remedy(&self) -> String {
        match self {
            Self::Against { number, .. } => format!("if {number} degrees are meant, write {number}*pi/180"),
            Self::Converted { angle } => format!("write {angle} without pi/180"),
        }
    }
}

impl fmt::Display for InDegrees {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Against { angle, number } => {
                write!(f, "{angle} is in radians and is compared with {number}, which is more than a full turn (6.28)")
            }
            Self::Converted { angle } => write!(f, "{angle} is in radians already and is multiplied by pi/180"),
        }
    }
}

/// The first such part of a formula; `shapes` are its parameters, which may be called like an angle.
#[must_use]
pub fn find(text: &str, shapes: &[&str]) -> Option<InDegrees> {
    let found = fold::<Traced>(text).ok()?.found?;
    let (InDegrees::Against { angle, .. } | InDegrees::Converted { angle }) = &found;
    (!shapes.contains(&angle.as_str())).then_some(found)
}

/// A part of a formula as far as it matters here.
struct Traced {
    part: Part,
    found: Option<InDegrees>,
}

enum Part {
    /// A number. Who writes pi into it thinks in radians.
    Number {
        value: f64,
        with_pi: bool,
    },
    /// A multiple of an angle or of its size, and numbers that are added.
    Angle {
        angle: String,
        factor: f64,
    },
    Other,
}

impl Traced {
    fn new(part: Part, found: Option<InDegrees>) -> Self {
        Self { part, found }
    }
}

/// An angle with a number added to it, subtracted from it or taken as its period.
fn against(angle: &str, factor: f64, value: f64, with_pi: bool) -> Option<InDegrees> {
    let number = (value / factor).abs();
    // a share of an angle is an amount, and any number may be added to that
    let compared = !with_pi && factor.abs() >= 1.0 && number.is_finite() && number > TAU + 0.01;
    compared.then(|| InDegrees::Against { angle: angle.to_owned(), number })
}

impl Steps for Traced {
    fn number(value: f64) -> Self {
        Self::new(Part::Number { value, with_pi: false }, None)
    }

    fn word(name: &str) -> Self {
        let part = match name {
            "pi" | "PI" => Part::Number { value: PI, with_pi: true },
            _ if ANGLES.contains(&name) => Part::Angle { angle: name.to_owned(), factor: 1.0 },
            _ => Part::Other,
        };
        Self::new(part, None)
    }

    fn negative(self) -> Self {
        let part = match self.part {
            Part::Number { value, with_pi } => Part::Number { value: -value, with_pi },
            Part::Angle { angle, factor } => Part::Angle { angle, factor: -factor },
            Part::Other => Part::Other,
        };
        Self::new(part, self.found)
    }

    fn operator(self, sign: char, right: Self) -> Self {
        let found = self.found.or(right.found);
        match (self.part, sign, right.part) {
            (Part::Number { value: a, with_pi: one }, _, Part::Number { value: b, with_pi: two }) => {
                let value = match sign {
                    '+' => a + b,
                    '-' => a - b,
                    '*' => a * b,
                    '/' => a / b,
                    _ => a.powf(b),
                };
                Self::new(Part::Number { value, with_pi: one || two }, found)
            }
            (Part::Angle { angle, factor }, '+' | '-', Part::Number { value, with_pi })
            | (Part::Number { value, with_pi }, '+' | '-', Part::Angle { angle, factor }) => {
                let found = found.or_else(|| against(&angle, factor, value, with_pi));
                Self::new(Part::Angle { angle, factor }, found)
            }
            (Part::Angle { angle, factor }, '*' | '/', Part::Number { value, .. })
            | (Part::Number { value, .. }, '*', Part::Angle { angle, factor }) => {
                let factor = if sign == '/' { factor / value } else { factor * value };
                let is_conversion = (factor.abs() * 180.0 / PI - 1.0).abs() < 1e-3;
                let found = found.or_else(|| is_conversion.then(|| InDegrees::Converted { angle: angle.clone() }));
                Self::new(Part::Angle { angle, factor }, found)
            }
            _ => Self::new(Part::Other, found),
        }
    }

    fn call(name: &str, arguments: Vec<Self>) -> Self {
        let mut found = None;
        let mut parts = Vec::new();
        for argument in arguments {
            found = found.or(argument.found);
            parts.push(argument.part);
        }
        match (name, &parts[..]) {
            ("mod", [Part::Angle { angle, factor }, Part::Number { value, with_pi }]) => {
                found = found.or_else(|| against(angle, *factor, *value, *with_pi));
                let part = Part::Angle { angle: angle.clone(), factor: *factor };
                Self::new(part, found)
            }
            ("abs", [Part::Angle { angle, factor }]) => {
                Self::new(Part::Angle { angle: angle.clone(), factor: factor.abs() }, found)
            }
            _ => Self::new(Part::Other, found),
        }
    }

    fn in_brackets(self) -> Self {
        self
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn degrees_are_found_and_radians_are_not() {
        for (text, number) in [
            ("step(abs(A) - 30)", 30.0),
            ("abs(A) - 30", 30.0),
            ("sin(C)*step(45 - B)", 45.0),
            ("step(2*C - 180)", 90.0),
            ("mod(C, 360)", 360.0),
            ("1 - exp(-((B + 90)/10)^2)", 90.0),
        ] {
            let found = find(text, &[]);
            assert!(matches!(&found, Some(InDegrees::Against { number: n, .. }) if *n == number), "{text}: {found:?}");
        }
        for text in ["sin(A*pi/180)", "cos(2*(C/57.29578))", "sin(pi/180*wB)"] {
            assert!(matches!(find(text, &[]), Some(InDegrees::Converted { .. })), "{text}");
        }
        for text in [
            "step(abs(A) - 30*pi/180)",
            "step(abs(A) - 0.5)",
            "cos(7*C)",
            "1 - B/20",
            "step(X - 30)",
            "sin(C + 4*pi)",
            "A*X/100 - 30",
            "cos(B) - 30",
            "T - 20",
        ] {
            assert_eq!(find(text, &[]), None, "{text}");
        }
        // a parameter goes before a variable of its name
        assert_eq!(find("S - 30", &["S"]), None);
    }
}
