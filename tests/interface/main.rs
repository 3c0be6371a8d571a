//! What a user meets besides: files, bad input, report, workbench, terminal.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)] // a panic in a test is a failure with its place

mod bad_input;
#[path = "../common/mod.rs"]
mod common;
mod dependencies;
mod files;
mod library;
mod many_findings;
mod report;
mod rooms;
mod screens;
mod shell;
mod start_page;
mod terminal;
mod torture;
mod workbench;
mod workbench_requests;
