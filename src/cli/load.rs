//! Studies, plans and machines for the verbs: read from the disk, what is noticed said at once.

use super::Io;
use crate::diag::Result;
use crate::files;
use crate::machine::Machine;
use crate::program::plan::Plan;
use crate::workflow::{self, Disk, Loaded, history};
use std::path::{Path, PathBuf};

/// A study with everything that it names.
///
/// # Errors
/// As [`workflow::load_study`].
pub fn load_study(path: &Path, io: &Io) -> Result<Loaded> {
    // no output of the verb may take its place
    files::protect(&history::history_path(path));
    io.remarked(|remarks| workflow::load_study(path, &Disk, remarks))
}

/// The plan of a machine.
///
/// # Errors
/// As [`workflow::load_plan`].
pub fn load_plan(path: &Path, machine: &Machine, io: &Io) -> Result<Plan> {
    io.remarked(|remarks| workflow::load_plan(path, machine, &Disk, remarks))
}

/// The machines of a file, or the built-in ones.
///
/// # Errors
/// As [`workflow::load_machines`].
pub fn load_machines(path: Option<&Path>, io: &Io) -> Result<Vec<Machine>> {
    io.remarked(|remarks| workflow::load_machines(path, &Disk, remarks))
}

/// One machine by name.
///
/// # Errors
/// As [`workflow::load_machine`].
pub fn load_machine(name: &str, path: Option<&Path>, io: &Io) -> Result<Machine> {
    io.remarked(|remarks| workflow::load_machine(name, path, &Disk, remarks))
}

/// `--machines FILE`, shared by every verb that names a machine.
#[derive(Debug, Clone, clap::Args)]
pub struct MachineArgs {
    /// Name of the machine (`axiscal machines` lists them)
    #[arg(long, short)]
    pub machine: String,
    /// A machines.toml of your own (default: the one built in)
    #[arg(long, value_name = "FILE")]
    pub machines: Option<PathBuf>,
}

impl MachineArgs {
    /// The machine that is meant.
    ///
    /// # Errors
    /// When the file is unusable or has no machine of that name.
    pub fn load(&self, io: &Io) -> Result<Machine> {
        load_machine(&self.machine, self.machines.as_deref(), io)
    }
}
