//! From plans and touches to observations: what the model needs to know of each touch, and which touches it cannot use.

use super::formula::{State, VARIABLES, slot};
use super::predict::{Observation, SetUp};
use super::spindle::{self, SpindleStretch};
use super::surface::{self, Body, Surface};
use super::temperatures::TemperatureGap;
use crate::axes::{AxisMap, AxisName, Position};
use crate::log::{Status, Supposed, Touch, suppose};
use crate::machine::{Carrier, Machine};
use crate::program::plan::{Numbered, Plan, PlanBlock, PlanTouch};
use crate::units::{hours_from_s, rad_from_deg, s_from_h};
use nalgebra::{UnitQuaternion, Vector3};

/// One measurement run.
#[derive(Debug, Clone)]
pub struct Run<'a> {
    /// What was to be touched.
    pub plan: &'a Plan,
    /// What was touched, matched to the plan.
    pub touches: &'a [Touch],
    /// Blocks of equal mounting, carrier and name share one set-up; each run has its own where this is `None`.
    pub mounting: Option<&'a str>,
    /// When the run began, s on the study's clock; runs without it follow one another.
    pub started_s: Option<f64>,
}

/// A touch that the model cannot use.
#[derive(Debug, Clone, PartialEq)]
pub struct Unusable {
    /// Which run, from 0.
    pub run: usize,
    /// Number in the plan.
    pub id: u64,
    /// Line in the log.
    pub line: usize,
    /// Why.
    pub reason: UnusableReason,
}

/// Why the model cannot use a touch.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum UnusableReason {
    /// The plan has no touch of this number.
    NotInPlan,
    /// The probe did not trigger.
    NoTrigger,
    /// The position is farther from the planned one than the probe can go.
    FarFromPlan,
    /// A position is infinite or not a number.
    NotANumber,
    /// The plan has no such block on that carrier.
    NoSuchBlock {
        /// `table` or the letter of a rotary axis.
        carrier: String,
        /// Name of the block.
        block: String,
    },
}

/// Where a touch comes from, in the words of its plan and log.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Origin {
    /// Line in the log, from 1.
    pub line: usize,
    /// Stage of the program.
    pub stage: String,
    /// The block as it stood: label of its set-up.
    pub block: String,
    /// The block's own face at all axes 0.
    pub face: String,
}

/// All runs, ready for the model.
#[derive(Debug, Clone, Default)]
pub struct Data {
    /// The touches that can be used.
    pub observations: Vec<Observation>,
    /// Their nominal counterparts: the same touches as an errorless machine makes them (for rank statements).
    pub nominal: Vec<Observation>,
    /// The touches that cannot.
    pub unusable: Vec<Unusable>,
    /// The blocks as they stood.
    pub set_ups: Vec<SetUp>,
    /// For each observation: where it comes from.
    pub origins: Vec<Origin>,
    /// For each observation: touches of one point made right after each other share a number.
    pub repeats: Vec<usize>,
    /// For each observation: its index visit, counted through all runs; touches of a visit follow one another.
    pub visits: Vec<usize>,
    /// For each visit: visits of equal poses share a number. The rotary axes were moved there in the same sense and the same
    /// blocks stand there: between touches of one point with one stylus and one orientation of the spindle, only scatter and
    /// time part such visits.
    pub poses: Vec<usize>,
    /// Where touches of a run are far from their places: the one simple mistake that would explain it. What is left of such
    /// a run is no sample of the machine, however many touches it has.
    pub supposed: Option<Supposed>,
    /// Touches without a temperature while others have one.
    pub temperature_gap: Option<TemperatureGap>,
    /// For each run: the last digit of its log, mm, where all its lengths are multiples of one.
    pub digits_mm: Vec<Option<f64>>,
}

/// More touches than this share may not be missing.
const MOST_MISSED: f64 = 0.2;

impl Data {
    /// Touches that were made, usable or not.
    #[must_use]
    pub fn made(&self) -> usize {
        self.observations.len() + self.unusable.len()
    }

    /// Is what can be used no sample of the machine: are too many touches missing, or just those that a simple mistake puts
    /// elsewhere?
    #[must_use]
    pub fn mostly_missed(&self) -> bool {
        self.supposed.is_some() || self.unusable.len() as f64 > MOST_MISSED * self.made() as f64
    }
}

/// Assembles runs. Positions mm and deg in R, lengths mm.
#[must_use]
pub fn assemble(machine: &Machine, runs: &[Run]) -> Data {
    assemble_with_spindle(machine, runs, &[])
}

