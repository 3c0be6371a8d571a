//! What a further program is to settle: pairs of effects of which the data cannot say which one acts.

use super::view::View;
use crate::search::groups::{PLAUSIBLE, alias_pairs};
use crate::search::power::power;
use nalgebra::DVector;
use std::collections::BTreeMap;

/// Pairs that one program is to settle at most.
const MOST_PAIRS: usize = 6;

/// Is it the one, or the other (or nothing)?
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Pair {
    /// Id of one effect.
    pub one: String,
    /// Id of the other; `None`: the question is whether the first is there at all.
    pub other: Option<String>,
}

/// The pairs, and the sizes that the data expect, in units of typical sizes.
#[derive(Debug, Clone, Default)]
pub struct Questions {
    /// The pairs, most pressing first.
    pub pairs: Vec<Pair>,
    /// Expected size of each parameter of an effect, by its id; effects without stand at their typical size.
    pub sizes: BTreeMap<String, DVector<f64>>,
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
        Self { pairs, sizes: BTreeMap::new(), says: "effects named in the call".into() }
    }

    /// What a diagnosis leaves open: the leading effect against everything that explains the misfit as well. `sizes`: the
    /// expected size of each parameter in units of its typical size, where there is one.
    #[must_use]
    pub fn left_open(leader: &str, rivals: &[String], sizes: BTreeMap<String, DVector<f64>>) -> Self {
        // a size beyond belief is that of a trace which hardly differs from the model's: not to be counted on
        let sizes = sizes.into_iter().filter(|(_, x)| x.amax() <= PLAUSIBLE).collect();
        if rivals.is_empty() {
            return Self {
                pairs: vec![Pair { one: leader.to_owned(), other: None }],
                sizes,
                says: format!("the data name {leader} alone: further touches confirm it"),
            };
        }
        let pair = |rival: &String| Pair { one: leader.to_owned(), other: Some(rival.clone()) };
        Self {
            pairs: rivals.iter().take(MOST_PAIRS).map(pair).collect(),
            sizes,
            says: match rivals.get(MOST_PAIRS..).map_or(0, <[String]>::len) {
                0 => format!("{leader} explains what the model leaves over; it may as well be {}", rivals.join(", ")),
                more => format!(
                    "{leader} explains what the model leaves over; it may as well be {} (and {more} more)",
                    rivals[..MOST_PAIRS].join(", ")
                ),
            },
        }
    }

    /// The pairs that a plan confounds both ways, those first that would be seen best at typical size.
    #[must_use]
    pub fn of_plan(view: &View) -> Self {
        let seen = power(&view.base, &view.library, Some(&view.raw_um), view.noise.sigma_mm);
        let id = |c: usize| view.library.candidates()[c].id.clone();
        let mut pairs: Vec<(f64, Pair)> = alias_pairs(&view.base, &view.library)
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
            sizes: BTreeMap::new(),
            says: "nothing is missing that the data can show; these effects would be confounded if one of them acted"
                .into(),
        }
    }
}
