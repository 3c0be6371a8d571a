//! Touches in the project's own form: a CSV with a header line, `id,X,Y,Z,A,B,C,time_s,temperature_degC,status`.
//!
//! Columns may be in any order; axes that the machine lacks, `time_s`, `temperature_degC` and `status` may be missing.
//! Positions are axis positions relative to R, mm and deg. Fields separated by semicolons or tabs, with a decimal comma
//! where commas do not separate, are read too: spreadsheets write them.

use super::finding_places::{Capped, Places};
use super::numbers::{number, whole};
use super::temperatures;
use super::text_lines::Lines;
use super::touch::{RawTouch, Status, Touch};
use crate::axes::{AxisName, Position};
use crate::diag::{Failure, Finding, Findings, Result};
use crate::machine::Machine;
use std::fmt::Write;

/// What a column holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Column {
    Id,
    Axis(AxisName),
    Time,
    Temperature,
    Status,
}

impl Column {
    fn named(name: &str) -> Option<Self> {
        match name {
            "id" => Some(Self::Id),
            "time_s" => Some(Self::Time),
            "temperature_degC" => Some(Self::Temperature),
            "status" => Some(Self::Status),
            _ => crate::post::as_written::axis_of(name).filter(|_| name.len() == 1).map(Self::Axis),
        }
    }
}

const FORM: &str = "a header line such as id,X,Y,Z,B,C,status, then one line per touch";

/// Reads a touches CSV.
///
/// # Errors
/// When the header is unusable or no line can be used.
pub fn read(bytes: &[u8], name: &str) -> Result<(Vec<RawTouch>, Findings)> {
    let places = Places::new(bytes, name);
    let mut findings = Findings::default();
    let start = super::parse::sniff(bytes, &places, &mut findings)?;
    let lines = Lines::new(&bytes[start..], start);
    let mut lines = lines.filter(|l| !l.bytes.iter().all(u8::is_ascii_whitespace));
    let Some(head) = lines.next() else {
        return Err(Failure::new("log::empty", format!("{name}:1:1: the file is empty")).help(FORM));
    };
    let separator = [b';', b'\t', b','].into_iter().find(|s| head.bytes.contains(s)).unwrap_or(b',');
    let columns = header(head.bytes, head.start, separator, &places)?;
    let mark = if separator == b',' { b'.' } else { decimal_mark(lines.clone().map(|l| l.bytes)) };
    let mut faults = Capped::default();
    let mut touches = Vec::new();
    for line in lines {
        match touch(line.bytes, line.number, &columns, separator, mark) {
            Ok(touch) => touches.push(touch),
            Err((range, message)) => faults.push(|| {
                let cut = if line.ended() { "" } else { " (the file is cut off here)" };
                let finding = Finding::warning("log::not_understood", format!("{message}{cut}; the line is not used"));
                places.at(finding, line.start + range.start..line.start + range.end)
            }),
        }
    }
    findings.0.extend(faults.drain("lines that are not understood", "log::not_understood"));
    findings.0.extend(temperatures::unusual(&touches, &places));
    if touches.is_empty() {
        findings.push(places.at_line(Finding::error("log::nothing", "no touch in the file").help(FORM), 1));
    }
    findings.finish(touches)
}

fn header(line: &[u8], start: usize, separator: u8, places: &Places<'_>) -> Result<Vec<Column>> {
    let mut findings = Findings::default();
    let mut columns = Vec::new();
    let mut at = 0;
    for field in line.split(|b| *b == separator) {
        let name = String::from_utf8_lossy(field).trim().trim_matches('"').to_owned();
        let range = start + at..start + at + field.len().max(1);
        at += field.len() + 1;
        match Column::named(&name) {
            Some(column) if columns.contains(&column) => findings.push(
                places
                    .at(Finding::error("log::column_twice", format!("column {name} appears twice")).help(FORM), range),
            ),
            Some(column) => columns.push(column),
            None => findings.push(
                places.at(
                    Finding::error("log::unknown_column", format!("column {name:?} is not known"))
                        .help("columns are id, X, Y, Z, A, B, C, time_s, temperature_degC, status"),
                    range,
                ),
            ),
        }
    }
    let needed = [Column::Id, Column::Axis(AxisName::X), Column::Axis(AxisName::Y), Column::Axis(AxisName::Z)];
    if let Some(lacks) = needed.iter().find(|c| !columns.contains(c)) {
        let what = if let Column::Axis(axis) = lacks { axis.to_string() } else { "id".to_owned() };
        let finding = Finding::error("log::column_missing", format!("the header has no column {what}")).help(FORM);
        findings.push(places.at(finding, start..start + line.len()));
    }
    findings.finish(columns).map(|(columns, _)| columns)
}

