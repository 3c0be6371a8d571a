//! `compensation.json` (`axiscal-compensation/1`): what a control was given, parameter by parameter.
//!
//! It is written beside the controller's own files, read back as "what was active during the measurement", and read by the
//! virtual machine. It holds no sign or unit that the controller's own files do not hold.

use super::place::{Dof, Place, Spot, along};
use crate::axes::AxisName;
use crate::diag::{Failure, Finding, Findings, Result, Source, from_json};
use crate::machine::Machine;
use crate::post::tables::{LengthUnit, Point, Turn};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// The format line.
pub const FORMAT: &str = "axiscal-compensation/1";

/// How the control applies it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Mode {
    /// By the kinematics component of the machine's own chain: every term.
    Component,
    /// By what the control has without it.
    Stock,
    /// By the tables of the control's own transformation.
    Table,
}

impl std::fmt::Display for Mode {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Component => "component",
            Self::Stock => "stock",
            Self::Table => "table",
        })
    }
}

/// One carried parameter: mm or deg.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Term {
    /// The rotary axis whose location it is.
    pub axis: AxisName,
    /// Relative to the axis's rotation.
    pub place: Place,
    /// Component.
    pub dof: Dof,
    /// What the control is given: `active_before + identified`, mm or deg.
    pub value: f64,
    /// `mm` or `deg`.
    pub unit: String,
    /// ISO symbol.
    pub parameter: String,
    /// Id of the effect that it was identified with.
    pub effect: String,
    /// What the control applied during the measurement, mm or deg.
    pub active_before: f64,
    /// What the study found on top of that (0 where it found nothing), mm or deg.
    pub identified: f64,
    /// Standard uncertainty of `identified`, mm or deg.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sigma: Option<f64>,
}

impl Term {
    /// Where it stands.
    #[must_use]
    pub fn spot(&self) -> Spot {
        Spot { axis: self.axis, place: self.place, dof: self.dof }
    }
}

/// What the control's own means carry, without a kinematics component.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Stock {
    /// The kinematics module that the pins belong to, if one describes the machine.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub module: Option<String>,
    /// Its pins, mm.
    #[serde(default)]
    pub pins: BTreeMap<String, f64>,
    /// How far the workpiece's zero stands off the nominal one in the module's world coordinates, mm.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub workpiece_shift_mm: Option<[f64; 3]>,
    /// To be added to the machine's own `[JOINT_n] HOME_OFFSET`, deg.
    #[serde(default)]
    pub home_offset_deg: BTreeMap<AxisName, f64>,
    /// Axis compensation tables.
    #[serde(default)]
    pub axis_tables: BTreeMap<AxisName, AxisTable>,
}

/// A table of one axis's own position: LinuxCNC's type 1.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct AxisTable {
    /// Number of the joint.
    pub joint: usize,
    /// Name of the file.
    pub file: String,
    /// Nominal, nominal - actual when moving up, the same when moving down: machine coordinates, mm or deg.
    pub rows: Vec<[f64; 3]>,
}

impl AxisTable {
    /// What the control adds to the command at a machine coordinate, moving up or down; the end values hold outside.
    #[must_use]
    pub fn at(&self, nominal: f64, up: bool) -> f64 {
        let column = if up { 1 } else { 2 };
        let above = self.rows.iter().position(|row| row[0] >= nominal);
        match above {
            None => self.rows.last().map_or(0.0, |row| row[column]),
            Some(0) => self.rows[0][column],
            Some(i) => {
                let (a, b) = (&self.rows[i - 1], &self.rows[i]);
                let share = (nominal - a[0]) / (b[0] - a[0]);
                a[column] + share * (b[column] - a[column])
            }
        }
    }
}

/// What the control's own tables hold: the same numbers as its files.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Tables {
    /// What the control calls this kind of machine.
    pub kind: String,
    /// Unit of lengths in the files; here they are in mm.
    pub unit: LengthUnit,
    /// Which reader of the virtual machine knows the files; none: it takes the numbers below.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reads: Option<String>,
    /// The files that are to be loaded.
    pub files: Vec<String>,
    /// The vectors.
    pub vectors: Vec<Vector>,
    /// By the control's name: what the files hold, in their unit. A later backup must hold the same.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub values: BTreeMap<String, f64>,
    /// By rotary axis: the coordinate at which it really stands at zero, deg.
    #[serde(default)]
    pub zero_deg: BTreeMap<AxisName, f64>,
    /// Tables of one axis's correction by another's position.
    #[serde(default)]
    pub grids: Vec<Grid>,
    /// How far the workpiece stands off in the control's coordinates, at the ball's place at zero, mm.
    pub workpiece_shift_mm: [f64; 3],
    /// Entries that nobody has verified on a control, and why; `--accept-unverified` wrote them all the same.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub unverified: BTreeMap<String, String>,
}

