//! Machines with their plans, and what the log says of every touch on a machine with faults.

use super::forward::{Slip, Target, V, Wrong, carrier_direction, tool_direction, trigger, turned};
use axiscal::axes::{AxisName, Position};
use axiscal::log::{RawTouch, Status, Touch, match_to_plan};
use axiscal::machine::{Machine, Side};
use axiscal::program::plan::{Plan, PlanTouch};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

/// A machine with the runs of a measurement.
#[derive(Clone)]
pub struct Bench {
    pub name: String,
    pub machine: Machine,
    /// Plans, and when each run began, s.
    pub runs: Vec<(Plan, f64)>,
}

/// What a fault may depend on at a touch.
pub struct At<'a> {
    pub machine: &'a Machine,
    pub run: usize,
    /// Shown by the control where the plan has the touch: mm, rad; X Y Z A B C.
    pub q: [f64; 6],
    pub hours: f64,
    /// Of the whole measurement.
    pub hours_of_all: f64,
    /// Over 20 °C.
    pub kelvin: f64,
    /// Direction of the last motion of each axis; 0 unknown.
    pub direction: [f64; 6],
    /// How far each axis has turned since it last turned back, rad.
    pub since_reversal: [f64; 6],
    /// Where each rotary axis stood before it came to where it stands, rad; 0 before its first motion.
    pub pose_before: [f64; 6],
    /// Way of the ball in the frame of the probe, which turns with the spindle.
    pub approach: V,
    /// Unit vector from the ball to the spindle, in R.
    pub spindle: V,
    /// Down, in the frame of the head.
    pub down_in_head: V,
    pub feed_mm_min: f64,
    pub stylus_mm: f64,
    pub block: usize,
    pub centre: V,
    pub edges: V,
    /// Unit vector from the middle of the carrier to the block.
    pub outward: V,
}

/// A machine that is wrong.
pub type Act = dyn Fn(&At, &mut Wrong) + Send + Sync;

fn normal(rng: &mut ChaCha8Rng) -> f64 {
    StandardNormal.sample(rng)
}

/// Room temperature, °C: it rises, falls and rises, and waves.
fn celsius(hours: f64) -> f64 {
    20.4 + 0.9 * hours + 0.8 * (3.1 * hours).sin()
}

impl Bench {
    /// Each of the four built-in machines on the program that its makers would start with, in two runs, and on `full`.
    pub fn all(full: bool) -> Vec<Self> {
        ["swivel-head", "double-head", "trunnion", "swivel-table-b"].map(|m| Self::of(m, full)).to_vec()
    }

    pub fn of(name: &str, full: bool) -> Self {
        let machine = crate::common::machine(name);
        let programs: Vec<&str> = match (name, full) {
            (_, true) => vec!["full"],
            ("swivel-head", _) => vec!["head", "table"],
            ("double-head", _) => vec!["double-head"; 2],
            _ => vec!["basic"; 2],
        };
        let mut runs: Vec<(Plan, f64)> = Vec::new();
        for (i, program) in programs.iter().enumerate() {
            let mut plan = crate::common::plan(&machine, program);
            // the paper's programs touch every point once: twice shows the noise
            if name == "swivel-head" && !full {
                twice(&mut plan);
            }
            let end = runs.last().map_or(0.0, |(p, began)| began + p.touches.last().unwrap().time_s.unwrap());
            runs.push((plan, if i == 0 { 0.0 } else { end + 900.0 }));
        }
        Self { name: format!("{name} {}", if full { "full" } else { "paper" }), machine, runs }
    }

    /// The commonest machine with the commonest artefact, and the program of twenty minutes that is chosen for it.
    pub fn one_sphere() -> Vec<Self> {
        let (machine, auto) = crate::common::with_artefact("trunnion", "sphere", 20.0);
        let (made, _) =
            axiscal::program::generate(&machine, &auto.spec, &axiscal::program::Options::default()).unwrap();
        vec![Self { name: "trunnion sphere".to_owned(), machine, runs: vec![(made.plan, 0.0)] }]
    }

    pub fn hours(&self) -> f64 {
        let (plan, began) = self.runs.last().unwrap();
        (began + plan.touches.last().unwrap().time_s.unwrap()) / 3600.0
    }

    pub fn rotary(&self) -> Vec<AxisName> {
        self.machine.axes.iter().map(|a| a.name).filter(|a| a.is_rotary()).collect()
    }

    /// The model that a user begins with.
    pub fn base_model(&self) -> Vec<String> {
        let locations = self.rotary().into_iter().map(|a| format!("location-{}", a.letter().to_ascii_lowercase()));
        let spheres = self.runs[0].0.blocks.iter().all(|b| b.diameter.is_some());
        let stands = if spheres { "sphere-setup" } else { "block-setup" };
        locations.chain([stands.to_owned(), "pretravel".to_owned()]).collect()
    }

