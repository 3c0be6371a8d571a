//! Many measurements of one machine with fresh noise: do errors scatter as the uncertainties say?
//!
//! The truth comes from the virtual machine. Noise is drawn anew for each run: in the virtual machine itself for the
//! first `n_virtual` runs, and for the rest added to a noise-free measurement along each touch's normal, which is the
//! same to second order. Every run is fitted in full, with noise, snooping and all.

use crate::common::*;
use axiscal::fit::outcome::Status;
use axiscal::fit::{self, Settings};
use axiscal::log::Touch;
use axiscal::machine::Machine;
use axiscal::model::catalogue::Catalogue;
use axiscal::model::data::Run;
use axiscal::model::data::{Data, assemble};
use axiscal::program::plan::Plan;
use axiscal::simulate::Scenario;
use axiscal::units::um_from_mm;
use nalgebra::Vector3;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use rayon::prelude::*;
use statrs::distribution::{ChiSquared, ContinuousCDF, FisherSnedecor};
use std::collections::BTreeMap;

/// What is simulated.
#[derive(Debug, Clone)]
pub struct Case {
    pub machine: &'static str,
    pub programs: &'static [&'static str],
    /// What is mounted, with a program of 20 minutes that is chosen for it; `None`: the machine's own blocks.
    pub artefact: Option<&'static str>,
    pub effects: &'static [&'static str],
    /// Noise of a touch and of a visit, mm.
    pub sigma_mm: f64,
    pub tau_mm: f64,
    /// Effects that act beside the location errors, with their values.
    pub planted: &'static [(&'static str, &'static [(&'static str, f64)])],
    /// What the study says of the scatter of visits, mm; `None`: revisits tell it, or the machine's file declares it.
    pub stated_tau_mm: Option<f64>,
    /// What the machine's file declares of it, mm, all rotary axes together; `None`: as the built-in file does.
    pub declared_tau_mm: Option<f64>,
}

/// The cases of the documentation.
pub const CASES: [Case; 9] = [
    Case {
        machine: "swivel-head",
        programs: &["head", "table"],
        artefact: None,
        effects: &["location-b", "location-c", "block-setup", "pretravel"],
        sigma_mm: 1e-3,
        tau_mm: 0.0,
        planted: &[],
        stated_tau_mm: Some(0.0),
        declared_tau_mm: None,
    },
    // no revisits: both rotary axes scatter as the machine's file declares it
    Case {
        machine: "swivel-head",
        programs: &["head", "table"],
        artefact: None,
        effects: &["location-b", "location-c", "block-setup", "pretravel"],
        sigma_mm: 1e-3,
        tau_mm: std::f64::consts::FRAC_1_SQRT_2 * 1e-3,
        planted: &[],
        stated_tau_mm: None,
        declared_tau_mm: None,
    },
    Case {
        machine: "swivel-head",
        programs: &["full"],
        artefact: None,
        effects: &["location-b", "location-c", "block-setup", "pretravel"],
        sigma_mm: 1e-3,
        tau_mm: 0.0,
        planted: &[],
        stated_tau_mm: None,
        declared_tau_mm: None,
    },
    Case {
        machine: "swivel-head",
        programs: &["full"],
        artefact: None,
        effects: &["location-b", "location-c", "block-setup", "pretravel"],
        sigma_mm: 1e-3,
        tau_mm: 0.5e-3,
        planted: &[],
        stated_tau_mm: None,
        declared_tau_mm: None,
    },
    Case {
        machine: "trunnion",
        programs: &["basic"],
        artefact: None,
        effects: &["location-a", "location-c", "block-setup", "pretravel"],
        sigma_mm: 1e-3,
        tau_mm: 0.0,
        planted: &[],
        stated_tau_mm: Some(0.0),
        declared_tau_mm: None,
    },
    Case {
        machine: "trunnion",
        programs: &["full"],
        artefact: None,
        effects: &["location-a", "location-c", "block-setup", "pretravel"],
        sigma_mm: 1e-3,
        tau_mm: 0.5e-3,
        planted: &[],
        stated_tau_mm: None,
        declared_tau_mm: None,
    },
    Case {
        machine: "double-head",
        programs: &["full"],
        artefact: None,
        effects: &["location-b", "location-a", "block-setup", "pretravel"],
        sigma_mm: 1e-3,
        tau_mm: 0.5e-3,
        planted: &[],
        stated_tau_mm: None,
        declared_tau_mm: None,
    },
    Case {
        machine: "swivel-table-b",
        programs: &["full"],
        artefact: None,
        effects: &["location-b", "location-c", "block-setup", "pretravel"],
        sigma_mm: 1e-3,
        tau_mm: 0.5e-3,
        planted: &[],
        stated_tau_mm: None,
        declared_tau_mm: None,
    },
    // a time constant among the unknowns: the touches do not depend on it linearly
    Case {
        machine: "trunnion",
        programs: &["full"],
        artefact: None,
        effects: &["location-a", "location-c", "block-setup", "pretravel", "warm-up"],
        sigma_mm: 1e-3,
        tau_mm: 0.5e-3,
        planted: &[("warm-up", &[("wx", 5.0), ("wz", 12.0), ("tau", 0.5)])],
        stated_tau_mm: None,
        declared_tau_mm: None,
    },
];

