//! What the stock means of LinuxCNC carry: pins of a stock module, home offsets, axis tables, and programs for the work
//! offset.

use super::{HalFile, Packing, Pin, plain};
use crate::diag::{Failure, Finding, Result};
use crate::post::ModuleFault;
use crate::tables::compensation::{Compensation, Mode, Stock, Term};
use crate::tables::correction::rounded;
use crate::tables::linuxcnc::stock::{self, Module};
use crate::tables::linuxcnc::{Way, work_offset};
use crate::tables::restate::kept_in_words;
use std::collections::BTreeMap;

/// Values that differ by less are the same, mm.
const SAME_MM: f64 = 1e-4;

impl Packing<'_> {
    pub(super) fn stock(&mut self) -> Result<Way> {
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
}
