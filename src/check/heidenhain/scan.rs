//! A block of Klartext, read word by word: what is expected is there, or the place where it is not is named.

use crate::check::code::{Expr, Function, Var};
use crate::check::lines::Line;
use crate::check::run::Fault;
use std::ops::Range;

/// A block, and what of it is not read yet.
pub struct Scan<'a> {
    line: Line<'a>,
    rest: &'a str,
    /// What may stand between the digits of a number in place of a point: a setting of the control.
    mark: char,
}

impl<'a> Scan<'a> {
    /// From a place of the line on.
    pub fn new(line: Line<'a>, rest: &'a str, mark: char) -> Self {
        Self { line, rest, mark }
    }

    /// What is not read yet.
    pub fn rest(&self) -> &'a str {
        self.rest
    }

    /// From here to the end of the line.
    pub fn place(&self) -> Range<usize> {
        self.line.rest(self.rest)
    }

    /// Something is wrong here.
    pub fn fault(&self, says: impl Into<String>) -> Fault {
        self.line.fault(self.rest, says)
    }

    /// Something else is expected here.
    pub fn expected(&self, what: &str) -> Fault {
        self.line.not_understood(self.rest, what)
    }

    /// Takes a word if it stands here.
    pub fn take(&mut self, word: &str) -> bool {
        let Some(rest) = self.rest.strip_prefix(word) else { return false };
        self.rest = rest;
        true
    }

    /// Takes a word.
    ///
    /// # Errors
    /// When it does not stand here.
    pub fn need(&mut self, word: &str, what: &str) -> Result<(), Fault> {
        if self.take(word) { Ok(()) } else { Err(self.expected(what)) }
    }

    /// Takes a word that ends with a blank or the line.
    pub fn take_whole(&mut self, word: &str) -> bool {
        let whole = self.rest.strip_prefix(word).is_some_and(|r| r.is_empty() || r.starts_with(' '));
        whole && self.take(word)
    }

    /// The block ends here; a remark may follow.
    ///
    /// # Errors
    /// When something else follows.
    pub fn end(&mut self) -> Result<(), Fault> {
        if self.rest.is_empty() || self.rest.starts_with(" ;") { Ok(()) } else { Err(self.expected("the block's end")) }
    }

    /// Takes everything up to a text, which is taken too.
    ///
    /// # Errors
    /// When the text does not follow.
    pub fn up_to(&mut self, text: &str, what: &str) -> Result<&'a str, Fault> {
        let Some((before, after)) = self.rest.split_once(text) else { return Err(self.expected(what)) };
        self.rest = after;
        Ok(before)
    }

    /// Takes the rest.
    pub fn all(&mut self) -> &'a str {
        std::mem::take(&mut self.rest)
    }

    fn digits(&self, from: usize) -> usize {
        self.rest.bytes().skip(from).take_while(u8::is_ascii_digit).count()
    }

    /// A whole number without a sign.
    ///
    /// # Errors
    /// When none stands here.
    pub fn whole(&mut self, what: &str) -> Result<u32, Fault> {
        let (digits, rest) = self.rest.split_at(self.digits(0));
        let number = digits.parse().map_err(|_| self.expected(what))?;
        self.rest = rest;
        Ok(number)
    }

    /// A number without a sign.
    ///
    /// # Errors
    /// When none stands here.
    pub fn unsigned(&mut self, what: &str) -> Result<f64, Fault> {
        let whole = self.digits(0);
        // `.` or `,`: one byte
        let decimals = self.rest[whole..].starts_with(['.', self.mark]).then(|| self.digits(whole + 1));
        if whole == 0 || decimals == Some(0) {
            return Err(self.expected(what));
        }
        let (text, rest) = self.rest.split_at(whole + decimals.map_or(0, |d| 1 + d));
        let number = text.replace(self.mark, ".").parse().map_err(|_| self.expected(what))?;
        self.rest = rest;
        Ok(number)
    }

    /// `1500`, `Q1610`: a feed.
    ///
    /// # Errors
    /// When none stands here.
    pub fn feed(&mut self) -> Result<Expr, Fault> {
        const WHAT: &str = "a feed";
        if self.rest.starts_with('Q') {
            self.parameter(WHAT).map(Expr::Var)
        } else {
            self.unsigned(WHAT).map(Expr::Number)
        }
    }

    /// `Q1600`.
    ///
    /// # Errors
    /// When none stands here.
    pub fn parameter(&mut self, what: &str) -> Result<Var, Fault> {
        self.need("Q", what)?;
        self.whole(what).map(Var::Number)
    }

    /// `+10`, `-5.5`, `+Q1605`: a value with its sign.
    ///
    /// # Errors
    /// When none stands here: a value without a sign is none.
    pub fn signed(&mut self, what: &str) -> Result<Expr, Fault> {
        let minus = match self.rest.as_bytes().first() {
            Some(b'+') => false,
            Some(b'-') => true,
            _ => return Err(self.expected(what)),
        };
        self.rest = &self.rest[1..];
        if self.rest.starts_with('Q') {
            let value = Expr::Var(self.parameter(what)?);
            return Ok(if minus { Expr::Call(Function::Minus, Box::new(value)) } else { value });
        }
        let value = self.unsigned(what)?;
        Ok(Expr::Number(if minus { -value } else { value }))
    }
}
