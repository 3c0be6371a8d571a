//! `check`: generated programs pass, edited ones are caught.

use crate::edits;

use edits::{Fate, original};

const CONTROLLERS: [&str; 7] =
    ["heidenhain", "linuxcnc", "fanuc", "haas", "sinumerik", "fanuc-inspection-plus", "haas-inspection-plus"];

/// How many random edits CI makes for each dialect; `examples/edits.rs` makes thousands.
const EDITS: u64 = 150;

/// `AXISCAL_EDITS=2000` makes as many in the test.
fn edits() -> u64 {
    std::env::var("AXISCAL_EDITS").ok().and_then(|n| n.parse().ok()).unwrap_or(EDITS)
}

#[test]
fn every_random_edit_is_refused_or_moves_identically() {
    for controller in CONTROLLERS {
        let original = original(controller, None);
        let fates = original.fates(edits(), 20260101);
        let number = |fate: Fate| fates.iter().filter(|(_, f)| *f == fate).count();
        let each = [Fate::NotRead, Fate::Refused, Fate::Unproven, Fate::Same, Fate::Remarked, Fate::Escaped];
        println!("{controller}: {:?}", each.map(|fate| (fate.clone(), number(fate))));
        let escaped: Vec<&String> = fates.iter().filter(|(_, f)| *f == Fate::Escaped).map(|(w, _)| w).collect();
        assert!(escaped.is_empty(), "{controller}: {escaped:#?}");
        // a check that refuses everything, or lets everything pass as the same, would show nothing
        for fate in [Fate::NotRead, Fate::Refused, Fate::Unproven, Fate::Same] {
            assert!(fates.iter().any(|(_, f)| *f == fate), "{controller}: no edit was {fate:?}");
        }
    }
}

/// The first line that begins with a text, replaced.
pub(super) fn with(text: &str, begins: &str, nth: usize, instead: &dyn Fn(&str) -> String) -> String {
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
    for controller in ["linuxcnc", "fanuc", "haas"] {
        let mut original = original(controller, None);
        let linuxcnc = controller == "linuxcnc";
        let rapid = if linuxcnc { "o<rapid> call [-30] [0] [11.3]" } else { "G65 P9103 X-30. Y0. Z11.3" };
        let guarded = if linuxcnc { "o<guarded> call [-30] [0] [10]" } else { "G65 P9102 A1. X-30. Y0. Z10." };
        let search = if linuxcnc { "o<touch> call [1] " } else { "G65 P9101 A1. " };
        let retract = if linuxcnc { "G38.3 X#<_axiscal_x>" } else { "G31 X#4 " };
        let t = original.text.clone();
        let cases: Vec<(&str, String)> = vec![
            ("a sign changed", with(&t, "G0 X-", 1, &|l| l.replace("X-", "X"))),
            ("a lift by a tenth", with(&t, rapid, 1, &|l| l.replace("11.3", "1.13"))),
            ("a rapid in place of a guarded move", with(&t, guarded, 1, &|_| "G0 Z10.\n".to_owned())),
            (
                "a search beyond the block",
                with(&t, search, 1, &|l| l.replace(" [6] ", " [-6] ").replace(" Z6. ", " Z-6. ")),
            ),
            (
                "the search at ten times its feed",
                with(&t, search, 1, &|l| l.replace(" [60] [60]", " [600] [60]").replace(" F60. ", " F600. ")),
            ),
            ("a retract removed", with(&t, retract, 1, &|_| String::new())),
            ("a line of the log removed", {
                let log = if linuxcnc { "(LOG,P N%.0f#1 S1" } else { "DPRNT[P*N#1[50]*S1" };
                with(&t, log, 1, &|_| String::new())
            }),
            ("a stop removed", {
                let stop = if linuxcnc { "o<touch> return [0]" } else { "M99 P9" };
                with(&t, stop, if linuxcnc { 5 } else { 1 }, &|_| String::new())
            }),
            ("the units not set", with(&t, "G21", 1, &|l| l.replace("G21 ", ""))),
            ("absolute coordinates not set", with(&t, "G21", 1, &|l| l.replace("G90 ", ""))),
        ];
        // up instead of down is safe on LinuxCNC, a hundredth of it on the others is not: changed it is on all
        let lost = with(&t, rapid, 1, &|l| l.replace("11.3", "113"));
        assert!(!original.codes(&lost).is_empty(), "{controller}: a decimal point lost was not caught");
        // all the others are refused for what they do, with nothing to compare with but the plan's touches
        original.plan.programs.clear();
        for (what, text) in cases {
            let codes = original.codes(&text);
            assert!(!codes.is_empty(), "{controller}: {what} was not caught");
        }
    }
}

