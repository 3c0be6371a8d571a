//! Proof that a move is clear: the least gap between every part of the probe and every solid over the whole move.
//!
//! A move of linear axes shifts the tool against each carrier along a straight line without turning it. The distance of
//! two convex solids is then a convex function of the way (both are convex sets, one is shifted), and it changes by no
//! more than the way itself: between samples these two laws bound it from below. A move of one rotary axis turns the
//! tool or a carrier: no point moves further than its distance from the axis times the angle. A piece that cannot be
//! proven clear at the finest subdivision counts as not clear.

use super::scene::{Obstacle, Part, Placement, Role, Scene, Solid, box_gap};
use crate::axes::{AxisName, Position};
use crate::units::rad_from_deg;
use nalgebra::Vector3;
use parry3d_f64::bounding_volume::Aabb;
use parry3d_f64::math::Vec3;

/// Pieces of a move are not halved below this way, mm: gaps that come within half of it of what is needed count as
/// too small. A thousandth of the usual clearance.
const FINEST_WAY_MM: f64 = 5e-4;

/// What a move must keep.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Manner {
    /// It cannot stop: what was set up by hand may stand off by the placement tolerance, on top of the clearance.
    Rapid,
    /// It stops when the probe trips: the clearance to everything. Body and head, which trip nothing, keep the room of a
    /// rapid.
    Guarded,
    /// A search up to the nominal contact with this block: only the ball may come near it.
    ToContact(usize),
    /// The rest of a search, run only where this block stands farther off: everything else keeps its clearance. The
    /// block itself is then not where the scene has it; against its real place the probe stands as at contact.
    PastContact(usize),
    /// The same of a search that finds the artefact: where the block stands farther off, all that is mounted with it does.
    PastArtefact(usize),
}

/// Two things that come too near.
#[derive(Debug, Clone, PartialEq)]
pub struct Hit {
    /// The part of the probe.
    pub part: Part,
    /// What it meets.
    pub obstacle: String,
    /// The gap that is left, mm; 0: they overlap.
    pub gap_mm: f64,
    /// The gap that is needed, mm.
    pub needed_mm: f64,
}

/// Two lengths in as many digits as it takes to see the difference, two at least. A gap that is less by no more than the proof resolves, or
/// that is proven too late to count, is shown just below what is needed.
pub(crate) fn told_apart(gap_mm: f64, needed_mm: f64) -> (String, String) {
    const MOST: usize = 4;
    let shown = |decimals: usize| (format!("{gap_mm:.decimals$}"), format!("{needed_mm:.decimals$}"));
    let apart = (2..=MOST).map(shown).find(|(gap, needed)| gap != needed && gap_mm < needed_mm);
    apart.unwrap_or_else(|| {
        let needed = format!("{needed_mm:.MOST$}");
        let step = 0.1_f64.powi(4);
        (format!("{:.MOST$}", (needed_mm - step).max(0.0)), needed)
    })
}

impl std::fmt::Display for Hit {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { part, obstacle, gap_mm, needed_mm } = self;
        if *gap_mm > 0.0 {
            let (gap, needed) = told_apart(*gap_mm, *needed_mm);
            write!(f, "the {part} would come within {gap} mm of {obstacle} ({needed} mm is needed)")
        } else {
            write!(f, "the {part} would hit {obstacle}")
        }
    }
}

