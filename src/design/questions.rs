//! What a further program is to settle: pairs of effects of which the data cannot say which one acts.

use super::view::View;
use crate::diag::Result;
use crate::fit::Fit;
use crate::fit::candidates::columns;
use crate::fit::uncertainty::unmodelled_by;
use crate::machine::Machine;
use crate::model::catalogue::{Catalogue, Effect};
use crate::search::groups::{PLAUSIBLE, alias_pairs};
use crate::search::power::power;
use crate::search::{Basis, Library, Origin, Question, Search};
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

    /// What the misfit of a study leaves open: the leading candidate against everything that explains the misfit as
    /// well; where nothing is missing, the pairs of effects that its plan confounds and that would matter most.
    ///
    /// # Errors
    /// Never for a fit that exists.
    pub fn of_fit(fit: &Fit, machine: &Machine, catalogue: &Catalogue, view: &View) -> Result<Self> {
        let effects: Vec<&Effect> = unmodelled_by(&fit.model.unknowns, machine, catalogue);
        let tau_mm = fit.noise.tau_test_mm;
        let linear = fit.linear(tau_mm);
        let all = columns(machine, &effects, &fit.data, &fit.data.observations, fit.model.reference, None);
        let mut values = all.values;
        for (mut column, u) in values.column_iter_mut().zip(&all.unknowns) {
            column *= u.typical;
        }
        fit.with_touches(tau_mm, |t| t.whiten(&mut values));
        let values = values.resize_vertically(linear.jacobian.nrows(), 0.0);
        let mut library = Library::new(values.nrows());
        for effect in &effects {
            let own: Vec<usize> = (0..all.unknowns.len())
                .filter(|&i| all.unknowns[i].effect == effect.id && !all.unknowns[i].shape)
                .collect();
            library.push(effect.id.clone(), Origin::Catalogue, &values.select_columns(&own));
        }
        let base = Basis::new(&linear.jacobian);
        let search = Search::new(Question { residual: &linear.residual, base: &base, pure: None }, &library);
        let id = |c: usize| library.candidates()[c].id.clone();
        let Some(leader) = search.leader() else { return Ok(Self::of_plan(view)) };
        let group = search.group_of(leader, &search.ranking());
        let mut rivals: Vec<usize> =
            group.members.iter().filter(|m| m.candidate != leader).map(|m| m.candidate).collect();
        rivals.truncate(MOST_PAIRS);
        let mut sizes = BTreeMap::new();
        for c in rivals.iter().copied().chain([leader]) {
            // a size beyond belief is that of a trace which hardly differs from the model's: not to be counted on
            if search.scores[c].relative_size() <= PLAUSIBLE {
                sizes.insert(id(c), search.scores[c].estimate.clone());
            }
        }
        if rivals.is_empty() {
            return Ok(Self {
                pairs: vec![Pair { one: id(leader), other: None }],
                sizes,
                says: format!("the data name {} alone: further touches confirm it", id(leader)),
            });
        }
        let says = format!(
            "{} explains what the model leaves over, and so does {}",
            id(leader),
            rivals.iter().map(|&c| id(c)).collect::<Vec<_>>().join(", ")
        );
        let pairs = rivals.iter().map(|&c| Pair { one: id(leader), other: Some(id(c)) }).collect();
        Ok(Self { pairs, sizes, says })
    }

    /// The pairs that a plan confounds both ways, those first that would be seen best at typical size.
    fn of_plan(view: &View) -> Self {
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
