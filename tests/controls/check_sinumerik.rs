//! `check` for SINUMERIK: what is generated passes on every machine and in every variant, what is edited is caught with the
//! right words.

use crate::edits;

use axiscal::check::{Against, Checked, check};
use axiscal::diag::{Failure, source};
use axiscal::machine::{self, Machine};
use axiscal::post::{Postprocessor, parse};
use axiscal::program::{self, Generated, Options};
use edits::original;
use std::path::Path;

fn machine(name: &str) -> Machine {
    let (machines, _) = machine::load(&source("machines", machine::BUILT_IN)).unwrap();
    machines.into_iter().find(|m| m.name == name).unwrap()
}

fn generated(machine: &Machine, program: &str, tcp: bool) -> Generated {
    let spec = program::choose(program::built_in().unwrap(), program, machine).unwrap();
    program::generate(machine, &spec, &Options { strict: false, tcp }).unwrap().0
}

/// The built-in postprocessor with these lines.
fn variant(lines: &str) -> Postprocessor {
    let text = format!("format = \"axiscal-postprocessor/1\"\nbased_on = \"sinumerik\"\nname = \"mine\"\n{lines}");
    parse(&source("mine.toml", text)).unwrap_or_else(|e| panic!("{e}")).0
}

const INCH: &str =
    "[number]\ndecimals = 7\nunverified = \"ours\"\n[log]\nunit = \"inch\"\ndecimals = 7\nunverified = \"ours\"\n";

fn checked(machine: &Machine, post: &Postprocessor, generated: &Generated, text: &str) -> Result<Checked, Failure> {
    let nc = post.program(machine, &generated.plan, &generated.path).unwrap();
    let (program, beside) = edits::parted(text, &nc.sources());
    let against = Against { plan: Some(&generated.plan), beside: &beside, ..Against::default() };
    check(machine, post, &source("p.mpf", program), &against)
}

fn passes(machine: &Machine, post: &Postprocessor, generated: &Generated, what: &str) {
    let nc = post.program(machine, &generated.plan, &generated.path).unwrap_or_else(|e| panic!("{what}: {e}"));
    let text = edits::whole(&nc);
    let checked = checked(machine, post, generated, &text).unwrap_or_else(|e| panic!("{what}: {e}"));
    let wrong: Vec<String> =
        checked.findings.iter().map(|f| format!("{} {f}", f.place().unwrap_or_default())).collect();
    assert!(wrong.is_empty(), "{what}: {wrong:#?}");
    assert_eq!(checked.touches, generated.plan.touches.len(), "{what}");
}

fn both_frames(name: &str, program: &str) {
    let machine = machine(name);
    let (post, _) = Postprocessor::load_built_in_or_file("sinumerik").unwrap();
    for tcp in [false, true] {
        passes(&machine, &post, &generated(&machine, program, tcp), &format!("{name} {program} tcp {tcp}"));
    }
}

#[test]
fn the_head_of_the_paper() {
    both_frames("swivel-head", "head");
}

#[test]
fn the_table_of_the_paper() {
    both_frames("swivel-head", "table");
}

#[test]
fn the_double_head() {
    both_frames("double-head", "double-head");
}

#[test]
fn a_trunnion() {
    both_frames("trunnion", "basic");
}

#[test]
fn a_swivelling_table() {
    both_frames("swivel-table-b", "basic");
}

#[test]
fn a_nutating_table() {
    both_frames("nutating-b", "basic");
}

#[test]
fn a_trunnion_whose_axes_do_not_meet() {
    both_frames("trunnion-offset", "basic");
}

#[test]
fn a_program_with_another_stylus() {
    let (post, _) = Postprocessor::load_built_in_or_file("sinumerik").unwrap();
    let (head, trunnion) = (machine("swivel-head"), machine("trunnion"));
    passes(&head, &post, &generated(&head, "full", false), "full");
    passes(&trunnion, &post, &generated(&trunnion, "full", true), "full, tcp");
}

