//! Asks the program what is missing, and compares its answer with what was planted.

use super::bench::{Act, Bench};
use super::faults::{self, Fault};
use super::mistakes::Mistake;
use axiscal::diagnose::evidence::Evidence;
use axiscal::diagnose::next_step::NextStep;
use axiscal::diagnose::{Diagnosis, Options, Subject, diagnose};
use axiscal::fit::{Fit, Settings, identify_data};
use axiscal::log::Touch;
use axiscal::model::catalogue::Catalogue;
use axiscal::model::data::{Run, assemble};
use nalgebra::DVector;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

/// What is asked of each case.
#[derive(Debug, Clone, Copy)]
pub struct Conditions {
    /// Scatter of the ball from one index position to the next, µm.
    pub visit_um: f64,
    /// The noncentrality that every fault is given; without it its peak is 3 to 10 µm and its noncentrality 25 or more.
    pub noncentrality: Option<f64>,
}

/// What came of a case.
#[derive(Debug, Clone)]
pub struct Outcome {
    pub bench: String,
    pub what: String,
    pub expects: Vec<String>,
    pub noncentrality: f64,
    pub verdict: String,
    /// Number of the group, from 1, that holds a right name.
    pub rank: Option<usize>,
    /// The group's first name is right.
    pub by_name: bool,
    pub groups: Vec<Vec<String>>,
    /// A right name is proposed, or one that the answer says cannot be separated from a proposed one.
    pub proposed: bool,
    /// Two effects are named together, where one fault was planted.
    pub pair: bool,
    /// The error of index positions left out falls with the effect that is named first.
    pub held_out_falls: bool,
    /// Reduced RMS before, and with a right name of the first group (else its first) in the model.
    pub reduced: (f64, f64),
}

/// As `diagnose` asks, refits included, without what is only said beside the answer.
pub const AS_ASKED: Options = Options { at_most: 3, refit: true, power: false, planned: None };

pub fn fit(bench: &Bench, touches: &[Vec<Touch>], more: &[String]) -> (Fit, Settings) {
    let runs: Vec<Run> = bench
        .runs
        .iter()
        .zip(touches)
        .map(|((plan, began), touches)| Run { plan, touches, mounting: None, started_s: Some(*began) })
        .collect();
    let effects = bench.base_model().into_iter().chain(more.iter().cloned()).collect();
    let settings = Settings { effects, quick: true, ..Settings::default() };
    let catalogue = Catalogue::built_in().unwrap();
    (identify_data(&bench.machine, &catalogue, assemble(&bench.machine, &runs), &settings).unwrap(), settings)
}

/// What the program says of a machine with these faults, at 1 µm of noise.
pub fn diagnosis(bench: &Bench, acts: &[&Act], seed: u64) -> Diagnosis {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let base = bench.ordinary(&mut rng);
    let all: Vec<&Act> = std::iter::once(&*base).chain(acts.iter().copied()).collect();
    let (fit, settings) = fit(bench, &bench.measure(&all, 1.0, 0.0, true, &mut rng), &[]);
    ask(bench, &fit, &settings)
}

pub fn ask(bench: &Bench, fit: &Fit, settings: &Settings) -> Diagnosis {
    let catalogue = Catalogue::built_in().unwrap();
    diagnose(Subject { machine: &bench.machine, catalogue: &catalogue, settings, fit }, &AS_ASKED).unwrap()
}

pub fn groups(d: &Diagnosis) -> Vec<Vec<String>> {
    d.candidates.iter().map(|c| std::iter::once(c.effect.clone()).chain(c.same_as.iter().cloned()).collect()).collect()
}

/// Readings without noise, less what the errorless fit leaves, µm.
fn gaps(bench: &Bench, acts: &[&Act]) -> (DVector<f64>, Fit) {
    let mut rng = ChaCha8Rng::seed_from_u64(0);
    let (fit, _) = fit(bench, &bench.measure(acts, 0.0, 0.0, true, &mut rng), &[]);
    let free: DVector<f64> = DVector::zeros(fit.free.len());
    (fit.with_touches(0.0, |t| DVector::from_vec(t.gaps(&free))) * 1000.0, fit)
}

