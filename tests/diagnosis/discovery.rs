//! What is in no catalogue, at counts that a test can afford; bars are those of docs/discovery.md widened by the sampling error of
//! these counts (three standard errors). And what the diagnosis says of single effects.
//! `cargo run --release --example discovery -- strange` makes the full counts.

use crate::discovery_bench::find;
use crate::discovery_bench::plant::{self, Bench};
use crate::generator::strange;
use axiscal::diagnose::{Diagnosis, Options, Subject, Verdict, with_effects};
use axiscal::fit::{Settings, identify_beside, identify_data};
use axiscal::model::catalogue::Catalogue;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

/// The least share that a sample of n may show where the true share is `bar`.
fn at_least(bar: f64, n: usize) -> f64 {
    bar - 3.0 * (bar * (1.0 - bar) / n as f64).sqrt()
}

fn check(what: &str, hits: usize, n: usize, bar: f64) {
    let share = hits as f64 / n as f64;
    println!("{what}: {hits} of {n} ({:.1} %), bar {:.1} %", 100.0 * share, 100.0 * bar);
    assert!(share >= at_least(bar, n), "{what}: {hits} of {n}");
}

#[test]
fn what_is_in_no_catalogue_is_never_adequate() {
    let (mut right_of_all, mut all, mut bare, mut after_two) = (0, 0, 0, 0);
    for (kind, (name, _, smooth)) in strange::KINDS.iter().enumerate() {
        let seen = strange::run(kind, 4, 105 + 100 * kind as u64);
        for s in &seen {
            assert!(s.verdict != Verdict::Adequate, "{name}: {s:?}");
            if *smooth {
                assert!(s.sketched.is_some_and(|rms| rms < 1.2), "{name}: {s:?}");
            }
        }
        bare += seen.iter().filter(|s| s.bare).count();
        after_two += seen.iter().filter(|s| s.adequate_after_two).count();
        let right = seen.iter().filter(|s| s.right()).count();
        // of each kind: chips are on faces of many directions, and a bump may look like one of them
        check(&format!("right variable first, {name}"), right, seen.len(), 0.80);
        right_of_all += right;
        all += seen.len();
    }
    check("right variable first", right_of_all, all, 0.90);
    check("something is still missing with two names in the model", all - after_two, all, 0.95);
    // every one of them would be wrong, or a part of what acts
    check("no bare name", all - bare, all, 0.97);
}

/// What is said of a machine with random location errors and block set-ups, and this besides.
fn said(bench: &Bench, wrong: &str, own: &str, without: &str) -> (axiscal::fit::Fit, Settings, Diagnosis) {
    let catalogue = Catalogue::built_in().unwrap();
    let base = plant::base(bench, &mut ChaCha8Rng::seed_from_u64(31));
    let touches = bench.measure(&format!("{base}{wrong}"), own, 1.0, 77);
    let data = find::data(&bench.machine, &bench.plans, &touches);
    let (mut fit, mut settings) = find::fit(&bench.machine, &catalogue, data, &[], None);
    if !without.is_empty() {
        settings.effects.retain(|e| e != without);
        fit = identify_data(&bench.machine, &catalogue, fit.data.clone(), &settings).unwrap();
    }
    let options = Options { refit: true, ..find::LEAN };
    let d = find::look(&bench.machine, &catalogue, &fit, &settings, &options);
    (fit, settings, d)
}

/// Seven teeth at a size that hides in the noise of a touch, and not among 744 of them.
#[test]
fn what_chance_does_not_make_is_not_called_faint() {
    let own = "[[effect]]\nid = \"planted\"\nat = \"C\"\nterms = [\n\
               { parameter = \"p\", unit = \"urad\", dof = \"rz\", formula = \"cos(7*C)\" },\n]\n";
    for urad in [45.0, 60.0] {
        let (_, _, d) = said(&Bench::full(), &format!("[effects.planted]\np = {urad:?}\n"), own, "");
        assert!(matches!(d.verdict, Verdict::Unexplained(_)), "{urad}: {}", d.says);
        assert!(
            !d.verdict.is_weak_pattern() && d.depends[0].by == "pose.C" && d.depends[0].p_adjusted < 1e-6,
            "{urad}: {}",
            d.says
        );
    }
}

