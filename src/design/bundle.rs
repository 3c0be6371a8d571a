//! Bundles of touches that a further program may be made of: one block in one pose, and the program file of a choice.

use super::linearised_plan::{INDEX_S, STYLUS_S, TOUCH_S};
use super::vary::faces_the_spindle;
use crate::axes::{AxisMap, AxisName, Position};
use crate::machine::{Block, Machine, Mounting};
use crate::program::plan::{self, ControllerFrame, Plan, PlanBlock, PlanTouch};
use crate::program::spec::{FORMAT, Face};
use crate::units::Plain;
use nalgebra::Vector3;
use std::collections::BTreeSet;
use std::fmt::Write as _;

/// Angles of an axis that swivels, deg.
const SWIVELS_DEG: [f64; 11] = [0.0, -90.0, -75.0, -60.0, -45.0, -30.0, -15.0, 20.0, 45.0, 75.0, 90.0];

/// Angles of an axis that turns all the way, deg: no common step.
const TURNS_DEG: [f64; 7] = [0.0, 45.0, 100.0, 160.0, 225.0, 270.0, 310.0];

/// Points of a face stand at this share of its edges from the centre.
const SHARE: f64 = 0.3;

/// Points of a side face stand this far below its upper edge, mm.
const DEPTH_MM: f64 = 3.5;

/// Faster touches: times the feed.
const FASTER: f64 = 4.0;

/// How a bundle is touched.
#[derive(Debug, Clone, PartialEq)]
pub struct Manner {
    /// Rotary axes, deg.
    pub pose: AxisMap,
    /// The sense in which they come there.
    pub from: AxisMap,
    /// Orientation of the spindle, deg.
    pub spindle_deg: f64,
    /// Feed of the measuring touch, mm/min.
    pub feed_mm_min: f64,
    /// A stylus of the machine's file; `None`: the probe's own.
    pub stylus: Option<String>,
}

/// One block in one pose.
#[derive(Debug, Clone)]
pub struct Bundle {
    /// How.
    pub manner: Manner,
    /// The block's name.
    pub block: String,
    pub faces: Vec<String>,
    /// The touches, with axis positions.
    pub touches: Vec<PlanTouch>,
}

/// Every bundle of a mounting that the axes' ranges allow. Collisions are for the program's own proof.
#[must_use]
pub fn bundles(machine: &Machine, mounting: &Mounting) -> Vec<Bundle> {
    let mut out = Vec::new();
    for manner in manners(machine) {
        let with_it = match &manner.stylus {
            None => Some(machine.clone()),
            Some(name) => machine.with_stylus(name),
        };
        let Some(with_it) = with_it else { continue };
        for block in &mounting.blocks {
            let bundle = bundle(&with_it, &manner, block);
            if bundle.touches.len() >= 3 {
                out.push(bundle);
            }
        }
    }
    out
}

/// Poses and ways to touch: all angles of each axis with all of the other, and the variations of the probe at a few.
fn manners(machine: &Machine) -> Vec<Manner> {
    let rotary: Vec<(AxisName, Vec<f64>)> = machine
        .rotary()
        .map(|a| {
            let [low, high] = a.range;
            let angles: &[f64] = if high - low >= 350.0 { &TURNS_DEG } else { &SWIVELS_DEG };
            (a.name, angles.iter().copied().filter(|x| (low..=high).contains(x)).collect())
        })
        .collect();
    let mut poses = vec![AxisMap::default()];
    for (name, angles) in &rotary {
        poses = poses.iter().flat_map(|p| angles.iter().map(|x| p.with(*name, *x))).collect();
    }
    let come = |sense: f64| rotary.iter().fold(AxisMap::default(), |m, (name, _)| m.with(*name, sense));
    let feed = machine.probe.slow_feed;
    let plain =
        |pose: &AxisMap| Manner { pose: *pose, from: come(1.0), spindle_deg: 0.0, feed_mm_min: feed, stylus: None };
    let mut out: Vec<Manner> = poses.iter().map(plain).collect();
    // one axis at a time away from 0: what the probe does differently is seen there already
    let away = |p: &AxisMap| p.iter().filter(|(_, x)| *x != 0.0).count();
    for pose in poses.iter().filter(|p| away(p) <= 1) {
        for spindle_deg in [90.0, 180.0] {
            out.push(Manner { spindle_deg, ..plain(pose) });
        }
        for (name, _) in &rotary {
            out.push(Manner { from: come(1.0).with(*name, -1.0), ..plain(pose) });
        }
        out.push(Manner { feed_mm_min: FASTER * feed, ..plain(pose) });
        for stylus in &machine.styli {
            out.push(Manner { stylus: Some(stylus.name.clone()), ..plain(pose) });
        }
    }
    out
}

