//! Puts the files of an export together.

use super::axis_table::{self};
use super::component;
use super::ini::Joints;
use super::stock::{self, Module};
use super::{CONTROLLER, Export, Left, Options, Way, force, head, program, readme, render, work_offset};
use crate::axes::AxisName;
use crate::diag::{Finding, Findings, Result};
use crate::machine::{Machine, Side};
use crate::tables::compensation::{AxisTable, Compensation, FORMAT, Mode, Stock, Term};
use crate::tables::correction::{Correction, left_um, rounded};
use crate::tables::restate::kept_in_words;
use minijinja::{Value, context};
use std::collections::BTreeMap;

const SETP: &str = include_str!("../templates/linuxcnc/setp.hal.j2");
const FRAGMENT: &str = include_str!("../templates/linuxcnc/fragment.ini.j2");
const TOOL_TABLE: &str = include_str!("../templates/linuxcnc/tool_table.ngc.j2");

/// What both ways of loading need to know.
pub(super) struct Packing<'a> {
    pub machine: &'a Machine,
    pub correction: &'a Correction,
    pub options: &'a Options,
    pub joints: &'a Joints,
    pub module: Result<Module, String>,
    pub tables: Vec<(AxisName, AxisTable)>,
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
    joints: &Joints,
) -> Result<(Export, Findings)> {
    let active = correction.active.as_ref();
    let old_table = |axis: AxisName| active.and_then(|a| a.stock.as_ref()?.axis_tables.get(&axis).cloned());
    let joint = |axis: AxisName| joints.numbers(axis).first().copied().unwrap_or(0);
    let tables = axis_table::tables(machine, &correction.shapes, old_table, joint);
    let mut noted = correction.clone();
    let mut findings = old_tables(&tables, correction, options);
    if options.force {
        force(&mut findings.0, &mut noted);
    }
    let mut packing = Packing {
        machine,
        correction: &noted,
        options,
        joints,
        module: stock::module_of(machine),
        tables,
        files: Vec::new(),
        findings,
    };
    let component = packing.component()?;
    let stock = packing.stock()?;
    packing.tool_table()?;
    let text = readme::text(&packing, &component, &stock)?;
    packing.put("README.txt", text);
    let (files, findings) = packing.findings.finish(packing.files)?;
    Ok((Export { files, component, stock }, findings))
}

