//! `axiscal check` from outside: exit codes, messages, the files beside a program.

use crate::edits;

use assert_cmd::Command;
use predicates::prelude::*;
use std::path::Path;

fn axiscal(folder: &Path) -> Command {
    let mut command = Command::cargo_bin("axiscal").unwrap();
    command.current_dir(folder);
    command
}

/// Each control, and the file of its small program.
const EACH: [(&str, &str); 5] = [
    ("linuxcnc", "small.ngc"),
    ("fanuc", "small.nc"),
    ("haas", "small.nc"),
    ("sinumerik", "small.mpf"),
    ("heidenhain", "small.h"),
];

/// A folder with a small program for a control.
fn folder(controller: &str) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("small.toml"), edits::SMALL).unwrap();
    axiscal(folder.path())
        .args([
            "generate",
            "--machine",
            "swivel-head",
            "--program",
            "small.toml",
            "--out",
            ".",
            "--controller",
            controller,
        ])
        .assert()
        .success()
        .stderr(predicate::str::contains("not checked").not());
    folder
}

fn check(folder: &Path, controller: &str, file: &str) -> Command {
    let mut command = axiscal(folder);
    command.args(["check", file, "--machine", "swivel-head", "--controller", controller]);
    command
}

/// Changes the first place; the number of its line.
fn edited(folder: &Path, file: &str, from: &str, to: &str) -> usize {
    let text = std::fs::read_to_string(folder.join(file)).unwrap();
    let edited = text.replacen(from, to, 1);
    assert_ne!(text, edited);
    std::fs::write(folder.join(file), edited).unwrap();
    text[..text.find(from).unwrap()].lines().count()
}

#[test]
fn exit_code_0_where_nothing_is_wrong() {
    for (controller, file) in
        [("linuxcnc", "small.ngc"), ("fanuc", "small.nc"), ("haas", "small.nc"), ("heidenhain", "small.h")]
    {
        let folder = folder(controller);
        let clean = || predicate::str::contains("3 touches").and(predicate::str::contains("nothing is wrong with it"));
        check(folder.path(), controller, file).assert().code(0).stdout(clean());
        check(folder.path(), controller, file).args(["--plan", "small.plan.json"]).assert().code(0).stdout(clean());
        let plan = std::fs::read_to_string(folder.path().join("small.plan.json")).unwrap();
        assert!(plan.contains(&format!("\"{controller}\"")), "the plan remembers what was proven");
    }
}

#[test]
fn exit_code_1_where_something_is_wrong() {
    let folder = folder("heidenhain");
    // the call of the move stands behind what it is given
    let line = edited(folder.path(), "small.h", "FN 0: Q1653 = +11.3", "FN 0: Q1653 = +1.13");
    let with_plan = |json: bool| {
        let mut command = check(folder.path(), "heidenhain", "small.h");
        command.args(["--plan", "small.plan.json"]).args(json.then_some("--json"));
        command
    };
    with_plan(false)
        .assert()
        .code(1)
        .stderr(predicate::str::contains(format!("small.h:{line}:")).and(predicate::str::contains("collision")))
        .stdout(predicate::str::contains("do not run it"));
    let output = with_plan(true).assert().code(1).get_output().stdout.clone();
    let answer: serde_json::Value = serde_json::from_slice(&output).unwrap();
    assert_eq!((&answer["good"], &answer["format"]), (&false.into(), &"axiscal-check/1".into()));
    let findings = answer["findings"].as_array().unwrap();
    assert!(findings.iter().any(|f| f["code"] == "check::collision" && f["line"] == line + 1), "{findings:#?}");
    assert!(findings.iter().any(|f| f["code"] == "check::changed"));
}

