//! What the answers say is true where data are few, stated wrongly or cannot tell: an aborted run, a wrong noise, a room
//! that only warms, effects that no touches part.

use crate::common;

use axiscal::design;
use axiscal::diagnose::{Diagnosis, Options, Subject, Verdict, diagnose};
use axiscal::fit::{self, Fit, Remark, Settings};
use axiscal::log::Touch;
use axiscal::machine::Machine;
use axiscal::model::catalogue::Catalogue;
use axiscal::model::data::Run;
use axiscal::program::plan::Plan;
use axiscal::search::distinguishability::Products;
use axiscal::simulate::Scenario;
use common::*;
use std::sync::OnceLock;

const MODEL: [&str; 4] = ["location-b", "location-c", "block-setup", "pretravel"];

/// The full program of the swivelling head.
fn full() -> &'static (Machine, Plan) {
    static FULL: OnceLock<(Machine, Plan)> = OnceLock::new();
    FULL.get_or_init(|| {
        let machine = machine("swivel-head");
        let plan = plan(&machine, "full");
        (machine, plan)
    })
}

fn clean(touch_um: f64) -> Vec<Touch> {
    let (machine, plan) = full();
    touch(machine, plan, &Scenario::flawless().with_noise(1e-3 * touch_um, 0.3e-3, 5), None)
}

fn settings(touch_um: Option<f64>) -> Settings {
    let effects = MODEL.iter().map(|e| (*e).to_owned()).collect();
    Settings { effects, touch_sigma_mm: touch_um.map(|s| 1e-3 * s), ..Settings::default() }
}

fn runs(touches: &[Touch]) -> [Run<'_>; 1] {
    [Run { plan: &full().1, touches, mounting: None, started_s: None }]
}

fn fitted(touches: &[Touch], touch_um: Option<f64>) -> Fit {
    fit::identify(&full().0, &Catalogue::built_in().unwrap(), &runs(touches), &settings(touch_um)).unwrap()
}

fn diagnosed(touches: &[Touch], touch_um: Option<f64>) -> Diagnosis {
    let catalogue = Catalogue::built_in().unwrap();
    let settings = Settings { quick: true, ..settings(touch_um) };
    let fit = fit::identify(&full().0, &catalogue, &runs(touches), &settings).unwrap();
    diagnose(Subject { machine: &full().0, catalogue: &catalogue, settings: &settings, fit: &fit }, &Options::default())
        .unwrap()
}

/// At B = 0 no angle of C can tell an error of the head: what was planned and not made must not count as made.
#[test]
fn what_would_help_after_an_aborted_run_is_asked_of_the_touches_made() {
    let touches = &clean(1.0)[..39];
    let mut fit = fitted(touches, None);
    design::explain(&full().0, &Catalogue::built_in().unwrap(), &runs(touches), &mut fit).unwrap();
    let about = |name: &str| {
        let all = fit.outcome.undetermined.iter().filter(|u| u.combination.contains_key(name));
        all.flat_map(|u| u.parted_by.clone()).collect::<Vec<_>>().join("; ")
    };
    let said = about("EC0B");
    assert!(said.contains("touch at B = ") && !said.contains("touch at C = "), "{said}");
}

#[test]
fn a_model_of_which_nothing_is_told_is_not_adequate() {
    let touches = clean(1.0);
    let few = diagnosed(&touches[..39], None);
    assert!(matches!(few.verdict, Verdict::TooLittleData(_)), "{}", few.says);
    assert!(few.says.contains("EX0B") && few.says.contains("EB0C") && !few.says.contains("pretravel"), "{}", few.says);
    assert!(few.candidates.is_empty());
    let all = diagnosed(&touches, None);
    assert_eq!(all.verdict, Verdict::Adequate, "{}", all.says);
}

