//! What the grammars of all dialects share: lines with their places, numbers, and how a nom error becomes a finding.

use super::run::Fault;
use nom::branch::alt;
use nom::bytes::complete::tag;
use nom::character::complete::{digit0, digit1, one_of};
use nom::combinator::{opt, recognize};
use nom::{IResult, Parser};
use std::ops::Range;

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

/// Blanks.
pub fn blanks(input: &str) -> IResult<&str, &str> {
    nom::bytes::complete::take_while(|c| c == ' ' || c == '\t').parse(input)
}

/// A number without exponent: value, and whether it has a decimal point.
pub fn number(input: &str) -> IResult<&str, (f64, bool)> {
    let (rest, text) = recognize((
        opt(one_of("+-")),
        alt((recognize((digit1, opt((tag("."), digit0)))), recognize((tag("."), digit1)))),
    ))
    .parse(input)?;
    // what the grammar lets through is a number
    let value = text.parse().map_err(|_| nom::Err::Error(nom::error::Error::new(input, nom::error::ErrorKind::Float)))?;
    Ok((rest, (value, text.contains('.'))))
}

/// A number without a sign.
pub fn unsigned(input: &str) -> IResult<&str, (f64, bool)> {
    if input.starts_with(['+', '-']) {
        return Err(nom::Err::Error(nom::error::Error::new(input, nom::error::ErrorKind::Digit)));
    }
    number(input)
}
