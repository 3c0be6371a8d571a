//! A log that is better than its probe, a log with temperatures here and there, values that hold more than their names say,
//! and a statement at another point: nothing is invented, and nothing is left out in silence.

use crate::common;

use axiscal::design::{Noise, Planned, Request, Task, assess};
use axiscal::diagnose::{Diagnosis, Options, Subject, Verdict, diagnose};
use axiscal::fit::{self, Fit, Knowledge, Settings};
use axiscal::log::Touch;
use axiscal::machine::Machine;
use axiscal::model::catalogue::Catalogue;
use axiscal::model::data::Run;
use axiscal::program::plan::Plan;
use axiscal::simulate::Scenario;
use common::*;

fn settings(machine: &Machine, more: &[&str]) -> Settings {
    let location = if machine.name == "trunnion" { ["location-a", "location-c"] } else { ["location-b", "location-c"] };
    let all = location.iter().chain(&["block-setup", "pretravel"]).chain(more);
    Settings { effects: all.map(|e| (*e).to_owned()).collect(), ..Settings::default() }
}

fn fitted(machine: &Machine, plan: &Plan, touches: &[Touch], settings: &Settings) -> Fit {
    let runs = [Run { plan, touches, mounting: None, started_s: None }];
    fit::identify(machine, &Catalogue::built_in().unwrap(), &runs, settings).unwrap()
}

fn diagnosed(machine: &Machine, plan: &Plan, touches: &[Touch]) -> Diagnosis {
    let settings = settings(machine, &[]);
    let fit = fitted(machine, plan, touches, &settings);
    let catalogue = Catalogue::built_in().unwrap();
    diagnose(Subject { machine, catalogue: &catalogue, settings: &settings, fit: &fit }, &Options::default()).unwrap()
}

fn scenario(machine: &Machine, text: &str) -> Scenario {
    axiscal::simulate::scenario::parse_text(text, machine).unwrap()
}

/// What is left of a log without noise, or of one whose digits are coarser than its probe, is rounding: no error of the machine.
#[test]
fn a_log_that_is_better_than_its_probe_shows_no_missing_effect() {
    for (name, program) in
        [("trunnion", "full"), ("trunnion", "basic"), ("swivel-head", "full"), ("swivel-head", "head")]
    {
        let machine = machine(name);
        let plan = plan(&machine, program);
        for (touch_um, rounding_um) in [(0.0, 0.0), (0.0, 1.0), (0.1, 1.0), (0.05, 0.1)] {
            let text = format!("seed = 4\n[noise]\ntouch_um = {touch_um:?}\nrounding_um = {rounding_um:?}\n");
            let touches = touch(&machine, &plan, &scenario(&machine, &text), None);
            let found = diagnosed(&machine, &plan, &touches);
            assert_eq!(found.verdict, Verdict::Adequate, "{name} {program} {touch_um} {rounding_um}: {}", found.says);
        }
    }
}

/// And an effect that is larger than the digits is found in spite of them.
#[test]
fn coarse_digits_do_not_hide_an_effect() {
    let machine = machine("swivel-head");
    let plan = plan(&machine, "full");
    let text = "seed = 4\n[noise]\ntouch_um = 0.1\nrounding_um = 1.0\n[effects.backlash-c]\nbacklash_C = 100.0\n";
    let found = diagnosed(&machine, &plan, &touch(&machine, &plan, &scenario(&machine, text), None));
    assert_eq!(found.candidates[0].effect, "backlash-c", "{}", found.says);
    assert!(found.candidates[0].proposed, "{}", found.says);
}

/// The displacement of one single index position is in the place of the block: its residuals say nothing of the scatter, and the declared
/// value is used. Several positions say something.
#[test]
fn the_declared_scatter_is_used_where_the_residuals_say_nothing() {
    let machine = machine("swivel-head");
    let plan = plan(&machine, "head");
    let text = "seed = 4\n[noise]\ntouch_um = 1.0\nvisit_um = 0.5\n";
    let touches = touch(&machine, &plan, &scenario(&machine, text), None);
    let all = fitted(&machine, &plan, &touches, &settings(&machine, &[]));
    assert!(all.outcome.visit_shown_um.is_some_and(|um| um > 0.0));
    let first = plan.touches[0].pose;
    let of_one: Vec<Touch> =
        touches.iter().zip(&plan.touches).filter(|(_, p)| p.pose == first).map(|(t, _)| t.clone()).collect();
    assert!(of_one.len() > 4);
    let one = fitted(&machine, &plan, &of_one, &settings(&machine, &[]));
    assert_eq!(one.outcome.visit_shown_um, None);
}

