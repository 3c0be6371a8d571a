//! Postprocessors: a path → the text that one control runs; a touch → the line that it writes into its log.
//!
//! A controller is a file (`postprocessors/*.toml`), not code: [`Postprocessor`] is such a file, checked, with its
//! templates compiled. Nothing here knows how to reach a face without harm: that is the path's business, and the path
//! has been proven before it comes here. What a log means is read back in [`crate::log`], driven by the same file.

pub mod as_written;
mod check;
mod emit;
mod environment;
mod frame;
mod inherit;
mod log_text;
mod moves;
mod nc;
mod numbers;
mod opening;
mod render;
mod spelling;
pub mod tables;

pub use as_written::{CallRule, DialectName, Does, LengthUnit, ModuleFault, Overflow, Release};
pub use emit::TOOL_PLACE;
pub use frame::Frame;
pub use inherit::parse_alone as parse;
pub use log_text::LogRecord;
pub(crate) use log_text::{VERSION as LOG_VERSION, log_word};
pub use nc::{NcProgram, SideFile};
pub use spelling::{CommentRule, NumberRule};

use crate::axes::AxisName;
use crate::diag::{Failure, Finding, Result, source};
use as_written::{BlockNumbers, Coordinates, EndOfLine, Padding, Role};
use std::collections::BTreeMap;
use std::path::Path;
use std::sync::OnceLock;

/// The postprocessors that are built in: file name, text.
pub const BUILT_IN: [(&str, &str); 7] = [
    ("linuxcnc.toml", include_str!("../../postprocessors/linuxcnc.toml")),
    ("sinumerik.toml", include_str!("../../postprocessors/sinumerik.toml")),
    ("fanuc.toml", include_str!("../../postprocessors/fanuc.toml")),
    ("heidenhain.toml", include_str!("../../postprocessors/heidenhain.toml")),
    ("haas.toml", include_str!("../../postprocessors/haas.toml")),
    ("fanuc-inspection-plus.toml", include_str!("../../postprocessors/fanuc-inspection-plus.toml")),
    ("haas-inspection-plus.toml", include_str!("../../postprocessors/haas-inspection-plus.toml")),
];

/// A checked postprocessor.
#[derive(Debug, Clone)]
pub struct Postprocessor {
    /// Short name.
    pub name: String,
    /// What it is, in one line.
    pub says: String,
    /// Of the program file, without the dot.
    pub extension: String,
    /// What ends a line of the program.
    pub end_of_line: EndOfLine,
    /// The longest line that the control takes, characters.
    pub line_length: usize,
    /// Empty lines stay.
    pub blank_lines: bool,
    /// A running number before each line.
    pub block_numbers: Option<BlockNumbers>,
    /// The controller that it completes itself from.
    pub based_on: Option<String>,
    /// Characters of names at the control, and what stands for others.
    pub name_characters: (String, String),
    /// What the control needs before a program runs.
    pub notes: Vec<String>,
    /// Numbers of labels that a step takes.
    pub labels_per_step: usize,
    /// The highest number of a label.
    pub last_label: Option<usize>,
    /// The highest number of a program.
    pub last_program: Option<u32>,
    /// Files beside the program: what each is for.
    pub companions: Vec<String>,
    /// Which coordinates the words of a program are (not under a transformation).
    pub coordinates: Coordinates,
    /// Numbers and axis words.
    pub number: NumberRule,
    /// Remarks and messages.
    pub comment: CommentRule,
    /// What the templates use as `settings.NAME`.
    pub settings: BTreeMap<String, String>,
    /// Where the control keeps the result of a probing move.
    pub result: BTreeMap<AxisName, String>,
    /// The control's own measuring cycle for a touch: its name, and why it cannot serve.
    pub cycle: Option<(String, Option<String>)>,
    /// A touch is made by it.
    pub touch_with_cycle: bool,
    /// The control's own transformation.
    pub tcp: Option<Tcp>,
    /// How its programs are read back.
    pub check: Option<CheckRule>,
    /// How its log is called and read.
    pub log: LogRule,
    /// Entries that nobody has verified: name of the entry, why.
    pub unverified: Vec<(String, String)>,
    /// The compensation tables that the control has.
    pub tables: Option<tables::Tables>,
    /// Versions of LinuxCNC.
    pub releases: Vec<Release>,
    /// Height of a dry run, mm; 0: the program measures.
    pub dry_run_mm: f64,
    /// Its programs have no switch for a dry run.
    pub without_dry_run: bool,
    /// The file as it was read.
    pub text: String,
    templates: minijinja::Environment<'static>,
}

