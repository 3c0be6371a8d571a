//! Adding effects one by one on the linearised level: project the leader out, test again, stop where Holm or the
//! held-out error stops.

use super::basis::Basis;
use super::distributions::ln_p_of_f;
use super::groups::Group;
use super::held_out::{Choice, HeldOut, held_out};
use super::library::Library;
use super::moments::KEPT;
use super::score::{PureError, Question, Search, held_against};
use nalgebra::{DMatrix, DVector};

/// An earlier effect goes again when its p-value next to the others is above this.
const ADDS_NOTHING: f64 = 0.05;

/// One effect added.
#[derive(Debug, Clone)]
pub struct Step {
    /// The group that led.
    pub group: Group,
    /// The member that was added.
    pub added: usize,
    /// Which variant of it.
    pub variant: usize,
    /// Its Holm-adjusted p-value.
    pub p_adjusted: f64,
    /// Root mean square of the whitened residual over all rows after it.
    pub rms: f64,
    /// The nested hold-out that let it pass.
    pub held_out: Option<HeldOut>,
}

/// Why a leader that passes Holm's test was not taken.
#[derive(Debug, Clone, PartialEq)]
pub enum Reason {
    /// Touches that had no part in choosing it are not predicted better with it.
    HeldOut(HeldOut),
    /// It is a shape without a cause: it says on what the misfit depends, and a person must say why.
    NoCause,
    /// The model follows it already.
    Nothing,
}

/// What Holm would have proposed when the loop stopped.
#[derive(Debug, Clone)]
pub struct Refused {
    /// Its group.
    pub group: Group,
    /// Its Holm-adjusted p-value.
    pub p_adjusted: f64,
    /// Expected size of the leader's parameters with standard uncertainties, in typical sizes.
    pub sizes: Vec<(f64, f64)>,
    /// Why not.
    pub reason: Reason,
}

/// Where the loop ended.
#[derive(Debug, Clone)]
pub struct Forward {
    /// The effects in the order in which they were added.
    pub steps: Vec<Step>,
    /// What was not taken in the end; `None`: nothing is left to find.
    pub refused: Option<Refused>,
    /// Indices of steps whose effect says nothing any more next to the later ones (Wald p above 5 %).
    pub dropped: Vec<usize>,
    /// Whitened residual of the last model.
    pub residual: DVector<f64>,
    /// Basis of the last model.
    pub basis: Basis,
}

impl Forward {
    /// Candidates that are in the final model.
    #[must_use]
    pub fn chosen(&self) -> Vec<usize> {
        (0..self.steps.len()).filter(|i| !self.dropped.contains(i)).map(|i| self.steps[i].added).collect()
    }
}

/// Runs the loop for at most `at_most` effects with a name. With `groups` (see [`held_out`]) each must also lower the
/// error of touches that had no part in its choice. Generic shapes are never taken: they have no cause.
#[must_use]
pub fn forward(question: Question, library: &Library, at_most: usize, groups: Option<&[usize]>) -> Forward {
    let mut basis = question.base.clone();
    let mut residual = basis.project(question.residual);
    let mut steps: Vec<Step> = Vec::new();
    let refused = loop {
        if steps.len() == at_most {
            break None;
        }
        let now = Question { residual: &residual, base: &basis, pure: question.pure };
        let search = Search::new(now, library);
        let refuse = |leader: usize, reason: Reason| {
            let s = &search.scores[leader];
            let sizes = (0..s.estimate.len()).map(|i| (s.estimate[i], s.covariance[(i, i)].max(0.0).sqrt())).collect();
            let group = search.group_of(leader, &search.ranking());
            Some(Refused { group, p_adjusted: s.p_adjusted, sizes, reason })
        };
        let Some(leader) = search.leader() else {
            break search.leading_shape().and_then(|shape| refuse(shape, Reason::NoCause));
        };
        let judged = groups.map(|g| held_out(now, library, g, Choice::Redone));
        if let Some(h) = judged.as_ref().filter(|h| !h.falls()) {
            break refuse(leader, Reason::HeldOut(h.clone()));
        }
        let group = search.group_of(leader, &search.ranking());
        let added = group.first();
        let (variant, p_adjusted) = (search.scores[added].variant, search.scores[leader].p_adjusted);
        let mut larger = basis.clone();
        if larger.extend(&library.columns(added, variant), KEPT) == 0 {
            break refuse(leader, Reason::Nothing);
        }
        residual = larger.project(&residual);
        basis = larger;
        let rms = (residual.norm_squared() / residual.len() as f64).sqrt();
        steps.push(Step { group, added, variant, p_adjusted, rms, held_out: judged });
    };
    let mut dropped = Vec::new();
    loop {
        let kept: Vec<usize> = (0..steps.len()).filter(|i| !dropped.contains(i)).collect();
        let columns: Vec<DMatrix<f64>> =
            kept.iter().map(|&i| library.columns(steps[i].added, steps[i].variant)).collect();
        let p = wald(question, &columns);
        let worst = (0..kept.len()).filter(|&i| p[i] > ADDS_NOTHING).max_by(|&a, &b| p[a].total_cmp(&p[b]));
        match worst {
            Some(i) if kept.len() > 1 => dropped.push(kept[i]),
            _ => {
                if !dropped.is_empty() {
                    basis = question.base.clone();
                    for c in &columns {
                        basis.extend(c, KEPT);
                    }
                    residual = basis.project(question.residual);
                }
                return Forward { steps, refused, dropped, residual, basis };
            }
        }
    }
}

/// p-value of each effect next to all the others over the base.
#[must_use]
pub fn wald(question: Question, effects: &[DMatrix<f64>]) -> Vec<f64> {
    let without = |left_out: Option<usize>| -> (f64, usize) {
        let mut basis = question.base.clone();
        for (_, c) in effects.iter().enumerate().filter(|(i, _)| Some(*i) != left_out) {
            basis.extend(c, KEPT);
        }
        (basis.project(question.residual).norm_squared(), basis.rank())
    };
    let (ss, rank) = without(None);
    let (pure_ss, pure_dof) = match question.pure {
        Some(PureError { variance, dof, within: false, .. }) => (variance * dof, dof),
        _ => (0.0, 0.0),
    };
    (0..effects.len())
        .map(|i| {
            let (more, fewer) = without(Some(i));
            let q = rank - fewer;
            let dof = question.residual.len() as f64 - rank as f64 + pure_dof;
            if q == 0 || dof < 1.0 {
                1.0
            } else {
                ln_p_of_f(more - ss, q as f64, held_against(question.pure, ss + pure_ss, dof), dof).exp()
            }
        })
        .collect()
}
