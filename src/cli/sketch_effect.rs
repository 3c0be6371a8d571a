//! `axiscal sketch-effect`: a starting formula for what no known effect explains.

use super::{Answer, Io};
use crate::diag::Result;
use crate::workflow::load_study;
use crate::workflow::new::relative;
use crate::workflow::sketch::sketch_into;
use serde_json::json;
use std::path::PathBuf;

#[derive(Debug, clap::Args)]
pub struct Args {
    /// The study
    pub study: PathBuf,
    /// The effects file to which the effect is added; other effects in it stay as they are
    #[arg(long, value_name = "FILE")]
    pub out: PathBuf,
}

/// # Errors
/// When the study or the effects file is unusable. Where nothing is left over that a formula could say the answer is "no".
pub fn run(args: &Args, io: &Io) -> Result<Answer> {
    let loaded = load_study(&args.study, io)?;
    let name = args.out.display().to_string();
    let made = match sketch_into(&loaded, &args.out, io) {
        Ok(made) => made,
        // the study is usable: the answer is "no"
        Err(failure) if failure.0.iter().all(|f| ["sketch::nothing_left", "sketch::no_formula"].contains(&f.code)) => {
            io.say(failure.to_string());
            failure.0.iter().filter_map(|f| f.help.as_ref()).for_each(|help| io.say(format!("  {help}")));
            io.answer(&json!({ "effect": null, "says": failure.to_string() }));
            return Ok(Answer::No);
        }
        Err(failure) => return Err(failure),
    };
    io.say(format!(
        "{}\n{} = {}\nwritten to {name}: its name is for you to change (and its id: then `add` takes the new one)",
        made.says, made.id, made.formula
    ));
    io.say(format!(
        "put effects_file = [\"{}\"] into the study, above the first [[data]], then: axiscal add {} {}",
        relative(&args.out, loaded.folder()),
        crate::words::command::quoted_path(&args.study),
        made.id
    ));
    for (i, t) in made.tried.iter().take(6).enumerate() {
        let which = match i {
            0 => ": this one is written",
            _ if t.as_good_as(&made.tried[0]) => ": these touches cannot separate it from the first",
            _ => "",
        };
        io.say(format!("  at {} ({}) it would leave {:.2} um{which}", t.at, t.dofs().join(", "), t.left_um));
    }
    io.answer(
        &json!({ "effect": made.id, "places": made.tried, "says": made.says, "formula": made.formula, "file": name, "toml": made.toml }),
    );
    Ok(Answer::Done)
}
