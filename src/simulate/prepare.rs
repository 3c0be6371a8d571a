//! From plan and scenario to touches that can be made, each with everything it depends on.

use super::chain::{Chain, Stylus};
use super::control::Compensation;
use super::noise::Dice;
use super::rigid::{Vec3, minus, unit};
use super::scenario::{BlockError, RADIUS, Scenario};
use super::terms::{Shifts, Terms, TouchState};
use crate::axes::{AxisName, Position};
use crate::diag::{Failure, Finding, Findings, Result};
use crate::machine::{Carrier, Form, Machine};
use crate::program::plan::{ControllerFrame, Plan, PlanBlock, PlanTouch};
use crate::units::{hours_from_s, rad_from_deg};
use std::collections::BTreeMap;

/// What one touch takes when the plan does not say, s.
const TOUCH_S: f64 = 12.0;

/// No axis stands as far as this, mm or deg: guards against numbers that would not leave any digits for the contact.
const FAR: f64 = 1e6;

/// An axis that goes less far than this (mm or deg) stands still: the rest is rounding of the plan's numbers.
const STILL: f64 = 1e-9;

/// The virtual machine with a program in it.
pub struct Bench<'a> {
    pub chain: Chain,
    pub terms: Terms,
    pub compensation: Option<&'a Compensation>,
    /// Does the program command the tool centre point?
    pub tcp: bool,
    pub dice: Dice,
    pub rounding_mm: f64,
    pub present: [bool; 6],
    pub touches: Vec<Ready>,
}

/// A touch with everything it depends on.
pub struct Ready {
    pub id: u64,
    /// Number in the plan, from 1.
    pub number: usize,
    pub start: Position,
    pub end: Position,
    /// Axes between the base and the block's carrier.
    pub n_links: usize,
    pub stylus: Stylus,
    pub ball_radius_mm: f64,
    /// The block's centre in the carrier's frame, mm.
    pub centre: Vec3,
    pub form: Form,
    /// Half edges of the box that holds it, mm.
    pub half: Vec3,
    /// Of a cylinder or a hole, mm.
    pub radius: f64,
    /// Planned place and size less real ones.
    pub wrong: Option<BlockError>,
    /// How much longer its half edges are than the plan says, beside that, mm.
    pub longer_half: Vec3,
    /// The same of its radius, mm.
    pub longer_radius: f64,
    /// Outward normal of the face in the carrier's frame.
    pub normal: Vec3,
    pub state: TouchState,
    pub visit: u64,
    pub time_s: Option<f64>,
    pub temperature_deg_c: Option<f64>,
}

