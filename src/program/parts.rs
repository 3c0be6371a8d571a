//! Parts of a program: stages that are made with the same blocks in the same place and the same stylus. Between two parts
//! the program stops, for a person puts up other blocks or changes the stylus.

use super::as_written::Placed;
use super::plan::PlanBlock;
use super::spec::{At, ProgramSpec};
use crate::diag::Finding;
use crate::machine::{Machine, Mounting, Stylus};
use crate::units::Plain;
use std::collections::BTreeSet;

/// What a stage writes for the probe's own stylus.
pub(super) const OWN_STYLUS: &str = "own";

/// A part as the program's file names it.
#[derive(Debug, Clone)]
pub struct PartSpec {
    pub mounting: At<String>,
    /// Name of the blocks as they stand: that of the mounting, and `NAME#2`, `NAME#3` … when they are put up anew.
    pub label: String,
    /// The stylus; `None`: the probe's own.
    pub stylus: Option<At<String>>,
}

/// The part to which a stage belongs, as a place in `parts`: the last one, or a new one.
pub(super) fn part_of(
    parts: &mut Vec<PartSpec>,
    mounting: At<String>,
    stylus: Option<At<String>>,
    placed: Option<Placed>,
) -> usize {
    let stylus = stylus.filter(|s| s.value != OWN_STYLUS);
    let stands = parts.last().is_some_and(|p| p.mounting.value == mounting.value);
    let placed = placed.unwrap_or(if stands { Placed::Same } else { Placed::Anew });
    let earlier: Vec<&PartSpec> = parts.iter().filter(|p| p.mounting.value == mounting.value).collect();
    let label = match (earlier.last(), placed) {
        (None, _) => mounting.value.clone(),
        (Some(last), Placed::Same) => last.label.clone(),
        (Some(_), Placed::Anew) => {
            let times = earlier.iter().map(|p| &p.label).collect::<BTreeSet<_>>().len();
            format!("{}#{}", mounting.value, times + 1)
        }
    };
    let name = |stylus: &Option<At<String>>| stylus.as_ref().map(|s| s.value.clone());
    if parts.last().is_none_or(|p| p.label != label || name(&p.stylus) != name(&stylus)) {
        parts.push(PartSpec { mounting, label, stylus });
    }
    parts.len() - 1
}

/// A part on a machine.
#[derive(Debug, Clone)]
pub struct Part<'a> {
    /// Name of the blocks as they stand; plans carry it.
    pub label: String,
    /// The artefact.
    pub mounting: &'a Mounting,
    /// The stylus; `None`: the probe's own.
    pub stylus: Option<&'a Stylus>,
    /// The machine with this stylus in its probe.
    pub machine: Machine,
}

impl<'a> Part<'a> {
    /// A part on a machine.
    ///
    /// # Errors
    /// What the machine lacks, with its place in the program's file.
    pub(super) fn on(machine: &'a Machine, spec: &ProgramSpec, part: &PartSpec) -> Result<Self, Vec<Finding>> {
        let mut lacks = Vec::new();
        let mounting = machine.mounting(&part.mounting.value);
        if mounting.is_none() {
            let names: Vec<&str> = machine.mountings.iter().map(|m| m.name.as_str()).collect();
            lacks.push(spec.error(
                &part.mounting.span,
                "program::unknown_mounting",
                format!("{} has no mounting {:?}", machine.name, part.mounting.value),
                format!("it has: {}; a mounting is described in the machine's file", names.join(", ")),
            ));
        }
        let (mut stylus, mut with_it) = (None, machine.clone());
        if let Some(named) = &part.stylus {
            stylus = machine.styli.iter().find(|s| s.name == named.value);
            match machine.with_stylus(&named.value) {
                Some(machine) => with_it = machine,
                None => {
                    let names: Vec<&str> = machine.styli.iter().map(|s| s.name.as_str()).collect();
                    lacks.push(spec.error(
                        &named.span,
                        "program::unknown_stylus",
                        format!("{} has no stylus {:?}", machine.name, named.value),
                        format!(
                            "it has: {}; styli are described in the machine's file, {OWN_STYLUS:?} is the probe's own",
                            if names.is_empty() {
                                "no other than the probe's own".to_owned()
                            } else {
                                names.join(", ")
                            }
                        ),
                    ));
                }
            }
        }
        match mounting {
            Some(mounting) if lacks.is_empty() => {
                Ok(Self { label: part.label.clone(), mounting, stylus, machine: with_it })
            }
            _ => Err(lacks),
        }
    }

    /// Name, ball and length of the stylus, in words.
    #[must_use]
    pub fn stylus_says(&self) -> String {
        let name = self.stylus.map_or_else(|| "probe's own stylus".to_owned(), |s| format!("stylus {}", s.name));
        format!("{name}: {}", self.probe_says())
    }

    /// Ball and length of the stylus, in words.
    #[must_use]
    pub fn probe_says(&self) -> String {
        format!(
            "ball {} mm across, stem {} mm, {} mm from the pivot or gauge line to the ball's centre",
            Plain(2.0 * self.machine.probe.ball_radius),
            Plain(self.machine.probe.stem_length),
            Plain(self.machine.tool.length_mm)
        )
    }
}

/// Length or radius of a part's stylus where it is not that of the first part, which the plan's head carries.
pub(super) fn where_it_differs(own: f64, first: f64) -> Option<f64> {
    (own.to_bits() != first.to_bits()).then_some(own)
}

/// The blocks of all parts as a plan holds them, each once.
pub(super) fn plan_blocks(parts: &[Part]) -> Vec<PlanBlock> {
    let first = parts.first().map(|p| p.label.as_str());
    let mut seen = BTreeSet::new();
    parts
        .iter()
        .filter(|p| seen.insert(p.label.clone()))
        .flat_map(|part| {
            part.mounting.blocks.iter().map(move |b| PlanBlock {
                name: b.name.clone(),
                carrier: b.carrier.to_string(),
                mounting: (Some(part.label.as_str()) != first).then(|| part.label.clone()),
                form: b.form,
                centre: b.centre.into(),
                size: b.size.into(),
                diameter: b.diameter,
            })
        })
        .collect()
}
