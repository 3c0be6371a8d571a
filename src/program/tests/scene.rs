//! The library's distances and the bounds that are built on them, against plain sampling.

use super::machine_of;
use crate::axes::{AxisName, Position};
use crate::machine::BUILT_IN;
use crate::program::scene::{Part, Scene};
use crate::program::sweep::Manner;
use crate::units::rad_from_deg;
use nalgebra::{Vector3, vector};
use proptest::prelude::*;

/// Distance from a point to a box, mm.
fn to_box(p: &Vector3<f64>, centre: &Vector3<f64>, size: &Vector3<f64>) -> f64 {
    ((p - centre).abs() - size / 2.0).map(|d| d.max(0.0)).norm()
}

/// Points on the skin of a cylinder that stands along a direction, mm.
fn skin(foot: Vector3<f64>, along: Vector3<f64>, radius: f64, height: f64) -> impl Iterator<Item = Vector3<f64>> {
    let side = if along.x.abs() < 0.9 { Vector3::x() } else { Vector3::y() };
    let u = along.cross(&side).normalize();
    let v = along.cross(&u);
    (0..=60).flat_map(move |h| {
        (0..120).flat_map(move |a| {
            let angle = rad_from_deg(f64::from(a) * 3.0);
            // both ends are closed: there the points fill the disc
            let rings = if h == 0 || h == 60 { 12 } else { 1 };
            (1..=rings).map(move |r| {
                let at = radius * f64::from(r) / f64::from(rings);
                foot + along * (height * f64::from(h) / 60.0) + (u * angle.cos() + v * angle.sin()) * at
            })
        })
    })
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 40, ..ProptestConfig::default() })]

    /// What the library calls the distance of body and block is never more than what sampling finds, and hardly less.
    #[test]
    fn distances_of_cylinder_and_box(x in -200.0f64..200.0, y in -100.0f64..100.0, z in -220.0f64..60.0, b in -110.0f64..110.0) {
        let machine = machine_of(BUILT_IN, "swivel-head");
        let mounting = machine.mounting("head").unwrap();
        let scene = Scene::new(&machine, mounting).unwrap();
        let mut at = Position([x, y, z, 0.0, b, 0.0]);
        at.set(AxisName::B, b);
        let placed = scene.place(&at);
        let (_, body) = scene.parts.iter().find(|(part, _)| *part == Part::Body).unwrap();
        let beta = rad_from_deg(b);
        // by hand: the table moves by (-X, -Y), the head by Z; at B the spindle points along (sin B, 0, cos B)
        let up = vector![beta.sin(), 0.0, beta.cos()];
        let ball = vector![0.0, 0.0, z] - up * 202.684;
        let samples: Vec<Vector3<f64>> = skin(ball + up * 75.0, up, 20.0, 60.0).collect();
        for (i, block) in mounting.blocks.iter().enumerate() {
            let centre = block.centre - vector![x, y, 0.0];
            let sampled = samples.iter().map(|p| to_box(p, &centre, &block.size)).fold(f64::MAX, f64::min);
            // a block that has gone into the body as a whole touches no part of its skin
            let from_foot = centre - (ball + up * 75.0);
            let along = from_foot.dot(&up);
            let inside = (0.0..60.0).contains(&along) && (from_foot - up * along).norm() < 20.0;
            let found = scene.gap(body, &scene.obstacles[i], &placed);
            // the library iterates to 5e-8 of the distance
            prop_assert!(found <= sampled * (1.0 + 1e-7) + 1e-5, "{found} > {sampled}");
            prop_assert!(inside || found > sampled - 0.8, "{found} < {sampled}");
        }
    }

    /// A straight move that is called clear keeps its gap at every place between its ends.
    #[test]
    fn clear_moves_are_clear_in_between(
        from in prop::array::uniform3(-80.0f64..80.0), way in prop::array::uniform3(-60.0f64..60.0), b in -95.0f64..95.0,
    ) {
        let machine = machine_of(BUILT_IN, "swivel-head");
        let scene = Scene::new(&machine, machine.mounting("head").unwrap()).unwrap();
        let place = |t: f64| Position([0, 1, 2, 3, 4, 5].map(|i| match i {
            0..=2 => from[i] + way[i] * t,
            4 => b,
            _ => 0.0,
        }));
        let verdict = scene.clear_straight(&place(0.0), &place(1.0), Manner::Guarded);
        // ball and stem trip the probe: they keep the clearance. Body and head do not: the placement tolerance on top
        let room = |part: Part| if matches!(part, Part::Ball | Part::Stem) { 0.3 } else { 1.3 };
        let mut to_spare = f64::MAX;
        for k in 0..=300 {
            let placed = scene.place(&place(f64::from(k) / 300.0));
            for (name, part) in &scene.parts {
                for obstacle in &scene.obstacles {
                    to_spare = to_spare.min(scene.gap(part, obstacle, &placed) - room(*name));
                }
            }
        }
        match verdict {
            Ok(()) => prop_assert!(to_spare >= -1e-6, "called clear with {to_spare}"),
            // samples stand up to 0.3 mm apart: what is refused may be a little tighter than they show
            Err(hit) => prop_assert!(to_spare < 0.2, "{hit} with {to_spare} to spare"),
        }
    }

    /// The same for a turn of the head and of the turntable.
    #[test]
    fn clear_turns_are_clear_in_between(
        from in prop::array::uniform3(-60.0f64..60.0), b in prop::array::uniform2(-100.0f64..100.0), c in -200.0f64..200.0,
    ) {
        let machine = machine_of(BUILT_IN, "swivel-head");
        let scene = Scene::new(&machine, machine.mounting("table").unwrap()).unwrap();
        let start = Position([from[0], from[1], from[2] + 20.0, 0.0, b[0], 0.0]);
        for (axis, to) in [(AxisName::B, b[1]), (AxisName::C, c)] {
            let verdict = scene.clear_turn(&start, axis, to);
            if verdict.is_ok() {
                for k in 0..=200 {
                    let mut at = start;
                    at.set(axis, start.get(axis) + (to - start.get(axis)) * f64::from(k) / 200.0);
                    let placed = scene.place(&at);
                    for (_, part) in &scene.parts {
                        for obstacle in scene.obstacles.iter().filter(|o| axis == AxisName::B || scene.carries(axis, o.carrier)) {
                            prop_assert!(scene.gap(part, obstacle, &placed) >= 0.3 - 1e-6);
                        }
                    }
                }
            }
        }
    }

    /// Lifted to the top nothing meets, wherever the rest of the machine stands.
    #[test]
    fn clear_from_anywhere_is_clear(x in -450.0f64..450.0, y in -300.0f64..300.0, b in -120.0f64..120.0, c in -360.0f64..360.0) {
        let machine = machine_of(BUILT_IN, "swivel-head");
        let scene = Scene::new(&machine, machine.mounting("table").unwrap()).unwrap();
        let lift = scene.lift().unwrap();
        prop_assert_eq!((lift.axis, lift.top), (AxisName::Z, 349.0));
        prop_assert!(scene.clear_from_anywhere(&lift, &|a| a.range));
        let placed = scene.place(&Position([x, y, lift.top, 0.0, b, c]));
        for (_, part) in &scene.parts {
            for obstacle in &scene.obstacles {
                prop_assert!(scene.gap(part, obstacle, &placed) >= 1.3);
            }
        }
    }
}