#[test]
fn a_program_that_begins_later_must_be_meant_so() {
    let folder = folder("heidenhain");
    edited(folder.path(), "small.h", "Q1600 = +1", "Q1600 = +2");
    let later = |from: &str| {
        let mut command = check(folder.path(), "heidenhain", "small.h");
        command.args(["--plan", "small.plan.json", "--from", from]);
        command
    };
    later("1").assert().code(1).stderr(predicate::str::contains("begins at set-up 2"));
    later("2").assert().code(0);
    later("7").assert().code(1).stderr(predicate::str::contains("there is no set-up 7: the program has 2"));
    edited(folder.path(), "small.h", "Q1600 = +2", "Q1600 = +7");
    later("7").assert().code(1).stderr(predicate::str::contains("the program begins at set-up 7: the program has 2"));
}

#[test]
fn exit_code_2_where_it_cannot_be_said() {
    let folder = folder("heidenhain");
    let path = folder.path();
    let fails = |command: &mut Command, says: &str| {
        command.assert().code(2).stderr(predicate::str::contains(says));
    };
    // what the grammar does not know, with its place
    let written = std::fs::read_to_string(path.join("small.h")).unwrap();
    let line = edited(path, "small.h", "PLANE RESET STAY", "PLANE RESET TURN");
    fails(&mut check(path, "heidenhain", "small.h"), &format!("small.h:{line}:"));
    fails(&mut check(path, "heidenhain", "small.h"), "error: PLANE RESET TURN is not known to axiscal");
    std::fs::write(path.join("small.h"), &written).unwrap();
    // a mask is a part of the program
    edited(path, "SMALL_P.A", "%10.4LF", "%10.4lf");
    fails(&mut check(path, "heidenhain", "small.h"), "SMALL_P.A:2:");
    std::fs::rename(path.join("SMALL_P.A"), path.join("away")).unwrap();
    fails(&mut check(path, "heidenhain", "small.h"), "the mask SMALL_P.A does not lie beside the program");
    std::fs::rename(path.join("away"), path.join("SMALL_P.A")).unwrap();
    edited(path, "SMALL_P.A", "%10.4lf", "%10.4LF");
    // another control's grammar
    fails(&mut check(path, "linuxcnc", "small.h"), "not understood");
    // files that cannot be read
    fails(&mut check(path, "heidenhain", "none.h"), "none.h");
    fails(&mut check(path, "heidenhain", "."), "");
    std::fs::write(path.join("bytes.h"), [0xff, 0xfe, 0x00]).unwrap();
    fails(&mut check(path, "heidenhain", "bytes.h"), "bytes.h");
    fails(check(path, "heidenhain", "small.h").args(["--plan", "none.json"]), "none.json");
    fails(check(path, "heidenhain", "small.h").args(["--plan", "small.toml"]), "small.toml");
    // calls that are unusable
    fails(&mut check(path, "nobody", "small.h"), "no controller is called");
    fails(check(path, "heidenhain", "small.h").args(["--from", "x"]), "--from");
    fails(axiscal(path).args(["check", "small.h"]), "--controller");
    fails(check(path, "heidenhain", "small.h").args(["--mounting", "nowhere"]), "nowhere");
    fails(
        axiscal(path).args([
            "check",
            "small.h",
            "--machine",
            "trunnion",
            "--controller",
            "heidenhain",
            "--plan",
            "small.plan.json",
        ]),
        "swivel-head",
    );
}

/// A plan that does not hold the program of this controller: that nothing is compared is said, and codes can be looked up.
#[test]
fn a_plan_without_the_program_is_said() {
    let folder = folder("linuxcnc");
    let path = folder.path().join("small.plan.json");
    let mut plan: serde_json::Value = serde_json::from_str(&std::fs::read_to_string(&path).unwrap()).unwrap();
    let programs = plan.as_object_mut().unwrap().remove("programs").unwrap();
    let mut with = |programs: Option<serde_json::Value>, says: &str| {
        programs.into_iter().for_each(|p| plan["programs"] = p);
        std::fs::write(&path, serde_json::to_string_pretty(&plan).unwrap()).unwrap();
        check(folder.path(), "linuxcnc", "small.ngc")
            .args(["--plan", "small.plan.json"])
            .assert()
            .code(0)
            .stderr(predicate::str::contains(says))
            .stdout(predicate::str::contains("check::older_plan (1)"));
    };
    with(None, "the plan is of an older version");
    let of_fanuc = serde_json::json!({ "fanuc": programs["linuxcnc"] });
    with(Some(of_fanuc), "the plan does not hold the program of linuxcnc, but of fanuc");
}

