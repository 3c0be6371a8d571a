//! Places in a log: from byte offsets to findings with line and column, without a copy of the log unless one is needed.

use crate::diag::{Finding, Source, source};
use std::cell::OnceCell;
use std::ops::Range;

/// A log's bytes and name; makes the text that findings point into when the first finding does.
#[derive(Debug)]
pub struct Places<'a> {
    bytes: &'a [u8],
    name: &'a str,
    text: OnceCell<Source>,
}

impl<'a> Places<'a> {
    /// Of a log.
    #[must_use]
    pub fn new(bytes: &'a [u8], name: &'a str) -> Self {
        Self { bytes, name, text: OnceCell::new() }
    }

    /// The log's name.
    #[must_use]
    pub fn name(&self) -> &str {
        self.name
    }

    /// A finding at a range of bytes.
    #[must_use]
    pub fn at(&self, finding: Finding, range: Range<usize>) -> Finding {
        finding.at(self.text(), range)
    }

    /// A finding at a whole line, counted from 1.
    #[must_use]
    pub fn at_line(&self, finding: Finding, line: usize) -> Finding {
        let text = self.text().inner();
        let start: usize = text.split_inclusive('\n').take(line.saturating_sub(1)).map(str::len).sum();
        let length = text[start..].find('\n').unwrap_or(text.len() - start);
        finding.at(self.text(), start..start + length)
    }

    /// The log as ASCII, byte for byte at the same offsets: what is not printable becomes `?`, a bare CR a line end.
    fn text(&self) -> &Source {
        self.text.get_or_init(|| {
            let mut text = String::with_capacity(self.bytes.len());
            for (i, byte) in self.bytes.iter().enumerate() {
                text.push(match byte {
                    b'\n' => '\n',
                    b'\r' if self.bytes.get(i + 1) == Some(&b'\n') => ' ',
                    b'\r' => '\n',
                    b'\t' | b' '..=b'~' => *byte as char,
                    _ => '?',
                });
            }
            source(self.name, text)
        })
    }
}

/// Findings of one kind: the first few in full, the rest counted.
#[derive(Debug)]
pub struct Capped {
    shown: Vec<Finding>,
    more: usize,
    limit: usize,
}

impl Default for Capped {
    fn default() -> Self {
        Self { shown: Vec::new(), more: 0, limit: 20 }
    }
}

impl Capped {
    /// For findings that come in floods and say the same: three are enough.
    #[must_use]
    pub fn few() -> Self {
        Self { limit: 3, ..Self::default() }
    }

    /// Adds one; `make` is called only when it will be shown.
    pub fn push(&mut self, make: impl FnOnce() -> Finding) {
        if self.shown.len() < self.limit {
            self.shown.push(make());
        } else {
            self.more += 1;
        }
    }

    /// How many there were.
    #[must_use]
    pub fn len(&self) -> usize {
        self.shown.len() + self.more
    }

    /// Those that are shown, and one that counts the rest.
    pub fn drain(self, what: &str, code: &'static str) -> Vec<Finding> {
        let mut findings = self.shown;
        if self.more > 0 {
            findings.push(Finding::warning(code, format!("and {} more {what}", self.more)));
        }
        findings
    }
}