/// The repeats of a log know its noise better than a line of a study.
#[test]
fn a_noise_that_the_repeats_contradict_is_said_and_not_judged_by() {
    let touches = clean(1.0);
    for stated in [0.3, 0.7, 20.0] {
        let found = diagnosed(&touches, Some(stated));
        assert_eq!(found.verdict, Verdict::Adequate, "{stated}: {}", found.says);
        assert!(found.noise_says.contains(&format!("{stated:.2} µm that the study states")), "{}", found.noise_says);
        let fit = fitted(&touches, Some(stated));
        assert!((fit.outcome.noise_um - 1.0).abs() < 0.2, "{}", fit.outcome.noise_um);
        let warned = fit.outcome.warnings.join("\n");
        assert!(warned.contains(&format!("states a noise of {stated:.2} µm")), "{warned}");
        assert!(!warned.contains("something is missing in the model"), "{warned}");
        // a bound on the visits of nothing at all would be the stated noise's, not theirs
        assert!(fit.noise.tau_test_mm > 0.1e-3, "{}", fit.noise.tau_test_mm);
    }
    // what the repeats bear out stands; what they bear out nearly makes no model wrong either
    for stated in [0.88, 1.0, 1.1] {
        let found = diagnosed(&touches, Some(stated));
        assert_eq!(found.verdict, Verdict::Adequate, "{stated}: {}", found.says);
        let fit = fitted(&touches, Some(stated));
        assert_eq!(fit.outcome.noise_source, axiscal::fit::NoiseSource::Study, "{stated}");
        assert!(
            !fit.remarks.iter().any(|r| matches!(r, axiscal::fit::Remark::Misfit { .. })),
            "{:?}",
            fit.outcome.warnings
        );
    }
}

/// Effective degrees of freedom far below one are not none.
#[test]
fn hardly_any_degrees_of_freedom_are_not_called_none() {
    let (touches, mut said) = (clean(1.0), Vec::new());
    let mut noise = fitted(&touches, None).noise;
    for dof in [0.002, 0.4, 10.2] {
        (noise.visit_source, noise.visit_dof, noise.tau_test_mm) =
            (axiscal::fit::VisitSource::Revisits, Some(dof), 0.3e-3);
        said.push(noise.says());
    }
    assert!(said[0].contains("less than 0.1 degrees of freedom, at most 0.30 µm"), "{said:?}");
    assert!(said[1].contains("0.4 degrees of freedom") && said[2].contains("10 degrees of freedom"), "{said:?}");
    noise.tau_test_mm = 0.0;
    assert!(!noise.says().contains("at most") && noise.says().contains("own noise"), "{}", noise.says());
}

/// Uncertainties that hold rows of the measurement itself do not count the noise only.
#[test]
fn type_b_rows_are_not_denied() {
    let (machine, plan) = full();
    let scenario =
        Scenario::flawless().with_noise(1e-3, 0.0, 5).with(machine, "head-sag", &[("head_sag", 15.0)]).unwrap();
    let touches = touch(machine, plan, &scenario, None);
    let with = Settings { type_b: [("dL".to_owned(), 0.005)].into(), ..settings(None) };
    let fit = fit::identify(machine, &Catalogue::built_in().unwrap(), &runs(&touches), &with).unwrap();
    let is_misfit = |r: &Remark| matches!(r, Remark::Misfit { with_type_b: true, .. });
    assert!(fit.remarks.iter().any(is_misfit), "{:?}", fit.outcome.warnings);
}

