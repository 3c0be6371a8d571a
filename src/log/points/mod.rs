//! Inspection results of other programs: nominal points with the ball's centre at each contact (`postprocessors/msr.toml`).
//!
//! No log of axiscal's programs: there is no status, no time, no axis position in it. A file that is not whole is refused
//! as it is by the programs that such files are made for: which point a line belongs to follows from the lines before it.
//! [`parse`] gives the points, [`touches`] makes touches of a plan of them.

mod form;
mod matching;
pub mod poses;
mod record;

pub use form::PointsForm;
pub use matching::touches;

use super::finding_places::{Capped, Places};
use super::runs::RunFound;
use super::text_lines::Lines;
use crate::diag::{Failure, Finding, Findings, Result};
use crate::geometry::Displacement;
use crate::post::as_written::LengthUnit;
use crate::units::{mm_from_inch, rad_from_deg};
use nalgebra::Vector3;
use record::{Record, record};

#[derive(Debug, Clone, PartialEq)]
pub struct Point {
    /// Its number in the file.
    pub number: u64,
    /// Rotations A, B, C of the record before it, deg.
    pub orientation_deg: [f64; 3],
    /// Which record that is, from 1; 0 where there is none before it.
    pub orientation: usize,
    /// Nominal point of the surface, as the file has it, mm.
    pub nominal: Vector3<f64>,
    /// Outward normal there, as the file has it.
    pub normal: Vector3<f64>,
    /// Centre of the ball at the contact, as the file has it, mm.
    pub centre: Vector3<f64>,
    /// Radius of the ball, mm.
    pub radius_mm: f64,
    /// Line of the centre, from 1.
    pub line: usize,
}

impl Point {
    /// A vector of the file in the part's frame: `Rz(C)·Ry(B)·Rx(A)·v`, active, degrees.
    ///
    /// Source: recovered from a file and its turned twin (81 points, three orientations; `docs/formats.md`).
    #[must_use]
    pub fn in_part(&self, v: &Vector3<f64>) -> Vector3<f64> {
        let [a, b, c] = self.orientation_deg.map(rad_from_deg);
        Displacement { d: Vector3::zeros(), w: Vector3::new(a, b, c) }.rotation() * v
    }
}

/// The points of one block START … END, and the blocks that the file holds.
#[derive(Debug, Clone, PartialEq)]
pub struct Points {
    /// In the order of the file.
    pub points: Vec<Point>,
    /// The line of the end is there.
    pub ended: bool,
    /// All blocks.
    pub runs: Vec<RunFound>,
}

/// A block as it is read.
#[derive(Debug, Default)]
struct Block {
    points: Vec<Point>,
    first_line: usize,
    last_line: usize,
    ended: bool,
    errors: Vec<Finding>,
}

/// Reads such a file: its only block, or the one of this number.
///
/// # Errors
/// When it is empty, holds no point, a line is not understood or out of order, or it holds several blocks and none is named.
pub fn parse(bytes: &[u8], name: &str, form: &PointsForm, asked: Option<usize>) -> Result<(Points, Findings)> {
    let places = Places::new(bytes, name);
    let mut findings = Findings::default();
    let start = super::parse::sniff(bytes, &places, &mut findings)?;
    let blocks = blocks(&bytes[start..], start, form, &places);
    let index = match asked {
        Some(number) => number.wrapping_sub(1),
        None => 0,
    };
    let runs: Vec<RunFound> = blocks
        .iter()
        .enumerate()
        .map(|(i, b)| RunFound {
            number: i + 1,
            first_line: b.first_line,
            last_line: b.last_line,
            touches: b.points.len(),
            complete: b.ended && b.errors.is_empty(),
            taken: i == index,
        })
        .collect();
    let offer: Vec<String> = runs
        .iter()
        .map(|r| format!("block {}: lines {} to {}, {} points", r.number, r.first_line, r.last_line, r.touches))
        .collect();
    if asked.is_none() && blocks.len() > 1 {
        let message = format!("a second {} in the file: it holds {} blocks", form.begin, blocks.len());
        let help = format!("say with --run N which one is meant: {}", offer.join("; "));
        let line = blocks.get(1).map_or(1, |b| b.first_line);
        let earlier: Vec<Finding> = blocks.into_iter().flat_map(|b| b.errors).collect();
        let finding = places.at_line(Finding::error("log::blocks", message).help(help), line);
        return Err(Failure([findings.0, earlier, vec![finding]].concat()));
    }
    let count = blocks.len();
    let Some(block) = blocks.into_iter().nth(index) else {
        let finding = match asked {
            Some(number) if count > 0 => {
                Failure::new("log::no_run", format!("there is no run {number}: {name} holds {count} of them"))
                    .help(offer.join("; "))
            }
            _ => places
                .at_line(Finding::error("log::nothing", format!("no line {} in the file", form.begin)), 1)
                .help("is this a file of inspection results?")
                .into(),
        };
        return Err(Failure([findings.0, finding.0].concat()));
    };
    findings.0.extend(block.errors);
    if findings.has_errors() {
        return Err(Failure(findings.0));
    }
    if block.points.is_empty() {
        let finding = Finding::error("log::nothing", "the file holds no point")
            .help("did the inspection program run, or was only its beginning and end printed?");
        findings.push(places.at_line(finding, block.first_line));
        return Err(Failure(findings.0));
    }
    if !block.ended {
        let message = format!("the file ends after {} points without the line {}", block.points.len(), form.end);
        let finding = Finding::warning("log::truncated", message)
            .help("it is cut off, or the program was stopped; what is there is used");
        findings.push(places.at_line(finding, block.last_line));
    }
    let mut points = block.points;
    if form.unit == LengthUnit::Inch {
        for point in &mut points {
            point.nominal = point.nominal.map(mm_from_inch);
            point.centre = point.centre.map(mm_from_inch);
            point.radius_mm = mm_from_inch(point.radius_mm);
        }
    }
    findings.finish(Points { points, ended: block.ended, runs })
}

