//! The machine as data: chain, limits, shapes, artefact, probe.
//!
//! [`load`] reads `machines.toml` and gives [`Machine`]s that cannot hold a parentless chain, a rotary axis without
//! direction or a radius of zero; everything after it relies on that. Nothing here knows errors, programs or
//! controllers.

pub mod artefact;
pub mod as_written;
mod check;
mod check_parts;
mod form;
mod risers;

pub use check::load;
pub use form::Form;

use crate::axes::{AxisMap, AxisName, Position};
use crate::diag::{Result, source};
use crate::geometry::{Transform, apply, rotation_about, translation};
use nalgebra::{Unit, Vector3};

pub const BUILT_IN: &str = include_str!("../../machines.toml");

/// One machine of those that are built in; the tables of the others are not read. `None`: none of them is called so.
///
/// # Errors
/// Never for a released program: a test reads each.
pub fn built_in(name: &str) -> Result<Option<Machine>> {
    const HEAD: &str = "[[machine]]";
    let mut tables = BUILT_IN.split(HEAD);
    let head = tables.next().unwrap_or_default();
    let called = |table: &&str| table.split('"').nth(1) == Some(name);
    let Some(table) = tables.find(called) else { return Ok(None) };
    let text = source("machines.toml (built in)", format!("{head}{HEAD}{table}"));
    Ok(load(&text)?.0.pop())
}

/// Where an axis stands in the chain.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Side {
    /// Between the base and the workpiece.
    Workpiece,
    /// Between the base and the tool.
    Tool,
}

impl Side {
    /// Which way a linear axis on this side moves what it carries as its NC coordinate grows: an NC coordinate says where the tool is
    /// over the workpiece, so that a table moves the other way. The one place where the side of the chain gives a sign.
    #[must_use]
    pub fn travel_sign(self) -> f64 {
        if self == Self::Workpiece { -1.0 } else { 1.0 }
    }
}

/// A checked axis. Lengths mm in R, angles rad, except `range` (mm or **deg**, machine coordinates less the origin).
#[derive(Debug, Clone)]
pub struct Axis {
    /// Its letter.
    pub name: AxisName,
    /// Workpiece or tool side.
    pub side: Side,
    /// Linear: of the tool over the workpiece. Rotary: about which `sense * angle` is right-handed.
    pub direction: Unit<Vector3<f64>>,
    /// A point of a rotary axis (0 for a linear one), mm.
    pub point: Vector3<f64>,
    /// +1 or -1.
    pub sense: f64,
    /// Lowest and highest coordinate relative to R's origin, mm or deg.
    pub range: [f64; 2],
    /// Rotary: scatter of the ball's place per index, mm, 1 sigma.
    pub indexing_repeatability_mm: f64,
}

/// A program keeps this far off the ends of a linear axis, mm: a loaded compensation moves the joints by up to half a
/// millimetre against the coordinates that the program names (`export` refuses more), and a control stops at the end.
pub const END_RESERVE_MM: f64 = 1.0;

impl Axis {
    /// The coordinates that a program may use, mm or deg relative to R's origin.
    #[must_use]
    pub fn program_range(&self) -> [f64; 2] {
        let [low, high] = self.range;
        if self.name.is_rotary() { [low, high] } else { [low + END_RESERVE_MM, high - END_RESERVE_MM] }
    }

    /// Which way a linear axis moves what it carries as its NC coordinate grows.
    #[must_use]
    pub fn travel_sign(&self) -> f64 {
        self.side.travel_sign()
    }

    /// The motion of what the axis carries, in R.
    #[must_use]
    pub fn motion(&self, at: &Position) -> Transform {
        let q = at.mm_or_rad(self.name);
        if self.name.is_rotary() {
            rotation_about(&self.point, &self.direction, self.sense * q)
        } else {
            translation(self.direction.into_inner() * (self.travel_sign() * q))
        }
    }
}

