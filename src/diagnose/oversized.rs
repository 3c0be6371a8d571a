//! Parameters of the model that are far larger than machines have them: the model fits, and something is set up wrong.

use crate::fit::Fit;
use crate::fit::outcome::{Parameter, Status};
use crate::machine::Machine;
use crate::model::catalogue::{Catalogue, Effect};
use crate::model::predict::Unknown;
use crate::search::groups::PLAUSIBLE;
use crate::search::{Basis, KEPT};
use crate::units::um_from_mm;
use nalgebra::{DMatrix, DVector};
use serde::Serialize;
use std::collections::{BTreeMap, BTreeSet};

/// The cause of an effect whose row in the catalogue names none.
const ANY_CAUSE: &str = "The error is really so large, or another effect that is not in the model looks like it";

/// The check of an effect whose row in the catalogue names none.
const ANY_CHECK: &str = "Measure this error at the machine by another method";

/// A parameter that is surely more than five times its usual size, or of a sign that it cannot have by nature.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Oversized {
    /// Its name. Names with commas between them where only a combination of an effect's parameters can be measured.
    pub parameter: String,
    pub effect: String,
    /// Of one parameter its value. Of a combination the largest displacement of a touch by it, µm.
    pub value: f64,
    /// Standard uncertainty.
    pub sigma: f64,
    pub unit: String,
    /// So many times its usual size.
    pub times: f64,
    /// It is positive by nature, and surely negative.
    pub wrong_sign: bool,
    /// Only a combination of the effect's parameters can be measured, and it is too large.
    pub combined: bool,
    /// What usually makes it so large.
    pub cause: String,
    /// What to check at the machine.
    pub check: String,
}

/// Of a fit, those of the machine first, then where blocks stand; of each the largest in usual sizes first.
pub(super) fn oversized(fit: &Fit, machine: &Machine, catalogue: &Catalogue) -> Vec<Oversized> {
    let find = |p: &Parameter| fit.model.unknowns.iter().find(|u| u.name == p.name && u.effect == p.effect);
    let identified = fit.outcome.parameters.iter().filter(|p| p.status == Status::Identified);
    let mut out: Vec<Oversized> = identified
        .filter_map(|p| of_parameter(p, find(p)?, catalogue.get(&p.effect, machine)?))
        .chain(combinations(fit, machine, catalogue))
        .collect();
    let of_block = |o: &Oversized| o.parameter.contains('@');
    out.sort_by(|a, b| of_block(a).cmp(&of_block(b)).then(b.times.total_cmp(&a.times)));
    out
}

fn of_parameter(p: &Parameter, u: &Unknown, effect: &Effect) -> Option<Oversized> {
    let sigma = p.sigma?;
    let positive = effect.parameters.iter().any(|e| e.name == u.own_name() && e.positive);
    let wrong_sign = positive && p.value < 0.0;
    let most = if wrong_sign { u.typical } else { PLAUSIBLE * u.typical };
    if u.shape || u.typical <= 0.0 || p.value.abs() - 2.0 * sigma <= most {
        return None;
    }
    Some(Oversized {
        parameter: p.name.clone(),
        effect: p.effect.clone(),
        value: p.value,
        sigma,
        unit: p.unit.clone(),
        times: p.value.abs() / u.typical,
        wrong_sign,
        combined: false,
        cause: or_any(&effect.too_large, ANY_CAUSE),
        check: or_any(&effect.look, ANY_CHECK),
    })
}

fn or_any(text: &str, any: &str) -> String {
    if text.is_empty() { any.to_owned() } else { text.to_owned() }
}

