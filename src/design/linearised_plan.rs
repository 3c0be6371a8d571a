//! A plan linearised at an errorless machine (a time constant or a pitch where its effect has its typical size): the whitened columns of a model and of every effect that it leaves out.

use super::shape_parameters::{Moments, every_slope_is_a_number};
use crate::axes::AxisName;
use crate::diag::{Failure, Result};
use crate::fit::candidates::{NoValue, columns, without_value};
use crate::fit::normal::Touches;
use crate::fit::uncertainty::unmodelled_by;
use crate::fit::whitening::{VisitNormals, Whitening};
use crate::fit::{design_jacobian, every_formula_has_a_value, free_in_a_design, jumps_in_a_design, scan};
use crate::log::{Status, Touch};
use crate::machine::Machine;
use crate::model::catalogue::{Catalogue, Effect};
use crate::model::data::{Data, Run, assemble_with_spindle};
use crate::model::predict::Model;
use crate::model::spindle::SpindleStretch;
use crate::program::plan::{Plan, PlanTouch};
use crate::search::{Basis, KEPT, Library, Origin, without_rounding};
use crate::units::um_from_mm;
use nalgebra::{DMatrix, Vector3};
use std::collections::{BTreeMap, HashSet};
use std::sync::OnceLock;

/// A touch with its way there, s, where a plan does not predict its times.
pub const TOUCH_S: f64 = 12.0;

/// Turning the rotary axes to another pose, s.
pub const INDEX_S: f64 = 60.0;

/// Putting up other blocks, s.
pub const MOUNTING_S: f64 = 600.0;

/// Changing the stylus, s.
pub const STYLUS_S: f64 = 300.0;

/// The room as it is assumed where nothing is measured: about 20 °C or the last value, swinging by this much, K …
pub const SWING_K: f64 = 1.0;

/// … once in this time, s: a hall whose heating or cooling comes and goes.
pub const SWING_S: f64 = 5400.0;

/// Scanned shapes that are tried at most for an effect that leaves no trace at its usual shape.
const MOST_SHAPES: usize = 16;

/// What is looked at: machine, model and everything that could act beside it.
#[derive(Debug, Clone)]
pub struct Task<'a> {
    pub machine: &'a Machine,
    /// All effects that exist.
    pub catalogue: &'a Catalogue,
    /// The effects of the model.
    pub effects: Vec<&'a Effect>,
    /// Parameters of the model that are held.
    pub held: Vec<String>,
    /// Where location errors of workpiece-side axes are stated, mm in R.
    pub reference: Vector3<f64>,
    /// Does every touch carry a temperature?
    pub temperature: bool,
}

/// Expected noise, mm, 1 sigma.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Noise {
    /// Of a touch along its approach.
    pub sigma_mm: f64,
    /// Of each component of the ball's place from one index to the next.
    pub tau_mm: f64,
}

/// A run that is planned.
#[derive(Debug, Clone)]
pub struct Planned {
    /// Its touches.
    pub plan: Plan,
    /// Runs of equal mounting share the blocks' set-up.
    pub mounting: Option<String>,
    /// When it begins, s on the study's clock; runs without it follow one another.
    pub started_s: Option<f64>,
    /// When and at what temperature its touches were made, by their numbers; of a run that is only planned: nothing.
    pub made: BTreeMap<u64, Made>,
    /// What the room does during touches that are not made yet.
    pub room: Room,
    /// When the spindle ran, in all runs of the study.
    pub spindle: Vec<SpindleStretch>,
}

/// The circumstances of a touch that was made.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Made {
    /// When, s on the study's clock.
    pub time_s: Option<f64>,
    /// The temperature, °C.
    pub temperature_deg_c: Option<f64>,
}

impl Planned {
    /// A run of a plan.
    #[must_use]
    pub fn new(plan: Plan) -> Self {
        Self {
            plan,
            mounting: None,
            started_s: None,
            made: BTreeMap::new(),
            room: Room::default(),
            spindle: Vec::new(),
        }
    }

    /// Of a run that was made.
    #[must_use]
    pub fn from_run(run: &Run) -> Self {
        let of = |t: &Touch| (t.id, Made { time_s: t.time_s, temperature_deg_c: t.temperature_deg_c });
        Self {
            plan: run.plan.clone(),
            mounting: run.mounting.map(str::to_owned),
            started_s: run.started_s,
            made: run.touches.iter().map(of).collect(),
            room: Room::GoesOn,
            spindle: Vec::new(),
        }
    }
}

