//! What is known of the machine, whoever controls it: identified errors, what was active while they were measured, and
//! what is left out, each with its reason.

use super::compensation::{Compensation, Provenance, Term};
use super::place::{Dof, Meaning, Place, Spot, meaning};
use crate::axes::AxisName;
use crate::diag::{Finding, Findings, Result};
use crate::fit::outcome::{Outcome, Parameter, Status};
use crate::geometry::Displacement;
use crate::machine::{Machine, Side};
use crate::units::{deg_from_rad, mm_from_um, rad_from_deg, ratio_from_ppm, um_from_mm};
use nalgebra::Vector3;
use std::collections::BTreeMap;

/// Effects of the probe, the artefact and the run: they spoil a measurement, not the machine.
const OF_THE_MEASUREMENT: [&str; 14] = [
    "block-setup",
    "block-size",
    "block-shape",
    "block-slip",
    "block-temperature",
    "artefact-growth",
    "pretravel",
    "pretravel-axial",
    "lobing-2",
    "lobing-3",
    "tip-eccentricity",
    "stylus-sag",
    "latency",
    "sign-or-axis-swap",
];

/// An identified error of one axis's own position, which depends on nothing but that position and its sense.
pub struct AxisShape {
    /// Name of the parameter in the outcome.
    pub parameter: String,
    /// The axis.
    pub axis: AxisName,
    /// Component of the axis's error motion; along (linear) or about (rotary) its direction.
    pub dof: Dof,
    /// Names of the variables in its formula.
    pub variables: Vec<String>,
    /// Position relative to R's origin (mm or deg) and sense (+1 or -1) → error with the identified value (mm or deg).
    pub error: Box<dyn Fn(f64, f64) -> f64>,
}

impl std::fmt::Debug for AxisShape {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "AxisShape({} of {} {})", self.parameter, self.axis, self.dof)
    }
}

/// Something of the study that no place of a correction holds.
#[derive(Debug, Clone, PartialEq)]
pub struct LeftOut {
    /// ISO symbol.
    pub parameter: String,
    /// Id of its effect.
    pub effect: String,
    /// Its value.
    pub value: f64,
    /// Unit of the value.
    pub unit: String,
    /// Why.
    pub why: String,
    /// True when it is a known error of the machine, so that leaving it out leaves that error.
    pub known: bool,
}

/// Corrections of a machine. Displacements in mm, tilts in deg.
#[derive(Debug)]
pub struct Correction {
    /// Location and zero errors, by axis, place and component.
    pub terms: Vec<Term>,
    /// Errors of an axis's own position.
    pub shapes: Vec<AxisShape>,
    /// The tool is this much longer than the study assumed, mm: belongs into the tool table.
    pub tool_length_mm: Option<f64>,
    /// What is not carried.
    pub left_out: Vec<LeftOut>,
    /// Effects of the measurement with the number of their parameters.
    pub of_measurement: BTreeMap<String, usize>,
    /// Where `before` terms of workpiece-side axes are stated, mm in R.
    pub reference_mm: [f64; 3],
    /// What was active during the measurement.
    pub active: Option<Compensation>,
    /// Where it comes from.
    pub provenance: Provenance,
}

/// Above these an export is refused unless it is forced: such values are set-up faults, not location errors.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Limits {
    /// Displacements, mm.
    pub mm: f64,
    /// Tilts and zero positions, deg.
    pub deg: f64,
}

impl Default for Limits {
    /// Half a millimetre, 0.2°: ten times what a machine that was ever aligned shows.
    fn default() -> Self {
        Self { mm: 0.5, deg: 0.2 }
    }
}

/// Twelve decimals: below every control's resolution, and the same in JSON as in the control's own file.
#[must_use]
pub fn rounded(value: f64) -> f64 {
    let rounded = (value * 1e12).round() / 1e12;
    // a large value loses nothing by staying as it is; -0 is written as 0
    if rounded.is_finite() { rounded + 0.0 } else { value }
}

/// A value in mm or deg, if the unit is one of a displacement or an angle.
#[must_use]
pub fn in_mm_or_deg(value: f64, unit: &str, dof: Dof) -> Option<f64> {
    match (unit, dof.is_angle()) {
        ("mm", false) | ("deg", true) => Some(value),
        ("um", false) => Some(mm_from_um(value)),
        ("urad", true) => Some(deg_from_rad(ratio_from_ppm(value))),
        ("mrad", true) => Some(deg_from_rad(ratio_from_ppm(value * 1e3))),
        _ => None,
    }
}

