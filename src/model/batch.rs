//! Many touches at once: what does not change from touch to touch is computed once, and rows hold only the unknowns
//! that their touch sees.
//!
//! Three levels: [`Model::prepare`] evaluates what depends on neither θ nor the iteration (formulas without shape
//! parameters, the rotations of each pose); [`Batch::at`] builds the error transforms that are the same at all touches,
//! or at all touches of a block; what is left per touch is a handful of 3 × 3 products.

use super::catalogue::Place;
use super::formula::slot;
use super::predict::{Active, Changes, Model, Observation};
use super::rigid_motions::{Centre, Placed, Rigid};
use crate::axes::AxisName;
use crate::geometry::Displacement;
use crate::machine::Axis;
use nalgebra::Vector3;
use std::collections::HashMap;

/// Touches ready for many evaluations of one model.
#[derive(Debug)]
pub struct Batch<'a> {
    model: &'a Model,
    observations: &'a [Observation],
    /// Which of `poses` a touch is at.
    pose: Vec<u32>,
    /// Rotations of all rotary axes, workpiece side first, for each distinct pose.
    poses: Vec<Vec<Rigid>>,
    /// Factors whose formula has neither a constant value nor a shape parameter that θ may change: index in `active`.
    varying: Vec<usize>,
    /// Their coefficients, touch by touch.
    coefficients: Vec<f64>,
    /// Actives with a shape parameter: evaluated anew for each θ, those of one formula together.
    shaped: Vec<Vec<usize>>,
    /// Places whose transform is another at every touch.
    moving: Vec<usize>,
    /// What the rows of each block hold.
    entries: Vec<Vec<Entry>>,
    n_rotary_workpiece: usize,
    roles: Roles,
}

/// One displacement of a row: where its slope stands, and by what it is multiplied.
#[derive(Debug, Clone, Copy)]
struct Entry {
    slot: u32,
    component: u32,
    /// Place in the row.
    at: u32,
    active: u32,
    /// Its coefficient; not a number where that changes from touch to touch.
    coefficient: f64,
}

/// Slots outside of the axes.
#[derive(Debug, Clone, Copy)]
struct Roles {
    tool: Option<usize>,
    base: Option<usize>,
    workpiece: Option<usize>,
    block: Option<usize>,
    trigger: Option<usize>,
    reading: Option<usize>,
}

/// Working space; one per thread.
#[derive(Debug, Clone)]
pub struct Scratch {
    displacement: Vec<Displacement>,
    placed: Vec<Placed>,
    gradient: Vec<[f64; 6]>,
    coefficient: Vec<f64>,
    /// Points after each place of the tool chain, in order of application.
    moved: Vec<Vector3<f64>>,
    /// Points in front of each place of the workpiece chain, in order of application.
    met: Vec<Vector3<f64>>,
    /// Rotations of axes whose reading is in error.
    turned: [Option<Rigid>; 6],
}

/// A batch at one θ.
#[derive(Debug)]
pub struct At<'b> {
    batch: &'b Batch<'b>,
    theta: &'b [f64],
    /// Displacements that do not change from touch to touch, by slot; of blocks after that, by set-up and slot.
    displacement: Vec<Displacement>,
    placed: Vec<Placed>,
    n_slots: usize,
}

