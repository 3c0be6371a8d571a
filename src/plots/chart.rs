//! A chart as a record: what is drawn, in the units of its axes, and the numbers behind it. Files (`render`) and the page (`web/plots.js`)
//! are drawn from the same record; what is known of every touch stands once in the view, and a mark says which of it is drawn.

use serde::Serialize;
use std::fmt::Write as _;

/// A colour by what it is for: paper and a dark screen have their own shades of the last three.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
#[allow(missing_docs)]
pub enum Ink {
    Blue,
    Red,
    Green,
    Purple,
    Orange,
    Sky,
    /// Letters and axes.
    Ink,
    /// What stands in the background.
    Muted,
    /// A tolerance, or the noise.
    Band,
}

/// How a point looks: what differs in colour differs in shape, too.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
#[allow(missing_docs)]
pub enum Shape {
    Circle,
    Square,
    Triangle,
    Diamond,
    Cross,
    /// An upright stroke.
    Tick,
}

/// How points look.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Look {
    pub ink: Ink,
    pub shape: Shape,
    /// Filled, or its outline alone.
    pub filled: bool,
    /// Half its width, px.
    pub size: i32,
    /// 0 (unseen) to 1.
    pub opacity: f64,
}

/// How a line is broken.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
#[allow(missing_docs)]
pub enum Dash {
    Solid,
    Dash,
    Dot,
    DashDot,
}

/// How a line looks.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Pen {
    pub ink: Ink,
    /// px.
    pub width: u32,
    pub dash: Dash,
}

/// A point with a remark.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Point {
    /// Value on the axis below.
    pub x: f64,
    /// Value on the axis at the left.
    pub y: f64,
    /// Which touch, which rung.
    #[serde(skip_serializing_if = "String::is_empty")]
    pub note: String,
}

/// One of the two models that are compared: a reader of the page may choose others.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
#[allow(missing_docs)]
pub enum Model {
    Before,
    After,
}

/// What is drawn. The series' name stands in the legend unless it is empty.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(tag = "mark", rename_all = "kebab-case")]
pub enum Mark {
    Points {
        series: String,
        look: Look,
        points: Vec<Point>,
    },
    /// A line through points; a break where a value is not finite.
    Line {
        series: String,
        pen: Pen,
        points: Vec<Point>,
    },
    /// A filled rectangle; without ends as long as the axis. The numbers stand in the CSV where the series has a name.
    Area {
        series: String,
        ink: Ink,
        /// 0 (unseen) to 1.
        opacity: f64,
        x: (f64, f64),
        y: (f64, f64),
    },
    /// A line across the whole chart with its name.
    Rule {
        series: String,
        pen: Pen,
        at: f64,
        /// At a value of the axis below, or at the left?
        upright: bool,
    },
    /// A word at a place.
    Word {
        text: String,
        /// Where it begins.
        at: (f64, f64),
    },
    /// A square of numbers from -1 to 1, row by row on axes of names.
    Cells {
        rows: Vec<Vec<Option<f64>>>,
    },
    /// The residual of each touch that is used, against the chart's variable.
    Touches {
        series: String,
        look: Look,
        /// Of the touches that show a displacement in this direction of R; none: of all, along their faces.
        direction: Option<usize>,
        model: Model,
    },
    /// What the model after has and the one before has not, against the chart's variable.
    Added {
        series: String,
        pen: Pen,
        /// As of the touches.
        direction: Option<usize>,
    },
    /// Lines in space, mm in R.
    Wire {
        pen: Pen,
        lines: Vec<Vec<[f64; 3]>>,
    },
    /// A word in space, mm in R.
    Name {
        text: String,
        at: [f64; 3],
    },
    /// The residual of each touch of a stage as an arrow.
    Arrows {
        series: String,
        pen: Pen,
        /// Number of its word in the view's touches.
        stage: usize,
    },
    /// The touches that are not used, in space.
    Unused {
        series: String,
        look: Look,
    },
}

/// What a picture in space needs besides its marks.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Picture {
    /// Middle of the touches, mm.
    pub centre: [f64; 3],
    /// How far they reach, mm.
    pub extent: f64,
    /// Where the bar of the scale stands, mm.
    pub foot: [f64; 3],
    /// For each rung of the ladder.
    pub scales: Vec<Scale>,
}

/// How long residuals are drawn.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Scale {
    /// So many times as long as they are.
    pub times: f64,
    /// Length of the bar of the scale, µm.
    pub bar_um: f64,
}

/// An axis of a chart.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Axis {
    /// Title, with its unit; empty: nothing stands at this axis.
    pub title: String,
    /// The same where there is little room.
    pub short: String,
    /// Lowest and highest value.
    pub range: (f64, f64),
    /// Names at whole numbers, in place of numbers.
    pub names: Vec<String>,
    /// Is it logarithmic?
    pub log: bool,
    /// Id of the view's variable that it shows.
    pub variable: Option<String>,
}

impl Axis {
    /// An axis of numbers.
    #[must_use]
    pub fn new(title: impl Into<String>, range: (f64, f64)) -> Self {
        let (low, high) = range;
        let usable = low.is_finite() && high.is_finite() && high > low;
        let (title, range) = (title.into(), if usable { range } else { (0.0, 1.0) });
        Self { short: title.clone(), title, range, names: Vec::new(), log: false, variable: None }
    }

    /// With a title for where there is little room.
    #[must_use]
    pub fn or(mut self, short: &str) -> Self {
        short.clone_into(&mut self.short);
        self
    }

    /// An axis of names, the first one at 0.
    #[must_use]
    pub fn named(names: Vec<String>) -> Self {
        let range = (-0.6, names.len() as f64 - 0.4);
        Self { names, ..Self::new("", range) }
    }