#[test]
fn edits_by_hand_of_a_program_for_a_package_are_caught() {
    for controller in ["fanuc-inspection-plus", "haas-inspection-plus"] {
        let mut original = original(controller, None);
        original.plan.programs.clear();
        let t = original.text.clone();
        let guarded = "G65 P9810";
        for (what, text, code) in [
            (
                "a rapid in its place",
                with(&t, guarded, 1, &|l| format!("G0 {}\n", l.split(' ').nth(2).unwrap_or(""))),
                "check::unguarded",
            ),
            ("a move at a feed in its place", with(&t, guarded, 1, &|l| l.replace(guarded, "G1")), "check::unguarded"),
            ("another macro", with(&t, guarded, 1, &|l| l.replace("P9810", "P9811")), "check::not_run"),
            (
                "without its feed",
                with(&t, guarded, 1, &|l| format!("{}\n", l.split(" F").next().unwrap_or(""))),
                "check::not_run",
            ),
            ("one that turns", with(&t, guarded, 1, &|l| l.replace(" F", " C10. F")), "check::not_run"),
            ("too fast", with(&t, guarded, 1, &|l| l.replace(" F", " F9")), "check::feed"),
            ("too deep", with(&t, "G65 P9810 Z10.", 1, &|l| l.replace("Z10.", "Z1.")), "check::stops"),
            ("a switch that moves", with(&t, "G65 P9832", 1, &|l| l.replace("P9832", "P9832 X1.")), "check::not_run"),
        ] {
            let codes = original.codes(&text);
            assert!(codes.contains(&code), "{controller}: {what}: {codes:?}");
        }
    }
}

#[test]
fn a_run_that_starts_again_meets_each_block_slowly() {
    for (controller, slow, fast) in [
        ("linuxcnc", "_axiscal_from> GT 1] *", "_axiscal_from> GT 9] *"),
        ("fanuc", "IF[#1LE1]GOTO", "IF[#1LE9]GOTO"),
        ("haas", "IF[#1LE1]GOTO", "IF[#1LE9]GOTO"),
        ("heidenhain", "", ""),
    ] {
        let mut original = original(controller, None);
        original.plan.programs.clear();
        if controller == "heidenhain" {
            let edited = original.text.replacen("FN 0: Q1668 = +2", "FN 0: Q1668 = +9", 1);
            assert_ne!(edited, original.text);
            let codes = original.codes(&edited);
            assert!(codes.contains(&"check::feed"), "{controller}: {codes:?}");
            continue;
        }
        assert_eq!(original.text.matches(slow).count(), 1, "{controller}");
        let codes = original.codes(&original.text.replace(slow, fast));
        assert!(codes.contains(&"check::feed"), "{controller}: {codes:?}");
    }
}

#[test]
fn a_probe_that_is_not_ready_is_found_before_the_first_move() {
    for (controller, says) in [
        ("linuxcnc", "(DEBUG,axiscal: the probe is triggered, or not switched on"),
        ("fanuc", "#3006=1(PROBE"),
        ("haas", "#3006=1(PROBE"),
        ("heidenhain", "QS1600 = \"AXISCAL: the probe"),
    ] {
        let mut original = original(controller, None);
        original.plan.programs.clear();
        // the message and the stop behind it taken out: it would go on with the probe deflected
        let text = original.without_numbers();
        let lines: Vec<&str> = text.split_inclusive('\n').collect();
        let message = lines.iter().position(|l| l.starts_with(says)).unwrap();
        let to = message
            + match controller {
                "linuxcnc" => 2,
                "heidenhain" => 4,
                _ => 3,
            };
        let edited: String = lines[..message].iter().chain(&lines[to..]).copied().collect();
        let codes = original.codes(&original.numbered(&edited));
        assert!(codes.contains(&"check::goes_on"), "{controller}: {codes:?}");
    }
}

