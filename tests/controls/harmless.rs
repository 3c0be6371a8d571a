//! Edits that people make at the control: those that harm nothing pass with a remark, those that are dangerous never do.
//!
//! The kinds are those of a list that machinists gave. Each is made wherever it can stand in a program, or at several places.

use crate::edits::{self, Original};
use axiscal::check::Checked;
use axiscal::diag::Severity;
use rayon::prelude::*;

const CONTROLLERS: [&str; 5] = ["linuxcnc", "fanuc", "haas", "sinumerik", "heidenhain"];

/// A kind of edit and texts that it makes of a program.
type Kind = (&'static str, Vec<String>);

/// How a control writes what people put in.
struct Words {
    remark: &'static str,
    stops: &'static [&'static str],
    coolant: &'static [&'static str],
    dwell: &'static str,
    modes: &'static [&'static str],
    /// Before the feed of positioning in the head, and the feed.
    feed: (&'static str, &'static str, &'static str),
    /// A call of a touch begins so.
    touch: &'static str,
    /// A text of a message, and another.
    message: (&'static str, &'static str),
}

fn words(controller: &str) -> Words {
    match controller {
        "linuxcnc" => Words {
            remark: "(seen by the day shift)",
            stops: &["M0", "M1"],
            coolant: &["M8", "M9"],
            dwell: "G4 P0.5",
            modes: &["G90", "G21", "G17", "G90 G40"],
            feed: ("#<_axiscal_feed> = ", "1500", "800"),
            touch: "o<touch> call",
            message: ("(DEBUG,axiscal: missed", "(DEBUG,axiscal: not found"),
        },
        "fanuc" | "haas" => Words {
            remark: "(SEEN BY THE DAY SHIFT)",
            stops: &["M0", "M1"],
            coolant: &["M8", "M9"],
            dwell: "G4 P500",
            modes: &["G90", "G21", "G17", "G90 G40"],
            feed: ("#20=", "1500.", "800."),
            touch: "G65 P9101",
            message: ("#3006=1(MISSED", "#3006=1(NOT FOUND"),
        },
        "sinumerik" => Words {
            remark: "; seen by the day shift",
            stops: &["M0", "M1"],
            coolant: &["M8", "M9"],
            dwell: "G4 F0.5",
            modes: &["G90", "G710", "G17", "G90 G40"],
            feed: ("DEF REAL AXC_FEED=", "1500", "800"),
            touch: "AXC_TOUCH(",
            message: (": missed, no contact", ": not found, no contact"),
        },
        _ => Words {
            remark: "; seen by the day shift",
            stops: &["STOP", "M0", "M1"],
            coolant: &["M8", "M9"],
            dwell: "CYCL DEF 9.0 DWELL TIME\r\nCYCL DEF 9.1 DWELL0.5",
            modes: &[],
            feed: ("FN 0: Q1699 = ", "+1500", "+800"),
            touch: "CALL LBL 1\r",
            message: ("missed, no contact", "not found, no contact"),
        },
    }
}

/// The text with a line before the `nth` line that begins with a text.
fn put_before(text: &str, begins: &str, nth: usize, line: &str) -> String {
    let end = if text.contains("\r\n") { "\r\n" } else { "\n" };
    let mut seen = 0;
    let lines = text.split_inclusive('\n').map(|l| {
        seen += usize::from(l.starts_with(begins));
        if l.starts_with(begins) && seen == nth { format!("{line}{end}{l}") } else { l.to_owned() }
    });
    let edited: String = lines.collect();
    assert_ne!(edited, text, "no line {nth} begins with {begins:?}");
    edited
}

/// Everything outside of texts in quotes and of files' names in small letters.
fn small_letters(text: &str) -> String {
    let mut quoted = false;
    let mut small = |c: char| {
        quoted = (quoted != (c == '"')) && c != '\n';
        if quoted { c } else { c.to_ascii_lowercase() }
    };
    let mut line = |l: &str| if l.starts_with("@@ ") { l.to_owned() } else { l.chars().map(&mut small).collect() };
    text.split_inclusive('\n').map(&mut line).collect()
}

