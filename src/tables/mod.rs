//! Identified errors → controller-neutral corrections → the controller's own tables.
//!
//! [`correction`] holds what is known of the machine, whoever controls it: which parameter stands at which place of the
//! chain, what was active while it was measured, what was left out and why. [`kins`] maps axis positions of the errorless
//! machine to those of the real one. [`rows`] places the rows of
//! tables and says what the straight lines between them leave. A module per controller ([`linuxcnc`]) turns a correction into files.
//!
//! Nothing here reads or writes a file or knows how the values were found.

pub mod compensation;
pub mod control;
pub mod correction;
pub mod kins;
pub mod lines;
pub mod linuxcnc;
pub mod place;
pub mod restate;
pub mod rows;

pub use compensation::Compensation;
pub use correction::Correction;
