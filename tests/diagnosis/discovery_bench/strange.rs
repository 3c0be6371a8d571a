//! What is in no catalogue: planted by the virtual machine, or by making a touch on the machine as it stood at the time.

use super::find;
use super::plant::{self, Bench};
use axiscal::axes::AxisName;
use axiscal::diagnose::verdict::Missing;
use axiscal::diagnose::{Options, Verdict};
use axiscal::log::Touch;
use axiscal::model::catalogue::Catalogue;
use axiscal::model::formula::slot;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

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

/// What came of one.
#[derive(Debug, Clone)]
pub struct Seen {
    pub kind: usize,
    pub lambda: f64,
    pub verdict: Verdict,
    pub first: Option<String>,
    pub depends: Vec<String>,
    pub rejected: usize,
    pub proposed: Option<String>,
    /// Said as the whole answer: proposed, separated from all others, no shape is better, and nothing else is missing. Of these kinds every
    /// name is wrong, or a part of what acts.
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

pub fn run(bench: &Bench, kind: usize, count: u64, seed: u64) -> Vec<Seen> {
    (0..count).into_par_iter().map(|i| one(bench, kind, &mut ChaCha8Rng::seed_from_u64(seed + i))).collect()
}

fn one(bench: &Bench, kind: usize, rng: &mut ChaCha8Rng) -> Seen {
    let catalogue = Catalogue::built_in().unwrap();
    let (touches, lambda) = loop {
        let (wrong, clean) = touches(bench, kind, rng);
        let lambda = noncentrality(bench, &catalogue, &wrong, &clean);
        if lambda >= SEEN {
            break (wrong, lambda);
        }
    };
    let data = find::data(&bench.machine, &bench.plans, &touches);
    let (fit, settings) = find::fit(&bench.machine, &catalogue, data.clone(), &[], None);
    // as `diagnose` asks, refits included
    let options = Options { at_most: 3, refit: true, power: false, planned: None };
    let d = find::look(&bench.machine, &catalogue, &fit, &settings, &options);
    let mut more: Vec<String> = Vec::new();
    let mut last = d.clone();
    for _ in 0..2 {
        let Some(next) = last.candidates.iter().find(|c| !more.contains(&c.effect)) else { break };
        more.push(next.effect.clone());
        let (fit, settings) = find::fit(&bench.machine, &catalogue, data.clone(), &more, None);
        last = find::look(&bench.machine, &catalogue, &fit, &settings, &options);
    }
    Seen {
        kind,
        lambda,
        adequate_after_two: last.verdict == Verdict::Adequate,
        verdict: d.verdict.clone(),
        first: d.depends.first().map(|w| format!("{} ({:.2})", w.id, w.share)),
        depends: d.depends.iter().map(|w| w.by.clone()).collect(),
        rejected: d.outliers.len(),
        proposed: d.candidates.first().filter(|c| c.proposed).map(|c| c.effect.clone()),
        bare: d.verdict == Verdict::MissingEffect(Missing::Effect(None))
            && d.candidates.first().is_some_and(|c| c.proposed && c.same_as.is_empty() && c.remains != Some(true)),
        sketched: if KINDS[kind].2 { find::sketched(&bench.machine, &catalogue, &fit, &settings) } else { None },
    }
}

/// An effect that only the virtual machine knows: displacements with formulas.
fn own(at: &str, terms: &[(&str, String)]) -> (String, String) {
    let mut file = format!("[[effect]]\nid = \"planted\"\nat = \"{at}\"\nterms = [\n");
    let mut planted = "[effects.planted]\n".to_owned();
    for (i, (dof, formula)) in terms.iter().enumerate() {
        file += &format!("{{ parameter = \"p{i}\", unit = \"um\", dof = \"{dof}\", formula = \"{formula}\" }},\n");
        planted += &format!("p{i} = 1.0\n");
    }
    (file + "]\n", planted)
}

/// What it leaves: the same touches with and without it, the noise being the same.
fn noncentrality(bench: &Bench, catalogue: &Catalogue, wrong: &[Vec<Touch>], clean: &[Vec<Touch>]) -> f64 {
    let gaps = |touches: &[Vec<Touch>]| {
        let data = find::data(&bench.machine, &bench.plans, touches);
        let (fit, _) = find::fit(&bench.machine, catalogue, data, &[], None);
        let rest = nalgebra::DVector::zeros(fit.free.len());
        (fit.with_touches(0.0, |t| nalgebra::DVector::from_vec(t.gaps(&rest))), fit)
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
    let base = plant::base(bench, rng);
    let seed = rng.random::<u64>() >> 12;
    let size = rng.random_range(4.0..9.0) * sign(rng);
    let hour = rng.random_range(0.3..0.7) * bench.hours();
    let clean = bench.measure(&base, "", 1.0, seed);
    let wrong = match kind {
        0 => {
            // a tooth turns the table, shifts it or tilts it: blocks beside the turntable see none of that
            let dof = ["rz", "dx", "dy", "dz", "rx", "ry"][rng.random_range(0..6)];
            let (unit, each) = if dof.starts_with('r') { ("urad", 25.0) } else { ("um", 1.0) };
            let (cos, sin) = (each * size, 0.6 * each * size * sign(rng));
            let wrong = format!(
                "{base}[[harmonic]]\naxis = \"C\"\ndof = \"{dof}\"\nk = 7\ncos_{unit} = {cos:?}\nsin_{unit} = {sin:?}\n"
            );
            bench.measure(&wrong, "", 1.0, seed)
        }
        1 => {
            let (plan, _) = &bench.plans[rng.random_range(0..bench.plans.len())];
            // a block that is touched before and after
            let block = loop {
                let b = &plan.blocks[rng.random_range(0..plan.blocks.len())];
                let begins = bench.plans.iter().find(|(p, _)| std::ptr::eq(p, plan)).unwrap().1;
                let times =
                    plan.touches.iter().filter(|t| t.block == b.name).map(|t| (begins + t.time_s.unwrap()) / 3600.0);
                let times: Vec<f64> = times.collect();
                if times.iter().any(|t| *t < hour - 0.1) && times.iter().any(|t| *t > hour + 0.1) {
                    break b;
                }
            };
            let near = |w: &str, c: f64, half: f64| format!("step({half:?} - abs({w} - ({c:?})))", half = half + 0.6);
            let [x, y, z] = block.centre;
            let [sx, sy, sz] = block.size.map(|s| 0.5 * s);
            let here = format!("step(t - {hour:?})*{}*{}*{}", near("px", x, sx), near("py", y, sy), near("pz", z, sz));
            let (file, planted) =
                own("block", &[("dx", format!("{size:?}*{here}")), ("dy", format!("{:?}*{here}", size * sign(rng)))]);
            bench.measure(&format!("{base}{planted}"), &file, 1.0, seed)
        }
        2 => {
            // in one or two directions it would be positions that axes lost, which have a name
            let jump = |size: f64| format!("{size:?}*step(t - {hour:?})");
            let (y, z) = (size * sign(rng), size * sign(rng));
            let (file, planted) = own("base", &[("dx", jump(size)), ("dy", jump(y)), ("dz", jump(z))]);
            bench.measure(&format!("{base}{planted}"), &file, 1.0, seed)
        }
        3 => {
            let phase = rng.random_range(0.0..std::f64::consts::TAU);
            let (file, planted) = own("base", &[("dz", format!("{:?}*sin(2*pi*t/0.15 + {phase:?})", 0.6 * size))]);
            bench.measure(&format!("{base}{planted}"), &file, 1.0, seed)
        }
        4 => hysteresis(bench, &base, 4.0 * size, seed),
        _ => chips(bench, &base, rng, seed),
    };
    (wrong, clean)
}

/// B stands off by so much per turn of 90 degrees at the visit before: each visit is made on a machine with that zero.
fn hysteresis(bench: &Bench, base: &str, urad: f64, seed: u64) -> Vec<Vec<Touch>> {
    let mut before: Vec<Vec<f64>> = Vec::new();
    for (plan, _) in &bench.plans {
        let (mut now, mut earlier) = (None::<f64>, 0.0);
        before.push(
            plan.touches
                .iter()
                .map(|t| {
                    let at = t.pose.get(AxisName::B).unwrap_or(0.0);
                    if let Some(last) = now
                        && (at - last).abs() > 1e-6
                    {
                        earlier = last;
                    }
                    now = Some(at);
                    earlier
                })
                .collect(),
        );
    }
    let mut places: Vec<f64> = before.iter().flatten().copied().collect();
    places.sort_by(f64::total_cmp);
    places.dedup();
    let mut out: Vec<Vec<Touch>> = Vec::new();
    for place in places {
        let deg = (urad * 1e-6 * place / 90.0).to_degrees();
        let made = bench.measure(&format!("{base}[effects.zero-b]\nEB0B = {deg:?}\n"), "", 1.0, seed);
        if out.is_empty() {
            out = made;
            continue;
        }
        for ((to, from), before) in out.iter_mut().zip(made).zip(&before) {
            for ((t, f), b) in to.iter_mut().zip(from).zip(before) {
                if (b - place).abs() < 1e-6 {
                    *t = f;
                }
            }
        }
    }
    out
}

/// Chips lie on three faces: each is touched early wherever it is touched, most of the time.
fn chips(bench: &Bench, base: &str, rng: &mut ChaCha8Rng, seed: u64) -> Vec<Vec<Touch>> {
    let mut out = bench.measure(base, "", 1.0, seed);
    let data = find::data(&bench.machine, &bench.plans, &out);
    for _ in 0..3 {
        let like = &data.observations[rng.random_range(0..data.observations.len())];
        let height = rng.random_range(0.005..0.03);
        for o in &data.observations {
            let same = o.set_up == like.set_up && (o.normal - like.normal).norm() < 1e-6;
            if same && rng.random_bool(0.7) {
                let touch = out[o.run].iter_mut().find(|t| t.id == o.id).unwrap();
                let n = nalgebra::Vector3::from_iterator((0..3).map(|k| o.state[slot::NORMAL_IN_R + k]));
                touch.position = touch.position.with_xyz_mm(touch.position.xyz_mm() + n * height);
            }
        }
    }
    out
}