/// The same where it is known when the spindle ran.
#[must_use]
pub fn assemble_with_spindle(machine: &Machine, runs: &[Run], spindle: &[SpindleStretch]) -> Data {
    let mut data = Data::default();
    // they are large: each goes straight to where it stays
    let n_touches = runs.iter().map(|r| r.touches.len()).sum();
    data.observations.reserve(n_touches);
    data.nominal.reserve(n_touches);
    let mut clock_s = 0.0;
    let mut first_touch_s: Option<f64> = None;
    let mut earliest_h = 0.0;
    let mut visits = Visits::default();
    let (temperatures, temperature_gap) = super::temperatures::of_runs(runs);
    data.temperature_gap = temperature_gap;
    for (index, run) in runs.iter().enumerate() {
        let label = run_label(runs, index);
        let numbered = run.plan.numbered();
        let started = run.started_s.unwrap_or(clock_s);
        let mut previous: Option<&PlanTouch> = None;
        let mut last_sense = [0.0; 6];
        let mut before = Before::default();
        let mut way = WaySinceReversal::default();
        let (mut turned, mut ideal_turned, mut places) = (Last::default(), Last::default(), Last::default());
        visits.last = None;
        let logged = run.touches.iter().filter(|t| t.position.0.iter().all(|v| v.is_finite()));
        let of_log = run.touches.iter().find_map(|t| t.digit_mm);
        data.digits_mm.push(of_log.or_else(|| crate::log::digit_mm(logged.map(|t| t.position))));
        data.supposed = data.supposed.take().or_else(|| elsewhere(machine, run, &numbered));
        for (touch, &temperature_deg_c) in run.touches.iter().zip(&temperatures[index]) {
            let Some(planned) = numbered.touch(touch.id) else {
                data.unusable.push(Unusable {
                    run: index,
                    id: touch.id,
                    line: touch.line,
                    reason: UnusableReason::NotInPlan,
                });
                continue;
            };
            let time_s = touch.time_s.unwrap_or_else(|| started + planned.time_s.unwrap_or(0.0));
            clock_s = f64::max(clock_s, time_s);
            let t = hours_from_s(time_s - *first_touch_s.get_or_insert(time_s));
            earliest_h = f64::min(earliest_h, t);
            let touched = run.plan.block_of(planned).is_none_or(|b| !b.form.is_centre());
            senses(&mut last_sense, planned, previous, touched);
            before.next(planned);
            way.next(planned);
            previous = Some(planned);
            let reason = match touch.status {
                Status::Miss => Some(UnusableReason::NoTrigger),
                Status::Elsewhere => Some(UnusableReason::FarFromPlan),
                Status::Hit if touch.position.0.iter().any(|v| !v.is_finite()) => Some(UnusableReason::NotANumber),
                Status::Hit => None,
            };
            if let Some(reason) = reason {
                data.unusable.push(Unusable { run: index, id: touch.id, line: touch.line, reason });
                continue;
            }
            let (Some(carrier), Some(block)) = (machine.carrier(&planned.carrier), run.plan.block_of(planned)) else {
                let reason = UnusableReason::NoSuchBlock {
                    carrier: planned.carrier.to_string(),
                    block: planned.block.to_string(),
                };
                data.unusable.push(Unusable { run: index, id: touch.id, line: touch.line, reason });
                continue;
            };
            let mounting = planned.mounting.as_deref().unwrap_or(&run.plan.mounting);
            let set_up_label = match (&label, mounting) {
                // a program with several mountings keeps them apart under the study's name too
                (Some(label), _) if planned.mounting.is_some() => format!("{label}/{mounting}/{}", planned.block),
                (Some(label), _) => format!("{label}/{}", planned.block),
                (None, "") => planned.block.to_string(),
                (None, mounting) => format!("{mounting}/{}", planned.block),
            };
            let seen = data.set_ups.len();
            let set_up = data.set_ups.iter().position(|s| s.label == set_up_label).unwrap_or_else(|| {
                let (centre, runs) = (block.centre.into(), Vec::new());
                data.set_ups.push(SetUp { label: set_up_label, carrier, body: Body::default(), centre, runs });
                data.set_ups.len() - 1
            });
            if data.set_ups[set_up].runs.last() != Some(&index) {
                data.set_ups[set_up].runs.push(index);
            }
            let surface = Surface::of(block, planned);
            let already = (set_up < seen).then(|| data.set_ups[set_up].body);
            data.set_ups[set_up].body = Body::of(block.form, &surface, already);
            let point: Vector3<f64> = planned.point.into();
            let normal = Vector3::from(planned.normal).normalize();
            let length_mm = planned.tool_length_mm.unwrap_or(run.plan.tool_length_mm);
            let ball_radius = planned.ball_radius_mm.unwrap_or(run.plan.ball_radius_mm);
            let ball = point + normal * ball_radius;
            let pose = planned.pose.position();
            let places = places
                .of((carrier, angles(&pose), length_mm.to_bits()), || machine.ball_places(carrier, &pose, length_mm));
            let ideal = places.map_or(touch.position, |places| pose.with_xyz_mm(places.linear_for(&ball)));
            // the rotary axes stand where the control says they stand; a log without them means the plan's pose
            let at = |position: Position, turned: &mut Last<_, _>| Observation {
                run: index,
                id: touch.id,
                set_up,
                point,
                normal,
                surface,
                ball_radius,
                ball_at_zero: machine.tool.ball_at_zero(length_mm),
                position,
                has_temperature: temperature_deg_c.is_some(),
                state: Circumstances {
                    turned: turned.of((carrier, angles(&position)), || Turned {
                        tool: machine.tool_frame(&position).rotation,
                        carrier: machine.carrier_frame(carrier, &position).rotation,
                    }),
                    machine,
                    carrier,
                    block,
                    planned,
                    at: &position,
                    hours: t,
                    temperature_deg_c,
                    senses: &last_sense,
                    before: &before.earlier,
                    way: &way.way,
                    length_mm,
                }
                .state(),
            };
            let observation = at(touch.position, &mut turned);
            data.origins.push(Origin {
                line: touch.line,
                stage: planned.stage.to_string(),
                block: data.set_ups[set_up].label.clone(),
                face: planned.face.to_string(),
            });
            // what formulas see is nominal too: noise in a coordinate would make a null direction look seen
            data.nominal.push(at(ideal, &mut ideal_turned));
            data.repeats.push(repeat_group(&data, &numbered, planned, index));
            let visit = visits.number_of(&mut data, index, planned, mounting_key(&label, mounting));
            data.visits.push(visit);
            data.observations.push(observation);
        }
    }
    if earliest_h < 0.0 {
        // the runs are not listed in the order in which they were made: hours count from the first touch all the same
        data.observations.iter_mut().chain(&mut data.nominal).for_each(|o| o.state[slot::HOURS] -= earliest_h);
    }
    let first_s = first_touch_s.unwrap_or(0.0) + s_from_h(earliest_h);
    for o in data.observations.iter_mut().chain(&mut data.nominal) {
        spindle::put_into(&mut o.state, spindle, first_s);
    }
    data
}

