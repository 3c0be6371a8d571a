//! `axiscal simulate`

use super::{Answer, Io};
use crate::diag::{Failure, Result};

/// Arguments of `simulate`.
#[derive(Debug, clap::Args)]
pub struct Args {}

/// Runs `simulate`.
///
/// # Errors
/// When the input is unusable.
pub fn run(_args: &Args, _io: &Io) -> Result<Answer> {
    Err(Failure::new("cli::missing", "simulate"))
}
