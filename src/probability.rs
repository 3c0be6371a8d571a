//! Distribution functions that answer every input: `None` where no probability can be computed. The only place that calls the library's,
//! which end the process where they cannot (no degrees of freedom, not a number, an argument that overflows).

use statrs::distribution::{
    Continuous, ContinuousCDF, DiscreteCDF, FisherSnedecor, Gamma, Hypergeometric, Normal, StudentsT,
};
use statrs::function::beta;

pub use statrs::function::gamma::ln_gamma;

/// Degrees of freedom from which the limit for endless ones is as exact as the library, and ends sooner.
const ENDLESS: f64 = 1e8;

/// Quantiles are searched up to this probability of a tail.
const LEAST_TAIL: f64 = 1e-15;

/// Is this a number of degrees of freedom? The library halves it.
fn is_dof(dof: f64) -> bool {
    dof.is_finite() && 0.5 * dof > 0.0
}

fn number(value: f64) -> Option<f64> {
    (!value.is_nan()).then_some(value)
}

/// P(χ² ≤ x).
#[must_use]
pub fn chi2_cdf(x: f64, dof: f64) -> Option<f64> {
    chi2(x, dof, Gamma::cdf, Normal::cdf)
}

/// P(χ² > x).
#[must_use]
pub fn chi2_sf(x: f64, dof: f64) -> Option<f64> {
    chi2(x, dof, Gamma::sf, Normal::sf)
}

fn chi2(x: f64, dof: f64, of: fn(&Gamma, f64) -> f64, of_many: fn(&Normal, f64) -> f64) -> Option<f64> {
    if !is_dof(dof) || x.is_nan() {
        return None;
    }
    // half of a denormal number is 0, which the library does not take
    let x = if x < f64::MIN_POSITIVE { 0.0 } else { x };
    if dof > ENDLESS {
        // Wilson and Hilferty: the cube root is normal
        let ninth = 2.0 / (9.0 * dof);
        let z = ((x / dof).cbrt() - (1.0 - ninth)) / ninth.sqrt();
        return number(of_many(&Normal::standard(), z));
    }
    number(of(&Gamma::new(0.5 * dof, 0.5).ok()?, x))
}

/// The x with P(χ² ≤ x) = p.
#[must_use]
pub fn chi2_quantile(p: f64, dof: f64) -> Option<f64> {
    if !is_dof(dof) || !(0.0..=1.0).contains(&p) {
        return None;
    }
    if p == 1.0 {
        return Some(f64::INFINITY);
    }
    if dof > ENDLESS {
        let ninth = 2.0 / (9.0 * dof);
        let z = Normal::standard().inverse_cdf(p.clamp(LEAST_TAIL, 1.0 - LEAST_TAIL));
        return number(dof * (1.0 - ninth + z * ninth.sqrt()).powi(3));
    }
    // P(χ² ≤ x) is about (x/2)^(dof/2): below this x is no longer a number, and the library would go on to 0
    if p.ln() < -690.0 * (0.5 * dof) {
        return Some(0.0);
    }
    quantile(&Gamma::new(0.5 * dof, 0.5).ok()?, p, dof)
}

/// The z with P(Z ≤ z) = p of a normal value.
#[must_use]
pub fn normal_quantile(p: f64) -> Option<f64> {
    (0.0..=1.0).contains(&p).then(|| Normal::standard().inverse_cdf(p)).and_then(number)
}

/// Newton's steps from the approximation of Wilson and Hilferty, within what is known to bracket the quantile: fewer steps than the
/// library's. Where they do not end, the library's.
fn quantile(of: &Gamma, p: f64, dof: f64) -> Option<f64> {
    const MOST_STEPS: usize = 40;
    /// After a step of less than this part of x the next one is rounding.
    const STEP: f64 = 1e-8;
    /// Below this x the first term of the probability is as exact as the library.
    const NEARLY: f64 = 1e-9;
    let ninth = 2.0 / (9.0 * dof);
    // P(χ² ≤ x) < (x/2)^(dof/2) / Γ(dof/2 + 1), and nearly so where x is small
    let mut low = 2.0 * ((p.ln() + ln_gamma(0.5 * dof + 1.0)) / (0.5 * dof)).exp();
    if low < NEARLY {
        return number(low);
    }
    let mut high = f64::INFINITY;
    let z = Normal::standard().inverse_cdf(p.min(1.0 - LEAST_TAIL));
    let mut x = if p < LEAST_TAIL { low } else { (dof * (1.0 - ninth + z * ninth.sqrt()).powi(3)).max(low) };
    for _ in 0..MOST_STEPS {
        // the smaller tail has more digits
        let beyond = if p < 0.5 { of.cdf(x) - p } else { (1.0 - p) - of.sf(x) };
        if beyond == 0.0 {
            return number(x);
        }
        if beyond > 0.0 {
            high = x;
        } else {
            low = x;
        }
        // by its logarithm: the density itself overflows where there are many degrees of freedom
        let newton = x - beyond / of.ln_pdf(x).exp();
        if newton > low && newton < high {
            if (newton - x).abs() <= STEP * x {
                return number(newton);
            }
            x = newton;
        } else if high.is_finite() {
            x = 0.5 * (low + high);
        } else {
            x *= 2.0;
        }
    }
    number(of.inverse_cdf(p))
}