fn bundle(machine: &Machine, manner: &Manner, block: &Block) -> Bundle {
    let at = manner.pose.position();
    let (mut faces, mut touches) = (Vec::new(), Vec::new());
    for word in ["+Z", "+X", "-X", "+Y", "-Y"] {
        let Some(face) = Face::parse(word) else { continue };
        if !faces_the_spindle(machine, block.carrier, &at, &face.normal()) {
            continue;
        }
        let all: Option<Vec<PlanTouch>> =
            points(face, block).into_iter().map(|p| touch(machine, manner, block, face, &p, &at)).collect();
        if let Some(all) = all {
            faces.push(word.to_owned());
            touches.extend(all);
        }
    }
    Bundle { manner: manner.clone(), block: block.name.clone(), faces, touches }
}

/// Four points of the upper face, two of a side.
fn points(face: Face, block: &Block) -> Vec<Vector3<f64>> {
    let (n, (u, v)) = (face.normal(), face.tangents());
    let edge = |d: &Vector3<f64>| block.size.dot(&d.abs());
    let centre = block.centre + n * (edge(&n) / 2.0);
    let across: Vec<f64> =
        if face.axis == 2 { vec![-SHARE * edge(&v), SHARE * edge(&v)] } else { vec![edge(&v) / 2.0 - DEPTH_MM] };
    [-SHARE, SHARE]
        .iter()
        .flat_map(|s| across.iter().map(|w| centre + u * (s * edge(&u)) + v * *w).collect::<Vec<_>>())
        .collect()
}

fn touch(
    machine: &Machine,
    manner: &Manner,
    block: &Block,
    face: Face,
    point: &Vector3<f64>,
    at: &Position,
) -> Option<PlanTouch> {
    let (probe, length_mm) = (&machine.probe, machine.tool.length_mm);
    let place = |off_face: f64| -> Option<AxisMap> {
        let ball = point + face.normal() * (probe.ball_radius + off_face);
        let at = machine.linear_for_ball(block.carrier, at, &ball, length_mm)?;
        let inside = |name: AxisName| {
            machine.axis(name).is_none_or(|axis| {
                let [low, high] = axis.program_range();
                (low..=high).contains(&at.get(name))
            })
        };
        let xyz = at.xyz_mm();
        [AxisName::X, AxisName::Y, AxisName::Z].into_iter().all(inside).then(|| AxisMap::xyz(xyz.x, xyz.y, xyz.z))
    };
    Some(PlanTouch {
        id: 0,
        stage: "next".into(),
        repeat: 1,
        carrier: block.carrier.to_string(),
        mounting: None,
        block: block.name.as_str().into(),
        face: face.to_string(),
        point: (*point).into(),
        normal: face.normal().into(),
        pose: manner.pose,
        start: place(probe.approach)?,
        nominal: place(0.0)?,
        end: place(-probe.search)?,
        time_s: None,
        visit: None,
        feed_mm_min: Some(manner.feed_mm_min),
        spindle_deg: Some(manner.spindle_deg),
        tool_length_mm: Some(length_mm),
        ball_radius_mm: Some(probe.ball_radius),
        from: manner.from,
        first: false,
    })
}