fn harmless(controller: &str, t: &str) -> Vec<Kind> {
    let w = words(controller);
    let before_touches = |line: &str| vec![put_before(t, w.touch, 1, line), put_before(t, w.touch, 3, line)];
    let all = |lines: &[&str]| lines.iter().flat_map(|line| before_touches(line)).collect::<Vec<_>>();
    let comment = if controller == "heidenhain" || controller == "sinumerik" { "; " } else { "(" };
    let title = t.lines().find(|l| l.starts_with(comment)).unwrap();
    let (before, feed, slower) = w.feed;
    let mut kinds = vec![
        ("a remark", before_touches(w.remark)),
        ("the text of a remark", vec![t.replacen(title, w.remark, 1)]),
        ("a stop", all(w.stops)),
        ("coolant", all(w.coolant)),
        ("a dwell", all(&[w.dwell])),
        ("a slower feed", vec![t.replacen(&format!("{before}{feed}"), &format!("{before}{slower}"), 1)]),
        ("trailing blanks", vec![t.replace('\n', " \n").replace("\r \n", " \r\n")]),
        ("the text of a message", vec![t.replacen(w.message.0, w.message.1, 1)]),
        (
            "another way to write a number",
            vec![match controller {
                "linuxcnc" => t.replacen("[-30] [0] [10]", "[-30.000] [0] [10.0]", 1),
                "fanuc" | "haas" => t.replacen("X-30. Y0. Z10.", "X-30.000 Y0. Z10.0", 1),
                "sinumerik" => t.replacen(",-30,0,10,", ",-30.000,0,10.0,", 1),
                _ => t.replacen("FN 0: Q1653 = +10\r", "FN 0: Q1653 = +10.000\r", 1),
            }],
        ),
    ];
    if controller != "heidenhain" {
        kinds.push(("CR LF", vec![t.replace('\n', "\r\n")]));
        kinds.push(("a blank line", before_touches("")));
        kinds.push(("modal words again", all(w.modes)));
    }
    if controller != "linuxcnc" {
        kinds.push(("small letters", vec![small_letters(t)]));
    }
    if controller == "linuxcnc" || controller == "sinumerik" {
        let numbered = |(n, l): (usize, &str)| {
            let plain = l.trim().is_empty() || l.starts_with(['%', 'o', '@', '(', ';']) || l.starts_with("PROC");
            if plain { l.to_owned() } else { format!("N{} {l}", 10 * n) }
        };
        kinds.push(("block numbers", vec![t.split_inclusive('\n').enumerate().map(numbered).collect()]));
    }
    if controller == "fanuc" || controller == "haas" {
        kinds.push(("another O number", vec![t.replacen("O9100\n", "O1234\n", 1)]));
        kinds
            .push(("blanks taken out", vec![t.replacen("G0 X-30.", "G0X-30.", 1), t.replacen("G90 G94", "G90G94", 1)]));
    }
    kinds
}