/// An effect of which only some parameters act is no less that effect, and a jump may come in mid-visit.
#[test]
fn an_effect_of_the_catalogue_that_acts_in_a_part_of_its_parameters_is_named() {
    for (hour, size) in [(0.5, [8.0, -5.0, 0.0]), (0.7, [8.0, -5.0, 0.0]), (0.7, [8.0, 0.0, 0.0])] {
        let [dx, dy, dz] = size;
        let wrong = format!("[effects.block-slip]\ndx = {dx:?}\ndy = {dy:?}\ndz = {dz:?}\nfrom_h = {hour:?}\n");
        let (_, _, d) = said(&Bench::full(), &wrong, "", "");
        assert!(matches!(d.verdict, Verdict::MissingEffect(_)), "{hour} {size:?}: {}", d.says);
        assert_eq!(d.candidates[0].effect, "block-slip", "{hour} {size:?}: {}", d.says);
    }
    // along C's line a Z that lost its position does the same, with one parameter
    let (_, _, d) = said(&Bench::full(), "[effects.block-slip]\ndx = 0.0\ndy = 0.0\ndz = 8.0\nfrom_h = 0.7\n", "", "");
    let first = &d.candidates[0];
    assert_eq!((d.verdict.is_missing_effect(), first.effect.as_str()), (true, "lost-position-z"), "{}", d.says);
    assert!(first.same_as.iter().any(|e| e == "block-slip"), "{:?}", first.same_as);
    // the set-up of blocks left out of a model of blocks that stand 0.1 mm and a milliradian off
    let (_, _, d) = said(&Bench::full(), "", "", "block-setup");
    assert_eq!((d.verdict.is_missing_effect(), d.candidates[0].effect.as_str()), (true, "block-setup"), "{}", d.says);
}

/// What is announced to become less certain does so when the effect is added, and nothing else does.
#[test]
fn what_is_said_to_become_less_certain_does() {
    let catalogue = Catalogue::built_in().unwrap();
    let mut flags = 0;
    for (bench, wrong) in [
        (Bench::full(), "[effects.zero-b]\nEB0B = 0.004\n"),
        (Bench::paper(), "[effects.scale-x]\nEXX = 200.0\n"),
        (Bench::paper(), "[effects.warm-up]\nwx = 8.0\ntau = 0.4\n"),
        (Bench::full().with_visits(0.3), "[effects.warm-up]\nwx = 8.0\ntau = 0.4\n"),
    ] {
        let (fit, settings, d) = said(&bench, wrong, "", "");
        let Some(first) = d.candidates.first() else { panic!("{wrong}: {}", d.says) };
        let more = vec![first.effect.clone()];
        let (after, _) = find::fit(&bench.machine, &catalogue, fit.data.clone(), &more, settings.visit_sigma_mm);
        let results = |f: &axiscal::fit::Fit| -> Vec<(String, f64)> {
            let told = |p: &&axiscal::fit::outcome::Parameter| !p.name.contains('@');
            f.outcome.parameters.iter().filter(told).filter_map(|p| Some((p.name.clone(), p.sigma?))).collect()
        };
        let later = results(&after);
        for (name, sigma) in results(&fit) {
            let Some((_, then)) = later.iter().find(|l| l.0 == name) else { continue };
            let real = then / sigma;
            let announced = first.weakens.iter().find(|w| w.name == name).map(|w| w.sigma_after / w.sigma_before);
            if let Some(ratio) = announced {
                println!("{}: {name} {ratio:.2} times announced, {real:.2} found", first.effect);
                assert!(real / ratio > 0.8 && real / ratio < 1.25, "{} {name}: {ratio} {real}", first.effect);
                flags += 1;
            } else {
                assert!(real < 4.0, "{} {name}: {real} times, and nothing said", first.effect);
            }
        }
    }
    assert!(flags > 0, "nothing was announced: nothing was tested");
}

/// What is the same at every touch is said so, and no group of touches is credited with it.
#[test]
fn a_constant_goes_with_no_variable() {
    let (_, _, d) = said(&Bench::full(), "[effects.zero-b]\nEB0B = 0.004\n", "", "");
    let first = &d.depends[0];
    let shares: Vec<(&str, f64)> = d.depends.iter().map(|w| (w.by.as_str(), w.share)).collect();
    assert!(first.share > 0.8, "{shares:?}");
    assert!(d.depends.iter().skip(1).all(|w| w.share < 0.3 || w.by == "constant"), "{shares:?}");
}

