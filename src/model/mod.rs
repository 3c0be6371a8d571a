//! Machine + effects + parameters → the gap between ball and face at a touch, with derivatives.

pub mod as_written;
pub mod batch;
pub mod catalogue;
mod check;
pub mod data;
pub mod degrees_in_formula;
mod dual_number;
mod expression;
mod for_each_axis;
pub mod formula;
pub mod formula_errors;
mod formula_parser;
pub mod lever_arm;
mod operators;
pub mod predict;
pub mod reference_points;
mod rigid_motions;
pub mod sensitivities;
pub mod spindle;
pub mod surface;
pub mod temperatures;
