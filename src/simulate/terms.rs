//! What is wrong with the virtual machine: terms, each an amount times a function of the state at a place of the chain.

use super::own::formula::Formula;
use super::rigid::{Vec3, dot, norm};
use crate::axes::{AxisName, Position};
use crate::units::mm_s_from_mm_min;
use std::sync::Arc;

/// What a touch is like while the ball searches: everything a term may depend on besides the axes' positions.
#[derive(Debug, Clone)]
pub struct TouchState {
    /// Sense (+1, -1, 0 when nothing is known) of each axis's last motion.
    pub sense: [f64; 6],
    /// Where A, B and C stood before they came to their pose, rad; 0 while an axis has not moved.
    pub stood_before_rad: [f64; 3],
    /// How far A, B and C have turned since they last turned back, rad, with the sign of the turn.
    pub since_reversal_rad: [f64; 3],
    /// Feed of the search, mm/min.
    pub feed_mm_min: f64,
    /// Hours since the first touch.
    pub hours: f64,
    /// Temperature, °C.
    pub temperature_deg_c: f64,
    /// Length of the stylus over that of the machine's own.
    pub stylus_ratio: f64,
    /// Number of the touch in the plan.
    pub id: u64,
    /// The way of the ball over the workpiece, unit vector in the frame that turns with tool and spindle.
    pub approach_probe: Vec3,
    /// Down, unit vector in the tool's frame (which does not turn with the spindle).
    pub down_tool: Vec3,
    /// From the ball to the spindle, unit vector in R.
    pub tool_axis: Vec3,
    /// Along `tool_axis`, unit vector in the frame of the probe.
    pub stylus_axis: Vec3,
    /// Turn of the spindle, rad.
    pub spindle_rad: f64,
    /// Pivot to ball, mm: of this stylus and of the machine's own.
    pub stylus_mm: f64,
    /// See `stylus_mm`.
    pub own_stylus_mm: f64,
    /// Outward unit normal of the planned face in R.
    pub normal_machine: Vec3,
    /// In the frame of the probe.
    pub normal_probe: Vec3,
    /// In the carrier's frame.
    pub normal_carrier: Vec3,
    /// Down, unit vector in the carrier's frame.
    pub down_carrier: Vec3,
    /// What is touched is round: it stands on a stem.
    pub on_stem: bool,
    /// It stands on a stem, whatever measured it.
    pub hangs: bool,
    /// Planned contact in the carrier's frame, mm.
    pub point: Vec3,
    /// Unit vector from the carrier's centre line to the block's centre, in the carrier's frame; 0 on it.
    pub outward: Vec3,
    /// Planned edge of the block along the normal, mm.
    pub edge_mm: f64,
    /// When the spindle runs: from, to (hours since the first touch), rpm.
    pub spindle: Arc<[[f64; 3]]>,
    /// `mounting/block`.
    pub label: Arc<str>,
}

impl Default for TouchState {
    fn default() -> Self {
        Self {
            sense: [0.0; 6],
            stood_before_rad: [0.0; 3],
            since_reversal_rad: [0.0; 3],
            feed_mm_min: 0.0,
            hours: 0.0,
            temperature_deg_c: 20.0,
            stylus_ratio: 1.0,
            id: 0,
            approach_probe: [0.0, 0.0, -1.0],
            down_tool: [0.0, 0.0, -1.0],
            tool_axis: [0.0, 0.0, 1.0],
            stylus_axis: [0.0, 0.0, 1.0],
            spindle_rad: 0.0,
            stylus_mm: 0.0,
            own_stylus_mm: 0.0,
            normal_machine: [0.0; 3],
            normal_probe: [0.0; 3],
            normal_carrier: [0.0; 3],
            down_carrier: [0.0, 0.0, -1.0],
            on_stem: false,
            hangs: false,
            point: [0.0; 3],
            outward: [0.0; 3],
            edge_mm: 0.0,
            spindle: Arc::from([]),
            label: Arc::from(""),
        }
    }
}

