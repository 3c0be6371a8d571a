//! Centres as plans and touches CSV: three touches each, of the planes through the nominal centre.

use super::place::Places;
use super::{Centre, CentresRequest, ConvertedRun};
use crate::axes::{AxisMap, AxisName, Position};
use crate::diag::{Failure, Result};
use crate::log::centres::Kind;
use crate::log::{Status, Touch, csv};
use crate::machine::{Form, Machine};
use crate::program::plan::{ControllerFrame, FORMAT, Plan, PlanBlock, PlanTouch};
use nalgebra::Vector3;
use std::collections::BTreeMap;

/// The search of a touch in the plan goes from this far off the centre to as far behind it, mm.
const SEARCH_MM: f64 = 2.0;

/// Edges of the body that stands for a centre, mm: no touch depends on them.
const EDGE_MM: f64 = 1.0;

const FACES: [&str; 3] = ["+X", "+Y", "+Z"];

/// One plan and one log for each run of the file.
pub(super) fn runs(
    machine: &Machine,
    places: &Places<'_>,
    centres: &[Centre],
    spheres: &[(String, Vector3<f64>)],
    request: &CentresRequest,
) -> Result<Vec<ConvertedRun>> {
    let mut numbers: Vec<Option<u64>> = centres.iter().map(|c| c.row.run).collect();
    numbers.sort_unstable();
    numbers.dedup();
    let several = numbers.len() > 1;
    let of_run = |number: Option<u64>| {
        let own: Vec<&Centre> = centres.iter().filter(|c| c.row.run == number).collect();
        let (touches, read) = touches(places, &own, spheres)?;
        let suffix = number.filter(|_| several).map_or_else(String::new, |n| format!("-run{n}"));
        let plan = Plan {
            format: FORMAT.to_owned(),
            machine: machine.name.clone(),
            machine_sha256: machine.sha256.clone(),
            program: format!("{}{suffix}", request.name),
            mounting: request.name.clone(),
            blocks_anew: false,
            controller_frame: ControllerFrame::Axes,
            ball_radius_mm: 0.0,
            tool_length_mm: places.length_mm,
            placement_tolerance_mm: None,
            find: None,
            blocks: blocks(places, &own, spheres),
            touches,
            skipped: Vec::new(),
            notes: vec!["made from sphere centres; each centre is three touches of the planes through it".to_owned()],
            programs: BTreeMap::new(),
        };
        let log = csv::write(machine, &read);
        Ok(ConvertedRun { number: number.filter(|_| several), plan, log })
    };
    numbers.into_iter().map(of_run).collect()
}

fn blocks(places: &Places<'_>, own: &[&Centre], spheres: &[(String, Vector3<f64>)]) -> Vec<PlanBlock> {
    let form = if places.kind == Kind::Reading { Form::Reading } else { Form::Centre };
    let is_here = |name: &str| own.iter().any(|c| c.row.sphere == name);
    let block = |(name, centre): &(String, Vector3<f64>)| PlanBlock {
        name: name.clone(),
        carrier: places.carrier.to_string(),
        mounting: None,
        form,
        centre: (*centre).into(),
        size: [EDGE_MM; 3],
        diameter: None,
    };
    spheres.iter().filter(|(name, _)| is_here(name)).map(block).collect()
}

/// The touches of a run, and what was read at each. Centres of one pose that follow each other are repeats of one point: those of
/// one plane stand together.
fn touches(
    places: &Places<'_>,
    own: &[&Centre],
    spheres: &[(String, Vector3<f64>)],
) -> Result<(Vec<PlanTouch>, Vec<Touch>)> {
    let together = |a: &&Centre, b: &&Centre| a.row.sphere == b.row.sphere && a.row.rotary == b.row.rotary;
    let (mut planned, mut read) = (Vec::new(), Vec::new());
    let mut before = 0_u64;
    let mut visit = 0;
    for group in own.chunk_by(together) {
        let Some(first) = group.first() else { continue };
        visit += 1;
        let Some((name, centre)) = spheres.iter().find(|(name, _)| *name == first.row.sphere) else { continue };
        let frame = Failure::new("centres::frame", "the linear axes of the machine do not span space")
            .help("check the directions of X, Y and Z in the machine file");
        let ball_places = places.machine.ball_places(places.carrier, &first.position, places.length_mm).ok_or(frame)?;
        let at = |ball: Vector3<f64>| {
            let p = ball_places.linear_for(&ball);
            AxisMap::xyz(p.x, p.y, p.z)
        };
        let pose = rotary_of(places.machine, &first.position);
        for (k, face) in FACES.into_iter().enumerate() {
            let mut normal = Vector3::zeros();
            normal[k] = 1.0;
            for (repeat, centre_row) in (1..).zip(group) {
                let id = before + 3 * u64::from(repeat - 1) + k as u64 + 1;
                planned.push(PlanTouch {
                    id,
                    stage: "centres".to_owned(),
                    repeat,
                    carrier: places.carrier.to_string(),
                    mounting: None,
                    block: name.clone(),
                    face: face.to_owned(),
                    point: (*centre).into(),
                    normal: normal.into(),
                    pose,
                    start: at(centre + normal * SEARCH_MM),
                    nominal: at(*centre),
                    end: at(centre - normal * SEARCH_MM),
                    time_s: centre_row.row.time_s,
                    visit: Some(visit),
                    feed_mm_min: None,
                    spindle_deg: None,
                    tool_length_mm: None,
                    ball_radius_mm: None,
                    from: AxisMap::default(),
                    first: false,
                });
                read.push(Touch {
                    id,
                    position: centre_row.position,
                    status: Status::Hit,
                    time_s: centre_row.row.time_s,
                    digit_mm: None,
                    temperature_deg_c: centre_row.row.temperature_deg_c,
                    line: centre_row.row.line,
                });
            }
        }
        before += 3 * group.len() as u64;
    }
    Ok((planned, read))
}

/// The machine's rotary axes.
fn rotary_of(machine: &Machine, position: &Position) -> AxisMap {
    AxisName::ALL
        .into_iter()
        .filter(|a| a.is_rotary() && machine.axis(*a).is_some())
        .fold(AxisMap::default(), |map, axis| map.with(axis, position.get(axis)))
}
