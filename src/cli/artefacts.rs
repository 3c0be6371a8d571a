//! `axiscal artefacts`: what is built in, and one of them as a file to start from.

use super::{Answer, Io};
use crate::diag::{Failure, Result, source};
use crate::machine::artefact::{BUILT_IN, File};
use serde_json::json;

#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(subcommand)]
    what: Option<ArtefactsCommand>,
}

#[derive(Debug, clap::Subcommand)]
enum ArtefactsCommand {
    /// Print one: the file, to save, change and use with `--artefact FILE.toml`
    Show {
        /// Its name
        name: String,
    },
}

/// # Errors
/// When there is none of that name.
pub fn run(args: &Args, io: &Io) -> Result<Answer> {
    match &args.what {
        None => {
            let mut table = crate::report::fit::table(&["artefact", "what it is"]);
            let says = |text: &str| toml::from_str::<File>(text).map(|f| f.says).unwrap_or_default();
            for (name, text) in BUILT_IN {
                table.add_row([name.to_owned(), says(text)]);
            }
            io.say(table.to_string());
            io.say(
                "`axiscal artefacts show NAME > mine.toml` gives a file to change; use it with --artefact mine.toml",
            );
            io.answer(&json!({ "artefacts": BUILT_IN.iter().map(|(n, t)| json!({ "name": n, "says": says(t) })).collect::<Vec<_>>() }));
        }
        Some(ArtefactsCommand::Show { name }) => {
            let text = built_in(name)?;
            io.say(text.inner().trim_end());
            io.answer(&json!({ "name": name, "text": text.inner() }));
        }
    }
    Ok(Answer::Done)
}

/// A built-in artefact.
///
/// # Errors
/// When there is none of that name.
pub(super) fn built_in(name: &str) -> Result<crate::diag::Source> {
    match BUILT_IN.iter().find(|(n, _)| *n == name) {
        Some((name, text)) => Ok(source(format!("{name}.toml (built in)"), *text)),
        None => {
            let names: Vec<&str> = BUILT_IN.iter().map(|(n, _)| *n).collect();
            Err(Failure::new("artefact::unknown", format!("no artefact is called {name:?}"))
                .help(format!("there are: {}; a file of your own ends in .toml", names.join(", "))))
        }
    }
}