#[test]
fn the_program_in_the_tree() {
    let machine = machine("swivel-head");
    let (post, _) = Postprocessor::load_built_in_or_file("sinumerik").unwrap();
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("programs/emitted/sinumerik/head.mpf");
    let text = std::fs::read_to_string(file).unwrap();
    let generated = generated(&machine, "head", false);
    let beside = post.program(&machine, &generated.plan, &generated.path).unwrap().sources();
    let against = Against { plan: Some(&generated.plan), beside: &beside, ..Against::default() };
    let checked = check(&machine, &post, &source("head.mpf", text), &against).unwrap();
    assert!(checked.findings.is_empty(), "{:#?}", checked.findings);
    assert_eq!((checked.touches, checked.setups, checked.stops), (202, 3, 0));
}

#[test]
fn variants_of_a_user() {
    let machine = machine("swivel-head");
    let origin = machine::BUILT_IN.replacen(
        "origin = { X = 0.0, Y = 0.0, Z = 0.0",
        "origin = { X = 100.0, Y = -50.0, Z = 12.5",
        1,
    );
    let (moved, _) = machine::load(&source("machines", origin)).unwrap();
    let moved = moved.into_iter().find(|m| m.name == "swivel-head").unwrap();
    for (what, lines) in [
        ("inch", INCH),
        ("names", "[number]\naxis_names = { C = \"C1\", B = \"B1\" }\nsource = \"our machine\"\n"),
        ("modulo", "[settings]\nmodulo = \"C\"\n"),
        ("both modulo", "[settings]\nmodulo = \"BC\"\n"),
        (
            "the builder's M functions",
            "[settings]\nprobe_on = \"M65\"\nprobe_off = \"M66\"\nprobe = \"2\"\norient = \"no\"\n",
        ),
    ] {
        let post = variant(lines);
        for machine in [&machine, &moved] {
            for tcp in [false, true] {
                let at = machine.origin.get(axiscal::axes::AxisName::X);
                passes(machine, &post, &generated(machine, "table", tcp), &format!("{what} tcp {tcp} origin {at:?}"));
            }
        }
    }
    // an M function that the postprocessor file does not name
    let post = variant("[settings]\nprobe_on = \"M65\"\n");
    let generated = generated(&machine, "table", false);
    let nc = post.program(&machine, &generated.plan, &generated.path).unwrap();
    let text = edits::whole(&nc).replace("M65", "M64");
    let checked = checked(&machine, &post, &generated, &text).unwrap();
    assert!(checked.findings.iter().any(|f| f.code == "check::not_run" && f.message.contains("M64")));
}

/// The line with this beginning, the `nth` one, replaced.
fn with(text: &str, begins: &str, nth: usize, instead: &dyn Fn(&str) -> String) -> String {
    let mut seen = 0;
    let out: String = text
        .split_inclusive('\n')
        .map(|line| {
            seen += usize::from(line.starts_with(begins));
            if line.starts_with(begins) && seen == nth { instead(line) } else { line.to_owned() }
        })
        .collect();
    assert!(out != text, "nothing is changed in line {nth} that begins with {begins:?}");
    out
}

