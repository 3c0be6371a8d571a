//! Centres of spheres as other programs have measured them: a CSV with a header line, `sphere,X,Y,Z,B,C` and optional columns
//! (docs/formats.md, "Sphere centres").
//!
//! What the numbers mean is in lines `# key = value` above the header, or in what the caller states. A file with a faulty row is
//! refused as a whole: a row that is left out moves results without a trace.

mod columns;
mod stated;

pub use stated::{Counted, Kind, Stated, unit_of};

use super::numbers::{number, whole};
use super::temperatures;
use super::text_lines::{Line, Lines};
use crate::axes::{AxisMap, AxisName};
use crate::diag::{Finding, Findings, Result, Source};
use columns::{Column, Header};
use nalgebra::Vector3;
use std::collections::HashMap;

/// A centre, or a point on a sphere, as the file has it.
#[derive(Debug, Clone, PartialEq)]
pub struct CentreRow {
    /// The sphere's name.
    pub sphere: String,
    /// X, Y, Z in the unit of the file.
    pub xyz: Vector3<f64>,
    /// The rotary axes, deg.
    pub rotary: AxisMap,
    pub time_s: Option<f64>,
    pub temperature_deg_c: Option<f64>,
    /// Standard deviation of each coordinate.
    pub sigma_um: Option<f64>,
    /// Which run, where the file says it.
    pub run: Option<u64>,
    /// Of a point: its number, and the direction from the sphere to the ball where the file has it.
    pub touch: Option<u64>,
    pub direction: Option<Vector3<f64>>,
    /// Line of the file, from 1.
    pub line: usize,
}

/// A file of centres, or of points on spheres.
#[derive(Debug, Clone, PartialEq)]
pub struct CentresFile {
    /// What its head says.
    pub stated: Stated,
    /// Its rows in their order; those that the file itself marks as unusable are not among them.
    pub rows: Vec<CentreRow>,
    /// Its rows are points on spheres.
    pub of_points: bool,
    /// The rotary axes that it has columns for.
    pub rotary: Vec<AxisName>,
}

const FORM: &str = "write a header line such as `sphere,X,Y,Z,B,C`, then one line for each centre (docs/formats.md, \"Sphere centres\")";

/// A file with more faults than this is another file.
const MOST_FAULTS: usize = 100;

/// Range of a line of a file, counted from 1.
#[must_use]
pub fn line_range(source: &Source, line: usize) -> std::ops::Range<usize> {
    let found = Lines::new(source.inner().as_bytes(), 0).nth(line.saturating_sub(1));
    found.map_or(0..0, |l| l.start..l.start + l.bytes.len())
}

/// Reads such a file.
///
/// # Errors
/// When its header is unusable or any row is not understood; every finding has its place.
pub fn read(source: &Source) -> Result<(CentresFile, Findings)> {
    let bytes = source.inner().as_bytes();
    let mut findings = Findings::default();
    let mut stated = Stated::default();
    let mut lines = Lines::new(bytes, 0).filter(|l| !l.bytes.trim_ascii().is_empty());
    let head = loop {
        let Some(line) = lines.next() else {
            let finding = Finding::error("centres::empty", "the file has no header line").help(FORM);
            return Err(finding.at(source, 0..0).into());
        };
        match line.bytes.trim_ascii().strip_prefix(b"#") {
            Some(remark) => stated.take(remark, line.start..line.start + line.bytes.len(), source, &mut findings),
            None => break line,
        }
    };
    let header = Header::read(&head, source, &mut stated, &mut findings)?;
    let mut rows = Vec::new();
    let mut unused = 0;
    let mut seen: HashMap<&[u8], usize> = HashMap::new();
    let mark = header.decimal_mark(lines.clone().map(|l| l.bytes));
    for line in lines.filter(|l| !l.bytes.trim_ascii().starts_with(b"#")) {
        if findings.0.len() >= MOST_FAULTS {
            break;
        }
        if let Some(first) = seen.insert(line.bytes.trim_ascii(), line.number) {
            let message = format!("this line is the same as line {first}: one measurement would count twice");
            let finding = Finding::error("centres::twice", message)
                .help("remove it; if the sphere was measured twice with equal results, add a column time_s that tells them apart");
            findings.push(finding.at(source, line.start..line.start + line.bytes.len()));
            continue;
        }
        match row(&line, &header, mark) {
            Ok(Some(row)) => rows.push(row),
            Ok(None) => unused += 1,
            Err((range, message, help)) => {
                let cut = if line.ended() { "" } else { "; the file is cut off here" };
                let finding = Finding::error("centres::row", format!("{message}{cut}")).help(help);
                findings.push(finding.at(source, line.start + range.start..line.start + range.end));
            }
        }
    }
    if unused > 0 {
        let message = format!("{unused} rows are marked as unusable in the column status; they are not used");
        findings.push(Finding::info("centres::unused", message));
    }
    if rows.is_empty() && !findings.has_errors() {
        let finding = Finding::error("centres::empty", "the file has a header and no row that can be used").help(FORM);
        findings.push(finding.at(source, head.start..head.start + head.bytes.len()));
    }
    findings.finish(CentresFile { stated, rows, of_points: header.of_points(), rotary: header.rotary() })
}