/// The spindle.
#[derive(Debug, Clone)]
pub struct Tool {
    /// Where `length` is measured from, mm in R.
    pub pivot: Vector3<f64>,
    /// From the ball to the spindle.
    pub direction: Unit<Vector3<f64>>,
    /// Pivot to ball's centre, mm.
    pub length_mm: f64,
    /// Sense of the control's M19 about `direction`.
    pub spindle_sense: f64,
}

impl Tool {
    /// Ball's centre at zero for a stylus of another length, mm in R.
    #[must_use]
    pub fn ball_at_zero(&self, length_mm: f64) -> Vector3<f64> {
        self.pivot - self.direction.into_inner() * length_mm
    }
}

/// Shape of a solid, in the carrier's frame (R at zero), mm.
#[derive(Debug, Clone, Copy)]
pub enum Shape {
    /// Along the axes of R: centre and full edges.
    Box {
        centre: Vector3<f64>,
        /// Its full edges.
        size: Vector3<f64>,
    },
    Cylinder {
        /// Centre of its lower end.
        foot: Vector3<f64>,
        /// From the foot to the other end.
        direction: Unit<Vector3<f64>>,
        radius: f64,
        height: f64,
    },
}

/// The part of the machine that bears something on the workpiece side.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Carrier {
    /// The machine's base: does not move.
    Base,
    /// The linear axes' table: all linear axes of the workpiece side, no rotary one.
    Table,
    /// What this axis of the workpiece side carries.
    Axis(AxisName),
}

impl std::fmt::Display for Carrier {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Base => write!(f, "base"),
            Self::Table => write!(f, "table"),
            Self::Axis(name) => write!(f, "{name}"),
        }
    }
}

/// A solid that must not be hit.
#[derive(Debug, Clone)]
pub struct Solid {
    /// For messages.
    pub name: String,
    /// What bears it.
    pub carrier: Carrier,
    pub shape: Shape,
}

/// An artefact's body that is touched, mm in R at zero.
#[derive(Clone)]
pub struct Block {
    /// Short name.
    pub name: String,
    pub form: Form,
    pub centre: Vector3<f64>,
    /// Full edges of the box that holds it.
    pub size: Vector3<f64>,
    /// Of a sphere, a cylinder or a hole.
    pub diameter: Option<f64>,
    /// Height and edges of what is under it.
    pub riser: Option<as_written::Riser>,
    /// What bears it.
    pub carrier: Carrier,
}

// machines are recognised by a digest of their records' debug form: a box is written as it always was
impl std::fmt::Debug for Block {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let mut out = f.debug_struct("Block");
        out.field("name", &self.name).field("centre", &self.centre).field("size", &self.size);
        out.field("riser", &self.riser).field("carrier", &self.carrier);
        if !self.form.is_box() {
            out.field("form", &self.form).field("diameter", &self.diameter);
        }
        out.finish()
    }
}

/// An artefact as it is mounted.
#[derive(Debug, Clone)]
pub struct Mounting {
    /// Short name.
    pub name: String,
    /// What to do at the machine.
    pub says: String,
    /// What bears it, where a block says nothing else.
    pub carrier: Carrier,
    pub blocks: Vec<Block>,
    /// Its other solids (the risers are among them).
    pub solids: Vec<Solid>,
}

/// A further stylus of the probe: what differs from the probe's own. Lengths mm.
#[derive(Debug, Clone, PartialEq)]
pub struct Stylus {
    /// Short name, used by programs.
    pub name: String,
    /// What to do at the machine.
    pub says: String,
    /// How much longer the stem is.
    pub longer: f64,
    pub ball_radius: f64,
    pub stem_radius: f64,
}

/// Points at which location errors can be stated, mm in R.
#[derive(Debug, Clone, Copy)]
pub struct Reference {
    /// The default.
    pub pivot: Vector3<f64>,
    /// The ball's centre at zero.
    pub ball: Vector3<f64>,
    /// The table's face.
    pub table: Vector3<f64>,
}