/// Another O number than the settings' harms nothing and is a remark; that of a macro that the program calls, or one that the control does
/// not have, is refused, by `generate` too.
#[test]
fn a_program_has_the_number_that_its_settings_say() {
    let name = "fanuc-inspection-plus";
    let folder = folder(name);
    let at = folder.path();
    let text = std::fs::read_to_string(at.join("small.nc")).unwrap();
    let check = |number: &str| {
        std::fs::write(at.join("edited.nc"), text.replacen("O9100", number, 1)).unwrap();
        axiscal(at)
            .args(["check", "edited.nc", "--machine", "swivel-head", "--controller", name, "--plan", "small.plan.json"])
            .assert()
    };
    check("O9100").success();
    check("O9111").success().stderr(predicate::str::contains("O9111"));
    // that of a program that it calls
    check("O9101").failure().stderr(predicate::str::contains("two programs have the number 9101"));
    for number in ["O9810", "O0", "O123456789"] {
        check(number).failure().stderr(predicate::str::contains(number));
    }
    let file = |number: &str| {
        format!(
            "format = \"axiscal-postprocessor/1\"\nbased_on = {name:?}\nname = \"mine\"\n[settings]\nprogram_number = {number:?}\n"
        )
    };
    for (number, says) in
        [("9810", "macro that the program calls"), ("0", "1 to 9999"), ("12345", "1 to 9999"), ("X", "1 to 9999")]
    {
        std::fs::write(at.join("mine.toml"), file(number)).unwrap();
        axiscal(at)
            .args(["generate", "--machine", "swivel-head", "--program", "small.toml", "--out", "mine", "--controller"])
            .arg("mine.toml")
            .assert()
            .code(2)
            .stderr(predicate::str::contains("program_number").and(predicate::str::contains(says)));
    }
}

/// LinuxCNC: a name in brackets is as it stands, and nothing but blank lines stands before the first %.
#[test]
fn what_linuxcnc_itself_refuses_is_refused() {
    let folder = folder("linuxcnc");
    let at = folder.path();
    let text = std::fs::read_to_string(at.join("small.ngc")).unwrap();
    let check = |edited: String| {
        assert_ne!(edited, text);
        std::fs::write(at.join("edited.ngc"), edited).unwrap();
        check(at, "linuxcnc", "edited.ngc").assert()
    };
    for (from, to, place) in [
        ("\no40 endif", "\no<040> endif", ""),
        ("\no2 if", "\no<02> if", ""),
        ("\no2 endif", "\no<0002> endif", ""),
        ("%\n", "(a remark)\n%\n", ":2:1"),
        ("%\n", "N10\n%\n", ":2:1"),
        ("%\n", "\u{feff}%\n", ":1:1"),
    ] {
        check(text.replacen(from, to, 1)).code(2).stderr(predicate::str::contains(format!("edited.ngc{place}")));
    }
    // a subroutine that is not in the program is a file of the control
    check(text.replacen("\no<axiscal> call", "\no<0axiscal> call", 1)).code(1);
    for (from, to) in [
        ("\no40 endif", "\nO<40> ENDIF"),
        ("\no40 endif", "\no040 endif"),
        ("\no<axiscal> call", "\no<AXISCAL> call"),
        ("%\n", "\n \t\n%\n"),
    ] {
        check(text.replacen(from, to, 1)).code(0);
    }
}

/// A byte order mark is no part of a program, on any control, nor of a mask beside it.
#[test]
fn a_byte_order_mark_is_refused() {
    for (controller, file) in [
        ("linuxcnc", "small.ngc"),
        ("fanuc", "small.nc"),
        ("haas", "small.nc"),
        ("sinumerik", "small.mpf"),
        ("heidenhain", "small.h"),
        ("heidenhain", "SMALL_P.A"),
    ] {
        let folder = folder(controller);
        let marked = std::fs::read_to_string(folder.path().join(file)).unwrap();
        std::fs::write(folder.path().join(file), format!("\u{feff}{marked}")).unwrap();
        let program = if controller == "heidenhain" { "small.h" } else { file };
        check(folder.path(), controller, program).assert().code(2).stderr(
            predicate::str::contains(format!("{file}:1:1: error"))
                .and(predicate::str::contains("byte order mark").and(predicate::str::contains("save it"))),
        );
    }
}

