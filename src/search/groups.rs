//! Findings as groups: candidates whose traces these touches cannot tell apart stand together under one leader.

pub use super::distinguishability::ALIGNED;
use super::distinguishability::adds_nothing;
use super::distributions::ln_p_of_f;
use super::library::Origin;
use super::moments::{Block, Moments};
use super::score::{Search, held_against};
use nalgebra::{DMatrix, DVector};
use std::ops::Range;

/// A rival explains at least this share of the leader's trace: a leader that is hardly there adds nothing after anything.
const RIVAL: f64 = 0.5;

/// Expected sizes above this many typical sizes are implausible.
pub const PLAUSIBLE: f64 = 5.0;

/// Logarithms of p-values closer than this make no difference (a factor of 20): it takes more to name the less simple effect.
pub const AS_LIKELY: f64 = 3.0;

/// A size of the wrong sign counts as a thousand times less likely: it takes more than a machine that wears.
const WRONG_SIGN: f64 = 7.0;

/// A candidate in a group.
#[derive(Debug, Clone, PartialEq)]
pub struct Member {
    /// Index in the library.
    pub candidate: usize,
    /// ‖Uᵀŵ‖²: share of the leader's trace that it explains.
    pub alignment: f64,
    /// Noncentrality of what of the leader's trace it does not explain, as estimated: 25 tells the two apart safely.
    pub separation: f64,
    /// p-value of adding the leader after it.
    pub leader_after_p: f64,
    /// Is its expected size at most [`PLAUSIBLE`] typical sizes?
    pub plausible: bool,
    /// Would a size that is positive by nature (lost motion, sag) be negative?
    pub wrong_sign: bool,
}

/// One finding.
#[derive(Debug, Clone, PartialEq)]
pub struct Group {
    /// The most significant candidate.
    pub leader: usize,
    /// The leader and every candidate after which it adds nothing ([`super::distinguishability`]): as likely as the leader first (a wrong
    /// sign makes a member less so), then the right sign, fewest parameters, plausible size, user's own, p-value.
    pub members: Vec<Member>,
}

impl Group {
    /// The first by order: what to name first.
    #[must_use]
    pub fn first(&self) -> usize {
        self.members.first().map_or(self.leader, |m| m.candidate)
    }

    #[must_use]
    pub fn holds(&self, candidate: usize) -> bool {
        self.members.iter().any(|m| m.candidate == candidate)
    }
}

