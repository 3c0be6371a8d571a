//! Controllers as a user's file changes them, and machines as a user has them: inches, axes with other names or without
//! ends, an origin of R elsewhere, probing packages, few labels.

use crate::controllers::{CONTROLLERS, controller, generated, holds_to_the_rules, machine, programs, variant, written};
use axiscal::diag::source;
use axiscal::machine;
use axiscal::post::Postprocessor;
use std::collections::BTreeMap;

/// The axis words of the straight moves of a program, in order.
fn words(text: &str, axis: char) -> Vec<f64> {
    let code = |l: &&str| !l.contains(['(', ';', '"', '*']) && !l.contains("SYSREAD") && !l.contains("TCH");
    let named = text
        .lines()
        .filter(code)
        .flat_map(|l| l.split_whitespace())
        .filter_map(|w| w.strip_prefix(axis)?.trim_start_matches('=').parse().ok());
    // what routines are given: X, Y, Z in this order, B and C of a turn, or a parameter for each of the three
    let given = |line: &str| -> Option<f64> {
        let place = "XYZ".find(axis);
        let argument =
            |rest: &str, at: usize| rest.split(['[', ']', ',', ' ']).filter(|w| !w.is_empty()).nth(at)?.parse().ok();
        let linear = ["o<rapid> call ", "o<guarded> call "].iter().find_map(|begins| line.strip_prefix(begins));
        if let Some((rest, place)) = linear.zip(place) {
            return argument(rest, place);
        }
        if let Some((rest, place)) = line.strip_prefix("o<turn> call ").zip("BC".find(axis)) {
            return argument(rest, place);
        }
        if let Some(((_, rest), place)) = line.strip_prefix("AXC_GUARDED(").and_then(|l| l.rsplit_once('"')).zip(place)
        {
            return argument(rest, place);
        }
        let (_, rest) = line.split_once("FN 0: Q165")?;
        rest.strip_prefix(&format!("{} = ", place? + 1))?.trim().parse().ok()
    };
    named.chain(text.lines().filter_map(given)).collect()
}

#[test]
fn a_machine_in_inches_gets_inches_everywhere() {
    let machine = machine("swivel-head");
    let generated = generated(&machine, "head", false);
    for (base, word) in [
        ("sinumerik", "G700"),
        ("fanuc", "G20"),
        ("haas", "G20"),
        ("heidenhain", "BEGIN PGM HEAD INCH"),
        ("linuxcnc", "G20"),
    ] {
        let metric = written(&controller(base), &machine, &generated);
        let lines = "[number]\ndecimals = 5\nunverified = \"an inch machine of ours\"\n[log]\nunit = \"inch\"\ndecimals = 5\nunverified = \"an inch machine of ours\"\n";
        let post = variant(base, lines);
        let inch = written(&post, &machine, &generated);
        holds_to_the_rules(&post, &inch, base);
        assert!(inch.text.contains(word) && !metric.text.contains(word), "{base}");
        let head = inch.text.to_owned() + &inch.beside.iter().map(|f| f.text.clone()).collect::<String>();
        assert!(head.replace('*', " ").contains(" INCH N202 U"), "{base}");
        for axis in ['X', 'Y', 'Z', 'B', 'C'] {
            let (mm, inch) = (words(&metric.text, axis), words(&inch.text, axis));
            assert!(mm.len() == inch.len() && !mm.is_empty(), "{base} {axis}: {} {}", mm.len(), inch.len());
            let unit = if "XYZ".contains(axis) { 25.4 } else { 1.0 };
            for (mm, inch) in mm.iter().zip(&inch) {
                assert!((mm - inch * unit).abs() < 1e-3, "{base} {axis}: {mm} mm, {inch}");
            }
        }
        // feeds, tolerances and settings too: 1500 mm/min, 300 mm/min, 1 mm
        assert!(["59.05512", "11.81102", "0.03937"].iter().all(|number| head.contains(number)), "{base}");
    }
}