/// What a fault of size 1 adds to the readings, µm, and what of it the base model cannot follow.
fn trace(bench: &Bench, base: &Act, fault: &Fault) -> Option<(DVector<f64>, DVector<f64>)> {
    let (without, fit) = gaps(bench, &[base]);
    let (with, _) = gaps(bench, &[base, &*fault.at_size(1.0)]);
    if with.len() != without.len() {
        return None;
    }
    let difference = with - without;
    let jacobian = fit.linear(0.0).jacobian;
    let touches = axiscal::search::Basis::new(&jacobian.rows(0, difference.len()).into_owned());
    let left = touches.project(&difference);
    Some((difference, left))
}

/// The size of a fault, and its noncentrality at 1 µm of noise; `None` where the base model takes all of it.
pub fn sized(bench: &Bench, base: &Act, fault: &Fault, conditions: Conditions, peak_um: f64) -> Option<(f64, f64)> {
    let (difference, left) = trace(bench, base, fault)?;
    size_of(&difference, left.norm_squared(), conditions, peak_um)
}

fn size_of(difference: &DVector<f64>, seen: f64, conditions: Conditions, peak_um: f64) -> Option<(f64, f64)> {
    let size = match conditions.noncentrality {
        Some(wanted) => (wanted / seen).sqrt(),
        None => peak_um / difference.amax(),
    };
    // what must be made huge to be seen is no fault of a machine
    (size.is_finite() && size < 40.0 && size * size * seen >= 25.0).then_some((size, size * size * seen))
}

/// What came of two faults at once.
#[derive(Debug, Clone)]
pub struct Pair {
    pub bench: String,
    pub what: [String; 2],
    /// The group of each step.
    pub steps: Vec<Vec<String>>,
    /// Each of the two has a right name in the group of a step of its own.
    pub both: bool,
}

/// Two faults at once, each of which can be seen, until there are `count`: look, add what is proposed first, look again.
pub fn pairs(benches: &[Bench], count: usize, seed: u64) -> Vec<Pair> {
    let mut out = Vec::new();
    let mut drawn = 0u64;
    while out.len() < count {
        let batch = 4 * rayon::current_num_threads() as u64;
        let more: Vec<Option<Pair>> = (drawn..drawn + batch)
            .into_par_iter()
            .map(|i| {
                let mut rng = ChaCha8Rng::seed_from_u64(seed.wrapping_mul(1_000_003).wrapping_add(i));
                pair(&benches[i as usize % benches.len()], &mut rng)
            })
            .collect();
        out.extend(more.into_iter().flatten());
        drawn += batch;
    }
    out.truncate(count);
    out
}

/// Names that a step may have: a pair that hides each other is one question and does not count.
const ONE_QUESTION: f64 = 0.95;
const MOST_STEPS: usize = 4;

fn pair(bench: &Bench, rng: &mut ChaCha8Rng) -> Option<Pair> {
    let plain = Conditions { visit_um: 0.0, noncentrality: None };
    let base = bench.ordinary(rng);
    let mut acts: Vec<Box<Act>> = Vec::new();
    let mut faults: Vec<Fault> = Vec::new();
    let mut traces: Vec<DVector<f64>> = Vec::new();
    while faults.len() < 2 {
        let fault = super::faults::draw(bench, rng);
        let peak_um = rng.random_range(3.0..10.0);
        if faults.iter().any(|f| f.expects.iter().any(|id| fault.expects.contains(id))) {
            continue;
        }
        let Some((difference, left)) = trace(bench, &base, &fault) else { continue };
        let Some((size, _)) = size_of(&difference, left.norm_squared(), plain, peak_um) else { continue };
        acts.push(fault.at_size(size));
        traces.push(left.normalize());
        faults.push(fault);
    }
    if traces[0].dot(&traces[1]).abs() >= ONE_QUESTION {
        return None;
    }
    let all: Vec<&Act> = std::iter::once(&*base).chain(acts.iter().map(|act| &**act)).collect();
    let touches = bench.measure(&all, 1.0, 0.0, true, rng);
    let (mut more, mut steps) = (Vec::new(), Vec::new());
    while steps.len() < MOST_STEPS {
        let (now, settings) = fit(bench, &touches, &more);
        let d = ask(bench, &now, &settings);
        // as `solve` does: of two that are named together the one that is clear
        let clear = if let NextStep::Add(clear) = d.next_step() { Some(clear) } else { d.proposed().first() };
        let Some(added) = clear else { break };
        more.push(added.effect.clone());
        steps.push(std::iter::once(&added.effect).chain(&added.same_as).cloned().collect());
    }
    let named = |step: &Vec<String>, fault: &Fault| step.iter().any(|id| fault.expects.contains(id));
    let both = (0..steps.len())
        .any(|i| (0..steps.len()).any(|j| i != j && named(&steps[i], &faults[0]) && named(&steps[j], &faults[1])));
    let what = [faults[0].what.clone(), faults[1].what.clone()];
    Some(Pair { bench: bench.name.clone(), what, steps, both })
}

