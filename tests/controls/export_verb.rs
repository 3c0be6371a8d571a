//! `axiscal export` from outside: old values, units, refusals, and what stands in the files.

use crate::common;
use assert_cmd::Command;
use common::*;
use predicates::prelude::*;
use serde_json::Value;
use std::collections::BTreeMap;
use std::path::Path;

fn axiscal(at: &Path) -> Command {
    let mut command = Command::cargo_bin("axiscal").unwrap();
    command.current_dir(at).env("NO_COLOR", "1").env_remove("COLUMNS");
    command
}

/// A folder with a program measured under a scenario, and its study with these effects.
fn folder(machine_name: &str, program: &str, controller: &str, scenario: &str, effects: &str) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    std::fs::write(at.join("plan.json"), plan(&machine(machine_name), program).to_json()).unwrap();
    std::fs::write(at.join("wrong.toml"), scenario).unwrap();
    let common = ["--machine", machine_name, "--controller", controller, "--plan", "plan.json"];
    axiscal(at).arg("simulate").args(common).args(["--scenario", "wrong.toml", "--out", "run.log"]).assert().success();
    axiscal(at)
        .arg("new")
        .args(common)
        .args(["--log", "run.log", "--effects", effects, "--out", "study.toml"])
        .assert()
        .success();
    folder
}

/// Location errors of a trunnion, measured with noise.
const WRONG: &str = "seed = 3\n[effects.location-a]\nEY0A = 0.021\n[effects.location-c]\nEX0C = 0.013\nEB0C = 0.006\n[noise]\ntouch_um = 0.5\n";
const EFFECTS: &str = "location-a,location-c,block-setup,pretravel";

fn trunnion(controller: &str) -> tempfile::TempDir {
    folder("trunnion", "basic", controller, WRONG, EFFECTS)
}

/// `export` of the folder's study for a control.
fn export(at: &Path, controller: &str, out: &str, more: &[&str]) -> Command {
    let mut command = axiscal(at);
    command.args(["export", "study.toml", "--controller", controller, "--out", out]).args(more);
    command
}

fn json(mut command: Command) -> Value {
    let run = command.arg("--json").assert().success();
    serde_json::from_slice(&run.get_output().stdout).unwrap()
}

fn text(at: &Path, name: &str) -> String {
    std::fs::read_to_string(at.join(name)).unwrap()
}

fn backup(name: &str) -> String {
    text(Path::new(env!("CARGO_MANIFEST_DIR")), &format!("tests/tables/backups/{name}"))
}

/// `NAME=1.25 ; remark`: what a control would hold after such a file.
fn sinumerik(text: &str) -> BTreeMap<String, f64> {
    let value = |line: &str| {
        let (name, value) = line.split(';').next()?.split_once('=')?;
        let name = name.split_whitespace().last()?;
        Some((name.to_owned(), value.trim().replace("EX", "E").parse().ok()?))
    };
    text.lines().filter_map(value).collect()
}

/// `N19700Q1M0.1;`, `N19700Q1L1M0.1 `: unit letter and number.
fn fanuc(text: &str) -> BTreeMap<String, (char, f64)> {
    let value = |line: &str| {
        let (name, value) = line.trim().trim_end_matches(';').split_once("Q1")?;
        let value = value.strip_prefix("L1").unwrap_or(value);
        Some((name.to_owned(), (value.chars().next()?, value[1..].parse().ok()?)))
    };
    text.lines().filter_map(value).collect()
}

#[test]
fn old_values_come_from_the_backup_and_the_restoring_file_brings_them_back() {
    let folder = trunnion("sinumerik");
    let at = folder.path();
    std::fs::write(at.join("backup.ini"), backup("sinumerik.ini")).unwrap();
    let more = ["--accept-unverified", "--backup", "backup.ini", "--date", "2026-11-20"];
    let answer = json(export(at, "sinumerik", "comp", &more));
    let (old, new) = (sinumerik(&backup("sinumerik.ini")), sinumerik(&text(at, "comp/axiscal_trafo.ini")));
    let restoring = text(at, "comp/restore_trafo.ini");
    assert!(restoring.contains("RESTORES the values before") && !restoring.contains("ASSUMED"), "{restoring}");
    // what the control holds after both files is what it held
    let mut held = old.clone();
    for (name, value) in &new {
        assert!(held.insert(name.clone(), *value).is_some(), "{name} is in no backup");
    }
    assert_ne!(held, old);
    held.extend(sinumerik(&restoring));
    assert_eq!(held, old);
    // EY0A is 0.021 mm, against the machine's description: the program gave axis positions, on which the -0.2 and -250.05 of
    // the backup did not act; along A's line, in X, they stay
    let moved = |name: &str| new[name] - old[name];
    assert!((new["$MC_TRAFO5_BASE_TOOL_1[1]"] - 0.021).abs() < 0.001, "{new:?}");
    assert!((new["$MC_TRAFO5_BASE_TOOL_1[2]"] + 250.0).abs() < 0.002);
    assert!(moved("$MC_TRAFO5_BASE_TOOL_1[0]").abs() < 1e-9 && moved("$MC_TRAFO5_JOINT_OFFSET_1[2]").abs() < 1e-5);
    assert!(
        (moved("$MC_TRAFO5_BASE_TOOL_1[1]")
            + moved("$MC_TRAFO5_JOINT_OFFSET_1[1]")
            + moved("$MC_TRAFO5_PART_OFFSET_1[1]"))
        .abs()
            < 1e-9
    );
    assert_eq!(answer["values"].as_array().unwrap().len(), new.len());

    // the head of every file: study, its hash, the day of the data
    let hash_of = |out: &str| -> String {
        let record: Value = serde_json::from_str(&text(at, &format!("{out}/compensation.json"))).unwrap();
        record["study_sha256"].as_str().unwrap().to_owned()
    };
    let hash = hash_of("comp");
    assert!(hash.len() == 64 && hash.bytes().all(|b| b.is_ascii_hexdigit()), "{hash}");
    let files = answer["files"].as_array().unwrap();
    // the present values of the swivel data are not known: no file of theirs
    assert_eq!(files.len(), 4, "{files:?}");
    for name in files {
        let text = text(at, &format!("comp/{}", name.as_str().unwrap()));
        for word in ["study.toml", hash.as_str(), "2026-11-20", "trunnion"] {
            assert!(text.contains(word), "{name} lacks {word}");
        }
    }
    // without --date: the day of the log file
    export(at, "sinumerik", "comp", &more[..3]).assert().success();
    assert!(!text(at, "comp/axiscal_trafo.ini").contains("2026-11-20"));
    assert_eq!(hash_of("comp"), hash, "the same data");

    // the same by hand, value by value
    let mut by_hand = vec!["--accept-unverified".to_owned()];
    by_hand.extend(
        old.iter().filter(|(n, _)| new.contains_key(*n)).flat_map(|(n, v)| ["--old".to_owned(), format!("{n}={v}")]),
    );
    let words: Vec<&str> = by_hand.iter().map(String::as_str).collect();
    export(at, "sinumerik", "hand", &words).assert().success();
    assert_eq!(sinumerik(&text(at, "hand/axiscal_trafo.ini")), new);

    // another byte in the log is another hash
    let log = text(at, "run.log");
    std::fs::write(at.join("run.log"), log.replace('\n', "\r\n")).unwrap();
    export(at, "sinumerik", "none", &["--accept-unverified"]).assert().success();
    assert_ne!(hash_of("none"), hash);
}

