//! Where a location error stands in the chain, read from an effect's id and a parameter's name.
//!
//! The table "Meaning of the location errors" of `docs/formats.md` in code; nothing else decides a place.

use crate::axes::AxisName;
use crate::machine::{Machine, Side};
use serde::{Deserialize, Serialize};
use std::fmt;

/// Place of an error displacement relative to the rotation of its axis.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Place {
    /// Before the axis's rotation: it does not turn with the axis.
    Before,
    /// After the axis's rotation: it turns with the axis.
    After,
    /// The axis's own angle: it stands this much further, right-handed about its direction, than it was told.
    Zero,
}

/// Component of a displacement E(d, w) = Trans(d)·Rz(c)·Ry(b)·Rx(a).
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
#[allow(missing_docs)]
pub enum Dof {
    Dx,
    Dy,
    Dz,
    Rx,
    Ry,
    Rz,
}

impl Dof {
    /// All components, in the order of `geometry::Displacement`.
    pub const ALL: [Self; 6] = [Self::Dx, Self::Dy, Self::Dz, Self::Rx, Self::Ry, Self::Rz];

    /// `0..6`, as `geometry::Displacement` counts.
    #[must_use]
    pub fn index(self) -> usize {
        self as usize
    }

    /// True for a rotation.
    #[must_use]
    pub fn is_angle(self) -> bool {
        self.index() >= 3
    }

    /// The unit in files: `mm` or `deg`.
    #[must_use]
    pub fn unit(self) -> &'static str {
        if self.is_angle() { "deg" } else { "mm" }
    }

    /// The letter of the ISO symbol's first place: X Y Z for a translation, A B C for a rotation.
    #[must_use]
    pub fn iso_letter(self) -> char {
        AxisName::ALL[self.index()].letter()
    }

    /// Its lower-case ISO letter, as HAL pins spell it: x y z a b c.
    #[must_use]
    pub fn pin_letter(self) -> char {
        self.iso_letter().to_ascii_lowercase()
    }
}

impl fmt::Display for Dof {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}{}", if self.is_angle() { 'r' } else { 'd' }, b"xyz"[self.index() % 3] as char)
    }
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Before => "before",
            Self::After => "after",
            Self::Zero => "zero",
        })
    }
}

/// Axis, place and component of an error: what distinguishes one carried term from another.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Spot {
    /// The rotary axis.
    pub axis: AxisName,
    /// Relative to its rotation.
    pub place: Place,
    /// Component.
    pub dof: Dof,
}

/// Reads an ISO location symbol such as `EX0C` or `E_AOB`: component and axis.
#[must_use]
pub fn iso_location(name: &str) -> Option<(Dof, AxisName)> {
    let mut letters = name.chars().filter(|c| *c != '_');
    let (e, what, zero, axis) = (letters.next()?, letters.next()?, letters.next()?, letters.next()?);
    let known = letters.next().is_none() && e.eq_ignore_ascii_case(&'E') && matches!(zero, '0' | 'O' | 'o');
    let dof = Dof::ALL.into_iter().find(|d| d.iso_letter() == what.to_ascii_uppercase())?;
    let axis = AxisName::from_letter(axis)?;
    (known && axis.is_rotary()).then_some((dof, axis))
}

/// What an effect's parameter means as a place of the chain.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Meaning {
    /// A location error at this spot.
    At(Spot),
    /// The effect is one of location errors, but the name does not fit it or the machine.
    Unreadable,
    /// The effect is not one of location errors.
    Other,
}

/// The place of a parameter of an effect.
///
/// `paper-…` and `double-head-10` stand before the rotation of the axis in the symbol. `location-…` stands before it on
/// the workpiece side; on the tool side the tilts do and the offsets stand after it. `zero-…` is the axis's own angle.
#[must_use]
pub fn meaning(effect: &str, parameter: &str, machine: &Machine) -> Meaning {
    let paper = matches!(effect, "paper-head" | "paper-table" | "paper-double-head" | "double-head-10");
    let of_axis = |prefix: &str| {
        let mut letters = effect.strip_prefix(prefix)?.chars();
        let axis = AxisName::from_letter(letters.next()?)?;
        (letters.next().is_none() && axis.is_rotary()).then_some(axis)
    };
    let (location, zero) = (of_axis("location-"), of_axis("zero-"));
    if !paper && location.is_none() && zero.is_none() {
        return Meaning::Other;
    }
    let Some((dof, symbol_axis)) = iso_location(parameter) else { return Meaning::Unreadable };
    let Some(axis) = machine.axis(symbol_axis) else { return Meaning::Unreadable };
    if location.or(zero).is_some_and(|named| named != symbol_axis) {
        return Meaning::Unreadable;
    }
    let place = if zero.is_some() {
        if !dof.is_angle() {
            return Meaning::Unreadable;
        }
        Place::Zero
    } else if location.is_some() && axis.side == Side::Tool && !dof.is_angle() {
        Place::After
    } else {
        Place::Before
    };
    Meaning::At(Spot { axis: symbol_axis, place, dof })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diag::source;

    fn swivel_head() -> Machine {
        let (machines, _) = crate::machine::load(&source("m", crate::machine::BUILT_IN)).unwrap();
        machines.into_iter().find(|m| m.name == "swivel-head").unwrap()
    }

    #[test]
    fn symbols_are_read_in_every_spelling() {
        for name in ["EX0C", "E_XOC", "ex0c", "E_X0C"] {
            assert_eq!(iso_location(name), Some((Dof::Dx, AxisName::C)), "{name}");
        }
        for name in ["EXX", "EX0X", "EX0CC", "d_xBZ", "", "EÄ0C"] {
            assert_eq!(iso_location(name), None, "{name}");
        }
    }

    #[test]
    fn the_place_follows_effect_and_side() {
        let machine = swivel_head();
        let at = |effect, name| match meaning(effect, name, &machine) {
            Meaning::At(s) => format!("{} {} {}", s.axis, s.place, s.dof),
            other => format!("{other:?}"),
        };
        assert_eq!(at("paper-head", "EX0B"), "B before dx");
        assert_eq!(at("location-b", "EX0B"), "B after dx");
        assert_eq!(at("location-b", "EA0B"), "B before rx");
        assert_eq!(at("location-c", "EX0C"), "C before dx");
        assert_eq!(at("zero-b", "EB0B"), "B zero ry");
        assert_eq!(at("zero-b", "EX0B"), "Unreadable");
        assert_eq!(at("location-c", "EX0B"), "Unreadable");
        assert_eq!(at("location-a", "EX0A"), "Unreadable");
        assert_eq!(at("scale-x", "EXX"), "Other");
        assert_eq!(at("location-x", "EX0X"), "Other");
    }
}
