//! Scenarios as they are written: what is understood, and what is refused with place and remedy.

use super::super::scenario::{self, parse_text};
use super::*;
use proptest::prelude::*;

const FULL: &str = r#"
seed = 7
[effects.paper-head]
a_BZ = 0.015
EX0B = 0.03
[effects.location-c]
E_XOC = 0.012
[effects.pretravel]
pretravel = { value = 5, unit = "um" }
[[block]]
mounting = "head"
name = "x-"
shift = [0.1, -0.2, 0.05]
tilt = [0.05, -0.03, 0.1]
[[harmonic]]
axis = "C"
dof = "dx"
k = 1
cos_um = 5.0
sin_um = 0.0
[noise]
touch_um = 1.0
visit_um = 0
[time]
started_s = 3600
[temperature]
profile = [[0, 20.0], [2.0, 23.0]]
"#;

#[test]
fn a_full_scenario_is_read() {
    let machine = machine_named("swivel-head");
    let scenario = parse_text(FULL, &machine).unwrap();
    assert_eq!(scenario.seed, 7);
    assert_eq!(scenario.noise.touch_mm, 1e-3);
    let names: Vec<(&str, f64)> = scenario.planted.iter().map(|p| (p.parameter.as_str(), p.value)).collect();
    assert_eq!(names, [("EA0B", 0.015), ("EX0B", 0.03), ("EX0C", 0.012), ("pretravel", 5.0)]);
    assert_eq!(scenario.blocks[0].shift_mm, [0.1, -0.2, 0.05]);
    assert_eq!(scenario.temperature_at(1.0), Some(21.5));
    assert_eq!(scenario.temperature_at(-1.0), Some(20.0));
    assert_eq!(scenario.temperature_at(9.0), Some(23.0));
}

#[test]
fn what_is_wrong_is_said_with_place_and_remedy() {
    let machine = machine_named("swivel-head");
    let cases = [
        ("[effects.papr-head]\na_BZ = 1", "scenario::effect", "s.toml:1:10"),
        ("[effects.paper-head]\nq_BZ = 1", "scenario::parameter", "s.toml:2:1"),
        ("[effects.paper-head]\na_BZ = 1\nEA0B = 1", "scenario::parameter_twice", "s.toml:3:1"),
        ("[effects.paper-head]\na_BZ = nan", "scenario::value", "s.toml:2:8"),
        ("[effects.paper-head]\na_BZ = \"1\"", "scenario::value", "s.toml:2:8"),
        ("[effects.paper-head]\na_BZ = { value = 1, unit = \"um\" }", "scenario::unit", "s.toml:2:1"),
        ("[effects.paper-head]\na_BZ = { value = 1, unit = \"furlong\" }", "scenario::unit", "s.toml:2:28"),
        ("[effects.location-a]\nEY0A = 1", "scenario::effect_not_here", "s.toml:1:10"),
        ("[effects.paper-double-head]\na_BA = 1", "scenario::effect_not_here", "s.toml:1:10"),
        ("[effects.block-setup]\n", "scenario::block_setup", "s.toml:1:10"),
        ("[effects.block-slip]\ndx = 1", "scenario::effect_not_here", "s.toml:1:10"),
        ("[effects.warm-up]\nwx = 1\ntau = 0", "scenario::setting", "s.toml:3:1"),
        ("[noise]\ntouch_um = -1", "scenario::negative", "s.toml:2:12"),
        ("[noise]\noutlier_share = 2", "scenario::range", "s.toml:2:17"),
        ("[noise]\ntouch_um = 1e300", "scenario::range", "s.toml:2:12"),
        ("[time]\nstarted_s = -5", "scenario::range", "s.toml:2:13"),
        ("[time]\nfirst_touch_s = 1e300", "scenario::range", "s.toml:2:17"),
        ("[temperature]\nconstant_degC = -300", "scenario::range", "s.toml:2:17"),
        ("[[block]]\nmounting = \"head\"\nname = \"x-\"\nshift = [1e9, 0, 0]", "scenario::range", "s.toml:4:10"),
        ("[noise]\ntuch_um = 1", "scenario::unknown", "s.toml:2:1"),
        ("noise = 1", "scenario::table", "s.toml:1:9"),
        ("sed = 1", "scenario::unknown", "s.toml:1:1"),
        ("seed = -1", "scenario::seed", "s.toml:1:8"),
        ("[[block]]\nname = \"x-\"", "scenario::which_block", "s.toml:1:1"),
        ("[[block]]\nmounting = \"haed\"\nname = \"x-\"", "scenario::mounting", "s.toml:2:12"),
        ("[[block]]\nmounting = \"head\"\nname = \"q\"", "scenario::block", "s.toml:3:8"),
        ("[[block]]\nmounting = \"head\"\nname = \"x-\"\nshift = [1, 2]", "scenario::three", "s.toml:4:9"),
        ("[[harmonic]]\naxis = \"X\"\ndof = \"dx\"\ncos_um = 1", "scenario::axis", "s.toml:2:8"),
        ("[[harmonic]]\naxis = \"C\"\ndof = \"rx\"\ncos_um = 1", "scenario::harmonic", "s.toml:1:1"),
        ("[temperature]\nprofile = [[1, 20], [0, 20]]", "scenario::profile", "s.toml:2:22"),
        ("seed = ", "scenario::not_toml", "s.toml:1:8"),
    ];
    for (text, code, place) in cases {
        let failure = scenario::parse(&source("s.toml", text), &machine).unwrap_err();
        let found: Vec<(&str, Option<String>)> = failure.0.iter().map(|f| (f.code, f.place())).collect();
        assert!(found.contains(&(code, Some(place.to_owned()))), "{text}: {found:?}");
        assert!(failure.0.iter().all(|f| f.help.is_some()), "{text}");
    }
}

#[test]
fn an_unknown_effect_is_answered_with_the_nearest_names() {
    let machine = machine_named("swivel-head");
    let failure = parse_text("[effects.papr-haed]\na_BZ = 1", &machine).unwrap_err();
    let help = failure.0[0].help.clone().unwrap();
    assert!(help.starts_with("did you mean paper-head"), "{help}");
    assert_eq!(help.matches(", ").count(), 9, "{help}");
}

#[test]
fn all_findings_come_at_once() {
    let machine = machine_named("swivel-head");
    let text = "sed = 1\n[noise]\ntouch_um = -1\n[effects.nothing]\n";
    let failure = scenario::parse(&source("s.toml", text), &machine).unwrap_err();
    let codes: Vec<&str> = failure.0.iter().map(|f| f.code).collect();
    assert_eq!(codes, ["scenario::unknown", "scenario::negative", "scenario::effect"]);
}

proptest! {
    #[test]
    fn no_text_makes_it_panic(text in "[\\[\\]a-z=\\.\"{}0-9 \n,-]{0,80}") {
        let machine = machine_named("swivel-head");
        let _ = parse_text(&text, &machine);
        let _ = parse_text(&format!("[effects.{text}"), &machine);
        let _ = parse_text(&format!("{FULL}{text}"), &machine);
    }
}
