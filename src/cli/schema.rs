//! `axiscal schema WHAT`: the JSON schema of a file, for editors.

use super::{Answer, Io};
use crate::diag::Result;

#[derive(Debug, clap::Args)]
pub struct Args {
    /// Which file
    #[arg(value_enum)]
    pub what: SchemaOf,
}

/// Files that have a schema.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub enum SchemaOf {
    /// machines.toml
    Machines,
    /// A program of your own
    Programs,
    /// An artefact of your own
    Artefacts,
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
        SchemaOf::Machines => schemars::schema_for!(crate::machine::as_written::File),
        SchemaOf::Programs => crate::program::schema(),
        SchemaOf::Artefacts => crate::machine::artefact::schema(),
        SchemaOf::Postprocessors => schemars::schema_for!(crate::post::as_written::File),
        SchemaOf::Study => schemars::schema_for!(crate::study::AsWritten),
        SchemaOf::Effects => schemars::schema_for!(crate::model::as_written::File),
    };
    // a schema is JSON with and without --json
    let text = serde_json::to_string_pretty(&schema).unwrap_or_default();
    super::common::print(&text);
    Ok(Answer::Done)
}
