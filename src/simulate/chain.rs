//! The real chain, evaluated forward: base → axes with their errors → ball, and base → axes with theirs → block.

use super::rigid::{Rigid, Vec3, cross, dot, minus, norm, plus, sin_cos_deg, unit};
use super::terms::Shifts;
use crate::axes::{AxisName, Position};
use crate::machine::{self, Carrier, Machine, Side};
use crate::units::deg_from_rad;

/// One axis on the way from the base.
#[derive(Debug, Clone)]
struct Link {
    axis: AxisName,
    direction: Vec3,
    /// A point of a rotary axis, mm.
    point: Vec3,
    /// What a positive coordinate does: the sense of a rotary axis; a linear axis of the workpiece side moves backwards
    /// because its coordinate says where the tool is over the workpiece.
    sign: f64,
    /// About which points its errors before and after its motion turn, mm.
    error_points: [Vec3; 2],
    /// Of a rotary axis: its own frame, with the origin at the point of its own line where its error motions are stated.
    own: Rigid,
}

impl Link {
    fn motion(&self, joints: &Position, reading: f64) -> Rigid {
        let q = joints.get(self.axis);
        if self.axis.is_rotary() {
            let (s, c) = sin_cos_deg(self.sign * q);
            let real = if reading == 0.0 {
                (s, c)
            } else {
                let (ds, dc) = sin_cos_deg(self.sign * deg_from_rad(reading));
                (s * dc + c * ds, c * dc - s * ds)
            };
            Rigid::turn(self.direction, self.point, real)
        } else {
            Rigid::shift(plus([0.0; 3], self.sign * (q + reading), self.direction))
        }
    }

    /// An error motion on the axis's own line: out of R into the axis's frame, the error there, and back.
    fn on_own_line(&self, six: &[f64; 6]) -> Rigid {
        self.own.then(&Rigid::error(six, [0.0; 3])).then(&self.own.inverse())
    }
}

/// The frame in which the error motions of a rotary axis count, with its origin on the axis's line: where the line passes
/// nearest to the ball at zero for an axis that bears the workpiece, at the axis's own point in the head.
fn own_frame(axis: &machine::Axis, ball: Vec3) -> Rigid {
    let line = [axis.direction.x, axis.direction.y, axis.direction.z];
    let point = [axis.point.x, axis.point.y, axis.point.z];
    let origin = match axis.side {
        Side::Tool => point,
        Side::Workpiece => plus(point, dot(line, minus(ball, point)), line),
    };
    let mut letter = [0.0; 3];
    letter[axis.name.index() % 3] = 1.0;
    // the letter's direction is turned onto the line by the smaller of the two ways, over the edge that both enclose
    let line = if dot(letter, line) < 0.0 { plus([0.0; 3], -1.0, line) } else { line };
    let edge = cross(letter, line);
    let sine = norm(edge);
    if sine < 1e-9 {
        return Rigid::shift(origin);
    }
    Rigid::shift(origin).then(&Rigid::turn(unit(edge), [0.0; 3], (sine, dot(letter, line))))
}

/// Where ball and carrier really are.
#[derive(Debug, Clone, Copy)]
pub struct Place {
    /// The ball's centre in R, mm.
    pub ball: Vec3,
    /// The carrier's frame in R.
    pub carrier: Rigid,
}

/// The two branches of a machine.
#[derive(Debug, Clone)]
pub struct Chain {
    workpiece: Vec<Link>,
    tool: Vec<Link>,
    /// Where tool lengths are measured from, mm in R.
    pivot: Vec3,
    /// From the ball to the spindle.
    tool_direction: Vec3,
}

/// A coordinate says where the tool is over the workpiece: what bears the workpiece goes, and stands, the other way.
pub(super) fn goes_backwards(axis: &machine::Axis) -> bool {
    !axis.name.is_rotary() && axis.side == Side::Workpiece
}

impl Chain {
    /// The chain of a machine; `reference` is the point (mm in R) at which errors of workpiece-side rotary axes are
    /// stated.
    pub fn new(machine: &Machine, reference: Vec3) -> Self {
        let ball = [machine.reference.ball.x, machine.reference.ball.y, machine.reference.ball.z];
        let links = |side: Side| {
            let axes = machine.axes.iter().filter(move |a| a.side == side);
            axes.map(move |a| {
                let rotary = a.name.is_rotary();
                let point = [a.point.x, a.point.y, a.point.z];
                let backwards = goes_backwards(a);
                let error_points = match (rotary, side) {
                    (false, _) => [[0.0; 3]; 2],
                    // what moves with the table is stated at the axis, not at a point that stands still
                    (true, Side::Workpiece) => [reference, point],
                    (true, Side::Tool) => [point; 2],
                };
                let own = if rotary { own_frame(a, ball) } else { Rigid::STILL };
                let sign = if backwards { -1.0 } else { a.sense };
                Link {
                    axis: a.name,
                    direction: [a.direction.x, a.direction.y, a.direction.z],
                    point,
                    sign,
                    error_points,
                    own,
                }
            })
            .collect()
        };
        let (p, d) = (&machine.tool.pivot, &machine.tool.direction);
        Self {
            workpiece: links(Side::Workpiece),
            tool: links(Side::Tool),
            pivot: [p.x, p.y, p.z],
            tool_direction: [d.x, d.y, d.z],
        }
    }