/// One artefact on one machine.
const fn on(machine: &'static str, artefact: &'static str, effects: &'static [&'static str]) -> Case {
    Case {
        machine,
        programs: &["auto"],
        artefact: Some(artefact),
        effects,
        sigma_mm: 1e-3,
        tau_mm: 0.5e-3,
        planted: &[],
        stated_tau_mm: Some(0.5e-3),
        declared_tau_mm: None,
    }
}

/// Effects of a model: two location errors and where a body stands.
macro_rules! model {
    ($one:literal, $other:literal, $($body:literal),+) => { &[$one, $other, $($body,)+ "pretravel"] };
}

/// Every artefact on every built-in machine.
pub const ARTEFACTS: [Case; 30] = {
    macro_rules! all {
        ($(($machine:literal, $one:literal, $other:literal)),+) => {
            [$(
                on($machine, "sphere", model!($one, $other, "sphere-setup")),
                on($machine, "two-spheres", model!($one, $other, "sphere-setup")),
                on($machine, "ring", model!($one, $other, "cylinder-setup")),
                on($machine, "pin", model!($one, $other, "cylinder-setup", "cylinder-height")),
                on($machine, "cube", model!($one, $other, "block-setup")),
            )+]
        };
    }
    all!(
        ("trunnion", "location-a", "location-c"),
        ("swivel-table-b", "location-b", "location-c"),
        ("swivel-head", "location-b", "location-c"),
        ("double-head", "location-a", "location-b"),
        ("nutating-b", "location-b", "location-c"),
        ("trunnion-offset", "location-a", "location-c")
    )
};

/// A scatter of visits that is not as declared, on a plan that comes back to poses and on two that do not.
#[allow(dead_code)] // of the example
pub fn scatters() -> Vec<Case> {
    let mut out = Vec::new();
    for (machine, programs, effects) in [
        ("swivel-head", &["head", "table"][..], &["location-b", "location-c", "block-setup", "pretravel"]),
        ("trunnion", &["basic"], &["location-a", "location-c", "block-setup", "pretravel"]),
        ("trunnion", &["full"], &["location-a", "location-c", "block-setup", "pretravel"]),
    ] {
        for declared_mm in [0.3e-3, 0.55e-3, 1e-3] {
            for tau_mm in [0.0, 0.3e-3, 0.7e-3] {
                let (artefact, planted, stated_tau_mm) = (None, &[][..], None);
                let declared_tau_mm = Some(declared_mm);
                out.push(Case {
                    machine,
                    programs,
                    artefact,
                    effects,
                    sigma_mm: 1e-3,
                    tau_mm,
                    planted,
                    stated_tau_mm,
                    declared_tau_mm,
                });
            }
        }
    }
    out
}

/// The machine of a case with what is mounted, and the plans.
fn mounted(case: &Case) -> (Machine, Vec<Plan>) {
    let Some(artefact) = case.artefact else {
        let mut machine = machine(case.machine);
        if let Some(declared_mm) = case.declared_tau_mm {
            let rotary = machine.rotary().count() as f64;
            let axes = machine.axes.iter_mut().filter(|a| a.name.is_rotary());
            axes.for_each(|a| a.indexing_repeatability_mm = declared_mm / rotary.sqrt());
        }
        let plans = case.programs.iter().map(|p| plan(&machine, p)).collect();
        return (machine, plans);
    };
    let (machine, auto) = with_artefact(case.machine, artefact, 20.0);
    let (generated, _) =
        axiscal::program::generate(&machine, &auto.spec, &axiscal::program::Options::default()).unwrap();
    (machine, vec![generated.plan])
}