/// Checks that the plan fits the machine and sets everything up.
pub fn bench<'a>(
    machine: &'a Machine,
    plan: &Plan,
    scenario: &Scenario,
    compensation: Option<&'a Compensation>,
) -> Result<(Bench<'a>, Findings)> {
    let mut findings = Findings::default();
    if plan.machine != machine.name {
        return Err(Failure::new(
            "simulate::machine",
            format!("the plan was made for machine {:?}, not for {:?}", plan.machine, machine.name),
        )
        .help("name the plan's machine with --machine, or make the plan again"));
    }
    let tcp = plan.controller_frame == ControllerFrame::Tcp;
    if let Some(Err(why)) = compensation.map(|c| c.acts_on(tcp)) {
        let finding = if tcp {
            Finding::error("simulate::frame", why).help("make the plan without --tcp")
        } else {
            Finding::warning("simulate::frame", why).help("make the plan with --tcp to see it at work")
        };
        findings.push(finding);
    }
    let p = &machine.reference.pivot;
    let chain = Chain::new(machine, [p.x, p.y, p.z]);
    let terms = Terms::new(scenario.terms.iter().copied(), &scenario.formulas);
    let times = times(plan, scenario, terms.timed(), &mut findings);
    let mut present = [false; 6];
    for axis in &machine.axes {
        present[axis.name.index()] = true;
    }
    let first_touch_s = first_touch_s(plan, scenario);
    let spindle: std::sync::Arc<[[f64; 3]]> = scenario
        .spindle
        .iter()
        .map(|&[from, to, rpm]| [from, to, rpm])
        .map(|[from, to, rpm]| [hours_from_s(from - first_touch_s), hours_from_s(to - first_touch_s), rpm])
        .collect();
    let mut senses = Senses::default();
    let mut came_from = CameFrom::default();
    let mut turned = Turned::default();
    let mut visits = Visits::default();
    let mut touches = Vec::with_capacity(plan.touches.len());
    let mut no_value: Vec<u64> = Vec::new();
    let mut refused: BTreeMap<String, Vec<u64>> = BTreeMap::new();
    for (i, touch) in plan.touches.iter().enumerate() {
        match ready(machine, plan, scenario, &chain, touch) {
            Ok(mut ready) => {
                ready.number = i + 1;
                (ready.time_s, ready.state.hours) = times[i];
                ready.temperature_deg_c = scenario.temperature_at(ready.state.hours);
                if let Some(degrees) = ready.temperature_deg_c {
                    ready.state.temperature_deg_c = degrees;
                }
                ready.state.spindle = spindle.clone();
                ready.state.sense = senses.next(touch, &ready);
                ready.state.stood_before_rad = came_from.next(touch);
                ready.state.since_reversal_rad = turned.next(touch);
                ready.visit = visits.next(touch, plan, &ready);
                if !terms.finite(&ready.state, &ready.start) {
                    no_value.push(touch.id);
                }
                touches.push(ready);
            }
            Err(what) => refused.entry(what).or_default().push(touch.id),
        }
    }
    for (what, ids) in refused {
        let (which, more) = super::some_of(&ids);
        findings.push(
            Finding::error(
                "simulate::touch",
                format!("{} touches cannot be made (touch {which}{more}): {what}", ids.len()),
            )
            .help("make the plan again with `axiscal generate`"),
        );
    }
    if !no_value.is_empty() {
        let (which, more) = super::some_of(&no_value);
        let message = format!("a formula of a planted effect has no value at touch {which}{more}");
        let help =
            "a division by zero, or a root or logarithm of a negative number: write it so that it holds at every touch";
        findings.push(Finding::error("simulate::no_value", message).help(help));
    }
    let dice = Dice::new(scenario, plan, compensation.is_some());
    let rounding_mm = scenario.noise.rounding_mm;
    findings.finish(Bench { chain, terms, compensation, tcp, dice, rounding_mm, present, touches })
}

/// Log time (s) and hours since the study's first touch of each touch.
fn times(plan: &Plan, scenario: &Scenario, needed: bool, findings: &mut Findings) -> Vec<(Option<f64>, f64)> {
    let untimed = plan.touches.iter().any(|t| t.time_s.is_none());
    if untimed && needed {
        let message =
            format!("the plan has no times, but the scenario changes with time: {TOUCH_S} s per touch are taken");
        findings.push(Finding::warning("simulate::no_times", message).help("make the plan again: it predicts time_s"));
    }
    let mut last = 0.0;
    let mut own: Vec<(Option<f64>, f64)> = Vec::with_capacity(plan.touches.len());
    for touch in &plan.touches {
        last = touch.time_s.unwrap_or(last + TOUCH_S);
        let since_start = scenario.clock.started_s + last;
        own.push((touch.time_s.map(|_| since_start).or(needed.then_some(since_start)), since_start));
    }
    let first = scenario.clock.first_touch_s.or(own.first().map(|t| t.1)).unwrap_or(0.0);
    own.into_iter().map(|(logged, at)| (logged, hours_from_s(at - first))).collect()
}

/// When the first touch of the study is made, s on its clock.
fn first_touch_s(plan: &Plan, scenario: &Scenario) -> f64 {
    let own = plan.touches.first().map_or(0.0, |t| scenario.clock.started_s + t.time_s.unwrap_or(TOUCH_S));
    scenario.clock.first_touch_s.unwrap_or(own)
}

/// Half edge of the box behind a plane through a centre, mm.
const BEHIND_MM: f64 = 50.0;

