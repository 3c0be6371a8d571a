//! ISO 230 error symbols: `EX0C` (location), `EXX` (motion): parsed in every spelling, printed in one.
//!
//! A term is data: the direction of the error, and the axis it belongs to, with `0` between them for a location error.

/// The form in which a symbol is printed: `E`, direction, `0`, axis, for a location error; other words are returned as
/// they are, upper-cased where they look like an error symbol.
///
/// Understood spellings: `EX0C`, `EXOC` (letter O), `E_X0C`, `XOC`, `x0c`.
///
/// ```
/// assert_eq!(axiscal::symbols::canonical("E_XOC").as_deref(), Some("EX0C"));
/// assert_eq!(axiscal::symbols::canonical("b0a").as_deref(), Some("EB0A"));
/// assert_eq!(axiscal::symbols::canonical("exx").as_deref(), Some("EXX"));
/// assert_eq!(axiscal::symbols::canonical("pretravel"), None);
/// ```
#[must_use]
pub fn canonical(word: &str) -> Option<String> {
    let plain: String = word.chars().filter(|c| !matches!(c, '_' | ' ')).map(|c| c.to_ascii_uppercase()).collect();
    let body = plain.strip_prefix('E').filter(|b| b.len() >= 2).unwrap_or(&plain);
    let is_axis = |c: char| "XYZABC".contains(c);
    let letters: Vec<char> = body.chars().collect();
    match letters[..] {
        [direction, '0' | 'O', axis] if is_axis(direction) && is_axis(axis) => Some(format!("E{direction}0{axis}")),
        [direction, axis] if is_axis(direction) && is_axis(axis) && plain.starts_with('E') => {
            Some(format!("E{direction}{axis}"))
        }
        _ => None,
    }
}

/// True when two words name the same parameter: as ISO symbols in any spelling, or letter by letter.
#[must_use]
pub fn same(a: &str, b: &str) -> bool {
    match (canonical(a), canonical(b)) {
        (Some(a), Some(b)) => a == b,
        (None, None) => a.eq_ignore_ascii_case(b),
        _ => false,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_spelling_gives_one_symbol() {
        for word in ["EX0B", "EXOB", "E_X0B", "E_XOB", "X0B", "XOB", "ex0b"] {
            assert_eq!(canonical(word).as_deref(), Some("EX0B"), "{word}");
        }
        assert_eq!(canonical("EAC").as_deref(), Some("EAC"));
        assert!(same("EBOA", "B0A"));
        assert!(!same("EX0C", "EX0B"));
        assert!(same("pretravel", "Pretravel"));
    }
}
