//! The parameters that the control has itself: names, numbers, coordinate systems.

use super::{Ngc, SYSTEMS};
use crate::axes::AxisName;
use crate::check::run::{Spoken, Vm};

/// Predefined parameters (manual 11.3.5): they cannot be written.
pub(super) const READ_ONLY: [&str; 18] = [
    "_task",
    "_metric",
    "_imperial",
    "_tool_offset",
    "_absolute",
    "_incremental",
    "_x",
    "_y",
    "_z",
    "_a",
    "_b",
    "_c",
    "_abs_x",
    "_abs_y",
    "_abs_z",
    "_abs_a",
    "_abs_b",
    "_abs_c",
];

impl Ngc {
    pub(super) fn named(&self, name: &str, vm: &Vm) -> Option<f64> {
        let truth = |yes: bool| if yes { 1.0 } else { 0.0 };
        let axis = |letter: &str| letter.chars().next().and_then(AxisName::from_letter).filter(|_| letter.len() == 1);
        Some(match name {
            "_task" => 1.0,
            "_metric" => truth(!self.modes.inch),
            "_imperial" => truth(self.modes.inch),
            "_tool_offset" => truth(self.modes.tool_on),
            "_absolute" => truth(!self.modes.incremental),
            "_incremental" => truth(self.modes.incremental),
            _ => {
                if let Some(axis) = name.strip_prefix("_abs_").and_then(axis) {
                    vm.at.get(axis) / self.unit(axis)
                } else {
                    self.shown(name.strip_prefix('_').and_then(axis)?, &vm.at)
                }
            }
        })
    }

    pub(super) fn parameter(&self, n: u32, vm: &Vm) -> Option<f64> {
        let truth = |yes: bool| if yes { 1.0 } else { 0.0 };
        let axis = |first: u32| AxisName::ALL.get((n - first) as usize).copied();
        Some(match n {
            5061..=5066 => {
                let axis = axis(5061)?;
                self.probed[axis.index()] / self.unit(axis)
            }
            5070 => truth(self.hit),
            5210 => truth(self.g92_on),
            5211..=5216 => self.g92[(n - 5211) as usize],
            5220 => self.modes.system as f64 + 1.0,
            5221..=5400 => {
                let (system, place) = ((n - 5221) / 20, (n - 5221) % 20);
                return self.slot(system as usize, place);
            }
            5420..=5425 => self.shown(axis(5420)?, &vm.at),
            _ => return None,
        })
    }

    /// A parameter of a coordinate system; U, V, W are 0 on a machine without them.
    pub(super) fn slot(&self, system: usize, place: u32) -> Option<f64> {
        let offsets = self.systems.get(system)?;
        match place {
            0..=5 => offsets.get(place as usize).copied(),
            6..=8 => Some(0.0),
            9 => offsets.last().copied(),
            _ => None,
        }
    }

    pub(super) fn set_system(&mut self, words: &[Spoken]) -> Result<(), String> {
        let value = |address: &str| words.iter().find(|w| w.address == address).map(|w| w.value);
        if value("L") != Some(2.0) {
            return Err("of G10 only L2 is known".to_owned());
        }
        let n = value("P").ok_or("G10 L2 needs P")?;
        let system =
            (1..=SYSTEMS).find(|s| *s as f64 == n).ok_or_else(|| format!("there is no coordinate system P{n}"))? - 1;
        let mut offsets = self.systems[system];
        for axis in AxisName::ALL {
            if let Some(x) = words.iter().find(|w| w.address.starts_with(axis.letter())) {
                // G10 sets what is written, in G91 too (manual 11.5.14)
                offsets[axis.index()] = x.value * self.unit(axis);
            }
        }
        if let Some(r) = value("R") {
            offsets[6] = r;
        }
        self.systems[system] = offsets;
        if self.modes.system == system {
            self.acting = offsets;
        }
        Ok(())
    }
}
