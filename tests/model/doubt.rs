//! What a fit says about its own doubt: noise from repeats and revisits, type B rows, another reference point, priors
//! counted once.

use crate::common;
use axiscal::fit::outcome::{Outcome, Status};
use axiscal::fit::{Fit, Knowledge, NoiseSource, Remark, Settings, VisitSource, uncertainty};
use axiscal::log::Touch;
use axiscal::machine::Machine;
use axiscal::model::catalogue::Catalogue;
use axiscal::model::data::Run;
use axiscal::program::plan::Plan;
use axiscal::simulate::Scenario;
use common::*;

pub(super) const MODEL: [&str; 4] = ["location-b", "location-c", "block-setup", "pretravel"];

/// The paper's two runs on a slightly wrong machine with 1 um of noise.
pub(super) fn measured(machine: &Machine, seed: u64) -> Vec<(Plan, Vec<Touch>)> {
    let scenario = Scenario::flawless()
        .with(machine, "location-b", &[("EX0B", 0.01), ("EA0B", 0.002)])
        .unwrap()
        .with(machine, "location-c", &[("EY0C", -0.02)])
        .unwrap()
        .with_noise(1e-3, 0.0, seed);
    ["head", "table"].map(|p| plan(machine, p)).map(|p| (p.clone(), touch(machine, &p, &scenario, None))).into()
}

pub(super) fn fit(machine: &Machine, runs: &[(Plan, Vec<Touch>)], effects: &[&str], settings: Settings) -> Fit {
    let runs: Vec<(&Plan, &[Touch])> = runs.iter().map(|(p, t)| (p, &t[..])).collect();
    identify_with(machine, &runs, effects, settings)
}

pub(super) fn sigma(o: &Outcome, name: &str) -> f64 {
    o.parameters.iter().find(|p| p.name == name).unwrap().sigma.unwrap()
}

#[test]
fn the_noise_is_measured_where_the_plan_can_and_said_where_it_is_declared() {
    let machine = machine("swivel-head");
    let paper = fit(&machine, &measured(&machine, 9), &MODEL, Settings::default()).outcome;
    assert_eq!((paper.noise_source, paper.visit_source), (NoiseSource::Declared, VisitSource::Declared));
    assert!(paper.noise_says.contains("declared repeatability"), "{}", paper.noise_says);
    // what is only declared of the visits widens the uncertainties too, and is said; the probe's noise stands beside it
    assert!(paper.noise_says.contains("declared indexing repeatability"), "{}", paper.noise_says);
    assert!((paper.visit_um - 0.5f64.sqrt()).abs() < 1e-9, "{}", paper.visit_um);
    let calm = Settings { visit_sigma_mm: Some(0.0), ..Settings::default() };
    let calm = fit(&machine, &measured(&machine, 9), &MODEL, calm).outcome;
    // these visits do not scatter: the residuals show less than is declared, and the uncertainties count that
    assert!(paper.noise_says.contains("the residuals show"), "{}", paper.noise_says);
    let stated = Settings { visit_sigma_mm: Some(0.5f64.sqrt() * 1e-3), ..Settings::default() };
    let stated = fit(&machine, &measured(&machine, 9), &MODEL, stated).outcome;
    let all = paper.parameters.iter().zip(&calm.parameters).zip(&stated.parameters);
    for ((with, without), stated) in all.filter(|((p, _), _)| !p.name.contains('@')) {
        let (alone, least) = (with.sigma_noise.unwrap(), without.sigma_noise.unwrap());
        if with.name != "pretravel" {
            assert!(stated.sigma.unwrap() > 1.3 * alone, "{}: {:?} of {alone}", with.name, stated.sigma);
            assert!((alone..stated.sigma.unwrap()).contains(&with.sigma.unwrap()), "{}: {:?}", with.name, with.sigma);
        }
        assert!((0.99..1.3).contains(&(alone / least)), "{}: {alone} and {least}", with.name);
    }
    let full = plan(&machine, "full");
    let scenario = Scenario::flawless().with_noise(0.7e-3, 0.4e-3, 12);
    let touches = touch(&machine, &full, &scenario, None);
    let o = fit(&machine, &[(full, touches)], &MODEL, Settings::default()).outcome;
    assert_eq!((o.noise_source, o.visit_source), (NoiseSource::Repeats, VisitSource::Revisits));
    assert!((o.noise_um / 0.7 - 1.0).abs() < 0.25, "{}", o.noise_um);
    assert!(o.visit_um > 0.1 && o.visit_um < 0.9, "{}", o.visit_um);
    // intervals are wider than twice the standard uncertainty where the noise itself is known from few touches
    let p = o.parameters.iter().find(|p| p.name == "EX0B").unwrap();
    assert!(p.expanded.unwrap() > 1.97 * p.sigma.unwrap() && p.expanded.unwrap() < 4.0 * p.sigma.unwrap());
}

