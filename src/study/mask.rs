//! Touches taken out of a study, or taken back in, in the study's own text: comments and order stay.

use super::Study;
use crate::diag::{Failure, Result, source};
use crate::fit::Mask;
use toml_edit::{ArrayOfTables, DocumentMut, InlineTable, Item, Table, Value, value};

/// Longest reason, in signs.
pub const LONGEST_REASON: usize = 200;

/// The text with touches put into `[[mask]]`; those that stand there already stay as they are.
///
/// # Errors
/// When the reason says nothing or is too long, or the text is no study (with those touches).
pub fn mask(text: &str, touches: &[(usize, u64)], reason: &str) -> Result<String> {
    let reason = reason.trim();
    if reason.is_empty() || reason.chars().count() > LONGEST_REASON || reason.chars().any(char::is_control) {
        return Err(Failure::new("study::reason", "a touch is excluded with a reason, in one line")
            .help(format!("say in up to {LONGEST_REASON} signs why, for instance: chip on the block")));
    }
    let mut expected = masked(text)?;
    let new = |&(run, id): &(usize, u64)| Mask { run, id, reason: reason.to_owned() };
    let known = |all: &[Mask], m: &Mask| all.iter().any(|k| (k.run, k.id) == (m.run, m.id));
    let mut added: Vec<Mask> = Vec::new();
    for m in touches.iter().map(new) {
        if !known(&expected, &m) && !known(&added, &m) {
            added.push(m);
        }
    }
    let mut doc = document(text)?;
    let item = doc.entry("mask").or_insert(Item::ArrayOfTables(ArrayOfTables::new()));
    for m in &added {
        let (run, id) = numbers(m)?;
        match &mut *item {
            Item::ArrayOfTables(tables) => {
                let mut table = Table::new();
                table["run"] = value(run);
                table["id"] = value(id);
                table["reason"] = value(&m.reason);
                table.decor_mut().set_prefix("\n");
                tables.push(table);
            }
            Item::Value(Value::Array(array)) => {
                let mut table = InlineTable::new();
                table.insert("run", run.into());
                table.insert("id", id.into());
                table.insert("reason", m.reason.as_str().into());
                array.push(table);
            }
            _ => return Err(unusable()),
        }
    }
    expected.extend(added);
    read_back(doc.to_string(), &expected)
}

/// The text without the masks of touches; one that is not there is no error.
///
/// # Errors
/// When the text is no study.
pub fn unmask(text: &str, touches: &[(usize, u64)]) -> Result<String> {
    let mut expected = masked(text)?;
    expected.retain(|m| !touches.contains(&(m.run, m.id)));
    let mut doc = document(text)?;
    let gone = |run: Option<i64>, id: Option<i64>| {
        let run = run.and_then(|r| usize::try_from(r).ok()).and_then(|r| r.checked_sub(1));
        let id = id.and_then(|i| u64::try_from(i).ok());
        run.zip(id).is_some_and(|touch| touches.contains(&touch))
    };
    let integer = |item: Option<&Item>| item.and_then(Item::as_integer);
    let empty = match doc.get_mut("mask") {
        Some(Item::ArrayOfTables(tables)) => {
            tables.retain(|t| !gone(integer(t.get("run")), integer(t.get("id"))));
            tables.is_empty()
        }
        Some(Item::Value(Value::Array(array))) => {
            array.retain(|v| {
                let field = |name| v.as_inline_table().and_then(|t| t.get(name)).and_then(Value::as_integer);
                !gone(field("run"), field("id"))
            });
            false
        }
        _ => false,
    };
    if empty {
        doc.remove("mask");
    }
    read_back(doc.to_string(), &expected)
}

/// The text with a further file in `effects_file`.
///
/// # Errors
/// When the text is no study.
pub fn name_effects_file(text: &str, file: &str) -> Result<String> {
    let before = parse(text)?.effects_files;
    if before.iter().any(|f| f == file) {
        return Ok(text.to_owned());
    }
    let mut doc = document(text)?;
    match doc.get_mut("effects_file").and_then(Item::as_array_mut) {
        Some(array) => array.push(file),
        None => {
            // behind `machine`, where a person would look for it; top-level keys stand before all tables
            doc["effects_file"] = value([file].into_iter().collect::<toml_edit::Array>());
        }
    }
    let text = doc.to_string();
    let after = parse(&text)?.effects_files;
    let meant = after.len() == before.len() + 1 && after.last().is_some_and(|f| f == file);
    if meant { Ok(text) } else { Err(unusable()) }
}