/// What is loaded takes the place of what the control held: without the present values nothing to load is written.
#[test]
fn without_present_values_nothing_to_load_is_written() {
    let folder = trunnion("sinumerik");
    let at = folder.path();
    for control in ["sinumerik", "fanuc", "heidenhain", "haas"] {
        let answer = json(export(at, control, control, &["--accept-unverified"]));
        assert_eq!(answer["files"], serde_json::json!(["axiscal_changes.txt", "README.txt", "compensation.json"]));
        let values = answer["values"].as_array().unwrap();
        assert!(values.iter().all(|v| v["old"].is_null() && v["new"].is_null() && v["known"] == false), "{values:?}");
        let moved = values.iter().map(|v| v["change"].as_f64().unwrap());
        assert!(moved.into_iter().any(|change| (change - 0.021).abs() < 0.0015), "{control}: {values:?}");
        assert!(answer["changes"].as_array().unwrap().iter().all(|c| c["change"] != 0.0), "{answer}");
        // the record is enough for the virtual machine, and for the study of the next measurement
        let log = format!("{control}.log");
        let compensation = format!("{control}/compensation.json");
        let common = ["--machine", "trunnion", "--controller", control, "--plan", "tcp.plan.json"];
        let mut tcp = plan(&machine("trunnion"), "basic");
        tcp.controller_frame = axiscal::program::plan::ControllerFrame::Tcp;
        std::fs::write(at.join("tcp.plan.json"), tcp.to_json()).unwrap();
        axiscal(at)
            .arg("simulate")
            .args(common)
            .args(["--scenario", "wrong.toml", "--compensation", &compensation, "--out", &log])
            .assert()
            .success();
        let study = format!("{control}.toml");
        axiscal(at)
            .arg("new")
            .args(common)
            .args(["--log", &log, "--compensation", &compensation, "--effects", EFFECTS, "--out", &study])
            .assert()
            .success();
        let run = axiscal(at).args(["identify", &study, "--json"]).assert().success();
        let fit: Value = serde_json::from_slice(&run.get_output().stdout).unwrap();
        let found = fit["parameters"].as_array().unwrap();
        // a tilt of C, which some of them cannot hold, leaves its share in the other offsets
        let left = found.iter().find(|p| p["name"] == "EY0A").unwrap()["value"].as_f64().unwrap();
        assert!(left.abs() < 0.003, "{control}: {left}");
        // a sheet is no present value: the next export still gives changes
        let out = format!("{control}-again");
        let mut again = axiscal(at);
        again.args(["export", &study, "--controller", control, "--out", &out, "--accept-unverified", "--json"]);
        let run = again.assert().success();
        let answer: Value = serde_json::from_slice(&run.get_output().stdout).unwrap();
        assert!(answer["values"].as_array().unwrap().iter().all(|v| v["new"].is_null()), "{answer}");
    }
}

