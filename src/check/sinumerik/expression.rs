//! Values and texts: variables that the program has declared, system variables, `<<`, SPRINT.
//!
//! Order of operations as in the list of the control: comparisons bind last, so `(A<1) OR (A>3)` needs its brackets.

use crate::axes::AxisName;
use crate::check::code::{Expr, Function, Op, Piece, Text, Var};
use crate::check::lines::{blanks, unsigned};
use nom::branch::alt;
use nom::bytes::complete::{tag, take_till, take_while, take_while1};
use nom::character::complete::{char, digit1, one_of};
use nom::combinator::{cut, opt, recognize};
use nom::sequence::{delimited, preceded};
use nom::{IResult, Parser};
use std::collections::BTreeMap;
use std::sync::Arc;

/// What a variable of the program holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Type {
    /// A whole number.
    Int,
    /// A number.
    Real,
    /// A text of at most so many characters.
    Text(usize),
}

/// What names mean: the program's own variables and the axes of this control.
#[derive(Debug, Default)]
pub struct Names {
    /// Declared so far.
    pub types: BTreeMap<Arc<str>, Type>,
    /// Names of the axes at this control.
    pub axes: Vec<(String, AxisName)>,
}

type Failed<'a> = nom::Err<nom::error::Error<&'a str>>;

/// System variables of an axis, and those with a number.
const OF_AXIS: [&str; 4] = ["$AA_IM", "$AA_IW", "$AA_MM", "$AA_MW"];
/// All frames together, whose components can be read: NC Programming 12/2019, 6FC5398-2EP40-0BA0, p. 631.
const FRAME: &str = "$P_ACTFRAME";
const NUMBERED: [&str; 4] = ["$AC_MEA", "$A_PROBE", "$AC_TIMER", "$A_IN"];
/// The time of day: without an index.
const CLOCK: [&str; 3] = ["$A_HOUR", "$A_MINUTE", "$A_SECOND"];

fn refuse<T>(input: &str) -> IResult<&str, T> {
    Err(nom::Err::Failure(nom::error::Error::new(input, nom::error::ErrorKind::Verify)))
}

fn miss<T>(input: &str) -> IResult<&str, T> {
    Err(nom::Err::Error(nom::error::Error::new(input, nom::error::ErrorKind::Alt)))
}

/// A name: letters, digits and _, the first one no digit.
pub fn identifier(input: &str) -> IResult<&str, &str> {
    let first = |c: char| c.is_ascii_uppercase() || c == '_';
    let more = |c: char| c.is_ascii_uppercase() || c.is_ascii_digit() || c == '_';
    recognize((take_while1(first), take_while(more))).parse(input)
}

/// Does a condition hold or not, is that what an expression says?
pub fn is_truth(expr: &Expr) -> bool {
    use Op::{And, Eq, Ge, Gt, Le, Lt, Ne, Or, Xor};
    matches!(expr, Expr::Two(Eq | Ne | Gt | Ge | Lt | Le | And | Or | Xor, ..))
}

/// `R12`
fn is_r(name: &str) -> bool {
    name.strip_prefix('R').is_some_and(|n| !n.is_empty() && n.len() <= 3 && n.bytes().all(|b| b.is_ascii_digit()))
}

impl Names {
    pub fn axis(&self, name: &str) -> Option<AxisName> {
        self.axes.iter().find(|(n, _)| n == name).map(|(_, a)| *a)
    }

    /// A variable of the program's own, or an R parameter, that holds a number.
    pub fn number(&self, name: &str) -> Option<Var> {
        let own = matches!(self.types.get(name), Some(Type::Int | Type::Real));
        (own || is_r(name)).then(|| Var::named(name))
    }