fn dangerous(controller: &str, t: &str) -> Vec<Kind> {
    let gone = |begins: &str, nth: usize| {
        let mut seen = 0;
        let kept = |l: &&str| {
            seen += usize::from(l.starts_with(begins));
            !(l.starts_with(begins) && seen == nth)
        };
        let edited: String = t.split_inclusive('\n').filter(kept).collect();
        assert_ne!(edited, t, "{controller}: no line {nth} begins with {begins:?}");
        edited
    };
    let doubled = |begins: &str, nth: usize| {
        let mut lines = t.split_inclusive('\n').filter(|l| l.starts_with(begins));
        let line = lines.nth(nth - 1).unwrap_or_else(|| panic!("{begins}"));
        put_before(t, begins, nth, line.trim_end())
    };
    let with = |from: &str, to: &str| {
        assert!(t.contains(from), "{controller}: {from:?} does not stand in the program");
        vec![t.replacen(from, to, 1)]
    };
    let w = words(controller);
    let put = |line: &str| vec![put_before(t, w.touch, 1, line), put_before(t, w.touch, 2, line)];
    let (guarded, rapid) = match controller {
        "linuxcnc" => ("o<guarded> call", "o<rapid> call"),
        "sinumerik" => ("AXC_GUARDED(", "G0 "),
        "heidenhain" => ("CALL LBL 2\r", "CALL LBL 3\r"),
        _ => ("G65 P9102", "G0 "),
    };
    let mut kinds = vec![
        ("a touch deleted", vec![gone(w.touch, 1), gone(w.touch, 2)]),
        ("a touch doubled", vec![doubled(w.touch, 1), doubled(w.touch, 3)]),
        ("a guarded move deleted", vec![gone(guarded, 1), gone(guarded, 2), gone(guarded, 3)]),
        ("a rapid deleted", vec![gone(rapid, 1), gone(rapid, 2)]),
    ];
    kinds.extend(match controller {
        "linuxcnc" => vec![
            ("a release deleted", vec![gone("G38.5 X#<bx>", 1), gone("G38.5 X#<_axiscal_x>", 1)]),
            ("a retract deleted", vec![gone("G38.3 X#<_axiscal_x>", 1)]),
            (
                "a retract as a rapid",
                with(
                    "G38.3 X#<_axiscal_x> Y#<_axiscal_y> Z#<_axiscal_z> F#<_axiscal_feed>",
                    "G0 X#<_axiscal_x> Y#<_axiscal_y> Z#<_axiscal_z>",
                ),
            ),
            ("a probing move as G1", with("G38.3 X#3 Y#4 Z#5 F#7", "G1 X#3 Y#4 Z#5 F#7")),
            ("a guarded move as G1", with("G38.3 X#1", "G1 X#1")),
            ("a sign", with("[-30] [0] [10]", "[30] [0] [10]")),
            ("a point lost", with("[-131.342] [0] [-15.8]", "[-131342] [0] [-15.8]")),
            ("another work offset", put("G55")),
            ("a tool length", put("G43 H1")),
            ("the spindle", put("M3 S100")),
            ("a turn before the lift", put("G0 C90")),
            ("ten times the feed of a search", with(" [60] [60]", " [600] [60]")),
            (
                "a check deleted",
                vec![gone("o9133 if", 1), t.replacen("o9133 if [#<_task> AND [#5070 EQ 1]]", "o9133 if [0 EQ 1]", 1)],
            ),
            ("increments", put("G91")),
            ("inches", put("G20")),
            ("arguments exchanged", with("o<touch> call [1] [1] [-30] [0]", "o<touch> call [1] [1] [0] [-30]")),
            ("arguments of the routine exchanged", with("G38.3 X#3 Y#4 Z#5 F#7", "G38.3 X#4 Y#3 Z#5 F#7")),
            ("one argument", with("[2] [60] [60]", "[1] [60] [60]")),
            ("a limit", with("GT 1]]", "GT 3]]")),
            ("a positive feed of positioning", with("#<_axiscal_feed> = 1500", "#<_axiscal_feed> = 15000")),
            ("a dry run below", with("#<_axiscal_dry> = 0", "#<_axiscal_dry> = -5")),
        ],
        "fanuc" | "haas" => vec![
            ("a release deleted", vec![gone("G1 X[#4", 1), gone("G1 X[#4", 2)]),
            ("a retract deleted", vec![gone("G31 X#4 ", 1)]),
            ("a retract as a rapid", with("G31 X#4 Y#5 Z#6 F#13", "G0 X#4 Y#5 Z#6")),
            ("a probing move as G1", with("G31 X#24 Y#25 Z#26 F#9\n", "G1 X#24 Y#25 Z#26 F#9\n")),
            ("a sign", with("A1. X-30. Y0. Z10.", "A1. X30. Y0. Z10.")),
            ("a point lost", with("X-131.342 Y0. Z-15.8", "X-131342. Y0. Z-15.8")),
            ("another work offset", put("G55")),
            ("a tool length", put("G43 H1")),
            ("the spindle", put("M3 S100")),
            ("a turn before the lift", put("G0 C90.")),
            ("ten times the feed of a search", with(" F60. E60.", " F600. E60.")),
            (
                "a check deleted",
                vec![gone("IF[ABS[#5061-#24]", 1), gone("IF[ABS[#5061-#24]", 2), gone("M99 P9", 1), gone("M99 P9", 2)],
            ),
            ("increments", put("G91")),
            ("inches", put("G20")),
            ("arguments exchanged", with("X-36. Y0. Z1.5", "X0. Y-36. Z1.5")),
            ("arguments of the routine exchanged", with("G31 X#24 Y#25 Z#26 F#9\n", "G31 X#25 Y#24 Z#26 F#9\n")),
            ("one argument", with(" D2. ", " D1. ")),
            ("a limit", with("GT1.]", "GT3.]")),
            ("a faster feed of positioning", with("#20=1500.", "#20=15000.")),
            ("back to another block", with("M99 P9", "M99 P8")),
            ("a dry run below", with("#19=0.\n", "#19=-5.\n")),
        ],
        "sinumerik" => vec![
            ("a release deleted", vec![gone("G1 SUPA X=AXT_SX+", 1), gone("G1 SUPA X=AXT_SX+", 2)]),
            ("a retract deleted", vec![gone("G1 SUPA X=AXT_SX ", 2)]),
            ("a retract as a rapid", with("G1 SUPA X=AXT_SX+AXT_BACK", "G0 SUPA X=AXT_SX+AXT_BACK")),
            ("a probing move without MEAS", with("Z=AXT_Z MEAS=1 F=AXT_FS", "Z=AXT_Z F=AXT_FS")),
            ("a sign", with(",-30,0,10,AXC_FEED", ",30,0,10,AXC_FEED")),
            ("a point lost", with("-131.342,0,-15.8", "-131342,0,-15.8")),
            ("another work offset", put("G55")),
            ("a tool length", put("D1")),
            ("the spindle", put("M3")),
            ("a turn before the lift", put("G0 SUPA C=90")),
            ("ten times the feed of a search", with(",60,60,AXC_FEED", ",600,60,AXC_FEED")),
            ("a check deleted", vec![t.replacen("IF $AC_MEA[1]<>0", "IF 1==2", 1), gone("RET(\"AXC_END\")", 5)]),
            ("increments", put("G91")),
            ("inches", put("G700")),
            ("arguments exchanged", with("-36,0,1.5,2", "0,-36,1.5,2")),
            ("arguments of the routine exchanged", with("X=AXT_X Y=AXT_Y", "X=AXT_Y Y=AXT_X")),
            ("one argument", with(",6,2,60", ",6,1,60")),
            ("a limit", with("ABS(AXT_OFF)>1", "ABS(AXT_OFF)>3")),
            ("a faster feed of positioning", with("AXC_FEED=1500", "AXC_FEED=15000")),
            ("a dry run below", with("AXC_DRY=0\n", "AXC_DRY=-5\n")),
        ],
        _ => vec![
            ("a release deleted", with("MB0.5", "MB0")),
            ("a retract deleted", vec![gone("L X+Q1654", 1)]),
            ("a retract as a rapid", with("L X+Q1654 Y+Q1655 Z+Q1656 R0 FQ1699", "L X+Q1654 Y+Q1655 Z+Q1656 R0 FMAX")),
            ("a guarded move as a rapid", with("Z+Q1673 R0 FQ1699", "Z+Q1673 R0 FMAX")),
            ("a sign", with("FN 0: Q1663 = -4\r", "FN 0: Q1663 = +4\r")),
            ("a lower way up after the touch", with("FN 0: Q1667 = +11.3\r", "FN 0: Q1667 = +1.3\r")),
            ("a point lost", with("FN 0: Q1653 = +11.3\r", "FN 0: Q1653 = +113\r")),
            ("another tool", put("TOOL CALL 1 Z")),
            ("a datum shift", put("TRANS DATUM AXIS X+1")),
            ("the spindle", put("M3")),
            ("a turn before the lift", put("L C+90 R0 FMAX M91")),
            ("ten times the feed of a search", vec![put_before(t, "CALL LBL 1\r", 1, "FN 0: Q1665 = +600")]),
            ("a check deleted", vec![gone("FN 10: IF +Q1604 NE -1", 1), gone("FN 10: IF +Q1604 NE -1", 2)]),
            ("inches", with(" MM\r", " INCH\r")),
            ("arguments exchanged", with("FN 0: Q1651 = -40", "FN 0: Q1652 = -40")),
            ("arguments of the routine exchanged", with("IX+Q1681 IY+Q1682", "IX+Q1682 IY+Q1681")),
            ("one argument", with("FN 0: Q1664 = +2\r", "FN 0: Q1664 = +1\r")),
            ("a limit", with("Q1605 GT +1 ", "Q1605 GT +3 ")),
            ("a faster feed of positioning", with("Q1699 = +1500", "Q1699 = +15000")),
            ("a dry run below", with("Q1610 = +0\r", "Q1610 = -5\r")),
        ],
    });
    kinds
}

