//! The physics, the fit and what it states: values by hand, planted errors, uncertainties.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)] // a panic in a test is a failure with its place

mod combinations;
#[path = "../common/mod.rs"]
mod common;
mod coverage;
#[path = "../common/coverage.rs"]
mod coverage_cases;
mod csv_times;
mod derivatives;
mod doubt;
mod formula_bounds;
mod kinematics;
mod not_converged;
mod outliers;
mod own_effects;
mod own_line;
mod paper;
mod planted;
mod recover;
mod shapes;
mod sides;
mod spindle;
mod told_honestly;
mod what_is_said;
