//! The gap at a touch and its derivatives, for any serial chain.
//!
//! At contact the ball's centre stands a ball radius off the real face. With q the ball's centre in the frame of the real
//! block, n and p the nominal normal and contact point, the gap is
//!
//! ```text
//! g(θ) = n·(q − p) − r        q = E_block⁻¹ · (carrier chain)⁻¹ · E_base · (tool chain) · ball
//! ```
//!
//! on a face; on a sphere or a cylinder it is the distance from the real surface (`surface.rs`),
//! with the linear axes where they stood at contact: a trigger that comes late has let them go on by as much along the
//! commanded line, against the planned normal. g = 0 at the true parameters θ. With θ = 0 it is the reading of the method
//! (recorded less nominal, along the outward normal), so g is "measured less model", mm. Errors stand in the chain as
//! exact transforms; nothing is linearised and nothing is expanded for one machine.

use super::catalogue::{About, Effect, Place, Term};
use super::formula::State;
use super::reference_points::{Stated, own_frame, own_point, stated};
use super::surface::{Body, Surface};
use crate::axes::Position;
use crate::machine::{Axis, Carrier, Machine, Side};
use nalgebra::{Matrix3, Vector3};

/// One unknown of a model.
#[derive(Debug, Clone)]
pub struct Unknown {
    /// Name, the ISO form where there is one; block parameters carry `@mounting/block`.
    pub name: String,
    /// The paper's symbol.
    pub alias: Option<String>,
    /// Id of its effect.
    pub effect: String,
    /// Its unit, for people; values of θ are in it.
    pub unit: String,
    /// Its unit in mm, rad or a ratio.
    pub factor: f64,
    /// Usual size, in the unit.
    pub typical: f64,
    /// Solved for, but no result.
    pub nuisance: bool,
    /// Where the search begins, in the unit.
    pub start: f64,
    /// A location error of a workpiece-side rotary axis: it is stated at the reference point.
    pub at_reference: bool,
    /// The block that it is of.
    pub set_up: Option<usize>,
    /// It stands inside a formula and scales nothing by itself.
    pub shape: bool,
}

impl Unknown {
    /// Where a block stands: solved for, and in no table of results.
    #[must_use]
    pub fn is_set_up(&self) -> bool {
        self.nuisance && self.set_up.is_some()
    }

    /// Its name without the block that it is of.
    #[must_use]
    pub fn own_name(&self) -> &str {
        self.name.split('@').next().unwrap_or_default()
    }

    /// Label of the block that it is of.
    #[must_use]
    pub fn block(&self) -> Option<&str> {
        self.name.split_once('@').map(|(_, block)| block)
    }
}

/// A block as it stood during a run: what `block-setup` has a set of parameters for.
#[derive(Debug, Clone, PartialEq)]
pub struct SetUp {
    /// `mounting/block`, unique in the study.
    pub label: String,
    /// What bears it.
    pub carrier: Carrier,
    /// What is unknown of its place.
    pub body: Body,
    /// Its nominal centre in the carrier's frame, mm.
    pub centre: Vector3<f64>,
    /// The runs in which it was touched, from 0.
    pub runs: Vec<usize>,
}

/// How the parameters of a run are called, behind `@`: runs are counted from 1.
fn run_label(run: usize) -> String {
    format!("run{}", run + 1)
}

/// Is this the name of a parameter of one run?
#[must_use]
pub fn is_of_a_run(name: &str) -> bool {
    name.split_once("@run").is_some_and(|(_, number)| number.parse::<usize>().is_ok())
}

/// One usable touch, ready for the model. Lengths mm, carrier's frame where not said otherwise.
#[derive(Debug, Clone)]
pub struct Observation {
    /// Which run of the study, from 0.
    pub run: usize,
    /// Number in the plan.
    pub id: u64,
    /// Index of the block's set-up.
    pub set_up: usize,
    /// Nominal contact point.
    pub point: Vector3<f64>,
    /// Outward unit normal.
    pub normal: Vector3<f64>,
    /// What was touched.
    pub surface: Surface,
    pub ball_radius: f64,
    /// Ball's centre at zero, in R.
    pub ball_at_zero: Vector3<f64>,
    /// Axis positions at the trigger.
    pub position: Position,
    /// What formulas see.
    pub state: State,
    /// True when the touch carries a temperature.
    pub has_temperature: bool,
}

