//! What counts of a plan where two are compared.

use super::linearised_plan::LinearisedPlan;
use super::score::is_location;
use crate::fit::solve::observe;
use crate::fit::uncertainty::expected;
use crate::search::power::{SEEN, power};

/// What a plan is worth.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Worth {
    /// Standard uncertainty of the worst-determined location error with the scatter of indexing, in its usual size; infinite where
    /// one cannot be determined.
    pub worst: f64,
    /// Effects of the catalogue that are found at their usual size.
    pub found: usize,
}

impl Worth {
    /// Of a plan with the whole catalogue beside its model.
    #[must_use]
    pub fn of(view: &LinearisedPlan) -> Self {
        let seen = observe(&view.jacobian);
        let sigma = expected(&view.jacobian, None, &seen);
        let location = view.free.iter().enumerate().filter(|(_, i)| is_location(&view.model.unknowns[**i].effect));
        let in_usual_sizes = location.map(|(column, &i)| {
            let determined = seen.unseen.iter().all(|direction| direction[column].abs() <= 1e-6);
            let share = sigma[column] / view.model.unknowns[i].typical;
            if determined && share.is_finite() { share } else { f64::INFINITY }
        });
        let worst = in_usual_sizes.fold(0.0, f64::max);
        let powers = power(view.base(), &view.library, &|c| view.raw_um[c].clone());
        Self { worst, found: powers.iter().filter(|p| p.at_typical >= SEEN).count() }
    }

    /// In nothing worse.
    #[must_use]
    pub fn is_as_good_as(&self, other: &Self) -> bool {
        self.worst <= other.worst && self.found >= other.found
    }
}
