//! The grammar: O-words, parameters, expressions, active comments. What it does not know is an error.
//!
//! Source: LinuxCNC 2.9 manual, chapters 11.3 (lines, words, expressions), 11.4 (comments), 11.7 (O-codes).

use super::comments::{Acting, comments};
use crate::check::code::{Code, Expr, Function, Instruction, Links, Op, UnknownKind, Var, Word};
use crate::check::ladder::{self, COMPARISONS, Ladder};
use crate::check::lines::{Line, blanks, lines, number, unsigned};
use crate::check::run::Fault;
use nom::branch::alt;
use nom::bytes::complete::{tag_no_case, take_while1};
use nom::character::complete::{char, digit1, one_of};
use nom::combinator::{cut, opt};
use nom::multi::many0;
use nom::sequence::{delimited, preceded};
use nom::{IResult, Parser};
use std::ops::Range;

/// The letters that a block may hold.
const ADDRESSES: [&str; 16] = ["G", "M", "X", "Y", "Z", "A", "B", "C", "F", "S", "P", "L", "R", "E", "D", "Q"];

/// Reads a program. What is of LinuxCNC's language and not known to axiscal is in [`Code::unknown`], all of it.
///
/// # Errors
/// The first place that is not of this grammar.
pub fn parse(text: &str) -> Result<Code, Fault> {
    let mut reader = Reader::default();
    let read = lines(text).try_for_each(|line| reader.line(&line));
    // what is not known may be why the rest is not understood: it is said first
    if !reader.code.unknown.is_empty() {
        return Ok(reader.code);
    }
    read?;
    reader.finish(text.len())
}

/// Arguments of a subroutine (manual 11.7.2).
const MOST_ARGUMENTS: usize = 30;

/// O-words of the language that are not read (manual 11.7).
const FURTHER_O_WORDS: [&str; 7] = ["while", "endwhile", "do", "repeat", "endrepeat", "break", "continue"];

#[derive(Default)]
struct Reader {
    code: Code,
    open: Vec<Open>,
    subs: Links<String>,
    percents: usize,
    /// A line that is not blank has come.
    begun: bool,
}

/// A line without its number, which the control does not look at: `N10 G0 Z5`; at most five digits (manual 11.3.2).
fn line_number(rest: &str) -> &str {
    const DIGITS: usize = 5;
    let Some(digits) = rest.strip_prefix(['n', 'N']).map(str::trim_start) else { return rest };
    let after = digits.trim_start_matches(|c: char| c.is_ascii_digit());
    let count = digits.len() - after.len();
    // what is no line number is no word either, and is refused where the words are read
    if (1..=DIGITS).contains(&count) { after.trim_start_matches([' ', '\t']) } else { rest }
}

/// A structure that is not closed yet.
struct Open {
    label: String,
    at: Range<usize>,
    kind: Kind,
}

enum Kind {
    /// The jump past the present branch, the jumps to the end, whether `else` has come.
    If { past: Option<usize>, ends: Vec<usize>, other: bool },
    /// The jump over the subroutine.
    Sub { over: usize },
}

impl Reader {
    fn line(&mut self, line: &Line<'_>) -> Result<(), Fault> {
        let (rest, _) = blanks(line.text).map_err(|e| line.unread(&e, "a line"))?;
        if rest.is_empty() {
            return Ok(());
        }
        if self.percents > 1 {
            return Err(line.fault(rest, "something stands behind the second % that ends the program"));
        }
        if let Some(after) = rest.strip_prefix('%') {
            if !after.trim().is_empty() {
                return Err(line.not_understood(after, "nothing else in a line with %"));
            }
            if self.percents == 0 && self.begun {
                let says = "the first % does not stand at the beginning of the program: nothing but blank lines may stand before it, and no remark";
                return Err(line.fault(rest, says));
            }
            (self.percents, self.begun) = (self.percents + 1, true);
            if self.percents == 2 {
                self.code.push(line.all(), Instruction::End);
            }
            return Ok(());
        }
        self.begun = true;
        if rest.starts_with(['o', 'O']) {
            return self.o_word(line, rest);
        }
        let rest = line_number(rest);
        let rest = if rest.starts_with('#') { self.assignment(line, rest)? } else { self.block(line, rest)? };
        self.comments(line, rest)
    }

