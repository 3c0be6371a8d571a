//! What the numbers of a file of centres mean: lines `# key = value` in its head, or options of the caller.

use crate::diag::{Failure, Finding, Findings, Result, Source};
use crate::post::as_written::LengthUnit;
use std::ops::Range;

/// What the coordinates of a centre are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// Machine coordinates of the axes while the ball is on the centre.
    Machine,
    /// Coordinates under the control's own transformation.
    Workpiece,
    /// Readings of a sensor, which count from an unknown zero (R-test, BK4).
    Reading,
}

impl Kind {
    /// As it is written.
    #[must_use]
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Machine => "machine",
            Self::Workpiece => "workpiece",
            Self::Reading => "reading",
        }
    }

    /// From its word.
    #[must_use]
    pub fn from_word(word: &str) -> Option<Self> {
        [Self::Machine, Self::Workpiece, Self::Reading].into_iter().find(|k| k.as_str().eq_ignore_ascii_case(word))
    }
}

/// What machine coordinates are the position of.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Counted {
    /// The ball's centre: the control subtracts the tool's length.
    Ball,
    /// The spindle: the tool's length is not in them.
    Spindle,
}

impl Counted {
    /// As it is written.
    #[must_use]
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Ball => "ball",
            Self::Spindle => "spindle",
        }
    }

    /// From its word.
    #[must_use]
    pub fn from_word(word: &str) -> Option<Self> {
        [Self::Ball, Self::Spindle].into_iter().find(|k| k.as_str().eq_ignore_ascii_case(word))
    }
}

/// What is said about a file of centres. Lengths mm.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Stated {
    /// Unit of X, Y and Z.
    pub unit: Option<LengthUnit>,
    /// What X, Y and Z are.
    pub kind: Option<Kind>,
    /// What they are the position of.
    pub position_of: Option<Counted>,
    /// Standard deviation of each coordinate.
    pub sigma_um: Option<f64>,
    /// `table` or the letter of the axis that bears the sphere.
    pub carrier: Option<String>,
    /// From the spindle to the ball's centre.
    pub tool_length_mm: Option<f64>,
    /// Where the sphere is with all axes at 0, in R.
    pub sphere_at_mm: Option<[f64; 3]>,
    /// Where the zero of workpiece coordinates is with all axes at 0, in R.
    pub zero_at_mm: Option<[f64; 3]>,
}

/// `mm` or `inch`.
#[must_use]
pub fn unit_of(word: &str) -> Option<LengthUnit> {
    match word.to_ascii_lowercase().as_str() {
        "mm" => Some(LengthUnit::Mm),
        "in" | "inch" => Some(LengthUnit::Inch),
        _ => None,
    }
}

/// Three numbers between commas.
fn three(word: &str) -> Option<[f64; 3]> {
    let numbers = word.split(',').map(|w| w.trim().parse::<f64>().ok().filter(|x| x.is_finite()));
    numbers.collect::<Option<Vec<f64>>>()?.try_into().ok()
}

impl Stated {
    /// Takes a remark of the head: `key = value`. Other remarks are for people.
    pub(super) fn take(&mut self, line: &[u8], range: Range<usize>, source: &Source, findings: &mut Findings) {
        let line = String::from_utf8_lossy(line);
        let Some((key, value)) = line.split_once(['=', ':']) else { return };
        let (key, value) = (key.trim().to_ascii_lowercase().replace('-', "_"), value.trim());
        let number = || value.parse::<f64>().ok().filter(|x| x.is_finite() && *x > 0.0);
        let is_good = match key.as_str() {
            "unit" => put(&mut self.unit, unit_of(value)),
            "kind" => put(&mut self.kind, Kind::from_word(value)),
            "position_of" => put(&mut self.position_of, Counted::from_word(value)),
            "sigma_um" => put(&mut self.sigma_um, number()),
            "tool_length_mm" => put(&mut self.tool_length_mm, number()),
            "sphere_at_mm" => put(&mut self.sphere_at_mm, three(value)),
            "zero_at_mm" => put(&mut self.zero_at_mm, three(value)),
            "carrier" => put(&mut self.carrier, (!value.is_empty()).then(|| value.to_owned())),
            _ => true,
        };
        if !is_good {
            let expected = match key.as_str() {
                "unit" => "mm or inch",
                "kind" => "machine, workpiece or reading",
                "position_of" => "ball or spindle",
                "sphere_at_mm" | "zero_at_mm" => "three numbers in mm, such as 200, 0, -250",
                "carrier" => "table or the letter of an axis",
                _ => "a number greater than 0, with a decimal point",
            };
            let finding = Finding::error("centres::head", format!("{key} is {value:?}, expected {expected}"))
                .help("correct this line of the head, or remove it and give the option of the same name");
            findings.push(finding.at(source, range));
        }
    }

    /// What the file and the caller say together.
    ///
    /// # Errors
    /// When they contradict each other.
    pub fn with(self, given: Self) -> Result<Self> {
        fn one<T: PartialEq>(file: Option<T>, given: Option<T>, name: &str) -> Result<Option<T>> {
            match (file, given) {
                (Some(file), Some(given)) if file != given => Err(Failure::new(
                    "centres::contradiction",
                    format!("the file and the option --{name} contradict each other"),
                )
                .help("leave the option out, or correct the head of the file")),
                (file, given) => Ok(file.or(given)),
            }
        }
        Ok(Self {
            unit: one(self.unit, given.unit, "unit")?,
            kind: one(self.kind, given.kind, "kind")?,
            position_of: one(self.position_of, given.position_of, "position-of")?,
            sigma_um: one(self.sigma_um, given.sigma_um, "sigma-um")?,
            carrier: one(self.carrier, given.carrier, "carrier")?,
            tool_length_mm: one(self.tool_length_mm, given.tool_length_mm, "tool-length")?,
            sphere_at_mm: one(self.sphere_at_mm, given.sphere_at_mm, "sphere-at")?,
            zero_at_mm: one(self.zero_at_mm, given.zero_at_mm, "zero-at")?,
        })
    }
}

/// Keeps what was read; `false`: it cannot be read.
fn put<T>(slot: &mut Option<T>, read: Option<T>) -> bool {
    let is_good = read.is_some();
    *slot = read.or(slot.take());
    is_good
}
