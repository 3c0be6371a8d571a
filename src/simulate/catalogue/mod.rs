//! What can be planted in the virtual machine: effects with their parameters, each as a place of the chain and a
//! function of the state.
//!
//! The physics is written down here once more, apart from the catalogue that the fit uses: that the two agree is a test.

pub mod axes;
mod body;
mod location;
mod probe;
mod thermal;
pub mod unit;

use super::terms::{Shape, Target};
use crate::axes::AxisName;
use crate::machine::{Machine, Side};
use unit::Unit;

/// A parameter of an effect.
#[derive(Debug, Clone)]
pub struct Parameter {
    /// Its name: an ISO 230 symbol where there is one.
    pub name: String,
    /// Other names that are understood.
    pub aliases: Vec<String>,
    /// Unit of a bare number.
    pub unit: Unit,
    pub role: Role,
}

/// What a parameter does.
#[derive(Debug, Clone)]
pub enum Role {
    /// Its value times each factor (in the unit's base: mm, rad, hours …) acts at each target with each shape.
    Amount(Vec<(Target, Shape, f64)>),
    /// A constant inside the shapes, with what is taken when it is not given.
    Setting {
        /// A time, a pitch: only more than 0 makes sense.
        positive: bool,
    },
}

impl Parameter {
    fn new(name: impl Into<String>, unit: Unit, acts: impl IntoIterator<Item = (Target, Shape, f64)>) -> Self {
        let role = Role::Amount(acts.into_iter().collect());
        Self { name: name.into(), aliases: Vec::new(), unit, role }
    }

    /// One that acts at one place.
    fn at(name: impl Into<String>, unit: Unit, target: Target, shape: Shape) -> Self {
        Self::new(name, unit, [(target, shape, 1.0)])
    }

    fn setting(name: &str, unit: Unit) -> Self {
        Self { name: name.to_owned(), aliases: Vec::new(), unit, role: Role::Setting { positive: true } }
    }

    /// A place: on either side of nothing.
    fn signed_setting(name: &str, unit: Unit) -> Self {
        Self { role: Role::Setting { positive: false }, ..Self::setting(name, unit) }
    }

    fn alias(mut self, name: impl Into<String>) -> Self {
        self.aliases.push(name.into());
        self
    }

    /// Is this one of its names? Case, underscores and the letter O for zero do not matter.
    pub fn is_called(&self, name: &str) -> bool {
        let wanted = plain(name);
        std::iter::once(&self.name).chain(&self.aliases).any(|n| plain(n) == wanted)
    }
}

/// A name without what does not distinguish names.
fn plain(name: &str) -> String {
    let kept = name.chars().filter(|c| !matches!(c, '_' | '-' | ' '));
    kept.flat_map(char::to_lowercase).map(|c| if c == 'o' { '0' } else { c }).collect()
}

/// Why an effect cannot be planted.
#[derive(Debug, Clone, PartialEq)]
pub enum Refusal {
    /// No effect has this id.
    Unknown,
    /// It makes no sense here; says why.
    NotHere(String),
}

/// Constants inside the shapes of an effect, as far as they are given.
pub type Settings<'a> = &'a dyn Fn(&str) -> Option<f64>;

/// The parameters of an effect on a machine.
pub fn parameters(id: &str, machine: &Machine, settings: Settings<'_>) -> Result<Vec<Parameter>, Refusal> {
    let families = [location::parameters, axes::parameters, probe::parameters, body::parameters, thermal::parameters];
    for family in families {
        match family(id, machine, settings) {
            Err(Refusal::Unknown) => {}
            answer => return answer,
        }
    }
    Err(Refusal::Unknown)
}

/// Has an effect values for each block? Their names end in `@mounting/block`, or `@block`.
fn is_of_blocks(id: &str) -> bool {
    matches!(id, "block-own-size" | "sphere-diameter" | "cylinder-diameter")
}

/// The name of a parameter, and the block that it is of.
pub fn name_and_block<'a>(id: &str, name: &'a str) -> (&'a str, Option<&'a str>) {
    match name.split_once('@').filter(|_| is_of_blocks(id)) {
        Some((name, block)) => (name, Some(block)),
        None => (name, None),
    }
}