/// A checked machine.
#[derive(Debug, Clone)]
pub struct Machine {
    /// Short name.
    pub name: String,
    pub says: String,
    /// Machine coordinates at the origin of R, mm and deg.
    pub origin: AxisMap,
    /// The axes: workpiece side from the base on, then tool side from the base on.
    pub axes: Vec<Axis>,
    /// The spindle.
    pub tool: Tool,
    /// Points at which location errors can be stated.
    pub reference: Reference,
    /// The probe; `repeatability_um` in µm, lengths mm, feeds mm/min.
    pub probe: as_written::Probe,
    /// Further styli of the probe.
    pub styli: Vec<Stylus>,
    /// Solids that are always there.
    pub solids: Vec<Solid>,
    /// Artefacts as they can be mounted.
    pub mountings: Vec<Mounting>,
    /// Rotary axes whose indexing repeatability the description does not state: a default is assumed.
    pub assumed_indexing: Vec<AxisName>,
    /// SHA-256 of the description that this was read from, hexadecimal.
    pub sha256: String,
}

/// Styli whose lengths and balls differ by less are taken for one, mm.
pub const SAME_STYLUS_MM: f64 = 1e-6;

/// Where the linear axes stand for each place of the ball in a carrier's frame, the rotary axes in one pose; mm.
#[derive(Debug, Clone, Copy)]
pub struct BallPlaces {
    at_zero: Vector3<f64>,
    /// Of the ball's way per way of X, Y and Z.
    inverse: nalgebra::Matrix3<f64>,
}

impl BallPlaces {
    /// X, Y and Z at which an errorless machine holds the ball there.
    #[must_use]
    pub fn linear_for(&self, ball: &Vector3<f64>) -> Vector3<f64> {
        self.inverse * (ball - self.at_zero)
    }
}

impl Machine {
    /// An axis by letter.
    #[must_use]
    pub fn axis(&self, name: AxisName) -> Option<&Axis> {
        self.axes.iter().find(|a| a.name == name)
    }

    /// The largest coordinate of the description, as R or the control has it, mm or deg: of ends of linear axes, points of rotary
    /// ones, reference points, blocks and the tool.
    #[must_use]
    pub fn largest_coordinate(&self) -> f64 {
        let linear = self.axes.iter().filter(|a| !a.name.is_rotary());
        let ends = linear.flat_map(|a| {
            let origin = self.origin.get(a.name).unwrap_or(0.0);
            a.range.into_iter().flat_map(move |end| [end, end + origin])
        });
        let points =
            self.axes.iter().map(|a| a.point).chain([self.tool.pivot, self.reference.ball, self.reference.table]);
        let blocks = self.mountings.iter().flat_map(|m| &m.blocks).map(|b| b.centre);
        let points = points.chain(blocks).flat_map(|p| [p.x, p.y, p.z]);
        ends.chain(points).chain([self.tool.length_mm]).fold(360.0, |most, c| most.max(c.abs()))
    }

    /// The axes of one side, from the base on.
    pub fn side(&self, side: Side) -> impl Iterator<Item = &Axis> {
        self.axes.iter().filter(move |a| a.side == side)
    }

    /// The rotary axes, workpiece side first.
    pub fn rotary(&self) -> impl Iterator<Item = &Axis> {
        self.axes.iter().filter(|a| a.name.is_rotary())
    }

    /// The axes between the base and a carrier, from the base on.
    #[must_use]
    pub fn carrier_chain(&self, carrier: Carrier) -> Vec<&Axis> {
        let chain: Vec<&Axis> = self.side(Side::Workpiece).collect();
        let end = match carrier {
            Carrier::Base => 0,
            // the linear axes' table is borne by the last linear axis before the first rotary one
            Carrier::Table => chain.iter().take_while(|a| !a.name.is_rotary()).count(),
            Carrier::Axis(name) => chain.iter().position(|a| a.name == name).map_or(0, |i| i + 1),
        };
        chain.into_iter().take(end).collect()
    }

    /// Frame of a carrier in R for an errorless machine.
    #[must_use]
    pub fn carrier_frame(&self, carrier: Carrier, at: &Position) -> Transform {
        self.carrier_chain(carrier).iter().fold(Transform::identity(), |t, a| t * a.motion(at))
    }

    /// Frame of the tool in R for an errorless machine (R at zero).
    #[must_use]
    pub fn tool_frame(&self, at: &Position) -> Transform {
        self.side(Side::Tool).fold(Transform::identity(), |t, a| t * a.motion(at))
    }

