//! Can this point be touched in this pose? Where does the search begin and end, and if not: why not.

use super::heights::Lift;
use super::layout::Target;
use super::scene::Scene;
use super::sweep::Manner;
use crate::axes::Position;
use crate::machine::Carrier;
use crate::units::Plain;

/// A search ends at least this far past the placement tolerance, mm: a block at the very limit must still be met.
const PAST_TOLERANCE_MM: f64 = 0.1;

/// Steps in which a search is shortened where something stands behind the face, mm.
const SHORTEN_BY_MM: f64 = 0.1;

/// Places are kept to this, mm: a picometre is finer than any control and keeps 7.999999999999971 out of the files.
const PLACES_MM: f64 = 1e-9;

/// Axis positions of a touch that can be made.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Reached {
    /// Where the search begins.
    pub start: Position,
    /// Where an errorless machine triggers.
    pub nominal: Position,
    /// Where the search gives up.
    pub end: Position,
}

impl Scene<'_> {
    /// How far past the nominal contact a search may go, mm: the least and the greatest way.
    ///
    /// The greatest keeps the push inside the overtravel even for a probe that never triggers against a block that stands
    /// nearer by the tolerance. `None`: the probe's figures leave no room for a search.
    #[must_use]
    pub fn search_past_mm(&self) -> Option<[f64; 2]> {
        let probe = &self.machine.probe;
        let least = probe.placement_tolerance + PAST_TOLERANCE_MM;
        let greatest = probe.search.min(probe.overtravel - probe.placement_tolerance);
        (least <= greatest).then_some([least, greatest])
    }

    /// Tries to reach a target: inside the axis limits, clear on the way down from `over_all` and during the search.
    ///
    /// # Errors
    /// The reason, for a person.
    pub fn reach(
        &self,
        lift: &Lift,
        carrier: Carrier,
        pose: &Position,
        target: &Target,
        over_all: f64,
    ) -> Result<Reached, String> {
        let probe = &self.machine.probe;
        let [least, greatest] = self.search_past_mm().ok_or("the probe's overtravel leaves no room for a search")?;
        let ball_at = |off_face: f64| {
            let place = target.point + target.normal * (probe.ball_radius + off_face);
            let at = self.machine.linear_for_ball(carrier, pose, &place, self.machine.tool.length_mm);
            at.map(|p| tidy(&p)).ok_or_else(|| "the linear axes do not span space in this pose".to_owned())
        };
        let (start, nominal) = (ball_at(probe.approach)?, ball_at(0.0)?);
        self.inside_limits(&start)?;
        self.inside_limits(&nominal)?;
        self.clear_straight(&start, &nominal, Manner::ToContact(target.block)).map_err(|hit| hit.to_string())?;

        let mut past = greatest;
        let end = loop {
            let end = ball_at(-past)?;
            let clear = self.inside_limits(&end).and_then(|()| {
                self.clear_straight(&nominal, &end, Manner::PastContact(target.block))
                    .map_err(|hit| format!("at the end of the search {hit}"))
            });
            match clear {
                Ok(()) => break end,
                Err(reason) if past <= least => return Err(reason),
                Err(_) => past = (past - SHORTEN_BY_MM).max(least),
            }
        };

        let mut above = start;
        above.set(lift.axis, lift.coordinate(lift.height(&start).max(over_all)));
        self.inside_limits(&above).map_err(|reason| format!("on the way down: {reason}"))?;
        self.clear_straight(&above, &start, Manner::Guarded).map_err(|hit| format!("on the way down {hit}"))?;
        Ok(Reached { start, nominal, end })
    }

    /// Checks a position against the ranges of all axes.
    ///
    /// # Errors
    /// The axis that is outside, with its machine coordinate.
    pub fn inside_limits(&self, at: &Position) -> Result<(), String> {
        for axis in &self.machine.axes {
            let value = at.get(axis.name);
            let [low, high] = axis.program_range();
            // rounding of the place must not turn a touch at the very limit away
            if !(value >= low - PLACES_MM && value <= high + PLACES_MM) {
                let origin = self.machine.origin.get(axis.name).unwrap_or(0.0);
                let unit = if axis.name.is_rotary() { "deg" } else { "mm" };
                return Err(format!(
                    "{} = {:.3} {unit} is outside the range of the axis ({} to {}, machine coordinates)",
                    axis.name,
                    value + origin,
                    Plain(low + origin),
                    Plain(high + origin),
                ));
            }
        }
        Ok(())
    }
}

/// A position with its numbers rounded to nine decimals, [`PLACES_MM`].
pub(super) fn tidy(at: &Position) -> Position {
    // through the text: that is the shortest spelling of the number; adding zero turns -0 into 0
    Position(at.0.map(|v| format!("{v:.9}").parse::<f64>().unwrap_or(v) + 0.0))
}