    /// The comments that end a line.
    fn comments(&mut self, line: &Line<'_>, rest: &str) -> Result<(), Fault> {
        let alone = line_number(line.text.trim_start_matches([' ', '\t'])).len() == rest.len();
        match comments(line, rest, alone)? {
            Some(Acting::Does(at, what)) => drop(self.code.push(at, what)),
            Some(Acting::Unknown(at, name)) => self.code.is_unknown(at, name),
            None => {}
        }
        Ok(())
    }

    fn assignment<'a>(&mut self, line: &Line<'a>, rest: &'a str) -> Result<&'a str, Fault> {
        let (after, target) = preceded(char('#'), parameter).parse(rest).map_err(|e| line.unread(&e, "a parameter"))?;
        let (after, value) = preceded((blanks, char('='), blanks), cut(value))
            .parse(after)
            .map_err(|e| line.unread(&e, "= and a value"))?;
        let what = match target {
            Expr::Var(var) => Instruction::Set(var, value),
            Expr::Indirect(number) => Instruction::SetIndirect(*number, value),
            _ => return Err(line.not_understood(rest, "a parameter")),
        };
        self.code.push(line.rest(rest), what);
        Ok(after)
    }

    fn block<'a>(&mut self, line: &Line<'a>, rest: &'a str) -> Result<&'a str, Fault> {
        let mut words: Vec<Word> = Vec::new();
        let mut left = rest;
        while left.starts_with(|c: char| c.is_ascii_alphabetic()) {
            let letter = left[..1].to_ascii_uppercase();
            let Some(address) = ADDRESSES.into_iter().find(|a| *a == letter) else {
                let Ok((after, _)) = word_value(&left[1..]) else {
                    return Err(line.not_understood(left, "a word that axiscal knows"));
                };
                self.code.is_unknown(line.rest(left), format!("the word {letter}"));
                left = blanks(after).map_err(|e| line.unread(&e, "a word"))?.0;
                continue;
            };
            if "GMPL".contains(address) && left[1..].starts_with(['+', '-']) {
                return Err(line.fault(left, format!("the number behind {address} has no sign")));
            }
            let (after, (value, point)) =
                cut(word_value).parse(&left[1..]).map_err(|e| line.unread(&e, "the value of a word"))?;
            if words.iter().any(|w| w.address == address) && address != "G" && address != "M" {
                return Err(line.fault(left, format!("two {address} words stand in one line")));
            }
            words.push(Word { address, value, point });
            left = blanks(after).map_err(|e| line.unread(&e, "a word"))?.0;
        }
        if !words.is_empty() {
            self.code.push(line.rest(rest), Instruction::Block(words));
        }
        Ok(left)
    }

