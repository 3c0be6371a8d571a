//! Programs that a program calls, in files of their own: read as one text, and what is found is told in its own file.

use crate::diag::{Finding, Source, source};
use crate::post::{DialectName, Postprocessor};
use std::ops::Range;

/// A program with those that it calls.
pub struct Whole {
    /// All of it, under the name of the program.
    pub source: Source,
    /// Where each file stands in it.
    files: Vec<(Range<usize>, Source)>,
}

impl Whole {
    /// The program, then the files of those that it calls, as far as they lie beside it.
    pub fn new(program: &Source, post: &Postprocessor, beside: &[(String, Source)]) -> Self {
        let wanted = wanted(program.inner(), post);
        let called: Vec<&Source> =
            wanted.iter().filter_map(|name| beside.iter().find(|(n, _)| n == name).map(|(_, file)| file)).collect();
        if called.is_empty() {
            return Self { source: program.clone(), files: Vec::new() };
        }
        let (mut text, mut files) = (String::new(), Vec::new());
        for file in std::iter::once(program).chain(called) {
            if !text.is_empty() && !text.ends_with('\n') {
                text.push('\n');
            }
            let start = text.len();
            text.push_str(file.inner());
            files.push((start..text.len(), file.clone()));
        }
        Self { source: source(program.name(), text), files }
    }

    /// Findings, each with its place in its own file.
    pub fn each_in_its_file(&self, findings: Vec<Finding>) -> Vec<Finding> {
        findings.into_iter().map(|finding| self.in_its_file(finding)).collect()
    }

    fn in_its_file(&self, mut finding: Finding) -> Finding {
        let Some(span) = finding.span.clone() else { return finding };
        let is_whole = finding.source.as_ref().is_some_and(|s| std::sync::Arc::ptr_eq(s, &self.source));
        // where one file ends the next begins
        let holds = |(range, _): &&(Range<usize>, Source)| span.start >= range.start;
        if let Some((range, file)) = self.files.iter().rev().find(holds).filter(|_| is_whole) {
            let of_file = |at: usize| at.saturating_sub(range.start).min(range.len());
            finding.span = Some(of_file(span.start)..of_file(span.end));
            finding.source = Some(file.clone());
        }
        finding
    }
}

/// The files of the programs that a program calls.
pub fn wanted(text: &str, post: &Postprocessor) -> Vec<String> {
    let Some(rule) = &post.check else { return Vec::new() };
    let Some(file) = &rule.called_file else { return Vec::new() };
    let text = text.to_ascii_uppercase();
    let begins = match rule.dialect {
        DialectName::MacroB => "G65 P",
        DialectName::Sinumerik => "EXTERN ",
        DialectName::Ngc | DialectName::Klartext => return Vec::new(),
    };
    let name = |line: &str| {
        let (_, rest) = line.split_once(begins)?;
        let end = rest.find(|c: char| !(c.is_ascii_alphanumeric() || c == '_')).unwrap_or(rest.len());
        let name = rest.get(..end).filter(|name| !name.is_empty())?;
        let described = rule.calls.iter().any(|call| call.program.to_string() == name);
        (!described).then(|| file.replace("{name}", name))
    };
    let mut names: Vec<String> = text.lines().filter_map(name).collect();
    names.sort_unstable();
    names.dedup();
    names
}
