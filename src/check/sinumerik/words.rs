//! The words of a block, and what is no name because it is one.

use super::expression::{Names, identifier};
use crate::axes::AxisName;
use crate::check::code::{Code, Expr, UnknownKind, Word};
use crate::check::lines::{Line, blanks, number, unsigned};
use crate::check::run::Fault;
use nom::Parser;
use nom::character::complete::char;
use nom::sequence::delimited;

/// How an axis is sent somewhere: as G90 and G91 say, or as the word says by itself.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Way {
    /// `X=5`
    Modal,
    /// `X=AC(5)`: to this place.
    Absolute,
    /// `X=IC(5)`: by this way.
    By,
    /// `C=DC(5)`: to this angle, the short way.
    Short,
    /// `C=ACP(5)`: to this angle in the positive sense.
    Up,
    /// `C=ACN(5)`: in the negative sense.
    Down,
}

const WAYS: [(Way, &str); 6] = [
    (Way::Modal, ""),
    (Way::Absolute, "AC"),
    (Way::By, "IC"),
    (Way::Short, "DC"),
    (Way::Up, "ACP"),
    (Way::Down, "ACN"),
];

/// Addresses of the axes, one row for each in the order of [`AxisName::ALL`], one for each way.
const ADDRESSES: [[&str; 6]; 6] = [
    ["X", "X=AC", "X=IC", "X=DC", "X=ACP", "X=ACN"],
    ["Y", "Y=AC", "Y=IC", "Y=DC", "Y=ACP", "Y=ACN"],
    ["Z", "Z=AC", "Z=IC", "Z=DC", "Z=ACP", "Z=ACN"],
    ["A", "A=AC", "A=IC", "A=DC", "A=ACP", "A=ACN"],
    ["B", "B=AC", "B=IC", "B=DC", "B=ACP", "B=ACN"],
    ["C", "C=AC", "C=IC", "C=DC", "C=ACP", "C=ACN"],
];

/// Words without a value.
const BARE: [&str; 5] = ["SUPA", "STOPRE", "TRAFOOF", "TRAORI", "TRANS"];
/// Words with `=` and a value.
const NAMED: [&str; 4] = ["F", "MEAS", "SPOS", "D"];
/// Letters with a number right behind them.
const LETTERS: [&str; 4] = ["G", "M", "D", "F"];

/// Words that cannot be names of variables or labels.
const RESERVED: [&str; 28] = [
    "DEF", "INT", "REAL", "STRING", "IF", "ELSE", "ENDIF", "WHILE", "ENDWHILE", "LOOP", "ENDLOOP", "REPEAT", "UNTIL",
    "GOTO", "GOTOF", "GOTOB", "MSG", "SETAL", "WRITE", "DELETE", "SPRINT", "SUPA", "STOPRE", "TRAFOOF", "TRAORI",
    "TRANS", "MEAS", "SPOS",
];

/// Words of the language that this grammar does not read: no name of a variable or label either.
const OTHER_WORDS: &str = "RET PROC EXTERN CALL ISOCALL PCALL FOR TO ENDFOR CASE OF DEFAULT GOTOC GOTOS REPEATB ENDLABEL ENDPROC SBLON \
    SBLOF SAVE DISPLON DISPLOF VAR BOOL CHAR AXIS FRAME AND OR XOR NOT DIV MOD TRUE FALSE AC IC DC ACP ACN ABS \
    SQRT ROUND TRUNC SIN COS TAN MEAW MEASA MEAC ATRANS ROT AROT SCALE MIRROR STARTFIFO STOPFIFO REDEF ADIS \
    AMIRROR ASCALE BRISK CFC CFIN CFTCP DRIVE FFWOF FFWON FGROUP FINEA NORM KONT ORIMKS ORIWKS PTP CP SOFT TRACYL \
    TRANSMIT TRAANG COARSEA IPOENDA";

/// Can a name not be one because it means something: an address with digits (`N70`, `M30`, `L10`, `R1`) or a word? The first
/// two characters of a name are letters or `_`.
pub fn means_something(name: &str) -> bool {
    let address = name.as_bytes().get(1).is_none_or(u8::is_ascii_digit);
    address || RESERVED.contains(&name) || OTHER_WORDS.split(' ').any(|word| word == name)
}

/// Axis and way of an address; `None` where it is no axis.
pub fn axis_word(address: &str) -> Option<(AxisName, Way)> {
    let (row, place) = ADDRESSES
        .iter()
        .zip(AxisName::ALL)
        .find_map(|(row, axis)| row.iter().position(|a| *a == address).map(|place| (axis, place)))?;
    WAYS.get(place).map(|(way, _)| (row, *way))
}

fn address(axis: AxisName, way: Way) -> &'static str {
    let place = WAYS.iter().position(|(w, _)| *w == way).unwrap_or(0);
    ADDRESSES.get(axis.index()).and_then(|row| row.get(place)).copied().unwrap_or("")
}

