//! `[check]`: how a program is read back.

use schemars::JsonSchema;
use serde::Deserialize;
use toml::Spanned;

fn dwell() -> Vec<String> {
    vec!["G4".to_owned()]
}

/// How a program is read back.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Check {
    /// The grammar.
    pub dialect: DialectName,
    /// The variable that says at which set-up the program begins; a line near the top of the program sets it to 1.
    #[schemars(with = "String")]
    pub from: Spanned<String>,
    /// The variable with the feed of positioning, which a person may lower; a line near the top of the program sets it.
    pub feed: Option<String>,
    /// The variable with the height of the dry run: 0 measures, more lifts all moves by so much and measures nothing.
    pub dry_run: Option<String>,
    /// Names of the files with the programs that a program calls, from `{name}`: `O{name}.nc`, `{name}.spf`.
    pub called_file: Option<String>,
    /// Blocks that a person may put in anywhere, e.g. `M88`: what they switch moves nothing and is not the probe's.
    #[serde(default)]
    pub harmless: Vec<String>,
    /// What the macros of a package do, which a program calls (G65): only of Fanuc and Haas.
    #[serde(default)]
    pub call: Vec<CallRule>,
    /// The control logs to a device that is always there: the program neither names nor opens a log.
    #[serde(default)]
    pub log_always_open: bool,
    /// Words behind which macro statements wait until everything before them is done (`G4`, `G53`, `M0`): only of Fanuc and Haas.
    /// M codes that stand in the setting `wait` do so too.
    #[serde(default = "dwell")]
    pub waits: Vec<String>,
    /// Settings that a run behind the last set-up gives back after a person has broken the program off.
    #[serde(default)]
    pub after_abort: Vec<String>,
    /// Settings of the control that the program leaves off, whatever they were before, by the names that `check` gives them.
    #[serde(default)]
    pub leaves: Vec<String>,
    /// Settings that a program under the control's own transformation may leave on where it stops by itself: reset takes them off.
    #[serde(default)]
    pub stays_on: Vec<String>,
    /// What the control does with a number that is too large for its field in the log: `grow` or `cut` (the places in front are lost).
    #[serde(default)]
    pub field_overflow: Overflow,
    /// The G number of the further work offsets, which are chosen with P: only of Fanuc (54.1) and Haas (154).
    #[schemars(with = "Option<f64>")]
    pub further_offsets: Option<Spanned<f64>>,
    /// Document and page, public file, or observation.
    pub source: Option<String>,
    /// Why it is not verified.
    pub unverified: Option<String>,
}

/// What becomes of a number that is too large for its field.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Overflow {
    /// The field becomes larger.
    #[default]
    Grow,
    /// The places in front are not written.
    Cut,
}

/// What a macro of a package does, so that a program which calls it can be proven.
#[derive(Debug, Clone, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct CallRule {
    /// Its number: 9810 for `G65 P9810`.
    pub program: u32,
    /// What it does.
    pub does: Does,
    /// Settings of the control that stay changed when it breaks the program off, by the names that `check` gives them.
    #[serde(default)]
    pub leaves: Vec<String>,
}

/// What a macro of a package does.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Does {
    /// A straight move to X, Y, Z at F that stops at contact, with an alarm that ends the program.
    GuardedMove,
    /// Nothing moves: a probe switched on or off.
    NothingMoves,
}

/// The grammar of a control's programs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum DialectName {
    /// LinuxCNC: RS274/NGC with O-words.
    Ngc,
    /// Fanuc, Haas: custom macro B.
    MacroB,
    /// HEIDENHAIN: Klartext.
    Klartext,
    /// SINUMERIK 840D sl and ONE.
    Sinumerik,
}
