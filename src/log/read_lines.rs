//! The lines of a log, read: touches, and everything else as events between them.
//!
//! A line that is not understood is only noted here: what is wrong with it is found out for the few that are shown.

use super::numbers::Fault;
use super::record::{LogHeader, Record, begin, record, row};
use super::text_lines::{BYTE_ORDER_MARK, HEADS, Line, Lines, blanks, inner_head, without_leader, without_trailer};
use super::touch::RawTouch;
use crate::post::as_written::EndOfLine;
use crate::post::{ColumnRule, LogRule};

/// What the lines of a log say.
#[derive(Debug, Default)]
pub struct ReadLines<'a> {
    /// In the order of the log.
    pub touches: Vec<RawTouch>,
    /// Everything else, in the order of the log.
    pub events: Vec<Event<'a>>,
    /// How many lines there are.
    pub lines: usize,
    /// Which kinds of line ends there are: LF, CR LF, CR.
    pub ends: [bool; 3],
}

/// A line that is no touch.
#[derive(Debug)]
pub struct Event<'a> {
    /// How many touches stand before it.
    pub at: usize,
    pub line: Line<'a>,
    pub kind: LineKind,
}

/// What kind of line it is, where it is no touch.
#[derive(Debug)]
pub enum LineKind {
    /// A run begins.
    Head(Box<LogHeader>),
    /// Where the artefact was found.
    Found([f64; 3]),
    /// A run has come to its end; number of touches of the plan.
    End(u64),
    /// Not understood, or the touch in it may be cut off.
    Fault,
}

/// How the lines of one log are read.
#[derive(Debug, Clone, Copy)]
pub struct Reader<'r> {
    /// Of the controller.
    pub rule: &'r LogRule,
    /// The log is nothing but columns.
    pub columns: Option<&'r ColumnRule>,
}

impl Reader<'_> {
    /// Reads a line by the grammar.
    ///
    /// # Errors
    /// When it is not understood as a whole, or it is the last one, has no end, and may be cut off in a number.
    pub fn line(&self, line: &Line<'_>) -> Result<Record, Fault> {
        let bytes = without_trailer(line.bytes);
        let record = match self.columns {
            Some(columns) => {
                row(bytes, line.number, columns, self.rule).map(|r| r.map_or(Record::Blank, Record::Touch))
            }
            None => record(bytes, line.number, self.rule),
        };
        match record {
            // without a check word a number that was cut may look whole
            Ok(Record::Touch(_)) if !line.ended() && (self.columns.is_some() || self.rule.check_word.is_none()) => {
                Err(Fault::at(bytes, &bytes[bytes.len()..], 1, "log::cut_line", "the last line has no end"))
            }
            Err(fault) => Err(no_text(bytes, line.start).unwrap_or(fault)),
            record => record,
        }
    }

    /// Could a line that is not understood have been a touch?
    pub fn may_be_touch(&self, line: &Line<'_>) -> bool {
        self.columns.is_some() || begin(line.bytes, self.rule).first().is_some_and(|b| b.eq_ignore_ascii_case(&b'P'))
    }

    /// Reads lines, the first of which begins at `start` of the log.
    pub fn read<'a>(&self, bytes: &'a [u8], start: usize) -> ReadLines<'a> {
        // lines of touches are some 60 bytes or longer
        let mut out = ReadLines { touches: Vec::with_capacity(bytes.len() / 60), ..ReadLines::default() };
        for mut line in Lines::new(bytes, start) {
            out.lines = line.number;
            line.end.into_iter().for_each(|e| out.ends[e as usize] = true);
            // two files put together without a line end between them: the head of the second begins a line of its own
            while self.columns.is_none()
                && let Some(head) = inner_head(line.bytes)
            {
                let before = self.without_prefix(&line.bytes[..head]);
                self.note(Line { bytes: before, end: None, ..line }, &mut out);
                line = Line { start: line.start + head, bytes: &line.bytes[head..], ..line };
            }
            self.note(line, &mut out);
        }
        out
    }

    fn note<'a>(&self, line: Line<'a>, out: &mut ReadLines<'a>) {
        let kind = match self.line(&line) {
            Ok(Record::Touch(touch)) => {
                out.touches.push(touch);
                None
            }
            Ok(Record::Head(head)) => Some(LineKind::Head(Box::new(head))),
            Ok(Record::Found(off)) => Some(LineKind::Found(off)),
            Ok(Record::End(count)) => Some(LineKind::End(count)),
            Ok(Record::Blank) => None,
            Err(_) => Some(LineKind::Fault),
        };
        let n_touches = out.touches.len();
        out.events.extend(kind.map(|kind| Event { at: n_touches, line, kind }));
    }

    /// What stands before a head in its line, without what belongs to the head.
    fn without_prefix<'a>(&self, before: &'a [u8]) -> &'a [u8] {
        let before = before.strip_suffix(self.rule.prefix.as_bytes()).unwrap_or(before);
        before.strip_suffix(BYTE_ORDER_MARK).unwrap_or(before)
    }

    /// Is this line, which is not understood, the head of a run?
    pub fn may_be_head(&self, line: &Line<'_>) -> bool {
        self.columns.is_none() && begin(line.bytes, self.rule).first().is_some_and(|b| b.eq_ignore_ascii_case(&b'H'))
    }
}

/// The log holds nothing but rows of this form: it begins with numbers and holds no line of words near its beginning; or it holds what
/// stands before the numbers of each row, and no head of a run.
#[must_use]
pub fn looks_like_columns(bytes: &[u8], columns: &ColumnRule) -> bool {
    if !columns.prefix.is_empty() {
        let holds = |what: &[u8]| memchr::memmem::find(bytes, what).is_some();
        return holds(columns.prefix.as_bytes()) && !HEADS.iter().any(|head| holds(head));
    }
    let firsts = Lines::new(bytes, 0).filter_map(|l| blanks(l.bytes).first().copied()).take(64);
    let mut numbers = 0;
    for first in firsts {
        match first {
            b'P' | b'H' | b'E' => return false,
            b'0'..=b'9' | b'-' | b'+' | b'.' | b',' => numbers += 1,
            _ => {}
        }
    }
    numbers > 0
}

/// The first byte of a line that is no text says more than what the grammar makes of it.
pub(super) fn no_text(line: &[u8], start: usize) -> Option<Fault> {
    // what a punch writes may stand before the words
    let words = without_leader(line);
    let at = line.len() - words.len() + words.iter().position(|b| !matches!(b, b'\t' | b' '..=b'~'))?;
    let message = format!("byte 0x{:02X} at offset {} of the file is no text", line[at], start + at);
    Some(Fault::at(line, &line[at..], 1, "log::no_text", message))
}

impl EndOfLine {
    /// How a person calls it.
    pub(super) fn says(self) -> &'static str {
        match self {
            Self::Lf => "LF",
            Self::Crlf => "CR LF, as Windows writes them",
            Self::Cr => "CR alone",
        }
    }
}
