//! What went wrong, where, and what to do: findings about a file, many per run.
//!
//! Severities: *error* = unusable; *warning* = something that was written is not being used, or may not mean what was
//! intended; *info* = a default was taken. All findings of a file are reported at once. Only `cli` prints them.

use miette::{Diagnostic, LabeledSpan, SourceCode};
use std::{collections::BTreeMap, fmt, ops::Range, sync::Arc};

/// How bad a finding is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Severity {
    /// A default was taken.
    Info,
    /// Something that was written is not being used.
    Warning,
    /// Unusable.
    Error,
}

/// A text in which findings have their place: its name (path) and contents.
pub type Source = Arc<miette::NamedSource<String>>;

/// Makes a [`Source`].
#[must_use]
pub fn source(name: impl AsRef<str>, text: impl Into<String>) -> Source {
    Arc::new(miette::NamedSource::new(name, text.into()))
}

/// One finding: message, place, remedy.
#[derive(Debug, Clone)]
pub struct Finding {
    /// How bad it is.
    pub severity: Severity,
    /// Stable code, e.g. `machine::no_parent`.
    pub code: &'static str,
    /// What is wrong: expected and found, lower case, no full stop.
    pub message: String,
    pub help: Option<String>,
    /// The word of a file that it is about: its place is there, where it has none of its own.
    pub about: Option<String>,
    /// Byte range in the source.
    pub span: Option<Range<usize>>,
    /// The text that `span` points into.
    pub source: Option<Source>,
}

impl Finding {
    #[must_use]
    pub fn error(code: &'static str, message: impl Into<String>) -> Self {
        let message = message.into();
        Self { severity: Severity::Error, code, message, help: None, about: None, span: None, source: None }
    }

    #[must_use]
    pub fn warning(code: &'static str, message: impl Into<String>) -> Self {
        Self { severity: Severity::Warning, ..Self::error(code, message) }
    }

    /// A note on a default.
    #[must_use]
    pub fn info(code: &'static str, message: impl Into<String>) -> Self {
        Self { severity: Severity::Info, ..Self::error(code, message) }
    }

    /// With a remedy.
    #[must_use]
    pub fn help(mut self, help: impl Into<String>) -> Self {
        self.help = Some(help.into());
        self
    }

    /// With the word of a file that it is about.
    #[must_use]
    pub fn about(mut self, word: impl Into<String>) -> Self {
        self.about = Some(word.into());
        self
    }

    /// With its place.
    #[must_use]
    pub fn at(mut self, source: &Source, span: Range<usize>) -> Self {
        // a label past the end would make the printer fail instead of the reader understand
        let len = source.inner().len();
        self.span = Some(span.start.min(len)..span.end.min(len));
        self.source = Some(source.clone());
        self
    }

    /// `file:line:column`, 1-based, when the place is known.
    #[must_use]
    pub fn place(&self) -> Option<String> {
        let (source, span) = (self.source.as_ref()?, self.span.as_ref()?);
        let before = &source.inner().as_bytes()[..span.start];
        let line = before.iter().filter(|&&b| b == b'\n').count() + 1;
        let column = before.iter().rev().take_while(|&&b| b != b'\n').count() + 1;
        Some(format!("{}:{line}:{column}", source.name()))
    }
}

impl fmt::Display for Finding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some(place) = self.place() {
            write!(f, "{place}: ")?;
        }
        write!(f, "{}", self.message)
    }
}

impl std::error::Error for Finding {}

impl Diagnostic for Finding {
    fn code<'a>(&'a self) -> Option<Box<dyn fmt::Display + 'a>> {
        Some(Box::new(self.code))
    }
    fn severity(&self) -> Option<miette::Severity> {
        Some(match self.severity {
            Severity::Info => miette::Severity::Advice,
            Severity::Warning => miette::Severity::Warning,
            Severity::Error => miette::Severity::Error,
        })
    }
    fn help<'a>(&'a self) -> Option<Box<dyn fmt::Display + 'a>> {
        self.help.as_ref().map(|h| Box::new(h) as Box<dyn fmt::Display>)
    }
    fn source_code(&self) -> Option<&dyn SourceCode> {
        self.source.as_ref().map(|s| s.as_ref() as &dyn SourceCode)
    }
    fn labels(&self) -> Option<Box<dyn Iterator<Item = LabeledSpan> + '_>> {
        let span = self.span.clone()?;
        Some(Box::new(std::iter::once(LabeledSpan::new(Some("here".to_owned()), span.start, span.len()))))
    }
}