/// What a bare number means for a constant inside the shapes, where that is not what the shapes count in.
pub fn unit_of_setting(name: &str) -> Option<Unit> {
    name.starts_with("windup_way").then_some(Unit::Deg)
}

/// All ids that can be planted in a machine.
pub fn ids(machine: &Machine) -> Vec<String> {
    all(machine).filter(|id| parameters(id, machine, &|_| Some(1.0)).is_ok()).collect()
}

/// Effects that say where a body stands: each has a place of its own, which a scenario gives in `[[block]]`.
const SET_UPS: [&str; 5] = ["block-setup", "sphere-setup", "cylinder-setup", "cylinder-height", "plane-setup"];

/// Is this the id of an effect that says where a body stands?
pub fn is_a_set_up(id: &str) -> bool {
    SET_UPS.contains(&id)
}

/// Is this the id of an effect that some machine can have?
pub fn is_known(id: &str, machine: &Machine) -> bool {
    is_a_set_up(id) || all(machine).any(|known| known == id)
}

fn all(machine: &Machine) -> impl Iterator<Item = String> {
    [location::ids, axes::ids, probe::ids, body::ids, thermal::ids].into_iter().flat_map(|family| family(machine))
}

/// `name-b` → the axis B of the machine, when the id begins so.
fn axis_of<'a>(
    id: &str,
    prefix: &str,
    machine: &'a Machine,
) -> Option<Result<(&'a crate::machine::Axis, AxisName), Refusal>> {
    let mut letters = id.strip_prefix(prefix)?.strip_prefix('-')?.chars();
    let (letter, None) = (letters.next()?, letters.next()) else { return None };
    if letter.is_ascii_uppercase() {
        return None;
    }
    let name = AxisName::from_letter(letter)?;
    Some(axis_here(name, machine).map(|a| (a, name)))
}

fn axis_here(name: AxisName, machine: &Machine) -> Result<&crate::machine::Axis, Refusal> {
    machine.axis(name).ok_or_else(|| Refusal::NotHere(format!("machine {:?} has no axis {name}", machine.name)))
}

fn must_stand_on(name: AxisName, side: Side, machine: &Machine) -> Result<(), Refusal> {
    if axis_here(name, machine)?.side == side {
        return Ok(());
    }
    let word = if side == Side::Tool { "tool" } else { "workpiece" };
    Err(Refusal::NotHere(format!("axis {name} of {:?} does not stand on the {word} side", machine.name)))
}

/// Letter of a component in ISO symbols: X Y Z for displacements, A B C for turns.
fn dof_letter(dof: usize) -> char {
    AxisName::ALL.get(dof).map_or('?', |a| a.letter())
}

/// 0, 1, 2 for an axis along or about x, y, z.
fn along(axis: AxisName) -> usize {
    axis.index() % 3
}

/// The two components across an axis.
fn across(axis: AxisName) -> impl Iterator<Item = usize> {
    (0..3).filter(move |&i| i != along(axis))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diag::source;

    #[test]
    fn names_are_understood_in_every_spelling() {
        let p = Parameter::at("EX0B", Unit::Mm, Target::Late, Shape::Constant).alias("d_xBZ");
        for name in ["EX0B", "EXOB", "exob", "E_X0B", "d_xBZ", "dxBZ", "DXBZ"] {
            assert!(p.is_called(name), "{name}");
        }
        assert!(!p.is_called("EY0B"));
    }

    #[test]
    fn every_id_has_parameters_with_names_of_their_own() {
        let (machines, _) = crate::machine::load(&source("built in", crate::machine::BUILT_IN)).unwrap();
        for machine in &machines {
            let ids = ids(machine);
            assert!(ids.len() > 60, "{}: {}", machine.name, ids.len());
            for id in ids {
                let rows = parameters(&id, machine, &|_| None);
                let rows = rows.or_else(|_| parameters(&id, machine, &|_| Some(1.0))).unwrap();
                assert!(!rows.is_empty(), "{id}");
                for (i, a) in rows.iter().enumerate() {
                    assert!(rows[..i].iter().all(|b| !b.is_called(&a.name)), "{id} {}", a.name);
                }
            }
        }
    }
}