#[test]
fn a_value_that_holds_another_effect_says_so() {
    let machine = machine("trunnion");
    let plan = plan(&machine, "full");
    let text = "seed = 4\n[noise]\ntouch_um = 1.0\n[effects.tool-length]\ndL = 0.3\n";
    let touches = touch(&machine, &plan, &scenario(&machine, text), None);
    let fit = fitted(&machine, &plan, &touches, &settings(&machine, &[]));
    let of = |name: &str| fit.outcome.parameters.iter().find(|p| p.name == name).unwrap();
    assert!((of("EZ0A").value - 0.3).abs() < 0.001);
    assert!(of("EZ0A").holds.contains(&"tool-length".to_owned()), "{:?}", of("EZ0A").holds);
    assert!(of("EA0C").holds.contains(&"zero-a".to_owned()), "{:?}", of("EA0C").holds);
    assert!(of("EX0C").holds.is_empty(), "{:?}", of("EX0C").holds);
    let text = axiscal::report::fit::outcome(
        &fit.outcome,
        axiscal::report::plot::Paper { width: 120, ascii: true, colour: false },
        true,
    );
    assert!(text.contains("EZ0A includes"), "{text}");
    // with the effect in the model it is the model's own matter
    let with = fitted(&machine, &plan, &touches, &settings(&machine, &["tool-length"]));
    assert!(with.outcome.parameters.iter().all(|p| !p.holds.contains(&"tool-length".to_owned())));
    assert!(with.outcome.undetermined.iter().any(|u| u.combination.contains_key("dL")));
}

/// A room that warms, read from a log that has no temperatures: what goes with time may be the room.
#[test]
fn time_is_not_named_alone_where_the_room_was_not_logged() {
    let machine = machine("swivel-head");
    let plan = plan(&machine, "full");
    let text = "seed = 4\n[noise]\ntouch_um = 1.0\n[effects.ambient-bending]\nqx = 3.0\nqz = 2.0\n[temperature]\n\
                profile = [[0.0, 20.0], [2.0, 23.5]]\n";
    let mut touches = touch(&machine, &plan, &scenario(&machine, text), None);
    let logged = diagnosed(&machine, &plan, &touches);
    assert!(logged.needs_temperature.is_empty());
    touches.iter_mut().for_each(|t| t.temperature_deg_c = None);
    let blind = diagnosed(&machine, &plan, &touches);
    assert!(blind.needs_temperature.contains(&"ambient-bending".to_owned()));
    assert!(blind.says.contains("the room's temperature"), "{}", blind.says);
}

/// Without temperatures a complete model is complete except for the room: the verdict says which effects that leaves open.
#[test]
fn an_adequate_model_says_that_the_room_was_not_logged() {
    let machine = machine("swivel-head");
    let plan = plan(&machine, "full");
    let text = "seed = 4\n[noise]\ntouch_um = 1.0\n[temperature]\nprofile = [[0.0, 20.0], [2.0, 23.5]]\n";
    let mut touches = touch(&machine, &plan, &scenario(&machine, text), None);
    let logged = diagnosed(&machine, &plan, &touches);
    assert_eq!(logged.verdict, Verdict::Adequate);
    assert!(!logged.says.contains("temperature"), "{}", logged.says);
    touches.iter_mut().for_each(|t| t.temperature_deg_c = None);
    let blind = diagnosed(&machine, &plan, &touches);
    assert_eq!(blind.verdict, Verdict::Adequate);
    assert!(
        blind.says.contains("The log has no temperatures") && blind.says.contains("ambient-bending"),
        "{}",
        blind.says
    );
    // temperatures for a quarter of the time are not used, and it is not said that there are none
    let n = touches.len();
    touches[..n / 4].iter_mut().for_each(|t| t.temperature_deg_c = Some(20.5));
    let gap = diagnosed(&machine, &plan, &touches);
    assert!(gap.says.contains("missing for a part of the touches"), "{}", gap.says);
}

