//! Identified → exported → applied by the virtual machine's control → probed again: the error is gone, or what is left is
//! what was predicted.

use crate::common;
use axiscal::diag::source;
use axiscal::fit::Fit;
use axiscal::machine::Machine;
use axiscal::model::catalogue::Catalogue;
use axiscal::model::predict::Observation;
use axiscal::paper::tables::GIVEN;
use axiscal::program::{self, plan::Plan};
use axiscal::simulate::{Compensation, Scenario};
use axiscal::tables::compensation::{self, Provenance};
use axiscal::tables::correction::{Correction, During};
use axiscal::tables::linuxcnc::{self, Export};
use common::*;

fn export(machine: &Machine, fit: &Fit, active: Option<&compensation::Compensation>) -> Export {
    let catalogue = Catalogue::built_in().unwrap();
    let (correction, _) = Correction::collect(
        machine,
        &catalogue,
        &fit.outcome,
        During { loaded: active, transformation: true },
        Provenance::default(),
    )
    .unwrap();
    linuxcnc::export(machine, &correction, &linuxcnc::Options::default()).unwrap().0
}

/// Through the file that the control's user gets.
fn loaded(machine: &Machine, written: &compensation::Compensation) -> Compensation {
    Compensation::parse(&source("compensation.json", written.to_json().unwrap()), machine).unwrap().0
}

/// Largest reading of an errorless model, mm.
fn largest(machine: &Machine, plan: &Plan, touches: &[axiscal::log::Touch], effect: &str) -> f64 {
    let catalogue = Catalogue::built_in().unwrap();
    let bench = axiscal::paper::tables::Bench { machine, plan, catalogue: &catalogue };
    assert!(!effect.is_empty());
    bench.readings(touches).iter().fold(0.0, |m: f64, r| m.max(r.e.abs()))
}

#[test]
fn the_papers_sequence_in_simulation_is_exact() {
    // the method, section 8 and 10: head, compensate, table, compensate, with least squares: 1e-10
    let machine = machine("swivel-head");
    let (head, table) = (plan(&machine, "head"), plan(&machine, "table"));
    for g in GIVEN {
        let on_head = [("a_BZ", g[0]), ("b_BZ", g[1]), ("g_BZ", g[2]), ("d_xBZ", g[3]), ("d_yBZ", g[4])];
        let on_table = [("a_CY", g[0]), ("b_CY", g[1]), ("d_xCY", g[3]), ("d_yCY", g[4])];
        let scenario = Scenario::flawless()
            .with(&machine, "paper-head", &on_head)
            .unwrap()
            .with(&machine, "paper-table", &on_table)
            .unwrap();

        let touches = touch(&machine, &head, &scenario, None);
        let fit = identify(&machine, &[(&head, &touches)], &["paper-head"]);
        for (name, given) in on_head {
            assert!((value(&fit, name) - given).abs() < 1e-10, "{name}: {}", value(&fit, name));
        }
        let first = export(&machine, &fit, None).component.compensation;
        let with_b = loaded(&machine, &first);
        let again = touch(&machine, &head, &scenario, Some(&with_b));
        assert!(largest(&machine, &head, &again, "paper-head") < 1e-10);

        let touches = touch(&machine, &table, &scenario, Some(&with_b));
        let fit = identify(&machine, &[(&table, &touches)], &["paper-table"]);
        for (name, given) in on_table {
            assert!((value(&fit, name) - given).abs() < 1e-10, "{name}: {}", value(&fit, name));
        }
        // what is found adds to what was active
        let second = export(&machine, &fit, Some(&first)).component.compensation;
        assert_eq!(second.terms.len(), 9);
        let with_both = loaded(&machine, &second);
        let again = touch(&machine, &table, &scenario, Some(&with_both));
        assert!(largest(&machine, &table, &again, "paper-table") < 1e-10);
    }
}

/// Points that no built-in program touches.
const OTHER: &str = r#"
format = "axiscal-programs/1"
name = "other"
says = "other points"
mounting = "table"
faces_in = "block"
[[grid]]
name = "top"
u = [-2.0, 1.0]
v = [-1.0, 2.0]
[[grid]]
name = "side"
u = [-1.0, 2.0]
depth = [3.0]
[[stage]]
name = "other"
[[stage.setup]]
pose = { SWIVEL = 0.0, C = [45.0, 165.0, 285.0] }
blocks = ["x+"]
touch = [{ faces = ["+Z"], grid = "top" }, { faces = ["+X", "-X", "+Y", "-Y"], grid = "side" }]
[[stage.setup]]
pose = { SWIVEL = TILT, C = [20.0, 200.0] }
blocks = ["x+"]
touch = [{ faces = ["+Z"], grid = "top" }]
"#;

