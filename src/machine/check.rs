//! From `machines.toml` as written to machines that can be relied on; all findings at once.

use super::as_written::{self as w, AxisKind};
use super::{Axis, Block, Carrier, Machine, Mounting, Reference, Shape, Side, Solid, Tool};
use crate::diag::{Finding, Findings, Result, Source, from_toml};
use crate::units::Plain;
use nalgebra::{Unit, Vector3};
use sha2::{Digest, Sha256};
use std::collections::BTreeMap;
use std::ops::Range;

const FORMAT: &str = "axiscal-machines/1";

/// No coordinate is larger than this (100 m, or deg): more is a slip of the pen.
const LARGEST: f64 = 1e5;

/// Two linear axes further off square than this are a slip of the pen, deg: real ones are off by some hundredths.
const LARGEST_SQUARENESS_DEG: f64 = 0.1;

/// Reads and checks a machines file.
///
/// # Errors
/// When the text is not TOML of this form or a machine cannot work; every finding has its place and remedy.
pub fn load(source: &Source) -> Result<(Vec<Machine>, Findings)> {
    let text = source.inner();
    let file: w::File = toml::from_str(text).map_err(|e| {
        from_toml(&e, source, "machine::not_toml")
            .help("`axiscal schema machines` prints the form; docs/guide/machines.md explains it")
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

struct Check<'a> {
    source: &'a Source,
    findings: Findings,
}

/// An axis whose own fields are good, its place in the chain not yet known.
struct Loose {
    axis: Axis,
    parent: String,
    span: Range<usize>,
}

impl Check<'_> {
    fn error(&mut self, span: &Range<usize>, code: &'static str, message: impl Into<String>, help: impl Into<String>) {
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
        if workpiece.is_some() && tool.is_some() && m.axis.len() == loose.len() {
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
        self.probe(name, &probe.0);
        let Some(reference) = m.reference else {
            self.error(
                &here,
                "machine::no_reference",
                format!("{name:?} has no [machine.reference]"),
                "say where location errors are stated: pivot, ball and table",
            );
            return None;
        };
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
        let solids = m.solid.iter().filter_map(|s| self.solid(name, s, &carriers)).collect();
        let mountings: Vec<Mounting> = m.mounting.iter().filter_map(|x| self.mounting(name, x, &carriers)).collect();
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
        if p.stem_length + p.body_length > tool.length_mm {
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
        // identical for identical contents: the debug form of the record, not the bytes with their comments
        let sha256 = format!(
            "{:x}",
            HexDigest(
                Sha256::digest(
                    format!("{:?}{:?}{:?}{:?}{:?}{:?}", axes, tool, p, mountings, reference, m.origin).as_bytes()
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
            solids,
            mountings,
            sha256,
        })
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
            Some(d) => self.direction(&d.span(), &format!("direction of axis {name}"), *d.get_ref()),
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
        let repeatability = a.indexing_repeatability_um.as_ref().map_or(0.0, |r| *r.get_ref());
        if !(repeatability.is_finite() && repeatability >= 0.0) {
            self.error(
                &span,
                "machine::repeatability",
                format!("indexing repeatability of axis {name} is {} um", Plain(repeatability)),
                "it is a standard deviation: 0 or more",
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
                indexing_repeatability_mm: crate::units::mm_from_um(repeatability),
            },
            parent: parent?,
            span,
        })
    }

    /// From an end (workpiece or tool) down to the base; the answer begins at the base.
    fn chain(
        &mut self,
        machine: &str,
        loose: &[Loose],
        refused: &[String],
        end: &toml::Spanned<String>,
        side: Side,
    ) -> Vec<Axis> {
        let mut out: Vec<Axis> = Vec::new();
        let (mut word, mut span) = (end.get_ref().clone(), end.span());
        while word != "base" {
            if refused.contains(&word) {
                break;
            }
            let Some(found) = loose.iter().find(|l| l.axis.name.to_string() == word) else {
                self.error(
                    &span,
                    "machine::unknown_parent",
                    format!("parent {word:?} is no axis of {machine:?}"),
                    "a parent is \"base\" or the letter of an axis of this machine",
                );
                break;
            };
            if out.iter().any(|a| a.name == found.axis.name) {
                self.error(
                    &found.span,
                    "machine::cyclic",
                    format!("axis {word} of {machine:?} bears itself: the chain is cyclic"),
                    "follow the parents: one of them must be \"base\"",
                );
                break;
            }
            out.push(Axis { side, ..found.axis.clone() });
            (word, span) = (found.parent.clone(), found.span.clone());
        }
        out.reverse();
        out
    }

    fn linear_axes_span_space(&mut self, here: &Range<usize>, machine: &str, axes: &[Axis]) {
        let linear: Vec<_> = axes.iter().filter(|a| !a.name.is_rotary()).map(|a| a.direction.into_inner()).collect();
        let spans = linear.len() == 3 && nalgebra::Matrix3::from_columns(&linear).determinant().abs() > 0.1;
        if !spans {
            let names: Vec<String> = axes.iter().filter(|a| !a.name.is_rotary()).map(|a| a.name.to_string()).collect();
            self.error(
                here,
                "machine::linear_axes",
                format!("the linear axes of {machine:?} in the chain ({}) do not span space", names.join(" ")),
                "X, Y and Z must be there, roughly square to each other",
            );
        }
    }

    /// Every pair of linear axes, in the order of their letters.
    fn linear_axes_square(&mut self, machine: &str, loose: &[Loose]) {
        for (i, a) in loose.iter().enumerate().filter(|(_, a)| !a.axis.name.is_rotary()) {
            for b in loose[..i].iter().filter(|b| !b.axis.name.is_rotary() && b.axis.name != a.axis.name) {
                let off = crate::units::deg_from_rad(a.axis.direction.dot(&b.axis.direction).clamp(-1.0, 1.0).asin());
                if off.abs() > LARGEST_SQUARENESS_DEG {
                    self.findings.push(
                        Finding::warning(
                            "machine::not_square",
                            format!(
                                "axes {} and {} of {machine:?} are {:.3} degrees off square",
                                b.axis.name,
                                a.axis.name,
                                off.abs()
                            ),
                        )
                        .help(
                            "write the axes as they are meant to be, square to each other: that they are not quite is \
                             an error to be identified, not a part of the description",
                        )
                        .at(self.source, a.span.clone()),
                    );
                }
            }
        }
    }

    fn finite3(&mut self, span: &Range<usize>, what: &str, v: [f64; 3]) -> Option<Vector3<f64>> {
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

    fn direction(&mut self, span: &Range<usize>, what: &str, v: [f64; 3]) -> Option<Unit<Vector3<f64>>> {
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

    fn tool(&mut self, machine: &str, t: &w::Tool) -> Option<Tool> {
        let direction = self.direction(&t.direction.span(), "direction of the tool", *t.direction.get_ref());
        let pivot = self.finite3(&t.parent.span(), "pivot of the tool", t.pivot);
        let length = *t.length.get_ref();
        if !(length.is_finite() && length > 0.0) {
            self.error(
                &t.length.span(),
                "machine::tool_length",
                format!("tool length of {machine:?} is {} mm", Plain(length)),
                "from the pivot to the ball's centre, more than 0",
            );
        }
        if t.spindle_sense.abs() != 1 {
            self.error(
                &t.parent.span(),
                "machine::sense",
                format!("spindle_sense is {}, expected 1 or -1", t.spindle_sense),
                "1: M19 counts right-handed about direction",
            );
        }
        Some(Tool { pivot: pivot?, direction: direction?, length_mm: length, spindle_sense: t.spindle_sense as f64 })
    }

    fn probe(&mut self, machine: &str, probe: &toml::Spanned<w::Probe>) {
        let p = probe.get_ref();
        let positive = [
            ("ball_radius", p.ball_radius),
            ("stem_radius", p.stem_radius),
            ("stem_length", p.stem_length),
            ("body_radius", p.body_radius),
            ("body_length", p.body_length),
            ("head_radius", p.head_radius),
            ("repeatability_um", p.repeatability_um),
            ("overtravel", p.overtravel),
            ("approach", p.approach),
            ("search", p.search),
            ("clearance", p.clearance),
            ("placement_tolerance", p.placement_tolerance),
            ("fast_feed", p.fast_feed),
            ("slow_feed", p.slow_feed),
            ("position_feed", p.position_feed),
            ("back_off", p.back_off),
        ];
        for (field, value) in positive {
            if !(value.is_finite() && value > 0.0) {
                self.error(
                    &probe.span(),
                    "machine::probe",
                    format!("{field} of the probe of {machine:?} is {}", Plain(value)),
                    "write a number greater than 0",
                );
            }
        }
        if p.stem_radius >= p.ball_radius {
            self.error(
                &probe.span(),
                "machine::probe",
                format!(
                    "the stem of {machine:?} (radius {} mm) is not thinner than the ball ({} mm)",
                    Plain(p.stem_radius),
                    Plain(p.ball_radius)
                ),
                "check the two radii: the ball must touch first",
            );
        }
        if p.search > p.overtravel {
            self.error(
                &probe.span(),
                "machine::overtravel",
                format!(
                    "a search ends {} mm past the nominal contact, the probe of {machine:?} can be pushed {} mm",
                    Plain(p.search),
                    Plain(p.overtravel)
                ),
                "lower search, or correct overtravel from the probe's data sheet",
            );
        }
        if p.placement_tolerance > p.approach.min(p.search) {
            self.error(
                &probe.span(),
                "machine::placement_tolerance",
                format!(
                    "placement tolerance {} mm of {machine:?} is larger than approach or search",
                    Plain(p.placement_tolerance)
                ),
                "a block within the tolerance must be met by the search",
            );
        }
        if p.back_off >= p.approach {
            self.error(
                &probe.span(),
                "machine::back_off",
                format!(
                    "back_off {} mm of {machine:?} is not less than approach {} mm",
                    Plain(p.back_off),
                    Plain(p.approach)
                ),
                "the ball must stay within the cleared approach",
            );
        }
        if p.slow_feed > p.fast_feed {
            self.error(
                &probe.span(),
                "machine::feed",
                format!("slow_feed {} is above fast_feed {}", Plain(p.slow_feed), Plain(p.fast_feed)),
                "swap the two feeds",
            );
        }
    }

    fn solid(&mut self, machine: &str, s: &w::Solid, carriers: &Carriers) -> Option<Solid> {
        let name = s.name.get_ref();
        let carrier = self.carrier(machine, name, &s.carrier, carriers);
        let shape = match (s.cuboid, s.cylinder) {
            (Some(b), None)
                if b.size.iter().all(|x| *x <= LARGEST && *x > 0.0) && b.centre.iter().all(|x| x.abs() <= LARGEST) =>
            {
                Some(Shape::Box { centre: b.centre.into(), size: b.size.into() })
            }
            (None, Some(c))
                if c.radius > 0.0
                    && c.height > 0.0
                    && c.radius <= LARGEST
                    && c.height <= LARGEST
                    && c.foot.iter().all(|x| x.abs() <= LARGEST) =>
            {
                self.direction(&s.name.span(), "direction of the cylinder", c.direction).map(|direction| {
                    Shape::Cylinder { foot: c.foot.into(), direction, radius: c.radius, height: c.height }
                })
            }
            _ => {
                self.error(
                    &s.name.span(),
                    "machine::shape",
                    format!("solid {name:?} of {machine:?} has no usable shape"),
                    format!(
                        "give either box = {{ centre, size }} or cylinder = {{ foot, direction, radius, height }}, \
                         with positive sizes and no number above {LARGEST} mm"
                    ),
                );
                None
            }
        };
        Some(Solid { name: name.clone(), carrier: carrier?, shape: shape? })
    }

    fn carrier(
        &mut self,
        machine: &str,
        what: &str,
        word: &toml::Spanned<String>,
        carriers: &Carriers,
    ) -> Option<Carrier> {
        let found = (carriers.of)(word.get_ref());
        if found.is_none() && !carriers.cut {
            self.error(
                &word.span(),
                "machine::carrier",
                format!(
                    "{what:?} of {machine:?} is carried by {:?}, which is no part of the workpiece side",
                    word.get_ref()
                ),
                "write \"base\", \"table\" or the letter of an axis on the workpiece side",
            );
        }
        found
    }

    fn mounting(&mut self, machine: &str, x: &w::Mounting, carriers: &Carriers) -> Option<Mounting> {
        let name = x.name.get_ref();
        if x.carrier.get_ref() == "base" {
            self.error(
                &x.carrier.span(),
                "machine::block_carrier",
                format!("mounting {name:?} of {machine:?} is carried by \"base\", which bears solids but no blocks"),
                "write \"table\": on a machine without a linear axis on the workpiece side that is what stands on the \
                 base",
            );
            return None;
        }
        let carrier = self.carrier(machine, name, &x.carrier, carriers)?;
        let mut solids: Vec<Solid> = x.solid.iter().filter_map(|s| self.solid(machine, s, carriers)).collect();
        let mut blocks: Vec<Block> = Vec::new();
        for b in &x.block {
            let block = b.name.get_ref();
            if blocks.iter().any(|o| &o.name == block) {
                self.error(
                    &b.name.span(),
                    "machine::block_twice",
                    format!("block {block:?} stands twice in mounting {name:?}"),
                    "give each block a name of its own",
                );
            }
            let centre = self.finite3(&b.centre.span(), &format!("centre of block {block:?}"), *b.centre.get_ref())?;
            let size = *b.size.get_ref();
            if !size.iter().all(|s| *s <= LARGEST && *s > 0.0) {
                self.error(
                    &b.size.span(),
                    "machine::block_size",
                    format!("size of block {block:?} is {size:?}"),
                    format!("write three edges in mm, more than 0 and up to {LARGEST}"),
                );
                continue;
            }
            let size = Vector3::from(size);
            // blocks may touch, not stand in each other
            let within = |o: &Block| ((o.size + size) / 2.0 - (o.centre - centre).abs()).min();
            if let Some(other) = blocks.iter().find(|o| within(o) > 1e-6) {
                self.error(
                    &b.centre.span(),
                    "machine::blocks_overlap",
                    format!(
                        "blocks {:?} and {block:?} of mounting {name:?} stand {:.3} mm in each other",
                        other.name,
                        within(other)
                    ),
                    "check the two centres and sizes",
                );
            }
            let riser = b.riser.or(x.riser);
            if let Some(r) = riser {
                if !(r.height > 0.0 && r.height <= LARGEST && r.size.iter().all(|s| *s > 0.0 && *s <= LARGEST)) {
                    self.error(
                        &b.name.span(),
                        "machine::riser",
                        format!("riser of block {block:?} has no usable size"),
                        format!("write height and size in mm, more than 0 and up to {LARGEST}"),
                    );
                }
                let mut under = centre;
                under.z -= size[2] / 2.0 + r.height / 2.0;
                solids.push(Solid {
                    name: format!("riser of {block}"),
                    carrier,
                    shape: Shape::Box { centre: under, size: Vector3::new(r.size[0], r.size[1], r.height) },
                });
            }
            blocks.push(Block { name: block.clone(), centre, size, riser });
        }
        if blocks.is_empty() {
            self.error(
                &x.name.span(),
                "machine::no_block",
                format!("mounting {name:?} of {machine:?} has no block"),
                "add [[machine.mounting.block]] tables",
            );
        }
        Some(Mounting { name: name.clone(), says: x.says.clone(), carrier, blocks, solids })
    }
}

/// What can bear a solid or a mounting.
struct Carriers<'a> {
    of: &'a dyn Fn(&str) -> Option<Carrier>,
    /// An axis was refused, so the chain may lack axes that the file has: a missing carrier is not worth saying.
    cut: bool,
}

struct HexDigest(Vec<u8>);

impl std::fmt::LowerHex for HexDigest {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        self.0.iter().try_for_each(|b| write!(f, "{b:02x}"))
    }
}

#[cfg(test)]
mod tests {
    use crate::axes::AxisName;
    use crate::diag::source;

    #[test]
    fn the_built_in_machines_are_good() {
        let (machines, findings) = super::load(&source("machines.toml", crate::machine::BUILT_IN)).unwrap();
        assert_eq!(machines.len(), 4);
        assert!(findings.0.is_empty());
    }

    #[test]
    fn a_range_is_written_in_machine_coordinates_and_kept_relative_to_r() {
        let text = crate::machine::BUILT_IN.replacen("origin = { X = 0.0", "origin = { X = 100.0", 1);
        let (machines, _) = super::load(&source("machines.toml", text)).unwrap();
        assert_eq!(machines[0].axis(AxisName::X).unwrap().range, [-550.0, 350.0]);
    }

    /// Codes of what is wrong with the built-in machines when `from` is written as `to`, once.
    fn codes(from: &str, to: &str) -> Vec<&'static str> {
        let text = crate::machine::BUILT_IN.replacen(from, to, 1);
        assert_ne!(text, crate::machine::BUILT_IN, "{from}");
        match super::load(&source("m.toml", text)) {
            Ok((_, findings)) => findings.0.iter().map(|f| f.code).collect(),
            Err(failure) => failure.0.iter().map(|f| f.code).collect(),
        }
    }

    #[test]
    fn one_slip_is_one_finding() {
        let range = "range = [-450.0, 450.0]";
        let cases = [
            (range, "range = [-1e300, 1e300]", "machine::too_large"),
            (range, "range = [450.0, -450.0]", "machine::range"),
            ("direction = [1.0, 0.0, 0.0]", "direction = [0.0, 0.0, 0.0]", "machine::zero_direction"),
            ("direction = [1.0, 0.0, 0.0]", "direction = [1.0, 0.005, 0.0]", "machine::not_square"),
            ("origin = { X = 0.0", "origin = { X = 1e7", "machine::too_large"),
            ("pivot = [0.0, 0.0, 0.0]", "pivot = [1e7, 0.0, 0.0]", "machine::too_large"),
            ("carrier = \"table\"\nriser", "carrier = \"base\"\nriser", "machine::block_carrier"),
        ];
        for (from, to, code) in cases {
            assert_eq!(codes(from, to), [code], "{to}");
        }
    }

    #[test]
    fn a_direction_a_little_off_square_is_left_alone() {
        assert_eq!(codes("direction = [1.0, 0.0, 0.0]", "direction = [1.0, 0.001, 0.0]"), [] as [&str; 0]);
    }

    #[test]
    fn blocks_may_touch_but_not_overlap() {
        let block = |x: f64| {
            format!(
                "[[machine.mounting.block]]\nname = \"more\"\ncentre = [{x:?}, 0.0, 900.0]\nsize = [10.0, 10.0, 10.0]\n"
            )
        };
        let at = "[[machine.mounting.block]]";
        let two = |gap: f64| format!("{}{}{at}", block(0.0), block(gap).replace("more", "less"));
        assert_eq!(codes(at, &two(9.0)), ["machine::blocks_overlap"]);
        assert_eq!(codes(at, &two(10.0)), [] as [&str; 0]);
    }

    #[test]
    fn numbers_of_another_world_are_said_shortly() {
        let text = crate::machine::BUILT_IN.replacen("range = [-450.0, 450.0]", "range = [-1e300, 1e300]", 1);
        let failure = super::load(&source("m.toml", text)).unwrap_err();
        assert!(failure.to_string().ends_with("range of axis X is [-1e300, 1e300]"), "{failure}");
    }
}
