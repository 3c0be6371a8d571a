//! The simulating half of the discovery runs: what is wrong with the virtual machine. Nothing here is seen by the half
//! that searches; only touches go over.

use axiscal::diag::source;
use axiscal::log::Touch;
use axiscal::machine::Machine;
use axiscal::model::catalogue::{Catalogue, Effect};
use axiscal::model::surface::Body;
use axiscal::program::plan::Plan;
use axiscal::simulate::{self, Scenario};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use std::fmt::Write as _;

/// The runs of a measurement: plan and when it began, s.
pub struct Bench {
    pub machine: Machine,
    pub plans: Vec<(Plan, f64)>,
    /// Scatter of index visits in all its runs, um.
    pub visit_um: f64,
}

impl Bench {
    /// The paper's two programs, every touch made twice.
    pub fn paper() -> Self {
        let machine = crate::common::machine("swivel-head");
        let mut plans: Vec<(Plan, f64)> = Vec::new();
        for name in ["head", "table"] {
            let mut plan = crate::common::plan(&machine, name);
            let mut twice = Vec::new();
            for touch in &plan.touches {
                for repeat in 1..=2u32 {
                    let mut t = touch.clone();
                    t.id = 2 * touch.id + u64::from(repeat) - 2;
                    t.repeat = repeat;
                    t.time_s = touch.time_s.map(|s| 1.5 * s + 6.0 * f64::from(repeat));
                    twice.push(t);
                }
            }
            plan.touches = twice;
            let begins = plans.last().map_or(0.0, |(p, s)| s + p.touches.last().unwrap().time_s.unwrap() + 600.0);
            plans.push((plan, begins));
        }
        Self { machine, plans, visit_um: 0.0 }
    }

    /// The rich program.
    pub fn full() -> Self {
        let machine = crate::common::machine("swivel-head");
        let plan = crate::common::plan(&machine, "full");
        Self { machine, plans: vec![(plan, 0.0)], visit_um: 0.0 }
    }

    pub fn with_visits(self, visit_um: f64) -> Self {
        Self { visit_um, ..self }
    }

    /// Hours that the runs take.
    pub fn hours(&self) -> f64 {
        let (plan, begins) = self.plans.last().unwrap();
        (begins + plan.touches.last().unwrap().time_s.unwrap()) / 3600.0
    }

    /// Every touch of all runs on a machine of which `wrong` says what is wrong (TOML of a scenario, without noise and
    /// clock). `own` is a file of effects that only the virtual machine knows.
    pub fn measure(&self, wrong: &str, own: &str, touch_um: f64, seed: u64) -> Vec<Vec<Touch>> {
        let first = self.plans[0].0.touches[0].time_s.unwrap();
        let visit_um = if touch_um > 0.0 { self.visit_um } else { 0.0 };
        let mut out = Vec::new();
        for (plan, begins) in &self.plans {
            let head = if own.is_empty() { "" } else { "effects_file = [\"own.toml\"]\n" };
            let text = format!(
                "seed = {seed}\n{head}{wrong}\n[noise]\ntouch_um = {touch_um:?}\nvisit_um = {visit_um:?}\n[time]\nstarted_s = {begins:?}\n\
                 first_touch_s = {first:?}\n[temperature]\nprofile = [[0.0, 20.0], [0.4, 21.3], [0.9, 20.8], [1.5, 22.4], [3.0, 23.0]]\n"
            );
            let open = |_: &str| Ok(source("own.toml", own.to_owned()));
            let scenario: Scenario =
                simulate::scenario::parse_with(&source("scenario", text), &self.machine, &open).unwrap().0;
            out.push(crate::common::touch(&self.machine, plan, &scenario, None));
        }
        out
    }
}

/// Location errors, block set-ups and pre-travel at random: what the searching half's base model holds.
pub fn base(bench: &Bench, rng: &mut ChaCha8Rng) -> String {
    let mut out = String::new();
    for (effect, names) in
        [("location-b", ["EX0B", "EZ0B", "EA0B", "EC0B"]), ("location-c", ["EX0C", "EY0C", "EA0C", "EB0C"])]
    {
        let _ = writeln!(out, "[effects.{effect}]");
        for name in names {
            let size = if ["EX", "EY", "EZ"].contains(&&name[..2]) { 0.03 } else { 0.003 };
            let _ = writeln!(out, "{name} = {:?}", rng.random_range(-size..size));
        }
    }
    let _ = writeln!(out, "[effects.pretravel]\npretravel = {:?}", rng.random_range(0.002..0.01));
    for (mounting, block) in stood(bench) {
        let mut three = |size: f64| -> Vec<f64> { (0..3).map(|_| rng.random_range(-size..size)).collect() };
        let _ = writeln!(
            out,
            "[[block]]\nmounting = \"{mounting}\"\nname = \"{block}\"\nshift = {:?}\ntilt = {:?}",
            three(0.1),
            three(0.057)
        );
    }
    out
}

