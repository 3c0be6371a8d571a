//! `axiscal programs`

use super::{Answer, Io};
use crate::diag::{Failure, Result};

/// Arguments of `programs`.
#[derive(Debug, clap::Args)]
pub struct Args {}

/// Runs `programs`.
///
/// # Errors
/// When the input is unusable.
pub fn run(_args: &Args, _io: &Io) -> Result<Answer> {
    Err(Failure::new("cli::missing", "programs"))
}
