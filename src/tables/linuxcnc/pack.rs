//! Puts the files of an export together: the kinematics component with its pins, and what both ways of loading share.

mod ini_lines;
mod stock_way;

use super::axis_table;
use super::component;
use super::ini::Joints;
use super::stock::{self, Module};
use super::{CONTROLLER, Changed, Export, Left, Options, Way, force, head, program, readme, render};
use crate::axes::AxisName;
use crate::diag::{Finding, Findings, Result};
use crate::machine::{Machine, Side};
use crate::post::{ModuleFault, Release};
use crate::tables::compensation::{AxisTable, Compensation, FORMAT, Mode, Stock, Term};
use crate::tables::correction::{Correction, left_um, rounded};
use crate::tables::rows::TableError;
use minijinja::{Value, context};
use std::collections::BTreeMap;

const SETP: &str = include_str!("../templates/linuxcnc/setp.hal.j2");
const CHANGES: &str = include_str!("../templates/linuxcnc/changes.txt.j2");
/// Sheet of the changes of values whose present ones are not known.
const SHEET: &str = "axiscal_changes.txt";
const TOOL_TABLE: &str = include_str!("../templates/linuxcnc/tool_table.ngc.j2");

/// What both ways of loading need to know.
pub(super) struct Packing<'a> {
    pub machine: &'a Machine,
    pub correction: &'a Correction,
    pub options: &'a Options,
    pub joints: &'a Joints,
    pub release: &'a Release,
    pub module: Result<Module, String>,
    pub tables: Vec<(AxisName, AxisTable)>,
    pub table_errors: Vec<TableError>,
    changes: Vec<Changed>,
    files: Vec<(String, Vec<u8>)>,
    findings: Findings,
}

/// One pin with what it means.
struct Pin {
    name: String,
    value: f64,
    says: String,
}

/// A file of HAL lines.
struct HalFile<'a> {
    path: &'a str,
    module: &'a str,
    says: &'a [String],
    pins: &'a [Pin],
}

pub(super) fn pack(
    machine: &Machine,
    correction: &Correction,
    options: &Options,
    (joints, release): (&Joints, &Release),
) -> Result<(Export, Findings)> {
    let active = correction.active.as_ref();
    let old_table = |axis: AxisName| active.and_then(|a| a.stock.as_ref()?.axis_tables.get(&axis).cloned());
    let joint = |axis: AxisName| joints.numbers(axis).first().copied().unwrap_or(0);
    let made = axis_table::tables(machine, correction, old_table, joint, options.radius_mm)?;
    let table_errors: Vec<TableError> = made.iter().map(|m| m.leaves.clone()).collect();
    let tables: Vec<(AxisName, AxisTable)> = made.into_iter().map(|m| (m.axis, m.table)).collect();
    let mut noted = correction.clone();
    let mut findings = old_tables(&tables, correction, options);
    findings.0.extend(table_errors.iter().flat_map(TableError::findings));
    if options.force {
        force(&mut findings.0, &mut noted);
    }
    let mut packing = Packing {
        machine,
        correction: &noted,
        options,
        joints,
        release,
        module: stock::module_of(machine, release),
        tables,
        table_errors,
        changes: Vec::new(),
        files: Vec::new(),
        findings,
    };
    let component = packing.component()?;
    let stock = packing.stock()?;
    packing.tool_table()?;
    packing.sheets()?;
    let text = readme::text(&packing, &component, &stock)?;
    packing.put("README.txt", text);
    let changes = packing.changes;
    let (files, findings) = packing.findings.finish(packing.files)?;
    Ok((Export { files, component, stock, table_errors: packing.table_errors, changes }, findings))
}

/// Tables or backlash of the user's own that ours would silently replace.
fn old_tables(tables: &[(AxisName, AxisTable)], correction: &Correction, options: &Options) -> Findings {
    let mut findings = Findings::default();
    let Some(ini) = &options.ini else { return findings };
    let active = correction.active.as_ref();
    for (axis, table) in tables {
        let ours = active.and_then(|a| a.stock.as_ref()?.loaded_table(*axis)).is_some();
        let old = ini.comp_file.get(&table.joint).map(|(file, _)| format!("COMP_FILE = {file}"));
        let backlash = ini.backlash.get(&table.joint).map(|b| format!("BACKLASH = {b}"));
        let Some(old) = old.filter(|_| !ours).or(backlash) else { continue };
        let says = format!(
            "{}: [JOINT_{}] {old} was in force while {axis} was measured, and the new table replaces it: add the old values to its lines by hand",
            ini.name, table.joint
        );
        findings.push(
            Finding::error("tables::replaces", says).help("--force writes it all the same; or measure without them"),
        );
    }
    findings
}

