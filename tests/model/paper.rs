//! The paper's tables, digit by digit, and the sequence of its section "head, compensate, table, compensate".

use crate::common;
use axiscal::model::catalogue::Catalogue;
use axiscal::paper::tables::{Bench, GIVEN, all};
use axiscal::program;
use axiscal::simulate::Scenario;
use common::*;

fn without_path(machine: &axiscal::machine::Machine, name: &str) -> axiscal::program::plan::Plan {
    let spec = program::choose(program::built_in().unwrap(), name, machine).unwrap();
    program::plan_without_path(machine, &spec).unwrap()
}

#[test]
fn tables_have_the_golden_digits() {
    let catalogue = Catalogue::built_in().unwrap();
    let (head, double) = (machine("swivel-head"), machine("double-head"));
    let plans = [plan(&head, "head"), plan(&head, "table"), plan(&double, "double-head")];
    let bench = |machine, plan| Bench { machine, plan, catalogue: &catalogue };
    let tables = all(bench(&head, &plans[0]), bench(&head, &plans[1]), bench(&double, &plans[2])).unwrap();
    // the method, section 9, closed forms: table, set, mode, rows
    #[allow(clippy::type_complexity)]
    let golden: &[(&str, usize, Option<&str>, &[(&str, f64)])] = &[
        (
            "4-1",
            1,
            None,
            &[
                ("a_BZ", 0.015003489573),
                ("b_BZ", -0.009999126333),
                ("g_BZ", 0.019999999289),
                ("d_xBZ", 0.029984564731),
                ("d_yBZ", 0.025),
            ],
        ),
        (
            "4-1",
            2,
            None,
            &[
                ("a_BZ", 0.025005932944),
                ("b_BZ", 0.033984670260),
                ("g_BZ", -0.009999998189),
                ("d_xBZ", -0.040038773395),
                ("d_yBZ", -0.035),
            ],
        ),
        (
            "4-2",
            1,
            None,
            &[("a_CY", 0.015000000571), ("b_CY", -0.010000000102), ("d_xCY", 0.03), ("d_yCY", 0.024999997025)],
        ),
        (
            "4-2",
            2,
            None,
            &[("a_CY", 0.025000005988), ("b_CY", 0.034000003991), ("d_xCY", -0.04), ("d_yCY", -0.035000041269)],
        ),
        (
            "4-3",
            1,
            Some("R"),
            &[
                ("g_BA", 0.012013270),
                ("d_zBA", 0.010015435),
                ("a_BZ", 0.014992589),
                ("b_BZ", -0.009994270),
                ("g_BZ", 0.019988852),
                ("d_xBZ", 0.03),
                ("d_yBZ", 0.025035942),
                ("d_zBZ", -0.010005402),
            ],
        ),
        (
            "4-3",
            2,
            Some("R"),
            &[
                ("g_BA", -0.018002648),
                ("d_zBA", 0.023038769),
                ("a_BZ", 0.024993635),
                ("b_BZ", 0.033991773),
                ("g_BZ", -0.010008324),
                ("d_xBZ", -0.04),
                ("d_yBZ", -0.034966532),
                ("d_zBZ", 0.018016205),
            ],
        ),
        (
            "4-3",
            1,
            Some("T"),
            &[
                ("a_BA", 0.011983707),
                ("d_xBA", 0.010036444),
                ("a_BZ", 0.015009927),
                ("b_BZ", -0.009990573),
                ("g_BZ", 0.020004710),
                ("d_xBZ", 0.029963555),
                ("d_yBZ", 0.025038349),
                ("d_zBZ", -0.009972663),
            ],
        ),
        (
            "4-3",
            2,
            Some("T"),
            &[
                ("a_BA", -0.017998846),
                ("d_xBA", 0.023046254),
                ("a_BZ", 0.025003478),
                ("b_BZ", 0.033998776),
                ("g_BZ", -0.010004154),
                ("d_xBZ", -0.040046259),
                ("d_yBZ", -0.034999412),
                ("d_zBZ", 0.018023551),
            ],
        ),
        (
            "4-3",
            1,
            Some("F"),
            &[
                ("a_BA", 0.011999012),
                ("d_xBA", 0.010014819),
                ("a_BZ", 0.015004476),
                ("b_BZ", -0.009990573),
                ("g_BZ", 0.019999259),
                ("d_xBZ", 0.029985180),
                ("d_yBZ", 0.025003491),
                ("d_zBZ", -0.009994288),
            ],
        ),
        (
            "4-3",
            2,
            Some("F"),
            &[
                ("a_BA", -0.017998863),
                ("d_xBA", 0.023011125),
                ("a_BZ", 0.025004797),
                ("b_BZ", 0.033998776),
                ("g_BZ", -0.010002835),
                ("d_xBZ", -0.040011130),
                ("d_yBZ", -0.035004014),
                ("d_zBZ", 0.017988422),
            ],
        ),
    ];
    assert_eq!(tables.len(), golden.len());
    for (name, set, mode, rows) in golden {
        let table = tables.iter().find(|t| t.table == *name && t.set == *set && t.mode.as_deref() == *mode).unwrap();
        assert_eq!(table.rows.len(), rows.len(), "{name}");
        for (parameter, digits) in *rows {
            let row = table.rows.iter().find(|r| r.parameter == *parameter).unwrap();
            assert!(
                (row.closed_form - digits).abs() < 1e-9,
                "table {name} set {set} {mode:?} {parameter}: {:.12} instead of {digits}",
                row.closed_form
            );
            assert!(
                (row.least_squares - row.given).abs() < 1e-10,
                "table {name} set {set} {mode:?} {parameter}: {:.14}",
                row.least_squares
            );
            assert!(row.equals_print(), "{parameter} differs from the print at four decimals");
        }
    }
}