    /// The logs of all runs on a machine with `acts`, matched to the plans. `touch_um`, `visit_um`: scatter of a touch and of the ball
    /// from one index position to the next. `warm`: does the log have temperatures?
    pub fn measure(
        &self,
        acts: &[&Act],
        touch_um: f64,
        visit_um: f64,
        warm: bool,
        rng: &mut ChaCha8Rng,
    ) -> Vec<Vec<Touch>> {
        let raw = self.raw(acts, touch_um, visit_um, warm, rng);
        let plans = self.runs.iter().map(|(plan, _)| plan);
        plans.zip(raw).map(|(plan, raw)| match_to_plan(&self.machine, plan, raw).unwrap().0).collect()
    }

    /// The same as the control wrote them.
    pub fn raw(
        &self,
        acts: &[&Act],
        touch_um: f64,
        visit_um: f64,
        warm: bool,
        rng: &mut ChaCha8Rng,
    ) -> Vec<Vec<RawTouch>> {
        let mut out = Vec::new();
        let mut blocks: Vec<String> = Vec::new();
        for (run, (plan, began)) in self.runs.iter().enumerate() {
            let mut motion = Motion::default();
            let mut visit = None;
            let mut scatter = V::zeros();
            let mut rows = Vec::new();
            for (line, touch) in plan.touches.iter().enumerate() {
                let stands = format!("{}/{}", touch.mounting.as_deref().unwrap_or(&plan.mounting), touch.block);
                let label = format!("{run}/{stands}");
                let block = blocks.iter().position(|b| *b == label).unwrap_or_else(|| {
                    blocks.push(label);
                    blocks.len() - 1
                });
                let time_s = began + touch.time_s.unwrap();
                let (mut at, target) = self.at(plan, touch, run, block);
                at.hours = (time_s - self.runs[0].0.touches[0].time_s.unwrap()) / 3600.0;
                at.hours_of_all = self.hours();
                at.kelvin = celsius(at.hours) - 20.0;
                motion.next(touch, &mut at);
                let now = (touch.visit, AxisName::ALL.map(|a| touch.pose.get(a).unwrap_or(0.0).to_bits()));
                if visit != Some(now) {
                    visit = Some(now);
                    scatter = V::from_fn(|_, _| visit_um / 1000.0 * normal(rng));
                }
                let mut wrong = Wrong::default();
                acts.iter().for_each(|act| act(&at, &mut wrong));
                wrong.tool += scatter;
                wrong.late += touch_um / 1000.0 * normal(rng);
                let start = joints(&touch.start_position());
                let end = joints(&touch.end_position());
                let way = V::from_fn(|k, _| end[k] - start[k]).normalize();
                let shown = trigger(&self.machine, &start, way, &wrong, &target);
                let mut position = touch.start_position();
                (0..3).for_each(|k| position.0[k] = shown[k]);
                let mut present = [false; 6];
                self.machine.axes.iter().for_each(|a| present[a.name.index()] = true);
                rows.push(RawTouch {
                    id: Some(touch.id),
                    position,
                    present,
                    status: Status::Hit,
                    time_s: Some(time_s),
                    temperature_deg_c: warm.then(|| celsius(at.hours)),
                    line: line + 1,
                });
            }
            out.push(rows);
        }
        out
    }

