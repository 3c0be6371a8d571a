//! `[tables]` of a postprocessor file: which compensation tables a control has, as data.
//!
//! A control's transformation knows the lines of the rotary axes by vectors between named points and by directions. Each
//! entry says which of them it is, under which names the control knows its components, and where that is documented.
//! `crate::tables::control` fills them; nothing there knows a control by name.

use super::check::Check;
use crate::axes::AxisName;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use toml::Spanned;

/// A point that a vector begins or ends at, with all axes at 0.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Point {
    /// Where machine coordinates are zero.
    MachineZero,
    /// On the line of the rotary axis of the workpiece side that stands nearest to the base.
    #[serde(rename = "workpiece-1")]
    Workpiece1,
    /// On the line of the second one.
    #[serde(rename = "workpiece-2")]
    Workpiece2,
    /// On the line of the rotary axis of the tool side that stands nearest to the base.
    #[serde(rename = "tool-1")]
    Tool1,
    /// On the line of the second one.
    #[serde(rename = "tool-2")]
    Tool2,
    /// On the line of the first rotary axis of the workpiece side, where the second one passes it.
    WorkpieceCrossing,
    /// Where tool lengths are measured from: the adapter in the spindle.
    ToolAdapter,
}

/// A rotary axis by its place in the chain.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema)]
pub enum Turn {
    /// Workpiece side, nearest to the base.
    #[serde(rename = "workpiece-1")]
    Workpiece1,
    /// Workpiece side, the second one.
    #[serde(rename = "workpiece-2")]
    Workpiece2,
    /// Tool side, nearest to the base.
    #[serde(rename = "tool-1")]
    Tool1,
    /// Tool side, the second one.
    #[serde(rename = "tool-2")]
    Tool2,
}

/// The unit of lengths in a control's tables.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema, clap::ValueEnum)]
#[serde(rename_all = "lowercase")]
pub enum LengthUnit {
    /// Millimetres.
    Mm,
    /// Inches.
    Inch,
}

impl LengthUnit {
    /// `mm` or `inch`.
    #[must_use]
    pub fn says(self) -> &'static str {
        match self {
            Self::Mm => "mm",
            Self::Inch => "inch",
        }
    }
}

/// Which tables the control has.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Tables {
    /// What they are, in one line.
    pub says: String,
    /// Nothing that the control reads: numbers for a person to enter.
    #[serde(default)]
    pub worksheet: bool,
    /// Smallest step of a length, mm.
    #[schemars(with = "f64")]
    pub step_mm: Spanned<f64>,
    /// Smallest step of a length on an inch control, inch.
    #[schemars(with = "f64")]
    pub step_inch: Spanned<f64>,
    /// Smallest step of an angle, deg.
    #[schemars(with = "f64")]
    pub step_deg: Spanned<f64>,
    /// Digits behind the point of a component of a direction.
    #[serde(default = "nine")]
    pub direction_decimals: usize,
    /// Numbers always carry a point.
    #[serde(default)]
    pub always_mark: bool,
    /// Largest value of a length, mm.
    #[serde(default = "large")]
    pub limit_mm: f64,
    /// How the user's backup is read.
    pub backup: BackupForm,
    /// The control's own description can have a rotary axis that is not along X, Y or Z, without a vector for its
    /// direction here: an inclination angle, or what the machine's builder writes.
    #[serde(default)]
    pub inclined_axes: bool,
    /// The vectors for each kind of machine.
    #[serde(default)]
    pub kind: Vec<Kind>,
    /// Tables of one axis's correction by another's position.
    pub grid: Option<GridForm>,
    /// The files.
    #[serde(default)]
    pub file: Vec<FileForm>,
    /// How to load them, line by line.
    #[serde(default)]
    pub load: Vec<String>,
    /// What the control cannot hold, in words.
    #[serde(default)]
    pub cannot: Vec<String>,
    /// Which reader of the virtual machine knows the file (`sinumerik-data`, `fanuc-parameters`); absent: it takes the
    /// record in compensation.json.
    pub reads: Option<String>,
    /// Document and page.
    pub source: Option<String>,
    /// Why it is not verified.
    pub unverified: Option<String>,
}

fn nine() -> usize {
    9
}

fn one() -> u32 {
    1
}

fn large() -> f64 {
    1e6
}

