//! Formulas of a user's effects, as the virtual machine reads them: it parses and evaluates them by itself, so that a fault of the
//! model's reader is no fault of both. What a word stands for is taken from the virtual machine's own state of a touch.

use crate::axes::{AxisName, Position};
use crate::simulate::terms::TouchState;

/// Words for the state of a touch, as messages list them.
pub const STATE_WORDS: &str = "X Y Z A B C t T nx ny nz mx my mz sX sY sZ sA sB sC feed S gx gy gz L L0 bx by bz px py pz \
    ox oy oz edge wA wB wC wayA wayB wayC speed1 on1 off1 speed2 on2 off2 \
    speed3 on3 off3 speed4 on4 off4 hx hy hz";

/// Functions, as messages list them.
pub const FUNCTION_WORDS: &str = "sin cos tan asin acos atan atan2 exp ln sqrt abs sign floor mod step";

/// Numbers with a name.
const NUMBERS: [&str; 4] = ["pi", "PI", "e", "E"];

/// Can a parameter have this name? It would hide a word that formulas have already.
pub fn is_free(name: &str) -> bool {
    let letter = |c: char| c.is_ascii_alphabetic() || c == '_';
    let is_word = name.starts_with(letter) && name.chars().all(|c| letter(c) || c.is_ascii_digit());
    let mut taken = STATE_WORDS.split_whitespace().chain(FUNCTION_WORDS.split_whitespace()).chain(NUMBERS);
    is_word && !taken.any(|word| word == name)
}

/// What a word stands for.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Word {
    /// Position of an axis: mm, or rad.
    Axis(AxisName),
    /// Sense of its last motion.
    Sense(AxisName),
    /// Where a rotary axis stood before, rad.
    Before(usize),
    /// How far a rotary axis has turned since it last turned back, rad.
    SinceReversal(usize),
    Hours,
    Temperature,
    NormalInMachine(usize),
    NormalInProbe(usize),
    Feed,
    Spindle,
    Gravity(usize),
    GravityAtBlock(usize),
    Stylus,
    OwnStylus,
    NormalOfBlock(usize),
    Point(usize),
    Outward(usize),
    Edge,
    /// Of the stretch in which the spindle ran last (0), of the one before (1) …: its speed over the highest, its begin, its end.
    Spun(usize, usize),
    /// A parameter of the effect, by its number.
    Parameter(usize),
}

impl Word {
    fn parse(text: &str, parameters: &[String]) -> Option<Self> {
        if let Some(i) = parameters.iter().position(|p| p == text) {
            return Some(Self::Parameter(i));
        }
        let axis = |word: &str| {
            let mut letters = word.chars();
            let first = letters.next().filter(char::is_ascii_uppercase)?;
            if letters.next().is_some() { None } else { AxisName::from_letter(first) }
        };
        let along = |last: Option<char>| last.and_then(|c| "xyz".find(c));
        Some(match text {
            "t" => Self::Hours,
            "T" => Self::Temperature,
            "feed" => Self::Feed,
            "S" => Self::Spindle,
            "L" => Self::Stylus,
            "L0" => Self::OwnStylus,
            "edge" => Self::Edge,
            _ if axis(text).is_some() => Self::Axis(axis(text)?),
            _ if text.starts_with('s') && axis(&text[1..]).is_some() => Self::Sense(axis(&text[1..])?),
            "wayA" => Self::SinceReversal(0),
            "wayB" => Self::SinceReversal(1),
            "wayC" => Self::SinceReversal(2),
            _ if spun(text).is_some() => spun(text)?,
            "wA" => Self::Before(0),
            "wB" => Self::Before(1),
            "wC" => Self::Before(2),
            _ if text.len() == 2 && text.is_ascii() => {
                let i = along(text.chars().nth(1))?;
                match text.as_bytes()[0] {
                    b'n' => Self::NormalInMachine(i),
                    b'm' => Self::NormalInProbe(i),
                    b'g' => Self::Gravity(i),
                    b'h' => Self::GravityAtBlock(i),
                    b'b' => Self::NormalOfBlock(i),
                    b'p' => Self::Point(i),
                    b'o' => Self::Outward(i),
                    _ => return None,
                }
            }
            _ => return None,
        })
    }

