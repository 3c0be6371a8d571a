//! Points of inspection results → touches of a plan: by number where number and nominal place agree, else by nominal place
//! and order. From the ball's centre in what bears the block the axis positions follow, at the plan's pose.

use super::{Point, Points, PointsForm};
use crate::axes::AxisName;
use crate::diag::{Failure, Finding, Findings, Result};
use crate::log::LogMistake;
use crate::log::finding_places::{Capped, Places};
use crate::log::matching::ranges;
use crate::log::origin_shift::common_shift;
use crate::log::touch::{RawTouch, Status};
use crate::machine::{Carrier, Machine};
use crate::program::plan::{Plan, PlanTouch};
use crate::units::mm_from_inch;
use nalgebra::Vector3;

/// Nominal points that are further apart (mm) are not the same: such files carry three to five decimals.
const SAME_POINT_MM: f64 = 0.05;
/// Normals whose difference is longer (rad, 0.6°) are not the same.
const SAME_NORMAL: f64 = 0.01;
/// A ball whose radius differs by more (mm) is another one: the file's is the calibrated one, pre-travel included.
const SAME_RADIUS_MM: f64 = 0.2;

/// Touches of the plan, with its numbers, and those that cannot be told apart. Axis positions, mm and deg; only X, Y, Z
/// are from the file, the rotary axes stand at the plan's pose.
///
/// # Errors
/// When no point of the file is one of the plan, or the machine's linear axes do not span space.
pub fn touches(
    machine: &Machine,
    plan: &Plan,
    points: &Points,
    form: &PointsForm,
    places: &Places<'_>,
) -> Result<(Vec<RawTouch>, Vec<u64>, Findings)> {
    let mut findings = Findings::default();
    let (pairs, unclear) = pair(plan, &points.points, places, &mut findings);
    if pairs.is_empty() && unclear.is_empty() {
        // that says it all: not each point on its own
        return Err(none_fits(plan, &points.points, form, places).into());
    }
    let mut out = Vec::with_capacity(pairs.len());
    let mut other_ball = Capped::few();
    for (point, planned) in pairs {
        let radius = planned.ball_radius_mm.unwrap_or(plan.ball_radius_mm);
        if (point.radius_mm - radius).abs() > SAME_RADIUS_MM {
            other_ball.push(|| {
                let message = format!("the ball has the radius {:.3} mm, the plan says {radius:.3}", point.radius_mm);
                places.at_line(
                    Finding::warning("log::ball_radius", message)
                        .help("is it the plan's stylus? the unit the right one?"),
                    point.line,
                )
            });
        }
        out.push(touch(machine, plan, point, planned)?);
    }
    findings.0.extend(other_ball.drain("points with another ball", "log::ball_radius"));
    findings.push(
        Finding::info("log::centres", "such a file holds centres of the ball as the control computed them")
            .help("rotary axes are taken from the plan; times, missed touches and what the control's own transformation added are not in the file"),
    );
    Ok((out, unclear, findings))
}

fn touch(machine: &Machine, plan: &Plan, point: &Point, planned: &PlanTouch) -> Result<RawTouch> {
    let carrier = machine.carrier(&planned.carrier).unwrap_or(Carrier::Table);
    let length = planned.tool_length_mm.unwrap_or(plan.tool_length_mm);
    let centre = point.in_part(&point.centre);
    let position = machine.linear_for_ball(carrier, &planned.nominal_position(), &centre, length).ok_or_else(|| {
        Failure::new("log::frame", format!("the linear axes of machine {} do not span space", machine.name))
            .help("check the directions of X, Y and Z in machines.toml")
    })?;
    let mut present = [false; 6];
    [AxisName::X, AxisName::Y, AxisName::Z].into_iter().for_each(|a| present[a.index()] = true);
    Ok(RawTouch {
        id: Some(planned.id),
        position,
        present,
        status: Status::Hit,
        time_s: None,
        temperature_deg_c: None,
        line: point.line,
    })
}

fn same(point: &Point, planned: &PlanTouch) -> bool {
    (point.in_part(&point.nominal) - Vector3::from(planned.point)).norm() <= SAME_POINT_MM
        && (point.in_part(&point.normal) - Vector3::from(planned.normal)).norm() <= SAME_NORMAL
}

