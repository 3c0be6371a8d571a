//! The gap at a touch and its derivatives, for any serial chain.
//!
//! At the trigger the ball's centre stands a ball radius (less the pre-travel) off the real face. With q the ball's
//! centre in the frame of the real block, n and p the nominal normal and contact point, the gap is
//!
//! ```text
//! g(θ) = n·(q − p) − r + trigger(θ)        q = E_block⁻¹ · (carrier chain)⁻¹ · E_base · (tool chain) · ball
//! ```
//!
//! and g = 0 at the true parameters θ. With θ = 0 it is the reading of the method (recorded less nominal, along the
//! outward normal), so g is "measured less model", mm. Errors stand in the chain as exact transforms; nothing is
//! linearised and nothing is expanded for one machine.

use super::catalogue::{Effect, Place, Term};
use super::formula::State;
use crate::axes::{AxisName, Position};
use crate::geometry::{Displacement, Transform, apply};
use crate::machine::{Axis, Carrier, Machine, Side};
use nalgebra::{RowVector3, Vector3};

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
}

/// A block as it stood during a run: what `block-setup` has a set of parameters for.
#[derive(Debug, Clone, PartialEq)]
pub struct SetUp {
    /// `mounting/block`, unique in the study.
    pub label: String,
    /// What bears it.
    pub carrier: Carrier,
    /// Its nominal centre in the carrier's frame, mm.
    pub centre: Vector3<f64>,
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
    /// Radius of the ball.
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
struct Active {
    /// Index of its factor in the unknowns.
    unknown: usize,
    /// Index of the first unknown of its effect: formulas number shape parameters from there.
    first: usize,
    /// Number of parameters of its effect.
    count: usize,
    slot: usize,
    component: usize,
    factor: f64,
    term: Term,
    set_up: Option<usize>,
}

/// A place where displacements act.
#[derive(Debug, Clone, Copy)]
struct Slot {
    place: Place,
    /// The point at which its offsets are stated, mm in R at zero.
    centre: Vector3<f64>,
}

/// Machine and effects, ready to predict.
#[derive(Debug, Clone)]
pub struct Model {
    workpiece: Vec<Axis>,
    n_table: usize,
    tool: Vec<Axis>,
    slots: Vec<Slot>,
    active: Vec<Active>,
    set_ups: Vec<SetUp>,
    /// The unknowns, in the order of θ.
    pub unknowns: Vec<Unknown>,
    /// Where location errors of workpiece-side axes are stated, mm in R.
    pub reference: Vector3<f64>,
}

/// Working space of a prediction; one per thread.
#[derive(Debug, Clone)]
pub struct Scratch {
    displacement: Vec<Displacement>,
    /// d gap / d component, per slot.
    gradient: Vec<[f64; 6]>,
    coefficient: Vec<f64>,
    /// Suffix points of the tool chain, in the order of the chain.
    points: Vec<Vector3<f64>>,
}

/// An error transform at its place: index of the slot, the point at which offsets are stated (mm), the transform.
type Placed = (usize, Vector3<f64>, Transform);

impl Model {
    /// Puts effects into a machine's chain.
    #[must_use]
    pub fn new(machine: &Machine, effects: &[&Effect], set_ups: &[SetUp], reference: Vector3<f64>) -> Self {
        let mut model = Self {
            workpiece: machine.side(Side::Workpiece).cloned().collect(),
            n_table: machine.carrier_chain(Carrier::Table).len(),
            tool: machine.side(Side::Tool).cloned().collect(),
            slots: Vec::new(),
            active: Vec::new(),
            set_ups: set_ups.to_vec(),
            unknowns: Vec::new(),
            reference,
        };
        for effect in effects {
            let instances: Vec<Option<usize>> =
                if effect.per_block { (0..set_ups.len()).map(Some).collect() } else { vec![None] };
            for set_up in instances {
                model.put(machine, effect, set_up);
            }
        }
        model
    }