/// Where a term acts. `dof` 0, 1, 2: displacement along x, y, z (mm); 3, 4, 5: turn about x, y, z (rad).
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Target {
    /// An error of an axis, before or after its own motion, along and about the directions of R. Of a rotary axis these
    /// are the constant ones, which say where its line lies.
    Axis {
        axis: AxisName,
        /// After its motion (the error moves with the axis) instead of before.
        after: bool,
        /// Component, 0 to 5.
        dof: usize,
    },
    /// How a rotary axis runs on its own line: along and about the directions of the axis's own frame, at its own line.
    OwnLine {
        axis: AxisName,
        /// After its motion (the error moves with the axis) instead of before.
        after: bool,
        /// Component, 0 to 5, in the axis's own frame.
        dof: usize,
    },
    /// The ball, along an axis of R.
    BallInMachine(usize),
    /// The tool's side against the workpiece's, about the origin of R, component 0 to 5.
    Base(usize),
    /// The tool in its holder, about the pivot, component 0 to 5 in the tool's frame.
    Tool(usize),
    /// What bears the block, in its own frame about the origin of R at zero, component 0 to 5.
    Workpiece(usize),
    /// The ball, along an axis of the tool's frame (turns with the head, not with the spindle).
    BallInTool(usize),
    /// The ball, along an axis of the stylus's frame (turns with the spindle too).
    BallInStylus(usize),
    /// The ball, away from the spindle.
    Length,
    /// An axis stands elsewhere than the control believes by this much: mm, or rad for a rotary axis.
    Reading(AxisName),
    /// The trigger comes this much later along the approach, mm.
    Late,
    /// Half the block's edge along its own x, y, z, mm.
    HalfSize(usize),
    /// The same in parts of the edge.
    HalfSizeRatio,
    /// The radius of a sphere, mm.
    SphereRadius,
    /// The radius of a cylinder or a hole, mm.
    CylinderRadius,
    /// The block's place in its carrier, component 0 to 5.
    Block(usize),
    /// The block's place, away from the carrier's centre line, mm.
    BlockOutward,
}

/// A function of the state. Angles of axes enter in radians, time in hours.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Shape {
    /// 1.
    Constant,
    /// cos(k·q) of a rotary axis.
    Cosine(AxisName, f64),
    /// sin(k·q) of a rotary axis.
    Sine(AxisName, f64),
    /// (q/scale)^n: mm for a linear axis, rad for a rotary one.
    Power(AxisName, f64, i32),
    /// cos(2π·q/period) of a linear axis.
    PitchCosine(AxisName, f64),
    /// sin(2π·q/period) of a linear axis.
    PitchSine(AxisName, f64),
    /// The sense of an axis's last motion.
    Sense(AxisName),
    /// How much a rotary axis is wound up, from -1 to 1: it nears the sense of its turn over an angle, rad.
    WoundUp(AxisName, f64),
    /// +1 or -1: to which side of upright a rotary axis stands; 0 upright.
    SideOfUpright(AxisName),
    /// Square of the approach's part along +x or -x (+y or -y) of the probe; 0 where it goes the other way.
    ApproachTo {
        /// 0: x, 1: y.
        component: usize,
        /// To the positive side.
        positive: bool,
    },
    /// Square of the approach's part along the stylus.
    AxialApproach,
    /// ρ·cos(k·φ), φ the direction of the approach about the stylus, ρ its part across the stylus.
    LobeCosine(f64),
    /// ρ·sin(k·φ).
    LobeSine(f64),
    /// sᵏ·cos(k·φ), φ the azimuth of the touched place on its body, s its distance from the body's z axis over the radius.
    FormCosine(i32),
    /// sᵏ·sin(k·φ).
    FormSine(i32),
    /// How far the ball pushes a body on a stem along an axis of the carrier: the part of the push, against the normal.
    Push(usize),
    /// The part of gravity along an axis of the carrier, for a body on a stem.
    CarrierGravity(usize),
    /// Feed, mm/s.
    Feed,
    /// The part of gravity across the stylus along a tool axis, times the square of the stylus's relative length.
    StylusGravity(usize),
    /// |sin| of the tool's tilt from the vertical of R.
    Tilt,
    /// Hours since the first touch.
    Hours,
    /// 1 - exp(-t/τ), τ in hours.
    WarmUp(f64),
    /// Growth of the spindle as a part of what it reaches at its highest speed, time constant in hours.
    SpindleWarmth(f64),
    /// Temperature over 20 °C, K.
    Warmth,
    /// The same times the position of an axis.
    WarmthTimes(AxisName),
    /// 1 from this time on (hours), 0 before.
    FromHour(f64),
    /// 1 from this touch on, 0 before.
    FromTouch(f64),
    /// A formula of a user's effect, by its number.
    Formula(usize),
}

impl Shape {
    /// Does it change while the linear axes move?
    fn moves(&self, formulas: &[Formula]) -> bool {
        match self {
            Self::Formula(i) => formulas.get(*i).is_some_and(Formula::moves),
            Self::Power(axis, ..) | Self::WarmthTimes(axis) => !axis.is_rotary(),
            Self::PitchCosine(..) | Self::PitchSine(..) => true,
            _ => false,
        }
    }

    /// Does it need the time of the touch?
    fn timed(&self, formulas: &[Formula]) -> bool {
        if let Self::Formula(i) = self {
            return formulas.get(*i).is_some_and(Formula::timed);
        }
        matches!(
            self,
            Self::Hours
                | Self::WarmUp(_)
                | Self::SpindleWarmth(_)
                | Self::Warmth
                | Self::WarmthTimes(_)
                | Self::FromHour(_)
        )
    }