/// 20 °C in the middle of a warm hour would be a jump that nothing made.
#[test]
fn gaps_in_the_temperatures_are_filled_or_said() {
    let machine = machine("swivel-head");
    let plan = plan(&machine, "full");
    let text = "seed = 4\n[noise]\ntouch_um = 1.0\n[effects.ambient-bending]\nqx = 3.0\nqz = 2.0\n[temperature]\n\
                profile = [[0.0, 20.0], [0.4, 23.5], [0.9, 21.0], [2.0, 24.0]]\n";
    let whole = touch(&machine, &plan, &scenario(&machine, text), None);
    let value = |touches: &[Touch]| {
        let fit = fitted(&machine, &plan, touches, &settings(&machine, &["ambient-bending"]));
        let qx = fit.outcome.parameters.iter().find(|p| p.name == "qx").unwrap().clone();
        (qx, fit.outcome.warnings.join("\n"))
    };
    let mut few = whole.clone();
    few.iter_mut().step_by(3).for_each(|t| t.temperature_deg_c = None);
    let (qx, said) = value(&few);
    assert!((qx.value - 3.0).abs() < 3.0 * qx.sigma.unwrap() + 0.05, "{qx:?}");
    assert!(said.contains("have no temperature. It is taken from the readings"), "{said}");
    let mut half = whole;
    half.iter_mut().skip(400).for_each(|t| t.temperature_deg_c = None);
    let (qx, said) = value(&half);
    assert_eq!(qx.sigma, None, "{qx:?}");
    assert!(said.contains("No temperature is used"), "{said}");
}

/// Held at the pivot is another line than held at the table: the statement must not change the fit.
#[test]
fn another_reference_is_refused_where_a_place_is_held() {
    let machine = machine("trunnion");
    let plan = plan(&machine, "basic");
    let touches = touch(&machine, &plan, &Scenario::flawless().with_noise(1e-3, 0.0, 5), None);
    let mut settings = settings(&machine, &[]);
    settings.reference = Some(machine.reference.ball);
    assert_ne!(machine.reference.ball, machine.reference.pivot);
    fitted(&machine, &plan, &touches, &settings);
    settings.knowledge.insert("EX0C".into(), Knowledge::Fixed(0.012));
    let runs = [Run { plan: &plan, touches: &touches, mounting: None, started_s: None }];
    let said = fit::identify(&machine, &Catalogue::built_in().unwrap(), &runs, &settings).unwrap_err();
    assert!(format!("{said:?}").contains("EX0C counts at the machine's pivot"), "{said:?}");
}

/// The figure of the probe's noise alone does not know how visits scatter.
#[test]
fn the_scatter_of_visits_is_no_noise_of_the_probe() {
    let machine = machine("swivel-head");
    let catalogue = Catalogue::built_in().unwrap();
    let alone = |visit_mm: f64| {
        let task = Task {
            machine: &machine,
            catalogue: &catalogue,
            effects: fit::effects_of(&settings(&machine, &[]).effects, &catalogue, &machine).unwrap(),
            held: Vec::new(),
            reference: machine.reference.pivot,
            temperature: false,
        };
        let runs = vec![Planned::new(plan(&machine, "head")), Planned::new(plan(&machine, "table"))];
        let names = vec!["head".to_owned(), "table".to_owned()];
        let probe = Noise { sigma_mm: 1e-3, tau_mm: 0.0 };
        assess(&Request { task, runs, names, probe, acting_tau_mm: Some(visit_mm) }).unwrap()
    };
    let (none, some) = (alone(0.0), alone(0.7e-3));
    for (a, b) in none.parameters.iter().zip(&some.parameters) {
        assert_eq!(a.sigma, b.sigma, "{}", a.name);
        assert!(b.sigma_with_visits > a.sigma_with_visits, "{}", a.name);
    }
    let blind = none.effects.iter().find(|e| e.effect == "ambient-bending").unwrap();
    assert!(blind.tell_apart.contains("goes with the temperature"), "{}", blind.tell_apart);
}

