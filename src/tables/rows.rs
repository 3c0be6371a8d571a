//! Rows of a table: where they go, and how far the straight lines that a control draws between them are off the function
//! that the table represents.

use super::correction::rounded;
use crate::axes::AxisName;
use crate::diag::{Failure, Finding};
use crate::units::{rad_from_deg, um_from_mm};
use serde::{Deserialize, Serialize};

/// A table with fewer rows is taken where the straight lines follow to this, mm or deg: a tenth of what a control resolves.
const CLOSE_ENOUGH: f64 = 1e-5;

/// More turns than those in use are covered where the straight lines still follow to this, µm at 100 mm.
const GOOD_UM: f64 = 0.05;

/// An export is refused where the straight lines leave more than this, µm at 100 mm ...
const REFUSED_UM: f64 = 0.5;

/// ... and more than this share of the largest correction.
const REFUSED_SHARE: f64 = 0.1;

/// Where angles are judged, mm.
const JUDGED_AT_MM: f64 = 100.0;

const FULL_TURN_DEG: f64 = 360.0;

/// A table covers at most this many turns each way, where not more of them are in use.
const MOST_TURNS: f64 = 50.0;

/// Distance at which the function is sampled between two rows, mm or deg, and the least and the most samples there.
const SAMPLE: f64 = 0.25;
const SAMPLES: std::ops::RangeInclusive<f64> = 16.0..=4096.0;

/// Less is shown as 0, µm.
const NOTHING_UM: f64 = 1e-3;

/// Samples of the travel that the rows do not cover, on each side.
const BEYOND_SAMPLES: u32 = 4000;

/// What a table of rows leaves of the correction that it represents.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct TableError {
    /// By whose position.
    pub input: AxisName,
    /// Whose correction.
    pub output: AxisName,
    /// 0: in both directions of motion; 1, -1: while the input moves up, down.
    pub sense: i8,
    /// The control's number of the table, or the joint.
    pub number: usize,
    /// Count of rows.
    pub rows: usize,
    /// First and last row, machine coordinate, mm or deg.
    pub range: [f64; 2],
    /// After the last row the first follows.
    pub modulo: bool,
    /// Largest correction between the first and the last row, µm.
    pub correction_um: f64,
    /// No point between the first and the last row is off by more because of the straight lines between rows, µm.
    pub interpolation_um: f64,
    /// Where it is largest, machine coordinate, mm or deg.
    pub interpolation_at: f64,
    /// No row is off by more because values are rounded to the control's resolution, µm.
    pub rounding_um: f64,
    /// Travel that the rows do not cover: the control holds the end value there, which leaves this, µm.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub beyond_um: Option<f64>,
    /// Distance at which the error of an angle is stated, mm.
    pub lever_mm: f64,
}

impl TableError {
    /// The table, in words.
    #[must_use]
    pub fn name(&self) -> String {
        let by = if self.input == self.output { String::new() } else { format!(" by the position of {}", self.input) };
        let moving = match self.sense {
            0 => "",
            1.. => ", moving up",
            _ => ", moving down",
        };
        format!("table of {}{by}{moving}", self.output)
    }

    fn unit(&self) -> &'static str {
        if self.input.is_rotary() { "deg" } else { "mm" }
    }

    /// From where to where it corrects, in words.
    #[must_use]
    pub fn covers(&self) -> String {
        let [first, last] = self.range;
        let turns = if self.modulo { ", repeated every turn" } else { "" };
        format!("{first} to {last} {}{turns}", self.unit())
    }

    /// What it leaves, in words; `show` writes a number.
    #[must_use]
    pub fn says(&self, show: impl Fn(f64) -> String) -> String {
        let lever = if self.output.is_rotary() { format!(" at {} mm", self.lever_mm) } else { String::new() };
        // less than a nanometre is rounding of the computer's own numbers
        let show = |um: f64| show(if um < NOTHING_UM { 0.0 } else { um });
        let mut text = format!(
            "{} ({} rows, {}): corrects up to {} um{lever}; straight lines between the rows leave up to {} um, rounding of the values up to {} um",
            self.name(),
            self.rows,
            self.covers(),
            show(self.correction_um),
            show(self.interpolation_um),
            show(self.rounding_um)
        );
        if let Some(um) = self.beyond_um {
            text += &format!("; outside the rows the control holds the end value, which leaves up to {} um", show(um));
        }
        text
    }

    /// A length or angle of the correction at 100 mm, from one at the stated distance, µm.
    fn judged(&self, um: f64) -> f64 {
        if self.output.is_rotary() { um * JUDGED_AT_MM / self.lever_mm } else { um }
    }

    fn too_large(&self, um: f64) -> bool {
        self.judged(um) > REFUSED_UM && um > REFUSED_SHARE * self.correction_um
    }

    /// What refuses the export, or must be known before it is loaded.
    #[must_use]
    pub fn findings(&self) -> Vec<Finding> {
        let mut findings = Vec::new();
        let shown = |um: f64| format!("{um:.2}");
        if self.too_large(self.interpolation_um) {
            let says = format!(
                "the {} is too coarse for what it corrects: {} rows from {} leave up to {} um of {} um",
                self.name(),
                self.rows,
                self.covers(),
                shown(self.interpolation_um),
                shown(self.correction_um)
            );
            findings.push(Finding::error("tables::too_coarse", says).help(format!(
                "narrow `range` of {} in machines.toml to the travel in use, or remove from the model the effect that changes fastest with {}; \
                 --force exports it all the same",
                self.input, self.input
            )));
        }
        if let Some(um) = self.beyond_um.filter(|um| self.too_large(*um)) {
            let says = format!(
                "the {} covers {} only: outside, the control holds the end value, which leaves up to {} um",
                self.name(),
                self.covers(),
                shown(um)
            );
            let help = format!("keep {} between the first and the last row", self.input);
            findings.push(Finding::warning("tables::turns", says).help(help));
        }
        findings
    }
}

