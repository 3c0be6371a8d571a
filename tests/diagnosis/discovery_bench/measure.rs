//! Cases at random, each planted, measured, searched and scored.

use super::find::{self, LEAN};
use super::plant::{self, Bench, Hidden};
use axiscal::diagnose::Verdict;
use axiscal::diagnose::evidence::Evidence;
use axiscal::model::catalogue::Catalogue;
use nalgebra::{DMatrix, DVector};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

/// A hidden effect with the size at which its peak over the touches is `peak_um`, and the noncentrality of that: the
/// virtual machine's own noise-free difference, projected against what the base model can follow.
pub struct Sized {
    pub hidden: Hidden,
    pub size: f64,
    pub lambda: f64,
    /// Of a mixture: the effect's own part explains less than 80 % of what these touches see of it. The admixture is an effect
    /// of the catalogue as well, and a large part of what there is to find: then either of the two is right, and the case
    /// counts.
    pub two_of_the_catalogue: bool,
    /// The difference in µm, one per touch.
    pub difference_um: DVector<f64>,
}

pub fn sized(bench: &Bench, base: &str, hidden: Hidden, peak_um: f64) -> Sized {
    let catalogue = Catalogue::built_in().unwrap();
    let gaps = |wrong: &str, own: &str| {
        let data = find::data(&bench.machine, &bench.plans, &bench.measure(wrong, own, 0.0, 1));
        let (fit, _) = find::fit(&bench.machine, &catalogue, data, &[], None);
        let free: DVector<f64> = DVector::zeros(fit.free.len());
        (fit.with_touches(0.0, |t| DVector::from_vec(t.gaps(&free))), fit)
    };
    let (without, fit) = gaps(base, "");
    let (with, _) = gaps(&format!("{base}{}", hidden.written(1.0)), hidden.own());
    let at_rest = without.clone();
    let difference = (with - without) * 1000.0;
    let size = peak_um / difference.amax();
    let difference_um = difference * size;
    let own = hidden.without_admixture().map(|own| {
        let (with, _) = gaps(&format!("{base}{}", own.written(1.0)), own.own());
        (with - &at_rest) * 1000.0 * size
    });
    let evidence = Evidence::from_fit(&fit);
    // the base at σ = 1 um and no scatter of visits
    let jacobian = fit.linear(0.0).jacobian;
    let n = difference_um.len();
    let touches = axiscal::search::Basis::new(&jacobian.rows(0, n).into_owned());
    debug_assert!(evidence.base.rank() <= jacobian.ncols());
    let lambda = touches.project(&difference_um).norm_squared();
    let seen = touches.project(&difference_um);
    // what its own part explains of the mixture as it is seen: the two parts may cancel each other where both are large
    let two_of_the_catalogue = own.is_some_and(|own| {
        let own = touches.project(&own);
        own.dot(&seen).powi(2) < 0.8 * own.norm_squared() * seen.norm_squared()
    });
    Sized { hidden, size, lambda, two_of_the_catalogue, difference_um }
}

/// What came of one planted case.
#[derive(Debug, Clone)]
pub struct Outcome {
    pub truth: String,
    pub other_shape: bool,
    pub lambda: f64,
    pub proposed: bool,
    pub verdict: Verdict,
    pub by_name: bool,
    pub first_group: bool,
    pub first_three: bool,
    pub group_size: usize,
    pub reduced_before: f64,
    pub reduced_after: f64,
    pub held_out_falls: bool,
    pub groups: Vec<Vec<String>>,
    /// Share of the misfit that the first of each group takes.
    pub shares: Vec<f64>,
}

fn draw(bench: &Bench, ids: &[String], bendable: &[String], rng: &mut ChaCha8Rng) -> Hidden {
    if rng.random_bool(1.0 / 3.0) {
        plant::bent(bench, &bendable[rng.random_range(0..bendable.len())], rng)
    } else {
        plant::hidden(bench, &ids[rng.random_range(0..ids.len())], rng)
    }
}

/// Cases that are drawn at the same time. The cases and their order do not depend on it.
fn batch_size() -> u64 {
    4 * rayon::current_num_threads() as u64
}

/// Planted cases until `count` of them have a noncentrality of 25 or more.
pub fn planted(bench: &Bench, count: usize, seed: u64) -> Vec<Outcome> {
    let ids = plant::ids(&bench.machine);
    let bendable = plant::bendable(&bench.machine);
    let mut out = Vec::new();
    let mut drawn = 0;
    while out.len() < count {
        let batch = batch_size();
        let more: Vec<Option<Outcome>> = (drawn..drawn + batch)
            .into_par_iter()
            .map(|i| {
                let mut rng = ChaCha8Rng::seed_from_u64(seed + 1000 * i);
                let base = plant::base(bench, &mut rng);
                let hidden = draw(bench, &ids, &bendable, &mut rng);
                let case = sized(bench, &base, hidden, rng.random_range(3.0..10.0));
                (case.lambda >= 25.0 && case.size.is_finite()).then(|| outcome(bench, &base, &case, rng.random()))
            })
            .collect();
        out.extend(more.into_iter().flatten());
        drawn += batch;
    }
    out.truncate(count);
    out
}