/// The control's own transformation.
#[derive(Debug, Clone, PartialEq)]
pub struct Tcp {
    /// Longest step of a rotary axis, deg.
    pub rotary_step_deg: f64,
    /// What must be switched on at the control.
    pub says: String,
    /// A program under the transformation can take up another stylus in the middle.
    pub other_stylus: bool,
    /// A program under the transformation can turn axes that count from 0 to 360 only.
    pub roll_over: bool,
}

/// How a program is read back.
#[derive(Debug, Clone, PartialEq)]
pub struct CheckRule {
    /// The grammar.
    pub dialect: DialectName,
    /// The variable that says at which set-up the program begins.
    pub from: String,
    /// The variable with the feed of positioning.
    pub feed: Option<String>,
    /// The variable with the height of the dry run.
    pub dry_run: Option<String>,
    /// Names of the files with the programs that a program calls.
    pub called_file: Option<String>,
    /// Blocks that a person may put in anywhere.
    pub harmless: Vec<String>,
    /// The program neither names nor opens a log.
    pub log_always_open: bool,
    /// Words behind which macro statements wait.
    pub waits: Vec<String>,
    /// Settings that a run behind the last set-up gives back after the program was broken off.
    pub after_abort: Vec<String>,
    /// What the macros of a package do.
    pub calls: Vec<CallRule>,
    /// Settings that the program leaves off.
    pub leaves: Vec<String>,
    /// Settings that a program under the control's own transformation may leave on where it stops by itself.
    pub stays_on: Vec<String>,
    /// The G number of the further work offsets.
    pub further_offsets: f64,
    /// What becomes of a number that is too large for its field in the log.
    pub field_overflow: Overflow,
}

/// How a log is called and read.
#[derive(Debug, Clone, PartialEq)]
pub struct LogRule {
    /// What may stand in its name.
    pub characters: String,
    /// Where a person finds it.
    pub place: String,
    /// Line ends that are as they should be.
    pub end_of_line: Vec<EndOfLine>,
    /// Digits after the decimal mark.
    pub decimals: usize,
    /// Every number has exactly so many.
    pub exact_decimals: bool,
    /// `.` or `,`
    pub mark: u8,
    /// The other one, where a setting of the control chooses.
    pub other_mark: Option<u8>,
    /// What X, Y and Z are in.
    pub unit: LengthUnit,
    /// Places before the mark that are filled with blanks.
    pub whole_places: usize,
    /// Where the blanks stand.
    pub padding: Padding,
    /// Before each line.
    pub prefix: String,
    /// Beginnings of lines that are the control's own.
    pub skip: Vec<String>,
    /// Letter of the word with the time, s since the program began.
    pub time_word: Option<u8>,
    /// Digits after the decimal mark of a time.
    pub time_decimals: usize,
    /// The program writes the time with each touch: a setting of the postprocessor file may say no.
    pub writes_time: bool,
    /// Letter of the word with the sum of all other numbers of the line: it shows a damaged digit.
    pub check_word: Option<u8>,
    /// Whole multiples of this are taken off the sum.
    pub check_modulo: Option<f64>,
    /// A file of nothing but columns.
    pub columns: Option<ColumnRule>,
}

/// A log of nothing but columns.
#[derive(Debug, Clone, PartialEq)]
pub struct ColumnRule {
    /// What each column holds; `None` for a letter that no machine here has.
    pub axes: Vec<Option<AxisName>>,
    /// Digits after the decimal mark.
    pub decimals: usize,
    /// The lines of one touch, in order.
    pub per_touch: Vec<Role>,
    /// What stands before the first number; lines without it are no rows. Empty: a row begins with its first number.
    pub prefix: String,
    /// What stands between two numbers; empty: blanks.
    pub separator: String,
    /// What stands between the last number and the status; empty: rows say none.
    pub status: String,
    /// What ends the row; empty: the end of the line.
    pub suffix: String,
    /// What X, Y and Z are in.
    pub unit: LengthUnit,
}

impl ColumnRule {
    /// Something follows the last number.
    pub(crate) fn has_tail(&self) -> bool {
        !self.status.is_empty() || !self.suffix.is_empty()
    }
}

/// The setting that names a version of the control.
const VERSION_SETTING: &str = "version";

impl Postprocessor {
    /// The version of the control that is meant: the one of this name, or the one that the setting `version` names.
    ///
    /// # Errors
    /// When the controller is not described with such a version; the message lists what there is.
    pub fn release(&self, name: Option<&str>) -> Result<&Release> {
        let name = name.or_else(|| self.settings.get(VERSION_SETTING).map(String::as_str)).unwrap_or_default();
        let names: Vec<&str> = self.releases.iter().map(|r| r.name.as_str()).collect();
        self.releases.iter().find(|r| r.name == name).ok_or_else(|| {
            let says = format!("controller {} is not described with a version {name:?}", self.name);
            let help = match names.as_slice() {
                [] => "its tables do not depend on the version: leave it away".to_owned(),
                _ => format!("there are: {}", names.join(", ")),
            };
            Failure::new("post::version", says).help(help)
        })
    }