/// Runs without the touches that a fit could not use: only what was measured tells anything.
pub fn keep_measured(runs: &mut [Planned], data: &Data) {
    let made: HashSet<(usize, u64)> = data.observations.iter().map(|o| (o.run, o.id)).collect();
    for (run, p) in runs.iter_mut().enumerate() {
        p.plan.touches.retain(|t| made.contains(&(run, t.id)));
        // touches that a variation adds may take their numbers
        p.made.retain(|id, _| made.contains(&(run, *id)));
    }
}

/// What the temperature does where it has not been measured yet.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Room {
    /// It swings as in a hall whose heating or cooling comes and goes; where it was measured before, it turns.
    #[default]
    Swings,
    /// It goes on as it went while the touches so far were made.
    GoesOn,
}

/// What is measured of the room: a straight line through the temperatures.
#[derive(Debug, Clone, Copy, Default)]
struct Measured {
    /// Touches that carry time and temperature.
    n: f64,
    last_s: f64,
    last_deg_c: f64,
    /// Sums of times, temperatures, their squares and products, about the first touch.
    sums: [f64; 4],
    first: Option<(f64, f64)>,
}

impl Measured {
    fn add(&mut self, time_s: f64, deg_c: f64) {
        let (s0, t0) = *self.first.get_or_insert((time_s, deg_c));
        let (s, t) = (time_s - s0, deg_c - t0);
        self.n += 1.0;
        (self.last_s, self.last_deg_c) = (time_s, deg_c);
        for (sum, x) in self.sums.iter_mut().zip([s, t, s * s, s * t]) {
            *sum += x;
        }
    }

    /// K/s.
    fn slope(&self) -> f64 {
        let [s, t, ss, st] = self.sums;
        let spread = self.n * ss - s * s;
        if spread > 0.0 { (self.n * st - s * t) / spread } else { 0.0 }
    }

    fn at(&self, time_s: f64, room: Room) -> f64 {
        let since_s = time_s - self.last_s;
        let swing = |s: f64| SWING_K * (std::f64::consts::TAU * s / SWING_S).sin();
        match (self.first, room) {
            (None, _) => 20.0 + swing(time_s),
            // the other way than it went: a room that goes the same way faster or slower has not turned
            (Some(_), Room::Swings) => self.last_deg_c - self.slope().signum() * swing(since_s),
            (Some(_), Room::GoesOn) => self.last_deg_c + self.slope() * since_s,
        }
    }
}

/// Something that is known beside the touches: Σ coefficient · unknown, with a standard uncertainty.
#[derive(Debug, Clone, PartialEq)]
pub struct Known {
    /// Names of unknowns with their coefficients.
    pub sum: Vec<(String, f64)>,
    /// Standard uncertainty of the sum.
    pub sigma: f64,
}

/// What planned touches see.
#[derive(Debug, Clone)]
pub struct LinearisedPlan {
    /// The touches as an errorless machine makes them.
    pub data: Data,
    pub model: Model,
    /// Where it is linearised: an errorless machine, and moments of jumps where they show.
    pub theta: Vec<f64>,
    /// Indices of the unknowns that are not held.
    pub free: Vec<usize>,
    /// Whitened Jacobian of the free unknowns: touches, then what is known beside them.
    pub jacobian: DMatrix<f64>,
    /// What the model can follow, when it is asked for.
    base: OnceLock<Basis>,
    /// The effects that it leaves out: whitened columns in units of typical sizes, one variant each.
    pub library: Library,
    /// Their columns before whitening, µm at typical size, effect by effect.
    pub raw_um: Vec<DMatrix<f64>>,
    /// Value of the scanned shape at which each candidate stands; `None` where it has none.
    pub shapes: Vec<Option<f64>>,
    /// Effects whose formula has no value at some of these touches, with what is said of them: they stand in the library with
    /// columns of nothing.
    pub left_out: Vec<NoValue>,
    pub noise: Noise,
    /// When the last touch is made, s.
    pub end_s: f64,
}

