//! Every effect of the catalogue, planted in the virtual machine, against what the model predicts for it: the two share
//! no arithmetic and no formula, so that where they agree both are right.

use crate::common;
use axiscal::diag::source;
use axiscal::machine::{Machine, Mounting};
use axiscal::model::catalogue::{Catalogue, Effect, Parameter};
use axiscal::model::data::{Run, assemble_with_spindle};
use axiscal::model::predict::{Model, SetUp};
use axiscal::model::spindle::SpindleStretch;
use axiscal::model::surface::Body;
use axiscal::simulate::{self, Scenario};
use common::more_machines::all_machines;
use common::random::{of_other_forms, random_plan};
use common::*;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::collections::BTreeMap;

/// Parameters that leave no trace on any machine, each with the reason.
const WITHOUT_TRACE: [(&str, &str, &str); 3] = [
    ("reading-zero", "RX", "of a sensor's readings, which no probe makes: tests/controls/centres.rs"),
    ("reading-zero", "RY", "the same"),
    ("reading-zero", "RZ", "the same"),
];

/// A random value of a parameter, in its unit: usual size, shape parameters in their range.
fn random_value(effect: &Effect, p: &Parameter, rng: &mut ChaCha8Rng) -> f64 {
    match p.shape {
        // a place may lie on either side of nothing
        Some((0.0, low, high)) => rng.random_range(low..high) / 4.0,
        Some((start, ..)) => start * rng.random_range(0.8..1.2),
        // a supposition is planted as a trace: at its full size no touch would meet its face
        None if effect.discrete => 1e-4 * rng.random_range(-1.0..1.0),
        None => p.typical * rng.random_range(0.3..1.0) * if rng.random_bool(0.5) { 1.0 } else { -1.0 },
    }
}

/// When the spindle ran, s and rpm: before the first touch, with pauses, at two speeds, and once when no touch is made any more.
const SPINDLE: [[f64; 3]; 4] =
    [[-900.0, 300.0, 8000.0], [3000.0, 7200.0, 12000.0], [7200.0, 9000.0, 4000.0], [90_000.0, 91_000.0, 12000.0]];

/// The scenario of an effect: in `[effects]`, or for the set-up of blocks, which has values for each, in `[[block]]`.
fn scenario_text(effect: &Effect, mounting: &Mounting, set_ups: &[SetUp], theta: &[f64]) -> String {
    let mut text = if effect.id == "spindle-growth" { format!("spindle = {SPINDLE:?}\n") } else { String::new() };
    text += "[temperature]\nprofile = [[0.0, 19.0], [3.0, 24.0], [8.0, 21.0]]\n";
    let set_ups: Vec<&SetUp> = set_ups.iter().filter(|s| effect.of.is_empty() || effect.of.contains(&s.body)).collect();
    if effect.nuisance && effect.per_block {
        for (set_up, own) in set_ups.iter().zip(theta.chunks(effect.parameters.len())) {
            let name = set_up.label.rsplit('/').next().unwrap();
            let mut six = [0.0; 6];
            for (p, value) in effect.parameters.iter().zip(own) {
                let at = ["SX", "SY", "SZ", "SA", "SB", "SC"].iter().position(|n| *n == p.name);
                six[at.unwrap_or(2)] = *value;
            }
            text += &format!(
                "[[block]]\nmounting = {:?}\nname = {name:?}\nshift = {:?}\ntilt = {:?}\n",
                mounting.name,
                &six[..3],
                &six[3..]
            );
        }
        return text;
    }
    text += &format!("[effects.{}]\n", effect.id);
    // what blocks have for themselves is given for each of them
    let blocks: Vec<Option<&SetUp>> =
        if effect.per_block { set_ups.into_iter().map(Some).collect() } else { vec![None] };
    for (block, own) in blocks.iter().zip(theta.chunks(effect.parameters.len())) {
        for (p, value) in effect.parameters.iter().zip(own) {
            let name = block.map_or_else(|| p.name.clone(), |b| format!("{}@{}", p.name, b.label));
            text += &format!("{name:?} = {{ value = {value:?}, unit = {:?} }}\n", p.unit);
        }
    }
    text
}

/// What was found when an effect was planted.
struct Found {
    /// The largest that the effect is at a touch, mm.
    largest_mm: f64,
    /// The largest gap that is left at the planted values, mm.
    left_mm: f64,
    /// The largest that each parameter alone does, mm.
    alone_mm: Vec<f64>,
}

/// Name of the mounting with other forms than boxes.
const OTHER_FORMS: &str = "other forms";

/// The machine with one more mounting, of other forms.
fn with_other_forms(machine: &Machine) -> Machine {
    let mut out = machine.clone();
    let mut mounting = of_other_forms(&out.mountings[0]);
    mounting.name = OTHER_FORMS.to_owned();
    out.mountings.push(mounting);
    out
}