    /// The same control, with touches made by its own measuring cycle.
    ///
    /// # Errors
    /// When no such cycle is known, or it cannot carry what the log needs; the reason stands in the postprocessor file.
    pub fn with_cycle(self) -> Result<Self> {
        let refuse = |says: String| {
            Failure::new("post::cycle", says)
                .help("generate without --touch-with cycle: the program then makes each touch itself")
        };
        match &self.cycle {
            None => Err(refuse(format!("controller {} is not described with a measuring cycle of its own", self.name))),
            Some((name, Some(why))) => {
                Err(refuse(format!("{name} cannot make the touches of controller {}: {why}", self.name)))
            }
            Some((_, None)) => Ok(Self { touch_with_cycle: true, ..self }),
        }
    }

    /// Whether a program may wait for a person.
    #[must_use]
    pub fn can_stop(&self) -> bool {
        self.templates.get_template("stop").is_ok()
    }

    /// Whether a program may find an artefact that was put down by eye.
    #[must_use]
    pub fn finds(&self) -> bool {
        ["found", "shift", "find_end"].iter().all(|name| self.templates.get_template(name).is_ok())
    }

    /// A program looks whether its first moves have brought the axes to where it sent them.
    pub fn looks_on_arrival(&self) -> bool {
        self.templates.get_template("arrived").is_ok()
    }

    /// All postprocessors that are built in.
    ///
    /// # Errors
    /// Never for the files that are shipped: a test reads them all.
    pub fn built_in() -> Result<Vec<Self>> {
        (0..BUILT_IN.len()).map(|file| Self::built_in_file(file).cloned()).collect()
    }

    /// A built-in one by its place; its file is read once.
    fn built_in_file(place: usize) -> Result<&'static Self> {
        static READ: [OnceLock<Result<Postprocessor>>; BUILT_IN.len()] = [const { OnceLock::new() }; BUILT_IN.len()];
        let (file, text) = BUILT_IN[place];
        let read = || parse(&source(format!("postprocessors/{file} (built in)"), text)).map(|(post, _)| post);
        READ[place].get_or_init(read).as_ref().map_err(Clone::clone)
    }

    /// The place of a built-in one.
    fn place_of(name: &str) -> Option<usize> {
        BUILT_IN.iter().position(|(file, _)| file.strip_suffix(".toml") == Some(name))
    }

    /// Is a control of this name built in?
    #[must_use]
    pub fn is_built_in(name: &str) -> bool {
        Self::place_of(name).is_some()
    }

    /// The tables of a built-in one; none where it has none, or there is none of that name.
    #[must_use]
    pub fn built_in_tables(name: &str) -> Option<&'static tables::Tables> {
        Self::built_in_file(Self::place_of(name)?).ok()?.tables.as_ref()
    }

    /// The postprocessor of a name, or of a file of the user's own when the word ends in `.toml` or holds a `/`.
    ///
    /// `read` fetches the text of a file.
    ///
    /// # Errors
    /// When there is none of that name, or the file is unusable; the message lists what there is.
    pub fn load(word: &str, read: impl Fn(&Path) -> Result<String>) -> Result<(Self, Vec<Finding>)> {
        if inherit::is_file(word) {
            let text = read(Path::new(word))?;
            return inherit::parse(&source(word, text), &read).map(|(post, findings)| (post, findings.0));
        }
        if let Some(place) = Self::place_of(word) {
            return Ok((Self::built_in_file(place)?.clone(), Vec::new()));
        }
        let names: Vec<&str> = BUILT_IN.iter().filter_map(|(file, _)| file.strip_suffix(".toml")).collect();
        Err(Failure::new("post::unknown", format!("no controller is called {word:?}"))
            .help(format!("there are: {}; a file of your own goes with --controller FILE.toml", names.join(", "))))
    }

    /// A name of the built-in ones, or the path of a file of the user's own, which is read.
    ///
    /// # Errors
    /// As for [`Self::load`].
    pub fn load_built_in_or_file(word: &str) -> Result<(Self, Vec<Finding>)> {
        Self::load(word, crate::files::read_text)
    }

    /// The JSON schema of a postprocessor file, for editors.
    #[must_use]
    pub fn schema() -> schemars::Schema {
        schemars::schema_for!(as_written::File)
    }
}

#[cfg(test)]
pub(crate) mod tests;
