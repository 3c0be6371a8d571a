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

/// Pins as the module needs them for offsets of both axes (by hand: the axes pass through z = -250, pivot at 0).
fn stock(machine: &Machine, module: &str, d_tilting: Vec3, d_turning: Vec3, shift: Option<Vec3>) -> Compensation {
    let (across, letter) = if module == "xyzac-trt-kins" { (1, "y") } else { (0, "x") };
    let shift = shift.map(|s| format!(r#""workpiece_shift_mm": {s:?},"#)).unwrap_or_default();
    let text = format!(
        r#"{{"format": "axiscal-compensation/1", "machine": "{}", "mode": "stock", "terms": [],
            "stock": {{"module": "{module}", {shift} "pins": {{"x-rot-point": {}, "y-rot-point": {}, "z-rot-point": {},
            "{letter}-offset": {}, "z-offset": 0.0, "tool-offset": 202.684}}}}}}"#,
        machine.name,
        d_tilting[0] + d_turning[0],
        d_tilting[1] + d_turning[1],
        -250.0 + d_tilting[2],
        -d_turning[across],
    );
    Compensation::parse(&source("c.json", text), machine).unwrap().0
}

#[test]
fn the_pins_of_the_stock_modules_take_offsets_out() {
    let cases = [
        (
            "trunnion",
            "xyzac-trt-kins",
            AxisName::A,
            "location-a",
            [("EY0A", 0.02), ("EZ0A", -0.03)],
            [0.0, 0.02, -0.03],
        ),
        (
            "swivel-table-b",
            "xyzbc-trt-kins",
            AxisName::B,
            "location-b",
            [("EX0B", 0.02), ("EZ0B", -0.03)],
            [0.02, 0.0, -0.03],
        ),
    ];
    for (name, module, tilting, effect, values, d_tilting) in cases {
        let machine = machine_named(name);
        let d_turning = [0.011, -0.013, 0.0];
        let scenario = Scenario::flawless()
            .with(&machine, effect, &values)
            .and_then(|s| s.with(&machine, "location-c", &[("EX0C", 0.011), ("EY0C", -0.013)]))
            .unwrap();
        let mut plan = empty_plan(&machine, "table");
        plan.controller_frame = crate::program::plan::ControllerFrame::Tcp;
        for (t, c) in [(0.0, 0.0), (35.0, 90.0), (-50.0, 211.0), (20.0, -75.0)] {
            for n in [[1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, 1.0]] {
                let at = pose(&[(tilting, t), (AxisName::C, c)]);
                add_touch(&mut plan, &machine, "x+", plus([30.0, 0.0, -202.684], 5.0, n), n, at);
            }
        }
        let moved = plus(d_tilting, 1.0, d_turning);
        // the block stands off with the table's centre, and nothing else is left
        let e = readings(&machine, &plan, &scenario, Some(&stock(&machine, module, d_tilting, d_turning, None)));
        e.iter().zip(&plan.touches).for_each(|(e, t)| close(*e, dot(t.normal, moved), 1e-12));
        // with the work offset touched off again there is nothing left at all
        let e = readings(&machine, &plan, &scenario, Some(&stock(&machine, module, d_tilting, d_turning, Some(moved))));
        e.iter().for_each(|e| close(*e, 0.0, 1e-12));
        // without the transformation the pins do not show
        plan.controller_frame = crate::program::plan::ControllerFrame::Axes;
        let pins = stock(&machine, module, d_tilting, d_turning, Some(moved));
        let (with, findings) = run(&machine, &plan, &scenario, Some(&pins)).unwrap();
        let without = run(&machine, &plan, &scenario, None).unwrap().0;
        assert_eq!(with, without);
        assert_eq!(findings.0[0].code, "simulate::frame");
    }
}

#[test]
fn zeros_and_home_offsets_bring_the_axis_where_it_was_meant() {
    let machine = machine_named("swivel-head");
    let scenario = Scenario::flawless()
        .with(&machine, "zero-b", &[("EB0B", 0.02)])
        .and_then(|s| s.with(&machine, "zero-c", &[("EC0C", -0.03)]))
        .unwrap();
    let component = compensation(&machine, &[term("B", "zero", "ry", 0.02), term("C", "zero", "rz", -0.03)].join(","));
    let stock = r#"{"format": "axiscal-compensation/1", "machine": "swivel-head", "mode": "stock",
        "stock": {"home_offset_deg": {"B": 0.02, "C": -0.03}}}"#;
    let (stock, _) = Compensation::parse(&source("c.json", stock), &machine).unwrap();
    let mut plan = empty_plan(&machine, "table");
    for n in [[1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, 1.0]] {
        let at = pose(&[(AxisName::B, -30.0), (AxisName::C, 50.0)]);
        add_touch(&mut plan, &machine, "x+", plus([30.0, 0.0, -202.684], 5.0, n), n, at);
    }
    for c in [&component, &stock] {
        readings(&machine, &plan, &scenario, Some(c)).iter().for_each(|e| close(*e, 0.0, 1e-12));
    }
}

#[test]
fn axis_tables_take_out_errors_of_the_axes_own_position() {
    let machine = machine_named("swivel-head");
    // the carried table stands 100 µm/m further in R: the tool stands less far over it, the command must grow
    let scenario = Scenario::flawless()
        .with(&machine, "scale-x", &[("EXX", 100.0)])
        .and_then(|s| s.with(&machine, "backlash-x", &[("backlash", 6.0)]))
        .unwrap();
    let text = r#"{"format": "axiscal-compensation/1", "machine": "swivel-head", "mode": "component", "terms": [],
        "stock": {"axis_tables": {"X": {"joint": 0, "file": "x.txt",
        "rows": [[-450, -0.042, -0.048], [450, 0.048, 0.042]]}}}}"#;
    let (tables, _) = Compensation::parse(&source("c.json", text), &machine).unwrap();
    let mut plan = empty_plan(&machine, "head");
    for (block, x, n) in [("x+", 35.0, 1.0), ("x+", 25.0, -1.0), ("x-", -35.0, -1.0)] {
        let at = pose(&[(AxisName::B, -30.0), (AxisName::C, 0.0)]);
        add_touch(&mut plan, &machine, block, [x, 0.0, -202.684], [n, 0.0, 0.0], at);
    }
    // what the tables leave is second order: the table is read at the commanded place
    readings(&machine, &plan, &scenario, Some(&tables)).iter().for_each(|e| close(*e, 0.0, 1e-5));
    assert!(readings(&machine, &plan, &scenario, None).iter().any(|e| e.abs() > 0.01));
    for rows in ["[]", "[[0, 0, 0], [0, 1, 1]]"] {
        let bad = text.replace("[[-450, -0.042, -0.048], [450, 0.048, 0.042]]", rows);
        assert!(Compensation::parse(&source("c.json", bad), &machine).is_err());
    }
}
