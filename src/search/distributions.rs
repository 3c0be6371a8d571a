//! Probabilities of the tests, also where they are too small for a floating-point number.

use crate::probability::{beta_reg, chi2_quantile, chi2_sf, ln_beta, ln_gamma, normal_quantile, t_sf};

/// Below this a regularised incomplete beta function is computed by its series in logarithms.
const SMALLEST: f64 = 1e-250;

/// ln P(F > f) with f = (`part` / `d1`) / (`rest` / `d2`): a strong effect has a p below 1e-308, and must still be
/// ranked. 0, as of no effect, where there is no such probability.
#[must_use]
pub fn ln_p_of_f(part: f64, d1: f64, rest: f64, d2: f64) -> f64 {
    if part <= 0.0 {
        return 0.0;
    }
    if rest <= 0.0 {
        return f64::NEG_INFINITY;
    }
    ln_beta_reg(0.5 * d2, 0.5 * d1, rest / (rest + part)).unwrap_or(0.0)
}

/// P(|T| > |t|) with `dof` degrees of freedom.
#[must_use]
pub fn p_of_t(t: f64, dof: f64) -> f64 {
    t_sf(t.abs(), dof).map_or(f64::NAN, |p| 2.0 * p)
}

/// P(|Z| > |z|) of a normal value.
#[must_use]
pub fn p_of_normal(z: f64) -> f64 {
    p_of_chi2(z * z, 1.0)
}

/// P(χ² > x) with `dof` degrees of freedom.
#[must_use]
pub fn p_of_chi2(x: f64, dof: f64) -> f64 {
    chi2_sf(x, dof).unwrap_or(f64::NAN)
}

fn ln_beta_reg(a: f64, b: f64, x: f64) -> Option<f64> {
    let direct = beta_reg(a, b, x.clamp(0.0, 1.0))?;
    if direct > SMALLEST {
        return Some(direct.ln());
    }
    // x^a / (a B(a, b)) · Σ (1 − b)_n a x^n / ((a + n) n!), Abramowitz and Stegun 26.5.4
    let (mut sum, mut term) = (1.0, 1.0);
    for n in 1..20_000 {
        let n = f64::from(n);
        term *= (n - b) / n * x;
        let added = term * a / (a + n);
        sum += added;
        if added.abs() < 1e-14 * sum.abs() {
            break;
        }
    }
    Some(a * x.ln() - a.ln() - ln_beta(a, b)? + sum.ln()).filter(|ln_p| !ln_p.is_nan())
}

/// ln of a bound on the p-value of the best of many scanned shapes.
///
/// `ln_p` holds the p-value of each shape (`q` columns each, neighbours in the scan next to each other). Two bounds
/// hold, and the smaller is taken: Bonferroni's, and that of Davies (Biometrika 74 (1987) 33) for the supremum of a
/// χ² process, P(χ² > S) + V · S^((q−1)/2) · e^(−S/2) · 2^(−q/2) / Γ(q/2), with V the total variation of √S over the
/// scan: neighbours that resemble each other cost little. Each p is turned into the S that has it.
#[must_use]
pub fn ln_p_of_scan(ln_p: &[f64], q: usize) -> f64 {
    let best = ln_p.iter().copied().fold(0.0, f64::min);
    if ln_p.len() < 2 {
        return best;
    }
    let bonferroni = best + (ln_p.len() as f64).ln();
    // the roots of a tiny p are not needed exactly: Bonferroni's factor no longer matters there
    if best < -300.0 {
        return bonferroni;
    }
    if q == 0 {
        return bonferroni.min(0.0);
    }
    let roots: Vec<f64> = ln_p.iter().map(|&ln_p| root(ln_p, q)).collect();
    let variation: f64 = roots.windows(2).map(|w| (w[1] - w[0]).abs()).sum();
    let top = roots.iter().copied().fold(0.0, f64::max);
    let half_q = 0.5 * q as f64;
    let crossings = variation
        * ((q as f64 - 1.0) * top.max(f64::MIN_POSITIVE).ln()
            - 0.5 * top * top
            - half_q * std::f64::consts::LN_2
            - ln_gamma(half_q))
        .exp();
    bonferroni.min((best.exp() + crossings).ln()).min(0.0)
}

/// √S with ln P(χ²_q > S) = `ln_p`; 0 where that is no number: it stands for no effect.
fn root(ln_p: f64, q: usize) -> f64 {
    let p = ln_p.exp();
    match q {
        1 => normal_quantile(0.5 * p).map_or(0.0, f64::abs),
        // P(χ² > S) = e^(−S/2)
        2 => (-2.0 * ln_p).max(0.0).sqrt(),
        _ if p <= 1e-12 => tail_root(ln_p, q),
        _ => chi2_quantile(1.0 - p, q as f64).unwrap_or(0.0).max(0.0).sqrt(),
    }
}