/// The blocks of all runs: mounting and name.
fn stood(bench: &Bench) -> Vec<(String, String)> {
    let mut stood: Vec<(String, String)> = Vec::new();
    for (plan, _) in &bench.plans {
        for t in &plan.touches {
            let at = (t.mounting.clone().unwrap_or_else(|| plan.mounting.clone()), t.block.to_string());
            if !stood.contains(&at) {
                stood.push(at);
            }
        }
    }
    stood
}

/// Something hidden: which effect it is, and how it is written for the virtual machine at a size.
#[derive(Clone)]
pub struct Hidden {
    /// Id of the effect of the catalogue that it is, or belongs to.
    pub truth: String,
    /// Is its shape another than the catalogue's?
    pub other_shape: bool,
    /// Values of the catalogue's effect: name, value, unit; shapes do not scale.
    values: Vec<(String, f64, String, bool)>,
    /// Id of an effect of the catalogue that is mixed in: another harmonic of the same motion.
    pub admixture: Option<String>,
    /// Its values: name, value, unit.
    mixed: Vec<(String, f64, String)>,
    /// A file of own effects with one effect `planted` and its parameters.
    own: String,
    own_parameters: Vec<(String, f64)>,
}

impl Hidden {
    /// Scenario lines at `size` times the drawn direction.
    pub fn written(&self, size: f64) -> String {
        let mut out = String::new();
        if !self.values.is_empty() {
            let _ = writeln!(out, "[effects.{}]", self.truth);
            for (name, value, unit, is_shape) in &self.values {
                let value = if *is_shape { *value } else { size * value };
                let _ = writeln!(out, "{name} = {{ value = {value:?}, unit = \"{unit}\" }}");
            }
        }
        if !self.own_parameters.is_empty() {
            let _ = writeln!(out, "[effects.planted]");
            for (name, value) in &self.own_parameters {
                let _ = writeln!(out, "{name} = {:?}", size * value);
            }
        }
        if let Some(admixture) = self.admixture.as_ref().filter(|_| !self.mixed.is_empty()) {
            let _ = writeln!(out, "[effects.{admixture}]");
            for (name, value, unit) in &self.mixed {
                let _ = writeln!(out, "{name} = {{ value = {:?}, unit = \"{unit}\" }}", size * value);
            }
        }
        out
    }

    /// The catalogue's part of a mixture; `None` where it is none.
    pub fn without_admixture(&self) -> Option<Self> {
        (!self.mixed.is_empty()).then(|| Self { mixed: Vec::new(), ..self.clone() })
    }

    pub fn own(&self) -> &str {
        &self.own
    }
}

fn normal(rng: &mut ChaCha8Rng) -> f64 {
    StandardNormal.sample(rng)
}

/// Effects that may be hidden: those of the catalogue that are no part of the base model, no whole hypothesis and no set
/// of the paper.
pub fn ids(machine: &Machine) -> Vec<String> {
    let catalogue = Catalogue::built_in().unwrap();
    let base = ["location-b", "location-c", "block-setup", "pretravel", "sign-or-axis-swap"];
    // what differs from run to run cannot be written once for all runs: tests/discovery plants it
    let of_blocks = |e: &&Effect| e.of.is_empty() || e.of.contains(&Body::Box);
    let ids =
        catalogue.iter().filter(|e| e.applies_to(machine) && !e.paper && !e.per_run && !base.contains(&e.id.as_str()));
    ids.filter(of_blocks).map(|e| e.id.clone()).collect()
}