/// How large an error a value leaves at a lever, µm; `None` where its unit says nothing about that.
#[must_use]
pub fn left_um(value: f64, unit: &str, lever_mm: f64) -> Option<f64> {
    let size = value.abs();
    Some(match unit {
        "mm" => um_from_mm(size),
        "um" => size,
        "deg" => um_from_mm(rad_from_deg(size) * lever_mm),
        "mrad" => um_from_mm(ratio_from_ppm(size * 1e3) * lever_mm),
        "urad" | "um/m" => um_from_mm(ratio_from_ppm(size) * lever_mm),
        _ => return None,
    })
}

struct Collector<'a> {
    machine: &'a Machine,
    identified: BTreeMap<Spot, Term>,
    correction: Correction,
    findings: Findings,
}

impl Correction {
    /// Collects what a fit found on top of what was active while its data were measured.
    ///
    /// Only parameters of status `identified` become corrections. `shapes` says which of the outcome's parameters are
    /// errors of one axis's own position.
    ///
    /// # Errors
    /// When the outcome or the active compensation belongs to another machine, or a value or name cannot be used.
    pub fn collect(
        machine: &Machine,
        outcome: &Outcome,
        active: Option<&Compensation>,
        shapes: Vec<AxisShape>,
        provenance: Provenance,
    ) -> Result<(Self, Findings)> {
        let mut collector = Collector {
            machine,
            identified: BTreeMap::new(),
            findings: Findings::default(),
            correction: Self {
                terms: Vec::new(),
                shapes: Vec::new(),
                tool_length_mm: None,
                left_out: Vec::new(),
                of_measurement: BTreeMap::new(),
                reference_mm: outcome.reference_mm,
                active: active.cloned(),
                provenance,
            },
        };
        if outcome.machine != machine.name {
            collector.error(
                "tables::other_machine",
                format!("the fit is of machine {:?}, not {:?}", outcome.machine, machine.name),
                "give the machine that the study names",
            );
        }
        let mut shapes: BTreeMap<String, AxisShape> = shapes.into_iter().map(|s| (s.parameter.clone(), s)).collect();
        for parameter in &outcome.parameters {
            collector.take(parameter, shapes.remove(&parameter.name));
        }
        collector.finish()
    }

    /// Values that a correction of location errors should never reach.
    #[must_use]
    pub fn beyond(&self, limits: &Limits) -> Vec<Finding> {
        let mut findings = Vec::new();
        for term in &self.terms {
            let limit = if term.dof.is_angle() { limits.deg } else { limits.mm };
            // the change too: a large step may hide in a small sum
            let (what, size) = if term.value.abs() >= term.identified.abs() {
                ("", term.value)
            } else {
                ("the change of ", term.identified)
            };
            if size.abs() > limit {
                findings.push(
                    Finding::error(
                        "tables::too_large",
                        format!(
                            "{what}{} ({}) is {size:.6} {unit}, above the limit of {limit} {unit}",
                            term.parameter,
                            term.effect,
                            unit = term.unit
                        ),
                    )
                    .help("look for a set-up fault (wrong block, wrong sense, wrong length) first; --force exports it all the same"),
                );
            }
        }
        findings
    }
}

