//! What weight does to head and table, and what is wrong with the artefact.

use super::axes::{SPAN_MM, about_a_point};
use super::unit::Unit::{H, One, PpmPerK, Um, Urad};
use super::{Parameter, Refusal, Settings, along, dof_letter};
use crate::axes::AxisName;
use crate::machine::{Machine, Side};
use crate::simulate::terms::{Shape, Target};

/// Ids of this family.
pub fn ids(_: &Machine) -> Vec<String> {
    let weight = ["head-sag", "head-tilt", "table-sag", "table-load"];
    let artefact = ["block-size", "block-own-size", "block-shape", "block-slip", "block-temperature"];
    let round = ["sphere-diameter", "cylinder-diameter", "sphere-form-2", "sphere-form-3", "stem-bending", "stem-sag"];
    weight.into_iter().chain(artefact).chain(round).map(str::to_owned).collect()
}

/// Parameters of an id of this family.
pub fn parameters(id: &str, machine: &Machine, settings: Settings<'_>) -> Result<Vec<Parameter>, Refusal> {
    match id {
        // a head that hangs out sinks, to whichever side it leans
        "head-sag" => {
            tilting_head(machine)?;
            let acts = [(Target::BallInMachine(2), Shape::Tilt, -1.0)];
            Ok(vec![Parameter::new("head_sag", Um, acts).alias("k").alias("sag")])
        }
        // and its weight turns it further about its own axis, or about a point above that, with what carries it
        "head-tilt" => {
            let axis = tilting_head(machine)?;
            let target = Target::OwnLine { axis, after: false, dof: along(axis) + 3 };
            let name = format!("E{}{axis}s", dof_letter(along(axis) + 3));
            let turn = Parameter::at(name, Urad, target, Shape::Sine(axis, 1.0)).alias("head_tilt").alias("k");
            Ok(about_a_point(vec![turn], id, 2, settings))
        }
        "table-sag" => table_sag(machine),
        "table-load" => table_load(machine),
        "block-size" => Ok((0..3).map(size).collect()),
        "block-own-size" => Ok((0..3).map(own_size).collect()),
        "sphere-diameter" => Ok(diameter(Target::SphereRadius)),
        "cylinder-diameter" => Ok(diameter(Target::CylinderRadius)),
        "sphere-form-2" => Ok(form_error(2)),
        "sphere-form-3" => Ok(form_error(3)),
        // the ball pushes the sphere away: its stem bends sideways and gives way along itself less than can be seen
        "stem-bending" => {
            let acts = [0, 1].map(|i| (Target::Block(i), Shape::Push(i), 1.0));
            Ok(vec![Parameter::new("stem_bending", Um, acts).alias("k")])
        }
        // and hangs down where the table stands upright
        "stem-sag" => {
            let acts = [0, 1].map(|i| (Target::Block(i), Shape::CarrierGravity(i), 1.0));
            Ok(vec![Parameter::new("stem_sag", Um, acts).alias("sag")])
        }
        "block-shape" => {
            let acts = [(Target::HalfSize(0), Shape::Constant, 0.5), (Target::HalfSize(1), Shape::Constant, -0.5)];
            Ok(vec![Parameter::new("dXY", Um, acts)])
        }
        "block-slip" => slip(settings),
        "block-temperature" => {
            let acts = [(Target::HalfSizeRatio, Shape::Warmth, 1.0)];
            Ok(vec![Parameter::new("block_expansion", PpmPerK, acts).alias("alpha")])
        }
        _ => Err(Refusal::Unknown),
    }
}

/// What is round is larger; a hole is wider.
fn diameter(target: Target) -> Vec<Parameter> {
    vec![Parameter::new("diameter", Um, [(target, Shape::Constant, 0.5)])]
}

