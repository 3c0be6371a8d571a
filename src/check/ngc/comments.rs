//! Comments: remarks, and those on which the control acts (LinuxCNC 2.9 manual, chapter 11.4).
//!
//! The control acts on the last comment of a line only: `(LOG,one)(A)` logs nothing.

use super::parse::parameter;
use crate::check::code::{Instruction, Piece, Text};
use crate::check::lines::{Line, blanks};
use crate::check::run::Fault;
use nom::branch::alt;
use nom::bytes::complete::take_till;
use nom::character::complete::{char, one_of};
use nom::sequence::{delimited, preceded};
use nom::{IResult, Parser};
use std::ops::Range;
use std::sync::Arc;

/// Words that make a comment do something, and whether a comma follows them. The others act whatever follows.
const ACTIVE: [(&str, bool); 13] = [
    ("MSG", true),
    ("DEBUG", true),
    ("PRINT", true),
    ("ABORT", true),
    ("LOG", true),
    ("LOGOPEN", true),
    ("LOGAPPEND", true),
    ("LOGCLOSE", false),
    ("PROBEOPEN", false),
    ("PROBECLOSE", false),
    ("PYRELOAD", false),
    ("PYRUN", true),
    ("PY", true),
];

/// What a comment does by its first word; `None`: it is a remark. Blanks within the word are taken out: what nearly acts is
/// no remark either.
fn active(body: &str) -> Option<&'static str> {
    let plain: String = body.chars().filter(|c| !c.is_whitespace()).flat_map(char::to_uppercase).collect();
    let whole = |rest: &str| !rest.starts_with(|c: char| c.is_alphanumeric() || c == '_');
    let acts = |(word, comma): &&(&str, bool)| {
        let first = body.trim_start().get(..word.len()).is_some_and(|w| w.eq_ignore_ascii_case(word));
        match plain.strip_prefix(word) {
            Some(rest) if *comma => rest.starts_with(',') || (first && whole(&body.trim_start()[word.len()..])),
            rest => rest.is_some(),
        }
    };
    ACTIVE.iter().find(acts).map(|(word, _)| *word)
}

/// A comment that acts.
pub enum Acting {
    /// What it does, and where it stands.
    Does(Range<usize>, Instruction),
    /// It does something that is not known to axiscal, of this name.
    Unknown(Range<usize>, String),
}

/// Reads the comments that end a line; gives what the one that acts does. The control acts on the last one of a line only,
/// and before everything else in it: one that acts stands alone (`alone`: nothing but a line number stands before them).
///
/// # Errors
/// What is no comment, and what acts otherwise than it looks.
pub fn comments(line: &Line<'_>, rest: &str, alone: bool) -> Result<Option<Acting>, Fault> {
    let mut rest = rest;
    let (mut seen, mut acting) = (0, None);
    loop {
        let (after, _) = blanks(rest).map_err(|e| line.unread(&e, "a comment"))?;
        if after.is_empty() {
            break;
        }
        // to the end of the line; the control looks into it for words that act
        if let Some(body) = after.strip_prefix(';') {
            match active(body) {
                Some(word) => {
                    return Ok(Some(Acting::Unknown(line.rest(after), format!("a remark that begins with {word}"))));
                }
                None => break,
            }
        }
        let (next, body) = delimited(char('('), take_till(|c| c == '(' || c == ')'), char(')'))
            .parse(after)
            .map_err(|e: nom::Err<nom::error::Error<&str>>| line.unread(&e, "a word, a comment or the line's end"))?;
        seen += 1;
        if let Some(word) = active(body) {
            acting.get_or_insert((after, body, word));
        }
        rest = next;
    }
    let Some((place, body, word)) = acting else { return Ok(None) };
    if seen > 1 {
        let says = format!("({word}) and another comment stand in one line: the control acts on the last one only");
        return Err(line.fault(place, says));
    }
    if !alone {
        return Err(line.fault(place, format!("({word}) acts: it stands alone in its line")));
    }
    let at = line.rest(place);
    does(line, place, body, word).map(|what| {
        Some(
            what.map_or_else(
                || Acting::Unknown(at.clone(), format!("({word})")),
                |what| Acting::Does(at.clone(), what),
            ),
        )
    })
}

/// `None`: something that is not known to axiscal.
fn does(line: &Line<'_>, place: &str, body: &str, word: &str) -> Result<Option<Instruction>, Fault> {
    let (head, tail) = body.split_once(',').map_or((body, None), |(h, t)| (h, Some(t)));
    let text = |fixed: bool| -> Result<Text, Fault> {
        let tail = tail
            .filter(|_| head.trim_start().eq_ignore_ascii_case(word))
            .ok_or_else(|| line.fault(place, format!("({word}) needs a comma right behind the word, and a text")))?;
        if fixed { Ok(vec![Piece::Text(Arc::from(tail))]) } else { expanded(line, tail) }
    };
    Ok(Some(match word {
        "MSG" => Instruction::Message(text(true)?),
        "DEBUG" => Instruction::Message(text(false)?),
        "ABORT" => Instruction::Abort(text(false)?),
        "LOG" => Instruction::LogLine(text(false)?),
        "LOGOPEN" => Instruction::LogOpen { name: text(true)?, append: false },
        "LOGAPPEND" => Instruction::LogOpen { name: text(true)?, append: true },
        "LOGCLOSE" if body.trim_start().eq_ignore_ascii_case("LOGCLOSE") => Instruction::LogClose,
        _ => return Ok(None),
    }))
}

/// Text with `%f`, `%.3f` and parameters in it.
fn expanded(line: &Line<'_>, text: &str) -> Result<Text, Fault> {
    const USUAL_DECIMALS: usize = 4;
    let mut out = Text::new();
    let (mut rest, mut decimals) = (text, USUAL_DECIMALS);
    while !rest.is_empty() {
        let plain = rest.find(['%', '#']).unwrap_or(rest.len());
        if plain > 0 {
            out.push(Piece::Text(Arc::from(&rest[..plain])));
            rest = &rest[plain..];
            continue;
        }
        if let Some(after) = rest.strip_prefix('%') {
            let (after, new) = format(after).map_err(|e| line.unread(&e, "%f, %d or %.3f"))?;
            (rest, decimals) = (after, new.unwrap_or(USUAL_DECIMALS));
            continue;
        }
        let (after, value) = preceded(char('#'), parameter).parse(rest).map_err(|e| line.unread(&e, "a parameter"))?;
        out.push(Piece::Fixed { decimals, width: 0, value });
        rest = after;
    }
    Ok(out)
}

fn format(input: &str) -> IResult<&str, Option<usize>> {
    let digits = (char('.'), one_of("0123456789"), char('f')).map(|(_, d, _)| d.to_digit(10).map(|d| d as usize));
    alt((digits, char('d').map(|_| Some(0)), char('f').map(|_| None))).parse(input)
}
