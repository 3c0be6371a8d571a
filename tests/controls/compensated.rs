//! A compensation as `export` writes it, applied by the virtual machine's control: what it carries is gone.

use crate::common;
use axiscal::diag::source;
use axiscal::machine::{Carrier, Machine, Mounting, Side};
use axiscal::post::Postprocessor;
use axiscal::program::plan::{ControllerFrame, Plan};
use axiscal::simulate::{self, Compensation, Scenario};
use axiscal::tables::compensation::{self, Mode, Stock, Term};
use axiscal::tables::linuxcnc::stock;
use axiscal::tables::place::{Meaning, meaning};
use common::random::random_plan;
use common::*;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Random errors of these effects: planted, and as terms of a compensation.
fn errors(machine: &Machine, effects: &[&str], rng: &mut ChaCha8Rng) -> (Scenario, Vec<Term>) {
    let catalogue = axiscal::model::catalogue::Catalogue::built_in().unwrap();
    let mut scenario = Scenario::flawless();
    let mut terms = Vec::new();
    for effect in effects {
        let Some(row) = catalogue.get(effect, machine) else { continue };
        for (index, p) in row.parameters.iter().enumerate() {
            let size = if p.unit == "mm" { 0.1 } else { 0.05 };
            let value = rng.random_range(-size..size);
            scenario = scenario.with(machine, effect, &[(&p.name, value)]).unwrap();
            let Meaning::Location(spots) = meaning(row, index, machine) else { panic!("{effect} {}", p.name) };
            terms.extend(spots.into_iter().map(|(spot, per_unit)| Term {
                axis: spot.axis,
                place: spot.place,
                dof: spot.dof,
                value: value * per_unit,
                unit: spot.dof.unit().to_owned(),
                parameter: p.name.clone(),
                effect: (*effect).to_owned(),
                active_before: 0.0,
                identified: value * per_unit,
                sigma: None,
            }));
        }
    }
    (scenario, terms)
}

/// Through the file that the control's user gets.
fn loaded(machine: &Machine, mode: Mode, terms: Vec<Term>, stock: Option<Stock>) -> Compensation {
    let written = compensation::Compensation {
        format: compensation::FORMAT.to_owned(),
        controller: "linuxcnc".to_owned(),
        machine: machine.name.clone(),
        machine_sha256: machine.sha256.clone(),
        mode,
        component: None,
        reference_mm: machine.reference.pivot.into(),
        terms,
        stock,
        tables: None,
        table_errors: Vec::new(),
        program: String::new(),
        provenance: compensation::Provenance::default(),
    };
    let text = source("compensation.json", written.to_json().unwrap());
    Compensation::parse(&text, machine).unwrap().0
}

/// Recorded less nominal along the search, mm.
fn readings(machine: &Machine, plan: &Plan, scenario: &Scenario, c: Option<&Compensation>) -> Vec<f64> {
    let (raw, _) = simulate::run(machine, plan, scenario, c).unwrap();
    raw.iter()
        .map(|r| {
            let touch = plan.touch(r.id.unwrap()).unwrap();
            let (start, nominal) = (touch.start_position().xyz_mm(), touch.nominal_position().xyz_mm());
            matched(r);
            (r.position.xyz_mm() - nominal).dot(&(start - nominal).normalize())
        })
        .collect()
}

const LOCATION: [&str; 3] = ["location-a", "location-b", "location-c"];
const ZERO: [&str; 3] = ["zero-a", "zero-b", "zero-c"];

#[test]
fn the_component_carries_every_location_error() {
    let mut rng = ChaCha8Rng::seed_from_u64(2);
    for machine in machines() {
        for (effects, within) in [(&LOCATION[..], 1e-11), (&ZERO[..], 1e-11), (&[LOCATION, ZERO].concat()[..], 1e-11)] {
            let (scenario, terms) = errors(&machine, effects, &mut rng);
            assert!(terms.len() >= 2, "{}", machine.name);
            let compensation = loaded(&machine, Mode::Component, terms, None);
            // blocks on the part that the component counts as the workpiece's carrier
            let last = machine.side(Side::Workpiece).last().unwrap().name;
            let borne = |m: &&Mounting| m.carrier == Carrier::Axis(last) || !last.is_rotary();
            for mounting in machine.mountings.iter().filter(borne) {
                let plan = random_plan(&machine, mounting, 60, &mut rng);
                let before = readings(&machine, &plan, &scenario, None);
                assert!(before.iter().any(|e| e.abs() > 1e-3));
                for e in readings(&machine, &plan, &scenario, Some(&compensation)) {
                    assert!(e.abs() < within, "{} {effects:?}: {e:e} mm left", machine.name);
                }
            }
        }
    }
}

#[test]
fn pins_and_home_offsets_carry_offsets_and_zeros() {
    let mut rng = ChaCha8Rng::seed_from_u64(4);
    let (post, _) = Postprocessor::load_built_in_or_file("linuxcnc").unwrap();
    // positive angles turn the table left-handed: only where the version has a pin for that
    let ways = [("2.9", 1.0), ("master", 1.0), ("master", -1.0)];
    let each = ["trunnion", "swivel-table-b"].into_iter().flat_map(|name| ways.map(|way| (name, way)));
    for (name, (version, sense)) in each {
        let mut machine = machine(name);
        machine.axes.iter_mut().filter(|a| a.name.is_rotary()).for_each(|a| a.sense = sense);
        let machine = machine;
        let (_, terms) = errors(&machine, &[LOCATION, ZERO].concat(), &mut rng);
        let module = stock::module_of(&machine, post.release(Some(version)).unwrap()).unwrap();
        assert_eq!(module.conventional, (version == "master").then_some(sense < 0.0));
        let carried: Vec<Term> =
            terms.iter().filter(|t| stock::why_not(&machine, &Ok(module), t).is_none()).cloned().collect();
        // plant only what is carried
        let scenario = carried.iter().fold(Scenario::flawless(), |s, t| {
            s.with(&machine, &t.effect, &[(t.parameter.as_str(), t.value)]).unwrap()
        });
        let pins = stock::pins(&machine, module, &carried);
        let written = Stock {
            module: Some(module.name.to_owned()),
            pins: pins.pins.clone(),
            conventional_directions: module.conventional,
            home_offset_deg: stock::home_offsets(&machine, &carried),
            ..Stock::default()
        };
        let compensation = loaded(&machine, Mode::Stock, carried, Some(written));
        let mut plan = random_plan(&machine, &machine.mountings[0], 60, &mut rng);
        plan.controller_frame = ControllerFrame::Tcp;
        let shift = nalgebra::Vector3::from(pins.workpiece_shift_mm);
        let before = readings(&machine, &plan, &scenario, None);
        assert!(before.iter().any(|e| e.abs() > 0.02));
        for (e, touch) in readings(&machine, &plan, &scenario, Some(&compensation)).iter().zip(&plan.touches) {
            // the workpiece stands off with its table until its offset is touched off again; pins have nine digits
            let stays = nalgebra::Vector3::from(touch.normal).dot(&shift);
            assert!((e - stays).abs() < 1e-8, "{name}: {e:e} mm instead of {stays:e}");
        }
    }
}
