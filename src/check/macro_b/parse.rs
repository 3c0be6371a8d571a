//! The grammar: sequence numbers, IF GOTO, variables, DPRNT, messages. What it does not know is an error.
//!
//! Sources: Fanuc B-63324EN/03 (15i) for blocks and G31; a clone's manual (NCT, pp. 158, 193) and Haas 96-8000 Rev AC
//! (p. 116) for DPRNT; the rest as the postprocessor files say, unverified where they say so.

use crate::axes::AxisName;
use crate::check::code::{Code, Expr, Function, Instruction, Links, Op, Piece, Text, Var, Word};
use crate::check::ladder::{self, COMPARISONS, Ladder};
use crate::check::lines::{Line, blanks, lines, number, unsigned};
use crate::check::run::Fault;
use crate::post::Postprocessor;
use nom::branch::alt;
use nom::bytes::complete::{tag, take_till, take_while};
use nom::character::complete::{char, digit1, one_of};
use nom::combinator::cut;
use nom::sequence::{delimited, preceded};
use nom::{IResult, Parser};
use std::collections::BTreeMap;
use std::ops::Range;
use std::sync::Arc;

/// The letters that a block may hold beside those of the axes.
const ADDRESSES: [&str; 7] = ["G", "M", "F", "P", "R", "S", "H"];

/// The letters of the axes, in the order of [`AxisName::ALL`].
const AXES: [&str; 6] = ["X", "Y", "Z", "A", "B", "C"];

/// Digits of a program's number: 8 on a 30i, 4 or 5 on others.
const MOST_DIGITS: usize = 8;

type Failed<'a> = nom::Err<nom::error::Error<&'a str>>;

/// Reads a program.
///
/// # Errors
/// The first place that is not of this grammar.
pub fn parse(text: &str, post: &Postprocessor) -> Result<Code, Fault> {
    // capitals and small letters are one; no place changes by that
    let text = &text.to_ascii_uppercase();
    let mut reader = Reader {
        names: post.number.spoken(),
        always_mark: post.number.always_mark,
        post: Some(post),
        there: numbers(text),
        ..Reader::default()
    };
    let read = lines(text).try_for_each(|line| reader.line(&line));
    // what is not known may be why the rest is not understood: it is said first
    if !reader.code.unknown.is_empty() {
        return Ok(reader.code);
    }
    read?;
    reader.finish(text.len())
}

#[derive(Default)]
struct Reader<'p> {
    /// The control, for its ranges.
    post: Option<&'p Postprocessor>,
    /// What the control calls each axis.
    names: Vec<(String, AxisName)>,
    /// Every number of a place or a feed is written with its decimal point: one without has lost it.
    always_mark: bool,
    code: Code,
    /// Numbers of the programs that stand in the text: the program itself first.
    there: Vec<u32>,
    /// The program that is read, by its place among them.
    program: usize,
    /// The labels of each program.
    labels: Links<(usize, u32)>,
    /// In which line each of them stands.
    stand_in: BTreeMap<(usize, u32), usize>,
    lines: usize,
    /// The programs that are called, by their numbers.
    programs: Links<u32>,
    percents: usize,
    number: bool,
    ended: bool,
}

/// The numbers of the programs in a text: lines that begin with O and digits.
fn numbers(text: &str) -> Vec<u32> {
    let number = |line: &str| {
        let digits = line.strip_prefix('O')?;
        digits.get(..digits.bytes().take_while(u8::is_ascii_digit).count())?.parse().ok()
    };
    text.lines().filter_map(number).collect()
}

/// The local variable of each letter of a call (argument specification I: B-63944EN, custom macro).
const ARGUMENTS: [(char, u32); 21] = [
    ('A', 1),
    ('B', 2),
    ('C', 3),
    ('D', 7),
    ('E', 8),
    ('F', 9),
    ('H', 11),
    ('I', 4),
    ('J', 5),
    ('K', 6),
    ('M', 13),
    ('Q', 17),
    ('R', 18),
    ('S', 19),
    ('T', 20),
    ('U', 21),
    ('V', 22),
    ('W', 23),
    ('X', 24),
    ('Y', 25),
    ('Z', 26),
];