#[test]
fn type_b_rows_widen_and_unmodelled_effects_are_shown_beside() {
    let machine = machine("swivel-head");
    let runs = measured(&machine, 10);
    let bare = fit(&machine, &runs, &MODEL, Settings::default()).outcome;
    let type_b = [("dL".to_owned(), 0.005), ("size_X".to_owned(), 0.5)].into_iter().collect();
    let wide = fit(&machine, &runs, &MODEL, Settings { type_b, ..Settings::default() }).outcome;
    // the tool's length is the head's offset along the spindle: its whole doubt goes there
    let (without, with) = (sigma(&bare, "EZ0B"), sigma(&wide, "EZ0B"));
    assert!((with.powi(2) - without.powi(2) - 0.005f64.powi(2)).abs() < 1e-8, "{without} {with}");
    assert_eq!(wide.type_b.len(), 2);
    let values = |o: &Outcome| o.parameters.iter().map(|p| p.value).collect::<Vec<_>>();
    assert_eq!(values(&bare), values(&wide), "type B rows move nothing");
    for p in bare.parameters.iter().filter(|p| MODEL[..2].contains(&p.effect.as_str())) {
        // effects.md, section D: aliasing, not the probe, limits the paper's plan
        assert!(p.sigma_with_unmodelled.unwrap() > 2.0 * p.sigma.unwrap(), "{}", p.name);
        // the rest of the standard uncertainty is the scatter of visits that the machine's file declares
        assert!(p.sigma_noise.unwrap() < p.sigma.unwrap(), "{}", p.name);
    }
    let type_b = [("nonsense".to_owned(), 1.0)].into_iter().collect();
    let all: Vec<(&Plan, &[Touch])> = runs.iter().map(|(p, t)| (p, &t[..])).collect();
    let runs: Vec<_> = all
        .iter()
        .map(|(plan, touches)| axiscal::model::data::Run { plan, touches, mounting: None, started_s: None })
        .collect();
    let settings = Settings { type_b, effects: MODEL.iter().map(|e| (*e).to_owned()).collect(), ..Settings::default() };
    let catalogue = axiscal::model::catalogue::Catalogue::built_in().unwrap();
    let failure = axiscal::fit::identify(&machine, &catalogue, &runs, &settings).unwrap_err();
    assert_eq!(failure.0[0].code, "model::unknown_type_b");
}

#[test]
fn another_reference_moves_values_and_covariance_together() {
    let machine = machine("swivel-head");
    let runs = measured(&machine, 11);
    let at_pivot = fit(&machine, &runs, &MODEL, Settings::default());
    let low = nalgebra::Vector3::new(0.0, 0.0, -207.684);
    let at_block = fit(&machine, &runs, &MODEL, Settings { reference: Some(low), ..Settings::default() });
    // EX0C' = EX0C + dz * EB0C, EY0C' = EY0C - dz * EA0C (seed method, section 1)
    let c = uncertainty::results_covariance(&at_pivot);
    let at = |n: &str| c.names.iter().position(|m| m == n).unwrap();
    for (offset, tilt, sign) in [("EX0C", "EB0C", 1.0), ("EY0C", "EA0C", -1.0)] {
        let lever = sign * low.z.to_radians();
        let moved = value(&at_pivot, offset) + lever * value(&at_pivot, tilt);
        assert!((value(&at_block, offset) - moved).abs() < 1e-6);
        let (o, t) = (at(offset), at(tilt));
        let variance = c.matrix[o][o] + 2.0 * lever * c.matrix[o][t] + lever * lever * c.matrix[t][t];
        assert!((sigma(&at_block.outcome, offset) / variance.sqrt() - 1.0).abs() < 1e-3, "{offset}");
    }
    // the same fit: neither its condition nor what is left depends on where the errors are stated
    let (a, b) = (&at_pivot.outcome, &at_block.outcome);
    assert!((a.condition / b.condition - 1.0).abs() < 1e-6, "{} {}", a.condition, b.condition);
    assert!((a.chi2_per_dof - b.chi2_per_dof).abs() < 1e-9);
    // effects.md, section 2: the base Jacobian of the paper's plan, 17.3
    assert!((a.condition - 17.3).abs() < 0.1, "{}", a.condition);
}