    fn put(&mut self, machine: &Machine, effect: &Effect, set_up: Option<usize>) {
        let first = self.unknowns.len();
        for (i, p) in effect.parameters.iter().enumerate() {
            let at_reference = effect.terms.iter().any(|t| {
                t.parameter == i
                    && matches!(t.place, Place::Before(a) if a.is_rotary() && machine.axis(a).is_some_and(|x| x.side == Side::Workpiece))
            });
            self.unknowns.push(Unknown {
                name: match set_up {
                    Some(s) => format!("{}@{}", p.name, self.set_ups[s].label),
                    None => p.name.clone(),
                },
                alias: p.alias.clone(),
                effect: effect.id.clone(),
                unit: p.unit.clone(),
                factor: p.factor,
                typical: p.typical,
                nuisance: effect.nuisance,
                start: p.shape.map_or(0.0, |(start, _, _)| start),
                at_reference,
            });
        }
        for term in &effect.terms {
            let slot = self.slot(machine, term.place);
            self.active.push(Active {
                unknown: first + term.parameter,
                first,
                count: effect.parameters.len(),
                slot,
                component: term.component,
                factor: effect.parameters[term.parameter].factor,
                term: term.clone(),
                set_up,
            });
        }
    }

    fn slot(&mut self, machine: &Machine, place: Place) -> usize {
        if let Some(i) = self.slots.iter().position(|s| s.place == place) {
            return i;
        }
        let centre = match place {
            Place::Before(name) | Place::After(name) if name.is_rotary() => match machine.axis(name) {
                Some(axis) if axis.side == Side::Tool => axis.point,
                _ => self.reference,
            },
            // a tilt of the tool is one of the tool in its holder
            Place::Tool => machine.tool.pivot,
            // a carriage's own coordinates are those of R at zero
            _ => Vector3::zeros(),
        };
        self.slots.push(Slot { place, centre });
        self.slots.len() - 1
    }

    /// Number of unknowns.
    #[must_use]
    pub fn n_unknowns(&self) -> usize {
        self.unknowns.len()
    }

    /// The set-ups of the blocks.
    #[must_use]
    pub fn set_ups(&self) -> &[SetUp] {
        &self.set_ups
    }

    /// Working space for this model.
    #[must_use]
    pub fn scratch(&self) -> Scratch {
        Scratch {
            displacement: vec![Displacement::default(); self.slots.len()],
            gradient: vec![[0.0; 6]; self.slots.len()],
            coefficient: vec![0.0; self.active.len()],
            points: Vec::with_capacity(2 * self.tool.len() + 1),
        }
    }

    /// θ at which the search begins.
    #[must_use]
    pub fn start(&self) -> Vec<f64> {
        self.unknowns.iter().map(|u| u.start).collect()
    }

    /// The gap at a touch, mm: measured less model along the outward normal.
    #[must_use]
    pub fn gap(&self, touch: &Observation, theta: &[f64], scratch: &mut Scratch) -> f64 {
        self.displace(touch, theta, scratch);
        self.evaluate(touch, scratch, false)
    }

    /// The gap at a touch, mm, and its derivatives with respect to every unknown (mm per unit) into `row`.
    pub fn gap_and_row(&self, touch: &Observation, theta: &[f64], scratch: &mut Scratch, row: &mut [f64]) -> f64 {
        self.displace(touch, theta, scratch);
        let gap = self.evaluate(touch, scratch, true);
        row.fill(0.0);
        for (i, a) in self.active.iter().enumerate() {
            if a.set_up.is_some_and(|s| s != touch.set_up) {
                continue;
            }
            let slope = scratch.gradient[a.slot][a.component];
            if slope == 0.0 {
                continue;
            }
            row[a.unknown] += slope * scratch.coefficient[i];
            if a.term.formula.has_shape() {
                let amount = theta[a.unknown] * a.factor;
                for (shape, derivative) in a.term.formula.partials(&touch.state, &theta[a.first..a.first + a.count]) {
                    row[a.first + shape] += slope * amount * derivative;
                }
            }
        }
        gap
    }

    /// Displacements of all slots at a touch.
    fn displace(&self, touch: &Observation, theta: &[f64], scratch: &mut Scratch) {
        scratch.displacement.fill(Displacement::default());
        for (i, a) in self.active.iter().enumerate() {
            if a.set_up.is_some_and(|s| s != touch.set_up) {
                continue;
            }
            let coefficient = a.factor * a.term.formula.eval(&touch.state, &theta[a.first..a.first + a.count]);
            scratch.coefficient[i] = coefficient;
            scratch.displacement[a.slot].add(a.component, theta[a.unknown] * coefficient);
        }
    }

