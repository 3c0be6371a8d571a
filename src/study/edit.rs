//! Effects put into a study's text, or taken out of it: everything else stays byte for byte.
//!
//! The parser says where the list and its items stand; the text is changed there and read again. What is taken out after
//! it was put in leaves the very same bytes.

use super::Study;
use crate::diag::{Failure, Result, source};
use std::ops::Range;

/// The text with effects put at the end of `model.effects`.
///
/// # Errors
/// When the study cannot be read, or would not be read back as meant.
pub fn add(text: &str, ids: &[String]) -> Result<String> {
    ids.iter()
        .try_fold(text.to_owned(), |text, id| change(&text, |text, list| put(text, list, id), |e| e.push(id.clone())))
}

/// The text without effects in `model.effects`.
///
/// # Errors
/// When one is not there, when none would be left, or the study cannot be read.
pub fn remove(text: &str, ids: &[String]) -> Result<String> {
    ids.iter().try_fold(text.to_owned(), |text, id| {
        let at = effects(&text)?.iter().position(|e| e == id).ok_or_else(|| {
            Failure::new("study::not_in_model", format!("effect {id:?} is not in the model"))
                .help(format!("the model has: {}", effects(&text).unwrap_or_default().join(", ")))
        })?;
        if effects(&text)?.len() == 1 {
            return Err(Failure::new("study::last_effect", format!("{id:?} is the only effect of the model"))
                .help("a model without effects says nothing: add another one first"));
        }
        change(&text, |text, list| take(text, list, at), |e| drop(e.remove(at)))
    })
}

fn effects(text: &str) -> Result<Vec<String>> {
    Ok(Study::parse(&source("study.toml", text.to_owned()))?.0.effects)
}

/// Edits, and reads back whether the model is as meant and nothing else has changed.
fn change(
    text: &str,
    edit: impl FnOnce(&str, &List) -> String,
    meant: impl FnOnce(&mut Vec<String>),
) -> Result<String> {
    let mut expected = effects(text)?;
    meant(&mut expected);
    let list = List::find(text).ok_or_else(|| {
        Failure::new("study::no_list", "the list of effects was not found in the study")
            .help("write [model] and effects = [\"…\"] as `axiscal new` does")
    })?;
    let edited = edit(text, &list);
    match effects(&edited) {
        Ok(now) if now == expected => Ok(edited),
        _ => {
            Err(Failure::new("study::edit", "the study cannot be edited in place")
                .help("edit the list of effects by hand"))
        }
    }
}

/// Where the list and its items stand in the text.
struct List {
    whole: Range<usize>,
    items: Vec<Range<usize>>,
}

impl List {
    fn find(text: &str) -> Option<Self> {
        let doc = toml_edit::Document::parse(text).ok()?;
        let array = doc.as_table().get("model")?.get("effects")?.as_array()?;
        let items = array.iter().map(toml_edit::Value::span).collect::<Option<Vec<_>>>()?;
        Some(Self { whole: array.span()?, items })
    }

    /// Where the line of the last item ends, when the list has one item a line.
    fn end_of_last_line(&self, text: &str) -> Option<usize> {
        let last = self.items.last()?;
        let start = text[..last.start].rfind('\n')? + 1;
        let alone = start > self.whole.start && text[start..last.start].trim().is_empty();
        let newline = last.end + text[last.end..self.whole.end].find('\n')?;
        alone.then_some(newline)
    }
}

/// True when a comma stands behind an item; where.
fn comma(text: &str, from: usize) -> Option<usize> {
    let behind = &text[from..];
    let at = from + (behind.len() - behind.trim_start_matches([' ', '\t']).len());
    text[at..].starts_with(',').then_some(at)
}

fn put(text: &str, list: &List, id: &str) -> String {
    let word = format!("\"{id}\"");
    let Some(last) = list.items.last() else {
        let mut out = text.to_owned();
        out.insert_str(list.whole.start + 1, &word);
        return out;
    };
    let Some(newline) = list.end_of_last_line(text) else {
        let mut out = text.to_owned();
        out.insert_str(last.end, &format!(", {word}"));
        return out;
    };
    let start = text[..last.start].rfind('\n').map_or(0, |n| n + 1);
    let indent = &text[start..last.start];
    let with_comma = comma(text, last.end).is_some();
    let (end, line_end) = if text[..newline].ends_with('\r') { (newline - 1, "\r\n") } else { (newline, "\n") };
    let mut out = text[..last.end].to_owned();
    if !with_comma {
        out.push(',');
    }
    out += &text[last.end..end];
    out += &format!("{line_end}{indent}{word}{}", if with_comma { "," } else { "" });
    out += &text[end..];
    out
}

