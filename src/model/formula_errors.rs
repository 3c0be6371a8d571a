//! What is wrong with a formula, in a sentence and with its place, before anything is made of it. Bounds on its size too: what is within
//! them is read, fitted and differentiated in far less than a second.

use super::formula::{FUNCTIONS, VARIABLES};
use std::ops::Range;

/// Bytes of a formula at most.
pub const LONGEST: usize = 4000;

/// Brackets, functions and powers inside one another at most.
pub const DEEPEST: usize = 64;

/// Operators and functions of a formula at most.
pub const MOST_OPERATIONS: usize = 1000;

/// Shape parameters of an effect at most.
pub const MOST_SHAPES: usize = 8;

/// What to do about a formula that exceeds a bound.
const SHORTER: &str = "write it shorter, or as several terms of one parameter";

/// A mistake in a formula.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Mistake {
    /// In a sentence.
    pub says: String,
    /// What to do, where the sentence does not say it.
    pub help: Option<&'static str>,
    /// Where, in bytes of the formula.
    pub at: Range<usize>,
}

/// A piece of a formula.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Token {
    Number,
    Word,
    Operator,
    Open,
    Close,
    Comma,
}

/// A bracket that is open.
struct Bracket<'a> {
    at: usize,
    /// The function before it.
    function: Option<&'a str>,
    commas: usize,
    /// Powers outside of the bracket that it is an exponent of.
    powers_outside: usize,
}

/// The first mistake of a formula, if it has one; `shapes` are the names of parameters that may stand inside.
#[must_use]
pub fn find(text: &str, shapes: &[&str]) -> Option<Mistake> {
    read(text, shapes).err()
}

fn read(text: &str, shapes: &[&str]) -> Result<(), Mistake> {
    if text.len() > LONGEST {
        let says = format!("it is {} characters long, and {LONGEST} at most are read", text.chars().count());
        return too_large(0..text.len(), says);
    }
    let tokens = tokens(text)?;
    let reader = Reader { text, shapes, tokens: &tokens, open: Vec::new(), powers: 0 };
    reader.few_operations()?;
    reader.read()
}

fn mistake<T>(at: Range<usize>, says: impl Into<String>) -> Result<T, Mistake> {
    Err(Mistake { says: says.into(), help: None, at })
}

fn too_large<T>(at: Range<usize>, says: String) -> Result<T, Mistake> {
    Err(Mistake { says, help: Some(SHORTER), at })
}

/// The words that a formula may use, for a sentence.
fn words(shapes: &[&str]) -> String {
    let own = if shapes.is_empty() { String::new() } else { format!("; parameters: {}", shapes.join(" ")) };
    format!("variables: {}{own}; functions: {}; pi", VARIABLES.join(" "), FUNCTIONS.join(" "))
}

fn tokens(text: &str) -> Result<Vec<(Token, Range<usize>)>, Mistake> {
    let mut out = Vec::new();
    let mut at = 0;
    while let Some(c) = text.get(at..).and_then(|rest| rest.chars().next()) {
        let run = |good: &dyn Fn(char) -> bool| {
            text.get(at..).map_or(0, |rest| rest.find(|c: char| !good(c)).unwrap_or(rest.len()))
        };
        let (token, length) = match c {
            _ if c.is_whitespace() => {
                at += c.len_utf8();
                continue;
            }
            '0'..='9' | '.' => (Token::Number, number_length(text, at)),
            _ if c.is_ascii_alphabetic() || c == '_' => {
                (Token::Word, run(&|c: char| c.is_ascii_alphanumeric() || c == '_'))
            }
            '+' | '-' | '*' | '/' | '^' => (Token::Operator, 1),
            '(' => (Token::Open, 1),
            ')' => (Token::Close, 1),
            ',' => (Token::Comma, 1),
            other => {
                let help = if other == '=' { ": a formula is one side only" } else { "" };
                return mistake(at..at + other.len_utf8(), format!("\"{other}\" is no sign of a formula{help}"));
            }
        };
        out.push((token, at..at + length));
        at += length;
    }
    Ok(out)
}

/// Digits and points, with an exponent where digits follow it.
fn number_length(text: &str, at: usize) -> usize {
    let bytes = text.as_bytes();
    let digits = |from: usize| bytes.iter().skip(from).take_while(|b| b.is_ascii_digit()).count();
    let mut end = at + bytes.iter().skip(at).take_while(|b| b.is_ascii_digit() || **b == b'.').count();
    if bytes.get(end).is_some_and(|b| matches!(b, b'e' | b'E')) {
        let sign = usize::from(bytes.get(end + 1).is_some_and(|b| matches!(b, b'+' | b'-')));
        let exponent = digits(end + 1 + sign);
        if exponent > 0 {
            end += 1 + sign + exponent;
        }
    }
    end - at
}

struct Reader<'a> {
    text: &'a str,
    shapes: &'a [&'a str],
    tokens: &'a [(Token, Range<usize>)],
    open: Vec<Bracket<'a>>,
    /// Powers inside one another, since the innermost bracket was opened.
    powers: usize,
}