/// The number of the first line (from 1) that differs.
fn first_other_line(one: &str, two: &str) -> usize {
    1 + one.lines().zip(two.lines()).position(|(a, b)| a != b).unwrap()
}

/// Every place that holds a text, with what stands there instead.
pub(super) fn all(text: &str, from: &str, to: &str) -> String {
    assert!(text.contains(from), "{from:?} does not stand in the program");
    text.replace(from, to)
}

#[test]
fn what_no_run_can_show_is_named_by_its_line_and_refused() {
    for (controller, cases) in [
        ("fanuc", &[("LT0.02]", "LT0.021]"), ("GT1.]", "GT1.1]"), ("GT0.25]", "GT0.26]"), ("M99 P9", "M99 P8")][..]),
        ("haas", &[("LT0.02]", "LT0.021]"), ("GT1.]", "GT1.1]"), ("GT0.25]", "GT0.26]")]),
        ("sinumerik", &[("ABS(AXT_OFF)>1", "ABS(AXT_OFF)>1.15"), ("ABS(AXT_OFF)>1", "AXT_OFF>1")]),
        ("heidenhain", &[("Q1605 GT +1 GOTO", "Q1605 GT +1.1 GOTO"), ("GT +0.25 GOTO", "GT +0.26 GOTO")]),
        ("linuxcnc", &[("GT 1]]", "GT 1.1]]"), ("GT 0.25]]", "GT 0.26]]")]),
    ] {
        let original = original(controller, None);
        for (from, to) in cases {
            let edited = original.text.replacen(from, to, 1);
            assert_ne!(edited, original.text, "{controller}: {from}");
            let (code, line, says) = original.finding(&edited);
            assert_eq!(
                (code, line),
                ("check::changed", first_other_line(&original.text, &edited)),
                "{controller} {from}: {says}"
            );
        }
    }
    // and it says why, where the program does the same in every run
    let original = original("fanuc", None);
    let (_, _, says) = original.finding(&original.text.replacen("GT0.25]", "GT0.26]", 1));
    assert!(says.contains("not the statement that axiscal wrote") && says.contains("not proven"), "{says}");
}

#[test]
fn a_jump_that_was_taken_out_is_named_before_what_follows_from_it() {
    for controller in ["fanuc", "haas"] {
        let original = original(controller, None);
        let lines: Vec<&str> = original.text.split_inclusive('\n').collect();
        let jumps: Vec<usize> = (0..lines.len()).filter(|i| lines[*i].starts_with("IF[")).collect();
        for taken in jumps.iter().step_by(jumps.len() / 12) {
            let edited = [&lines[..*taken], &lines[taken + 1..]].concat().concat();
            let (code, line, says) = original.finding(&edited);
            let first = first_other_line(&original.text, &edited);
            // a label or a remark is no statement; the condition before it may lead elsewhere now
            assert!(
                code == "check::changed" && (first - 1..first + 3).contains(&line),
                "{controller} {first}: {line} {says}"
            );
            assert_eq!(original.codes(&edited)[0], "check::changed", "{controller} {first}");
        }
    }
}

#[test]
fn a_word_that_is_not_known_is_said_before_what_goes_with_it() {
    let original = original("fanuc", None);
    for (block, expected) in [("M3 S500", "M3 is not known to axiscal"), ("G28 Z0.", "G28 is not known to axiscal")] {
        let edited = with(&original.text, "M9", 1, &|l| format!("{l}{block}\n"));
        let says = original.says(&edited);
        assert!(says.iter().any(|s| s.contains(expected)), "{block}: {says:?}");
    }
}

