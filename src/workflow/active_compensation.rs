//! The compensation that the control applied while the touches were made: what it did to them.

use super::{Environment, Loaded};
use crate::diag::{Failure, Finding, Result};
use crate::machine::{Machine, Side};
use crate::program::plan::{ControllerFrame, Plan, PlanBlock};
use crate::tables::compensation::Compensation;
use crate::tables::correction::During;
use std::path::Path;

impl Loaded {
    /// The compensation that was loaded while the touches were made; `None` where nothing was. All runs must agree: the
    /// identified errors add to it.
    ///
    /// # Errors
    /// When a file is unusable, belongs to another machine, or the runs differ.
    pub fn active(&self, env: &dyn Environment) -> Result<Option<Compensation>> {
        let mut found: Option<Option<Compensation>> = None;
        for run in &*self.runs {
            let here = match &run.compensation {
                Some(path) => Some(load_compensation(path, &self.machine, env)?),
                None => None,
            };
            match &found {
                Some(first) if *first != here => {
                    return Err(Failure::new(
                        "study::two_compensations",
                        "the runs of the study were measured under different compensations",
                    )
                    .help(
                        "the identified errors add to what was active: put runs under one compensation into one study",
                    ));
                }
                _ => found = Some(here),
            }
        }
        let found = found.flatten();
        if let Some(idle) = found.as_ref().filter(|c| c.idle_without_transformation(&self.machine) > 0)
            && self.transformation().is_none()
        {
            return Err(Failure::new(
                "study::two_frames",
                format!(
                    "the compensation of study {} acted on a part of the runs only: its mode is \"{}\", and some programs give axis positions",
                    idle.provenance.study, idle.mode
                ),
            )
            .help("put the programs of `generate --tcp` into one study and the others into another"));
        }
        Ok(found)
    }

    /// Was the control's own transformation on, so that what it held acted on the touches? `None`: in a part of the runs.
    #[must_use]
    pub fn transformation(&self) -> Option<bool> {
        let mut on = self.runs.iter().map(|r| r.plan.controller_frame == ControllerFrame::Tcp);
        let first = on.next().unwrap_or(false);
        on.all(|other| other == first).then_some(first)
    }

    /// What the control did while the touches were made.
    #[must_use]
    pub fn during<'a>(&self, loaded: Option<&'a Compensation>) -> During<'a> {
        During { loaded, transformation: self.transformation() == Some(true) }
    }
}

/// A compensation that does not act on a program of axis positions.
#[must_use]
pub fn does_not_act(compensation: &Compensation, machine: &Machine, plan: &Plan) -> Option<Finding> {
    let idle = compensation.idle_without_transformation(machine);
    if idle == 0 || plan.controller_frame == ControllerFrame::Tcp {
        return None;
    }
    let of = compensation.terms.iter().filter(|t| t.value != 0.0).count();
    let tables = compensation.tables.as_ref().is_some_and(|t| !t.grids.is_empty())
        || compensation.stock.as_ref().is_some_and(|s| !s.axis_tables.is_empty());
    let which = match (idle == of, tables) {
        (true, false) => "the compensation acts under the control's own transformation, and it does not act on it".to_owned(),
        (true, true) => "only the position tables of the compensation act on it, its other errors under the control's own transformation".to_owned(),
        (false, _) => format!("{idle} of the {of} errors of the compensation act under the control's own transformation only"),
    };
    Some(
        Finding::info(
            "compensation::does_not_act",
            format!("program {} gives axis positions: {which}", plan.program),
        )
        .help("what these touches show is the machine without it, and an export takes its place; a program of `generate --tcp` shows what it leaves"),
    )
}

/// A compensation with errors of an axis that does not carry the blocks: the control then corrects what the blocks do not
/// do, and their readings hold that axis's errors with the other sign.
#[must_use]
pub fn beside_the_axis(compensation: &Compensation, machine: &Machine, plan: &Plan) -> Option<Finding> {
    let side = |axis| machine.axis(axis).map(|a| a.side);
    let beside = |axis| -> Vec<&str> {
        let carried = |b: &&PlanBlock| {
            machine.carrier(&b.carrier).is_none_or(|c| machine.carrier_chain(c).iter().any(|a| a.name == axis))
        };
        plan.blocks.iter().filter(|b| !carried(b)).map(|b| b.name.as_str()).collect()
    };
    let of_workpiece = compensation.terms.iter().filter(|t| t.value != 0.0 && side(t.axis) == Some(Side::Workpiece));
    let (term, blocks) = of_workpiece.map(|t| (t, beside(t.axis))).find(|(_, blocks)| !blocks.is_empty())?;
    if blocks.len() < plan.blocks.len() {
        let (which, they) = if blocks.len() == 1 { ("block", "it is") } else { ("blocks", "they are") };
        return Some(
            Finding::info(
                "compensation::beside_the_axis",
                format!(
                    "the compensation has errors of {}, which carries {} of the {} blocks of program {}, and not {which} {}",
                    term.axis,
                    plan.blocks.len() - blocks.len(),
                    plan.blocks.len(),
                    plan.program,
                    blocks.join(", ")
                ),
            )
            .help(format!("{they} read with the errors of {0} the wrong way round where {0} is turned", term.axis)),
        );
    }
    Some(
        Finding::warning(
            "compensation::beside_the_axis",
            format!("the compensation has errors of {}, which does not carry the blocks of program {}", term.axis, plan.program),
        )
        .help(format!(
            "such blocks are read with the errors of {0} the wrong way round: measure them with {0}'s values at 0, or use a program whose blocks {0} carries",
            term.axis
        )),
    )
}

/// What `export` wrote: the directory, or the compensation.json in it.
///
/// # Errors
/// When it is unusable or belongs to another machine.
pub fn load_compensation(path: &Path, machine: &Machine, env: &dyn Environment) -> Result<Compensation> {
    let inside = path.join("compensation.json");
    let compensation = Compensation::read(&env.source(if env.exists(&inside) { &inside } else { path })?)?;
    compensation.check_belongs(machine, &compensation.controller)?;
    Ok(compensation)
}
