//! Points on spheres: one sphere is fitted to those of each pose, radius free, and its centre is used.

use super::at_line;
use crate::diag::{Failure, Finding, Result, Source};
use crate::geometry::sphere::{FittedSphere, algebraic, geometric};
use crate::log::centres::CentreRow;
use crate::post::as_written::LengthUnit;
use crate::units::mm_from_inch;
use nalgebra::Vector3;

/// A sphere that was fitted to the points of one pose.
#[derive(Debug, Clone)]
pub struct FittedGroup {
    pub sphere: String,
    /// The first line of its points.
    pub line: usize,
    pub n_points: usize,
    /// By least distances: what is used, mm.
    pub fitted: FittedSphere,
    /// How far the centre of the linear least squares is from it, mm: what many controls use.
    pub algebraic_off_mm: f64,
}

/// The fewest points through which a sphere of free radius goes.
const FEWEST: usize = 4;

/// Replaces the points of each pose by the centre of their sphere, in the unit of the file.
pub(super) fn fitted(
    rows: &[CentreRow],
    unit: LengthUnit,
    source: &Source,
) -> Result<(Vec<CentreRow>, Vec<FittedGroup>)> {
    let mm = |v: f64| if unit == LengthUnit::Inch { mm_from_inch(v) } else { v };
    let together = |a: &CentreRow, b: &CentreRow| a.sphere == b.sphere && a.run == b.run && a.rotary == b.rotary;
    let mut out = Vec::new();
    let mut groups = Vec::new();
    let mut wrong = Vec::new();
    for group in rows.chunk_by(together) {
        let Some(first) = group.first() else { continue };
        let points: Vec<Vector3<f64>> = group.iter().map(|r| r.xyz.map(mm)).collect();
        let fault = |message: String| {
            let finding = Finding::error("centres::points", message)
                .help("touch the sphere at its pole and at four points and more round it; write all points of one pose one after the other");
            at_line(source, first.line, finding)
        };
        if points.len() < FEWEST {
            wrong.push(fault(format!(
                "this pose has {} points: a sphere of unknown radius needs {FEWEST} and more",
                points.len()
            )));
            continue;
        }
        let (Some(fitted), Some((linear, _))) = (geometric(&points), algebraic(&points)) else {
            wrong.push(fault(format!(
                "the {} points of this pose determine no sphere: they are in one plane",
                points.len()
            )));
            continue;
        };
        let other_side = |(row, point): (&CentreRow, &Vector3<f64>)| {
            row.direction.filter(|d| d.dot(&(point - fitted.centre)) <= 0.0).map(|_| row.line)
        };
        if let Some(line) = group.iter().zip(&points).find_map(other_side) {
            let finding = Finding::error(
                "centres::direction",
                "the direction of this point looks into the sphere that fits the points of its pose",
            )
            .help("a direction goes from the sphere to the ball; or the point belongs to another pose");
            wrong.push(at_line(source, line, finding));
            continue;
        }
        let mean = |of: fn(&CentreRow) -> Option<f64>| {
            let all: Option<Vec<f64>> = group.iter().map(of).collect();
            all.map(|v| v.iter().sum::<f64>() / v.len() as f64)
        };
        out.push(CentreRow {
            xyz: if unit == LengthUnit::Inch { fitted.centre.map(crate::units::inch_from_mm) } else { fitted.centre },
            time_s: mean(|r| r.time_s),
            temperature_deg_c: mean(|r| r.temperature_deg_c),
            touch: None,
            direction: None,
            ..first.clone()
        });
        groups.push(FittedGroup {
            sphere: first.sphere.clone(),
            line: first.line,
            n_points: points.len(),
            fitted,
            algebraic_off_mm: (linear - fitted.centre).norm(),
        });
    }
    if wrong.is_empty() { Ok((out, groups)) } else { Err(Failure(wrong)) }
}