fn ready(
    machine: &Machine,
    plan: &Plan,
    scenario: &Scenario,
    chain: &Chain,
    touch: &PlanTouch,
) -> Result<Ready, String> {
    let carrier = machine.carrier(&touch.carrier).filter(|c| *c != Carrier::Base);
    let carrier = carrier.ok_or_else(|| format!("{:?} carries no blocks on {:?}", touch.carrier, machine.name))?;
    for axis in &machine.axes {
        let name = axis.name;
        let given = if name.is_rotary() {
            touch.pose.get(name).is_some()
        } else {
            touch.start.get(name).is_some() && touch.end.get(name).is_some()
        };
        if !given {
            return Err(format!("the position of axis {name} is not given"));
        }
    }
    let (start, end) = (touch.start_position(), touch.end_position());
    for name in AxisName::ALL {
        if ![start, end].iter().all(|p| p.get(name).abs() < FAR) {
            return Err(format!("the position of axis {name} is nowhere on a machine"));
        }
        if machine.axis(name).is_none() && (start.get(name) != 0.0 || end.get(name) != 0.0) {
            return Err(format!("{:?} has no axis {name}", machine.name));
        }
        if name.is_rotary() && start.get(name) != end.get(name) {
            return Err(format!("axis {name} turns during the search"));
        }
    }
    if start == end {
        return Err("its search ends where it starts".to_owned());
    }
    let block = plan.block_of(touch).ok_or_else(|| format!("the plan lacks its block {:?}", touch.block))?;
    let ball_radius_mm = touch.ball_radius_mm.unwrap_or(plan.ball_radius_mm);
    let length_mm = touch.tool_length_mm.unwrap_or(plan.tool_length_mm);
    let of_centre = block.form.is_centre();
    if block.form == Form::Part {
        return Err("a workpiece that is known by its nominal points has no body to touch".to_owned());
    }
    if !(ball_radius_mm.is_finite() && (ball_radius_mm > 0.0 || of_centre && ball_radius_mm == 0.0)) {
        return Err(format!("the ball's radius is {ball_radius_mm} mm"));
    }
    if !(length_mm.abs() < FAR && ball_radius_mm < FAR && block.centre.iter().all(|x| x.abs() < FAR)) {
        return Err("its tool length, ball or block centre is nowhere on a machine".to_owned());
    }
    if !block.size.iter().all(|&s| s > 0.0 && s < FAR) {
        return Err(format!("block {:?} has an edge of no length", block.name));
    }
    let stylus = Stylus { length_mm, spindle_deg: touch.spindle_deg.unwrap_or(0.0) };
    if !stylus.spindle_deg.is_finite() {
        return Err("its spindle orientation is not a number".to_owned());
    }
    let n_links = chain.links_to(carrier);
    let state = state(machine, plan, chain, (touch, block), (&start, &end), n_links, stylus);
    // a centre is found by the three planes through it: each is the face of a large box behind it
    let half = if of_centre { [BEHIND_MM; 3] } else { block.size.map(|s| 0.5 * s) };
    let behind = if of_centre { BEHIND_MM } else { 0.0 };
    Ok(Ready {
        id: touch.id,
        number: 0,
        start,
        end,
        n_links,
        stylus,
        ball_radius_mm,
        centre: std::array::from_fn(|i| block.centre[i] - behind * touch.normal[i]),
        form: block.form,
        half,
        radius: 0.5 * block.diameter.unwrap_or(0.0),
        wrong: wrong_block(machine, plan, scenario, touch),
        longer_half: [0, 1, 2].map(|along| longer_half(scenario, &state.label, along)),
        longer_radius: longer_half(scenario, &state.label, RADIUS),
        normal: touch.normal,
        state,
        visit: 0,
        time_s: None,
        temperature_deg_c: None,
    })
}