#[test]
fn priors_are_shown_and_counted_once() {
    let machine = machine("swivel-head");
    let runs = measured(&machine, 12);
    let knowledge = [("EX0B".to_owned(), Knowledge::Prior { value: 0.01, sigma: 0.0002 })].into_iter().collect();
    // a prior changes what the residuals show of the scatter a little: it is stated here
    let stated = Settings { visit_sigma_mm: Some(0.0007), ..Settings::default() };
    let bare = fit(&machine, &runs, &MODEL, stated.clone()).outcome;
    let o = fit(&machine, &runs, &MODEL, Settings { knowledge, ..stated }).outcome;
    assert_eq!((o.priors.len(), o.priors[0].name.as_str()), (1, "EX0B"));
    assert_eq!(o.dof, bare.dof + 1);
    let expected = (sigma(&bare, "EX0B").powi(-2) + 0.0002f64.powi(-2)).powf(-0.5);
    assert!((sigma(&o, "EX0B") / expected - 1.0).abs() < 1e-3);
}

/// A type B row that goes with the temperature counts per kelvin where no touch carries one, and says so.
#[test]
fn a_temperature_row_without_temperatures_is_not_zero() {
    let machine = machine("swivel-head");
    let runs = measured(&machine, 22);
    let stated = |with: bool| {
        let runs: Vec<_> = runs
            .iter()
            .cloned()
            .map(|(plan, mut touches)| {
                touches.iter_mut().for_each(|t| t.temperature_deg_c = with.then_some(21.0));
                (plan, touches)
            })
            .collect();
        let type_b = [("expansion".to_owned(), 2.0)].into_iter().collect();
        fit(&machine, &runs, &MODEL, Settings { type_b, ..Settings::default() }).outcome
    };
    let (without, warm) = (stated(false), stated(true));
    let says =
        |o: &axiscal::fit::outcome::Outcome| o.warnings.iter().any(|w| w.contains("expansion") && w.contains("1 K"));
    assert!(says(&without) && !says(&warm), "{:?}", without.warnings);
    let of = |o: &axiscal::fit::outcome::Outcome| {
        o.parameters.iter().find(|p| p.name == "EZ0B").unwrap().sigma_type_b.unwrap()
    };
    assert!(of(&without) > 1e-5, "{}", of(&without));
    assert!((of(&without) / of(&warm) - 1.0).abs() < 1e-9, "{} {}", of(&without), of(&warm));
}

/// At 20 °C the thermal rows make nothing, which is said; the thermometer's own doubt acts there too, by all that goes with it.
#[test]
fn the_doubt_of_the_thermometer_is_a_row_of_its_own() {
    let machine = machine("swivel-head");
    let runs = measured(&machine, 23);
    let stated = |rows: &[(&str, f64)]| {
        let runs: Vec<_> = runs
            .iter()
            .cloned()
            .map(|(plan, mut touches)| {
                touches.iter_mut().for_each(|t| t.temperature_deg_c = Some(20.0));
                (plan, touches)
            })
            .collect();
        let type_b = rows.iter().map(|(name, sigma)| ((*name).to_owned(), *sigma)).collect();
        fit(&machine, &runs, &MODEL, Settings { type_b, ..Settings::default() }).outcome
    };
    let of = |o: &axiscal::fit::outcome::Outcome| {
        o.parameters.iter().find(|p| p.name == "EZ0B").unwrap().sigma_type_b.unwrap()
    };
    let nothing = stated(&[("expansion", 2.0)]);
    assert!(nothing.warnings.iter().any(|w| w.contains("expansion has no effect")), "{:?}", nothing.warnings);
    assert!(of(&nothing) == 0.0);
    let half = stated(&[("temperature", 0.5)]);
    let whole = stated(&[("temperature", 1.0)]);
    assert_eq!((half.type_b[0].name.as_str(), half.type_b[0].unit.as_str()), ("temperature", "K"));
    assert!(half.warnings.iter().all(|w| !w.contains("has no effect")), "{:?}", half.warnings);
    // 0.5 K of some 10 ppm/K over the height of the blocks above R, as EZ0B: µm and not nothing
    assert!((1e-5..1e-2).contains(&of(&half)), "{}", of(&half));
    assert!((of(&whole) / of(&half) - 2.0).abs() < 1e-9);
}