impl LinearisedPlan {
    /// Looks at planned runs.
    ///
    /// # Errors
    /// When no touch can be used.
    pub fn new(task: &Task, runs: &[Planned], known: &[Known], noise: Noise) -> Result<Self> {
        let mut view = Self::of_model(task, runs, known, noise)?;
        let candidates = unmodelled_by(&view.model.unknowns, task.machine, task.catalogue);
        let candidates = candidates.into_iter().filter(|e| view.model.has_parameters_of(e));
        let usual: Vec<(&Effect, Option<f64>)> = candidates.map(|e| (e, None)).collect();
        view.add(task, &usual);
        Ok(view)
    }

    /// Looks at planned runs, with the named effects only, each with its scanned shape at a value (`None`: as usual).
    ///
    /// # Errors
    /// When no touch can be used.
    pub fn with_effects(
        task: &Task,
        runs: &[Planned],
        known: &[Known],
        noise: Noise,
        effects: &[(&Effect, Option<f64>)],
    ) -> Result<Self> {
        let mut view = Self::of_model(task, runs, known, noise)?;
        view.add(task, effects);
        Ok(view)
    }

    /// Looks at planned runs, without the effects that the model leaves out.
    ///
    /// # Errors
    /// When no touch can be used.
    pub fn of_model(task: &Task, runs: &[Planned], known: &[Known], noise: Noise) -> Result<Self> {
        let (data, end_s) = nominal(task, runs);
        if data.nominal.is_empty() {
            return Err(Failure::new("assess::no_touches", "the plan has no touch that this machine can make")
                .help("is it a plan for this machine, and does it touch any block?"));
        }
        // one that is no number would make every slope none. No touch of a plan carries a temperature: built-in ones may wait for it
        every_formula_has_a_value(task.effects.iter().copied().filter(|e| !e.built_in), &data.nominal)?;
        let model = Model::new(task.machine, &task.effects, &data.set_ups, task.reference);
        let free = free_in_a_design(&model, &task.effects, &data, &task.held);
        let mut theta = model.start();
        let jacobian_at = |theta: &[f64], noise: Noise| {
            whitening(&model, &data, theta, &free, noise, |t| {
                let mut jacobian = design_jacobian(t, &model, &free);
                t.whiten(&mut jacobian);
                jacobian
            })
        };
        if task.effects.iter().any(|e| !jumps_in_a_design(e, &data).is_empty()) {
            // the same place whatever scatter the visits have
            let probe = Noise { tau_mm: 0.0, ..noise };
            let white = whitening(&model, &data, &theta, &free, probe, |t| t.whitening());
            let jacobian = jacobian_at(&theta, probe);
            Moments { task, model: &model, data: &data, free: &free, white: &white }
                .put_where_they_show(&mut theta, &jacobian);
        }
        let touched = jacobian_at(&theta, noise);
        every_slope_is_a_number(&model, &data, &free, &touched)?;
        let n = touched.nrows();
        let mut jacobian = touched.resize_vertically(n + known.len(), 0.0);
        for (row, k) in known.iter().enumerate() {
            for (name, coefficient) in &k.sum {
                if let Some(c) = free.iter().position(|&i| model.unknowns[i].name == *name) {
                    jacobian[(n + row, c)] += coefficient / k.sigma;
                }
            }
        }
        let base = OnceLock::new();
        let library = Library::new(jacobian.nrows());
        let (raw_um, shapes, left_out) = (Vec::new(), Vec::new(), Vec::new());
        Ok(Self { data, model, theta, free, jacobian, base, library, raw_um, shapes, left_out, noise, end_s })
    }

    /// What the model can follow.
    #[must_use]
    pub fn base(&self) -> &Basis {
        self.base.get_or_init(|| Basis::new(&self.jacobian))
    }

