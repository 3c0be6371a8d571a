//! `compensation.json` as it is written → [`Compensation`].

use super::component::Component;
use super::loaded::{self, Cross, Loaded};
use super::stock::TiltingTable;
use super::table::Table;
use super::{Compensation, Kinematics};
use crate::axes::AxisName;
use crate::diag::{Failure, Finding, Findings, Result, Source, from_json};
use crate::machine::{self, Machine};
use crate::simulate::chain::Chain;
use crate::simulate::rigid::{Vec3, plus};
use crate::simulate::terms::Shifts;
use crate::units::{mm_from_inch, rad_from_deg};
use serde::Deserialize;
use std::collections::BTreeMap;

/// The format line of a compensation.
pub const FORMAT: &str = "axiscal-compensation/1";

#[derive(Debug, Deserialize)]
struct Written {
    format: String,
    machine: String,
    mode: String,
    #[serde(default)]
    reference_mm: Option<Vec3>,
    #[serde(default)]
    terms: Vec<WrittenTerm>,
    #[serde(default)]
    stock: Option<WrittenStock>,
    #[serde(default)]
    tables: Option<WrittenTables>,
}

/// Tables of the control's own transformation.
#[derive(Debug, Deserialize)]
struct WrittenTables {
    /// Who knows the files.
    #[serde(default)]
    reads: Option<String>,
    /// Of the lengths in the files.
    #[serde(default)]
    unit: Option<String>,
    files: Vec<String>,
    vectors: Vec<WrittenVector>,
    #[serde(default)]
    zero_deg: BTreeMap<AxisName, f64>,
    #[serde(default)]
    grids: Vec<WrittenGrid>,
}

/// A table of one axis's correction by another's position, machine coordinates.
#[derive(Debug, Deserialize)]
struct WrittenGrid {
    input: AxisName,
    output: AxisName,
    sense: f64,
    min: f64,
    step: f64,
    modulo: bool,
    values: Vec<f64>,
}

#[derive(Debug, Deserialize)]
struct WrittenVector {
    #[serde(default)]
    between: Option<[String; 2]>,
    #[serde(default)]
    direction: Option<String>,
    #[serde(default)]
    against: bool,
    value: Vec3,
}

/// An error that the control takes into account, mm or deg.
#[derive(Debug, Deserialize)]
struct WrittenTerm {
    axis: String,
    place: String,
    dof: String,
    value: f64,
    unit: String,
}

/// What the control's own means hold.
#[derive(Debug, Default, Deserialize)]
struct WrittenStock {
    #[serde(default)]
    module: Option<String>,
    #[serde(default)]
    pins: BTreeMap<String, f64>,
    /// The module's direction pin is 1.
    #[serde(default)]
    conventional_directions: bool,
    #[serde(default)]
    home_offset_deg: BTreeMap<AxisName, f64>,
    #[serde(default)]
    axis_tables: BTreeMap<AxisName, WrittenTable>,
    /// How far the work offset is moved after loading, mm in R.
    #[serde(default)]
    workpiece_shift_mm: Option<Vec3>,
}

#[derive(Debug, Deserialize)]
struct WrittenTable {
    rows: Vec<[f64; 3]>,
}

const UNCHANGED: &str = "give the compensation.json that `axiscal export` wrote, unedited";

impl Compensation {
    /// Reads `compensation.json` of an export.
    ///
    /// # Errors
    /// When the text is not of this form, or was made for another machine.
    pub fn parse(source: &Source, machine: &Machine) -> Result<(Self, Findings)> {
        Self::parse_with(source, machine, &|name| {
            Err(Failure::new("compensation::file", format!("the compensation names the file {name}"))
                .help("give the folder that `axiscal export` wrote, not the one file"))
        })
    }

