//! A starting formula for what no known effect explains, written into an effects file of the user's own.

use super::{Environment, Loaded};
use crate::diag::{Result, source};
use crate::diagnose::sketch::{Sketch, sketch};
use crate::model::catalogue::Catalogue;
use std::path::Path;

/// Adds it to the file; other effects in it stay as they are.
///
/// # Errors
/// When the study or the file is unusable, nothing significant is left, or what is left has no formula.
pub fn sketch_into(loaded: &Loaded, file: &Path, env: &dyn Environment) -> Result<Sketch> {
    let settings = loaded.quick_settings();
    let fit = loaded.fit(&settings)?;
    // what was read of it must still be there when it is written
    let _alone = env.lock(file)?;
    let before = if env.exists(file) { env.text(file)? } else { String::new() };
    let name = file.display().to_string();
    // what stands in the file must be readable: its ids are taken, whether or not the study names the file
    let mut own = Catalogue::default();
    if !before.trim().is_empty() {
        own.add_file(&source(&name, before.clone()))?;
    }
    let made = sketch(loaded.subject(&settings, &fit), &|id| loaded.catalogue.knows(id) || own.knows(id))?;
    let gap = match before.trim_end() {
        "" => "",
        _ if before.ends_with('\n') => "\n",
        _ => "\n\n",
    };
    let text = format!("{before}{gap}{}", made.toml);
    Catalogue::built_in()?.add_file(&source(&name, text.clone()))?;
    env.write(file, Some(text.as_bytes()))?;
    Ok(made)
}
