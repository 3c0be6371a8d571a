//! What is wrong with the virtual machine, checked: planted effects, displaced blocks, noise, clock and weather.

use super::catalogue::unit::Unit;
use super::catalogue::{self, Parameter, Refusal, Role};
use super::own::formula::Formula;
use super::own::{Own, converted};
use super::rigid::Vec3;
use super::terms::{Target, Term};
use crate::axes::AxisName;
use crate::diag::{Failure, Findings, Result, Source, enough};
use crate::machine::Machine;
use crate::units::Plain;
use std::collections::BTreeMap;

pub use super::written::{parse, parse_with};

/// A checked scenario.
#[derive(Debug, Clone, Default)]
pub struct Scenario {
    /// Of the noise: the same seed gives the same log.
    pub seed: u64,
    /// What was planted, as it was written: the truth that an identification is compared with.
    pub planted: Vec<Planted>,
    /// The same as terms of the chain.
    pub(super) terms: Vec<Term>,
    /// Formulas of planted effects of the user's own.
    pub(super) formulas: Vec<Formula>,
    /// Files of effects of the user's own, as the scenario names them.
    pub effects_files: Vec<String>,
    /// Blocks that stand elsewhere or have another size than the plan says.
    pub blocks: Vec<BlockError>,
    /// How much longer edges of single blocks are.
    pub(super) edges: Vec<LongerEdge>,
    /// Scatter.
    pub noise: Noise,
    /// When the run takes place.
    pub clock: Clock,
    /// When the spindle ran: from, to (s on the study's clock), rpm; one after the other. Empty: since the first touch.
    pub spindle: Vec<[f64; 3]>,
    /// Temperature over time: hours since the study's first touch, °C; straight between the points. Empty: not measured.
    pub temperature: Vec<(f64, f64)>,
}

/// A planted value.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct Planted {
    /// Id of the effect.
    pub effect: String,
    /// Name of the parameter.
    pub parameter: String,
    /// Its value in `unit`.
    pub value: f64,
    /// As written in files.
    pub unit: &'static str,
}

/// A block that is not where or what the plan says: `p' = centre + shift + Rz(g)·Ry(b)·Rx(a)·(p - centre)` in the
/// carrier's frame.
#[derive(Debug, Clone, PartialEq)]
pub struct BlockError {
    pub mounting: String,
    pub name: String,
    /// Displacement, mm.
    pub shift_mm: Vec3,
    /// Turns about x, y, z, rad.
    pub tilt_rad: Vec3,
    /// How much longer its edges are, mm.
    pub size_mm: Vec3,
}

/// In place of an edge: the radius.
pub(super) const RADIUS: usize = 3;

/// An edge or radius of one block that is longer than the plan says.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct LongerEdge {
    /// `mounting/block`, or `block`.
    pub block: String,
    /// 0, 1, 2: along x, y, z of the block; [`RADIUS`]: of what is round.
    pub along: usize,
    /// By how much its half is longer, mm.
    pub half_mm: f64,
}

/// Scatter of touches; all 1 sigma in mm.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Noise {
    /// Of a touch, along its approach.
    pub touch_mm: f64,
    /// Of each component of the displacement that a ball has during one index visit.
    pub visit_mm: f64,
    /// Share of touches that are disturbed (0 to 1).
    pub outlier_share: f64,
    /// Scatter of the disturbed ones.
    pub outlier_mm: f64,
    /// Steps in which the log counts, 0: all digits.
    pub rounding_mm: f64,
}

/// When the run takes place, s.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Clock {
    /// When the program began.
    pub started_s: f64,
    /// When the first touch of the study was made (default: the first touch of this run).
    pub first_touch_s: Option<f64>,
}

impl Scenario {
    /// A machine without errors, noise or displaced blocks.
    #[must_use]
    pub fn flawless() -> Self {
        Self::default()
    }

    /// The same with values of an effect planted, each in the unit that the effect states.
    ///
    /// # Errors
    /// When the effect or a parameter is not known for this machine, or a value is not finite.
    pub fn with(mut self, machine: &Machine, effect: &str, values: &[(&str, f64)]) -> Result<Self> {
        let values: Vec<Value<'_>> = values.iter().map(|&(name, value)| Value { name, value, unit: None }).collect();
        match self.plant(machine, effect, &values, true) {
            Ok(()) => Ok(self),
            Err(misfits) => {
                let findings = misfits.into_iter().map(|m| crate::diag::Finding::error(m.code, m.message).help(m.help));
                Err(Failure(findings.collect()))
            }
        }
    }

