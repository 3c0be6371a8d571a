//! How one control spells numbers, axis words, remarks and names. Pure functions over the checked data.

use super::as_written::LengthUnit;
use crate::axes::{AxisMap, AxisName};
use crate::units::{inch_from_mm, mm_from_inch};
use std::collections::BTreeMap;

/// How numbers and axis words are written.
#[derive(Debug, Clone, PartialEq)]
pub struct NumberRule {
    /// Digits after the decimal mark.
    pub decimals: usize,
    /// Zeros at the end stay.
    pub trailing_zeros: bool,
    /// Whole numbers carry the mark too.
    pub always_mark: bool,
    /// Positive numbers carry a `+`.
    pub plus: bool,
    /// `.` or `,`
    pub mark: char,
    /// `{axis}{value}`
    pub word: String,
    pub unit: LengthUnit,
    /// What the control calls an axis, where that is not its letter.
    pub names: BTreeMap<AxisName, String>,
    /// The number of an axis at the control, where it is not its place among the machine's axes.
    pub numbers: BTreeMap<AxisName, usize>,
}

impl NumberRule {
    /// A finite number; never `-0`.
    #[must_use]
    pub fn number(&self, value: f64) -> String {
        let mut text = format!("{value:.*}", self.decimals);
        if !self.trailing_zeros && text.contains('.') {
            let kept = text.trim_end_matches('0').len();
            text.truncate(kept);
        }
        if !self.always_mark && text.ends_with('.') {
            text.pop();
        }
        if self.always_mark && !text.contains('.') {
            text.push('.');
        }
        if text.starts_with('-') && !text.bytes().any(|b| (b'1'..=b'9').contains(&b)) {
            text.remove(0);
        }
        if self.plus && !text.starts_with('-') {
            text.insert(0, '+');
        }
        if self.mark == '.' { text } else { text.replace('.', &self.mark.to_string()) }
    }

    /// A length in mm, from the control's unit.
    #[must_use]
    pub fn mm(&self, length: f64) -> f64 {
        match self.unit {
            LengthUnit::Mm => length,
            LengthUnit::Inch => mm_from_inch(length),
        }
    }

    /// A length (or a feed) in the control's unit, from mm.
    #[must_use]
    pub fn length(&self, mm: f64) -> String {
        self.number(match self.unit {
            LengthUnit::Mm => mm,
            LengthUnit::Inch => inch_from_mm(mm),
        })
    }

    /// A position of an axis, from mm or deg.
    #[must_use]
    pub fn position(&self, axis: AxisName, value: f64) -> String {
        if axis.is_rotary() { self.number(value) } else { self.length(value) }
    }

    /// What the control calls an axis.
    #[must_use]
    pub fn name(&self, axis: AxisName) -> String {
        self.names.get(&axis).cloned().unwrap_or_else(|| axis.to_string())
    }

    /// What words may call the axes: names that were given before letters, longer ones first, each name once.
    #[must_use]
    pub fn spoken(&self) -> Vec<(String, AxisName)> {
        let given = |a: &AxisName| self.names.contains_key(a);
        let mut names: Vec<(String, AxisName)> = Vec::new();
        let (own, letters): (Vec<AxisName>, Vec<AxisName>) = AxisName::ALL.into_iter().partition(given);
        for axis in own.into_iter().chain(letters) {
            let name = self.name(axis);
            if !name.is_empty() && names.iter().all(|(n, _)| *n != name) {
                names.push((name, axis));
            }
        }
        names.sort_by_key(|(name, _)| std::cmp::Reverse(name.len()));
        names
    }

    /// An axis word, e.g. `X-33.5`.
    #[must_use]
    pub fn axis_word(&self, axis: AxisName, value: f64) -> String {
        self.word.replace("{axis}", &self.name(axis)).replace("{value}", &self.position(axis, value))
    }

    /// The axes whose words differ between two places: those that a move from one to the other must name.
    #[must_use]
    pub fn moved(&self, from: &AxisMap, to: &AxisMap) -> AxisMap {
        let mut moved = AxisMap::default();
        for (axis, value) in to.iter() {
            if from.get(axis).is_none_or(|old| self.position(axis, old) != self.position(axis, value)) {
                moved.set(axis, value);
            }
        }
        moved
    }
}

/// How remarks and messages are written.
#[derive(Debug, Clone, PartialEq)]
pub struct CommentRule {
    /// Before the text.
    pub open: String,
    /// After it.
    pub close: String,
    /// Longer remarks go on in the next line, characters.
    pub width: usize,
    /// The longest message to the operator that is shown whole, characters.
    pub message_width: Option<usize>,
    pub replace: BTreeMap<char, String>,
    /// For a character outside printable ASCII.
    pub other: String,
    /// All letters become capitals.
    pub capitals: bool,
    /// First words that would make a remark do something.
    pub reserved: Vec<String>,
    /// Put before such a word.
    pub reserved_prefix: String,
}

