//! One line of a log → header, touch or end; or a row of columns. Driven by the postprocessor's data.

use super::numbers::{Fault, Number, number, whole};
use super::text_lines::{blanks, without_leader};
use super::touch::{RawTouch, Status};
use crate::axes::{AxisName, Position};
use crate::post::as_written::LengthUnit;
use crate::post::{ColumnRule, LogRule};
use nom::branch::alt;
use nom::bytes::complete::{tag, take_till1};
use nom::character::complete::space1;
use nom::combinator::{opt, value as is};
use nom::sequence::preceded;
use nom::{IResult, Parser};

/// What a line says.
#[derive(Debug, Clone, PartialEq)]
pub enum Record {
    /// A run begins.
    Head(LogHeader),
    Touch(RawTouch),
    /// Where an artefact was found that was put down by eye: how far off its place along X, Y and Z.
    Found([f64; 3]),
    /// A run has come to its end; number of touches of the plan.
    End(u64),
    /// Nothing.
    Blank,
}

/// The line with which a run begins.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct LogHeader {
    /// Controller, in capitals.
    pub controller: String,
    /// Machine, in capitals.
    pub machine: String,
    /// Program, in capitals.
    pub program: String,
    /// Of the plan.
    pub digest: String,
    /// Touches of the plan.
    pub touches: u64,
    /// What X, Y and Z are in; a head that does not say so means mm.
    pub unit: LengthUnit,
    pub says_unit: bool,
    /// The control writes no blanks: all three names stand in `controller`, one behind the other.
    pub written_together: bool,
    /// Set-up with which the run begins: 1, or where it was started again.
    pub setup: u64,
    /// Line in the log, from 1.
    pub line: usize,
}

impl LogHeader {
    /// Parts names that are written together, where they end with this machine and this program.
    pub(super) fn part(&mut self, machine: &str, program: &str) -> bool {
        let names = self.controller.strip_suffix(program).and_then(|names| names.strip_suffix(machine));
        let Some(controller) = names.filter(|_| self.written_together).map(str::to_owned) else { return false };
        (self.controller, self.machine, self.program) = (controller, machine.to_owned(), program.to_owned());
        true
    }

    /// What it names, for a message.
    pub(super) fn says(&self) -> String {
        match self.program.as_str() {
            "" => format!("{} (controller, machine and program)", self.controller),
            program => format!("program {program} on machine {}", self.machine),
        }
    }
}

/// Reads a line of words.
///
/// # Errors
/// When the line is not understood as a whole.
pub fn record(line: &[u8], line_number: usize, rule: &LogRule) -> Result<Record, Fault> {
    let begin = begin(line, rule);
    let Some((first, rest)) = begin.split_first() else { return Ok(Record::Blank) };
    match first {
        // the mark between which a punch writes, alone in its line
        b'%' if rest.is_empty() => Ok(Record::Blank),
        _ if rule.skip.iter().any(|s| without_leader(line).starts_with(s.as_bytes())) => Ok(Record::Blank),
        b'P' => touch(line, rest, line_number, rule).map(Record::Touch),
        b'H' => head(line, rest, line_number).map(Record::Head),
        b'F' => found(line, rest, rule).map(Record::Found),
        b'E' => end(line, rest).map(Record::End),
        _ => Err(Fault::at(
            line,
            begin,
            begin.len(),
            "log::not_understood",
            format!("{} is not a line of this log: a touch begins with P, a run with H, its end with E", show(begin)),
        )),
    }
}

/// Where the words of a line begin: behind blanks, what a punch writes, and what the control puts before each line.
pub fn begin<'a>(line: &'a [u8], rule: &LogRule) -> &'a [u8] {
    let begin = without_leader(line);
    if rule.prefix.is_empty() {
        return begin;
    }
    begin.strip_prefix(rule.prefix.as_bytes()).map_or(begin, blanks)
}

/// The touch that a line names which is not understood as a whole; the line may be damaged there too.
pub fn named(line: &[u8], rule: &LogRule) -> Option<u64> {
    let rest = begin(line, rule).strip_prefix(b"P")?;
    let at = rest.iter().position(|b| *b == b'N')?;
    let (tail, n) = number(b'.')(&rest[at + 1..]).ok()?;
    whole(n).filter(|_| tail.first().is_none_or(|b| *b == b' ' || *b == b'\t'))
}

/// A piece of a line for a message.
fn show(bytes: &[u8]) -> String {
    let shown: String =
        bytes.iter().take(40).map(|b| if (b' '..=b'~').contains(b) { *b as char } else { '?' }).collect();
    format!("{shown:?}{}", if bytes.len() > 40 { " ..." } else { "" })
}

