//! Combinations of parameters that the touches tell badly or not at all: they are named, and nothing else is lost with them.

use crate::common::{self, *};
use crate::doubt::{MODEL, fit, fit_with, measured};
use axiscal::fit::Settings;
use axiscal::fit::outcome::Status;
use axiscal::model::catalogue::Catalogue;
use axiscal::model::data::Run;

#[test]
fn weak_combinations_are_named() {
    // effects.md, B.1: on the paper's plan the squareness of Z hides behind the tilt of the head
    let machine = machine("swivel-head");
    let runs = measured(&machine, 13);
    let effects = [&MODEL[..], &["squareness-yz", "squareness-zx", "scale-z"]].concat();
    let o = fit(&machine, &runs, &effects, Settings::default()).outcome;
    assert!(o.weak.iter().any(|w| w.combination.contains_key("EA0Z")), "{:?}", o.weak);
    let pair = o.correlations.iter().any(|c| [&c.a, &c.b].contains(&&"EA0Z".to_owned()) && c.r.abs() > 0.9);
    assert!(pair, "{:?}", o.correlations);
    assert!(o.parameters.iter().all(|p| p.status == Status::Identified || p.sigma.is_none()));
}

#[test]
fn noise_does_not_make_a_null_direction_look_seen() {
    // a uniform scale of the machine is the head's length and the ball's radius (effects.md, B.1)
    let machine = machine("swivel-head");
    let runs = measured(&machine, 14);
    let effects = [&MODEL[..], &["scale-x", "scale-y", "scale-z"]].concat();
    let o = fit(&machine, &runs, &effects, Settings::default()).outcome;
    assert_eq!((o.unknowns, o.rank), (42, 41));
    assert!(o.undetermined.iter().any(|u| u.combination.contains_key("EXX") && u.combination.contains_key("EZ0B")));
    assert!(o.chi2_per_dof > 0.8, "{}", o.chi2_per_dof);
    // what is identified is known to its usual size times a few: no millimetre, no degree
    for p in o.parameters.iter().filter(|p| p.status == Status::Identified) {
        let most = match p.unit.as_str() {
            "mm" => 0.1,
            "deg" => 0.1,
            "um/m" => 1e3,
            other => panic!("{}: {other}", p.name),
        };
        assert!(p.sigma.is_some_and(|s| s > 0.0 && s < most), "{}: {:?} {}", p.name, p.sigma, p.unit);
    }
}

/// effects.md, B.1: the head alone has rank 29 and condition 14.2, the table alone 13 and 3.0.
#[test]
fn each_program_alone_is_as_well_conditioned_as_the_design_study_says() {
    let machine = machine("swivel-head");
    let both = measured(&machine, 21);
    for (run, effects, rank, condition) in
        [(0, &["location-b", "block-setup", "pretravel"][..], 29, 14.2), (1, &MODEL[..], 13, 3.0)]
    {
        let o = fit(&machine, &both[run..=run], effects, Settings::default()).outcome;
        println!("{} {}", o.rank, o.condition);
        assert_eq!(o.rank, rank);
        assert!((o.condition - condition).abs() < 0.15, "{}", o.condition);
    }
}

/// A pitch of an amplitude that the touches do not show cannot be told, and takes nothing else with it.
#[test]
fn a_pitch_of_nothing_leaves_the_errors_told() {
    let machine = machine("swivel-head");
    for seed in 30..30 + common::count(2, 4) {
        let runs = measured(&machine, seed);
        for pitch in ["pitch-x", "pitch-y", "warm-up"] {
            let o = fit(&machine, &runs, &[&MODEL[..], &[pitch]].concat(), Settings::default()).outcome;
            for name in ["EX0B", "EZ0B", "EA0B", "EC0B", "EX0C", "EY0C", "EA0C", "EB0C"] {
                let p = o.parameters.iter().find(|p| p.name == name).unwrap();
                assert!(p.status == Status::Identified, "{seed} {pitch}: {name} is {:?}; {:?}", p.status, o.warnings);
            }
        }
    }
}

