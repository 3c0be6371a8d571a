//! Which runs of a program are made: from the beginning with the control in an awkward state and with everything that may
//! happen, once more from elsewhere with the control fresh, and from each set-up.

mod doubted;
mod files;
mod hidden_rotation;
mod otherwise;
mod program;
mod spindle;

use super::doubt::Taken;
use super::explore::{Explored, ExploredRun, Limits, explore};
use super::run::{Dialect, Event, Happened, Pause, Run, Start, Vm};
use super::seconds::Clock;
use super::world::World;
use super::{heidenhain, macro_b, ngc, sinumerik};
use crate::axes::{AxisName, Position};
use crate::machine::Machine;
use crate::post::{DialectName, Postprocessor};
use crate::program::plan::Plan;
use crate::program::scene::Scene;
use hidden_rotation::Begun;
use otherwise::otherwise;
pub use program::Program;
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::ops::Range;
use std::sync::Arc;

/// What is known before the runs are made.
pub struct Opening {
    /// Where the rotary axes may stand when the program begins.
    window: [[f64; 2]; 6],
    /// Wherever the program consents to begin, its first moves are clear.
    pub clear_from_anywhere: bool,
    /// The settings of a control as it is switched on.
    pub neutral: BTreeMap<String, String>,
}

/// What a run is made for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// The whole program, or its run from a set-up.
    Begun,
    /// A whole run that finds the control in another state.
    Other,
    /// A run that finds the machine where the program must not begin.
    Refused,
    /// The dry run: no block is met, and nothing is measured.
    Dry,
    /// A run that takes the other way at a condition on a value that is not known, or finds the control as the program has left it.
    Doubted,
}

/// What the runs show together. They are told one by one while they are made: a program of 250 set-ups has 250 of them, each of which
/// is as long as what is left of it.
pub struct All {
    /// The run of the whole program.
    pub whole: ExploredRun,
    /// The first condition whose other way was not run, where there are too many.
    pub beyond: Option<Range<usize>>,
    /// What is wrong in the comparison of runs.
    pub findings: Vec<(Range<usize>, String)>,
    /// Set-ups at which it can begin.
    pub setups: u32,
    /// Stops of the whole program.
    pub stops: usize,
}

/// The machine and the program whose runs are made.
#[derive(Clone, Copy)]
pub struct Stage<'a> {
    /// The machine with the stylus of the first part.
    pub machine: &'a Machine,
    /// The control.
    pub post: &'a Postprocessor,
    pub plan: Option<&'a Plan>,
    pub program: &'a Program,
    /// Blocks and coordinates.
    pub world: &'a Arc<World>,
    /// Shapes of each part.
    pub scenes: &'a [Scene<'a>],
    /// Only the runs without missed touches and interruptions. Those are followed with the artefact at its nominal position.
    pub only_trunks: bool,
}

/// What is known before the runs are made.
pub fn opening(stage: Stage<'_>) -> Opening {
    match stage.program.dialect {
        DialectName::Ngc => Runs::<ngc::Ngc>::new(stage).opening(),
        DialectName::MacroB => Runs::<macro_b::MacroB>::new(stage).opening(),
        DialectName::Klartext => Runs::<heidenhain::Heidenhain>::new(stage).opening(),
        DialectName::Sinumerik => Runs::<sinumerik::Sinumerik>::new(stage).opening(),
    }
}

/// Makes all runs. `each` is told of them in the order of [`Kind`], the whole program first.
pub fn all(stage: Stage<'_>, opening: &Opening, each: &mut dyn FnMut(Kind, &ExploredRun)) -> All {
    match stage.program.dialect {
        DialectName::Ngc => Runs::<ngc::Ngc>::new(stage).all(opening, each),
        DialectName::MacroB => Runs::<macro_b::MacroB>::new(stage).all(opening, each),
        DialectName::Klartext => Runs::<heidenhain::Heidenhain>::new(stage).all(opening, each),
        DialectName::Sinumerik => Runs::<sinumerik::Sinumerik>::new(stage).all(opening, each),
    }
}

