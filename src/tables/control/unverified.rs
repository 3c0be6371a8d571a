//! Entries of the tables that were not run on a real control: they are refused, or reported where that is accepted.

use super::changes::Division;
use super::fill::Filled;
use super::{Options, kind_of};
use crate::diag::{Finding, Findings};
use crate::machine::Machine;
use crate::post::tables::{Kind, Tables, doubt};
use std::collections::{BTreeMap, BTreeSet};

/// Entries of the tables for a machine that were not run on a real control: what `--accept-unverified` accepts.
#[must_use]
pub fn not_run(machine: &Machine, tables: &Tables, position_tables: bool) -> Vec<String> {
    let Ok(kind) = kind_of(machine, tables) else { return Vec::new() };
    let mut out = Vec::new();
    let mut add = |what: String, source: &Option<String>, unverified: &Option<String>| {
        if doubt(source.as_ref(), unverified.as_ref()).is_some() {
            out.push(what);
        }
    };
    add("the tables".to_owned(), &tables.source, &tables.unverified);
    add(kind_says(kind), &kind.source, &kind.unverified);
    kind.vector.iter().for_each(|v| add(v.says.clone(), &v.source, &v.unverified));
    kind.angle.iter().for_each(|a| add(a.says.clone(), &a.source, &a.unverified));
    if let Some(grid) = tables.grid.as_ref().filter(|_| position_tables) {
        add("position tables".to_owned(), &grid.source, &grid.unverified);
    }
    tables
        .file
        .iter()
        .filter(|f| position_tables || !f.grids)
        .for_each(|f| add(format!("file {}", f.name), &f.source, &f.unverified));
    out
}

/// The key of the machine's kind in the list of what is not verified.
fn kind_id(kind: &Kind) -> String {
    format!("kind {}", kind.name)
}

fn kind_says(kind: &Kind) -> String {
    format!("entries for the kind \"{}\"", kind.name)
}

/// What an entry is, in words: its id is a key of the postprocessor's file.
fn entry_says(kind: &Kind, id: &str) -> String {
    if id == kind_id(kind) {
        return kind_says(kind);
    }
    let vectors = kind.vector.iter().map(|v| (&v.id, &v.says));
    let mut all = vectors.chain(kind.angle.iter().map(|a| (&a.id, &a.says)));
    all.find(|(known, _)| *known == id).map_or_else(|| id.to_owned(), |(_, says)| says.clone())
}

/// Entries that are not verified, and why: refused, or reported.
pub(super) fn say_unverified(
    tables: &Tables,
    kind: &Kind,
    filled: &Filled,
    (grids, division): (bool, &Division),
    options: &Options,
    findings: &mut Findings,
) -> BTreeMap<String, String> {
    let mut doubts: Vec<(String, String)> = Vec::new();
    let mut add = |what: String, why: Option<String>| {
        if let Some(why) = why {
            doubts.push((what, why));
        }
    };
    add("the tables".to_owned(), doubt(tables.source.as_ref(), tables.unverified.as_ref()));
    add(kind_id(kind), doubt(kind.source.as_ref(), kind.unverified.as_ref()));
    let mut seen = BTreeSet::new();
    for value in &filled.values {
        let id = value.id.split('.').next().unwrap_or_default().to_owned();
        if seen.insert(id.clone()) {
            add(id, value.unverified.clone());
        }
    }
    if grids && let Some(form) = &tables.grid {
        add("position tables".to_owned(), doubt(form.source.as_ref(), form.unverified.as_ref()));
    }
    for file in tables.file.iter().filter(|f| division.files.contains(&f.name)) {
        add(format!("file {}", file.name), doubt(file.source.as_ref(), file.unverified.as_ref()));
    }
    for (what, why) in &doubts {
        let message = format!("{}: not verified: {why}", entry_says(kind, what));
        findings.push(if options.accept_unverified {
            Finding::warning("tables::unverified", message)
                .help("compare it with the control's manual and its own backup before you load it")
        } else {
            Finding::error("tables::unverified", message)
                .help("compare it with the control's manual and backup; --accept-unverified writes it all the same")
        });
    }
    doubts.into_iter().collect()
}