/// What a table is to represent.
pub(super) struct Wanted<'a> {
    /// By whose position.
    pub input: AxisName,
    /// Whose correction.
    pub output: AxisName,
    /// Machine coordinate of R's origin of the input, mm or deg.
    pub origin: f64,
    /// Travel of the input relative to R's origin, mm or deg.
    pub travel: [f64; 2],
    /// The part of it that the study's programs used, where that is known.
    pub used: Option<[f64; 2]>,
    /// The directions of motion that the table is for: 1, -1.
    pub senses: &'a [f64],
    /// What is to be added to the output's position, mm or deg, at a machine coordinate of the input, moving up or down.
    pub value: &'a dyn Fn(f64, f64) -> f64,
}

/// The largest difference of straight lines from the function, and the largest value of the function.
#[derive(Debug, Clone, Copy)]
struct Worst {
    off: f64,
    at: f64,
    value: f64,
}

/// Evenly placed positions from the first to the last.
fn even([low, high]: [f64; 2], count: usize) -> Vec<f64> {
    (0..count).map(|i| low + (high - low) * i as f64 / (count - 1) as f64).collect()
}

/// A difference of a length or an angle, µm.
fn um(axis: AxisName, off: f64, lever_mm: f64) -> f64 {
    um_from_mm(if axis.is_rotary() { rad_from_deg(off) * lever_mm } else { off })
}

