//! System variables, as far as programs of ours and of probing packages read them.

use super::MacroB;
use crate::axes::AxisName;
use crate::check::macro_b::leftover_modes;
use crate::check::run::Vm;

/// What #3001 counts.
pub(super) const MILLISECOND_S: f64 = 0.001;

/// #3012, hours minutes seconds in one number: the program begins two minutes before midnight.
fn time_of_day(clock_s: f64) -> f64 {
    const DAY_S: f64 = 86_400.0;
    let s = (clock_s + DAY_S - 120.0).rem_euclid(DAY_S);
    (s / 3600.0).floor() * 10_000.0 + (s / 60.0 % 60.0).floor() * 100.0 + (s % 60.0).floor()
}

impl MacroB {
    pub(super) fn system_variable(&self, n: u32, vm: &Vm) -> Option<f64> {
        Some(match n {
            // inputs of the machine: a condition on one is run both ways
            1000..=1063 if !self.builder.is_probe_input(n) => 0.0,
            2001..=2200 => self.stored_mm(n - 2000) / self.unit(AxisName::Z),
            11_001..=11_999 => self.stored_mm(n - 11_000) / self.unit(AxisName::Z),
            3001 => ((vm.clock_s(MILLISECOND_S) - self.seconds) * 1000.0).round(),
            3012 => time_of_day(vm.clock_s(1.0)),
            3004 => self.holds,
            4002 => self.plane,
            4003 => {
                if self.incremental {
                    91.0
                } else {
                    90.0
                }
            }
            4005 => self.feed_mode,
            4006 => {
                if self.inch {
                    20.0
                } else {
                    21.0
                }
            }
            4008 => match (self.tool_on, vm.world.is_tcp()) {
                (false, _) => 49.0,
                (true, false) => 43.0,
                (true, true) => 43.4,
            },
            4012 | 4014 => self.system,
            4130 => self.system_p,
            5021..=5026 => {
                let axis = self.axis(n - 5020)?;
                self.shown(axis, vm.at.get(axis) + self.skew.off(axis, &vm.at)) / self.unit(axis)
            }
            5041..=5046 => {
                let axis = self.axis(n - 5040)?;
                self.shown(axis, self.sense(axis) * (vm.at.get(axis) - self.shift(axis))) / self.unit(axis)
            }
            5061..=5066 => {
                let axis = self.axis(n - 5060)?;
                self.shown(axis, self.skipped[axis.index()]) / self.unit(axis)
            }
            _ => return leftover_modes::modal(n, self.lasting),
        })
    }
}