/// How a backup spells a value.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct BackupForm {
    /// `assignments`: a name, `=`, a number on a line; `words`: `N19700Q1L1M-0.0123 `
    pub form: BackupKind,
    /// What begins a remark, in `assignments`.
    #[serde(default)]
    pub comment: String,
    /// The control's file ends with this line.
    pub last_line: Option<String>,
    /// A line that says of which channel the values behind it are, from `{n}`: `CHANDATA({n})`.
    pub sections: Option<String>,
    /// The channel that is read, and that the files are written for.
    #[serde(default = "one")]
    pub section: u32,
    /// Beginnings of names that are of no channel.
    #[serde(default)]
    pub everywhere: Vec<String>,
    /// Document and page.
    pub source: Option<String>,
    /// Why it is not verified.
    pub unverified: Option<String>,
}

impl BackupForm {
    /// Is a value of no channel?
    #[must_use]
    pub fn is_everywhere(&self, name: &str) -> bool {
        self.everywhere.iter().any(|begins| name.starts_with(begins.as_str()))
    }

    /// How the control calls a channel.
    #[must_use]
    pub fn section_name(&self, n: u32) -> String {
        self.sections.as_ref().map_or_else(|| n.to_string(), |form| form.replace("{n}", &n.to_string()))
    }
}

/// The forms of a backup.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum BackupKind {
    /// `NAME = 1.25 ; remark`, with or without a block number before.
    Assignments,
    /// `N19700Q1L1M-0.0123`: number, parameter data, path, unit letter (`M` mm, `I` inch), value; without `L1` and with `;` too.
    Words,
}

/// The vectors for one kind of machine.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Kind {
    /// What the control calls it.
    pub name: String,
    /// Rotary axes on the workpiece side.
    pub workpiece: usize,
    /// Rotary axes on the tool side.
    pub tool: usize,
    /// The vectors.
    pub vector: Vec<VectorForm>,
    /// Zero positions of rotary axes.
    #[serde(default)]
    pub angle: Vec<AngleForm>,
    /// Document and page.
    pub source: Option<String>,
    /// Why it is not verified.
    pub unverified: Option<String>,
}

/// One vector: between two points, a direction, or the one that closes a chain.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct VectorForm {
    /// Short name.
    pub id: String,
    /// What it is, in words.
    pub says: String,
    /// Spelling → names of the X, Y and Z component (an empty name: the control has no such component).
    pub names: BTreeMap<String, [String; 3]>,
    /// Begins here.
    pub from: Option<Point>,
    /// Ends here.
    pub to: Option<Point>,
    /// Is the direction of this axis.
    pub direction: Option<Turn>,
    /// A direction counts against the motion where the workpiece moves.
    #[serde(default)]
    pub reversed: bool,
    /// Is minus the sum of these vectors.
    pub close: Option<Vec<String>>,
    /// Some software of the control has this one in place of all others.
    #[serde(default)]
    pub instead: bool,
    /// Document and page.
    pub source: Option<String>,
    /// Why it is not verified.
    pub unverified: Option<String>,
}

/// The zero position of a rotary axis: the coordinate, in the control's own count, at which it really stands at zero.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct AngleForm {
    /// Short name.
    pub id: String,
    /// What it is, in words.
    pub says: String,
    /// Spelling → its name.
    pub names: BTreeMap<String, String>,
    /// Whose.
    pub axis: Turn,
    /// Document and page.
    pub source: Option<String>,
    /// Why it is not verified.
    pub unverified: Option<String>,
}

/// Tables of one axis's correction by another's position.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct GridForm {
    /// The number of the first table.
    #[serde(default)]
    pub first: usize,
    /// Most tables.
    pub most: usize,
    /// Most points of a table.
    pub most_points: usize,
    /// How the control calls an axis, from `{axis}` and `{number}` (its place among the machine's axes, from 1).
    pub axis: String,
    /// How the control calls a point, from `{table}` and `{point}`: what its backup is searched for.
    #[serde(default)]
    pub point: String,
    /// Document and page.
    pub source: Option<String>,
    /// Why it is not verified.
    pub unverified: Option<String>,
}

/// What ends a line of a table's file.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum FileEnd {
    /// LF
    #[default]
    Lf,
    /// CR LF
    Crlf,
    /// LF CR CR: the end of a block in files that a Fanuc punches.
    LfCrCr,
}