#[test]
fn remarks_blanks_and_how_a_number_is_spelled_do_not_matter() {
    for (controller, edits) in [
        ("fanuc", &[("(TOUCH 1", "(TOUCH ONE"), ("GT1.]", "GT1.0]"), ("\n", "\r\n"), ("N640", "N99")][..]),
        ("linuxcnc", &[("(touch 1", "(touch one"), ("GT 1]]", "GT 1.0]]"), ("G38.3 ", "  G38.3  "), ("\n", "\r\n")]),
        ("sinumerik", &[("; touch 1", "; touch one"), (">1\n", ">1.0\n"), ("\n", " \r\n")]),
        ("heidenhain", &[("; touch 1", "; touch one"), ("GT +1 GOTO", "GT +1.0 GOTO")]),
    ] {
        let original = original(controller, None);
        for (from, to) in edits {
            let edited = original.text.replace(from, to);
            assert!(edited != original.text || *from == "N640", "{controller}: {from}");
            // a label with what goes to it
            let edited = if *from == "N640" { edited.replace("GOTO640", "GOTO99") } else { edited };
            assert_eq!(original.fate(&edited), Fate::Same, "{controller}: {from:?} {:?}", original.codes(&edited));
        }
    }
}

#[test]
fn a_plan_of_an_older_version_says_that_it_does_not_know_the_statements() {
    let mut original = original("fanuc", None);
    for proof in original.plan.programs.values_mut() {
        proof.steps.clear();
        proof.steps_sha256.clear();
    }
    let (code, _, says) = original.finding(&original.text);
    assert_eq!(code, "check::older_plan", "{says}");
    assert_eq!(original.codes(&original.text.replacen("GT0.25]", "GT0.26]", 1)), ["check::older_plan"]);
    assert_eq!(original.codes(&with(&original.text, "M9", 1, &|_| String::new())), ["check::older_plan"]);
}

#[test]
fn late_contacts_reference_systems_holds_and_signs_are_seen_without_a_program_to_compare_with() {
    for (controller, cases) in [
        (
            "fanuc",
            &[
                ("LT0.02]GOTO", "LT002]GOTO", "check::goes_on"),
                ("LT0.02]GOTO", "LT0.09]GOTO", "check::goes_on"),
                ("#3004=2", "#3004=3", "check::not_run"),
                ("G0 ", "G-0 ", "check::not_understood"),
                ("G53\n", "G53 P-10\n", "check::not_understood"),
                ("M5", "M-5", "check::not_understood"),
            ][..],
        ),
        ("haas", &[("LT0.02]GOTO", "LT002]GOTO", "check::goes_on"), ("#3004=2", "#3004=3", "check::not_run")]),
        ("linuxcnc", &[("G0 ", "G-0 ", "check::not_understood"), ("M5 ", "M-5 ", "check::not_understood")]),
        ("sinumerik", &[("G0 ", "G-0 ", "check::not_understood"), ("M5\n", "M-5\n", "check::not_understood")]),
        (
            "heidenhain",
            &[("REFERENCE SYSTEM:1", "REFERENCE SYSTEM:0", "check::not_run"), ("M5", "M-5", "check::not_understood")],
        ),
    ] {
        let mut original = original(controller, None);
        original.plan.programs.clear();
        for (from, to, code) in cases {
            let codes = original.codes(&all(&original.text, from, to));
            assert!(codes.contains(code), "{controller}: {from} to {to}: {codes:?}");
        }
    }
}

#[test]
fn a_set_up_that_does_not_exist_moves_nothing() {
    for (controller, line, number) in [
        ("fanuc", "#1=", "#1={n}\n"),
        ("haas", "#1=", "#1={n}\n"),
        ("heidenhain", "FN 0: Q1600 = ", "FN 0: Q1600 = +{n}\r\n"),
        ("linuxcnc", "#<_axiscal_from> = ", "#<_axiscal_from> = {n}\n"),
        ("sinumerik", "DEF INT AXC_FROM=", "DEF INT AXC_FROM={n}\n"),
    ] {
        let original = original(controller, None);
        let t = original.without_numbers();
        for n in ["7", "0", "1.5"] {
            if controller == "sinumerik" && n == "1.5" {
                continue; // an INT
            }
            let edited = original.numbered(&with(&t, line, 1, &|_| number.replace("{n}", n)));
            for from in [1, 7] {
                let (checked, no_setup) = original.begun(&edited, from);
                assert!(no_setup, "{controller} {n}: {:?}", checked.findings);
            }
        }
        // the first line with which the program says so, taken out with its stop: then it would move
        let (checked, no_setup) = original.begun(&original.text, 7);
        assert!(no_setup, "{controller}: {:?}", checked.findings);
        let (checked, no_setup) =
            original.begun(&original.numbered(&with(&t, line, 1, &|_| number.replace("{n}", "2"))), 2);
        // that the head says another number is said
        let wrong = checked.findings.iter().any(|f| f.code != "check::edited");
        assert!(!no_setup && !wrong, "{controller}: {:?}", checked.findings);
    }
}

