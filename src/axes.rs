//! Axis letters and sets of axis positions.
//!
//! [`Position`] mirrors what files and controls show: NC coordinates, millimetres and **degrees**. The chain converts
//! to radians where it builds its transforms; nothing else holds an angle in degrees.

use crate::units::rad_from_deg;
use serde::de::{MapAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize, Serializer, ser::SerializeMap};
use std::fmt;

/// The letter of an axis of the machine (ISO 841).
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize, schemars::JsonSchema)]
#[allow(missing_docs)]
pub enum AxisName {
    X,
    Y,
    Z,
    A,
    B,
    C,
}

impl AxisName {
    /// All letters, in the order in which positions are stored and printed.
    pub const ALL: [Self; 6] = [Self::X, Self::Y, Self::Z, Self::A, Self::B, Self::C];

    /// Place in [`Position`].
    #[must_use]
    pub fn index(self) -> usize {
        self as usize
    }

    /// True for A, B, C.
    #[must_use]
    pub fn is_rotary(self) -> bool {
        self.index() >= 3
    }

    /// The letter.
    #[must_use]
    pub fn letter(self) -> char {
        b"XYZABC"[self.index()] as char
    }

    /// From a letter of either case.
    #[must_use]
    pub fn from_letter(letter: char) -> Option<Self> {
        Self::ALL.into_iter().find(|name| name.letter() == letter.to_ascii_uppercase())
    }

    /// A text that is written for X or A, with its letters in braces replaced by those of this axis: `{X}` is the direction
    /// in which the axis lies and `{A}` the rotation about it, `{Y}` `{Z}` and `{B}` `{C}` are the other two in the order of
    /// the alphabet. Small letters in braces become small letters.
    #[must_use]
    pub fn fill_in(self, text: &str) -> String {
        let own = self.index() % 3;
        let order: Vec<usize> = [own].into_iter().chain((0..3).filter(|i| *i != own)).collect();
        let mut out = text.to_owned();
        for (written, meant) in order.into_iter().enumerate() {
            for kind in [0, 3] {
                let (from, to) = (Self::ALL[written + kind].letter(), Self::ALL[meant + kind].letter());
                out = out.replace(&format!("{{{from}}}"), &to.to_string());
                out = out.replace(&format!("{{{}}}", from.to_ascii_lowercase()), &to.to_ascii_lowercase().to_string());
            }
        }
        out
    }
}

impl fmt::Display for AxisName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.letter())
    }
}

/// Positions of some axes, NC coordinates, mm and degrees; in JSON an object such as `{"B": -30.0, "C": 90.0}`.
///
/// A plan holds five of these for every touch: they are kept small.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct AxisMap {
    /// Values of the axes that are given, 0 for the others.
    values: [f64; 6],
    /// One bit for each axis that is given.
    given: u8,
}

impl AxisMap {
    /// Value of an axis, if it is given.
    #[must_use]
    pub fn get(&self, axis: AxisName) -> Option<f64> {
        (self.given & (1 << axis.index()) != 0).then_some(self.values[axis.index()])
    }

    /// Sets the value of an axis.
    pub fn set(&mut self, axis: AxisName, value: f64) {
        self.values[axis.index()] = value;
        self.given |= 1 << axis.index();
    }

    /// The same with one value set.
    #[must_use]
    pub fn with(mut self, axis: AxisName, value: f64) -> Self {
        self.set(axis, value);
        self
    }

    /// X, Y, Z from a vector in mm.
    #[must_use]
    pub fn xyz(x: f64, y: f64, z: f64) -> Self {
        Self { values: [x, y, z, 0.0, 0.0, 0.0], given: 0b111 }
    }

    /// The axes that are given, in storage order.
    pub fn iter(&self) -> impl Iterator<Item = (AxisName, f64)> + '_ {
        AxisName::ALL.into_iter().filter_map(|a| self.get(a).map(|v| (a, v)))
    }

    /// True when no axis is given.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.given == 0
    }

    /// These positions, with `other`'s where they are not given.
    #[must_use]
    pub fn or(&self, other: &Self) -> Self {
        let mut out = *other;
        self.iter().for_each(|(axis, value)| out.set(axis, value));
        out
    }

    /// Those of the linear axes.
    #[must_use]
    pub fn linear(&self) -> Self {
        self.iter().filter(|(axis, _)| !axis.is_rotary()).fold(Self::default(), |out, (axis, mm)| out.with(axis, mm))
    }

    /// A full position; axes that are not given stand at 0.
    #[must_use]
    pub fn position(&self) -> Position {
        Position(self.values)
    }
}

impl From<Position> for AxisMap {
    /// All six axes.
    fn from(position: Position) -> Self {
        Self { values: position.0, given: 0b11_1111 }
    }
}

impl Serialize for AxisMap {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut map = serializer.serialize_map(None)?;
        for (axis, value) in self.iter() {
            map.serialize_entry(&axis, &value)?;
        }
        map.end()
    }
}

impl<'de> Deserialize<'de> for AxisMap {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        // straight into its place: a plan has five of these for every touch
        deserializer.deserialize_map(Axes)
    }
}

struct Axes;

impl<'de> Visitor<'de> for Axes {
    type Value = AxisMap;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a map of axis letters and positions")
    }

    fn visit_map<M: MapAccess<'de>>(self, mut map: M) -> Result<AxisMap, M::Error> {
        let mut out = AxisMap::default();
        while let Some((axis, value)) = map.next_entry::<AxisName, f64>()? {
            out.set(axis, value);
        }
        Ok(out)
    }
}

impl schemars::JsonSchema for AxisMap {
    fn schema_name() -> std::borrow::Cow<'static, str> {
        "AxisMap".into()
    }
    fn json_schema(generator: &mut schemars::SchemaGenerator) -> schemars::Schema {
        std::collections::BTreeMap::<String, f64>::json_schema(generator)
    }
}

/// Positions of all six axes (those that a machine lacks stand at 0), NC coordinates, mm and **degrees**, relative to R.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Position(pub [f64; 6]);

impl Position {
    /// Value of an axis, mm or degrees.
    #[must_use]
    pub fn get(&self, axis: AxisName) -> f64 {
        self.0[axis.index()]
    }

    /// Sets the value of an axis, mm or degrees.
    pub fn set(&mut self, axis: AxisName, value: f64) {
        self.0[axis.index()] = value;
    }

    /// Value as the kinematics uses it: mm for a linear axis, **radians** for a rotary one.
    #[must_use]
    pub fn mm_or_rad(&self, axis: AxisName) -> f64 {
        let value = self.get(axis);
        if axis.is_rotary() { rad_from_deg(value) } else { value }
    }

    /// X, Y, Z in mm.
    #[must_use]
    pub fn xyz_mm(&self) -> nalgebra::Vector3<f64> {
        nalgebra::Vector3::new(self.0[0], self.0[1], self.0[2])
    }

    /// The same pose with other X, Y, Z in mm.
    #[must_use]
    pub fn with_xyz_mm(mut self, xyz: nalgebra::Vector3<f64>) -> Self {
        self.0[..3].copy_from_slice(xyz.as_slice());
        self
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn axis_map_reads_and_writes_only_what_is_given() {
        let map = AxisMap::default().with(AxisName::B, -30.0).with(AxisName::C, 90.0);
        let text = serde_json::to_string(&map).unwrap();
        assert_eq!(text, r#"{"B":-30.0,"C":90.0}"#);
        assert_eq!(serde_json::from_str::<AxisMap>(&text).unwrap(), map);
        assert_eq!(map.position().get(AxisName::X), 0.0);
    }
}
