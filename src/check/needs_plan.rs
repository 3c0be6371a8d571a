//! What nobody can judge of a program whose plan is not there.

use super::code::{Code, Expr, Instruction};
use super::run::Event;
use super::vm::Happened;
use crate::diag::{Failure, Finding, Source};
use crate::log;
use crate::post::{DialectName, TOOL_PLACE};
use std::ops::Range;

const HELP: &str = "add --plan NAME.plan.json, the plan that was written with it";

fn refuse(says: &str, at: Range<usize>, source: &Source) -> Failure {
    Finding::error("check::needs_plan", says).help(HELP).at(source, at).into()
}

/// Refuses a program whose coordinates are not axis positions.
pub fn transforms(dialect: DialectName, code: &Code, source: &Source) -> Option<Failure> {
    let at = transformation(dialect, code, source.inner())?;
    let says = "from here on its coordinates are those of the control's own transformation: where the axes stand, and what they may meet, only its plan says";
    Some(refuse(says, at, source))
}

/// Refuses a program that waits for a person between two touches, who may mount something else. `trunk`: its whole run, where
/// nothing goes wrong.
pub fn waits(trunk: &[Happened], source: &Source) -> Option<Failure> {
    let says = "here the program waits, between two touches, for a person who mounts something else: what stands on the machine from then on only its plan says";
    Some(refuse(says, stop(trunk)?, source))
}

/// Refuses a program that finds its artefact: where its touches are expected only its plan says. `trunk`: its whole run.
pub fn finds(trunk: &[Happened], source: &Source) -> Option<Failure> {
    let found = trunk.iter().find(|h| matches!(&h.event, Event::Log(text) if log::says_found(text)))?;
    let says = "the program finds an artefact that was put down by eye: how far off it may stand only its plan says";
    Some(refuse(says, found.at.clone(), source))
}

/// Where a program goes over to the control's own transformation.
fn transformation(dialect: DialectName, code: &Code, text: &str) -> Option<Range<usize>> {
    if dialect == DialectName::Ngc {
        // it finds the transformation switched on: only its head says so
        return text.find(TOOL_PLACE).map(|at| at..at + TOOL_PLACE.len());
    }
    let turns_on = |address: &str, value: &Expr| match (dialect, address, value) {
        (DialectName::Sinumerik, "TRAORI", _) => true,
        (DialectName::Klartext, "M", Expr::Number(n)) => *n == 128.0,
        (DialectName::MacroB, "G", Expr::Number(n)) => [43.4, 43.5, 234.0].contains(n),
        _ => false,
    };
    let found = code.statements.iter().find(|s| match &s.what {
        Instruction::Block(words) => words.iter().any(|w| turns_on(w.address, &w.value)),
        _ => false,
    });
    found.map(|s| s.at.clone())
}

/// The first stop for a person between two touches.
fn stop(trunk: &[Happened]) -> Option<Range<usize>> {
    let probe = |h: &Happened| matches!(h.event, Event::Probe { .. });
    let (first, last) = (trunk.iter().position(probe)?, trunk.iter().rposition(probe)?);
    let between = trunk.get(first..last)?;
    between.iter().find(|h| matches!(h.event, Event::Wait(_))).map(|h| h.at.clone())
}