impl<'a> Reader<'a> {
    fn word(&self, at: &Range<usize>) -> &'a str {
        self.text.get(at.clone()).unwrap_or_default()
    }

    /// Every operator is an operation, and every word with a bracket behind it.
    fn few_operations(&self) -> Result<(), Mistake> {
        let is_operation = |i: usize| match self.tokens[i].0 {
            Token::Operator => true,
            Token::Word => self.tokens.get(i + 1).is_some_and(|next| next.0 == Token::Open),
            _ => false,
        };
        let mut operations = (0..self.tokens.len()).filter(|&i| is_operation(i));
        let Some(first_beyond) = operations.nth(MOST_OPERATIONS) else { return Ok(()) };
        let count = MOST_OPERATIONS + 1 + operations.count();
        let says = format!("it has {count} operators and functions, and {MOST_OPERATIONS} at most are read");
        too_large(self.tokens[first_beyond].1.clone(), says)
    }

    /// One bracket or power more inside the others.
    fn deeper(&self, at: &Range<usize>) -> Result<(), Mistake> {
        let outside: usize = self.open.iter().map(|bracket| 1 + bracket.powers_outside).sum();
        if outside + self.powers < DEEPEST {
            return Ok(());
        }
        let says = format!("more than {DEEPEST} brackets, functions and powers are inside one another here");
        too_large(at.clone(), says)
    }

    fn read(mut self) -> Result<(), Mistake> {
        if self.tokens.is_empty() {
            return mistake(
                0..self.text.len(),
                "the formula is empty: write 1 where the parameter itself is the amount",
            );
        }
        // true where a value must come, false where one has just ended
        let mut wanted = true;
        let mut last: Option<&(Token, Range<usize>)> = None;
        for (i, token) in self.tokens.iter().enumerate() {
            let at = &token.1;
            match token.0 {
                Token::Number => {
                    self.no_value_before(wanted, at)?;
                    self.number(at)?;
                    wanted = false;
                }
                Token::Word => {
                    let next = self.tokens.get(i + 1).map(|t| t.0);
                    wanted = self.named(wanted, at, next)?;
                }
                Token::Operator => {
                    if wanted && !matches!(self.word(at), "+" | "-") {
                        return mistake(at.clone(), format!("nothing stands before {:?}", self.word(at)));
                    }
                    if self.word(at) == "^" {
                        self.deeper(at)?;
                        self.powers += 1;
                    } else if !wanted {
                        // the exponent ends here; a sign belongs to it
                        self.powers = 0;
                    }
                    wanted = true;
                }
                Token::Open => {
                    self.no_value_before(wanted, at)?;
                    let function = last.filter(|l| l.0 == Token::Word).map(|l| self.word(&l.1));
                    self.deeper(at)?;
                    let powers_outside = std::mem::take(&mut self.powers);
                    self.open.push(Bracket { at: at.start, function, commas: 0, powers_outside });
                    wanted = true;
                }
                Token::Close => {
                    if wanted && last.is_some() {
                        return mistake(at.clone(), "a value is missing before the closing bracket");
                    }
                    self.close(at)?;
                    wanted = false;
                }
                Token::Comma => {
                    let pair = |b: &&mut Bracket| b.function.is_some_and(takes_two);
                    match self.open.last_mut().filter(pair) {
                        Some(bracket) if !wanted => {
                            bracket.commas += 1;
                            self.powers = 0;
                        }
                        Some(_) => return mistake(at.clone(), "a value is missing before the comma"),
                        None => {
                            return mistake(
                                at.clone(),
                                "a comma stands between the two values of atan2 and mod only: a decimal point is a point",
                            );
                        }
                    }
                    wanted = true;
                }
            }
            last = Some(token);
        }
        if let Some(bracket) = self.open.last() {
            return mistake(bracket.at..bracket.at + 1, "this bracket is not closed");
        }
        match last {
            Some((_, at)) if wanted => mistake(at.clone(), format!("a value is missing after {:?}", self.word(at))),
            _ => Ok(()),
        }
    }

    fn no_value_before(&self, wanted: bool, at: &Range<usize>) -> Result<(), Mistake> {
        if wanted {
            return Ok(());
        }
        mistake(at.clone(), format!("an operator is missing before {:?}: + - * / or ^", self.word(at)))
    }

    fn number(&self, at: &Range<usize>) -> Result<(), Mistake> {
        let word = self.word(at);
        match word.parse::<f64>() {
            Ok(value) if value.is_finite() => Ok(()),
            Ok(_) => mistake(at.clone(), format!("{word:?} is too large a number")),
            Err(_) => mistake(at.clone(), format!("{word:?} is no number")),
        }
    }

    /// A word; true where a value must follow it.
    fn named(&self, wanted: bool, at: &Range<usize>, next: Option<Token>) -> Result<bool, Mistake> {
        let word = self.word(at);
        // a parameter of the effect goes before a function or variable of the same name
        let value = self.shapes.contains(&word) || VARIABLES.contains(&word) || matches!(word, "pi" | "PI");
        if value {
            self.no_value_before(wanted, at)?;
            return Ok(false);
        }
        if FUNCTIONS.contains(&word) {
            if next != Some(Token::Open) {
                return mistake(at.clone(), format!("{word:?} needs brackets: {word}(…)"));
            }
            self.no_value_before(wanted, at)?;
            return Ok(true);
        }
        let what = if next == Some(Token::Open) { "function" } else { "word" };
        mistake(at.clone(), format!("unknown {what} {word:?} ({})", words(self.shapes)))
    }

    fn close(&mut self, at: &Range<usize>) -> Result<(), Mistake> {
        let Some(bracket) = self.open.pop() else {
            return mistake(at.clone(), "this bracket closes none that was opened");
        };
        self.powers = bracket.powers_outside;
        match bracket.function {
            Some(function) if takes_two(function) && bracket.commas != 1 => {
                mistake(bracket.at..at.end, format!("{function:?} takes two values: {function}(a, b)"))
            }
            _ => Ok(()),
        }
    }
}