    fn value(&self, formulas: &[Formula], touch: &TouchState, joints: &Position) -> f64 {
        let q = |axis: AxisName| joints.mm_or_rad(axis);
        let turn = std::f64::consts::TAU;
        match *self {
            Self::Constant => 1.0,
            Self::Cosine(axis, k) => (k * q(axis)).cos(),
            Self::Sine(axis, k) => (k * q(axis)).sin(),
            Self::Power(axis, scale, n) => (q(axis) / scale).powi(n),
            Self::PitchCosine(axis, period) => (turn * q(axis) / period).cos(),
            Self::PitchSine(axis, period) => (turn * q(axis) / period).sin(),
            Self::Sense(axis) => touch.sense[axis.index()],
            Self::WoundUp(axis, over) => {
                let turned = touch.since_reversal_rad[axis.index() % 3];
                -(-turned.abs() / over).exp_m1().copysign(-turned)
            }
            Self::SideOfUpright(axis) => {
                let sine = q(axis).sin();
                if sine == 0.0 { 0.0 } else { sine.signum() }
            }
            Self::ApproachTo { component, positive } => {
                let part = touch.approach_probe[component];
                if (part > 0.0) == positive { part * part } else { 0.0 }
            }
            Self::AxialApproach => dot(touch.approach_probe, touch.stylus_axis).powi(2),
            Self::LobeCosine(k) => lobe(touch.approach_probe, k).1,
            Self::LobeSine(k) => lobe(touch.approach_probe, k).0,
            Self::FormCosine(k) => form_lobe(touch.normal_carrier, k).1,
            Self::FormSine(k) => form_lobe(touch.normal_carrier, k).0,
            Self::Push(_) if !touch.on_stem => 0.0,
            Self::CarrierGravity(_) if !touch.hangs => 0.0,
            Self::Push(i) => -touch.normal_carrier[i],
            Self::CarrierGravity(i) => touch.down_carrier[i],
            Self::Feed => mm_s_from_mm_min(touch.feed_mm_min),
            Self::StylusGravity(i) => {
                let along = dot(touch.down_tool, touch.stylus_axis);
                (touch.down_tool[i] - along * touch.stylus_axis[i]) * touch.stylus_ratio.powi(2)
            }
            Self::Tilt => norm([touch.tool_axis[0], touch.tool_axis[1], 0.0]),
            Self::Hours => touch.hours,
            Self::WarmUp(tau) => -(-touch.hours / tau).exp_m1(),
            Self::SpindleWarmth(tau) if touch.spindle.is_empty() => -(-touch.hours / tau).exp_m1(),
            Self::SpindleWarmth(tau) => super::scenario::Scenario::spindle_warmth(&touch.spindle, touch.hours, tau),
            Self::Warmth => touch.temperature_deg_c - REFERENCE_DEG_C,
            Self::WarmthTimes(axis) => (touch.temperature_deg_c - REFERENCE_DEG_C) * q(axis),
            Self::FromHour(h) => f64::from(touch.hours >= h),
            Self::FromTouch(id) => f64::from(touch.id as f64 >= id),
            Self::Formula(i) => formulas.get(i).map_or(f64::NAN, |f| f.value(touch, joints)),
        }
    }
}

/// Lengths are stated at this temperature (ISO 1), °C.
pub const REFERENCE_DEG_C: f64 = 20.0;

/// Sine and cosine of k times the direction of the approach about the stylus, times the part across the stylus.
fn lobe(approach: Vec3, k: f64) -> (f64, f64) {
    let across = approach[0].hypot(approach[1]);
    let (s, c) = (k * approach[1].atan2(approach[0])).sin_cos();
    (across * s, across * c)
}

/// Sine and cosine of k times the azimuth of a place on its body, times the k-th power of its sine from the z axis.
fn form_lobe(normal: Vec3, k: i32) -> (f64, f64) {
    let from_axis = normal[0].hypot(normal[1]).powi(k);
    let (s, c) = (f64::from(k) * normal[1].atan2(normal[0])).sin_cos();
    (from_axis * s, from_axis * c)
}

/// One thing that is wrong.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Term {
    /// Where it acts.
    pub target: Target,
    /// On what it depends.
    pub shape: Shape,
    /// How much: mm, rad, or what its shape leaves of them.
    pub amount: f64,
}

