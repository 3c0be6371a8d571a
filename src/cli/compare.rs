//! `axiscal compare`: model against measurement, where it fails.

use super::common::of_fit;
use super::{Answer, Io};
use crate::diag::Result;
use crate::workflow::load_study;
use crate::{files, report};
use std::path::PathBuf;

#[derive(Debug, clap::Args)]
pub struct Args {
    /// The study
    pub study: PathBuf,
    /// Every touch with its residual and what it may depend on, as CSV
    #[arg(long, value_name = "FILE")]
    pub csv: Option<PathBuf>,
    /// All groups and plots, not only those that explain something
    #[arg(long)]
    pub all: bool,
    /// Plots of plain ASCII signs (as in a pipe)
    #[arg(long)]
    pub ascii: bool,
}

/// # Errors
/// When the study or a file that it names is unusable, or the CSV cannot be written.
pub fn run(args: &Args, io: &Io) -> Result<Answer> {
    let loaded = load_study(&args.study, io)?;
    let fit = loaded.fit(&loaded.settings())?;
    let (comparison, found) = loaded.compare(&fit)?;
    if let Some(path) = &args.csv {
        files::write_whole(path, report::compare::csv(&comparison).as_bytes())?;
    }
    io.say(report::compare::comparison(&comparison, io.paper(args.ascii), args.all));
    for u in &fit.outcome.undetermined {
        io.say(format!("cannot be determined: {}", u.says));
    }
    if !comparison.explained_by_noise || !found.depends.is_empty() {
        io.say_as_it_is(format!("next: axiscal diagnose {}", crate::words::command::quoted_path(&args.study)));
    }
    io.answer(&comparison);
    Ok(of_fit(&fit.outcome, Answer::Done, io))
}