impl Packing<'_> {
    fn put(&mut self, path: &str, text: String) {
        self.files.push((path.to_owned(), text.into_bytes()));
    }

    /// Has this file been written?
    pub(super) fn has(&self, path: &str) -> bool {
        self.files.iter().any(|(p, _)| p == path)
    }

    pub(super) fn mm_per_unit(&self) -> f64 {
        self.options.ini.as_ref().map_or(1.0, |i| i.mm_per_unit)
    }

    fn active(&self, mode: Mode) -> Option<&Compensation> {
        self.correction.active.as_ref().filter(|a| a.mode == mode)
    }

    fn compensation(&self, mode: Mode, terms: Vec<Term>, stock: Option<Stock>) -> Compensation {
        Compensation {
            format: FORMAT.to_owned(),
            controller: CONTROLLER.to_owned(),
            machine: self.machine.name.clone(),
            machine_sha256: self.machine.sha256.clone(),
            mode,
            component: (mode == Mode::Component).then(|| component::name(self.machine)),
            reference_mm: self.correction.reference_mm,
            terms,
            stock,
            tables: None,
            table_errors: self.table_errors.clone(),
            program: program(),
            provenance: self.correction.provenance.clone(),
        }
    }

    /// The axis tables as both ways record them.
    fn table_record(&self) -> Stock {
        let by_change = self.tables.iter().map(|(axis, _)| *axis).filter(|axis| !self.knows_table(*axis));
        Stock {
            axis_tables: self.tables.iter().cloned().collect(),
            tables_by_change: by_change.collect(),
            ..Stock::default()
        }
    }

    /// The table of an axis that a file of an earlier export held.
    fn loaded_table(&self, axis: AxisName) -> Option<&AxisTable> {
        self.correction.active.as_ref()?.stock.as_ref()?.loaded_table(axis)
    }

    /// Is it known what table an axis had? The INI file says it, or the file that was loaded.
    fn knows_table(&self, axis: AxisName) -> bool {
        self.options.ini.is_some() || self.loaded_table(axis).is_some()
    }

    // ------------------------------------------------------------------- what is added to values that are not known

    fn change(&mut self, folder: &str, name: String, change: f64, unit: &'static str) {
        let change = rounded(change);
        if change != 0.0 {
            self.changes.push(Changed { file: format!("{folder}{SHEET}"), name, change, unit });
        }
    }

    fn length_unit(&self) -> &'static str {
        if self.mm_per_unit() == 1.0 { "mm" } else { "inch" }
    }

    /// The sheets, and what a person is told of them.
    fn sheets(&mut self) -> Result<()> {
        for folder in ["", "stock/"] {
            let path = format!("{folder}{SHEET}");
            let own = self.changes.iter().filter(|c| c.file == path);
            let lines: Vec<Value> = own
                .map(|c| context! { name => c.name.clone(), unit => c.unit, change => format!("{}{}", if c.change > 0.0 { "+" } else { "" }, plain(c.change)) })
                .collect();
            if lines.is_empty() {
                continue;
            }
            let says = format!(
                "the present values of what {path} names are not known: it says by how much each changes, and no file with values is written"
            );
            self.findings
                .push(Finding::warning("tables::old_assumed", says).help(
                    "give the machine's INI file with --ini, and the pins of a kinematics module in use with --old MODULE.PIN=VALUE: then \
                     the files to load and to go back are complete",
                ));
            let text = render(
                "changes.txt",
                CHANGES,
                &context! { head => head(self.machine, self.correction), changes => lines },
            )?;
            self.put(&path, text);
        }
        Ok(())
    }

    // ------------------------------------------------------------------------------------------- the component

    fn component(&mut self) -> Result<Way> {
        let name = component::name(self.machine);
        let (terms, reference) = (self.correction.terms.clone(), self.correction.reference_mm);
        let (old_terms, old_reference) = match self.active(Mode::Component) {
            Some(active) => (active.terms.clone(), active.reference_mm),
            None => (Vec::new(), self.machine.reference.pivot.into()),
        };
        let stock = (!self.tables.is_empty()).then(|| self.table_record());
        let compensation = self.compensation(Mode::Component, terms.clone(), stock);

        let source = component::source(self.machine, self.correction)?;
        self.put(&format!("{name}.c"), source);
        self.pin_file("axiscal.hal", &name, &terms, reference, &[
            "Pins of the kinematics component: load this after `loadrt [KINS]KINEMATICS` (a further [HAL] HALFILE).".to_owned(),
            format!("{name}.tool-length stays at the probe's length unless you set it: README.txt."),
        ])?;
        self.pin_file("restore.hal", &name, &old_terms, old_reference, &[
            "The values that were active while the data were measured: load this in place of axiscal.hal to go back.".to_owned(),
        ])?;
        let kinematics = format!("{name} coordinates={}", self.joints.coordinates());
        self.ini_files("", Some(kinematics), &BTreeMap::new())?;
        let json = compensation.to_json()?;
        self.put("compensation.json", json);
        let left = self.left_by_all();
        Ok(Way { compensation, left })
    }

    fn pin_file(
        &mut self,
        path: &str,
        module: &str,
        terms: &[Term],
        reference: [f64; 3],
        says: &[String],
    ) -> Result<()> {
        let says_of = |pin: &str| {
            let named = terms.iter().filter(|t| component::pin(t.spot()) == pin);
            named.map(|t| format!("{} of {}, {}", t.parameter, t.effect, t.unit)).collect::<Vec<_>>().join("; ")
        };
        let pins: Vec<Pin> = component::pins(self.machine, terms, reference, self.mm_per_unit())
            .into_iter()
            .map(|(name, value)| Pin { says: says_of(&name), name, value })
            .collect();
        self.hal_file(&HalFile { path, module, says, pins: &pins })
    }

    fn hal_file(&mut self, file: &HalFile) -> Result<()> {
        let pins: Vec<Value> = file
            .pins
            .iter()
            .map(|p| context! { name => p.name.clone(), value => plain(p.value), says => super::one_line(&p.says) })
            .collect();
        let context = context! { head => head(self.machine, self.correction), says => file.says.to_vec(), module => file.module, pins };
        let text = render("setp.hal", SETP, &context)?;
        self.put(file.path, text);
        Ok(())
    }

    /// Which way the module turns the table.
    pub(super) fn turning(&self, module: &Module) -> String {
        match module.conventional {
            Some(true) => {
                "Positive angles turn the table left-handed (clockwise seen against the axis), as this machine does."
            }
            Some(false) => "Positive angles turn the table right-handed, as this machine does.",
            None => {
                "Positive angles turn the table right-handed, as this machine does; this version has no pin for that."
            }
        }
        .to_owned()
    }

    /// Faults of some builds of this version that this machine would show.
    pub(super) fn faults(&self, module: &Module) -> impl Iterator<Item = &ModuleFault> {
        let shows = (module.name, module.conventional.unwrap_or(false));
        self.release.fault.iter().filter(move |f| (f.module.as_str(), f.conventional) == shows)
    }

    /// The probe's length for the tool table, as two programs that change it there and back.
    fn tool_table(&mut self) -> Result<()> {
        let Some(change) = self.correction.tool_length_mm.filter(|c| *c != 0.0) else { return Ok(()) };
        for (path, change, other) in [
            ("tool_table.ngc", change, "restore_tool_table.ngc"),
            ("restore_tool_table.ngc", -change, "tool_table.ngc"),
        ] {
            let context =
                context! { head => head(self.machine, self.correction), change => format!("{change:.6}"), other };
            let text = render("tool_table.ngc", TOOL_TABLE, &context)?;
            self.put(path, text);
        }
        Ok(())
    }

    // -------------------------------------------------------------------------------------------- what is left

    /// Distance at which a tilt of an axis acts, mm: the tool's length in the head, the stated radius in the table.
    pub(super) fn lever(&self, term: &Term) -> f64 {
        match self.machine.axis(term.axis) {
            Some(axis) if axis.side == Side::Tool => self.machine.tool.length_mm,
            _ => self.options.radius_mm,
        }
    }

    fn left(&self, parameter: &str, effect: &str, value: f64, unit: &str, lever_mm: f64, why: String) -> Left {
        let left_um = left_um(value, unit, lever_mm);
        Left {
            parameter: parameter.to_owned(),
            effect: effect.to_owned(),
            value,
            unit: unit.to_owned(),
            lever_mm,
            left_um,
            why,
        }
    }

    /// What neither way carries.
    fn left_by_all(&self) -> Vec<Left> {
        let known = self.correction.left_out.iter().filter(|l| l.known);
        known
            .map(|l| self.left(&l.parameter, &l.effect, l.value, &l.unit, self.options.radius_mm, l.why.clone()))
            .collect()
    }
}

/// A number as HAL and INI files read it: no exponent.
fn plain(value: f64) -> String {
    format!("{}", value + 0.0)
}