    fn find(&self, place: Place) -> Option<usize> {
        self.slots.iter().position(|s| s.place == place)
    }

    /// What a control shows for an axis, corrected by the reading's own error.
    fn position(&self, touch: &Observation, scratch: &Scratch) -> Position {
        let mut at = touch.position;
        if let Some(slot) = self.find(Place::Reading) {
            for name in AxisName::ALL {
                let amount = scratch.displacement[slot].get(name.index());
                let shown = if name.is_rotary() { crate::units::deg_from_rad(amount) } else { amount };
                at.set(name, at.get(name) + shown);
            }
        }
        at
    }

    /// Number of workpiece-side axes between the base and the touched block.
    fn carrier_length(&self, carrier: Carrier) -> usize {
        match carrier {
            Carrier::Base => 0,
            Carrier::Table => self.n_table,
            Carrier::Axis(name) => self.workpiece.iter().position(|a| a.name == name).map_or(0, |i| i + 1),
        }
    }

    fn evaluate(&self, touch: &Observation, scratch: &mut Scratch, derive: bool) -> f64 {
        let set_up = &self.set_ups[touch.set_up];
        let at = self.position(touch, scratch);
        let at_slot = |slot: Option<usize>, centre: Option<Vector3<f64>>| -> Option<Placed> {
            let i = slot?;
            let centre = centre.unwrap_or(self.slots[i].centre);
            Some((i, centre, scratch.displacement[i].transform_about(&centre)))
        };
        let reading = self.find(Place::Reading);

        // --- the ball from the tool's frame to R, remembering the point behind each place
        let tool_slot = at_slot(self.find(Place::Tool), None);
        let mut point = touch.ball_at_zero;
        let mut behind: Vec<Vector3<f64>> = std::mem::take(&mut scratch.points);
        behind.clear();
        behind.push(point);
        if let Some((_, _, e)) = &tool_slot {
            point = apply(e, &point);
        }
        struct Link<'a> {
            axis: &'a Axis,
            motion: Transform,
            before: Option<Placed>,
            after: Option<Placed>,
        }
        let link = |axis: &'_ Axis| -> (Transform, Option<Placed>, Option<Placed>) {
            (
                axis.motion(&at),
                at_slot(self.find(Place::Before(axis.name)), None),
                at_slot(self.find(Place::After(axis.name)), None),
            )
        };
        let tool: Vec<Link> = self
            .tool
            .iter()
            .map(|axis| {
                let (motion, before, after) = link(axis);
                Link { axis, motion, before, after }
            })
            .collect();
        for l in tool.iter().rev() {
            behind.push(point);
            if let Some((_, _, e)) = &l.after {
                point = apply(e, &point);
            }
            point = apply(&l.motion, &point);
            behind.push(point);
            if let Some((_, _, e)) = &l.before {
                point = apply(e, &point);
            }
        }
        let base_slot = at_slot(self.find(Place::Base), None);
        let in_r = point;
        if let Some((_, _, e)) = &base_slot {
            point = apply(e, &point);
        }

        // --- from R into the frame of the touched block
        let workpiece: Vec<Link> = self.workpiece[..self.carrier_length(set_up.carrier)]
            .iter()
            .map(|axis| {
                let (motion, before, after) = link(axis);
                Link { axis, motion, before, after }
            })
            .collect();
        let mut ahead: Vec<(Vector3<f64>, Vector3<f64>)> = Vec::with_capacity(workpiece.len());
        for l in &workpiece {
            if let Some((_, _, e)) = &l.before {
                point = apply(&e.inverse(), &point);
            }
            let after_before = point;
            point = apply(&l.motion.inverse(), &point);
            if let Some((_, _, e)) = &l.after {
                point = apply(&e.inverse(), &point);
            }
            ahead.push((after_before, point));
        }
        let work_slot = at_slot(self.find(Place::Workpiece), None);
        if let Some((_, _, e)) = &work_slot {
            point = apply(&e.inverse(), &point);
        }
        let in_carrier = point;
        let block_slot = at_slot(self.find(Place::Block), Some(set_up.centre));
        if let Some((_, _, e)) = &block_slot {
            point = apply(&e.inverse(), &point);
        }
        let trigger = self.find(Place::Trigger);
        let late = trigger.map_or(0.0, |i| scratch.displacement[i].get(0));
        let gap = touch.normal.dot(&(point - touch.point)) - touch.ball_radius + late;
        if !derive {
            scratch.points = behind;
            return gap;
        }

