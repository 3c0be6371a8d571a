//! What is in no catalogue, on `full` of a machine with head and table.

use super::bench::{Act, At, Bench};
use super::forward::{Slip, V, Wrong};
use super::judge;
use axiscal::axes::AxisName;
use axiscal::diag::source;
use axiscal::diagnose::verdict::Missing;
use axiscal::diagnose::{Subject, Verdict, sketch};
use axiscal::fit::{Fit, Settings, identify_data};
use axiscal::log::Touch;
use axiscal::model::catalogue::Catalogue;
use nalgebra::DVector;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use std::f64::consts::TAU;

/// Kinds, each with the variables that are right, and whether a formula has its shape.
pub const KINDS: [(&str, &[&str], bool); 6] = [
    ("teeth of C, 7 per turn", &["pose.C"], true),
    ("one block bumped", &["time*block", "block"], false),
    ("step in time in X, Y and Z", &["time"], false),
    ("cycle of 9 minutes", &["time"], true),
    ("hysteresis of B", &["before.B"], true),
    ("chips on three faces", &["face"], false),
];

/// Smaller ones do not count.
const SEEN: f64 = 25.0;
/// Noise of a touch, µm.
const TOUCH_UM: f64 = 1.0;

/// What came of one.
#[derive(Debug, Clone)]
pub struct Seen {
    pub kind: usize,
    pub noncentrality: f64,
    pub verdict: Verdict,
    pub first: Option<String>,
    pub depends: Vec<String>,
    pub rejected: usize,
    pub proposed: Option<String>,
    /// Said as the whole answer: proposed, separated from all others, no shape is better, nothing else is missing, and the repeats do not
    /// say that a part of what acts may count as noise. Of these kinds every name is wrong, or a part of what acts.
    pub bare: bool,
    /// Reduced RMS with the sketched formula, where the kind has one.
    pub sketched: Option<f64>,
    /// With the first two names in the model, none of which is the cause: is nothing missing any more?
    pub adequate_after_two: bool,
}

impl Seen {
    pub fn right(&self) -> bool {
        self.depends.first().is_some_and(|w| KINDS[self.kind].1.contains(&w.as_str()))
    }
}

pub fn run(kind: usize, count: u64, seed: u64) -> Vec<Seen> {
    let bench = Bench::of("swivel-head", true);
    (0..count).into_par_iter().map(|i| one(&bench, kind, &mut ChaCha8Rng::seed_from_u64(seed + i))).collect()
}

fn one(bench: &Bench, kind: usize, rng: &mut ChaCha8Rng) -> Seen {
    let (touches, noncentrality) = loop {
        let (wrong, clean) = touches(bench, kind, rng);
        let noncentrality = noncentrality(bench, &wrong, &clean);
        if noncentrality >= SEEN {
            break (wrong, noncentrality);
        }
    };
    let (fit, settings) = judge::fit(bench, &touches, &[]);
    let d = judge::ask(bench, &fit, &settings);
    let mut more: Vec<String> = Vec::new();
    let mut last = d.clone();
    for _ in 0..2 {
        let Some(next) = last.candidates.iter().find(|c| !more.contains(&c.effect)) else { break };
        more.push(next.effect.clone());
        let (fit, settings) = judge::fit(bench, &touches, &more);
        last = judge::ask(bench, &fit, &settings);
    }
    Seen {
        kind,
        noncentrality,
        adequate_after_two: last.verdict == Verdict::Adequate,
        verdict: d.verdict.clone(),
        first: d.depends.first().map(|w| format!("{} ({:.2})", w.id, w.share)),
        depends: d.depends.iter().map(|w| w.by.clone()).collect(),
        rejected: d.outliers.len(),
        proposed: d.candidates.first().filter(|c| c.proposed).map(|c| c.effect.clone()),
        bare: d.verdict == Verdict::MissingEffect(Missing::Effect(None))
            && d.declared_noise_um.is_none()
            && d.candidates.first().is_some_and(|c| c.proposed && c.same_as.is_empty() && c.remains != Some(true)),
        sketched: if KINDS[kind].2 { sketched(bench, &fit, &settings) } else { None },
    }
}

/// Reduced RMS with the sketched effect in the model; `None` where nothing can be sketched.
fn sketched(bench: &Bench, first: &Fit, settings: &Settings) -> Option<f64> {
    let mut catalogue = Catalogue::built_in().unwrap();
    let subject = Subject { machine: &bench.machine, catalogue: &catalogue, settings, fit: first };
    let made = sketch::sketch(subject, &|id| catalogue.knows(id)).ok()?;
    catalogue.add_file(&source("my-effects.toml", made.toml)).unwrap();
    let mut with = settings.clone();
    with.effects.push(made.id);
    Some(judge::reduced_rms(&identify_data(&bench.machine, &catalogue, first.data.clone(), &with).unwrap()))
}

