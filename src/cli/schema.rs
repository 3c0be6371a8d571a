//! `axiscal schema WHAT`: the JSON schema of a file, for editors.

use super::{Answer, Io};
use crate::diag::Result;

#[derive(Debug, clap::Args)]
pub struct Args {
    /// Which file
    #[arg(value_enum)]
    pub what: What,
}

/// Files that have a schema.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub enum What {
    /// machines.toml
    Machines,
    /// A program of your own
    Programs,
    /// A postprocessor
    Postprocessors,
    /// study.toml
    Study,
    /// Effects of your own
    Effects,
}

/// # Errors
/// Never: the schemas are built in.
pub fn run(args: &Args, _io: &Io) -> Result<Answer> {
    let schema = match args.what {
        What::Machines => schemars::schema_for!(crate::machine::as_written::File),
        What::Programs => crate::program::schema(),
        What::Postprocessors => schemars::schema_for!(crate::post::as_written::File),
        What::Study => schemars::schema_for!(crate::study::AsWritten),
        What::Effects => schemars::schema_for!(crate::model::as_written::File),
    };
    // a schema is JSON with and without --json
    let text = serde_json::to_string_pretty(&schema).unwrap_or_default();
    super::common::print(&text);
    Ok(Answer::Done)
}