    fn o_word(&mut self, line: &Line<'_>, rest: &str) -> Result<(), Fault> {
        // o040 is o40, and so is o<40>; o<040> is another name
        let name = bracketed_name.map(str::to_ascii_lowercase);
        let plain = digit1.map(|digits: &str| match digits.trim_start_matches('0') {
            "" => "0".to_owned(),
            number => number.to_owned(),
        });
        let (after, label) = preceded(one_of("oO"), alt((name, plain)))
            .parse(rest)
            .map_err(|e: nom::Err<nom::error::Error<&str>>| line.unread(&e, "an O-word"))?;
        let (after, keyword) = preceded(blanks, take_while1(|c: char| c.is_ascii_alphabetic()))
            .parse(after)
            .map_err(|e: nom::Err<nom::error::Error<&str>>| line.unread(&e, "if, else, endif, sub, call, return"))?;
        let condition = |after| {
            preceded(blanks, cut(bracketed))
                .parse(after)
                .map_err(|e: nom::Err<nom::error::Error<&str>>| line.unread(&e, "a condition in brackets"))
        };
        let at = line.rest(rest);
        let left = match keyword.to_ascii_lowercase().as_str() {
            "if" => {
                let (left, test) = condition(after)?;
                self.first_use(line, rest, &label)?;
                let past = self.code.push(at.clone(), Instruction::JumpUnless(test, 0));
                self.open.push(Open { label, at, kind: Kind::If { past: Some(past), ends: Vec::new(), other: false } });
                left
            }
            word @ ("else" | "elseif") => {
                let (left, test) =
                    if word == "elseif" { condition(after).map(|(l, t)| (l, Some(t)))? } else { (after, None) };
                self.next_branch(line, rest, &label, test)?;
                left
            }
            "endif" => {
                let Some(Open { kind: Kind::If { past, ends, .. }, .. }) = self.close(&label, true) else {
                    return Err(line.fault(rest, format!("o{label} endif closes nothing")));
                };
                let here = self.code.statements.len();
                past.into_iter().chain(ends).for_each(|jump| self.code.aim(jump, here));
                after
            }
            "sub" => {
                if !self.open.is_empty() {
                    return Err(line.fault(rest, "a subroutine begins inside of something else"));
                }
                self.first_use(line, rest, &label)?;
                let over = self.code.push(at.clone(), Instruction::Jump(0));
                self.subs.label(label.clone(), &self.code);
                self.open.push(Open { label, at, kind: Kind::Sub { over } });
                after
            }
            word @ ("endsub" | "return") => {
                let (left, value) = opt(preceded(blanks, bracketed))
                    .parse(after)
                    .map_err(|e: nom::Err<nom::error::Error<&str>>| line.unread(&e, "a value in brackets"))?;
                let inside = |o: &Open| matches!(o.kind, Kind::Sub { .. }) && o.label == label;
                if !self.open.iter().any(inside) {
                    return Err(line.fault(rest, format!("{word} outside of a subroutine of that name")));
                }
                self.code.push(at, Instruction::Return(value));
                if word == "endsub" {
                    let Some(Open { kind: Kind::Sub { over }, .. }) = self.close(&label, false) else {
                        return Err(line.fault(rest, "the subroutine ends inside of something else"));
                    };
                    let here = self.code.statements.len();
                    self.code.aim(over, here);
                }
                left
            }
            "call" => {
                let (left, given) = many0(preceded(blanks, bracketed))
                    .parse(after)
                    .map_err(|e: nom::Err<nom::error::Error<&str>>| line.unread(&e, "arguments in brackets"))?;
                if given.len() > MOST_ARGUMENTS {
                    return Err(line.fault(rest, format!("a call has more than {MOST_ARGUMENTS} arguments")));
                }
                // one that is not given is 0 at the control (manual 11.7.2); here it has no value, and may not be read
                let is_step = !given.is_empty();
                let gives = (1..).map(Var::Number).zip(given).collect();
                let call = self.code.push(at.clone(), Instruction::Call { to: 0, gives, texts: Vec::new(), is_step });
                self.subs.leads(call, label, at);
                left
            }
            other if FURTHER_O_WORDS.contains(&other) => {
                self.code.is_unknown(at, format!("o {other}"));
                return Ok(());
            }
            other => return Err(line.fault(rest, format!("{other:?} is no O-word"))),
        };
        self.comments(line, left)
    }

    /// A number may serve again where the structure before it is closed; a subroutine may not.
    fn first_use(&mut self, line: &Line<'_>, rest: &str, label: &str) -> Result<(), Fault> {
        let open = self.open.iter().any(|o| o.label == label);
        if open || self.subs.has(&label.to_owned()) {
            return Err(line.fault(rest, format!("o{label} is used twice")));
        }
        Ok(())
    }

    fn next_branch(&mut self, line: &Line<'_>, rest: &str, label: &str, test: Option<Expr>) -> Result<(), Fault> {
        let wrong = |says: &str| Err(line.fault(rest, format!("o{label} {says}")));
        let to_end = self.code.push(line.rest(rest), Instruction::Jump(0));
        let here = self.code.statements.len();
        let Some(Open { label: open, kind: Kind::If { past, ends, other }, .. }) = self.open.last_mut() else {
            return wrong("else belongs to no if");
        };
        if open != label {
            return wrong("else belongs to no open if");
        }
        if *other {
            return wrong("has a branch behind its else");
        }
        ends.push(to_end);
        *other = test.is_none();
        let before = past.take();
        if let Some(test) = test {
            *past = Some(here);
            self.code.push(line.rest(rest), Instruction::JumpUnless(test, 0));
        }
        if let Some(jump) = before {
            self.code.aim(jump, here);
        }
        Ok(())
    }

    fn close(&mut self, label: &str, conditional: bool) -> Option<Open> {
        let fits = |o: &Open| o.label == label && matches!(o.kind, Kind::If { .. }) == conditional;
        if self.open.last().is_some_and(fits) { self.open.pop() } else { None }
    }