/// Of a plan without revisits `assess` promises what `identify` then states, with the same noise: the probe's share and, with the
/// scatter of indexing, the whole.
#[test]
fn assess_promises_what_identify_states() {
    use axiscal::design::{Noise, Planned, Request, Task, assess};
    let machine = machine("swivel-head");
    let catalogue = Catalogue::built_in().unwrap();
    let runs = measured(&machine, 31);
    let effects: Vec<String> = MODEL.iter().map(|e| (*e).to_owned()).collect();
    let task = Task {
        machine: &machine,
        catalogue: &catalogue,
        effects: axiscal::fit::effects_of(&effects, &catalogue, &machine).unwrap(),
        held: Vec::new(),
        reference: machine.reference.pivot,
        temperature: true,
    };
    let promised = assess(&Request {
        task,
        runs: runs.iter().map(|r| Planned::new(r.0.clone())).collect(),
        names: vec!["head".into(), "table".into()],
        probe: Noise { sigma_mm: 1e-3, tau_mm: 0.0 },
        acting_tau_mm: None,
    })
    .unwrap();
    // a plan without touches knows the declared scatter only
    let visit_sigma_mm = Some(0.5f64.sqrt() * 1e-3);
    let settings = Settings { touch_sigma_mm: Some(1e-3), visit_sigma_mm, ..Settings::default() };
    let stated = fit(&machine, &runs, &MODEL, settings).outcome;
    for p in &promised.parameters {
        let q = stated.parameters.iter().find(|q| q.name == p.name).unwrap();
        let (whole, alone) =
            (q.sigma.unwrap() / p.sigma_with_visits.unwrap(), q.sigma_noise.unwrap() / p.sigma.unwrap());
        assert!((whole - 1.0).abs() < 0.02, "{}: {whole}", p.name);
        // the fit weighs the touches for the scatter of visits too, which costs a little of the probe's share
        assert!((0.99..1.3).contains(&alone), "{}: {alone}", p.name);
        if p.name != "pretravel" {
            assert!(p.sigma_with_visits.unwrap() > 1.3 * p.sigma.unwrap(), "{}", p.name);
        }
    }
}

/// A study with an effect of the user's own beside [`MODEL`].
pub(super) fn fit_with(
    machine: &Machine,
    runs: &[(Plan, Vec<Touch>)],
    own: &str,
    effects: &[&str],
) -> axiscal::diag::Result<Fit> {
    let mut catalogue = Catalogue::built_in().unwrap();
    catalogue.add_file(&axiscal::diag::source("own.toml", own)).unwrap();
    let runs: Vec<Run> =
        runs.iter().map(|(plan, touches)| Run { plan, touches, mounting: None, started_s: None }).collect();
    let effects = MODEL.iter().chain(effects).map(|e| (*e).to_owned()).collect();
    axiscal::fit::identify(machine, &catalogue, &runs, &Settings { effects, ..Settings::default() })
}