/// Effects with parameters of which only a combination can be measured. Each is judged by what the touches see of that combination.
fn combinations(fit: &Fit, machine: &Machine, catalogue: &Catalogue) -> Vec<Oversized> {
    let undetermined = |i: usize| fit.outcome.parameters[i].status == Status::Undetermined;
    let unknowns = &fit.model.unknowns;
    // a size beside a shape that is not determined may have any value
    let of_any_shape = |effect: &str| {
        (0..unknowns.len()).any(|i| unknowns[i].shape && unknowns[i].effect == effect && undetermined(i))
    };
    // of each effect: columns of the fit
    let mut columns: BTreeMap<&str, Vec<usize>> = BTreeMap::new();
    for (column, &i) in fit.free.iter().enumerate().filter(|(_, i)| undetermined(**i)) {
        let u = &unknowns[i];
        if !u.shape && !u.is_set_up() && u.typical > 0.0 {
            columns.entry(&u.effect).or_default().push(column);
        }
    }
    // a combination has two parameters or more
    columns.retain(|effect, own| own.len() > 1 && !of_any_shape(effect));
    if columns.is_empty() {
        return Vec::new();
    }
    let white = fit.linear(fit.noise.tau_mm).jacobian;
    let raw_mm = fit.with_touches(0.0, |touches| touches.unwhitened(&fit.free_theta()).1);
    let of_effect =
        |(id, own): (&str, Vec<usize>)| combination(fit, (&white, &raw_mm), &own, catalogue.get(id, machine)?);
    columns.into_iter().filter_map(of_effect).collect()
}

