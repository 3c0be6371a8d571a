//! Where an artefact stood that was put down by eye, of a log that does not say it.

use super::touch::{RawTouch, Status};
use crate::machine::Machine;
use crate::program::find::shift_matrix;
use crate::program::plan::Plan;
use nalgebra::Vector3;

/// The middle of what each touch says, along each of X, Y and Z: how far off its nominal place it triggered, with all rotary axes back
/// at 0. Errors of the machine are far smaller than what a person leaves. `None`: the touches have no numbers.
pub fn by_touches(machine: &Machine, plan: &Plan, touches: &[RawTouch]) -> Option<Vector3<f64>> {
    plan.find.as_ref()?;
    let numbered = plan.numbered();
    let off = |raw: &RawTouch| {
        let planned = raw.id.and_then(|id| numbered.touch(id)).filter(|_| raw.status == Status::Hit)?;
        let carrier = machine.carrier(&planned.carrier)?;
        let back = shift_matrix(machine, carrier, &planned.pose.position())?.try_inverse()?;
        Some(back * (raw.position.xyz_mm() - planned.nominal_position().xyz_mm()))
    };
    let all: Vec<Vector3<f64>> = touches.iter().filter_map(off).collect();
    let middle = |axis: usize| {
        let mut values: Vec<f64> = all.iter().map(|off| off[axis]).collect();
        values.sort_by(f64::total_cmp);
        values.get(values.len() / 2).copied()
    };
    Some(Vector3::new(middle(0)?, middle(1)?, middle(2)?))
}
