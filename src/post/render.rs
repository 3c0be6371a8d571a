//! One template → text, and the text as the control takes it: lines, block numbers, line ends, names.

use super::Postprocessor;
use super::as_written::EndOfLine;
use crate::diag::{Failure, Result};
use minijinja::Value;

/// Does a line take a block number? Not the head or end of a file (`%`), and not an O-word.
pub(super) fn is_block(line: &str) -> bool {
    !line.starts_with(['%', 'O', 'o'])
}

impl Postprocessor {
    /// Whether a template, or a part of it, names labels; numbers are scarce on some controls, so only those take any.
    pub(super) fn uses_labels(&self, template: &str) -> bool {
        self.templates.get_template(template).is_ok_and(|t| {
            let text = t.source();
            let mut parts = text.split("{% include \"").skip(1).filter_map(|rest| rest.split_once('"'));
            text.contains("label") || parts.any(|(part, _)| part != template && self.uses_labels(part))
        })
    }

    /// Does the touch go on along the lift, so that no guarded move is written there?
    pub(super) fn touch_leaves(&self) -> bool {
        let touch = if self.touch_with_cycle { "cycle" } else { "touch" };
        self.templates.get_template(touch).is_ok_and(|t| t.source().contains("leaves"))
    }

    /// Does a template use this setting?
    pub(super) fn names_setting(&self, name: &str) -> bool {
        let whole = |rest: &str| !rest.starts_with(|c: char| c.is_alphanumeric() || c == '_');
        let uses = |text: &str| {
            // by a name that is made in the template it may be any
            text.contains("settings[")
                || text.split("settings.").skip(1).any(|t| t.strip_prefix(name).is_some_and(whole))
        };
        self.templates.templates().any(|(_, template)| uses(template.source()))
    }

    /// A name as the control takes it.
    pub(crate) fn nc_name(&self, name: &str) -> String {
        let (allowed, other) = &self.name_characters;
        let spelled = |c: char| if allowed.contains(c) { c.to_string() } else { other.clone() };
        name.to_ascii_uppercase().chars().map(spelled).collect()
    }

    /// The text with the control's line ends.
    pub(super) fn ended(&self, text: String) -> String {
        match self.end_of_line {
            EndOfLine::Lf => text,
            EndOfLine::Crlf => text.replace('\n', "\r\n"),
            EndOfLine::Cr => text.replace('\n', "\r"),
        }
    }

    /// Does a line stay in the program?
    pub(super) fn keeps(&self, line: &str) -> bool {
        self.blank_lines || !line.trim().is_empty()
    }

    /// The text with or without its empty lines, numbered where the control wants it.
    pub(super) fn lines(&self, text: &str) -> String {
        let kept = text.lines().filter(|line| self.keeps(line));
        let mut out = String::with_capacity(text.len());
        let mut index = 0;
        for line in kept {
            if let Some(rule) = self.block_numbers.as_ref().filter(|_| is_block(line)) {
                out.push_str(&rule.word.replace("{n}", &(rule.first + index * rule.step).to_string()));
                index += 1;
            }
            out.push_str(line);
            out.push('\n');
        }
        out
    }

    /// Renders one template; a failure names the template and its line.
    pub(super) fn render(&self, template: &str, context: Value) -> Result<String> {
        self.templates.get_template(template).and_then(|t| t.render(context)).map_err(|outer| {
            // an error in an included part stands behind the one that says which part
            let mut e = &outer;
            while let Some(inner) = std::error::Error::source(e).and_then(|s| s.downcast_ref::<minijinja::Error>()) {
                e = inner;
            }
            let template = e.name().unwrap_or(template);
            let line = e.line().map(|l| format!(", line {l}")).unwrap_or_default();
            let mut detail = e.detail().map_or_else(|| e.kind().to_string(), str::to_owned);
            if e.kind() == minijinja::ErrorKind::UndefinedError {
                detail = format!("a name is not known here ({detail})");
            }
            Failure::new("post::template", format!("controller {}: template {template}{line}: {detail}", self.name))
                .help("docs/guide/controllers.md lists what each template is given")
        })
    }
}
