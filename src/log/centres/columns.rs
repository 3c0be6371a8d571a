//! The header line of a file of centres.

use super::FORM;
use super::stated::{Kind, Stated, unit_of};
use crate::axes::AxisName;
use crate::diag::{Finding, Findings, Result, Source};
use crate::log::numbers::number;
use crate::log::text_lines::Line;
use crate::post::as_written::LengthUnit;
use std::ops::Range;

/// What a column holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Column {
    Sphere,
    /// X, Y, Z.
    Linear(usize),
    Rotary(AxisName),
    Time,
    Temperature,
    Sigma,
    Run,
    Status,
    Touch,
    Direction,
    Normal(usize),
}

const KNOWN: &str = "sphere, X, Y, Z (or dX, dY, dZ of readings), A, B, C, time_s, temperature_degC, sigma_um, run, status, and for points touch and direction (or nx, ny, nz)";

impl Column {
    pub fn name(self) -> &'static str {
        match self {
            Self::Sphere => "sphere",
            Self::Linear(i) => ["X", "Y", "Z"][i.min(2)],
            Self::Rotary(AxisName::A) => "A",
            Self::Rotary(AxisName::B) => "B",
            Self::Rotary(_) => "C",
            Self::Time => "time_s",
            Self::Temperature => "temperature_degC",
            Self::Sigma => "sigma_um",
            Self::Run => "run",
            Self::Status => "status",
            Self::Touch => "touch",
            Self::Direction => "direction",
            Self::Normal(i) => ["nx", "ny", "nz"][i.min(2)],
        }
    }
}

/// A column's name taken apart.
struct Named {
    column: Column,
    unit: Option<LengthUnit>,
    /// `dX`: a change against the start.
    is_reading: bool,
}

fn named(name: &str) -> Option<Named> {
    let plain = |column| Some(Named { column, unit: None, is_reading: false });
    let lower = name.to_ascii_lowercase();
    match lower.as_str() {
        "sphere" | "ball" => return plain(Column::Sphere),
        "time_s" => return plain(Column::Time),
        "temperature_degc" => return plain(Column::Temperature),
        "sigma_um" => return plain(Column::Sigma),
        "run" => return plain(Column::Run),
        "status" => return plain(Column::Status),
        "touch" => return plain(Column::Touch),
        "direction" => return plain(Column::Direction),
        "nx" => return plain(Column::Normal(0)),
        "ny" => return plain(Column::Normal(1)),
        "nz" => return plain(Column::Normal(2)),
        _ => {}
    }
    let (axis, unit) = match lower.split_once('_') {
        Some((axis, unit)) => (axis, Some(unit)),
        None => (lower.as_str(), None),
    };
    let (letter, is_reading) = match axis.as_bytes() {
        [letter] => (*letter, false),
        [b'd', letter] => (*letter, true),
        _ => return None,
    };
    let axis = AxisName::from_letter(char::from(letter))?;
    if axis.is_rotary() {
        let is_good = !is_reading && unit.is_none_or(|u| u == "deg");
        return is_good.then_some(Named { column: Column::Rotary(axis), unit: None, is_reading: false });
    }
    let unit = match unit {
        Some(word) => Some(unit_of(word)?),
        None => None,
    };
    Some(Named { column: Column::Linear(axis.index()), unit, is_reading })
}

/// The columns and what separates them.
#[derive(Debug)]
pub(super) struct Header {
    /// `None`: blanks.
    pub separator: Option<u8>,
    pub columns: Vec<Column>,
}

