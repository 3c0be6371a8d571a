//! An exported compensation at work: what the control knows it takes out, what it does not know stays.

use super::*;

fn compensation(machine: &Machine, terms: &str) -> Compensation {
    let text = format!(
        r#"{{"format": "axiscal-compensation/1", "controller": "linuxcnc", "machine": "{}", "mode": "component",
            "component": "test_kins", "reference_mm": [0.0, 0.0, 0.0], "terms": [{terms}]}}"#,
        machine.name
    );
    Compensation::parse(&source("compensation.json", text), machine).unwrap().0
}

fn term(axis: &str, place: &str, dof: &str, value: f64) -> String {
    let unit = if dof.starts_with('d') { "mm" } else { "deg" };
    format!(r#"{{"axis": "{axis}", "place": "{place}", "dof": "{dof}", "value": {value}, "unit": "{unit}"}}"#)
}

#[test]
fn what_the_control_knows_it_takes_out() {
    let machine = machine_named("swivel-head");
    let head = [("rx", "EA0B", 0.015), ("ry", "EB0B", -0.01), ("rz", "EC0B", 0.02), ("dx", "EX0B", 0.03)];
    let table = [("rx", "EA0C", 0.025), ("ry", "EB0C", 0.034), ("dx", "EX0C", -0.04), ("dy", "EY0C", -0.035)];
    let values = |rows: &[(&str, &'static str, f64)]| rows.iter().map(|r| (r.1, r.2)).collect::<Vec<_>>();
    let scenario = Scenario::flawless()
        .with(&machine, "paper-head", &values(&head))
        .and_then(|s| s.with(&machine, "paper-table", &values(&table)))
        .unwrap();
    let terms: Vec<String> = head
        .iter()
        .map(|(dof, _, v)| term("B", "before", dof, *v))
        .chain(table.iter().map(|(dof, _, v)| term("C", "before", dof, *v)))
        .collect();
    let compensation = compensation(&machine, &terms.join(","));
    let mut plan = empty_plan(&machine, "table");
    for (b, c) in [(0.0, 0.0), (-90.0, 90.0), (-30.0, 211.0), (20.0, -75.0)] {
        let at = pose(&[(AxisName::B, b), (AxisName::C, c)]);
        for (point, n) in [
            ([35.0, 2.0, -203.0], [1.0, 0.0, 0.0]),
            ([31.0, -5.0, -201.0], [0.0, -1.0, 0.0]),
            ([32.0, 1.0, -197.684], [0.0, 0.0, 1.0]),
        ] {
            add_touch(&mut plan, &machine, "x+", point, n, at);
        }
    }
    for e in readings(&machine, &plan, &scenario, Some(&compensation)) {
        close(e, 0.0, 5e-13);
    }
    assert!(readings(&machine, &plan, &scenario, None).iter().any(|e| e.abs() > 0.05));
}

#[test]
fn what_it_does_not_know_stays() {
    let machine = machine_named("swivel-head");
    let planted = Scenario::flawless().with(&machine, "paper-head", &[("d_xBZ", 0.03), ("d_yBZ", 0.02)]).unwrap();
    let rest = Scenario::flawless().with(&machine, "paper-head", &[("d_yBZ", 0.02)]).unwrap();
    let known = compensation(&machine, &term("B", "before", "dx", 0.03));
    let mut plan = empty_plan(&machine, "head");
    let at = pose(&[(AxisName::B, -30.0), (AxisName::C, 0.0)]);
    add_touch(&mut plan, &machine, "x+", [35.0, 0.0, -203.0], [1.0, 0.0, 0.0], at);
    add_touch(&mut plan, &machine, "y+", [0.0, 35.0, -203.0], [0.0, 1.0, 0.0], at);
    let with = readings(&machine, &plan, &planted, Some(&known));
    let without = readings(&machine, &plan, &rest, None);
    with.iter().zip(&without).for_each(|(a, b)| close(*a, *b, 1e-12));
}

#[test]
fn a_bad_compensation_is_refused_with_its_term() {
    let machine = machine_named("swivel-head");
    for (terms, word) in [
        (term("A", "before", "dx", 1.0), "axis \"A\""),
        (term("B", "beside", "dx", 1.0), "beside"),
        (term("B", "before", "dq", 1.0), "dq"),
        (term("B", "before", "dx", 1.0).replace("mm", "deg"), "deg"),
    ] {
        let text = format!(
            r#"{{"format": "axiscal-compensation/1", "machine": "swivel-head", "mode": "component", "terms": [{terms}]}}"#
        );
        let failure = Compensation::parse(&source("c.json", text), &machine).unwrap_err();
        assert!(failure.to_string().contains(word), "{failure}");
    }
    for text in ["", "{}", "[]", r#"{"format": "x", "machine": "y", "mode": "z"}"#] {
        assert!(Compensation::parse(&source("c.json", text), &machine).is_err());
    }
}
