//! The probe: when it triggers, where its ball is.

use super::unit::Unit::{Mm, Ms, Um};
use super::{Parameter, Refusal, Settings};
use crate::machine::Machine;
use crate::simulate::terms::{Shape, Target};
use crate::units::s_from_h;

/// Ids of this family.
pub fn ids(_: &Machine) -> Vec<String> {
    let all = [
        "pretravel",
        "pretravel-axial",
        "pretravel-directions",
        "lobing-2",
        "lobing-3",
        "tip-eccentricity",
        "stylus-sag",
        "latency",
    ];
    all.map(str::to_owned).to_vec()
}

/// Parameters of an id of this family.
pub fn parameters(id: &str, _: &Machine, _: Settings<'_>) -> Result<Vec<Parameter>, Refusal> {
    Ok(match id {
        "pretravel" => vec![Parameter::at("pretravel", Mm, Target::Late, Shape::Constant)],
        "pretravel-axial" => {
            vec![Parameter::at("pretravel_axial", Um, Target::Late, Shape::AxialApproach).alias("k")]
        }
        "pretravel-directions" => {
            let row = |(name, component, positive)| {
                Parameter::at(name, Um, Target::Late, Shape::ApproachTo { component, positive })
            };
            let all = [("xp", 0, true), ("xm", 0, false), ("yp", 1, true), ("ym", 1, false)];
            all.map(|(side, component, positive)| row((format!("pretravel_{side}"), component, positive))).to_vec()
        }
        "lobing-2" => lobing(2.0, 2),
        "lobing-3" => lobing(3.0, 3),
        "tip-eccentricity" => vec![
            Parameter::at("ex", Um, Target::BallInStylus(0), Shape::Constant).alias("tip_x"),
            Parameter::at("ey", Um, Target::BallInStylus(1), Shape::Constant).alias("tip_y"),
        ],
        "stylus-sag" => vec![sag()],
        // the faster the ball, the further it runs on until the control has seen the trigger
        "latency" => {
            let acts = [(Target::Late, Shape::Feed, s_from_h(1.0))];
            vec![Parameter::new("latency", Ms, acts).alias("tau")]
        }
        _ => return Err(Refusal::Unknown),
    })
}

/// The three seats of the stylus's plate (or two stiff directions) let go earlier in some directions.
fn lobing(order: f64, k: u32) -> Vec<Parameter> {
    vec![
        Parameter::at(format!("lobing{k}c"), Um, Target::Late, Shape::LobeCosine(order)),
        Parameter::at(format!("lobing{k}s"), Um, Target::Late, Shape::LobeSine(order)),
    ]
}

/// The stylus bends under its own weight, across itself and with the square of its length.
fn sag() -> Parameter {
    let acts = (0..3).map(|i| (Target::BallInTool(i), Shape::StylusGravity(i), 1.0));
    Parameter::new("stylus_sag", Um, acts).alias("k").alias("sag")
}
