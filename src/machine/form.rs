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
    /// The centre of a sphere as something else has measured it. In plans only.
    #[schemars(skip)]
    Centre,
    /// The same as readings of a sensor, whose zero is unknown. In plans only.
    #[schemars(skip)]
    Reading,
    /// A workpiece that is known by its nominal points: each is a plane of its own. In plans only.
    #[schemars(skip)]
    Part,
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
            Self::Centre => "centre",
            Self::Reading => "reading",
            Self::Part => "part",
        }
    }

    /// Is it known by its centre only? Then no probe has triggered, and no direction of approach means anything.
    #[must_use]
    pub fn is_centre(self) -> bool {
        matches!(self, Self::Centre | Self::Reading)
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
