//! The text of a formula before the expression crate reads it: numbers as the crate knows them, functions that exist, and
//! variables by number.

use super::formula::FUNCTIONS;
use std::collections::BTreeMap;
use std::fmt::Write as _;

/// The value of a formula that is nothing but a number.
pub(super) fn bare_number(text: &str) -> Option<f64> {
    let digits = text.trim().trim_start_matches('-');
    digits
        .starts_with(|c: char| c.is_ascii_digit())
        .then(|| text.trim().parse().ok().filter(|v: &f64| v.is_finite()))?
}

/// The expression crate reads no exponents: `1.5e-3` is written out as `0.0015`.
pub(super) fn plain_numbers(text: &str) -> Result<String, String> {
    let bytes = text.as_bytes();
    let (mut out, mut at) = (String::new(), 0);
    while at < bytes.len() {
        let in_word = at > 0 && (bytes[at - 1].is_ascii_alphanumeric() || bytes[at - 1] == b'_');
        let begins = bytes[at].is_ascii_digit() || bytes[at] == b'.';
        if !begins || in_word {
            let end = (at + 1..=bytes.len()).find(|i| text.is_char_boundary(*i)).unwrap_or(bytes.len());
            out.push_str(&text[at..end]);
            at = end;
            continue;
        }
        let mut end = at;
        while end < bytes.len() && (bytes[end].is_ascii_digit() || bytes[end] == b'.') {
            end += 1;
        }
        if end < bytes.len() && matches!(bytes[end], b'e' | b'E') {
            let sign = usize::from(end + 1 < bytes.len() && matches!(bytes[end + 1], b'+' | b'-'));
            let digits = bytes[end + 1 + sign..].iter().take_while(|b| b.is_ascii_digit()).count();
            if digits > 0 {
                end += 1 + sign + digits;
            }
        }
        let word = &text[at..end];
        let value: f64 = word.parse().map_err(|_| format!("{word:?} is no number"))?;
        if !value.is_finite() {
            return Err(format!("{word:?} is too large a number"));
        }
        out.push_str(&value.to_string());
        at = end;
    }
    Ok(out)
}

/// A word in front of a bracket must be a function.
pub(super) fn known_functions(text: &str) -> Result<(), String> {
    let mut rest = text;
    while let Some(bracket) = rest.find('(') {
        let before = rest[..bracket].trim_end();
        let word_from = before.rfind(|c: char| !(c.is_ascii_alphanumeric() || c == '_')).map_or(0, |i| i + 1);
        let word = before.get(word_from..).unwrap_or_default();
        if !word.is_empty() && !word.starts_with(|c: char| c.is_ascii_digit()) && !FUNCTIONS.contains(&word) {
            return Err(format!("unknown function {word:?} (functions: {})", FUNCTIONS.join(" ")));
        }
        rest = &rest[bracket + 1..];
    }
    Ok(())
}

/// A formula with its variables and its numbers replaced by places, and what stands at each: first the variables in the order of their
/// names (that in which the expression crate has them), then the numbers. `cos(2*B)` and `cos(3*C)` are both `cos({01}*{00})`: one
/// expression serves them all. A power stays a number, whose derivative is a power again. In braces the crate takes a name as it
/// stands; without them it would first compile a regular expression for names, in a quarter of a millisecond. `variable` knows the
/// words that are variables; without any the formula stays as it is.
pub(super) fn numbered<T: Copy>(
    text: &str,
    variable: impl Fn(&str) -> Option<T>,
    number: impl Fn(f64) -> T,
) -> Option<(String, Vec<T>)> {
    let plain = plain_numbers(text).ok()?;
    let part_of_word = |c: char| c.is_ascii_alphanumeric() || matches!(c, '_' | '.');
    let words = || {
        plain
            .split_inclusive(|c: char| !part_of_word(c))
            .map(|w| w.split_at(w.trim_end_matches(|c| !part_of_word(c)).len()))
    };
    let variables: BTreeMap<&str, T> = words().filter_map(|(word, _)| Some((word, variable(word)?))).collect();
    let (mut out, mut numbers): (String, Vec<f64>) = Default::default();
    let mut place = |word: &str, before: &str| {
        let mut of_number = || {
            let power = before.trim_end().ends_with('^');
            let digits = !variables.is_empty() && !power && word.starts_with(|c: char| c.is_ascii_digit() || c == '.');
            let value: f64 = word.parse().ok().filter(|_| digits)?;
            let known = numbers.iter().position(|n| *n == value);
            Some(known.unwrap_or_else(|| {
                numbers.push(value);
                numbers.len() - 1
            }))
        };
        let of_variable = variables.keys().position(|name| *name == word);
        of_variable.or_else(|| of_number().map(|k| variables.len() + k))
    };
    for (word, rest) in words() {
        match place(word, &out) {
            Some(k) => write!(out, "{{{k:02}}}{rest}").ok()?,
            None => out.extend([word, rest]),
        }
    }
    Some((out, variables.into_values().chain(numbers.into_iter().map(number)).collect()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn variables_and_numbers_have_places() {
        let variable = |word: &str| ["B", "C", "t", "tau"].iter().position(|v| *v == word).map(|k| k as f64);
        let numbered = |text| numbered(text, variable, |number| -number).unwrap();
        assert_eq!(numbered("cos(2*B)"), ("cos({01}*{00})".to_owned(), vec![0.0, -2.0]));
        assert_eq!(numbered("cos(3.5*C)"), ("cos({01}*{00})".to_owned(), vec![1.0, -3.5]));
        assert_eq!(
            numbered("1 - exp(-t/tau) + t*C"),
            ("{03} - exp(-{01}/{02}) + {01}*{00}".to_owned(), vec![1.0, 2.0, 3.0, -1.0])
        );
        // a power stays, equal numbers share a place, functions, constants and unknown words stay
        assert_eq!(numbered("(B/2)^2 + 2 ^ 3"), ("({00}/{01})^2 + {01} ^ 3".to_owned(), vec![0.0, -2.0]));
        assert_eq!(numbered("atan2(B, pi)*1e2 + tB"), ("atan2({00}, pi)*{01} + tB".to_owned(), vec![0.0, -100.0]));
        // nothing but numbers is a number
        assert_eq!(numbered("2*3"), ("2*3".to_owned(), vec![]));
    }
}