/// A vector as it is written.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Vector {
    /// Its short name.
    pub id: String,
    /// Between these points.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub between: Option<[Point; 2]>,
    /// Or the direction of this axis.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub direction: Option<Turn>,
    /// A direction against the motion.
    #[serde(default)]
    pub against: bool,
    /// mm, or components of a direction.
    pub value: [f64; 3],
}

/// A table of one axis's correction by another's position (or its own), machine coordinates, mm and deg.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Grid {
    /// The control's number of it.
    pub number: usize,
    /// By whose position.
    pub input: AxisName,
    /// Whose correction.
    pub output: AxisName,
    /// 0: in both senses; 1, -1: while the input moves up, down.
    pub sense: i8,
    /// First point.
    pub min: f64,
    /// Distance of two points.
    pub step: f64,
    /// After the last point the first follows.
    pub modulo: bool,
    /// What is added to the output's position.
    pub values: Vec<f64>,
}

impl Grid {
    /// Last point.
    #[must_use]
    pub fn max(&self) -> f64 {
        self.min + self.step * (self.values.len().max(1) - 1) as f64
    }

    /// What it adds at a coordinate of its input, mm or deg.
    #[must_use]
    pub fn at(&self, position: f64) -> f64 {
        let last = self.values.len().saturating_sub(1);
        let value = |i: usize| self.values.get(i.min(last)).copied().unwrap_or(0.0);
        let span = self.max() - self.min;
        let off = position - self.min;
        let place = if self.modulo && span > 0.0 { off.rem_euclid(span) } else { off.clamp(0.0, span) } / self.step;
        let low = place.floor().max(0.0);
        value(low as usize) + (place - low) * (value(low as usize + 1) - value(low as usize))
    }
}

/// Where a compensation comes from.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct Provenance {
    /// Name of the study.
    pub study: String,
    /// SHA-256 of the study file, hexadecimal.
    pub study_sha256: String,
    /// When the data were measured, as the caller states it.
    pub data_date: String,
    /// What spoke against this export, which `--force` wrote all the same.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub forced: Vec<String>,
}

/// The whole file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Compensation {
    /// `axiscal-compensation/1`
    pub format: String,
    /// Id of the controller.
    pub controller: String,
    /// Name of the machine.
    pub machine: String,
    /// SHA-256 of the machine's description.
    pub machine_sha256: String,
    /// How the control applies it.
    pub mode: Mode,
    /// Name of the kinematics component.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub component: Option<String>,
    /// Where `before` terms of workpiece-side axes are stated, mm in R.
    pub reference_mm: [f64; 3],
    /// The carried parameters.
    pub terms: Vec<Term>,
    /// What the control's own means carry.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub stock: Option<Stock>,
    /// What the control's own tables hold.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tables: Option<Tables>,
    /// Version of the program that wrote it.
    #[serde(default)]
    pub program: String,
    /// Where it comes from.
    #[serde(flatten)]
    pub provenance: Provenance,
}

