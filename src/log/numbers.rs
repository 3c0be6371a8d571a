//! The grammar of one line: words of a letter and a number, as every control can write them.
//!
//! What is tolerated, because controls do it: blanks after the letter and after the sign, words without blanks between
//! them, a number that begins or ends with its decimal mark, `+`, `1.5EX+02`. What is not: anything else. A line either
//! is understood as a whole or is a [`Fault`] with its place.

use super::text_lines::blanks;
use nom::bytes::complete::take_while_m_n;
use nom::character::complete::one_of;
use nom::combinator::opt;
use nom::{IResult, Parser};

/// Why a line is not understood.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Fault {
    /// Offset in the line.
    pub at: usize,
    /// How many bytes are meant.
    pub length: usize,
    /// Stable code.
    pub code: &'static str,
    /// Expected and found.
    pub message: String,
}

impl Fault {
    /// At a place of `line`, which `rest` is the end of.
    pub fn at(line: &[u8], rest: &[u8], length: usize, code: &'static str, message: impl Into<String>) -> Self {
        let at = line.len().saturating_sub(rest.len());
        Self { at, length: length.clamp(1, rest.len().max(1)), code, message: message.into() }
    }
}

/// A number as it is written.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Number {
    pub value: f64,
    /// Digits after the mark; `None` without a mark.
    pub decimals: Option<usize>,
}

/// Powers of ten that a double holds exactly.
const POWERS: [f64; 23] = [
    1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15, 1e16, 1e17, 1e18, 1e19, 1e20,
    1e21, 1e22,
];

/// A number with this decimal mark; blanks may stand before it and after its sign.
pub fn number(mark: u8) -> impl Fn(&[u8]) -> IResult<&[u8], Number> {
    move |input| {
        let input = blanks(input);
        let is_negative = input.first() == Some(&b'-');
        let start = match input {
            [b'+' | b'-', rest @ ..] => blanks(rest),
            _ => input,
        };
        let (rest, whole) = digits(start);
        let (rest, fraction) = match rest.split_first() {
            Some((b, after)) if *b == mark => {
                let (rest, fraction) = digits(after);
                (rest, Some(fraction))
            }
            _ => (rest, None),
        };
        if whole.text.is_empty() && fraction.is_none_or(|f| f.text.is_empty()) {
            return Err(nom::Err::Error(nom::error::Error::new(input, nom::error::ErrorKind::Digit)));
        }
        let (rest, exponent) = match rest.first() {
            Some(b'E' | b'e') => opt(exponent).parse(rest)?,
            _ => (rest, None),
        };
        let value = decimal(whole, fraction.unwrap_or_default(), exponent.unwrap_or(0));
        let value = if is_negative { -value } else { value };
        Ok((rest, Number { value, decimals: fraction.map(|f| f.text.len()) }))
    }
}

/// Digits and their value; the value of more than 19 digits is not used.
#[derive(Debug, Clone, Copy, Default)]
struct Digits<'a> {
    text: &'a [u8],
    value: u64,
}

/// The digits with which a text begins, and what follows them.
#[inline]
fn digits(input: &[u8]) -> (&[u8], Digits<'_>) {
    let (mut count, mut value) = (0, 0_u64);
    while let Some(digit) = input.get(count).map(|b| b.wrapping_sub(b'0')).filter(|d| *d < 10) {
        value = value.wrapping_mul(10).wrapping_add(u64::from(digit));
        count += 1;
    }
    let (text, rest) = input.split_at(count);
    (rest, Digits { text, value })
}

/// `E+02`, `e2`, `EX-06`.
fn exponent(input: &[u8]) -> IResult<&[u8], i32> {
    let (rest, _) = one_of(&b"Ee"[..]).parse(input)?;
    let (rest, _) = opt(one_of(&b"Xx"[..])).parse(rest)?;
    let (rest, sign) = opt(one_of(&b"+-"[..])).parse(rest)?;
    let (rest, digits) = take_while_m_n(1, 3, |b: u8| b.is_ascii_digit()).parse(rest)?;
    let value = digits.iter().fold(0, |v, d| v * 10 + i32::from(d - b'0'));
    Ok((rest, if sign == Some('-') { -value } else { value }))
}

/// The double next to a decimal number.
fn decimal(whole: Digits<'_>, fraction: Digits<'_>, exponent: i32) -> f64 {
    let digits = whole.text.len() + fraction.text.len();
    let scale = exponent - i32::try_from(fraction.text.len()).unwrap_or(i32::MAX);
    if digits <= 15 {
        // up to 15 digits and powers up to 10^22 are exact doubles: one rounding, so the result is the nearest one
        let mantissa = whole.value as f64 * POWERS[fraction.text.len()] + fraction.value as f64;
        match (POWERS.get(scale.unsigned_abs() as usize), scale < 0) {
            (Some(power), true) => return mantissa / power,
            (Some(power), false) => return mantissa * power,
            (None, _) => {}
        }
    }
    // rare: more digits than a log holds. Digits, one point and an exponent are what the standard library reads
    let mut text = String::with_capacity(digits + 8);
    text.extend(whole.text.iter().map(|b| *b as char));
    text.push('.');
    text.extend(fraction.text.iter().map(|b| *b as char));
    if exponent != 0 {
        text.push_str(&format!("e{exponent}"));
    }
    text.parse().unwrap_or(f64::NAN)
}

/// The value of a number that must be whole and not negative, e.g. an id.
#[must_use]
pub fn whole(number: Number) -> Option<u64> {
    // beyond 2^53 a double no longer holds every whole number
    let good = number.value >= 0.0 && number.value <= 9e15 && number.value.fract() == 0.0;
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // checked just above
    good.then_some(number.value as u64)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn read(text: &str) -> Option<(f64, Option<usize>, usize)> {
        number(b'.')(text.as_bytes()).ok().map(|(rest, n)| (n.value, n.decimals, rest.len()))
    }

    #[test]
    fn numbers_as_controls_write_them() {
        assert_eq!(read("-33.000000"), Some((-33.0, Some(6), 0)));
        assert_eq!(read("-   1.500"), Some((-1.5, Some(3), 0)));
        assert_eq!(read("  -.4187Y2"), Some((-0.4187, Some(4), 2)));
        assert_eq!(read("12."), Some((12.0, Some(0), 0)));
        assert_eq!(read("+7"), Some((7.0, None, 0)));
        assert_eq!(read("1.5EX+02"), Some((150.0, Some(1), 0)));
        assert_eq!(read("1.5e-3 "), Some((0.0015, Some(1), 1)));
        for bad in ["", ".", "-", "nan", "inf", "X", "--1", "+-1"] {
            assert_eq!(read(bad), None, "{bad}");
        }
    }

    proptest! {
        #[test]
        fn what_was_written_with_six_decimals_is_read_as_the_nearest_double(value in -1e6..1e6f64) {
            let text = format!("{value:.6}");
            prop_assert_eq!(read(&text).unwrap().0, text.parse::<f64>().unwrap());
        }

        #[test]
        fn long_numbers_too(text in "[0-9]{1,30}\\.[0-9]{0,30}") {
            prop_assert_eq!(read(&text).unwrap().0, text.parse::<f64>().unwrap());
        }
    }
}