/// `,` where numbers hold a comma and none holds a point.
pub(super) fn decimal_mark<'a>(lines: impl Iterator<Item = &'a [u8]>) -> u8 {
    let (mut comma, mut point) = (false, false);
    for line in lines.take(100) {
        comma |= line.contains(&b',');
        point |= line.contains(&b'.');
    }
    if comma && !point { b',' } else { b'.' }
}

type At = (std::ops::Range<usize>, String);

fn touch(line: &[u8], line_number: usize, columns: &[Column], separator: u8, mark: u8) -> Result<RawTouch, At> {
    let fields = line.split(|b| *b == separator).count();
    if fields != columns.len() {
        let commas = separator == b',' && fields > columns.len();
        let hint = if commas { " (decimal commas? then separate the fields with semicolons)" } else { "" };
        return Err((0..line.len(), format!("{fields} fields, the header has {}{hint}", columns.len())));
    }
    let mut out = RawTouch {
        id: None,
        position: Position::default(),
        present: [false; 6],
        status: Status::Hit,
        time_s: None,
        temperature_deg_c: None,
        line: line_number,
    };
    let mut at = 0;
    for (field, column) in line.split(|b| *b == separator).zip(columns) {
        let range = at..at + field.len().max(1);
        at += field.len() + 1;
        let text = field.trim_ascii();
        let text = text.strip_prefix(b"\"").and_then(|t| t.strip_suffix(b"\"")).unwrap_or(text);
        let wrong = |what: &str| {
            let shown: String = String::from_utf8_lossy(text).chars().take(40).collect();
            (range.clone(), format!("expected {what}, found {shown:?}"))
        };
        if *column == Column::Status {
            out.status = match text {
                b"hit" => Status::Hit,
                b"miss" => Status::Miss,
                _ => return Err(wrong("the status hit or miss")),
            };
            continue;
        }
        if text.is_empty() && matches!(column, Column::Time | Column::Temperature) {
            continue;
        }
        let value = number(mark)(text).ok().filter(|(rest, n)| rest.is_empty() && n.value.is_finite());
        let (_, value) = value.ok_or_else(|| wrong("a number"))?;
        match column {
            Column::Id => out.id = Some(whole(value).ok_or_else(|| wrong("the number of a touch"))?),
            Column::Axis(axis) => {
                out.position.set(*axis, value.value);
                out.present[axis.index()] = true;
            }
            Column::Time => out.time_s = Some(value.value),
            Column::Temperature if !temperatures::USABLE_DEG_C.contains(&value.value) => {
                return Err(wrong(temperatures::EXPECTED));
            }
            Column::Temperature => out.temperature_deg_c = Some(value.value),
            Column::Status => {}
        }
    }
    Ok(out)
}

/// Writes a touches CSV: numbers in full, so that reading them gives the same doubles. What is far from its place is no touch of
/// the plan, and is left out.
#[must_use]
pub fn write(machine: &Machine, touches: &[Touch]) -> String {
    let axes: Vec<AxisName> = AxisName::ALL.into_iter().filter(|a| machine.axis(*a).is_some()).collect();
    let timed = touches.iter().any(|t| t.time_s.is_some());
    let warmed = touches.iter().any(|t| t.temperature_deg_c.is_some());
    let mut text = String::from("id");
    // writing into a String cannot fail
    axes.iter().for_each(|a| {
        let _ = write!(text, ",{a}");
    });
    text.push_str(if timed { ",time_s" } else { "" });
    text.push_str(if warmed { ",temperature_degC" } else { "" });
    text.push_str(",status\n");
    let optional = |value: Option<f64>| value.map(|v| v.to_string()).unwrap_or_default();
    for touch in touches.iter().filter(|t| t.status != Status::Elsewhere) {
        let _ = write!(text, "{}", touch.id);
        for axis in &axes {
            // adding 0 turns -0 into 0
            let _ = write!(text, ",{}", touch.position.get(*axis) + 0.0);
        }
        if timed {
            let _ = write!(text, ",{}", optional(touch.time_s));
        }
        if warmed {
            let _ = write!(text, ",{}", optional(touch.temperature_deg_c));
        }
        text.push_str(if touch.status == Status::Hit { ",hit\n" } else { ",miss\n" });
    }
    text
}
