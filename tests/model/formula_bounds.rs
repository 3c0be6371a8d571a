//! No formula ends the process, and none within the bounds takes long: neither its reading, nor its derivatives, nor a fit.

use crate::common;
use axiscal::diag::source;
use axiscal::model::catalogue::Catalogue;
use axiscal::model::formula::{Formula, State, VARIABLES};
use common::verbs;
use std::time::{Duration, Instant};

fn repeated(part: &str, times: usize, between: &str) -> String {
    vec![part; times].join(between)
}

/// Formulas with a shape parameter `s` that a symbolic derivative makes many times as long.
fn heavy() -> Vec<String> {
    vec![
        format!("X{}", "*s".repeat(18)),
        format!("X{}", "*s".repeat(900)),
        format!("{}s", "s^".repeat(64)),
        format!("{}s{}", "sin(".repeat(64), ")".repeat(64)),
        repeated("cos(Y/s)", 24, "+"),
        repeated("cos(Y/s)", 120, "+"),
        repeated("cos(Y/s)", 120, "*"),
        repeated("(X/s)^2", 200, "/"),
        format!("{}s{}", "(1+s*".repeat(64), ")".repeat(64)),
        "-".repeat(998) + "s",
    ]
}

fn state() -> State {
    std::array::from_fn(|i| 0.31 + 0.017 * i as f64)
}

#[test]
fn heavy_formulas_are_read_and_differentiated_at_once() {
    for text in heavy() {
        let begun = Instant::now();
        let formula = Formula::parse(&text, &["s"]).unwrap_or_else(|e| panic!("{text}: {e}"));
        let at = |s: f64| formula.eval(&state(), &[s]);
        let s = 1.1;
        let (_, slope) = formula.partials(&state(), &[s]).next().unwrap();
        let h = 1e-6;
        let difference = (at(s + h) - at(s - h)) / (2.0 * h);
        let close = (slope - difference).abs() <= 1e-5 * slope.abs().max(1e-3);
        assert!(close || !difference.is_finite(), "{text}: {slope} {difference}");
        // a thousand touches
        for _ in 0..1000 {
            formula.partials(&state(), &[s]).for_each(drop);
        }
        let time = begun.elapsed();
        assert!(time < Duration::from_secs(2), "{text}: {time:?}");
    }
}

#[test]
fn derivatives_are_exact() {
    let state = state();
    let x = state[VARIABLES.iter().position(|v| *v == "X").unwrap()];
    let s = 0.7;
    for (text, expected) in [
        ("X*s", x),
        ("X*s*s*s", 3.0 * x * s * s),
        ("X/s", -x / (s * s)),
        ("-s^2", -2.0 * s),
        ("2^s", 2f64.powf(s) * 2f64.ln()),
        ("s^s", s.powf(s) * (s.ln() + 1.0)),
        ("exp(-X/s)", (-x / s).exp() * x / (s * s)),
        ("atan2(X, s)", -x / (x * x + s * s)),
        ("abs(X - s)", 1.0),
        ("mod(X, s) + step(X - s) + floor(s) + sign(s)", 0.0),
        ("sin(2*pi*X/s)", -(2.0 * std::f64::consts::PI * x / s).cos() * 2.0 * std::f64::consts::PI * x / (s * s)),
    ] {
        let formula = Formula::parse(text, &["s"]).unwrap();
        let slopes: Vec<(usize, f64)> = formula.partials(&state, &[s]).collect();
        assert_eq!(slopes.len(), 1, "{text}");
        let slope = slopes[0].1;
        assert!((slope - expected).abs() <= 1e-12 * expected.abs().max(1.0), "{text}: {slope} {expected}");
    }
}

fn file(formula: &str, shapes: &[String]) -> String {
    let shape =
        |name: &String| format!("{{ parameter = \"{name}\", unit = \"mm\", start = 0.9, min = 0.5, max = 1.5 }}");
    let shapes: Vec<String> = shapes.iter().map(shape).collect();
    format!(
        "format = \"axiscal-effects/1\"\n[[effect]]\nid = \"my-a\"\nat = \"X\"\nterms = [ {{ parameter = \"p\", unit = \"um\", dof = \
         \"dx\", formula = \"{formula}\" }} ]\nshape = [ {} ]\n",
        shapes.join(", ")
    )
}

#[test]
fn what_is_beyond_a_bound_is_refused_with_its_place() {
    let one = || vec!["s".to_owned()];
    let many: Vec<String> = (1..=9).map(|i| format!("s{i}")).collect();
    for (formula, shapes, code, place) in [
        ("(".repeat(65) + "s" + &")".repeat(65), one(), "effects::formula", "w.toml:5:"),
        ("s^".repeat(100) + "s", one(), "effects::formula", "w.toml:5:"),
        (repeated("s", 1002, "+"), one(), "effects::formula", "w.toml:5:"),
        (many.join("*"), many.clone(), "effects::shape", "w.toml:6:"),
    ] {
        let failure = Catalogue::default().add_file(&source("w.toml", file(&formula, &shapes))).unwrap_err();
        let found = &failure.0[0];
        assert_eq!(found.code, code, "{formula}: {found:?}");
        assert!(found.place().unwrap().starts_with(place) && found.help.is_some(), "{formula}: {found:?}");
    }
    // the deepest bracket itself
    let text = file(&("(".repeat(65) + "s" + &")".repeat(65)), &one());
    let failure = Catalogue::default().add_file(&source("w.toml", &text)).unwrap_err();
    let column = text.lines().nth(4).unwrap().find("((").unwrap() + 65;
    assert_eq!(failure.0[0].place().unwrap(), format!("w.toml:5:{column}"));
    // eight are read
    let eight = &many[..8];
    Catalogue::default().add_file(&source("w.toml", file(&eight.join("*"), eight))).unwrap();
}

#[test]
fn every_verb_ends_with_an_answer() {
    let folder =
        verbs::folder(&["table"], "seed = 3\n[effects.paper-table]\nd_xCY = 0.03\n[noise]\ntouch_um = 0.5\n", None);
    let at = folder.path();
    let study = std::fs::read_to_string(at.join("study.toml")).unwrap();
    std::fs::write(at.join("study.toml"), format!("effects_file = [\"fx.toml\"]\n{study}")).unwrap();
    for formula in [format!("X{}", "*s".repeat(100)), repeated("cos(Y/s)", 120, "+")] {
        std::fs::write(at.join("fx.toml"), file(&formula, &["s".to_owned()])).unwrap();
        let begun = Instant::now();
        let (_, code) = verbs::json(at, &["add", "study.toml", "my-a", "--dry-run"]);
        assert!(code < 3, "add ends with {code}");
        for verb in ["identify", "diagnose"] {
            let (_, code) = verbs::json(at, &[verb, "study.toml"]);
            assert!(code < 3, "{verb} ends with {code}");
        }
        let time = begun.elapsed();
        assert!(time < Duration::from_secs(60), "{formula}: {time:?}");
    }
    std::fs::write(at.join("fx.toml"), file(&("s^".repeat(100) + "s"), &["s".to_owned()])).unwrap();
    for verb in ["identify", "diagnose", "report"] {
        let (answer, code) = verbs::json(at, &[verb, "study.toml"]);
        let finding = &answer["findings"][0];
        assert_eq!(
            (code, &finding["code"], &finding["line"]),
            (2, &"effects::formula".into(), &5.into()),
            "{verb}: {answer}"
        );
    }
}