impl FileEnd {
    /// The characters.
    #[must_use]
    pub fn characters(self) -> &'static str {
        match self {
            Self::Lf => "\n",
            Self::Crlf => "\r\n",
            Self::LfCrCr => "\n\r\r",
        }
    }
}

/// A file that is written.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FileForm {
    /// Its name.
    pub name: String,
    /// The file that restores the old values.
    pub restore: Option<String>,
    /// Which names of the entries it uses; absent: it holds no vectors.
    pub spelling: Option<String>,
    /// It holds the position tables: written where there are any.
    #[serde(default)]
    pub grids: bool,
    /// It is another way to load the same values: never to be loaded together with the first one.
    #[serde(default)]
    pub variant: bool,
    /// What ends its lines.
    #[serde(default)]
    pub end_of_line: FileEnd,
    /// minijinja.
    #[schemars(with = "String")]
    pub template: Spanned<String>,
    /// Document and page.
    pub source: Option<String>,
    /// Why it is not verified.
    pub unverified: Option<String>,
}

impl Point {
    /// The axis on whose line it lies.
    #[must_use]
    pub fn turn(self) -> Option<Turn> {
        match self {
            Self::Workpiece1 => Some(Turn::Workpiece1),
            Self::Workpiece2 => Some(Turn::Workpiece2),
            Self::Tool1 => Some(Turn::Tool1),
            Self::Tool2 => Some(Turn::Tool2),
            Self::MachineZero | Self::WorkpieceCrossing | Self::ToolAdapter => None,
        }
    }
}

impl std::fmt::Display for Point {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::MachineZero => "the machine's zero point",
            Self::Workpiece1 => "the first axis of the table",
            Self::Workpiece2 => "the second axis of the table",
            Self::Tool1 => "the first axis of the head",
            Self::Tool2 => "the second axis of the head",
            Self::WorkpieceCrossing => "where the axes of the table cross",
            Self::ToolAdapter => "the tool adapter",
        })
    }
}

impl Turn {
    /// Side of the chain and place among its rotary axes, from the base on.
    #[must_use]
    pub fn place(self) -> (crate::machine::Side, usize) {
        use crate::machine::Side;
        match self {
            Self::Workpiece1 => (Side::Workpiece, 0),
            Self::Workpiece2 => (Side::Workpiece, 1),
            Self::Tool1 => (Side::Tool, 0),
            Self::Tool2 => (Side::Tool, 1),
        }
    }
}

impl GridForm {
    /// How the control calls an axis.
    #[must_use]
    pub fn axis_name(&self, axis: AxisName, number: usize) -> String {
        self.axis.replace("{axis}", &axis.to_string()).replace("{number}", &number.to_string())
    }

    /// The control's name of a point; `None` where the file does not say it.
    pub fn point_name(&self, table: usize, point: usize) -> Option<String> {
        let name = self.point.replace("{table}", &table.to_string()).replace("{point}", &point.to_string());
        (!name.is_empty()).then_some(name)
    }

    /// Names of all points of all tables.
    pub fn point_names(&self) -> impl Iterator<Item = String> + '_ {
        let tables = self.first..self.first + self.most;
        tables.flat_map(move |t| (0..self.most_points).filter_map(move |p| self.point_name(t, p)))
    }
}

/// Why an entry is not verified: its own word, or that it names no document.
#[must_use]
pub fn doubt(source: Option<&String>, unverified: Option<&String>) -> Option<String> {
    match (source, unverified) {
        (_, Some(why)) => Some(why.clone()),
        (Some(from), None) if !from.trim().is_empty() => None,
        _ => Some("it does not say where it comes from".to_owned()),
    }
}