    /// Puts effects into the library, each at the given shape; else at its usual one, or where that leaves no trace at the
    /// one that leaves most.
    fn add(&mut self, task: &Task, effects: &[(&Effect, Option<f64>)]) {
        let plain: Vec<&Effect> = effects.iter().map(|e| e.0).collect();
        let all = columns(task.machine, &plain, &self.data, &self.data.nominal, task.reference, None);
        let rows = self.jacobian.nrows();
        for (effect, given) in effects {
            let bad = if effect.built_in { Vec::new() } else { without_value(effect, &self.data.nominal) };
            if let Some(bad) = bad.first() {
                self.left_out.push(bad.clone());
            }
            let own: Vec<usize> = (0..all.unknowns.len())
                .filter(|&i| all.unknowns[i].effect == effect.id && !all.unknowns[i].shape)
                .collect();
            let scaled = |values: &DMatrix<f64>, which: &[usize], unknowns: &[crate::model::predict::Unknown]| {
                if !bad.is_empty() {
                    return DMatrix::zeros(rows, which.len());
                }
                let mut out = values.select_columns(which).resize_vertically(rows, 0.0);
                for (mut column, &i) in out.column_iter_mut().zip(which) {
                    column *= unknowns[i].typical;
                }
                out
            };
            let mut plain = scaled(&all.values, &own, &all.unknowns);
            let mut whitened = self.whitened(&plain);
            let start = effect.parameters.iter().find_map(|p| p.shape.map(|s| s.0));
            let mut shape = start;
            if let Some(shapes) = given.and_then(|value| shapes_at(effect, value)) {
                let (data, places) = (&self.data, &self.data.nominal);
                let at = columns(task.machine, &[effect], data, places, task.reference, Some(&shapes));
                let which: Vec<usize> = (0..at.unknowns.len()).filter(|&i| !at.unknowns[i].shape).collect();
                plain = scaled(&at.values, &which, &at.unknowns);
                whitened = self.whitened(&plain);
                shape = *given;
            } else if self.kept(&whitened) < KEPT {
                /// Shares that differ by less are equal.
                const SAME: f64 = 1e-9;
                let scanned = effect.parameters.iter().find(|p| !p.scan.is_empty());
                let mut best = KEPT;
                // the usual values; where none of them shows it, as in a plan that is over before the first of them, the plan's own
                let usual = scanned.map_or_else(Vec::new, |p| p.scan.clone());
                let own = scanned.filter(|p| p.between.is_some()).and_then(|p| scan(p, &self.data)).unwrap_or_default();
                let few = |all: Vec<f64>| {
                    let step = all.len().div_ceil(MOST_SHAPES).max(1);
                    all.into_iter().step_by(step).collect::<Vec<f64>>()
                };
                let (usual, own) = (few(usual), few(own));
                for (k, &value) in usual.iter().chain(&own).enumerate() {
                    if k == usual.len() && best > KEPT {
                        break;
                    }
                    let at = columns(
                        task.machine,
                        &[effect],
                        &self.data,
                        &self.data.nominal,
                        task.reference,
                        Some(&[value]),
                    );
                    let which: Vec<usize> = (0..at.unknowns.len()).filter(|&i| !at.unknowns[i].shape).collect();
                    let tried = scaled(&at.values, &which, &at.unknowns);
                    let seen = self.whitened(&tried);
                    let kept = self.kept(&seen);
                    // an arm to one side often shows as much as one to the other: rounding is not to choose between them
                    if kept > best * (1.0 + SAME) {
                        (best, shape, plain, whitened) = (kept, Some(value), tried, seen);
                    }
                }
            }
            let origin = if effect.built_in { Origin::Catalogue } else { Origin::User };
            self.library.push(effect.id.clone(), origin, &whitened);
            self.shapes.push(shape);
            self.raw_um.push(plain.map(um_from_mm));
        }
    }

    /// Columns whitened: touches only, what is known beside them has no part in it.
    fn whitened(&self, plain: &DMatrix<f64>) -> DMatrix<f64> {
        let n = self.data.nominal.len();
        let mut touched = plain.rows(0, n).into_owned();
        whitening(&self.model, &self.data, &self.theta, &self.free, self.noise, |t| t.whiten(&mut touched));
        without_rounding(&mut touched);
        touched.resize_vertically(plain.nrows(), 0.0)
    }

    /// What whitens columns of the touches.
    pub(super) fn whitening(&self) -> Whitening {
        whitening(&self.model, &self.data, &self.theta, &self.free, self.noise, |t| t.whitening())
    }

    /// Which touches a scatter of visits would move together, and where to.
    pub(super) fn visit_normals(&self) -> VisitNormals {
        whitening(&self.model, &self.data, &self.theta, &self.free, self.noise, |t| t.visit_normals())
    }

    /// Share of a block's norm that the model cannot follow.
    fn kept(&self, columns: &DMatrix<f64>) -> f64 {
        let norm = columns.norm();
        if norm > 0.0 { self.base().project_columns(columns).norm() / norm } else { 0.0 }
    }

