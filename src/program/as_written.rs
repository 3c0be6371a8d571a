//! `programs/*.toml` as a person wrote it: every field as it stands, with its place in the file. Nothing is checked here.

use schemars::JsonSchema;
use serde::Deserialize;
use std::collections::BTreeMap;
use toml::Spanned;

/// A probing program: which faces of which blocks are touched, on which grids, in which poses, how often.
///
/// Lengths in mm, angles in deg, feeds in mm/min.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct File {
    /// `axiscal-programs/1`
    #[schemars(with = "String")]
    pub format: Spanned<String>,
    /// Short name: what `generate --program` takes and what the written files are called.
    #[schemars(with = "String")]
    pub name: Spanned<String>,
    /// The machine that it was written for; without it the program is for every machine that has its axes and blocks.
    #[schemars(with = "Option<String>")]
    pub machine: Option<Spanned<String>>,
    /// What it is for, in one line.
    #[serde(default)]
    pub says: String,
    /// The mounting of the machine's description that carries the blocks, where a stage does not say otherwise.
    #[schemars(with = "String")]
    pub mounting: Spanned<String>,
    /// The stylus of the machine's description, where a stage does not say otherwise; without it the probe's own.
    #[schemars(with = "Option<String>")]
    pub stylus: Option<Spanned<String>>,
    /// What the names of faces mean: the block's own faces at all axes 0, or machine directions at the pose.
    #[serde(default)]
    pub faces_in: FacesIn,
    /// The artefact, one sphere, is put down by eye: how far it may stand from its place along X, Y and Z, mm. The first touches
    /// find it. Without it, it stands within the `placement_tolerance` of the machine's probe.
    #[schemars(with = "Option<f64>")]
    pub placement_tolerance: Option<Spanned<f64>>,
    /// How often each point is touched, where a stage or a set-up does not say otherwise.
    #[schemars(with = "Option<i64>")]
    pub repeats: Option<Spanned<i64>>,
    /// How far a rotary axis goes past a pose that it must come to from the other side, deg.
    #[schemars(with = "Option<f64>")]
    pub overshoot_deg: Option<Spanned<f64>>,
    /// Places of the points on a face.
    #[serde(default)]
    pub grid: Vec<Grid>,
    /// Directions in which what is round is touched.
    #[serde(default)]
    pub ring: Vec<Ring>,
    /// The stages of the procedure, in the order in which they are run.
    #[serde(default)]
    pub stage: Vec<Stage>,
}

/// What the names of faces mean.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum FacesIn {
    /// The block's own face at all axes 0: it turns with what carries the block.
    #[default]
    Block,
    /// The direction into which the face looks at the pose; the carrier must then stand at a multiple of 90 degrees.
    Machine,
}

/// What the directions of a ring count in.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum RingIn {
    /// The body at all axes 0: they turn with what carries it.
    Block,
    /// The machine, whatever the pose.
    Machine,
    /// The spindle at the pose: elevation 90 is where it comes from.
    Tool,
}

/// How the blocks of a stage came to stand.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Placed {
    /// As they stood when this mounting was used last: on a pallet that comes back to its place.
    Same,
    /// Put up anew: where they stand now is another unknown.
    Anew,
}

/// Points on a face: all combinations of `u` with `v` or with `depth` (`u` changes slowest).
///
/// `u` and `v` count from the centre of the face along the axes of the frame that `faces_in` names:
/// on ±Z `u` is along X and `v` along Y; on ±X `u` is along Y, on ±Y along X, and `v` along Z.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Grid {
    /// Short name.
    #[schemars(with = "String")]
    pub name: Spanned<String>,
    /// First coordinate, mm from the centre of the face.
    pub u: Vec<f64>,
    /// Second coordinate, mm from the centre of the face.
    #[serde(default)]
    pub v: Vec<f64>,
    /// Instead of `v`, side faces only: mm down from the upper edge.
    #[serde(default)]
    pub depth: Vec<f64>,
}

