//! Inspection results on a part of one's own become a plan and a log: each nominal point is a touch of the plane through it.

use crate::axes::{AxisMap, AxisName};
use crate::diag::{Failure, Finding, Findings, Result, Source, source};
use crate::log::centres::line_range;
use crate::log::points::{self, Point, PointsForm, poses};
use crate::log::{Status, Touch, csv};
use crate::machine::{Carrier, Form, Machine};
use crate::program::plan::{ControllerFrame, FORMAT, Plan, PlanBlock, PlanTouch};
use nalgebra::Vector3;
use std::collections::{BTreeMap, BTreeSet};

/// What the caller says of the results.
#[derive(Debug, Clone)]
pub struct PartRequest {
    /// Name of the plan and of the mounting.
    pub name: String,
    pub carrier: Carrier,
    pub tool_length_mm: f64,
    /// Are the coordinates those of the part, whatever the orientation? `None`: as the points themselves show it.
    pub in_part: Option<bool>,
    /// Where the part's zero is with all axes at 0, in R, mm.
    pub zero_at_mm: [f64; 3],
}

/// Results as plan and log.
#[derive(Debug, Clone)]
pub struct ConvertedPart {
    pub plan: Plan,
    /// A touches CSV.
    pub log: String,
}

/// The search of a touch in the plan goes from this far off the contact to as far behind it, mm.
const SEARCH_MM: f64 = 2.0;

/// The body that stands for the part is at least so large, mm: no touch depends on it.
const EDGE_MM: f64 = 1.0;

/// Balls whose radii differ by less are one, mm.
const SAME_BALL_MM: f64 = 1e-9;

