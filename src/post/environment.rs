//! The language of the templates: filters and functions that spell this control.

use super::spelling::{CommentRule, NumberRule};
use minijinja::{Environment, State, UndefinedBehavior, context, syntax::SyntaxConfig};

/// A number without its sign.
fn unsigned(text: &str) -> &str {
    text.trim_start_matches(['+', '-'])
}

/// A number as a term of a sum: `+ 8` or `- 8`.
fn signed(text: &str, [plus, minus]: [&str; 2]) -> String {
    format!("{} {}", if text.starts_with('-') { minus } else { plus }, unsigned(text))
}

/// The templates' language: strict about unknown names, with the filters and functions that spell this control.
pub(super) fn environment(comment: &CommentRule, number: &NumberRule, line_length: usize) -> Environment<'static> {
    let mut env = Environment::new();
    // the delimiters are the default ones, so this cannot fail; the defaults would only leave more blank lines
    if let Ok(syntax) = SyntaxConfig::builder().trim_blocks(true).lstrip_blocks(true).build() {
        env.set_syntax(syntax);
    }
    env.set_undefined_behavior(UndefinedBehavior::Strict);
    env.set_auto_escape_callback(|_| minijinja::AutoEscape::None);
    let rule = comment.clone();
    env.add_filter("note", move |text: String| rule.note(&text));
    let rule = comment.clone();
    env.add_filter("clean", move |text: String| rule.clean(&text));
    let rule = number.clone();
    env.add_filter("length", move |text: String| -> Result<String, minijinja::Error> {
        text.trim().parse::<f64>().map(|mm| rule.length(mm)).map_err(|_| {
            let what = format!("`length` makes the control's number of a number of mm, {text:?} is none");
            minijinja::Error::new(minijinja::ErrorKind::InvalidOperation, what)
        })
    });
    env.add_filter("unsigned", |text: String| unsigned(&text).to_owned());
    env.add_filter("added", |text: String| signed(&text, ["+", "-"]));
    env.add_filter("taken", |text: String| signed(&text, ["-", "+"]));
    env.add_filter("words", |words: minijinja::Value| -> Result<String, minijinja::Error> {
        // a mistyped name would make a motion line without words: a move that is not made
        let words: Result<Vec<String>, _> =
            words.try_iter()?.map(|w| w.get_attr("word").map(|word| word.to_string())).collect();
        let words = words?;
        if words.is_empty() || words.iter().any(|w| w.is_empty() || w == "undefined") {
            let what = "`words` was given nothing: is the name before it mistyped, or the move empty?";
            return Err(minijinja::Error::new(minijinja::ErrorKind::InvalidOperation, what));
        }
        Ok(words.join(" "))
    });
    env.add_filter(
        "values",
        |words: minijinja::Value, before: String, behind: String| -> Result<String, minijinja::Error> {
            let one = |w: minijinja::Value| w.get_attr("value").map(|value| format!("{before}{value}{behind}"));
            let values: Vec<String> = words.try_iter()?.map(one).collect::<Result<_, _>>()?;
            // a mistyped name would leave arguments of a call away
            if values.is_empty() || values.iter().any(|v| v.contains("undefined")) {
                let what = "`values` was given nothing: is the name before it mistyped?";
                return Err(minijinja::Error::new(minijinja::ErrorKind::InvalidOperation, what));
            }
            Ok(values.join(" "))
        },
    );
    let rule = comment.clone();
    env.add_function("message", move |state: &State, text: String, value: Option<String>| {
        // `value` is the control's own expression: it must not be cleaned away
        let clean = rule.clean(&text);
        let parts = match (rule.message_width, &value) {
            (None, _) => vec![clean],
            // several messages, one after the other, rather than one that is cut
            (Some(width), None) => pieces(&clean, width),
            (Some(width), Some(_)) => vec![shortened(&clean, width)],
        };
        let template = state.env().get_template("message")?;
        let one = |mut clean: String| loop {
            let filled = match &value {
                Some(value) => clean.replace("{}", value),
                None => clean.clone(),
            };
            let line = template.render(context! { text => filled })?;
            let excess = line.lines().map(|l| l.chars().count().saturating_sub(line_length)).max().unwrap_or(0);
            if excess == 0 || clean.is_empty() {
                return Ok::<String, minijinja::Error>(line);
            }
            // a message that is too long loses its end rather than stopping the program's making
            let keep = clean.chars().count().saturating_sub(excess);
            clean = shortened(&clean, keep);
        };
        let messages: Vec<String> = parts.into_iter().map(one).collect::<Result<_, _>>()?;
        Ok::<String, minijinja::Error>(messages.iter().map(|m| m.trim_end_matches('\n')).collect::<Vec<_>>().join("\n"))
    });
    env
}

/// A text in pieces of at most so many characters, between words; a word that is longer is cut.
fn pieces(text: &str, width: usize) -> Vec<String> {
    let mut pieces = vec![String::new()];
    for word in text.split(' ').filter(|w| !w.is_empty()) {
        let word: Vec<char> = word.chars().collect();
        for part in word.chunks(width.max(1)) {
            match pieces.last_mut() {
                Some(piece) if piece.is_empty() => piece.extend(part),
                Some(piece) if piece.chars().count() + 1 + part.len() <= width => {
                    piece.push(' ');
                    piece.extend(part);
                }
                _ => pieces.push(part.iter().collect()),
            }
        }
    }
    pieces
}

/// The words of a text that find room in so many characters; where not even the first one does, its beginning.
fn shortened(text: &str, width: usize) -> String {
    let Some((end, next)) = text.char_indices().nth(width) else { return text.to_owned() };
    let kept = text.get(..end).unwrap_or(text);
    let words = if next == ' ' { Some(kept) } else { kept.rsplit_once(' ').map(|(words, _)| words) };
    words.unwrap_or(kept).trim_end_matches([' ', ',', ':']).to_owned()
}