    /// Ball's centre in a carrier's frame for an errorless machine, mm.
    #[must_use]
    pub fn ball_in(&self, carrier: Carrier, at: &Position, length_mm: f64) -> Vector3<f64> {
        let ball = apply(&self.tool_frame(at), &self.tool.ball_at_zero(length_mm));
        apply(&self.carrier_frame(carrier, at).inverse(), &ball)
    }

    /// The linear axes' positions at which an errorless machine holds the ball at a place of a carrier.
    ///
    /// `pose` gives the rotary axes. The ball's place in a carrier's frame is affine in X, Y, Z for every serial chain,
    /// so three unit steps give the exact answer. `None` when the linear axes do not span space.
    #[must_use]
    pub fn linear_for_ball(
        &self,
        carrier: Carrier,
        pose: &Position,
        ball: &Vector3<f64>,
        length_mm: f64,
    ) -> Option<Position> {
        let places = self.ball_places(carrier, pose, length_mm)?;
        Some(pose.with_xyz_mm(places.linear_for(ball)))
    }

    /// The same for many places of the ball with the rotary axes in one pose.
    #[must_use]
    pub fn ball_places(&self, carrier: Carrier, pose: &Position, length_mm: f64) -> Option<BallPlaces> {
        let at_zero = self.ball_in(carrier, &pose.with_xyz_mm(Vector3::zeros()), length_mm);
        let columns = [Vector3::x(), Vector3::y(), Vector3::z()]
            .map(|unit| self.ball_in(carrier, &pose.with_xyz_mm(unit), length_mm) - at_zero);
        Some(BallPlaces { at_zero, inverse: nalgebra::Matrix3::from_columns(&columns).try_inverse()? })
    }

    /// A mounting by name. `NAME#2`, `NAME#3` … are the same blocks put up once more.
    #[must_use]
    pub fn mounting(&self, name: &str) -> Option<&Mounting> {
        let described = |name: &str| self.mountings.iter().find(|m| m.name == name);
        described(name).or_else(|| described(name.rsplit_once('#')?.0))
    }

    /// The machine with a stylus in its probe: other lengths and radii, everything else the same. `None`: it has no
    /// stylus of that name.
    #[must_use]
    pub fn with_stylus(&self, name: &str) -> Option<Self> {
        let stylus = self.styli.iter().find(|s| s.name == name)?;
        let mut machine = self.clone();
        // to a picometre: plans need not carry 302.68399999999997
        let longer = |own: f64| ((own + stylus.longer) * 1e9).round() / 1e9;
        machine.tool.length_mm = longer(machine.tool.length_mm);
        machine.probe.stem_length = longer(machine.probe.stem_length);
        machine.probe.stem_radius = stylus.stem_radius;
        machine.probe.ball_radius = stylus.ball_radius;
        Some(machine)
    }

    /// The machine with the stylus of this length (pivot to ball's centre) and ball radius, mm; `None`: it has no such.
    #[must_use]
    pub fn with_stylus_of(&self, length_mm: f64, ball_radius_mm: f64) -> Option<Self> {
        let same = |m: &Self| {
            (m.tool.length_mm - length_mm).abs() < SAME_STYLUS_MM
                && (m.probe.ball_radius - ball_radius_mm).abs() < SAME_STYLUS_MM
        };
        if same(self) {
            return Some(self.clone());
        }
        self.styli.iter().filter_map(|s| self.with_stylus(&s.name)).find(same)
    }

    /// Reads `table`, `base` or an axis letter of the workpiece side.
    #[must_use]
    pub fn carrier(&self, word: &str) -> Option<Carrier> {
        match word {
            "base" => Some(Carrier::Base),
            "table" => Some(Carrier::Table),
            _ => {
                let mut letters = word.chars();
                let name = AxisName::from_letter(letters.next()?)?;
                let known = letters.next().is_none() && self.axis(name)?.side == Side::Workpiece;
                known.then_some(Carrier::Axis(name))
            }
        }
    }
}
