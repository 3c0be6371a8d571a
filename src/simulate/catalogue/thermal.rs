//! What time and temperature do.

use super::unit::Unit::{H, PpmPerK, Um, UmPerH, UmPerK};
use super::{Parameter, Refusal, Settings, dof_letter, must_stand_on};
use crate::axes::AxisName;
use crate::machine::{Machine, Side};
use crate::simulate::terms::{Shape, Target};

/// Time constant when none is given, hours.
const TAU_H: f64 = 0.5;

/// Ids of this family.
pub fn ids(_: &Machine) -> Vec<String> {
    let all = [
        "drift-linear",
        "warm-up",
        "spindle-growth",
        "ambient-bending",
        "ambient-scale",
        "centre-drift-c",
        "artefact-growth",
    ];
    all.map(str::to_owned).to_vec()
}

/// Parameters of an id of this family.
pub fn parameters(id: &str, machine: &Machine, settings: Settings<'_>) -> Result<Vec<Parameter>, Refusal> {
    let tau = settings("spindle_tau").or_else(|| settings("tau")).unwrap_or(TAU_H);
    let tau_row = |name: &str| Parameter::setting(name, H).alias("tau_h");
    let ball = |prefix: &'static str, unit, shape| {
        (0..3).map(move |i| {
            let letter = dof_letter(i).to_ascii_lowercase();
            Parameter::at(format!("{prefix}{letter}"), unit, Target::BallInMachine(i), shape)
        })
    };
    Ok(match id {
        "drift-linear" => ball("v", UmPerH, Shape::Hours).collect(),
        "warm-up" => ball("w", Um, Shape::WarmUp(tau)).chain([tau_row("tau")]).collect(),
        "ambient-bending" => ball("q", UmPerK, Shape::Warmth).collect(),
        // the spindle grows out of the head: the ball moves away from it
        "spindle-growth" => {
            let row = Parameter::at("spindle_growth", Um, Target::Length, Shape::SpindleWarmth(tau)).alias("growth");
            vec![row.alias("A"), tau_row("spindle_tau").alias("tau")]
        }
        "ambient-scale" => {
            let axes = machine.axes.iter().map(|a| a.name).filter(|a| !a.is_rotary());
            // a scale that has grown shows less than the way that the axis has gone, whatever it bears
            let acts = axes.map(|axis| (Target::Reading(axis), Shape::WarmthTimes(axis), 1.0));
            vec![Parameter::new("expansion", PpmPerK, acts).alias("alpha")]
        }
        "centre-drift-c" => {
            must_stand_on(AxisName::C, Side::Workpiece, machine)?;
            let row = |dof: usize, name: &str| {
                let target = Target::OwnLine { axis: AxisName::C, after: false, dof };
                Parameter::at(format!("centre_{name}"), UmPerH, target, Shape::Hours).alias(name)
            };
            vec![row(0, "vx"), row(1, "vy")]
        }
        "artefact-growth" => {
            let row = Parameter::at("artefact_growth", UmPerH, Target::BlockOutward, Shape::Hours);
            vec![row.alias("growth").alias("k")]
        }
        _ => return Err(Refusal::Unknown),
    })
}
