//! Programs of a user's own: what is wrong in them is said with its place, all at once.

use super::machine_of;
use crate::diag::{Failure, source};
use crate::machine::BUILT_IN;
use crate::program::{Options, generate, load};
use proptest::prelude::*;

const GOOD: &str = r#"format = "axiscal-programs/1"
name = "mine"
mounting = "head"
[[grid]]
name = "G"
u = [0.0]
v = [0.0]
[[stage]]
name = "s"
[[stage.setup]]
pose = { B = 0.0 }
blocks = ["x-"]
touch = [{ faces = ["+Z"], grid = "G" }]
"#;

fn run(text: &str) -> Result<usize, Failure> {
    let (spec, _) = load(&source("mine.toml", text))?;
    let machine = machine_of(BUILT_IN, "swivel-head");
    generate(&machine, &spec, &Options::default()).map(|(g, _)| g.plan.touches.len())
}

#[test]
fn a_small_program_is_enough() {
    assert_eq!(run(GOOD).unwrap(), 1);
}

/// What is changed, into what, what is said and where (line of the file).
#[test]
fn each_slip_is_named_with_its_place() {
    let cases = [
        ("axiscal-programs/1", "axiscal-programs/9", "format is", 1),
        ("name = \"mine\"", "name = \"../mine\"", "cannot be called", 2),
        ("name = \"mine\"", "name = \"mine\"\nrepeats = 0", "touched 0 times", 3),
        ("name = \"mine\"", "name = \"mine\"\nspeed = 0", "unknown field", 3),
        ("mounting = \"head\"", "mounting = \"heap\"", "no mounting \"heap\"", 3),
        ("name = \"s\"", "name = \"s\"\nmounting = \"heap\"", "no mounting \"heap\"", 10),
        ("name = \"s\"", "name = \"s\"\nstylus = \"short\"", "no stylus \"short\"", 10),
        ("name = \"s\"", "name = \"s\"\nplaced = \"well\"", "unknown variant", 10),
        ("u = [0.0]", "u = []", "needs u", 5),
        ("u = [0.0]", "u = [9.0]", "4.000 mm past the edge", 13),
        ("v = [0.0]", "v = [nan]", "not finite", 5),
        ("v = [0.0]", "depth = [2.0]", "face +Z has none", 13),
        ("B = 0.0", "B = 150.0", "outside the range", 11),
        ("B = 0.0", "A = 0.0", "no axis A", 11),
        ("B = 0.0", "Q = 0.0", "no rotary axis", 11),
        ("B = 0.0", "X = 0.0", "no rotary axis", 11),
        ("B = 0.0", "B = []", "angles of B", 11),
        ("\"x-\"", "\"x-\", \"q\"", "no block \"q\"", 12),
        ("\"x-\"", "\"x-\", \"x-\"", "stands twice", 12),
        ("[\"+Z\"]", "[\"up\"]", "no face \"up\"", 13),
        ("grid = \"G\"", "grid = \"H\"", "no grid is called \"H\"", 13),
        ("B = 0.0 }", "B = 0.0 }\nfrom = { B = 2 }", "sense 2", 12),
        ("B = 0.0 }", "C = -360.0 }\nfrom = { C = 1 }", "range ends at -360", 0),
        ("B = 0.0 }", "B = 0.0 }\nfeed = -1", "feed is -1", 12),
        ("[[stage.setup]]", "[[stage.step]]", "unknown field", 10),
    ];
    for (old, new, says, line) in cases {
        let failure = run(&GOOD.replacen(old, new, 1)).unwrap_err();
        let finding = failure.0.iter().find(|f| f.message.contains(says));
        let finding = finding.unwrap_or_else(|| panic!("{says:?} is not said: {failure:?}"));
        assert!(finding.help.is_some(), "{says:?} has no remedy");
        if line > 0 {
            let place = finding.place().unwrap();
            assert!(place.starts_with(&format!("mine.toml:{line}:")), "{says:?} stands at {place}");
        }
    }
}

#[test]
fn all_slips_are_said_at_once() {
    let text = GOOD.replace("[\"+Z\"]", "[\"up\"]").replace("[0.0]", "[inf]").replace("B = 0.0", "Q = 0.0");
    assert_eq!(run(&text).unwrap_err().0.len(), 3);
    let text = GOOD.replace("B = 0.0", "B = 150.0").replace("\"x-\"", "\"q\"");
    assert_eq!(run(&text).unwrap_err().0.len(), 2);
}

#[test]
fn machine_directions_need_a_square_carrier() {
    let text = GOOD
        .replace("mounting = \"head\"", "mounting = \"table\"\nfaces_in = \"machine\"")
        .replace("\"x-\"", "\"x+\"")
        .replace("B = 0.0", "C = 30.0")
        .replace("+Z", "+X");
    let failure = run(&text).unwrap_err();
    assert!(failure.to_string().contains("no face of block \"x+\" looks along machine +X"), "{failure}");
    assert_eq!(run(&text.replace("C = 30.0", "C = -90.0")).unwrap(), 1);
    // the top face looks up at every C; only its edges do not run along X and Y
    let failure = run(&text.replace("+X", "+Z").replace("C = 30.0", "C = 37.0")).unwrap_err();
    assert!(failure.to_string().contains("face +Z of block \"x+\" looks along machine +Z"), "{failure}");
    assert_eq!(run(&text.replace("+X", "+Z").replace("C = 30.0", "C = 90.0")).unwrap(), 1);
}

#[test]
fn lengths_of_another_world_are_refused() {
    // the machine's file is refused already; whoever makes the record otherwise is refused here
    let huge = BUILT_IN.replacen("head_radius = ", "head_radius = 1e9 # ", 1);
    assert!(crate::machine::load(&source("machines.toml", huge)).is_err());
    let mut machine = machine_of(BUILT_IN, "swivel-head");
    machine.probe.head_radius = 1e9;
    let (spec, _) = load(&source("mine.toml", GOOD)).unwrap();
    assert!(generate(&machine, &spec, &Options::default()).unwrap_err().to_string().contains("reaches"));
}

#[test]
fn the_schema_names_the_fields() {
    let schema = serde_json::to_string(&crate::program::schema()).unwrap();
    for field in ["mounting", "faces_in", "overshoot_deg", "pose", "depth"] {
        assert!(schema.contains(field), "{field}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 200, ..ProptestConfig::default() })]

    /// Whatever is cut out of a good program or written into it: an answer, never a panic.
    #[test]
    fn no_text_makes_it_panic(from in 0usize..GOOD.len(), len in 0usize..40, put in "[-0-9a-zA-Z\\[\\]{}=\", .\n]{0,12}") {
        let mut text = GOOD.to_owned();
        let to = (from + len).min(text.len());
        text.replace_range(from..to, &put);
        let _ = run(&text);
    }

    /// Any numbers in a pose, a grid and an overshoot: an answer, never a panic.
    #[test]
    fn no_number_makes_it_panic(b in any::<f64>(), u in any::<f64>(), over in any::<f64>()) {
        let text = GOOD.replace("B = 0.0", &format!("B = {b:?}")).replace("u = [0.0]", &format!("u = [{u:?}]"));
        let text = text.replace("mounting", &format!("overshoot_deg = {over:?}\nmounting"));
        let _ = run(&text);
    }
}