/// A program that moves before it has stopped the spindle, without a plan that would say so.
#[test]
fn the_spindle_is_stopped_before_anything_moves() {
    for (controller, file) in EACH {
        let folder = folder(controller);
        let text = std::fs::read_to_string(folder.path().join(file)).unwrap();
        let stops = |line: &str| {
            let words = line.trim_start_matches(|c: char| c.is_ascii_digit()).trim_start();
            words.split_whitespace().next().is_some_and(|w| w == "M5" || w == "M19" || w.starts_with("SPOS"))
        };
        let without = |only_the_first: bool| {
            let mut seen = 0;
            let line = |line: &str| {
                seen += usize::from(stops(line));
                match line.trim_end() {
                    kept if !stops(line) || (only_the_first && seen > 1) => kept.to_owned(),
                    "M5 M9" => "M9".to_owned(),
                    // block numbers run on: a remark keeps its own
                    gone => gone
                        .split_once(' ')
                        .filter(|_| controller == "heidenhain")
                        .map_or(String::new(), |(n, words)| format!("{n} ;{words}")),
                }
            };
            let edited: String = text.lines().map(line).map(|line| line + "\n").collect();
            std::fs::write(folder.path().join(file), edited).unwrap();
            check(folder.path(), controller, file)
                .assert()
                .code(1)
                .stderr(predicate::str::contains("before it has stopped the spindle"))
                .stdout(predicate::str::contains("check::start"));
        };
        without(false);
        without(true);
    }
}

/// A probe that the postprocessor file switches on is on before the first search, with a plan or without; what switches it is
/// no function of the control's own.
#[test]
fn a_probe_is_switched_on_before_it_searches() {
    for (controller, file) in EACH {
        let folder = folder(controller);
        let with = |on: &str| {
            let post = format!(
                "format = \"axiscal-postprocessor/1\"\nbased_on = \"{controller}\"\nname = \"own\"\n[settings]\nprobe_on = \"{on}\"\nprobe_off = \"M102\"\n"
            );
            std::fs::write(folder.path().join("own.toml"), post).unwrap();
            let mut generate = axiscal(folder.path());
            generate.args(["generate", "--machine", "swivel-head", "--program", "small.toml", "--out", "."]);
            generate.args(["--controller", "./own.toml"]);
            generate.assert()
        };
        with("M101").success();
        check(folder.path(), "./own.toml", file).assert().code(0);
        edited(folder.path(), file, "M101", "M102");
        check(folder.path(), "./own.toml", file)
            .assert()
            .code(1)
            .stderr(predicate::str::contains("before M101 has switched the probe on"))
            .stdout(predicate::str::contains("check::start"));
        // a spindle that is started is no probe that is switched on
        with("M3").code(2);
    }
}

/// The cause stands first: what the control stops at, not what follows from it.
#[test]
fn the_cause_stands_before_what_follows_from_it() {
    let folder = folder("fanuc");
    edited(folder.path(), "small.nc", "\nM9\n", "\nM98 P1000\n");
    // without its plan, what reaches beyond the program is named before anything is run
    for plan in [&[][..], &["--plan", "small.plan.json"]] {
        let output = check(folder.path(), "fanuc", "small.nc").args(plan).arg("--json").assert().code(1);
        let answer: serde_json::Value = serde_json::from_slice(&output.get_output().stdout).unwrap();
        let codes: Vec<&str> =
            answer["findings"].as_array().unwrap().iter().map(|f| f["code"].as_str().unwrap()).collect();
        // with its plan the line that was edited is named before what the control says to it
        let first: &[&str] =
            if plan.is_empty() { &["check::foreign_program"] } else { &["check::changed", "check::not_run"] };
        assert!(codes.starts_with(first), "{codes:?}");
        assert!(!codes.contains(&"check::log"), "{codes:?}");
    }
}

