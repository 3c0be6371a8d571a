//! Files that a control reads → what it then applies, by what its manual says that they mean.
//!
//! Shares nothing with the code that writes them. SINUMERIK: IM9 Commissioning Manual 12/2017 p. 572 and 03/2013 p. 502
//! (vectors I1..I4 of kinematics T, P, M; directions reversed where the workpiece moves), Extended Functions 03/2013 pp. 248,
//! 249, 264 (position tables). Fanuc: A-79348E p. 82 (19703..19705), A-78712E pp. 61, 62 (19709..19714).

use super::lines::{Joint, Side, Vectors};
use crate::axes::AxisName;
use crate::diag::{Finding, Findings, Source};
use crate::machine::{self, Machine};
use crate::simulate::rigid::{Vec3, norm, plus, unit};
use std::collections::BTreeMap;

/// A table of the control: what it adds to `output` by the position of `input`.
#[derive(Debug, Clone, PartialEq)]
pub struct Cross {
    /// By whose position.
    pub input: AxisName,
    /// Whose position it changes.
    pub output: AxisName,
    /// 0, or the sense of the input in which it applies.
    pub sense: f64,
    /// First point, machine coordinates, mm or deg.
    pub min: f64,
    /// Last point.
    pub max: f64,
    /// Distance of two points.
    pub step: f64,
    /// After the last point the first follows.
    pub modulo: bool,
    /// mm or deg.
    pub values: Vec<f64>,
    /// Machine coordinate of R's origin of the input.
    pub origin: f64,
}

impl Cross {
    /// What it adds at a coordinate relative to R's origin.
    pub fn added(&self, q: f64, up: bool) -> f64 {
        if (self.sense > 0.0 && !up) || (self.sense < 0.0 && up) {
            return 0.0;
        }
        let at = q + self.origin;
        // outside the range the end value holds
        let at = if self.modulo {
            self.min + (at - self.min).rem_euclid(self.max - self.min)
        } else {
            at.max(self.min).min(self.max)
        };
        let n = ((at - self.min) / self.step) as usize;
        let (low, high) = (self.values.get(n), self.values.get(n + 1));
        match (low, high) {
            (Some(a), Some(b)) => a + (b - a) * (at - self.min - n as f64 * self.step) / self.step,
            (Some(a), None) => *a,
            _ => 0.0,
        }
    }
}

/// What was read.
#[derive(Debug, Default)]
pub struct Loaded {
    /// The transformation.
    pub vectors: Option<Vectors>,
    /// Position tables.
    pub cross: Vec<Cross>,
}

/// The rotary axes of one side from the base on, with the direction about which a positive coordinate turns what they
/// carry.
fn rotary(machine: &Machine, side: machine::Side) -> Vec<(AxisName, Vec3)> {
    let of_side = machine.axes.iter().filter(|a| a.side == side && a.name.is_rotary());
    of_side.map(|a| (a.name, [a.sense * a.direction.x, a.sense * a.direction.y, a.sense * a.direction.z])).collect()
}

fn blank(machine: &Machine) -> Vectors {
    let origin = [AxisName::X, AxisName::Y, AxisName::Z].map(|a| machine.origin.get(a).unwrap_or(0.0));
    let p = &machine.tool.pivot;
    Vectors { head: Side::default(), table: Side::default(), origin, adapter: [p.x, p.y, p.z] }
}

struct Texts<'a> {
    machine: &'a Machine,
    findings: &'a mut Findings,
}

impl Texts<'_> {
    fn wrong(&mut self, source: &Source, at: usize, message: String) {
        let help = "load the file as `axiscal export` wrote it";
        self.findings.push(Finding::error("compensation::file", message).help(help).at(source, at..at));
    }
}

/// Reads SINUMERIK data: machine data or swivel data of the transformation, and position tables. The files do not say their
/// unit: lengths are in that of the control's basic system.
pub fn sinumerik(files: &[Source], machine: &Machine, mm_per_unit: f64, findings: &mut Findings) -> Loaded {
    let mut texts = Texts { machine, findings };
    let mut data: BTreeMap<String, String> = BTreeMap::new();
    for source in files {
        let mut at = 0;
        for raw in source.inner().split_inclusive('\n') {
            let line = raw.split(';').next().unwrap_or("").trim();
            let skip = line.is_empty()
                || line.starts_with('%')
                || line.starts_with("CHANDATA")
                || matches!(line, "M17" | "M30" | "NEWCONF");
            match line.split_once('=') {
                _ if skip => {}
                Some((name, value)) if name.trim().starts_with('$') => {
                    let name: String = name.chars().filter(|c| !c.is_whitespace()).collect();
                    if data.insert(name.clone(), value.trim().to_owned()).is_some() {
                        texts.wrong(source, at, format!("{name} stands twice"));
                    }
                }
                _ => texts.wrong(source, at, format!("{line:?} is no assignment")),
            }
            at += raw.len();
        }
    }
    let Some(first) = files.first() else { return Loaded::default() };
    let vectors = texts.transformation(first, &data, mm_per_unit);
    let cross = texts.cross(first, &data);
    Loaded { vectors, cross }
}

