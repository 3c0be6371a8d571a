//! Lines of a log: bytes between line ends of any kind, with number and place. No allocation.

use nom::bytes::complete::{take_till, take_until};
use nom::{IResult, Parser};

/// How the lines of a log end.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LineEnds {
    /// LF, also where some lines end with CR LF: the CR is taken off.
    Lf,
    /// CR alone.
    Cr,
}

/// One line.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Line<'a> {
    /// From 1.
    pub number: usize,
    /// Offset of its first byte in the log.
    pub start: usize,
    /// Without its end.
    pub bytes: &'a [u8],
    /// False for a last line without an end.
    pub ended: bool,
    /// It ended with CR LF.
    pub crlf: bool,
}

/// Iterator over the lines of a log.
#[derive(Debug, Clone)]
pub struct Lines<'a> {
    rest: &'a [u8],
    ends: LineEnds,
    start: usize,
    number: usize,
}

impl<'a> Lines<'a> {
    /// Lines of `bytes`, whose first byte stands at `start` of the file.
    #[must_use]
    pub fn new(bytes: &'a [u8], start: usize) -> Self {
        // a file without any LF that has CRs was written with CR alone
        let has = |byte: u8| until(byte, bytes).is_ok();
        let ends = if !has(b'\n') && has(b'\r') { LineEnds::Cr } else { LineEnds::Lf };
        Self { rest: bytes, ends, start, number: 0 }
    }

    /// How the lines end.
    #[must_use]
    pub fn ends(&self) -> LineEnds {
        self.ends
    }
}

fn until(byte: u8, bytes: &[u8]) -> IResult<&[u8], &[u8]> {
    // a one-byte pattern is searched with memchr
    take_until(&[byte][..]).parse(bytes)
}

impl<'a> Iterator for Lines<'a> {
    type Item = Line<'a>;

    fn next(&mut self) -> Option<Line<'a>> {
        if self.rest.is_empty() {
            return None;
        }
        let end = match self.ends {
            LineEnds::Lf => b'\n',
            LineEnds::Cr => b'\r',
        };
        let (mut bytes, consumed, ended) = match until(end, self.rest) {
            Ok((_, line)) => (line, line.len() + 1, true),
            Err(_) => (self.rest, self.rest.len(), false),
        };
        let crlf = self.ends == LineEnds::Lf && bytes.last() == Some(&b'\r');
        if crlf {
            bytes = &bytes[..bytes.len() - 1];
        }
        self.number += 1;
        let line = Line { number: self.number, start: self.start, bytes, ended, crlf };
        self.rest = &self.rest[consumed..];
        self.start += consumed;
        Some(line)
    }
}

/// Blanks and tabs.
pub fn blanks(input: &[u8]) -> &[u8] {
    let parsed: IResult<&[u8], &[u8]> = take_till(|b| b != b' ' && b != b'\t').parse(input);
    parsed.map_or(input, |(rest, _)| rest)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn all(text: &[u8]) -> Vec<(usize, usize, &[u8], bool)> {
        Lines::new(text, 0).map(|l| (l.number, l.start, l.bytes, l.ended)).collect()
    }

    #[test]
    fn every_kind_of_line_end_is_read() {
        let expected: Vec<(usize, usize, &[u8], bool)> =
            vec![(1, 0, b"a", true), (2, 2, b"", true), (3, 3, b"b", false)];
        assert_eq!(all(b"a\n\nb"), expected);
        assert_eq!(all(b"a\r\rb"), expected);
        assert_eq!(all(b"a\r\nb\r\n"), vec![(1, 0, &b"a"[..], true), (2, 3, &b"b"[..], true)]);
        assert!(all(b"").is_empty());
    }
}
