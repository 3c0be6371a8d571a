//! Forms of artefacts: what each needs besides its centre.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Form of an artefact. Spheres are round in every direction; cylinders and bores stand along Z of R at zero.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Form {
    /// A box with three edges: a gauge block, a cube.
    #[default]
    Box,
    /// A calibration sphere.
    Sphere,
    /// A cylinder that is touched from outside: a pin, a boss.
    Cylinder,
    /// A hole through a box that is touched from inside: a ring gauge, a bore.
    Bore,
    /// A flat face that looks up: a table, a pallet.
    Plane,
}

impl Form {
    /// As it is written.
    #[must_use]
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Box => "box",
            Self::Sphere => "sphere",
            Self::Cylinder => "cylinder",
            Self::Bore => "bore",
            Self::Plane => "plane",
        }
    }

    /// Is it the default?
    #[must_use]
    #[allow(clippy::trivially_copy_pass_by_ref)] // serde's signature
    pub fn is_box(&self) -> bool {
        *self == Self::Box
    }

    /// Does it have a diameter?
    #[must_use]
    pub fn is_round(self) -> bool {
        matches!(self, Self::Sphere | Self::Cylinder | Self::Bore)
    }
}
