//! Quantiles of Student's t and Fisher's F, from their distribution functions.
//!
//! The library's inverses go through an inverse of the incomplete beta function that does not end for some large degrees of
//! freedom (t with 115 424 348.9). Newton's method within a bracket always does.

use crate::probability::{f_cdf, f_pdf, t_cdf, t_pdf};

/// Upper 97.5 % point of the normal distribution.
const Z: f64 = 1.959_963_984_540_054;

/// Degrees of freedom from which the expansion is right to eleven digits, which the distribution function is not.
const EXPANDED_FROM: f64 = 1e3;

/// Two-sided 95 % factor of Student's t; `dof` below 1 counts as 1, and where it is no number the noise counts as known.
#[must_use]
pub fn student_95(dof: f64) -> f64 {
    // 12.706 with one degree of freedom
    student(dof, Z, 0.975, 13.0)
}

/// What Student's t exceeds on either side as seldom as a normal value exceeds 4: once in 16 000 times. Degrees of freedom below 1
/// count as 1.
#[must_use]
pub fn student_as_4(dof: f64) -> f64 {
    /// The normal distribution function at 4.
    const LEVEL: f64 = 0.999_968_328_758_166_9;
    // 1.005e4 with one degree of freedom
    student(dof, 4.0, LEVEL, 1.1e4)
}

/// A quantile of Student's t; `z` is that of the normal distribution, `most` one that it never exceeds.
fn student(dof: f64, z: f64, level: f64, most: f64) -> f64 {
    let dof = dof.max(1.0);
    // Cornish and Fisher's expansion (Abramowitz and Stegun 26.7.5), which is below the quantile
    let z2 = z * z;
    let first = z * (z2 + 1.0) / 4.0;
    let second = z * ((5.0 * z2 + 16.0) * z2 + 3.0) / 96.0;
    let third = z * (((3.0 * z2 + 19.0) * z2 + 17.0) * z2 - 15.0) / 384.0;
    let start = z + (first + (second + third / dof) / dof) / dof;
    if dof >= EXPANDED_FROM {
        return start;
    }
    let or_nan = |value: Option<f64>| value.unwrap_or(f64::NAN);
    inverse(|x| or_nan(t_cdf(x, dof)), |x| or_nan(t_pdf(x, dof)), level, start, (z, most))
}

/// Upper 99.9 % point of Fisher's F.
#[must_use]
pub fn fisher_999(dof: f64, dof_below: f64) -> f64 {
    let cdf = |x| f_cdf(x, dof, dof_below).unwrap_or(f64::NAN);
    if cdf(1.0).is_nan() {
        return f64::INFINITY;
    }
    let mut high = 2.0;
    while cdf(high) < 0.999 && high < 1e9 {
        high *= 2.0;
    }
    inverse(cdf, |x| f_pdf(x, dof, dof_below).unwrap_or(f64::NAN), 0.999, 0.5 * high, (0.0, high))
}

/// Where a distribution function takes a value: Newton's steps, halves of the bracket where they leave it.
fn inverse(
    cdf: impl Fn(f64) -> f64,
    pdf: impl Fn(f64) -> f64,
    level: f64,
    start: f64,
    (mut low, mut high): (f64, f64),
) -> f64 {
    const MOST_STEPS: usize = 100;
    let mut x = start.clamp(low, high);
    for _ in 0..MOST_STEPS {
        let over = cdf(x) - level;
        if over < 0.0 {
            low = x
        } else {
            high = x
        }
        let newton = x - over / pdf(x);
        let next = if newton > low && newton < high { newton } else { 0.5 * (low + high) };
        if (next - x).abs() <= 1e-12 * x {
            return next;
        }
        x = next;
    }
    x
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn they_agree_with_tables() {
        for (dof, t) in [(1.0, 12.706_204_736), (2.0, 4.302_652_730), (5.0, 2.570_581_836), (30.0, 2.042_272_456)] {
            assert!((student_95(dof) - t).abs() < 1e-8, "{dof}: {}", student_95(dof));
        }
        // by numerical integration of the density
        for (dof, t) in [(1.0, 10_050.2), (2.0, 125.64), (5.0, 12.28), (30.0, 4.645)] {
            assert!((student_as_4(dof) / t - 1.0).abs() < 2e-3, "{dof}: {}", student_as_4(dof));
        }
        assert!((student_as_4(1e6) - 4.0).abs() < 1e-4 && student_as_4(f64::INFINITY) == 4.0);
        assert!((student_95(1e6) - 1.959_966_357).abs() < 1e-8, "{}", student_95(1e6));
        assert_eq!(student_95(f64::INFINITY), Z);
        assert_eq!(student_95(f64::NAN), student_95(1.0));
        // NIST/SEMATECH, table of F, 0.1 %
        assert!((fisher_999(5.0, 10.0) - 10.481).abs() < 1e-3, "{}", fisher_999(5.0, 10.0));
        assert!((fisher_999(30.0, 60.0) - 2.549).abs() < 1e-2, "{}", fisher_999(30.0, 60.0));
    }

    #[test]
    fn they_end_for_all_degrees_of_freedom() {
        let mut before = f64::INFINITY;
        for k in 0..20_000 {
            let dof = 1.001_f64.powi(k) * 1.37;
            let t = student_95(dof);
            assert!(t <= before && t >= Z, "{dof}: {t}");
            before = t + 1e-9; // the digits of the distribution function
        }
        for (a, b) in [(1.0, 1.0), (300.0, 1.3), (300.0, 1e7 + 0.3), (1e5, 1e9), (744.0, 157.9)] {
            let f = fisher_999(a, b);
            assert!(f.is_finite() && f > 1.0, "{a} {b}: {f}");
        }
        // where there is no distribution, nothing is above its quantile
        for bad in [0.0, -1.0, f64::NAN, f64::INFINITY, 1e308] {
            assert!(fisher_999(bad, 5.0) > 1.0 && fisher_999(5.0, bad) > 1.0, "{bad}");
            assert!(student_95(bad) >= Z && student_as_4(bad) >= 4.0, "{bad}");
        }
    }
}