/// The dry run without missed touches and interruptions, where the program has one.
pub fn dry(stage: Stage<'_>, opening: &Opening) -> Option<ExploredRun> {
    match stage.program.dialect {
        DialectName::Ngc => Runs::<ngc::Ngc>::new(stage).dry_trunk(opening),
        DialectName::MacroB => Runs::<macro_b::MacroB>::new(stage).dry_trunk(opening),
        DialectName::Klartext => Runs::<heidenhain::Heidenhain>::new(stage).dry_trunk(opening),
        DialectName::Sinumerik => Runs::<sinumerik::Sinumerik>::new(stage).dry_trunk(opening),
    }
}

struct Runs<'a, D> {
    machine: &'a Machine,
    post: &'a Postprocessor,
    plan: Option<&'a Plan>,
    program: &'a Program,
    world: &'a Arc<World>,
    scenes: &'a [Scene<'a>],
    only_trunks: bool,
    dialect: std::marker::PhantomData<fn() -> D>,
}

impl<'a, D: Dialect> Runs<'a, D> {
    fn new(Stage { machine, post, plan, program, world, scenes, only_trunks }: Stage<'a>) -> Self {
        Self { machine, post, plan, program, world, scenes, only_trunks, dialect: std::marker::PhantomData }
    }

    /// The last number at which it can be told to begin: the last set-up, and one more that only gives the settings back.
    fn last(&self) -> u32 {
        if self.program.from.is_some() { self.program.setups + 1 } else { 1 }
    }

    fn opening(&self) -> Opening {
        let (window, clear_from_anywhere) = self.windows();
        let neutral = D::begin(Start::Fresh, self.post, self.machine).settings();
        Opening { window, clear_from_anywhere, neutral }
    }

    fn all(&self, opening: &Opening, each: &mut dyn FnMut(Kind, &ExploredRun)) -> All {
        let window = opening.window;
        let beginning = self.beginning(opening);
        if self.only_trunks {
            return self.trunks(beginning, each);
        }
        // a touch takes a dozen, with the guarded moves to it
        const PER_TOUCH: usize = 50;
        let touches = self.plan.map_or(self.program.code.statements.len() / PER_TOUCH, |p| p.touches.len());
        let limits = Limits {
            placement_mm: self.machine.probe.placement_tolerance,
            find_mm: self.plan.and_then(|p| p.find.as_ref()).map_or(0.0, |find| find.room_mm),
            back_off_mm: self.machine.probe.back_off,
            guard_mm: self.post.settings.get("missed_within").and_then(|mm| mm.trim().parse().ok()),
            probes: usize::MAX,
            most_probes: 10_000 + PER_TOUCH * touches,
        };
        let elsewhere = self.start(&window, if self.tcp() { 0.5 } else { 0.4 }, 0.8);
        let whole = self.explored(1, Start::Awkward, beginning, Some(limits));
        let (mut turns, mut dead) = (Vec::new(), Vec::new());
        let (mut begun, mut faultless) = (Vec::new(), true);
        let mut all_taken = Taken::new();
        let setting = |name: &str| self.post.settings.get(name).map_or("", String::as_str);
        let (on, off) = (setting("probe_on"), setting("probe_off"));
        let mut looked_at = |kind: Kind, told: &ExploredRun| {
            if matches!(kind, Kind::Begun | Kind::Doubted) {
                turns.extend(spindle::turns(told));
                dead.extend(spindle::searches_dead(told, on, off));
            }
            if kind == Kind::Begun {
                begun.push(Begun::from_run(told));
                faultless &= told.fault.is_none();
            }
            each(kind, told);
        };
        let left = whole.left.after_abort().filter(|_| whole.told.fault.is_none());
        let Explored { told: whole, forks, mut cut, .. } = whole;
        let mut open = self.forks(&whole, forks, None);
        note(&mut all_taken, &whole);
        // 2 … the last set-up, and one more that only gives the settings back; the whole one is looked at while the first are made
        let numbers: Vec<u32> = (2..=self.last()).collect();
        let from_there = |k: &u32| self.explored(*k, Start::Awkward, beginning, Some(limits));
        made_ahead(&numbers, from_there, |made| {
            let Some(Explored { told, forks, cut: own, .. }) = made else {
                looked_at(Kind::Begun, &whole);
                return;
            };
            cut = cut.or(own);
            open.extend(self.forks(&told, forks, Some(&whole)));
            note(&mut all_taken, &told);
            looked_at(Kind::Begun, &told);
        });
        // the same from elsewhere
        let starts: Vec<Start> = [Start::Fresh, Start::Third]
            .into_iter()
            .chain(D::lasting(self.tcp()).iter().map(|what| Start::LeftoverMode(*what)))
            .collect();
        let mut findings = Vec::new();
        let from_elsewhere = |start: &Start| self.told(1, *start, elsewhere, None);
        made_ahead(&starts, from_elsewhere, |made| {
            let Some(other) = made else { return };
            findings.extend(otherwise(&whole, &other).filter(|_| !stays(&other)));
            note(&mut all_taken, &other);
            looked_at(Kind::Other, &other);
        });
        let (again, (dry, refused)) = rayon::join(
            || left.map(|left| self.again(left, beginning)),
            || (self.dry(beginning, Some(limits)), self.refused(beginning)),
        );
        let mut moving = Vec::new();
        for refused in refused {
            moving.extend(moves_all_the_same(&refused, self.program.setups));
            note(&mut all_taken, &refused);
            looked_at(Kind::Refused, &refused);
        }
        if let Some(dry) = dry {
            looked_at(Kind::Dry, &dry);
        }
        again.iter().for_each(|again| note(&mut all_taken, again));
        let doubted::Doubted { runs, beyond } = self.doubted(open, &all_taken, limits);
        let beyond = beyond.or(cut.map(|statement| self.program.place(statement)));
        runs.iter().chain(&again).for_each(|doubted| looked_at(Kind::Doubted, doubted));
        findings.extend(turns);
        findings.extend(dead);
        findings.dedup();
        if D::may_be_rotated(self.tcp()) && faultless {
            findings.extend(self.skewed(elsewhere, &begun));
        }
        findings.extend(moving);
        let stops = stops(&whole.trunk);
        All { whole, beyond, findings, setups: self.program.setups, stops }
    }

