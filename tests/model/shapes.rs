//! Shape parameters: time constants, pitches, moments at which something jumps. What the touches say of them, and where they say
//! nothing.

use crate::common;
mod jumps;

use axiscal::fit::nonlinear_scan::start_shapes;
use axiscal::fit::outcome::Status;
use axiscal::fit::{Contradiction, Found, Knowledge, Remark};
use axiscal::fit::{Fit, Settings};
use axiscal::model::catalogue::Catalogue;
use axiscal::model::predict::Unknown;
use axiscal::simulate::Scenario;
use common::*;

/// A warm-up that is still under way when the run ends, and a pitch that nothing shows: how large they are depends on a shape that
/// the touches hardly tell, and their intervals say so.
#[test]
fn sizes_are_no_surer_than_their_shapes() {
    let machine = machine("trunnion");
    let full = plan(&machine, "full");
    let runs = common::count(10, 20);
    let (mut n, mut inside) = (0, 0);
    for (seed, visit_mm) in (1..=runs).map(|seed| (seed, if seed % 2 == 0 { 0.3e-3 } else { 0.5e-3 })) {
        let scenario = Scenario::flawless().with_noise(1e-3, visit_mm, seed);
        let slow = [("wx", 5.0), ("wz", 12.0), ("tau", 2.0)];
        let scenario = scenario.with(&machine, "warm-up", &slow).unwrap();
        let touches = touch(&machine, &full, &scenario, None);
        let model = ["location-a", "location-c", "block-setup", "pretravel", "warm-up", "pitch-x"];
        let fit = identify(&machine, &[(&full, &touches)], &model);
        for (name, truth) in [("wx", 5.0), ("wz", 12.0), ("tau", 2.0), ("EXXc", 0.0), ("EXXs", 0.0)] {
            let p = fit.outcome.parameters.iter().find(|p| p.name == name).unwrap();
            let Some(expanded) = p.expanded else {
                // nobody fixed it: what the search holds is not told, and no size that goes with it
                let shape = if name.starts_with("EXX") { "pitch_X" } else { "tau" };
                assert!(parameter(&fit, shape).sigma.is_none() && p.status == Status::Undetermined, "{name}: {p:?}");
                continue;
            };
            assert!(expanded.is_finite());
            let [low, high] = p.interval.unwrap_or([Some(p.value - expanded), Some(p.value + expanded)]);
            n += 1;
            inside += u64::from(low.is_none_or(|low| low <= truth) && high.is_none_or(|high| truth <= high));
        }
        assert!(fit.noise.tau_mm < 1.2e-3, "seed {seed}: {} mm", fit.noise.tau_mm);
    }
    println!("{inside} of {n} told");
    // what is called not told cannot be wrong: most of it is told
    assert!(2 * n >= 5 * runs, "{n} of {} values are told", 5 * runs);
    // nineteen of twenty, less twice the standard deviation of such a count
    assert!(inside * 10 >= n * 9, "{inside} of {n}");
}