/// Checks `[tables]`: everything that the filling relies on.
pub(super) fn check(check: &mut Check, tables: &Tables) {
    let at = tables.step_mm.span();
    let mut wrong = |what: String, help: &str| check.error(&at, "post::tables", what, help);
    for (name, step) in [("step_mm", &tables.step_mm), ("step_inch", &tables.step_inch), ("step_deg", &tables.step_deg)]
    {
        let step = *step.get_ref();
        if !(1e-12..=0.1).contains(&step) {
            wrong(
                format!("{name} of [tables] is {step}"),
                "between 1e-12 and 0.1: the smallest step that the control stores",
            );
        }
    }
    if !(tables.limit_mm.is_finite() && tables.limit_mm > 0.0) || tables.direction_decimals > 15 {
        wrong(
            "limit_mm or direction_decimals of [tables] is no such number".to_owned(),
            "a length in mm; 0 to 15 digits",
        );
    }
    for kind in &tables.kind {
        let of = |what: &str| format!("[tables] kind {:?}: {what}", kind.name);
        let here = |turn: Turn| {
            let (side, place) = turn.place();
            place < if side == crate::machine::Side::Tool { kind.tool } else { kind.workpiece }
        };
        for v in &kind.vector {
            let ways = [v.from.is_some() && v.to.is_some(), v.direction.is_some(), v.close.is_some()];
            if ways.iter().filter(|w| **w).count() != 1 || v.from.is_some() != v.to.is_some() {
                wrong(
                    of(&format!("vector {:?} is not one of: from and to, direction, close", v.id)),
                    "say what the vector is, once",
                );
            }
            let turns = [v.from.and_then(Point::turn), v.to.and_then(Point::turn), v.direction];
            if !turns.into_iter().flatten().all(here) {
                wrong(
                    of(&format!("vector {:?} names an axis that this kind has not", v.id)),
                    "compare workpiece and tool",
                );
            }
            if let (Some(from), Some(to)) = (v.from, v.to) {
                let of_head = |p: Point| matches!(p, Point::Tool1 | Point::Tool2 | Point::ToolAdapter);
                let crosses = to == Point::WorkpieceCrossing && v.instead && kind.workpiece == 2;
                if of_head(from) != of_head(to) || (to.turn().is_none() && !crosses) {
                    wrong(
                        of(&format!("vector {:?} leads from {from} to {to}", v.id)),
                        "head and table are two chains; a vector leads to an axis, or, with instead = true, to where two of them cross",
                    );
                }
            }
            for other in v.close.iter().flatten() {
                let known = kind.vector.iter().any(|k| k.id == *other && k.from.is_some());
                if !known {
                    wrong(
                        of(&format!("vector {:?} closes {other:?}, which is no vector between points", v.id)),
                        "name vectors of this kind",
                    );
                }
            }
            if kind.vector.iter().filter(|k| k.id == v.id).count() > 1 {
                wrong(of(&format!("vector {:?} stands twice", v.id)), "give each its own id");
            }
        }
        if !kind.angle.iter().all(|a| here(a.axis)) {
            wrong(of("an angle names an axis that this kind has not"), "compare workpiece and tool");
        }
        if tables.kind.iter().filter(|k| (k.workpiece, k.tool) == (kind.workpiece, kind.tool)).count() > 1 {
            wrong(of("stands twice for these counts of rotary axes"), "one kind for each count");
        }
    }
    for file in &tables.file {
        let good = |name: &str| {
            name.starts_with("axiscal")
                || name.starts_with("restore")
                || name.strip_prefix("O").is_some_and(|n| n.chars().next().is_some_and(|c| c.is_ascii_digit()))
        };
        let plain = |name: &str| {
            !name.is_empty() && name.chars().all(|c| c.is_ascii_alphanumeric() || matches!(c, '.' | '_' | '-'))
        };
        for name in [Some(&file.name), file.restore.as_ref()].into_iter().flatten() {
            if !(plain(name) && good(name)) {
                check.error(
                    &file.template.span(),
                    "post::tables",
                    format!("the file of [tables] is called {name:?}"),
                    "names begin with axiscal or restore, so that an older export is known again",
                );
            }
        }
        if let Err(e) = compile(file.template.get_ref()) {
            check.error(
                &file.template.span(),
                "post::template",
                format!("template of {}: {e:#}", file.name),
                "minijinja's own manual says how templates are written",
            );
        }
    }
}

/// An environment with the one template, named `file`.
///
/// # Errors
/// When it does not compile.
pub fn compile(template: &str) -> Result<minijinja::Environment<'static>, minijinja::Error> {
    let mut syntax = minijinja::syntax::SyntaxConfig::builder();
    syntax.trim_blocks(true).lstrip_blocks(true).keep_trailing_newline(true);
    let mut environment = minijinja::Environment::new();
    environment.set_syntax(syntax.build()?);
    environment.set_auto_escape_callback(|_| minijinja::AutoEscape::None);
    environment.set_undefined_behavior(minijinja::UndefinedBehavior::Strict);
    environment.add_template_owned("file", template.trim_start_matches('\n').to_owned())?;
    Ok(environment)
}