/// There is no set-up 0, and the name that a program gives itself is that of its file.
#[test]
fn set_up_0_and_other_names_are_said() {
    let folder = folder("heidenhain");
    let at = folder.path();
    check(at, "heidenhain", "small.h")
        .args(["--from", "0"])
        .assert()
        .code(2)
        .stderr(predicate::str::contains("--from"));
    let named = || predicate::str::contains("BEGIN PGM");
    check(at, "heidenhain", "small.h").assert().code(0).stderr(named().not());
    let text = std::fs::read_to_string(at.join("small.h")).unwrap();
    std::fs::write(at.join("small.h"), text.replace(" PGM SMALL ", " PGM OTHER ")).unwrap();
    check(at, "heidenhain", "small.h").assert().code(0).stderr(named().and(predicate::str::contains("small.h:1:")));
}

/// One letter for the controller, wherever a verb takes one.
#[test]
fn the_controller_has_one_letter_everywhere() {
    let folder = folder("fanuc");
    let run = |args: &[&str]| axiscal(folder.path()).args(args).args(["-c", "fanuc"]).assert().code(0);
    run(&["check", "small.nc", "-m", "swivel-head"]);
    run(&["simulate", "-m", "swivel-head", "--plan", "small.plan.json", "--out", "small.log"]);
    run(&["parse", "small.log", "--plan", "small.plan.json"]);
}

/// Where another block or stylus is mounted on the way, or the control's own transformation acts, a program without its plan is
/// not judged at all rather than with faults that are none.
#[test]
fn what_only_a_plan_says_needs_it() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("stop.toml"), STOPS).unwrap();
    for (controller, ending) in
        [("linuxcnc", "ngc"), ("fanuc", "nc"), ("haas", "nc"), ("sinumerik", "mpf"), ("heidenhain", "h")]
    {
        let judged = |machine: &str, program: &str, more: &[&str], says: &str| {
            let at = folder.path().join(controller);
            let args = ["generate", "--machine", machine, "--program", program, "--controller", controller, "--out"];
            axiscal(folder.path()).args(args).arg(&at).args(more).assert().success();
            let name = program.strip_suffix(".toml").unwrap_or(program);
            let check = || {
                let mut command = axiscal(&at);
                command.args(["check", &format!("{name}.{ending}"), "--machine", machine, "--controller", controller]);
                command
            };
            let place = predicate::str::is_match(format!(r"{name}\.{ending}:\d+:\d+: error: ")).unwrap();
            let said = place.and(predicate::str::contains(says)).and(predicate::str::contains("add --plan"));
            check().assert().code(2).stderr(said);
            check().args(["--plan", &format!("{name}.plan.json")]).assert().code(0);
        };
        judged("swivel-head", "stop.toml", &[], "waits, between two touches, for a person");
        judged("trunnion", "basic", &["--tcp"], "the control's own transformation");
    }
}

/// One touch, a stop at which the stylus is changed, and one with the other stylus.
const STOPS: &str = r#"
format   = "axiscal-programs/1"
name     = "stop"
says     = "a stylus is changed"
mounting = "head"
faces_in = "machine"
[[grid]]
name  = "S1"
u     = [0.0]
depth = [3.0]
[[stage]]
name = "own"
[[stage.setup]]
pose   = { B = 0.0, C = 0.0 }
blocks = ["x+"]
touch  = [ { faces = ["+X"], grid = "S1" } ]
[[stage]]
name   = "long"
stylus = "long"
[[stage.setup]]
pose   = { B = 0.0, C = 0.0 }
blocks = ["x+"]
touch  = [ { faces = ["+X"], grid = "S1" } ]
"#;