/// LinuxCNC: a component's pins are all that there is; what stands in the INI file is added to.
#[test]
fn linuxcnc_adds_to_what_the_ini_holds() {
    let scenario = "seed = 3\n[effects.zero-a]\nEA0A = 0.03\n[effects.scale-x]\nEXX = 60\n[effects.location-a]\nEY0A = 0.013\n[noise]\ntouch_um = 0.5\n";
    // without tilts of C, one of which is A's zero position
    let effects = "location-a,zero-a,scale-x,block-setup,pretravel";
    let folder = folder("trunnion", "full", "linuxcnc", scenario, effects);
    let at = folder.path();
    let files = |answer: &Value| -> Vec<String> {
        answer["files"].as_array().unwrap().iter().map(|f| f.as_str().unwrap().to_owned()).collect()
    };
    let without = json(export(at, "linuxcnc", "without", &[]));
    let names = files(&without);
    assert!(names.contains(&"axiscal.hal".to_owned()) && names.contains(&"restore.hal".to_owned()), "{names:?}");
    for file in ["axiscal_comp_x.txt", "stock/axiscal.hal", "stock/restore.hal", "stock/axiscal_comp_x.txt"] {
        assert!(!names.contains(&file.to_owned()), "{file}: {names:?}");
    }
    let ini = |name: &str| {
        let own = text(at, name);
        own.lines().filter(|l| !l.starts_with('#')).map(str::to_owned).collect::<Vec<_>>().join("\n")
    };
    for name in ["without/stock/axiscal.ini", "without/restore.ini", "without/stock/restore.ini"] {
        for word in ["HOME_OFFSET", "COMP_FILE"] {
            assert!(!ini(name).contains(word), "{name}: {}", ini(name));
        }
    }
    assert!(!ini("without/restore.ini").contains("KINEMATICS"));
    let changes = without["changes"].as_array().unwrap();
    let of = |word: &str| changes.iter().find(|c| c["name"].as_str().unwrap().contains(word));
    assert!((of("y-rot-point").unwrap()["change"].as_f64().unwrap() - 0.013).abs() < 0.002, "{changes:?}");
    assert!(of("HOME_OFFSET").is_some() && of("compensation of X at -300 mm").is_some(), "{changes:?}");

    std::fs::write(
        at.join("own.ini"),
        "[KINS]\nKINEMATICS = trivkins coordinates=XYZAC\nJOINTS = 5\n[TRAJ]\nCOORDINATES = XYZAC\nLINEAR_UNITS = mm\n[JOINT_3]\nTYPE = ANGULAR\nHOME_OFFSET = 12.5\n[JOINT_4]\nTYPE = ANGULAR\n",
    )
    .unwrap();
    let with = json(export(at, "linuxcnc", "with", &["--ini", "own.ini"]));
    assert_eq!(with["changes"], serde_json::json!([]));
    let home: f64 = ini("with/stock/axiscal.ini")
        .lines()
        .filter_map(|l| l.strip_prefix("HOME_OFFSET = ")?.parse().ok())
        .find(|v: &f64| (v - 12.5).abs() < 0.1)
        .unwrap();
    assert!(((home - 12.5).abs() - 0.03).abs() < 0.005, "{home}");
    assert!(ini("with/stock/restore.ini").contains("HOME_OFFSET = 12.5"));
    for file in ["axiscal_comp_x.txt", "stock/axiscal.hal", "stock/restore.hal"] {
        assert!(files(&with).contains(&file.to_owned()), "{file}");
    }
    // the module in use has pins that no INI file holds
    let used = text(at, "own.ini").replace("trivkins", "xyzac-trt-kins");
    std::fs::write(at.join("used.ini"), used).unwrap();
    let used = json(export(at, "linuxcnc", "used", &["--ini", "used.ini"]));
    assert!(!files(&used).contains(&"stock/axiscal.hal".to_owned()), "{used}");
    assert!(used["changes"].as_array().unwrap().iter().all(|c| c["file"] == "stock/axiscal_changes.txt"));
    // given by hand they are added to, and the restoring file brings them back
    let pin = |folder: &str, file: &str, name: &str| -> Option<f64> {
        let lines = text(at, &format!("{folder}/stock/{file}.hal"));
        lines.lines().find_map(|l| l.strip_prefix(&format!("setp xyzac-trt-kins.{name} "))?.parse().ok())
    };
    let present = [("x-rot-point", 7.5), ("y-rot-point", -3.25), ("z-rot-point", -251.0), ("y-offset", 0.4)];
    let old: Vec<String> = present.iter().map(|(n, v)| format!("--old=xyzac-trt-kins.{n}={v}")).collect();
    let old: Vec<&str> = ["--ini", "used.ini"].into_iter().chain(old.iter().map(String::as_str)).collect();
    let given = json(export(at, "linuxcnc", "given", &old));
    assert_eq!(given["changes"], serde_json::json!([]));
    for (name, was) in present {
        let described = pin("with", "restore", name).unwrap();
        let change = pin("with", "axiscal", name).unwrap() - described;
        assert_eq!(pin("given", "restore", name), Some(was), "{name}");
        assert!((pin("given", "axiscal", name).unwrap() - was - change).abs() < 1e-9, "{name}");
    }
    assert_eq!(pin("given", "axiscal", "tool-offset"), None);
    // the virtual machine has the described machine's pins: the same change
    let record = |folder: &str| -> Value {
        serde_json::from_str(&text(at, &format!("{folder}/stock/compensation.json"))).unwrap()
    };
    assert_eq!(record("given")["stock"]["pins"], record("with")["stock"]["pins"]);
    // what lacks a pin, or is none, or has another kinematics in use is refused with its code
    let refused: [(&[&str], &str); 4] = [
        (&["--ini", "used.ini", "--old", "xyzac-trt-kins.x-offset=0"], "tables::old_pins"),
        (&["--ini", "used.ini", "--old", "xyzac-trt-kins.rot-point=0"], "export::old"),
        (&["--ini", "used.ini", "--old", "xyzac-trt-kins.x-rot-point=1e308"], "export::backup_range"),
        (&[&["--ini", "own.ini"], &old[2..]].concat(), "tables::old_pins"),
    ];
    for (more, code) in refused {
        let run = export(at, "linuxcnc", "refused", &[more, &["--json"]].concat()).assert().code(2);
        let answer: Value = serde_json::from_slice(&run.get_output().stdout).unwrap();
        assert_eq!(answer["findings"][0]["code"], code, "{more:?}: {answer}");
        assert!(!at.join("refused").exists());
    }
}

