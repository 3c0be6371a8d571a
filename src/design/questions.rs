//! What a further program is to settle: pairs of effects of which the data cannot say which one acts.

use super::linearised_plan::LinearisedPlan;
use crate::search::groups::{PLAUSIBLE, alias_pairs};
use crate::search::power::power;
use nalgebra::DVector;

/// Pairs of a plan alone (nothing is known to be missing) that one program is to settle at most.
const MOST_PAIRS: usize = 6;

/// Pairs of a diagnosis that one program is to settle at most: all of a group of fifteen.
const MOST_OPEN: usize = 105;

/// Pairs that are named in a sentence.
const MOST_NAMED: usize = 6;

/// Is it the one, or the other (or nothing)?
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Pair {
    /// Id of one effect.
    pub one: String,
    /// Id of the other; `None`: the question is whether the first is there at all.
    pub other: Option<String>,
}

/// An effect as the data would have it, if it is the one that acts.
#[derive(Debug, Clone, PartialEq)]
pub struct Suspect {
    pub id: String,
    /// Expected size of each parameter, in typical sizes.
    pub size: DVector<f64>,
    /// Value of its scanned shape.
    pub shape: Option<f64>,
}

/// The pairs, and the sizes that the data expect.
#[derive(Debug, Clone, Default)]
pub struct Questions {
    /// The pairs, most pressing first.
    pub pairs: Vec<Pair>,
    /// Effects with a size of their own; those without stand at their typical one.
    pub suspects: Vec<Suspect>,
    /// Where the pairs come from, in a sentence.
    pub says: String,
}

impl Questions {
    /// All pairs of effects that a user names; one alone is asked for itself.
    #[must_use]
    pub fn named(ids: &[String]) -> Self {
        let mut pairs = Vec::new();
        for (i, one) in ids.iter().enumerate() {
            for other in &ids[i + 1..] {
                pairs.push(Pair { one: one.clone(), other: Some(other.clone()) });
            }
        }
        if let [only] = ids {
            pairs.push(Pair { one: only.clone(), other: None });
        }
        Self { pairs, suspects: Vec::new(), says: "effects named in the call, each at its usual size".into() }
    }

    /// What a diagnosis leaves open: every pair of suspects that its data do not tell apart. The first suspect leads; `including`:
    /// effects of which it is a special case.
    #[must_use]
    pub fn left_open(mut suspects: Vec<Suspect>, pairs: &[(usize, usize)], including: &[String]) -> Self {
        for s in &mut suspects {
            // a size beyond belief is that of a trace which hardly differs from the model's: not to be counted on
            let most = s.size.amax();
            if most > PLAUSIBLE {
                s.size *= PLAUSIBLE / most;
            }
        }
        let id = |i: usize| suspects.get(i).map(|s| s.id.clone());
        let Some(leader) = id(0) else { return Self::default() };
        let asked: Vec<Pair> = pairs
            .iter()
            .take(MOST_OPEN)
            .filter_map(|&(a, b)| Some(Pair { one: id(a)?, other: Some(id(b)?) }))
            .collect();
        if asked.is_empty() {
            let says = match including {
                [] => format!("the data name {leader} alone: further touches confirm it"),
                _ => format!(
                    "{leader} explains the remaining error. It is a special case of {}, which no touches can exclude. Further touches \
                     confirm {leader}",
                    including.join(", ")
                ),
            };
            return Self { pairs: vec![Pair { one: leader, other: None }], suspects, says };
        }
        let rivals: Vec<String> = suspects[1..].iter().map(|s| s.id.clone()).collect();
        let named = rivals[..rivals.len().min(MOST_NAMED)].join(", ");
        let more = match rivals.len().saturating_sub(MOST_NAMED) {
            0 => String::new(),
            more => format!(" (and {more} more)"),
        };
        let says = format!("{leader} explains the remaining error; it may as well be {named}{more}");
        Self { pairs: asked, suspects, says }
    }

    /// These questions and others besides.
    #[must_use]
    pub fn and(mut self, other: Self) -> Self {
        self.pairs.extend(other.pairs);
        self.suspects.extend(other.suspects);
        self.says = format!("{}; {}", self.says, other.says);
        self
    }

    /// The pairs that a plan confounds both ways, those first that would be seen best at typical size.
    #[must_use]
    pub fn of_plan(view: &LinearisedPlan) -> Self {
        let seen = power(view.base(), &view.library, &|c| view.raw_um[c].clone());
        let id = |c: usize| view.library.candidates()[c].id.clone();
        let mut pairs: Vec<(f64, Pair)> = alias_pairs(view.base(), &view.library)
            .into_iter()
            .filter(|p| p.both_ways && p.explained < p.by)
            .map(|p| {
                let size = seen[p.explained].at_typical.min(seen[p.by].at_typical);
                (size, Pair { one: id(p.explained), other: Some(id(p.by)) })
            })
            .collect();
        pairs.sort_by(|a, b| b.0.total_cmp(&a.0));
        Self {
            pairs: pairs.into_iter().take(MOST_PAIRS).map(|(_, p)| p).collect(),
            suspects: Vec::new(),
            says: "nothing is missing that the data can show; these effects would be confounded if one of them acted"
                .into(),
        }
    }
}