impl Reader<'_> {
    fn line(&mut self, line: &Line<'_>) -> Result<(), Fault> {
        let text = line.text.trim_end_matches([' ', '\t']);
        let line = &Line { start: line.start, text };
        let rest = line.text;
        self.lines += 1;
        if rest.is_empty() {
            return Ok(());
        }
        if self.percents > 0 && self.percents.is_multiple_of(2) && rest != "%" {
            return Err(line.fault(rest, "something stands behind the second % that ends the program"));
        }
        if let Some(after) = rest.strip_prefix('%') {
            if !after.is_empty() {
                return Err(line.not_understood(after, "nothing else in a line with %"));
            }
            if self.percents > 0 && self.percents.is_multiple_of(2) {
                // another program, which the first one calls
                (self.number, self.program) = (false, self.program + 1);
            } else if self.program > 0
                && !matches!(self.code.statements.last().map(|s| &s.what), Some(Instruction::Return(_)))
            {
                return Err(line.fault(rest, "the program that is called does not end with M99"));
            }
            if self.percents == 0 && !self.code.statements.is_empty() {
                return Err(line.fault(rest, "the first % does not stand at the beginning of the program"));
            }
            self.percents += 1;
            return Ok(());
        }
        if self.percents == 0 {
            return Err(line.fault(rest, "the program does not begin with %"));
        }
        if !self.number {
            let (after, digits) = preceded(char('O'), digit1)
                .parse(rest)
                .map_err(|e: Failed<'_>| line.unread(&e, "the program's number, O1234"))?;
            if digits.len() > MOST_DIGITS {
                return Err(
                    line.fault(rest, format!("O{digits}: no control has numbers of more than {MOST_DIGITS} digits"))
                );
            }
            if self.program == 0 {
                self.code.number = Some((digits.to_owned(), line.rest(rest)));
            } else if let Ok(number) = digits.parse()
                && (self.there.first() == Some(&number) || !self.programs.label(number, &self.code))
            {
                return Err(line.fault(rest, format!("two programs have the number {digits}")));
            }
            self.number = true;
            return self.comments(line, after);
        }
        let mut rest = rest;
        if let Ok((after, digits)) = preceded(char('N'), digit1::<_, nom::error::Error<&str>>).parse(rest) {
            let label = self.label(line, rest, digits)?;
            self.labels.label((self.program, label), &self.code);
            if let Some(first) = self.stand_in.insert((self.program, label), self.lines) {
                return Err(line.fault(rest, format!("N{label} stands twice, first in line {first}")));
            }
            rest = blanks(after).map_err(|e| line.unread(&e, "a block"))?.0;
        }
        let left = self.statement(line, rest)?;
        self.comments(line, left)
    }

    fn statement<'a>(&mut self, line: &Line<'a>, rest: &'a str) -> Result<&'a str, Fault> {
        let at = line.rest(rest);
        if let Some(after) = rest.strip_prefix("IF[") {
            let (after, condition) = (expression, char(']'))
                .map(|(e, _)| e)
                .parse(after)
                .map_err(|e: Failed<'_>| line.unread(&e, "a condition"))?;
            let over = self.code.push(at.clone(), Instruction::JumpUnless(condition, 0));
            let left = self.goto(line, after, at)?;
            let here = self.code.statements.len();
            self.code.aim(over, here);
            return Ok(left);
        }
        if rest.starts_with("GOTO") {
            return self.goto(line, rest, at);
        }
        if let Some(after) = rest.strip_prefix("POPEN") {
            self.code.push(at, Instruction::LogOpen { name: Vec::new(), append: true });
            return Ok(after);
        }
        if let Some(after) = rest.strip_prefix("PCLOS") {
            self.code.push(at, Instruction::LogClose);
            return Ok(after);
        }
        if let Some(after) = rest.strip_prefix("DPRNT[") {
            let (left, text) = printed(line, after)?;
            self.code.push(at, Instruction::LogLine(text));
            return Ok(left);
        }
        if rest.starts_with('#') {
            return self.assignment(line, rest, at);
        }
        if let Some(after) = rest.strip_prefix("M99").filter(|after| !after.starts_with(|c: char| c.is_ascii_digit()))
            && self.program > 0
        {
            return self.leave(line, after, at);
        }
        if let Some(after) = rest.strip_prefix("G65 P")
            && let Ok((after, number)) = digit1::<&str, nom::error::Error<&str>>(after)
            && let Ok(number) = number.parse()
            && self.there.iter().skip(1).any(|n| *n == number)
        {
            return self.call(line, after, number, at);
        }
        self.block(line, rest)
    }

    /// `M99`, or `M99 P9`: back to a label of the program that has called this one.
    fn leave<'a>(&mut self, line: &Line<'a>, after: &'a str, at: Range<usize>) -> Result<&'a str, Fault> {
        let Ok((left, digits)) = preceded((blanks, char('P')), digit1::<_, nom::error::Error<&str>>).parse(after)
        else {
            self.code.push(at, Instruction::Return(None));
            return Ok(after);
        };
        let label = self.label(line, after, digits)?;
        let jump = self.code.push(at.clone(), Instruction::Leave(0));
        self.labels.leads(jump, (0, label), at.clone());
        // the control comes to nothing behind it
        self.code.push(at, Instruction::Return(None));
        Ok(left)
    }

    /// `G65 P9101 A12. X-33.`: a program that stands in the text too.
    fn call<'a>(&mut self, line: &Line<'a>, after: &'a str, number: u32, at: Range<usize>) -> Result<&'a str, Fault> {
        let mut gives: Vec<(Var, Expr)> = Vec::new();
        let mut left = blanks(after).map_err(|e| line.unread(&e, "an argument"))?.0;
        while let Some(letter) = left.chars().next().filter(char::is_ascii_uppercase) {
            let Some((_, local)) = ARGUMENTS.into_iter().find(|(l, _)| *l == letter) else {
                return Err(line.not_understood(left, "a letter that may be an argument"));
            };
            let (after, (value, point)) =
                cut(word_value).parse(&left[1..]).map_err(|e| line.unread(&e, "the value of an argument"))?;
            if self.always_mark && !point && !matches!(value, Expr::Number(0.0)) {
                let says =
                    format!("the number behind {letter} has no decimal point: the control may count it in thousandths");
                return Err(line.fault(left, says));
            }
            let var = Var::Number(local);
            if gives.iter().any(|(given, _)| *given == var) {
                return Err(line.fault(left, format!("two {letter} words stand in one call")));
            }
            gives.push((var, value));
            left = blanks(after).map_err(|e| line.unread(&e, "an argument"))?.0;
        }
        let what = Instruction::Call { to: 0, gives, texts: Vec::new(), is_step: true };
        let call = self.code.push(at.clone(), what);
        self.programs.leads(call, number, at);
        Ok(left)
    }

    fn goto<'a>(&mut self, line: &Line<'a>, rest: &'a str, at: Range<usize>) -> Result<&'a str, Fault> {
        let (after, digits) = preceded(tag("GOTO"), cut(digit1))
            .parse(rest)
            .map_err(|e: Failed<'_>| line.unread(&e, "GOTO and a sequence number"))?;
        let label = self.label(line, rest, digits)?;
        let jump = self.code.push(at.clone(), Instruction::Jump(0));
        self.labels.leads(jump, (self.program, label), at);
        Ok(after)
    }

    /// A sequence number that the control has.
    fn label(&self, line: &Line<'_>, rest: &str, digits: &str) -> Result<u32, Fault> {
        let label = sequence_number(line, rest, digits)?;
        match self.post.and_then(|post| post.wrong_label(label)) {
            Some(wrong) => Err(line.fault(rest, format!("N{digits}: {wrong}"))),
            None => Ok(label),
        }
    }

    fn assignment<'a>(&mut self, line: &Line<'a>, rest: &'a str, at: Range<usize>) -> Result<&'a str, Fault> {
        let (after, n) =
            preceded(char('#'), digit1).parse(rest).map_err(|e: Failed<'_>| line.unread(&e, "a variable"))?;
        let variable = sequence_number(line, rest, n)?;
        let (after, value) = preceded(char('='), cut(expression))
            .parse(after)
            .map_err(|e: Failed<'_>| line.unread(&e, "= and a value"))?;
        if matches!(variable, 3000 | 3006) {
            let (left, body) = remark(line, after, "a message in parentheses")?;
            if variable == 3006 && value != Expr::Number(1.0) {
                return Err(line.fault(rest, format!("#{variable} is known with the value 1 only")));
            }
            let mut text = vec![Piece::Text(Arc::from(body))];
            if value != Expr::Number(1.0) {
                // the number of the alarm, 3000 beside it
                text.splice(0..0, [Piece::Fixed { decimals: 0, width: 0, value }, Piece::Text(Arc::from(" "))]);
            }
            self.code.push(at, if variable == 3000 { Instruction::Abort(text) } else { Instruction::Wait(text) });
            return Ok(left);
        }
        self.code.push(at, Instruction::Set(Var::Number(variable), value));
        Ok(after)
    }

    fn block<'a>(&mut self, line: &Line<'a>, rest: &'a str) -> Result<&'a str, Fault> {
        let mut words: Vec<Word> = Vec::new();
        let mut left = rest;
        while left.starts_with(|c: char| c.is_ascii_uppercase()) {
            let axis = self.names.iter().find(|(name, _)| left.starts_with(name.as_str()));
            let axis = axis.map(|(name, axis)| (name.len(), AXES[axis.index()]));
            let other = || ADDRESSES.into_iter().find(|a| left.starts_with(a)).map(|a| (1, a));
            let Some((length, address)) = axis.or_else(other) else {
                let Ok((after, _)) = word_value(&left[1..]) else {
                    return Err(line.not_understood(left, "a word that axiscal knows"));
                };
                self.code.is_unknown(line.rest(left), format!("the word {}", &left[..1]));
                left = blanks(after).map_err(|e| line.unread(&e, "a word"))?.0;
                continue;
            };
            if "GMPH".contains(address) && left[length..].starts_with(['+', '-']) {
                return Err(line.fault(left, format!("the number behind {address} has no sign")));
            }
            let (after, (value, point)) =
                cut(word_value).parse(&left[length..]).map_err(|e| line.unread(&e, "the value of a word"))?;
            if words.iter().any(|w| w.address == address) && address != "G" {
                return Err(line.fault(left, format!("two {address} words stand in one block")));
            }
            let a_length = AXES.contains(&address) || address == "F";
            if self.always_mark && a_length && !point && !matches!(value, Expr::Number(0.0)) {
                let says = format!(
                    "the number behind {address} has no decimal point: the control may count it in thousandths"
                );
                return Err(line.fault(left, says));
            }
            words.push(Word { address, value, point });
            left = blanks(after).map_err(|e| line.unread(&e, "a word"))?.0;
        }
        if !words.is_empty() {
            self.ended |= words.iter().any(|w| w.address == "M" && w.value == Expr::Number(30.0));
            self.code.push(line.rest(rest), Instruction::Block(words));
        }
        Ok(left)
    }

    fn comments(&mut self, line: &Line<'_>, rest: &str) -> Result<(), Fault> {
        let mut rest = rest;
        loop {
            let (after, _) = blanks(rest).map_err(|e| line.unread(&e, "a comment"))?;
            if after.is_empty() {
                return Ok(());
            }
            rest = remark(line, after, "a word, a comment or the block's end")?.0;
        }
    }

    fn finish(mut self, end: usize) -> Result<Code, Fault> {
        if self.percents == 0 || !self.percents.is_multiple_of(2) {
            return Err(Fault { at: end..end, says: "the program ends without its second %".to_owned() });
        }
        if !self.ended {
            return Err(Fault { at: end..end, says: "the program has no M30".to_owned() });
        }
        let lacks = |name: String, at| Err(Fault { at, says: format!("there is no {name}") });
        self.labels.resolve(&mut self.code, |_, (_, label), at| lacks(format!("N{label}"), at))?;
        self.programs.resolve(&mut self.code, |_, number, at| lacks(format!("O{number}"), at))?;
        Ok(self.code)
    }
}

fn sequence_number(line: &Line<'_>, rest: &str, digits: &str) -> Result<u32, Fault> {
    digits.parse().map_err(|_| line.fault(rest, format!("{digits} is too large a number")))
}

/// A remark or a message: no bracket, nothing that ends a program or a block for the control, and what its code has only.
fn comment_text(input: &str) -> IResult<&str, &str> {
    take_till(|c: char| matches!(c, '(' | ')' | '%' | ';') || !matches!(c, '\t' | ' '..='~')).parse(input)
}

/// A remark or a message in its brackets; what it cannot hold is named.
fn remark<'a>(line: &Line<'a>, input: &'a str, what: &str) -> Result<(&'a str, &'a str), Fault> {
    delimited(char('('), comment_text, char(')')).parse(input).map_err(|e: Failed<'a>| {
        let foreign = match &e {
            nom::Err::Error(e) | nom::Err::Failure(e) if input.starts_with('(') => e.input,
            _ => "",
        };
        match foreign.chars().next().filter(|c| !c.is_ascii()) {
            Some(c) => line.fault(foreign, format!("{c:?} in a remark or message: it takes ASCII characters only")),
            None => line.unread(&e, what),
        }
    })
}

/// How many places a field has at most, before and behind the point: Haas 96-8000 Rev AC, p. 116.
const PLACES: usize = 8;

/// What stands in DPRNT: `*` is a blank, `#21[44]` a variable with four whole digits and four after the point.
fn printed<'a>(line: &Line<'a>, input: &'a str) -> Result<(&'a str, Text), Fault> {
    let mut text = Text::new();
    let mut rest = input;
    loop {
        if let Some(after) = rest.strip_prefix(']') {
            return Ok((after, text));
        }
        if rest.starts_with('#') {
            let (after, (n, whole, decimals)) = (
                preceded(char('#'), digit1),
                preceded(char('['), one_of("0123456789")),
                (one_of("0123456789"), char(']')).map(|(d, _)| d),
            )
                .parse(rest)
                .map_err(|e: Failed<'_>| line.unread(&e, "a variable with its places, #21[44]"))?;
            let digit = |c: char| c.to_digit(10).unwrap_or(0) as usize;
            if digit(whole) + digit(decimals) > PLACES {
                let says = format!(
                    "a field of {} places: DPRNT writes {PLACES} at most (field_places in [log])",
                    digit(whole) + digit(decimals)
                );
                return Err(line.fault(rest, says));
            }
            let value = Expr::Var(Var::Number(sequence_number(line, rest, n)?));
            text.push(Piece::Fixed { decimals: digit(decimals), width: digit(whole), value });
            rest = after;
            continue;
        }
        let plain = |c: char| c.is_ascii_uppercase() || c.is_ascii_digit() || "*-+/.,".contains(c);
        let (after, words) = take_while(plain).parse(rest).map_err(|e: Failed<'_>| line.unread(&e, "text"))?;
        if words.is_empty() {
            return Err(line.not_understood(rest, "text, a variable or ]"));
        }
        text.push(Piece::Text(Arc::from(words.replace('*', " "))));
        rest = after;
    }
}

fn variable(input: &str) -> IResult<&str, Expr> {
    let plain = digit1.map(|d: &str| d.parse().map_or(Expr::Number(f64::NAN), |n| Expr::Var(Var::Number(n))));
    preceded(char('#'), plain).parse(input)
}

fn bracketed(input: &str) -> IResult<&str, Expr> {
    delimited(char('['), expression, char(']')).parse(input)
}

/// The value of a word: a number, a variable, or something in brackets.
fn word_value(input: &str) -> IResult<&str, (Expr, bool)> {
    let computed = alt((bracketed, variable)).map(|e| (e, true));
    alt((number.map(|(n, point)| (Expr::Number(n), point)), computed)).parse(input)
}

fn value(input: &str) -> IResult<&str, Expr> {
    alt((
        unsigned.map(|(n, _)| Expr::Number(n)),
        variable,
        bracketed,
        ladder::function(FUNCTIONS, bracketed),
        preceded(char('-'), value).map(|e| Expr::Call(Function::Minus, Box::new(e))),
    ))
    .parse(input)
}

const FUNCTIONS: &[(&str, Function)] = &[
    ("ABS", Function::Abs),
    ("SQRT", Function::Sqrt),
    ("ROUND", Function::Round),
    ("FIX", Function::Truncate),
    ("FUP", Function::Ceil),
];

const LADDER: Ladder = Ladder {
    levels: &[
        COMPARISONS,
        &[("+", Op::Add), ("-", Op::Sub), ("XOR", Op::Xor), ("OR", Op::Or)],
        &[("*", Op::Mul), ("/", Op::Div), ("MOD", Op::Mod), ("AND", Op::And)],
    ],
    gap: |input| Ok((input, "")),
    value,
};

fn expression(input: &str) -> IResult<&str, Expr> {
    LADDER.expression(input)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::post::Postprocessor;

    /// The built-in control, for a program of the number 1.
    fn fanuc() -> Postprocessor {
        let mut post = Postprocessor::load_built_in_or_file("fanuc").unwrap().0;
        post.settings.insert("program_number".into(), "1".into());
        post
    }

    fn read(text: &str) -> Result<Code, Fault> {
        parse(text, &fanuc())
    }

    #[test]
    fn what_is_not_known_is_an_error_with_its_place() {
        let mut wrong = Vec::new();
        for (text, place) in [
            ("G0 X1.\n", 0),
            ("%\nG0 X1.\n", 2),
            ("%\nO1\nG0 X1..5\n%\n", 11),
            ("%\nO1\nG0 K1\n%\n", 8),
            ("%\nO1\nIF[#1GT]GOTO1\n%\n", 12),
            ("%\nO1\nGOTO1\nM30\n%\n", 5),
            ("%\nO1\nN1\nN1\n", 8),
            ("%\nO1\nDPRNT[P*N#1]\n", 16),
            ("%\nO1\n#3006=1\n", 12),
            ("%\nO1\n(A(B)\n", 7),
            ("%\nO1\nX1.\n%\n", 11),
            ("%\nO1\nG-0 X1.\n%\n", 5),
            ("%\nO1\nG4 P-10\n%\n", 8),
            ("%\nO1\nM+5\n%\n", 5),
            ("%\nO1\nN-5\n%\n", 5),
            ("%\nO1\nDPRNT[P*N#1[45]]\n%\n", 14),
            ("%\nO1\n(100%)\n%\n", 9),
            ("%\nO1\nG4 P10 (UP; DOWN)\n%\n", 15),
            ("%\nO1\n(\u{d6}L)\n%\n", 6),
            // beyond what the control has
            ("%\nO1\nGOTO99999999\nM30\n%\n", 5),
            ("%\nO1\nN0\nM30\n%\n", 5),
            ("%\nO1\nN100000\nM30\n%\n", 5),
            // longer than any control has them
            ("%\nO123456789\nM30\n%\n", 2),
        ] {
            let fault = match read(text) {
                Err(fault) => fault,
                Ok(code) => Fault { at: code.unknown[0].at.clone(), says: code.unknown[0].name.clone() },
            };
            if fault.at.start != place {
                wrong.push(format!("{text:?}, not {place} but {}: {}", fault.at.start, fault.says));
            }
        }
        assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    }

    #[test]
    fn what_is_wrong_is_named() {
        for (text, says) in [
            ("%\nO1\nN7\nG4 P1\nN7\n", "N7 stands twice, first in line 3"),
            ("%\nO1\n(Set-up 1 gepr\u{fc}ft)\n", "'ü' in a remark or message: it takes ASCII characters only"),
            ("%\nO1\n#3006=1(gepr\u{fc}ft)\n", "'ü' in a remark or message: it takes ASCII characters only"),
        ] {
            let fault = read(text).unwrap_err();
            assert_eq!(fault.says, says, "{text:?}");
        }
    }

    #[test]
    fn the_number_is_read_and_not_judged() {
        for digits in ["1", "0123", "00230001"] {
            assert_eq!(read(&format!("%\nO{digits}\nM30\n%\n")).unwrap().number.unwrap().0, digits);
        }
    }

    proptest::proptest! {
        #[test]
        fn rubbish_never_panics(text in "%\nO1\n[ -~\n]{0,300}") {
            let _ = read(&text);
        }
    }
}
