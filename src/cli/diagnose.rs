//! `axiscal diagnose`: which physical effect is missing.

use super::load::load_study;
use super::{Answer, Io};
use crate::diag::Result;
use crate::diagnose::{Options, Subject, Verdict, diagnose};
use crate::fit;
use std::path::PathBuf;

/// Arguments of `diagnose`.
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
}

/// Runs `diagnose`. The answer is "no" when the model does not fit.
///
/// # Errors
/// When the study or a file that it names is unusable.
pub fn run(args: &Args, io: &Io) -> Result<Answer> {
    let loaded = load_study(&args.study, io)?;
    let mut settings = loaded.settings();
    settings.quick = true;
    let fit = fit::identify(&loaded.machine, &loaded.catalogue, &loaded.runs(), &settings)?;
    let subject = Subject { machine: &loaded.machine, catalogue: &loaded.catalogue, settings: &settings, fit: &fit };
    let planned = loaded.planned();
    let options = Options { at_most: args.at_most.max(1), planned: Some(&planned), ..Options::default() };
    let found = diagnose(subject, &options)?;
    io.say(crate::report::diagnosis::diagnosis(&found, io.paper(args.ascii)).trim_end());
    // scatter and bad touches that lie together are put right at the machine, not by a formula
    let at_the_machine = |id: &str| id.starts_with("scatter:") || id.starts_with("not-used:");
    let sketched = found.depends.first().is_some_and(|w| !at_the_machine(&w.id));
    if found.mistake().is_some() {
        io.say("next: put that right and measure again; smaller errors can be spoken of afterwards");
    } else if matches!(found.verdict, Verdict::MissingEffect) && !io.json {
        if let Some(first) = found.candidates.first().filter(|c| c.proposed) {
            if first.same_as.is_empty() {
                io.say_as_it_is(format!("next: axiscal add {} {}", args.study.display(), first.effect));
            } else {
                // which of them it is, is for touches or a person to say
                let ids: Vec<&str> = std::iter::once(&first.effect).chain(&first.same_as).map(String::as_str).collect();
                io.say_as_it_is(format!(
                    "next: axiscal plan-next {} --out next --controller NAME",
                    args.study.display()
                ));
                io.say_as_it_is(format!(
                    "  or, when you know which it is: axiscal add {} EFFECT, with one of {}",
                    args.study.display(),
                    ids.join(", ")
                ));
            }
        }
    } else if found.faint {
        io.say_as_it_is(format!("next: axiscal plan-next {} --out next --controller NAME", args.study.display()));
        if sketched {
            io.say_as_it_is(format!("  or: axiscal sketch-effect {} --out my-effects.toml", args.study.display()));
        }
    } else if matches!(found.verdict, Verdict::Unexplained) && sketched {
        io.say_as_it_is(format!("next: axiscal sketch-effect {} --out my-effects.toml", args.study.display()));
    }
    io.answer(&found);
    let no = matches!(found.verdict, Verdict::MissingEffect | Verdict::Unexplained) || found.most_missed;
    Ok(if no { Answer::No } else { Answer::Done })
}
