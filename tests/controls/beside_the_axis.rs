//! The loop by its verbs on machines whose axes do not meet, or have no end: what is exported makes the machine right.

use crate::common;
use common::verbs::ok;
use serde_json::Value;
use std::path::Path;

/// What a verb answers with `--json`.
fn answer(at: &Path, words: &str) -> Value {
    let words: Vec<&str> = words.split_whitespace().chain(["--json"]).collect();
    serde_json::from_str(&ok(at, &words)).unwrap()
}

/// A machine, a program for it, what is wrong with it, and the effects of its model.
struct Case<'a> {
    machine: &'a str,
    program: &'a str,
    scenario: &'a str,
    model: &'a str,
}

impl Case<'_> {
    /// The error of the machine as it was built, and with its compensation, over the noise: measured against a model of the blocks alone.
    fn left(&self, at: &Path) -> (f64, f64) {
        let Self { machine, program, scenario, model } = self;
        std::fs::write(at.join("wrong.toml"), scenario).unwrap();
        answer(at, &format!("generate {machine} --program {program} --controller linuxcnc --out job"));
        let name = program.trim_end_matches(".toml");
        let plan = format!("job/{name}.plan.json");
        answer(at, &format!("simulate {machine} --plan {plan} --scenario wrong.toml --out before.log"));
        let study = |log: &str, more: &str, out: &str| {
            answer(at, &format!("new {machine} --plan {plan} --log {log} --out {out} --effects {more}"));
        };
        study("before.log", model, "study.toml");
        let exported = answer(at, "export study.toml --controller linuxcnc --out comp");
        assert!(!exported["files"].as_array().unwrap().is_empty(), "{exported}");
        answer(
            at,
            &format!("simulate {machine} --plan {plan} --scenario wrong.toml --compensation comp --out after.log"),
        );
        let blocks = "block-setup,pretravel";
        study("before.log", blocks, "b.toml");
        study("after.log", blocks, "a.toml");
        let rms = |study: &str| answer(at, &format!("identify {study} --quick"))["rms_um"].as_f64().unwrap();
        (rms("b.toml"), rms("a.toml"))
    }
}

/// The line of C passes 35 mm and more beside the reference point: its zero turns about its own line.
#[test]
fn a_zero_position_is_one_about_the_line_of_the_axis() {
    for machine in ["nutating-b", "trunnion-offset"] {
        let folder = tempfile::tempdir().unwrap();
        let zero = if machine == "nutating-b" { "zero-b" } else { "zero-a" };
        let error = if machine == "nutating-b" { "EB0B" } else { "EA0A" };
        let case = Case {
            machine: &format!("--machine {machine}"),
            program: "basic",
            scenario: &format!("seed = 4\n[effects.{zero}]\n{error} = 0.02\n[noise]\ntouch_um = 0.5\nvisit_um = 0.0\n"),
            model: &format!("{zero},block-setup,pretravel"),
        };
        let (before, after) = case.left(folder.path());
        assert!(before > 2.0 && after < 0.6, "{machine}: {before} um, {after} um with the compensation");
    }
}

const TURNS: &str = r#"
format = "axiscal-programs/1"
name = "turn"
machine = "endless"
says = "C over two turns, A level and at both sides"
mounting = "table"
faces_in = "block"
[[grid]]
name = "top"
u = [-2.5, 2.5]
v = [-2.5, 2.5]
[[grid]]
name = "side"
u = [-2.5, 2.5]
depth = [3.5]
[[stage]]
name = "c"
[[stage.setup]]
pose = { A = 0.0, C = [-135.0, -45.0, 0.0, 45.0, 135.0, 180.0, 315.0, 450.0, 585.0] }
touch = [ { faces = ["+Z"], grid = "top" }, { faces = ["+X", "-X", "+Y", "-Y"], grid = "side" } ]
[[stage.setup]]
pose = { A = [-40.0, 40.0], C = [0.0, 90.0, 180.0] }
touch = [ { faces = ["+Z"], grid = "top" }, { faces = ["+X", "-X", "+Y", "-Y"], grid = "side" } ]
"#;

