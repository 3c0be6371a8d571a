//! Rigid motions of the virtual machine's own: homogeneous rows built from sines and cosines, multiplied forward.
//!
//! This is on purpose another formulation than the one that predicts: the two must agree because both are right, not
//! because they share a mistake. Lengths mm.

use crate::units::rad_from_deg;

/// A place or a displacement, mm.
pub type Vec3 = [f64; 3];

/// `a + f·b`.
pub fn plus(a: Vec3, f: f64, b: Vec3) -> Vec3 {
    [a[0] + f * b[0], a[1] + f * b[1], a[2] + f * b[2]]
}

/// `a - b`.
pub fn minus(a: Vec3, b: Vec3) -> Vec3 {
    plus(a, -1.0, b)
}

/// Scalar product.
pub fn dot(a: Vec3, b: Vec3) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// Vector product.
pub fn cross(a: Vec3, b: Vec3) -> Vec3 {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// Length of a vector.
pub fn norm(a: Vec3) -> f64 {
    dot(a, a).sqrt()
}

/// `a / |a|`, or zero for a zero vector.
pub fn unit(a: Vec3) -> Vec3 {
    let n = norm(a);
    if n > 0.0 { [a[0] / n, a[1] / n, a[2] / n] } else { [0.0; 3] }
}

/// Sine and cosine of an angle in **degrees**: exact at whole quarter turns, where a control's angle is exact too.
pub fn sin_cos_deg(deg: f64) -> (f64, f64) {
    let turned = deg % 360.0;
    match turned {
        0.0 => (0.0, 1.0),
        90.0 | -270.0 => (1.0, 0.0),
        180.0 | -180.0 => (0.0, -1.0),
        270.0 | -90.0 => (-1.0, 0.0),
        _ => rad_from_deg(turned).sin_cos(),
    }
}

/// Three rows of a homogeneous matrix: rotation and translation (mm).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rigid([[f64; 4]; 3]);

impl Rigid {
    /// No motion.
    pub const STILL: Self = Self([[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]]);

    /// A displacement.
    pub fn shift(d: Vec3) -> Self {
        Self([[1.0, 0.0, 0.0, d[0]], [0.0, 1.0, 0.0, d[1]], [0.0, 0.0, 1.0, d[2]]])
    }

    /// A turn about a unit direction through a point, from its sine and cosine (Rodrigues' matrix).
    pub fn turn(direction: Vec3, point: Vec3, (s, c): (f64, f64)) -> Self {
        let [x, y, z] = direction;
        let v = 1.0 - c;
        let r = [
            [c + x * x * v, x * y * v - z * s, x * z * v + y * s],
            [y * x * v + z * s, c + y * y * v, y * z * v - x * s],
            [z * x * v - y * s, z * y * v + x * s, c + z * z * v],
        ];
        Self::about(r, [0.0; 3], point)
    }

    /// The error transform about a point: `Trans(d)·Rz(c)·Ry(b)·Rx(a)` with `six = [dx, dy, dz, a, b, c]`, mm and rad.
    pub fn error(six: &[f64; 6], point: Vec3) -> Self {
        let [dx, dy, dz, a, b, c] = *six;
        if a == 0.0 && b == 0.0 && c == 0.0 {
            return Self::shift([dx, dy, dz]);
        }
        let ((sa, ca), (sb, cb), (sc, cc)) = (a.sin_cos(), b.sin_cos(), c.sin_cos());
        let r = [
            [cc * cb, cc * sb * sa - sc * ca, cc * sb * ca + sc * sa],
            [sc * cb, sc * sb * sa + cc * ca, sc * sb * ca - cc * sa],
            [-sb, cb * sa, cb * ca],
        ];
        Self::about(r, [dx, dy, dz], point)
    }

    /// A rotation about a point, then a displacement.
    fn about(r: [[f64; 3]; 3], d: Vec3, point: Vec3) -> Self {
        let row = |i: usize| [r[i][0], r[i][1], r[i][2], d[i] + point[i] - dot(r[i], point)];
        Self([row(0), row(1), row(2)])
    }

    /// This motion with another one inside it: `self · inner`.
    pub fn then(&self, inner: &Self) -> Self {
        let (p, q) = (&self.0, &inner.0);
        let cell = |i: usize, j: usize| p[i][0] * q[0][j] + p[i][1] * q[1][j] + p[i][2] * q[2][j];
        let row = |i: usize| [cell(i, 0), cell(i, 1), cell(i, 2), cell(i, 3) + p[i][3]];
        Self([row(0), row(1), row(2)])
    }

    /// The motion that undoes this one.
    pub fn inverse(&self) -> Self {
        let row = |i: usize| [self.0[0][i], self.0[1][i], self.0[2][i]];
        let shift = [self.0[0][3], self.0[1][3], self.0[2][3]];
        let cells = |i: usize| [row(i)[0], row(i)[1], row(i)[2], -dot(row(i), shift)];
        Self([cells(0), cells(1), cells(2)])
    }

    /// The place in the outer frame of a place in the inner one.
    pub fn outward(&self, p: Vec3) -> Vec3 {
        let row = |i: usize| self.0[i][0] * p[0] + self.0[i][1] * p[1] + self.0[i][2] * p[2] + self.0[i][3];
        [row(0), row(1), row(2)]
    }

    /// The place in the inner frame of a place in the outer one.
    pub fn inward(&self, p: Vec3) -> Vec3 {
        self.inward_direction([p[0] - self.0[0][3], p[1] - self.0[1][3], p[2] - self.0[2][3]])
    }

    /// The outer direction of an inner one.
    pub fn outward_direction(&self, v: Vec3) -> Vec3 {
        let row = |i: usize| self.0[i][0] * v[0] + self.0[i][1] * v[1] + self.0[i][2] * v[2];
        [row(0), row(1), row(2)]
    }

    /// The inner direction of an outer one.
    pub fn inward_direction(&self, v: Vec3) -> Vec3 {
        let column = |j: usize| self.0[0][j] * v[0] + self.0[1][j] * v[1] + self.0[2][j] * v[2];
        [column(0), column(1), column(2)]
    }
}

/// Solves `M·x = b` for three columns of `M` (Cramer). `None` when they do not span space.
pub fn solve(columns: [Vec3; 3], b: Vec3) -> Option<Vec3> {
    let [p, q, r] = columns;
    let det = dot(p, cross(q, r));
    if det.abs() <= 1e-9 * norm(p) * norm(q) * norm(r) || !det.is_finite() {
        return None;
    }
    Some([dot(b, cross(q, r)) / det, dot(p, cross(b, r)) / det, dot(p, cross(q, b)) / det])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn turns_are_right_handed_and_exact_at_quarters() {
        let quarter = Rigid::turn([0.0, 0.0, 1.0], [1.0, 0.0, 0.0], sin_cos_deg(90.0));
        assert_eq!(quarter.outward([2.0, 0.0, 5.0]), [1.0, 1.0, 5.0]);
        assert_eq!(sin_cos_deg(-450.0), (-1.0, 0.0));
    }

    #[test]
    fn an_error_turns_x_first_then_y_then_z_and_keeps_its_point() {
        let point = [1.0, -2.0, 3.0];
        let six = [0.1, 0.2, 0.3, 0.3, -0.4, 0.5];
        let all = Rigid::error(&six, point);
        let step = |i: usize, axis: Vec3| Rigid::turn(axis, point, six[i].sin_cos());
        let by_hand = Rigid::shift([0.1, 0.2, 0.3])
            .then(&step(5, [0.0, 0.0, 1.0]))
            .then(&step(4, [0.0, 1.0, 0.0]))
            .then(&step(3, [1.0, 0.0, 0.0]));
        let p = [7.0, 8.0, -9.0];
        assert!(norm(minus(all.outward(p), by_hand.outward(p))) < 1e-14);
        assert!(norm(minus(all.outward(point), [1.1, -1.8, 3.3])) < 1e-15);
        assert!(norm(minus(all.inward(all.outward(p)), p)) < 1e-14);
    }

    #[test]
    fn three_equations_are_solved_or_refused() {
        let x = solve([[2.0, 0.0, 0.0], [1.0, 3.0, 0.0], [0.0, 0.0, -1.0]], [4.0, 6.0, 5.0]);
        assert_eq!(x, Some([1.0, 2.0, -5.0]));
        assert_eq!(solve([[1.0, 0.0, 0.0], [2.0, 0.0, 0.0], [0.0, 0.0, 1.0]], [1.0, 1.0, 1.0]), None);
    }
}