/// What would put the touches of a run that are far from their places where they belong.
fn elsewhere(machine: &Machine, run: &Run, numbered: &Numbered<'_>) -> Option<Supposed> {
    if !run.touches.iter().any(|t| t.status == Status::Elsewhere) {
        return None;
    }
    let planned = |t: &Touch| Some((numbered.touch(t.id)?, t.position, [true; 6]));
    suppose(machine, &run.touches.iter().filter_map(planned).collect::<Vec<_>>())
}

/// What the touches of one index visit have in common.
#[derive(Debug, Clone, PartialEq)]
struct Indexed {
    mounting: String,
    pose: AxisMap,
    from: AxisMap,
}

/// The visits so far.
#[derive(Debug, Default)]
struct Visits {
    last: Option<(usize, Option<u32>, Indexed)>,
    poses: Vec<Indexed>,
    count: usize,
}

impl Visits {
    /// The visit that a touch belongs to: a new one where the run, the plan's visit number or the pose changes. The axes stand
    /// where they stood while the spindle turns or the stylus is changed: their scatter is drawn once for all of it.
    fn number_of(&mut self, data: &mut Data, run: usize, touch: &PlanTouch, mounting: String) -> usize {
        let at = Indexed { mounting, pose: touch.pose, from: touch.from };
        let now = (run, touch.visit, at);
        if self.last.as_ref() != Some(&now) {
            let pose = self.poses.iter().position(|p| *p == now.2).unwrap_or_else(|| {
                self.poses.push(now.2.clone());
                self.poses.len() - 1
            });
            data.poses.push(pose);
            self.count += 1;
            self.last = Some(now);
        }
        self.count - 1
    }
}

