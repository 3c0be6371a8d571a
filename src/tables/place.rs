//! Where an error stands in the chain, and what of an effect a correction can hold.
//!
//! The effects say it (`at`, `about`, `frame`, `dof`, `formula`); nothing here knows one by name.

use crate::axes::AxisName;
use crate::machine::{Axis, Machine, Side};
use crate::model::catalogue::{Effect, Place as At, Term};
use crate::model::reference_points::{Stated, direction_sign, own_turn, stated};
use crate::units::deg_from_rad;
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

/// What a parameter of an effect means to a correction.
#[derive(Debug, Clone, PartialEq)]
pub enum Meaning {
    /// Location errors: where, and mm or deg per unit of the parameter.
    Location(Vec<(Spot, f64)>),
    /// The tool is longer: mm per unit of the parameter.
    ToolLength(f64),
    /// The position of one axis, by that position and its sense only.
    Position(AxisName),
    /// Of the probe or the artefact: it spoils a measurement, not the machine.
    Measurement,
    /// No correction holds it, for this reason.
    Nothing(String),
}

/// The meaning of a parameter, by the places and formulas of its effect.
///
/// A constant displacement at a rotary axis is a location error, before or after the rotation as the effect says; a
/// constant turn of the axis about its own line is one of its angle. A displacement of an axis along (about) its own
/// direction that depends on nothing but its own position and sense is an error of that position.
#[must_use]
pub fn meaning(effect: &Effect, parameter: usize, machine: &Machine) -> Meaning {
    if effect.nuisance
        || effect.is_repeated()
        || effect.terms.iter().all(|t| matches!(t.place, At::Block | At::Trigger))
    {
        return Meaning::Measurement;
    }
    let terms: Vec<&Term> = effect.terms.iter().filter(|t| t.parameter == parameter).collect();
    let Some(factor) = effect.parameters.get(parameter).map(|p| p.factor) else {
        return Meaning::Nothing("the effect has no such parameter".to_owned());
    };
    if terms.is_empty() {
        return Meaning::Nothing("it shapes the other parameters of its effect".to_owned());
    }
    if let Some(spots) = terms.iter().map(|t| location(effect, t, factor, machine)).collect() {
        return Meaning::Location(spots);
    }
    if let [term] = terms.as_slice()
        && let (At::Tool, 2, Some(k)) = (term.place, term.component, term.formula.constant())
    {
        // dz of the tool's frame points from the ball to the spindle
        return Meaning::ToolLength(-k * factor);
    }
    let mut axes = terms.iter().map(|t| own_position(effect, t, machine));
    match axes.next() {
        Some(Ok(first)) => match axes.find(|a| *a != Ok(first)) {
            None => Meaning::Position(first),
            Some(Ok(_)) => Meaning::Nothing("it moves several axes at once".to_owned()),
            Some(Err(why)) => Meaning::Nothing(why),
        },
        Some(Err(why)) => Meaning::Nothing(why),
        None => Meaning::Nothing("it moves nothing".to_owned()),
    }
}

/// Does this component lie along (about) the axis's direction? +1 or -1 when it does.
#[must_use]
pub fn along(axis: &Axis, dof: Dof) -> Option<f64> {
    let share = axis.direction[dof.index() % 3];
    ((share.abs() - 1.0).abs() < 1e-9).then_some(share.signum())
}

fn location(effect: &Effect, term: &Term, factor: f64, machine: &Machine) -> Option<(Spot, f64)> {
    let (name, place) = match term.place {
        At::Before(name) => (name, Place::Before),
        At::After(name) => (name, Place::After),
        _ => return None,
    };
    let axis = machine.axis(name).filter(|a| a.name.is_rotary())?;
    let dof = *Dof::ALL.get(term.component)?;
    let amount = term.formula.constant()? * factor;
    let amount = if dof.is_angle() { deg_from_rad(amount) } else { amount };
    match stated(machine, effect, term) {
        Stated::OwnLine if term.component == own_turn(name) => {
            Some((Spot { axis: name, place: Place::Zero, dof }, direction_sign(axis) * amount))
        }
        // a tilt about a point of the line, or an offset along a direction that is not one of R, is no location error
        Stated::OwnLine if dof.is_angle() || along(axis, Dof::ALL[own_turn(name)]).is_none() => None,
        _ => Some((Spot { axis: name, place, dof }, amount)),
    }
}

