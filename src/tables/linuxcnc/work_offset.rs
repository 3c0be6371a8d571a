//! Work offsets for indexed work without a transformation: a subroutine that sets a work offset for the present place of
//! the rotary axes.
//!
//! With identity kinematics a control can be put right at one point of the workpiece, pose by pose. The offset of each
//! linear axis is a trigonometric polynomial of first degree in the two rotary angles wherever no linear axis stands
//! between them and no error of one turns the other's lever (every built-in machine): nine numbers per axis, found from
//! nine poses and proven at others. A machine for which they do not prove gets no subroutine.

use super::{head, render};
use crate::axes::{AxisName, Position};
use crate::diag::Result;
use crate::machine::{Axis, Carrier, Machine, Side};
use crate::tables::compensation::Term;
use crate::tables::correction::Correction;
use crate::tables::kins::{Errors, Kins};
use crate::tables::linuxcnc::stock;
use minijinja::context;
use nalgebra::{DMatrix, Vector3};

const TEMPLATE: &str = include_str!("../templates/linuxcnc/work_offset.ngc.j2");

/// Name of the subroutine and its file.
pub const SUBROUTINE: &str = "axiscal_work_offset";

/// The nine numbers reproduce the offset to this, mm: a hundredth of a micrometre.
const CLOSE_ENOUGH: f64 = 1e-5;

/// Offset of X, Y, Z as `Σ c[i][j] f_i(first) f_j(second)` with f = 1, cos, sin.
pub struct Offset<'a> {
    /// The rotary axes.
    pub axes: [&'a Axis; 2],
    /// Per linear axis nine numbers, mm, the second axis's index running fastest.
    pub coefficients: [Vec<f64>; 3],
    /// The point of the workpiece for which it is exact, mm in R with all axes at 0.
    pub point_mm: Vector3<f64>,
}

fn basis(deg: f64) -> [f64; 3] {
    let (sin, cos) = crate::units::rad_from_deg(deg).sin_cos();
    [1.0, cos, sin]
}

fn products(first: f64, second: f64) -> Vec<f64> {
    basis(first).into_iter().flat_map(|a| basis(second).map(|b| a * b)).collect()
}

/// What the axes must be told more so that the ball stands over the point, at a pose of the rotary axes.
fn told_more(
    machine: &Machine,
    kins: &Kins,
    axes: [&Axis; 2],
    point: &Vector3<f64>,
    at: [f64; 2],
) -> Option<Vector3<f64>> {
    let mut pose = Position::default();
    for (axis, deg) in axes.into_iter().zip(at) {
        pose.set(axis.name, deg);
    }
    let carrier = machine.side(Side::Workpiece).last().map_or(Carrier::Base, |a| Carrier::Axis(a.name));
    let world = machine.linear_for_ball(carrier, &pose, point, machine.tool.length_mm)?;
    Some(kins.joints(&world)?.xyz_mm() - world.xyz_mm())
}

/// The offset for a machine, when nine numbers per axis give it.
#[must_use]
pub fn offset<'a>(machine: &'a Machine, terms: &[Term], reference_mm: [f64; 3]) -> Option<Offset<'a>> {
    let rotary: Vec<&Axis> = machine.rotary().collect();
    let [first, second] = rotary.as_slice() else { return None };
    let axes = [*first, *second];
    let point = machine.reference.ball;
    let kins = Kins::new(machine, Errors::from_terms(terms, reference_mm), machine.tool.length_mm);
    let third = 120.0;
    let poses: Vec<[f64; 2]> = (0..9).map(|n| [f64::from(n / 3) * third, f64::from(n % 3) * third]).collect();
    let matrix = DMatrix::from_row_iterator(9, 9, poses.iter().flat_map(|p| products(p[0], p[1])));
    let values: Option<Vec<Vector3<f64>>> = poses.iter().map(|p| told_more(machine, &kins, axes, &point, *p)).collect();
    let values = values?;
    let inverse = matrix.try_inverse()?;
    let coefficients = [0, 1, 2].map(|k| {
        let column = DMatrix::from_iterator(9, 1, values.iter().map(|v| v[k]));
        (&inverse * column).iter().map(|c| crate::tables::correction::rounded(*c)).collect::<Vec<f64>>()
    });
    let found = Offset { axes, coefficients, point_mm: point };
    let proven = [[17.0, -33.0], [-90.0, 45.0], [61.0, 200.0], [-120.0, 271.0], [5.0, 5.0], [90.0, -135.0]];
    proven
        .iter()
        .all(|p| told_more(machine, &kins, axes, &point, *p).is_some_and(|v| (found.at(*p) - v).amax() < CLOSE_ENOUGH))
        .then_some(found)
}

impl Offset<'_> {
    /// What X, Y, Z must be told more at a pose (deg), mm.
    #[must_use]
    pub fn at(&self, pose: [f64; 2]) -> Vector3<f64> {
        let f = products(pose[0], pose[1]);
        Vector3::from([0, 1, 2].map(|k| self.coefficients[k].iter().zip(&f).map(|(c, f)| c * f).sum::<f64>()))
    }
}

/// The subroutine's file, where there is something to offset. `by_home` are the terms that home offsets carry already.
pub(super) fn files(machine: &Machine, correction: &Correction, carried: &[Term]) -> Result<Vec<(String, String)>> {
    let by_home = |t: &Term| carried.iter().any(|c| c.spot() == t.spot()) && stock::home_offset_carries(machine, t);
    let terms: Vec<Term> = correction.terms.iter().filter(|t| t.value != 0.0 && !by_home(t)).cloned().collect();
    if terms.is_empty() {
        return Ok(Vec::new());
    }
    let Some(offset) = offset(machine, &terms, correction.reference_mm) else { return Ok(Vec::new()) };
    let origin = |axis: AxisName| machine.origin.get(axis).unwrap_or(0.0);
    let sums: Vec<_> = [AxisName::X, AxisName::Y, AxisName::Z]
        .into_iter()
        .zip(&offset.coefficients)
        .map(|(axis, c)| context! { letter => axis.to_string(), terms => written(c) })
        .collect();
    let rotary: Vec<_> = offset
        .axes
        .iter()
        .map(
            |a| context! { letter => a.name.to_string(), parameter => 5420 + a.name.index(), origin => origin(a.name) },
        )
        .collect();
    let context = context! {
        head => head(machine, correction),
        name => SUBROUTINE,
        rotary,
        sums,
        point => offset.point_mm.iter().map(|v| v.to_string()).collect::<Vec<_>>(),
        length => machine.tool.length_mm,
    };
    Ok(vec![(format!("stock/{SUBROUTINE}.ngc"), render("work_offset.ngc", TEMPLATE, &context)?)])
}

/// The terms of a sum as the interpreter reads them, without those that vanish at the sixth decimal.
fn written(coefficients: &[f64]) -> Vec<String> {
    const F: [&str; 3] = ["", "c", "s"];
    coefficients
        .iter()
        .enumerate()
        .filter(|(_, c)| c.abs() >= 5e-7)
        .map(|(n, c)| {
            let factors: Vec<String> = [(1, F[n / 3]), (2, F[n % 3])]
                .into_iter()
                .filter(|(_, f)| !f.is_empty())
                .map(|(axis, f)| format!(" * #<{f}{axis}>"))
                .collect();
            format!("{} {:.6}{}", if *c < 0.0 { "-" } else { "+" }, c.abs(), factors.concat())
        })
        .collect()
}
