//! A program run with everything that may happen at its probing moves.
//!
//! The trunk is the run in which all is as it should be. At each probing move branches leave it: no contact, contact on
//! the way, contact at once, a block that stands off, a probe that does not close again, a search and a measuring touch
//! that disagree, a person who breaks the program off. A branch is followed until the program ends or moves on.

use super::doubt::{Doubt, Fork, Taken};
use super::run::{Dialect, Event, Fault, Happened, Outcome, Pause, Probe, Run, Start, Trouble, Vm};
use super::world::way_mm;
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::ops::Range;
use std::sync::Arc;

/// What happens otherwise than it should.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Deviation {
    /// Contact after this part of the way.
    Contact(f64),
    /// The search meets nothing.
    Miss,
    /// The block stands further along the approach by this, mm.
    Shift(f64),
    /// The measuring touch triggers further along than the search did by this, mm.
    Disagree(f64),
    /// The probe triggers and does not close again.
    Stuck,
    /// A line cannot be written into the log.
    NotWritten,
    /// The probe is deflected when the program looks at it.
    Deflected,
}

impl Deviation {
    /// Is the program to stop?
    pub fn must_stop(self) -> bool {
        !matches!(self, Self::Shift(mm) if mm.abs() < 1.0)
    }
}

/// What the program does then.
#[derive(Debug, Clone)]
pub struct Branch {
    /// What happened.
    pub deviation: Deviation,
    /// From the deviating move on.
    pub trace: Vec<Happened>,
    /// The program has ended.
    pub over: bool,
    /// It could not go on.
    pub fault: Option<Fault>,
    /// The control's settings at the end, where it had to stop and did; most branches end with the same.
    pub settings: Arc<BTreeMap<String, String>>,
}

/// A run with its branches.
#[derive(Debug, Clone)]
pub struct ExploredRun {
    /// Set-up at which it was told to begin.
    pub from: u32,
    /// In what state it found the control.
    pub start: Start,
    /// What happened when all was as it should be.
    pub trunk: Vec<Happened>,
    /// What is mounted at each event.
    pub parts: Vec<usize>,
    /// What happens otherwise.
    pub branches: Vec<Branch>,
    /// It could not go on.
    pub fault: Option<Fault>,
    /// The control's settings before and after.
    pub settings: [BTreeMap<String, String>; 2],
    /// After a person broke it off and gave the settings back: those that were not given back, and where it was broken
    /// off (place in the trunk).
    pub aborted: Vec<(usize, BTreeMap<String, String>)>,
    /// The conditions that depend on values that are not known, and the ways that it took there.
    pub taken: Taken,
    /// The conditions at which it took the other way than the values say, and what they depend on.
    pub otherwise: Vec<(Range<usize>, Doubt)>,
}

/// A run that was made, and what can begin from it.
pub struct Explored<'p, D> {
    /// What happened.
    pub told: ExploredRun,
    /// Runs that take the other way at a condition that depends on a value that is not known.
    pub forks: Vec<Fork<'p, D>>,
    /// The first condition whose other way was not kept, because there are too many.
    pub cut: Option<usize>,
    /// The control as it was left.
    pub left: D,
}

/// A probing move that asks whether the probe is deflected is no longer than this, mm.
const ASKED_MM: f64 = 0.1;

impl ExploredRun {
    /// It was told to begin at a later set-up, and stopped before it probed anything: it says that it cannot. The moves of its
    /// opening, from wherever the machine stands, are judged like those of any run.
    pub fn declines(&self) -> bool {
        let acts = |h: &Happened| match &h.event {
            // over less it only asks whether the probe is ready
            Event::Probe { probe, .. } => way_mm(probe) > ASKED_MM,
            Event::Log(line) => line.starts_with('P'),
            _ => false,
        };
        let says = |h: &Happened| matches!(h.event, Event::Abort(_) | Event::Message(_));
        self.from > 1 && self.fault.is_none() && !self.trunk.iter().any(acts) && self.trunk.iter().any(says)
    }
}