fn other_points(machine: &Machine) -> Plan {
    let swivel = machine.rotary().find(|a| a.name.to_string() != "C").unwrap();
    // to the side where the axis can turn
    let tilt = if swivel.range[0] <= -40.0 { "-40.0" } else { "40.0" };
    let text = OTHER.replace("SWIVEL", &swivel.name.to_string()).replace("TILT", tilt);
    let (spec, _) = program::load(&source("other.toml", text)).unwrap();
    program::generate(machine, &spec, &program::Options::default()).unwrap().0.plan
}

/// Readings that the fitted model predicts for touches of an errorless control, mm: nominal positions, planted blocks.
fn predicted(fit: &Fit, machine: &Machine, plan: &Plan) -> f64 {
    let perfect = touch(machine, plan, &Scenario::flawless(), None);
    let runs = [axiscal::model::data::Run { plan, touches: &perfect, mounting: None, started_s: None }];
    let data = axiscal::model::data::assemble(machine, &runs);
    let location: Vec<String> = fit.outcome.effects.iter().filter(|e| e.starts_with("location")).cloned().collect();
    let catalogue = Catalogue::built_in().unwrap();
    let (model, _) = axiscal::fit::observe_plan(machine, &catalogue, &data, &location).unwrap();
    let theta: Vec<f64> = model.unknowns.iter().map(|u| value(fit, &u.name)).collect();
    let gap = |o: &Observation| model.gap(o, &theta);
    let squares: f64 = data.observations.iter().map(|o| gap(o).powi(2)).sum();
    (squares / data.observations.len() as f64).sqrt()
}

#[test]
fn at_other_points_the_error_falls_by_what_was_predicted() {
    for (name, programs, effects) in [
        ("swivel-head", &["head", "table"][..], ["location-b", "location-c"]),
        ("trunnion", &["basic"][..], ["location-a", "location-c"]),
        ("swivel-table-b", &["basic"][..], ["location-b", "location-c"]),
        ("nutating-b", &["basic"][..], ["location-b", "location-c"]),
        ("trunnion-offset", &["basic"][..], ["location-a", "location-c"]),
    ] {
        let machine = machine(name);
        let catalogue = Catalogue::built_in().unwrap();
        let mut scenario = Scenario::flawless().with_noise(0.5e-3, 0.0, 4);
        let mut size = 1.0;
        for effect in effects {
            for p in &catalogue.get(effect, &machine).unwrap().parameters {
                // sizes of every sign, some 20 um and 0.004 deg
                size *= -1.1;
                let planted = if p.unit == "mm" { 0.02 * size } else { 0.004 * size };
                scenario = scenario.with(&machine, effect, &[(&p.name, planted)]).unwrap();
            }
        }
        let plans: Vec<Plan> = programs.iter().map(|p| plan(&machine, p)).collect();
        let touches: Vec<_> = plans.iter().map(|p| touch(&machine, p, &scenario, None)).collect();
        let runs: Vec<_> = plans.iter().zip(&touches).map(|(p, t)| (p, &t[..])).collect();
        let fit = identify(&machine, &runs, &[effects[0], effects[1], "block-setup", "pretravel"]);

        let other = other_points(&machine);
        let bench = axiscal::paper::tables::Bench { machine: &machine, plan: &other, catalogue: &catalogue };
        let rms = |touches: &[axiscal::log::Touch]| {
            let readings = bench.readings(touches);
            (readings.iter().map(|r| r.e * r.e).sum::<f64>() / readings.len() as f64).sqrt()
        };
        let control = loaded(&machine, &export(&machine, &fit, None).component.compensation);
        let before = rms(&touch(&machine, &other, &scenario, None));
        let after = rms(&touch(&machine, &other, &scenario, Some(&control)));
        let foretold = predicted(&fit, &machine, &other);
        println!(
            "{name}: before {:.2} um, foretold {:.2} um, after {:.3} um",
            before * 1e3,
            foretold * 1e3,
            after * 1e3
        );
        // the fit says what the errors do at these points; the noise of 0.5 um and its own doubt are on top
        assert!((before - foretold).abs() < 0.1 * before, "{name}: {before} mm found, {foretold} mm foretold");
        assert!(before > 10e-3 && after < 1.5e-3, "{name}: {before} mm before, {after} mm after");
    }
}
