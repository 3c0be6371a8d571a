//! Every effect of the catalogue, planted in the virtual machine, against what the model predicts for it: the two share
//! no arithmetic and no formula, so that where they agree both are right.

mod common;
use axiscal::axes::AxisMap;
use axiscal::diag::source;
use axiscal::machine::{Machine, Mounting};
use axiscal::model::catalogue::{Catalogue, Effect};
use axiscal::model::data::{Run, assemble};
use axiscal::model::predict::Model;
use axiscal::program::plan::{ControllerFrame, FORMAT, Plan, PlanBlock, PlanTouch};
use axiscal::simulate;
use common::*;
use nalgebra::Vector3;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Touches of random faces at random poses, feeds, spindle angles, stylus lengths, senses and times.
fn random_plan(machine: &Machine, mounting: &Mounting, n_touches: usize, rng: &mut ChaCha8Rng) -> Plan {
    let carrier = mounting.carrier.to_string();
    let blocks = mounting.blocks.iter().map(|b| PlanBlock {
        name: b.name.clone(),
        carrier: carrier.clone(),
        mounting: None,
        centre: b.centre.into(),
        size: b.size.into(),
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
            pose.set(axis.name, rng.random_range(-80.0..80.0));
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
            block: block.name.clone(),
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
        controller_frame: ControllerFrame::Axes,
        ball_radius_mm: machine.probe.ball_radius,
        tool_length_mm: machine.tool.length_mm,
        placement_tolerance_mm: None,
        blocks,
        touches,
        skipped: Vec::new(),
        notes: Vec::new(),
    }
}

/// Random values of an effect's parameters, in their units: usual size, shape parameters in their range.
fn random_values(effect: &Effect, rng: &mut ChaCha8Rng) -> Vec<f64> {
    let draw = |p: &axiscal::model::catalogue::Parameter, rng: &mut ChaCha8Rng| match p.shape {
        Some((start, ..)) => start * rng.random_range(0.8..1.2),
        None => p.typical * rng.random_range(-1.0..1.0),
    };
    effect.parameters.iter().map(|p| draw(p, rng)).collect()
}

#[test]
fn what_is_planted_is_what_is_predicted() {
    let mut rng = ChaCha8Rng::seed_from_u64(5);
    let catalogue = Catalogue::built_in().unwrap();
    let mut unknown = Vec::new();
    for machine in machines() {
        let reference = machine.reference.pivot;
        for effect in catalogue.iter().filter(|e| e.applies_to(&machine) && !e.per_block) {
            for mounting in &machine.mountings {
                let plan = random_plan(&machine, mounting, 40, &mut rng);
                let theta = random_values(effect, &mut rng);
                let mut text = format!(
                    "[temperature]\nprofile = [[0.0, 19.0], [3.0, 24.0], [8.0, 21.0]]\n[effects.{}]\n",
                    effect.id
                );
                for (p, value) in effect.parameters.iter().zip(&theta) {
                    text += &format!("{} = {{ value = {value:?}, unit = {:?} }}\n", p.name, p.unit);
                }
                let scenario = match simulate::scenario::parse(&source("planted", &text), &machine) {
                    Ok((scenario, _)) => scenario,
                    Err(failure) => {
                        unknown.push(format!("{} on {}: {failure}", effect.id, machine.name));
                        continue;
                    }
                };
                let touches = touch(&machine, &plan, &scenario, None);
                let run = Run { plan: &plan, touches: &touches, mounting: None, started_s: None };
                let data = assemble(&machine, &[run]);
                let model = Model::new(&machine, &[effect], &data.set_ups, reference);
                let mut scratch = model.scratch();
                let zero = vec![0.0; theta.len()];
                let (mut largest, mut left) = (0.0_f64, 0.0_f64);
                for observation in &data.observations {
                    largest = largest.max(model.gap(observation, &zero, &mut scratch).abs());
                    left = left.max(model.gap(observation, &theta, &mut scratch).abs());
                }
                // to second order: what is left is a small part of the effect, or rounding
                let allowed = 1e-3 * largest + 1e-12;
                assert!(
                    left <= allowed,
                    "{} on {} ({}): {left:e} mm of {largest:e} mm left at the planted values",
                    effect.id,
                    machine.name,
                    mounting.name
                );
            }
        }
    }
    assert!(unknown.is_empty(), "the virtual machine cannot plant:\n{}", unknown.join("\n"));
}