/// Cases until `count` of them can be seen.
pub fn planted(benches: &[Bench], conditions: Conditions, count: usize, seed: u64) -> Vec<Outcome> {
    let mut out = Vec::new();
    let mut drawn = 0u64;
    while out.len() < count {
        let batch = 4 * rayon::current_num_threads() as u64;
        let more: Vec<Option<Outcome>> = (drawn..drawn + batch)
            .into_par_iter()
            .map(|i| {
                let mut rng = ChaCha8Rng::seed_from_u64(seed.wrapping_mul(1_000_003).wrapping_add(i));
                let bench = &benches[i as usize % benches.len()];
                let base = bench.ordinary(&mut rng);
                let fault = faults::draw(bench, &mut rng);
                let peak_um = rng.random_range(3.0..10.0);
                let (size, noncentrality) = sized(bench, &base, &fault, conditions, peak_um)?;
                Some(one(bench, &base, &fault, size, noncentrality, conditions, &mut rng))
            })
            .collect();
        out.extend(more.into_iter().flatten());
        drawn += batch;
    }
    out.truncate(count);
    out
}

fn one(
    bench: &Bench,
    base: &Act,
    fault: &Fault,
    size: f64,
    noncentrality: f64,
    conditions: Conditions,
    rng: &mut ChaCha8Rng,
) -> Outcome {
    let touches = bench.measure(&[base, &*fault.at_size(size)], 1.0, conditions.visit_um, true, rng);
    let (fit, settings) = fit(bench, &touches, &[]);
    let d = ask(bench, &fit, &settings);
    let groups = groups(&d);
    let right = |id: &String| fault.expects.contains(id);
    let added = groups.first().and_then(|g| g.iter().find(|id| right(id)).or(g.first()));
    let after = added.map(|id| self::fit(bench, &touches, std::slice::from_ref(id)).0);
    Outcome {
        held_out_falls: d.candidates.first().is_some_and(|c| c.held_out_after_um < c.held_out_before_um),
        reduced: (reduced_rms(&fit), reduced_rms(after.as_ref().unwrap_or(&fit))),
        bench: bench.name.clone(),
        what: fault.what.clone(),
        expects: fault.expects.clone(),
        noncentrality,
        verdict: d.verdict.as_str().to_owned(),
        rank: groups.iter().position(|g| g.iter().any(right)).map(|i| i + 1),
        by_name: groups.first().is_some_and(|g| right(&g[0])),
        proposed: d.proposed().iter().any(|c| right(&c.effect) || c.same_as.iter().any(right)),
        pair: d.candidates.first().is_some_and(|c| c.together_with.is_some()),
        groups,
    }
}

/// Verdicts on machines without a fault.
pub fn clean(benches: &[Bench], visit_um: f64, count: usize, seed: u64) -> Vec<(String, String)> {
    (0..count as u64)
        .into_par_iter()
        .map(|i| {
            let mut rng = ChaCha8Rng::seed_from_u64(seed.wrapping_mul(1_000_003).wrapping_add(i));
            let bench = &benches[i as usize % benches.len()];
            let base = bench.ordinary(&mut rng);
            let (fit, settings) = fit(bench, &bench.measure(&[&*base], 1.0, visit_um, true, &mut rng), &[]);
            let d = ask(bench, &fit, &settings);
            (bench.name.clone(), d.verdict.as_str().to_owned())
        })
        .collect()
}