impl CommentRule {
    /// A text with nothing in it that the control would not take in a remark or a message.
    #[must_use]
    pub fn clean(&self, text: &str) -> String {
        let mut clean = String::with_capacity(text.len());
        for character in text.chars() {
            match self.replace.get(&character) {
                Some(instead) => clean.push_str(instead),
                None if (' '..='~').contains(&character) => clean.push(character),
                None if character.is_whitespace() => clean.push(' '),
                None => clean.push_str(&self.other),
            }
        }
        if self.capitals { clean.to_ascii_uppercase() } else { clean }
    }

    /// A remark of one or more lines, without the last line end.
    #[must_use]
    pub fn note(&self, text: &str) -> String {
        let clean = self.clean(text);
        let mut lines = Vec::new();
        let mut line = String::new();
        for word in clean.split(' ').filter(|w| !w.is_empty()) {
            if !line.is_empty() && line.len() + 1 + word.len() > self.width {
                lines.push(std::mem::take(&mut line));
            }
            let mut rest = word;
            // a word longer than a line is cut: the text is ASCII by now
            while rest.len() > self.width {
                let (head, tail) = rest.split_at(self.width);
                lines.push(head.to_owned());
                rest = tail;
            }
            if !line.is_empty() {
                line.push(' ');
            }
            line.push_str(rest);
        }
        if !line.is_empty() || lines.is_empty() {
            lines.push(line);
        }
        let spelled: Vec<String> = lines
            .iter()
            .map(|line| {
                let prefix = if self.is_reserved(line) { self.reserved_prefix.as_str() } else { "" };
                format!("{}{prefix}{line}{}", self.open, self.close)
            })
            .collect();
        spelled.join("\n")
    }

    /// Would the control act on a remark that begins like this?
    fn is_reserved(&self, line: &str) -> bool {
        let squeezed: String = line.chars().filter(|c| !c.is_whitespace()).collect();
        let begins = |text: &str, word: &str| {
            text.get(..word.len()).is_some_and(|head| head.eq_ignore_ascii_case(word))
                && !text[word.len()..].starts_with(|c: char| c.is_ascii_alphanumeric())
        };
        // as one word, or with blanks in it: what nearly acts is no remark
        self.reserved.iter().any(|word| begins(line.trim_start(), word) || begins(&squeezed, word))
    }
}

/// A name of a file or in a log with only these characters; others become `-`, and it is never empty.
#[must_use]
pub fn name_of(text: &str, allowed: impl Fn(char) -> bool) -> String {
    let name: String = text.chars().map(|c| if allowed(c) { c } else { '-' }).collect();
    if name.is_empty() { "-".to_owned() } else { name }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn rule() -> NumberRule {
        NumberRule {
            decimals: 3,
            trailing_zeros: false,
            always_mark: false,
            plus: false,
            mark: '.',
            word: "{axis}{value}".into(),
            unit: LengthUnit::Mm,
            names: BTreeMap::new(),
            numbers: BTreeMap::new(),
        }
    }

    #[test]
    fn numbers_are_written_as_the_control_wants_them() {
        let plain = rule();
        assert_eq!(plain.number(-0.0001), "0");
        assert_eq!(plain.number(10.0), "10");
        assert_eq!(plain.number(-10.25), "-10.25");
        assert_eq!(plain.axis_word(AxisName::B, -30.0), "B-30");
        let marked = NumberRule { always_mark: true, ..rule() };
        assert_eq!(marked.number(100.0), "100.");
        assert_eq!(marked.number(-0.0), "0.");
        let heidenhain = NumberRule { plus: true, mark: ',', trailing_zeros: true, ..rule() };
        assert_eq!(heidenhain.number(1.5), "+1,500");
        assert_eq!(heidenhain.number(-0.0001), "+0,000");
        let whole = NumberRule { decimals: 0, always_mark: true, ..rule() };
        assert_eq!(whole.number(7.0), "7.");
    }

    fn comment() -> CommentRule {
        CommentRule {
            open: "(".into(),
            close: ")".into(),
            width: 20,
            message_width: None,
            replace: BTreeMap::from([('(', "[".into()), (')', "]".into())]),
            other: "?".into(),
            capitals: false,
            reserved: vec!["MSG".into(), "LOG".into()],
            reserved_prefix: "- ".into(),
        }
    }

    #[test]
    fn remarks_cannot_nest_or_act() {
        assert_eq!(comment().note("plate (flat), ä"), "(plate [flat], ?)");
        assert_eq!(comment().note("m sg, hello"), "(- m sg, hello)");
        assert_eq!(comment().note("logarithm"), "(logarithm)");
        assert_eq!(comment().note("log, x"), "(- log, x)");
        assert_eq!(comment().note(""), "()");
        assert_eq!(comment().note("one two three four five six"), "(one two three four)\n(five six)");
    }

    proptest! {
        #[test]
        fn no_remark_breaks_out_of_its_line(text in "\\PC{0,200}") {
            for line in comment().note(&text).lines() {
                prop_assert!(line.starts_with('(') && line.ends_with(')'));
                prop_assert!(line.is_ascii() && line.len() <= 24);
                prop_assert_eq!(line.matches(['(', ')']).count(), 2);
            }
        }

        #[test]
        fn numbers_read_back(value in -1e4..1e4f64) {
            let text = rule().number(value);
            prop_assert!((text.parse::<f64>().unwrap() - value).abs() <= 0.0005001);
            prop_assert!(text != "-0");
        }
    }
}