/// The file's blocks; what is wrong in one stands in its errors.
fn blocks(bytes: &[u8], start: usize, form: &PointsForm, places: &Places<'_>) -> Vec<Block> {
    let mut blocks: Vec<Block> = Vec::new();
    let mut faults = Capped::default();
    let mut before = Block { first_line: 1, ..Block::default() };
    let mut orientation = [0.0; 3];
    let mut orientations = 0;
    let mut open: Option<(u64, Vector3<f64>, Vector3<f64>, usize)> = None;
    let lost = |number: u64, line: usize| {
        let message = format!(
            "the line {} N{number} is missing: a new record begins before the centre of the point",
            form.centre
        );
        places.at_line(Finding::error("log::order", message).help(WHOLE), line)
    };
    for line in Lines::new(bytes, start) {
        let text = super::text_lines::without_trailer(line.bytes);
        let found = record(text, form);
        if blocks.is_empty()
            && matches!(found, Ok(Record::Orientation(_) | Record::Nominal { .. } | Record::Centre { .. }))
        {
            let message = format!("the file does not begin with {}: is its head lost?", form.begin);
            let finding = Finding::warning("log::no_head", message).help("what is there is used");
            let errors = vec![places.at_line(finding, line.number)];
            blocks.push(Block { first_line: line.number, errors, ..Block::default() });
        }
        let in_block = blocks.last().is_some_and(|b: &Block| !b.ended);
        let block = blocks.last_mut().filter(|_| in_block).unwrap_or(&mut before);
        if !matches!(found, Ok(Record::Blank)) {
            block.last_line = line.number;
        }
        let mut error = |at: usize, length: usize, code, message: String| {
            let range = line.start + at..line.start + at + length;
            faults.push(|| places.at(Finding::error(code, message).help(WHOLE), range));
        };
        match found {
            Err(fault) => {
                let fault = super::read_lines::no_text(text, line.start).unwrap_or(fault);
                error(fault.at, fault.length, fault.code, fault.message);
            }
            Ok(Record::Blank) => {}
            Ok(Record::Begin) => {
                if let Some((number, ..)) = open.take() {
                    block.errors.push(lost(number, line.number));
                }
                // twice the same line, one behind the other, is one
                if !in_block || !block.points.is_empty() {
                    (orientation, orientations) = ([0.0; 3], 0);
                    blocks.push(Block { first_line: line.number, last_line: line.number, ..Block::default() });
                }
            }
            Ok(Record::End) => {
                if let Some((number, ..)) = open.take() {
                    block.errors.push(lost(number, line.number));
                }
                if in_block {
                    block.ended = true;
                } else if blocks.is_empty() {
                    error(0, text.len(), "log::order", format!("{} before {}", form.end, form.begin));
                }
            }
            Ok(_) if !in_block => {
                error(
                    0,
                    text.len(),
                    "log::order",
                    format!("a point or an orientation outside of {} and {}", form.begin, form.end),
                );
            }
            Ok(Record::Orientation(angles)) => {
                if let Some((number, ..)) = open.take() {
                    block.errors.push(lost(number, line.number));
                }
                orientation = angles;
                orientations += 1;
            }
            Ok(Record::Nominal { number, point, normal }) => {
                if let Some((number, ..)) = open.replace((number, point, normal, line.number)) {
                    block.errors.push(lost(number, line.number));
                }
            }
            Ok(Record::Centre { number, point, radius }) => match open.take() {
                None => error(
                    0,
                    text.len(),
                    "log::order",
                    format!("the line {} N{number} is missing before this one", form.nominal),
                ),
                Some((expected, ..)) if expected != number => {
                    error(
                        0,
                        text.len(),
                        "log::order",
                        format!("the centre is of point N{number}, the nominal point before it is N{expected}"),
                    );
                }
                Some((_, nominal, normal, _)) => block.points.push(Point {
                    number,
                    orientation_deg: orientation,
                    orientation: orientations,
                    nominal,
                    normal,
                    centre: point,
                    radius_mm: radius,
                    line: line.number,
                }),
            },
        }
    }
    if let (Some((number, ..)), Some(block)) = (open, blocks.last_mut()) {
        let message = format!("the file ends behind the nominal point N{number}: it is cut off");
        let finding = Finding::warning("log::cut_line", message).help("the point is not used");
        block.errors.push(places.at_line(finding, block.last_line));
    }
    let errors = faults.drain("lines that are not understood", "log::not_understood");
    // what is wrong somewhere makes the whole file doubtful, as for the programs that these files are made for
    match blocks.first_mut() {
        Some(block) => block.errors.splice(0..0, errors).for_each(drop),
        None => blocks.extend((!errors.is_empty()).then_some(Block {
            errors,
            first_line: 1,
            last_line: 1,
            ..Block::default()
        })),
    }
    blocks
}

const WHOLE: &str = "a file that is not whole is not used: take it from the control again";
