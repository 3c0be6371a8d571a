//! Faults that a generator of its own plants (`tests/discovery`), at counts that a test can afford. The full counts:
//! `cargo run --release --example discovery -- faults 400`, `-- faultless`.

use crate::generator::bench::{At, Bench};
use crate::generator::judge::{self, Conditions, Outcome, planted, rate};
use crate::generator::mistakes::MISTAKES;
use crate::generator::{faults, forward};
use axiscal::diagnose::answer::{Candidate, Parameter};
use axiscal::log::Status;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

const PLAIN: Conditions = Conditions { visit_um: 0.0, noncentrality: None };

/// The generator and the program have no arithmetic in common: an errorless machine of the one has no residuals in the other.
#[test]
fn an_errorless_machine_of_the_generator_reads_as_planned() {
    for full in [false, true] {
        for bench in Bench::all(full) {
            let mut rng = ChaCha8Rng::seed_from_u64(1);
            for (run, (plan, _)) in bench.measure(&[], 0.0, 0.0, true, &mut rng).iter().zip(&bench.runs) {
                assert_eq!(run.len(), plan.touches.len());
                for (touch, planned) in run.iter().zip(&plan.touches) {
                    assert_eq!(touch.status, Status::Hit, "{} {}", bench.name, touch.id);
                    let off = touch.position.xyz_mm() - planned.nominal_position().xyz_mm();
                    assert!(off.norm() < 1e-9, "{} {}: {off}", bench.name, touch.id);
                }
            }
        }
    }
}

/// Every family has faults on some machine, and the ids that it expects exist.
#[test]
fn every_family_expects_effects_that_exist() {
    let catalogue = axiscal::model::catalogue::Catalogue::built_in().unwrap();
    let benches: Vec<Bench> = Bench::all(false);
    for (number, draw) in faults::families().into_iter().enumerate() {
        let mut found = 0;
        for bench in &benches {
            for seed in 0..8 {
                let Some(fault) = draw(bench, &mut ChaCha8Rng::seed_from_u64(seed)) else { continue };
                found += 1;
                let here = |id: &String| catalogue.get(id, &bench.machine).is_some();
                assert!(
                    fault.expects.iter().any(here),
                    "{number}: {} expects {:?} on {}",
                    fault.what,
                    fault.expects,
                    bench.name
                );
            }
        }
        assert!(found > 0, "family {number}");
    }
}

/// A turn by hand: 90 degrees about Z takes X to Y.
#[test]
fn a_quarter_turn_takes_x_to_y() {
    let turned = forward::turned(forward::V::z() * std::f64::consts::FRAC_PI_2) * forward::V::x();
    assert!((turned - forward::V::y()).norm() < 1e-15);
}

/// C of the paper's machine leans by 150 µrad to and fro once per turn, about a bearing 180 mm below the blocks: at the ball that is
/// 27 µm of sideways motion, and no run-out.
#[test]
fn a_wobble_says_where_its_bearing_is() {
    let bench = Bench::of("swivel-head", true);
    let about = bench.machine.reference.ball - forward::V::z() * 180.0;
    let wobble = move |at: &At, wrong: &mut forward::Wrong| {
        let turn = forward::V::new(at.q[5].cos(), 0.4 * at.q[5].sin(), 0.0) * 150e-6;
        wrong.before[5].push(forward::Slip::turn(turn, about));
    };
    let d = judge::diagnosis(&bench, &[&wobble], 5);
    let first = &d.candidates[0];
    assert_eq!(first.effect, "tilt-c-1", "{}", d.says);
    let says = &first.says;
    assert!(
        says.contains("wobble of C about a point 1") && says.contains(" mm below the ball: the bearing, not run-out"),
        "{says}"
    );
    let arm = first.parameters.iter().find(|p| p.name == "arm_tilt_c_1").unwrap();
    assert!((arm.value + 180.0).abs() < 40.0, "{}", arm.value);
    says_the_distance(first, arm);
}