    /// Where the machine stands when the program begins.
    fn beginning(&self, opening: &Opening) -> Position {
        self.start(&opening.window, 0.5, 0.3)
    }

    fn dry_trunk(&self, opening: &Opening) -> Option<ExploredRun> {
        self.dry(self.beginning(opening), None)
    }

    /// The whole run, those from each set-up, and the dry run, with nothing that happens otherwise.
    fn trunks(&self, beginning: Position, each: &mut dyn FnMut(Kind, &ExploredRun)) -> All {
        let whole = self.told(1, Start::Awkward, beginning, None);
        let numbers: Vec<u32> = (2..=self.last()).collect();
        let from_there = |k: &u32| self.told(*k, Start::Awkward, beginning, None);
        made_ahead(&numbers, from_there, |made| each(Kind::Begun, made.as_ref().unwrap_or(&whole)));
        if let Some(dry) = self.dry(beginning, None) {
            each(Kind::Dry, &dry);
        }
        let stops = stops(&whole.trunk);
        All { whole, beyond: None, findings: Vec::new(), setups: self.program.setups, stops }
    }

    /// Under the control's own transformation the rotary axes must stand at 0: runs that find one of them elsewhere. And those in
    /// which the program must look before it moves.
    fn refused(&self, beginning: Position) -> Vec<ExploredRun> {
        const ELSEWHERE_DEG: f64 = 0.01;
        let obstructed = D::OBSTRUCTED.iter().map(|start| self.told(1, *start, beginning, None));
        let elsewhere = |axis: AxisName, by: f64| {
            let mut at = beginning;
            at.set(axis, at.get(axis) + by);
            self.told(1, Start::Awkward, at, None)
        };
        let rotary = self.machine.rotary().filter(|_| self.tcp());
        let turned = rotary.flat_map(|a| [ELSEWHERE_DEG, -ELSEWHERE_DEG].map(|by| elsewhere(a.name, by)));
        turned.chain(obstructed).chain(self.nowhere(beginning)).collect()
    }

