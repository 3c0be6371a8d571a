//! The surface that a touch is made on: the ball's gap to it and its gradient, in the frame of the real body.
//!
//! A face is the plane of its nominal point and normal. A sphere and a cylinder are what they are, so that a touch beside the
//! pole needs no correction.

use crate::machine::Form;
use crate::program::plan::{PlanBlock, PlanTouch};
use nalgebra::Vector3;
use schemars::JsonSchema;
use serde::Deserialize;

/// A surface in the frame of the nominal body (the carrier's), mm.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Surface {
    /// Through a point, with its outward unit normal.
    Plane { point: Vector3<f64>, normal: Vector3<f64> },
    /// About a centre.
    Sphere { centre: Vector3<f64>, radius: f64 },
    /// About a line along z through a centre; `sense` is +1 where it is touched from outside, -1 from inside.
    Cylinder { centre: Vector3<f64>, radius: f64, sense: f64 },
}

/// A body by what is unknown of its place.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Body {
    /// Three shifts, three turns.
    #[default]
    Box,
    /// Three shifts.
    Sphere,
    /// A pin, a ring or a bore that is touched on its side only: two shifts, two turns.
    Cylinder,
    /// The same touched on an end, too: and its height.
    CylinderWithEnd,
    /// A shift, two turns.
    Plane,
    /// The centre of a sphere that something else has measured: three shifts.
    Centre,
    /// The same as readings of a sensor with an unknown zero: three shifts.
    Reading,
    /// A workpiece that is known by its nominal points: three shifts, three turns.
    Part,
}

impl Body {
    /// As effects name it.
    #[must_use]
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Box => "box",
            Self::Sphere => "sphere",
            Self::Cylinder => "cylinder",
            Self::CylinderWithEnd => "cylinder-with-end",
            Self::Plane => "plane",
            Self::Centre => "centre",
            Self::Reading => "reading",
            Self::Part => "part",
        }
    }

    /// Has a probe triggered on it? A centre comes from something else, and what is wrong with a trigger is not in it.
    #[must_use]
    pub fn is_touched(self) -> bool {
        !matches!(self, Self::Centre | Self::Reading)
    }

    /// What a body of this form is while only these surfaces of it are touched.
    #[must_use]
    pub fn of(form: Form, touched: &Surface, before: Option<Self>) -> Self {
        match (form, touched, before) {
            (Form::Box, ..) => Self::Box,
            (Form::Sphere, ..) => Self::Sphere,
            (Form::Plane, ..) => Self::Plane,
            (Form::Centre, ..) => Self::Centre,
            (Form::Reading, ..) => Self::Reading,
            (Form::Part, ..) => Self::Part,
            (_, Surface::Plane { .. }, _) | (_, _, Some(Self::CylinderWithEnd)) => Self::CylinderWithEnd,
            (Form::Cylinder | Form::Bore, ..) => Self::Cylinder,
        }
    }
}

/// What formulas see as `edge`: the whole length of the body along the normal, the diameter of what is round; negative where a
/// larger body has its surface nearer to the ball's side, as a hole has; 0 where a larger body is none of these.
#[must_use]
pub fn edge(block: &PlanBlock, surface: &Surface, normal: &Vector3<f64>) -> f64 {
    match surface {
        Surface::Plane { .. } if block.form.is_centre() || block.form == Form::Part => 0.0,
        Surface::Plane { .. } => Vector3::from(block.size).dot(&normal.abs()),
        Surface::Sphere { radius, .. } => 2.0 * radius,
        Surface::Cylinder { radius, sense, .. } => 2.0 * radius * sense,
    }
}

impl Surface {
    /// The surface that a planned touch is made on.
    #[must_use]
    pub fn of(block: &PlanBlock, touch: &PlanTouch) -> Self {
        let normal = Vector3::from(touch.normal).normalize();
        let (centre, radius) = (Vector3::from(block.centre), block.diameter.unwrap_or_default() / 2.0);
        let on_end = normal.z.abs() > 0.5;
        match block.form {
            Form::Sphere => Self::Sphere { centre, radius },
            Form::Cylinder if !on_end => Self::Cylinder { centre, radius, sense: 1.0 },
            Form::Bore if !on_end => Self::Cylinder { centre, radius, sense: -1.0 },
            Form::Box | Form::Plane | Form::Cylinder | Form::Bore | Form::Centre | Form::Reading | Form::Part => {
                Self::Plane { point: touch.point.into(), normal }
            }
        }
    }

    /// How far a ball with its centre at `q` is off the surface, mm (negative: within), and the derivative by `q`.
    #[must_use]
    #[inline]
    pub fn gap(&self, q: &Vector3<f64>, ball_radius_mm: f64) -> (f64, Vector3<f64>) {
        match self {
            Self::Plane { point, normal } => (normal.dot(&(q - point)) - ball_radius_mm, *normal),
            Self::Sphere { centre, radius } => {
                let arm = q - centre;
                let length = arm.norm();
                (length - radius - ball_radius_mm, arm / length.max(f64::MIN_POSITIVE))
            }
            Self::Cylinder { centre, radius, sense } => {
                let mut arm = q - centre;
                arm.z = 0.0;
                let length = arm.norm();
                (sense * (length - radius) - ball_radius_mm, arm * (*sense / length.max(f64::MIN_POSITIVE)))
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gaps_are_those_of_a_drawing_and_slopes_those_of_the_gap() {
        let centre = Vector3::new(1.0, 2.0, 3.0);
        let sphere = Surface::Sphere { centre, radius: 12.5 };
        let pin = Surface::Cylinder { centre, radius: 12.5, sense: 1.0 };
        let ring = Surface::Cylinder { centre, radius: 12.5, sense: -1.0 };
        let plane = Surface::Plane { point: centre, normal: Vector3::z() };
        // 3-4-5: the ball's centre 20 mm off the sphere's, 16 mm off the axis of the cylinder
        let q = centre + Vector3::new(0.0, 16.0, 12.0);
        assert!((sphere.gap(&q, 3.0).0 - 4.5).abs() < 1e-12);
        assert!((pin.gap(&q, 3.0).0 - 0.5).abs() < 1e-12);
        assert!((plane.gap(&q, 3.0).0 - 9.0).abs() < 1e-12);
        let inside = centre + Vector3::new(-9.0, 0.0, 5.0);
        assert!((ring.gap(&inside, 3.0).0 - 0.5).abs() < 1e-12);
        for (surface, at) in [(sphere, q), (pin, q), (plane, q), (ring, inside)] {
            let (_, slope) = surface.gap(&at, 3.0);
            for k in 0..3 {
                let mut step = Vector3::zeros();
                step[k] = 1e-5;
                let by_steps = (surface.gap(&(at + step), 3.0).0 - surface.gap(&(at - step), 3.0).0) / 2e-5;
                assert!((by_steps - slope[k]).abs() < 1e-8, "{surface:?} {k}");
            }
        }
    }
}
