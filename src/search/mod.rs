//! Which effect is missing: linear algebra and statistics on whitened matrices, and nothing about machines.
//!
//! A [`Question`] is one linearised regression, a [`Library`] the candidates with their columns. [`Search`] tests all
//! of them at once, [`groups`] says which of them these data cannot tell apart, [`held_out`] redoes the choice without
//! the touches that judge it, [`distinguishability`] is the criterion by which two effects are separated, [`power`] says before any
//! measurement what a plan can see, `scatter` estimates the scatter of groups of rows under each hypothesis, and [`pattern_tests`] and [`dependence`] say on what the misfit depends where no candidate explains it.

pub mod basis;
pub mod dependence;
pub mod distinguishability;
pub mod distributions;
pub mod groups;
pub mod held_out;
pub mod library;
mod moments;
pub mod multiplicity;
mod pairs;
pub mod pattern_tests;
pub mod power;
mod scatter;
pub mod score;
#[cfg(test)]
mod shape_tests;
mod shapes;
#[cfg(test)]
pub(crate) mod testing;
#[cfg(test)]
mod tests;

pub use basis::Basis;
pub use library::{Candidate, Library, Origin, Variant, side_by_side, without_rounding};
pub use moments::{Change, KEPT};
pub use pairs::Pair;
pub use scatter::{Scatter, Supposed, scatter_that_fits};
pub use score::{LackOfFit, PureError, Question, Score, Search, best_variant, lack_of_fit};
