//! Many tests at once: Holm's family-wise level.
//!
//! Candidates with a name (catalogue, user) and generic shapes are two families that share the level, so that the
//! many shapes cost the named effects next to nothing. An adjusted p-value is stated against the whole level: Holm's
//! within the family, times level over the family's share.

use super::score::Score;

/// Probability of any false proposal on clean data.
pub const FAMILY_LEVEL: f64 = 0.05;

/// The part of it that effects with a name may use.
pub const NAMED_LEVEL: f64 = 0.04;

/// The part of it that generic shapes may use: most of them …
pub const GENERIC_LEVEL: f64 = 0.006;

/// … and the few that are looked for before all others.
pub const EXPECTED_LEVEL: f64 = 0.004;

/// Which candidates share a part of the level.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Family {
    /// Effects with a name.
    Named,
    /// Shapes.
    Generic,
    /// The few shapes that are looked for first.
    Expected,
}

/// The part of the level that a family may use.
#[must_use]
pub fn level_of(family: Family) -> f64 {
    match family {
        Family::Named => NAMED_LEVEL,
        Family::Generic => GENERIC_LEVEL,
        Family::Expected => EXPECTED_LEVEL,
    }
}

/// Holm's adjusted p-values (Scandinavian Journal of Statistics 6 (1979) 65).
#[must_use]
pub fn holm(p: &[f64]) -> Vec<f64> {
    let m = p.len();
    let mut out = vec![1.0; m];
    let mut worst = 0.0f64;
    for (rank, &i) in ascending(p).iter().enumerate() {
        worst = worst.max(((m - rank) as f64 * p[i]).min(1.0));
        out[i] = worst;
    }
    out
}

fn ascending(p: &[f64]) -> Vec<usize> {
    let mut order: Vec<usize> = (0..p.len()).collect();
    order.sort_by(|&a, &b| p[a].total_cmp(&p[b]));
    order
}

/// Fills in the adjusted p-values; what the plan cannot see was not tested and does not count.
pub(super) fn adjust(scores: &mut [Score], family_of: impl Fn(&Score) -> Family) {
    for (family, level) in
        [(Family::Named, NAMED_LEVEL), (Family::Generic, GENERIC_LEVEL), (Family::Expected, EXPECTED_LEVEL)]
    {
        let share = level / FAMILY_LEVEL;
        let members: Vec<usize> =
            (0..scores.len()).filter(|&i| scores[i].visible() && family_of(&scores[i]) == family).collect();
        let p: Vec<f64> = members.iter().map(|&i| scores[i].p).collect();
        for (&i, adjusted) in members.iter().zip(holm(&p)) {
            scores[i].p_adjusted = (adjusted / share).min(1.0);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn near(a: &[f64], b: &[f64]) {
        assert!(a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-12), "{a:?} {b:?}");
    }

    #[test]
    fn textbook_values() {
        // p.adjust of R for these four
        let p = [0.01, 0.04, 0.03, 0.005];
        near(&holm(&p), &[0.03, 0.06, 0.06, 0.02]);
        assert!(holm(&[]).is_empty());
    }
}