    /// Share of the way along it, 0 to 1 inside.
    #[must_use]
    pub fn share(&self, value: f64) -> f64 {
        let (low, high) = self.range;
        if self.log {
            (value.max(f64::MIN_POSITIVE) / low).ln() / (high / low).ln()
        } else {
            (value - low) / (high - low)
        }
    }

    /// Where its numbers stand, and what they say.
    #[must_use]
    pub fn ticks(&self) -> Vec<(f64, String)> {
        if !self.names.is_empty() {
            return self.names.iter().enumerate().map(|(i, n)| (i as f64, n.clone())).collect();
        }
        let (low, high) = self.range;
        if self.log {
            let first = low.log10().floor() as i32;
            let last = high.log10().ceil() as i32;
            let all = (first..=last).flat_map(|e| [1.0, 2.0, 5.0].map(|k| k * 10f64.powi(e)));
            return all.filter(|v| (low..=high).contains(v)).map(|v| (v, format!("{v}"))).collect();
        }
        let step = nice((high - low) / 8.0);
        let digits = (-step.log10().floor()).max(0.0) as usize;
        let from = (low / step).ceil() as i64;
        let to = (high / step).floor() as i64;
        let text = |v: f64| format!("{v:.digits$}").replace('-', "\u{2212}");
        (from..=to).map(|k| k as f64 * step).map(|v| (v, text(v + 0.0))).collect()
    }
}

/// 1, 2 or 5 times a power of ten, not below x.
fn nice(x: f64) -> f64 {
    let power = 10f64.powf(x.log10().floor());
    let rest = x / power;
    power
        * if rest <= 1.0 {
            1.0
        } else if rest <= 2.0 {
            2.0
        } else if rest <= 5.0 {
            5.0
        } else {
            10.0
        }
}

/// A plot, on paper and on the page.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Chart {
    /// Name of its files.
    pub name: String,
    pub title: String,
    /// For who cannot see it.
    pub says: String,
    pub x: Axis,
    pub y: Axis,
    /// The axis at the left counts from the top, as lists do.
    pub downwards: bool,
    /// A picture in space, no numbers at its axes.
    pub picture: Option<Picture>,
    /// The page shows names of series, too; else a caption says them.
    pub legend: bool,
    /// Height over width.
    pub aspect: f64,
    /// What is drawn, the first one at the bottom.
    pub marks: Vec<Mark>,
    /// The numbers, where they are not those of the marks.
    #[serde(skip)]
    pub csv: Option<String>,
}

impl Chart {
    /// The numbers behind it, once it is on paper.
    #[must_use]
    pub fn to_csv(&self) -> String {
        if let Some(csv) = &self.csv {
            return csv.clone();
        }
        let title =
            |axis: &Axis, letter: &str| if axis.title.is_empty() { letter.to_owned() } else { axis.title.clone() };
        let mut out = format!("series,{},{},note\n", field(&title(&self.x, "x")), field(&title(&self.y, "y")));
        let name = |axis: &Axis, v: f64| match axis.names.get(v.round().max(0.0) as usize) {
            Some(name) if (v - v.round()).abs() < 1e-9 => field(&name.replace('\n', " ")),
            _ if v.is_finite() => format!("{v}"),
            _ => String::new(),
        };
        for mark in &self.marks {
            let (series, points) = match mark {
                Mark::Points { series, points, .. } | Mark::Line { series, points, .. } => (series, points.clone()),
                Mark::Area { series, x, y, .. } if !series.is_empty() => {
                    let end = |x: f64, y: f64| Point { x, y, note: String::new() };
                    (series, vec![end(x.0, y.0), end(x.1, y.1)])
                }
                _ => continue,
            };
            for p in points {
                let _ =
                    writeln!(out, "{},{},{},{}", field(series), name(&self.x, p.x), name(&self.y, p.y), field(&p.note));
            }
        }
        out
    }
}

/// A field of a CSV; what a spreadsheet would take for a formula is text.
#[must_use]
pub fn field(text: &str) -> String {
    let formula =
        text.starts_with(['=', '+', '@', '\t', '\r']) || (text.starts_with('-') && text.parse::<f64>().is_err());
    let text = if formula { format!("'{text}") } else { text.to_owned() };
    if text.contains(['"', ',', '\n', '\r']) { format!("\"{}\"", text.replace('"', "\"\"")) } else { text }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_round_numbers_inside_the_range() {
        let axis = Axis::new("x", (-3.2, 11.0));
        let ticks = axis.ticks();
        assert!((4..=9).contains(&ticks.len()), "{ticks:?}");
        assert!(ticks.iter().all(|(v, _)| (-3.2..=11.0).contains(v)) && ticks.iter().any(|(v, _)| *v == 0.0));
        let log = Axis { log: true, ..Axis::new("y", (0.3, 25.0)) };
        let ticks: Vec<String> = log.ticks().into_iter().map(|t| t.1).collect();
        assert_eq!(ticks, ["0.5", "1", "2", "5", "10", "20"]);
        assert!((log.share(0.3)).abs() < 1e-12 && (log.share(25.0) - 1.0).abs() < 1e-12);
    }

    #[test]
    fn a_range_that_is_none_does_no_harm() {
        for range in [(1.0, 1.0), (f64::NAN, 2.0), (0.0, f64::INFINITY), (3.0, -1.0)] {
            assert_eq!(Axis::new("x", range).range, (0.0, 1.0));
        }
    }

    #[test]
    fn fields_are_quoted_and_are_no_formulas() {
        assert_eq!(field("a,b"), "\"a,b\"");
        assert_eq!(field("=1+1"), "'=1+1");
        assert_eq!(field("-2.5"), "-2.5");
        assert_eq!(field("say \"x\""), "\"say \"\"x\"\"\"");
    }
}