impl Model {
    /// Where the transform of a slot is stated; a block turns about its own centre.
    fn centre_of(&self, slot: usize, set_up: Option<usize>) -> Centre<'_> {
        let slot = &self.slots[slot];
        match set_up {
            Some(s) if slot.place == Place::Block => (&self.set_ups()[s].centre, None),
            _ => (&slot.centre, slot.frame.as_ref()),
        }
    }

    /// Prepares touches for many evaluations.
    #[must_use]
    pub fn prepare<'a>(&'a self, observations: &'a [Observation]) -> Batch<'a> {
        self.prepare_holding(observations, &[], &|_| false)
    }

    /// The same where some unknowns stay at their values in θ: shape parameters among them count as numbers, and rows say
    /// nothing of them.
    #[must_use]
    pub fn prepare_holding<'a>(
        &'a self,
        observations: &'a [Observation],
        theta: &[f64],
        held: &dyn Fn(usize) -> bool,
    ) -> Batch<'a> {
        let mut batch = self.prepare_places(observations);
        let mut alike: HashMap<(&str, usize), usize> = HashMap::new();
        for (i, a) in self.active.iter().enumerate().filter(|(_, a)| a.constant().is_none()) {
            let formula = &a.term.formula;
            if (0..a.count).all(|shape| !formula.holds(shape) || held(a.first + shape)) {
                batch.varying.push(i);
                continue;
            }
            let group = *alike.entry((formula.text(), a.first)).or_insert(batch.shaped.len());
            if group == batch.shaped.len() {
                batch.shaped.push(Vec::new());
            }
            batch.shaped[group].push(i);
        }
        batch.coefficients.reserve_exact(batch.varying.len() * observations.len());
        for o in observations {
            let mut before: Option<(&str, usize, f64)> = None;
            for &i in &batch.varying {
                let a = &self.active[i];
                if !a.acts_on(o) {
                    batch.coefficients.push(0.0);
                    continue;
                }
                // the components of one effect mostly go by one formula
                let text = a.term.formula.text();
                let value = before.filter(|b| (b.0, b.1) == (text, a.first)).map_or_else(
                    || a.term.formula.eval(&o.state, theta.get(a.first..a.first + a.count).unwrap_or_default()),
                    |b| b.2,
                );
                before = Some((text, a.first, value));
                batch.coefficients.push(a.factor * value);
            }
        }
        batch
    }

    /// The same without the values of formulas: enough where no effect has a size.
    pub(super) fn prepare_places<'a>(&'a self, observations: &'a [Observation]) -> Batch<'a> {
        let mut seen: HashMap<[u64; 3], u32> = HashMap::new();
        let mut poses = Vec::new();
        let pose = observations
            .iter()
            .map(|o| {
                let key = [AxisName::A, AxisName::B, AxisName::C].map(|a| o.position.get(a).to_bits());
                *seen.entry(key).or_insert_with(|| {
                    let all = self.workpiece.iter().chain(&self.tool).filter(|l| l.axis.name.is_rotary());
                    poses.push(all.map(|l| Rigid::of_rotary(&l.axis, &o.position)).collect());
                    (poses.len() - 1) as u32
                })
            })
            .collect();
        let n_common = self.layout.common.len();
        let entry = |(i, a): (usize, &Active)| Entry {
            slot: a.slot as u32,
            component: a.component as u32,
            at: (self.layout.place(a.unknown) + if a.set_up.is_some() { n_common } else { 0 }) as u32,
            active: i as u32,
            coefficient: a.constant().map_or(f64::NAN, |value| a.factor * value),
        };
        let of = |s: usize| self.active.iter().enumerate().filter(move |(_, a)| a.is_seen_at(s));
        let entries = (0..self.set_ups().len()).map(|s| of(s).map(entry).collect()).collect();
        let n_rotary_workpiece = self.workpiece.iter().filter(|l| l.axis.name.is_rotary()).count();
        let roles = Roles {
            tool: self.find(Place::Tool),
            base: self.find(Place::Base),
            workpiece: self.find(Place::Workpiece),
            block: self.find(Place::Block),
            trigger: self.find(Place::Trigger),
            reading: self.find(Place::Reading),
        };
        let moving = (0..self.slots.len()).filter(|&i| self.slots[i].changes == Changes::WithTouch).collect();
        Batch {
            model: self,
            observations,
            pose,
            poses,
            varying: Vec::new(),
            coefficients: Vec::new(),
            shaped: Vec::new(),
            moving,
            entries,
            n_rotary_workpiece,
            roles,
        }
    }
}