impl Collector<'_> {
    fn error(&mut self, code: &'static str, message: String, help: &str) {
        self.findings.push(Finding::error(code, message).help(help));
    }

    fn leave_out(&mut self, p: &Parameter, known: bool, why: impl Into<String>) {
        self.correction.left_out.push(LeftOut {
            parameter: p.name.clone(),
            effect: p.effect.clone(),
            value: p.value,
            unit: p.unit.clone(),
            why: why.into(),
            known,
        });
    }

    fn take(&mut self, p: &Parameter, shape: Option<AxisShape>) {
        if OF_THE_MEASUREMENT.contains(&p.effect.as_str()) {
            *self.correction.of_measurement.entry(p.effect.clone()).or_default() += 1;
            return;
        }
        match p.status {
            Status::Identified => {}
            Status::Fixed => return self.leave_out(p, false, "held by the user, not identified"),
            Status::PriorDominated => return self.leave_out(p, false, "known from its prior, not from the data"),
            Status::Undetermined => return self.leave_out(p, false, "the data cannot tell it"),
        }
        if !p.value.is_finite() {
            return self.error(
                "tables::not_a_number",
                format!("{} ({}) is {}", p.name, p.effect, p.value),
                "the fit went wrong: run `axiscal identify` and read its warnings",
            );
        }
        match meaning(&p.effect, &p.name, self.machine) {
            Meaning::At(spot) => self.take_term(p, spot),
            Meaning::Unreadable => self.error(
                "tables::unknown_parameter",
                format!("{} of effect {} names no location error of machine {:?}", p.name, p.effect, self.machine.name),
                "the fit and the machine's description do not belong together",
            ),
            Meaning::Other if p.effect == "tool-length" => match in_mm_or_deg(p.value, &p.unit, Dof::Dz) {
                Some(mm) => self.correction.tool_length_mm = Some(rounded(mm)),
                None => self.leave_out(p, true, format!("a tool length in {:?}", p.unit)),
            },
            Meaning::Other => match shape {
                Some(shape) => self.take_shape(p, shape),
                None => self.leave_out(p, true, "no place in a location correction or an axis table holds it"),
            },
        }
    }

    fn take_term(&mut self, p: &Parameter, spot: Spot) {
        let Some(value) = in_mm_or_deg(p.value, &p.unit, spot.dof) else {
            return self.error(
                "tables::unit",
                format!("{} ({}) is in {:?}, expected {:?}", p.name, p.effect, p.unit, spot.dof.unit()),
                "location errors are stated in mm and deg",
            );
        };
        let sigma = p.sigma.and_then(|s| in_mm_or_deg(s, &p.unit, spot.dof));
        match self.identified.get_mut(&spot) {
            // two effects at one place add up component by component
            Some(term) => {
                term.identified += value;
                term.sigma = term.sigma.zip(sigma).map(|(a, b)| a.hypot(b));
                term.effect = format!("{}+{}", term.effect, p.effect);
            }
            None => {
                self.identified.insert(spot, blank(spot, &p.name, &p.effect, value, sigma));
            }
        }
    }

    fn take_shape(&mut self, p: &Parameter, shape: AxisShape) {
        let Some(axis) = self.machine.axis(shape.axis) else {
            return self.leave_out(p, true, format!("the machine has no axis {}", shape.axis));
        };
        let along = axis.direction[shape.dof.index() % 3].abs();
        if shape.dof.is_angle() != shape.axis.is_rotary() || (along - 1.0).abs() > 1e-9 {
            return self.leave_out(p, true, format!("{} moves {} across its own motion", shape.axis, shape.dof));
        }
        let (own, sense) = (shape.axis.to_string(), format!("s{}", shape.axis));
        if let Some(other) = shape.variables.iter().find(|v| **v != own && **v != sense) {
            return self.leave_out(
                p,
                true,
                format!("it depends on {other}, an axis table only on {own} and its sense"),
            );
        }
        self.correction.shapes.push(shape);
    }

    /// Adds what was active, restated at the new reference point.
    fn finish(mut self) -> Result<(Correction, Findings)> {
        let active: Vec<Term> = match &self.correction.active {
            Some(active) => restated(active, self.machine, self.correction.reference_mm),
            None => Vec::new(),
        };
        let mut terms = self.identified;
        for old in active {
            let term =
                terms.entry(old.spot()).or_insert_with(|| blank(old.spot(), &old.parameter, &old.effect, 0.0, None));
            term.active_before = rounded(old.value);
        }
        self.correction.terms = terms
            .into_values()
            .map(|mut term| {
                term.identified = rounded(term.identified);
                term.value = rounded(term.active_before + term.identified);
                term
            })
            .collect();
        self.findings.finish(self.correction)
    }
}

fn blank(spot: Spot, parameter: &str, effect: &str, identified: f64, sigma: Option<f64>) -> Term {
    Term {
        axis: spot.axis,
        place: spot.place,
        dof: spot.dof,
        value: identified,
        unit: spot.dof.unit().to_owned(),
        parameter: parameter.to_owned(),
        effect: effect.to_owned(),
        active_before: 0.0,
        identified,
        sigma,
    }
}

/// The terms of a compensation with workpiece-side displacements stated at another point.
///
/// E about c1 by d1 is E about c2 by d1 + (R - 1)(c2 - c1), with R its rotation: exact, so the same transform.
fn restated(active: &Compensation, machine: &Machine, reference_mm: [f64; 3]) -> Vec<Term> {
    let mut terms = active.terms.clone();
    let shift = Vector3::from(reference_mm) - Vector3::from(active.reference_mm);
    if shift == Vector3::zeros() {
        return terms;
    }
    for axis in machine.rotary().filter(|a| a.side == Side::Workpiece) {
        let mut e = Displacement::default();
        for dof in Dof::ALL.into_iter().filter(|d| d.is_angle()) {
            let value = active.value(Spot { axis: axis.name, place: Place::Before, dof });
            e.add(dof.index(), rad_from_deg(value));
        }
        let moved = e.rotation() * shift - shift;
        for dof in [Dof::Dx, Dof::Dy, Dof::Dz] {
            let spot = Spot { axis: axis.name, place: Place::Before, dof };
            let by = moved[dof.index()];
            if let Some(term) = terms.iter_mut().find(|t| t.spot() == spot) {
                term.value += by;
            } else if by.abs() > 1e-12 {
                let parameter = format!("E{}0{}", dof.iso_letter(), axis.name);
                terms.push(blank(spot, &parameter, "restated reference", by, None));
            }
        }
    }
    terms
}