#[test]
fn old_values_by_hand_are_checked() {
    let folder = trunnion("sinumerik");
    let at = folder.path();
    let name = "$MC_TRAFO5_BASE_TOOL_1[1]";
    std::fs::write(at.join("backup.ini"), backup("sinumerik.ini")).unwrap();
    std::fs::write(at.join("empty.ini"), "; nothing\n").unwrap();
    std::fs::write(at.join("twice.ini"), format!("{name}=1\n{name}=2\n")).unwrap();
    let of = |value: &str| format!("{name}={value}");
    let cases: [(&[&str], &str); 8] = [
        (&["--old", name], "there is no ="),
        (&["--old", "$MC_OTHER=1"], "no such value is written"),
        (&["--old", &of("1,5")], "that is no number"),
        (&["--old", &of("inf")], "that is no number"),
        (&["--old", &of("1"), "--old", &of("1")], "it is given twice"),
        (&["--backup", "backup.ini", "--old", &of("1")], "it is given twice"),
        (&["--backup", "empty.ini"], "none of the values"),
        (&["--backup", "twice.ini"], "twice.ini:2:1: error: $MC_TRAFO5_BASE_TOOL_1[1] stands twice: 1 and 2"),
    ];
    for (more, says) in cases {
        let all = [&["--accept-unverified"][..], more].concat();
        let run = export(at, "sinumerik", "comp", &all).assert().code(2);
        let said = String::from_utf8_lossy(&run.get_output().stderr).split_whitespace().collect::<Vec<_>>().join(" ");
        assert!(said.contains(says), "{more:?}: {said}");
        assert!(!at.join("comp").exists());
    }
    // a place 3 mm away is another machine's
    export(at, "sinumerik", "comp", &["--accept-unverified", "--old", &of("3")])
        .assert()
        .code(2)
        .stderr(predicate::str::contains("--force"));
    // LinuxCNC has its own
    for more in [&["--backup", "backup.ini"][..], &["--unit", "inch"]] {
        export(at, "linuxcnc", "comp", more).assert().code(2).stderr(predicate::str::contains("--ini"));
    }
    export(at, "sinumerik", "comp", &["--ini", "backup.ini"])
        .assert()
        .code(2)
        .stderr(predicate::str::contains("--backup"));
}

/// A component that is in use acted on the touches: where the study does not name its compensation, its values would be lost.
#[test]
fn a_component_in_use_is_not_written_over() {
    let folder = trunnion("linuxcnc");
    let at = folder.path();
    let ini = "[KINS]\nKINEMATICS = axiscal_trunnion_kins coordinates=XYZAC\nJOINTS = 5\n[TRAJ]\nCOORDINATES = XYZAC\n";
    std::fs::write(at.join("machine.ini"), ini).unwrap();
    let run = export(at, "linuxcnc", "comp", &["--ini", "machine.ini", "--json"]).assert().code(2);
    let refused: Value = serde_json::from_slice(&run.get_output().stdout).unwrap();
    assert_eq!(refused["findings"][0]["code"], "tables::component_in_use", "{refused}");
    assert!(!at.join("comp").exists());
    let forced = json(export(at, "linuxcnc", "comp", &["--ini", "machine.ini", "--force"]));
    assert!(!forced["files"].as_array().unwrap().is_empty());
    // whoever loads it is told
    let record: Value = serde_json::from_str(&text(at, "comp/compensation.json")).unwrap();
    assert!(record["forced"].as_array().unwrap().iter().any(|f| f.as_str().unwrap().contains("axiscal_trunnion_kins")));
}

/// JOINTS, letters and joint types of an INI file that contradict each other: the zero of A would go to a linear joint.
#[test]
fn an_ini_that_contradicts_itself_is_refused() {
    let folder = trunnion("linuxcnc");
    let at = folder.path();
    let ini = "[KINS]\nKINEMATICS = xyzac-trt-kins\nJOINTS = 6\n[TRAJ]\nCOORDINATES = XYZAC\nLINEAR_UNITS = mm\n\
               [JOINT_3]\nTYPE = LINEAR\nHOME_OFFSET = 12.0\n[JOINT_4]\nTYPE = ANGULAR\nHOME_OFFSET = 1.25\n";
    std::fs::write(at.join("machine.ini"), ini).unwrap();
    let refused = export(at, "linuxcnc", "comp", &["--ini", "machine.ini"]).assert().code(2);
    refused.stderr(
        predicate::str::contains("machine.ini:3:1: error:").and(predicate::str::contains("machine.ini:8:1: error:")),
    );
    assert!(!at.join("comp").exists());
    let good = ini.replace("JOINTS = 6", "JOINTS = 5").replacen("LINEAR\nHOME", "ANGULAR\nHOME", 1);
    std::fs::write(at.join("machine.ini"), good).unwrap();
    export(at, "linuxcnc", "comp", &["--ini", "machine.ini"]).assert().success();
}