/// What a candidate would leave is what its refit leaves, for the first and for those behind it; the same of a sketch.
#[test]
fn what_would_be_left_is_what_a_refit_leaves() {
    let catalogue = Catalogue::built_in().unwrap();
    for (bench, wrong) in [
        (Bench::full(), "[[harmonic]]\naxis = \"B\"\ndof = \"dx\"\nk = 2\ncos_um = 6.0\nsin_um = 4.0\n"),
        (Bench::full().with_visits(0.5), "[effects.warm-up]\nwx = 8.0\nwz = 5.0\ntau = 0.4\n"),
    ] {
        let (fit, settings, d) = said(&bench, wrong, "", "");
        let subject = Subject { machine: &bench.machine, catalogue: &catalogue, settings: &settings, fit: &fit };
        assert!(d.candidates.len() > 1, "{}", d.says);
        for c in &d.candidates {
            let after = with_effects(subject, &[c.effect.as_str()]).unwrap();
            // touches come back with an effect, or are left out with it: then the two are of other touches
            if after.rejected.len() == fit.rejected.len() {
                let (said, is) = (c.rms_after_um, after.outcome.rms_um);
                assert!((said / is - 1.0).abs() < 0.02, "{}: {said} said, {is} found", c.effect);
            }
        }
    }
    let wrong = "[[harmonic]]\naxis = \"C\"\ndof = \"dx\"\nk = 7\ncos_um = 6.0\nsin_um = 4.0\n";
    let bench = Bench::full().with_visits(0.5);
    let (fit, settings, _) = said(&bench, wrong, "", "");
    let subject = Subject { machine: &bench.machine, catalogue: &catalogue, settings: &settings, fit: &fit };
    let made = axiscal::diagnose::sketch::sketch(subject, &|_| false).unwrap();
    let mut own = Catalogue::built_in().unwrap();
    own.add_file(&axiscal::diag::source("my-effects.toml", made.toml.clone())).unwrap();
    let more = Subject { catalogue: &own, ..subject };
    let after = with_effects(more, &[made.id.as_str()]).unwrap().outcome.rms_um;
    let first = &made.tried[0];
    assert!((first.left_um / after - 1.0).abs() < 0.02, "{} said, {after} found\n{}", first.left_um, made.toml);
}

/// A block 1.7 mm from its place fits, and is said to be too far off: it may be another one.
#[test]
fn a_block_far_from_its_place_is_a_finding() {
    let d = said_of_a_block("[[block]]\nmounting = \"full\"\nname = \"b\"\nshift = [1.7, 0.0, 0.0]\n");
    assert_eq!(d.verdict, Verdict::Adequate, "{}", d.says);
    let found: Vec<&str> = d.oversized.iter().map(|o| o.parameter.as_str()).collect();
    assert_eq!(found, ["SX@full/b"], "{}", d.says);
    assert!(d.says.contains("another block stands there"), "{}", d.says);
}

/// A trial that begins where another fit has ended is held to what nominal touches see, as one that begins at nothing: where blocks stand
/// askew, sizes of blocks would leave a trace that no probe sees, and the search would run along it without an end.
#[test]
fn a_trial_sees_as_much_as_a_fit_from_nothing() {
    let (fit, settings, _) = said(&Bench::full(), "", "", "");
    let mut more = Settings { reference: Some(fit.model.reference), ..settings };
    more.effects.push("block-own-size".to_owned());
    let (machine, catalogue) = (Bench::full().machine, Catalogue::built_in().unwrap());
    let trial = identify_beside(&fit, &machine, &catalogue, &more).unwrap();
    let anew = identify_data(&machine, &catalogue, fit.data.clone(), &more).unwrap();
    assert_eq!(trial.observability.rank, anew.observability.rank);
    assert!((trial.chi2 / anew.chi2 - 1.0).abs() < 1e-6, "{} {}", trial.chi2, anew.chi2);
}

/// One block of another size: that block is named, with the edge and by how much, however large the fault is. The size is that of one
/// step from the model without it, where the largest misfits count less.
#[test]
fn one_block_of_another_size_is_named() {
    for size_um in [4.0, 12.0] {
        let wrong = format!("[[block]]\nmounting = \"full\"\nname = \"b\"\nsize_um = [{size_um:?}, 0.0, 0.0]\n");
        let d = said_of_a_block(&wrong);
        assert!(d.verdict.is_missing_effect(), "{size_um}: {}", d.says);
        let first = &d.candidates[0];
        assert_eq!(first.effect, "block-own-size", "{size_um}: {}", d.says);
        let named = first.says.split("block full/b differs most, its own_size_X is ").nth(1);
        let by: f64 = named.and_then(|s| s.split(' ').next()).and_then(|s| s.parse().ok()).unwrap_or_default();
        assert!(
            (by - size_um).abs() < 0.5 + 0.2 * size_um && first.says.contains(" um more than"),
            "{size_um}: {}",
            first.says
        );
    }
    let d = said_of_a_block("[[block]]\nmounting = \"full\"\nname = \"b\"\nsize_um = [6.0, 6.0, 6.0]\n");
    let first = &d.candidates[0];
    assert!(
        first.effect == "block-own-size" && first.says.contains("block full/b differs most"),
        "{}: {}",
        d.says,
        first.says
    );
}

/// Blocks stand where the plan has them: a scenario names each block once.
fn said_of_a_block(wrong: &str) -> Diagnosis {
    let bench = Bench::full();
    let catalogue = Catalogue::built_in().unwrap();
    let touches = bench.measure(wrong, "", 1.0, 78);
    let data = find::data(&bench.machine, &bench.plans, &touches);
    let (fit, settings) = find::fit(&bench.machine, &catalogue, data, &[], None);
    find::look(&bench.machine, &catalogue, &fit, &settings, &find::LEAN)
}
