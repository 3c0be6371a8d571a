//! What the language of a control is to the one machine that runs its programs: what words, variables and G numbers mean.

use super::code::{UnknownKind, Var};
use super::doubt::Doubt;
use super::hidden_rotation::Turn;
use super::vm::{Outcome, Probe, Vm};
use crate::axes::Position;
use crate::machine::Machine;
use crate::post::Postprocessor;
use std::collections::BTreeMap;

/// What a block asks the interpreter to do next.
#[derive(Debug, Clone, PartialEq)]
pub enum Next {
    /// The next statement.
    On,
    /// How does this move end?
    Probe(Probe),
    /// The program is over.
    End,
}

/// In what state a program finds the control.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Start {
    /// As it is switched on.
    Fresh,
    /// Every mode otherwise than the program needs it, every offset set.
    Awkward,
    /// What neither of the two has: modes and coordinate systems of which a control has more than two.
    Third,
    /// Something acts on the program's coordinates that none of its words takes off: it must see that and not move.
    Obstructed,
    /// A tool length acts that the program cannot take off without a move: it must see that and not move.
    LengthActs,
    /// Something turns the program's coordinates against the axes that no variable shows: it must take it off, or see after its first
    /// moves that the axes stand elsewhere, and probe nothing.
    Rotated(Turn),
    /// A function that the user has left on acts on the program's coordinates: it must take it off, or see it and not move.
    LeftoverMode(LeftoverMode),
}

/// A function that outlasts programs and acts on their coordinates.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LeftoverMode {
    /// Lengths are multiplied.
    Scaled,
    /// X and Y are a radius and an angle.
    Polar,
    /// An offset that turns along with the table.
    TurnsAlong,
    /// The workpiece's system is turned against the machine's.
    Rotated,
    /// An axis of the workpiece's system runs against the machine's.
    Mirrored,
}

impl LeftoverMode {
    /// What it is to a person.
    pub fn says(self) -> &'static str {
        match self {
            Self::Scaled => "a scaling",
            Self::Polar => "polar coordinates",
            Self::TurnsAlong => "an offset that turns along with the table (dynamic fixture offset)",
            Self::Rotated => "a rotation of the workpiece's system (basic rotation, rotated frame)",
            Self::Mirrored => "a mirror image",
        }
    }
}

/// The language of a control: what words, variables and G numbers mean.
pub trait Dialect: Clone + Send + Sync {
    /// States in which a program must see that it cannot begin, because it cannot switch off what acts.
    const OBSTRUCTED: &'static [Start] = &[];
    /// What a user may have left on that acts on the coordinates of a program. `tcp`: under the control's own transformation.
    fn lasting(_tcp: bool) -> &'static [LeftoverMode] {
        &[]
    }
    /// Something that no variable shows may turn the program's coordinates. `tcp`: under the control's own transformation.
    fn may_be_rotated(_tcp: bool) -> bool {
        false
    }
    /// The control before the program.
    fn begin(start: Start, post: &Postprocessor, machine: &Machine) -> Self;
    /// What outlives a program that is broken off by hand; `None`: nothing that a further run of the program could use.
    fn after_abort(&self) -> Option<Self> {
        None
    }
    /// What axiscal does not know of a block, by name. Values that are computed are NaN.
    fn unknown(&self, _words: &[Spoken], _post: &Postprocessor) -> Vec<(UnknownKind, String)> {
        Vec::new()
    }
    /// A variable that switches an output of the machine when it is written.
    fn is_output(&self, _var: &Var) -> bool {
        false
    }
    /// A block of words with their values.
    ///
    /// # Errors
    /// What the control would not do.
    fn block(&mut self, words: &[Spoken], vm: &mut Vm) -> Result<Next, String>;
    /// What a variable holds that is not the program's own.
    ///
    /// # Errors
    /// When the control has no such variable.
    fn read(&self, var: &Var, vm: &Vm) -> Result<f64, String>;
    /// Whether a variable exists.
    fn exists(&self, var: &Var) -> bool;
    /// Does this variable hold whether the probe is deflected?
    fn is_probe_input(&self, _var: &Var) -> bool {
        false
    }
    /// Why a proof cannot know what a variable of the control holds; `None`: it can.
    fn doubt(&self, _var: &Var, _vm: &Vm) -> Option<Doubt> {
        None
    }
    /// Another program may or may not have left a variable of this name at the control.
    fn may_exist(&self, _var: &Var) -> bool {
        false
    }
    /// Each subroutine has a variable of this name of its own.
    fn is_local(&self, _var: &Var) -> bool {
        false
    }
    /// A variable is written.
    ///
    /// # Errors
    /// When it cannot be.
    fn write(&mut self, var: &Var, value: f64, vm: &Vm) -> Result<(), String>;
    /// A move ended: where its result is kept.
    fn probed(&mut self, probe: &Probe, outcome: Outcome, stands: &Position);
    /// The control latches all axes at the contact and lets them run out behind it; `false`: a cycle that keeps X, Y, Z and itself
    /// brings the ball to where the program asks for.
    fn latches(&self) -> bool {
        true
    }
    /// It latches the rotary axes too.
    fn latches_rotary(&self) -> bool {
        true
    }
    /// A subroutine was entered.
    fn entered(&mut self) {}
    /// A subroutine was left, with its value.
    fn left(&mut self, _value: Option<f64>, _vm: &Vm) {}
    /// All that a user would have to find again, by name.
    fn settings(&self) -> BTreeMap<String, String>;
    /// How a number is written into a text.
    fn spell(&self, value: f64, decimals: usize, width: usize) -> String {
        // room for the sign and the point beside the digits
        format!("{value:>width$.decimals$}", width = if width > 0 { width + decimals + 2 } else { 0 })
    }
}

/// A word with its value.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Spoken {
    pub address: &'static str,
    pub value: f64,
    /// It was computed, or written with a decimal point.
    pub point: bool,
}