/// The version of LinuxCNC: 2.9 unless it is said, by `--target` or in a file; the direction pin is set where there is one.
#[test]
fn linuxcnc_is_written_for_its_version() {
    let folder = trunnion("linuxcnc");
    let at = folder.path();
    let mine = "format = \"axiscal-postprocessor/1\"\nbased_on = \"linuxcnc\"\nname = \"mine\"\n[settings]\nversion = \"master\"\n";
    std::fs::write(at.join("mine.toml"), mine).unwrap();
    // another kinematics in use: no pin of the stock module holds anything that would be added to
    let own = "[KINS]\nKINEMATICS = trivkins coordinates=XYZAC\nJOINTS = 5\n[TRAJ]\nCOORDINATES = XYZAC\nLINEAR_UNITS = mm\n\
               [JOINT_3]\nTYPE = ANGULAR\n[JOINT_4]\nTYPE = ANGULAR\n";
    std::fs::write(at.join("own.ini"), own).unwrap();
    for (n, (controller, more, version)) in [
        ("linuxcnc", &[][..], "2.9"),
        ("linuxcnc", &["--target", "master"], "master"),
        ("./mine.toml", &[], "master"),
        ("./mine.toml", &["--target", "2.9"], "2.9"),
    ]
    .into_iter()
    .enumerate()
    {
        let out = format!("comp{n}");
        let answer = json(export(at, controller, &out, &[more, &["--ini", "own.ini"]].concat()));
        assert_eq!(answer["version"], version);
        let record: Value = serde_json::from_str(&text(at, &format!("{out}/stock/compensation.json"))).unwrap();
        assert_eq!(record["stock"]["version"], version);
        let pin = "setp xyzac-trt-kins.conventional-directions 0";
        for file in ["axiscal.hal", "restore.hal"] {
            let hal = text(at, &format!("{out}/stock/{file}"));
            assert_eq!(hal.lines().any(|l| l == pin), version == "master", "{hal}");
            assert_eq!(hal.lines().filter(|l| l.starts_with("setp")).count(), 7 + usize::from(version == "master"));
        }
    }
    let unknown = export(at, "linuxcnc", "comp9", &["--target", "2.8"]).assert().code(2);
    unknown.stderr(predicate::str::contains("2.9, master"));
    export(at, "haas", "comp9", &["--target", "2.9", "--accept-unverified"]).assert().code(2);
}

#[test]
fn what_nobody_has_verified_is_written_only_when_it_is_accepted() {
    let folder = trunnion("fanuc");
    let at = folder.path();
    for control in ["fanuc", "heidenhain", "haas"] {
        let refused = export(at, control, "comp", &[]).assert().code(2);
        refused.stderr(predicate::str::contains("not verified").and(predicate::str::contains("--accept-unverified")));
        assert!(!at.join("comp").exists(), "{control}");
        export(at, control, control, &["--accept-unverified"])
            .assert()
            .success()
            .stderr(predicate::str::contains("not verified"));
        assert!(text(at, &format!("{control}/README.txt")).contains("NOT VERIFIED on a real control"), "{control}");
    }
    // what every entry of has its page for needs nothing: SINUMERIK's kinds P and T
    export(at, "sinumerik", "sinumerik", &[]).assert().success();
    let folder = self::folder(
        "double-head",
        "double-head",
        "sinumerik",
        "seed = 1\n[effects.location-a]\nEY0A = 0.02\n[noise]\ntouch_um = 0.5\n",
        "location-b,location-a,block-setup,pretravel",
    );
    export(folder.path(), "sinumerik", "comp", &[]).assert().success();
}

#[test]
fn the_unit_of_the_table_is_the_user_s() {
    let folder = trunnion("fanuc");
    let at = folder.path();
    std::fs::write(at.join("backup.txt"), backup("fanuc.txt")).unwrap();
    let more = ["--accept-unverified", "--backup", "backup.txt"];
    export(at, "fanuc", "mm", &more).assert().success();
    export(at, "fanuc", "inch", &[&more[..], &["--unit", "inch"]].concat()).assert().success();
    let (old, mm, inch) = (
        fanuc(&backup("fanuc.txt")),
        fanuc(&text(at, "mm/axiscal_parameters.txt")),
        fanuc(&text(at, "inch/axiscal_parameters.txt")),
    );
    assert_eq!(mm.keys().collect::<Vec<_>>(), inch.keys().collect::<Vec<_>>());
    assert_eq!(mm.len(), 6);
    for (name, (letter, value)) in &mm {
        let (other, inches) = inch[name];
        assert_eq!((*letter, other), ('M', 'I'), "{name}");
        // half a step of each table: 0.5 um, 0.00005 in
        assert!((value - inches * 25.4).abs() < 0.5e-3 + 0.5e-4 * 25.4 + 1e-9, "{name}: {value} mm, {inches} in");
    }
    assert!((mm["N19701"].1 - 0.021).abs() < 0.0015, "{mm:?}");
    // to go back: the old values as they were, whatever the unit of the new ones
    for folder in ["mm", "inch"] {
        let back = fanuc(&text(at, &format!("{folder}/restore_parameters.txt")));
        assert!(back.len() == mm.len() && back.iter().all(|(name, value)| old[name] == *value), "{folder}: {back:?}");
    }
    assert!(text(at, "inch/axiscal_g10.nc").contains("G20") && text(at, "mm/axiscal_g10.nc").contains("G21"));
    export(at, "fanuc", "x", &["--unit", "furlong"]).assert().code(2);
}

/// Controls without a file that a user writes: the sheet is the record of what was entered, and serves as the backup.
#[test]
fn a_worksheet_serves_as_the_backup_of_the_next_export() {
    let folder = trunnion("haas");
    let at = folder.path();
    let sheet = |name: &str| -> BTreeMap<String, f64> {
        let value = |line: &str| {
            let (name, value) = line.split(';').next()?.split_once('=')?;
            Some((name.trim().to_owned(), value.trim().parse().ok()?))
        };
        text(at, name).lines().filter_map(value).collect()
    };
    for control in ["haas", "heidenhain"] {
        let [one, two] = ["one", "two"].map(|n| format!("{control}-{n}"));
        std::fs::write(at.join("held.txt"), held(control)).unwrap();
        let first = json(export(at, control, &one, &["--accept-unverified", "--backup", "held.txt"]));
        let entered = format!("{one}/axiscal_worksheet.txt");
        let more = ["--accept-unverified", "--backup", entered.as_str()];
        // of the same study they are the new values: what was identified would be added twice
        let twice = export(at, control, &two, &more).assert().code(2);
        twice.stderr(predicates::str::contains("written by an export of this study"));
        // the study of the next measurement
        std::fs::write(at.join("study.toml"), text(at, "study.toml") + "# measured again\n").unwrap();
        let second = json(export(at, control, &two, &more));
        assert_eq!(first["values"].as_array().unwrap().len(), second["values"].as_array().unwrap().len());
        let (was, back) = (sheet(&entered), sheet(&format!("{two}/restore_worksheet.txt")));
        assert!(was.len() >= 6 && was == back, "{control}: {was:?} {back:?}");
        // a program of axis positions shows the same error again, whatever was entered: it is no sum
        let again = sheet(&format!("{two}/axiscal_worksheet.txt"));
        let old = sheet(&format!("{one}/restore_worksheet.txt"));
        for (name, value) in &was {
            assert!((again[name] - value).abs() < 1.1e-4, "{control} {name}: {} instead of {value}", again[name]);
        }
        assert!(was.iter().any(|(name, value)| (value - old[name]).abs() > 0.01), "{control}: {was:?}");
    }
}

