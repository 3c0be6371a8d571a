//! Touches at random, for laws that hold at every pose.

use axiscal::axes::AxisMap;
use axiscal::machine::{Machine, Mounting};
use axiscal::program::plan::{ControllerFrame, FORMAT, Plan, PlanBlock, PlanTouch};
use nalgebra::Vector3;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

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
        let mut normal = Vector3::zeros();
        let side = rng.random_range(0..3);
        normal[side] = if rng.random_bool(0.5) { 1.0 } else { -1.0 };
        let mut point = block.centre;
        for k in 0..3 {
            let half = 0.5 * block.size[k];
            point[k] += if k == side { half * normal[k] } else { rng.random_range(-0.6..0.6) * half };
        }
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
        blocks,
        touches,
        skipped: Vec::new(),
        notes: Vec::new(),
        programs: std::collections::BTreeMap::new(),
    }
}
