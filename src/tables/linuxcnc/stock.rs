//! What LinuxCNC carries without a component of its own: the pins of its two tilting-table kinematics, and home offsets.
//!
//! `xyzac-trt-kins` (table A carries table C) and `xyzbc-trt-kins` (B carries C) map joints j to world coordinates w by
//!
//! ```text
//! w = P + Rz(-C) ( D + Rt(-T) ( j - P - D ) )        P = (x, y, z)-rot-point, D = (x, y, z)-offset, z with tool-offset
//! ```
//!
//! with the tilting axis T = A about X or B about Y (`trtfuncs.c`; a test drives the installed modules and compares).
//! So the table turns right-handed for positive angles (newer versions have a pin that turns both angles round, with P and D as
//! they are: [`Release`]), C about the vertical through P, T about the line through P + D;
//! D's component along T does not act, and of z only the sum z-rot-point + z-offset + tool-offset does.
//! World and joints are equal at T = C = 0 whatever the pins say.
//!
//! A machine whose T and C stand off by dT and dC (before their rotations) is exactly such a mapping: P = pC + dT + dC,
//! P + D = pT + dT, and the workpiece stands at dT + dC. No pin takes a tilt.

use crate::axes::AxisName;
use crate::machine::{Axis, Machine, Side};
use crate::post::Release;
use crate::tables::compensation::Term;
use crate::tables::correction::{Correction, rounded};
use crate::tables::place::{Place, Spot, along, turns_about_itself};
use crate::tables::restate::stated_at;
use nalgebra::Vector3;
use std::collections::BTreeMap;

/// A stock kinematics module that knows the machine's chain.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Module {
    /// Name of the module, and of its pins.
    pub name: &'static str,
    pub tilting: AxisName,
    /// What its direction pin must be: 1 (true) where positive angles turn the table left-handed. `None`: this version has none.
    pub conventional: Option<bool>,
}

/// What the offsets of the two axes amount to.
#[derive(Debug, Clone, PartialEq)]
pub struct Pins {
    /// Pin name without the module's, value in mm.
    pub pins: BTreeMap<String, f64>,
    /// How far the workpiece's zero stands off the nominal one in world coordinates, mm.
    pub workpiece_shift_mm: [f64; 3],
}

/// Modules and the tilting axis of each.
const MODULES: [(&str, AxisName); 2] = [("xyzac-trt-kins", AxisName::A), ("xyzbc-trt-kins", AxisName::B)];

/// The module of this version that describes the machine.
///
/// # Errors
/// The reason, in words for the person, when none does.
pub fn module_of(machine: &Machine, release: &Release) -> Result<Module, String> {
    let rotary: Vec<&Axis> = machine.rotary().collect();
    let [tilting, turning] = rotary.as_slice() else {
        return Err(format!("the machine has {} rotary axes, the modules know two", rotary.len()));
    };
    if tilting.side == Side::Tool || turning.side == Side::Tool {
        return Err("a rotary axis is in the head; the modules know two rotary axes in the table".to_owned());
    }
    let known = |(_, of): &(&str, AxisName)| *of == tilting.name && turning.name == AxisName::C;
    let Some((name, tilts)) = MODULES.into_iter().find(known) else {
        return Err(format!(
            "{} carries {}; the modules know A that carries C and B that carries C",
            tilting.name, turning.name
        ));
    };
    let first_rotary = machine.side(Side::Workpiece).position(|a| a.name.is_rotary());
    let last_linear =
        machine.side(Side::Workpiece).enumerate().filter(|(_, a)| !a.name.is_rotary()).map(|(i, _)| i).last();
    if last_linear > first_rotary {
        return Err("a rotary axis carries a linear one; the modules know it the other way round".to_owned());
    }
    if !release.pins.contains_key(name) {
        return Err(format!("{} has no module {name} whose pins are known here", release.says));
    }
    // axes that turn the table left-handed for positive angles
    let mut left_handed: Vec<AxisName> = Vec::new();
    for axis in &machine.axes {
        let nominal = unit(axis.name.index() % 3);
        let sense = if axis.name.is_rotary() { axis.sense } else { 1.0 };
        let along = axis.direction.dot(&nominal) * sense;
        if (along + 1.0).abs() < 1e-9 && axis.name.is_rotary() {
            left_handed.push(axis.name);
        } else if (along - 1.0).abs() > 1e-9 {
            return Err(format!("axis {} is not along a coordinate of the machine, as the modules assume", axis.name));
        }
        let origin = machine.origin.get(axis.name).unwrap_or(0.0);
        if axis.name.is_rotary() && origin != 0.0 {
            return Err(format!("the level table stands at {} {origin}, the modules assume 0", axis.name));
        }
    }
    if (machine.tool.direction.dot(&Vector3::z()) - 1.0).abs() > 1e-9 {
        return Err("the spindle is not along Z, as the modules assume".to_owned());
    }
    let conventional = match (&release.direction_pin, left_handed.as_slice()) {
        (None, [axis, ..]) => {
            return Err(format!(
                "positive {axis} turns the table the other way than the module does (right-handed about +{}), and {} has no pin \
                 for that",
                ["X", "Y", "Z"][axis.index() % 3],
                release.says
            ));
        }
        (Some(pin), [axis]) => {
            return Err(format!(
                "positive {axis} turns the table left-handed, the other rotary axis right-handed: {pin} turns both round or none"
            ));
        }
        (None, []) => None,
        (Some(_), all) => Some(!all.is_empty()),
    };
    Ok(Module { name, tilting: tilts, conventional })
}

