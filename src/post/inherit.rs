//! A postprocessor file that says only what is different: `based_on = "fanuc"`, and the lines that it changes.
//!
//! The file is completed from its base, table by table, and read like any other. A table that says where it comes from
//! loses that when one of its lines is changed: what a manual says of the base is no word on the change.

use super::{BUILT_IN, Postprocessor, check};
use crate::diag::{Failure, Finding, Findings, Result, Source, from_toml, source};
use std::collections::BTreeSet;
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
    let Some((whole, of_base)) = completed(source, read, 0)? else {
        let (post, findings) = check::parse(source)?;
        // a copy may leave settings of the built-in file without a use
        let tables = || BUILT_IN.iter().filter_map(|(_, text)| toml::from_str::<Table>(text).ok());
        uses_its_settings(&post, source, || tables().flat_map(|table| settings(&table)).collect())?;
        return Ok((post, findings));
    };
    let (post, findings) = check::parse(&whole)?;
    uses_its_settings(&post, source, || of_base)?;
    Ok((Postprocessor { text: source.inner().clone(), ..post }, findings))
}

fn settings(table: &Table) -> BTreeSet<String> {
    let settings = table.get("settings").and_then(Value::as_table);
    settings.into_iter().flat_map(Table::keys).cloned().collect()
}

/// A setting of the file's own that neither its base knows nor a template uses: a misspelled one would be taken without a
/// word, and the meant one stay as it was.
fn uses_its_settings(post: &Postprocessor, source: &Source, known: impl FnOnce() -> BTreeSet<String>) -> Result<()> {
    let unused: Vec<&String> = post.settings.keys().filter(|name| !post.names_setting(name)).collect();
    if unused.is_empty() {
        return Ok(());
    }
    let (known, mut findings) = (known(), Findings::default());
    for name in unused.into_iter().filter(|name| !known.contains(*name)) {
        let near = post.settings.keys().filter(|other| *other != name).min_by_key(|other| distance(name, other));
        let meant =
            near.filter(|other| distance(name, other) <= 2).map_or(String::new(), |n| format!("is {n} meant? "));
        let finding = Finding::error("post::unused_setting", format!("no template uses the setting {name:?}"))
            .help(format!("{meant}`axiscal controllers show` lists the settings of a controller"));
        let begins =
            |line: &str| line.trim_start().strip_prefix(name.as_str()).is_some_and(|r| r.trim_start().starts_with('='));
        let mut at = 0;
        let place = source.inner().split_inclusive('\n').find_map(|line| {
            let here = at..at + line.trim_end().len();
            at += line.len();
            begins(line).then_some(here)
        });
        findings.push(match place {
            Some(place) => finding.at(source, place),
            None => finding,
        });
    }
    findings.finish(()).map(|_| ())
}

/// How many letters lie between two words: added, left out or changed.
fn distance(one: &str, other: &str) -> usize {
    let other: Vec<char> = other.chars().collect();
    let mut row: Vec<usize> = (0..=other.len()).collect();
    for (i, a) in one.chars().enumerate() {
        let mut corner = std::mem::replace(&mut row[0], i + 1);
        for (j, b) in other.iter().enumerate() {
            let changed = corner + usize::from(a != *b);
            corner = row[j + 1];
            row[j + 1] = changed.min(row[j] + 1).min(corner + 1);
        }
    }
    row.last().copied().unwrap_or(0)
}

/// The whole file, and the settings of its base.
type Completed = (Source, BTreeSet<String>);

/// The file with everything that it takes from its base; `None` when it has none.
fn completed(text: &Source, read: &dyn Fn(&Path) -> Result<String>, depth: usize) -> Result<Option<Completed>> {
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
    let base = completed(&base, read, depth + 1)?.map_or(base, |(whole, _)| whole);
    let mut whole: Table = toml::from_str(base.inner())
        .map_err(|e| from_toml(&e, &base, "post::not_toml").help("the base is unusable"))?;
    let of_base = settings(&whole);
    for path in own.get("without").and_then(Value::as_array).into_iter().flatten().filter_map(Value::as_str) {
        if remove(&mut whole, path).is_none() {
            return Err(Failure::new("post::base", format!("{}: {word:?} has no {path:?}", text.name()))
                .help("`without` lists the tables and keys of the base that do not apply, such as \"tables\" or \"check.waits\""));
        }
    }
    merge(&mut whole, own);
    let written = toml::to_string_pretty(&whole).map_err(|e| {
        Failure::new("post::base", format!("{} cannot be completed from {word:?}: {e}", text.name()))
            .help("copy the base and change the copy")
    })?;
    Ok(Some((source(format!("{} completed from {word}", text.name()), written), of_base)))
}

/// Removes what stands at a path such as `check.waits`.
fn remove(table: &mut Table, path: &str) -> Option<Value> {
    match path.split_once('.') {
        Some((first, rest)) => remove(table.get_mut(first)?.as_table_mut()?, rest),
        None => table.remove(path),
    }
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
    fn parts_of_the_base_are_left_out() {
        let of_fanuc = VARIANT.replace("linuxcnc", "fanuc");
        let without = |what: &str| of_fanuc.replace("name = ", &format!("without = [{what:?}]\nname = "));
        let (post, _) = parse_alone(&source("mine.toml", without("tables"))).unwrap();
        assert!(post.tables.is_none());
        let failure = parse_alone(&source("mine.toml", without("tabels"))).unwrap_err();
        assert!(failure.to_string().contains("tabels"), "{failure}");
    }

    #[test]
    fn a_setting_that_nothing_uses_is_an_error_with_its_place() {
        let text = VARIANT.replace("release_feed = ", "release_fed = ");
        let failure = parse_alone(&source("mine.toml", text)).unwrap_err();
        assert_eq!(failure.0[0].place().as_deref(), Some("mine.toml:6:1"));
        assert!(failure.0[0].help.as_deref().unwrap().contains("is release_feed meant?"), "{failure}");
        // what a template of the file's own uses is known
        let text = VARIANT.replace("release_feed = ", "my_feed = ").replace("F5000", "F{{ settings.my_feed }}");
        assert!(parse_alone(&source("mine.toml", text)).is_ok());
        assert_eq!((distance("probe_onn", "probe_on"), distance("a", "xyz"), distance("", "ab")), (1, 3, 2));
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
