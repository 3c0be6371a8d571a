//! The order of the rooms (ARCHITECTURE.md): a room imports only rooms that stand before it here.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

const ORDER: &str = "units diag probability geometry symbols axes keys files machine program post log model search simulate \
                     fit tables paper study compare design diagnose check report view plots page workflow prelude workbench cli";

/// Rooms that may import these rooms and no others.
const ONLY: [(&str, &str); 3] = [
    ("search", "probability"),
    ("simulate", "axes diag keys log machine program units"),
    ("model", "axes diag geometry keys log machine program symbols units words"),
];

/// Facts become sentences in `words`: it knows the rooms of the facts, and the rooms that print or keep sentences know it.
const USES_WORDS: &str = "log model fit design diagnose compare report view plots page workflow workbench cli";

#[test]
fn rooms_import_only_what_stands_before_them() {
    let order: Vec<&str> = ORDER.split_whitespace().collect();
    let place = |room: &str| order.iter().position(|r| *r == room);
    let has = |list: &str, room: &str| list.split_whitespace().any(|r| r == room);
    let may_import = |room: &str, other: &str| match ONLY.iter().find(|(only, _)| *only == room) {
        Some((_, list)) => has(list, other),
        None if other == "words" => has(USES_WORDS, room),
        None => room == "words" || place(other) < place(room),
    };
    let mut files = Vec::new();
    collect(Path::new(env!("CARGO_MANIFEST_DIR")).join("src"), &mut files);
    let mut wrong = BTreeSet::new();
    for file in files.iter().filter(|f| !f.ends_with("lib.rs") && !f.ends_with("main.rs")) {
        let inside = file.strip_prefix(concat!(env!("CARGO_MANIFEST_DIR"), "/src")).unwrap();
        let room = inside.components().next().unwrap().as_os_str().to_str().unwrap().trim_end_matches(".rs").to_owned();
        assert!(room == "words" || place(&room).is_some(), "{room} has no place in the order");
        let text = std::fs::read_to_string(file).unwrap();
        let code = text.split("#[cfg(test)]\nmod tests {").next().unwrap();
        for line in code.lines().filter(|line| !line.trim_start().starts_with("//")) {
            for import in line.split("crate::").skip(1) {
                let other: String = import.chars().take_while(|c| c.is_ascii_alphanumeric() || *c == '_').collect();
                if other != room && (place(&other).is_some() || other == "words") && !may_import(&room, &other) {
                    wrong.insert(format!("{}: {room} imports {other}", inside.display()));
                }
            }
        }
    }
    assert!(files.len() > 100 && wrong.is_empty(), "{wrong:#?}");
}

/// Files that take text apart because it comes from elsewhere.
const READS_FOREIGN_TEXT: [(&str, &str); 8] = [
    ("check/", "reads NC programs back"),
    ("tables/control/backup.rs", "reads a control's backup"),
    ("workflow/export/old_values.rs", "recognises the backup among its own files"),
    ("study/mod.rs", "the error of the TOML reader has no other form"),
    ("words/diagnose.rs", "names of variables: `C before`"),
    ("post/render.rs", "a template that another one includes"),
    ("page/", "the page's template"),
    ("diagnose/sketch.rs", "writes a sentence into a TOML file: quotes must go"),
];

const TAKES_APART: [&str; 10] = [
    ".starts_with(",
    ".ends_with(",
    ".contains(",
    ".split(",
    ".split_once(",
    ".rsplit_once(",
    ".strip_prefix(",
    ".strip_suffix(",
    ".replace(",
    ".find(",
];

/// No decision is taken from a sentence: it is not searched for words, split or rewritten.
#[test]
fn no_sentence_is_taken_apart() {
    let mut files = Vec::new();
    collect(Path::new(env!("CARGO_MANIFEST_DIR")).join("src"), &mut files);
    let mut wrong = Vec::new();
    for file in &files {
        let inside = file.strip_prefix(concat!(env!("CARGO_MANIFEST_DIR"), "/src")).unwrap().display().to_string();
        if READS_FOREIGN_TEXT.iter().any(|(allowed, _)| inside.starts_with(allowed)) {
            continue;
        }
        let text = std::fs::read_to_string(file).unwrap();
        let code = text.split("#[cfg(test)]\n").next().unwrap();
        for (number, line) in code.lines().enumerate().filter(|(_, line)| !line.trim_start().starts_with("//")) {
            if takes_a_sentence_apart(line) {
                wrong.push(format!("{inside}:{}: {}", number + 1, line.trim()));
            }
        }
    }
    assert!(files.len() > 100 && wrong.is_empty(), "{wrong:#?}");
}

/// Is a text searched for words of a sentence, or is a message searched for anything?
fn takes_a_sentence_apart(line: &str) -> bool {
    TAKES_APART.iter().any(|call| {
        line.match_indices(call).any(|(at, _)| {
            let (before, after) = (&line[..at], &line[at + call.len()..]);
            let of_message = ["message", "says", "reason", "sentence", "detail", "tell_apart", "warning", "remark"]
                .iter()
                .any(|name| before.ends_with(name) || before.ends_with(&format!("{name}()")));
            let quoted = after.trim_start_matches("&format!(").trim_start_matches('&').strip_prefix('"');
            let words = quoted
                .and_then(|text| text.split('"').next())
                .is_some_and(|text| text.contains(' ') && text.chars().any(char::is_alphabetic));
            (of_message && !after.starts_with('|')) || words
        })
    })
}

#[test]
fn a_sentence_that_is_taken_apart_is_found() {
    for bad in [
        r#"if reason.starts_with("taken out") {"#,
        r#"let plain = |text: String| text.replace(" um ", " µm ");"#,
        r#"if !last.contains("left that no variation") {"#,
        r#"let word = f.message.split('"').nth(1);"#,
        r#"f.message.starts_with(&format!("formula {:?} of", text))"#,
    ] {
        assert!(takes_a_sentence_apart(bad), "{bad}");
    }
    for good in [r#"if id.starts_with("location-") {"#, r#"name.split('@').next()"#, r#"text.replace('-', "_")"#] {
        assert!(!takes_a_sentence_apart(good), "{good}");
    }
}

/// The sources without the unit tests in files of their own, which may use any room.
fn collect(folder: PathBuf, files: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()) {
        match entry.file_stem().and_then(|name| name.to_str()) {
            Some("tests") => {}
            _ if entry.is_dir() => collect(entry, files),
            _ => files.extend(entry.extension().is_some_and(|e| e == "rs").then_some(entry)),
        }
    }
}
