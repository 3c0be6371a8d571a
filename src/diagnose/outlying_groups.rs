//! Which faces or blocks it is, where faces or blocks disagree: the one that stands out most is set free, then the next one
//! among what is left. Contrasts of all at once would call a bad face's innocent neighbours bad, too.

use super::evidence::Evidence;
use crate::fit::Fit;
use crate::search::dependence::Dependence;
use crate::search::pattern_tests::Features;
use crate::search::{Basis, KEPT, Library, Origin, Question, Search};
use crate::units::mm_from_um;
use nalgebra::DMatrix;

/// Standard uncertainties beyond which one stands out from twenty.
const FAR: f64 = 3.5;

/// More than this many are no longer single ones.
const AT_MOST: usize = 8;

/// Numbers of the groups that stand out, the most conspicuous first.
pub(super) fn groups(evidence: &Evidence, features: &Features, d: &Dependence, of: &[usize]) -> Vec<usize> {
    let Some(direction) = features.directions.iter().find(|x| x.name == d.direction) else { return Vec::new() };
    let numbers = &d.groups;
    let column = |number: usize| {
        let value = |i: usize| if of[i] == number { mm_from_um(direction.weight[i]) } else { 0.0 };
        evidence.whiten(DMatrix::from_fn(of.len(), 1, |i, _| value(i)))
    };
    let columns: Vec<DMatrix<f64>> = numbers.iter().map(|&number| column(number)).collect();
    let mut base: Basis = evidence.base.clone();
    let mut out = Vec::new();
    while out.len() < AT_MOST {
        let open: Vec<usize> = (0..numbers.len()).filter(|&k| !out.contains(&numbers[k])).collect();
        let mut library = Library::new(evidence.n_rows());
        for &k in &open {
            library.push(k.to_string(), Origin::Generic, &columns[k]);
        }
        let search = Search::new(Question { base: &base, ..evidence.question() }, &library);
        // the same size as a multiple of its doubt, in the scatter that is there beside it
        let best = search.scores.iter().filter(|s| s.visible()).max_by(|a, b| a.f.total_cmp(&b.f));
        let Some(best) = best.filter(|s| s.f > FAR * FAR) else { break };
        let chosen = open[best.candidate];
        if base.extend(&columns[chosen], KEPT) == 0 {
            break;
        }
        out.push(numbers[chosen]);
    }
    out
}

/// The face on the other side of a block, where it was touched. How far a block reaches along an edge is told, and not at which of
/// its two ends: its place is free.
pub(super) fn opposite(fit: &Fit, features: &Features, face: usize) -> Option<usize> {
    let observations = &fit.data.observations;
    let own = &observations[features.face.iter().position(|f| *f == face)?];
    let other = |o: &crate::model::predict::Observation| o.set_up == own.set_up && (o.normal + own.normal).norm() < 0.3;
    observations.iter().position(other).map(|i| features.face[i])
}