/// A displacement of the model with its place resolved.
#[derive(Debug, Clone)]
pub(super) struct Active {
    /// Index of its factor in the unknowns.
    pub unknown: usize,
    /// Index of the first unknown of its effect: formulas number shape parameters from there.
    pub first: usize,
    /// Number of parameters of its effect.
    pub count: usize,
    /// Where it acts.
    pub slot: usize,
    pub component: usize,
    pub factor: f64,
    pub term: Term,
    /// The block that it is of.
    pub set_up: Option<usize>,
    /// The run that it is of.
    pub run: Option<usize>,
    /// By set-up: does it act on this body? Empty: on all.
    pub on: Vec<bool>,
}

impl Active {
    /// Does it act on a touch?
    #[inline]
    pub fn acts_on(&self, touch: &Observation) -> bool {
        self.acts_in(touch.set_up, touch.run)
    }

    /// Does it act on touches of this body in this run?
    #[inline]
    pub fn acts_in(&self, set_up: usize, run: usize) -> bool {
        self.is_seen_at(set_up) && self.run.is_none_or(|own| own == run)
    }

    /// Does it act on all touches?
    pub fn acts_everywhere(&self) -> bool {
        self.set_up.is_none() && self.run.is_none() && self.on.is_empty()
    }

    /// Does it act on touches of this body?
    #[inline]
    pub fn is_seen_at(&self, set_up: usize) -> bool {
        self.set_up.is_none_or(|own| own == set_up) && self.on.get(set_up).is_none_or(|acts| *acts)
    }

    /// Its formula's value where that is one number at all touches of its block.
    #[inline]
    pub fn constant(&self) -> Option<f64> {
        self.term.formula.constant().filter(|_| self.run.is_none() && self.on.is_empty())
    }
}

/// One set of an effect's parameters: of all touches, of a block, or of a run.
#[derive(Debug, Clone, Copy, Default)]
struct Instance {
    set_up: Option<usize>,
    run: Option<usize>,
}

/// The runs in which blocks were touched, in order.
fn runs_of(set_ups: &[SetUp]) -> Vec<usize> {
    let mut runs: Vec<usize> = set_ups.iter().flat_map(|s| s.runs.iter().copied()).collect();
    runs.sort_unstable();
    runs.dedup();
    runs
}

/// The sets of parameters that an effect has where these blocks stand.
fn instances_of(effect: &Effect, set_ups: &[SetUp]) -> Vec<Instance> {
    if effect.per_block {
        let has = |s: &usize| effect.of.is_empty() || effect.of.contains(&set_ups[*s].body);
        return (0..set_ups.len()).filter(has).map(|s| Instance { set_up: Some(s), run: None }).collect();
    }
    if effect.per_run {
        return runs_of(set_ups).into_iter().skip(1).map(|run| Instance { set_up: None, run: Some(run) }).collect();
    }
    vec![Instance::default()]
}

/// A place where displacements act.
#[derive(Debug, Clone, Copy)]
pub(super) struct Slot {
    pub place: Place,
    /// Errors of a rotary axis on its own line act beside its location errors.
    pub own_line: bool,
    /// The point at which its offsets are stated, mm in R at zero.
    pub centre: Vector3<f64>,
    /// Along which directions its components count (columns, in R), where they are not those of R.
    pub frame: Option<Matrix3<f64>>,
    /// What its displacement depends on.
    pub changes: Changes,
}

/// How often the displacement of a place must be computed for one θ.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Changes {
    /// Once.
    Never,
    /// Once for each block.
    WithSetUp,
    WithTouch,
}

/// An axis of the chain with the places in front of and behind its motion, from the base on:
/// location errors · own line · motion · own line · location errors.
#[derive(Debug, Clone)]
pub(super) struct Link {
    pub axis: Axis,
    pub before: [Option<usize>; 2],
    pub after: [Option<usize>; 2],
}

/// What a turn of a linear axis about the ball's point is besides the same turn about the centre of its place, `lever` from
/// the ball's point to that centre: displacements ω × lever, as (component, mm per rad).
fn lever_of(effect: &Effect, term: &Term, lever: &Vector3<f64>) -> Vec<(usize, f64)> {
    match term.place {
        Place::Before(axis) | Place::After(axis)
            if effect.about == Some(About::Ball) && term.component >= 3 && !axis.is_rotary() =>
        {
            let mut turn = Vector3::zeros();
            turn[term.component - 3] = 1.0;
            let moved = turn.cross(lever);
            (0..3).map(|k| (k, moved[k])).filter(|(_, amount)| *amount != 0.0).collect()
        }
        _ => Vec::new(),
    }
}