/// The room as it was measured is what the touches so far saw of it; a line in time stays one unless the room turns.
#[test]
fn a_room_that_goes_on_parts_nothing_from_time() {
    let (machine, plan) = full();
    let catalogue = Catalogue::built_in().unwrap();
    let mut touches = touch(machine, plan, &Scenario::flawless(), None);
    for (i, t) in touches.iter_mut().enumerate() {
        t.time_s = Some(8.0 * i as f64);
        t.temperature_deg_c = Some(20.0 + 4e-3 * i as f64);
    }
    let task = design::Task {
        machine,
        catalogue: &catalogue,
        effects: fit::effects_of(&MODEL.map(str::to_owned), &catalogue, machine).unwrap(),
        held: Vec::new(),
        reference: machine.reference.pivot,
        temperature: true,
    };
    let effects: Vec<_> =
        ["ambient-bending", "drift-linear"].map(|e| (catalogue.get(e, machine).unwrap(), None)).into();
    let noise = design::Noise { sigma_mm: 1e-3, tau_mm: 0.0 };
    let made = design::Planned::from_run(&runs(&touches)[0]);
    let left = |room: Option<design::Room>| {
        let next = room.map(|room| design::Planned {
            room,
            mounting: Some("again".to_owned()),
            ..design::Planned::new(plan.clone())
        });
        let runs: Vec<design::Planned> = std::iter::once(made.clone()).chain(next).collect();
        let view = design::LinearisedPlan::with_effects(&task, &runs, &[], noise, &effects).unwrap();
        let products = Products::new(view.base(), &view.library.matrix().into_owned());
        let span = |i: usize| view.library.candidates()[i].variants[0].columns.clone();
        products.left(&span(0), None, Some(&span(1))).lambda
    };
    let (now, on, turned) = (left(None), left(Some(design::Room::GoesOn)), left(Some(design::Room::Swings)));
    assert!(now < 1e-3 && on < 1e-3 && turned > 25.0, "{now}, {on}, {turned}");
}

/// Where the spindle never tilts its growth and a drift along it are one: no program is promised, and the one that would have
/// to shrink is not named first.
#[test]
fn what_no_touches_part_is_said() {
    let machine = machine("trunnion");
    let plan = plan(&machine, "full");
    let scenario = Scenario::flawless().with_noise(1e-3, 0.3e-3, 31);
    let scenario = scenario.with(&machine, "warm-up", &[("wz", 8.0), ("tau", 0.3)]).unwrap();
    let touches = touch(&machine, &plan, &scenario, None);
    let runs = [Run { plan: &plan, touches: &touches, mounting: None, started_s: None }];
    let catalogue = Catalogue::built_in().unwrap();
    let effects = ["location-a", "location-c", "block-setup", "pretravel"].map(str::to_owned).to_vec();
    let settings = Settings { effects, quick: true, ..Settings::default() };
    let fit = fit::identify(&machine, &catalogue, &runs, &settings).unwrap();
    let planned = [design::Planned::from_run(&runs[0])];
    let options = Options { planned: Some(&planned), ..Options::default() };
    let subject = Subject { machine: &machine, catalogue: &catalogue, settings: &settings, fit: &fit };
    let found = diagnose(subject, &options).unwrap();
    let first = &found.candidates[0];
    assert_eq!((first.effect.as_str(), &first.same_as[..]), ("warm-up", &["spindle-growth".to_owned()][..]));
    assert!(first.never_parted, "{}", first.tell_apart);
    assert!(first.never_parted);
}

/// A term is its parameter times its formula: with the parameter inside once more it acts in second order.
#[test]
fn a_formula_that_holds_its_own_parameter_is_warned_of() {
    let of = |formula: &str| -> Vec<&'static str> {
        let text = format!(
            "[[effect]]\nid = \"mine\"\nat = \"B\"\nterms = [{{ parameter = \"p\", unit = \"um\", dof = \"dz\", formula = \"{formula}\" }}]\n"
        );
        let found = Catalogue::built_in().unwrap().add_file(&axiscal::diag::source("own.toml", text)).unwrap();
        found.0.iter().map(|f| f.code).collect()
    };
    assert_eq!(of("p*(1 - cos(B))"), ["effects::twice_inside"]);
    assert_eq!(of("0"), ["effects::nothing"]);
    assert!(of("1 - cos(B)").is_empty());
}