    /// The same with a block displaced.
    #[must_use]
    pub fn with_block(mut self, mounting: &str, name: &str, shift_mm: Vec3, tilt_rad: Vec3) -> Self {
        let (mounting, name) = (mounting.to_owned(), name.to_owned());
        self.blocks.push(BlockError { mounting, name, shift_mm, tilt_rad, size_mm: [0.0; 3] });
        self
    }

    /// The same with another scatter (mm, 1 sigma) and seed.
    #[must_use]
    pub fn with_noise(mut self, touch_mm: f64, visit_mm: f64, seed: u64) -> Self {
        self.noise.touch_mm = touch_mm;
        self.noise.visit_mm = visit_mm;
        self.seed = seed;
        self
    }

    /// Plants values of one effect; what is wrong with them comes back, and then nothing was planted. `similar`: names that
    /// are like an unknown one are searched, which takes longer than everything else.
    pub(super) fn plant(
        &mut self,
        machine: &Machine,
        id: &str,
        values: &[Value<'_>],
        similar: bool,
    ) -> Result<(), Vec<Misfit>> {
        let settings = |name: &str| {
            let called = |v: &&Value<'_>| {
                let row = Parameter::setting_named(name);
                row.is_called(v.name)
            };
            let unit = catalogue::unit_of_setting(name);
            values.iter().find(called).map(|v| Value { unit: v.unit.or(unit), ..*v }.base())
        };
        let rows = catalogue::parameters(id, machine, &settings).map_err(|refusal| {
            vec![match refusal {
                Refusal::Unknown => Misfit {
                    value: None,
                    code: "scenario::effect",
                    message: format!("no effect is called {id:?}"),
                    help: if similar {
                        let names = nearest(id, catalogue::ids(machine));
                        format!("did you mean {}? `axiscal effects` lists all", names.join(", "))
                    } else {
                        "`axiscal effects` lists all".to_owned()
                    },
                },
                Refusal::NotHere(why) => Misfit {
                    value: None,
                    code: "scenario::effect_not_here",
                    message: format!("effect {id:?} cannot be planted: {why}"),
                    help: "take it out, or choose the effect of an axis that the machine has".to_owned(),
                },
            }]
        })?;
        let mut misfits = Vec::new();
        let mut terms = Vec::new();
        let mut edges = Vec::new();
        let mut planted = Vec::new();
        for (i, value) in values.iter().enumerate() {
            let similar = !enough(misfits.iter().map(|m: &Misfit| m.code), "scenario::parameter");
            let mut bad = |code, message: String, help: String| {
                misfits.push(Misfit { value: Some(i), code, message, help });
            };
            let (name, block) = catalogue::name_and_block(id, value.name);
            let Some(row) = rows.iter().find(|r| r.is_called(name)) else {
                // those with the nearest names, as they are written
                let names = if similar { rows.iter().map(|r| r.name.clone()).collect() } else { Vec::new() };
                let near = nearest(value.name, names);
                let names: Vec<String> =
                    near.iter().filter_map(|n| rows.iter().find(|r| &r.name == n)).map(Parameter::written).collect();
                let more = rows.len() - names.len();
                let more = if more > 0 { format!(" and {more} more: `axiscal effects`") } else { String::new() };
                bad(
                    "scenario::parameter",
                    format!("effect {id:?} has no parameter {:?}", value.name),
                    format!("it has: {}{more}", names.join(", ")),
                );
                continue;
            };
            let same = |earlier: &Value<'_>| {
                let (name, of) = catalogue::name_and_block(id, earlier.name);
                row.is_called(name) && of == block
            };
            if let Some(block) = block.filter(|b| !has_block(machine, b)) {
                bad(
                    "scenario::block",
                    format!("no mounting has a block {block:?}"),
                    format!("{:?} has: {}", machine.name, blocks_of(machine)),
                );
            }
            if values[..i].iter().any(same) {
                bad(
                    "scenario::parameter_twice",
                    format!("parameter {} of {id:?} is given twice", row.name),
                    "the symbols of the paper and of ISO 230 name the same value: keep one".to_owned(),
                );
            }
            let unit = value.unit.unwrap_or(row.unit);
            if unit.kind() != row.unit.kind() {
                bad(
                    "scenario::unit",
                    format!("{} of {id:?} is given in {}, expected {}", row.name, unit.word(), row.unit.word()),
                    format!("write the value in {}", row.unit.word()),
                );
            }
            if !value.value.is_finite() {
                bad(
                    "scenario::value",
                    format!("{} of {id:?} is {}, expected a finite number", row.name, Plain(value.value)),
                    "write a number".to_owned(),
                );
            }
            match &row.role {
                Role::Amount(acts) => {
                    let base = unit.base(value.value);
                    for &(target, shape, f) in acts {
                        match (target, block) {
                            (Target::HalfSize(along), Some(block)) => {
                                edges.push(LongerEdge { block: block.to_owned(), along, half_mm: f * base });
                            }
                            (Target::SphereRadius | Target::CylinderRadius, Some(block)) => {
                                edges.push(LongerEdge { block: block.to_owned(), along: RADIUS, half_mm: f * base });
                            }
                            _ => terms.push(Term { target, shape, amount: f * base }),
                        }
                    }
                }
                Role::Setting { positive } if !positive || value.value > 0.0 => {}
                Role::Setting { .. } => bad(
                    "scenario::setting",
                    format!("{} of {id:?} is {}, expected more than 0", row.name, Plain(value.value)),
                    "write a positive number".to_owned(),
                ),
            }
            let name = block.map_or_else(|| row.name.clone(), |block| format!("{}@{block}", row.name));
            planted.push(Planted { effect: id.to_owned(), parameter: name, value: value.value, unit: unit.word() });
        }
        if misfits.is_empty() {
            self.terms.extend(terms);
            self.edges.extend(edges);
            self.planted.extend(planted);
            Ok(())
        } else {
            Err(misfits)
        }
    }

    /// Plants values of an effect of the user's own; a name may end in `@mounting/block` or `@block`.
    pub(super) fn plant_own(&mut self, machine: &Machine, own: &Own, values: &[Value<'_>]) -> Result<(), Vec<Misfit>> {
        let id = &own.id;
        if let Some(why) = &own.not_here {
            return Err(vec![Misfit {
                value: None,
                code: "scenario::effect_not_here",
                message: format!("effect {id:?} cannot be planted: {why}"),
                help: "take it out, or plant one that the machine has the axes for".to_owned(),
            }]);
        }
        let mut misfits = Vec::new();
        // one group for all blocks (None), and one for each block that is named
        let mut groups: BTreeMap<Option<&str>, Vec<(usize, f64)>> = BTreeMap::new();
        for (i, value) in values.iter().enumerate() {
            let mut bad = |code, message: String, help: String| {
                misfits.push(Misfit { value: Some(i), code, message, help });
            };
            let (name, block) = value.name.split_once('@').map_or((value.name, None), |(n, b)| (n, Some(b)));
            let Some(row) = own.parameters.iter().position(|p| p.name == name) else {
                bad(
                    "scenario::parameter",
                    format!("effect {id:?} has no parameter {name:?}"),
                    format!("it has: {}", own.written()),
                );
                continue;
            };
            if let Some(block) = block.filter(|b| !has_block(machine, b)) {
                bad(
                    "scenario::block",
                    format!("no mounting has a block {block:?}"),
                    format!("{:?} has: {}", machine.name, blocks_of(machine)),
                );
            }
            let unit = own.parameters[row].unit;
            let given = value.unit.unwrap_or(unit);
            let Some(amount) = converted(value.value, given, unit) else {
                bad(
                    "scenario::unit",
                    format!("{name} of {id:?} is given in {}, expected {}", given.word(), unit.word()),
                    format!("write the value in {}", unit.word()),
                );
                continue;
            };
            groups.entry(block).or_default().push((row, amount));
            self.planted.push(Planted {
                effect: id.clone(),
                parameter: value.name.to_owned(),
                value: value.value,
                unit: given.word(),
            });
        }
        if !misfits.is_empty() {
            return Err(misfits);
        }
        for (block, group) in groups {
            let (terms, formulas) = own.plant(&group, block, self.formulas.len());
            self.terms.extend(terms);
            self.formulas.extend(formulas);
        }
        Ok(())
    }

    /// How far the spindle has gone towards its growth at the highest speed, for a time constant: it nears that of each speed, and
    /// nothing while it stands. `hours` and the stretches count from one moment.
    pub(super) fn spindle_warmth(stretches: &[[f64; 3]], hours: f64, tau: f64) -> f64 {
        let highest = stretches.iter().fold(0.0, |most: f64, s| most.max(s[2]));
        let (mut grown, mut at) = (0.0, f64::NEG_INFINITY);
        let mut settle = |until: f64, goal: f64| {
            if until > at {
                grown = if at.is_finite() { goal + (grown - goal) * (-(until - at) / tau).exp() } else { 0.0 };
                at = until;
            }
        };
        for &[from, to, rpm] in stretches {
            settle(from.min(hours), 0.0);
            settle(to.min(hours), rpm / highest);
        }
        settle(hours, 0.0);
        grown
    }

    /// The temperature at a time (hours), °C; outside the profile it stays as at its end.
    pub(super) fn temperature_at(&self, hours: f64) -> Option<f64> {
        let (first, last) = (self.temperature.first()?, self.temperature.last()?);
        let after = self.temperature.partition_point(|p| p.0 <= hours);
        let (Some(a), Some(b)) =
            (after.checked_sub(1).and_then(|i| self.temperature.get(i)), self.temperature.get(after))
        else {
            return Some(if after == 0 { first.1 } else { last.1 });
        };
        Some(a.1 + (b.1 - a.1) * (hours - a.0) / (b.0 - a.0))
    }
}