    fn value(self, touch: &TouchState, joints: &Position, parameters: &[f64]) -> f64 {
        match self {
            Self::Axis(name) => joints.mm_or_rad(name),
            Self::Sense(name) => touch.sense[name.index()],
            Self::Before(i) => touch.stood_before_rad[i],
            Self::SinceReversal(i) => touch.since_reversal_rad[i],
            Self::Hours => touch.hours,
            Self::Temperature => touch.temperature_deg_c,
            Self::NormalInMachine(i) => plain(touch.normal_machine[i]),
            Self::NormalInProbe(i) => plain(touch.normal_probe[i]),
            Self::Feed => touch.feed_mm_min,
            Self::Spindle => touch.spindle_rad,
            Self::Gravity(i) => plain(touch.down_tool[i]),
            Self::GravityAtBlock(i) => plain(touch.down_carrier[i]),
            Self::Stylus => touch.stylus_mm,
            Self::OwnStylus => touch.own_stylus_mm,
            Self::NormalOfBlock(i) => touch.normal_carrier[i],
            Self::Point(i) => touch.point[i],
            Self::Outward(i) => plain(touch.outward[i]),
            Self::Edge => touch.edge_mm,
            Self::Spun(which, part) => spun_at(touch, which)[part],
            Self::Parameter(i) => parameters.get(i).copied().unwrap_or(f64::NAN),
        }
    }
}

/// `speed2`, `on2`, `off2`: of the last stretch but one.
fn spun(text: &str) -> Option<Word> {
    let word = text.trim_end_matches(|c: char| c.is_ascii_digit());
    let part = ["speed", "on", "off"].iter().position(|w| *w == word)?;
    match &text[word.len()..] {
        "1" => Some(Word::Spun(0, part)),
        "2" => Some(Word::Spun(1, part)),
        "3" => Some(Word::Spun(2, part)),
        "4" => Some(Word::Spun(3, part)),
        _ => None,
    }
}

/// Speed, begin and end of the last stretch of the spindle (0) or one before; nothing where there is none.
fn spun_at(touch: &TouchState, which: usize) -> [f64; 3] {
    if touch.spindle.is_empty() {
        return if which == 0 { [1.0, 0.0, touch.hours] } else { [0.0; 3] };
    }
    let highest = touch.spindle.iter().fold(0.0, |most: f64, s| most.max(s[2]));
    let begun = touch.spindle.iter().rev().filter(|s| s[0] < touch.hours);
    begun.skip(which).map(|&[from, to, rpm]| [rpm / highest, from, to.min(touch.hours)]).next().unwrap_or_default()
}

/// A part of a direction: a millionth of a millionth is what sines leave of 0, and a formula may jump with its sign.
fn plain(part: f64) -> f64 {
    if part.abs() <= 1e-12 { 0.0 } else { part }
}

/// A step of a formula on a pile of values: the last values are taken, and what comes of them is put there.
#[derive(Debug, Clone, Copy)]
enum Step {
    /// A number is put there.
    Number(f64),
    /// The value of one of the formula's words is put there.
    Word(usize),
    /// Of the last value.
    One(fn(f64) -> f64),
    /// Of the last two.
    Two(fn(f64, f64) -> f64),
}

impl Step {
    fn function(name: &str) -> Option<Self> {
        // the remainder has the sign of the divisor
        let remainder = |a: f64, b: f64| a - (a / b).floor() * b;
        Some(match name {
            "sin" => Self::One(f64::sin),
            "cos" => Self::One(f64::cos),
            "tan" => Self::One(f64::tan),
            "asin" => Self::One(f64::asin),
            "acos" => Self::One(f64::acos),
            "atan" => Self::One(f64::atan),
            "exp" => Self::One(f64::exp),
            "ln" => Self::One(f64::ln),
            "sqrt" => Self::One(f64::sqrt),
            "abs" => Self::One(f64::abs),
            "floor" => Self::One(f64::floor),
            "sign" => Self::One(|x| f64::from(x > 0.0) - f64::from(x < 0.0)),
            "step" => Self::One(|x| f64::from(x >= 0.0)),
            "atan2" => Self::Two(f64::atan2),
            "mod" => Self::Two(remainder),
            _ => return None,
        })
    }