fn unit(component: usize) -> Vector3<f64> {
    let mut v = Vector3::zeros();
    v[component] = 1.0;
    v
}

/// The terms of a correction stated where the workpiece is: without tilts an offset is right at one height only, so it
/// is taken at the block's (`ball` of the machine's reference points); with the places that stay as they were.
#[must_use]
pub fn terms_at_the_workpiece(machine: &Machine, correction: &Correction) -> (Vec<Term>, [f64; 3], Vec<Spot>) {
    let point: [f64; 3] = machine.reference.ball.into();
    let (terms, kept) = stated_at(machine, correction, point);
    (terms, point, kept)
}

/// Offset of an axis before its rotation, mm.
fn offset(terms: &[Term], axis: AxisName) -> Vector3<f64> {
    let mut d = Vector3::zeros();
    for term in terms.iter().filter(|t| t.axis == axis && t.place == Place::Before && !t.dof.is_angle()) {
        d[term.dof.index()] += term.value;
    }
    d
}

/// Can the module's pins hold this term?
#[must_use]
pub fn pins_carry(module: Module, term: &Term) -> bool {
    let of_the_table = term.axis == module.tilting || term.axis == AxisName::C;
    of_the_table && term.place == Place::Before && !term.dof.is_angle()
}

/// Is this term a turn of an axis about itself, which its home offset holds?
#[must_use]
pub fn home_offset_carries(machine: &Machine, term: &Term) -> bool {
    turns_about_itself(machine, term.spot())
}

/// The pins of a module for the machine with the offsets of `terms`.
///
/// The joint coordinate of Z is that of the spindle's pivot, so `tool-offset` is the length from the pivot to the tip.
#[must_use]
pub fn pins(machine: &Machine, module: Module, terms: &[Term]) -> Pins {
    let point = |axis: AxisName| machine.axis(axis).map_or_else(Vector3::zeros, |a| a.point);
    let origin = Vector3::from([AxisName::X, AxisName::Y, AxisName::Z].map(|a| machine.origin.get(a).unwrap_or(0.0)))
        - machine.tool.pivot;
    let (d_tilting, d_turning) = (offset(terms, module.tilting), offset(terms, AxisName::C));
    let tilting = point(module.tilting) + d_tilting + origin;
    let turning = point(AxisName::C) + d_tilting + d_turning + origin;
    // across T, in the table's plane: y for A, x for B
    let across = if module.tilting == AxisName::A { 1 } else { 0 };
    let mut d = Vector3::zeros();
    d[across] = tilting[across] - turning[across];
    let named = [
        ("x-rot-point", turning.x),
        ("y-rot-point", turning.y),
        ("z-rot-point", tilting.z),
        ("x-offset", d.x),
        ("y-offset", d.y),
        ("z-offset", 0.0),
        ("tool-offset", machine.tool.length_mm),
    ];
    Pins {
        pins: named.into_iter().map(|(name, value)| (name.to_owned(), rounded(value))).collect(),
        workpiece_shift_mm: (d_tilting + d_turning).map(rounded).into(),
    }
}