/// An effect in a random direction, in the catalogue's own shape (a scanned number anywhere in its usual range).
pub fn hidden(bench: &Bench, id: &str, rng: &mut ChaCha8Rng) -> Hidden {
    let catalogue = Catalogue::built_in().unwrap();
    let effect = catalogue.get(id, &bench.machine).unwrap();
    let mut values = Vec::new();
    let blocks: Vec<Option<(String, String)>> =
        if effect.per_block { stood(bench).into_iter().map(Some).collect() } else { vec![None] };
    for (block, p) in blocks.iter().flat_map(|b| effect.parameters.iter().map(move |p| (b, p))) {
        let (value, is_shape) = match id {
            _ if p.shape.is_none() => {
                let size = p.typical * normal(rng);
                // no machine has a negative lost motion or a head that rises by its weight
                (if p.positive { size.abs() } else { size }, false)
            }
            "block-slip" => (rng.random_range(0.15..0.85) * bench.hours(), true),
            _ if p.name.starts_with("pitch") => {
                (*[5.0, 8.0, 10.0, 12.0, 16.0].get(rng.random_range(0..5)).unwrap(), true)
            }
            _ if p.scan.is_empty() => (rng.random_range(0.5..1.5) * p.shape.map_or(1.0, |s| s.0), true),
            _ => (p.scan[rng.random_range(0..p.scan.len())], true),
        };
        let name =
            block.as_ref().map_or(p.name.clone(), |(mounting, block)| format!("\"{}@{mounting}/{block}\"", p.name));
        values.push((name, value, p.unit.clone(), is_shape));
    }
    Hidden {
        truth: id.to_owned(),
        other_shape: false,
        values,
        admixture: None,
        mixed: Vec::new(),
        own: String::new(),
        own_parameters: Vec::new(),
    }
}

/// Ids of which [`bent`] knows another shape.
pub fn bendable(machine: &Machine) -> Vec<String> {
    let families = [
        "radial-",
        "axial-",
        "tilt-",
        "positioning-b",
        "positioning-c",
        "warm-up",
        "spindle-growth",
        "pitch-",
        "head-sag",
        "drift-linear",
    ];
    ids(machine)
        .into_iter()
        .filter(|id| families.iter().any(|f| id.starts_with(f)) && !id.ends_with("-linear") || id == "drift-linear")
        .collect()
}

/// The same with a shape that is not exactly the catalogue's: a time constant between the scanned ones, another
/// exponent, or a quarter of another harmonic in it.
pub fn bent(bench: &Bench, id: &str, rng: &mut ChaCha8Rng) -> Hidden {
    let mut out = hidden(bench, id, rng);
    out.other_shape = true;
    let words: Vec<&str> = id.split('-').collect();
    match (words[0], words.get(2).and_then(|k| k.parse::<u32>().ok())) {
        ("warm" | "spindle", _) => {
            let tau = f64::exp(rng.random_range(f64::ln(0.13)..f64::ln(2.0)));
            let mut shapes = out.values.iter_mut().filter(|v| v.3).peekable();
            assert!(shapes.peek().is_some(), "{id} has no time constant to bend");
            shapes.for_each(|v| v.1 = tau);
        }
        ("pitch", _) => {
            let pitch = rng.random_range(5.0..18.0);
            let mut shapes = out.values.iter_mut().filter(|v| v.3).peekable();
            assert!(shapes.peek().is_some(), "{id} has no pitch to bend");
            shapes.for_each(|v| v.1 = pitch);
        }
        ("head", _) => {
            out.values.clear();
            out.own = "[[effect]]\nid = \"planted\"\nat = \"Z\"\nterms = [{ parameter = \"p\", unit = \"um\", dof = \"dz\", formula = \"0 - abs(sin(B))^1.5\" }]\n".into();
            out.own_parameters = vec![("p".into(), 5.0)];
        }
        ("drift", _) => {
            out.values.clear();
            out.own = "[[effect]]\nid = \"planted\"\nat = \"base\"\nterms = [\n{ parameter = \"qx\", unit = \"um\", dof = \"dx\", formula = \"t^1.3\" },\n\
                       { parameter = \"qy\", unit = \"um\", dof = \"dy\", formula = \"t^1.3\" },\n{ parameter = \"qz\", unit = \"um\", dof = \"dz\", formula = \"t^1.3\" }]\n"
                .into();
            out.own_parameters = ["qx", "qy", "qz"].map(|p| (p.to_owned(), 5.0 * normal(rng))).to_vec();
        }
        (family, Some(k)) => {
            let other = format!("{family}-{}-{}", words[1], if k == 1 { 2 } else { 1 });
            let catalogue = Catalogue::built_in().unwrap();
            let effect = catalogue.get(&other, &bench.machine).unwrap();
            let quarter = 0.25 * out.values[0].1.abs().max(1.0);
            out.mixed =
                effect.parameters.iter().map(|p| (p.name.clone(), quarter * normal(rng), p.unit.clone())).collect();
            out.admixture = Some(other);
        }
        _ => {}
    }
    out
}