#[test]
fn edits_by_hand_are_caught_with_the_right_words() {
    let mut original = original("sinumerik", None);
    // nothing to compare with but the touches of the plan
    original.plan.programs.clear();
    let t = original.text.clone();
    let gone = |_: &str| String::new();
    let cases: Vec<(&str, String, &str, &str)> = vec![
        (
            "a sign changed",
            with(&t, "AXC_TOUCH(1", 1, &|l| l.replace(",-30,0,6,", ",30,0,6,")),
            "check::overtravel",
            "the search ends",
        ),
        (
            "a place over the block",
            with(&t, "AXC_RAPID(-30", 1, &|l| l.replace("11.3", "1.13")),
            "check::collision",
            "collision",
        ),
        (
            "a point lost",
            with(&t, "AXC_GUARDED(2,\"block x- face -X\",-40,0,1.5", 1, &|l| l.replace("1.5", "15")),
            "check::unguarded",
            "did not come",
        ),
        (
            "a rapid in place of a guarded move",
            with(&t, "AXC_GUARDED(1", 1, &|_| "G0 SUPA Z=10\n".into()),
            "check::unguarded",
            "",
        ),
        (
            "MEAS deleted",
            with(&t, "G1 SUPA X=AXT_X", 2, &|l| l.replace(" MEAS=1", "")),
            "check::collision",
            "collision",
        ),
        (
            "MEAS deleted on the way",
            with(&t, "G1 SUPA X=AXG_X", 1, &|l| l.replace(" MEAS=1", "")),
            "check::stops",
            "the probe triggered",
        ),
        (
            "the falling edge",
            with(&t, "G1 SUPA X=AXG_X", 1, &|l| l.replace("MEAS=1", "MEAS=-1")),
            "check::not_run",
            "rising edge",
        ),
        (
            "an axis not latched",
            with(&t, "G1 SUPA X=AXT_X", 3, &|l| l.replace(" Y=AXT_Y", "")),
            "check::not_run",
            "latched Y",
        ),
        (
            "a search beyond the block",
            with(&t, "AXC_TOUCH(1", 1, &|l| l.replace(",6,", ",-6,")),
            "check::not_the_plan",
            "end",
        ),
        (
            "a search at ten times its feed",
            with(&t, "AXC_TOUCH(1", 1, &|l| l.replace(",60,60,", ",600,60,")),
            "check::feed",
            "slow_feed",
        ),
        ("the way off the face removed", with(&t, "G1 SUPA X=AXT_SX+", 1, &gone), "check::stops", "does not close"),
        ("the retract removed", with(&t, "G1 SUPA X=AXT_SX+", 2, &gone), "check::stops", "does not close"),
        (
            "the retract into the block",
            with(&t, "AXT_BACK=", 2, &|l| l.replace("-0.5", "+0.5")),
            "check::in_contact",
            "first go back",
        ),
        (
            "a turn below the clearance",
            with(&t, "AXC_GUARDED(3,\"block x- face +Z\",-40,0,11.3", 1, &|l| l.replace("11.3", "2.3")),
            "check::turn_not_clear",
            "turns where",
        ),
        (
            "a turn without the lift",
            with(&t, "AXC_GUARDED(3,\"block x- face +Z\",-40,0,11.3", 1, &gone),
            "check::turn_not_clear",
            "turns where",
        ),
        ("a line of the log removed", with(&t, "AXT_LINE=SPRINT(\"P N%D S1", 1, &gone), "check::", ""),
        ("a stop removed", with(&t, "RET(\"AXC_END\")", 5, &gone), "check::goes_on", "no contact up to the end"),
        (
            "the check of the touch turned round",
            with(&t, "IF $AC_MEA[1]==0", 1, &|l| l.replace("==", "<>")),
            "check::stops",
            "missed",
        ),
        (
            "a full log goes unseen",
            with(&t, "IF AXT_ERR<>0", 3, &|l| l.replace("<>", "<")),
            "check::goes_on",
            "cannot be written",
        ),
        ("the old log stays", with(&t, "DELETE", 1, &gone), "check::log", "old log"),
        ("the units not set", with(&t, "G710", 1, &|l| l.replace("G710 ", "")), "check::limit", "outside"),
        ("absolute coordinates not set", with(&t, "G710", 1, &|l| l.replace("G90 ", "")), "check::", ""),
        ("exact stop not set", with(&t, "G710", 1, &|l| l.replace("G60 ", "")), "check::rounded", "corner"),
        ("the transformation left on", with(&t, "TRAFOOF", 1, &gone), "check::not_run", "TRAFOOF"),
        ("the length of the tool left on", with(&t, "D0", 1, &gone), "check::", ""),
        ("an offset left on", with(&t, "G0 SUPA X=AXR_X", 1, &|l| l.replace("SUPA ", "")), "check::", ""),
        // the ones before it are of the head, the clock and the dry run
        ("STOPRE removed", with(&t, "STOPRE", 6, &gone), "check::not_run", "STOPRE is missing"),
        ("the other input", with(&t, "IF $A_PROBE[1]", 2, &|l| l.replace("[1]", "[2]")), "check::not_run", "input"),
        (
            "a deflected probe goes unseen",
            with(&t, "IF $A_PROBE[1]==1", 2, &|l| l.replace("==1", "==6")),
            "check::goes_on",
            "deflected before",
        ),
        (
            "nobody looks at the probe",
            with(&t, "IF $A_PROBE[1]==1", 2, &|_| "IF 1==2\n".into()),
            "check::not_run",
            "without a look",
        ),
        (
            "a message removed",
            // with its stop: that alone would be shown
            {
                let t =
                    with(&t, "MSG(\"AXISCAL: touch \"<<AXT_ID<<\", \"<<AXT_SAYS<<\": the probe is deflected", 1, &gone);
                with(&t, "M0", 7, &gone)
            },
            "check::goes_on",
            "no message",
        ),
        ("no end", with(&t, "M30", 1, &gone), "check::not_understood", "in a file of its own"),
        (
            "a word that is not known",
            with(&t, "G0 SUPA Z=349", 1, &|l| l.replace("SUPA", "SUPB")),
            "check::not_known",
            "SUPB",
        ),
        (
            "begins later",
            with(&t, "DEF INT AXC_FROM", 1, &|l| l.replace("=1", "=2")),
            "check::begins_later",
            "set-up 2",
        ),
    ];
    let mut wrong = Vec::new();
    for (what, text, code, words) in cases {
        let findings = match original.checked(&text) {
            Err(failure) => failure.0,
            Ok(checked) => checked.findings,
        };
        let fits =
            |f: &axiscal::diag::Finding| f.code.starts_with(code) && f.message.contains(words) && f.place().is_some();
        if !findings.iter().any(fits) {
            let found: Vec<String> = findings.iter().map(|f| format!("{} {}", f.code, f.message)).collect();
            wrong.push(format!("{what}: {code} {words:?} is not among {found:#?}"));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn under_the_transformation_it_must_be_switched_on_with_the_length_of_the_probe() {
    let machine = machine("swivel-head");
    let (post, _) = Postprocessor::load_built_in_or_file("sinumerik").unwrap();
    let generated = generated(&machine, "table", true);
    let t = edits::whole(&post.program(&machine, &generated.plan, &generated.path).unwrap());
    let gone = |_: &str| String::new();
    for (what, text, words) in [
        ("TRAORI", with(&t, "TRAORI", 1, &gone), "TRAORI is missing"),
        ("D1", with(&t, "D1", 1, &gone), "D is missing"),
        ("D2", with(&t, "D1", 1, &|_| "D2\n".into()), "tool_edge"),
        ("the frame of the user", with(&t, "TRANS", 1, &gone), ""),
        ("the frame", with(&t, "TRANS X", 1, &gone), ""),
        ("MM in place of MW", t.replace("AXT_PX=$AA_MW", "AXT_PX=$AA_MM"), "the place of the contact"),
    ] {
        let findings = match checked(&machine, &post, &generated, &text) {
            Err(failure) => failure.0,
            Ok(checked) => checked.findings,
        };
        let said: Vec<&str> = findings.iter().map(|f| f.message.as_str()).collect();
        assert!(said.iter().any(|m| m.contains(words)), "{what}: {said:#?}");
    }
}

#[test]
fn what_it_does_not_know_has_its_line_and_column() {
    let original = original("sinumerik", None);
    let text = with(&original.text, "G0 SUPA Z=349", 1, &|l| l.replace("349", "349 CYCLE800()"));
    let line = text.lines().position(|l| l.contains("CYCLE800")).unwrap() + 1;
    let failure = original.checked(&text).unwrap_err();
    assert_eq!(failure.0[0].place().unwrap(), format!("edited:{line}:15"));
}

/// A fault in a program that another one calls is shown in its own file, with the line that it has there.
#[test]
fn a_fault_of_a_called_program_is_shown_in_its_file() {
    let (machine, (post, _)) = (machine("trunnion"), Postprocessor::load_built_in_or_file("sinumerik").unwrap());
    let generated = generated(&machine, "basic", false);
    let nc = post.program(&machine, &generated.plan, &generated.path).unwrap();
    let program = source("p.mpf", nc.text.as_str());
    for at_the_end in [false, true] {
        let mut beside = nc.sources();
        let (_, called) = beside.iter_mut().find(|(name, _)| name == "AXC_TOUCH.spf").unwrap();
        let text = called.inner();
        let text = if at_the_end { format!("{text}FOO BAR\n") } else { format!("FOO BAR\n{text}") };
        let line = if at_the_end { text.lines().count() } else { 1 };
        *called = source("AXC_TOUCH.spf", text);
        let failure = axiscal::check::grammar(&post, &program, &beside).unwrap_err();
        let place = failure.0.first().and_then(axiscal::diag::Finding::place);
        assert_eq!(place, Some(format!("AXC_TOUCH.spf:{line}:1")), "{failure}");
    }
}