    fn operator(sign: char) -> Self {
        Self::Two(match sign {
            '+' => |a, b| a + b,
            '-' => |a, b| a - b,
            '*' => |a, b| a * b,
            '/' => |a, b| a / b,
            _ => f64::powf,
        })
    }
}

/// The number at the beginning of a text, with an exponent too.
fn number_at(text: &str) -> Option<&str> {
    let byte = |at: usize| text.as_bytes().get(at).copied();
    let digits = |from: usize| text.bytes().skip(from).take_while(u8::is_ascii_digit).count();
    let whole = digits(0);
    let mut end = whole;
    if byte(end) == Some(b'.') {
        end += 1 + digits(end + 1);
    }
    if end == 0 || &text[..end] == "." {
        return None;
    }
    if matches!(byte(end), Some(b'e' | b'E')) {
        let sign = usize::from(matches!(byte(end + 1), Some(b'+' | b'-')));
        let exponent = digits(end + 1 + sign);
        if exponent > 0 {
            end += 1 + sign + exponent;
        }
    }
    Some(&text[..end])
}

/// Brackets, powers and signs inside of one another at most: each takes a part of the stack.
const DEEPEST: usize = 200;

/// Reads a formula by descent, the loosest level first: sums of products of signed powers.
struct Reader<'a> {
    rest: &'a str,
    parameters: &'a [String],
    words: Vec<Word>,
    steps: Vec<Step>,
    depth: usize,
}

impl<'a> Reader<'a> {
    /// Is this sign next? It is taken then.
    fn takes(&mut self, sign: char) -> bool {
        self.rest = self.rest.trim_start();
        let rest = self.rest.strip_prefix(sign);
        self.rest = rest.unwrap_or(self.rest);
        rest.is_some()
    }

    fn taken(&mut self, signs: [char; 2]) -> Option<char> {
        signs.into_iter().find(|sign| self.takes(*sign))
    }

    fn sum(&mut self) -> Result<(), String> {
        self.product()?;
        while let Some(sign) = self.taken(['+', '-']) {
            self.product()?;
            self.steps.push(Step::operator(sign));
        }
        Ok(())
    }

    fn product(&mut self) -> Result<(), String> {
        self.signed()?;
        while let Some(sign) = self.taken(['*', '/']) {
            self.signed()?;
            self.steps.push(Step::operator(sign));
        }
        Ok(())
    }

    /// A sign belongs to the whole power behind it, and an exponent may have one of its own.
    fn signed(&mut self) -> Result<(), String> {
        self.depth += 1;
        if self.depth > DEEPEST {
            return Err(format!("more than {DEEPEST} brackets, powers or signs stand inside of one another"));
        }
        match self.taken(['+', '-']) {
            Some('-') => {
                self.signed()?;
                self.steps.push(Step::One(|x| -x));
            }
            Some(_) => self.signed()?,
            None => {
                self.value()?;
                if self.takes('^') {
                    self.signed()?;
                    self.steps.push(Step::operator('^'));
                }
            }
        }
        self.depth -= 1;
        Ok(())
    }

    fn value(&mut self) -> Result<(), String> {
        if self.takes('(') {
            self.sum()?;
            return self.closed();
        }
        if let Some(number) = number_at(self.rest) {
            self.rest = &self.rest[number.len()..];
            self.steps.push(Step::Number(number.parse().map_err(|_| format!("{number:?} is no number"))?));
            return Ok(());
        }
        let end = self.rest.find(|c: char| !(c.is_ascii_alphanumeric() || c == '_')).unwrap_or(self.rest.len());
        let (word, rest) = self.rest.split_at(end);
        self.rest = rest;
        if let Some(known) = Word::parse(word, self.parameters) {
            self.words.push(known);
            self.steps.push(Step::Word(self.words.len() - 1));
            return Ok(());
        }
        if matches!(word, "pi" | "PI") {
            self.steps.push(Step::Number(std::f64::consts::PI));
            return Ok(());
        }
        let Some(function) = Step::function(word) else { return Err("a value is missing".to_owned()) };
        if !self.takes('(') {
            return Err("a function stands without its bracket".to_owned());
        }
        self.sum()?;
        if matches!(function, Step::Two(_)) {
            if !self.takes(',') {
                return Err(format!("{word:?} takes two values"));
            }
            self.sum()?;
        }
        self.closed()?;
        self.steps.push(function);
        Ok(())
    }