fn parse(text: &str) -> Result<Study> {
    Ok(Study::parse(&source("study.toml", text.to_owned()))?.0)
}

fn masked(text: &str) -> Result<Vec<Mask>> {
    Ok(parse(text)?.masked)
}

fn document(text: &str) -> Result<DocumentMut> {
    text.parse().map_err(|e| {
        Failure::new("study::not_toml", format!("the study is no TOML: {e}")).help("correct it by hand first")
    })
}

fn numbers(m: &Mask) -> Result<(i64, i64)> {
    let run = i64::try_from(m.run).ok().and_then(|r| r.checked_add(1));
    run.zip(i64::try_from(m.id).ok())
        .ok_or_else(|| Failure::new("study::mask", format!("there is no touch {} in run {}", m.id, m.run)))
}

fn unusable() -> Failure {
    Failure::new("study::edit", "the study cannot be edited in place").help("edit it by hand")
}

/// The text, once it is read back as meant.
fn read_back(text: String, expected: &[Mask]) -> Result<String> {
    let now = masked(&text)?;
    let same = now.len() == expected.len() && expected.iter().all(|m| now.contains(m));
    if same { Ok(text) } else { Err(unusable()) }
}

#[cfg(test)]
mod tests {
    use super::*;

    const STUDY: &str = "# mine\nmachine = \"m\" # the old one\n\n[[data]]\nplan='p'\nlog=\"l\"\ncontroller=\"csv\"\n\n[model] # all\neffects = [\"a\"] # end\n\n[noise]\ntouch_um = 0.5\n";

    #[test]
    fn what_was_masked_and_unmasked_leaves_the_same_bytes() {
        for text in [
            STUDY.to_owned(),
            STUDY.replace("[model]", "[[mask]] # a chip\nrun = 1\nid = 3\nreason = \"chip\"\n\n[model]"),
        ] {
            let out = mask(&text, &[(0, 17), (0, 18), (0, 17)], " coolant \"drop\" ").unwrap();
            let study = parse(&out).unwrap();
            assert!(study.masked.contains(&Mask { run: 0, id: 17, reason: "coolant \"drop\"".into() }), "{out}");
            assert!(out.contains("# mine") && out.contains("# end") && out.contains("# the old one"));
            assert_eq!(unmask(&out, &[(0, 17), (0, 18)]).unwrap(), text);
        }
    }

    #[test]
    fn a_list_in_one_line_is_understood() {
        let text = STUDY.replace("\n[[data]]", "mask = [{ run = 1, id = 2, reason = \"dirt\" }] # one\n\n[[data]]");
        let out = mask(&text, &[(0, 5)], "dirt too").unwrap();
        assert_eq!(masked(&out).unwrap().len(), 2, "{out}");
        let out = unmask(&out, &[(0, 2)]).unwrap();
        assert_eq!(masked(&out).unwrap(), [Mask { run: 0, id: 5, reason: "dirt too".into() }], "{out}");
    }

    #[test]
    fn a_mask_needs_a_reason_and_a_run() {
        assert!(mask(STUDY, &[(0, 1)], "  ").is_err());
        assert!(mask(STUDY, &[(0, 1)], "two\nlines").is_err());
        assert!(mask(STUDY, &[(0, 1)], &"x".repeat(201)).is_err());
        assert!(mask(STUDY, &[(7, 1)], "there is no such run").is_err());
        assert!(mask(STUDY, &[(0, u64::MAX)], "no such number").is_err());
    }

    #[test]
    fn an_effects_file_is_named_once() {
        let out = name_effects_file(STUDY, "my-effects.toml").unwrap();
        assert!(
            out.starts_with("# mine\nmachine = \"m\" # the old one\neffects_file = [\"my-effects.toml\"]\n"),
            "{out}"
        );
        assert_eq!(name_effects_file(&out, "my-effects.toml").unwrap(), out);
        let two = name_effects_file(&out, "more.toml").unwrap();
        assert_eq!(parse(&two).unwrap().effects_files, ["my-effects.toml", "more.toml"]);
    }
}
