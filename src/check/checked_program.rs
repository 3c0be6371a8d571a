//! A program that is checked, with what it is checked against, and the findings about it.

use super::world::World;
use crate::diag::{Finding, Source};
use crate::machine::{Machine, Mounting};
use crate::post::Postprocessor;
use crate::program::plan::Plan;
use crate::program::scene::Scene;
use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;

/// How far a way back may lead sideways: its words are rounded, and it may be short, mm.
pub const SIDEWAYS_MM: f64 = 0.002;

/// What is judged, and against what.
pub struct CheckedProgram<'a> {
    /// The machine with its own stylus.
    pub machine: &'a Machine,
    /// The control.
    pub post: &'a Postprocessor,
    pub plan: Option<&'a Plan>,
    /// The plan as it was written: touches relative to an artefact that was put down by eye are others.
    pub written: Option<&'a Plan>,
    /// Shapes of each part.
    pub scenes: &'a [Scene<'a>],
    /// Blocks and coordinates.
    pub world: &'a World,
    /// The program.
    pub source: &'a Source,
    /// Coordinates that differ by less are the same, mm or deg.
    pub same: f64,
    /// What is mounted in each part.
    pub mountings: &'a [&'a Mounting],
    /// A person may start it from anywhere only when this holds.
    pub clear_from_anywhere: bool,
    /// The settings of a control as it is switched on.
    pub neutral: &'a BTreeMap<String, String>,
}

/// Findings of one kind that are shown; the rest is counted.
const SHOWN: usize = 8;

/// Collects findings; equal ones are said once.
#[derive(Default)]
pub struct CollectedFindings {
    findings: Vec<Finding>,
    seen: BTreeSet<(&'static str, usize, String)>,
    count: BTreeMap<&'static str, usize>,
    /// In which run it happens, where that is none of the usual ones.
    pub(super) when: Option<String>,
}

impl CollectedFindings {
    /// Notes a finding at a place.
    pub fn say(
        &mut self,
        case: &CheckedProgram<'_>,
        code: &'static str,
        at: &Range<usize>,
        message: String,
        help: &str,
    ) {
        if !self.seen.insert((code, at.start, message.clone())) {
            return;
        }
        let message = self.when.as_ref().map_or(message.clone(), |when| format!("{when}: {message}"));
        let count = self.count.entry(code).or_default();
        *count += 1;
        if *count <= SHOWN {
            let finding = Finding::error(code, message).at(case.source, at.clone());
            self.findings.push(if help.is_empty() { finding } else { finding.help(help) });
        }
    }

    /// All findings in the order of the program; first where the control stops, for others may follow from that.
    pub fn finish(mut self) -> Vec<Finding> {
        self.findings.sort_by_key(|f| (f.code != "check::not_run", f.span.as_ref().map_or(usize::MAX, |s| s.start)));
        for (code, count) in self.count.iter().filter(|(_, n)| **n > SHOWN) {
            self.findings.push(Finding::error(code, format!("{} more of the kind {code}", count - SHOWN)));
        }
        self.findings
    }
}
