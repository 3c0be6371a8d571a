//! The loop: a study is opened, fitted, diagnosed and changed; then it is reported, exported, or measured further.
//!
//! Functions over records, with a trait for the [`Files`] of a study. `cli` reads arguments, calls them and prints; the
//! workbench and users of the library call the same. What is to be noticed on the way is pushed to `remarks`.

pub mod active_compensation;
pub mod change;
pub mod examine;
pub mod export;
mod files;
pub mod generate;
pub mod history;
pub mod join;
mod load;
pub mod new;
pub mod plan_next;
mod read_run;
pub mod simulated_log;
pub mod sketch;
pub mod verify;
pub mod view;

pub use files::{Disk, Files, InMemory};
pub use load::{Loaded, LoadedRun, load_effects, load_machine, load_machines, load_study};
pub use read_run::{LogFile, controller_path, load_plan, load_plan_and_machine};
