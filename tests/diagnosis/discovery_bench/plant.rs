//! The simulating half of the discovery runs: what is wrong with the virtual machine. Nothing here is seen by the half
//! that searches; only touches go over.

use axiscal::diag::source;
use axiscal::log::Touch;
use axiscal::machine::Machine;
use axiscal::program::plan::Plan;
use axiscal::simulate::{self, Scenario};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
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
