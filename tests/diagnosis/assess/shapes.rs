//! Time constants, pitches and moments of jumps before the first touch.

use super::{DEFAULT, NOISE, common, plan, task};
use axiscal::design::record::Assessment;
use axiscal::design::{Planned, Request, assess};
use axiscal::diag::source;
use axiscal::model::catalogue::Catalogue;
use axiscal::program;

/// What is expected of a time constant, and of the sizes that go with it, is what the fit then says of typical ones: looked at
/// where the effect has no size, nothing told it, and the sizes were as sure as if it were known.
#[test]
fn what_is_expected_of_a_time_constant_is_what_the_fit_says() {
    let machine = common::machine("swivel-head");
    let catalogue = Catalogue::built_in().unwrap();
    let model = [&DEFAULT[..], &["warm-up"]].concat();
    let request = Request {
        task: task(&machine, &catalogue, &model),
        runs: vec![plan(&machine, "full")],
        names: vec!["full".to_owned()],
        probe: NOISE,
        acting_tau_mm: Some(0.0),
    };
    let expected = assess(&request).unwrap();
    assert_eq!(expected.rank, expected.unknowns);
    let sizes: Vec<(&str, f64)> = catalogue
        .get("warm-up", &machine)
        .unwrap()
        .parameters
        .iter()
        .map(|p| (p.name.as_str(), if p.shape.is_some() { 0.5 } else { p.typical }))
        .collect();
    let scenario = axiscal::simulate::Scenario::flawless().with(&machine, "warm-up", &sizes).unwrap();
    let full = common::plan(&machine, "full");
    let touches = common::touch(&machine, &full, &scenario, None);
    let known = axiscal::fit::Settings {
        touch_sigma_mm: Some(NOISE.sigma_mm),
        visit_sigma_mm: Some(0.0),
        ..Default::default()
    };
    let fit = common::identify_with(&machine, &[(&full, &touches)], &model, known);
    for p in &expected.parameters {
        let found = fit.outcome.parameters.iter().find(|f| f.name == p.name).unwrap();
        let (said, then) = (p.sigma.unwrap(), found.sigma.unwrap());
        println!("{} {said} {then}", p.name);
        assert!((then / said - 1.0).abs() < 0.02, "{}: {said} expected, {then} found", p.name);
    }
    assert!(
        expected.warnings.iter().any(|w| w.starts_with("tau (Warm-up) is examined where it is 0.5 h")),
        "{:?}",
        expected.warnings
    );
}

/// A pitch is told by touches at many places; where few take one for the other, that is said before they are made. The moment of a
/// jump is found by trying.
#[test]
fn a_shape_that_touches_would_not_tell_is_said_before() {
    let machine = common::machine("swivel-head");
    let catalogue = Catalogue::built_in().unwrap();
    let with = |program: &str, more: &str| {
        let model = [&DEFAULT[..], &[more]].concat();
        let request = Request {
            task: task(&machine, &catalogue, &model),
            runs: vec![plan(&machine, program)],
            names: vec![program.to_owned()],
            probe: NOISE,
            acting_tau_mm: None,
        };
        assess(&request).unwrap()
    };
    let row = |a: &Assessment, name: &str| a.parameters.iter().find(|p| p.name == name).cloned();
    let says = |a: &Assessment, word: &str| a.warnings.iter().any(|w| w.contains(word));
    let told = with("full", "pitch-x");
    assert!(
        row(&told, "pitch_X").unwrap().sigma.is_some_and(|s| s < 0.1) && !says(&told, "may not separate it from"),
        "{:?}",
        told.warnings
    );
    let not = with("head", "pitch-x");
    assert!(
        row(&not, "pitch_X").unwrap().sigma.is_none() && says(&not, "may not separate it from"),
        "{:?}",
        not.warnings
    );
    let slip = with("full", "block-slip");
    assert!(row(&slip, "from_h").is_none() && row(&slip, "dx").unwrap().sigma.is_some(), "{:?}", slip.parameters);
    assert!(says(&slip, "from_h") && says(&slip, "trying every position"), "{:?}", slip.warnings);
}

/// A slip is looked at among the touches: behind the last one, where its range of hours begins, it moved nothing.
#[test]
fn a_slip_is_looked_at_where_it_shows() {
    let machine = common::machine("swivel-head");
    let catalogue = Catalogue::built_in().unwrap();
    let model = [&DEFAULT[..], &["block-slip"]].concat();
    let request = Request {
        task: task(&machine, &catalogue, &model),
        runs: ["head", "table"].map(|p| plan(&machine, p)).to_vec(),
        names: vec!["head".to_owned(), "table".to_owned()],
        probe: NOISE,
        acting_tau_mm: None,
    };
    let a = assess(&request).unwrap();
    assert!(a.rank == a.unknowns && a.undetermined.is_empty(), "{:?}", a.undetermined);
    let sizes: Vec<_> = a.parameters.iter().filter(|p| p.effect == "block-slip").collect();
    assert!(sizes.len() == 6 && sizes.iter().all(|p| p.sigma.is_some()), "{sizes:?}");
}

