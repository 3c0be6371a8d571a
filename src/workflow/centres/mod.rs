//! Sphere centres that others have measured become a plan and a log, so that everything else sees an ordinary run: each centre is
//! three touches of the planes through it.

mod noise;
mod place;
mod points;
mod write;

pub use points::FittedGroup;

use crate::diag::{Failure, Finding, Findings, Result, Source};
use crate::log::centres::{self, CentreRow, Kind, Stated, line_range};
use crate::machine::{Carrier, Machine, Side};
use crate::program::plan::Plan;
use crate::workflow::new::Beside;
use nalgebra::Vector3;
use place::Places;

/// A file of centres, and what is to become of it.
#[derive(Debug, Clone)]
pub struct CentresRequest {
    /// What the caller says of the file.
    pub given: Stated,
    /// Name of the plan and of the mounting.
    pub name: String,
}

/// A run of a file as plan and log.
#[derive(Debug, Clone)]
pub struct ConvertedRun {
    /// Number of the run, where the file has several.
    pub number: Option<u64>,
    pub plan: Plan,
    /// A touches CSV.
    pub log: String,
}

/// A file of centres as plans and logs.
#[derive(Debug, Clone)]
pub struct Converted {
    pub runs: Vec<ConvertedRun>,
    /// What the study states beside them.
    pub beside: Beside,
    /// Spheres that were fitted to points; empty where the file has centres.
    pub fitted: Vec<FittedGroup>,
    pub kind: Kind,
    /// Rows, or fitted spheres.
    pub n_centres: usize,
    /// Poses among them.
    pub n_poses: usize,
    /// Names of the spheres with their estimated centres in the carrier's frame, mm.
    pub spheres: Vec<(String, Vector3<f64>)>,
    pub carrier: Carrier,
}

/// A centre with its place on the machine.
#[derive(Debug, Clone)]
struct Centre {
    row: CentreRow,
    /// Axis positions relative to R.
    position: crate::axes::Position,
}

/// Reads a file of centres or points and makes plans and logs of it.
///
/// # Errors
/// When the file is not usable, does not say what its numbers are, or does not fit the machine.
pub fn convert(machine: &Machine, source: &Source, request: &CentresRequest) -> Result<(Converted, Findings)> {
    let (file, mut findings) = centres::read(source)?;
    let stated = file.stated.clone().with(request.given.clone())?;
    axes_of(machine, &file, source)?;
    let (Some(unit), Some(kind)) = (stated.unit, stated.kind) else { return Err(not_stated(&stated, source)) };
    if file.of_points && kind == Kind::Reading {
        return Err(at_line(
            source,
            1,
            Finding::error("centres::kind", "a sphere cannot be fitted to readings: they are changes of one centre"),
        )
        .help("give positions (kind machine or workpiece), or remove the column touch")
        .into());
    }
    let carrier = carrier_of(machine, stated.carrier.as_deref())?;
    let (rows, fitted) =
        if file.of_points { points::fitted(&file.rows, unit, source)? } else { (file.rows.clone(), Vec::new()) };
    let places = Places::find(machine, carrier, &stated, (unit, kind), &rows, source, &mut findings)?;
    let centres = places.centres(&rows, source)?;
    let spheres = places.spheres(&centres, source)?;
    let beside_noise = noise::of(&centres, &stated, &fitted, source, &mut findings)?;
    let runs = write::runs(machine, &places, &centres, &spheres, request)?;
    let mut poses: Vec<[u64; 6]> = centres.iter().map(|c| c.row.rotary.position().0.map(f64::to_bits)).collect();
    poses.sort_unstable();
    poses.dedup();
    let shared = runs.len() > 1 && kind != Kind::Reading;
    findings.finish(Converted {
        n_centres: centres.len(),
        n_poses: poses.len(),
        runs,
        beside: Beside { mounting: shared.then(|| request.name.clone()), ..beside_noise },
        fitted,
        kind,
        spheres,
        carrier,
    })
}

/// A finding at a line of the file.
fn at_line(source: &Source, line: usize, finding: Finding) -> Finding {
    finding.at(source, line_range(source, line))
}

/// The machine's rotary axes and the file's columns belong together.
fn axes_of(machine: &Machine, file: &centres::CentresFile, source: &Source) -> Result<()> {
    let line = file.rows.first().map_or(1, |r| r.line.saturating_sub(1));
    if let Some(other) = file.rotary.iter().find(|a| machine.axis(**a).is_none()) {
        let message = format!("the file has a column {other}, and machine {:?} has no axis {other}", machine.name);
        let finding =
            Finding::error("centres::axes", message).help("name the machine that was measured, or remove the column");
        return Err(at_line(source, line, finding).into());
    }
    let missing: Vec<String> =
        machine.rotary().filter(|a| !file.rotary.contains(&a.name)).map(|a| a.name.to_string()).collect();
    if missing.is_empty() {
        return Ok(());
    }
    let list = missing.join(", ");
    let message = format!("the file has no column {list}, and machine {:?} has this axis", machine.name);
    let finding = Finding::error("centres::axes", message)
        .help(format!("add a column {list} with the position of the axis in each row; if it never moved, with the same value in all rows"));
    Err(at_line(source, line, finding).into())
}

/// Neither the file nor the caller says what the numbers are.
fn not_stated(stated: &Stated, source: &Source) -> Failure {
    let mut findings = Vec::new();
    if stated.unit.is_none() {
        let finding = Finding::error("centres::unit", "neither the file nor an option says the unit of X, Y and Z")
            .help("add the line `# unit = mm` (or inch) above the header line, or give --unit mm");
        findings.push(at_line(source, 1, finding));
    }
    if stated.kind.is_none() {
        let finding = Finding::error("centres::kind", "neither the file nor an option says what X, Y and Z are").help(
            "add the line `# kind = machine` above the header line (machine positions of the axes), or workpiece (coordinates under \
             the control's transformation), or reading (of an R-test, from an unknown zero); or give --kind",
        );
        findings.push(at_line(source, 1, finding));
    }
    Failure(findings)
}

/// What bears the sphere: as stated, or the last rotary axis of the workpiece side, or the table.
///
/// # Errors
/// When the stated one bears nothing.
pub fn carrier_of(machine: &Machine, stated: Option<&str>) -> Result<Carrier> {
    match stated {
        Some(word) => machine.carrier(word).filter(|c| *c != Carrier::Base).ok_or_else(|| {
            let axes: Vec<String> = machine.side(Side::Workpiece).map(|a| a.name.to_string()).collect();
            Failure::new("centres::carrier", format!("{word:?} does not carry a sphere on machine {:?}", machine.name))
                .help(format!("write table, or an axis of the workpiece side: {}", axes.join(", ")))
        }),
        None => {
            let last = machine.side(Side::Workpiece).filter(|a| a.name.is_rotary()).last();
            Ok(last.map_or(Carrier::Table, |a| Carrier::Axis(a.name)))
        }
    }
}
