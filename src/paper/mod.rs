//! The paper's method as it was printed and corrected: closed forms, its three tables, its statements of rank.
//!
//! Source: "The error's measurement and identification of five-axes CNC MACHINE based on touch-trigger probe"; relations
//! (3-1)…(3-9), (4-3)…(4-9) with their misprints corrected (docs/method.md).

pub mod closed_form;
pub mod ranks;
pub mod tables;