/// A table of an endless axis holds every turn that the program used.
#[test]
fn the_turns_in_use_are_in_the_table() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let built_in = axiscal::machine::BUILT_IN;
    let own = built_in.split("[[machine]]").find(|m| m.contains("name = \"trunnion\"\n")).unwrap();
    let own =
        own.replace("\"trunnion\"", "\"endless\"").replace("range = [-360.0, 360.0]", "range = [-9999.0, 9999.0]");
    std::fs::write(at.join("own.toml"), format!("format = \"axiscal-machines/1\"\n[[machine]]{own}")).unwrap();
    std::fs::write(at.join("turn.toml"), TURNS).unwrap();
    let case = Case {
        machine: "--machine endless --machines own.toml",
        program: "turn.toml",
        scenario: "seed = 2\n[effects.positioning-c-1]\nECC1c = 300.0\nECC1s = -200.0\n[effects.positioning-c-3]\nECC3s = 150.0\n[noise]\n\
                   touch_um = 0.5\nvisit_um = 0.0\n",
        model: "positioning-c-1,positioning-c-3,block-setup,pretravel",
    };
    let (before, after) = case.left(at);
    assert!(before > 3.0 && after < 0.6, "{before} um, {after} um with the compensation");
    let table = std::fs::read_to_string(at.join("comp/axiscal_comp_c.txt"))
        .or_else(|_| std::fs::read_to_string(at.join("comp/axiscal_changes.txt")))
        .unwrap();
    assert!(table.contains("720"), "{table}");
}

/// The files of a public case, beside what the verbs write.
fn public_case(files: &[(&str, &str)]) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    for (name, text) in files {
        std::fs::write(folder.path().join(name), text).unwrap();
    }
    folder
}

/// A fitted parameter: its value and its standard uncertainty.
fn fitted(fit: &Value, name: &str) -> (f64, f64) {
    let all = fit["parameters"].as_array().unwrap();
    let found = all.iter().find(|p| p["name"] == name).unwrap_or_else(|| panic!("no {name}: {fit}"));
    (found["value"].as_f64().unwrap(), found["sigma"].as_f64().unwrap())
}

/// Generate, simulate, identify, export; and the same with the compensation. Both fits.
fn around(at: &Path, machine: &str, effects: &str) -> (Value, Value) {
    let plan = "--plan job/turn.plan.json";
    answer(at, &format!("generate {machine} --program program.toml --controller linuxcnc --out job"));
    answer(at, &format!("simulate {machine} {plan} --scenario wrong.toml --out before.log"));
    answer(at, &format!("new {machine} {plan} --log before.log --effects {effects} --out study.toml"));
    answer(at, "export study.toml --controller linuxcnc --out comp");
    answer(at, &format!("simulate {machine} {plan} --scenario wrong.toml --compensation comp --out after.log"));
    answer(
        at,
        &format!("new {machine} {plan} --log after.log --compensation comp --effects {effects} --out after.toml"),
    );
    (answer(at, "identify study.toml --quick"), answer(at, "identify after.toml --quick"))
}