impl Header {
    pub fn read(line: &Line<'_>, source: &Source, stated: &mut Stated, findings: &mut Findings) -> Result<Self> {
        let separator = [b';', b'\t', b','].into_iter().find(|s| line.bytes.contains(s));
        let mut header = Self { separator, columns: Vec::new() };
        let whole_line = line.start..line.start + line.bytes.len();
        let fields = header.fields(line.bytes);
        let is_number =
            |r: &Range<usize>| number(b'.')(line.bytes[r.clone()].trim_ascii()).is_ok_and(|(rest, _)| rest.is_empty());
        if fields.iter().all(is_number) {
            let finding = if fields.len() == 3 {
                Finding::error(
                    "centres::no_angles",
                    format!("the file has three numbers in each row and no angles. {WITHOUT_ANGLES}"),
                )
                .help(ADD_ANGLES)
            } else {
                Finding::error(
                    "centres::no_header",
                    "the first line has numbers only: the file does not say what its columns are",
                )
                .help(FORM)
            };
            findings.push(finding.at(source, whole_line));
            return Err(crate::diag::Failure(std::mem::take(&mut findings.0)));
        }
        let mut in_columns: Option<LengthUnit> = None;
        let mut readings = [0, 0];
        for field in fields {
            let text = String::from_utf8_lossy(&line.bytes[field.clone()]).trim().trim_matches('"').to_owned();
            let range = line.start + field.start..line.start + field.end.max(field.start + 1);
            let Some(found) = named(&text) else {
                let finding = Finding::error("centres::unknown_column", format!("column {text:?} is not known"));
                findings.push(finding.help(format!("columns are {KNOWN}; remove other columns")).at(source, range));
                continue;
            };
            if header.columns.contains(&found.column) {
                let finding =
                    Finding::error("centres::column_twice", format!("column {} appears twice", found.column.name()));
                findings.push(finding.help("remove one of them").at(source, range.clone()));
            }
            if found.unit.is_some() && in_columns.is_some() && found.unit != in_columns {
                let finding = Finding::error("centres::unit", "two columns have different units")
                    .help("write all lengths in one unit");
                findings.push(finding.at(source, range));
            }
            in_columns = in_columns.or(found.unit);
            if matches!(found.column, Column::Linear(_)) {
                readings[usize::from(found.is_reading)] += 1;
            }
            header.columns.push(found.column);
        }
        let missing: Vec<&str> =
            (0..3).map(Column::Linear).filter(|c| !header.columns.contains(c)).map(Column::name).collect();
        if !missing.is_empty() {
            let finding =
                Finding::error("centres::column_missing", format!("the header has no column {}", missing.join(", ")))
                    .help(FORM);
            findings.push(finding.at(source, whole_line.clone()));
        }
        if header.rotary().is_empty() {
            let finding = Finding::error(
                "centres::no_angles",
                format!("the file has no column with the position of a rotary axis. {WITHOUT_ANGLES}"),
            );
            findings.push(finding.help(ADD_ANGLES).at(source, whole_line.clone()));
        }
        if readings[0] > 0 && readings[1] > 0 {
            let finding = Finding::error("centres::kind", "some columns are positions (X) and others readings (dX)")
                .help("a file has either positions or readings");
            findings.push(finding.at(source, whole_line.clone()));
        }
        let of_columns =
            Stated { unit: in_columns, kind: (readings[1] > 0).then_some(Kind::Reading), ..Stated::default() };
        let contradicts = |a: Option<LengthUnit>, b: Option<LengthUnit>| a.is_some() && b.is_some() && a != b;
        if contradicts(stated.unit, of_columns.unit) {
            let finding =
                Finding::error("centres::unit", "the head and the names of the columns state different units")
                    .help("correct one of them");
            findings.push(finding.at(source, whole_line.clone()));
        }
        if of_columns.kind.is_some() && stated.kind.is_some_and(|k| k != Kind::Reading) {
            let finding = Finding::error(
                "centres::kind",
                "the columns dX, dY, dZ are readings, and the head states another kind",
            )
            .help("correct one of them");
            findings.push(finding.at(source, whole_line));
        }
        stated.unit = stated.unit.or(of_columns.unit);
        stated.kind = stated.kind.or(of_columns.kind);
        if findings.has_errors() {
            return Err(crate::diag::Failure(std::mem::take(&mut findings.0)));
        }
        Ok(header)
    }

    /// The fields of a line.
    pub fn fields(&self, line: &[u8]) -> Vec<Range<usize>> {
        let mut out = Vec::new();
        let mut start = 0;
        let is_separator = |b: u8| self.separator.map_or(b.is_ascii_whitespace(), |s| b == s);
        for (i, _) in line.iter().enumerate().filter(|(_, b)| is_separator(**b)) {
            out.push(start..i);
            start = i + 1;
        }
        out.push(start..line.len());
        if self.separator.is_none() {
            // several blanks are one
            out.retain(|r| !r.is_empty());
        }
        out
    }

    /// `,` where numbers have a comma and none has a point.
    pub fn decimal_mark<'a>(&self, lines: impl Iterator<Item = &'a [u8]>) -> u8 {
        if self.separator == Some(b',') { b'.' } else { crate::log::csv::decimal_mark(lines) }
    }

    pub fn of_points(&self) -> bool {
        self.columns.contains(&Column::Touch)
    }

    pub fn rotary(&self) -> Vec<AxisName> {
        let axis = |c: &Column| if let Column::Rotary(axis) = c { Some(*axis) } else { None };
        self.columns.iter().filter_map(axis).collect()
    }
}

const WITHOUT_ANGLES: &str = "An error of a rotary axis shows only in how the centre moves from one angle to the next: without the angles it cannot be determined";

const ADD_ANGLES: &str =
    "add a column for each rotary axis of the machine (A, B, C, in degrees) with its position in each row";