/// A combination that is nearly, but not quite, without a trace is said too: an effect that differs from the place of C by
/// a ten-millionth only.
#[test]
fn nothing_falls_between_weak_and_unseen() {
    let machine = machine("swivel-head");
    let runs = measured(&machine, 23);
    for share in ["1e-5", "1e-6", "1e-7"] {
        let mut catalogue = Catalogue::built_in().unwrap();
        let text = format!(
            "[[effect]]\nid = \"near\"\nname = \"Nearly the same\"\nat = \"C\"\nterms = [{{ parameter = \"near\", unit = \"um\", dof = \"dx\", formula = \"1 + {share}*cos(3*C)\", typical = 16 }}]\n"
        );
        catalogue.add_file(&axiscal::diag::source("near.toml", &text)).unwrap();
        let runs: Vec<Run> =
            runs.iter().map(|(plan, touches)| Run { plan, touches, mounting: None, started_s: None }).collect();
        let effects = MODEL.iter().copied().chain(["near"]).map(str::to_owned).collect();
        let o = axiscal::fit::identify(&machine, &catalogue, &runs, &Settings { effects, ..Settings::default() })
            .unwrap()
            .outcome;
        let weak = o.weak.iter().find(|w| w.combination.contains_key("near") && w.combination.contains_key("EX0C"));
        let unseen = o.undetermined.iter().any(|u| u.combination.contains_key("near"));
        println!("{share}: {weak:?} {unseen}");
        let weak = weak.unwrap_or_else(|| panic!("{share}: {:?} {:?}", o.weak, o.undetermined));
        assert!(weak.times_typical > 100.0 && !unseen);
        assert!(weak.says.contains("the position of axis C in X (EX0C)"), "{}", weak.says);
    }
}

/// Where another direction without a trace moves a sum, that sum is not said to be seen; where none does, it is.
#[test]
fn a_sum_that_another_direction_moves_is_not_said_to_be_seen() {
    let machine = machine("swivel-head");
    let runs = measured(&machine, 32);
    let effect = |id: &str| {
        format!(
            "[[effect]]\nid = \"{id}\"\nname = \"Another place of C\"\nat = \"C\"\nterms = [{{ parameter = \"{id}\", unit = \"mm\", dof = \"dx\", formula = \"1\", typical = 0.016 }}]\n"
        )
    };
    let one = fit_with(&machine, &runs, &effect("again"), &["again"]).unwrap().outcome;
    assert!(
        one.undetermined.len() == 1 && one.undetermined[0].says.starts_with("Only the sum"),
        "{:?}",
        one.undetermined
    );
    let two = fit_with(&machine, &runs, &(effect("again") + &effect("thrice")), &["again", "thrice"]).unwrap().outcome;
    assert_eq!(two.undetermined.len(), 2);
    for u in &two.undetermined {
        assert!(!u.says.starts_with("Only") && u.says.contains("+1 mm of"), "{}", u.says);
    }
    // none of the three has a value, so no pair of them is told apart badly
    for c in &two.correlations {
        for name in [&c.a, &c.b] {
            let p = two.parameters.iter().find(|p| &p.name == name).unwrap();
            assert!(p.sigma.is_some(), "{c:?}");
        }
    }
}

/// Few touches: what is a gauge is said once, and not again as hardly told.
#[test]
fn a_gauge_is_not_hardly_told_too() {
    let machine = machine("swivel-head");
    let (plan, touches) = measured(&machine, 33).swap_remove(0);
    let runs = [(plan, touches[..29].to_vec())];
    let o = fit(&machine, &runs, &["location-b", "block-setup", "pretravel"], Settings::default()).outcome;
    assert!(!o.undetermined.is_empty());
    assert!(o.weak.iter().all(|w| w.times_typical < 1e9), "{:?}", o.weak);
}