/// Blocks of equal key share their set-up.
fn mounting_key(label: &Option<String>, mounting: &str) -> String {
    label.clone().unwrap_or_else(|| mounting.to_owned())
}

/// `None` when the plans' own mounting names tell the runs apart.
fn run_label(runs: &[Run], index: usize) -> Option<String> {
    if let Some(mounting) = runs[index].mounting {
        return Some(mounting.to_owned());
    }
    let name = &runs[index].plan.mounting;
    let n_equal = runs.iter().filter(|r| r.mounting.is_none() && &r.plan.mounting == name).count();
    (n_equal > 1).then(|| format!("{name}#{}", index + 1))
}

/// +1 or -1: sense of each axis's last motion; of the touching move for an axis that moves in it. A centre is the mean of touches
/// from many sides: 0 for the linear axes.
fn senses(last: &mut [f64; 6], touch: &PlanTouch, previous: Option<&PlanTouch>, touched: bool) {
    for name in AxisName::ALL {
        let i = name.index();
        if !touched && !name.is_rotary() {
            last[i] = 0.0;
            continue;
        }
        let in_touch = touch.end_position().get(name) - touch.start_position().get(name);
        if in_touch.abs() > 1e-9 {
            last[i] = in_touch.signum();
        } else if let Some(from) = touch.from.get(name) {
            last[i] = from.signum();
        } else if let Some(previous) = previous {
            let moved = touch.start_position().get(name) - previous.start_position().get(name);
            if moved.abs() > 1e-9 {
                last[i] = moved.signum();
            }
        }
    }
}

/// Where each rotary axis stood before it came to its pose, in one run.
#[derive(Debug, Default)]
struct Before {
    now: [Option<f64>; 3],
    /// rad; 0 until the axis has moved.
    earlier: [f64; 3],
}

impl Before {
    fn next(&mut self, touch: &PlanTouch) {
        let pose = touch.pose.position();
        for (i, name) in [AxisName::A, AxisName::B, AxisName::C].into_iter().enumerate() {
            let at = rad_from_deg(pose.get(name));
            if let Some(last) = self.now[i].filter(|last| (at - last).abs() > 1e-6) {
                self.earlier[i] = last;
            }
            self.now[i] = Some(at);
        }
    }
}

/// So far a program goes past a pose to come to it in a direction that its `from` asks for: what plans do not say, deg.
const PAST_THE_POSE_DEG: f64 = 5.0;

/// How far each rotary axis has gone since it last changed its direction, in one run.
#[derive(Debug, Default)]
struct WaySinceReversal {
    now: [Option<f64>; 3],
    /// rad, with the sign of the motion; 0 until the axis has moved.
    way: [f64; 3],
}

impl WaySinceReversal {
    fn next(&mut self, touch: &PlanTouch) {
        let pose = touch.pose.position();
        for (i, name) in [AxisName::A, AxisName::B, AxisName::C].into_iter().enumerate() {
            let at = rad_from_deg(pose.get(name));
            let moved = self.now[i].map_or(0.0, |last| at - last);
            let moved = if moved.abs() > 1e-9 { moved } else { 0.0 };
            let goes_on = moved * self.way[i] >= 0.0;
            let natural = if goes_on { self.way[i] + moved } else { moved };
            let wanted = touch.from.get(name).unwrap_or(0.0);
            // it came from the other side: past the pose, and back to it
            let came_back = wanted != 0.0 && wanted * natural <= 0.0;
            self.way[i] = if came_back { wanted.signum() * rad_from_deg(PAST_THE_POSE_DEG) } else { natural };
            self.now[i] = Some(at);
        }
    }
}

/// How tool and carrier are turned in a pose.
#[derive(Debug, Clone, Copy)]
struct Turned {
    tool: UnitQuaternion<f64>,
    carrier: UnitQuaternion<f64>,
}

/// What was made of the last pose: touches of a pose follow one another.
#[derive(Debug)]
struct Last<K, V>(Option<(K, V)>);

impl<K, V> Default for Last<K, V> {
    fn default() -> Self {
        Self(None)
    }
}

impl<K: PartialEq, V: Copy> Last<K, V> {
    fn of(&mut self, key: K, make: impl FnOnce() -> V) -> V {
        match &self.0 {
            Some((known, value)) if *known == key => *value,
            _ => {
                let value = make();
                self.0 = Some((key, value));
                value
            }
        }
    }
}

/// The rotary axes' angles, to the bit.
fn angles(at: &Position) -> [u64; 3] {
    [3, 4, 5].map(|i| at.0[i].to_bits())
}