    /// The same; `open` gives the text of a file beside it: where the control reads files of its own, they count.
    ///
    /// # Errors
    /// As [`Self::parse`], or when such a file cannot be read.
    pub fn parse_with(
        source: &Source,
        machine: &Machine,
        open: &dyn Fn(&str) -> Result<Source>,
    ) -> Result<(Self, Findings)> {
        let written: Written = serde_json::from_str(source.inner()).map_err(|e| {
            from_json(&e, source, "compensation::not_json")
                .help("a compensation is written by `axiscal export` (axiscal-compensation/1)")
        })?;
        let mut reader = Reader { source, machine, findings: Findings::default() };
        if written.format != FORMAT {
            let message = format!("format is {:?}, expected {FORMAT:?}", written.format);
            reader.error(
                "compensation::format",
                message,
                "is this a compensation? `axiscal export` writes compensation.json",
            );
        }
        if written.machine != machine.name {
            let message = format!("the compensation is for {:?}, not for {:?}", written.machine, machine.name);
            reader.error("compensation::machine", message, "name the machine that it was exported for with --machine");
        }
        let stock = written.stock.unwrap_or_default();
        let mut told_less_deg = [0.0; 6];
        let mut cross = Vec::new();
        let kinematics = match written.mode.as_str() {
            "component" => {
                let p = &machine.reference.pivot;
                let reference = written.reference_mm.unwrap_or([p.x, p.y, p.z]);
                let known = reader.terms(&written.terms, &mut told_less_deg);
                if !reference.iter().all(|x| x.is_finite()) {
                    reader.error("compensation::reference", "reference_mm is no point", UNCHANGED);
                }
                Kinematics::Component(Box::new(Component { chain: Chain::new(machine, reference), known }))
            }
            "stock" => {
                reader.home_offsets(&stock, &mut told_less_deg);
                match &stock.module {
                    None => Kinematics::Identity,
                    Some(module) => reader.tilting_table(module, &stock).unwrap_or(Kinematics::Identity),
                }
            }
            "table" => {
                let loaded = reader.tables(written.tables.as_ref(), open, &mut told_less_deg)?;
                cross = loaded.cross;
                loaded.vectors.map_or(Kinematics::Identity, |v| Kinematics::Vectors(Box::new(v)))
            }
            other => {
                let message = format!("mode is {other:?}, expected \"component\", \"stock\" or \"table\"");
                reader.error("compensation::mode", message, "export again with this version");
                Kinematics::Identity
            }
        };
        let tables = stock.axis_tables.iter().filter_map(|(axis, table)| reader.table(*axis, table)).collect();
        reader.findings.finish(Self { kinematics, told_less_deg, tables, cross })
    }
}

struct Reader<'a> {
    source: &'a Source,
    machine: &'a Machine,
    findings: Findings,
}

