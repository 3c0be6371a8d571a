//! Backups of controls, from which old values are taken.
#![no_main]
mod common;

use axiscal::diag::source;
use axiscal::machine;
use axiscal::post::tables::Tables;
use axiscal::tables::control::{self, backup};
use axiscal::tables::linuxcnc::ini::UserIni;
use libfuzzer_sys::fuzz_target;
use std::collections::BTreeSet;
use std::sync::LazyLock;

/// The tables of each control, with the names of the machine that has most of them: the reader is the same for all machines.
static SOUGHT: LazyLock<Vec<(Tables, BTreeSet<String>)>> = LazyLock::new(|| {
    let (machines, _) = machine::load(&source("machines.toml", machine::BUILT_IN)).expect("shipped");
    let tables: Vec<Tables> = common::POSTS.iter().filter_map(|p| p.tables.clone()).collect();
    let all = |t: Tables| {
        let names = machines.iter().map(|m| control::names(m, &t)).max_by_key(BTreeSet::len);
        names.filter(|n| !n.is_empty()).map(|n| (t, n))
    };
    tables.into_iter().flat_map(all).collect()
});

fuzz_target!(|data: &[u8]| {
    let Ok(text) = std::str::from_utf8(data) else { return };
    let text = source("fuzz", text);
    for (tables, names) in SOUGHT.iter() {
        match backup::read(&text, &tables.backup, names) {
            Ok(old) => {
                assert!(!old.values.is_empty());
                assert!(old.values.iter().all(|(name, (value, _))| names.contains(name) && value.is_finite()));
            }
            Err(failure) => assert!(!failure.0.is_empty()),
        }
    }
    if let Ok(ini) = UserIni::read(&text) {
        drop(format!("{ini:?}"));
    }
});