/// X of the paper's machine bears the table and pitches by 120 µrad at 150 mm, about the middle of its carriages 180 mm below the ball:
/// at the ball it shows as 22 µm of another scale.
#[test]
fn a_pitching_carriage_says_where_it_turns() {
    let bench = Bench::of("swivel-head", true);
    let about = bench.machine.reference.ball - forward::V::z() * 180.0;
    let pitch = move |at: &At, wrong: &mut forward::Wrong| {
        wrong.after[0].push(forward::Slip::turn(forward::V::y() * (120e-6 * at.q[0] / 150.0), about));
    };
    let d = judge::diagnosis(&bench, &[&pitch], 5);
    let first = &d.candidates[0];
    assert_eq!(first.effect, "angular-bx", "{}", d.says);
    let says = &first.says;
    assert!(
        says.contains("turn of the carriage of X about a point 1")
            && says.contains(" mm below the ball: the guideway, not straightness or scale"),
        "{says}"
    );
    let value = |name: &str| first.parameters.iter().find(|p| p.name == name).unwrap().value;
    assert!((value("EBX_x") / value("EBX") * 1e3 - 180.0).abs() < 20.0, "{} {}", value("EBX_x"), value("EBX"));
}

/// X of the trunnion is a carriage in the head. Its guideway is bowed upwards, so that it sinks by 15 µm at 150 mm and pitches by the
/// slope, about bearings 300 mm below the ball.
#[test]
fn a_bowed_guideway_says_where_its_carriage_turns() {
    let bench = Bench::of("trunnion", true);
    let about = bench.machine.reference.ball - forward::V::z() * 300.0;
    let bow = move |at: &At, wrong: &mut forward::Wrong| {
        let u = at.q[0] / 150.0;
        // the slope is dz/dx = -2 * 15 µm * u / 150 mm, and what falls towards +X turns about +Y
        let (shift, turn) = (forward::V::z() * (-0.015 * u * u), forward::V::y() * (0.030 * u / 150.0));
        wrong.after[0].push(forward::Slip { shift, turn, about });
    };
    let d = judge::diagnosis(&bench, &[&bow], 5);
    let first = &d.candidates[0];
    assert_eq!(first.effect, "carriage-sag-x", "{}", d.says);
    let says = &first.says;
    assert!(says.contains("turn of the carriage of X about a point ") && says.contains(" mm below the ball"), "{says}");
    let arm = first.parameters.iter().find(|p| p.name == "arm_carriage_sag_x").unwrap();
    assert!((arm.value + 300.0).abs() < 40.0, "{}", arm.value);
    says_the_distance(first, arm);
}

/// The sentence has the distance of the list of sizes, with its standard uncertainty.
fn says_the_distance(candidate: &Candidate, arm: &Parameter) {
    let distance = format!("about a point {:.0} ± {:.0} mm below the ball", arm.value.abs(), arm.sigma.unwrap());
    assert!(candidate.says.contains(&distance), "{distance}: {}", candidate.says);
}

/// The weight of the head turns it by 80 µrad at B = 90: in its gear, or with its ram about a point 300 mm above the pivot.
#[test]
fn a_head_turned_by_its_weight_says_whether_its_ram_turns_too() {
    let bench = Bench::of("swivel-head", true);
    let pivot = bench.machine.reference.pivot;
    for (above_mm, says) in [
        (0.0, "the gear or clamp of B gives way, not what carries it"),
        (300.0, "what carries B gives way, not its gear or clamp"),
    ] {
        let about = pivot + forward::V::z() * above_mm;
        let lean = move |at: &At, wrong: &mut forward::Wrong| {
            wrong.before[4].push(forward::Slip::turn(forward::V::y() * (80e-6 * at.q[4].sin()), about));
        };
        let d = judge::diagnosis(&bench, &[&lean], 5);
        let group = judge::groups(&d).swap_remove(0);
        assert!(group.contains(&"head-tilt".to_owned()), "{above_mm}: {}", d.says);
        let mut rng = ChaCha8Rng::seed_from_u64(5);
        let base = bench.ordinary(&mut rng);
        let touches = bench.measure(&[&*base, &lean], 1.0, 0.0, true, &mut rng);
        let (fit, _) = judge::fit(&bench, &touches, &["head-tilt".to_owned()]);
        let [point] = &fit.outcome.turns_about[..] else { panic!("{above_mm}: {:?}", fit.outcome.turns_about) };
        assert!(point.says.ends_with(says), "{above_mm}: {}", point.says);
    }
}

