//! `postprocessors/*.toml` as a person wrote it, with the places of what can be wrong. Nothing is checked here.

use crate::axes::AxisName;
use schemars::JsonSchema;
use serde::Deserialize;
use std::collections::BTreeMap;
use toml::Spanned;

mod read_back;

pub use read_back::{CallRule, Check, DialectName, Does, Overflow};

/// The whole file.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct File {
    /// Another controller (a name or a file) that says everything that this file does not. A table with a `source` or
    /// `unverified` of its own takes a new one when any line of it is changed.
    #[serde(default)]
    pub based_on: Option<String>,
    /// Tables and keys of the base that do not apply, such as `tables` or `check.waits`.
    #[serde(default)]
    pub without: Vec<String>,
    /// `axiscal-postprocessor/1`
    #[schemars(with = "String")]
    pub format: Spanned<String>,
    /// Short name, used on the command line.
    #[schemars(with = "String")]
    pub name: Spanned<String>,
    /// What it is, in one line.
    pub says: String,
    /// The program file.
    pub file: ProgramFile,
    /// How numbers and axis words are written.
    pub number: Number,
    /// How remarks and messages are written.
    pub comment: Comment,
    /// Texts and numbers that the templates use as `settings.NAME`; a user changes them for a machine.
    #[serde(default)]
    pub settings: BTreeMap<String, String>,
    /// Where the control keeps the result of a probing move.
    pub result: ResultPlaces,
    /// The templates.
    pub write: Write,
    /// How `check` reads a program back; absent: it cannot.
    pub check: Option<Check>,
    /// Pieces of templates by name, for `{% include "NAME" %}`.
    #[serde(default)]
    pub parts: BTreeMap<String, Entry>,
    /// Files that the control needs beside the program, e.g. masks of its log.
    #[serde(default)]
    pub companion: Vec<Companion>,
    /// The control's own measuring cycle for a touch (`--touch-with cycle`); absent: none is known.
    pub cycle: Option<Cycle>,
    /// Programs under the control's own transformation (`--tcp`); absent: the control has none.
    pub tcp: Option<Tcp>,
    /// The log: how it is called and how it is read.
    pub log: Log,
    /// The compensation tables that the control has; absent: none are known.
    pub tables: Option<super::tables::Tables>,
    /// Versions of LinuxCNC, which `export` writes kinematics pins for; the setting `version` names the one that is meant.
    #[serde(default)]
    pub release: Vec<Release>,
}

/// A version of LinuxCNC: what its kinematics modules take.
#[derive(Debug, Clone, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Release {
    /// Its name, for the setting `version` and for `--target`.
    pub name: String,
    /// What it is, in words.
    pub says: String,
    /// Pins of each kinematics module that a compensation may set, without the name of the module. A pin that the module lacks
    /// would stop LinuxCNC where its HAL file is loaded.
    pub pins: BTreeMap<String, Vec<String>>,
    /// The pin (bit) that turns positive angles round: 1 is the direction of ISO 841 (the table turns left-handed), 0 the other
    /// one. Absent: there is no such pin, and positive angles turn the table right-handed.
    pub direction_pin: Option<String>,
    /// Faults of some builds of this version.
    #[serde(default)]
    pub fault: Vec<ModuleFault>,
    /// Document and page.
    pub source: Option<String>,
    /// Why it is not verified.
    pub unverified: Option<String>,
}

/// A fault of a kinematics module in some builds of a version.
#[derive(Debug, Clone, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ModuleFault {
    /// The module.
    pub module: String,
    /// It shows while the direction pin has this value.
    pub conventional: bool,
    /// What it does, and since when it is mended.
    pub says: String,
}

/// The program file.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ProgramFile {
    /// Without the dot.
    #[schemars(with = "String")]
    pub extension: Spanned<String>,
    /// What ends a line.
    pub end_of_line: EndOfLine,
    /// The longest line that the control takes, characters.
    #[schemars(with = "usize")]
    pub line_length: Spanned<usize>,
    /// Empty lines of the templates stay; false where each line is a block.
    #[serde(default = "yes")]
    pub blank_lines: bool,
    /// A running number before each line, where the control wants one.
    #[schemars(with = "Option<BlockNumbers>")]
    pub block_numbers: Option<Spanned<BlockNumbers>>,
    /// What may stand in names of programs at the control (`nc_name` of the templates); others become `name_other`.
    #[serde(default = "name_characters")]
    pub name_characters: String,
    /// For a character that may not.
    #[serde(default = "name_other")]
    pub name_other: String,
    /// What the control needs before the program runs, for the notes beside it: machine data, options, files.
    #[serde(default)]
    pub notes: Vec<String>,
    /// Numbers of labels from one set-up to the next; absent: 10.
    pub labels_per_step: Option<usize>,
    /// The highest number of a label; absent: any.
    pub last_label: Option<usize>,
    /// The highest number of a program (`program_number` in `[settings]`), Fanuc and Haas; absent: 9999.
    pub last_program: Option<u32>,
    /// Document and page, public file, or observation.
    pub source: Option<String>,
    /// Why it is not verified.
    pub unverified: Option<String>,
}

