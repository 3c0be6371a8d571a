//! One line of inspection results.

use super::PointsForm;
use crate::log::numbers::{Fault, number, whole};
use crate::log::text_lines::{blanks, without_leader};
use nalgebra::Vector3;

/// What a line says.
#[derive(Debug, Clone, PartialEq)]
pub enum Record {
    /// Nothing, a remark, or a line that is no part of the points.
    Blank,
    /// A block begins.
    Begin,
    /// A block ends.
    End,
    /// A, B, C, deg.
    Orientation([f64; 3]),
    /// A point of the surface and its normal.
    Nominal { number: u64, point: Vector3<f64>, normal: Vector3<f64> },
    /// The ball's centre at the contact.
    Centre { number: u64, point: Vector3<f64>, radius: f64 },
}

/// Reads a line.
///
/// # Errors
/// When it is not understood as a whole.
pub fn record(line: &[u8], form: &PointsForm) -> Result<Record, Fault> {
    let line = match find(line, form.remark.as_bytes()) {
        Some(at) => &line[..at],
        None => line,
    };
    let begin = without_leader(line);
    if begin.is_empty() || begin.iter().all(u8::is_ascii_whitespace) {
        return Ok(Record::Blank);
    }
    let length = begin.iter().position(|b| matches!(b, b' ' | b'\t')).unwrap_or(begin.len());
    let (first, rest) = begin.split_at(length);
    let alone = |record| match blanks(rest) {
        [] => Ok(record),
        more => Err(Fault::at(line, more, more.len(), "log::too_long", "something stands behind this word")),
    };
    let is = |word: &str| first == word.as_bytes();
    if form.skip.iter().any(|s| is(s)) {
        return Ok(Record::Blank);
    }
    if is(&form.begin) {
        return alone(Record::Begin);
    }
    if is(&form.end) {
        return alone(Record::End);
    }
    if is(&form.orientation) {
        let words = words(line, rest, b"NABCXYZIR", form)?;
        let [a, b, c] = words.all(line, b"ABC")?;
        return Ok(Record::Orientation([a, b, c]));
    }
    if is(&form.nominal) {
        let words = words(line, rest, b"NXYZIJKOUL", form)?;
        let normal = Vector3::from(words.all(line, b"IJK")?);
        // four decimals, and a normal of length 1
        if (normal.norm() - 1.0).abs() > 0.01 {
            let message = format!("the normal I J K has the length {:.4}, expected 1", normal.norm());
            return Err(Fault::at(line, rest, rest.len(), "log::normal", message));
        }
        return Ok(Record::Nominal {
            number: words.number(line)?,
            point: Vector3::from(words.all(line, b"XYZ")?),
            normal,
        });
    }
    if is(&form.centre) {
        let words = words(line, rest, b"NXYZR", form)?;
        let [radius] = words.all(line, b"R")?;
        return Ok(Record::Centre {
            number: words.number(line)?,
            point: Vector3::from(words.all(line, b"XYZ")?),
            radius,
        });
    }
    let message = format!(
        "not a line of this file: {}, {}, {}, {} or {} is expected",
        form.begin, form.orientation, form.nominal, form.centre, form.end
    );
    Err(Fault::at(line, begin, begin.len(), "log::not_understood", message))
}

/// Numbers by letter.
struct Words([Option<f64>; 26]);

impl Words {
    fn all<const N: usize>(&self, line: &[u8], letters: &[u8; N]) -> Result<[f64; N], Fault> {
        let mut out = [0.0; N];
        for (slot, letter) in out.iter_mut().zip(letters) {
            *slot = self.0[usize::from(letter - b'A')].ok_or_else(|| {
                let message = format!("the line ends without its word {}", *letter as char);
                Fault::at(line, &line[line.len()..], 1, "log::cut_line", message)
            })?;
        }
        Ok(out)
    }

    fn number(&self, line: &[u8]) -> Result<u64, Fault> {
        let [value] = self.all(line, b"N")?;
        let number = crate::log::numbers::Number { value, decimals: None };
        whole(number).ok_or_else(|| {
            Fault::at(line, line, line.len(), "log::id", "the number of a point is whole and not negative")
        })
    }
}

fn words(line: &[u8], mut rest: &[u8], known: &[u8], form: &PointsForm) -> Result<Words, Fault> {
    let mut out = Words([None; 26]);
    loop {
        rest = blanks(rest);
        let Some((letter, after)) = rest.split_first() else { return Ok(out) };
        if !known.contains(letter) {
            let message = format!("a word that this line does not have: {}", shown(rest));
            return Err(Fault::at(line, rest, 1, "log::unknown_word", message));
        }
        let slot = &mut out.0[usize::from(letter - b'A')];
        if slot.is_some() {
            let message = format!("the word {} appears twice", *letter as char);
            return Err(Fault::at(line, rest, 1, "log::word_twice", message));
        }
        let Some((tail, n)) = number(form.mark)(after).ok().filter(|(_, n)| n.value.is_finite()) else {
            let message = format!("expected a number, found {}", shown(after));
            return Err(Fault::at(line, after, 1, "log::not_a_number", message));
        };
        if !tail.is_empty() && !matches!(tail[0], b' ' | b'\t' | b'A'..=b'Z') {
            let message = format!("expected a blank or the next word, found {}", shown(tail));
            return Err(Fault::at(line, tail, 1, "log::in_number", message));
        }
        *slot = Some(n.value);
        rest = tail;
    }
}

fn shown(bytes: &[u8]) -> String {
    let text: String =
        bytes.iter().take(20).map(|b| if (b' '..=b'~').contains(b) { *b as char } else { '?' }).collect();
    format!("{text:?}")
}

fn find(line: &[u8], what: &[u8]) -> Option<usize> {
    (!what.is_empty()).then(|| line.windows(what.len()).position(|w| w == what)).flatten()
}
