//! `axiscal plan-next`: the probing program that best separates what the data of a study cannot tell apart.

mod join;
mod write_centres;
mod write_program;

use super::{Answer, Io};
use crate::diag::{Failure, Result};
use crate::workflow::plan_next::{Advice, Next, NoProgram, Request, plan_next};
use crate::workflow::{load_controller, load_study};
use join::{join, plan_of};
use serde_json::json;
use std::path::PathBuf;
use write_centres::write_centres;
use write_program::write;

#[derive(Debug, clap::Args)]
pub struct Args {
    /// The study
    pub study: PathBuf,
    /// Folder for the program and its plan
    #[arg(long, short, value_name = "DIR")]
    pub out: PathBuf,
    /// Name of the controller, or a postprocessor file; a study of sphere centres needs none
    #[arg(long, short)]
    pub controller: Option<String>,
    /// How long the program may take, minutes (without mounting other blocks)
    #[arg(long, default_value_t = 10.0)]
    pub minutes: f64,
    /// The effects to separate (default: those that the data leave open)
    #[arg(long, value_delimiter = ',')]
    pub effects: Vec<String>,
    /// The blocks were mounted again since the last run, or will be: their positions are unknown again
    #[arg(long)]
    pub moved: bool,
    /// Add this log of the program to the study as its next run, instead of writing a program
    #[arg(long, value_name = "LOG")]
    pub join: Option<PathBuf>,
}

/// # Errors
/// When the study is unusable, an effect is unknown, or nothing can be reached.
pub fn run(args: &Args, io: &Io) -> Result<Answer> {
    // a run that is joined changes the study: nobody else does so until it is written
    let _alone = if args.join.is_some() { Some(crate::files::lock(&args.study)?) } else { None };
    let loaded = load_study(&args.study, io)?;
    let name = format!("next-{}", loaded.study.data.len() + 1);
    let plan_file = args.out.join(format!("{name}.plan.json"));
    if let Some(log) = &args.join {
        return join(args, &loaded, &plan_of(log, &args.out).unwrap_or(plan_file), log, io);
    }
    // a wrong name is said before the search, not after it
    let post = args.controller.as_ref().map(|word| load_controller(word, io)).transpose()?;
    let request = Request { minutes: args.minutes, effects: &args.effects, moved: args.moved, name: &name };
    match plan_next(&loaded, &request, io)? {
        Next::NothingConfounded => {
            io.say("the touches of this study separate all effects: no further program is needed");
            io.answer(&json!({ "format": "axiscal-next/1", "pairs": [], "says": "nothing is confounded" }));
            Ok(Answer::Done)
        }
        Next::NoProgram(NoProgram { says, advice }) => {
            io.say(&says);
            match advice {
                Advice::Says(lines) => lines.iter().for_each(|line| io.say(format!("  {line}"))),
                Advice::Sketch => {
                    io.say(format!(
                        "  {} writes what is seen as a formula",
                        crate::words::next_calls::sketch_effect(&loaded)
                    ));
                    io.say("  nothing is written");
                }
            }
            io.answer(&json!({ "format": "axiscal-next/1", "pairs": [], "says": says }));
            Ok(Answer::No)
        }
        Next::Program(program) => {
            let post = post.ok_or_else(no_controller)?;
            write(args, &loaded, &post, &plan_file, &program, io)
        }
        Next::Centres { questions, poses } => write_centres(args, &name, &questions, &poses, io),
    }
}

fn no_controller() -> Failure {
    Failure::new("next::controller", "a program needs a controller").help("name it with --controller")
}
