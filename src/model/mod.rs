//! Machine + effects + parameters → the gap between ball and face at a touch, with derivatives.

pub mod as_written;
pub mod batch;
pub mod catalogue;
mod check;
pub mod data;
pub mod degrees;
mod dual;
mod expression;
mod for_each_axis;
pub mod formula;
pub mod mistake;
mod placed;
mod poses;
pub mod predict;
mod spelling;
pub mod stated;
mod temperatures;
pub mod traces;
mod words;