/// A value as it was written.
#[derive(Debug, Clone, Copy)]
pub(super) struct Value<'a> {
    pub name: &'a str,
    pub value: f64,
    pub unit: Option<Unit>,
}

impl Value<'_> {
    fn base(&self) -> f64 {
        self.unit.map_or(self.value, |u| u.base(self.value))
    }
}

/// What is wrong with a planted value (or, without one, with the effect).
#[derive(Debug, Clone)]
pub(super) struct Misfit {
    pub value: Option<usize>,
    pub code: &'static str,
    pub message: String,
    pub help: String,
}

impl Parameter {
    /// The name with what a bare number means, and the other names.
    fn written(&self) -> String {
        let other = if self.aliases.is_empty() { String::new() } else { format!(" or {}", self.aliases.join(", ")) };
        format!("{}{other} ({})", self.name, self.unit.word())
    }

    fn setting_named(name: &str) -> Self {
        let aliases = vec![format!("{name}_h"), format!("{name}_mm")];
        Self { name: name.to_owned(), aliases, unit: Unit::One, role: Role::Setting { positive: true } }
    }
}

/// Up to ten of the names, the likeliest meant first.
pub(crate) fn nearest(word: &str, mut names: Vec<String>) -> Vec<String> {
    const SHOWN: usize = 10;
    // likeness is between 0 and 1, so that the bits of it are in its order
    names.sort_by_cached_key(|name| std::cmp::Reverse(strsim::jaro_winkler(word, name).to_bits()));
    names.truncate(SHOWN);
    names
}

