//! Lines for the machine's INI file, new and old, with the axis tables that they name.

use super::{Packing, SHEET, plain};
use crate::axes::AxisName;
use crate::diag::Result;
use crate::tables::compensation::{AxisTable, Mode};
use crate::tables::correction::rounded;
use crate::tables::linuxcnc::{axis_table, head, render};
use minijinja::{Value, context};
use std::collections::BTreeMap;

/// Why a line is a remark.
const NO_INI: &str = "(no INI file was given)";

const FRAGMENT: &str = include_str!("../../templates/linuxcnc/fragment.ini.j2");

impl Packing<'_> {
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
    pub(super) fn ini_files(
        &mut self,
        folder: &str,
        kinematics: Option<String>,
        home: &BTreeMap<AxisName, f64>,
    ) -> Result<()> {
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
}
