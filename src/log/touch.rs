//! Records of measured touches: raw as a log gave them, and matched to the plan.

use crate::axes::Position;
pub use crate::program::Status;

/// One touch as the log gives it. Positions are NC coordinates in R (mm, deg), not corrected for the ball.
#[derive(Debug, Clone, PartialEq)]
pub struct RawTouch {
    /// Number in the plan, where the log holds one.
    pub id: Option<u64>,
    /// Positions at the trigger; axes that the log does not hold stand at `None`'s place as the plan's pose later.
    pub position: Position,
    /// Which of the six positions the log held.
    pub present: [bool; 6],
    /// Hit or miss.
    pub status: Status,
    /// Time, s, on the log's own clock.
    pub time_s: Option<f64>,
    /// Temperature, °C.
    pub temperature_deg_c: Option<f64>,
    /// Line in the log, from 1.
    pub line: usize,
}

impl RawTouch {
    /// Does it say something else than another line of the same touch?
    #[must_use]
    pub fn differs(&self, other: &Self) -> bool {
        (self.position, self.present, self.status, self.time_s)
            != (other.position, other.present, other.status, other.time_s)
    }
}

/// One touch matched to the plan: never dropped or edited afterwards, only marked.
#[derive(Debug, Clone, PartialEq)]
pub struct Touch {
    /// Number in the plan.
    pub id: u64,
    /// Axis positions at the trigger, NC coordinates relative to R, mm and deg.
    pub position: Position,
    /// Hit or miss.
    pub status: Status,
    /// Time, s, on the study's clock where known.
    pub time_s: Option<f64>,
    /// Temperature, °C.
    pub temperature_deg_c: Option<f64>,
    /// The last digit of its log, where all lengths in it are multiples of one, mm.
    pub digit_mm: Option<f64>,
    /// Line in the log, from 1.
    pub line: usize,
}
