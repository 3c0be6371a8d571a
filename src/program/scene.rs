//! Everything that can collide: ball, stem, body and head on the tool side; blocks, risers, plates and tables on the
//! workpiece side; and the distances between them. Shapes and distances are parry3d's.
//!
//! What is not modelled is not protected: cables, a door, the column, and whatever else the machine's file does not name.

use crate::axes::{AxisName, Position};
use crate::diag::{Failure, Result};
use crate::geometry::{Transform, apply, rotation_about};
use crate::machine::{Axis, Block, Carrier, Form, Machine, Mounting, Shape, Side};
use nalgebra::{Isometry3, Translation3, Unit, UnitQuaternion, Vector3};
use parry3d_f64::bounding_volume::Aabb;
use parry3d_f64::math::{Pose, Rot3, Vec3};
use parry3d_f64::query;
use parry3d_f64::shape::SharedShape;

/// Lengths beyond this (1 km) are a slip of the pen, and the distance algorithm would overflow on them.
const LARGEST_LENGTH_MM: f64 = 1e6;

/// A piece of the probe, head included.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Part {
    /// The spindle head from the probe's body up to the pivot.
    Head,
    /// The probe's body.
    Body,
    Stem,
    Ball,
}

impl std::fmt::Display for Part {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Head => "head",
            Self::Body => "probe body",
            Self::Stem => "stem",
            Self::Ball => "ball",
        })
    }
}

/// What a solid of the workpiece side is: it decides how much room it is given.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Role {
    /// A block, by its place in the mounting: it may stand off by the placement tolerance.
    Block(usize),
    /// A riser or plate of the mounting: it was set up together with the blocks.
    Mounted,
    /// A part of the machine.
    Fixed,
}

/// A convex shape on a body of the machine.
pub(super) struct Solid {
    shape: SharedShape,
    /// In the body's frame (R with all axes at 0).
    local: Isometry3<f64>,
    /// Radius of the sphere about the shape's own origin that holds it, mm.
    reach: f64,
}

impl Solid {
    fn new(shape: SharedShape, local: Isometry3<f64>, reach: f64) -> Self {
        Self { shape, local, reach }
    }

    fn ball(centre: Vector3<f64>, radius: f64) -> Self {
        Self::new(SharedShape::ball(radius), Translation3::from(centre).into(), radius)
    }

    fn cuboid(centre: Vector3<f64>, size: Vector3<f64>) -> Self {
        let half = size / 2.0;
        Self::new(SharedShape::cuboid(half.x, half.y, half.z), Translation3::from(centre).into(), half.norm())
    }

