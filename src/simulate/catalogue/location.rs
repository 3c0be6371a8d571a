//! Constant errors of place and direction: location of rotary axes, their zeros, the paper's sets, the tool's length.

use super::unit::Unit::{Deg, Mm};
use super::{Parameter, Refusal, Settings, across, along, axis_of, dof_letter, must_stand_on};
use crate::axes::AxisName;
use crate::machine::{Machine, Side};
use crate::simulate::terms::{Shape, Target};

/// Ids of this family.
pub fn ids(_: &Machine) -> Vec<String> {
    let fixed = ["paper-head", "paper-table", "paper-double-head", "double-head-10", "tool-length"];
    let letters = ["location-a", "location-b", "location-c", "zero-a", "zero-b", "zero-c"];
    fixed.into_iter().chain(letters).map(str::to_owned).collect()
}

/// Parameters of an id of this family.
pub fn parameters(id: &str, machine: &Machine, _: Settings<'_>) -> Result<Vec<Parameter>, Refusal> {
    if let Some(found) = axis_of(id, "location", machine) {
        let (axis, name) = found?;
        return location(name, axis.side);
    }
    if let Some(found) = axis_of(id, "zero", machine) {
        let (_, name) = found?;
        must_be_rotary(name)?;
        // the axis stands further round its own line than it shows
        let dof = along(name) + 3;
        let bare = format!("{}0{name}", dof_letter(dof));
        let target = Target::OwnLine { axis: name, after: false, dof };
        return Ok(vec![Parameter::at(format!("E{bare}"), Deg, target, Shape::Constant).alias(bare)]);
    }
    let head = AxisName::B;
    match id {
        "tool-length" => {
            let row = Parameter::at("dL", Mm, Target::Length, Shape::Constant).alias("tool_length");
            Ok(vec![row])
        }
        "paper-head" => {
            must_stand_on(head, Side::Tool, machine)?;
            Ok(paper(head, "BZ", &[3, 4, 5, 0, 1]))
        }
        "paper-table" => {
            must_stand_on(AxisName::C, Side::Workpiece, machine)?;
            Ok(paper(AxisName::C, "CY", &[3, 4, 0, 1]))
        }
        "paper-double-head" | "double-head-10" => {
            must_stand_on(head, Side::Tool, machine)?;
            must_stand_on(AxisName::A, Side::Tool, machine)?;
            let mut rows = paper(head, "BZ", &[3, 4, 5, 0, 1, 2]);
            let of_a: &[usize] = if id == "double-head-10" { &[3, 5, 0, 2] } else { &[3, 0] };
            rows.extend(paper(AxisName::A, "BA", of_a));
            Ok(rows)
        }
        _ => Err(Refusal::Unknown),
    }
}

fn must_be_rotary(name: AxisName) -> Result<(), Refusal> {
    if name.is_rotary() { Ok(()) } else { Err(Refusal::Unknown) }
}

/// Two offsets across the axis and two tilts. In the head the offsets turn with the axis (they stand after its motion):
/// there they cannot be mistaken for a shift of the blocks.
fn location(axis: AxisName, side: Side) -> Result<Vec<Parameter>, Refusal> {
    must_be_rotary(axis)?;
    let offsets = across(axis).map(|d| iso(axis, d, side == Side::Tool));
    let tilts = across(axis).map(|d| iso(axis, d + 3, false));
    Ok(offsets.chain(tilts).collect())
}

/// The location error of an axis under its ISO 230-7 symbol.
fn iso(axis: AxisName, dof: usize, after: bool) -> Parameter {
    let unit = if dof < 3 { Mm } else { Deg };
    let bare = format!("{}0{axis}", dof_letter(dof));
    Parameter::at(format!("E{bare}"), unit, Target::Axis { axis, after, dof }, Shape::Constant).alias(bare)
}

/// The paper's set of an axis: all errors before its motion, under the paper's symbols too.
fn paper(axis: AxisName, suffix: &str, dofs: &[usize]) -> Vec<Parameter> {
    let symbols = ["d_x", "d_y", "d_z", "a_", "b_", "g_"];
    dofs.iter().map(|&dof| iso(axis, dof, false).alias(format!("{}{suffix}", symbols[dof]))).collect()
}