    /// Runs that are told to begin at a set-up that the program does not have, nor takes for the order to give settings back.
    fn nowhere(&self, beginning: Position) -> Vec<ExploredRun> {
        if self.program.from.is_none() {
            return Vec::new();
        }
        let told = |setup: u32| {
            let run = self.run(setup, Start::Awkward, beginning, 0, false);
            ExploredRun { start: Start::Awkward, ..explore(run, setup, None, &|_| None).told }
        };
        [0, self.program.setups + 2].map(told).into()
    }

    fn tcp(&self) -> bool {
        self.plan.is_some_and(|p| p.controller_frame == crate::program::plan::ControllerFrame::Tcp)
    }

    /// A place at which the program may find the machine.
    fn start(&self, window: &[[f64; 2]; 6], rotary: f64, linear: f64) -> Position {
        let mut at = Position::default();
        for axis in &self.machine.axes {
            let i = axis.name.index();
            let [low, high] = if axis.name.is_rotary() { window[i] } else { axis.range };
            let share = if axis.name.is_rotary() { rotary } else { linear };
            // a program under the control's own transformation wants 0, which is in the middle of its window
            let value = low + (high - low) * share;
            at.set(axis.name, value + self.machine.origin.get(axis.name).unwrap_or(0.0));
        }
        at
    }

