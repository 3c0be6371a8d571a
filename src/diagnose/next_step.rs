//! What to do after a diagnosis. The terminal, the page and the workbench say the same decision.

use super::answer::{Candidate, Diagnosis, Finding, Where};
use super::oversized::Oversized;
use super::verdict::{NotNamed, Verdict};

#[derive(Debug, Clone, Copy, PartialEq)]
pub enum NextStep<'d> {
    /// Correct the set-up mistake and measure again.
    CorrectSetupMistake,
    /// Add the effect to the model.
    Add(&'d Candidate),
    /// Check at the machine whether it is the effect or something that is no effect; add the effect in either case.
    AddOrCheck(&'d Candidate, &'d str),
    /// Check at the machine which effect of the group it is: no touches separate them. Add the first in either case.
    CheckWhich(&'d Candidate),
    /// Measure the touches that separate the effects of the group.
    Separate(&'d Candidate),
    /// Measure further touches: they show whether a weak pattern is there, whether the effect in question acts, or which of several.
    MeasureMore,
    /// Correct what no formula describes at the machine.
    CorrectAtMachine(&'d MachineCheck),
    /// Write what is seen as a formula.
    Sketch,
    /// Measure with a program of more poses: these touches are too few to judge.
    RicherProgram,
    /// The model fits, and a value in it is far larger than machines have it: check what makes it so large.
    CheckSize(&'d Oversized),
    /// Nothing that a diagnosis asks for.
    Nothing,
}

#[derive(Debug, Clone, PartialEq, Eq)]
pub enum MachineCheck {
    /// These faces are dirty, or their block has another size.
    NamedFaces(Vec<String>),
    /// These blocks are dirty, loose or have another size, the worst first.
    NamedBlocks(Vec<String>),
    MovedBlock(String),
    /// Some faces are dirty.
    Faces,
    /// Some block is dirty or loose.
    Blocks,
    /// Poses have an error of their own and come back with it.
    PosesComeBack,
    /// Something changed between the runs.
    Runs,
    /// Clamping or indexing of the rotary axes has play.
    Clamping,
    /// The pattern is weak: further touches tell whether it is there.
    WeakPattern,
    /// A pattern that no formula describes.
    NoFormula,
    /// The residual depends on nothing that the touches show.
    NoPattern,
}

impl Diagnosis {
    #[must_use]
    pub fn next_step(&self) -> NextStep<'_> {
        if self.mistake().is_some() {
            return NextStep::CorrectSetupMistake;
        }
        match &self.verdict {
            Verdict::MissingEffect(_) => match self.proposed() {
                [] => NextStep::Nothing,
                [first, ..] if first.same_as.is_empty() => match &first.or_else {
                    None => NextStep::Add(first),
                    Some(other) => NextStep::AddOrCheck(first, other),
                },
                // of two the one that is clear goes into the model, and the other one is judged again
                [_, second, ..] if second.same_as.is_empty() => NextStep::Add(second),
                [first, ..] if first.never_parted => NextStep::CheckWhich(first),
                [first, ..] => NextStep::Separate(first),
            },
            Verdict::Unexplained(found) => {
                let formula = found.sketchable && self.verdict.moved_block().is_none();
                match found.why {
                    _ if self.leaves_open() => NextStep::MeasureMore,
                    NotNamed::CannotBeConfirmed(_) => NextStep::MeasureMore,
                    NotNamed::WeakPattern if formula => NextStep::MeasureMore,
                    _ if formula => NextStep::Sketch,
                    _ => NextStep::CorrectAtMachine(&found.check),
                }
            }
            Verdict::TooLittleData(_) => NextStep::RicherProgram,
            Verdict::Adequate => self.oversized.first().map_or(NextStep::Nothing, NextStep::CheckSize),
        }
    }
}

impl MachineCheck {
    /// What to check about the first finding that no formula describes.
    pub(super) fn from_dependence(first: Option<&Where>, visits_come_back: bool) -> Self {
        let Some(first) = first else { return Self::NoPattern };
        match first.by.as_str() {
            "face" => Self::Faces,
            "block" => Self::Blocks,
            "visit" if visits_come_back && first.finding != Finding::Scatter => Self::PosesComeBack,
            "run" => Self::Runs,
            "visit" => Self::Clamping,
            _ => Self::NoFormula,
        }
    }
}