    fn closed(&mut self) -> Result<(), String> {
        if self.takes(')') { Ok(()) } else { Err("a bracket is not closed".to_owned()) }
    }
}

/// A formula with the values of the parameters that stand inside it.
#[derive(Debug, Clone)]
pub struct Formula {
    steps: Vec<Step>,
    words: Vec<Word>,
    /// In the parameters' own units.
    parameters: Vec<f64>,
    /// `mounting/block` or `block`, where it acts on one block only.
    only: Option<String>,
}

impl Formula {
    /// Reads a formula of an effect with these parameters.
    ///
    /// # Errors
    /// A sentence that says what is wrong, and one that says which words exist.
    pub fn read(text: &str, parameters: &[String]) -> Result<Self, (String, String)> {
        let help = || {
            let own = if parameters.is_empty() { String::new() } else { format!("; {}", parameters.join(" ")) };
            format!("words: {STATE_WORDS}{own}; functions: {FUNCTION_WORDS}; pi")
        };
        for (at, word) in words_in(text) {
            let function = FUNCTION_WORDS.split(' ').any(|f| f == word);
            if !function && !matches!(word, "pi" | "PI") && Word::parse(word, parameters).is_none() {
                return Err((format!("unknown word {word:?} at character {}", at + 1), help()));
            }
        }
        let mut reader = Reader { rest: text, parameters, words: Vec::new(), steps: Vec::new(), depth: 0 };
        reader.sum().map_err(|says| (says, help()))?;
        let rest = reader.rest.trim();
        if !rest.is_empty() {
            return Err((format!("{rest:?} stands behind the end of the formula"), help()));
        }
        let Reader { steps, words, .. } = reader;
        Ok(Self { steps, words, parameters: Vec::new(), only: None })
    }

    /// The same with values of the parameters (each in its own unit), on one block only where that is named.
    pub fn with(&self, parameters: &[f64], only: Option<&str>) -> Self {
        Self { parameters: parameters.to_vec(), only: only.map(str::to_owned), ..self.clone() }
    }

    /// Is it the same number at every touch, whatever the parameters inside it?
    pub fn is_constant(&self) -> bool {
        self.words.is_empty()
    }

    /// Does it change while the linear axes move?
    pub fn moves(&self) -> bool {
        self.words.iter().any(|w| matches!(w, Word::Axis(name) if !name.is_rotary()))
    }

    /// Does it need the time of the touch?
    pub fn timed(&self) -> bool {
        self.words.iter().any(|w| matches!(w, Word::Hours | Word::Temperature))
    }

    pub fn value(&self, touch: &TouchState, joints: &Position) -> f64 {
        let here = |only: &str| only == &*touch.label || Some(only) == touch.label.rsplit('/').next();
        if !self.only.as_deref().is_none_or(here) {
            return 0.0;
        }
        let mut pile: Vec<f64> = Vec::with_capacity(8);
        for step in &self.steps {
            let mut last = || pile.pop().unwrap_or(f64::NAN);
            let value = match *step {
                Step::Number(value) => value,
                Step::Word(i) => self.words[i].value(touch, joints, &self.parameters),
                Step::One(of) => of(last()),
                Step::Two(of) => {
                    let right = last();
                    of(last(), right)
                }
            };
            pile.push(value);
        }
        pile.pop().unwrap_or(f64::NAN)
    }
}

