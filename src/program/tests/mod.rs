//! The built-in programs on the built-in machines, and what the method says can and cannot be reached.

use super::plan::Plan;
use super::{Generated, Options, generate};
use crate::axes::AxisName;
use crate::diag::source;
use crate::machine::{BUILT_IN, Machine};

mod forms;
mod paths;
mod reach;
mod scene;

fn machine_of(text: &str, name: &str) -> Machine {
    let (machines, _) = crate::machine::load(&source("machines.toml", text)).unwrap();
    machines.into_iter().find(|m| m.name == name).unwrap()
}

fn built_in(machine: &str, program: &str) -> (Machine, Generated) {
    let machine = machine_of(BUILT_IN, machine);
    let spec = super::choose(super::built_in().unwrap(), program, &machine).unwrap();
    let (generated, _) = generate(&machine, &spec, &Options::default())
        .unwrap_or_else(|f| panic!("{}", f.0.iter().map(|f| format!("{f}\n")).collect::<String>()));
    (machine, generated)
}

fn count(plan: &Plan, pose: &[(AxisName, f64)]) -> usize {
    plan.touches.iter().filter(|t| pose.iter().all(|(a, v)| t.pose.get(*a) == Some(*v))).count()
}

#[test]
fn head_has_the_touches_of_the_paper() {
    let (_, g) = built_in("swivel-head", "head");
    assert!(g.plan.skipped.is_empty(), "{:?}", super::skipped_groups(&g.plan.skipped));
    let by_b = [0.0, -90.0, -30.0].map(|b| count(&g.plan, &[(AxisName::B, b)]));
    assert_eq!(by_b, [112, 42, 48]);
    assert_eq!(g.plan.touches.len(), 202);
}

#[test]
fn table_has_the_touches_of_the_paper() {
    let (_, g) = built_in("swivel-head", "table");
    assert!(g.plan.skipped.is_empty(), "{:?}", super::skipped_groups(&g.plan.skipped));
    for c in [0.0, 90.0, 180.0, 270.0] {
        assert_eq!(count(&g.plan, &[(AxisName::B, 0.0), (AxisName::C, c)]), 28);
        assert_eq!(count(&g.plan, &[(AxisName::B, -90.0), (AxisName::C, c)]), if c == 0.0 { 0 } else { 14 });
    }
    assert_eq!(g.plan.touches.len(), 154);
}

#[test]
fn double_head_has_the_touches_of_the_paper() {
    let (_, g) = built_in("double-head", "double-head");
    assert!(g.plan.skipped.is_empty(), "{:?}", super::skipped_groups(&g.plan.skipped));
    let poses = [(0.0, 0.0), (-90.0, 0.0), (-30.0, 0.0), (0.0, -90.0), (0.0, 90.0)];
    let counts = poses.map(|(b, a)| count(&g.plan, &[(AxisName::B, b), (AxisName::A, a)]));
    assert_eq!(counts, [112, 42, 48, 42, 42]);
}

#[test]
fn basic_is_complete_on_the_table_machines() {
    let tilting = 4 * 48 + 2 * 40 + 2 * 30;
    let nutating = 4 * 48 + 3 * 32 + 2 * 30;
    for (name, touches) in
        [("trunnion", tilting), ("swivel-table-b", tilting), ("trunnion-offset", tilting), ("nutating-b", nutating)]
    {
        let (_, g) = built_in(name, "basic");
        assert!(g.plan.skipped.is_empty(), "{:?}", super::skipped_groups(&g.plan.skipped));
        assert_eq!(g.plan.touches.len(), touches, "{name}");
    }
}

/// The trunnion machine with its text changed, and what `basic` gives on it.
fn changed_trunnion(changes: &[(&str, &str)]) -> Generated {
    let start = BUILT_IN.find("name = \"trunnion\"").unwrap();
    let (before, mut machine_text) = (&BUILT_IN[..start], BUILT_IN[start..].to_owned());
    for (old, new) in changes {
        assert!(machine_text.contains(old), "{old}");
        machine_text = machine_text.replacen(old, new, 1);
    }
    let machine = machine_of(&format!("{before}{machine_text}"), "trunnion");
    let spec = super::choose(super::built_in().unwrap(), "basic", &machine).unwrap();
    generate(&machine, &spec, &Options::default())
        .unwrap_or_else(|f| panic!("{}", f.0.iter().map(|f| format!("{f}\n")).collect::<String>()))
        .0
}

#[test]
fn a_knee_that_lifts_the_table_is_an_axis_like_any_other() {
    let (_, usual) = built_in("trunnion", "basic");
    let z_to_table = [
        ("name = \"A\"\nparent = \"base\"", "name = \"A\"\nparent = \"Z\""),
        ("name = \"Z\"\nparent = \"Y\"", "name = \"Z\"\nparent = \"base\""),
        ("[machine.tool]\nparent = \"Z\"", "[machine.tool]\nparent = \"Y\""),
    ];
    let knee = changed_trunnion(&z_to_table);
    assert_eq!(knee.plan.touches, usual.plan.touches);
    assert_eq!(knee.path.steps, usual.path.steps);
}

#[test]
fn a_lift_that_counts_downwards_lifts_towards_its_lower_end() {
    let (_, usual) = built_in("trunnion", "basic");
    let z_down = [(
        "direction = [0.0, 0.0, 1.0]\nrange = [-200.0, 350.0]",
        "direction = [0.0, 0.0, -1.0]\nrange = [-350.0, 200.0]",
    )];
    let down = changed_trunnion(&z_down);
    assert_eq!(down.plan.touches.len(), usual.plan.touches.len());
    for (a, b) in down.plan.touches.iter().zip(&usual.plan.touches) {
        let z = |t: &super::plan::PlanTouch| t.nominal.get(AxisName::Z).unwrap();
        assert!((z(a) + z(b)).abs() < 1e-8);
    }
    let first = down.path.steps.first().unwrap();
    // the end of the range less the reserve for a loaded compensation
    assert_eq!(*first, super::path::Step::Rapid { to: crate::axes::AxisMap::default().with(AxisName::Z, -349.0) });
}