/// Is it a turn of a rotary axis about its own line? A table's is one only where it is stated there; in the head a turn
/// about the axis's direction before its motion is the same.
#[must_use]
pub fn turns_about_itself(machine: &Machine, spot: Spot) -> bool {
    let Some(axis) = machine.axis(spot.axis) else { return false };
    match spot.place {
        Place::Zero => true,
        Place::Before => axis.side == Side::Tool && spot.dof.is_angle() && along(axis, spot.dof).is_some(),
        Place::After => false,
    }
}

/// The linear axis that can take an error out which depends on the position of one axis only: (input, output).
///
/// The displacement must lie along a linear axis whatever the other axes do: no rotary axis may stand between the base and
/// its place.
#[must_use]
pub fn across(effect: &Effect, parameter: usize, machine: &Machine) -> Option<(AxisName, AxisName)> {
    let terms: Vec<&Term> = effect.terms.iter().filter(|t| t.parameter == parameter).collect();
    let [term] = terms.as_slice() else { return None };
    let (name, behind) = match term.place {
        At::Before(name) => (name, false),
        At::After(name) => (name, true),
        _ => return None,
    };
    let axis = machine.axis(name)?;
    let mut inner = machine.side(axis.side).take_while(|a| a.name != name);
    if inner.any(|a| a.name.is_rotary()) || (behind && name.is_rotary()) || Dof::ALL.get(term.component)?.is_angle() {
        return None;
    }
    let output = AxisName::ALL[term.component];
    along(machine.axis(output)?, Dof::ALL[term.component])?;
    let inputs: Vec<AxisName> = term
        .formula
        .variables()
        .into_iter()
        .map(|v| AxisName::from_letter(v.chars().last()?).filter(|a| v == a.to_string() || v == format!("s{a}")))
        .collect::<Option<Vec<_>>>()?;
    let first = *inputs.first()?;
    (inputs.iter().all(|i| *i == first) && machine.axis(first).is_some()).then_some((first, output))
}

/// The axis whose own position a term is an error of, or why it is none.
fn own_position(effect: &Effect, term: &Term, machine: &Machine) -> Result<AxisName, String> {
    let name = match term.place {
        At::Before(name) | At::After(name) => name,
        At::Reading => *AxisName::ALL.get(term.component).ok_or("it is read on no axis")?,
        _ => return Err("it is no error of an axis".to_owned()),
    };
    let axis = machine.axis(name).ok_or_else(|| format!("the machine has no axis {name}"))?;
    if term.place != At::Reading {
        let dof = Dof::ALL.get(term.component).copied().ok_or("it has no direction")?;
        let about_itself = stated(machine, effect, term) == Stated::OwnLine && term.component == own_turn(name);
        let own = if name.is_rotary() { about_itself } else { !dof.is_angle() && along(axis, dof).is_some() };
        if !own {
            return Err(format!("it moves {name} in {dof}, across its own motion"));
        }
    }
    let (own, sense) = (name.to_string(), format!("s{name}"));
    if term.formula.constant().is_some() {
        return Err(format!("a constant of {name} is a matter of its zero or of the work offset"));
    }
    match term.formula.variables().into_iter().find(|v| *v != own && *v != sense) {
        Some(other) => Err(format!("it depends on {other}, an axis table only on {own} and its sense")),
        None => Ok(name),
    }
}