/// Machine and effects, ready to predict.
#[derive(Debug, Clone)]
pub struct Model {
    pub(super) workpiece: Vec<Link>,
    n_table: usize,
    pub(super) tool: Vec<Link>,
    pub(super) slots: Vec<Slot>,
    pub(super) active: Vec<Active>,
    set_ups: Vec<SetUp>,
    /// The unknowns, in the order of θ.
    pub unknowns: Vec<Unknown>,
    /// Where location errors of workpiece-side axes are stated, mm in R.
    pub reference: Vector3<f64>,
    /// Unknowns that every touch sees, and those of each block.
    pub(super) layout: Layout,
    /// Unknowns of each effect, once for each block where it is of a block: (first, count).
    instances: Vec<Vec<(usize, usize)>>,
}

/// Which unknowns the row of a touch holds: the common ones first, then those of its block. The rows of a large
/// problem are short because a touch sees one block only.
#[derive(Debug, Clone, Default)]
pub struct Layout {
    /// Unknowns of no block, in the order of θ.
    pub common: Vec<usize>,
    /// Unknowns of each block.
    pub own: Vec<Vec<usize>>,
    /// Place of each unknown in the rows that hold it.
    at: Vec<usize>,
}

impl Layout {
    /// The unknowns of a row, in its order.
    pub fn row(&self, set_up: usize) -> impl Iterator<Item = usize> + '_ {
        self.common.iter().copied().chain(self.own.get(set_up).into_iter().flatten().copied())
    }

    #[must_use]
    pub fn row_length(&self, set_up: usize) -> usize {
        self.common.len() + self.own.get(set_up).map_or(0, Vec::len)
    }

    /// Place of an unknown in the rows that hold it.
    #[must_use]
    pub fn place(&self, unknown: usize) -> usize {
        self.at[unknown]
    }
}

impl Model {
    /// Puts effects into a machine's chain.
    #[must_use]
    pub fn new(machine: &Machine, effects: &[&Effect], set_ups: &[SetUp], reference: Vector3<f64>) -> Self {
        let bare = |side| -> Vec<Link> {
            machine.side(side).map(|axis| Link { axis: axis.clone(), before: [None; 2], after: [None; 2] }).collect()
        };
        let mut model = Self {
            workpiece: bare(Side::Workpiece),
            n_table: machine.carrier_chain(Carrier::Table).len(),
            tool: bare(Side::Tool),
            slots: Vec::new(),
            active: Vec::new(),
            set_ups: set_ups.to_vec(),
            unknowns: Vec::new(),
            reference,
            layout: Layout { own: vec![Vec::new(); set_ups.len()], ..Layout::default() },
            instances: Vec::new(),
        };
        for effect in effects {
            let mut own = Vec::new();
            for instance in instances_of(effect, set_ups) {
                own.push((model.n_unknowns(), effect.parameters.len()));
                model.put(machine, effect, instance);
            }
            model.instances.push(own);
        }
        let places: Vec<(Place, bool)> = model.slots.iter().map(|s| (s.place, s.own_line)).collect();
        let find = |place: Place, own_line: bool| places.iter().position(|p| *p == (place, own_line));
        for link in model.workpiece.iter_mut().chain(&mut model.tool) {
            let (before, after) = (Place::Before(link.axis.name), Place::After(link.axis.name));
            link.before = [find(before, false), find(before, true)];
            link.after = [find(after, true), find(after, false)];
        }
        model
    }