fn plant(machine: &Machine, mounting: &Mounting, effect: &Effect, rng: &mut ChaCha8Rng) -> Result<Found, String> {
    let plan = random_plan(machine, mounting, 40, rng);
    // an errorless run says which blocks there are
    let touches = touch(machine, &plan, &Scenario::flawless(), None);
    let run = |touches| Run { plan: &plan, touches, mounting: Some(mounting.name.as_str()), started_s: Some(0.0) };
    // what a later run has for itself is planted in the second of two, on the same blocks
    let flawless = touches.clone();
    let runs = |touches| {
        let first = effect.per_run.then(|| run(&flawless));
        let all: Vec<Run> = first.into_iter().chain([run(touches)]).collect();
        let stretch = |&[from_s, to_s, rpm]: &[f64; 3]| SpindleStretch { from_s, to_s, rpm };
        let spindle: Vec<SpindleStretch> =
            SPINDLE.iter().filter(|_| effect.id == "spindle-growth").map(stretch).collect();
        assemble_with_spindle(machine, &all, &spindle)
    };
    let set_ups = runs(&touches).set_ups;
    let has = |s: &&SetUp| effect.of.is_empty() || effect.of.contains(&s.body);
    let n_sets = if effect.per_block { set_ups.iter().filter(has).count() } else { 1 };
    let parameters: Vec<&Parameter> = (0..n_sets).flat_map(|_| &effect.parameters).collect();
    let theta: Vec<f64> = parameters.iter().map(|p| random_value(effect, p, rng)).collect();
    let text = scenario_text(effect, mounting, &set_ups, &theta);
    let (scenario, _) = simulate::scenario::parse(&source("planted", &text), machine).map_err(|e| e.to_string())?;
    let touches = touch(machine, &plan, &scenario, None);
    let data = runs(&touches);
    assert_eq!(data.set_ups, set_ups);
    let model = Model::new(machine, &[effect], &data.set_ups, machine.reference.pivot);
    // without the effect: its parameters are zero, but those inside its formulas stay
    let without: Vec<f64> =
        parameters.iter().zip(&theta).map(|(p, &v)| if p.shape.is_some() { v } else { 0.0 }).collect();
    let mut found = Found { largest_mm: 0.0, left_mm: 0.0, alone_mm: vec![0.0; effect.parameters.len()] };
    for observation in &data.observations {
        let bare = model.gap(observation, &without);
        found.largest_mm = found.largest_mm.max(bare.abs());
        found.left_mm = found.left_mm.max(model.gap(observation, &theta).abs());
        for (i, p) in parameters.iter().enumerate() {
            let mut alone = if p.shape.is_some() { theta.clone() } else { without.clone() };
            alone[i] = if p.shape.is_some() { 0.5 * theta[i] } else { theta[i] };
            let from = if p.shape.is_some() { &theta } else { &without };
            let does = model.gap(observation, &alone) - model.gap(observation, from);
            let slot = &mut found.alone_mm[i % effect.parameters.len()];
            *slot = slot.max(does.abs());
        }
    }
    Ok(found)
}

#[test]
fn what_is_planted_is_what_is_predicted() {
    let mut rng = ChaCha8Rng::seed_from_u64(5);
    let catalogue = Catalogue::built_in().unwrap();
    let machines = all_machines();
    let mut wrong = Vec::new();
    // the most that each parameter of each row does anywhere, mm
    let mut traces: BTreeMap<(usize, String, String), f64> = BTreeMap::new();
    let (mut worst_ratio, mut worst_mm, mut n_planted) = (0.0_f64, 0.0_f64, 0);
    for (row, effect) in catalogue.iter().enumerate() {
        for p in &effect.parameters {
            traces.insert((row, effect.id.clone(), p.name.clone()), 0.0);
        }
        for machine in machines.iter().filter(|m| effect.applies_to(m)) {
            // the machine's own blocks, then a sphere, a pin, a ring and a plane in place of the first
            let round = with_other_forms(machine);
            let others = round.mountings.last().map(|m| (&round, m));
            for (machine, mounting) in machine.mountings.iter().map(|m| (machine, m)).chain(others) {
                let acts = |body: &Body| (*body == Body::Box) == (mounting.name != OTHER_FORMS);
                if !effect.of.is_empty() && !effect.of.iter().any(acts) {
                    continue;
                }
                let place = format!("{} on {} ({})", effect.id, machine.name, mounting.name);
                let found = match plant(machine, mounting, effect, &mut rng) {
                    Ok(found) => found,
                    Err(failure) => {
                        wrong.push(format!("{place}: {failure}"));
                        continue;
                    }
                };
                n_planted += 1;
                // both are exact: what may be left is far below second order, and the rounding of coordinates
                if found.left_mm > 1e-8 * found.largest_mm + 2e-12 {
                    wrong.push(format!("{place}: {:e} mm of {:e} mm left", found.left_mm, found.largest_mm));
                }
                worst_mm = worst_mm.max(found.left_mm);
                if found.largest_mm > 1e-5 {
                    worst_ratio = worst_ratio.max(found.left_mm / found.largest_mm);
                }
                for (p, does) in effect.parameters.iter().zip(&found.alone_mm) {
                    let most = traces.get_mut(&(row, effect.id.clone(), p.name.clone())).unwrap();
                    *most = most.max(*does);
                }
            }
        }
    }
    println!("{n_planted} plantings; left at most {worst_mm:e} mm, {worst_ratio:e} of the effect");
    assert!(wrong.is_empty(), "planted and predicted differ:\n{}", wrong.join("\n"));
    let dead: Vec<String> = traces
        .iter()
        .filter(|((_, id, name), most)| {
            **most < 1e-9 && !WITHOUT_TRACE.iter().any(|(e, p, _)| *e == id.as_str() && *p == name.as_str())
        })
        .map(|((row, id, name), most)| format!("row {row} {id} {name}: {most:e} mm"))
        .collect();
    assert!(dead.is_empty(), "no trace on any machine:\n{}", dead.join("\n"));
}

#[test]
fn the_virtual_machine_plants_every_effect_that_the_catalogue_has_for_a_machine() {
    let catalogue = Catalogue::built_in().unwrap();
    for machine in all_machines() {
        let known = simulate::catalogue::ids(&machine);
        for effect in catalogue.iter().filter(|e| !(e.nuisance && e.per_block)) {
            let (here, there) = (catalogue.get(&effect.id, &machine).is_some(), known.contains(&effect.id));
            assert_eq!(here, there, "{} on {}: catalogue {here}, virtual machine {there}", effect.id, machine.name);
        }
        for id in known {
            assert!(catalogue.knows(&id), "{id}");
        }
    }
}
