//! Lines of a log: bytes between line ends of any kind, mixed too, with number and place. No allocation.

use crate::post::as_written::EndOfLine;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Line<'a> {
    /// From 1.
    pub number: usize,
    /// Offset of its first byte in the log.
    pub start: usize,
    /// Without its end.
    pub bytes: &'a [u8],
    /// What ends it; `None` for a last line without an end.
    pub end: Option<EndOfLine>,
}

impl Line<'_> {
    /// False for a last line without an end.
    #[must_use]
    pub fn ended(&self) -> bool {
        self.end.is_some()
    }
}

/// Iterator over the lines of a log.
#[derive(Debug, Clone)]
pub struct Lines<'a> {
    rest: &'a [u8],
    start: usize,
    number: usize,
}

impl<'a> Lines<'a> {
    /// Lines of `bytes`, whose first byte stands at `start` of the file.
    #[must_use]
    pub fn new(bytes: &'a [u8], start: usize) -> Self {
        Self { rest: bytes, start, number: 0 }
    }
}

/// The first line of `bytes`, what ends it, and how many bytes both take.
#[must_use]
pub fn first(bytes: &[u8]) -> (&[u8], Option<EndOfLine>, usize) {
    match memchr::memchr2(b'\n', b'\r', bytes) {
        None => (bytes, None, bytes.len()),
        Some(at) => {
            let (end, length) = line_end(&bytes[at..]).unwrap_or((EndOfLine::Lf, 1));
            (&bytes[..at], Some(end), at + length)
        }
    }
}

/// The line end with which `bytes` begin, and its length.
#[must_use]
pub fn line_end(bytes: &[u8]) -> Option<(EndOfLine, usize)> {
    match bytes {
        [b'\n', ..] => Some((EndOfLine::Lf, 1)),
        [b'\r', b'\n', ..] => Some((EndOfLine::Crlf, 2)),
        [b'\r', ..] => Some((EndOfLine::Cr, 1)),
        _ => None,
    }
}

impl<'a> Iterator for Lines<'a> {
    type Item = Line<'a>;

    fn next(&mut self) -> Option<Line<'a>> {
        if self.rest.is_empty() {
            return None;
        }
        let (bytes, end, used) = first(self.rest);
        self.number += 1;
        let line = Line { number: self.number, start: self.start, bytes, end };
        self.rest = &self.rest[used..];
        self.start += used;
        Some(line)
    }
}

/// Blanks and tabs.
pub fn blanks(mut input: &[u8]) -> &[u8] {
    while let [b' ' | b'\t', rest @ ..] = input {
        input = rest;
    }
    input
}

/// What a punch, a serial line or an old system puts around text: NUL, STX, ETX, EOT, DC1 to DC4, SUB, rub-out.
#[must_use]
pub fn is_tape(byte: u8) -> bool {
    matches!(byte, 0 | 2..=4 | 0x11..=0x14 | 0x1a | 0x7f)
}

/// Without such bytes, and blanks, at its end.
#[must_use]
pub fn without_trailer(line: &[u8]) -> &[u8] {
    // the common line has none: one look
    match line.last() {
        Some(last) if is_tape(*last) => {
            let kept = line.iter().rposition(|b| !is_tape(*b) && *b != b' ').map_or(0, |at| at + 1);
            &line[..kept]
        }
        _ => line,
    }
}

/// Without such bytes, blanks, and the byte order mark of a file that was put behind another one, at its beginning.
#[must_use]
pub fn without_leader(line: &[u8]) -> &[u8] {
    let leader = line.iter().position(|b| !matches!(b, b' ' | b'\t') && !is_tape(*b)).unwrap_or(line.len());
    let rest = &line[leader..];
    rest.strip_prefix(BYTE_ORDER_MARK).map_or(rest, without_leader)
}

/// What some editors put before a text.
pub const BYTE_ORDER_MARK: &[u8] = b"\xef\xbb\xbf";

/// How a run begins; the second where a control writes no blanks.
pub const HEADS: [&[u8]; 2] = [b"H AXISCAL ", b"HAXISCAL1"];

/// Where the head of a run begins in the middle of a line: the line end before it was lost.
#[must_use]
pub fn inner_head(line: &[u8]) -> Option<usize> {
    let leader = line.len() - without_leader(line).len();
    let rest = &line[(leader + 1).min(line.len())..];
    // the usual line of a touch holds no H
    memchr::memchr(b'H', rest)?;
    HEADS.iter().filter_map(|head| memchr::memmem::find(rest, head)).min().map(|at| leader + 1 + at)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn all(text: &[u8]) -> Vec<(usize, usize, &[u8], Option<EndOfLine>)> {
        Lines::new(text, 0).map(|l| (l.number, l.start, l.bytes, l.end)).collect()
    }

    #[test]
    fn every_kind_of_line_end_is_read() {
        let expected = |end| -> Vec<(usize, usize, &[u8], Option<EndOfLine>)> {
            vec![(1, 0, b"a", Some(end)), (2, 2, b"", Some(end)), (3, 3, b"b", None)]
        };
        assert_eq!(all(b"a\n\nb"), expected(EndOfLine::Lf));
        assert_eq!(all(b"a\r\rb"), expected(EndOfLine::Cr));
        let mixed: Vec<(usize, usize, &[u8], Option<EndOfLine>)> = vec![
            (1, 0, b"a", Some(EndOfLine::Crlf)),
            (2, 3, b"b", Some(EndOfLine::Cr)),
            (3, 5, b"c", Some(EndOfLine::Lf)),
        ];
        assert_eq!(all(b"a\r\nb\rc\n"), mixed);
        assert!(all(b"").is_empty());
    }

    #[test]
    fn what_a_punch_puts_around_a_line_is_taken_off() {
        assert_eq!(without_leader(without_trailer(b"\0\0\x7f P N1 \x14\0")), b"P N1");
        assert_eq!(without_trailer(b"\0\0"), b"");
        assert_eq!(without_trailer(b"P\0N1 "), b"P\0N1 ");
        assert_eq!(without_leader(b"\0\xef\xbb\xbf H"), b"H");
    }

    #[test]
    fn a_head_inside_a_line_is_found() {
        assert_eq!(inner_head(b"E N202H AXISCAL 1"), Some(6));
        assert_eq!(inner_head(b" \xef\xbb\xbfH AXISCAL 1"), None);
        assert_eq!(inner_head(b"H AXISCAL 1 FAH AXISCAL 1"), Some(14));
        assert_eq!(inner_head(b"EN202HAXISCAL1FANUC"), Some(5));
        assert_eq!(inner_head(b"HAXISCAL1FANUC"), None);
        assert_eq!(inner_head(b""), None);
    }
}