impl Batch<'_> {
    /// Number of touches.
    #[must_use]
    pub fn len(&self) -> usize {
        self.observations.len()
    }

    /// True without touches.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.observations.is_empty()
    }

    #[must_use]
    pub fn model(&self) -> &Model {
        self.model
    }

    /// The touches.
    #[must_use]
    pub fn observations(&self) -> &[Observation] {
        self.observations
    }

    /// Working space for this batch.
    #[must_use]
    pub fn scratch(&self) -> Scratch {
        let n = self.model.slots.len();
        let nowhere = Placed::new(&Displacement::default(), (&Vector3::zeros(), None));
        Scratch {
            displacement: vec![Displacement::default(); n],
            placed: vec![nowhere; n],
            gradient: vec![[0.0; 6]; n],
            coefficient: vec![0.0; self.model.active.len()],
            moved: Vec::with_capacity(5 * self.model.tool.len() + 2),
            met: Vec::with_capacity(5 * self.model.workpiece.len() + 2),
            turned: [None; 6],
        }
    }

    /// The batch at θ (each unknown in its unit).
    #[must_use]
    pub fn at<'b>(&'b self, theta: &'b [f64]) -> At<'b> {
        let model = self.model;
        let n_slots = model.slots.len();
        let n_set_ups = model.set_ups().len();
        // the common displacements, then a copy of them for each block with the block's own added
        let mut displacement = vec![Displacement::default(); n_slots];
        for a in model.active.iter().filter(|a| a.set_up.is_none()) {
            if let Some(value) = a.constant() {
                displacement[a.slot].add(a.component, theta[a.unknown] * a.factor * value);
            }
        }
        let mut all = displacement.clone();
        for _ in 0..n_set_ups {
            all.extend_from_slice(&displacement);
        }
        for a in &model.active {
            if let (Some(s), Some(value)) = (a.set_up, a.constant()) {
                all[(1 + s) * n_slots + a.slot].add(a.component, theta[a.unknown] * a.factor * value);
            }
        }
        let placed = all
            .iter()
            .enumerate()
            .map(|(i, d)| Placed::new(d, model.centre_of(i % n_slots, (i / n_slots).checked_sub(1))))
            .collect();
        At { batch: self, theta, displacement: all, placed, n_slots }
    }
}

