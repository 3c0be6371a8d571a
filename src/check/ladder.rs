//! Operations in an expression, from the loosest to the tightest: the ladder of the dialects that write them without a type.

use super::code::{Expr, Function, Op};
use nom::bytes::complete::tag_no_case;
use nom::combinator::cut;
use nom::sequence::preceded;
use nom::{IResult, Parser};

/// How an operation is written, and what it is.
pub type Level = &'static [(&'static str, Op)];

/// The comparisons of LinuxCNC, Fanuc and Haas.
pub const COMPARISONS: Level =
    &[("EQ", Op::Eq), ("NE", Op::Ne), ("GT", Op::Gt), ("GE", Op::Ge), ("LT", Op::Lt), ("LE", Op::Le)];

/// A grammar of expressions.
pub struct Ladder {
    /// The loosest first.
    pub levels: &'static [Level],
    /// What may stand around an operation.
    pub gap: fn(&str) -> IResult<&str, &str>,
    pub value: fn(&str) -> IResult<&str, Expr>,
}

impl Ladder {
    pub fn expression<'a>(&self, input: &'a str) -> IResult<&'a str, Expr> {
        self.level(input, self.levels)
    }

    fn level<'a>(&self, input: &'a str, levels: &[Level]) -> IResult<&'a str, Expr> {
        let Some((operations, tighter)) = levels.split_first() else { return (self.value)(input) };
        let (mut rest, mut left) = self.level(input, tighter)?;
        while let Some((after, op)) = self.operation(rest, operations) {
            let (after, right) = cut(|i| self.level(i, tighter)).parse(after)?;
            left = Expr::Two(op, Box::new(left), Box::new(right));
            rest = after;
        }
        Ok((rest, left))
    }

    fn operation<'a>(&self, input: &'a str, operations: Level) -> Option<(&'a str, Op)> {
        let (start, _) = (self.gap)(input).ok()?;
        let written = |(word, op): &(&str, Op)| {
            let (head, rest) = start.split_at_checked(word.len())?;
            head.eq_ignore_ascii_case(word).then_some((rest, *op))
        };
        let (rest, op) = operations.iter().find_map(written)?;
        let (rest, _) = (self.gap)(rest).ok()?;
        Some((rest, op))
    }
}

/// `ABS[ … ]`: a function of what stands in brackets.
pub fn function(
    functions: &'static [(&'static str, Function)],
    bracketed: fn(&str) -> IResult<&str, Expr>,
) -> impl Fn(&str) -> IResult<&str, Expr> {
    move |input| {
        for (name, function) in functions {
            let parsed = preceded(tag_no_case::<_, _, nom::error::Error<&str>>(*name), cut(bracketed)).parse(input);
            match parsed {
                Ok((rest, of)) => return Ok((rest, Expr::Call(*function, Box::new(of)))),
                Err(nom::Err::Error(_)) => {}
                Err(failure) => return Err(failure),
            }
        }
        Err(nom::Err::Error(nom::error::Error::new(input, nom::error::ErrorKind::Alt)))
    }
}
