//! `check` for HEIDENHAIN: edits by hand of a Klartext program and of the masks beside it are caught.

use crate::check::{all, with};
use crate::edits::original;

/// Lines from the first that begins with one text up to and with the next that begins with another, taken out.
fn without(text: &str, begins: &str, nth: usize, ends: &str) -> String {
    let lines: Vec<&str> = text.split_inclusive('\n').collect();
    let first = lines.iter().enumerate().filter(|(_, l)| l.starts_with(begins)).nth(nth - 1).unwrap().0;
    let last = first + lines[first..].iter().position(|l| l.starts_with(ends)).unwrap();
    lines[..first].iter().chain(&lines[last + 1..]).copied().collect()
}

#[test]
fn edits_by_hand_of_a_klartext_program_are_caught() {
    let mut original = original("heidenhain", None);
    let t = original.without_numbers();
    let fast = with(&t, "L X+Q1671", 1, &|l| l.replace("FQ1699", "FMAX"));
    let not_oriented = with(&t, "M19", 1, &|_| String::new());
    for text in [fast, not_oriented] {
        assert_eq!(original.codes(&original.numbered(&text)), ["check::changed"]);
    }
    // all the others are refused for what they do, with nothing to compare with but the plan's touches
    original.plan.programs.clear();
    let probe = "TCH PROBE 4.0";
    // the last one is that of a guarded move
    let stops = t.lines().filter(|l| l.trim_end() == "FN 9: IF +0 EQU +0 GOTO LBL 9").count();
    let turn = with(&t, "L B-35", 1, &|l| format!("L Z-20 R0 FMAX M91\r\n{l}"));
    let mut wrong = Vec::new();
    for (what, text, code) in [
        ("a sign changed", with(&t, "FN 0: Q1651 = -", 1, &|l| l.replace("= -", "= +")), "check::unknown_start"),
        ("a lift by a tenth", with(&t, "FN 0: Q1653 = +11.3", 1, &|l| l.replace("11.3", "1.13")), "check::collision"),
        ("a zero lost", with(&t, "FN 0: Q1653 = +10", 1, &|l| l.replace("10", "1")), "check::stops"),
        (
            "FMAX in a search",
            with(&t, "TCH PROBE 4.3 DIST+Q1684 FQ1665", 1, &|l| l.replace("FQ1665", "FMAX")),
            "check::not_understood",
        ),
        (
            "FMAX in a guarded move",
            with(&t, "TCH PROBE 4.3 DIST+Q1684 FQ1699", 1, &|l| l.replace("FQ1699", "FMAX")),
            "check::not_understood",
        ),
        ("a guarded move without its cycle", without(&t, probe, 5, "TCH PROBE 4.3"), "check::unguarded"),
        ("a block of a cycle lost", with(&t, "TCH PROBE 4.2", 3, &|_| String::new()), "check::not_understood"),
        ("a search lost", without(&t, probe, 2, "TCH PROBE 4.3"), "check::stops"),
        ("a call lost", with(&t, "CALL LBL 1\r", 1, &|_| String::new()), "check::touch_lacking"),
        (
            "a search beyond the block",
            with(&t, "FN 0: Q1663 = -4\r", 1, &|l| l.replace("-4", "-40")),
            "check::not_the_plan",
        ),
        (
            "a search at ten times its feed",
            with(&t, "FN 0: Q1665 = +60\r", 2, &|l| l.replace("+60", "+600")),
            "check::feed",
        ),
        ("a retract removed", without(&t, "Q1614", 1, "L X"), "check::in_contact"),
        (
            "a line of the log removed",
            with(&t, "FN 16: F-PRINT TNC:\\AXISCAL\\SMALL_P.A", 1, &|_| String::new()),
            "check::log",
        ),
        ("a stop removed", with(&t, "FN 9: IF +0 EQU +0 GOTO LBL 9\r", stops, &|_| String::new()), "check::goes_on"),
        ("the tilted plane of before", with(&t, "PLANE RESET", 1, &|_| String::new()), "check::not_run"),
        ("M128 of before", with(&t, "M129", 1, &|_| String::new()), "check::not_run"),
        ("machine coordinates lost", with(&t, "L X-", 1, &|l| l.replace(" M91", "")), "check::start"),
        ("a turn below the clearance", turn, "check::turn_not_clear"),
        (
            "a remark that takes the next block in",
            with(&t, ";", 2, &|l| format!("{} ~\r\n", l.trim_end())),
            "check::not_understood",
        ),
        ("a label that the control lacks", all(&t, "LBL 9\r", "LBL 99999\r"), "check::not_understood"),
    ] {
        let codes = original.codes(&original.numbered(&text));
        if !codes.contains(&code) {
            wrong.push(format!("{what}: {codes:?}"));
        }
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
    // a block number that is missing shows that a line is
    assert_eq!(original.codes(&with(&original.text, "90 ", 1, &|_| String::new())), ["check::not_understood"]);
}

#[test]
fn masks_are_a_part_of_a_klartext_program() {
    let mut original = original("heidenhain", None);
    let written = original.beside.clone();
    for (what, mask, from, to, code) in [
        ("two columns exchanged", "SMALL_P.A", "Q1621,Q1622", "Q1622,Q1621", "check::log"),
        ("decimals", "SMALL_P.A", "X%10.4LF", "X%10.3LF", "check::log"),
        ("it writes over the log", "SMALL_P.A", "M_APPEND", "M_TRUNCATE", "check::log"),
        ("it keeps the log in memory", "SMALL_P.A", "M_CLOSE;", "", "check::not_understood"),
        ("a form too few", "SMALL_P.A", " Y%10.4LF", "", "check::not_understood"),
        ("no end of the log", "SMALL_E.A", "E N", "X N", "check::log"),
        ("a message without its text", "AXISCAL_M.A", "%S", "%1.0LF", "check::not_understood"),
    ] {
        original.beside = written
            .iter()
            .map(|(name, text)| {
                let edited = if name == mask { text.inner().replace(from, to) } else { text.inner().clone() };
                assert!(name != mask || edited != *text.inner(), "{what}");
                (name.clone(), axiscal::diag::source(name, edited))
            })
            .collect();
        let codes = original.codes(&original.text);
        assert!(codes.contains(&code), "{what}: {codes:?}");
    }
    original.beside.clear();
    assert_eq!(original.codes(&original.text), ["check::not_understood"]);
}
