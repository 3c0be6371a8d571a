//! The first moves of a program, its stops, and the way back in when it starts again at a later set-up.
//!
//! The first moves bring the machine from anywhere to a known place with the lift at its top, where nothing can meet
//! whatever the other axes do: the path has proven that. A run that starts again makes the same moves, then goes up
//! there to where its set-up begins, rotary axes first and in the sense in which they would have come, the lift last.

use super::Frame;
use super::emit::Writer;
use crate::axes::{AxisMap, AxisName};
use crate::diag::Failure;
use crate::diag::Result;
use crate::machine::Machine;
use crate::program::path::{Path, Step, Stop};
use minijinja::{Value, context};

/// The first moves.
#[derive(Debug, Clone, Default)]
pub(super) struct Opening {
    /// Indices of the path's steps, in the order in which they are written.
    pub(super) steps: Vec<usize>,
    /// The rest, in order.
    pub(super) rest: Vec<usize>,
    /// The axis that lifts the probe over everything.
    lift: Option<AxisName>,
    /// Where every axis stands after them; `None` where that is not known.
    place: Option<AxisMap>,
}

impl Opening {
    /// The axis that lifts the probe over everything.
    pub(super) fn lift(&self) -> Option<AxisName> {
        self.lift
    }

    /// Takes the first moves out of the first set-up. Under a transformation linear axes go first: a turn needs to know
    /// where they stand.
    pub(super) fn from_path(path: &Path, machine: &Machine, tcp: bool) -> Self {
        let mut known = AxisMap::default();
        let whole = |known: &AxisMap| machine.axes.iter().all(|a| known.get(a.name).is_some());
        let mut setup = None;
        let mut steps = Vec::new();
        let mut lift = None;
        for (index, step) in path.steps.iter().enumerate() {
            if whole(&known) {
                break;
            }
            match step {
                Step::Setup { .. } if setup.is_none() => setup = Some(index),
                Step::Note(_) | Step::OrientSpindle { .. } => steps.push(index),
                Step::Rapid { to } | Step::Rotary { to, .. } => {
                    if lift.is_none() {
                        lift = to.iter().map(|(a, _)| a).find(|a| !a.is_rotary());
                    }
                    known = to.or(&known);
                    steps.push(index);
                }
                _ => break,
            }
        }
        if !whole(&known) {
            // a path by hand that begins otherwise: as it stands, and with no way back in
            return Self { rest: (0..path.steps.len()).collect(), ..Self::default() };
        }
        if tcp {
            steps.sort_by_key(|i| matches!(path.steps.get(*i), Some(Step::Rotary { .. })));
        }
        let rest = (0..path.steps.len()).filter(|i| !steps.contains(i)).collect();
        Self { steps, rest, lift, ..Self::default() }
    }
}

