//! Something that no variable of a control tells turns a program's coordinates against its axes: only where the axes then stand shows it.

use super::run::Start;
use crate::axes::{AxisName, Position};

/// What turns a program's coordinates against the axes, once it acts: where they stood when it began to be reckoned.
#[derive(Debug, Clone, Copy, Default)]
pub enum Skew {
    /// Nothing does.
    #[default]
    None,
    /// It acts, and nothing has moved.
    Acts,
    /// The axes agree with the words here.
    From(Position),
}

impl Skew {
    /// A probing move that only asks whether the probe is closed is no longer, mm.
    const ASKING_MM: f64 = 0.1;
    /// Some 0.1 deg.
    const PER_MM: f64 = 0.002;

    /// The state that a control begins in.
    pub fn of(start: Start) -> Self {
        if start == Start::Skewed { Self::Acts } else { Self::None }
    }

    /// Something is about to happen here.
    pub fn reckon(&mut self, at: &Position) {
        if matches!(self, Self::Acts) {
            *self = Self::From(*at);
        }
    }

    /// How far an axis stands from where the words have sent it: the way that another one has made goes over to it, mm.
    pub fn off(self, axis: AxisName, at: &Position) -> f64 {
        let Self::From(from) = self else { return 0.0 };
        let other = match axis {
            AxisName::X => AxisName::Y,
            AxisName::Y => AxisName::Z,
            AxisName::Z => AxisName::X,
            _ => return 0.0,
        };
        (at.get(other) - from.get(other)) * Self::PER_MM
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