    fn put(&mut self, machine: &Machine, effect: &Effect, Instance { set_up, run }: Instance) {
        let first = self.unknowns.len();
        for (i, p) in effect.parameters.iter().enumerate() {
            let at_reference =
                effect.terms.iter().any(|t| t.parameter == i && stated(machine, effect, t) == Stated::Reference);
            let list = match set_up {
                Some(s) => &mut self.layout.own[s],
                None => &mut self.layout.common,
            };
            self.layout.at.push(list.len());
            list.push(self.unknowns.len());
            self.unknowns.push(Unknown {
                name: match (set_up, run) {
                    (Some(s), _) => format!("{}@{}", p.name, self.set_ups[s].label),
                    (None, Some(run)) => format!("{}@{}", p.name, run_label(run)),
                    (None, None) => p.name.clone(),
                },
                alias: p.alias.clone(),
                effect: effect.id.clone(),
                unit: p.unit.clone(),
                factor: p.factor,
                typical: p.typical,
                nuisance: effect.nuisance,
                start: p.shape.map_or(0.0, |(start, _, _)| start),
                at_reference,
                set_up,
                shape: p.shape.is_some(),
            });
        }
        for term in &effect.terms {
            let slot = self.slot(machine, term.place, stated(machine, effect, term));
            // an effect of some bodies that has one set of parameters for all of them; a trigger where a probe has triggered
            let has_it = |s: &SetUp| set_up.is_some() || effect.of.is_empty() || effect.of.contains(&s.body);
            let acts = |s: &SetUp| has_it(s) && (term.place != Place::Trigger || s.body.is_touched());
            let on: Vec<bool> = self.set_ups.iter().map(acts).collect();
            let on = if on.contains(&false) { on } else { Vec::new() };
            let everywhere = term.formula.constant().filter(|_| run.is_none() && on.is_empty());
            let changes = match (everywhere, set_up) {
                (None, _) => Changes::WithTouch,
                (Some(_), Some(_)) => Changes::WithSetUp,
                (Some(_), None) => Changes::Never,
            };
            self.slots[slot].changes = self.slots[slot].changes.max(changes);
            let factor = effect.parameters[term.parameter].factor;
            let mut act = |component: usize, factor: f64| {
                self.active.push(Active {
                    unknown: first + term.parameter,
                    first,
                    count: effect.parameters.len(),
                    slot,
                    component,
                    factor,
                    term: term.clone(),
                    set_up,
                    run,
                    on: on.clone(),
                });
            };
            act(term.component, factor);
            let lever = self.slots[slot].centre - machine.reference.ball;
            for (component, amount) in lever_of(effect, term, &lever) {
                act(component, factor * amount);
            }
        }
    }

    fn slot(&mut self, machine: &Machine, place: Place, stated: Stated) -> usize {
        let own_line = stated == Stated::OwnLine;
        if let Some(i) = self.slots.iter().position(|s| (s.place, s.own_line) == (place, own_line)) {
            return i;
        }
        let axis = match place {
            Place::Before(name) | Place::After(name) => machine.axis(name),
            _ => None,
        };
        let (centre, frame) = match (stated, axis) {
            (Stated::Reference, _) => (self.reference, None),
            (Stated::AxisPoint, Some(axis)) => (axis.point, None),
            (Stated::OwnLine, Some(axis)) => (own_point(machine, axis), own_frame(axis)),
            // a tilt of the tool is one of the tool in its holder
            _ if place == Place::Tool => (machine.tool.pivot, None),
            // a carriage's own coordinates are those of R at zero
            _ => (Vector3::zeros(), None),
        };
        // a block turns about its own centre
        let changes = if place == Place::Block { Changes::WithSetUp } else { Changes::Never };
        self.slots.push(Slot { place, own_line, centre, frame, changes });
        self.slots.len() - 1
    }

    /// Unknowns of an effect (its index among the effects), once for each block where it is of a block: (first, count).
    #[must_use]
    pub fn instances(&self, effect: usize) -> &[(usize, usize)] {
        self.instances.get(effect).map_or(&[], Vec::as_slice)
    }

