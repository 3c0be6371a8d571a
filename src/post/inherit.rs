//! A postprocessor file that says only what is different: `based_on = "fanuc"`, and the lines that it changes.
//!
//! The file is completed from its base, table by table, and read like any other. A table that says where it comes from
//! loses that when one of its lines is changed: what a manual says of the base is no word on the change.

use super::{BUILT_IN, Postprocessor, check};
use crate::diag::{Failure, Findings, Result, Source, from_toml, source};
use std::path::Path;
use toml::{Table, Value};

/// How many files may stand on one another.
const DEPTH: usize = 8;

/// Whether a word means a file rather than a name.
pub(super) fn is_file(word: &str) -> bool {
    word.ends_with(".toml") || word.contains(['/', '\\'])
}

/// Reads and checks a postprocessor file that is complete, or based on a built-in one.
///
/// # Errors
/// When the text is not TOML of this form, or a template does not compile; every finding has its place and remedy.
pub fn parse_alone(source: &Source) -> Result<(Postprocessor, Findings)> {
    let none = |path: &Path| {
        let message = format!("{} is not read here", path.display());
        Err(Failure::new("post::base", message).help("base it on a controller that is built in"))
    };
    parse(source, &none)
}

/// Reads and checks a postprocessor file, which may be based on another one; `read` fetches the text of a file.
///
/// # Errors
/// As [`parse_alone`], and when the base is not found or unusable.
pub(super) fn parse(source: &Source, read: &dyn Fn(&Path) -> Result<String>) -> Result<(Postprocessor, Findings)> {
    let Some(whole) = completed(source, read, 0)? else { return check::parse(source) };
    let (post, findings) = check::parse(&whole)?;
    Ok((Postprocessor { text: source.inner().clone(), ..post }, findings))
}

/// The file with everything that it takes from its base; `None` when it has none.
fn completed(text: &Source, read: &dyn Fn(&Path) -> Result<String>, depth: usize) -> Result<Option<Source>> {
    // what is no TOML is reported with its place by the one who reads it
    let Ok(own) = toml::from_str::<Table>(text.inner()) else { return Ok(None) };
    let Some(Value::String(word)) = own.get("based_on").cloned() else { return Ok(None) };
    if depth >= DEPTH {
        return Err(Failure::new("post::base", format!("{}: {DEPTH} files stand on one another", text.name()))
            .help("is a file based on itself?"));
    }
    let base = if is_file(&word) {
        let beside = Path::new(text.name()).parent().unwrap_or(Path::new("")).join(&word);
        source(beside.display().to_string(), read(&beside)?)
    } else {
        let found = BUILT_IN.iter().find(|(file, _)| file.strip_suffix(".toml") == Some(word.as_str()));
        let (file, text) = found.ok_or_else(|| {
            let names: Vec<&str> = BUILT_IN.iter().filter_map(|(file, _)| file.strip_suffix(".toml")).collect();
            Failure::new("post::base", format!("{}: no controller is called {word:?}", text.name()))
                .help(format!("base it on one of {}, or on a file: \"./base.toml\"", names.join(", ")))
        })?;
        source(format!("postprocessors/{file} (built in)"), *text)
    };
    let base = completed(&base, read, depth + 1)?.unwrap_or(base);
    let mut whole: Table = toml::from_str(base.inner())
        .map_err(|e| from_toml(&e, &base, "post::not_toml").help("the base is unusable"))?;
    merge(&mut whole, own);
    let written = toml::to_string_pretty(&whole).map_err(|e| {
        Failure::new("post::base", format!("{} cannot be completed from {word:?}: {e}", text.name()))
            .help("copy the base and change the copy")
    })?;
    Ok(Some(source(format!("{} completed from {word}", text.name()), written)))
}

fn merge(base: &mut Table, own: Table) {
    if !own.is_empty() && base.contains_key("source") | base.contains_key("unverified") {
        base.remove("source");
        base.remove("unverified");
    }
    for (key, value) in own {
        match (base.get_mut(&key), value) {
            (Some(Value::Table(below)), Value::Table(above)) => merge(below, above),
            (_, value) => {
                base.insert(key, value);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const VARIANT: &str = r#"
format = "axiscal-postprocessor/1"
based_on = "linuxcnc"
name = "mine"
[settings]
release_feed = "77"
[write.rapid]
template = "G1 {{ to | words }} F5000"
unverified = "the builder's sheet"
"#;

    #[test]
    fn what_is_not_said_is_the_base_s() {
        let (post, _) = parse_alone(&source("mine.toml", VARIANT)).unwrap();
        let base = Postprocessor::load_built_in_or_file("linuxcnc").unwrap().0;
        assert_eq!((post.name.as_str(), post.based_on.as_deref()), ("mine", Some("linuxcnc")));
        assert_eq!(post.settings["release_feed"], "77");
        assert_eq!((post.settings["orient"].clone(), &post.log), (base.settings["orient"].clone(), &base.log));
        assert_eq!(post.unverified, [("write.rapid".to_owned(), "the builder's sheet".to_owned())]);
        assert_eq!(post.text, VARIANT);
    }

    #[test]
    fn a_change_needs_a_source_of_its_own() {
        let silent = VARIANT.replace("unverified = \"the builder's sheet\"\n", "");
        let failure = parse_alone(&source("mine.toml", silent)).unwrap_err();
        assert!(
            failure.0.iter().any(|f| f.code == "post::no_source" && f.message.contains("write.rapid")),
            "{failure}"
        );
    }

    #[test]
    fn a_base_that_is_not_there_is_said() {
        for (word, what) in [("fanuk", "fanuc"), ("./x.toml", "built in")] {
            let text = VARIANT.replace("\"linuxcnc\"", &format!("{word:?}"));
            let failure = parse_alone(&source("mine.toml", text)).unwrap_err();
            assert!(failure.to_string().contains(what) || failure.0[0].help.as_deref().unwrap().contains(what));
        }
        let itself = |_: &Path| Ok(VARIANT.replace("\"linuxcnc\"", "\"mine.toml\""));
        let text = source("mine.toml", VARIANT.replace("\"linuxcnc\"", "\"mine.toml\""));
        assert!(parse(&text, &itself).unwrap_err().to_string().contains("stand on one another"));
    }
}
