//! What the method's text says can and cannot be reached (the method, section 6), row by row.

use super::machine_of;
use crate::diag::source;
use crate::machine::BUILT_IN;
use crate::program::{Options, generate, load};
use std::collections::BTreeSet;

/// An artefact of four blocks: what they stand on, and how long the stem is.
#[derive(Clone, Copy)]
struct SetUp {
    machine: &'static str,
    /// mm; 0: directly on the table.
    riser: f64,
    stem: f64,
    /// The table's edge on the side of the head, mm.
    table_from_x: f64,
}

const RISERS: SetUp = SetUp { machine: "swivel-head", riser: 60.0, stem: 75.0, table_from_x: -250.0 };

/// The faces (`block face`) of which every point can be touched at a pose.
fn reachable(set_up: SetUp, pose: &str, depth: &str) -> BTreeSet<String> {
    let SetUp { machine, riser, stem, table_from_x } = set_up;
    let start = BUILT_IN.find(&format!("name = \"{machine}\"")).unwrap();
    let start = BUILT_IN[..start].rfind("[[machine]]").unwrap();
    let end = BUILT_IN[start..].find("[[machine.solid]]").unwrap() + start;
    let mut text = format!("format = \"axiscal-machines/1\"\n{}", &BUILT_IN[start..end]);
    text = text.replacen("stem_length = 75.0", &format!("stem_length = {stem:?}"), 1);
    let top = -207.684 - riser;
    let (width, middle) = (250.0 - table_from_x, (250.0 + table_from_x) / 2.0);
    text += &format!(
        "[[machine.solid]]\nname = \"table\"\ncarrier = \"table\"\n\
         box = {{ centre = [{middle:?}, 0.0, {:?}], size = [{width:?}, 400.0, 20.0] }}\n\
         [[machine.mounting]]\nname = \"m\"\ncarrier = \"table\"\n",
        top - 10.0
    );
    if riser > 0.0 {
        text += &format!("riser = {{ height = {riser:?}, size = [10.0, 10.0] }}\n");
    }
    for (name, x, y) in [("x-", -30.0, 0.0), ("x+", 30.0, 0.0), ("y-", 0.0, -30.0), ("y+", 0.0, 30.0)] {
        text += &format!(
            "[[machine.mounting.block]]\nname = \"{name}\"\ncentre = [{x:?}, {y:?}, -202.684]\nsize = [10.0, 10.0, 10.0]\n"
        );
    }
    let machine = machine_of(&text, machine);
    let program = format!(
        "format = \"axiscal-programs/1\"\nname = \"p\"\nmounting = \"m\"\nfaces_in = \"machine\"\n\
         [[grid]]\nname = \"U\"\nu = [-3.0, 3.0]\nv = [-3.0, 3.0]\n\
         [[grid]]\nname = \"S\"\nu = [-2.5, 2.5]\ndepth = {depth}\n\
         [[stage]]\nname = \"s\"\n[[stage.setup]]\npose = {pose}\n\
         touch = [{{ faces = [\"+Z\"], grid = \"U\" }}, {{ faces = [\"+X\", \"-X\", \"+Y\", \"-Y\"], grid = \"S\" }}]\n"
    );
    let (spec, _) = load(&source("p.toml", program)).unwrap();
    let Ok((generated, _)) = generate(&machine, &spec, &Options::default()) else { return BTreeSet::new() };
    let lost: BTreeSet<String> = generated.plan.skipped.iter().map(|s| format!("{} {}", s.block, s.face)).collect();
    let made = generated.plan.touches.iter().map(|t| format!("{} {}", t.block, t.face));
    made.filter(|f| !lost.contains(f)).collect()
}

fn faces(blocks: &[&str], faces: &[&str]) -> BTreeSet<String> {
    blocks.iter().flat_map(|b| faces.iter().map(move |f| format!("{b} {f}"))).collect()
}

const ALL: [&str; 4] = ["x-", "x+", "y-", "y+"];
const S4: &str = "[2.0, 5.0]";

#[test]
fn upright_all_five_faces_with_and_without_riser() {
    for (riser, stem) in [(60.0, 75.0), (60.0, 50.0), (0.0, 75.0), (0.0, 50.0)] {
        let set_up = SetUp { riser, stem, ..RISERS };
        assert_eq!(reachable(set_up, "{ B = 0.0 }", S4), faces(&ALL, &["+Z", "+X", "-X", "+Y", "-Y"]));
    }
}

