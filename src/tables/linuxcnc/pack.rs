//! Puts the files of an export together.

use super::axis_table::{self};
use super::component;
use super::ini::Joints;
use super::stock::{self, Module};
use super::{CONTROLLER, Changed, Export, Left, Options, Way, force, head, program, readme, render, work_offset};
use crate::axes::AxisName;
use crate::diag::{Failure, Finding, Findings, Result};
use crate::machine::{Machine, Side};
use crate::post::{ModuleFault, Release};
use crate::tables::compensation::{AxisTable, Compensation, FORMAT, Mode, Stock, Term};
use crate::tables::correction::{Correction, left_um, rounded};
use crate::tables::restate::kept_in_words;
use crate::tables::rows::TableError;
use minijinja::{Value, context};
use std::collections::BTreeMap;

/// Why a line is a remark.
const NO_INI: &str = "(no INI file was given)";

const SETP: &str = include_str!("../templates/linuxcnc/setp.hal.j2");
const FRAGMENT: &str = include_str!("../templates/linuxcnc/fragment.ini.j2");
const CHANGES: &str = include_str!("../templates/linuxcnc/changes.txt.j2");
/// Values that differ by less are the same, mm.
const SAME_MM: f64 = 1e-4;
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

    // -------------------------------------------------------------------------------------------- INI fragments

    /// The `[KINS] KINEMATICS` line that was in force, where it is known.
    fn old_kinematics(&self) -> Option<String> {
        let coordinates = self.joints.coordinates();
        if let Some(line) = self.options.ini.as_ref().and_then(|i| i.kinematics.clone()) {
            return Some(line);
        }
        let active = self.correction.active.as_ref();
        let module = active.and_then(|a| a.component.clone().or_else(|| a.stock.as_ref()?.module.clone()));
        module.map(|module| format!("{module} coordinates={coordinates}"))
    }

    /// `axiscal.ini` and `restore.ini` of a directory, with the axis tables beside them.
    fn ini_files(&mut self, folder: &str, kinematics: Option<String>, home: &BTreeMap<AxisName, f64>) -> Result<()> {
        let mut new: BTreeMap<(u8, usize), Vec<String>> = BTreeMap::new();
        let mut old = new.clone();
        const KINS: (u8, usize) = (0, 0);
        if let Some(line) = kinematics {
            let joints = format!("JOINTS = {}", self.joints.count());
            new.insert(KINS, vec![format!("KINEMATICS = {line}"), joints.clone()]);
            let lines = match self.old_kinematics() {
                Some(line) => vec![format!("KINEMATICS = {line}"), joints],
                None => vec![format!("# put back the lines KINEMATICS and JOINTS that you replaced {NO_INI}")],
            };
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
                let Some(ini) = &self.options.ini else {
                    self.change(folder, format!("[JOINT_{joint}] HOME_OFFSET"), change, "deg");
                    let says = format!("# {SHEET} says by how much HOME_OFFSET changes {NO_INI}");
                    new.entry((1, joint)).or_default().push(says);
                    let says = format!("# put back the line HOME_OFFSET that you replaced {NO_INI}");
                    old.entry((1, joint)).or_default().push(says);
                    continue;
                };
                // an INI without the line homes to 0
                let was = ini.home_offset.get(&joint).copied().unwrap_or(0.0);
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
            if !self.knows_table(axis) {
                self.table_changes(folder, axis, &table);
                for joint in self.joints.numbers(axis) {
                    let says = format!(
                        "# {SHEET} says by how much the axis compensation (COMP_FILE, BACKLASH) changes {NO_INI}"
                    );
                    new.entry((1, joint)).or_default().push(says);
                    let says = format!("# put back what COMP_FILE and BACKLASH were {NO_INI}");
                    old.entry((1, joint)).or_default().push(says);
                }
                continue;
            }
            let active = self.loaded_table(axis).cloned();
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

    /// The rows of an axis table as changes of the one that the machine has.
    fn table_changes(&mut self, folder: &str, axis: AxisName, table: &AxisTable) {
        let before = self.correction.active.as_ref().and_then(|a| a.stock.as_ref()?.axis_tables.get(&axis).cloned());
        let (unit, factor) = if axis.is_rotary() { ("deg", 1.0) } else { (self.length_unit(), self.mm_per_unit()) };
        for row in &table.rows {
            for (column, up) in [(1, true), (2, false)] {
                let was = before.as_ref().map_or(0.0, |t| t.at(row[0], up));
                let at = plain(rounded(row[0] / factor));
                let way = if up { "up" } else { "down" };
                let name = format!("compensation of {axis} at {at} {unit}, moving {way},");
                self.change(folder, name, (row[column] - was) / factor, unit);
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
        let mut record = Stock { home_offset_deg: home.clone(), ..self.table_record() };
        let mut kinematics = None;
        if let Ok(module) = &module {
            let pins = stock::pins(machine, *module, &carried);
            record.module = Some(module.name.to_owned());
            record.pins = pins.pins.clone();
            record.version = Some(self.release.name.clone());
            record.conventional_directions = module.conventional;
            let told = |fault: &ModuleFault| {
                Finding::warning("tables::build", format!("stock/: {}", fault.says))
                    .help("use a newer build, or the kinematics component, which does not depend on it")
            };
            let faults: Vec<Finding> = self.faults(module).map(told).collect();
            self.findings.0.extend(faults);
            record.workpiece_shift_mm = Some(pins.workpiece_shift_mm);
            kinematics = Some(format!("{} coordinates={}", module.name, self.joints.coordinates()));
            let loaded = self.active(Mode::Stock).and_then(|a| a.stock.clone()).filter(|old| !old.pins.is_empty());
            let before =
                loaded.as_ref().map_or_else(|| stock::pins(machine, *module, &[]).pins, |old| old.pins.clone());
            let change = |name: &String, mm: f64| rounded(mm - before.get(name).copied().unwrap_or(0.0));
            let present = self.present_pins(module, loaded.as_ref(), &before);
            let changed = pins.pins.iter().filter(|(name, mm)| change(name, **mm) != 0.0);
            let lacks: Vec<String> =
                changed.filter(|(n, _)| !present.contains_key(*n)).map(|(n, _)| n.clone()).collect();
            if let ([name, ..], false) = (&lacks[..], self.options.old_pins.is_empty()) {
                let says = format!("--old does not give all pins that change, it lacks: {}", lacks.join(", "));
                self.findings.push(
                    Finding::error("tables::old_pins", says)
                        .help(format!("`halcmd getp {}.{name}` on the machine prints the present value", module.name)),
                );
            }
            let written: BTreeMap<String, f64> = present
                .iter()
                .filter_map(|(name, was)| Some((name.clone(), rounded(was + change(name, *pins.pins.get(name)?)))))
                .collect();
            if !lacks.is_empty() {
                record.pins_by_change = true;
                let (factor, unit) = (self.mm_per_unit(), self.length_unit());
                for (name, mm) in &pins.pins {
                    self.change("stock/", format!("{}.{name}", module.name), change(name, *mm) / factor, unit);
                }
            } else if written != pins.pins {
                record.pins_written = written.clone();
            }
            let says = [
                format!("Written for {}. {}", self.release.says, self.turning(module)),
                format!("Pins of {}: load this after `loadrt [KINS]KINEMATICS` (a further [HAL] HALFILE).", module.name),
                "tool-offset holds the probe's length, for programs with G49. For other tools take that line out and write".to_owned(),
                format!("    net axiscal-tool-offset motion.tooloffset.z => {}.tool-offset", module.name),
                "with G43 and tool lengths that count from the spindle's pivot.".to_owned(),
            ];
            if lacks.is_empty() {
                self.module_pins("stock/axiscal.hal", module, &written, &says)?;
                let says = ["The pins before: load this in place of axiscal.hal to go back.".to_owned()];
                self.module_pins("stock/restore.hal", module, &present, &says)?;
            }
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

    /// The pins of the module before: as given by hand, as an earlier export wrote them, or, where the module was not in use, those
    /// of the machine as described (`before`). Empty where they are not known.
    fn present_pins(
        &mut self,
        module: &Module,
        loaded: Option<&Stock>,
        before: &BTreeMap<String, f64>,
    ) -> BTreeMap<String, f64> {
        let in_ini = self.options.ini.as_ref().and_then(|ini| ini.kinematics.as_ref());
        let other = in_ini.and_then(|line| line.split_whitespace().next()).filter(|name| *name != module.name);
        let known = match loaded.filter(|old| !old.pins_by_change) {
            Some(old) if old.pins_written.is_empty() => before.clone(),
            Some(old) => old.pins_written.clone(),
            None if other.is_some() => before.clone(),
            None => BTreeMap::new(),
        };
        let given = &self.options.old_pins;
        if given.is_empty() {
            return known;
        }
        let differs = |(name, mm): (&String, &f64)| {
            let written = known.get(name).filter(|w| (*w - mm).abs() > SAME_MM)?;
            Some(format!(
                "{}.{name} is {} mm by --old and {} mm by that file",
                module.name,
                plain(*mm),
                plain(*written)
            ))
        };
        let finding = match (other, given.iter().find_map(differs)) {
            (Some(other), _) if loaded.is_none() => Some(
                Finding::error(
                    "tables::old_pins",
                    format!("--old gives pins of {}, and the INI file says that {other} is in use", module.name),
                )
                .help("leave --old away, or give the INI file with which the machine ran"),
            ),
            (_, Some(differs)) => Some(
                Finding::error(
                    "tables::old_not_active",
                    format!("the compensation that was active during the measurement wrote other pins: {differs}"),
                )
                .help("give the pins from after that compensation was loaded, or leave --old away: then what it wrote is used"),
            ),
            _ => None,
        };
        let given = given.clone();
        self.findings.0.extend(finding);
        given
    }

    fn module_pins(
        &mut self,
        path: &str,
        module: &Module,
        pins: &BTreeMap<String, f64>,
        says: &[String],
    ) -> Result<()> {
        let unit = self.mm_per_unit();
        let mut pins: Vec<Pin> =
            pins.iter().map(|(name, mm)| Pin { name: name.clone(), value: mm / unit, says: String::new() }).collect();
        // what the control has without the pin is relied on too: it is set in any case
        if let (Some(name), Some(conventional)) = (&self.release.direction_pin, module.conventional) {
            let says = self.turning(module);
            pins.push(Pin { name: name.clone(), value: f64::from(u8::from(conventional)), says });
        }
        let known = self.release.pins.get(module.name);
        if let Some(pin) = pins.iter().find(|p| known.is_none_or(|known| !known.contains(&p.name))) {
            let says = format!("{} of {} has no pin {}", module.name, self.release.says, pin.name);
            return Err(Failure::new("tables::pin", says)
                .help("LinuxCNC would not load the HAL file: name the version of your control with --target"));
        }
        self.hal_file(&HalFile { path, module: module.name, says, pins: &pins })
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
