//! Rigid motions with the slopes of a gap along their six components.

use crate::axes::Position;
use crate::geometry::Displacement;
use crate::machine::Axis;
use nalgebra::{Matrix3, Vector3};

/// p → r·p + t, mm.
#[derive(Debug, Clone, Copy)]
pub(super) struct Rigid {
    pub r: Matrix3<f64>,
    pub t: Vector3<f64>,
}

impl Rigid {
    #[inline]
    pub fn of_rotary(axis: &Axis, at: &Position) -> Self {
        let motion = axis.motion(at);
        Self { r: motion.rotation.to_rotation_matrix().into_inner(), t: motion.translation.vector }
    }

    #[inline]
    pub fn apply(&self, p: &Vector3<f64>) -> Vector3<f64> {
        self.r * p + self.t
    }

    #[inline]
    pub fn undo(&self, p: &Vector3<f64>) -> Vector3<f64> {
        self.r.tr_mul(&(p - self.t))
    }
}

/// An error transform at its place: p → r·(p − centre) + image.
#[derive(Debug, Clone, Copy)]
pub(super) struct Placed {
    pub rigid: Rigid,
    /// Where the transform takes its centre.
    image: Vector3<f64>,
    /// About which axes the angles a and b turn; c turns about z.
    axis_a: Vector3<f64>,
    axis_b: Vector3<f64>,
}

impl Placed {
    #[inline]
    pub fn new(by: &Displacement, centre: &Vector3<f64>) -> Self {
        if by.w == Vector3::zeros() {
            return Self::shift(by, centre);
        }
        let ((sa, ca), (sb, cb), (sc, cc)) = (by.w.x.sin_cos(), by.w.y.sin_cos(), by.w.z.sin_cos());
        // Rz(c)·Ry(b)·Rx(a), as `Displacement::rotation`
        let r = Matrix3::new(
            cc * cb,
            cc * sb * sa - sc * ca,
            cc * sb * ca + sc * sa,
            sc * cb,
            sc * sb * sa + cc * ca,
            sc * sb * ca - cc * sa,
            -sb,
            cb * sa,
            cb * ca,
        );
        let image = centre + by.d;
        Self {
            rigid: Rigid { r, t: image - r * centre },
            image,
            axis_a: r.column(0).into_owned(),
            axis_b: Vector3::new(-sc, cc, 0.0),
        }
    }

    #[inline]
    fn shift(by: &Displacement, centre: &Vector3<f64>) -> Self {
        let rigid = Rigid { r: Matrix3::identity(), t: by.d };
        Self { rigid, image: centre + by.d, axis_a: Vector3::x(), axis_b: Vector3::y() }
    }

    /// Makes it the transform of another displacement; cheap where neither turns.
    #[inline]
    pub fn set(&mut self, by: &Displacement, centre: &Vector3<f64>) {
        if by.w == Vector3::zeros() && self.rigid.r == Matrix3::identity() {
            self.rigid.t = by.d;
            self.image = centre + by.d;
        } else {
            *self = Self::new(by, centre);
        }
    }

    /// Adds d gap / d (dx … rz) for a place that is applied; `g` = d gap / d moved.
    #[inline]
    pub fn slope(&self, g: &Vector3<f64>, moved: &Vector3<f64>, sign: f64, into: &mut [f64; 6]) {
        let turned = (moved - self.image).cross(g);
        for k in 0..3 {
            into[k] += sign * g[k];
        }
        into[3] += sign * self.axis_a.dot(&turned);
        into[4] += sign * self.axis_b.dot(&turned);
        into[5] += sign * turned.z;
    }
}
