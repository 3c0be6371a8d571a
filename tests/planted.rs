//! Every effect of the catalogue, planted in the virtual machine, against what the model predicts for it: the two share
//! no arithmetic and no formula, so that where they agree both are right.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)] // a panic in a test is a failure with its place

mod common;
use axiscal::diag::source;
use axiscal::model::catalogue::{Catalogue, Effect};
use axiscal::model::data::{Run, assemble};
use axiscal::model::predict::Model;
use axiscal::simulate;
use common::random::random_plan;
use common::*;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

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
                let zero = vec![0.0; theta.len()];
                let (mut largest, mut left) = (0.0_f64, 0.0_f64);
                for observation in &data.observations {
                    largest = largest.max(model.gap(observation, &zero).abs());
                    left = left.max(model.gap(observation, &theta).abs());
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
