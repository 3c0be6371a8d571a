//! The control between program and axes: what an exported compensation makes of a commanded position.
//!
//! A commanded position is that of the errorless machine's axes. The control's kinematics turns it into positions of the
//! linear axes, home offsets and axis tables add what they hold, and so the real axes move.

mod component;
mod lines;
mod loaded;
mod stock;
mod table;
mod written;

use super::chain::{Chain, Stylus};
use super::rigid::{Vec3, minus, plus};
use super::terms::Shifts;
use crate::axes::{AxisName, Position};
use component::Component;
use lines::Vectors;
use loaded::Cross;
use stock::TiltingTable;
use table::Table;

pub use written::FORMAT;

/// A compensation as the control applies it.
#[derive(Debug, Clone)]
pub struct Compensation {
    kinematics: Kinematics,
    /// How much less than the commanded angle the rotary axes are told, deg.
    told_less_deg: [f64; 6],
    tables: Vec<Table>,
    cross: Vec<Cross>,
}

/// What the control computes with.
#[derive(Debug, Clone)]
enum Kinematics {
    /// Commanded positions are joint positions.
    Identity,
    /// The exported component: its world coordinates are the axis positions of the errorless machine.
    Component(Box<Component>),
    /// LinuxCNC's own kinematics of a tilting table with a turntable; acts on tool centre point programs only.
    TiltingTable(TiltingTable),
    /// Vectors of the control's own transformation; acts on tool centre point programs only.
    Vectors(Box<Vectors>),
}

impl Compensation {
    /// Does its kinematics act on a program of this frame? The message says why not.
    pub(super) fn acts_on(&self, tcp: bool) -> Result<(), &'static str> {
        match (&self.kinematics, tcp) {
            (Kinematics::TiltingTable(_), false) => Err("the pins of the control's own kinematics act only under its \
                transformation: without it home offsets and axis tables are all that shows"),
            (Kinematics::Vectors(_), false) => {
                Err("the vectors of the control's own transformation act only under it: \
                without it zero positions and position tables are all that shows")
            }
            (Kinematics::Component(_), true) => {
                Err("the kinematics component knows axis positions only, no tool centre point")
            }
            _ => Ok(()),
        }
    }

    /// How the control moves the axes during a touch from `start` to `end`.
    ///
    /// # Errors
    /// When the control could not move there.
    pub(super) fn mapping(
        &self,
        nominal: &Chain,
        tcp: bool,
        (start, end): (&Position, &Position),
        last_sense: &[f64; 6],
        stylus: Stylus,
    ) -> Result<Mapping<'_>, &'static str> {
        let linear = match &self.kinematics {
            Kinematics::Component(component) => component.linear(nominal, start, stylus)?,
            Kinematics::TiltingTable(table) if tcp => table.linear(nominal, start, stylus),
            Kinematics::Vectors(vectors) if tcp => vectors.linear(nominal, start, stylus),
            Kinematics::Identity | Kinematics::TiltingTable(_) | Kinematics::Vectors(_) => Linear::SAME,
        };
        let mut out = Mapping {
            linear,
            told_less_deg: self.told_less_deg,
            tables: &self.tables,
            cross: &self.cross,
            up: [false; 6],
        };
        let (from, to) = (out.kinematic(start), out.kinematic(end));
        for name in AxisName::ALL {
            let i = name.index();
            let moves = to.get(name) - from.get(name);
            out.up[i] = if moves == 0.0 { last_sense[i] > 0.0 } else { moves > 0.0 };
        }
        Ok(out)
    }
}

/// Linear axes from commanded linear axes, at one pose of the rotary axes: offset + columns · commanded.
#[derive(Debug, Clone, Copy)]
pub(super) struct Linear {
    /// mm at commanded zero.
    offset: Vec3,
    /// What each commanded mm does.
    columns: [Vec3; 3],
}

impl Linear {
    /// As commanded.
    const SAME: Self = Self { offset: [0.0; 3], columns: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]] };

    /// From a function that is affine in the commanded axes.
    fn linearise(place: impl Fn(Vec3) -> Vec3) -> Self {
        // a step of machine size, a power of two: the difference loses no digits, the division is exact
        const STEP_MM: f64 = 512.0;
        let offset = place([0.0; 3]);
        let column = |i: usize| {
            let mut at = [0.0; 3];
            at[i] = STEP_MM;
            minus(place(at), offset).map(|d| d / STEP_MM)
        };
        Self { offset, columns: [column(0), column(1), column(2)] }
    }

    /// The ball in the workpiece for linear axes at a pose.
    fn ball_in_workpiece(chain: &Chain, shifts: &Shifts, pose: &Position, stylus: Stylus) -> Self {
        Self::linearise(|linear| {
            let mut at = *pose;
            at.0[..3].copy_from_slice(&linear);
            chain.ball_in(&at, shifts, chain.links_to_workpiece(), stylus)
        })
    }

    fn at(&self, commanded: Vec3) -> Vec3 {
        self.columns.iter().zip(commanded).fold(self.offset, |sum, (column, q)| plus(sum, q, *column))
    }
}

/// Commanded position → positions of the axes during one touch.
#[derive(Debug, Clone, Copy)]
pub struct Mapping<'a> {
    linear: Linear,
    told_less_deg: [f64; 6],
    tables: &'a [Table],
    cross: &'a [Cross],
    /// Which axes move up.
    up: [bool; 6],
}

impl Mapping<'_> {
    /// A control without any compensation.
    pub const DIRECT: Mapping<'static> =
        Mapping { linear: Linear::SAME, told_less_deg: [0.0; 6], tables: &[], cross: &[], up: [false; 6] };

    /// Does a straight commanded line give a straight line of the axes?
    pub fn is_affine(&self) -> bool {
        self.tables.iter().all(|t| t.axis.is_rotary()) && self.cross.iter().all(|c| c.input.is_rotary())
    }

    /// What the kinematics says.
    fn kinematic(&self, commanded: &Position) -> Position {
        let mut out = *commanded;
        let [x, y, z, ..] = commanded.0;
        out.0[..3].copy_from_slice(&self.linear.at([x, y, z]));
        for (q, less) in out.0.iter_mut().zip(self.told_less_deg) {
            *q -= less;
        }
        out
    }

    /// The axes' positions for a commanded position.
    pub fn joints(&self, commanded: &Position) -> Position {
        let kinematic = self.kinematic(commanded);
        let mut out = kinematic;
        for cross in self.cross {
            let added = cross.added(kinematic.get(cross.input), self.up[cross.input.index()]);
            out.set(cross.output, out.get(cross.output) + added);
        }
        for table in self.tables {
            let told = out.get(table.axis);
            out.set(table.axis, told + table.added(told, self.up[table.axis.index()]));
        }
        out
    }
}
