use crate::axes::AxisName;
use crate::diag::source;

#[test]
fn each_built_in_machine_is_the_same_by_its_own_table() {
    let (machines, _) = super::load(&source("machines.toml", crate::machine::BUILT_IN)).unwrap();
    assert!(machines.len() > 3);
    for machine in machines {
        let alone = crate::machine::built_in(&machine.name).unwrap().unwrap();
        assert_eq!(format!("{alone:?}"), format!("{machine:?}"));
    }
    assert!(crate::machine::built_in("nobody").unwrap().is_none());
}

#[test]
fn the_built_in_machines_are_good() {
    let (machines, findings) = super::load(&source("machines.toml", crate::machine::BUILT_IN)).unwrap();
    assert_eq!(machines.len(), 6);
    assert!(findings.0.is_empty());
}

#[test]
fn an_indexing_that_is_not_stated_is_not_perfect() {
    let text = crate::machine::BUILT_IN.replace("indexing_repeatability_um = 0.5", "");
    let (machines, findings) = super::load(&source("machines.toml", text)).unwrap();
    // said once for each machine
    assert_eq!(findings.0.len(), machines.len());
    assert!(findings.0.iter().all(|f| f.severity == crate::diag::Severity::Info));
    for machine in &machines {
        let rotary: Vec<AxisName> = machine.rotary().map(|a| a.name).collect();
        assert!(rotary.iter().all(|name| machine.assumed_indexing.contains(name)));
        assert!(machine.rotary().all(|a| a.indexing_repeatability_mm == 0.0005));
    }
    let text = crate::machine::BUILT_IN.replace("indexing_repeatability_um = 0.5", "indexing_repeatability_um = 0");
    let (machines, findings) = super::load(&source("machines.toml", text)).unwrap();
    assert!(findings.0.is_empty() && machines[0].rotary().all(|a| a.indexing_repeatability_mm == 0.0));
}

#[test]
fn a_range_is_written_in_machine_coordinates_and_kept_relative_to_r() {
    let text = crate::machine::BUILT_IN.replacen("origin = { X = 0.0", "origin = { X = 100.0", 1);
    let (machines, _) = super::load(&source("machines.toml", text)).unwrap();
    assert_eq!(machines[0].axis(AxisName::X).unwrap().range, [-550.0, 350.0]);
}

/// The errors of a rotary axis are named by its letter: B along X and Z would have none about its own inclination.
#[test]
fn a_letter_that_does_not_fit_its_direction_is_refused() {
    let of = |direction: &str| {
        let b = crate::machine::BUILT_IN.find("name = \"B\"").unwrap();
        let (before, after) = crate::machine::BUILT_IN.split_at(b);
        let after = after.replacen("direction = [0.0, 1.0, 0.0]", &format!("direction = {direction}"), 1);
        match super::load(&source("m.toml", format!("{before}{after}"))) {
            Ok((_, findings)) => findings.0.iter().map(|f| f.code).collect::<Vec<_>>(),
            Err(failure) => failure.0.iter().map(|f| f.code).collect(),
        }
    };
    assert_eq!(of("[1.0, 0.0, 1.0]"), ["machine::letter"]);
    assert_eq!(of("[1.0, 0.0, 0.0]"), ["machine::letter"]);
    for fits in ["[0.0, 1.0, 1.0]", "[0.0, -1.0, 0.0]", "[0.7, 0.8, 0.0]"] {
        assert!(!of(fits).contains(&"machine::letter"), "{fits}");
    }
}

/// Codes of what is wrong with the built-in machines when `from` is written as `to`, once.
fn codes(from: &str, to: &str) -> Vec<&'static str> {
    let text = crate::machine::BUILT_IN.replacen(from, to, 1);
    assert_ne!(text, crate::machine::BUILT_IN, "{from}");
    match super::load(&source("m.toml", text)) {
        Ok((_, findings)) => findings.0.iter().map(|f| f.code).collect(),
        Err(failure) => failure.0.iter().map(|f| f.code).collect(),
    }
}

#[test]
fn one_slip_is_one_finding() {
    let range = "range = [-450.0, 450.0]";
    let cases = [
        (range, "range = [-1e300, 1e300]", "machine::too_large"),
        (range, "range = [450.0, -450.0]", "machine::range"),
        ("direction = [1.0, 0.0, 0.0]", "direction = [0.0, 0.0, 0.0]", "machine::zero_direction"),
        ("direction = [1.0, 0.0, 0.0]", "direction = [1.0, 0.005, 0.0]", "machine::not_square"),
        ("origin = { X = 0.0", "origin = { X = 1e7", "machine::too_large"),
        ("pivot = [0.0, 0.0, 0.0]", "pivot = [1e7, 0.0, 0.0]", "machine::too_large"),
        ("indexing_repeatability_um = 0.5", "indexing_repeatability_um = 1e9", "machine::repeatability"),
        ("indexing_repeatability_um = 0.5", "indexing_repeatability_um = -0.5", "machine::repeatability"),
        ("indexing_repeatability_um = 0.5", "", "machine::assumed_indexing"),
        ("carrier = \"table\"\nriser", "carrier = \"base\"\nriser", "machine::block_carrier"),
    ];
    for (from, to, code) in cases {
        assert_eq!(codes(from, to), [code], "{to}");
    }
}

