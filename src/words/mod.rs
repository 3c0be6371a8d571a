//! Sentences: each fact of a room becomes one in exactly one place, for the terminal, the report, the page and the workbench.

pub(crate) mod command;
pub(crate) mod diagnose;
pub(crate) mod diagnosis_remarks;
pub(crate) mod fit;
pub(crate) mod generate;
pub(crate) mod headline;
pub(crate) mod log;
pub(crate) mod next_calls;
pub(crate) mod next_steps;
mod not_explained;
mod oversized;
pub(crate) mod standing;
pub(crate) mod why;