    /// A system variable: `$AA_MM[X]` by the letter of the axis, `$AC_MEA[1]`.
    pub fn system<'a>(&self, input: &'a str) -> IResult<&'a str, Var> {
        let (after, name) = recognize((char('$'), identifier)).parse(input)?;
        if name == FRAME {
            return self.frame(input, after);
        }
        if CLOCK.contains(&name) {
            return Ok((after, Var::named(name)));
        }
        let (after, index) = delimited(
            char('['),
            take_while1(|c: char| c.is_ascii_uppercase() || c.is_ascii_digit() || c == '_'),
            char(']'),
        )
        .parse(after)
        .map_err(to_failure)?;
        let index = if OF_AXIS.contains(&name) {
            self.axis(index).map(|a| a.letter().to_string())
        } else if NUMBERED.contains(&name) {
            index.parse::<u8>().ok().map(|n| n.to_string())
        } else {
            None
        };
        match index {
            Some(index) => Ok((after, Var::named(&format!("{name}[{index}]")))),
            None => refuse(input),
        }
    }

    /// A component of the frame that acts: `$P_ACTFRAME[X,RT]`.
    fn frame<'a>(&self, input: &'a str, after: &'a str) -> IResult<&'a str, Var> {
        let component = alt((tag("RT"), tag("SC"), tag("MI")));
        let (after, (axis, _, component)) =
            delimited(char('['), (identifier, char(','), component), char(']')).parse(after).map_err(to_failure)?;
        match self.axis(axis).filter(|a| !a.is_rotary()) {
            Some(axis) => Ok((after, Var::named(&format!("{FRAME}[{},{component}]", axis.letter())))),
            None => refuse(input),
        }
    }

    /// A value or a condition.
    pub fn expression<'a>(&self, input: &'a str) -> IResult<&'a str, Expr> {
        let (rest, left) = self.level(input, 0)?;
        let Ok((after, op)) = preceded(blanks, comparison).parse(rest) else { return Ok((rest, left)) };
        let (after, right) = preceded(blanks, |i| self.level(i, 0)).parse(after).map_err(to_failure)?;
        if is_truth(&left) || is_truth(&right) || preceded(blanks, comparison).parse(after).is_ok() {
            return refuse(rest);
        }
        Ok((after, Expr::Two(op, Box::new(left), Box::new(right))))
    }

    /// A number.
    pub fn value_of<'a>(&self, input: &'a str) -> IResult<&'a str, Expr> {
        let (rest, expr) = self.expression(input)?;
        if is_truth(&expr) { refuse(input) } else { Ok((rest, expr)) }
    }

    fn level<'a>(&self, input: &'a str, depth: usize) -> IResult<&'a str, Expr> {
        let Some(operator) = LEVELS.get(depth) else { return self.operand(input) };
        let (mut rest, mut left) = self.level(input, depth + 1)?;
        while let Ok((after, op)) = preceded(blanks, operator).parse(rest) {
            let (after, right) = preceded(blanks, |i| self.level(i, depth + 1)).parse(after).map_err(to_failure)?;
            let joins = matches!(op, Op::And | Op::Or | Op::Xor);
            if is_truth(&left) != joins || is_truth(&right) != joins {
                return refuse(rest);
            }
            left = Expr::Two(op, Box::new(left), Box::new(right));
            rest = after;
        }
        Ok((rest, left))
    }

    fn operand<'a>(&self, input: &'a str) -> IResult<&'a str, Expr> {
        if let Ok((after, _)) = char::<_, nom::error::Error<&str>>('-').parse(input) {
            let (rest, of) = self.operand(after)?;
            return match of {
                Expr::Number(x) => Ok((rest, Expr::Number(-x))),
                of if is_truth(&of) => refuse(input),
                of => Ok((rest, Expr::Call(Function::Minus, Box::new(of)))),
            };
        }
        if input.starts_with('(') {
            return self.bracketed(input);
        }
        if input.starts_with('$') {
            return self.system(input).map(|(rest, var)| (rest, Expr::Var(var)));
        }
        if let Ok((rest, (x, _))) = unsigned(input) {
            return exponent(rest, x);
        }
        let (after, name) = identifier(input)?;
        if name == "NOT" {
            let (rest, of) = preceded(blanks, |i| self.operand(i)).parse(after).map_err(to_failure)?;
            let zero = Box::new(Expr::Number(0.0));
            return if is_truth(&of) { Ok((rest, Expr::Two(Op::Eq, Box::new(of), zero))) } else { refuse(input) };
        }
        let function = match name {
            "ABS" => Some(Function::Abs),
            "SQRT" => Some(Function::Sqrt),
            "ROUND" => Some(Function::Round),
            "ROUNDUP" => Some(Function::Ceil),
            _ => None,
        };
        if let Some(function) = function {
            let (rest, of) = self.bracketed(after).map_err(to_failure)?;
            return if is_truth(&of) { refuse(after) } else { Ok((rest, Expr::Call(function, Box::new(of)))) };
        }
        match self.number(name) {
            Some(var) => Ok((after, Expr::Var(var))),
            None => miss(input),
        }
    }

    /// `( … )`
    pub fn bracketed<'a>(&self, input: &'a str) -> IResult<&'a str, Expr> {
        delimited((char('('), blanks), cut(|i| self.expression(i)), (blanks, cut(char(')')))).parse(input)
    }

    // ------------------------------------------------------------------------------------------------------ texts

    /// A text. `shown`: it is only shown to a person, so a REAL may stand behind `<<`, whose digits the control chooses.
    pub fn text<'a>(&self, input: &'a str, shown: bool) -> IResult<&'a str, Text> {
        let (mut rest, mut text) = self.piece(input, shown)?;
        while let Ok((after, _)) = (blanks, tag("<<"), blanks).parse(rest) as IResult<&str, _> {
            let (after, more) = self.piece(after, shown).map_err(to_failure)?;
            text.extend(more);
            rest = after;
        }
        Ok((rest, text))
    }

    fn piece<'a>(&self, input: &'a str, shown: bool) -> IResult<&'a str, Text> {
        if input.starts_with('"') {
            return quoted(input).map(|(rest, text)| (rest, vec![Piece::Text(Arc::from(text))]));
        }
        if let Ok((after, _)) = tag::<_, _, nom::error::Error<&str>>("SPRINT(").parse(input) {
            return self.printed(after).map_err(to_failure);
        }
        if let Ok((rest, name)) = identifier(input)
            && matches!(self.types.get(name), Some(Type::Text(_)))
        {
            return Ok((rest, vec![Piece::Held(Var::named(name))]));
        }
        let (rest, value) = self.level(input, 0)?;
        let whole = self.is_whole(&value);
        if is_truth(&value) || !(whole || shown) {
            return refuse(input);
        }
        const SHOWN_DECIMALS: usize = 6;
        Ok((rest, vec![Piece::Fixed { decimals: if whole { 0 } else { SHOWN_DECIMALS }, width: 0, value }]))
    }

    fn is_whole(&self, value: &Expr) -> bool {
        match value {
            Expr::Number(x) => x.fract() == 0.0,
            Expr::Var(Var::Name(name)) => self.types.get(&**name) == Some(&Type::Int),
            _ => false,
        }
    }

    /// Behind `SPRINT(`: a text with `%D`, `%.6F`, `%12.4F`, and a value for each.
    fn printed<'a>(&self, input: &'a str) -> IResult<&'a str, Text> {
        let (mut rest, format) = quoted(input)?;
        let mut text = Text::new();
        let mut left = format;
        // a place is told by what of the whole line is left, not of the text in quotes
        let from_here = |left: &str| input.get(1 + format.len() - left.len()..).unwrap_or(input);
        while !left.is_empty() {
            let (after, plain) = take_till(|c| c == '%').parse(left)?;
            if !plain.is_empty() {
                text.push(Piece::Text(Arc::from(plain)));
            }
            left = after;
            if left.is_empty() {
                break;
            }
            let mut conversion = (char('%'), opt(digit1), opt(preceded(char('.'), digit1)), one_of("DF"));
            let parsed: IResult<&str, _> = conversion.parse(left);
            let Ok((after, (_, width, decimals, kind))) = parsed else { return refuse(from_here(left)) };
            let places = |digits: Option<&str>| digits.map_or(Ok(0), str::parse::<usize>);
            let (Ok(width), Ok(decimals)) = (places(width), places(decimals).map(|d| (d, decimals.is_some()))) else {
                return refuse(from_here(left));
            };
            const MOST: usize = 30;
            let good = if kind == 'D' { !decimals.1 } else { decimals.1 };
            if !good || width > MOST || decimals.0 > MOST {
                return refuse(from_here(left));
            }
            let (next, value) = preceded((blanks, char(','), blanks), |i| self.value_of(i)).parse(rest)?;
            if kind == 'D' && !self.is_whole(&value) {
                return refuse(rest);
            }
            text.push(Piece::Fixed { decimals: decimals.0, width, value });
            (left, rest) = (after, next);
        }
        let (rest, _) = (blanks, char(')')).parse(rest)?;
        Ok((rest, text))
    }
}