/// What the scenario says about the block of a touch. A plan without mountings is matched by the blocks' carrier.
fn wrong_block(machine: &Machine, plan: &Plan, scenario: &Scenario, touch: &PlanTouch) -> Option<BlockError> {
    let mounting = touch.mounting.as_deref().unwrap_or(&plan.mounting);
    let found = scenario.blocks.iter().find(|b| {
        let same_mounting = if mounting.is_empty() {
            machine.mounting(&b.mounting).is_some_and(|m| m.carrier.to_string() == touch.carrier)
        } else {
            b.mounting == mounting
        };
        b.name == touch.block && same_mounting
    });
    found.cloned()
}

/// How much longer one half edge of a block is, or its radius, mm.
fn longer_half(scenario: &Scenario, label: &str, along: usize) -> f64 {
    let name = label.rsplit('/').next();
    let of_it = scenario.edges.iter().filter(|e| e.block == label || Some(e.block.as_str()) == name);
    of_it.filter(|e| e.along == along).map(|e| e.half_mm).sum()
}

/// Everything that the errors of a touch may depend on besides axis positions; senses and time come later.
fn state(
    machine: &Machine,
    plan: &Plan,
    chain: &Chain,
    (touch, block): (&PlanTouch, &PlanBlock),
    (start, end): (&Position, &Position),
    n_links: usize,
    stylus: Stylus,
) -> TouchState {
    let none = Shifts::default();
    let (from, to) = (chain.place(start, &none, n_links, stylus), chain.place(end, &none, n_links, stylus));
    let way = minus(to.carrier.inward(to.ball), from.carrier.inward(from.ball));
    let tool = chain.tool_frame(start, &none);
    let approach_tool = tool.inward_direction(from.carrier.outward_direction(unit(way)));
    let spindle = chain.spindle(stylus.spindle_deg);
    let normal = unit(touch.normal);
    let normal_machine = from.carrier.outward_direction(normal);
    let mounting = touch.mounting.as_deref().unwrap_or(&plan.mounting);
    let feed = touch.feed_mm_min.filter(|f| f.is_finite()).unwrap_or(machine.probe.slow_feed);
    TouchState {
        sense: [0.0; 6],
        stood_before_rad: [0.0; 3],
        since_reversal_rad: [0.0; 3],
        feed_mm_min: feed,
        hours: 0.0,
        stylus_ratio: stylus.length_mm / machine.tool.length_mm,
        id: touch.id,
        approach_probe: spindle.inward_direction(approach_tool),
        down_tool: tool.inward_direction([0.0, 0.0, -1.0]),
        tool_axis: tool.outward_direction(chain.tool_direction()),
        stylus_axis: chain.tool_direction(),
        spindle_rad: rad_from_deg(stylus.spindle_deg),
        stylus_mm: stylus.length_mm,
        own_stylus_mm: machine.tool.length_mm,
        normal_machine,
        normal_probe: spindle.inward_direction(tool.inward_direction(normal_machine)),
        normal_carrier: normal,
        point: touch.point,
        outward: chain.outward_from_centre(n_links, block.centre),
        edge_mm: edge_mm(block, normal),
        on_stem: matches!(block.form, Form::Sphere | Form::Cylinder | Form::Bore),
        hangs: !matches!(block.form, Form::Box | Form::Plane | Form::Part),
        down_carrier: from.carrier.inward_direction([0.0, 0.0, -1.0]),
        label: if mounting.is_empty() {
            touch.block.as_str().into()
        } else {
            format!("{mounting}/{}", touch.block).into()
        },
        ..TouchState::default()
    }
}

/// How long the body is along a normal, mm: what is round has its diameter, a hole a negative one.
fn edge_mm(block: &PlanBlock, normal: Vec3) -> f64 {
    let across = block.diameter.unwrap_or(0.0);
    match block.form {
        Form::Sphere => across,
        Form::Cylinder if normal[2].abs() < 0.5 => across,
        Form::Bore if normal[2].abs() < 0.5 => -across,
        // planes through single points: a larger body is none of these
        Form::Centre | Form::Reading | Form::Part => 0.0,
        _ => (0..3).map(|i| block.size[i] * normal[i].abs()).sum(),
    }
}