/// A sphere with two or three lobes about its upright axis.
fn form_error(k: i32) -> Vec<Parameter> {
    let row = |letter, shape| Parameter::at(format!("form{k}{letter}"), Um, Target::SphereRadius, shape);
    vec![row('c', Shape::FormCosine(k)), row('s', Shape::FormSine(k))]
}

/// The axis of the head that tilts the tool: B where the head has it, else A.
fn tilting_head(machine: &Machine) -> Result<AxisName, Refusal> {
    let here = |name: &AxisName| machine.axis(*name).is_some_and(|a| a.side == Side::Tool);
    let found = [AxisName::B, AxisName::A].into_iter().find(here);
    found.ok_or_else(|| Refusal::NotHere(format!("the head of {:?} does not tilt", machine.name)))
}

/// The table sinks the further out it stands: a bowl.
fn table_sag(machine: &Machine) -> Result<Vec<Parameter>, Refusal> {
    let axes: Vec<AxisName> = machine
        .axes
        .iter()
        .filter(|a| a.side == Side::Workpiece && matches!(a.name, AxisName::X | AxisName::Y))
        .map(|a| a.name)
        .collect();
    let Some(&last) = axes.last() else {
        return Err(Refusal::NotHere(format!("the table of {:?} does not move along X or Y", machine.name)));
    };
    let target = Target::Axis { axis: last, after: true, dof: 2 };
    let acts = axes.into_iter().map(|a| (target, Shape::Power(a, SPAN_MM, 2), -1.0));
    Ok(vec![Parameter::new("table_sag", Um, acts).alias("k").alias("sag")])
}

/// A load beside the centre tilts the plate (C's where there is one), and the tilt turns with it.
fn table_load(machine: &Machine) -> Result<Vec<Parameter>, Refusal> {
    let here = |name: &AxisName| machine.axis(*name).is_some_and(|a| a.side == Side::Workpiece);
    let Some(axis) = [AxisName::C, AxisName::B, AxisName::A].into_iter().find(here) else {
        return Err(Refusal::NotHere(format!("{:?} has no rotary table", machine.name)));
    };
    let row = |name: &str, dof: usize| {
        // a load that turns the axis about itself does so about its own line
        let about_itself = dof == along(axis) + 3;
        let target = if about_itself {
            Target::OwnLine { axis, after: true, dof }
        } else {
            Target::Axis { axis, after: true, dof }
        };
        Parameter::at(name, Urad, target, Shape::Constant)
    };
    Ok(vec![row("load_a", 3), row("load_b", 4)])
}

/// The edge of all blocks along their own x, y or z is longer by this much.
fn size(i: usize) -> Parameter {
    let acts = [(Target::HalfSize(i), Shape::Constant, 0.5)];
    Parameter::new(format!("size_{}", dof_letter(i)), Um, acts).alias(format!("s{}", dof_letter(i)))
}

/// The same of one block, which the value names; of all blocks where it names none.
fn own_size(i: usize) -> Parameter {
    let acts = [(Target::HalfSize(i), Shape::Constant, 0.5)];
    Parameter::new(format!("own_size_{}", dof_letter(i)), Um, acts)
}

/// All blocks slip on their carrier at one moment.
fn slip(settings: Settings<'_>) -> Result<Vec<Parameter>, Refusal> {
    let shape = match (settings("from_touch"), settings("from_h")) {
        (Some(touch), _) => Shape::FromTouch(touch),
        (None, Some(hour)) => Shape::FromHour(hour),
        (None, None) => {
            return Err(Refusal::NotHere("it must say when: from_touch (number) or from_h (hours)".to_owned()));
        }
    };
    let names = ["dx", "dy", "dz", "rx", "ry", "rz"];
    let mut rows: Vec<Parameter> =
        (0..6).map(|i| Parameter::at(names[i], if i < 3 { Um } else { Urad }, Target::Block(i), shape)).collect();
    rows.push(Parameter::setting("from_touch", One));
    rows.push(Parameter::setting("from_h", H));
    Ok(rows)
}