#[test]
fn the_unmodelled_pair_of_mode_f_comes_out_small() {
    // the two unknowns that are zero: g_BA 5.5e-6 / -1.3e-6 deg, d_zBA 2.2e-5 / 3.5e-5 mm
    let catalogue = Catalogue::built_in().unwrap();
    let machine = machine("double-head");
    let plan = without_path(&machine, "double-head");
    let bench = Bench { machine: &machine, plan: &plan, catalogue: &catalogue };
    for (g, expected) in GIVEN.iter().zip([(5.5e-6, 2.2e-5), (-1.3e-6, 3.5e-5)]) {
        let errors = [
            ("a_BZ", g[0]),
            ("b_BZ", g[1]),
            ("g_BZ", g[2]),
            ("d_xBZ", g[3]),
            ("d_yBZ", g[4]),
            ("d_zBZ", g[5]),
            ("a_BA", g[6]),
            ("d_xBA", g[7]),
        ];
        let readings = bench.readings(&bench.touch("paper-double-head", &errors).unwrap());
        let u = axiscal::paper::closed_form::double_head(
            &readings,
            machine.tool.length_mm,
            axiscal::paper::closed_form::Mode::F,
        )
        .unwrap();
        assert!((u.g_ba.to_degrees() - expected.0).abs() < 5e-8, "{:e}", u.g_ba.to_degrees());
        assert!((u.dz_ba - expected.1).abs() < 5e-7, "{:e}", u.dz_ba);
    }
}

#[test]
fn the_fourth_decimal_of_dx_depends_on_the_length() {
    // "set 2 fails the fourth decimal of d_xBZ for z_b > 261.4 mm (set 1: 656.6 mm)"
    let catalogue = Catalogue::built_in().unwrap();
    for (z_b, set, equal) in [(261.0, 1, true), (262.0, 1, false), (656.0, 0, true), (657.0, 0, false)] {
        let mut machine = machine("swivel-head");
        machine.tool.length_mm = z_b;
        let plan = without_path(&machine, "head");
        let bench = Bench { machine: &machine, plan: &plan, catalogue: &catalogue };
        let g = GIVEN[set];
        let errors = [("a_BZ", g[0]), ("b_BZ", g[1]), ("g_BZ", g[2]), ("d_xBZ", g[3]), ("d_yBZ", g[4])];
        let readings = bench.readings(&bench.touch("paper-head", &errors).unwrap());
        let [_, _, _, dx, _] = axiscal::paper::closed_form::head(&readings, z_b).unwrap();
        let four = |x: f64| (x * 1e4).round();
        assert_eq!(four(dx) == four(g[3]), equal, "z_b {z_b}: {dx}");
    }
}