impl Compensation {
    /// Reads the file; nothing in it can be a NaN, an unsorted table or a term that stands twice.
    ///
    /// # Errors
    /// When it is not JSON of this form, with its place.
    pub fn read(source: &Source) -> Result<Self> {
        let read: Self = serde_json::from_str(source.inner()).map_err(|e| {
            from_json(&e, source, "compensation::not_json")
                .help("give the compensation.json that `axiscal export` wrote, unedited")
        })?;
        let mut findings = Findings::default();
        let mut wrong = |message: String| {
            findings.push(
                Finding::error("compensation::damaged", message)
                    .at(source, 0..0)
                    .help("was it edited by hand? take the file that `axiscal export` wrote"),
            );
        };
        if read.format != FORMAT {
            wrong(format!("format is {:?}, expected {FORMAT:?}", read.format));
        }
        let mut seen = std::collections::BTreeSet::new();
        for term in &read.terms {
            let name = format!("{} {} {}", term.axis, term.place, term.dof);
            if !seen.insert(term.spot()) {
                wrong(format!("term {name} stands twice"));
            }
            if !term.axis.is_rotary() {
                wrong(format!("term {name}: {} is no rotary axis", term.axis));
            }
            if term.unit != term.dof.unit() {
                wrong(format!("term {name} is in {:?}, expected {:?}", term.unit, term.dof.unit()));
            }
            if term.place == Place::Zero && !term.dof.is_angle() {
                wrong(format!("term {name}: a zero position is an angle"));
            }
            if !(term.value.is_finite() && term.active_before.is_finite() && term.identified.is_finite()) {
                wrong(format!("term {name} is not a number"));
            }
        }
        if !read.reference_mm.iter().all(|v| v.is_finite()) {
            wrong("reference_mm is not a point".to_owned());
        }
        if !read.tables.iter().flat_map(|t| t.values.values()).all(|v| v.is_finite()) {
            wrong("a value of the tables is not a number".to_owned());
        }
        for grid in read.tables.iter().flat_map(|t| &t.grids) {
            let numbers = [grid.min, grid.step].iter().chain(&grid.values).all(|v| v.is_finite());
            if grid.values.len() < 2 || grid.step <= 0.0 || !numbers {
                wrong(format!("position table {} is too short, not ascending or not of numbers", grid.number));
            }
        }
        for (axis, table) in read.stock.iter().flat_map(|s| &s.axis_tables) {
            let ascending = table.rows.windows(2).all(|w| w[0][0] < w[1][0]);
            if table.rows.is_empty() || !ascending || !table.rows.iter().flatten().all(|v| v.is_finite()) {
                wrong(format!("axis table of {axis} is empty, not ascending or not of numbers"));
            }
        }
        Ok(findings.finish(read)?.0)
    }

    /// Is it one of this machine and controller?
    ///
    /// # Errors
    /// When it belongs to another machine or controller. A changed description of the same machine is a warning.
    pub fn check_belongs(&self, machine: &Machine, controller: &str) -> Result<Findings> {
        let other = |what: &str, found: &str, expected: &str| {
            Failure::new(
                "compensation::other",
                format!("the active compensation is of {what} {found:?}, not {expected:?}"),
            )
            .help("give the compensation that the control applied while the data were measured")
        };
        if self.machine != machine.name {
            return Err(other("machine", &self.machine, &machine.name));
        }
        if self.controller != controller {
            return Err(other("controller", &self.controller, controller));
        }
        for term in &self.terms {
            if machine.axis(term.axis).is_none() {
                return Err(Failure::new(
                    "compensation::other",
                    format!(
                        "the active compensation has a term of axis {}, which machine {:?} lacks",
                        term.axis, machine.name
                    ),
                ));
            }
        }
        let mut findings = Findings::default();
        if self.machine_sha256 != machine.sha256 {
            findings.push(
                Finding::warning(
                    "compensation::description_changed",
                    format!("the description of machine {:?} has changed since the active compensation was written", machine.name),
                )
                .help("its values are added as they are; if axis points or directions changed, start from no compensation"),
            );
        }
        Ok(findings)
    }

    /// The file's text.
    ///
    /// # Errors
    /// When a value cannot be written as JSON.
    pub fn to_json(&self) -> Result<String> {
        let text = serde_json::to_string_pretty(self)
            .map_err(|e| Failure::new("compensation::unwritable", format!("cannot write compensation.json: {e}")))?;
        Ok(text + "\n")
    }

    /// Does the control apply this term to a program that gives axis positions? The vectors and pins of its own
    /// transformation act under that only; zero positions of axes act always, and so does the kinematics component.
    #[must_use]
    pub fn acts_without_transformation(&self, machine: &Machine, term: &Term) -> bool {
        let own_turn = term.place == Place::Zero
            || (term.place == Place::Before
                && term.dof.is_angle()
                && machine.axis(term.axis).is_some_and(|a| along(a, term.dof).is_some()));
        match self.mode {
            Mode::Component => true,
            Mode::Stock => own_turn,
            Mode::Table => own_turn && self.tables.as_ref().is_some_and(|t| t.zero_deg.contains_key(&term.axis)),
        }
    }

    /// Its terms that do not act on a program of axis positions.
    #[must_use]
    pub fn idle_without_transformation(&self, machine: &Machine) -> usize {
        self.terms.iter().filter(|t| t.value != 0.0 && !self.acts_without_transformation(machine, t)).count()
    }

    /// The value of a spot: 0 where nothing stands, mm or deg.
    #[must_use]
    pub fn value(&self, spot: Spot) -> f64 {
        self.terms.iter().find(|t| t.spot() == spot).map_or(0.0, |t| t.value)
    }
}