/// A search for a time constant beside an earlier fit begins with everything else where it belongs beside the effect: the touches lie
/// nearly as close as at its end. Beside the values of the earlier fit they lay far off, and the search ran away. The earlier fit may
/// have shapes of its own: a warm-up that is there, and a wave of a screw that nothing shows, whose sizes begin at none.
#[test]
fn a_search_begins_near_its_end() {
    let machine = machine("swivel-head");
    let full = plan(&machine, "full");
    let catalogue = Catalogue::built_in().unwrap();
    let growth = [("spindle_growth", 30.0), ("spindle_tau", 3.0)];
    let warm = [("wx", 40.0), ("wz", 0.0), ("tau", 0.4)];
    for (other, is_there) in [(None, false), (Some("warm-up"), true), (Some("pitch-x"), false)] {
        let mut scenario = Scenario::flawless().with_noise(1e-3, 0.3e-3, 5);
        scenario = scenario.with(&machine, "spindle-growth", &growth).unwrap();
        if is_there {
            scenario = scenario.with(&machine, other.unwrap(), &warm).unwrap();
        }
        let touches = touch(&machine, &full, &scenario, None);
        let mut model = vec!["location-b", "location-c", "block-setup", "pretravel"];
        model.extend(other);
        let without = identify(&machine, &[(&full, &touches)], &model);
        model.push("spindle-growth");
        let with = identify(&machine, &[(&full, &touches)], &model);

        let start = start_shapes(&without, &machine, catalogue.get("spindle-growth", &machine).unwrap());
        assert!(start.shown, "{other:?}");
        let begin = |u: &Unknown| start.values.get(&u.name).copied().unwrap_or(u.start);
        let begins: Vec<f64> = with.model.unknowns.iter().map(begin).collect();
        let rms_um = |theta: &[f64]| {
            let gaps = with.data.observations.iter().map(|o| with.model.gap(o, theta));
            1e3 * (gaps.map(|gap| gap * gap).sum::<f64>() / with.data.observations.len() as f64).sqrt()
        };
        let (first, last) = (rms_um(&begins), rms_um(&with.theta));
        let without = without.outcome.rms_um;
        println!("{other:?}: begins at {first} um, ends at {last} um; {without} um without the effect");
        assert!(first - last < 0.1 * (without - last), "{other:?}: {first}, {last} and {without} um");
        if other == Some("pitch-x") {
            assert!(!start.values.contains_key("EXXc") && !start.values.contains_key("EXXs"), "{:?}", start.values);
        }
    }
}

/// A prior on a time constant counts in its interval: the surer, the narrower.
#[test]
fn a_prior_on_a_shape_narrows_its_interval() {
    let machine = machine("swivel-head");
    let full = plan(&machine, "full");
    let scenario = Scenario::flawless().with_noise(1e-3, 0.3e-3, 1);
    let scenario = scenario.with(&machine, "warm-up", &[("wz", 8.0)]).unwrap();
    let touches = touch(&machine, &full, &scenario, None);
    let mut last = f64::INFINITY;
    for sigma in [0.1, 0.01, 1e-6] {
        let prior = Knowledge::Prior { value: 0.5, sigma };
        let settings = Settings { knowledge: [("tau".to_owned(), prior)].into(), ..Settings::default() };
        let model = ["location-b", "location-c", "block-setup", "pretravel", "warm-up"];
        let fit = identify_with(&machine, &[(&full, &touches)], &model, settings);
        let p = fit.outcome.parameters.iter().find(|p| p.name == "tau").unwrap();
        let [low, high] = p.interval.unwrap().map(Option::unwrap);
        assert!(low < p.value && p.value < high && high - low < last, "{sigma}: {p:?}");
        assert!(high - low < 6.0 * sigma, "{sigma}: {low} to {high}");
        last = high - low;
    }
}

fn parameter<'f>(fit: &'f Fit, name: &str) -> &'f axiscal::fit::outcome::Parameter {
    fit.outcome.parameters.iter().find(|p| p.name == name).unwrap()
}

/// A prior on a time constant that the touches contradict: what they say without it is a time, with an interval that holds the
/// truth. A straight line through the solution led below 0 h.
#[test]
fn a_prior_on_a_shape_is_contradicted_by_what_the_touches_say_alone() {
    let machine = machine("swivel-head");
    let full = plan(&machine, "full");
    let model = ["location-b", "location-c", "block-setup", "pretravel", "warm-up"];
    for (truth, stated, sigma) in [(0.4, 3.0, 0.2), (2.0, 0.2, 0.02), (0.5, 0.5, 0.05)] {
        let scenario = Scenario::flawless().with_noise(0.5e-3, 0.2e-3, 3);
        let scenario = scenario.with(&machine, "warm-up", &[("wx", 6.0), ("wz", 15.0), ("tau", truth)]).unwrap();
        let touches = touch(&machine, &full, &scenario, None);
        let prior = Knowledge::Prior { value: stated, sigma };
        let settings = Settings { knowledge: [("tau".to_owned(), prior)].into(), ..Settings::default() };
        let fit = identify_with(&machine, &[(&full, &touches)], &model, settings);
        let said = contradiction(&fit);
        println!("{truth} {stated}: {said:?}");
        if (truth - stated).abs() < sigma {
            assert_eq!(said, None);
            continue;
        }
        let said = said.unwrap_or_else(|| panic!("{truth}: {:?}", fit.remarks));
        let Found::Interval([low, high]) = said.found else { panic!("{said:?}") };
        assert!(0.0 < low && low < truth && truth < high, "{said:?}");
    }
}