/// What ends a line.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum EndOfLine {
    /// LF
    Lf,
    /// CR LF
    Crlf,
    /// CR
    Cr,
}

fn name_characters() -> String {
    "ABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_-".to_owned()
}

fn name_other() -> String {
    "_".to_owned()
}

/// A file that the control needs beside the program.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Companion {
    /// Its name: a template.
    #[schemars(with = "String")]
    pub name: Spanned<String>,
    /// What it is for, in one line.
    pub says: String,
    /// Its text: a template, given what all templates are given.
    #[schemars(with = "String")]
    pub template: Spanned<String>,
    /// Document and page, public file, or observation.
    pub source: Option<String>,
    /// Why it is not verified.
    pub unverified: Option<String>,
}

fn yes() -> bool {
    true
}

/// A running number before each line of the program.
#[derive(Debug, Clone, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct BlockNumbers {
    /// Of the first line.
    pub first: usize,
    /// From line to line.
    pub step: usize,
    /// What stands before the line, from `{n}`: `"{n} "`, `"N{n} "`.
    pub word: String,
}

/// Which coordinates a program's words are.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Coordinates {
    /// From the origin of R: the program sets an offset of its own.
    #[default]
    Origin,
    /// What the control displays without any offset. Not under a transformation (`--tcp`): there they are the origin's.
    Machine,
}

/// How numbers and axis words are written.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Number {
    /// Digits after the decimal mark, coordinates in mm and deg.
    #[schemars(with = "usize")]
    pub decimals: Spanned<usize>,
    /// `X10.500000` rather than `X10.5`.
    #[serde(default)]
    pub trailing_zeros: bool,
    /// The decimal mark is written for whole numbers too: `X10.`
    #[serde(default)]
    pub always_mark: bool,
    /// `+` before positive coordinates.
    #[serde(default)]
    pub plus: bool,
    /// `.` or `,`
    #[schemars(with = "String")]
    pub decimal_mark: Spanned<String>,
    /// An axis word, from `{axis}` and `{value}`.
    #[schemars(with = "String")]
    pub word: Spanned<String>,
    /// Which coordinates the words are.
    #[serde(default)]
    pub coordinates: Coordinates,
    /// What the control calls an axis, where that is not its letter: `{ C = "C1" }`.
    #[serde(default)]
    pub axis_names: BTreeMap<AxisName, String>,
    /// The number of an axis at the control, where it is not its place among the machine's axes: `{ C = 6 }`.
    #[serde(default)]
    pub axis_numbers: BTreeMap<AxisName, usize>,
    /// Document and page, public file, or observation.
    pub source: Option<String>,
    /// Why it is not verified.
    pub unverified: Option<String>,
}

/// How remarks and messages are written.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Comment {
    /// Before the text.
    pub open: String,
    /// After it.
    #[serde(default)]
    pub close: String,
    /// Longer remarks go on in the next line, characters.
    #[schemars(with = "usize")]
    pub width: Spanned<usize>,
    /// The longest message to the operator that is shown whole, characters.
    pub message_width: Option<usize>,
    /// Characters that must not stand in a remark, and what is written in their place.
    #[serde(default)]
    pub replace: BTreeMap<String, String>,
    /// What is written for a character outside printable ASCII.
    pub other: String,
    /// All letters become capitals.
    #[serde(default)]
    pub capitals: bool,
    /// First words that would make a remark do something.
    #[serde(default)]
    pub reserved: Vec<String>,
    /// What is put before such a word.
    #[serde(default)]
    pub reserved_prefix: String,
    /// Document and page, public file, or observation.
    pub source: Option<String>,
    /// Why it is not verified.
    pub unverified: Option<String>,
}