/// An edited program, checked: the exit code, and what is said.
fn checked(original: &Original, text: &str) -> (i32, Vec<String>) {
    let text = if original.post.block_numbers.is_some() { original.numbered(text) } else { text.to_owned() };
    match original.checked(&text) {
        Err(failure) => (2, failure.0.iter().map(|f| f.message.clone()).collect()),
        Ok(Checked { findings, .. }) => {
            let wrong = findings.iter().any(|f| f.severity == Severity::Error);
            (i32::from(wrong), findings.iter().map(|f| format!("{} {}", f.code, f.message)).collect())
        }
    }
}

#[test]
fn what_harms_nothing_passes_with_a_remark() {
    let mut wrong = Vec::new();
    for controller in CONTROLLERS {
        let original = edits::original(controller, None);
        let kinds = harmless(controller, &original.without_numbers());
        let failed: Vec<String> = kinds
            .par_iter()
            .filter_map(|(kind, texts)| {
                let bad = texts
                    .iter()
                    .map(|text| checked(&original, text))
                    .find(|(code, said)| *code != 0 || said.is_empty());
                bad.map(|(code, said)| format!("{controller}, {kind}: exit {code} {said:?}"))
            })
            .collect();
        println!("{controller}: {} of {} harmless kinds pass with a remark", kinds.len() - failed.len(), kinds.len());
        // nine in ten at least
        if failed.len() * 10 > kinds.len() {
            wrong.extend(failed);
        } else {
            failed.iter().for_each(|f| println!("{f}"));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn what_is_dangerous_never_passes() {
    let mut passed = Vec::new();
    for controller in CONTROLLERS {
        let original = edits::original(controller, None);
        let kinds = dangerous(controller, &original.without_numbers());
        let all: Vec<(&str, &String)> =
            kinds.iter().flat_map(|(kind, texts)| texts.iter().map(|t| (*kind, t))).collect();
        println!("{controller}: {} dangerous edits of {} kinds", all.len(), kinds.len());
        let escaped: Vec<String> = all
            .par_iter()
            .filter(|(_, text)| checked(&original, text).0 == 0)
            .map(|(kind, _)| format!("{controller}: {kind}"))
            .collect();
        passed.extend(escaped);
    }
    assert!(passed.is_empty(), "{}", passed.join("\n"));
}
