//! The numbers of a formula before the expression crate reads it (`build.rs` shares this file).

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
