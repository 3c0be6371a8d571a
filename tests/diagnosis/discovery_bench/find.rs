//! The searching half: touches in, findings out. It knows the machine and the plans, and nothing of what was planted.

use axiscal::diag::source;
use axiscal::diagnose::evidence::Evidence;
use axiscal::diagnose::{Diagnosis, Options, Subject, diagnose, sketch};
use axiscal::fit::{Fit, Settings, identify_data};
use axiscal::log::Touch;
use axiscal::machine::Machine;
use axiscal::model::catalogue::Catalogue;
use axiscal::model::data::{Data, Run, assemble};
use axiscal::program::plan::Plan;

pub const BASE: [&str; 4] = ["location-b", "location-c", "block-setup", "pretravel"];

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

/// RMS over noise with the sketched effect in the model; `None` where nothing can be sketched.
pub fn sketched(machine: &Machine, built_in: &Catalogue, first: &Fit, settings: &Settings) -> Option<f64> {
    let made = sketch::sketch(Subject { machine, catalogue: built_in, settings, fit: first }, &|id| built_in.knows(id))
        .ok()?;
    let mut own = Catalogue::built_in().unwrap();
    own.add_file(&source("my-effects.toml", made.toml)).unwrap();
    let mut more = settings.effects[BASE.len()..].to_vec();
    more.push(made.id);
    let after = fit(machine, &own, first.data.clone(), &more, None).0;
    Some(reduced_rms(&after))
}

/// √(χ²/dof) in units of the noise of a touch.
pub fn reduced_rms(fit: &Fit) -> f64 {
    let evidence = Evidence::from_fit(fit);
    let ss = evidence.base.project(&evidence.residual).norm_squared();
    (ss / evidence.dof() as f64).sqrt() * fit.noise.sigma_mm * 1000.0
}
