//! What the control held: against what it was given, and one of its tables against another.

use super::backup::Old;
use super::fill::{Filled, Value};
use crate::diag::Finding;
use crate::post::tables::{LengthUnit, Tables};
use crate::tables::compensation::Tables as Record;
use crate::units::{inch_from_mm, mm_from_inch};
use std::collections::BTreeMap;

/// Old values that differ by less are the same: 0.1 um, and what of a direction or an angle is as small.
const SAME_MM: f64 = 1e-4;
const SAME_DIRECTION: f64 = 1e-6;
const SAME_DEG: f64 = 1e-5;

/// The spellings of the control's files, the one that is loaded first.
pub fn spellings(tables: &Tables) -> Vec<&str> {
    let mut out: Vec<&str> = Vec::new();
    for spelling in tables.file.iter().filter_map(|f| f.spelling.as_deref()) {
        if !out.contains(&spelling) {
            out.push(spelling);
        }
    }
    out
}

/// The old values with those that a loaded compensation wrote, where nothing else is said of them.
pub fn with_what_was_loaded(old: &Old, loaded: Option<&Record>) -> Old {
    let mut held = old.clone();
    let Some(loaded) = loaded else { return held };
    for (name, value) in &loaded.values {
        held.values.entry(name.clone()).or_insert((*value, Some(loaded.unit)));
    }
    held
}

/// In mm, for a length.
fn plain(value: f64, unit: &str) -> f64 {
    if unit == "inch" { mm_from_inch(value) } else { value }
}

/// How far two values of a kind may be apart and be the same.
fn same(unit: &str) -> f64 {
    match unit {
        "" => SAME_DIRECTION,
        "deg" => SAME_DEG,
        _ => SAME_MM,
    }
}

/// Old values that are not what the compensation that was active during the measurement had written: with them that
/// compensation would be lost.
pub fn other_than_active<'a>(
    active: &Record,
    filled: impl Iterator<Item = &'a Filled>,
    unit: LengthUnit,
) -> Vec<Finding> {
    let mut wrong: BTreeMap<&str, (f64, f64, &str)> = BTreeMap::new();
    for value in filled.flat_map(|f| &f.values).filter(|v| !v.elsewhere) {
        let Some(name) = &value.given else { continue };
        let Some(written) = written(active, value, name, unit) else { continue };
        if (plain(written, value.unit) - plain(value.old, value.unit)).abs() > same(value.unit) {
            wrong.insert(name, (written, value.old, value.unit));
        }
    }
    let Some((name, (written, old, unit))) = wrong.iter().next() else { return Vec::new() };
    let more = match wrong.len() {
        1 => String::new(),
        n => format!(" ({} more differ)", n - 1),
    };
    let says = format!(
        "the compensation that was active during the measurement wrote {name} = {written} {unit}, the old value that is given is {old} {unit}{more}: one of the two is not what the control held"
    );
    vec![Finding::error("tables::old_not_active", says).help(
        "give a backup of the control from after that compensation was loaded, or none: then the values that it wrote are the old ones; values of a table that was not loaded do not belong into it",
    )]
}

/// What the active compensation wrote, in the unit of the value.
fn written(active: &Record, value: &Value, name: &str, unit: LengthUnit) -> Option<f64> {
    let in_unit = |mm: f64, of: LengthUnit| match (of, unit) {
        (LengthUnit::Mm, LengthUnit::Inch) => inch_from_mm(mm),
        (LengthUnit::Inch, LengthUnit::Mm) => mm_from_inch(mm),
        _ => mm,
    };
    let is_length = matches!(value.unit, "mm" | "inch");
    if let Some(written) = active.values.get(name) {
        return Some(if is_length { in_unit(*written, active.unit) } else { *written });
    }
    // a record of an older version has the vectors only, in mm
    let (id, k) = value.id.split_once('.')?;
    let k = ["x", "y", "z"].iter().position(|c| *c == k)?;
    // and a sheet of changes says nothing of what the control then held
    let older = active.values.is_empty() && active.changes.is_empty();
    let vector = active.vectors.iter().find(|v| older && v.id == id)?;
    let written = *vector.value.get(k)?;
    Some(if is_length { in_unit(written, LengthUnit::Mm) } else { written })
}

/// Where a table has no old values of its own, or two tables hold different ones.
pub fn between_tables(tables: &Tables, first: &Filled, others: &BTreeMap<&str, Filled>, old: &Old) -> Vec<Finding> {
    let mut findings = Vec::new();
    let named = |spelling: Option<&str>| {
        let files = tables.file.iter().filter(|f| f.spelling.as_deref() == spelling);
        files.map(|f| f.name.as_str()).next().unwrap_or_default().to_owned()
    };
    let spelling = spellings(tables).first().copied();
    let all = std::iter::once((spelling, first)).chain(others.iter().map(|(s, f)| (Some(*s), f)));
    for (n, (spelling, filled)) in all.enumerate() {
        let Some(value) = filled.values.iter().find(|v| v.elsewhere) else { continue };
        let lacks = filled.values.iter().filter(|v| v.elsewhere).count();
        let says = format!(
            "{}: {lacks} of its old values are not in the backup, such as {}: it is not written, because the backup has only those of the other table, such as {}",
            named(spelling),
            value.name(spelling).cloned().unwrap_or_default(),
            value.given.clone().unwrap_or_default()
        );
        // what is loaded in place of the first one concerns whoever loads it
        findings.push(if n == 0 {
            Finding::warning("tables::old_elsewhere", says).help(
                "load the table whose values the backup holds, or give a backup that holds those of this one, too",
            )
        } else {
            Finding::info("tables::old_elsewhere", says)
        });
    }
    let mut differ = Vec::new();
    for value in others.values().flat_map(|f| &f.values).filter(|v| !v.elsewhere) {
        let twin = first.values.iter().find(|v| v.id == value.id && !v.elsewhere && v.given != value.given);
        let (Some(twin), Some(name)) = (twin, &value.given) else { continue };
        let Some(other) = &twin.given else { continue };
        if (plain(value.old, value.unit) - plain(twin.old, twin.unit)).abs() > same(value.unit) {
            differ.push(format!("{other} = {} and {name} = {}", shown(old, other, twin), shown(old, name, value)));
        }
    }
    if let Some(first) = differ.first() {
        let more = if differ.len() > 1 { format!(" ({} more)", differ.len() - 1) } else { String::new() };
        let says = format!("the control's two tables differ: {first}{more}; each keeps its own, and adds to it");
        findings.push(
            Finding::warning("tables::old_differ", says).help(
                "only one of them acts: load that one; where they should be the same, one of them is out of date",
            ),
        );
    }
    findings
}

/// A number as the user spelled it.
fn shown(old: &Old, name: &str, value: &Value) -> String {
    old.texts.get(name).cloned().unwrap_or_else(|| value.old.to_string())
}