impl Wanted<'_> {
    fn whole(&self) -> [f64; 2] {
        self.travel.map(|q| q + self.origin)
    }

    /// Ranges that a table may cover, the widest first; the last one holds the turns in use.
    fn ranges(&self) -> Vec<[f64; 2]> {
        let [low, high] = self.travel;
        let farthest = |[a, b]: [f64; 2]| a.abs().max(b.abs());
        if !self.input.is_rotary() || farthest(self.travel) <= FULL_TURN_DEG {
            return vec![self.whole()];
        }
        let turns = |deg: f64| (deg / FULL_TURN_DEG - 1e-9).ceil().max(1.0);
        // C -135 to 180 and C 0 to 360 are both usual: one turn each way is always in use
        let in_use = turns(self.used.map_or(0.0, farthest));
        let mut count = turns(farthest(self.travel)).min(MOST_TURNS).max(in_use);
        let mut ranges = Vec::new();
        while count >= in_use {
            let reach = count * FULL_TURN_DEG;
            let range = [low.max(-reach), high.min(reach)];
            if range[0] < range[1] {
                ranges.push(range.map(|q| q + self.origin));
            }
            count -= 1.0;
        }
        if ranges.is_empty() { vec![self.whole()] } else { ranges }
    }

    /// The range that a table of so many rows covers, and the fewest rows that follow the function closely.
    pub fn place(&self, counts: &[usize]) -> ([f64; 2], usize) {
        let ranges = self.ranges();
        let most = counts.iter().copied().max().unwrap_or(2).max(2);
        let good = GOOD_UM / um(self.output, 1.0, JUDGED_AT_MM);
        let follows = |range: [f64; 2]| self.worst(&even(range, most), good).off <= good;
        let last = ranges.last().copied().unwrap_or_else(|| self.whole());
        let range = ranges.iter().copied().find(|r| *r == last || follows(*r)).unwrap_or(last);
        (range, self.count(range, counts))
    }

    /// The fewest rows over a range that follow the function closely, else the most.
    pub fn count(&self, range: [f64; 2], counts: &[usize]) -> usize {
        let most = counts.iter().copied().max().unwrap_or(2).max(2);
        let follows = |n: &usize| *n >= 2 && self.worst(&even(range, *n), CLOSE_ENOUGH).off <= CLOSE_ENOUGH;
        counts.iter().copied().find(follows).unwrap_or(most)
    }

    /// How far straight lines between the function's values at these positions are off it: no point is off by more. Looks no
    /// further than to where it exceeds `enough`.
    ///
    /// Between two samples the function can rise above both by an eighth of its second difference where it is smooth, and by
    /// half of it where it has a corner (an older table's row): the half is added.
    fn worst(&self, positions: &[f64], enough: f64) -> Worst {
        let mut worst = Worst { off: 0.0, at: positions.first().copied().unwrap_or(0.0), value: 0.0 };
        for pair in positions.windows(2) {
            let (low, width) = (pair[0], pair[1] - pair[0]);
            let steps = (width / SAMPLE).ceil().clamp(*SAMPLES.start(), *SAMPLES.end()) as i32;
            for sense in self.senses {
                let (from, to) = ((self.value)(pair[0], *sense), (self.value)(pair[1], *sense));
                let (mut sampled, mut bent, mut at) = (0.0_f64, 0.0_f64, low);
                let mut before: [Option<f64>; 2] = [None; 2];
                // a sample outside on each side, so that a corner beside a row is seen
                for i in -1..=steps + 1 {
                    let share = f64::from(i) / f64::from(steps);
                    let here = low + share * width;
                    let value = (self.value)(here, *sense);
                    let off = value - (from + share * (to - from));
                    if !off.is_finite() {
                        return Worst { off: f64::INFINITY, at: here, value: f64::INFINITY };
                    }
                    if let [Some(a), Some(b)] = before {
                        bent = bent.max((off - 2.0 * b + a).abs());
                    }
                    before = [before[1], Some(off)];
                    if (0..=steps).contains(&i) {
                        worst.value = worst.value.max(value.abs());
                        if off.abs() > sampled {
                            (sampled, at) = (off.abs(), here);
                        }
                    }
                }
                if sampled + bent / 2.0 > worst.off {
                    (worst.off, worst.at) = (sampled + bent / 2.0, at);
                }
            }
            if worst.off > enough {
                break;
            }
        }
        worst
    }

    /// How far the function is off the end values over the travel that rows between these two do not cover.
    fn beyond(&self, [first, last]: [f64; 2]) -> Option<f64> {
        let [low, high] = self.whole();
        let mut worst: Option<f64> = None;
        for (end, to) in [(first, low), (last, high)] {
            let missing = if to == low { end - to } else { to - end };
            if missing <= SAMPLE * 1e-3 {
                continue;
            }
            // within the first turn every sample stands for one angle, further out for turns too
            for i in 0..=BEYOND_SAMPLES {
                let at = end + (to - end) * f64::from(i) / f64::from(BEYOND_SAMPLES);
                for sense in self.senses {
                    let off = ((self.value)(at, *sense) - (self.value)(end, *sense)).abs();
                    worst = Some(worst.unwrap_or(0.0).max(off));
                }
            }
        }
        worst
    }

    /// What a table leaves whose rows are at these positions and hold what `written` gives, by number of the row and
    /// direction of motion.
    ///
    /// # Errors
    /// When the function has no value somewhere on the way.
    pub fn leaves(
        &self,
        positions: &[f64],
        written: impl Fn(usize, f64) -> f64,
        (number, sense, modulo): (usize, i8, bool),
        lever_mm: f64,
    ) -> Result<TableError, Failure> {
        let worst = self.worst(positions, f64::INFINITY);
        if !worst.off.is_finite() {
            let says = format!("the correction of {} has no value at {} = {}", self.output, self.input, worst.at);
            return Err(Failure::new("tables::no_value", says)
                .help("correct the formula of the effect, or narrow the axis's `range` in machines.toml"));
        }
        let off = |(i, at): (usize, &f64)| -> f64 {
            self.senses.iter().map(|s| (written(i, *s) - (self.value)(*at, *s)).abs()).fold(0.0, f64::max)
        };
        let rounding = positions.iter().enumerate().map(off).fold(0.0, f64::max);
        let range = [positions.first(), positions.last()].map(|q| rounded(q.copied().unwrap_or(0.0)));
        let beyond = if modulo { None } else { self.beyond(range) };
        let shown = |off: f64| rounded(um(self.output, off, lever_mm));
        Ok(TableError {
            input: self.input,
            output: self.output,
            sense,
            number,
            rows: positions.len(),
            range,
            modulo,
            correction_um: shown(worst.value),
            interpolation_um: shown(worst.off),
            interpolation_at: rounded(worst.at),
            rounding_um: shown(rounding),
            beyond_um: beyond.map(shown),
            lever_mm,
        })
    }
}