impl At<'_> {
    /// The gap at a touch, mm: measured less model along the outward normal.
    pub fn gap(&self, touch: usize, scratch: &mut Scratch) -> f64 {
        self.displace(touch, scratch);
        self.evaluate(touch, scratch, false)
    }

    /// The gap at a touch, mm, and its derivatives (mm per unit) with respect to the unknowns of its row
    /// ([`super::predict::Layout::row`]).
    pub fn gap_and_row(&self, touch: usize, scratch: &mut Scratch, row: &mut [f64]) -> f64 {
        self.displace(touch, scratch);
        let gap = self.evaluate(touch, scratch, true);
        row.fill(0.0);
        let (model, o) = (self.batch.model, &self.batch.observations[touch]);
        for e in &self.batch.entries[o.set_up] {
            let coefficient =
                if e.coefficient.is_nan() { scratch.coefficient[e.active as usize] } else { e.coefficient };
            row[e.at as usize] += scratch.gradient[e.slot as usize][e.component as usize] * coefficient;
        }
        for group in &self.batch.shaped {
            let a = &model.active[group[0]];
            if !a.acts_on(o) {
                continue;
            }
            let offset = if a.set_up.is_some() { model.layout.common.len() } else { 0 };
            let all = group.iter().map(|&i| &model.active[i]);
            let amount: f64 =
                all.map(|a| scratch.gradient[a.slot][a.component] * self.theta[a.unknown] * a.factor).sum();
            for (shape, derivative) in a.term.formula.partials(&o.state, &self.theta[a.first..a.first + a.count]) {
                row[offset + model.layout.place(a.first + shape)] += amount * derivative;
            }
        }
        gap
    }

    /// d gap / d displacement at every place of the model (mm per mm, mm per rad), at a touch.
    pub(super) fn slopes<'s>(&self, touch: usize, scratch: &'s mut Scratch) -> &'s [[f64; 6]] {
        self.displace(touch, scratch);
        self.evaluate(touch, scratch, true);
        &scratch.gradient
    }

    /// Displacements and transforms of the places that change from touch to touch.
    fn displace(&self, touch: usize, scratch: &mut Scratch) {
        let (batch, model) = (self.batch, self.batch.model);
        if batch.moving.is_empty() {
            return;
        }
        let o = &batch.observations[touch];
        let base = (1 + o.set_up) * self.n_slots;
        for &i in &batch.moving {
            scratch.displacement[i] = self.displacement[base + i];
        }
        let own = &batch.coefficients[touch * batch.varying.len()..(touch + 1) * batch.varying.len()];
        for (&i, &coefficient) in batch.varying.iter().zip(own) {
            let a = &model.active[i];
            scratch.coefficient[i] = coefficient;
            scratch.displacement[a.slot].add(a.component, self.theta[a.unknown] * coefficient);
        }
        for group in &batch.shaped {
            let first = &model.active[group[0]];
            if !first.acts_on(o) {
                group.iter().for_each(|&i| scratch.coefficient[i] = 0.0);
            } else {
                let value = first.term.formula.eval(&o.state, &self.theta[first.first..first.first + first.count]);
                for (&i, a) in group.iter().map(|i| (i, &model.active[*i])) {
                    scratch.coefficient[i] = a.factor * value;
                    scratch.displacement[a.slot].add(a.component, self.theta[a.unknown] * a.factor * value);
                }
            }
        }
        for &i in &batch.moving {
            scratch.placed[i].set(&scratch.displacement[i], model.centre_of(i, Some(o.set_up)));
        }
    }

    fn evaluate(&self, touch: usize, scratch: &mut Scratch, derive: bool) -> f64 {
        let (batch, model) = (self.batch, self.batch.model);
        let o = &batch.observations[touch];
        let base = (1 + o.set_up) * self.n_slots;
        let Scratch { placed, displacement, gradient, moved, met, turned, .. } = scratch;
        let changes = |i: usize| model.slots[i].changes == Changes::WithTouch;
        let at_slot = |i: usize| -> &Placed { if changes(i) { &placed[i] } else { &self.placed[base + i] } };
        let by_slot =
            |i: usize| -> &Displacement { if changes(i) { &displacement[i] } else { &self.displacement[base + i] } };

        // what the control shows, corrected by the reading's own error
        let mut shown = o.position;
        if let Some(slot) = batch.roles.reading {
            turned.fill(None);
            for link in model.workpiece.iter().chain(&model.tool) {
                let name = link.axis.name;
                let amount = by_slot(slot).get(name.index());
                let by = if name.is_rotary() { crate::units::deg_from_rad(amount) } else { amount };
                shown.set(name, shown.get(name) + by);
                if name.is_rotary() && amount != 0.0 {
                    turned[name.index()] = Some(Rigid::of_rotary(&link.axis, &shown));
                }
            }
        }
        // a late trigger is a way on along the commanded line, against the planned normal: contact was that much before it
        let mut planned = Vector3::zeros();
        if let Some(i) = batch.roles.trigger {
            planned.copy_from_slice(&o.state[slot::NORMAL_IN_R..slot::NORMAL_IN_R + 3]);
            let back = planned * by_slot(i).get(0);
            for link in model.workpiece.iter().chain(&model.tool).filter(|l| !l.axis.name.is_rotary()) {
                let name = link.axis.name;
                shown.set(name, shown.get(name) + back.dot(&link.axis.direction));
            }
        }
        let pose = &batch.poses[batch.pose[touch] as usize];
        let rotary = |axis: &Axis, at: usize| -> &Rigid {
            let by_reading = if batch.roles.reading.is_some() { turned[axis.name.index()].as_ref() } else { None };
            by_reading.unwrap_or(&pose[at])
        };
        let travel =
            |axis: &Axis| -> Vector3<f64> { axis.direction.into_inner() * (axis.travel_sign() * shown.get(axis.name)) };
        // --- the ball from the tool's frame to R
        moved.clear();
        let mut point = o.ball_at_zero;
        if let Some(i) = batch.roles.tool {
            point = at_slot(i).rigid.apply(&point);
            moved.push(point);
        }
        let mut at_rotary = pose.len();
        for link in model.tool.iter().rev() {
            for i in link.after.into_iter().rev().flatten() {
                point = at_slot(i).rigid.apply(&point);
                moved.push(point);
            }
            if link.axis.name.is_rotary() {
                at_rotary -= 1;
                point = rotary(&link.axis, at_rotary).apply(&point);
            } else {
                point += travel(&link.axis);
            }
            moved.push(point);
            for i in link.before.into_iter().rev().flatten() {
                point = at_slot(i).rigid.apply(&point);
                moved.push(point);
            }
        }

        if let Some(i) = batch.roles.base {
            point = at_slot(i).rigid.apply(&point);
            moved.push(point);
        }

        // --- from R into the frame of the touched block
        met.clear();
        let chain = &model.workpiece[..model.carrier_length(model.set_ups()[o.set_up].carrier)];
        let mut at_rotary = 0;
        for link in chain {
            for i in link.before.into_iter().flatten() {
                met.push(point);
                point = at_slot(i).rigid.undo(&point);
            }
            met.push(point);
            if link.axis.name.is_rotary() {
                point = rotary(&link.axis, at_rotary).undo(&point);
                at_rotary += 1;
            } else {
                point -= travel(&link.axis);
            }
            for i in link.after.into_iter().flatten() {
                met.push(point);
                point = at_slot(i).rigid.undo(&point);
            }
        }
        debug_assert!(at_rotary <= batch.n_rotary_workpiece);
        for i in [batch.roles.workpiece, batch.roles.block].into_iter().flatten() {
            met.push(point);
            point = at_slot(i).rigid.undo(&point);
        }
        let (gap, along_gap) = o.surface.gap(&point, o.ball_radius);
        if !derive {
            return gap;
        }

        // --- derivatives: g = d gap / d point is carried back through the same places
        gradient.fill([0.0; 6]);
        let mut along = 0.0;
        let on_line = |axis: &Axis, g: &Vector3<f64>| g.dot(&axis.direction) * planned.dot(&axis.direction);
        let mut g = along_gap;
        // a place on the workpiece side is undone: q = E⁻¹·p, dq = −Rᵀ·dE·q
        let mut back = met.iter().rev();
        let undone = |p: Option<&Vector3<f64>>, i: usize, g: &mut Vector3<f64>, gradient: &mut [[f64; 6]]| {
            if let Some(p) = p {
                let place = at_slot(i);
                *g = place.rigid.r * *g;
                place.slope(g, p, -1.0, &mut gradient[i]);
            }
        };
        for i in [batch.roles.block, batch.roles.workpiece].into_iter().flatten() {
            undone(back.next(), i, &mut g, gradient);
        }
        for link in chain.iter().rev() {
            for i in link.after.into_iter().rev().flatten() {
                undone(back.next(), i, &mut g, gradient);
            }
            if link.axis.name.is_rotary() {
                at_rotary -= 1;
                g = rotary(&link.axis, at_rotary).r * g;
            } else if batch.roles.trigger.is_some() {
                along += on_line(&link.axis, &g);
            }
            if let Some(p) = back.next()
                && let Some(i) = batch.roles.reading
            {
                gradient[i][link.axis.name.index()] -= motion_slope(&link.axis, &g, p);
            }
            for i in link.before.into_iter().rev().flatten() {
                undone(back.next(), i, &mut g, gradient);
            }
        }
        // on the tool side a place is applied
        let mut back = moved.iter().rev();
        let applied = |p: Option<&Vector3<f64>>, i: usize, g: &mut Vector3<f64>, gradient: &mut [[f64; 6]]| {
            if let Some(p) = p {
                let place = at_slot(i);
                place.slope(g, p, 1.0, &mut gradient[i]);
                *g = place.rigid.r.tr_mul(g);
            }
        };
        let mut at_rotary = batch.n_rotary_workpiece;
        if let Some(i) = batch.roles.base {
            applied(back.next(), i, &mut g, gradient);
        }
        for link in &model.tool {
            for i in link.before.into_iter().flatten() {
                applied(back.next(), i, &mut g, gradient);
            }
            if let Some(p) = back.next()
                && let Some(i) = batch.roles.reading
            {
                gradient[i][link.axis.name.index()] += motion_slope(&link.axis, &g, p);
            }
            if link.axis.name.is_rotary() {
                g = rotary(&link.axis, at_rotary).r.tr_mul(&g);
                at_rotary += 1;
            } else if batch.roles.trigger.is_some() {
                along += on_line(&link.axis, &g);
            }
            for i in link.after.into_iter().flatten() {
                applied(back.next(), i, &mut g, gradient);
            }
        }
        if let Some(i) = batch.roles.tool {
            applied(back.next(), i, &mut g, gradient);
        }
        if let Some(i) = batch.roles.trigger {
            gradient[i][0] = along;
        }
        gap
    }
}

/// d gap / d coordinate of an axis (mm or rad), from `g` = d gap / d point in front of its motion.
fn motion_slope(axis: &Axis, g: &Vector3<f64>, moved: &Vector3<f64>) -> f64 {
    let direction = axis.direction.into_inner();
    if axis.name.is_rotary() {
        axis.sense * g.dot(&direction.cross(&(moved - axis.point)))
    } else {
        axis.travel_sign() * g.dot(&direction)
    }
}
