//! The usual line of a touch, read in one go: what [`super::record`] reads, for lines without anything unusual.
//!
//! Nothing is decided here: a line with anything that is not expected (a tab, a word that is not known, a sum that does
//! not fit, a last line without an end) is `None`, and the grammar has the word. A test compares the two on drawn lines.
//! Digits are read eight at a time, as one 64-bit word.

use super::lines::line_end;
use super::record::{off_sum, sum_room};
use super::touch::{RawTouch, Status};
use super::words::POWERS;
use crate::axes::{AxisName, Position};
use crate::post::LogRule;
use crate::post::as_written::EndOfLine;

/// What a letter means in a line of a touch.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Word {
    Axis(u8),
    Id,
    Status,
    Check,
    Time,
    None,
}

/// The rule of a log, made ready for reading many lines.
#[derive(Debug, Clone)]
pub struct Table {
    words: [Word; 256],
    decimals: Option<usize>,
    time_decimals: usize,
    modulo: Option<f64>,
    mark: u8,
    check: bool,
    room: [f64; 7],
    prefix: Vec<u8>,
}

impl Table {
    /// For a rule.
    #[must_use]
    pub fn new(rule: &LogRule) -> Self {
        let mut words = [Word::None; 256];
        for axis in AxisName::ALL {
            // six axes
            #[allow(clippy::cast_possible_truncation)]
            let index = axis.index() as u8;
            words[axis.letter() as usize & 0xff] = Word::Axis(index);
        }
        words[usize::from(b'N')] = Word::Id;
        words[usize::from(b'S')] = Word::Status;
        rule.check_word.iter().for_each(|w| words[usize::from(*w)] = Word::Check);
        rule.time_word.iter().for_each(|w| words[usize::from(*w)] = Word::Time);
        Self {
            words,
            decimals: rule.exact_decimals.then_some(rule.decimals),
            time_decimals: rule.time_decimals,
            modulo: rule.check_modulo,
            mark: rule.mark,
            check: rule.check_word.is_some(),
            room: std::array::from_fn(|n_axes| sum_room(rule, n_axes)),
            prefix: rule.prefix.as_bytes().to_vec(),
        }
    }
}

/// The touch of the line with which `bytes` begin, what ends the line, and how many bytes both take.
pub fn touch(bytes: &[u8], line_number: usize, table: &Table) -> Option<(RawTouch, EndOfLine, usize)> {
    let mut rest = bytes.strip_prefix(table.prefix.as_slice())?.strip_prefix(b"P")?;
    let mut position = Position::default();
    let mut present = [false; 6];
    let (mut id, mut status, mut check, mut time_s) = (None, None, None, None);
    let mut seen = 0u32;
    let mut sum = 0.0;
    let (end, length) = loop {
        let (&letter, after) = rest.split_first()?;
        match letter {
            b' ' => {
                rest = after;
                continue;
            }
            b'\n' | b'\r' => break line_end(rest)?,
            _ => {}
        }
        let word = table.words[usize::from(letter)];
        // capitals only, so that five bits tell the letters apart
        let bit = 1u32 << (letter & 31);
        if word == Word::None || seen & bit != 0 {
            return None;
        }
        seen |= bit;
        match word {
            Word::Axis(index) => {
                let (value, tail) = decimal(after, table)?;
                position.0[usize::from(index)] = value;
                present[usize::from(index)] = true;
                sum += value;
                rest = tail;
            }
            Word::Check => {
                let (value, tail) = decimal(after, table)?;
                check = Some(value);
                rest = tail;
            }
            Word::Id => {
                let (value, count, tail) = digits(blanks(after))?;
                if count == 0 || count == 8 {
                    return None;
                }
                id = Some(value);
                sum += value as f64;
                rest = tail;
            }
            Word::Status => {
                let (digit, tail) = after.split_first()?;
                status = Some(match digit {
                    b'1' => Status::Hit,
                    b'0' => Status::Miss,
                    _ => return None,
                });
                sum += f64::from(digit - b'0');
                rest = tail;
            }
            Word::Time => {
                let (value, tail) = time(after, table)?;
                time_s = Some(value);
                sum += value;
                rest = tail;
            }
            Word::None => return None,
        }
        if !matches!(rest.first()?, b' ' | b'\n' | b'\r' | b'A'..=b'Z') {
            return None;
        }
    };
    let n_axes = present.iter().filter(|p| **p).count();
    if !(present[0] && present[1] && present[2])
        || (table.check && off_sum(check? - sum, table.modulo) > table.room[n_axes])
    {
        return None;
    }
    let used = bytes.len() - rest.len() + length;
    let touch = RawTouch {
        id: Some(id?),
        position,
        present,
        status: status?,
        time_s,
        temperature_deg_c: None,
        line: line_number,
    };
    Some((touch, end, used))
}