    fn at<'a>(&'a self, plan: &Plan, touch: &PlanTouch, run: usize, block: usize) -> (At<'a>, Target) {
        let machine = &self.machine;
        let chain = super::forward::chain(machine, Side::Workpiece);
        let carried_by = match touch.carrier.as_str() {
            "table" => chain.iter().take_while(|a| !a.name.is_rotary()).count(),
            letter => chain.iter().position(|a| a.name.to_string() == letter).unwrap() + 1,
        };
        let planned = plan.block_of(touch).unwrap();
        let centre = V::from(planned.centre);
        let point = V::from(touch.point);
        let outward_normal = V::from(touch.normal);
        let mut q = joints(&touch.pose.position());
        let nominal = touch.nominal.position();
        (0..3).for_each(|k| q[k] = nominal.0[k]);
        let spindle_rad = touch.spindle_deg.unwrap_or(0.0).to_radians();
        let stylus_mm = touch.tool_length_mm.unwrap_or(plan.tool_length_mm);
        let in_r = carrier_direction(machine, &q, carried_by, outward_normal);
        // into the head's frame: its columns are the images of the unit vectors
        let head = nalgebra::Matrix3::from_columns(&[V::x(), V::y(), V::z()].map(|u| tool_direction(machine, &q, u)));
        let own = machine.tool.direction.into_inner();
        let approach = turned(own * -spindle_rad) * (head.transpose() * -in_r);
        let middle = chain[..carried_by].last().filter(|a| a.name.is_rotary());
        let (foot, along) = middle.map_or((V::zeros(), V::z()), |a| (a.point, a.direction.into_inner()));
        let arm = centre - foot;
        let across = arm - along * arm.dot(&along);
        let at = At {
            machine,
            run,
            q,
            hours: 0.0,
            hours_of_all: 0.0,
            kelvin: 0.0,
            direction: [0.0; 6],
            since_reversal: [0.0; 6],
            pose_before: [0.0; 6],
            approach,
            spindle: head * own,
            down_in_head: head.transpose() * -V::z(),
            feed_mm_min: touch.feed_mm_min.unwrap_or(machine.probe.slow_feed),
            stylus_mm,
            block,
            centre,
            edges: V::from(planned.size),
            outward: if across.norm() > 1e-9 { across.normalize() } else { V::zeros() },
        };
        let target = Target {
            carried_by,
            centre,
            point,
            normal: outward_normal,
            sphere_radius: planned.diameter.map(|d| d / 2.0),
            ball_radius: touch.ball_radius_mm.unwrap_or(plan.ball_radius_mm),
            stylus_mm,
            spindle_rad,
        };
        (at, target)
    }

    /// Location errors of the rotary axes, blocks that stand a little elsewhere, and a probe that triggers late: what the user's
    /// first model holds.
    pub fn ordinary(&self, rng: &mut ChaCha8Rng) -> Box<Act> {
        let mut location: [(V, V); 6] = [(V::zeros(), V::zeros()); 6];
        for slot in &mut location {
            *slot =
                (V::from_fn(|_, _| rng.random_range(-0.02..0.02)), V::from_fn(|_, _| rng.random_range(-4e-5..4e-5)));
        }
        let late = rng.random_range(0.002..0.01);
        let stands: Vec<(V, V)> = (0..64)
            .map(|_| (V::from_fn(|_, _| rng.random_range(-0.1..0.1)), V::from_fn(|_, _| rng.random_range(-1e-3..1e-3))))
            .collect();
        Box::new(move |at: &At, wrong: &mut Wrong| {
            wrong.late += late;
            let (shift, turn) = stands[at.block % stands.len()];
            wrong.block_shift += shift;
            wrong.block_turn += turn;
            for axis in at.machine.axes.iter().filter(|a| a.name.is_rotary()) {
                let i = axis.name.index();
                let along = axis.direction.into_inner();
                let across = |v: V| v - along * along.dot(&v);
                let (shift, turn) = (across(location[i].0), across(location[i].1));
                if axis.side == Side::Workpiece {
                    wrong.before[i].push(Slip { shift, turn, about: at.machine.reference.pivot });
                } else {
                    wrong.before[i].push(Slip::turn(turn, axis.point));
                    wrong.after[i].push(Slip::shift(shift));
                }
            }
        })
    }
}

/// mm and rad.
fn joints(position: &Position) -> [f64; 6] {
    let mut q = position.0;
    q[3..].iter_mut().for_each(|angle| *angle = angle.to_radians());
    q
}

fn twice(plan: &mut Plan) {
    let mut touches = Vec::new();
    for touch in &plan.touches {
        for repeat in 0..2u32 {
            let mut t = touch.clone();
            t.id = 2 * touch.id + u64::from(repeat);
            t.repeat = repeat + 1;
            t.time_s = touch.time_s.map(|s| 1.5 * s + 6.0 * f64::from(repeat));
            touches.push(t);
        }
    }
    plan.touches = touches;
}

/// How the axes came to where they are.
#[derive(Default)]
struct Motion {
    known: bool,
    last_start: [f64; 6],
    direction: [f64; 6],
    turned_back_at: [f64; 6],
    pose_before: [f64; 6],
}

impl Motion {
    fn next(&mut self, touch: &PlanTouch, at: &mut At) {
        let (start, end) = (joints(&touch.start_position()), joints(&touch.end_position()));
        for name in AxisName::ALL {
            let i = name.index();
            let wanted = touch.from.get(name).unwrap_or(0.0);
            let came = if self.known { start[i] - self.last_start[i] } else { 0.0 };
            if name.is_rotary() && came.abs() > 1e-9 {
                self.pose_before[i] = self.last_start[i];
            }
            let searched = end[i] - start[i];
            let moves = [searched, wanted, came];
            if let Some(motion) = moves.into_iter().find(|m| m.abs() > 1e-9) {
                self.direction[i] = motion.signum();
            }
            if !self.known {
                self.turned_back_at[i] = start[i];
            }
            if came * (self.last_start[i] - self.turned_back_at[i]) < 0.0 && came.abs() > 1e-9 {
                self.turned_back_at[i] = self.last_start[i];
            }
            // programs go 5 degrees past a pose to come to it from the other side
            if wanted * (start[i] - self.turned_back_at[i]) <= 0.0 && wanted != 0.0 {
                self.turned_back_at[i] = start[i] - wanted.signum() * 5f64.to_radians();
            }
            at.since_reversal[i] = start[i] - self.turned_back_at[i];
        }
        (at.direction, at.pose_before) = (self.direction, self.pose_before);
        (self.known, self.last_start) = (true, start);
    }
}