/// Why something is unusable: one or more findings, at least one of them an error.
#[derive(Debug, Clone, thiserror::Error)]
#[error("{}", .0.iter().find(|f| f.severity == Severity::Error).map_or_else(String::new, ToString::to_string))]
pub struct Failure(pub Vec<Finding>);

impl From<Finding> for Failure {
    fn from(finding: Finding) -> Self {
        Self(vec![finding])
    }
}

impl Failure {
    /// A failure of one error without a place.
    #[must_use]
    pub fn new(code: &'static str, message: impl Into<String>) -> Self {
        Finding::error(code, message).into()
    }

    /// With a remedy on its last finding.
    #[must_use]
    pub fn help(mut self, help: impl Into<String>) -> Self {
        if let Some(last) = self.0.last_mut() {
            last.help = Some(help.into());
        }
        self
    }
}

/// Result of everything that can find its input unusable.
pub type Result<T, E = Failure> = std::result::Result<T, E>;

/// Findings as they are collected.
#[derive(Debug, Clone, Default)]
pub struct Findings(pub Vec<Finding>);

impl Findings {
    /// Adds one.
    pub fn push(&mut self, finding: Finding) {
        self.0.push(finding);
    }

    /// True when at least one is an error.
    #[must_use]
    pub fn has_errors(&self) -> bool {
        self.0.iter().any(|f| f.severity == Severity::Error)
    }

    /// The value with the findings, or the failure when one of them is an error.
    ///
    /// # Errors
    /// When a finding is an error; all findings are in it.
    pub fn finish<T>(self, value: T) -> Result<(T, Self)> {
        if self.has_errors() { Err(Failure(self.0)) } else { Ok((value, self)) }
    }
}

/// Findings of one code that are shown at most: a person corrects these first.
pub const SHOWN: usize = 20;

/// What is shown of many findings: the first ones of each code, and for each code one that counts the others.
#[must_use]
pub fn shown(findings: &[Finding]) -> Vec<Finding> {
    let mut counts: BTreeMap<&str, usize> = BTreeMap::new();
    let mut out = Vec::new();
    for finding in findings {
        let count = counts.entry(finding.code).or_default();
        *count += 1;
        if *count <= SHOWN {
            out.push(finding.clone());
        }
    }
    let rest = counts.into_iter().filter(|(_, count)| *count > SHOWN);
    out.extend(rest.map(|(code, count)| {
        let message = match count - SHOWN {
            1 => format!("1 more finding of the kind {code} is not listed"),
            more => format!("{more} more findings of the kind {code} are not listed"),
        };
        let more = Finding::info("diag::more", message);
        match findings.iter().any(|f| f.code == code && f.severity == Severity::Error) {
            true => more.help("correct the listed ones and run the command again"),
            false => more,
        }
    }));
    out
}

/// Will no further finding of this code be shown? What costs time to say about it can be left out.
#[must_use]
pub fn enough(mut codes: impl Iterator<Item = &'static str>, code: &str) -> bool {
    codes.by_ref().filter(|known| *known == code).nth(SHOWN - 1).is_some()
}

/// A TOML error of the parser as a finding with its place.
#[must_use]
pub fn from_toml(error: &toml::de::Error, source: &Source, code: &'static str) -> Finding {
    let finding = Finding::error(code, error.message().to_owned());
    match error.span() {
        Some(span) => finding.at(source, span),
        None => finding.at(source, 0..0),
    }
}

/// A JSON error of the parser as a finding with its place.
#[must_use]
pub fn from_json(error: &serde_json::Error, source: &Source, code: &'static str) -> Finding {
    let text = source.inner();
    let line_start: usize = text.split_inclusive('\n').take(error.line().saturating_sub(1)).map(str::len).sum();
    let at = (line_start + error.column().saturating_sub(1)).min(text.len());
    Finding::error(code, error.to_string()).at(source, at..at)
}

/// Where a field of an entry of a list stands in a JSON text (`touches`, 3, `point`), or a field of the whole; the entry
/// where it has no such field. `None` where the text is not so.
#[must_use]
pub fn in_json(text: &str, entry: Option<(&str, usize)>, field: &str) -> Option<Range<usize>> {
    let whole = skip_blanks(text, 0);
    let Some((list, number)) = entry else { return json_member(text, whole, field) };
    let list = json_member(text, whole, list)?;
    let mut at = skip_blanks(text, list.start + 1);
    for _ in 0..number {
        at = skip_blanks(text, json_end(text, at)?);
        at = skip_blanks(text, at + 1);
    }
    if text.as_bytes().get(at) != Some(&b'{') {
        return None;
    }
    json_member(text, at, field).or_else(|| Some(at..json_end(text, at)?))
}