fn touch(line: &[u8], mut rest: &[u8], line_number: usize, rule: &LogRule) -> Result<RawTouch, Fault> {
    let mut seen = [false; 256];
    let (mut id, mut status, mut check, mut time_s) = (None, None, None, None);
    let mut position = Position::default();
    let mut present = [false; 6];
    let mut sum = 0.0;
    loop {
        rest = blanks(rest);
        let Some((letter, after)) = rest.split_first() else { break };
        let word = rest;
        let axis = axis_of(*letter);
        let own = [rule.check_word, rule.time_word].contains(&Some(*letter));
        if axis.is_none() && !matches!(letter, b'N' | b'S') && !own {
            return Err(Fault::at(line, word, 1, "log::unknown_word", format!("unknown word {}", show(word))));
        }
        if std::mem::replace(&mut seen[usize::from(*letter)], true) {
            let message = format!("the word {} appears twice", *letter as char);
            return Err(Fault::at(line, word, 1, "log::word_twice", message));
        }
        let (tail, value) = value(line, after, rule)?;
        let width = word.len() - tail.len();
        if !tail.is_empty() && !matches!(tail[0], b' ' | b'\t' | b'A'..=b'Z') {
            let message = format!("expected a blank or the next word, found {}", show(tail));
            return Err(Fault::at(line, tail, 1, "log::in_number", message));
        }
        if let Some(axis) = axis {
            exact(line, word, width, value, rule)?;
            position.set(axis, value.value);
            present[axis.index()] = true;
            sum += value.value;
        } else if *letter == b'N' {
            let wrong = || Fault::at(line, word, width, "log::id", "the number of a touch is whole and not negative");
            id = Some(whole(value).ok_or_else(wrong)?);
            sum += value.value;
        } else if *letter == b'S' {
            sum += value.value;
            status = Some(match value.value {
                1.0 => Status::Hit,
                0.0 => Status::Miss,
                _ => return Err(Fault::at(line, word, width, "log::status", "status S is 1 (hit) or 0 (miss)")),
            });
        } else if Some(*letter) == rule.time_word {
            // any clock, any zero
            if value.decimals.unwrap_or(0) != rule.time_decimals {
                exact(line, word, width, value, rule)?;
            }
            time_s = Some(value.value);
            sum += value.value;
        } else {
            exact(line, word, width, value, rule)?;
            check = Some((value.value, word, width));
        }
        rest = tail;
    }
    let lacks =
        |what: &str| Fault::at(line, &line[line.len()..], 1, "log::cut_line", format!("the line ends without {what}"));
    let id = id.ok_or_else(|| lacks("the number N of its touch"))?;
    let status = status.ok_or_else(|| lacks("its status S"))?;
    for axis in [AxisName::X, AxisName::Y, AxisName::Z] {
        if !present[axis.index()] {
            return Err(lacks(&format!("{axis}")));
        }
    }
    if let Some(letter) = rule.check_word {
        let (check, word, width) = check.ok_or_else(|| lacks(&format!("its sum {}", letter as char)))?;
        if off_sum(check - sum, rule.check_modulo) > sum_room(rule, present.iter().filter(|p| **p).count()) {
            let message = format!("the numbers add up to {sum:.6}, the line says {check:.6}: it was damaged or edited");
            return Err(Fault::at(line, word, width, "log::sum", message));
        }
    }
    Ok(RawTouch { id: Some(id), position, present, status, time_s, temperature_deg_c: None, line: line_number })
}

/// `F X2.5 Y-1 Z0.3 K1.8`: where an artefact was found.
fn found(line: &[u8], mut rest: &[u8], rule: &LogRule) -> Result<[f64; 3], Fault> {
    let mut off = [0.0; 3];
    let mut sum = 0.0;
    let cut =
        |what: &str| Fault::at(line, &line[line.len()..], 1, "log::cut_line", format!("the line ends without {what}"));
    let mut word = |letter: u8| -> Result<f64, Fault> {
        rest = blanks(rest);
        let Some((_, after)) = rest.split_first().filter(|(first, _)| **first == letter) else {
            return Err(cut(&format!("{}", letter as char)));
        };
        let (tail, number) = value(line, after, rule)?;
        exact(line, rest, rest.len() - tail.len(), number, rule)?;
        rest = tail;
        Ok(number.value)
    };
    for (slot, letter) in off.iter_mut().zip(*b"XYZ") {
        *slot = word(letter)?;
        sum += *slot;
    }
    if let Some(letter) = rule.check_word {
        let check = word(letter)?;
        if off_sum(check - sum, rule.check_modulo) > sum_room(rule, off.len()) {
            let message = format!("the numbers add up to {sum:.6}, the line says {check:.6}: it was damaged or edited");
            return Err(Fault::at(line, line, line.len(), "log::sum", message));
        }
    }
    if blanks(rest).is_empty() {
        Ok(off)
    } else {
        Err(Fault::at(line, rest, 1, "log::unknown_word", format!("unknown word {}", show(rest))))
    }
}