    fn run(&self, from: u32, start: Start, at: Position, part: usize, reminded: bool) -> Run<'a, D> {
        let mut axes = [false; 6];
        self.machine.axes.iter().for_each(|a| axes[a.name.index()] = true);
        // under the control's own transformation a program sees to it that the rotary axes stand at 0 when it begins
        let known = AxisName::ALL.map(|a| self.tcp() && a.is_rotary());
        // axes that count from 0 to 360 only are counted as the plan counts them
        let mut turned_near = self.machine.origin.position();
        if let Some(touch) = self.plan.and_then(|p| p.touches.first()) {
            let start = touch.start_position();
            turned_near.0.iter_mut().zip(start.0).for_each(|(slot, angle)| *slot += angle);
        }
        let vm = Vm {
            at,
            known,
            trace: Vec::new(),
            place: 0..0,
            axes,
            world: self.world.clone(),
            part,
            stop_is_reminder: reminded,
            stuck: false,
            shift: [0.0; 3],
            finding: self.plan.is_some_and(|p| p.find.is_some()),
            hits: 0,
            moved: true,
            asked: false,
            turned_near,
            clock: Clock::default(),
        };
        let mut run =
            Run::new(&self.program.code, &self.program.inserted, D::begin(start, self.post, self.machine), vm);
        run.switched = self.program.switched(from, 0.0);
        run
    }

    fn told(&self, k: u32, start: Start, at: Position, limits: Option<Limits>) -> ExploredRun {
        self.explored(k, start, at, limits).told
    }

    fn explored(&self, k: u32, start: Start, at: Position, limits: Option<Limits>) -> Explored<'a, D> {
        let gives_back = self.program.from.is_some().then(|| self.last());
        let restart = |run: &Run<'a, D>| {
            let dialect = run.dialect.after_abort()?;
            let mut again = self.run(gives_back?, start, run.vm.at, run.vm.part, false);
            again.dialect = dialect;
            Some(again)
        };
        let parts = self.world.last_part() + 1;
        let part = if k == 1 || parts == 1 { 0 } else { self.part_of(k, start, at, parts) };
        let run = self.run(k, start, at, part, k > 1 && parts > 1);
        let probes = if k > 1 { Limits::PROBES_AFTER_RESTART } else { usize::MAX };
        let mut explored = explore(run, k, limits.map(|l| Limits { probes, ..l }), &restart);
        explored.told.start = start;
        explored
    }

    /// The dry run, at the height that is written or else at the usual one.
    fn dry(&self, at: Position, limits: Option<Limits>) -> Option<ExploredRun> {
        const USUAL_MM: f64 = 50.0;
        let (written, _) = self.program.dry_run()?;
        let usual = self.post.number.length(USUAL_MM).parse().unwrap_or(USUAL_MM);
        let mut run = self.run(1, Start::Awkward, at, 0, false);
        run.switched = self.program.switched(1, if written > 0.0 { written } else { usual });
        let told = explore(run, 1, limits, &|_| None).told;
        Some(ExploredRun { start: Start::Awkward, ..told })
    }

    /// What is mounted when the program begins at a set-up: that of the first touch that it then makes.
    fn part_of(&self, from: u32, start: Start, at: Position, parts: usize) -> usize {
        let first = |part: usize| first_touch(self.run(from, start, at, part, true));
        let fits = |part: &usize| first(*part).is_some_and(|id| self.part_of_touch(id) == Some(*part));
        (0..parts).find(fits).unwrap_or(0)
    }

    fn part_of_touch(&self, id: u64) -> Option<usize> {
        let plan = self.plan?;
        let key = |t: &crate::program::plan::PlanTouch| {
            (
                t.mounting.clone().unwrap_or_else(|| plan.mounting.clone()),
                t.tool_length_mm.unwrap_or(plan.tool_length_mm).to_bits(),
                t.ball_radius_mm.unwrap_or(plan.ball_radius_mm).to_bits(),
            )
        };
        let mut part = 0;
        let mut before = None;
        for touch in &plan.touches {
            let this = key(touch);
            if before.as_ref().is_some_and(|b| *b != this) {
                part += 1;
            }
            before = Some(this);
            if touch.id == id {
                return Some(part);
            }
        }
        None
    }

    /// Where the rotary axes may stand when the program begins, and whether its first moves are clear from there.
    ///
    /// Where they are not clear from everywhere, the program is asked: it is begun with each axis at each whole step of
    /// its range, and the angles at which it moves bound the window.
    fn windows(&self) -> ([[f64; 2]; 6], bool) {
        const STEP_DEG: f64 = 1.0;
        let mut window = [[0.0; 2]; 6];
        self.machine.axes.iter().for_each(|a| window[a.name.index()] = a.range);
        let clear = |window: &[[f64; 2]; 6]| {
            self.scenes
                .iter()
                .all(|s| s.lift().is_some_and(|lift| s.clear_from_anywhere(&lift, &|a| window[a.name.index()])))
        };
        if clear(&window) && !self.tcp() {
            return (window, true);
        }
        // other axes stand where the program may want them: at the first angle at which it moves at all
        let rotary: Vec<AxisName> = self.machine.rotary().map(|a| a.name).collect();
        let steps = |[low, high]: [f64; 2]| {
            let n = ((high - low) / STEP_DEG).ceil().clamp(1.0, 800.0);
            (0..=n as u32).map(move |k| low + (high - low) * f64::from(k) / n).collect::<Vec<_>>()
        };
        let mut stands = self.start(&window, 0.5, 0.5);
        let consents = |at: &Position| {
            let mut run = self.run(1, Start::Fresh, *at, 0, false);
            loop {
                let paused = run.on();
                if run.vm.trace.iter().any(|h| matches!(h.event, Event::Move { .. })) {
                    return true;
                }
                match paused {
                    Ok(Pause::Probe(probe)) => {
                        let outcome = run.vm.world.outcome(&run.vm, &probe);
                        run.resolve(outcome);
                    }
                    Ok(Pause::Done) => return false,
                    // it goes on to something that the control would not do
                    Err(_) => return true,
                }
            }
        };
        let origin = |axis: AxisName| self.machine.origin.get(axis).unwrap_or(0.0);
        if !consents(&stands) {
            // both axes at once, coarsely; then each by itself
            let range = |i: usize| rotary.get(i).map_or([0.0; 2], |a| window[a.index()]);
            'search: for a in steps(range(0)) {
                for b in [0.0].into_iter().chain(steps(range(1)).into_iter().step_by(15)) {
                    for (axis, value) in rotary.iter().zip([a, b]) {
                        stands.set(*axis, value + origin(*axis));
                    }
                    if consents(&stands) {
                        break 'search;
                    }
                }
            }
        }
        for axis in &rotary {
            let angles = steps(window[axis.index()]);
            let at = |angle: f64| {
                let mut p = stands;
                p.set(*axis, angle + origin(*axis));
                p
            };
            let own = stands.get(*axis) - origin(*axis);
            let good: Vec<f64> = angles.into_iter().filter(|a| consents(&at(*a))).chain([own]).collect();
            let low = good.iter().copied().fold(f64::MAX, f64::min);
            let high = good.iter().copied().fold(f64::MIN, f64::max);
            let [least, most] = window[axis.index()];
            window[axis.index()] = [(low - STEP_DEG).max(least), (high + STEP_DEG).min(most)];
        }
        let is_clear = clear(&window);
        // the program is begun well inside of its window
        (window, is_clear)
    }
}