#[test]
fn a_wrongly_set_up_block_spoils_the_closed_form_and_not_the_fit() {
    // the method, section 9: (0.1, -0.2, 0.05) mm and (0.05, -0.03, 0.1) deg about the centre
    let machine = machine("swivel-head");
    let plan = plan(&machine, "table");
    let catalogue = Catalogue::built_in().unwrap();
    let bench = Bench { machine: &machine, plan: &plan, catalogue: &catalogue };
    let expected = [[3.1e-5, 1.91e-4, 8.0e-4, -2.2e-4], [-3.1e-4, -7.2e-5, -1.7e-4, 1.36e-3]];
    for (g, off) in GIVEN.iter().zip(expected) {
        let errors = [("a_CY", g[0]), ("b_CY", g[1]), ("d_xCY", g[3]), ("d_yCY", g[4])];
        let tilt = [0.05f64, -0.03, 0.1].map(f64::to_radians);
        let scenario = Scenario::flawless().with(&machine, "paper-table", &errors).unwrap().with_block(
            "table",
            "x+",
            [0.1, -0.2, 0.05],
            tilt,
        );
        let touches = touch(&machine, &plan, &scenario, None);
        let [a, b, dx, dy] = axiscal::paper::closed_form::table(&bench.readings(&touches), 0.0).unwrap();
        let found = [a.to_degrees() - g[0], b.to_degrees() - g[1], dx - g[3], dy - g[4]];
        for (f, e) in found.iter().zip(off) {
            assert!((f - e).abs() < 0.02 * e.abs() + 6e-7, "{found:?} instead of {off:?}");
        }
        let fit = identify(&machine, &[(&plan, &touches)], &["paper-table", "block-setup"]);
        for (name, given) in errors {
            assert!((value(&fit, name) - given).abs() < 1e-10, "{name}: {}", value(&fit, name));
        }
    }
}

#[test]
fn without_compensating_the_head_the_table_is_wrong_by_the_heads_displacement() {
    // the method, section 8: d_xCY, d_yCY wrong by exactly -delta(0)
    let machine = machine("swivel-head");
    let plan = plan(&machine, "table");
    let catalogue = Catalogue::built_in().unwrap();
    let bench = Bench { machine: &machine, plan: &plan, catalogue: &catalogue };
    let expected = [[-0.0654, -0.0781], [0.1603, -0.0535]];
    for (g, wrong) in GIVEN.iter().zip(expected) {
        let scenario = Scenario::flawless()
            .with(
                &machine,
                "paper-head",
                &[("a_BZ", g[0]), ("b_BZ", g[1]), ("g_BZ", g[2]), ("d_xBZ", g[3]), ("d_yBZ", g[4])],
            )
            .unwrap()
            .with(&machine, "paper-table", &[("a_CY", g[0]), ("b_CY", g[1]), ("d_xCY", g[3]), ("d_yCY", g[4])])
            .unwrap();
        let touches = touch(&machine, &plan, &scenario, None);
        let [_, _, dx, dy] = axiscal::paper::closed_form::table(&bench.readings(&touches), 0.0).unwrap();
        assert!((dx - g[3] - wrong[0]).abs() < 1e-4, "{}", dx - g[3]);
        assert!((dy - g[4] - wrong[1]).abs() < 1e-4, "{}", dy - g[4]);
        // and the least squares over both B leave up to 0.04 … 0.12 mm, which the answer flags
        let fit = identify(&machine, &[(&plan, &touches)], &["paper-table"]);
        let largest = fit.residual_mm.iter().fold(0.0, |m: f64, r| m.max(r.abs()));
        println!("set with d_xCY {}: largest residual {largest} mm", g[3]);
        assert!((0.035..0.125).contains(&largest), "{largest}");
        assert!(
            fit.remarks.iter().any(|r| matches!(r, axiscal::fit::Remark::Misfit { .. })),
            "{:?}",
            fit.outcome.warnings
        );
    }
}

