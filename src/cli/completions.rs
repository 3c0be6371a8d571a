//! `axiscal completions SHELL` and `axiscal man`: what shells and `man` want to know of the verbs.

use super::{Answer, Cli, Io};
use crate::diag::Result;
use crate::files;
use clap::CommandFactory;
use serde_json::json;
use std::path::PathBuf;

#[derive(Debug, clap::Args)]
pub struct CompletionArgs {
    /// The shell
    #[arg(value_enum)]
    pub shell: clap_complete::Shell,
}

#[derive(Debug, clap::Args)]
pub struct ManArgs {
    /// Folder for the pages: one for the program, one for each verb
    #[arg(long, short, value_name = "DIR")]
    pub out: PathBuf,
}

/// Prints the script that a shell reads.
///
/// # Errors
/// Never: the script is made in memory.
pub fn completions(args: &CompletionArgs, io: &Io) -> Result<Answer> {
    let mut script = Vec::new();
    clap_complete::generate(args.shell, &mut Cli::command(), "axiscal", &mut script);
    let text = String::from_utf8_lossy(&script).into_owned();
    io.say_as_it_is(text.trim_end());
    io.answer(&json!({ "shell": args.shell.to_string(), "script": text }));
    Ok(Answer::Done)
}

/// Writes the manual pages.
///
/// # Errors
/// When the folder cannot be written.
pub fn man(args: &ManArgs, io: &Io) -> Result<Answer> {
    let mut program = Cli::command();
    // every verb gets what all verbs share: --json, --help, --version
    program.build();
    let mut pages = vec![("axiscal.1".to_owned(), page(program.clone())?)];
    for verb in program.get_subcommands().filter(|v| v.get_name() != "help" && !v.is_hide_set()) {
        pages.push((format!("axiscal-{}.1", verb.get_name()), page(verb.clone())?));
    }
    files::check_outputs(&pages.iter().map(|(name, _)| args.out.join(name)).collect::<Vec<_>>())?;
    for (name, bytes) in &pages {
        files::write_whole(&args.out.join(name), bytes)?;
    }
    io.say(format!("{} pages written to {}", pages.len(), args.out.display()));
    io.say_as_it_is(format!("read one: man -l {}", args.out.join("axiscal-diagnose.1").display()));
    let names: Vec<&String> = pages.iter().map(|p| &p.0).collect();
    io.answer(&json!({ "out": args.out.display().to_string(), "pages": names }));
    Ok(Answer::Done)
}

fn page(command: clap::Command) -> Result<Vec<u8>> {
    let mut bytes = Vec::new();
    // same inputs, same bytes: a page has no date
    clap_mangen::Man::new(command).date("").render(&mut bytes).map_err(|e| {
        crate::diag::Failure::new("man::page", format!("the page could not be made: {e}"))
            .help("report this: it is a fault of the program")
    })?;
    Ok(bytes)
}
