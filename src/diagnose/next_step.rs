//! What to do after a diagnosis. The terminal, the page and the workbench say the same decision.

use super::answer::{Candidate, Diagnosis};
use super::{Verdict, scatter_leads};
use crate::search::multiplicity::FAMILY_LEVEL;

/// What to do next.
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
    /// Measure further touches, which answer the question.
    MeasureMore(OpenQuestion),
    /// Correct what no formula describes at the machine.
    CorrectAtMachine(MachineCheck<'d>),
    /// Write what is seen as a formula.
    Sketch,
    /// Measure with a program of more poses: these touches are too few to judge.
    RicherProgram,
    /// Nothing that a diagnosis asks for.
    Nothing,
}

/// What further touches tell.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum OpenQuestion {
    /// Whether a weak pattern is there at all.
    WeakPattern,
    /// Which of several effects it is, none of which could be tried on unused touches.
    UntriedEffects,
    /// Whether the effect in question acts.
    EffectInQuestion,
}

/// What to check at the machine.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum MachineCheck<'d> {
    /// These faces are dirty, or their block has another size.
    NamedFaces(&'d [String]),
    /// This block is dirty, loose or has another size.
    NamedBlock(&'d str),
    /// This block moved.
    MovedBlock(&'d str),
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
    /// What to do next.
    #[must_use]
    pub fn next_step(&self) -> NextStep<'_> {
        if self.mistake().is_some() {
            return NextStep::CorrectSetupMistake;
        }
        match self.verdict {
            Verdict::MissingEffect => match self.candidates.first().filter(|c| c.proposed) {
                None => NextStep::Nothing,
                Some(first) if first.same_as.is_empty() => match &first.or_else {
                    None => NextStep::Add(first),
                    Some(other) => NextStep::AddOrCheck(first, other),
                },
                Some(first) if first.never_parted => NextStep::CheckWhich(first),
                Some(first) => NextStep::Separate(first),
            },
            Verdict::Unexplained if self.faint && (self.leaves_open() || self.touches_would_tell()) => {
                NextStep::MeasureMore(OpenQuestion::WeakPattern)
            }
            Verdict::Unexplained if !self.untried().is_empty() => NextStep::MeasureMore(OpenQuestion::UntriedEffects),
            Verdict::Unexplained if self.leaves_open() => NextStep::MeasureMore(OpenQuestion::EffectInQuestion),
            Verdict::Unexplained if self.sketchable && self.moved_block.is_none() => NextStep::Sketch,
            Verdict::Unexplained => NextStep::CorrectAtMachine(self.machine_check()),
            Verdict::TooLittleData => NextStep::RicherProgram,
            Verdict::Adequate => NextStep::Nothing,
        }
    }

    /// The effects that pass the test with all of them counted in, where nothing is proposed only because these poses leave
    /// no touches to try the choice on: ids, the first one first.
    #[must_use]
    pub fn untried(&self) -> Vec<&str> {
        let passes = |c: &&Candidate| c.p_adjusted < FAMILY_LEVEL;
        let leads = self.candidates.first().is_some_and(|c| passes(&c) && !c.proposed && !tried(c));
        if self.verdict != Verdict::Unexplained || !leads {
            return Vec::new();
        }
        let each = self.candidates.iter().filter(passes).filter(|c| !tried(c));
        let mut out: Vec<&str> = Vec::new();
        for id in each.flat_map(|c| std::iter::once(&c.effect).chain(&c.same_as)) {
            if !out.contains(&id.as_str()) {
                out.push(id);
            }
        }
        out
    }

    /// What to check at the machine about a finding that no formula describes.
    #[must_use]
    pub fn machine_check(&self) -> MachineCheck<'_> {
        if !self.faces.is_empty() {
            return MachineCheck::NamedFaces(&self.faces);
        }
        if let Some(block) = self.blocks.first() {
            return MachineCheck::NamedBlock(block);
        }
        if let Some(block) = &self.moved_block {
            return MachineCheck::MovedBlock(block);
        }
        match self.depends.first().map(|w| w.by.as_str()) {
            Some("face") => MachineCheck::Faces,
            Some("block") => MachineCheck::Blocks,
            Some("visit") if self.visits_come_back && !scatter_leads(self) => MachineCheck::PosesComeBack,
            Some("run") => MachineCheck::Runs,
            Some("visit") => MachineCheck::Clamping,
            Some(_) if self.faint => MachineCheck::WeakPattern,
            Some(_) => MachineCheck::NoFormula,
            None => MachineCheck::NoPattern,
        }
    }
}

/// Could a candidate be tried on touches that had no part in choosing it? With few poses none can be predicted.
fn tried(c: &Candidate) -> bool {
    match (c.held_out_before_um, c.held_out_after_um) {
        (Some(before), Some(after)) => before.is_finite() && after.is_finite() && (before > 0.0 || after > 0.0),
        _ => false,
    }
}