/// How much further an axis stands than it shows, from the value of a term of [`Meaning::Position`] (mm or rad, a
/// displacement in R): mm or rad of its coordinate.
#[must_use]
pub fn coordinate_off(term: &Term, axis: &Axis, displacement: f64) -> f64 {
    if term.place == At::Reading {
        return displacement;
    }
    let sign = Dof::ALL.get(term.component).and_then(|dof| along(axis, *dof)).unwrap_or(1.0);
    match (axis.name.is_rotary(), axis.side) {
        (true, _) => direction_sign(axis) * axis.sense * displacement,
        // a table that stands further in R has the tool less far over the workpiece
        (false, Side::Workpiece) => -sign * displacement,
        (false, Side::Tool) => sign * displacement,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diag::source;
    use crate::model::catalogue::Catalogue;

    fn machine(name: &str) -> Machine {
        let (machines, _) = crate::machine::load(&source("m", crate::machine::BUILT_IN)).unwrap();
        machines.into_iter().find(|m| m.name == name).unwrap()
    }

    fn says(catalogue: &Catalogue, machine: &Machine, effect: &str, parameter: &str) -> String {
        let effect = catalogue.get(effect, machine).unwrap();
        let index = effect.parameters.iter().position(|p| p.name == parameter).unwrap();
        match meaning(effect, index, machine) {
            Meaning::Location(spots) => {
                let each: Vec<String> =
                    spots.iter().map(|(s, k)| format!("{} {} {} {k:.3}", s.axis, s.place, s.dof)).collect();
                each.join(", ")
            }
            Meaning::Nothing(why) => why,
            other => format!("{other:?}"),
        }
    }

    #[test]
    fn the_place_of_built_in_effects_is_that_of_formats_md() {
        let (catalogue, head) = (Catalogue::built_in().unwrap(), machine("swivel-head"));
        let at = |effect, name| says(&catalogue, &head, effect, name);
        assert_eq!(at("paper-head", "EX0B"), "B before dx 1.000");
        assert_eq!(at("paper-head", "EB0B"), "B before ry 1.000");
        assert_eq!(at("location-b", "EX0B"), "B after dx 1.000");
        assert_eq!(at("location-b", "EA0B"), "B before rx 1.000");
        assert_eq!(at("location-c", "EX0C"), "C before dx 1.000");
        assert_eq!(at("zero-b", "EB0B"), "B zero ry 1.000");
        assert_eq!(at("tool-length", "dL"), "ToolLength(1.0)");
        assert_eq!(at("block-setup", "SX"), "Measurement");
        assert_eq!(at("pretravel", "pretravel"), "Measurement");
        let table = machine("trunnion");
        assert_eq!(says(&catalogue, &table, "location-a", "EZ0A"), "A before dz 1.000");
        let double = machine("double-head");
        assert_eq!(says(&catalogue, &double, "paper-double-head", "EX0A"), "A before dx 1.000");
    }

    #[test]
    fn a_user_s_effect_means_what_its_places_and_formulas_say() {
        let file = r#"
[[effect]]
id = "my-tilt"
at = "B"
terms = [ { parameter = "tilt", unit = "urad", dof = "rx", formula = "1" } ]
[[effect]]
id = "my-screw"
at = "X"
terms = [ { parameter = "k", unit = "um/m", dof = "dx", formula = "X" } ]
[[effect]]
id = "my-bend"
at = "X"
terms = [ { parameter = "k", unit = "um/m", dof = "dy", formula = "X" } ]
[[effect]]
id = "my-growth"
at = "X"
terms = [ { parameter = "k", unit = "um/h", dof = "dx", formula = "t" } ]
"#;
        let mut catalogue = Catalogue::built_in().unwrap();
        catalogue.add_file(&source("my-effects.toml", file)).unwrap();
        let head = machine("swivel-head");
        let at = |effect, name| says(&catalogue, &head, effect, name);
        assert!(at("my-tilt", "tilt").starts_with("B before rx 0.000"));
        assert_eq!(at("my-screw", "k"), "Position(X)");
        assert_eq!(at("my-bend", "k"), "it moves X in dy, across its own motion");
        assert_eq!(at("my-growth", "k"), "it depends on t, an axis table only on X and its sense");
    }
}