fn blanks(mut rest: &[u8]) -> &[u8] {
    while let [b' ', after @ ..] = rest {
        rest = after;
    }
    rest
}

/// Up to eight digits, how many there are, and what follows. `None` near the end of the log.
#[inline]
fn digits(bytes: &[u8]) -> Option<(u64, usize, &[u8])> {
    const HIGH: u64 = 0x8080_8080_8080_8080;
    let (word, _) = bytes.split_first_chunk::<8>()?;
    let word = u64::from_le_bytes(*word);
    // a digit is 0x30 to 0x39: its high half is 3, and adding 6 to its low half does not reach 16
    let high_half = (word & 0xf0f0_f0f0_f0f0_f0f0) ^ 0x3030_3030_3030_3030;
    let low_half = ((word & 0x0f0f_0f0f_0f0f_0f0f) + 0x0606_0606_0606_0606) & 0x1010_1010_1010_1010;
    let other = high_half | low_half;
    // the high bit of every byte that is not zero, without a carry from one byte into the next
    let marks = (((other & !HIGH) + !HIGH) | other) & HIGH;
    let count = (marks.trailing_zeros() / 8) as usize;
    if count == 0 {
        return Some((0, 0, bytes));
    }
    // the digits at the end of the word, zeros before them; then pairs, fours and all eight at once
    let word = (word & 0x0f0f_0f0f_0f0f_0f0f) << (8 * (8 - count));
    let pairs = word * 10 + (word >> 8);
    let low = (pairs & 0x0000_00ff_0000_00ff).wrapping_mul(0x000f_4240_0000_0064);
    let high = ((pairs >> 16) & 0x0000_00ff_0000_00ff).wrapping_mul(0x0000_2710_0000_0001);
    Some((low.wrapping_add(high) >> 32, count, &bytes[count..]))
}

/// A number with a mark and as many decimals as the rule demands.
#[inline]
fn decimal<'a>(bytes: &'a [u8], table: &Table) -> Option<(f64, &'a [u8])> {
    let ((value, decimals), rest) = any_decimal(bytes, table.mark)?;
    table.decimals.is_none_or(|d| d == decimals).then_some((value, rest))
}

/// A time: with the decimals of its own, or with those of all other numbers.
#[inline]
fn time<'a>(bytes: &'a [u8], table: &Table) -> Option<(f64, &'a [u8])> {
    if table.time_decimals == 0 {
        let (value, count, rest) = digits(blanks(bytes))?;
        if count > 0 && count < 8 && rest.first() != Some(&table.mark) {
            return Some((value as f64, rest));
        }
    }
    let ((value, decimals), rest) = any_decimal(bytes, table.mark)?;
    let known = decimals == table.time_decimals || table.decimals.is_none_or(|d| d == decimals);
    known.then_some((value, rest))
}

/// A number with a mark and its count of decimals.
#[inline]
fn any_decimal(bytes: &[u8], mark: u8) -> Option<((f64, usize), &[u8])> {
    let mut rest = blanks(bytes);
    let negative = rest.first() == Some(&b'-');
    if negative {
        rest = blanks(&rest[1..]);
    }
    let (whole, whole_count, rest) = digits(rest)?;
    let (&point, rest) = rest.split_first()?;
    if point != mark || whole_count == 0 {
        return None;
    }
    let (fraction, count, rest) = digits(rest)?;
    // up to 15 digits are an exact double; with eight of them there may be a ninth
    if whole_count == 8 || count == 8 {
        return None;
    }
    const WHOLE: [u64; 8] = [1, 10, 100, 1_000, 10_000, 100_000, 1_000_000, 10_000_000];
    let value = (whole * WHOLE[count] + fraction) as f64 / POWERS[count];
    Some(((if negative { -value } else { value }, count), rest))
}
