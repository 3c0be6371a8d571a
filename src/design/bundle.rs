//! Bundles of touches that a further program may be made of: one block in one pose, and the program file of a choice.

use super::linearised_plan::{INDEX_S, STYLUS_S, TOUCH_S};
use super::vary::{faces_the_spindle, way_to_face};
use crate::axes::{AxisMap, AxisName, Position};
use crate::machine::{Block, Form, Machine, Mounting};
use crate::program::as_written::RingIn;
use crate::program::plan::{self, ControllerFrame, Plan, PlanBlock, PlanTouch};
use crate::program::ring_points;
use crate::program::spec::{Along, FORMAT, Face};
use crate::units::Plain;
use nalgebra::Vector3;
use std::collections::BTreeSet;
use std::fmt::Write as _;

/// Angles of an axis that swivels, deg.
pub const SWIVELS_DEG: [f64; 11] = [0.0, -90.0, -75.0, -60.0, -45.0, -30.0, -15.0, 20.0, 45.0, 75.0, 90.0];

/// The same with those at which most of an artefact is hidden.
pub const SWIVELS_WIDE_DEG: [f64; 15] =
    [0.0, -90.0, -75.0, -60.0, -45.0, -30.0, -15.0, 20.0, 45.0, 75.0, 90.0, -120.0, 120.0, 150.0, 180.0];

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

/// A point on what is round.
#[derive(Debug, Clone, PartialEq)]
pub struct RingTouch {
    /// As the plan calls it.
    pub label: String,
    pub azimuth_deg: f64,
    pub along: Along,
}

/// One block in one pose.
#[derive(Debug, Clone)]
pub struct Bundle {
    /// How.
    pub manner: Manner,
    /// The block's name.
    pub block: String,
    /// Its flat faces that are touched.
    pub faces: Vec<String>,
    /// Where it is touched on what is round.
    pub ring: Vec<RingTouch>,
    /// The touches, with axis positions.
    pub touches: Vec<PlanTouch>,
}

impl Bundle {
    /// Does it touch the same block in the same manner, be it at fewer points?
    #[must_use]
    pub fn is_of(&self, other: &Self) -> bool {
        self.block == other.block && self.manner == other.manner
    }
}

