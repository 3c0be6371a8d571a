//! A program on a machine: which points are to be touched in which pose, in order. Whether they can be reached is not
//! asked here.

use super::as_written::{FacesIn, RingIn};
use super::parts::Part;
use super::ring_points;
use super::spec::{Across, Along, At, Face, FaceGrid, MOST_TOUCHES, ProgramSpec, RingPoints, SetupSpec};
use crate::axes::{AxisMap, Position};
use crate::diag::{Failure, Finding, Findings, Result};
use crate::machine::{Block, Form, Machine, Mounting};
use crate::units::Plain;
use nalgebra::{Rotation3, Vector3};

/// A point that is to be touched, in the carrier's frame, mm.
#[derive(Debug, Clone, PartialEq)]
pub struct Target {
    /// Place of the block in the mounting.
    pub block: usize,
    /// The block's own face; on what is round the direction.
    pub face: String,
    /// Nominal contact.
    pub point: Vector3<f64>,
    /// Unit normal that points out of the material; on faces an axis of the carrier's frame.
    pub normal: Vector3<f64>,
}

/// A set-up: one pose and its targets in the order block, face, point.
#[derive(Debug, Clone)]
pub struct Setup<'a> {
    /// What the program says about it.
    pub spec: &'a SetupSpec,
    /// Place of its part in [`Layout::parts`].
    pub part: usize,
    /// Every rotary axis of the machine, deg.
    pub pose: AxisMap,
    /// The targets; each is touched `spec.repeats` times.
    pub targets: Vec<Target>,
}

impl Setup<'_> {
    /// The pose with the linear axes at 0.
    #[must_use]
    pub fn at_pose(&self) -> Position {
        self.pose.position()
    }
}

/// A whole program on a machine.
#[derive(Debug, Clone)]
pub struct Layout<'a> {
    /// What is mounted, from stop to stop: at least one part.
    pub parts: Vec<Part<'a>>,
    /// The set-ups, in order.
    pub setups: Vec<Setup<'a>>,
}

impl Layout<'_> {
    #[must_use]
    pub fn block(&self, setup: &Setup, target: &Target) -> Option<&Block> {
        self.parts.get(setup.part)?.mounting.blocks.get(target.block)
    }

    /// Name of a target's block.
    #[must_use]
    pub fn block_name(&self, setup: &Setup, target: &Target) -> &str {
        self.block(setup, target).map_or("", |b| b.name.as_str())
    }
}

/// Lays a program out on a machine.
///
/// # Errors
/// When the machine lacks what the program names, a pose lies outside its ranges, or a point lies off its face; all
/// findings at once.
pub fn lay_out<'a>(machine: &'a Machine, spec: &'a ProgramSpec) -> Result<(Layout<'a>, Findings)> {
    let mut check = Check { machine, spec, findings: Findings::default() };
    if let Some(written_for) = spec.machine.as_ref().filter(|m| m.value != machine.name) {
        check.findings.push(
            Finding::warning(
                "program::other_machine",
                format!(
                    "program {:?} is written for {}, and is used for {}",
                    spec.name, written_for.value, machine.name
                ),
            )
            .help("limits and collisions are checked for this machine; look at the poses all the same")
            .at(&spec.source, written_for.span.clone()),
        );
    }
    let mut parts = Vec::new();
    for part in &spec.parts {
        match Part::on(machine, spec, part) {
            Ok(part) => parts.push(part),
            Err(lacks) => lacks.into_iter().for_each(|finding| check.push_once(finding)),
        }
    }
    if parts.len() < spec.parts.len() {
        return Err(Failure(check.findings.0));
    }
    let mounting = |s: &SetupSpec| parts.get(s.part).map(|p| p.mounting);
    let setups: Vec<Setup> = spec.setups.iter().filter_map(|s| Some(check.setup(mounting(s)?, s))).collect();
    let touches: usize = setups.iter().map(|s| s.targets.len().saturating_mul(s.spec.repeats as usize)).sum();
    if touches > MOST_TOUCHES {
        let at = spec.parts.first().map_or(0..0, |p| p.mounting.span.clone());
        check.push_once(spec.error(
            &at,
            "program::too_many",
            format!("the program asks for {touches} touches"),
            format!("write fewer points, poses or repeats: {MOST_TOUCHES} at most"),
        ));
    }
    check.findings.finish(Layout { parts, setups })
}

struct Check<'a> {
    machine: &'a Machine,
    spec: &'a ProgramSpec,
    findings: Findings,
}

impl<'a> Check<'a> {
    /// A list of angles gives the same finding once for each: the first is enough.
    fn push_once(&mut self, finding: Finding) {
        if !self.findings.0.iter().any(|f| f.message == finding.message && f.span == finding.span) {
            self.findings.push(finding);
        }
    }

