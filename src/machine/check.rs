//! From `machines.toml` as written to machines that can be relied on; all findings at once.

mod chain;

use super::as_written::{self as w, AxisKind};
use super::check_parts::Carriers;
use super::{Axis, Carrier, Machine, Mounting, Reference, Side, Solid};
use crate::axes::AxisName;
use crate::diag::{Finding, Findings, Result, Source};
use crate::keys::not_of_form;
use crate::units::Plain;
use nalgebra::{Unit, Vector3};
use sha2::{Digest, Sha256};
use std::collections::BTreeMap;
use std::ops::Range;

const FORMAT: &str = "axiscal-machines/1";

/// No coordinate is larger than this (100 m, or deg): more is a slip of the pen.
pub(super) const LARGEST: f64 = 1e5;

/// Two linear axes further off square than this are a slip of the pen, deg: real ones are off by some hundredths.
pub(super) const LARGEST_SQUARENESS_DEG: f64 = 0.1;

/// Scatter of the ball's position per index where a rotary axis states none, µm, 1 sigma: what the built-in machines have.
/// With 0 every uncertainty would be too small.
const ASSUMED_INDEXING_UM: f64 = 0.5;

/// No scatter is larger than this, µm: more is a slip of the pen.
pub(super) const LARGEST_SCATTER_UM: f64 = 1000.0;

/// Reads and checks a machines file.
///
/// # Errors
/// When the text is not TOML of this form or a machine cannot work; every finding has its place and remedy.
pub fn load(source: &Source) -> Result<(Vec<Machine>, Findings)> {
    let text = source.inner();
    let file: w::File = toml::from_str(text).map_err(|e| {
        let help = "`axiscal schema machines` prints the form; docs/guide/machines.md explains it";
        not_of_form::<w::File>(&e, source, "machine::not_toml", help)
    })?;
    let mut check = Check { source, findings: Findings::default() };
    if file.format.get_ref() != FORMAT {
        check.error(
            &file.format.span(),
            "machine::format",
            format!("format is {:?}, expected {FORMAT:?}", file.format.get_ref()),
            "write the format line of this version",
        );
    }
    if file.machine.is_empty() {
        check.error(&(0..0), "machine::none", "no machine in the file", "add a [[machine]] table");
    }
    let mut seen = BTreeMap::new();
    let mut machines = Vec::new();
    for written in &file.machine {
        if seen.insert(written.name.get_ref().clone(), ()).is_some() {
            check.error(
                &written.name.span(),
                "machine::twice",
                format!("machine {:?} stands twice", written.name.get_ref()),
                "give each machine a name of its own",
            );
        }
        if let Some(machine) = check.machine(written) {
            machines.push(machine);
        }
    }
    check.findings.finish(machines)
}

pub(super) struct Check<'a> {
    pub(super) source: &'a Source,
    pub(super) findings: Findings,
}

/// An axis whose own fields are good, its place in the chain not yet known.
struct Loose {
    axis: Axis,
    parent: String,
    span: Range<usize>,
}

