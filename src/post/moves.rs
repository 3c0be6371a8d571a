//! Axis words of moves, in the control's own coordinates: what a move must name, and turns in steps under a
//! transformation.

use super::as_written::Coordinates;
use super::emit::Writer;
use crate::axes::{AxisMap, AxisName, Position};
use crate::diag::{Failure, Result};
use minijinja::{Value, context};

/// Under a transformation no axis is sent nearer to the end of its range than this, mm.
const LIMIT_ROOM_MM: f64 = 1e-4;

/// An angle of an axis that counts from 0 to 360 only: 0 that is reached in the negative sense is 360.
fn turned(deg: f64, sense: f64) -> f64 {
    let rest = deg.rem_euclid(360.0);
    let is_zero = rest.min(360.0 - rest) < 1e-9;
    match (is_zero, sense < 0.0) {
        (false, _) => rest,
        (true, true) => 360.0,
        (true, false) => 0.0,
    }
}

impl Writer<'_> {
    pub(super) fn number(&self, value: f64) -> String {
        self.post.number.number(value)
    }

    /// A place of an axis as the program's words name it: from the origin of R, or the control's own machine coordinate.
    pub(super) fn shown(&self, axis: AxisName, value: f64) -> f64 {
        match self.post.coordinates {
            Coordinates::Machine if !self.frame.is_tcp() => value + self.machine.origin.get(axis).unwrap_or(0.0),
            _ => value,
        }
    }

    /// A length or a feed, mm or mm/min.
    pub(super) fn length(&self, mm: f64) -> String {
        self.post.number.length(mm)
    }

    /// Axis words of a template: `{ axis, name, value, word, rotary, sense, turned, by }`.
    pub(super) fn words(&self, to: &AxisMap) -> Result<Value> {
        self.words_by(to, &AxisMap::default())
    }

    /// The same with the sense (+1, -1) in which rotary axes must go.
    pub(super) fn words_by(&self, to: &AxisMap, senses: &AxisMap) -> Result<Value> {
        let mut words = Vec::new();
        for (axis, value) in to.iter() {
            if !value.is_finite() {
                return Err(self.broken(format!("axis {axis} is sent to {value}")));
            }
            if self.machine.axis(axis).is_none() {
                return Err(self.broken(format!("axis {axis} is moved, which machine {} lacks", self.machine.name)));
            }
            let value = self.shown(axis, value);
            words.push(context! {
                axis => axis.to_string(),
                name => self.post.number.name(axis),
                value => self.post.number.position(axis, value),
                word => self.post.number.axis_word(axis, value),
                rotary => axis.is_rotary(),
                sense => senses.get(axis).map_or("", |s| if s < 0.0 { "-" } else { "+" }),
                by => self.at.get(axis).map_or(String::new(), |at| self.post.number.position(axis, value - self.shown(axis, at))),
                turned => self.number(turned(value, senses.get(axis).unwrap_or(1.0))),
            });
        }
        Ok(Value::from(words))
    }

    /// The path is not what the template language can be trusted with.
    pub(super) fn broken(&self, what: String) -> Failure {
        Failure::new("post::path", format!("step {} of the path: {what}", self.index + 1))
            .help("this is a fault of the path, not of the postprocessor: report it with the plan")
    }

    /// The control's coordinates of a place; rotary axes that nothing has been said about stand at 0.
    pub(super) fn controller(&self, axes: &AxisMap) -> Position {
        let mut position = axes.position();
        if self.frame.is_tcp() {
            // rounded world coordinates would carry an axis that stands at the end of its range past it
            for axis in self.machine.axes.iter().filter(|a| !a.name.is_rotary()) {
                let [low, high] = [axis.range[0] + LIMIT_ROOM_MM, axis.range[1] - LIMIT_ROOM_MM];
                position.set(axis.name, position.get(axis.name).max(low).min(high));
            }
        }
        self.frame.controller_from_axes(&position)
    }

    /// Words of a move of linear axes. Under a transformation every coordinate may change.
    pub(super) fn linear_words(&self, to: &AxisMap) -> Result<AxisMap> {
        if !self.frame.is_tcp() {
            return Ok(*to);
        }
        let target = to.or(&self.at);
        let turned = self.machine.rotary().any(|a| self.at.get(a.name).is_none_or(|v| v != 0.0));
        let linear = [AxisName::X, AxisName::Y, AxisName::Z];
        if linear.iter().any(|a| target.get(*a).is_none()) {
            // both frames are the same while the rotary axes stand at 0
            return if turned {
                Err(self.broken("under the transformation a linear axis moves whose position is not known".into()))
            } else {
                Ok(*to)
            };
        }
        let (before, after) = (self.controller(&self.at), self.controller(&target));
        let after = AxisMap::xyz(after.0[0], after.0[1], after.0[2]);
        let known = !self.loose && linear.iter().all(|a| self.at.get(*a).is_some());
        let before = if known { AxisMap::xyz(before.0[0], before.0[1], before.0[2]) } else { AxisMap::default() };
        let mut moved = self.post.number.moved(&before, &after);
        if moved.is_empty() {
            moved = after;
        }
        Ok(moved)
    }

    /// The places between two rotary positions; one place without a transformation.
    pub(super) fn rotary_steps(&self, from: &AxisMap, to: &AxisMap) -> Result<Vec<AxisMap>> {
        let Some(tcp) = self.post.tcp.as_ref().filter(|_| self.frame.is_tcp()) else { return Ok(vec![*to]) };
        if AxisName::ALL[..3].iter().any(|a| from.get(*a).is_none()) {
            return Err(self.broken("under the transformation a rotary axis moves before X, Y, Z are known".into()));
        }
        let way = to.iter().map(|(a, v)| (v - from.get(a).unwrap_or(0.0)).abs()).fold(0.0, f64::max);
        // at most 720 deg in steps of at least a small fraction of a degree
        let steps = (way / tcp.rotary_step_deg).ceil().clamp(1.0, 1e5);
        let mut words = Vec::new();
        let mut k = 1.0;
        while k <= steps {
            let mut place = *from;
            for (axis, value) in to.iter() {
                let begin = from.get(axis).unwrap_or(0.0);
                place.set(axis, if k < steps { begin + (value - begin) * (k / steps) } else { value });
            }
            let world = self.controller(&place);
            let mut step = AxisMap::xyz(world.0[0], world.0[1], world.0[2]);
            to.iter().for_each(|(axis, _)| step.set(axis, place.get(axis).unwrap_or(0.0)));
            words.push(step);
            k += 1.0;
        }
        Ok(words)
    }
}
