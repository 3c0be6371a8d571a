//! Which turns bring the rotary axes to a pose in a known sense: backlash and hysteresis depend on it, so the sense of every
//! arrival is forced and stands in the plan.

use super::path::Step;
use crate::axes::{AxisMap, AxisName, Position};
use crate::machine::Machine;
use crate::units::Plain;

/// Angles that differ by less are the same, deg.
const SAME: f64 = 1e-9;

/// A turn of one rotary axis: where to and, where it is known, in which sense.
pub(super) type Turn = (AxisName, f64, Option<f64>);

/// The turns that bring each rotary axis from a place (with the senses in which it came there; `None`: unknown) to a
/// pose in the senses that are wanted.
pub(super) fn turns(
    machine: &Machine,
    overshoot_deg: f64,
    from: Option<(Position, AxisMap)>,
    pose: &AxisMap,
    wanted: &AxisMap,
) -> Result<Vec<Turn>, String> {
    let mut turns = Vec::new();
    for axis in machine.rotary() {
        let (name, [low, high]) = (axis.name, axis.range);
        let target = pose.get(name).unwrap_or(0.0);
        let wanted = wanted.get(name);
        let past = |sense: f64| {
            let before = target - sense * overshoot_deg;
            (low..=high).contains(&before).then_some(before).ok_or_else(|| {
                format!(
                    "{name} cannot come to {} deg with {} angles: its range ends at {}",
                    Plain(target),
                    if sense > 0.0 { "rising" } else { "falling" },
                    Plain(if sense > 0.0 { low } else { high }),
                )
            })
        };
        let Some((at, senses)) = from else {
            // from an unknown angle: past the pose on one side, then to it in a sense that is known
            let sense = wanted.unwrap_or(if past(1.0).is_ok() { 1.0 } else { -1.0 });
            turns.push((name, past(sense)?, None));
            turns.push((name, target, Some(sense)));
            continue;
        };
        let way = target - at.get(name);
        if way.abs() < SAME {
            if let Some(sense) = wanted.filter(|w| senses.get(name) != Some(*w)) {
                turns.push((name, past(sense)?, Some(-sense)));
                turns.push((name, target, Some(sense)));
            }
            continue;
        }
        let natural = way.signum();
        match wanted {
            Some(sense) if sense != natural => {
                turns.push((name, past(sense)?, Some(natural)));
                turns.push((name, target, Some(sense)));
            }
            _ => turns.push((name, target, Some(natural))),
        }
    }
    Ok(turns)
}

pub(super) fn turn_step(axis: AxisName, to: f64, sense: Option<f64>) -> Step {
    let turn = |value: f64| AxisMap::default().with(axis, value);
    Step::Rotary { to: turn(to), sense: sense.map_or_else(AxisMap::default, turn) }
}