impl Scene<'_> {
    /// Gap that a part must keep from an obstacle, mm; `None`: it is allowed to touch.
    fn needed(&self, part: Part, obstacle: &Obstacle, manner: Manner) -> Option<f64> {
        let probe = &self.machine.probe;
        let needed = match (manner, obstacle.role) {
            (Manner::Rapid, Role::Block(_) | Role::Mounted) => Some(probe.clearance + probe.placement_tolerance),
            (Manner::ToContact(b), Role::Block(o)) if b == o && part == Part::Ball => None,
            (Manner::PastContact(b) | Manner::PastArtefact(b), Role::Block(o)) if b == o => None,
            (Manner::PastArtefact(_), Role::Mounted) => None,
            // body and head trip nothing: no control stops them
            (_, Role::Block(_) | Role::Mounted) if matches!(part, Part::Head | Part::Body) => {
                Some(probe.clearance + probe.placement_tolerance)
            }
            _ => Some(probe.clearance),
        };
        // at its contact a search is relative to the block, wherever that stands
        let at_contact = |b: usize| obstacle.role == Role::Block(b) && matches!(part, Part::Ball | Part::Stem);
        let displacement = match manner {
            Manner::ToContact(b) if at_contact(b) => 0.0,
            _ => self.displacement_mm(obstacle.role, manner == Manner::Rapid),
        };
        needed.map(|mm| (mm + displacement - self.slack_mm).max(0.0))
    }

    /// The box along R's axes of each part of the tool.
    fn boxes(&self, placed: &Placement) -> Vec<Aabb> {
        self.parts.iter().map(|(_, solid)| solid.aabb(&placed.tool)).collect()
    }

    /// Proves a straight move of linear axes clear.
    ///
    /// # Errors
    /// The tightest place that is not clear.
    pub fn clear_straight(&self, from: &Position, to: &Position, manner: Manner) -> Result<(), Hit> {
        let (start, end) = (self.place(from), self.place(to));
        let mut worst: Option<Hit> = None;
        let tool_way = end.tool.translation.vector - start.tool.translation.vector;
        let boxes = self.boxes(&start);
        for obstacle in &self.obstacles {
            let (Some(before), Some(after)) =
                (start.carriers.get(obstacle.carrier), end.carriers.get(obstacle.carrier))
            else {
                continue;
            };
            let way = tool_way - (after.translation.vector - before.translation.vector);
            let obstacle_box = obstacle.solid.aabb(before);
            for ((part, solid), own) in self.parts.iter().zip(&boxes) {
                let Some(needed) = self.needed(*part, obstacle, manner) else { continue };
                // the box of the whole move against the obstacle's: far most pairs end here
                let mut swept = *own;
                let shift = Vec3::new(way.x, way.y, way.z);
                swept.mins = swept.mins.min(swept.mins + shift);
                swept.maxs = swept.maxs.max(swept.maxs + shift);
                if box_gap(&swept, &obstacle_box) >= needed {
                    continue;
                }
                let line = Straight { scene: self, solid, obstacle, start: &start, way };
                if let Err(gap_mm) = line.prove(needed) {
                    keep_worst(
                        &mut worst,
                        Hit { part: *part, obstacle: obstacle.name.clone(), gap_mm, needed_mm: needed },
                    );
                }
            }
        }
        worst.map_or(Ok(()), Err)
    }

    /// Proves the whole box that a rapid of several linear axes spans clear: each axis may run at its own speed. By
    /// bounding boxes only, so that boxes that come near anything count as not clear.
    ///
    /// # Errors
    /// The first pair that is not clear.
    pub fn clear_box(&self, from: &Position, to: &Position) -> Result<(), Hit> {
        let start = self.place(from);
        let ends: Vec<Placement> = [AxisName::X, AxisName::Y, AxisName::Z]
            .into_iter()
            .map(|axis| {
                let mut end = *from;
                end.set(axis, to.get(axis));
                self.place(&end)
            })
            .collect();
        let boxes = self.boxes(&start);
        for obstacle in &self.obstacles {
            let Some(before) = start.carriers.get(obstacle.carrier) else { continue };
            let obstacle_box = obstacle.solid.aabb(before);
            for ((part, _), own) in self.parts.iter().zip(&boxes) {
                let Some(needed) = self.needed(*part, obstacle, Manner::Rapid) else { continue };
                let mut swept = *own;
                for end in &ends {
                    let Some(after) = end.carriers.get(obstacle.carrier) else { continue };
                    let tool = end.tool.translation.vector - start.tool.translation.vector;
                    let way = tool - (after.translation.vector - before.translation.vector);
                    let shift = Vec3::new(way.x, way.y, way.z);
                    swept.mins = swept.mins.min(swept.mins + shift);
                    swept.maxs = swept.maxs.max(swept.maxs + shift);
                }
                let gap_mm = box_gap(&swept, &obstacle_box);
                if gap_mm < needed {
                    return Err(Hit { part: *part, obstacle: obstacle.name.clone(), gap_mm, needed_mm: needed });
                }
            }
        }
        Ok(())
    }

    /// Proves a move of one rotary axis clear.
    ///
    /// # Errors
    /// The tightest place that is not clear.
    pub fn clear_turn(&self, at: &Position, axis: AxisName, to_deg: f64) -> Result<(), Hit> {
        let from_deg = at.get(axis);
        let mut end = *at;
        end.set(axis, to_deg);
        let (Some(described), start) = (self.machine.axis(axis), self.place(at)) else { return Ok(()) };
        let line = self.axis_line(described, at);
        let angle = rad_from_deg(to_deg - from_deg).abs();
        let on_tool = self.side_of(axis) == Some(crate::machine::Side::Tool);
        let mut worst: Option<Hit> = None;
        for obstacle in &self.obstacles {
            let turns = self.carries(axis, obstacle.carrier);
            if !on_tool && !turns {
                continue; // neither of the two moves: the moves before and after prove it
            }
            let Some(carrier) = start.carriers.get(obstacle.carrier) else { continue };
            for (part, solid) in &self.parts {
                let Some(needed) = self.needed(*part, obstacle, Manner::Rapid) else { continue };
                let radius = if on_tool {
                    Self::radius_about(&line, solid, &start.tool)
                } else {
                    Self::radius_about(&line, &obstacle.solid, carrier)
                };
                let turn = Turn { scene: self, solid, obstacle, from: at, axis, to_deg };
                if let Err(gap_mm) = turn.prove(0.0, 1.0, radius * angle, needed) {
                    keep_worst(
                        &mut worst,
                        Hit { part: *part, obstacle: obstacle.name.clone(), gap_mm, needed_mm: needed },
                    );
                }
            }
        }
        worst.map_or(Ok(()), Err)
    }
}