/// The same program twice, and between the two the machine has moved: no clamping is to blame.
#[test]
fn runs_that_disagree_are_named_as_runs() {
    let machine = machine("trunnion");
    let plan = plan(&machine, "basic");
    let at = |seed: u64, moved: &str| {
        let text = format!("seed = {seed}\n[noise]\ntouch_um = 1.0\n{moved}");
        touch(&machine, &plan, &scenario(&machine, &text), None)
    };
    // the axis of A has moved by 8 um against the blocks' places in the second run
    let (first, second) = (at(4, ""), at(5, "[effects.location-a]\nEZ0A = 0.008\n"));
    let run = |touches| Run { plan: &plan, touches, mounting: Some("same"), started_s: None };
    let settings = settings(&machine, &[]);
    let catalogue = Catalogue::built_in().unwrap();
    let fit = fit::identify(&machine, &catalogue, &[run(&first), run(&second)], &settings).unwrap();
    let subject = Subject { machine: &machine, catalogue: &catalogue, settings: &settings, fit: &fit };
    let found = diagnose(subject, &Options::default()).unwrap();
    assert_ne!(found.verdict, Verdict::Adequate);
    assert_eq!(found.depends[0].by, "run", "{}", found.says);
    let check = found.verdict.unexplained().map(|u| &u.check);
    assert_eq!(check, Some(&axiscal::diagnose::next_step::MachineCheck::Runs), "{}", found.says);
}

/// What is answered is the minimum of the noise that is answered, however the fit came to it: solved again from elsewhere, with that
/// noise, the same values, covariance and chi-square come out.
#[test]
fn the_answer_belongs_to_its_noise() {
    let mut other_than_declared = 0;
    for (name, program, touch_um, visit_um, stated_tau_mm, chips) in [
        ("swivel-head", "full", 2.5, 0.0, Some(0.0), 0),
        ("swivel-head", "full", 0.6, 0.0, Some(0.0), 3),
        ("swivel-head", "full", 1.0, 0.8, None, 2),
        ("trunnion", "full", 3.0, 0.0, Some(0.0), 2),
        ("double-head", "full", 2.0, 0.0, Some(0.0), 0),
        ("swivel-head", "head", 2.0, 0.0, Some(0.0), 2),
        ("trunnion", "basic", 1.0, 0.5, None, 1),
    ] {
        let machine = machine(name);
        let plan = plan(&machine, program);
        let text = format!("seed = 11\n[noise]\ntouch_um = {touch_um:?}\nvisit_um = {visit_um:?}\n");
        let mut touches = touch(&machine, &plan, &scenario(&machine, &text), None);
        for k in 0..chips {
            let n = touches.len();
            touches[17 + k * n / 4].position.0[..3].iter_mut().for_each(|at| *at += 0.2);
        }
        let axes = machine.axes.iter().filter(|a| a.name.is_rotary());
        let mut effects: Vec<String> = axes.map(|a| format!("location-{}", a.name).to_lowercase()).collect();
        effects.extend(["block-setup", "pretravel"].map(str::to_owned));
        let settings = Settings { effects, visit_sigma_mm: stated_tau_mm, ..Settings::default() };
        let fit = fitted(&machine, &plan, &touches, &settings);
        let case = format!("{name} {program} {touch_um}");
        assert!(fit.rejected.len() >= chips, "{case}: {:?}", fit.rejected);
        other_than_declared += usize::from((fit.noise.sigma_mm / 1e-3).ln().abs() > 0.3 && fit.observability.full());
        let theta = fit.free_theta();
        let sigma = |c: usize| fit.covariance[(fit.free[c], fit.free[c])].sqrt();
        let held = |c: usize| fit.observability.held.contains(&c);
        let mut start = theta.clone();
        for c in (0..start.len()).filter(|c| !held(*c)) {
            start[c] += 20.0 * sigma(c) * if c % 2 == 0 { 1.0 } else { -1.0 };
        }
        let again = fit.with_touches(fit.noise.tau_mm, |t| fit::solve::minimise(t, start, &fit.observability));
        assert!(again.converged && again.iterations > 0, "{case}: {}", again.stopped);
        assert!((again.chi2 / fit.chi2 - 1.0).abs() < 1e-9, "{case}: {} {}", again.chi2, fit.chi2);
        for a in (0..theta.len()).filter(|c| !held(*c)) {
            let off = (again.theta[a] - theta[a]).abs() / sigma(a);
            assert!(off < 1e-6, "{case}: {} is {off} standard uncertainties off", fit.model.unknowns[fit.free[a]].name);
            for b in (0..theta.len()).filter(|c| !held(*c)) {
                let off =
                    (again.covariance[(a, b)] - fit.covariance[(fit.free[a], fit.free[b])]) / (sigma(a) * sigma(b));
                assert!(off.abs() < 1e-6, "{case}: covariance of {a} and {b} is {off} off");
            }
        }
    }
    assert!(other_than_declared >= 3, "{other_than_declared} cases whose noise was not the declared one");
}