/// Is a line of the log that which says where an artefact was found?
pub(crate) fn says_found(line: &str) -> bool {
    line.starts_with('F')
}

/// How far a sum is off the one that it should be; whole multiples of the modulo do not count.
fn off_sum(difference: f64, modulo: Option<f64>) -> f64 {
    modulo.map_or(difference, |m| difference - (difference / m).round() * m).abs()
}

/// How far the sum that a line gives may be from the sum of its numbers.
///
/// Every position, a time and the sum itself are rounded by at most half a digit; with a little room for the doubles.
fn sum_room(rule: &LogRule, n_axes: usize) -> f64 {
    let half = |decimals: usize| 0.505 * 10f64.powi(-i32::try_from(decimals).unwrap_or(0));
    // a control that counts whole ticks adds those that it writes: only digits behind the positions' own are rounded
    let time = if rule.time_word.is_some() { half(rule.decimals) } else { 0.0 };
    (n_axes as f64 + 1.0) * half(rule.decimals) + time + 1e-9
}

fn axis_of(letter: u8) -> Option<AxisName> {
    match letter {
        b'X' => Some(AxisName::X),
        b'Y' => Some(AxisName::Y),
        b'Z' => Some(AxisName::Z),
        b'A' => Some(AxisName::A),
        b'B' => Some(AxisName::B),
        b'C' => Some(AxisName::C),
        _ => None,
    }
}

/// A finite number, or the fault that says what stands there instead.
fn value<'a>(line: &[u8], at: &'a [u8], rule: &LogRule) -> Result<(&'a [u8], Number), Fault> {
    value_before(line, at, rule, b"")
}

/// The same where this text follows the number, which may be a comma. Empty: blanks.
fn value_before<'a>(line: &[u8], at: &'a [u8], rule: &LogRule, separator: &[u8]) -> Result<(&'a [u8], Number), Fault> {
    let fault = |code, message: String| Err(Fault::at(line, at, word_length(at), code, message));
    let shown = || show(&padded(at));
    match number(rule.mark)(at) {
        Ok((rest, n)) if n.value.is_finite() => {
            let other = if rule.mark == b',' { b'.' } else { b',' };
            if rest.first() == Some(&other) && separator.first() != Some(&other) {
                let mark = other as char;
                let what_to_do = match rule.other_mark {
                    None => format!(
                        "where a setting makes it write '{mark}', say other_decimal_mark = \"{mark}\" in [log] of its postprocessor file"
                    ),
                    Some(_) => "a log has one decimal mark, and its first touch has that one".to_owned(),
                };
                let message = format!(
                    "{} has the decimal mark '{mark}', this controller writes '{}'; {what_to_do}",
                    shown(),
                    rule.mark as char
                );
                return fault("log::decimal_mark", message);
            }
            Ok((rest, n))
        }
        Ok(_) => fault("log::not_a_number", format!("{} is too large", shown())),
        Err(_) => fault("log::not_a_number", format!("expected a number, found {}", shown())),
    }
}

/// A number without the blanks that fill its field before and behind its sign.
fn padded(at: &[u8]) -> Vec<u8> {
    let at = blanks(at);
    let (sign, digits) = at.split_at(usize::from(at.first().is_some_and(|b| matches!(b, b'+' | b'-'))));
    let digits = blanks(digits);
    [sign, &digits[..word_length(digits)]].concat()
}

/// Up to the next blank.
fn word_length(at: &[u8]) -> usize {
    at.iter().position(|b| *b == b' ' || *b == b'\t').unwrap_or(at.len())
}

/// A number with another count of decimals than the controller writes was cut or edited.
fn exact(line: &[u8], word: &[u8], width: usize, n: Number, rule: &LogRule) -> Result<(), Fault> {
    let found = n.decimals.unwrap_or(0);
    if rule.exact_decimals && found != rule.decimals {
        let message = format!(
            "{} has {found} decimals, this controller writes {}: the line was cut or edited",
            show(&word[..width]),
            rule.decimals
        );
        return Err(Fault::at(line, word, width, "log::decimals", message));
    }
    Ok(())
}