fn take(text: &str, list: &List, at: usize) -> String {
    let item = &list.items[at];
    let is_last = at + 1 == list.items.len();
    let start = text[..item.start].rfind('\n').map_or(0, |n| n + 1);
    let stop = text[item.end..list.whole.end].find('\n').map(|n| item.end + n + 1);
    let behind = comma(text, item.end).map_or(item.end, |c| c + 1);
    // a line of its own, but for a remark about it
    let alone = start > list.whole.start && text[start..item.start].trim().is_empty();
    if let Some(stop) = stop.filter(|s| {
        alone && {
            let rest = text[behind..*s].trim();
            rest.is_empty() || rest.starts_with('#')
        }
    }) {
        let mut out = text[..start].to_owned();
        if let Some(before) = list.items[..at].last().filter(|_| is_last && behind == item.end)
            && let Some(comma) = comma(text, before.end)
        {
            out.replace_range(comma..=comma, "");
        }
        return out + &text[stop..];
    }
    let gone = match (list.items[..at].last(), list.items.get(at + 1)) {
        (Some(before), _) => before.end..item.end,
        (None, Some(after)) => item.start..after.start,
        (None, None) => item.clone(),
    };
    format!("{}{}", &text[..gone.start], &text[gone.end..])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn study(list: &str) -> String {
        format!(
            "# mine\nmachine = \"m\"   # the old one\n\n[[data]]\nplan='p'\nlog=\"l\"\ncontroller=\"csv\"\n\n[model] # all\neffects = {list} # end\n\n[noise]\ntouch_um = 0.5\n"
        )
    }

    #[test]
    fn what_was_added_and_removed_leaves_the_same_bytes() {
        let lists = [
            "[\"a\"]",
            "[ \"a\", \"b\" ]",
            "[\"a\",\"b\",]",
            "['a', # why\n \"b\"]",
            "[\n  \"a\",\n  \"b\"\n]",
            "[\n  \"a\", # the first\n  \"b\", # the second\n  # and no more\n]",
            "[\n\t\"a\", # the first\n\t\"b\" # the second\n]",
            "[\n  \"a\", \"b\",\n  \"c\"]",
            "[\n  \"a\", \"b\",\n  \"c\", \"d\"\n]",
        ];
        let ids = ["x".to_owned(), "y".to_owned()];
        for list in lists {
            for text in [study(list), study(list).replace('\n', "\r\n")] {
                let added = add(&text, &ids).unwrap();
                assert_eq!(remove(&added, &["y".into(), "x".into()]).unwrap(), text, "{added}");
                assert_eq!(remove(&added, &ids).unwrap(), text, "{added}");
                assert!(added.contains("# end") && added.contains("# mine"));
            }
        }
    }

    #[test]
    fn a_list_of_lines_stays_one() {
        let added = add(&study("[\n  \"a\", # the first\n  \"b\", # the second\n]"), &["c".into()]).unwrap();
        assert!(added.contains("  \"a\", # the first\n  \"b\", # the second\n  \"c\",\n]"), "{added}");
        let added = add(&study("[\n  \"a\",\n  \"b\" # the second\n]"), &["c".into()]).unwrap();
        assert!(added.contains("  \"b\", # the second\n  \"c\"\n]"), "{added}");
    }

    #[test]
    fn what_is_in_the_middle_goes_with_its_line() {
        let gone = remove(&study("[\n  \"a\",\n  \"b\", # the second\n  \"c\"\n]"), &["b".into()]).unwrap();
        assert!(gone.contains("[\n  \"a\",\n  \"c\"\n]"), "{gone}");
        let gone = remove(&study("[\"a\", \"b\", \"c\"]"), &["a".into()]).unwrap();
        assert!(gone.contains("[\"b\", \"c\"]"), "{gone}");
    }

    #[test]
    fn the_last_effect_stays() {
        assert!(remove(&study("[\"a\"]"), &["a".into()]).unwrap_err().to_string().contains("only effect"));
        assert!(remove(&study("[\"a\"]"), &["z".into()]).unwrap_err().to_string().contains("not in the model"));
    }
}