    fn cylinder(foot: Vector3<f64>, direction: &Unit<Vector3<f64>>, radius: f64, height: f64) -> Self {
        // parry's cylinders stand along y
        let turn = UnitQuaternion::rotation_between_axis(&Vector3::y_axis(), direction)
            .unwrap_or_else(|| UnitQuaternion::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI));
        let centre = foot + direction.into_inner() * (height / 2.0);
        Self::new(
            SharedShape::cylinder(height / 2.0, radius),
            Isometry3::from_parts(Translation3::from(centre), turn),
            radius.hypot(height / 2.0),
        )
    }

    /// A body that is touched: one convex solid, a hole as the wedges round it.
    fn of_body(block: &Block) -> Vec<Self> {
        let radius = block.diameter.unwrap_or_default() / 2.0;
        match block.form {
            Form::Box | Form::Plane | Form::Centre | Form::Reading | Form::Part => {
                vec![Self::cuboid(block.centre, block.size)]
            }
            Form::Sphere => vec![Self::ball(block.centre, radius)],
            Form::Cylinder => {
                let foot = block.centre - Vector3::z() * (block.size.z / 2.0);
                vec![Self::cylinder(foot, &Vector3::z_axis(), radius, block.size.z)]
            }
            Form::Bore => Self::round_a_hole(block.centre, block.size, radius),
        }
    }

    /// The box round a hole, cut into wedges. Their inner faces are chords of the hole: they stand a little inside of its wall, never
    /// outside.
    fn round_a_hole(centre: Vector3<f64>, size: Vector3<f64>, radius: f64) -> Vec<Self> {
        /// A chord of the hole stands inside of its wall by radius * (1 - cos(pi / 32)): half a percent.
        const WEDGES: u32 = 32;
        let half = size / 2.0;
        let direction = |k: u32| {
            let angle = std::f64::consts::TAU * f64::from(k) / f64::from(WEDGES);
            Vector3::new(angle.cos(), angle.sin(), 0.0)
        };
        // where a ray from the middle leaves the box; corners of the box lie on rays of their own where it is square
        let border = |d: &Vector3<f64>| d * (half.x / d.x.abs()).min(half.y / d.y.abs());
        let corner = |a: &Vector3<f64>, b: &Vector3<f64>| {
            let at = Vector3::new(half.x.copysign(a.x + b.x), half.y.copysign(a.y + b.y), 0.0);
            let (from, to) = (a.y.atan2(a.x), b.y.atan2(b.x));
            let to = if to < from { to + std::f64::consts::TAU } else { to };
            let own = at.y.atan2(at.x);
            let own = if own < from { own + std::f64::consts::TAU } else { own };
            (own > from && own < to).then_some(at)
        };
        (0..WEDGES)
            .map(|k| {
                let (a, b) = (direction(k), direction(k + 1));
                let mut flat = vec![a * radius, b * radius, border(&a), border(&b)];
                // a corner that lies on a ray of the wedge is there already
                let far = |at: &Vector3<f64>, b: &Vector3<f64>| (at - b).norm() > 1e-6;
                flat.extend(corner(&a, &b).filter(|at| far(at, &border(&a)) && far(at, &border(&b))));
                let points: Vec<Vec3> =
                    flat.iter().flat_map(|p| [-half.z, half.z].map(|z| Vec3::new(p.x, p.y, p.z + z))).collect();
                let reach = flat.iter().map(|p| p.norm().hypot(half.z)).fold(0.0, f64::max);
                match SharedShape::convex_hull(&points) {
                    Some(shape) => Self::new(shape, Translation3::from(centre).into(), reach),
                    // the box that holds the wedge: no piece of the body may be missing
                    None => {
                        let low = flat.iter().fold(Vector3::repeat(f64::MAX), |m, p| m.inf(p));
                        let high = flat.iter().fold(Vector3::repeat(f64::MIN), |m, p| m.sup(p));
                        let size = Vector3::new(high.x - low.x, high.y - low.y, size.z);
                        let middle = (low + high) / 2.0;
                        Self::cuboid(centre + Vector3::new(middle.x, middle.y, 0.0), size)
                    }
                }
            })
            .collect()
    }

    /// Centre of the sphere that holds it, in R, mm.
    pub(super) fn centre(&self, body: &Transform) -> Vector3<f64> {
        apply(body, &self.local.translation.vector)
    }

    /// Radius of that sphere, mm.
    pub(super) fn reach(&self) -> f64 {
        self.reach
    }

    /// The box along R's axes that holds it.
    pub(super) fn aabb(&self, body: &Transform) -> Aabb {
        self.shape.compute_aabb(&parry(&(body * self.local)))
    }

    /// How far it extends along a direction, mm from R's origin.
    pub(super) fn extent(&self, body: &Transform, direction: &Vector3<f64>) -> f64 {
        let at = body * self.local;
        let d = at.inverse_transform_vector(direction);
        let support = self.shape.as_support_map().map_or(self.reach, |s| {
            let p = s.local_support_point(Vec3::new(d.x, d.y, d.z));
            Vector3::new(p.x, p.y, p.z).dot(&d)
        });
        at.translation.vector.dot(direction) + support
    }
}

/// A solid of the workpiece side.
pub(super) struct Obstacle {
    pub(super) name: String,
    pub(super) role: Role,
    /// Place in [`Scene::carriers`].
    pub(super) carrier: usize,
    pub(super) solid: Solid,
}