/// Where the control keeps the result of a probing move.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ResultPlaces {
    /// Variable of the control, for each axis letter; `{n}` is the number of the axis, `{nn}` in two digits, `{name}` its name.
    #[serde(rename = "X")]
    pub x: Option<String>,
    #[allow(missing_docs)]
    #[serde(rename = "Y")]
    pub y: Option<String>,
    #[allow(missing_docs)]
    #[serde(rename = "Z")]
    pub z: Option<String>,
    #[allow(missing_docs)]
    #[serde(rename = "A")]
    pub a: Option<String>,
    #[allow(missing_docs)]
    #[serde(rename = "B")]
    pub b: Option<String>,
    #[allow(missing_docs)]
    #[serde(rename = "C")]
    pub c: Option<String>,
    /// Document and page, public file, or observation.
    pub source: Option<String>,
    /// Why it is not verified.
    pub unverified: Option<String>,
}

/// One template with where it comes from.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Entry {
    /// minijinja.
    #[schemars(with = "String")]
    pub template: Spanned<String>,
    /// Document and page, public file, or observation.
    pub source: Option<String>,
    /// Why it is not verified.
    pub unverified: Option<String>,
}

/// The templates, one per kind of step.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Write {
    /// Everything before the first move.
    pub start: Entry,
    /// A remark.
    pub note: Entry,
    /// A set-up begins.
    pub setup: Entry,
    /// The way to where a set-up begins, when the program starts again there.
    pub resume: Entry,
    /// A set-up ends.
    pub setup_end: Entry,
    /// The program waits until a person has changed blocks or stylus; absent: programs with such a stop are refused.
    pub stop: Option<Entry>,
    /// The spindle is oriented.
    pub orient: Entry,
    /// Rapid of linear axes.
    pub rapid: Entry,
    /// Rotary axes move.
    pub rotary: Entry,
    /// The first moves have brought X, Y and Z to a known place at the top of the lift: the program may look whether the axes stand there.
    pub arrived: Option<Entry>,
    /// What a touch that finds the artefact adds to what was found; absent: programs for one that was put down by eye are refused.
    pub found: Option<Entry>,
    /// From here on moves are relative to what was found.
    pub shift: Option<Entry>,
    /// The artefact is found: too far off, the program stops; else what was found goes into the log.
    pub find_end: Option<Entry>,
    /// Positioning that stops when the probe triggers.
    pub protected: Entry,
    /// One touch.
    pub touch: Entry,
    /// Back from contact.
    pub retract: Entry,
    /// A message to the operator.
    pub message: Entry,
    /// Everything after the last move.
    pub end: Entry,
}

/// The control's own measuring cycle, in place of the routine for a touch.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Cycle {
    /// What it is called.
    pub name: String,
    /// Template of a touch that calls it, given what `touch` is given; absent: it cannot serve.
    #[schemars(with = "Option<String>")]
    pub template: Option<Spanned<String>>,
    /// Why it cannot serve.
    pub refused: Option<String>,
    /// Document and page, public file, or observation.
    pub source: Option<String>,
    /// Why it is not verified.
    pub unverified: Option<String>,
}

/// Programs under the control's own transformation.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Tcp {
    /// Longest step of a rotary axis, deg: between two steps the linear axes leave the arc.
    #[schemars(with = "f64")]
    pub rotary_step: Spanned<f64>,
    /// What must be switched on at the control.
    pub says: String,
    /// A program under the transformation can take up another stylus in the middle.
    #[serde(default = "yes")]
    pub other_stylus: bool,
    /// A program under the transformation can turn axes that count from 0 to 360 only (`modulo` in `[settings]`).
    #[serde(default = "yes")]
    pub roll_over: bool,
    /// Document and page, public file, or observation.
    pub source: Option<String>,
    /// Why it is not verified.
    pub unverified: Option<String>,
}

