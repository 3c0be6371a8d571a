//! What `full` cannot see on each machine, and why no touch can show it.

use super::{NOISE, common, invisible, plan, task};
use axiscal::design::record::Score;
use axiscal::design::{Request, assess};
use axiscal::model::catalogue::Catalogue;
use std::collections::BTreeSet;

/// An effect that `full` cannot see on a machine, and why no touch can show it: derived from the chain, not from an answer.
type Blind = (&'static str, &'static str);

/// C carries blocks: Rz(C)·Rz(ζ)·block = Rz(C)·(block turned by ζ about C's line), for all of them and at every C. Each block's
/// set-up has that turn and shift.
const ZERO_C: Blind = ("zero-c", "one turn of every block on C about C's line");

/// A load beside C's line bends an evenly stiff table towards itself: the lean turns with C, so in the table's own frame it is
/// the same at every C: a tilt of each block with the shift that goes with it.
const TABLE_LOAD: Blind = ("table-load", "one tilt of every block on C");

/// Every face that is touched along Z is an upper one: Z moves down to each of them, and half the backlash is the height of
/// each block.
const BACKLASH_Z: Blind = ("backlash-z", "one height of every block");

/// The stylus hangs straight down at every touch: gravity has no part across it.
const SAG: Blind = ("stylus-sag", "gx = gy = 0 where the spindle never leans");