/// One parameter over all runs.
#[derive(Debug, Clone)]
pub struct Row {
    pub name: String,
    /// RMS error over the Cramér-Rao bound (true noise).
    pub ratio: f64,
    /// Share of runs whose 95 % interval holds the truth.
    pub covered: f64,
}

/// All parameters over all runs.
#[derive(Debug, Clone)]
pub struct Summary {
    pub runs: usize,
    pub rows: Vec<Row>,
    #[allow(dead_code)] // printed by the example
    /// Mean of χ² per degree of freedom, in units of the true noise of a touch.
    pub chi2_per_dof: f64,
    /// Share of runs whose lack of fit lies below, and above, the central 95 % of its own distribution ([`tails`]).
    pub tails: [f64; 2],
    /// Is the scatter of visits estimated by each run?
    pub tau_estimated: bool,
    #[allow(dead_code)] // printed by the example
    pub dof: usize,
    #[allow(dead_code)] // printed by the example
    /// Mean of τ̂², in units of the true one.
    pub tau2_ratio: f64,
    #[allow(dead_code)] // printed by the example
    /// Scatter of visits as the residuals of each run show it, µm: 16th and 84th percentile; `None` where it is known otherwise.
    pub shown_um: Option<[f64; 2]>,
    #[allow(dead_code)] // printed by the example
    /// Rejected touches per thousand.
    pub rejected_per_mille: f64,
}

/// A machine with random location errors and block places.
fn wrong(machine: &Machine, case: &Case, rng: &mut ChaCha8Rng) -> Scenario {
    let catalogue = Catalogue::built_in().unwrap();
    let mut scenario = Scenario::flawless();
    for id in case.effects.iter().filter(|e| e.starts_with("location")) {
        let effect = catalogue.get(id, machine).unwrap();
        let values: Vec<(&str, f64)> = effect
            .parameters
            .iter()
            .map(|p| (p.name.as_str(), rng.random_range(-1.0..1.0) * if p.unit == "mm" { 0.03 } else { 0.003 }))
            .collect();
        scenario = scenario.with(machine, id, &values).unwrap();
    }
    for (id, values) in case.planted {
        scenario = scenario.with(machine, id, values).unwrap();
    }
    for mounting in &machine.mountings {
        for block in &mounting.blocks {
            let shift = [0; 3].map(|_| rng.random_range(-0.1..0.1));
            let tilt = [0; 3].map(|_| rng.random_range(-1e-3..1e-3));
            scenario = scenario.with_block(&mounting.name, &block.name, shift, tilt);
        }
    }
    scenario
}

fn settings(case: &Case) -> Settings {
    Settings {
        effects: case.effects.iter().map(|e| (*e).to_owned()).collect(),
        visit_sigma_mm: case.stated_tau_mm,
        // the interval of a shape parameter takes more
        quick: case.planted.is_empty(),
        ..Settings::default()
    }
}

/// The same touches with fresh noise.
fn noisy(perfect: &Data, plans: &[Plan], case: &Case, rng: &mut ChaCha8Rng) -> Data {
    let mut data = perfect.clone();
    // index visits are the plan's own here: what the fit takes for one is to be tested
    let mut visits: BTreeMap<(usize, u32), Vector3<f64>> = BTreeMap::new();
    let mut draw = |scale: f64| -> f64 {
        let x: f64 = StandardNormal.sample(rng);
        x * scale
    };
    for o in &mut data.observations {
        let n = Vector3::new(o.state[8], o.state[9], o.state[10]);
        let visit = (o.run, plans[o.run].touch(o.id).unwrap().visit.unwrap());
        let shift = *visits.entry(visit).or_insert_with(|| Vector3::from_fn(|_, _| draw(case.tau_mm)));
        let by = n * (draw(case.sigma_mm) + n.dot(&shift));
        for k in 0..3 {
            o.position.0[k] += by[k];
        }
    }
    data
}