/// The combination of these columns of a fit that the touches see. `jacobians`: whitened, and in mm.
fn combination(
    fit: &Fit,
    jacobians: (&DMatrix<f64>, &DMatrix<f64>),
    own: &[usize],
    effect: &Effect,
) -> Option<Oversized> {
    /// Parameters with a smaller part in the combination than this share of the largest are not named.
    const NAMED: f64 = 0.1;
    let unknowns: Vec<&Unknown> = own.iter().map(|&c| &fit.model.unknowns[fit.free[c]]).collect();
    let at_typical = |jacobian: &DMatrix<f64>| {
        let mut out = jacobian.select_columns(own);
        out.column_iter_mut().zip(&unknowns).for_each(|(mut column, u)| column *= u.typical);
        out
    };
    let sizes = own.iter().zip(&unknowns).map(|(&c, u)| fit.theta[fit.free[c]] / u.typical);
    let sizes = DVector::from_iterator(own.len(), sizes);
    let whole = at_typical(jacobians.0);
    let left = Basis::new(&jacobians.0.clone().remove_columns_at(own)).project_columns(&whole);
    if left.norm() <= KEPT * whole.norm() {
        return None;
    }
    // of an effect with a set of parameters for each block, the usual size is that of one set
    let in_a_set = unknowns.iter().map(|u| u.own_name()).collect::<BTreeSet<_>>().len();
    let usual = left.norm() / (in_a_set as f64).sqrt();
    let seen = (&left * &sizes).norm();
    // the noise changes what is seen by 1, whitened
    if seen - 2.0 <= PLAUSIBLE * usual {
        return None;
    }
    let gram = left.tr_mul(&left);
    let covariance = gram.clone().pseudo_inverse(KEPT * KEPT * gram.trace()).ok()?;
    let size = &covariance * gram * sizes;
    let raw_mm = at_typical(jacobians.1);
    let moved = &raw_mm * &size;
    let used = (0..moved.len()).filter(|&i| fit.weight[i] > 0.0);
    let touch = used.max_by(|&a, &b| moved[a].abs().total_cmp(&moved[b].abs()))?;
    let row = raw_mm.row(touch).transpose();
    let named = unknowns.iter().zip(&size).filter(|(_, part)| part.abs() > NAMED * size.amax());
    let named: Vec<&str> = named.map(|(u, _)| u.name.as_str()).collect();
    Some(Oversized {
        parameter: named.join(", "),
        effect: effect.id.clone(),
        value: um_from_mm(moved[touch].abs()),
        sigma: um_from_mm(row.dot(&(&covariance * &row)).max(0.0).sqrt()),
        unit: "um".to_owned(),
        times: seen / usual,
        wrong_sign: false,
        combined: true,
        cause: or_any(&effect.too_large, ANY_CAUSE),
        check: or_any(&effect.look, ANY_CHECK),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diag::source;
    use crate::diagnose::{Options, Subject, Verdict, diagnose};
    use crate::fit::{Settings, identify};
    use crate::log::match_to_plan;
    use crate::model::data::Run;
    use crate::{machine, program, simulate};

    /// The trunnion with a radial error motion of C, which is in the model, diagnosed.
    fn with_radial_motion(exc1c_um: f64, eyc1s_um: f64) -> crate::diagnose::Diagnosis {
        let machines = machine::load(&source("machines.toml", machine::BUILT_IN)).unwrap().0;
        let machine = machines.into_iter().find(|m| m.name == "trunnion").unwrap();
        let catalogue = Catalogue::built_in().unwrap();
        let spec = program::choose(program::built_in().unwrap(), "full", &machine).unwrap();
        let plan = program::generate(&machine, &spec, &program::Options::default()).unwrap().0.plan;
        let text = format!(
            "seed = 3\n[effects.radial-c-1]\nEXC1c = {exc1c_um:?}\nEYC1s = {eyc1s_um:?}\n[noise]\ntouch_um = 0.5\n"
        );
        let scenario = simulate::scenario::parse(&source("wrong.toml", text), &machine).unwrap().0;
        let raw = simulate::run(&machine, &plan, &scenario, None).unwrap().0;
        let touches = match_to_plan(&machine, &plan, raw).unwrap().0;
        let run = Run { plan: &plan, touches: &touches, mounting: None, started_s: None };
        let effects = ["radial-c-1", "location-a", "location-c", "block-setup", "pretravel"].map(str::to_owned);
        let settings = Settings { effects: effects.to_vec(), quick: true, ..Settings::default() };
        let fit = identify(&machine, &catalogue, &[run], &settings).unwrap();
        let subject = Subject { machine: &machine, catalogue: &catalogue, settings: &settings, fit: &fit };
        diagnose(subject, &Options { at_most: 3, refit: false, power: false, planned: None }).unwrap()
    }

    /// EXC1c and EYC1s cannot be measured one by one: the position of the block hides their sum. Their difference is seen.
    #[test]
    fn a_combination_of_parameters_that_is_too_large_is_a_finding() {
        let d = with_radial_motion(30.0, -20.0);
        assert_eq!(d.verdict, Verdict::Adequate, "{}", d.says);
        let [o] = d.oversized.as_slice() else { panic!("{:?}", d.oversized) };
        assert_eq!((o.parameter.as_str(), o.effect.as_str(), o.unit.as_str()), ("EXC1c, EYC1s", "radial-c-1", "um"));
        assert!(o.combined && o.times > PLAUSIBLE && (10.0..60.0).contains(&o.value) && o.sigma < 1.0, "{o:?}");
        assert!(d.says.contains("radial-c-1 (EXC1c, EYC1s) moves a touch by"), "{}", d.says);
        assert!(d.says.contains("Probable cause: The bearing of C"), "{}", d.says);
    }

    #[test]
    fn a_combination_of_usual_size_is_none() {
        let d = with_radial_motion(2.0, -1.5);
        assert_eq!((&d.verdict, d.oversized), (&Verdict::Adequate, Vec::new()));
    }

    /// An effect of the user's own need not say what makes it too large.
    #[test]
    fn a_row_without_a_cause_has_a_cause_and_a_check() {
        for (text, any) in [("", ANY_CAUSE), ("", ANY_CHECK), ("It is bent", "It is bent")] {
            assert_eq!(or_any(text, any), any);
        }
        let rows = Catalogue::built_in().unwrap();
        let without: Vec<&str> =
            rows.iter().filter(|e| !e.discrete && e.too_large.is_empty()).map(|e| e.id.as_str()).collect();
        assert!(without.is_empty(), "{without:?}");
        assert!(rows.iter().all(|e| !e.look.is_empty()));
    }
}
