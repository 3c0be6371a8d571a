//! What `assess` says (`axiscal-assessment/1`).

use crate::fit::outcome::Undetermined;
use serde::{Deserialize, Serialize};

/// The format line of an assessment.
pub const FORMAT: &str = "axiscal-assessment/1";

/// How well a plan does.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Score {
    /// It cannot even tell the location errors.
    #[serde(rename = "not enough")]
    NotEnough,
    /// It tells the location errors of a machine that has no other errors.
    Enough,
    /// It also names other errors, or keeps them out of the location errors.
    Good,
}

impl Score {
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::NotEnough => "not enough",
            Self::Enough => "enough",
            Self::Good => "good",
        }
    }
}

/// What a plan will be able to tell. Displacements in mm, tilts in deg, sizes of effects in µm.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Assessment {
    /// `axiscal-assessment/1`
    pub format: String,
    /// Name of the machine.
    pub machine: String,
    /// The runs: names of programs or files of plans.
    pub plan: Vec<String>,
    /// Ids of the effects in the model.
    pub model: Vec<String>,
    pub touches: usize,
    /// How long it takes, s.
    pub time_s: f64,
    /// Assumed standard deviation of a touch, µm.
    pub noise_um: f64,
    /// Assumed scatter per index visit, µm.
    pub visit_um: f64,
    /// How well it does.
    pub score: Score,
    /// Why.
    pub says: String,
    /// Unknowns of the model, and how many of them the touches determine.
    pub unknowns: usize,
    pub rank: usize,
    /// Combinations that leave no trace.
    pub undetermined: Vec<Undetermined>,
    /// What would tell all of them together: variations of the touches, chosen one after the other.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub parted_together: Vec<String>,
    /// Combinations that no variation determines.
    #[serde(skip)]
    pub never_determined: usize,
    /// The parameters that are no set-up of blocks.
    pub parameters: Vec<Expected>,
    /// Every effect that the model leaves out.
    pub effects: Vec<Seen>,
    /// Effects that cannot be told apart, largest group first.
    pub alias_groups: Vec<Vec<String>>,
    /// Pairs of effects of which one explains the other.
    pub alias_pairs: usize,
    /// Touches that would help most for their time.
    pub advice: Vec<Advice>,
    /// Further plans, side by side with this one.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub compared: Vec<Assessment>,
    /// Remarks that a reader must not miss.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub warnings: Vec<String>,
}

/// What is to be expected of a parameter.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Expected {
    /// ISO form, e.g. `EX0B`.
    pub name: String,
    /// The paper's form.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub alias: Option<String>,
    /// Id of its effect.
    pub effect: String,
    /// `mm`, `deg`, …
    pub unit: String,
    /// Standard uncertainty from the noise of a touch alone; none where the plan cannot tell it.
    pub sigma: Option<f64>,
    /// The same with the scatter of the ball's place from one index to the next: what `identify` will say of its `sigma`.
    #[serde(default)]
    pub sigma_with_visits: Option<f64>,
    /// That again while everything that the model leaves out acts at its typical size.
    pub sigma_with_unmodelled: Option<f64>,
    /// Effects that equal this parameter exactly: its value holds theirs.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub holds: Vec<String>,
}

/// What a plan sees of an effect.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Seen {
    /// Id.
    pub effect: String,
    /// Name for people.
    pub name: String,
    /// Does it leave a trace that the model cannot follow?
    pub visible: bool,
    /// Smallest peak over the touches that is found nearly always (noncentrality 25), µm; null: never.
    pub minimal_detectable_um: Option<f64>,
    /// Peak over the touches at typical size, µm.
    pub typical_um: f64,
    /// Noncentrality at typical size.
    pub noncentrality: f64,
    /// Share of it that the model cannot follow.
    pub kept: f64,
    /// Effects that it cannot be told from.
    pub same_as: Vec<String>,
    /// Effects that explain it, but not the other way round.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub contained_in: Vec<String>,
    /// Where an invisible effect goes: parameters of the model that take it.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub absorbed_by: Vec<String>,
    /// What would make it visible, or tell it from the others.
    pub tell_apart: String,
    /// Ids of those variations, cheapest first.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub habits: Vec<String>,
}

/// Touches that would help.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Advice {
    /// Short word.
    pub habit: String,
    pub says: String,
    /// Further touches.
    pub touches: usize,
    /// What it takes, s.
    pub time_s: f64,
    /// Effects that become visible.
    pub shows: Vec<String>,
    /// Alias pairs that are parted.
    pub parts: usize,
    /// Combinations of the model's parameters that become determined.
    pub determines: usize,
}
