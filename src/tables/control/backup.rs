//! Old values from the user's own backup of the control: strict about what it needs, blind to the rest of the file.

use crate::diag::{Finding, Findings, Result, Source};
use crate::machine::Machine;
use crate::post::tables::{BackupForm, BackupKind, LengthUnit};
use crate::units::Plain;
use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;

/// Old values by the control's names.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Old {
    /// As the control holds them: in its unit, or in that which stands beside them.
    pub values: BTreeMap<String, (f64, Option<LengthUnit>)>,
    /// The numbers as they were spelled: a restoring file brings back these digits and no others.
    pub texts: BTreeMap<String, String>,
    /// In which lines they stand, from 1.
    pub lines: BTreeMap<String, usize>,
    /// Names of values that the backup itself marks as assumed: a restoring file of an export without the control's own.
    pub assumed: BTreeSet<String>,
    /// What was chosen among several: which channel, which path.
    pub said: Vec<String>,
}

impl Old {
    /// The one unit of these lengths; without a word beside them they are in `ours`.
    #[must_use]
    pub fn unit<'n>(&self, lengths: impl Iterator<Item = &'n String>, ours: LengthUnit) -> Option<LengthUnit> {
        let mut units = lengths.filter_map(|name| self.values.get(name)).map(|(_, unit)| unit.unwrap_or(ours));
        let first = units.next()?;
        units.all(|u| u == first).then_some(first)
    }

    /// Where a length stands that is not in `ours`, and in which unit.
    #[must_use]
    pub fn converted<'n>(&self, lengths: impl Iterator<Item = &'n String>, ours: LengthUnit) -> Option<String> {
        let other = |name: &'n String| {
            let unit = self.values.get(name)?.1.filter(|unit| *unit != ours)?;
            Some((self.lines.get(name).copied().unwrap_or_default(), name, unit))
        };
        // the first of the file
        let (line, name, unit) = lengths.filter_map(other).min_by_key(|(line, ..)| *line)?;
        let place = if line == 0 { String::new() } else { format!(" (line {line} of the backup)") };
        Some(format!("{name} is in {}{place}", unit.says()))
    }
}