/// Tables or backlash of the user's own that ours would silently replace.
fn old_tables(tables: &[(AxisName, AxisTable)], correction: &Correction, options: &Options) -> Findings {
    let mut findings = Findings::default();
    let Some(ini) = &options.ini else { return findings };
    let active = correction.active.as_ref();
    for (axis, table) in tables {
        let ours = active.and_then(|a| a.stock.as_ref()).is_some_and(|s| s.axis_tables.contains_key(axis));
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
            program: program(),
            provenance: self.correction.provenance.clone(),
        }
    }

    fn table_map(&self) -> BTreeMap<AxisName, AxisTable> {
        self.tables.iter().cloned().collect()
    }

    // ------------------------------------------------------------------------------------------- the component

    fn component(&mut self) -> Result<Way> {
        let name = component::name(self.machine);
        let (terms, reference) = (self.correction.terms.clone(), self.correction.reference_mm);
        let (old_terms, old_reference) = match self.active(Mode::Component) {
            Some(active) => (active.terms.clone(), active.reference_mm),
            None => (Vec::new(), self.machine.reference.pivot.into()),
        };
        let stock = (!self.tables.is_empty()).then(|| Stock { axis_tables: self.table_map(), ..Stock::default() });
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

    // -------------------------------------------------------------------------------------------- INI fragments

    /// The `[KINS] KINEMATICS` line that was in force, and whether it is known.
    fn old_kinematics(&self) -> (String, bool) {
        let coordinates = self.joints.coordinates();
        if let Some(line) = self.options.ini.as_ref().and_then(|i| i.kinematics.clone()) {
            return (line, true);
        }
        let active = self.correction.active.as_ref();
        let module = active.and_then(|a| a.component.clone().or_else(|| a.stock.as_ref()?.module.clone()));
        match module {
            Some(module) => (format!("{module} coordinates={coordinates}"), true),
            None => (format!("trivkins coordinates={coordinates}"), false),
        }
    }

    /// `axiscal.ini` and `restore.ini` of a directory, with the axis tables beside them.
    fn ini_files(&mut self, folder: &str, kinematics: Option<String>, home: &BTreeMap<AxisName, f64>) -> Result<()> {
        let (old_kinematics, known) = self.old_kinematics();
        let mut new: BTreeMap<(u8, usize), Vec<String>> = BTreeMap::new();
        let mut old = new.clone();
        const KINS: (u8, usize) = (0, 0);
        if let Some(line) = kinematics {
            let joints = format!("JOINTS = {}", self.joints.count());
            new.insert(KINS, vec![format!("KINEMATICS = {line}"), joints.clone()]);
            let mut lines = vec![format!("KINEMATICS = {old_kinematics}"), joints];
            if !known {
                lines.insert(0, "# assumed: no INI file was given, so put back the line that you replaced".to_owned());
            }
            old.insert(KINS, lines);
        }
        let home_active: BTreeMap<AxisName, f64> = self
            .active(Mode::Stock)
            .and_then(|a| a.stock.as_ref())
            .map(|s| s.home_offset_deg.clone())
            .unwrap_or_default();
        for axis in self.machine.rotary() {
            let change = home.get(&axis.name).unwrap_or(&0.0) - home_active.get(&axis.name).unwrap_or(&0.0);
            let active = home_active.get(&axis.name).copied().unwrap_or(0.0);
            if change == 0.0 && active == 0.0 {
                continue;
            }
            for joint in self.joints.numbers(axis.name) {
                // an INI without the line homes to 0; without an INI the machine's own offset is taken as 0
                let was = match &self.options.ini {
                    Some(ini) => ini.home_offset.get(&joint).copied().unwrap_or(0.0),
                    None => active,
                };
                if self.options.ini.is_none() {
                    let changed = plain(rounded(change));
                    new.entry((1, joint)).or_default().push(format!(
                        "# assumed: the old line is HOME_OFFSET = {} (no INI file was given); is it another one, add {changed} to it",
                        plain(was)
                    ));
                    old.entry((1, joint))
                        .or_default()
                        .push("# assumed: put back the line that you replaced".to_owned());
                }
                new.entry((1, joint)).or_default().push(format!("HOME_OFFSET = {}", plain(rounded(was + change))));
                old.entry((1, joint)).or_default().push(format!("HOME_OFFSET = {}", plain(was)));
            }
        }
        self.table_files(folder, &mut new, &mut old);
        for (path, says, sections) in [
            (
                "axiscal.ini",
                "Lines for the machine's INI file: each goes into the section of its name, in place of the old line.",
                new,
            ),
            ("restore.ini", "The old lines: put them back into the machine's INI file.", old),
        ] {
            let sections: Vec<Value> = sections
                .into_iter()
                .map(|((kind, n), lines)| {
                    let name = if kind == 0 { "KINS".to_owned() } else { format!("JOINT_{n}") };
                    context! { name, lines }
                })
                .collect();
            let mut says = vec![says.to_owned()];
            if sections.is_empty() {
                says.push("There is nothing to change.".to_owned());
            }
            let text = render(
                "fragment.ini",
                FRAGMENT,
                &context! { head => head(self.machine, self.correction), says, sections },
            )?;
            self.put(&format!("{folder}{path}"), text);
        }
        Ok(())
    }

    fn table_files(
        &mut self,
        folder: &str,
        new: &mut BTreeMap<(u8, usize), Vec<String>>,
        old: &mut BTreeMap<(u8, usize), Vec<String>>,
    ) {
        let unit = self.mm_per_unit();
        for (axis, table) in self.tables.clone() {
            let active =
                self.correction.active.as_ref().and_then(|a| a.stock.as_ref()?.axis_tables.get(&axis).cloned());
            self.put(&format!("{folder}{}", table.file), axis_table::text(axis, &table, unit));
            let restore = active.map(|old_table| {
                let file = format!("restore_{}", table.file);
                self.put(&format!("{folder}{file}"), axis_table::text(axis, &old_table, unit));
                file
            });
            for joint in self.joints.numbers(axis) {
                let lines =
                    |file: &str, kind: &str| [format!("COMP_FILE = {file}"), format!("COMP_FILE_TYPE = {kind}")];
                new.entry((1, joint)).or_default().extend(lines(&table.file, "1"));
                let own = self.options.ini.as_ref().and_then(|i| i.comp_file.get(&joint));
                old.entry((1, joint)).or_default().extend(match (&restore, own) {
                    (Some(file), _) => lines(file, "1").to_vec(),
                    (None, Some((file, kind))) => lines(file, kind).to_vec(),
                    (None, None) => {
                        vec![
                            "# take out the lines COMP_FILE and COMP_FILE_TYPE (assumed: there was no table before)"
                                .to_owned(),
                        ]
                    }
                });
            }
        }
    }

    // --------------------------------------------------------------------------------------------------- stock

    fn stock(&mut self) -> Result<Way> {
        let (machine, module) = (self.machine, self.module.clone());
        let (terms, reference_mm, kept) = stock::terms_at_the_workpiece(machine, self.correction);
        if module.is_ok() && !kept.is_empty() {
            self.findings.push(Finding::info("tables::kept", format!("stock/: {}", kept_in_words(&kept))));
        }
        let (carried, not): (Vec<Term>, Vec<Term>) =
            terms.into_iter().partition(|t| stock::why_not(machine, &module, t).is_none());
        let home = stock::home_offsets(machine, &carried);
        let mut record = Stock { home_offset_deg: home.clone(), axis_tables: self.table_map(), ..Stock::default() };
        let mut kinematics = None;
        if let Ok(module) = &module {
            let pins = stock::pins(machine, *module, &carried);
            record.module = Some(module.name.to_owned());
            record.pins = pins.pins.clone();
            record.workpiece_shift_mm = Some(pins.workpiece_shift_mm);
            kinematics = Some(format!("{} coordinates={}", module.name, self.joints.coordinates()));
            let old_pins = match self.active(Mode::Stock).and_then(|a| a.stock.clone()) {
                Some(old) if !old.pins.is_empty() => old.pins,
                _ => stock::pins(machine, *module, &[]).pins,
            };
            let says = [
                format!("Pins of {}: load this after `loadrt [KINS]KINEMATICS` (a further [HAL] HALFILE).", module.name),
                "tool-offset holds the probe's length, for programs with G49. For other tools take that line out and write".to_owned(),
                format!("    net axiscal-tool-offset motion.tooloffset.z => {}.tool-offset", module.name),
                "with G43 and tool lengths that count from the spindle's pivot.".to_owned(),
            ];
            self.module_pins("stock/axiscal.hal", module, &pins.pins, &says)?;
            let says = ["The pins before: load this in place of axiscal.hal to go back.".to_owned()];
            self.module_pins("stock/restore.hal", module, &old_pins, &says)?;
        }
        self.ini_files("stock/", kinematics, &home)?;
        for (path, text) in work_offset::files(machine, self.correction, &carried)? {
            self.put(&path, text);
        }
        let compensation = Compensation { reference_mm, ..self.compensation(Mode::Stock, carried, Some(record)) };
        let json = compensation.to_json()?;
        self.put("stock/compensation.json", json);
        let mut left = self.left_by_all();
        left.extend(not.iter().filter(|t| t.value != 0.0).map(|term| {
            let why = stock::why_not(machine, &module, term).unwrap_or_default();
            self.left(&term.parameter, &term.effect, term.value, &term.unit, self.lever(term), why)
        }));
        Ok(Way { compensation, left })
    }

    fn module_pins(
        &mut self,
        path: &str,
        module: &Module,
        pins: &BTreeMap<String, f64>,
        says: &[String],
    ) -> Result<()> {
        let unit = self.mm_per_unit();
        let pins: Vec<Pin> =
            pins.iter().map(|(name, mm)| Pin { name: name.clone(), value: mm / unit, says: String::new() }).collect();
        self.hal_file(&HalFile { path, module: module.name, says, pins: &pins })
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
