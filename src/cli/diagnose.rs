//! `axiscal diagnose`: which physical effect is missing.

use super::common::of_fit;
use super::{Answer, Io};
use crate::diag::Result;
use crate::diagnose::Options;
use crate::workflow::load_study;
use std::path::PathBuf;

#[derive(Debug, clap::Args)]
pub struct Args {
    /// The study
    pub study: PathBuf,
    /// Most candidates that are listed
    #[arg(long, value_name = "N", default_value_t = Options::default().at_most)]
    pub at_most: usize,
    /// Plots of plain ASCII signs (as in a pipe)
    #[arg(long)]
    pub ascii: bool,
    /// All remarks, all sizes, and the curve of the residual
    #[arg(long, short)]
    pub verbose: bool,
}

/// Runs `diagnose`. The answer is "no" when the model does not fit.
///
/// # Errors
/// When the study or a file that it names is unusable.
pub fn run(args: &Args, io: &Io) -> Result<Answer> {
    let loaded = load_study(&args.study, io)?;
    let settings = loaded.quick_settings();
    let fit = loaded.fit(&settings)?;
    let found = loaded.diagnose(&settings, &fit, &Options { at_most: args.at_most.max(1), ..Options::default() })?;
    io.say(crate::report::diagnosis::diagnosis(&found, io.paper(args.ascii), args.verbose).trim_end());
    crate::words::next_calls::lines(&found, &loaded).iter().for_each(|line| io.say_as_it_is(line));
    io.answer(&found);
    Ok(of_fit(&fit.outcome, if found.verdict.is_no() { Answer::No } else { Answer::Done }, io))
}
