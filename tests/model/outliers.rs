//! Touches that do not belong, and those that the user takes out: single ones are rejected with their size, whole faces are
//! a finding, and good touches stay.

use crate::common::*;
use crate::doubt::{MODEL, fit, measured, sigma};
use axiscal::fit::outcome::Status;
use axiscal::fit::{Mask, Remark, Settings};
use axiscal::log::Touch;
use axiscal::program::plan::Plan;
use axiscal::simulate::Scenario;

/// Pushes a touch along its approach: a chip keeps the ball off the face.
fn chip(run: &mut (Plan, Vec<Touch>), index: usize, by_mm: f64) {
    let planned = run.0.touch(run.1[index].id).unwrap();
    let (start, end) = (planned.start_position(), planned.end_position());
    let way: Vec<f64> = (0..3).map(|k| start.0[k] - end.0[k]).collect();
    let length = way.iter().map(|w| w * w).sum::<f64>().sqrt();
    for (at, w) in run.1[index].position.0.iter_mut().zip(&way) {
        *at += by_mm * w / length;
    }
}

#[test]
fn a_chip_is_rejected_with_its_size_and_the_rest_is_left_alone() {
    let machine = machine("swivel-head");
    let clean = measured(&machine, 5);
    let whole = fit(&machine, &clean, &MODEL, Settings::default());
    assert!(whole.rejected.len() <= 1, "{:?}", whole.rejected);
    let mut runs = clean.clone();
    for (run, index, by) in [(0, 17, 0.012), (0, 18, 0.5), (1, 60, 0.03), (1, 100, -0.015)] {
        chip(&mut runs[run], index, by);
    }
    let spoiled = fit(&machine, &runs, &MODEL, Settings::default());
    let o = &spoiled.outcome;
    for (run, index) in [(0, 17), (0, 18), (1, 60), (1, 100)] {
        let id = runs[run].1[index].id;
        let found = o.rejected.iter().find(|r| r.run == run + 1 && r.id == id);
        assert!(found.is_some_and(|r| r.reason.contains("µm off")), "{id} of run {run}: {:?}", o.rejected);
    }
    assert!(o.rejected.len() <= 5, "{:?}", o.rejected);
    assert!(o.rms_um < 1.1 && (o.chi2_per_dof - 1.0).abs() < 0.25, "{} {}", o.rms_um, o.chi2_per_dof);
    // a rejected touch stays in the data, and says so
    assert_eq!(o.touches, 356);
    let residuals = o.residuals.as_ref().unwrap();
    assert_eq!(residuals.iter().filter(|r| !r.used).count(), o.rejected.len());
    for name in ["EX0B", "EY0C"] {
        assert!((value(&spoiled, name) - value(&whole, name)).abs() < 0.5 * sigma(&whole.outcome, name), "{name}");
    }
}

#[test]
fn too_many_strangers_and_whole_faces_are_findings() {
    let machine = machine("swivel-head");
    let mut runs = measured(&machine, 6);
    // a whole face of one block in one pose: something in common, not chips
    let face: Vec<usize> = {
        let first = runs[1].0.touch(runs[1].1[0].id).unwrap().clone();
        let same = |t: &Touch| {
            let p = runs[1].0.touch(t.id).unwrap();
            p.normal == first.normal && p.pose == first.pose && p.block == first.block
        };
        (0..runs[1].1.len()).filter(|&i| same(&runs[1].1[i])).collect()
    };
    assert!(face.len() >= 3);
    for &i in &face {
        chip(&mut runs[1], i, 0.02);
    }
    let spoiled = fit(&machine, &runs, &MODEL, Settings::default());
    let rejected = spoiled.rejected.len();
    assert!(rejected < face.len(), "{rejected} of {} touches of a face were thrown away together", face.len());
    assert!(spoiled.remarks.iter().any(|r| matches!(r, Remark::Misfit { .. })), "{:?}", spoiled.outcome.warnings);

    // the cap holds, and what the robust fit found is said
    let found = spoiled.remarks.iter().any(|r| matches!(r, Remark::OutliersBeyond { .. }));
    assert_eq!(found, spoiled.outliers_beyond.is_some());
}