/// A public case: a trunnion whose C line is 35 mm beside the reference point. A turn of C is one about its own line, in the
/// virtual machine and in what is exported.
#[test]
fn the_case_of_an_axis_beside_the_pivot() {
    macro_rules! file {
        ($name:literal) => {
            ($name, include_str!(concat!("../beside_the_axis/axis-beside-pivot/", $name)))
        };
    }
    let folder =
        public_case(&[file!("machine.toml"), file!("program.toml"), file!("wrong.toml"), file!("only-c.toml")]);
    let at = folder.path();
    let machine = "--machine offset-trunnion --machines machine.toml";
    let effects = "location-a,location-c,positioning-c-1,block-setup,pretravel";
    let (before, after) = around(at, machine, effects);

    // 1 mrad at C = 0 moves each block by that times its distance from the line of C, which passes through y = 35
    let csv = "--controller csv --out only-c.csv";
    answer(at, &format!("simulate {machine} --plan job/turn.plan.json --scenario only-c.toml {csv}"));
    let plan: Value = serde_json::from_str(&std::fs::read_to_string(at.join("job/turn.plan.json")).unwrap()).unwrap();
    let log = std::fs::read_to_string(at.join("only-c.csv")).unwrap();
    let mut rows = log.lines().filter(|l| !l.starts_with('#')).map(|l| l.split(',').collect::<Vec<_>>());
    let head = rows.next().unwrap();
    let column = |name: &str| head.iter().position(|c| *c == name).unwrap();
    let (id, x) = (column("id"), column("X"));
    let mut seen = 0;
    for row in rows {
        let number: u64 = row[id].parse().unwrap();
        let touch = plan["touches"].as_array().unwrap().iter().find(|t| t["id"] == number).unwrap();
        let normal = touch["normal"][0].as_f64().unwrap();
        if touch["pose"]["A"] != 0.0 || touch["pose"]["C"] != 0.0 || normal.abs() != 1.0 {
            continue;
        }
        let y = match touch["block"].as_str().unwrap() {
            "x-" | "x+" => 35.0,
            "y-" => 5.0,
            "y+" => 65.0,
            other => panic!("{other}"),
        };
        let moved = row[x].parse::<f64>().unwrap() - touch["nominal"]["X"].as_f64().unwrap();
        // the touched point of a face is up to 2.5 mm beside the block's middle
        assert!((moved + 0.001 * (y - 35.0)).abs() < 0.006, "{touch}: moved by {moved}");
        seen += 1;
    }
    assert!(seen >= 4, "{seen} touches at C = 0");

    let rms = |fit: &Value| fit["rms_um"].as_f64().unwrap();
    assert!(rms(&before) < 0.85 && rms(&after) < 0.85, "{} um, {} um after", rms(&before), rms(&after));
    for (name, planted) in [("ECC1c", 300.0), ("ECC1s", -200.0)] {
        let (found, sigma) = fitted(&before, name);
        assert!((found - planted).abs() < 4.0 * sigma && sigma < 15.0, "{name}: {found} ± {sigma}");
        let (stays, sigma) = fitted(&after, name);
        assert!(stays.abs() < 4.0 * 2f64.sqrt() * sigma, "{name} after: {stays} ± {sigma}");
    }
    let diagnosis = answer(at, "diagnose after.toml");
    assert_eq!(diagnosis["verdict"], "adequate", "{diagnosis}");
}

/// A public case: C has no end, and its error goes three times a turn. The rows of its table are fine enough to carry that.
#[test]
fn the_case_of_a_table_for_an_endless_axis() {
    macro_rules! file {
        ($name:literal) => {
            ($name, include_str!(concat!("../beside_the_axis/endless-axis-table/", $name)))
        };
    }
    let folder = public_case(&[file!("endless.toml"), file!("program.toml"), file!("wrong.toml")]);
    let at = folder.path();
    let effects = "location-a,location-c,positioning-c-1,positioning-c-2,positioning-c-3,block-setup,pretravel";
    let (_, after) = around(at, "--machine endless --machines endless.toml", effects);
    for name in ["ECC1c", "ECC1s", "ECC2c", "ECC2s", "ECC3c", "ECC3s"] {
        let (stays, sigma) = fitted(&after, name);
        assert!(stays.abs() < 4.0 * 2f64.sqrt() * sigma && sigma < 15.0, "{name}: {stays} ± {sigma} urad stay");
    }
    assert!(after["rms_um"].as_f64().unwrap() < 0.85, "{} um", after["rms_um"]);
}