impl Texts<'_> {
    fn number(&mut self, source: &Source, data: &BTreeMap<String, String>, name: &str) -> f64 {
        match data.get(name).and_then(|v| v.replace("EX", "E").parse::<f64>().ok()).filter(|v| v.is_finite()) {
            Some(value) => value,
            None => {
                self.wrong(source, 0, format!("{name} has no number"));
                0.0
            }
        }
    }

    fn transformation(
        &mut self,
        source: &Source,
        data: &BTreeMap<String, String>,
        mm_per_unit: f64,
    ) -> Option<Vectors> {
        let carrier = data.keys().any(|k| k.starts_with("$TC_CARR"));
        let (tool, table) = (rotary(self.machine, machine::Side::Tool), rotary(self.machine, machine::Side::Workpiece));
        let by_axes = match (tool.len(), table.len()) {
            (2, 0) => "T",
            (0, 2) => "P",
            (1, 1) => "M",
            _ => "?",
        };
        let kind = match data.get("$TC_CARR23[1]") {
            Some(kind) => kind.trim_matches('"').to_owned(),
            None => by_axes.to_owned(),
        };
        if kind != by_axes {
            self.wrong(source, 0, format!("kinematics {kind:?} is not that of machine {:?}", self.machine.name));
            return None;
        }
        // I1, I2, I3, I4, V1, V2 (IM9 12/2017 p. 572)
        let md = |name: &str, k: usize| format!("$MC_TRAFO5_{name}_1[{k}]");
        let spelled = |which: usize, k: usize| -> String {
            if carrier {
                let first = [1, 4, 15, 18, 7, 10][which];
                return format!("$TC_CARR{}[1]", first + k);
            }
            match (kind.as_str(), which) {
                ("T", 0) => md("PART_OFFSET", k),
                ("T", 1) => md("JOINT_OFFSET", k),
                ("P", 2) => md("JOINT_OFFSET", k),
                ("M", 0) => md("JOINT_OFFSET", k),
                ("M", 2) => md("JOINT_OFFSET_PART", k),
                ("P" | "M", 3) => md("PART_OFFSET", k),
                (_, 4) => md("AXIS1", k),
                (_, 5) => md("AXIS2", k),
                _ => md("BASE_TOOL", k),
            }
        };
        let mut out = blank(self.machine);
        let mut get = |which: usize| [0, 1, 2].map(|k| self.number(source, data, &spelled(which, k)));
        let (v1, v2) = (get(4), get(5));
        let mut get = |which: usize| get(which).map(|length| length * mm_per_unit);
        // a table's direction counts against its motion
        let against = |v: Vec3| v.map(|x| -x);
        match kind.as_str() {
            "T" => {
                let (l1, l2, l3) = (get(0), get(1), get(2));
                out.head = Side { outside: l1, joints: vec![joint(tool[0].0, v1, l2), joint(tool[1].0, v2, l3)] };
            }
            "P" => {
                let (l2, l3, l4) = (get(1), get(2), get(3));
                let joints = vec![joint(table[0].0, against(v1), l3), joint(table[1].0, against(v2), l4)];
                out.table = Side { outside: l2, joints };
            }
            _ => {
                let (l1, l2, l3, l4) = (get(0), get(1), get(2), get(3));
                out.head = Side { outside: l1, joints: vec![joint(tool[0].0, v1, l2)] };
                out.table = Side { outside: l3, joints: vec![joint(table[0].0, against(v2), l4)] };
            }
        }
        if [v1, v2].iter().any(|v| (norm(*v) - 1.0).abs() > 1e-3) {
            self.wrong(source, 0, "a direction is no unit vector".to_owned());
        }
        Some(out)
    }

    fn cross(&mut self, source: &Source, data: &BTreeMap<String, String>) -> Vec<Cross> {
        let mut tables = Vec::new();
        let numbered =
            data.keys().filter_map(|k| k.strip_prefix("$AN_CEC_INPUT_AXIS[")?.strip_suffix(']')).map(str::to_owned);
        for t in numbered.collect::<Vec<_>>() {
            let axis = |what: &str| -> Option<AxisName> {
                let text = data.get(&format!("$AN_CEC_{what}_AXIS[{t}]"))?;
                let n: usize = text.trim_matches(['(', ')']).strip_prefix("AX")?.parse().ok()?;
                let present = AxisName::ALL.into_iter().filter(|a| self.machine.axis(*a).is_some());
                present.take(n).nth(n.checked_sub(1)?)
            };
            let (Some(input), Some(output)) = (axis("INPUT"), axis("OUTPUT")) else {
                self.wrong(source, 0, format!("position table {t} has no such axes"));
                continue;
            };
            let mut get = |what: &str| self.number(source, data, &format!("$AN_CEC_{what}[{t}]"));
            let (min, max, step) = (get("MIN"), get("MAX"), get("STEP"));
            let (sense, modulo, product) = (get("DIRECTION"), get("IS_MODULO") != 0.0, get("MULT_BY_TABLE"));
            // number of points = (MAX - MIN) / STEP + 1
            let points = ((max - min) / step).round() as usize + 1;
            if !(step > 0.0 && max > min && points < 10_000) || product != 0.0 {
                self.wrong(source, 0, format!("position table {t} has no points, or is multiplied by another"));
                continue;
            }
            let values = (0..points).map(|n| self.number(source, data, &format!("$AN_CEC[{t},{n}]"))).collect();
            let origin = self.machine.origin.get(input).unwrap_or(0.0);
            tables.push(Cross { input, output, sense, min, max, step, modulo, values, origin });
        }
        tables
    }
}

