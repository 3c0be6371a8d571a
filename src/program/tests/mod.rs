//! The built-in programs on the built-in machines, and what seed-method says can and cannot be reached.

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
fn basic_is_complete_on_both_table_machines() {
    for name in ["trunnion", "swivel-table-b"] {
        let (_, g) = built_in(name, "basic");
        assert!(g.plan.skipped.is_empty(), "{:?}", super::skipped_groups(&g.plan.skipped));
        assert_eq!(g.plan.touches.len(), 4 * 48 + 2 * 40 + 2 * 30);
    }
}