impl Writer<'_> {
    /// Blocks or stylus are changed. It belongs to the set-up before it: a run that starts again behind it does not stop.
    pub(super) fn stop(&mut self, stop: &Stop) -> Result<()> {
        if !self.post.can_stop() {
            return Err(Failure::new(
                "post::no_stop",
                format!("controller {} does not say how a program waits for a person", self.post.name),
            )
            .help("describe it under [write.stop] in the postprocessor file, or make a program with one mounting and stylus"));
        }
        let changes = stop.tool_length_mm.to_bits() != self.frame.length_mm().to_bits();
        if self.frame.is_tcp() && changes && self.post.tcp.as_ref().is_some_and(|tcp| !tcp.other_stylus) {
            let message = format!(
                "under its transformation controller {} cannot take up another stylus in the middle of a program",
                self.post.name
            );
            return Err(Failure::new("post::other_stylus", message)
                .help("make a program for each stylus, or generate without --tcp"));
        }
        self.mounted.clone_from(&stop.mounted);
        self.touched.clear();
        // all rotary axes stand at 0, where the control's coordinates are the same for every length
        self.frame = Frame::new(self.machine, self.plan.controller_frame, stop.tool_length_mm);
        let longer = self.length(stop.tool_length_mm - self.plan.tool_length_mm);
        let origin_z = self.length(self.machine.origin.get(AxisName::Z).unwrap_or(0.0));
        self.render("stop", context! { says => stop.says.clone(), longer, origin_z })
    }

    /// Writes the first moves. As soon as X, Y and Z are known, the rotary axes under a transformation still at 0, the program may look
    /// whether the axes of the machine stand where its words have sent them: what no variable of the control tells shows there.
    pub(super) fn open(&mut self, first: &[usize]) -> Result<()> {
        let mut looked = !self.post.looks_on_arrival();
        for step in first {
            self.steps(std::slice::from_ref(step))?;
            let stands = self.at.linear();
            if !looked && [AxisName::X, AxisName::Y, AxisName::Z].into_iter().all(|a| stands.get(a).is_some()) {
                looked = true;
                self.look_about()?;
            }
        }
        if self.opening.lift.is_some() && self.path.start_near.is_none() {
            self.opening.place = Some(self.at);
        }
        Ok(())
    }

    /// Looks where the lift stands at its top, further along each of the other linear axes, and goes back: a program that began just here
    /// has made no way on which anything could show. Of two places one shows at least half of what turns the way between them.
    fn look_about(&mut self) -> Result<()> {
        /// An angle of 0.02 deg moves the end of it by some hundredths of a millimetre.
        const WAY_MM: f64 = 100.0;
        if !self.look()? {
            return Ok(());
        }
        let begins = self.at.linear();
        let across = |a: &&crate::machine::Axis| !a.name.is_rotary() && Some(a.name) != self.opening.lift;
        let mut places = Vec::new();
        for axis in self.machine.axes.iter().filter(across) {
            let Some(at) = begins.get(axis.name) else { continue };
            let [low, high] = axis.range;
            let to = if high - at > at - low { (at + WAY_MM).min(high) } else { (at - WAY_MM).max(low) };
            places.push((axis.name, at, to));
        }
        for (axis, _, to) in &places {
            self.step(&Step::Rapid { to: AxisMap::default().with(*axis, *to) })?;
            self.look()?;
        }
        for (axis, at, _) in places.iter().rev() {
            self.step(&Step::Rapid { to: AxisMap::default().with(*axis, *at) })?;
        }
        Ok(())
    }

    /// Does this program look at all?
    fn look(&mut self) -> Result<bool> {
        let words = self.words(&self.at.linear())?;
        let before = self.text.len();
        self.render("arrived", context! { stands => words })?;
        Ok(self.text.len() > before)
    }

    /// The way that the path gives from where the first moves end to where the present set-up begins; `None` where the
    /// path proves none.
    pub(super) fn resume(&self, way: Option<&[Step]>) -> Result<Option<Vec<Value>>> {
        let (Some(opening), Some(way)) = (self.opening.place, way) else { return Ok(None) };
        // the first moves are written for the length of the first stylus, and turn
        if self.frame.is_tcp() && self.frame.length_mm().to_bits() != self.plan.tool_length_mm.to_bits() {
            return Ok(None);
        }
        let (mut stands, mut moves) = (opening, Vec::new());
        for step in way {
            match step {
                Step::Rotary { to, sense } => {
                    for place in self.rotary_steps(&stands, to)? {
                        moves.push(self.words_by(&place, sense)?);
                    }
                    stands = to.or(&stands);
                }
                Step::Rapid { to } => {
                    stands = to.or(&stands);
                    let place = if self.frame.is_tcp() {
                        let world = self.controller(&stands);
                        AxisMap::xyz(world.0[0], world.0[1], world.0[2])
                    } else {
                        *to
                    };
                    moves.push(self.words(&place)?);
                }
                Step::Shift { matrix } => moves.push(context! { shift => self.shift_rows(matrix) }),
                _ => return Err(self.broken("the way to a set-up holds more than rapids and turns".into())),
            }
        }
        Ok(Some(moves))
    }
}
