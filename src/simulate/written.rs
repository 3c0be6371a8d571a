//! A scenario as a person wrote it → [`Scenario`]; all findings at once, each with its place and remedy.

use super::catalogue::unit::Unit;
use super::own::{self, Own};
use super::rigid::Vec3;
use super::scenario::{BlockError, Misfit, Scenario, Value, axis_named, blocks_of};
use super::terms::{Shape, Target, Term};
use crate::diag::{Failure, Finding, Findings, Result, Severity, Source, enough, from_toml};
use crate::machine::Machine;
use crate::units::{Plain, mm_from_um, rad_from_deg, ratio_from_ppm};
use std::ops::Range;
use toml::Spanned;
use toml::de::{DeString, DeTable, DeValue};

/// No scatter, order or length in µm is larger than this (1 m).
const LARGEST_NUMBER: f64 = 1e6;

/// A block that stands further off (1 m) stands on another machine.
const LARGEST_SHIFT_MM: f64 = 1e3;

/// A clock shows seconds since anything up to the year 1 (64e9 s ago).
const CLOCK_S: [f64; 2] = [0.0, 1e11];

/// A workshop, with room to play: what a log may hold.
const WEATHER_DEG_C: [f64; 2] = [-50.0, 100.0];

type Table<'a> = DeTable<'a>;
type Node<'a> = Spanned<DeValue<'a>>;

/// Reads and checks a scenario (`docs/formats.md`).
///
/// # Errors
/// When the text is not TOML, or something in it cannot be planted in this machine.
pub fn parse(source: &Source, machine: &Machine) -> Result<(Scenario, Findings)> {
    parse_with(source, machine, &|file| {
        Err(Failure::new("scenario::effects_file", format!("{file}: this scenario has no folder to look in")))
    })
}

/// The same; `open` gives the text of a file of effects that the scenario names.
///
/// # Errors
/// As [`parse`], and when a file of effects is unusable.
pub fn parse_with(
    source: &Source,
    machine: &Machine,
    open: &dyn Fn(&str) -> Result<Source>,
) -> Result<(Scenario, Findings)> {
    let text: &str = source.inner();
    let document = DeTable::parse(text).map_err(|e| {
        from_toml(&e, source, "scenario::not_toml").help("a scenario is TOML; docs/formats.md shows the form")
    })?;
    let mut reader = Reader { source, machine, own: Vec::new(), findings: Findings::default() };
    let mut out = Scenario::default();
    // the user's effects first: what is planted may be of them
    if let Some(node) = document.get_ref().get("effects_file") {
        reader.effects_file(&mut out, node, open);
    }
    // what a file that cannot be read holds is not unknown
    let unread = reader.findings.0.iter().any(|f| f.severity == Severity::Error);
    for (key, node) in in_order(document.get_ref()) {
        match &**key.get_ref() {
            "effects_file" => {}
            "seed" => out.seed = reader.seed(node),
            "effects" if unread => {}
            "effects" => reader.effects(&mut out, node),
            "block" => reader.each(node, "block", |r, t, at| r.block(&mut out, t, at)),
            "harmonic" => reader.each(node, "harmonic", |r, t, at| r.harmonic(&mut out, t, at)),
            "noise" => reader.noise(&mut out, node),
            "time" => reader.time(&mut out, node),
            "spindle" => reader.spindle(&mut out, node),
            "temperature" => reader.temperature(&mut out, node),
            other => {
                let message = format!("a scenario has no {other:?}");
                reader.error(
                    key.span(),
                    "scenario::unknown",
                    message,
                    "it has: seed, effects_file, effects, block, harmonic, noise, time, spindle, temperature",
                );
            }
        }
    }
    reader.findings.finish(out)
}

/// The entries as they stand in the file, so that findings and sums do not depend on the alphabet.
fn in_order<'t, 'i>(table: &'t Table<'i>) -> Vec<(&'t Spanned<DeString<'i>>, &'t Node<'i>)> {
    let mut entries: Vec<_> = table.iter().collect();
    entries.sort_by_key(|(key, _)| key.span().start);
    entries
}

struct Reader<'a> {
    source: &'a Source,
    machine: &'a Machine,
    /// Effects of the user's own.
    own: Vec<Own>,
    findings: Findings,
}

