//! `machines.toml` as a person wrote it: every field as it stands, with its place in the file. Nothing is checked here.

use super::form::Form;
use crate::axes::{AxisMap, AxisName};
use schemars::JsonSchema;
use serde::Deserialize;
use toml::Spanned;

/// The whole file.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct File {
    /// `axiscal-machines/1`
    #[schemars(with = "String")]
    pub format: Spanned<String>,
    /// The machines.
    #[serde(default)]
    pub machine: Vec<Machine>,
}

/// One machine.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Machine {
    /// Short name, used on the command line.
    #[schemars(with = "String")]
    pub name: Spanned<String>,
    /// What it is, in one line.
    #[serde(default)]
    pub says: String,
    /// Machine coordinates (mm, deg) at the origin of frame R.
    #[serde(default)]
    pub origin: AxisMap,
    /// The moving axes, in any order; `parent` makes the chain.
    #[serde(default)]
    pub axis: Vec<Axis>,
    /// What bears the workpiece: exactly one.
    #[serde(default)]
    #[schemars(with = "Workpiece")]
    pub workpiece: OneOrMany<Workpiece>,
    /// The spindle with the probe: exactly one.
    #[serde(default)]
    #[schemars(with = "Tool")]
    pub tool: OneOrMany<Tool>,
    /// Points at which location errors can be stated, mm in R.
    pub reference: Option<Reference>,
    /// The touch probe.
    pub probe: Option<Spanned2<Probe>>,
    /// Further styli of the probe, which a program may ask for.
    #[serde(default)]
    pub stylus: Vec<Stylus>,
    /// Solids that must not be hit, whatever is mounted.
    #[serde(default)]
    pub solid: Vec<Solid>,
    /// Artefacts as they can be mounted.
    #[serde(default)]
    pub mounting: Vec<Mounting>,
}

/// A value with its place, whose schema is the value's.
pub type Spanned2<T> = SpannedSchema<T>;

/// A `toml::Spanned` that has the JSON schema of what it holds.
#[derive(Debug, Deserialize)]
#[serde(transparent)]
pub struct SpannedSchema<T>(pub Spanned<T>);

impl<T: JsonSchema> JsonSchema for SpannedSchema<T> {
    fn schema_name() -> std::borrow::Cow<'static, str> {
        T::schema_name()
    }
    fn json_schema(generator: &mut schemars::SchemaGenerator) -> schemars::Schema {
        T::json_schema(generator)
    }
}

/// A table that must stand once; several are kept so that all can be named in the message.
#[derive(Debug)]
pub enum OneOrMany<T> {
    /// `[machine.tool]`
    One(Box<T>),
    /// `[[machine.tool]]`
    Many(Vec<T>),
}

impl<T> Default for OneOrMany<T> {
    fn default() -> Self {
        Self::Many(Vec::new())
    }
}

// by hand: serde's `untagged` buffers what it reads, and the places in the file are lost with it
impl<'de, T: Deserialize<'de>> Deserialize<'de> for OneOrMany<T> {
    fn deserialize<D: serde::Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Tables<T>(std::marker::PhantomData<T>);
        impl<'de, T: Deserialize<'de>> serde::de::Visitor<'de> for Tables<T> {
            type Value = OneOrMany<T>;
            fn expecting(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                write!(f, "a table")
            }
            fn visit_map<A: serde::de::MapAccess<'de>>(self, map: A) -> Result<Self::Value, A::Error> {
                T::deserialize(serde::de::value::MapAccessDeserializer::new(map)).map(|t| OneOrMany::One(Box::new(t)))
            }
            fn visit_seq<A: serde::de::SeqAccess<'de>>(self, seq: A) -> Result<Self::Value, A::Error> {
                Vec::deserialize(serde::de::value::SeqAccessDeserializer::new(seq)).map(OneOrMany::Many)
            }
        }
        deserializer.deserialize_any(Tables(std::marker::PhantomData))
    }
}

impl<T> OneOrMany<T> {
    /// All that were written.
    pub fn all(&self) -> &[T] {
        match self {
            Self::One(one) => std::slice::from_ref(one),
            Self::Many(many) => many,
        }
    }
}

