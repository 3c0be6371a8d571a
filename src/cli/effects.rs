//! `axiscal effects`

use super::{Answer, Io};
use crate::diag::{Failure, Result};

/// Arguments of `effects`.
#[derive(Debug, clap::Args)]
pub struct Args {}

/// Runs `effects`.
///
/// # Errors
/// When the input is unusable.
pub fn run(_args: &Args, _io: &Io) -> Result<Answer> {
    Err(Failure::new("cli::missing", "effects"))
}