/// What came of a mistake.
#[derive(Debug)]
pub struct Led {
    pub bench: String,
    pub what: &'static str,
    /// After one or two steps the answer names one of the expected effects or mistakes.
    pub led: bool,
    /// The first step named nothing that could be added; the verdict said that an expected effect cannot be tested without
    /// temperatures, and the user gave them.
    pub gave_temperatures: bool,
    pub said: Vec<String>,
}

/// Is a user who made a mistake led to its cause within two steps? A step adds the effect that is named first, or gives the
/// temperatures that the verdict asks for.
pub fn mistake(bench: &Bench, mistake: &Mistake, seed: u64) -> Led {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let base = bench.ordinary(&mut rng);
    let mut same_draws = rng.clone();
    let mut result =
        Led { bench: bench.name.clone(), what: mistake.what, led: false, gave_temperatures: false, said: Vec::new() };
    let mut touches = match (mistake.make)(bench, &base, &mut rng) {
        Ok(touches) => touches,
        Err(refused) => {
            result.said = refused.0.into_iter().map(|finding| finding.message).collect();
            result.led = result.said.iter().any(|message| mistake.expects.iter().any(|word| message.contains(word)));
            return result;
        }
    };
    let (mut more, mut expects) = (Vec::new(), mistake.expects);
    for _ in 0..2 {
        let (fit, settings) = fit(bench, &touches, &more);
        let d = ask(bench, &fit, &settings);
        let groups = groups(&d);
        let first = groups.first().filter(|_| d.verdict.is_missing_effect());
        let named = first.is_some_and(|g| g.iter().any(|id| expects.contains(&id.as_str())));
        let gross = d.mistake().is_some() && d.gross.first().is_some_and(|g| expects.contains(&g.hypothesis.as_str()));
        // a size that no machine has: the verdict names the first
        let too_large = d.oversized.first().is_some_and(|o| expects.contains(&o.effect.as_str()));
        // a drift is the room's only where the answer says that the log has no temperatures
        result.led |= named && (mistake.with_temperatures.is_none() || result.gave_temperatures) || gross || too_large;
        let cannot_be_tested = |id: &str| d.needs_temperature.iter().any(|e| e == id);
        // beside the verdict, or beside the name of a drift
        let or_the_room = d.candidates.first().is_some_and(|c| c.proposed && c.or_else.is_some());
        let asks_for_temperatures =
            expects.iter().any(|id| cannot_be_tested(id) && (or_the_room || d.says.contains(id)));
        let first_name = first.map(|g| g[0].clone());
        result.said.push(format!("{}: {}", d.verdict.as_str(), first_name.as_deref().unwrap_or("no effect")));
        match (first_name.filter(|id| id != "sign-or-axis-swap"), &mistake.with_temperatures) {
            (_, Some((make, then))) if asks_for_temperatures && !result.gave_temperatures => {
                touches = make(bench, &base, &mut same_draws).unwrap();
                // the second step has to name the cause
                (result.led, result.gave_temperatures, expects) = (false, true, then);
            }
            (Some(id), _) => more.push(id),
            _ => break,
        }
    }
    result
}

/// Wilson's interval of a rate, 95 %.
pub fn wilson(hits: usize, of: usize) -> (f64, f64) {
    let (n, z) = (of.max(1) as f64, 1.959_963_984_540_054);
    let p = hits as f64 / n;
    let (middle, half) = (
        (p + z * z / (2.0 * n)) / (1.0 + z * z / n),
        z / (1.0 + z * z / n) * (p * (1.0 - p) / n + z * z / (4.0 * n * n)).sqrt(),
    );
    (middle - half, middle + half)
}

/// `97.5 % (390 of 400; 95.5 to 98.6 %)`
pub fn rate(hits: usize, of: usize) -> String {
    let (low, high) = wilson(hits, of);
    let percent = |x: f64| 100.0 * x;
    format!(
        "{:.1} % ({hits} of {of}; {:.1} to {:.1} %)",
        percent(hits as f64 / of.max(1) as f64),
        percent(low),
        percent(high)
    )
}

/// Reduced RMS: what a fit leaves, over the noise of a touch.
pub fn reduced_rms(fit: &Fit) -> f64 {
    let evidence = Evidence::from_fit(fit);
    let ss = evidence.base.project(&evidence.residual).norm_squared();
    (ss / evidence.dof() as f64).sqrt()
}