/// How far, in parts of their limits, things deviate.
#[derive(Debug, Clone, Copy)]
pub struct Limits {
    /// How far a block may stand off, mm.
    pub placement_mm: f64,
    /// How far an artefact that is being found may stand off, mm.
    pub find_mm: f64,
    /// Way back between search and measuring touch, mm.
    pub back_off_mm: f64,
    /// A guarded move that ends so near its end counts as one without contact, mm; `None`: the control says whether there was one.
    pub guard_mm: Option<f64>,
    /// Probing moves from the beginning at which branches are followed. A run from a later set-up differs from the whole one
    /// at its beginning: after some set-ups what goes wrong there goes wrong in the whole run, or in the run from there, too.
    pub probes: usize,
    /// A program that makes more probing moves than this runs in a circle.
    pub most_probes: usize,
}

impl Limits {
    /// Probing moves of a run that starts again at which branches are followed: those of several set-ups.
    pub const PROBES_AFTER_RESTART: usize = 100;
}

/// Numbers of the probing moves at which a person breaks the program off.
const ABORTED_AT: [usize; 12] = [1, 2, 3, 5, 8, 20, 50, 100, 200, 500, 2000, 5000];

/// Probing moves that a branch may make when the probe stays deflected: it backs off and asks again.
const MOVES_WHILE_STUCK: usize = 3;

/// Runs a program that stands at its beginning. `restart` makes the run that gives the settings back after a person
/// has broken the program off, where the dialect and the program can.
pub fn explore<'p, D: Dialect>(
    run: Run<'p, D>,
    from: u32,
    limits: Option<Limits>,
    restart: &dyn Fn(&Run<'p, D>) -> Option<Run<'p, D>>,
) -> Explored<'p, D> {
    let before = run.dialect.settings();
    let told = ExploredRun {
        from,
        start: Start::Fresh,
        trunk: Vec::new(),
        parts: Vec::new(),
        branches: Vec::new(),
        fault: None,
        settings: [before, BTreeMap::new()],
        aborted: Vec::new(),
        taken: Taken::new(),
        otherwise: Vec::new(),
    };
    explore_on(run, told, limits, restart)
}

/// Runs a program on from where it stands; `told`: what is known of it so far.
pub fn explore_on<'p, D: Dialect>(
    mut run: Run<'p, D>,
    mut told: ExploredRun,
    limits: Option<Limits>,
    restart: &dyn Fn(&Run<'p, D>) -> Option<Run<'p, D>>,
) -> Explored<'p, D> {
    run.keeps_forks = limits.is_some();
    run.doubts.keeps = limits.map(|_| Doubt::Stored);
    let mut forks = Vec::new();
    let mut leaving = Leaving { kept: Vec::new(), seen: Vec::new() };
    let mut probes = 0;
    loop {
        let part_before = run.vm.part;
        let paused = run.on();
        // events before the last stop belong to the part that was up then; a stop is at most the last of them
        note_parts(&mut told.parts, &run.vm, part_before);
        let troubled = run.take_forks().into_iter();
        leaving.kept.extend(troubled.map(|(trouble, fork)| Leaves::Trouble(fork, trouble.into())));
        forks.extend(run.take_doubted());
        match paused {
            Err(fault) => {
                told.fault = Some(fault);
                break;
            }
            Ok(Pause::Done) => break,
            Ok(Pause::Probe(probe)) => {
                probes += 1;
                if limits.is_some_and(|l| probes > l.most_probes) {
                    let says = format!("the program runs in a circle: it makes more than {} probing moves", probes - 1);
                    told.fault = Some(Fault { at: run.vm.place.clone(), says });
                    break;
                }
                let outcome = run.vm.world.outcome(&run.vm, &probe);
                if let Some(limits) = limits.filter(|l| probes <= l.probes) {
                    let leaves = run.vm.trace.len();
                    let trace = std::mem::take(&mut run.vm.trace);
                    let ways = deviations(&run.vm, &probe, outcome, limits);
                    leaving.kept.push(Leaves::Probe { run: run.clone(), probe: probe.clone(), outcome, ways });
                    if ABORTED_AT.contains(&probes)
                        && let Some(again) = restart(&run)
                    {
                        told.aborted.push((leaves, settings_after(again)));
                    }
                    run.vm.trace = trace;
                }
                if leaving.kept.len() >= MOST_LEAVING {
                    leaving.follow(&mut told.branches);
                }
                run.resolve(outcome);
            }
        }
    }
    leaving.follow(&mut told.branches);
    told.settings[1] = run.dialect.settings();
    note_parts(&mut told.parts, &run.vm, run.vm.part);
    told.trunk = run.vm.trace;
    told.taken = run.doubts.taken;
    Explored { told, forks, cut: run.doubts.cut, left: run.dialect }
}