/// √S with ln P(χ²_q > S) = `ln_p`, for small p: Newton's steps on the leading term of the tail.
fn tail_root(ln_p: f64, q: usize) -> f64 {
    let half_q = 0.5 * q as f64;
    let mut s = -2.0 * ln_p;
    for _ in 0..50 {
        // P ≈ (S/2)^(q/2 − 1) e^(−S/2) / Γ(q/2) · S / (S − q + 2)
        let ln_tail = (half_q - 1.0) * (0.5 * s).ln() - 0.5 * s - ln_gamma(half_q) - (1.0 + (2.0 - q as f64) / s).ln();
        let step = 2.0 * (ln_tail - ln_p);
        s = (s + step).max(1.0);
        if step.abs() < 1e-9 {
            break;
        }
    }
    s.sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn f_agrees_with_tables_and_goes_on_where_numbers_end() {
        // F(0.95; 3, 20) = 3.0984
        assert!((ln_p_of_f(3.0 * 3.0984, 3.0, 20.0, 20.0).exp() - 0.05).abs() < 1e-5);
        // the series joins the direct value
        let direct = beta_reg(150.0, 1.0, 0.05).unwrap().ln();
        assert!((direct - 150.0 * 0.05f64.ln()).abs() < 1e-9);
        let tiny = ln_p_of_f(1e6, 2.0, 300.0, 300.0);
        assert!((tiny - 150.0 * (300.0f64 / 1_000_300.0).ln()).abs() < 1e-6 * tiny.abs(), "{tiny}");
        assert!(ln_p_of_f(2e6, 3.0, 300.0, 300.0) < ln_p_of_f(1e6, 3.0, 300.0, 300.0));
    }

    #[test]
    fn what_is_no_probability_shows_no_effect() {
        const BAD: [f64; 6] = [0.0, -1.0, 1e308, f64::NAN, f64::INFINITY, f64::NEG_INFINITY];
        for a in BAD {
            for b in BAD {
                let all = [ln_p_of_f(a, 2.0, b, 20.0), ln_p_of_f(3.0, a, 20.0, b), ln_p_of_f(a, b, a, b)];
                assert!(all.iter().all(|ln_p| *ln_p <= 1e-9), "{a} {b}: {all:?}");
                let _ = (p_of_t(a, b), p_of_chi2(a, b), p_of_normal(a), ln_p_of_scan(&[a, b], 2));
            }
        }
        assert_eq!(ln_p_of_f(f64::NAN, 2.0, 20.0, 20.0), 0.0);
        assert_eq!(ln_p_of_scan(&[-1.0, -2.0], 0), (-2.0 + 2f64.ln()).min(0.0));
    }

    #[test]
    fn roots_of_small_tails_join_those_of_large_ones() {
        for q in [3, 6] {
            for p in [1e-6f64, 1e-9] {
                let exact = chi2_quantile(1.0 - p, q as f64).unwrap().sqrt();
                assert!((tail_root(p.ln(), q) - exact).abs() < 0.02 * exact, "{q} {p}");
            }
        }
    }

    #[test]
    fn roots_have_their_probability_whatever_the_number_of_columns() {
        for q in [1, 2, 3] {
            for p in [0.9f64, 0.3, 1e-3, 1e-8] {
                let root = root(p.ln(), q);
                assert!((p_of_chi2(root * root, q as f64) / p - 1.0).abs() < 1e-6, "{q} {p}: {root}");
            }
        }
        // Φ(−21.30594) = 1e-100 / 2
        assert!((root(1e-100f64.ln(), 1) - 21.305_940).abs() < 1e-5);
        assert!((root(1e-100f64.ln(), 2) - (200.0 * 10f64.ln()).sqrt()).abs() < 1e-9);
        assert_eq!((root(f64::NAN, 1), root(f64::NAN, 2), root(0.0, 1)), (0.0, 0.0, 0.0));
    }

    #[test]
    fn equal_shapes_cost_nothing_and_no_scan_costs_more_than_bonferroni() {
        let p = 1e-4f64.ln();
        assert!((ln_p_of_scan(&[p; 50], 2) - p).abs() < 1e-9);
        let jagged: Vec<f64> = (0..50).map(|i| if i % 2 == 0 { p } else { -0.01 }).collect();
        assert!(ln_p_of_scan(&jagged, 2) <= p + 50f64.ln() + 1e-12);
        assert!(ln_p_of_scan(&jagged, 2) > p + 1.0);
    }
}
