//! A formula as it is written → its steps in the order of mathematics.

/// The value of a formula that is nothing but a number.
pub(super) fn bare_number(text: &str) -> Option<f64> {
    let digits = text.trim().trim_start_matches('-');
    digits
        .starts_with(|c: char| c.is_ascii_digit())
        .then(|| text.trim().parse().ok().filter(|v: &f64| v.is_finite()))?
}

/// What a formula is made into, step by step.
pub(super) trait Steps: Sized {
    /// A number that is written down.
    fn number(value: f64) -> Self;
    /// A variable, a parameter or a number with a name.
    fn word(name: &str) -> Self;
    /// `-self`
    fn negative(self) -> Self;
    /// `self + right` and the like: `+ - * / ^`
    fn operator(self, sign: char, right: Self) -> Self;
    /// A function of one value or two.
    fn call(name: &str, arguments: Vec<Self>) -> Self;
    /// `(self)`
    fn in_brackets(self) -> Self;
}

/// What waits for its right-hand value.
#[derive(Clone, Copy)]
enum Waiting<'a> {
    Sign,
    Operator(char),
    /// A bracket, the function before it, and how many values there were before.
    Open(Option<&'a str>, usize),
}

impl Waiting<'_> {
    /// Which of two neighbours comes first: powers, signs, products, sums.
    fn rank(self) -> u8 {
        match self {
            Self::Operator('^') => 4,
            Self::Sign => 3,
            Self::Operator('*' | '/') => 2,
            Self::Operator(_) => 1,
            Self::Open(..) => 0,
        }
    }
}