/// The mounting and block names of a machine, for messages.
pub(super) fn blocks_of(machine: &Machine) -> String {
    let each = machine.mountings.iter().map(|m| {
        let names: Vec<&str> = m.blocks.iter().map(|b| b.name.as_str()).collect();
        format!("{} ({})", m.name, names.join(", "))
    });
    each.collect::<Vec<_>>().join("; ")
}

fn has_block(machine: &Machine, label: &str) -> bool {
    let (mounting, name) = label.split_once('/').map_or((None, label), |(m, n)| (Some(m), n));
    let mut mountings = machine.mountings.iter().filter(|m| mounting.is_none_or(|w| w == m.name));
    mountings.any(|m| m.blocks.iter().any(|b| b.name == name))
}

/// Reads a scenario without a place for its findings, for callers that built the text themselves.
///
/// # Errors
/// As [`parse`].
pub fn parse_text(text: &str, machine: &Machine) -> Result<Scenario> {
    let source: Source = crate::diag::source("scenario", text);
    parse(&source, machine).map(|(scenario, Findings(_))| scenario)
}

/// The axis of a letter, for readers of files.
pub(super) fn axis_named(word: &str) -> Option<AxisName> {
    let mut letters = word.chars();
    let name = AxisName::from_letter(letters.next()?)?;
    letters.next().is_none().then_some(name)
}
