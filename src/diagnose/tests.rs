//! Tests of what this module decides by itself.

use super::*;
use crate::diag::source;
use crate::log::match_to_plan;
use crate::model::data::{Run, assemble};
use crate::{machine, program, simulate};

/// A fit of the paper's head program, touched with a scale of X that is 100 µm/m too long. The model holds these effects.
fn fit_with(effects: &[&str]) -> Fit {
    let machines = machine::load(&source("machines.toml", machine::BUILT_IN)).unwrap().0;
    let machine = machines.into_iter().find(|m| m.name == "swivel-head").unwrap();
    let spec = program::choose(program::built_in().unwrap(), "head", &machine).unwrap();
    let plan = program::plan_without_path(&machine, &spec).unwrap();
    let text = "seed = 3\n[effects.scale-x]\nEXX = 100.0\n[noise]\ntouch_um = 0.5\n";
    let scenario = simulate::scenario::parse(&source("wrong.toml", text), &machine).unwrap().0;
    let raw = simulate::run(&machine, &plan, &scenario, None).unwrap().0;
    let touches = match_to_plan(&machine, &plan, raw).unwrap().0;
    let data = assemble(&machine, &[Run { plan: &plan, touches: &touches, mounting: None, started_s: None }]);
    let settings = Settings {
        effects: effects.iter().map(|id| (*id).to_owned()).collect(),
        all_in: true,
        quick: true,
        ..Settings::default()
    };
    identify_data(&machine, &Catalogue::built_in().unwrap(), data, &settings).unwrap()
}

/// The same fit with residuals of its own.
fn with_residuals(fit: &Fit, residual_mm: impl Fn(usize) -> f64) -> Fit {
    let residual_mm = (0..fit.residual_mm.len()).map(residual_mm).collect();
    Fit { residual_mm, ..fit.clone() }
}

#[test]
fn a_larger_sum_of_squares_of_the_used_touches_is_a_raised_error() {
    let before = fit_with(&["location-b", "block-setup", "pretravel"]);
    let of = |touch: usize| before.residual_mm[touch];
    assert!(before.residual_mm.iter().any(|r| r.abs() > 1e-4));
    assert!(!raises_the_error(&before, &before), "an equal error is not raised");
    assert!(!raises_the_error(&before, &with_residuals(&before, |touch| -of(touch))), "squares have no sign");
    assert!(raises_the_error(&before, &with_residuals(&before, |touch| 1.01 * of(touch))));
    assert!(!raises_the_error(&before, &with_residuals(&before, |touch| 0.99 * of(touch))));
    // one touch is worse and the others are better: the sum counts
    let one_worse = |size: f64| with_residuals(&before, |touch| if touch == 0 { size } else { 0.9 * of(touch) });
    assert!(!raises_the_error(&before, &one_worse(of(0))));
    assert!(raises_the_error(&before, &one_worse(1.0)));
}

#[test]
fn only_the_touches_that_the_first_fit_uses_count() {
    let mut before = fit_with(&["location-b", "block-setup", "pretravel"]);
    let of: Vec<f64> = before.residual_mm.clone();
    before.weight[0] = 0.0;
    let far_off = with_residuals(&before, |touch| if touch == 0 { 1.0 } else { of[touch] });
    assert!(!raises_the_error(&before, &far_off), "the first fit does not use touch 0");
    // the second fit may exclude touches: they count as before
    let mut excludes = with_residuals(&before, |touch| if touch == 1 { 1.0 } else { of[touch] });
    excludes.weight[1] = 0.0;
    assert!(raises_the_error(&before, &excludes), "the first fit uses touch 1");
}

#[test]
fn a_refit_with_the_effect_that_acts_does_not_raise_the_error() {
    let without = fit_with(&["location-b", "block-setup", "pretravel"]);
    let with = fit_with(&["location-b", "block-setup", "pretravel", "scale-x"]);
    assert!(with.outcome.rms_um < 0.9 * without.outcome.rms_um, "{} {}", without.outcome.rms_um, with.outcome.rms_um);
    assert!(!raises_the_error(&without, &with));
    assert!(raises_the_error(&with, &without));
}

#[test]
fn a_model_still_fails_where_touches_that_it_does_not_use_lie_together() {
    let machines = machine::load(&source("machines.toml", machine::BUILT_IN)).unwrap().0;
    let machine = machines.into_iter().find(|m| m.name == "swivel-head").unwrap();
    let complete = fit_with(&["location-b", "block-setup", "pretravel", "scale-x"]);
    let catalogue = Catalogue::built_in().unwrap();
    let n = complete.data.observations.len();
    let without = |touches: &mut dyn Iterator<Item = usize>| {
        let mut fit = complete.clone();
        for touch in touches {
            fit.weight[touch] = 0.0;
            fit.rejected.insert(touch, Reason::Outlier { off_mm: 0.02, standardised: 40.0, robust_only: false });
        }
        still_fails(&fit, &machine, &catalogue)
    };
    assert!(!without(&mut std::iter::empty()));
    // six from anywhere, and six that follow one another on one face
    assert!(!without(&mut (0..n).step_by(n / 6)));
    assert!(without(&mut (0..6)));
}
