//! The kinematics component: C source for `halcompile` from the machine description, and the HAL lines of its pins.

use super::{CONTROLLER, HAL_NAME_LEN, head, one_line, render};
use crate::axes::AxisName;
use crate::diag::Result;
use crate::machine::{Machine, Side};
use crate::tables::compensation::Term;
use crate::tables::correction::Correction;
use crate::tables::place::{Dof, Place, Spot};
use minijinja::context;
use sha2::{Digest, Sha256};

/// The source's template.
const SOURCE: &str = include_str!("../templates/linuxcnc/kins.c.j2");

/// Longest `.pin` of the component.
const LONGEST_PIN: usize = ".reference-x".len();

/// Name of the component: a C identifier that leaves room for its pins in a HAL name.
///
/// A machine name that is not letters, digits, `-` and `_`, or is too long, gets six digits of its hash, so that two
/// machines cannot share a component.
#[must_use]
pub fn name(machine: &Machine) -> String {
    const PREFIX: &str = "axiscal_";
    const SUFFIX: &str = "_kins";
    let plain: String =
        machine.name.chars().map(|c| if c.is_ascii_alphanumeric() { c.to_ascii_lowercase() } else { '_' }).collect();
    let faithful = machine.name.chars().all(|c| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '-');
    let room = HAL_NAME_LEN - LONGEST_PIN - PREFIX.len() - SUFFIX.len();
    if faithful && plain.len() <= room {
        return format!("{PREFIX}{plain}{SUFFIX}");
    }
    let hash = Sha256::digest(machine.name.as_bytes());
    let digits: String = hash.iter().take(3).map(|b| format!("{b:02x}")).collect();
    let kept: String = plain.chars().take(room - digits.len() - 1).collect();
    format!("{PREFIX}{kept}_{digits}{SUFFIX}")
}

/// A number as C reads it: always with a point or an exponent.
fn c_number(value: f64) -> String {
    format!("{:?}", value + 0.0)
}

fn c_vector(v: &nalgebra::Vector3<f64>) -> Vec<String> {
    v.iter().map(|x| c_number(*x)).collect()
}

/// Letters of the machine's axes in LinuxCNC's standard order.
#[must_use]
pub fn coordinates(machine: &Machine) -> String {
    AxisName::ALL.into_iter().filter(|a| machine.axis(*a).is_some()).map(AxisName::letter).collect()
}

/// The C source.
///
/// # Errors
/// When the template cannot be rendered.
pub fn source(machine: &Machine, correction: &Correction) -> Result<String> {
    let rotary: Vec<AxisName> = machine.rotary().map(|a| a.name).collect();
    let axes: Vec<minijinja::Value> = machine
        .axes
        .iter()
        .map(|a| {
            context! {
                index => a.name.index(),
                letter => a.name.letter().to_string(),
                side => if a.side == Side::Tool { "TOOL" } else { "WORKPIECE" },
                rotary => rotary.iter().position(|r| *r == a.name).map_or(-1, |i| i as i64),
                direction => c_vector(&a.direction.into_inner()),
                point => c_vector(&a.point),
                sense => c_number(a.sense),
                origin => c_number(machine.origin.get(a.name).unwrap_or(0.0)),
            }
        })
        .collect();
    render(
        "kins.c",
        SOURCE,
        &context! {
            machine => one_line(&machine.name),
            machine_sha256 => machine.sha256.clone(),
            controller => CONTROLLER,
            head => head(machine, correction),
            component => name(machine),
            coordinates => coordinates(machine),
            axes => axes,
            rotary => rotary.iter().map(|r| context! { letter => r.letter().to_string() }).collect::<Vec<_>>(),
            pivot => c_vector(&machine.tool.pivot),
            tool_axis => c_vector(&machine.tool.direction.into_inner()),
            tool_length => c_number(machine.tool.length_mm),
            reference => c_vector(&machine.reference.pivot),
        },
    )
}

/// Pin of a spot, without the component's name.
#[must_use]
pub fn pin(spot: Spot) -> String {
    let axis = spot.axis.letter().to_ascii_lowercase();
    match spot.place {
        Place::Zero => format!("{axis}-zero"),
        place => format!("{axis}-{place}-{}", spot.dof.pin_letter()),
    }
}

/// Every pin with its value, in the order of the source: what is not in `terms` is 0, so that a file loaded over
/// another one leaves nothing of it.
#[must_use]
pub fn pins(machine: &Machine, terms: &[Term], reference_mm: [f64; 3], mm_per_unit: f64) -> Vec<(String, f64)> {
    let value = |spot: Spot| terms.iter().filter(|t| pin(t.spot()) == pin(spot)).map(|t| t.value).sum::<f64>();
    let mut pins = Vec::new();
    for axis in machine.rotary() {
        for place in [Place::Before, Place::After] {
            for dof in Dof::ALL {
                let spot = Spot { axis: axis.name, place, dof };
                pins.push((pin(spot), value(spot)));
            }
        }
        let spot = Spot { axis: axis.name, place: Place::Zero, dof: Dof::Rx };
        pins.push((pin(spot), value(spot)));
    }
    for (letter, value) in ["x", "y", "z"].into_iter().zip(reference_mm) {
        pins.push((format!("reference-{letter}"), value));
    }
    pins.push(("mm-per-unit".to_owned(), mm_per_unit));
    pins
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diag::source as text;

    #[test]
    fn names_are_c_identifiers_that_leave_room_for_pins() {
        let (machines, _) = crate::machine::load(&text("m", crate::machine::BUILT_IN)).unwrap();
        let mut machine = machines.into_iter().find(|m| m.name == "swivel-head").unwrap();
        assert_eq!(name(&machine), "axiscal_swivel_head_kins");
        for odd in ["Fräse #1", "../etc", "", "a name that is much longer than any HAL name can be", "swivel_head"] {
            machine.name = odd.to_owned();
            let name = name(&machine);
            assert!(name.len() + LONGEST_PIN <= HAL_NAME_LEN, "{name}");
            assert!(name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_'), "{name}");
            assert_ne!(name, "axiscal_swivel_head_kins", "{odd:?}");
        }
    }
}