/// The first value that the touches contradict.
fn contradiction(fit: &Fit) -> Option<&Contradiction> {
    fit.remarks.iter().find_map(|r| if let Remark::Contradiction(c) = r { Some(c) } else { None })
}

/// A drift that is even all along is a warm-up without an end: its time constant runs out of its range, nobody is told one, and
/// no size beside it is sure.
#[test]
fn a_shape_that_runs_out_of_its_range_is_not_told() {
    let machine = machine("swivel-head");
    let full = plan(&machine, "full");
    let model = ["location-b", "location-c", "block-setup", "pretravel", "warm-up"];
    let mut out = 0;
    for seed in 1..=4 {
        let scenario = Scenario::flawless().with_noise(0.3e-3, 0.0, seed);
        let scenario = scenario.with(&machine, "drift-linear", &[("vx", 5.0), ("vz", 12.0)]).unwrap();
        let touches = touch(&machine, &full, &scenario, None);
        let fit = identify(&machine, &[(&full, &touches)], &model);
        let (tau, size) = (parameter(&fit, "tau"), parameter(&fit, "wz"));
        println!("{tau:?} {size:?} {:?}", fit.outcome.warnings);
        if fit.remarks.iter().any(|r| matches!(r, Remark::OutOfRange { name, .. } if name == "tau")) {
            out += 1;
            assert_eq!((tau.status, tau.sigma, tau.value), (Status::Undetermined, None, 20.0), "{tau:?}");
        } else {
            assert!(tau.expanded.is_none_or(|e| e > 0.5 * tau.value), "{tau:?}");
        }
        // 12 um each hour: beside any time constant that may be, a size that goes with it
        let Some(expanded) = size.expanded else { continue };
        assert!(expanded > 0.3 * size.value.abs(), "{size:?}");
    }
    assert!(out >= 1, "none of four ran out of its range");
}

/// Pitches of all of the range come back exactly where the touches tell them, whether the catalogue tries them or not; where few
/// positions take one for the other, none is called identified that is not right, and the others are named.
#[test]
fn a_pitch_is_the_right_one_or_not_told() {
    for (name, program, tells) in [("swivel-head", "full", true), ("trunnion", "basic", false)] {
        let machine = machine(name);
        let plan = plan(&machine, program);
        let first = if name == "trunnion" { "location-a" } else { "location-b" };
        let model = [first, "location-c", "block-setup", "pretravel", "pitch-x"];
        for pitch in [4.0, 7.3, 16.0, 32.0] {
            let of_screw = [("EXXc", 3.1), ("EXXs", -2.3), ("pitch_X", pitch)];
            let place = [("EX0C", 0.013), ("EB0C", -0.0015)];
            let scenario = Scenario::flawless().with(&machine, "pitch-x", &of_screw).unwrap();
            let scenario = scenario.with(&machine, "location-c", &place).unwrap();
            let fit = identify(&machine, &[(&plan, &touch(&machine, &plan, &scenario, None))], &model);
            let truth = |name: &str| of_screw.iter().chain(&place).find(|t| t.0 == name).map_or(0.0, |t| t.1);
            for p in fit.outcome.parameters.iter().filter(|p| p.status == Status::Identified && !p.name.contains('@')) {
                // mm and deg; a pitch that is a part of the steps of the touches hardly shows its own slope, and the search ends
                // in a valley that bends
                let exact = if p.unit == "um" { 1e-7 } else { 1e-10 };
                let room = if tells { exact } else { (1e-3 * p.expanded.unwrap()).max(exact) };
                assert!((p.value - truth(&p.name)).abs() < room, "{name} {pitch}: {p:?}");
            }
            let told = parameter(&fit, "pitch_X");
            assert_eq!(told.status == Status::Identified, tells, "{name} {pitch}: {told:?}");
            let names_it = fit.remarks.iter().any(|r| r.names().contains(&"pitch_X"));
            assert_eq!(names_it, !tells, "{name} {pitch}: {:?}", fit.remarks);
        }
    }
}

