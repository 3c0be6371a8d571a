//! The virtual machine without any error, for a program that is run as a check: where its ball first meets a block, and
//! which axis positions a tool centre point means.

use super::chain::{Chain, Stylus};
use super::contact::{Body, Contact, first_contact};
use super::rigid::{Vec3, minus, norm, plus, solve};
use super::terms::Shifts;
use crate::axes::Position;
use crate::machine::{Machine, Mounting};

/// A ball this near to a block touches it, mm.
const TOUCHING_MM: f64 = 1e-6;

/// Axis positions that differ by less are the same, mm or deg.
const STILL: f64 = 1e-9;

/// A machine with blocks on it and a stylus in its probe.
#[derive(Debug, Clone)]
pub struct Errorless {
    chain: Chain,
    nothing: Shifts,
    stylus: Stylus,
    radius_mm: f64,
    blocks: Vec<Block>,
}

#[derive(Debug, Clone)]
struct Block {
    name: String,
    links: usize,
    centre: Vec3,
    body: Body,
}

/// Where a move meets a block.
#[derive(Debug, Clone, PartialEq)]
pub struct Met {
    /// Part of the way, 0 to 1.
    pub part: f64,
    /// The block's name.
    pub block: String,
}

impl Errorless {
    /// `machine` has the stylus in its probe; `mounting`: `None` for an empty table.
    #[must_use]
    pub fn new(machine: &Machine, mounting: Option<&Mounting>) -> Self {
        let p = &machine.reference.pivot;
        let chain = Chain::new(machine, [p.x, p.y, p.z]);
        let blocks = mounting.map(|m| m.blocks.as_slice()).unwrap_or_default().iter().map(|b| Block {
            name: b.name.clone(),
            links: chain.links_to(b.carrier),
            centre: [b.centre.x, b.centre.y, b.centre.z],
            body: Body {
                form: b.form,
                half: [b.size.x / 2.0, b.size.y / 2.0, b.size.z / 2.0],
                radius: b.diameter.unwrap_or_default() / 2.0,
            },
        });
        Self {
            blocks: blocks.collect(),
            nothing: Shifts::default(),
            stylus: Stylus { length_mm: machine.tool.length_mm, spindle_deg: 0.0 },
            radius_mm: machine.probe.ball_radius,
            chain,
        }
    }

    /// The ball's centre in the frame of a block (origin at its centre).
    fn in_block(&self, block: &Block, at: &Position) -> Vec3 {
        minus(self.chain.ball_in(at, &self.nothing, block.links, self.stylus), block.centre)
    }

    /// Does the ball touch a block here?
    #[must_use]
    pub fn touches(&self, at: &Position) -> bool {
        self.blocks.iter().any(|b| b.body.distance(self.in_block(b, at)).0 - self.radius_mm <= TOUCHING_MM)
    }

    /// Where a straight move of linear axes first meets a block. A move that begins in contact meets it at 0.
    #[must_use]
    pub fn first(&self, from: &Position, to: &Position) -> Option<Met> {
        let at = |s: f64| {
            let mut p = *from;
            for (slot, (a, b)) in p.0.iter_mut().zip(from.0.iter().zip(to.0)) {
                *slot = a + s * (b - a);
            }
            p
        };
        let turned = from.0[3..].iter().zip(&to.0[3..]).any(|(a, b)| (a - b).abs() > STILL);
        let mut first: Option<Met> = None;
        for block in &self.blocks {
            let place = |s: f64| self.in_block(block, &at(s));
            // far most moves end far from a block: the ball's way is no longer than the larger of its two distances
            let (begin, end) = (place(0.0), place(1.0));
            if !turned {
                let way = norm(minus(end, begin));
                let gap = block.body.distance(begin).0.min(block.body.distance(end).0) - self.radius_mm;
                if gap > way {
                    continue;
                }
            }
            let part = match first_contact(&place, !turned, &block.body, self.radius_mm) {
                Contact::Met { at, .. } => at,
                Contact::Already(_) => 0.0,
                Contact::Missed => continue,
            };
            if first.as_ref().is_none_or(|m| part < m.part) {
                first = Some(Met { part, block: block.name.clone() });
            }
        }
        first
    }

    /// The axis positions of a tool centre point in the frame of what bears the workpiece (equal to the axis positions
    /// while all rotary axes stand at 0). `None` when the linear axes do not span space.
    #[must_use]
    pub fn axes_of_tcp(&self, tcp: &Position) -> Option<Position> {
        let links = self.chain.links_to_workpiece();
        let ball = |at: &Position| self.chain.ball_in(at, &self.nothing, links, self.stylus);
        let at_zero = ball(&Position::default());
        let wanted = plus([tcp.0[0], tcp.0[1], tcp.0[2]], 1.0, at_zero);
        let with = |xyz: Vec3| Position([xyz[0], xyz[1], xyz[2], tcp.0[3], tcp.0[4], tcp.0[5]]);
        let origin = ball(&with([0.0; 3]));
        let column = |unit: Vec3| minus(ball(&with(unit)), origin);
        let columns = [column([1.0, 0.0, 0.0]), column([0.0, 1.0, 0.0]), column([0.0, 0.0, 1.0])];
        Some(with(solve(columns, minus(wanted, origin))?))
    }
}