/// A prior and a held value that the touches contradict are said with both numbers, and the model is not blamed for them; those
/// that agree are not.
#[test]
fn what_the_touches_contradict_is_said() {
    let machine = machine("swivel-head");
    let runs = measured(&machine, 34);
    let with = |k: Knowledge| {
        let knowledge = [("EX0B".to_owned(), k)].into_iter().collect();
        fit(&machine, &runs, &MODEL, Settings { knowledge, ..Settings::default() })
    };
    let bare = fit(&machine, &runs, &MODEL, Settings::default());
    let found = |fit: &Fit| {
        fit.remarks.iter().find_map(|r| if let Remark::Contradiction(c) = r { Some(c.clone()) } else { None })
    };
    let of_misfit = |fit: &Fit| fit.remarks.iter().any(|r| matches!(r, Remark::Misfit { .. }));
    for (known, prior) in
        [(Knowledge::Prior { value: 0.05, sigma: 0.001 }, Some(0.001)), (Knowledge::Fixed(0.05), None)]
    {
        let wrong = with(known);
        let c = found(&wrong).unwrap_or_else(|| panic!("{:?}", wrong.remarks));
        assert_eq!((c.name.as_str(), c.stated, c.sigma), ("EX0B", 0.05, prior));
        // the value is that of the fit without what is stated
        assert!((c.value - value(&bare, "EX0B")).abs() < sigma(&bare.outcome, "EX0B"), "{c:?}");
        assert!(prior.is_none() || !of_misfit(&wrong), "{:?}", wrong.remarks);
    }
    for good in [Knowledge::Prior { value: 0.01, sigma: 0.001 }, Knowledge::Fixed(value(&bare, "EX0B"))] {
        assert_eq!(found(&with(good)), None);
    }
}

/// The tool's length is one number with EZ0B: with a prior of the one, the other lives from it alone.
#[test]
fn a_value_that_lives_from_anothers_prior_is_the_priors() {
    let machine = machine("swivel-head");
    let runs = measured(&machine, 35);
    let knowledge = [("dL".to_owned(), Knowledge::Prior { value: 0.0, sigma: 0.005 })].into_iter().collect();
    let effects = [&MODEL[..], &["tool-length"]].concat();
    let o = fit(&machine, &runs, &effects, Settings { knowledge, ..Settings::default() }).outcome;
    let status = |name: &str| o.parameters.iter().find(|p| p.name == name).unwrap().status;
    assert_eq!((status("dL"), status("EZ0B")), (Status::PriorDominated, Status::PriorDominated));
    assert_eq!((status("EX0B"), status("EY0C")), (Status::Identified, Status::Identified));
}

/// The covariance that is given out has the squares of the standard uncertainties on its diagonal, type B rows and all.
#[test]
fn the_covariance_holds_the_type_b_rows() {
    let machine = machine("swivel-head");
    let runs = measured(&machine, 36);
    let type_b = [("dL".to_owned(), 0.005), ("size_X".to_owned(), 0.5)].into_iter().collect();
    let fit = fit(&machine, &runs, &MODEL, Settings { type_b, ..Settings::default() });
    let (full, a) = (uncertainty::full_covariance(&fit), uncertainty::results_covariance(&fit));
    assert_eq!(full.names, a.names);
    let mut wider = 0;
    for (i, name) in full.names.iter().enumerate() {
        let sigma = sigma(&fit.outcome, name);
        assert!((full.matrix[i][i] / (sigma * sigma) - 1.0).abs() < 1e-9, "{name}");
        wider += usize::from(full.matrix[i][i] > 1.01 * a.matrix[i][i]);
        for j in 0..i {
            // a covariance still
            let limit = (full.matrix[i][i] * full.matrix[j][j]).sqrt();
            assert!(full.matrix[i][j].abs() <= limit && full.matrix[i][j] == full.matrix[j][i]);
        }
    }
    assert!(wider > 0);
}

/// A formula without a usable size is refused with its touch, in the model and among what is left out of it.
#[test]
fn a_kilometre_is_no_value() {
    let machine = machine("swivel-head");
    let runs = measured(&machine, 37);
    for formula in ["tan(B)", "1e200*B"] {
        let own = format!(
            "[[effect]]\nid = \"mine\"\nname = \"Mine\"\nat = \"B\"\nterms = [{{ parameter = \"mine\", unit = \"um\", dof = \"dx\", formula = \"{formula}\" }}]\n"
        );
        let failure = fit_with(&machine, &runs, &own, &["mine"]).unwrap_err();
        assert_eq!(failure.0[0].code, "model::no_value");
        assert!(failure.0[0].message.contains("has no usable value at"), "{}", failure.0[0].message);
        let beside = fit_with(&machine, &runs, &own, &[]).unwrap().outcome;
        assert!(beside.warnings.iter().any(|w| w.contains("no usable value")), "{:?}", beside.warnings);
        let bare = fit(&machine, &runs, &MODEL, Settings::default()).outcome;
        for (p, q) in beside.parameters.iter().zip(&bare.parameters) {
            assert_eq!(p.sigma_with_unmodelled, q.sigma_with_unmodelled, "{}", p.name);
        }
    }
}