#[test]
fn a_short_lift_asks_for_a_start_near_the_first_pose_or_is_refused() {
    use crate::program::{Options, built_in, choose, generate};
    let with_top = |top: &str| {
        let at = BUILT_IN.find("name = \"trunnion\"").unwrap();
        let text = format!(
            "{}{}",
            &BUILT_IN[..at],
            BUILT_IN[at..].replacen("[-200.0, 350.0]", &format!("[-200.0, {top}]"), 1)
        );
        let machine = machine_of(&text, "trunnion");
        let spec = choose(built_in().unwrap(), "basic", &machine).unwrap();
        generate(&machine, &spec, &Options::default())
    };
    assert!(with_top("350.0").unwrap().0.path.start_near.is_none());
    let (near, _) = with_top("45.0").unwrap();
    assert!(near.path.start_near.is_some());
    assert!(near.path.head.iter().any(|l| l.contains("turn the rotary axes to A 0, C 0")), "{:?}", near.path.head);
    assert!(with_top("10.0").is_err());
}

/// Under a control's own transformation a program ends with the rotary axes at 0, each turn proven: where it stands, or above the
/// place at which it began. Where neither is clear it stays as it stands and says so.
#[test]
fn under_a_transformation_the_rotary_axes_end_at_0() {
    use crate::diag::source;
    use crate::program::path::Step;
    use crate::program::{Options, generate, load};
    // a wide block on a post swings over the turntable as A turns; the lift's top is lower than its circle
    let blocks = [("side", "[70.0, 0.0, -202.684]", 10, 60.0), ("low", "[-70.0, 60.0, -202.684]", 10, 60.0)];
    let wide = ("wide", "[-40.0, 120.0, -150.0]", 80, 112.684);
    let mounting: String = blocks
        .iter()
        .chain([&wide])
        .map(|(name, centre, x, riser)| {
            format!(
                "[[machine.mounting.block]]\nname = \"{name}\"\ncentre = {centre}\nsize = [{x}.0, 10.0, 10.0]\n\
                 riser = {{ height = {riser}, size = [10.0, 10.0] }}\n"
            )
        })
        .collect();
    let from = BUILT_IN.find("name = \"trunnion\"").unwrap();
    let first = from + BUILT_IN[from..].find("[[machine.mounting]]").unwrap();
    let rest = first + BUILT_IN[first..].find("# ----").unwrap();
    let ends = |top: &str, visits: &[(&str, &str)], tcp: bool| {
        let text = format!(
            "{}{}[[machine.mounting]]\nname = \"table\"\nsays = \"posts\"\ncarrier = \"C\"\n{mounting}\n{}",
            &BUILT_IN[..from],
            BUILT_IN[from..first].replacen("[-200.0, 350.0]", &format!("[-200.0, {top}]"), 1),
            &BUILT_IN[rest..]
        );
        let machine = machine_of(&text, "trunnion");
        let setups: String = visits
            .iter()
            .map(|(block, a)| {
                let face = if *a == "0.0" { "+Z" } else { "+Y" };
                format!(
                    "[[stage.setup]]\npose = {{ A = {a}, C = 0.0 }}\nblocks = [\"{block}\"]\n\
                     touch = [{{ faces = [\"{face}\"], grid = \"G\" }}]\n"
                )
            })
            .collect();
        let program = format!(
            "format = \"axiscal-programs/1\"\nname = \"p\"\nmounting = \"table\"\nfaces_in = \"block\"\n\
             [[grid]]\nname = \"G\"\nu = [0.0]\nv = [0.0]\n[[stage]]\nname = \"s\"\n{setups}"
        );
        let (spec, _) = load(&source("p.toml", program)).unwrap();
        let (generated, findings) = generate(&machine, &spec, &Options { strict: true, tcp }).unwrap();
        let steps = &generated.path.steps;
        let mut stands = crate::axes::AxisMap::default();
        for step in steps {
            if let Step::Rotary { to, .. } = step {
                stands = to.or(&stands);
            }
        }
        let at_0 = machine.rotary().all(|a| stands.get(a.name).is_none_or(|v| v == 0.0));
        let left = steps.iter().rev().skip_while(|s| matches!(s, Step::Rotary { .. }));
        let across = left.take_while(|s| matches!(s, Step::Rapid { to } if to.get(AxisName::Z).is_none())).count();
        (at_0, across, findings.0.iter().any(|f| f.code == "program::stays_turned"))
    };
    let twice = [("side", "0.0"), ("low", "90.0")];
    assert_eq!(ends("350.0", &twice, false), (false, 0, false));
    assert_eq!(ends("350.0", &twice, true), (true, 0, false));
    assert_eq!(ends("100.0", &twice, true), (true, 2, false));
    assert_eq!(ends("100.0", &[("low", "0.0"), twice[0], twice[1]], true), (false, 0, true));
}