/// What a control with a worksheet holds, where it is set as the trunnion is described.
fn held(control: &str) -> String {
    let names: Vec<String> = match control {
        "haas" => (300..306).map(|n| format!("SETTING {n}")).collect(),
        _ => ["FIRST", "SECOND"]
            .iter()
            .flat_map(|axis| ["X", "Y", "Z"].map(|c| format!("{axis} TABLE AXIS {c}")))
            .collect(),
    };
    let value = |n: usize| if n == 2 || (n == 5 && control == "haas") { -250.0 } else { 0.0 };
    names.iter().enumerate().map(|(n, name)| format!("{name} = {:.4}\n", value(n))).collect()
}

/// A model that does not fit is no compensation where what is missing makes a value wrong by more than its tolerance.
#[test]
fn a_bad_verdict_refuses_what_would_be_wrong_by_more_than_its_tolerance() {
    let missing = "seed = 4\n[effects.radial-c-2]\nEXC2c = 9.0\nEYC2s = -8.0\n[noise]\ntouch_um = 0.5\n";
    // seven teeth of the turntable's ring: nothing in the catalogue has seven periods
    let teeth = "seed = 6\n[[harmonic]]\naxis = \"C\"\ndof = \"rz\"\nk = 7\ncos_urad = 160.0\nsin_urad = -90.0\n[noise]\ntouch_um = 1.0\n";
    for (scenario, verdict) in [(missing, "missing-effect"), (teeth, "unexplained")] {
        let folder = folder("swivel-head", "full", "linuxcnc", scenario, "location-b,location-c,block-setup,pretravel");
        let at = folder.path();
        let study = text(at, "study.toml");
        // the amount is in the answer; within the tolerance it is a remark
        std::fs::write(at.join("study.toml"), format!("{study}\n[tolerance]\nerror_um = 1000\n")).unwrap();
        let answer = json(export(at, "linuxcnc", "wide", &[]));
        let worst = &answer["could_be_wrong"][0];
        let (off, tolerance) = (worst["off"].as_f64().unwrap(), worst["tolerance"].as_f64().unwrap());
        assert!(off > 0.0 && off < tolerance && !worst["because"].as_str().unwrap().is_empty(), "{answer}");
        let um = worst["off_um"].as_f64().unwrap();
        std::fs::write(at.join("study.toml"), format!("{study}\n[tolerance]\nerror_um = {}\n", um / 2.0)).unwrap();
        for control in ["linuxcnc", "sinumerik"] {
            let says = format!("the diagnosis is {verdict}");
            let refused = export(at, control, "comp", &["--accept-unverified"]).assert().code(2);
            refused.stderr(predicate::str::contains(says.as_str()).and(predicate::str::contains("--force")));
            assert!(!at.join("comp").exists(), "{control}");
        }
        export(at, "linuxcnc", "comp", &["--force"])
            .assert()
            .success()
            .stderr(predicate::str::contains(format!("the diagnosis is {verdict}")));
        // whoever loads them did not see the screen
        for name in ["comp/README.txt", "comp/compensation.json"] {
            assert!(text(at, name).contains(&format!("the diagnosis is {verdict}")), "{name}");
        }
        assert!(text(at, "comp/axiscal.hal").contains("FORCED, 1 finding spoke against it"));
    }
}

/// A pattern as large as the noise, and planted values that are found: the consequence is a fraction of a micrometre, so that it is
/// a remark. What is said to be the most is at least what is really wrong.
#[test]
fn a_weak_pattern_is_a_remark() {
    let scenario =
        WRONG.replace("seed = 3", "seed = 5").replace("[noise]", "[effects.radial-c-2]\nEXC2c = 0.5\n[noise]");
    let folder = folder("trunnion", "full", "linuxcnc", &scenario, EFFECTS);
    let at = folder.path();
    let run = axiscal(at).args(["diagnose", "study.toml", "--json"]).output().unwrap();
    let found: Value = serde_json::from_slice(&run.stdout).unwrap();
    assert_ne!(found["verdict"], "adequate", "{found}");
    let ratio = found["rms_um"].as_f64().unwrap() / found["noise_um"].as_f64().unwrap();
    assert!(ratio < 1.2, "{ratio}");
    let answer = json(export(at, "linuxcnc", "comp", &[]));
    let doubts = answer["could_be_wrong"].as_array().unwrap();
    assert!(!doubts.is_empty() && doubts.iter().all(|d| d["off_um"].as_f64().unwrap() < 1.0), "{doubts:?}");
    let planted = BTreeMap::from([("EY0A", 0.021), ("EX0C", 0.013), ("EB0C", 0.006)]);
    for term in answer["terms"].as_array().unwrap() {
        let name = term["parameter"].as_str().unwrap();
        let off = (term["identified"].as_f64().unwrap() - planted.get(name).copied().unwrap_or(0.0)).abs();
        let sigma = term["sigma"].as_f64().unwrap();
        let said = doubts.iter().find(|d| d["parameter"] == name).map_or(0.0, |d| d["off"].as_f64().unwrap());
        assert!(off <= said + 4.0 * sigma, "{name}: {off} off, said {said}, sigma {sigma}");
    }
}