fn end(line: &[u8], rest: &[u8]) -> Result<u64, Fault> {
    let begin = blanks(rest);
    begin
        .strip_prefix(b"N")
        .and_then(|digits| number(b'.')(digits).ok())
        .filter(|(tail, _)| blanks(tail).is_empty())
        .and_then(|(_, n)| whole(n))
        .ok_or_else(|| {
            Fault::at(line, begin, begin.len(), "log::end", "the end of a run is `E N` and the count of touches")
        })
}

/// What stands behind the H of a head.
const MARK: &[u8] = b"AXISCAL";

/// Digits of a plan's digest.
const DIGEST: usize = 12;

fn head(line: &[u8], rest: &[u8], line_number: usize) -> Result<LogHeader, Fault> {
    let fault = |message: &str| Fault::at(line, rest, rest.len(), "log::head", message);
    let form = "the head of a run is `H AXISCAL 1 controller machine program digest MM N touches U set-up`";
    if !rest.is_ascii() {
        return Err(fault("the head of a run holds characters that are not ASCII"));
    }
    if rest.starts_with(MARK) {
        return head_without_blanks(rest, line_number).ok_or_else(|| fault(form));
    }
    let word =
        |input| -> IResult<&[u8], &[u8]> { preceded(space1, take_till1(|b: u8| b == b' ' || b == b'\t')).parse(input) };
    let mut words = (word, word, word, word, word, word);
    let (tail, (mark, version, controller, machine, program, digest)) = words.parse(rest).map_err(|_| fault(form))?;
    if digest.len() != DIGEST || !digest.iter().all(u8::is_ascii_hexdigit) {
        return Err(fault(form));
    }
    if mark != MARK || version != crate::post::LOG_VERSION.to_string().as_bytes() {
        return Err(fault("this is not the head of a log of this version of axiscal"));
    }
    let unit = alt((is(LengthUnit::Inch, tag(&b"INCH"[..])), is(LengthUnit::Mm, tag(&b"MM"[..]))));
    let unit: IResult<&[u8], Option<LengthUnit>> = opt(preceded(space1, unit)).parse(tail);
    let (tail, unit) = unit.unwrap_or((tail, None));
    let text = |word: &[u8]| String::from_utf8_lossy(word).into_owned();
    let (touches, setup) = counts(tail).ok_or_else(|| {
        Fault::at(
            line,
            tail,
            tail.len(),
            "log::head",
            "the head of a run ends with its unit MM or INCH, N and the count of touches, U and the first set-up",
        )
    })?;
    Ok(LogHeader {
        controller: text(controller),
        machine: text(machine),
        program: text(program),
        digest: text(digest),
        unit: unit.unwrap_or_default(),
        says_unit: unit.is_some(),
        written_together: false,
        touches,
        setup,
        line: line_number,
    })
}

/// `N202 U1`, the end of a head. A control may pad these numbers, and write them with a mark.
fn counts(tail: &[u8]) -> Option<(u64, u64)> {
    let count = |input: &[u8], letter: u8| -> Option<(usize, u64)> {
        let digits = blanks(input).strip_prefix(&[letter])?;
        let (after, n) = number(b'.')(digits).ok()?;
        Some((after.len(), whole(n)?))
    };
    let (left, touches) = count(tail, b'N')?;
    let tail = &tail[tail.len() - left..];
    let (left, setup) = count(tail, b'U')?;
    blanks(&tail[tail.len() - left..]).is_empty().then_some((touches, setup))
}

/// `AXISCAL1FANUCSWIVEL-HEADHEAD979A8518119DMMN202U1`: read from its end, for names may end and begin with anything.
fn head_without_blanks(rest: &[u8], line_number: usize) -> Option<LogHeader> {
    let text = std::str::from_utf8(rest).ok()?.strip_prefix("AXISCAL")?;
    let text = text.strip_prefix(&crate::post::LOG_VERSION.to_string())?;
    let (before, tail) = text.split_at_checked(text.rfind('N')?)?;
    let (touches, setup) = counts(tail.as_bytes())?;
    let units = [(LengthUnit::Inch, "INCH"), (LengthUnit::Mm, "MM")];
    let unit = units.into_iter().find_map(|(unit, word)| Some((unit, before.strip_suffix(word)?)));
    let (unit, before) = unit.map_or((None, before), |(unit, before)| (Some(unit), before));
    let (names, digest) = before.split_at_checked(before.len().checked_sub(DIGEST)?)?;
    let good = !names.is_empty() && !names.contains([' ', '\t']) && digest.bytes().all(|b| b.is_ascii_hexdigit());
    good.then(|| LogHeader {
        controller: names.to_owned(),
        machine: String::new(),
        program: String::new(),
        digest: digest.to_owned(),
        unit: unit.unwrap_or_default(),
        says_unit: unit.is_some(),
        written_together: true,
        touches,
        setup,
        line: line_number,
    })
}

