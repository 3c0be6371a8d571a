//! `check`: generated programs pass, edited ones are caught.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)] // a panic in a test is a failure with its place

#[path = "check/edits.rs"]
mod edits;

use edits::{Fate, original};

const CONTROLLERS: [&str; 4] = ["linuxcnc", "fanuc", "haas", "sinumerik"];

/// How many random edits CI makes for each dialect; `examples/edits.rs` makes thousands.
const EDITS: u64 = 150;

#[test]
fn every_random_edit_is_refused_or_moves_identically() {
    for controller in CONTROLLERS {
        let original = original(controller, None);
        let fates = original.fates(EDITS, 20260101);
        let escaped: Vec<&String> = fates.iter().filter(|(_, f)| *f == Fate::Escaped).map(|(w, _)| w).collect();
        assert!(escaped.is_empty(), "{controller}: {escaped:#?}");
        // a check that refuses everything, or lets everything pass as the same, would show nothing
        for fate in [Fate::NotRead, Fate::Refused, Fate::Same] {
            assert!(fates.iter().any(|(_, f)| *f == fate), "{controller}: no edit was {fate:?}");
        }
    }
}

/// The first line that begins with a text, replaced.
fn with(text: &str, begins: &str, nth: usize, instead: &dyn Fn(&str) -> String) -> String {
    let mut seen = 0;
    let mut done = false;
    let lines = text.split_inclusive('\n').map(|line| {
        if line.starts_with(begins) {
            seen += 1;
            if seen == nth {
                done = true;
                return instead(line);
            }
        }
        line.to_owned()
    });
    let out: String = lines.collect();
    assert!(done, "no line {nth} begins with {begins:?}");
    out
}

#[test]
fn edits_by_hand_are_caught() {
    for controller in CONTROLLERS {
        let mut original = original(controller, None);
        let linuxcnc = controller == "linuxcnc";
        let guarded = if linuxcnc { "G38.3 " } else { "G31 " };
        let search = if linuxcnc { "G38.3 Z6" } else { "G31 Z6." };
        let retract = if linuxcnc { "G38.3 X" } else { "G31 X" };
        let t = original.text.clone();
        let cases: Vec<(&str, String)> = vec![
            ("a sign changed", with(&t, "G0 X-", 1, &|l| l.replace("X-", "X"))),
            ("a lift by a tenth", with(&t, "G0 Z11.3", 1, &|l| l.replace("11.3", "1.13"))),
            (
                "a rapid in place of a guarded move",
                with(&t, guarded, if linuxcnc { 2 } else { 1 }, &|l| {
                    format!("G0 {}\n", l.split(' ').nth(1).unwrap_or(""))
                }),
            ),
            ("a search beyond the block", with(&t, search, 1, &|l| l.replace("Z6", "Z-6"))),
            ("the search at ten times its feed", with(&t, search, 1, &|l| l.replace("F60", "F600"))),
            ("a retract removed", with(&t, retract, 1, &|_| String::new())),
            ("a line of the log removed", {
                let log = if linuxcnc { "(LOG,P N2 S1" } else { "DPRNT[P*N2*S1" };
                with(&t, log, 1, &|_| String::new())
            }),
            ("a stop removed", {
                let stop = if linuxcnc { "o<axiscal> return [1]" } else { "GOTO9" };
                with(&t, stop, if linuxcnc { 2 } else { 3 }, &|_| String::new())
            }),
            ("the units not set", with(&t, "G21", 1, &|l| l.replace("G21 ", ""))),
            ("absolute coordinates not set", with(&t, "G21", 1, &|l| l.replace("G90 ", ""))),
        ];
        // up instead of down is safe on LinuxCNC, a hundredth of it on the others is not: changed it is on all
        let lost = with(&t, "G0 Z11.3", 1, &|l| l.replace("11.3", "113"));
        assert!(!original.codes(&lost).is_empty(), "{controller}: a decimal point lost was not caught");
        // all the others are refused for what they do, with nothing to compare with but the plan's touches
        original.plan.programs.clear();
        for (what, text) in cases {
            let codes = original.codes(&text);
            assert!(!codes.is_empty(), "{controller}: {what} was not caught");
        }
    }
}