/// Where branches leave the trunk.
enum Leaves<'p, D> {
    /// At a statement that has trouble.
    Trouble(Run<'p, D>, Deviation),
    /// At a probing move, in several ways.
    Probe { run: Run<'p, D>, probe: Probe, outcome: Outcome, ways: Vec<Deviation> },
}

/// Places of the trunk that are kept in memory at once.
const MOST_LEAVING: usize = 64;

/// Branches that are not followed yet: they know nothing of each other, and all cores follow some.
struct Leaving<'p, D> {
    kept: Vec<Leaves<'p, D>>,
    /// Settings at the end of branches. The same are kept once: a long program has a hundred thousand branches.
    seen: Vec<Arc<BTreeMap<String, String>>>,
}

impl<D: Dialect> Leaving<'_, D> {
    fn follow(&mut self, branches: &mut Vec<Branch>) {
        let kept = std::mem::take(&mut self.kept);
        let followed = kept.into_par_iter().flat_map_iter(|leaves| match leaves {
            Leaves::Trouble(run, deviation) => until_it_stops(run, deviation),
            Leaves::Probe { run, probe, outcome, ways } => {
                ways.into_iter().flat_map(|way| follow(run.clone(), &probe, outcome, way)).collect()
            }
        });
        let followed: Vec<Branch> = followed.collect();
        for mut branch in followed {
            match self.seen.iter().find(|known| **known == branch.settings) {
                Some(known) => branch.settings = known.clone(),
                None => self.seen.push(branch.settings.clone()),
            }
            branches.push(branch);
        }
    }
}

fn note_parts(parts: &mut Vec<usize>, vm: &Vm, before: usize) {
    let mut part = parts.last().copied().unwrap_or(before).max(before);
    let known = parts.len();
    for happened in vm.trace.iter().skip(known) {
        parts.push(part);
        if matches!(happened.event, Event::Wait(_)) {
            part = vm.part;
        }
    }
}

fn settings_after<D: Dialect>(mut run: Run<'_, D>) -> BTreeMap<String, String> {
    let moved = |run: &Run<'_, D>| run.vm.trace.iter().any(|h| matches!(h.event, Event::Move { .. }));
    match run.on() {
        Ok(Pause::Done) if !moved(&run) => run.dialect.settings(),
        Ok(_) => BTreeMap::from([("the run that gives the settings back".to_owned(), "moves".to_owned())]),
        Err(fault) => BTreeMap::from([("the run that gives the settings back".to_owned(), fault.says)]),
    }
}

fn deviations(vm: &Vm, probe: &Probe, outcome: Outcome, limits: Limits) -> Vec<Deviation> {
    if !probe.toward {
        return Vec::new();
    }
    if !outcome.hit {
        // a program that looks how near its end the move came must see a contact just before it, too
        const BEFORE_THE_END_MM: f64 = 1.0;
        let way = way_mm(probe);
        let late = [Some(BEFORE_THE_END_MM), limits.guard_mm.map(|mm| 2.0 * mm)].into_iter().flatten();
        let late = late.filter(|mm| *mm < 0.5 * way).map(|mm| 1.0 - mm / way);
        return [0.0, 0.5].into_iter().chain(late).map(Deviation::Contact).collect();
    }
    if vm.searches() {
        const OUTSIDE: f64 = 1.2;
        const INSIDE: f64 = 0.4;
        let mm = if vm.finding { limits.find_mm } else { limits.placement_mm };
        vec![
            Deviation::Miss,
            Deviation::Contact(0.0),
            Deviation::Shift(OUTSIDE * mm.max(1.0)),
            Deviation::Shift(-OUTSIDE * mm.max(1.0)),
            Deviation::Shift(INSIDE * mm.min(1.0)),
            Deviation::Stuck,
        ]
    } else {
        const OUTSIDE: f64 = 0.6;
        let mm = OUTSIDE * limits.back_off_mm;
        vec![
            Deviation::Miss,
            Deviation::Contact(0.0),
            Deviation::Disagree(mm),
            Deviation::Disagree(-mm),
            Deviation::Stuck,
        ]
    }
}

