//! Parameters of the model that are far larger than machines have them: the model fits, and something is set up wrong.

use crate::fit::Fit;
use crate::fit::outcome::Status;
use crate::machine::Machine;
use crate::model::catalogue::Catalogue;
use crate::search::groups::PLAUSIBLE;
use serde::Serialize;

/// A parameter that is surely more than five times its usual size, or of a sign that it cannot have by nature.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Oversized {
    pub parameter: String,
    pub effect: String,
    pub value: f64,
    /// Standard uncertainty.
    pub sigma: f64,
    pub unit: String,
    /// So many times its usual size.
    pub times: f64,
    /// It is positive by nature, and surely negative.
    pub wrong_sign: bool,
    /// What usually makes it so large.
    pub cause: String,
    /// What to check at the machine.
    pub check: String,
}

/// Of a fit, those of the machine first, the largest in usual sizes first. Where blocks stand is no error, however far it is.
pub(super) fn oversized(fit: &Fit, machine: &Machine, catalogue: &Catalogue) -> Vec<Oversized> {
    let mut out: Vec<Oversized> = fit
        .outcome
        .parameters
        .iter()
        .filter(|p| p.status == Status::Identified)
        .filter_map(|p| {
            let sigma = p.sigma?;
            let u = fit.model.unknowns.iter().find(|u| u.name == p.name && u.effect == p.effect)?;
            let effect = catalogue.get(&p.effect, machine)?;
            let positive = effect.parameters.iter().any(|e| e.name == u.own_name() && e.positive);
            let wrong_sign = positive && p.value < 0.0;
            let most = if wrong_sign { u.typical } else { PLAUSIBLE * u.typical };
            // a block that stands elsewhere is no matter; one that is turned may be another block
            let is_place = u.is_set_up() && u.unit != "deg";
            if u.shape || is_place || u.typical <= 0.0 || p.value.abs() - 2.0 * sigma <= most {
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
                cause: effect.too_large.clone(),
                check: effect.look.clone(),
            })
        })
        .collect();
    let of_block = |o: &Oversized| o.parameter.contains('@');
    out.sort_by(|a, b| of_block(a).cmp(&of_block(b)).then(b.times.total_cmp(&a.times)));
    out
}
