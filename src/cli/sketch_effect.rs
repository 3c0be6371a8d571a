//! `axiscal sketch-effect`: a starting formula for what no known effect explains.

use super::load::load_study;
use super::new::relative;
use super::{Answer, Io};
use crate::diag::{Result, source};
use crate::diagnose::{Subject, sketch::sketch};
use crate::files;
use crate::model::catalogue::Catalogue;
use serde_json::json;
use std::path::{Path, PathBuf};

/// Arguments of `sketch-effect`.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The study
    pub study: PathBuf,
    /// The effects file to which the effect is added; other effects in it stay as they are
    #[arg(long, value_name = "FILE")]
    pub out: PathBuf,
}

/// Runs `sketch-effect`.
///
/// # Errors
/// When the study or the effects file is unusable. Where nothing is left over that a formula could say the answer is "no".
pub fn run(args: &Args, io: &Io) -> Result<Answer> {
    let loaded = load_study(&args.study, io)?;
    let mut settings = loaded.settings();
    settings.quick = true;
    let fit = loaded.fit(&settings)?;
    let name = args.out.display().to_string();
    // what was read of it must still be there when it is written
    let _alone = files::lock(&args.out)?;
    let before = if args.out.exists() { files::read_text(&args.out)? } else { String::new() };
    // what stands in the file must be readable: its ids are taken, whether or not the study names the file
    let mut own = Catalogue::default();
    if !before.trim().is_empty() {
        own.add_file(&source(&name, before.clone()))?;
    }
    let taken = |id: &str| loaded.catalogue.knows(id) || own.knows(id);
    let subject = Subject { machine: &loaded.machine, catalogue: &loaded.catalogue, settings: &settings, fit: &fit };
    let made = match sketch(subject, &taken) {
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
    let gap = match before.trim_end() {
        "" => "",
        _ if before.ends_with('\n') => "\n",
        _ => "\n\n",
    };
    let text = format!("{before}{gap}{}", made.toml);
    Catalogue::built_in()?.add_file(&source(&name, text.clone()))?;
    files::rewrite(&args.out, text.as_bytes())?;
    io.say(format!(
        "{}\n{} = {}\nwritten to {name}: its name is for you to change (and its id: then `add` takes the new one)",
        made.says, made.id, made.formula
    ));
    // the study's paths are relative to the study
    let folder = args.study.parent().map(Path::to_path_buf).unwrap_or_default();
    io.say(format!(
        "put effects_file = [\"{}\"] into the study, above the first [[data]], then: axiscal add {} {}",
        relative(&args.out, &folder),
        args.study.display(),
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