/// A time constant that the user holds at what the touches contradict, and one that nothing may have.
#[test]
fn a_held_shape_is_compared_and_has_a_range() {
    let machine = machine("swivel-head");
    let full = plan(&machine, "full");
    let scenario = Scenario::flawless().with_noise(1e-3, 0.3e-3, 5);
    let scenario = scenario.with(&machine, "warm-up", &[("wx", 8.0), ("wz", 20.0), ("tau", 0.5)]).unwrap();
    let touches = touch(&machine, &full, &scenario, None);
    let model = ["location-b", "location-c", "block-setup", "pretravel", "warm-up"];
    let with = |known: Knowledge| -> Settings {
        Settings {
            knowledge: [("tau".to_owned(), known)].into(),
            effects: model.iter().map(|e| (*e).to_owned()).collect(),
            ..Settings::default()
        }
    };
    let said = |value: f64| {
        let fit = identify_with(&machine, &[(&full, &touches)], &model, with(Knowledge::Fixed(value)));
        contradiction(&fit).is_some_and(|c| c.name == "tau" && c.sigma.is_none())
    };
    assert!(said(5.0) && said(0.06) && !said(0.5));
    for known in [Knowledge::Fixed(-1.0), Knowledge::Prior { value: 30.0, sigma: 1.0 }] {
        let run = axiscal::model::data::Run { plan: &full, touches: &touches, mounting: None, started_s: None };
        let catalogue = axiscal::model::catalogue::Catalogue::built_in().unwrap();
        let refused = axiscal::fit::identify(&machine, &catalogue, &[run], &with(known)).unwrap_err();
        assert!(refused.0[0].message.contains("lies outside of its range, 0.05 to 20"), "{refused}");
    }
}

/// A pitch that is there and too small to show may be any of its range: what goes with it is all that it may be beside any of them.
/// On the paper's plan the place of B held the truth in 31 of 38 runs.
#[test]
fn what_stands_beside_a_pitch_that_does_not_show_is_no_surer_than_it() {
    let machine = machine("swivel-head");
    let plans = [plan(&machine, "head"), plan(&machine, "table")];
    let model = ["location-b", "location-c", "block-setup", "pretravel", "pitch-x"];
    let (mut n, mut inside, mut not) = (0, 0, 0);
    for seed in 1..=12 {
        let of_screw = [("EXXc", 0.5), ("EXXs", if seed % 2 == 0 { 0.5 } else { -0.5 }), ("pitch_X", 10.0)];
        let made: Vec<_> = plans
            .iter()
            .zip([0, 100])
            .map(|(plan, more)| {
                let scenario = Scenario::flawless().with_noise(1e-3, 0.5e-3, seed + more);
                touch(&machine, plan, &scenario.with(&machine, "pitch-x", &of_screw).unwrap(), None)
            })
            .collect();
        let settings = Settings { touch_sigma_mm: Some(1e-3), visit_sigma_mm: Some(0.5e-3), ..Settings::default() };
        let fit = identify_with(&machine, &[(&plans[0], &made[0]), (&plans[1], &made[1])], &model, settings);
        for name in ["EX0B", "EZ0B", "EX0C"] {
            let p = parameter(&fit, name);
            let Some(expanded) = p.expanded else {
                not += 1;
                continue;
            };
            let [low, high] = p.interval.unwrap_or([Some(p.value - expanded), Some(p.value + expanded)]);
            n += 1;
            inside += i32::from(low.is_none_or(|low| low <= 0.0) && high.is_none_or(|high| 0.0 <= high));
        }
    }
    println!("{inside} of {n}, {not} not told");
    assert!(n >= 24 && inside * 20 >= n * 18, "{inside} of {n}, {not} not told");
}