impl Check<'_> {
    pub(super) fn error(
        &mut self,
        span: &Range<usize>,
        code: &'static str,
        message: impl Into<String>,
        help: impl Into<String>,
    ) {
        self.findings.push(Finding::error(code, message).help(help).at(self.source, span.clone()));
    }

    fn machine(&mut self, m: &w::Machine) -> Option<Machine> {
        let before = self.findings.0.len();
        let name = m.name.get_ref();
        let here = m.name.span();
        let loose: Vec<Loose> = m.axis.iter().filter_map(|a| self.axis(name, a)).collect();
        // an axis that was refused has said why: what names it says nothing more
        let refused: Vec<String> = m
            .axis
            .iter()
            .map(|a| a.name.get_ref().to_string())
            .filter(|letter| !loose.iter().any(|l| &l.axis.name.to_string() == letter))
            .collect();
        for (i, a) in loose.iter().enumerate() {
            if loose[..i].iter().any(|b| b.axis.name == a.axis.name) {
                self.error(
                    &a.span,
                    "machine::axis_twice",
                    format!("axis {} stands twice in {name:?}", a.axis.name),
                    "each letter names one axis",
                );
            }
        }
        let workpiece = self.exactly_one(&here, name, "workpiece", m.workpiece.all());
        let tool = self.exactly_one(&here, name, "tool", m.tool.all());
        let before_the_chain = self.findings.0.len();
        let mut axes = Vec::new();
        if let Some(workpiece) = workpiece {
            axes.extend(self.chain(name, &loose, &refused, &workpiece.parent, Side::Workpiece));
        }
        if let Some(tool) = tool {
            let tool_side = self.chain(name, &loose, &refused, &tool.parent, Side::Tool);
            for a in &tool_side {
                if axes.iter().any(|b: &Axis| b.name == a.name) {
                    self.error(
                        &here,
                        "machine::shared_axis",
                        format!("axis {} of {name:?} bears both workpiece and tool", a.name),
                        "an axis stands on one side only: check the parents",
                    );
                }
            }
            axes.extend(tool_side);
        }
        // a chain that breaks off lacks axes for that reason alone
        let is_whole = self.findings.0.len() == before_the_chain;
        if is_whole && workpiece.is_some() && tool.is_some() && m.axis.len() == loose.len() {
            for a in &loose {
                if !axes.iter().any(|b| b.name == a.axis.name) {
                    self.error(
                        &a.span,
                        "machine::idle_axis",
                        format!("axis {} of {name:?} bears neither workpiece nor tool", a.axis.name),
                        "name it as the parent of an axis, of the workpiece or of the tool, or take it out",
                    );
                }
            }
            self.linear_axes_span_space(&here, name, &axes);
            self.linear_axes_square(name, &loose);
            self.linear_axes_follow_r(&here, name, &axes);
            let n_rotary = axes.iter().filter(|a| a.name.is_rotary()).count();
            if n_rotary == 0 || n_rotary > 2 {
                self.error(
                    &here,
                    "machine::rotary_count",
                    format!("{name:?} has {n_rotary} rotary axes in its chain"),
                    "a five-axis machine has two (one is allowed)",
                );
            }
        }
        for (axis, value) in m.origin.iter() {
            if value.is_nan() || value.abs() > LARGEST {
                self.error(
                    &here,
                    "machine::too_large",
                    format!("origin of axis {axis} of {name:?} is {}", Plain(value)),
                    format!("write mm or deg, up to {LARGEST}"),
                );
            }
            if !axes.iter().any(|a| a.name == axis) && self.findings.0.len() == before {
                self.error(
                    &here,
                    "machine::origin",
                    format!("origin of {name:?} names axis {axis}, which the machine lacks"),
                    "take it out",
                );
            }
        }
        // written as the control displays it; everything else counts from the origin of R
        for axis in &mut axes {
            let origin = m.origin.get(axis.name).unwrap_or(0.0);
            axis.range = axis.range.map(|end| end - origin);
        }
        let Some(probe) = &m.probe else {
            self.error(
                &here,
                "machine::no_probe",
                format!("{name:?} has no probe"),
                "add a [machine.probe] table: it decides which moves are safe",
            );
            return None;
        };
        let probe_is_good = self.probe(name, &probe.0);
        let styli = if probe_is_good { self.styli(name, &m.stylus, probe.0.get_ref()) } else { Vec::new() };
        let Some(reference) = m.reference else {
            self.error(
                &here,
                "machine::no_reference",
                format!("{name:?} has no [machine.reference]"),
                "say where location errors are stated: pivot, ball and table",
            );
            return None;
        };
        for (field, point) in [("pivot", reference.pivot), ("ball", reference.ball), ("table", reference.table)] {
            self.finite3(&here, &format!("{field} of the reference of {name:?}"), point);
        }
        let tool = self.tool(name, tool?)?;
        let carriers = |word: &str| -> Option<Carrier> {
            match word {
                "base" => Some(Carrier::Base),
                "table" => Some(Carrier::Table),
                _ => axes
                    .iter()
                    .find(|a| a.side == Side::Workpiece && a.name.to_string() == word)
                    .map(|a| Carrier::Axis(a.name)),
            }
        };
        let carriers = Carriers { of: &carriers, cut: !refused.is_empty() };
        let solids: Vec<Solid> = m.solid.iter().filter_map(|s| self.solid(name, s, &carriers)).collect();
        let mountings: Vec<Mounting> =
            m.mounting.iter().filter_map(|x| self.mounting(name, x, &solids, &carriers)).collect();
        for (i, x) in m.mounting.iter().enumerate() {
            if m.mounting[..i].iter().any(|y| y.name.get_ref() == x.name.get_ref()) {
                self.error(
                    &x.name.span(),
                    "machine::mounting_twice",
                    format!("mounting {:?} stands twice in {name:?}", x.name.get_ref()),
                    "give each mounting a name of its own",
                );
            }
        }
        // the probe must fit between ball and pivot, else the collision check looks at nothing
        let p = probe.0.get_ref();
        if probe_is_good && tool.length_mm > 0.0 && p.stem_length + p.body_length > tool.length_mm {
            self.error(
                &probe.0.span(),
                "machine::probe_too_long",
                format!(
                    "stem {} mm and body {} mm are longer than the tool length {} mm",
                    Plain(p.stem_length),
                    Plain(p.body_length),
                    Plain(tool.length_mm)
                ),
                "tool.length is measured from the pivot to the ball's centre",
            );
        }
        if self.findings.0[before..].iter().any(|f| f.severity == crate::diag::Severity::Error) {
            return None;
        }
        let rotary = |a: &&w::Axis| a.name.get_ref().is_rotary() && a.indexing_repeatability_um.is_none();
        let assumed_indexing: Vec<AxisName> = m.axis.iter().filter(rotary).map(|a| *a.name.get_ref()).collect();
        if !assumed_indexing.is_empty() {
            let letters: Vec<String> = assumed_indexing.iter().map(ToString::to_string).collect();
            let says = format!(
                "{name:?} has no indexing_repeatability_um for {}: {ASSUMED_INDEXING_UM} um is assumed",
                letters.join(" and ")
            );
            self.findings.push(
                Finding::info("machine::assumed_indexing", says)
                    .help("write how well the axis comes back to a position (1 sigma, from the maker's sheet), or 0")
                    .at(self.source, here.clone()),
            );
        }
        self.assumed_sense(&here, name, &m.axis);
        // identical for identical contents: the debug form of the record, not the bytes with their comments
        let sha256 = format!(
            "{:x}",
            HexDigest(
                Sha256::digest(
                    format!("{axes:?}{tool:?}{p:?}{styli:?}{mountings:?}{reference:?}{:?}", m.origin).as_bytes()
                )
                .to_vec()
            )
        );
        Some(Machine {
            name: name.clone(),
            says: m.says.clone(),
            origin: m.origin,
            axes,
            tool,
            reference: Reference {
                pivot: reference.pivot.into(),
                ball: reference.ball.into(),
                table: reference.table.into(),
            },
            probe: *p,
            styli,
            solids,
            mountings,
            assumed_indexing,
            sha256,
        })
    }

    /// Says of which rotary axes the direction of rotation is not written: +1 is taken.
    fn assumed_sense(&mut self, here: &Range<usize>, machine: &str, axes: &[w::Axis]) {
        let unwritten = axes.iter().filter(|a| a.name.get_ref().is_rotary() && a.sense.is_none());
        let letters: Vec<String> = unwritten.map(|a| a.name.get_ref().to_string()).collect();
        if letters.is_empty() {
            return;
        }
        let says = format!("sense of {} of {machine:?} is +1, since the file does not say it", letters.join(" and "));
        self.findings.push(
            Finding::info("machine::assumed_sense", says)
                .help("check the sign at the machine, then write sense = 1 or sense = -1 (docs/guide/machines.md)")
                .at(self.source, here.clone()),
        );
    }

    fn exactly_one<'m, T>(
        &mut self,
        here: &Range<usize>,
        machine: &str,
        what: &'static str,
        all: &'m [T],
    ) -> Option<&'m T> {
        match all {
            [one] => Some(one),
            [] => {
                self.error(
                    here,
                    "machine::missing_end",
                    format!("{machine:?} has no {what}"),
                    format!("add a [machine.{what}] table with its parent"),
                );
                None
            }
            several => {
                self.error(
                    here,
                    "machine::two_ends",
                    format!("{machine:?} has {} {what}s, expected one", several.len()),
                    "a chain has one workpiece and one tool: describe a second spindle as a machine of its own",
                );
                None
            }
        }
    }

    fn axis(&mut self, machine: &str, a: &w::Axis) -> Option<Loose> {
        let name = *a.name.get_ref();
        let span = a.name.span();
        let expected = if name.is_rotary() { AxisKind::Rotary } else { AxisKind::Linear };
        match a.kind {
            None => self.error(
                &span,
                "machine::no_kind",
                format!("axis {name} of {machine:?} has no kind"),
                "write kind = \"linear\" or \"rotary\"",
            ),
            Some(kind) if kind != expected => self.error(
                &span,
                "machine::kind",
                format!("axis {name} of {machine:?} is {kind:?}, but X Y Z are linear and A B C rotary"),
                "name axes by ISO 841",
            ),
            Some(_) => {}
        }
        let parent = a.parent.as_ref().map(|p| p.get_ref().clone());
        if parent.is_none() {
            self.error(
                &span,
                "machine::no_parent",
                format!("axis {name} of {machine:?} has no parent"),
                "write parent = \"base\" or the letter of the axis that bears it",
            );
        }
        let direction = match &a.direction {
            None => {
                self.error(
                    &span,
                    "machine::no_direction",
                    format!("axis {name} of {machine:?} has no direction"),
                    "write direction = [x, y, z] in frame R",
                );
                None
            }
            Some(d) => {
                let direction = self.direction(&d.span(), &format!("direction of axis {name}"), *d.get_ref());
                self.letter_of_rotary(&d.span(), name, direction.as_ref());
                direction
            }
        };
        let point = match (&a.point, name.is_rotary()) {
            (Some(p), true) => self.finite3(&p.span(), &format!("point of axis {name}"), *p.get_ref()),
            (None, true) => {
                self.error(
                    &span,
                    "machine::no_point",
                    format!("rotary axis {name} of {machine:?} has no point"),
                    "write point = [x, y, z]: any point on the axis, in R at zero",
                );
                None
            }
            (Some(p), false) => {
                self.findings.push(
                    Finding::warning("machine::unused", format!("point of linear axis {name} has no meaning"))
                        .help("take it out")
                        .at(self.source, p.span()),
                );
                Some(Vector3::zeros())
            }
            (None, false) => Some(Vector3::zeros()),
        };
        let sense = match &a.sense {
            None => 1.0,
            Some(s) if s.get_ref().abs() == 1 => *s.get_ref() as f64,
            Some(s) => {
                self.error(
                    &s.span(),
                    "machine::sense",
                    format!("sense of axis {name} is {}, expected 1 or -1", s.get_ref()),
                    "1: a positive angle turns what it carries right-handed about direction",
                );
                1.0
            }
        };
        if sense < 0.0 && !name.is_rotary() {
            self.error(
                &span,
                "machine::sense",
                format!("linear axis {name} has a sense"),
                "turn its direction instead",
            );
        }
        let range = match &a.range {
            None => {
                self.error(
                    &span,
                    "machine::no_range",
                    format!("axis {name} of {machine:?} has no range"),
                    "write range = [lowest, highest]: no move can be proven safe without it",
                );
                None
            }
            Some(r) => {
                let [low, high] = *r.get_ref();
                if low.abs() <= LARGEST && high.abs() <= LARGEST && low < high {
                    Some([low, high])
                } else if low < high {
                    self.error(
                        &r.span(),
                        "machine::too_large",
                        format!("range of axis {name} is [{}, {}]", Plain(low), Plain(high)),
                        format!(
                            "write how far the axis goes, at most {LARGEST} mm or deg; an endless axis: [-9999, 9999]"
                        ),
                    );
                    None
                } else {
                    self.error(
                        &r.span(),
                        "machine::range",
                        format!(
                            "range of axis {name} is [{}, {}], expected lowest before highest",
                            Plain(low),
                            Plain(high)
                        ),
                        "swap the two numbers",
                    );
                    None
                }
            }
        };
        let repeatability = a.indexing_repeatability_um.as_ref();
        let repeatability_um =
            repeatability.map_or(if name.is_rotary() { ASSUMED_INDEXING_UM } else { 0.0 }, |r| *r.get_ref());
        if !(0.0..=LARGEST_SCATTER_UM).contains(&repeatability_um) {
            self.error(
                &repeatability.map_or(span.clone(), toml::Spanned::span),
                "machine::repeatability",
                format!("indexing repeatability of axis {name} is {} um", Plain(repeatability_um)),
                format!("it is a standard deviation: 0 or more, up to {LARGEST_SCATTER_UM} um"),
            );
        }
        Some(Loose {
            axis: Axis {
                name,
                side: Side::Tool,
                direction: direction?,
                point: point?,
                sense,
                range: range?,
                indexing_repeatability_mm: crate::units::mm_from_um(repeatability_um),
            },
            parent: parent?,
            span,
        })
    }

    pub(super) fn finite3(&mut self, span: &Range<usize>, what: &str, v: [f64; 3]) -> Option<Vector3<f64>> {
        if !v.iter().all(|x| x.is_finite()) {
            self.error(span, "machine::not_finite", format!("{what} is {v:?}"), "write three finite numbers");
            return None;
        }
        if v.iter().any(|x| x.abs() > LARGEST) {
            self.error(
                span,
                "machine::too_large",
                format!("{what} is {v:?}"),
                format!("write millimetres in R, up to {LARGEST}"),
            );
            return None;
        }
        Some(v.into())
    }

    /// The location errors of a rotary axis are chosen by its letter, square to X, Y or Z: an axis that is square to its letter's
    /// direction would have the wrong ones.
    fn letter_of_rotary(&mut self, span: &Range<usize>, name: AxisName, direction: Option<&Unit<Vector3<f64>>>) {
        /// Cosine of 60 degrees: an axis at 45 degrees may have either of two letters.
        const LEAST_COSINE: f64 = 0.5;
        let Some(direction) = direction.filter(|_| name.is_rotary()) else { return };
        let (own, letters) = (name.index() % 3, ["A", "B", "C"]);
        if direction[own].abs() < LEAST_COSINE {
            let fits: Vec<&str> = (0..3).filter(|k| direction[*k].abs() >= LEAST_COSINE).map(|k| letters[k]).collect();
            self.error(
                span,
                "machine::letter",
                format!(
                    "axis {name} is more than 60 degrees off {}. Its errors are named by its letter and would get wrong names",
                    ["X", "Y", "Z"][own]
                ),
                format!("correct the direction, or name the axis {} (ISO 841)", fits.join(" or ")),
            );
        }
    }

    pub(super) fn direction(&mut self, span: &Range<usize>, what: &str, v: [f64; 3]) -> Option<Unit<Vector3<f64>>> {
        let v = self.finite3(span, what, v)?;
        let unit = Unit::try_new(v, 1e-9);
        if unit.is_none() {
            self.error(
                span,
                "machine::zero_direction",
                format!("{what} is zero"),
                "write a direction such as [0, 0, 1]",
            );
        }
        unit
    }
}

struct HexDigest(Vec<u8>);

impl std::fmt::LowerHex for HexDigest {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        self.0.iter().try_for_each(|b| write!(f, "{b:02x}"))
    }
}

#[cfg(test)]
mod tests;