/// The words of a formula with the places at which they begin.
fn words_in(text: &str) -> Vec<(usize, &str)> {
    let mut out = Vec::new();
    let mut at = 0;
    while let Some(c) = text[at..].chars().next() {
        let rest = &text[at..];
        if let Some(number) = number_at(rest) {
            at += number.len();
        } else if c.is_alphabetic() || c == '_' {
            let end = rest.find(|c: char| !(c.is_alphanumeric() || c == '_')).unwrap_or(rest.len());
            out.push((text[..at].chars().count(), &rest[..end]));
            at += end;
        } else {
            at += c.len_utf8();
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    fn value(text: &str) -> f64 {
        let touch = TouchState { hours: 0.5, feed_mm_min: 60.0, point: [1.0, 2.0, 3.0], ..TouchState::default() };
        let joints = Position([10.0, 20.0, 30.0, 0.0, 90.0, 0.0]);
        let formula = Formula::read(text, &["tau".to_owned()]).unwrap();
        formula.with(&[0.25], None).value(&touch, &joints)
    }

    /// What a message lists, and what no parameter may be called, is what a formula knows.
    #[test]
    fn the_words_of_the_state_are_those_that_are_read() {
        let listed: Vec<&str> = STATE_WORDS.split_whitespace().collect();
        assert!(listed.iter().all(|word| Word::parse(word, &[]).is_some()));
        let letters = ('a'..='z').chain('A'..='Z').chain('0'..='9');
        let short = letters.clone().flat_map(|a| letters.clone().map(move |b| format!("{a}{b}")));
        let known: Vec<String> = short.filter(|word| Word::parse(word, &[]).is_some()).collect();
        assert!(known.len() > 20 && known.iter().all(|word| listed.contains(&word.as_str())), "{known:?}");
    }

    #[test]
    fn formulas_have_the_value_of_the_state() {
        for (text, expected) in [
            ("1 - exp(-t/tau)", 1.0 - (-2.0_f64).exp()),
            ("sin(B)*X + 2.5e-1*Y^2", 10.0 + 100.0),
            ("mod(-Z, 7) + atan2(1, 1)", 5.0 + std::f64::consts::FRAC_PI_4),
            ("-(px + py*pz)/feed", -7.0 / 60.0),
            ("step(t - 0.5) + step(t - 0.6) + sign(-2) + abs(-3)", 3.0),
            ("2^3*1e1 - .5", 79.5),
            ("cos(2*pi*X/10) + floor(1.9)", 2.0),
        ] {
            assert!((value(text) - expected).abs() < 1e-12, "{text}: {} {expected}", value(text));
        }
    }

    #[test]
    fn one_block_only() {
        let formula = Formula::read("1", &[]).unwrap();
        let touch = TouchState { label: "m/b".into(), ..TouchState::default() };
        let at = |only: &str| formula.with(&[], Some(only)).value(&touch, &Position::default());
        assert_eq!([at("b"), at("m/b"), at("c"), at("n/b")], [1.0, 1.0, 0.0, 0.0]);
    }

    #[test]
    fn mistakes_name_the_word_its_place_and_the_words_that_exist() {
        let (says, help) = Formula::read("1 - cos(Q)", &[]).unwrap_err();
        assert_eq!(says, "unknown word \"Q\" at character 9");
        assert!(help.contains("X Y Z A B C") && help.contains("atan2"));
        for text in ["", "1 +", "sine(B)", "(1", "1 2", "å", "2..3"] {
            assert!(Formula::read(text, &[]).is_err(), "{text}");
        }
    }

    #[test]
    fn formulas_have_the_values_that_python_computes() {
        let text = include_str!("../../../tests/formulas/expressions.json");
        let table: serde_json::Value = serde_json::from_str(text).unwrap();
        let at = |name: &str| table["variables"][name].as_f64().unwrap();
        let touch = TouchState { hours: at("t"), temperature_deg_c: at("T"), ..TouchState::default() };
        let degrees = |name: &str| at(name).to_degrees();
        let joints = Position([at("X"), at("Y"), at("Z"), degrees("A"), degrees("B"), degrees("C")]);
        let mut wrong = Vec::new();
        for row in table["rows"].as_array().unwrap() {
            let (text, expected) = (row["formula"].as_str().unwrap(), row["value"].as_f64().unwrap());
            let formula = Formula::read(text, &[]).unwrap_or_else(|e| panic!("{text}: {}", e.0));
            let value = formula.value(&touch, &joints);
            if (value - expected).abs() > 1e-9 * expected.abs().max(1.0) {
                wrong.push(format!("{text}: {value}, and {expected} in Python"));
            }
        }
        assert!(wrong.is_empty(), "{wrong:#?}");
    }

    #[test]
    fn brackets_within_brackets_end_with_a_sentence() {
        for deep in ["(".repeat(4000), "-".repeat(4000), "2^".repeat(2000)] {
            assert!(Formula::read(&deep, &[]).is_err());
        }
    }
}