/// What each rotary axis's home offset must grow by: a joint that stands e further than it shows is told that it stands
/// there, deg.
#[must_use]
pub fn home_offsets(machine: &Machine, terms: &[Term]) -> BTreeMap<AxisName, f64> {
    let mut offsets = BTreeMap::new();
    for term in terms.iter().filter(|t| home_offset_carries(machine, t) && t.value != 0.0) {
        let Some(axis) = machine.axis(term.axis) else { continue };
        // a zero error is about the axis's direction, a location error about R's axis
        let sign = if term.place == Place::Zero { 1.0 } else { along(axis, term.dof).unwrap_or(1.0) };
        *offsets.entry(axis.name).or_insert(0.0) += sign * axis.sense * term.value;
    }
    offsets.into_iter().map(|(axis, deg)| (axis, rounded(deg))).collect()
}

/// Why the stock means do not carry a term, or `None` when they do.
#[must_use]
pub fn why_not(machine: &Machine, module: &Result<Module, String>, term: &Term) -> Option<String> {
    if home_offset_carries(machine, term) {
        return None;
    }
    match module {
        Ok(module) if pins_carry(*module, term) => None,
        Ok(module) => Some(match (term.dof.is_angle(), term.place) {
            (true, _) => format!("{} has no pin for a tilt", module.name),
            (false, place) => format!("{} has no pin for an offset {place} the rotation of {}", module.name, term.axis),
        }),
        Err(_) => Some("no stock kinematics module describes this machine".to_owned()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diag::source;
    use crate::tables::place::Dof;

    fn machine(name: &str) -> Machine {
        let (machines, _) = crate::machine::load(&source("m", crate::machine::BUILT_IN)).unwrap();
        machines.into_iter().find(|m| m.name == name).unwrap()
    }

    fn term(axis: AxisName, place: Place, dof: Dof, value: f64) -> Term {
        Term {
            axis,
            place,
            dof,
            value,
            unit: dof.unit().to_owned(),
            parameter: String::new(),
            effect: String::new(),
            active_before: 0.0,
            identified: value,
            sigma: None,
        }
    }

    fn release(name: &str) -> Release {
        let (post, _) = crate::post::Postprocessor::load_built_in_or_file("linuxcnc").unwrap();
        post.release(Some(name)).unwrap().clone()
    }

    fn module_of(machine: &Machine) -> Result<Module, String> {
        super::module_of(machine, &release("2.9"))
    }

    /// One pin turns both angles round: both axes left-handed, or none.
    #[test]
    fn the_direction_pin_follows_the_machine() {
        let with = |a: f64, c: f64| {
            let mut machine = machine("trunnion");
            for axis in machine.axes.iter_mut().filter(|x| x.name.is_rotary()) {
                axis.sense = if axis.name == AxisName::C { c } else { a };
            }
            machine
        };
        let master = release("master");
        let pin = |a, c| super::module_of(&with(a, c), &master).map(|m| m.conventional);
        assert_eq!((pin(1.0, 1.0), pin(-1.0, -1.0)), (Ok(Some(false)), Ok(Some(true))));
        assert!(pin(1.0, -1.0).unwrap_err().contains("both round"));
        assert_eq!(module_of(&with(1.0, 1.0)).unwrap().conventional, None);
        assert!(module_of(&with(-1.0, -1.0)).is_err());
        // a version that lacks the module
        let without = Release { pins: BTreeMap::new(), ..master.clone() };
        assert!(super::module_of(&with(1.0, 1.0), &without).is_err());
    }

    #[test]
    fn the_two_tables_are_known_and_the_heads_are_not() {
        assert_eq!(module_of(&machine("trunnion")).unwrap().name, "xyzac-trt-kins");
        assert_eq!(module_of(&machine("swivel-table-b")).unwrap().name, "xyzbc-trt-kins");
        assert!(module_of(&machine("swivel-head")).unwrap_err().contains("in the head"));
        assert!(module_of(&machine("double-head")).unwrap_err().contains("in the head"));
        assert!(module_of(&machine("nutating-b")).unwrap_err().contains("axis B is not along"));
        assert!(
            module_of(&machine("trunnion-offset")).unwrap_err().contains("positive C turns the table the other way")
        );
        let mut other_way = machine("trunnion");
        for axis in &mut other_way.axes {
            if axis.name == AxisName::C {
                axis.sense = -1.0;
            }
        }
        assert!(module_of(&other_way).unwrap_err().contains("positive C turns the table the other way"));
    }

    /// By hand, for the trunnion: axes through (0, 0, -250), pivot at the origin, ball 202.684 below it. A stands off by
    /// (0.01, 0.02, 0.03), C by (0.001, 0.002, 0).
    #[test]
    fn pins_by_hand() {
        let machine = machine("trunnion");
        let terms = [
            term(AxisName::A, Place::Before, Dof::Dx, 0.01),
            term(AxisName::A, Place::Before, Dof::Dy, 0.02),
            term(AxisName::A, Place::Before, Dof::Dz, 0.03),
            term(AxisName::C, Place::Before, Dof::Dx, 0.001),
            term(AxisName::C, Place::Before, Dof::Dy, 0.002),
        ];
        let found = pins(&machine, module_of(&machine).unwrap(), &terms);
        let pin = |name: &str| found.pins[name];
        assert_eq!(pin("x-rot-point"), 0.011);
        assert_eq!(pin("y-rot-point"), 0.022);
        assert_eq!(pin("z-rot-point"), -249.97);
        assert_eq!(pin("y-offset"), -0.002);
        assert_eq!((pin("x-offset"), pin("z-offset"), pin("tool-offset")), (0.0, 0.0, 202.684));
        assert_eq!(found.workpiece_shift_mm, [0.011, 0.022, 0.0 + 0.03]);
    }

    /// A joint that homes to 0 but stands at +0.05 is told that it homed to +0.05. With a sense of -1 a right-handed turn
    /// of the axis is a smaller coordinate.
    #[test]
    fn a_home_offset_grows_by_where_the_axis_stands() {
        let mut machine = machine("trunnion");
        let terms = [term(AxisName::C, Place::Zero, Dof::Rz, 0.05), term(AxisName::A, Place::Zero, Dof::Rx, -0.02)];
        let found = home_offsets(&machine, &terms);
        assert_eq!((found[&AxisName::C], found[&AxisName::A]), (0.05, -0.02));
        for axis in &mut machine.axes {
            axis.sense = -1.0;
        }
        assert_eq!(home_offsets(&machine, &terms)[&AxisName::C], -0.05);
    }

    #[test]
    fn what_is_not_carried_has_its_reason() {
        let trunnion = machine("trunnion");
        let module = module_of(&trunnion);
        let carried = |t: &Term| why_not(&trunnion, &module, t);
        assert_eq!(carried(&term(AxisName::C, Place::Before, Dof::Dx, 0.1)), None);
        assert_eq!(carried(&term(AxisName::C, Place::Zero, Dof::Rz, 0.1)), None);
        // a turn of a table stated at the reference point is none about its own line
        assert!(carried(&term(AxisName::C, Place::Before, Dof::Rz, 0.1)).is_some());
        assert!(carried(&term(AxisName::C, Place::Before, Dof::Rx, 0.1)).unwrap().contains("no pin for a tilt"));
        let head = machine("swivel-head");
        let module = module_of(&head);
        assert!(
            why_not(&head, &module, &term(AxisName::B, Place::After, Dof::Dx, 0.1))
                .unwrap()
                .contains("no stock kinematics")
        );
    }
}