/// Where in the line, what is wrong, what to do.
type Fault = (std::ops::Range<usize>, String, String);

/// A row; `None` where its status says that it cannot be used.
fn row(line: &Line<'_>, header: &Header, mark: u8) -> Result<Option<CentreRow>, Fault> {
    let fields = header.fields(line.bytes);
    if fields.len() != header.columns.len() {
        let commas = header.separator == Some(b',') && fields.len() > header.columns.len();
        let help = if commas {
            "if the numbers have decimal commas, separate the columns with semicolons"
        } else {
            "write one value for each column; leave a field empty only where its column may be empty"
        };
        let message =
            format!("the row has {} fields and the header has {} columns", fields.len(), header.columns.len());
        return Err((0..line.bytes.len(), message, help.to_owned()));
    }
    let mut out = CentreRow {
        sphere: "sphere".to_owned(),
        xyz: Vector3::zeros(),
        rotary: AxisMap::default(),
        time_s: None,
        temperature_deg_c: None,
        sigma_um: None,
        run: None,
        touch: None,
        direction: None,
        line: line.number,
    };
    let mut is_used = true;
    let mut normal = Vector3::zeros();
    for (field, column) in fields.into_iter().zip(&header.columns) {
        let text = line.bytes[field.clone()].trim_ascii();
        let text = text.strip_prefix(b"\"").and_then(|t| t.strip_suffix(b"\"")).unwrap_or(text);
        let range = field.start..field.end.max(field.start + 1);
        let fault = |expected: &str, help: &str| {
            let shown: String = String::from_utf8_lossy(text).chars().take(40).collect();
            (range.clone(), format!("column {}: expected {expected}, found {shown:?}", column.name()), help.to_owned())
        };
        match column {
            Column::Sphere => {
                let name = String::from_utf8_lossy(text);
                if text.is_empty() || name.chars().any(|c| c.is_control() || "@/#\"".contains(c)) {
                    return Err(fault(
                        "the name of a sphere",
                        "write a short name without the characters @ / # and quotes",
                    ));
                }
                out.sphere = name.into_owned();
                continue;
            }
            Column::Status => {
                is_used = match text.to_ascii_lowercase().as_slice() {
                    b"hit" | b"ok" | b"" => true,
                    b"miss" | b"bad" => false,
                    _ => return Err(fault("hit, ok, miss or bad", "hit and ok are used, miss and bad are not")),
                };
                continue;
            }
            Column::Direction => {
                out.direction = match text {
                    b"" => None,
                    _ => Some(direction(text).ok_or_else(|| {
                        fault("a direction such as +X", "write +X, -X, +Y, -Y, +Z or -Z: from the sphere to the ball")
                    })?),
                };
                continue;
            }
            _ => {}
        }
        let optional = !matches!(column, Column::Linear(_) | Column::Rotary(_) | Column::Touch);
        if text.is_empty() && optional {
            continue;
        }
        let parsed = number(mark)(text).ok().filter(|(rest, n)| rest.is_empty() && n.value.is_finite());
        let Some((_, parsed)) = parsed else {
            let help = if mark == b'.' && text.contains(&b',') {
                "write a decimal point, or separate all columns with semicolons and write every number with a decimal comma"
            } else {
                "every row needs this number: measure the centre again, or remove the row"
            };
            return Err(fault("a number", help));
        };
        let value = parsed.value;
        let count = || whole(parsed).ok_or_else(|| fault("a whole number", "number them 1, 2, 3 …"));
        match column {
            Column::Linear(i) if value.abs() <= LARGEST => out.xyz[*i] = value,
            Column::Rotary(axis) if value.abs() <= LARGEST => out.rotary.set(*axis, value),
            Column::Linear(_) | Column::Rotary(_) => {
                return Err(fault("a position of a machine", "is the decimal point missing?"));
            }
            Column::Time => out.time_s = Some(value),
            Column::Temperature if temperatures::USABLE_DEG_C.contains(&value) => out.temperature_deg_c = Some(value),
            Column::Temperature => {
                return Err(fault(temperatures::EXPECTED, "write degrees Celsius, or remove the column"));
            }
            Column::Sigma if value > 0.0 && value <= 1e6 => out.sigma_um = Some(value),
            Column::Sigma => return Err(fault("µm, more than 0", "write the standard deviation of each coordinate")),
            Column::Run => out.run = Some(count()?),
            Column::Touch => out.touch = Some(count()?),
            Column::Normal(i) => normal[*i] = value,
            Column::Sphere | Column::Status | Column::Direction => {}
        }
    }
    if out.direction.is_none() && normal.norm() > 0.0 {
        out.direction = Some(normal.normalize());
    }
    Ok(is_used.then_some(out))
}

/// No coordinate of a machine is larger, mm, inch or deg.
const LARGEST: f64 = 1e5;

/// `+X`, `-Z` and so on.
fn direction(text: &[u8]) -> Option<Vector3<f64>> {
    let (sign, letter) = match text {
        [b'+', letter] | [letter] => (1.0, letter),
        [b'-', letter] => (-1.0, letter),
        _ => return None,
    };
    let axis = AxisName::from_letter(char::from(*letter)).filter(|a| !a.is_rotary())?;
    let mut out = Vector3::zeros();
    out[axis.index()] = sign;
    Some(out)
}