/// Runs a case.
pub fn run(case: &Case, runs: usize, n_virtual: usize, seed: u64) -> Summary {
    let (machine, plans) = mounted(case);
    let catalogue = Catalogue::built_in().unwrap();
    let scenario = wrong(&machine, case, &mut ChaCha8Rng::seed_from_u64(seed));
    let measure = |scenario: &Scenario| -> Data {
        let touches: Vec<Vec<Touch>> = plans.iter().map(|p| touch(&machine, p, scenario, None)).collect();
        let runs: Vec<Run> = plans
            .iter()
            .zip(&touches)
            .map(|(plan, touches)| Run { plan, touches, mounting: None, started_s: None })
            .collect();
        assemble(&machine, &runs)
    };
    let perfect = measure(&scenario);
    // the truth is what a noise-free measurement gives back (tests/model/recover.rs: exact to 1e-10)
    let exact = fit::identify_data(&machine, &catalogue, perfect.clone(), &settings(case)).unwrap();
    let bound = {
        let stated =
            Settings { touch_sigma_mm: Some(case.sigma_mm), visit_sigma_mm: Some(case.tau_mm), ..settings(case) };
        fit::identify_data(&machine, &catalogue, perfect.clone(), &stated).unwrap()
    };
    let results: Vec<usize> = (0..exact.outcome.parameters.len())
        .filter(|&i| exact.outcome.parameters[i].status == Status::Identified)
        .collect();
    struct One {
        error: Vec<f64>,
        covered: Vec<bool>,
        chi2: f64,
        tail: f64,
        tau2: f64,
        shown_um: Option<f64>,
        rejected: usize,
        tau_estimated: bool,
    }
    let all: Vec<One> = (0..runs as u64)
        .into_par_iter()
        .map(|r| {
            let data = if r < n_virtual as u64 {
                measure(&scenario.clone().with_noise(case.sigma_mm, case.tau_mm, seed + 1000 * (r + 1)))
            } else {
                let mut rng = ChaCha8Rng::seed_from_u64(seed);
                rng.set_stream(r + 1);
                noisy(&perfect, &plans, case, &mut rng)
            };
            let fit = fit::identify_data(&machine, &catalogue, data, &settings(case)).unwrap();
            let of = |i: usize| &fit.outcome.parameters[i];
            let error: Vec<f64> = results.iter().map(|&i| of(i).value - exact.outcome.parameters[i].value).collect();
            let inside = |i: usize, e: f64| match of(i).interval {
                Some([low, high]) => {
                    let truth = of(i).value - e;
                    low.is_none_or(|low| low <= truth) && high.is_none_or(|high| truth <= high)
                }
                None => of(i).expanded.is_some_and(|x| e.abs() <= x),
            };
            let covered = results.iter().zip(&error).map(|(&i, e)| inside(i, *e)).collect();
            let scale = fit.noise.sigma_mm / case.sigma_mm;
            One {
                error,
                covered,
                chi2: fit.outcome.chi2_per_dof * scale * scale,
                tail: lack_of_fit(fit.chi2, fit.dof, fit.noise.dof),
                tau_estimated: fit.noise.visit_source == fit::VisitSource::Revisits,
                tau2: fit.noise.tau_mm.powi(2),
                shown_um: fit.noise.visits_shown.map(|shown| um_from_mm(shown.tau_mm)),
                rejected: fit.rejected.len(),
            }
        })
        .collect();
    let n = runs as f64;
    let mut shown_um: Vec<f64> = all.iter().filter_map(|o| o.shown_um).collect();
    shown_um.sort_by(f64::total_cmp);
    let percentile = |part: f64| shown_um[(part * (shown_um.len() - 1) as f64).round() as usize];
    let rows = results
        .iter()
        .enumerate()
        .map(|(k, &i)| Row {
            name: exact.outcome.parameters[i].name.clone(),
            ratio: (all.iter().map(|o| o.error[k].powi(2)).sum::<f64>() / n).sqrt()
                / bound.outcome.parameters[i].sigma.unwrap(),
            covered: all.iter().filter(|o| o.covered[k]).count() as f64 / n,
        })
        .collect();
    Summary {
        runs,
        rows,
        chi2_per_dof: all.iter().map(|o| o.chi2).sum::<f64>() / n,
        tails: [
            all.iter().filter(|o| o.tail < 0.025).count() as f64 / n,
            all.iter().filter(|o| o.tail > 0.975).count() as f64 / n,
        ],
        tau_estimated: all.iter().any(|o| o.tau_estimated),
        dof: exact.dof,
        tau2_ratio: if case.tau_mm > 0.0 {
            all.iter().map(|o| o.tau2).sum::<f64>() / n / case.tau_mm.powi(2)
        } else {
            0.0
        },
        shown_um: (!shown_um.is_empty()).then(|| [percentile(0.16), percentile(0.84)]),
        rejected_per_mille: 1e3 * all.iter().map(|o| o.rejected).sum::<usize>() as f64
            / n
            / perfect.observations.len() as f64,
    }
}