/// A name without blanks, in capitals, a point in brackets as a comma: `$MC_X[0]` and `$mc_x[ 0 ]`, `$AN_CEC[0,1]` and
/// `$AN_CEC [0.1]` are one.
#[must_use]
pub fn plain_name(name: &str) -> String {
    let mut inside = false;
    let plain = |c: char| {
        inside = c == '[' || (inside && c != ']');
        if inside && c == '.' { ',' } else { c }
    };
    name.chars().filter(|c| !c.is_whitespace()).map(plain).flat_map(char::to_uppercase).collect()
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
    let mut section = None;
    // what is there for other channels or paths than the one that is written
    let mut others = Others::default();
    for (raw, number) in text.split_inclusive('\n').zip(1_usize..) {
        let line = raw.trim_end_matches(['\n', '\r']);
        let span = at..at + line.len();
        at += raw.len();
        if !line.trim().is_empty() {
            last = line.trim();
        }
        if let Some(begins) = section_line(line, form) {
            section = Some(begins);
            continue;
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
        others.seen.extend(found.paths.iter().copied());
        if let Some(of) = section.filter(|n| *n != form.section && !form.is_everywhere(known)) {
            others.sections.entry((*known).clone()).or_insert((of, span));
            continue;
        }
        match found.value {
            Read::Not => wrong(&mut findings, source, span, format!("{known} is no number here: {:?}", line.trim())),
            Read::Doubtful(why) => wrong(&mut findings, source, span, format!("{known}: {why}: {:?}", line.trim())),
            Read::OfPath(path) => {
                others.paths.entry((*known).clone()).or_insert((path, span));
            }
            Read::Number(value) => {
                old.texts.insert((*known).clone(), found.text);
                old.lines.insert((*known).clone(), number);
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
    others.say(form, source, &mut old, &mut findings);
    let end = text.len()..text.len();
    if let Some(ending) = &form.last_line
        && last != ending.as_str()
    {
        wrong(&mut findings, source, end.clone(), format!("the backup does not end with {ending:?}: it was cut off"));
    } else if old.values.is_empty() && findings.0.is_empty() {
        let first = if such_as.is_empty() { String::new() } else { format!(", such as {such_as}") };
        wrong(&mut findings, source, end, format!("none of the values that are to be changed stands in it{first}"));
    }
    Ok(findings.finish(old)?.0)
}

/// Values further than this beyond everything that the machine's description holds are no values of that machine, mm or deg.
const BEYOND: f64 = 2000.0;

/// Checks that every value can be one of this machine: a number that is metres beyond all of its coordinates was not read as it is
/// meant. `source`: the backup, where the values have lines.
///
/// # Errors
/// When one cannot: each with its line and the range.
pub fn within_reach(old: &Old, source: Option<&Source>, machine: &Machine) -> Result<()> {
    let largest = machine.largest_coordinate() + BEYOND;
    let mut findings = Findings::default();
    for (name, (value, _)) in old.values.iter().filter(|(_, (value, _))| !(-largest..=largest).contains(value)) {
        let finding = Finding::error(
            "export::backup_range",
            format!("{name} is {}, expected {} to {}", Plain(*value), Plain(-largest), Plain(largest)),
        )
        .help("compare the value with the control: no coordinate of this machine is as large");
        let line = old.lines.get(name).copied().unwrap_or_default();
        findings.push(match source.filter(|_| line > 0) {
            Some(source) => {
                let before: usize = source.inner().split_inclusive('\n').take(line - 1).map(str::len).sum();
                let length = source.inner()[before..].lines().next().map_or(0, str::len);
                finding.at(source, before..before + length)
            }
            None => finding,
        });
    }
    findings.finish(()).map(|_| ())
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
    value: Read,
    unit: Option<LengthUnit>,
    /// The number as it is spelled.
    text: String,
    /// Paths for which values stand in this line.
    paths: Vec<u32>,
}

/// What stands behind a name.
enum Read {
    Number(f64),
    /// Not a number.
    Not,
    /// Something that could mean two things: why.
    Doubtful(&'static str),
    /// Only of another path than the first.
    OfPath(u32),
}

/// Values of other channels or paths than the one that is written: by name, with the first of them and its place.
#[derive(Default)]
struct Others {
    sections: BTreeMap<String, (u32, Range<usize>)>,
    paths: BTreeMap<String, (u32, Range<usize>)>,
    /// All paths that were seen.
    seen: BTreeSet<u32>,
}

impl Others {
    /// Says which one is taken; what is there for another one only is refused.
    fn say(&self, form: &BackupForm, source: &Source, old: &mut Old, findings: &mut Findings) {
        let name = |n: u32| form.section_name(n);
        for (kind, of) in [("section", &self.sections), ("path", &self.paths)] {
            let is_path = kind == "path";
            let called = |n: u32| if is_path { format!("path {n} (L{n})") } else { name(n) };
            let ours = called(if is_path { 1 } else { form.section });
            if let Some((known, (n, span))) = of.iter().find(|(known, _)| !old.values.contains_key(*known)) {
                let says = format!("{known} stands in the backup for {} only, and {ours} is written", called(*n));
                wrong(findings, source, span.clone(), says);
            } else if !of.is_empty() {
                old.said.push(format!("the backup holds more than {ours}: the values of {ours} are taken"));
            }
        }
        if self.paths.is_empty() && self.seen.len() > 1 {
            old.said.push("the backup holds several paths: the values of path 1 (L1) are taken".to_owned());
        }
    }
}

/// `CHANDATA(2)`: the values behind it are of channel 2.
fn section_line(line: &str, form: &BackupForm) -> Option<u32> {
    let (before, after) = form.sections.as_ref()?.split_once("{n}")?;
    let line = if form.comment.is_empty() { line } else { line.split(form.comment.as_str()).next()? };
    plain_name(line).strip_prefix(before)?.strip_suffix(after)?.parse().ok()
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

/// `[N123] NAME = 1.25 ; remark`; numbers may be written `1.25EX-04`, and a checksum of the line may follow: `0.005 '2F34`.
fn assignment(line: &str, comment: &str) -> Option<Found> {
    let line = if comment.is_empty() { line } else { line.split(comment).next().unwrap_or("") };
    let (name, value) = line.split_once('=')?;
    let name = name.trim();
    let digits = |rest: &str| rest.bytes().take_while(u8::is_ascii_digit).count();
    let name = match name.strip_prefix(['N', 'n']).map(|rest| rest.split_at(digits(rest))) {
        Some((number, rest)) if !number.is_empty() && rest.starts_with(|c: char| c.is_whitespace() || c == '$') => rest,
        _ => name,
    };
    let value = value.trim();
    let is_sum = |sum: &str| !sum.is_empty() && sum.bytes().all(|b| b.is_ascii_hexdigit());
    let value = match value.split_once('\'') {
        Some((number, sum)) if !number.is_empty() && is_sum(sum.trim_end()) => number.trim_end(),
        _ => value,
    };
    let read = number(&value.replace("EX", "E")).map_or(Read::Not, Read::Number);
    Some(Found { name: plain_name(name), value: read, unit: None, text: value.to_owned(), paths: Vec::new() })
}

/// Letter and number of what it is of (path, axis), unit letter, number.
type WordValue<'a> = (Option<(char, u32)>, char, &'a str);

/// `N19703Q1M-0.0123;`, of a control with several paths `N19703Q1L1M-0.0123L2M0.0`, of an older one `N19703 P-0.0123`.
fn word(line: &str) -> Option<Found> {
    let line: String = line.trim().trim_end_matches(';').chars().filter(|c| !c.is_whitespace()).collect();
    let count = |rest: &str| rest.bytes().take_while(u8::is_ascii_digit).count();
    let rest = line.strip_prefix('N')?;
    let (digits, mut rest) = rest.split_at(count(rest));
    let name = format!("N{}", digits.parse::<u32>().ok()?);
    let mut found = Found { name, value: Read::Not, unit: None, text: String::new(), paths: Vec::new() };
    if let Some(data) = rest.strip_prefix('Q') {
        let (kind, behind) = data.split_at(count(data));
        // another kind of data than parameters
        if kind != "1" {
            return Some(found);
        }
        rest = behind;
    }
    let mut values: Vec<WordValue<'_>> = Vec::new();
    while let Some(letter) = rest.chars().next() {
        let mut index = None;
        if matches!(letter, 'L' | 'A' | 'S' | 'T') {
            let (digits, behind) = rest[1..].split_at(count(&rest[1..]));
            let Ok(number) = digits.parse() else { return Some(found) };
            index = Some((letter, number));
            rest = behind;
        }
        let Some(kind) = rest.chars().next().filter(|c| matches!(c, 'M' | 'I' | 'P')) else { return Some(found) };
        let end = rest[1..].find(|c: char| c.is_ascii_uppercase() && c != 'E').map_or(rest.len(), |at| at + 1);
        values.push((index, kind, &rest[1..end]));
        rest = &rest[end..];
    }
    let (kind, text) = match values[..] {
        [(None, kind, text)] => (kind, text),
        _ if !values.iter().all(|(index, ..)| index.is_some_and(|(letter, _)| letter == 'L')) => {
            found.value = Read::Doubtful("values by axis or spindle, or several: which one is meant is not known");
            return Some(found);
        }
        _ => {
            found.paths = values.iter().filter_map(|(index, ..)| index.map(|(_, n)| n)).collect();
            let mut ours = values.iter().filter(|(index, ..)| index.is_some_and(|(_, n)| n == 1));
            match (ours.next(), ours.next()) {
                (Some((_, kind, text)), None) => (*kind, *text),
                (None, _) => {
                    found.value = found.paths.first().map_or(Read::Not, |n| Read::OfPath(*n));
                    return Some(found);
                }
                _ => return Some(found),
            }
        }
    };
    found.unit = match kind {
        'M' => Some(LengthUnit::Mm),
        'I' => Some(LengthUnit::Inch),
        _ => None,
    };
    found.value = match number(text) {
        // P stands before whole numbers, too, which count something smaller
        Some(value) if kind == 'P' && value != 0.0 && !text.contains('.') => {
            Read::Doubtful("P and no decimal point: it may count the least increment")
        }
        Some(value) => Read::Number(value),
        None => Read::Not,
    };
    found.text = text.to_owned();
    Some(found)
}

/// A finite number in the control's spelling and no other: no `inf`, no `nan`, no hexadecimal.
fn number(text: &str) -> Option<f64> {
    let good = |b: u8| b.is_ascii_digit() || matches!(b, b'+' | b'-' | b'.' | b'E' | b'e');
    let value: Option<f64> = if text.is_empty() || !text.bytes().all(good) { None } else { text.parse().ok() };
    value.filter(|v| v.is_finite())
}
