//! Old values from the user's own backup of the control: strict about what it needs, blind to the rest of the file.

use crate::diag::{Finding, Findings, Result, Source};
use crate::post::tables::{BackupForm, BackupKind, LengthUnit};
use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;

/// Old values by the control's names.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Old {
    /// As the control holds them: in its unit, or in that which stands beside them.
    pub values: BTreeMap<String, (f64, Option<LengthUnit>)>,
    /// The numbers as they were spelled: a restoring file brings back these digits and no others.
    pub texts: BTreeMap<String, String>,
    /// Names of values that the backup itself marks as assumed: a restoring file of an export without the control's own.
    pub assumed: BTreeSet<String>,
}

impl Old {
    /// The one unit of all lengths, where the backup says it.
    #[must_use]
    pub fn unit(&self) -> Option<LengthUnit> {
        let mut units = self.values.values().filter_map(|(_, unit)| *unit);
        let first = units.next()?;
        units.all(|u| u == first).then_some(first)
    }
}

/// A name without blanks, in capitals: `N24500 $MC_X[0]` and `$MC_X[ 0 ]` are one.
#[must_use]
pub fn plain_name(name: &str) -> String {
    name.chars().filter(|c| !c.is_whitespace()).flat_map(char::to_uppercase).collect()
}

/// Reads the values of these names.
///
/// # Errors
/// When one of them stands twice with two values, is no number, or none is there; every finding has its place.
pub fn read(source: &Source, form: &BackupForm, wanted: &BTreeSet<String>) -> Result<Old> {
    read_such_as(source, form, wanted, wanted.first().map_or("", String::as_str))
}

/// The same; where none of the values is there, this name is the example.
///
/// # Errors
/// As [`read`].
pub fn read_such_as(source: &Source, form: &BackupForm, wanted: &BTreeSet<String>, such_as: &str) -> Result<Old> {
    let wanted: BTreeMap<String, &String> = wanted.iter().map(|n| (plain_name(n), n)).collect();
    let (mut old, mut findings) = (Old::default(), Findings::default());
    let text = source.inner();
    let (mut at, mut last) = (0, "");
    // of a sheet of axiscal's, from the line that says it
    let (mut unit, mut restores, mut assumed) = (None, false, None);
    for raw in text.split_inclusive('\n') {
        let line = raw.trim_end_matches(['\n', '\r']);
        let span = at..at + line.len();
        at += raw.len();
        if !line.trim().is_empty() {
            last = line.trim();
        }
        let found = match form.form {
            BackupKind::Assignments => {
                unit = unit_line(line, &form.comment).or(unit);
                assignment(line, &form.comment).map(|f| Found { unit, ..f })
            }
            BackupKind::Words => word(line),
        };
        let Some(found) = found else {
            restores |= line.contains(RESTORES);
            if restores && says_assumed(line) {
                let named = line.split_whitespace().filter_map(|w| wanted.get(&plain_name(w)));
                assumed.get_or_insert_with(BTreeSet::new).extend(named.map(|n| (*n).clone()));
            }
            continue;
        };
        let Some(known) = wanted.get(&found.name) else { continue };
        if restores && says_assumed(line) {
            old.assumed.insert((*known).clone());
        }
        match found.value.filter(|v| v.is_finite()) {
            None => wrong(&mut findings, source, span, format!("{known} is no number here: {:?}", line.trim())),
            Some(value) => {
                old.texts.insert((*known).clone(), found.text);
                let given = (value, found.unit);
                if let Some(before) = old.values.insert((*known).clone(), given).filter(|b| *b != given) {
                    wrong(&mut findings, source, span, format!("{known} stands twice: {} and {value}", before.0));
                }
            }
        }
    }
    if let (Some(named), true) = (assumed, old.assumed.is_empty()) {
        // a file that names none means all of them
        old.assumed = if named.is_empty() { old.values.keys().cloned().collect() } else { named };
    }
    let end = text.len()..text.len();
    if let Some(ending) = &form.last_line
        && last != ending.as_str()
    {
        wrong(&mut findings, source, end.clone(), format!("the backup does not end with {ending:?}: it was cut off"));
    } else if old.values.is_empty() {
        let first = if such_as.is_empty() { String::new() } else { format!(", such as {such_as}") };
        wrong(&mut findings, source, end, format!("none of the values that are to be changed stands in it{first}"));
    }
    Ok(findings.finish(old)?.0)
}

fn wrong(findings: &mut Findings, source: &Source, span: Range<usize>, message: String) {
    findings.push(
        Finding::error("export::backup", message)
            .at(source, span)
            .help("give the control's own backup of these values, unedited and complete"),
    );
}

/// A value in a line.
struct Found {
    name: String,
    value: Option<f64>,
    unit: Option<LengthUnit>,
    /// The number as it is spelled.
    text: String,
}

/// The head of a restoring file. What other sheets mark is the value before the one that was entered.
const RESTORES: &str = "RESTORES";

/// A sheet of axiscal's marks what it took from the machine's description, not from the control.
fn says_assumed(line: &str) -> bool {
    line.contains("ASSUMED")
}

/// `; lengths in mm`, as axiscal's own sheets say it.
fn unit_line(line: &str, comment: &str) -> Option<LengthUnit> {
    let remark = line.trim().strip_prefix(comment).filter(|_| !comment.is_empty())?;
    match remark.trim().strip_prefix("lengths in ")?.trim() {
        "mm" => Some(LengthUnit::Mm),
        "inch" => Some(LengthUnit::Inch),
        _ => None,
    }
}

/// `[N123] NAME = 1.25 ; remark`; numbers may be written `1.25EX-04`.
fn assignment(line: &str, comment: &str) -> Option<Found> {
    let line = if comment.is_empty() { line } else { line.split(comment).next().unwrap_or("") };
    let (name, value) = line.split_once('=')?;
    let name = name.trim();
    let name = match name.strip_prefix(['N', 'n']).and_then(|n| n.split_once(char::is_whitespace)) {
        Some((number, rest)) if number.bytes().all(|b| b.is_ascii_digit()) => rest,
        _ => name,
    };
    let text = value.trim().to_owned();
    Some(Found { name: plain_name(name), value: number(&text.replace("EX", "E")), unit: None, text })
}

/// `N19703Q1M-0.0123;`
fn word(line: &str) -> Option<Found> {
    let line: String = line.trim().trim_end_matches(';').chars().filter(|c| !c.is_whitespace()).collect();
    let rest = line.strip_prefix('N')?;
    let digits = rest.bytes().take_while(u8::is_ascii_digit).count();
    let number_of: u32 = rest[..digits].parse().ok()?;
    let name = format!("N{number_of}");
    // another kind of data than parameters
    let other = |name| Some(Found { name, value: None, unit: None, text: String::new() });
    let Some(value) = rest[digits..].strip_prefix("Q1") else { return other(name) };
    let unit = match value.chars().next() {
        Some('M') => Some(LengthUnit::Mm),
        Some('I') => Some(LengthUnit::Inch),
        Some('P') => None,
        _ => return other(name),
    };
    Some(Found { name, value: number(&value[1..]), unit, text: value[1..].to_owned() })
}

/// A number in the control's spelling and no other: no `inf`, no `nan`, no hexadecimal.
fn number(text: &str) -> Option<f64> {
    let good = |b: u8| b.is_ascii_digit() || matches!(b, b'+' | b'-' | b'.' | b'E' | b'e');
    if text.is_empty() || !text.bytes().all(good) { None } else { text.parse().ok() }
}