/// One index position of `full` has another feed. A control that stores 12 ms late moves it as a whole: its touches are excluded, and
/// put back where the question is asked again.
#[test]
fn an_index_position_at_another_feed_tells_the_latency() {
    for machine in ["swivel-head", "trunnion", "double-head"] {
        let bench = Bench::of(machine, true);
        let feeds = |at: fn(f64, f64) -> f64, from: f64| {
            let touches = bench.runs.iter().flat_map(|(plan, _)| &plan.touches);
            touches.filter_map(|t| t.feed_mm_min).fold(from, at)
        };
        assert!(feeds(f64::max, 0.0) > 1.5 * feeds(f64::min, f64::INFINITY), "{machine}");
        let late = |at: &At, wrong: &mut forward::Wrong| wrong.late += 12e-3 * at.feed_mm_min / 60.0;
        let d = judge::diagnosis(&bench, &[&late], 8);
        assert!(d.verdict.is_missing_effect(), "{machine}: {}", d.says);
        let first = &d.candidates[0];
        assert_eq!(first.effect, "latency", "{machine}: {}", d.says);
        let size = first.parameters[0].value;
        assert!((size - 12.0).abs() < 1.0, "{machine}: {size} {}", first.parameters[0].unit);
        assert!(d.all_touches.is_some(), "{machine}: {}", d.says);
    }
}

/// The axis has another zero in the second of two runs: the blocks of each run stand for themselves. At 0.3 degrees the error is gross,
/// and the name is proposed because its refit does not raise the error.
#[test]
fn an_axis_that_was_homed_again_is_named() {
    let bench = Bench::of("trunnion", false);
    for (off_deg, is_gross) in [(0.03f64, false), (0.3, true)] {
        let homed = move |at: &At, wrong: &mut forward::Wrong| wrong.joint[3] += off_deg.to_radians() * at.run as f64;
        let d = judge::diagnosis(&bench, &[&homed], 6);
        assert_eq!(d.rms_um > 50.0, is_gross, "{}", d.rms_um);
        assert!(d.verdict.is_missing_effect(), "{}", d.says);
        assert_eq!(d.candidates[0].effect, "rehomed-a", "{}", d.says);
        let size = d.candidates[0].parameters.iter().find(|p| p.name == "rehomed_A@run2").unwrap();
        assert!((size.value - off_deg).abs() < 0.1 * off_deg, "{}", size.value);
        assert!(d.candidates[0].rms_after_um < 2.0, "{}", d.candidates[0].rms_after_um);
    }
}

/// From the middle of the measurement on an axis of the table and one of the head stand elsewhere than the control believes.
#[test]
fn an_axis_that_lost_its_position_is_named_with_its_moment() {
    for (machine, axis, off, effect) in [
        ("trunnion", 0, 0.012, "lost-position-x"),
        ("trunnion", 5, 1.2e-4, "lost-position-c"),
        ("swivel-head", 1, -0.012, "lost-position-y"),
        ("swivel-head", 4, 1.2e-4, "lost-position-b"),
    ] {
        let bench = Bench::of(machine, true);
        let slipped = move |at: &At, wrong: &mut forward::Wrong| {
            wrong.joint[axis] += if at.hours > 0.5 * at.hours_of_all { off } else { 0.0 };
        };
        let d = judge::diagnosis(&bench, &[&slipped], 7);
        assert!(d.verdict.is_missing_effect(), "{machine} {effect}: {}", d.says);
        let first = &d.candidates[0];
        assert_eq!(first.effect, effect, "{machine}: {}", d.says);
        let lost = first.parameters.iter().find(|p| p.name.starts_with("lost_") && !p.name.contains("_h_")).unwrap();
        let unit = if axis < 3 { 1e3 } else { 1e6 };
        assert!((lost.value / unit - off).abs() < 0.2 * off.abs(), "{machine} {effect}: {} {}", lost.value, lost.unit);
    }
}

fn count(outcomes: &[Outcome], what: impl Fn(&Outcome) -> bool) -> usize {
    outcomes.iter().filter(|o| what(o)).count()
}

/// The draws are fixed, and today all of them are in the first group: at most one may move to the second or third group.
fn are_in_the_first_groups(outcomes: &[Outcome]) {
    let (first, three) = (count(outcomes, |o| o.rank == Some(1)), count(outcomes, |o| o.rank.is_some()));
    for o in outcomes.iter().filter(|o| o.rank != Some(1)) {
        println!(
            "{}: {} {:?}, noncentrality {:.0}: {:?} {}",
            o.bench, o.what, o.expects, o.noncentrality, o.groups, o.verdict
        );
    }
    println!("first group {}, first three {}", rate(first, outcomes.len()), rate(three, outcomes.len()));
    assert!(first + 1 >= outcomes.len() && three == outcomes.len(), "{first} and {three} of {}", outcomes.len());
}