#[test]
fn a_name_that_formulas_have_is_refused_by_the_virtual_machine_too() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    verbs::ok(at, &[&["generate", "--program", "table"][..], &verbs::COMMON, &["."]].concat());
    for name in ["pi", "e", "sB", "exp", "two words"] {
        let own = format!(
            "[[effect]]\nid = \"mine\"\nat = \"B\"\nterms = [{{ parameter = \"{name}\", unit = \"um\", dof = \"dz\", formula = \"1 - cos(B)\" }}]\n"
        );
        std::fs::write(at.join("own.toml"), own).unwrap();
        std::fs::write(at.join("s.toml"), "seed = 1\neffects_file = [\"own.toml\"]\n").unwrap();
        let call = [&["simulate", "--plan", "table.plan.json", "--scenario", "s.toml"][..], &verbs::COMMON, &["t.log"]];
        let out = verbs::axiscal(at, &call.concat());
        let said = String::from_utf8_lossy(&out.stderr);
        assert!(out.status.code() == Some(2) && said.contains("cannot be the name of a parameter"), "{name}: {said}");
    }
}

/// A log is of the plan that has its name, however many runs the study has by now; and it counts once.
#[test]
fn a_joined_log_finds_its_plan_by_its_name() {
    let folder = verbs::touched(&["head", "table"], "seed = 5\n[noise]\ntouch_um = 1.0\n", None);
    let at = folder.path();
    verbs::study(at, &["head"]);
    for (from, to) in [("table.plan.json", "next-7.plan.json"), ("table.log", "next-7.log")] {
        std::fs::rename(at.join(from), at.join(to)).unwrap();
    }
    let join = ["plan-next", "study.toml", "--out", ".", "--controller", "linuxcnc", "--join", "next-7.log"];
    verbs::ok(at, &join);
    let text = std::fs::read_to_string(at.join("study.toml")).unwrap();
    assert!(text.contains("next-7.plan.json"), "{text}");
    let again = verbs::axiscal(at, &join);
    let said = String::from_utf8_lossy(&again.stderr);
    assert!(again.status.code() == Some(2) && said.contains("run 2 of the study already"), "{said}");
    assert_eq!(std::fs::read_to_string(at.join("study.toml")).unwrap(), text);

    // an effect of which these touches see nothing changes nothing, and no digits of the arithmetic are shown
    let said = verbs::ok(at, &["add", "study.toml", "zero-b", "--dry-run"]);
    assert!(said.contains("the cross-validated error stays the same") && !said.contains("0.00000000"), "{said}");
    assert!(said.contains("± in this table: one standard uncertainty"), "{said}");

    // a file that is not there has its line in the study
    std::fs::write(at.join("none.toml"), format!("effects_file = [\"nowhere.toml\"]\n{text}")).unwrap();
    let said = String::from_utf8(verbs::axiscal(at, &["identify", "none.toml"]).stderr).unwrap();
    assert!(said.contains("nowhere.toml") && said.contains("none.toml:1:17"), "{said}");
}

/// The study names a compensation, and the errors are as they were: nothing acted.
#[test]
fn a_compensation_that_did_not_act_is_suspected() {
    let hidden = |seed: u32| {
        format!("seed = {seed}\n[effects.location-c]\nEX0C = 0.02\nEY0C = -0.03\n[noise]\ntouch_um = 1.0\n")
    };
    let folder = verbs::touched(&["table"], &hidden(2), None);
    let at = folder.path();
    verbs::study(at, &["table"]);
    verbs::ok(at, &["export", "study.toml", "--controller", "linuxcnc", "--out", "comp"]);
    std::fs::write(at.join("again.toml"), hidden(3)).unwrap();
    let call = ["simulate", "--plan", "table.plan.json", "--scenario", "again.toml"];
    verbs::ok(at, &[&call[..], &verbs::COMMON, &["after.log"]].concat());
    let text = std::fs::read_to_string(at.join("study.toml")).unwrap();
    let after = text.replace("\"table.log\"", "\"after.log\"\ncompensation = \"comp\"");
    std::fs::write(at.join("after.toml"), after).unwrap();
    let (v, code) = verbs::json(at, &["verify", "study.toml", "after.toml"]);
    assert_eq!((v["verdict"].as_str(), code), (Some("not-improved"), 1), "{v}");
    assert!(v["remarks"].to_string().contains("did not act"), "{}", v["remarks"]);
}
