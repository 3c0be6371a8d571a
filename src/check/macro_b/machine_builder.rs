//! What a builder has made otherwise, as the `[settings]` of the postprocessor file say it.

use crate::check::run::Spoken;
use crate::post::{Overflow, Postprocessor};

/// M functions that mean the same to every control: no setting makes something else of them.
const EVERYBODY_S: [f64; 9] = [0.0, 1.0, 2.0, 3.0, 4.0, 6.0, 30.0, 98.0, 99.0];

/// Letters behind which an angle of the spindle may stand.
const ANGLES: [&str; 3] = ["R", "S", "P"];

/// What the control has beyond what all of them have.
#[derive(Debug)]
pub struct Builder {
    /// Blocks that switch the probe: letters with their numbers.
    switches: Vec<Vec<(char, f64)>>,
    /// Words behind which macro statements wait until the moves before them are done.
    waits: Vec<(char, f64)>,
    /// The first of them, for messages.
    wait_word: String,
    /// M function that turns the spindle, and the word with its angle.
    orient: (f64, &'static str),
    /// Variable that is 1 while the probe is deflected.
    probe_input: Option<u32>,
    /// Common variables that the program writes over: the touch at which it stopped, and where it has found the artefact.
    pub common: Vec<u32>,
    /// What does not fit into a field of the log is not written.
    pub cuts: bool,
}

impl Builder {
    pub fn from_settings(post: &Postprocessor) -> Self {
        let setting = |name: &str| post.settings.get(name).map_or("", String::as_str);
        let switches =
            ["probe_on", "probe_off"].into_iter().flat_map(|name| setting(name).lines()).map(block).collect();
        let builder_s = |words: Vec<(char, f64)>| {
            words.into_iter().filter(|(letter, m)| *letter == 'M' && !EVERYBODY_S.contains(m)).collect::<Vec<_>>()
        };
        let words: &[String] = post.check.as_ref().map_or(&[], |c| &c.waits);
        let known = words.iter().flat_map(|word| block(word));
        let orient = setting("orient").split_once(char::is_whitespace).and_then(|(function, letter)| {
            let number = block(function).first().filter(|(l, m)| *l == 'M' && !EVERYBODY_S.contains(m))?.1;
            Some((number, ANGLES.into_iter().find(|a| *a == letter.trim())?))
        });
        Self {
            switches,
            waits: setting("wait").lines().flat_map(|line| builder_s(block(line))).chain(known).collect(),
            wait_word: words.first().cloned().unwrap_or_default(),
            orient: orient.unwrap_or((19.0, "R")),
            probe_input: setting("probe_input").trim().strip_prefix('#').and_then(|n| n.parse().ok()),
            common: ["stopped_in", "found_x", "found_y", "found_z", "found_off", "found_room"]
                .into_iter()
                .filter_map(|name| setting(name).trim().strip_prefix('#')?.parse().ok())
                .collect(),
            cuts: post.check.as_ref().is_some_and(|c| c.field_overflow == Overflow::Cut),
        }
    }

    /// Does this M function switch the probe?
    pub fn switches(&self, m: f64) -> bool {
        !EVERYBODY_S.contains(&m) && self.switches.iter().flatten().any(|word| *word == ('M', m))
    }

    /// Does this word make macro statements wait?
    pub fn waits(&self, letter: char, number: f64) -> bool {
        self.waits.contains(&(letter, number))
    }

    /// A word that makes them wait, for messages.
    pub fn wait_word(&self) -> &str {
        &self.wait_word
    }

    /// Is it an M function of the builder's that makes macro statements wait?
    pub fn is_waiting_function(&self, m: f64) -> bool {
        !EVERYBODY_S.contains(&m) && self.waits('M', m)
    }

    /// The word with the angle, where this M function turns the spindle.
    pub fn orients(&self, m: f64) -> Option<&'static str> {
        (self.orient.0 == m).then_some(self.orient.1)
    }

    /// Is the word part of what the builder's M function in its block is given?
    pub fn uses(&self, word: &Spoken, words: &[Spoken]) -> bool {
        let ms = || words.iter().filter(|w| w.address == "M").map(|w| w.value);
        let given = |line: &Vec<(char, f64)>| {
            let is = |(letter, value): &(char, f64)| word.address.starts_with(*letter) && word.value == *value;
            line.iter().any(is) && ms().any(|m| self.switches(m) && line.contains(&('M', m)))
        };
        ms().any(|m| self.orients(m) == Some(word.address)) || self.switches.iter().any(given)
    }

    /// Does this variable hold whether the probe is deflected?
    pub fn is_probe_input(&self, variable: u32) -> bool {
        self.probe_input == Some(variable)
    }
}

/// The words of a block that a setting holds.
fn block(line: &str) -> Vec<(char, f64)> {
    let starts: Vec<usize> = line.char_indices().filter(|(_, c)| c.is_ascii_uppercase()).map(|(at, _)| at).collect();
    let ends = starts.iter().skip(1).copied().chain([line.len()]);
    let word =
        |(from, to): (&usize, usize)| Some((line[*from..].chars().next()?, line[from + 1..to].trim().parse().ok()?));
    starts.iter().zip(ends).filter_map(word).collect()
}
