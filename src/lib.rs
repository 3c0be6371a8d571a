//! axiscal: a five-axis machine measures itself with its own touch probe, learns what is wrong with it, and is put right.
//!
//! One direction of flow: machine → program → log → model → fit → diagnosis → tables. The map of the rooms and the
//! invariants are in `ARCHITECTURE.md`; frames and signs in `docs/conventions.md`.

// tests may unwrap: a panic there is a failure with its place
#![cfg_attr(test, allow(clippy::unwrap_used, clippy::expect_used, clippy::panic))]

pub mod axes;
pub mod diag;
pub mod files;
pub mod geometry;
pub mod keys;
pub mod probability;
pub mod symbols;
pub mod units;

pub mod check;
pub mod cli;
pub mod compare;
pub mod design;
pub mod diagnose;
pub mod fit;
pub mod log;
pub mod machine;
pub mod model;
pub mod page;
pub mod paper;
pub mod plots;
pub mod post;
pub mod program;
pub mod report;
pub mod search;
pub mod simulate;
pub mod study;
pub mod tables;
pub mod view;
mod words;
pub mod workbench;
