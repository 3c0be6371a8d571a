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
    let wanted: BTreeMap<String, &String> = wanted.iter().map(|n| (plain_name(n), n)).collect();
    let (mut old, mut findings) = (Old::default(), Findings::default());
    let text = source.inner();
    let (mut at, mut last) = (0, "");
    for raw in text.split_inclusive('\n') {
        let line = raw.trim_end_matches(['\n', '\r']);
        let span = at..at + line.len();
        at += raw.len();
        if !line.trim().is_empty() {
            last = line.trim();
        }
        let found = match form.form {
            BackupKind::Assignments => assignment(line, &form.comment),
            BackupKind::Words => word(line),
        };
        let Some((name, value, unit)) = found else { continue };
        let Some(known) = wanted.get(&name) else { continue };
        match value.filter(|v| v.is_finite()) {
            None => wrong(&mut findings, source, span, format!("{known} is no number here: {:?}", line.trim())),
            Some(value) => {
                if let Some(before) = old.values.insert((*known).clone(), (value, unit)).filter(|b| *b != (value, unit))
                {
                    wrong(&mut findings, source, span, format!("{known} stands twice: {} and {value}", before.0));
                }
            }
        }
    }
    let end = text.len()..text.len();
    if let Some(ending) = &form.last_line
        && last != ending.as_str()
    {
        wrong(&mut findings, source, end.clone(), format!("the backup does not end with {ending:?}: it was cut off"));
    } else if old.values.is_empty() {
        let first = wanted.values().next().map_or(String::new(), |n| format!(", such as {n}"));
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

type Found = Option<(String, Option<f64>, Option<LengthUnit>)>;

/// `[N123] NAME = 1.25 ; remark`; numbers may be written `1.25EX-04`.
fn assignment(line: &str, comment: &str) -> Found {
    let line = if comment.is_empty() { line } else { line.split(comment).next().unwrap_or("") };
    let (name, value) = line.split_once('=')?;
    let name = name.trim();
    let name = match name.strip_prefix(['N', 'n']).and_then(|n| n.split_once(char::is_whitespace)) {
        Some((number, rest)) if number.bytes().all(|b| b.is_ascii_digit()) => rest,
        _ => name,
    };
    Some((plain_name(name), number(&value.trim().replace("EX", "E")), None))
}

/// `N19703Q1M-0.0123;`
fn word(line: &str) -> Found {
    let line: String = line.trim().trim_end_matches(';').chars().filter(|c| !c.is_whitespace()).collect();
    let rest = line.strip_prefix('N')?;
    let digits = rest.bytes().take_while(u8::is_ascii_digit).count();
    let number_of: u32 = rest[..digits].parse().ok()?;
    let name = format!("N{number_of}");
    // another kind of data than parameters
    let Some(value) = rest[digits..].strip_prefix("Q1") else { return Some((name, None, None)) };
    let unit = match value.chars().next() {
        Some('M') => Some(LengthUnit::Mm),
        Some('I') => Some(LengthUnit::Inch),
        Some('P') => None,
        _ => return Some((name, None, None)),
    };
    Some((name, number(&value[1..]), unit))
}

/// A number in the control's spelling and no other: no `inf`, no `nan`, no hexadecimal.
fn number(text: &str) -> Option<f64> {
    let good = |b: u8| b.is_ascii_digit() || matches!(b, b'+' | b'-' | b'.' | b'E' | b'e');
    if text.is_empty() || !text.bytes().all(good) { None } else { text.parse().ok() }
}