impl Reader<'_> {
    fn error(&mut self, code: &'static str, message: impl Into<String>, help: &str) {
        self.findings.push(Finding::error(code, message).help(help).at(self.source, 0..0));
    }

    fn terms(&mut self, terms: &[WrittenTerm], told_less_deg: &mut [f64; 6]) -> Shifts {
        let mut known = Shifts::default();
        for (i, term) in terms.iter().enumerate() {
            if let Err(what) = self.term(term, &mut known, told_less_deg) {
                let message = format!("term {} of the compensation: {what}", i + 1);
                self.error("compensation::term", message, UNCHANGED);
            }
        }
        known
    }

    fn term(&self, term: &WrittenTerm, known: &mut Shifts, told_less_deg: &mut [f64; 6]) -> Result<(), String> {
        let mut letters = term.axis.chars();
        let name = letters.next().and_then(AxisName::from_letter).filter(|_| letters.next().is_none());
        let axis = name.and_then(|a| self.machine.axis(a)).filter(|a| a.name.is_rotary());
        let axis = axis.ok_or_else(|| format!("axis {:?} is no rotary axis of {:?}", term.axis, self.machine.name))?;
        let dof = ["dx", "dy", "dz", "rx", "ry", "rz"].iter().position(|d| *d == term.dof);
        let dof = dof.ok_or_else(|| format!("dof {:?} is not known", term.dof))?;
        if !term.value.is_finite() {
            return Err(format!("value {} is not finite", term.value));
        }
        let value = match (term.unit.as_str(), dof < 3) {
            ("mm", true) => term.value,
            ("deg", false) => rad_from_deg(term.value),
            (unit, _) => return Err(format!("{} is given in {unit:?}", term.dof)),
        };
        let i = axis.name.index();
        match term.place.as_str() {
            "before" => known.before[i][dof] += value,
            "after" => known.after[i][dof] += value,
            // right-handed about the axis's direction, whichever way its coordinate counts
            "zero" if dof >= 3 => told_less_deg[i] += axis.sense * term.value,
            place => return Err(format!("place {place:?} is not known for {}", term.dof)),
        }
        Ok(())
    }

    fn home_offsets(&mut self, stock: &WrittenStock, told_less_deg: &mut [f64; 6]) {
        for (&axis, &deg) in &stock.home_offset_deg {
            if self.machine.axis(axis).is_none() || !deg.is_finite() {
                let message = format!("the home offset of {axis} is {deg} on {:?}", self.machine.name);
                self.error("compensation::home_offset", message, UNCHANGED);
                continue;
            }
            // homed to where it stands: a command of that much less brings it to the same place
            told_less_deg[axis.index()] += deg;
        }
    }

    fn tables(
        &mut self,
        written: Option<&WrittenTables>,
        open: &dyn Fn(&str) -> Result<Source>,
        told_less_deg: &mut [f64; 6],
    ) -> Result<Loaded> {
        let Some(written) = written else {
            self.error("compensation::tables", "mode is \"table\", but there are no tables", UNCHANGED);
            return Ok(Loaded::default());
        };
        for (&axis, &deg) in &written.zero_deg {
            if self.machine.axis(axis).is_none() || !deg.is_finite() {
                self.error("compensation::zero", format!("the zero position of {axis} is {deg}"), UNCHANGED);
                continue;
            }
            // an offset is added to what is commanded
            told_less_deg[axis.index()] -= deg;
        }
        let opened: Vec<Result<Source>> = written.files.iter().map(|name| open(name)).collect();
        // the record holds the same numbers: it is enough by itself, but half of the files are no compensation
        let alone = written.reads.is_some() && opened.iter().all(Result::is_err);
        if alone && !opened.is_empty() {
            let says = format!("{} is not beside it: the numbers of the record are applied", written.files.join(", "));
            self.findings.push(Finding::info("compensation::record", says));
        }
        let files = || opened.into_iter().collect::<Result<Vec<_>>>();
        Ok(match written.reads.as_deref().filter(|_| !alone) {
            Some("sinumerik-data") => {
                let mm_per_unit = if written.unit.as_deref() == Some("inch") { mm_from_inch(1.0) } else { 1.0 };
                loaded::sinumerik(&files()?, self.machine, mm_per_unit, &mut self.findings)
            }
            Some("fanuc-parameters") => loaded::fanuc(&files()?, self.machine, &mut self.findings),
            Some(other) => {
                let message = format!("files of the kind {other:?} are not known");
                self.error("compensation::reads", message, "there are: sinumerik-data, fanuc-parameters");
                Loaded::default()
            }
            None => self.record(written),
        })
    }

    /// What a person entered, or where no file is to be had: lines by vectors between named points, directions, and position tables.
    fn record(&mut self, written: &WrittenTables) -> Loaded {
        let mut points: BTreeMap<&str, Vec3> = [("machine-zero", [0.0; 3]), ("tool-adapter", [0.0; 3])].into();
        // as often as there are vectors: each may lead on from any other
        for _ in &written.vectors {
            for v in &written.vectors {
                let Some([from, to]) = &v.between else { continue };
                if let Some(base) = points.get(from.as_str()).copied() {
                    points.insert(to, plus(base, 1.0, v.value));
                }
            }
        }
        let mut lines = |side: machine::Side, word: &str| -> Vec<(AxisName, Vec3, Vec3)> {
            let axes = self.machine.axes.iter().filter(|a| a.side == side && a.name.is_rotary());
            let mut out = Vec::new();
            for (i, axis) in axes.enumerate() {
                let name = format!("{word}-{}", i + 1);
                let given = written.vectors.iter().find(|v| v.direction.as_deref() == Some(name.as_str()));
                let nominal = [axis.direction.x, axis.direction.y, axis.direction.z].map(|d| d * axis.sense);
                let direction = given.map_or(nominal, |v| if v.against { v.value.map(|x| -x) } else { v.value });
                match points.get(name.as_str()) {
                    Some(point) => out.push((axis.name, direction, *point)),
                    None => self.findings.push(
                        Finding::error("compensation::tables", format!("no vector leads to {name}")).help(UNCHANGED),
                    ),
                }
            }
            out
        };
        let (table, head) = (lines(machine::Side::Workpiece, "workpiece"), lines(machine::Side::Tool, "tool"));
        let cross = written.grids.iter().filter_map(|grid| self.position_table(grid)).collect();
        Loaded { vectors: Some(loaded::through(self.machine, &table, &head)), cross }
    }

    fn position_table(&mut self, grid: &WrittenGrid) -> Option<Cross> {
        let WrittenGrid { input, output, sense, min, step, modulo, ref values } = *grid;
        let numbers = [min, step, sense].iter().chain(values).all(|v| v.is_finite());
        let axes = [input, output].iter().all(|a| self.machine.axis(*a).is_some());
        if !(numbers && axes && step > 0.0 && values.len() > 1) {
            self.error(
                "compensation::tables",
                format!("the position table of {output} by {input} is damaged"),
                UNCHANGED,
            );
            return None;
        }
        let max = min + step * (values.len() - 1) as f64;
        let origin = self.machine.origin.get(input).unwrap_or(0.0);
        Some(Cross { input, output, sense, min, max, step, modulo, values: values.clone(), origin })
    }

    fn tilting_table(&mut self, module: &str, stock: &WrittenStock) -> Option<Kinematics> {
        let tilting = match module {
            "xyzac-trt-kins" => AxisName::A,
            "xyzbc-trt-kins" => AxisName::B,
            _ => {
                let message = format!("kinematics module {module:?} is not known");
                self.error("compensation::module", message, "there are: xyzac-trt-kins, xyzbc-trt-kins");
                return None;
            }
        };
        if self.machine.axis(tilting).is_none() || self.machine.axis(AxisName::C).is_none() {
            let message = format!("module {module} needs axes {tilting} and C, {:?} lacks one", self.machine.name);
            self.error("compensation::module", message, UNCHANGED);
            return None;
        }
        let length = self.machine.tool.length_mm;
        let mut pin = |name: &str, default: Option<f64>| {
            let value = stock.pins.get(name).copied().or(default);
            match value {
                Some(v) if v.is_finite() => v,
                _ => {
                    self.error("compensation::pin", format!("pin {name} of {module} has no value"), UNCHANGED);
                    0.0
                }
            }
        };
        let rot_point = [pin("x-rot-point", None), pin("y-rot-point", None), pin("z-rot-point", None)];
        let offset = [pin("x-offset", Some(0.0)), pin("y-offset", Some(0.0)), pin("z-offset", Some(0.0))];
        let tool_beyond_mm = pin("tool-offset", Some(length)) - length;
        let origin = [AxisName::X, AxisName::Y, AxisName::Z].map(|a| self.machine.origin.get(a).unwrap_or(0.0));
        let workpiece_shift = stock.workpiece_shift_mm.unwrap_or([0.0; 3]);
        let conventional = stock.conventional_directions;
        let table = TiltingTable { tilting, rot_point, offset, conventional, tool_beyond_mm, origin, workpiece_shift };
        Some(Kinematics::TiltingTable(table))
    }

    fn table(&mut self, axis: AxisName, written: &WrittenTable) -> Option<Table> {
        let rows = &written.rows;
        let good = self.machine.axis(axis).is_some()
            && !rows.is_empty()
            && rows.iter().flatten().all(|x| x.is_finite())
            && rows.windows(2).all(|w| w[0][0] < w[1][0]);
        if !good {
            let message = format!("the axis table of {axis} is empty, not ascending, not of numbers or of no axis");
            self.error("compensation::table", message, UNCHANGED);
            return None;
        }
        Some(Table { axis, origin: self.machine.origin.get(axis).unwrap_or(0.0), rows: rows.clone() })
    }
}