/// What `full` cannot see on each machine. Nothing else may be blind, least of all an axis's own motions.
#[test]
fn full_leaves_only_what_no_touch_can_show() {
    // pairs: as many as there are today with the noise of the touches alone, without and with LATER rows; a further one is looked at
    for (name, location, expected, [most_pairs, with_later, most_of_lost]) in [
        (
            "swivel-head",
            ["location-b", "location-c"],
            // the ball stands at Ry(B)·(EX0B, 0, EZ0B − L), L longer with every stylus by the same amount. B's own zero is seen: it
            // moves the ball by L across the tool, and two styli have two L; nothing stands between B and the tool
            &[ZERO_C, BACKLASH_Z, TABLE_LOAD, ("tool-length", "−EZ0B: behind the rotation of B, along the tool")][..],
            [26, 36, 1],
        ),
        (
            "double-head",
            ["location-b", "location-a"],
            // the ball: Ry(B)·Trans(EX0B, 0, EZ0B)·Rz(EC0A)·Ry(EB0A)·Rx(A)·(0, EY0A, EZ0A − L). No axis bears blocks: neither a
            // zero of C nor a load. A's own zero is seen as B's on the machine above: two lengths
            &[
                ("zero-b", "Ry(B + ζ): EB0A grows by ζ, and (EX0B, EZ0B) turns by ζ; to first order EB0A alone"),
                BACKLASH_Z,
                ("tool-length", "−EZ0A: behind the rotation of A, along the tool"),
            ],
            [32, 47, 3],
        ),
        (
            "trunnion",
            ["location-a", "location-c"],
            // a block on C: Trans(0, EY0A, EZ0A)·Rz·Ry·Rx(A)·Trans(EX0C, EY0C, 0)·Ry(EB0C)·Rx(EA0C)·Rz(C)·block
            &[
                (
                    "zero-a",
                    "Rx(A + ζ): EA0C grows by ζ, EY0C by ζ times the height of C's point over A's line; heights of blocks",
                ),
                ZERO_C,
                BACKLASH_Z,
                TABLE_LOAD,
                // the spindle never leans: the ball is lower by dL at every touch, as is A's line with all that it carries; what
                // stands beside A takes it as its height
                ("tool-length", "EZ0A, and the heights of blocks that A does not carry"),
                SAG,
            ],
            [29, 38, 0],
        ),
        (
            "swivel-table-b",
            ["location-b", "location-c"],
            // as the trunnion with B for A: Trans(EX0B, 0, EZ0B)·…·Ry(B)·Trans(EX0C, EY0C, 0)·Ry(EB0C)·Rx(EA0C)·Rz(C)·block
            &[
                (
                    "zero-b",
                    "Ry(B + ζ): EB0C grows by ζ, EX0C by ζ times the height of C's point over B's line; heights of blocks",
                ),
                ZERO_C,
                BACKLASH_Z,
                TABLE_LOAD,
                ("tool-length", "EZ0B, and the heights of blocks that B does not carry"),
                SAG,
            ],
            [27, 36, 0],
        ),
        (
            "nutating-b",
            ["location-b", "location-c"],
            // on a table that is nearly upright side faces look down by some degrees: backlash of Z is seen
            &[
                (
                    "zero-b",
                    "R(B + ζ): what B carries turns by ζ about B's line: the line of C by its four errors, and the blocks",
                ),
                ZERO_C,
                TABLE_LOAD,
                ("tool-length", "EZ0B, and the heights of blocks that B does not carry"),
                SAG,
            ],
            [25, 34, 0],
        ),
        (
            "trunnion-offset",
            ["location-a", "location-c"],
            // side faces look down by some degrees at A = 75: backlash of Z is seen
            &[
                (
                    "zero-a",
                    "Rx(A + ζ): EA0C grows by ζ, EY0C by ζ times the height of C's point over A's line; heights of blocks",
                ),
                ZERO_C,
                TABLE_LOAD,
                ("tool-length", "EZ0A, and the heights of blocks that A does not carry"),
                SAG,
            ],
            [28, 37, 0],
        ),
    ] {
        let machine = common::machine(name);
        let catalogue = Catalogue::built_in().unwrap();
        let request = Request {
            task: task(&machine, &catalogue, &[location[0], location[1], "block-setup", "pretravel"]),
            runs: vec![plan(&machine, "full")],
            names: vec!["full".to_owned()],
            probe: NOISE,
            acting_tau_mm: Some(0.0),
        };
        let a = assess(&request).unwrap();
        println!("{name}: blind {:?}, pairs {}, {:?} {}", invisible(&a), a.alias_pairs, a.score, a.says);
        assert_eq!(invisible(&a), expected.iter().map(|e| e.0).collect(), "{name}: {expected:?}");
        // what stands still is said to do so, and nothing else is
        let still: BTreeSet<&str> =
            a.effects.iter().filter(|e| e.typical_um <= 1e-9).map(|e| e.effect.as_str()).collect();
        let upright = expected.iter().map(|e| e.0).filter(|id| *id == SAG.0);
        assert_eq!(still, upright.collect(), "{name}");
        // those of rows that came later are counted by themselves
        let later = |id: &str| LATER.iter().any(|family| id.starts_with(family));
        // a scale is a turn of the carriage about a point far away: no touches separate a special case from what includes it
        let includes = |by: &str, id: &str| {
            catalogue.get(by, &machine).is_some_and(|effect| effect.includes.iter().any(|x| x == id))
        };
        let pairs_of = |both: &dyn Fn(&str, &str) -> bool| -> usize {
            let each =
                a.effects.iter().flat_map(|e| e.same_as.iter().chain(&e.contained_in).map(move |x| (&e.effect, x)));
            each.filter(|(x, y)| both(x.as_str(), y.as_str()) && !includes(y, x)).count()
        };
        let lost = |id: &str| id.starts_with(LOST);
        let without_later = pairs_of(&|x, y| !later(x) && !later(y) && !lost(x) && !lost(y));
        let without_lost = pairs_of(&|x, y| !lost(x) && !lost(y));
        let of_lost = pairs_of(&|x, y| lost(x) || lost(y));
        assert!(without_later <= most_pairs, "{name}: {without_later} {:?}", a.alias_groups);
        assert!(without_lost <= with_later, "{name}: {without_lost} {:?}", a.alias_groups);
        assert!(of_lost <= most_of_lost, "{name}: {of_lost} {:?}", a.alias_groups);
        assert_eq!(pairs_of(&|_, _| true), without_lost + of_lost, "{name}");
        assert_eq!(a.score, Score::Good, "{name}: {}", a.says);
        // a value that holds another effect with any touches is no fault of the plan, but it is named
        for p in a.parameters.iter().filter(|p| !p.holds.is_empty()) {
            let poor = p.sigma_with_unmodelled.is_none_or(|s| s > if p.unit == "mm" { 0.016 } else { 0.0018 });
            let said = a.says.contains(&format!("{} includes {}", p.name, p.holds.join(", ")));
            assert_eq!(said, poor, "{name} {}: {}", p.name, a.says);
        }
    }
}

/// Rows of which some are special cases of one (a run-out with and without an encoder that reads it) and one nears another where a
/// plan lets the axes go far before each pose (a wind-up and a backlash): more pairs, and no fault of the plan.
const LATER: [&str; 4] = ["windup-", "encoder-eccentricity-", "block-own-size", "rehomed-"];

/// A lost position may look like blocks that slip at the same moment, along the line of C for example.
const LOST: &str = "lost-position-";
