//! What goes to a control and comes from it: programs, logs and tables.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)] // a panic in a test is a failure with its place

mod any_machine;
mod artefacts;
mod beside_the_axis;
mod by_eye;
mod centres;
mod check;
mod check_branches;
mod check_klartext;
mod check_programs;
mod check_readers;
mod check_settings;
mod check_sinumerik;
mod check_transformation;
mod check_verb;
mod closed_loop;
#[path = "../common/mod.rs"]
mod common;
mod compensated;
mod controller_variants;
mod controllers;
mod edits;
mod export_linuxcnc;
mod export_old_values;
mod export_verb;
mod facts;
mod foreign;
mod generate;
mod harmless;
mod logs;
mod logs_closed_loop;
mod msr;
mod parse_verb;
mod simulate_verb;
mod tables;
