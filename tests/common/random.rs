//! Touches at random, for laws that hold at every pose.

use axiscal::axes::AxisMap;
use axiscal::machine::{Block, Form, Machine, Mounting};
use axiscal::program::plan::{ControllerFrame, FORMAT, Plan, PlanBlock, PlanTouch};
use axiscal::program::ring_points;
use axiscal::program::spec::Along;
use nalgebra::{Rotation3, Vector3};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

/// A point of a body, and its normal.
fn random_point(block: &Block, rng: &mut ChaCha8Rng) -> (Vector3<f64>, Vector3<f64>) {
    let ends = block.form == Form::Cylinder && rng.random_bool(0.3);
    if block.form.is_round() && !ends {
        let along = match block.form {
            Form::Sphere => Along::Elevation(rng.random_range(-60.0..90.0)),
            _ => Along::Depth(rng.random_range(0.2..0.8) * block.size.z),
        };
        let p = ring_points::place(block, rng.random_range(0.0..360.0), along, &Rotation3::identity()).unwrap();
        return (p.point, p.normal);
    }
    let mut normal = Vector3::zeros();
    let side = if block.form == Form::Box { rng.random_range(0..3) } else { 2 };
    let up = block.form != Form::Box || rng.random_bool(0.5);
    normal[side] = if up { 1.0 } else { -1.0 };
    let mut point = block.centre;
    for k in 0..3 {
        let half = 0.5 * block.size[k];
        point[k] += if k == side { half * normal[k] } else { rng.random_range(-0.6..0.6) * half };
    }
    (point, normal)
}

/// A mounting with a sphere, a pin, a ring and a plane where its blocks stand.
pub fn of_other_forms(mounting: &Mounting) -> Mounting {
    let mut out = mounting.clone();
    let forms = [Form::Sphere, Form::Cylinder, Form::Bore, Form::Plane];
    let first = out.blocks[0].clone();
    out.blocks = forms
        .iter()
        .enumerate()
        .map(|(i, form)| {
            let mut b = first.clone();
            (b.name, b.form) = (form.as_str().to_owned(), *form);
            b.centre += Vector3::new(60.0 * i as f64, 0.0, 0.0);
            (b.size, b.diameter) = match form {
                Form::Sphere => (Vector3::repeat(25.0), Some(25.0)),
                Form::Cylinder => (Vector3::new(20.0, 20.0, 30.0), Some(20.0)),
                Form::Bore => (Vector3::new(50.0, 50.0, 20.0), Some(36.0)),
                _ => (Vector3::new(40.0, 40.0, 10.0), None),
            };
            b
        })
        .collect();
    out
}

/// Touches of random faces at random poses, feeds, spindle angles, stylus lengths, senses and times.
pub fn random_plan(machine: &Machine, mounting: &Mounting, n_touches: usize, rng: &mut ChaCha8Rng) -> Plan {
    let carrier = mounting.carrier.to_string();
    let blocks = mounting.blocks.iter().map(|b| PlanBlock {
        name: b.name.clone(),
        carrier: carrier.clone(),
        mounting: None,
        form: b.form,
        centre: b.centre.into(),
        size: b.size.into(),
        diameter: b.diameter,
    });
    let blocks: Vec<PlanBlock> = blocks.collect();
    let mut touches = Vec::new();
    for i in 0..n_touches {
        let block = &mounting.blocks[rng.random_range(0..mounting.blocks.len())];
        let (point, normal) = random_point(block, rng);
        let mut pose = AxisMap::default();
        let mut from = AxisMap::default();
        for axis in machine.rotary() {
            let [low, high] = axis.range;
            pose.set(axis.name, rng.random_range(low.max(-80.0)..high.min(80.0)));
            from.set(axis.name, if rng.random_bool(0.5) { 1.0 } else { -1.0 });
        }
        let length_mm = machine.tool.length_mm + [0.0, 60.0][i % 2];
        let at = |off: f64| {
            let ball = point + normal * (machine.probe.ball_radius + off);
            let p = machine.linear_for_ball(mounting.carrier, &pose.position(), &ball, length_mm).unwrap();
            AxisMap::xyz(p.0[0], p.0[1], p.0[2])
        };
        touches.push(PlanTouch {
            id: i as u64 + 1,
            stage: "random".into(),
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
            time_s: Some(600.0 * i as f64 + 30.0),
            visit: None,
            feed_mm_min: Some([30.0, 60.0, 200.0][i % 3]),
            spindle_deg: Some(45.0 * (i % 8) as f64),
            tool_length_mm: Some(length_mm),
            ball_radius_mm: None,
            from,
            first: false,
        });
    }
    Plan {
        format: FORMAT.into(),
        machine: machine.name.clone(),
        machine_sha256: String::new(),
        program: "random".into(),
        mounting: mounting.name.clone(),
        blocks_anew: false,
        controller_frame: ControllerFrame::Axes,
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