/// What the state of a touch is made of.
struct Circumstances<'a> {
    turned: Turned,
    machine: &'a Machine,
    carrier: Carrier,
    block: &'a PlanBlock,
    planned: &'a PlanTouch,
    /// Where the axes stood, mm and deg.
    at: &'a Position,
    hours: f64,
    temperature_deg_c: Option<f64>,
    senses: &'a [f64; 6],
    /// Where the rotary axes stood before, rad.
    before: &'a [f64; 3],
    /// How far the rotary axes have gone since their last reversal, rad.
    way: &'a [f64; 3],
    /// Pivot to ball, mm.
    length_mm: f64,
}

impl Circumstances<'_> {
    fn state(&self) -> State {
        let c = self;
        let mut state = [0.0; VARIABLES.len()];
        for name in AxisName::ALL {
            state[slot::AXES + name.index()] = c.at.mm_or_rad(name);
        }
        state[slot::SENSES..slot::SENSES + 6].copy_from_slice(c.senses);
        state[slot::BEFORE..slot::BEFORE + 3].copy_from_slice(c.before);
        state[slot::WAY..slot::WAY + 3].copy_from_slice(c.way);
        state[slot::HOURS] = c.hours;
        state[slot::TEMPERATURE] = c.temperature_deg_c.unwrap_or(20.0);
        state[slot::FEED] = c.planned.feed_mm_min.unwrap_or(c.machine.probe.slow_feed);
        let spindle = rad_from_deg(c.planned.spindle_deg.unwrap_or(0.0));
        state[slot::SPINDLE] = spindle;
        state[slot::LENGTHS] = c.length_mm;
        state[slot::LENGTHS + 1] = c.machine.tool.length_mm;
        let mut put = |from: usize, v: Vector3<f64>| state[from..from + 3].copy_from_slice(v.as_slice());
        // what rounding leaves of a zero has a sign, and no formula may jump by it: `atan2(my, mx)` where the probe points along a face
        const ROUNDING: f64 = 1e-12;
        let plain = |v: Vector3<f64>| v.map(|x| if x.abs() <= ROUNDING { 0.0 } else { x });
        let normal = Vector3::from(c.planned.normal).normalize();
        let into_tool = c.turned.tool.inverse();
        let in_r = c.turned.carrier * normal;
        let into_probe = nalgebra::Rotation3::from_axis_angle(&c.machine.tool.direction, -spindle);
        put(slot::NORMAL_IN_R, plain(in_r));
        put(slot::NORMAL_IN_PROBE, plain(into_probe * (into_tool * in_r)));
        put(slot::GRAVITY, plain(into_tool * -Vector3::z()));
        put(slot::GRAVITY_AT_BLOCK, plain(c.turned.carrier.inverse() * -Vector3::z()));
        put(slot::NORMAL_OF_BLOCK, normal);
        put(slot::POINT, c.planned.point.into());
        put(slot::OUTWARD, plain(outward(c.machine, c.carrier, &c.block.centre.into())));
        state[slot::EDGE] = surface::edge(c.block, &Surface::of(c.block, c.planned), &normal);
        state
    }
}

/// Unit vector from a carrier's centre line (its rotary axis, else the z axis of R) to a place in its frame; 0 on it.
fn outward(machine: &Machine, carrier: Carrier, place: &Vector3<f64>) -> Vector3<f64> {
    let turning = machine.carrier_chain(carrier).last().copied().filter(|a| a.name.is_rotary());
    let (foot, along) =
        turning.map_or((Vector3::zeros(), Vector3::z()), |axis| (axis.point, axis.direction.into_inner()));
    let arm = place - foot;
    let across = arm - along * arm.dot(&along);
    across.try_normalize(1e-9).unwrap_or_default()
}

/// A new number unless the touch before was made at the same point of the same set-up.
fn repeat_group(data: &Data, numbered: &Numbered<'_>, touch: &PlanTouch, run: usize) -> usize {
    let Some(last) = data.observations.last() else { return 0 };
    let group = data.repeats.last().copied().unwrap_or(0);
    let same = last.run == run
        && numbered.touch(last.id).is_some_and(|p| {
            p.block == touch.block
                && p.pose == touch.pose
                && p.point == touch.point
                && p.normal == touch.normal
                && p.visit == touch.visit
                && p.spindle_deg == touch.spindle_deg
                && p.feed_mm_min == touch.feed_mm_min
        });
    if same { group } else { group + 1 }
}