/// What breaks a probe needs no plan to be seen: a rapid that leaves a face, a search that goes on past the overtravel, one
/// that is too fast.
#[test]
fn a_rough_touch_is_refused_without_a_plan() {
    let edits = [
        (
            "fanuc",
            "O9101.nc",
            "G1 X[#4+#12*#14] Y[#5+#12*#15] Z[#6+#12*#16] F300.",
            "G0 X[#4+#12*#14] Y[#5+#12*#15] Z[#6+#12*#16]",
            "a rapid leaves the face",
        ),
        (
            "haas",
            "O9101.nc",
            "G1 X[#4+#12*#14] Y[#5+#12*#15] Z[#6+#12*#16] F300.",
            "G0 X[#4+#12*#14] Y[#5+#12*#15] Z[#6+#12*#16]",
            "a rapid leaves the face",
        ),
        (
            "sinumerik",
            "AXC_TOUCH.spf",
            "G1 SUPA X=AXT_SX+AXT_BACK*AXT_DX Y=AXT_SY+AXT_BACK*AXT_DY Z=AXT_SZ+AXT_BACK*AXT_DZ F=300",
            "G0 SUPA X=AXT_SX+AXT_BACK*AXT_DX Y=AXT_SY+AXT_BACK*AXT_DY Z=AXT_SZ+AXT_BACK*AXT_DZ",
            "a rapid leaves the face",
        ),
        ("fanuc", "small.nc", "Z6. D2. F60.", "Z4. D2. F60.", "pushed past its overtravel"),
        ("fanuc", "small.nc", "X-36. Y0. Z1.5 D2.", "X-33. Y0. Z1.5 D2.", "pushed past its overtravel"),
        ("haas", "small.nc", "Z6. D2. F60.", "Z4. D2. F60.", "pushed past its overtravel"),
        (
            "linuxcnc",
            "small.ngc",
            "o<touch> call [2] [2] [-36]",
            "o<touch> call [2] [2] [-33]",
            "pushed past its overtravel",
        ),
        ("sinumerik", "small.mpf", "-30,0,6,2,60", "-30,0,4,2,60", "pushed past its overtravel"),
        ("heidenhain", "small.h", "FN 0: Q1663 = -4", "FN 0: Q1663 = -6", "pushed past its overtravel"),
        ("fanuc", "small.nc", "Z1.5 D2. F300.", "Z1.5 D2. F900.", "fast_feed is 300"),
        ("sinumerik", "small.mpf", "-36,0,1.5,2,300", "-36,0,1.5,2,900", "fast_feed is 300"),
        ("heidenhain", "small.h", "FN 0: Q1665 = +300", "FN 0: Q1665 = +900", "fast_feed is 300"),
    ];
    for (controller, file, from, to, code) in edits {
        let folder = folder(controller);
        edited(folder.path(), file, from, to);
        let file = if file.starts_with("small") {
            file
        } else if controller == "sinumerik" {
            "small.mpf"
        } else {
            "small.nc"
        };
        let said = predicate::str::contains(code);
        check(folder.path(), controller, file).assert().code(1).stderr(said.clone());
        check(folder.path(), controller, file).args(["--plan", "small.plan.json"]).assert().code(1).stderr(said);
    }
}

/// Words of a control in inches are rounded to 2.5 um: gaps that were proven clear before that stay proven.
#[test]
fn what_an_inch_control_rounds_is_no_collision() {
    let folder = tempfile::tempdir().unwrap();
    let own = STOPS.split("[[stage]]").take(2).collect::<Vec<_>>().join("[[stage]]");
    let own = own.replace("B = 0.0", "B = [0.0, -90.0]").replace("[\"+X\"]", "[\"+X\", \"+Y\"]");
    std::fs::write(folder.path().join("stop.toml"), own).unwrap();
    for controller in ["fanuc", "haas"] {
        let file = format!(
            "format = \"axiscal-postprocessor/1\"\nbased_on = \"{controller}\"\nname = \"inch\"\n\
             [log]\nunit = \"inch\"\nsource = \"ours\"\n[number]\ndecimals = 4\nsource = \"ours\"\n"
        );
        std::fs::write(folder.path().join("inch.toml"), file).unwrap();
        let args = ["generate", "--machine", "swivel-head", "--program", "stop.toml", "--controller", "inch.toml"];
        axiscal(folder.path()).args(args).args(["--out", controller]).assert().success();
    }
}

