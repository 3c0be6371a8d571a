//! Something that no variable of a control tells turns a program's coordinates against its axes: only where the axes then stand shows it.

use super::run::Start;
use crate::axes::{AxisName, Position};

/// What turns a program's coordinates against the axes, once it acts: where they stood when it began to be reckoned.
#[derive(Debug, Clone, Copy, Default)]
pub enum HiddenRotation {
    /// Nothing does.
    #[default]
    None,
    /// It acts, and nothing has moved.
    Acts(Turn),
    /// The axes agree with the words here.
    From(Turn, Position),
}

/// A small turn of the coordinates about one of the linear axes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Turn {
    /// The way along this axis goes over,
    pub of: AxisName,
    pub to: AxisName,
    /// in the negative sense.
    pub negative: bool,
}

impl Turn {
    /// Both senses about each axis.
    pub fn all() -> Vec<Self> {
        use AxisName::{X, Y, Z};
        let about = [(X, Y), (Y, Z), (Z, X)];
        about.into_iter().flat_map(|(of, to)| [false, true].map(|negative| Self { of, to, negative })).collect()
    }
}

impl HiddenRotation {
    /// A probing move that only asks whether the probe is closed is no longer, mm.
    const ASKING_MM: f64 = 0.1;
    /// Some 0.02 deg.
    const PER_MM: f64 = 0.0004;

    /// The state that a control begins in.
    pub fn from_start(start: Start) -> Self {
        if let Start::Rotated(turn) = start { Self::Acts(turn) } else { Self::None }
    }

    /// Something is about to happen here.
    pub fn reckon(&mut self, at: &Position) {
        if let Self::Acts(turn) = self {
            *self = Self::From(*turn, *at);
        }
    }

    /// How far an axis stands from where the words have sent it, mm.
    pub fn off(self, axis: AxisName, at: &Position) -> f64 {
        let Self::From(turn, from) = self else { return 0.0 };
        let by = Self::PER_MM * if turn.negative { -1.0 } else { 1.0 };
        let made = |a: AxisName| at.get(a) - from.get(a);
        match axis {
            a if a == turn.to => made(turn.of) * by,
            a if a == turn.of => -made(turn.to) * by,
            _ => 0.0,
        }
    }

    /// # Errors
    /// A probing move further than any that only asks, while it acts.
    pub fn may_probe(self, from: &Position, to: &Position, what: &str) -> Result<(), String> {
        let far = (to.xyz_mm() - from.xyz_mm()).norm() > Self::ASKING_MM;
        if far && !matches!(self, Self::None) {
            return Err(format!(
                "{what} may be left on by the user, which turns what the program says: it has neither taken it off nor looked, after its first moves, whether the axes stand where its words have sent them"
            ));
        }
        Ok(())
    }
}
