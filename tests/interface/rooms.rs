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
