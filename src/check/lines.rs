//! What the grammars of all dialects share: lines with their places, numbers, and how a nom error becomes a finding.

use super::run::Fault;
use nom::{IResult, Parser};
use std::ops::Range;

/// What some editors put before a text.
pub const BYTE_ORDER_MARK: char = '\u{feff}';

/// A line without its end, and where it begins in the text.
#[derive(Debug, Clone, Copy)]
pub struct Line<'a> {
    /// Offset of its first byte.
    pub start: usize,
    /// Without LF or CR LF.
    pub text: &'a str,
}

impl<'a> Line<'a> {
    /// The place of a rest of the line, up to its end.
    pub fn rest(&self, rest: &str) -> Range<usize> {
        let begin = self.start + (self.text.len() - rest.len().min(self.text.len()));
        begin..self.start + self.text.len()
    }

    /// The place of the whole line.
    pub fn all(&self) -> Range<usize> {
        self.start..self.start + self.text.len()
    }

    /// A fault at a rest of the line.
    pub fn fault(&self, rest: &str, says: impl Into<String>) -> Fault {
        Fault { at: self.rest(rest), says: says.into() }
    }

    /// What nom could not read.
    pub fn unread(&self, error: &nom::Err<nom::error::Error<&'a str>>, what: &str) -> Fault {
        let rest = match error {
            nom::Err::Error(e) | nom::Err::Failure(e) => e.input,
            nom::Err::Incomplete(_) => "",
        };
        self.not_understood(rest, what)
    }

    /// Something that the dialect does not know.
    pub fn not_understood(&self, rest: &str, what: &str) -> Fault {
        let shown: String = rest.chars().take(24).collect();
        let says = if shown.is_empty() {
            format!("the line ends where {what} is expected")
        } else {
            format!("not understood: {shown:?}, {what} is expected")
        };
        self.fault(rest, says)
    }
}

/// The lines of a program, LF or CR LF.
pub fn lines(text: &str) -> impl Iterator<Item = Line<'_>> {
    let mut start = 0;
    text.split_inclusive('\n').map(move |whole| {
        let begin = start;
        start += whole.len();
        let line = whole.strip_suffix('\n').unwrap_or(whole);
        Line { start: begin, text: line.strip_suffix('\r').unwrap_or(line) }
    })
}

/// Where the first byte stands that no line of a program holds: a control character, or a CR without its LF.
pub fn control_byte(text: &str) -> Option<usize> {
    let bytes = text.as_bytes();
    let bad = |at: usize| match bytes[at] {
        b'\t' | b'\n' => false,
        b'\r' => bytes.get(at + 1) != Some(&b'\n'),
        byte => byte < b' ' || byte == 0x7f,
    };
    (0..bytes.len()).find(|at| bad(*at))
}

pub fn blanks(input: &str) -> IResult<&str, &str> {
    nom::bytes::complete::take_while(|c| c == ' ' || c == '\t').parse(input)
}

/// A number without exponent: value, and whether it has a decimal point.
pub fn number(input: &str) -> IResult<&str, (f64, bool)> {
    let digits = |s: &str| s.bytes().take_while(u8::is_ascii_digit).count();
    let bad = || nom::Err::Error(nom::error::Error::new(input, nom::error::ErrorKind::Float));
    let sign = usize::from(input.starts_with(['+', '-']));
    let whole = digits(&input[sign..]);
    let mut end = sign + whole;
    let point = input[end..].starts_with('.');
    if point {
        let decimals = digits(&input[end + 1..]);
        if whole + decimals == 0 {
            return Err(bad());
        }
        end += 1 + decimals;
    } else if whole == 0 {
        return Err(bad());
    }
    let (text, rest) = input.split_at(end);
    let value = text.parse().map_err(|_| bad())?;
    Ok((rest, (value, point)))
}

/// A number without a sign.
pub fn unsigned(input: &str) -> IResult<&str, (f64, bool)> {
    if input.starts_with(['+', '-']) {
        return Err(nom::Err::Error(nom::error::Error::new(input, nom::error::ErrorKind::Digit)));
    }
    number(input)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn control_bytes_are_found() {
        assert_eq!(control_byte("A\tB\r\nC\n"), None);
        for (text, at) in [("A\rB\n", 1), ("A\r", 1), ("\0", 0), ("AB\u{c}", 2), ("A\u{1a}", 1), ("A\r\r\n", 1)] {
            assert_eq!(control_byte(text), Some(at), "{text:?}");
        }
    }

    #[test]
    fn numbers_end_where_they_end() {
        assert_eq!(number("92.2"), Ok(("", (92.2, true))));
        assert_eq!(number("-1.X2"), Ok(("X2", (-1.0, true))));
        assert_eq!(number("+.5.5"), Ok((".5", (0.5, true))));
        assert_eq!(number("10 "), Ok((" ", (10.0, false))));
        for bad in ["", "-", ".", "X", "-.", "+-1"] {
            assert!(number(bad).is_err(), "{bad}");
        }
        assert!(unsigned("-1").is_err());
    }

    #[test]
    fn lines_know_where_they_begin() {
        let all: Vec<_> = lines("a\r\nbc\n\nd").map(|l| (l.start, l.text)).collect();
        assert_eq!(all, [(0, "a"), (3, "bc"), (6, ""), (7, "d")]);
    }
}