#[test]
fn at_minus_30_all_but_the_faces_away_from_the_body() {
    for riser in [60.0, 0.0] {
        let set_up = SetUp { riser, ..RISERS };
        assert_eq!(reachable(set_up, "{ B = -30.0 }", S4), faces(&ALL, &["+Z", "-X", "+Y", "-Y"]));
    }
}

#[test]
fn at_minus_90_on_the_table_nothing() {
    for stem in [50.0, 75.0] {
        assert!(reachable(SetUp { riser: 0.0, stem, ..RISERS }, "{ B = -90.0 }", S4).is_empty());
    }
}

#[test]
fn at_minus_90_on_risers_what_the_stem_does_not_pass_through() {
    // with a stem of 50 the body meets block x- before the ball comes to block x+
    let near = faces(&["x-", "y-", "y+"], &["+Z", "-X", "+Y", "-Y"]);
    assert_eq!(reachable(SetUp { stem: 50.0, ..RISERS }, "{ B = -90.0 }", S4), near);
    let far = faces(&["x+"], &["+Z", "+Y", "-Y"]);
    assert_eq!(reachable(RISERS, "{ B = -90.0 }", S4), near.union(&far).cloned().collect());
}

#[test]
fn at_plus_90_the_mirror_image() {
    let near = faces(&["x+", "y-", "y+"], &["+Z", "+X", "+Y", "-Y"]);
    let far = faces(&["x-"], &["+Z", "+Y", "-Y"]);
    assert_eq!(reachable(RISERS, "{ B = 90.0 }", S4), near.union(&far).cloned().collect());
}

#[test]
fn two_axis_head_with_a_at_90_both_ways() {
    let set_up = SetUp { machine: "double-head", stem: 50.0, ..RISERS };
    let toward = faces(&["x-", "x+", "y+"], &["+Z", "+X", "-X", "+Y"]);
    assert_eq!(reachable(set_up, "{ A = -90.0 }", S4), toward);
    let toward = faces(&["x-", "x+", "y-"], &["+Z", "+X", "-X", "-Y"]);
    assert_eq!(reachable(set_up, "{ A = 90.0 }", S4), toward);
}

#[test]
fn least_riser_is_the_head_radius_below_the_deepest_touch() {
    // 45 mm + clearance 0.3 for a head of radius 50 over the table, 15 mm + clearance where only the body is over it
    let lowest = |riser: f64, table_from_x: f64| {
        reachable(SetUp { riser, table_from_x, ..RISERS }, "{ B = -90.0 }", "[5.0]").contains("y- -X")
    };
    assert!(!lowest(45.2, -250.0));
    assert!(lowest(45.4, -250.0));
    assert!(!lowest(15.2, -120.0));
    assert!(lowest(15.4, -120.0));
}

#[test]
fn one_block_on_the_turntable_at_any_c() {
    let machine = machine_of(BUILT_IN, "swivel-head");
    let program = "format = \"axiscal-programs/1\"\nname = \"p\"\nmounting = \"table\"\nfaces_in = \"machine\"\n\
         [[grid]]\nname = \"U\"\nu = [-3.0, 3.0]\nv = [-3.0, 3.0]\n\
         [[grid]]\nname = \"S\"\nu = [-2.5, 2.5]\ndepth = [2.0, 5.0]\n\
         [[stage]]\nname = \"s\"\n[[stage.setup]]\npose = { B = -90.0, C = [0.0, 90.0, 180.0, 270.0] }\n\
         touch = [{ faces = [\"+Z\"], grid = \"U\" }, { faces = [\"+X\", \"-X\", \"+Y\", \"-Y\"], grid = \"S\" }]\n";
    let (spec, _) = load(&source("p.toml", program)).unwrap();
    let (generated, findings) = generate(&machine, &spec, &Options::default()).unwrap();
    assert_eq!(generated.plan.touches.len(), 4 * 16);
    // the face that looks along machine +X is another own face at each C
    let lost: Vec<String> = crate::program::skipped_groups(&generated.plan.skipped)
        .iter()
        .map(|g| format!("{} {}", g.face, g.points))
        .collect();
    assert_eq!(lost, ["+X 4", "-Y 4", "-X 4", "+Y 4"]);
    assert!(generated.plan.notes.iter().any(|n| n.contains("lost its +X side")), "{:?}", generated.plan.notes);
    assert!(findings.0.iter().any(|f| f.message.contains("the stem would hit block x+")));
    // strict: the same is refused
    assert!(generate(&machine, &spec, &Options { strict: true, ..Options::default() }).is_err());
}
