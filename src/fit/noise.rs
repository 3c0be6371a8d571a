//! How much a touch scatters: from touches repeated at once, or as declared.

use statrs::distribution::{ChiSquared, ContinuousCDF, StudentsT};

/// Fewer degrees of freedom than this say too little: their 95 % interval for σ spans more than a factor of two.
const LEAST_REPEATS: usize = 8;

/// The noise of a touch.
#[derive(Debug, Clone, Copy)]
pub(super) struct Noise {
    /// Standard deviation, mm.
    pub sigma_mm: f64,
    /// `repeats`, `study` or `declared`.
    pub source: &'static str,
    /// Factor of the 95 % interval.
    pub coverage_factor: f64,
}

/// From residuals (mm) and their repeat groups; `stated` is the user's own figure and goes first.
pub(super) fn estimate(residual_mm: &[f64], groups: &[usize], declared_mm: f64, stated_mm: Option<f64>) -> Noise {
    if let Some(sigma_mm) = stated_mm {
        return Noise { sigma_mm, source: "study", coverage_factor: coverage(None) };
    }
    let (mut squares, mut dof, mut at) = (0.0, 0, 0);
    while at < groups.len() {
        let end = at + groups[at..].iter().take_while(|&&g| g == groups[at]).count();
        let group = &residual_mm[at..end];
        let mean = group.iter().sum::<f64>() / group.len() as f64;
        squares += group.iter().map(|r| (r - mean) * (r - mean)).sum::<f64>();
        dof += group.len() - 1;
        at = end;
    }
    let sigma_mm = (squares / dof as f64).sqrt();
    // repeats without any scatter come from a noise-free log: dividing by them would mean nothing
    if dof >= LEAST_REPEATS && sigma_mm > 1e-9 {
        Noise { sigma_mm, source: "repeats", coverage_factor: coverage(Some(dof)) }
    } else {
        Noise { sigma_mm: declared_mm, source: "declared", coverage_factor: coverage(None) }
    }
}

/// Two-sided 95 % factor of Student's t, or of the normal distribution where σ is taken as known.
fn coverage(dof: Option<usize>) -> f64 {
    let t = dof.and_then(|d| StudentsT::new(0.0, 1.0, d as f64).ok());
    t.map_or(1.959_963_984_540_054, |t| t.inverse_cdf(0.975))
}

/// χ²/dof above this has a probability below 0.1 % when the model holds.
pub(super) fn chi2_limit(dof: usize) -> f64 {
    ChiSquared::new(dof as f64).map_or(f64::INFINITY, |d| d.inverse_cdf(0.999) / dof as f64)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn repeats_give_the_pure_error() {
        let residual: Vec<f64> =
            (0..20).map(|i| 0.01 * f64::from(i / 2) + if i % 2 == 0 { 1e-3 } else { -1e-3 }).collect();
        let groups: Vec<usize> = (0..20).map(|i| i / 2).collect();
        let noise = estimate(&residual, &groups, 5.0, None);
        assert_eq!(noise.source, "repeats");
        assert!((noise.sigma_mm - 2f64.sqrt() * 1e-3).abs() < 1e-15);
        assert!((noise.coverage_factor - 2.228).abs() < 1e-3);
    }

    #[test]
    fn too_few_repeats_mean_the_declared_value() {
        let noise = estimate(&[0.1, 0.2, 0.3], &[0, 0, 1], 5.0, None);
        assert_eq!((noise.sigma_mm, noise.source), (5.0, "declared"));
    }

    #[test]
    fn chi_square_limit_is_above_one() {
        assert!((chi2_limit(100) - 1.494).abs() < 2e-3);
    }
}