/// Points on a sphere, a cylinder or in a bore: all combinations of `azimuth_deg` with `elevation_deg` or with `depth`
/// (`azimuth_deg` changes slowest).
///
/// Azimuth counts from +X towards +Y, elevation from the equator up, in the frame that `faces_in` names. On cylinders and in
/// bores azimuths are always those of the body itself.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Ring {
    /// Short name.
    #[schemars(with = "String")]
    pub name: Spanned<String>,
    /// Spheres: what the directions count in; without it what `faces_in` says.
    pub directions_in: Option<RingIn>,
    /// Directions from the middle, deg.
    pub azimuth_deg: Vec<f64>,
    /// Spheres: height over the equator, deg; 90 is the pole.
    #[serde(default)]
    pub elevation_deg: Vec<f64>,
    /// Cylinders and bores: mm down from the upper end.
    #[serde(default)]
    pub depth: Vec<f64>,
}

/// A stage: set-ups that belong together, e.g. `head`.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Stage {
    /// Short name; the touches carry it.
    #[schemars(with = "String")]
    pub name: Spanned<String>,
    /// The mounting, where it differs from the program's: the program stops and says what to put up.
    #[schemars(with = "Option<String>")]
    pub mounting: Option<Spanned<String>>,
    /// The stylus, where it differs from the program's (`own`: the probe's own): the program stops and says which.
    #[schemars(with = "Option<String>")]
    pub stylus: Option<Spanned<String>>,
    /// Whether the blocks stand as an earlier stage left them. Default: `same` while the mounting does not change, `anew`
    /// when it does.
    pub placed: Option<Placed>,
    /// How often each point is touched.
    #[schemars(with = "Option<i64>")]
    pub repeats: Option<Spanned<i64>>,
    /// The set-ups, in order.
    #[serde(default)]
    pub setup: Vec<Setup>,
}

/// A set-up: a pose of the rotary axes (or several, one after the other) and what is touched in it.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Setup {
    /// Rotary axes, deg: one angle or a list each; lists are combined, the last axis changes fastest. Axes that are not
    /// named stand at 0.
    #[schemars(with = "BTreeMap<String, Angles>")]
    pub pose: Spanned<BTreeMap<String, Angles>>,
    /// The sense (1, -1) in which a rotary axis must come to the pose; without it the shorter way without overshoot.
    #[schemars(with = "Option<BTreeMap<String, i64>>")]
    pub from: Option<Spanned<BTreeMap<String, i64>>>,
    /// Orientation of the spindle, right-handed about the tool frame's +z, deg.
    #[schemars(with = "Option<f64>")]
    pub spindle_deg: Option<Spanned<f64>>,
    /// Feed of the measuring touch, mm/min, where it differs from the machine's `slow_feed`.
    #[schemars(with = "Option<f64>")]
    pub feed: Option<Spanned<f64>>,
    /// How often each point is touched.
    #[schemars(with = "Option<i64>")]
    pub repeats: Option<Spanned<i64>>,
    /// The blocks, in order; without it all of the mounting.
    #[schemars(with = "Option<Vec<String>>")]
    pub blocks: Option<Vec<Spanned<String>>>,
    /// The faces and their grids, in order.
    #[serde(default)]
    pub touch: Vec<TouchGroup>,
}

/// One angle or several.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum Angles {
    /// One pose.
    One(f64),
    /// One pose each.
    Many(Vec<f64>),
}

impl Angles {
    /// All that were written.
    pub fn all(&self) -> &[f64] {
        match self {
            Self::One(one) => std::slice::from_ref(one),
            Self::Many(many) => many,
        }
    }
}

/// Faces that are touched on one grid, or a ring of points on what is round.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct TouchGroup {
    /// `+X`, `-X`, `+Y`, `-Y`, `+Z`, `-Z`, in order.
    #[serde(default)]
    #[schemars(with = "Vec<String>")]
    pub faces: Vec<Spanned<String>>,
    /// Name of a grid of this file.
    #[schemars(with = "Option<String>")]
    pub grid: Option<Spanned<String>>,
    /// Instead of faces and grid: name of a ring of this file.
    #[schemars(with = "Option<String>")]
    pub ring: Option<Spanned<String>>,
}