/// What must hold of location errors, pretravel and set-ups of blocks, with `k` standard deviations of the sampling error on top.
pub fn check(case: &Case, summary: &Summary, k: f64) -> Vec<String> {
    let n = summary.runs as f64;
    let mut wrong = Vec::new();
    for row in &summary.rows {
        let slack = 0.05 + k / (2.0 * n).sqrt();
        if (row.ratio - 1.0).abs() > slack {
            wrong.push(format!("{case:?} {}: RMS error {:.3} of its bound", row.name, row.ratio));
        }
        let slack = k * (0.95 * 0.05 / n).sqrt();
        if row.covered < 0.935 - slack || row.covered > 0.965 + slack {
            wrong.push(format!("{case:?} {}: covered in {:.2} %", row.name, 100.0 * row.covered));
        }
    }
    // all of them together: single ones have too few runs to be seen too wide. They share noise and touches: no more than a
    // quarter of them count as drawn apart
    let covered = summary.rows.iter().map(|r| r.covered).sum::<f64>() / summary.rows.len() as f64;
    let slack = k * (0.95 * 0.05 / (n * (summary.rows.len() as f64 / 4.0).max(1.0))).sqrt();
    if covered < 0.935 - slack || covered > 0.965 + slack {
        wrong.push(format!("{case:?}: all together covered in {:.2} %", 100.0 * covered));
    }
    // the bounds of χ²: each tail holds 2.5 %. Where each run estimates the scatter of its visits from the very residuals,
    // and cannot take it below zero, χ² is narrower than its law and on the low side: then only too many are wrong
    let slack = 0.015 + k * (0.025 * 0.975 / n).sqrt();
    let low = summary.tails[0] > 0.025 + slack && !summary.tau_estimated;
    let few = summary.tails.iter().any(|t| *t < 0.025 - slack) && !summary.tau_estimated;
    if low || few || summary.tails[1] > 0.025 + slack {
        wrong.push(format!("{case:?}: chi2 below and above its 95 % in {:.4?}", summary.tails));
    }
    wrong
}

/// What must hold of all cases together: runs of different cases share nothing, so that many more of them are judged at once
/// and both sides are near. An interval that is 5 % too narrow or too wide does not pass.
#[allow(dead_code)] // of the small count
pub fn check_together(all: &[Summary], k: f64) -> Vec<String> {
    let n_cases = all.len() as f64;
    let mean = |of: &dyn Fn(&Row) -> f64| -> f64 {
        all.iter().map(|s| s.rows.iter().map(of).sum::<f64>() / s.rows.len() as f64).sum::<f64>() / n_cases
    };
    // as in `check`, a quarter of the parameters of a case counts as drawn apart
    let n: f64 = all.iter().map(|s| s.runs as f64 * (s.rows.len() as f64 / 4.0).max(1.0)).sum();
    let (covered, ratio) = (mean(&|r| r.covered), mean(&|r| r.ratio.powi(2)).sqrt());
    let mut wrong = Vec::new();
    if (covered - 0.95).abs() > 0.004 + k * (0.95 * 0.05 / n).sqrt() {
        wrong.push(format!("all cases: covered in {:.2} %", 100.0 * covered));
    }
    if (ratio - 1.0).abs() > 0.01 + k / (2.0 * n).sqrt() {
        wrong.push(format!("all cases: RMS error {ratio:.4} of its bound"));
    }
    wrong
}

/// Where χ² stands in its own distribution, 0 to 1: what the repeats say themselves (σ̂² on ν degrees of freedom) is taken
/// out of it, and the rest per degree of freedom is F on (dof − ν, ν); with a stated σ it is χ² on dof.
fn lack_of_fit(chi2: f64, dof: usize, noise_dof: Option<f64>) -> f64 {
    match noise_dof {
        None => ChiSquared::new(dof as f64).unwrap().cdf(chi2),
        Some(nu) => {
            let rest = dof as f64 - nu;
            FisherSnedecor::new(rest, nu).unwrap().cdf((chi2 - nu).max(0.0) / rest)
        }
    }
}
