//! Sentences: each fact of a room becomes one in exactly one place, for the terminal, the report, the page and the workbench.

pub(crate) mod diagnose;
pub(crate) mod fit;
pub(crate) mod generate;
pub(crate) mod log;