/// P(F ≤ x).
#[must_use]
pub fn f_cdf(x: f64, dof: f64, dof_below: f64) -> Option<f64> {
    if dof_below > ENDLESS {
        return chi2_cdf(dof * x, dof);
    }
    number(fisher(x, dof, dof_below)?.cdf(x))
}

/// P(F > x).
#[must_use]
pub fn f_sf(x: f64, dof: f64, dof_below: f64) -> Option<f64> {
    if dof_below > ENDLESS {
        return chi2_sf(dof * x, dof);
    }
    number(fisher(x, dof, dof_below)?.sf(x))
}

/// Density of F.
#[must_use]
pub fn f_pdf(x: f64, dof: f64, dof_below: f64) -> Option<f64> {
    number(fisher(x, dof, dof_below)?.pdf(x))
}

fn fisher(x: f64, dof: f64, dof_below: f64) -> Option<FisherSnedecor> {
    let all_are = |good: fn(f64) -> bool| [dof, dof_below].into_iter().all(good);
    // the library divides this product by itself and the degrees of freedom below
    let is_computable = x.is_infinite() || (dof * x + dof_below).is_finite();
    if x.is_nan() || !is_computable || !all_are(is_dof) || !all_are(|dof| dof <= ENDLESS) {
        return None;
    }
    FisherSnedecor::new(dof, dof_below).ok()
}

/// P(T ≤ t) of Student's t.
#[must_use]
pub fn t_cdf(t: f64, dof: f64) -> Option<f64> {
    number(student(t, dof)?.cdf(t))
}

/// P(T > t) of Student's t.
#[must_use]
pub fn t_sf(t: f64, dof: f64) -> Option<f64> {
    number(student(t, dof)?.sf(t))
}

/// Density of Student's t.
#[must_use]
pub fn t_pdf(t: f64, dof: f64) -> Option<f64> {
    number(student(t, dof)?.pdf(t))
}

fn student(t: f64, dof: f64) -> Option<StudentsT> {
    // endless ones are the normal distribution
    let dof = if dof > ENDLESS { f64::INFINITY } else { dof };
    if t.is_nan() || 0.5 * dof <= 0.0 {
        return None;
    }
    StudentsT::new(0.0, 1.0, dof).ok()
}

/// P(X > x): more than x of the `drawn` ones are among the `marked` ones of `all`.
#[must_use]
pub fn hypergeometric_sf(x: u64, all: u64, marked: u64, drawn: u64) -> Option<f64> {
    number(Hypergeometric::new(all, marked, drawn).ok()?.sf(x))
}

/// The regularised incomplete beta function I_x(a, b).
#[must_use]
pub fn beta_reg(a: f64, b: f64, x: f64) -> Option<f64> {
    if !is_dof(a) || !is_dof(b) || a.max(b) > ENDLESS {
        return None;
    }
    beta::checked_beta_reg(a, b, x).ok().and_then(number)
}