    /// How many axes of the workpiece side stand between the base and a carrier.
    pub fn links_to(&self, carrier: Carrier) -> usize {
        match carrier {
            Carrier::Base => 0,
            Carrier::Table => self.workpiece.iter().take_while(|l| !l.axis.is_rotary()).count(),
            Carrier::Axis(name) => self.workpiece.iter().position(|l| l.axis == name).map_or(0, |i| i + 1),
        }
    }

    /// All axes of the workpiece side.
    pub fn links_to_workpiece(&self) -> usize {
        self.workpiece.len()
    }

    /// From the ball to the spindle, in R at zero.
    pub fn tool_direction(&self) -> Vec3 {
        self.tool_direction
    }

    fn frame(links: &[Link], joints: &Position, shifts: &Shifts) -> Rigid {
        let mut out = Rigid::STILL;
        for link in links {
            let i = link.axis.index();
            if shifts.before[i] != [0.0; 6] {
                out = out.then(&Rigid::error(&shifts.before[i], link.error_points[0]));
            }
            if shifts.line_before[i] != [0.0; 6] {
                out = out.then(&link.on_own_line(&shifts.line_before[i]));
            }
            out = out.then(&link.motion(joints, shifts.reading[i]));
            if shifts.line_after[i] != [0.0; 6] {
                out = out.then(&link.on_own_line(&shifts.line_after[i]));
            }
            if shifts.after[i] != [0.0; 6] {
                out = out.then(&Rigid::error(&shifts.after[i], link.error_points[1]));
            }
        }
        out
    }

    /// The tool's frame in R (it coincides with R at zero).
    pub fn tool_frame(&self, joints: &Position, shifts: &Shifts) -> Rigid {
        Self::frame(&self.tool, joints, shifts)
    }

    /// Where the ball and the carrier (after `n_links` axes) are, for a stylus of a length (mm) in a spindle turned by
    /// an angle (deg, right-handed about the tool's direction).
    pub fn place(&self, joints: &Position, shifts: &Shifts, n_links: usize, stylus: Stylus) -> Place {
        let links = &self.workpiece[..n_links.min(self.workpiece.len())];
        let tool = self.tool_frame(joints, shifts);
        let mut ball = plus(self.pivot, -(stylus.length_mm + shifts.length), self.tool_direction);
        ball = plus(ball, 1.0, shifts.ball_tool);
        if shifts.ball_stylus != [0.0; 3] {
            ball = plus(ball, 1.0, self.spindle(stylus.spindle_deg).outward_direction(shifts.ball_stylus));
        }
        if shifts.tool != [0.0; 6] {
            ball = Rigid::error(&shifts.tool, self.pivot).outward(ball);
        }
        let mut ball = plus(tool.outward(ball), 1.0, shifts.ball_machine);
        if shifts.base != [0.0; 6] {
            ball = Rigid::error(&shifts.base, [0.0; 3]).outward(ball);
        }
        let mut carrier = Self::frame(links, joints, shifts);
        if shifts.workpiece != [0.0; 6] {
            carrier = carrier.then(&Rigid::error(&shifts.workpiece, [0.0; 3]));
        }
        Place { ball, carrier }
    }

    /// The turn of the spindle in the tool's frame.
    pub fn spindle(&self, deg: f64) -> Rigid {
        Rigid::turn(self.tool_direction, [0.0; 3], sin_cos_deg(deg))
    }

    /// The ball's centre in a carrier's frame, mm.
    pub fn ball_in(&self, joints: &Position, shifts: &Shifts, n_links: usize, stylus: Stylus) -> Vec3 {
        let place = self.place(joints, shifts, n_links, stylus);
        place.carrier.inward(place.ball)
    }

    /// Away from the centre line of a carrier: the unit vector from its rotary axis (or R's z axis for a carrier that
    /// does not turn) to a place in its frame.
    pub fn outward_from_centre(&self, n_links: usize, place: Vec3) -> Vec3 {
        let last = self.workpiece[..n_links.min(self.workpiece.len())].last().filter(|l| l.axis.is_rotary());
        let (foot, along) = last.map_or(([0.0; 3], [0.0, 0.0, 1.0]), |l| (l.point, l.direction));
        let arm = minus(place, foot);
        let across = plus(arm, -dot(arm, along), along);
        if norm(across) > 1e-9 { unit(across) } else { [0.0; 3] }
    }
}

/// The stylus as it is clamped.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Stylus {
    /// Pivot to ball's centre, mm.
    pub length_mm: f64,
    /// Turn of the spindle, deg.
    pub spindle_deg: f64,
}
