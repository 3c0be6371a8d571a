//! `compensation.json` (`axiscal-compensation/1`): what a control was given, parameter by parameter.
//!
//! It is written beside the controller's own files, read back as "what was active during the measurement", and read by the
//! virtual machine. It holds no sign or unit that the controller's own files do not hold.

use super::place::{Dof, Place, Spot, turns_about_itself};
use super::rows::TableError;
use crate::axes::AxisName;
use crate::diag::{Failure, Finding, Findings, Result, Source, from_json, in_json};
use crate::machine::Machine;
use crate::post::tables::{LengthUnit, Point, Turn};
use crate::units::Plain;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// The format line.
pub const FORMAT: &str = "axiscal-compensation/1";

/// No length (mm) or angle (deg) of a compensation is larger: more is a slip of the pen.
const LARGEST_MM: f64 = 1e5;
const LARGEST_DEG: f64 = 3600.0;
/// A location error beyond these is none: also a forced export stays far below.
const LARGEST_ERROR_MM: f64 = 10.0;
const LARGEST_ERROR_DEG: f64 = 5.0;

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
    /// The version of LinuxCNC that they are written for.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub version: Option<String>,
    /// Its direction pin: positive angles turn the table left-handed. Absent: the version has none, they turn it right-handed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub conventional_directions: Option<bool>,
    /// How far the workpiece's zero stands off the nominal one in the module's world coordinates, mm.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub workpiece_shift_mm: Option<[f64; 3]>,
    /// To be added to the machine's own `[JOINT_n] HOME_OFFSET`, deg.
    #[serde(default)]
    pub home_offset_deg: BTreeMap<AxisName, f64>,
    /// Axis compensation tables.
    #[serde(default)]
    pub axis_tables: BTreeMap<AxisName, AxisTable>,
    /// The pins were given as changes, because the present ones are not known.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub pins_by_change: bool,
    /// What the file set, mm, where the machine's own pins were given: `pins` is then the same change to the machine as described.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub pins_written: BTreeMap<String, f64>,
    /// Axes whose tables were given as changes, because the present ones are not known.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub tables_by_change: Vec<AxisName>,
}

impl Stock {
    /// The table that was loaded for an axis, where a file of it was written.
    #[must_use]
    pub fn loaded_table(&self, axis: AxisName) -> Option<&AxisTable> {
        self.axis_tables.get(&axis).filter(|_| !self.tables_by_change.contains(&axis))
    }
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
    pub vectors: Vec<Vector>,
    /// By the control's name: what the files hold, in their unit. A later backup must hold the same.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub values: BTreeMap<String, f64>,
    /// By the control's name: by how much a value changes, in the unit of the files, where its present value is not known. No file
    /// holds such a value; `vectors` and `grids` then say what the control would hold if it held the machine's description before.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub changes: BTreeMap<String, f64>,
    /// Offsets that the lines hold in place of turns of the head, for which the control has no place.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub of_turns: Vec<Term>,
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
    /// What each table of rows leaves.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub table_errors: Vec<TableError>,
    /// Version of the program that wrote it.
    #[serde(default)]
    pub program: String,
    /// Where it comes from.
    #[serde(flatten)]
    pub provenance: Provenance,
}