/// Machine and artefact as solids.
pub struct Scene<'m> {
    pub machine: &'m Machine,
    pub(super) parts: Vec<(Part, Solid)>,
    pub(super) obstacles: Vec<Obstacle>,
    /// The first is the mounting's own.
    pub(super) carriers: Vec<Carrier>,
    /// By how much every gap may fall short of what is needed, mm.
    pub(super) slack_mm: f64,
    /// What is mounted was put down by eye.
    pub(super) by_eye: Option<ByEye>,
}

/// An artefact that was put down by eye, and a machine whose moves are relative to it once it is found.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ByEye {
    /// How far off it may stand, mm.
    pub displacement_mm: f64,
    /// The moves are relative to it already.
    pub found: bool,
}

impl ByEye {
    /// What must be left free beside the room that an artefact at its place needs, mm. `at_rapid`: rapids and turns. A turn takes the
    /// artefact along and not yet the tool: both may be off by as much, in opposite directions.
    fn room_mm(&self, role: Role, at_rapid: bool) -> f64 {
        match role {
            Role::Fixed => self.displacement_mm,
            Role::Block(_) | Role::Mounted if at_rapid => 2.0 * self.displacement_mm,
            Role::Block(_) | Role::Mounted if self.found => 0.0,
            Role::Block(_) | Role::Mounted => self.displacement_mm,
        }
    }
}

/// Where the bodies of the machine are: the tool and each carrier of obstacles, in R.
#[derive(Debug, Clone)]
pub struct Placement {
    pub(super) tool: Transform,
    pub(super) carriers: Vec<Transform>,
}

impl<'m> Scene<'m> {
    /// The same for a program whose words are rounded: a place that was proven clear may stand so much off, mm.
    #[must_use]
    pub fn rounded(self, slack_mm: f64) -> Self {
        Self { slack_mm, ..self }
    }

    /// The same for an artefact that was put down by eye.
    #[must_use]
    pub fn put_by_eye(self, by_eye: Option<ByEye>) -> Self {
        Self { by_eye, ..self }
    }

    /// Room for where something stands that was put down by eye, mm.
    pub(super) fn displacement_mm(&self, role: Role, at_rapid: bool) -> f64 {
        self.by_eye.map_or(0.0, |by_eye| by_eye.room_mm(role, at_rapid))
    }

    /// The solids of a machine with an artefact mounted.
    ///
    /// # Errors
    /// When a length is so large that distances cannot be computed.
    pub fn new(machine: &'m Machine, mounting: &Mounting) -> Result<Self> {
        let probe = &machine.probe;
        let up = &machine.tool.direction;
        let ball = machine.tool.ball_at_zero(machine.tool.length_mm);
        let along = |mm: f64| ball + up.into_inner() * mm;
        let body_foot = probe.stem_length;
        let head_foot = body_foot + probe.body_length;
        let head_height = machine.tool.length_mm - head_foot;
        let mut parts = Vec::new();
        // a probe that reaches up to the pivot leaves no room for a head
        if head_height > 1e-3 {
            parts.push((Part::Head, Solid::cylinder(along(head_foot), up, probe.head_radius, head_height)));
        }
        parts.push((Part::Body, Solid::cylinder(along(body_foot), up, probe.body_radius, probe.body_length)));
        parts.push((Part::Stem, Solid::cylinder(ball, up, probe.stem_radius, probe.stem_length)));
        parts.push((Part::Ball, Solid::ball(ball, probe.ball_radius)));

        let (obstacles, carriers) = (Vec::new(), vec![mounting.carrier]);
        let mut scene = Self { machine, parts, obstacles, carriers, slack_mm: 0.0, by_eye: None };
        for (i, block) in mounting.blocks.iter().enumerate() {
            for solid in Solid::of_body(block) {
                scene.add(format!("block {}", block.name), Role::Block(i), block.carrier, solid);
            }
        }
        for (role, solids) in [(Role::Mounted, &mounting.solids), (Role::Fixed, &machine.solids)] {
            for s in solids {
                let solid = match &s.shape {
                    Shape::Box { centre, size } => Solid::cuboid(*centre, *size),
                    Shape::Cylinder { foot, direction, radius, height } => {
                        Solid::cylinder(*foot, direction, *radius, *height)
                    }
                };
                scene.add(s.name.clone(), role, s.carrier, solid);
            }
        }
        let lengths = scene.parts.iter().map(|(_, s)| s).chain(scene.obstacles.iter().map(|o| &o.solid));
        let axes = machine.axes.iter().flat_map(|a| [a.point.norm(), a.range[0].abs(), a.range[1].abs()]);
        let largest = lengths.map(|s| s.local.translation.vector.norm() + s.reach).chain(axes).fold(0.0, f64::max);
        if largest.is_nan() || largest >= LARGEST_LENGTH_MM {
            return Err(Failure::new(
                "program::too_large",
                format!("a place, size or range of {} reaches {largest:e} mm", machine.name),
            )
            .help("lengths in the machine's file are millimetres: correct the largest one"));
        }
        Ok(scene)
    }