/// Takes the steps of a formula. A sign stands behind powers (`-x^2` is -(x^2), `2^-x` is 2^(-x)), powers are taken from the right
/// (`2^3^2` is 2^9), everything else from the left. No call inside of another: brackets may be as deep as the text is long.
pub(super) fn fold<T: Steps>(text: &str) -> Result<T, String> {
    let unreadable = || "it cannot be read".to_owned();
    let (mut values, mut waiting): (Vec<T>, Vec<Waiting<'_>>) = (Vec::new(), Vec::new());
    let mut function = None;
    // true where a value must come, false where one has just ended
    let mut wanted = true;
    let mut rest = text.trim_start();
    while let Some(first) = rest.chars().next() {
        let length = match first {
            '0'..='9' | '.' => number_length(rest),
            _ if first.is_ascii_alphabetic() || first == '_' => {
                rest.find(|c: char| !(c.is_ascii_alphanumeric() || c == '_')).unwrap_or(rest.len())
            }
            _ => first.len_utf8(),
        };
        let (word, behind) = rest.split_at(length);
        rest = behind.trim_start();
        match first {
            '0'..='9' | '.' if wanted => {
                values.push(T::number(number(word)?));
                wanted = false;
            }
            '(' if wanted => {
                waiting.push(Waiting::Open(function.take(), values.len()));
            }
            ',' | ')' if !wanted => {
                while let Some(step) = waiting.pop_if(|w| !matches!(w, Waiting::Open(..))) {
                    take(&mut values, step).ok_or_else(unreadable)?;
                }
                if first == ',' {
                    wanted = true;
                    continue;
                }
                let Some(Waiting::Open(of, before)) = waiting.pop() else { return Err(unreadable()) };
                let mut inside = values.split_off(before);
                values.push(match (of, inside.len()) {
                    (Some(name), 1 | 2) => T::call(name, inside),
                    (None, 1) => inside.remove(0).in_brackets(),
                    _ => return Err(unreadable()),
                });
            }
            '+' if wanted => {}
            '-' if wanted => waiting.push(Waiting::Sign),
            '+' | '-' | '*' | '/' | '^' if !wanted => {
                let this = Waiting::Operator(first);
                // of two powers the right one comes first
                let least = this.rank() + u8::from(first == '^');
                while let Some(step) = waiting.pop_if(|w| w.rank() >= least) {
                    take(&mut values, step).ok_or_else(unreadable)?;
                }
                waiting.push(this);
                wanted = true;
            }
            _ if wanted && word.starts_with(|c: char| c.is_ascii_alphabetic() || c == '_') => {
                if rest.starts_with('(') {
                    function = Some(word);
                } else {
                    values.push(T::word(word));
                    wanted = false;
                }
            }
            _ => return Err(unreadable()),
        }
    }
    while let Some(step) = waiting.pop() {
        take(&mut values, step).ok_or_else(unreadable)?;
    }
    match (values.pop(), values.is_empty()) {
        (Some(whole), true) if !wanted => Ok(whole),
        _ => Err(unreadable()),
    }
}

/// Takes a step that has waited; `None` where its values are missing, or a bracket is not closed.
fn take<T: Steps>(values: &mut Vec<T>, step: Waiting<'_>) -> Option<()> {
    let right = values.pop()?;
    let made = match step {
        Waiting::Sign => right.negative(),
        Waiting::Operator(sign) => values.pop()?.operator(sign, right),
        Waiting::Open(..) => return None,
    };
    values.push(made);
    Some(())
}

/// Digits and points, with an exponent where digits follow it.
fn number_length(text: &str) -> usize {
    let bytes = text.as_bytes();
    let digits = |from: usize| bytes.iter().skip(from).take_while(|b| b.is_ascii_digit()).count();
    let mut end = bytes.iter().take_while(|b| b.is_ascii_digit() || **b == b'.').count();
    if matches!(bytes.get(end), Some(b'e' | b'E')) {
        let sign = usize::from(matches!(bytes.get(end + 1), Some(b'+' | b'-')));
        let exponent = digits(end + 1 + sign);
        if exponent > 0 {
            end += 1 + sign + exponent;
        }
    }
    end
}

fn number(word: &str) -> Result<f64, String> {
    let value: f64 = word.parse().map_err(|_| format!("{word:?} is no number"))?;
    if value.is_finite() { Ok(value) } else { Err(format!("{word:?} is too large a number")) }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A formula with brackets around every step whose order could be doubted.
    struct Spelled(String);

    impl Steps for Spelled {
        fn number(value: f64) -> Self {
            Self(value.to_string())
        }

        fn word(name: &str) -> Self {
            Self(name.to_owned())
        }

        fn negative(self) -> Self {
            Self(format!("(-{})", self.0))
        }

        fn operator(self, sign: char, right: Self) -> Self {
            Self(format!("({}{sign}{})", self.0, right.0))
        }

        fn call(name: &str, arguments: Vec<Self>) -> Self {
            let inside: Vec<String> = arguments.into_iter().map(|Self(text)| text).collect();
            Self(format!("{name}({})", inside.join(",")))
        }

        fn in_brackets(self) -> Self {
            self
        }
    }

    fn spelled_out(text: &str) -> Result<String, String> {
        fold(text).map(|Spelled(text)| text)
    }

    #[test]
    fn brackets_say_the_order() {
        for (text, written) in [
            ("-X^2", "(-(X^2))"),
            ("-(X)^2", "(-(X^2))"),
            ("2^-X", "(2^(-X))"),
            ("2^3^2", "(2^(3^2))"),
            ("2^-X^2*3", "((2^(-(X^2)))*3)"),
            ("a - b - c", "((a-b)-c)"),
            ("a - b + c", "((a-b)+c)"),
            ("a / b * c", "((a/b)*c)"),
            ("a * b / c - d*e", "(((a*b)/c)-(d*e))"),
            ("a*-b", "(a*(-b))"),
            ("--a", "(-(-a))"),
            ("1.5e-3*pi", "(0.0015*pi)"),
            ("mod(a, mod(b, 2))", "mod(a,mod(b,2))"),
            ("sin(-B)", "sin((-B))"),
        ] {
            assert_eq!(spelled_out(text).unwrap(), written, "{text}");
        }
        for text in ["", "1 +", "(1", "1)", "1 2", "sin", "sin()", ",", "a,b", "1..2", "2(3)", "å", "1e999"] {
            // a bare word is a variable: the expression knows whether there is one
            assert_eq!(spelled_out(text).is_err(), text != "sin", "{text}");
        }
    }
}