    /// Rows that are touches.
    #[must_use]
    pub fn n_touches(&self) -> usize {
        self.data.nominal.len()
    }

    /// Whitened columns of every effect that the model leaves out, touches only.
    #[must_use]
    pub fn left_out(&self) -> DMatrix<f64> {
        self.library.matrix().rows(0, self.n_touches()).into_owned()
    }
}

/// The shape parameters of an effect with its scanned one at a value; `None` where none is scanned.
fn shapes_at(effect: &Effect, value: f64) -> Option<Vec<f64>> {
    let shaped = || effect.parameters.iter().filter(|p| p.shape.is_some());
    let which = shaped().position(|p| p.scan.len() > 1)?;
    let starts = shaped().filter_map(|p| p.shape.map(|s| s.0));
    Some(starts.enumerate().map(|(k, start)| if k == which { value } else { start }).collect())
}

/// Calls `f` with the nominal touches as a problem.
fn whitening<T>(
    model: &Model,
    data: &Data,
    theta: &[f64],
    free: &[usize],
    noise: Noise,
    f: impl FnOnce(&Touches) -> T,
) -> T {
    let batch = model.prepare(&data.nominal);
    f(&Touches::new(&batch, &data.visits, theta.to_vec(), free, &[], (noise.sigma_mm, noise.tau_mm)))
}

/// The touches of runs as an errorless machine makes them, and when the last one is made, s.
fn nominal(task: &Task, runs: &[Planned]) -> (Data, f64) {
    let mut clock_s = 0.0;
    let mut last_mounting: Option<&str> = None;
    let mut touched: Vec<(f64, Vec<Touch>)> = Vec::new();
    let mut measured = Measured::default();
    for run in runs {
        let mounting = run.mounting.as_deref().unwrap_or(&run.plan.mounting);
        let change_s = if last_mounting.is_some_and(|m| m != mounting) { MOUNTING_S } else { 0.0 };
        last_mounting = Some(mounting);
        let started_s = run.started_s.unwrap_or(clock_s + change_s);
        let times = times_s(&run.plan.touches);
        let touches = run
            .plan
            .touches
            .iter()
            .zip(&times)
            .map(|(t, &after_s)| {
                let made = run.made.get(&t.id);
                let time_s = made.and_then(|m| m.time_s).unwrap_or(started_s + after_s);
                clock_s = f64::max(clock_s, time_s);
                let known = made.and_then(|m| m.temperature_deg_c);
                if let Some(deg_c) = known {
                    measured.add(time_s, deg_c);
                }
                let deg_c = known.unwrap_or_else(|| measured.at(time_s, run.room));
                Touch {
                    id: t.id,
                    position: t.nominal_position(),
                    status: Status::Hit,
                    time_s: Some(time_s),
                    digit_mm: None,
                    temperature_deg_c: task.temperature.then_some(deg_c),
                    line: 0,
                }
            })
            .collect();
        touched.push((started_s, touches));
    }
    let spindle = runs.iter().map(|run| &run.spindle[..]).find(|spindle| !spindle.is_empty()).unwrap_or_default();
    let runs: Vec<Run> = runs
        .iter()
        .zip(&touched)
        .map(|(run, (started_s, touches))| Run {
            plan: &run.plan,
            touches,
            mounting: run.mounting.as_deref(),
            started_s: Some(*started_s),
        })
        .collect();
    (assemble_with_spindle(task.machine, &runs, spindle), clock_s)
}

/// When each touch is made, s after the program's begin: the plan's prediction, else ordinary times.
#[must_use]
pub fn times_s(touches: &[PlanTouch]) -> Vec<f64> {
    let mut clock_s = 0.0;
    let mut previous: Option<&PlanTouch> = None;
    let mut out = Vec::with_capacity(touches.len());
    for t in touches {
        let turned = previous.is_none_or(|p| {
            AxisName::ALL.into_iter().any(|a| p.pose.get(a) != t.pose.get(a))
                || p.visit != t.visit
                || p.spindle_deg != t.spindle_deg
        });
        clock_s += TOUCH_S + if turned { INDEX_S } else { 0.0 };
        if let Some(s) = t.time_s {
            clock_s = s;
        }
        out.push(clock_s);
        previous = Some(t);
    }
    out
}
