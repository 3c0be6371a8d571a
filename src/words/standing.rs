//! How results and candidates stand, in a word: the same on the page, in its plots and in their files.

use crate::view::record::{Judgement, Standing};

/// A result against its tolerance.
pub const fn judgement(judgement: Judgement) -> &'static str {
    match judgement {
        Judgement::Within => "within",
        Judgement::Beyond => "too large",
        Judgement::Open => "uncertain",
        Judgement::None => "no tolerance",
    }
}

/// A candidate.
pub const fn candidate(standing: Standing) -> &'static str {
    match standing {
        Standing::Proposed => "proposed",
        Standing::ProposedTogether => "proposed together with another",
        Standing::NoMoreThanNoise => "no more than noise",
        Standing::CannotBeJudged => "cannot be judged yet",
        Standing::CannotBeTried => "possible: these poses cannot decide",
        Standing::NotBorneOut => "explains part, but not in cross-validation",
        Standing::LessThanTheFirst => "explains part, less than the first",
    }
}
