//! Identifications of any size, touched by the virtual machine: what the benchmarks solve.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)] // a benchmark that cannot run says where
#![allow(dead_code)] // each benchmark uses a part of it

use axiscal::axes::{AxisMap, AxisName};
use axiscal::diag::source;
use axiscal::fit::normal::Touches;
use axiscal::fit::solve::{self, Problem as _, Solution};
use axiscal::fit::{self, Settings};
use axiscal::log::{RawTouch, Status, Touch};
use axiscal::machine::{self, Form, Machine};
use axiscal::model::catalogue::Catalogue;
use axiscal::model::data::{Data, Run, assemble};
use axiscal::model::predict::Model;
use axiscal::program::plan::{ControllerFrame, FORMAT, Plan, PlanBlock, PlanTouch};
use axiscal::simulate::{self, Scenario};
use nalgebra::{DVector, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Standard deviation of a touch, mm: planted where touches are noisy, and what every fit is told.
pub const SIGMA_MM: f64 = 1e-3;

/// Name of the mounting that holds all blocks.
pub const MOUNTING: &str = "bench";

/// Touches of a plan and the model that is fitted to them.
pub struct Problem {
    pub machine: Machine,
    pub catalogue: Catalogue,
    pub plan: Plan,
    pub touches: Vec<Touch>,
    pub effects: Vec<String>,
}

/// Number of blocks and of unknowns beside their set-up: 15 = 9 + 6, 60 = 12 + 48, 120 = 12 + 108.
pub fn parts(n_unknowns: usize) -> (usize, usize) {
    let others = if n_unknowns < 60 { 9 } else { 12 };
    assert_eq!((n_unknowns - others) % 6, 0, "six unknowns per block");
    ((n_unknowns - others) / 6, others)
}

impl Problem {
    /// `n_touches` touches of as many blocks as `n_unknowns` needs, on a machine with errors; `noise_mm` is 1 sigma.
    pub fn new(n_touches: usize, n_unknowns: usize, noise_mm: f64) -> Self {
        let (n_blocks, others) = parts(n_unknowns);
        let machine = swivel_head();
        let mut rng = ChaCha8Rng::seed_from_u64(7);
        let blocks: Vec<PlanBlock> = (0..n_blocks).map(|i| block(i, &mut rng)).collect();
        let plan = plan(&machine, blocks, n_touches, &mut rng);
        let mut spread = |size: f64| rng.random_range(-size..size);
        let mut scenario = Scenario::flawless().with_noise(noise_mm, 0.0, 11);
        let mut plant = |effect: &str, values: &[(&str, f64)]| {
            scenario = std::mem::take(&mut scenario).with(&machine, effect, values).unwrap();
        };
        plant("location-b", &[("EX0B", 0.031), ("EZ0B", -0.022), ("EA0B", 0.004), ("EC0B", -0.003)]);
        plant("location-c", &[("EX0C", 0.012), ("EY0C", -0.027), ("EA0C", 0.002), ("EB0C", 0.005)]);
        plant("pretravel", &[("pretravel", 0.006)]);
        let mut effects = vec!["location-b", "location-c", "pretravel"];
        if others > 9 {
            plant("scale-x", &[("EXX", 14.0)]);
            plant("scale-y", &[("EYY", -11.0)]);
            plant("squareness-xy", &[("EC0Y", 25.0)]);
            effects.extend(["scale-x", "scale-y", "squareness-xy"]);
        }
        effects.push("block-setup");
        for b in &plan.blocks {
            let shift = [spread(0.3), spread(0.3), spread(0.3)];
            let tilt = [spread(2e-3), spread(2e-3), spread(2e-3)];
            scenario = scenario.with_block(MOUNTING, &b.name, shift, tilt);
        }
        let (raw, _) = simulate::run(&machine, &plan, &scenario, None).unwrap();
        let touches = raw.iter().map(matched).collect();
        let effects = effects.into_iter().map(str::to_owned).collect();
        Self { machine, catalogue: Catalogue::built_in().unwrap(), plan, touches, effects }
    }

    /// The touches as the fit takes them.
    pub fn data(&self) -> Data {
        assemble(&self.machine, &[Run { plan: &self.plan, touches: &self.touches, mounting: None, started_s: None }])
    }

    /// The model in the machine's chain.
    pub fn model(&self, data: &Data) -> Model {
        let effects = fit::effects_of(&self.effects, &self.catalogue, &self.machine).unwrap();
        Model::new(&self.machine, &effects, &data.set_ups, self.machine.reference.pivot)
    }

    /// What `identify` is asked for.
    pub fn settings(&self) -> Settings {
        Settings {
            effects: self.effects.clone(),
            touch_sigma_mm: Some(SIGMA_MM),
            visit_sigma_mm: Some(0.0),
            ..Settings::default()
        }
    }
}

/// Rank, fit and covariance, as `identify` does them (the rank on the nominal touches where the sums at the start leave a doubt
/// of it), without what it does around them: the work that the peers do. White noise of [`SIGMA_MM`].
pub fn solve(model: &Model, data: &Data) -> Solution {
    let solution = try_solve(model, data).expect("every unknown is seen");
    assert!(solution.converged, "{}", solution.stopped);
    solution
}

/// The same; `None` where the touches do not show every unknown.
pub fn try_solve(model: &Model, data: &Data) -> Option<Solution> {
    let free: Vec<usize> = (0..model.n_unknowns()).collect();
    let start = DVector::from_vec(model.start());
    let noise = (SIGMA_MM, 0.0);
    let batch = model.prepare(&data.observations);
    let touches = Touches::new(&batch, &data.visits, model.start(), &free, &[], noise);
    let first = touches.normal(&start, true);
    let seen = solve::observe_clearly(&first.gram).or_else(|| {
        let nominal = model.prepare(&data.nominal);
        let touches = Touches::new(&nominal, &data.visits, model.start(), &free, &[], noise);
        solve::observe_gram(&touches.normal(&start, true).gram)
    })?;
    Some(solve::minimise_from(&touches, start, &seen, Some(first)))
}

/// The machine of all benchmarks.
pub fn swivel_head() -> Machine {
    let (machines, _) = machine::load(&source("machines.toml", machine::BUILT_IN)).unwrap();
    machines.into_iter().find(|m| m.name == "swivel-head").unwrap()
}

/// A touch that hit, with its number.
pub fn matched(raw: &RawTouch) -> Touch {
    assert_eq!(raw.status, Status::Hit, "touch {:?} missed", raw.id);
    let RawTouch { position, status, time_s, temperature_deg_c, line, .. } = *raw;
    Touch { id: raw.id.unwrap(), position, status, time_s, digit_mm: None, temperature_deg_c, line }
}

/// Blocks on the turntable and on the linear axes' table by turns.
fn block(i: usize, rng: &mut ChaCha8Rng) -> PlanBlock {
    let mut spread = |size: f64| rng.random_range(-size..size);
    PlanBlock {
        name: format!("b{i}"),
        carrier: if i.is_multiple_of(2) { "C" } else { "table" }.into(),
        mounting: None,
        centre: [spread(120.0), spread(120.0), -202.684 + spread(30.0)],
        form: Form::Box,
        size: [10.0; 3],
        diameter: None,
    }
}

/// Every pose of seven angles of B and eight of C is visited once; at each all blocks take their turn, at random points of
/// random faces.
fn plan(machine: &Machine, blocks: Vec<PlanBlock>, n_touches: usize, rng: &mut ChaCha8Rng) -> Plan {
    const N_B: usize = 7;
    const N_C: usize = 8;
    let length_mm = machine.tool.length_mm;
    let mut touches = Vec::with_capacity(n_touches);
    for i in 0..n_touches {
        let visit = i * N_B * N_C / n_touches;
        let pose = AxisMap::default()
            .with(AxisName::B, -90.0 + 30.0 * (visit / N_C) as f64)
            .with(AxisName::C, 45.0 * (visit % N_C) as f64);
        let block = &blocks[i % blocks.len()];
        let carrier = machine.carrier(&block.carrier).unwrap();
        let side = rng.random_range(0..3);
        let mut normal = Vector3::zeros();
        normal[side] = if rng.random_bool(0.5) { 1.0 } else { -1.0 };
        let mut point = Vector3::from(block.centre) + normal * (0.5 * block.size[side]);
        for k in (0..3).filter(|&k| k != side) {
            point[k] += rng.random_range(-3.0..3.0);
        }
        let at = |off_mm: f64| {
            let ball = point + normal * (machine.probe.ball_radius + off_mm);
            let p = machine.linear_for_ball(carrier, &pose.position(), &ball, length_mm).unwrap();
            AxisMap::xyz(p.0[0], p.0[1], p.0[2])
        };
        touches.push(PlanTouch {
            id: i as u64 + 1,
            stage: MOUNTING.into(),
            repeat: 1,
            carrier: block.carrier.clone(),
            mounting: None,
            block: block.name.clone(),
            face: format!("{}{}", if normal[side] > 0.0 { '+' } else { '-' }, ['X', 'Y', 'Z'][side]),
            point: point.into(),
            normal: normal.into(),
            pose,
            start: at(2.0),
            nominal: at(0.0),
            end: at(-2.0),
            time_s: Some(12.0 * i as f64),
            visit: Some(u32::try_from(visit).unwrap()),
            feed_mm_min: None,
            spindle_deg: None,
            tool_length_mm: None,
            ball_radius_mm: None,
            from: AxisMap::default(),
            first: false,
        });
    }
    Plan {
        format: FORMAT.into(),
        machine: machine.name.clone(),
        machine_sha256: String::new(),
        program: MOUNTING.into(),
        programs: Default::default(),
        mounting: MOUNTING.into(),
        controller_frame: ControllerFrame::Axes,
        ball_radius_mm: machine.probe.ball_radius,
        tool_length_mm: length_mm,
        placement_tolerance_mm: None,
        find: None,
        blocks_anew: false,
        blocks,
        touches,
        skipped: Vec::new(),
        notes: Vec::new(),
    }
}
