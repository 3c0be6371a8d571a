//! Rigid transforms of the chain: the only place that multiplies rotations.
//!
//! Not a geometry kernel: shapes and distances of solids belong to `program::collision`.

pub mod sphere;

use nalgebra::{Isometry3, Matrix3, Point3, Rotation3, Translation3, Unit, UnitQuaternion, Vector3};

/// A rigid transform, mm.
pub type Transform = Isometry3<f64>;

/// Six components of a small rigid displacement: `d` in mm, `w` = (a, b, c) in rad about x, y, z.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Displacement {
    /// Translation, mm.
    pub d: Vector3<f64>,
    /// Angles about x, y, z, rad.
    pub w: Vector3<f64>,
}

impl Displacement {
    /// Component `0..6` = dx dy dz rx ry rz.
    #[must_use]
    pub fn get(&self, component: usize) -> f64 {
        if component < 3 { self.d[component] } else { self.w[component - 3] }
    }

    /// Adds `amount` (mm or rad) to component `0..6`.
    pub fn add(&mut self, component: usize, amount: f64) {
        if component < 3 {
            self.d[component] += amount;
        } else {
            self.w[component - 3] += amount;
        }
    }

    /// The rotation Rz(c)·Ry(b)·Rx(a), exact (conventions.md, "order of the error angles").
    #[must_use]
    pub fn rotation(&self) -> Rotation3<f64> {
        // nalgebra's Euler angles are roll, pitch, yaw = Rz(yaw)·Ry(pitch)·Rx(roll): the order that is wanted here
        Rotation3::from_euler_angles(self.w.x, self.w.y, self.w.z)
    }

    /// E = Trans(d)·Rz(c)·Ry(b)·Rx(a), taken about `centre` (mm): the point at which `d` is stated.
    #[must_use]
    pub fn transform_about(&self, centre: &Vector3<f64>) -> Transform {
        let rotation = self.rotation();
        let translation = self.d + centre - rotation * centre;
        Transform::from_parts(Translation3::from(translation), UnitQuaternion::from_rotation_matrix(&rotation))
    }

    /// Derivatives of `rotation()·v` with respect to a, b, c: the columns, mm per rad.
    #[must_use]
    pub fn rotation_derivative(&self, v: &Vector3<f64>) -> Matrix3<f64> {
        let rx = Rotation3::from_axis_angle(&Vector3::x_axis(), self.w.x);
        let ry = Rotation3::from_axis_angle(&Vector3::y_axis(), self.w.y);
        let rz = Rotation3::from_axis_angle(&Vector3::z_axis(), self.w.z);
        let after_x = rx * v;
        let after_y = ry * after_x;
        let after_z = rz * after_y;
        Matrix3::from_columns(&[
            rz * (ry * Vector3::x().cross(&after_x)),
            rz * Vector3::y().cross(&after_y),
            Vector3::z().cross(&after_z),
        ])
    }
}

/// Rotation by `angle_rad` about the line through `point` (mm) along `direction`, right-handed.
#[must_use]
pub fn rotation_about(point: &Vector3<f64>, direction: &Unit<Vector3<f64>>, angle_rad: f64) -> Transform {
    let rotation = UnitQuaternion::from_axis_angle(direction, angle_rad);
    Transform::from_parts(Translation3::from(point - rotation * point), rotation)
}

/// Translation by a vector in mm.
#[must_use]
pub fn translation(by: Vector3<f64>) -> Transform {
    Transform::from_parts(Translation3::from(by), UnitQuaternion::identity())
}

/// Image of a point given as a vector.
#[must_use]
pub fn apply(transform: &Transform, point: &Vector3<f64>) -> Vector3<f64> {
    transform.transform_point(&Point3::from(*point)).coords
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::vector;

    #[test]
    fn rotation_derivative_agrees_with_differences() {
        let at = Displacement { d: Vector3::zeros(), w: vector![0.3, -0.2, 0.5] };
        let v = vector![1.0, -2.0, 3.0];
        let analytic = at.rotation_derivative(&v);
        for k in 0..3 {
            let (mut plus, mut minus) = (at, at);
            plus.w[k] += 1e-6;
            minus.w[k] -= 1e-6;
            let numeric = (plus.rotation() * v - minus.rotation() * v) / 2e-6;
            assert!((analytic.column(k) - numeric).norm() < 1e-9);
        }
    }

    #[test]
    fn angles_turn_about_x_first_then_y_then_z() {
        let quarter = std::f64::consts::FRAC_PI_2;
        let e = Displacement { d: Vector3::zeros(), w: vector![quarter, 0.0, quarter] };
        // Rx: y -> z; Rz leaves z
        assert!((e.rotation() * Vector3::y() - Vector3::z()).norm() < 1e-15);
    }

    #[test]
    fn displacement_about_a_centre_moves_the_centre_by_d_only() {
        let e = Displacement { d: vector![1.0, 2.0, 3.0], w: vector![0.1, 0.2, 0.3] };
        let centre = vector![-30.0, 5.0, -200.0];
        assert!((apply(&e.transform_about(&centre), &centre) - centre - e.d).norm() < 1e-12);
    }
}