impl Search<'_> {
    /// The first groups of the ranking, at most so many; a candidate stands in one of them only.
    #[must_use]
    pub fn groups(&self, at_most: usize) -> Vec<Group> {
        let mut left = self.ranking();
        let mut out = Vec::new();
        while out.len() < at_most && !left.is_empty() {
            let group = self.group_of(left[0], &left);
            left.retain(|&c| !group.holds(c));
            out.push(group);
        }
        out
    }

    /// The group of a leader among candidates (the leader included). Effects with a name and generic shapes do not
    /// stand in one group: a shape is no cause.
    #[must_use]
    pub fn group_of(&self, leader: usize, among: &[usize]) -> Group {
        let trace = self.trace(leader);
        // ŵ: the direction in the data that speaks for the leader
        let direction = -(&trace.left * &self.scores[leader].estimate);
        let length = direction.norm();
        let unit =
            DMatrix::from_column_slice(direction.len(), 1, (direction / length.max(f64::MIN_POSITIVE)).as_slice());
        let generic = |c: usize| self.library.candidates()[c].origin == Origin::Generic;
        let rivals: Vec<usize> = among.iter().copied().filter(|&j| generic(j) == generic(leader)).collect();
        let spans: Vec<Range<usize>> = rivals.iter().map(|&j| self.span(j)).collect();
        // the direction and the trace in one go: columns may have to be made anew
        let mut both = unit.resize_horizontally(1 + trace.left.ncols(), 0.0);
        both.columns_mut(1, trace.left.ncols()).copy_from(&trace.left);
        let cross = Moments::cross(&both, self.library, &spans);
        let mut at = 0;
        let mut members: Vec<Member> = rivals
            .iter()
            .zip(&spans)
            .filter_map(|(&j, span)| {
                let block = self.block(j);
                let (first, own) = (at, cross.columns(at, span.len()));
                at = first + span.len();
                let alignment = block.whitener.tr_mul(&own.row(0).transpose()).norm_squared().min(1.0);
                if j != leader && alignment < RIVAL {
                    return None;
                }
                let on_trace = own.rows(1, own.nrows() - 1).transpose();
                let leader_after_p = if j == leader { 1.0 } else { self.leader_after(&trace, j, &block, &on_trace) };
                let alignment = if j == leader { 1.0 } else { alignment };
                adds_nothing(leader_after_p).then(|| Member {
                    candidate: j,
                    alignment,
                    separation: self.scores[leader].noncentrality * (1.0 - alignment),
                    leader_after_p,
                    plausible: self.scores[j].relative_size() <= PLAUSIBLE,
                    wrong_sign: !self.scores[j].wrong_signs(self.library).is_empty(),
                })
            })
            .collect();
        let best = self.scores[leader].ln_p;
        let rank = |m: &Member| self.rank_of(m, best);
        members.sort_by(|a, b| rank(a).partial_cmp(&rank(b)).unwrap_or(std::cmp::Ordering::Equal));
        Group { leader, members }
    }

    /// Sorts members: what comes first is named first. Those that are as likely as the leader go by simplicity; those
    /// that are clearly less likely come after them, however simple they are, and a size of the wrong sign after the right ones.
    fn rank_of(&self, m: &Member, best: f64) -> (f64, bool, usize, bool, bool, f64) {
        let score = &self.scores[m.candidate];
        let behind = if best.is_finite() { ((score.ln_p - best) / AS_LIKELY).floor().max(0.0) } else { 0.0 };
        let behind = behind + if m.wrong_sign { WRONG_SIGN } else { 0.0 };
        let origin = self.library.candidates()[m.candidate].origin;
        (behind, m.wrong_sign, score.n_parameters, !m.plausible, origin != Origin::User, score.ln_p)
    }

    /// Columns of a candidate's best variant.
    fn span(&self, candidate: usize) -> Range<usize> {
        self.library.candidates()[candidate].variants[self.scores[candidate].variant].columns.clone()
    }

    /// PJ of a candidate's best variant, with its products.
    fn trace(&self, candidate: usize) -> Trace {
        let columns = self.columns(candidate);
        let raw = columns.tr_mul(&columns);
        let left = self.question.base.project_columns(&columns);
        let gram = left.tr_mul(&left);
        let residual = self.moments.jr.rows(self.span(candidate).start, columns.ncols()).into_owned();
        Trace { raw, gram, residual, left }
    }

    /// p-value of the leader once candidate j is in the model; `on_trace`: JⱼᵀPJ of the leader.
    fn leader_after(&self, leader: &Trace, j: usize, block: &Block, on_trace: &DMatrix<f64>) -> f64 {
        let span = self.span(j);
        // UⱼᵀPJ of the leader and Uⱼᵀr
        let shared = block.whitener.tr_mul(on_trace);
        let along = block.whitener.tr_mul(&self.moments.jr.rows(span.start, span.len()));
        let left = &leader.gram - shared.tr_mul(&shared);
        let after = Block::new(&leader.raw, &left);
        let q = after.rank();
        if q == 0 {
            return 1.0;
        }
        let delta = after.whitener.tr_mul(&(&leader.residual - shared.tr_mul(&along))).norm_squared();
        let (pure_ss, pure_dof) = match self.question.pure {
            Some(e) if !e.within => (e.variance * e.dof, e.dof),
            _ => (0.0, 0.0),
        };
        let rest = (self.moments.rr - along.norm_squared() - delta).max(0.0) + pure_ss;
        let dof = (self.moments.n - self.moments.p) as f64 - (self.scores[j].n_parameters + q) as f64 + pure_dof;
        if dof < 1.0 { 1.0 } else { ln_p_of_f(delta, q as f64, held_against(self.question.pure, rest, dof), dof).exp() }
    }
}

/// A leader's columns after projection.
struct Trace {
    raw: DMatrix<f64>,
    gram: DMatrix<f64>,
    residual: DVector<f64>,
    left: DMatrix<f64>,
}

/// Two candidates of a plan of which one explains the other.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AliasPair {
    /// The candidate that is explained.
    pub explained: usize,
    /// The candidate that explains it.
    pub by: usize,
    /// ‖U_bᵀU_a‖²/q_a.
    pub share: f64,
    /// Both ways: they cannot be told apart; else the one is contained in the other.
    pub both_ways: bool,
}

/// Alias pairs of a plan, from no measurement: candidate `a` is explained by `b` when ‖U_bᵀU_a‖²_F/q_a is at least
/// [`ALIGNED`]: even at a size that is clearly seen `b` leaves too little of it. Each candidate stands with its first variant.
#[must_use]
pub fn alias_pairs(base: &super::Basis, library: &super::Library) -> Vec<AliasPair> {
    let shares = super::power::shares(base, library);
    let mut out = Vec::new();
    for explained in 0..shares.nrows() {
        for by in 0..shares.ncols() {
            let share = shares[(explained, by)];
            if explained != by && share >= ALIGNED {
                out.push(AliasPair { explained, by, share, both_ways: shares[(by, explained)] >= ALIGNED });
            }
        }
    }
    out
}