/// The method, section 7: which poses of the two-axis head tell all ten unknowns, and what is left without a trace where
/// they do not (blocks where the plan says).
#[test]
fn ranks_and_null_vectors_of_the_two_axis_head() {
    use axiscal::axes::AxisName;
    use axiscal::fit::observe_plan;
    use axiscal::model::data::{Run, assemble};
    let machine = machine("double-head");
    let catalogue = Catalogue::built_in().unwrap();
    let whole = plan(&machine, "double-head");
    let radius_mm = (machine.reference.pivot - machine.reference.ball).norm();
    let observed = |left_out: &[(f64, f64)]| {
        let mut plan = whole.clone();
        plan.touches.retain(|t| {
            let at = |a| t.pose.get(a).unwrap_or(0.0);
            !left_out.iter().any(|(b, a)| (at(AxisName::B) - b).abs() < 1e-9 && (at(AxisName::A) - a).abs() < 1e-9)
        });
        let touches = touch(&machine, &plan, &Scenario::flawless(), None);
        let run = Run { plan: &plan, touches: &touches, mounting: None, started_s: None };
        let data = assemble(&machine, &[run]);
        let of = |effect: &str| observe_plan(&machine, &catalogue, &data, &[effect.to_owned()]).unwrap();
        assert_eq!(of("paper-double-head").1.rank, 8, "{left_out:?}");
        of("double-head-10")
    };
    // the null vector in rad and in radii, its largest part 1
    let null = |left_out: &[(f64, f64)]| {
        let (model, seen) = observed(left_out);
        assert_eq!((seen.rank, seen.unseen.len()), (9, 1), "{left_out:?}");
        let amount = |c: usize| {
            let x = seen.unseen[0][c] / seen.scale[c];
            if model.unknowns[c].unit == "mm" { x / radius_mm } else { x.to_radians() }
        };
        let largest = (0..model.n_unknowns()).map(amount).fold(0.0, |m: f64, x| if x.abs() > m.abs() { x } else { m });
        let of = |symbol: &str| {
            let c = model.unknowns.iter().position(|u| u.alias.as_deref() == Some(symbol)).unwrap();
            amount(c) / largest
        };
        let all = ["a_BZ", "b_BZ", "g_BZ", "d_xBZ", "d_yBZ", "d_zBZ", "a_BA", "g_BA", "d_xBA", "d_zBA"];
        all.map(|symbol| (symbol, of(symbol)))
    };
    assert_eq!(observed(&[]).1.rank, 10);
    for (left_out, parts) in [
        // as printed, A to one side only: b_BZ : d_xBA/R : g_BA = 1 : 1 : -1
        ((0.0, 90.0), &["b_BZ", "d_xBA", "g_BA"][..]),
        // without B = -30: a_BZ, g_BZ, -a_BA, -g_BA in equal parts
        ((-30.0, 0.0), &["a_BZ", "g_BZ", "a_BA", "g_BA"]),
    ] {
        let vector = null(&[left_out]);
        println!("without {left_out:?}: {vector:?}");
        for (symbol, part) in vector {
            let expected = if parts.contains(&symbol) { 1.0 } else { 0.0 };
            assert!((part.abs() - expected).abs() < 1e-6, "{symbol}: {vector:?}");
        }
        let of = |symbol: &str| vector.iter().find(|v| v.0 == symbol).unwrap().1;
        assert!(of(parts[0]) * of(parts[1]) > 0.0, "{vector:?}");
        assert!(parts[2..].iter().all(|p| of(p) * of(parts[0]) < 0.0), "{vector:?}");
    }
}