/// The command that report and workbench suggest runs as it stands, whatever the control.
#[test]
fn the_suggested_command_runs_as_it_stands() {
    let controls = [("sinumerik", false), ("fanuc", true), ("heidenhain", true), ("haas", true), ("linuxcnc", false)];
    for (control, accepts) in controls {
        let folder = trunnion(control);
        let at = folder.path();
        axiscal(at).args(["report", "study.toml", "--out", "r.html", "--view", "v.json"]).assert().success();
        let view: Value = serde_json::from_str(&text(at, "v.json")).unwrap();
        let next = view["next"].as_array().unwrap();
        let suggested = next.iter().find(|n| n["command"].as_str().unwrap().starts_with("axiscal export")).unwrap();
        let words: Vec<&str> = suggested["command"].as_str().unwrap().split_whitespace().skip(1).collect();
        assert_eq!(words.contains(&"--accept-unverified"), accepts, "{control}: {words:?}");
        // and a sentence says what that accepts
        assert_eq!(suggested["how"].as_str().unwrap().contains("--accept-unverified"), accepts, "{suggested}");
        axiscal(at).args(&words).assert().success();
        assert!(at.join("compensation/compensation.json").exists(), "{control}");
    }
}

#[test]
fn values_beyond_the_limit_are_refused() {
    let large = "seed = 1\n[effects.location-c]\nEX0C = 0.62\n[noise]\ntouch_um = 0.5\n";
    let folder = folder("trunnion", "basic", "fanuc", large, EFFECTS);
    let at = folder.path();
    export(at, "fanuc", "comp", &["--accept-unverified"])
        .assert()
        .code(2)
        .stderr(predicate::str::contains("above the limit of 0.5 mm").and(predicate::str::contains("--force")));
    assert!(!at.join("comp").exists());
    export(at, "fanuc", "comp", &["--accept-unverified", "--force"])
        .assert()
        .success()
        .stderr(predicate::str::contains("above the limit of 0.5 mm"));
    let record: Value = serde_json::from_str(&text(at, "comp/compensation.json")).unwrap();
    assert!((record["tables"]["changes"]["N19703"].as_f64().unwrap() - 0.62).abs() < 0.002);
}

#[test]
fn a_restoring_file_is_not_written_over() {
    let folder = trunnion("sinumerik");
    let at = folder.path();
    std::fs::write(at.join("backup.ini"), backup("sinumerik.ini")).unwrap();
    export(at, "sinumerik", "comp", &["--accept-unverified", "--backup", "backup.ini"]).assert().success();
    let restoring = text(at, "comp/restore_trafo.ini");
    export(at, "sinumerik", "comp", &["--accept-unverified"])
        .assert()
        .code(2)
        .stderr(predicate::str::contains("restore_trafo.ini of an earlier export holds other values"));
    assert_eq!(text(at, "comp/restore_trafo.ini"), restoring);
    // the same values again, and what is forced
    export(at, "sinumerik", "comp", &["--accept-unverified", "--backup", "backup.ini"]).assert().success();
    export(at, "sinumerik", "comp", &["--accept-unverified", "--force"]).assert().success();
}

#[test]
fn a_restoring_worksheet_shows_the_way_back() {
    let folder = trunnion("heidenhain");
    let at = folder.path();
    std::fs::write(at.join("held.txt"), held("heidenhain")).unwrap();
    export(at, "heidenhain", "comp", &["--accept-unverified", "--backup", "held.txt"]).assert().success();
    let changes = |name: &str| -> Vec<f64> {
        let change = |line: &str| line.split("change ").nth(1)?.split([';', ' ']).next()?.trim().parse().ok();
        text(at, name).lines().filter_map(change).collect()
    };
    let names: Vec<String> = std::fs::read_dir(at.join("comp"))
        .unwrap()
        .map(|e| format!("comp/{}", e.unwrap().file_name().to_string_lossy()))
        .filter(|n| n.contains("worksheet"))
        .collect();
    let (back, there): (Vec<_>, Vec<_>) = names.iter().partition(|n| n.contains("restore"));
    let (back, there) = (changes(back[0]), changes(there[0]));
    assert!(there.iter().any(|c| c.abs() > 0.01), "{there:?}");
    assert_eq!(back.len(), there.len());
    assert!(back.iter().zip(&there).all(|(b, t)| (b + t).abs() < 1e-9), "{back:?} {there:?}");
}

#[test]
fn a_position_table_that_is_in_use_is_not_written_over() {
    let scenario = "seed = 5\n[effects.scale-x]\nEXX = 60\n[noise]\ntouch_um = 0.5\n";
    let folder = folder("swivel-head", "head", "sinumerik", scenario, "location-b,scale-x,block-setup,pretravel");
    let at = folder.path();
    std::fs::write(at.join("used.ini"), "$AN_CEC[0,0]=0.05\n$AN_CEC[0,1]=0.07\nM17\n").unwrap();
    let more = ["--accept-unverified", "--force", "--backup", "used.ini"];
    export(at, "sinumerik", "none", &more[..1]).assert().success();
    assert!(!at.join("none/axiscal_cec.ini").exists() && !at.join("none/restore_cec.ini").exists());
    assert!(text(at, "none/axiscal_changes.txt").contains("$AN_CEC[0,0]"));
    // the table is not in use: that is a present value, and the vectors are still not known
    let alone = [more[0], "--old", "$AN_CEC[0,0]=0"];
    let answer = json(export(at, "sinumerik", "alone", &alone));
    assert!(at.join("alone/axiscal_cec.ini").exists() && !at.join("alone/axiscal_trafo.ini").exists(), "{answer}");
    export(at, "sinumerik", "forced", &more)
        .assert()
        .success()
        .stderr(predicate::str::contains("position table 0 of the control is in use: $AN_CEC[0,0] = 0.05"));
    let quiet = [more[0], more[2], more[3]];
    export(at, "sinumerik", "used", &quiet).assert().code(2).stderr(predicate::str::contains("is in use"));
    std::fs::write(at.join("used.ini"), "$AN_CEC[0,0]=0\n$AN_CEC[0,1]=0\nM17\n").unwrap();
    export(at, "sinumerik", "free", &quiet).assert().success();
    assert!(!text(at, "free/restore_cec.ini").contains("ASSUMED"));
}

