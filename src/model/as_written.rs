//! `effects.toml` as a person wrote it: every field as it stands, with its place in the file. Nothing is checked here.

use super::surface::Body;
use crate::machine::Side;
use schemars::JsonSchema;
use serde::Deserialize;
use toml::Spanned;

/// A word with its place in the file.
pub type Placed = Spanned<String>;

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
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct EffectAsWritten {
    /// Short name, used in studies.
    #[schemars(with = "String")]
    pub id: Placed,
    /// Letters of axes, all linear or all rotary: the row stands for one row of each. It is written for X or A, with `{X}`,
    /// `{Y}`, `{Z}`, `{A}`, `{B}`, `{C}` (or small letters) where another axis has another letter.
    #[serde(default)]
    #[schemars(with = "Vec<String>")]
    pub axes: Vec<Placed>,
    /// The row has the axes of the row before: both are repeated together, axis by axis.
    #[serde(default)]
    pub with_previous: bool,
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
    /// What usually makes it far larger than machines have it.
    #[serde(default)]
    pub too_large: String,
    /// An axis of the chain, or base, tool, workpiece, block, trigger, reading.
    #[schemars(with = "String")]
    pub at: Placed,
    /// Applies where its axes stand on this side only.
    pub side: Option<SideAsWritten>,
    /// Of a row with `{place}` in a formula: the side of its axis.
    #[serde(skip)]
    pub place_on: Option<Side>,
    /// `line`: constant errors of a rotary axis turn about its own line, as its error motions always do. `ball`: rotations
    /// of a linear axis that bears the workpiece are stated at the ball's centre at zero, not at the origin of R.
    pub about: Option<About>,
    /// `x`, `y` or `z`: its rotations act about a point at an unknown distance along this direction, mm (`arm_` and the id, with _).
    #[schemars(with = "Option<String>")]
    pub arm: Option<Placed>,
    /// Letters of further axes that the machine must have (on that side).
    #[serde(default)]
    #[schemars(with = "Vec<String>")]
    pub needs: Vec<Placed>,
    /// Letters of axes that the machine must not have (on that side).
    #[serde(default)]
    #[schemars(with = "Vec<String>")]
    pub unless: Vec<Placed>,
    /// Ids of effects that are special cases of it: no touches separate them from it.
    #[serde(default)]
    #[schemars(with = "Vec<String>")]
    pub includes: Vec<Placed>,
    /// Short word that groups effects in lists.
    #[serde(default)]
    pub family: String,
    /// Its parameters are 0 or 1: a supposition that is tried where the error is gross.
    #[serde(default)]
    pub discrete: bool,
    /// `block`: a set of parameters for each block. `run`: one for each run after the first.
    pub per: Option<Per>,
    /// With `per = "block"`: the bodies that have it; all where it is missing.
    #[serde(default)]
    pub of: Vec<Body>,
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

/// Point about which rotations are stated.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum About {
    /// The ball's centre at zero.
    Ball,
    /// The rotary axis's own line.
    Line,
}

/// What an effect has a set of parameters for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Per {
    /// Each block of each mounting.
    Block,
    /// Each run after the first.
    Run,
}

/// The sign that a size has by its nature.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum SignAsWritten {
    /// Lost motion, sag: only a compensation that is set too far makes it negative.
    Positive,
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
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct TermAsWritten {
    /// Name of its factor, unique among the effects of a model.
    #[schemars(with = "String")]
    pub parameter: Placed,
    /// ISO 230 symbol of the error motion or location error that it belongs to.
    pub iso: Option<String>,
    /// The paper's symbol.
    pub alias: Option<String>,
    /// `positive`: the sign that its size has by nature; a size of the other sign is named after the others.
    pub sign: Option<SignAsWritten>,
    /// um mm urad mrad deg um/m um/h um/K ppm/K ms s h 1
    #[schemars(with = "String")]
    pub unit: Placed,
    /// dx dy dz rx ry rz (axis, tool, workpiece, block), r (trigger), X Y Z A B C (reading).
    #[schemars(with = "String")]
    pub dof: Placed,
    /// The function of the state.
    #[schemars(with = "String")]
    pub formula: Placed,
    /// Usual size, in the unit.
    pub typical: Option<Typical>,
    /// Where that size comes from.
    pub source: Option<String>,
    /// Where it differs from the effect's.
    #[schemars(with = "Option<String>")]
    pub at: Option<Placed>,
    /// Before or after the axis's motion.
    pub frame: Option<Frame>,
}

/// The usual size of a parameter.
#[derive(Debug, Clone, PartialEq, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum Typical {
    /// One for all axes of the row.
    All(f64),
    /// One for each axis of the row.
    Each(Vec<f64>),
}

/// A shape parameter as written.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ShapeAsWritten {
    /// Its name in the formulas.
    #[schemars(with = "String")]
    pub parameter: Placed,
    /// Its unit: the formula sees the value in it.
    #[schemars(with = "String")]
    pub unit: Placed,
    /// Where the search begins.
    pub start: f64,
    /// Lowest value.
    pub min: Option<f64>,
    /// Highest value.
    pub max: Option<f64>,
    /// Values to be tried where a search from `start` alone would not find the right one.
    pub scan: Option<Scan>,
    /// A variable at whose value something jumps: with touches at hand, what is tried are the places half-way between
    /// successive touches, in place of `scan`.
    #[schemars(with = "Option<String>")]
    pub between: Option<Placed>,
    /// Where the start comes from.
    pub source: Option<String>,
}

/// Values of a shape parameter to be tried.
#[derive(Debug, Clone, PartialEq, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum Scan {
    /// These.
    Values(Vec<f64>),
    /// So many in equal ratios (`log = true`) or equal steps.
    Grid(Grid),
}

/// Values from one to another.
#[derive(Debug, Clone, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Grid {
    /// The first.
    pub from: f64,
    /// The last.
    pub to: f64,
    /// How many, 2 to 1000.
    pub points: usize,
    /// In equal ratios instead of equal steps.
    #[serde(default)]
    pub log: bool,
}

impl Scan {
    /// The values; `None` where they make no sense.
    #[must_use]
    pub fn values(&self) -> Option<Vec<f64>> {
        let values = match self {
            Self::Values(values) => values.clone(),
            Self::Grid(g) => {
                let fit = (2..=1000).contains(&g.points) && (!g.log || (g.from > 0.0 && g.to > 0.0));
                let share = |i: usize| i as f64 / (g.points - 1) as f64;
                let at = |i: usize| {
                    if g.log { g.from * (g.to / g.from).powf(share(i)) } else { g.from + (g.to - g.from) * share(i) }
                };
                if fit { (0..g.points).map(at).collect() } else { Vec::new() }
            }
        };
        (!values.is_empty() && values.iter().all(|v| v.is_finite())).then_some(values)
    }
}