/// The sum of all terms at one state.
#[derive(Debug, Clone, Copy, Default)]
pub struct Shifts {
    /// Error motion of each axis before its motion: dx dy dz (mm), rx ry rz (rad).
    pub before: [[f64; 6]; 6],
    pub after: [[f64; 6]; 6],
    /// Of a rotary axis on its own line, in its own frame, before its motion.
    pub line_before: [[f64; 6]; 6],
    pub line_after: [[f64; 6]; 6],
    /// Displacement of the ball in R, mm.
    pub ball_machine: Vec3,
    /// Displacement of the tool's side in R, mm and rad.
    pub base: [f64; 6],
    /// Displacement of the tool in its holder, mm and rad.
    pub tool: [f64; 6],
    /// Displacement of what bears the block, mm and rad.
    pub workpiece: [f64; 6],
    /// In the tool's frame.
    pub ball_tool: Vec3,
    /// In the stylus's frame.
    pub ball_stylus: Vec3,
    /// Lengthening of the tool, mm.
    pub length: f64,
    /// Where the axes really stand less where the control believes, mm and rad.
    pub reading: [f64; 6],
    /// Lateness of the trigger, mm.
    pub late: f64,
    /// Half sizes of the block, mm.
    pub half_size: Vec3,
    /// The same in parts of the edge.
    pub half_size_ratio: f64,
    /// Radius of a sphere, mm.
    pub sphere_radius: f64,
    /// Radius of a cylinder or a hole, mm.
    pub cylinder_radius: f64,
    /// Displacement of the block in its carrier, mm and rad.
    pub block: [f64; 6],
    /// Displacement of the block outward, mm.
    pub block_outward: f64,
}

impl Shifts {
    fn add(&mut self, target: Target, value: f64) {
        match target {
            Target::Axis { axis, after: false, dof } => self.before[axis.index()][dof] += value,
            Target::Axis { axis, after: true, dof } => self.after[axis.index()][dof] += value,
            Target::OwnLine { axis, after: false, dof } => self.line_before[axis.index()][dof] += value,
            Target::OwnLine { axis, after: true, dof } => self.line_after[axis.index()][dof] += value,
            Target::Base(i) => self.base[i] += value,
            Target::Tool(i) => self.tool[i] += value,
            Target::Workpiece(i) => self.workpiece[i] += value,
            Target::BallInMachine(i) => self.ball_machine[i] += value,
            Target::BallInTool(i) => self.ball_tool[i] += value,
            Target::BallInStylus(i) => self.ball_stylus[i] += value,
            Target::Length => self.length += value,
            Target::Reading(axis) => self.reading[axis.index()] += value,
            Target::Late => self.late += value,
            Target::HalfSize(i) => self.half_size[i] += value,
            Target::HalfSizeRatio => self.half_size_ratio += value,
            Target::SphereRadius => self.sphere_radius += value,
            Target::CylinderRadius => self.cylinder_radius += value,
            Target::Block(i) => self.block[i] += value,
            Target::BlockOutward => self.block_outward += value,
        }
    }
}

/// The terms of a machine, those that change during a search apart from those that do not.
#[derive(Debug, Clone, Default)]
pub struct Terms {
    steady: Vec<Term>,
    moving: Vec<Term>,
    formulas: Vec<Formula>,
}

impl Terms {
    /// Sorts terms; those of amount 0 are left out. `formulas` are those of users' effects.
    pub fn new(terms: impl IntoIterator<Item = Term>, formulas: &[Formula]) -> Self {
        let (moving, steady) = terms.into_iter().filter(|t| t.amount != 0.0).partition(|t| t.shape.moves(formulas));
        Self { steady, moving, formulas: formulas.to_vec() }
    }

    /// Has every term a value at a touch?
    pub fn finite(&self, touch: &TouchState, joints: &Position) -> bool {
        let value = |t: &Term| t.shape.value(&self.formulas, touch, joints);
        self.steady.iter().chain(&self.moving).all(|t| value(t).is_finite())
    }

    /// Does nothing change while the ball searches? Then its way in the block's frame is straight.
    pub fn steady(&self) -> bool {
        self.moving.is_empty()
    }

    /// Does a term need the time of the touch?
    pub fn timed(&self) -> bool {
        self.steady.iter().chain(&self.moving).any(|t| t.shape.timed(&self.formulas))
    }

    /// The sum of what does not change during a touch.
    pub fn during(&self, touch: &TouchState, pose: &Position) -> Shifts {
        self.sum(Shifts::default(), &self.steady, touch, pose)
    }

    /// With what does, at positions of the axes.
    pub fn at(&self, steady: &Shifts, touch: &TouchState, joints: &Position) -> Shifts {
        self.sum(*steady, &self.moving, touch, joints)
    }

    fn sum(&self, mut out: Shifts, terms: &[Term], touch: &TouchState, joints: &Position) -> Shifts {
        for term in terms {
            out.add(term.target, term.amount * term.shape.value(&self.formulas, touch, joints));
        }
        out
    }
}
