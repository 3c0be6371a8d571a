//! Functions that a user may have left on and that act on a program's coordinates: scaling, polar coordinates, an offset that
//! turns along with the table. A control may lack them, and then takes neither their G number nor the one that ends them.
//!
//! Groups 11 (G50, G51), 17 (G15, G16) and 23 (G54.2) of #4001 and up: from memory. G255 ends G254: Haas UMC-750 manual, p. 40.

use crate::check::run::LeftoverMode;
use crate::post::Postprocessor;

/// What a control may be found with.
pub const ALL: &[LeftoverMode] = &[LeftoverMode::Scaled, LeftoverMode::Polar, LeftoverMode::TurnsAlong];

/// A control whose file says that nothing switches the dynamic offset off lacks it.
pub fn may_act(what: LeftoverMode, post: &Postprocessor) -> bool {
    what != LeftoverMode::TurnsAlong || post.settings.get("dynamic_offset").is_none_or(|ends| !ends.is_empty())
}

/// What a G number (in tenths) ends; G54.2 with P0.
pub fn ended_by(tenth: i64, p: Option<f64>) -> Result<Option<LeftoverMode>, String> {
    Ok(Some(match tenth {
        500 => LeftoverMode::Scaled,
        150 => LeftoverMode::Polar,
        542 if p == Some(0.0) => LeftoverMode::TurnsAlong,
        542 => return Err("G54.2 is known with P0 only, which ends it".to_owned()),
        2550 => LeftoverMode::TurnsAlong,
        _ => return Ok(None),
    }))
}

/// What the variables of their groups hold.
pub fn modal(variable: u32, acts: Option<LeftoverMode>) -> Option<f64> {
    let of = |what: LeftoverMode, on: f64, off: f64| if acts == Some(what) { on } else { off };
    Some(match variable {
        4011 => of(LeftoverMode::Scaled, 51.0, 50.0),
        4017 => of(LeftoverMode::Polar, 16.0, 15.0),
        4023 => of(LeftoverMode::TurnsAlong, 54.2, 0.0),
        _ => return None,
    })
}

/// The words that end it.
pub fn ends(what: LeftoverMode) -> &'static str {
    match what {
        LeftoverMode::Scaled => "G50",
        LeftoverMode::Polar => "G15",
        _ => "G54.2 P0 (Haas: G255)",
    }
}