/// A word of the language, or a cycle with its values, that is not known to axiscal: what follows it, and its name. Letters that have a
/// meaning are none, whatever stands behind them.
fn stranger<'a>(names: &Names, left: &'a str) -> Option<(&'a str, &'a str)> {
    let (after, name) = identifier(left).ok()?;
    let is_address = name.as_bytes().get(1).is_none_or(u8::is_ascii_digit);
    let is_known = match after.strip_prefix('=') {
        // a user's axis may be called C1
        Some(_) if names.axis(name).is_some() => true,
        // the number of a block stands at its beginning, where it has been taken: another one is a mistake
        _ if is_address => name.get(..1).is_none_or(|l| l == "N" || LETTERS.contains(&l) || names.axis(l).is_some()),
        Some(_) => NAMED.contains(&name),
        None => BARE.contains(&name),
    };
    if is_known {
        return None;
    }
    let (mut depth, mut quoted) = (0_usize, false);
    let end = after.find(|c: char| {
        match c {
            '"' => quoted = !quoted,
            '(' if !quoted => depth += 1,
            ')' if !quoted => depth = depth.saturating_sub(1),
            _ => {}
        }
        !quoted && depth == 0 && (c == ' ' || c == '\t')
    });
    Some((after.get(end.unwrap_or(after.len())..)?, name))
}

/// What is not known of a word: calls of programs are `L10` and these words.
fn kind(name: &str) -> UnknownKind {
    let number = name.strip_prefix('L').is_some_and(|n| !n.is_empty() && n.bytes().all(|b| b.is_ascii_digit()));
    let calls = ["EXTCALL", "CALL", "PCALL", "ISOCALL", "MCALL"].contains(&name);
    if number || calls { UnknownKind::Program } else { UnknownKind::Meaning }
}

/// Reads the words of a block up to the end of the line. Those that are not known to axiscal are noted in the code.
///
/// # Errors
/// A word that cannot be read, one that stands twice, two without a blank between them.
pub fn words(names: &Names, line: &Line<'_>, rest: &str, code: &mut Code) -> Result<Vec<Word>, Fault> {
    let mut words: Vec<Word> = Vec::new();
    let mut left = rest;
    while !left.is_empty() {
        if let Some((after, name)) = stranger(names, left) {
            code.is_unknown_of(kind(name), line.rest(left), name);
            left = blanks(after).map_err(|e| line.unread(&e, "a word"))?.0;
            continue;
        }
        let (after, word) = word(names, line, left)?;
        let is_twice = |w: &Word| {
            w.address == word.address
                || matches!((axis_word(w.address), axis_word(word.address)), (Some(a), Some(b)) if a.0 == b.0)
        };
        if words.iter().any(is_twice) && !["G", "M"].contains(&word.address) {
            return Err(line.fault(left, format!("two {} words stand in one block", word.address)));
        }
        words.push(word);
        let (next, gap) = blanks(after).map_err(|e| line.unread(&e, "a word"))?;
        if gap.is_empty() && !next.is_empty() {
            return Err(line.not_understood(after, "a blank before the next word"));
        }
        left = next;
    }
    Ok(words)
}

fn word<'a>(names: &Names, line: &Line<'_>, left: &'a str) -> Result<(&'a str, Word), Fault> {
    let unknown = || line.not_understood(left, "a word that axiscal knows");
    let (after, name) = identifier(left).map_err(|_| unknown())?;
    if let Some(bare) = BARE.into_iter().find(|b| *b == name) {
        return Ok((after, Word { address: bare, value: Expr::Number(1.0), point: true }));
    }
    if let Some(value) = after.strip_prefix('=') {
        if let Some(axis) = names.axis(name) {
            return axis_value(names, line, value, axis);
        }
        let address = NAMED.into_iter().find(|n| *n == name).ok_or_else(unknown)?;
        let (after, value) = names.value_of(value).map_err(|_| line.not_understood(value, "the value of a word"))?;
        return Ok((after, Word { address, value, point: true }));
    }
    let letter = left.get(..1).ok_or_else(unknown)?;
    let behind = left.get(1..).ok_or_else(unknown)?;
    let (address, signed) = match names.axis(letter) {
        Some(axis) => (address(axis, Way::Modal), true),
        None => (LETTERS.into_iter().find(|l| *l == letter).ok_or_else(unknown)?, false),
    };
    let (after, (value, _)) = if signed { number(behind) } else { unsigned(behind) }.map_err(|_| unknown())?;
    Ok((after, Word { address, value: Expr::Number(value), point: true }))
}

fn axis_value<'a>(names: &Names, line: &Line<'_>, input: &'a str, axis: AxisName) -> Result<(&'a str, Word), Fault> {
    let unread = |rest: &str| line.not_understood(rest, "the value of a word");
    let way =
        WAYS.iter().skip(1).find(|(_, spelled)| input.strip_prefix(spelled).is_some_and(|rest| rest.starts_with('(')));
    let Some((way, spelled)) = way else {
        let (after, value) = names.value_of(input).map_err(|_| unread(input))?;
        return Ok((after, Word { address: address(axis, Way::Modal), value, point: true }));
    };
    let inside = input.get(spelled.len()..).unwrap_or("");
    let (after, value) = delimited(char('('), |i| names.value_of(i), char(')'))
        .parse(inside)
        .map_err(|_: nom::Err<nom::error::Error<&str>>| unread(inside))?;
    Ok((after, Word { address: address(axis, *way), value, point: true }))
}