fn joint(axis: AxisName, direction: Vec3, inside: Vec3) -> Joint {
    Joint { axis, direction: unit(direction), inside }
}

/// Lines through points of the axes: the vectors that close.
pub fn through(machine: &Machine, table: &[(AxisName, Vec3, Vec3)], head: &[(AxisName, Vec3, Vec3)]) -> Vectors {
    let side = |axes: &[(AxisName, Vec3, Vec3)], sign: f64| {
        let mut out = Side::default();
        let mut last = [0.0; 3];
        for (axis, direction, point) in axes {
            // from the last point to this one, inside of the turn about the last one
            let step = plus(*point, -1.0, last).map(|v| v * sign);
            match out.joints.last_mut() {
                None => out.outside = step,
                Some(outer) => outer.inside = step,
            }
            out.joints.push(joint(*axis, *direction, point.map(|v| -v * sign)));
            last = *point;
        }
        out
    };
    Vectors { head: side(head, -1.0), table: side(table, 1.0), ..blank(machine) }
}

/// Reads Fanuc parameters.
pub fn fanuc(files: &[Source], machine: &Machine, findings: &mut Findings) -> Loaded {
    let mut texts = Texts { machine, findings };
    let mut mm: BTreeMap<u32, f64> = BTreeMap::new();
    for source in files {
        let mut at = 0;
        for raw in source.inner().split_inclusive('\n') {
            let line = raw.trim();
            // behind a % stands a title at most (leader section, B-64014EN/03 p. 21)
            let comment = line.is_empty() || line.starts_with(['%', '(']);
            match parameter(line) {
                _ if comment => {}
                Some((number, value)) => {
                    if mm.insert(number, value).is_some() {
                        texts.wrong(source, at, format!("parameter {number} stands twice"));
                    }
                }
                None => texts.wrong(source, at, format!("{line:?} is no real parameter with its unit")),
            }
            at += raw.len();
        }
    }
    let Some(first) = files.first() else { return Loaded::default() };
    let mut triple = |from: u32| {
        [0, 1, 2].map(|k| {
            mm.get(&(from + k)).copied().unwrap_or_else(|| {
                texts.wrong(first, 0, format!("parameter {} is missing", from + k));
                0.0
            })
        })
    };
    let (table, head) = (rotary(machine, machine::Side::Workpiece), rotary(machine, machine::Side::Tool));
    let mut table_lines = Vec::new();
    if let Some((axis, direction)) = table.first() {
        let first_point = triple(19700);
        table_lines.push((*axis, *direction, first_point));
        if let Some((axis, direction)) = table.get(1) {
            table_lines.push((*axis, *direction, plus(first_point, 1.0, triple(19703))));
        }
    }
    let mut head_lines = Vec::new();
    if let Some((axis, direction)) = head.last() {
        let next_to_tool = triple(19709);
        if head.len() == 2 {
            let (outer, about) = head[0];
            head_lines.push((outer, about, plus(next_to_tool, 1.0, triple(19712))));
        }
        head_lines.push((*axis, *direction, next_to_tool));
    }
    Loaded { vectors: Some(through(machine, &table_lines, &head_lines)), cross: Vec::new() }
}

/// `N19703Q1M-0.0123;` in mm.
fn parameter(line: &str) -> Option<(u32, f64)> {
    let line = line.strip_suffix(';').unwrap_or(line).trim_end();
    let (number, value) = line.strip_prefix('N')?.split_once("Q1")?;
    let value = value.strip_prefix("L1").unwrap_or(value);
    let unit = match value.as_bytes().first()? {
        b'M' => 1.0,
        b'I' => crate::units::mm_from_inch(1.0),
        _ => return None,
    };
    let value: f64 = value[1..].parse().ok()?;
    value.is_finite().then_some((number.parse().ok()?, value * unit))
}
