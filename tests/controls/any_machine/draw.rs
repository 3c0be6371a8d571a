//! Machines that nobody wrote: a random serial five-axis chain, random errors on it, random touches.

use axiscal::axes::{AxisMap, AxisName};
use axiscal::diag::source;
use axiscal::machine::{self, Machine, Mounting, Side};
use axiscal::model::catalogue::Catalogue;
use axiscal::program::plan::{ControllerFrame, FORMAT, Plan, PlanBlock, PlanTouch};
use axiscal::simulate::{self, Scenario};
use nalgebra::{Unit, UnitQuaternion, Vector3};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

/// Lines of axes and reference points lie within so much of the origin, mm.
const WITHIN_MM: f64 = 200.0;

/// How the two rotary axes are shared between table and head.
const CHAINS: [&str; 3] = ["table/table", "head/table", "head/head"];

fn letter(axis: AxisName) -> Vector3<f64> {
    let mut v = Vector3::zeros();
    v[axis.index() % 3] = 1.0;
    v
}

/// A direction for an axis of this letter: square to the others or inclined by up to 50°, either way round.
fn direction(axis: AxisName, rng: &mut ChaCha8Rng) -> Vector3<f64> {
    let along = letter(axis);
    let mut line = along;
    if rng.random_bool(0.4) {
        let other = Vector3::from_fn(|_, _| rng.random_range(-1.0..1.0));
        let about = Unit::new_normalize(along.cross(&other) + 1e-3 * along.cross(&Vector3::new(0.3, 0.5, 0.7)));
        line = UnitQuaternion::from_axis_angle(&about, rng.random_range(10.0_f64..50.0).to_radians()) * along;
    }
    if rng.random_bool(0.3) { -line } else { line }
}

fn point(rng: &mut ChaCha8Rng) -> Vector3<f64> {
    Vector3::from_fn(|_, _| rng.random_range(-WITHIN_MM..WITHIN_MM))
}

fn list(v: &Vector3<f64>) -> String {
    format!("[{:?}, {:?}, {:?}]", v.x, v.y, v.z)
}