/// Senses of the axes' last motions, from touch to touch.
#[derive(Default)]
struct Senses {
    last: [f64; 6],
    /// Where the axes stood after the last touch: a search ends with the way back to its start.
    stood: Option<Position>,
}

impl Senses {
    fn next(&mut self, touch: &PlanTouch, ready: &Ready) -> [f64; 6] {
        for name in AxisName::ALL {
            let i = name.index();
            if ready.form.is_centre() && !name.is_rotary() {
                self.last[i] = 0.0;
                continue;
            }
            let searched = ready.end.get(name) - ready.start.get(name);
            let came = self.stood.map_or(0.0, |p| ready.start.get(name) - p.get(name));
            // the search itself, else the forced sense of indexing, else the way from the last touch
            let forced = touch.from.get(name).unwrap_or(0.0);
            for motion in [searched, forced, came] {
                if motion.abs() > STILL && motion.is_finite() {
                    self.last[i] = motion.signum();
                    break;
                }
            }
        }
        self.stood = Some(ready.start);
        self.last
    }
}

/// The pose that each rotary axis left for the one where it is.
#[derive(Default)]
struct CameFrom {
    /// Last pose and the one before, deg.
    poses: BTreeMap<char, (f64, f64)>,
}

impl CameFrom {
    fn next(&mut self, touch: &PlanTouch) -> [f64; 3] {
        ['A', 'B', 'C'].map(|letter| {
            let here = AxisName::from_letter(letter).and_then(|name| touch.pose.get(name)).unwrap_or(0.0);
            let (pose, left) = self.poses.entry(letter).or_insert((here, 0.0));
            // a ten-thousandth of a degree is no other pose
            if (here - *pose).abs() > 1e-4 {
                (*left, *pose) = (*pose, here);
            }
            crate::units::rad_from_deg(*left)
        })
    }
}

/// How far each rotary axis has turned since it last turned back.
#[derive(Default)]
struct Turned {
    /// Of each letter: where it is, and where it last turned back, deg.
    axes: BTreeMap<char, (f64, f64)>,
}

impl Turned {
    fn next(&mut self, touch: &PlanTouch) -> [f64; 3] {
        /// How far past its goal an axis goes that must come from a given side.
        const PAST_DEG: f64 = 5.0;
        ['A', 'B', 'C'].map(|letter| {
            let name = AxisName::from_letter(letter);
            let goal = name.and_then(|n| touch.pose.get(n)).unwrap_or(0.0);
            let (at, turned_back) = self.axes.entry(letter).or_insert((goal, goal));
            let turns_back = (goal - *at) * (*at - *turned_back) < 0.0 && (goal - *at).abs() > 1e-7;
            if turns_back {
                *turned_back = *at;
            }
            *at = goal;
            // asked to come from a side that is not the one it comes from: past its goal and back
            if let Some(side) = name.and_then(|n| touch.from.get(n)).filter(|s| *s != 0.0)
                && (goal - *turned_back) * side <= 0.0
            {
                *turned_back = goal - side.signum() * PAST_DEG;
            }
            rad_from_deg(goal - *turned_back)
        })
    }
}

/// Numbers of index visits: the plan's own, or a new one whenever a rotary axis or the mounting changes.
#[derive(Default)]
struct Visits {
    known: BTreeMap<(u32, String), u64>,
    last: Option<(Position, String)>,
    count: u64,
}

impl Visits {
    fn next(&mut self, touch: &PlanTouch, plan: &Plan, ready: &Ready) -> u64 {
        let mounting = touch.mounting.as_deref().unwrap_or(&plan.mounting).to_owned();
        if let Some(visit) = touch.visit {
            let next = self.known.len() as u64;
            // visits without a number count from far above
            return *self.known.entry((visit, mounting)).or_insert(next);
        }
        let mut pose = ready.start;
        pose.0[..3].fill(0.0);
        if self.last.as_ref() != Some(&(pose, mounting.clone())) {
            self.count += 1;
            self.last = Some((pose, mounting));
        }
        (1 << 32) + self.count
    }
}
