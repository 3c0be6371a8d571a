//! The control between program and axes: what an exported compensation makes of a commanded position.

mod component;

use super::chain::{Chain, Stylus};
use super::rigid::{Vec3, plus};
use crate::axes::Position;
use crate::diag::{Finding, Findings, Result, Source, from_json};
use crate::machine::Machine;
use component::Component;
use serde::Deserialize;

/// The format line of a compensation.
pub const FORMAT: &str = "axiscal-compensation/1";

/// A compensation as the control applies it.
#[derive(Debug, Clone)]
pub struct Compensation {
    kind: Kind,
}

#[derive(Debug, Clone)]
enum Kind {
    Component(Component),
}

/// `compensation.json` as it is written.
#[derive(Debug, Deserialize)]
struct Written {
    format: String,
    machine: String,
    mode: String,
    #[serde(default)]
    reference_mm: Option<Vec3>,
    #[serde(default)]
    terms: Vec<WrittenTerm>,
}

/// An error that the control takes into account.
#[derive(Debug, Deserialize)]
struct WrittenTerm {
    axis: String,
    place: String,
    dof: String,
    value: f64,
    unit: String,
}

impl Compensation {
    /// Reads `compensation.json` of an export.
    ///
    /// # Errors
    /// When the text is not of this form, or was made for another machine.
    pub fn parse(source: &Source, machine: &Machine) -> Result<(Self, Findings)> {
        let written: Written = serde_json::from_str(source.inner()).map_err(|e| {
            from_json(&e, source, "compensation::not_json")
                .help("a compensation is written by `axiscal export` (axiscal-compensation/1)")
        })?;
        let mut findings = Findings::default();
        let mut error = |code, message: String, help: &str| {
            findings.push(Finding::error(code, message).help(help).at(source, 0..0));
        };
        if written.format != FORMAT {
            error(
                "compensation::format",
                format!("format is {:?}, expected {FORMAT:?}", written.format),
                "is this a compensation? `axiscal export` writes compensation.json",
            );
        }
        if written.machine != machine.name {
            error(
                "compensation::machine",
                format!("the compensation is for {:?}, not for {:?}", written.machine, machine.name),
                "name the machine that it was exported for with --machine",
            );
        }
        let kind = match written.mode.as_str() {
            "component" => Component::new(&written, machine, &mut error).map(Kind::Component),
            other => {
                error(
                    "compensation::mode",
                    format!("mode is {other:?}, expected \"component\""),
                    "export again with this version",
                );
                None
            }
        };
        let (kind, findings) = findings.finish(kind)?;
        match kind {
            Some(kind) => Ok((Self { kind }, findings)),
            // only a refused kind leaves nothing, and its error has left above
            None => Err(Finding::error("compensation::empty", "the compensation holds nothing").into()),
        }
    }

    /// How the control moves the axes during a touch: rotary axes at `pose`, `nominal` the errorless machine.
    ///
    /// # Errors
    /// When the control could not move there.
    pub(super) fn mapping(&self, nominal: &Chain, pose: &Position, stylus: Stylus) -> Result<Mapping, &'static str> {
        match &self.kind {
            Kind::Component(component) => component.mapping(nominal, pose, stylus),
        }
    }
}

/// Commanded position → positions of the axes, for one pose of the rotary axes.
#[derive(Debug, Clone, Copy)]
pub enum Mapping {
    /// The control moves the axes as they are commanded.
    Direct,
    /// Linear axes = offset + columns · commanded linear axes.
    Affine {
        /// mm at commanded zero.
        offset: Vec3,
        /// What each commanded mm does.
        columns: [Vec3; 3],
    },
}

impl Mapping {
    /// Does a straight commanded line give a straight line of the axes?
    pub fn is_affine(&self) -> bool {
        match self {
            Self::Direct | Self::Affine { .. } => true,
        }
    }

    /// The axes' positions for a commanded position.
    pub fn joints(&self, commanded: &Position) -> Position {
        match self {
            Self::Direct => *commanded,
            Self::Affine { offset, columns } => {
                let mut out = *commanded;
                let mut linear = *offset;
                for (column, q) in columns.iter().zip(commanded.0) {
                    linear = plus(linear, q, *column);
                }
                out.0[..3].copy_from_slice(&linear);
                out
            }
        }
    }
}