/// A machine, and which chain it is.
pub fn machine(rng: &mut ChaCha8Rng) -> (Machine, &'static str) {
    let chain = CHAINS[rng.random_range(0..CHAINS.len())];
    let mut letters = vec![AxisName::A, AxisName::B, AxisName::C];
    letters.remove(rng.random_range(0..3));
    if rng.random_bool(0.5) {
        letters.reverse();
    }
    // two axes that are nearly parallel are no five-axis machine
    let (first, second) = loop {
        let (a, b) = (direction(letters[0], rng), direction(letters[1], rng));
        if a.dot(&b).abs() < 25.0_f64.to_radians().cos() {
            break (a, b);
        }
    };
    let on_table = CHAINS.iter().position(|c| *c == chain).map_or(0, |i| 2 - i);
    let mut axes = String::new();
    let mut ends = ["base".to_owned(), "base".to_owned()];
    let mut put = |axes: &mut String, name: AxisName, on_tool: bool, more: &str| {
        let end = &mut ends[usize::from(on_tool)];
        *axes += &format!("[[machine.axis]]\nname = \"{name}\"\nparent = \"{end}\"\n{more}\n");
        *end = name.to_string();
    };
    for name in [AxisName::X, AxisName::Y, AxisName::Z] {
        let on_tool = rng.random_bool(0.5);
        let more = format!("kind = \"linear\"\ndirection = {}\nrange = [-3000.0, 3000.0]", list(&letter(name)));
        put(&mut axes, name, on_tool, &more);
    }
    let mut rotary = |axes: &mut String,
                      name: AxisName,
                      direction: &Vector3<f64>,
                      on_tool: bool,
                      rng: &mut ChaCha8Rng| {
        let range = [[-120.0, 120.0], [-360.0, 360.0], [0.0, 360.0], [-9999.0, 9999.0]][rng.random_range(0..4)];
        let more = format!(
            "kind = \"rotary\"\ndirection = {}\npoint = {}\nsense = {}\nrange = {range:?}\nindexing_repeatability_um = 0.0",
            list(direction),
            list(&point(rng)),
            if rng.random_bool(0.3) { -1 } else { 1 },
        );
        put(axes, name, on_tool, &more);
    };
    rotary(&mut axes, letters[0], &first, on_table == 0, rng);
    rotary(&mut axes, letters[1], &second, on_table < 2, rng);
    let [workpiece, tool] = ends;
    let (length, pivot) = (rng.random_range(150.0..300.0), 0.5 * point(rng));
    let ball = pivot - Vector3::z() * length;
    let carrier = if on_table == 0 { "table".to_owned() } else { letters[on_table - 1].to_string() };
    let origin: Vec<String> =
        ["X", "Y", "Z"].iter().map(|a| format!("{a} = {:?}", rng.random_range(-100.0..100.0))).collect();
    let rotary_origin: Vec<String> = letters.iter().map(|a| format!("{a} = 0.0")).collect();
    let probe = machine::BUILT_IN.split("[machine.probe]").nth(1).unwrap().split("[[").next().unwrap();
    let mut text = format!(
        "format = \"axiscal-machines/1\"\n[[machine]]\nname = \"drawn\"\nsays = \"{chain}\"\norigin = {{ {}, {} }}\n{axes}\
         [machine.workpiece]\nparent = \"{workpiece}\"\n[machine.tool]\nparent = \"{tool}\"\npivot = {}\n\
         direction = [0.0, 0.0, 1.0]\nlength = {length:?}\nspindle_sense = 1\n[machine.reference]\npivot = {}\nball = {}\n\
         table = {}\n[machine.probe]{probe}\n[[machine.mounting]]\nname = \"blocks\"\nsays = \"three blocks\"\n\
         carrier = \"{carrier}\"\nriser = {{ height = 60.0, size = [10.0, 10.0] }}\n",
        origin.join(", "),
        rotary_origin.join(", "),
        list(&pivot),
        list(&point(rng)),
        list(&ball),
        list(&point(rng)),
    );
    // apart from each other, so that none stands in another
    for (block, beside) in [("one", [-45.0, 0.0]), ("two", [30.0, 35.0]), ("three", [25.0, -40.0])] {
        let spot = Vector3::new(beside[0], beside[1], 0.0) + Vector3::from_fn(|_, _| rng.random_range(-15.0..15.0));
        let centre = ball + spot;
        text += &format!(
            "[[machine.mounting.block]]\nname = \"{block}\"\ncentre = {}\nsize = [10.0, 12.0, 14.0]\n",
            list(&centre)
        );
    }
    let machine = machine::load(&source("drawn", text)).unwrap().0.remove(0);
    (machine, chain)
}

/// Effects that a control may be able to carry, each with a chance: location errors always.
pub fn effects(machine: &Machine, catalogue: &Catalogue, positions: bool, rng: &mut ChaCha8Rng) -> Vec<String> {
    let mut out = Vec::new();
    for axis in machine.rotary() {
        let l = axis.name.to_string().to_lowercase();
        out.push(format!("location-{l}"));
        for (id, chance, is_position) in [
            // in the head a zero position is the same as an offset, with one stylus: seldom, to see that it is refused
            (format!("zero-{l}"), if axis.side == Side::Tool { 0.1 } else { 0.5 }, false),
            (format!("positioning-{l}-1"), 0.4, true),
            (format!("positioning-{l}-2"), 0.4, true),
            (format!("backlash-{l}"), 0.2, true),
        ] {
            if (positions || !is_position) && rng.random_bool(chance) {
                out.push(id);
            }
        }
    }
    for l in ["x", "y", "z"] {
        for (id, chance) in [(format!("scale-{l}"), 0.3), (format!("positioning-{l}-2"), 0.2)] {
            if positions && rng.random_bool(chance) {
                out.push(id);
            }
        }
    }
    out.retain(|id| catalogue.get(id, machine).is_some());
    out
}

