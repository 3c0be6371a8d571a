//! Each location error alone, of both signs, through every control's files: what is carried is gone, what is not is said.

use super::controls::{parameters, plan, tables, way};
use super::support::{catalogue, machine};
use axiscal::axes::AxisName;
use axiscal::diag::source;
use axiscal::machine::{self, Machine, Side};
use axiscal::tables::control;
use std::collections::BTreeMap;

/// Their files are read by a reader made from the manuals' pages.
const DOCUMENTED: [&str; 2] = ["sinumerik", "fanuc"];
/// No page says what their values mean: the virtual machine takes the numbers as this program writes them.
const ROUND_TRIP_ONLY: [&str; 2] = ["heidenhain", "haas"];

/// For each control, parameter and sign: every touch reads what was foretold; what is carried is gone to the control's
/// resolution, what is not is said.
fn every_parameter(name: &str, controls: [&str; 2], at_least: usize) {
    every_parameter_of(&machine(name), controls, at_least);
}

fn every_parameter_of(machine: &Machine, controls: [&str; 2], at_least: usize) {
    let (catalogue, name) = (catalogue(), machine.name.as_str());
    let plan = plan(machine, 7);
    let (mut carried, mut told) = (0, BTreeMap::new());
    for control in controls {
        if control::kind_of(machine, &tables(control)).is_err() {
            // trunnions only, and no setting for an inclination
            let other = machine.side(Side::Tool).any(|a| a.name.is_rotary()) || name == "nutating-b";
            assert!(control == "haas" && other, "{control} {name}");
            continue;
        }
        for (effect, parameter, length) in parameters(&catalogue, machine) {
            for sign in [1.0, -1.0] {
                let value = sign * if length { 0.05 } else { 0.02 };
                // the others are known, and 0
                let others = parameters(&catalogue, machine)
                    .into_iter()
                    .filter(|(e, n, _)| e.starts_with("location") && (*e, n) != (effect, &parameter));
                let others: Vec<(&str, String, bool)> = others.collect();
                let mut planted = vec![(effect, parameter.as_str(), value)];
                planted.extend(others.iter().map(|(e, n, _)| (*e, n.as_str(), 0.0)));
                let (before, after, export) = way(machine, control, &planted, &plan);
                let of = format!("{control} {name} {parameter} ({effect}) {value}");
                if export.left.is_empty() {
                    // half a step in each of several components, and angles of 0.0005 deg at some 100 mm
                    let resolution = match control {
                        "sinumerik" => 0.05,
                        "fanuc" => 2.0,
                        "haas" => 3.0,
                        _ => 0.6,
                    };
                    assert!(after < resolution, "{of}: before {before:.3} um, after {after:.3} um");
                    carried += 1;
                } else {
                    // a tilt is held as the offset that it makes at the workpiece's height; nothing gets worse
                    assert!(after < 1.05 * before + 1.5, "{of}: {before:.3} um, {after:.3} um");
                    assert!(
                        export.left.iter().all(|l| l.left_um.is_some() && !l.why.is_empty()),
                        "{of}: {:?}",
                        export.left
                    );
                    *told.entry(control).or_insert(0) += 1;
                }
            }
        }
    }
    println!("{name}: {carried} carried; said to be left: {told:?}");
    assert!(carried >= at_least, "{carried}");
}

/// Axes that count the other way, and a machine zero that is not R's origin: the same must come back.
fn counting_otherwise(name: &str) -> Machine {
    let (before, own) = machine::BUILT_IN.split_once(&format!("name = \"{name}\"")).unwrap();
    let (own, after) = own.split_once("[machine.tool]").unwrap();
    let own = own.replace("\nsense = 1\n", "\nsense = -1\n");
    let own = own.replacen("X = 0.0, Y = 0.0, Z = 0.0,", "X = 100.0, Y = -50.0, Z = 30.0,", 1);
    let text = format!("{before}name = \"{name}\"{own}[machine.tool]{after}");
    let (machines, _) = machine::load(&source("machines.toml", text)).unwrap();
    let found = machines.into_iter().find(|m| m.name == name).unwrap();
    assert!(found.rotary().all(|a| a.sense < 0.0) && found.origin.get(AxisName::X) == Some(100.0));
    found
}

#[test]
fn every_parameter_of_a_table_that_counts_otherwise_comes_back() {
    let trunnion = counting_otherwise("trunnion");
    every_parameter_of(&trunnion, DOCUMENTED, 24);
    every_parameter_of(&trunnion, ROUND_TRIP_ONLY, 14);
}

#[test]
fn every_parameter_of_a_head_that_counts_otherwise_comes_back() {
    let swivel = counting_otherwise("swivel-head");
    every_parameter_of(&swivel, DOCUMENTED, 24);
    every_parameter_of(&swivel, ROUND_TRIP_ONLY, 10);
    every_parameter_of(&counting_otherwise("double-head"), DOCUMENTED, 24);
}

#[test]
fn every_parameter_of_the_swivel_head_comes_back() {
    every_parameter("swivel-head", DOCUMENTED, 24);
}

#[test]
fn every_parameter_of_the_swivel_head_comes_back_round_trip_only() {
    every_parameter("swivel-head", ROUND_TRIP_ONLY, 10);
}

#[test]
fn every_parameter_of_the_double_head_comes_back() {
    every_parameter("double-head", DOCUMENTED, 24);
}

#[test]
fn every_parameter_of_the_double_head_comes_back_round_trip_only() {
    every_parameter("double-head", ROUND_TRIP_ONLY, 10);
}

#[test]
fn every_parameter_of_the_trunnion_comes_back() {
    every_parameter("trunnion", DOCUMENTED, 24);
}

#[test]
fn every_parameter_of_the_trunnion_comes_back_round_trip_only() {
    every_parameter("trunnion", ROUND_TRIP_ONLY, 14);
}

#[test]
fn every_parameter_of_the_swivel_table_comes_back() {
    every_parameter("swivel-table-b", DOCUMENTED, 24);
}

#[test]
fn every_parameter_of_the_swivel_table_comes_back_round_trip_only() {
    every_parameter("swivel-table-b", ROUND_TRIP_ONLY, 14);
}

#[test]
fn every_parameter_of_the_nutating_table_comes_back() {
    every_parameter("nutating-b", DOCUMENTED, 24);
}

#[test]
fn every_parameter_of_the_nutating_table_comes_back_round_trip_only() {
    every_parameter("nutating-b", ROUND_TRIP_ONLY, 8);
}

#[test]
fn every_parameter_of_the_trunnion_whose_axes_do_not_meet_comes_back() {
    every_parameter("trunnion-offset", DOCUMENTED, 24);
}

#[test]
fn every_parameter_of_the_trunnion_whose_axes_do_not_meet_comes_back_round_trip_only() {
    every_parameter("trunnion-offset", ROUND_TRIP_ONLY, 14);
}
