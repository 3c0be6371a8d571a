//! What a diagnosis leaves open: which of its effects these touches do not tell apart, and how large each would be.

use super::Examination;
use crate::design::questions::Suspect;
use crate::search::groups::{AS_LIKELY, Group, Member};

/// Effects of which the data cannot say which one acts.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Open {
    /// The effects, the one that is named first in front.
    pub suspects: Vec<Suspect>,
    /// Pairs of them that these touches do not tell apart.
    pub pairs: Vec<(usize, usize)>,
    /// Effects of the first group of which the first effect is a special case: no touches separate them.
    pub including: Vec<String>,
    /// Scatter of index visits that the tests allowed for, mm.
    pub tau_mm: f64,
}

/// All pairs of the first group, and its members against those of groups that are as likely.
#[must_use]
pub(super) fn open(seen: &Examination) -> Open {
    let Some(first) = seen.groups.first() else { return Open::default() };
    let ln_p = |g: &Group| seen.order().scores[g.leader].ln_p;
    let best = ln_p(first);
    let tied = |g: &&Group| best.is_finite() && ln_p(g) - best < AS_LIKELY;
    let suspect = |candidate: usize| {
        let score = &seen.scores(0)[candidate];
        let shape = seen.named.library.candidates()[candidate].variants[score.variant].shape;
        Suspect {
            id: seen.named.effects[candidate].id.clone(),
            size: score.estimate.clone(),
            shape: seen.named.scanned[candidate].as_ref().map(|_| shape),
        }
    };
    // no touches separate an effect from one of which it is a special case: the simpler one is asked about
    let simplest = &seen.named.effects[first.first()].id;
    let includes = |m: &&Member| seen.named.effects[m.candidate].includes.contains(simplest);
    let (including, own): (Vec<&Member>, Vec<&Member>) = first.members.iter().partition(includes);
    let including = including.iter().map(|m| seen.named.effects[m.candidate].id.clone()).collect();
    let mut suspects: Vec<Suspect> = own.iter().map(|m| suspect(m.candidate)).collect();
    let n = suspects.len();
    let mut pairs: Vec<(usize, usize)> = (0..n).flat_map(|a| (a + 1..n).map(move |b| (a, b))).collect();
    for group in seen.groups[1..].iter().filter(tied) {
        let from = suspects.len();
        suspects.extend(group.members.iter().map(|m| suspect(m.candidate)));
        pairs.extend((0..n).flat_map(|a| (from..suspects.len()).map(move |b| (a, b))));
    }
    Open { suspects, pairs, including, tau_mm: seen.evidence.tau_mm }
}
