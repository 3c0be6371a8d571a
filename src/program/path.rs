//! The path: every move of a program in order, controller-neutral. A postprocessor spells it, `check` proves it.
//!
//! A [`Step`] says what the control must do and what it may rely on; nothing here knows a controller's language.

use crate::axes::AxisMap;
use nalgebra::Matrix3;

/// One step of a program. Positions are NC coordinates relative to R, mm and deg; feeds mm/min.
#[derive(Debug, Clone, PartialEq)]
#[allow(clippy::large_enum_variant)] // most steps of a program belong to touches: boxing them would save nothing
pub enum Step {
    /// A remark for the reader of the NC program.
    Note(String),
    /// A set-up begins: a place at which the program can be taken up again.
    ///
    /// The moves before the first one are the opening of the program: after them the machine stands at a known place at
    /// the top of the lifting axis.
    Setup {
        /// Running number from 1, without a gap.
        number: u32,
        /// What is touched in it.
        says: String,
        /// The way from the end of the opening to where this set-up begins: rapids of one axis and turns with their
        /// senses, proven like every other move. `None`: no way is proven clear, the program cannot be taken up here.
        resume: Option<Vec<Step>>,
    },
    /// The program stops until a person has done what is said. The lift stands at its top and all rotary axes at 0.
    Stop(Stop),
    /// Spindle stopped and oriented, right-handed about the tool frame's +z, deg.
    OrientSpindle {
        /// Orientation.
        deg: f64,
    },
    /// Rapid of linear axes: one axis, or several when the whole box that the move spans is proven clear.
    Rapid {
        /// The axes that move.
        to: AxisMap,
    },
    /// A rotary axis moves, at clearance only; the sense is forced.
    Rotary {
        /// Where to: one axis.
        to: AxisMap,
        /// +1 or -1 for the axis that moves. Empty only in the first moves of a program, when nobody knows from which
        /// angle the axis comes: whichever way the control chooses is clear.
        sense: AxisMap,
    },
    /// Positioning near the blocks: straight, at a feed, stops the program if the probe trips.
    Protected {
        /// The axes that move.
        to: AxisMap,
        feed: f64,
    },
    /// One touch: search from where the ball stands (the touch's `start`), back off, measure, log.
    Touch(TouchStep),
    /// A touch that finds the artefact: like a touch, but none of the plan's, and its search is longer.
    Find(TouchStep),
    /// What the find touch just made adds to what was found: mm along an axis for each mm that it triggered further along its search.
    Found {
        /// The axis and how much.
        moves: AxisMap,
    },
    /// From here on all places of linear axes are relative to what was found; no axis moves by that.
    Shift {
        /// By how much X, Y and Z are further, for each mm that was found along X, Y and Z (columns).
        matrix: Matrix3<f64>,
    },
    /// The artefact is found: further off than the tolerance the program stops, and what was found goes into the log.
    FindEnd,
    /// Straight back from contact to the touch's start: the probe may still be deflected when it begins.
    Retract {
        /// The axes that move.
        to: AxisMap,
        feed: f64,
    },
}

impl Step {
    /// The touch that it makes, if it makes one.
    #[must_use]
    pub fn touch(&self) -> Option<&TouchStep> {
        match self {
            Self::Touch(touch) | Self::Find(touch) => Some(touch),
            _ => None,
        }
    }
}

/// What a person does while the program stands, and what is mounted then.
#[derive(Debug, Clone, PartialEq)]
pub struct Stop {
    /// What to do, one line each.
    pub says: Vec<String>,
    /// What is mounted then, one line each: what a run that starts again in this part needs.
    pub mounted: Vec<String>,
    /// Name of the blocks as they stand then; the plan's touches carry it.
    pub mounting: String,
    /// Pivot to ball's centre.
    pub tool_length_mm: f64,
    pub ball_radius_mm: f64,
}

/// What a postprocessor needs to spell a touch.
#[derive(Debug, Clone, PartialEq)]
pub struct TouchStep {
    /// Number in the plan.
    pub id: u64,
    /// For messages: block and face.
    pub says: String,
    /// Where the search begins (the ball stands there).
    pub start: AxisMap,
    /// Where an errorless machine triggers.
    pub nominal: AxisMap,
    /// Where the search gives up: inside the probe's mechanical overtravel.
    pub end: AxisMap,
    /// Rotary axes, deg.
    pub pose: AxisMap,
    /// True on the first touch of a block: the search runs at the slow feed and must trigger within `tolerance_mm`.
    pub first: bool,
    /// How far from `nominal` the first touch of a block may trigger.
    pub tolerance_mm: f64,
    pub search_feed: f64,
    /// Feed of the measuring touch.
    pub measure_feed: f64,
    /// Way back between the two.
    pub back_off_mm: f64,
}

/// The whole path.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Path {
    /// What a person must know before pressing start: artefact, layout, settings. One line each.
    pub head: Vec<String>,
    pub steps: Vec<Step>,
    /// Predicted run time, s; with what a person needs at the stops.
    pub seconds: f64,
    /// What a person needs at the stops, s: assumed.
    pub waiting: f64,
    /// What is mounted up to the first stop, one line each; empty where the program does not stop.
    pub mounted: Vec<String>,
    /// Where the rotary axes must stand at the start; `None`: anywhere.
    pub start_near: Option<StartNear>,
}

/// A start that is not from anywhere: the first moves are proven clear only near a pose.
#[derive(Debug, Clone, PartialEq)]
pub struct StartNear {
    /// The pose, deg.
    pub pose: AxisMap,
    /// How far off an axis may stand, deg.
    pub within_deg: f64,
}

impl StartNear {
    /// The angles in which an axis may stand, deg.
    #[must_use]
    pub fn window(&self, axis: &crate::machine::Axis) -> [f64; 2] {
        let angle = self.pose.get(axis.name).unwrap_or(0.0);
        [angle - self.within_deg, angle + self.within_deg]
    }
}