#[test]
fn linear_axes_go_along_their_letters_and_are_right_handed() {
    let message = |from: &str, to: &str| {
        let text = crate::machine::BUILT_IN.replacen(from, to, 1);
        let (_, findings) = super::load(&source("m.toml", text)).unwrap();
        let codes: Vec<&str> = findings.0.iter().map(|f| f.code).collect();
        assert_eq!(codes, ["machine::not_along_r"], "{to}");
        findings.0[0].message.clone()
    };
    let axis = |letter: &str, parent: &str, direction: &str| {
        format!("name = \"{letter}\"\nparent = \"{parent}\"\nkind = \"linear\"\ndirection = {direction}")
    };
    let x = axis("X", "base", "[1.0, 0.0, 0.0]");
    let mirrored = message(&x, &axis("X", "base", "[-1.0, 0.0, 0.0]"));
    assert!(mirrored.ends_with("(X is [-1.00, 0.00, 0.00]), and left-handed"), "{mirrored}");
    // turned by 90 degrees about Z: right-handed, and X is along Y
    let text = crate::machine::BUILT_IN;
    let (from, y) = (text.find(&x).unwrap(), axis("Y", "X", "[0.0, 1.0, 0.0]"));
    let both = &text[from..from + text[from..].find(&y).unwrap() + y.len()];
    let turned =
        both.replace(&x, &axis("X", "base", "[0.0, 1.0, 0.0]")).replace(&y, &axis("Y", "X", "[-1.0, 0.0, 0.0]"));
    let says = message(both, &turned);
    assert!(says.contains("X is [0.00, 1.00, 0.00], Y is [-1.00, 0.00, 0.00]") && !says.contains("left"), "{says}");
}

#[test]
fn a_direction_of_rotation_that_is_not_stated_is_said() {
    let text = crate::machine::BUILT_IN.replacen("\nsense = 1\n", "\n", 1);
    let (machines, findings) = super::load(&source("m.toml", text)).unwrap();
    let codes: Vec<&str> = findings.0.iter().map(|f| f.code).collect();
    assert_eq!(codes, ["machine::assumed_sense"]);
    assert_eq!(findings.0[0].severity, crate::diag::Severity::Info);
    let rotary = machines[0].rotary().next().unwrap();
    assert!(findings.0[0].message.contains(" is +1, since the file does not say it"), "{}", findings.0[0].message);
    assert_eq!(rotary.sense, 1.0);
}

#[test]
fn what_follows_from_a_slip_is_not_said_besides() {
    for (from, to, code) in [
        ("ball_radius = 3.0", "ball_radius = 0.0", "machine::probe"),
        ("slow_feed = 60.0", "slow_feed = inf", "machine::probe"),
        ("length = 202.684", "length = 0.0", "machine::tool_length"),
        ("parent = \"X\"", "parent = \"Q\"", "machine::unknown_parent"),
        ("parent = \"B\"", "parent = \"Q\"", "machine::unknown_parent"),
        ("riser = { height = 60.0", "riser = { height = -1.0", "machine::riser"),
    ] {
        assert_eq!(codes(from, to), [code], "{from} {to}");
    }
}

#[test]
fn a_stylus_is_thinner_than_its_ball_and_unlike_the_others() {
    let at = "\n[[machine.stylus]]\nname = \"long\"\n";
    let more = |fields: &str| format!("\n[[machine.stylus]]\nname = \"more\"\n{fields}\n{at}");
    assert_eq!(codes(at, &more("longer = 50.0")), [] as [&str; 0]);
    assert_eq!(codes(at, &more("ball_radius = 2.0")), [] as [&str; 0]);
    let wrong =
        ["longer = 100.0", "longer = 0.0", "longer = -75.0", "longer = nan", "stem_radius = 3.0", "ball_radius = -1.0"];
    for fields in wrong {
        assert_eq!(codes(at, &more(fields)), ["machine::stylus"], "{fields}");
    }
    assert_eq!(codes(at, &more("longer = 50.0").replace("more", "long")), ["machine::stylus"]);
    assert_eq!(codes("carrier = \"table\"\ncentre", "carrier = \"base\"\ncentre"), ["machine::block_carrier"]);
    assert_eq!(codes("carrier = \"table\"\ncentre", "carrier = \"Z\"\ncentre"), ["machine::carrier"]);
}

#[test]
fn a_direction_a_little_off_square_is_left_alone() {
    assert_eq!(codes("direction = [1.0, 0.0, 0.0]", "direction = [1.0, 0.001, 0.0]"), [] as [&str; 0]);
}

#[test]
fn blocks_may_touch_but_not_overlap() {
    let block = |x: f64| {
        format!(
            "[[machine.mounting.block]]\nname = \"more\"\ncentre = [{x:?}, 0.0, 900.0]\nsize = [10.0, 10.0, 10.0]\n"
        )
    };
    let at = "[[machine.mounting.block]]";
    let two = |gap: f64| format!("{}{}{at}", block(0.0), block(gap).replace("more", "less"));
    // so far up their risers hang in the air, which is another matter
    let codes =
        |gap: f64| -> Vec<&str> { codes(at, &two(gap)).into_iter().filter(|c| *c != "machine::riser_hangs").collect() };
    assert_eq!(codes(9.0), ["machine::blocks_overlap"]);
    assert_eq!(codes(10.0), [] as [&str; 0]);
}

#[test]
fn numbers_of_another_world_are_said_shortly() {
    let text = crate::machine::BUILT_IN.replacen("range = [-450.0, 450.0]", "range = [-1e300, 1e300]", 1);
    let failure = super::load(&source("m.toml", text)).unwrap_err();
    assert!(failure.to_string().ends_with("range of axis X is [-1e300, 1e300]"), "{failure}");
}