fn follow<D: Dialect>(mut run: Run<'_, D>, probe: &Probe, nominal: Outcome, deviation: Deviation) -> Vec<Branch> {
    let way = way_mm(probe);
    let shifted = |mm: f64| Outcome { hit: true, part: (nominal.part + mm / way).clamp(0.0, 1.0) };
    let outcome = match deviation {
        Deviation::Contact(part) => Outcome { hit: true, part },
        Deviation::Miss => Outcome { hit: false, part: 1.0 },
        Deviation::Disagree(mm) => shifted(mm),
        Deviation::Shift(mm) => {
            let along = (probe.to.xyz_mm() - probe.from.xyz_mm()) * (mm / way);
            run.vm.shift = [along.x, along.y, along.z];
            run.vm.world.outcome(&run.vm, probe)
        }
        Deviation::Stuck => {
            run.vm.stuck = true;
            nominal
        }
        Deviation::NotWritten | Deviation::Deflected => nominal,
    };
    run.resolve(outcome);
    until_it_stops(run, deviation)
}

impl From<Trouble> for Deviation {
    fn from(trouble: Trouble) -> Self {
        match trouble {
            Trouble::LogFull => Self::NotWritten,
            Trouble::Deflected => Self::Deflected,
        }
    }
}

/// Conditions on a clock that are taken the other way, one behind the other, after something went wrong.
const DEEPEST: usize = 2;

/// Follows a run until it ends or moves on; the line with which it says what is wrong may be lost as well.
fn until_it_stops<D: Dialect>(mut run: Run<'_, D>, deviation: Deviation) -> Vec<Branch> {
    let mut branches = Vec::new();
    let mut fault = None;
    let mut moves = 0;
    let logged = |run: &Run<'_, D>| run.vm.trace.iter().any(|h| matches!(h.event, Event::Log(_)));
    // stored values are others in each run that comes here; a clock may show anything
    run.doubts.keeps = run.doubts.keeps.map(|_| Doubt::Outside);
    run.doubts.kept = 0;
    loop {
        let paused = run.on();
        for (trouble, fork) in run.take_forks() {
            if trouble == Trouble::LogFull && deviation.must_stop() {
                branches.extend(until_it_stops(fork, Deviation::NotWritten));
            }
        }
        for fork in run.take_doubted() {
            if fork.run.doubts.depth <= DEEPEST {
                branches.extend(until_it_stops(fork.run, deviation));
            }
        }
        match paused {
            Err(f) => {
                fault = Some(f);
                break;
            }
            Ok(Pause::Done) => break,
            Ok(Pause::Probe(next)) => {
                let goes_on = match deviation {
                    Deviation::Stuck => moves < MOVES_WHILE_STUCK,
                    _ if !deviation.must_stop() => !logged(&run),
                    _ => false,
                };
                if !goes_on {
                    break;
                }
                moves += 1;
                let outcome = run.vm.world.outcome(&run.vm, &next);
                run.resolve(outcome);
            }
        }
    }
    let over = run.is_over();
    let is_compared = deviation.must_stop() && over && fault.is_none();
    let settings = Arc::new(if is_compared { run.dialect.settings() } else { BTreeMap::new() });
    branches.insert(0, Branch { deviation, over, fault, settings, trace: run.vm.trace });
    branches
}
