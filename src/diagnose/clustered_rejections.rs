//! Touches that were not used and lie together: chips on a face, a block that was knocked. Single bad readings come from
//! anywhere; many from one place are a finding.

use crate::fit::Fit;
use crate::probability::hypergeometric_sf;
use crate::search::multiplicity::FAMILY_LEVEL;
use crate::search::pattern_tests::Features;

/// Fewer touches than this may lie together by chance.
const LEAST: usize = 4;

/// Probability, over all places looked at, below which it is none.
const LEVEL: f64 = 1e-3;

/// A place where many touches were not used.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Gathered {
    /// `face`, `block` or `visit`.
    pub by: &'static str,
    /// Of so many touches that were not used …
    pub rejected: usize,
    /// … so many lie there.
    pub here: usize,
    /// Touches there in all.
    pub of: usize,
    /// Probability of that by chance, all places counted in.
    pub p: f64,
    /// Observation that stands for the place.
    pub one: usize,
}

/// The place that stands out most.
pub(super) fn gathered(fit: &Fit, features: &Features) -> Option<Gathered> {
    let bad: Vec<usize> = fit.rejected.iter().filter(|(_, why)| why.is_outlier()).map(|r| *r.0).collect();
    if bad.len() < LEAST {
        return None;
    }
    let total = fit.data.observations.len();
    let ways: [(&'static str, &[usize]); 3] =
        [("face", &features.face), ("block", &features.block), ("visit", &features.visit)];
    let places: usize = ways.iter().map(|w| w.1.iter().max().map_or(0, |m| m + 1)).sum();
    let mut best: Option<Gathered> = None;
    for (by, group) in ways {
        let mut seen: Vec<usize> = bad.iter().filter_map(|&i| group.get(i).copied()).collect();
        seen.sort_unstable();
        seen.dedup();
        for place in seen {
            let of = group.iter().filter(|g| **g == place).count();
            let mut there = bad.iter().copied().filter(|&i| group.get(i) == Some(&place));
            let Some(one) = there.next() else { continue };
            let here = 1 + there.count();
            let [total, of_place, drawn, beside] = [total, of, bad.len(), here - 1].map(|n| n as u64);
            let Some(chance) = hypergeometric_sf(beside, total, of_place, drawn) else { continue };
            let p = (places as f64 * chance).min(1.0);
            if here >= LEAST && p < LEVEL && best.as_ref().is_none_or(|b| p < b.p) {
                best = Some(Gathered { by, rejected: bad.len(), here, of, p, one });
            }
        }
    }
    best
}

/// Faces on which more of the touches that were not used lie than by chance, where it is known that faces differ: an
/// observation of each.
pub(super) fn faces(fit: &Fit, features: &Features) -> Vec<usize> {
    let bad: Vec<usize> = fit.rejected.iter().filter(|(_, why)| why.is_outlier()).map(|r| *r.0).collect();
    let n_faces = features.face.iter().max().map_or(0, |m| m + 1);
    let each = (0..n_faces).filter_map(|face| {
        let of = features.face.iter().filter(|f| **f == face).count();
        let here: Vec<usize> = bad.iter().copied().filter(|&i| features.face.get(i) == Some(&face)).collect();
        let [total, of_face, drawn, beside] =
            [features.face.len(), of, bad.len(), here.len().saturating_sub(1)].map(|n| n as u64);
        let p = n_faces as f64 * hypergeometric_sf(beside, total, of_face, drawn)?;
        (here.len() >= LEAST && p < FAMILY_LEVEL).then(|| here[0])
    });
    each.collect()
}

impl Gathered {
    /// In a sentence.
    pub fn says(&self, fit: &Fit) -> String {
        let origin = &fit.data.origins[self.one];
        let place = match self.by {
            "face" => format!("face {} of block {}", origin.face, origin.block),
            "block" => format!("block {}", origin.block),
            _ => format!("index position {}", fit.data.visits[self.one] + 1),
        };
        format!(
            "{} of the {} touches that are not used are on {place} (of {} there): check it",
            self.here, self.rejected, self.of
        )
    }

    /// What kind of thing does that.
    pub fn kind(&self) -> &'static str {
        match self.by {
            "face" => "chips, burrs or coolant on the face",
            "block" => "a block that moved: loose, knocked, or dirt under it",
            _ => "a pose that was not clamped like the others",
        }
    }
}