    /// Proves that blocks which do not move with the rest of their mounting are clear of everything that rotary axes turn
    /// against them, at every angle. Moves of the machine then need not look at it.
    ///
    /// # Errors
    /// The first pair that is not proven clear.
    pub fn blocks_clear_of_each_other(&self) -> Result<()> {
        let probe = &self.machine.probe;
        let room = probe.clearance + probe.placement_tolerance;
        // what stands on the mounting's own carrier meets the machine's solids as its maker meant it
        let displacement = |o: &Obstacle| o.role != Role::Fixed && o.carrier != 0;
        for one in self.obstacles.iter().filter(|o| displacement(o)) {
            for other in self.obstacles.iter().filter(|o| o.carrier != one.carrier) {
                if self.least_gap(one, other) < room {
                    return Err(Failure::new(
                        "program::blocks_turn_into",
                        format!("{} is not clear of {} at every angle of the rotary axes", one.name, other.name),
                    )
                    .help("stand it further off what turns, in the machine's file"));
                }
            }
        }
        Ok(())
    }

    /// Lower bound of the distance of two solids of different carriers over all angles of the axes between them, mm.
    fn least_gap(&self, one: &Obstacle, other: &Obstacle) -> f64 {
        let chain =
            |o: &Obstacle| self.carriers.get(o.carrier).map(|c| self.machine.carrier_chain(*c)).unwrap_or_default();
        let (a, b) = (chain(one), chain(other));
        let shared = a.iter().zip(&b).take_while(|(x, y)| x.name == y.name).count();
        let between: Vec<&Axis> = a.iter().skip(shared).chain(b.iter().skip(shared)).copied().collect();
        if between.iter().any(|x| !x.name.is_rotary()) {
            return 0.0; // a linear axis can bring anything anywhere
        }
        // solids of one carrier never move against each other
        if between.is_empty() {
            return f64::MAX;
        }
        let (turning, standing) = if b.len() > shared { (other, one) } else { (one, other) };
        if let [axis] = between[..] {
            return self.least_gap_about(axis, turning, standing);
        }
        if a.len() > shared && b.len() > shared {
            return 0.0; // both turn
        }
        // any angles of several axes: inside the sphere about a point of the outer axis's line that holds all of them.
        // A turn moves nothing along its line, so the nearest point of each line gives the smallest sphere
        let mut reach = turning.solid.reach();
        let mut centre = turning.solid.centre(&Transform::identity());
        for axis in between.iter().rev() {
            let direction = axis.direction.into_inner();
            let nearest = axis.point + direction * direction.dot(&(centre - axis.point));
            reach += (centre - nearest).norm();
            centre = nearest;
        }
        let ball = Solid::ball(centre, reach);
        self.distance(&ball, &Transform::identity(), &standing.solid, &Transform::identity())
    }