/// Reads a row of columns: a touch without a number, hit for all that the row says. `None` for a line that is no row: a blank one, or
/// one without what stands before the numbers of each row.
///
/// # Errors
/// When the line is not such a row.
pub fn row(line: &[u8], line_number: usize, columns: &ColumnRule, rule: &LogRule) -> Result<Option<RawTouch>, Fault> {
    let mut rest = without_leader(line);
    if rest.is_empty() || rest == b"%" {
        return Ok(None);
    }
    if !columns.prefix.is_empty() {
        let prefix = columns.prefix.as_bytes();
        let Some(at) = memchr::memmem::find(rest, prefix) else { return Ok(None) };
        rest = blanks(&rest[at + prefix.len()..]);
    }
    let exact_rule = LogRule { decimals: columns.decimals, ..rule.clone() };
    let separator = columns.separator.as_bytes();
    let mut position = Position::default();
    let mut present = [false; 6];
    for (index, axis) in columns.axes.iter().enumerate() {
        if rest.is_empty() {
            let message = format!("{index} numbers, expected {}: the line was cut", columns.axes.len());
            return Err(Fault::at(line, rest, 1, "log::cut_line", message));
        }
        let (tail, n) = value_before(line, rest, rule, separator)?;
        let width = rest.len() - tail.len();
        let after = blanks(tail);
        let last = index + 1 == columns.axes.len();
        let between = match separator {
            [] if last && columns.has_tail() => Some(after),
            [] => (after.is_empty() || after.len() < tail.len()).then_some(after),
            _ if last || after.is_empty() => Some(after),
            _ => after.strip_prefix(separator).map(blanks),
        };
        let Some(between) = between else {
            let wanted = if separator.is_empty() { "a blank".to_owned() } else { format!("{:?}", columns.separator) };
            let message = format!("expected {wanted} after the number, found {}", show(tail));
            return Err(Fault::at(line, tail, 1, "log::in_number", message));
        };
        exact(line, rest, width, n, &exact_rule)?;
        if let Some(axis) = axis {
            position.set(*axis, n.value);
            present[axis.index()] = true;
        }
        rest = between;
    }
    let (rest, status) = row_status(line, rest, columns)?;
    match columns.suffix.as_bytes() {
        [] if rest.is_empty() => {}
        [] => {
            let message = format!("more than {} numbers: {}", columns.axes.len(), show(rest));
            return Err(Fault::at(line, rest, rest.len(), "log::too_long", message));
        }
        suffix if rest.starts_with(suffix) => {}
        _ => {
            let (code, found) = match rest {
                [] => ("log::cut_line", "the line was cut".to_owned()),
                _ => ("log::too_long", format!("found {}", show(rest))),
            };
            let message = format!("expected {:?} behind the {} numbers: {found}", columns.suffix, columns.axes.len());
            return Err(Fault::at(line, rest, rest.len(), code, message));
        }
    }
    Ok(Some(RawTouch { id: None, position, present, status, time_s: None, temperature_deg_c: None, line: line_number }))
}

/// Whether the probe triggered, where a row says so behind its numbers, and what follows.
fn row_status<'a>(line: &[u8], rest: &'a [u8], columns: &ColumnRule) -> Result<(&'a [u8], Status), Fault> {
    if columns.status.is_empty() {
        return Ok((rest, Status::Hit));
    }
    let says = rest.strip_prefix(columns.status.as_bytes()).map(blanks).and_then(<[u8]>::split_first);
    match says {
        Some((b'1', after)) => Ok((blanks(after), Status::Hit)),
        Some((b'0', after)) => Ok((blanks(after), Status::Miss)),
        _ => {
            let message = format!(
                "expected {:?} and 1 (triggered) or 0 behind the numbers, found {}",
                columns.status,
                show(rest)
            );
            Err(Fault::at(line, rest, rest.len(), "log::status", message))
        }
    }
}