/// ln B(a, b).
#[must_use]
pub fn ln_beta(a: f64, b: f64) -> Option<f64> {
    if !is_dof(a) || !is_dof(b) {
        return None;
    }
    beta::checked_ln_beta(a, b).ok().and_then(number)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn they_agree_with_tables() {
        let close = |found: Option<f64>, table: f64| (found.unwrap() - table).abs() < 1e-3 * table;
        assert!(close(chi2_quantile(0.95, 10.0), 18.307) && close(chi2_sf(18.307, 10.0), 0.05));
        assert!(close(f_sf(3.0984, 3.0, 20.0), 0.05) && close(t_sf(2.571, 5.0), 0.025));
        // joined at the change to the limit
        let (below, above) = (0.999 * ENDLESS, 1.001 * ENDLESS);
        let at = |dof: f64, z: f64| chi2_sf(dof + z * (2.0 * dof).sqrt(), dof).unwrap();
        for z in [-2.0, 0.0, 2.0] {
            assert!((at(below, z) - at(above, z)).abs() < 1e-4, "{z}: {} {}", at(below, z), at(above, z));
        }
        let quantile = |dof: f64| (chi2_quantile(0.999, dof).unwrap() - dof) / dof.sqrt();
        assert!((quantile(below) - quantile(above)).abs() < 1e-3, "{} {}", quantile(below), quantile(above));
        assert!((t_sf(2.0, below).unwrap() - t_sf(2.0, above).unwrap()).abs() < 1e-6);
        assert!((f_sf(1.5, 4.0, below).unwrap() - f_sf(1.5, 4.0, above).unwrap()).abs() < 1e-6);
    }

    #[test]
    fn quantiles_have_their_probability() {
        for dof in [0.3, 1.0, 2.0, 3.0, 4.0, 7.0, 12.5, 60.0, 257.0, 280.0, 300.0, 320.0, 4000.0, 1e7] {
            for p in [1e-200, 1e-12, 1e-6, 1e-3, 0.1, 0.45, 0.5, 0.9, 0.999, 1.0 - 1e-9] {
                // with so many degrees of freedom neither search reaches so small a probability
                if dof > 1e4 && p < 1e-100 {
                    continue;
                }
                let x = chi2_quantile(p, dof).unwrap();
                let (at, tail) = (chi2_cdf(x, dof).unwrap(), chi2_sf(x, dof).unwrap());
                let near = if dof > 1e4 { 1e-6 } else { 1e-9 };
                let close = (at / p - 1.0).abs() < near && (p < 0.5 || (tail / (1.0 - p) - 1.0).abs() < 1e-6);
                assert!(close || x == 0.0, "{dof} {p}: {x} {at} {tail}");
                assert!(x > 0.0 || p < 1e-100, "{dof} {p}");
            }
        }
    }

    /// Every function with every kind of number: an answer between 0 and 1, a quantile of at least 0, or none.
    #[test]
    fn nothing_ends_the_process() {
        const NUMBERS: [f64; 17] = [
            0.0,
            -0.0,
            -1.0,
            0.5,
            1.0,
            2.0,
            300.0,
            5e-324,
            1e-308,
            1e-9,
            1e9,
            1e17,
            1e308,
            -1e308,
            f64::INFINITY,
            f64::NEG_INFINITY,
            f64::NAN,
        ];
        let mut answers = 0;
        for a in NUMBERS {
            for b in NUMBERS {
                let of_two = [chi2_cdf(a, b), chi2_sf(a, b), t_cdf(a, b), t_sf(a, b)];
                assert!(of_two.iter().flatten().all(|p| (0.0..=1.0 + 1e-9).contains(p)), "{a} {b}: {of_two:?}");
                answers += of_two.iter().flatten().count();
                let rest = [chi2_quantile(a, b), t_pdf(a, b)];
                assert!(rest.iter().flatten().all(|q| *q >= 0.0), "{a} {b}: {rest:?}");
                assert!(ln_beta(a, b).is_none_or(|l| !l.is_nan()));
                for c in NUMBERS {
                    let of_three = [f_cdf(a, b, c), f_sf(a, b, c), beta_reg(a, b, c)];
                    let good = |p: &f64| (-1e-9..=1.0 + 1e-9).contains(p);
                    assert!(of_three.iter().flatten().all(good), "{a} {b} {c}: {of_three:?}");
                    assert!(f_pdf(a, b, c).is_none_or(|p| p >= 0.0), "{a} {b} {c}");
                }
            }
        }
        assert!(answers > 300, "{answers}");
        for (all, marked, drawn) in [(0, 0, 0), (10, 3, 5), (10, 20, 5), (10, 3, 20), (10, 0, 0), (u64::MAX, 1, 1)] {
            let found = hypergeometric_sf(2, all, marked, drawn);
            assert!(found.is_none_or(|p| (-1e-9..=1.0 + 1e-9).contains(&p)), "{all} {marked} {drawn}: {found:?}");
        }
        for dof in [0.0, -1.0, f64::NAN] {
            assert_eq!(
                [chi2_cdf(1.0, dof), chi2_quantile(0.5, dof), f_sf(1.0, dof, 3.0), f_sf(1.0, 3.0, dof)],
                [None; 4]
            );
        }
    }
}