/// Random values of the effects, as a scenario with this noise of a touch, µm.
pub fn scenario(
    machine: &Machine,
    catalogue: &Catalogue,
    effects: &[String],
    noise_um: f64,
    rng: &mut ChaCha8Rng,
) -> Scenario {
    let mut text = format!("seed = {}\n[noise]\ntouch_um = {noise_um:?}\n", rng.random_range(1..1_000_000));
    for id in effects {
        text += &format!("[effects.{id}]\n");
        for p in catalogue.get(id, machine).unwrap().parameters.iter().filter(|p| p.shape.is_none()) {
            let size = match p.unit.as_str() {
                "mm" => 0.05,
                "deg" => 0.01,
                _ => 3.0 * p.typical,
            };
            text += &format!("{} = {{ value = {:?}, unit = {:?} }}\n", p.name, rng.random_range(-size..size), p.unit);
        }
    }
    simulate::scenario::parse(&source("drawn", &text), machine).unwrap().0
}

/// Touches at random points of all faces at random poses within the ranges, blocks shifted by up to `shift_mm`.
pub fn program(
    machine: &Machine,
    frame: ControllerFrame,
    (n_poses, shift_mm): (usize, f64),
    rng: &mut ChaCha8Rng,
) -> Plan {
    let mounting: &Mounting = &machine.mountings[0];
    let carrier = mounting.carrier.to_string();
    let mut blocks: Vec<PlanBlock> = Vec::new();
    for b in &mounting.blocks {
        let centre = b.centre + Vector3::from_fn(|_, _| shift_mm * rng.random_range(-1.0..1.0));
        blocks.push(PlanBlock {
            name: b.name.clone(),
            carrier: carrier.clone(),
            mounting: None,
            form: b.form,
            centre: centre.into(),
            size: b.size.into(),
            diameter: b.diameter,
        });
    }
    let mut touches = Vec::new();
    for visit in 0..n_poses {
        let (mut pose, mut from) = (AxisMap::default(), AxisMap::default());
        for axis in machine.rotary() {
            // the first pose is home; endless axes are used for one turn
            let (low, high) = (axis.range[0].max(-180.0), axis.range[1].min(180.0));
            pose.set(axis.name, if visit == 0 { 0.0 } else { rng.random_range(low..high) });
            from.set(axis.name, if rng.random_bool(0.5) { 1.0 } else { -1.0 });
        }
        for block in &blocks {
            for side in 0..5 {
                let mut normal = Vector3::zeros();
                normal[side % 3] = if side < 3 { 1.0 } else { -1.0 };
                let mut point = Vector3::from(block.centre);
                for k in 0..3 {
                    let half = 0.5 * block.size[k];
                    point[k] += if normal[k] != 0.0 { half * normal[k] } else { rng.random_range(-0.6..0.6) * half };
                }
                let at = |off: f64| {
                    let ball = point + normal * (machine.probe.ball_radius + off);
                    let p = machine
                        .linear_for_ball(mounting.carrier, &pose.position(), &ball, machine.tool.length_mm)
                        .unwrap();
                    AxisMap::xyz(p.0[0], p.0[1], p.0[2])
                };
                touches.push(PlanTouch {
                    id: touches.len() as u64 + 1,
                    stage: "drawn".into(),
                    repeat: 1,
                    carrier: carrier.clone(),
                    mounting: None,
                    block: block.name.as_str().into(),
                    face: String::new(),
                    point: point.into(),
                    normal: normal.into(),
                    pose,
                    start: at(2.0),
                    nominal: at(0.0),
                    end: at(-2.0),
                    time_s: Some(20.0 * touches.len() as f64 + 30.0),
                    visit: Some(u32::try_from(visit).unwrap() + 1),
                    feed_mm_min: None,
                    spindle_deg: None,
                    tool_length_mm: None,
                    ball_radius_mm: None,
                    from,
                    first: false,
                });
            }
        }
    }
    Plan {
        format: FORMAT.into(),
        machine: machine.name.clone(),
        machine_sha256: String::new(),
        program: "drawn".into(),
        mounting: mounting.name.clone(),
        blocks_anew: false,
        controller_frame: frame,
        ball_radius_mm: machine.probe.ball_radius,
        tool_length_mm: machine.tool.length_mm,
        placement_tolerance_mm: None,
        find: None,
        blocks,
        touches,
        skipped: Vec::new(),
        notes: Vec::new(),
        programs: std::collections::BTreeMap::new(),
    }
}