/// Repeats that agree exactly are not called too few.
#[test]
fn a_log_without_noise_is_said_to_be_one() {
    let machine = machine("swivel-head");
    let full = plan(&machine, "full");
    let touches = touch(&machine, &full, &Scenario::flawless(), None);
    let o = fit(&machine, &[(full, touches)], &MODEL, Settings { quick: true, ..Settings::default() }).outcome;
    assert_eq!(o.noise_source, NoiseSource::Declared);
    assert!(o.noise_says.contains("agree exactly") && !o.noise_says.contains("too few"), "{}", o.noise_says);
}

/// What a prior lets a value be is no noise of the touches.
#[test]
fn the_touches_own_noise_holds_no_prior() {
    let machine = machine("swivel-head");
    let runs = measured(&machine, 38);
    let own = |o: &Outcome, name: &str| o.parameters.iter().find(|p| p.name == name).unwrap().sigma_noise.unwrap();
    let without = fit(&machine, &runs, &MODEL, Settings::default()).outcome;
    let knowledge = [("dL".to_owned(), Knowledge::Prior { value: 0.0, sigma: 0.005 })].into_iter().collect();
    let effects = [&MODEL[..], &["tool-length"]].concat();
    let with = fit(&machine, &runs, &effects, Settings { knowledge, ..Settings::default() }).outcome;
    // no touch tells the tool's length from EZ0B: all that is known of it is the prior
    assert!(sigma(&with, "dL") > 0.0049 && own(&with, "dL") < 1e-6, "{}", own(&with, "dL"));
    assert!(sigma(&with, "EZ0B") > 0.0049);
    assert!((own(&with, "EZ0B") / own(&without, "EZ0B") - 1.0).abs() < 1e-3, "{}", own(&with, "EZ0B"));
}

/// Where no touches tell how much a touch scatters, a misfit may be the probe's, and touches that agree too well are said to.
#[test]
fn a_noise_that_no_touches_tell_is_not_taken_for_sure() {
    let machine = machine("swivel-head");
    let said = |program: &str, touch_um: f64| {
        let plan = plan(&machine, program);
        let touches = touch(&machine, &plan, &Scenario::flawless().with_noise(touch_um * 1e-3, 0.0, 39), None);
        let settings = Settings { visit_sigma_mm: Some(0.0), quick: true, ..Settings::default() };
        fit(&machine, &[(plan, touches)], &["location-b", "block-setup", "pretravel"], settings)
    };
    let is_misfit = |r: &Remark| matches!(r, Remark::Misfit { noise, .. } if noise.or_the_probe(1.0).is_some());
    let may_be_the_probe = |f: &Fit| f.remarks.iter().any(is_misfit);
    let better = |f: &Fit| {
        f.remarks
            .iter()
            .find_map(|r| if let Remark::NoiseTooLarge { times_better, .. } = r { Some(*times_better) } else { None })
    };
    let five = said("head", 5.0);
    assert!(
        five.noise.source == NoiseSource::Declared && may_be_the_probe(&five) && better(&five).is_none(),
        "{:?}",
        five.remarks
    );
    assert!(
        five.outcome.warnings.iter().any(|w| w.contains("a touch scatters by up to 5.")),
        "{:?}",
        five.outcome.warnings
    );
    let small = said("head", 0.05);
    assert!(
        better(&small).is_some_and(|times| (times / 20.0 - 1.0).abs() < 0.15) && !may_be_the_probe(&small),
        "{:?}",
        small.remarks
    );
    for (program, touch_um) in [("head", 1.0), ("head", 0.0), ("full", 5.0), ("full", 0.05)] {
        let o = said(program, touch_um);
        assert!(!may_be_the_probe(&o) && better(&o).is_none(), "{program} {touch_um}: {:?}", o.remarks);
    }
}