#[test]
fn hidden_faults_are_in_the_first_groups() {
    let benches: Vec<Bench> = [true, false].into_iter().flat_map(Bench::all).collect();
    let outcomes = planted(&benches, PLAIN, 24, 41);
    // one fault was planted in each
    assert!(outcomes.iter().all(|o| !o.pair));
    are_in_the_first_groups(&outcomes);
}

#[test]
fn hidden_faults_on_the_papers_plan() {
    are_in_the_first_groups(&planted(&Bench::all(false), PLAIN, 40, 45));
}

#[test]
fn hidden_faults_on_full() {
    let outcomes = planted(&Bench::all(true), PLAIN, 30, 42);
    are_in_the_first_groups(&outcomes);
    let [by_name, proposed, falls] =
        [count(&outcomes, |o| o.by_name), count(&outcomes, |o| o.proposed), count(&outcomes, |o| o.held_out_falls)];
    // of these draws; one may be fewer
    assert!(by_name + 1 >= 28 && proposed + 1 >= 29 && falls + 1 >= 30, "{by_name} {proposed} {falls}");
    let left = outcomes.iter().map(|o| o.reduced.1).sum::<f64>() / outcomes.len() as f64;
    assert!((left - 1.0).abs() < 0.05, "{left} times the noise is left");
}

/// 6.7 standard deviations of the noise in all.
#[test]
fn weak_faults_are_named() {
    let outcomes = planted(&Bench::all(true), Conditions { noncentrality: Some(45.0), ..PLAIN }, 24, 46);
    let (proposed, first) = (count(&outcomes, |o| o.proposed), count(&outcomes, |o| o.rank == Some(1)));
    // of these draws; one may be fewer
    assert!(proposed + 1 >= 20 && first + 1 >= 22, "{proposed} {first}");
}

/// Without a fault, without and with scatter of the index positions. So many of these draws are adequate; one may be fewer.
#[test]
fn machines_without_a_fault_are_adequate() {
    for (full, visit_um, runs, adequate) in
        [(false, 0.0, 40, 40), (false, 0.7, 40, 40), (true, 0.0, 32, 31), (true, 0.7, 32, 32)]
    {
        let verdicts = judge::clean(&Bench::all(full), visit_um, runs, 43);
        let found = verdicts.iter().filter(|(_, verdict)| verdict == "adequate").count();
        assert!(found + 1 >= adequate, "full {full}, scatter {visit_um} µm: {found} of {runs}: {verdicts:?}");
    }
}

#[test]
fn two_faults_at_once_are_both_named() {
    let pairs = judge::pairs(&Bench::all(true), 12, 44);
    for p in pairs.iter().filter(|p| !p.both) {
        println!("{}: {} and {}: {:?}", p.bench, p.what[0], p.what[1], p.steps);
    }
    let both = pairs.iter().filter(|p| p.both).count();
    // the draws are fixed, and today both are named in all of them: at most one may miss
    assert!(both + 1 >= pairs.len(), "{both} of {}", pairs.len());
}

/// All eight kinds on the paper's plan of each machine; on `full` the example counts them. Where the frame bends with a room that is not
/// logged, the first step asks for the temperatures (ten index positions of a head cannot tell that from scatter, other plans see a
/// drift), and the second names the cause.
#[test]
fn every_set_up_mistake_is_led_to_its_cause_within_two_steps() {
    let mut with_temperatures = Vec::new();
    let room = "temperature not logged while the frame bends with it";
    let on_full = MISTAKES.iter().filter(|m| m.what == room).map(|m| (Bench::of("trunnion", true), m));
    let cases = Bench::all(false).into_iter().flat_map(|bench| MISTAKES.iter().map(move |m| (bench.clone(), m)));
    for (bench, mistake) in cases.chain(on_full) {
        let led = judge::mistake(&bench, mistake, 56);
        assert!(led.led, "{led:?}");
        if led.gave_temperatures {
            with_temperatures.push((led.bench, led.what));
        }
    }
    assert!(with_temperatures.iter().all(|(_, what)| *what == room), "{with_temperatures:?}");
    assert_eq!(with_temperatures.len(), Bench::all(false).len() + 1, "{with_temperatures:?}");
}
