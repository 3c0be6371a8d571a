//! `axiscal controllers`: what is built in, and one of them as a file to start from.

use super::{Answer, Io};
use crate::diag::Result;
use crate::log::Reader;
use crate::log::points::PointsForm;
use crate::post::Postprocessor;
use crate::workflow::load_controller;

#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(subcommand)]
    what: Option<ControllersCommand>,
}

#[derive(Debug, clap::Subcommand)]
enum ControllersCommand {
    /// Print one: the file, to save, change and use with `--controller FILE.toml`
    Show {
        /// Its name, or a file of your own to check
        name: String,
    },
}

/// # Errors
/// When there is none of that name, or the user's own file is unusable.
pub fn run(args: &Args, io: &Io) -> Result<Answer> {
    match &args.what {
        None => {
            let all = Postprocessor::built_in()?;
            let mut table = crate::report::fit::table(&["controller", "what it is"]);
            for post in &all {
                table.add_row([&post.name, &post.says]);
            }
            io.say(table.to_string());
            let forms = PointsForm::built_in()?;
            let mut table = crate::report::fit::table(&["log form", "what it is"]);
            for form in &forms {
                table.add_row([&form.name, &form.says]);
            }
            io.say(table.to_string());
            io.say("`axiscal controllers show NAME > mine.toml` gives a file to change; use it with --controller mine.toml");
            io.answer(&serde_json::json!({
                "format": "axiscal-controllers/1",
                "controllers": all.iter().map(facts).collect::<Vec<_>>(),
                "log_forms": forms.iter().map(form_facts).collect::<Vec<_>>(),
            }));
        }
        Some(ControllersCommand::Show { name }) => {
            // `csv` is no file
            let shown = match Reader::load(name, crate::files::read_text) {
                Ok((Reader::Points(form), findings)) => Some((form, findings)),
                _ => None,
            };
            if let Some((form, findings)) = shown {
                io.report(&findings);
                io.say(form.text.trim_end());
                io.answer(&form_facts(&form));
                return Ok(Answer::Done);
            }
            let post = load_controller(name, io)?;
            io.say(post.text.trim_end());
            io.answer(&facts(&post));
        }
    }
    Ok(Answer::Done)
}

fn form_facts(form: &PointsForm) -> serde_json::Value {
    serde_json::json!({ "name": form.name, "says": form.says, "source": form.source, "unverified": form.unverified })
}

fn facts(post: &Postprocessor) -> serde_json::Value {
    let unverified: Vec<_> =
        post.unverified.iter().map(|(entry, why)| serde_json::json!({ "entry": entry, "why": why })).collect();
    serde_json::json!({
        "name": post.name,
        "says": post.says,
        "extension": post.extension,
        "based_on": post.based_on,
        "beside": post.companions,
        "tcp": post.tcp.is_some(),
        "log_decimals": post.log.decimals,
        "unverified": unverified,
    })
}