fn skip_blanks(text: &str, at: usize) -> usize {
    at + text.as_bytes().iter().skip(at).take_while(|b| b.is_ascii_whitespace()).count()
}

/// Where the value that begins at a place ends.
fn json_end(text: &str, at: usize) -> Option<usize> {
    let (mut depth, mut inside, mut escaped) = (0_usize, false, false);
    for (i, byte) in text.bytes().enumerate().skip(at) {
        match byte {
            _ if escaped => escaped = false,
            b'\\' if inside => escaped = true,
            b'"' => {
                inside = !inside;
                if !inside && depth == 0 {
                    return Some(i + 1);
                }
            }
            _ if inside => {}
            b'[' | b'{' => depth += 1,
            b']' | b'}' if depth > 0 => {
                depth -= 1;
                if depth == 0 {
                    return Some(i + 1);
                }
            }
            // behind a number or a word
            b',' | b']' | b'}' | b' ' | b'\n' | b'\r' | b'\t' if depth == 0 => return Some(i),
            _ => {}
        }
    }
    None
}

/// The value of a key of the object that begins at a place.
fn json_member(text: &str, at: usize, key: &str) -> Option<Range<usize>> {
    let mut at = skip_blanks(text, at + 1);
    while text.as_bytes().get(at) == Some(&b'"') {
        let end = json_end(text, at)?;
        let colon = skip_blanks(text, end);
        let value = skip_blanks(text, colon + 1);
        let behind = json_end(text, value)?;
        if text.get(at + 1..end - 1) == Some(key) {
            return Some(value..behind);
        }
        at = skip_blanks(text, skip_blanks(text, behind) + 1);
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_finding_names_line_and_column() {
        let src = source("m.toml", "a = 1\nbb = 2\n");
        let finding = Finding::error("t::t", "wrong").at(&src, 9..10);
        assert_eq!(finding.place().unwrap(), "m.toml:2:4");
        assert_eq!(finding.to_string(), "m.toml:2:4: wrong");
    }

    #[test]
    fn the_first_findings_of_a_code_are_shown_and_the_others_counted() {
        let many = |code, n| (0..n).map(move |i| Finding::error(code, format!("{i}")));
        let all: Vec<Finding> = many("t::many", 1000).chain(many("t::few", SHOWN)).collect();
        let shown = shown(&all);
        let count = |code| shown.iter().filter(|f| f.code == code).count();
        assert_eq!((count("t::many"), count("t::few"), count("diag::more")), (SHOWN, SHOWN, 1));
        assert_eq!(shown[SHOWN - 1].message, "19");
        let last = shown.last().unwrap();
        assert!(last.message.starts_with("980 more") && last.help.is_some(), "{last:?}");
        let codes = || all.iter().map(|f| f.code);
        assert!(enough(codes(), "t::few") && !enough(codes().take(SHOWN - 1), "t::many"));
    }

    #[test]
    fn a_field_of_a_list_has_its_place() {
        let text = r#"{ "name": "a \"touches\": [", "n": 1,
  "touches": [
    {"id":1,"point":[0,1,2],"pose":{"B":0}}, {"id":2, "point" : [3, 4, 5]} ] }"#;
        let at = |entry, field| in_json(text, entry, field).map(|span| &text[span]);
        assert_eq!(at(None, "n"), Some("1"));
        assert_eq!(at(Some(("touches", 0)), "pose"), Some(r#"{"B":0}"#));
        assert_eq!(at(Some(("touches", 1)), "point"), Some("[3, 4, 5]"));
        assert_eq!(at(Some(("touches", 1)), "end"), Some(r#"{"id":2, "point" : [3, 4, 5]}"#));
        assert_eq!(at(Some(("touches", 2)), "id"), None);
        assert_eq!(at(Some(("blocks", 0)), "name"), None);
        assert_eq!(in_json("", None, "a"), None);
    }

    #[test]
    fn a_place_past_the_end_is_kept_inside() {
        let src = source("m.toml", "a");
        assert_eq!(Finding::error("t::t", "wrong").at(&src, 5..9).place().unwrap(), "m.toml:1:2");
    }
}