/// `" … "`
pub fn quoted(input: &str) -> IResult<&str, &str> {
    delimited(char('"'), take_till(|c| c == '"'), char('"')).parse(input)
}

fn exponent(input: &str, x: f64) -> IResult<&str, Expr> {
    let Ok((rest, digits)) =
        preceded(tag("EX"), recognize((opt(one_of("+-")), digit1))).parse(input) as IResult<&str, &str>
    else {
        return Ok((input, Expr::Number(x)));
    };
    match digits.parse::<i32>() {
        Ok(power) if power.abs() <= 30 => Ok((rest, Expr::Number(x * 10f64.powi(power)))),
        _ => refuse(input),
    }
}

fn to_failure(error: Failed<'_>) -> Failed<'_> {
    match error {
        nom::Err::Error(e) => nom::Err::Failure(e),
        other => other,
    }
}

fn comparison(input: &str) -> IResult<&str, Op> {
    if input.starts_with("<<") {
        return miss(input);
    }
    alt((
        tag("==").map(|_| Op::Eq),
        tag("<>").map(|_| Op::Ne),
        tag(">=").map(|_| Op::Ge),
        tag("<=").map(|_| Op::Le),
        char('>').map(|_| Op::Gt),
        char('<').map(|_| Op::Lt),
    ))
    .parse(input)
}

/// An operation that is a word: nothing of a name may follow.
fn spelled<'a>(word: &'static str, op: Op, input: &'a str) -> IResult<&'a str, Op> {
    match identifier(input) {
        Ok((rest, name)) if name == word => Ok((rest, op)),
        _ => miss(input),
    }
}

type OpParser = fn(&str) -> IResult<&str, Op>;

const LEVELS: [OpParser; 5] = [
    |i| spelled("OR", Op::Or, i),
    |i| spelled("XOR", Op::Xor, i),
    |i| spelled("AND", Op::And, i),
    |i| alt((char('+').map(|_| Op::Add), char('-').map(|_| Op::Sub))).parse(i),
    |i| alt((char('*').map(|_| Op::Mul), char('/').map(|_| Op::Div))).parse(i),
];