    fn finish(mut self, end: usize) -> Result<Code, Fault> {
        if let Some(open) = self.open.last() {
            return Err(Fault { at: open.at.clone(), says: format!("o{} is not closed", open.label) });
        }
        if self.percents == 1 {
            return Err(Fault { at: end..end, says: "the program ends without its second %".to_owned() });
        }
        self.subs.resolve(&mut self.code, |code, label, at| {
            // a file of that name, in a folder of the control
            code.is_unknown_of(UnknownKind::Program, at, format!("o<{label}> call"));
            Ok(())
        })?;
        Ok(self.code)
    }
}

fn bracketed_name(input: &str) -> IResult<&str, &str> {
    // the control takes whatever stands between the brackets; blanks it takes out
    let part = |c: char| c.is_ascii_alphanumeric() || "_-.".contains(c);
    delimited(char('<'), take_while1(part), char('>')).parse(input)
}

/// What follows `#`.
pub(super) fn parameter(input: &str) -> IResult<&str, Expr> {
    let name = bracketed_name.map(|n: &str| Expr::Var(Var::named(&n.to_ascii_lowercase())));
    let plain = digit1.map(|d: &str| d.parse().map_or(Expr::Number(f64::NAN), |n| Expr::Var(Var::Number(n))));
    let computed = bracketed.map(|e| Expr::Indirect(Box::new(e)));
    alt((name, plain, computed)).parse(input)
}

fn bracketed(input: &str) -> IResult<&str, Expr> {
    delimited((char('['), blanks), expression, (blanks, char(']'))).parse(input)
}

/// The value of a word: a number or something in brackets.
fn word_value(input: &str) -> IResult<&str, (Expr, bool)> {
    let computed = alt((bracketed, preceded(char('#'), parameter))).map(|e| (e, true));
    alt((number.map(|(n, point)| (Expr::Number(n), point)), computed)).parse(input)
}

fn value(input: &str) -> IResult<&str, Expr> {
    alt((
        unsigned.map(|(n, _)| Expr::Number(n)),
        preceded(char('#'), parameter),
        bracketed,
        function,
        preceded(char('-'), value).map(|e| Expr::Call(Function::Minus, Box::new(e))),
    ))
    .parse(input)
}

fn function(input: &str) -> IResult<&str, Expr> {
    let exists = preceded(tag_no_case("EXISTS["), cut((char('#'), parameter, char(']')))).map(|(_, p, _)| match p {
        Expr::Var(var) => Expr::Exists(var),
        other => other,
    });
    alt((exists, ladder::function(FUNCTIONS, bracketed))).parse(input)
}

const FUNCTIONS: &[(&str, Function)] = &[
    ("ABS", Function::Abs),
    ("SQRT", Function::Sqrt),
    ("ROUND", Function::Round),
    ("FIX", Function::Floor),
    ("FUP", Function::Ceil),
];

/// The operators, from the loosest to the tightest (manual 11.3.9).
const LADDER: Ladder = Ladder {
    levels: &[
        &[("AND", Op::And), ("XOR", Op::Xor), ("OR", Op::Or)],
        COMPARISONS,
        &[("+", Op::Add), ("-", Op::Sub)],
        &[("*", Op::Mul), ("/", Op::Div), ("MOD", Op::Mod)],
        &[("**", Op::Pow)],
    ],
    gap: blanks,
    value,
};