#[test]
fn modulo_axes_are_told_their_sense() {
    let machine = machine("swivel-head");
    let generated = generated(&machine, "table", false);
    for (base, forward, back) in
        [("sinumerik", "C=ACP(", "C=ACN("), ("fanuc", "G0 C90.", "G0 C-"), ("heidenhain", "L IC+", "L IC-")]
    {
        let post = variant(base, "[settings]\nmodulo = \"C\"\n");
        let nc = written(&post, &machine, &generated);
        holds_to_the_rules(&post, &nc, base);
        assert!(nc.text.contains(forward) && nc.text.contains(back), "{base}");
    }
}

#[test]
fn axes_have_the_control_s_own_names_and_numbers() {
    let machine = machine("swivel-head");
    let generated = generated(&machine, "head", false);
    let post = variant("sinumerik", "[number]\naxis_names = { C = \"C1\", B = \"B1\" }\nsource = \"our machine\"\n");
    let text = programs(&post, &written(&post, &machine, &generated)).concat();
    assert!(text.contains("G0 SUPA C1=0") && text.contains("$AA_IM[B1]") && !text.contains("$AA_IM[B]"));
    let post = variant("fanuc", "[number]\naxis_numbers = { C = 6 }\nsource = \"our machine\"\n");
    let text = programs(&post, &written(&post, &machine, &generated)).concat();
    assert!(text.contains("=#5066") && text.contains("=#5046-#5026") && text.contains("=#5064"));
}

#[test]
fn machine_coordinates_hold_the_origin_of_r() {
    let text = machine::BUILT_IN.replacen(
        "origin = { X = 0.0, Y = 0.0, Z = 0.0",
        "origin = { X = 100.0, Y = -50.0, Z = 0.0",
        1,
    );
    let (machines, _) = machine::load(&source("machines", text)).unwrap();
    let machine = machines.into_iter().find(|m| m.name == "swivel-head").unwrap();
    let generated = generated(&machine, "head", false);
    for (name, first, touch) in [
        ("sinumerik", "G0 SUPA X=67\n", "AXT_PX=$AA_MM[X]-(100)\n"),
        ("heidenhain", "L X+67 R0 FMAX M91", "Q1621 = Q1601 - 100\n"),
        ("fanuc", "G0 X-33.\n", "#27=#5041-#5021+[100.]\n#28=#5042-#5022+[-50.]\n#29=#5043-#5023\n"),
    ] {
        let post = controller(name);
        let text = programs(&post, &written(&post, &machine, &generated)).concat();
        assert!(text.contains(first) && text.contains(touch), "{name}");
    }
}

/// Between two steps of a control the origin of R cannot be named: that is said, with the place next to it, which then serves.
#[test]
fn an_origin_between_the_steps_of_a_control_is_named() {
    let inch = "[number]\ndecimals = 4\nsource = \"ours\"\n[log]\nunit = \"inch\"\ndecimals = 4\nsource = \"ours\"\n";
    let with = |origin: &str| {
        let text =
            machine::BUILT_IN.replace("origin = { X = 0.0, Y = 0.0, Z = 0.0, A", &format!("origin = {{ {origin}, A"));
        let (machines, _) = machine::load(&source("machines", &text)).unwrap();
        machines.into_iter().find(|m| m.name == "trunnion").unwrap()
    };
    for (post, origin, nearest) in [
        (controller("fanuc"), "X = 1.1234, Y = 0.5, Z = 0.0", "X = 1.123"),
        (variant("fanuc", inch), "X = 0.1, Y = 0.5, Z = 0.254", "X = 0.09906, Y = 0.50038"),
    ] {
        let machine = with(origin);
        let generated = generated(&machine, "basic", false);
        let failure = post.program(&machine, &generated.plan, &generated.path).unwrap_err();
        assert_eq!(failure.0[0].code, "post::origin", "{failure}");
        assert!(failure.0[0].help.as_deref().unwrap().ends_with(nearest), "{failure}");
        let machine = with(&if post.number.decimals == 4 {
            format!("{nearest}, Z = 0.254")
        } else {
            format!("{nearest}, Y = 0.5, Z = 0.0")
        });
        written(&post, &machine, &generated);
    }
}

