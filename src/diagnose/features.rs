//! What is known of each touch, for shapes that no effect has a name for.

use super::evidence::Evidence;
use crate::axes::AxisName;
use crate::fit::Fit;
use crate::fit::candidates::columns;
use crate::machine::{Machine, Side};
use crate::model::catalogue::Catalogue;
use crate::model::formula::slot;
use crate::search::pattern_tests::{Direction, Features, Generics, Kind, Variable, generics};
use crate::units::um_from_mm;
use nalgebra::Vector3;
use std::sync::Arc;

/// The table of what is known: one entry per touch in the fit's order.
#[must_use]
pub fn features(fit: &Fit, machine: &Machine) -> Features {
    let observations = &fit.data.observations;
    let column = |s: usize| -> Vec<f64> { observations.iter().map(|o| o.state[s]).collect() };
    let mut variables = Vec::new();
    for axis in &machine.axes {
        let kind = if axis.name.is_rotary() { Kind::Rotary } else { Kind::Linear };
        // where the plan has them: a step between two readings of one point would split them by their own noise
        let places = fit.data.nominal.iter().map(|o| o.position.mm_or_rad(axis.name)).collect();
        variables.push(Variable::new(axis.name.to_string(), kind, places).acting(sees(fit, axis.name)));
    }
    variables.push(Variable::new("t", Kind::Time, column(slot::HOURS)));
    if observations.iter().any(|o| o.has_temperature) {
        variables.push(Variable::new("T", Kind::Temperature, column(slot::TEMPERATURE)));
    }
    for axis in &machine.axes {
        let sense = Variable::new(format!("s{}", axis.name), Kind::Plain, column(slot::SENSES + axis.name.index()));
        variables.push(sense.acting(sees(fit, axis.name)));
    }
    for axis in machine.rotary() {
        variables.push(before(fit, axis.name));
    }
    variables.push(Variable::new("feed", Kind::Plain, column(slot::FEED)));
    variables.push(Variable::new("S", Kind::Rotary, column(slot::SPINDLE)));
    variables.push(Variable::new("L", Kind::Plain, column(slot::LENGTHS)));
    variables.push(approach(fit));

    let vector = |s: usize| -> Vec<Vector3<f64>> {
        observations.iter().map(|o| Vector3::new(o.state[s], o.state[s + 1], o.state[s + 2])).collect()
    };
    let carrier: Vec<Vector3<f64>> = observations.iter().map(|o| o.normal).collect();
    let mut directions = Direction::of_normals(&vector(slot::NORMAL_IN_R), &carrier, "base");
    directions.extend(turns(fit, machine));
    Features {
        variables,
        directions,
        block: observations.iter().map(|o| o.set_up).collect(),
        face: faces(fit),
        visit: fit.data.visits.clone(),
        run: observations.iter().map(|o| o.run).collect(),
    }
}

/// The touches whose block or ball an axis moves.
fn sees(fit: &Fit, axis: AxisName) -> Vec<bool> {
    fit.data.observations.iter().map(|o| fit.model.sees(axis, o)).collect()
}

/// Where a rotary axis stood before it came to its pose: hysteresis.
fn before(fit: &Fit, axis: AxisName) -> Variable {
    let place = slot::BEFORE + axis.index() - AxisName::A.index();
    let values = fit.data.observations.iter().map(|o| o.state[place]).collect();
    let name = format!("{axis} before");
    Variable { word: Some(format!("w{axis}")), ..Variable::new(name, Kind::Plain, values).acting(sees(fit, axis)) }
}

/// Angle of the approach in the probe's frame.
fn approach(fit: &Fit) -> Variable {
    let s = slot::NORMAL_IN_PROBE;
    let angles = fit.data.observations.iter().map(|o| {
        let (x, y) = (o.state[s], o.state[s + 1]);
        if x.hypot(y) > 1e-6 { y.atan2(x) } else { 0.0 }
    });
    let mut out = Variable::new("approach", Kind::Approach, angles.collect());
    out.word = Some("atan2(my, mx)".into());
    out
}

/// Touches of one face of one block share a number.
fn faces(fit: &Fit) -> Vec<usize> {
    let mut seen: Vec<(usize, [i8; 3])> = Vec::new();
    let key = |v: &Vector3<f64>| [v.x, v.y, v.z].map(|c| (10.0 * c).round() as i8);
    fit.data
        .observations
        .iter()
        .map(|o| {
            let face = (o.set_up, key(&o.normal));
            seen.iter().position(|f| *f == face).unwrap_or_else(|| {
                seen.push(face);
                seen.len() - 1
            })
        })
        .collect()
}

/// Turns of the rotary axes about their own line and tilts of it: their lever arms are the model's own.
fn turns(fit: &Fit, machine: &Machine) -> Vec<Direction> {
    const DOFS: [&str; 3] = ["rx", "ry", "rz"];
    let own = |axis: AxisName| match axis {
        AxisName::A => "rx",
        AxisName::B => "ry",
        _ => "rz",
    };
    let mut out = Vec::new();
    for axis in machine.rotary() {
        // 1 everywhere, and still an error motion: a constant would say where the line is, at the reference point
        let one = format!("1 + 0*{}", axis.name);
        let term = |dof| format!("{{ parameter = \"{dof}\", unit = \"urad\", dof = \"{dof}\", formula = \"{one}\" }}");
        let terms = DOFS.map(term).join(", ");
        let text = format!("[[effect]]\nid = \"turn\"\nat = \"{}\"\nterms = [{terms}]", axis.name);
        let mut catalogue = Catalogue::default();
        if catalogue.add_file(&crate::diag::source("turn", text)).is_err() {
            continue;
        }
        let Some(effect) = catalogue.get("turn", machine) else { continue };
        let made = columns(machine, &[effect], &fit.data, &fit.data.observations, fit.model.reference, None);
        for (i, dof) in DOFS.into_iter().enumerate() {
            let weight: Vec<f64> = made.values.column(i).iter().map(|v| um_from_mm(*v)).collect();
            if weight.iter().any(|w| w.abs() > 1e-6) {
                let about = dof.trim_start_matches('r').to_uppercase();
                let is_own = dof == own(axis.name);
                let name = if is_own { format!("turn-{}", axis.name) } else { format!("tilt-{}-{about}", axis.name) };
                let (at, dof, unit) = (axis.name.to_string(), dof.to_owned(), "urad".to_owned());
                out.push(Direction { name, at, dof, unit, weight });
            }
        }
    }
    out
}

/// All generic shapes of a fit, whitened as its touches are.
#[must_use]
pub fn shapes(evidence: &Evidence, features: &Arc<Features>) -> Generics {
    generics(features, evidence.rows.clone())
}

/// In which frame a direction's name stands, for people.
#[must_use]
pub fn direction_words(name: &str, machine: &Machine) -> String {
    match name.split_once('-') {
        Some(("machine", axis)) => format!("in {axis} of the machine"),
        Some(("table", axis)) => {
            let turns = machine.axes.iter().any(|a| a.name.is_rotary() && a.side == Side::Workpiece);
            if turns { format!("in {axis} of what carries the block") } else { format!("in {axis} of the table") }
        }
        Some(("turn", axis)) => format!("as a turn about {axis}"),
        Some(("tilt", which)) => {
            let (axis, about) = which.split_once('-').unwrap_or((which, ""));
            format!("as a tilt of {axis} about {about}")
        }
        _ => "along the approach".to_owned(),
    }
}
