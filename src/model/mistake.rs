//! What is wrong with a formula, in a sentence of our own and with its place, before the expression crate sees it.

use super::formula::{FUNCTIONS, VARIABLES};
use std::ops::Range;

/// A mistake in a formula.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Mistake {
    /// In a sentence.
    pub says: String,
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
}

/// The first mistake of a formula, if it has one; `shapes` are the names of parameters that may stand inside.
#[must_use]
pub fn find(text: &str, shapes: &[&str]) -> Option<Mistake> {
    let tokens = match tokens(text) {
        Ok(tokens) => tokens,
        Err(mistake) => return Some(mistake),
    };
    Reader { text, shapes, tokens: &tokens, open: Vec::new() }.read().err()
}

fn mistake<T>(at: Range<usize>, says: impl Into<String>) -> Result<T, Mistake> {
    Err(Mistake { says: says.into(), at })
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
}

impl<'a> Reader<'a> {
    fn word(&self, at: &Range<usize>) -> &'a str {
        self.text.get(at.clone()).unwrap_or_default()
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
                    wanted = true;
                }
                Token::Open => {
                    self.no_value_before(wanted, at)?;
                    let function = last.filter(|l| l.0 == Token::Word).map(|l| self.word(&l.1));
                    self.open.push(Bracket { at: at.start, function, commas: 0 });
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
                        Some(bracket) if !wanted => bracket.commas += 1,
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