/// Each point with its touch, and the touches of which a point is there but not clear.
fn pair<'a>(
    plan: &'a Plan,
    points: &'a [Point],
    places: &Places<'_>,
    findings: &mut Findings,
) -> (Vec<(&'a Point, &'a PlanTouch)>, Vec<u64>) {
    let numbered = plan.numbered();
    let by_number = |p: &'a Point| numbered.touch(p.number).filter(|t| same(p, t)).map(|t| (p, t));
    if let Some(pairs) = points.iter().map(by_number).collect::<Option<Vec<_>>>() {
        return (pairs, Vec::new());
    }
    // one place may be touched again and again, at other poses too: only equal counts can be shared out, in order
    let mut pairs: Vec<(&Point, &PlanTouch)> = Vec::new();
    let mut unclear = Vec::new();
    let mut elsewhere = Capped::few();
    let mut doubtful = Capped::few();
    let mut done = vec![false; points.len()];
    for (i, point) in points.iter().enumerate() {
        if done[i] {
            continue;
        }
        let planned: Vec<&PlanTouch> = plan.touches.iter().filter(|t| same(point, t)).collect();
        if planned.is_empty() {
            elsewhere.push(|| {
                let message = format!("point N{} is no nominal point of the plan; it is not used", point.number);
                places.at_line(Finding::warning("log::unmatched", message), point.line)
            });
            continue;
        }
        let alike: Vec<usize> =
            (i..points.len()).filter(|k| !done[*k] && planned.first().is_some_and(|t| same(&points[*k], t))).collect();
        alike.iter().for_each(|k| done[*k] = true);
        if alike.len() == planned.len() {
            pairs.extend(alike.iter().map(|k| &points[*k]).zip(planned));
        } else {
            let ids: Vec<u64> = planned.iter().map(|t| t.id).collect();
            unclear.extend(&ids);
            doubtful.push(|| {
                let message = format!(
                    "{} points are at the planned position of {} touches ({}): they cannot be assigned and are not used",
                    alike.len(),
                    planned.len(),
                    ranges(&ids)
                );
                places.at_line(Finding::warning("log::ambiguous", message), point.line)
            });
        }
    }
    findings.0.extend(elsewhere.drain("points that are not the plan's", "log::unmatched"));
    findings.0.extend(doubtful.drain("places that are not clear", "log::ambiguous"));
    (pairs, unclear)
}

/// Why no point is the plan's: the nearest nominal point, or the wrong unit.
fn none_fits(plan: &Plan, points: &[Point], form: &PointsForm, places: &Places<'_>) -> Finding {
    let line = points.first().map_or(1, |p| p.line);
    let inches = points.iter().filter(|p| {
        let big = Point { nominal: p.nominal.map(mm_from_inch), ..(*p).clone() };
        plan.touches.iter().any(|t| same(&big, t))
    });
    if inches.count() * 2 > points.len() {
        let message = "no point of the file is one of the plan; read as inches most would be".to_owned();
        let help = format!(
            "copy the form (`axiscal controllers show {}`), write unit = \"inch\" and name that file",
            form.name
        );
        return places.at_line(Finding::error("log::swapped", message).help(help), line);
    }
    if let Some(by_mm) = shift(plan, points) {
        let shift = LogMistake::Shift { by_mm, inches: false };
        let message = format!("no point of the file is one of the plan; most would be if {}", shift.says());
        return places.at_line(Finding::error("log::swapped", message).help(OTHER_ZERO), line);
    }
    let distance = |p: &Point, t: &PlanTouch| (p.in_part(&p.nominal) - Vector3::from(t.point)).norm();
    let nearest = points
        .iter()
        .flat_map(|p| plan.touches.iter().map(move |t| (distance(p, t), p, t)))
        .min_by(|a, b| a.0.total_cmp(&b.0));
    let message = match nearest {
        Some((d, p, t)) => format!(
            "no point of the file is one of the plan: the nearest are point N{} and touch {}, {d:.3} mm apart",
            p.number, t.id
        ),
        None => "no point of the file is one of the plan".to_owned(),
    };
    places.at_line(Finding::error("log::other_plan", message), line).help(OTHER_ZERO)
}

const OTHER_ZERO: &str = "the file's zero must be the origin of R (where the ball's carrier frame lies), its nominal points those of the plan";

/// The shift with which most nominal points of the file are the plan's.
fn shift(plan: &Plan, points: &[Point]) -> Option<Vector3<f64>> {
    let found: Vec<Vector3<f64>> = points.iter().map(|p| p.in_part(&p.nominal)).collect();
    let normals: Vec<Vector3<f64>> = points.iter().map(|p| p.in_part(&p.normal)).collect();
    let planned: Vec<Vector3<f64>> = plan.touches.iter().map(|t| Vector3::from(t.point)).collect();
    let alike = |i: usize, j: usize| (normals[i] - Vector3::from(plan.touches[j].normal)).norm() <= SAME_NORMAL;
    let lies = |i: usize, by: &Vector3<f64>| {
        (0..planned.len()).find(|j| alike(i, *j) && (found[i] - by - planned[*j]).norm() <= SAME_POINT_MM)
    };
    common_shift(&found, &planned, &alike, &lies)
}
