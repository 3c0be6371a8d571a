//! `axiscal verify`: two studies side by side: did the compensation work, has the machine changed?

use super::common::of_fit;
use super::{Answer, Io};
use crate::compare::verify::Verdict;
use crate::diag::Result;
use crate::report;
use crate::workflow::load_study;
use crate::workflow::verify::{Verified, verify};
use std::path::PathBuf;

#[derive(Debug, clap::Args)]
pub struct Args {
    /// The study of the runs before
    pub before: PathBuf,
    /// The study of the runs after
    pub after: PathBuf,
}

/// # Errors
/// When a study is unusable, they are of two machines or of the same logs, or the runs after cannot show what is asked.
pub fn run(args: &Args, io: &Io) -> Result<Answer> {
    let (before, after) = (load_study(&args.before, io)?, load_study(&args.after, io)?);
    let Verified { answer, before: first, after: second } = verify(&before, &after, io)?;
    io.say(report::ladder::verification(&answer, io.paper(false)));
    for (lacks, effects) in [(&after, &answer.only_before), (&before, &answer.only_after)] {
        if !effects.is_empty() {
            let study = crate::words::command::quoted_path(&lacks.path);
            io.say_as_it_is(format!("next: axiscal add {study} {}", effects.join(" ")));
        }
    }
    io.answer(&answer);
    let no = matches!(answer.verdict, Verdict::NotImproved | Verdict::ModelsDiffer);
    let answer = of_fit(&first, if no { Answer::No } else { Answer::Done }, io);
    Ok(of_fit(&second, answer, io))
}
