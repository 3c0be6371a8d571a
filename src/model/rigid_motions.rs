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
    /// About which axes the angles a, b and c turn.
    axis_a: Vector3<f64>,
    axis_b: Vector3<f64>,
    axis_c: Vector3<f64>,
    /// Along which directions dx, dy and dz count (columns), where they are not those of R.
    frame: Option<Matrix3<f64>>,
}

/// The centre of an error transform (mm in R), and the frame of its components where it is not R.
pub(super) type Centre<'a> = (&'a Vector3<f64>, Option<&'a Matrix3<f64>>);

impl Placed {
    #[inline]
    pub fn new(by: &Displacement, (centre, frame): Centre<'_>) -> Self {
        if by.w == Vector3::zeros() {
            return Self::shift(by, (centre, frame));
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
        let (axis_a, axis_b, axis_c) = (r.column(0).into_owned(), Vector3::new(-sc, cc, 0.0), Vector3::z());
        let Some(own) = frame else {
            let image = centre + by.d;
            return Self { rigid: Rigid { r, t: image - r * centre }, image, axis_a, axis_b, axis_c, frame: None };
        };
        let (r, image) = (own * r * own.transpose(), centre + own * by.d);
        Self {
            rigid: Rigid { r, t: image - r * centre },
            image,
            axis_a: own * axis_a,
            axis_b: own * axis_b,
            axis_c: own * axis_c,
            frame: Some(*own),
        }
    }

    #[inline]
    fn shift(by: &Displacement, (centre, frame): Centre<'_>) -> Self {
        let t = frame.map_or(by.d, |own| own * by.d);
        let own = frame.copied().unwrap_or_else(Matrix3::identity);
        let column = |i: usize| own.column(i).into_owned();
        let rigid = Rigid { r: Matrix3::identity(), t };
        let (axis_a, axis_b, axis_c) = (column(0), column(1), column(2));
        Self { rigid, image: centre + t, axis_a, axis_b, axis_c, frame: frame.copied() }
    }

    /// Makes it the transform of another displacement; cheap where neither turns.
    #[inline]
    pub fn set(&mut self, by: &Displacement, (centre, frame): Centre<'_>) {
        if by.w == Vector3::zeros() && self.rigid.r == Matrix3::identity() && frame.is_none() {
            self.rigid.t = by.d;
            self.image = centre + by.d;
        } else {
            *self = Self::new(by, (centre, frame));
        }
    }

    /// Adds d gap / d (dx … rz) for a place that is applied; `g` = d gap / d moved.
    #[inline]
    pub fn slope(&self, g: &Vector3<f64>, moved: &Vector3<f64>, sign: f64, into: &mut [f64; 6]) {
        let turned = (moved - self.image).cross(g);
        let along = self.frame.map_or(*g, |own| own.tr_mul(g));
        for k in 0..3 {
            into[k] += sign * along[k];
        }
        into[3] += sign * self.axis_a.dot(&turned);
        into[4] += sign * self.axis_b.dot(&turned);
        into[5] += sign * self.axis_c.dot(&turned);
    }
}