/// A stated scatter of index visits that revisited poses contradict is used, and said to be contradicted; one that chance allows is not.
#[test]
fn a_stated_scatter_of_visits_is_held_against_the_revisits() {
    let machine = machine("swivel-head");
    let plan = plan(&machine, "full");
    let text = "seed = 5\n[noise]\ntouch_um = 1.0\nvisit_um = 0.5\n";
    let touches = touch(&machine, &plan, &scenario(&machine, text), None);
    for (stated_um, contradicted) in [(5.0, true), (0.0, true), (0.35, false), (0.5, false), (0.7, false)] {
        let settings = Settings { visit_sigma_mm: Some(1e-3 * stated_um), ..settings(&machine, &[]) };
        let fit = fitted(&machine, &plan, &touches, &settings);
        assert_eq!((fit.noise.tau_mm, fit.noise.visit_source), (1e-3 * stated_um, axiscal::fit::VisitSource::Study));
        let said = fit.remarks.iter().any(|r| matches!(r, axiscal::fit::Remark::VisitsContradicted { .. }));
        assert_eq!(said, contradicted, "{stated_um}: {:?}", fit.outcome.warnings);
    }
}

/// A drift that the model lacks makes revisited poses scatter, and chi-square beside such a scatter is what it should be: the scatter
/// itself is the finding. With the drift in the model, or without one, nothing is said.
#[test]
fn an_effect_that_hides_in_the_scatter_of_visits_is_said() {
    for (name, program) in [("trunnion", "full"), ("swivel-head", "full")] {
        let machine = machine(name);
        let plan = plan(&machine, program);
        for (drift_um_per_h, more, hides) in
            [(8.0, &[][..], true), (8.0, &["drift-linear"][..], false), (0.0, &[][..], false)]
        {
            let drift = format!("[effects.drift-linear]\nvz = {drift_um_per_h:?}\n");
            let text = format!("seed = 6\n[noise]\ntouch_um = 1.0\nvisit_um = 0.5\n{drift}");
            let touches = touch(&machine, &plan, &scenario(&machine, &text), None);
            let fit = fitted(&machine, &plan, &touches, &settings(&machine, more));
            let said = fit.remarks.iter().any(|r| matches!(r, axiscal::fit::Remark::VisitsBeyond { .. }));
            assert_eq!(said, hides, "{name} {more:?}: {:?} {:?}", fit.noise, fit.outcome.warnings);
        }
    }
}

/// A probe that repeats far worse than its file declares: what makes it so counts as noise, and is said.
#[test]
fn repeats_that_scatter_far_more_than_declared_are_said() {
    let machine = machine("swivel-head");
    let plan = plan(&machine, "full");
    let declared_um = machine.probe.repeatability_um;
    for (times, more) in [(1.0, false), (1.3, false), (2.0, true)] {
        let text = format!("seed = 5\n[noise]\ntouch_um = {:?}\n", times * declared_um);
        let touches = touch(&machine, &plan, &scenario(&machine, &text), None);
        let fit = fitted(&machine, &plan, &touches, &settings(&machine, &[]));
        let said = fit.remarks.iter().any(|r| matches!(r, axiscal::fit::Remark::RepeatsBeyond { .. }));
        assert_eq!(said, more, "{times}: {:?}", fit.outcome.warnings);
    }
}

/// Hours count from the first touch that was made, in whatever order a study lists its runs.
#[test]
fn runs_may_be_listed_in_any_order() {
    let machine = machine("swivel-head");
    let plan = plan(&machine, "full");
    let at = |seed: u64, started_s: f64| {
        let text = format!(
            "seed = {seed}\n[noise]\ntouch_um = 1.0\n[time]\nstarted_s = {started_s:?}\n[effects.drift-linear]\nvz = 6.0\n"
        );
        touch(&machine, &plan, &scenario(&machine, &text), None)
    };
    let (first, second) = (at(4, 0.0), at(5, 9000.0));
    let run = |touches, mounting, started_s| Run {
        plan: &plan,
        touches,
        mounting: Some(mounting),
        started_s: Some(started_s),
    };
    let (a, b) = (|| run(&first, "a", 0.0), || run(&second, "b", 9000.0));
    let settings = settings(&machine, &["drift-linear"]);
    let catalogue = Catalogue::built_in().unwrap();
    let [listed, turned] =
        [[a(), b()], [b(), a()]].map(|runs| fit::identify(&machine, &catalogue, &runs, &settings).unwrap());
    for p in &listed.outcome.parameters {
        let other = turned.outcome.parameters.iter().find(|q| q.name == p.name).unwrap();
        assert_eq!(p.status, other.status, "{}", p.name);
        let off = (p.value - other.value).abs();
        assert!(off < 1e-4 * p.sigma.unwrap_or(f64::INFINITY), "{}: {} {}", p.name, p.value, other.value);
    }
    let drift = value(&turned, "vz");
    assert!((drift - 6.0).abs() < 2.0, "{drift}");
}