/// What it leaves: the same touches with and without it, the noise being the same.
fn noncentrality(bench: &Bench, wrong: &[Vec<Touch>], clean: &[Vec<Touch>]) -> f64 {
    let gaps = |touches: &[Vec<Touch>]| {
        let (fit, _) = judge::fit(bench, touches, &[]);
        let rest = DVector::zeros(fit.free.len());
        (fit.with_touches(0.0, |t| DVector::from_vec(t.gaps(&rest))), fit)
    };
    let (with, _) = gaps(wrong);
    let (without, fit) = gaps(clean);
    let jacobian = fit.linear(0.0).jacobian;
    let base = axiscal::search::Basis::new(&jacobian.rows(0, with.len()).into_owned());
    base.project(&((with - without) * 1000.0)).norm_squared()
}

fn sign(rng: &mut ChaCha8Rng) -> f64 {
    if rng.random_bool(0.5) { 1.0 } else { -1.0 }
}

/// Touches with it and without it, of equal noise.
fn touches(bench: &Bench, kind: usize, rng: &mut ChaCha8Rng) -> (Vec<Vec<Touch>>, Vec<Vec<Touch>>) {
    let base = bench.ordinary(rng);
    let mm = rng.random_range(4e-3..9e-3) * sign(rng);
    let hour = rng.random_range(0.3..0.7) * bench.hours();
    let act: Box<Act> = match kind {
        0 => teeth(mm, rng),
        1 => bumped(bench, mm, hour, rng),
        2 => {
            // in one or two directions it would be positions that axes lost, which have a name
            let jump = V::new(mm, mm * sign(rng), mm * sign(rng));
            Box::new(move |at: &At, wrong: &mut Wrong| wrong.tool += if at.hours > hour { jump } else { V::zeros() })
        }
        3 => {
            let phase = rng.random_range(0.0..TAU);
            Box::new(move |at: &At, wrong: &mut Wrong| wrong.tool.z += 0.6 * mm * (TAU * at.hours / 0.15 + phase).sin())
        }
        // B stands off by so much per turn of 90 degrees at the pose before
        4 => Box::new(move |at: &At, wrong: &mut Wrong| wrong.joint[4] += 4e-3 * mm * at.pose_before[4] / (TAU / 4.0)),
        _ => Box::new(|_: &At, _: &mut Wrong| {}),
    };
    let measured = |acts: &[&Act], rng: &mut ChaCha8Rng| bench.measure(acts, TOUCH_UM, 0.0, true, rng);
    let clean = measured(&[&*base], &mut rng.clone());
    let mut wrong = measured(&[&*base, &*act], rng);
    if kind == 5 {
        chips(bench, &mut wrong, rng);
    }
    (wrong, clean)
}

/// The table turns, shifts or leans seven times per turn of C.
fn teeth(mm: f64, rng: &mut ChaCha8Rng) -> Box<Act> {
    let (component, other) = (rng.random_range(0..6), 0.6 * sign(rng));
    Box::new(move |at: &At, wrong: &mut Wrong| {
        let by = mm * ((7.0 * at.q[5]).cos() + other * (7.0 * at.q[5]).sin());
        let along = V::from_fn(|k, _| f64::from(u8::from(k == component % 3)));
        let about = at.machine.axis(AxisName::C).unwrap().point;
        // a turn of 25 µrad where a shift is 1 µm
        let slip = if component < 3 { Slip::shift(along * by) } else { Slip::turn(along * (0.025 * by), about) };
        wrong.before[5].push(slip);
    })
}

/// A block that is touched before and after.
fn bumped(bench: &Bench, mm: f64, hour: f64, rng: &mut ChaCha8Rng) -> Box<Act> {
    let (plan, _) = &bench.runs[0];
    let mut stands: Vec<(&str, [bool; 2])> = Vec::new();
    for touch in &plan.touches {
        let i = stands.iter().position(|(name, _)| *name == &*touch.block).unwrap_or_else(|| {
            stands.push((&touch.block, [false; 2]));
            stands.len() - 1
        });
        let hours = touch.time_s.unwrap() / 3600.0;
        stands[i].1[0] |= hours < hour - 0.1;
        stands[i].1[1] |= hours > hour + 0.1;
    }
    let both: Vec<usize> = (0..stands.len()).filter(|i| stands[*i].1 == [true; 2]).collect();
    let block = both[rng.random_range(0..both.len())];
    let shift = V::new(mm, mm * sign(rng), 0.0);
    Box::new(move |at: &At, wrong: &mut Wrong| {
        if at.block == block && at.hours > hour {
            wrong.block_shift += shift;
        }
    })
}

/// Chips lie on three faces: each is touched early wherever it is touched, most of the time.
fn chips(bench: &Bench, touches: &mut [Vec<Touch>], rng: &mut ChaCha8Rng) {
    let data = judge::fit(bench, touches, &[]).0.data;
    for _ in 0..3 {
        let like = &data.observations[rng.random_range(0..data.observations.len())];
        let height = rng.random_range(0.005..0.03);
        for o in &data.observations {
            let same = o.set_up == like.set_up && (o.normal - like.normal).norm() < 1e-6;
            if same && rng.random_bool(0.7) {
                let touch = touches[o.run].iter_mut().find(|t| t.id == o.id).unwrap();
                let n = V::from_fn(|k, _| o.state[axiscal::model::formula::slot::NORMAL_IN_R + k]);
                touch.position = touch.position.with_xyz_mm(touch.position.xyz_mm() + n * height);
            }
        }
    }
}
