//! `check` of programs with other settings than the built-in ones: each setting can be what its file says, and what none names
//! is refused.

use crate::edits;

use axiscal::diag::source;
use axiscal::post::{Postprocessor, parse};

/// A variant of a built-in controller: its file with these lines.
fn variant(base: &str, lines: &str) -> Result<Postprocessor, axiscal::diag::Failure> {
    let text = format!("format = \"axiscal-postprocessor/1\"\nbased_on = {base:?}\nname = \"mine\"\n{lines}");
    parse(&source("mine.toml", text)).map(|(post, _)| post)
}

/// Values that a builder or a user may give each setting, as the guide and the files name them.
const SETTINGS: [(&[&str], &str, &[&str]); 43] = [
    (&["fanuc", "haas"], "touch_program", &["7001"]),
    (&["fanuc", "haas"], "guarded_program", &["7002"]),
    (&["fanuc", "haas"], "rapid_program", &["7003"]),
    (&["fanuc", "haas"], "stopped_in", &["#100", "#599"]),
    (&["fanuc", "haas"], "found_x", &["#100"]),
    (&["sinumerik"], "found_x", &["R1"]),
    (&["fanuc", "haas"], "found_y", &["#100"]),
    (&["sinumerik"], "found_y", &["R1"]),
    (&["fanuc", "haas"], "found_z", &["#100"]),
    (&["sinumerik"], "found_z", &["R1"]),
    (&["fanuc", "haas"], "found_off", &["#100"]),
    (&["sinumerik"], "found_off", &["R1"]),
    (&["fanuc", "haas"], "found_room", &["#100"]),
    (&["sinumerik"], "found_room", &["R1"]),
    (&["fanuc", "haas"], "last_alarm", &["99"]),
    (&["fanuc", "haas"], "dry_run", &["no"]),
    (&["fanuc", "haas"], "program_number", &["1234"]),
    (&["fanuc", "haas", "heidenhain", "sinumerik", "linuxcnc"], "triggered_within", &["0.08"]),
    (&["fanuc", "haas"], "missed_within", &["0.03"]),
    (&["fanuc", "haas", "sinumerik", "linuxcnc"], "release_feed", &["200"]),
    (&["fanuc", "haas"], "orient", &["", "M119 R", "M19 S", "M19 P"]),
    (&["heidenhain", "sinumerik", "linuxcnc"], "orient", &["no"]),
    (&["fanuc", "haas"], "probe_on", &["M101", "M59 P2", "M59 P1133", "M101\nM59 P1133"]),
    (&["fanuc", "haas"], "probe_off", &["M102", "M69 P2"]),
    (&["fanuc", "haas"], "probe_input", &["#1004", "#1032", "#11004"]),
    (&["fanuc", "haas"], "cancel", &["G69 G40 G80"]),
    (&["haas"], "dynamic_offset", &[""]),
    (&["fanuc"], "wait", &["M53", "G53"]),
    (&["haas"], "wait", &["M53", "G4 P500"]),
    (&["haas"], "read_ahead", &["G103 P1\nG4 P1"]),
    (&["fanuc", "haas", "heidenhain", "sinumerik"], "modulo", &["C"]),
    (&["fanuc", "haas", "sinumerik"], "time", &["no"]),
    (&["fanuc", "haas"], "tool_offset", &["5"]),
    (&["heidenhain", "sinumerik"], "probe_on", &["M27"]),
    (&["heidenhain", "sinumerik"], "probe_off", &["M28"]),
    (&["heidenhain"], "folder", &["TNC:\\PROBE\\"]),
    (&["heidenhain"], "cancel", &["M129\nPLANE RESET STAY\nM127"]),
    (&["sinumerik"], "probe", &["2"]),
    (&["sinumerik"], "tool_edge", &["D2"]),
    (&["linuxcnc"], "version", &["master"]),
    (&["linuxcnc"], "probe_on", &["M64 P0"]),
    (&["linuxcnc"], "probe_off", &["M65 P0"]),
    (&["fanuc-inspection-plus", "haas-inspection-plus"], "probe_input", &["#1004"]),
];

/// With --tcp only, and of the templates of that.
const OF_TCP: [&str; 2] = ["tcp", "tool_length"];