/// A time constant of each block, of a user's effect: each is searched for, and has its interval, as one that all share. It stood
/// where its range begins, without a trace.
#[test]
fn each_block_may_have_a_time_constant_of_its_own() {
    const OWN: &str = "[[effect]]\nid = \"settling\"\nper = \"block\"\nat = \"block\"\nterms = [{ parameter = \"sz\", unit = \"um\", \
                       dof = \"dz\", formula = \"1 - exp(-t/st)\", typical = 10 }]\nshape = [{ parameter = \"st\", unit = \"h\", \
                       start = 0.1, min = 0.02, max = 10.0 }]\n";
    let machine = machine("trunnion");
    let mut catalogue = axiscal::model::catalogue::Catalogue::built_in().unwrap();
    catalogue.add_file(&axiscal::diag::source("own.toml", OWN)).unwrap();
    let full = plan(&machine, "full");
    let text = "effects_file = [\"own.toml\"]\n[effects.settling]\nsz = 12.0\nst = 0.6\n";
    let open = |name: &str| Ok(axiscal::diag::source(name, OWN));
    let (planted, _) =
        axiscal::simulate::scenario::parse_with(&axiscal::diag::source("s.toml", text), &machine, &open).unwrap();
    let settings = Settings {
        effects: ["location-a", "location-c", "block-setup", "pretravel", "settling"].map(str::to_owned).to_vec(),
        touch_sigma_mm: Some(0.5e-3),
        visit_sigma_mm: Some(0.0),
        ..Settings::default()
    };
    let (mut told, mut inside) = (0, 0);
    for seed in 1..=3 {
        let touches = touch(&machine, &full, &planted.clone().with_noise(0.5e-3, 0.0, seed), None);
        let run = axiscal::model::data::Run { plan: &full, touches: &touches, mounting: None, started_s: None };
        let fit = axiscal::fit::identify(&machine, &catalogue, &[run], &settings).unwrap();
        for p in fit.outcome.parameters.iter().filter(|p| p.effect == "settling") {
            let truth = if p.name.starts_with("st@") { 0.6 } else { 12.0 };
            // whichever of them runs out, each is brought back
            assert!(truth == 12.0 || (0.02..=10.0).contains(&p.value), "{p:?}");
            println!("{} {} {:?} {:?} {:?}", p.name, p.value, p.status, p.expanded, p.interval);
            let Some(expanded) = p.expanded else { continue };
            let [low, high] = p.interval.unwrap_or([Some(p.value - expanded), Some(p.value + expanded)]);
            told += 1;
            inside += i32::from(low.is_none_or(|low| low <= truth) && high.is_none_or(|high| truth <= high));
        }
        assert!(
            !fit.outcome.undetermined.iter().any(|u| u.says.contains("position of")),
            "{:?}",
            fit.outcome.undetermined
        );
    }
    println!("{inside} of {told}");
    assert!(told >= 6 && inside * 10 >= told * 9, "{inside} of {told}");
    // what the user knows of each, and it is true: the touches contradict none of it
    for seed in 1..=common::count(1, 3) {
        let touches = touch(&machine, &full, &planted.clone().with_noise(0.5e-3, 0.0, seed), None);
        let run = axiscal::model::data::Run { plan: &full, touches: &touches, mounting: None, started_s: None };
        let of_one = "st@full/a".to_owned();
        let settings = Settings {
            knowledge: [(of_one.clone(), Knowledge::Prior { value: 0.6, sigma: 0.05 })].into(),
            ..settings.clone()
        };
        let fit = axiscal::fit::identify(&machine, &catalogue, &[run], &settings).unwrap();
        assert_eq!(contradiction(&fit), None);
        let st = fit.outcome.parameters.iter().find(|p| p.name == of_one).unwrap();
        assert!((st.value - 0.6).abs() < 0.15, "{st:?}");
    }
}