fn takes_two(function: &str) -> bool {
    matches!(function, "atan2" | "mod")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bounds_are_named_with_their_value_and_place() {
        let nested = |open: &str, inside: &str, close: &str, times: usize| {
            format!("{}{inside}{}", open.repeat(times), close.repeat(times))
        };
        let sum = |times: usize| vec!["B"; times + 1].join("+");
        for (good, bad, bound) in [
            (nested("(", "B", ")", 64), nested("(", "B", ")", 65), "more than 64"),
            (nested("sin(", "B", ")", 64), nested("sin(", "B", ")", 65), "more than 64"),
            ("B^".repeat(64) + "B", "B^".repeat(65) + "B", "more than 64"),
            (nested("B^(", "B", ")", 32), nested("B^(", "B", ")", 33), "more than 64"),
            (sum(1000), sum(1001), "1001 operators and functions, and 1000 at most"),
            ("-".repeat(999) + "sin(B)", "-".repeat(1000) + "sin(B)", "1001 operators and functions"),
            ("B".to_owned() + &" ".repeat(3999), "B".to_owned() + &" ".repeat(4000), "4001 characters long"),
        ] {
            assert_eq!(find(&good, &[]), None, "{good}");
            let found = find(&bad, &[]).unwrap_or_else(|| panic!("{bad}"));
            assert!(found.says.contains(bound) && found.help.is_some(), "{bad}: {found:?}");
            assert!(!found.at.is_empty() && found.at.end <= bad.len(), "{bad}: {found:?}");
        }
        // side by side they are not inside one another
        assert_eq!(find(&vec!["(B^2^B)"; 100].join("*"), &[]), None);
        assert_eq!(find(&vec!["B^2"; 100].join("*"), &[]), None);
        let deep = "B^".repeat(65) + "B";
        assert_eq!(find(&deep, &[]).map(|m| m.at), Some(129..130));
    }

    #[test]
    fn every_mistake_has_a_sentence_and_its_place() {
        for (text, wrong, says) in [
            ("", "", "empty"),
            ("1 - cos(Q)", "Q", "unknown word \"Q\""),
            ("2*sine(B)", "sine", "unknown function \"sine\""),
            ("Cos(B)", "Cos", "unknown function"),
            ("1 +", "+", "a value is missing after"),
            ("1 + * B", "*", "nothing stands before"),
            ("2 B", "B", "an operator is missing before"),
            ("2(B)", "(", "an operator is missing before"),
            ("sin(B))", ")", "closes none"),
            ("(1 + sin(B)", "(", "not closed"),
            ("sin()", ")", "a value is missing before the closing"),
            ("1,5*B", ",", "a decimal point is a point"),
            ("atan2(B)", "(B)", "takes two values"),
            ("mod(1, 2, 3)", "(1, 2, 3)", "takes two values"),
            ("1e999", "1e999", "too large"),
            ("1.2.3", "1.2.3", "no number"),
            ("B = 3", "=", "one side only"),
            ("B*°", "°", "no sign of a formula"),
            ("sin B", "sin", "needs brackets"),
        ] {
            let found = find(text, &[]).unwrap_or_else(|| panic!("{text}"));
            assert_eq!(&text[found.at.clone()], wrong, "{text}: {found:?}");
            assert!(found.says.contains(says), "{text}: {}", found.says);
        }
        for good in ["1", "-(X^2)", "mod(B, 0.3) + atan2(-B, 1)", "1.5e-3*pi", "tau*exp(-t/tau)", "2^-3", "sin(-B)"] {
            assert_eq!(find(good, &["tau"]), None, "{good}");
        }
        assert!(
            find("q*B", &["tau"]).is_some_and(|m| m.says.contains("parameters: tau") && m.says.contains("gx gy gz"))
        );
    }
}