pub fn outcome(bench: &Bench, base: &str, case: &Sized, seed: u64) -> Outcome {
    let wrong = format!("{base}{}", case.hidden.written(case.size));
    let touches = bench.measure(&wrong, case.hidden.own(), 1.0, seed >> 12);
    let catalogue = Catalogue::built_in().unwrap();
    let data = find::data(&bench.machine, &bench.plans, &touches);
    let (fit, settings) = find::fit(&bench.machine, &catalogue, data, &[], None);
    let d = find::look(&bench.machine, &catalogue, &fit, &settings, &LEAN);
    let groups = find::groups(&d);
    let truth = &case.hidden.truth;
    let admixture = case.hidden.admixture.as_ref().filter(|_| case.two_of_the_catalogue);
    let right = |id: &String| id == truth || Some(id) == admixture;
    let added = groups.first().map_or_else(Vec::new, |g| vec![g.iter().find(|e| right(e)).unwrap_or(&g[0]).clone()]);
    let after = find::fit(&bench.machine, &catalogue, fit.data.clone(), &added, None).0;
    Outcome {
        truth: truth.clone(),
        other_shape: case.hidden.other_shape,
        lambda: case.lambda,
        proposed: d.candidates.first().is_some_and(|c| c.p_adjusted < 0.05),
        verdict: d.verdict.clone(),
        by_name: groups.first().is_some_and(|g| right(&g[0])),
        first_group: groups.first().is_some_and(|g| g.iter().any(right)),
        first_three: groups.iter().any(|g| g.iter().any(right)),
        group_size: groups.first().map_or(0, Vec::len),
        reduced_before: find::reduced_rms(&fit),
        reduced_after: find::reduced_rms(&after),
        held_out_falls: d.candidates.first().is_some_and(|c| c.held_out_after_um < c.held_out_before_um),
        shares: d.candidates.iter().map(|c| c.share).collect(),
        groups,
    }
}

/// What was said of a clean machine.
#[derive(Debug, Clone)]
pub struct Clean {
    pub verdict: Verdict,
    /// Why, where it is not adequate.
    pub because: String,
}

/// Clean machines: how often each verdict falls.
pub fn clean(bench: &Bench, count: u64, visit_told_um: Option<f64>, seed: u64) -> Vec<Clean> {
    let catalogue = Catalogue::built_in().unwrap();
    (0..count)
        .into_par_iter()
        .map(|i| {
            let mut rng = ChaCha8Rng::seed_from_u64(seed + i);
            let base = plant::base(bench, &mut rng);
            let touches = bench.measure(&base, "", 1.0, rng.random::<u64>() >> 12);
            let data = find::data(&bench.machine, &bench.plans, &touches);
            let (fit, settings) = find::fit(&bench.machine, &catalogue, data, &[], visit_told_um);
            let d = find::look(&bench.machine, &catalogue, &fit, &settings, &LEAN);
            let first = d.candidates.first();
            let because = format!(
                "{} p {:.1e}; {} p {:.1e}; lack of fit {:.1e}; sigma {:.2} tau {:.2}",
                first.map_or("", |c| &c.effect),
                first.map_or(1.0, |c| c.p_adjusted),
                d.depends.first().map_or("", |w| &w.id),
                d.depends.first().map_or(1.0, |w| w.p_adjusted),
                d.lack_of_fit_p,
                d.noise_um,
                d.visit_um
            );
            Clean { verdict: d.verdict.clone(), because }
        })
        .collect()
}

/// Two hidden effects at once: (both named, more than two added).
pub fn two(bench: &Bench, count: usize, seed: u64) -> Vec<(Vec<String>, Vec<Vec<String>>)> {
    let catalogue = Catalogue::built_in().unwrap();
    let ids = plant::ids(&bench.machine);
    let mut out = Vec::new();
    let mut drawn = 0;
    while out.len() < count {
        let batch = batch_size();
        let more: Vec<Option<_>> = (drawn..drawn + batch)
            .into_par_iter()
            .map(|i| {
                let mut rng = ChaCha8Rng::seed_from_u64(seed + 1000 * i);
                let base = plant::base(bench, &mut rng);
                let mut wrong = base.clone();
                let mut truths = Vec::new();
                let mut traces: Vec<DVector<f64>> = Vec::new();
                while truths.len() < 2 {
                    let hidden = plant::hidden(bench, &ids[rng.random_range(0..ids.len())], &mut rng);
                    if truths.contains(&hidden.truth) {
                        continue;
                    }
                    let case = sized(bench, &base, hidden, rng.random_range(3.0..10.0));
                    if case.lambda < 25.0 || !case.size.is_finite() {
                        continue;
                    }
                    wrong += &case.hidden.written(case.size);
                    truths.push(case.hidden.truth.clone());
                    traces.push(case.difference_um);
                }
                let touches = bench.measure(&wrong, "", 1.0, rng.random::<u64>() >> 12);
                let data = find::data(&bench.machine, &bench.plans, &touches);
                let (steps, _) = find::ladder(&bench.machine, &catalogue, &data, 4);
                // two that hide each other are one question, not two
                let apart = DMatrix::from_columns(&[traces[0].normalize(), traces[1].normalize()]);
                (apart.column(0).dot(&apart.column(1)).abs() < 0.95).then_some((truths, steps))
            })
            .collect();
        out.extend(more.into_iter().flatten());
        drawn += batch;
    }
    out.truncate(count);
    out
}

/// Are both truths in the group of a step, each in its own?
pub fn both_named(truths: &[String], steps: &[Vec<String>]) -> bool {
    let holds = |step: &Vec<String>, truth: &String| step.contains(truth);
    (0..steps.len())
        .any(|i| (0..steps.len()).any(|j| i != j && holds(&steps[i], &truths[0]) && holds(&steps[j], &truths[1])))
}
