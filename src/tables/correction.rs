//! What is known of the machine, whoever controls it: identified errors, what was active while they were measured, and
//! what is left out, each with its reason.

use super::compensation::{Compensation, Provenance, Term};
use super::place::{Meaning, Place, Spot, across, coordinate_off, meaning};
use super::restate::{is_known, restated};
use crate::axes::AxisName;
use crate::diag::{Finding, Findings, Result};
use crate::fit::outcome::{Outcome, Parameter, Status};
use crate::machine::{Axis, Machine};
use crate::model::catalogue::{Catalogue, Effect, Place as At};
use crate::model::formula::VARIABLES;
use crate::units::{deg_from_rad, rad_from_deg, rad_from_mrad, ratio_from_ppm, um_from_mm};
use std::collections::{BTreeMap, BTreeSet};

/// How much further an axis stands than it shows: coordinate relative to R's origin (mm or deg) and sense (+1 or -1) →
/// mm or deg.
pub type CoordinateError = std::rc::Rc<dyn Fn(f64, f64) -> f64>;

/// An identified error of one axis's position, which depends on nothing but one axis's position and its sense.
#[derive(Clone)]
pub struct AxisShape {
    /// Name of the parameter.
    pub parameter: String,
    /// Id of its effect.
    pub effect: String,
    pub axis: AxisName,
    pub value: f64,
    /// Unit of the value.
    pub unit: String,
    /// The axis by whose position: the same one, or another.
    pub input: AxisName,
    /// With the identified value; of the input's coordinate and sense.
    pub error: CoordinateError,
}

impl std::fmt::Debug for AxisShape {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "AxisShape({} ({}) of {})", self.parameter, self.effect, self.axis)
    }
}

/// Something of the study that no place of a correction holds.
#[derive(Debug, Clone, PartialEq)]
pub struct LeftOut {
    /// ISO symbol.
    pub parameter: String,
    /// Id of its effect.
    pub effect: String,
    pub value: f64,
    /// Unit of the value.
    pub unit: String,
    pub why: String,
    /// True when it is a known error of the machine, so that leaving it out leaves that error.
    pub known: bool,
}

/// Corrections of a machine. Displacements in mm, tilts in deg.
#[derive(Debug, Clone, Default)]
pub struct Correction {
    /// Location and zero errors, by axis, place and component.
    pub terms: Vec<Term>,
    /// Errors of an axis's own position.
    pub shapes: Vec<AxisShape>,
    /// Errors of a linear axis by the position of another one. They are in `left_out` too: few controls have a place.
    pub across: Vec<AxisShape>,
    /// The tool is this much longer than the study assumed, mm: belongs into the tool table.
    pub tool_length_mm: Option<f64>,
    /// What is not carried.
    pub left_out: Vec<LeftOut>,
    /// Effects of the measurement with the number of their parameters.
    pub of_measurement: BTreeMap<String, usize>,
    /// Where `before` terms of workpiece-side axes are stated, mm in R.
    pub reference_mm: [f64; 3],
    /// Tilts that the study holds: they are written nowhere.
    pub held_tilts: Vec<Term>,
    /// Where the study found something.
    pub found: BTreeSet<Spot>,
    /// What was loaded during the measurement.
    pub active: Option<Compensation>,
    /// The control's own transformation was on while the touches were made: what it held acted on them.
    pub transformation: bool,
    /// From where to where the programs of the study moved each axis, relative to R's origin, mm or deg; empty where that is
    /// not known.
    pub used: BTreeMap<AxisName, [f64; 2]>,
    /// Where it comes from.
    pub provenance: Provenance,
}

/// What the control did while the touches were made.
#[derive(Debug, Clone, Copy, Default)]
pub struct During<'a> {
    /// The compensation that was loaded.
    pub loaded: Option<&'a Compensation>,
    /// The control's own transformation was on (programs of `generate --tcp`). Without it a touch shows the bare machine,
    /// whatever vectors and pins the control holds.
    pub transformation: bool,
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

/// How large an error a value leaves at a lever, µm; `None` where its unit says nothing about that.
#[must_use]
pub fn left_um(value: f64, unit: &str, lever_mm: f64) -> Option<f64> {
    let size = value.abs();
    Some(match unit {
        "mm" => um_from_mm(size),
        "um" => size,
        "deg" => um_from_mm(rad_from_deg(size) * lever_mm),
        "mrad" => um_from_mm(rad_from_mrad(size) * lever_mm),
        "urad" | "um/m" => um_from_mm(ratio_from_ppm(size) * lever_mm),
        _ => return None,
    })
}

/// A formula must have a value at so many points along its axis.
const FORMULA_STEPS: u32 = 1001;

struct Collector<'a> {
    machine: &'a Machine,
    outcome: &'a Outcome,
    identified: BTreeMap<Spot, Term>,
    correction: Correction,
    findings: Findings,
}

