//! The searching half: touches in, findings out. It knows the machine and the plans, and nothing of what was planted.

use axiscal::diagnose::{Diagnosis, Options, Subject, diagnose};
use axiscal::fit::{Fit, Settings, identify_data};
use axiscal::log::Touch;
use axiscal::machine::Machine;
use axiscal::model::catalogue::Catalogue;
use axiscal::model::data::{Data, Run, assemble};
use axiscal::program::plan::Plan;

const BASE: [&str; 4] = ["location-b", "location-c", "block-setup", "pretravel"];

pub fn data(machine: &Machine, plans: &[(Plan, f64)], touches: &[Vec<Touch>]) -> Data {
    let runs: Vec<Run> = plans
        .iter()
        .zip(touches)
        .map(|((plan, begins), touches)| Run { plan, touches, mounting: None, started_s: Some(*begins) })
        .collect();
    assemble(machine, &runs)
}

pub fn fit(
    machine: &Machine,
    catalogue: &Catalogue,
    data: Data,
    more: &[String],
    visit_um: Option<f64>,
) -> (Fit, Settings) {
    let settings = Settings {
        effects: BASE.iter().map(|e| (*e).to_owned()).chain(more.iter().cloned()).collect(),
        // what a plan without revisits must be told
        visit_sigma_mm: visit_um.map(|um| um / 1000.0),
        quick: true,
        ..Settings::default()
    };
    (identify_data(machine, catalogue, data, &settings).unwrap(), settings)
}

/// One look at a fit.
pub fn look(machine: &Machine, catalogue: &Catalogue, fit: &Fit, settings: &Settings, options: &Options) -> Diagnosis {
    diagnose(Subject { machine, catalogue, settings, fit }, options).unwrap()
}

/// Without the refit and the figures that only a reader needs.
pub const LEAN: Options = Options { at_most: 3, refit: false, power: false, planned: None };