/// All bundles as the touches of one plan, in their order; `time_s` is when all of them are made: what drifts is not
/// stretched by the length of the pool.
#[must_use]
pub fn as_plan(machine: &Machine, mounting: &Mounting, bundles: &[Bundle], time_s: f64) -> Plan {
    let mut touches = Vec::new();
    for (bundle, visit) in bundles.iter().zip(1..) {
        for t in &bundle.touches {
            let id = touches.len() as u64 + 1;
            touches.push(PlanTouch { id, visit: Some(visit), time_s: Some(time_s), ..t.clone() });
        }
    }
    Plan {
        format: plan::FORMAT.into(),
        machine: machine.name.clone(),
        machine_sha256: machine.sha256.clone(),
        program: "pool".into(),
        mounting: mounting.name.clone(),
        blocks_anew: false,
        controller_frame: ControllerFrame::Axes,
        ball_radius_mm: machine.probe.ball_radius,
        tool_length_mm: machine.tool.length_mm,
        placement_tolerance_mm: None,
        blocks: mounting
            .blocks
            .iter()
            .map(|b| PlanBlock {
                name: b.name.clone(),
                carrier: b.carrier.to_string(),
                mounting: None,
                form: b.form,
                centre: b.centre.into(),
                size: b.size.into(),
                diameter: b.diameter,
            })
            .collect(),
        touches,
        skipped: Vec::new(),
        notes: Vec::new(),
        programs: std::collections::BTreeMap::new(),
    }
}

/// What a choice takes, s: touches, an index for each pose, changes of stylus.
#[must_use]
pub fn cost_s(pool: &[Bundle], chosen: &[usize]) -> f64 {
    let mut manners: Vec<&Manner> = Vec::new();
    let mut styli: BTreeSet<&str> = BTreeSet::new();
    let mut seconds = 0.0;
    for &i in chosen {
        let b = &pool[i];
        // a feed of its own slows or speeds the measuring stroke only: a touch is mostly way
        seconds += TOUCH_S * b.touches.len() as f64;
        if !manners.contains(&&b.manner) {
            manners.push(&b.manner);
            seconds += INDEX_S;
        }
        styli.extend(b.manner.stylus.as_deref());
    }
    seconds + STYLUS_S * styli.len() as f64
}

