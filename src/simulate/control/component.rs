//! The exported kinematics component: its world coordinates are the axis positions of the errorless machine.
//!
//! For a commanded position the control finds the linear axes' positions at which the machine *with* the errors it
//! knows holds the ball where the errorless machine would hold it in the workpiece.

use super::{Mapping, Written, WrittenTerm};
use crate::axes::{AxisName, Position};
use crate::machine::{Machine, Side};
use crate::simulate::chain::{Chain, Stylus};
use crate::simulate::rigid::{Vec3, minus, solve};
use crate::simulate::terms::Shifts;
use crate::units::rad_from_deg;

/// A machine as the control knows it.
#[derive(Debug, Clone)]
pub struct Component {
    chain: Chain,
    known: Shifts,
}

impl Component {
    /// Reads the terms.
    pub(super) fn new(
        written: &Written,
        machine: &Machine,
        error: &mut impl FnMut(&'static str, String, &str),
    ) -> Option<Self> {
        let p = &machine.reference.pivot;
        let reference = written.reference_mm.unwrap_or([p.x, p.y, p.z]);
        let mut known = Shifts::default();
        let mut good = true;
        for (i, term) in written.terms.iter().enumerate() {
            if let Err(what) = add(&mut known, term, machine) {
                good = false;
                error(
                    "compensation::term",
                    format!("term {} of the compensation: {what}", i + 1),
                    "export again: the file was changed or is of another version",
                );
            }
        }
        good.then(|| Self { chain: Chain::new(machine, reference), known })
    }

    /// How the linear axes follow the commanded ones at a pose.
    pub(super) fn mapping(&self, nominal: &Chain, pose: &Position, stylus: Stylus) -> Result<Mapping, &'static str> {
        let none = Shifts::default();
        let (real_0, real) = affine(&self.chain, &self.known, pose, stylus);
        let (wanted_0, wanted) = affine(nominal, &none, pose, stylus);
        let singular = "the linear axes of the compensated machine do not span space";
        let joints = |place: Vec3| solve(real, place).ok_or(singular);
        let offset = joints(minus(wanted_0, real_0))?;
        let columns = [joints(wanted[0])?, joints(wanted[1])?, joints(wanted[2])?];
        Ok(Mapping::Affine { offset, columns })
    }
}

/// The ball in the workpiece is affine in the linear axes when the errors are constant: its place at their zero, and
/// what each millimetre does.
fn affine(chain: &Chain, shifts: &Shifts, pose: &Position, stylus: Stylus) -> (Vec3, [Vec3; 3]) {
    let ball = |linear: Vec3| {
        let mut at = *pose;
        at.0[..3].copy_from_slice(&linear);
        chain.ball_in(&at, shifts, chain.links_to_workpiece(), stylus)
    };
    let p0 = ball([0.0; 3]);
    let column = |i: usize| {
        let mut linear = [0.0; 3];
        linear[i] = 1.0;
        minus(ball(linear), p0)
    };
    (p0, [column(0), column(1), column(2)])
}

fn add(known: &mut Shifts, term: &WrittenTerm, machine: &Machine) -> Result<(), String> {
    let mut letters = term.axis.chars();
    let axis = letters.next().and_then(AxisName::from_letter).filter(|_| letters.next().is_none());
    let axis = axis
        .and_then(|a| machine.axis(a))
        .ok_or_else(|| format!("axis {:?} is no axis of {:?}", term.axis, machine.name))?;
    let dof = ["dx", "dy", "dz", "rx", "ry", "rz"].iter().position(|d| *d == term.dof);
    let dof = dof.ok_or_else(|| format!("dof {:?} is not known", term.dof))?;
    if !term.value.is_finite() {
        return Err(format!("value {} is not finite", term.value));
    }
    let value = match (term.unit.as_str(), dof < 3) {
        ("mm", true) => term.value,
        ("deg", false) => rad_from_deg(term.value),
        (unit, _) => return Err(format!("{} is given in {unit:?}", term.dof)),
    };
    let sites = match term.place.as_str() {
        "before" => &mut known.before,
        "after" if axis.side == Side::Tool || axis.name.is_rotary() => &mut known.after,
        place => return Err(format!("place {place:?} of axis {} is not known", axis.name)),
    };
    sites[axis.name.index()][dof] += value;
    Ok(())
}