/// The program `head` does not touch what C carries: nothing of C is known, and nothing of it is written.
#[test]
fn only_what_was_identified_is_written() {
    let scenario =
        "seed = 2\n[effects.location-b]\nEX0B = 0.03\n[effects.location-c]\nEX0C = 0.05\n[noise]\ntouch_um = 0.5\n";
    let folder = folder("swivel-head", "head", "sinumerik", scenario, "location-b,location-c,block-setup,pretravel");
    let at = folder.path();
    let answer = json(export(at, "sinumerik", "comp", &["--accept-unverified"]));
    let terms: Vec<&str> =
        answer["terms"].as_array().unwrap().iter().map(|t| t["parameter"].as_str().unwrap()).collect();
    assert!(terms.contains(&"EX0B") && !terms.iter().any(|t| t.ends_with("0C")), "{terms:?}");
    let readme = text(at, "comp/README.txt");
    for name in ["EX0C", "EY0C", "EA0C", "EB0C"] {
        assert!(
            readme.contains(&format!("Not exported: {name} (location-c): these touches cannot determine it")),
            "{readme}"
        );
    }
    // the table axis stays where the description has it, but for the shift that the head's own offset makes in X
    let record: Value = serde_json::from_str(&text(at, "comp/compensation.json")).unwrap();
    let change = |name: &str| record["tables"]["changes"][name].as_f64().unwrap_or(0.0);
    assert!(change("$MC_TRAFO5_JOINT_OFFSET_PART_1[1]").abs() < 1e-3, "{record}");
    assert_eq!(change("$MC_TRAFO5_AXIS2_1[2]"), 0.0);
}

/// A turntable without ends: LinuxCNC has no table that repeats every turn, and 256 rows over 55 turns would be 78 deg apart.
/// What goes two and three times a turn must be gone after the export, and what the rows leave must be stated.
#[test]
fn rows_of_an_endless_axis_hold_what_goes_several_times_a_turn() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    for name in ["endless.toml", "program.toml", "wrong.toml"] {
        let text = text(Path::new(env!("CARGO_MANIFEST_DIR")), &format!("tests/tables/endless/{name}"));
        std::fs::write(at.join(name), text).unwrap();
    }
    let machine = ["--machine", "endless", "--machines", "endless.toml"];
    let plan = ["--plan", "job/turn.plan.json"];
    let effects = "location-a,location-c,positioning-c-1,positioning-c-2,positioning-c-3,block-setup,pretravel";
    let run = |verb: &str, more: &[&str]| {
        axiscal(at).arg(verb).args(machine).args(more).assert().success();
    };
    run("generate", &["--program", "program.toml", "--controller", "linuxcnc", "--out", "job"]);
    run("simulate", &[&plan[..], &["--scenario", "wrong.toml", "--out", "run.log"]].concat());
    run("new", &[&plan[..], &["--log", "run.log", "--effects", effects, "--out", "study.toml"]].concat());

    let answer = json(export(at, "linuxcnc", "comp", &[]));
    let [said] = answer["table_errors"].as_array().unwrap().as_slice() else { panic!("{answer}") };
    assert_eq!((said["input"].as_str(), said["output"].as_str()), (Some("C"), Some("C")));
    let um = |key: &str| said[key].as_f64().unwrap();
    assert!(um("correction_um") > 30.0 && um("interpolation_um") < 0.1 && um("rounding_um") < 1e-3, "{said}");
    // the rows cover the turns in use, and what the end values leave elsewhere is said
    assert!(said["range"][0].as_f64().unwrap() <= -360.0 && said["range"][1].as_f64().unwrap() >= 360.0, "{said}");
    assert!(um("beyond_um") > 10.0, "{said}");
    for way in ["comp/compensation.json", "comp/stock/compensation.json"] {
        let record: Value = serde_json::from_str(&text(at, way)).unwrap();
        assert_eq!(record["table_errors"], answer["table_errors"]);
    }

    // measured again with it
    let comp = ["--compensation", "comp"];
    run("simulate", &[&plan[..], &comp[..], &["--scenario", "wrong.toml", "--out", "after.log"]].concat());
    run("new", &[&plan[..], &comp[..], &["--log", "after.log", "--effects", effects, "--out", "after.toml"]].concat());
    let mut identify = axiscal(at);
    identify.args(["identify", "after.toml", "--quick"]);
    let fit = json(identify);
    let value = |name: &str| {
        let found = fit["parameters"].as_array().unwrap().iter().find(|p| p["name"] == name).unwrap();
        (found["value"].as_f64().unwrap(), found["sigma"].as_f64().unwrap())
    };
    for (name, planted) in [("ECC2c", 200.0), ("ECC3s", 150.0)] {
        let (urad, sigma) = value(name);
        assert!(urad.abs() < 5.0 * sigma && urad.abs() < 0.1 * planted, "{name}: {urad} +- {sigma} urad");
    }
}