/// A log of few digits under the control's transformation: three rounded words of a place may fall on one axis. The program of a sound
/// machine is written, and what is rounded away is found in the log and counted.
#[test]
fn few_digits_under_the_transformation() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    for (controller, lines) in [
        ("fanuc", "[log]\ndecimals = 3\nsource = \"ours\"\n"),
        ("sinumerik", "[log]\ndecimals = 3\nsource = \"ours\"\n"),
        (
            "fanuc",
            "[log]\nunit = \"inch\"\ndecimals = 4\nsource = \"ours\"\n[number]\ndecimals = 4\nsource = \"ours\"\n",
        ),
    ] {
        let file =
            format!("format = \"axiscal-postprocessor/1\"\nbased_on = \"{controller}\"\nname = \"ours\"\n{lines}");
        std::fs::write(at.join("ours.toml"), file).unwrap();
        let common = ["--machine", "trunnion", "--controller", "ours.toml"];
        let _ = std::fs::remove_dir_all(at.join("out"));
        axiscal(at)
            .arg("generate")
            .args(common)
            .args(["--program", "basic", "--tcp", "--out", "out"])
            .assert()
            .success();
        std::fs::write(at.join("wrong.toml"), "seed = 11\n[noise]\ntouch_um = 0.7\n").unwrap();
        let plan = ["--plan", "out/basic.plan.json"];
        for name in ["run.log", "study.toml"] {
            let _ = std::fs::remove_file(at.join(name));
        }
        axiscal(at)
            .arg("simulate")
            .args(common)
            .args(plan)
            .args(["--scenario", "wrong.toml", "--out", "run.log"])
            .assert()
            .success();
        let effects =
            ["--log", "run.log", "--effects", "location-a,location-c,block-setup,pretravel", "--out", "study.toml"];
        axiscal(at).arg("new").args(common).args(plan).args(effects).assert().success();
        let run = axiscal(at).args(["diagnose", "study.toml", "--json"]).assert().code(0);
        let answer: serde_json::Value = serde_json::from_slice(&run.get_output().stdout).unwrap();
        assert_eq!(answer["verdict"], "adequate", "{controller} {lines}");
        axiscal(at)
            .args(["identify", "study.toml", "--verbose"])
            .assert()
            .success()
            .stdout(predicate::str::contains("from the digits of the log"));
    }
}

/// A shop's own variant of LinuxCNC knows no more transformations than LinuxCNC does.
#[test]
fn a_variant_of_linuxcnc_has_its_transformations() {
    let folder = tempfile::tempdir().unwrap();
    let file = "format = \"axiscal-postprocessor/1\"\nbased_on = \"linuxcnc\"\nname = \"ours\"\n";
    std::fs::write(folder.path().join("ours.toml"), file).unwrap();
    let args = ["generate", "--machine", "swivel-head", "--program", "head", "--controller", "ours.toml", "--tcp"];
    axiscal(folder.path())
        .args(args)
        .args(["--out", "."])
        .assert()
        .code(2)
        .stderr(predicate::str::contains("under a transformation of LinuxCNC's own"));
}

/// The zero of a rotary axis need not be that of R: the opening turn has its sense all the same.
#[test]
fn a_rotary_axis_may_have_its_own_zero() {
    let folder = tempfile::tempdir().unwrap();
    let machines = include_str!("../../machines.toml");
    let (before, own) = machines.split_once("name = \"trunnion\"").unwrap();
    let own = own.replacen("C = 0.0 }", "C = -31.0 }", 1);
    std::fs::write(folder.path().join("ours.toml"), format!("{before}name = \"trunnion\"{own}")).unwrap();
    for (controller, _) in EACH {
        let args = ["generate", "--machine", "trunnion", "--machines", "ours.toml", "--program", "basic", "--out"];
        axiscal(folder.path()).args(args).args([controller, "--controller", controller]).assert().success();
    }
}