    /// The same for one axis between them: in steps, less what a point of the turning one moves in half a step.
    fn least_gap_about(&self, axis: &Axis, turning: &Obstacle, standing: &Obstacle) -> f64 {
        const STEPS: u32 = 720;
        let step = std::f64::consts::TAU / f64::from(STEPS);
        let line = (axis.point, axis.direction.into_inner());
        let margin = Self::radius_about(&line, &turning.solid, &Transform::identity()) * step / 2.0;
        (0..STEPS)
            .map(|k| {
                let turned = rotation_about(&axis.point, &axis.direction, step * f64::from(k));
                self.distance(&turning.solid, &turned, &standing.solid, &Transform::identity())
            })
            .fold(f64::MAX, f64::min)
            - margin
    }

    fn add(&mut self, name: String, role: Role, carrier: Carrier, solid: Solid) {
        let carrier = self.carriers.iter().position(|c| *c == carrier).unwrap_or_else(|| {
            self.carriers.push(carrier);
            self.carriers.len() - 1
        });
        self.obstacles.push(Obstacle { name, role, carrier, solid });
    }

    /// Places all bodies.
    #[must_use]
    pub fn place(&self, at: &Position) -> Placement {
        Placement {
            tool: self.machine.tool_frame(at),
            carriers: self.carriers.iter().map(|c| self.machine.carrier_frame(*c, at)).collect(),
        }
    }

    /// Distance between a part and an obstacle, mm; 0 when they overlap.
    pub(super) fn gap(&self, part: &Solid, obstacle: &Obstacle, placed: &Placement) -> f64 {
        let Some(carrier) = placed.carriers.get(obstacle.carrier) else { return 0.0 };
        self.distance(part, &placed.tool, &obstacle.solid, carrier)
    }

    /// Distance between two solids on bodies, mm; 0 when they overlap.
    fn distance(&self, one: &Solid, on: &Transform, other: &Solid, other_on: &Transform) -> f64 {
        let (a, b) = (on * one.local, other_on * other.local);
        // a pair that parry cannot compare counts as touching: refused, never let through
        query::distance(&parry(&a), one.shape.as_ref(), &parry(&b), other.shape.as_ref())
            .map_or(0.0, |d| if d.distance.is_finite() { d.distance } else { 0.0 })
    }

    /// The line of a rotary axis in R: a point of it and its direction.
    pub(super) fn axis_line(&self, axis: &Axis, at: &Position) -> (Vector3<f64>, Vector3<f64>) {
        let before = self
            .machine
            .side(axis.side)
            .take_while(|a| a.name != axis.name)
            .fold(Transform::identity(), |t, a| t * a.motion(at));
        (apply(&before, &axis.point), before.rotation * axis.direction.into_inner())
    }

    /// True when a rotary axis moves this carrier of obstacles.
    pub(super) fn carries(&self, axis: AxisName, carrier: usize) -> bool {
        self.carriers.get(carrier).is_some_and(|c| self.machine.carrier_chain(*c).iter().any(|a| a.name == axis))
    }

    /// Upper bound of the distance from an axis's line of any point of a solid, mm.
    pub(super) fn radius_about(line: &(Vector3<f64>, Vector3<f64>), solid: &Solid, body: &Transform) -> f64 {
        let from_line = solid.centre(body) - line.0;
        (from_line - line.1 * from_line.dot(&line.1)).norm() + solid.reach()
    }

    pub(super) fn side_of(&self, axis: AxisName) -> Option<Side> {
        self.machine.axis(axis).map(|a| a.side)
    }
}

/// A transform as parry takes it.
fn parry(t: &Transform) -> Pose {
    let (p, q) = (&t.translation.vector, t.rotation.coords);
    Pose::from_parts(Vec3::new(p.x, p.y, p.z), Rot3::from_xyzw(q.x, q.y, q.z, q.w))
}

/// Lower bound of the distance between what two boxes hold, mm.
pub(super) fn box_gap(a: &Aabb, b: &Aabb) -> f64 {
    let apart = (a.mins - b.maxs).max(b.mins - a.maxs).max(Vec3::ZERO);
    apart.length()
}
