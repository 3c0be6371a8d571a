//! The loop: a study is opened, fitted, diagnosed and changed; then it is reported, exported, or measured further.
//!
//! Functions over records, with the [`Environment`] for files and remarks. `cli` reads arguments, calls them and prints; the
//! workbench and users of the library call the same.

pub mod active_compensation;
pub mod auto_program;
pub mod centres;
pub mod change;
mod environment;
pub mod examine;
pub mod export;
pub mod generate;
pub mod history;
pub mod join;
mod load;
pub mod new;
pub mod overlay;
pub mod own_part;
pub mod plan_next;
mod read_run;
pub mod simulated_log;
pub mod sketch;
pub mod verify;
pub mod view;

pub use environment::{Disk, Environment, InMemory};
pub use load::{
    Loaded, LoadedRun, load_controller, load_effects, load_machine, load_machines, load_study, machines_file,
};
pub use read_run::{LogFile, controller_path, load_plan, load_plan_and_machine};