#[test]
fn every_setting_can_be_what_its_file_says() {
    for base in ["fanuc", "haas", "heidenhain", "sinumerik", "linuxcnc"] {
        let (post, _) = Postprocessor::load_built_in_or_file(base).unwrap();
        // texts of messages are tried below, all at once
        let is_tried = |n: &&String| !OF_TCP.contains(&n.as_str()) && !n.starts_with("text_");
        for name in post.settings.keys().filter(is_tried) {
            assert!(SETTINGS.iter().any(|(of, n, _)| of.contains(&base) && n == name), "{base}: {name} is not tried");
        }
    }
    for base in ["fanuc", "haas"] {
        let (post, _) = Postprocessor::load_built_in_or_file(base).unwrap();
        let texts = post.settings.keys().filter(|n| n.starts_with("text_"));
        let lines: String = texts.map(|n| format!("{n} = \"ours (no {})\"\n", n.len())).collect();
        assert!(lines.lines().count() > 5, "{base}: {lines}");
        edits::of(variant(base, &format!("[settings]\n{lines}")).unwrap_or_else(|e| panic!("{e}")), None);
    }
    for (of, name, values) in SETTINGS {
        for (base, value) in of.iter().flat_map(|base| values.iter().map(move |v| (base, v))) {
            let post = variant(base, &format!("[settings]\n{name} = {value:?}\n")).unwrap_or_else(|e| panic!("{e}"));
            // it is clean, or this says what is wrong
            let original = edits::of(post, None);
            if *name == *"probe_input" {
                assert!(original.text.contains(&format!("{value}EQ0")), "{base}: {value} is not asked");
            }
        }
    }
}

/// What no setting names is not the builder's, nor is what means the same to every control.
#[test]
fn what_no_setting_names_is_refused() {
    for base in ["fanuc", "haas"] {
        let with = |lines: &str| edits::of(variant(base, &format!("[settings]\n{lines}\n")).unwrap(), None);
        let original = with("probe_on = \"M59 P2\"");
        for other in ["M59 P3", "M59", "M58 P2", "M59 P2 R1"] {
            let codes = original.codes(&original.text.replacen("M59 P2\n", &format!("{other}\n"), 1));
            assert!(!codes.is_empty(), "{base}: {other}");
        }
        let original = with("orient = \"M119 R\"");
        assert!(original.codes(&original.text.replacen("M119 R", "M19 R", 1)).contains(&"check::not_run"), "{base}");
        // a look at the probe that does not lead to the stop
        let original = with("probe_input = \"#1004\"");
        assert!(!original.codes(&original.text.replacen("#1004EQ0", "#1004EQ1", 1)).is_empty(), "{base}");
        assert!(!original.codes(&original.text.replace("#1004", "#1005")).is_empty(), "{base}");
    }
    let original = edits::of(variant("heidenhain", "[settings]\nprobe_on = \"M27\"\n").unwrap(), None);
    assert!(!original.codes(&original.text.replacen("M27", "M26", 1)).is_empty());
}

/// Whatever number of decimals the log has, its fields hold what is written into them.
#[test]
fn the_fields_of_a_log_follow_its_decimals() {
    for base in ["fanuc", "haas"] {
        for (decimals, field, modulo) in [(3, "[53]", "100000."), (4, "[44]", "10000."), (5, "[35]", "1000.")] {
            let lines = format!("[log]\ndecimals = {decimals}\nunverified = \"ours\"\n");
            let original = edits::of(variant(base, &lines).unwrap(), None);
            let taken = format!("#33=#33-{modulo}*FIX[#33/{modulo}]");
            assert!(
                original.text.contains(&format!("K#33{field}")) && original.text.contains(&taken),
                "{base} {decimals}"
            );
        }
        // a field that is too narrow: Fanuc loses the first places of what is written into it
        let original = edits::of(variant(base, "[log]\ndecimals = 5\nunverified = \"ours\"\n").unwrap(), None);
        let narrow = original.text.replace("X#27[35]", "X#27[15]");
        assert_ne!(narrow, original.text);
        assert_eq!(original.codes(&narrow).contains(&"check::log"), base == "fanuc", "{base}");
        let text = original.text.replace("K#33[35]", "K#33[45]");
        assert_eq!(original.finding(&text).0, "check::not_understood", "{base}");
        assert!(original.finding(&text).2.contains("9 places"), "{base}");
        // a file that does not fit together
        let lines = "[log]\ndecimals = 5\nwhole_places = 3\ncheck_modulo = 10000.0\nunverified = \"ours\"\n";
        let refused = variant(base, lines).unwrap_err();
        assert!(refused.0.iter().any(|f| f.code == "post::check_modulo"), "{refused}");
    }
}

#[test]
fn inches_need_four_decimals() {
    for base in ["fanuc", "haas", "fanuc-inspection-plus", "haas-inspection-plus"] {
        let refused = variant(base, "[log]\nunit = \"inch\"\nunverified = \"ours\"\n").unwrap_err();
        let finding = refused.0.iter().find(|f| f.code == "post::inch_decimals").unwrap_or_else(|| panic!("{refused}"));
        assert!(finding.help.as_ref().is_some_and(|h| h.contains("[number] decimals = 4")), "{finding}");
    }
}