impl Correction {
    /// Collects what a fit found on top of what acted while its data were measured.
    ///
    /// Only parameters of status `identified` become corrections; the catalogue says what each of them means. What was loaded
    /// and did not act is replaced where something was found, and kept elsewhere.
    ///
    /// # Errors
    /// When the outcome belongs to another machine, the catalogue lacks one of its effects, or a value is not a number.
    pub fn collect(
        machine: &Machine,
        catalogue: &Catalogue,
        outcome: &Outcome,
        during: During,
        provenance: Provenance,
    ) -> Result<(Self, Findings)> {
        let mut collector = Collector {
            machine,
            outcome,
            identified: BTreeMap::new(),
            findings: Findings::default(),
            correction: Self {
                terms: Vec::new(),
                shapes: Vec::new(),
                across: Vec::new(),
                tool_length_mm: None,
                left_out: Vec::new(),
                of_measurement: BTreeMap::new(),
                reference_mm: outcome.reference_mm,
                held_tilts: Vec::new(),
                found: BTreeSet::new(),
                active: during.loaded.cloned(),
                transformation: during.transformation,
                used: BTreeMap::new(),
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
        for parameter in &outcome.parameters {
            match catalogue.get(&parameter.effect, machine) {
                Some(effect) => collector.take(parameter, effect),
                None => collector.error(
                    "tables::unknown_effect",
                    format!(
                        "{} is of effect {:?}, which machine {:?} has not",
                        parameter.name, parameter.effect, machine.name
                    ),
                    "give the effects file that the study names",
                ),
            }
        }
        collector.combinations(catalogue);
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

    /// Several errors of the machine of which only a combination can be measured: without any of them the compensation would
    /// leave an error that the touches show. One that is told apart from the block positions only does no harm.
    fn combinations(&mut self, catalogue: &Catalogue) {
        for undetermined in &self.outcome.undetermined {
            let members: Vec<&Parameter> = self
                .outcome
                .parameters
                .iter()
                .filter(|p| p.status == Status::Undetermined && undetermined.combination.contains_key(&p.name))
                .filter(|p| {
                    let effect = catalogue.get(&p.effect, self.machine);
                    let index = |e: &Effect| e.parameters.iter().position(|known| known.name == p.name);
                    let meant = effect.and_then(|e| Some(meaning(e, index(e)?, self.machine)));
                    matches!(meant, Some(Meaning::Location(_) | Meaning::Position(_) | Meaning::ToolLength(_)))
                })
                .collect();
            if members.len() < 2 {
                continue;
            }
            let names: Vec<String> = members.iter().map(|p| format!("{} ({})", p.name, p.effect)).collect();
            let last = members.last().map_or_else(String::new, |p| p.effect.clone());
            if let Some(um) = undetermined.moves_um {
                self.correction.left_out.push(LeftOut {
                    parameter: members.iter().map(|p| p.name.as_str()).collect::<Vec<_>>().join(" with "),
                    effect: last.clone(),
                    value: rounded(um),
                    unit: "um".to_owned(),
                    why: "the touches determine only a combination of these errors; the value is its largest effect on a touch"
                        .to_owned(),
                    known: true,
                });
            }
            self.findings.push(
                Finding::warning(
                    "tables::combination",
                    format!(
                        "only a combination of {} can be measured with these touches: they are not exported",
                        names.join(", ")
                    ),
                )
                .help(format!(
                    "take one of these effects out of the model (`axiscal remove STUDY {last}`), or hold one value in \
                     [model.parameters]: the others then include it"
                )),
            );
        }
    }

    fn take(&mut self, p: &Parameter, effect: &Effect) {
        let named = effect.parameters.iter().position(|known| known.name == p.name);
        let meaning = match named {
            Some(index) => meaning(effect, index, self.machine),
            // a parameter of a block or a run carries it in its name
            None if effect.is_repeated() => Meaning::Measurement,
            None => {
                return self.error(
                    "tables::unknown_parameter",
                    format!("effect {:?} has no parameter {:?}", p.effect, p.name),
                    "the fit and the effects file do not belong together",
                );
            }
        };
        if meaning == Meaning::Measurement {
            *self.correction.of_measurement.entry(p.effect.clone()).or_default() += 1;
            return;
        }
        match p.status {
            Status::Identified => {}
            Status::Fixed => {
                if let Meaning::Location(spots) = &meaning {
                    let tilts = spots.iter().filter(|(spot, _)| spot.dof.is_angle() && spot.place == Place::Before);
                    let held = tilts.map(|(spot, per)| blank(*spot, &p.name, &p.effect, p.value * per, None));
                    self.correction.held_tilts.extend(held);
                }
                return self.leave_out(p, false, "held by the user, not identified");
            }
            Status::PriorDominated => return self.leave_out(p, false, "known from its prior, not from the data"),
            Status::Undetermined => return self.leave_out(p, false, "these touches cannot determine it"),
        }
        if !p.value.is_finite() {
            return self.error(
                "tables::not_a_number",
                format!("{} ({}) is {}", p.name, p.effect, p.value),
                "the fit went wrong: run `axiscal identify` and read its warnings",
            );
        }
        match meaning {
            Meaning::Location(spots) => {
                for (spot, per_unit) in spots {
                    self.take_term(p, spot, per_unit);
                }
            }
            Meaning::ToolLength(per_unit) => {
                let sum = self.correction.tool_length_mm.unwrap_or(0.0) + p.value * per_unit;
                self.correction.tool_length_mm = Some(rounded(sum));
            }
            Meaning::Position(axis) => match self.shape(p, effect, axis, axis) {
                Ok(shape) => self.correction.shapes.push(shape),
                Err(why) => self.leave_out(p, true, why),
            },
            Meaning::Nothing(why) => {
                let index = effect.parameters.iter().position(|known| known.name == p.name);
                // a time constant is no error of its own
                let known = index.and_then(|i| effect.parameters.get(i)).is_none_or(|known| known.shape.is_none());
                self.leave_out(p, known, why);
                let found = index.and_then(|i| across(effect, i, self.machine));
                if let Some(Ok(shape)) = found.map(|(input, output)| self.shape(p, effect, input, output)) {
                    self.correction.across.push(shape);
                }
            }
            Meaning::Measurement => {}
        }
    }

    fn take_term(&mut self, p: &Parameter, spot: Spot, per_unit: f64) {
        let (value, sigma) = (p.value * per_unit, p.sigma.map(|s| s * per_unit.abs()));
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

    /// The error of `output`'s position by that of `input`, or why it cannot be computed.
    fn shape(&self, p: &Parameter, effect: &Effect, input: AxisName, output: AxisName) -> Result<AxisShape, String> {
        let none = || "the machine has no such axis".to_owned();
        let axis = self.machine.axis(output).cloned().ok_or_else(none)?;
        let index = effect.parameters.iter().position(|known| known.name == p.name).ok_or_else(none)?;
        // a formula may hold other parameters of its effect: they must be known to be used
        let mut values = Vec::new();
        for known in &effect.parameters {
            let found = self.outcome.parameters.iter().find(|o| o.effect == effect.id && o.name == known.name);
            let usable =
                found.filter(|o| known.shape.is_none() || matches!(o.status, Status::Identified | Status::Fixed));
            let other = usable.ok_or_else(|| format!("{} in its formula is not known", known.name))?;
            values.push(other.value);
        }
        let terms: Vec<_> = effect.terms.iter().filter(|t| t.parameter == index).cloned().collect();
        let amount = p.value * effect.parameters[index].factor;
        // what is across moves with the side that its own axis stands on, not with that of the axis that mends it
        let of = match terms.first().map(|t| t.place) {
            Some(At::Before(name) | At::After(name)) => self.machine.axis(name).map(|a| a.side),
            _ => None,
        };
        let mends = Axis { side: of.unwrap_or(axis.side), ..axis };
        let error = move |q: f64, sense: f64| -> f64 {
            let mut state = [0.0; VARIABLES.len()];
            for (variable, slot) in VARIABLES.iter().zip(&mut state) {
                if *variable == input.to_string() {
                    *slot = if input.is_rotary() { rad_from_deg(q) } else { q };
                } else if *variable == format!("s{input}") {
                    *slot = sense;
                }
            }
            let off: f64 =
                terms.iter().map(|t| coordinate_off(t, &mends, amount * t.formula.eval(&state, &values))).sum();
            if mends.name.is_rotary() { deg_from_rad(off) } else { off }
        };
        let range = self.machine.axis(input).map_or([0.0, 0.0], |a| a.range);
        // an odd count of steps: 0 is looked at by itself
        let along =
            (0..=FORMULA_STEPS).map(|i| range[0] + (range[1] - range[0]) * f64::from(i) / f64::from(FORMULA_STEPS));
        let no_value = |q: &f64| ![1.0, -1.0].iter().all(|sense| error(*q, *sense).is_finite());
        if let Some(q) = std::iter::once(0.0).chain(along).find(no_value) {
            return Err(format!("its formula has no value at {input} = {q}"));
        }
        Ok(AxisShape {
            parameter: p.name.clone(),
            effect: p.effect.clone(),
            value: p.value,
            unit: p.unit.clone(),
            axis: output,
            input,
            error: std::rc::Rc::new(error),
        })
    }

    /// Adds what was active, restated at the new reference point.
    fn finish(mut self) -> Result<(Correction, Findings)> {
        let loaded = self.correction.active.clone();
        let mut terms = self.identified;
        self.correction.found = terms.keys().copied().collect();
        if let Some(loaded) = loaded {
            let to = self.correction.reference_mm;
            for old in restated(&loaded.terms, self.machine, loaded.reference_mm, to) {
                let acted = self.correction.transformation || loaded.acts_without_transformation(self.machine, &old);
                // the touches show the whole error; what a tilt made of a place along its line is made anew
                let offset = old.place == Place::Before && !old.dof.is_angle();
                let told =
                    terms.contains_key(&old.spot()) || (offset && is_known(self.machine, &self.correction, old.spot()));
                if !acted && told {
                    continue;
                }
                let term = terms
                    .entry(old.spot())
                    .or_insert_with(|| blank(old.spot(), &old.parameter, &old.effect, 0.0, None));
                term.active_before = rounded(old.value);
            }
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

pub(super) fn blank(spot: Spot, parameter: &str, effect: &str, identified: f64, sigma: Option<f64>) -> Term {
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
