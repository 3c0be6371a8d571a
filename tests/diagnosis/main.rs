//! Missing effects, plans, and the loop of commands that finds and adds them.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)] // a panic in a test is a failure with its place

mod assess;
#[path = "../common/mod.rs"]
mod common;
mod diagnose;
mod diagnose_verbs;
mod discovery;
mod discovery_bench;
mod full;
#[path = "../discovery/mod.rs"]
mod generator;
mod hidden_faults;
mod loop_verbs;
mod next_steps;
mod plan_next;
mod plan_sweep;
mod solve;
mod sphere;
mod story;
mod telescope;
mod two_effects;