/// Whatever displaces a block does so in its carrier's frame: components add, and a slip beside tilted blocks comes back exactly.
#[test]
fn a_slip_comes_back_beside_blocks_that_stand_askew() {
    let machine = machine("trunnion");
    let plan = plan(&machine, "full");
    let slip =
        [("dx", 30.0), ("dy", -20.0), ("dz", 15.0), ("rx", 300.0), ("ry", -200.0), ("rz", 150.0), ("from_h", 0.7)];
    let mut scenario = Scenario::flawless().with(&machine, "block-slip", &slip).unwrap();
    for block in &plan.blocks {
        scenario = scenario.with_block(&plan.mounting, &block.name, [0.1, -0.08, 0.05], [8e-4, -5e-4, 7e-4]);
    }
    let touches = touch(&machine, &plan, &scenario, None);
    let fit = fitted(&machine, &plan, &touches, &settings(&machine, &["block-slip"]));
    for (p, v) in &slip[..6] {
        let found = value(&fit, p);
        assert!((found - v).abs() < 1e-7 * v.abs(), "{p} is {found}, planted {v}");
    }
}

/// What an axis does goes with where it stands when the probe triggers: without noise its errors come back beside a pre-travel, too.
#[test]
fn errors_along_an_axis_come_back_beside_a_pretravel() {
    for (name, effect, planted) in [
        ("swivel-head", "pitch-x", vec![("pitch_X", 10.0), ("EXXc", 2.0), ("EXXs", -1.5)]),
        ("swivel-head", "scale-x", vec![("EXX", 15.0)]),
        ("trunnion", "straightness-xy", vec![("EXY2", 8.0)]),
        ("trunnion", "squareness-xy", vec![("EC0Y", 16.0)]),
    ] {
        let machine = machine(name);
        let plan = plan(&machine, "full");
        let mut text = format!("[effects.pretravel]\npretravel = 0.005\n[effects.{effect}]\n");
        planted.iter().for_each(|(p, v)| text += &format!("{p} = {v:?}\n"));
        let touches = touch(&machine, &plan, &scenario(&machine, &text), None);
        let fit = fitted(&machine, &plan, &touches, &settings(&machine, &[effect]));
        for (p, v) in planted.iter().chain(&[("pretravel", 0.005)]) {
            let found = value(&fit, p);
            assert!((found - v).abs() < 1e-10 * v.abs().max(1.0), "{name} {effect}: {p} is {found}, planted {v}");
        }
    }
}

/// Each value of a shape is tried once: where it begins and the same place of a grid, in another rounding, are no two values, of which
/// the one beside the other could be taken for a minimum of its own.
#[test]
fn no_value_of_a_shape_is_tried_twice() {
    let machine = machine("swivel-head");
    let mut catalogue = Catalogue::built_in().unwrap();
    let own = "[[effect]]\nid = \"two\"\nat = \"base\"\n\
        terms = [{ parameter = \"ta\", unit = \"um\", dof = \"dz\", formula = \"exp(-t/t2)\" }]\n\
        shape = [{ parameter = \"t2\", unit = \"h\", start = 0.1, min = 0.01, max = 10 }]\n";
    catalogue.add_file(&axiscal::diag::source("two.toml", own)).unwrap();
    let p = &catalogue.get("two", &machine).unwrap().parameters[1];
    let does = |at: f64| nalgebra::DMatrix::from_fn(300, 1, |i, _| (-0.005 * i as f64 / at).exp());
    let values = fit::fine(p, 300, &does);
    assert!(values.len() > 24 && values.iter().any(|v| (v - 0.1).abs() < 1e-9));
    assert!(values.windows(2).all(|w| w[1] - w[0] > 1e-6 * w[1]), "{values:?}");
}
