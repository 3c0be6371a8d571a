//! `effects.toml` as a person wrote it: every field as it stands, with its place in the file. Nothing is checked here.

use schemars::JsonSchema;
use serde::Deserialize;
use toml::Spanned;

/// A file of effects as written.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct File {
    /// `axiscal-effects/1` (may be missing in a user's file)
    pub format: Option<String>,
    /// The effects.
    #[serde(default)]
    pub effect: Vec<EffectAsWritten>,
}

/// An effect as written.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct EffectAsWritten {
    /// Short name, used in studies.
    #[schemars(with = "String")]
    pub id: Spanned<String>,
    /// Name for people.
    #[serde(default)]
    pub name: String,
    /// What it is.
    #[serde(default)]
    pub says: String,
    /// How to confirm it on the machine.
    #[serde(default)]
    pub look: String,
    /// What mends it.
    #[serde(default)]
    pub mends: String,
    /// An axis of the chain, or base, tool, workpiece, block, trigger, reading.
    #[schemars(with = "String")]
    pub at: Spanned<String>,
    /// Applies where the axis stands on this side only.
    pub side: Option<SideAsWritten>,
    /// `block`: a set of parameters for each block.
    pub per: Option<Per>,
    /// Solved for, but no result.
    #[serde(default)]
    pub nuisance: bool,
    /// A parameter set of the paper: blocks count as known with it.
    #[serde(default)]
    pub paper: bool,
    /// The displacements.
    #[serde(default)]
    pub terms: Vec<TermAsWritten>,
    /// Parameters that stand inside the formulas only (a time constant, a period).
    #[serde(default)]
    pub shape: Vec<ShapeAsWritten>,
}

/// Side of the chain as written.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
#[allow(missing_docs)]
pub enum SideAsWritten {
    Workpiece,
    Tool,
}

/// What an effect has a set of parameters for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Per {
    /// Each block of each mounting.
    Block,
}

/// Frame of a displacement.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Frame {
    /// Before the axis's motion.
    Fixed,
    /// After it.
    Moving,
}

/// A displacement as written.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct TermAsWritten {
    /// Name of its factor.
    #[schemars(with = "String")]
    pub parameter: Spanned<String>,
    /// ISO 230 symbol.
    pub iso: Option<String>,
    /// The paper's symbol.
    pub alias: Option<String>,
    /// um mm urad mrad deg um/m um/h um/K ppm/K ms s h 1
    #[schemars(with = "String")]
    pub unit: Spanned<String>,
    /// dx dy dz rx ry rz (axis, tool, workpiece, block), r (trigger), X Y Z A B C (reading).
    #[schemars(with = "String")]
    pub dof: Spanned<String>,
    /// The function of the state.
    #[schemars(with = "String")]
    pub formula: Spanned<String>,
    /// Usual size, in the unit.
    pub typical: Option<f64>,
    /// Where that size comes from.
    pub source: Option<String>,
    /// Where it differs from the effect's.
    #[schemars(with = "Option<String>")]
    pub at: Option<Spanned<String>>,
    /// Before or after the axis's motion.
    pub frame: Option<Frame>,
}

/// A shape parameter as written.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ShapeAsWritten {
    /// Its name in the formulas.
    #[schemars(with = "String")]
    pub parameter: Spanned<String>,
    /// Its unit, for the reader.
    pub unit: String,
    /// Where the search begins.
    pub start: f64,
    /// Lowest value.
    pub min: Option<f64>,
    /// Highest value.
    pub max: Option<f64>,
}