/// The program file of a choice: a stage for each stylus, the probe's own first; poses next to each other follow one
/// another.
#[must_use]
pub fn program_text(
    machine: &Machine,
    mounting: &Mounting,
    name: &str,
    says: &str,
    pool: &[Bundle],
    chosen: &[usize],
) -> String {
    let mut text = format!(
        "# chosen by `axiscal plan-next`\nformat = \"{FORMAT}\"\nname = \"{name}\"\nmachine = \"{}\"\nsays = {}\nmounting = \"{}\"\nfaces_in = \"block\"\n",
        machine.name,
        toml_edit::value(says),
        mounting.name
    );
    let mut order: Vec<usize> = chosen.to_vec();
    let angle = |i: usize, name: AxisName| pool[i].manner.pose.get(name).unwrap_or(0.0);
    order.sort_by(|&a, &b| {
        let key =
            |i: usize| (pool[i].manner.stylus.clone(), machine.rotary().map(|x| angle(i, x.name)).collect::<Vec<_>>());
        let ((sa, pa), (sb, pb)) = (key(a), key(b));
        let by_pose = pa.iter().zip(&pb).map(|(x, y)| x.total_cmp(y)).find(|o| o.is_ne());
        sa.cmp(&sb).then(by_pose.unwrap_or(std::cmp::Ordering::Equal)).then(a.cmp(&b))
    });
    let mut grids: Vec<String> = Vec::new();
    let mut body = String::new();
    let mut stage: Option<Option<String>> = None;
    let mut done: Vec<usize> = Vec::new();
    for &i in &order {
        if done.contains(&i) {
            continue;
        }
        let manner = &pool[i].manner;
        if stage.as_ref() != Some(&manner.stylus) {
            let word = stage_of(manner);
            let _ = write!(body, "\n[[stage]]\nname = \"{word}\"\nstylus = \"{word}\"\n");
            stage = Some(manner.stylus.clone());
        }
        // blocks in the same manner with the same faces share a set-up
        let together: Vec<usize> = order
            .iter()
            .copied()
            .filter(|&k| {
                pool[k].manner == *manner
                    && pool[k].faces == pool[i].faces
                    && same_size(mounting, &pool[k].block, &pool[i].block)
            })
            .collect();
        let pose: Vec<String> = manner.pose.iter().map(|(a, x)| format!("{a} = {}", decimal(x))).collect();
        let from: Vec<String> = manner.from.iter().map(|(a, x)| format!("{a} = {x:.0}")).collect();
        let blocks: Vec<String> = together.iter().map(|&k| format!("\"{}\"", pool[k].block)).collect();
        let grid = |side: bool, grids: &mut Vec<String>| -> String {
            let size = mounting.blocks.iter().find(|b| b.name == pool[i].block).map_or_else(Vector3::zeros, |b| b.size);
            let [x, y] = [size.x, size.y].map(|e| Plain((e * SHARE * 1e6).round() / 1e6).to_string());
            let spelled = if side {
                format!("u = [-{x}, {x}]\ndepth = [{DEPTH_MM}]")
            } else {
                format!("u = [-{x}, {x}]\nv = [-{y}, {y}]")
            };
            let n = grids.iter().position(|g| *g == spelled).unwrap_or_else(|| {
                grids.push(spelled);
                grids.len() - 1
            });
            format!("G{}", n + 1)
        };
        let quoted = |side: bool| -> Vec<String> {
            pool[i].faces.iter().filter(|f| f.ends_with('Z') != side).map(|f| format!("\"{f}\"")).collect()
        };
        let groups: Vec<String> = [false, true]
            .into_iter()
            .map(|side| (quoted(side), side))
            .filter(|(faces, _)| !faces.is_empty())
            .map(|(faces, side)| format!("{{ faces = [{}], grid = \"{}\" }}", faces.join(", "), grid(side, &mut grids)))
            .collect();
        let _ = write!(
            body,
            "\n[[stage.setup]]\npose = {{ {} }}\nfrom = {{ {} }}\nspindle_deg = {}\nfeed = {}\nblocks = [{}]\ntouch = [{}]\n",
            pose.join(", "),
            from.join(", "),
            decimal(manner.spindle_deg),
            decimal(manner.feed_mm_min),
            blocks.join(", "),
            groups.join(", ")
        );
        done.extend(together);
    }
    for (grid, n) in grids.iter().zip(1..) {
        let _ = write!(text, "\n[[grid]]\nname = \"G{n}\"\n{grid}\n");
    }
    text + &body
}

/// Stages are called after their stylus.
fn stage_of(manner: &Manner) -> &str {
    manner.stylus.as_deref().unwrap_or("own")
}

fn same_size(mounting: &Mounting, a: &str, b: &str) -> bool {
    let size = |name: &str| mounting.blocks.iter().find(|x| x.name == name).map(|x| x.size);
    size(a) == size(b)
}

/// A number as TOML wants a float.
fn decimal(x: f64) -> String {
    format!("{x:?}")
}

/// Touches that the program's proof left out: which of a bundle's faces must not be asked for again.
#[must_use]
pub fn without(pool: &[Bundle], skipped: &[plan::Skipped]) -> Vec<Bundle> {
    let is_out = |b: &Bundle, face: &str| {
        skipped
            .iter()
            .any(|s| s.stage == stage_of(&b.manner) && s.block == b.block && s.face == face && s.pose == b.manner.pose)
    };
    pool.iter()
        .filter_map(|b| {
            let mut left = b.clone();
            left.faces.retain(|f| !is_out(b, f));
            left.touches.retain(|t| left.faces.contains(&t.face));
            (left.touches.len() >= 3).then_some(left)
        })
        .collect()
}
