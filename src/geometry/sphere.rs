//! The sphere through measured points: centre and radius.

use nalgebra::{DMatrix, DVector, Matrix4, Vector3, Vector4};

/// A sphere that was fitted to points, mm.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FittedSphere {
    pub centre: Vector3<f64>,
    /// Of the points: of the sphere and the ball together, where the points are centres of a ball.
    pub radius: f64,
    /// Square root of the mean square distance of the points from it.
    pub rms: f64,
    /// The largest distance of a point from it.
    pub largest: f64,
    /// How far noise of 1 in each distance moves the centre, standard deviation along X, Y, Z.
    pub centre_per_noise: Vector3<f64>,
}

/// Steps of Newton's method at most: each takes what is left to its square.
const MOST_STEPS: usize = 50;

/// The least squares of |p|² − 2 c·p − k, which is linear in the unknowns: what many controls use. It weighs points by twice
/// the radius, and differs from [`geometric`] by the form of the sphere. `None`: the points do not determine a sphere.
#[must_use]
pub fn algebraic(points: &[Vector3<f64>]) -> Option<(Vector3<f64>, f64)> {
    let mean = mean(points)?;
    let rows = DMatrix::from_fn(points.len(), 4, |i, k| if k < 3 { 2.0 * (points[i] - mean)[k] } else { 1.0 });
    let squares = DVector::from_iterator(points.len(), points.iter().map(|p| (p - mean).norm_squared()));
    let svd = rows.svd(true, true);
    let (largest, smallest) = (svd.singular_values.max(), svd.singular_values.min());
    /// Points nearer to a plane than this, relative to their extent, determine no sphere.
    const FLAT: f64 = 1e-9;
    if smallest <= FLAT * largest {
        return None;
    }
    let solved = svd.solve(&squares, 0.0).ok()?;
    let arm = Vector3::new(solved[0], solved[1], solved[2]);
    let squared = solved[3] + arm.norm_squared();
    (squared > 0.0).then(|| (mean + arm, squared.sqrt()))
}

/// The least squares of the distances from the surface. `None`: the points do not determine a sphere.
#[must_use]
pub fn geometric(points: &[Vector3<f64>]) -> Option<FittedSphere> {
    let (mut centre, mut radius) = algebraic(points)?;
    let row = |p: &Vector3<f64>, centre: &Vector3<f64>| {
        let out = (p - centre).normalize();
        Vector4::new(out.x, out.y, out.z, 1.0)
    };
    let mut inverse = Matrix4::zeros();
    for _ in 0..MOST_STEPS {
        let (mut normal, mut right) = (Matrix4::zeros(), Vector4::zeros());
        for p in points {
            let row = row(p, &centre);
            normal += row * row.transpose();
            right += row * ((p - centre).norm() - radius);
        }
        inverse = normal.try_inverse()?;
        let step: Vector4<f64> = inverse * right;
        centre += Vector3::new(step.x, step.y, step.z);
        radius += step.w;
        if step.norm() <= 1e-13 * (1.0 + centre.norm()) {
            break;
        }
    }
    let off = |p: &Vector3<f64>| (p - centre).norm() - radius;
    let rms = (points.iter().map(|p| off(p).powi(2)).sum::<f64>() / points.len() as f64).sqrt();
    let largest = points.iter().map(|p| off(p).abs()).fold(0.0, f64::max);
    let usable = radius > 0.0 && centre.iter().all(|c| c.is_finite());
    let centre_per_noise = Vector3::new(inverse[(0, 0)], inverse[(1, 1)], inverse[(2, 2)]).map(|v| v.max(0.0).sqrt());
    usable.then_some(FittedSphere { centre, radius, rms, largest, centre_per_noise })
}

fn mean(points: &[Vector3<f64>]) -> Option<Vector3<f64>> {
    (points.len() >= 4).then(|| points.iter().sum::<Vector3<f64>>() / points.len() as f64)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Six points on a calibration sphere at one pose, and its centre: Beckhoff TF5245 manual, pages 326270731 and 326272267 (the
    /// numbers as facts). The geometric centre was computed elsewhere.
    const POINTS: [[f64; 3]; 6] = [
        [101.807, 273.174, 130.068],
        [116.795, 258.750, 130.068],
        [104.246, 244.524, 129.024],
        [89.606, 257.804, 132.980],
        [96.606, 269.804, 133.957],
        [102.780, 264.366, 139.522],
    ];

    #[test]
    fn the_published_centre_is_met() {
        let points = POINTS.map(Vector3::from);
        let (centre, radius) = algebraic(&points).unwrap();
        let published = Vector3::new(102.545_449, 258.949_268, 125.618_611_8);
        assert!((centre - published).amax() < 1e-7, "{centre}");
        assert!((radius - 14.924_314_21).abs() < 1e-8, "{radius}");
        let fitted = geometric(&points).unwrap();
        let elsewhere = Vector3::new(102.545_448_89, 258.949_270_38, 125.618_601_7);
        assert!((fitted.centre - elsewhere).amax() < 1e-7, "{fitted:?}");
        let apart = fitted.centre - centre;
        assert!((apart.y - 2.3e-6).abs() < 0.1e-6 && (apart.z + 1.0e-5).abs() < 0.05e-5, "{apart}");
        assert!((fitted.radius - 14.924_317_9).abs() < 1e-7 && (fitted.largest - 6.6e-3).abs() < 0.1e-3, "{fitted:?}");
    }

    #[test]
    fn points_in_a_plane_determine_no_sphere() {
        let circle: Vec<Vector3<f64>> =
            (0..8).map(|i| f64::from(i) * 0.7).map(|a| Vector3::new(a.cos() * 10.0, a.sin() * 10.0, 3.0)).collect();
        assert!(algebraic(&circle).is_none() && geometric(&circle).is_none());
        assert!(geometric(&circle[..3]).is_none());
    }
}