/// Makes a plan and a log of inspection results and of the poses that belong to their orientations.
///
/// # Errors
/// When a file is not usable, an orientation has no pose, or a point is far from where it should be.
pub fn convert(
    machine: &Machine,
    (bytes, name): (&[u8], &str),
    form: &PointsForm,
    poses_file: &Source,
    request: &PartRequest,
) -> Result<(ConvertedPart, Findings)> {
    let (read, findings) = points::parse(bytes, name, form, None)?;
    let poses = poses::read(poses_file, machine)?;
    let results = source(name, String::from_utf8_lossy(bytes));
    let at = |line: usize, finding: Finding| finding.at(&results, line_range(&results, line));
    let used: BTreeSet<usize> = read.points.iter().map(|p| p.orientation.max(1)).collect();
    if let Some(unused) = poses.keys().find(|record| !used.contains(record)) {
        let message = format!("record {unused} has a pose, and the results have no points for it");
        return Err(Failure::new("poses::unused", message)
            .help("orientations are counted from 1 in the order of the results, each line with one counts"));
    }
    let zero = Vector3::from(request.zero_at_mm);
    let in_part = request.in_part.unwrap_or_else(|| same_in_each(&read.points));
    let mut findings = findings;
    if request.in_part.is_none() && in_part {
        let message = "each orientation has the same nominal points: they are read as points of the part, whatever the orientation";
        findings
            .push(Finding::info("points::frame", message).help("--points-in turned turns them by their orientation"));
    }
    // as the part has them
    let points: Vec<Point> = read
        .points
        .iter()
        .map(|p| if in_part { Point { orientation_deg: [0.0; 3], ..p.clone() } } else { p.clone() })
        .collect();
    let ball_radius_mm = read.points.first().map_or(0.0, |p| p.radius_mm);
    let mut wrong = Vec::new();
    let (mut touches, mut logged) = (Vec::new(), Vec::new());
    for (id, p) in (1..).zip(&points) {
        let Some(pose) = poses.get(&p.orientation.max(1)) else {
            let message = format!("orientation {} of the results has no pose", p.orientation.max(1));
            let finding = Finding::error("poses::missing", message)
                .help("add a line for it to the file of --poses: its number and where the rotary axes were");
            wrong.push(at(p.line, finding));
            break;
        };
        let Some(places) = machine.ball_places(request.carrier, &pose.position(), request.tool_length_mm) else {
            return Err(Failure::new(
                "points::frame",
                format!("the linear axes of machine {:?} do not span space", machine.name),
            )
            .help("check the directions of X, Y and Z in the machine file"));
        };
        let normal = p.in_part(&p.normal).normalize();
        let point = p.in_part(&p.nominal) + zero;
        let ball = |off: f64| places.linear_for(&(point + normal * (p.radius_mm + off)));
        let found = places.linear_for(&(p.in_part(&p.centre) + zero));
        let off = (found - ball(0.0)).norm();
        if off > machine.probe.overtravel + machine.probe.placement_tolerance {
            let message =
                format!("the ball's centre is {off:.1} mm from where it should be for this nominal point and normal");
            let finding = Finding::error("points::far", message)
                .help("do the nominal points belong to this part, and does the normal look out of the material?");
            wrong.push(at(p.line, finding));
            continue;
        }
        let linear = |v: Vector3<f64>| AxisMap::xyz(v.x, v.y, v.z);
        touches.push(PlanTouch {
            id,
            stage: "part".to_owned(),
            repeat: 1,
            carrier: request.carrier.to_string(),
            mounting: None,
            block: "part".to_owned(),
            face: face_of(&normal),
            point: point.into(),
            normal: normal.into(),
            pose: *pose,
            start: linear(ball(SEARCH_MM)),
            nominal: linear(ball(0.0)),
            end: linear(ball(-SEARCH_MM)),
            time_s: None,
            visit: Some(u32::try_from(p.orientation.max(1)).unwrap_or(u32::MAX)),
            feed_mm_min: None,
            spindle_deg: None,
            tool_length_mm: None,
            ball_radius_mm: ((p.radius_mm - ball_radius_mm).abs() > SAME_BALL_MM).then_some(p.radius_mm),
            from: AxisMap::default(),
            first: false,
        });
        logged.push(Touch {
            id,
            position: pose.position().with_xyz_mm(found),
            status: Status::Hit,
            time_s: None,
            digit_mm: None,
            temperature_deg_c: None,
            line: p.line,
        });
    }
    if !wrong.is_empty() {
        return Err(Failure(wrong));
    }
    let plan = Plan {
        format: FORMAT.to_owned(),
        machine: machine.name.clone(),
        machine_sha256: machine.sha256.clone(),
        program: request.name.clone(),
        mounting: request.name.clone(),
        blocks_anew: false,
        controller_frame: ControllerFrame::Axes,
        ball_radius_mm,
        tool_length_mm: request.tool_length_mm,
        placement_tolerance_mm: None,
        find: None,
        blocks: vec![body(&points, &zero, request.carrier)],
        touches,
        skipped: Vec::new(),
        notes: vec!["made from inspection results of a part; each point is a touch of the plane through it".to_owned()],
        programs: BTreeMap::new(),
    };
    let log = csv::write(machine, &logged);
    findings.finish(ConvertedPart { plan, log })
}

/// Has each of several orientations the same nominal points?
fn same_in_each(points: &[Point]) -> bool {
    let groups: Vec<&[Point]> = points.chunk_by(|a, b| a.orientation == b.orientation).collect();
    let nominal = |group: &[Point]| group.iter().map(|p| (p.nominal, p.normal)).collect::<Vec<_>>();
    groups.len() > 1 && groups.windows(2).all(|pair| nominal(pair[0]) == nominal(pair[1]))
}

/// The box that holds all nominal points.
fn body(points: &[Point], zero: &Vector3<f64>, carrier: Carrier) -> PlanBlock {
    let at = |p: &Point| p.in_part(&p.nominal) + zero;
    let low = points.iter().map(at).reduce(|a, b| a.inf(&b)).unwrap_or_default();
    let high = points.iter().map(at).reduce(|a, b| a.sup(&b)).unwrap_or_default();
    PlanBlock {
        name: "part".to_owned(),
        carrier: carrier.to_string(),
        mounting: None,
        form: Form::Part,
        centre: ((low + high) / 2.0).into(),
        size: (high - low).map(|edge| edge.max(EDGE_MM)).into(),
        diameter: None,
    }
}

/// The direction that a normal is nearest to.
fn face_of(normal: &Vector3<f64>) -> String {
    let k = normal.iamax();
    let axis = [AxisName::X, AxisName::Y, AxisName::Z][k.min(2)];
    format!("{}{axis}", if normal[k] < 0.0 { '-' } else { '+' })
}
