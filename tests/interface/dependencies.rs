//! What the program is made of: every crate has a licence that `licences.toml` allows, and every crate that `Cargo.toml` names stands in
//! `docs/dependencies.md`.

use std::collections::BTreeSet;
use std::process::Command;

const ROOT: &str = env!("CARGO_MANIFEST_DIR");

fn read(file: &str) -> String {
    std::fs::read_to_string(format!("{ROOT}/{file}")).unwrap_or_else(|e| panic!("{file}: {e}"))
}

/// What a command prints.
fn answer(program: &str, arguments: &[&str]) -> String {
    let run = Command::new(program).args(arguments).current_dir(ROOT).output().unwrap();
    assert!(run.status.success(), "{program} {arguments:?}: {}", String::from_utf8_lossy(&run.stderr));
    String::from_utf8(run.stdout).unwrap()
}

/// A crate with its licence as it states it.
struct Package {
    name: String,
    licence: Option<String>,
}

/// Every crate that is built on this system, for the program, its build and its tests. Those of other systems are not on the disk.
fn packages() -> Vec<Package> {
    let host = answer("rustc", &["--print", "host-tuple"]);
    let cargo = std::env::var("CARGO").unwrap_or_else(|_| "cargo".to_owned());
    let call = ["metadata", "--format-version", "1", "--locked", "--offline", "--filter-platform", host.trim()];
    let graph: serde_json::Value = serde_json::from_str(&answer(&cargo, &call)).unwrap();
    let all = graph["packages"].as_array().unwrap().iter();
    let package = |p: &serde_json::Value| Package {
        name: p["name"].as_str().unwrap().to_owned(),
        licence: p["license"].as_str().map(str::to_owned),
    };
    all.map(package).collect()
}

/// Is a licence allowed, such as `(MIT OR Apache-2.0) AND Unicode-3.0`? `AND` binds closer than `OR`; `/` is an old `OR`.
fn is_allowed(licence: &str, allowed: &BTreeSet<String>) -> bool {
    let spaced = licence.replace('/', " OR ").replace('(', " ( ").replace(')', " ) ").replace(" WITH ", "+WITH+");
    let words: Vec<&str> = spaced.split_whitespace().collect();
    let mut rest = &words[..];
    any(&mut rest, allowed) == Some(true) && rest.is_empty()
}

/// Takes the next word, if it is this one.
fn takes(rest: &mut &[&str], word: &str) -> bool {
    let is_next = rest.first() == Some(&word);
    if is_next {
        *rest = &rest[1..];
    }
    is_next
}

/// Of licences joined by `OR`; `None` where the text is no licence.
fn any(rest: &mut &[&str], allowed: &BTreeSet<String>) -> Option<bool> {
    let mut found = all(rest, allowed)?;
    while takes(rest, "OR") {
        found |= all(rest, allowed)?;
    }
    Some(found)
}

/// Of licences joined by `AND`.
fn all(rest: &mut &[&str], allowed: &BTreeSet<String>) -> Option<bool> {
    let mut found = one(rest, allowed)?;
    while takes(rest, "AND") {
        found &= one(rest, allowed)?;
    }
    Some(found)
}

fn one(rest: &mut &[&str], allowed: &BTreeSet<String>) -> Option<bool> {
    if takes(rest, "(") {
        let found = any(rest, allowed)?;
        return takes(rest, ")").then_some(found);
    }
    let (first, behind) = rest.split_first()?;
    *rest = behind;
    Some(allowed.contains(*first))
}

#[test]
fn licences_are_read_as_they_are_meant() {
    let allowed = BTreeSet::from(["MIT", "Apache-2.0", "Unicode-3.0"].map(str::to_owned));
    for good in [
        "MIT",
        "GPL-3.0 OR MIT",
        "MIT/Apache-2.0",
        "(MIT OR GPL-3.0) AND Unicode-3.0",
        "MIT AND Apache-2.0",
        "GPL-3.0 AND MIT OR MIT",
        "Apache-2.0 WITH LLVM-exception OR MIT",
    ] {
        assert!(is_allowed(good, &allowed), "{good}");
    }
    for bad in ["", "GPL-3.0", "MIT AND GPL-3.0", "(MIT OR GPL-3.0", "MIT OR", "MIT MIT", "MIT WITH Something"] {
        assert!(!is_allowed(bad, &allowed), "{bad}");
    }
}

#[test]
fn every_crate_has_a_licence_that_is_allowed() {
    let file: toml::Table = read("licences.toml").parse().unwrap();
    let word = |value: &toml::Value| value.as_str().unwrap().to_owned();
    let allowed: BTreeSet<String> = file["allowed"].as_array().unwrap().iter().map(word).collect();
    let exceptions = file.get("exception").map_or(&[][..], |e| e.as_array().unwrap());
    let packages = packages();
    assert!(packages.len() > 100, "{} crates", packages.len());
    let is_exception =
        |p: &Package| exceptions.iter().any(|e| word(&e["crate"]) == p.name && Some(word(&e["licence"])) == p.licence);
    let is_good = |p: &Package| p.licence.as_deref().is_some_and(|licence| is_allowed(licence, &allowed));
    let wrong: Vec<String> = packages
        .iter()
        .filter(|p| !is_good(p) && !is_exception(p))
        .map(|p| format!("{}: {}", p.name, p.licence.as_deref().unwrap_or("none")))
        .collect();
    assert!(wrong.is_empty(), "no licence of these is in licences.toml: {wrong:#?}");
    for exception in exceptions {
        let name = word(&exception["crate"]);
        assert!(!word(&exception["reason"]).trim().is_empty(), "the exception for {name} has no reason");
        assert!(packages.iter().any(|p| p.name == name && !is_good(p)), "the exception for {name} is not needed");
    }
    // a licence that no crate needs is not in the list
    for licence in &allowed {
        let fewer: BTreeSet<String> = allowed.iter().filter(|l| *l != licence).cloned().collect();
        let needed = packages.iter().any(|p| p.licence.as_deref().is_some_and(|l| !is_allowed(l, &fewer)));
        assert!(needed, "no crate needs {licence}");
    }
}

#[test]
fn every_direct_dependency_is_explained() {
    let manifest: toml::Table = read("Cargo.toml").parse().unwrap();
    let tables = ["dependencies", "build-dependencies", "dev-dependencies"];
    let tables = tables.iter().filter_map(|table| manifest.get(*table)?.as_table());
    let named: BTreeSet<String> = tables.flat_map(|table| table.keys().cloned()).collect();
    let page = read("docs/dependencies.md");
    let rows: Vec<Vec<&str>> = page
        .lines()
        .filter(|line| line.starts_with("| `"))
        .map(|line| line.trim_matches('|').split('|').map(str::trim).collect())
        .collect();
    let mut explained = BTreeSet::new();
    for row in &rows {
        assert!(row.len() == 4 && row.iter().all(|cell| !cell.is_empty()), "{row:?}");
        for name in row[0].split(", ") {
            assert!(explained.insert(name.trim_matches('`').to_owned()), "{name} stands there twice");
        }
    }
    let missing: Vec<&String> = named.difference(&explained).collect();
    let beyond: Vec<&String> = explained.difference(&named).collect();
    assert!(missing.is_empty() && beyond.is_empty(), "not explained: {missing:?}; not in Cargo.toml: {beyond:?}");
}