/// A moving axis.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Axis {
    /// Its letter.
    #[schemars(with = "AxisName")]
    pub name: Spanned<AxisName>,
    /// `base` or the letter of the axis that bears it.
    #[schemars(with = "Option<String>")]
    pub parent: Option<Spanned<String>>,
    /// `linear` or `rotary`.
    pub kind: Option<AxisKind>,
    /// Direction in R; linear: of the tool over the workpiece for a positive coordinate.
    #[schemars(with = "Option<[f64; 3]>")]
    pub direction: Option<Spanned<[f64; 3]>>,
    /// A point of a rotary axis, mm in R.
    #[schemars(with = "Option<[f64; 3]>")]
    pub point: Option<Spanned<[f64; 3]>>,
    /// Rotary: +1 when a positive angle turns what it carries right-handed about `direction`, -1 otherwise.
    #[schemars(with = "Option<i64>")]
    pub sense: Option<Spanned<i64>>,
    /// Lowest and highest machine coordinate, mm or deg.
    #[schemars(with = "Option<[f64; 2]>")]
    pub range: Option<Spanned<[f64; 2]>>,
    /// Rotary: scatter of the ball's place from one indexing to the next, µm, 1 sigma.
    #[schemars(with = "Option<f64>")]
    pub indexing_repeatability_um: Option<Spanned<f64>>,
}

/// Kind of an axis.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum AxisKind {
    /// Moves along `direction`.
    Linear,
    /// Turns about `direction` through `point`.
    Rotary,
}

/// What bears the workpiece.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Workpiece {
    /// `base` or the letter of the axis that bears it.
    #[schemars(with = "String")]
    pub parent: Spanned<String>,
}

/// The spindle with the probe.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Tool {
    /// `base` or the letter of the axis that bears it.
    #[schemars(with = "String")]
    pub parent: Spanned<String>,
    /// Where `length` is measured from, mm in R.
    pub pivot: [f64; 3],
    /// From the ball to the spindle, in R.
    #[schemars(with = "[f64; 3]")]
    pub direction: Spanned<[f64; 3]>,
    /// From the pivot to the ball's centre, mm.
    #[schemars(with = "f64")]
    pub length: Spanned<f64>,
    /// +1 when the control's M19 angle counts right-handed about `direction`, -1 otherwise.
    #[serde(default = "plus_one")]
    #[schemars(with = "i64")]
    pub spindle_sense: i64,
}

fn plus_one() -> i64 {
    1
}

/// Points at which location errors can be stated, mm in R.
#[derive(Debug, Clone, Copy, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Reference {
    /// The default.
    pub pivot: [f64; 3],
    /// The ball's centre at zero.
    pub ball: [f64; 3],
    /// The table's face.
    pub table: [f64; 3],
}

/// The touch probe: shapes in mm, feeds in mm/min.
#[derive(Debug, Clone, Copy, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[allow(missing_docs)]
pub struct Probe {
    pub ball_radius: f64,
    pub stem_radius: f64,
    /// Ball's centre to probe body.
    pub stem_length: f64,
    pub body_radius: f64,
    pub body_length: f64,
    /// Radius of the head, from the body up to the pivot.
    pub head_radius: f64,
    /// 1 sigma of a touch in one direction, µm.
    pub repeatability_um: f64,
    /// How far the stylus may be pushed past the trigger.
    pub overtravel: f64,
    /// A search begins this far off the nominal contact.
    pub approach: f64,
    /// And ends this far past it.
    pub search: f64,
    /// Least distance to everything that is not touched.
    pub clearance: f64,
    /// How far a block may stand from where it should.
    pub placement_tolerance: f64,
    pub fast_feed: f64,
    pub slow_feed: f64,
    pub position_feed: f64,
    /// Between the first touch and the measuring touch.
    pub back_off: f64,
}

/// Another stylus of the same probe: what is not written is as with the probe's own.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Stylus {
    /// Short name, used by programs.
    #[schemars(with = "String")]
    pub name: Spanned<String>,
    /// What to do at the machine, in one line.
    #[serde(default)]
    pub says: String,
    /// How much longer the stem is than the probe's own, mm; negative: shorter.
    #[serde(default)]
    pub longer: f64,
    /// Radius of its ball, mm.
    pub ball_radius: Option<f64>,
    /// Radius of its stem, mm.
    pub stem_radius: Option<f64>,
}

/// A solid that must not be hit.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Solid {
    /// For messages.
    #[schemars(with = "String")]
    pub name: Spanned<String>,
    /// `base`, `table` (the linear axes' table) or the letter of an axis of the workpiece side.
    #[schemars(with = "String")]
    pub carrier: Spanned<String>,
    /// A box along the axes of R.
    #[serde(rename = "box")]
    pub cuboid: Option<Cuboid>,
    /// Or a cylinder.
    pub cylinder: Option<Cylinder>,
}

/// A box along the axes of R, mm.
#[derive(Debug, Clone, Copy, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Cuboid {
    /// Its centre.
    pub centre: [f64; 3],
    /// Its full edges.
    pub size: [f64; 3],
}