impl Reader<'_> {
    /// `effects_file = ["my-effects.toml"]`, or one name.
    fn effects_file(&mut self, out: &mut Scenario, node: &Node<'_>, open: &dyn Fn(&str) -> Result<Source>) {
        let names: Vec<&Node<'_>> = match node.get_ref() {
            DeValue::Array(names) => names.iter().collect(),
            _ => vec![node],
        };
        for node in names {
            let Some(name) = self.word(node, "effects_file") else { continue };
            match open(name).and_then(|text| own::read(&text, self.machine)) {
                Ok(effects) => {
                    for effect in &effects {
                        if self.own.iter().any(|o| o.id == effect.id) {
                            let message = format!("effect {:?} stands in two files", effect.id);
                            self.error(node.span(), "scenario::effects_file", message, "keep one of the two");
                        }
                    }
                    self.own.extend(effects);
                }
                Err(failure) => self.findings.0.extend(failure.0),
            }
            out.effects_files.push(name.to_owned());
        }
    }

    fn error(&mut self, span: Range<usize>, code: &'static str, message: impl Into<String>, help: impl Into<String>) {
        self.findings.push(Finding::error(code, message).help(help).at(self.source, span));
    }

    fn seed(&mut self, node: &Node<'_>) -> u64 {
        let number = node.get_ref().as_integer().and_then(|i| u64::from_str_radix(i.as_str(), i.radix()).ok());
        number.unwrap_or_else(|| {
            self.error(node.span(), "scenario::seed", "seed is no whole number from 0 on", "write seed = 7");
            0
        })
    }

    fn table<'t, 'i>(&mut self, node: &'t Node<'i>, name: &str) -> Option<&'t Table<'i>> {
        let table = node.get_ref().as_table();
        if table.is_none() {
            self.error(node.span(), "scenario::table", format!("{name} is no table"), format!("write [{name}]"));
        }
        table
    }

    /// Each table of `[[name]]`.
    fn each<'t, 'i>(
        &mut self,
        node: &'t Node<'i>,
        name: &str,
        mut read: impl FnMut(&mut Self, &'t Table<'i>, Range<usize>),
    ) {
        let Some(rows) = node.get_ref().as_array() else {
            self.error(
                node.span(),
                "scenario::table",
                format!("{name} is no list of tables"),
                format!("write [[{name}]]"),
            );
            return;
        };
        for row in rows.iter() {
            match row.get_ref().as_table() {
                Some(table) => read(self, table, row.span()),
                None => self.error(
                    row.span(),
                    "scenario::table",
                    format!("an element of {name} is no table"),
                    format!("write [[{name}]]"),
                ),
            }
        }
    }

    /// A finite number, integer or float.
    fn number(&mut self, node: &Node<'_>, name: &str) -> Option<f64> {
        let value = match node.get_ref() {
            DeValue::Integer(i) => i64::from_str_radix(i.as_str(), i.radix()).ok().map(|i| i as f64),
            DeValue::Float(f) => f.as_str().parse().ok(),
            _ => None,
        };
        match value {
            Some(v) if f64::is_finite(v) => Some(v),
            Some(v) => {
                self.error(
                    node.span(),
                    "scenario::value",
                    format!("{name} is {v}, expected a finite number"),
                    "write a number",
                );
                None
            }
            None => {
                let found = node.get_ref().type_str();
                self.error(
                    node.span(),
                    "scenario::value",
                    format!("{name} is of type {found}, expected a number"),
                    "write a number",
                );
                None
            }
        }
    }

    /// A number from `low` to `high`; `help` says what it is.
    fn within(&mut self, node: &Node<'_>, name: &str, [low, high]: [f64; 2], help: &str) -> Option<f64> {
        let value = self.number(node, name)?;
        if (low..=high).contains(&value) {
            return Some(value);
        }
        self.error(
            node.span(),
            "scenario::range",
            format!("{name} is {}, expected {} to {}", Plain(value), Plain(low), Plain(high)),
            help,
        );
        None
    }

    fn not_negative(&mut self, node: &Node<'_>, name: &str) -> f64 {
        match self.number(node, name) {
            Some(v) if v > LARGEST_NUMBER => {
                self.error(
                    node.span(),
                    "scenario::range",
                    format!("{name} is {}, expected up to {LARGEST_NUMBER}", Plain(v)),
                    "is the unit the right one?",
                );
                0.0
            }
            Some(v) if v >= 0.0 => v,
            Some(v) => {
                self.error(
                    node.span(),
                    "scenario::negative",
                    format!("{name} is {}, expected 0 or more", Plain(v)),
                    "write it without the sign",
                );
                0.0
            }
            None => 0.0,
        }
    }

    /// Three numbers, none of them larger than `most`.
    fn three(&mut self, node: &Node<'_>, name: &str, most: f64) -> Vec3 {
        let array = node.get_ref().as_array().filter(|a| a.len() == 3);
        let Some(array) = array else {
            self.error(
                node.span(),
                "scenario::three",
                format!("{name} is no list of three numbers"),
                "write [x, y, z]",
            );
            return [0.0; 3];
        };
        let mut out = [0.0; 3];
        for (slot, element) in out.iter_mut().zip(array.iter()) {
            *slot = self.within(element, name, [-most, most], "is the unit the right one?").unwrap_or(0.0);
        }
        out
    }

    fn word<'t>(&mut self, node: &'t Node<'_>, name: &str) -> Option<&'t str> {
        let word = node.get_ref().as_str();
        if word.is_none() {
            let message = format!("{name} is no text");
            self.error(node.span(), "scenario::text", message, format!("write {name} = \"…\""));
        }
        word
    }

    fn unknown_key(&mut self, span: Range<usize>, table: &str, key: &str, known: &str) {
        self.error(span, "scenario::unknown", format!("{table} has no {key:?}"), format!("it has: {known}"));
    }

    fn effects(&mut self, out: &mut Scenario, node: &Node<'_>) {
        let Some(table) = self.table(node, "effects") else { return };
        for (id, node) in in_order(table) {
            if super::catalogue::is_a_set_up(id.get_ref()) {
                self.error(
                    id.span(),
                    "scenario::block_setup",
                    format!("{} has values for each block", id.get_ref()),
                    "write a [[block]] table with mounting, name, shift and tilt for each",
                );
                continue;
            }
            let Some(table) = self.table(node, &format!("effects.{}", id.get_ref())) else { continue };
            let before = self.findings.0.len();
            let mut values = Vec::new();
            let mut spans = Vec::new();
            for (name, node) in in_order(table) {
                if let Some((value, unit)) = self.value(node, name.get_ref()) {
                    values.push(Value { name: name.get_ref(), value, unit });
                    spans.push(name.span().start..node.span().end);
                }
            }
            if self.findings.0.len() > before {
                continue;
            }
            let own = self.own.iter().find(|o| o.id == **id.get_ref());
            let planted = match own {
                Some(own) => out.plant_own(self.machine, own, &values),
                None => {
                    let similar = !enough(self.findings.0.iter().map(|f| f.code), "scenario::effect");
                    out.plant(self.machine, id.get_ref(), &values, similar)
                }
            };
            if let Err(misfits) = planted {
                for Misfit { value, code, message, help } in misfits {
                    let span = value.and_then(|i| spans.get(i).cloned()).unwrap_or(id.span());
                    self.error(span, code, message, help);
                }
            }
        }
    }

    /// `0.015` or `{ value = 15, unit = "um" }`.
    fn value(&mut self, node: &Node<'_>, name: &str) -> Option<(f64, Option<Unit>)> {
        let Some(table) = node.get_ref().as_table() else {
            return self.number(node, name).map(|v| (v, None));
        };
        let (mut value, mut unit) = (None, None);
        for (key, node) in in_order(table) {
            match &**key.get_ref() {
                "value" => value = self.number(node, name),
                "unit" => {
                    let word = self.word(node, "unit")?;
                    unit = Unit::parse(word);
                    if unit.is_none() {
                        let known: Vec<&str> = Unit::ALL.iter().map(|u| u.word()).collect();
                        let message = format!("no unit is called {word:?}");
                        self.error(node.span(), "scenario::unit", message, format!("there are: {}", known.join(", ")));
                    }
                }
                other => self.unknown_key(key.span(), name, other, "value, unit"),
            }
        }
        if value.is_none() {
            self.error(
                node.span(),
                "scenario::value",
                format!("{name} has no value"),
                "write { value = 1.5, unit = \"um\" }",
            );
        }
        value.map(|v| (v, unit))
    }

    fn block(&mut self, out: &mut Scenario, table: &Table<'_>, at: Range<usize>) {
        let (mut mounting, mut name) = (None, None);
        let mut block = BlockError {
            mounting: String::new(),
            name: String::new(),
            shift_mm: [0.0; 3],
            tilt_rad: [0.0; 3],
            size_mm: [0.0; 3],
        };
        for (key, node) in in_order(table) {
            match &**key.get_ref() {
                "mounting" => mounting = self.word(node, "mounting").map(|w| (w.to_owned(), node.span())),
                "name" => name = self.word(node, "name").map(|w| (w.to_owned(), node.span())),
                "shift" => block.shift_mm = self.three(node, "shift", LARGEST_SHIFT_MM),
                "tilt" => block.tilt_rad = self.three(node, "tilt", 360.0).map(rad_from_deg),
                "size_um" => block.size_mm = self.three(node, "size_um", LARGEST_NUMBER).map(mm_from_um),
                other => self.unknown_key(key.span(), "block", other, "mounting, name, shift, tilt, size_um"),
            }
        }
        let there_are = format!("{:?} has: {}", self.machine.name, blocks_of(self.machine));
        let (Some((mounting, mounting_at)), Some((name, name_at))) = (mounting, name) else {
            self.error(at, "scenario::which_block", "a block needs its mounting and its name", there_are);
            return;
        };
        match self.machine.mounting(&mounting) {
            None => {
                let message = format!("no mounting is called {mounting:?}");
                self.error(mounting_at, "scenario::mounting", message, there_are);
                return;
            }
            Some(m) if !m.blocks.iter().any(|b| b.name == name) => {
                let message = format!("mounting {mounting:?} has no block {name:?}");
                self.error(name_at.clone(), "scenario::block", message, there_are);
            }
            Some(_) => {}
        }
        if out.blocks.iter().any(|b| b.mounting == mounting && b.name == name) {
            let message = format!("block {name:?} of mounting {mounting:?} is displaced twice");
            self.error(name_at, "scenario::block_twice", message, "keep one of the two tables");
            return;
        }
        (block.mounting, block.name) = (mounting, name);
        out.blocks.push(block);
    }

    /// A hidden error motion of a rotary axis that no effect of the catalogue needs to know.
    fn harmonic(&mut self, out: &mut Scenario, table: &Table<'_>, at: Range<usize>) {
        const DOFS: [&str; 6] = ["dx", "dy", "dz", "rx", "ry", "rz"];
        let (mut axis, mut dof, mut k) = (None, None, 1.0);
        // cosine and sine, as displacement (mm) and as turn (rad)
        let (mut um, mut urad) = (None, None);
        for (key, node) in in_order(table) {
            let word = &**key.get_ref();
            match word {
                "axis" => {
                    let name = self.word(node, "axis").and_then(axis_named);
                    axis = name.filter(|&a| a.is_rotary() && self.machine.axis(a).is_some());
                    if axis.is_none() {
                        let message = format!("axis is no rotary axis of {:?}", self.machine.name);
                        self.error(
                            node.span(),
                            "scenario::axis",
                            message,
                            "write the letter of one, e.g. axis = \"C\"",
                        );
                    }
                }
                "dof" => {
                    dof = self.word(node, "dof").and_then(|w| DOFS.iter().position(|d| *d == w));
                    if dof.is_none() {
                        self.error(
                            node.span(),
                            "scenario::dof",
                            "dof is not known",
                            format!("there are: {}", DOFS.join(", ")),
                        );
                    }
                }
                "k" => k = self.not_negative(node, "k"),
                "cos_um" => um.get_or_insert((0.0, 0.0)).0 = mm_from_um(self.number(node, word).unwrap_or(0.0)),
                "sin_um" => um.get_or_insert((0.0, 0.0)).1 = mm_from_um(self.number(node, word).unwrap_or(0.0)),
                "cos_urad" => urad.get_or_insert((0.0, 0.0)).0 = ratio_from_ppm(self.number(node, word).unwrap_or(0.0)),
                "sin_urad" => urad.get_or_insert((0.0, 0.0)).1 = ratio_from_ppm(self.number(node, word).unwrap_or(0.0)),
                other => {
                    self.unknown_key(key.span(), "harmonic", other, "axis, dof, k, cos_um, sin_um, cos_urad, sin_urad");
                }
            }
        }
        let (Some(axis), Some(dof)) = (axis, dof) else {
            if !table.keys().any(|k| matches!(&**k.get_ref(), "axis" | "dof")) {
                self.error(
                    at,
                    "scenario::harmonic",
                    "a harmonic needs axis and dof",
                    "write axis = \"C\", dof = \"dx\"",
                );
            }
            return;
        };
        let (given, other, unit) = if dof < 3 { (um, urad, "um") } else { (urad, um, "urad") };
        if other.is_some() || given.is_none() {
            let message = format!("the size of a harmonic of {} stands in cos_{unit} and sin_{unit}", DOFS[dof]);
            self.error(at, "scenario::harmonic", message, format!("write cos_{unit} = 5.0"));
            return;
        }
        let (c, s) = given.unwrap_or_default();
        let target = Target::OwnLine { axis, after: false, dof };
        out.terms.push(Term { target, shape: Shape::Cosine(axis, k), amount: c });
        out.terms.push(Term { target, shape: Shape::Sine(axis, k), amount: s });
    }

    fn noise(&mut self, out: &mut Scenario, node: &Node<'_>) {
        let Some(table) = self.table(node, "noise") else { return };
        for (key, node) in in_order(table) {
            let word = &**key.get_ref();
            match word {
                "touch_um" => out.noise.touch_mm = mm_from_um(self.not_negative(node, word)),
                "visit_um" => out.noise.visit_mm = mm_from_um(self.not_negative(node, word)),
                "outlier_share" => {
                    let help = "it is the share of touches that are disturbed: 0.05 for 5 %";
                    out.noise.outlier_share = self.within(node, word, [0.0, 1.0], help).unwrap_or(0.0);
                }
                "outlier_um" => out.noise.outlier_mm = mm_from_um(self.not_negative(node, word)),
                "rounding_um" => out.noise.rounding_mm = mm_from_um(self.not_negative(node, word)),
                other => self.unknown_key(
                    key.span(),
                    "noise",
                    other,
                    "touch_um, visit_um, outlier_share, outlier_um, rounding_um",
                ),
            }
        }
    }

    fn time(&mut self, out: &mut Scenario, node: &Node<'_>) {
        let clock = "seconds on the clock that the whole study shares, from 0 on";
        let Some(table) = self.table(node, "time") else { return };
        for (key, node) in in_order(table) {
            let word = &**key.get_ref();
            match word {
                "started_s" => out.clock.started_s = self.within(node, word, CLOCK_S, clock).unwrap_or(0.0),
                "first_touch_s" => out.clock.first_touch_s = self.within(node, word, CLOCK_S, clock),
                other => self.unknown_key(key.span(), "time", other, "started_s, first_touch_s"),
            }
        }
    }

    /// `spindle = [[start_s, end_s, rpm], …]`
    fn spindle(&mut self, out: &mut Scenario, node: &Node<'_>) {
        let help = "write spindle = [[0, 1800, 12000], [3600, 5400, 8000]]: start and end in s on the study's clock, one after the other, and the speed";
        let rows: Vec<&Node<'_>> = node.get_ref().as_array().map_or_else(Vec::new, |a| a.iter().collect());
        if rows.is_empty() {
            self.error(node.span(), "scenario::spindle", "spindle holds no stretches", help);
        }
        for row in rows {
            let three = self.three(row, "a stretch of the spindle", LARGEST_NUMBER);
            let follows = out.spindle.last().is_none_or(|last| last[1] <= three[0]);
            if three[0] < three[1] && three[2] > 0.0 && follows {
                out.spindle.push(three);
            } else {
                self.error(row.span(), "scenario::spindle", "a stretch of the spindle is not usable", help);
            }
        }
    }

    fn temperature(&mut self, out: &mut Scenario, node: &Node<'_>) {
        let Some(table) = self.table(node, "temperature") else { return };
        for (key, node) in in_order(table) {
            match &**key.get_ref() {
                "constant_degC" => {
                    let degrees = self.within(node, "constant_degC", WEATHER_DEG_C, "degrees Celsius");
                    out.temperature.extend(degrees.map(|t| (0.0, t)));
                }
                "profile" => {
                    let points: Vec<&Node<'_>> =
                        node.get_ref().as_array().map_or_else(Vec::new, |a| a.iter().collect());
                    for point in points {
                        let pair: Vec<&Node<'_>> =
                            point.get_ref().as_array().map_or_else(Vec::new, |a| a.iter().collect());
                        let [hours, degrees] = pair[..] else {
                            self.error(
                                point.span(),
                                "scenario::profile",
                                "a point of the profile is no pair",
                                "write profile = [[0.0, 20.0], [2.0, 23.5]]: hours, °C",
                            );
                            continue;
                        };
                        let (Some(h), Some(t)) = (
                            self.within(hours, "hours", [-LARGEST_NUMBER, LARGEST_NUMBER], "hours"),
                            self.within(degrees, "temperature", WEATHER_DEG_C, "degrees Celsius"),
                        ) else {
                            continue;
                        };
                        if out.temperature.last().is_some_and(|last| h <= last.0) {
                            self.error(
                                hours.span(),
                                "scenario::profile",
                                "the profile runs back in time",
                                "sort it by hours",
                            );
                        }
                        out.temperature.push((h, t));
                    }
                    if out.temperature.is_empty() {
                        self.error(
                            node.span(),
                            "scenario::profile",
                            "the profile is empty",
                            "write profile = [[0.0, 20.0], [2.0, 23.5]]: hours, °C",
                        );
                    }
                }
                other => self.unknown_key(key.span(), "temperature", other, "constant_degC, profile"),
            }
        }
    }
}