impl Compensation {
    /// Reads the file: the one check of it. Nothing in it can be a NaN, an absurd number, an unsorted table or a term that stands
    /// twice.
    ///
    /// # Errors
    /// When it is not JSON of this form, with its place.
    pub fn read(source: &Source) -> Result<Self> {
        let read: Self = serde_json::from_str(source.inner()).map_err(|e| {
            from_json(&e, source, "compensation::not_json")
                .help("give the compensation.json that `axiscal export` wrote, unedited")
        })?;
        let mut findings = Findings::default();
        let mut wrong = |(entry, field): (Option<(&str, usize)>, &str), message: String| {
            findings.push(
                Finding::error("compensation::damaged", message)
                    .at(source, in_json(source.inner(), entry, field).unwrap_or(0..0))
                    .help("was it edited by hand? take the file that `axiscal export` wrote"),
            );
        };
        if read.format != FORMAT {
            wrong((None, "format"), format!("format is {:?}, expected {FORMAT:?}", read.format));
        }
        let mut seen = std::collections::BTreeSet::new();
        for (i, term) in read.terms.iter().enumerate() {
            let name = format!("{} {} {}", term.axis, term.place, term.dof);
            let mut wrong = |field: &str, message: String| wrong((Some(("terms", i)), field), message);
            if !seen.insert(term.spot()) {
                wrong("axis", format!("term {name} stands twice"));
            }
            if !term.axis.is_rotary() {
                wrong("axis", format!("term {name}: {} is no rotary axis", term.axis));
            }
            if term.unit != term.dof.unit() {
                wrong("unit", format!("term {name} is in {:?}, expected {:?}", term.unit, term.dof.unit()));
            }
            if term.place == Place::Zero && !term.dof.is_angle() {
                wrong("dof", format!("term {name}: a zero position is an angle"));
            }
            let values =
                [("value", term.value), ("active_before", term.active_before), ("identified", term.identified)];
            let largest = if term.dof.is_angle() { LARGEST_ERROR_DEG } else { LARGEST_ERROR_MM };
            for (field, value) in values {
                if !(-largest..=largest).contains(&value) {
                    let unit = &term.unit;
                    wrong(
                        field,
                        format!("{field} of term {name} is {}, expected up to {largest} {unit}", Plain(value)),
                    );
                }
            }
            if term.sigma.is_some_and(|s| !(0.0..=largest).contains(&s)) {
                wrong("sigma", format!("sigma of term {name} is no standard uncertainty"));
            }
        }
        let lengths = |all: &[f64]| all.iter().all(|v| v.abs() <= LARGEST_MM);
        let angles =
            |mut all: std::collections::btree_map::Values<'_, AxisName, f64>| all.all(|v| v.abs() <= LARGEST_DEG);
        if !lengths(&read.reference_mm) {
            wrong((None, "reference_mm"), format!("reference_mm is no point within {LARGEST_MM} mm"));
        }
        if let Some(tables) = &read.tables {
            let mut wrong = |message: String| wrong((None, "tables"), message);
            if !tables.values.values().all(|v| v.abs() <= LARGEST_MM) {
                wrong(format!("a value of the tables is no number up to {LARGEST_MM}"));
            }
            if !angles(tables.zero_deg.values()) {
                wrong(format!("a zero position of the tables is no angle up to {LARGEST_DEG} deg"));
            }
            if !lengths(&tables.workpiece_shift_mm) {
                wrong("workpiece_shift_mm of the tables is no shift".to_owned());
            }
            for vector in &tables.vectors {
                let largest = if vector.direction.is_some() { 1.0 + 1e-6 } else { LARGEST_MM };
                if !vector.value.iter().all(|v| v.abs() <= largest) {
                    wrong(format!("vector {:?} of the tables has a component beyond {largest}", vector.id));
                }
                let length = vector.value.iter().map(|v| v * v).sum::<f64>().sqrt();
                if vector.direction.is_some() && (length - 1.0).abs() > 1e-3 {
                    wrong(format!("direction {:?} of the tables has the length {}, not 1", vector.id, Plain(length)));
                }
            }
            for grid in &tables.grids {
                let numbers = [grid.min, grid.step].iter().chain(&grid.values).all(|v| v.abs() <= LARGEST_MM);
                if grid.values.len() < 2 || grid.step <= 0.0 || !numbers {
                    wrong(format!("position table {} is too short, not ascending or not of numbers", grid.number));
                }
            }
        }
        if let Some(stock) = &read.stock {
            let mut wrong = |message: String| wrong((None, "stock"), message);
            if !stock.pins.values().chain(stock.pins_written.values()).all(|v| v.abs() <= LARGEST_MM) {
                wrong(format!("a pin is no number up to {LARGEST_MM} mm"));
            }
            if !angles(stock.home_offset_deg.values()) {
                wrong(format!("a home offset is no angle up to {LARGEST_DEG} deg"));
            }
            if stock.workpiece_shift_mm.is_some_and(|shift| !lengths(&shift)) {
                wrong("workpiece_shift_mm is no shift".to_owned());
            }
            for (axis, table) in &stock.axis_tables {
                let ascending = table.rows.windows(2).all(|w| w[0][0] < w[1][0]);
                if table.rows.is_empty() || !ascending || !table.rows.iter().flatten().all(|v| v.abs() <= LARGEST_MM) {
                    wrong(format!("axis table of {axis} is empty, not ascending or not of numbers"));
                }
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
        let own_turn = turns_about_itself(machine, term.spot());
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