fn expression(input: &str) -> IResult<&str, Expr> {
    LADDER.expression(input)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_keep_their_fractions() {
        let code = parse("G92.2 X-1.5 Y.25 Z[1 + 2 * 3]\n").unwrap();
        let Instruction::Block(words) = &code.statements[0].what else { panic!() };
        assert_eq!(words[0].value, Expr::Number(92.2), "{words:?}");
        assert_eq!(words[1].value, Expr::Number(-1.5));
        assert_eq!(words[2].value, Expr::Number(0.25));
    }

    /// Where a program is refused first, and why.
    fn refused(text: &str) -> Fault {
        match parse(text) {
            Err(fault) => fault,
            Ok(code) => {
                let first = code.unknown.first().unwrap_or_else(|| panic!("{text:?} is read"));
                Fault { at: first.at.clone(), says: first.name.clone() }
            }
        }
    }

    #[test]
    fn what_is_not_known_is_named_all_at_once() {
        let names = |text: &str| parse(text).unwrap().unknown.into_iter().map(|u| u.name).collect::<Vec<_>>();
        assert_eq!(
            names("o10 repeat [2]\nG5 I1 J-2\no10 endrepeat\n"),
            ["o repeat", "the word I", "the word J", "o endrepeat"]
        );
        assert_eq!(names("o<t> sub\no<t> endsub\no<t> call [5] [2]\n(PROBEOPEN a.txt)\n"), ["(PROBEOPEN)"]);
        assert_eq!(
            names("; a remark\nG21 ; another\no<my-touch> sub\no<my-touch> endsub\no<my-touch> call ; third\n"),
            [""; 0]
        );
        // nor is what may act behind a semicolon a remark
        assert_eq!(names("G21 ;LOG,one\n"), ["a remark that begins with LOG"]);
    }

    #[test]
    fn what_is_not_of_the_language_is_an_error_with_its_place() {
        let mut wrong = Vec::new();
        for (text, place) in [
            ("G0 X1 K3\n", 6),
            ("G0 X1..5\n", 6),
            ("G0 X\n", 4),
            ("(a (b))\n", 3),
            ("o1 if [1 GT]\no1 endif\n", 11),
            ("o1 if [1 GT 0]\n", 0),
            ("o1 endif\n", 0),
            ("o<a> call\n", 0),
            ("#<a> = \n", 7),
            ("G0 X1 X2\n", 6),
            ("(PRINT,hello)\n", 0),
            ("hello\n", 0),
            ("%\nG0 X1\n", 8),
            ("%\n%\nG0\n", 4),
            ("(LOG,%x)\n", 7),
            ("G0 X[1\n", 4),
            ("G-0 X1\n", 0),
            ("G4 P-1\n", 3),
            ("M+5\n", 0),
            // the control acts on the last comment of a line only
            ("(LOG,one)(A)\n", 0),
            ("G0 X1\n(ABORT,five) (A)\n", 6),
            ("(B)(LOG,three)\n", 3),
            ("(LOG,one)(LOG,two)\n", 0),
            // and before everything else in it
            ("G0 X1 (LOG,one)\n", 6),
            ("o1 if [1 GT 0] (MSG,one)\no1 endif\n", 15),
            ("N100000 G0 X1\n", 0),
            // by the first word, whatever follows
            ("(PROBEOPEN small.log)\n", 0),
            ("( probeclose now)\n", 0),
            ("(LOGCLOSE now)\n", 0),
            ("(LOG ,one)\n", 0),
            ("(D E B U G,one)\n", 0),
            ("(MSG)\n", 0),
            ("(PYRUN x)\n", 0),
            // a name in brackets is as it stands
            ("o40 if [1 GT 0]\no<040> endif\n", 16),
            ("o<a> sub\no<a> endsub\no<0a> call\n", 21),
            ("o<01> if [1 GT 0]\no1 endif\n", 18),
            // before the first % only what is blank
            ("(A)\n%\nG0 X1\n%\n", 4),
            ("N10\n%\nG0 X1\n%\n", 4),
        ] {
            let fault = refused(text);
            if fault.at.start != place {
                wrong.push(format!("{text:?}, not {place} but {}: {}", fault.at.start, fault.says));
            }
        }
        assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    }

    #[test]
    fn what_the_control_takes_is_read() {
        for text in [
            "o40 if [1 GT 0]\nO040 ENDIF\n",
            "o40 if [1 GT 0]\no<40> endif\n",
            "o0 if [1 GT 0]\no<0> endif\n",
            "o<Ab> sub\no<aB> endsub\no<AB> call\n",
            "\n \t\r\n%\nG0 X1\n%\n",
        ] {
            parse(text).unwrap_or_else(|e| panic!("{text:?}: {}", e.says));
        }
    }

    #[test]
    fn remarks_are_no_comments_that_act() {
        for text in [
            "(A)(B)\n",
            "G0 X1 (logger)(messages)\n",
            "o1 if [1 GT 0] (A)\no1 endif\n",
            "N10 (LOG,one)\n",
            "(- log, two)\n",
        ] {
            parse(text).unwrap_or_else(|e| panic!("{text:?}: {}", e.says));
        }
    }

    proptest::proptest! {
        #[test]
        fn rubbish_never_panics(text in "[ -~\n\u{e4}]{0,300}") {
            let _ = parse(&text);
        }

        #[test]
        fn words_of_the_language_never_panic(words in proptest::collection::vec(
            proptest::sample::select(vec!["G0 ", "X", "-1.5", "[", "]", "#", "<a>", "o1 ", "if ", "else", "endif", "sub", "\n", "(", ")", "LOG,", "%", "call", " = ", "5061"]), 0..80)) {
            let _ = parse(&words.concat());
        }
    }
}
