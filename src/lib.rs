//! axiscal: a five-axis machine tool measures its errors with its own touch probe, finds their cause, and compensates them.
//!
//! One direction of flow: machine → program → log → model → fit → diagnosis → tables. The map of the rooms and the
//! invariants are in `ARCHITECTURE.md`; frames and signs in `docs/conventions.md`.

// tests may unwrap: a panic there is a failure with its place
#![cfg_attr(test, allow(clippy::unwrap_used, clippy::expect_used, clippy::panic))]

pub mod prelude;

// the rooms are for the program, its tests, benchmarks and fuzz targets: their names change without notice
#[doc(hidden)]
pub mod axes;
#[doc(hidden)]
pub mod check;
#[doc(hidden)]
pub mod cli;
#[doc(hidden)]
pub mod compare;
#[doc(hidden)]
pub mod design;
#[doc(hidden)]
pub mod diag;
#[doc(hidden)]
pub mod diagnose;
#[doc(hidden)]
pub mod files;
#[doc(hidden)]
pub mod fit;
#[doc(hidden)]
pub mod geometry;
#[doc(hidden)]
pub mod keys;
#[doc(hidden)]
pub mod log;
#[doc(hidden)]
pub mod machine;
#[doc(hidden)]
pub mod model;
#[doc(hidden)]
pub mod page;
#[doc(hidden)]
pub mod paper;
#[doc(hidden)]
pub mod plots;
#[doc(hidden)]
pub mod post;
#[doc(hidden)]
pub mod probability;
#[doc(hidden)]
pub mod program;
#[doc(hidden)]
pub mod report;
#[doc(hidden)]
pub mod search;
#[doc(hidden)]
pub mod simulate;
#[doc(hidden)]
pub mod study;
#[doc(hidden)]
pub mod symbols;
#[doc(hidden)]
pub mod tables;
#[doc(hidden)]
pub mod units;
#[doc(hidden)]
pub mod view;
mod words;
#[doc(hidden)]
pub mod workbench;
#[doc(hidden)]
pub mod workflow;