#[test]
fn a_program_that_does_not_look_at_the_number_of_the_set_up_is_found() {
    for (controller, from, to) in [
        ("fanuc", "IF[#1LE2]GOTO28\n", "GOTO28\n"),
        ("haas", "IF[#1LE2]GOTO28\n", "GOTO28\n"),
        ("heidenhain", "", ""),
        ("linuxcnc", "o7 if [#<_task> AND", "o7 if [0 AND"),
        ("sinumerik", "IF (AXC_FROM<1) OR (AXC_FROM>2)\n", "IF AXC_FROM<1\n"),
    ] {
        let mut original = original(controller, None);
        original.plan.programs.clear();
        let edited = if to.is_empty() {
            let line = "FN 11: IF +Q1600 GT +2 GOTO LBL 25";
            original.numbered(&with(&original.without_numbers(), line, 1, &|_| String::new()))
        } else {
            all(&original.text, from, to)
        };
        let codes = original.codes(&edited);
        assert!(codes.contains(&"check::start"), "{controller}: {codes:?}");
    }
}

/// What an editor or a transfer may put into a remark, and what a control makes a block of.
#[test]
fn what_no_control_reads_as_a_remark_is_refused() {
    for (controller, begins, remark) in [
        ("linuxcnc", "(", "(UP)"),
        ("fanuc", "(", "(UP)"),
        ("haas", "(", "(UP)"),
        ("sinumerik", ";", "; UP"),
        ("heidenhain", "", "; UP"),
    ] {
        let original = original(controller, None);
        let line =
            original.text.lines().find(|l| l.starts_with(begins) && l.contains("axiscal") || l.contains("AXISCAL"));
        let line = line.unwrap_or_else(|| panic!("{controller}"));
        let with = |more: &str| {
            let end = original.text.find(line).unwrap() + line.len();
            let remark = if line.starts_with('(') || controller != "heidenhain" { remark } else { "" };
            format!("{} {}{}", &original.text[..end], remark.replace("UP", &format!("UP{more}")), &original.text[end..])
        };
        assert!(
            controller == "heidenhain" || original.codes(&with("")) == ["check::edited"],
            "{controller}: {:?}",
            original.codes(&with(""))
        );
        for bad in ["\r.", "\rG0 Z-100.", "\0", "\u{c}", "\u{1a}", "\u{1b}", "\u{7f}"] {
            let codes = if controller == "heidenhain" {
                original.codes(&original.text.replacen("BEGIN PGM", &format!("{bad}BEGIN PGM"), 1))
            } else {
                original.codes(&with(bad))
            };
            assert_eq!(codes, ["check::not_understood"], "{controller}: {bad:?}");
        }
        for bad in ["100%", "; G0 Z-100.", "\u{d6}L", "\u{2028}"] {
            let refused = original.codes(&with(bad)).contains(&"check::not_understood");
            assert!(refused || !["fanuc", "haas"].contains(&controller), "{controller}: {bad:?}");
        }
    }
}

/// LinuxCNC does not look at the number of a line.
#[test]
fn line_numbers_do_not_matter() {
    let original = original("linuxcnc", None);
    let numbered = original.text.replace("\nG0 ", "\nN10 G0 ").replace("\nG1 ", "\nn0020G1 ");
    assert_ne!(numbered, original.text);
    assert_eq!(original.fate(&numbered), Fate::Same);
    for bad in ["N G0 ", "N-1 G0 ", "G0 N10 "] {
        assert_eq!(original.fate(&original.text.replacen("\nG0 ", &format!("\n{bad}"), 1)), Fate::NotRead, "{bad}");
    }
}