/// A cylinder, mm.
#[derive(Debug, Clone, Copy, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[allow(missing_docs)]
pub struct Cylinder {
    /// Centre of the lower end.
    pub foot: [f64; 3],
    /// From the foot to the other end.
    pub direction: [f64; 3],
    pub radius: f64,
    pub height: f64,
}

/// An artefact as it is mounted.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Mounting {
    /// Short name, used by programs.
    #[schemars(with = "String")]
    pub name: Spanned<String>,
    /// What to do at the machine, in one line.
    #[serde(default)]
    pub says: String,
    /// `table` (the linear axes' table; without a linear axis on the workpiece side: what stands on the base) or the
    /// letter of an axis of the workpiece side. Not `base`.
    #[schemars(with = "String")]
    pub carrier: Spanned<String>,
    /// What each block stands on.
    pub riser: Option<Riser>,
    /// Further solids, mounted with the blocks.
    #[serde(default)]
    pub solid: Vec<Solid>,
    /// The blocks.
    #[serde(default)]
    pub block: Vec<Block>,
}

/// What a block stands on: a box or a round stem under it.
#[derive(Clone, Copy, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Riser {
    /// From the block's lower face down, mm.
    pub height: f64,
    /// Edges along X and Y, mm; along the two other axes where it does not go along Z.
    #[serde(default)]
    pub size: [f64; 2],
    /// Instead of the edges: of a round stem, mm.
    pub diameter: Option<f64>,
    /// Where it goes from the block, e.g. `-Y`; left out: -Z, or to where the carrier's solids are.
    pub toward: Option<Toward>,
}

// machines are recognised by a digest of their records' debug form: a riser that goes down is written as it always was
impl std::fmt::Debug for Riser {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let mut out = f.debug_struct("Riser");
        out.field("height", &self.height).field("size", &self.size);
        if let Some(diameter) = self.diameter {
            out.field("diameter", &diameter);
        }
        if let Some(toward) = self.toward.filter(|t| *t != Toward::MinusZ) {
            out.field("toward", &toward);
        }
        out.finish()
    }
}

/// A direction along an axis of R.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, JsonSchema)]
pub enum Toward {
    /// +X
    #[serde(rename = "+X")]
    PlusX,
    /// -X
    #[serde(rename = "-X")]
    MinusX,
    /// +Y
    #[serde(rename = "+Y")]
    PlusY,
    /// -Y
    #[serde(rename = "-Y")]
    MinusY,
    /// +Z
    #[serde(rename = "+Z")]
    PlusZ,
    /// -Z
    #[serde(rename = "-Z")]
    MinusZ,
}

impl Toward {
    /// All, down first.
    pub const ALL: [Self; 6] = [Self::MinusZ, Self::MinusY, Self::PlusY, Self::MinusX, Self::PlusX, Self::PlusZ];

    /// The axis, 0 to 2 for X to Z, and the sign.
    #[must_use]
    pub fn axis_and_sign(self) -> (usize, f64) {
        match self {
            Self::PlusX => (0, 1.0),
            Self::MinusX => (0, -1.0),
            Self::PlusY => (1, 1.0),
            Self::MinusY => (1, -1.0),
            Self::PlusZ => (2, 1.0),
            Self::MinusZ => (2, -1.0),
        }
    }

    /// As it is written.
    #[must_use]
    pub fn as_str(self) -> &'static str {
        match self {
            Self::PlusX => "+X",
            Self::MinusX => "-X",
            Self::PlusY => "+Y",
            Self::MinusY => "-Y",
            Self::PlusZ => "+Z",
            Self::MinusZ => "-Z",
        }
    }
}

/// A body that is touched, mm in R at zero.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Block {
    /// Short name.
    #[schemars(with = "String")]
    pub name: Spanned<String>,
    /// Its centre.
    #[schemars(with = "[f64; 3]")]
    pub centre: Spanned<[f64; 3]>,
    /// What it is; without it a box.
    #[serde(default)]
    pub form: Form,
    /// Full edges of a box, of the body round a bore, of a plane.
    #[schemars(with = "Option<[f64; 3]>")]
    pub size: Option<Spanned<[f64; 3]>>,
    /// Of a sphere, a cylinder or a bore.
    #[schemars(with = "Option<f64>")]
    pub diameter: Option<Spanned<f64>>,
    /// Of a cylinder.
    #[schemars(with = "Option<f64>")]
    pub height: Option<Spanned<f64>>,
    /// Where it differs from the mounting's.
    pub riser: Option<Riser>,
    /// Where it differs from the mounting's: a fixed block beside those that turn.
    #[schemars(with = "Option<String>")]
    pub carrier: Option<Spanned<String>>,
}