/// The log.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Log {
    /// Its name: a template that knows `program` and `machine`.
    #[schemars(with = "String")]
    pub file: Spanned<String>,
    /// What may stand in its name.
    pub characters: String,
    /// Where a person finds it.
    #[serde(rename = "where")]
    pub place: String,
    /// Line ends that are as they should be; others are read too, and reported.
    pub end_of_line: Vec<EndOfLine>,
    /// Digits after the decimal mark.
    #[schemars(with = "usize")]
    pub decimals: Spanned<usize>,
    /// Every number has exactly so many: another count means that it was cut or edited.
    #[serde(default)]
    pub exact_decimals: bool,
    /// `.` or `,`
    #[schemars(with = "String")]
    pub decimal_mark: Spanned<String>,
    /// The other decimal mark, where a setting of the control chooses between the two: a log that uses it is read too.
    #[schemars(with = "Option<String>")]
    pub other_decimal_mark: Option<Spanned<String>>,
    /// What lengths are in, in the program and in its log; the head of the log says it too, and what it says counts.
    #[serde(default)]
    pub unit: LengthUnit,
    /// Places of a field, before and behind the mark together, where it has a size: those before the mark follow, and what is taken
    /// off the sum.
    #[schemars(with = "Option<usize>")]
    pub field_places: Option<Spanned<usize>>,
    /// Places before the mark that the control fills with blanks; 0: it pads nothing.
    #[schemars(with = "Option<usize>")]
    pub whole_places: Option<Spanned<usize>>,
    /// Where the blanks stand.
    #[serde(default)]
    pub padding: Padding,
    /// What the control puts before each line, e.g. `;` where the log is a program file; lines without it are read too.
    #[serde(default)]
    pub prefix: String,
    /// Lines that begin like this are the control's own and no part of the log.
    #[serde(default)]
    pub skip: Vec<String>,
    /// Letter of the word with the time of the touch, s since the program began, where the control can give it.
    #[schemars(with = "Option<String>")]
    pub time_word: Option<Spanned<String>>,
    /// Digits after the decimal mark of a time, where they are others than those of positions; 0: whole seconds.
    pub time_decimals: Option<usize>,
    /// Letter of the word with the sum of all other numbers of the line, where the control can write one.
    #[schemars(with = "Option<String>")]
    pub check_word: Option<Spanned<String>>,
    /// Whole multiples of this are taken off the sum, where its field has no room for all of it.
    #[schemars(with = "Option<f64>")]
    pub check_modulo: Option<Spanned<f64>>,
    /// A file of nothing but columns, where the control has such a log of its own.
    pub columns: Option<Columns>,
    /// Document and page, public file, or observation.
    pub source: Option<String>,
    /// Why it is not verified.
    pub unverified: Option<String>,
}

/// What lengths are in.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum LengthUnit {
    /// Millimetres.
    #[default]
    Mm,
    /// Inches.
    Inch,
}

/// Where a control pads a number.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Padding {
    /// `X  -1.500`: the sign is one of the places.
    #[default]
    BeforeSign,
    /// `X-   1.500`, `X    1.500`: the sign has a place of its own.
    AfterSign,
}

/// A log of nothing but columns.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Columns {
    /// What each column holds: an axis letter (letters that no machine here has are read and left out).
    #[schemars(with = "Vec<String>")]
    pub axes: Spanned<Vec<String>>,
    /// Digits after the decimal mark.
    pub decimals: usize,
    /// The lines of one touch, in order.
    #[schemars(with = "Vec<Role>")]
    pub per_touch: Spanned<Vec<Role>>,
    /// What stands before the first number of a row, e.g. `[PRB:`; lines without it are not read. Left out: a row begins with its first number.
    #[schemars(with = "Option<String>")]
    pub prefix: Option<Spanned<String>>,
    /// What stands between two numbers, e.g. `,`. Left out: blanks.
    #[schemars(with = "Option<String>")]
    pub separator: Option<Spanned<String>>,
    /// What stands between the last number and 1 (triggered) or 0 (not triggered), e.g. `:`. Left out: rows do not say it.
    #[schemars(with = "Option<String>")]
    pub status: Option<Spanned<String>>,
    /// What ends a row, e.g. `]`; what follows in the line is not read. Left out: the end of the line.
    #[schemars(with = "Option<String>")]
    pub suffix: Option<Spanned<String>>,
    /// What X, Y and Z of the rows are in.
    #[serde(default)]
    pub unit: LengthUnit,
    /// Document and page, public file, or observation.
    pub source: Option<String>,
    /// Why it is not verified.
    pub unverified: Option<String>,
}

/// What a line of a log of columns comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Role {
    /// The fast search.
    Search,
    /// The move off the face.
    Release,
    /// The slow touch that is measured.
    Measure,
}

/// The axis of a letter, if axiscal knows it.
#[must_use]
pub fn axis_of(letter: &str) -> Option<AxisName> {
    let mut characters = letter.chars();
    let axis = AxisName::from_letter(characters.next()?)?;
    characters.next().is_none().then_some(axis)
}