/// Many gross touches strewn over the faces are left out, all of them, and the values are those of the rest; that they are
/// many is a finding all the same.
#[test]
fn many_strangers_do_not_make_the_values_wrong() {
    let machine = machine("swivel-head");
    for (seed, every, sizes) in [(7, 18, [0.03, 0.5]), (8, 9, [0.03, 0.08]), (9, 7, [-0.05, 0.3])] {
        let clean = measured(&machine, seed);
        let whole = fit(&machine, &clean, &MODEL, Settings::default());
        let mut runs = clean.clone();
        let mut bad = Vec::new();
        let mut touch = seed as usize;
        while touch < 356 {
            let (run, index) = if touch < 202 { (0, touch) } else { (1, touch - 202) };
            chip(&mut runs[run], index, sizes[bad.len() % 2]);
            bad.push((run + 1, runs[run].1[index].id));
            // not in step with the faces
            touch += every - 2 + (touch * 7) % 5;
        }
        let o = fit(&machine, &runs, &MODEL, Settings::default());
        let rejected: Vec<(usize, u64)> = o.outcome.rejected.iter().map(|r| (r.run, r.id)).collect();
        assert!(bad.iter().all(|b| rejected.contains(b)), "{seed}: {bad:?} {rejected:?}");
        assert!(rejected.len() <= bad.len() + 2, "{seed}: {} of {}", rejected.len(), bad.len());
        assert!((o.outcome.chi2_per_dof - 1.0).abs() < 0.3, "{}", o.outcome.chi2_per_dof);
        for p in o.outcome.parameters.iter().filter(|p| !p.name.contains('@')) {
            let off = (p.value - value(&whole, &p.name)).abs();
            assert!(off < 1.5 * p.sigma.unwrap(), "{seed} {}: {off} {:?}", p.name, p.sigma);
        }
        assert!(o.remarks.contains(&Remark::ManyOutliers { excluded: rejected.len(), of: 356 }), "{:?}", o.remarks);
    }
}

#[test]
fn a_masked_touch_is_not_used() {
    let machine = machine("swivel-head");
    let mut runs = measured(&machine, 8);
    chip(&mut runs[0], 3, 0.2);
    let id = runs[0].1[3].id;
    let settings = Settings { masked: vec![Mask { run: 0, id, reason: "coolant".into() }], ..Settings::default() };
    let o = fit(&machine, &runs, &MODEL, settings).outcome;
    assert!(o.rejected.iter().any(|r| r.id == id && r.reason.contains("coolant")), "{:?}", o.rejected);
}

#[test]
fn touches_that_are_all_taken_out_tell_nothing() {
    let machine = machine("swivel-head");
    let runs = measured(&machine, 15);
    let mask = |run: usize, t: &Touch| Mask { run, id: t.id, reason: "all".into() };
    let all: Vec<Mask> = runs.iter().enumerate().flat_map(|(r, run)| run.1.iter().map(move |t| mask(r, t))).collect();
    for masked in [all.clone(), all[10..].to_vec()] {
        let o = fit(&machine, &runs, &MODEL, Settings { masked, ..Settings::default() }).outcome;
        assert!(o.rank <= 10, "{}", o.rank);
        assert!(o.parameters.iter().all(|p| p.sigma.is_none_or(f64::is_finite)));
        assert!(o.parameters.iter().any(|p| p.status == Status::Undetermined));
    }
    let masked = vec![Mask { run: 0, id: 99_999, reason: "typo".into() }];
    let o = fit(&machine, &runs, &MODEL, Settings { masked, ..Settings::default() }).outcome;
    assert!(o.warnings.iter().any(|w| w.contains("99999")), "{:?}", o.warnings);
}

/// Few touches say little of what a standard deviation is: good ones stay, and a chip goes all the same.
#[test]
fn good_touches_of_a_short_plan_stay() {
    let machine = machine("swivel-head");
    let head = plan(&machine, "head");
    for (n, effects) in [(8, &["pretravel"][..]), (12, &["pretravel"]), (28, &["block-setup", "pretravel"])] {
        let short = Plan { touches: head.touches[..n].to_vec(), ..head.clone() };
        let (mut thrown, mut found) = (0, 0);
        for seed in 0..150 {
            let touches = touch(&machine, &short, &Scenario::flawless().with_noise(1e-3, 0.0, 1000 + seed), None);
            let mut run = (short.clone(), touches);
            let rejected = |run: &(Plan, Vec<Touch>)| {
                let settings = Settings { bare: true, ..Settings::default() };
                fit(&machine, std::slice::from_ref(run), effects, settings).rejected.keys().copied().collect::<Vec<_>>()
            };
            thrown += usize::from(!rejected(&run).is_empty());
            chip(&mut run, 2, 0.2);
            found += usize::from(rejected(&run) == [2]);
        }
        assert!(thrown <= 1, "{n} touches: good ones thrown out in {thrown} of 150 runs");
        assert!(found >= 140, "{n} touches: a chip found in {found} of 150 runs");
    }
}

/// Beside touches without noise a wrong one is off by any number of their standard deviations.
#[test]
fn a_number_of_standard_deviations_has_few_digits() {
    let machine = machine("swivel-head");
    let head = plan(&machine, "head");
    let touches = touch(&machine, &head, &Scenario::flawless(), None);
    let mut run = (head, touches);
    chip(&mut run, 100, 0.008);
    let rejected = fit(&machine, &[run], &["location-b", "block-setup", "pretravel"], Settings::default()).rejected;
    let reason = rejected.get(&100).unwrap().says();
    assert!(reason.contains("more than 1000 standard deviations") || reason.contains("(80."), "{reason}");
}