    /// One mistake in the file may show on every block, face and pose: it is said at its place, once.
    fn push_once_per_place(&mut self, finding: Finding) {
        if !self.findings.0.iter().any(|f| f.code == finding.code && f.span == finding.span) {
            self.findings.push(finding);
        }
    }

    fn error<T>(&mut self, at: &At<T>, code: &'static str, message: String, help: String) {
        self.push_once(self.spec.error(&at.span, code, message, help));
    }

    fn setup(&mut self, mounting: &Mounting, spec: &'a SetupSpec) -> Setup<'a> {
        let machine = self.machine;
        for (at, map) in [(&spec.pose, &spec.pose.value), (&spec.from, &spec.from.value)] {
            for (axis, _) in map.iter().filter(|(a, _)| machine.axis(*a).is_none()) {
                let has: Vec<String> = machine.rotary().map(|a| a.name.to_string()).collect();
                self.error(
                    at,
                    "program::unknown_axis",
                    format!("{} has no axis {axis}", machine.name),
                    format!("its rotary axes are {}", has.join(" and ")),
                );
            }
        }
        let mut pose = AxisMap::default();
        for axis in machine.rotary() {
            let angle = spec.pose.value.get(axis.name).unwrap_or(0.0);
            pose.set(axis.name, angle);
            let [low, high] = axis.range;
            if !(low..=high).contains(&angle) {
                self.error(
                    &spec.pose,
                    "program::pose_outside",
                    format!(
                        "{} = {} deg is outside the range of {} ({low} … {high})",
                        axis.name,
                        Plain(angle),
                        machine.name
                    ),
                    "choose an angle inside the range, or correct the range in the machine's file".to_owned(),
                );
            }
        }
        let blocks = self.blocks(mounting, spec);
        let named_in = match self.spec.faces_in {
            FacesIn::Block => RingIn::Block,
            FacesIn::Machine => RingIn::Machine,
        };
        let at = pose.position();
        let mut targets = Vec::new();
        for (b, block) in blocks.iter().filter_map(|&b| Some((b, mounting.blocks.get(b)?))) {
            let turned = ring_points::to_carrier(machine, block, named_in, &at);
            let before = targets.len();
            if matches!(block.form, Form::Box | Form::Plane | Form::Cylinder) {
                for faces in &spec.faces {
                    targets.extend(self.face(b, block, faces, &turned, spec));
                }
            }
            if block.form.is_round() {
                for ring in &spec.rings {
                    let turned = ring_points::to_carrier(machine, block, ring.directions_in, &at);
                    targets.extend(self.ring(b, block, ring, &turned));
                }
            }
            if targets.len() == before && !self.findings.has_errors() {
                let says =
                    format!("nothing that the set-up names is on block {:?}, a {}", block.name, block.form.as_str());
                let help = if block.form.is_round() { "add { ring = \"…\" }" } else { "add faces and a grid" };
                self.push_once(self.spec.error(&spec.pose.span, "program::nothing_on_block", says, help.to_owned()));
            }
        }
        Setup { spec, part: spec.part, pose, targets }
    }

    fn blocks(&mut self, mounting: &Mounting, spec: &SetupSpec) -> Vec<usize> {
        let Some(named) = &spec.blocks else { return (0..mounting.blocks.len()).collect() };
        let mut out = Vec::new();
        for name in named {
            match mounting.blocks.iter().position(|b| b.name == name.value) {
                Some(i) => out.push(i),
                None => {
                    let has: Vec<&str> = mounting.blocks.iter().map(|b| b.name.as_str()).collect();
                    self.error(
                        name,
                        "program::unknown_block",
                        format!("mounting {:?} of {} has no block {:?}", mounting.name, self.machine.name, name.value),
                        format!("it has: {}", has.join(", ")),
                    );
                }
            }
        }
        out
    }

    /// The targets on a face that is named in a frame, `to_carrier` turning that frame's directions into the carrier's.
    fn face(
        &mut self,
        b: usize,
        block: &Block,
        named: &FaceGrid,
        to_carrier: &Rotation3<f64>,
        setup: &SetupSpec,
    ) -> Vec<Target> {
        let face = named.face.value;
        let (u, v) = face.tangents();
        let along = [face.normal(), u, v].map(|d| axis_of(&(to_carrier * d)));
        let [Some(normal), Some(u), Some(v)] = along else {
            let message = match along[0] {
                None => format!(
                    "no face of block {:?} looks along machine {face} in a pose of this set-up: faces cannot be named in \
                     machine directions there",
                    block.name
                ),
                Some(own) => format!(
                    "face {} of block {:?} looks along machine {face} in a pose of this set-up, but its edges do not run \
                     along machine directions: the grid cannot be laid on it",
                    Face::from_normal(&own),
                    block.name
                ),
            };
            // the pose is what does not go together with machine directions, whichever block and face shows it
            self.push_once_per_place(
                self.spec.error(
                    &setup.pose.span,
                    "program::skew_face",
                    message,
                    "name faces in machine directions only where the carrier stands at a multiple of 90 degrees, \
                     else write faces_in = \"block\""
                        .to_owned(),
                ),
            );
            return Vec::new();
        };
        let half = |d: &Vector3<f64>| block.size.component_mul(&d.abs()).sum() / 2.0;
        let flat = match block.form {
            Form::Box => true,
            Form::Plane => normal == Vector3::z(),
            _ => normal.z != 0.0,
        };
        if !flat {
            let own = Face::from_normal(&normal);
            self.push_once_per_place(self.spec.error(
                &named.face.span,
                "program::no_face",
                format!("block {:?}, a {}, has no face {own}", block.name, block.form.as_str()),
                "a plane has +Z only, a cylinder its ends: touch its side with a ring".to_owned(),
            ));
            return Vec::new();
        }
        let mut out = Vec::new();
        for &(along_u, across) in &named.points {
            let along_v = match across {
                Across::FromCentre(mm) => mm,
                Across::Depth(mm) => half(&v) - mm,
            };
            let to_edge = match block.diameter {
                // the end of a cylinder
                Some(diameter) => diameter / 2.0 - along_u.hypot(along_v),
                None => (half(&u) - along_u.abs()).min(half(&v) - along_v.abs()),
            };
            if to_edge < 0.0 {
                let past = if to_edge < -1e9 { format!("{:e}", -to_edge) } else { format!("{:.3}", -to_edge) };
                self.push_once_per_place(self.spec.error(
                    &named.grid.span,
                    "program::off_face",
                    format!("grid {:?} reaches {past} mm past the edge of face {face}", named.grid.value),
                    format!("block {:?} measures {:?} mm: keep the points on it", block.name, block.size.as_slice()),
                ));
                continue;
            }
            if to_edge < self.machine.probe.placement_tolerance {
                let finding = Finding::warning(
                    "program::near_edge",
                    format!("grid {:?} comes within {to_edge:.3} mm of the edge of face {face}", named.grid.value),
                )
                .help(format!(
                    "a block may stand {} mm from its place: the ball can then miss the face",
                    self.machine.probe.placement_tolerance
                ))
                .at(&self.spec.source, named.grid.span.clone());
                self.push_once_per_place(finding);
            }
            let point = block.centre + normal * half(&normal) + u * along_u + v * along_v;
            out.push(Target { block: b, face: Face::from_normal(&normal).to_string(), point, normal });
        }
        out
    }
}

impl Check<'_> {
    /// The targets of a ring, `to_carrier` turning the program's frame into the carrier's.
    fn ring(&mut self, b: usize, block: &Block, ring: &RingPoints, to_carrier: &Rotation3<f64>) -> Vec<Target> {
        let mut out = Vec::new();
        for &(azimuth_deg, along) in &ring.points {
            match ring_points::place(block, azimuth_deg, along, to_carrier) {
                Ok(p) => {
                    let tolerance = self.machine.probe.placement_tolerance;
                    if let Along::Depth(mm) = along
                        && mm.min(block.size.z - mm) < tolerance
                    {
                        let says = format!("ring {:?} comes within {tolerance} mm of an end", ring.name.value);
                        let help = format!(
                            "block {:?} may stand {tolerance} mm from its place: the ball can then miss its wall",
                            block.name
                        );
                        self.push_once_per_place(self.spec.error(&ring.name.span, "program::near_edge", says, help));
                    }
                    out.push(Target { block: b, face: p.label, point: p.point, normal: p.normal });
                }
                Err(reason) => {
                    let says = format!("ring {:?} does not fit block {:?}: {reason}", ring.name.value, block.name);
                    let help = format!("block {:?} is a {}", block.name, block.form.as_str());
                    self.push_once_per_place(self.spec.error(&ring.name.span, "program::ring", says, help));
                }
            }
        }
        out
    }
}

/// The axis of a frame that a direction lies along, exact; `None` when it lies askew.
fn axis_of(direction: &Vector3<f64>) -> Option<Vector3<f64>> {
    let rounded = direction.map(f64::round);
    // adding zero turns -0 into 0, so that files do not show it
    ((direction - rounded).norm() < 1e-9).then(|| rounded.add_scalar(0.0))
}