/// A slope that is no number at a touch would be one of everything: the answer never came.
#[test]
fn a_slope_that_is_no_number_is_refused() {
    const ROOT: &str = "[[effect]]\nid = \"root\"\nat = \"base\"\nterms = [{ parameter = \"ra\", unit = \"um\", dof = \"dx\", formula = \
                        \"sqrt(t - rb)\" }]\nshape = [{ parameter = \"rb\", unit = \"h\", start = 0.0, min = -1.0, max = 3.0 }]\n";
    let machine = common::machine("swivel-head");
    let mut catalogue = Catalogue::built_in().unwrap();
    catalogue.add_file(&axiscal::diag::source("root.toml", ROOT)).unwrap();
    let mut from_zero = plan(&machine, "head");
    from_zero.plan.touches[0].time_s = Some(0.0);
    let model = [&DEFAULT[..], &["root"]].concat();
    let request = Request {
        task: task(&machine, &catalogue, &model),
        runs: vec![from_zero],
        names: vec!["head".to_owned()],
        probe: NOISE,
        acting_tau_mm: None,
    };
    let refused = assess(&request).unwrap_err().to_string();
    assert!(refused.contains("rb of effect root") && refused.contains("touch 1"), "{refused}");
}

/// An effect with a set of parameters for each block is expected like any other: a row for each, and what is said of its shape.
#[test]
fn what_each_block_does_by_itself_is_expected_too() {
    const OWN: &str = "[[effect]]\nid = \"settling\"\nper = \"block\"\nat = \"block\"\nterms = [{ parameter = \"sz\", unit = \"um\", \
                       dof = \"dz\", formula = \"1 - exp(-t/st)\", typical = 10 }]\nshape = [{ parameter = \"st\", unit = \"h\", \
                       start = 0.5, min = 0.02, max = 10.0 }]\n";
    let machine = common::machine("trunnion");
    let mut catalogue = Catalogue::built_in().unwrap();
    catalogue.add_file(&axiscal::diag::source("own.toml", OWN)).unwrap();
    let model = ["location-a", "location-c", "block-setup", "pretravel", "settling"];
    let request = Request {
        task: task(&machine, &catalogue, &model),
        runs: vec![plan(&machine, "full")],
        names: vec!["full".to_owned()],
        probe: NOISE,
        acting_tau_mm: Some(0.0),
    };
    let expected = assess(&request).unwrap();
    let of = |word: &str| expected.parameters.iter().filter(|p| p.name.starts_with(word)).count();
    assert_eq!((of("sz@"), of("st@")), (4, 4), "{:?}", expected.parameters.iter().map(|p| &p.name).collect::<Vec<_>>());
    assert!(expected.parameters.iter().all(|p| p.effect != "block-setup"));
    for block in ["a", "b", "c", "f"] {
        let says = format!("st@full/{block} (");
        assert!(
            expected.warnings.iter().any(|w| w.starts_with(&says) && w.contains("is examined where it is 0.5 h")),
            "{block}: {:?}",
            expected.warnings
        );
    }
}

/// A plan that is over within three minutes shows blocks that slip in its midst: the usual moments all come later.
#[test]
fn a_jump_shows_in_a_short_plan() {
    const SMALL: &str = r#"
format = "axiscal-programs/1"
name = "small"
machine = "trunnion"
says = "few touches"
mounting = "table"
faces_in = "machine"
[[grid]]
name = "one"
u = [0.0]
v = [0.0]
[[stage]]
name = "s"
[[stage.setup]]
pose = { A = 0.0, C = [0.0, 90.0] }
touch = [ { faces = ["+X","-X","+Y","-Y","+Z"], grid = "one" } ]
"#;
    let machine = common::machine("trunnion");
    let catalogue = Catalogue::built_in().unwrap();
    let spec = program::load(&source("small.toml", SMALL)).unwrap().0;
    let made = program::generate(&machine, &spec, &program::Options::default()).unwrap().0;
    let request = Request {
        task: task(&machine, &catalogue, &["location-a", "location-c", "block-setup", "pretravel"]),
        runs: vec![Planned::new(made.plan)],
        names: vec!["small".to_owned()],
        probe: NOISE,
        acting_tau_mm: Some(0.0),
    };
    let slips = assess(&request).unwrap().effects.into_iter().find(|e| e.effect == "block-slip").unwrap();
    assert!(slips.visible && slips.typical_um > 1.0, "{slips:?}");
}

/// A formula without a value is named itself, and not whatever else is in the model.
#[test]
fn a_formula_without_a_value_is_named_before_the_first_touch() {
    const OWN: &str = r#"
[[effect]]
id = "div"
at = "tool"
terms = [ { parameter = "dv", unit = "um", dof = "dz", formula = "1/sin(B)", typical = 10 } ]
"#;
    let machine = common::machine("swivel-head");
    let mut catalogue = Catalogue::built_in().unwrap();
    catalogue.add_file(&source("div.toml", OWN)).unwrap();
    let request = Request {
        task: task(&machine, &catalogue, &["location-b", "block-setup", "pretravel", "div"]),
        runs: vec![plan(&machine, "head")],
        names: vec!["head".to_owned()],
        probe: NOISE,
        acting_tau_mm: Some(0.0),
    };
    let said = assess(&request).unwrap_err().to_string();
    assert!(said.contains("1/sin(B)") && said.contains("div") && said.contains("touch 1"), "{said}");
}