/// What no touch sees stays unseen, however large something else is that turns or shifts the touches: of second order in both a tilt
/// showed beside a pitch of a millimetre, and was called identified.
#[test]
fn what_is_unseen_stays_unseen_beside_something_large() {
    for (name, program) in
        [("swivel-head", "head"), ("nutating-b", "basic"), ("trunnion-offset", "basic"), ("double-head", "double-head")]
    {
        let machine = machine(name);
        let plan = plan(&machine, program);
        let rotary: Vec<String> =
            machine.rotary().map(|a| format!("location-{}", a.name.to_string().to_lowercase())).collect();
        let unseen = |pitch_um: f64, with: &[&str]| -> Vec<String> {
            let scenario = Scenario::flawless().with_noise(1e-3, 0.0, 4);
            let scenario = scenario
                .with(&machine, "pitch-x", &[("EXXc", pitch_um), ("EXXs", 0.3 * pitch_um), ("pitch_X", 10.0)])
                .unwrap();
            let touches = touch(&machine, &plan, &scenario, None);
            let model: Vec<&str> = rotary
                .iter()
                .map(String::as_str)
                .chain(["block-setup", "pretravel"])
                .chain(with.iter().copied())
                .collect();
            let fit = identify(&machine, &[(&plan, &touches)], &model);
            let of_axes = fit.outcome.parameters.iter().filter(|p| p.effect.starts_with("location-"));
            of_axes.filter(|p| p.status != Status::Identified).map(|p| p.name.clone()).collect()
        };
        let small = unseen(0.0, &[]);
        let large = unseen(1000.0, &["pitch-x"]);
        println!("{name} {program}: {small:?} {large:?}");
        // a pitch may take something away, it shows nothing new
        assert!(small.iter().all(|n| large.contains(n)), "{name} {program}: {small:?} {large:?}");
    }
}

/// The uncertainty with unmodelled effects is never below the one without, whatever a shape does to the first.
#[test]
fn unmodelled_effects_make_nothing_surer() {
    let machine = machine("swivel-head");
    let full = plan(&machine, "full");
    let model = ["location-b", "location-c", "block-setup", "pretravel", "warm-up"];
    for (seed, wz) in [(1, 0.0), (2, 0.0), (3, 12.0), (4, 3.0)] {
        let scenario = Scenario::flawless().with_noise(1e-3, 0.5e-3, seed);
        let scenario = scenario.with(&machine, "warm-up", &[("wz", wz), ("tau", 1.0)]).unwrap();
        let touches = touch(&machine, &full, &scenario, None);
        let fit = identify(&machine, &[(&full, &touches)], &model);
        for p in &fit.outcome.parameters {
            let (Some(sigma), Some(with)) = (p.sigma, p.sigma_with_unmodelled) else { continue };
            assert!(with >= sigma * (1.0 - 1e-9), "seed {seed}: {p:?}");
        }
    }
}

/// What unmodelled effects of typical size make of a result has nothing to do with a shape in the model that nothing shows: the figures
/// are those beside the shape at a stated value. EY0C of the paper's plan came out four times too sure.
#[test]
fn the_second_figure_is_the_same_beside_an_untold_shape() {
    let machine = machine("swivel-head");
    let plans = [plan(&machine, "head"), plan(&machine, "table")];
    let model = ["location-b", "location-c", "squareness-yz", "block-setup", "pretravel", "spindle-growth"];
    let made: Vec<_> = plans
        .iter()
        .zip([5, 105])
        .map(|(plan, seed)| touch(&machine, plan, &Scenario::flawless().with_noise(1e-3, 0.5e-3, seed), None))
        .collect();
    let both = [(&plans[0], &made[0][..]), (&plans[1], &made[1][..])];
    let free = identify(&machine, &both, &model);
    let mut settings = Settings::default();
    settings.knowledge.insert("spindle_tau".into(), Knowledge::Fixed(parameter(&free, "spindle_tau").value));
    let held = identify_with(&machine, &both, &model, settings);
    assert_eq!(parameter(&free, "spindle_tau").status, Status::Undetermined);
    let mut n = 0;
    for p in &free.outcome.parameters {
        let other = parameter(&held, &p.name);
        let (Some(one), Some(two)) = (p.sigma_with_unmodelled, other.sigma_with_unmodelled) else { continue };
        // beside any time constant a little more is possible
        assert!((0.98..1.5).contains(&(one / two)), "{}: {one} and {two}", p.name);
        n += 1;
    }
    assert!(n > 20, "{n}");
    let weak = |fit: &Fit| -> Vec<Vec<String>> {
        let of_axes = fit.outcome.weak.iter().map(|w| w.combination.keys().cloned().collect::<Vec<String>>());
        of_axes.filter(|names| names.iter().all(|n| !n.starts_with('g') && !n.contains("tau"))).collect()
    };
    println!("{:?} {:?}", weak(&free), weak(&held));
    assert!(weak(&held).iter().all(|names| weak(&free).contains(names)));
}