        // --- derivatives: the row g = d gap / d point is carried back through the same places
        let displacement = scratch.displacement.clone();
        let gradient = &mut scratch.gradient;
        for g in gradient.iter_mut() {
            *g = [0.0; 6];
        }
        if let Some(i) = trigger {
            gradient[i][0] = 1.0;
        }
        // a place on the workpiece side is undone: q = E⁻¹·p, dq = −Rᵀ·dE·q
        let undo =
            |slot: &Placed, g: RowVector3<f64>, behind: &Vector3<f64>, gradient: &mut [[f64; 6]]| -> RowVector3<f64> {
                let (i, centre, e) = slot;
                let g = g * e.rotation.inverse().to_rotation_matrix().matrix();
                let turned = g * displacement[*i].rotation_derivative(&(behind - centre));
                for k in 0..3 {
                    gradient[*i][k] -= g[k];
                    gradient[*i][k + 3] -= turned[k];
                }
                g
            };
        let mut g: RowVector3<f64> = touch.normal.transpose();
        if let Some(slot) = &block_slot {
            g = undo(slot, g, &point, gradient);
        }
        if let Some(slot) = &work_slot {
            // the workpiece's own slot lies between carrier and block
            g = undo(slot, g, &in_carrier, gradient);
        }
        for (l, (after_before, after_all)) in workpiece.iter().zip(&ahead).rev() {
            if let Some(slot) = &l.after {
                g = undo(slot, g, after_all, gradient);
            }
            g *= l.motion.rotation.inverse().to_rotation_matrix().matrix();
            if let Some(i) = reading {
                gradient[i][l.axis.name.index()] -= motion_slope(l.axis, &g, after_before);
            }
            if let Some(slot) = &l.before {
                g = undo(slot, g, after_before, gradient);
            }
        }
        if let Some((i, centre, e)) = &base_slot {
            add(&mut gradient[*i], &g, &displacement[*i], &(in_r - centre));
            g *= e.rotation.to_rotation_matrix().matrix();
        }
        let mut at_point = behind.len();
        for l in &tool {
            at_point -= 1;
            let moved = behind[at_point];
            if let Some((i, centre, e)) = &l.before {
                add(&mut gradient[*i], &g, &displacement[*i], &(moved - centre));
                g *= e.rotation.to_rotation_matrix().matrix();
            }
            if let Some(i) = reading {
                gradient[i][l.axis.name.index()] += motion_slope(l.axis, &g, &moved);
            }
            g *= l.motion.rotation.to_rotation_matrix().matrix();
            at_point -= 1;
            if let Some((i, centre, e)) = &l.after {
                add(&mut gradient[*i], &g, &displacement[*i], &(behind[at_point] - centre));
                g *= e.rotation.to_rotation_matrix().matrix();
            }
        }
        if let Some((i, centre, _)) = &tool_slot {
            add(&mut gradient[*i], &g, &displacement[*i], &(behind[0] - centre));
        }
        scratch.points = behind;
        gap
    }
}

/// Adds the derivatives of E·v: `g` is d gap / d (E·v), `v` relative to the centre of the place.
fn add(gradient: &mut [f64; 6], g: &RowVector3<f64>, at: &Displacement, v: &Vector3<f64>) {
    let turned = g * at.rotation_derivative(v);
    for k in 0..3 {
        gradient[k] += g[k];
        gradient[k + 3] += turned[k];
    }
}

/// d gap / d coordinate of an axis (mm or rad), from `g` = d gap / d point in front of its motion.
fn motion_slope(axis: &Axis, g: &RowVector3<f64>, moved: &Vector3<f64>) -> f64 {
    let direction = axis.direction.into_inner();
    if axis.name.is_rotary() {
        axis.sense * (g * direction.cross(&(moved - axis.point)))[0]
    } else {
        let sign = if axis.side == Side::Workpiece { -1.0 } else { 1.0 };
        sign * (g * direction)[0]
    }
}