/// An origin of many digits in every axis makes no line that a control would not take.
#[test]
fn an_origin_of_many_digits_fits_the_lines() {
    let origin = "origin = { X = -1350.125, Y = -1412.625, Z = -1287.315, ";
    let text = machine::BUILT_IN.replace("origin = { X = 0.0, Y = 0.0, Z = 0.0, ", origin);
    assert!(text.matches(origin).count() >= 3);
    // the ends of the axes stand in machine coordinates
    let mut by = 0.0;
    let ends = |line: &str, by: f64| -> Option<String> {
        let (low, high) = line.strip_prefix("range = [")?.split_once(']')?.0.split_once(',')?;
        let shifted = |end: &str| end.trim().parse::<f64>().map(|v| format!("{:.3}", v + by)).unwrap();
        Some(format!("range = [{}, {}]\n", shifted(low), shifted(high)))
    };
    let mut moved = String::new();
    for line in text.lines() {
        if let Some(name) = line.strip_prefix("name = \"") {
            by = ["X\"", "Y\"", "Z\""]
                .iter()
                .position(|n| name.starts_with(n))
                .map_or(0.0, |i| [-1350.125, -1412.625, -1287.315][i]);
        }
        moved += &ends(line, by).unwrap_or_else(|| format!("{line}\n"));
    }
    let (machines, _) = machine::load(&source("machines", &moved)).unwrap();
    for (name, program) in
        [("swivel-head", "head"), ("trunnion", "basic"), ("double-head", "double-head"), ("nutating-b", "basic")]
    {
        let machine = machines.iter().find(|m| m.name == name).unwrap();
        for tcp in [false, true] {
            let generated = generated(machine, program, tcp);
            for control in ["sinumerik", "heidenhain", "fanuc", "haas", "linuxcnc"] {
                let post = controller(control);
                if let Err(why) = post.program(machine, &generated.plan, &generated.path) {
                    assert_ne!(why.0[0].code, "post::line_length", "{control} {name} {tcp}: {why}");
                }
            }
        }
    }
}

#[test]
fn a_probing_package_is_a_file_of_a_few_lines() {
    let machine = machine("swivel-head");
    let generated = generated(&machine, "head", false);
    for (name, base) in [("fanuc-inspection-plus", "fanuc"), ("haas-inspection-plus", "haas")] {
        let (post, base) = (controller(name), controller(base));
        assert!(post.text.lines().count() < 40 && post.based_on.as_deref() == Some(base.name.as_str()));
        let nc = written(&post, &machine, &generated);
        assert!(
            nc.text.contains("G65 P9832") && nc.text.contains("G65 P9833") && nc.text.contains("G65 P9810 Z10. F1500.")
        );
        assert_eq!(post.log.decimals, base.log.decimals);
    }
}

#[test]
fn labels_that_run_out_are_said() {
    let machine = machine("swivel-head");
    let generated = generated(&machine, "head", false);
    let post = variant("fanuc", "[file]\nlast_label = 60\nsource = \"a small control\"\n");
    let failure = post.program(&machine, &generated.plan, &generated.path).unwrap_err();
    assert_eq!(failure.0[0].code, "post::labels");
}

#[test]
fn controllers_say_what_they_are_based_on_and_what_stands_beside() {
    let beside: BTreeMap<&str, usize> = CONTROLLERS.iter().map(|c| (*c, controller(c).companions.len())).collect();
    assert_eq!((beside["heidenhain"], beside["fanuc"], beside["sinumerik"], beside["linuxcnc"]), (7, 3, 3, 0));
    assert!(Postprocessor::built_in().unwrap().len() == CONTROLLERS.len());
}