/// Every bundle of a mounting that the axes' ranges allow. Collisions are for the program's own proof.
#[must_use]
pub fn bundles(machine: &Machine, mounting: &Mounting, swivels_deg: &[f64]) -> Vec<Bundle> {
    let mut out = Vec::new();
    for manner in manners(machine, swivels_deg) {
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

/// The usual poses of a machine: all angles of each rotary axis within its range with all of the others.
#[must_use]
pub fn poses(machine: &Machine) -> Vec<AxisMap> {
    all_of(&angles(machine, &SWIVELS_DEG))
}

fn angles(machine: &Machine, swivels_deg: &[f64]) -> Vec<(AxisName, Vec<f64>)> {
    let of = |axis: &crate::machine::Axis| {
        let [low, high] = axis.range;
        let angles: &[f64] = if high - low >= 350.0 { &TURNS_DEG } else { swivels_deg };
        (axis.name, angles.iter().copied().filter(|x| (low..=high).contains(x)).collect())
    };
    machine.rotary().map(of).collect()
}

fn all_of(rotary: &[(AxisName, Vec<f64>)]) -> Vec<AxisMap> {
    let none = vec![AxisMap::default()];
    rotary.iter().fold(none, |poses, (name, angles)| {
        poses.iter().flat_map(|p| angles.iter().map(|x| p.with(*name, *x))).collect()
    })
}

/// Poses and ways to touch: all angles of each axis with all of the other, and the variations of the probe at a few.
fn manners(machine: &Machine, swivels_deg: &[f64]) -> Vec<Manner> {
    let rotary = angles(machine, swivels_deg);
    let poses = all_of(&rotary);
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

/// Azimuths of a ring, deg: five take neither a second nor a third lobe of probe or sphere for a place.
const AZIMUTHS_DEG: [f64; 5] = [0.0, 72.0, 144.0, 216.0, 288.0];

/// Height of a ring over the equator of a sphere, deg: above what its stem and the placement tolerance hide.
const ELEVATION_DEG: f64 = 15.0;

/// Rings on a cylinder and in a bore, in parts of its height from the upper end.
const DEPTHS: [f64; 2] = [0.3, 0.7];

/// The directions in which a sphere is touched count in the spindle's frame.
pub const SPHERE_IN: RingIn = RingIn::Tool;

fn bundle(machine: &Machine, manner: &Manner, block: &Block) -> Bundle {
    let at = manner.pose.position();
    let mut bundle = Bundle {
        manner: manner.clone(),
        block: block.name.clone(),
        faces: Vec::new(),
        ring: Vec::new(),
        touches: Vec::new(),
    };
    let flat: &[&str] = match block.form {
        Form::Box => &["+Z", "+X", "-X", "+Y", "-Y"],
        Form::Plane | Form::Cylinder => &["+Z"],
        _ => &[],
    };
    for word in flat {
        let Some(face) = Face::parse(word) else { continue };
        let normal = face.normal();
        if !faces_the_spindle(machine, block.carrier, &at, &normal) {
            continue;
        }
        let all: Option<Vec<PlanTouch>> =
            points(face, block).into_iter().map(|p| touch(machine, manner, block, word, (&p, &normal), &at)).collect();
        if let Some(all) = all {
            bundle.faces.push((*word).to_owned());
            bundle.touches.extend(all);
        }
    }
    if too_narrow(machine, block).is_some() {
        return bundle;
    }
    let turned = ring_points::to_carrier(machine, block, SPHERE_IN, &at);
    for (azimuth_deg, along) in ring(block) {
        let Ok(p) = ring_points::place(block, azimuth_deg, along, &turned) else { continue };
        if !faces_the_spindle(machine, block.carrier, &at, &p.normal) {
            continue;
        }
        if let Some(t) = touch(machine, manner, block, &p.label, (&p.point, &p.normal), &at) {
            bundle.ring.push(RingTouch { label: p.label, azimuth_deg, along });
            bundle.touches.push(t);
        }
    }
    bundle
}

/// The smallest diameter of a hole that the ball goes into with its clearance, mm, where this hole is narrower.
#[must_use]
pub fn too_narrow(machine: &Machine, block: &Block) -> Option<f64> {
    let least_mm = 2.0 * (machine.probe.ball_radius + machine.probe.clearance);
    (block.form == Form::Bore && block.diameter.unwrap_or_default() <= least_mm).then_some(least_mm)
}

/// Where a body that is round is touched: the pole first, which finds it.
fn ring(block: &Block) -> Vec<(f64, Along)> {
    let around = |along: Along| AZIMUTHS_DEG.into_iter().map(move |azimuth| (azimuth, along));
    match block.form {
        Form::Sphere => {
            std::iter::once((0.0, Along::Elevation(90.0))).chain(around(Along::Elevation(ELEVATION_DEG))).collect()
        }
        Form::Cylinder | Form::Bore => {
            // a tenth of a millimetre is fine enough to be read
            DEPTHS.iter().flat_map(|d| around(Along::Depth((d * block.size.z * 10.0).round() / 10.0))).collect()
        }
        _ => Vec::new(),
    }
}

/// Four points of the upper face, two of a side.
fn points(face: Face, block: &Block) -> Vec<Vector3<f64>> {
    let (n, (u, v)) = (face.normal(), face.tangents());
    // the end of a cylinder is no square: points within it
    let within = if block.form == Form::Cylinder { std::f64::consts::FRAC_1_SQRT_2 } else { 1.0 };
    let edge = |d: &Vector3<f64>| block.size.dot(&d.abs()) * if d.z == 0.0 { within } else { 1.0 };
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
    face: &str,
    (point, normal): (&Vector3<f64>, &Vector3<f64>),
    at: &Position,
) -> Option<PlanTouch> {
    let (probe, length_mm) = (&machine.probe, machine.tool.length_mm);
    let [start, nominal, end] =
        way_to_face(machine, block.carrier, at, (*point, *normal), probe.ball_radius, length_mm)?;
    Some(PlanTouch {
        id: 0,
        stage: "next".into(),
        repeat: 1,
        carrier: block.carrier.to_string(),
        mounting: None,
        block: block.name.as_str().into(),
        face: face.to_owned(),
        point: (*point).into(),
        normal: (*normal).into(),
        pose: manner.pose,
        start,
        nominal,
        end,
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

/// What is one visit of the rotary axes in the plan of a pool.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum VisitOf {
    /// Each bundle: each can be chosen alone.
    Bundle,
    /// All bundles in one manner: they are chosen together.
    Manner,
}

/// All bundles as the touches of one plan, in their order; `time_s` is when all of them are made: what drifts is not
/// stretched by the length of the pool.
#[must_use]
pub fn as_plan(machine: &Machine, mounting: &Mounting, bundles: &[Bundle], time_s: f64, visits: VisitOf) -> Plan {
    let mut touches = Vec::new();
    let mut visit = 0;
    for (i, bundle) in bundles.iter().enumerate() {
        let goes_on = i > 0 && bundles[i - 1].manner == bundle.manner && visits == VisitOf::Manner;
        visit += u32::from(!goes_on);
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
        find: None,
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
pub fn cost_s<'a>(chosen: impl IntoIterator<Item = &'a Bundle>) -> f64 {
    let mut manners: Vec<&Manner> = Vec::new();
    let mut styli: BTreeSet<&str> = BTreeSet::new();
    let mut seconds = 0.0;
    for b in chosen {
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
pub fn program_text(machine: &Machine, mounting: &Mounting, head: &Head, pool: &[Bundle], chosen: &[usize]) -> String {
    let Head { by, name, says, again, by_eye_mm } = head;
    let mut text = format!(
        "# chosen by `axiscal {by}`\nformat = \"{FORMAT}\"\nname = \"{name}\"\nmachine = {}\nsays = {}\nmounting = {}\nfaces_in = \"block\"\n",
        toml_edit::value(&machine.name),
        toml_edit::value(*says),
        toml_edit::value(&mounting.name)
    );
    if let Some(mm) = by_eye_mm {
        let _ = writeln!(text, "placement_tolerance = {mm:?}");
    }
    let mut shapes = Shapes::default();
    let mut body = String::new();
    let order = in_order(machine, pool, chosen);
    let mut stage: Option<Option<String>> = None;
    for (at, &i) in order.iter().enumerate() {
        let manner = &pool[i].manner;
        if stage.as_ref() != Some(&manner.stylus) {
            let word = stage_of(manner);
            let _ = write!(body, "\n[[stage]]\nname = \"{word}\"\nstylus = \"{word}\"\n");
            stage = Some(manner.stylus.clone());
        }
        let alike = |&&k: &&usize| touched_alike(mounting, &pool[k], &pool[i]);
        if order[..at].iter().any(|k| alike(&k)) {
            continue;
        }
        let together: Vec<&str> = order.iter().filter(alike).map(|&k| pool[k].block.as_str()).collect();
        body.push_str(&setup_text(mounting, &pool[i], &together, &mut shapes));
    }
    if !again.is_empty() {
        let _ =
            write!(body, "\n# the first poses once more: how well the machine repeats\n[[stage]]\nname = \"again\"\n");
        for &i in *again {
            body.push_str(&setup_text(mounting, &pool[i], &[&pool[i].block], &mut shapes));
        }
    }
    for (grid, n) in shapes.grids.iter().zip(1..) {
        let _ = write!(text, "\n[[grid]]\nname = \"G{n}\"\n{grid}\n");
    }
    for (ring, n) in shapes.rings.iter().zip(1..) {
        let _ = write!(text, "\n[[ring]]\nname = \"R{n}\"\n{ring}\n");
    }
    text + &body
}

/// What a program says of itself.
#[derive(Debug, Clone, Copy)]
pub struct Head<'a> {
    /// The verb that chose it.
    pub by: &'a str,
    pub name: &'a str,
    /// What it is for, in one line.
    pub says: &'a str,
    /// Bundles that are touched once more at the end.
    pub again: &'a [usize],
    /// The artefact is put down by eye within this.
    pub by_eye_mm: Option<f64>,
}

/// Grids and rings of a program, each once.
#[derive(Default)]
struct Shapes {
    grids: Vec<String>,
    rings: Vec<String>,
}

/// Number of a text in a list, from 1; it is added where it is missing.
fn number_in(list: &mut Vec<String>, text: String) -> usize {
    let at = list.iter().position(|t| *t == text).unwrap_or_else(|| {
        list.push(text);
        list.len() - 1
    });
    at + 1
}

/// Bundles by stylus, then by pose.
fn in_order(machine: &Machine, pool: &[Bundle], chosen: &[usize]) -> Vec<usize> {
    let mut order: Vec<usize> = chosen.to_vec();
    let angle = |i: usize, name: AxisName| pool[i].manner.pose.get(name).unwrap_or(0.0);
    order.sort_by(|&a, &b| {
        let key =
            |i: usize| (pool[i].manner.stylus.clone(), machine.rotary().map(|x| angle(i, x.name)).collect::<Vec<_>>());
        let ((sa, pa), (sb, pb)) = (key(a), key(b));
        let by_pose = pa.iter().zip(&pb).map(|(x, y)| x.total_cmp(y)).find(|o| o.is_ne());
        sa.cmp(&sb).then(by_pose.unwrap_or(std::cmp::Ordering::Equal)).then(a.cmp(&b))
    });
    order
}

/// Blocks in the same manner with the same points share a set-up.
fn touched_alike(mounting: &Mounting, a: &Bundle, b: &Bundle) -> bool {
    a.manner == b.manner && a.faces == b.faces && a.ring == b.ring && same_size(mounting, &a.block, &b.block)
}

fn setup_text(mounting: &Mounting, bundle: &Bundle, blocks: &[&str], shapes: &mut Shapes) -> String {
    let manner = &bundle.manner;
    let pose: Vec<String> = manner.pose.iter().map(|(a, x)| format!("{a} = {}", decimal(x))).collect();
    let from: Vec<String> = manner.from.iter().map(|(a, x)| format!("{a} = {x:.0}")).collect();
    let blocks: Vec<String> = blocks.iter().map(|b| toml_edit::value(*b).to_string()).collect();
    let block = mounting.blocks.iter().find(|b| b.name == bundle.block);
    let mut groups = Vec::new();
    for side in [false, true] {
        let faces: Vec<String> =
            bundle.faces.iter().filter(|f| f.ends_with('Z') != side).map(|f| format!("\"{f}\"")).collect();
        if faces.is_empty() {
            continue;
        }
        let round = block.is_some_and(|b| b.form.is_round());
        let share = if round { SHARE * std::f64::consts::FRAC_1_SQRT_2 } else { SHARE };
        let size = block.map_or_else(Vector3::zeros, |b| b.size);
        let [x, y] = [size.x, size.y].map(|e| Plain((e * share * 1e6).round() / 1e6).to_string());
        let spelled = if side {
            format!("u = [-{x}, {x}]\ndepth = [{DEPTH_MM}]")
        } else {
            format!("u = [-{x}, {x}]\nv = [-{y}, {y}]")
        };
        let n = number_in(&mut shapes.grids, spelled);
        groups.push(format!("{{ faces = [{}], grid = \"G{n}\" }}", faces.join(", ")));
    }
    let mut rest = &bundle.ring[..];
    while let Some(first) = rest.first() {
        let count = rest.iter().take_while(|r| r.along == first.along).count();
        let (one, others) = rest.split_at(count);
        rest = others;
        let azimuths: Vec<String> = one.iter().map(|r| decimal(r.azimuth_deg)).collect();
        let spelled = match first.along {
            Along::Elevation(deg) => format!(
                "directions_in = \"tool\"\nazimuth_deg = [{}]\nelevation_deg = [{}]",
                azimuths.join(", "),
                decimal(deg)
            ),
            Along::Depth(mm) => format!("azimuth_deg = [{}]\ndepth = [{}]", azimuths.join(", "), decimal(mm)),
        };
        let n = number_in(&mut shapes.rings, spelled);
        groups.push(format!("{{ ring = \"R{n}\" }}"));
    }
    format!(
        "\n[[stage.setup]]\npose = {{ {} }}\nfrom = {{ {} }}\nspindle_deg = {}\nfeed = {}\nblocks = [{}]\ntouch = [{}]\n",
        pose.join(", "),
        from.join(", "),
        decimal(manner.spindle_deg),
        decimal(manner.feed_mm_min),
        blocks.join(", "),
        groups.join(", ")
    )
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

/// Did a program's proof leave out this face of a bundle?
#[must_use]
pub fn is_skipped(b: &Bundle, face: &str, skipped: &[plan::Skipped]) -> bool {
    skipped
        .iter()
        .any(|s| s.stage == stage_of(&b.manner) && s.block == b.block && s.face == face && s.pose == b.manner.pose)
}

/// A pool without some faces, and which of its touches are left. `is_out`: number in the pool, bundle, face.
#[must_use]
pub fn without(pool: &[Bundle], is_out: impl Fn(usize, &Bundle, &str) -> bool) -> (Vec<Bundle>, Vec<usize>) {
    let (mut bundles, mut touches) = (Vec::new(), Vec::new());
    let mut at = 0;
    for (i, b) in pool.iter().enumerate() {
        let own: Vec<usize> = (0..b.touches.len()).filter(|k| !is_out(i, b, &b.touches[*k].face)).collect();
        if own.len() >= 3 {
            touches.extend(own.iter().map(|k| at + k));
            let mut left = b.clone();
            left.faces.retain(|face| !is_out(i, b, face));
            left.ring.retain(|r| !is_out(i, b, &r.label));
            left.touches = own.iter().map(|k| b.touches[*k].clone()).collect();
            bundles.push(left);
        }
        at += b.touches.len();
    }
    (bundles, touches)
}