    /// The same of all effects, in the order of θ.
    pub fn all_instances(&self) -> impl Iterator<Item = (usize, usize)> + '_ {
        self.instances.iter().flatten().copied()
    }

    /// Number of unknowns.
    #[must_use]
    pub fn n_unknowns(&self) -> usize {
        self.unknowns.len()
    }

    /// The axes of the machine, X to C.
    #[must_use]
    pub fn axes(&self) -> Vec<crate::axes::AxisName> {
        let mut names: Vec<_> = self.workpiece.iter().chain(&self.tool).map(|l| l.axis.name).collect();
        names.sort_by_key(|n| n.index());
        names
    }

    /// Does an error of this axis move the ball against the touched block? Blocks beside a turntable do not see it.
    #[must_use]
    pub fn sees(&self, axis: crate::axes::AxisName, touch: &Observation) -> bool {
        let carried = self.carrier_length(self.set_ups[touch.set_up].carrier);
        self.tool.iter().chain(&self.workpiece[..carried]).any(|l| l.axis.name == axis)
    }

    /// Can an effect be told apart from nothing in these runs? One that says how a run differs from the first needs two, one of
    /// spheres needs a sphere.
    #[must_use]
    pub fn has_parameters_of(&self, effect: &Effect) -> bool {
        let of_triggers = effect.terms.iter().all(|t| t.place == Place::Trigger);
        let has_it = |s: &SetUp| effect.of.is_empty() || effect.of.contains(&s.body);
        let acts = |s: &SetUp| has_it(s) && (s.body.is_touched() || !of_triggers);
        !instances_of(effect, &self.set_ups).is_empty() && (self.set_ups.is_empty() || self.set_ups.iter().any(acts))
    }

    /// The set-ups of the blocks.
    #[must_use]
    pub fn set_ups(&self) -> &[SetUp] {
        &self.set_ups
    }

    /// Which unknowns the row of a touch holds.
    #[must_use]
    pub fn layout(&self) -> &Layout {
        &self.layout
    }

    /// θ at which the search begins.
    #[must_use]
    pub fn start(&self) -> Vec<f64> {
        self.unknowns.iter().map(|u| u.start).collect()
    }

    pub(super) fn find(&self, place: Place) -> Option<usize> {
        self.slots.iter().position(|s| s.place == place)
    }

    /// Number of workpiece-side axes between the base and the touched block.
    pub(super) fn carrier_length(&self, carrier: Carrier) -> usize {
        match carrier {
            Carrier::Base => 0,
            Carrier::Table => self.n_table,
            Carrier::Axis(name) => self.workpiece.iter().position(|l| l.axis.name == name).map_or(0, |i| i + 1),
        }
    }

    /// Where location errors are least correlated: at the middle of the touched points instead of the reference.
    /// (offset, tilt, lever): the offset at the reference is that at the middle plus lever × tilt, in their units.
    #[must_use]
    pub fn least_correlated(&self, observations: &[Observation]) -> Vec<(usize, usize, f64)> {
        let mut out = Vec::new();
        for link in self.workpiece.iter().filter(|l| l.axis.name.is_rotary()) {
            let [Some(slot), _] = link.before else { continue };
            let seen = |o: &&Observation| {
                let carrier = self.set_ups[o.set_up].carrier;
                self.workpiece[..self.carrier_length(carrier)].iter().any(|l| l.axis.name == link.axis.name)
            };
            let (mut sum, mut n) = (Vector3::zeros(), 0.0);
            for o in observations.iter().filter(seen) {
                sum += o.point;
                n += 1.0;
            }
            if n == 0.0 {
                continue;
            }
            // a constant tilt w about the reference moves the middle by w × (middle − reference)
            let lever = self.reference - sum / n;
            let constant = |a: &&Active| a.slot == slot && a.set_up.is_none() && a.constant().is_some();
            for tilt in self.active.iter().filter(constant).filter(|a| a.component >= 3) {
                let mut axis = Vector3::zeros();
                axis[tilt.component - 3] = tilt.factor;
                let moved = axis.cross(&lever);
                for offset in self.active.iter().filter(constant).filter(|a| a.component < 3) {
                    let amount = moved[offset.component] / offset.factor;
                    if amount != 0.0 {
                        out.push((offset.unknown, tilt.unknown, amount));
                    }
                }
            }
        }
        out
    }

    /// The gap at one touch, mm: measured less model along the outward normal. For many touches: [`Model::prepare`].
    #[must_use]
    pub fn gap(&self, touch: &Observation, theta: &[f64]) -> f64 {
        let batch = self.prepare(std::slice::from_ref(touch));
        batch.at(theta).gap(0, &mut batch.scratch())
    }

    /// The gap at one touch, mm, and its derivatives with respect to every unknown (mm per unit) into `row`.
    pub fn gap_and_row(&self, touch: &Observation, theta: &[f64], row: &mut [f64]) -> f64 {
        let batch = self.prepare(std::slice::from_ref(touch));
        let mut short = vec![0.0; self.layout.row_length(touch.set_up)];
        let gap = batch.at(theta).gap_and_row(0, &mut batch.scratch(), &mut short);
        row.fill(0.0);
        for (value, unknown) in short.iter().zip(self.layout.row(touch.set_up)) {
            row[unknown] = *value;
        }
        gap
    }
}