fn keep_worst(worst: &mut Option<Hit>, hit: Hit) {
    if worst.as_ref().is_none_or(|w| hit.gap_mm < w.gap_mm) {
        *worst = Some(hit);
    }
}

/// A pair of solids of which one is shifted along a straight line.
struct Straight<'a, 'm> {
    scene: &'a Scene<'m>,
    solid: &'a Solid,
    obstacle: &'a Obstacle,
    start: &'a Placement,
    /// Whole shift of the tool against the obstacle, mm.
    way: Vector3<f64>,
}

impl Straight<'_, '_> {
    fn gap(&self, t: f64) -> f64 {
        let mut placed = self.start.clone();
        placed.tool.translation.vector += self.way * t;
        self.scene.gap(self.solid, self.obstacle, &placed)
    }

    /// `Err` with the gap where it is too small.
    fn prove(&self, needed: f64) -> Result<(), f64> {
        let (a, b) = (self.gap(0.0), self.gap(1.0));
        if a.min(b) < needed {
            return Err(self.least(0.0, 1.0));
        }
        self.between(0.0, 1.0, a, b, needed)
    }

    /// The ends of the piece are clear; is everything between them?
    fn between(&self, from: f64, to: f64, at_from: f64, at_to: f64, needed: f64) -> Result<(), f64> {
        let way = self.way.norm() * (to - from);
        // the gap falls by no more than the way
        if (at_from + at_to - way) / 2.0 >= needed {
            return Ok(());
        }
        let middle = (from + to) / 2.0;
        let at_middle = self.gap(middle);
        if at_middle < needed || way < FINEST_WAY_MM {
            return Err(self.least(from, to));
        }
        // convex: the line through two samples, carried on past the nearer one, lies below the gap
        if at_middle.min(2.0 * at_middle - at_to) < needed {
            self.between(from, middle, at_from, at_middle, needed)?;
        }
        if at_middle.min(2.0 * at_middle - at_from) < needed {
            self.between(middle, to, at_middle, at_to, needed)?;
        }
        Ok(())
    }

    /// The least gap on a piece, by golden section: for the message only.
    fn least(&self, mut from: f64, mut to: f64) -> f64 {
        const SECTION: f64 = 0.381_966_011_250_105;
        let mut least = self.gap(from).min(self.gap(to));
        for _ in 0..30 {
            let (a, b) = (from + SECTION * (to - from), to - SECTION * (to - from));
            let (at_a, at_b) = (self.gap(a), self.gap(b));
            least = least.min(at_a).min(at_b);
            if at_a < at_b {
                to = b;
            } else {
                from = a;
            }
        }
        least
    }
}

/// A pair of solids of which one is turned by a rotary axis.
struct Turn<'a, 'm> {
    scene: &'a Scene<'m>,
    solid: &'a Solid,
    obstacle: &'a Obstacle,
    from: &'a Position,
    axis: AxisName,
    to_deg: f64,
}

impl Turn<'_, '_> {
    /// `way`: how far a point moves at most over the piece, mm.
    fn prove(&self, from: f64, to: f64, way: f64, needed: f64) -> Result<(), f64> {
        let middle = (from + to) / 2.0;
        let mut at = *self.from;
        at.set(self.axis, at.get(self.axis) + (self.to_deg - at.get(self.axis)) * middle);
        let placed = self.scene.place(&at);
        let boxes = placed
            .carriers
            .get(self.obstacle.carrier)
            .map_or(0.0, |c| box_gap(&self.solid.aabb(&placed.tool), &self.obstacle.solid.aabb(c)));
        // the two ends are half the way from the middle
        if boxes - way / 2.0 >= needed {
            return Ok(());
        }
        let gap = self.scene.gap(self.solid, self.obstacle, &placed);
        if gap - way / 2.0 >= needed {
            return Ok(());
        }
        if gap < needed || way < FINEST_WAY_MM {
            return Err(gap);
        }
        self.prove(from, middle, way / 2.0, needed)?;
        self.prove(middle, to, way / 2.0, needed)
    }
}
