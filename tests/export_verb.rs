//! `axiscal export` from outside: old values, units, refusals, and what stands in the files.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)] // a panic in a test is a failure with its place

mod common;
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

/// `N19700Q1M0.1;`: unit letter and number.
fn fanuc(text: &str) -> BTreeMap<String, (char, f64)> {
    let value = |line: &str| {
        let (name, value) = line.strip_suffix(';')?.split_once("Q1")?;
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
    assert!(moved("$MC_TRAFO5_BASE_TOOL_1[0]").abs() < 1e-9 && moved("$MC_TRAFO5_JOINT_OFFSET_PART_1[2]").abs() < 1e-5);
    assert!(
        (moved("$MC_TRAFO5_BASE_TOOL_1[1]")
            + moved("$MC_TRAFO5_JOINT_OFFSET_PART_1[1]")
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
    assert!(files.len() >= 6, "{files:?}");
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
    // without old values: said, and the restoring file says it too
    export(at, "sinumerik", "none", &["--accept-unverified"]).assert().success().stderr(
        predicate::str::contains("the control's old values are not known")
            .and(predicate::str::contains("--backup FILE")),
    );
    assert!(text(at, "none/restore_trafo.ini").contains("ASSUMED"));
    assert_ne!(hash_of("none"), hash);
    assert!(text(at, "none/README.txt").contains("NOT KNOWN: the control's old values"));
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
    for more in [&["--backup", "backup.ini"][..], &["--old", "X=1"], &["--unit", "inch"]] {
        export(at, "linuxcnc", "comp", more).assert().code(2).stderr(predicate::str::contains("--ini"));
    }
    export(at, "sinumerik", "comp", &["--ini", "backup.ini"])
        .assert()
        .code(2)
        .stderr(predicate::str::contains("--backup"));
}

#[test]
fn what_nobody_has_verified_is_written_only_when_it_is_accepted() {
    let folder = trunnion("fanuc");
    let at = folder.path();
    for control in ["sinumerik", "fanuc", "heidenhain", "haas"] {
        let refused = export(at, control, "comp", &[]).assert().code(2);
        refused.stderr(predicate::str::contains("not verified").and(predicate::str::contains("--accept-unverified")));
        assert!(!at.join("comp").exists(), "{control}");
        export(at, control, control, &["--accept-unverified"])
            .assert()
            .success()
            .stderr(predicate::str::contains("not verified"));
        assert!(text(at, &format!("{control}/README.txt")).contains("NOT VERIFIED on a real control"), "{control}");
    }
    // what every entry of has its page for needs nothing
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
        let first = json(export(at, control, &one, &["--accept-unverified"]));
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

/// A model that does not fit is no compensation.
#[test]
fn after_a_bad_verdict_nothing_is_written_unless_forced() {
    let missing = "seed = 4\n[effects.radial-c-2]\nEXC2c = 9.0\nEYC2s = -8.0\n[noise]\ntouch_um = 0.5\n";
    // seven teeth of the turntable's ring: nothing in the catalogue has seven periods
    let teeth = "seed = 6\n[[harmonic]]\naxis = \"C\"\ndof = \"rz\"\nk = 7\ncos_urad = 160.0\nsin_urad = -90.0\n[noise]\ntouch_um = 1.0\n";
    for (scenario, verdict) in [(missing, "missing-effect"), (teeth, "unexplained")] {
        let folder = folder("swivel-head", "full", "linuxcnc", scenario, "location-b,location-c,block-setup,pretravel");
        let at = folder.path();
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
    assert!((fanuc(&text(at, "comp/axiscal_parameters.txt"))["N19703"].1 - 0.62).abs() < 0.002);
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
    export(at, "heidenhain", "comp", &["--accept-unverified"]).assert().success();
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
    assert!(text(at, "none/restore_cec.ini").contains("ASSUMED"));
    let readme = text(at, "none/README.txt");
    assert!(readme.contains("Position table 0: X by the position of X") && readme.contains("is ASSUMED"), "{readme}");
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
        assert!(readme.contains(&format!("Not exported: {name} (location-c): the data cannot tell it")), "{readme}");
    }
    // the table axis stays where the description has it, but for the shift that the head's own offset makes in X
    let new = sinumerik(&text(at, "comp/axiscal_trafo.ini"));
    assert!(new["$MC_TRAFO5_JOINT_OFFSET_PART_1[1]"].abs() < 1e-3, "{new:?}");
    assert_eq!(new["$MC_TRAFO5_AXIS2_1[2]"], -1.0);
}