/// Makes runs, as many at once as there are threads, and looks at them in their order while the next ones are made. `look` is called with
/// `None` once, while the first ones are made.
fn made_ahead<I: Sync, T: Send>(of: &[I], make: impl Fn(&I) -> T + Sync, mut look: impl FnMut(Option<T>)) {
    let mut ready = vec![None];
    for some in of.chunks(rayon::current_num_threads().max(1)) {
        let mut next = Vec::new();
        rayon::in_place_scope(|scope| {
            scope.spawn(|_| next = some.par_iter().map(|one| Some(make(one))).collect());
            ready.drain(..).for_each(&mut look);
        });
        ready = next;
    }
    ready.into_iter().for_each(look);
}

/// Notes the ways that a run took at conditions on values that are not known.
fn note(taken: &mut Taken, told: &ExploredRun) {
    for (statement, [no, yes]) in &told.taken {
        let ways = taken.entry(*statement).or_default();
        *ways = [ways[0] | no, ways[1] | yes];
    }
}

/// It begins where it must not.
fn moves_all_the_same(told: &ExploredRun, setups: u32) -> Option<(Range<usize>, String)> {
    let moves = told.trunk.iter().find(|h| is_motion(h))?;
    let says = match told.start {
        _ if !(1..=setups).contains(&told.from) => {
            "told to begin at a set-up that it does not have, it moves: it must say that there is none"
        }
        Start::Obstructed => {
            "with a mirror image left on by the user (G51.1), which the program's words do not take off, it moves: it must first see that its coordinates are those of the axes"
        }
        Start::LengthActs => {
            "with a tool length left on by the user (G43) it moves: G49 itself may take Z along by that length (No. 5006#6 TOS = 0), so it must first see that none acts (#4008 is 49)"
        }
        _ => {
            "under the control's own transformation the program must not move unless the rotary axes stand at 0: begun with one at 0.01 deg, it does"
        }
    };
    Some((moves.at.clone(), says.to_owned()))
}

fn is_motion(happened: &Happened) -> bool {
    matches!(happened.event, Event::Move { .. } | Event::Probe { .. })
}

/// It says that it cannot begin so, and moves nothing.
fn stays(told: &ExploredRun) -> bool {
    let says = |h: &Happened| matches!(&h.event, Event::Wait(t) | Event::Abort(t) | Event::Message(t) if !t.is_empty());
    told.fault.is_none() && !told.trunk.iter().any(is_motion) && told.trunk.iter().any(says)
}

/// Stops of a run: several without a move between them are one.
fn stops(trunk: &[Happened]) -> usize {
    let (mut stops, mut moved) = (0, true);
    for happened in trunk {
        match happened.event {
            Event::Wait(_) if moved => {
                stops += 1;
                moved = false;
            }
            Event::Move { .. } | Event::Probe { .. } => moved = true,
            _ => {}
        }
    }
    stops
}

/// The touch that a run logs first.
fn first_touch<D: Dialect>(mut run: Run<'_, D>) -> Option<u64> {
    loop {
        let seen = run.vm.trace.len();
        let paused = run.on();
        let logged = run.vm.trace.iter().skip(seen).find_map(|h| match &h.event {
            Event::Log(text) if text.starts_with('P') => number_after_n(text),
            _ => None,
        });
        match (logged, paused) {
            (Some(id), _) => return Some(id),
            (None, Ok(Pause::Probe(probe))) => {
                let outcome = run.vm.world.outcome(&run.vm, &probe);
                run.resolve(outcome);
            }
            (None, _) => return None,
        }
    }
}

/// The number behind the first N of a line of the log.
fn number_after_n(text: &str) -> Option<u64> {
    let (_, rest) = text.split_once('N')?;
    let digits: String = rest.trim_start().chars().take_while(char::is_ascii_digit).collect();
    digits.parse().ok()
}
